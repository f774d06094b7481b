"""Fronts of cost against time, the proof of the least cost; and what is said of them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.text import Annotation
from support.builders import cross, spinner
from support.cases import deep
from support.colours import check_colours
from support.compared_body import BODY, line
from support.golden import check_text
from support.layout import check_layout, texts
from support.shown import WIDE, check_star, legend_words

from nutdamp.common.numerics import down
from nutdamp.common.results import note
from nutdamp.figures import studies
from nutdamp.planning import plan as planning
from nutdamp.planning import tradeoff
from nutdamp.planning.decision import compare
from nutdamp.planning.plan import Plan
from nutdamp.planning.tradeoff import Front, Point, certificate
from nutdamp.schemes.catalogue import OptimalOptions
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Limits, Requirement, Spacecraft
from nutdamp.spacecraft.schedule import Bounds, Schedule
from nutdamp.views.text import cost, sentences, text
from nutdamp.views.trade import fails, front_parts, trade_notes

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
    body = replace(body, requirement=Requirement(momentum_shift=math.radians(0.05)))
    both = tradeoff.fronts(body, OptimalOptions(), count=3, shifts=(0.0, math.inf))
    plans = [point for _, _, point in tradeoff.numbered(both)]
    failing = {(point.plan.end, point.cost) for point in plans if point.plan.meets_requirement is False}
    figure = studies.trade_figure(body, both)
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
    figure = studies.trade_figure(BODY, (close,))
    check_layout(figure, crowded=count > 5)
    assert {str(number) for number in range(1, count + 1)} <= {text.get_text() for text, _ in texts(figure)}
    (axes,) = figure.axes
    joined = [np.asarray(line.get_xydata())[0] for line in axes.lines if line.get_label() == "_leader"]
    named = {label.get_text(): label for label in axes.texts if isinstance(label, Annotation)}
    spots = {name: np.asarray(axes.transData.transform(label.xy)) for name, label in named.items()}
    for name, label in named.items() if count == 5 else ():
        box = label.get_window_extent()
        away = {other: np.hypot(*(np.clip(spot, box.min, box.max) - spot)) for other, spot in spots.items()}
        own = away.pop(name)
        assert own < 0.5 * min(away.values()) or any(np.allclose(label.xy, end) for end in joined), name


@pytest.mark.deep
@pytest.mark.parametrize(("horizon", "torque", "long"), [(120.0, 8.0, False), (400.0, 8.0, False), (120.0, 2.0, True)])
def test_the_envelope_of_the_primer_is_nowhere_below_zero_but_where_a_channel_is_on_for_long(
    horizon: float, torque: float, long: bool
) -> None:
    """It reaches as far as the plan fires, and the firings stand on it."""
    made = planning.plan(spinner(channels=cross(torque), limits=Limits(horizon=horizon)), "optimal")
    figure = studies.certificate_figure(certificate(made))
    check_layout(figure)
    check_colours(figure)
    (axes,) = figure.axes
    envelope, fired = line(axes, "least 1 − q of all channels"), line(axes, "firings of the plan")
    assert made.pulses.end < envelope[-1, 0] <= 2.0 * max(made.pulses.end, made.spacecraft.body_period)
    assert sorted(fired[:, 0]) == pytest.approx([pulse.t for pulse in made.pulses])
    assert bool(envelope[:, 1].min() < -studies.SHALLOW) is long
    assert ("is taken off the bound" in axes.get_title("left")) is long
    assert np.interp(fired[:, 0], *envelope.T) == pytest.approx(fired[:, 1], abs=1e-2)


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
    return [note.code for note in trade_notes(fronts, chosen)]


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
    assert next(trade_notes(*pairs[0])).values["point"] == 3
    check_text("pictures.trade-better", "\n".join(text(note) for pair in pairs for note in trade_notes(*pair)))


def test_a_recommended_plan_that_is_not_traded_and_costs_less_is_explained() -> None:
    chosen = planning.plan(replace(WIDE, steerable=Steerable(20.0)), "one-pulse")
    dearer = front_of(WIDE, 1.0)
    share = 0.9 * dearer.points[0].plan.pulses.cost_in("N m s") / chosen.pulses.total_impulse
    pulses = tuple(replace(one, impulse=one.impulse * share, t=one.t + 60.0) for one in chosen.pulses)
    cheap = replace(chosen, schedule=replace(chosen.pulses, pulses=pulses))
    (dear,) = trade_notes((dearer,), cheap)
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
