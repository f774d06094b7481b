"""The verdict: status, bounds and causes follow from the numbers of plan and cases; notes on plans
and comparisons.
"""

import itertools
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
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
    aimed,
    channel,
    codes,
    cross,
    judged,
    noted,
    one_of,
    present,
    recommended,
    spinner,
)
from support.cases import weekly
from support.certificate_checker import check
from support.checker import violations
from support.commands import rows as rows_of
from support.dispersed import normal
from support.golden import check_text, refused
from support.process import Run

import nutdamp
from nutdamp.common import work
from nutdamp.common.results import Note
from nutdamp.errors import BadRequest
from nutdamp.files.reader import example_text
from nutdamp.files.tabular import json_text
from nutdamp.flight.end_state import seen_at
from nutdamp.flight.propagation import by_impulses
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.planning import notes, tradeoff
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import hindrances, remaining
from nutdamp.planning.decision import Comparison, compare
from nutdamp.planning.notes import (
    comparison_warnings,
    plan_notes,
    reasons,
    verdict_notes,
    with_disturbances,
)
from nutdamp.planning.verdict import Cases, Light, Status, cases_of
from nutdamp.schemes import catalogue
from nutdamp.spacecraft import directions, requirements
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import (
    Disturbance,
    Goal,
    Inertia,
    Keep,
    Limits,
    Requirement,
    Spacecraft,
)
from nutdamp.spacecraft.requirements import SAME_COST, Part, bounds
from nutdamp.spacecraft.schedule import Bounds, Pulse, Schedule, channel_pulse
from nutdamp.spacecraft.tolerances import Dispersions
from nutdamp.views.decisions import certificate_json
from nutdamp.views.verdict import line_json

EXITS = {
    Status.FLY: 0,
    Status.NO_PULSE: 0,
    Status.NOT_SHOWN: 4,
    Status.NOT_ENOUGH: 4,
    Status.NOT_COMMANDABLE: 4,
    Status.NO_PLAN: 3,
}
PROBABLE = Requirement(nutation=math.radians(0.5), probability=0.99)
SPREAD = Dispersions(A=normal(0.5))


def within(low: float, high: float) -> Cases:
    return Cases(20_000, 1, 0.997, low, low, high)


def test_the_status_goes_by_nominal_values_and_by_the_interval_of_the_share() -> None:
    assert {status: status.exit_status for status in Status} == EXITS
    for required, dispersed, left, share, *expected in [
        # Requirement, dispersions, nutation left in deg, from where to where the share of all cases
        # lies of which 99.7 % must comply; status, colour, whether all that is required is met.
        (HALF_A_DEGREE, False, 0.4, None, Status.FLY, Light.AMBER, True),
        (HALF_A_DEGREE, False, 0.6, None, Status.NOT_ENOUGH, Light.RED, False),
        (
            PROBABLE,
            False,
            0.4,
            None,
            Status.NOT_SHOWN,
            Light.RED,
            False,
        ),  # a probability, and nothing to draw from
        (PROBABLE, False, 0.6, None, Status.NOT_ENOUGH, Light.RED, False),
        (HALF_A_DEGREE, True, 0.4, None, Status.NOT_SHOWN, Light.RED, False),  # no case was flown
        (HALF_A_DEGREE, True, 0.4, (0.998, 0.9995), Status.FLY, Light.GREEN, True),
        (HALF_A_DEGREE, True, 0.4, (0.997, 1.0), Status.FLY, Light.GREEN, True),
        (HALF_A_DEGREE, True, 0.4, (0.9969, 1.0), Status.NOT_SHOWN, Light.RED, False),
        (HALF_A_DEGREE, True, 0.4, (0.99, 0.9969), Status.NOT_ENOUGH, Light.RED, False),
        (
            HALF_A_DEGREE,
            True,
            0.6,
            (0.998, 0.9995),
            Status.NOT_ENOUGH,
            Light.RED,
            False,
        ),  # it misses with nominal values
        (None, False, 3.0, None, Status.FLY, Light.AMBER, None),
        (None, True, 3.0, None, Status.FLY, Light.AMBER, None),
    ]:
        made = judged("a", left, required=required)
        made = replace(
            made, spacecraft=replace(made.spacecraft, dispersions=SPREAD if dispersed else None)
        )
        verdict = planning.judge(made, None if share is None else within(*share))
        assert [verdict.status, verdict.light, verdict.met] == expected, (
            required,
            dispersed,
            left,
            share,
        )
    alone = planning.judge(made, nominal=True)  # cases are left out on request
    assert (alone.status, alone.light) == (Status.FLY, Light.AMBER)


def test_where_nothing_fires_nothing_is_to_be_sent() -> None:
    """Whatever can be commanded: what misses the requirement is not enough, all the same."""
    commands = nutdamp.load(places.case("cbp1004.yaml")).commands
    for left, pulses, timed, status in (
        (0.4, 0, False, Status.NO_PULSE),
        (0.6, 0, False, Status.NOT_ENOUGH),
        (0.4, 1, False, Status.NOT_COMMANDABLE),
        (0.4, 1, True, Status.FLY),
        (0.6, 1, False, Status.NOT_ENOUGH),
    ):
        made = judged("a", left, required=HALF_A_DEGREE, pulses=pulses)
        made = replace(made, spacecraft=replace(made.spacecraft, commands=commands))
        assert planning.judge(made, timed=timed).status is status
    none = planning.judge(INFEASIBLE)
    assert (none.status, none.light, none.met, none.why, none.lines) == (
        Status.NO_PLAN,
        Light.RED,
        None,
        "because",
        (),
    )


NINE_TENTHS = {"requirement": {"nutation": "0.5 deg", "probability": 0.9}}


@pytest.mark.parametrize(
    ("changes", "scheme", "dispersed", "status", "light"),
    [
        (NINE_TENTHS, "two-pulse", True, Status.FLY, Light.GREEN),
        ({}, "two-pulse", False, Status.FLY, Light.AMBER),
        (NINE_TENTHS, "two-pulse", False, Status.NOT_SHOWN, Light.RED),
        ({}, "two-pulse", True, Status.NOT_SHOWN, Light.RED),  # to show 99.7 % takes 1,277 cases
        ({}, "four-pulse", True, Status.NOT_ENOUGH, Light.RED),
        (
            {"state": {"spin": "30 rpm", "nutation": "0.3 deg"}},
            "none",
            False,
            Status.NO_PULSE,
            Light.AMBER,
        ),
        ({"limits": {"horizon": "1 ms"}}, "two-pulse", True, Status.NO_PLAN, Light.RED),
    ],
)
def test_every_status_of_the_built_in_example(
    changes: Mapping[str, Any], scheme: str, dispersed: bool, status: Status, light: Light
) -> None:
    body = nutdamp.example().with_(**changes)
    body = body if dispersed else replace(body, dispersions=None)
    verdict = compare(body, [scheme], samples=500).verdict
    assert (verdict.status, verdict.light, verdict.status.exit_status) == (
        status,
        light,
        EXITS[status],
    )


