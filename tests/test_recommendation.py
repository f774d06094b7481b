"""The rule of the recommendation, on plans whose figures are given, and what is said of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import reference
from builders import aimed, channel, cross, judged, off_target, spinner
from cases_dir import case

from nutdamp import compliance, flight, planning, schemes
from nutdamp.compliance import Part
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.hindrance import Hindrance, Obstacle
from nutdamp.planning import Comparison, Plan, compare
from nutdamp.presentation import verdicts
from nutdamp.recommendation import Ground, Standing, recommend
from nutdamp.remarks import infeasibility, remarks
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.spacecraft import Disturbance, Goal, Inertia, Limits, Requirement

INFEASIBLE = Plan(spinner(), "infeasible", None, "because")
HALF_A_DEGREE = Requirement(nutation=math.radians(0.5))
BOTH = Requirement(nutation=math.radians(0.5), momentum_shift=math.radians(0.2))
POINTING = Goal(axis=np.array([math.sin(0.2), 0.0, math.cos(0.2)]))
"""A target 0.2 rad = 11.46° from H at t = 0."""

COUNTS = 0.05
"""Degrees that count as damped: 1 % of the 5° of these plans."""


def chosen(*plans: Plan) -> str | None:
    best = recommend(plans).plan
    return None if best is None else best.scheme


def said(*plans: Plan) -> str:
    return verdicts.reason(Comparison(plans[0].spacecraft, plans))


NOTHING_DAMPS = case("nothing-damps.yaml").read_text(encoding="utf-8")


def warned(*plans: Plan) -> str:
    return " ".join(verdicts.warnings(Comparison(plans[0].spacecraft, plans)))


# --- which plan ------------------------------------------------------------------------------------------------------


def test_nothing_feasible_recommends_nothing() -> None:
    found = recommend([INFEASIBLE])
    assert (found.plan, found.standing, found.ground) == (None, None, None)
    assert chosen() is None
    assert said(INFEASIBLE) == "no scheme is feasible"
    assert warned(INFEASIBLE) == ""


def test_infeasible_plans_are_passed_over() -> None:
    assert chosen(INFEASIBLE, judged("a", 3.0)) == "a"


def test_of_those_that_damp_the_least_propellant() -> None:
    """One per cent of the initial 5° is as good as nothing; what leaves more is not considered, however cheap."""
    clean = judged("clean", 1e-12, propellant=0.2)
    assert chosen(judged("thrifty", 0.99 * COUNTS, propellant=0.1), clean) == "thrifty"
    assert chosen(judged("thrifty", 1.01 * COUNTS, propellant=0.1), clean) == "clean"
    assert chosen(judged("thrifty", 4.9, propellant=0.001), clean) == "clean"


def test_below_a_thousandth_of_a_degree_it_counts_as_damped_whatever_the_initial_nutation() -> None:
    def small(one: Plan) -> Plan:
        return replace(one, spacecraft=spinner(degrees=0.02))

    clean = small(judged("clean", 1e-12, propellant=0.2))
    assert chosen(small(judged("thrifty", 0.99e-3, propellant=0.1)), clean) == "thrifty"
    assert chosen(small(judged("thrifty", 1.01e-3, propellant=0.1)), clean) == "clean"


def test_with_a_target_it_must_be_reached_too() -> None:
    there = judged("there", 1e-12, shift=0.11, propellant=0.2, goal=POINTING)  # 1 % of the turn is 0.1146°
    assert chosen(judged("beside", 1e-12, shift=0.12, propellant=0.1, goal=POINTING), there) == "there"
    assert chosen(judged("near", 1e-12, shift=0.114, propellant=0.1, goal=POINTING), there) == "near"


def test_where_nothing_damps_the_least_nutation_whatever_the_cost() -> None:
    """nothing-damps.yaml: the cheapest plan left 98 % of the nutation."""
    plans = [judged("two", 4.9, propellant=4.0), judged("four", 2.5, propellant=81.0), judged("one", 3.7, propellant=4)]
    assert chosen(*plans) == "four"
    found = recommend(plans)
    assert (found.standing, found.ground, found.count) == (Standing.MISSES, Ground.LEFT, 3)


def test_where_nothing_reaches_the_target_the_least_of_distance_and_nutation() -> None:
    plans = [
        judged("straight", 0.0, shift=9.0, goal=POINTING),
        judged("near", 4.0, shift=3.0, goal=POINTING),
        judged("wobbling", 6.0, shift=1.0, goal=POINTING),
    ]
    assert chosen(*plans) == "near"
    assert said(*plans) == "comes nearest to the target of the 3 feasible plans"


def test_plans_that_meet_the_requirement_come_first() -> None:
    """Even if one that does not leaves less nutation for less propellant."""
    drifting = judged("drifting", 0.01, shift=0.3, propellant=0.1, required=BOTH)
    meeting = judged("meeting", 0.4, shift=0.1, propellant=0.5, required=BOTH)
    assert chosen(drifting, meeting) == "meeting"


def test_of_those_that_meet_the_requirement_the_least_propellant() -> None:
    """The requirement says what is enough: 0.4° is, although it does not count as damped."""
    thrifty = judged("thrifty", 0.4, propellant=0.1, required=HALF_A_DEGREE)
    assert chosen(thrifty, judged("clean", 0.0, propellant=0.2, required=HALF_A_DEGREE)) == "thrifty"


def test_what_a_requirement_does_not_bound_must_be_damped() -> None:
    """Firing nothing keeps H best: that is no way to damp."""
    keep = Requirement(momentum_shift=math.radians(0.2))
    idle = judged("idle", 4.9, propellant=0.0, required=keep)
    damping = judged("damping", 0.01, shift=0.1, propellant=0.5, required=keep)
    assert idle.meets_requirement
    assert chosen(idle, damping) == "damping"
    worse = judged("worse", 3.0, shift=0.1, propellant=0.5, required=keep)
    assert chosen(idle, worse) == "worse"
    assert recommend([idle, worse]).standing is Standing.MEETS
    assert "none of the 2 schemes compared damps the nutation" in warned(idle, worse)


def test_if_none_meets_it_the_least_flown_nutation_whatever_the_cost() -> None:
    one = judged("one", 0.7, propellant=0.1, required=HALF_A_DEGREE)
    two = judged("two", 0.6, propellant=9.0, required=HALF_A_DEGREE)
    assert chosen(one, two) == "two"
    assert warned(one, two).startswith(
        "none of the 2 schemes compared meets the requirement. two leaves 0.6 deg of nutation (0.5 deg req"
    )


def test_if_none_meets_it_and_all_damp_the_nearest_to_the_requirement() -> None:
    """Of two that leave no nutation but for rounding, rounding must not decide."""
    far = judged("far", 1e-12, shift=3.5, propellant=0.1, required=BOTH)
    near = judged("near", 5e-12, shift=0.25, propellant=0.2, required=BOTH)
    assert chosen(far, near) == "near"
    assert "near leaves 0.25 deg of shift of H (0.2 deg required)" in warned(far, near)


def test_costs_within_a_thousandth_are_equal() -> None:
    """12.6312 g against 12.6323 g: both print as 12.63 g, and one ends in half the time."""
    late = judged("late", 0.0, shift=1.0, propellant=12.6312, end=28.0)
    early = judged("early", 0.0, shift=1.0, propellant=12.6323, end=15.0)
    assert chosen(late, early) == "early"
    assert recommend([late, early]).ground is Ground.END
    still = judged("still", 0.0, shift=0.5, propellant=12.6330, end=90.0)
    assert chosen(late, early, still) == "still"
    assert recommend([late, early, still]).ground is Ground.SHIFT
    dearer = judged("dearer", 0.0, shift=0.0, propellant=12.6312 * 1.0011, end=1.0)
    assert chosen(late, dearer) == "late"


@pytest.mark.parametrize(
    ("share", "ground", "best"),
    [(1.0005, Ground.END, "early"), (1.002, Ground.COST, "late"), (1.008, Ground.COST, "late")],
)
def test_costs_count_as_equal_within_a_thousandth_and_no_further(share: float, ground: Ground, best: str) -> None:
    late, early = judged("late", 0.0, propellant=1.0, end=9.0), judged("early", 0.0, propellant=share, end=1.0)
    assert recommend([late, early]).ground is ground
    assert chosen(late, early) == best


@pytest.mark.parametrize(
    ("shift", "ground", "best"),
    [
        (0.5e-9, Ground.END, "early"),
        (2e-9, Ground.SHIFT, "late"),
        (1e-6, Ground.SHIFT, "late"),
        (5e-3, Ground.SHIFT, "late"),
    ],
)
def test_shifts_count_as_equal_within_a_nanoradian_and_no_further(shift: float, ground: Ground, best: str) -> None:
    late, early = judged("late", 0.0, end=9.0), judged("early", 0.0, shift=math.degrees(shift), end=1.0)
    assert recommend([late, early]).ground is ground
    assert chosen(late, early) == best


@pytest.mark.parametrize(
    ("required", "nutation", "shift", "ground"),
    [
        (BOTH, 5e-6, 0.2501, Ground.COST),  # 0.04 % more than 0.25° of shift
        (BOTH, 5e-6, 0.251, Ground.NEAREST),
        (Requirement(nutation=math.radians(1e-6)), 5.0005e-6, 0.25, Ground.COST),
        (Requirement(nutation=math.radians(1e-6)), 5.1e-6, 0.25, Ground.NEAREST),  # 1e-7° are no rounding
    ],
)
def test_plans_are_as_near_to_the_requirement_within_a_thousandth(
    required: Requirement, nutation: float, shift: float, ground: Ground
) -> None:
    near = judged("near", 5e-6, shift=0.25, propellant=0.2, required=required)
    cheap = judged("cheap", nutation, shift=shift, propellant=0.1, required=required)
    assert recommend([near, cheap]).ground is ground
    assert chosen(near, cheap) == ("cheap" if ground is Ground.COST else "near")


def test_where_a_propellant_is_not_known_the_impulse_decides() -> None:
    plans = judged("a", 0.0, impulse=3.0, propellant=0.1), judged("b", 0.0, impulse=2.0)
    assert chosen(*plans) == "b"
    assert "least impulse of the 2 plans" in said(*plans)


@pytest.mark.parametrize("degrees", [8, 60])
def test_where_thrusters_are_too_weak_the_plan_that_leaves_least(degrees: int) -> None:
    body = read_spacecraft(NOTHING_DAMPS.replace("8 deg", f"{degrees} deg"), "nothing-damps.yaml")
    compared = compare(body, schemes.CLASSIC)
    left = {one.scheme: one.flown.nutation for one in compared.plans if one.flown is not None}
    assert compared.recommended is not None
    assert compared.recommended.scheme == min(left, key=lambda name: left[name]) == "four-pulse"
    assert verdicts.reason(compared) == "leaves the least residual nutation of the 3 feasible plans"
    (warning,) = verdicts.warnings(compared)
    assert warning.startswith(
        f"none of the 3 schemes compared damps the nutation. four-pulse leaves "
        f"{math.degrees(left['four-pulse']):.4g} deg"
    )
    assert "each as long as max_on_time allows" in warning
    assert warning.endswith(
        "--scheme optimal was not compared; it can fire several pulses of a channel in each half turn."
    )


# --- the spin of the goal --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("spin", "meets"), [(3.0, True), (3.0029, True), (3.0031, False), (2.9969, False)])
@pytest.mark.parametrize("required", [None, HALF_A_DEGREE])
def test_a_spin_is_part_of_the_requirement(required: Requirement | None, spin: float, meets: bool) -> None:
    one = judged("a", 0.0, required=required, goal=Goal(spin=3.0), spin=spin)
    assert one.meets_requirement is meets
    assert (one.standing is Standing.COMPLIES) == meets


def test_a_plan_that_misses_the_spin_comes_after_one_that_does_not() -> None:
    goal = Goal(spin=3.0)
    cheap = judged("cheap", 0.0, propellant=0.1, goal=goal, spin=3.01)
    assert chosen(cheap, judged("right", 0.0, propellant=0.2, goal=goal)) == "right"
    assert "the spin at 28.743 rpm (28.648 rpm required)" in warned(cheap)


def test_a_scheme_that_cannot_set_the_spin_says_so() -> None:
    body = replace(spinner(channels=cross(20.0)), goal=Goal(spin=3.3))
    compared = compare(body, (*schemes.CLASSIC, "half-cone"))
    assert {one.feasible for one in compared.plans} == {False}
    assert all("cannot set the spin" in infeasibility(one) for one in compared.plans)
    assert "optimal" in planning.usual(body)
    assert planning.plan(body, "none").meets_requirement is False
    kept = replace(body, goal=Goal(spin=3.0))
    assert planning.plan(kept, "two-pulse").meets_requirement is True
    assert planning.usual(kept) == (*schemes.CLASSIC, "optimal")


def test_a_spin_that_is_kept_by_itself_takes_no_channel() -> None:
    body = replace(spinner(channels=cross(20.0)), goal=Goal(spin=3.0))
    assert planning.plan(body, "optimal").meets_requirement is True


def test_without_nutation_a_spin_to_set_is_something_to_do() -> None:
    body = replace(spinner(degrees=0.0, channels=cross(20.0)), goal=Goal(spin=3.3))
    assert not planning.plan(body, "four-pulse").feasible
    assert planning.plan(replace(body, goal=Goal(spin=3.0)), "four-pulse").meets_requirement is True


# --- keeping H -------------------------------------------------------------------------------------------------------


def test_a_plan_that_keeps_h_for_little_more_is_mentioned() -> None:
    cheap = judged("cheap", 0.0, shift=1.8, propellant=12.0)
    assert recommend([cheap, judged("still", 0.0, shift=0.35, propellant=13.1)]).steadier is not None
    for shift, propellant in ((0.37, 13.1), (0.35, 13.3)):
        assert recommend([cheap, judged("still", 0.0, shift=shift, propellant=propellant)]).steadier is None
    compared = Comparison(cheap.spacecraft, (cheap, judged("still", 0.0, shift=0.01, propellant=12.8)))
    assert verdicts.hints(compared) == (
        "still shifts H by 0.01 deg instead of 1.8 deg, for 800 g more propellant (6.7 %).",
    )


def test_of_plans_that_keep_h_for_little_more_the_cheapest_is_mentioned() -> None:
    best = judged("best", 0.0, shift=1.0, propellant=0.1)
    dear, cheap = (judged(name, 0.0, shift=0.1, propellant=cost) for name, cost in (("dear", 0.108), ("cheap", 0.105)))
    for plans in ((best, dear, cheap), (best, cheap, dear)):
        assert recommend(plans).steadier is cheap


def test_a_plan_of_half_the_pulses_for_little_more_is_mentioned() -> None:
    many = judged("many", 0.0, propellant=0.1, pulses=10)
    few = judged("few", 0.0, propellant=0.1049, pulses=5)
    found = Comparison(many.spacecraft, (many, few))
    assert found.recommended is many
    assert verdicts.hints(found) == ("few takes 5 pulses instead of 10, for 4.9 g more propellant (4.9 %).",)
    for pulses, propellant in ((6, 0.1049), (5, 0.1051)):
        other = judged("few", 0.0, propellant=propellant, pulses=pulses)
        assert recommend([many, other]).simpler is None
    single = judged("single", 0.0, propellant=0.101, pulses=1)
    assert recommend([many, few, single]).simpler is single
    both = judged("both", 0.0, shift=0.01, propellant=0.104, pulses=1)
    (hint,) = verdicts.hints(
        Comparison(many.spacecraft, (judged("many", 0.0, shift=1.0, propellant=0.1, pulses=2), both))
    )
    assert hint.startswith("both shifts H by 0.01 deg instead of 1 deg and takes 1 pulse instead of 2, for 4 g more")
    nothing = judged("a", 0.0, pulses=0), judged("b", 0.0, pulses=0)
    assert recommend(nothing).simpler is None


def test_only_a_plan_that_damps_as_well_is_mentioned() -> None:
    cheap = judged("cheap", 0.0, shift=1.8, propellant=12.0)
    assert recommend([cheap, judged("idle", 4.0, shift=0.0, propellant=12.5)]).steadier is None
    wandering = judged("cheap", 0.0, shift=0.11, propellant=12.0, goal=POINTING)
    pointing = judged("still", 0.0, shift=0.0, propellant=12.5, goal=POINTING)
    assert recommend([wandering, pointing]).steadier is None  # with a target H shall not stay


# --- the words -------------------------------------------------------------------------------------------------------


def test_reasons_say_what_decided() -> None:
    damped, other = judged("a", 0.0, propellant=0.1), judged("b", 0.0, propellant=0.2)
    assert said(damped) == "the scheme named; it damps"
    assert said(damped, INFEASIBLE) == "the only plan that damps"
    assert said(judged("a", 0.1, required=HALF_A_DEGREE), INFEASIBLE) == "the only plan that meets the requirement"
    assert said(damped, other) == "least propellant of the 2 plans that damp"
    near, nearer = judged("a", 0.0, goal=POINTING), judged("b", 0.0, impulse=2.0, goal=POINTING)
    assert said(near, nearer) == "least impulse of the 2 plans that reach the target"
    assert said(judged("a", 0.0, shift=1.0), judged("b", 0.0)).endswith("within 0.1 %; of these least shift of H")
    assert said(judged("a", 0.0), judged("b", 0.0, end=2.0)).endswith("within 0.1 %; of these it ends first")
    assert said(judged("a", 3.0), judged("b", 4.0)) == "leaves the least residual nutation of the 2 feasible plans"
    assert said(judged("a", 3.0), INFEASIBLE) == "the only feasible plan"
    assert said(judged("a", 3.0)) == "the scheme named"


def test_a_plan_that_complies_needs_no_warning() -> None:
    assert warned(judged("a", 0.0)) == ""
    assert warned(judged("a", 0.4, required=HALF_A_DEGREE)) == ""


def test_the_warning_says_how_far_the_pulses_come() -> None:
    weak = spinner(channels=cross(0.1, max_on_time=0.5), limits=Limits(horizon=30.0))
    compared = compare(weak, ("four-pulse",))
    (text,) = verdicts.warnings(compared)
    made = compared.plans[0]
    assert made.hindrance.obstacle is Obstacle.LIMITS
    assert text.startswith("four-pulse does not damp the nutation. It leaves ")
    assert "(0.05 deg would count as damped)" in text
    given = made.pulses.total_impulse
    assert f"Its {len(made.pulses)} pulses give {given:.4g} N m s, each as long as max_on_time allows; " in text
    assert "damping takes 21 N m s" in text
    assert f"The last one ends at {made.pulses.end:.3f} s of a horizon of 30 s." in text
    assert made.hindrance.binding == ("max_on_time", "limits.horizon")
    assert any("four-pulse is limited by max_on_time and limits.horizon" in remark for remark in remarks(made))


def test_pulses_that_may_not_be_shorter_are_named() -> None:
    body = spinner(channels=cross(8.0, min_on_time=5.0), requirement=Requirement(nutation=1e-4))
    compared = compare(body, ("two-pulse",))
    (made,) = compared.plans
    assert made.hindrance.binding == ("min_on_time",)
    assert any("two-pulse is limited by min_on_time" in remark for remark in remarks(made))
    assert "and min_on_time allows no shorter ones; damping takes 21 N m s." in verdicts.warnings(compared)[0]


def test_a_limit_that_may_not_be_what_ends_it_is_no_more_than_suspected() -> None:
    """In a sphere one channel takes out what it opposes of the nutation, whatever the ticks."""
    body = spinner(100.0, 100.0, channels=(channel("T", 5.0, 5.0, 0.0),), limits=Limits(tick=1e-3))
    body = replace(body, omega0=np.array([-0.2, 0.1, 3.0]))
    made = planning.plan(body, "four-pulse")
    assert made.hindrance.binding == ()
    assert made.hindrance.suspected == ("limits.tick",)
    assert any("four-pulse may be limited by limits.tick" in remark for remark in remarks(made))


def test_where_nothing_is_feasible_what_was_not_compared_is_named() -> None:
    body = spinner(channels=cross(8.0), limits=Limits(horizon=0.01))
    assert verdicts.reason(compare(body, schemes.CLASSIC)).endswith("feasible; --scheme optimal was not compared")
    assert verdicts.reason(compare(body, ("optimal",))) == "no scheme is feasible"
    assert verdicts.reason(compare(replace(body, goal=Goal(spin=3.1)), schemes.CLASSIC)) == "no scheme is feasible"


def test_no_limit_is_named_that_the_file_does_not_set() -> None:
    body = spinner(channels=cross(8.0), limits=Limits(horizon=0.5))
    assert infeasibility(planning.plan(body, "two-pulse")).endswith("nutation within the horizon of 0.5 s")
    bound = replace(
        body, limits=Limits(horizon=0.5, gap=0.1, blackout=((0.1, 0.2),)), channels=cross(8.0, max_on_time=1.0)
    )
    assert infeasibility(planning.plan(bound, "two-pulse")).endswith(
        "within the horizon of 0.5 s, on-times, gap and blackout windows"
    )


def test_what_cannot_fire_optimal_either_is_not_sent_there() -> None:
    axial = spinner(channels=(channel("A", 0.0, 0.0, 8.0),))
    assert verdicts.reason(compare(axial, schemes.CLASSIC)) == "no scheme is feasible"


def test_three_things_required_are_listed_as_in_a_sentence() -> None:
    body = replace(spinner(requirement=BOTH), goal=Goal(spin=3.0))
    listed = "nutation within 0.5 deg, shift of H within 0.2 deg and spin within 0.1 % of 28.648 rpm"
    assert verdicts.required(body) == listed


def test_what_binds_is_named_and_nothing_else() -> None:
    """A file without on-times and blackout windows: neither can be what stands in the way."""
    single = spinner(channels=(channel("T", 0.0, 1.0, 0.0),), limits=Limits(horizon=7.0))
    made = planning.plan(single, "one-pulse")
    assert made.hindrance.obstacle is Obstacle.SCHEME or made.hindrance.binding == ("limits.horizon",)
    assert not any("max_on_time" in remark or "blackout" in remark for remark in remarks(made))
    dark = replace(single, limits=Limits(horizon=7.0, blackout=((0.0, 1.0),)))
    found = planning.plan(dark, "one-pulse").hindrance
    assert found.binding == ("limits.horizon",)
    assert found.suspected == ("limits.blackout",)


def test_a_blackout_is_not_said_to_limit_what_it_may_not_touch() -> None:
    """It is over before the first pulse: without it the plan is the same, so it must not be called the limit."""
    single = spinner(channels=(channel("T", 0.0, 1.0, 0.0),), limits=Limits(horizon=7.0, blackout=((0.0, 0.1),)))
    made = planning.plan(single, "one-pulse")
    free = planning.plan(replace(single, limits=Limits(horizon=7.0)), "one-pulse")
    assert made.pulses.end == free.pulses.end
    assert any(
        remark.endswith("one-pulse is limited by limits.horizon, and may be limited by limits.blackout")
        for remark in remarks(made)
    )


@pytest.mark.parametrize(
    ("limits", "disturbances", "planned", "obstacle", "text"),
    [
        (Limits(max_pulses=1), (), False, Obstacle.MAX_PULSES, "limits.max_pulses = 1 allows no more pulses."),
        (Limits(), (Disturbance(0.5 + 0j),), False, Obstacle.UNPLANNED_DISTURBANCES, "--with-disturbances plans with"),
        (Limits(), (Disturbance(0.5 + 0j),), True, Obstacle.STEADY_TILT, "Under the disturbances a steady tilt of 0."),
        (Limits(tick=0.3), (), False, Obstacle.RESOLUTION, "limits.tick and the shortest on-times allow no less."),
    ],
)
def test_the_warning_names_what_stands_in_the_way(
    limits: Limits, disturbances: tuple[Disturbance, ...], planned: bool, obstacle: Obstacle, text: str
) -> None:
    body = spinner(channels=cross(8.0, max_on_time=0.6), limits=limits)
    options = schemes.Options(with_disturbances=planned)
    compared = compare(replace(body, disturbances=disturbances), ("four-pulse",), options)
    assert compared.plans[0].hindrance.obstacle is obstacle
    assert text in verdicts.warnings(compared)[0]


@pytest.mark.parametrize(
    ("tick", "share", "obstacle", "suspected"),
    [
        (0.01, 0.09, Obstacle.RESOLUTION, ("limits.tick",)),
        (0.01, 0.11, Obstacle.LIMITS, ("limits.tick",)),
        (None, 0.09, Obstacle.SCHEME, ()),
        (None, 0.11, Obstacle.SCHEME, ()),
    ],
)
def test_ticks_explain_what_is_left_up_to_a_tenth(
    tick: float | None, share: float, obstacle: Obstacle, suspected: tuple[str, ...]
) -> None:
    body = spinner(channels=cross(8.0), limits=Limits(tick=tick))
    pulse = channel_pulse(body.channels[0], 1.0, 0.1)
    found = Hindrance(body, Schedule((pulse,)), aware=False, nutation=share * body.nutation)
    assert found.obstacle is obstacle
    assert found.binding == ()
    assert found.suspected == suspected


def test_the_least_on_time_binds_where_a_pulse_is_no_longer() -> None:
    body = spinner(channels=cross(8.0, min_on_time=0.1))
    for on_time, binding in ((0.1, ("min_on_time",)), (0.11, ())):
        made = Schedule((channel_pulse(body.channels[0], 1.0, 0.5), channel_pulse(body.channels[1], 3.0, on_time)))
        assert Hindrance(body, made, aware=False, nutation=0.01).binding == binding


def test_a_scheme_that_was_not_compared_is_named_where_it_may_help() -> None:
    far = judged("far", 1e-12, shift=3.5, impulse=20.0, required=BOTH)
    firing = replace(far, spacecraft=replace(far.spacecraft, channels=cross(20.0)))
    said = "--scheme optimal was not compared; it may reach more."
    assert said in warned(firing)
    assert said not in warned(far)  # without channels it cannot
    assert said not in warned(firing, replace(INFEASIBLE, scheme="optimal"))


def test_the_parts_that_are_missed() -> None:
    one = judged("a", 0.6, shift=0.3, required=BOTH, goal=Goal(spin=3.0), spin=4.0)
    assert [bound.part for bound in one.shortfalls] == [Part.NUTATION, Part.SHIFT, Part.SPIN]
    assert one.severity == pytest.approx(1.0 / 0.003)
    assert Plan(one.spacecraft, "x", None, "why").severity == math.inf


def test_with_a_target_the_severity_goes_by_the_distance_from_it() -> None:
    """One pulse takes the nutation out and leaves H 11.7° from its target, having shifted it by 2.1°."""
    body = aimed(spinner(channels=cross(8.0), requirement=Requirement(None, math.radians(1.0))), 10.0, 40.0)
    made = planning.plan(body, "one-pulse")
    assert made.flown is not None
    assert made.severity == pytest.approx(off_target(body, made.pulses) / math.radians(1.0), rel=1e-9)
    assert made.flown.momentum_shift < 0.9 * made.flown.axis_error
    free = replace(body, requirement=None)
    assert replace(made, spacecraft=free).severity == pytest.approx(off_target(body, made.pulses), rel=1e-9)


def test_the_severity_of_many_is_that_of_each() -> None:
    body = replace(spinner(requirement=BOTH), goal=Goal(spin=3.0))
    generator = np.random.default_rng(1)
    nutation, aim = generator.uniform(0.0, 0.02, (2, 50))
    spin = 3.0 + generator.normal(size=50) * 0.003
    found = compliance.severity(body, compliance.Left(nutation, aim, spin))
    for row in range(50):
        alone = compliance.severity(body, compliance.Left(nutation[row], aim[row], spin[row]))
        assert found[row] == alone
        within = nutation[row] <= math.radians(0.5) and aim[row] <= math.radians(0.2)
        assert (alone <= 1.0) == (within and abs(spin[row] / 3.0 - 1.0) <= 1e-3)


@pytest.mark.parametrize(
    ("share", "required", "text"),
    [
        (0.9991, 0.997, "met: 99.9 % of cases comply (99.7 % required)"),
        (0.8562, 0.997, "NOT met: 85.6 % of cases comply (99.7 % required)"),
        (0.99696, 0.997, "NOT met: 99.696 % of cases comply (99.7 % required)"),
        (0.99704, 0.997, "met: 99.704 % of cases comply (99.7 % required)"),
        (0.997, 0.997, "met: 99.7 % of cases comply (99.7 % required)"),
        (0.99999, 1e-9, "met: 99.999 % of cases comply (1e-07 % required)"),
        (0.99996, 0.9973, "met: 99.996 % of cases comply (99.73 % required)"),
        (1.0, 0.997, "met: 100.0 % of cases comply (99.7 % required)"),
        (0.0, 0.5, "NOT met: 0.0 % of cases comply (50 % required)"),
        (0.00004, 0.5, "NOT met: 0.004 % of cases comply (50 % required)"),
        (0.9999999, 0.999999, "met: 99.99999 % of cases comply (99.9999 % required)"),
    ],
)
def test_a_share_is_never_rounded_to_what_it_is_not(share: float, required: float, text: str) -> None:
    assert verdicts.cases_verdict(share, required) == text


# --- nothing to do ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("degrees", "required", "goal", "said"),
    [
        (0.3, HALF_A_DEGREE, None, "0.3 deg at t = 0 already meets the requirement (nutation within 0.5 deg)"),
        (0.6, HALF_A_DEGREE, None, None),
        (0.3, Requirement(momentum_shift=0.01), None, None),  # the nutation is not bounded: it is to be damped
        (0.9e-3, None, None, "the nutation of 0.0009 deg at t = 0 already counts as damped"),
        (1.1e-3, None, None, None),
        (0.3, HALF_A_DEGREE, POINTING, None),
        (0.3, replace(HALF_A_DEGREE, momentum_shift=0.21), POINTING, "already meet the requirement"),
        (0.3, HALF_A_DEGREE, Goal(spin=3.1), None),
        (0.3, HALF_A_DEGREE, Goal(spin=3.0), "spin within 0.1 % of 28.648 rpm"),
    ],
)
def test_where_no_pulse_is_needed_it_says_so(
    degrees: float, required: Requirement | None, goal: Goal | None, said: str | None
) -> None:
    body = replace(spinner(degrees=degrees, channels=cross(8.0), requirement=required), goal=goal or Goal())
    compared = compare(body, ("four-pulse",))
    text = verdicts.needless(compared)
    assert (text is None) == (said is None)
    assert said is None or (text is not None and said in text)
    assert verdicts.spoken(compared)["no_pulse_needed"] is (said is not None)
    assert (planning.plan(body, "none").standing is Standing.COMPLIES) == (said is not None)


def test_what_dissipation_makes_of_it_counts() -> None:
    """0.3 deg grow e-fold in 40 s: past 0.5 deg after 20.4 s."""
    calm = spinner(degrees=0.3, channels=cross(8.0), requirement=HALF_A_DEGREE, limits=Limits(horizon=20.0))
    growing = replace(calm, dissipation=40.0)
    assert growing.growth > 0.0
    assert compliance.unaided(growing)
    assert not compliance.unaided(replace(growing, limits=Limits(horizon=21.0)))
    assert not compliance.unaided(replace(calm, dissipation=0.01))  # e-fold 2,000 times: beyond any float
    assert "up to the horizon of 20 s too" in (verdicts.needless(compare(growing, ("four-pulse",))) or "")
    assert not compliance.unaided(replace(calm, disturbances=(Disturbance(0.5 + 0j),)))
    # Nutation and spin of unequal moments run to and fro: what they are at t = 0 says too little.
    assert not compliance.unaided(replace(calm, inertia=Inertia((122.0, 118.0, 80.0))))


@pytest.mark.parametrize(("A", "C", "degrees", "horizon", "kept"), [(120, 80, 2, 60, False), (120, 80, 2, 2, True)])
@pytest.mark.parametrize("turned", [False, True])
def test_the_spin_that_dissipation_changes_counts(
    A: float, C: float, degrees: float, horizon: float, kept: bool, turned: bool
) -> None:
    """H stays, so the spin falls with cos θ: by the reference integrator too, for either shape."""
    if turned:
        A, C, degrees = C, A, 10 * degrees
        kept = False
    body = spinner(A, C, degrees=degrees, requirement=Requirement(nutation=math.radians(30)))
    body = replace(body, dissipation=30.0, goal=Goal(spin=3.0), limits=Limits(horizon=horizon))
    ended = reference.fly(body.inertia.moments, body.omega0, [], horizon, growth=body.growth)
    assert (abs(ended.rates[2] - 3.0) <= 3e-3) == kept
    assert compliance.unaided(body) == kept


# --- rounding does not decide ----------------------------------------------------------------------------------------


def test_of_plans_that_leave_nothing_but_rounding_the_cheapest() -> None:
    """Where nothing meets a requirement below what a flight resolves, and where another part of it is missed."""
    tiny = Requirement(nutation=math.radians(1e-13))
    noisy = judged("noisy", 2e-12, propellant=0.1, required=tiny)
    quiet = judged("quiet", 3e-13, propellant=0.2, required=tiny)
    assert chosen(quiet, noisy) == "noisy"
    assert recommend([quiet, noisy]).ground is Ground.COST
    assert said(quiet, noisy).endswith("feasible plans, within 0.001 deg; of these least propellant")
    shifting = Requirement(nutation=math.radians(1e-13), momentum_shift=math.radians(0.1))
    dear = judged("dear", 1e-13, shift=0.3, propellant=0.2, required=shifting)
    assert chosen(dear, judged("cheap", 0.0, shift=0.3, propellant=0.1, required=shifting)) == "cheap"


def test_what_was_nearest_to_the_requirement_does_not_claim_least_nutation() -> None:
    far = judged("far", 1e-12, shift=3.5, propellant=0.1, required=BOTH)
    near = judged("near", 5e-12, shift=0.25, propellant=0.2, required=BOTH)
    assert said(far, near) == "comes nearest to the requirement of the 2 feasible plans"


# --- disturbances ----------------------------------------------------------------------------------------------------


def test_planning_with_the_disturbances_is_the_first_cure_where_it_helps() -> None:
    requested = Requirement(nutation=math.radians(0.1), momentum_shift=math.radians(0.01))
    body = spinner(channels=cross(8.0), requirement=requested)
    body = replace(body, disturbances=(Disturbance(0.02 + 0j, rate=-body.spin),))
    compared = compare(body, schemes.CLASSIC)
    (text,) = verdicts.warnings(compared)
    aware = compare(body, schemes.CLASSIC, schemes.Options(with_disturbances=True))
    assert aware.recommended is not None
    assert aware.recommended.meets_requirement
    cure = f"--with-disturbances is the cure: {aware.recommended.scheme} then meets the requirement."
    assert text.index(cure) < text.index("--scheme optimal")
    hopeless = replace(body, requirement=Requirement(nutation=math.radians(1e-6)))
    (text,) = verdicts.warnings(compare(hopeless, schemes.CLASSIC))
    assert "plans with them, but then too no scheme compared meets the requirement." in text


def test_planning_with_disturbances_is_tried_only_where_it_was_not_done() -> None:
    body = spinner(channels=cross(8.0))
    assert compare(body, schemes.CLASSIC).with_disturbances is None  # there are none
    disturbed = replace(body, disturbances=(Disturbance(0.02 + 0j, rate=-body.spin),))
    assert compare(disturbed, schemes.CLASSIC).with_disturbances is not None
    aware = schemes.Options(with_disturbances=True)
    assert compare(disturbed, schemes.CLASSIC, aware).with_disturbances is None
    nothing_fits = replace(disturbed, limits=Limits(horizon=1e-6))
    assert compare(nothing_fits, schemes.CLASSIC).with_disturbances is None  # and no recommended plan to compare with


# --- a scheme with a bug ---------------------------------------------------------------------------------------------


def test_a_bug_of_one_scheme_leaves_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    from nutdamp.schemes import two_pulse

    def broken(*_: object) -> Schedule:
        raise ZeroDivisionError("float division by zero")

    body = spinner(channels=cross(20.0))
    whole = compare(body, schemes.CLASSIC)
    monkeypatch.setattr(two_pulse, "schedule", broken)
    compared = compare(body, schemes.CLASSIC)
    (failed,) = compared.failed
    assert failed.scheme == "two-pulse"
    assert infeasibility(failed) == "internal error, please report: ZeroDivisionError"
    assert isinstance(failed.failure, ZeroDivisionError)
    for one, other in zip(compared.plans, whole.plans, strict=True):
        assert one.scheme == "two-pulse" or one.pulses.total_impulse == other.pulses.total_impulse
    assert compared.recommended is not None


def test_a_bug_that_shows_when_the_plan_is_judged_counts_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> object:
        raise IndexError("list index out of range")

    monkeypatch.setattr(flight, "momentum_gained", broken)
    jet = channel("T", 0.0, 8.0, 0.0, isp=220.0, thrust=10.0, force=(10.0, 0.0, 0.0))
    compared = compare(spinner(channels=(jet,), mass=100.0), ("one-pulse",))
    assert [infeasibility(one) for one in compared.failed] == ["internal error, please report: IndexError"]
    assert compared.recommended is None


def test_what_a_user_can_cure_is_no_bug() -> None:
    with pytest.raises(KeyError):
        compare(spinner(), ("two-pulse", "five-pulse"))
