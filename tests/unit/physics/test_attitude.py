"""Rotation, cones, the impulse sum, finite pulses, Magnus 1970 (12) and (17)-(22), by DOP853 and
quadrature.
"""

import cmath
import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import quad
from support import reference
from support.builders import present, within
from support.cases import spread
from support.spinning import EPS, Triple, about, arc, plain_spinners, spinners

from nutdamp.physics import attitude, response
from nutdamp.physics import body as rigid_body
from nutdamp.physics import inertia as principal_moments

FLOWN = 1e-11
"""rad; what DOP853 at 1e-13 a step adds up over some tens of radians."""

SHAPES = {
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
    return omega, reference.Motion(
        reference.vector(omega.real, omega.imag, spin), about((1, -2, 0.5), 1.2)
    )


@given(axes, angles, axes, angles, vectors)
def test_quaternions_are_rodrigues_formula(
    axis: reference.Array, angle: float, other: reference.Array, by: float, vector: reference.Array
) -> None:
    """Scalar first, body to inertial; a product turns by the right one first; `from_matrix` is the
    inverse.
    """
    left, right = quaternion_of(axis, angle), quaternion_of(other, by)
    assert attitude.rotate(left, vector) == pytest.approx(
        about(axis, angle) @ vector, abs=100 * EPS
    )
    assert attitude.matrix(left) == pytest.approx(about(axis, angle), abs=10 * EPS)
    both = attitude.rotate(attitude.multiply(left, right), vector)
    assert both == pytest.approx(about(axis, angle) @ about(other, by) @ vector, abs=200 * EPS)
    again = attitude.from_matrix(attitude.matrix(left))
    assert again == pytest.approx(math.copysign(1, again @ left) * left, abs=8 * EPS)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (3, 2, 1)])
@pytest.mark.parametrize("angle", [0.0, 1e-9, math.pi - 0.01, math.pi])
def test_from_matrix_of_half_turns_and_small_ones(axis: Triple, angle: float) -> None:
    quaternion = attitude.from_matrix(about(axis, angle))
    expected = quaternion_of(np.array(axis) / np.linalg.norm(axis), angle)
    assert quaternion[0] >= 0.0
    # Either sign is the same half turn.
    assert quaternion == pytest.approx(np.sign(expected @ quaternion) * expected, abs=4 * EPS)


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-9, 1e-4, 0.5 * math.pi, 3.0])
def test_angle_between_keeps_small_angles_whole_and_those_near_a_half_turn(angle: float) -> None:
    """π - angle is kept to the rounding of π."""
    first, second = np.array([1.0, 0.0, 0.0]), np.array([math.cos(angle), math.sin(angle), 0.0])
    assert attitude.angle_between(first, 5.0 * second) == pytest.approx(angle, rel=4 * EPS)
    rest = math.pi - attitude.angle_between(first, -second)
    assert rest == pytest.approx(angle, abs=2 * EPS * math.pi)


@spread("spin", [2.0, -2.0], quick=1)
@spread("theta", [0.0, 1e-9, math.radians(10), math.radians(60), math.radians(89)], quick=2, deep=3)
@pytest.mark.parametrize(("A", "C"), SHAPES.values(), ids=SHAPES)
def test_arc_is_the_motion_of_the_integrated_body(
    A: float, C: float, theta: float, spin: float
) -> None:
    """An arc begun where another ended is the rest of it, and the end of an arc is its last row."""
    omega, start = start_of(A, C, theta, spin)
    begin = attitude.from_matrix(start.rotation)
    # Two radians of the fastest of the turns at a time: a needle near θ = 89° goes slowly about
    # itself, a disc fast.
    times = np.array([2.0, 5.0, 11.0]) / float(np.linalg.norm(start.rates))
    quaternions = arc(A, C, 0.0, begin, omega, spin, times)[2]
    for quaternion, motion in zip(
        quaternions, reference.coast((A, A, C), start, np.zeros(3), times), strict=True
    ):
        assert float(np.linalg.norm(quaternion)) == pytest.approx(1.0, abs=8 * EPS)
        assert reference.turned(attitude.matrix(quaternion), motion.rotation) < FLOWN
    turned = complex(omega * np.exp(-1j * (A - C) / A * spin * times[0]))
    rest = arc(A, C, 0.0, quaternions[0], turned, spin, times[2:] - times[0])[2]
    assert rest[0] == pytest.approx(quaternions[2], abs=50 * EPS)
    assert arc(A, C, 0.0, begin, omega, spin, float(times[2]))[2] == pytest.approx(
        quaternions[2], abs=50 * EPS
    )


