"""Fronts of ``trade`` as CSV and JSON, and their schedules as files of pulses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from nutdamp.files.tabular import csv_text, number, truth
from nutdamp.planning.tradeoff import Front, Point, numbered
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views.plan_json import heading, plan_json
from nutdamp.views.pulses import pulse_table

HEADER = (
    "point",
    "shift_allowed_deg",
    "end_s",
    "pulses",
    "propellant_kg",
    "total_impulse_Nms",
    "first_order_least",
    "least_unit",
    "nutation_deg",
    "momentum_shift_deg",
    "axis_error_deg",
    "scheme",
    "meets_requirement",
)


def trade_csv(fronts: Sequence[Front]) -> str:
    """One row a point; a shift allowed of any size is empty."""
    return csv_text(HEADER, (_row(index, front, point) for index, front, point in numbered(fronts)))


def _row(index: int, front: Front, point: Point) -> list[str]:
    plan, left = point.plan, point.plan.flight.residual
    return [
        str(index),
        number(math.degrees(front.shift)),
        number(plan.pulses.end),
        str(len(plan.pulses)),
        number(plan.pulses.propellant),
        number(plan.pulses.total_impulse),
        number(front.least(point)),
        point.unit,
        *(number(math.degrees(angle)) for angle in (left.nutation, left.momentum_shift, left.axis_error)),
        plan.scheme,
        truth(plan.meets_requirement),
    ]


def trade_json(spacecraft: Spacecraft, fronts: Sequence[Front]) -> dict[str, Any]:
    """All fronts with their plans, in the form of ``plan --json``."""
    numbers: dict[int, list[dict[str, Any]]] = {id(front): [] for front in fronts}
    for index, front, point in numbered(fronts):
        numbers[id(front)].append({"point": index, "horizon_s": point.horizon, **plan_json(point.plan)})
    return {
        **heading(spacecraft),
        "fronts": [
            {"shift_allowed_deg": math.degrees(front.shift), "why": front.why, "points": numbers[id(front)]}
            for front in fronts
        ],
    }


def schedule_files(fronts: Sequence[Front], folder: str) -> list[tuple[str, str]]:
    """The pulses of every point: (path in ``folder``, contents)."""
    points = list(numbered(fronts))
    paths = schedule_paths(folder, len(points))
    return [(path, pulse_table(point.plan.flight).csv()) for path, (_, _, point) in zip(paths, points, strict=True)]


def schedule_paths(folder: str, count: int) -> list[str]:
    """Paths of the files of pulses of ``count`` points."""
    return [str(Path(folder) / f"point-{index}.csv") for index in range(1, count + 1)]
