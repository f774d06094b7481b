"""Schemes beside each other: a row each, and a dot for cost, end time and final motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nutdamp.errors import listed
from nutdamp.figures import labels, style
from nutdamp.figures.legends import heading, legend
from nutdamp.figures.style import FIRED, GREY, INK, MOTION, PAPER, PULSE
from nutdamp.planning.decision import Comparison, Decision
from nutdamp.planning.plan import Plan
from nutdamp.planning.recommendation import Standing, by_propellant
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Vector
from nutdamp.spacecraft.requirements import NEGLIGIBLE, Part
from nutdamp.views.schemes import flown_by
from nutdamp.views.text import digits, in_degrees
from nutdamp.views.verdicts import percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


DECADES = 5.0
"""Largest number of decades of a log axis: smaller values are drawn at its left edge."""

SPAN = 0.1
"""Least span of a linear axis, as a part of its largest value: values equal but for rounding look equal."""

FAILS: dict[str, Any] = {"color": PULSE, "markersize": 7, "markeredgewidth": 1.6}
"""Mark of a plan that does not meet the requirement, or does not damp."""

UNMET, UNDAMPED = "requirement NOT met", "does not damp"
"""Words for plans that fall short."""

ABREAST = 3
"""Largest number of panels side by side."""


class Floor(NamedTuple):
    """Lower bound on the cost of schedules whose final motion is as good as that of ``scheme``."""

    least: float
    scheme: str


class BarQuantity(NamedTuple):
    """A column: its name, the value of a plan (None: unknown), the text beside the dot, and the lines.

    ``required``: the bound of the requirement. ``log``: an angle in degrees on a log axis. ``most``: no value is more.
    """

    name: str
    value: Callable[[Plan], float | None]
    text: Callable[[float], str]
    floor: Floor | None = None
    required: float | None = None
    log: bool = False
    most: float = math.inf


class SchemeRows(NamedTuple):
    """The plans from above, the ``chosen`` one of them, and the reasons why others fall short, by scheme."""

    plans: Sequence[Plan]
    chosen: Plan | None
    short: Mapping[str, str]


@style.styled
def schemes_figure(compared: Comparison, decided: Decision | None = None) -> Figure:
    """Dot plots of the schemes; the plan ``decided`` on is marked, default the recommended one."""
    columns = _columns(compared)
    shares = {plan.scheme: share.exact for plan, share in compared.shares.items() if share.exact is not None}
    if shares:
        columns.append(_complying(shares, next(iter(compared.shares.values())).probability))
    chosen = compared.recommended if decided is None else decided.plan
    short = {plan.scheme: reason for plan in compared.plans if (reason := _short(plan, compared))}
    plans = sorted(compared.plans, key=lambda plan: _place(plan, short))
    abreast = min(ABREAST, -(-len(columns) // 2))
    figure = style.sheet(7.4 if abreast < ABREAST else 9.0, 1.2 + 2 * (0.75 + 0.36 * len(plans)))
    cells = list(figure.subplots(2, abreast).flat)
    for index, (axes, column) in enumerate(zip(cells, columns, strict=False)):
        rows = SchemeRows(plans, chosen, short)
        _column(axes, column, rows)
        # The reasons why schemes fall short stand at the left alone: beside every panel they would leave it no room.
        _name_rows(axes, rows, why=index % abreast == 0)
    for axes in cells[len(columns) :]:
        axes.remove()
    legend(figure, cells[: len(columns)], 3)
    verdict = "no recommendation" if chosen is None else f"recommended: {chosen.scheme}"
    if chosen is not None and chosen.scheme in short:
        verdict += f" ({short[chosen.scheme]})"
    heading(figure, compared.spacecraft, f"schemes by {flown_by(compared)}\n{verdict}")
    labels.settle(figure)
    return figure


def _place(plan: Plan, short: Mapping[str, str]) -> int:
    """Key of the order: schemes that reach more are higher up, those without a plan at the foot."""
    if not plan.feasible:
        return len(Standing)
    return list(Standing).index(Standing.MISSES if plan.scheme in short else plan.standing)


def _short(plan: Plan, compared: Comparison) -> str:
    """Text for a plan that misses the requirement on it or on its cases; empty where it does not."""
    if not plan.feasible:
        return ""
    if plan.standing is Standing.MISSES or plan.kept is False:
        missed = [bound.part.label for bound in plan.shortfalls if bound.required]
        missed += ["cones"] * (plan.kept is False)
        return f"NOT met: {listed(missed)}" if missed else UNDAMPED
    return "" if compared.meets(plan) in (None, True) else "NOT met: too few cases comply"


def _columns(compared: Comparison) -> list[BarQuantity]:
    plans = [plan for plan in compared.plans if plan.feasible]
    body, propellant = compared.spacecraft, by_propellant(plans)
    unit = "kg" if propellant else "N m s"
    light = propellant and max((plan.pulses.cost_in(unit) for plan in plans), default=0.0) < 1.0
    scale, proved = 1e3 if light else 1.0, []
    for plan in plans:
        bounds = plan.pulses.bounds
        if bounds is not None and bounds.rigorous is not None and bounds.unit == unit:
            proved.append(Floor(scale * bounds.rigorous, plan.scheme))
    most: dict[Part, float] = {
        bound.part: math.degrees(bound.most) for bound in requirements.required(body) if bound.part is not Part.SPIN
    }
    aim = requirements.aim(body)

    def cost(plan: Plan) -> float | None:
        spent = plan.pulses.propellant if propellant else plan.pulses.total_impulse
        return None if spent is None else scale * spent

    def left(part: Part) -> Callable[[Plan], float | None]:
        return lambda plan: None if plan.flown is None else math.degrees(getattr(plan.flown, part.value))

    return [
        *(
            BarQuantity(f"{part.label}, deg", left(part), _angle, required=most.get(part), log=True)
            for part in (Part.NUTATION, aim)
        ),
        BarQuantity(
            ("propellant, g" if light else "propellant, kg") if propellant else "impulse, N m s", cost, _figures,
            floor=min(proved, default=None),
        ),
        BarQuantity("end, s", lambda plan: plan.pulses.end, "{:.3f}".format),
    ]  # fmt: skip


def _figures(value: float) -> str:
    return digits(value, 4)


def _angle(value: float) -> str:
    return in_degrees(math.radians(value))


def _complying(shares: Mapping[str, float], probability: float) -> BarQuantity:
    def share(plan: Plan) -> float | None:
        fraction = shares.get(plan.scheme)
        return None if fraction is None else 100.0 * fraction

    def text(value: float) -> str:
        return percent(value / 100.0, probability).removesuffix(" %")

    return BarQuantity("complying cases, %", share, text, required=100.0 * probability, most=100.0)


def _column(axes: Axes, column: BarQuantity, rows: SchemeRows) -> None:
    values = [column.value(plan) if plan.feasible else None for plan in rows.plans]
    known = [value for value in values if value is not None]
    floor = None if column.floor is None else column.floor.least
    lines = [line for line in (floor, column.required) if line is not None]
    low = _scale(axes, [*known, *lines], column)
    for row, (plan, value) in enumerate(zip(rows.plans, values, strict=True)):
        axes.axhline(-row, color=GREY, linewidth=0.5, alpha=0.5)
        if value is not None:
            place = np.array([max(value, low), -row])
            _mark(axes, place, rows.short.get(plan.scheme, ""), chosen=plan is rows.chosen, less=value < low)
            labels.add(axes, column.text(value), place, INK, role="vital")
    if column.floor is not None:
        name = f"lower bound of cost, for {column.floor.scheme}"
        axes.axvline(column.floor.least, color=INK, linewidth=1.0, linestyle=":", label=name, zorder=1.5)
    if column.required is not None:
        axes.axvline(column.required, color=PULSE, linewidth=1.6, label="required", zorder=1.5)
    axes.set_xlabel(column.name)
    axes.grid(axis="x")


def _mark(axes: Axes, place: Vector, short: str, *, chosen: bool, less: bool) -> None:
    """The mark of a plan at ``place`` (2,), and its line in the legend; ``less``: below the scale."""
    look: dict[str, Any] = {"color": MOTION, "markerfacecolor": MOTION if chosen else PAPER, "markersize": 6}
    mark, name = "o", "recommended" if chosen else "other schemes"
    if short:
        # The reason stands beside the row: each mark has a single name in the legend.
        result = UNDAMPED if short == UNDAMPED else UNMET
        look, mark, name = FAILS, "X" if chosen else "x", ("recommended, " if chosen else "") + result
    axes.plot(*place, "<" if less else mark, clip_on=False, zorder=3, linestyle="", **look)
    axes.plot([], [], mark, label=name, linestyle="", **look)
    if less:
        axes.plot([], [], "<", color=GREY, markersize=6, linestyle="", label="less than the axis shows")


def _name_rows(axes: Axes, rows: SchemeRows, *, why: bool) -> None:
    """Schemes beside their rows; those that fall short have another colour, and their reason with ``why``."""
    names = []
    for plan in rows.plans:
        reason = rows.short.get(plan.scheme, "") * why if plan.feasible else "no plan"
        names.append(f"{plan.scheme}\n{reason}" if reason else plan.scheme)
    axes.set_yticks(-np.arange(len(names)), names)
    axes.set_ylim(-len(names) + 0.45, 0.7)
    axes.tick_params(axis="y", length=0, pad=6)
    for tick, plan in zip(axes.get_yticklabels(), rows.plans, strict=True):
        colour = FIRED if plan.scheme in rows.short else INK
        tick.set(fontweight="bold" if plan is rows.chosen else "normal", color=colour, fontsize=style.SMALL)


def _scale(axes: Axes, values: list[float], column: BarQuantity) -> float:
    """Scale and limits of a column; returns its least value, below which a dot is drawn at the edge."""
    from matplotlib.ticker import LogLocator

    if not column.log:
        low, high = min(values, default=0.0), max(values, default=1.0)
        span = max(high - low, SPAN * abs(high)) or 1.0
        low = 0.5 * (low + high - span)
        axes.set_xlim(max(low - 0.35 * span, 0.0), min(low + 1.35 * span, column.most + 0.06 * span))
        axes.locator_params(axis="x", nbins=4)
        return -math.inf
    seen = [value for value in values if value > math.degrees(NEGLIGIBLE)]
    high = max(seen, default=1.0)
    low = float(max(min(seen, default=high), high * 10.0**-DECADES) / 10.0)
    low = 10.0 ** math.floor(math.log10(low))  # a tick
    axes.set_xscale("log")
    axes.set_xlim(low, high * (high / low) ** 0.3)
    axes.xaxis.set_major_locator(LogLocator(numticks=5))
    axes.xaxis.set_minor_formatter("")
    axes.xaxis.set_major_formatter("{x:g}")
    return low
