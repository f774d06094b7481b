"""Pictures of a dispersion study: how the cases are distributed, where H ends in them, which tolerance counts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from nutdamp import compliance
from nutdamp.compliance import Part
from nutdamp.dispersion.outputs import VECTORS
from nutdamp.dispersion.statistics import Distribution
from nutdamp.dispersion.study import EARLY, Results
from nutdamp.physics import attitude
from nutdamp.presentation import geometry
from nutdamp.presentation.dispersion_tables import budget_rows
from nutdamp.presentation.figures import style
from nutdamp.presentation.figures.style import GREY, INK, MOMENTUM, MOTION, PULSE
from nutdamp.presentation.verdicts import cases_verdict, exact_percent
from nutdamp.spacecraft import Vector

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

BINS = 80

TAIL, KNEE = 2.0, 0.999
"""A histogram ends at the largest value, or where that is more, at TAIL times what KNEE of the cases stay below."""

DOTS = 2_000
"""Cases shown as dots: more would only make the picture heavy."""


@style.styled
def dispersion_figure(name: str, results: Results, *, scheme: str) -> Figure:
    """The figure ``overview``, ``cases``, ``momentum`` or ``budget``; raises KeyError for others."""
    study = results.study
    figure = DRAWN[name](results)
    how = "real pulse widths" if study.flown else "impulse sum (17)"
    heading = f"{study.model.spacecraft.name}: {scheme} by {how}, {results.done:,} dispersed cases"
    share = results.met_fraction
    verdict = "" if share is None else f"\nrequirement {cases_verdict(share, results.probability)}"
    figure.suptitle(heading + verdict)
    style.settle(figure)
    return figure


def overview(results: Results) -> Figure:
    """All of them on one sheet."""
    figure = style.sheet(11.0, 9.4)
    upper, lower = figure.subfigures(2, 1, height_ratios=[1.5, 1.0], squeeze=False)[:, 0]
    left, right = upper.subfigures(1, 2, width_ratios=[1.9, 1.0], squeeze=False)[0]
    _cases(left, results)
    _momentum(right, results)
    _budget(lower, results)
    return figure


def cases(results: Results) -> Figure:
    """Histogram and distribution function of nutation and shift of H, with what is required of them."""
    figure = style.sheet(7.4, 5.6)
    _cases(figure, results)
    return figure


def momentum(results: Results) -> Figure:
    """Where H ends in each case, seen from outside, with the ellipse that holds as many as must comply."""
    figure = style.sheet(5.8, 5.6)
    _momentum(figure, results)
    return figure


def budget(results: Results) -> Figure:
    """What each tolerance does to nutation and shift of H, side by side."""
    figure = style.sheet(7.4, 1.5 + 0.22 * len(budget_rows(results.study)))
    _budget(figure, results)
    return figure


DRAWN = {"overview": overview, "cases": cases, "momentum": momentum, "budget": budget}


def _limit(results: Results, part: Part) -> float | None:
    """What is required of a part, degrees."""
    bounds = compliance.required(results.study.model.spacecraft)
    return next((math.degrees(bound.most) for bound in bounds if bound.part is part), None)


def _cases(figure: Figure | SubFigure, results: Results) -> None:
    grid = figure.subplots(2, 2)
    for row, part in zip(grid, (Part.NUTATION, compliance.aim(results.study.model.spacecraft)), strict=True):
        found = results.distribution(part.value)
        if found is None:
            continue
        name = "nutation left" if part is Part.NUTATION else part.label
        limit = _limit(results, part)
        _histogram(row[0], found, name, limit)
        _function(row[1], found, name, results)
        reached = math.degrees(float(found.quantiles(np.array([results.probability]))[0]))
        for axes in row:
            _mark(axes, reached, limit, results.probability)
        required = "" if limit is None else f", required {limit:.4g}°"
        row[1].set_title(f"{exact_percent(results.probability)} within {reached:.4g}°{required}")
    style.legend(figure, list(grid.flat))


def _histogram(axes: Axes, found: Distribution, name: str, limit: float | None) -> None:
    """To the largest value; a long tail is cut, and said to be."""
    knee, end = float(found.quantiles(np.array([KNEE]))[0]), found.maximum
    cut = end > TAIL * knee > 0.0
    end = TAIL * knee if cut else end
    edges = np.linspace(found.minimum, max(end, found.minimum * (1.0 + 1e-9) + 1e-12), BINS + 1)
    counts = found.histogram(np.append(edges, found.maximum) if cut else edges)
    share = 100.0 * counts / max(counts.sum(), 1.0)
    axes.stairs(share[:BINS], np.degrees(edges), fill=True, color=MOTION, alpha=0.85, label="cases")
    title = f"{name}: histogram"
    if cut:
        title += f"\n{share[-1]:.2g} % of the cases lie beyond, up to {math.degrees(found.maximum):.4g}°"
    elif limit is not None and limit > math.degrees(edges[-1]):
        axes.set_xlim(right=1.04 * limit)
    axes.set(xlabel=f"{name}, deg", ylabel="cases in each bin, %", title=title)


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
    share = exact_percent(probability)
    axes.axvline(reached, color=GREY, linewidth=1.0, linestyle="--", label=f"{share} of the cases")
    if limit is not None:
        axes.axvline(limit, color=PULSE, linewidth=1.6, label="required")
    axes.locator_params(axis="x", nbins=6)


def momentum_cases(results: Results) -> Vector:
    """(n, 2): H at the end of the first cases as angles in degrees, from the target or from where it was.

    Directions are those of `geometry.sky_plane`; the distance from zero is the axis error or the shift of H.
    """
    model = results.study.model
    vectors = results.early[VECTORS[compliance.aim(model.spacecraft).value], : min(results.done, EARLY)].T
    turn = model.spacecraft.initial.quaternion
    plane = geometry.sky_plane(results.study.nominal, attitude.rotate(turn, model.target))
    across = (attitude.rotate(turn, vectors) @ plane.T)[:, :2]
    size = np.linalg.norm(across, axis=1)
    angle = np.degrees(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(vectors, axis=1), 0.0, 1.0)))
    return np.asarray(across * np.divide(angle, size, out=np.zeros_like(angle), where=size > 0.0)[:, None])


def ellipse(points: Vector, share: float) -> Vector:
    """(m, 2): the ellipse about the mean of ``points`` (n, 2), of their covariance, that holds ``share`` of them."""
    middle = points.mean(axis=0)
    variances, vectors = np.linalg.eigh((points - middle).T @ (points - middle) / len(points))
    sizes = np.sqrt(np.maximum(variances, 0.0))
    along = (points - middle) @ vectors
    away = np.hypot(*np.divide(along, sizes, out=np.zeros_like(along), where=sizes > 0.0).T)
    turn = np.linspace(0.0, 2.0 * math.pi, 121)
    circle = np.column_stack([np.cos(turn), np.sin(turn)]) * sizes * float(np.quantile(away, share))
    return np.asarray(middle + circle @ vectors.T)


def _momentum(figure: Figure | SubFigure, results: Results) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    axes = figure.subplots()
    body = results.study.model.spacecraft
    aim = compliance.aim(body)
    points, limit = momentum_cases(results), _limit(results, aim)
    around = ellipse(points, results.probability)
    # One path for all dots, as short in a file as can be: strokes of next to no length with round caps.
    few = points[:DOTS]
    short = np.array([1e-3 * float(np.ptp(few, axis=0).max()), 0.0])
    ends = np.stack([few, few + short], axis=1).reshape(-1, 2)
    dots = Path(ends, [Path.MOVETO, Path.LINETO] * len(few))
    dots.should_simplify = False
    axes.add_patch(PathPatch(dots, edgecolor=MOTION, facecolor="none", linewidth=1.6, capstyle="round", alpha=0.5))
    axes.plot([], [], ".", color=MOTION, alpha=0.5, label=f"{len(few):,} of the cases")
    axes.plot(
        *around.T, color=MOMENTUM, linewidth=1.5, label=f"holds {exact_percent(results.probability)} of the cases"
    )
    shown = [points, around]
    if limit is not None:
        turn = np.linspace(0.0, 2.0 * math.pi, 121)
        shown.append(limit * np.column_stack([np.cos(turn), np.sin(turn)]))
        axes.plot(*shown[-1].T, color=PULSE, linewidth=1.6, label=f"required: {limit:.4g}°")
    centre = "H(0)" if aim is Part.SHIFT else "the target"
    axes.plot(0.0, 0.0, "+", color=INK, markersize=9, markeredgewidth=1.4, label=centre)
    style.square(axes, np.vstack(shown), margin=0.08)
    sky = geometry.sky_names(results.study.nominal, centre)
    axes.set(xlabel=sky.x, ylabel=sky.y, title=f"Where H ends, about {centre}\n{sky.view}")
    style.legend(figure, [axes], 2)


def _budget(figure: Figure | SubFigure, results: Results) -> None:
    """Bars as long as the effects are, the largest on top: a tornado."""
    rows = budget_rows(results.study)
    pair = figure.subplots(1, 2, sharey=True)
    places = -np.arange(len(rows), dtype=float)
    parts = (Part.NUTATION, compliance.aim(results.study.model.spacecraft))
    for axes, part, colour, index in zip(pair, parts, (MOTION, MOMENTUM), (0, 1), strict=True):
        effects = np.degrees([row.effects[index] for row in rows])
        hatches = ["////" if row.bias else "" for row in rows]
        bars = axes.barh(places, effects, height=0.62, facecolor=colour, edgecolor=INK, linewidth=0.5, alpha=0.85)
        for bar, hatch in zip(bars, hatches, strict=True):
            bar.set_hatch(hatch)
        for place, effect in zip(places, effects, strict=True):
            axes.annotate(
                f"{effect:.3g}", (effect, place), (3, 0), textcoords="offset points", va="center", fontsize=style.SMALL
            )
        axes.set_xlim(0.0, 1.3 * max(float(effects.max(initial=0.0)), 1e-12))
        limit = _limit(results, part)
        if limit is not None and limit < axes.get_xlim()[1]:
            axes.axvline(limit, color=PULSE, linewidth=1.6, label="required")
        name = "nutation" if part is Part.NUTATION else part.label
        axes.set(xlabel=f"{name}, deg", title=f"Each input alone: {name}")
        axes.grid(axis="x")
    pair[0].set_yticks(places, [f"{row.name}, {row.size}" if row.size else row.name for row in rows])
    style.legend(figure, list(pair))
