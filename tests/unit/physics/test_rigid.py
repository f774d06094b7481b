"""Euler's equations by Taylor series, against DOP853, conservation laws and the growth rate of an unstable spin."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray
from support import reference
from support.cases import spread

from nutdamp.errors import Infeasible
from nutdamp.physics import attitude, rigid

Array = NDArray[np.float64]
EPS = float(np.finfo(float).eps)
FLOWN = 1e-11
"""rad, rad/s; what DOP853 at 1e-13 a step adds up over some tens of radians."""

START = attitude.from_matrix(np.eye(3))
MOMENTS = {
    "triaxial": (90.0, 120.0, 70.0),
    "prolate": (120.0, 120.0, 80.0),
    "oblate": (80.0, 80.0, 120.0),
    "sphere": (100.0, 100.0, 100.0),
    "flat": (30.0, 50.0, 80.0),
}


def ends(pieces: list[rigid.Piece], time: float) -> tuple[Array, Array]:
    """Rates and rotation at ``time`` from the piece that holds it."""
    piece = next(piece for piece in pieces if time <= piece.start + piece.duration)
    rates, quaternion = piece.at(np.array([time]))
    return rates[0], attitude.matrix(quaternion[0])


@spread("torque", [(0.0, 0.0, 0.0), (20.0, -10.0, 0.0), (3.0, 8.0, -15.0), (500.0, 0.0, 300.0)], quick=1, ids=str)
@spread("moments", MOMENTS.values(), quick=8, ids=MOMENTS)
def test_motion_under_a_constant_torque(moments: tuple[float, float, float], torque: tuple[float, ...]) -> None:
    """At the ends of the pieces and within them."""
    rates, times = reference.vector(0.6, -0.3, 2.0), np.linspace(0.7, 7.0, 10)
    pieces = rigid.integrate(moments, np.array(torque), rates, START, 0.0, 7.0)
    expected = reference.coast(moments, reference.Motion(rates, np.eye(3)), np.array(torque), times)
    for time, motion in zip(times, expected, strict=True):
        got, rotation = ends(pieces, float(time))
        size = float(np.linalg.norm(motion.rates))
        assert got == pytest.approx(motion.rates, abs=FLOWN * max(1.0, size))
        # A torque of 500 N m turns the body through some hundred radians.
        assert reference.turned(rotation, motion.rotation) < FLOWN * max(1.0, 0.5 * size)


def test_pieces_join_without_gap_or_jump() -> None:
    pieces = rigid.integrate((90.0, 120.0, 70.0), reference.vector(5, 2, 1), reference.vector(1, 2, 3), START, 2.0, 9.0)
    assert len(pieces) > 3
    assert pieces[0].start == 2.0
    assert pieces[-1].start + pieces[-1].duration == pytest.approx(9.0, rel=EPS)
    for one, two in itertools.pairwise(pieces):
        assert one.start + one.duration == pytest.approx(two.start, rel=EPS)
        assert np.array_equal(one.final[0], two.at(np.array([two.start]))[0][0])


@pytest.mark.parametrize("moments", MOMENTS.values(), ids=MOMENTS)
def test_energy_and_momentum_stay_without_torque(moments: tuple[float, float, float]) -> None:
    rates = reference.vector(0.6, -0.3, 2.0)
    (got,), (quaternion,) = rigid.integrate(moments, np.zeros(3), rates, START, 0.0, 100.0)[-1].at(np.array([100.0]))
    # One rounding in each of about a hundred steps.
    assert reference.energy(moments, got) == pytest.approx(reference.energy(moments, rates), rel=200 * EPS)
    h = attitude.rotate(quaternion, got * np.array(moments))
    assert h == pytest.approx(rates * np.array(moments), abs=400 * EPS * float(np.linalg.norm(h)))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_spin_about_the_middle_axis_grows_at_the_published_rate(sign: float) -> None:
    """2, 3, 4 kg m² about the middle axis at 1.5 rad/s: p = 0.5303/s = ω √((I3-I1)(I2-I3)/(I1 I2)), axes reordered."""
    moments, spin = (2.0, 4.0, 3.0), 1.5 * sign
    p = abs(spin) * math.sqrt((3.0 - 2.0) * (4.0 - 3.0) / (2.0 * 4.0))
    assert p == pytest.approx(0.5303, abs=5e-5)
    # On the growing direction of the linearised equations ω1 and ω2 grow together by e^{pt}.
    rates = 1e-9 * reference.vector(1.0, p * 2.0 / ((4.0 - 3.0) * spin), 0.0) + reference.vector(0, 0, spin)
    last, _ = rigid.integrate(moments, np.zeros(3), rates, START, 0.0, 10.0)[-1].final
    # What rounding puts on the other direction, and second order: 1e-16/1e-9 and (1e-9 e^{10p})².
    assert last[:2] == pytest.approx(rates[:2] * math.exp(10 * p), rel=1e-6)


def test_from_rest_by_a_torque_about_a_principal_axis() -> None:
    """ω = Mt/I, angle Mt²/(2I): seven and a half turns."""
    (rates,), (quaternion,) = rigid.integrate((2.0, 3.0, 4.0), reference.vector(0, 0, 4), np.zeros(3), START, 0.0, 9.7)[
        -1
    ].at(np.array([9.7]))
    assert rates == pytest.approx([0, 0, 9.7], abs=100 * EPS)
    angle = 9.7**2 / 2
    expected = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    assert attitude.matrix(quaternion)[:2, :2] == pytest.approx(np.array(expected), abs=1000 * EPS)


def test_nothing_happens_to_a_body_at_rest() -> None:
    pieces = rigid.integrate((2.0, 3.0, 4.0), np.zeros(3), np.zeros(3), START, 0.0, 1e6)
    assert np.array_equal(pieces[-1].final[0], np.zeros(3))
    assert np.array_equal(pieces[-1].final[1], START)


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_units_of_mass_do_not_matter(scale: float) -> None:
    moments, torque, rates = np.array([90.0, 120.0, 70.0]), reference.vector(5, 2, 1), reference.vector(1, 2, 3)
    plain = rigid.integrate((90.0, 120.0, 70.0), torque, rates, START, 0.0, 5.0)[-1].final
    first, second, third = (moments * scale).tolist()
    scaled = rigid.integrate((first, second, third), torque * scale, rates, START, 0.0, 5.0)[-1].final
    assert scaled[0] == pytest.approx(plain[0], rel=100 * EPS)


@pytest.mark.parametrize("scale", [1e-9, 1e6])
def test_units_of_time_do_not_matter(scale: float) -> None:
    """Rates × s, torques × s², times / s: the same path through space."""
    moments, torque, rates = (90.0, 120.0, 70.0), reference.vector(5, 2, 1), reference.vector(1, 2, 3)
    plain = rigid.integrate(moments, torque, rates, START, 0.0, 5.0)[-1].final
    scaled = rigid.integrate(moments, torque * scale**2, rates * scale, START, 0.0, 5.0 / scale)[-1].final
    assert scaled[0] / scale == pytest.approx(plain[0], rel=200 * EPS)
    assert scaled[1] == pytest.approx(plain[1], abs=200 * EPS)


def test_a_late_clock_that_cannot_tell_the_steps_does_not_stop_them() -> None:
    """At 1e17 s a second is less than a rounding; the motion over the 64 s is that of any other time."""
    torque, start = np.array([0.3, -0.2, 0.1]), np.array([0.2, 0.1, 3.0])
    quaternion = np.array([1.0, 0.0, 0.0, 0.0])
    late, early = (rigid.integrate((120.0, 100.0, 80.0), torque, start, quaternion, t, t + 64.0) for t in (1e17, 0.0))
    assert len(late) == len(early)
    for one, other in zip(late[-1].final, early[-1].final, strict=True):
        assert one == pytest.approx(other, abs=1e-12)


@pytest.mark.parametrize("torque", [math.nan, math.inf, 1e200, 1e300])
def test_what_cannot_be_integrated_is_refused(torque: float) -> None:
    with np.errstate(all="ignore"), pytest.raises(Infeasible, match="integrated"):
        rigid.integrate(
            (120.0, 100.0, 80.0), np.array([torque, 0.0, 0.0]), np.ones(3), np.array([1.0, 0, 0, 0]), 0.0, 1e9
        )
