"""The picture of ``trade``: cost over time, a step line for each front."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from nutdamp.fronts import Front
from nutdamp.presentation.figures import style
from nutdamp.presentation.figures.style import GREY, INK, MOMENTUM, MOTION, PULSE
from nutdamp.presentation.trade_tables import front_name
from nutdamp.spacecraft import Spacecraft

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOOKS = ((MOTION, "o", "-"), (PULSE, "s", (0, (5, 1.5))), (MOMENTUM, "^", (0, (5, 1.5, 1, 1.5))), (INK, "D", ":"))
"""Colour, mark and line of the fronts in turn."""


@style.styled
def trade_figure(spacecraft: Spacecraft, found: Sequence[Front]) -> Figure:
    """End of the last pulse against propellant (impulse where that is unknown), numbered as in the table."""
    from matplotlib.ticker import LogLocator

    figure = style.sheet(7.4, 4.6)
    axes = figure.subplots()
    unit, number = "N m s", 0
    shown: list[tuple[float, float]] = []
    for index, front in enumerate(found):
        colour, mark, line = LOOKS[index % len(LOOKS)]
        if not front.points:
            continue
        unit = front.points[0].bounds.unit
        ends = [point.plan.pulses.end for point in front.points]
        costs = [scale_of(unit) * point.cost for point in front.points]
        name = front_name(front, pointing=spacecraft.goal.axis is not None)
        # A schedule serves for every later end, until a cheaper one does.
        axes.step(
            [*ends, spacecraft.horizon], [*costs, costs[-1]], where="post", color=colour, linestyle=line, label=name
        )
        axes.plot(ends, costs, mark, color=colour, markersize=5)
        for shift, (end, cost) in enumerate(zip(ends, costs, strict=True), start=1):
            if any(math.isclose(end, t, rel_tol=0.02) and math.isclose(cost, c, rel_tol=0.002) for t, c in shown):
                continue  # a stricter front has it already, or as good as
            shown.append((end, cost))
            axes.annotate(
                str(number + shift), (end, cost), xytext=(4, 4), textcoords="offset points",
                color=colour, fontsize=style.SMALL,
            )  # fmt: skip
        number += len(front.points)
    points = [point for front in found for point in front.points]
    proved = [point.bounds.rigorous for point in points]
    if points:
        if None not in proved:
            least = min(scale_of(unit) * value for value in proved if value is not None)
            axes.axhline(least, color=GREY, linewidth=0.9, linestyle=":", label="no schedule takes less")
        axes.set_xscale("log")
        axes.set_xlim(right=spacecraft.horizon)
        axes.margins(y=0.12)
        axes.legend(loc="upper right")
    else:
        axes.text(0.5, 0.5, "no schedule was found", transform=axes.transAxes, ha="center", va="center")
    axes.set_xlabel("end of the last pulse, s")
    axes.set_ylabel("propellant, g" if unit == "kg" else "impulse, N m s")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("")
    axes.grid(True, which="both")
    figure.suptitle(f"{spacecraft.name}: what time costs")
    return figure


def scale_of(unit: str) -> float:
    """What turns a cost into the unit of the axis."""
    return 1e3 if unit == "kg" else 1.0
