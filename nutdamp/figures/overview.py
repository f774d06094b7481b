"""The pictures of a flight by their names, and the two planes of its motion; one of them shows all on one sheet.

The planes: pole curve in the body, axis track in space with H as an inset. ``track`` is a track of ``flight``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.figures import geometry, history, labels, sphere, style
from nutdamp.figures.style import FIRED, GREY, INK, MOMENTUM, MOTION, PULSE, THIN, TURNED
from nutdamp.flight import propagation
from nutdamp.flight.propagation import Flight, Track, model_name
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Vector
from nutdamp.views.spacecraft import angle_names, angle_texts

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

    from nutdamp.planning.plan import Plan


ROWS = 1000
"""Rows of the track of a plan; the figures draw a finer one where they need it."""

TALL = 4.0
"""Inches of the two planes of the motion on the sheet with all."""

ALIKE = math.radians(2.0)
"""Channels whose torques point within this angle share one arrow."""

NUMBERED = 17
"""Largest number of firings of a path that are numbered, and have arrowheads."""

CROWD, NEAR = 3, 0.05
"""Firings in a row that have one label, at least, each nearer to the one before than this part of the path's width."""

MANY, SPARSE = 12, 40
"""Numbers of firings above which lines and arrowheads are small, and up to which each has a dot."""

ROOM, INSET = 1.8, (0.675, 0.17, 0.315, 0.66)
"""Width of the axis track with an inset over that without, and the box of the inset as shares of the panel."""


@style.styled
def flight_figure(name: str, flight: Flight, track: Track, *, narrow: bool = False) -> Figure:
    """The figure ``overview``, ``motion``, ``sphere`` or ``history``; raises KeyError for others.

    Where the rows of ``track`` are too few for a smooth curve, a finer one is drawn. ``narrow``: for a phone, which has
    ``history`` alone. Raises MissingExtra without matplotlib.
    """
    seen = geometry.drawn(flight, track)
    figure = (NARROW if narrow else DRAWN)[name](flight, seen)
    until, end = float(seen.t[-1]), float(track.t[-1])
    part = f"; drawn: the first {until:.4g} s of {end:.4g} s" if until < 0.99 * end else ""
    style.heading(figure, flight.spacecraft, title(flight) + part)
    labels.settle(figure)
    return figure


def title(flight: Flight) -> str:
    """Heading of every sheet after the spacecraft's name: scheme, model and result."""
    left, count, body = flight.residual, len(flight.schedule), flight.spacecraft
    how = " ".join(filter(None, (flight.scheme, f"by {model_name([flight.schedule], flight.model)}")))
    fired = f"firings: {count} until {style.number(flight.schedule.end)} s" if count else "no firing"
    swings = "" if body.inertia.symmetric else "at most "  # between two angles, H standing still
    goal, turn = body.goal.axis, ""
    if goal is not None:
        angles = zip(angle_names(body), angle_texts(body, goal), strict=True)
        target = ", ".join(f"{name} {text.removesuffix(' deg').rstrip('0').rstrip('.')}°" for name, text in angles)
        turn = f"H turned {style.angle(body.to_turn)} to the target, {target}\n"
    result = f"nutation {swings}{style.angle(body.nutation)} → {style.angle(left.nutation)}"
    return f"{how}, {fired}\n{turn}{result}, {style.part_name(requirements.aim(body))} {style.angle(left.axis_error)}"


def overview(flight: Flight, track: Track) -> Figure:
    """Motion above history: one sheet of A4 across, or longer."""
    sizes = history.heights(flight, track)
    figure = style.sheet(9.6, TALL + 1.6 + sum(sizes))
    ratio = ROOM if geometry.momentum_inset(flight, track) is not None else 1.0
    grid = figure.add_gridspec(1 + len(sizes), 2, height_ratios=[TALL, *sizes], width_ratios=[1.0, ratio])
    planes(figure, (grid[0, 0], grid[0, 1]), flight, track)
    cells = [grid[row + 1, :] for row in range(len(sizes))]
    style.legend(figure, history.courses(figure, cells, flight, track))
    return figure


def motion(flight: Flight, track: Track) -> Figure:
    """Pole curve in the 1-2 plane of the body beside the axis track in space (Magnus 1970 fig. 5-8)."""
    wide = geometry.momentum_inset(flight, track) is not None
    figure = style.sheet(9.6 if wide else 7.4, 4.1)
    grid = figure.add_gridspec(1, 2, width_ratios=[1.0, ROOM if wide else 1.0])
    planes(figure, (grid[0], grid[1]), flight, track)
    return figure


def planes(figure: Figure, cells: Sequence[SubplotSpec], flight: Flight, track: Track) -> None:
    """The two panels in ``cells`` of a figure."""
    body, space = (figure.add_subplot(cell) for cell in cells)
    pole_curve(body, flight, track)
    axis_track(space, flight, track)


