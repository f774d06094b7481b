"""What ``check --json`` gives: faults, or derived quantities, of each file."""

from __future__ import annotations

import math
from typing import Any

from nutdamp import __version__, survey
from nutdamp.errors import CannotRead, FaultyFile
from nutdamp.files.plan_json import spacecraft_json
from nutdamp.spacecraft import Spacecraft


def check_json(reports: list[dict[str, Any]]) -> dict[str, Any]:
    """All files."""
    return {"nutdamp": __version__, "files": reports}


def failed_json(name: str | None, wrong: FaultyFile | CannotRead) -> dict[str, Any]:
    """A file that could not be read or says something that cannot be."""
    if isinstance(wrong, CannotRead):
        faults: list[dict[str, Any]] = [{"line": None, "column": None, "where": "", "problem": wrong.reason}]
    else:
        faults = [
            {"line": fault.line, "column": fault.column, "where": fault.where, "problem": fault.problem}
            for fault in wrong.faults
        ]
    return {"file": name, "valid": False, "faults": faults, "spacecraft": None, "channels": [], "two_pulse": None}


def checked_json(name: str | None, spacecraft: Spacecraft) -> dict[str, Any]:
    """A valid file: derived quantities, channels with their steps, the mounting angle for two pulses."""
    axes = spacecraft.inertia.axes
    pair = survey.nearest_pair(spacecraft)
    return {
        "file": name,
        "valid": True,
        "faults": [],
        "spacecraft": spacecraft_json(spacecraft),
        "channels": [
            {
                "name": steps.channel.name,
                "torque_Nm": (axes @ steps.channel.torque).tolist(),
                "min_on_time_s": steps.channel.min_on_time,
                "max_on_time_s": steps.channel.max_on_time,
                "smallest_step_deg": math.degrees(steps.smallest),
                "largest_step_deg": math.degrees(steps.largest),
                "damps": steps.channel.damps,
            }
            for steps in survey.channel_steps(spacecraft)
        ],
        "two_pulse": {
            "mounting_angle_deg": math.degrees(survey.mounting_angle(spacecraft)),
            "nearest": None if pair is None else [pair.first.name, pair.second.name],
            "nearest_off_deg": None if pair is None else abs(math.degrees(pair.miss)),
        },
    }
