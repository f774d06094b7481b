"""The linear program's solver: what it cannot do in one way it does in another, and what it cannot do ends no plan."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.optimize
from builders import channel, cross, spinner
from cases_dir import case

from nutdamp.files.spacecraft_file import load_spacecraft
from nutdamp.planning import plan
from nutdamp.remarks import infeasibility
from nutdamp.schemes import Options
from nutdamp.schemes.optimal import lp_solver
from nutdamp.schemes.optimal.linear_program import Program
from nutdamp.schemes.optimal.problem import Problem
from nutdamp.schemes.options import OptimalOptions
from nutdamp.spacecraft import Goal, Limits, Spacecraft

MICRODEGREE = math.radians(1e-6)


@pytest.mark.parametrize(
    ("name", "least"),
    [("optimal-highs-1", "propellant"), ("optimal-highs-3", "time"), ("optimal-beaten-107", "pulses")],
)
def test_what_the_solver_gave_up_on_is_planned(name: str, least: str) -> None:
    made = plan(load_spacecraft(case(f"{name}.yaml")), "optimal", Options(least=least))
    assert made.flown is not None, infeasibility(made)
    assert max(made.flown.nutation, made.flown.momentum_shift) < MICRODEGREE


def test_no_word_of_the_solver_is_shown() -> None:
    made = plan(load_spacecraft(case("optimal-highs-2.yaml")), "optimal")
    assert infeasibility(made) == "" or not any(word in infeasibility(made) for word in ("HiGHS", "status", "solver"))


class Failing:
    """A solver that fails where ``fails`` says so: of the number of the call and the method."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, fails: Any) -> None:
        self.calls, self.failed = 0, 0
        solve = scipy.optimize.linprog

        def linprog(*args: Any, **kwargs: Any) -> Any:
            self.calls += 1
            if fails(self.calls, kwargs["method"]):
                self.failed += 1
                return SimpleNamespace(success=False, status=4, x=None, fun=None, message="HiGHS Status 15")
            return solve(*args, **kwargs)

        monkeypatch.setattr(scipy.optimize, "linprog", linprog)


def body() -> Spacecraft:
    return spinner(channels=cross(8.0, max_on_time=2.0), limits=Limits(horizon=30.0))


def test_interior_points_do_what_the_simplex_cannot(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = plan(body(), "optimal")
    solver = Failing(monkeypatch, lambda _, method: method == "highs-ds")
    other = plan(body(), "optimal")
    assert solver.failed > 0
    assert other.flown is not None, infeasibility(other)
    assert max(other.flown.nutation, other.flown.momentum_shift) < MICRODEGREE
    assert other.pulses.total_impulse == pytest.approx(plain.pulses.total_impulse, rel=0.01)


def test_a_solver_that_fails_late_keeps_what_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = Failing(monkeypatch, lambda *_: False)
    plan(body(), "optimal")
    monkeypatch.undo()
    for after in range(3, counted.calls, 3):
        with monkeypatch.context() as patch:
            Failing(patch, lambda call, _, after=after: call > after)
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


@pytest.mark.parametrize("seed", range(20))
def test_the_optimum_and_its_prices(seed: int) -> None:
    """Prices are the slopes of the least cost by the right-hand sides, by difference quotients."""
    rng = np.random.default_rng(seed)
    equal, below = rng.normal(size=(3, 12)), rng.uniform(0.1, 1.0, size=(2, 12))
    right, cost, most = equal @ rng.uniform(0.1, 0.4, 12), rng.uniform(1.0, 2.0, 12), np.full(12, 0.8)
    limits = np.full(2, 10.0)
    found = lp_solver.least(cost, equal, right, most, below, limits)
    assert found is not None
    assert equal @ found.x == pytest.approx(right)
    for index in range(3):
        step = np.zeros(3)
        step[index] = 1e-6
        other = lp_solver.least(cost, equal, right + step, most, below, limits)
        assert other is not None
        assert (cost @ other.x - cost @ found.x) / 1e-6 == pytest.approx(found.prices[index], rel=1e-3, abs=1e-6)


def test_no_way_of_solving_is_no_optimum() -> None:
    """x ≥ 0 cannot be -1."""
    none = np.zeros((0, 1))
    assert lp_solver.least(np.ones(1), np.ones((1, 1)), -np.ones(1), np.ones(1), none, np.zeros(0)) is None


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


def test_a_far_target_with_weak_thrusters_is_not_called_out_of_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    """Columns taken in a few at a time ended before they supplied the goal; 64 times the horizon seemed too short."""
    body = load_spacecraft(case("geo-target.yaml"))
    down = math.radians(-20.0)
    body = replace(body, goal=Goal(axis=np.array([0.0, math.cos(down), math.sin(down)])))
    solved: list[int] = []
    least = lp_solver.least

    def counted(*given: Any) -> lp_solver.Optimum | None:
        solved.append(1)
        return least(*given)

    monkeypatch.setattr(lp_solver, "least", counted)
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
