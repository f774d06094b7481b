"""Quaternions, the exact torque-free arc, and the frame N, against rotation matrices integrated by DOP853."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from support import reference

from nutdamp.physics import attitude, cones

Array = NDArray[np.float64]
EPS = float(np.finfo(float).eps)
FLOWN = 1e-11
"""rad; what DOP853 at 1e-13 a step adds up over some tens of radians."""

BODIES = {
    "prolate": (120.0, 80.0),
    "oblate": (80.0, 120.0),
    "sphere": (100.0, 100.0),
    "flat disc": (100.0, 200.0),
    "nearly a flat disc": (100.0, 200.0 * (1 - 1e-9)),
    "needle": (100.0, 5.0),
    "a = 1e-6": (100.0, 100.0 * (1 - 1e-6)),
    "a = -1e-6": (100.0, 100.0 * (1 + 1e-6)),
    "a = 1e-12": (100.0, 100.0 * (1 - 1e-12)),
    "a = -1e-12": (100.0, 100.0 * (1 + 1e-12)),
}
unit_quaternions = (
    st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4)
    .map(np.array)
    .filter(lambda q: float(np.linalg.norm(q)) > 0.1)
    .map(lambda q: q / np.linalg.norm(q))
)
vectors = st.lists(st.floats(-10.0, 10.0), min_size=3, max_size=3).map(np.array)


def about(axis: Array, angle: float) -> Array:
    """Rotation matrix by Rodrigues' formula."""
    x, y, z = axis / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K)


def start_of(A: float, C: float, theta: float, spin: float) -> tuple[complex, reference.Motion]:
    """A motion with nutation θ, in a frame that is not N."""
    omega = cones.transverse_rate(A, C, theta, spin) * complex(math.cos(2.1), math.sin(2.1))
    return omega, reference.Motion(
        reference.vector(omega.real, omega.imag, spin), about(reference.vector(1, -2, 0.5), 1.2)
    )


# --- quaternions -----------------------------------------------------------------------------------------------------


def test_scalar_first_and_body_to_inertial() -> None:
    """A quarter turn about axis 3 takes body axis 1 to y."""
    quarter = np.array([math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)])
    assert attitude.rotate(quarter, np.array([1.0, 0.0, 0.0])) == pytest.approx([0, 1, 0], abs=2 * EPS)


@given(vectors.filter(lambda v: float(np.linalg.norm(v)) > 0.1), st.floats(-math.pi, math.pi), vectors)
def test_rotate_is_rodrigues_formula(axis: Array, angle: float, vector: Array) -> None:
    quaternion = np.concatenate([[math.cos(angle / 2)], math.sin(angle / 2) * axis / np.linalg.norm(axis)])
    assert attitude.rotate(quaternion, vector) == pytest.approx(about(axis, angle) @ vector, abs=100 * EPS)
    assert attitude.matrix(quaternion) == pytest.approx(about(axis, angle), abs=10 * EPS)


@given(unit_quaternions, unit_quaternions, vectors)
def test_multiply_turns_by_the_right_one_first(left: Array, right: Array, vector: Array) -> None:
    both = attitude.rotate(attitude.multiply(left, right), vector)
    assert both == pytest.approx(attitude.rotate(left, attitude.rotate(right, vector)), abs=200 * EPS)


@pytest.mark.parametrize(
    ("axis", "angle"),
    [
        pytest.param((1.0, 1.0, 1.0), 0.3, id="w largest"),
        pytest.param((1.0, 0.1, -0.1), math.pi - 0.01, id="x largest"),
        pytest.param((0.1, 1.0, 0.1), math.pi - 0.01, id="y largest"),
        pytest.param((0.1, -0.1, 1.0), math.pi - 0.01, id="z largest"),
        pytest.param((1.0, 0.0, 0.0), math.pi, id="half turn about x"),
        pytest.param((0.0, 1.0, 0.0), math.pi, id="half turn about y"),
        pytest.param((0.0, 0.0, 1.0), math.pi, id="half turn about z"),
        pytest.param((1.0, 1.0, 1.0), 2 * math.pi / 3, id="all equal"),
        pytest.param((3.0, 2.0, 1.0), 0.0, id="no turn"),
        pytest.param((3.0, 2.0, 1.0), 1e-9, id="tiny turn"),
    ],
)
def test_from_matrix_in_all_its_branches(axis: tuple[float, float, float], angle: float) -> None:
    direction = np.array(axis) / np.linalg.norm(axis)
    quaternion = attitude.from_matrix(about(direction, angle))
    assert quaternion[0] >= 0.0
    expected = np.concatenate([[math.cos(angle / 2)], math.sin(angle / 2) * direction])
    if angle == math.pi:  # either sign is the same half turn
        expected *= np.sign(expected @ quaternion)
    assert quaternion == pytest.approx(expected, abs=4 * EPS)


@given(unit_quaternions)
def test_matrix_and_from_matrix_are_inverse(quaternion: Array) -> None:
    again = attitude.from_matrix(attitude.matrix(quaternion))
    assert again == pytest.approx(math.copysign(1, again @ quaternion) * quaternion, abs=8 * EPS)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-9, 1e-4, 0.5 * math.pi, 3.0])
def test_angle_between_keeps_small_angles_whole(angle: float) -> None:
    first, second = np.array([1.0, 0.0, 0.0]), np.array([math.cos(angle), math.sin(angle), 0.0])
    assert float(attitude.angle_between(first, 5.0 * second)) == pytest.approx(angle, rel=4 * EPS)


