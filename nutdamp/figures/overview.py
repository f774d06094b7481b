"""The overview of a plan: pole curve, axis track and globe above the course of the motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.figures import geometry, sphere, style
from nutdamp.figures.style import FIRED, GREY, INK, MOMENTUM, MOTION, PAPER, PULSE, THIN
from nutdamp.flight.propagation import Flight, Track, model_name
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Vector
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.views.parts import by_the_sun, direction_columns
from nutdamp.views.text import duration, steering
from nutdamp.views.verdict import stated

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

    from nutdamp.planning.plan import Plan
    from nutdamp.planning.verdict import Verdict

ROWS = 1000  # rows of the track of a plan; the figures draw a finer one where they need it
TALL = 4.0  # inches of the two planes of the motion on the sheet with all
BROAD = 12.0  # width of the sheet with the globe, inches: its panels are as large as without
ALIKE = math.radians(2.0)  # channels whose torques point within this angle share one arrow
ACROSS = 1e-9  # transverse over axial torque below which it has no direction to be drawn
NUMBERED = 17  # largest number of firings of a path that are numbered, and have arrowheads

CROWD, NEAR = 3, 0.05
"""Firings in a row that have one label, at least, each nearer to the one before than this part of
the path's width.
"""

MANY, SPARSE = (
    12,
    40,
)  # numbers of firings above which lines and arrowheads are small, and up to which each has a dot

NO_OUTLINES: Mapping[str, Vector] = MappingProxyType({})  # of an axis track without a verdict


@style.styled()
def flight_figure(
    name: str,
    flight: Flight,
    track: Track,
    judged: Verdict | None = None,
    *,
    box: Callable[[Axes], None] | None = None,
    outlines: Mapping[str, Vector] = NO_OUTLINES,
    narrow: bool = False,
) -> Figure:
    """The figure ``overview``, ``motion`` or ``course``, that of the first screen of the report,
    with the verdict on its plan; raises KeyError for others.

    Where the rows of ``track`` are too few for a smooth curve, a finer one is drawn. ``box`` draws
    the first panel of the overview of a plan, in place of the pole curve. A course has the
    ``outlines`` of `studies.accepted` on its axis track; ``narrow``: it is for a phone.
    Raises MissingExtra without matplotlib.
    """
    drawings: dict[str, Callable[[Flight, Track], Figure]] = {
        "overview": partial(overview, box=box),
        "motion": motion,
        "course": partial(course, outlines=outlines, narrow=narrow),
    }
    draw = drawings[name]
    seen = geometry.drawn(flight, track)
    until, end = float(seen.t[-1]), float(track.t[-1])
    drawn = f"; drawn: the first {duration(until)} of {duration(end)}"
    part = drawn if until < 0.99 * end else ""
    told = None if judged is None else stated(judged)
    return style.finished(draw(flight, seen), flight.spacecraft, title(flight) + part, told)


def title(flight: Flight) -> str:
    """Heading of every sheet after the spacecraft's name: scheme, model and result."""
    left = flight.residual
    count = len(flight.schedule)
    spacecraft = flight.spacecraft
    how = " ".join(
        filter(None, (flight.scheme, f"by {model_name([flight.schedule], flight.model)}"))
    )
    fired = f"firings: {count} until {duration(flight.schedule.end)}" if count else "no firing"
    swings = (
        "" if spacecraft.inertia.symmetric else "at most "
    )  # between two angles, H standing still
    goal = spacecraft.goal.axis
    turn = ""
    if goal is not None:
        target = ", ".join(
            f"{column.heading} {column.shown(goal).rstrip('0').rstrip('.')}°"
            for column in direction_columns(spacecraft)
        )
        target += by_the_sun(spacecraft)
        turn = f"H turned {style.angle(spacecraft.to_turn)} to the target, {target}\n"
    result = f"nutation {swings}{style.angle(spacecraft.nutation)} → {style.angle(left.nutation)}"
    return (
        f"{how}, {fired}\n{turn}{result}, {requirements.aim(spacecraft).label} "
        f"{style.angle(left.axis_error)}"
    )


