"""Pictures over time: rates, cone angles, firings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.flight import Flight
from nutdamp.presentation import geometry
from nutdamp.presentation.figures import style
from nutdamp.presentation.figures.motion import title
from nutdamp.presentation.figures.style import GREY, INK, MOMENTUM, MOTION, PULSE, THIN
from nutdamp.presentation.text import steering
from nutdamp.schedule import STEERABLE, Pulse
from nutdamp.track import Track

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


EDGE = 0.012
"""Room before t = 0, as a part of the time shown: what happens at once must be seen."""


@style.styled
def history_figure(flight: Flight, track: Track) -> Figure:
    """Rates in the body and cone angles over time, firings as bars behind them."""
    whole, track = track, geometry.drawn(flight, track)
    figure = style.sheet(7.4, 5.0)
    rates, spin, cones = figure.subplots(3, 1, sharex=True, height_ratios=[3, 1.3, 3])
    rate_history(rates, flight, track)
    spin_history(spin, flight, track)
    cone_history(cones, flight, track)
    cones.set_xlabel(time_label(whole, track))
    style.legend(figure, [rates, cones])
    figure.suptitle(title(flight))
    style.settle(figure)
    return figure


@style.styled
def timeline_figure(flight: Flight) -> Figure:
    """Which channel fires when and for how long."""
    rows = len(_channels(flight))
    figure = style.sheet(7.4, 1.5 + 0.36 * max(rows, 1))
    axes = figure.subplots()
    timeline(axes, flight, 1.12 * flight.schedule.end or flight.spacecraft.inertial_period)
    axes.set_xlabel("time, s")
    style.legend(figure, [axes])
    figure.suptitle(title(flight))
    style.settle(figure)
    return figure


def time_label(whole: Track, drawn: Track) -> str:
    """What the time axis is called; it says so where only the first part of a long time is drawn."""
    end = float(whole.t[-1])
    return "time, s" if drawn.t[-1] >= end else f"time, s (the first {float(drawn.t[-1]):.4g} of {end:.4g})"


def rate_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Transverse rates ω1, ω2."""
    track = geometry.drawn(flight, track)
    rates = np.degrees(track.rates)
    width = _line(flight, track)
    axes.plot(track.t, rates[:, 0], color=MOTION, linewidth=width, label="ω1")
    axes.plot(track.t, rates[:, 1], color=INK, linewidth=0.8 * width, linestyle=(0, (4, 1.5)), label="ω2")
    _finish(axes, flight, track, rates[:, :2], "ω1, ω2, deg/s")
    _numbers(axes, flight, track)


