"""Euler's equations by series, torques fixed or turning, against DOP853, conservation laws and
closed forms.
"""

import itertools
import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from support import reference
from support.builders import present
from support.cases import deep, spread
from support.golden import refused
from support.spinning import EPS, Triple, driven, series, turning

from nutdamp.common.numerics import cos_sin
from nutdamp.errors import Infeasible
from nutdamp.montecarlo.propagated import Pulses
from nutdamp.montecarlo.propagated import fly_pulses as fly
from nutdamp.physics import attitude
from nutdamp.physics.motion import (
    BLOCK,
    NOTHING,
    Bodies,
    Falling,
    Forcing,
    MotionStretch,
    polynomials,
)
from nutdamp.physics.sky import AxisWatch

FLOWN = 1e-11
"""rad, rad/s; what DOP853 at 1e-13 a step adds up over some tens of radians."""
START = attitude.from_matrix(np.eye(3))
TURNING = ((2.0 - 1.5j, -1.7), (0.4 + 0.1j, 5.0))
BODY = (90.0, 120.0, 70.0)
CASES = {
    "three moments": (BODY, (20.0, -10.0, 0.0), (0.6, -0.3, 2.0)),
    "three moments, free": (BODY, (0.0, 0.0, 0.0), (0.6, -0.3, 2.0)),
    "flat, strong": ((30.0, 50.0, 80.0), (500.0, 0.0, 300.0), (0.6, -0.3, 2.0)),
    "prolate": ((120.0, 120.0, 80.0), (5.0, -3.0, 0.0), (0.1, -0.2, 3.0)),
    "oblate": ((80.0, 80.0, 120.0), (5.0, -3.0, 2.0), (0.4, 0.3, -2.0)),
    "sphere": ((100.0, 100.0, 100.0), (1.0, 8.0, -4.0), (0.1, 0.0, 1.0)),
    "spin reversed": ((120.0, 120.0, 80.0), (1.0, 2.0, -40.0), (0.05, 0.1, 4.0)),
    "from rest": ((120.0, 120.0, 80.0), (10.0, 5.0, 7.0), (0.0, 0.0, 0.0)),
}


def last(
    moments: Triple, torque: reference.Array, rates: reference.Array, begin: float, end: float
) -> tuple[reference.Array, reference.Array]:
    """Rates and quaternion at the end of a flight from `START`."""
    return series(moments, torque, rates, START, begin, end)[-1].end()


@spread("turns", [False, True], quick=2, ids=["fixed", "turning"])
@spread(("moments", "torque", "rates"), CASES.values(), quick=3, ids=CASES)
def test_motion_under_fixed_and_turning_torques(
    moments: Triple, torque: Triple, rates: Triple, turns: bool
) -> None:
    """At the ends of the pieces, which join without gap or jump, and within them."""
    times = np.linspace(1.3, 10.0, 11)
    acting = turning(*TURNING) if turns else lambda _: (0.0, 0.0, 0.0)
    pieces = series(
        moments,
        np.array(torque),
        np.array(rates),
        START,
        1.3,
        10.0,
        Forcing(TURNING if turns else ()),
    )
    assert (len(pieces) > 3, pieces[0].start) == (True, 1.3)
    assert pieces[-1].start + pieces[-1].duration == pytest.approx(10.0, rel=4 * EPS)
    for one, two in itertools.pairwise(pieces):
        assert one.start + one.duration == pytest.approx(two.start, rel=4 * EPS)
        assert one.end()[0] == pytest.approx(two.motion(np.array([two.start]))[0][0], abs=1e-15)
    expected = driven(
        moments,
        reference.Motion(np.array(rates), np.eye(3)),
        lambda t: np.add(torque, acting(t)).tolist(),
        times,
    )
    for time, motion in zip(times[1:].tolist(), expected, strict=True):
        piece = next((one for one in pieces if time <= one.start + one.duration), pieces[-1])
        (_, omega), (_, quaternion) = piece.motion(np.array([piece.start, time]))
        size = float(np.linalg.norm(motion.rates))
        assert omega == pytest.approx(motion.rates, abs=FLOWN * max(1.0, size))
        # A torque of 500 N m turns the body through some hundred radians.
        assert reference.turned(attitude.matrix(quaternion), motion.rotation) < FLOWN * max(
            1.0, 0.5 * size
        )


