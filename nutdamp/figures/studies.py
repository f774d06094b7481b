"""Pictures of studies: dispersed cases, the acceptance box, and fronts of cost over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.common.numerics import RPM, down
from nutdamp.figures import geometry, style
from nutdamp.figures.style import FIRED, GREY, INK, MISSED, MOMENTUM, MOTION, PAPER, TURNED
from nutdamp.flight.propagation import model_name
from nutdamp.montecarlo.statistics import VECTORS, Distribution
from nutdamp.montecarlo.study import EARLY, Results
from nutdamp.physics import attitude
from nutdamp.planning.tradeoff import Trade, numbered
from nutdamp.planning.verdict import Verdict
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Vector
from nutdamp.spacecraft.requirements import Bound, Part
from nutdamp.views.text import cost as written
from nutdamp.views.text import text
from nutdamp.views.trade import FAILS, fails, front_name, missing, schemes_of
from nutdamp.views.verdict import exact_percent, share_text, spent, stated
from nutdamp.views.verdict import limit as stated_limit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from nutdamp.control_loop.dispersion import LoopDispersion, LoopResults
    from nutdamp.flight.propagation import Flight
    from nutdamp.planning.screening import Dispersion


# the axis is logarithmic where the largest value is more than TAIL times the quantile KNEE
TAIL, KNEE = 2.0, 0.999
DECADES = 6.0  # largest number of decades of that axis
STEPS = 400  # steps of the curve of the cases within a value, besides the last ones
ALIKE = 1e-9  # relative difference up to which the values of all cases are one, but for rounding
NOTHING = 1e-6  # degrees below which all cases together are not worth a picture

# A requirement is drawn where it is at most so many times the largest value: beyond, it would
# leave a panel empty.
FAR = 4.0

DOTS = 2_000  # largest number of cases shown as dots: more would only make the picture heavy
DENSE = 0.8  # opacity of a dot: fainter ones are not seen

TITLE: dict[str, Any] = {"fontsize": style.TICK_SIZE}  # look of the title of a panel

# panels of each figure: nutation and momentum, their cases, and the final directions of H
PANELS = {"overview": 3, "cases": 2, "momentum": 1}


def dispersion_figure(flown: Dispersion, name: str = "overview", *, narrow: bool = False) -> Figure:
    """The figure ``overview``, ``cases`` or ``momentum``; raises KeyError for others. ``narrow``:
    the last one for phones.
    """
    how = f"{flown.plan.scheme} by {model_name([flown.core.study.model.schedule])}"
    return _figure(flown.core, flown.verdict, name, how, narrow=narrow)


def loop_cases_figure(flown: LoopDispersion) -> Figure:
    """Largest nutation after the loop falls quiet, and how far H has moved, of dispersed cases of a
    loop.
    """
    return _figure(flown.core, flown.verdict, "cases", "closed loop by real pulse widths")


@style.styled()
def _figure(
    results: Results | LoopResults, judged: Verdict, name: str, how: str, *, narrow: bool = False
) -> Figure:
    panels = PANELS[name]
    spacecraft = results.study.model.spacecraft
    width = style.PHONE if narrow else (4.1, 7.4, 10.8)[panels - 1]
    figure = style.sheet(width, 4.4 if panels != 2 else 3.9)
    axes = list(figure.subplots(1, panels, squeeze=False)[0])
    if name != "momentum":
        for panel, part in zip(axes, (Part.NUTATION, requirements.aim(spacecraft)), strict=False):
            _cases(panel, results, judged, part)
    if isinstance(results, Results) and name != "cases":
        _momentum(axes[-1], results)
    style.legend(figure, axes)
    about = f"{how}, {results.done:,} dispersed cases"
    return style.finished(figure, spacecraft, about, stated(judged))


def _cases(axes: Axes, results: Results | LoopResults, judged: Verdict, part: Part) -> None:
    """Share of the cases within each value of nutation or momentum shift; words where a curve would
    show nothing.
    """
    distribution = results.distribution(part.value)
    limit = style.limit_of(results.study.model.spacecraft, part)
    nutation = "nutation left" if isinstance(results, Results) else "largest nutation"
    name = nutation if part is Part.NUTATION else part.label
    required = "" if limit is None else f", required {style.number(limit)}°"
    least = most = 0.0
    if distribution is not None:
        least, most = math.degrees(distribution.minimum), math.degrees(distribution.maximum)
    if distribution is None or most < NOTHING or most - least <= ALIKE * most:
        said = "no case ends" if distribution is None else style.angle(distribution.maximum)
        axes.set_title(name, **TITLE)
        style.words(axes, f"all {results.done:,} cases:\n{said}{required}")
        return
    reached = math.degrees(float(distribution.quantiles(np.array([results.probability]))[0]))
    share = exact_percent(results.probability)
    near = limit is not None and limit <= FAR * most
    draw_distribution(axes, distribution, f"{name}, °", limit if near else None)
    if limit is not None and not near:
        style.off_scale(axes, f"required ≤ {style.number(limit)}°")
    axes.axvline(reached, color=GREY, linewidth=0.8, linestyle=":")
    axes.plot(reached, 100.0 * results.probability, "o", color=INK, markersize=4)
    missed = any(line.bound.part is part and not line.met for line in judged.required)
    text = f"{name}\n{share} within {style.number(reached)}°{required}"
    axes.set_title(text, color=MISSED if missed else INK, **TITLE)


def draw_distribution(
    axes: Axes, distribution: Distribution, name: str, limit: float | None
) -> None:
    """Curve of the cases within a value: on a log axis where few lie far beyond the others."""
    high = distribution.maximum
    shares = np.append(np.linspace(0.0, 0.99, STEPS), 1.0 - np.geomspace(0.01, 1e-6, STEPS))
    values = np.degrees(np.append(distribution.quantiles(shares), high))
    axes.plot(
        values, 100.0 * np.append(shares, 1.0), color=MOTION, linewidth=1.6, label="cases within"
    )
    if high > TAIL * float(distribution.quantiles(np.array([KNEE]))[0]):
        axes.set_xscale("log")
        axes.set_xlim(left=math.degrees(max(distribution.minimum, high * 10.0**-DECADES)))
        name += " (log)"
    else:
        axes.locator_params(axis="x", nbins=6)
    if limit is not None:
        axes.axvline(limit, **style.LIMIT)
        axes.set_xlim(right=max(axes.get_xlim()[1], 1.04 * limit))
    if axes.get_xscale() == "log":
        style.log_axis(axes.xaxis)
    axes.set(xlabel=name, ylabel="cases within, %", ylim=(0.0, 104.0))
    axes.grid()


def momentum_cases(results: Results) -> Vector:
    """(n, 2): final H of the first cases as angles in degrees, from the target or from its initial
    direction.

    Directions are those of `geometry.sky_plane`; the distance from zero is the error or the
    momentum shift.
    """
    model = results.study.model
    vectors = results.early[
        VECTORS[requirements.aim(model.spacecraft).value], : min(results.done, EARLY)
    ].T
    turn = model.spacecraft.initial.quaternion
    plane = geometry.sky_plane(results.study.nominal, attitude.rotate(turn, model.target))
    across = (attitude.rotate(turn, vectors) @ plane.T)[:, :2]
    size = np.linalg.norm(across, axis=1)
    angle = np.degrees(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(vectors, axis=1), 0.0, 1.0)))
    return np.asarray(
        across * np.divide(angle, size, out=np.zeros_like(angle), where=size > 0.0)[:, None]
    )


def ellipse(points: Vector, share: float) -> Vector:
    """(m, 2): the ellipse about the mean of ``points`` (n, 2), of their covariance, that holds
    ``share`` of them.
    """
    middle = points.mean(axis=0)
    variances, vectors = np.linalg.eigh((points - middle).T @ (points - middle) / len(points))
    sizes = np.sqrt(np.maximum(variances, 0.0))
    along = (points - middle) @ vectors
    away = np.hypot(*np.divide(along, sizes, out=np.zeros_like(along), where=sizes > 0.0).T)
    return np.asarray(
        middle + geometry.circle() * sizes * float(np.quantile(away, share)) @ vectors.T
    )


def _momentum(axes: Axes, results: Results) -> None:
    """Final direction of H in each case, seen from outside, with the ellipse that holds as many as
    must comply.
    """
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    spacecraft = results.study.model.spacecraft
    shift = requirements.aim(spacecraft) is Part.SHIFT
    points = momentum_cases(results)
    limit = style.limit_of(spacecraft, requirements.aim(spacecraft))
    # A case has an H(0) of its own: the momentum shift is counted from there, so that it is the
    # centre in each.
    centre, about = ("H(0)", "the H(0) of each case") if shift else ("the target", "the target")
    x, y, sense = geometry.sky_names(results.study.nominal, centre)
    widest = float(np.hypot(*points.T).max())
    if widest < NOTHING:
        axes.set_title(f"Where H ends, about {about}", **TITLE)
        said = f"{style.angle(math.radians(widest))} from {centre}"
        style.words(axes, f"all {results.done:,} cases:\n{said}")
        return
    around = ellipse(points, results.probability)
    # One path for all dots, as short in a file as can be: strokes of next to no length with round
    # caps. Above the ellipse: where all cases lie on a line, it would hide them.
    few = points[:DOTS]
    short = np.array([1e-3 * float(np.ptp(few, axis=0).max()), 0.0])
    strokes = np.stack([few, few + short], axis=1).reshape(-1, 2)
    dots = Path(strokes, [Path.MOVETO, Path.LINETO] * len(few))
    dots.should_simplify = False
    axes.add_patch(
        PathPatch(
            dots,
            edgecolor=MOTION,
            facecolor="none",
            linewidth=1.6,
            capstyle="round",
            alpha=DENSE,
            zorder=2.5,
        )
    )
    some = f"{len(few):,} of " if len(few) < results.done else ""
    label = f"{some}the {results.done:,} cases"
    axes.plot([], [], ".", color=MOTION, alpha=DENSE, label=label)
    held = f"holds {exact_percent(results.probability)} of the cases"
    axes.plot(*around.T, color=MOMENTUM, linewidth=1.5, label=held)
    shown = [points, around]
    if limit is not None and limit <= FAR * widest:
        shown.append(limit * geometry.circle())
        axes.plot(*shown[-1].T, **style.LIMIT)
    elif limit is not None:
        style.off_scale(axes, f"required ≤ {style.number(limit)}°")
    style.square(axes, np.vstack(shown), margin=0.08)
    if all(low < 0.0 < high for low, high in (axes.get_xlim(), axes.get_ylim())):
        cross = {**style.TARGET, "marker": "+", "markersize": 9.0, "zorder": 3}
        look = cross if shift else style.TARGET
        axes.plot(0.0, 0.0, label=centre.removeprefix("the "), **look)
    # Of shifts of thousandths of a degree more labels would run into each other.
    axes.locator_params(nbins=4)
    axes.set(xlabel=x, ylabel=y)
    axes.set_title(f"Where H ends, about {about}\n{sense}", **TITLE)


def accepted(flight: Flight, judged: Verdict) -> dict[str, Vector]:
    """(n, 2) each, degrees on the sky of the axis track: the ``limit`` of the end of H, and the
    ``contour`` that holds the share of the cases that must comply; without those that are unknown.
    """
    spacecraft = flight.spacecraft
    start = spacecraft.momentum
    sky = geometry.sky_plane(flight, start)
    goal = spacecraft.goal.axis
    about = sky if goal is None else geometry.sky_plane(flight, goal)
    outlines = {}
    limit = style.limit_of(spacecraft, requirements.aim(spacecraft))
    if limit is not None:
        outlines["limit"] = limit * geometry.circle()
    if judged.results is not None:
        assert isinstance(judged.results, Results)
        outlines["contour"] = ellipse(momentum_cases(judged.results), judged.results.probability)
    return {
        name: geometry.on_sky(sky, geometry.off_sky(about, angles))
        for name, angles in outlines.items()
    }


# largest and least end of an axis of the acceptance box over its limit: farther schemes are arrows
# at the edge, and a limit alone leaves room beside its label
REACH, SPARE = 1.4, 1.25

OTHERS = (TURNED, INK, FIRED, GREY)  # colours of the schemes that are not recommended, in turn


@style.styled()
def acceptance_figure(
    judged: Verdict, others: Sequence[Verdict], *, narrow: bool = False
) -> Figure:
    """The box of `acceptance`, for the report and ``plan --figure box``."""
    figure = style.sheet(style.PHONE if narrow else 6.2, 4.4 if narrow else 3.6)
    acceptance(figure.subplots(), judged, others)
    return style.finished(figure, judged.spacecraft, "schemes beside their limits", stated(judged))


def acceptance(axes: Axes, judged: Verdict, others: Sequence[Verdict] = ()) -> None:
    """Nutation left against the value with the tightest other limit, both limits as a box.

    Each scheme is the contour that holds the share of its cases that must comply, or a point
    without cases; the recommended one, ``judged``, is filled.
    """
    bounds = box_bounds(judged)
    limits = np.array([_in_units(bound, bound.limit) for bound in bounds])
    verdicts = [judged, *others]
    regions = [acceptance_contour(verdict, bounds) for verdict in verdicts]
    tops = np.array([region.max(axis=0) for region in regions])
    within = [np.all(region.min(axis=0) <= REACH * limits) for region in regions]
    farthest = np.max(tops[within], axis=0, initial=0.0)
    bounded = np.isfinite(limits)
    near = np.clip(1.1 * farthest, SPARE * limits, REACH * limits)
    ends = np.maximum(np.where(bounded, near, SPARE * tops.max(axis=0)), style.LEAST)
    right, top = np.where(bounded, limits, 2.0 * ends)
    axes.fill_between([0.0, right], top, **style.BAND)
    axes.plot([right, right, 0.0], [0.0, top, top], **{**style.LIMIT, "label": None})
    colours = (MOTION, *(colour for _, colour in zip(others, cycle(OTHERS), strict=False)))
    for order, (verdict, region, colour) in enumerate(zip(verdicts, regions, colours, strict=True)):
        above = 3.0 - 0.01 * order  # the recommended one is on top
        share = "" if verdict.cases is None else f", {share_text(verdict.cases)}"
        name = f"{verdict.scheme} {spent(verdict.schedule)}{share}"
        beyond = region.min(axis=0) > ends
        place, mark, ink = region[-1], "o", colour
        if beyond.any():
            row = int(beyond[1])
            nominal = _nominal(verdict, bounds)
            unit = " rpm" if bounds[row].part is Part.SPIN else "°"
            name += f": {style.number(nominal[row])}{unit}"
            place, mark = np.minimum(nominal, ends), ">^"[row]
        if beyond.any() or len(region) < 3:
            ground = colour if verdict is judged else "none"
            axes.plot(
                *place,
                mark,
                color=colour,
                markersize=7,
                markerfacecolor=ground,
                clip_on=False,
                zorder=above,
            )
        else:
            if verdict is judged:
                axes.fill(*region.T, color=colour, alpha=0.3, linewidth=0.0)
                ink = INK  # on its own fill
            line = "-" if verdict.met is not False else (0, (4, 1.5))
            outline = np.vstack([region, region[:1]])
            axes.plot(*outline.T, color=colour, linestyle=line, linewidth=1.5, zorder=above)
            far = region[np.argmax(np.minimum(region, 0.97 * ends) @ (1.0 / ends))]
            place = np.minimum(far, 0.97 * ends)
        style.add(axes, name, place, ink, role="vital")
    across, along = map(_bound_axis, bounds)
    axes.set(xlim=(0.0, ends[0]), ylim=(0.0, ends[1]), xlabel=across, ylabel=along)
    axes.locator_params(nbins=6)
    axes.grid()
    marks = "points: nominal values"
    if judged.results is not None and judged.cases is not None:
        marks = f"contours: {exact_percent(judged.cases.probability)} of the cases"
    width = style.LETTERS * axes.figure.get_figwidth()  # type: ignore[union-attr]
    title = fill(f"{marks}; filled: recommended", int(width))
    axes.set_title(f"Acceptance box: what a scheme leaves\n{title}")


def box_bounds(judged: Verdict) -> tuple[Bound, Bound]:
    """The bounds of the acceptance box: nutation left, and the tightest other one at the end.

    Without another one the end of H, which has no limit then.
    """
    ends = [line for line in judged.lines if line.bound.keep is None]
    nutation = next(line.bound for line in ends if line.bound.part is Part.NUTATION)
    tight = min(
        (line for line in ends if line.bound is not nutation),
        key=lambda line: (not line.bound.required, line.room),
        default=None,
    )
    free = Bound(requirements.aim(judged.spacecraft), math.inf, False)
    return nutation, free if tight is None else tight.bound


def acceptance_contour(verdict: Verdict, bounds: tuple[Bound, Bound]) -> Vector:
    """(n, 2) in the units of `acceptance`: the hull of the cases that use least of both bounds, as
    many as must comply; one point, of nominal values, without cases.

    It lies within the box where enough cases keep both bounds, and nowhere else.
    """
    scale = np.array([_in_units(bound, 1.0) for bound in bounds])
    if verdict.results is not None and verdict.cases is not None:
        spreads = [verdict.results.spread(bound) for bound in bounds]
        if all(hasattr(spread, "values") for spread in spreads):  # not only counted
            values = np.column_stack([spread.values for spread in spreads])
            used = np.maximum(*(bound.used(values[:, row]) for row, bound in enumerate(bounds)))
            count = math.ceil(verdict.cases.probability * len(used))
            return geometry.hull(scale * values[np.argsort(used, kind="stable")[:count]])
    return _nominal(verdict, bounds)[None]


def _nominal(verdict: Verdict, bounds: tuple[Bound, Bound]) -> Vector:
    """(2,): nominal values in the units of `acceptance`."""
    assert verdict.flight is not None
    nominal = {line.bound: line.nominal for line in verdict.lines}
    values = (nominal.get(bound, verdict.flight.residual.axis_error) for bound in bounds)
    return np.array([_in_units(*pair) for pair in zip(bounds, values, strict=True)])


def _in_units(bound: Bound, value: float) -> float:
    """A value of a bound's part in deg, of the spin in rpm."""
    return RPM * value if bound.part is Part.SPIN else math.degrees(value)


