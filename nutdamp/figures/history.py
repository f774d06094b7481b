"""The picture over time: nutation with its bound, firings of each channel, rates in the body."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.figures import geometry, labels, style
from nutdamp.figures.style import GREY, INK, MISSED, MOTION, PULSE, UNCHECKED
from nutdamp.flight.propagation import Flight, Track
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Vector
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.views.text import steering

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec


TIME = "time, s"
"""Label of time axes."""

DECADES = 4.0
"""Largest number of decades of the nutation on a log axis, unless the requirement lies lower."""

EDGE = 0.012
"""Room before t = 0, as a part of the time shown, so that events at t = 0 are seen."""

FULL, PALE = 0.9, 0.35
"""Share of a bar that several firings must fill to be drawn as one, and how dense it is drawn where they do not."""

BAR = 0.46
"""Height of a bar; the distance between two rows is 1."""

CHANGES = 1e-3
"""Share of the largest ω3 from which on its change is drawn."""


def heights(flight: Flight, track: Track) -> list[float]:
    """Height of each panel, inches: nutation, firings, ω1 and ω2, and ω3 where it changes."""
    spin = track.rates[:, 2]
    changes = float(np.ptp(spin)) > CHANGES * float(np.abs(spin).max())
    return [1.9, *firings_height(flight), 1.5, *([0.9] * changes)]


def firings_height(flight: Flight) -> list[float]:
    """Inches of the panel of `firings`, for each row a bar, its number, and room; empty where nothing fires."""
    rows = len(geometry.channels_fired(flight))
    return [0.3 + 0.36 * rows] * bool(rows)


def history(flight: Flight, track: Track, *, narrow: bool = False) -> Figure:
    """Nutation, firings and rates over one time axis; ``narrow``: for a phone."""
    sizes = heights(flight, track)
    figure = style.sheet(style.PHONE if narrow else 7.4, 1.6 + sum(sizes))
    grid = figure.add_gridspec(len(sizes), 1, height_ratios=sizes)
    style.legend(figure, courses(figure, [grid[row] for row in range(len(sizes))], flight, track))
    return figure


def courses(figure: Figure, cells: Sequence[SubplotSpec], flight: Flight, track: Track) -> list[Axes]:
    """The panels of `heights` in ``cells`` of a figure, from above."""
    first = figure.add_subplot(cells[0])
    panels = [first, *(figure.add_subplot(cell, sharex=first) for cell in cells[1:])]
    others = iter(panels[1:])
    nutation_history(first, flight, track)
    if len(flight.schedule):
        firings(next(others), flight, float(track.t[-1]))
    rate_history(next(others), flight, track)
    for axes in others:
        _spin_history(axes, flight, track)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    panels[-1].set_xlabel(TIME)
    return panels


def nutation_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Nutation θ on a log axis with the band that is required, and its last value."""
    angles, limit = np.degrees(track.nutation), style.limit_of(flight.spacecraft, Part.NUTATION)
    most, bound = max(float(angles.max()), geometry.LEAST), math.inf if limit is None else limit
    low = max(0.5 * min(float(angles.min()), bound, 0.1 * most), min(most * 10.0**-DECADES, 0.1 * bound))
    if limit is not None:
        axes.axhspan(0.0, limit, facecolor=GREY, alpha=0.16, linewidth=0.0, zorder=0.4)
        axes.axhline(limit, **style.LIMIT)
    axes.plot(track.t, np.where(angles > low, angles, 0.1 * low), color=MOTION, label="nutation θ")
    _bands(axes, flight, track)
    style.log_angles(axes, low, 2.0 * (most if limit is None else max(most, limit)))
    text, colour = _verdict(flight)
    last = f"θ at {style.number(float(track.t[-1]))} s: {style.angle(float(track.nutation[-1]))}"
    axes.set_title(last + text, loc="right", color=colour, **style.NOTE)


def _verdict(flight: Flight) -> tuple[str, str]:
    """Words, and their colour, for the requirement after the last firing; empty without one."""
    body, left = flight.spacecraft, flight.residual
    limits = {part: style.limit_of(body, part) for part in (Part.NUTATION, requirements.aim(body))}
    if all(limit is None for limit in limits.values()):
        return "", INK
    ends = {part: math.degrees(getattr(left, part.value)) for part in limits}
    missed = [style.part_name(part) for part, limit in limits.items() if limit is not None and ends[part] > limit]
    if missed:
        return f"; NOT met: {', '.join(missed)}", MISSED
    return ("; tolerances not checked", UNCHECKED) if body.dispersions is None else ("", INK)


