"""Figures of trades: every point with its number, marks that are explained, fronts that are missing."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.text import Annotation
from support.builders import cross, spinner
from support.colours import check_colours
from support.compared_body import BODY, compared, line
from support.layout import check_layout, texts

from nutdamp import fronts, planning
from nutdamp.certificate import certificate
from nutdamp.planning import Plan
from nutdamp.presentation import figures
from nutdamp.presentation.figures import style
from nutdamp.presentation.text import cost
from nutdamp.remarks import down
from nutdamp.schedule import Bounds, Schedule
from nutdamp.schemes.options import OptimalOptions
from nutdamp.spacecraft import Limits, Requirement

pytestmark = pytest.mark.usefixtures("plans_shared")


@cache
def traded() -> tuple[fronts.Front, ...]:
    """Two hand-made fronts that begin with one schedule: later ends cost less, and a free H less still."""
    strict = ((0.0, 1.0), (4.0, 0.97), (10.0, 0.95), (20.0, 0.94))
    free = ((0.0, 1.0), (5.0, 0.94), (12.0, 0.91), (22.0, 0.895))
    first = _point(*strict[0])
    return tuple(
        fronts.Front(shift, (first, *(_point(*one) for one in ends[1:])))
        for shift, ends in ((0.0, strict), (math.inf, free))
    )


def _point(later: float, share: float) -> fronts.Point:
    """The two pulses of the compared body, ``later`` s and of a ``share`` of their impulse."""
    made = compared()["two-pulse"]
    pulses = tuple(replace(one, t=one.t + later, impulse=one.impulse * share) for one in made.pulses)
    least = share * made.total_impulse
    schedule = Schedule(pulses, bounds=Bounds(0.99 * least, 0.9 * least, "N m s", 40.0))
    return fronts.Point(replace(made, scheme="optimal", schedule=schedule), 40.0, "N m s")


@pytest.mark.deep
def test_the_trade_numbers_every_point_and_explains_its_marks() -> None:
    figure = figures.trade_figure(BODY, traded())
    check_layout(figure)
    (axes,) = figure.axes
    count = sum(len(front.points) for front in traded())
    named = [int(number) for note in axes.texts for number in note.get_text().split(", ")]
    assert sorted(named) == list(range(1, count + 1))
    words = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"H ends where it was", "H may end anywhere"} <= words
    least = min(point.bounds.rigorous or 0.0 for front in traded() for point in front.points)
    assert f"lower bound of cost, same nutation left: {cost(down(least), 'N m s')}" in words
    first, second = ({(p.plan.end, p.cost) for p in front.points} for front in traded())
    assert first & second, "no point is on both fronts"
    assert "the same schedule, on this front too" in words
    rings = [one for one in axes.lines if one.get_markerfacecolor() == "none" and len(np.asarray(one.get_xdata())) == 1]
    marks = [one for one in axes.lines if one.get_marker() == "o" and len(np.asarray(one.get_xdata()))]
    assert len(rings) >= len(first & second)
    assert all(ring.get_markersize() > mark.get_markersize() for ring in rings for mark in marks)


@pytest.mark.deep
def test_the_recommended_plan_is_marked_among_the_trade() -> None:
    chosen: Plan | None = compared().recommended
    assert chosen is not None
    (axes,) = figures.trade_figure(BODY, traded(), chosen).axes
    assert line(axes, f"recommended: {chosen.scheme}")[0] == pytest.approx([chosen.end, chosen.total_impulse])


@pytest.mark.deep
@pytest.mark.parametrize("front", [0, 1])
def test_no_number_lies_under_the_star_of_the_recommended_plan(front: int) -> None:
    for point in traded()[front].points:
        (axes,) = figures.trade_figure(BODY, traded(), point.plan).axes
        middle = axes.transData.transform((point.plan.end, point.cost))
        radius = 0.45 * style.STAR * axes.figure.dpi / 72.0
        for note in axes.texts:
            box = note.get_window_extent()
            nearest = np.clip(middle, box.min, box.max)
            assert math.dist(nearest, middle) >= 0.8 * radius, note.get_text()


def test_a_trade_without_points_says_why_and_draws_no_axes() -> None:
    figure = figures.trade_figure(spinner(), (fronts.Front(0.0, (), "no channel"),))
    check_layout(figure)
    assert not figure.axes
    assert any("H ends where it was \N{EN DASH} none: no channel" in text.get_text() for text, _ in texts(figure))


def test_a_front_that_is_missing_is_named_above_the_others() -> None:
    (strict, free) = traded()
    missing = fronts.Front(0.0, (), "within 40 s H cannot be kept where it is; " + "set limits.horizon to more " * 5)
    figure = figures.trade_figure(BODY, (missing, free))
    check_layout(figure)
    said = " ".join(figure.axes[0].get_title(loc="left").split())
    assert said.startswith("H ends where it was \N{EN DASH} none: within 40 s H cannot be kept")
    assert not any("none" in text.get_text() for text, _ in texts(figures.trade_figure(BODY, (strict, free))))


@pytest.mark.weekly
def test_points_that_do_not_meet_the_requirement_are_crossed_out() -> None:
    body = replace(BODY, requirement=Requirement(momentum_shift=math.radians(0.05)))
    found = fronts.fronts(body, OptimalOptions(), count=3, shifts=(0.0, math.inf))
    failing = {
        (point.plan.end, point.cost) for _, _, point in fronts.numbered(found) if point.plan.meets_requirement is False
    }
    assert failing
    figure = figures.trade_figure(body, found)
    check_layout(figure)
    crossed = line(figure.axes[0], "does not meet the requirement")
    assert {(end, cost) for end, cost in crossed.tolist()} == failing


def near_each_other(count: int, *, later: float, cheaper: float) -> list[fronts.Point]:
    """Points of which each ends ``later`` s after the one before, and costs so much less."""
    point = traded()[0].points[0]
    close = []
    for step in range(count):
        pulses = tuple(
            replace(one, t=one.t + later * step, impulse=one.impulse * (1.0 - cheaper * step))
            for one in point.plan.pulses
        )
        close.append(point._replace(plan=replace(point.plan, schedule=replace(point.plan.pulses, pulses=pulses))))
    return close


@pytest.mark.weekly
def test_points_close_together_keep_numbers_that_can_be_read() -> None:
    """Eighty schedules of which each costs a little less, a little later."""
    close = near_each_other(80, later=0.006, cheaper=0.0022)
    figure = figures.trade_figure(BODY, (fronts.Front(0.0, tuple(close)),))
    check_layout(figure, crowded=True)
    assert {str(count) for count in range(1, 81)} <= {text.get_text() for text, _ in texts(figure)}


def test_numbers_of_points_close_together_are_nearest_to_their_own_or_joined_to_them() -> None:
    close = near_each_other(5, later=0.4, cheaper=0.004)
    figure = figures.trade_figure(BODY, (fronts.Front(0.0, tuple(close)),))
    check_layout(figure)
    (axes,) = figure.axes
    joined = [np.asarray(line.get_xydata())[0] for line in axes.lines if line.get_label() == "_leader"]
    notes = [note for note in axes.texts if isinstance(note, Annotation)]
    places = {note.get_text(): np.asarray(axes.transData.transform(note.xy)) for note in notes}
    for note in notes:
        box = note.get_window_extent()
        away = {
            name: np.hypot(*np.maximum(np.maximum(box.min - place, place - box.max), 0.0))
            for name, place in places.items()
        }
        own = away.pop(note.get_text())
        assert own < 0.5 * min(away.values()) or any(np.allclose(note.xy, end) for end in joined), note.get_text()


def test_trades_can_be_seen_on_white_and_in_the_dark() -> None:
    check_colours(figures.trade_figure(BODY, traded(), compared().recommended))


def test_a_schedule_that_ends_at_once_has_its_place_on_the_axis_of_time() -> None:
    body = replace(spinner(phase=0.0), requirement=Requirement(momentum_shift=math.radians(0.05)))
    found = fronts.fronts(body, OptimalOptions(), count=3, shifts=(0.0, math.inf))
    ends = [point.plan.pulses.end for _, _, point in fronts.numbered(found)]
    assert min(ends) == 0.0
    figure = figures.trade_figure(body, found)
    check_layout(figure)
    low, high = figure.axes[0].get_xlim()
    assert all(low < end < high for end in ends)


# --- the proof of the least cost -------------------------------------------------------------------------------------


def test_a_plan_that_ends_early_is_drawn_again_where_its_pulses_can_be_told_apart() -> None:
    body = spinner(channels=cross(8.0), limits=Limits(horizon=120.0))
    made = planning.plan(body, "optimal")
    assert 0.0 < made.pulses.end < 60.0
    figure = figures.certificate_figure(certificate(made))
    check_layout(figure)
    *_, closer = figure.axes
    fired = line(closer, "pulses of the plan")
    assert sorted(fired[:, 0]) == pytest.approx([pulse.t for pulse in made.pulses])
    places = closer.transData.transform(fired)
    assert closer.get_window_extent().count_contains(places) == len(places)
    assert np.diff(np.sort(places[:, 0])).min() > 10.0 * figure.dpi / 72.0


def test_curves_of_many_periods_are_drawn_by_their_peaks() -> None:
    """Curves would fill the panel; burns stand on the line of the peaks, which is what they cost."""
    body = spinner(channels=cross(8.0), limits=Limits(horizon=400.0))
    figure = figures.certificate_figure(certificate(planning.plan(body, "optimal")))
    check_layout(figure)
    upper, closer = figure.axes
    assert upper.get_title().endswith("the highest of each period")
    for axes, least in ((upper, 0.85), (closer, -1.1)):
        values = np.concatenate([line(axes, name)[:, 1] for name in ("+1", "-1", "+2", "-2")])
        assert values.max() == pytest.approx(1.0, abs=1e-3)
        assert least < values.min()
        assert (values.min() < 0.0) == (axes is closer)
