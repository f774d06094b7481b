"""The picture of ``disperse --loop``: time until dispersed loops fall quiet, their final motion, and their cost."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.control_loop.dispersion import LoopResults
from nutdamp.figures import style
from nutdamp.figures.legends import heading, legend
from nutdamp.figures.style import GREY, MOTION, PULSE
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.requirements import Part
from nutdamp.views.verdicts import cases_verdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


BINS = 60
"""Bars of a histogram, at most."""

NEAR = 2.0
"""Times the largest value up to which a requirement is drawn beside it."""


@style.styled
def loop_cases_figure(results: LoopResults) -> Figure:
    """Histograms of six outputs, with dead band and requirement."""
    study = results.study
    figure = style.sheet(7.4, 8.4)
    settled, quiet, largest, shift, propellant, firings = figure.subplots(3, 2).ravel()
    degrees = 180.0 / math.pi
    _histogram(settled, results, "settled", 1.0, "first quiet, s")
    _histogram(quiet, results, "quiet", degrees, "left then, deg")
    quiet.axvline(degrees * study.band.most, color=GREY, linewidth=1.2, linestyle="--", label="dead band")
    _histogram(largest, results, "nutation", degrees, "largest, deg")
    _required(largest, results, "nutation", Part.NUTATION)
    aim = requirements.aim(study.spacecraft)
    _histogram(shift, results, aim.value, degrees, f"{aim.label}, deg")
    _required(shift, results, aim.value, aim)
    _histogram(propellant, results, "propellant", 1e3, "propellant, g")
    _histogram(firings, results, "firings", 1.0, "firings")
    firings.locator_params(axis="x", integer=True)
    legend(figure, [quiet, largest, shift])
    share = results.met_fraction
    verdict = "" if share is None else f"\nrequirement {cases_verdict(share, results.probability)}"
    heading(figure, study.spacecraft, f"closed loop, {results.done:,} dispersed cases{verdict}")
    return figure


def _required(axes: Axes, results: LoopResults, output: str, part: Part) -> None:
    """The bound of a part of the requirement, degrees; in words where it is far from every case."""
    limit = next((bound.most for bound in requirements.required(results.study.spacecraft) if bound.part is part), None)
    most = results.distribution(output)
    if limit is None or not most:
        return
    if limit < NEAR * most.maximum:
        axes.axvline(math.degrees(limit), color=PULSE, linewidth=1.4, label="required")
    else:
        far = f"required {math.degrees(limit):.4g}°, outside the view"
        axes.set_title(far, fontsize=style.SMALL, fontweight="normal")


def _histogram(axes: Axes, results: LoopResults, output: str, scale: float, name: str) -> None:
    values = scale * results.of(output)
    axes.set_xlabel(name)
    axes.set_ylabel("cases")
    axes.grid(axis="y")
    if not len(values):
        axes.set_yticks([])
        return
    low, high = float(values.min()), float(values.max())
    bins = min(BINS, max(2 * math.isqrt(len(values)), 1))
    edges = np.linspace(low, high, bins + 1) if high > low else np.array([low - 0.5, low + 0.5])
    axes.hist(values, edges.tolist(), color=MOTION)
