"""Stability of principal axes, nutation in three frames, steady precession: against Euler's equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support import reference

from nutdamp.physics import forced, inertia, stability

Array = NDArray[np.float64]
LEVEL = np.eye(3)
SHAPES = [(120.0, 80.0, 3.0), (120.0, 80.0, -3.0), (80.0, 120.0, 3.0), (80.0, 120.0, -3.0)]


def coast(moments: tuple[float, float, float], rates0: Array, times: Array) -> Array:
    motions = reference.coast(moments, reference.Motion(rates0, LEVEL), np.zeros(3), times)
    return np.array([motion.rates for motion in motions])


@pytest.mark.parametrize(
    ("moments", "kind"),
    [
        ((3.0, 2.0, 1.5), "minimum"),
        ((2.0, 2.0, 1.0), "minimum"),
        ((2.0, 3.0, 4.0), "maximum"),
        ((2.0, 2.0, 3.0), "maximum"),
        ((2.0, 4.0, 3.0), "intermediate"),
        ((4.0, 2.0, 3.0), "intermediate"),
        ((2.0, 3.0, 3.0), "degenerate"),
        ((3.0, 4.0, 3.0 * (1 + 1e-13)), "degenerate"),
        ((3.0, 4.0, 3.0 * (1 + 1e-6)), "intermediate"),
        ((3.0, 3.0, 3.0), "sphere"),
        ((3.0, 3.0 * (1 - 1e-13), 3.0 * (1 + 1e-13)), "sphere"),
    ],
)
def test_axis_class(moments: tuple[float, float, float], kind: str) -> None:
    assert stability.axis_class(moments) == kind
    first, second, third = moments
    assert stability.axis_class((second, first, third)) == kind


@pytest.mark.parametrize("spin", [1.5, -1.5])
def test_growth_about_the_middle_axis_is_what_integration_shows(spin: float) -> None:
    moments = (2.0, 4.0, 3.0)
    result = stability.growth(moments, spin)
    assert not result.stable
    rate = math.sqrt(result.squared_exponent)
    assert rate == pytest.approx(0.5303, abs=5e-5)
    assert result.growth_time == pytest.approx(1 / rate)
    # Along the growing direction from 1e-9 rad/s: dω1/dt = (I2 - I3)/I1 ω3 ω2 = p ω1
    tiny = 1e-9
    rates0 = np.array([tiny, tiny * rate * moments[0] / ((moments[1] - moments[2]) * spin), spin])
    later = coast(moments, rates0, np.array([10.0]))[0]
    assert math.log(later[0] / tiny) / 10.0 == pytest.approx(rate, rel=1e-6)


def test_growth_without_exponent_is_linear() -> None:
    for moments in ((1.0, 2.0, 2.0), (2.0, 1.0, 2.0)):
        assert stability.growth(moments, 1.5) == (0.0, False, math.inf)
    times = np.linspace(0.0, 40.0, 5)[1:]
    track = coast((1.0, 2.0, 2.0), np.array([1e-7, 0.0, 1.5]), times)
    assert track[:, 1] == pytest.approx((2.0 - 1.0) / 2.0 * 1.5 * 1e-7 * times, rel=1e-6)


def test_what_nothing_couples_stays() -> None:
    assert stability.growth((2.0, 2.0, 2.0), 1.5) == (0.0, True, math.inf)
    assert stability.growth((2.0, 4.0, 3.0), 0.0) == (0.0, True, math.inf)


@given(
    sides=st.lists(st.floats(0.1, 1.0), min_size=3, max_size=3),
    spin=st.floats(0.1, 5.0) | st.floats(-5.0, -0.1),
)
def test_stable_is_extreme(sides: list[float], spin: float) -> None:
    x, y, z = sides
    moments = (y + z, z + x, x + y)
    kind, result = stability.axis_class(moments), stability.growth(moments, spin)
    assert result.stable == (kind in {"minimum", "maximum", "sphere"})
    assert (result.squared_exponent < 0) == (kind in {"minimum", "maximum"})
    assert math.isfinite(result.growth_time) == (kind == "intermediate")
    assert stability.growth(moments, -spin) == result
    # The eigenvalues of the linear equation are the exponents.
    matrix = spin * np.array([[0, (moments[1] - moments[2]) / moments[0]], [(moments[2] - moments[0]) / moments[1], 0]])
    assert result.squared_exponent == pytest.approx(-float(np.linalg.det(matrix)), abs=1e-7)


@pytest.mark.parametrize("tilt", [0.0, 1e-10, 0.01, 0.3])
def test_principal_tilt(tilt: float) -> None:
    turn = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
    assert stability.principal_tilt(turn) == pytest.approx(tilt, rel=1e-14)
    assert stability.principal_tilt(-turn) == pytest.approx(tilt, rel=1e-14)
    _, axes = inertia.principal_axes(turn @ np.diag([120.0, 100.0, 80.0]) @ turn.T)
    assert stability.principal_tilt(axes) == pytest.approx(tilt, abs=1e-14)


@pytest.mark.parametrize(("A", "C", "spin"), SHAPES)
def test_nutation_in_three_frames(A: float, C: float, spin: float) -> None:
    omega0 = 0.2 + 0.1j
    rates0 = np.array([omega0.real, omega0.imag, spin])
    turning = stability.nutation_rates(A, C, abs(omega0), spin)
    assert turning.body == pytest.approx(turning.despun - spin)
    step = 0.1
    motion = reference.coast((A, A, C), reference.Motion(rates0, LEVEL), np.zeros(3), np.array([step]))[0]
    # In the body ω turns at K(7); the body has turned by ω3 t in the despun frame, where it turns at K(10).
    later = complex(motion.rates[0], motion.rates[1])
    assert later == pytest.approx(omega0 * np.exp(1j * turning.body * step), abs=1e-12)
    assert later * np.exp(1j * spin * step) == pytest.approx(omega0 * np.exp(1j * turning.despun * step), abs=1e-12)
    # Inertially the spin axis goes round H, positively, at K(13).
    z = reference.momentum((A, A, C), reference.Motion(rates0, LEVEL))
    z /= np.linalg.norm(z)
    before, after = (axis - z * (z @ axis) for axis in (LEVEL[:, 2], motion.rotation[:, 2]))
    swept = math.atan2(z @ np.cross(before, after), before @ after)
    assert swept / step == pytest.approx(turning.inertial, rel=1e-11)


def euler(t: float, y: Array, moments: Array, torque: complex, turn: float) -> Array:
    """Body rates under a transverse torque that turns at ``turn`` in the body."""
    now = torque * np.exp(1j * turn * t)
    return np.asarray((np.array([now.real, now.imag, 0.0]) - np.cross(y, moments * y)) / moments)


@pytest.mark.parametrize("torque", [2.0 + 0.0j, -1.0 + 3.0j])
@pytest.mark.parametrize(("A", "C", "spin"), SHAPES)
def test_precession_is_steady(A: float, C: float, spin: float, torque: complex) -> None:
    moments = np.array([A, A, C])
    despun = forced.steady_response(A, C, spin, torque, -spin)
    body = forced.steady_response(A, C, spin, torque)
    # A torque fixed in the despun frame turns at -ω3 in the body, and so does a steady ω.
    for steady, turn in ((despun, -spin), (body, 0.0)):
        flown = solve_ivp(
            euler, (0.0, 5.0), [steady.real, steady.imag, spin], "DOP853", np.linspace(0.0, 5.0, 11),
            args=(moments, torque, turn), rtol=1e-13, atol=1e-15,
        )  # fmt: skip
        assert (flown.y[0] + 1j * flown.y[1]) * np.exp(-1j * turn * flown.t) == pytest.approx(
            np.full(11, steady), abs=1e-12
        )
        assert flown.y[2] == pytest.approx(spin, rel=1e-12)
    # The signs as in K(14), K(15), with J_z - J_xy in the last line of K(14).
    axis = np.array([0.0, 0.0, spin])
    pushed = np.array([torque.real, torque.imag, 0.0])
    assert np.cross([despun.real, despun.imag, 0.0], axis) * C == pytest.approx(pushed, rel=1e-14)
    assert np.cross([body.real, body.imag, 0.0], axis) * (C - A) == pytest.approx(pushed, rel=1e-14)
    assert despun == pytest.approx(complex(-torque.imag, torque.real) / (C * spin))
    assert body == pytest.approx(complex(torque.imag, -torque.real) / ((A - C) * spin))


@pytest.mark.parametrize(("A", "C", "spin"), SHAPES)
def test_precession_under_a_despun_torque_turns_the_axis_in_space(A: float, C: float, spin: float) -> None:
    """Euler's equations in the despun frame, which turns with ω1, ω2 only: dH/dt + Ω × H = M, M = (1, 0, 0) N m.

    Seen inertially the spin axis goes straight on, dσe3/dt = ω × e3, about the axis that ω names.
    """
    steady = forced.steady_response(A, C, spin, 1.0 + 0.0j, -spin)

    def slope(t: float, y: Array) -> Array:
        rotation = y[2:].reshape(3, 3)  # despun -> inertial
        turn = np.array([y[0], y[1], 0.0])
        momentum = np.array([A * y[0], A * y[1], C * spin])
        change = np.array([1.0, 0.0, 0.0]) - np.cross(turn, momentum)
        assert change[2] == 0.0
        cross = np.array([[0, 0, y[1]], [0, 0, -y[0]], [-y[1], y[0], 0]])
        return np.concatenate([change[:2] / A, (rotation @ cross).ravel()])

    start = np.concatenate([[steady.real, steady.imag], LEVEL.ravel()])
    flown = solve_ivp(slope, (0.0, 10.0), start, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    assert complex(flown[0], flown[1]) == pytest.approx(steady, rel=1e-12)
    angle = abs(steady) * 10.0
    # ω lies along ±body axis 2 of the start, so that the axis goes towards σM, a torque along +1.
    expected = [math.copysign(math.sin(angle), spin), 0.0, math.cos(angle)]
    assert flown[2:].reshape(3, 3)[:, 2] == pytest.approx(expected, abs=1e-12)
