"""How many dispersed cases the plans of a comparison fly: as many as it takes to know what to recommend."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from support import places
from support.builders import HALF_A_DEGREE, judged
from support.dispersed import normal

import nutdamp
from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.files.reader import load_spacecraft
from nutdamp.montecarlo import study as dispersion
from nutdamp.montecarlo.propagated import RealWidths
from nutdamp.montecarlo.study import SEED, STAGES, Results, run, study_of
from nutdamp.planning import screening
from nutdamp.planning.decision import Comparison, compare, recommend
from nutdamp.planning.plan import Plan
from nutdamp.planning.screening import FlownPlan, unflown
from nutdamp.planning.verdict import Cases, Status
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.spacecraft.model import Requirement
from nutdamp.spacecraft.tolerances import Dispersions

SHORT, LONG, ALL = STAGES[:3]
FAILS = (-1.0, -1.0)  # a case cannot be flown
Told = list[tuple[float, float]]

# Of each plan, the cheapest first, between which shares of all cases those lie that comply, as far as the cases of each
# stage tell; how many it flies; which of them is recommended, and its status.
FLOWN: list[tuple[list[tuple[Told, int]], int, Status]] = [
    # As many as it takes to know whether enough comply, and all with the plan to fly.
    ([([(0.9, 0.95)], SHORT), ([(0.99, 1.0), (0.996, 0.999), (0.998, 0.998)], ALL)], 1, Status.FLY),
    ([([(0.998, 1.0)] * 2 + [(0.9985,) * 2], ALL), ([(0.99, 1.0), (0.998, 0.9995)], LONG)], 0, Status.FLY),
    ([([(0.99, 1.0), (0.99, 0.998), (0.996,) * 2], ALL), ([(0.998, 1.0)] * 2 + [(0.999,) * 2], ALL)], 1, Status.FLY),
    # Too few with each: all that may be better than the best by a hundredth.
    (
        [
            ([(0.5, 0.6), (0.55, 0.57), (0.56,) * 2], ALL),
            ([(0.3, 0.58), (0.4, 0.5), (0.45,) * 2], ALL),
            ([(0.2, 0.569)], SHORT),
        ],
        0,
        Status.NOT_ENOUGH,
    ),
    (
        [([(0.5, 0.6), (0.51, 0.56), (0.52,) * 2], ALL), ([(0.4, 0.6), (0.5, 0.58), (0.54,) * 2], ALL)],
        1,
        Status.NOT_ENOUGH,
    ),
    # Not known with all cases that are flown.
    ([([(0.9, 0.95)], SHORT), ([(0.99, 1.0)] * 3, ALL)], 1, Status.NOT_SHOWN),
    # Plans with a case that cannot be flown are out, at once or later.
    ([([FAILS], 0), ([(0.998, 1.0)] * 2 + [(0.999,) * 2], ALL)], 1, Status.FLY),
    ([([(0.998, 1.0), FAILS], 0), ([(0.998, 1.0)] * 2 + [(0.999,) * 2], ALL)], 1, Status.FLY),
]


@pytest.fixture
def staged(monkeypatch: pytest.MonkeyPatch) -> dict[float, Told]:
    """What cases tell of plans by their impulse, by stage, instead of flying them; each stage takes a unit of work."""
    known: dict[float, Told] = {}

    def next_stage(begun: tuple[float, int], samples: int | None) -> tuple[float, int]:
        study, stage = begun[0], begun[1] + 1
        if stage == len(known[study]) or (stage > 0 and work.exhausted()):
            return begun
        work.spend(1.0)
        if known[study][stage] == FAILS:
            raise Infeasible("a case cannot be flown")
        return study, stage

    def cases_of(results: tuple[float, int], *, final: bool) -> Cases:
        low, high = known[results[0]][results[1]]
        return Cases(STAGES[results[1]], SEED, 0.997, low, low, high, final)

    monkeypatch.setattr(screening, "study_of", lambda _, schedule: schedule.total_impulse)
    monkeypatch.setattr(screening, "Results", lambda study, _: (study, -1))
    monkeypatch.setattr(screening, "next_stage", next_stage)
    monkeypatch.setattr(screening, "cases_of", cases_of)
    monkeypatch.setattr(screening, "affordable", lambda *_: not work.exhausted())
    return known


def required(count: int) -> list[Plan]:
    return [judged(f"{n}", 0.0, impulse=1.0 + n, required=HALF_A_DEGREE) for n in range(count)]


def recommending(plans: list[Plan]) -> partial[Plan | None]:
    return partial(lambda among, cases: recommend(among, cases).plan, plans)


def flown_of(plans: list[Plan], flown: dict[Plan, FlownPlan]) -> list[int]:
    return [flown[one].cases.samples if one in flown else 0 for one in plans]


@pytest.mark.parametrize(("told", "chosen", "status"), FLOWN)
def test_plans_compared_fly_as_many_cases_as_decide(
    told: list[tuple[Told, int]], chosen: int, status: Status, staged: dict[float, Told]
) -> None:
    plans = required(len(told))
    staged.update({plan.total_impulse: shares for plan, (shares, _) in zip(plans, told, strict=True)})
    flown = screening.fly_compared(plans, None, recommending(plans), plans)
    assert flown_of(plans, flown) == [count for _, count in told]
    compared = Comparison(plans[0].spacecraft, tuple(plans), flown)
    assert compared.recommended is plans[chosen]
    assert compared.verdict.status is status
    assert flown[plans[chosen]].final
    assert compared.cases == {plan: flown[plan].cases if plan in flown else unflown(plan) for plan in plans}


def test_a_plan_that_may_not_be_chosen_flies_until_its_verdict_is_known(staged: dict[float, Told]) -> None:
    """Such as one that cannot be commanded: whatever its share, the one to fly stays the same."""
    plans = required(3)
    shares = ([(0.1, 0.3)] * 2 + [(0.2, 0.2)], [(0.998, 1.0)] * 3, [(0.4, 1.0), (0.5, 0.9), (0.7, 0.7)])
    staged.update({plan.total_impulse: told for plan, told in zip(plans, shares, strict=True)})
    flown = screening.fly_compared(plans, None, recommending(plans[:1]), plans[:1])
    assert flown_of(plans, flown) == [ALL, SHORT, LONG]


def test_without_a_requirement_the_plan_to_fly_has_all_cases_and_a_budget_ends_them(
    staged: dict[float, Told],
) -> None:
    free = [judged(f"{n}", 0.0, impulse=1.0 + n) for n in range(2)]
    staged.update({plan.total_impulse: [(1.0, 1.0)] * 3 for plan in free})
    assert flown_of(free, screening.fly_compared(free, None, recommending(free), free)) == [ALL, SHORT]
    bound = required(2)
    staged.update({plan.total_impulse: [(0.99, 1.0), (0.99, 0.999), (0.998, 0.998)] for plan in bound})
    for units, *expected in ((0.5, SHORT, 0), (2.0, LONG, 0), (3.0, ALL, 0), (4.0, ALL, SHORT), (6.0, ALL, ALL)):
        with work.budget("cases", units):
            flown = screening.fly_compared(bound, None, recommending(bound), bound)
        assert flown_of(bound, flown) == expected
        status = Comparison(bound[0].spacecraft, tuple(bound), flown).verdict.status
        assert status is (Status.FLY if units >= 3.0 else Status.NOT_SHOWN)


@pytest.mark.deep
def test_cases_of_a_comparison_are_those_of_a_study_of_each_plan() -> None:
    """Of the seed of any study, the first ones first; and no more than were asked for."""
    spread = Dispersions(A=normal(0.01, relative=True), thrust_per_pulse=normal(0.02, relative=True))
    body = replace(nutdamp.example(), dispersions=spread, requirement=Requirement(math.radians(0.4), None, 0.6))
    compared = compare(body, CLASSIC, samples=3_000)
    assert compared.recommended is not None
    assert compared.flown is not None
    for plan in compared:
        verdict, flown = compared.verdicts[plan], compared.flown[plan]
        assert verdict.cases is flown.cases is compared.cases[plan]
        again = run(Results(study_of(body, plan.pulses), flown.cases.samples))
        assert (flown.cases.complying, flown.cases.seed) == (again.met_fraction, SEED)
        assert (flown.cases.low, flown.cases.high) == again.interval(certain=not flown.final)
        assert flown.final == (flown.cases.samples == 3_000)
        levels = {bound.part.value: level for bound, level in flown.cases.levels.items()}
        assert flown.left == levels["nutation"] == np.quantile(again.values[0], 0.6)  # type: ignore[index]
    assert compared.flown[compared.recommended].final
    assert {flown.cases.samples for flown in compared.flown.values()} == {2_048, 3_000}
    nominal = [compare(body, CLASSIC, samples=0), compare(replace(body, dispersions=None), CLASSIC)]
    nominal += [compare(replace(body, requirement=None), CLASSIC)]
    for one in nominal:
        assert (one.flown, one.cases, one.verdict.cases) == (None, {}, None)
    with work.budget("nothing", 0.0):
        assert compare(body, ["two-pulse"]).flown == {}


@pytest.mark.deep
def test_more_cases_than_are_kept_one_by_one_are_counted_and_have_the_budget_of_so_many(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    body, samples = nutdamp.example(), 24_000
    kept = compare(body, ["two-pulse"], samples=samples).verdict
    monkeypatch.setattr(dispersion, "EXACT_CASES", 20_000)
    monkeypatch.setattr(work, "CASES", 305.0)  # for 20,000 cases; so many take 360 units
    counted = compare(body, ["two-pulse"], samples=samples).verdict
    assert kept.cases is not None
    assert counted.cases is not None
    assert counted.cases.samples == samples
    assert (counted.cases.complying, counted.status) == (kept.cases.complying, Status.FLY)


def test_what_costs_more_than_is_left_of_the_budget_is_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first cases are flown at once: they alone may take long, where coasts are no arcs and cones are looked at."""
    body = load_spacecraft(places.case("rob2.yaml"))
    monkeypatch.setattr(RealWidths, "effort", 1e9)
    compared = compare(body, ["two-pulse"])
    assert (compared.flown, compared.verdict.status) == ({}, Status.NOT_SHOWN)