@pytest.mark.parametrize("short", [0.0, 1e-12, 1e-9, 1e-4])
def test_angle_between_near_a_half_turn(short: float) -> None:
    """π - angle is kept to the rounding of π."""
    first, second = np.array([0.0, 2.0, 0.0]), np.array([math.sin(short), -math.cos(short), 0.0])
    assert math.pi - float(attitude.angle_between(first, second)) == pytest.approx(short, abs=2 * EPS * math.pi)


# --- torque-free arcs ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spin", [2.0, -2.0])
@pytest.mark.parametrize("theta", [0.0, 1e-9, math.radians(10), math.radians(60), math.radians(89)])
@pytest.mark.parametrize(("A", "C"), BODIES.values(), ids=BODIES)
def test_arc_is_the_motion_of_the_integrated_body(A: float, C: float, theta: float, spin: float) -> None:
    omega, start = start_of(A, C, theta, spin)
    # Two radians of the fastest of the turns at a time: a needle near θ = 89° goes slowly about itself, a disc fast.
    times = np.array([2.0, 5.0, 11.0]) / float(np.linalg.norm(start.rates))
    quaternions = attitude.arc(A, C, attitude.from_matrix(start.rotation), omega, spin, times)
    for quaternion, motion in zip(quaternions, reference.coast((A, A, C), start, np.zeros(3), times), strict=True):
        assert float(np.linalg.norm(quaternion)) == pytest.approx(1.0, abs=8 * EPS)
        assert reference.turned(attitude.matrix(quaternion), motion.rotation) < FLOWN


@pytest.mark.parametrize("spin", [3.0, -3.0])
@pytest.mark.parametrize(("A", "C"), [(120.0, 80.0), (80.0, 120.0), (100.0, 100.0)])
@pytest.mark.parametrize("omega", [0.0 + 0.0j, 0.1 - 0.3j, 4.0 + 5.0j])
def test_the_end_of_an_arc_is_its_last_row(A: float, C: float, spin: float, omega: complex) -> None:
    start = attitude.from_matrix(reference.frame_n((A, A, C), np.array([0.3, -0.2, spin])))
    last = attitude.arc(A, C, start, omega, spin, np.array([0.7, 11.3]))[-1]
    assert attitude.arc_end(A, C, start, omega, spin, 11.3) == pytest.approx(last, abs=50 * EPS)


@pytest.mark.parametrize("spin", [2.0, -2.0])
@pytest.mark.parametrize(("A", "C"), BODIES.values(), ids=BODIES)
def test_arcs_compose(A: float, C: float, spin: float) -> None:
    """An arc begun where another ended is the rest of it."""
    omega, start = start_of(A, C, 0.4, spin)
    begin = attitude.from_matrix(start.rotation)
    middle = attitude.arc(A, C, begin, omega, spin, np.array(3.0))
    turned = omega * np.exp(-1j * (A - C) / A * spin * 3.0)
    in_two = attitude.arc(A, C, middle, complex(turned), spin, np.array(4.0))
    assert in_two == pytest.approx(attitude.arc(A, C, begin, omega, spin, np.array(7.0)), abs=50 * EPS)


def test_a_body_at_rest_stays() -> None:
    quaternion = np.array([0.5, 0.5, 0.5, 0.5])
    assert np.array_equal(attitude.arc(3.0, 2.0, quaternion, 0j, 0.0, np.array([7.0])), [quaternion])


# --- frame N ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spin", [3.0, -3.0])
@pytest.mark.parametrize("phase", [0.0, 0.7, -2.0, math.pi])
@pytest.mark.parametrize("theta", [1e-12, 1e-9, 0.2, math.radians(89)])
@pytest.mark.parametrize(("A", "C"), [(120.0, 80.0), (80.0, 120.0)])
def test_frame_n(A: float, C: float, theta: float, phase: float, spin: float) -> None:
    """z along H, the spin axis at θ from it in the half plane x >= 0, to every digit at small angles too."""
    omega = cones.transverse_rate(A, C, theta, spin) * complex(math.cos(phase), math.sin(phase))
    quaternion = attitude.frame_n(A, C, omega, spin)
    rates = reference.vector(omega.real, omega.imag, spin)
    h = attitude.rotate(quaternion, np.array([A, A, C]) * rates)
    assert h / np.linalg.norm(h) == pytest.approx([0, 0, 1], abs=4 * EPS)
    axis = attitude.rotate(quaternion, np.array([0.0, 0.0, math.copysign(1.0, spin)]))
    assert axis == pytest.approx([math.sin(theta), 0.0, math.cos(theta)], abs=4 * EPS)
    assert reference.turned(attitude.matrix(quaternion), reference.frame_n((A, A, C), rates)) < 10 * EPS


@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_frame_n_without_nutation_has_x_along_body_axis_1(spin: float) -> None:
    rotation = attitude.matrix(attitude.frame_n(120.0, 80.0, 0j, spin))
    assert rotation @ [1.0, 0.0, 0.0] == pytest.approx([1, 0, 0], abs=2 * EPS)
    assert rotation @ [0.0, 0.0, math.copysign(1, spin)] == pytest.approx([0, 0, 1], abs=2 * EPS)


def test_angular_momentum_in_body_axes() -> None:
    assert np.array_equal(attitude.angular_momentum(120.0, 80.0, 0.5 - 0.25j, -3.0), [60.0, -30.0, -240.0])
