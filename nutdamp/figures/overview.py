"""The overview of a plan: pole curve, axis track and globe above the course of the motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.figures import geometry, style
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

    from nutdamp.planning.plan import Plan
    from nutdamp.planning.verdict import Verdict

FIGURES = ("overview", "motion")  # those that `plan --figure` draws of any flight
ROWS = 1000  # rows of the track of a plan; the figures draw a finer one where they need it

# Width of a sheet with so many planes of the motion, height of these and of titles and legend,
# inches: the planes are as large with the globe as without it.
SHEETS = {
    ("overview", 2): (9.6, 4.0, 1.6),
    ("overview", 3): (12.0, 4.0, 1.6),
    ("motion", 2): (7.4, 4.1, 0.0),
    ("course", 1): (style.PHONE, 3.4, 1.0),
}
ALIKE = math.radians(2.0)  # directions of torques are rounded to it: those alike share one arrow
ACROSS = 1e-9  # transverse over axial torque below which it has no direction to be drawn
NUMBERED = 17  # largest number of firings of a path that are numbered, and have arrowheads and dots
MANY = 12  # number of firings above which lines and arrowheads are small

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
    """The figure ``motion``: pole curve in the body beside the axis track in space (Magnus 1970
    fig. 5-8); ``overview``: both, and the globe where it has something to show, above the course of
    the motion; ``course``, of the first screen of the report: the axis track beside its course.
    With the verdict on the plan; raises KeyError for others.

    Where the rows of ``track`` are too few for a smooth curve, a finer one is drawn. ``box`` draws
    the first panel of the overview of a plan, in place of the pole curve. A course has the
    ``outlines`` of `studies.accepted` on its axis track; ``narrow``: it is for a phone.
    Raises MissingExtra without matplotlib.
    """
    seen = geometry.drawn(flight, track)
    pole = partial(_pole_curve, flight=flight, track=seen)
    sky = partial(_axis_track, flight=flight, track=seen, outlines=outlines)
    named: dict[str, list[Callable[[Axes], None]]] = {
        "overview": [box or pole, sky],
        "motion": [pole, sky],
        "course": [sky],
    }
    planes = named[name]
    if name == "overview" and geometry.has_globe(flight, seen):
        planes.append(partial(geometry.draw_globe, flight=flight, track=seen))
    courses = [] if name == "motion" else [*_courses(flight, seen, rates=name == "overview")]
    sizes = [height for _, height in courses]
    if name == "course" and not narrow:
        figure = style.sheet(7.4, max(4.6, 1.4 + sum(sizes)))
        grid = figure.add_gridspec(len(sizes), 2, height_ratios=sizes)
        above, below = [grid[:, 0]], [grid[row, 1] for row in range(len(sizes))]
    else:
        width, tall, more = SHEETS[name, len(planes)]
        figure = style.sheet(width, tall + more + sum(sizes))
        grid = figure.add_gridspec(1 + len(sizes), len(planes), height_ratios=[tall, *sizes])
        above = [grid[0, column] for column in range(len(planes))]
        below = [grid[row + 1, :] for row in range(len(sizes))]
    for cell, draw in zip(above, planes, strict=True):
        draw(figure.add_subplot(cell))
    timed: list[Axes] = []
    for cell, (draw, _) in zip(below, courses, strict=True):
        timed.append(figure.add_subplot(cell, sharex=timed[0] if timed else None))
        draw(timed[-1])
        timed[-1].tick_params(labelbottom=len(timed) == len(below))
    if timed:
        timed[-1].set_xlabel(TIME)
        style.legend(figure, figure.axes)
    until, end = float(seen.t[-1]), float(track.t[-1])
    drawn = f"; drawn: the first {duration(until)} of {duration(end)}"
    told = None if judged is None else stated(judged)
    about = title(flight) + (drawn if until < 0.99 * end else "")
    return style.finished(figure, flight.spacecraft, about, told)


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


def _pole_curve(axes: Axes, flight: Flight, track: Track) -> None:
    """Path of the rotation vector in the 1-2 plane of the body (Magnus 1970 fig. 5), firings and
    channels marked.
    """
    rates = np.degrees(track.rates[:, :2])
    _path(axes, flight, track, rates)
    arrows = _directions(axes, flight, float(np.abs(rates).max()))
    style.square(axes, rates, margin=0.45 if arrows else 0.12, centre=True)
    said = "\narrows: torque of the channels" if arrows else ""
    axes.set(
        xlabel=f"ω1, °/s{geometry.pole_note(flight)}",
        ylabel="ω2, °/s",
        title=f"Pole curve: ω in the body{said}",
    )


def _axis_track(axes: Axes, flight: Flight, track: Track, outlines: Mapping[str, Vector]) -> None:
    """Path of the spin axis about the first H, as angles, and of H with its places at first and
    after each firing (Magnus 1970 fig. 6-8), with ``outlines`` of where H may end.
    """
    path, momentum, target = geometry.sky_paths(flight, track)
    _path(axes, flight, track, path)
    width = float(np.ptp(path, axis=0).max())
    axes.plot(*momentum.T, label="path of H", **style.PATH_OF_H)
    stations = [momentum[0]]
    numbered = style.thinned(len(flight.schedule), NUMBERED)
    for rows, pulse in geometry.stretches(flight, track):
        if pulse in numbered:
            moved = _refined(momentum[rows])
            stations.append(moved[-1])
            if np.hypot(*(moved[-1] - moved[0])) > 0.08 * width:
                style.head(axes, moved, _halfway(moved), MOMENTUM)
    axes.plot(
        *np.array(stations).T,
        "+",
        label="H",
        color=MOMENTUM,
        markersize=8,
        markeredgewidth=1.4,
        zorder=1.9,  # under firings
    )
    style.target(axes, target)
    for name, outline in outlines.items():
        axes.plot(*outline.T, **ACCEPTED[name])
    style.square(axes, np.vstack([path, momentum, target]), margin=0.14)
    x, y, sense = geometry.sky_names(flight)
    axes.set(xlabel=x, ylabel=y, title=f"Axis track: spin axis in space\n{sense}")


# looks of the lines of `studies.accepted`
ACCEPTED: dict[str, dict[str, Any]] = {
    "limit": {**style.LIMIT, "label": "H may end within"},
    "contour": {"color": MOMENTUM, "linewidth": 1.5, "label": "H ends within, cases required"},
}


def _path(axes: Axes, flight: Flight, track: Track, points: Vector) -> None:
    """A path (n, 2) with its beginning, its sense, and its firings:
    numbered where there is room.
    """
    coasts: list[Vector] = []
    firings: list[Vector] = []
    width = float(np.ptp(points, axis=0).max())
    count = len(flight.schedule)
    numbered = style.thinned(count, NUMBERED)
    thin = min(style.thickness(points), THIN if count > MANY else style.LINE) / style.LINE
    size = 9.0 if thin == 1.0 else 5.5
    axes.axhline(0.0, color=GREY, linewidth=0.5)
    axes.axvline(0.0, color=GREY, linewidth=0.5)
    for rows, pulse in geometry.stretches(flight, track):
        part = points[rows]
        if pulse is None:
            coasts.append(part)
            if len(firings) in (*numbered, count):
                style.head(axes, part, _halfway(part), MOTION, size)
            continue
        firings.append(part)
        if pulse in numbered:
            fine = _refined(part)
            if np.hypot(*(fine[-1] - fine[0])) > 0.03 * width:
                style.head(axes, fine, len(fine) - 1, PULSE, size)
            text = str(pulse + 1) if pulse else "firing 1"
            style.add(axes, text, fine[len(fine) // 2], FIRED)
    axes.plot(*style.joined(coasts).T, color=MOTION, linewidth=thin * style.LINE, label="path")
    if firings:
        wide = max(2.2 * thin, style.LINE)
        axes.plot(*style.joined(firings).T, color=PULSE, linewidth=wide, label="firing")
        begins = [rows[0] for number, rows in enumerate(firings) if number in numbered]
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
    groups: dict[int, list[Channel]] = {}
    for channel in [entry for entry in fired if entry.damps] or (across if used else []):
        turn = round(float(np.angle(channel.transverse)) / ALIKE)
        groups.setdefault(turn % round(2.0 * math.pi / ALIKE), []).append(channel)
    for group in groups.values():
        torque = group[0].transverse / abs(group[0].transverse)
        way = np.array([torque.real, torque.imag]) * (size if size > style.LEAST else 0.7)
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

# share of a bar that several firings must fill to be drawn as one, and how dense it is drawn where
# they do not
FULL, PALE = 0.9, 0.35
BAR = 0.46  # height of a bar; the distance between two rows is 1
CHANGES = 1e-3  # share of the largest ω3 from which on its change is drawn

# Rates by their axis, with names, colours and dashes: θ alone is a blue line without a gap in a
# legend.
RATES: dict[int, tuple[str, str, Any]] = {
    0: ("ω1", MOTION, (0, (6, 1.5, 1, 1.5))),
    1: ("ω2", INK, (0, (4, 1.5))),
    2: ("_ω3", MOTION, "-"),
}


def _courses(
    flight: Flight, track: Track, *, rates: bool
) -> Iterator[tuple[Callable[[Axes], None], float]]:
    """The panels over time and the height of each, inches: nutation, firings, ω1 and ω2 for
    ``rates``, and ω3 where it changes.
    """
    spin = track.rates[:, 2]
    yield partial(nutation_history, flight=flight, track=track), 1.9
    for height in firings_height(flight):
        yield partial(firings, flight=flight, until=float(track.t[-1])), height
    if rates:
        yield partial(_rate_history, flight=flight, track=track, parts=(0, 1)), 1.5
    if float(np.ptp(spin)) > CHANGES * float(np.abs(spin).max()):
        yield partial(_rate_history, flight=flight, track=track, parts=(2,)), 0.9


def firings_height(flight: Flight) -> list[float]:
    """Inches of the panel of `firings`, for each row a bar, its number, and room; empty where
    nothing fires.
    """
    rows = len(geometry.channels_fired(flight))
    return [0.3 + 0.36 * rows] if rows else []


def nutation_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Nutation θ on a log axis with the band that is required, and its last value."""
    angles = np.degrees(track.nutation)
    limit = style.limit_of(flight.spacecraft, Part.NUTATION)
    most = max(float(angles.max()), style.LEAST)
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


