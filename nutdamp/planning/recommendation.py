"""Recommendation among plans, by flown residuals and cost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

from nutdamp.planning.plan import Plan, Share, Standing
from nutdamp.spacecraft.requirements import DAMPED_ANGLE, NEGLIGIBLE, SAME_COST, Part, missed, required

STEADIER_SHIFT = 0.2  # share of the recommended plan's momentum shift below which another plan keeps H much better
FEWER_PULSES = 0.5  # share of its pulses up to which another plan is much simpler
SOONER_END = 0.5  # share of its end up to which another one, a nutation period earlier at least, is much sooner
STEADIER_COST = 1.1  # largest cost ratio at which a smaller momentum shift is worth a note
FEWER_COST = 1.05  # largest cost ratio at which fewer pulses are
SOONER_COST = 1.05  # largest cost ratio at which an earlier end is
REAL_COST = 1.1  # largest cost ratio of a plan with real widths beside one of ideal impulses that is worth a note

SAME_ANGLE, SAME_SPEED = 1e-9, 1e-5
"""rad and m/s by which shifts of H and ΔV may differ and be equal: the rounding of a flight."""


class Ground(Enum):
    """Deciding ground among the plans of one standing."""

    ONLY = "only"
    CASES = "cases"
    """Most cases comply, where too few do with each plan."""
    LEFT = "left"
    NEAREST = "nearest"
    COST = "cost"
    NOMINAL = "tie-nominal"
    PULSES = "tie-pulses"
    DELTA_V = "tie-delta-v"
    SHIFT = "tie-shift"
    END = "tie-end"


TIES = (Ground.NOMINAL, Ground.PULSES, Ground.DELTA_V, Ground.SHIFT, Ground.END)
"""Grounds among plans of equal cost; the value of each is the code of its note."""


class Gain(Enum):
    """Advantage of another plan over the recommended one, by the code of its note."""

    STEADIER = "smaller-shift"
    SIMPLER = "fewer-pulses"
    SOONER = "ends-sooner"
    REAL = "real-widths"
    COMMANDED = "as-blocks"


@dataclass(frozen=True, eq=False)
class Recommendation:
    """Recommended plan of the ``count`` of its ``standing``, by propellant or by impulse; None where none is feasible.

    ``alternatives``: the cheapest plan that gains so much.
    """

    plan: Plan | None = None
    standing: Standing | None = None
    ground: Ground | None = None
    count: int = 0
    by_propellant: bool = True
    alternatives: Mapping[Gain, Plan] = field(default_factory=dict)


def recommend(plans: Sequence[Plan], shares: Mapping[Plan, Share] | None = None) -> Recommendation:
    """Recommendation: of the plans that meet the requirement, and damp where it bounds nothing, the `cheapest`.

    Where there is none, that with least nutation left (least distance from a target axis where that is more). Of plans
    that reach as much those that keep all cones count alone. With ``shares`` a plan meets the requirement in enough
    dispersed cases or not at all; where none does, it is that with which most comply.
    """
    feasible = [plan for plan in plans if plan.flown is not None]
    if not feasible:
        return Recommendation()
    reached = {plan: plan.standing if not shares or shares[plan].met else Standing.MISSES for plan in feasible}
    standing = next(standing for standing in Standing if standing in reached.values())
    those = [plan for plan in feasible if reached[plan] is standing]
    those = [plan for plan in those if plan.kept is not False] or those
    if standing is Standing.COMPLIES:
        best, ground = cheapest(those)
        return Recommendation(best, standing, ground, len(those), by_propellant(those), _alternatives(best, those))
    most = max(shares[plan].low for plan in those) if shares else 0.0
    if shares and standing is Standing.MISSES and most > 0.0 and len(those) > 1:
        best, _ = cheapest([plan for plan in those if shares[plan].low >= most])
        return Recommendation(best, standing, Ground.CASES, len(those), by_propellant(those))
    best, ground = nearest(those)
    return Recommendation(best, standing, ground, len(those), by_propellant(those))


def cheapest(plans: Sequence[Plan], usual: Plan | None = None) -> tuple[Plan, Ground]:
    """Plan of least propellant (impulse where one is unknown), and the deciding ground.

    Of costs within `SAME_COST` the ``usual`` one, else that with fewer pulses, less ΔV, less momentum shift (distance
    from the target axis), the earlier end; the first of these that leaves one decides.
    """
    if len(plans) == 1:
        return plans[0], Ground.ONLY
    unit = _unit(plans)
    least = min(plan.pulses.cost_in(unit) for plan in plans)
    equal = [plan for plan in plans if plan.pulses.cost_in(unit) <= least * (1.0 + SAME_COST)]
    if len(equal) == 1:
        return equal[0], Ground.COST
    if usual is not None and any(plan is usual for plan in equal):
        return usual, Ground.NOMINAL
    for ground, measure, same in (
        (Ground.PULSES, lambda plan: float(len(plan.pulses)), 0.0),
        (Ground.DELTA_V, _speed, SAME_SPEED),
        (Ground.SHIFT, _off, SAME_ANGLE),
    ):
        values = [value for plan in equal if (value := measure(plan)) is not None]
        if len(values) < len(equal):  # not known of all
            continue
        least = min(values) + same
        equal = [plan for plan, value in zip(equal, values, strict=True) if value <= least]
        if len(equal) == 1:
            return equal[0], ground
    return min(equal, key=lambda plan: plan.pulses.end), Ground.END


def nearest(plans: Sequence[Plan]) -> tuple[Plan, Ground]:
    """Plan of least residual but for `DAMPED_ANGLE`, nearest to the requirement, then `cheapest`; deciding ground."""
    if len(plans) == 1:
        return plans[0], Ground.ONLY
    least = min(map(_missed, plans))
    as_little = [plan for plan in plans if _missed(plan) <= least + DAMPED_ANGLE]
    if len(as_little) == 1:
        return as_little[0], Ground.LEFT
    body = as_little[0].spacecraft
    least = min(plan.severity for plan in as_little)
    rounding = NEGLIGIBLE / min((bound.most for bound in required(body) if bound.part is not Part.SPIN), default=1.0)
    near = [plan for plan in as_little if plan.severity <= least * (1.0 + SAME_COST) + rounding]
    return (near[0], Ground.NEAREST) if len(near) == 1 else cheapest(near)


def _alternatives(best: Plan, plans: Sequence[Plan]) -> dict[Gain, Plan]:
    """Cheapest of the ``plans`` with each gain on the ``best`` for little more; of command blocks at any cost."""
    unit, body = _unit(plans), best.spacecraft
    turned = 0.0 if body.goal.axis is not None or _off(best) <= DAMPED_ANGLE else STEADIER_SHIFT * _off(best)
    few = FEWER_PULSES * len(best.pulses)
    soon = min(SOONER_END * best.pulses.end, best.pulses.end - body.inertial_period)
    gains_of: dict[Gain, Plan] = {}
    for gain, ratio, gains in (
        (Gain.STEADIER, STEADIER_COST, lambda plan: _off(plan) < turned),
        (Gain.SIMPLER, FEWER_COST, lambda plan: len(plan.pulses) <= few),
        (Gain.SOONER, SOONER_COST, lambda plan: plan.pulses.end <= soon),
        (Gain.REAL, REAL_COST, lambda plan: best.pulses.idealised and not plan.pulses.idealised),
        (Gain.COMMANDED, math.inf, lambda plan: bool(plan.pulses.blocks) and not best.pulses.blocks),
    ):
        most = ratio * best.pulses.cost_in(unit)
        those = [plan for plan in plans if len(plan.pulses) and gains(plan) and plan.pulses.cost_in(unit) <= most]
        if those:
            gains_of[gain] = min(those, key=lambda plan: plan.pulses.cost_in(unit))
    return gains_of


def by_propellant(plans: Sequence[Plan]) -> bool:
    """True if propellant is known for all plans, which are compared by it; else by impulse."""
    return all(plan.pulses.propellant is not None for plan in plans)


def _unit(plans: Sequence[Plan]) -> str:
    return "kg" if by_propellant(plans) else "N m s"


def _speed(plan: Plan) -> float | None:
    """|ΔV| in m/s; None where unknown."""
    return None if plan.delta_v is None else math.hypot(*plan.delta_v.tolist())


def _off(plan: Plan) -> float:
    assert plan.flown is not None
    return plan.flown.axis_error


def _missed(plan: Plan) -> float:
    assert plan.flown is not None
    return float(missed(plan.spacecraft, plan.flown.nutation, plan.flown.axis_error))
