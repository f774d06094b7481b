"""Dispersed cases through real widths, against single flights."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import dispersed
from support.single_case import flown_outputs, realised

from nutdamp import flight
from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.flown import RealWidths, largest_nutation
from nutdamp.dispersion.outputs import measure
from nutdamp.dispersion.study import Study
from nutdamp.physics.arc_cones import arc_cones
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Disturbance

CASES = 40
MODELS = {
    "prolate": dispersed.with_jets(),
    "oblate, spin reversed": dispersed.steered(moments=(70.0, 70.0, 110.0), spin=-3.0),
    "three moments": dispersed.with_jets(moments=(120.0, 105.0, 80.0)),
    "three moments, oblate, spin reversed": dispersed.with_jets(moments=(80.0, 95.0, 120.0), spin=-2.0),
}


def disturbed() -> Model:
    model = MODELS["prolate"]
    body = replace(
        model.spacecraft,
        disturbances=(Disturbance(0.02 + 0.01j, 0.05), Disturbance(0.03 + 0.0j, rate=-3.0)),
        dissipation=400.0,
    )
    return Model(body, model.schedule)


SINKING = [dispersed.sinking(MODELS["prolate"]), dispersed.sinking(MODELS["oblate, spin reversed"], 5.0)]


@pytest.mark.parametrize(
    "model",
    [*MODELS.values(), disturbed(), *SINKING],
    ids=[*MODELS, "disturbances, dissipation", "prolate, dissipation", "oblate, dissipation"],
)
def test_each_case_is_the_flight_of_its_own_spacecraft(model: Model) -> None:
    draws = dispersed.first_cases(Study(model), CASES)
    found = np.empty((5, CASES))
    measure(model, RealWidths(model)(model.cases(draws)), found)
    for case in range(0, CASES, 3):
        one = dispersed.one_of(draws, case)
        assert found[:, case] == pytest.approx(flown_outputs(model, one), abs=1e-10, nan_ok=True)


def test_a_case_of_its_own_has_the_attitude_of_the_truth() -> None:
    model = MODELS["prolate"]
    true, _ = realised(model, {"attitude x": 0.02})
    before, after = model.spacecraft.initial.quaternion, true.initial.quaternion
    turned = 2.0 * math.acos(min(1.0, abs(float(before @ after))))
    assert turned == pytest.approx(0.02)


def test_largest_nutation_of_many_is_that_of_each() -> None:
    """Prolate, oblate and intermediate axes, small and large angles, motions over the separatrix, reversed spin."""
    generator = np.random.default_rng(12)
    moments = generator.uniform(50.0, 100.0, (3, 400))
    momentum = generator.normal(size=(3, 400)) * [[30.0], [30.0], [200.0]]
    momentum[:2, :20] *= 1e-7
    found = largest_nutation(moments, tuple(momentum), 1.0)
    for case in range(400):
        first, second, third = (float(moment) for moment in moments[:, case])
        expected = arc_cones((first, second, third), momentum[:, case] / moments[:, case], 1.0)
        assert found[case] == pytest.approx(expected.nutation, rel=1e-9, abs=1e-15), case


def test_a_schedule_without_pulses_flies() -> None:
    model = Model(MODELS["three moments"].spacecraft, Schedule())
    left = flight.flown(model.spacecraft, Schedule()).residual
    assert Study(model).outputs_of({})[0] == pytest.approx(left.nutation)
