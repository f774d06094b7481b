"""Torque-free motion of triaxial bodies, against two integrators; bodies with a wheel, with H3 =
Cω3 + h, by DOP853.
"""

import cmath
import itertools
import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support import reference
from support.cases import deep, spread
from support.golden import refused
from support.places import case
from support.spinning import arc, series

from nutdamp.files.reader import load_spacecraft
from nutdamp.flight.dynamics import make_dynamics
from nutdamp.physics import attitude, energy_sink, response, triaxial
from nutdamp.physics import body as rigid_body
from nutdamp.physics.motion import Bodies, Forcing, MotionStretch, advance
from nutdamp.spacecraft import requirements

START = np.array([0.5, -0.5, 0.5, 0.5])

part = st.floats(0.05, 1.0)
# I1 = y² + z² and round of a mass distribution: the triangle inequality holds, flat discs and equal
# moments included.
bodies = st.tuples(part, part, part | st.just(0.0)).map(
    lambda p: np.array([p[1] + p[2], p[2] + p[0], p[0] + p[1]])
)
# Squares of the smallest rates must not vanish, or the tests could not tell how large |ω| is.
rate = st.floats(-3.0, 3.0).map(lambda x: x if abs(x) > 1e-100 else 0.0)
turns = st.lists(rate, min_size=3, max_size=3).map(np.array)


def turned(first: reference.Array, second: reference.Array) -> float:
    """Largest angle between two tracks of unit quaternions, rad."""
    return 2 * float(
        np.min(
            [np.linalg.norm(first - second, axis=1), np.linalg.norm(first + second, axis=1)], 0
        ).max()
    )


def extremes(
    moments: Sequence[float] | reference.Array, rates0: Sequence[float] | reference.Array
) -> tuple[float, float]:
    """Least and largest nutation angle."""
    sense = math.copysign(1.0, rates0[2])
    least, largest = (
        float(triaxial.widest_cones(np.array(moments), np.array(rates0), end * sense)[0])
        for end in (-1.0, 1.0)
    )
    return math.pi - least, largest


def flown(
    moments: Sequence[float] | reference.Array,
    rates0: Sequence[float] | reference.Array,
    times: reference.Array,
) -> tuple[reference.Array, reference.Array]:
    """Rates and attitudes by the closed form."""
    return triaxial.free_rates(moments, rates0, times), triaxial.free_attitude(
        moments, rates0, START, times
    )


def assert_obeys(
    moments: Sequence[float] | reference.Array,
    rates0: Sequence[float] | reference.Array,
    late: float,
) -> None:
    """From a point of the track a radian on by DOP853: so short that no separatrix magnifies its
    errors.
    """
    size = max(float(np.linalg.norm(rates0)), 1e-3)
    times = np.array([late, late + 1.0]) / size
    track, attitudes = flown(moments, rates0, times)
    start = reference.Motion(track[0], attitude.matrix(attitudes[0]))
    (end,) = reference.coast(list(moments), start, np.zeros(3), times[1:] - times[0])
    assert end.rates == pytest.approx(track[1], abs=1e-12 * size)
    assert reference.turned(end.rotation, attitude.matrix(attitudes[1])) < 2e-12


ON_SEPARATRIX = [
    [0.5, 0.375, 0.25],
    [-0.5, 0.375, 0.25],
    [0.5, -0.375, -0.25],
    [-0.5, -0.375, 0.25],
    [0.5, 0.0, -0.25],
]
"""Rates of 1.5, 2, 3 kg m²: 3·1·ω3² = 1.5·0.5·ω1²."""
NUDGES = [2.0**-52, 1e-2, -1e-4, 1e-8, -1e-12, -(2.0**-52)]
NEARLY = {
    apart: [
        ([1.0, 1.0 + apart, 1.0 + 2 * apart], [0.5, 0.25, 1.0], 12.0),  # a sphere
        ([1.0, 1.5, 1.5 * (1 + apart)], [0.5, 0.25, 1.0], 12.0),  # equal to the spin axis
        ([1.5 * (1 + apart), 1.0, 1.5], [1e-9, 0.25, 1.0], 12.0),
    ]
    for apart in (1e-3, 1e-6, 1e-12, 2.0**-52)
}


