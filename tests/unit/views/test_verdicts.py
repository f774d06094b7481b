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
from support.golden import check_text

import nutdamp
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import Comparison, compare, infeasibility, remarks
from nutdamp.planning.plan import Plan
from nutdamp.planning.recommendation import Hindrance, Obstacle, Standing
from nutdamp.schemes import catalogue
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Disturbance, Goal, Limits, Requirement, Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.views import verdicts

FIRED = spinner(channels=cross(8.0))
WIDE = Goal(spin=3.0)


def verdict(compared: Comparison) -> str:
    return "\n".join(verdicts.warnings(compared))


def test_reasons_and_warnings_say_what_decided_and_what_is_missed() -> None:
    damped, far = judged("a", 0.0, propellant=0.1), judged("far", 1e-12, shift=3.5, impulse=20.0, required=BOTH)
    firing = replace(far, spacecraft=replace(far.spacecraft, channels=cross(20.0)))
    short = replace(FIRED, limits=Limits(horizon=0.01))
    plans: dict[str, tuple[Plan, ...]] = {
        "one": (damped,),
        "the other infeasible": (damped, INFEASIBLE),
        "required": (judged("a", 0.1, required=HALF_A_DEGREE), INFEASIBLE),
        "less propellant": (damped, judged("b", 0.0, propellant=0.2)),
        "targets": (judged("a", 0.0, goal=POINTING), judged("b", 0.0, impulse=2.0, goal=POINTING)),
        "equal, less shift": (judged("a", 0.0, shift=1.0), judged("b", 0.0)),
        "equal, sooner": (judged("a", 0.0), judged("b", 0.0, end=2.0)),
        "undamped": (judged("a", 3.0), judged("b", 4.0)),
        "undamped, the other infeasible": (judged("a", 3.0), INFEASIBLE),
        "undamped, one": (judged("a", 3.0),),
        "shift missed": (firing,),
        "shift missed, without channels": (far,),
        "shift missed, optimal compared": (firing, replace(INFEASIBLE, scheme="optimal")),
    }
    texts = [f"{name}: {said(*each)}; {warned(*each)}" for name, each in plans.items()]
    bodies = (short, replace(short, goal=Goal(spin=3.1)), spinner(channels=(channel("A", 0.0, 0.0, 8.0),)))
    texts += [verdicts.reason(compare(body, catalogue.CLASSIC)) for body in bodies]
    texts += [verdicts.reason(compare(short, ("optimal",))), verdicts.required(replace(far.spacecraft, goal=WIDE))]
    check_text("verdicts.reasons", "\n".join(texts))
    assert warned(damped) == warned(judged("a", 0.4, required=HALF_A_DEGREE)) == ""  # it complies


def test_no_limit_is_named_that_the_file_does_not_set() -> None:
    body = replace(FIRED, limits=Limits(horizon=0.5))
    bound = Limits(horizon=0.5, gap=0.1, blackout=((0.1, 0.2),))
    bound_body = replace(body, limits=bound, channels=cross(8.0, max_on_time=1.0))
    texts = [infeasibility(planning.plan(each, "two-pulse")) or "" for each in (body, bound_body)]
    check_text("verdicts.limits-named", "\n".join(texts))


def test_a_share_is_never_rounded_to_what_it_is_not() -> None:
    shares = (0.9991, 0.8562, 0.99696, 0.99704, 0.997, 1.0, 0.00004)
    pairs = [*((share, 0.997) for share in shares), (0.99999, 1e-9), (0.99996, 0.9973), (0.9999999, 0.999999)]
    check_text("verdicts.shares", "\n".join(f"{share}: {verdicts.cases_verdict(share, of)}" for share, of in pairs))


TILTING = (Disturbance(0.5 + 0j),)
SINGLE = spinner(channels=(channel("T", 0.0, 1.0, 0.0),), limits=Limits(horizon=7.0))
BALL = replace(
    spinner(100.0, 100.0, channels=(channel("T", 5.0, 5.0, 0.0),), limits=Limits(tick=1e-3)),
    omega0=np.array([-0.2, 0.1, 3.0]),
)
"""In a sphere one channel takes out what it opposes of the nutation, whatever the ticks."""