def overview(flight: Flight, track: Track, *, box: Callable[[Axes], None] | None = None) -> Figure:
    """Motion, and the globe where it has something to show, above history."""
    courses = _courses(flight, track)
    sizes = [*courses.values()]
    globe = sphere.has_globe(flight, track)
    figure = style.sheet(BROAD if globe else 9.6, TALL + 1.6 + sum(sizes))
    grid = figure.add_gridspec(1 + len(sizes), 2 + globe, height_ratios=[TALL, *sizes])
    first = figure.add_subplot(grid[0, 0])
    if box is None:
        _pole_curve(first, flight, track)
    else:
        box(first)
    _axis_track(figure.add_subplot(grid[0, 1]), flight, track)
    if globe:
        sphere.draw_globe(figure.add_subplot(grid[0, 2]), flight, track)
    _draw_courses(figure, [grid[row + 1, :] for row in range(len(sizes))], flight, track, courses)
    return figure


def motion(flight: Flight, track: Track) -> Figure:
    """Pole curve in the 1-2 plane of the body beside the axis track in space (Magnus 1970 fig.
    5-8).
    """
    figure = style.sheet(7.4, 4.1)
    pole, sky = figure.subplots(1, 2)
    _pole_curve(pole, flight, track)
    _axis_track(sky, flight, track)
    return figure


def _pole_curve(axes: Axes, flight: Flight, track: Track) -> None:
    """Path of the rotation vector in the 1-2 plane of the body (Magnus 1970 fig. 5), firings and
    channels marked.
    """
    rates = geometry.pole_path(track)
    _path(axes, flight, track, rates)
    arrows = _directions(axes, flight, float(np.abs(rates).max()))
    style.square(axes, rates, margin=0.45 if arrows else 0.12, centre=True)
    title = "Pole curve: ω in the body" + ("\narrows: torque of the channels" if arrows else "")
    axes.set(xlabel=f"ω1, °/s{geometry.pole_note(flight)}", ylabel="ω2, °/s", title=title)


def _axis_track(
    axes: Axes, flight: Flight, track: Track, outlines: Mapping[str, Vector] = NO_OUTLINES
) -> None:
    """Path of the spin axis about the first H, as angles, and of H (Magnus 1970 fig. 6-8), with
    ``outlines`` of where H may end.
    """
    path, momentum = geometry.sky_paths(flight, track)
    target = geometry.sky_target(flight, track)
    _path(axes, flight, track, path)
    _momentum(axes, flight, track, momentum, float(np.ptp(path, axis=0).max()))
    style.target(axes, target)
    for name, outline in outlines.items():
        axes.plot(*outline.T, **ACCEPTED[name])
    style.square(axes, np.vstack([path, momentum, target]), margin=0.14)
    x, y, sense = geometry.sky_names(flight)
    axes.set(xlabel=x, ylabel=y, title=f"Axis track: spin axis in space\n{sense}")


ACCEPTED: dict[str, dict[str, Any]] = {
    "limit": {**style.LIMIT, "label": "H may end within"},
    "contour": {"color": MOMENTUM, "linewidth": 1.5, "label": "H ends within, cases required"},
}
"""Looks of the lines of `studies.accepted`."""


def _momentum(axes: Axes, flight: Flight, track: Track, momentum: Vector, width: float) -> None:
    """The path of H, (n, 2) degrees, with its places at first and after each firing."""
    axes.plot(*geometry.once(momentum).T, label="path of H", **style.PATH_OF_H)
    stations = [momentum[:1]]
    numbered = style.thinned(len(flight.schedule), NUMBERED)
    for stretch in geometry.stretches(flight, track):
        if stretch.pulse is not None:
            moved = _refined(momentum[stretch.first : stretch.last + 1])
            stations.append(moved[-1:])
            if stretch.pulse in numbered and np.hypot(*(moved[-1] - moved[0])) > 0.08 * width:
                style.head(axes, moved, _halfway(moved), MOMENTUM)
    places = np.vstack(stations)
    marked = [
        row
        for row in range(len(places))
        if len(places) <= SPARSE or row == 0 or row - 1 in numbered
    ]
    axes.plot(
        *places[marked].T,
        "+",
        label="H",
        color=MOMENTUM,
        markersize=8,
        markeredgewidth=1.4,
        zorder=1.9,  # under firings
    )


