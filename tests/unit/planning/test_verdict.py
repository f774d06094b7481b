"""The verdict: status, bounds and causes follow from the numbers of plan and cases; notes on plans and comparisons."""

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
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
from support.dispersed import normal
from support.golden import check_text
from support.process import Run

import nutdamp
from nutdamp.common.results import Note
from nutdamp.flight.end_state import seen_at
from nutdamp.flight.propagation import by_impulses
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import Comparison, compare
from nutdamp.planning.notes import comparison_warnings, hindrances, plan_notes, reasons, remaining, verdict_notes
from nutdamp.planning.verdict import Cases, Light, Status, cases_of
from nutdamp.schemes import catalogue
from nutdamp.spacecraft.model import Disturbance, Goal, Inertia, Keep, Limits, Requirement, Spacecraft
from nutdamp.spacecraft.requirements import Part, bounds
from nutdamp.spacecraft.schedule import Pulse, Schedule, channel_pulse
from nutdamp.spacecraft.tolerances import Dispersions

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

# Requirement, dispersions, nutation left in deg, from where to where the share of all cases lies of which 99.7 % must
# comply; status, colour, whether all that is required is met.
VERDICTS: list[tuple[Requirement | None, bool, float, tuple[float, float] | None, Status, Light, bool | None]] = [
    (HALF_A_DEGREE, False, 0.4, None, Status.FLY, Light.AMBER, True),
    (HALF_A_DEGREE, False, 0.6, None, Status.NOT_ENOUGH, Light.RED, False),
    (PROBABLE, False, 0.4, None, Status.NOT_SHOWN, Light.RED, False),  # a probability, and nothing to draw from
    (PROBABLE, False, 0.6, None, Status.NOT_ENOUGH, Light.RED, False),
    (HALF_A_DEGREE, True, 0.4, None, Status.NOT_SHOWN, Light.RED, False),  # no case was flown
    (HALF_A_DEGREE, True, 0.4, (0.998, 0.9995), Status.FLY, Light.GREEN, True),
    (HALF_A_DEGREE, True, 0.4, (0.997, 1.0), Status.FLY, Light.GREEN, True),
    (HALF_A_DEGREE, True, 0.4, (0.9969, 1.0), Status.NOT_SHOWN, Light.RED, False),
    (HALF_A_DEGREE, True, 0.4, (0.99, 0.9969), Status.NOT_ENOUGH, Light.RED, False),
    (HALF_A_DEGREE, True, 0.6, (0.998, 0.9995), Status.NOT_ENOUGH, Light.RED, False),  # it misses with nominal values
    (None, False, 3.0, None, Status.FLY, Light.AMBER, None),
    (None, True, 3.0, None, Status.FLY, Light.AMBER, None),
]


def within(low: float, high: float) -> Cases:
    return Cases(20_000, 1, 0.997, low, low, high)


def test_the_status_goes_by_nominal_values_and_by_the_interval_of_the_share() -> None:
    assert {status: status.exit_status for status in Status} == EXITS
    for required, dispersed, left, share, *expected in VERDICTS:
        made = judged("a", left, required=required)
        made = replace(made, spacecraft=replace(made.spacecraft, dispersions=SPREAD if dispersed else None))
        verdict = planning.judge(made, None if share is None else within(*share))
        assert [verdict.status, verdict.light, verdict.met] == expected, (required, dispersed, left, share)
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
    assert (none.status, none.light, none.met, none.why, none.lines) == (Status.NO_PLAN, Light.RED, None, "because", ())


NINE_TENTHS = {"requirement": {"nutation": "0.5 deg", "probability": 0.9}}