def test_pulses_that_cannot_be_sent_to_a_spacecraft_that_takes_commands() -> None:
    body = replace(nutdamp.load(places.case("cbp1004.yaml")), dispersions=None)
    assert compare(body, ["two-pulse"]).verdict.status is Status.NOT_COMMANDABLE
    assert compare(body, ["two-pulse"], timed=True).verdict.status is not Status.NOT_COMMANDABLE


@pytest.mark.parametrize(("limits", "status"), [({}, "fly"), ({"gap": "60 s"}, "not-commandable")])
def test_a_schedule_read_from_a_file_keeps_the_limits_or_cannot_be_commanded(
    run: Run, tmp_path: Path, limits: Mapping[str, str], status: str
) -> None:
    sent = str(tmp_path / "sent.csv")
    run("plan", "-q", "--scheme", "two-pulse", "--csv", sent)
    setting = [part for key, value in limits.items() for part in ("--set", f"limits.{key}={value}")]
    flown = run("simulate", "-q", "--schedule", sent, "--json", "-", *setting)
    data = json.loads(flown.stdout)
    assert (data["decision"]["status"], flown.returncode) == (status, EXITS[Status(status)])
    assert ("warning: pulse 2 " in flown.stderr) is bool(limits)


# --- lines


def cases_with(
    nutation: tuple[float, float], shift: tuple[float, float], made: planning.Plan
) -> Cases:
    """Cases by the share that keeps each bound of `BOTH`, and the degrees that 99.7 % keep."""
    both = list(zip(bounds(made.spacecraft), (nutation, shift), strict=True))
    shares = {bound: share for bound, (share, _) in both}
    levels = {bound: math.radians(level) for bound, (_, level) in both}
    least = min(shares.values())
    return Cases(20_000, 1, 0.997, least, least, least, levels=levels, shares=shares)


def test_a_line_has_the_margin_of_what_is_judged_and_counts_the_cases_that_keep_it_alone() -> None:
    made = judged("a", 0.4, shift=0.15, required=BOTH)
    for cases, tightest, *expected in (
        (None, Part.NUTATION, (0.4, None, None, 0.1, True), (0.15, None, None, 0.05, True)),
        (
            ((0.7, 0.9), (0.998, 0.16)),
            Part.NUTATION,
            (0.4, 0.9, 0.7, -0.4, False),
            (0.15, 0.16, 0.998, 0.04, True),
        ),
        (
            ((0.997, 0.5), (0.9969, 0.2)),
            Part.SHIFT,
            (0.4, 0.5, 0.997, 0.0, True),
            (0.15, 0.2, 0.9969, 0.0, False),
        ),
    ):
        verdict = planning.judge(made, None if cases is None else cases_with(*cases, made))
        for line, cells in zip(verdict.lines, expected, strict=True):
            values = [
                None if value is None else math.degrees(value)
                for value in (line.nominal, line.dispersed)
            ]
            assert [*values, line.share, math.degrees(line.margin), line.met] == pytest.approx(
                cells, abs=1e-12
            )
        assert present(verdict.tightest).bound.part is tightest
        assert (
            verdict.good
            is (verdict.status is Status.FLY)
            is all(line.met for line in verdict.lines)
        )
    free = planning.judge(judged("a", 3.0))
    assert ([line.met for line in free.lines], free.required, free.tightest, free.good) == (
        [False],
        (),
        None,
        False,
    )


@cache
def example() -> Comparison:
    return compare(nutdamp.example(), catalogue.CLASSIC, samples=0)


def test_levels_shares_and_interval_are_those_of_the_cases() -> None:
    one = example()["four-pulse"]
    results = run(Results(study_of(one.spacecraft, one.pulses), 500))
    for final in (True, False):
        cases = cases_of(results, final=final)
        kept = present(results.values)[:2] <= np.radians([0.5, 0.2])[:, None]
        assert [*cases.levels.values()] == [
            np.quantile(row, 0.997) for row in present(results.values)[:2]
        ]
        assert [*cases.shares.values()] == [*kept.mean(axis=1)]
        assert (cases.complying, cases.samples, cases.final) == (
            kept.all(axis=0).mean(),
            500,
            final,
        )
        assert (cases.low, cases.high) == results.interval(certain=not final)
    verdict = planning.judge(one, cases_of(results), results)
    assert [line.share for line in verdict.lines] == [*kept.mean(axis=1)]
    assert verdict.causes
    assert {cause.input for cause in verdict.causes} <= {
        entry.tolerance for entry in results.study.model.inputs.drawn
    }


def test_main_causes_are_at_most_three_that_matter_of_the_tightest_bound() -> None:
    made = judged("a", 0.4, shift=0.15, required=BOTH)
    for shares, named in (
        ({"timing": 0.05, "A": 0.5, "thrust": 0.15, "C": 0.3}, ["A", "C", "thrust"]),
        ({"a": 0.26, "b": 0.25, "c": 0.25, "d": 0.24}, ["a", "b", "c"]),
        ({"a": 0.5, "b": 0.0999}, ["a"]),
        ({"a": 0.04, "b": 0.05}, ["b"]),
        ({}, []),
    ):
        told = SimpleNamespace(
            contributions=lambda bound, shares=shares: shares if bound.part is Part.SHIFT else {}
        )
        verdict = planning.judge(made, cases_with((0.99, 0.6), (0.9, 0.3), made), told)
        assert [cause.input for cause in verdict.causes] == named
    assert planning.judge(made).causes == ()


# --- cones


def watched(least: float, tilt: float = 20.0, azimuth: float = math.degrees(1.0)) -> Spacecraft:
    """The example, whose spin axis must stay ``least`` degrees from a
    star that is ``tilt`` from H.
    """
    body = nutdamp.example()
    star = directions.direction_in_n(body, math.radians(tilt), math.radians(azimuth))
    return replace(body, keep=(Keep("star", star, math.radians(least)),))


def test_a_cone_is_a_bound_like_any_other_whatever_is_left_at_the_end() -> None:
    kept, broken = (
        planning.judge(planning.plan(watched(least), "four-pulse"), nominal=True)
        for least in (10.0, 16.0)
    )
    assert [verdict.status for verdict in (kept, broken)] == [Status.FLY, Status.NOT_ENOUGH]
    (aspect,), line = broken.aspects, broken.lines[-1]
    assert (line.bound.part, line.bound.keep, line.bound.inner, line.met) == (
        Part.CONE,
        aspect.keep,
        True,
        False,
    )
    assert (line.nominal, line.margin) == (aspect.least, aspect.least - math.radians(16.0))
    four = planning.plan(watched(16.0), "four-pulse")
    assert (four.meets_requirement, four._ends_well, broken.tightest) == (False, True, line)
    assert (
        planning.judge(replace(four, spacecraft=replace(watched(16.0), requirement=None))).status
        is Status.NOT_ENOUGH
    )


