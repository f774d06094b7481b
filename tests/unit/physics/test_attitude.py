"""Quaternions, torque-free arcs, the frame N, cone angles and periods, Magnus 1970 (12), (18)-(20), (22), by DOP853."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import reference
from support.cases import spread
from support.spinning import EPS, about, spinners

from nutdamp.physics import attitude
from nutdamp.physics import body as rigid_body

FLOWN = 1e-11
"""rad; what DOP853 at 1e-13 a step adds up over some tens of radians."""

BODIES = {
    "prolate": (120.0, 80.0),
    "oblate": (80.0, 120.0),
    "sphere": (100.0, 100.0),
    "flat disc": (100.0, 200.0),
    "nearly a flat disc": (100.0, 200.0 * (1 - 1e-9)),
    "needle": (100.0, 5.0),
    **{f"a = {a}": (100.0, 100.0 * (1 - a)) for a in (1e-6, -1e-6, 1e-12, -1e-12)},
}
vectors = st.lists(st.floats(-10.0, 10.0), min_size=3, max_size=3).map(np.array)
axes = vectors.filter(lambda v: float(np.linalg.norm(v)) > 0.1).map(lambda v: v / np.linalg.norm(v))
angles = st.floats(-math.pi, math.pi)


def quaternion_of(axis: reference.Array, angle: float) -> reference.Array:
    return np.concatenate([[math.cos(angle / 2)], math.sin(angle / 2) * axis])


def start_of(A: float, C: float, theta: float, spin: float) -> tuple[complex, reference.Motion]:
    """A motion with nutation θ, in a frame that is not N."""
    omega = cmath.rect(rigid_body.transverse_rate(A, C, theta, spin), 2.1)
    return omega, reference.Motion(reference.vector(omega.real, omega.imag, spin), about((1, -2, 0.5), 1.2))


@given(axes, angles, axes, angles, vectors)
def test_quaternions_are_rodrigues_formula(
    axis: reference.Array, angle: float, other: reference.Array, by: float, vector: reference.Array
) -> None:
    """Scalar first, body to inertial; a product turns by the right one first; `from_matrix` is the inverse."""
    left, right = quaternion_of(axis, angle), quaternion_of(other, by)
    assert attitude.rotate(left, vector) == pytest.approx(about(axis, angle) @ vector, abs=100 * EPS)
    assert attitude.matrix(left) == pytest.approx(about(axis, angle), abs=10 * EPS)
    both = attitude.rotate(attitude.multiply(left, right), vector)
    assert both == pytest.approx(about(axis, angle) @ about(other, by) @ vector, abs=200 * EPS)
    again = attitude.from_matrix(attitude.matrix(left))
    assert again == pytest.approx(math.copysign(1, again @ left) * left, abs=8 * EPS)


def test_from_matrix_in_all_its_branches() -> None:
    near, half, e1, e2, e3 = math.pi - 0.01, math.pi, (1, 0, 0), (0, 1, 0), (0, 0, 1)
    for direction, angle in [
        *[
            ((1, 1, 1), 0.3),
            ((1, 0.1, -0.1), near),
            ((0.1, 1, 0.1), near),
            ((0.1, -0.1, 1), near),
        ],  # w, x, y, z largest
        *[(e1, half), (e2, half), (e3, half), ((1, 1, 1), 2 * math.pi / 3), ((3, 2, 1), 0.0), ((3, 2, 1), 1e-9)],
    ]:
        quaternion = attitude.from_matrix(about(direction, angle))
        assert quaternion[0] >= 0.0
        expected = quaternion_of(np.array(direction) / np.linalg.norm(direction), angle)
        if angle == half:  # either sign is the same half turn
            expected *= np.sign(expected @ quaternion)
        assert quaternion == pytest.approx(expected, abs=4 * EPS)


def test_angle_between_keeps_small_angles_whole_and_those_near_a_half_turn() -> None:
    """π - angle is kept to the rounding of π."""
    for angle in (0.0, 1e-300, 1e-12, 1e-9, 1e-4, 0.5 * math.pi, 3.0):
        first, second = np.array([1.0, 0.0, 0.0]), np.array([math.cos(angle), math.sin(angle), 0.0])
        assert float(attitude.angle_between(first, 5.0 * second)) == pytest.approx(angle, rel=4 * EPS)
    for short in (0.0, 1e-12, 1e-9, 1e-4):
        first, second = np.array([0.0, 2.0, 0.0]), np.array([math.sin(short), -math.cos(short), 0.0])
        rest = math.pi - float(attitude.angle_between(first, second))
        assert rest == pytest.approx(short, abs=2 * EPS * math.pi)


@spread("spin", [2.0, -2.0], quick=1)
@spread("theta", [0.0, 1e-9, math.radians(10), math.radians(60), math.radians(89)], quick=2, deep=3)
@pytest.mark.parametrize(("A", "C"), BODIES.values(), ids=BODIES)
def test_arc_is_the_motion_of_the_integrated_body(A: float, C: float, theta: float, spin: float) -> None:
    """An arc begun where another ended is the rest of it, and the end of an arc is its last row."""
    omega, start = start_of(A, C, theta, spin)
    begin = attitude.from_matrix(start.rotation)
    # Two radians of the fastest of the turns at a time: a needle near θ = 89° goes slowly about itself, a disc fast.
    times = np.array([2.0, 5.0, 11.0]) / float(np.linalg.norm(start.rates))
    quaternions = attitude.arc(A, C, begin, omega, spin, times)
    for quaternion, motion in zip(quaternions, reference.coast((A, A, C), start, np.zeros(3), times), strict=True):
        assert float(np.linalg.norm(quaternion)) == pytest.approx(1.0, abs=8 * EPS)
        assert reference.turned(attitude.matrix(quaternion), motion.rotation) < FLOWN
    turned = complex(omega * np.exp(-1j * (A - C) / A * spin * times[0]))
    rest = attitude.arc(A, C, quaternions[0], turned, spin, times[2:] - times[0])
    assert rest[0] == pytest.approx(quaternions[2], abs=50 * EPS)
    assert attitude.arc_end(A, C, begin, omega, spin, float(times[2])) == pytest.approx(quaternions[2], abs=50 * EPS)


@pytest.mark.parametrize("spin", [3.0, -3.0])
@pytest.mark.parametrize(("A", "C"), [(120.0, 80.0), (80.0, 120.0)])
def test_frame_n(A: float, C: float, spin: float) -> None:
    """z along H, the spin axis at θ from it in the half plane x >= 0, to every digit at small angles too."""
    sense = np.array([0.0, 0.0, math.copysign(1.0, spin)])
    for theta in (1e-12, 1e-9, 0.2, math.radians(89)):
        for phase in (0.0, 0.7, -2.0, math.pi):
            omega = cmath.rect(rigid_body.transverse_rate(A, C, theta, spin), phase)
            quaternion = attitude.frame_n(A, C, omega, spin)
            rates = reference.vector(omega.real, omega.imag, spin)
            h = attitude.rotate(quaternion, np.array([A, A, C]) * rates)
            assert h / np.linalg.norm(h) == pytest.approx([0, 0, 1], abs=4 * EPS)
            axis = attitude.rotate(quaternion, sense)
            assert axis == pytest.approx([math.sin(theta), 0.0, math.cos(theta)], abs=4 * EPS)
            assert reference.turned(attitude.matrix(quaternion), reference.frame_n((A, A, C), rates)) < 10 * EPS
    # Without nutation x lies along body axis 1.
    rotation = attitude.matrix(attitude.frame_n(A, C, 0j, spin))
    assert rotation @ [1.0, 0.0, 0.0] == pytest.approx([1, 0, 0], abs=2 * EPS)
    assert rotation @ sense == pytest.approx([0, 0, 1], abs=2 * EPS)


def test_angular_momentum_in_body_axes_and_rest() -> None:
    quaternion = np.array([0.5, 0.5, 0.5, 0.5])
    assert np.array_equal(attitude.arc(3.0, 2.0, quaternion, 0j, 0.0, np.array([7.0])), [quaternion])
    assert np.array_equal(attitude.angular_momentum(120.0, 80.0, 0.5 - 0.25j, -3.0), [60.0, -30.0, -240.0])


# --- cones and periods -----------------------------------------------------------------------------------------------

nutations = st.floats(1e-12, 1.55) | st.sampled_from([1e-300, 0.5 * math.pi * (1 - 1e-9)])
shapes = st.floats(-1.0, 0.95).map(lambda a: (100.0, 100.0 * (1 - a)))
spins = st.floats(0.01, 100.0) | st.floats(-100.0, -0.01)


@given(shapes, spins, nutations, angles)
def test_magnus_18_19_20_are_the_angles_between_the_vectors(
    body: tuple[float, float], spin: float, theta: float, phase: float
) -> None:
    """And λ = θ - μ, with its sign: negative for oblate bodies; relatively exact at small angles too."""
    A, C = body
    size = rigid_body.transverse_rate(A, C, theta, spin)
    omega = cmath.rect(size, phase)
    rates, axis = reference.vector(omega.real, omega.imag, spin), reference.vector(0, 0, math.copysign(1, spin))
    h, body_cone, space_cone = (
        np.array([A, A, C]) * rates,
        rigid_body.body_cone(size, spin),
        rigid_body.space_cone(A, C, size, spin),
    )
    assert rigid_body.nutation_angle(A, C, size, spin) == pytest.approx(reference.angle(h, axis), abs=4 * EPS)
    assert body_cone == pytest.approx(reference.angle(rates, axis), abs=4 * EPS)
    assert space_cone == pytest.approx(math.copysign(reference.angle(rates, h), A - C), abs=4 * EPS)
    assert space_cone + body_cone == pytest.approx(theta, rel=8 * EPS)
    # tan θ stretches the rounding of θ by 1/cos θ, which arctan undoes.
    assert rigid_body.nutation_angle(A, C, size, spin) == pytest.approx(theta, rel=4 * EPS)


def test_limits_of_the_cones_and_of_arrays() -> None:
    for spin in (3.0, -3.0):
        assert rigid_body.nutation_angle(120.0, 80.0, 0.0, spin) == rigid_body.space_cone(120.0, 80.0, 0.0, spin) == 0.0
        assert rigid_body.nutation_angle(120.0, 80.0, 1.0, 0.0) == 0.5 * math.pi
        assert rigid_body.space_cone(100.0, 100.0, 1.0, spin) == 0.0  # a sphere: ω along H
    omega, spins = np.array([0.0, 0.1, 2.0]), np.array([3.0, -3.0, 0.5])
    pairs = list(zip(omega.tolist(), spins.tolist(), strict=True))
    assert rigid_body.body_cone(omega, spins).tolist() == [rigid_body.body_cone(*pair) for pair in pairs]
    for cone in (rigid_body.nutation_angle, rigid_body.space_cone):
        assert cone(120.0, 80.0, omega, spins).tolist() == [cone(120.0, 80.0, *pair) for pair in pairs]


@spinners
def test_magnus_12_omega_is_back_in_the_body_after_t_omega(A: float, C: float, spin: float) -> None:
    """And has gone a quarter turn, against the sign of aω3, after T_ω/4; a sphere has no such period."""
    period = rigid_body.body_period(A, C, spin)
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
    size, sense = rigid_body.transverse_rate(A, C, math.radians(40), spin), math.copysign(1, spin)
    moments, rates = (A, A, C), reference.vector(size, 0.0, spin)
    start = reference.Motion(rates, reference.frame_n(moments, rates))
    half = 0.5 * rigid_body.inertial_period(A, C, size, spin)
    assert rigid_body.inertial_period(A, C, size, spin) == pytest.approx(2 * half, rel=2 * EPS)
    h = float(np.linalg.norm(reference.momentum(moments, start)))
    assert rigid_body.inertial_rate(A, C, size, spin) == pytest.approx(h / A, rel=4 * EPS)
    opposite, back = reference.coast(moments, start, np.zeros(3), half * np.array([1.0, 2.0]))
    x, y, z = sense * start.rotation[:, 2]
    assert sense * opposite.rotation[:, 2] == pytest.approx([-x, -y, z], abs=1e-11)
    assert sense * back.rotation[:, 2] == pytest.approx([x, y, z], abs=1e-11)
