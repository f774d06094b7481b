"""Decision on a plan as a JSON-ready dictionary: angles in degrees, the spin error in rad/s."""

from __future__ import annotations

import math
from typing import Any

from nutdamp.planning.decision import Decision, Line
from nutdamp.spacecraft.requirements import Part
from nutdamp.views.plan_json import aspects_json, final_json


def decision_json(decision: Decision, verdict: str) -> dict[str, Any]:
    """The plan, whether it ``met`` the requirement and the ``verdict`` in words, part by part with margins, its end.

    ``cases`` is null where none were flown.
    """
    plan, cases, pulses = decision.plan, decision.cases, decision.flight.schedule
    return {
        "scheme": plan.scheme,
        "met": decision.met,
        "verdict": verdict,
        "requirement": [_line(line) for line in decision.lines],
        "cases": None
        if cases is None
        else {
            "samples": cases.samples,
            "seed": cases.seed,
            "met_fraction": cases.complying,
            "probability": cases.probability,
            "met": cases.met,
        },
        "final": final_json(decision.flight),
        **aspects_json(decision.aspects),
        "propellant_kg": pulses.propellant,
        "total_impulse_Nms": pulses.total_impulse,
        "end_s": pulses.end,
    }


def _line(line: Line) -> dict[str, Any]:
    """A part: its limit, its residual with nominal values and in the share of cases required, and the margin."""
    unit, scale = ("rad_s", 1.0) if line.bound.part is Part.SPIN else ("deg", 180.0 / math.pi)
    return {
        "part": line.bound.part.value,
        "required": line.bound.required,
        f"limit_{unit}": scale * line.bound.most,
        f"nominal_{unit}": scale * line.nominal,
        f"dispersed_{unit}": None if line.dispersed is None else scale * line.dispersed,
        f"margin_{unit}": scale * line.margin,
        "met": line.met,
    }
