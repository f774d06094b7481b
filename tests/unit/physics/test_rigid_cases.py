"""Many cases at once against the independent integrator, case by case; their spin axes over long arcs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support import reference
from support.cases import deep, spread
from support.golden import refused
from support.reference import Array, Kick, Motion, Push
from support.spinning import Triple, driven, turning

from nutdamp.common.numerics import cos_sin
from nutdamp.errors import Infeasible
from nutdamp.physics import attitude, batch
from nutdamp.physics.batch import Bodies, MotionStretch, Pulses
from nutdamp.physics.sky import AxisWatch
from nutdamp.physics.taylor import NOTHING, Forcing

STILL = np.zeros(3)

SYMMETRIC = (120.0, 120.0, 80.0)
OBLATE = (80.0, 80.0, 130.0)
TENSOR = (120.0, 100.0, 80.0)


class Case(NamedTuple):
    """The arguments of `rigid_cases.fly`."""

    bodies: Bodies
    rates: Array
    quaternion: Array
    pulses: Pulses

    def fly(self) -> tuple[Array, Array]:
        return batch.fly(*self)

    def some(self, which: Any) -> Case:
        return Case(self.bodies.some(which), self.rates[:, which], self.quaternion[:, which], self.pulses.some(which))

    def start(self, number: int) -> Motion:
        return Motion(self.rates[:, number], attitude.matrix(self.quaternion[:, number]))

    def events(self, number: int) -> list[Push | Kick]:
        starts, impulses = self.pulses.starts[:, number], self.pulses.impulses[:, :, number]
        return [
            Push(start, start + width, impulse / width) if width else Kick(start, impulse)
            for start, width, impulse in zip(starts, self.pulses.on_times[:, 0], impulses, strict=True)
        ]


def cases(
    count: int,
    moments: Triple = SYMMETRIC,
    spin: float = 3.0,
    starts: tuple[float, ...] = (0.4, 2.9),
    on_times: tuple[float, ...] = (0.5, 0.3),
    jitter: float = 0.05,
    constant: Array = STILL,
    forcing: Forcing = NOTHING,
) -> Case:
    """Dispersed cases: moments by 2 %, rates, attitude at random, torques with an axial part, edges by ``jitter`` s."""
    draw = np.random.default_rng(7)
    bodies = np.array(moments)[:, None] * (1 + 0.02 * draw.standard_normal((3, count)))
    if moments[0] == moments[1]:
        bodies[1] = bodies[0]
    rates = np.array([0.3, 0.2, spin])[:, None] + 0.01 * draw.standard_normal((3, count))
    quaternion = draw.standard_normal((4, count))
    quaternion /= np.linalg.norm(quaternion, axis=0)
    times = np.maximum(np.array(starts)[:, None] + jitter * draw.uniform(-1, 1, (len(starts), count)), 0.0)
    torque = np.array([12.0, -9.0, 1.5])[None, :, None] * (1 + 0.1 * draw.standard_normal((len(starts), 3, count)))
    widths = np.array(on_times, dtype=float)
    impulses = torque * np.where(widths == 0.0, 0.5, widths)[:, None, None]
    return Case(Bodies(bodies, constant, forcing), rates, quaternion, Pulses(times, widths[:, None], impulses))


def assert_is(flown: tuple[Array, Array], number: int, motion: Motion, tolerance: float) -> None:
    assert_allclose(flown[0][:, number], motion.rates, atol=tolerance, rtol=0)
    assert reference.turned(motion.rotation, attitude.matrix(flown[1][:, number])) < tolerance


def assert_flown_alike(case: Case, numbers: Iterable[int], tolerance: float = 2e-12) -> None:
    flown = case.fly()
    assert_allclose(np.linalg.norm(flown[1], axis=0), 1.0, atol=1e-15)
    for number in numbers:
        until = float((case.pulses.starts[:, number] + case.pulses.on_times[:, 0]).max())
        moments, start = case.bodies.moments[:, number].tolist(), case.start(number)
        growth = case.bodies.forcing.growth
        motion = reference.fly(moments, start.rates, case.events(number), until, start.rotation, growth)
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
        deep({"count": 2, "moments": TENSOR, "starts": (0.0, 25.0), "on_times": (4.0, 6.0)}, (1,), 1e-11),
        # Overlapping; ideal impulses among pulses, also at the beginning.
        ({"count": 5, "starts": (0.5, 0.8, 2.0), "on_times": (0.6, 0.2, 0.4)}, (0, 4), 2e-12),
        ({"count": 5, **MIXED, "jitter": 0.0}, (0, 4), 2e-12),
        ({"count": 8, **MIXED, "jitter": 0.2}, (0, 4, 7), 2e-12),
    ],
)
def test_pulses_are_flown_as_by_the_reference(
    options: dict[str, Any], numbers: tuple[int, ...], tolerance: float
) -> None:
    assert_flown_alike(cases(**options), numbers, tolerance)


def test_pulses_that_change_their_order_in_some_cases() -> None:
    case = cases(30, starts=(0.5, 1.05, 1.1), on_times=(0.5, 0.2, 0.4), jitter=0.12)
    order = np.argsort(case.pulses.edges, axis=0)
    assert len({tuple(column) for column in order.T}) > 3
    assert_flown_alike(case, range(0, 30, 6))


def test_the_spin_may_stop_and_turn_round() -> None:
    case = cases(4, spin=0.2, starts=(0.3,), on_times=(3.0,))
    case.pulses.impulses[:, 2] = -60.0  # from 0.2 rad/s to about -0.55
    assert_flown_alike(case, (0, 3))
    assert np.all(case.fly()[0][2] < -0.3)


def test_no_pulses_and_no_time_and_what_is_given_stays() -> None:
    case = cases(3, starts=(), on_times=())
    for flown, start in zip(case.fly(), (case.rates, case.quaternion), strict=True):
        assert_array_equal(flown, start)
    case, same = cases(5), cases(5)
    case.fly()
    assert_array_equal(case.rates, same.rates)
    assert_array_equal(case.quaternion, same.quaternion)
    assert_array_equal(case.pulses.starts, same.pulses.starts)
    assert_array_equal(case.pulses.impulses, same.pulses.impulses)


def test_blocks_hold_what_single_cases_give_and_the_same_block_the_same_bits() -> None:
    case = cases(batch.BLOCK + 3, on_times=(0.5, 0.0))
    flown = case.fly()
    for number in (0, batch.BLOCK - 1, batch.BLOCK, batch.BLOCK + 2):
        for alone, of_many in zip(case.some([number]).fly(), flown, strict=True):
            assert_allclose(alone[:, 0], of_many[:, number], atol=1e-14)
    case, half = cases(2 * batch.BLOCK), slice(batch.BLOCK, None)
    for alone, of_many in zip(case.some(half).fly(), case.fly(), strict=True):
        assert_array_equal(alone, of_many[:, half])


def forced(case: Case, number: int) -> Motion:
    """The motion at the end, by DOP853 on the equations with all that acts."""
    forcing, motion = case.bodies.forcing, case.start(number)
    pushes, turned = [event for event in case.events(number) if isinstance(event, Push)], turning(*forcing.turning)
    edges = sorted({0.0, *(edge for push in pushes for edge in (push.start, push.end))})
    for begin, end in itertools.pairwise(edges):
        on = [push.torque for push in pushes if push.start < 0.5 * (begin + end) < push.end]
        steady = np.sum([case.bodies.constant, *on], axis=0)

        def torque(t: float, steady: Array = steady) -> Array:
            return np.asarray(steady + turned(t))

        (motion,) = driven(case.bodies.moments[:, number].tolist(), motion, torque, [begin, end], forcing.growth)
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
def test_disturbances_and_dissipation(moments: Triple, constant: Array, forcing: Forcing) -> None:
    case = cases(4, moments, constant=constant, forcing=forcing)
    for number in (0, 3):
        assert_is(case.fly(), number, forced(case, number), 1e-11)


@pytest.mark.deep
@spread("moments", [SYMMETRIC, OBLATE], quick=1)
def test_coasts_under_dissipation_end_in_flat_or_in_pure_spin(moments: Triple) -> None:
    growth = math.copysign(1 / 40, moments[0] - moments[2])
    case = cases(6, moments, starts=(0.5, 200.0), on_times=(0.5, 0.0), forcing=Forcing(growth=growth))
    case.rates[:2, 0] = 3.0  # far out already
    case.pulses.impulses[1] *= 1e-3
    assert_flown_alike(case, (0, 3), 1e-10)
    momentum = case.fly()[0] * case.bodies.moments
    tilt = np.degrees(np.arctan2(np.hypot(momentum[0], momentum[1]), momentum[2]))
    assert np.all((tilt > 80.0) & (tilt < 90.0) if growth > 0.0 else tilt < 1.0)


def test_a_long_free_coast_is_exact_and_motions_too_long_to_integrate_are_refused() -> None:
    case = cases(4, starts=(1e4,), on_times=(0.0,), jitter=0.0)
    case.pulses.impulses[:] = 0.0
    rates, quaternion = case.fly()
    for number in range(4):
        A, _, C = case.bodies.moments[:, number].tolist()
        first, second, spin = case.rates[:, number].tolist()
        (after,) = attitude.arc(A, C, case.quaternion[:, number], complex(first, second), spin, np.array([1e4]))
        assert reference.turned(attitude.matrix(after), attitude.matrix(quaternion[:, number])) < 1e-10
        assert math.hypot(*rates[:2, number]) == pytest.approx(math.hypot(first, second), rel=1e-13)
    with refused(Infeasible, "physics.cases-too-long"):
        cases(2, TENSOR, starts=(2e5,), on_times=(1.0,)).fly()


def test_cosine_and_sine_by_the_half_angle() -> None:
    angles = np.concatenate([np.linspace(-400.0, 400.0, 2001), [0.0, 1e-300, math.pi, math.pi / 2, 1e-9]])
    assert_allclose(cos_sin(angles), (np.cos(angles), np.sin(angles)), atol=1e-15)


@pytest.mark.weekly
@pytest.mark.parametrize(("sense", "growth"), [(1.0, 3e-3), (-1.0, 3e-3), (1.0, -6e-3)])
def test_few_turns_show_what_all_show(sense: float, growth: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Arcs of some 20 to 40 turns with dissipation, directions near the spin axis and away from it."""
    rng, count = np.random.default_rng(5), 60
    first = rng.uniform(80.0, 120.0, count)
    moments = np.array([first, first, first * rng.uniform(0.5, 1.6, count)])
    tilt = rng.uniform(0.02, 0.1, count)
    rates = np.array([np.sin(tilt), 0.3 * np.sin(tilt), sense * np.cos(tilt)]) * rng.uniform(1.0, 2.0, count)
    upright = np.repeat([[1.0], [0.0], [0.0], [0.0]], count, axis=1)
    away = np.array([rng.uniform(0.0, 0.3, count), rng.uniform(math.pi - 0.3, math.pi, count)])
    round_ = rng.uniform(0.0, 2.0 * math.pi, (2, count))
    directions = np.stack([np.sin(away) * np.cos(round_), np.sin(away) * np.sin(round_), np.cos(away)], axis=1)
    lasts = rng.uniform(20.0, 40.0, count) * 2.0 * math.pi * first / np.linalg.norm(moments * rates, axis=0)
    here = MotionStretch(Bodies(moments, np.zeros(3), Forcing(growth=growth)), np.zeros(count), rates, upright)
    few, every = AxisWatch.of(directions, sense), AxisWatch.of(directions, sense)
    every._steps(here, lasts)
    steps: list[int] = []
    stepped = AxisWatch._steps

    def counted(self: AxisWatch, begin: MotionStretch, duration: Array) -> None:
        steps.append(len(duration))
        stepped(self, begin, duration)

    monkeypatch.setattr(AxisWatch, "_steps", counted)
    few.motion(here, lasts)
    assert few.angles == pytest.approx(every.angles, abs=3e-5)
    assert steps[0] < count // 2  # followed all the way
    assert steps[1:] == [count - steps[0]] * 2


def test_cases_with_pulses_in_different_orders_are_watched_as_each_alone() -> None:
    case = cases(6, jitter=2.0)
    directions = np.repeat(np.array([[[0.0], [0.6], [0.8]]]), 6, axis=2)
    together = AxisWatch.of(directions, 1.0)
    batch.fly(*case, together)
    assert len({tuple(order) for order in np.argsort(case.pulses.edges, axis=0).T.tolist()}) > 1
    for number in range(6):
        alone = AxisWatch.of(directions[:, :, [number]], 1.0)
        batch.fly(*case.some([number]), alone)
        assert together.angles[..., [number]] == pytest.approx(alone.angles, abs=1e-5)
