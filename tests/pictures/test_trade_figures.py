"""Fronts of cost against time, and what is said of them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.text import Annotation
from support.builders import spinner
from support.colours import check_colours
from support.compared_body import BODY, line
from support.golden import check_text
from support.layout import check_layout, texts
from support.shown import WIDE, check_star, legend_words
from support.spinners import commanded

import nutdamp.api  # noqa: F401 - plans are judged by what is declared there
from nutdamp.common.numerics import down
from nutdamp.common.results import note
from nutdamp.figures import studies
from nutdamp.planning import plan as planning
from nutdamp.planning import tradeoff
from nutdamp.planning.decision import compare
from nutdamp.planning.plan import Plan
from nutdamp.planning.tradeoff import Front, Point
from nutdamp.planning.verdict import Status
from nutdamp.schemes.catalogue import OptimalOptions
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.spacecraft.schedule import Bounds, Schedule
from nutdamp.views.text import cost, sentences, text
from nutdamp.views.trade import FAILS, fails, front_parts, trade_notes

pytestmark = pytest.mark.usefixtures("plans_shared")

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
    figure = studies.trade_figure(BODY, traded(), chosen)
    check_layout(figure)
    check_colours(figure)
    (axes,) = figure.axes
    named = [int(number) for note in axes.texts for number in note.get_text().split(", ")]
    assert sorted(named) == list(range(1, sum(len(front.points) for front in traded()) + 1))
    least = min(point.bounds.rigorous or 0.0 for front in traded() for point in front.points)
    bound = f"lower bound, {cost(down(least), 'N m s')}"
    assert {"H ends where it was", "H may end anywhere", bound} <= legend_words(figure)
    assert sum(", " in note.get_text() for note in axes.texts) == 1  # the schedule of both fronts has one mark
    assert line(axes, "recommended: two-pulse (not traded)")[0] == pytest.approx([chosen.end, chosen.total_impulse])
    last = max(point.plan.end for front in traded() for point in front.points)
    assert last < axes.get_xlim()[1] < 2.0 * last


@pytest.mark.deep
@pytest.mark.parametrize("front", [0, 1])
def test_no_number_lies_under_the_mark_of_the_recommended_plan(front: int) -> None:
    for point in traded()[front].points:
        (axes,) = studies.trade_figure(BODY, traded(), point.plan).axes
        assert axes.xaxis.get_major_formatter()(2.0) == "2"  # no powers of ten
        check_star(axes, np.array([point.plan.end, point.cost]), 0.36 * 11.0)


@pytest.mark.deep
def test_fronts_without_points_say_why() -> None:
    figure = studies.trade_figure(spinner(), (Front(0.0, (), "no channel"),))
    check_layout(figure)
    assert not figure.axes
    assert any("H ends where it was \N{EN DASH} none: no channel" in text.get_text() for text, _ in texts(figure))
    missing = Front(0.0, (), "within 40 s H cannot be kept where it is; " + "set limits.horizon to more " * 5)
    figure = studies.trade_figure(BODY, (missing, traded()[1]))
    check_layout(figure)
    said = " ".join(figure.axes[0].get_title(loc="left").split())
    assert said.startswith("H ends where it was \N{EN DASH} none: within 40 s H cannot be kept")
    assert not any("none" in text.get_text() for text, _ in texts(studies.trade_figure(BODY, traded())))


@pytest.mark.weekly
@pytest.mark.parametrize("body", [BODY, spinner(phase=0.0)], ids=["channels", "at once"])
def test_points_that_do_not_meet_the_requirement_are_crossed_out_and_all_have_their_place(body: Spacecraft) -> None:
    body = replace(body, requirement=Requirement(momentum_shift=math.radians(0.05)), dispersions=None)
    both = tradeoff.fronts(body, OptimalOptions(), count=3, shifts=(0.0, math.inf))
    plans = [point for _, _, point in tradeoff.numbered(both)]
    failing = {(point.plan.end, point.cost) for point in plans if point.plan.meets_requirement is False}
    figure = studies.trade_figure(body, both)
    check_layout(figure)
    low, high = figure.axes[0].get_xlim()
    assert all(low < point.plan.pulses.end < high for point in plans)
    if body.channels:
        crossed = line(figure.axes[0], FAILS)
        assert failing == {(end, cost) for end, cost in crossed.tolist()} != set()
    else:
        assert min(point.plan.pulses.end for point in plans) == 0.0


@pytest.mark.deep
@pytest.mark.parametrize(("count", "later", "cheaper"), [(5, 0.4, 0.004), (80, 0.006, 0.0022)])
def test_of_points_close_together_those_are_numbered_that_have_room(count: int, later: float, cheaper: float) -> None:
    """Each nearest to its own number."""
    close = Front(0.0, tuple(traded_point(later * step, 1.0 - cheaper * step) for step in range(count)))
    figure = studies.trade_figure(BODY, (close,))
    check_layout(figure)
    (axes,) = figure.axes
    labels = [one for one in axes.texts if isinstance(one, Annotation)]
    shown = [label for label in labels if label.get_visible()]
    assert len(labels) == count
    assert len(shown) == 5 if count == 5 else 5 < len(shown) < 80
    spots = {label.get_text(): np.asarray(axes.transData.transform(label.xy)) for label in labels}
    for label in shown if count == 5 else ():
        box = label.get_window_extent()
        away = {other: np.hypot(*(np.clip(spot, box.min, box.max) - spot)) for other, spot in spots.items()}
        assert away.pop(label.get_text()) < 0.5 * min(away.values())


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


def codes(fronts: tuple[Front, ...], chosen: Plan) -> list[str]:
    """Codes of the notes on a trade beside a plan."""
    return [note.code for note in trade_notes(fronts, chosen, chosen.verdict)]


def test_a_schedule_that_is_better_is_named_beside_the_recommended_one() -> None:
    """One that costs less, one as cheap a nutation period earlier, one that meets what the plan does not."""
    chosen = compare(EASY, ["two-pulse"])["two-pulse"]
    cheaper = (front_of(EASY, 0.999999, 0.95, 0.9),)
    assert [codes((front_of(EASY, *shares),), chosen) for shares in ((1.0, 1.1), (1.0,))] == [[], []]
    assert codes((), chosen) == []
    late = replace(EASY, limits=replace(EASY.limits, earliest=EASY.nutation_period))
    later = compare(late, ["two-pulse"])["two-pulse"]
    alike = (front_of(EASY, 1.0),)
    whole = front_of(replace(WIDE, requirement=Requirement(nutation=math.radians(1.0))), 1.0)
    failing = half_of(whole)
    plan = failing.points[0].plan
    assert plan.meets_requirement is False
    assert codes((failing,), plan) == []
    pairs = ((cheaper, chosen), (alike, later), ((whole,), plan))
    assert [codes(*pair) for pair in pairs] == [["trade-better"], ["trade-better"], ["trade-meets"]]
    assert next(trade_notes(cheaper, chosen, chosen.verdict)).values["point"] == 3
    check_text(
        "pictures.trade-better", "\n".join(text(note) for pair in pairs for note in trade_notes(*pair, pair[1].verdict))
    )


def test_a_point_that_no_command_block_fires_is_not_to_be_flown() -> None:
    front = front_of(commanded(EASY, np.array([1.0, 0.0, 0.0])), 0.9)
    assert front.points[0].verdict.status is Status.NOT_COMMANDABLE
    assert fails(front.points[0])
    assert codes((front,), compare(EASY, ["two-pulse"])["two-pulse"]) == []
    assert codes((front_of(EASY, 0.9),), compare(EASY, ["two-pulse"])["two-pulse"]) == ["trade-better"]


def test_a_recommended_plan_that_is_not_traded_and_costs_less_is_explained() -> None:
    chosen = planning.plan(replace(WIDE, steerable=Steerable(20.0)), "one-pulse")
    dearer = front_of(WIDE, 1.0)
    share = 0.9 * dearer.points[0].plan.pulses.cost_in("N m s") / chosen.pulses.total_impulse
    pulses = tuple(replace(one, impulse=one.impulse * share, t=one.t + 60.0) for one in chosen.pulses)
    cheap = replace(chosen, schedule=replace(chosen.pulses, pulses=pulses))
    (dear,) = trade_notes((dearer,), cheap, cheap.verdict)
    assert (dear.code, dear.values["point"]) == ("trade-dearer", 1)
    assert dear.values["saved_percent"] == pytest.approx(10.0)
    assert codes((dearer,), dearer.points[0].plan) == []
    little = replace(pulses[0], impulse=1e-3 * pulses[0].impulse)
    cheaper = replace(cheap, schedule=replace(cheap.pulses, pulses=(little,)))
    assert codes((half_of(dearer),), cheaper) == ["trade-dearer"]
    (point,) = half_of(dearer).points
    failing = point._replace(plan=replace(point.plan, spacecraft=replace(WIDE, requirement=Requirement(nutation=1e-6))))
    assert fails(failing)
    assert codes((replace(dearer, points=(failing,)),), cheaper) == [], "it is not compared with what fails"
    # Costs that count as equal are told where they read differently.
    assert codes((front_of(WIDE, 1.0009),), dearer.points[0].plan) == ["trade-alike"]


def test_a_table_says_why_h_ends_beside_where_it_was_and_how_costs_lie_below_their_first_order_least() -> None:
    """The first of two pulses alone shifts H: on a front where H is not to move that is explained."""
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
