"""Schemes beside each other: a row each, and a dot for what it costs, when it ends and what it leaves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nutdamp import compliance
from nutdamp.comparison import Comparison
from nutdamp.compliance import NEGLIGIBLE, Part
from nutdamp.decision import Decision
from nutdamp.planning import Plan
from nutdamp.presentation.figures import labels, style
from nutdamp.presentation.figures.legends import heading, legend
from nutdamp.presentation.figures.style import FIRED, GREY, INK, MOTION, PAPER, PULSE
from nutdamp.presentation.text import in_degrees
from nutdamp.presentation.verdicts import percent
from nutdamp.recommendation import Standing, by_propellant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DECADES = 5.0
"""Of a log axis at most: what is less is drawn at its left edge."""

SPAN = 0.1
"""Of a linear axis at least, as a part of its largest value: what is equal but for rounding looks equal."""

FAILS: dict[str, Any] = {"color": PULSE, "markersize": 7, "markeredgewidth": 1.6, "linestyle": ""}
"""Mark of what does not meet the requirement, or does not damp."""

ABREAST = 3
"""Panels side by side at most."""


class Floor(NamedTuple):
    """What no schedule can go below that leaves as little as that of ``scheme``."""

    least: float
    scheme: str


class Quantity(NamedTuple):
    """A column: its name, the value of a plan (None: unknown), what is written beside the dot, and the lines.

    ``required``: the bound of the requirement. ``log``: an angle in degrees on a log axis. ``most``: no value is more.
    """

    name: str
    value: Callable[[Plan], float | None]
    text: Callable[[float], str]
    floor: Floor | None = None
    required: float | None = None
    log: bool = False
    most: float = math.inf


@style.styled
def schemes_figure(compared: Comparison, decided: Decision | None = None) -> Figure:
    """Dot plots of the schemes; ``decided`` knows which cases of which scheme comply, where they were dispersed."""
    columns = _columns(compared)
    if decided is not None and decided.cases is not None and decided.shares:
        columns.append(_complying(decided.shares, decided.cases.probability))
    plans = sorted(compared.plans, key=_place)
    chosen = compared.recommended if decided is None else decided.plan
    abreast = min(ABREAST, -(-len(columns) // 2))
    figure = style.sheet(7.4 if abreast < ABREAST else 9.0, 1.2 + 2 * (0.75 + 0.36 * len(plans)))
    cells = list(figure.subplots(2, abreast).flat)
    for axes, column in zip(cells, columns, strict=False):
        _column(axes, column, plans, chosen)
    for axes in cells[len(columns) :]:
        axes.remove()
    legend(figure, cells[: len(columns)], 3)
    verdict = "no recommendation" if chosen is None else f"recommended: {chosen.scheme}"
    if chosen is not None and _misses(chosen):
        verdict += f" ({_short(chosen)})"
    heading(figure, compared.spacecraft, f"schemes by real pulse widths\n{verdict}")
    labels.settle(figure)
    return figure


def _place(plan: Plan) -> int:
    """Schemes that reach more are higher up, those without a plan at the foot."""
    if not plan.feasible:
        return len(Standing)
    return list(Standing).index(Standing.MISSES if _misses(plan) else plan.standing)


def _misses(plan: Plan) -> bool:
    """Whether the requirement or a cone is not kept, or nothing is damped."""
    return plan.standing is Standing.MISSES or plan.kept is False


def _short(plan: Plan) -> str:
    """What is to be said of a plan that misses what is required of it or of its cases."""
    required = compliance.required(plan.spacecraft) or plan.kept is False
    return "requirement NOT met" if required else "does not damp"


def _columns(compared: Comparison) -> list[Quantity]:
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
        bound.part: math.degrees(bound.most) for bound in compliance.required(body) if bound.part is not Part.SPIN
    }
    aim = compliance.aim(body)

    def cost(plan: Plan) -> float | None:
        spent = plan.pulses.propellant if propellant else plan.pulses.total_impulse
        return None if spent is None else scale * spent

    def left(part: Part) -> Callable[[Plan], float | None]:
        return lambda plan: None if plan.flown is None else math.degrees(getattr(plan.flown, part.value))

    return [
        *(
            Quantity(f"{part.label}, deg", left(part), _angle, required=most.get(part), log=True)
            for part in (Part.NUTATION, aim)
        ),
        Quantity(
            ("propellant, g" if light else "propellant, kg") if propellant else "impulse, N m s", cost, "{:.4g}".format,
            floor=min(proved, default=None),
        ),
        Quantity("end, s", lambda plan: plan.pulses.end, "{:.3f}".format),
    ]  # fmt: skip


def _angle(value: float) -> str:
    return in_degrees(math.radians(value))


def _complying(shares: Mapping[str, float], probability: float) -> Quantity:
    def share(plan: Plan) -> float | None:
        found = shares.get(plan.scheme)
        return None if found is None else 100.0 * found

    def text(value: float) -> str:
        return percent(value / 100.0, probability).removesuffix(" %")

    return Quantity("complying cases, %", share, text, required=100.0 * probability, most=100.0)


def _column(axes: Axes, column: Quantity, plans: Sequence[Plan], chosen: Plan | None) -> None:
    values = [column.value(plan) if plan.feasible else None for plan in plans]
    known = [value for value in values if value is not None]
    floor = None if column.floor is None else column.floor.least
    lines = [line for line in (floor, column.required) if line is not None]
    low = _scale(axes, [*known, *lines], column)
    for row, (plan, value) in enumerate(zip(plans, values, strict=True)):
        axes.axhline(-row, color=GREY, linewidth=0.5, alpha=0.5)
        if value is None:
            continue
        few = column.most < math.inf and column.required is not None and value < column.required
        less, place = value < low, np.array([max(value, low), -row])
        if few or _misses(plan):
            name = ("recommended, " if plan is chosen else "") + _short(plan)
            axes.plot(*place, "X" if plan is chosen else "x", clip_on=False, **FAILS)
            axes.plot([], [], "X" if plan is chosen else "x", label=name, **FAILS)
        else:
            face = MOTION if plan is chosen else PAPER
            look: dict[str, Any] = {"color": MOTION, "markerfacecolor": face, "markersize": 6, "linestyle": ""}
            axes.plot(*place, "<" if less else "o", clip_on=False, zorder=3, **look)
            axes.plot([], [], "o", label="recommended" if plan is chosen else "other schemes", **look)
        labels.add(axes, column.text(value), place, INK, role="vital")
    if column.floor is not None:
        name = f"least to leave as little as {column.floor.scheme}"
        axes.axvline(column.floor.least, color=INK, linewidth=1.0, linestyle=":", label=name, zorder=1.5)
    if column.required is not None:
        axes.axvline(column.required, color=PULSE, linewidth=1.6, label="required", zorder=1.5)
    axes.set_xlabel(column.name)
    axes.grid(axis="x")
    _name_rows(axes, plans, chosen)


def _name_rows(axes: Axes, plans: Sequence[Plan], chosen: Plan | None) -> None:
    """Schemes beside their rows; those that fall short say so there."""
    short = [plan.feasible and _misses(plan) for plan in plans]
    names = [
        f"{plan.scheme}\n{_short(plan) if fails else 'no plan'}" if fails or not plan.feasible else plan.scheme
        for plan, fails in zip(plans, short, strict=True)
    ]
    axes.set_yticks(-np.arange(len(plans)), names)
    axes.set_ylim(-len(plans) + 0.45, 0.7)
    axes.tick_params(axis="y", length=0, pad=6)
    for tick, plan, fails in zip(axes.get_yticklabels(), plans, short, strict=True):
        tick.set(fontweight="bold" if plan is chosen else "normal", color=FIRED if fails else INK, fontsize=style.SMALL)


def _scale(axes: Axes, values: list[float], column: Quantity) -> float:
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