def test_a_late_clock_that_cannot_tell_the_steps_does_not_stop_them() -> None:
    """At 1e17 s a second is less than a rounding; the motion over the 64 s is that of any other
    time.
    """
    torque, start = reference.vector(0.3, -0.2, 0.1), reference.vector(0.2, 0.1, 3.0)
    late, early = (
        series((120.0, 100.0, 80.0), torque, start, START, t, t + 64.0) for t in (1e17, 0.0)
    )
    assert len(late) == len(early)
    assert np.concatenate(late[-1].end()) == pytest.approx(
        np.concatenate(early[-1].end()), abs=1e-12
    )


def test_what_cannot_be_integrated_is_refused() -> None:
    for torque in (math.nan, math.inf, 1e200, 1e300):
        with np.errstate(all="ignore"), pytest.raises(Infeasible, match="integrated"):
            last((120.0, 100.0, 80.0), reference.vector(torque, 0, 0), np.ones(3), 0.0, 1e9)
    body = (120.0, 120.0, 80.0)
    rates = reference.vector(0.1, 0.0, 3.0)
    with refused(Infeasible, "physics.too-many-steps"):
        series(body, reference.vector(1, 0, 0), rates, START, 0.0, 100.0, most=20)
    with refused(Infeasible, "physics.too-long"):
        last(body, reference.vector(1, 0, 0), rates, 0.0, 1e6)
    with refused(Infeasible, "physics.cases-too-long"):
        cases(2, TENSOR, starts=(2e5,), on_times=(1.0,), constant=np.array([0.0, 0.0, 1e-9])).fly()


# --- many cases at once against the independent integrator, case by case; their spin axes over long
# arcs

STILL = np.zeros(3)

SYMMETRIC = (120.0, 120.0, 80.0)
OBLATE = (80.0, 80.0, 130.0)
TENSOR = (120.0, 100.0, 80.0)


def some_of(pulses: Pulses, which: Any) -> Pulses:
    """Pulses of some of the cases."""
    fields = pulses.starts, pulses.impulses, pulses.leans, pulses.sheds
    starts, impulses, leans, sheds = (None if part is None else part[..., which] for part in fields)
    widths = pulses.on_times
    widths = widths if widths.shape[-1] == 1 or widths.ndim == 1 else widths[:, which]
    return Pulses(present(starts), widths, present(impulses), leans, sheds)


class Case(NamedTuple):
    """The arguments of `rigid_cases.fly`."""

    bodies: Bodies
    rates: reference.Array
    quaternion: reference.Array
    pulses: Pulses

    def fly(self) -> tuple[reference.Array, reference.Array]:
        return fly(*self)

    def some(self, which: Any) -> "Case":
        return Case(
            self.bodies.some(which),
            self.rates[:, which],
            self.quaternion[:, which],
            some_of(self.pulses, which),
        )

    def start(self, number: int) -> reference.Motion:
        return reference.Motion(self.rates[:, number], attitude.matrix(self.quaternion[:, number]))

    def events(self, number: int) -> list[reference.Push | reference.Kick]:
        starts, impulses = self.pulses.starts[:, number], self.pulses.impulses[:, :, number]
        return [
            reference.Push(start, start + width, impulse / width)
            if width
            else reference.Kick(start, impulse)
            for start, width, impulse in zip(
                starts, self.pulses.on_times[:, 0], impulses, strict=True
            )
        ]


