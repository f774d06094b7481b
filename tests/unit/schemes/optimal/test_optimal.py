"""The scheme optimal: the linear program's optima, its bounds, and the flown schedules."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares, linprog
from scipy.spatial.transform import Rotation
from support import reference
from support.builders import Outcome, spinner
from support.cases import deep, spread
from support.checker import violations

from nutdamp.compliance import SAME_COST
from nutdamp.planning import plan
from nutdamp.remarks import broken_limits, infeasibility, remarks
from nutdamp.schemes import Options
from nutdamp.schemes.optimal import search
from nutdamp.schemes.optimal.linear_program import Program, Solution
from nutdamp.schemes.optimal.residual_equations import Equations, small_angles
from nutdamp.schemes.optimal.search import _Search
from nutdamp.schemes.options import OptimalOptions
from nutdamp.spacecraft import Channel, Limits, Spacecraft, Thruster

NANODEGREE = math.radians(1e-9)
MICRODEGREE = math.radians(1e-6)
CROSS = {"+1": (1.0, 0.0, 0.0), "-1": (-1.0, 0.0, 0.0), "+2": (0.0, 1.0, 0.0), "-2": (0.0, -1.0, 0.0)}


def channels(
    torque: float, names: str = "+1 -1 +2 -2", min_on_time: float = 0.0, max_on_time: float = math.inf
) -> tuple[Channel, ...]:
    def thruster(name: str) -> Thruster:
        return Thruster(name, torque * np.array(CROSS[name]), None, 10.0, 220.0, min_on_time, max_on_time)

    return tuple(Channel(name, (thruster(name),)) for name in names.split())


def body(A: float, C: float, spin: float, horizon: float, names: str = "+1 -1 +2 -2") -> Spacecraft:
    """Practically ideal impulses: a torque that needs a microsecond."""
    return spinner(A, C, spin, 5.0, 0.7, channels=channels(1e7, names), limits=Limits(horizon=horizon))


def optimum(spacecraft: Spacecraft, per_impulse: np.ndarray | None = None) -> Solution:
    """The program of small angles, at these costs of one N m s in each channel, or one."""
    torques = np.array([np.linalg.norm(channel.torque) for channel in spacecraft.channels])
    costs = torques if per_impulse is None else torques * per_impulse
    return Program(spacecraft, spacecraft.channels, costs, small_angles(spacecraft, Equations())).solve()


PUBLISHED = [
    (120.0, 80.0, 3.0, 3.2, "+1 -1 +2 -2", 1.000),
    (120.0, 80.0, 3.0, 2.0, "+1 -1 +2 -2", 1.118),
    (120.0, 80.0, 3.0, 1.0, "+1 -1 +2 -2", 1.397),
    (120.0, 80.0, -3.0, 2.0, "+1 -1 +2 -2", 1.151),
    (80.0, 120.0, 3.0, 2.0, "+1 -1 +2 -2", 1.082),
    (120.0, 80.0, 3.0, 8.0, "+1", 1.155),
    (100.0, 80.0, 3.0, 200.0, "+1 -1 +2 -2", 1.051),
    (90.0, 120.0, 3.0, 200.0, "+1 -1 +2 -2", 1.155),
]


@pytest.mark.parametrize(("A", "C", "spin", "horizon", "names", "cost"), PUBLISHED)
def test_small_angle_optima(A: float, C: float, spin: float, horizon: float, names: str, cost: float) -> None:
    spacecraft = body(A, C, spin, horizon, names)
    found = optimum(spacecraft)
    assert found.unmet < 1e-9
    assert found.cost / spacecraft.least_impulse == pytest.approx(cost, abs=6e-4)
    assert len(found.burns) <= 4


@spread(("A", "C", "spin", "horizon", "names", "cost"), PUBLISHED, quick=3)
def test_flown_schedules_leave_nothing_at_that_cost(
    A: float, C: float, spin: float, horizon: float, names: str, cost: float
) -> None:
    spacecraft = body(A, C, spin, horizon, names)
    made = plan(spacecraft, "optimal")
    assert made.flown is not None, infeasibility(made)
    assert max(made.flown.nutation, made.flown.momentum_shift) < MICRODEGREE
    assert made.pulses.total_impulse / spacecraft.least_impulse == pytest.approx(cost, rel=0.01)
    assert made.pulses.bounds is not None
    assert made.pulses.bounds.rigorous is not None
    assert made.pulses.bounds.first_order is not None
    assert made.pulses.bounds.rigorous <= made.pulses.bounds.first_order * (1 + 1e-6)


def dense(spacecraft: Spacecraft, costs: np.ndarray, points: int) -> float:
    """The same optimum from one large grid of impulses, without any of the program's code."""
    inertia, omega = spacecraft.inertia, complex(spacecraft.omega0[0], spacecraft.omega0[1])
    times = np.linspace(0.0, spacecraft.horizon, points)
    rows = []
    for rate in (inertia.a * spacecraft.spin, spacecraft.spin):
        turned = np.concatenate(
            [c.transverse / abs(c.transverse) * np.exp(1j * rate * times) for c in spacecraft.channels]
        )
        rows += [turned.real, turned.imag]
    goal = -inertia.A * np.array([omega.real, omega.imag, 0.0, 0.0])
    found = linprog(np.repeat(costs, points), A_eq=np.array(rows), b_eq=goal, method="highs")
    assert found.fun is not None
    return float(found.fun)


