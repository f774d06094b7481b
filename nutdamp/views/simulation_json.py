"""Result of ``simulate --json``."""

from __future__ import annotations

import math
from typing import Any

from nutdamp.flight import end_state
from nutdamp.flight.end_state import aspects
from nutdamp.physics.attitude import full_turn
from nutdamp.planning.decision import Simulation
from nutdamp.views.decision_json import decision_json
from nutdamp.views.plan_json import aspects_json, final_json, heading, residual_json, target_json
from nutdamp.views.pulses import pulse_table


def simulation_json(simulation: Simulation, verdict: str) -> dict[str, Any]:
    """Pulses with the cone angles around them, ends of both models, and extremes of the axis track in degrees."""
    flight, extremes, impulses, flown = simulation.shown, simulation.extremes, simulation.impulses, simulation.flown
    attitude = flight.spacecraft.attitude
    return {
        **heading(flight.spacecraft),
        "scheme": simulation.plan.scheme,
        "propagated": "flown" if simulation.real else "residual",
        "pulses": pulse_table(flight).json("flown"),
        "residual": residual_json(impulses.residual),
        "flown": residual_json(flown.residual),
        "final": final_json(flown),
        "final_by_impulses": final_json(impulses),
        "differ": [bound.part.value for bound in end_state.deviations(impulses, flown)],
        "target": target_json(flight.spacecraft),
        **aspects_json(aspects(flight, extremes.until)),
        "decision": decision_json(simulation.decision, verdict),
        "until_s": extremes.until,
        "axis_track": {
            "frame": "N" if attitude is None else attitude.frame,
            "farthest_from_momentum_deg": math.degrees(extremes.farthest[0]),
            "farthest_s": extremes.farthest[1],
            "nearest_to_momentum_deg": math.degrees(extremes.nearest[0]),
            "nearest_s": extremes.nearest[1],
            "x_deg": [math.degrees(value) for value in extremes.x],
            "y_deg": [math.degrees(value) for value in extremes.y],
            "right_ascension_deg": None if attitude is None else _turns(extremes.right_ascension),
            "declination_deg": None if attitude is None else [math.degrees(v) for v in extremes.declination],
        },
    }


def _turns(angles: tuple[float, float]) -> list[float]:
    """Western and eastern end of a range of right ascension in degrees from 0 to below 360, for any range between."""
    return [math.degrees(full_turn(angle)) for angle in angles]
