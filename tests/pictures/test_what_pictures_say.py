"""Captions, legends and notes name what is drawn, and nothing else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from support.builders import cross, spinner
from support.cases import spread
from support.colours import contrast

from nutdamp import dispersion, flight, planning
from nutdamp.comparison import compare
from nutdamp.dispersion.study import Results, run
from nutdamp.fronts import Front, Point
from nutdamp.presentation import figures
from nutdamp.presentation.figures.motion import _together
from nutdamp.presentation.page.document import Prose
from nutdamp.presentation.page.html import block_html
from nutdamp.presentation.page.pictures import dispersion_pictures_of
from nutdamp.presentation.page.scales import LEAD, strip_of
from nutdamp.presentation.trade_tables import ALIKE, BELOW, OFF, apart, beats, fails, front_parts, outdone
from nutdamp.schedule import Bounds, Schedule
from nutdamp.spacecraft import Inertia, Limits, Requirement, Spacecraft, Steerable
from nutdamp.tolerances import Dispersions, Tolerance

pytestmark = pytest.mark.usefixtures("plans_shared")

BODY = spinner(channels=cross(20.0))
SPREAD = Dispersions(A=Tolerance("normal", 0.02, relative=True))


@pytest.mark.deep
@spread("biased", [False, True], quick=1)
@spread("required", [None, Requirement(nutation=0.01), Requirement(nutation=0.01, momentum_shift=0.01)], quick=1)
def test_captions_of_dispersed_cases_name_no_bias_and_no_bound_that_is_not_drawn(
    required: Requirement | None, biased: bool
) -> None:
    offset = Tolerance("bias", 0.01) if biased else None
    body = replace(BODY, requirement=required, dispersions=replace(SPREAD, timing_offset=offset))
    made = dispersion.study_of(body, planning.plan(body, "two-pulse").pulses)
    _, momentum, budget = dispersion_pictures_of(run(Results(made, 50)), "two-pulse")
    assert ("required" in momentum.caption) == (required is not None and required.momentum_shift is not None)
    assert ("bias" in budget.caption) == biased


def test_the_sphere_names_pulses_where_they_move_the_axis() -> None:
    plan = planning.plan(BODY, "two-pulse")
    flights = flight.by_impulses(BODY, plan.pulses), plan.flight
    for flown, named in zip(flights, (False, True), strict=True):
        drawn = figures.flight_figure("sphere", flown, flown.sampled(400, 20.0))
        assert ("pulse" in {text.get_text() for text in drawn.legends[0].get_texts()}) == named


@pytest.mark.parametrize(("moment", "hidden"), [(80.0, False), (1.5, True)])
def test_a_body_cone_under_the_marks_says_how_large_it_is(moment: float, hidden: bool) -> None:
    """The half-angle of the body cone is about C/A of the nutation."""
    body = replace(spinner(), inertia=Inertia((120.0, 120.0, moment)), omega0=np.array([0.003, 0.0, 3.0]))
    flown = flight.flown(body, Schedule(), 20.0)
    drawn = figures.flight_figure("sphere", flown, flown.sampled(400, 20.0))
    (name,) = (text.get_text() for text in drawn.legends[0].get_texts() if "body cone" in text.get_text())
    assert ("under the marks" in name) == hidden


def test_hatching_of_times_that_are_closed_is_seen() -> None:
    body = replace(BODY, limits=Limits(blackout=((0.0, 0.3),), horizon=60.0))
    drawn = figures.flight_figure("timeline", *figures.shown(planning.plan(body, "two-pulse")))
    closed = [bars for bars in drawn.axes[0].collections if bars.get_hatch()]
    assert closed
    for bars in closed:
        (colour,) = np.asarray(bars.get_edgecolor()).tolist()
        assert colour[3] == 1.0
        assert contrast(to_hex(colour), "#ffffff") >= 3.0


def test_options_and_relations_stay_in_one_line() -> None:
    shown = block_html(Prose("report --disperse flies them; < 1e-9 deg is left, a-b breaks"))
    assert '<span class="whole-word">--disperse</span> flies' in shown
    assert '<span class="whole-word">&lt; 1e-9 deg</span> is left, a-b breaks' in shown


@pytest.mark.parametrize("degrees", [0.5, 50.0])
def test_the_moving_view_says_where_the_required_nutation_is(degrees: float) -> None:
    body = replace(BODY, requirement=Requirement(nutation=math.radians(degrees)))
    flown = flight.flown(body, planning.plan(body, "two-pulse").pulses, 20.0)
    strip, (low, high) = strip_of(flown, flown.sampled(200, 20.0), 20.0)
    inside = low < degrees < high
    assert inside == (degrees < 1.0)
    assert (strip.required is not None) == inside
    assert strip.outside == ("" if inside else "50 deg")


def fronts_of(body: Spacecraft, costs: tuple[float, ...]) -> tuple[Front, ...]:
    """A front of one schedule a cost, with H anywhere, all of which end as the plan of two-pulse does."""
    plan = planning.plan(body, "two-pulse")
    spent = plan.pulses.cost_in("N m s")
    made = []
    for share in costs:
        cheaper = [replace(one, impulse=share * one.impulse) for one in plan.pulses]
        pulses = replace(plan.pulses, pulses=tuple(cheaper), bounds=Bounds(spent, None, "N m s", 60.0))
        made.append(Point(replace(plan, schedule=pulses), 42.0, "N m s"))
    return (Front(math.inf, tuple(made)),)


def half_of(fronts: tuple[Front, ...]) -> Front:
    """A front of the first pulse alone of its first point, which leaves nutation and shifts H."""
    (first, *_), point = fronts[0].points[0].plan.pulses, fronts[0].points[0]
    half = replace(point.plan, schedule=replace(point.plan.pulses, pulses=(first,)))
    return replace(fronts[0], points=(point._replace(plan=half),))


def test_a_cheaper_schedule_that_ends_no_later_is_named_beside_the_recommended_one() -> None:
    body = replace(BODY, requirement=Requirement(nutation=math.radians(30.0)))
    chosen = compare(body, ["two-pulse"])["two-pulse"]
    said = beats(fronts_of(body, (0.999999, 0.95, 0.9)), chosen)
    assert said.startswith(
        "point 3 meets the requirement with nominal values too, costs 10 % less than the recommended plan"
    )
    assert "pulses instead of" not in said, "both take two"
    assert said.endswith('--free-axis --set "limits.horizon=42 s".')
    assert beats(fronts_of(body, (1.0, 1.1)), chosen) == ""


def test_a_schedule_as_cheap_that_ends_sooner_is_named_beside_the_recommended_one() -> None:
    """The same two pulses a nutation period earlier."""
    body = replace(BODY, requirement=Requirement(nutation=math.radians(30.0)))
    late = replace(body, limits=replace(body.limits, earliest=body.nutation_period))
    chosen = compare(late, ["two-pulse"])["two-pulse"]
    said = beats(fronts_of(body, (1.0,)), chosen)
    assert said.startswith("point 1 meets the requirement with nominal values too, costs as much as")
    assert "and ends 6.283 s earlier" in said
    headline = "“Time against cost” has a schedule that costs as much as the recommended plan and ends 6.283 s earlier."
    assert outdone(fronts_of(body, (1.0,)), chosen) == headline
    assert outdone((), chosen) == ""
    assert beats(fronts_of(body, (1.0,)), compare(body, ["two-pulse"])["two-pulse"]) == ""


def test_a_schedule_that_meets_the_requirement_is_named_beside_a_plan_that_does_not() -> None:
    """However dear it is, and however late it ends."""
    body = replace(BODY, requirement=Requirement(nutation=math.radians(1.0)))
    (front,) = fronts_of(body, (1.0,))
    (point,) = front.points
    chosen = half_of((front,)).points[0].plan
    assert chosen.meets_requirement is False
    only = "meets the requirement with nominal values, which the recommended plan does not"
    assert outdone((front,), chosen) == f"“Time against cost” has a schedule that {only}."
    assert beats((front,), chosen).startswith(f"point 1 {only} (")
    failing = point._replace(plan=chosen)
    assert outdone((replace(front, points=(failing,)),), chosen) == ""


def test_a_recommended_plan_that_is_not_traded_and_costs_less_is_explained() -> None:
    body = replace(BODY, steerable=Steerable(20.0))
    chosen = planning.plan(body, "one-pulse")
    assert {pulse.channel for pulse in chosen.pulses} == {"steerable"}
    dearer = fronts_of(BODY, (1.0,))
    spent = dearer[0].points[0].plan.pulses.cost_in("N m s")
    cheap = replace(chosen, schedule=replace(chosen.pulses, pulses=tuple(
        replace(one, impulse=one.impulse * 0.9 * spent / chosen.pulses.total_impulse, t=one.t + 60.0)
        for one in chosen.pulses
    )))  # fmt: skip
    said = apart(dearer, cheap)
    assert said.startswith("the recommended plan, by one-pulse, costs 10 % less than point 1, the cheapest of the")
    assert "it fires the steerable torquer, which the schedules of the trade do not" in said
    assert "deg of nutation, they at most" in said
    assert apart(dearer, dearer[0].points[0].plan) == ""
    (point,) = half_of(dearer).points
    little = replace(cheap.pulses.pulses[0], impulse=1e-3 * cheap.pulses.pulses[0].impulse)
    cheaper = replace(cheap, schedule=replace(cheap.pulses, pulses=(little,)))
    assert apart((replace(dearer[0], points=(point,)),), cheaper)
    failing = point._replace(plan=replace(point.plan, spacecraft=replace(BODY, requirement=Requirement(nutation=1e-6))))
    assert fails(failing)
    assert apart((replace(dearer[0], points=(failing,)),), cheaper) == "", "it is not compared with what fails"


def test_costs_that_count_as_equal_are_told_where_they_read_differently() -> None:
    dearer = fronts_of(BODY, (1.0009,))
    chosen = fronts_of(BODY, (1.0,))[0].points[0].plan
    assert apart(dearer, chosen) == ALIKE
    assert apart(fronts_of(BODY, (1.0,)), chosen) == ""


def test_a_table_says_why_h_ends_beside_where_it_was() -> None:
    """The first of two pulses alone shifts H: on a front where H is not to move that is explained."""
    made = fronts_of(BODY, (1.0,))
    shifted, still = (replace(front, shift=0.0) for front in (half_of(made), made[0]))
    for front, told in ((shifted, True), (replace(shifted, shift=math.inf), False), (still, False)):
        texts = [str(part) for part in front_parts(BODY, [front])]
        assert (OFF in texts) == told


@pytest.mark.parametrize(("torque", "model"), [(20.0, "real pulse widths"), (None, "exact motion, ideal impulses")])
def test_titles_speak_of_widths_where_pulses_have_some(torque: float | None, model: str) -> None:
    body = spinner(steerable=Steerable(torque))
    compared = compare(body, ["one-pulse", "two-pulse"])
    assert f"schemes by {model}" in " ".join(figures.schemes_figure(compared).get_suptitle().split())
    flown = compared["two-pulse"].flight
    drawn = figures.flight_figure("timeline", *figures.shown(compared["two-pulse"]))
    assert f"by {model}" in " ".join(drawn.get_suptitle().split())
    assert flown.model == "real pulse widths"


def test_the_moving_view_has_the_times_without_firings() -> None:
    body = replace(BODY, limits=Limits(earliest=2.0, blackout=((5.0, 7.0), (19.0, 25.0)), horizon=60.0))
    flown = flight.flown(body, Schedule(), 20.0)
    strip, _ = strip_of(flown, flown.sampled(200, 20.0), 20.0)
    places = [2000.0 * (LEAD + (1.0 - LEAD) * time / 20.0) for time in (0.0, 2.0, 5.0, 7.0, 19.0, 20.0)]
    for (left, width), begins, ends in zip(strip.closed, places[::2], places[1::2], strict=True):
        assert left == pytest.approx(begins, abs=0.06)
        assert width == pytest.approx(ends - begins, abs=0.06)


def test_pulses_in_one_place_of_a_path_have_one_number() -> None:
    """Three in a row at least, each beside the one before; with more than can be numbered, none are gathered."""
    near, far = np.zeros(2), np.array([1.0, 0.0])
    assert _together([far, near, near, near, far], 2.0) == [[0], [1, 2, 3], [4]]
    assert _together([near, near, far, far], 2.0) == [[0], [1], [2], [3]]
    assert _together([far * 0.09 * step for step in range(4)], 2.0) == [[0, 1, 2, 3]]
    assert all(len(group) == 1 for group in _together([near] * 40, 2.0))


def test_costs_below_their_first_order_least_are_explained() -> None:
    for share, explained in ((0.9, True), (1.1, False)):
        texts = [str(part) for part in front_parts(BODY, fronts_of(BODY, (share,)))]
        assert (BELOW in texts) == explained
