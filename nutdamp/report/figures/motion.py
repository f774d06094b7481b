"""The two plane pictures of the motion: pole curve in the body, axis track in space."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.flight import Flight
from nutdamp.report import geometry
from nutdamp.report.figures import style
from nutdamp.report.figures.style import GREY, INK, MOMENTUM, MOTION, PULSE, THIN
from nutdamp.spacecraft import Channel, Vector
from nutdamp.track import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ALIKE = math.radians(2.0)
"""Channels whose torques point within this angle share one arrow."""


@style.styled
def motion_figure(flight: Flight, track: Track) -> Figure:
    """Pole curve in the 1-2 plane of the body beside the axis track in space (Magnus 1970 fig. 5-8)."""
    figure = style.sheet(7.4, 4.3)
    body, space = figure.subplots(1, 2)
    pole_curve(body, flight, track)
    axis_track(space, flight, track)
    style.legend(figure, [body, space], 6)
    figure.suptitle(title(flight))
    style.settle(figure)
    return figure


def title(flight: Flight) -> str:
    """What every sheet is headed with."""
    body, count = flight.spacecraft, len(flight.schedule)
    pulses = "no pulse" if count == 0 else "1 pulse" if count == 1 else f"{count} pulses"
    start, left = math.degrees(body.nutation), math.degrees(flight.residual.nutation)
    kept = f"{left:.3g}°" if left > 1e-6 else "zero"
    change = f"nutation {start:.3g}°, then {kept}" if count else f"nutation {start:.3g}°"
    return f"{body.name}: {change}, {pulses}"


def pole_curve(axes: Axes, flight: Flight, track: Track) -> None:
    """Path of the rotation vector in the 1-2 plane of the body (Magnus 1970 fig. 5), pulses and channels marked."""
    track = geometry.drawn(flight, track)
    rates = np.degrees(track.rates[:, :2])
    size = float(np.hypot(*rates.T).max())
    axes.axhline(0.0, color=GREY, linewidth=0.5)
    axes.axvline(0.0, color=GREY, linewidth=0.5)
    _path(axes, flight, track, rates, "ω in the body")
    named = _directions(axes, flight, size)
    style.square(axes, rates, margin=0.42 if named else 0.12, centre=True)
    aligned = flight.spacecraft.inertia.aligned
    axes.set(
        xlabel="ω1, deg/s",
        ylabel="ω2, deg/s",
        title="Pole curve in the body" + ("" if aligned else " (principal axes)"),
    )


def axis_track(axes: Axes, flight: Flight, track: Track) -> None:
    """Path of the spin axis about the first direction of H, as angles, with the jumps of H (Magnus 1970 fig. 6-8)."""
    track = geometry.drawn(flight, track)
    plane = geometry.sky_plane(flight, track.momentum[0])
    path, momentum = geometry.on_sky(plane, track.axis), geometry.on_sky(plane, track.momentum)
    axes.axhline(0.0, color=GREY, linewidth=0.5)
    axes.axvline(0.0, color=GREY, linewidth=0.5)
    _path(axes, flight, track, path, "spin axis")
    axes.plot(momentum[:, 0], momentum[:, 1], color=MOMENTUM, linewidth=1.0, linestyle=(0, (3, 1.5)))
    before, after = (geometry.on_sky(plane, state.momentum) for state in flight.around_pulses())
    stations = np.vstack([momentum[:1], after])
    axes.plot(
        *stations.T, "+", color=MOMENTUM, markersize=8, markeredgewidth=1.4, label="H", linestyle=(0, (3, 1.5)),
        linewidth=0.0,
    )  # fmt: skip
    for start, end in zip(before, after, strict=True):
        if np.hypot(*(end - start)) > 0.08 * np.ptp(path, axis=0).max():
            style.heads(axes, np.array([start, 0.5 * (start + end)]), [1], MOMENTUM)
    x, y = geometry.sky_names(flight)
    style.square(axes, np.vstack([path, momentum]), margin=0.14)
    axes.set(xlabel=x, ylabel=y, title="Axis track in space")


def _path(axes: Axes, flight: Flight, track: Track, points: Vector, name: str) -> None:
    """A path (n, 2) with its beginning, its sense, and its pulses: numbered where there is room."""
    first: int | None = None
    numbered = style.thinned(len(flight.schedule))
    for stretch in geometry.stretches(flight, track):
        rows = points[stretch.first : stretch.last + 1]
        if stretch.pulse is None:
            axes.plot(*rows.T, color=MOTION, label=name if first is None else None)
            first = stretch.first if first is None else first
            style.heads(axes, rows, _halfway(rows), MOTION)
            continue
        axes.plot(*rows.T, color=PULSE, linewidth=2.2, label="pulse" if stretch.pulse == 0 else None)
        way = rows[-1] - rows[0]
        if np.hypot(*way) > 0.03 * np.ptp(points, axis=0).max():
            style.arrow(axes, rows[-1] - 0.02 * way if len(rows) < 3 else rows[-2], rows[-1], PULSE, width=1.0)
        axes.plot(*rows[0], ".", color=PULSE, markersize=5)
        if stretch.pulse in numbered:
            style.label(axes, str(stretch.pulse + 1), 0.5 * (rows[0] + rows[-1]), PULSE)
    axes.plot(*points[0], "o", color=MOTION, markersize=4.5, label="t = 0")
    axes.plot(*points[-1], "o", color=MOTION, markersize=5.5, markerfacecolor="none", markeredgewidth=1.2, label="end")
    style.label(axes, "t = 0", points[0], INK, vital=True)


def _halfway(rows: Vector) -> list[int]:
    """Where on a stretch an arrowhead goes: half a turn into it at most."""
    steps = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rows, axis=0).T))])
    width = float(np.ptp(rows, axis=0).max())
    if steps[-1] <= 0.0:
        return []
    return [int(np.searchsorted(steps, min(0.5 * float(steps[-1]), 1.3 * width)))]


def _directions(axes: Axes, flight: Flight, size: float) -> bool:
    """Torque directions of the channels, as arrows outside the curve; whether there are any."""
    used = {pulse.channel for pulse in flight.schedule}
    channels = [one for one in flight.spacecraft.channels if one.damps and (one.name in used or not used)]
    channels = channels or [one for one in flight.spacecraft.channels if one.name in used]
    groups: list[list[Channel]] = []
    for channel in channels:
        group = next((one for one in groups if _apart(one[0], channel) < ALIKE), None)
        if group is None:
            groups.append([channel])
        else:
            group.append(channel)
    for group in groups:
        torque = group[0].transverse / abs(group[0].transverse)
        way = np.array([torque.real, torque.imag]) * (size if size > 1e-6 else 1.0 / 1.42)
        style.arrow(axes, 1.08 * way, 1.22 * way, GREY, width=1.2)
        names = ", ".join(one.name for one in group[:3]) + (" …" if len(group) > 3 else "")
        at = 1.31 * way
        axes.annotate(names, (at[0], at[1]), color=INK, fontsize=style.SMALL, ha="center", va="center")
    if groups:
        axes.plot([], [], color=GREY, linewidth=THIN + 0.5, marker=">", markersize=4, label="torque of a channel")
    return bool(groups)


def _apart(one: Channel, other: Channel) -> float:
    return abs(float(np.angle(one.transverse * other.transverse.conjugate())))