def test_the_cone_about_h_bounds_the_nutation_on_the_way() -> None:
    for most, status in ((5.5, Status.FLY), (4.5, Status.NOT_ENOUGH)):  # it begins with 5°
        body = replace(
            nutdamp.example(), keep=(Keep("H", None, most=math.radians(most)),), dispersions=None
        )
        verdict = planning.plan(body, "two-pulse").verdict
        line = verdict.lines[-1]
        assert (verdict.status, line.bound.part, line.bound.limit) == (
            status,
            Part.DURING,
            math.radians(most),
        )
        assert math.degrees(line.nominal) == pytest.approx(5.0, abs=0.1)


# --- spin


@pytest.mark.deep
@pytest.mark.parametrize(
    ("tolerance", "rpm", "complying"), [(None, 0.2, 0.377), ("0.1 %", 0.02, 0.156)]
)
def test_spin_is_a_bound_within_one_percent_of_the_goal_unless_required_otherwise(
    tolerance: str | None, rpm: float, complying: float
) -> None:
    """Rim spinner with two thrusters that spin it up from 15 rpm."""
    body = nutdamp.load(places.case("rim-spin-up.yaml")).with_(goal={"spin": "20 rpm"})
    body = body if tolerance is None else body.with_(requirement={"spin": tolerance})
    verdict = compare(body, ["optimal"], samples=8_192).verdict
    cases = verdict.cases
    lines = {line.bound.part: line for line in verdict.lines}
    assert (verdict.status, verdict.tightest) == (Status.NOT_ENOUGH, lines[Part.NUTATION])
    assert cases is not None
    assert cases.low < complying < cases.high
    spin = lines[Part.SPIN]
    assert spin.bound.limit == pytest.approx(rpm * math.pi / 30.0)
    assert (spin.share == 1.0) is spin.met is (tolerance is None)
    assert [cause.input for cause in verdict.causes] == ["A", "C"]


# --- screens and files


FILE = """
name: Watched
inertia: {A: 80 kg m^2, C: 120 kg m^2}
state: {spin: 30 rpm, nutation: 2 deg}
attitude: {epoch: 2026-03-20T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}
steerable: {torque: 20 N m}
requirement: {nutation: 0.1 deg}
sun: epoch
keep: [{name: star, direction: [10 deg, 86 deg], min: 3.5 deg, max: 30 deg}]
"""
TWO = ("-q", "-", "--scheme", "two-pulse")
BOTH_SCHEMES = ("plan", "-v", "-q", "--scheme", "two-pulse", "--scheme", "four-pulse")


def test_a_broken_cone_is_in_every_file(run: Run) -> None:
    for command in ("plan", "simulate"):
        done = run(command, *TWO, "--json", "-", stdin=FILE)
        decision = json.loads(done.stdout)["decision"]
        told = [(line["part"], line.get("edge"), line["met"]) for line in decision["requirement"]]
        assert (done.returncode, decision["status"], decision["met"]) == (4, "not-enough", False)
        assert told == [("nutation", None, True), ("cone", "min", False), ("cone", "max", True)]
        assert [each["kept"] for each in decision["aspects"]] == [
            False,
            True,
        ]  # that of the Sun is any


def test_json_and_the_table_of_schemes_have_the_verdict_of_each(run: Run, tmp_path: Path) -> None:
    done = run(
        *BOTH_SCHEMES, "--nominal", "--table", "schemes.csv", "--json", "plan.json", columns=80
    )
    content = json.loads((tmp_path / "plan.json").read_text("utf-8"))
    decision, shift = content["decision"], content["decision"]["requirement"][1]
    told = (
        decision["scheme"],
        decision["status"],
        decision["met"],
        decision["cases"],
        decision["cheaper"],
    )
    assert (done.returncode, *told) == (0, "four-pulse", "fly", True, None, [])
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert shift["margin_deg"] == pytest.approx(shift["limit_deg"] - shift["nominal_deg"])
    assert decision["final"]["spin_rad_s"] == pytest.approx(math.pi)
    rows = rows_of((tmp_path / "schemes.csv").read_text("utf-8"))
    for row, one in zip(rows, content["plans"], strict=True):
        yes = [
            str(value).lower()
            for value in (one["scheme"] == "four-pulse", one["meets_requirement"])
        ]
        columns = ("scheme", "recommended", "meets_requirement", "met_fraction")
        assert [row[name] for name in columns] == [one["scheme"], *yes, ""]
        assert (int(row["pulses"]), float(row["propellant_kg"])) == (
            len(one["pulses"]),
            one["propellant_kg"],
        )
        assert float(row["momentum_shift_deg"]) == one["flown"]["momentum_shift_deg"]
        assert float(row["axis_tilt_deg"]) == one["final"]["axis"]["tilt_deg"]


@pytest.mark.deep
def test_the_table_of_schemes_goes_by_cases_has_shares_and_what_is_infeasible(run: Run) -> None:
    two, four = rows_of(run(*BOTH_SCHEMES, "--table", "-").stdout)
    assert [(row["recommended"], row["meets_requirement"]) for row in (two, four)] == [
        ("true", "true"),
        ("false",) * 2,
    ]
    assert float(two["met_fraction"]) == pytest.approx(0.99995, abs=1e-4)
    assert four["met_fraction"] == ""
    rows = list(
        rows_of(run(*BOTH_SCHEMES, "--robust", "--table", "-", "--set", "limits.horizon=4s").stdout)
    )
    assert {row["feasible"] for row in rows} == {"true", "false"}
    for row in rows:
        assert bool(row["why"]) == (not row["end_s"]) == (row["feasible"] == "false")


# --- notes: reasons, what is missed and what stands in the way, cures

FIRED = spinner(channels=cross(8.0))