@pytest.mark.parametrize("spin", [3.0, -3.0])
@pytest.mark.parametrize(("A", "C"), [(120.0, 80.0), (80.0, 120.0)])
def test_frame_n(A: float, C: float, spin: float) -> None:
    """z along H, the spin axis at θ from it in the half plane x >= 0, to every digit at small
    angles too.
    """
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
            assert (
                reference.turned(attitude.matrix(quaternion), reference.frame_n((A, A, C), rates))
                < 10 * EPS
            )
    # Without nutation x lies along body axis 1.
    rotation = attitude.matrix(attitude.frame_n(A, C, 0j, spin))
    assert rotation @ [1.0, 0.0, 0.0] == pytest.approx([1, 0, 0], abs=2 * EPS)
    assert rotation @ sense == pytest.approx([0, 0, 1], abs=2 * EPS)


# --- cones and periods
# -----------------------------------------------------------------------------------------------

nutations = st.floats(1e-12, 1.55) | st.sampled_from([1e-300, 0.5 * math.pi * (1 - 1e-9)])
shapes = st.floats(-1.0, 0.95).map(lambda a: (100.0, 100.0 * (1 - a)))
spins = st.floats(0.01, 100.0) | st.floats(-100.0, -0.01)


@given(shapes, spins, nutations, angles)
def test_magnus_18_19_20_are_the_angles_between_the_vectors(
    body: tuple[float, float], spin: float, theta: float, phase: float
) -> None:
    """And λ = θ - μ, with its sign: negative for oblate bodies; relatively exact at small angles
    too.
    """
    A, C = body
    size = rigid_body.transverse_rate(A, C, theta, spin)
    omega = cmath.rect(size, phase)
    rates, axis = (
        reference.vector(omega.real, omega.imag, spin),
        reference.vector(0, 0, math.copysign(1, spin)),
    )
    h = np.array([A, A, C]) * rates
    body_cone = rigid_body.body_cone(size, spin)
    space_cone = rigid_body.space_cone(A, C, size, spin)
    assert rigid_body.nutation_angle(A, C, size, spin) == pytest.approx(
        reference.angle(h, axis), abs=4 * EPS
    )
    assert body_cone == pytest.approx(reference.angle(rates, axis), abs=4 * EPS)
    assert space_cone == pytest.approx(math.copysign(reference.angle(rates, h), A - C), abs=4 * EPS)
    assert space_cone + body_cone == pytest.approx(theta, rel=8 * EPS)
    # tan θ stretches the rounding of θ by 1/cos θ, which arctan undoes.
    assert rigid_body.nutation_angle(A, C, size, spin) == pytest.approx(theta, rel=4 * EPS)


def test_limits_of_the_cones() -> None:
    for spin in (3.0, -3.0):
        assert (
            rigid_body.nutation_angle(120.0, 80.0, 0.0, spin)
            == rigid_body.space_cone(120.0, 80.0, 0.0, spin)
            == 0.0
        )
        assert rigid_body.nutation_angle(120.0, 80.0, 1.0, 0.0) == 0.5 * math.pi
        assert rigid_body.space_cone(100.0, 100.0, 1.0, spin) == 0.0  # a sphere: ω along H


@spinners
def test_magnus_12_omega_is_back_in_the_body_after_t_omega(A: float, C: float, spin: float) -> None:
    """And has gone a quarter turn, against the sign of aω3, after T_ω/4; a sphere has no such
    period.
    """
    period = rigid_body.body_period(A, C, spin)
    if A == C:
        assert period == math.inf
        return
    start = reference.Motion(reference.vector(0.4, 0.3, spin), np.eye(3))
    quarter, whole = reference.coast((A, A, C), start, np.zeros(3), period * np.array([0.25, 1.0]))
    assert whole.rates == pytest.approx(start.rates, abs=1e-11)
    turned = complex(quarter.rates[0], quarter.rates[1]) / complex(0.4, 0.3)
    assert turned == pytest.approx(-1j * math.copysign(1.0, (A - C) * spin), abs=2e-11)


# --- the impulse sum, Magnus 1970 (17), finite pulses, and what to fire when, (21), (22), by DOP853
# and quadrature

"""rad/s, and half of it in rad; what DOP853 at 1e-13 a step adds up over the flights here, at rates
of a few rad/s.
"""


