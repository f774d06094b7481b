"""Fixed parts around the moving view: square panels and the strip over time, with their scales."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nutdamp.figures import geometry
from nutdamp.figures.geometry import ticks
from nutdamp.flight.propagation import Flight, Track
from nutdamp.spacecraft.model import Vector
from nutdamp.views.text import most

EDGES = (350, 150, 1960, 1760)
"""Frame of a square panel in units of its SVG, which is 2000 wide and high: left, top, right, bottom."""

STRIP = (2000, 1000)
"""Width and height of the angles over time in units of their SVG."""

EDGE = 0.03
"""Part of a scale at either end without a number: it would touch those of the other scale."""

LEAD = 0.012
"""Part of the axis of time before t = 0: motion at t = 0 is seen beside the cursor."""

PREFIXES, SHORT = (("", 1.0), ("m", 1e3), ("µ", 1e6), ("n", 1e9)), 0.05
"""Prefixes of units with their factors, and the largest number of a scale that needs another one."""

Mark = tuple[float, str]
"""A place on a scale, and the number there."""


class Scale(NamedTuple):
    """A scale with its name and marks."""

    name: str
    marks: tuple[Mark, ...]


class Panel(NamedTuple):
    """A square panel: ``part`` names it for the script, ``zero`` is where the axes cross, if within the frame."""

    part: str
    title: str
    described: str
    x: Scale
    y: Scale
    zero: tuple[float, float]
    frame: tuple[int, int, int, int] = EDGES


class Strip(NamedTuple):
    """Parts drawn over time; marks in per cent, ``required`` and ``zero`` in units of the SVG.

    ``outside``: a required nutation that lies beyond the scale. ``bars``: row of the channel, left and width of each
    firing; ``closed``: left and width of times without firing.
    """

    times: Scale
    angles: Scale
    zero: float
    required: float | None
    outside: str
    channels: tuple[str, ...]
    bars: tuple[tuple[int, float, float], ...]
    closed: tuple[tuple[float, float], ...]


def placed(points: Vector, middle: Vector, half: float) -> list[list[int]]:
    """Two columns: the places of ``points`` (n, 2) in a panel."""
    left, top, right, bottom = EDGES
    part = (points - middle + half) / (2.0 * half)
    across = left + part[:, 0] * (right - left), bottom - part[:, 1] * (bottom - top)
    return [np.rint(column).astype(int).tolist() for column in across]


def panel(part: str, title: str, room: tuple[Vector, float], names: tuple[str, str]) -> Panel:
    """A panel with ``room``: its middle (2,) and half its side; the ``names`` of its axes have deg as their unit."""
    middle, half = room
    prefix, factor = _prefix(half)
    names = names[0].replace(", deg", f", {prefix}deg"), names[1].replace(", deg", f", {prefix}deg")
    marks = []
    for which in (0, 1):
        inner = (1.0 - 2.0 * EDGE) * half
        values = np.array(ticks(float(middle[which]) - inner, float(middle[which]) + inner, 5))
        both = np.column_stack([values, values])
        places = placed(both, middle[[which, which]], half)[which]
        marks.append(tuple(zip(map(float, places), map(_number, (factor * values).tolist()), strict=True)))
    zero = placed(np.zeros((1, 2)), middle, half)
    described = f"{title}; {names[0]} to the right, {names[1]} upwards"
    x, y = (Scale(name, mark) for name, mark in zip(names, marks, strict=True))
    return Panel(part, title, described, x, y, (zero[0][0], zero[1][0]))


def _prefix(largest: float) -> tuple[str, float]:
    """The prefix of a unit that keeps numbers up to ``largest`` short, and the factor by which they grow."""
    return next(((name, factor) for name, factor in PREFIXES if factor * largest >= SHORT), PREFIXES[-1])


def _number(value: float) -> str:
    return f"{value:.6g}".replace("-", "−")


def strip_of(flown: Flight, track: Track, until: float) -> tuple[Strip, list[float]]:
    """Angles and firings over time, and the lowest and highest angle of the scale, deg."""
    body = flown.spacecraft
    angles = np.degrees(np.concatenate([track.nutation, track.body_cone, track.space_cone, [0.0]]))
    low, high = float(angles.min()), float(angles.max())
    margin = 0.06 * (high - low) if high - low > geometry.LEAST else 1.0
    low, high = low - margin, high + margin
    width, height = STRIP

    def rise(angle: float) -> float:
        return round(height * (high - angle) / (high - low), 1)

    def across(time: float) -> float:
        return LEAD + (1.0 - LEAD) * time / until

    def spread(begins: float, ends: float) -> tuple[float, float]:
        return round(width * across(begins), 1), round(width * (across(ends) - across(begins)), 1)

    required = None if body.requirement is None else body.requirement.nutation
    channels = tuple(geometry.channels_fired(flown))
    fired = zip(flown.schedule, flown.spans, strict=True)
    prefix, factor = _prefix(high - low)
    level = None if required is None else math.degrees(required)
    edge = EDGE * (high - low)
    scale = tuple(
        (rise(angle) * 100.0 / height, _number(factor * angle)) for angle in ticks(low + edge, high - edge, 5)
    )
    strip = Strip(
        times=Scale("time, s", tuple((100.0 * across(time), _number(time)) for time in ticks(0.0, until, 6))),
        angles=Scale(f"{prefix}deg", scale),
        zero=rise(0.0),
        required=rise(level) if level is not None and low < level < high else None,
        outside=most(math.radians(level)) if level is not None and not low < level < high else "",
        channels=channels,
        bars=tuple((channels.index(pulse.channel), *spread(*span)) for pulse, span in fired),
        closed=tuple(spread(begins, ends) for begins, ends in geometry.closed(body, until)),
    )
    return strip, [low, high]
