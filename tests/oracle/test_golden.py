"""Flights against golden.json, which the reference integrator made (make_golden.py)."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from make_golden import FILE, event, fly
from support import reference

from nutdamp import flight
from nutdamp.physics import attitude
from nutdamp.schedule import Pulse, Schedule
from nutdamp.spacecraft import Inertia, Spacecraft

GOLDEN: dict[str, dict[str, Any]] = json.loads(FILE.read_text(encoding="utf-8"))
TOLERANCE = 1e-10
"""rad, and relative for rates and H; the reference adds up a few 1e-12."""


def pulse(given: dict[str, Any]) -> Pulse:
    fired = event(given)
    if isinstance(fired, reference.Kick):
        return Pulse(fired.t, 0.0, "T", fired.impulse)
    on_time = fired.end - fired.start
    return Pulse(fired.start + 0.5 * on_time, on_time, "T", fired.torque * on_time, fired.torque)


@pytest.mark.parametrize("name", GOLDEN)
def test_flown(name: str) -> None:
    golden = GOLDEN[name]
    first, second, third = golden["moments_kgm2"]
    body = Spacecraft(name, Inertia((first, second, third)), np.array(golden["rates_rad_s"]))
    flown = flight.flown(body, Schedule(tuple(pulse(one) for one in golden["pulses"])))
    end = flown.settled
    size = float(np.linalg.norm(golden["end_rates_rad_s"]))
    assert end.rates == pytest.approx(golden["end_rates_rad_s"], abs=TOLERANCE * size)
    # Frame N of a body of three different moments is laid by the H of its equivalent symmetric one.
    start = attitude.matrix(body.initial.quaternion)
    to_n = reference.frame_n(golden["moments_kgm2"], body.omega0) @ start.T
    assert reference.turned(to_n @ attitude.matrix(end.quaternion), np.array(golden["end_rotation"])) < TOLERANCE
    h = to_n @ attitude.rotate(end.quaternion, end.rates * np.array(flown.moments))
    assert h == pytest.approx(golden["momentum_Nms"], abs=TOLERANCE * float(np.linalg.norm(h)))
    left = flown.residual
    assert left.momentum_shift == pytest.approx(golden["momentum_shift_rad"], abs=TOLERANCE)
    assert flown.sampled(2, flown.legs[-1].end).nutation[-1] == pytest.approx(golden["nutation_rad"], abs=TOLERANCE)
    assert left.space_cone + left.body_cone == pytest.approx(left.nutation, abs=1e-15 * math.pi)
    if body.inertia.symmetric:
        assert left.nutation == pytest.approx(golden["nutation_rad"], abs=TOLERANCE)
    else:  # the largest on the arc that follows
        assert left.nutation >= golden["nutation_rad"] - TOLERANCE


@pytest.mark.parametrize("name", ["prolate, wide pulses", "three different moments, coast and pulses"])
def test_the_script_makes_what_the_file_holds(name: str) -> None:
    """So that the script cannot rot."""
    for key, value in fly(GOLDEN[name]).items():
        assert np.array(GOLDEN[name][key]) == pytest.approx(np.array(value), abs=1e-9)
