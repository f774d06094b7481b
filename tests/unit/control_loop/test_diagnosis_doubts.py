"""What is off in the sensor itself widens what the effect of a firing leaves open."""

import pytest

from nutdamp.control_loop.law import Diagnosis, Doubt, Glimpse


def test_a_sensor_whose_scale_may_be_off_leaves_the_effect_open_by_that_share() -> None:
    before, after = (Glimpse(z, 50, 0j, 0j, 50.0, 1.0) for z in (0.02 + 0j, 0.019 + 0j))
    opens = []
    for scale in (0.0, 0.01):
        diagnosis = Diagnosis(period=6.0)
        doubt = Doubt(noise=1e-6, white=1e-6, least=0.0, lift=1.0, bias=0.0, steps=0.0, scale=scale)
        diagnosis.judge("T0", 10.0, before, after, -0.001 + 0j, doubt)
        opens.append(diagnosis.effects["T0"].open())
    assert opens[1] - opens[0] == pytest.approx(0.01 * 0.02 / 0.001, rel=1e-9)
