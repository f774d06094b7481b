"""Notes on plans and comparisons: reasons, what is missed and what stands in the way, cures."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

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
    one_of,
    recommended,
    spinner,
)
from support.golden import check_text
from support.places import case

import nutdamp
from nutdamp.common.results import Note
from nutdamp.flight.end_state import seen_at
from nutdamp.flight.propagation import by_impulses
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import Comparison, compare
from nutdamp.planning.notes import comparison_warnings, hindrances, plan_notes, reasons, remaining, verdict_notes
from nutdamp.planning.plan import Plan, judge
from nutdamp.planning.verdict import Cases, cases_of
from nutdamp.schemes import catalogue
from nutdamp.spacecraft.model import Disturbance, Goal, Inertia, Keep, Limits, Requirement, Spacecraft
from nutdamp.spacecraft.requirements import bounds
from nutdamp.spacecraft.schedule import Pulse, Schedule, channel_pulse

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


def noted_beside(made: Plan, cases: Cases | None = None, *, looped: bool = False) -> list[Note]:
    """The notes beside the verdict on a plan, by nominal values or by cases."""
    return list(verdict_notes(judge(made, cases, nominal=cases is None), made, looped=looped))


def test_what_a_plan_does_to_axis_and_spin_that_nothing_asks_for_is_noted() -> None:
    """Beyond 0.1° and a digit of the spin shown; not where the shift is limited, or target or spin are asked for."""
    free = nutdamp.example().replace(requirement=Requirement(nutation=math.radians(0.5)))
    turning, steady = (planning.plan(free, scheme) for scheme in ("one-pulse", "two-pulse"))
    turned = turning.flight.residual.momentum_shift
    assert turned > math.radians(0.1) > steady.flight.residual.momentum_shift
    goal = replace(turning, spacecraft=replace(free, goal=Goal(axis=free.direction_in_n(0.1, 0.0))))
    limited = planning.plan(nutdamp.example(), "one-pulse")
    plans = (turning, steady, goal, limited)
    assert [made for made in plans if "momentum-shift" in codes(noted_beside(made))] == [turning]
    assert one_of(noted_beside(turning), "momentum-shift")["momentum_shift_deg"] == math.degrees(turned)
    up = nutdamp.load(case("genesis-spinup.yaml"))
    for share, change in ((5e-5, False), (8e-5, True), (-8e-5, True)):
        fired = Pulse(1.0, 0.0, "T", np.array([0.0, 0.0, share * up.spin * up.inertia.C]))
        for asked in (False, True):
            aimed = replace(up, goal=Goal(spin=up.spin * (1.0 + share)) if asked else Goal())
            notes = noted_beside(Plan(aimed, "trial", Schedule((fired,))))
            assert ("spin-change" in codes(notes)) == (change and not asked)
            if change and not asked:
                values = one_of(notes, "spin-change")
                assert values["before_rpm"] == pytest.approx(1.6)
                assert values["after_rpm"] == pytest.approx(1.6 * (1.0 + share))
                assert values["cause"] == f"T {1.6 * share:+.3g} rpm"


STAGE = nutdamp.example("upper-stage")
OBLATE = Inertia((4200.0, 4200.0, 5000.0))


def idle(body: Spacecraft, degrees: float, t: float) -> float:
    """Degrees that ``degrees`` of nutation come to in ``t`` s without a pulse, by a flight."""
    slope = math.tan(math.radians(degrees)) / math.tan(body.nutation)
    left = replace(body, omega0=np.array([*(slope * body.omega0[:2]), body.omega0[2]]))
    return math.degrees(seen_at(by_impulses(left, Schedule(()), t), t).final.nutation)


def test_nutation_that_grows_or_decays_is_said_to_keep_the_requirement_for_a_while_or_from_when_on() -> None:
    """Before any pulse and again after the last one; the times end where a flight without pulses says."""
    made = planning.plan(STAGE, "two-pulse")
    levels = {bound: math.radians(0.54) for bound in bounds(STAGE)}
    wide = noted_beside(made, Cases(20_000, 1, 0.99, 1.0, 1.0, 1.0, levels=levels))
    after, before = (one_of(wide, code) for code in ("grows-again-in-cases", "met-without-pulse-until"))
    assert codes(noted_beside(made)) == ["tolerances-not-checked", "met-without-pulse-until", "loop-not-judged"]
    assert codes(noted_beside(made, looped=True)) == ["tolerances-not-checked"]
    assert [after["left_deg"], after["after_s"]] == pytest.approx([0.54, made.end])
    for start, lasting in ((1.0, before["until_s"]), (0.54, after["lasting_s"])):
        assert isinstance(lasting, float)
        assert idle(STAGE, start, lasting) == pytest.approx(2.0, rel=1e-4)
    body = replace(STAGE, inertia=OBLATE, omega0=np.array([5.0, 5.0, 1.0]) * STAGE.omega0, loop=None)
    body = replace(body, requirement=Requirement(nutation=math.radians(0.5)))
    decays = one_of(noted_beside(planning.plan(body, "two-pulse")), "met-without-pulse-from")
    assert isinstance(decays["from_s"], float)
    assert idle(body, math.degrees(body.nutation), decays["from_s"]) == pytest.approx(0.5, rel=1e-4)


@pytest.mark.parametrize(
    "change",
    [
        {"dissipation": None},
        {"inertia": OBLATE},  # it decays
        {"requirement": Requirement(nutation=math.radians(5.0))},  # kept up to the horizon
        {"requirement": Requirement(nutation=math.radians(0.5))},  # not kept at t = 0
        {"requirement": None},
        {"keep": (Keep("star", np.array([1.0, 0.0, 0.0]), 0.1),)},
    ],
)
def test_where_nothing_grows_beyond_what_is_required_nothing_is_said(change: dict[str, Any]) -> None:
    body = replace(STAGE, loop=None, dispersions=None, **change)
    assert set(codes(noted_beside(planning.plan(body, "two-pulse")))) <= {"no-tolerances"}


def test_what_is_not_shown_and_what_decides_the_failing_cases_is_said() -> None:
    made = planning.plan(nutdamp.example(), "four-pulse")
    results = run(Results(study_of(made.spacecraft, made.pulses), 500))
    cases = cases_of(results)
    for probability, expected in (
        (0.997, ["causes-of-failure"]),
        (0.9, ["undecided-cases", "causes-of-failure"]),
        (0.8, []),
    ):
        verdict = judge(made, replace(cases, probability=probability), results)
        assert codes(verdict_notes(verdict, made)) == expected
    certain = replace(made.spacecraft, requirement=Requirement(0.01, probability=0.9), dispersions=None)
    made = replace(made, spacecraft=certain)
    assert codes(verdict_notes(judge(made), made))[:2] == ["probability-without-tolerances", "no-tolerances"]


def test_plans_that_keep_the_cones_are_named_where_the_recommended_one_does_not() -> None:
    """One-pulse leaves the axis where it no longer passes the star, but shifts H by more than is required."""
    body = nutdamp.example()
    star = Keep("star", body.direction_in_n(math.radians(8.0), math.radians(210.0)), math.radians(5.2))
    compared = compare(replace(body, keep=(star,)), catalogue.CLASSIC, samples=0)
    assert [plan.kept for plan in compared] == [True, False, False]
    alone = Comparison(compared.spacecraft, (compared["two-pulse"],))
    assert one_of(comparison_warnings(compared), "plans-keep-cones")["schemes"] == "one-pulse"
    assert "plans-keep-cones" not in codes(comparison_warnings(alone))
    for tabulated in (False, True):
        assert ("cone-broken" in codes(comparison_warnings(compared, tabulated=tabulated))) is not tabulated
    assert codes(reasons(compared)) == ["cheapest-at-end"]