def cases(
    count: int,
    moments: Triple = SYMMETRIC,
    spin: float = 3.0,
    starts: tuple[float, ...] = (0.4, 2.9),
    on_times: tuple[float, ...] = (0.5, 0.3),
    jitter: float = 0.05,
    constant: reference.Array = STILL,
    forcing: Forcing = NOTHING,
) -> Case:
    """Dispersed cases: moments by 2 %, rates, attitude at random, torques with an axial part, edges
    by ``jitter`` s.
    """
    draw = np.random.default_rng(7)
    bodies = np.array(moments)[:, None] * (1 + 0.02 * draw.standard_normal((3, count)))
    if moments[0] == moments[1]:
        bodies[1] = bodies[0]
    rates = np.array([0.3, 0.2, spin])[:, None] + 0.01 * draw.standard_normal((3, count))
    quaternion = draw.standard_normal((4, count))
    quaternion /= np.linalg.norm(quaternion, axis=0)
    times = np.maximum(
        np.array(starts)[:, None] + jitter * draw.uniform(-1, 1, (len(starts), count)), 0.0
    )
    torque = np.array([12.0, -9.0, 1.5])[None, :, None] * (
        1 + 0.1 * draw.standard_normal((len(starts), 3, count))
    )
    widths = np.array(on_times, dtype=float)
    impulses = torque * np.where(widths == 0.0, 0.5, widths)[:, None, None]
    return Case(
        Bodies(bodies, constant, forcing),
        rates,
        quaternion,
        Pulses(times, widths[:, None], impulses),
    )


def assert_is(
    flown: tuple[reference.Array, reference.Array],
    number: int,
    motion: reference.Motion,
    tolerance: float,
) -> None:
    assert_allclose(flown[0][:, number], motion.rates, atol=tolerance, rtol=0)
    assert reference.turned(motion.rotation, attitude.matrix(flown[1][:, number])) < tolerance


def assert_flown_alike(case: Case, numbers: Iterable[int], tolerance: float = 2e-12) -> None:
    flown = case.fly()
    assert_allclose(np.linalg.norm(flown[1], axis=0), 1.0, atol=1e-15)
    for number in numbers:
        until = float((case.pulses.starts[:, number] + case.pulses.on_times[:, 0]).max())
        moments = case.bodies.moments[:, number].tolist()
        start = case.start(number)
        growth = case.bodies.forcing.growth
        motion = reference.fly(
            moments, start.rates, case.events(number), until, start.rotation, growth
        )
        assert_is(flown, number, motion, tolerance)


MIXED = {"starts": (0.0, 0.9, 1.0, 1.8), "on_times": (0.0, 0.4, 0.0, 0.0)}


@pytest.mark.parametrize(
    ("options", "numbers", "tolerance"),
    [
        *[
            ({"count": 6, "moments": moments, "spin": spin}, (0, 5), 2e-12)
            for moments in (SYMMETRIC, OBLATE, TENSOR, (100.0, 100.0, 100.0))
            for spin in (3.0, -3.0)
        ],
        # Longer than a turn and far apart.
        ({"count": 2, "starts": (0.0, 25.0), "on_times": (4.0, 6.0)}, (1,), 1e-11),
        deep(
            {"count": 2, "moments": TENSOR, "starts": (0.0, 25.0), "on_times": (4.0, 6.0)},
            (1,),
            1e-11,
        ),
        # Overlapping; ideal impulses among pulses, also at the beginning.
        ({"count": 5, "starts": (0.5, 0.8, 2.0), "on_times": (0.6, 0.2, 0.4)}, (0, 4), 2e-12),
        ({"count": 5, **MIXED, "jitter": 0.0}, (0, 4), 2e-12),
        ({"count": 8, **MIXED, "jitter": 0.2}, (0, 4, 7), 2e-12),
        # In another order in some of them.
        (
            {"count": 30, "starts": (0.5, 1.05, 1.1), "on_times": (0.5, 0.2, 0.4), "jitter": 0.12},
            range(0, 30, 6),
            2e-12,
        ),
    ],
)
def test_pulses_are_flown_as_by_the_reference(
    options: dict[str, Any], numbers: tuple[int, ...], tolerance: float
) -> None:
    assert_flown_alike(cases(**options), numbers, tolerance)


