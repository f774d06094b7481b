"""Cone angles and periods, Magnus 1970 (12), (18)-(20), (22), against angles and times measured on the motion."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import reference
from support.spinning import BODIES, EPS, spinners

from nutdamp.physics import cones

shapes = st.floats(-1.0, 0.95).map(lambda a: (100.0, 100.0 * (1 - a)))
spins = st.floats(0.01, 100.0) | st.floats(-100.0, -0.01)


@given(shapes, spins, st.floats(1e-12, 1.55), st.floats(-math.pi, math.pi))
def test_magnus_18_19_20_are_the_angles_between_the_vectors(
    body: tuple[float, float], spin: float, theta: float, phase: float
) -> None:
    """And λ = θ - μ, with its sign: negative for oblate bodies; relatively exact at small angles too."""
    A, C = body
    size = cones.transverse_rate(A, C, theta, spin)
    omega = cmath.rect(size, phase)
    rates, axis = reference.vector(omega.real, omega.imag, spin), reference.vector(0, 0, math.copysign(1, spin))
    h, body_cone, space_cone = (
        np.array([A, A, C]) * rates,
        cones.body_cone(size, spin),
        cones.space_cone(A, C, size, spin),
    )
    assert cones.nutation_angle(A, C, size, spin) == pytest.approx(reference.angle(h, axis), abs=4 * EPS)
    assert body_cone == pytest.approx(reference.angle(rates, axis), abs=4 * EPS)
    assert space_cone == pytest.approx(math.copysign(reference.angle(rates, h), A - C), abs=4 * EPS)
    assert space_cone + body_cone == pytest.approx(theta, rel=8 * EPS)


def test_magnus_20_as_printed_is_wrong() -> None:
    """With the printed denominator Cω3² - Aω1², λ would depend on where ω stands in the body, and be far off."""
    A, C, spin = 120.0, 80.0, 3.0
    size = cones.transverse_rate(A, C, math.radians(30), spin)
    truth = reference.angle(reference.vector(size, 0, spin), reference.vector(A * size, 0, C * spin))
    assert cones.space_cone(A, C, size, spin) == pytest.approx(truth, rel=4 * EPS)
    for phase in (0.0, 0.5 * math.pi, 1.0):
        printed = math.atan2((A - C) * size * spin, C * spin**2 - A * (size * math.cos(phase)) ** 2)
        assert abs(printed - truth) > math.radians(1)


@pytest.mark.parametrize("theta", [1e-300, 1e-12, 1e-9, 0.1, math.radians(89), 0.5 * math.pi * (1 - 1e-9)])
def test_transverse_rate_is_the_inverse_of_the_nutation_angle(theta: float) -> None:
    """tan θ stretches the rounding of θ by 1/cos θ, which arctan undoes."""
    for A, C in BODIES:
        size = cones.transverse_rate(A, C, theta, -2.0)
        assert cones.nutation_angle(A, C, size, -2.0) == pytest.approx(theta, rel=4 * EPS)


def test_limits_of_the_cones_and_of_arrays() -> None:
    for spin in (3.0, -3.0):
        assert cones.nutation_angle(120.0, 80.0, 0.0, spin) == cones.space_cone(120.0, 80.0, 0.0, spin) == 0.0
        assert cones.nutation_angle(120.0, 80.0, 1.0, 0.0) == 0.5 * math.pi
        assert cones.space_cone(100.0, 100.0, 1.0, spin) == 0.0  # a sphere: ω along H
    omega, spins = np.array([0.0, 0.1, 2.0]), np.array([3.0, -3.0, 0.5])
    pairs = list(zip(omega.tolist(), spins.tolist(), strict=True))
    assert cones.body_cone(omega, spins).tolist() == [cones.body_cone(*pair) for pair in pairs]
    for cone in (cones.nutation_angle, cones.space_cone):
        assert cone(120.0, 80.0, omega, spins).tolist() == [cone(120.0, 80.0, *pair) for pair in pairs]


@spinners
def test_magnus_12_omega_is_back_in_the_body_after_t_omega(A: float, C: float, spin: float) -> None:
    """And has gone a quarter turn, against the sign of aω3, after T_ω/4; a sphere has no such period."""
    period = cones.body_period(A, C, spin)
    if A == C:
        assert period == math.inf
        return
    start = reference.Motion(reference.vector(0.4, 0.3, spin), np.eye(3))
    quarter, whole = reference.coast((A, A, C), start, np.zeros(3), period * np.array([0.25, 1.0]))
    assert whole.rates == pytest.approx(start.rates, abs=1e-11)
    turned = complex(quarter.rates[0], quarter.rates[1]) / complex(0.4, 0.3)
    assert turned == pytest.approx(-1j * math.copysign(1.0, (A - C) * spin), abs=2e-11)


@spinners
def test_magnus_22_the_spin_axis_is_opposite_after_half_an_inertial_period(A: float, C: float, spin: float) -> None:
    """On its cone about H: half a turn after π/ω_n, back after 2π/ω_n."""
    size, sense = cones.transverse_rate(A, C, math.radians(40), spin), math.copysign(1, spin)
    moments, rates = (A, A, C), reference.vector(size, 0.0, spin)
    start = reference.Motion(rates, reference.frame_n(moments, rates))
    half = cones.half_turn(A, C, size, spin)
    assert cones.inertial_period(A, C, size, spin) == pytest.approx(2 * half, rel=2 * EPS)
    h = float(np.linalg.norm(reference.momentum(moments, start)))
    assert cones.inertial_rate(A, C, size, spin) == pytest.approx(h / A, rel=4 * EPS)
    opposite, back = reference.coast(moments, start, np.zeros(3), half * np.array([1.0, 2.0]))
    x, y, z = sense * start.rotation[:, 2]
    assert sense * opposite.rotation[:, 2] == pytest.approx([-x, -y, z], abs=1e-11)
    assert sense * back.rotation[:, 2] == pytest.approx([x, y, z], abs=1e-11)


def test_magnus_22_small_angle_form() -> None:
    """Δt = πA/(Cω3) to second order in the nutation angle."""
    size = cones.transverse_rate(120.0, 80.0, 1e-3, 3.0)
    assert cones.half_turn(120.0, 80.0, size, 3.0) == pytest.approx(math.pi / 2 * (1 - 1e-6 / 2), rel=1e-11)
