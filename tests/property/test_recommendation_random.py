"""Random spacecraft with weak, strong, few and many thrusters: no plan beats the recommended one in all that counts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.builders import Outcome, aimed, channel, spinner

from nutdamp.comparison import Comparison, compare, usual
from nutdamp.planning import Plan
from nutdamp.presentation import verdicts
from nutdamp.recommendation import Standing
from nutdamp.schemes import Options
from nutdamp.spacecraft import Channel, Limits, Requirement, Spacecraft, Steerable

COUNT = 300
SLOW = {"optimal"}
"""Left out: it takes most of the time, and the rule does not know schemes by name."""


WITH_OPTIMAL = (7, 8, 15, 19, 28, 34, 45, 54, 58, 67, 71, 80, 88, 91, 98)
"""Those with few channels, and without ticks, that it plans in a moment."""


def thrusters(rng: np.random.Generator, needed: float, period: float) -> tuple[Channel, ...]:
    """One to a dozen, each of whose pulses does between a thousandth and all of what is ``needed`` (N m s)."""
    count = int(rng.choice([1, 2, 3, 4, 6, 12]))
    torque = needed / period * 10.0 ** rng.uniform(-2.5, 1.5)
    longest = period * 10.0 ** rng.uniform(-1.5, 0.0) if rng.random() < 0.7 else math.inf
    shortest = 0.02 * longest if math.isfinite(longest) and rng.random() < 0.5 else 0.0
    priced = rng.random() < 0.7
    first = rng.uniform(0.0, 2.0 * math.pi)
    made = []
    for index in range(count):
        angle = first + 2.0 * math.pi * index / count + rng.normal() * 0.05
        axial = 0.05 * torque * rng.normal() if rng.random() < 0.3 else 0.0
        made.append(
            channel(
                f"T{index}",
                torque * math.cos(angle),
                torque * math.sin(angle),
                axial,
                min_on_time=shortest,
                max_on_time=longest,
                isp=float(rng.choice([220.0, 70.0])) if priced else None,
                thrust=torque if priced else None,
            )
        )
    return tuple(made)


def draw(number: int) -> Spacecraft:
    rng = np.random.default_rng([2024, number])
    A = 10.0 ** rng.uniform(0.5, 3.5)
    C = A * float(rng.choice([rng.uniform(0.3, 0.95), rng.uniform(1.05, 1.9), 0.8, 4.0 / 3.0]))
    spin = float(rng.choice([-1.0, 1.0])) * 10.0 ** rng.uniform(-0.5, 1.0)
    degrees = float(rng.choice([0.02, rng.uniform(0.1, 5.0), rng.uniform(5.0, 50.0)]))
    spread = 0.02 * abs(A - C) if rng.random() < 0.1 else 0.0
    body = spinner(A, C, spin, degrees, rng.uniform(0.0, 6.0), moments=(A + spread, A - spread, C))
    period = body.body_period
    limits = Limits(
        horizon=period * float(rng.choice([0.5, 3.0, 20.0])) if rng.random() < 0.7 else None,
        gap=0.05 * period if rng.random() < 0.2 else 0.0,
        tick=1e-3 * period if rng.random() < 0.15 else None,
        max_pulses=int(rng.integers(1, 9)) if rng.random() < 0.2 else None,
    )
    requested = None
    if rng.random() < 0.5:
        nutation = math.radians(degrees * 10.0 ** rng.uniform(-3.0, -0.3)) if rng.random() < 0.85 else None
        shift = math.radians(degrees * 10.0 ** rng.uniform(-2.0, 0.0)) if rng.random() < 0.5 or not nutation else None
        requested = Requirement(nutation, shift)
    body = replace(body, limits=limits, requirement=requested)
    if rng.random() < 0.1:
        body = replace(
            body, steerable=Steerable(body.least_impulse / period * 10.0 ** rng.uniform(-1.0, 1.0), 220.0, 1.0)
        )
    else:
        body = replace(body, channels=thrusters(rng, body.least_impulse, period))
    return aimed(body, rng.uniform(1.0, 30.0), rng.uniform(0.0, 360.0)) if rng.random() < 0.1 else body


def planned(body: Spacecraft) -> Comparison:
    return compare(body, [name for name in usual(body) if name not in SLOW], Options())


def cost(plan: Plan, others: tuple[Plan, ...]) -> float:
    """Propellant in kg where all know it, else impulse in N m s."""
    known = [plan.pulses.propellant, *(one.pulses.propellant for one in others)]
    return plan.pulses.total_impulse if None in known else known[0] or 0.0


def beaten(chosen: Plan, other: Plan, others: tuple[Plan, ...]) -> bool:
    """Whether ``other`` leaves no more of anything and costs less, by more than counts as equal."""
    assert chosen.flown is not None
    assert other.flown is not None
    no_more = other.flown.nutation <= chosen.flown.nutation and other.flown.axis_error <= chosen.flown.axis_error
    return no_more and cost(other, others) < cost(chosen, others) * (1.0 - 1e-3)


def complies(body: Spacecraft, nutation: float, distance: float) -> bool:
    """The rule, written down again: the requirement, and what counts as damped where it says nothing."""
    requested = body.requirement or Requirement()
    least = math.radians(1e-3)
    most = requested.nutation if requested.nutation is not None else max(0.01 * body.nutation, least)
    far = requested.momentum_shift
    if far is None:
        far = math.inf if body.goal.axis is None else max(0.01 * body.to_turn, least)
    return nutation <= most and distance <= far


def left(plan: Plan) -> float:
    """Nutation, or the distance from a target axis where that is more, rad."""
    assert plan.flown is not None
    target = plan.spacecraft.goal.axis
    return plan.flown.nutation if target is None else max(plan.flown.nutation, plan.flown.axis_error)


def standing(number: int, compared: Comparison) -> Standing | None:
    """What the recommended plan reaches, once it is seen that none beats it and that what is said of it is so."""
    body = compared.spacecraft
    assert not compared.failed, (number, [one.failure for one in compared.failed])
    feasible = tuple(one for one in compared.plans if one.flown is not None)
    chosen, warnings = compared.recommended, verdicts.warnings(compared)
    if chosen is None or chosen.flown is None:
        assert not feasible
        return None
    for other in feasible:
        assert not beaten(chosen, other, feasible), (number, chosen.scheme, other.scheme)
    good = [one for one in feasible if one.flown and complies(body, one.flown.nutation, one.flown.axis_error)]
    assert (chosen in good) == bool(good), number
    assert bool(warnings) == (not good), number
    aim = 0.0 if body.goal.axis is None else body.to_turn
    assert (verdicts.needless(compared) is not None) == complies(body, body.nutation, aim), number
    if good:
        least = min(cost(one, tuple(good)) for one in good)
        assert cost(chosen, tuple(good)) <= 1.001 * least
        return chosen.standing
    those = [one for one in feasible if one.standing is chosen.standing]
    assert left(chosen) <= min(map(left, those)) + math.radians(1e-3), number
    (text,) = warnings
    assert text.startswith(f"none of the {len(compared.plans)} schemes compared ")
    nutation = f"{math.degrees(chosen.flown.nutation):.4g} deg of nutation"
    assert any(said in text for said in (nutation, "of error of H", "of shift of H"))
    untried = body.channels and all(one.scheme != "optimal" for one in compared.plans)
    assert ("--scheme optimal was not compared" in text) == bool(untried), number
    return chosen.standing


@pytest.mark.weekly
def test_nothing_beats_what_is_recommended() -> None:
    found = [standing(number, planned(draw(number))) for number in range(COUNT)]
    # Each kind of outcome is there, and often.
    assert found.count(Standing.COMPLIES) > COUNT // 5
    assert found.count(Standing.MISSES) > COUNT // 5
    assert found.count(None) < COUNT // 3


@pytest.mark.weekly
@pytest.mark.parametrize("number", WITH_OPTIMAL)
def test_nor_where_optimal_is_compared_too(number: int) -> None:
    body = draw(number)
    compared = compare(body, tuple(dict.fromkeys((*usual(body), "optimal"))))
    assert standing(number, compared) is not None


@pytest.mark.weekly
def test_what_is_said_of_the_recommended_plan_is_so() -> None:
    """Its residuals by an integrator that shares nothing with the flights here."""
    checked = 0
    for number in range(0, COUNT, 7):
        body = draw(number)
        chosen = planned(body).recommended
        if chosen is None or body.goal.axis is not None or len(chosen.pulses) > 30:
            continue
        outcome = Outcome(body, chosen.pulses)
        near = 1e-8
        if complies(body, outcome.nutation * (1 + near) + near, outcome.shift * (1 + near) + near):
            assert chosen.standing is Standing.COMPLIES
        if chosen.standing is Standing.COMPLIES:
            assert complies(body, outcome.nutation * (1 - near) - near, outcome.shift * (1 - near) - near)
        checked += 1
    assert checked > 20