@pytest.mark.parametrize(
    ("changes", "scheme", "dispersed", "status", "light"),
    [
        (NINE_TENTHS, "two-pulse", True, Status.FLY, Light.GREEN),
        ({}, "two-pulse", False, Status.FLY, Light.AMBER),
        (NINE_TENTHS, "two-pulse", False, Status.NOT_SHOWN, Light.RED),
        ({}, "two-pulse", True, Status.NOT_SHOWN, Light.RED),  # to show 99.7 % takes 1,277 cases
        ({}, "four-pulse", True, Status.NOT_ENOUGH, Light.RED),
        ({"state": {"spin": "30 rpm", "nutation": "0.3 deg"}}, "none", False, Status.NO_PULSE, Light.AMBER),
        ({"limits": {"horizon": "1 ms"}}, "two-pulse", True, Status.NO_PLAN, Light.RED),
    ],
)
def test_every_status_of_the_built_in_example(
    changes: Mapping[str, Any], scheme: str, dispersed: bool, status: Status, light: Light
) -> None:
    body = nutdamp.example().with_(**changes)
    body = body if dispersed else replace(body, dispersions=None)
    verdict = compare(body, [scheme], samples=500).verdict
    assert (verdict.status, verdict.light, verdict.status.exit_status) == (status, light, EXITS[status])


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


def cases_with(nutation: tuple[float, float], shift: tuple[float, float], made: planning.Plan) -> Cases:
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
        (((0.7, 0.9), (0.998, 0.16)), Part.NUTATION, (0.4, 0.9, 0.7, -0.4, False), (0.15, 0.16, 0.998, 0.04, True)),
        (((0.997, 0.5), (0.9969, 0.2)), Part.SHIFT, (0.4, 0.5, 0.997, 0.0, True), (0.15, 0.2, 0.9969, 0.0, False)),
    ):
        verdict = planning.judge(made, None if cases is None else cases_with(*cases, made))
        for line, cells in zip(verdict.lines, expected, strict=True):
            values = [None if value is None else math.degrees(value) for value in (line.nominal, line.dispersed)]
            assert [*values, line.share, math.degrees(line.margin), line.met] == pytest.approx(cells, abs=1e-12)
        assert present(verdict.tightest).bound.part is tightest
        assert verdict.good is (verdict.status is Status.FLY) is all(line.met for line in verdict.lines)
    free = planning.judge(judged("a", 3.0))
    assert ([line.met for line in free.lines], free.required, free.tightest, free.good) == ([False], (), None, False)


@cache
def example() -> Comparison:
    return compare(nutdamp.example(), catalogue.CLASSIC, samples=0)


def test_levels_shares_and_interval_are_those_of_the_cases() -> None:
    one = example()["four-pulse"]
    results = run(Results(study_of(one.spacecraft, one.pulses), 500))
    for final in (True, False):
        cases = cases_of(results, final=final)
        kept = present(results.values)[:2] <= np.radians([0.5, 0.2])[:, None]
        assert [*cases.levels.values()] == [np.quantile(row, 0.997) for row in present(results.values)[:2]]
        assert [*cases.shares.values()] == [*kept.mean(axis=1)]
        assert (cases.complying, cases.samples, cases.final) == (kept.all(axis=0).mean(), 500, final)
        assert (cases.low, cases.high) == results.interval(certain=not final)
    verdict = planning.judge(one, cases_of(results), results)
    assert [line.share for line in verdict.lines] == [*kept.mean(axis=1)]
    assert verdict.causes
    assert {cause.input for cause in verdict.causes} <= {entry.tolerance for entry in results.study.model.inputs.drawn}


def test_main_causes_are_at_most_three_that_matter_of_the_tightest_bound() -> None:
    made = judged("a", 0.4, shift=0.15, required=BOTH)
    for shares, named in (
        ({"timing": 0.05, "A": 0.5, "thrust": 0.15, "C": 0.3}, ["A", "C", "thrust"]),
        ({"a": 0.26, "b": 0.25, "c": 0.25, "d": 0.24}, ["a", "b", "c"]),
        ({"a": 0.5, "b": 0.0999}, ["a"]),
        ({"a": 0.04, "b": 0.05}, ["b"]),
        ({}, []),
    ):
        told = SimpleNamespace(contributions=lambda bound, shares=shares: shares if bound.part is Part.SHIFT else {})
        verdict = planning.judge(made, cases_with((0.99, 0.6), (0.9, 0.3), made), told)
        assert [cause.input for cause in verdict.causes] == named
    assert planning.judge(made).causes == ()


# --- cones


