"""Inertia: the ratio a, shapes, principal axes of a tensor."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from nutdamp.physics import inertia, stability, triaxial

Array = NDArray[np.float64]
EPS = np.finfo(float).eps


def about(axis: tuple[float, float, float], angle: float) -> Array:
    """Rotation matrix by Rodrigues' formula."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K)


def test_magnus_4_ratio() -> None:
    assert inertia.ratio(120.0, 80.0) == pytest.approx(1 / 3, rel=EPS)
    assert inertia.ratio(100.0, 200.0) == -1.0  # flat disc
    assert inertia.ratio(100.0, 100.0) == 0.0


@pytest.mark.parametrize(("C", "shape"), [(80.0, "prolate"), (100.0, "sphere"), (120.0, "oblate")])
def test_shape(C: float, shape: str) -> None:
    assert inertia.shape(100.0, C) == shape


moments = st.tuples(st.floats(0.5, 1.0), st.floats(0.5, 1.0), st.floats(0.5, 1.0))
directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 0.1)


@given(moments, directions, st.floats(-math.pi, math.pi), st.sampled_from([1e-6, 1.0, 1e6]))
def test_rotated_tensor_is_diagonal_in_its_principal_axes(
    values: tuple[float, float, float], axis: tuple[float, float, float], angle: float, scale: float
) -> None:
    R = about(axis, angle)
    tensor = scale * R @ np.diag(values) @ R.T
    tensor = 0.5 * (tensor + tensor.T)
    found, axes = inertia.principal_axes(tensor)
    assert axes.T @ axes == pytest.approx(np.eye(3), abs=8 * EPS)
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=8 * EPS)  # right handed
    # Moments nearer than DEGENERATE count as equal: that much may stay off the diagonal.
    assert axes.T @ tensor @ axes == pytest.approx(np.diag(found), abs=scale * (inertia.DEGENERATE + 20 * EPS))
    assert sorted(found) == pytest.approx(sorted(scale * value for value in values), rel=inertia.DEGENERATE)


@given(st.permutations([1.0, 0.9, 0.7]), directions, st.floats(-0.5, 0.5))
def test_axes_are_named_by_the_axes_of_the_file_they_are_near_to(
    values: list[float], axis: tuple[float, float, float], angle: float
) -> None:
    """A turn of less than 30° permutes nothing: axis 3 nearest the file's third, axis 1 nearest its first."""
    R = about(axis, angle)
    found, axes = inertia.principal_axes(R @ np.diag(values) @ R.T)
    assert found == pytest.approx(values, rel=50 * EPS)
    assert axes == pytest.approx(R, abs=50 * EPS / 0.1)  # eigenvectors: eps over the gap of the moments


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_axis_3_is_the_nearest_to_the_third_whichever_moment_it_has(order: tuple[int, ...]) -> None:
    """A tensor with permuted axes and a slight tilt: no axis of the file is renamed."""
    values = np.array([5.0, 4.0, 3.0])[list(order)]
    tilt = about((1.0, 2.0, 0.5), 0.02)
    found, _ = inertia.principal_axes(tilt @ np.diag(values) @ tilt.T)
    assert found == pytest.approx(tuple(values), rel=50 * EPS)


def test_diagonal_tensor_keeps_its_axes_exactly() -> None:
    found, axes = inertia.principal_axes(np.diag([3.0, 2.0, 4.0]))
    assert found == (3.0, 2.0, 4.0)
    assert np.array_equal(axes, np.eye(3))


def test_equal_transverse_moments_lie_along_the_file_as_far_as_the_tilt_allows() -> None:
    """Axis 3 tilted by 3° about axis 2: axis 1 stays in the 1-3 plane of the file."""
    R = about((0.0, 1.0, 0.0), math.radians(3))
    found, axes = inertia.principal_axes(R @ np.diag([120.0, 120.0, 80.0]) @ R.T)
    assert found == pytest.approx((120.0, 120.0, 80.0), rel=10 * EPS)
    assert axes == pytest.approx(R, abs=50 * EPS)


def test_equal_moments_about_1_and_3_lie_along_the_third_axis_of_the_file() -> None:
    """Only axis 2 is given (turned about axis 1): axis 3 is free in its plane, and nearest the file's third."""
    R = about((1.0, 0.0, 0.0), math.radians(10))
    _, axes = inertia.principal_axes(R @ np.diag([5.0, 3.0, 5.0]) @ R.T)
    assert axes[:, 2] == pytest.approx(R[:, 2], abs=50 * EPS)
    assert axes == pytest.approx(R, abs=50 * EPS)


def test_sphere_that_rounding_has_smeared_keeps_the_axes_of_the_file() -> None:
    tensor = 7.0 * np.eye(3) + 1e-15 * np.array([[0, 1, 2], [1, 0, 3], [2, 3, 0]])
    found, axes = inertia.principal_axes(tensor)
    assert found == pytest.approx((7.0, 7.0, 7.0), rel=4 * EPS)
    assert axes == pytest.approx(np.eye(3), abs=4 * EPS)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ((100.00000003, 100.0, 100.0), (100.0, 100.0, 100.0)),
        ((100.0, 100.0000000002, 100.0000000001), (100.0000000001,) * 3),  # I3 in the middle
        ((100.0, 100.0, 100.00000009), (100.00000009,) * 3),
        ((100.0, 100.00000015, 100.00000008), (100.00000008,) * 3),  # each within reach of I3, not of one another
        ((120.0, 120.0 * (1 + 5e-10), 80.0), (120.0 * (1 + 2.5e-10), 120.0 * (1 + 2.5e-10), 80.0)),
        ((120.0, 120.0 * (1 + 2e-9), 80.0), (120.0, 120.0 * (1 + 2e-9), 80.0)),
        ((100.0, 100.0, 100.0000002), (100.0, 100.0, 100.0000002)),
        ((3.0, 4.0, 3.0 * (1 + 1e-13)), (3.0, 4.0, 3.0 * (1 + 1e-13))),
    ],
)
def test_moments_that_differ_by_rounding_are_one(
    given: tuple[float, float, float], expected: tuple[float, float, float]
) -> None:
    found = inertia.settled(given)
    assert found == pytest.approx(expected, rel=2 * EPS)
    assert inertia.settled(found) == found
    assert (found[0] == found[1]) == (expected[0] == expected[1])
    assert (found[0] == found[2]) == (expected[0] == expected[2])


@given(st.floats(1e-3, 1e6), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_what_is_a_sphere_is_one_for_every_question(size: float, one: float, two: float) -> None:
    moments = (size, size * (1 + one * inertia.DEGENERATE), size * (1 + two * inertia.DEGENERATE))
    first, second, third = inertia.settled(moments)
    kind = stability.axis_class(moments)
    assert kind == stability.axis_class((first, second, third))
    assert (kind == "sphere") == (first == second == third) == (inertia.ratio(first, third) == 0.0 and first == second)
    if kind in ("minimum", "maximum"):
        assert triaxial.body_nutation_rate((first, second, third), 1.0) != 0.0
