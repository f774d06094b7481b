"""The verdict: status, a line for each bound, and causes follow from the numbers of plan and cases."""

from __future__ import annotations

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
from support.builders import BOTH, HALF_A_DEGREE, INFEASIBLE, judged
from support.dispersed import normal
from support.places import case
from support.process import Run

import nutdamp
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.planning.decision import Comparison, compare
from nutdamp.planning.plan import Plan, judge, plan
from nutdamp.planning.verdict import Cases, Light, Status, cases_of
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.spacecraft.model import Keep, Requirement, Spacecraft
from nutdamp.spacecraft.requirements import Part, bounds
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
        verdict = judge(made, None if share is None else within(*share))
        assert [verdict.status, verdict.light, verdict.met] == expected, (required, dispersed, left, share)
    alone = judge(made, nominal=True)  # cases are left out on request
    assert (alone.status, alone.light) == (Status.FLY, Light.AMBER)


def test_where_nothing_fires_nothing_is_to_be_sent() -> None:
    """Whatever can be commanded: what misses the requirement is not enough, all the same."""
    commands = nutdamp.load(case("cbp1004.yaml")).commands
    for left, pulses, timed, status in (
        (0.4, 0, False, Status.NO_PULSE),
        (0.6, 0, False, Status.NOT_ENOUGH),
        (0.4, 1, False, Status.NOT_COMMANDABLE),
        (0.4, 1, True, Status.FLY),
        (0.6, 1, False, Status.NOT_ENOUGH),
    ):
        made = judged("a", left, required=HALF_A_DEGREE, pulses=pulses)
        made = replace(made, spacecraft=replace(made.spacecraft, commands=commands))
        assert judge(made, timed=timed).status is status
    none = judge(INFEASIBLE)
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
    body = replace(nutdamp.load(case("cbp1004.yaml")), dispersions=None)
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


def cases_with(nutation: tuple[float, float], shift: tuple[float, float], made: Plan) -> Cases:
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
        verdict = judge(made, None if cases is None else cases_with(*cases, made))
        for line, cells in zip(verdict.lines, expected, strict=True):
            values = [None if value is None else math.degrees(value) for value in (line.nominal, line.dispersed)]
            assert [*values, line.share, math.degrees(line.margin), line.met] == pytest.approx(cells, abs=1e-12)
        assert verdict.tightest is not None
        assert verdict.tightest.bound.part is tightest
        assert verdict.good is (verdict.status is Status.FLY) is all(line.met for line in verdict.lines)
    free = judge(judged("a", 3.0))
    assert ([line.met for line in free.lines], free.required, free.tightest, free.good) == ([False], (), None, False)


@cache
def example() -> Comparison:
    return compare(nutdamp.example(), CLASSIC, samples=0)


def test_levels_shares_and_interval_are_those_of_the_cases() -> None:
    one = example()["four-pulse"]
    results = run(Results(study_of(one.spacecraft, one.pulses), 500))
    assert results.values is not None
    for final in (True, False):
        cases = cases_of(results, final=final)
        limits = np.radians([0.5, 0.2])
        kept = results.values[:2] <= limits[:, None]
        assert [*cases.levels.values()] == [np.quantile(row, 0.997) for row in results.values[:2]]
        assert [*cases.shares.values()] == [*kept.mean(axis=1)]
        assert (cases.complying, cases.samples, cases.final) == (kept.all(axis=0).mean(), 500, final)
        assert (cases.low, cases.high) == results.interval(certain=not final)
    verdict = judge(one, cases_of(results), results)
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
        verdict = judge(made, cases_with((0.99, 0.6), (0.9, 0.3), made), told)
        assert [cause.input for cause in verdict.causes] == named
    assert judge(made).causes == ()


# --- cones


def watched(least: float, tilt: float = 20.0, azimuth: float = math.degrees(1.0)) -> Spacecraft:
    """The example, whose spin axis must stay ``least`` degrees from a star that is ``tilt`` from H."""
    body = nutdamp.example()
    star = body.direction_in_n(math.radians(tilt), math.radians(azimuth))
    return replace(body, keep=(Keep("star", star, math.radians(least)),))


def test_a_cone_is_a_bound_like_any_other_whatever_is_left_at_the_end() -> None:
    kept, broken = (judge(plan(watched(least), "four-pulse"), nominal=True) for least in (10.0, 16.0))
    assert [verdict.status for verdict in (kept, broken)] == [Status.FLY, Status.NOT_ENOUGH]
    (aspect,), line = broken.aspects, broken.lines[-1]
    assert (line.bound.part, line.bound.keep, line.bound.inner, line.met) == (Part.CONE, aspect.keep, True, False)
    assert (line.nominal, line.margin) == (aspect.least, aspect.least - math.radians(16.0))
    four = plan(watched(16.0), "four-pulse")
    assert (four.meets_requirement, four.ends_well, broken.tightest) == (False, True, line)
    assert judge(replace(four, spacecraft=replace(watched(16.0), requirement=None))).status is Status.NOT_ENOUGH


def test_the_cone_about_h_bounds_the_nutation_on_the_way() -> None:
    for most, status in ((5.5, Status.FLY), (4.5, Status.NOT_ENOUGH)):  # it begins with 5°
        body = replace(nutdamp.example(), keep=(Keep("H", None, most=math.radians(most)),), dispersions=None)
        verdict = plan(body, "two-pulse").verdict
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
    body = nutdamp.load(case("rim-spin-up.yaml")).with_(goal={"spin": "20 rpm"})
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