def pole_curve(axes: Axes, flight: Flight, track: Track) -> None:
    """Path of the rotation vector in the 1-2 plane of the body (Magnus 1970 fig. 5), firings and channels marked."""
    rates = geometry.pole_path(track)
    _path(axes, flight, track, rates)
    arrows = _directions(axes, flight, float(np.hypot(*rates.T).max()))
    style.square(axes, rates, margin=0.45 if arrows else 0.12, centre=True)
    title = "Pole curve: ω in the body" + ("\narrows: torque of the channels" if arrows else "")
    axes.set(xlabel=f"ω1, °/s{geometry.pole_note(flight)}", ylabel="ω2, °/s", title=title)


def axis_track(axes: Axes, flight: Flight, track: Track) -> None:
    """Path of the spin axis about the first direction of H, as angles, with the jumps of H (Magnus 1970 fig. 6-8).

    Where it is too wide for the path of H, that is shown enlarged in an inset.
    """
    path, momentum = geometry.sky_paths(flight, track)
    target, small = geometry.sky_target(flight, track), geometry.momentum_inset(flight, track)
    _path(axes, flight, track, path)
    places = _momentum(axes, flight, track, momentum, float(np.ptp(path, axis=0).max()))
    labels.target(axes, target)
    middle, half = style.square(axes, np.vstack([path, momentum, target]), margin=0.14)
    if small is None:
        labels.add(axes, "H", places[0], TURNED, role="vital")
    else:
        ticks = [tick for tick in axes.get_xticks() if abs(tick - middle[0]) <= half]
        axes.set_xlim(middle[0] - half, middle[0] + (2.0 * ROOM - 1.0) * half)
        axes.set_xticks(ticks)
        _inset(axes, flight, track, small)
    x, y, sense = geometry.sky_names(flight)
    axes.set(xlabel=x, ylabel=y, title=f"Axis track: spin axis in space\n{sense}")


def _inset(axes: Axes, flight: Flight, track: Track, small: Vector) -> None:
    """Path of H, enlarged, beside the axis track; ``small``: `geometry.momentum_inset`."""
    inset = axes.inset_axes(INSET)
    momentum = geometry.sky_paths(flight, track)[1]
    stations = _momentum(inset, flight, track, momentum, float(np.ptp(small, axis=0).max()))
    for number in style.thinned(len(stations) - 1, NUMBERED):
        labels.add(inset, str(number + 1), stations[number + 1], FIRED, meant=labels.meant(stations, [number + 1]))
    labels.add(inset, "t = 0", stations[0], INK, role="vital")
    labels.target(inset, geometry.sky_target(flight, track))
    style.square(inset, small, margin=0.25)
    inset.locator_params(nbins=3)
    inset.tick_params(labelsize=style.SMALL)
    much = min(INSET[2] * ROOM, INSET[3]) * float(np.ptp(axes.get_ylim()) / np.ptp(inset.get_ylim()))
    inset.set_title(f"H after each firing (× {much:.2g})", **style.NOTE)
    axes.indicate_inset_zoom(inset, edgecolor=GREY, linewidth=THIN, alpha=1.0)


def _momentum(axes: Axes, flight: Flight, track: Track, momentum: Vector, width: float) -> Vector:
    """The path of H, (n, 2) degrees, with its places at first and after each firing, which are returned."""
    axes.plot(*geometry.once(momentum).T, label="path of H", **style.PATH_OF_H)
    stations = [momentum[:1]]
    numbered = style.thinned(len(flight.schedule), NUMBERED)
    for stretch in geometry.stretches(flight, track):
        if stretch.pulse is not None:
            moved = _refined(momentum[stretch.first : stretch.last + 1])
            stations.append(moved[-1:])
            if stretch.pulse in numbered and np.hypot(*(moved[-1] - moved[0])) > 0.08 * width:
                style.heads(axes, moved, _halfway(moved), MOMENTUM)
    places = np.vstack(stations)
    marked = [row for row in range(len(places)) if len(places) <= SPARSE or row == 0 or row - 1 in numbered]
    look: dict[str, Any] = {"color": MOMENTUM, "markersize": 8, "markeredgewidth": 1.4, "zorder": 1.9}  # under firings
    axes.plot(*places[marked].T, "+", label="H", **look)
    return places


