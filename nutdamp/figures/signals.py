"""Pictures of signals: one run of ``loop``, the nutation that ``budget`` holds, and residuals of a
``fit``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.control_loop.budget import DAY, YEAR, Budget
from nutdamp.control_loop.evaluation import LoopPlan
from nutdamp.figures import style
from nutdamp.figures.geometry import ticks
from nutdamp.figures.overview import EDGE, TIME, firings, firings_height, title
from nutdamp.figures.style import GREY, INK, MOTION, PULSE
from nutdamp.spacecraft import requirements
from nutdamp.views.loop import described

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from nutdamp.estimation.model import Fit
    from nutdamp.estimation.results import Estimate, Fitted

SAMPLES = 3000  # rows of the nutation of a run
DECADES = 5.0  # largest number of decades of the nutation on its log axis
PERIODS = 4.0  # cycles drawn of the longest limit cycle
ROWS = 600  # rows of the nutation without firing


@style.styled()
def loop_figure(plan: LoopPlan) -> Figure:
    """Nutation on a log axis with thresholds, dead band and the nutation seen at each firing, above
    the firings, and what holding it takes.
    """
    run = plan.flown_run
    unit, seconds = time_unit(run.until)
    heights = [2.6, *firings_height(run.flight)]
    figure = style.sheet(7.4, 1.8 + sum(heights))
    panels = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights, sharex=True)
    axes, last = panels[0, 0], panels[-1, 0]
    track = run.flight.sampled(SAMPLES, run.until)
    angles = np.degrees(track.nutation)
    start, stop, band = np.degrees([run.loop.start, run.loop.stop, plan.band.most]).tolist()
    most = max(float(angles.max()), start)
    lowest = min(float(angles.min()), stop or start, band or start)
    low = max(0.5 * lowest, most * 10.0**-DECADES)
    axes.plot(track.t, np.maximum(angles, 0.1 * low), color=MOTION, label="nutation θ")
    if run.fired:
        seen = [(firing.pulse.t, max(math.degrees(firing.seen), low)) for firing in run.fired]
        axes.plot(*np.transpose(seen), "x", color=PULSE, markersize=4, label="θ seen at a firing")
        firings(last, run.flight, run.until)
    for name, level, line in (("start", start, "--"), ("stop", stop, ":")):
        if level > 0.0:
            axes.axhline(level, color=GREY, linewidth=0.9, linestyle=line, label=name)
    axes.axhspan(0.1 * low, max(band, 0.1 * low), label="dead band", **style.BAND)
    style.log_angles(axes, low, 2.0 * most)
    axes.set_xlim(-EDGE * run.until, run.until)
    axes.set_title(upkeep(plan), loc="right", **style.NOTE)
    if seconds > 1.0:  # the panels are drawn over seconds
        times = np.array(ticks(0.0, run.until / seconds, 7))
        last.set_xticks(seconds * times, [f"{time:g}" for time in times])
    last.set_xlabel(f"time, {unit}")
    style.legend(figure, figure.axes)
    loop = described(run.loop, thresholds=False).replace(" deg", "°")
    return style.finished(figure, run.flight.spacecraft, f"{title(run.flight)}\n{loop}")


def time_unit(until: float) -> tuple[str, float]:
    """Unit of a time axis to ``until`` s, and its seconds."""
    if until > 2.0 * DAY:
        return "days", DAY
    return ("hours", 3600.0) if until > 7200.0 else ("s", 1.0)


def upkeep(plan: LoopPlan) -> str:
    """Pulses a day and propellant a year of the whole cycles of the run, as a budget counts them,
    from quiet to quiet; empty where there is none.

    The first cycle, which begins where the initial nutation was left, counts in a run of no other.
    """
    run = plan.flown_run
    if len(run.quiet) < 2:
        return ""
    begin = run.quiet[0] if len(run.quiet) == 2 else run.quiet[1]
    lasts = run.quiet[-1] - begin
    later = [firing.pulse for firing in run.fired if begin < firing.pulse.t < run.quiet[-1]]
    text = f"from quiet to quiet: {style.number(len(later) / lasts * DAY)} pulses a day"
    masses = [pulse.propellant for pulse in later if pulse.propellant is not None]
    if len(masses) < len(later):
        return text
    return f"{text}, {style.number(math.fsum(masses) / lasts * YEAR)} kg a year"


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
    unit, seconds = time_unit(size)
    figure = style.sheet(7.4, 4.0)
    axes = figure.subplots()
    times = np.linspace(0.0, size, ROWS)
    free = np.degrees(requirements.idle(spacecraft, times))
    axes.plot(times / seconds, free, color=INK, label="no firing")
    highest, lows = [float(free[0])], []
    for (thresholds, cycle, period, begins), (colour, _, line) in zip(
        held, style.LOOKS, strict=False
    ):
        low, high = math.degrees(cycle.low), math.degrees(cycle.high)
        rises = period
        if high > low > 0.0:
            rises = min(requirements.reached(spacecraft, cycle.high, cycle.low), period)
        starts = begins + period * np.arange(max(math.ceil((size - begins) / period), 0))
        drawn = np.stack([starts, starts + period - rises, starts + period], axis=1).ravel()
        name = f"{style.angle(thresholds.start)} to {style.angle(thresholds.stop)}"
        angles = np.tile([low, low, high], len(starts))
        axes.plot(drawn / seconds, angles, color=colour, linestyle=line, label=name)
        highest.append(math.degrees(cycle.largest))
        lows.append(low)
    if budget.largest is not None:
        highest.append(math.degrees(budget.largest))
        axes.axhline(highest[-1], **{**style.LIMIT, "label": "largest allowed"})
    top = max(highest)
    style.log_angles(axes, 0.5 * min([*lows, max(float(free.min()), 1e-3 * top)]), 3.0 * top)
    axes.set(xlabel=f"time, {unit}", xlim=(0.0, size / seconds))
    style.legend(figure, [axes])
    how = "held by the limit cycle of the loop" if held else "without firing"
    return style.finished(figure, spacecraft, f"nutation under dissipation, {how}")


# standard deviations to either side that residuals are drawn to; outliers beyond are marked at the
# edge
SPREAD = 6.0  # twice the three that are marked

# share of the noise taken for the digits below which all residuals are rounding: of real noise some
# are above it
ROUNDING = 1e-3
LABELS = 8  # labels of pulls that fit into half of the height
FARTHEST = 6.0  # pulls beyond are drawn at the edge


@style.styled()
def fit_figure(fitted: Fitted) -> Figure:
    """Residuals of the signals below each other; beside them autocorrelations, and pulls of the
    parameters.
    """
    from nutdamp.estimation.results import estimates

    fit = fitted.core
    noisy = [index for index in range(len(fit.model.signals)) if not _rounding(fit, index)]
    shown = noisy or [0]
    exact = [name for index, name in enumerate(fit.model.signals) if index not in shown]
    pulled = [row for row in estimates(fit, 0.0) if row.change is not None and row.prior]
    correlated = [index for index in noisy if len(fit.whiteness(index))]
    aside: list[tuple[Callable[[Axes], None], float]] = []
    if correlated:
        aside.append((partial(_autocorrelation, fit=fit, shown=correlated), 1.0))
    if pulled:
        aside.append((partial(_pulls, rows=pulled), max(1.0, len(pulled) / LABELS)))
    figure = style.sheet(8.6 if aside else 5.4, max(4.8, 1.2 + 1.15 * len(shown)))
    sides = figure.add_gridspec(1, 2, width_ratios=[1.2, 1.0 if aside else 1e-3])
    left = sides[0].subgridspec(len(shown), 1).subplots(sharex=True, squeeze=False)[:, 0]
    for index, axes in zip(shown, left, strict=True):
        _residuals(axes, fit, index)
    times = fit.model.times
    left[0].set(title="Residuals: data less fit", xlim=(times.min(), times.max()))
    left[-1].set_xlabel(f"{TIME}\nonly rounding: {', '.join(exact)}" if exact else TIME)
    for row, (draw, _) in enumerate(aside):
        beside = sides[1].subgridspec(len(aside), 1, height_ratios=[size for _, size in aside])
        draw(figure.add_subplot(beside[row]))
    style.legend(figure, figure.axes)
    shape = "symmetric" if fit.model.body(fit.named).inertia.symmetric else "triaxial"
    count = int(np.count_nonzero(fit.used))
    about = f"fit of a free rigid body, {shape}, to {count:,} samples"
    return style.finished(figure, fit.model.spacecraft, about)


def _residuals(axes: Axes, fit: Fit, index: int) -> None:
    """Residuals of a signal with three sigma of its noise."""
    from nutdamp.views.fit import in_shown

    unit, factor = in_shown(fit.model.signals[index])
    unit = unit.replace("deg", "°")
    rows = fit.model.signal == index
    noise = float(fit.noise[index])
    axes.set_ylabel(f"{fit.model.signals[index]}, {unit}")
    if _rounding(fit, index):
        style.words(axes, "only rounding")
        return
    limit = factor * SPREAD * noise
    left = np.clip(factor * fit.residuals[rows], -limit, limit)
    kept = fit.used[rows]
    times = fit.model.times[rows]
    colour, *_ = style.LOOKS[index % len(style.LOOKS)]
    axes.plot(times[kept], left[kept], ".", color=colour, markersize=2.0)
    if not kept.all():
        axes.plot(times[~kept], left[~kept], "x", color=INK, label="left out")
    for side in (-0.5 * limit, 0.5 * limit):
        axes.axhline(side, color=GREY, linewidth=0.9, linestyle="--", label="3 sigma")
    axes.set_ylim(-1.08 * limit, 1.08 * limit)
    axes.grid()


def _rounding(fit: Fit, index: int) -> bool:
    """True where data and fit are the same but for the rounding of their numbers."""
    rows = (fit.model.signal == index) & fit.used
    largest = np.abs(fit.residuals[rows]).max(initial=0.0)
    return bool(largest <= ROUNDING * float(fit.noise[index]))


def _autocorrelation(axes: Axes, fit: Fit, shown: Sequence[int]) -> None:
    """Autocorrelation of the residuals of the signals ``shown``, with the band of white noise."""
    axes.set_title("Autocorrelation of the residuals")
    bands = []
    for index in shown:
        correlations = fit.whiteness(index)
        lags = np.arange(1, len(correlations) + 1)
        colour, _, line = style.LOOKS[index % len(style.LOOKS)]
        name = fit.model.signals[index]
        axes.plot(lags, correlations, color=colour, linestyle=line, linewidth=1.0, label=name)
        bands.append(1.96 / np.sqrt(int((fit.used & (fit.model.signal == index)).sum())))
    axes.axhspan(-max(bands), max(bands), label="95 % of white noise", **style.BAND)
    most = max(float(np.abs(line.get_ydata()).max()) for line in axes.lines)
    size = min(1.0, 1.15 * max(most, 2.0 * max(bands)))
    axes.set(xlabel="lag, samples", ylim=(-size, size))
    axes.grid()


def _pulls(axes: Axes, rows: Sequence[Estimate]) -> None:
    """Value less that of the file, with one sigma after the fit,
    both over the sigma of the file.
    """
    axes.set_title("Pulls: change from the file")
    places = -np.arange(len(rows), dtype=float)
    changes = np.clip([row.change or 0.0 for row in rows], -FARTHEST, FARTHEST)
    sigmas = [min(row.sigma / (row.prior or 1.0), FARTHEST) for row in rows]
    axes.axvspan(-1.0, 1.0, **style.BAND)
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    axes.errorbar(
        changes, places, xerr=sigmas, fmt="o", color=MOTION, markersize=4, elinewidth=1.2, capsize=2
    )
    reach = max(2.0, 1.1 * float((np.abs(changes) + sigmas).max()))
    axes.set(xlabel="sigmas of the file", xlim=(-reach, reach), ylim=(0.6 - len(rows), 0.6))
    axes.set_yticks(places, [row.label for row in rows])
    axes.grid(axis="x")
