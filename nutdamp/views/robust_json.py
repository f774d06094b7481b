"""Part of ``plan --robust --json`` beside the plans."""

from __future__ import annotations

import math
from typing import Any

from nutdamp.planning.robust import RobustComparison
from nutdamp.planning.screening import PlanCandidate
from nutdamp.spacecraft.requirements import aim
from nutdamp.views.plan_json import final_json, plan_json, target_json


def robust_json(robust: RobustComparison, reason: str) -> dict[str, Any]:
    """The candidates from the best down, the one to fly with its pulses, and its cost against the usual one.

    ``reason``: that of the choice, in words.
    """
    chosen, usual = robust.chosen, robust.usual
    return {
        "probability": robust.probability,
        "samples": robust.samples,
        "seed": robust.seed,
        "target": target_json(robust.comparison.spacecraft),
        "candidates": [_candidate(candidate) for candidate in robust.candidates],
        "recommended": None if chosen is None else {**_candidate(chosen), "plan": plan_json(chosen.plan)},
        "reason": reason,
        "meets_requirement": robust.meets_requirement,
        "fresh": None
        if robust.fresh is None
        else {
            "samples": robust.fresh.cases.samples,
            "seed": robust.fresh.cases.seed,
            "met_fraction": robust.fresh.met,
            "interval": list(robust.fresh.interval),
        },
        "tightening": None
        if robust.tightening is None
        else {
            "factor": robust.tightening.factor,
            "tolerances": {
                entry.tolerance: {"sigma": entry.sigma, "needed": robust.tightening.factor * entry.sigma}
                for entry, _ in reversed(robust.tightening.inputs)
            },
            "inputs": [
                {
                    "name": entry.name,
                    entry.kind: entry.size,
                    "needed": robust.tightening.factor * entry.size,
                    "unit": entry.unit,
                }
                for entry, _ in robust.tightening.inputs
            ],
            "checked": {
                "samples": robust.tightening.cases,
                "seed": robust.tightening.seed,
                "met_fraction": robust.tightening.complied,
                "at_least": robust.tightening.least,
            },
        },
        "against": None if usual is None else _candidate(usual),
        "cost": None
        if robust.cost is None
        else {
            "propellant_kg": robust.cost.propellant,
            "total_impulse_Nms": robust.cost.impulse,
            "end_s": robust.cost.end,
            "nutation_deg": math.degrees(robust.cost.nutation),
        },
    }


def _candidate(candidate: PlanCandidate) -> dict[str, Any]:
    plan, pulses = candidate.plan, candidate.plan.pulses
    return {
        "scheme": plan.scheme,
        "variant": candidate.variant,
        "pulses": len(pulses),
        "end_s": pulses.end,
        "total_impulse_Nms": pulses.total_impulse,
        "propellant_kg": pulses.propellant,
        "nominal_nutation_deg": None if plan.flown is None else math.degrees(plan.flown.nutation),
        "nutation_deg": math.degrees(candidate.nutation),
        aim(plan.spacecraft).value + "_deg": math.degrees(candidate.off),
        "samples": candidate.cases.samples,
        "met_fraction": candidate.met,
        "final": final_json(plan.flight),
    }
