"""Schemes beside each other: a row each, and a dot for what it costs, when it ends and what it leaves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nutdamp import compliance
from nutdamp.comparison import Comparison
from nutdamp.compliance import NEGLIGIBLE, Part
from nutdamp.decision import Decision
from nutdamp.planning import Plan
from nutdamp.presentation.figures import style
from nutdamp.presentation.figures.style import GREY, INK, MOTION, PAPER, PULSE
from nutdamp.presentation.text import degrees
from nutdamp.presentation.verdicts import percent
from nutdamp.recommendation import by_propellant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DECADES = 5.0
"""Of a log axis at most: what is less stands at its left edge."""


class Floor(NamedTuple):
    """What no schedule can go below that leaves as little as that of ``scheme``."""

    least: float
    scheme: str


class Quantity(NamedTuple):
    """A column: its name, the value of a plan (None: unknown), what stands beside the dot, and the lines.

    ``required``: the bound of the requirement. ``log``: an angle in degrees
    on a log axis.
    """

    name: str
    value: Callable[[Plan], float | None]
    text: Callable[[float], str]
    floor: Floor | None = None
    required: float | None = None
    log: bool = False


@style.styled
def schemes_figure(compared: Comparison, decided: Decision | None = None) -> Figure:
    """Dot plots of the schemes; ``decided`` knows which cases of which scheme comply, where they were dispersed."""
    columns = _columns(compared)
    if decided is not None and decided.cases is not None and decided.shares:
        columns.append(_complying(decided.shares, decided.cases.probability))
    figure = style.sheet(1.75 * len(columns) + 0.4, 1.75 + 0.4 * len(compared.plans))
    grid = figure.subplots(1, len(columns), sharey=True, squeeze=False)[0]
    names = [plan.scheme for plan in compared.plans]
    chosen = compared.recommended if decided is None else decided.plan
    for axes, column in zip(grid, columns, strict=True):
        _column(axes, column, compared, chosen)
    grid[0].set_yticks(-np.arange(len(names)), names)
    grid[0].set_ylim(-len(names) + 0.45, 0.7)
    for tick, plan in zip(grid[0].get_yticklabels(), compared.plans, strict=True):
        tick.set_fontweight("bold" if plan is chosen else "normal")
    style.legend(figure, list(grid))
    verdict = "no recommendation" if chosen is None else f"recommended: {chosen.scheme}"
    figure.suptitle(f"{compared.spacecraft.name}: schemes by real pulse widths\n{verdict}")
    style.settle(figure)
    return figure


def _columns(compared: Comparison) -> list[Quantity]:
    plans = [plan for plan in compared.plans if plan.feasible]
    body, propellant = compared.spacecraft, by_propellant(plans)
    unit = "kg" if propellant else "N m s"
    scale, proved = 1e3 if propellant else 1.0, []
    for plan in plans:
        bounds = plan.pulses.bounds
        if bounds is not None and bounds.rigorous is not None and bounds.unit == unit:
            proved.append(Floor(scale * bounds.rigorous, plan.scheme))
    most: dict[Part, float] = {
        bound.part: math.degrees(bound.most) for bound in compliance.required(body) if bound.part is not Part.SPIN
    }
    aim = compliance.aim(body)

    def cost(plan: Plan) -> float | None:
        spent = plan.pulses.propellant if propellant else plan.pulses.total_impulse
        return None if spent is None else scale * spent

    def left(part: Part) -> Callable[[Plan], float | None]:
        return lambda plan: None if plan.flown is None else math.degrees(getattr(plan.flown, part.value))

    return [
        Quantity(
            "propellant, g" if propellant else "impulse, N m s", cost, "{:.4g}".format,
            floor=min(proved, default=None),
        ),
        Quantity("end, s", lambda plan: plan.pulses.end, "{:.3f}".format),
        *(
            Quantity(f"{part.label}, deg", left(part), _angle, required=most.get(part), log=True)
            for part in (Part.NUTATION, aim)
        ),
    ]  # fmt: skip


def _angle(value: float) -> str:
    return degrees(math.radians(value)).removesuffix(" deg")


def _complying(shares: Mapping[str, float], probability: float) -> Quantity:
    def share(plan: Plan) -> float | None:
        found = shares.get(plan.scheme)
        return None if found is None else 100.0 * found

    def text(value: float) -> str:
        return percent(value / 100.0, probability).removesuffix(" %")

    return Quantity("complying cases, %", share, text, required=100.0 * probability)


def _column(axes: Axes, column: Quantity, compared: Comparison, chosen: Plan | None) -> None:
    values = [column.value(plan) if plan.feasible else None for plan in compared.plans]
    known = [value for value in values if value is not None]
    floor = None if column.floor is None else column.floor.least
    lines = [line for line in (floor, column.required) if line is not None]
    low = _scale(axes, [*known, *lines], log=column.log)
    for row, (plan, value) in enumerate(zip(compared.plans, values, strict=True)):
        axes.axhline(-row, color=GREY, linewidth=0.5, alpha=0.5)
        if value is None:
            if not plan.feasible and axes.get_subplotspec().is_first_col():  # type: ignore[union-attr]
                sides = axes.get_yaxis_transform()
                axes.annotate("no plan", (0.5, -row), xycoords=sides, ha="center", fontsize=style.SMALL)
            continue
        less = value < low
        face = MOTION if plan is chosen else PAPER
        name = "recommended" if plan is chosen else "other schemes"
        look: dict[str, Any] = {"color": MOTION, "markerfacecolor": face, "markersize": 6, "linestyle": ""}
        axes.plot(max(value, low), -row, "<" if less else "o", clip_on=False, **look)
        axes.plot([], [], "o", label=name, **look)
        style.label(axes, column.text(value), np.array([max(value, low), -row]), INK, role="vital")
    if column.floor is not None:
        name = f"least to leave as little as {column.floor.scheme}"
        axes.axvline(column.floor.least, color=INK, linewidth=1.0, linestyle=":", label=name)
    if column.required is not None:
        axes.axvline(column.required, color=PULSE, linewidth=1.6, label="required")
    axes.set_xlabel(column.name)
    axes.grid(axis="x")
    axes.tick_params(axis="y", length=0)


def _scale(axes: Axes, values: list[float], *, log: bool) -> float:
    """Scale and limits of a column; returns its least value, below which a dot stands at the edge."""
    from matplotlib.ticker import LogLocator

    if not log:
        low, high = min(values, default=0.0), max(values, default=1.0)
        room = 0.35 * (high - low) or 0.5 * abs(high) or 1.0
        axes.set_xlim(max(low - room, 0.0), high + room)
        axes.locator_params(axis="x", nbins=3)
        return -math.inf
    seen = [value for value in values if value > math.degrees(NEGLIGIBLE)]
    high = max(seen, default=1.0)
    low = float(max(min(seen, default=high), high * 10.0**-DECADES) / 10.0)
    axes.set_xscale("log")
    axes.set_xlim(low, high * (high / low) ** 0.3)
    axes.xaxis.set_major_locator(LogLocator(numticks=4))
    axes.xaxis.set_minor_formatter("")
    axes.xaxis.set_major_formatter("{x:g}")
    return low
