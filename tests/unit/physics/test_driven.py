"""Symmetric bodies under torque, many steps at once, against DOP853 on Euler's equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support import reference
from support.cases import spread

from nutdamp.errors import Infeasible
from nutdamp.physics import attitude, driven, rigid, rigid_cases
from nutdamp.physics.rigid import Forcing

Array = NDArray[np.float64]
START = attitude.from_matrix(np.eye(3))
CLOSE = 2e-11
"""rad, rad/s; what DOP853 at 1e-13 a step adds up over a hundred radians."""
TURNING = ((2.0 - 1.5j, -1.7), (0.4 + 0.1j, 5.0))
CASES = {
    "prolate": ((120.0, 120.0, 80.0), (5.0, -3.0, 0.0), (0.1, -0.2, 3.0)),
    "oblate": ((80.0, 80.0, 120.0), (5.0, -3.0, 2.0), (0.4, 0.3, -2.0)),
    "sphere": ((100.0, 100.0, 100.0), (1.0, 8.0, -4.0), (0.1, 0.0, 1.0)),
    "spin reversed": ((120.0, 120.0, 80.0), (1.0, 2.0, -40.0), (0.05, 0.1, 6.0)),
    "from rest": ((120.0, 120.0, 80.0), (10.0, 5.0, 7.0), (0.0, 0.0, 0.0)),
}


def expected(
    moments: tuple[float, ...], torque: tuple[float, ...], rates: Array, times: Array, turning: bool
) -> tuple[Array, Array]:
    """Rates (n, 3) and quaternions (n, 4) of Euler's equations from 1.3 s on."""
    inertia = np.array(moments)

    def slope(time: float, state: Array) -> Array:
        omega, q = state[:3], state[3:]
        acting = np.array(torque)
        for size, rate in TURNING if turning else ():
            push = size * np.exp(1j * rate * time)
            acting = acting + np.array([push.real, push.imag, 0.0])
        change = (acting - np.cross(omega, inertia * omega)) / inertia
        return np.concatenate([change, 0.5 * attitude.multiply(q, np.array([0.0, *omega]))])

    start = np.concatenate([rates, START])
    found = solve_ivp(slope, (1.3, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-14)
    quaternion = found.y[3:].T
    return found.y[:3].T, quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)


@spread("turning", [False, True], quick=1, ids=["fixed", "turning"])
@spread(("moments", "torque", "rates"), CASES.values(), quick=1, ids=CASES)
def test_one_body_under_fixed_and_turning_torques(
    moments: tuple[float, float, float], torque: tuple[float, ...], rates: tuple[float, ...], turning: bool
) -> None:
    """At the ends of the steps and within them."""
    start, times = reference.vector(*rates), np.linspace(1.9, 21.3, 13)
    forcing = Forcing(TURNING if turning else ())
    pieces = rigid.integrate(moments, np.array(torque), start, START, 1.3, 21.3, forcing)
    speeds, quaternions = expected(moments, torque, start, times, turning)
    assert len(pieces) > 10
    for time, rate, quaternion in zip(times, speeds, quaternions, strict=True):
        piece = next(one for one in pieces if time <= one.start + one.duration)
        got, turned = piece.at(np.array([time]))
        assert got[0] == pytest.approx(rate, abs=CLOSE)
        assert turned[0] == pytest.approx(quaternion, abs=CLOSE)


@pytest.mark.parametrize("turning", [False, True], ids=["fixed", "turning"])
def test_few_cases_fly_as_each_alone_does(turning: bool) -> None:
    """Bodies, motions, torques, begins and durations of their own."""
    rng, count = np.random.default_rng(12), 7
    A = 100.0 * (1.0 + 0.2 * rng.normal(size=count))
    moments = np.array([A, A, 80.0 * (1.0 + 0.2 * rng.normal(size=count))])
    rates, torque = rng.normal(size=(3, count)), 20.0 * rng.normal(size=(3, count))
    now, duration = 2.0 * rng.random(count), 40.0 * rng.random(count)
    forcing = Forcing(TURNING if turning else ())
    got, turn = rates.copy(), np.repeat(START[:, None], count, axis=1)
    bodies = rigid_cases.Bodies(moments, np.zeros(3), forcing)
    rigid_cases.advance(rigid_cases.Stretch(bodies, now, got, turn, torque), duration)
    for case in range(count):
        one = tuple(moments[:, case].tolist())
        begin, end = float(now[case]), float(now[case] + duration[case])
        pieces = rigid.integrate((one[0], one[1], one[2]), torque[:, case], rates[:, case], START, begin, end, forcing)
        rate, quaternion = pieces[-1].final
        assert got[:, case] == pytest.approx(rate, abs=1e-12)
        assert turn[:, case] == pytest.approx(quaternion, abs=1e-12)


def test_steps_are_halved_where_the_torque_changes_faster_than_promised() -> None:
    """A sphere at rest, spun up by so much that its last turns are much faster than the first."""
    drive = driven.Drive(np.array([0.0]), np.array([0.3 + 0.1j]), np.array([0.0]))
    rest, none = np.zeros(1, dtype=complex), np.zeros(1)
    duration = np.array([40.0])
    made = list(driven.steps(drive, rest, none, none, duration, 1))
    assert made[0].duration[0] < 40.0 / driven.count_for(drive, rest, none, duration)
    assert sum(len(one.starts) * one.duration[0] for one in made) == pytest.approx(40.0)
    turn = driven.whole(np.concatenate([one.turn.sum(axis=0) for one in made], axis=1))
    angle = 0.5 * abs(0.3 + 0.1j) * 40.0**2  # about one axis: the turn is that of the angle
    assert turn[0, 0] == pytest.approx(math.cos(0.5 * angle), abs=1e-11)


def test_too_many_steps_are_refused() -> None:
    moments, rates = (120.0, 120.0, 80.0), reference.vector(0.1, 0.0, 3.0)
    with pytest.raises(Infeasible, match="takes too many steps"):
        rigid.integrate(moments, reference.vector(1, 0, 0), rates, START, 0.0, 100.0, most=20)
    with pytest.raises(Infeasible, match="runs over"):
        rigid.integrate(moments, reference.vector(1, 0, 0), rates, START, 0.0, 1e6)
