"""Fronts of cost against time, figures of studies and of loops, and what is said of them."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.text import Annotation
from support import places
from support.builders import aimed, cross, present, spinner
from support.cases import deep, weekly
from support.dispersed import jet, normal
from support.golden import check_text
from support.shown import (
    WIDE,
    check_colours,
    check_layout,
    check_star,
    heading,
    legend_words,
    studied,
    texts,
)
from support.spinners import commanded

import nutdamp
from nutdamp.common.numerics import down
from nutdamp.common.results import note
from nutdamp.control_loop.budget import budget
from nutdamp.control_loop.dispersion import LoopDispersion, LoopResults, loop_study
from nutdamp.control_loop.dispersion import run as run_loops
from nutdamp.control_loop.evaluation import loop_of
from nutdamp.figures import geometry, studies, style
from nutdamp.figures.signals import loop_figure, time_unit, upkeep
from nutdamp.montecarlo.statistics import OUTPUTS, Exact
from nutdamp.physics.attitude import angle_between
from nutdamp.planning import plan as planning
from nutdamp.planning import tradeoff
from nutdamp.planning.decision import compare
from nutdamp.planning.screening import Dispersion
from nutdamp.planning.verdict import Status
from nutdamp.schemes.catalogue import OptimalOptions
from nutdamp.spacecraft.equipment import Channel, Loop, Sensor, Steerable
from nutdamp.spacecraft.model import Limits, Requirement, Spacecraft, Vector
from nutdamp.spacecraft.requirements import Part, aim
from nutdamp.spacecraft.schedule import Bounds, Schedule
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance
from nutdamp.views.text import cost, sentences, text
from nutdamp.views.trade import FAILS, fails, front_parts, trade_notes
from nutdamp.views.verdict import lead, share_text, spent, statement

REQUIRED = Requirement(math.radians(0.5), math.radians(0.2), 0.997)
TOLERANCES = Dispersions(
    A=normal(0.005, relative=True),
    C=normal(0.005, relative=True),
    omega0=(normal(0.002),) * 3,
    thrust=dict.fromkeys(("+1", "-1", "+2", "-2"), normal(0.02, relative=True)),
    timing=Tolerance("uniform", 0.005),
    timing_offset=Tolerance("bias", 0.002),
    attitude=normal(0.002),
)
BODY = replace(
    spinner(
        channels=cross(8.0, min_on_time=0.02, max_on_time=2.0),
        requirement=REQUIRED,
        limits=Limits(horizon=40.0),
    ),
    dispersions=TOLERANCES,
)


def line(axes: Axes, label: str) -> Vector:
    (found,) = (one for one in axes.lines if str(one.get_label()).startswith(label))
    return np.asarray(found.get_xydata(), dtype=np.float64)


pytestmark = pytest.mark.usefixtures("plans_shared")

# --- trades
# --------------------------------------------------------------------------------------------------


@cache
def traded() -> tuple[tradeoff.Front, ...]:
    """Two hand-made fronts that begin with one schedule: later ends cost less, and a free H less
    still.
    """
    strict = ((0.0, 1.0), (4.0, 0.97), (10.0, 0.95), (20.0, 0.94))
    free = ((5.0, 0.94), (12.0, 0.91), (22.0, 0.895))
    first, *others = (traded_point(*one) for one in strict)
    return tradeoff.Front(0.0, (first, *others)), tradeoff.Front(
        math.inf, (first, *(traded_point(*one) for one in free))
    )


def traded_point(later: float, share: float) -> tradeoff.Point:
    """The two pulses of the compared body, ``later`` s and of a ``share`` of their impulse."""
    made = planning.plan(BODY, "two-pulse")
    pulses = tuple(
        replace(one, t=one.t + later, impulse=one.impulse * share) for one in made.pulses
    )
    least = share * made.total_impulse
    schedule = Schedule(pulses, bounds=Bounds(0.99 * least, 0.9 * least, "N m s", 40.0))
    return tradeoff.Point(replace(made, scheme="optimal", schedule=schedule), 40.0, "N m s")


def trade_figure(
    body: Spacecraft, fronts: tuple[tradeoff.Front, ...], chosen: planning.Plan | None = None
) -> Figure:
    return studies.trade_figure(tradeoff.Trade(body, fronts, chosen))


@pytest.mark.deep
def test_the_trade_numbers_every_point_and_explains_its_marks() -> None:
    chosen = planning.plan(BODY, "two-pulse")
    figure = trade_figure(BODY, traded(), chosen)
    check_layout(figure)
    check_colours(figure)
    (axes,) = figure.axes
    named = [int(number) for note in axes.texts for number in note.get_text().split(", ")]
    assert sorted(named) == list(range(1, sum(len(front.points) for front in traded()) + 1))
    least = min(point.bounds.rigorous or 0.0 for front in traded() for point in front.points)
    assert axes.get_ylabel() == f"impulse over the lower bound, {cost(down(least), 'N m s')}, %"
    assert axes.get_ylim()[0] == 0.0, "no cut axis"
    assert {"H ends where it was", "H may end anywhere"} <= legend_words(figure)
    assert (
        sum(", " in note.get_text() for note in axes.texts) == 1
    )  # the schedule of both fronts has one mark
    assert line(axes, "recommended: two-pulse (not traded)")[0] == pytest.approx(
        [chosen.end, studies.over(chosen.total_impulse, down(least))]
    )
    last = max(point.plan.end for front in traded() for point in front.points)
    assert last < axes.get_xlim()[1] < 2.0 * last
    for point in [point for front in traded() for point in front.points]:
        (axes,) = trade_figure(BODY, traded(), point.plan).axes
        assert axes.xaxis.get_major_formatter()(2.0) == "2"  # no powers of ten
        height = studies.over(point.cost, down(least))
        check_star(axes, np.array([point.plan.end, height]), 0.36 * 11.0)


@pytest.mark.deep
def test_fronts_without_points_say_why() -> None:
    figure = trade_figure(spinner(), (tradeoff.Front(0.0, (), "no channel"),))
    check_layout(figure)
    assert not figure.axes
    assert any(
        "H ends where it was \N{EN DASH} none: no channel" in text.get_text()
        for text, _ in texts(figure)
    )
    missing = tradeoff.Front(
        0.0, (), "within 40 s H cannot be kept where it is; " + "set limits.horizon to more " * 5
    )
    figure = trade_figure(BODY, (missing, traded()[1]))
    check_layout(figure)
    said = " ".join(figure.axes[0].get_title(loc="left").split())
    assert said.startswith("H ends where it was \N{EN DASH} none: within 40 s H cannot be kept")
    assert not any("none" in text.get_text() for text, _ in texts(trade_figure(BODY, traded())))


@pytest.mark.weekly
@pytest.mark.parametrize("body", [BODY, spinner(phase=0.0)], ids=["channels", "at once"])
def test_points_that_miss_the_requirement_are_hollow_and_all_have_a_place(
    body: Spacecraft,
) -> None:
    body = replace(
        body, requirement=Requirement(momentum_shift=math.radians(0.05)), dispersions=None
    )
    both = tradeoff.fronts(body, OptimalOptions(), count=3, shifts=(0.0, math.inf))
    plans = [point for _, _, point in tradeoff.numbered(both)]
    failing = {point.plan.end for point in plans if point.plan.meets_requirement is False}
    figure = trade_figure(body, both)
    check_layout(figure)
    low, high = figure.axes[0].get_xlim()
    assert all(low < point.plan.pulses.end < high for point in plans)
    if body.channels:
        marks = [one for one in figure.axes[0].lines if len(np.asarray(one.get_xdata())) == 1]
        hollow = (one for one in marks if one.get_markerfacecolor() == style.PAPER)
        assert failing == {float(np.asarray(one.get_xdata())[0]) for one in hollow} != set()
        assert f"hollow: {FAILS}" in legend_words(figure)
    else:
        assert min(point.plan.pulses.end for point in plans) == 0.0


@pytest.mark.deep
def test_of_points_close_together_those_are_numbered_that_have_room() -> None:
    """Each nearest to its own number."""
    points = tuple(traded_point(0.4 * step, 1.0 - 0.004 * step) for step in range(5))
    figure = trade_figure(BODY, (tradeoff.Front(0.0, points),))
    check_layout(figure)
    (axes,) = figure.axes
    labels = [one for one in axes.texts if isinstance(one, Annotation)]
    spots = {label.get_text(): np.asarray(axes.transData.transform(label.xy)) for label in labels}
    assert {*spots} == {"1", "2", "3", "4", "5"}
    for label in labels:
        box = label.get_window_extent()
        away = {
            other: np.hypot(*(np.clip(spot, box.min, box.max) - spot))
            for other, spot in spots.items()
        }
        assert label.get_visible()
        assert away.pop(label.get_text()) < 0.5 * min(away.values())


# --- what is said of trades
# ------------------------------------------------------------------------------------------

EASY = replace(WIDE, requirement=Requirement(nutation=math.radians(30.0)))


def front_of(body: Spacecraft, *shares: float) -> tradeoff.Front:
    """One schedule a share of the cost, with H anywhere, all of which end as the plan of two-pulse
    does.
    """
    plan = planning.plan(body, "two-pulse")
    bounds = Bounds(plan.pulses.cost_in("N m s"), None, "N m s", 60.0)
    points = []
    for share in shares:
        pulses = tuple(replace(one, impulse=share * one.impulse) for one in plan.pulses)
        schedule = replace(plan.pulses, pulses=pulses, bounds=bounds)
        points.append(tradeoff.Point(replace(plan, schedule=schedule), 42.0, "N m s"))
    return tradeoff.Front(math.inf, tuple(points))


def half_of(front: tradeoff.Front) -> tradeoff.Front:
    """A front of the first pulse alone of its first point, which leaves nutation and shifts H."""
    point = front.points[0]
    half = replace(
        point.plan, schedule=replace(point.plan.pulses, pulses=point.plan.pulses.pulses[:1])
    )
    return replace(front, points=(point._replace(plan=half),))


def codes(fronts: tuple[tradeoff.Front, ...], chosen: planning.Plan) -> list[str]:
    """Codes of the notes on a trade beside a plan."""
    return [note.code for note in trade_notes(fronts, chosen, chosen.verdict)]


def test_a_schedule_that_is_better_is_named_beside_the_recommended_one() -> None:
    """One that costs less, one as cheap a nutation period earlier, one that meets what the plan
    does not; none that is not to be flown.
    """
    chosen = compare(EASY, ["two-pulse"])["two-pulse"]
    cheaper = (front_of(EASY, 0.999999, 0.95, 0.9),)
    late = replace(EASY, limits=replace(EASY.limits, earliest=EASY.nutation_period))
    later = compare(late, ["two-pulse"])["two-pulse"]
    whole = front_of(replace(WIDE, requirement=Requirement(nutation=math.radians(1.0))), 1.0)
    failing = half_of(whole)
    plan = failing.points[0].plan
    blocks = front_of(commanded(EASY, np.array([1.0, 0.0, 0.0])), 0.9)
    assert plan.meets_requirement is False
    assert blocks.points[0].verdict.status is Status.NOT_COMMANDABLE
    rows: tuple[tuple[tuple[tradeoff.Front, ...], planning.Plan, list[str]], ...] = (
        ((), chosen, []),
        ((front_of(EASY, 1.0),), chosen, []),
        ((front_of(EASY, 1.0, 1.1),), chosen, []),
        ((blocks,), chosen, []),
        ((failing,), plan, []),
        (cheaper, chosen, ["trade-better"]),
        ((front_of(EASY, 1.0),), later, ["trade-better"]),
        ((whole,), plan, ["trade-meets"]),
    )
    assert [codes(fronts, beside) for fronts, beside, _ in rows] == [code for *_, code in rows]
    better = next(trade_notes(cheaper, chosen, chosen.verdict, "own.yaml"))
    assert better.values["point"] == 3
    assert str(better.values["command"]).startswith("nutdamp plan own.yaml --scheme ")
    told = [trade_notes(fronts, beside, beside.verdict) for fronts, beside, _ in rows]
    check_text("pictures.trade-better", "\n".join(text(note) for notes in told for note in notes))


def test_a_recommended_plan_that_is_not_traded_and_costs_less_is_explained() -> None:
    chosen = planning.plan(replace(WIDE, steerable=Steerable(20.0)), "one-pulse")
    dearer = front_of(WIDE, 1.0)
    share = 0.9 * dearer.points[0].plan.pulses.cost_in("N m s") / chosen.pulses.total_impulse
    pulses = tuple(
        replace(one, impulse=one.impulse * share, t=one.t + 60.0) for one in chosen.pulses
    )
    cheap = replace(chosen, schedule=replace(chosen.pulses, pulses=pulses))
    (dear,) = trade_notes((dearer,), cheap, cheap.verdict)
    assert (dear.code, dear.values["point"]) == ("trade-dearer", 1)
    assert dear.values["saved_percent"] == pytest.approx(10.0)
    assert codes((dearer,), dearer.points[0].plan) == []
    little = replace(pulses[0], impulse=1e-3 * pulses[0].impulse)
    cheaper = replace(cheap, schedule=replace(cheap.pulses, pulses=(little,)))
    assert codes((half_of(dearer),), cheaper) == ["trade-dearer"]
    (point,) = half_of(dearer).points
    failing = point._replace(
        plan=replace(point.plan, spacecraft=replace(WIDE, requirement=Requirement(nutation=1e-6)))
    )
    assert fails(failing)
    assert codes((replace(dearer, points=(failing,)),), cheaper) == [], (
        "it is not compared with what fails"
    )
    # Costs that count as equal are told where they read differently.
    assert codes((front_of(WIDE, 1.0009),), dearer.points[0].plan) == ["trade-alike"]


def test_a_table_says_why_h_ends_beside_its_start_and_how_costs_lie_below_first_order() -> None:
    """The first of two pulses alone shifts H:
    on a front where H is not to move that is explained.
    """
    whole = front_of(WIDE, 1.0)
    shifted, still = (replace(front, shift=0.0) for front in (half_of(whole), whole))
    for front, code, told in (
        (shifted, "trade-ends-off", True),
        (replace(shifted, shift=math.inf), "trade-ends-off", False),
        (still, "trade-ends-off", False),
        (front_of(WIDE, 0.9), "trade-below-bound", True),
        (front_of(WIDE, 1.1), "trade-below-bound", False),
    ):
        (sentence,) = sentences([note(code)])
        assert (sentence in [str(part) for part in front_parts(WIDE, [front])]) is told


# --- studies and loops: distributions, final H, firings

POINTED = replace(
    aimed(spinner(steerable=Steerable(50.0), requirement=REQUIRED), 10.0, 30.0),
    dispersions=replace(TOLERANCES, thrust={}),
)
NAMES = ("overview", "cases", "momentum")
OFFSET = Tolerance("bias", 0.01)


@cache
def study(which: str = "shift") -> Dispersion:
    return studied(BODY if which == "shift" else POINTED, 3000)


@cache
def drawn(name: str, which: str = "shift") -> Figure:
    return studies.dispersion_figure(study(which), name)


@pytest.mark.deep
@pytest.mark.parametrize(
    ("name", "which"),
    [*((name, "shift") for name in NAMES), *(weekly(name, "target") for name in NAMES)],
)
def test_studies_are_drawn_whole_seen_on_any_page_and_say_what_is_met(
    name: str, which: str
) -> None:
    check_layout(drawn(name, which))
    check_colours(drawn(name, which))
    verdict = study(which).verdict
    assert verdict.status is Status.NOT_ENOUGH
    assert heading(drawn(name, which)).endswith(f" {lead(verdict)}: {statement(verdict)}")


@pytest.mark.parametrize("which", ["shift", weekly("target")])
@pytest.mark.parametrize("factor", [0.3, 0.6, 0.9, 1.0, 1.4, 2.0, 3.0])
def test_a_contour_lies_in_the_box_where_enough_cases_keep_both_limits(
    which: str, factor: float
) -> None:
    """Whatever the limits are, and nowhere else; it holds the share required."""
    verdict, results = study(which).verdict, study(which).core
    bounds = studies.box_bounds(verdict)
    assert {bound.part for bound in bounds} == {Part.NUTATION, aim(verdict.spacecraft)}
    nutation, other = (bound._replace(limit=factor * bound.limit) for bound in bounds)
    region = studies.acceptance_contour(verdict, (nutation, other))
    rows = present(results.values)[[OUTPUTS.index(bound.part.value) for bound in bounds]]
    keep = nutation.met(rows[0]) & other.met(rows[1])
    limits = np.degrees([nutation.limit, other.limit])
    assert bool(np.all(region <= limits * (1.0 + 1e-12))) == (keep.mean() >= results.probability)
    corners = np.degrees(rows.T)
    inside = np.ones(len(corners), dtype=bool)
    for corner, following in zip(region, np.roll(region, -1, axis=0), strict=True):
        (x, y), (across, along) = following - corner, (corners - corner).T
        inside &= x * along - y * across >= -1e-12
    assert inside.mean() >= results.probability


@pytest.mark.parametrize("which", ["shift", weekly("target")])
def test_h_may_end_about_its_goal_and_its_contour_holds_the_cases(which: str) -> None:
    verdict = study(which).verdict
    flight = present(verdict.flight)
    outlines = studies.accepted(flight, verdict)
    start = verdict.spacecraft.momentum
    goal = start if which == "shift" else present(verdict.spacecraft.goal.axis)
    directions = geometry.off_sky(geometry.sky_plane(flight, start), outlines["limit"])
    away = np.degrees(angle_between(directions, goal))
    assert away == pytest.approx(np.full(len(away), math.degrees(present(REQUIRED.momentum_shift))))
    if which == "shift":  # about the H(0) of each case, which is the centre
        points = studies.momentum_cases(study(which).core)
        held = studies.ellipse(points, study(which).core.probability)
        assert outlines["contour"] == pytest.approx(held, abs=1e-9)


@pytest.mark.deep
def test_the_acceptance_box_names_every_scheme_with_cost_and_share() -> None:
    compared = compare(BODY, samples=2_048)
    figure = compared.figure("box")
    check_layout(figure)
    check_colours(figure)
    (axes,) = figure.axes
    words = [line for note in axes.texts for line in note.get_text().split("\n")]
    for plan, verdict in compared.verdicts.items():
        (label,) = [text for text in words if text.startswith(f"{plan.scheme} ")]
        assert label.startswith(f"{plan.scheme} {spent(plan.pulses)}, {share_text(verdict.cases)}")
    (off,) = [text for text in words if text.startswith("one-pulse")]
    shift = math.degrees(compared["one-pulse"]._flight.residual.momentum_shift)
    assert off.endswith(f": {shift:.3g}°")
    assert len(axes.patches) == 1, "the recommended one is filled"


def test_without_cases_schemes_are_points_and_a_missing_limit_is_no_edge() -> None:
    free = replace(BODY, dispersions=None, requirement=Requirement(math.radians(0.5)))
    compared = compare(free, ["one-pulse", "two-pulse"])
    (axes,) = compared.figure("box").axes
    assert axes.get_ylabel() == "momentum shift, ° (no limit)"
    dots = [np.asarray(one.get_xydata())[0] for one in axes.lines if one.get_marker() == "o"]
    shifts = [math.degrees(plan._flight.residual.momentum_shift) for plan in compared]
    assert sorted(dot[1] for dot in dots) == pytest.approx(sorted(shifts), abs=1e-9)


@pytest.mark.deep
@pytest.mark.parametrize("which", ["shift", weekly("target")])
def test_curves_hold_all_cases(which: str) -> None:
    """The curve is the share of cases within a value; a point on it is that of the requirement."""
    results = study(which).core
    outputs = ("nutation", "momentum_shift" if which == "shift" else "axis_error")
    for axes, output in zip(drawn("cases", which).axes, outputs, strict=True):
        values = np.sort(np.degrees(present(results.values)[OUTPUTS.index(output)]))
        assert not axes.patches
        places, shares = line(axes, "cases within").T
        assert (places[-1], shares[-1]) == (pytest.approx(values[-1]), 100.0)
        for place, share in zip(places[::37], shares[::37], strict=True):
            assert 100.0 * np.mean(values <= place * (1.0 + 1e-9)) == pytest.approx(
                share, abs=200.0 / len(values)
            )
        (dot,) = (one for one in axes.lines if one.get_marker() == "o")
        assert np.asarray(dot.get_xydata())[0] == pytest.approx(
            [np.quantile(values, 0.997), 99.7], rel=0.02
        )


def test_a_curve_with_a_long_tail_reaches_its_end_on_a_log_axis() -> None:
    """Which begins at the least value, or six decades before the largest."""
    few = np.random.default_rng(1).random(99_990)
    values = np.radians(np.append(few, np.full(10, 50.0)))
    axes = Figure().subplots()
    studies.draw_distribution(axes, Exact(values), "nutation left, °", None)
    assert (axes.get_xscale(), axes.get_xlabel()) == ("log", "nutation left, ° (log)")
    left, right = axes.get_xlim()
    assert left == pytest.approx(max(few.min(), 50e-6))
    assert line(axes, "cases within")[-1] == pytest.approx([50.0, 100.0])
    assert right > 50.0


@pytest.mark.deep
@pytest.mark.parametrize("bias", [0.0, 0.01])
def test_cases_that_are_all_alike_are_told_in_words(bias: float) -> None:
    """A curve of rounding is an empty panel with ticks of 1e-13 degrees."""
    still = Dispersions(timing=Tolerance("uniform", 1e-15), timing_offset=OFFSET if bias else None)
    results = studied(replace(BODY, dispersions=still), 50)
    check_layout(studies.dispersion_figure(results, "overview"))
    figure = studies.dispersion_figure(results, "cases")
    check_layout(figure)
    for axes, output, required in zip(
        figure.axes, ("nutation", "momentum_shift"), (0.5, 0.2), strict=True
    ):
        distribution = results.core.distribution(output)
        assert distribution is not None
        left = math.degrees(distribution.maximum)
        assert (left >= 1e-6) == bool(bias)
        (said,) = (text.get_text() for text in axes.texts)
        sizes = (f"{left:#.3g}°",) if bias else ("0°", "< 1e-6°")
        assert said in [f"all 50 cases:\n{size}, required {required:.3f}°" for size in sizes]
        assert not len(axes.get_xticks())
        assert not axes.lines


@pytest.mark.deep
@pytest.mark.parametrize("size", [0.0005, 0.001])
def test_the_ticks_of_small_shifts_keep_apart(size: float) -> None:
    thrust = dict.fromkeys(TOLERANCES.thrust, Tolerance("normal", size, relative=True))
    body = replace(
        BODY, dispersions=Dispersions(thrust=thrust, timing=Tolerance("uniform", 0.05 * size))
    )
    figure = studies.dispersion_figure(studied(body, 500), "momentum")
    check_layout(figure)
    assert "the 500 cases" in legend_words(figure)
    assert len(figure.axes[0].get_xticklabels()) >= 3


@pytest.mark.deep
@pytest.mark.parametrize(
    ("which", "output"), [("shift", "momentum_shift"), ("target", "axis_error")]
)
def test_final_h_lies_as_far_out_as_the_table_says(which: str, output: str) -> None:
    results = study(which).core
    cases = studies.momentum_cases(results)
    away = np.degrees(present(results.values)[OUTPUTS.index(output)])
    assert np.hypot(*cases.T) == pytest.approx(away, rel=1e-6, abs=1e-9)
    axes = drawn("momentum", which).axes[0]
    (dots,) = (patch for patch in axes.patches if isinstance(patch, PathPatch))
    assert np.asarray(dots.get_path().vertices)[::2] == pytest.approx(cases[: studies.DOTS])
    required = line(axes, "required")
    assert np.hypot(*required.T) == pytest.approx(np.full(len(required), 0.2))
    assert axes.get_aspect() == 1.0
    left, right = axes.get_xlim()
    assert left < cases[:, 0].min() <= cases[:, 0].max() < right
    assert "2,000 of the 3,000 cases" in legend_words(drawn("momentum", which))


def test_the_ellipse_holds_its_share_and_is_that_of_the_covariance() -> None:
    points = np.random.default_rng(2).multivariate_normal(
        [1.0, -2.0], [[4.0, 1.5], [1.5, 1.0]], 100_000
    )
    inverse = np.linalg.inv(np.cov(points.T))
    for share in (0.5, 0.9, 0.997):
        rim, inside = (
            rows - points.mean(axis=0) for rows in (studies.ellipse(points, share), points)
        )
        sizes = np.sqrt(np.einsum("ij,jk,ik->i", rim, inverse, rim))
        assert np.ptp(sizes) < 1e-6 * sizes[0]
        # Rayleigh: of normal cases this share lies within.
        assert sizes[0] == pytest.approx(math.sqrt(-2.0 * math.log(1.0 - share)), rel=0.02)
        within = np.einsum("ij,jk,ik->i", inside, inverse, inside) <= sizes[0] ** 2
        assert within.mean() == pytest.approx(share, abs=1e-4)
    assert (studies.ellipse(np.zeros((5, 2)), 0.997) == 0.0).all()


# --- loops
# --------------------------------------------------------------------------------------------------


def looping(requirement: Requirement | None = None) -> Spacecraft:
    forces = {
        "+M1": (0.0, -9.0, 0.0),
        "-M1": (0.0, 9.0, 0.0),
        "+M2": (9.0, 0.0, 0.0),
        "-M2": (-9.0, 0.0, 0.0),
    }
    channels = tuple(
        Channel(
            name, (replace(jet(name, (0.0, 0.0, 0.8), force), min_on_time=0.02, max_on_time=0.3),)
        )
        for name, force in forces.items()
    )
    loop = Loop(Sensor(rate=20.0), start=math.radians(0.5), stop=math.radians(0.05))
    dispersions = Dispersions(omega0=(normal(0.004),) * 3)
    return replace(
        spinner(channels=channels), loop=loop, dispersions=dispersions, requirement=requirement
    )


@pytest.mark.parametrize(("most", "beside"), [deep(1e-3, True), deep(80.0, False)])
def test_dispersed_loops_show_the_shift_that_is_required(most: float, beside: bool) -> None:
    body = looping(Requirement(momentum_shift=math.radians(most)))
    results = run_loops(LoopResults(loop_study(body, 60.0), 20))
    figure = studies.loop_cases_figure(LoopDispersion(results))
    check_layout(figure)
    nutation, shift = figure.axes
    assert line(nutation, "cases within")[-1] == pytest.approx(
        [np.degrees(results.of("nutation").max()), 100.0]
    )
    levels = [
        float(np.asarray(one.get_xdata())[0])
        for one in shift.lines
        if one.get_label() == "required"
    ]
    assert levels == ([pytest.approx(most)] if beside else [])
    assert f"required {most:#.3g}".rstrip(".") in shift.get_title()


@pytest.mark.deep
def test_a_loop_shows_its_dead_band_and_what_holding_takes() -> None:
    """Pulses of whole cycles, as a budget has them but for 1 %; time in hours where it is long."""
    plan = loop_of(looping(), 400.0)
    figure = loop_figure(plan)
    check_layout(figure)
    assert "dead band" in legend_words(figure)
    assert [axes.get_xlabel() for axes in figure.axes][-1] == "time, s"
    assert upkeep(plan) == "", "nothing grows, so that it never fires again"
    held = loop_of(nutdamp.load(places.CONFIGS / "ulysses.yaml"))
    words = upkeep(held).split()
    (cycle,) = (pair.cycle for pair in budget(held.spacecraft).held)
    pulses, kg = (float(words[words.index(unit) - 1]) for unit in ("pulses", "kg"))
    assert pulses == pytest.approx(86400.0 * present(cycle).pulses, rel=0.01)
    assert kg == pytest.approx(365.25 * 86400.0 * present(present(cycle).propellant), rel=0.01)
    figure = loop_figure(held)
    check_layout(figure)
    assert figure.axes[-1].get_xlabel() == "time, hours"
    assert [time_unit(until)[0] for until in (7200.0, 7201.0, 3e5)] == ["s", "hours", "days"]