def cut(limits: Limits, disturbances: tuple[Disturbance, ...] = ()) -> Spacecraft:
    return replace(spinner(channels=cross(8.0, max_on_time=0.6), limits=limits), disturbances=disturbances)


HINDERED: dict[str, tuple[Spacecraft, str]] = {
    "weak": (spinner(channels=cross(0.1, max_on_time=0.5), limits=Limits(horizon=30.0)), "four-pulse"),
    "no shorter": (spinner(channels=cross(8.0, min_on_time=5.0), requirement=Requirement(nutation=1e-4)), "two-pulse"),
    "suspected": (BALL, "four-pulse"),
    "no other limits in the file": (SINGLE, "one-pulse"),
    "dark": (replace(SINGLE, limits=Limits(horizon=7.0, blackout=((0.0, 1.0),))), "one-pulse"),
    "one pulse": (cut(Limits(max_pulses=1)), "four-pulse"),
    "disturbed": (cut(Limits(), TILTING), "four-pulse"),
    "steady tilt": (cut(Limits(), TILTING), "four-pulse"),
    "ticks": (cut(Limits(tick=0.3)), "four-pulse"),
    "ticks, and pulses left": (cut(Limits(tick=0.3, max_pulses=5)), "four-pulse"),
}


def test_what_stands_in_the_way_is_named_and_nothing_else() -> None:
    texts = []
    for name, (body, scheme) in HINDERED.items():
        compared = compare(body, (scheme,), catalogue.Options(with_disturbances=name == "steady tilt"))
        (plan,) = compared.plans
        why = plan.hindrance
        texts += [f"{name}: {why.obstacle}, binding {why.binding}, suspected {why.suspected}", verdict(compared)]
        texts += remarks(plan)
    check_text("verdicts.hindered", "\n".join(texts))


def test_a_blackout_is_not_said_to_limit_what_it_may_not_touch() -> None:
    """It is over before the first pulse: without it the plan is the same, so it must not be called the limit."""
    dark = planning.plan(replace(SINGLE, limits=Limits(horizon=7.0, blackout=((0.0, 0.1),))), "one-pulse")
    assert dark.pulses.end == planning.plan(SINGLE, "one-pulse").pulses.end
    assert (dark.hindrance.binding, dark.hindrance.suspected) == (("limits.horizon",), ("limits.blackout",))


@pytest.mark.deep
def test_no_scheme_is_said_to_leave_the_least_where_another_leaves_less() -> None:
    """ACE: all of them end on ticks, one leaves least; each names what rounding can leave, which is more."""
    compared = compare(nutdamp.load(places.CONFIGS / "ace.yaml"), ("two-pulse", "four-pulse", "optimal"))
    left = {plan.scheme: plan.flight.residual.nutation for plan in compared if plan.feasible}
    assert max(left.values()) > 1.2 * min(left.values())
    for plan in compared:
        assert plan.hindrance.obstacle is Obstacle.RESOLUTION
        assert left[plan.scheme] <= plan.hindrance.rounding
        assert not any("no less" in remark for remark in remarks(plan))


def test_ticks_explain_what_rounding_to_them_can_leave() -> None:
    """8 N m for 0.1 s: 0.04 N m s by the on-time, 0.004 N m s × ω3 by the start, at worst √(1 + 1.5²) of both."""
    for tick, share, obstacle, suspected in (
        (0.01, 0.9, Obstacle.RESOLUTION, ("limits.tick",)),
        (0.01, 1.1, Obstacle.LIMITS, ("limits.tick",)),
        (None, 0.9, Obstacle.SCHEME, ()),
    ):
        body = replace(FIRED, limits=Limits(tick=tick))
        most = math.hypot(1.0, 1.5) * math.hypot(0.04, 0.004 * body.spin) / (body.inertia.C * body.spin)
        made = Schedule((channel_pulse(body.channels[0], 1.0, 0.1),))
        hindrance = Hindrance(body, made, aware=False, nutation=share * most)
        assert (hindrance.obstacle, hindrance.binding, hindrance.suspected) == (obstacle, (), suspected)


