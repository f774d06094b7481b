"""Pictures of signals: one run of ``loop``, the nutation that ``budget`` holds, and residuals of a
``fit``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.control_loop.budget import DAY, Budget
from nutdamp.control_loop.evaluation import LoopPlan
from nutdamp.control_loop.sensor import Signal
from nutdamp.figures import style
from nutdamp.figures.overview import EDGE, TIME, firings, firings_height, title
from nutdamp.figures.style import GREY, INK, MOMENTUM, MOTION, PULSE
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import GYRO
from nutdamp.spacecraft.model import Vector
from nutdamp.views.loop import described

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from nutdamp.estimation.results import Estimate, Fitted
    from nutdamp.estimation.search import Fit

SAMPLES = 3000  # largest number of samples of the sensor drawn
BLOCK = 4096  # samples evaluated together
DECADES = 5.0  # largest number of decades of the nutation on its log axis

FIRST, EARLY, TURNS = 4, 0.2, 4.0
"""Firings in this share of the run, and periods of the nutation, that the enlarged first seconds
hold.
"""

SHORT = 0.5  # share of the run from which on its first seconds are not drawn a second time

LINES = ((MOTION, "-"), (MOMENTUM, "--"), (GREY, "-."), (MOTION, ":"))
"""Colour and style of the pairs of thresholds whose limit cycles are drawn."""

PERIODS = 4.0  # cycles drawn of the longest limit cycle

ROWS = 600


@style.styled()
def loop_figure(plan: LoopPlan) -> Figure:
    """Signal of the sensor, nutation with thresholds, and firings: the whole run, and beside it its
    first seconds.
    """
    run = plan.flown_run
    first = first_seconds(plan)
    spans = [run.until, first] if first < SHORT * run.until else [run.until]
    heights = [1.8, 1.8, *firings_height(run.flight)]
    figure = style.sheet(7.4 if len(spans) == 1 else 10.4, 1.8 + sum(heights))
    shape: dict[str, Any] = {"height_ratios": heights, "width_ratios": [1.5, 1.0][: len(spans)]}
    panels = figure.subplots(len(heights), len(spans), squeeze=False, sharex="col", **shape)
    for column, until in zip(panels.T, spans, strict=True):
        _signal(column[0], plan, until)
        _nutation(column[1], plan, until)
        if run.fired:
            firings(column[2], run.flight, until)
        column[0].set_xlim(-EDGE * until, until)
        column[-1].set_xlabel(TIME)
    if len(spans) > 1:
        panels[0, 1].set_title(f"The first {style.number(first)} s")
    style.legend(figure, list(panels.ravel()))
    loop = described(run.loop, thresholds=False).replace(" deg", "°")
    style.heading(figure, run.flight.spacecraft, f"{title(run.flight)}\n{loop}")
    style.settle(figure)
    return figure


def first_seconds(plan: LoopPlan) -> float:
    """End of the first seconds of a run, s: some firings, and some periods of the nutation."""
    run = plan.flown_run
    ends = [
        firing.pulse.end for firing in run.fired[:FIRST] if firing.pulse.end < EARLY * run.until
    ]
    return min(run.until, max(1.2 * max(ends, default=0.0), TURNS * plan.spacecraft.body_period))


def _signal(axes: Axes, plan: LoopPlan, until: float) -> None:
    run, sensor = plan.flown_run, plan.flown_run.loop.sensor
    if sensor.rate is None:
        times = np.linspace(0.0, until, SAMPLES)
        values = Signal(plan.spacecraft, sensor, run.key).shown(run.flight.motion(times)[0])
    else:
        times, values = _samples(plan, sensor.rate, until)
    scale = 180.0 / math.pi if sensor.kind == GYRO else 1.0
    names = (
        ("ω1 as sampled", "ω2 as sampled") if sensor.kind == GYRO else ("acceleration as sampled",)
    )
    for column, (name, colour) in enumerate(zip(names, (MOTION, INK), strict=False)):
        axes.plot(times, scale * values[:, column], ".", markersize=1.6, color=colour, label=name)
    axes.set_ylabel("signal, °/s" if sensor.kind == GYRO else "signal, m/s²")
    axes.grid()


def _samples(plan: LoopPlan, rate: float, until: float) -> tuple[Vector, Vector]:
    """Some of the samples, evenly, with the noise that the loop saw; those within firings are left
    out.
    """
    run = plan.flown_run
    count = math.floor(until * rate) + 1
    shown_at = np.arange(0, count, max(math.ceil(count / SAMPLES), 1))
    signal = Signal(plan.spacecraft, run.loop.sensor, run.key)
    times = []
    values = []
    for block in range(0, count, BLOCK):
        numbers = shown_at[(shown_at >= block) & (shown_at < block + BLOCK)]
        if len(numbers):
            times.append(np.asarray(numbers / rate, dtype=np.float64))
            values.append(signal.sampled(numbers, signal.shown(run.flight.motion(times[-1])[0])))
    instants = np.concatenate(times)
    quiet = np.ones(len(instants), dtype=bool)
    for firing in run.fired:
        quiet &= (instants < firing.pulse.start) | (instants > firing.pulse.end)
    return instants[quiet], np.concatenate(values)[quiet]


def _nutation(axes: Axes, plan: LoopPlan, until: float) -> None:
    """Nutation on a log axis, thresholds, and the nutation seen at each firing."""
    run = plan.flown_run
    track = run.flight.sampled(SAMPLES, until)
    angles = np.degrees(track.nutation)
    start, stop = math.degrees(run.loop.start), math.degrees(run.loop.stop)
    most = max(float(angles.max()), start)
    low = max(0.5 * min(float(angles.min()), stop or start), most * 10.0**-DECADES)
    axes.plot(track.t, np.maximum(angles, 0.1 * low), color=MOTION, label="nutation θ")
    seen = [
        (firing.pulse.t, max(math.degrees(firing.seen), low))
        for firing in run.fired
        if firing.pulse.t <= until
    ]
    if seen:
        axes.plot(*np.transpose(seen), "x", color=PULSE, markersize=4, label="θ seen at a firing")
    axes.axhline(start, color=GREY, linewidth=0.9, linestyle="--", label="start")
    if stop > 0.0:
        axes.axhline(stop, color=GREY, linewidth=0.9, linestyle=":", label="stop")
    style.log_angles(axes, low, 2.0 * most)


@style.styled()
def budget_figure(budget: Budget) -> Figure:
    """Nutation over time: without firing, and the sawtooth of each limit cycle by its means."""
    spacecraft, growth, until = budget.spacecraft, budget.spacecraft.growth, budget.until_largest
    # Cycles, or pulses of a loop that never pauses; with no nutation from the first that could grow
    # at once.
    held = []
    for row in budget.held:
        if row.cycle is not None:
            period = 1.0 / (row.cycle.cycles or row.cycle.pulses)
            begins = row.begins if math.isfinite(row.begins) else 0.0
            held.append((row.thresholds, row.cycle, period, begins))
    size = max([PERIODS * period + begins for _, _, period, begins in held], default=0.0)
    if until is not None and math.isfinite(until):
        size = max(size, 1.2 * until)
    size = size or 3.0 / max(abs(growth), 1e-300)
    unit, seconds = "s", 1.0
    if size > 2.0 * DAY:
        unit, seconds = "days", DAY
    elif size > 7200.0:
        unit, seconds = "hours", 3600.0
    figure = style.sheet(7.4, 4.0)
    axes = figure.subplots()
    times = np.linspace(0.0, size, ROWS)
    free = np.degrees(requirements.idle(spacecraft, times))
    axes.plot(times / seconds, free, color=INK, label="no firing")
    for (thresholds, cycle, period, begins), (colour, line) in zip(held, LINES, strict=False):
        low, high = math.degrees(cycle.low), math.degrees(cycle.high)
        rises = (
            min(requirements.reached(spacecraft, cycle.high, cycle.low), period)
            if high > low > 0.0
            else period
        )
        starts = begins + period * np.arange(max(math.ceil((size - begins) / period), 0))
        drawn = np.stack([starts, starts + period - rises, starts + period], axis=1).ravel()
        name = f"{style.angle(thresholds.start)} to {style.angle(thresholds.stop)}"
        angles = np.tile([low, low, high], len(starts))
        axes.plot(drawn / seconds, angles, color=colour, linestyle=line, label=name)
    if budget.largest is not None:
        axes.axhline(math.degrees(budget.largest), **{**style.LIMIT, "label": "largest allowed"})
    highest = [math.degrees(cycle.largest) for _, cycle, _, _ in held]
    top = max([*highest, math.degrees(budget.largest or 0.0), float(free[0])])
    lows = [math.degrees(cycle.low) for _, cycle, _, _ in held]
    style.log_angles(axes, 0.5 * min([*lows, max(float(free.min()), 1e-3 * top)]), 3.0 * top)
    axes.set(xlabel=f"time, {unit}", xlim=(0.0, size / seconds))
    style.legend(figure, [axes])
    how = "held by the limit cycle of the loop" if held else "without firing"
    style.heading(figure, spacecraft, f"nutation under dissipation, {how}")
    return figure


# standard deviations to either side that residuals are drawn to; outliers beyond are marked at the
# edge
SPREAD = 6.0

ROUNDING = 1e-3
"""Share of the noise taken for the digits below which all residuals are rounding: of real noise
some are above it.
"""

LOOKS = tuple(
    (colour, line) for line in ("-", (0, (4, 1.5)), ":") for colour in (MOTION, INK, MOMENTUM, GREY)
)
"""Colour and line of the signals in turn."""

FARTHEST = 6.0  # pulls beyond are drawn at the edge


@style.styled()
def fit_figure(fitted: Fitted) -> Figure:
    """Residuals of the signals below each other; beside them autocorrelations, and pulls of the
    parameters.
    """
    from nutdamp.estimation.results import estimates

    fit = fitted.core
    signals = fit.model.signals
    figure = style.sheet(8.6, max(4.8, 1.2 + 1.15 * len(signals)))
    sides = figure.add_gridspec(1, 2, width_ratios=[1.2, 1.0])
    left = sides[0].subgridspec(len(signals), 1).subplots(sharex=True, squeeze=False)[:, 0].tolist()
    white, pulls = sides[1].subgridspec(2, 1).subplots(squeeze=False)[:, 0]
    for index, axes in enumerate(left):
        _residuals(axes, fit, index)
    left[0].set_title("Residuals: data less fit")
    left[-1].set_xlabel(TIME)
    _autocorrelation(white, fit)
    _pulls(pulls, [row for row in estimates(fit, 0.0) if row.change is not None and row.prior])
    style.legend(figure, [*left, white])
    shape = "symmetric" if fit.model.body(fit.named).inertia.symmetric else "triaxial"
    count = int(np.count_nonzero(fit.used))
    style.heading(
        figure, fit.model.spacecraft, f"fit of a free rigid body, {shape}, to {count:,} samples"
    )
    return figure


def _residuals(axes: Axes, fit: Fit, index: int) -> None:
    """Residuals of a signal with three sigma of its noise."""
    from nutdamp.views.fit import in_shown

    unit, factor = in_shown(fit.model.signals[index])
    unit = unit.replace("deg", "°")
    rows = fit.model.signal == index
    noise = float(fit.noise[index])
    axes.set_ylabel(f"{fit.model.signals[index]}, {unit}")
    if _rounding(fit, index):
        axes.text(0.5, 0.5, "only rounding", transform=axes.transAxes, ha="center", va="center")
        axes.set_yticks([])
        return
    limit = factor * SPREAD * noise
    left = np.clip(factor * fit.residuals[rows], -limit, limit)
    kept = fit.used[rows]
    times = fit.model.times[rows]
    axes.plot(
        times[kept],
        left[kept],
        color=LOOKS[index % len(LOOKS)][0],
        linestyle="",
        marker=".",
        markersize=2.0,
    )
    if not kept.all():
        axes.plot(times[~kept], left[~kept], color=INK, linestyle="", marker="x", label="left out")
    for side in (-3.0, 3.0):
        axes.axhline(
            side * factor * noise, color=GREY, linewidth=0.9, linestyle="--", label="3 sigma"
        )
    axes.set_ylim(-1.08 * limit, 1.08 * limit)
    axes.grid()


def _rounding(fit: Fit, index: int) -> bool:
    """True where data and fit are the same but for the rounding of their numbers."""
    rows = (fit.model.signal == index) & fit.used
    largest = np.abs(fit.residuals[rows]).max(initial=0.0)
    return bool(largest <= ROUNDING * float(fit.noise[index]))


def _autocorrelation(axes: Axes, fit: Fit) -> None:
    """Autocorrelation of the residuals of all signals, with the band of white noise."""
    axes.set_title("Autocorrelation of the residuals")
    bands = []
    for index, (name, (colour, line)) in enumerate(zip(fit.model.signals, LOOKS, strict=False)):
        correlations = fit.whiteness(index)
        if len(correlations) and not _rounding(fit, index):
            lags = np.arange(1, len(correlations) + 1)
            axes.plot(lags, correlations, color=colour, linestyle=line, linewidth=1.0, label=name)
            bands.append(1.96 / np.sqrt(int((fit.used & (fit.model.signal == index)).sum())))
    if not bands:
        style.words(axes, "too few samples, or only rounding")
        return
    axes.axhspan(
        -max(bands),
        max(bands),
        facecolor=GREY,
        alpha=0.25,
        linewidth=0.0,
        label="95 % of white noise",
    )
    most = max(float(np.abs(line.get_ydata()).max()) for line in axes.lines)
    size = min(1.0, 1.15 * max(most, 2.0 * max(bands)))
    axes.set(xlabel="lag, samples", ylim=(-size, size))
    axes.grid()


def _pulls(axes: Axes, rows: list[Estimate]) -> None:
    """Value less that of the file, with one sigma after the fit,
    both over the sigma of the file.
    """
    axes.set_title("Pulls: change from the file")
    if not rows:
        style.words(axes, "the file has no tolerances of what is fitted")
        return
    places = -np.arange(len(rows), dtype=float)
    changes = np.clip([row.change or 0.0 for row in rows], -FARTHEST, FARTHEST)
    sigmas = [min(row.sigma / (row.prior or 1.0), FARTHEST) for row in rows]
    axes.axvspan(-1.0, 1.0, facecolor=GREY, alpha=0.25, linewidth=0.0)
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    look: dict[str, Any] = {
        "fmt": "o",
        "color": MOTION,
        "markersize": 4,
        "elinewidth": 1.2,
        "capsize": 2.0,
    }
    axes.errorbar(changes, places, xerr=sigmas, **look)
    reach = max(2.0, 1.1 * float((np.abs(changes) + sigmas).max()))
    axes.set(xlabel="sigmas of the file", xlim=(-reach, reach), ylim=(0.6 - len(rows), 0.6))
    axes.set_yticks(places, [row.label for row in rows])
    axes.grid(axis="x")
