"""Tracks for exchange: fine enough for whoever interpolates, in the axes of the file, without jumps of sign."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from support import messages

from nutdamp import flight
from nutdamp.files.frames import TURN, Stretch, stretches
from nutdamp.physics import attitude

pytestmark = pytest.mark.usefixtures("plans_shared")

CASES = pytest.mark.parametrize("case", messages.CASES)


def track(case: str) -> tuple[flight.Flight, list[Stretch]]:
    plan = messages.planned(case)
    until = plan.pulses.end + plan.spacecraft.inertial_period
    flown = flight.flown(plan.spacecraft, plan.pulses, until)
    return flown, list(stretches(flown, until))


@CASES
def test_records_are_close_and_continuous(case: str) -> None:
    flown, found = track(case)
    assert found[0].t[0] == 0.0
    assert found[-1].t[-1] == pytest.approx(flown.legs[-1].end, abs=0.51e-9)
    for one, two in pairwise(found):
        assert two.t[0] == pytest.approx(one.t[-1], abs=4e-9)
    quaternion = np.concatenate([stretch.quaternion for stretch in found])
    assert np.all(np.sum(quaternion[1:] * quaternion[:-1], axis=1) > 0.9)
    for stretch in found:
        assert len(stretch.t) >= 4
        assert np.all(np.diff(stretch.t) > 0.0)
        assert stretch.t.tolist() == (np.rint(stretch.t * 1e9) / 1e9).tolist()
        turns = np.linalg.norm(stretch.rates, axis=1)[1:] * np.diff(stretch.t)
        assert turns.max() <= 1.02 * TURN < math.radians(18.0)
    # Pulses completed as each stretch begins.
    ends = [pulse.end for pulse in flown.schedule]
    assert [stretch.completed for stretch in found] == [
        sum(end <= stretch.t[0] + 1e-9 for end in ends) for stretch in found
    ]


@CASES
def test_even_the_plainest_interpolation_stays_below_a_hundredth_of_a_degree(case: str) -> None:
    """One turn about a fixed axis from record to record, as readers do that look at quaternions only."""
    flown, found = track(case)
    worst = 0.0
    for stretch in found:
        middle = stretch.quaternion[1:] + stretch.quaternion[:-1]  # half of the turn
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        times = 0.5 * (stretch.t[1:] + stretch.t[:-1])
        leg = next(leg for leg in flown.legs if leg.start - 1e-9 <= stretch.t[0] and stretch.t[-1] <= leg.end + 1e-9)
        _, truth = leg.path.motion(times)
        for one, two in zip(middle, truth, strict=True):
            worst = max(worst, messages.turned(attitude.matrix(one), messages.columns(flown.spacecraft, two)))
    assert worst <= 0.01