@spread("seed", range(12), quick=1)
def test_the_optimum_is_that_of_a_dense_grid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = rng.uniform(0, 2 * math.pi, 5)
    skew = tuple(
        Channel(f"c{i}", (Thruster(f"c{i}", 1e7 * np.array([math.cos(angle), math.sin(angle), 0.0])),))
        for i, angle in enumerate(angles)
    )
    A, C, spin = 120.0, rng.choice([50.0, 90.0, 150.0, 220.0]), rng.choice([-2.0, 3.0])
    spacecraft = spinner(A, C, spin, 2.0, channels=skew, limits=Limits(horizon=8.0))
    costs = rng.uniform(1.0, 3.0, 5)
    found = optimum(spacecraft, costs)
    if found.unmet > 1e-9:
        pytest.skip("no solution for this layout")
    assert found.cost == pytest.approx(dense(spacecraft, costs, 6000), rel=1e-4)


def test_no_pair_or_triple_of_a_brute_search_is_cheaper() -> None:
    """Two impulses at any two moments of a fine grid, solved for their strengths."""
    spacecraft = body(120.0, 80.0, 3.0, 3.0)
    found = optimum(spacecraft)
    inertia, omega = spacecraft.inertia, complex(spacecraft.omega0[0], spacecraft.omega0[1])
    times = np.linspace(0.0, 3.0, 61)
    goal = -inertia.A * np.array([omega.real, omega.imag, 0.0, 0.0])
    columns = []
    for channel in spacecraft.channels:
        for time in times:
            turned = [channel.transverse / 1e7 * np.exp(1j * rate * time) for rate in (inertia.a * 3.0, 3.0)]
            columns.append([part for row in turned for part in (row.real, row.imag)])
    table = np.array(columns)
    rng = np.random.default_rng(3)
    cheapest = math.inf
    for _ in range(4000):
        chosen = rng.choice(len(table), size=4, replace=False)
        matrix = table[chosen].T
        if abs(np.linalg.det(matrix)) > 1e-6:
            strengths = np.linalg.solve(matrix, goal)
            if strengths.min() >= 0.0:
                cheapest = min(cheapest, float(strengths.sum()))
    assert found.cost <= cheapest * 1.001


@spread("degrees", [1.0, 5.0, 15.0], quick=1)
@spread(("A", "C", "spin"), [(120.0, 80.0, 3.0), (120.0, 80.0, -3.0), (90.0, 120.0, 2.0)], quick=3)
def test_real_thrusters_keep_their_limits_and_leave_nothing(A: float, C: float, spin: float, degrees: float) -> None:
    limits = Limits(blackout=((3.0, 9.0),), earliest=1.0)
    real = channels(8.0, min_on_time=0.02, max_on_time=2.0)
    spacecraft = spinner(A, C, spin, degrees, channels=real, limits=limits)
    made = plan(spacecraft, "optimal")
    assert made.flown is not None, infeasibility(made)
    assert max(made.flown.nutation, made.flown.momentum_shift) < MICRODEGREE
    assert broken_limits(spacecraft, made.pulses) == []
    bounds = made.pulses.bounds
    assert bounds is not None
    assert made.pulses.propellant is not None
    assert bounds.unit == "kg"
    assert bounds.rigorous is not None
    assert bounds.rigorous <= made.pulses.propellant
    assert bounds.first_order is not None
    assert made.pulses.propellant <= bounds.first_order * 1.02


def test_a_free_axis_is_no_dearer_and_leaves_no_nutation() -> None:
    spacecraft = body(120.0, 80.0, 3.0, 1.0)
    kept, free = (plan(spacecraft, "optimal", Options(free_axis=flag)) for flag in (False, True))
    assert free.flown is not None
    assert free.flown.nutation < MICRODEGREE
    assert free.pulses.total_impulse < kept.pulses.total_impulse


def test_an_impossible_deadline_says_what_to_relax() -> None:
    kept_only = plan(body(120.0, 80.0, 3.0, 0.4, "+1 +2"), "optimal")
    assert "horizon" in infeasibility(kept_only)
    nothing = plan(body(120.0, 80.0, 3.0, 0.05, "+1"), "optimal")
    assert "cannot take out the nutation" in infeasibility(nothing)


