"""Pictures over time: rates, cone angles, firings."""

from __future__ import annotations

import math
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.figures import geometry, labels, style
from nutdamp.figures.legends import legend
from nutdamp.figures.style import FIRED, GREY, INK, MOMENTUM, MOTION, PULSE
from nutdamp.flight.propagation import Flight
from nutdamp.flight.track import Track
from nutdamp.spacecraft.schedule import STEERABLE, Pulse
from nutdamp.views.text import degrees, steering

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


TIME = "time, s"
"""Label of time axes."""

DECADES = 4.0
"""Largest number of decades of the nutation on a log axis, unless the requirement lies lower."""

HEADING = 9.0
"""Letters of a heading of a panel that have room in an inch of a figure."""

EDGE = 0.012
"""Room before t = 0, as a part of the time shown, so that events at t = 0 are seen."""

FULL, PALE = 0.9, 0.35
"""Share of a bar that several firings must fill to be drawn as one, and how dense it is drawn where they do not."""

NOTE: dict[str, Any] = {"fontsize": style.SMALL, "fontweight": "normal"}
"""Look of a remark above a panel."""

BAR = 0.46
"""Height of a bar; the distance between two rows is 1."""


def history(flight: Flight, track: Track, *, narrow: bool = False) -> Figure:
    """Rates in the body and cone angles over time, firings as bars behind them; the nutation on a log axis too.

    ``narrow``: all below each other, for a phone.
    """
    figure = style.sheet(style.PHONE, 8.6) if narrow else style.sheet(7.4, 5.6)
    grid = figure.add_gridspec(4, 1, height_ratios=[3, 1.6, 3, 3]) if narrow else None
    grid = grid or figure.add_gridspec(3, 2, height_ratios=[3, 1.3, 3.4])
    rates = figure.add_subplot(grid[0, :])
    spin = figure.add_subplot(grid[1, :], sharex=rates)
    cones, decay = (figure.add_subplot(cell) for cell in ((grid[2], grid[3]) if narrow else (grid[2, 0], grid[2, 1])))
    rates.tick_params(labelbottom=False)
    rate_history(rates, flight, track)
    spin_history(spin, flight, track)
    cone_history(cones, flight, track)
    decay_history(decay, flight, track)
    for axes in (spin, cones, decay):
        axes.set_xlabel(TIME)
    legend(figure, [rates, cones, decay])
    return figure


def timeline(flight: Flight, track: Track, *, narrow: bool = False) -> Figure:
    """Firings of each channel as bars; ``narrow``: for a phone."""
    rows = max(len(geometry.channels_fired(flight)), 1)
    figure = style.sheet(style.PHONE if narrow else 7.4, 1.85 + 0.39 * rows)
    axes = figure.subplots()
    firings(axes, flight, float(track.t[-1]))
    axes.set_xlabel(TIME)
    legend(figure, [axes])
    return figure


def rate_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Transverse rates ω1, ω2."""
    rates = np.degrees(track.rates)
    width = style.thickness(rates, float(track.t[-1]) / flight.spacecraft.body_period / 2.5)
    axes.plot(track.t, rates[:, 0], color=MOTION, linewidth=width, label="ω1")
    axes.plot(track.t, rates[:, 1], color=INK, linewidth=0.8 * width, linestyle=(0, (4, 1.5)), label="ω2")
    _finish(axes, flight, track, rates[:, :2], "ω1, ω2, deg/s")
    _numbers(axes, flight, track)


def spin_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Axial rate ω3; a constant one is drawn as such, not as its rounding."""
    spin = np.degrees(track.rates[:, 2])
    axes.plot(track.t, spin, color=MOTION, label="ω3")
    _finish(axes, flight, track, spin, "ω3, deg/s", least=0.02 * float(np.abs(spin).max()))
    axes.locator_params(axis="y", nbins=3)


