"""Schedules kept from test to test: the same spacecraft has the same pulses."""

import dataclasses
import json
import math
from importlib import import_module
from typing import Any
from unittest.mock import patch

from nutdamp.common import work
from nutdamp.errors import NutdampError
from nutdamp.planning import plan as planning
from nutdamp.schemes import catalogue, planner
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule

NOT_PLANNED_WITH = ("source", "dispersions", "with_disturbances")
"""Fields that no scheme reads: disturbances are taken from the body before a scheme sees it."""


class Planner:
    """`schemes.schedule`, which searches once for each scheme, body and options, and counts the
    work every time.

    What a budget of work has cut, or would cut, is planned anew, and so is a scheme whose module a
    test has changed.
    """

    def __init__(self) -> None:
        self.kept: dict[str, tuple[Schedule | NutdampError, float]] = {}
        self.calls = 0
        self.plain = planner.schedule

    def __call__(
        self, spacecraft: Spacecraft, name: str, options: planner.Choice = None
    ) -> planning.Plan:
        """The plan of a scheme, judged as `nutdamp.planning.plan.plan` does."""
        with patch.object(planner, "schedule", self.schedule):
            return planning.plan(spacecraft, name, options)

    def schedule(
        self, name: str, spacecraft: Spacecraft, options: planner.Choice = None
    ) -> Schedule:
        """As `schemes.schedule`."""
        self.calls += 1
        code = (
            id(import_module(catalogue.SCHEMES[name].module).schedule)
            if catalogue.SCHEMES[name].fires
            else 0
        )
        key = json.dumps([name, code, type(options).__name__, options, spacecraft], default=_plain)
        with work.budget("a schedule", math.inf) as spent:
            made, units = self.kept.get(key, (None, math.inf))
            if made is None or units >= spent.most:
                try:
                    made = self.plain(name, spacecraft, options)
                except NutdampError as reason:
                    made = reason
                if not spent.exhausted:
                    self.kept[key] = made, spent.done
            else:
                work.spend(units)
        if isinstance(made, NutdampError):
            raise made
        return made


def _plain(value: Any) -> Any:
    """What JSON does not know, in full precision: arrays as numbers, objects as fields."""
    if dataclasses.is_dataclass(value):
        names = [
            field.name for field in dataclasses.fields(value) if field.name not in NOT_PLANNED_WITH
        ]
        return {name: getattr(value, name) for name in names}
    return value.tolist() if hasattr(value, "tolist") else repr(value)