def _path(axes: Axes, flight: Flight, track: Track, points: Vector) -> None:
    """A path (n, 2) with its beginning, its sense, and its firings:
    numbered where there is room.
    """
    coasts: list[Vector] = []
    firings: list[Vector] = []
    width = float(np.ptp(points, axis=0).max())
    numbered = style.thinned(len(flight.schedule), NUMBERED)
    thin = (
        min(style.thickness(points), THIN if len(flight.schedule) > MANY else style.LINE)
        / style.LINE
    )
    size = 9.0 if thin == 1.0 else 5.5
    axes.axhline(0.0, color=GREY, linewidth=0.5)
    axes.axvline(0.0, color=GREY, linewidth=0.5)
    for stretch in geometry.stretches(flight, track):
        rows = points[stretch.first : stretch.last + 1]
        if stretch.pulse is None:
            coasts.append(rows)
            if len(firings) in numbered or len(firings) == len(flight.schedule):
                style.head(axes, rows, _halfway(rows), MOTION, size)
            continue
        firings.append(rows)
        if stretch.pulse in numbered and np.hypot(*(rows[-1] - rows[0])) > 0.03 * width:
            style.head(axes, _refined(rows), len(_refined(rows)) - 1, PULSE, size)
    refined = [_refined(rows) for rows in firings]
    # First and last number of those in one place, beside the middle one.
    for group in together([rows[len(rows) // 2] for rows in refined], width):
        first = group[0] + 1
        last = group[-1] + 1
        middle = refined[group[len(group) // 2]]
        numbers = str(first) if first == last else f"{first}\N{EN DASH}{last}"
        text = f"firing {numbers}" if first == 1 else numbers
        style.add(axes, text, middle[len(middle) // 2], FIRED)
    axes.plot(*style.joined(coasts).T, color=MOTION, linewidth=thin * style.LINE, label="path")
    if firings:
        axes.plot(
            *style.joined(firings).T,
            color=PULSE,
            linewidth=max(2.2 * thin, style.LINE),
            label="firing",
        )
        begins = [
            rows[0]
            for number, rows in enumerate(firings)
            if len(firings) <= SPARSE or number in numbered
        ]
        axes.plot(*np.array(begins).T, ".", color=PULSE, markersize=5 if thin == 1.0 else 3)
    axes.plot(*points[0], "o", color=MOTION, markersize=4.5, label="t = 0")
    axes.plot(
        *points[-1],
        "o",
        color=MOTION,
        markersize=5.5,
        markerfacecolor="none",
        markeredgewidth=1.2,
        label="end",
    )


def together(places: Sequence[Vector], width: float) -> list[list[int]]:
    """The firings to be numbered, from 0: `CROWD` or more in a row, each near the one before, have
    one label.
    """
    numbered = style.thinned(len(places), NUMBERED)
    if len(numbered) < len(places):
        return [[number] for number in numbered]
    return geometry.runs(
        numbered, lambda a, b: bool(np.hypot(*(places[b] - places[a])) < NEAR * width), CROWD
    )


def _refined(rows: Vector) -> Vector:
    """A path of some rows at least: an impulse has only its two ends."""
    return rows if len(rows) > 2 else np.linspace(rows[0], rows[-1], 21)


def _halfway(rows: Vector) -> int:
    """Row of a stretch where an arrowhead goes: half a turn into it at most."""
    steps = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rows, axis=0).T))])
    width = float(np.ptp(rows, axis=0).max())
    return int(np.searchsorted(steps, min(0.5 * float(steps[-1]), 1.3 * width)))


def _directions(axes: Axes, flight: Flight, size: float) -> bool:
    """Torque directions of the channels, as arrows outside the curve; True where there are any."""
    used = {pulse.channel for pulse in flight.schedule}
    fired = [entry for entry in flight.spacecraft.channels if entry.name in used or not used]
    # Where only channels for the spin fire, those that push across the axis beyond rounding.
    across = [entry for entry in fired if abs(entry.transverse) > ACROSS * abs(entry.axial)]
    channels = [entry for entry in fired if entry.damps] or (across if used else [])
    groups: list[list[Channel]] = []
    for channel in channels:
        back = channel.transverse.conjugate()
        alike = (entry for entry in groups if abs(np.angle(entry[0].transverse * back)) < ALIKE)
        group = next(alike, [])
        if not group:
            groups.append(group)
        group.append(channel)
    for group in groups:
        torque = group[0].transverse / abs(group[0].transverse)
        way = np.array([torque.real, torque.imag]) * (size if size > geometry.LEAST else 0.7)
        axes.plot(*np.outer(way, [1.1, 1.28]), color=INK, linewidth=1.2)
        style.head(axes, np.outer([1.1, 1.3], way), 1, INK)
        names = ", ".join(entry.name for entry in group[:3]) + (" …" if len(group) > 3 else "")
        style.add(axes, names, 1.2 * way, INK, role="vital")
    return bool(groups)


def shown(plan: Plan) -> tuple[Flight, Track]:
    """A plan flown through its real widths as far as its pictures reach."""
    end = geometry.shown_until(plan.spacecraft, plan.pulses)
    flown = plan._reaching(end)
    return flown, flown.sampled(ROWS, end)


def until(flight: Flight) -> float:
    """End of the time axis of a flight, s: that of the flight where it was named, else
    `geometry.shown_until`.
    """
    usual = flight.spacecraft.watched_until(flight.schedule.end)
    return (
        flight.shown_to
        if flight.shown_to != usual
        else geometry.shown_until(flight.spacecraft, flight.schedule)
    )


TIME = "time, s"  # label of time axes
# largest number of decades of the nutation on a log axis, unless the requirement lies lower
DECADES = 4.0
EDGE = 0.012  # room before t = 0, as a part of the time shown, so that events at t = 0 are seen

FULL, PALE = 0.9, 0.35
"""Share of a bar that several firings must fill to be drawn as one, and how dense it is drawn where
they do not.
"""

RATES = (("ω1", MOTION, (0, (6, 1.5, 1, 1.5))), ("ω2", INK, (0, (4, 1.5))))
"""Rates across the axis, with colours and dashes: θ alone is a blue line without a gap."""

BAR = 0.46  # height of a bar; the distance between two rows is 1
CHANGES = 1e-3  # share of the largest ω3 from which on its change is drawn


def _courses(
    flight: Flight, track: Track, *, rates: bool = True
) -> dict[Callable[[Axes, Flight, Track], None], float]:
    """The panels over time and the height of each, inches: nutation, firings, ω1 and ω2 for
    ``rates``, and ω3 where it changes.
    """
    spin = track.rates[:, 2]
    courses: dict[Callable[[Axes, Flight, Track], None], float] = {nutation_history: 1.9}
    for height in firings_height(flight):
        courses[lambda axes, flight, track: firings(axes, flight, float(track.t[-1]))] = height
    if rates:
        courses[_rate_history] = 1.5
    if float(np.ptp(spin)) > CHANGES * float(np.abs(spin).max()):
        courses[_spin_history] = 0.9
    return courses


def firings_height(flight: Flight) -> list[float]:
    """Inches of the panel of `firings`, for each row a bar, its number, and room; empty where
    nothing fires.
    """
    rows = len(geometry.channels_fired(flight))
    return [0.3 + 0.36 * rows] if rows else []


def course(flight: Flight, track: Track, *, outlines: Mapping[str, Vector], narrow: bool) -> Figure:
    """Axis track beside nutation, firings and changing spin; ``narrow``: above them."""
    courses = _courses(flight, track, rates=False)
    sizes = [*courses.values()]
    if narrow:
        figure = style.sheet(style.PHONE, 4.4 + sum(sizes))
        grid = figure.add_gridspec(1 + len(sizes), 1, height_ratios=[3.4, *sizes])
        track_cell, cells = grid[0], [grid[row + 1] for row in range(len(sizes))]
    else:
        figure = style.sheet(7.4, max(4.6, 1.4 + sum(sizes)))
        grid = figure.add_gridspec(len(sizes), 2, height_ratios=sizes)
        track_cell, cells = grid[:, 0], [grid[row, 1] for row in range(len(sizes))]
    _axis_track(figure.add_subplot(track_cell), flight, track, outlines)
    _draw_courses(figure, cells, flight, track, courses)
    return figure


def _draw_courses(
    figure: Figure,
    cells: Sequence[SubplotSpec],
    flight: Flight,
    track: Track,
    courses: Iterable[Callable[[Axes, Flight, Track], None]],
) -> None:
    """The panels over time in ``cells`` of a figure, from above, with the legend of all panels."""
    panels: list[Axes] = []
    for cell, draw in zip(cells, courses, strict=True):
        panels.append(figure.add_subplot(cell, sharex=panels[0] if panels else None))
        draw(panels[-1], flight, track)
        panels[-1].tick_params(labelbottom=len(panels) == len(cells))
    panels[-1].set_xlabel(TIME)
    style.legend(figure, figure.axes)


def nutation_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Nutation θ on a log axis with the band that is required, and its last value."""
    angles = np.degrees(track.nutation)
    limit = style.limit_of(flight.spacecraft, Part.NUTATION)
    most = max(float(angles.max()), geometry.LEAST)
    bound = math.inf if limit is None else limit
    low = max(
        0.5 * min(float(angles.min()), bound, 0.1 * most), min(most * 10.0**-DECADES, 0.1 * bound)
    )
    if limit is not None:
        axes.axhspan(0.0, limit, zorder=0.4, **style.BAND)
        axes.axhline(limit, **style.LIMIT)
    axes.plot(track.t, np.where(angles > low, angles, 0.1 * low), color=MOTION, label="nutation θ")
    _bands(axes, flight, track)
    style.log_angles(axes, low, 2.0 * (most if limit is None else max(most, limit)))
    ended = float(angles[-1])
    mark = "o" if ended > low else "v"  # below the scale
    axes.plot(
        track.t[-1], max(ended, low), mark, color=MOTION, markerfacecolor=PAPER, clip_on=False
    )
    last = f"θ at {duration(float(track.t[-1]))}: {style.angle(float(track.nutation[-1]))}"
    axes.set_title(last, loc="right", color=INK, **style.NOTE)


def _rate_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Rates across the axis."""
    rates = np.degrees(track.rates)
    width = style.thickness(rates, float(track.t[-1]) / flight.spacecraft.body_period / 2.5)
    for row, (name, colour, dashes) in enumerate(RATES):
        axes.plot(
            track.t, rates[:, row], color=colour, linewidth=width, linestyle=dashes, label=name
        )
    half = 1.12 * max(float(np.abs(rates[:, :2]).max()), geometry.LEAST)
    axes.set(ylim=(-half, half), ylabel="ω1, ω2, °/s")
    _bands(axes, flight, track)


def _spin_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Rate about the axis."""
    axes.plot(track.t, np.degrees(track.rates[:, 2]), color=MOTION, label="_ω3")
    axes.margins(y=0.12)
    axes.locator_params(axis="y", nbins=3)
    axes.set_ylabel("ω3, °/s")
    _bands(axes, flight, track)


def _bands(axes: Axes, flight: Flight, track: Track) -> None:
    """Time axis, grid, and bands of the firings."""
    until = float(track.t[-1])
    axes.set_xlim(-EDGE * until, until)
    axes.grid(visible=True)
    for number, block in enumerate(geometry.blocks(flight, until)):
        axes.axvspan(
            block.begins,
            block.ends,
            label=None if number else "firing",
            facecolor=(PULSE, 0.25),
            edgecolor=PULSE,
            linewidth=0.6,
            zorder=0.5,
        )


def firings(axes: Axes, flight: Flight, until: float) -> None:
    """A bar for each firing, in the row of its channel; times when nothing may fire are hatched,
    beside the labels.
    """
    names = geometry.channels_fired(flight)
    rows = {name: len(names) - 1 - index for index, name in enumerate(names)}
    axes.set_xlim(-EDGE * until, until)
    axes.set_ylim(-0.5, max(len(names), 1) + 0.25)
    for begins, ends in geometry.closed(flight.spacecraft, until):
        for row in rows.values():
            axes.broken_barh(
                [(begins, ends - begins)],
                (row - 0.5 * BAR, BAR),
                facecolor="none",
                edgecolor=GREY,
                hatch="////",
                linewidth=0.0,
                label="must not fire",
            )
    bars = (
        (block, row) for name, row in rows.items() for block in geometry.blocks(flight, until, name)
    )
    for block, row in sorted(bars):
        _bar(axes, flight, block, row)
    axes.set_yticks(list(rows.values()), list(rows))
    axes.grid(axis="x")
    notes = []
    if any(pulse.through_valve for pulse in flight.schedule):
        notes.append("effective on-times, not the commands")
    if any(pulse.channel == STEERABLE for pulse in flight.schedule):
        notes.append("angles: torque from body axis +1")
    axes.set_title("; ".join(notes), loc="right", **style.NOTE)


def _bar(axes: Axes, flight: Flight, block: geometry.FiredBlock, row: int) -> None:
    """The bar of a firing, or of several that cannot be distinguished: paler where they do not fill
    it.
    """
    size = block.ends - block.begins
    dense = block.many == 1 or block.on > FULL * size
    axes.broken_barh(
        [(block.begins, size)],
        (row - 0.5 * BAR, BAR),
        facecolor=PULSE if dense else (PULSE, PALE),
        edgecolor=PULSE,
        linewidth=0.8,
        label=None if dense else "firings too close to be distinguished",
    )
    how = f"{style.number(block.on)} s"
    pulse = flight.schedule.pulses[block.first - 1]
    if block.many == 1:
        how = how if pulse.on_time else f"{style.number(pulse.magnitude)} N m s"
        if pulse.channel == STEERABLE:
            how += f" at {steering(flight.spacecraft.inertia.in_file(pulse.impulse).tolist())}"
    place: Vector = np.array([block.begins + 0.5 * size, row + 0.5 * BAR])
    style.add(axes, f"{block.name}: {how}", place, INK, role="bar")


FIGURES = ("overview", "motion")  # those that `plan --figure` draws of any flight
