"""The picture of ``loop``: signal of the sensor, nutation between its thresholds, firings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.control_loop.evaluation import LoopPlan
from nutdamp.control_loop.sensor import Signal
from nutdamp.figures import labels, style
from nutdamp.figures.history import TIME, firings
from nutdamp.figures.legends import legend
from nutdamp.figures.motion import title
from nutdamp.figures.style import GREY, INK, MOTION, PULSE
from nutdamp.spacecraft.equipment import GYRO
from nutdamp.spacecraft.model import Vector
from nutdamp.views.loop import described

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


SAMPLES = 3000
"""Largest number of samples of the sensor drawn."""

BLOCK = 4096
"""Samples evaluated together."""

ROW = 0.36
"""Inches from one row of firings to the next: a bar, its number, and room."""

DECADES = 5.0
"""Largest number of decades of the nutation on its log axis."""


@style.styled
def loop_figure(plan: LoopPlan) -> Figure:
    """Signal of the sensor, nutation with thresholds, and firings, over the whole run."""
    run = plan.flown_run
    names = len({firing.pulse.channel for firing in run.fired})
    figure = style.sheet(7.4, 5.3 + ROW * names)
    grid = figure.add_gridspec(3, 1, height_ratios=[1.8, 1.8, 0.3 + ROW * names])
    signal = figure.add_subplot(grid[0])
    nutation = figure.add_subplot(grid[1], sharex=signal)
    fired = figure.add_subplot(grid[2], sharex=signal)
    for axes in (signal, nutation):
        axes.tick_params(labelbottom=False)
    _signal(signal, plan)
    _nutation(nutation, plan)
    firings(fired, run.flight, run.until, brief=True)
    fired.set_xlabel(TIME)
    legend(figure, [signal, nutation])
    figure.suptitle(f"{title(run.flight)}\n{described(run.loop, thresholds=False)}")
    labels.settle(figure)
    return figure


def _signal(axes: Axes, plan: LoopPlan) -> None:
    run = plan.flown_run
    sensor = run.loop.sensor
    if sensor.rate is None:
        times = np.linspace(0.0, run.until, SAMPLES)
        values = Signal(plan.spacecraft, sensor, run.key).shown(run.flight.motion(times)[0])
    else:
        times, values = _samples(plan, sensor.rate)
    scale = 180.0 / math.pi if sensor.kind == GYRO else 1.0
    names = ("ω1 as sampled", "ω2 as sampled") if sensor.kind == GYRO else ("acceleration as sampled",)
    for column, (label, colour) in enumerate(zip(names, (MOTION, PULSE), strict=False)):
        axes.plot(times, scale * values[:, column], ".", markersize=1.6, color=colour, label=label)
    axes.set_ylabel("signal, deg/s" if sensor.kind == GYRO else "signal, m/s²")
    axes.grid()


def _samples(plan: LoopPlan, rate: float) -> tuple[Vector, Vector]:
    """Some of the samples, evenly, with the noise that the loop saw; those within firings are left out."""
    run = plan.flown_run
    count = math.floor(run.until * rate) + 1
    shown_at = np.arange(0, count, max(math.ceil(count / SAMPLES), 1))
    signal, times, values = Signal(plan.spacecraft, run.loop.sensor, run.key), [], []
    for block in range(0, count, BLOCK):
        numbers = shown_at[(shown_at >= block) & (shown_at < block + BLOCK)]
        if len(numbers):
            times.append(np.asarray(numbers / rate, dtype=np.float64))
            values.append(signal.sampled(numbers, signal.shown(run.flight.motion(times[-1])[0])))
    instants, shown = np.concatenate(times), np.concatenate(values)
    quiet = np.ones(len(instants), dtype=bool)
    for firing in run.fired:
        quiet &= (instants < firing.pulse.start) | (instants > firing.pulse.end)
    return instants[quiet], shown[quiet]


def _nutation(axes: Axes, plan: LoopPlan) -> None:
    """Nutation on a log axis, thresholds, and the nutation seen at each firing."""
    run = plan.flown_run
    track = run.flight.sampled(SAMPLES, run.until)
    angles = np.degrees(track.nutation)
    start, stop = math.degrees(run.loop.start), math.degrees(run.loop.stop)
    most = max(float(angles.max()), start)
    low = max(0.5 * min(float(angles.min()), stop or start), most * 10.0**-DECADES)
    axes.plot(track.t, np.maximum(angles, 0.1 * low), color=INK, label="nutation")
    seen = [max(math.degrees(firing.seen), low) for firing in run.fired]
    axes.plot([firing.pulse.t for firing in run.fired], seen, "x", color=PULSE, markersize=4, label="seen at a firing")
    axes.axhline(start, color=GREY, linewidth=0.9, linestyle="--", label="start")
    if stop > 0.0:
        axes.axhline(stop, color=GREY, linewidth=0.9, linestyle=":", label="stop")
    axes.set_yscale("log")
    axes.set_ylim(low, 2.0 * most)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    axes.set_ylabel("nutation, deg (log)")
    axes.grid()