def test_the_plan_carries_its_proof() -> None:
    spacecraft = spinner(channels=channels(8.0, min_on_time=0.02, max_on_time=2.0))
    said = remarks(plan(spacecraft, "optimal"))
    assert any("first-order least within" in text and "leaves as little takes less than" in text for text in said)


def test_few_pulses_are_preferred_to_the_last_tenth_of_a_percent() -> None:
    spacecraft = spinner(channels=channels(8.0, min_on_time=0.02, max_on_time=2.0))
    made = plan(spacecraft, "optimal")
    assert len(made.pulses) <= 12
    for one, two in itertools.pairwise(made.pulses):
        assert one.t < two.t


def random_layout(seed: int) -> Spacecraft:
    """2 to 12 skew channels, some with axial torque, 1° to 30° of nutation, 1 to 50 body nutation periods."""
    rng = np.random.default_rng(seed)
    count, A, spin = int(rng.integers(2, 13)), rng.uniform(60, 200), rng.uniform(0.5, 6) * rng.choice([-1, 1])
    C = A * float(rng.choice([rng.uniform(0.3, 0.95), rng.uniform(1.05, 1.9)]))
    degrees = rng.uniform(1, 30)
    period = 2 * math.pi / abs((A - C) / A * spin)
    horizon = rng.uniform(1, 50) * period
    needed = C * abs(spin) * math.tan(math.radians(degrees)) / period
    made = []
    for index in range(count):
        angle, size = rng.uniform(0, 2 * math.pi), needed * 10 ** rng.uniform(-0.7, 1.5)
        axial = rng.uniform(-0.2, 0.2) * size * (rng.random() < 0.4)
        torque = np.array([size * math.cos(angle), size * math.sin(angle), axial])
        shortest, longest = rng.choice([0.0, 0.02]), math.inf if rng.random() < 0.5 else rng.uniform(0.2, 4)
        one = Thruster(f"c{index}", torque, None, rng.uniform(1, 20), 220.0, shortest, longest)
        made.append(Channel(f"c{index}", (one,)))
    return spinner(A, C, spin, degrees, rng.uniform(0, 6.28), channels=tuple(made), limits=Limits(horizon=horizon))


TEN_MICRODEGREE = math.radians(1e-5)


def flies(seed: int, dearest: float) -> None:
    """Flown by the reference integrator, nothing is left, within all limits, and the rigorous bound holds.

    The cost lies below ``dearest`` times the first-order bound, which knows neither large angles nor on-times.
    """
    spacecraft = random_layout(seed)
    made = plan(spacecraft, "optimal")
    assert made.schedule is not None, infeasibility(made)
    assert made.schedule.bounds is not None
    assert violations(spacecraft, made.pulses) == []
    flown = Outcome(spacecraft, made.pulses)
    assert flown.nutation < TEN_MICRODEGREE
    assert flown.shift < TEN_MICRODEGREE
    assert made.pulses.propellant is not None
    bounds = made.schedule.bounds
    assert bounds.rigorous is not None
    assert bounds.rigorous <= made.pulses.propellant * (1 + 1e-9)
    assert bounds.first_order is not None
    assert made.pulses.propellant <= dearest * bounds.first_order


@spread("seed", range(16), quick=1)
def test_random_layouts_are_planned(seed: int) -> None:
    flies(seed, 1.03)


KNOWN = {
    9: 0.0005683514790203955,
    17: 0.0015252966350810253,
    109: 5.7688437020970824e-05,
    111: 0.0001805874376459324,
    116: 0.0012134310937840607,
    130: 0.00027772812193374363,
    131: 0.00044437928732715036,
    138: 0.002253543083145223,
    153: 0.0027131339413776203,
}
"""Propellant, kg, of layouts as commit b69e7e0 plans them: by linear programs alone, which another solver solved."""