def summed(
    A: float,
    C: float,
    start: reference.Array,
    kicks: list[reference.Kick],
    *until: float,
    wheel: float = 0.0,
) -> reference.Array:
    """Rates (n, 3) by the impulse sum."""
    impulses = np.array([kick.impulse for kick in kicks]).reshape(-1, 3)
    fired = np.array([kick.t for kick in kicks])
    across = impulses[:, 0] + 1j * impulses[:, 1]
    omega, spin = response.impulse_sum(
        np.array(until),
        complex(start[0], start[1]),
        float(start[2]),
        A,
        C,
        fired,
        across,
        impulses[:, 2],
        wheel,
    )
    return np.column_stack([omega.real, omega.imag, spin])


@spinners
def test_magnus_17_is_the_motion(A: float, C: float, spin: float) -> None:
    """Transverse impulses; axial ones too, by which ω3 goes from 3 over 1, 0 and -2 to -4 rad/s (or
    mirrored).
    """
    start = reference.vector(0.9, -0.4, spin)
    across = [
        reference.Kick(t, reference.vector(40 - 20 * t, 15 * t, 0)) for t in (0.0, 0.7, 2.5, 2.9)
    ]
    steps = [(0.5, -2), (1.5, -1), (2.2, -2), (4.0, -2)]
    axial = [
        reference.Kick(t, reference.vector(10 * t, -5, math.copysign(C, spin) * step))
        for t, step in steps
    ]
    for kicks, ends in ((across, spin), (axial, -4 * math.copysign(1, spin))):
        (found,) = summed(A, C, start, kicks, 4.5)
        assert found == pytest.approx(reference.fly((A, A, C), start, kicks, 4.5).rates, abs=FLOWN)
        assert found[2] == pytest.approx(ends, rel=2 * EPS)


def test_magnus_17_steps_at_an_impulse_and_turns_at_minus_a_omega3() -> None:
    times = np.linspace(0.0, 20.0, 7)
    free = summed(120.0, 80.0, reference.vector(0.3, 0.4, -2), [], *times)
    assert free[:, 0] + 1j * free[:, 1] == pytest.approx(
        (0.3 + 0.4j) * np.exp(2j * times / 3), abs=20 * EPS
    )
    assert np.array_equal(free[:, 2], np.full(7, -2.0))
    kick = reference.Kick(1.0, reference.vector(100, 0, 25))
    before_and_after = summed(
        50.0, 50.0, reference.vector(0, 0, 1), [kick], math.nextafter(1.0, 0.0), 1.0
    )
    assert np.array_equal(before_and_after, [[0, 0, 1.0], [2.0, 0, 1.5]])


@spread(
    ("on_time", "spin_rate", "wheel"),
    [
        *((1e-3, 0, 0), (0.4, 0, 0), (9, 0, 0), (4, 0.006, 0), (4, -0.05, 0), (4, 0.75, 0)),
        *((4, -1.5, 0), (1.3, 0.075, 90.0), (1.3, 0, -300.0)),
    ],
    quick=4,
)
@spinners
def test_a_pulse_acts_as_its_impulse_times_the_width_factor_at_its_centre(
    A: float, C: float, spin: float, on_time: float, spin_rate: float, wheel: float
) -> None:
    """M τ sinc(ντ/2) at any width and angle; with axial torque half the width is turned at the new
    spin.
    """
    start, torque = reference.vector(0.3, -0.2, spin), reference.vector(6.0, 9.0, C * spin_rate)
    rate = ((A - C) * spin - wheel) / A
    factor = response.width_factor(rate, (A - C) / A * spin_rate, on_time)
    if not spin_rate:
        half = 0.5 * rate * on_time
        assert factor == pytest.approx(math.sin(half) / half if half else 1.0, abs=2 * EPS)
    pushed = factor * complex(torque[0], torque[1]) * on_time
    kick = reference.Kick(
        1.0 + 0.5 * on_time, reference.vector(pushed.real, pushed.imag, torque[2] * on_time)
    )
    end = 1.0 + on_time
    push = reference.Push(1.0, end, torque)
    flown = reference.fly((A, A, C), start, [push], end, wheel=wheel)
    found = summed(A, C, start, [kick], end, wheel=wheel)
    assert found[0] == pytest.approx(flown.rates, abs=FLOWN)


