"""Histograms and distribution functions of a dispersion study."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.dispersion.statistics import Distribution
from nutdamp.dispersion.study import Results
from nutdamp.report.figures import ending, rendered, style
from nutdamp.report.figures.style import GREY, MOTION, PULSE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BINS = 80


def check_picture(path: str) -> None:
    """Raises BadRequest where the ending of ``path`` is no format, MissingExtra without matplotlib."""
    ending(path)
    style.require()


def dispersion_picture(results: Results, path: str, *, scheme: str) -> bytes:
    """`dispersion_figure` as the content of the file ``path``."""
    check_picture(path)
    return rendered(dispersion_figure(results, scheme=scheme), path)


@style.styled
def dispersion_figure(results: Results, *, scheme: str) -> Figure:
    """Histogram and distribution function of nutation and shift of H, with what is required of them."""
    figure = style.sheet(10.0, 7.0)
    grid = figure.subplots(2, 2)
    asked = results.study.model.spacecraft.requirement
    limits = (None, None) if asked is None else (asked.nutation, asked.momentum_shift)
    for row, output, name, limit in zip(
        grid, ("nutation", "momentum_shift"), ("nutation left", "shift of H"), limits, strict=True
    ):
        found = results.distribution(output)
        if found is None:
            continue
        limit_deg = None if limit is None else math.degrees(limit)
        _histogram(row[0], found, name)
        _function(row[1], found, name, results)
        for axes in row:
            _mark(axes, found, limit_deg, results.probability)
    figure.suptitle(f"{results.study.model.spacecraft.name}: {scheme}, {results.done:,} dispersed truths")
    return figure


def _histogram(axes: Axes, found: Distribution, name: str) -> None:
    """Up to what 999 of 1000 cases stay below; the rest would only stretch the axis."""
    end = float(found.quantiles(np.array([0.999]))[0])
    edges = np.linspace(found.minimum, max(end, found.minimum * (1.0 + 1e-9) + 1e-12), BINS + 1)
    counts = found.histogram(edges)
    share = 100.0 * counts / max(counts.sum(), 1.0)
    axes.stairs(share, np.degrees(edges), fill=True, color=MOTION, alpha=0.85, label="cases")
    axes.set(xlabel=f"{name}, deg", ylabel="cases in each bin, %", title=f"{name}: histogram")


def _function(axes: Axes, found: Distribution, name: str, results: Results) -> None:
    """How many cases lie beyond: on a scale that shows the last per mille as well as the first half."""
    tail = np.logspace(0.0, -math.log10(max(results.done, 10)), 400)
    axes.plot(np.degrees(found.quantiles(1.0 - tail)), 100.0 * tail, color=MOTION, linewidth=1.6, label="cases")
    allowed = 100.0 * (1.0 - results.probability)
    axes.axhline(allowed, color=GREY, linewidth=1.0, linestyle=":", label=f"{allowed:.3g} % allowed")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set(xlabel=f"{name}, deg", ylabel="cases beyond, %", title=f"{name}: distribution (1 - CDF)")
    axes.grid()


def _mark(axes: Axes, found: Distribution, limit: float | None, probability: float) -> None:
    """Where as many cases lie as shall meet the requirement, and the requirement."""
    reached = math.degrees(float(found.quantiles(np.array([probability]))[0]))
    axes.axvline(
        reached, color=GREY, linewidth=1.0, linestyle="--", label=f"{100 * probability:.6g} % within {reached:.3g}°"
    )
    if limit is not None:
        axes.axvline(limit, color=PULSE, linewidth=1.6, label=f"required: {limit:.3g}°")
    axes.legend(loc="best")