CHANGING = cases(30, starts=(0.5, 1.05, 1.1), on_times=(0.5, 0.2, 0.4), jitter=0.12)
LEANS = np.tile([[-0.2], [0.1], [-0.3]], 30)
ONE = cases(3, starts=(0.4,), on_times=(0.5,), jitter=0.0)
WIDTHS = np.array([[0.5, 0.0, 0.3]])


@pytest.mark.parametrize(
    ("case", "numbers"),
    [
        (CHANGING, range(0, 30, 6)),
        (CHANGING._replace(pulses=replace(CHANGING.pulses, leans=LEANS)), range(0, 30, 6)),
        (ONE._replace(pulses=replace(ONE.pulses, on_times=WIDTHS)), range(3)),
        (cases(BLOCK + 3, on_times=(0.5, 0.0)), (0, BLOCK - 1, BLOCK, BLOCK + 2)),
    ],
    ids=["other orders", "torques that lean", "impulses in some", "more than a block"],
)
def test_cases_fly_together_as_each_alone(case: Case, numbers: Iterable[int]) -> None:
    begun = case.rates.copy()
    flown = case.fly()
    assert_array_equal(case.rates, begun)
    for number in numbers:
        for alone, of_many in zip(case.some([number]).fly(), flown, strict=True):
            assert_allclose(alone[:, 0], of_many[:, number], atol=1e-13)


def forced(case: Case, number: int) -> reference.Motion:
    """The motion at the end, by DOP853 on the equations with all that acts."""
    forcing = case.bodies.forcing
    motion = case.start(number)
    pushes = [event for event in case.events(number) if isinstance(event, reference.Push)]
    turned = turning(*forcing.turning)
    edges = sorted({0.0, *(edge for push in pushes for edge in (push.start, push.end))})
    for begin, end in itertools.pairwise(edges):
        on = [push.torque for push in pushes if push.start < 0.5 * (begin + end) < push.end]
        steady = np.sum([case.bodies.constant, *on], axis=0)

        def torque(t: float, steady: reference.Array = steady) -> reference.Array:
            return np.asarray(steady + turned(t))

        (motion,) = driven(
            case.bodies.moments[:, number].tolist(), motion, torque, [begin, end], forcing.growth
        )
    return motion


@spread("moments", [SYMMETRIC, TENSOR], quick=1)
@spread(
    ("constant", "forcing"),
    [
        (np.array([0.5, -0.3, 0.2]), NOTHING),
        (STILL, Forcing(turning=((0.4 + 0.1j, -3.0), (0.2j, 7.0)))),
        (STILL, Forcing(growth=1 / 20)),
        (np.array([0.1, 0.0, -0.2]), Forcing(turning=((0.3j, 1.0),), growth=-1 / 30)),
    ],
    quick=1,
    ids=["constant", "turning", "growing", "all"],
)
def test_disturbances_and_dissipation(
    moments: Triple, constant: reference.Array, forcing: Forcing
) -> None:
    case = cases(4, moments, constant=constant, forcing=forcing)
    for number in (0, 3):
        assert_is(case.fly(), number, forced(case, number), 1e-11)


def test_cosine_and_sine_by_the_half_angle() -> None:
    angles = np.concatenate(
        [np.linspace(-400.0, 400.0, 2001), [0.0, 1e-300, math.pi, math.pi / 2, 1e-9]]
    )
    assert_allclose(cos_sin(angles), (np.cos(angles), np.sin(angles)), atol=1e-15)


