"""Euler's equations by series, torques fixed or turning, against DOP853, conservation laws and closed forms."""

import itertools
import math

import numpy as np
import pytest
from support import reference
from support.cases import spread
from support.golden import refused
from support.spinning import EPS, Triple, about, driven, turning

from nutdamp.errors import Infeasible
from nutdamp.physics import attitude, batch, taylor

FLOWN = 1e-11
"""rad, rad/s; what DOP853 at 1e-13 a step adds up over some tens of radians."""
START = attitude.from_matrix(np.eye(3))
TURNING = ((2.0 - 1.5j, -1.7), (0.4 + 0.1j, 5.0))
BODY = (90.0, 120.0, 70.0)
MOMENTS = [BODY, (120.0, 120.0, 80.0), (80.0, 80.0, 120.0), (100.0, 100.0, 100.0), (30.0, 50.0, 80.0)]
CASES = {
    "three moments": (BODY, (20.0, -10.0, 0.0), (0.6, -0.3, 2.0)),
    "three moments, free": (BODY, (0.0, 0.0, 0.0), (0.6, -0.3, 2.0)),
    "flat, strong": ((30.0, 50.0, 80.0), (500.0, 0.0, 300.0), (0.6, -0.3, 2.0)),
    "prolate": ((120.0, 120.0, 80.0), (5.0, -3.0, 0.0), (0.1, -0.2, 3.0)),
    "oblate": ((80.0, 80.0, 120.0), (5.0, -3.0, 2.0), (0.4, 0.3, -2.0)),
    "sphere": ((100.0, 100.0, 100.0), (1.0, 8.0, -4.0), (0.1, 0.0, 1.0)),
    "spin reversed": ((120.0, 120.0, 80.0), (1.0, 2.0, -40.0), (0.05, 0.1, 4.0)),
    "from rest": ((120.0, 120.0, 80.0), (10.0, 5.0, 7.0), (0.0, 0.0, 0.0)),
}


def last(
    moments: Triple, torque: reference.Array, rates: reference.Array, begin: float, end: float
) -> tuple[reference.Array, reference.Array]:
    """Rates and quaternion at the end of a flight from `START`."""
    return taylor.integrate(moments, torque, rates, START, begin, end)[-1].final


@spread("turns", [False, True], quick=2, ids=["fixed", "turning"])
@spread(("moments", "torque", "rates"), CASES.values(), quick=3, ids=CASES)
def test_motion_under_fixed_and_turning_torques(moments: Triple, torque: Triple, rates: Triple, turns: bool) -> None:
    """At the ends of the pieces, which join without gap or jump, and within them."""
    times, acting = np.linspace(1.3, 10.0, 11), turning(*TURNING) if turns else lambda _: (0.0, 0.0, 0.0)
    pieces = taylor.integrate(
        moments, np.array(torque), np.array(rates), START, 1.3, 10.0, taylor.Forcing(TURNING if turns else ())
    )
    assert (len(pieces) > 3, pieces[0].start) == (True, 1.3)
    assert pieces[-1].start + pieces[-1].duration == pytest.approx(10.0, rel=EPS)
    for one, two in itertools.pairwise(pieces):
        assert one.start + one.duration == pytest.approx(two.start, rel=EPS)
        assert one.final[0] == pytest.approx(two.at(np.array([two.start]))[0][0], abs=1e-15)
    expected = driven(
        moments, reference.Motion(np.array(rates), np.eye(3)), lambda t: np.add(torque, acting(t)).tolist(), times
    )
    for time, motion in zip(times[1:].tolist(), expected, strict=True):
        piece = next(one for one in pieces if time <= one.start + one.duration)
        (_, omega), (_, quaternion) = piece.at(np.array([piece.start, time]))
        size = float(np.linalg.norm(motion.rates))
        assert omega == pytest.approx(motion.rates, abs=FLOWN * max(1.0, size))
        # A torque of 500 N m turns the body through some hundred radians.
        assert reference.turned(attitude.matrix(quaternion), motion.rotation) < FLOWN * max(1.0, 0.5 * size)


@pytest.mark.parametrize("moments", MOMENTS)
def test_energy_and_momentum_stay_without_torque(moments: Triple) -> None:
    rates = reference.vector(0.6, -0.3, 2.0)
    later, quaternion = last(moments, np.zeros(3), rates, 0.0, 100.0)
    # One rounding in each of about a hundred steps.
    assert reference.energy(moments, later) == pytest.approx(reference.energy(moments, rates), rel=200 * EPS)
    h = attitude.rotate(quaternion, later * np.array(moments))
    assert h == pytest.approx(rates * np.array(moments), abs=400 * EPS * float(np.linalg.norm(h)))


def test_a_spin_up_about_a_principal_axis_and_rest() -> None:
    """ω = Mt/I, angle Mt²/(2I): seven and a half turns."""
    body, still, angle = (2.0, 3.0, 4.0), np.zeros(3), 9.7**2 / 2
    rates, quaternion = last(body, reference.vector(0, 0, 4), still, 0.0, 9.7)
    assert rates == pytest.approx([0, 0, 9.7], abs=100 * EPS)
    assert attitude.matrix(quaternion) == pytest.approx(about((0, 0, 1), angle), abs=1000 * EPS)
    assert np.array_equal(np.concatenate(last(body, still, still, 0.0, 1e6)), [*still, *START])


