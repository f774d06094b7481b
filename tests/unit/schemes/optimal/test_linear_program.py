"""The linear program: its equations, its solver, what it can reach, and what it says where it
cannot.
"""

import math
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.optimize
from support.builders import channel, cross, present, spinner
from support.cases import deep
from support.golden import check_text
from support.optimal import flies
from support.places import case

from nutdamp.common import work
from nutdamp.files.reader import load_spacecraft
from nutdamp.flight import propagation
from nutdamp.planning.causes import infeasibility
from nutdamp.planning.plan import plan
from nutdamp.schemes.catalogue import OptimalOptions
from nutdamp.schemes.optimal import linear_program, refinement
from nutdamp.schemes.optimal.problem import Problem, thinned
from nutdamp.spacecraft.model import Goal, Limits, Vector
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

BODY = spinner(channels=cross(8.0, max_on_time=2.0), limits=Limits(horizon=30.0))


class Failing:
    """A solver that fails where ``fails`` says so: of the number of the call and the method."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, fails: Callable[[int, str], bool]) -> None:
        self.calls, self.failed = 0, 0
        plain = linear_program.GrowingProgram._solved

        def tried(
            program: linear_program.GrowingProgram, method: str
        ) -> linear_program.Optimum | None:
            self.calls += 1
            failed = fails(self.calls, method)
            self.failed += failed
            return None if failed else plain(program, method)

        monkeypatch.setattr(linear_program.GrowingProgram, "_solved", tried)


@pytest.mark.deep
@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("optimal-highs-1", "propellant"),
        ("optimal-highs-3", "time"),
        ("optimal-beaten-107", "pulses"),
    ],
)
def test_what_the_solver_gave_up_on_is_planned(name: str, least: str) -> None:
    flies(load_spacecraft(case(f"{name}.yaml")), least=least)


@pytest.mark.deep
def test_a_solver_that_fails_late_keeps_what_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        counted = Failing(patch, lambda *_: False)
        plan(BODY, "optimal")
    for last in range(3, counted.calls, 8):
        with monkeypatch.context() as patch:
            Failing(patch, lambda call, _, last=last: call > last)  # type: ignore[misc]
            made = plan(BODY, "optimal")
        if made.flown is None:
            assert "HiGHS" not in infeasibility(made)
        elif made.pulses.bounds is not None and made.pulses.bounds.first_order is not None:
            assert made.pulses.bounds.first_order <= made.pulses.total_impulse * 1.001
    assert made.flown is not None  # the last failure comes after all that mattered


def test_a_solver_that_always_fails_leaves_other_schemes_and_a_plain_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    Failing(monkeypatch, lambda *_: True)
    check_text(
        "plan.no-solver", infeasibility(plan(replace(BODY, limits=Limits(horizon=1.0)), "optimal"))
    )
    made = plan(spinner(channels=cross(400.0), limits=Limits(horizon=60.0)), "optimal")
    assert made.flown is not None, infeasibility(made)  # two-pulse finds it
    assert made.pulses.bounds is not None
    assert made.pulses.bounds.first_order is None
    assert made.pulses.bounds.rigorous is not None


@dataclass(frozen=True)
class Small:
    """A program of 3 equations, 2 upper limits and 12 unknowns, at most 0.8 each."""

    cost: Vector
    equal: Vector
    right: Vector
    below: Vector
    limits: Vector

    def grown(
        self, *parts: int, level: float = 1.0, step: Vector | float = 0.0
    ) -> linear_program.GrowingProgram:
        """With the columns added in ``parts``, solved after each but the last."""
        program = linear_program.GrowingProgram(self.right + step, self.limits, np.full(3, level))
        for count, part in enumerate(np.split(np.arange(12), parts)):
            if count:
                program.optimum()
            program.add(
                self.cost[part],
                np.vstack([self.equal, self.below])[:, part],
                np.full(len(part), 0.8),
            )
        return program


def small(seed: int) -> Small:
    rng = np.random.default_rng(seed)
    equal = rng.normal(size=(3, 12))
    below = rng.uniform(0.1, 1.0, size=(2, 12))
    return Small(
        rng.uniform(1.0, 2.0, 12),
        equal,
        equal @ rng.uniform(0.1, 0.4, 12),
        below,
        rng.uniform(2.0, 3.0, 2),
    )


def solved(program: linear_program.GrowingProgram) -> linear_program.Optimum:
    return present(program.optimum())


def check_same(found: linear_program.Optimum, other: linear_program.Optimum) -> None:
    assert other.x == pytest.approx(found.x, abs=1e-7)
    assert other.prices == pytest.approx(found.prices, rel=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_the_optimum_and_its_prices(seed: int) -> None:
    """Prices are the slopes of the least cost by the right-hand sides; and columns may come later,
    on any scale.
    """
    program = small(seed)
    found = solved(program.grown())
    assert program.equal @ found.x == pytest.approx(program.right)
    assert (program.below @ found.x < program.limits + 1e-7).all()
    equal = (program.equal, program.right)
    below = (program.below, program.limits)
    bounds = [(0.0, 0.8)] * 12
    by_scipy = scipy.optimize.linprog(program.cost, *below, *equal, bounds, method="highs-ds")
    assert program.cost @ found.x == pytest.approx(by_scipy.fun, rel=1e-7)
    for index in range(3):
        other = solved(program.grown(step=1e-6 * np.eye(3)[index]))
        assert program.cost @ (other.x - found.x) / 1e-6 == pytest.approx(
            found.prices[index], rel=1e-3, abs=1e-6
        )
    for level in (1.0, 1e-4):
        check_same(found, solved(program.grown(5, 8, level=level)))


@pytest.mark.parametrize(
    ("large", "failing", "expected"),
    [(12, 0, ["simplex"]), (12, 1, ["simplex", "ipm"]), (11, 0, ["ipm"])],
    ids=["few unknowns", "one that fails", "many unknowns"],
)
def test_either_way_of_solving_finds_the_same(
    large: int, failing: int, expected: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = solved(small(1).grown())
    ways = list[str]()

    def fails(call: int, method: str) -> bool:
        ways.append(method)
        return call <= failing

    monkeypatch.setattr(linear_program, "LARGE", large)
    Failing(monkeypatch, fails)
    check_same(usual, solved(small(1).grown()))
    assert ways == expected


def test_no_burns_are_left_out_once_the_work_is_spent() -> None:
    program = Problem(BODY, OptimalOptions()).program()
    solution = program.solve()
    assert len(solution.burns) > 1
    for most in (0.0, 1e9):
        with work.budget("test", most) as spent:
            fewer = thinned(program, solution, solution.cost, fewest=True)
        assert (spent.done > 0.0, len(fewer.burns) <= len(solution.burns)) == (most > 0.0, True)
        assert fewer is solution or most > 0.0


def test_the_basis_is_kept() -> None:
    """From the last basis, columns that change nothing take no step;
    from none they take several.
    """
    program = small(2).grown()
    solved(program)
    assert program._highs.getInfo().simplex_iteration_count > 0
    program.add(np.full(12, 100.0), np.vstack([small(2).equal, small(2).below]), np.full(12, 0.8))
    solved(program)
    assert program._highs.getInfo().simplex_iteration_count == 0


def test_no_way_of_solving_is_no_optimum() -> None:
    """x ≥ 0 cannot be -1."""
    program = linear_program.GrowingProgram(-np.ones(1), np.zeros(0), np.ones(1))
    program.add(np.ones(1), np.ones((1, 1)), np.ones(1))
    assert program.optimum() is None


CALLER = """
import highspy
other = highspy.Highs()
other.setOptionValue("output_flag", False)
other.setOptionValue("threads", {threads})
other.addVar(0.0, 1.0)
assert other.run() == highspy.HighsStatus.kOk
"""
SOLVED_IN_SILENCE = """
import numpy as np
from nutdamp.schemes.optimal.linear_program import GrowingProgram
program = GrowingProgram(np.ones(1), np.zeros(0), np.ones(1))
program.add(np.array([3.0, 2.0]), np.array([[1.0, 1.0]]), np.array([9.0, 9.0]))
found = program.optimum()
assert found is not None and found.x.tolist() == [0.0, 1.0] and found.prices.tolist() == [2.0]
"""


@pytest.mark.deep
@pytest.mark.parametrize(
    "caller", ["", *(CALLER.format(threads=threads) for threads in (1, 2))], ids=["first", "1", "2"]
)
def test_the_solver_prints_nothing_whoever_used_it_before(caller: str) -> None:
    """Not even the banner that HiGHS 1.16 prints once in a process: CSV and JSON may go to stdout.

    How many threads HiGHS has is settled once in a process: a caller may have chosen another
    number.
    """
    of_the_caller, both = (
        subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
        for script in (caller, caller + SOLVED_IN_SILENCE)
    )
    assert (both.stdout, both.stderr) == (of_the_caller.stdout, "")


@pytest.mark.parametrize(
    "name",
    [
        "optimal-sphere-goal",
        deep("crash-literal-sphere-goal"),
        "crash-calm-target-short-horizon",
        "crash-max-on-time-1e-9-hang",
    ],
)
def test_what_is_out_of_reach_has_a_reason_without_a_word_of_the_solver(name: str) -> None:
    check_text(
        f"plan.{name}", infeasibility(plan(load_spacecraft(case(f"{name}.yaml")), "optimal"))
    )


@pytest.mark.deep
def test_a_far_target_with_weak_thrusters_is_not_called_out_of_reach() -> None:
    """Columns taken in a few at a time ended before they supplied the goal; 64 times the horizon
    seemed too short.
    """
    body = load_spacecraft(case("geo-target.yaml"))
    down = math.radians(-20.0)
    body = replace(body, goal=Goal(axis=np.array([0.0, math.cos(down), math.sin(down)])))
    named = re.search(r"limits.horizon of (\S+) s", infeasibility(plan(body, "optimal")))
    assert named
    for share, feasible in ((1.001, True), (0.99, False)):
        longer = replace(body, limits=replace(body.limits, horizon=share * float(named.group(1))))
        assert (unmet_by_all_slots(Problem(longer, OptimalOptions()).program()) < 1e-7) == feasible


def unmet_by_all_slots(program: linear_program.Program) -> float:
    """What all slots together cannot supply,
    by one program of least slack over every one of them.
    """
    size = float(np.linalg.norm(program.influence.goal))
    most = np.repeat(
        [program.width * one.strength / size for one in program.channels], len(program.centres)
    )
    rows = program.influence.rows(program.centres)
    lost = program.influence.widths(np.array([program.width]))[0]
    matrix = np.concatenate(
        [rows @ (np.asarray(one.torque) / one.strength) * lost for one in program.channels]
    ).T
    count = len(matrix)
    cost = np.repeat([0.0, 1.0], [len(most), 2 * count])
    slack = np.hstack([np.eye(count), -np.eye(count)])
    bounds = [*((0.0, one) for one in most), *((0.0, None),) * (2 * count)]
    goal = program.influence.goal / size
    found = scipy.optimize.linprog(cost, A_eq=np.hstack([matrix, slack]), b_eq=goal, bounds=bounds)
    return float(present(found.fun))


@pytest.mark.parametrize("rows", [2, 4, 5])
@pytest.mark.parametrize("seed", range(4))
def test_goals_within_and_beyond_reach_are_told_apart(seed: int, rows: int) -> None:
    """Goals just within and just beyond the farthest multiple that a program of another make
    reaches.
    """
    rng = np.random.default_rng(seed)
    most = rng.normal(size=(rows, 300)) * rng.uniform(0.0, 0.02, 300)
    goal = rng.normal(size=rows)
    goal /= np.linalg.norm(goal)
    # The largest s with most @ x = s goal, 0 <= x <= 1.
    equal = np.hstack([most, -goal[:, None]])
    bounds = [(0, 1)] * 300 + [(0, None)]
    found = scipy.optimize.linprog(
        [*np.zeros(300), -1.0], A_eq=equal, b_eq=np.zeros(rows), bounds=bounds
    )
    size = float(present(found.x)[-1])
    assert size > 0.01
    told = [
        linear_program.supplies(most / size, share * goal)
        for share in (0.3, 0.99, 0.9999, 1.0001, 1.01, 3.0)
    ]
    assert told == [True] * 3 + [False] * 3
    # By so much rows 2 and 3 may be missed.
    half, goal = np.eye(4) * 0.5, np.array([0.5, 0.5, 0.9, 0.5])
    missed = [linear_program.supplies(half, goal, off) for off in (0.39, 0.41)]
    assert missed == [False, True]


@pytest.mark.parametrize("spin", [2.0, -2.0])
@pytest.mark.parametrize(("dissipation", "first"), [(None, 100.0), (15.0, 100.0), (None, 125.0)])
def test_the_equations_along_a_flight_say_what_a_short_firing_adds(
    spin: float, dissipation: float | None, first: float
) -> None:
    """Differences of flights: with a short firing more, at true angles and with the spin that
    dissipation changes.

    Of an oblate body, whose spin the wheels of its nutation speed up while that decays; one with
    three moments.
    """
    jets = channel("T", 3.0, 1.0, 0.4), *cross(4.0)
    body = spinner(100.0, 150.0, spin, 25.0, moments=(first, 100.0, 150.0), channels=jets)
    body = replace(body, dissipation=dissipation)
    last = channel_pulse(body.channels[1], 9.0, 0.5)
    influence = refinement.along(
        propagation.flown(body, Schedule((last,))), refinement.EndEquations(), 0.05
    )
    for at in (2.0, 6.0):
        added = channel_pulse(body.channels[0], at, 1e-3)
        without, more = (
            refinement.misses(
                propagation.flown(body, Schedule(made)), refinement.EndEquations(shift=False)
            )
            for made in ((last,), (added, last))
        )
        expected = np.hypot(*(influence.rows(np.array([at]))[0] @ added.impulse)[:2])
        assert np.hypot(*(more - without)) == pytest.approx(expected, rel=0.05)
