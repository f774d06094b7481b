"""Pictures of dispersed cases, of schedules and of loops: how far they end off, and the final directions of H."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.figures import geometry, style
from nutdamp.figures.style import GREY, INK, MISSED, MOMENTUM, MOTION
from nutdamp.flight.propagation import model_name
from nutdamp.montecarlo.statistics import VECTORS, Distribution
from nutdamp.montecarlo.study import EARLY, Results
from nutdamp.physics import attitude
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Part
from nutdamp.views.decisions import cases_verdict, exact_percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from nutdamp.control_loop.dispersion import LoopResults


BINS = 60
"""Bars of a histogram, at most."""

TAIL, KNEE = 2.0, 0.999
"""The axis is logarithmic where the largest value is more than TAIL times the quantile KNEE."""

DECADES = 6.0
"""Largest number of decades of that axis: its first bin holds all smaller values."""

STEPS = 400
"""Steps of the curve of the cases within a value, besides the last ones."""

HIGHEST = 60.0
"""Height of the highest bar of a histogram, on the scale of the curve over it, %."""

ALIKE = 1e-9
"""Relative difference up to which the values of all cases are one, but for rounding."""

NOTHING, NEXT_TO_NOTHING = 1e-6, "1e-6°"
"""Degrees below which all cases together are not worth a picture, and their text."""

FAR = 4.0
"""A requirement is drawn where it is at most so many times the largest value: beyond, it would leave a panel empty."""

DOTS = 2_000
"""Largest number of cases shown as dots: more would only make the picture heavy."""

DENSE = 0.8
"""Opacity of a dot: fainter ones are not seen (less than 3:1 on white)."""

TITLE: dict[str, Any] = {"fontsize": style.TICK_SIZE}
"""Look of the title of a panel."""

PANELS = {"overview": 3, "cases": 2, "momentum": 1}
"""Panels of each figure: nutation and momentum, their cases, and the final directions of H."""


def dispersion_figure(name: str, results: Results, *, scheme: str) -> Figure:
    """The figure ``overview``, ``cases`` or ``momentum``; raises KeyError for others."""
    return _figure(name, results, f"{scheme} by {model_name([results.study.model.schedule])}")


def loop_cases_figure(results: LoopResults) -> Figure:
    """Largest nutation after the loop falls quiet, and how far H has moved, of dispersed cases of a loop."""
    return _figure("cases", results, "closed loop by real pulse widths")


@style.styled
def _figure(name: str, results: Results | LoopResults, how: str) -> Figure:
    panels, body, share = PANELS[name], results.study.model.spacecraft, results.met_fraction
    figure = style.sheet((4.1, 7.4, 10.8)[panels - 1], 4.4 if panels != 2 else 3.9)
    axes = list(figure.subplots(1, panels, squeeze=False)[0])
    if name != "momentum":
        _cases(axes[:2], results, body)
    if isinstance(results, Results) and name != "cases":
        _momentum(axes[-1], results)
    style.legend(figure, axes, 2 if name == "momentum" else 8)
    verdict = "" if share is None else f"\nrequirement {cases_verdict(share, results.probability)}"
    style.heading(figure, body, f"{how}, {results.done:,} dispersed cases{verdict}")
    return figure


def _cases(panels: list[Axes], results: Results | LoopResults, body: Spacecraft) -> None:
    """Share of the cases within each value of nutation and momentum shift, over a histogram."""
    for axes, part in zip(panels, (Part.NUTATION, requirements.aim(body)), strict=True):
        distribution = results.distribution(part.value)
        nutation = "nutation left" if isinstance(results, Results) else "largest nutation"
        name = nutation if part is Part.NUTATION else style.part_name(part)
        limit = style.limit_of(body, part)
        required = "" if limit is None else f", required {style.number(limit)}°"
        axes.set_title(name, **TITLE)
        alike = "no case ends" if distribution is None else _alike(distribution)
        if distribution is None or alike is not None:
            style.words(axes, f"all {results.done:,} cases:\n{alike}{required}")
            continue
        reached = math.degrees(float(distribution.quantiles(np.array([results.probability]))[0]))
        share = exact_percent(results.probability)
        shown = limit if limit is not None and limit <= FAR * math.degrees(distribution.maximum) else None
        draw_distribution(axes, distribution, f"{name}, °", shown, min(BINS, 2 * math.isqrt(results.done)))
        axes.axvline(reached, color=GREY, linewidth=0.8, linestyle=":")
        axes.plot(reached, 100.0 * results.probability, "o", color=INK, markersize=4)
        missed = limit is not None and reached > limit
        text = f"{name}\n{share} within {style.number(reached)}°{required}"
        axes.set_title(text, color=MISSED if missed else INK, **TITLE)


def _alike(distribution: Distribution) -> str | None:
    """Text for cases of which a curve would show nothing; None where it shows something."""
    least, most = math.degrees(distribution.minimum), math.degrees(distribution.maximum)
    if most < NOTHING:
        return f"below {NEXT_TO_NOTHING}"
    return f"{style.number(most)}°" if most - least <= ALIKE * most else None


def draw_distribution(axes: Axes, distribution: Distribution, name: str, limit: float | None, bins: int) -> None:
    """Curve and histogram to the largest value: on a log axis where few cases lie far beyond the others."""
    low, high = distribution.minimum, distribution.maximum
    if high > TAIL * float(distribution.quantiles(np.array([KNEE]))[0]):
        axes.set_xscale("log")
        style.log_axis(axes.xaxis)
        edges = np.geomspace(max(low, high * 10.0**-DECADES), high, bins + 1)
        name += " (log)"
    else:
        edges = np.linspace(low, high, bins + 1)
        axes.locator_params(axis="x", nbins=6)
    counts = distribution.histogram(np.concatenate([[min(low, edges[0])], edges[1:-1], [high]]))
    bars = HIGHEST * counts / max(counts.max(), 1.0)
    look: dict[str, Any] = {"facecolor": (MOTION, 0.3), "edgecolor": MOTION, "linewidth": 0.5}
    axes.stairs(bars, np.degrees(edges), fill=True, label="histogram, scaled", **look)
    shares = np.append(np.linspace(0.0, 0.99, STEPS), 1.0 - np.geomspace(0.01, 1e-6, STEPS))
    values = np.degrees(np.append(distribution.quantiles(shares), high))
    axes.plot(values, 100.0 * np.append(shares, 1.0), color=MOTION, linewidth=1.6, label="cases within")
    if limit is not None:
        axes.axvline(limit, **style.LIMIT)
        axes.set_xlim(right=max(axes.get_xlim()[1], 1.04 * limit))
    axes.set(xlabel=name, ylabel="cases within, %", ylim=(0.0, 104.0))
    axes.grid()


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
    return np.asarray(middle + geometry.circle() * sizes * float(np.quantile(away, share)) @ vectors.T)


def _momentum(axes: Axes, results: Results) -> None:
    """Final direction of H in each case, seen from outside, with the ellipse that holds as many as must comply."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    body = results.study.model.spacecraft
    aim = requirements.aim(body)
    points, limit = momentum_cases(results), style.limit_of(body, aim)
    # A case has an H(0) of its own: the momentum shift is counted from there, so that it is the centre in each.
    centre, about = ("H(0)", "the H(0) of each case") if aim is Part.SHIFT else ("the target", "the target")
    sky = geometry.sky_names(results.study.nominal, centre)
    widest = float(np.hypot(*points.T).max())
    if widest < NOTHING:
        axes.set_title(f"Where H ends, about {about}", **TITLE)
        style.words(axes, f"all {results.done:,} cases:\nwithin {NEXT_TO_NOTHING} of {centre}")
        return
    around = ellipse(points, results.probability)
    # One path for all dots, as short in a file as can be: strokes of next to no length with round caps.
    few = points[:DOTS]
    short = np.array([1e-3 * float(np.ptp(few, axis=0).max()), 0.0])
    dots = Path(np.stack([few, few + short], axis=1).reshape(-1, 2), [Path.MOVETO, Path.LINETO] * len(few))
    dots.should_simplify = False
    # Above the ellipse: where all cases lie on a line, it would hide them.
    look: dict[str, Any] = {"linewidth": 1.6, "capstyle": "round", "alpha": DENSE, "zorder": 2.5}
    axes.add_patch(PathPatch(dots, edgecolor=MOTION, facecolor="none", **look))
    some = f"{len(few):,} of the {results.done:,} cases" if len(few) < results.done else f"the {results.done:,} cases"
    axes.plot([], [], ".", color=MOTION, alpha=DENSE, label=some)
    held = f"holds {exact_percent(results.probability)} of the cases"
    axes.plot(*around.T, color=MOMENTUM, linewidth=1.5, label=held)
    shown = [points, around]
    if limit is not None and limit <= FAR * widest:
        shown.append(limit * geometry.circle())
        axes.plot(*shown[-1].T, **style.LIMIT)
    style.square(axes, np.vstack(shown), margin=0.08)
    if all(low < 0.0 < high for low, high in (axes.get_xlim(), axes.get_ylim())):
        mark: dict[str, Any] = {"marker": "+", "color": INK, "markersize": 9, "linestyle": "", "zorder": 3}
        axes.plot(0.0, 0.0, label=centre.removeprefix("the "), **(mark if aim is Part.SHIFT else style.TARGET))
    axes.locator_params(nbins=4)  # of shifts of thousandths of a degree more labels would run into each other
    axes.set(xlabel=sky.x, ylabel=sky.y)
    axes.set_title(f"Where H ends, about {about}\n{sky.view}", **TITLE)