@pytest.mark.parametrize(("mass", "time"), [(1e-12, 1.0), (1e12, 1.0), (1.0, 1e-9), (1.0, 1e6)])
def test_units_do_not_matter(mass: float, time: float) -> None:
    """Rates × s, torques × s², times / s: the same path through space."""
    torque, rates, (first, second, third) = reference.vector(5, 2, 1), reference.vector(1, 2, 3), BODY
    plain = last(BODY, torque, rates, 0.0, 5.0)
    moments = first * mass, second * mass, third * mass
    scaled = last(moments, torque * mass * time**2, rates * time, 0.0, 5.0 / time)
    assert scaled[0] / time == pytest.approx(plain[0], rel=200 * EPS)
    assert scaled[1] == pytest.approx(plain[1], abs=200 * EPS)


def test_a_late_clock_that_cannot_tell_the_steps_does_not_stop_them() -> None:
    """At 1e17 s a second is less than a rounding; the motion over the 64 s is that of any other time."""
    torque, start = reference.vector(0.3, -0.2, 0.1), reference.vector(0.2, 0.1, 3.0)
    late, early = (taylor.integrate((120.0, 100.0, 80.0), torque, start, START, t, t + 64.0) for t in (1e17, 0.0))
    assert len(late) == len(early)
    assert np.concatenate(late[-1].final) == pytest.approx(np.concatenate(early[-1].final), abs=1e-12)


def test_what_cannot_be_integrated_is_refused() -> None:
    for torque in (math.nan, math.inf, 1e200, 1e300):
        with np.errstate(all="ignore"), pytest.raises(Infeasible, match="integrated"):
            last((120.0, 100.0, 80.0), reference.vector(torque, 0, 0), np.ones(3), 0.0, 1e9)
    body, rates = (120.0, 120.0, 80.0), reference.vector(0.1, 0.0, 3.0)
    with refused(Infeasible, "physics.too-many-steps"):
        taylor.integrate(body, reference.vector(1, 0, 0), rates, START, 0.0, 100.0, most=20)
    with refused(Infeasible, "physics.too-long"):
        last(body, reference.vector(1, 0, 0), rates, 0.0, 1e6)


@pytest.mark.parametrize(
    ("forcing", "alike"),
    [(taylor.Forcing(), (0, 1)), (taylor.Forcing(TURNING), (0, 1)), (taylor.Forcing(), (0, 2))],
    ids=["fixed", "turning", "symmetric about axis 2"],
)
def test_few_cases_fly_as_each_alone_does(forcing: taylor.Forcing, alike: tuple[int, int]) -> None:
    """Bodies, motions, torques, begins and durations of their own."""
    rng, count = np.random.default_rng(12), 7
    A = 100.0 * (1.0 + 0.2 * rng.normal(size=count))
    moments = np.tile(80.0 * (1.0 + 0.2 * rng.normal(size=count)), (3, 1))
    moments[[*alike]] = A
    rates, torque = rng.normal(size=(3, count)), 20.0 * rng.normal(size=(3, count))
    now, duration = 2.0 * rng.random(count), 40.0 * rng.random(count)
    omega, quaternion = rates.copy(), np.repeat(START[:, None], count, axis=1)
    bodies = batch.Bodies(moments, np.zeros(3), forcing)
    batch.advance(batch.MotionStretch(bodies, now, omega, quaternion, torque), duration)
    for case, (first, second, third) in enumerate(moments.T.tolist()):
        begin, end = float(now[case]), float(now[case] + duration[case])
        body = first, second, third
        pieces = taylor.integrate(body, torque[:, case], rates[:, case], START, begin, end, forcing)
        alone = np.concatenate(pieces[-1].final)
        assert np.concatenate([omega[:, case], quaternion[:, case]]) == pytest.approx(alone, abs=1e-12)


def test_the_pace_bounds_what_turns_with_a_torque_too() -> None:
    none, rest = np.zeros(1), np.zeros(1, dtype=complex)
    drive = taylor.Drive(none, rest, none, ((np.array([0.01 + 0j]), -7.0),))
    assert drive.pace(np.array([0.2j]), np.array([-0.5]), np.ones(1))[0] > 7.0 + 0.5 + 0.2


def test_steps_are_halved_where_the_torque_changes_faster_than_promised() -> None:
    """A sphere at rest, spun up by so much that its last turns are much faster than the first."""
    drive = taylor.Drive(np.array([0.0]), np.array([0.3 + 0.1j]), np.array([0.0]))
    rest, none, duration = np.zeros(1, dtype=complex), np.zeros(1), np.array([40.0])
    steps = list(taylor.steps(drive, rest, none, none, duration, 1))
    assert steps[0].duration[0] < 40.0 / taylor.count_for(drive, rest, none, duration)
    assert sum(len(one.starts) * one.duration[0] for one in steps) == pytest.approx(40.0)
    turn = taylor.whole(np.concatenate([one.turn.sum(axis=0) for one in steps], axis=1))
    angle = 0.5 * abs(0.3 + 0.1j) * 40.0**2  # about one axis: the turn is that of the angle
    assert turn[0, 0] == pytest.approx(math.cos(0.5 * angle), abs=1e-11)