def test_the_least_on_time_binds_where_a_pulse_is_no_longer() -> None:
    body = spinner(channels=cross(8.0, min_on_time=0.1))
    for on_time, binding in ((0.1, ("min_on_time",)), (0.11, ())):
        made = Schedule((channel_pulse(body.channels[0], 1.0, 0.5), channel_pulse(body.channels[1], 3.0, on_time)))
        assert Hindrance(body, made, aware=False, nutation=0.01).binding == binding


def test_the_parts_that_are_missed_and_by_how_much() -> None:
    plan = judged("a", 0.6, shift=0.3, required=BOTH, goal=WIDE, spin=4.0)
    assert [bound.part for bound in plan.shortfalls] == [Part.NUTATION, Part.SHIFT, Part.SPIN]
    assert plan.severity == pytest.approx(1.0 / 0.003)
    assert Plan(plan.spacecraft, "x", None, "why").severity == math.inf


def test_with_a_target_the_severity_goes_by_the_distance_from_it() -> None:
    """One pulse takes the nutation out and leaves H 11.7° from its target, having shifted it by 2.1°."""
    body = aimed(replace(FIRED, requirement=Requirement(None, math.radians(1.0))), 10.0, 40.0)
    plan = planning.plan(body, "one-pulse")
    assert plan.flown is not None
    assert plan.severity == pytest.approx(off_target(body, plan.pulses) / math.radians(1.0), rel=1e-9)
    assert plan.flown.momentum_shift < 0.9 * plan.flown.axis_error
    free = replace(plan, spacecraft=replace(body, requirement=None))
    assert free.severity == pytest.approx(off_target(body, plan.pulses), rel=1e-9)


def test_the_severity_of_many_is_that_of_each() -> None:
    body, generator = replace(spinner(requirement=BOTH), goal=WIDE), np.random.default_rng(1)
    nutation, aim = generator.uniform(0.0, 0.02, (2, 50))
    spin = 3.0 + generator.normal(size=50) * 0.003
    many = requirements.severity(body, requirements.Left(nutation, aim, spin))
    for row in range(50):
        alone = requirements.severity(body, requirements.Left(nutation[row], aim[row], spin[row]))
        assert many[row] == alone
        within = nutation[row] <= math.radians(0.5) and aim[row] <= math.radians(0.2)
        assert (alone <= 1.0) == (within and abs(spin[row] / 3.0 - 1.0) <= 1e-3)


def test_where_no_pulse_is_needed_it_says_so() -> None:
    rows: list[tuple[float, Requirement | None, Goal, bool]] = [
        (0.3, HALF_A_DEGREE, Goal(), True),
        (0.6, HALF_A_DEGREE, Goal(), False),
        (0.3, Requirement(momentum_shift=0.01), Goal(), False),  # the nutation is not bounded: it is to be damped
        (0.9e-3, None, Goal(), True),
        (1.1e-3, None, Goal(), False),
        (0.3, HALF_A_DEGREE, POINTING, False),
        (0.3, replace(HALF_A_DEGREE, momentum_shift=0.21), POINTING, True),
        (0.3, HALF_A_DEGREE, Goal(spin=3.1), False),
        (0.3, HALF_A_DEGREE, WIDE, True),
    ]
    texts = []
    for degrees, required, goal, needless in rows:
        body = replace(spinner(degrees=degrees, channels=cross(8.0), requirement=required), goal=goal)
        compared = compare(body, ("four-pulse",))
        text = verdicts.needless(compared)
        assert (text is not None) is needless is verdicts.spoken(compared)["no_pulse_needed"]
        assert (planning.plan(body, "none").standing is Standing.COMPLIES) is needless
        texts += [text] if text else []
    check_text("verdicts.needless", "\n".join(texts))


