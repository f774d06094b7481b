"""Searches are bounded by counted work: they end with the best found so far, and say so."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from support.builders import aimed, codes, cross, spinner
from support.cases import deep, spread
from support.places import case

from nutdamp.common import work
from nutdamp.files.reader import load_spacecraft
from nutdamp.flight import dynamics, propagation
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import compare
from nutdamp.planning.notes import CUT, comparison_warnings, infeasibility, plan_notes
from nutdamp.planning.plan import Standing
from nutdamp.schemes.optimal import linear_program
from nutdamp.spacecraft.model import Disturbance, Goal, Limits
from nutdamp.spacecraft.schedule import Schedule


def test_steps_of_a_task_are_part_of_a_step_of_the_task_around_it() -> None:
    heard: list[tuple[float, float]] = []
    with work.watched() as watch:
        seen = [watch.task]
        work.reach(5.0)  # nobody counts
        with work.steps(10.0, hook=lambda done, of: heard.append((done, of))) as whole:
            assert whole.share == 0.0
            with work.steps(4.0, 5.0):
                work.reach(2.0)
                assert whole.share == 0.25
                work.reach(9.0)  # more than was expected
                assert whole.share == 0.5
            assert whole.share == 0.5
            whole.reach(7.0)
            with work.steps(0.0):
                assert whole.share == 0.8
            seen.append(watch.task)
    assert seen == [None, whole]
    assert heard == [(7.0, 10.0)]


def test_work_counts_for_all_budgets_around_it_and_who_watches_sees_the_innermost() -> None:
    with work.watched() as watch:
        seen = [watch.budget]
        with work.budget("all", 10.0) as outer:
            with work.budget("first", 7.0) as first:
                seen.append(watch.budget)
                for left in (3.0, 0.0):
                    work.spend(4.0)
                    assert (work.left(), work.exhausted()) == (left, left == 0.0)
            seen.append(watch.budget)
            assert (first.done, outer.done) == (8.0, 8.0)
            with work.budget("second", 7.0) as second:
                assert second.most == 2.0
            assert not work.exhausted()
            assert outer.done == 8.0
        seen.append(watch.budget)
    assert seen == [None, first, outer, None]
    assert work.left() == math.inf
    work.spend(1e9)  # nobody counts
    assert not work.exhausted()


def test_flights_count_by_legs_and_steps() -> None:
    driven = replace(spinner(moments=(100.0, 120.0, 80.0)), disturbances=(Disturbance(1e-3 + 0.0j),))
    for body, until in ((spinner(channels=cross(8.0)), 10.0), (driven, 100.0)):
        with work.budget("flight", 1e9) as spent:
            flown = propagation.flown(body, Schedule(), until)
        if body.inertia.symmetric:
            assert 0.0 < spent.done == dynamics.LEG * len(flown.legs)
        else:
            assert spent.done > dynamics.STEP * flown.steps > 10.0


@pytest.mark.parametrize("most", [20.0, deep(500.0)])
def test_a_search_that_is_cut_ends_soon_with_what_it_has(most: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A comparison shares one budget."""
    body = load_spacecraft(case("slow-optimal.yaml"))
    monkeypatch.setattr(work, "SCHEME", most)
    with work.budget("test", 1e9) as spent:
        plan = planning.plan(body, "optimal")
    assert plan.cut
    assert spent.done < most + 300.0
    assert "search-ended" in codes(plan_notes(plan)) or CUT in infeasibility(plan)
    monkeypatch.setattr(work, "COMMAND", 30.0)
    with work.budget("test", 1e9) as spent:
        compared = compare(body, ("one-pulse", "optimal"))
    assert compared.plans[-1].cut
    for other in (compared, compare(replace(body, goal=Goal(), requirement=None), ("one-pulse", "optimal"))):
        missed = other.recommendation.standing is not Standing.COMPLIES
        assert (missed, other.plans[-1].cut) == (other is compared, True)
        assert ("search-incomplete" in codes(comparison_warnings(other))) is missed
    assert spent.done < 330.0


def test_what_is_not_cut_is_the_same_with_any_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    body = load_spacecraft(case("kick-stage.yaml"))
    before = planning.plan(body, "optimal")
    monkeypatch.setattr(work, "SCHEME", 1e9)
    after = planning.plan(body, "optimal")
    assert (before.cut, before.feasible) == (False, True)
    assert [(one.t, one.on_time) for one in before.pulses] == [(one.t, one.on_time) for one in after.pulses]
    assert "search-ended" not in codes(plan_notes(before))


@pytest.mark.deep
@spread("scheme", ["rhumb-line", "half-cone"], quick=1)
def test_damping_of_thousands_of_turns_before_a_turn_of_the_axis_is_cut_too(
    scheme: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of its pulses takes a thousand steps of integration, and neither it nor a longer horizon is tried twice."""
    body = replace(spinner(200.0, 250.0, -0.44, degrees=89.9, channels=cross(30.0)), dissipation=1e4)
    monkeypatch.setattr(work, "SCHEME", 300.0)
    with work.budget("test", 1e9) as spent:
        plan = planning.plan(aimed(body, 40.0, 10.0), scheme)
    assert (plan.cut, plan.feasible) == (True, False)
    assert spent.done < 1500.0  # of 39,000 without a bound


def test_a_longer_horizon_is_sought_within_bounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """What only names a cure leaves the other schemes of a comparison their search."""
    body = aimed(spinner(150.0, 100.0, 0.3, channels=cross(1.0), limits=Limits(horizon=60.0)), 40.0, 10.0)
    units, named = [], []
    for most in (0.0, 50.0, work.CURE):
        monkeypatch.setattr(work, "CURE", most)
        with work.budget("test", 1e9) as spent:
            plan = planning.plan(body, "rhumb-line")
        units.append(spent.done)
        named.append("limits.horizon" in infeasibility(plan))
    assert named == [False, True, True]
    assert units[0] < units[1] < units[0] + 2.0 * 50.0 < units[2]  # the try under way when it is spent is finished


def test_linear_programs_count_by_their_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a sphere pulses of every turn do alike, and all slots of a long horizon get into the program."""
    body = spinner(7500.0, 7500.0, 0.018, degrees=0.5, channels=cross(3e-4), limits=Limits(horizon=2e5))
    monkeypatch.setattr(work, "SCHEME", 300.0)
    sizes: list[int] = []
    optimum = linear_program.GrowingProgram.optimum

    def counted(self: linear_program.GrowingProgram) -> linear_program.Optimum | None:
        sizes.append(self._highs.getNumNz())
        return optimum(self)

    monkeypatch.setattr(linear_program.GrowingProgram, "optimum", counted)
    assert planning.plan(aimed(body, 3.0, 0.0), "optimal").cut
    assert sum(sizes) < 200_000  # of 1.2 million