@given(st.floats(-1.0, 1.0), st.floats(-10.0, 10.0), st.floats(-5.0, 5.0), st.floats(1e-3, 5.0))
def test_width_factor_by_quadrature(
    a: float, spin: float, spin_rate: float, on_time: float
) -> None:
    """F = (1/τ) ∫ exp(i a (spin s + spin_rate (s + τ/2)²/2)) ds over |s| <= τ/2, of which width
    only loses.
    """
    half = 0.5 * on_time

    def phase(s: float) -> float:
        return a * (spin * s + 0.5 * spin_rate * (s + half) ** 2)

    real, imaginary = (
        quad(
            lambda s, part=part: part(phase(s)), -half, half, epsabs=1e-13, epsrel=1e-13, limit=500
        )[0]
        / on_time
        for part in (math.cos, math.sin)
    )
    factor = response.width_factor(a * spin, a * spin_rate, on_time)
    assert factor == pytest.approx(complex(real, imaginary), abs=1e-12)
    assert abs(factor) <= 1.0 + 1e-13


# --- on-time of one pulse
# --------------------------------------------------------------------------------------------


@spinners
def test_one_pulse_of_the_on_time_of_the_formula_leaves_no_omega(
    A: float, C: float, spin: float
) -> None:
    """τ = (2/(aω3)) asin(aω3 A|ω|/(2M)), centred where ω opposes the torque (US patent 4504032)."""
    a = (A - C) / A
    size = 0.2
    torque = 40.0
    on_time = present(response.on_time_for(A * size, torque, a * spin, 0.0, math.inf))
    if a:
        assert on_time == pytest.approx(
            2 / (a * spin) * math.asin(a * spin * A * size / (2 * torque)), rel=4 * EPS
        )
    # ω0 such that ω = -|ω| at the centre of the pulse along +1.
    omega0 = -size * cmath.exp(0.5j * a * spin * on_time)
    push = reference.Push(0.0, on_time, reference.vector(torque, 0, 0))
    end = reference.fly(
        (A, A, C), reference.vector(omega0.real, omega0.imag, spin), [push], on_time
    )
    assert np.abs(end.rates[:2]).max() < FLOWN


def test_limits_of_on_times() -> None:
    """One pulse does at most 2M/|aω3| = 6 N m s, in half a period; none is longer than allowed;
    nothing takes none.

    For a to zero it is impulse over torque, and asin x / x = 1 + x²/6 …: nothing cancels.
    """
    for a in (1e-3, -1e-6, 1e-9, -1e-12, 1e-300, 0.0):
        on_time = response.on_time_for(12.0, 4.0, a * 2.0, 0.0, math.inf)
        x = 0.5 * a * 2.0 * 3.0
        assert on_time == pytest.approx(3.0 * (1 + x * x / 6), rel=max(x**4, 4 * EPS))
    most = (3.0, -1.0, 0.0, math.inf)
    assert response.on_time_for(6.0 * (1 - 1e-12), *most) == pytest.approx(math.pi, rel=1e-5)
    assert response.on_time_for(6.0 * (1 + 1e-12), *most) is None
    for spin_rate, longest, on_time in ((0.0, 10.0, 10.0), (0.0, 9.999, None), (0.1, 9.999, None)):
        assert response.on_time_for(10.0, 1.0, 0.0, 0.0 * spin_rate, longest) == on_time
    for spin_rate in (0.0, 0.2):
        assert response.on_time_for(0.0, 5.0, 0.3, 0.3 * spin_rate, math.inf) == 0.0


@given(
    st.floats(-0.95, 0.95).filter(lambda a: abs(a) > 0.01),
    st.sampled_from([-3.0, -0.7, 0.7, 3.0]),
    st.floats(-0.1, 0.1),
    st.floats(0.01, 0.95),
)
# The spin passes zero within the pulse; less is reached after half a period than before, so that
# the first crossing counts; a near sphere is found from the pulse without axial torque.
@example(0.847171258807392, -0.8766341758481142, 0.7646324588877599, 1.0996556986187433)
@example(0.21068867019307735, -0.5783760751564644, 3.1001585028026706, 0.5005859273617815)
@example(1e-09, 3.0, 387850.9448876288, 3.333333333333334e-09)
def test_on_time_with_axial_torque_gives_the_impulse_requested(
    a: float, spin: float, share: float, part: float
) -> None:
    """While the spin changes by less than a third: found, and exact to rounding."""
    rate = abs(a * spin)
    impulse = part * 0.9 * 2 * 5.0 / rate
    slope = a * share * abs(spin) * rate / math.pi * 3
    with within(100_000):
        on_time = present(response.on_time_for(impulse, 5.0, a * spin, slope, math.inf))
    acts = 5.0 * on_time * abs(response.width_factor(a * spin, slope, on_time))
    assert acts == pytest.approx(impulse, rel=1e-13)


