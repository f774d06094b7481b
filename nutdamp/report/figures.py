"""Figures (matplotlib, the extra ``plot``), returned as the bytes of a picture file."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.errors import BadRequest, MissingExtra
from nutdamp.flight import Flight
from nutdamp.spacecraft import Vector
from nutdamp.track import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMATS = ("png", "svg", "pdf")

# Okabe & Ito's palette, told apart by colour-blind readers and in grey print (jfly.uni-koeln.de/color).
MOTION, PULSE, MOMENTUM, GREY = "#0072B2", "#D55E00", "#009E73", "#666666"


def motion_picture(flight: Flight, track: Track, path: str) -> bytes:
    """Pole curve in the body and axis track in space, side by side; the format by the ending of ``path``.

    ``track`` is a track of ``flight``. Raises BadRequest for an unknown ending, MissingExtra without matplotlib.
    """
    ending = "png" if path == "-" else Path(path).suffix.lstrip(".").lower()
    if ending not in FORMATS:
        raise BadRequest(f"--plot {path}: the ending says the format; use one of .{', .'.join(FORMATS)}")
    try:
        from matplotlib.figure import Figure
    except ImportError as reason:
        raise MissingExtra("plot", "a picture") from reason
    figure = Figure(figsize=(10.0, 5.2), layout="constrained")
    body, space = figure.subplots(1, 2)
    _pole_curve(body, flight, track)
    _axis_track(space, flight, track)
    figure.suptitle(f"{flight.spacecraft.name}: nutation {math.degrees(flight.spacecraft.nutation):.3g}° at t = 0")
    stream = io.BytesIO()
    figure.savefig(stream, format=ending, dpi=150, metadata=_metadata(ending))
    return stream.getvalue()


def _metadata(ending: str) -> dict[str, None]:
    """No dates in the file, so that the same flight gives the same picture."""
    return {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}[ending]


def _pole_curve(axes: Axes, flight: Flight, track: Track) -> None:
    """Path of the rotation vector in the 1-2 plane of the body (Magnus 1970 fig. 5)."""
    rates = np.degrees(track.rates[:, :2])
    axes.plot(rates[:, 0], rates[:, 1], color=MOTION, linewidth=1.2, label="ω in the body")
    before, after = (np.degrees(state.rates[:, :2]) for state in flight.around_pulses())
    _arrows(axes, before, after, "pulse")
    axes.plot(*rates[0], "o", color=MOTION, markersize=5)
    axes.annotate("t = 0", rates[0], xytext=(6, 6), textcoords="offset points", color=GREY)
    axes.set(xlabel="ω1, deg/s", ylabel="ω2, deg/s", title="Pole curve, principal body axes")
    _finish(axes)


def _axis_track(axes: Axes, flight: Flight, track: Track) -> None:
    """Path of the spin axis about the first direction of H, as angles (Magnus 1970 fig. 6-8)."""
    plane = _sky_plane(track.momentum[0], framed=flight.spacecraft.attitude is not None)
    path = _on_sky(plane, track.axis)
    axes.plot(path[:, 0], path[:, 1], color=MOTION, linewidth=1.2, label="spin axis")
    axes.plot(*path[0], "o", color=MOTION, markersize=5)
    axes.annotate("t = 0", path[0], xytext=(6, 6), textcoords="offset points", color=GREY)
    before, after = flight.around_pulses()
    places = _on_sky(plane, np.vstack([track.momentum[:1], after.momentum]))
    axes.plot(places[:, 0], places[:, 1], color=MOMENTUM, linewidth=0.8, linestyle="--")
    axes.plot(places[:, 0], places[:, 1], "+", color=MOMENTUM, markersize=9, label="H, from first to last")
    pulses = _on_sky(plane, before.axis)
    axes.plot(pulses[:, 0], pulses[:, 1], "s", color=PULSE, markersize=4, label="pulse begins")
    names = (
        ("east of H(0), deg", "north of H(0), deg") if flight.spacecraft.attitude else ("x of N, deg", "y of N, deg")
    )
    axes.set(xlabel=names[0], ylabel=names[1], title="Axis track, inertial")
    _finish(axes)


def _sky_plane(momentum: Vector, *, framed: bool) -> Vector:
    """Rows: two directions square to H, and H. In a celestial frame east and north, in N its x and y."""
    up = momentum / np.linalg.norm(momentum)
    first = np.cross([0.0, 0.0, 1.0], up) if framed else np.array([1.0, 0.0, 0.0])
    if np.linalg.norm(first) < 1e-9:  # H at the pole: there is no east
        first = np.array([1.0, 0.0, 0.0])
    first = first - up * (first @ up)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(up, first), up])


def _on_sky(plane: Vector, directions: Vector) -> Vector:
    """Directions (n, 3) as angles from H(0) in degrees, true to scale along every radius (azimuthal equidistant)."""
    local = directions @ plane.T
    across = np.hypot(local[:, 0], local[:, 1])
    angle = np.degrees(np.arctan2(across, local[:, 2]))
    scale = np.divide(angle, across, out=np.zeros_like(angle), where=across > 0)
    return local[:, :2] * scale[:, None]


def _arrows(axes: Axes, before: Vector, after: Vector, label: str) -> None:
    for index, (start, end) in enumerate(zip(before, after, strict=True)):
        axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": PULSE, "linewidth": 1.4})
        axes.annotate(str(index + 1), start, xytext=(4, -11), textcoords="offset points", color=PULSE, fontsize=9)
    if len(before):
        axes.plot([], [], color=PULSE, linewidth=1.4, label=label)


def _finish(axes: Axes) -> None:
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(linewidth=0.4, color="#cccccc")
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.axvline(0.0, color=GREY, linewidth=0.6)
    axes.legend(loc="best", fontsize=9)