@pytest.mark.parametrize(
    ("moments", "rates0", "until"),
    [
        deep([1.0, 1.5, 2.375], [0.5, -0.25, 0.75], 1300.0),  # a hundred periods
        *[([1.5, 2.0, 3.0], rates0, 40.0) for rates0 in ON_SEPARATRIX],
        *[([1.5, 2.0, 3.0], [0.5, 0.375, 0.25 * (1.0 + nudge)], 100.0) for nudge in NUDGES],
        *itertools.chain(*NEARLY.values()),
    ],
)
def test_motions_at_the_limits_obey_eulers_equations(
    moments: list[float], rates0: list[float], until: float
) -> None:
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
    assert moments[1] * abs(end[1]) == pytest.approx(
        np.linalg.norm(np.multiply(moments, rates0)), rel=1e-14
    )


def test_bodies_together_move_as_each_alone() -> None:
    """On the separatrix, beside it, nearly symmetric, symmetric, a sphere, at rest."""
    random = np.random.default_rng(12)
    rows = [([1.5, 2.0, 3.0], rates0) for rates0 in ON_SEPARATRIX]
    rows += [([1.5, 2.0, 3.0], [0.5, 0.375, 0.25 * (1.0 + nudge)]) for nudge in NUDGES]
    rows += [row[:2] for near in NEARLY.values() for row in near]
    rows += [([2.0, 2.0, 1.0], [0.1, 0.2, 0.7]), ([1.0, 1.0, 1.0], [0.1, 0.2, 0.7])]
    rows += [([1.5, 2.0, 3.0], [0.0, 0.0, 0.0]), ([1.5, 2.0, 3.0], [0.0, -2.0, 0.0])]
    for _ in range(20):
        x, y, z = random.uniform(0.05, 1.0, 3)
        rows.append(([y + z, z + x, x + y], random.uniform(-2.0, 2.0, 3).tolist()))
    moments, rates0 = (np.array(each).T for each in zip(*rows, strict=True))
    times = random.uniform(-30.0, 30.0, len(rows))
    starts = random.normal(size=(4, len(rows)))
    starts /= np.linalg.norm(starts, axis=0)
    rates, quaternions = triaxial.coasts(moments, rates0, starts, times)
    for one in range(len(rows)):
        body, rates_of_one, start = (each[:, [one]] for each in (moments, rates0, starts))
        alone = triaxial.coasts(body, rates_of_one, start, times[[one]])
        assert rates[:, one] == pytest.approx(alone[0][:, 0], abs=1e-13)
        assert quaternions[:, one] == pytest.approx(alone[1][:, 0], abs=1e-13)


@given(moments=bodies, rates0=turns, late=st.floats(0.0, 300.0))
def test_any_motion_obeys_eulers_equations(
    moments: reference.Array, rates0: reference.Array, late: float
) -> None:
    assert_obeys(moments, rates0, late)


@settings(max_examples=80)
@given(moments=bodies, rates0=turns)
def test_energy_and_momentum_stay_and_the_period_is_one(
    moments: reference.Array, rates0: reference.Array
) -> None:
    """After half of it the transverse rates have changed sign, after the whole nothing differs."""
    size = float(np.linalg.norm(rates0))
    track, attitudes = flown(moments, rates0, np.linspace(0.0, 1000.0, 41) / max(size, 1e-3))
    assert track[0] == pytest.approx(rates0, abs=1e-15 * size)
    assert np.square(track) @ moments == pytest.approx(
        np.square(rates0) @ moments, rel=1e-13, abs=1e-290
    )
    momentum, expected = (
        attitude.rotate(attitudes, track * moments),
        attitude.rotate(START, rates0 * moments),
    )
    assert np.linalg.norm(momentum - expected, axis=1).max() <= 1e-13 * np.linalg.norm(expected)
    assert turned(attitudes[:1], START[None, :]) < 1e-15
    assert np.linalg.norm(attitudes, axis=1) == pytest.approx(1.0, abs=1e-15)
    if size:
        least, largest = extremes(moments, rates0)
        angles = attitude.angle_between(
            track * moments, np.array([0.0, 0.0, math.copysign(1.0, rates0[2])])
        )
        assert least - 1e-7 <= angles.min() <= angles.max() <= largest + 1e-7
    period = triaxial.nutation_period(moments, rates0)
    if math.isfinite(period):
        half, whole, many = triaxial.free_rates(
            moments, rates0, np.array([0.5, 1.0, 50.0]) * period
        )
        assert whole == pytest.approx(rates0, abs=1e-13 * size)
        assert many == pytest.approx(rates0, abs=1e-12 * size)
        assert np.abs(half) == pytest.approx(np.abs(rates0), abs=1e-13 * size)
        assert np.sum(np.abs(half - rates0) <= 1e-12 * size) >= 1
        assert np.sum(np.abs(half + rates0) <= 1e-12 * size) >= 2