@given(
    *(st.sampled_from([0.0, 1e-320, 1e-300, 1e-30, 1.0, 1e30, 1e300]) for _ in range(3)),
    st.sampled_from([-1.0, -1e-9, 0.0, 1e-15, 0.3, 0.99]),
    st.sampled_from([1e-300, 1.0, -3.0, 1e30]),
    st.sampled_from([0.0, 1e-300, 0.1, -5.0, 1e10]),
)
def test_the_search_for_an_on_time_ends(
    impulse: float, torque: float, longest: float, a: float, spin: float, spin_rate: float
) -> None:
    """Also where the on-time without axial torque is too small for a number: it was then stretched
    for ever.
    """
    with within(3_000_000):
        on_time = response.on_time_for(
            impulse, torque or 1.0, a * spin, a * spin_rate, longest or math.inf
        )
    assert on_time is None or 0.0 <= on_time <= (longest or math.inf)


# --- what to fire, and when
# ------------------------------------------------------------------------------------------

every_angle = spread("degrees", [1e-6, 2.0, 10.0, 30.0, 60.0, 85.0], quick=2, deep=4)


def after(
    A: float, C: float, spin: float, omega0: complex, *kicks: tuple[float, complex]
) -> tuple[float, float, complex]:
    """Nutation angle, shift of H (rad) and ω (rad/s) just after the last of the impulses (s, N m
    s).
    """
    moments = (A, A, C)
    rates = reference.vector(omega0.real, omega0.imag, spin)
    fired = [reference.Kick(t, reference.vector(J.real, J.imag, 0)) for t, J in kicks]
    rotation = reference.frame_n(moments, rates)
    end = reference.fly(moments, rates, fired, kicks[-1][0], rotation)
    before = reference.momentum(moments, reference.Motion(rates, rotation))
    nutation = reference.nutation(moments, end.rates, math.copysign(1, spin))
    return (
        nutation,
        reference.angle(before, reference.momentum(moments, end)),
        complex(end.rates[0], end.rates[1]),
    )


def after_two(
    A: float, C: float, spin: float, omega: complex, first: float, second: float, wait: float
) -> tuple[float, float]:
    """Nutation and shift of H, rad, after two impulses against ω,
    which turns at -aω3 in between.
    """
    left = omega * (1 - first / (A * abs(omega))) * cmath.exp(-1j * (A - C) / A * spin * wait)
    kicks = (0.0, -first * omega / abs(omega)), (wait, -second * left / abs(left))
    return after(A, C, spin, omega, *kicks)[:2]


@every_angle
@spinners
def test_magnus_21_and_22_made_exact(A: float, C: float, spin: float, degrees: float) -> None:
    """One impulse against ω takes out all and moves H by θ; two leave H where it was, for not a
    gram more.
    """
    theta = math.radians(degrees)
    size = rigid_body.transverse_rate(A, C, theta, spin)
    omega = cmath.rect(size, 0.7)
    nutation, shift, _ = after(A, C, spin, omega, (0.0, -A * omega))
    assert nutation < 2 * EPS * max(1.0, math.tan(theta))  # the rounding of A|ω|, as an angle
    assert shift == pytest.approx(theta, abs=8 * EPS)
    halves = rigid_body.half_pulses(A, C, size, spin)
    assert halves.first + halves.second == pytest.approx(A * size, rel=2 * EPS)
    assert min(halves) > 0.0
    assert max(after_two(A, C, spin, omega, *halves)) < 2 * FLOWN


