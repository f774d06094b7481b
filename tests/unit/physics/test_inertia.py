"""Inertia: the ratio a, shapes, principal axes of a tensor, and whether a spin about one of them is
stable.
"""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import reference
from support.spinning import EPS, Triple, about, spinners

from nutdamp.physics import body as rigid_body
from nutdamp.physics import inertia as principal_moments
from nutdamp.physics import triaxial


def test_magnus_4_ratio_and_shape() -> None:
    assert rigid_body.ratio(120.0, 80.0) == pytest.approx(1 / 3, rel=EPS)
    assert [rigid_body.ratio(100.0, C) for C in (10.0, 200.0, 100.0)] == [0.9, -1.0, 0.0]
    assert [rigid_body.shape(100.0, C) for C in (80.0, 100.0, 120.0)] == [
        "prolate",
        "sphere",
        "oblate",
    ]


directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: math.hypot(*v) > 0.1)


@given(
    st.tuples(*[st.floats(0.5, 1.0)] * 3),
    directions,
    st.floats(-math.pi, math.pi),
    st.sampled_from([1e-6, 1, 1e6]),
)
def test_rotated_tensor_is_diagonal_in_its_principal_axes(
    moments: Triple, axis: Triple, angle: float, scale: float
) -> None:
    R = about(axis, angle)
    tensor = scale * R @ np.diag(moments) @ R.T
    tensor = 0.5 * (tensor + tensor.T)
    principal, axes = principal_moments.principal_axes(tensor)
    assert axes.T @ axes == pytest.approx(np.eye(3), abs=8 * EPS)
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=8 * EPS)  # right handed
    # Moments nearer than DEGENERATE count as equal: that much may stay off the diagonal.
    assert axes.T @ tensor @ axes == pytest.approx(
        np.diag(principal), abs=scale * (principal_moments.DEGENERATE + 20 * EPS)
    )
    assert sorted(principal) == pytest.approx(
        sorted(scale * one for one in moments), rel=principal_moments.DEGENERATE
    )


@given(st.permutations([1.0, 0.9, 0.7]), directions, st.floats(-0.5, 0.5))
def test_axes_are_named_by_the_axes_of_the_file_they_are_near_to(
    moments: list[float], axis: Triple, angle: float
) -> None:
    """A turn of less than 30° permutes nothing: axis 3 nearest the file's third, axis 1 nearest its
    first.
    """
    R = about(axis, angle)
    principal, axes = principal_moments.principal_axes(R @ np.diag(moments) @ R.T)
    assert principal == pytest.approx(moments, rel=50 * EPS)
    assert axes == pytest.approx(
        R, abs=50 * EPS / 0.1
    )  # eigenvectors: eps over the gap of the moments


def test_axes_that_the_tensor_leaves_open() -> None:
    """Whichever moment axis 3 has, it is the nearest to the third of the file, and so are axes of
    equal moments.
    """
    for order in itertools.permutations((5.0, 4.0, 3.0)):
        R = about((1.0, 2.0, 0.5), 0.02)
        assert principal_moments.principal_axes(R @ np.diag(order) @ R.T)[0] == pytest.approx(
            order, rel=50 * EPS
        )
    principal, axes = principal_moments.principal_axes(np.diag([3.0, 2.0, 4.0]))
    assert principal == (3.0, 2.0, 4.0)
    assert np.array_equal(axes, np.eye(3))
    for moments, R in (
        # Axis 3 tilted about axis 2: axis 1 stays in the 1-3 plane of the file.
        ((120.0, 120.0, 80.0), about((0.0, 1.0, 0.0), math.radians(3))),
        # Only axis 2 is given: axis 3 is free in its plane.
        ((5.0, 3.0, 5.0), about((1.0, 0.0, 0.0), math.radians(10))),
    ):
        principal, axes = principal_moments.principal_axes(R @ np.diag(moments) @ R.T)
        assert principal == pytest.approx(moments, rel=10 * EPS)
        assert axes == pytest.approx(R, abs=50 * EPS)
    smeared = 7.0 * np.eye(3) + 1e-15 * np.array(
        [[0, 1, 2], [1, 0, 3], [2, 3, 0]]
    )  # a sphere, but for rounding
    principal, axes = principal_moments.principal_axes(smeared)
    assert principal == pytest.approx((7.0, 7.0, 7.0), rel=4 * EPS)
    assert axes == pytest.approx(np.eye(3), abs=4 * EPS)


