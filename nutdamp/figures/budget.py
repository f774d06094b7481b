"""The picture of ``budget``: growth of the nutation, its limit cycles, and the cost of each pair of thresholds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.control_loop.budget import DAY, YEAR, Budget, HeldNutation
from nutdamp.figures import style
from nutdamp.figures.legends import heading, legend
from nutdamp.figures.style import GREY, INK, MOMENTUM, MOTION, PULSE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


LINES = ((MOTION, "-"), (PULSE, "--"), (MOMENTUM, "-."), (GREY, ":"))
"""Colour and style of the pairs of thresholds whose limit cycles are drawn."""

WIDE = 30.0
"""Ratio of the longest bar to the shortest from which on their axis is logarithmic."""

HEAD = "nutation by itself, and held between thresholds by the loop"

PERIODS = 4.0
"""Cycles drawn of the longest limit cycle."""

ROWS = 600


@style.styled
def budget_figure(budget: Budget) -> Figure:
    """Nutation without and with firings; below, pulses a day and propellant a year."""
    held = [row for row in budget.held if row.cycle is not None]
    figure = style.sheet(7.4, 3.4 + (1.1 + 0.22 * len(held)) * bool(held))
    if not held:
        alone = figure.subplots()
        _courses(alone, budget, held)
        legend(figure, [alone])
        heading(figure, budget.spacecraft, HEAD)
        return figure
    grid = figure.add_gridspec(2, 2, height_ratios=[3.0, 0.9 + 0.22 * len(held)])
    courses = figure.add_subplot(grid[0, :])
    _courses(courses, budget, held)
    pulses, mass = figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
    names = [_named(row) for row in held]
    _bars(pulses, names, [row.cycle.pulses * DAY for row in held if row.cycle], "pulses a day")
    known = [row.cycle.propellant for row in held if row.cycle]
    if None in known:
        impulses = [row.cycle.impulse * YEAR for row in held if row.cycle]
        _bars(mass, [""] * len(held), impulses, "impulse, N m s a year")
    else:
        _bars(mass, [""] * len(held), [(amount or 0.0) * YEAR for amount in known], "propellant, kg a year")
    legend(figure, [courses])
    heading(figure, budget.spacecraft, HEAD)
    return figure


def _named(row: HeldNutation) -> str:
    return f"{math.degrees(row.thresholds.start):.3g} to {math.degrees(row.thresholds.stop):.3g} deg"


def _courses(axes: Axes, budget: Budget, held: list[HeldNutation]) -> None:
    """Nutation over time: without firing, and the sawtooth of each limit cycle by its means."""
    body = budget.spacecraft
    size = max([PERIODS / _pace(row) + _begins(row) for row in held], default=0.0)
    until = budget.until_largest
    if until is not None and math.isfinite(until):
        size = max(size, 1.2 * until)
    size = size or 3.0 / max(abs(body.growth), 1e-300)
    unit, seconds = ("days", DAY) if size > 2.0 * DAY else ("hours", 3600.0) if size > 7200.0 else ("s", 1.0)
    times = np.linspace(0.0, size, ROWS)
    free = np.degrees(np.arctan(np.exp(np.minimum(body.growth * times, 300.0)) * math.tan(body.nutation)))
    lows = [math.degrees(row.cycle.low) for row in held if row.cycle is not None]
    axes.plot(times / seconds, free, color=INK, label="no firing")
    for row, (colour, line) in zip(held, LINES, strict=False):
        drawn, angles = _sawtooth(body.growth, row, size)
        axes.plot(drawn / seconds, angles, color=colour, linestyle=line, label=_named(row))
    if budget.largest is not None:
        axes.axhline(math.degrees(budget.largest), color=GREY, linewidth=0.9, linestyle="--", label="largest")
    highest = [math.degrees(row.cycle.largest) for row in held if row.cycle is not None]
    top = max([*highest, math.degrees(budget.largest or 0.0), float(free[0])])
    axes.set_yscale("log")
    axes.set_ylim(0.5 * min([*lows, max(float(free.min()), 1e-3 * top)]), 3.0 * top)
    axes.set_xlim(0.0, size / seconds)
    axes.set_xlabel(f"time, {unit}")
    axes.set_ylabel("nutation, deg (log)")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    axes.grid()


def _begins(row: HeldNutation) -> float:
    """Time of the first firing, s; with no nutation that of the first that could grow at once."""
    return row.begins if math.isfinite(row.begins) else 0.0


def _pace(row: HeldNutation) -> float:
    """Cycles, or pulses of a loop that never pauses, 1/s."""
    assert row.cycle is not None
    return row.cycle.cycles or row.cycle.pulses


def _sawtooth(growth: float, row: HeldNutation, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Times (s) and nutation (deg) of a limit cycle, by its means, from when it first fires."""
    assert row.cycle is not None
    period, low, high = 1.0 / _pace(row), math.degrees(row.cycle.low), math.degrees(row.cycle.high)
    count = max(math.ceil((size - _begins(row)) / period), 0)
    rises = min(math.log(high / low) / growth, period) if high > low > 0.0 else period
    starts = _begins(row) + period * np.arange(count)
    times = np.stack([starts, starts + period - rises, starts + period], axis=1).ravel()
    angles = np.tile([low, low, high], count)
    return times, angles


def _bars(axes: Axes, names: list[str], values: list[float], label: str) -> None:
    """One bar for each pair of thresholds, with its number."""
    places = np.arange(len(values))[::-1]
    colours = [*(colour for colour, _ in LINES), *[INK] * len(values)][: len(values)]
    bars = axes.barh(places, values, height=0.6, color=colours)
    axes.bar_label(bars, [f"{value:.4g}" for value in values], padding=3, fontsize=style.SMALL)
    axes.set_yticks(places, names)
    if 0.0 < WIDE * min(values) < max(values):
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.set_xlim(0.5 * min(values), 8.0 * max(values))
    else:
        axes.set_xlim(0.0, 1.45 * max(values) or 1.0)
    axes.set_ylim(-0.6, len(values) - 0.4)
    axes.set_xlabel(label)
    axes.grid(axis="x")
