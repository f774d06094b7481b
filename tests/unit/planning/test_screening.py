"""How many dispersed cases the plans of a comparison fly: as many as it takes to know what to recommend."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import pytest
from support import places
from support.builders import HALF_A_DEGREE, judged

import nutdamp
from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.files.reader import load_spacecraft
from nutdamp.montecarlo import study as dispersion
from nutdamp.montecarlo.propagated import RealWidths
from nutdamp.montecarlo.study import SEED
from nutdamp.planning import screening
from nutdamp.planning.decision import Comparison, compare, decide
from nutdamp.planning.plan import Plan, Share
from nutdamp.planning.recommendation import recommend
from nutdamp.planning.screening import Cases, PlanCandidate

SHORT, LONG, ALL = 2_048, 8_192, 20_000
NEVER = "cannot be flown"

# Of each plan, the cheapest first, between which shares of all cases those lie that comply, as far as 2,048, 8,192 and
# 20,000 cases tell; how many it flies; which of them is recommended, and whether enough comply.
FLOWN: list[tuple[list[tuple[list[tuple[float, float]], int]], int, bool | None]] = [
    # As many as it takes to know whether enough comply, and all with the plan to fly.
    (
        [([(0.9, 0.95)], SHORT), ([(0.99, 1.0), (0.996, 0.999), (0.998,) * 2], ALL)],
        1,
        True,
    ),
    (
        [([(0.998, 1.0), (0.998, 1.0), (0.9985,) * 2], ALL), ([(0.99, 1.0), (0.998, 0.9995)], LONG)],
        0,
        True,
    ),
    ([([(0.99, 1.0), (0.99, 0.998), (0.996,) * 2], ALL), ([(0.998, 1.0), (0.998, 1.0), (0.999,) * 2], ALL)], 1, True),
    # Too few with each: all that may be as good as the best.
    (
        [
            ([(0.5, 0.6), (0.55, 0.57), (0.56,) * 2], ALL),
            ([(0.3, 0.58), (0.4, 0.5)], LONG),
            ([(0.2, 0.55)], SHORT),
        ],
        0,
        False,
    ),
    ([([(0.5, 0.6), (0.51, 0.56), (0.52,) * 2], ALL), ([(0.4, 0.6), (0.5, 0.58), (0.54,) * 2], ALL)], 1, False),
    # Plans with a case that cannot be flown are out, at once or later.
    ([([], 0), ([(0.998, 1.0)] * 2 + [(0.999,) * 2], ALL)], 1, True),
    ([([(0.998, 1.0)], 0), ([(0.998, 1.0)] * 2 + [(0.999,) * 2], ALL)], 1, True),
]


@pytest.fixture
def staged(monkeypatch: pytest.MonkeyPatch) -> dict[Plan, list[tuple[float, float]]]:
    """What cases tell of plans, by stage, instead of flying them; each takes a unit of work."""
    known: dict[Plan, list[tuple[float, float]]] = {}

    def told(one: PlanCandidate, stage: int) -> None:
        work.spend(1.0)
        if stage >= len(known[one.plan]):
            raise Infeasible(NEVER)
        one.share = Share(*known[one.plan][stage], 0.997)
        one.cases = replace(one.cases, samples=(*screening.STAGES, ALL)[stage], complying=one.share.low)

    def entered(plan: Plan, variant: str, study: object, samples: int) -> PlanCandidate:
        made = PlanCandidate(plan, variant, Cases(0, samples, SEED, 0.0, 0.997, {}))
        told(made, 0)
        return made

    def further(one: PlanCandidate, samples: int) -> None:
        assert samples == ALL
        told(one, 1 + screening.STAGES.index(one.cases.samples))

    monkeypatch.setattr(screening, "entered", entered)
    monkeypatch.setattr(screening, "_further", further)
    monkeypatch.setattr(screening, "study_of", lambda *_: None)
    monkeypatch.setattr(screening, "affordable", lambda *_: not work.exhausted())
    return known


def chosen_of(plans: list[Plan], shares: Mapping[Plan, Share]) -> Plan | None:
    return recommend(plans, shares).plan


def flown_of(plans: list[Plan], flown: dict[Plan, PlanCandidate]) -> list[int]:
    return [flown[one].cases.samples if one in flown else 0 for one in plans]


def test_plans_compared_fly_as_many_cases_as_decide(staged: dict[Plan, list[tuple[float, float]]]) -> None:
    for given, chosen, met in FLOWN:
        plans = [judged(f"{n}", 0.0, impulse=1.0 + n, required=HALF_A_DEGREE) for n in range(len(given))]
        staged.update({plan: told for plan, (told, _) in zip(plans, given, strict=True)})
        flown = screening.fly_compared(plans, ALL, partial(chosen_of, plans))
        assert flown_of(plans, flown) == [count for _, count in given]
        compared = Comparison(plans[0].spacecraft, tuple(plans), flown)
        assert compared.recommended is plans[chosen]
        assert compared.meets(plans[chosen]) is met
        for plan in plans:
            expected = Share(*staged[plan][-1], 0.997) if plan in flown else Share(0.0, 1.0, 0.997)
            if plan not in flown or flown[plan].cases.decided:
                assert compared.shares[plan] == expected
            assert (compared.cases(plan) is None) == (plan not in flown)


def test_a_plan_that_may_not_be_chosen_flies_until_its_verdict_is_known(
    staged: dict[Plan, list[tuple[float, float]]],
) -> None:
    """Such as one that cannot be commanded: whatever its share, the one to fly stays the same."""
    plans = [judged(f"{n}", 0.0, impulse=1.0 + n, required=HALF_A_DEGREE) for n in range(3)]
    shares = ([(0.1, 0.3)] * 2 + [(0.2, 0.2)], [(0.998, 1.0)] * 3, [(0.4, 1.0), (0.5, 0.9), (0.7, 0.7)])
    staged.update(zip(plans, shares, strict=True))
    flown = screening.fly_compared(plans, ALL, partial(chosen_of, plans[:1]))
    assert flown_of(plans, flown) == [ALL, SHORT, LONG]


def test_without_a_requirement_the_plan_to_fly_has_all_cases_and_a_budget_ends_them(
    staged: dict[Plan, list[tuple[float, float]]],
) -> None:
    free = [judged(f"{n}", 0.0, impulse=1.0 + n) for n in range(2)]
    staged.update({plan: [(0.0, 0.0)] * 3 for plan in free})
    flown = screening.fly_compared(free, ALL, lambda shares: recommend(free, shares).plan)
    assert flown_of(free, flown) == [ALL, SHORT]
    bound = [judged(f"{n}", 0.0, impulse=1.0 + n, required=HALF_A_DEGREE) for n in range(2)]
    staged.update({plan: [(0.99, 1.0), (0.99, 0.999), (0.998, 0.998)] for plan in bound})
    for units, expected in ((0.5, [SHORT, 0]), (2.0, [SHORT, SHORT]), (3.0, [LONG, SHORT]), (6.0, [ALL, ALL])):
        with work.budget("cases", units):
            flown = screening.fly_compared(bound, ALL, lambda shares: recommend(bound, shares).plan)
        assert flown_of(bound, flown) == expected
        decision = decide(Comparison(bound[0].spacecraft, tuple(bound), flown))
        assert decision is not None
        assert (decision.unknown, decision.met) == (units < 6.0, units == 6.0)


@pytest.mark.deep
def test_more_cases_than_are_kept_one_by_one_are_counted_and_have_the_budget_of_so_many(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    body, samples = nutdamp.example(), 24_000
    kept = compare(body, ["two-pulse"], samples=samples)
    monkeypatch.setattr(dispersion, "EXACT_CASES", 20_000)
    monkeypatch.setattr(screening, "EXACT_CASES", 20_000)
    monkeypatch.setattr(work, "CASES", 305.0)  # for 20,000 cases; so many take 360 units
    counted = compare(body, ["two-pulse"], samples=samples)
    told = [one.shares[one.plans[0]].exact for one in (kept, counted)]
    assert told[0] is not None
    assert told[0] == told[1]
    decided = decide(counted)
    assert decided is not None
    assert (decided.unknown, decided.met) == (False, True)


def test_what_costs_more_than_is_left_of_the_budget_is_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first cases are flown at once: they alone may take long, where coasts are no arcs and cones are looked at."""
    body = load_spacecraft(places.case("rob2.yaml"))
    monkeypatch.setattr(RealWidths, "effort", 1e9)
    compared = compare(body, ["two-pulse"])
    assert compared.flown == {}
    decided = decide(compared)
    assert decided is not None
    assert (decided.unknown, decided.met) == (True, False)
