"""Decisions on random spacecraft and plans: `plan` says what `disperse` says, and recommends what takes least."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from support.builders import HALF_A_DEGREE, judged
from support.cases import spread

import nutdamp
from nutdamp.planning.decision import Comparison, compare
from nutdamp.planning.screening import FlownPlan
from nutdamp.planning.verdict import Cases, Status
from nutdamp.schemes.catalogue import LEAST
from nutdamp.spacecraft.model import Spacecraft

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
    verdict, recommended = compared.verdict, compared.recommended
    assert recommended is not None
    for plan in compared:
        cases = compared.verdicts[plan].cases
        if cases is None:
            continue
        flown = nutdamp.disperse(plan, 4_000).verdict
        assert flown.cases is not None
        if plan is recommended:
            assert (verdict.status, verdict.lines, verdict.cases) == (flown.status, flown.lines, flown.cases)
        if cases.enough is not None:
            assert compared.verdicts[plan].status is flown.status, plan.scheme
        assert cases.low <= (flown.cases.complying or 0.0) <= cases.high
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