def _path(axes: Axes, flight: Flight, track: Track, points: Vector) -> None:
    """A path (n, 2) with its beginning, its sense, and its firings: numbered where there is room."""
    coasts: list[Vector] = []
    firings: list[Vector] = []
    width = float(np.ptp(points, axis=0).max())
    numbered = style.thinned(len(flight.schedule), NUMBERED)
    thin = min(style.thickness(points), THIN if len(flight.schedule) > MANY else style.LINE) / style.LINE
    size = 9.0 if thin == 1.0 else 5.5
    axes.axhline(0.0, color=GREY, linewidth=0.5)
    axes.axvline(0.0, color=GREY, linewidth=0.5)
    for stretch in geometry.stretches(flight, track):
        rows = points[stretch.first : stretch.last + 1]
        if stretch.pulse is None:
            coasts.append(rows)
            if len(firings) in numbered or len(firings) == len(flight.schedule):
                style.heads(axes, rows, _halfway(rows), MOTION, size)
            continue
        firings.append(rows)
        if stretch.pulse in numbered and np.hypot(*(rows[-1] - rows[0])) > 0.03 * width:
            style.heads(axes, _refined(rows), [len(_refined(rows)) - 1], PULSE, size)
    _number(axes, [_refined(rows) for rows in firings], width)
    axes.plot(*style.joined(coasts).T, color=MOTION, linewidth=thin * style.LINE, label="path")
    if firings:
        axes.plot(*style.joined(firings).T, color=PULSE, linewidth=max(2.2 * thin, style.LINE), label="firing")
        begins = [rows[0] for number, rows in enumerate(firings) if len(firings) <= SPARSE or number in numbered]
        axes.plot(*np.array(begins).T, ".", color=PULSE, markersize=5 if thin == 1.0 else 3)
    axes.plot(*points[0], "o", color=MOTION, markersize=4.5)
    axes.plot(*points[-1], "o", color=MOTION, markersize=5.5, markerfacecolor="none", markeredgewidth=1.2, label="end")
    labels.add(axes, "t = 0", points[0], INK, role="vital")
    if firings:
        labels.add(axes, "end", points[-1], INK)


def _number(axes: Axes, firings: Sequence[Vector], width: float) -> None:
    """Numbers of firings beside their stretches of a path, (n, 2) each; first and last of those in one place."""
    some = [rows[:: max(len(rows) // 20, 1)] for rows in firings]
    for group in together([rows[len(rows) // 2] for rows in firings], width):
        own, first, last = np.vstack([some[number] for number in group]), group[0] + 1, group[-1] + 1
        others = [rows for other, rows in enumerate(some) if other not in group]
        meant = labels.Meant(own, np.vstack([np.empty((0, 2)), *others]))
        middle = firings[group[len(group) // 2]]
        text = f"{'firing ' * (first == 1)}{first}" + (f"\N{EN DASH}{last}" if first != last else "")
        labels.add(axes, text, middle[len(middle) // 2], FIRED, meant=meant)


def together(places: Sequence[Vector], width: float) -> list[list[int]]:
    """The firings to be numbered, from 0: `CROWD` or more in a row, each near the one before, have one label."""
    numbered = style.thinned(len(places), NUMBERED)
    if len(numbered) < len(places):
        return [[number] for number in numbered]
    return geometry.runs(numbered, lambda a, b: bool(np.hypot(*(places[b] - places[a])) < NEAR * width), CROWD)


def _refined(rows: Vector) -> Vector:
    """A path of some rows at least: an impulse has only its two ends."""
    return rows if len(rows) > 2 else np.linspace(rows[0], rows[-1], 21)


def _halfway(rows: Vector) -> list[int]:
    """Row of a stretch where an arrowhead goes: half a turn into it at most."""
    steps = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rows, axis=0).T))])
    width = float(np.ptp(rows, axis=0).max())
    if steps[-1] <= 0.0:
        return []
    return [int(np.searchsorted(steps, min(0.5 * float(steps[-1]), 1.3 * width)))]


def _directions(axes: Axes, flight: Flight, size: float) -> bool:
    """Torque directions of the channels, as arrows outside the curve; True where there are any."""
    used = {pulse.channel for pulse in flight.schedule}
    channels = [entry for entry in flight.spacecraft.channels if entry.damps and (entry.name in used or not used)]
    channels = channels or [entry for entry in flight.spacecraft.channels if entry.name in used]
    groups: list[list[Channel]] = []
    for channel in channels:
        across = channel.transverse.conjugate()
        group = next((group for group in groups if abs(np.angle(group[0].transverse * across)) < ALIKE), None)
        if group is None:
            groups.append([channel])
        else:
            group.append(channel)
    for group in groups:
        torque = group[0].transverse / abs(group[0].transverse)
        way = np.array([torque.real, torque.imag]) * (size if size > geometry.LEAST else 0.7)
        axes.plot(*np.outer(way, [1.1, 1.28]), color=INK, linewidth=1.2)
        style.heads(axes, np.outer([1.1, 1.3], way), [1], INK)
        names = ", ".join(entry.name for entry in group[:3]) + (" …" if len(group) > 3 else "")
        labels.add(axes, names, 1.2 * way, INK, role="vital")
    return bool(groups)


DRAWN = {"overview": overview, "motion": motion, "sphere": sphere.sphere, "history": history.history}
NARROW = {"history": partial(history.history, narrow=True)}


def shown(plan: Plan) -> tuple[Flight, Track]:
    """A plan flown through its real widths as far as its pictures reach."""
    end = geometry.shown_until(plan.spacecraft, plan.pulses)
    flown = replace(propagation.flown(plan.spacecraft, plan.pulses, end), scheme=plan.scheme)
    return flown, flown.sampled(ROWS, end)


def until(flight: Flight) -> float:
    """End of the time axis of a flight, s: that of the flight where it was named, else `geometry.shown_until`."""
    usual = flight.schedule.end + flight.spacecraft.inertial_period
    return flight.shown_to if flight.shown_to != usual else geometry.shown_until(flight.spacecraft, flight.schedule)