@pytest.mark.weekly
@pytest.mark.parametrize(("sense", "growth"), [(1.0, 3e-3), (-1.0, 3e-3), (1.0, -6e-3)])
def test_few_turns_show_what_all_show(sense: float, growth: float) -> None:
    """Arcs of some 20 to 40 turns with dissipation,
    directions near the spin axis and away from it.
    """
    rng = np.random.default_rng(5)
    count = 60
    first = rng.uniform(80.0, 120.0, count)
    moments = np.array([first, first, first * rng.uniform(0.5, 1.6, count)])
    tilt = rng.uniform(0.02, 0.1, count)
    rates = np.array([np.sin(tilt), 0.3 * np.sin(tilt), sense * np.cos(tilt)]) * rng.uniform(
        1.0, 2.0, count
    )
    upright = np.repeat([[1.0], [0.0], [0.0], [0.0]], count, axis=1)
    away = np.array([rng.uniform(0.0, 0.3, count), rng.uniform(math.pi - 0.3, math.pi, count)])
    round_ = rng.uniform(0.0, 2.0 * math.pi, (2, count))
    directions = np.stack(
        [np.sin(away) * np.cos(round_), np.sin(away) * np.sin(round_), np.cos(away)], axis=1
    )
    lasts = (
        rng.uniform(20.0, 40.0, count)
        * 2.0
        * math.pi
        * first
        / np.linalg.norm(moments * rates, axis=0)
    )
    here = MotionStretch(
        Bodies(moments, np.zeros(3), Forcing(growth=growth)), np.zeros(count), rates, upright
    )
    few, every = AxisWatch.of(directions, sense), AxisWatch.of(directions, sense)
    every._steps(here, lasts)
    few.motion(here, lasts)
    assert few.angles == pytest.approx(every.angles, abs=3e-5)


def test_cases_with_pulses_in_different_orders_are_watched_as_each_alone() -> None:
    case = cases(6, jitter=2.0)
    directions = np.repeat(np.array([[[0.0], [0.6], [0.8]]]), 6, axis=2)
    together = AxisWatch.of(directions, 1.0)
    fly(*case, together)
    assert len({tuple(order) for order in np.argsort(case.pulses.edges, axis=0).T.tolist()}) > 1
    for number in range(6):
        alone = AxisWatch.of(directions[:, :, [number]], 1.0)
        fly(*case.some([number]), alone)
        assert together.angles[..., [number]] == pytest.approx(alone.angles, abs=1e-5)


@pytest.mark.parametrize(
    ("moments", "forcing", "sheds"),
    [
        (SYMMETRIC, NOTHING, (0.0, 0.0, 0.0)),
        (OBLATE, NOTHING, (2.0, 2.0, 1.0)),
        (TENSOR, Forcing(wheel=30.0), (2.0, 1.0, 0.5)),
        (TENSOR, Forcing(turning=TURNING), (2.0, 1.0, 0.5)),
    ],
    ids=["constant moments", "symmetric", "three moments", "turning torques"],
)
def test_torques_that_rise_and_moments_that_fall(
    moments: Triple, forcing: Forcing, sheds: Triple
) -> None:
    """Over several steps, against I dω/dt = M - ω × (Iω + h) with I and M as they are."""
    rates, torque, slope = reference.vector(0.3, -0.2, 2.0), np.array([6.0, -4.0, 2.0]), np.ones(3)
    rate, growth = -np.array(sheds) / 4.0, np.array(sheds) / 40.0
    start = MotionStretch(
        Bodies(np.array(moments), np.array([0.1, 0.0, -0.2]), forcing),
        0.5,
        rates,
        START,
        torque,
        slope,
        Falling(rate, growth) if any(sheds) else None,
    )
    pieces = list(polynomials(start, 4.0))
    acting = turning(*forcing.turning)

    def euler(t: float, state: reference.Array) -> reference.Array:
        inertia = np.array(moments) + rate * (t - 0.5) + 0.5 * growth * (t - 0.5) ** 2
        push = start.bodies.constant + torque + slope * (t - 0.5) + acting(t)
        momentum = inertia * state[:3] + (0.0, 0.0, forcing.wheel)
        turned = 0.5 * attitude.multiply(state[3:], np.array([0.0, *state[:3]]))
        return np.concatenate([(push - np.cross(state[:3], momentum)) / inertia, turned])

    state = np.concatenate([rates, START])
    flown = solve_ivp(euler, (0.5, 4.5), state, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    assert len(pieces) > 2
    assert np.concatenate(pieces[-1].end()) == pytest.approx(flown, abs=1e-10)
