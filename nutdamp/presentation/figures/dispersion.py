"""Histograms and distribution functions of a dispersion study."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nutdamp import compliance
from nutdamp.dispersion.statistics import Distribution
from nutdamp.dispersion.study import Results
from nutdamp.presentation.figures import style
from nutdamp.presentation.figures.style import GREY, MOTION, PULSE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BINS = 80


@style.styled
def dispersion_figure(results: Results, *, scheme: str) -> Figure:
    """Histogram and distribution function of nutation and shift of H, with what is required of them."""
    figure = style.sheet(7.4, 5.4)
    grid = figure.subplots(2, 2)
    aim = compliance.aim(results.study.model.spacecraft)
    requested = results.study.model.spacecraft.requirement
    limits = (None, None) if requested is None else (requested.nutation, requested.momentum_shift)
    for row, output, name, limit in zip(
        grid, ("nutation", aim.value), ("nutation left", aim.label), limits, strict=True
    ):
        found = results.distribution(output)
        if found is None:
            continue
        limit_deg = None if limit is None else math.degrees(limit)
        _histogram(row[0], found, name)
        _function(row[1], found, name, results)
        reached = math.degrees(float(found.quantiles(np.array([results.probability]))[0]))
        for axes in row:
            _mark(axes, reached, limit_deg, results.probability)
        required = "" if limit_deg is None else f", required {limit_deg:.3g}°"
        row[0].set_title(f"{name}: histogram")
        row[1].set_title(f"{100 * results.probability:.6g} % within {reached:.3g}°{required}")
    style.legend(figure, list(grid.flat))
    figure.suptitle(f"{results.study.model.spacecraft.name}: {scheme}, {results.done:,} dispersed cases")
    return figure


def _histogram(axes: Axes, found: Distribution, name: str) -> None:
    """Up to what 999 of 1000 cases stay below; the rest would only stretch the axis."""
    end = float(found.quantiles(np.array([0.999]))[0])
    edges = np.linspace(found.minimum, max(end, found.minimum * (1.0 + 1e-9) + 1e-12), BINS + 1)
    counts = found.histogram(edges)
    share = 100.0 * counts / max(counts.sum(), 1.0)
    axes.stairs(share, np.degrees(edges), fill=True, color=MOTION, alpha=0.85, label="cases")
    axes.set(xlabel=f"{name}, deg", ylabel="cases in each bin, %")


def _function(axes: Axes, found: Distribution, name: str, results: Results) -> None:
    """How many cases lie beyond: on a scale that shows the last per mille as well as the first half."""
    tail = np.logspace(0.0, -math.log10(max(results.done, 10)), 400)
    axes.plot(np.degrees(found.quantiles(1.0 - tail)), 100.0 * tail, color=MOTION, linewidth=1.6, label="cases")
    allowed = 100.0 * (1.0 - results.probability)
    axes.axhline(allowed, color=GREY, linewidth=1.0, linestyle=":", label=f"{allowed:.3g} % may lie beyond")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set(xlabel=f"{name}, deg", ylabel="cases beyond, %")
    axes.grid(True)


def _mark(axes: Axes, reached: float, limit: float | None, probability: float) -> None:
    """Where as many cases lie as shall meet the requirement, and the requirement, degrees."""
    axes.axvline(reached, color=GREY, linewidth=1.0, linestyle="--", label=f"{100 * probability:.6g} % of the cases")
    if limit is not None:
        axes.axvline(limit, color=PULSE, linewidth=1.6, label="required")
    axes.locator_params(axis="x", nbins=6)
