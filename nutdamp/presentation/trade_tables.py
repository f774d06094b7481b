"""The screen of ``trade``: one table of schedules for each front."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.fronts import Front, numbered
from nutdamp.presentation.layout import columns
from nutdamp.presentation.plan_tables import header
from nutdamp.presentation.text import degrees, mass, moment, quantity
from nutdamp.spacecraft import Spacecraft


def trade_screen(spacecraft: Spacecraft, found: Sequence[Front]) -> RenderableType:
    """Everything that ``trade`` shows."""
    return Group(header(spacecraft), *front_parts(spacecraft, found))


def front_parts(spacecraft: Spacecraft, found: Sequence[Front]) -> list[RenderableType]:
    """The table of each front under its name."""
    parts: list[RenderableType] = []
    for front in found:
        parts += [Text(), Text(front_name(front, pointing=spacecraft.goal.axis is not None), style="bold")]
        if not front.points:
            parts.append(Text(f"none: {front.why}"))
            continue
        table = columns("point", "ends at", "cost", "first-order least", "pulses", "shift of H", "saves")
        dearest = front.points[0].cost
        for index, owner, point in numbered(found):
            if owner is front:
                unit = point.bounds.unit
                cost, least = (
                    mass(value) if unit == "kg" else quantity(value, unit)
                    for value in (point.cost, point.bounds.first_order)
                )
                plan, saved = point.plan, 100.0 * (1.0 - point.cost / dearest)
                shift = degrees(plan.flight.residual.momentum_shift)
                cells = moment(plan.pulses.end), cost, least, str(len(plan.pulses)), shift, f"{saved:.1f} %"
                table.add_row(str(index), *cells)
        parts.append(table)
    return parts


def front_name(front: Front, *, pointing: bool) -> str:
    """What is required of H, in words."""
    if math.isinf(front.shift):
        return "H may end anywhere"
    if front.shift == 0.0:
        return "H ends on its target" if pointing else "H ends where it was"
    return f"H ends within {degrees(front.shift)} of " + ("its target" if pointing else "where it was")