def cone_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Nutation angle θ = λ + μ, body cone μ and space cone λ."""
    angles = np.degrees(np.column_stack([track.nutation, track.body_cone, track.space_cone]))
    axes.plot(track.t, angles[:, 0], color=INK, label="nutation θ = μ + λ")
    axes.plot(track.t, angles[:, 1], color=MOTION, linestyle=(0, (5, 1.5)), label="body cone μ")
    axes.plot(track.t, angles[:, 2], color=MOMENTUM, linestyle=(0, (5, 1.5, 1, 1.5)), label="space cone λ")
    _finish(axes, flight, track, np.append(angles.ravel(), 0.0), "angles, deg")
    most, top = required_nutation(flight), axes.get_ylim()[1]
    if most is not None and most > top:
        axes.set_title(f"required θ {most:.4g}°, outside the view", loc="right", **NOTE)
    else:
        _required(axes, most)
    axes.axhline(0.0, color=GREY, linewidth=0.5)


def decay_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Nutation angle θ on a log axis; its value at the right edge is written above if the axis does not reach it."""
    angles = np.degrees(track.nutation)
    limit = required_nutation(flight)
    _required(axes, limit)
    most, required = max(float(angles.max()), geometry.LEAST), math.inf if limit is None else limit
    least = min(most * 10.0**-DECADES, 0.1 * required)
    low = max(0.5 * min(float(angles.min()), required, 0.1 * most), least)
    axes.plot(track.t, np.where(angles > low, angles, 0.1 * low), color=INK)
    _finish(axes, flight, track, angles, "nutation θ, deg (log)")
    axes.set_yscale("log")
    axes.set_ylim(low, 2.0 * (most if limit is None else max(most, limit)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    if angles[-1] <= low:
        axes.set_title(f"at {track.t[-1]:.4g} s: {degrees(float(track.nutation[-1]))}", loc="right", **NOTE)


def required_nutation(flight: Flight) -> float | None:
    """The nutation that may be left, deg; None where none is required."""
    requested = flight.spacecraft.requirement
    return None if requested is None or requested.nutation is None else math.degrees(requested.nutation)


def _required(axes: Axes, most: float | None) -> None:
    """A line at the nutation that may be left, deg."""
    if most is not None:
        axes.axhline(most, color=INK, linewidth=0.9, linestyle=":", label="required θ")


def firings(axes: Axes, flight: Flight, until: float, *, brief: bool = False) -> None:
    """A bar for each firing, in the row of its channel; times when nothing may fire are hatched, beside the labels.

    ``brief`` labels bars with the number of the pulse alone.
    """
    names = geometry.channels_fired(flight)
    rows = {name: len(names) - 1 - index for index, name in enumerate(names)}
    axes.set_xlim(-EDGE * until, until)
    axes.set_ylim(-0.5, max(len(names), 1) + 0.25)
    named = "must not fire"
    for begins, ends in geometry.closed(flight.spacecraft, until):
        for row in rows.values():
            axes.broken_barh(
                [(begins, ends - begins)], (row - 0.5 * BAR, BAR), facecolor="none", edgecolor=GREY, hatch="////",
                linewidth=0.0, label=named,
            )  # fmt: skip
            named = ""
    bars = ((block, row) for name, row in rows.items() for block in geometry.blocks(flight, until, name))
    for block, row in sorted(bars):
        _bar(axes, flight, block, row, brief=brief)
    axes.set_yticks(list(rows.values()), list(rows))
    axes.grid(axis="x")
    title = "Firings"
    if flight.schedule.through_valves:
        title += ": effective on-times, not the commands"
    roomy = (
        not brief and axes.figure.bbox.width / axes.figure.dpi > style.PHONE
    )  # for the angles that bars are labelled with
    if roomy and any(pulse.channel == STEERABLE for pulse in flight.schedule):
        title += "; angles: direction of the torque from body axis +1"
    axes.set_title(fill(title, int(HEADING * axes.figure.bbox.width / axes.figure.dpi)))
    if not names:
        axes.text(0.5, 0.5, "no pulses", transform=axes.transAxes, ha="center", va="center")


def _bar(axes: Axes, flight: Flight, block: geometry.FiredBlock, row: int, *, brief: bool) -> None:
    """The bar of a firing, or of several that cannot be distinguished: paler where they do not fill it."""
    size = block.ends - block.begins
    dense = block.many == 1 or block.on > FULL * size
    axes.broken_barh(
        [(block.begins, size)], (row - 0.5 * BAR, BAR), facecolor=PULSE if dense else (PULSE, PALE), edgecolor=PULSE,
        linewidth=0.8, label=None if dense else "many firings, too close to be distinguished",
    )  # fmt: skip
    text = block.name
    if not brief:
        pulse = flight.schedule.pulses[block.first - 1]
        text = _firing(block.first, pulse, flight) if block.many == 1 else f"{text}: {block.on:.3g} s in all"
    place = np.array([block.begins + 0.5 * size, row + 0.5 * BAR])
    labels.add(axes, text, place, INK, role="bar", short=block.name)


def _firing(number: int, pulse: Pulse, flight: Flight) -> str:
    how = f"{pulse.on_time:.3g} s" if pulse.on_time else f"{pulse.magnitude:.3g} N m s"
    if pulse.channel == STEERABLE:
        how += f" at {steering(flight.spacecraft.inertia.in_file(pulse.impulse).tolist())}"
    return f"{number}: {how}"


def _numbers(axes: Axes, flight: Flight, track: Track) -> None:
    """Numbers of the pulses along the upper edge."""
    top = axes.get_ylim()[1]
    for number in style.thinned(len(flight.schedule)):
        pulse = flight.schedule.pulses[number]
        if pulse.t <= track.t[-1]:
            labels.add(axes, str(number + 1), np.array([pulse.t, top]), FIRED, role="number")


def _finish(axes: Axes, flight: Flight, track: Track, values: np.ndarray, name: str, *, least: float = 0.0) -> None:
    low, high = float(values.min()), float(values.max())
    half = max(0.56 * (high - low), least)
    half = half if half > 1e-9 else 1.0
    axes.set_ylim(0.5 * (low + high) - half, 0.5 * (low + high) + half)
    axes.set_xlim(-EDGE * float(track.t[-1]), float(track.t[-1]))
    for number, block in enumerate(geometry.blocks(flight, float(track.t[-1]))):
        axes.axvspan(
            block.begins, block.ends, facecolor=(PULSE, 0.25), edgecolor=PULSE, linewidth=0.6, zorder=0.5,
            label=None if number else "firing",
        )  # fmt: skip
    axes.set_ylabel(name)
    axes.grid()
