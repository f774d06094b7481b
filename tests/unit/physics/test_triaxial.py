"""Torque-free motion of triaxial bodies: against two integrators, conserved quantities, limits and separatrix."""

import math
from collections.abc import Sequence
from decimal import Decimal, localcontext
from operator import mul

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ellipj, ellipk
from support import reference
from support.cases import deep
from support.golden import refused

from nutdamp.physics import attitude, response, triaxial
from nutdamp.physics import body as rigid_body

START = np.array([0.5, -0.5, 0.5, 0.5])

part = st.floats(0.05, 1.0)
# I1 = y² + z² and round of a mass distribution: the triangle inequality holds, flat discs and equal moments included.
bodies = st.tuples(part, part, part | st.just(0.0)).map(lambda p: np.array([p[1] + p[2], p[2] + p[0], p[0] + p[1]]))
# Squares of the smallest rates must not vanish, or the tests could not tell how large |ω| is.
rate = st.floats(-3.0, 3.0).map(lambda x: x if abs(x) > 1e-100 else 0.0)
turns = st.lists(rate, min_size=3, max_size=3).map(np.array)


def forty_digits(moments: Sequence[float], rates0: Sequence[float], times: reference.Array) -> reference.Array:
    """Rates (n, 3) by Taylor series of Euler's equations in decimal numbers of 40 digits, half a radian a step."""
    track = []
    with localcontext() as context:
        context.prec = 40
        i1, i2, i3 = (Decimal(moment) for moment in moments)
        state, now = [Decimal(float(rate)) for rate in rates0], Decimal(0)
        for time in times.tolist():
            steps = math.ceil((time - float(now)) * math.hypot(*rates0) / 0.5)
            step = (Decimal(time) - now) / steps
            for _ in range(steps):
                one, two, three = series = [[value] for value in state]
                for k in range(1, 31):
                    products = [
                        sum(map(mul, u, reversed(v)), Decimal(0)) for u, v in ((two, three), (three, one), (one, two))
                    ]
                    for terms, coupling, product in zip(
                        series, ((i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3), products, strict=True
                    ):
                        terms.append(step / k * coupling * product)
                state = [sum(terms, Decimal(0)) for terms in series]
            now = Decimal(time)
            track.append([float(value) for value in state])
    return np.array(track)


def turned(first: reference.Array, second: reference.Array) -> float:
    """Largest angle between two tracks of unit quaternions, rad."""
    return 2 * float(np.min([np.linalg.norm(first - second, axis=1), np.linalg.norm(first + second, axis=1)], 0).max())


def extremes(
    moments: Sequence[float] | reference.Array, rates0: Sequence[float] | reference.Array
) -> tuple[float, float]:
    """Least and largest nutation angle."""
    sense = math.copysign(1.0, rates0[2])
    least, largest = (triaxial.arc_cones(moments, rates0, end * sense).nutation for end in (-1.0, 1.0))
    return math.pi - least, largest


def flown(
    moments: Sequence[float] | reference.Array, rates0: Sequence[float] | reference.Array, times: reference.Array
) -> tuple[reference.Array, reference.Array]:
    """Rates and attitudes by the closed form."""
    return triaxial.free_rates(moments, rates0, times), triaxial.free_attitude(moments, rates0, START, times)


def off(first: reference.Array, second: reference.Array) -> float:
    """Largest distance of two tracks of rates, as a part of |ω|."""
    return float(np.linalg.norm(first - second, axis=1).max() / np.linalg.norm(second, axis=1).max())


def test_jacobi_functions_are_those_of_scipy() -> None:
    u = np.linspace(-20.0, 20.0, 401)
    for m in (0.0, 1e-12, 0.1, 0.5, 0.9, 0.999):
        assert np.array(triaxial._jacobi(u, 1.0 - m)) == pytest.approx(np.array(ellipj(u, m)[:3]), abs=5e-14)
        assert 0.5 * math.pi / triaxial._means(1.0 - m)[1] == pytest.approx(float(ellipk(m)), rel=1e-14)


def assert_obeys(
    moments: Sequence[float] | reference.Array, rates0: Sequence[float] | reference.Array, late: float
) -> None:
    """From a point of the track a radian on by DOP853: so short that no separatrix magnifies its errors."""
    size = max(float(np.linalg.norm(rates0)), 1e-3)
    times = np.array([late, late + 1.0]) / size
    track, attitudes = flown(moments, rates0, times)
    start = reference.Motion(track[0], attitude.matrix(attitudes[0]))
    (end,) = reference.coast(list(moments), start, np.zeros(3), times[1:] - times[0])
    assert end.rates == pytest.approx(track[1], abs=1e-12 * size)
    assert reference.turned(end.rotation, attitude.matrix(attitudes[1])) < 2e-12


ON_SEPARATRIX = [[0.5, 0.375, 0.25], [-0.5, 0.375, 0.25], [0.5, -0.375, -0.25], [-0.5, -0.375, 0.25], [0.5, 0.0, -0.25]]
"""Rates of 1.5, 2, 3 kg m²: 3·1·ω3² = 1.5·0.5·ω1²."""
NUDGES = [2.0**-52, 1e-2, -1e-4, 1e-8, -1e-12, -(2.0**-52)]
NEARLY = {
    apart: [
        ([1.0, 1.0 + apart, 1.0 + 2 * apart], [0.5, 0.25, 1.0], 12.0, 1e-14),  # a sphere
        ([1.0, 1.5, 1.5 * (1 + apart)], [0.5, 0.25, 1.0], 12.0, 1e-14),  # equal to the spin axis
        ([1.5 * (1 + apart), 1.0, 1.5], [1e-9, 0.25, 1.0], 12.0, 1e-14),
    ]
    for apart in (1e-3, 1e-6, 1e-12, 2.0**-52)
}


@pytest.mark.parametrize(
    ("moments", "rates0", "until", "close"),
    [
        deep([1.0, 1.5, 2.375], [0.5, -0.25, 0.75], 1300.0, 2e-13),  # a hundred periods
        *[([1.5, 2.0, 3.0], rates0, 40.0, 1e-14) for rates0 in ON_SEPARATRIX[::2]],
        *[deep([1.5, 2.0, 3.0], rates0, 40.0, 1e-14) for rates0 in ON_SEPARATRIX[1::2]],
        *[([1.5, 2.0, 3.0], [0.5, 0.375, 0.25 * (1.0 + nudge)], 100.0, 1e-12) for nudge in NUDGES[:2]],
        *[deep([1.5, 2.0, 3.0], [0.5, 0.375, 0.25 * (1.0 + nudge)], 300.0, 1e-12) for nudge in NUDGES[2:]],
        *NEARLY[2.0**-52],
        *[deep(*row) for apart in (1e-3, 1e-6, 1e-12) for row in NEARLY[apart]],
    ],
)
def test_rates_to_every_digit(moments: list[float], rates0: list[float], until: float, close: float) -> None:
    times = np.linspace(0.0, until, 11)[1:]
    assert off(triaxial.free_rates(moments, rates0, times), forty_digits(moments, rates0, times)) < close
    for time in (0.0, 0.4 * until, until):
        assert_obeys(moments, rates0, time * math.hypot(*rates0))


@pytest.mark.parametrize("rates0", ON_SEPARATRIX)
def test_on_the_separatrix_it_ends_in_a_spin_about_the_middle_axis(rates0: list[float]) -> None:
    moments = [1.5, 2.0, 3.0]
    assert triaxial.nutation_period(moments, rates0) == math.inf
    # A rounding of the rates moves the largest angle by the root of it.
    assert extremes(moments, rates0)[1] == pytest.approx(math.pi / 2, abs=2e-8)
    (end,) = triaxial.free_rates(moments, rates0, [1e4])
    assert abs(end[[0, 2]]).max() < 1e-300
    assert moments[1] * abs(end[1]) == pytest.approx(np.linalg.norm(np.multiply(moments, rates0)), rel=1e-14)


@given(moments=bodies, rates0=turns, late=st.floats(0.0, 300.0))
def test_any_motion_obeys_eulers_equations(moments: reference.Array, rates0: reference.Array, late: float) -> None:
    assert_obeys(moments, rates0, late)


@settings(max_examples=80)
@given(moments=bodies, rates0=turns)
def test_energy_and_momentum_stay_and_the_period_is_one(moments: reference.Array, rates0: reference.Array) -> None:
    """After half of it the transverse rates have changed sign, after the whole nothing differs."""
    size = float(np.linalg.norm(rates0))
    track, attitudes = flown(moments, rates0, np.linspace(0.0, 1000.0, 41) / max(size, 1e-3))
    assert track[0] == pytest.approx(rates0, abs=1e-15 * size)
    assert np.square(track) @ moments == pytest.approx(np.square(rates0) @ moments, rel=1e-13, abs=1e-290)
    momentum, expected = attitude.rotate(attitudes, track * moments), attitude.rotate(START, rates0 * moments)
    assert np.linalg.norm(momentum - expected, axis=1).max() <= 1e-13 * np.linalg.norm(expected)
    assert turned(attitudes[:1], START[None, :]) < 1e-15
    assert np.linalg.norm(attitudes, axis=1) == pytest.approx(1.0, abs=1e-15)
    if size:
        least, largest = extremes(moments, rates0)
        angles = attitude.angle_between(track * moments, np.array([0.0, 0.0, math.copysign(1.0, rates0[2])]))
        assert least - 1e-7 <= angles.min() <= angles.max() <= largest + 1e-7
    period = triaxial.nutation_period(moments, rates0)
    if math.isfinite(period):
        half, whole, many = triaxial.free_rates(moments, rates0, np.array([0.5, 1.0, 50.0]) * period)
        assert whole == pytest.approx(rates0, abs=1e-13 * size)
        assert many == pytest.approx(rates0, abs=1e-12 * size)
        assert np.abs(half) == pytest.approx(np.abs(rates0), abs=1e-13 * size)
        assert np.sum(np.abs(half - rates0) <= 1e-12 * size) >= 1
        assert np.sum(np.abs(half + rates0) <= 1e-12 * size) >= 2


def test_extremes_where_they_are_reached() -> None:
    """With ω1 = 0 and with ω2 = 0 the motion about axis 3 is at an extreme; small angles keep all digits."""
    for moments in ([2.0, 3.0, 4.0], [4.0, 3.0, 2.0]):
        for scale in (0.1, 1e-9):
            rates0 = [scale, 0.0, -1.0]
            later = triaxial.free_rates(moments, rates0, [0.25 * triaxial.nutation_period(moments, rates0)])[0]
            assert abs(later[0]) < 1e-15
            h = np.abs([rates0, later]) * moments
            ends = sorted(np.arctan2(np.hypot(h[:, 0], h[:, 1]), h[:, 2]))
            assert extremes(moments, rates0) == pytest.approx(ends, rel=1e-13)
    # Motion about axis 1 turns axis 3, here the largest, over.
    least, largest = extremes([2.0, 3.0, 4.0], [1.0, 0.0, 0.1])
    assert (least, largest) == pytest.approx((math.atan2(2.0, 0.4), math.pi - least))


@pytest.mark.parametrize("spin", [3.0, -3.0])
@pytest.mark.parametrize("axial", [80.0, 160.0, 239.0])
def test_symmetric_limit_is_continuous(axial: float, spin: float) -> None:
    first, omega0, times = 120.0, 0.3 - 0.2j, np.linspace(0.0, 50.0, 51)
    ideal, _ = response.impulse_sum(times, omega0, spin, first, axial, np.zeros(0), np.zeros(0, complex), np.zeros(0))
    arc = attitude.arc(first, axial, START, omega0, spin, times)
    for apart in (1e-6, 1e-9, 1e-12, 0.0):
        moments, rates0 = (first, first * (1.0 + apart), axial), [omega0.real, omega0.imag, spin]
        track, attitudes = flown(moments, rates0, times)
        assert np.abs(track[:, 0] + 1j * track[:, 1] - ideal).max() < 1e-12 + 100 * apart
        assert np.abs(track[:, 2] - spin).max() < 1e-14 + 10 * apart
        assert turned(attitudes, arc) < 1e-12 + 1000 * apart
        close = pytest.approx(rigid_body.body_period(first, axial, spin), rel=1e-15 + 5 * apart)
        assert triaxial.nutation_period(moments, rates0) == close
        angle = rigid_body.nutation_angle(first, axial, abs(omega0), spin)
        assert extremes(moments, rates0) == pytest.approx((angle, angle), rel=1e-14 + 10 * apart)
        rate = triaxial.body_nutation_rate(moments, spin)
        assert rate == pytest.approx((first - axial) / first * spin, rel=1e-15 + 5 * apart)


def test_rates_that_stay() -> None:
    """About each principal axis, at rest, and wherever moments are equal."""
    times, body = np.linspace(0.0, 100.0, 11), (2.0, 3.0, 4.0)
    for moments, rates0 in (
        *[(body, (0.0, 0.0, -2.0)), (body, (0.0, 2.0, 0.0)), (body, (-2.0, 0.0, 0.0)), (body, (0.0, 0.0, 0.0))],
        *[((3.0,) * 3, (1.0, 2.0, -3.0)), ((2.0, 2.0, 3.0), (1.0, 2.0, 0.0)), ((2.0, 3.0, 3.0), (0.0, 1.0, 2.0))],
    ):
        size, (track, attitudes) = math.hypot(*rates0), flown(moments, rates0, times)
        assert track == pytest.approx(np.tile(rates0, (11, 1)), rel=1e-15)
        half = 0.5 * size * times[:, None]
        by_spin = attitude.multiply(START, np.hstack([np.cos(half), np.sin(half) * np.array(rates0) / (size or 1.0)]))
        assert turned(attitudes, by_spin) < 2e-13
        least, largest = extremes(moments, rates0)
        assert least == pytest.approx(largest, rel=1e-15)


def test_period_has_its_limits() -> None:
    moments = (120.0, 100.0, 80.0)
    small = 2 * math.pi / abs(triaxial.body_nutation_rate(moments, -3.0))
    assert triaxial.nutation_period(moments, [0.0, 0.0, -3.0]) == pytest.approx(small, rel=1e-15)
    assert triaxial.nutation_period(moments, [1e-9, 1e-9, -3.0]) == pytest.approx(small, rel=1e-15)
    assert triaxial.nutation_period(moments, [0.3, 0.3, -3.0]) > small * 1.001
    endless = [
        (moments, [0.0, 1.0, 0.0]),
        (moments, [0.0] * 3),
        ((2.0,) * 3, [1.0] * 3),
        ((2.0, 3.0, 3.0), [0.0, 1.0, 1.0]),
    ]
    assert [triaxial.nutation_period(*motion) for motion in endless] == [math.inf] * 4


def test_body_nutation_rate_of_unequal_transverse_moments() -> None:
    """Not that of the mean, 0.818 rad/s; and backwards for a ω3 > 0: ω2 falls first."""
    moments, spin = (120.0, 100.0, 80.0), 3.0
    rate = triaxial.body_nutation_rate(moments, spin)
    assert rate == pytest.approx(0.775, abs=5e-4)
    times = np.linspace(0.0, 20 * math.pi / rate, 2001)
    track = triaxial.free_rates(moments, [1e-4, 0.0, spin], times)
    assert track[:, 0] == pytest.approx(1e-4 * np.cos(rate * times), abs=1e-10)
    assert track[1, 1] < 0
    assert triaxial.body_nutation_rate(moments, -spin) == -rate
    assert triaxial.body_nutation_rate((80.0, 100.0, 120.0), spin) < 0
    for third in ((100.0, 80.0, 80.0), (80.0, 80.0, 80.0), (100.0, 80.0, 80.0 * (1 + 1e-15))):
        assert triaxial.body_nutation_rate(third, spin) == 0
    with refused(ValueError, "physics.middle-moment"):
        triaxial.body_nutation_rate((120.0, 80.0, 100.0), spin)


def test_units_do_not_matter() -> None:
    """Powers of two only shift exponents, even far out of the usual range."""
    moments, rates0, times = np.array([2.0, 3.0, 4.0]), np.array([0.3, 0.2, 1.0]), np.linspace(0.0, 50.0, 6)
    heavy, slow = 2.0**600, 2.0**-400
    plain, scaled = flown(moments, rates0, times), flown(moments * heavy, rates0 * slow, times / slow)
    assert np.array_equal(scaled[0], plain[0] * slow)
    assert np.array_equal(scaled[1], plain[1])
    assert triaxial.nutation_period(moments, rates0 * slow) * slow == triaxial.nutation_period(moments, rates0)
    assert [part.shape for part in flown(moments, rates0, np.zeros(0))] == [(0, 3), (0, 4)]
