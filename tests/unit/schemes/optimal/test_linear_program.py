"""The linear program's solver: what it cannot do in one way it does in another, and what it cannot do ends no plan."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.optimize
from support.builders import channel, cross, spinner
from support.places import case

from nutdamp.files.spacecraft_file import load_spacecraft
from nutdamp.planning import plan
from nutdamp.remarks import infeasibility
from nutdamp.schemes import Options
from nutdamp.schemes.optimal import lp_solver
from nutdamp.schemes.optimal.linear_program import Program
from nutdamp.schemes.optimal.lp_solver import GrowingProgram, Optimum
from nutdamp.schemes.optimal.problem import Problem
from nutdamp.schemes.options import OptimalOptions
from nutdamp.spacecraft import Goal, Limits, Spacecraft, Vector

MICRODEGREE = math.radians(1e-6)


@pytest.mark.parametrize(
    ("name", "least"),
    [("optimal-highs-1", "propellant"), ("optimal-highs-3", "time"), ("optimal-beaten-107", "pulses")],
)
def test_what_the_solver_gave_up_on_is_planned(name: str, least: str) -> None:
    made = plan(load_spacecraft(case(f"{name}.yaml")), "optimal", Options(least=least))
    assert made.flown is not None, infeasibility(made)
    assert max(made.flown.nutation, made.flown.momentum_shift) < MICRODEGREE


@pytest.mark.deep
def test_no_word_of_the_solver_is_shown() -> None:
    made = plan(load_spacecraft(case("optimal-highs-2.yaml")), "optimal")
    assert infeasibility(made) == "" or not any(word in infeasibility(made) for word in ("HiGHS", "status", "solver"))


class Failing:
    """A solver that fails where ``fails`` says so: of the number of the call and the method."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, fails: Callable[[int, str], bool]) -> None:
        self.calls, self.failed = 0, 0
        solved = lp_solver.GrowingProgram._solved

        def tried(program: GrowingProgram, method: str, presolve: bool, factor: float) -> Optimum | None:
            self.calls += 1
            if fails(self.calls, method):
                self.failed += 1
                return None
            return solved(program, method, presolve, factor)

        monkeypatch.setattr(lp_solver.GrowingProgram, "_solved", tried)


def after(last: int) -> Callable[[int, str], bool]:
    return lambda call, _: call > last


def up_to(last: int) -> Callable[[int, str], bool]:
    return lambda call, _: call <= last


def body() -> Spacecraft:
    return spinner(channels=cross(8.0, max_on_time=2.0), limits=Limits(horizon=30.0))