def test_extremes_where_they_are_reached() -> None:
    """With ω1 = 0 and with ω2 = 0 the motion about axis 3 is at an extreme; small angles keep all
    digits.
    """
    for moments in ([2.0, 3.0, 4.0], [4.0, 3.0, 2.0]):
        for scale in (0.1, 1e-9):
            rates0 = [scale, 0.0, -1.0]
            later = triaxial.free_rates(
                moments, rates0, [0.25 * triaxial.nutation_period(moments, rates0)]
            )[0]
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
    first = 120.0
    omega0 = 0.3 - 0.2j
    times = np.linspace(0.0, 50.0, 51)
    ideal, _ = response.impulse_sum(
        times, omega0, spin, first, axial, np.zeros(0), np.zeros(0, complex), np.zeros(0)
    )
    symmetric = arc(first, axial, 0.0, START, omega0, spin, times)[2]
    for apart in (1e-6, 1e-9, 1e-12, 0.0):
        moments = (first, first * (1.0 + apart), axial)
        rates0 = [omega0.real, omega0.imag, spin]
        track, attitudes = flown(moments, rates0, times)
        assert np.abs(track[:, 0] + 1j * track[:, 1] - ideal).max() < 1e-12 + 100 * apart
        assert turned(attitudes, symmetric) < 1e-12 + 1000 * apart
        close = pytest.approx(rigid_body.body_period(first, axial, spin), rel=1e-15 + 5 * apart)
        assert triaxial.nutation_period(moments, rates0) == close
        angle = rigid_body.nutation_angle(first, axial, abs(omega0), spin)
        assert extremes(moments, rates0) == pytest.approx((angle, angle), rel=1e-14 + 10 * apart)


def test_rates_that_stay() -> None:
    """About each principal axis, at rest, and wherever moments are equal."""
    times = np.linspace(0.0, 100.0, 11)
    body = (2.0, 3.0, 4.0)
    for moments, rates0 in (
        *[
            (body, (0.0, 0.0, -2.0)),
            (body, (0.0, 2.0, 0.0)),
            (body, (-2.0, 0.0, 0.0)),
            (body, (0.0, 0.0, 0.0)),
        ],
        *[
            ((3.0,) * 3, (1.0, 2.0, -3.0)),
            ((2.0, 2.0, 3.0), (1.0, 2.0, 0.0)),
            ((2.0, 3.0, 3.0), (0.0, 1.0, 2.0)),
        ],
    ):
        size, (track, attitudes) = math.hypot(*rates0), flown(moments, rates0, times)
        assert track == pytest.approx(np.tile(rates0, (11, 1)), rel=1e-15)
        half = 0.5 * size * times[:, None]
        by_spin = attitude.multiply(
            START, np.hstack([np.cos(half), np.sin(half) * np.array(rates0) / (size or 1.0)])
        )
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
    moments = (120.0, 100.0, 80.0)
    spin = 3.0
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


# --- bodies with a wheel: closed forms, series and cones against DOP853, with H3 = Cω3 + h in the
# place of Cω3

Array = NDArray[np.float64]

MOMENTS = [(120.0, 80.0), (100.0, 160.0), (100.0, 100.0), (80.0, 160.0)]
MOTIONS = [(3.0, 90.0), (0.0, 60.0), (0.0, -60.0), (-2.0, 250.0), (1.0, -300.0), (0.3, 5.0)]
"""ω3 in rad/s and h in N m s: both senses, at rest about axis 3, and H3 against the spin."""

gyrostats = spread(
    ("A", "C", "spin", "wheel"),
    [(*moments, *motion) for moments in MOMENTS for motion in MOTIONS],
    quick=8,
)

OMEGA = 0.25 - 0.4j
TIMES = np.array([0.4, 3.0, 20.0])


def start(A: float, C: float, spin: float, wheel: float) -> tuple[reference.Motion, Array]:
    """The motion of the reference at t = 0, and its attitude as a quaternion."""
    rates = reference.vector(OMEGA.real, OMEGA.imag, spin)
    rotation = reference.frame_n((A, A, C), rates, wheel)
    return reference.Motion(rates, rotation), attitude.from_matrix(rotation)


def apart(quaternions: Array, motions: list[reference.Motion]) -> float:
    """Largest difference of attitudes."""
    return max(
        float(np.abs(attitude.matrix(q) - m.rotation).max())
        for q, m in zip(quaternions, motions, strict=True)
    )