@spread("seed", KNOWN, quick=1)
def test_layouts_cost_no_more_than_by_linear_programs_alone(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The schedule found, and the one that ends earlier and is taken in its place, within what counts as equal."""
    made = plan(random_layout(seed), "optimal")
    monkeypatch.setattr(search, "hastened", lambda _problem, best, *_: best)
    found = plan(random_layout(seed), "optimal")
    assert made.pulses.propellant is not None
    assert found.pulses.propellant is not None
    assert found.pulses.propellant <= KNOWN[seed] * (1.0 + 1e-9)
    assert made.pulses.propellant <= found.pulses.propellant * (1.0 + SAME_COST)
    assert (made.end, len(made)) <= (found.end, len(found))


def test_a_schedule_is_taken_down_on_the_true_motion_and_leaves_nothing() -> None:
    body = random_layout(153)
    search = _Search(body, OptimalOptions())
    first = search.program().solve()
    before = search.programmed(first)
    assert before is not None
    after = search.cheapened(before)
    assert after is not None
    assert search.price(after) < search.price(before) * (1.0 - 1e-4)
    assert [one.channel for one in after] == [one.channel for one in before]
    assert math.degrees(search.left(search.flown(after))) < 1e-9
    ticked = _Search(replace(body, limits=replace(body.limits, tick=1e-3)), OptimalOptions())
    assert ticked.cheapened(before) is before  # ticks decide what a schedule leaves


@pytest.mark.deep
@pytest.mark.parametrize("seed", range(16, 200))
def test_many_random_layouts_are_planned(seed: int) -> None:
    flies(seed, 1.25)


@pytest.mark.deep
@pytest.mark.parametrize(("seed", "degrees"), [(0, 1.0), deep(1, 5.0)])
def test_no_flown_schedule_of_a_brute_search_is_cheaper(seed: int, degrees: float) -> None:
    brute_search(seed, degrees, 40)


@pytest.mark.deep
@pytest.mark.parametrize(("seed", "degrees"), [(0, 1.0), (1, 3.0), (2, 5.0), (3, 1.0), (0, 5.0)])
def test_no_flown_schedule_of_a_long_brute_search_is_cheaper(seed: int, degrees: float) -> None:
    brute_search(seed, degrees, 150)


def brute_search(seed: int, degrees: float, tries: int) -> None:
    """Two to four ideal impulses at random moments, each made exact by its own solver, against the plan."""
    rng = np.random.default_rng(100 + seed)
    horizon = float(rng.uniform(2.0, 8.0))
    spacecraft = spinner(120.0, 80.0, 3.0, degrees, 0.7, channels=channels(1e7), limits=Limits(horizon=horizon))
    made = plan(spacecraft, "optimal")
    assert made.flown is not None, infeasibility(made)
    cheapest = math.inf
    for _ in range(tries):
        count = int(rng.integers(2, 5))
        cost = exact_impulses(spacecraft, rng.choice(4, count), np.sort(rng.uniform(0, horizon, count)), rng)
        cheapest = min(cheapest, cost)
    assert cheapest < 1.5 * spacecraft.least_impulse  # the search is not blind
    assert made.pulses.total_impulse <= cheapest * 1.001


def exact_impulses(spacecraft: Spacecraft, which: np.ndarray, times: np.ndarray, rng: np.random.Generator) -> float:
    """Impulse of a schedule that ends without nutation and with H where it was, found from these moments; or inf.

    The motion is that of the exact arcs (physics sheet), written here once more; four unknowns at least are solved for.
    """
    inertia, horizon = spacecraft.inertia, spacecraft.horizon
    directions = np.array([spacecraft.channels[index].transverse / 1e7 for index in which])

    def left(x: np.ndarray) -> np.ndarray:
        rotation = reference.frame_n(inertia.moments, spacecraft.omega0)
        rates, now = spacecraft.omega0.copy(), 0.0
        for t, strength, direction in zip(x[: len(which)], x[len(which) :], directions, strict=True):
            rotation, rates = coasted(inertia.moments, rotation, rates, t - now)
            rates = rates + np.array([direction.real, direction.imag, 0.0]) * strength / inertia.A
            now = t
        momentum = rotation @ (np.asarray(inertia.moments) * rates)
        return np.array([rates[0], rates[1], momentum[0] / 240, momentum[1] / 240])

    start = np.concatenate([times, np.full(len(which), spacecraft.least_impulse / len(which))])
    lower = np.zeros(2 * len(which))
    upper = np.concatenate([np.full(len(which), horizon), np.full(len(which), 10 * spacecraft.least_impulse)])
    found = least_squares(left, np.clip(start, 1e-6, upper - 1e-6), bounds=(lower, upper), xtol=1e-12, max_nfev=40)
    moments = found.x[: len(which)]
    if np.linalg.norm(found.fun) > 1e-8 or np.any(np.diff(moments) < 0.0):
        return math.inf
    return float(found.x[len(which) :].sum())


def coasted(
    moments: tuple[float, float, float], rotation: np.ndarray, rates: np.ndarray, time: float
) -> tuple[np.ndarray, np.ndarray]:
    """R(t) = Rot(H t/A) R Rot3(a ω3 t)."""
    A, _, C = moments
    momentum = rotation @ (np.asarray(moments) * rates)
    turn = (A - C) / A * rates[2] * time
    about_axis = Rotation.from_rotvec([0.0, 0.0, turn]).as_matrix()
    following = Rotation.from_rotvec(momentum * time / A).as_matrix() @ rotation @ about_axis
    return following, about_axis.T @ rates