def _rate_history(axes: Axes, flight: Flight, track: Track, parts: tuple[int, ...]) -> None:
    """Rates about the axes ``parts``, from 0."""
    rates = np.degrees(track.rates)
    rates[np.abs(rates) < style.LEAST] = 0.0
    turns = float(track.t[-1]) / flight.spacecraft.body_period / 2.5
    width = style.thickness(rates, turns) if len(parts) > 1 else style.LINE
    for part in parts:
        name, colour, dashes = RATES[part]
        axes.plot(
            track.t, rates[:, part], color=colour, linewidth=width, linestyle=dashes, label=name
        )
    axes.margins(y=0.12)
    axes.locator_params(axis="y", nbins=4)
    axes.set_ylabel(f"{', '.join(f'ω{part + 1}' for part in parts)}, °/s")
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
    """A bar for each firing, in the row of its channel, or for several that cannot be
    distinguished: paler where they do not fill it. Times when nothing may fire are hatched, beside
    the labels.
    """
    names = geometry.channels_fired(flight)
    rows = {name: len(names) - 1 - index for index, name in enumerate(names)}
    axes.set_xlim(-EDGE * until, until)
    axes.set_ylim(-0.5, max(len(names), 1) + 0.25)
    closed = [(begin, end - begin) for begin, end in geometry.closed(flight.spacecraft, until)]
    for name, row in rows.items():
        level = (row - 0.5 * BAR, BAR)
        for span in closed:
            axes.broken_barh(
                [span],
                level,
                facecolor="none",
                edgecolor=GREY,
                hatch="////",
                linewidth=0.0,
                label="must not fire",
            )
        for block in geometry.blocks(flight, until, name):
            size = block.ends - block.begins
            dense = block.many == 1 or block.on > FULL * size
            axes.broken_barh(
                [(block.begins, size)],
                level,
                facecolor=PULSE if dense else (PULSE, PALE),
                edgecolor=PULSE,
                linewidth=0.8,
                label=None if dense else "firings too close to be distinguished",
            )
            how = f"{style.number(block.on)} s"
            pulse = flight.schedule.pulses[block.first - 1]
            if block.many == 1 and not pulse.on_time:
                how = f"{style.number(pulse.magnitude)} N m s"
            if block.many == 1 and pulse.channel == STEERABLE:
                how += f" at {steering(flight.spacecraft.inertia.in_file(pulse.impulse).tolist())}"
            place = np.array([block.begins + 0.5 * size, row + 0.5 * BAR])
            style.add(axes, f"{block.name}: {how}", place, INK, role="bar")
    axes.set_yticks(list(rows.values()), list(rows))
    axes.grid(axis="x")
    notes = []
    if any(pulse.through_valve for pulse in flight.schedule):
        notes.append("effective on-times, not the commands")
    if any(pulse.channel == STEERABLE for pulse in flight.schedule):
        notes.append("angles: torque from body axis +1")
    axes.set_title("; ".join(notes), loc="right", **style.NOTE)
