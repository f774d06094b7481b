"""Schemes beside each other, fronts of cost against time, the proof of the least cost; and what is said of them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from support.builders import cross, spinner
from support.cases import deep
from support.colours import check_colours
from support.compared_body import BODY, line
from support.dispersed import normal
from support.golden import check_text
from support.layout import check_layout, texts
from support.shown import WIDE, check_star, flight_picture, heading, legend_words

from nutdamp.common.numerics import down
from nutdamp.figures import certificate as primer
from nutdamp.figures import schemes, style, trade
from nutdamp.figures.style import PULSE
from nutdamp.planning import plan as planning
from nutdamp.planning import tradeoff
from nutdamp.planning.decision import Comparison, compare
from nutdamp.planning.plan import Plan
from nutdamp.planning.recommendation import Standing
from nutdamp.planning.tradeoff import Front, Point, certificate
from nutdamp.schemes.catalogue import OptimalOptions
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Keep, Limits, Requirement, Spacecraft
from nutdamp.spacecraft.schedule import Bounds, Schedule
from nutdamp.spacecraft.tolerances import Dispersions
from nutdamp.views.text import cost
from nutdamp.views.trade import ALIKE, BELOW, OFF, apart, beats, fails, front_parts, outdone

pytestmark = pytest.mark.usefixtures("plans_shared")

# --- schemes ---------------------------------------------------------------------------------------------------------


@cache
def compared() -> Comparison:
    return compare(BODY, ("one-pulse", "two-pulse", "four-pulse", "optimal"), samples=0)


def column(figure: Figure, name: str) -> Axes:
    (axes,) = (axes for axes in figure.axes if axes.get_xlabel().startswith(name))
    return axes


def dots(axes: Axes) -> dict[str, tuple[float, str, bool]]:
    """By scheme: where the dot stands, its mark, whether it is filled."""
    rows = dict(zip(axes.get_yticks(), (text.get_text() for text in axes.get_yticklabels()), strict=True))
    marks = {}
    for one in axes.lines:
        if str(one.get_marker()) in "o<xX" and len(np.asarray(one.get_xdata())) == 1:
            x, y = np.asarray(one.get_xydata())[0]
            filled = one.get_markerfacecolor() == one.get_color()
            marks[rows[y].partition("\n")[0]] = float(x), str(one.get_marker()), filled
    return marks


@pytest.mark.deep
def test_dots_stand_at_the_numbers_of_the_comparison_beside_floor_and_requirement() -> None:
    figure = schemes.schemes_figure(compared())
    check_layout(figure)
    check_colours(figure)
    ends, impulses = dots(column(figure, "end")), dots(column(figure, "impulse"))
    for plan in compared().plans:
        assert ends[plan.scheme][0] == pytest.approx(plan.end)
        assert impulses[plan.scheme][0] == pytest.approx(plan.total_impulse)
        if plan.meets_requirement:
            assert ends[plan.scheme][1:] == ("o", plan is compared().recommended)
    for name, part, most in (("nutation", "nutation", 0.5), ("shift of H", "momentum_shift", 0.2)):
        axes = column(figure, name)
        assert axes.get_xscale() == "log"
        assert line(axes, "required")[0, 0] == pytest.approx(most)
        for plan in compared().plans:
            left = math.degrees(getattr(plan.flown, part))
            place, mark, _ = dots(axes)[plan.scheme]
            below = place == pytest.approx(axes.get_xlim()[0])
            assert left < place and mark in "<xX" if below else place == pytest.approx(left)
            assert (f"{left:#.4g}" if left >= 1e-9 else "< 1e-9") in [note.get_text() for note in axes.texts]
    bounds = compared()["optimal"].pulses.bounds
    assert bounds is not None
    # A scheme that leaves more may take less: the line does not say that nothing does.
    floor = "lower bound of cost, for optimal"
    assert line(column(figure, "impulse"), floor)[0, 0] == pytest.approx(bounds.rigorous)
    assert floor in legend_words(figure)
    assert "no schedule that leaves as little takes less" not in legend_words(figure)
    assert all(axes.get_xlim()[0] >= 0.0 for axes in figure.axes)
    assert not [axes for axes in figure.axes if "complying" in axes.get_xlabel()]


@pytest.mark.deep
@pytest.mark.parametrize("required", [True, False])
def test_schemes_that_fall_short_are_not_taken_for_the_cheapest(required: bool) -> None:
    """They stand at the foot under another mark, and say so: half of a schedule takes half of the impulse."""
    body = BODY if required else replace(BODY, requirement=None)
    whole, best = (planning.plan(body, name) for name in ("two-pulse", "optimal"))
    both = Comparison(body, (Plan(body, "half", Schedule(whole.pulses.pulses[:1])), whole, best))
    assert [plan.scheme for plan in both.plans if plan.standing is Standing.MISSES] == ["half"]
    figure = schemes.schemes_figure(both)
    check_layout(figure)
    words = "NOT met: nutation and shift of H" if required else "does not damp"
    left = min(axes.get_position().x0 for axes in figure.axes)
    for axes in figure.axes:
        named = [text.get_text() for text in axes.get_yticklabels()]
        outermost = axes.get_position().x0 == pytest.approx(left, abs=0.01)
        assert named[-1] == (f"half\n{words}" if outermost else "half")
        assert not [name for name in named[:-1] if words in name]
        assert {scheme for scheme, (_, mark, _) in dots(axes).items() if mark in "xX"} == {"half"}
    assert ("requirement NOT met" if required else "does not damp") in legend_words(figure)


def test_scales_of_schemes() -> None:
    """Costs that are equal but for rounding look equal; complying cases end at all of them."""
    axes = Figure().subplots()
    for costs in ([2.564, 2.5642, 2.56423], [200.0, 200.0 * (1 + 1e-15)]):
        schemes._scale(axes, costs, schemes.BarQuantity("impulse", lambda plan: plan.pulses.total_impulse, str))
        low, high = axes.get_xlim()
        assert np.ptp(costs) / (high - low) < 0.01
        assert 0.0 < low < min(costs) <= max(costs) < high
    schemes._scale(axes, [64.0, 99.9, 99.7], schemes._complying({}, 0.997))
    assert 100.0 < axes.get_xlim()[1] < 105.0


@pytest.mark.deep
@pytest.mark.parametrize(("kilograms", "unit", "shown"), [((1.593, 0.654), "kg", "0.6540"), ((0.0128,), "g", "12.80")])
def test_propellant_has_the_unit_of_the_tables(kilograms: tuple[float, ...], unit: str, shown: str) -> None:
    pulse = planning.plan(BODY, "two-pulse").pulses.pulses[0]
    plans = (Plan(BODY, f"trial {spent}", Schedule((replace(pulse, propellant=spent),))) for spent in kilograms)
    axes = column(schemes.schemes_figure(Comparison(BODY, tuple(plans))), "propellant")
    assert axes.get_xlabel() == f"propellant, {unit}"
    assert shown in {note.get_text() for note in axes.texts}


@pytest.mark.deep
def test_where_cases_were_flown_a_column_says_how_many_comply() -> None:
    """Of the schemes of which all have flown; those with which too few comply fall short."""
    sure = replace(BODY, dispersions=Dispersions(thrust_per_pulse=normal(0.001, relative=True)))
    for body, samples, count in ((BODY, 2_000, 2), (BODY, 3_000, 1), (sure, 2_000, 2)):
        both = compare(body, ("two-pulse", "four-pulse"), samples=samples)
        figure = schemes.schemes_figure(both)
        check_layout(figure)
        axes = column(figure, "complying cases")
        shares = {plan.scheme: 100.0 * share.exact for plan, share in both.shares.items() if share.exact is not None}
        assert {name: place for name, (place, _, _) in dots(axes).items()} == pytest.approx(shares)
        assert len(shares) == count
        meet = {plan.scheme for plan in both.plans if both.meets(plan)}
        assert ({name for name, (_, mark, _) in dots(axes).items() if mark == "o"}) == meet & set(shares)
        assert meet == (set() if body is BODY else {"two-pulse"})
        chosen = [name for name, (_, mark, filled) in dots(axes).items() if filled and mark == "o"]
        assert chosen == [name for name in sorted(meet) if both[name] is both.recommended]
        few = {plan.scheme for plan in both.plans if plan.meets_requirement} - meet
        assert bool(few) == (body is BODY)
        rows = [text.get_text() for text in column(figure, "nutation").get_yticklabels()]
        assert {row.partition("\n")[0] for row in rows if "too few cases comply" in row} == few
        assert axes.get_xlim()[1] <= 106.0  # beyond all of them by 6 % of the scale at most
        assert line(axes, "required")[0, 0] == pytest.approx(99.7)


@pytest.mark.deep
def test_an_infeasible_scheme_has_a_row_without_dots() -> None:
    ideal = compare(spinner(), ("one-pulse", "four-pulse"))
    figure = schemes.schemes_figure(ideal)
    check_layout(figure)
    assert all(set(dots(axes)) == {"one-pulse"} for axes in figure.axes)
    rows = [tick.get_text() for axes in figure.axes for tick in axes.get_yticklabels()]
    assert rows.count("four-pulse\nno plan") == len(figure.axes)
    check_layout(schemes.schemes_figure(compare(spinner(), ("four-pulse",))))


@pytest.mark.deep
def test_a_scheme_that_breaks_a_cone_is_marked_as_not_met() -> None:
    body = replace(BODY, keep=(Keep("Star", np.array([1.0, 0.0, 0.0]), least=math.radians(179.0)),))
    both = compare(body, ("two-pulse", "four-pulse"))
    assert all(plan.kept is False and not plan.meets_requirement for plan in both.plans)
    assert any(plan.ends_well for plan in both.plans)
    assert all(fails(Point(plan, 100.0, "N m s")) for plan in both.plans)
    figure = schemes.schemes_figure(both)
    check_layout(figure)
    # Below the scale a mark points there, in the colour of the others that fail.
    assert all(mark in "xX<" for axes in figure.axes for _, mark, _ in dots(axes).values())
    marks = [one for axes in figure.axes for one in axes.lines if str(one.get_marker()) in "oxX<"]
    assert {one.get_color() for one in marks if len(np.asarray(one.get_xdata()))} == {PULSE}


@pytest.mark.deep
@pytest.mark.parametrize(("torque", "model"), [(20.0, "real pulse widths"), (None, "exact motion, ideal impulses")])
def test_titles_speak_of_widths_where_pulses_have_some(torque: float | None, model: str) -> None:
    body = spinner(steerable=Steerable(torque))
    both = compare(body, ["one-pulse", "two-pulse"])
    assert f"schemes by {model}" in heading(schemes.schemes_figure(both))
    assert f"by {model}" in heading(flight_picture("timeline", body))
    assert both["two-pulse"].flight.model == "real pulse widths"


# --- trades ----------------------------------------------------------------------------------------------------------


@cache
def traded() -> tuple[Front, ...]:
    """Two hand-made fronts that begin with one schedule: later ends cost less, and a free H less still."""
    strict = ((0.0, 1.0), (4.0, 0.97), (10.0, 0.95), (20.0, 0.94))
    free = ((5.0, 0.94), (12.0, 0.91), (22.0, 0.895))
    first, *others = (traded_point(*one) for one in strict)
    return Front(0.0, (first, *others)), Front(math.inf, (first, *(traded_point(*one) for one in free)))


def traded_point(later: float, share: float) -> Point:
    """The two pulses of the compared body, ``later`` s and of a ``share`` of their impulse."""
    made = planning.plan(BODY, "two-pulse")
    pulses = tuple(replace(one, t=one.t + later, impulse=one.impulse * share) for one in made.pulses)
    least = share * made.total_impulse
    schedule = Schedule(pulses, bounds=Bounds(0.99 * least, 0.9 * least, "N m s", 40.0))
    return Point(replace(made, scheme="optimal", schedule=schedule), 40.0, "N m s")


@pytest.mark.deep
def test_the_trade_numbers_every_point_and_explains_its_marks() -> None:
    chosen = planning.plan(BODY, "two-pulse")
    figure = trade.trade_figure(BODY, traded(), chosen)
    check_layout(figure)
    check_colours(figure)
    (axes,) = figure.axes
    named = [int(number) for note in axes.texts for number in note.get_text().split(", ")]
    assert sorted(named) == list(range(1, sum(len(front.points) for front in traded()) + 1))
    least = min(point.bounds.rigorous or 0.0 for front in traded() for point in front.points)
    bound = f"lower bound of cost, same nutation left: {cost(down(least), 'N m s')}"
    both = "the same schedule, on this front too"
    assert {"H ends where it was", "H may end anywhere", bound, both} <= legend_words(figure)
    rings = [one for one in axes.lines if one.get_markerfacecolor() == "none" and len(np.asarray(one.get_xdata())) == 1]
    marks = [one for one in axes.lines if one.get_marker() == "o" and len(np.asarray(one.get_xdata()))]
    assert rings
    assert all(ring.get_markersize() > mark.get_markersize() for ring in rings for mark in marks)
    assert line(axes, "recommended: two-pulse")[0] == pytest.approx([chosen.end, chosen.total_impulse])


@pytest.mark.deep
@pytest.mark.parametrize("front", [0, 1])
def test_no_number_lies_under_the_star_of_the_recommended_plan(front: int) -> None:
    for point in traded()[front].points:
        (axes,) = trade.trade_figure(BODY, traded(), point.plan).axes
        assert axes.xaxis.get_major_formatter()(2.0) == "2"  # no powers of ten
        check_star(axes, np.array([point.plan.end, point.cost]), 0.36 * style.STAR)


@pytest.mark.deep
def test_fronts_without_points_say_why() -> None:
    figure = trade.trade_figure(spinner(), (Front(0.0, (), "no channel"),))
    check_layout(figure)
    assert not figure.axes
    assert any("H ends where it was \N{EN DASH} none: no channel" in text.get_text() for text, _ in texts(figure))
    missing = Front(0.0, (), "within 40 s H cannot be kept where it is; " + "set limits.horizon to more " * 5)
    figure = trade.trade_figure(BODY, (missing, traded()[1]))
    check_layout(figure)
    said = " ".join(figure.axes[0].get_title(loc="left").split())
    assert said.startswith("H ends where it was \N{EN DASH} none: within 40 s H cannot be kept")
    assert not any("none" in text.get_text() for text, _ in texts(trade.trade_figure(BODY, traded())))


@pytest.mark.weekly
@pytest.mark.parametrize("body", [BODY, spinner(phase=0.0)], ids=["channels", "at once"])
def test_points_that_do_not_meet_the_requirement_are_crossed_out_and_all_have_their_place(body: Spacecraft) -> None:
    body = replace(body, requirement=Requirement(momentum_shift=math.radians(0.05)))
    both = tradeoff.fronts(body, OptimalOptions(), count=3, shifts=(0.0, math.inf))
    plans = [point for _, _, point in tradeoff.numbered(both)]
    failing = {(point.plan.end, point.cost) for point in plans if point.plan.meets_requirement is False}
    figure = trade.trade_figure(body, both)
    check_layout(figure)
    low, high = figure.axes[0].get_xlim()
    assert all(low < point.plan.pulses.end < high for point in plans)
    if body.channels:
        crossed = line(figure.axes[0], "does not meet the requirement")
        assert failing == {(end, cost) for end, cost in crossed.tolist()} != set()
    else:
        assert min(point.plan.pulses.end for point in plans) == 0.0


@pytest.mark.parametrize(
    ("count", "later", "cheaper"), [deep(5, 0.4, 0.004), pytest.param(80, 0.006, 0.0022, marks=pytest.mark.weekly)]
)
def test_points_close_together_keep_numbers_that_can_be_read(count: int, later: float, cheaper: float) -> None:
    """Nearest to their own points or joined to them."""
    close = Front(0.0, tuple(traded_point(later * step, 1.0 - cheaper * step) for step in range(count)))
    figure = trade.trade_figure(BODY, (close,))
    check_layout(figure, crowded=count > 5)
    assert {str(number) for number in range(1, count + 1)} <= {text.get_text() for text, _ in texts(figure)}
    (axes,) = figure.axes
    joined = [np.asarray(line.get_xydata())[0] for line in axes.lines if line.get_label() == "_leader"]
    named = {note.get_text(): note for note in axes.texts if isinstance(note, Annotation)}
    spots = {name: np.asarray(axes.transData.transform(note.xy)) for name, note in named.items()}
    for name, note in named.items() if count == 5 else ():
        box = note.get_window_extent()
        away = {other: np.hypot(*(np.clip(spot, box.min, box.max) - spot)) for other, spot in spots.items()}
        own = away.pop(name)
        assert own < 0.5 * min(away.values()) or any(np.allclose(note.xy, end) for end in joined), name


@pytest.mark.deep
@pytest.mark.parametrize("horizon", [120.0, 400.0])
def test_proofs_are_drawn_where_pulses_can_be_told_apart_and_of_many_periods_by_their_peaks(horizon: float) -> None:
    """Curves would fill the panel; burns stand on the line of the peaks, which is what they cost."""
    made = planning.plan(spinner(channels=cross(8.0), limits=Limits(horizon=horizon)), "optimal")
    assert 0.0 < made.pulses.end < 60.0
    figure = primer.certificate_figure(certificate(made))
    check_layout(figure)
    *_, upper, closer = figure.axes
    fired = line(closer, "pulses of the plan")
    assert sorted(fired[:, 0]) == pytest.approx([pulse.t for pulse in made.pulses])
    spots = closer.transData.transform(fired)
    assert closer.get_window_extent().count_contains(spots) == len(spots)
    assert np.diff(np.sort(spots[:, 0])).min() > 10.0 * figure.dpi / 72.0
    if horizon == 400.0:
        assert upper.get_title().endswith("the highest of each period")
        for axes, least in ((upper, 0.85), (closer, -1.1)):
            values = np.concatenate([line(axes, name)[:, 1] for name in ("+1", "-1", "+2", "-2")])
            assert values.max() == pytest.approx(1.0, abs=1e-3)
            assert least < values.min()
            assert (values.min() < 0.0) == (axes is closer)


# --- what is said of trades ------------------------------------------------------------------------------------------

EASY = replace(WIDE, requirement=Requirement(nutation=math.radians(30.0)))


def front_of(body: Spacecraft, *shares: float) -> Front:
    """One schedule a share of the cost, with H anywhere, all of which end as the plan of two-pulse does."""
    plan = planning.plan(body, "two-pulse")
    bounds = Bounds(plan.pulses.cost_in("N m s"), None, "N m s", 60.0)
    points = []
    for share in shares:
        pulses = tuple(replace(one, impulse=share * one.impulse) for one in plan.pulses)
        schedule = replace(plan.pulses, pulses=pulses, bounds=bounds)
        points.append(Point(replace(plan, schedule=schedule), 42.0, "N m s"))
    return Front(math.inf, tuple(points))


def half_of(front: Front) -> Front:
    """A front of the first pulse alone of its first point, which leaves nutation and shifts H."""
    point = front.points[0]
    half = replace(point.plan, schedule=replace(point.plan.pulses, pulses=point.plan.pulses.pulses[:1]))
    return replace(front, points=(point._replace(plan=half),))


def test_a_schedule_that_is_better_is_named_beside_the_recommended_one() -> None:
    """One that costs less, one as cheap a nutation period earlier, one that meets what the plan does not."""
    chosen = compare(EASY, ["two-pulse"])["two-pulse"]
    cheaper = beats((front_of(EASY, 0.999999, 0.95, 0.9),), chosen)
    assert "pulses instead of" not in cheaper, "both take two"
    assert [beats((front_of(EASY, *shares),), chosen) for shares in ((1.0, 1.1), (1.0,))] == ["", ""]
    assert outdone((), chosen) == ""
    late = replace(EASY, limits=replace(EASY.limits, earliest=EASY.nutation_period))
    later = compare(late, ["two-pulse"])["two-pulse"]
    alike = (front_of(EASY, 1.0),)
    whole = front_of(replace(WIDE, requirement=Requirement(nutation=math.radians(1.0))), 1.0)
    failing = half_of(whole)
    plan = failing.points[0].plan
    assert plan.meets_requirement is False
    assert outdone((failing,), plan) == ""
    said = [cheaper, beats(alike, later), outdone(alike, later), beats((whole,), plan), outdone((whole,), plan)]
    check_text("pictures.trade-better", "\n".join(said))


def test_a_recommended_plan_that_is_not_traded_and_costs_less_is_explained() -> None:
    chosen = planning.plan(replace(WIDE, steerable=Steerable(20.0)), "one-pulse")
    dearer = front_of(WIDE, 1.0)
    share = 0.9 * dearer.points[0].plan.pulses.cost_in("N m s") / chosen.pulses.total_impulse
    pulses = tuple(replace(one, impulse=one.impulse * share, t=one.t + 60.0) for one in chosen.pulses)
    cheap = replace(chosen, schedule=replace(chosen.pulses, pulses=pulses))
    check_text("pictures.trade-apart", apart((dearer,), cheap))
    assert apart((dearer,), dearer.points[0].plan) == ""
    little = replace(pulses[0], impulse=1e-3 * pulses[0].impulse)
    cheaper = replace(cheap, schedule=replace(cheap.pulses, pulses=(little,)))
    assert apart((half_of(dearer),), cheaper)
    (point,) = half_of(dearer).points
    failing = point._replace(plan=replace(point.plan, spacecraft=replace(WIDE, requirement=Requirement(nutation=1e-6))))
    assert fails(failing)
    assert apart((replace(dearer, points=(failing,)),), cheaper) == "", "it is not compared with what fails"
    # Costs that count as equal are told where they read differently.
    assert apart((front_of(WIDE, 1.0009),), dearer.points[0].plan) == ALIKE


def test_a_table_says_why_h_ends_beside_where_it_was_and_how_costs_lie_below_their_first_order_least() -> None:
    """The first of two pulses alone shifts H: on a front where H is not to move that is explained."""
    whole = front_of(WIDE, 1.0)
    shifted, still = (replace(front, shift=0.0) for front in (half_of(whole), whole))
    for front, note, told in (
        (shifted, OFF, True),
        (replace(shifted, shift=math.inf), OFF, False),
        (still, OFF, False),
        (front_of(WIDE, 0.9), BELOW, True),
        (front_of(WIDE, 1.1), BELOW, False),
    ):
        assert (note in [str(part) for part in front_parts(WIDE, [front])]) is told