def test_reasons_and_warnings_are_of_what_decided_and_what_is_missed() -> None:
    damped, far = (
        judged("a", 0.0, propellant=0.1),
        judged("far", 1e-12, shift=3.5, impulse=20.0, required=BOTH),
    )
    firing = replace(far, spacecraft=replace(far.spacecraft, channels=cross(20.0)))
    short = replace(FIRED, limits=Limits(horizon=0.01))
    plans: dict[str, tuple[planning.Plan, ...]] = {
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
    bodies = (
        short,
        replace(short, goal=Goal(spin=3.1)),
        spinner(channels=(channel("A", 0.0, 0.0, 8.0),)),
    )
    texts = [
        *(recommended(name, Comparison(each[0].spacecraft, each)) for name, each in plans.items()),
        *(noted(reasons(compare(body, catalogue.CLASSIC))) for body in bodies),
        noted(reasons(compare(short, ("optimal",)))),
    ]
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
    return replace(
        spinner(channels=cross(8.0, max_on_time=0.6), limits=limits), disturbances=disturbances
    )


def test_what_stands_in_the_way_is_named_and_nothing_else() -> None:
    texts = []
    for name, (body, scheme) in {
        "weak": (
            spinner(channels=cross(0.1, max_on_time=0.5), limits=Limits(horizon=30.0)),
            "four-pulse",
        ),
        "no shorter": (
            spinner(channels=cross(8.0, min_on_time=5.0), requirement=Requirement(nutation=1e-4)),
            "two-pulse",
        ),
        "suspected": (BALL, "four-pulse"),
        "no other limits in the file": (SINGLE, "one-pulse"),
        "dark": (replace(SINGLE, limits=Limits(horizon=7.0, blackout=((0.0, 1.0),))), "one-pulse"),
        "one pulse": (cut(Limits(max_pulses=1)), "four-pulse"),
        "disturbed": (cut(Limits(), TILTING), "four-pulse"),
        "steady tilt": (cut(Limits(), TILTING), "four-pulse"),
        "ticks": (cut(Limits(tick=0.3)), "four-pulse"),
        "ticks, and pulses left": (cut(Limits(tick=0.3, max_pulses=5)), "four-pulse"),
    }.items():
        compared = compare(
            body, (scheme,), catalogue.Options(with_disturbances=name == "steady tilt")
        )
        (plan,) = compared.plans
        certain, possible = hindrances(plan)
        texts += [
            f"{name}: {remaining(plan).code}, binding {certain}, suspected {possible}",
            noted((*comparison_warnings(compared), *plan_notes(plan))),
        ]
    check_text("notes.hindered", "\n".join(texts))


def test_a_blackout_is_not_said_to_limit_what_it_may_not_touch() -> None:
    """It is over before the first pulse: without it the plan is the same, so it must not be called
    the limit.
    """
    dark = planning.plan(
        replace(SINGLE, limits=Limits(horizon=7.0, blackout=((0.0, 0.1),))), "one-pulse"
    )
    assert dark.pulses.end == planning.plan(SINGLE, "one-pulse").pulses.end
    assert hindrances(dark) == (("limits.horizon",), ("limits.blackout",))


@pytest.mark.deep
def test_no_scheme_is_said_to_leave_the_least_where_another_leaves_less() -> None:
    """ACE: all of them end on ticks, one leaves least; each names what rounding can leave, which is
    more.
    """
    compared = compare(
        nutdamp.load(places.CONFIGS / "ace.yaml"), ("two-pulse", "four-pulse", "optimal")
    )
    left = {plan.scheme: plan._flight.residual.nutation for plan in compared if plan.feasible}
    assert max(left.values()) > 1.2 * min(left.values())
    for plan in compared:
        assert remaining(plan).code == "remains-rounding"
        assert math.degrees(left[plan.scheme]) <= float(
            remaining(plan).values["rounding_deg"] or 0.0
        )
        assert "remains-rounding" in codes(plan_notes(plan))


def test_ticks_explain_what_rounding_to_them_can_leave() -> None:
    """8 N m for 0.1 s: 0.04 N m s by the on-time, 0.004 N m s × ω3 by the start, at worst √(1 +
    1.5²) of both.
    """
    for tick, share, obstacle, suspected in (
        (0.01, 0.9, "remains-rounding", ("limits.tick",)),
        (0.01, 1.1, "remains-limits", ("limits.tick",)),
        (None, 0.9, "remains-scheme", ()),
    ):
        body = replace(FIRED, limits=Limits(tick=tick))
        most = (
            math.hypot(1.0, 1.5)
            * math.hypot(0.04, 0.004 * body.spin)
            / (body.inertia.C * body.spin)
        )
        made = Schedule((channel_pulse(body.channels[0], 1.0, 0.1),))
        plan = planning.Plan(body, "four-pulse", made)
        left = replace(plan._flight.residual, nutation=share * most)
        vars(plan)["_flight"] = SimpleNamespace(residual=left)
        assert (remaining(plan).code, hindrances(plan)) == (obstacle, ((), suspected))


def test_the_least_on_time_binds_where_a_pulse_is_no_longer() -> None:
    body = spinner(channels=cross(8.0, min_on_time=0.1))
    for on_time, binding in ((0.1, ("min_on_time",)), (0.11, ())):
        made = Schedule(
            (
                channel_pulse(body.channels[0], 1.0, 0.5),
                channel_pulse(body.channels[1], 3.0, on_time),
            )
        )
        assert hindrances(planning.Plan(body, "four-pulse", made))[0] == binding


SHAKEN = replace(
    FIRED, disturbances=(Disturbance(0.02 + 0j, rate=-FIRED.spin),), limits=Limits(horizon=20.0)
)
AWARE = catalogue.Options(with_disturbances=True)


def test_planning_with_the_disturbances_is_the_first_cure_where_it_helps() -> None:
    body = replace(SHAKEN, requirement=Requirement(math.radians(0.1), math.radians(0.01)))
    assert present(compare(body, ("two-pulse",), AWARE).recommended).meets_requirement
    hopeless = replace(body, requirement=Requirement(nutation=math.radians(1e-6)))
    warned = [
        codes(comparison_warnings(compare(each, ("two-pulse",)))) for each in (body, hopeless)
    ]
    assert [entry[:2] for entry in warned] == [
        ["requirement-missed", "disturbances-helped"],
        ["requirement-missed", "disturbances-not-helped"],
    ]


def test_planning_with_disturbances_is_tried_only_where_it_was_not_done() -> None:
    assert with_disturbances(compare(FIRED, ("two-pulse",))) is None  # there are none
    assert with_disturbances(compare(SHAKEN, ("two-pulse",))) is not None
    assert with_disturbances(compare(SHAKEN, ("two-pulse",), AWARE)) is None
    compared = compare(SHAKEN, ("two-pulse",))
    robust = replace(compared, preferred=compared["two-pulse"])
    assert with_disturbances(robust) not in (None, compared["two-pulse"])
    nothing_fits = replace(SHAKEN, limits=Limits(horizon=1e-6))
    assert (
        with_disturbances(compare(nothing_fits, ("two-pulse",))) is None
    )  # and no recommended plan to compare with


def test_schemes_that_know_the_disturbances_are_not_planned_again_with_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plans = [planning.plan(SHAKEN, name) for name in ("two-pulse", "command-block")]
    planned = list[str]()

    def attempted(_: Spacecraft, scheme: str, options: catalogue.SchemeOptions) -> planning.Plan:
        assert options.with_disturbances
        planned.append(scheme)
        return plans[0]

    monkeypatch.setattr(notes, "attempt", attempted)
    assert with_disturbances(Comparison(SHAKEN, tuple(plans))) in plans
    assert planned == ["two-pulse"]


def noted_beside(
    made: planning.Plan, cases: Cases | None = None, *, looped: bool = False
) -> list[Note]:
    """The notes beside the verdict on a plan, by nominal values or by cases."""
    return list(
        verdict_notes(planning.judge(made, cases, nominal=cases is None), made, looped=looped)
    )


@pytest.mark.parametrize(
    ("key", "tilt", "part", "said"),
    [
        ("pointing", 10.0, "pointing", False),
        ("momentum_shift", 10.0, "pointing", True),
        ("momentum_shift", None, "momentum_shift", False),
    ],
)
def test_where_h_may_end_counts_from_the_target_or_from_t_0(
    key: str, tilt: float | None, part: str, said: bool
) -> None:
    """With a target momentum_shift is read as pointing, and a warning says so."""
    text = example_text().replace("momentum_shift: 0.2 deg", f"{key}: 0.2 deg", 1)
    body = nutdamp.read(text if tilt is None else f"{text}goal: {{tilt: {tilt} deg}}\n")
    made = planning.plan(body, "none")
    (bound,) = (each for each in requirements.required(body) if each.part is not Part.NUTATION)
    assert (bound.part is Part.DISTANCE, bound.limit) == (tilt is not None, math.radians(0.2))
    (line,) = (each for each in planning.judge(made, nominal=True).lines if each.bound == bound)
    assert line.nominal == pytest.approx(math.radians(tilt or 0.0), abs=1e-9)
    assert line_json(line)["part"] == part
    assert ("momentum-shift-of-target" in codes(noted_beside(made))) == said


def test_what_a_plan_does_to_axis_and_spin_that_nothing_asks_for_is_noted() -> None:
    """Beyond 0.1° and a digit of the spin shown; not where the shift is limited, or target or spin
    are asked for.
    """
    free = nutdamp.example().replace(requirement=Requirement(nutation=math.radians(0.5)))
    turning, steady = (planning.plan(free, scheme) for scheme in ("one-pulse", "two-pulse"))
    turned = turning._flight.residual.momentum_shift
    assert turned > math.radians(0.1) > steady._flight.residual.momentum_shift
    goal = replace(
        turning, spacecraft=replace(free, goal=Goal(axis=directions.direction_in_n(free, 0.1, 0.0)))
    )
    limited = planning.plan(nutdamp.example(), "one-pulse")
    plans = (turning, steady, goal, limited)
    assert [made for made in plans if "momentum-shift" in codes(noted_beside(made))] == [turning]
    assert one_of(noted_beside(turning), "momentum-shift")["momentum_shift_deg"] == math.degrees(
        turned
    )
    up = nutdamp.load(places.case("genesis-spinup.yaml"))
    for share, change in ((5e-5, False), (8e-5, True), (-8e-5, True)):
        fired = Pulse(1.0, 0.0, "T", np.array([0.0, 0.0, share * up.spin * up.inertia.C]))
        for asked in (False, True):
            asking = replace(up, goal=Goal(spin=up.spin * (1.0 + share)) if asked else Goal())
            notes = noted_beside(planning.Plan(asking, "trial", Schedule((fired,))))
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


def test_nutation_that_grows_or_decays_keeps_the_requirement_for_a_while_or_from_when_on() -> None:
    """Before any pulse and again after the last one; the times end where a flight without pulses
    says.
    """
    made = planning.plan(STAGE, "two-pulse")
    levels = {bound: math.radians(0.54) for bound in bounds(STAGE)}
    wide = noted_beside(made, Cases(20_000, 1, 0.99, 1.0, 1.0, 1.0, levels=levels))
    after, before = (
        one_of(wide, code) for code in ("grows-again-in-cases", "met-without-pulse-until")
    )
    assert codes(noted_beside(made)) == [
        "tolerances-not-checked",
        "met-without-pulse-until",
        "loop-not-judged",
    ]
    assert codes(noted_beside(made, looped=True)) == ["tolerances-not-checked"]
    assert [after["left_deg"], after["after_s"]] == pytest.approx([0.54, made.end])
    for start, lasting in ((1.0, before["until_s"]), (0.54, after["lasting_s"])):
        assert isinstance(lasting, float)
        assert idle(STAGE, start, lasting) == pytest.approx(2.0, rel=1e-4)
    body = replace(
        STAGE, inertia=OBLATE, omega0=np.array([5.0, 5.0, 1.0]) * STAGE.omega0, loop=None
    )
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
def test_where_nothing_grows_beyond_what_is_required_nothing_is_said(
    change: dict[str, Any],
) -> None:
    body = replace(STAGE, loop=None, dispersions=None, **change)
    assert set(codes(noted_beside(planning.plan(body, "two-pulse")))) <= {
        "no-tolerances",
        "pulses-unneeded",
    }


def test_what_is_not_shown_and_what_decides_the_failing_cases_is_said() -> None:
    made = planning.plan(nutdamp.example(), "four-pulse")
    results = run(Results(study_of(made.spacecraft, made.pulses), 500))
    cases = cases_of(results)
    for probability, expected in (
        (0.997, ["causes-of-failure"]),
        (0.9, ["undecided-cases", "causes-of-failure"]),
        (0.8, []),
    ):
        verdict = planning.judge(made, replace(cases, probability=probability), results)
        assert codes(verdict_notes(verdict, made)) == expected
    certain = replace(
        made.spacecraft, requirement=Requirement(0.01, probability=0.9), dispersions=None
    )
    made = replace(made, spacecraft=certain)
    assert codes(verdict_notes(planning.judge(made), made))[:2] == [
        "probability-without-tolerances",
        "no-tolerances",
    ]


def test_plans_that_keep_the_cones_are_named_where_the_recommended_one_does_not() -> None:
    """One-pulse leaves the axis where it no longer passes the star, but shifts H by more than is
    required.
    """
    body = nutdamp.example()
    star = Keep(
        "star",
        directions.direction_in_n(body, math.radians(8.0), math.radians(210.0)),
        math.radians(5.2),
    )
    compared = compare(replace(body, keep=(star,)), catalogue.CLASSIC, samples=0)
    assert [plan._kept for plan in compared] == [True, False, False]
    alone = Comparison(compared.spacecraft, (compared["two-pulse"],))
    assert one_of(comparison_warnings(compared), "plans-keep-cones")["schemes"] == "one-pulse"
    assert "plans-keep-cones" not in codes(comparison_warnings(alone))
    for tabulated in (False, True):
        assert (
            "cone-broken" in codes(comparison_warnings(compared, tabulated=tabulated))
        ) is not tabulated
    assert codes(reasons(compared)) == ["cheapest-at-end"]


# --- fronts of time against propellant; certificates of the least cost of optimal

BODY = spinner(channels=cross(8.0, min_on_time=0.02, max_on_time=2.0), limits=Limits(horizon=40.0))
STEERED = str(places.CONFIGS / "steerable-stage.yaml")


@dataclass(frozen=True, eq=False, repr=False)
class Given(planning.Plan):
    """A plan of optimal whose distance of H from its target is given, rad."""

    off: float = 0.0

    @property
    def _flight(self) -> Any:
        return SimpleNamespace(residual=SimpleNamespace(axis_error=self.off))


def given(
    end: float, cost: float, degrees: float = 0.0, least: float = 0.1, within: float = 40.0
) -> Given:
    pulse = Pulse(end, 0.0, "+1", np.array([1.0, 0.0, 0.0]), propellant=cost)
    return Given(
        BODY,
        "optimal",
        Schedule((pulse,), bounds=Bounds(least, None, "kg", within)),
        off=math.radians(degrees),
    )


def points(plans: list[Given]) -> list[tradeoff.Point]:
    return [tradeoff.Point(one, 40.0, "kg") for one in plans]


def figures(points: tuple[tradeoff.Point, ...]) -> list[tuple[float, float]]:
    return [(point.plan.pulses.end, point.cost) for point in points]


def test_each_front_has_what_any_search_found_that_keeps_its_shift_and_none_beats(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Searches: the whole horizon, the fastest, horizons evenly between their ends by ratios; from
    strict to free.
    """
    results = iter(
        [
            *(given(30.0, 1.0), given(10.0, 3.0), given(16.0, 2.0), given(25.0, 2.1)),
            *(
                given(28.0, 0.9, 5.0),
                given(8.0, 2.5),
                given(18.0, 1.5, 2.0),
                given(20.0, 1.4995, 2.0),
            ),
        ]
    )
    asked, done = list[tuple[str, bool | None, float]](), list[int]()

    def search(body: Spacecraft, name: str, options: nutdamp.OptimalOptions) -> planning.Plan:
        assert name == "optimal"
        asked.append((options.least, options.free_axis, body.horizon))
        return next(results)

    monkeypatch.setattr(tradeoff, "plan", search)
    with work.steps(8, hook=lambda count, _: done.append(count)):
        made = tradeoff.fronts(
            BODY, nutdamp.OptimalOptions(), count=4, shifts=(math.inf, 0.0, math.inf)
        )
    assert [front.shift for front in made] == [0.0, math.inf]
    # The fastest of the free front keeps H too; what saves less than a thousandth is no point.
    assert figures(made[0].points) == [(8.0, 2.5), (16.0, 2.0), (30.0, 1.0)]
    assert figures(made[1].points) == [(8.0, 2.5), (16.0, 2.0), (18.0, 1.5), (28.0, 0.9)]
    for free, first, last in ((False, 10.0, 30.0), (True, 8.0, 28.0)):
        horizons = [
            40.0,
            40.0,
            first * (last / first) ** (1 / 3),
            first * (last / first) ** (2 / 3),
        ]
        leasts = ["propellant", "time", "propellant", "propellant"]
        searches = asked[4 * free : 4 * free + 4]
        assert [(least, freed) for least, freed, _ in searches] == [
            (least, free) for least in leasts
        ]
        assert [horizon for *_, horizon in searches] == pytest.approx(horizons)
    assert done == list(range(1, 9))
    numbers = [(number, front.shift) for number, front, _ in tradeoff.numbered(made)]
    assert numbers == [(number, 0.0 if number < 4 else math.inf) for number in range(1, 8)]


def test_the_first_order_least_of_a_front_never_rises_with_time() -> None:
    """A schedule that a stricter front found has the least of that one, which may be more than this
    front needs.
    """
    plans = [
        given(10.0, 3.0, 0.0, 2.0, 10.0),
        given(20.0, 2.0, 0.0, 2.2, 20.0),
        given(30.0, 1.0, 0.0, 0.7, 40.0),
    ]
    front = tradeoff.Front(0.0, tuple(points(plans)))
    assert [front.least(point) for point in front.points] == [2.0, 2.0, 0.7]


def test_no_point_is_beaten_by_one_of_a_stricter_front() -> None:
    """Random clouds: what allows more is nowhere dearer, and no front has two points that cost the
    same.
    """
    draw = np.random.default_rng(5)
    for _ in range(50):
        strict, more = (
            points(
                [given(*one) for one in (1.0 + draw.uniform(0.0, [10.0, 0.01], (8, 2))).tolist()]
            )
            for _ in range(2)
        )
        first = tradeoff.undominated(strict)
        second = tradeoff.undominated([*strict, *more], first)
        for one, two in (*itertools.pairwise(figures(first)), *itertools.pairwise(figures(second))):
            assert one[0] < two[0]
            assert one[1] > two[1]
        for end, cost in figures(first):
            assert min(other for ended, other in figures(second) if ended <= end) <= cost
        assert all(
            one.cost > two.cost * (1.0 + SAME_COST) for one, two in itertools.pairwise(first)
        )
        assert first[-1].cost <= min(point.cost for point in strict) / (1.0 - SAME_COST)


@pytest.mark.deep
def test_a_point_is_judged_by_all_cases_as_any_schedule_or_by_nominal_values() -> None:
    """One of four-pulse: 90 % of cases comply."""
    made = planning.plan(nutdamp.example(), "four-pulse")
    point = tradeoff.Point(made, 40.0, "kg")
    assert point.verdict is made.verdict
    assert (point.verdict.status, point._replace(nominal=True).verdict.status) == (
        Status.NOT_ENOUGH,
        Status.FLY,
    )


@pytest.mark.weekly
def test_fronts_that_are_searched_fly() -> None:
    half = math.radians(0.5)
    made = tradeoff.fronts(BODY, nutdamp.OptimalOptions(), count=4, shifts=(math.inf, 0.0, half))
    assert [front.shift for front in made] == [0.0, half, math.inf]
    for front in made:
        assert len(front.points) >= 2
        leasts = [
            front.least(point) or 0.0
            for point in sorted(front.points, key=lambda one: one.bounds.within)
        ]
        assert leasts == sorted(leasts, reverse=True)
        for point in front.points:
            assert violations(BODY, point.plan.pulses) == []
            left = point.plan._flight.residual
            assert left.nutation < math.radians(1e-6)
            assert left.momentum_shift <= front.shift + math.radians(1e-6)
            assert present(point.bounds.rigorous) <= point.cost * (1 + 1e-9)
    for strict, free in itertools.pairwise(made):
        for point in strict.points:
            sooner = [
                other for other in free.points if other.plan.pulses.end <= point.plan.pulses.end
            ]
            assert min(other.cost for other in sooner) <= point.cost


@pytest.mark.weekly
def test_impulse_is_traded_in_one_unit_also_where_the_propellant_is_known() -> None:
    """The fastest schedule, looked for by time, once counted in kg beside N m s, and beat all
    others.
    """
    body = replace(BODY, channels=tuple(one.of(isp=220.0, thrust=10.0) for one in BODY.channels))
    (front,) = tradeoff.fronts(
        body, nutdamp.OptimalOptions(least="impulse"), count=3, shifts=(0.0,)
    )
    (known,) = tradeoff.fronts(body, nutdamp.OptimalOptions(), count=3, shifts=(0.0,))
    assert [{point.bounds.unit for point in one.points} for one in (front, known)] == [
        {"N m s"},
        {"kg"},
    ]
    assert len(front.points) == len(known.points) >= 2
    for by_impulse, by_propellant in zip(
        front.points, known.points, strict=True
    ):  # all thrusters are alike
        assert by_impulse.cost == pytest.approx(by_propellant.plan.pulses.total_impulse, rel=1e-6)


@pytest.mark.weekly
def test_no_front_holds_what_a_schedule_of_another_front_beats_in_everything() -> None:
    """On ticks no schedule leaves H just where it was: one that leaves it as near, as soon and as
    cheaply counts.
    """
    body = nutdamp.load(places.CONFIGS / "couples-minisat.yaml")
    made = tradeoff.fronts(body, nutdamp.OptimalOptions(), count=6, shifts=(0.0, math.inf))
    for point, other in itertools.product(
        [point for front in made for point in front.points], repeat=2
    ):
        same = math.isclose(point.cost, other.cost, rel_tol=SAME_COST)
        sooner = other.plan.end < 0.999 * point.plan.end
        near = other.plan._flight.residual.axis_error <= point.plan._flight.residual.axis_error
        assert not (near and sooner and (same or other.cost < point.cost))


@pytest.mark.weekly
def test_what_plan_finds_is_traded_where_the_fastest_is_not_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """120 short pulses; the search for the fastest tries thousands, and ends without any."""
    body = nutdamp.load(places.case("nothing-damps.yaml"))
    made = planning.plan(body, "optimal", nutdamp.OptimalOptions(free_axis=False))
    monkeypatch.setattr(work, "FRONTS", 4_000.0)
    (front,) = tradeoff.fronts(body, nutdamp.OptimalOptions(), count=3, shifts=(0.0,))
    assert [(point.plan.end, point.cost, point.plan._cut) for point in front.points] == [
        (made.end, made.pulses.cost_in("kg"), False)
    ]
    assert front.why is None


def test_where_optimal_cannot_fire_the_other_schemes_are_traded(run: Run, tmp_path: Path) -> None:
    run("trade", STEERED, "--points", "2", "--csv", "t.csv")
    rows = rows_of((tmp_path / "t.csv").read_text("utf-8"))
    expected = [("two-pulse", "true"), ("one-pulse", "false"), ("two-pulse", "true")]
    assert [(row["scheme"], row["meets_requirement"]) for row in rows] == expected
    assert float(rows[0]["end_s"]) == planning.plan(nutdamp.load(STEERED), "two-pulse").end
    (front,) = tradeoff.fronts(
        nutdamp.load(STEERED), nutdamp.OptimalOptions(), count=2, shifts=(0.0,)
    )
    check_text("plan.trade-others", front.why or "")


@pytest.mark.deep
def test_the_command_writes_table_csv_json_picture_and_schedules(run: Run, tmp_path: Path) -> None:
    files = ["--csv", "t.csv", "--json", "t.json", "--plot", "t.svg", "--schedules", "front"]
    assert run("trade", "--points", "2", "--allow", "0", *files).returncode == 0
    rows = rows_of((tmp_path / "t.csv").read_text())
    written = json.loads((tmp_path / "t.json").read_text())["fronts"][0]["points"]
    assert len(rows) == len(written) == len(list((tmp_path / "front").glob("point-*.csv"))) == 2
    assert float(rows[0]["propellant_kg"]) == written[0]["propellant_kg"]
    assert (tmp_path / "t.svg").stat().st_size > 10_000
    again = run("simulate", "--schedule", "front/point-1.csv", "--flown", "--json", "-")
    assert json.loads(again.stdout)["flown"]["nutation_deg"] < 1e-6


def test_nothing_feasible_ends_with_status_3_and_a_reason(run: Run) -> None:
    text = (
        "name: x\ninertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 5 deg}\n"
        "thrusters: [{name: T, torque: [1, 0, 0], min_on_time: 1 s}]\nlimits: {horizon: 0.1}\n"
    )
    done = run("trade", "-", "--points", "1", "--allow", "any", stdin=text, columns=200, status=3)
    check_text(
        "plan.trade-none",
        "\n".join(line.strip() for line in done.stdout.splitlines() if "none" in line),
    )
    assert run("trade", "--allow", "-1deg").returncode == 2


def test_a_trade_searches_what_a_comparison_has_planned_no_second_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of the fronts with H kept and with H free, the comparison has planned the one of the file."""
    searched: list[tuple[bool | None, str]] = []

    def counted(*question: Any) -> planning.Plan:
        searched.append((question[2].free_axis, question[2].least))
        return planning.plan(*question)

    monkeypatch.setattr(tradeoff, "plan", counted)
    for body, free in ((BODY, True), (aimed(BODY, 5.0, 0.0), False)):
        searched.clear()
        made = tradeoff.trade(body, nutdamp.OptimalOptions(), count=1, shifts=(0.0, math.inf))
        assert searched == [(not free, "propellant")]
        alone = tradeoff.fronts(body, nutdamp.OptimalOptions(), count=1, shifts=(0.0, math.inf))
        costs = [[point.cost for point in front.points] for front in made.fronts]
        assert costs == [[point.cost for point in front.points] for front in alone]


@pytest.mark.deep
def test_the_searches_of_all_points_share_a_limit_of_work(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """But that of the whole horizon, as `plan` finds it; the others would take 490 units."""
    with work.budget("test", 1e9) as whole:
        planning.plan(nutdamp.example(), "optimal", nutdamp.OptimalOptions(free_axis=False))
    monkeypatch.setattr(work, "FRONTS", 200.0)
    with work.budget("test", 1e9) as spent:
        tradeoff.fronts(nutdamp.example(), nutdamp.OptimalOptions(), count=3, shifts=(0.0,))
    assert spent.done < whole.done + work.FRONTS + 150.0  # with bounds
    command = ("trade", "--points", "3", "--allow", "0deg")
    done = run(*command, status=0)
    check_text(
        "plan.trade-cut", "\n".join(line for line in done.stderr.splitlines() if "point" in line)
    )
    monkeypatch.setattr(work, "FRONTS", 5.0)
    monkeypatch.setattr(work, "SCHEME", 5.0)
    none = run(*command, "--csv", "-", status=0)
    assert {row["scheme"] for row in rows_of(none.stdout)} <= {
        "two-pulse",
        "four-pulse",
    }


# --- certificates, checked from the file alone by certificate_checker

WEAK, STRONG = cross(8.0), cross(4_000.0)
PLAIN, IMPULSE = nutdamp.OptimalOptions(), nutdamp.OptimalOptions(least="impulse")
WINDOWS = Limits(earliest=3.0, horizon=70.0, blackout=((10.0, 22.5), (40.0, 41.0)))
ONE_WAY = (
    channel("T1", 8.0, 0.0, 0.0),
    channel("T2", -3.0, 5.0, 0.0),
    channel("T3", 1.0, -9.0, 0.0),
)
BRIEF = Limits(horizon=40.0)
PROLATE = spinner(channels=WEAK, limits=Limits(horizon=60.0))
OBLATE_BODY = spinner(100.0, 150.0, channels=WEAK, limits=BRIEF)
TURNED, FASTER = Goal(axis=np.array([math.sin(0.15), 0.0, math.cos(0.15)])), Goal(spin=3.1)
ROLL = channel("R", 0.0, 0.0, 4.0)
BODIES: dict[str, tuple[Spacecraft, nutdamp.OptimalOptions]] = {
    "prolate": (PROLATE, PLAIN),
    "oblate": (OBLATE_BODY, PLAIN),
    "reversed": (spinner(spin=-3.0, channels=WEAK, limits=BRIEF), PLAIN),
    "windows": (spinner(channels=WEAK, limits=WINDOWS), PLAIN),
    "strong": (spinner(channels=STRONG, limits=Limits(horizon=30.0)), IMPULSE),
    "strong in windows": (spinner(channels=STRONG, limits=WINDOWS), IMPULSE),
    "one way only": (spinner(channels=ONE_WAY, limits=Limits(horizon=90.0)), IMPULSE),
    "free axis": (spinner(channels=ONE_WAY), nutdamp.OptimalOptions(free_axis=True)),
    "shift": (
        spinner(channels=STRONG, limits=Limits(horizon=5.0)),
        nutdamp.OptimalOptions(shift=math.radians(0.3)),
    ),
    "steerable beside": (spinner(channels=WEAK, steerable=Steerable(20.0)), PLAIN),
    "turned": (replace(PROLATE, goal=TURNED), PLAIN),
    "spun up": (replace(spinner(channels=(*WEAK, ROLL), limits=BRIEF), goal=FASTER), IMPULSE),
    "damped": (replace(OBLATE_BODY, dissipation=60.0), PLAIN),
    "I1 ≠ I2": (spinner(moments=(122.0, 118.0, 80.0), channels=WEAK, limits=BRIEF), PLAIN),
}
IN_CI = ("windows", "one way only", "shift", "damped", "I1 ≠ I2")


def raised(c: dict[str, Any]) -> None:
    """Higher prices would prove a higher bound."""
    for one in c["equations"]:
        one["price"] *= 1.01
    c["bound"] = 1.01 * (c["bound"] + c["gained"]) - c["gained"]
    for one in c["primer"]:
        one["q"] = {name: [1.01 * q for q in curve] for name, curve in one["q"].items()}


def halved(*keys: str | int) -> Callable[[dict[str, Any]], None]:
    """Halves the number at ``keys``."""

    def halve(c: Any) -> None:
        for key in keys[:-1]:
            c = c[key]
        c[keys[-1]] *= 0.5

    return halve


def refutes(text: str, *tampers: Callable[[dict[str, Any]], None]) -> None:
    """The file as it is proves what it says, and as any of these make it does not."""
    for tamper in tampers:
        content = json.loads(text)
        tamper(content)
        with pytest.raises(AssertionError):
            check(json.dumps(content))


@pytest.mark.deep
@pytest.mark.parametrize("name", [one if one in IN_CI else weekly(one) for one in BODIES])
def test_the_file_alone_proves_the_bound_and_a_tampered_one_does_not(name: str) -> None:
    body, options = BODIES[name]
    made = tradeoff.certificate(planning.plan(body, "optimal", options))
    text = json_text(certificate_json(made))
    bounds = present(made.plan.pulses.bounds)
    assert check(text) == bounds.first_order == made.proof.bound > 0.0
    if "windows" in name:
        refutes(
            text,
            *[
                halved("circle", 0),
                halved("nutation_rad_s"),
                halved("equations", 0, "goal_Nms"),
                lambda c: c.update(bound=1.001 * c["bound"]),
                halved("channels", 0, "cost_per_s"),
                lambda c: c["channels"][0].update(
                    torque_Nm=[1.1 * one for one in c["channels"][0]["torque_Nm"]]
                ),
                halved("burns", 0, "on_time_s"),
                lambda c: c["burns"][0].update(t_s=c["burns"][0]["t_s"] + 0.4),
                halved("primer", 0, "q", "+1", 7),
                raised,
            ],
        )


@pytest.mark.deep
def test_firing_in_the_dark_would_be_worth_more() -> None:
    """The prices know of the windows: where they end, q goes above the price of a channel that acts
    at once.
    """
    two = channel("T", 4_000.0, 0.0, 0.0), channel("U", 0.0, -4_000.0, 0.0)
    options = nutdamp.OptimalOptions(least="impulse", free_axis=True)
    content = certificate_json(
        tradeoff.certificate(
            planning.plan(spinner(channels=two, limits=Limits(horizon=2.0)), "optimal", options)
        )
    )
    check(json_text(content))
    content["windows_s"] = [[0.0, 90.0]]
    with pytest.raises(AssertionError, match="above"):
        check(json_text(content))


def test_what_has_no_certificate_says_why_and_the_command_what_to_name(
    run: Run, tmp_path: Path
) -> None:
    """Optimal is infeasible within a millisecond, which only planning shows: the screen is shown
    too.
    """
    with refused(BadRequest, "plan.certificate-of-other"):
        tradeoff.certificate(planning.plan(PROLATE, "four-pulse"))
    for status, scheme in ((2, ("two-pulse",)), (1, ("optimal", "--set", "limits.horizon=1 ms"))):
        result = run("plan", "--scheme", *scheme, "--certificate", "proof.json", columns=300)
        assert (result.returncode, bool(result.stdout)) == (status, status == 1)
        assert not (tmp_path / "proof.json").exists()
        check_text(f"plan.certificate-{status}", "\n".join(result.stderr.strip().splitlines()[-1:]))


def test_the_command_writes_the_file_and_says_what_it_proves(run: Run, tmp_path: Path) -> None:
    limits = ("--nominal", "--set", "limits.horizon=30 s")
    result = run(
        "plan",
        "-v",
        "--scheme",
        "optimal",
        "--certificate",
        "proof.json",
        *limits,
        columns=200,
        status=0,
    )
    text = (tmp_path / "proof.json").read_text()
    assert json.loads(text)["unit"] == "kg"
    assert f"small-angle bound within 30 s: {1e3 * check(text):.4g} g" in result.stdout
    refutes(text, raised)


@pytest.mark.deep
def test_where_another_plan_is_recommended_the_command_says_whose_certificate_it_writes(
    run: Run,
) -> None:
    command = (
        "plan",
        "--scheme",
        "optimal",
        "--scheme",
        "two-pulse",
        "--certificate",
        "proof.json",
        "--json",
        "-",
    )
    nominal, dispersed = (run(*command, *each, columns=200) for each in (["--nominal"], []))
    schemes = [json.loads(one.stdout)["decision"]["scheme"] for one in (nominal, dispersed)]
    assert schemes == ["optimal", "two-pulse"]
    whose = [line for line in dispersed.stderr.splitlines() if line not in nominal.stderr]
    check_text("plan.certificate-whose", "\n".join(whose))