def watched(least: float, tilt: float = 20.0, azimuth: float = math.degrees(1.0)) -> Spacecraft:
    """The example, whose spin axis must stay ``least`` degrees from a star that is ``tilt`` from H."""
    body = nutdamp.example()
    star = body.direction_in_n(math.radians(tilt), math.radians(azimuth))
    return replace(body, keep=(Keep("star", star, math.radians(least)),))


def test_a_cone_is_a_bound_like_any_other_whatever_is_left_at_the_end() -> None:
    kept, broken = (planning.judge(planning.plan(watched(least), "four-pulse"), nominal=True) for least in (10.0, 16.0))
    assert [verdict.status for verdict in (kept, broken)] == [Status.FLY, Status.NOT_ENOUGH]
    (aspect,), line = broken.aspects, broken.lines[-1]
    assert (line.bound.part, line.bound.keep, line.bound.inner, line.met) == (Part.CONE, aspect.keep, True, False)
    assert (line.nominal, line.margin) == (aspect.least, aspect.least - math.radians(16.0))
    four = planning.plan(watched(16.0), "four-pulse")
    assert (four.meets_requirement, four.ends_well, broken.tightest) == (False, True, line)
    assert (
        planning.judge(replace(four, spacecraft=replace(watched(16.0), requirement=None))).status is Status.NOT_ENOUGH
    )


def test_the_cone_about_h_bounds_the_nutation_on_the_way() -> None:
    for most, status in ((5.5, Status.FLY), (4.5, Status.NOT_ENOUGH)):  # it begins with 5°
        body = replace(nutdamp.example(), keep=(Keep("H", None, most=math.radians(most)),), dispersions=None)
        verdict = planning.plan(body, "two-pulse").verdict
        line = verdict.lines[-1]
        assert (verdict.status, line.bound.part, line.bound.limit) == (status, Part.DURING, math.radians(most))
        assert math.degrees(line.nominal) == pytest.approx(5.0, abs=0.1)


# --- spin


@pytest.mark.deep
@pytest.mark.parametrize(("tolerance", "rpm", "complying"), [(None, 0.2, 0.377), ("0.1 %", 0.02, 0.156)])
def test_spin_is_a_bound_like_any_other_within_one_percent_of_the_goal_unless_required_otherwise(
    tolerance: str | None, rpm: float, complying: float
) -> None:
    """Rim spinner with two thrusters that spin it up from 15 rpm."""
    body = nutdamp.load(places.case("rim-spin-up.yaml")).with_(goal={"spin": "20 rpm"})
    body = body if tolerance is None else body.with_(requirement={"spin": tolerance})
    verdict = compare(body, ["optimal"], samples=8_192).verdict
    cases, lines = verdict.cases, {line.bound.part: line for line in verdict.lines}
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
        assert [each["kept"] for each in decision["aspects"]] == [False, True]  # that of the Sun is any


def csv_rows(text: str) -> Iterator[dict[str, str]]:
    return iter(csv.DictReader(io.StringIO(text)))


def test_json_and_the_table_of_schemes_have_the_verdict_of_each(run: Run, tmp_path: Path) -> None:
    done = run(*BOTH_SCHEMES, "--nominal", "--table", "schemes.csv", "--json", "plan.json", columns=80)
    content = json.loads((tmp_path / "plan.json").read_text("utf-8"))
    decision, shift = content["decision"], content["decision"]["requirement"][1]
    told = (decision["scheme"], decision["status"], decision["met"], decision["cases"], decision["cheaper"])
    assert (done.returncode, *told) == (0, "four-pulse", "fly", True, None, [])
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert shift["margin_deg"] == pytest.approx(shift["limit_deg"] - shift["nominal_deg"])
    assert decision["final"]["spin_rad_s"] == pytest.approx(math.pi)
    rows = csv_rows((tmp_path / "schemes.csv").read_text("utf-8"))
    for row, one in zip(rows, content["plans"], strict=True):
        yes = [str(value).lower() for value in (one["scheme"] == "four-pulse", one["meets_requirement"])]
        columns = ("scheme", "recommended", "meets_requirement", "met_fraction")
        assert [row[name] for name in columns] == [one["scheme"], *yes, ""]
        assert (int(row["pulses"]), float(row["propellant_kg"])) == (len(one["pulses"]), one["propellant_kg"])
        assert float(row["momentum_shift_deg"]) == one["flown"]["momentum_shift_deg"]
        assert float(row["axis_tilt_deg"]) == one["final"]["axis"]["tilt_deg"]


