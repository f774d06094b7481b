"""Notes on plans and comparisons: reasons, what is missed and what stands in the way, cures."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support import places
from support.builders import (
    BOTH,
    HALF_A_DEGREE,
    INFEASIBLE,
    POINTING,
    channel,
    codes,
    cross,
    judged,
    noted,
    recommended,
    spinner,
)
from support.golden import check_text

import nutdamp
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import Comparison, compare
from nutdamp.planning.notes import comparison_warnings, hindrances, plan_notes, reasons, remaining
from nutdamp.planning.plan import Plan
from nutdamp.schemes import catalogue
from nutdamp.spacecraft.model import Disturbance, Goal, Limits, Requirement, Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

FIRED = spinner(channels=cross(8.0))


def test_reasons_and_warnings_are_of_what_decided_and_what_is_missed() -> None:
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
    texts = [recommended(name, Comparison(each[0].spacecraft, each)) for name, each in plans.items()]
    bodies = (short, replace(short, goal=Goal(spin=3.1)), spinner(channels=(channel("A", 0.0, 0.0, 8.0),)))
    texts += [noted(reasons(compare(body, catalogue.CLASSIC))) for body in bodies]
    texts += [noted(reasons(compare(short, ("optimal",))))]
    check_text("notes.reasons", "\n".join(texts))
    for plan in (damped, judged("a", 0.4, required=HALF_A_DEGREE)):  # they comply
        assert not [*comparison_warnings(Comparison(plan.spacecraft, (plan,)))]


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
        certain, possible = hindrances(plan)
        texts += [f"{name}: {remaining(plan).code}, binding {certain}, suspected {possible}"]
        texts += [noted((*comparison_warnings(compared), *plan_notes(plan)))]
    check_text("notes.hindered", "\n".join(texts))


def test_a_blackout_is_not_said_to_limit_what_it_may_not_touch() -> None:
    """It is over before the first pulse: without it the plan is the same, so it must not be called the limit."""
    dark = planning.plan(replace(SINGLE, limits=Limits(horizon=7.0, blackout=((0.0, 0.1),))), "one-pulse")
    assert dark.pulses.end == planning.plan(SINGLE, "one-pulse").pulses.end
    assert hindrances(dark) == (("limits.horizon",), ("limits.blackout",))


@pytest.mark.deep
def test_no_scheme_is_said_to_leave_the_least_where_another_leaves_less() -> None:
    """ACE: all of them end on ticks, one leaves least; each names what rounding can leave, which is more."""
    compared = compare(nutdamp.load(places.CONFIGS / "ace.yaml"), ("two-pulse", "four-pulse", "optimal"))
    left = {plan.scheme: plan.flight.residual.nutation for plan in compared if plan.feasible}
    assert max(left.values()) > 1.2 * min(left.values())
    for plan in compared:
        assert remaining(plan).code == "remains-rounding"
        assert math.degrees(left[plan.scheme]) <= float(remaining(plan).values["rounding_deg"] or 0.0)
        assert "remains-rounding" in codes(plan_notes(plan))


def test_ticks_explain_what_rounding_to_them_can_leave() -> None:
    """8 N m for 0.1 s: 0.04 N m s by the on-time, 0.004 N m s × ω3 by the start, at worst √(1 + 1.5²) of both."""
    for tick, share, obstacle, suspected in (
        (0.01, 0.9, "remains-rounding", ("limits.tick",)),
        (0.01, 1.1, "remains-limits", ("limits.tick",)),
        (None, 0.9, "remains-scheme", ()),
    ):
        body = replace(FIRED, limits=Limits(tick=tick))
        most = math.hypot(1.0, 1.5) * math.hypot(0.04, 0.004 * body.spin) / (body.inertia.C * body.spin)
        made = Schedule((channel_pulse(body.channels[0], 1.0, 0.1),))
        plan = Plan(body, "four-pulse", made)
        left = replace(plan.flight.residual, nutation=share * most)
        vars(plan)["flight"] = SimpleNamespace(residual=left)
        assert (remaining(plan).code, hindrances(plan)) == (obstacle, ((), suspected))


def test_the_least_on_time_binds_where_a_pulse_is_no_longer() -> None:
    body = spinner(channels=cross(8.0, min_on_time=0.1))
    for on_time, binding in ((0.1, ("min_on_time",)), (0.11, ())):
        made = Schedule((channel_pulse(body.channels[0], 1.0, 0.5), channel_pulse(body.channels[1], 3.0, on_time)))
        assert hindrances(Plan(body, "four-pulse", made))[0] == binding


SHAKEN = replace(FIRED, disturbances=(Disturbance(0.02 + 0j, rate=-FIRED.spin),), limits=Limits(horizon=20.0))
AWARE = catalogue.Options(with_disturbances=True)


def test_planning_with_the_disturbances_is_the_first_cure_where_it_helps() -> None:
    body = replace(SHAKEN, requirement=Requirement(math.radians(0.1), math.radians(0.01)))
    aware = compare(body, ("two-pulse",), AWARE)
    assert aware.recommended is not None
    assert aware.recommended.meets_requirement
    hopeless = replace(body, requirement=Requirement(nutation=math.radians(1e-6)))
    warned = [codes(comparison_warnings(compare(each, ("two-pulse",)))) for each in (body, hopeless)]
    assert [entry[:2] for entry in warned] == [
        ["requirement-missed", "disturbances-helped"],
        ["requirement-missed", "disturbances-not-helped"],
    ]


def test_planning_with_disturbances_is_tried_only_where_it_was_not_done() -> None:
    assert compare(FIRED, ("two-pulse",)).with_disturbances is None  # there are none
    assert compare(SHAKEN, ("two-pulse",)).with_disturbances is not None
    assert compare(SHAKEN, ("two-pulse",), AWARE).with_disturbances is None
    nothing_fits = replace(SHAKEN, limits=Limits(horizon=1e-6))
    assert compare(nothing_fits, ("two-pulse",)).with_disturbances is None  # and no recommended plan to compare with