def test_moments_that_differ_by_rounding_are_one() -> None:
    apart, same = 120.0 * (1 + 2e-9), 120.0 * (1 + 2.5e-10)
    for moments, expected in {
        (100.00000003, 100.0, 100.0): (100.0, 100.0, 100.0),
        (100.0, 100.0000000002, 100.0000000001): (100.0000000001,) * 3,  # I3 in the middle
        (100.0, 100.0, 100.00000009): (100.00000009,) * 3,
        (100.0, 100.00000015, 100.00000008): (100.00000008,)
        * 3,  # each within reach of I3, not of one another
        (120.0, 120.0 * (1 + 5e-10), 80.0): (same, same, 80.0),
        **{
            one: one
            for one in (
                (120.0, apart, 80.0),
                (100.0, 100.0, 100.0000002),
                (3.0, 4.0, 3.0 * (1 + 1e-13)),
            )
        },
    }.items():
        settled = principal_moments.settled(moments)
        assert settled == pytest.approx(expected, rel=2 * EPS)
        assert principal_moments.settled(settled) == settled
        assert [settled[0] == one for one in settled] == [expected[0] == one for one in expected]


@given(st.floats(1e-3, 1e6), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_what_is_a_sphere_is_one_for_every_question(size: float, one: float, two: float) -> None:
    moments = (
        size,
        size * (1 + one * principal_moments.DEGENERATE),
        size * (1 + two * principal_moments.DEGENERATE),
    )
    first, second, third = settled = principal_moments.settled(moments)
    kind = principal_moments.axis_class(moments)
    assert kind == principal_moments.axis_class(settled)
    assert (
        (kind == "sphere")
        == (first == second == third)
        == (rigid_body.ratio(first, third) == 0.0 and first == second)
    )
    if kind in ("minimum", "maximum"):
        assert triaxial.body_nutation_rate(settled, 1.0) != 0.0


# --- stability
# --------------------------------------------------------------------------------------------------


def test_axis_class() -> None:
    kinds = {
        "minimum": [(3.0, 2.0, 1.5), (2.0, 2.0, 1.0)],
        "maximum": [(2.0, 3.0, 4.0), (2.0, 2.0, 3.0)],
        "intermediate": [(2.0, 4.0, 3.0), (3.0, 4.0, 3.0 * (1 + 1e-6))],
        "degenerate": [(2.0, 3.0, 3.0), (3.0, 4.0, 3.0 * (1 + 1e-13))],
        "sphere": [(3.0, 3.0, 3.0), (3.0, 3.0 * (1 - 1e-13), 3.0 * (1 + 1e-13))],
    }
    for kind, bodies in kinds.items():
        for first, second, third in bodies:
            assert principal_moments.axis_class((first, second, third)) == kind
            assert principal_moments.axis_class((second, first, third)) == kind


def test_growth_is_what_integration_shows() -> None:
    """By 0.5303/s about the middle axis of 2, 3, 4 kg m²; linear where two moments are equal; else
    none.
    """
    for spin in (1.5, -1.5):
        unstable = principal_moments.growth((2.0, 4.0, 3.0), spin)
        rate = math.sqrt(unstable.squared_exponent)
        assert rate == pytest.approx(0.5303, abs=5e-5)
        assert not unstable.stable
        assert unstable.growth_time == pytest.approx(1 / rate)
        # Along the growing direction from 1e-9 rad/s: dω1/dt = (I2 - I3)/I1 ω3 ω2 = p ω1
        start = reference.Motion(
            reference.vector(1e-9, 1e-9 * rate * 2.0 / ((4.0 - 3.0) * spin), spin), np.eye(3)
        )
        (later,) = reference.coast((2.0, 4.0, 3.0), start, np.zeros(3), np.array([10.0]))
        assert math.log(later.rates[0] / 1e-9) / 10.0 == pytest.approx(rate, rel=1e-6)
    for moments in ((1.0, 2.0, 2.0), (2.0, 1.0, 2.0)):
        assert principal_moments.growth(moments, 1.5) == (0.0, False, math.inf)
    start = reference.Motion(reference.vector(1e-7, 0.0, 1.5), np.eye(3))
    (later,) = reference.coast((1.0, 2.0, 2.0), start, np.zeros(3), np.array([40.0]))
    assert later.rates[1] == pytest.approx((2.0 - 1.0) / 2.0 * 1.5 * 1e-7 * 40.0, rel=1e-6)
    assert (
        principal_moments.growth((2.0, 2.0, 2.0), 1.5)
        == principal_moments.growth((2.0, 4.0, 3.0), 0.0)
        == (0.0, True, math.inf)
    )


@given(
    st.tuples(*[st.floats(0.1, 1.0)] * 3),
    st.floats(0.1, 5.0) | st.floats(-5.0, -0.1),
    st.just(0.0) | st.floats(-5.0, 5.0),
)
def test_stable_is_extreme_and_a_wheel_may_change_that(
    sides: Triple, spin: float, wheel: float
) -> None:
    x, y, z = sides
    first, second, third = moments = (y + z, z + x, x + y)
    result = principal_moments.growth(moments, spin, wheel)
    assert principal_moments.growth(moments, -spin, -wheel) == result
    # The eigenvalues of the linear equation are the exponents.
    by_second, by_first = (second - third) * spin - wheel, (third - first) * spin + wheel
    assert result.squared_exponent == pytest.approx(
        by_second / first * (by_first / second), abs=1e-7
    )
    assert math.isfinite(result.growth_time) == (result.squared_exponent > 0.0)
    if wheel == 0.0:
        kind = principal_moments.axis_class(moments)
        assert result.stable == (kind in {"minimum", "maximum", "sphere"})
        assert (result.squared_exponent < 0) == (kind in {"minimum", "maximum"})
    if result.squared_exponent < 0.0:
        rate = triaxial.body_nutation_rate(moments, spin, wheel)
        assert rate * rate == pytest.approx(-result.squared_exponent, rel=1e-12)
    elif result.squared_exponent > 0.0:
        with pytest.raises(ValueError, match="no nutation rate"):
            triaxial.body_nutation_rate(moments, spin, wheel)


@pytest.mark.parametrize("tilt", [0.0, 1e-10, 0.01, 0.3])
def test_principal_tilt(tilt: float) -> None:
    turn = about((1.0, 0.0, 0.0), tilt)
    assert (
        principal_moments.principal_tilt(turn)
        == principal_moments.principal_tilt(-turn)
        == pytest.approx(tilt, rel=1e-14)
    )
    _, axes = principal_moments.principal_axes(turn @ np.diag([120.0, 100.0, 80.0]) @ turn.T)
    assert principal_moments.principal_tilt(axes) == pytest.approx(tilt, abs=1e-14)


@spinners
def test_nutation_in_three_frames(A: float, C: float, spin: float) -> None:
    omega0 = 0.2 + 0.1j
    step = 0.1
    start = reference.Motion(reference.vector(0.2, 0.1, spin), np.eye(3))
    turning = principal_moments.nutation_rates(A, C, abs(omega0), spin)
    (motion,) = reference.coast((A, A, C), start, np.zeros(3), np.array([step]))
    # In the body ω turns at K(7); the body has turned by ω3 t in the despun frame, where it turns
    # at K(10).
    later = complex(motion.rates[0], motion.rates[1])
    assert later == pytest.approx(omega0 * np.exp(1j * turning.body * step), abs=1e-12)
    assert later * np.exp(1j * spin * step) == pytest.approx(
        omega0 * np.exp(1j * turning.despun * step), abs=1e-12
    )
    # Inertially the spin axis goes round H, positively, at K(13).
    z = reference.momentum((A, A, C), start)
    z /= np.linalg.norm(z)
    before, after = (axis - z * (z @ axis) for axis in (np.eye(3)[:, 2], motion.rotation[:, 2]))
    swept = math.atan2(z @ np.cross(before, after), before @ after)
    assert swept / step == pytest.approx(turning.inertial, rel=1e-11)
