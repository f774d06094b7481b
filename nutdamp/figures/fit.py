"""The picture of ``fit``: residuals of each signal, their autocorrelation, and what the data change of the file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.estimation.results import Estimate, estimates
from nutdamp.estimation.search import Fit
from nutdamp.figures import style
from nutdamp.figures.style import GREY, INK, MOMENTUM, MOTION
from nutdamp.views.fit import in_shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


SPREAD = 6.0  # standard deviations to either side that residuals are drawn to; outliers beyond are marked at the edge

ROUNDING = 1e-3
"""Share of the noise taken for the digits below which all residuals are rounding: of real noise some are above it."""

LOOKS = tuple((colour, line) for line in ("-", (0, (4, 1.5)), ":") for colour in (MOTION, INK, MOMENTUM, GREY))
"""Colour and line of the signals in turn."""

FARTHEST = 6.0  # pulls beyond are drawn at the edge


@style.styled
def fit_figure(fit: Fit) -> Figure:
    """Residuals of the signals below each other; beside them autocorrelations, and pulls of the parameters."""
    signals = fit.model.signals
    figure = style.sheet(8.6, max(4.8, 1.2 + 1.15 * len(signals)))
    sides = figure.add_gridspec(1, 2, width_ratios=[1.2, 1.0])
    rows, others = sides[0].subgridspec(len(signals), 1), sides[1].subgridspec(2, 1)
    left: list[Axes] = []
    for index in range(len(signals)):
        left.append(figure.add_subplot(rows[index], sharex=left[0] if left else None))
        _residuals(left[-1], fit, index)
        left[-1].tick_params(labelbottom=index + 1 == len(signals))
    left[0].set_title("Residuals: data less fit")
    left[-1].set_xlabel("time, s")
    white, pulls = figure.add_subplot(others[0]), figure.add_subplot(others[1])
    _autocorrelation(white, fit)
    _pulls(pulls, [row for row in estimates(fit, 0.0) if row.change is not None and row.prior])
    style.legend(figure, [*left, white])
    shape = "symmetric" if fit.model.body(fit.named).symmetric else "triaxial"
    count = int(np.count_nonzero(fit.used))
    style.heading(figure, fit.model.spacecraft, f"fit of a free rigid body, {shape}, to {count:,} samples")
    return figure


def _residuals(axes: Axes, fit: Fit, index: int) -> None:
    """Residuals of a signal with three sigma of its noise."""
    unit, factor = in_shown(fit.model.signals[index])
    unit = unit.replace("deg", "°")
    rows, noise = fit.model.signal == index, float(fit.noise[index])
    axes.set_ylabel(f"{fit.model.signals[index]}, {unit}")
    if _rounding(fit, index):
        axes.text(0.5, 0.5, "only rounding", transform=axes.transAxes, ha="center", va="center")
        axes.set_yticks([])
        return
    limit = factor * SPREAD * noise
    left, kept = np.clip(factor * fit.residuals[rows], -limit, limit), fit.used[rows]
    times = fit.model.times[rows]
    axes.plot(times[kept], left[kept], color=LOOKS[index % len(LOOKS)][0], linestyle="", marker=".", markersize=2.0)
    if not kept.all():
        axes.plot(times[~kept], left[~kept], color=INK, linestyle="", marker="x", label="left out")
    for side in (-3.0, 3.0):
        axes.axhline(side * factor * noise, color=GREY, linewidth=0.9, linestyle="--", label="3 sigma")
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
    axes.axhspan(-max(bands), max(bands), facecolor=GREY, alpha=0.25, linewidth=0.0, label="95 % of white noise")
    most = max(float(np.abs(line.get_ydata()).max()) for line in axes.lines)
    size = min(1.0, 1.15 * max(most, 2.0 * max(bands)))
    axes.set(xlabel="lag, samples", ylim=(-size, size))
    axes.grid()


def _pulls(axes: Axes, rows: list[Estimate]) -> None:
    """Value less that of the file, with one sigma after the fit, both over the sigma of the file."""
    axes.set_title("Pulls: change from the file")
    if not rows:
        style.words(axes, "the file has no tolerances of what is fitted")
        return
    places = -np.arange(len(rows), dtype=float)
    changes = np.clip([row.change or 0.0 for row in rows], -FARTHEST, FARTHEST)
    sigmas = [min(row.sigma / (row.prior or 1.0), FARTHEST) for row in rows]
    axes.axvspan(-1.0, 1.0, facecolor=GREY, alpha=0.25, linewidth=0.0)
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    look: dict[str, Any] = {"fmt": "o", "color": MOTION, "markersize": 4, "elinewidth": 1.2, "capsize": 2.0}
    axes.errorbar(changes, places, xerr=sigmas, **look)
    reach = max(2.0, 1.1 * float((np.abs(changes) + sigmas).max()))
    axes.set(xlabel="sigmas of the file", xlim=(-reach, reach), ylim=(0.6 - len(rows), 0.6))
    axes.set_yticks(places, [row.label for row in rows])
    axes.grid(axis="x")