@pytest.mark.parametrize("growth", [0.0, 0.05, -0.04])
@gyrostats
def test_arcs(A: float, C: float, spin: float, wheel: float, growth: float) -> None:
    """ω turns in the body at ν = ω3 - H3/A, and the body about H at |H|/A and about axis 3 at ν;
    dissipation changes the whole of H3, and the wheel keeps its share of it.
    """
    motion, quaternion = start(A, C, spin, wheel)
    sense = math.copysign(1.0, C * spin + wheel)
    flown = reference.coast((A, A, C), motion, np.zeros(3), TIMES, None, wheel, growth)
    omega, spins, turned = arc(A, C, growth, quaternion, OMEGA, spin, TIMES, wheel, sense)
    assert omega == pytest.approx([complex(*m.rates[:2]) for m in flown], abs=1e-10)
    assert spins + 0.0 * TIMES == pytest.approx([m.rates[2] for m in flown], abs=1e-10)
    assert apart(turned, flown) < 1e-10
    end = arc(A, C, growth, quaternion, OMEGA, spin, 20.0, wheel, sense)
    assert end[0] == pytest.approx(omega[-1], abs=1e-12)
    assert end[2] == pytest.approx(turned[-1], abs=1e-12)
    rates = energy_sink.rates_on_arc(A, C, growth, OMEGA, spin, TIMES, wheel, sense)
    assert rates[0] == pytest.approx(omega, abs=1e-12)
    assert rates[1] == pytest.approx(spins, abs=1e-12)


@pytest.mark.parametrize(
    ("time", "degrees", "spin"),
    [(120.0, 8.372, None), (240.0, 22.237, None), (400.0, 27.431, 2.7927), (1e6, 27.606, None)],
)
def test_growth_ends_where_omega_stands_still_in_the_body(
    time: float, degrees: float, spin: float | None
) -> None:
    """By DOP853 of E(θ); with tan θ e^{κt} it was 8.72, 34.0 and 78.3 deg, and -8.63 rad/s."""
    body = load_spacecraft(case("wheel-growth.yaml"))
    end = make_dynamics(body).path(body.initial, 0.0, time, most=1)[1]
    moments, rates = body.inertia.moments, end.rates
    assert math.degrees(reference.nutation(moments, rates, 1.0, 1800.0)) == pytest.approx(
        degrees, abs=6e-4
    )
    assert spin is None or end.spin == pytest.approx(spin, abs=1e-4)
    assert requirements.idle(body, time) == pytest.approx(
        reference.nutation(moments, rates, 1.0, 1800.0), abs=1e-11
    )
    if time < 1e3:
        assert requirements.reached(body, math.radians(degrees)) == pytest.approx(time, abs=0.1)
        assert requirements.reached(body, math.radians(28.0)) == math.inf


def test_the_course_follows_its_law_with_and_without_a_wheel() -> None:
    """By any share of the wheel: toward an angle at rest, and past 90 deg."""
    for shares in ((1.0, 0.0), (8.8, -7.8), (0.4, 0.6), (-1.5, 2.5)):
        theta = math.radians(30.0)
        step = 1e-4
        times = np.array([40.0 - step, 40.0, 40.0 + step])
        course = energy_sink.course(0.02, math.cos(theta), math.sin(theta) ** 2, times, shares)
        tilt = math.atan2(math.sin(theta) * course.transverse[1], course.along[1])
        rise = 0.02 * math.sin(tilt) * (shares[0] * math.cos(tilt) + shares[1])
        rates = [(part[2] - part[0]) / (2.0 * step) for part in (course.travel, course.along)]
        assert rates == pytest.approx([math.cos(tilt), -math.sin(tilt) * rise], rel=1e-8, abs=1e-10)
        assert math.hypot(course.cosine[1], math.sin(theta) * course.sine[1]) == pytest.approx(
            1.0, rel=1e-13
        )


@gyrostats
def test_half_pulses(A: float, C: float, spin: float, wheel: float) -> None:
    """(22) at every angle, its wait and the turn of ω in between: no nutation left, and H where it
    was.
    """
    motion, _ = start(A, C, spin, wheel)
    axial = C * spin + wheel
    halves = rigid_body.half_pulses(A, C, abs(OMEGA), axial / C)
    turn = rigid_body.turn_between_halves(A, C, abs(OMEGA), spin, wheel)
    pushes = [-OMEGA / abs(OMEGA), -OMEGA / abs(OMEGA) * cmath.exp(1j * turn)]
    kicks = [
        reference.Kick(t, reference.vector((size * push).real, (size * push).imag, 0.0))
        for t, size, push in zip((0.0, halves.wait), halves[:2], pushes, strict=True)
    ]
    end = reference.fly((A, A, C), motion.rates, kicks, halves.wait, motion.rotation, wheel=wheel)
    assert np.abs(end.rates[:2]).max() < 1e-10
    shift = reference.angle(
        reference.momentum((A, A, C), end, wheel), reference.momentum((A, A, C), motion, wheel)
    )
    assert shift < 1e-10
    assert halves.first + halves.second == pytest.approx(A * abs(OMEGA), rel=1e-14)