def rate_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Transverse rates ω1, ω2."""
    rates = np.degrees(track.rates)
    width = style.thickness(rates, float(track.t[-1]) / flight.spacecraft.body_period / 2.5)
    axes.plot(track.t, rates[:, 0], color=MOTION, linewidth=width, label="ω1")
    axes.plot(track.t, rates[:, 1], color=INK, linewidth=0.8 * width, linestyle=(0, (4, 1.5)), label="ω2")
    half = 1.12 * max(float(np.abs(rates[:, :2]).max()), geometry.LEAST)
    axes.set_ylim(-half, half)
    _bands(axes, flight, track)
    axes.set_ylabel("ω1, ω2, °/s")
    axes.grid()


def _spin_history(axes: Axes, flight: Flight, track: Track) -> None:
    spin = np.degrees(track.rates[:, 2])
    axes.plot(track.t, spin, color=MOTION, label="_ω3")
    axes.margins(y=0.12)
    _bands(axes, flight, track)
    axes.set_ylabel("ω3, °/s")
    axes.grid()
    axes.locator_params(axis="y", nbins=3)


def _bands(axes: Axes, flight: Flight, track: Track) -> None:
    """Time axis, and bands of the firings."""
    until = float(track.t[-1])
    axes.set_xlim(-EDGE * until, until)
    look: dict[str, Any] = {"facecolor": (PULSE, 0.25), "edgecolor": PULSE, "linewidth": 0.6, "zorder": 0.5}
    for number, block in enumerate(geometry.blocks(flight, until)):
        axes.axvspan(block.begins, block.ends, label=None if number else "firing", **look)


def firings(axes: Axes, flight: Flight, until: float) -> None:
    """A bar for each firing, in the row of its channel; times when nothing may fire are hatched, beside the labels."""
    names = geometry.channels_fired(flight)
    rows = {name: len(names) - 1 - index for index, name in enumerate(names)}
    axes.set_xlim(-EDGE * until, until)
    axes.set_ylim(-0.5, max(len(names), 1) + 0.25)
    for begins, ends in geometry.closed(flight.spacecraft, until):
        for row in rows.values():
            axes.broken_barh(
                [(begins, ends - begins)], (row - 0.5 * BAR, BAR), facecolor="none", edgecolor=GREY, hatch="////",
                linewidth=0.0, label="must not fire",
            )  # fmt: skip
    bars = ((block, row) for name, row in rows.items() for block in geometry.blocks(flight, until, name))
    for block, row in sorted(bars):
        _bar(axes, flight, block, row)
    axes.set_yticks(list(rows.values()), list(rows))
    axes.grid(axis="x")
    notes = ["effective on-times, not the commands"] * any(pulse.through_valve for pulse in flight.schedule)
    if any(pulse.channel == STEERABLE for pulse in flight.schedule):
        notes.append("angles: torque from body axis +1")
    axes.set_title("; ".join(notes), loc="right", **style.NOTE)


def _bar(axes: Axes, flight: Flight, block: geometry.FiredBlock, row: int) -> None:
    """The bar of a firing, or of several that cannot be distinguished: paler where they do not fill it."""
    size = block.ends - block.begins
    dense = block.many == 1 or block.on > FULL * size
    axes.broken_barh(
        [(block.begins, size)], (row - 0.5 * BAR, BAR), facecolor=PULSE if dense else (PULSE, PALE), edgecolor=PULSE,
        linewidth=0.8, label=None if dense else "firings too close to be distinguished",
    )  # fmt: skip
    how, pulse = f"{style.number(block.on)} s", flight.schedule.pulses[block.first - 1]
    if block.many == 1:
        how = how if pulse.on_time else f"{style.number(pulse.magnitude)} N m s"
        if pulse.channel == STEERABLE:
            how += f" at {steering(flight.spacecraft.inertia.in_file(pulse.impulse).tolist())}"
    place: Vector = np.array([block.begins + 0.5 * size, row + 0.5 * BAR])
    labels.add(axes, f"{block.name}: {how}", place, INK, role="bar", short=block.name)
