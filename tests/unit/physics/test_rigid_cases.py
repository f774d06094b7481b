"""Many cases at once against the independent integrator, case by case."""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from support import reference
from support.cases import spread
from support.reference import Array, Kick, Push

from nutdamp.errors import Infeasible
from nutdamp.physics import attitude
from nutdamp.physics import rigid_cases as many
from nutdamp.physics.rigid import NOTHING, Forcing
from nutdamp.physics.rigid_cases import Bodies, Pulses

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
        return many.fly(*self)


def cases(
    count: int,
    moments: tuple[float, float, float] = SYMMETRIC,
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
    return Case(Bodies(bodies, constant, forcing), rates, quaternion, Pulses(times, widths, impulses))


def events(case: Case, number: int) -> list[Push | Kick]:
    found: list[Push | Kick] = []
    for start, on_time, impulse in zip(
        case.pulses.starts[:, number], case.pulses.on_times, case.pulses.impulses[:, :, number], strict=True
    ):
        found.append(Push(start, start + on_time, impulse / on_time) if on_time else Kick(start, impulse))
    return found


def assert_flown_alike(case: Case, numbers: range, tolerance: float = 2e-12) -> None:
    rates, quaternion = case.fly()
    assert_allclose(np.linalg.norm(quaternion, axis=0), 1.0, atol=1e-15)
    for number in numbers:
        until = float((case.pulses.starts[:, number] + case.pulses.on_times).max())
        start = attitude.matrix(case.quaternion[:, number])
        moments = case.bodies.moments[:, number].tolist()
        motion = reference.fly(moments, case.rates[:, number], events(case, number), until, start)
        assert_allclose(rates[:, number], motion.rates, atol=tolerance, rtol=0)
        assert reference.turned(motion.rotation, attitude.matrix(quaternion[:, number])) < tolerance


@pytest.mark.parametrize("moments", [SYMMETRIC, OBLATE, TENSOR, (100.0, 100.0, 100.0)])
@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_pulses_of_real_width(moments: tuple[float, float, float], spin: float) -> None:
    assert_flown_alike(cases(20, moments, spin), range(0, 20, 5))


@pytest.mark.parametrize("moments", [SYMMETRIC, TENSOR])
def test_pulses_longer_than_a_turn_and_far_apart(moments: tuple[float, float, float]) -> None:
    assert_flown_alike(cases(6, moments, starts=(0.0, 25.0), on_times=(4.0, 6.0)), range(3), 1e-11)


def test_pulses_that_overlap_in_every_case() -> None:
    assert_flown_alike(cases(8, starts=(0.5, 0.8, 2.0), on_times=(0.6, 0.2, 0.4)), range(0, 8, 2))


def test_pulses_that_change_their_order_in_some_cases() -> None:
    case = cases(30, starts=(0.5, 1.05, 1.1), on_times=(0.5, 0.2, 0.4), jitter=0.12)
    order = np.argsort(case.pulses.edges, axis=0)
    assert len({tuple(column) for column in order.T}) > 3
    assert_flown_alike(case, range(0, 30, 3))


def test_ideal_impulses_among_pulses_also_at_the_beginning() -> None:
    case = cases(12, starts=(0.0, 0.9, 1.0, 1.8), on_times=(0.0, 0.4, 0.0, 0.0), jitter=0.0)
    assert_flown_alike(case, range(0, 12, 4))
    shaken = cases(12, starts=(0.0, 0.9, 1.0, 1.8), on_times=(0.0, 0.4, 0.0, 0.0), jitter=0.2)
    assert_flown_alike(shaken, range(0, 12, 3))


def test_the_spin_may_stop_and_turn_round() -> None:
    case = cases(8, spin=0.2, starts=(0.3,), on_times=(3.0,))
    case.pulses.impulses[:, 2] = -60.0  # from 0.2 rad/s to about -0.55
    assert_flown_alike(case, range(0, 8, 2))
    assert np.all(case.fly()[0][2] < -0.3)


def test_no_pulses_and_no_time() -> None:
    case = cases(3, starts=(), on_times=())
    for found, given in zip(case.fly(), (case.rates, case.quaternion), strict=True):
        assert_array_equal(found, given)


def test_what_it_is_given_stays_as_it_is() -> None:
    case = cases(5)
    copies = [case.rates.copy(), case.quaternion.copy(), case.pulses.starts.copy(), case.pulses.impulses.copy()]
    case.fly()
    for kept, given in zip(
        copies, (case.rates, case.quaternion, case.pulses.starts, case.pulses.impulses), strict=True
    ):
        assert_array_equal(kept, given)


def test_blocks_hold_what_single_cases_give() -> None:
    case = cases(many.BLOCK + 3, on_times=(0.5, 0.0))
    rates, quaternion = case.fly()
    for number in (0, many.BLOCK - 1, many.BLOCK, many.BLOCK + 2):
        one = [number]
        alone = many.fly(case.bodies.some(one), case.rates[:, one], case.quaternion[:, one], case.pulses.some(one))
        assert_allclose(alone[0][:, 0], rates[:, number], atol=1e-14)
        assert_allclose(alone[1][:, 0], quaternion[:, number], atol=1e-14)


def test_the_same_block_gives_the_same_bits() -> None:
    case = cases(2 * many.BLOCK)
    half = slice(many.BLOCK, None)
    rates, quaternion = case.fly()
    again = many.fly(case.bodies.some(half), case.rates[:, half], case.quaternion[:, half], case.pulses.some(half))
    assert_array_equal(again[0], rates[:, half])
    assert_array_equal(again[1], quaternion[:, half])


def forced(case: Case, number: int) -> tuple[Array, Array]:
    """Rates and attitude matrix at the end, by DOP853 on the equations with all that acts."""
    moments, forcing = case.bodies.moments[:, number], case.bodies.forcing
    pushes = [event for event in events(case, number) if isinstance(event, Push)]

    def slope(t: float, y: Array, torque: Array) -> Array:
        w, rotation = y[:3], y[3:].reshape(3, 3)
        h = moments * w
        total = torque + case.bodies.constant
        for size, rate in forcing.turning:
            turned = size * complex(math.cos(rate * t), math.sin(rate * t))
            total = total + np.array([turned.real, turned.imag, 0.0])
        along = h[2] / (h @ h) * h - np.array([0.0, 0.0, 1.0])
        drive = forcing.growth * h[2] * along  # κ H1 cos²θ, κ H2 cos²θ, -κ H3 sin²θ
        slip = w + np.cross(drive, h) / (h @ h)
        cross = np.array([[0, -slip[2], slip[1]], [slip[2], 0, -slip[0]], [-slip[1], slip[0], 0]])
        return np.concatenate([(total + drive - np.cross(w, h)) / moments, (rotation @ cross).ravel()])

    y = np.concatenate([case.rates[:, number], attitude.matrix(case.quaternion[:, number]).ravel()])
    edges = sorted({0.0, *(edge for push in pushes for edge in (push.start, push.end))})
    for begin, end in itertools.pairwise(edges):
        on = [push.torque for push in pushes if push.start < 0.5 * (begin + end) < push.end]
        torque = np.sum(on, axis=0) if on else np.zeros(3)
        y = solve_ivp(slope, (begin, end), y, method="DOP853", rtol=1e-13, atol=1e-14, args=(torque,)).y[:, -1]
    return y[:3], y[3:].reshape(3, 3)


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
def test_disturbances_and_dissipation(moments: tuple[float, float, float], constant: Array, forcing: Forcing) -> None:
    case = cases(6, moments, constant=constant, forcing=forcing)
    rates, quaternion = case.fly()
    for number in range(0, 6, 3):
        body, rotation = forced(case, number)
        assert_allclose(rates[:, number], body, atol=1e-11, rtol=0)
        assert reference.turned(rotation, attitude.matrix(quaternion[:, number])) < 1e-11


@pytest.mark.deep
@spread("moments", [SYMMETRIC, OBLATE], quick=1)
def test_coasts_under_dissipation_end_in_flat_or_in_pure_spin(moments: tuple[float, float, float]) -> None:
    growth = math.copysign(1 / 40, moments[0] - moments[2])
    case = cases(6, moments, starts=(0.5, 200.0), on_times=(0.5, 0.0), forcing=Forcing(growth=growth))
    case.rates[:2, 0] = 3.0  # far out already
    case.pulses.impulses[1] *= 1e-3
    rates, quaternion = case.fly()
    for number in (0, 3):
        motion = reference.fly(
            case.bodies.moments[:, number].tolist(),
            case.rates[:, number],
            events(case, number),
            float(case.pulses.starts[1, number]),
            attitude.matrix(case.quaternion[:, number]),
            growth,
        )
        assert_allclose(rates[:, number], motion.rates, atol=1e-10, rtol=0)
        assert reference.turned(motion.rotation, attitude.matrix(quaternion[:, number])) < 1e-10
    momentum = rates * case.bodies.moments
    tilt = np.degrees(np.arctan2(np.hypot(momentum[0], momentum[1]), momentum[2]))
    assert np.all((tilt > 80.0) & (tilt < 90.0) if growth > 0.0 else tilt < 1.0)


def test_motions_too_long_to_integrate_are_refused() -> None:
    with pytest.raises(Infeasible, match="too many to be integrated"):
        cases(2, TENSOR, starts=(2e5,), on_times=(1.0,)).fly()


def test_a_long_free_coast_is_exact() -> None:
    case = cases(4, starts=(1e4,), on_times=(0.0,), jitter=0.0)
    case.pulses.impulses[:] = 0.0
    rates, quaternion = case.fly()
    for number in range(4):
        A, _, C = case.bodies.moments[:, number].tolist()
        first, second, spin = case.rates[:, number].tolist()
        after = attitude.arc(A, C, case.quaternion[:, number], complex(first, second), spin, np.array([1e4]))[0]
        assert reference.turned(attitude.matrix(after), attitude.matrix(quaternion[:, number])) < 1e-10
        assert math.hypot(*rates[:2, number]) == pytest.approx(math.hypot(first, second), rel=1e-13)


def test_cosine_and_sine_by_the_half_angle() -> None:
    angles = np.concatenate([np.linspace(-400.0, 400.0, 2001), [0.0, 1e-300, math.pi, math.pi / 2, 1e-9]])
    cosine, sine = many.cos_sin(angles)
    assert_allclose(cosine, np.cos(angles), atol=1e-15)
    assert_allclose(sine, np.sin(angles), atol=1e-15)