def test_with_unequal_moments_the_largest_nutation_counts() -> None:
    """By the reference integrator too: it is least at t = 0, and passes 0.3 deg within a period."""
    body = spinner(moments=(125.0, 110.0, 80.0), degrees=0.3, channels=cross(8.0))
    times, start = np.linspace(0.0, 2.0 * body.body_period, 400), reference.Motion(body.omega0, np.eye(3))
    path = reference.coast(body.inertia.moments, start, np.zeros(3), times[1:])
    angles = [reference.nutation(body.inertia.moments, motion.rates, 1.0) for motion in path]
    largest = max(angles)
    assert largest > min(angles) * 1.05
    for share, kept in ((1.001, True), (0.999, False)):
        needed = replace(body, requirement=Requirement(nutation=share * largest))
        assert requirements.unaided(needed) is kept
        text = verdicts.needless(compare(needed, ("four-pulse",)))
        assert (text is not None) is kept
        assert text is None or f"{math.degrees(largest):.4g} deg" in text
    easy = replace(body, requirement=Requirement(nutation=1.0))
    assert not requirements.unaided(replace(easy, dissipation=40.0))
    assert not requirements.unaided(replace(easy, goal=Goal(spin=body.spin)))


def test_what_dissipation_makes_of_it_counts() -> None:
    """0.3 deg grow e-fold in 40 s: past 0.5 deg after 20.4 s."""
    calm = spinner(degrees=0.3, channels=cross(8.0), requirement=HALF_A_DEGREE, limits=Limits(horizon=20.0))
    growing = replace(calm, dissipation=40.0)
    assert growing.growth > 0.0
    assert requirements.unaided(growing)
    assert not requirements.unaided(replace(growing, limits=Limits(horizon=21.0)))
    assert not requirements.unaided(replace(calm, dissipation=0.01))  # e-fold 2,000 times: beyond any float
    check_text("verdicts.needless-growing", verdicts.needless(compare(growing, ("four-pulse",))) or "")
    assert not requirements.unaided(replace(calm, disturbances=TILTING))


@pytest.mark.parametrize(
    ("A", "C", "degrees", "horizon", "kept"),
    [(120.0, 80.0, 2.0, 30.0, False), (120.0, 80.0, 2.0, 2.0, True), (80.0, 120.0, 20.0, 20.0, False)],
)
def test_changes_of_spin_count(A: float, C: float, degrees: float, horizon: float, kept: bool) -> None:
    """H stays, so the spin falls with cos θ: by the reference integrator too, for either shape."""
    body = spinner(A, C, degrees=degrees, requirement=Requirement(nutation=math.radians(30)))
    body = replace(body, dissipation=30.0, goal=WIDE, limits=Limits(horizon=horizon))
    ended = reference.fly(body.inertia.moments, body.omega0, [], horizon, growth=body.growth)
    assert bool(abs(ended.rates[2] - 3.0) <= 3e-3) is kept is requirements.unaided(body)


SHAKEN = replace(FIRED, disturbances=(Disturbance(0.02 + 0j, rate=-FIRED.spin),), limits=Limits(horizon=20.0))
AWARE = catalogue.Options(with_disturbances=True)


def test_planning_with_the_disturbances_is_the_first_cure_where_it_helps() -> None:
    body = replace(SHAKEN, requirement=Requirement(math.radians(0.1), math.radians(0.01)))
    aware = compare(body, ("two-pulse",), AWARE)
    assert aware.recommended is not None
    assert aware.recommended.meets_requirement
    hopeless = replace(body, requirement=Requirement(nutation=math.radians(1e-6)))
    texts = [verdict(compare(each, ("two-pulse",))) for each in (body, hopeless)]
    check_text("verdicts.with-disturbances", "\n".join(texts))


def test_planning_with_disturbances_is_tried_only_where_it_was_not_done() -> None:
    assert compare(FIRED, ("two-pulse",)).with_disturbances is None  # there are none
    assert compare(SHAKEN, ("two-pulse",)).with_disturbances is not None
    assert compare(SHAKEN, ("two-pulse",), AWARE).with_disturbances is None
    nothing_fits = replace(SHAKEN, limits=Limits(horizon=1e-6))
    assert compare(nothing_fits, ("two-pulse",)).with_disturbances is None  # and no recommended plan to compare with