@pytest.mark.deep
def test_the_table_of_schemes_goes_by_cases_has_the_share_where_all_have_flown_and_what_is_infeasible(run: Run) -> None:
    two, four = csv_rows(run(*BOTH_SCHEMES, "--table", "-").stdout)
    assert [(row["recommended"], row["meets_requirement"]) for row in (two, four)] == [("true", "true"), ("false",) * 2]
    assert float(two["met_fraction"]) == pytest.approx(0.99995, abs=1e-4)
    assert four["met_fraction"] == ""
    rows = list(csv_rows(run(*BOTH_SCHEMES, "--robust", "--table", "-", "--set", "limits.horizon=4s").stdout))
    assert {row["feasible"] for row in rows} == {"true", "false"}
    for row in rows:
        assert bool(row["why"]) == (not row["end_s"]) == (row["feasible"] == "false")


# --- notes: reasons, what is missed and what stands in the way, cures

FIRED = spinner(channels=cross(8.0))


def test_reasons_and_warnings_are_of_what_decided_and_what_is_missed() -> None:
    damped, far = judged("a", 0.0, propellant=0.1), judged("far", 1e-12, shift=3.5, impulse=20.0, required=BOTH)
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
    bodies = (short, replace(short, goal=Goal(spin=3.1)), spinner(channels=(channel("A", 0.0, 0.0, 8.0),)))
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
        texts += [
            f"{name}: {remaining(plan).code}, binding {certain}, suspected {possible}",
            noted((*comparison_warnings(compared), *plan_notes(plan))),
        ]
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
        plan = planning.Plan(body, "four-pulse", made)
        left = replace(plan.flight.residual, nutation=share * most)
        vars(plan)["flight"] = SimpleNamespace(residual=left)
        assert (remaining(plan).code, hindrances(plan)) == (obstacle, ((), suspected))


def test_the_least_on_time_binds_where_a_pulse_is_no_longer() -> None:
    body = spinner(channels=cross(8.0, min_on_time=0.1))
    for on_time, binding in ((0.1, ("min_on_time",)), (0.11, ())):
        made = Schedule((channel_pulse(body.channels[0], 1.0, 0.5), channel_pulse(body.channels[1], 3.0, on_time)))
        assert hindrances(planning.Plan(body, "four-pulse", made))[0] == binding


SHAKEN = replace(FIRED, disturbances=(Disturbance(0.02 + 0j, rate=-FIRED.spin),), limits=Limits(horizon=20.0))
AWARE = catalogue.Options(with_disturbances=True)


def test_planning_with_the_disturbances_is_the_first_cure_where_it_helps() -> None:
    body = replace(SHAKEN, requirement=Requirement(math.radians(0.1), math.radians(0.01)))
    assert present(compare(body, ("two-pulse",), AWARE).recommended).meets_requirement
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


def noted_beside(made: planning.Plan, cases: Cases | None = None, *, looped: bool = False) -> list[Note]:
    """The notes beside the verdict on a plan, by nominal values or by cases."""
    return list(verdict_notes(planning.judge(made, cases, nominal=cases is None), made, looped=looped))


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
    up = nutdamp.load(places.case("genesis-spinup.yaml"))
    for share, change in ((5e-5, False), (8e-5, True), (-8e-5, True)):
        fired = Pulse(1.0, 0.0, "T", np.array([0.0, 0.0, share * up.spin * up.inertia.C]))
        for asked in (False, True):
            aimed = replace(up, goal=Goal(spin=up.spin * (1.0 + share)) if asked else Goal())
            notes = noted_beside(planning.Plan(aimed, "trial", Schedule((fired,))))
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
    assert set(codes(noted_beside(planning.plan(body, "two-pulse")))) <= {"no-tolerances", "pulses-unneeded"}


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
    certain = replace(made.spacecraft, requirement=Requirement(0.01, probability=0.9), dispersions=None)
    made = replace(made, spacecraft=certain)
    assert codes(verdict_notes(planning.judge(made), made))[:2] == ["probability-without-tolerances", "no-tolerances"]


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