THREE = [(120.0, 100.0, 80.0), (90.0, 120.0, 160.0), (80.0, 120.0, 100.0)]


@spread(("moments", "spin", "wheel", "growth"), [
    (moments, spin, wheel, growth)
    for moments in [*THREE, (100.0, 100.0, 70.0)]
    for spin, wheel in [(2.0, 90.0), (0.0, -60.0), (-1.0, 400.0)]
    for growth in (0.0, 0.03)
], quick=6)  # fmt: skip
def test_series_under_a_torque(
    moments: tuple[float, float, float], spin: float, wheel: float, growth: float
) -> None:
    """One body and many at once, with and without dissipation, on a short stretch and on a long
    one.
    """
    rates, torque = reference.vector(0.2, -0.1, spin), reference.vector(5.0, -2.0, 3.0)
    rotation = reference.frame_n(moments, rates, wheel)
    begin = reference.Motion(rates, rotation)
    quaternion = attitude.from_matrix(rotation)
    for time in (0.7, 12.0):
        sense = math.copysign(1.0, moments[2] * spin + wheel)
        span = np.array([time])
        forcing = Forcing(growth=growth, wheel=wheel, sense=sense)
        push = reference.Push(0.0, time, torque)
        flown = reference.path(moments, begin, [push], span, growth, wheel)
        body, turned = series(moments, torque, rates, quaternion, 0.0, time, forcing)[-1].end()
        assert body == pytest.approx(flown[0].rates, abs=1e-10)
        assert apart(turned[None], flown) < 1e-10
        many = Bodies(
            np.tile(moments, (3, 1)).T, np.zeros(3), forcing._replace(wheel=np.full(3, wheel))
        )
        here = MotionStretch(
            many,
            np.zeros(3),
            np.tile(rates, (3, 1)).T,
            np.tile(quaternion, (3, 1)).T,
            np.tile(torque, (3, 1)).T,
        )
        advance(here, np.array([time, 0.5 * time, time]))
        assert here.rates[:, 2] == pytest.approx(flown[0].rates, abs=1e-10)
        assert apart(here.quaternion[:, 2][None], flown) < 1e-10


@spread("seed", range(24), quick=4)
def test_widest_cones_of_many_bodies_are_those_that_they_reach(seed: int) -> None:
    """Any moments, wheels and motions, over the separatrix and reversed: against the motion sampled
    densely.
    """
    draws = np.random.default_rng(seed)
    moments = np.sort(draws.uniform(60.0, 110.0, 3))[draws.permutation(3)]
    rates = draws.normal(size=3) * [0.5, 0.5, 2.0]
    if seed % 5 == 1:  # a small nutation, of a body that it does not leave
        rates[:2] *= 1e-5
        moments.sort()
    wheel = float(draws.normal() * 150.0) if seed % 4 else 0.0
    rates[2] = 0.0 if seed % 7 == 0 else rates[2]
    sense = math.copysign(1.0, moments[2] * rates[2] + wheel)
    pieces = series(
        (moments[0], moments[1], moments[2]),
        np.zeros(3),
        rates,
        np.array([1.0, 0, 0, 0]),
        0.0,
        60.0,
        Forcing(wheel=wheel),
    )
    body = np.concatenate(
        [
            piece.motion(np.linspace(piece.start, piece.start + piece.duration, 60))[0]
            for piece in pieces
        ]
    )
    momentum = body * moments + [0.0, 0.0, wheel]
    angles = np.arctan2(np.hypot(momentum[:, 0], momentum[:, 1]), sense * momentum[:, 2])
    nutation, cone = (float(angle) for angle in triaxial.widest_cones(moments, rates, sense, wheel))
    assert angles.max() <= nutation + 1e-11
    assert nutation == pytest.approx(angles.max(), rel=2e-3)
    widest = int(np.argmax(angles))
    reached = math.atan2(math.hypot(*body[widest, :2]), sense * body[widest, 2])
    assert cone == pytest.approx(reached, rel=0.02, abs=1e-9)