def spin_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Axial rate ω3; a constant one is drawn as such, not as its rounding."""
    track = geometry.drawn(flight, track)
    spin = np.degrees(track.rates[:, 2])
    axes.plot(track.t, spin, color=MOTION, label="ω3")
    _finish(axes, flight, track, spin, "ω3, deg/s", least=0.02 * float(np.abs(spin).max()))
    axes.locator_params(axis="y", nbins=3)


def cone_history(axes: Axes, flight: Flight, track: Track) -> None:
    """Nutation angle θ = λ + μ, body cone μ and space cone λ."""
    track = geometry.drawn(flight, track)
    angles = np.degrees(np.column_stack([track.nutation, track.body_cone, track.space_cone]))
    axes.plot(track.t, angles[:, 0], color=INK, label="nutation θ = μ + λ")
    axes.plot(track.t, angles[:, 1], color=MOTION, linestyle=(0, (5, 1.5)), label="body cone μ")
    axes.plot(track.t, angles[:, 2], color=MOMENTUM, linestyle=(0, (5, 1.5, 1, 1.5)), label="space cone λ")
    _finish(axes, flight, track, np.append(angles.ravel(), 0.0), "angles, deg")
    requested = flight.spacecraft.requirement
    if requested is not None and requested.nutation is not None:
        axes.axhline(math.degrees(requested.nutation), color=GREY, linewidth=0.9, linestyle=":", label="required θ")
    axes.axhline(0.0, color=GREY, linewidth=0.5)


def timeline(axes: Axes, flight: Flight, until: float, *, brief: bool = False) -> None:
    """A bar for each firing, in the row of its channel; times when nothing may fire are hatched.

    ``brief`` labels bars with the number of the pulse alone.
    """
    names = _channels(flight)
    rows = {name: len(names) - 1 - index for index, name in enumerate(names)}
    axes.set_xlim(-EDGE * until, until)
    axes.set_ylim(-0.6, max(len(names), 1) - 0.1)
    for index, (begins, ends) in enumerate(_closed(flight, until)):
        axes.axvspan(
            begins, ends, facecolor="none", edgecolor=GREY, hatch="////", linewidth=0.0, alpha=0.35,
            label="must not fire" if index == 0 else None,
        )  # fmt: skip
    numbered = style.thinned(len(flight.schedule))
    for number, pulse in enumerate(flight.schedule):
        row = rows[pulse.channel]
        if pulse.start > until:
            break
        axes.broken_barh(
            [(pulse.start, pulse.on_time)], (row - 0.38, 0.46), facecolor=PULSE, edgecolor=PULSE, linewidth=0.8
        )
        if number in numbered:
            style.label(
                axes,
                str(number + 1) if brief else _firing(number, pulse, flight),
                np.array([pulse.t, row + 0.08]),
                INK,
                role="above",
            )
    axes.set_yticks(list(rows.values()), list(rows))
    axes.grid(axis="x")
    axes.set_title("Firings" if brief else "Firings: number, on-time")
    if not names:
        axes.text(0.5, 0.5, "no pulses", transform=axes.transAxes, ha="center", va="center")


def _firing(number: int, pulse: Pulse, flight: Flight) -> str:
    how = f"{pulse.on_time:.3g} s" if pulse.on_time else f"{pulse.magnitude:.3g} N m s"
    if pulse.channel == STEERABLE:
        how += f" at {steering(flight.spacecraft.inertia.in_file(pulse.impulse).tolist())}"
    return f"{number + 1}: {how}"


def _channels(flight: Flight) -> list[str]:
    """Channels that fire, in the order of the file."""
    used = dict.fromkeys(pulse.channel for pulse in flight.schedule)
    order = [channel.name for channel in flight.spacecraft.channels]
    return sorted(used, key=lambda name: order.index(name) if name in order else -1)


def _closed(flight: Flight, until: float) -> list[tuple[float, float]]:
    """Times, cut at ``until``, in which no pulse may be on."""
    limits = flight.spacecraft.limits
    windows = [(0.0, limits.earliest), *limits.blackout]
    return [(begins, min(ends, until)) for begins, ends in windows if begins < until and ends > begins]


def _line(flight: Flight, track: Track) -> float:
    """Thinner where many turns stand side by side."""
    turns = float(track.t[-1]) / min(flight.spacecraft.body_period, float(track.t[-1]) or 1.0)
    return style.LINE if turns < 25 else THIN if turns < 100 else 0.5


def _numbers(axes: Axes, flight: Flight, track: Track) -> None:
    """Numbers of the pulses along the upper edge."""
    top = axes.get_ylim()[1]
    for number in style.thinned(len(flight.schedule)):
        pulse = flight.schedule.pulses[number]
        if pulse.t <= track.t[-1]:
            style.label(axes, str(number + 1), np.array([pulse.t, top]), PULSE, role="number")


def _finish(axes: Axes, flight: Flight, track: Track, values: np.ndarray, name: str, *, least: float = 0.0) -> None:
    low, high = float(values.min()), float(values.max())
    half = max(0.56 * (high - low), least)
    half = half if half > 1e-9 else 1.0
    axes.set_ylim(0.5 * (low + high) - half, 0.5 * (low + high) + half)
    axes.set_xlim(-EDGE * float(track.t[-1]), float(track.t[-1]))
    for pulse in flight.schedule:
        if pulse.start <= track.t[-1]:
            axes.axvspan(
                pulse.start, pulse.end, facecolor=PULSE, edgecolor=PULSE, linewidth=0.6, alpha=0.25, zorder=0.5,
                label="firing" if pulse is flight.schedule.pulses[0] else None,
            )  # fmt: skip
    axes.set_ylabel(name)
    axes.grid()
