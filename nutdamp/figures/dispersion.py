"""Pictures of a dispersion study: distribution of the cases, final directions of H, effect of each tolerance."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.figures import geometry, labels, style
from nutdamp.figures.legends import heading, legend
from nutdamp.figures.style import GREY, INK, MOMENTUM, MOTION, PULSE
from nutdamp.flight.propagation import model_name
from nutdamp.montecarlo.statistics import VECTORS, Distribution
from nutdamp.montecarlo.study import EARLY, Results
from nutdamp.physics import attitude
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Vector
from nutdamp.spacecraft.requirements import Part
from nutdamp.views.tolerances import budget_rows
from nutdamp.views.verdicts import cases_verdict, exact_percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure


BINS = 80

TAIL, KNEE = 2.0, 0.999
"""The axis is logarithmic where the largest value is more than TAIL times the quantile KNEE."""

DECADES = 6.0
"""Largest number of decades of that axis: its first bin holds all smaller values."""

STEPS = 100
"""Cases at the end of a distribution function that have a step each."""

ALIKE = 1e-9
"""Relative difference up to which the values of all cases are one, but for rounding."""

NOTHING, NEXT_TO_NOTHING = 1e-6, "1e-6°"
"""Degrees below which all cases together are not worth a picture, and their text."""

FAR = 4.0
"""A requirement is drawn where it is at most so many times the largest value: beyond, it would leave a panel empty."""

FEW = 4
"""Least number of rows of a tornado: fewer bars are no thicker."""

DOTS = 2_000
"""Largest number of cases shown as dots: more would only make the picture heavy."""

DENSE = 0.8
"""Opacity of a dot: fainter ones are not seen (less than 3:1 on white)."""


@style.styled
def dispersion_figure(name: str, results: Results, *, scheme: str) -> Figure:
    """The figure ``overview``, ``cases``, ``momentum`` or ``budget``; raises KeyError for others."""
    study = results.study
    figure = DRAWN[name](results)
    how = model_name([study.model.schedule])
    shown = f"{scheme} by {how}, {results.done:,} dispersed cases"
    share = results.met_fraction
    verdict = "" if share is None else f"\nrequirement {cases_verdict(share, results.probability)}"
    heading(figure, study.model.spacecraft, shown + verdict)
    labels.settle(figure)
    return figure


def overview(results: Results) -> Figure:
    """All figures on one sheet."""
    figure = style.sheet(11.0, 9.4)
    upper, lower = figure.subfigures(2, 1, height_ratios=[1.5, 1.0], squeeze=False)[:, 0]
    left, right = upper.subfigures(1, 2, width_ratios=[1.9, 1.0], squeeze=False)[0]
    _cases(left, results)
    _momentum(right, results)
    _budget(lower, results)
    return figure


def cases(results: Results) -> Figure:
    """Histogram and distribution function of nutation and momentum shift, with their requirements."""
    figure = style.sheet(7.4, 5.6)
    _cases(figure, results)
    return figure


def momentum(results: Results) -> Figure:
    """Final direction of H in each case, seen from outside, with the ellipse that holds as many as must comply."""
    figure = style.sheet(4.1, 4.5)
    _momentum(figure, results)
    return figure


def budget(results: Results) -> Figure:
    """Effect of each tolerance on nutation and momentum shift, side by side."""
    figure = style.sheet(8.0, 1.7 + 0.22 * max(len(budget_rows(results.study)), FEW))
    _budget(figure, results)
    return figure


DRAWN = {"overview": overview, "cases": cases, "momentum": momentum, "budget": budget}


def _limit(results: Results, part: Part) -> float | None:
    """The bound required of a part, degrees."""
    bounds = requirements.required(results.study.model.spacecraft)
    return next((math.degrees(bound.most) for bound in bounds if bound.part is part), None)


def _cases(figure: Figure | SubFigure, results: Results) -> None:
    grid = figure.subplots(2, 2)
    for row, part in zip(grid, (Part.NUTATION, requirements.aim(results.study.model.spacecraft)), strict=True):
        distribution = results.distribution(part.value)
        if distribution is None:
            continue
        name = "nutation left" if part is Part.NUTATION else part.label
        limit = _limit(results, part)
        required = "" if limit is None else f", required {limit:.4g}°"
        row[0].set_title(f"{name}: histogram")
        row[1].set_title(f"{name}: cases beyond")
        alike = _alike(distribution)
        if alike is not None:
            for axes in row:
                style.words(axes, f"all {results.done:,} cases:\n{alike}{required}")
            continue
        row[1].sharex(row[0])
        _histogram(row[0], distribution, name, limit)
        _function(row[1], distribution, name, results)
        reached = math.degrees(float(distribution.quantiles(np.array([results.probability]))[0]))
        for axes in row:
            _mark(axes, reached, limit, results.probability)
        row[1].set_title(f"{exact_percent(results.probability)} within {reached:.4g}°{required}")
    legend(figure, list(grid.flat))


def _alike(distribution: Distribution) -> str | None:
    """Text for cases of which a histogram would show nothing; None where it shows something."""
    least, most = math.degrees(distribution.minimum), math.degrees(distribution.maximum)
    if most < NOTHING:
        return f"below {NEXT_TO_NOTHING}"
    return f"{most:.4g}°" if most - least <= ALIKE * most else None


def _histogram(axes: Axes, distribution: Distribution, name: str, limit: float | None) -> None:
    """Histogram from the smallest to the largest value: on a log axis where few cases lie far beyond the others."""
    low, high = distribution.minimum, distribution.maximum
    title = f"{name}: histogram"
    if high > TAIL * float(distribution.quantiles(np.array([KNEE]))[0]):
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter("")
        edges = np.geomspace(max(low, high * 10.0**-DECADES), high, BINS + 1)
        title += ", log axis"
    else:
        edges = np.linspace(low, high, BINS + 1)
        axes.locator_params(axis="x", nbins=6)
    counts = distribution.histogram(np.concatenate([[min(low, edges[0])], edges[1:-1], [high]]))
    shown = np.degrees(edges)
    axes.stairs(100.0 * counts / max(counts.sum(), 1.0), shown, fill=True, color=MOTION, label="cases")
    if limit is not None and shown[-1] < limit <= FAR * shown[-1]:
        axes.set_xlim(right=1.04 * limit)
    axes.set(xlabel=f"{name}, deg", ylabel="cases in each bin, %", title=title)


def _function(axes: Axes, distribution: Distribution, name: str, results: Results) -> None:
    """Share of cases beyond a value, on a scale that shows the last per mille as well as the first half."""
    each = 1.0 / max(results.done, 10)
    steps = each * np.arange(1, min(results.done, STEPS) + 1)
    shares = np.sort(np.append(np.geomspace(steps[-1], 1.0, 400), steps[:-1]))[::-1]
    # Beyond the last case but one lies one case, as far as the last one; beyond that none, below the edge.
    values = np.degrees(np.append(distribution.quantiles(1.0 - shares), [distribution.maximum, distribution.maximum]))
    shares = 100.0 * np.append(shares, [each, 0.1 * each])
    axes.plot(values, shares, color=MOTION, linewidth=1.6, drawstyle="steps-post", label="cases")
    allowed = 100.0 * (1.0 - results.probability)
    axes.axhline(allowed, color=GREY, linewidth=1.0, linestyle=":", label=f"{allowed:.3g} % may lie beyond")
    axes.set_yscale("log")
    axes.set_ylim(50.0 * each, 150.0)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set(xlabel=f"{name}, deg", ylabel="cases beyond, %")
    axes.grid(True)


def _mark(axes: Axes, reached: float, limit: float | None, probability: float) -> None:
    """Lines at the quantile that shall meet the requirement, and at the requirement, degrees."""
    share = exact_percent(probability)
    axes.axvline(reached, color=GREY, linewidth=1.0, linestyle="--", label=f"{share} of the cases")
    if limit is not None and limit <= axes.get_xlim()[1]:
        axes.axvline(limit, color=PULSE, linewidth=1.6, label="required")


def momentum_cases(results: Results) -> Vector:
    """(n, 2): final H of the first cases as angles in degrees, from the target or from its initial direction.

    Directions are those of `geometry.sky_plane`; the distance from zero is the error or the momentum shift.
    """
    model = results.study.model
    vectors = results.early[VECTORS[requirements.aim(model.spacecraft).value], : min(results.done, EARLY)].T
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
    aim = requirements.aim(body)
    points, limit = momentum_cases(results), _limit(results, aim)
    centre = "H(0)" if aim is Part.SHIFT else "the target"
    # A case has an H(0) of its own: the momentum shift is counted from there, so that it is the centre in each.
    about = "the H(0) of each case" if aim is Part.SHIFT else centre
    sky = geometry.sky_names(results.study.nominal, centre)
    title = f"Where H ends, about {about}\n{sky.view}"
    widest = float(np.hypot(*points.T).max())
    if widest < NOTHING:
        axes.set_title(f"Where H ends, about {about}")
        required = "" if limit is None else f", required {limit:.4g}°"
        style.words(axes, f"all {results.done:,} cases:\nwithin {NEXT_TO_NOTHING} of {centre}{required}")
        return
    around = ellipse(points, results.probability)
    # One path for all dots, as short in a file as can be: strokes of next to no length with round caps.
    few = points[:DOTS]
    short = np.array([1e-3 * float(np.ptp(few, axis=0).max()), 0.0])
    ends = np.stack([few, few + short], axis=1).reshape(-1, 2)
    dots = Path(ends, [Path.MOVETO, Path.LINETO] * len(few))
    dots.should_simplify = False
    # Above the ellipse: where all cases lie on a line, it would hide them.
    look: dict[str, Any] = {"linewidth": 1.6, "capstyle": "round", "alpha": DENSE, "zorder": 2.5}
    axes.add_patch(PathPatch(dots, edgecolor=MOTION, facecolor="none", **look))
    some = f"{len(few):,} of the {results.done:,} cases" if len(few) < results.done else f"the {results.done:,} cases"
    axes.plot([], [], ".", color=MOTION, alpha=DENSE, label=some)
    axes.plot(
        *around.T, color=MOMENTUM, linewidth=1.5, label=f"holds {exact_percent(results.probability)} of the cases"
    )
    shown = [points, around]
    if limit is not None and limit > FAR * widest:
        title += f"\nrequired {limit:.4g}°, outside the view"
    elif limit is not None:
        turn = np.linspace(0.0, 2.0 * math.pi, 121)
        shown.append(limit * np.column_stack([np.cos(turn), np.sin(turn)]))
        axes.plot(*shown[-1].T, color=PULSE, linewidth=1.6, label=f"required: {limit:.4g}°")
    style.square(axes, np.vstack(shown), margin=0.08)
    if all(low < 0.0 < high for low, high in (axes.get_xlim(), axes.get_ylim())):
        axes.plot(0.0, 0.0, "+", color=INK, markersize=9, markeredgewidth=1.4, zorder=3, label=centre)
    axes.locator_params(nbins=4)  # of shifts of thousandths of a degree more labels would run into each other
    axes.set(xlabel=sky.x, ylabel=sky.y, title=title)
    legend(figure, [axes], 2)


def _budget(figure: Figure | SubFigure, results: Results) -> None:
    """Bars as long as the effects are, on each side the largest on top (a tornado), those without a name last."""
    inputs = budget_rows(results.study)
    pair = figure.subplots(1, 2)
    places = -np.arange(len(inputs), dtype=float)
    parts = (Part.NUTATION, requirements.aim(results.study.model.spacecraft))
    for axes, part, colour, index in zip(pair, parts, (MOTION, MOMENTUM), (0, 1), strict=True):
        name = "nutation" if part is Part.NUTATION else part.label
        axes.set_title(f"{name}: one sigma\nof each input alone")
        order = np.lexsort(([-row.effects[index] for row in inputs], [not row.size for row in inputs]))
        rows = [inputs[place] for place in order.tolist()]
        names = [f"{row.name}, {row.size}" if row.size else row.name for row in rows]
        effects = np.degrees([row.effects[index] for row in rows])
        most = float(effects.max(initial=0.0))
        limit, right = _limit(results, part), 1.3 * most
        if limit is not None and NOTHING <= most < limit and limit > right:
            axes.set_title(f"{axes.get_title()}\nrequired {limit:.4g}°, outside the view")
        if most < NOTHING:
            required = "" if limit is None else f"\nrequired {limit:.4g}°"
            style.words(axes, (f"each input: below {NEXT_TO_NOTHING}" if rows else "no input varies") + required)
            continue
        bars = axes.barh(places, effects, height=0.62, facecolor=colour, edgecolor=INK, linewidth=0.5)
        for bar, row, place, effect in zip(bars, rows, places, effects, strict=True):
            if row.bias:
                bar.set(hatch="////", label="bias, not one sigma")
            text = f"{effect:.3g}" if effect >= NOTHING else "< 1e-6"
            axes.annotate(text, (effect, place), (3, 0), textcoords="offset points", va="center", **style.ON_PAPER)
        if limit is not None and limit <= right:
            right = max(right, 1.05 * limit)
            axes.axvline(limit, color=PULSE, linewidth=1.6, label="required")
        axes.set_xlim(0.0, right)
        middle, half = 0.5 * (1 - len(rows)), 0.5 * max(len(rows), FEW) + 0.1
        axes.set_ylim(middle - half, middle + half)
        axes.set_yticks(places, names)
        axes.set_xlabel(f"{name}, deg")
        axes.locator_params(axis="x", nbins=5)
        axes.grid(axis="x")
    legend(figure, list(pair))
