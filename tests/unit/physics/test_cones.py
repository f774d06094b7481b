"""Cone angles and periods, Magnus 1970 (12), (18)-(20), (22), against angles and times measured on the motion."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import reference

from nutdamp.physics import cones

EPS = float(np.finfo(float).eps)

BODIES = [(120.0, 80.0), (80.0, 120.0), (100.0, 100.0), (100.0, 200.0), (100.0, 5.0)]
SPINS = [3.0, -3.0]

shapes = st.floats(-1.0, 0.95).map(lambda a: (100.0, 100.0 * (1 - a)))
spins = st.floats(0.01, 100.0) | st.floats(-100.0, -0.01)


def measured(A: float, C: float, omega: complex, spin: float) -> tuple[float, float, float]:
    """Angles between H, ω and the spin axis, rad: θ, μ and |λ|."""
    rates = reference.vector(omega.real, omega.imag, spin)
    h = np.array([A, A, C]) * rates
    axis = reference.vector(0, 0, math.copysign(1, spin))
    return reference.angle(h, axis), reference.angle(rates, axis), reference.angle(rates, h)


@given(shapes, spins, st.floats(1e-9, 1.55), st.floats(-math.pi, math.pi))
def test_magnus_18_19_20_are_the_angles_between_the_vectors(
    body: tuple[float, float], spin: float, theta: float, phase: float
) -> None:
    A, C = body
    size = cones.transverse_rate(A, C, theta, spin)
    nutation, body_cone, space_cone = measured(A, C, cmath.rect(size, phase), spin)
    assert cones.nutation_angle(A, C, size, spin) == pytest.approx(nutation, abs=4 * EPS)
    assert cones.body_cone(size, spin) == pytest.approx(body_cone, abs=4 * EPS)
    assert cones.space_cone(A, C, size, spin) == pytest.approx(math.copysign(space_cone, A - C), abs=4 * EPS)


def test_magnus_20_as_printed_is_wrong() -> None:
    """With the printed denominator Cω3² - Aω1², λ would depend on where ω stands in the body, and be far off."""
    A, C, spin = 120.0, 80.0, 3.0
    size = cones.transverse_rate(A, C, math.radians(30), spin)
    _, _, truth = measured(A, C, complex(size), spin)
    for phase in (0.0, 0.5 * math.pi, 1.0):
        omega = cmath.rect(size, phase)
        printed = math.atan2((A - C) * abs(omega) * spin, C * spin**2 - A * omega.real**2)
        assert abs(printed - truth) > math.radians(1)
        assert cones.space_cone(A, C, abs(omega), spin) == pytest.approx(truth, rel=4 * EPS)


@given(shapes, spins, st.floats(1e-12, 1.55))
def test_space_cone_and_body_cone_add_up_to_the_nutation_angle(
    body: tuple[float, float], spin: float, theta: float
) -> None:
    """λ = θ - μ, with its sign: negative for oblate bodies; relatively exact at small angles too."""
    A, C = body
    size = cones.transverse_rate(A, C, theta, spin)
    total = cones.space_cone(A, C, size, spin) + cones.body_cone(size, spin)
    assert total == pytest.approx(theta, rel=8 * EPS)


@pytest.mark.parametrize("theta", [1e-300, 1e-12, 1e-9, 0.1, math.radians(89), 0.5 * math.pi * (1 - 1e-9)])
def test_transverse_rate_is_the_inverse_of_the_nutation_angle(theta: float) -> None:
    """tan θ stretches the rounding of θ by 1/cos θ, which arctan undoes."""
    for A, C in BODIES:
        size = cones.transverse_rate(A, C, theta, -2.0)
        assert cones.nutation_angle(A, C, size, -2.0) == pytest.approx(theta, rel=4 * EPS)


@pytest.mark.parametrize("spin", SPINS)
def test_limits_of_the_cones(spin: float) -> None:
    assert cones.nutation_angle(120.0, 80.0, 0.0, spin) == 0.0
    assert cones.space_cone(120.0, 80.0, 0.0, spin) == 0.0
    assert cones.nutation_angle(120.0, 80.0, 1.0, 0.0) == 0.5 * math.pi
    assert cones.space_cone(100.0, 100.0, 1.0, spin) == 0.0  # a sphere: ω along H


def test_arrays_give_what_single_numbers_give() -> None:
    omega, spin = np.array([0.0, 0.1, 2.0]), np.array([3.0, -3.0, 0.5])
    pairs = list(zip(omega.tolist(), spin.tolist(), strict=True))
    assert cones.nutation_angle(120.0, 80.0, omega, spin).tolist() == [
        cones.nutation_angle(120.0, 80.0, *pair) for pair in pairs
    ]
    assert cones.body_cone(omega, spin).tolist() == [cones.body_cone(*pair) for pair in pairs]
    assert cones.space_cone(120.0, 80.0, omega, spin).tolist() == [
        cones.space_cone(120.0, 80.0, *pair) for pair in pairs
    ]


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), [body for body in BODIES if body[0] != body[1]])
def test_magnus_12_omega_is_back_in_the_body_after_t_omega(A: float, C: float, spin: float) -> None:
    """And has gone a quarter turn, against the sign of aω3, after T_ω/4."""
    rates = reference.vector(0.4, 0.3, spin)
    period = cones.body_period(A, C, spin)
    start = reference.Motion(rates, np.eye(3))
    quarter, whole = reference.coast((A, A, C), start, np.zeros(3), period * np.array([0.25, 1.0]))
    assert whole.rates == pytest.approx(rates, abs=1e-11)
    turned = complex(quarter.rates[0], quarter.rates[1]) / 0.5
    sense = math.copysign(1.0, (A - C) * spin)
    assert turned == pytest.approx(complex(0.8, 0.6) * -1j * sense, abs=1e-11)


def test_magnus_12_a_sphere_has_no_nutation_period_in_the_body() -> None:
    assert cones.body_period(100.0, 100.0, 3.0) == math.inf


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_magnus_22_the_spin_axis_is_opposite_after_half_an_inertial_period(A: float, C: float, spin: float) -> None:
    """On its cone about H: half a turn after π/ω_n, back after 2π/ω_n."""
    size = cones.transverse_rate(A, C, math.radians(40), spin)
    moments, rates = (A, A, C), reference.vector(size, 0.0, spin)
    start = reference.Motion(rates, reference.frame_n(moments, rates))
    half = cones.half_turn(A, C, size, spin)
    assert cones.inertial_period(A, C, size, spin) == pytest.approx(2 * half, rel=2 * EPS)
    h = float(np.linalg.norm(reference.momentum(moments, start)))
    assert cones.inertial_rate(A, C, size, spin) == pytest.approx(h / A, rel=4 * EPS)
    opposite, back = reference.coast(moments, start, np.zeros(3), half * np.array([1.0, 2.0]))
    x, y, z = math.copysign(1, spin) * start.rotation[:, 2]
    assert math.copysign(1, spin) * opposite.rotation[:, 2] == pytest.approx([-x, -y, z], abs=1e-11)
    assert math.copysign(1, spin) * back.rotation[:, 2] == pytest.approx([x, y, z], abs=1e-11)


def test_magnus_22_small_angle_form() -> None:
    """Δt = πA/(Cω3) to second order in the nutation angle."""
    A, C, spin, theta = 120.0, 80.0, 3.0, 1e-3
    size = cones.transverse_rate(A, C, theta, spin)
    assert cones.half_turn(A, C, size, spin) == pytest.approx(math.pi * A / (C * spin) * (1 - theta**2 / 2), rel=1e-11)
