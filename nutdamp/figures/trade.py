"""The picture of ``trade``: cost over time, a step line for each front."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.common.numerics import down
from nutdamp.figures import labels, style
from nutdamp.figures.legends import heading, legend
from nutdamp.figures.style import INK, MOMENTUM, MOTION, PAPER, PULSE
from nutdamp.flight.propagation import model_name
from nutdamp.planning.plan import Plan
from nutdamp.planning.tradeoff import Front, numbered
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views.text import cost as written
from nutdamp.views.trade import FAILS, fails, front_name, missing, schemes_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


LOOKS = ((MOTION, "o", "-"), (PULSE, "s", (0, (5, 1.5))), (MOMENTUM, "^", (0, (5, 1.5, 1, 1.5))), (INK, "D", ":"))
"""Colour, mark and line of the fronts in turn."""

ALIKE = (0.02, 0.002)
"""Relative differences in end and in cost of points that are drawn as one."""

WIDTH = 14.0
"""Characters of a line above the picture in an inch of it."""

FEWEST = 3
"""Ticks of a decade's 1, 2 and 5 below which the axis of time has others."""


REACH = 1.03
"""End of the axis of time beyond the horizon: marks at its end are drawn whole."""


@style.styled
def trade_figure(
    spacecraft: Spacecraft, fronts: Sequence[Front], chosen: Plan | None = None, *, narrow: bool = False
) -> Figure:
    """End of the last pulse against propellant (impulse where that is unknown), numbered as in the table.

    ``chosen``: a plan to be marked among them. Fronts that have no points are named, with the reason. ``narrow``: for a
    phone.
    """
    width = style.PHONE if narrow else 7.4
    figure = style.sheet(width, 4.8)
    names = ", ".join(schemes_of(fronts))
    how = model_name(point.plan.pulses for _, _, point in numbered(fronts))
    heading(figure, spacecraft, f"what time costs, by {names}, flown by {how}")
    reasons = "\n".join(fill(reason, int(WIDTH * width)) for reason in missing(spacecraft, fronts))
    points = [point for _, _, point in numbered(fronts)]
    if not points:
        figure.text(0.5, 0.5, reasons, ha="center", va="center", linespacing=1.6)
        return figure
    axes = figure.subplots()
    axes.set_title(reasons, loc="left", fontsize=style.SMALL, fontweight="normal")
    # A pulse of no width at t = 0 ends there, which a log axis has no place for.
    log = all(point.plan.pulses.end > 0.0 for point in points)
    axes.set_xscale("log" if log else "linear")
    scale = 1e3 if points[0].unit == "kg" else 1.0
    _draw_fronts(axes, spacecraft, fronts, scale)
    proved = [point.bounds.rigorous for point in points]
    if None not in proved:
        least = min(scale * value for value in proved if value is not None)
        name = f"lower bound of cost, same nutation left: {written(down(least) / scale, points[0].unit)}"
        axes.axhline(least, color=INK, linewidth=1.0, linestyle=":", label=name)
    if chosen is not None and len(chosen.pulses):
        place = chosen.pulses.end, scale * chosen.pulses.cost_in(points[0].unit)
        look: dict[str, Any] = {
            "color": INK,
            "markersize": style.STAR,
            "markerfacecolor": "none",
            "linestyle": "",
            "zorder": 4,
        }
        ideal = ", ideal impulses" * chosen.pulses.idealised
        other = "" if chosen.scheme in schemes_of(fronts) else f" (not traded{ideal})"
        axes.plot(*place, "*", label=f"recommended: {chosen.scheme}{other}", **look)
    axes.set_xlim(right=REACH * spacecraft.horizon)
    axes.margins(y=0.12)
    axes.set_xlabel("end of the last pulse, s")
    axes.set_ylabel("propellant, g" if scale > 1.0 else "impulse, N m s")
    if log:
        _graduate(axes)
    axes.grid(True, which="both")
    legend(figure, [axes], 3)
    labels.settle(figure)
    return figure


def _graduate(axes: Axes) -> None:
    """Ticks at 1, 2 and 5 of each decade, or evenly spaced within part of one."""
    from matplotlib.ticker import LogLocator, MaxNLocator

    low, high = axes.get_xlim()
    few = sum(low <= value <= high for value in LogLocator(subs=(1.0, 2.0, 5.0)).tick_values(low, high)) < FEWEST
    axes.xaxis.set_major_locator(MaxNLocator(6) if few else LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("")


def _draw_fronts(axes: Axes, spacecraft: Spacecraft, fronts: Sequence[Front], scale: float) -> None:
    """Step lines and marks; a point that another front has too is drawn around that one's mark, hollow and larger."""
    shown: list[tuple[float, float, list[int]]] = []
    covered: list[tuple[float, float]] = []
    for front, (colour, mark, line) in zip(fronts, LOOKS * math.ceil(len(fronts) / len(LOOKS)), strict=False):
        if not front.points:
            continue
        ends = [point.plan.pulses.end for point in front.points]
        costs = [scale * point.cost for point in front.points]
        name = front_name(front, pointing=spacecraft.goal.axis is not None)
        # A schedule serves for every later end, until a cheaper one does.
        times, levels = np.repeat([*ends, spacecraft.horizon], 2)[1:], np.repeat([*costs, costs[-1]], 2)[:-1]
        axes.plot(times, levels, color=colour, linestyle=line)
        on_top: dict[str, Any] = {"color": colour, "clip_on": False}  # marks at the horizon lie on the frame
        axes.plot([], [], color=colour, linestyle=line, marker=mark, markersize=5, label=name)
        alone = []
        for index, owner, point in numbered(fronts):
            if owner is front:
                end, cost = point.plan.pulses.end, scale * point.cost
                same = next((place for place in shown if _alike((end, cost), place[:2])), None)
                if same is None:
                    alone.append((end, cost))
                    shown.append((end, cost, [index]))
                else:
                    covered.append((end, cost))
                    same[2].append(index)
                    axes.plot(end, cost, mark, markersize=10, markerfacecolor="none", zorder=3, **on_top)
        if alone:
            axes.plot(*np.transpose(alone), mark, markersize=5, zorder=3.5, **on_top)
    failing = [(point.plan.pulses.end, scale * point.cost) for _, _, point in numbered(fronts) if fails(point)]
    if failing:
        axes.plot(*np.transpose(failing), "x", label=FAILS, **style.CROSS)
    if covered:
        ring: dict[str, Any] = {"color": INK, "markersize": 10, "markerfacecolor": PAPER, "linestyle": ""}
        axes.plot([], [], "s", label="the same schedule, on this front too", **ring)
    places = np.array([place[:2] for place in shown])
    for row, (_, _, numbers) in enumerate(shown):
        meant = labels.Meant(places[[row]], np.delete(places, row, axis=0))
        labels.add(axes, ", ".join(map(str, numbers)), places[row], INK, role="vital", meant=meant)


def _alike(first: tuple[float, float], second: tuple[float, float]) -> bool:
    return all(math.isclose(a, b, rel_tol=near) for a, b, near in zip(first, second, ALIKE, strict=True))
