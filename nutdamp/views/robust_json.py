"""What ``plan --robust --json`` adds to the plans."""

from __future__ import annotations

import math
from typing import Any

from nutdamp.planning.robust import RobustComparison
from nutdamp.planning.screening import PlanCandidate
from nutdamp.spacecraft.requirements import aim
from nutdamp.views.plan_json import final_json, plan_json, target_json


def robust_json(found: RobustComparison, reason: str) -> dict[str, Any]:
    """The candidates from the best down, the one to fly with its pulses, and what it costs against the usual one.

    ``reason``: why that one, in words.
    """
    chosen, usual = found.chosen, found.usual
    return {
        "probability": found.probability,
        "samples": found.samples,
        "seed": found.seed,
        "target": target_json(found.comparison.spacecraft),
        "candidates": [_candidate(one) for one in found.candidates],
        "recommended": None if chosen is None else {**_candidate(chosen), "plan": plan_json(chosen.plan)},
        "reason": reason,
        "meets_requirement": found.meets_requirement,
        "fresh": None
        if found.fresh is None
        else {
            "samples": found.fresh.cases.samples,
            "seed": found.fresh.cases.seed,
            "met_fraction": found.fresh.met,
            "interval": list(found.fresh.interval),
        },
        "tightening": None
        if found.tightening is None
        else {
            "factor": found.tightening.factor,
            "tolerances": {
                one.tolerance: {"sigma": one.sigma, "needed": found.tightening.factor * one.sigma}
                for one, _ in reversed(found.tightening.inputs)
            },
            "inputs": [
                {"name": one.name, one.kind: one.size, "needed": found.tightening.factor * one.size, "unit": one.unit}
                for one, _ in found.tightening.inputs
            ],
            "checked": {
                "samples": found.tightening.cases,
                "seed": found.tightening.seed,
                "met_fraction": found.tightening.complied,
                "at_least": found.tightening.least,
            },
        },
        "against": None if usual is None else _candidate(usual),
        "cost": None
        if found.cost is None
        else {
            "propellant_kg": found.cost.propellant,
            "total_impulse_Nms": found.cost.impulse,
            "end_s": found.cost.end,
            "nutation_deg": math.degrees(found.cost.nutation),
        },
    }


def _candidate(one: PlanCandidate) -> dict[str, Any]:
    plan, pulses = one.plan, one.plan.pulses
    return {
        "scheme": plan.scheme,
        "variant": one.variant,
        "pulses": len(pulses),
        "end_s": pulses.end,
        "total_impulse_Nms": pulses.total_impulse,
        "propellant_kg": pulses.propellant,
        "nominal_nutation_deg": None if plan.flown is None else math.degrees(plan.flown.nutation),
        "nutation_deg": math.degrees(one.nutation),
        aim(plan.spacecraft).value + "_deg": math.degrees(one.off),
        "samples": one.cases.samples,
        "met_fraction": one.met,
        "final": final_json(plan.flight),
    }
