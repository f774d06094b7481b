"""Results of ``budget`` as CSV and JSON: a row for each pair of thresholds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from nutdamp.control_loop.budget import DAY, YEAR, Budget, HeldNutation
from nutdamp.files.tabular import csv_text, number, truth
from nutdamp.views.plan_json import heading

HEADER = (
    "start_deg",
    "stop_deg",
    "first_firing_s",
    "pulses_per_day",
    "cycles_per_day",
    "impulse_Nms_per_year",
    "propellant_kg_per_year",
    "sigma",
    "spin_change_rad_s_per_day",
    "nutation_low_deg",
    "nutation_high_deg",
    "nutation_largest_deg",
    "noise_deg",
    "smallest_pulse_deg",
    "tank_lasts_days",
)


def _numbers(held: HeldNutation) -> tuple[float | None, ...]:
    """The numbers of a row."""
    cycle, band = held.cycle, held.band
    numbers: tuple[float | None, ...] = (None,) * 9
    if cycle is not None:
        yearly = None if cycle.propellant is None else cycle.propellant * YEAR
        rates = (cycle.pulses * DAY, cycle.cycles * DAY, cycle.impulse * YEAR, yearly, cycle.doubt)
        numbers = (*rates, cycle.spin_rate * DAY, *map(math.degrees, (cycle.low, cycle.high, cycle.largest)))
    bounds = (None, None) if band is None else (math.degrees(band.noise), math.degrees(band.step))
    lasts = None if held.lasts is None else held.lasts / DAY
    return (*map(math.degrees, held.thresholds), held.begins, *numbers, *bounds, lasts)


def _other(held: HeldNutation) -> dict[str, float | None] | None:
    """The second limit cycle, where there is one."""
    if held.other is None:
        return None
    numbers = dict(zip(HEADER, _numbers(replace(held, cycle=held.other)), strict=True))
    return {name: numbers[name] for name in ("pulses_per_day", "cycles_per_day", "propellant_kg_per_year")}


def budget_csv(budget: Budget) -> str:
    """One row for each pair of thresholds; unknown values stay empty."""
    rows = ([*(number(value) for value in _numbers(row)), truth(row.meets_requirement), row.why] for row in budget.held)
    return csv_text((*HEADER, "meets_requirement", "why"), rows)


def budget_json(budget: Budget) -> dict[str, Any]:
    """Growth of the nutation, and every row."""
    body = budget.spacecraft
    return {
        **heading(body),
        "growth_1_s": body.growth,
        "largest_deg": None if budget.largest is None else math.degrees(budget.largest),
        "until_largest_s": budget.until_largest,
        "law": None if body.loop is None else body.loop.law,
        "meets_requirement": budget.meets_requirement,
        "thresholds": [
            dict(zip(HEADER, _numbers(row), strict=True))
            | {"meets_requirement": row.meets_requirement, "why": row.why or None, "other": _other(row)}
            for row in budget.held
        ],
    }
