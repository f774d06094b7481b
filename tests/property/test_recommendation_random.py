"""Random spacecraft, weak and strong, under any limits: no plan beats the recommended one in all that counts."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.builders import HALF_A_DEGREE, Outcome, aimed, codes, judged, present
from support.cases import spread
from support.random_bodies import power, random_spacecraft

import nutdamp
from nutdamp.planning.decision import Comparison, compare, usual
from nutdamp.planning.notes import comparison_warnings
from nutdamp.planning.plan import Plan, Standing
from nutdamp.planning.screening import FlownPlan
from nutdamp.planning.verdict import Cases, Status
from nutdamp.schemes.catalogue import LEAST, Options
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.spacecraft.requirements import Part

COUNT = 200


def draw(number: int) -> Spacecraft:
    """With a requirement in half of the cases, a target in a tenth."""
    rng = np.random.default_rng([2024, number])
    body = random_spacecraft(rng)
    requirement = None
    if rng.random() < 0.5:
        nutation = body.nutation * power(rng, -3.0, -0.3) if rng.random() < 0.85 else None
        shift = body.nutation * power(rng, -2.0, 0.0) if rng.random() < 0.5 or not nutation else None
        requirement = Requirement(nutation, shift)
    body = replace(body, requirement=requirement)
    return aimed(body, rng.uniform(1.0, 30.0), rng.uniform(0.0, 360.0)) if rng.random() < 0.1 else body


def cost(plan: Plan, others: tuple[Plan, ...]) -> float:
    """Propellant in kg where all know it, else impulse in N m s."""
    known = [plan.pulses.propellant, *(one.pulses.propellant for one in others)]
    return plan.pulses.total_impulse if None in known else known[0] or 0.0


def left(plan: Plan) -> tuple[float, float]:
    return present(plan.flown).nutation, present(plan.flown).axis_error


def complies(body: Spacecraft, nutation: float, distance: float) -> bool:
    """The rule, written down again: the requirement, and what counts as damped where it says nothing."""
    requirement, least = body.requirement or Requirement(), math.radians(1e-3)
    most, far = requirement.nutation, requirement.momentum_shift
    if far is None:
        far = math.inf if body.goal.axis is None else max(0.01 * body.to_turn, least)
    return nutation <= (max(0.01 * body.nutation, least) if most is None else most) and distance <= far


def standing(number: int, compared: Comparison) -> Standing | None:
    """What the recommended plan reaches, once it is seen that none beats it and that what is said of it is so."""
    body, chosen, warnings = compared.spacecraft, compared.recommended, [*comparison_warnings(compared)]
    assert not compared.failed, (number, [one.failure for one in compared.failed])
    feasible = tuple(one for one in compared.plans if one.flown is not None)
    if chosen is None or chosen.flown is None:
        assert not feasible
        return None
    for other in feasible:  # none leaves no more of anything and costs less, by more than counts as equal
        no_more = all(theirs <= own for theirs, own in zip(left(other), left(chosen), strict=True))
        cheaper = cost(other, feasible) < cost(chosen, feasible) * (1.0 - 1e-3)
        assert not (no_more and cheaper), (number, chosen.scheme, other.scheme)
    good = [one for one in feasible if complies(body, *left(one))]
    assert (chosen in good) == bool(good) != bool(warnings), number
    aim = 0.0 if body.goal.axis is None else body.to_turn
    assert compared.verdict.idle == complies(body, body.nutation, aim), number
    if good:
        assert cost(chosen, tuple(good)) <= 1.001 * min(cost(one, tuple(good)) for one in good)
        return chosen.standing
    counts = 1 if body.goal.axis is None else 2  # the nutation, or the distance from a target where that is more
    alike = [max(left(one)[:counts]) for one in feasible if one.standing is chosen.standing]
    assert max(left(chosen)[:counts]) <= min(alike) + math.radians(1e-3), number
    missed = [entry.values for entry in warnings if entry.code in ("requirement-missed", "not-damped")]
    assert missed, number
    for values in missed:
        left_deg = math.degrees(left(chosen)[values["part"] != Part.NUTATION.label])
        assert values["left_deg"] == pytest.approx(left_deg), number
    untried = body.channels and all(one.scheme != "optimal" for one in compared.plans)
    assert ("optimal-not-compared" in codes(warnings)) == bool(untried), number
    return chosen.standing


@pytest.mark.weekly
def test_nothing_beats_what_is_recommended_and_what_is_said_of_it_is_so() -> None:
    """Its residuals too, by an integrator that shares nothing with the flights here."""
    standings, flown = [], 0
    for number in range(COUNT):
        body = draw(number)
        # The rule does not know schemes by name.
        compared = compare(body, [name for name in usual(body) if name != "optimal"], Options())
        standings.append(standing(number, compared))
        chosen = compared.recommended
        if number % 7 or chosen is None or body.goal.axis is not None or len(chosen.pulses) > 30:
            continue
        outcome, flown = Outcome(body, chosen.pulses), flown + 1
        surely, hardly = (
            complies(body, *(angle * (1 + off) + off for angle in (outcome.nutation, outcome.shift)))
            for off in (1e-8, -1e-8)
        )
        assert surely <= (chosen.standing is Standing.COMPLIES) <= hardly
    assert flown > 20
    # Each kind of outcome is there, and often.
    assert min(standings.count(Standing.COMPLIES), standings.count(Standing.MISSES)) > COUNT // 5
    assert standings.count(None) < COUNT // 3


@pytest.mark.weekly
@pytest.mark.parametrize("number", range(0, COUNT, 15))
def test_nor_where_optimal_is_compared_too(number: int) -> None:
    body = draw(number)
    standing(number, compare(body, tuple(dict.fromkeys((*usual(body), "optimal")))))


# --- `plan` says what `disperse` says, and recommends what takes least

SCHEMES = ("one-pulse", "two-pulse", "four-pulse")


def tolerant(seed: int) -> Spacecraft:
    """The built-in example with other moments, motion, tolerances and requirement: some plans comply, others do not."""
    rng = np.random.default_rng(seed)
    size = float(10.0 ** rng.uniform(-1.0, 0.0))
    requirement: dict[str, Any] = {"nutation": f"{rng.uniform(0.2, 0.8)} deg"}
    if rng.random() < 0.5:
        requirement["momentum_shift"] = f"{rng.uniform(0.1, 1.0)} deg"
    return nutdamp.example().with_(
        inertia={"A": 120.0, "C": 120.0 * rng.uniform(0.4, 1.6)},
        state={"spin": f"{rng.choice([-20, 30])} rpm", "nutation": f"{rng.uniform(2.0, 8.0)} deg", "phase": "40 deg"},
        requirement=requirement | {"probability": float(rng.choice([0.9, 0.99, 0.997]))},
        dispersions={
            "A": {"normal": f"{0.5 * size} %"},
            "omega0": {"normal": f"{0.1 * size} deg/s"},
            "thrust": {"normal": f"{2.0 * size} %"},
            "timing": {"uniform": "5 ms"},
        },
    )


@spread("seed", range(100), quick=1, deep=5)
def test_plan_and_disperse_say_the_same(seed: int) -> None:
    """Of the plan recommended, all; of the others as far as their cases were flown."""
    compared = compare(tolerant(seed), SCHEMES, samples=4_000)
    verdict, recommended = compared.verdict, present(compared.recommended)
    for plan in compared:
        cases = compared.verdicts[plan].cases
        if cases is None:
            continue
        flown = nutdamp.disperse(plan, 4_000).verdict
        if plan is recommended:
            assert (verdict.status, verdict.lines, verdict.cases) == (flown.status, flown.lines, present(flown.cases))
        if cases.enough is not None:
            assert compared.verdicts[plan].status is flown.status, plan.scheme
        assert cases.low <= (present(flown.cases).complying or 0.0) <= cases.high
    complying = [plan for plan in compared if compared.verdicts[plan].met]
    if complying:
        assert recommended in complying
        assert recommended.pulses.cost <= min(plan.pulses.cost for plan in complying) * 1.001


PLANS = st.lists(
    st.tuples(st.floats(0.0, 0.8), st.floats(0.1, 2.0), st.floats(1.0, 9.0), st.integers(1, 4), st.floats(0.99, 1.0)),
    min_size=1,
    max_size=6,
)


@given(PLANS, st.sampled_from(LEAST))
def test_of_the_plans_that_meet_the_one_that_takes_least_is_recommended(
    figures: list[tuple[float, float, float, int, float]], least: str
) -> None:
    """By brute force: what is saved within a thousandth, then propellant; half a degree may be left."""
    flown = {}
    for left, cost, end, pulses, low in figures:
        plan = judged("any", left, propellant=cost, impulse=cost, end=end, pulses=pulses, required=HALF_A_DEGREE)
        flown[plan] = FlownPlan(plan, None, cases=Cases(2_048, 1, 0.997, low, low, 1.0))
    compared = Comparison(next(iter(flown)).spacecraft, tuple(flown), flown, least=least)
    meeting = [plan for plan, each in flown.items() if plan.flown and each.cases.low >= 0.997 and plan.ends_well]
    assert (compared.verdict.status is Status.FLY) is bool(meeting)
    if meeting:
        measure = {"propellant": "propellant", "impulse": "total_impulse", "time": "end"}.get(least)
        spent = [len(plan) if measure is None else getattr(plan, measure) for plan in meeting]
        equal = [plan for plan, amount in zip(meeting, spent, strict=True) if amount <= min(spent) * 1.001]
        assert compared.recommended in equal
        cheapest = min(plan.pulses.cost for plan in equal)
        assert compared.verdict.schedule.cost <= cheapest * 1.001