def test_interior_points_do_what_the_simplex_cannot(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = plan(body(), "optimal")
    solver = Failing(monkeypatch, lambda _, method: method == "simplex")
    other = plan(body(), "optimal")
    assert solver.failed > 0
    assert other.flown is not None, infeasibility(other)
    assert max(other.flown.nutation, other.flown.momentum_shift) < MICRODEGREE
    assert other.pulses.total_impulse == pytest.approx(plain.pulses.total_impulse, rel=0.01)


@pytest.mark.deep
def test_a_solver_that_fails_late_keeps_what_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = Failing(monkeypatch, lambda *_: False)
    plan(body(), "optimal")
    monkeypatch.undo()
    for last in range(3, counted.calls, 3):
        with monkeypatch.context() as patch:
            Failing(patch, after(last))
            made = plan(body(), "optimal")
        if made.flown is None:
            assert "HiGHS" not in infeasibility(made)
        elif made.pulses.bounds is not None and made.pulses.bounds.first_order is not None:
            assert made.pulses.bounds.first_order <= made.pulses.total_impulse * 1.001
    assert made.flown is not None  # the last failure comes after all that mattered


def test_a_solver_that_always_fails_leaves_other_schemes_and_a_plain_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    Failing(monkeypatch, lambda *_: True)
    far = plan(replace(body(), limits=Limits(horizon=1.0)), "optimal")
    assert "HiGHS" not in infeasibility(far)
    found = plan(spinner(channels=cross(400.0), limits=Limits(horizon=60.0)), "optimal")
    assert found.flown is not None, infeasibility(found)  # two-pulse finds it
    assert found.pulses.bounds is not None
    assert found.pulses.bounds.first_order is None
    assert found.pulses.bounds.rigorous is not None


@dataclass(frozen=True)
class Small:
    """A program of 3 equations, 2 upper limits and 12 unknowns, at most 0.8 each."""

    cost: Vector
    equal: Vector
    right: Vector
    below: Vector
    limits: Vector

    def grown(self, *parts: int, level: float = 1.0, step: Vector | float = 0.0) -> GrowingProgram:
        """With the columns added in ``parts``, solved after each but the last."""
        program = GrowingProgram(self.right + step, self.limits, np.full(3, level))
        for count, part in enumerate(np.split(np.arange(12), parts)):
            if count:
                program.optimum()
            rows = np.vstack([self.equal, self.below])[:, part]
            program.add(self.cost[part], rows, np.full(len(part), 0.8))
        return program

    def by_scipy(self) -> float | None:
        """The least cost, None where there is no solution."""
        found = scipy.optimize.linprog(
            self.cost,
            A_eq=self.equal,
            b_eq=self.right,
            A_ub=self.below,
            b_ub=self.limits,
            bounds=[(0.0, 0.8)] * 12,
            method="highs-ds",
        )
        return float(found.fun) if found.success and found.fun is not None else None


def small(seed: int) -> Small:
    rng = np.random.default_rng(seed)
    equal, below = rng.normal(size=(3, 12)), rng.uniform(0.1, 1.0, size=(2, 12))
    return Small(rng.uniform(1.0, 2.0, 12), equal, equal @ rng.uniform(0.1, 0.4, 12), below, rng.uniform(2.0, 3.0, 2))


@pytest.mark.parametrize("seed", range(20))
def test_the_optimum_and_its_prices(seed: int) -> None:
    """Prices are the slopes of the least cost by the right-hand sides, by difference quotients."""
    program = small(seed)
    found = program.grown().optimum()
    assert found is not None
    assert program.equal @ found.x == pytest.approx(program.right)
    assert (program.below @ found.x < program.limits + 1e-7).all()
    assert program.cost @ found.x == pytest.approx(program.by_scipy(), rel=1e-7)
    for index in range(3):
        step = np.zeros(3)
        step[index] = 1e-6
        other = program.grown(step=step).optimum()
        assert other is not None
        slope = program.cost @ (other.x - found.x) / 1e-6
        assert slope == pytest.approx(found.prices[index], rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("level", [1.0, 1e-4])
def test_columns_added_later_count_as_those_from_the_beginning(seed: int, level: float) -> None:
    """And so whatever the equations are divided by."""
    program = small(seed)
    at_once, grown = program.grown().optimum(), program.grown(5, 8, level=level).optimum()
    assert at_once is not None
    assert grown is not None
    assert grown.x == pytest.approx(at_once.x, abs=1e-7)
    assert grown.prices == pytest.approx(at_once.prices, rel=1e-6)


def test_every_way_of_solving_finds_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    program = small(1)
    usual = program.grown().optimum()
    assert usual is not None
    for number in range(len(lp_solver.WAYS)):
        with monkeypatch.context() as patch:
            Failing(patch, up_to(1 + number))
            other = program.grown().optimum()
        assert other is not None
        assert other.x == pytest.approx(usual.x, abs=1e-7)
        assert other.prices == pytest.approx(usual.prices, rel=1e-6)


def test_the_basis_is_kept() -> None:
    """From the last basis, columns that change nothing take no step; from none they take several."""
    program = small(2).grown()
    assert program.optimum() is not None
    assert program.steps > 0
    program.add(np.full(12, 100.0), np.vstack([small(2).equal, small(2).below]), np.full(12, 0.8))
    assert program.optimum() is not None
    assert program.steps == 0


def test_no_way_of_solving_is_no_optimum() -> None:
    """x ≥ 0 cannot be -1."""
    program = GrowingProgram(-np.ones(1), np.zeros(0), np.ones(1))
    program.add(np.ones(1), np.ones((1, 1)), np.ones(1))
    assert program.optimum() is None


SOLVED_IN_SILENCE = """
import numpy as np
from nutdamp.schemes.optimal.lp_solver import GrowingProgram
program = GrowingProgram(np.ones(1), np.zeros(0), np.ones(1))
program.add(np.array([3.0, 2.0]), np.array([[1.0, 1.0]]), np.array([9.0, 9.0]))
found = program.optimum()
assert found is not None and found.x.tolist() == [0.0, 1.0] and found.prices.tolist() == [2.0]
"""


def run_script(script: str) -> tuple[int, str, str]:
    done = subprocess.run([sys.executable, "-c", script], check=False, capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def test_the_solver_prints_nothing() -> None:
    """Not even the banner that HiGHS 1.16 prints once in a process: CSV and JSON may go to stdout."""
    assert run_script(SOLVED_IN_SILENCE) == (0, "", "")


@pytest.mark.parametrize("threads", [1, 2])
def test_nothing_is_printed_whoever_used_the_solver_before(threads: int) -> None:
    """How many threads HiGHS has is settled once in a process: a caller may have chosen another number."""
    caller = f"""
import highspy
other = highspy.Highs()
other.setOptionValue("output_flag", False)
other.setOptionValue("threads", {threads})
other.addVar(0.0, 1.0)
assert other.run() == highspy.HighsStatus.kOk
"""
    status, of_the_caller, _ = run_script(caller)
    assert status == 0
    assert run_script(caller + SOLVED_IN_SILENCE) == (0, of_the_caller, "")


@pytest.mark.parametrize(
    "name", ["optimal-sphere-goal", "crash-literal-sphere-goal", "crash-calm-target-short-horizon"]
)
def test_without_nutation_and_out_of_reach_the_target_is_named_in_the_reason(name: str) -> None:
    made = plan(load_spacecraft(case(f"{name}.yaml")), "optimal")
    assert "H cannot be brought to the target" in infeasibility(made)


def test_pulses_of_a_nanosecond_end_in_a_reason() -> None:
    made = plan(load_spacecraft(case("crash-max-on-time-1e-9-hang.yaml")), "optimal")
    assert "2.75e+09 pulses" in infeasibility(made)  # A|ω0| / (8 N m · 1 ns)


def test_a_weak_axial_torque_is_scaled_up() -> None:
    """The spin is set by torques a ten-thousandth of the transverse ones."""
    skew = tuple(channel(f"T{k}", 8 * math.cos(k), 8 * math.sin(k), 8e-4 * (-1) ** k) for k in range(6))
    spinning = spinner(channels=skew, limits=Limits(horizon=60.0))
    made = plan(replace(spinning, goal=Goal(None, 3.0)), "optimal")
    assert made.flown is not None, infeasibility(made)
    assert made.spin_change == pytest.approx(0.0, abs=1e-9)


@pytest.mark.deep
def test_a_far_target_with_weak_thrusters_is_not_called_out_of_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    """Columns taken in a few at a time ended before they supplied the goal; 64 times the horizon seemed too short."""
    body = load_spacecraft(case("geo-target.yaml"))
    down = math.radians(-20.0)
    body = replace(body, goal=Goal(axis=np.array([0.0, math.cos(down), math.sin(down)])))
    solved: list[int] = []
    optimum = GrowingProgram.optimum

    def counted(program: GrowingProgram) -> Optimum | None:
        solved.append(1)
        return optimum(program)

    monkeypatch.setattr(GrowingProgram, "optimum", counted)
    why = infeasibility(plan(body, "optimal"))
    found = re.search(r"set limits.horizon to at least (\S+) s", why)
    assert found, why
    assert len(solved) < 200  # 385 before, for less
    options, needed = OptimalOptions(), float(found.group(1))
    for share, feasible in ((1.001, True), (0.99, False)):
        program = Problem(replace(body, limits=replace(body.limits, horizon=share * needed)), options).program()
        assert (unmet_by_all_slots(program) < 1e-7) == feasible


def unmet_by_all_slots(program: Program) -> float:
    """What all slots together cannot supply, by one program of least slack over every one of them."""
    slots, channels = len(program.centres), len(program.channels)
    size = float(np.linalg.norm(program.influence.goal))
    most = np.array([program.width * one.strength / size for one in program.channels])
    every = [
        program.influence.rows(program.centres)
        @ (np.asarray(one.torque) / one.strength)
        * program.influence.widths(np.array([program.width]))[0]
        for one in program.channels
    ]
    matrix = np.concatenate(every).T
    count = len(matrix)
    found = scipy.optimize.linprog(
        np.concatenate([np.zeros(slots * channels), np.ones(2 * count)]),
        A_eq=np.hstack([matrix, np.eye(count), -np.eye(count)]),
        b_eq=program.influence.goal / size,
        bounds=[*((0.0, one) for one in np.repeat(most, slots)), *((0.0, None),) * (2 * count)],
    )
    assert found.fun is not None
    return float(found.fun)
