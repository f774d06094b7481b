"""Verdicts in words: which plan is recommended and why, what is not met, what stands in the way, how many cases comply.

The floors below give data; all sentences about them are here, so that every screen and page says the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from nutdamp import compliance, outcome, schemes
from nutdamp.compliance import Bound, Part
from nutdamp.flight import Flight
from nutdamp.planning import Comparison, Obstacle, Plan
from nutdamp.recommendation import Ground, Recommendation, Standing
from nutdamp.report.text import MISSING, degrees, duration, mass, moment, quantity
from nutdamp.spacecraft import Spacecraft

if TYPE_CHECKING:  # few runs look for a robust plan
    from nutdamp.robust import RobustComparison

VERDICT = {True: "met", False: "not met", None: MISSING}
"""What `Plan.meets_requirement` says of the requirement."""


def no_plan(plan: Plan) -> str:
    """What stands in the column of a scheme that has no plan."""
    if plan.failure is None:
        return "infeasible"
    return f"internal error,\nplease report:\n{type(plan.failure).__name__}"


def reason(compared: Comparison) -> str:
    """Why the recommended plan, or none."""
    found = compared.recommendation
    if found.plan is None:
        return "no scheme is feasible"
    body = compared.spacecraft
    if found.standing is Standing.COMPLIES:
        return _cheapest(found, _those(found, body))
    least = "leaves least nutation" if body.goal.axis is None else "comes nearest to the target"
    if found.standing is Standing.MEETS:
        return f"{least} of the plans that meet the requirement" if found.count > 1 else "the only one to meet it"
    if found.ground is Ground.ONLY:
        return "the only feasible plan"
    return f"{least} of the {found.count} feasible plans"


def _those(found: Recommendation[Plan], body: Spacecraft) -> str:
    """What the plans have in common among which the recommended one was chosen: the verb in the plural."""
    if compliance.required(body):
        return "meet the requirement" if found.count > 1 else "meets the requirement"
    what = "damp" if body.goal.axis is None else "reach the target"
    return what if found.count > 1 else {"damp": "damps", "reach the target": "reaches the target"}[what]


def _cheapest(found: Recommendation[Plan], those: str) -> str:
    """What decided among the plans that comply."""
    cost = "propellant" if found.by_propellant else "impulse"
    if found.ground is Ground.ONLY:
        return f"the only plan that {those}"
    among = f"of the {found.count} plans that {those}"
    if found.ground is Ground.COST:
        return f"least {cost} {among}"
    if found.ground is Ground.SHIFT:
        return f"least {cost} {among}, within 0.1 %; of these least shift of H"
    return f"least {cost} {among}, within 0.1 %; of these it ends first"


def warnings(compared: Comparison) -> tuple[str, ...]:
    """What the recommended plan does not reach, and what stands in the way; nothing for one that complies."""
    found = compared.recommendation
    if found.plan is None or found.standing is Standing.COMPLIES:
        return ()
    body = compared.spacecraft
    if found.standing is Standing.MISSES and compliance.required(body):
        head = "no plan meets the requirement"
    else:
        head = "no plan damps the nutation" if body.goal.axis is None else "no plan reaches the target"
    chosen = found.plan
    missed = "; ".join(shortfall(chosen, bound) for bound in chosen.shortfalls)
    return (" ".join((f"{head}. {chosen.scheme} leaves {missed}.", *_obstacles(chosen, compared))),)


def model_warnings(impulses: Flight, flown: Flight) -> tuple[str, ...]:
    """How far the impulse sum (17) ends from real widths, where that is more than may be."""
    apart = outcome.deviations(impulses, flown)
    if not apart:
        return ()
    required = {bound.part for bound in compliance.required(flown.spacecraft)}
    parts = []
    for one in apart:
        most = "a tenth of the requirement" if one.part in required else degrees(one.most)
        parts.append(f"{one} (more than {most})")
    return (f"the impulse sum (17) and real widths differ by {' and '.join(parts)}. What is flown counts.",)


def shortfall(plan: Plan, bound: Bound) -> str:
    """One thing that a plan misses: how much is left, and how much may be."""
    left = plan.left
    assert left is not None
    value = compliance.left_of(bound.part, left, plan.spacecraft)
    if bound.part is Part.SPIN:
        goal = plan.spacecraft.goal.spin or 0.0
        return f"the spin at {_rpm(left.spin)} ({_rpm(goal)} required)"
    what = {
        Part.NUTATION: "of nutation",
        Part.SHIFT: "of shift of H",
        Part.DISTANCE: "between H and the target",
    }[bound.part]
    allowed = "required" if bound.required else "would count as damped"
    return f"{degrees(value)} {what} ({degrees(bound.most)} {allowed})"


def _obstacles(plan: Plan, compared: Comparison) -> Iterator[str]:
    """What stands in the way of less, in sentences."""
    body, limits = plan.spacecraft, plan.spacecraft.limits
    parts = {bound.part for bound in plan.shortfalls}
    if Part.NUTATION in parts:
        yield {
            Obstacle.UNPLANNED_DISTURBANCES: "The plan was made without the disturbances; --with-disturbances plans "
            "with them.",
            Obstacle.STEADY_TILT: f"Under the disturbances a tilt of {degrees(plan.steady_tilt)} stays.",
            Obstacle.MAX_PULSES: f"limits.max_pulses = {limits.max_pulses} allows no more pulses.",
            Obstacle.RESOLUTION: "limits.tick and the shortest on-times allow no less.",
            Obstacle.LIMITS: _spent(plan),
        }[plan.obstacle]
    if Part.DISTANCE in parts and plan.scheme not in schemes.POINTING:
        yield f"{plan.scheme} does not turn H to a target; {', '.join(schemes.POINTING)} do."
    tried = {one.scheme for one in compared.plans}
    if "optimal" not in tried and body.channels and parts != {Part.SPIN} and not (_full(plan) and _to_the_end(plan)):
        yield "--scheme optimal was not compared; it may reach more."


def _spent(plan: Plan) -> str:
    """How much of what damping takes the pulses give, and what ends them."""
    body, pulses = plan.spacecraft, plan.pulses
    count = f"{len(pulses)} pulses give" if len(pulses) != 1 else "pulse gives"
    width = ", each as long as max_on_time allows" if _full(plan) else ""
    blackout = ", with blackout windows" if body.limits.blackout else ""
    return (
        f"Its {count} {quantity(pulses.total_impulse, 'N m s')}{width}; damping takes "
        f"{quantity(body.least_impulse, 'N m s')}. The last one ends at {moment(pulses.end)} of a horizon of "
        f"{duration(body.horizon)}{blackout}."
    )


def _full(plan: Plan) -> bool:
    """Whether every pulse is as long as its channel may be on."""
    longest = {channel.name: channel.max_on_time for channel in plan.spacecraft.channels}
    return all(pulse.on_time >= longest.get(pulse.channel, math.inf) * (1.0 - 1e-9) for pulse in plan.pulses)


def _to_the_end(plan: Plan) -> bool:
    """Whether less than one nutation period is left of the horizon after the last pulse."""
    body = plan.spacecraft
    period = body.body_period if math.isfinite(body.body_period) else body.inertial_period
    return body.horizon - plan.pulses.end < period


def hints(compared: Comparison) -> tuple[str, ...]:
    """What the reader may prefer: a plan that keeps H much better for little more."""
    found = compared.recommendation
    chosen, steadier = found.plan, found.steadier
    if chosen is None or steadier is None or chosen.flown is None or steadier.flown is None:
        return ()
    if found.by_propellant:
        more, less = steadier.pulses.propellant or 0.0, chosen.pulses.propellant or 0.0
        extra = f"{mass(more - less)} more propellant"
    else:
        more, less = steadier.pulses.total_impulse, chosen.pulses.total_impulse
        extra = f"{quantity(more - less, 'N m s')} more impulse"
    return (
        f"{steadier.scheme} shifts H by {degrees(steadier.flown.momentum_shift)} instead of "
        f"{degrees(chosen.flown.momentum_shift)}, for {extra} ({100.0 * (more / less - 1.0):.2g} %).",
    )


def spoken(compared: Comparison) -> dict[str, Any]:
    """The words of a comparison for JSON files."""
    return {
        "reason": reason(compared),
        "warnings": list(warnings(compared)),
        "hints": list(hints(compared)),
    }


def robust_reason(found: RobustComparison) -> str:
    """Why the robust plan, or none."""
    chosen, count = found.chosen, len(found.candidates)
    if chosen is None:
        return "no scheme is feasible"
    if chosen.met is None:
        level = exact_percent(found.probability)
        best = f"least {left_name(found.comparison.spacecraft)} in {level} of the cases, of {count} plans"
        as_good = f"{found.equals} leave about as little"
    else:
        best = f"most cases comply, of {count} plans"
        as_good = f"{found.equals} comply as often but for the sampling error"
    if count == 1:
        return "the only plan"
    cost = "propellant" if found.by_propellant else "impulse"
    then = {
        Ground.COST: f"least {cost}",
        Ground.SHIFT: f"least {cost} within 0.1 %, and least shift of H",
        Ground.END: f"least {cost} within 0.1 %, and first to end",
    }
    return best if found.ground not in then else f"{best}; {as_good}, of these {then[found.ground]}"


def robust_cost(found: RobustComparison) -> str:
    """The robust plan against the one that is recommended for nominal values."""
    chosen, usual, cost = found.chosen, found.usual, found.cost
    if chosen is None or usual is None or cost is None:
        return "There is nothing to compare it with."
    if chosen is usual:
        return "It is the plan that is recommended for nominal values too."
    if cost.propellant is None:
        spent = _more(cost.impulse, quantity(abs(cost.impulse), "N m s"), "impulse")
    else:
        spent = _more(cost.propellant, mass(abs(cost.propellant)), "propellant")
    when = "as early" if cost.end == 0.0 else f"{moment(abs(cost.end))} {'later' if cost.end > 0 else 'earlier'}"
    level = exact_percent(found.probability)
    what = left_name(found.comparison.spacecraft)
    gained = f"{degrees(chosen.left)} instead of {degrees(usual.left)} of {what} in {level} of the cases"
    if chosen.met is not None and usual.met is not None:
        shares = (percent(one.met or 0.0, found.probability) for one in (chosen, usual))
        gained = f"{' instead of '.join(shares)} of cases comply"
    return f"Against {usual.plan.scheme}, recommended for nominal values: {gained}; it takes {spent} and ends {when}."


def left_name(spacecraft: Spacecraft) -> str:
    """What a plan is to leave least of."""
    return "nutation" if spacecraft.goal.axis is None else "nutation or axis error"


def _more(difference: float, shown: str, what: str) -> str:
    if difference == 0.0:
        return f"as much {what}"
    return f"{shown} {'more' if difference > 0 else 'less'} {what}"


def required(spacecraft: Spacecraft) -> str:
    """What is required, on one line; empty where nothing is."""
    texts = []
    for bound in compliance.required(spacecraft):
        if bound.part is Part.SPIN:
            tolerance = 100.0 * compliance.SPIN_TOLERANCE
            texts.append(f"spin within {tolerance:g} % of {_rpm(spacecraft.goal.spin or 0.0)}")
        else:
            name = {Part.NUTATION: "nutation", Part.SHIFT: "shift of H", Part.DISTANCE: "axis error"}[bound.part]
            texts.append(f"{name} within {degrees(bound.most)}")
    return " and ".join(texts)


def cases_verdict(share: float, probability: float) -> str:
    """Whether enough cases comply: "met: 99.9 % of cases comply (99.7 % required)"."""
    verdict = "met" if share >= probability else "NOT met"
    return f"{verdict}: {percent(share, probability)} of cases comply ({exact_percent(probability)} required)"


def percent(share: float, *others: float) -> str:
    """A share in percent to one decimal; to more where it would be taken for one of the ``others``, or for all."""
    distinct = [other for other in (*others, 0.0, 1.0) if other != share]
    for digits in range(1, 12):
        text = f"{100.0 * share:.{digits}f}"
        if all(float(text) != float(f"{100.0 * other:.10g}") for other in distinct):
            return f"{text} %"
    return f"{100.0 * share:.12g} %"


def exact_percent(share: float) -> str:
    """A share that a file gives, in percent as it was written."""
    return f"{100.0 * share:.10g} %"


def _rpm(spin: float) -> str:
    return f"{spin * 30.0 / math.pi:.5g} rpm"
