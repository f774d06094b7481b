"""Schedules kept for the commands of one spacecraft: each command plans the same pulses anew, to the last digit."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

from nutdamp import schemes, work
from nutdamp.errors import NutdampError
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Spacecraft

NOT_PLANNED_WITH = ("source", "dispersions", "with_disturbances")
"""Fields that no scheme reads: disturbances are taken from the body before a scheme sees it."""


class Planner:
    """`schemes.schedule`, which plans a body, scheme and options once; the work counts every time."""

    def __init__(self) -> None:
        self.kept: dict[str, tuple[Schedule | NutdampError, float]] = {}
        self.calls = 0
        self.plain = schemes.schedule

    def schedule(self, name: str, spacecraft: Spacecraft, options: schemes.Choice = None) -> Schedule:
        """As `schemes.schedule`."""
        self.calls += 1
        key = json.dumps([name, type(options).__name__, options, spacecraft], default=_plain)
        if key not in self.kept:
            with work.budget("a schedule", math.inf) as spent:
                try:
                    made: Schedule | NutdampError = self.plain(name, spacecraft, options)
                except NutdampError as reason:
                    made = reason
            self.kept[key] = made, spent.done
        else:
            work.spend(self.kept[key][1])
        made = self.kept[key][0]
        if isinstance(made, NutdampError):
            raise made
        return made


def _plain(value: Any) -> Any:
    """Full precision for what JSON does not know: arrays by their numbers, objects by their fields."""
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value) if field.name not in NOT_PLANNED_WITH]
        return {name: getattr(value, name) for name in names}
    return value.tolist() if hasattr(value, "tolist") else repr(value)