@pytest.mark.parametrize(
    ("A", "C", "spin"), [(120.0, 80.0, 3.0), (80.0, 120.0, -3.0), (100.0, 190.0, 3.0)]
)
@pytest.mark.parametrize(
    ("degrees", "before", "after_first", "approximation"),
    [(2.0, 0.0016, 0.0006, 0.0008), (10.0, 0.19, 0.077, 0.098), (30.0, 5.1, 2.2, 2.9)],
)
def test_magnus_22_as_printed_displaces_h_by_the_figures_of_the_physics_sheet(
    A: float,
    C: float,
    spin: float,
    degrees: float,
    before: float,
    after_first: float,
    approximation: float,
) -> None:
    """Equal halves, with Δt from the ω before or after the first, or πA/(Cω3): to the last digit,
    for every body.
    """
    size = rigid_body.transverse_rate(A, C, math.radians(degrees), spin)
    printed = rigid_body.half_pulses_as_printed(A, C, size, spin)
    assert printed.first == printed.second == 0.5 * A * size
    halfway, small = math.pi / math.hypot(0.5 * size, C / A * spin), math.pi * A / (C * abs(spin))
    for wait, figure in ((printed.wait, before), (halfway, after_first), (small, approximation)):
        nutation, shift = after_two(A, C, spin, complex(size), printed.first, printed.second, wait)
        assert nutation < 2 * FLOWN
        last_digit = 0.5 * 10.0 ** -len(str(figure).partition(".")[2])
        assert math.degrees(shift) == pytest.approx(figure, abs=last_digit)


@every_angle
@spinners
def test_two_actuators_at_the_mounting_angle_give_both_pulses(
    A: float, C: float, spin: float, degrees: float
) -> None:
    """The second actuator stands along ω, either way, as the axis has gone half a turn; at small
    angles -σπA/C.
    """
    size = rigid_body.transverse_rate(A, C, math.radians(degrees), spin)
    halves = rigid_body.half_pulses(A, C, size, spin)
    angle = principal_moments.mounting_angle(A, C, size, spin)
    assert 0.0 <= angle < math.pi
    _, _, omega = after(A, C, spin, complex(size), (0.0, complex(-halves.first)), (halves.wait, 0j))
    assert abs((omega * cmath.exp(-1j * angle)).imag) < 2 * FLOWN * max(size, 1.0)
    if degrees < 1e-3:
        assert cmath.exp(2j * angle) == pytest.approx(
            cmath.exp(-2j * math.copysign(math.pi, spin) * A / C), abs=1e-11
        )


TABLE = {+1: ("omega2", +1), -1: ("omega2", -1), +2: ("omega1", -1), -2: ("omega1", +1)}
"""Magnus 1970 before fig. 5: thruster -> the component that passes zero, and the sign of its rate
of change.
"""


def moment(A: float, C: float, spin: float, thruster: int, mirrored: bool) -> complex:
    """ω of size 1/5 at the moment at which the table fires a thruster, by the rates of change of
    Euler's equations.
    """
    passing, sign = TABLE[thruster]
    rate = (A - C) / A * spin
    for omega in (0.2 + 0j, -0.2 + 0j, 0.2j, -0.2j):
        slope = {"omega1": rate * omega.imag, "omega2": -rate * omega.real}[passing]
        zero = {"omega1": omega.real, "omega2": omega.imag}[passing]
        if zero == 0.0 and slope * sign * (-1 if mirrored else 1) > 0:
            return omega
    raise AssertionError("the table names no moment")


@pytest.mark.parametrize("thruster", TABLE)
@plain_spinners
def test_sign_table_of_magnus(A: float, C: float, spin: float, thruster: int) -> None:
    """The rule "ω against the torque" is the table for aω3 > 0, else its mirror image; the other
    one pumps.
    """
    direction = complex(math.copysign(1, thruster)) * (1 if abs(thruster) == 1 else 1j)
    damps, pumps = (
        moment(A, C, spin, thruster, wrong == ((A - C) * spin > 0)) for wrong in (False, True)
    )
    for omega, phase, change in ((damps, 0.0, -3.0 / A), (pumps, math.pi, 3.0 / A)):
        assert abs(rigid_body.phase_to_oppose(omega, direction)) == phase
        _, _, left = after(A, C, spin, omega, (0.0, 3.0 * direction))
        assert abs(left) == pytest.approx(abs(omega) + change, rel=4 * EPS)


@pytest.mark.parametrize("phase", [0.0, 0.4, -1.7, 3.0])
@pytest.mark.parametrize("torque", [5.0 + 0j, -2.0 + 1j, 0.3j])
def test_phase_to_oppose_is_the_turn_left_to_the_opposite_of_the_torque(
    phase: float, torque: complex
) -> None:
    """ω turns at -aω3: after the time phase/(aω3) it stands against the torque."""
    omega = cmath.rect(0.3, phase)
    then = omega * cmath.exp(-1j * rigid_body.phase_to_oppose(omega, torque))
    assert then / abs(then) == pytest.approx(-torque / abs(torque), abs=8 * EPS)
