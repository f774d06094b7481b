"""Bounds that no schedule may go below: against independent linear programs, and against what all
schemes plan.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog, minimize
from support.builders import aimed, channel, cross, noted, one_of, present, spinner
from support.cases import deep, spread, weekly
from support.golden import check_text
from support.places import case

from nutdamp.common.results import Note
from nutdamp.files.reader import load_spacecraft
from nutdamp.flight import propagation
from nutdamp.planning.notes import plan_notes
from nutdamp.planning.plan import plan
from nutdamp.schemes.catalogue import OptimalOptions
from nutdamp.schemes.optimal import bounds
from nutdamp.schemes.optimal.linear_program import Program, Solution
from nutdamp.schemes.optimal.search import Search
from nutdamp.spacecraft import directions
from nutdamp.spacecraft.constraints import free_windows
from nutdamp.spacecraft.model import Disturbance, Goal, Limits, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Bounds, Schedule, channel_pulse

TIGHT = 1e-9
NOTHING = bounds.Allowed()


def prices(spacecraft: Spacecraft) -> dict[str, float]:
    return {one.name: float(np.linalg.norm(one.torque)) for one in spacecraft.channels}


def proved(
    spacecraft: Spacecraft,
    left: bounds.Allowed = NOTHING,
    *,
    shift: bool = False,
    cost: float = math.inf,
) -> float:
    """The bound; ``cost`` is that of a schedule known, which counts where torques are axial."""
    if not math.isfinite(cost):
        cost = 1e3 * (spacecraft.least_impulse + spacecraft.turning_impulse)
    return present(bounds.rigorous(spacecraft, prices(spacecraft), cost, left, shift=shift))


def grid_optimum(
    spacecraft: Spacecraft,
    points: int,
    rates: tuple[float, ...] | None = None,
    *,
    lasting: bool = False,
) -> float:
    """Least cost on a grid of some ``points`` of time that takes the nutation out, by HiGHS and no
    line of nutdamp's.

    ``rates``: also those at which the equations turn, as the four of small angles; ``lasting``:
    each channel is on for at most the time from one moment to the next, as the torque there is,
    else there are impulses.
    """
    inertia = spacecraft.inertia
    omega = complex(spacecraft.omega0[0], spacecraft.omega0[1])
    spans = free_windows(spacecraft)
    total = sum(end - begin for begin, end in spans)
    parts = [np.linspace(b, e, max(int(points * (e - b) / total), 2) + 1) for b, e in spans]
    step = np.concatenate([np.diff(part) for part in parts])
    times = np.concatenate([0.5 * (part[1:] + part[:-1]) if lasting else part for part in parts])
    rows = []
    for rate in (inertia.a * spacecraft.spin, *(rates or ())):
        mean = np.exp(1j * rate * times) * (np.sinc(rate * step / (2 * np.pi)) if lasting else 1.0)
        acts = np.concatenate([one.transverse * mean for one in spacecraft.channels])
        rows += [acts.real, acts.imag]
    matrix = np.array(rows)
    size = float(np.abs(rows).max())
    costs = np.repeat([prices(spacecraft)[one.name] for one in spacecraft.channels], len(times))
    most = (
        np.tile(step, len(spacecraft.channels)) * size if lasting else np.full(len(costs), np.inf)
    )
    limit = np.column_stack([np.zeros(len(most)), most / spacecraft.least_impulse])
    goal = -np.array([omega.real, omega.imag, *(0.0 for _ in rows[2:])]) / abs(omega)
    found = linprog(costs / size, A_eq=matrix / size, b_eq=goal, bounds=limit)  # type: ignore[call-overload]
    return math.inf if found.fun is None else float(found.fun) * spacecraft.least_impulse


def layout(rng: np.random.Generator, *, axial: float = 0.0, count: int | None = None) -> Spacecraft:
    """Some skew channels about a random body; short and long horizons,
    some with blackout windows.
    """
    A = rng.uniform(60, 200)
    C = A * float(rng.choice([rng.uniform(0.3, 0.95), rng.uniform(1.05, 1.95), 1.0]))
    spin = float(rng.uniform(0.5, 6) * rng.choice([-1, 1]))
    degrees = float(rng.uniform(1, 60))
    period = 2 * math.pi / max(abs((A - C) / A * spin), 0.1 * abs(spin))
    horizon = period * float(10 ** rng.uniform(-0.6, 1.0))
    size = C * abs(spin) * math.tan(math.radians(degrees)) / period * 10 ** rng.uniform(0.5, 3.0)
    made = []
    for index in range(count or int(rng.integers(2, 7))):
        angle = rng.uniform(0, 2 * math.pi)
        share = size * rng.uniform(0.3, 1.0)
        along = share * math.cos(angle), share * math.sin(angle), axial * size * rng.uniform(-1, 1)
        made.append(channel(f"c{index}", *along))
    begin, end = sorted(rng.uniform(0, horizon, 2).tolist()) if rng.random() < 0.4 else (0.0, 0.0)
    earliest = float(rng.uniform(0, 0.3) * horizon) if rng.random() < 0.4 else 0.0
    limits = Limits(horizon=horizon, earliest=earliest, blackout=((begin, end),) if end else ())
    return spinner(
        A, C, spin, degrees, float(rng.uniform(0, 6.28)), channels=tuple(made), limits=limits
    )


@pytest.mark.parametrize(("first", "last"), [(0, 5), deep(5, 15), weekly(15, 200)])
def test_the_bound_is_the_optimum_of_a_dense_grid_and_never_above_it(first: int, last: int) -> None:
    """Times on the grid are some of all times, so its optimum lies above the bound; hardly, where
    the grid is fine.
    """
    solved = 0
    for seed in range(first, last):
        body = layout(np.random.default_rng(seed))
        optimum = grid_optimum(body, 2000)
        if math.isfinite(optimum):  # else there is no phase at which the channels can take it out
            solved += 1
            assert optimum * (1.0 - 1e-4) <= proved(body) <= optimum * (1.0 + TIGHT)
    assert solved > 0.6 * (last - first)


@pytest.mark.parametrize(("first", "last"), [(0, 6), deep(6, 12), weekly(12, 240)])
def test_no_plan_of_any_scheme_is_below_its_bound_for_what_it_leaves(first: int, last: int) -> None:
    feasible = 0
    for seed in range(first, last):
        rng = np.random.default_rng(seed)
        body = layout(rng, axial=(0.0, 0.0, 0.05, 0.4)[seed % 4])
        schemes = "one-pulse two-pulse four-pulse"
        if seed % 3 == 0:
            axis = directions.direction_in_n(
                body, math.radians(rng.uniform(1, 120)), float(rng.uniform(0, 6.28))
            )
            body = replace(body, goal=Goal(axis))
            schemes = "two-pulse half-cone rhumb-line four-pulse"
        for made in (plan(body, scheme) for scheme in schemes.split()):
            if made.flown is None:
                continue
            feasible += 1
            cost = made.pulses.total_impulse
            left = bounds.Allowed(made.flown.nutation, made.flown.axis_error)
            for shift in (False, body.goal.axis is not None):
                assert cost >= proved(body, left, shift=shift, cost=cost) * (1.0 - TIGHT), (
                    seed,
                    made.scheme,
                )
    assert feasible > last - first


@pytest.mark.deep
def test_one_pulse_attains_the_bound_of_the_file_where_it_was_above() -> None:
    """The primal cost on the grid of the column generation was 208.84693 N m s, one pulse takes
    208.84384.
    """
    body = load_spacecraft(case("bound-grid.yaml"))
    cost = plan(body, "one-pulse").pulses.total_impulse
    best = present(plan(body, "optimal").pulses.bounds)
    assert cost * (1.0 - 1e-6) <= present(best.rigorous) <= cost


def test_a_bound_is_never_told_rounded_up_and_none_of_nothing() -> None:
    """Where the nutation damps itself schedules may cost next to nothing; a share of nothing is no
    number.
    """
    one = plan(spinner(channels=cross(8.0)), "one-pulse")
    cost = one.pulses.total_impulse

    def told(first_order: float, rigorous: float) -> list[Note]:
        bounds = Bounds(first_order, rigorous, "N m s", 60.0)
        return [*plan_notes(replace(one, schedule=replace(one.pulses, bounds=bounds)))]

    for bound in (12.3449, 0.0999999, 20.0, 99995.0):
        proven = one_of(told(1.0, bound), "proven-bound")["bound"]
        assert isinstance(proven, float)
        assert bound * (1.0 - 1e-3) < float(f"{proven:.4g}") <= bound  # as texts round
    first = {"above": 1.01 * cost, "equal": cost, "below": 0.5 * cost, "nothing": 0.0}
    check_text(
        "plan.bounds",
        "\n".join(f"{name}: {noted(told(bound, 0.1 * bound))}" for name, bound in first.items()),
    )


def test_a_change_of_spin_that_brings_the_phase_sooner_is_allowed_for() -> None:
    """Within the horizon +1 opposes ω only if the body spins faster; the bound of fixed phases
    would forbid it.

    Flown: the spin thruster at t = 0 by 0.1 rad/s, then +1 where it opposes ω.
    """
    spin_up, push = channel("up", 0.0, 0.0, 1e9), channel("+1", 1e9, 0.0, 0.0)
    body = spinner(
        120.0, 80.0, 3.0, 5.0, math.pi + 1.6, channels=(spin_up, push), limits=Limits(horizon=1.58)
    )
    wait = ((math.atan2(body.omega0[1], body.omega0[0]) - math.pi) % (2 * math.pi)) / (
        body.inertia.a * 3.1
    )
    first = channel_pulse(spin_up, 0.0, 80.0 * 0.1 / 1e9)
    made = Schedule(
        (replace(first, t=0.5 * first.on_time), channel_pulse(push, wait, body.least_impulse / 1e9))
    )
    assert made.end <= body.horizon
    cost, left = made.total_impulse, propagation.flown(body, made).residual.nutation
    assert left < 1e-7
    assert (
        body.least_impulse * (1.0 - 1e-6)
        <= proved(body, bounds.Allowed(left), cost=cost)
        <= cost * (1.0 + TIGHT)
    )
    fixed, with_plenty = replace(body, channels=(push,)), replace(body, limits=Limits(horizon=60.0))
    assert bounds.rigorous(fixed, prices(fixed), cost, bounds.Allowed(left), shift=False) in (
        None,
        pytest.approx(math.inf),
    )
    assert proved(with_plenty, cost=cost) == pytest.approx(body.least_impulse, rel=1e-9)


@pytest.mark.parametrize(
    ("degrees", "turn"),
    [(0.0, 40.0), deep(10.0, 5.0), deep(10.0, 60.0), deep(45.0, 30.0), deep(45.0, 160.0)],
)
def test_the_way_of_h_is_the_shortest_round_its_sphere(degrees: float, turn: float) -> None:
    """A broken line of 40 corners outside the sphere of radius C|ω3|, shortened by an optimiser."""
    body = spinner(degrees=degrees, channels=cross(8.0))
    beta = math.radians(turn)
    body, r = (
        replace(body, goal=Goal(directions.direction_in_n(body, beta, 1.0))),
        body.inertia.C * abs(body.spin),
    )
    begin = np.linalg.norm(body.momentum)
    corners = np.exp(1j * np.linspace(0.0, beta, 41))

    def length(radii: Vector) -> float:
        return float(np.abs(np.diff(np.concatenate([[begin], radii]) * corners)).sum())

    shortest = float(minimize(length, np.full(40, r * 1.01), bounds=[(r, None)] * 40).fun)
    if turn <= degrees:  # what is left of the nutation then counts for more
        assert proved(body, shift=True) == pytest.approx(body.least_impulse, rel=1e-9)
        assert shortest <= body.least_impulse * 1.001
    else:
        assert proved(body, shift=True) == pytest.approx(shortest, rel=1e-3)


SPINNER = spinner(channels=cross(8.0, max_on_time=2.0), limits=Limits(horizon=60.0))
ROLL = channel("roll", 0.0, 0.0, 80.0)


@pytest.mark.parametrize(
    "other",
    [
        replace(SPINNER, disturbances=(Disturbance(1e-3 + 0.0j),)),
        replace(
            SPINNER, channels=(*cross(80.0), ROLL), goal=Goal(spin=3.1), limits=Limits(horizon=15.0)
        ),
        deep(replace(SPINNER, dissipation=300.0)),
        deep(replace(SPINNER, inertia=replace(SPINNER.inertia, moments=(118.0, 122.0, 80.0)))),
    ],
)
def test_no_rigorous_bound_is_told_where_none_is_known_to_hold(other: Spacecraft) -> None:
    made = plan(other, "optimal")
    assert made.pulses.bounds is not None
    assert made.pulses.bounds.rigorous is None
    assert made.pulses.bounds.first_order is not None


@spread(
    ("seed", "lasting"),
    [(seed, one) for seed in range(32) for one in (False, True)],
    quick=6,
    deep=16,
)
def test_the_first_order_bound_and_the_program_are_those_of_a_dense_grid(
    seed: int, lasting: bool
) -> None:
    """Impulses at moments of a grid for strong torques; for weak ones, on-times in its cells.

    Its moments are some of all moments, so its optimum lies above; hardly, where it is fine. The
    slots of the program, 64 in a turn, cost it up to 2e-4.
    """
    body = layout(np.random.default_rng(seed), count=6)
    factor = 10.0 ** np.random.default_rng(seed).uniform(-2.5, -1.0) if lasting else 1e6
    weaker = (channel(one.name, *(factor * one.torque)) for one in body.channels)
    body = replace(body, channels=tuple(weaker))
    program, solution = solved_program(body)
    optimum = grid_optimum(body, 6000, (body.spin,), lasting=lasting)
    assert lasting or (solution.unmet > 1e-9) == math.isinf(optimum)
    if solution.unmet > 1e-9:
        return
    found = bounds.first_order(program, solution.prices).bound
    assert found <= optimum * (1.0 + TIGHT)
    assert solution.cost * (1.0 - 5e-3) <= found <= solution.cost * (1.0 + TIGHT)
    if not lasting and body.horizon * body.fastest < 80.0:
        assert solution.cost == pytest.approx(optimum, rel=2e-4)


def solved_program(body: Spacecraft) -> tuple[Program, Solution]:
    program = Search(body, OptimalOptions(least="impulse")).program()
    return program, program.solve()


@spread("seed", range(10), quick=2)
def test_any_prices_give_a_bound(seed: int) -> None:
    """Not only those of the solver, which may have stopped anywhere: the dual is checked at every
    time.
    """
    rng = np.random.default_rng(seed)
    program, solution = solved_program(layout(rng, count=6))
    if solution.unmet > 1e-9:  # no solution for this layout
        return
    size = float(np.linalg.norm(solution.prices))
    for width in (1e-3, 0.1, 1.0):
        other = solution.prices + width * size * rng.normal(size=4)
        assert 0.0 <= bounds.first_order(program, other).bound <= solution.cost * (1.0 + TIGHT)


@pytest.mark.deep
def test_dissipation_is_in_the_first_order_bound() -> None:
    """An oblate body damps itself while it waits; 39.68 g was the least of a body without
    dissipation.
    """
    made = plan(load_spacecraft(case("oblate-dissipation.yaml")), "optimal")
    assert present(made.flown).nutation < math.radians(1e-6)
    assert present(made.pulses.bounds).first_order == pytest.approx(
        made.pulses.cost_in("kg"), rel=0.01
    )
    assert made.pulses.cost_in("kg") < 0.03251


@pytest.mark.deep
def test_very_many_alignments_do_not_loosen_the_first_order_bound() -> None:
    """Slots leave prices a little too high in each of some hundred alignments: that once added up
    to 8 %.
    """
    body = aimed(load_spacecraft(case("optimal-far-target.yaml")), 120.0, 87.29)
    program, solution = solved_program(body)
    found = bounds.first_order(program, solution.prices).bound
    assert solution.cost * (1.0 - 2e-3) <= found <= solution.cost * (1.0 + TIGHT)


@pytest.mark.parametrize(("degrees", "known"), [(80.0, True), (100.0, False)])
def test_nothing_is_known_of_schedules_that_turn_the_spin_axis_over(
    degrees: float, known: bool
) -> None:
    body = spinner(channels=cross(8.0), limits=Limits(horizon=60.0))
    found = bounds.rigorous(
        body, prices(body), 100.0, bounds.Allowed(nutation=math.radians(degrees)), shift=True
    )
    assert (found is not None) is known


def test_the_highest_of_a_curve_is_found_however_loosely_its_bend_is_known() -> None:
    program, solution = solved_program(layout(np.random.default_rng(1), count=6))
    curve = bounds.SmallAngles(program, solution.prices)
    every = np.ones(len(program.channels), dtype=bool)
    known = bounds._highest(curve, every)
    assert known == pytest.approx(
        curve.at(np.linspace(curve.begins[0], program.end, 20_000)).max(), rel=1e-5
    )
    curve.bends = 1e9 * curve.bends  # so that no quartering rules a stretch out
    assert known * (1.0 - 1e-9) <= bounds._highest(curve, every) < 10.0 * known
