"""What ``simulate --json`` gives."""

from __future__ import annotations

import math
from typing import Any

from nutdamp import __version__
from nutdamp.files.plan_json import final_json, pulses_json, residual_json, spacecraft_json, target_json
from nutdamp.flight import Flight, Residual
from nutdamp.physics.attitude import full_turn
from nutdamp.track import Extremes


def simulation_json(
    flight: Flight, found: Extremes, residual: Residual, flown: Residual, *, scheme: str
) -> dict[str, Any]:
    """Pulses with the cone angles around them, both residuals, and the extremes of the axis track in degrees."""
    attitude = flight.spacecraft.attitude
    return {
        "nutdamp": __version__,
        "spacecraft": spacecraft_json(flight.spacecraft),
        "scheme": scheme,
        "pulses": pulses_json(flight),
        "residual": residual_json(residual),
        "flown": residual_json(flown),
        "final": final_json(flight),
        "target": target_json(flight.spacecraft),
        "until_s": found.until,
        "axis_track": {
            "frame": "N" if attitude is None else attitude.frame,
            "farthest_from_momentum_deg": math.degrees(found.farthest[0]),
            "farthest_s": found.farthest[1],
            "nearest_to_momentum_deg": math.degrees(found.nearest[0]),
            "nearest_s": found.nearest[1],
            "x_deg": [math.degrees(value) for value in found.x],
            "y_deg": [math.degrees(value) for value in found.y],
            "right_ascension_deg": None if attitude is None else _turns(found.right_ascension),
            "declination_deg": None if attitude is None else [math.degrees(v) for v in found.declination],
        },
    }


def _turns(angles: tuple[float, float]) -> list[float]:
    """Western and eastern end of a range of right ascension in degrees from 0 to below 360, whatever lies between."""
    return [math.degrees(full_turn(angle)) for angle in angles]
