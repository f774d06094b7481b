"""What is said of a comparison: why one plan is recommended, what it lacks, what would help."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import places, reference
from support.builders import (
    BOTH,
    HALF_A_DEGREE,
    INFEASIBLE,
    POINTING,
    aimed,
    channel,
    cross,
    judged,
    off_target,
    said,
    spinner,
    warned,
)
from support.cases import spread

import nutdamp
from nutdamp import compliance, planning, schemes
from nutdamp.comparison import compare
from nutdamp.compliance import Part
from nutdamp.hindrance import Hindrance, Obstacle
from nutdamp.planning import Plan
from nutdamp.presentation import verdicts
from nutdamp.recommendation import Standing
from nutdamp.remarks import infeasibility, remarks
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.spacecraft import Disturbance, Goal, Limits, Requirement

EQUAL = "; of those that cost as much within 0.1 %"

# --- the words ------------------------------------------------------------------------------------------------------


def test_reasons_say_what_decided() -> None:
    damped, other = judged("a", 0.0, propellant=0.1), judged("b", 0.0, propellant=0.2)
    assert said(damped) == "the scheme named; it damps"
    assert said(damped, INFEASIBLE) == "the only plan that damps"
    assert said(judged("a", 0.1, required=HALF_A_DEGREE), INFEASIBLE) == "the only plan that meets the requirement"
    assert said(damped, other) == "least propellant of the 2 plans that damp"
    near, nearer = judged("a", 0.0, goal=POINTING), judged("b", 0.0, impulse=2.0, goal=POINTING)
    assert said(near, nearer) == "least impulse of the 2 plans that reach the target"
    assert said(judged("a", 0.0, shift=1.0), judged("b", 0.0)).endswith(f"{EQUAL}, least shift of H")
    assert said(judged("a", 0.0), judged("b", 0.0, end=2.0)).endswith(f"{EQUAL}, it ends first")
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
        (Limits(), (Disturbance(0.5 + 0j),), True, Obstacle.STEADY_TILT, "The disturbances leave a steady tilt of 0."),
        (Limits(tick=0.3), (), False, Obstacle.RESOLUTION, "Rounding to limits.tick can leave up to "),
        (Limits(tick=0.3, max_pulses=5), (), False, Obstacle.RESOLUTION, "Rounding to limits.tick can leave up to "),
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


@pytest.mark.deep
def test_no_scheme_is_said_to_leave_the_least_where_another_leaves_less() -> None:
    """ACE: all of them end on ticks, one leaves least; each names what rounding can leave, which is more."""
    body = nutdamp.load(places.CONFIGS / "ace.yaml")
    compared = compare(body, ("two-pulse", "four-pulse", "optimal"))
    left = {plan.scheme: plan.flight.residual.nutation for plan in compared if plan.feasible}
    assert max(left.values()) > 1.2 * min(left.values())
    for plan in compared:
        assert plan.hindrance.obstacle is Obstacle.RESOLUTION
        assert left[plan.scheme] <= plan.hindrance.rounding
        assert not any("no less" in remark for remark in remarks(plan))


@pytest.mark.parametrize(
    ("tick", "share", "obstacle", "suspected"),
    [
        (0.01, 0.9, Obstacle.RESOLUTION, ("limits.tick",)),
        (0.01, 1.1, Obstacle.LIMITS, ("limits.tick",)),
        (None, 0.9, Obstacle.SCHEME, ()),
        (None, 1.1, Obstacle.SCHEME, ()),
    ],
)
def test_ticks_explain_what_rounding_to_them_can_leave(
    tick: float | None, share: float, obstacle: Obstacle, suspected: tuple[str, ...]
) -> None:
    """8 N m for 0.1 s: 0.04 N m s by the on-time, 0.004 N m s × ω3 by the start, at worst √(1 + 1.5²) of both."""
    body = spinner(channels=cross(8.0), limits=Limits(tick=tick))
    pulse = channel_pulse(body.channels[0], 1.0, 0.1)
    most = math.hypot(1.0, 1.5) * math.hypot(0.04, 0.004 * body.spin) / (body.inertia.C * body.spin)
    found = Hindrance(body, Schedule((pulse,)), aware=False, nutation=share * most)
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


# --- nothing to do --------------------------------------------------------------------------------------------------


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


def test_with_unequal_moments_the_largest_nutation_counts() -> None:
    """By the reference integrator too: it is least at t = 0, and passes 0.3 deg within a period."""
    body = spinner(moments=(125.0, 110.0, 80.0), degrees=0.3, channels=cross(8.0))
    times = np.linspace(0.0, 2.0 * body.body_period, 400)
    start = reference.Motion(body.omega0, np.eye(3))
    path = reference.coast(body.inertia.moments, start, np.zeros(3), times[1:])
    seen = [reference.nutation(body.inertia.moments, motion.rates, 1.0) for motion in path]
    largest = max(seen)
    assert largest > min(seen) * 1.05
    for share, kept in ((1.001, True), (0.999, False)):
        needed = replace(body, requirement=Requirement(nutation=share * largest))
        assert compliance.unaided(needed) is kept
        said = verdicts.needless(compare(needed, ("four-pulse",)))
        assert (said is not None) is kept
        assert said is None or said.startswith(f"the nutation of at most {math.degrees(largest):.4g} deg already")
    easy = replace(body, requirement=Requirement(nutation=1.0))
    assert not compliance.unaided(replace(easy, dissipation=40.0))
    assert not compliance.unaided(replace(easy, goal=Goal(spin=body.spin)))


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


@spread(("A", "C", "degrees", "horizon", "kept"), [(120, 80, 2, 60, False), (120, 80, 2, 2, True)], quick=1)
@spread("turned", [False, True], quick=2)
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


# --- disturbances ---------------------------------------------------------------------------------------------------


def test_planning_with_the_disturbances_is_the_first_cure_where_it_helps() -> None:
    requested = Requirement(nutation=math.radians(0.1), momentum_shift=math.radians(0.01))
    body = spinner(channels=cross(8.0), requirement=requested)
    body = replace(body, disturbances=(Disturbance(0.02 + 0j, rate=-body.spin),))
    compared = compare(body, schemes.CLASSIC)
    (text,) = verdicts.warnings(compared)
    aware = compare(body, schemes.CLASSIC, schemes.Options(with_disturbances=True))
    assert aware.recommended is not None
    assert aware.recommended.meets_requirement
    cure = f"With --with-disturbances {aware.recommended.scheme} meets the requirement."
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
