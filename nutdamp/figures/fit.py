"""The picture of ``fit``: data and fit of each signal, residuals, and their autocorrelation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nutdamp.estimation.fit import Fit
from nutdamp.figures import style
from nutdamp.figures.legends import heading, legend
from nutdamp.figures.style import GREY, INK, MOTION, PULSE
from nutdamp.views.fit import in_shown

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


PERIODS = 4.0
"""Nutation periods of data that are drawn."""

SPREAD = 6.0
"""Standard deviations to either side that residuals are drawn to; outliers beyond are marked at the edge."""

ROUNDING = 1e-3
"""Share of the noise taken for the digits below which all residuals are rounding: of real noise some are above it."""

DIFFERENCES = ("axis", "sun_pulse")
"""Signals that are compared as differences: data less fit is all there is of them."""


@style.styled
def fit_figure(fit: Fit) -> Figure:
    """A row for each signal: data and fit over the first periods, residuals, autocorrelations."""
    model = fit.model
    count = len(model.signals)
    figure = style.sheet(7.4, 0.7 + 1.75 * count)
    grid = figure.subplots(count, 3, squeeze=False, width_ratios=[1.25, 1.25, 0.9])
    for index, (name, row) in enumerate(zip(model.signals, grid, strict=True)):
        unit, factor = in_shown(name)
        _data(row[0], fit, index, factor, f"{name}, {unit}")
        _residuals(row[1], fit, index, factor, f"residual, {unit}")
        unseen = _no_correlation(fit, index)
        if unseen:
            style.words(row[2], unseen)
        else:
            _white(row[2], fit, index)
        for axes in row:
            axes.grid()
    for column, text in zip(grid.T, ("time, s", "time, s", "lag, samples"), strict=True):
        for axes in [axes for axes in column if axes.has_data()][-1:]:  # words have no scale
            axes.set_xlabel(text)
    legend(figure, list(grid.ravel()))
    heading(figure, model.spacecraft, "telemetry and fit, what is left, and whether that is white")
    return figure


def _data(axes: Axes, fit: Fit, index: int, factor: float, name: str) -> None:
    model = fit.model
    values = fit.named
    period = 2.0 * np.pi / max(abs((1.0 - values["C/A"]) * values.get("omega_3", model.spacecraft.spin)), 1e-12)
    end = model.start + min(PERIODS * period, model.record.length)
    rows = (model.signal == index) & (model.times <= end)
    times, measured = model.times[rows], model.measured[rows]
    axes.set_ylabel(name)
    if model.signals[index] in DIFFERENCES and _rounding(fit, index):
        style.words(axes, "data and fit are the same\nbut for rounding")
        return
    if model.signals[index] in DIFFERENCES:
        axes.plot(times, factor * measured, color=INK, label="fit")
        shown = fit.residuals[rows]
    else:
        shown = measured
        fitted = measured - fit.residuals[rows]
        order = np.argsort(times)
        axes.plot(times[order], factor * fitted[order], color=INK, label="fit")
        margin = 0.15 * float(np.ptp(fitted)) + SPREAD * float(fit.noise[index])
        axes.set_ylim(factor * (float(fitted.min()) - margin), factor * (float(fitted.max()) + margin))
    axes.plot(times, factor * shown, color=MOTION, linestyle="", marker=".", markersize=2.5, label="data")
    axes.set_xlim(model.start, end)


def _residuals(axes: Axes, fit: Fit, index: int, factor: float, name: str) -> None:
    model, noise = fit.model, float(fit.noise[index])
    rows = model.signal == index
    if _rounding(fit, index):
        style.words(axes, "residuals: only rounding")
        return
    limit = factor * SPREAD * noise
    left = np.clip(factor * fit.residuals[rows], -limit, limit)
    kept = fit.used[rows]
    axes.plot(model.times[rows][kept], left[kept], color=MOTION, linestyle="", marker=".", markersize=2.0)
    if not kept.all():
        axes.plot(model.times[rows][~kept], left[~kept], color=PULSE, linestyle="", marker="x", label="left out")
    for side in (-3.0, 3.0):
        axes.axhline(side * factor * noise, color=GREY, linewidth=0.9, linestyle="--", label="3 sigma")
    axes.set_ylim(-1.08 * limit, 1.08 * limit)
    axes.set_ylabel(name)


def _rounding(fit: Fit, index: int) -> bool:
    """True where data and fit are the same but for the rounding of their numbers."""
    rows = (fit.model.signal == index) & fit.used
    largest = np.abs(fit.residuals[rows]).max(initial=0.0)
    return bool(largest <= ROUNDING * float(fit.noise[index]))


def _no_correlation(fit: Fit, index: int) -> str:
    """The reason why there are no autocorrelations to be drawn; "" where there are."""
    if len(fit.whiteness(index)) == 0:
        return "too few samples for\nautocorrelation"
    if _rounding(fit, index):
        return "only rounding:\nno autocorrelation"
    return ""


def _white(axes: Axes, fit: Fit, index: int) -> None:
    correlations = fit.whiteness(index)
    lags = np.arange(1, len(correlations) + 1)
    count = int((fit.used & (fit.model.signal == index)).sum())
    axes.vlines(lags, 0.0, correlations, color=MOTION, linewidth=1.2)
    for side in (-1.0, 1.0):
        axes.axhline(
            side * 1.96 / np.sqrt(count), color=GREY, linewidth=0.9, linestyle=":", label="95 % of white noise"
        )
    axes.set_ylim(-1.0, 1.0)
    axes.set_ylabel("autocorrelation")
