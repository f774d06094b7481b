"""Result of ``verify --json``."""

from __future__ import annotations

import math
from typing import Any

from nutdamp.flight.propagation import Flight
from nutdamp.flight.verification import Verification
from nutdamp.views.plan_json import final_json, heading, target_json


def verification_json(flown: Flight, name: str, verification: Verification) -> dict[str, Any]:
    """Methods with their differences from the motion of ``flown`` (rad), conservation, error budget."""
    spacecraft = flown.spacecraft
    return {
        **heading(spacecraft),
        "scheme": name,
        "agree": verification.agree if verification.checks else None,
        "disagreeing": list(verification.disagreeing),
        "final": final_json(flown),
        "target": target_json(spacecraft),
        "methods": [
            {
                "name": method.name,
                "nutation_deg": _degrees(method.nutation),
                "momentum_shift_deg": _degrees(method.momentum_shift),
                "axis_difference_rad": method.axis,
                "momentum_difference_rad": method.momentum,
                "rate_difference": method.rate,
                "missing": method.missing or None,
            }
            for method in verification.methods
        ],
        "momentum_drift": verification.momentum.drift,
        "momentum_kept": verification.momentum.kept,
        "energy_drift": verification.energy.drift,
        "energy_kept": verification.energy.kept,
        "budget": [
            {
                "imperfection": row.name,
                "nutation_deg": math.degrees(row.nutation),
                "momentum_shift_deg": math.degrees(row.momentum_shift),
                "axis_error_deg": math.degrees(row.axis_error),
            }
            for row in verification.budget
        ],
    }


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)