def _bound_axis(bound: Bound) -> str:
    """Name of an axis of the acceptance box with its limit."""
    name = "nutation left" if bound.part is Part.NUTATION else bound.label
    unit = "rpm" if bound.part is Part.SPIN else "°"
    if math.isinf(bound.limit):
        return f"{name}, {unit} (no limit)"
    word = "required" if bound.required else "damped"
    return f"{name}, {unit} ({word} {stated_limit(bound).replace(' deg', '°')})"


WIDTH = 14.0  # characters of a line above the picture in an inch of it

# end of the axis of time over the last end of a schedule: to there its cost holds, as far as the
# horizon reaches
LATER = 1.4


@style.styled()
def trade_figure(traded: Trade, *, narrow: bool = False) -> Figure:
    """End of the last firing against propellant (impulse where that is unknown) as % over its lower
    bound, numbered as in the table; hollow where the verdict is not to fly, with the recommended
    plan among them.

    Fronts without points are named, with reasons. ``narrow``: for phones.
    """
    spacecraft, fronts, chosen = traded.spacecraft, traded.fronts, traded.recommended
    width = style.PHONE if narrow else 7.4
    figure = style.sheet(width, 4.8)
    points = [point for _, _, point in numbered(fronts)]
    how = model_name(point.plan.pulses for point in points)
    about = f"finish time against cost, {', '.join(schemes_of(fronts))} by {how}"
    reasons = "\n".join(
        fill(text(entry), int(WIDTH * width)) for entry in missing(spacecraft, fronts)
    )
    if not points:
        figure.text(0.5, 0.5, reasons, ha="center", va="center", linespacing=1.6)
        return style.finished(figure, spacecraft, about)
    axes = figure.subplots()
    axes.set_title(reasons, loc="left", **style.NOTE)
    ends = [point.plan.pulses.end for point in points]
    if chosen is not None and len(chosen.pulses):
        ends.append(chosen.pulses.end)
    # A firing of no width at t = 0 ends there, which a log axis has no place for.
    log = min(ends) > 0.0
    axes.set_xscale("log" if log else "linear")
    unit = points[0].unit
    bounds = [point.bounds.rigorous for point in points if point.bounds.rigorous is not None]
    proven = len(bounds) == len(points)
    # Below it for certain: the bound is rounded down as on the screen.
    base = down(min(bounds)) if proven else min(point.cost for point in points)
    reach = max(min(LATER * max(ends), spacecraft.horizon), 1.03 * max(ends))
    for front, (colour, mark, line) in zip(fronts, cycle(style.LOOKS), strict=False):
        own = [
            (number, point.plan.pulses.end, over(point.cost, base), fails(point))
            for number, owner, point in numbered(fronts)
            if owner is front
        ]
        look: dict[str, Any] = {"color": colour, "linestyle": line}
        for number, end, cost, hollow in own:
            ground = PAPER if hollow else colour
            axes.plot(
                end,
                cost,
                mark,
                color=colour,
                markerfacecolor=ground,
                markersize=6,
                clip_on=False,
                zorder=3.5,
            )
            style.add(axes, str(number), np.array([end, cost]), INK)
        if own:
            # A schedule serves for every later end, until a cheaper one does.
            times = [*(end for _, end, _, _ in own), reach]
            costs = [*(cost for _, _, cost, _ in own), own[-1][2]]
            axes.plot(np.repeat(times, 2)[1:], np.repeat(costs, 2)[:-1], **look)
            name = front_name(front, pointing=spacecraft.goal.axis is not None)
            axes.plot([], [], marker=mark, markersize=5, label=name.replace(" deg", "°"), **look)
    if any(map(fails, points)):
        axes.plot([], [], "o", color=GREY, markerfacecolor=PAPER, label=f"hollow: {FAILS}")
    if chosen is not None and len(chosen.pulses):
        ideal = ", ideal impulses" if chosen.pulses.idealised else ""
        other = "" if chosen.scheme in schemes_of(fronts) else f" (not traded{ideal})"
        axes.plot(
            chosen.pulses.end,
            over(chosen.pulses.cost_in(unit), base),
            "D",
            label=f"recommended: {chosen.scheme}{other}",
            color=INK,
            markersize=11,
            markerfacecolor="none",
            clip_on=False,
            zorder=4,
        )
    axes.set_xlim(right=reach if reach > 1.03 * max(ends) else 1.03 * reach)
    axes.margins(y=0.12)
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]) if axes.dataLim.y0 < 0.0 else 0.0)
    what = "propellant" if unit == "kg" else "impulse"
    least = "the lower bound" if proven else "the cheapest point"
    axes.set_xlabel("end of the last firing, s")
    axes.set_ylabel(f"{what} over {least}, {written(base, unit)}, %")
    if log:
        style.log_axis(axes.xaxis)
    axes.grid(True, which="both")
    style.legend(figure, [axes])
    return style.finished(figure, spacecraft, about)


def over(cost: float, base: float) -> float:
    """A cost as % over the ``base``."""
    return 100.0 * (cost / base - 1.0)
