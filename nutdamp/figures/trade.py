"""Pictures of cost over time: the fronts of ``trade``, and the proof of a least cost (``plan --figure primer``)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.common.numerics import down
from nutdamp.figures import labels, style
from nutdamp.figures.style import GREY, INK, MISSED, MOMENTUM, MOTION, PULSE
from nutdamp.flight.propagation import model_name
from nutdamp.planning.plan import Plan
from nutdamp.planning.tradeoff import Certificate, Front, numbered
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.views.text import cost as written
from nutdamp.views.trade import FAILS, fails, front_name, missing, schemes_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


LOOKS = ((MOTION, "o", "-"), (MOMENTUM, "^", (0, (5, 1.5, 1, 1.5))), (INK, "s", (0, (5, 1.5))), (GREY, "v", ":"))
"""Colour, mark and line of the fronts in turn."""

ALIKE = (0.02, 0.002)
"""Relative differences in end and in cost of points that are drawn as one."""

WIDTH = 14.0
"""Characters of a line above the picture in an inch of it."""

FEWEST = 3
"""Ticks of a decade's 1, 2 and 5 below which the axis of time has others."""


REACH = 1.4
"""End of the axis of time over the last end of a schedule: to there its cost holds, as far as the horizon reaches."""

CROSS: dict[str, Any] = {"color": MISSED, "markersize": 9, "markeredgewidth": 1.4, "linestyle": "", "zorder": 3.8}
"""Look of an x over the mark of a plan that does not meet the requirement."""

CHOSEN: dict[str, Any] = {"color": INK, "markersize": 11, "markerfacecolor": "none", "linestyle": "", "zorder": 4}
"""Look of the mark of the recommended plan."""


@style.styled
def trade_figure(
    spacecraft: Spacecraft, fronts: Sequence[Front], chosen: Plan | None = None, *, narrow: bool = False
) -> Figure:
    """End of the last firing against propellant (impulse where that is unknown), numbered as in the table.

    ``chosen``: a plan to be marked among them. Fronts that have no points are named, with the reason. ``narrow``: for a
    phone.
    """
    width = style.PHONE if narrow else 7.4
    figure = style.sheet(width, 4.8)
    points = [point for _, _, point in numbered(fronts)]
    how = model_name(point.plan.pulses for point in points)
    style.heading(figure, spacecraft, f"finish time against cost, {', '.join(schemes_of(fronts))} by {how}")
    reasons = "\n".join(fill(reason, int(WIDTH * width)) for reason in missing(spacecraft, fronts))
    if not points:
        figure.text(0.5, 0.5, reasons, ha="center", va="center", linespacing=1.6)
        return figure
    axes = figure.subplots()
    axes.set_title(reasons, loc="left", **style.NOTE)
    # A firing of no width at t = 0 ends there, which a log axis has no place for.
    ends = [point.plan.pulses.end for point in points]
    ends += [chosen.pulses.end] if chosen is not None and len(chosen.pulses) else []
    log = min(ends) > 0.0
    axes.set_xscale("log" if log else "linear")
    scale, unit = (1e3, "propellant, g") if points[0].unit == "kg" else (1.0, "impulse, N m s")
    reach = max(min(REACH * max(ends), spacecraft.horizon), 1.03 * max(ends))
    _draw_fronts(axes, spacecraft, fronts, scale, reach)
    proved = [point.bounds.rigorous for point in points]
    if None not in proved:
        least = min(scale * value for value in proved if value is not None)
        name = f"lower bound, {written(down(least) / scale, points[0].unit)}"
        axes.axhline(least, **{**style.LIMIT, "label": name})
    if chosen is not None and len(chosen.pulses):
        place = chosen.pulses.end, scale * chosen.pulses.cost_in(points[0].unit)
        ideal = ", ideal impulses" * chosen.pulses.idealised
        other = "" if chosen.scheme in schemes_of(fronts) else f" (not traded{ideal})"
        axes.plot(*place, "D", label=f"recommended: {chosen.scheme}{other}", **CHOSEN)
    axes.set_xlim(right=reach if reach > 1.03 * max(ends) else 1.03 * reach)
    axes.margins(y=0.12)
    axes.set(xlabel="end of the last firing, s", ylabel=unit)
    if log:
        _graduate(axes)
    axes.grid(True, which="both")
    style.legend(figure, [axes], 3)
    labels.settle(figure)
    return figure


def _graduate(axes: Axes) -> None:
    """Ticks at 1, 2 and 5 of each decade, or evenly spaced within part of one."""
    from matplotlib.ticker import LogLocator, MaxNLocator

    low, high = axes.get_xlim()
    few = sum(low <= value <= high for value in LogLocator(subs=(1.0, 2.0, 5.0)).tick_values(low, high)) < FEWEST
    axes.xaxis.set_major_locator(MaxNLocator(6) if few else LogLocator(subs=(1.0, 2.0, 5.0)))
    style.log_axis(axes.xaxis)


