"""Robust planning: the cheapest plan of which enough cases comply, in fresh ones too; else that with most of them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from support.builders import HALF_A_DEGREE, cross, judged, spinner
from support.cases import deep
from support.checker import violations
from support.dispersed import normal
from support.golden import refused
from support.places import case
from support.single_case import flown_outputs

import nutdamp
from nutdamp.errors import BadRequest
from nutdamp.montecarlo.inputs import DispersedInput
from nutdamp.montecarlo.study import SEED, Results, flown_in_stages, run, study_of
from nutdamp.planning import plan as planning
from nutdamp.planning import robust
from nutdamp.planning.chance_plan import Tightening
from nutdamp.planning.decision import Comparison, Ground, compare
from nutdamp.planning.plan import Plan
from nutdamp.planning.robust import FRESH, robust_reasons
from nutdamp.planning.screening import FlownPlan
from nutdamp.planning.verdict import Cases, Status, cases_of
from nutdamp.schemes import four_pulse
from nutdamp.schemes.catalogue import CLASSIC, Options
from nutdamp.spacecraft.model import Limits, Requirement, Spacecraft
from nutdamp.spacecraft.requirements import bounds
from nutdamp.spacecraft.tolerances import Dispersions
from nutdamp.views.robust import robust_json
from nutdamp.views.text import joined

share_of = partial(normal, relative=True)
EXACT = Dispersions(A=share_of(0.002))
"""Dispersions that leave everything but A exactly known, and that nearly."""


def dispersed(
    dispersions: Dispersions | None = EXACT,
    requirement: Requirement | None = None,
    moments: tuple[float, float, float] | None = None,
) -> Spacecraft:
    channels = tuple(one.of(thrust=10.0, isp=220.0) for one in cross(8.0, max_on_time=2.0))
    return replace(spinner(channels=channels, requirement=requirement, moments=moments), dispersions=dispersions)


def planned(body: Spacecraft, *names: str, trials: int | None = None) -> robust.RobustComparison:
    compared = compare(body, names or CLASSIC)
    attempts = robust.variations_of(compared)
    if trials is not None:
        as_planned = [("as planned", plan) for plan in compared]
        attempts = [robust.Variation(partial(list, as_planned)), *attempts[:trials]]
    return robust.compare(compared, attempts)


@pytest.fixture
def untightened(monkeypatch: pytest.MonkeyPatch) -> None:
    """How far tolerances have to shrink is not asked: that flies many cases more."""
    monkeypatch.setattr(robust, "tightening", lambda *_: None)


def best(found: robust.RobustComparison) -> FlownPlan:
    assert found.chosen is not None
    return found.chosen


def share(body: Spacecraft, plan: Plan, seed: int = SEED, samples: int = 20_000) -> float:
    """Of the cases those that comply."""
    return run(Results(study_of(body, plan.pulses, seed=seed), samples)).met_fraction or 0.0


# --- the choice, on plans whose figures are given


Shares = tuple[float, float, float]
"""Of the cases those that comply, and between which two shares that of all lies."""
ENOUGH, TOO_FEW, UNKNOWN, NONE = (0.999, 0.998, 1.0), (0.93, 0.9, 0.95), (0.998, 0.99, 1.0), (0.0, 0.0, 0.004)
MOST, LESS, LEAST = (0.9, 0.88, 0.917), (0.885, 0.864, 0.903), (0.875, 0.853, 0.894)
"""95 % intervals of 900, 885 and 875 in 1,000 cases."""


def candidate(
    impulse: float,
    shares: Shares = ENOUGH,
    left: float = 0.0,
    *,
    end: float = 1.0,
    required: Requirement | None = HALF_A_DEGREE,
    flown: float = 0.0,
) -> FlownPlan:
    """A plan of so many N m s, and degrees of nutation: ``left`` in 99.7 % of cases, ``flown`` with nominal values."""
    made = judged("plan", flown, impulse=impulse, end=end, required=required)
    levels = {bound: math.radians(left) for bound in bounds(made.spacecraft)}
    complying, low, high = (None if required is None else shares[0]), *shares[1:]
    return FlownPlan(made, None, "as planned", True, Cases(1_000, SEED, 0.997, complying, low, high, levels=levels))


IDLE = Requirement(momentum_shift=0.1)

# Plans, of which the first is recommended without --robust; those of which enough fresh cases comply too; the chosen
# one and what decided; None: that with most cases is taken.
CHOICES: list[tuple[list[FlownPlan], set[int], int | None, Ground | None]] = [
    ([candidate(2.0, ENOUGH), candidate(1.0, ENOUGH)], {0, 1}, 1, Ground.COST),
    ([candidate(2.0, ENOUGH), candidate(1.0, ENOUGH)], {0}, 0, Ground.ONLY),  # the cheaper one complied by luck
    ([candidate(2.0, ENOUGH), candidate(1.0, TOO_FEW)], {0, 1}, 0, Ground.ONLY),
    ([candidate(2.0, ENOUGH), candidate(1.0, UNKNOWN)], {0, 1}, 0, Ground.ONLY),
    ([candidate(2.0, ENOUGH), candidate(1.0, ENOUGH, flown=0.6)], {0, 1}, 0, Ground.ONLY),  # it misses nominally
    ([candidate(1.0, ENOUGH, end=2.0), candidate(1.0 - 1e-12, ENOUGH)], {0, 1}, 0, Ground.NOMINAL),
    ([candidate(2.0, ENOUGH), candidate(1.0, ENOUGH, end=2.0), candidate(1.0, ENOUGH)], {0, 1, 2}, 2, Ground.END),
    # What is not required is damped all the same, or at least as far as it goes.
    (
        [candidate(2.0, ENOUGH, required=IDLE), candidate(1.0, ENOUGH, 4.0, required=IDLE, flown=3.0)],
        {0, 1},
        0,
        Ground.ONLY,
    ),
    (
        [candidate(1.0, ENOUGH, 4.0, required=IDLE, flown=3.0), candidate(2.0, ENOUGH, 2.0, required=IDLE, flown=1.0)],
        {0, 1},
        1,
        Ground.ONLY,
    ),
    ([candidate(2.0, ENOUGH), candidate(1.0, ENOUGH)], set(), None, None),
    ([candidate(2.0, TOO_FEW), candidate(1.0, UNKNOWN)], {0, 1}, None, None),
    ([candidate(1.0, required=None)], {0}, None, None),  # nothing is required
]


@pytest.mark.parametrize(("plans", "fresh", "chosen", "ground"), CHOICES)
def test_the_cheapest_plan_of_which_enough_cases_comply_in_fresh_ones_too(
    plans: list[FlownPlan], fresh: set[int], chosen: int | None, ground: Ground | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    shares = {id(each): ENOUGH if number in fresh else UNKNOWN for number, each in enumerate(plans)}
    monkeypatch.setattr(robust, "_fresh", lambda each: Cases(1_000, FRESH, 0.997, *shares[id(each)]))
    found, decided, _ = robust._confirmed(dict(enumerate(plans)), plans[0].plan)
    assert (found, decided) == (None if chosen is None else plans[chosen], ground)


def test_else_the_plan_with_most_cases_or_that_leaves_least_and_the_cheapest_within_the_sampling_error() -> None:
    """Angles within 5 % are equal."""
    for plans, chosen, ground, equals in (
        ([candidate(1.0, LESS), candidate(2.0, MOST)], 0, Ground.COST, 2),
        ([candidate(1.0, LEAST), candidate(2.0, MOST)], 1, Ground.ONLY, 1),
        ([candidate(1.0, LESS, end=9.0), candidate(1.0, MOST)], 0, Ground.NOMINAL, 2),
        ([candidate(1.0, NONE, flown=3.0), candidate(2.0, NONE, flown=2.0)], 1, Ground.LEFT, 2),
    ):
        assert robust._nearest(plans, plans[0].plan) == (plans[chosen], ground, equals)
    for cheap, chosen, equals in ((1.04, 0, 2), (1.06, 1, 1)):
        free = [candidate(1.0, left=cheap, required=None), candidate(2.0, left=1.0, required=None)]
        assert robust._nearest(free, free[0].plan)[::2] == (free[chosen], equals)
    assert robust._nearest([], None) == (None, None, 0)


# --- plans that are flown


def test_a_thruster_that_cannot_be_trusted_is_left_out() -> None:
    """Nominally four-pulse fires the untrusted channel; the robust plan does without, and tells what that takes."""
    untrusted = planning.plan(dispersed(), "four-pulse").pulses.pulses[0].channel
    found = planned(dispersed(replace(EXACT, thrust={untrusted: share_of(0.3)})), "four-pulse")
    assert found.usual is not None
    more, less = best(found).plan.pulses, found.usual.plan.pulses
    assert [untrusted in {pulse.channel for pulse in pulses} for pulses in (less, more)] == [True, False]
    assert best(found).left < 0.3 * found.usual.left
    expected = (
        (more.propellant or 0.0) - (less.propellant or 0.0),
        more.total_impulse - less.total_impulse,
        more.end - less.end,
        best(found).left - found.usual.left,
    )
    assert found.cost == pytest.approx(expected)


@pytest.mark.deep
def test_where_nothing_is_better_the_plan_recommended_for_nominal_values_stays_of_many_that_keep_the_limits() -> None:
    body = dispersed()
    found = planned(body)
    assert best(found) is found.usual
    assert (best(found).plan, found.fresh) == (found.comparison.recommended, None)
    kinds = {tuple((pulse.channel, round(pulse.start, 6)) for pulse in one.plan.pulses) for one in found.candidates}
    assert len(kinds) == len(found.candidates) > 10, "none comes twice"
    for plan in (one.plan for one in found.candidates):
        assert (plan.spacecraft, violations(body, plan.pulses)) == (body, [])
        assert plan.flown is not None
        assert plan.flown.nutation < body.nutation
    for scheme, parts in (("two-pulse", ("as planned", "from ", " then ")), ("four-pulse", ("from ", "without "))):
        variants = " ".join(one.variant for one in found.candidates if one.plan.scheme == scheme)
        assert all(text in variants for text in parts)
    least = min(one.left for one in found.candidates)
    close = [one.plan.pulses.cost for one in found.candidates if one.left <= 1.05 * least]
    assert len(close) == found.equals
    assert best(found).plan.pulses.cost <= min(close) * 1.001


@pytest.mark.parametrize("moments", [deep(None), deep((122.0, 118.0, 80.0))])
@pytest.mark.usefixtures("untightened")
def test_the_plan_in_which_most_cases_comply_by_flights_one_by_one(moments: tuple[float, float, float] | None) -> None:
    """Whatever the nominal plan costs; of those within the sampling error of the best the cheapest."""
    spread = Dispersions(A=share_of(0.01), thrust_per_pulse=share_of(0.02))
    body = dispersed(spread, Requirement(math.radians(0.4), math.radians(0.3), 0.9), moments)
    found = planned(body, "two-pulse", "four-pulse", trials=None if moments is None else 1)
    chosen, pulses = best(found), best(found).plan.pulses
    final = [one for one in found.candidates if one.final]
    most = max(final, key=lambda one: one.cases.complying or 0.0)
    assert 0.05 < (most.cases.complying or 0.0) < found.probability == 0.9
    assert chosen is found.candidates[0]
    assert chosen.cases.complying == share(body, chosen.plan)
    good = [one for one in final if (one.cases.complying or 0.0) >= most.cases.low]
    assert chosen in good
    assert pulses.cost <= 1.001 * min(one.plan.pulses.cost for one in good)
    assert max(one.cases.high for one in found.candidates if not one.final) < most.cases.high
    assert found.verdict.status is Status.NOT_ENOUGH
    # The nutation that 90 % of 100 cases do not exceed, flown singly; the sampling error of it is about a seventh.
    study = study_of(body, pulses)
    flown = [flown_outputs(study.model, study.draws_of(case))[0] for case in range(100)]
    assert float(np.quantile(flown, 0.9)) == pytest.approx(chosen.left, rel=0.35)
    assert study.outputs_of(study.draws_of(3))[0] == pytest.approx(flown[3], abs=1e-10)
    # And in cases that are new to the choice.
    assert found.fresh == cases_of(flown_in_stages(study_of(body, pulses, seed=FRESH)))
    assert found.fresh.complying != chosen.cases.complying


@pytest.mark.weekly
def test_the_earliest_end_is_a_candidate() -> None:
    """No robust plan complies less often: phases of late pulses are wrong by an error of C that grows with time."""
    pair = tuple(one.of(isp=220.0, thrust=2.9) for one in cross(1.8748, min_on_time=0.02, max_on_time=2.0)[:2])
    required = Requirement(math.radians(0.199), math.radians(0.826), 0.99)
    body = spinner(137.2, 244.1, 0.9753, 3.427, 4.92, channels=pair, requirement=required, limits=Limits(horizon=300.0))
    bits = {one.name: share_of(0.0081) for one in pair}
    body = replace(body, dispersions=Dispersions(C=share_of(0.0055), impulse_bit=bits))
    alone = share(body, planning.plan(body, "optimal", Options(least="time")))
    assert (best(planned(body, "four-pulse", "optimal")).cases.complying or 0.0) >= alone > 0.4


@pytest.mark.deep
def test_the_spin_is_set_with_h_kept_where_that_damps_in_more_cases() -> None:
    """Where H may end anywhere no plan has more than 80 %."""
    body = nutdamp.load(case("rim-spin-up.yaml")).with_(goal={"spin": "20 rpm"})
    robust_plan = planned(body, "optimal")
    assert (robust_plan.verdict.status, best(robust_plan).variant[-6:]) == (Status.FLY, "H kept")


@pytest.mark.deep
@pytest.mark.usefixtures("untightened")
@pytest.mark.parametrize(("shift", "scheme"), [(5.0, "four-pulse"), (0.1, "two-pulse")])
def test_of_plans_with_which_all_cases_comply_the_cheapest(shift: float, scheme: str) -> None:
    """Four pulses of the example cost less, but turn H more; two pulses bring it back.

    By all cases of each: with none that costs less enough comply. The verdict is by those of any other command.
    """
    requested = Requirement(math.radians(0.5), math.radians(shift), 0.99)
    body = replace(nutdamp.example(), dispersions=Dispersions(thrust_per_pulse=share_of(0.001)), requirement=requested)
    found = planned(body, "four-pulse", "two-pulse")
    assert (best(found).plan.scheme, best(found).cases.complying) == (scheme, 1.0)
    assert (found.verdict.status, found.verdict.cases, found.name) == (Status.FLY, best(found).cases, scheme)
    assert found.verdict.cases == cases_of(flown_in_stages(study_of(body, best(found).plan.pulses)))
    assert found.fresh is not None
    assert found.fresh.complying == share(body, best(found).plan, FRESH) >= 0.99
    for other in found.candidates:
        if other.plan.pulses.cost < 0.999 * best(found).plan.pulses.cost:
            assert share(body, other.plan) < 0.99


def raising(*_: object) -> object:
    raise ZeroDivisionError


def test_the_share_is_that_of_the_real_widths_and_how_far_it_is_can_be_watched(monkeypatch: pytest.MonkeyPatch) -> None:
    """Long pulses: four-pulse shifts H by 0.57°, by impulse sums by 0.83°."""
    compared = compare(dispersed(requirement=Requirement(None, math.radians(0.7))), ("four-pulse",))
    trials, reported = robust.variations_of(compared)[:3], list[int]()
    found = robust.compare(compared, trials, reported.append)
    planned_as_it_is = next(one for one in found.candidates if one.variant == "as planned")
    assert planned_as_it_is.cases.complying == 1.0
    assert reported == list(range(len(trials) + 1))
    nowhere = planned(replace(dispersed(), channels=cross(1e-9), limits=Limits(horizon=1e-3)))
    assert (nowhere.chosen, nowhere.cost, nowhere.verdict.status) == (None, None, Status.NO_PLAN)
    sure = compare(dispersed(None), ("four-pulse",))
    with refused(BadRequest, "plan.not-dispersed"):
        robust.compare(sure, robust.variations_of(sure))
    monkeypatch.setattr(four_pulse, "schedule", raising)  # a scheme with a bug is left out
    assert robust.variations_of(compare(dispersed(), ("four-pulse",))) == []


def test_the_json_has_what_the_best_costs_fresh_cases_and_what_would_have_to_be_better_known() -> None:
    dear, usual = candidate(2.0, MOST, 0.5, end=3.0), candidate(1.0, LEAST, 1.0)
    body = usual.plan.spacecraft
    dear.plan = replace(dear.plan, spacecraft=body)
    compared, of_A = Comparison(body, (usual.plan,)), DispersedInput("A", "A", "normal", 0.6, 120.0, "kg m²")
    needed, fresh = Tightening(("A",), 0.5, ((of_A, True),), 5_000, 7, 0.998, 0.9971), Cases(1_000, 9, 0.997, *MOST)
    found = robust.RobustComparison(compared, (dear, usual), usual, dear, Ground.ONLY, 1, 0.997, needed, fresh)
    written = robust_json(found)
    assert (written["reason"], written["meets_requirement"]) == (joined(robust_reasons(found)), False)
    assert [one["met_fraction"] for one in written["candidates"]] == [0.9, 0.875]
    assert (written["recommended"]["left_deg"], written["against"]["left_deg"]) == pytest.approx((0.5, 1.0))
    cost = {"propellant_kg": None, "total_impulse_Nms": 1.0, "end_s": 2.0, "nutation_deg": -0.5}
    assert written["cost"] == pytest.approx(cost)
    told = {"samples": 1_000, "seed": 9, "met_fraction": 0.9, "low": 0.88, "high": 0.917, "probability": 0.997}
    assert written["fresh"] == told
    checked = {"samples": 5_000, "seed": 7, "met_fraction": 0.998, "at_least": 0.9971}
    inputs = [{"name": "A", "normal": 0.6, "needed": 0.3, "unit": "kg m²"}]
    tolerances = {"A": {"sigma": 0.6, "needed": 0.3}}
    assert written["tightening"] == {"factor": 0.5, "tolerances": tolerances, "inputs": inputs, "checked": checked}


@pytest.mark.deep
@pytest.mark.usefixtures("untightened")
def test_the_robust_plan_of_a_spacecraft_with_commands_can_be_commanded_unless_pulses_may_be_timed() -> None:
    """Timed pulses cost far less."""
    body = replace(nutdamp.load(case("cbp1004.yaml")), dispersions=EXACT)
    compared = compare(body, ("command-block", "two-pulse"), samples=200)
    alone = compare(body, ("two-pulse",), samples=200)
    few, many = (robust.variations_of(each) for each in (compared, replace(compared, timed=True)))
    assert 1 < len(few) < len(many) == len(few) + len(robust.variations_of(alone))  # no timed plan is made in vain
    for one, commanded in ((compared, True), (replace(compared, timed=True), False), (alone, False)):
        trials = [robust.Variation(partial(list, [("as planned", plan)])) for plan in one]
        found = robust.compare(one, trials)
        assert {each.plan.scheme for each in found.candidates} == (
            {"command-block"} if commanded else {plan.scheme for plan in one}
        )
        assert best(found).plan.commandable is commanded