def _draw_fronts(axes: Axes, spacecraft: Spacecraft, fronts: Sequence[Front], scale: float, reach: float) -> None:
    """Step lines to ``reach`` s, with their names, and numbered marks; a schedule of two fronts has one mark."""
    shown: list[tuple[float, float, list[int]]] = []
    points = [(index, owner, point.plan.pulses.end, scale * point.cost) for index, owner, point in numbered(fronts)]
    for front, (colour, mark, line) in zip(fronts, LOOKS * math.ceil(len(fronts) / len(LOOKS)), strict=False):
        if not front.points:
            continue
        own = [(index, end, cost) for index, owner, end, cost in points if owner is front]
        ends, costs = [end for _, end, _ in own], [cost for _, _, cost in own]
        name = front_name(front, pointing=spacecraft.goal.axis is not None).replace(" deg", "°")
        # A schedule serves for every later end, until a cheaper one does.
        times, levels = np.repeat([*ends, reach], 2)[1:], np.repeat([*costs, costs[-1]], 2)[:-1]
        axes.plot(times, levels, color=colour, linestyle=line)
        axes.plot(ends, costs, mark, color=colour, markersize=5, zorder=3.5, clip_on=False)
        axes.plot([], [], color=colour, linestyle=line, marker=mark, markersize=5, label=name)
        for index, end, cost in own:
            same = next((place for place in shown if _alike((end, cost), place[:2])), None)
            if same is None:
                shown.append((end, cost, [index]))
            else:
                same[2].append(index)
    failing = [(point.plan.pulses.end, scale * point.cost) for _, _, point in numbered(fronts) if fails(point)]
    if failing:
        axes.plot(*np.transpose(failing), "x", label=FAILS, **CROSS)
    places = np.array([place[:2] for place in shown])
    for row, (_, _, numbers) in enumerate(shown):
        meant = labels.Meant(places[[row]], np.delete(places, row, axis=0))
        labels.add(axes, ", ".join(map(str, numbers)), places[row], INK, role="vital", meant=meant)


def _alike(first: tuple[float, float], second: tuple[float, float]) -> bool:
    return all(math.isclose(a, b, rel_tol=near) for a, b, near in zip(first, second, ALIKE, strict=True))


ROWS = 6000
"""Moments of the envelope, over all windows."""

AFTER = 1.25
"""End of the time shown over the end of the last firing of the plan."""

TURNS = 2.0
"""Periods of the nutation that are shown at least."""

SHALLOW = 1e-3
"""Depth of the envelope below 0 that is the step of the linear program in time."""


@style.styled
def certificate_figure(proof: Certificate) -> Figure:
    """Envelope of 1 − q of all channels, as far as the plan fires, with the firings of program and plan.

    q is the worth of a second of firing over its cost, by the prices of the proof: where 1 − q > 0, to fire costs more
    than it is worth.
    """
    times = moments(proof)
    curves = [1.0 - proof.primer(span).max(axis=1) for span in times]
    figure = style.sheet(7.4, 3.9)
    axes = figure.subplots()
    for span, curve in zip(times, curves, strict=True):
        axes.plot(span, curve, color=MOTION, label="least 1 − q of all channels")
    last, later = float(times[-1][-1]), 0
    for name, fired, mark in _firings(proof):
        places = [(t, 1.0 - proof.primer(np.array([t]))[0, index]) for t, index in fired if t <= last]
        later += len(fired) - len(places)
        look = {"color": PULSE, "markersize": 5, "linestyle": "", "fillstyle": "none", "markeredgewidth": 1.3}
        axes.plot(*np.array(places).reshape(-1, 2).T, marker=mark, label=name, **look)  # type: ignore[arg-type]
    axes.axhline(0.0, color=GREY, linewidth=1.0)
    lowest = min(float(curve.min()) for curve in curves)
    axes.margins(x=0.02, y=0.08)
    axes.set(xlabel="time, s", ylabel="1 − q: cost less worth, over cost")
    text = "below 0 a firing would be worth more than it costs: nowhere here"
    if lowest < -SHALLOW:
        gain = written(proof.proof.gained, proof.problem.unit)
        text = f"below 0 a channel is on for long: the gain there, {gain}, is taken off the bound"
    text += f"; firings of the program after {style.number(last)} s: {later}" * bool(later)
    axes.set_title(text, loc="left", color=INK, **style.NOTE)
    axes.grid()
    style.legend(figure, [axes])
    bound = written(proof.bound, proof.problem.unit)
    style.heading(figure, proof.spacecraft, f"primer by the linear program of small angles\nsmall-angle bound {bound}")
    return figure


def moments(proof: Certificate) -> list[Vector]:
    """Moments (n,) s of each window that matters: until soon after the last firing of the plan."""
    shortest = TURNS * proof.spacecraft.body_period
    until = max(AFTER * proof.plan.pulses.end, min(shortest, proof.windows[-1][1]))
    spans = [(begins, min(ends, until)) for begins, ends in proof.windows if begins < until]
    pace = ROWS / max(sum(ends - begins for begins, ends in spans), 1e-9)
    return [np.linspace(begins, ends, int((ends - begins) * pace) + 2) for begins, ends in spans]


def _firings(proof: Certificate) -> list[tuple[str, list[tuple[float, int]], str]]:
    """Firings of the linear program and of the plan: moments, s, and channels, with name and mark."""
    names = [channel.name for channel in proof.program.channels]
    program = [(burn.t, names.index(burn.channel.name)) for burn in proof.burns]
    plan = [(pulse.t, names.index(pulse.channel)) for pulse in proof.plan.pulses]
    return [("firings of the program", program, "o"), ("firings of the plan", plan, "x")]
