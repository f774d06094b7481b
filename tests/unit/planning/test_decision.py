"""The decision: margins and verdicts follow from the numbers of plan and cases, and read the same everywhere."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cases import spread
from support.markup import parsed
from support.pages import plain_page
from support.process import Run

import nutdamp
from nutdamp.comparison import Comparison, compare
from nutdamp.compliance import Part
from nutdamp.decision import Cases, Decision, cases_of, decide
from nutdamp.dispersion import study_of
from nutdamp.dispersion.study import Results
from nutdamp.dispersion.study import run as fly
from nutdamp.flight import by_impulses
from nutdamp.outcome import seen_at
from nutdamp.presentation import decisions, verdicts
from nutdamp.schedule import Schedule
from nutdamp.schemes import CLASSIC
from nutdamp.spacecraft import Goal, Inertia, Keep, Requirement, Spacecraft


@cache
def example() -> Comparison:
    return compare(nutdamp.example(), CLASSIC)


def counted(share: float, nutation: float, shift: float) -> Cases:
    """Cases of which ``share`` comply, with what 99.7 % do not exceed, in degrees."""
    levels = {Part.NUTATION: math.radians(nutation), Part.SHIFT: math.radians(shift)}
    return Cases(1000, 7, share, 0.997, levels)


def test_a_margin_is_what_may_be_left_minus_what_is() -> None:
    plan = example()["four-pulse"]
    assert plan.flown is not None
    nominal = {line.bound.part: line for line in Decision(plan).lines}
    assert nominal[Part.SHIFT].margin == math.radians(0.2) - plan.flown.momentum_shift
    assert nominal[Part.SHIFT].dispersed is None
    dispersed = {line.bound.part: line for line in Decision(plan, counted(0.7, 0.9, 0.15)).lines}
    assert math.degrees(dispersed[Part.NUTATION].margin) == pytest.approx(0.5 - 0.9)
    assert math.degrees(dispersed[Part.SHIFT].margin) == pytest.approx(0.2 - 0.15)
    assert (dispersed[Part.NUTATION].met, dispersed[Part.SHIFT].met) == (False, True)


@pytest.mark.parametrize(
    ("share", "nutation", "met", "said"),
    [
        (0.998, 0.4, True, "met: 99.8 % of cases comply (99.7 % required)"),
        (0.996, 0.6, False, "NOT met: 99.6 % of cases comply (99.7 % required)"),
        (0.996, 0.4, False, "NOT met: 99.6 % of cases comply (99.7 % required)"),  # each part alone would do
    ],
)
def test_the_share_of_cases_decides(share: float, nutation: float, met: bool, said: str) -> None:
    decided = Decision(example()["two-pulse"], counted(share, nutation, 0.1))
    assert decided.met is met
    assert decisions.verdict(decided) == said
    if met:
        assert all(line.met for line in decided.lines)


def test_one_part_says_what_the_count_says_though_the_percentile_lies_between_two_cases() -> None:
    body = replace(nutdamp.example(), requirement=Requirement(nutation=math.radians(0.5)))
    for share, level in ((0.9969, 0.4999), (0.9971, 0.5001)):
        decided = Decision(replace(example()["two-pulse"], spacecraft=body), counted(share, level, 0.0))
        assert [line.met for line in decided.lines if line.bound.required] == [decided.met]
        assert decided.met is (share > 0.997)


def test_a_plan_that_misses_nominally_is_not_met_whatever_the_cases() -> None:
    decided = Decision(example()["one-pulse"], counted(0.999, 0.1, 0.1))
    assert decided.met is False
    assert decisions.verdict(decided).startswith("NOT met with nominal values; met: 99.9 %")


def test_without_cases_it_says_that_none_were_flown() -> None:
    plan = example()["two-pulse"]
    assert decisions.verdict(Decision(plan)) == "met with nominal values; dispersed cases were not flown"
    sure = replace(plan, spacecraft=replace(plan.spacecraft, dispersions=None))
    assert decisions.verdict(Decision(sure)) == "met with nominal values"


@spread(
    ("target", "said"),
    [(None, "nutation is damped"), (10.0, "target is reached")],
    quick=1,
)
def test_where_nothing_is_required_the_verdict_does_not_say_met(target: float | None, said: str) -> None:
    body = replace(nutdamp.example(), requirement=None, dispersions=None)
    body = body if target is None else replace(body, goal=Goal(axis=body.direction_in_n(math.radians(target), 0.0)))
    decided = decide(compare(body, ["two-pulse" if target is None else "optimal"]))
    assert decided is not None
    assert decided.met is None
    assert decisions.verdict(decided) == f"nothing is required at the end; with nominal values the {said}"
    assert {line.bound.required for line in decided.lines} == {False}


def test_the_levels_are_those_of_the_cases() -> None:
    plan = example()["two-pulse"]
    results = fly(Results(study_of(plan.spacecraft, plan.pulses), 500))
    found = cases_of(results)
    assert results.values is not None
    for row, part in ((0, Part.NUTATION), (1, Part.SHIFT)):
        assert found.levels[part] == np.quantile(results.values[row], 0.997)
    kept = (results.values[0] <= math.radians(0.5)) & (results.values[1] <= math.radians(0.2))
    assert found.complying == kept.mean()


def test_schemes_that_comply_more_often_are_named() -> None:
    shares = {"one-pulse": 0.1, "two-pulse": 0.856, "four-pulse": 0.714}
    decided = Decision(example()["four-pulse"], counted(0.714, 0.9, 0.1), shares)
    said = "more cases comply with two-pulse (85.6 %) than with four-pulse (71.4 %)."
    assert decisions.better(decided) == said
    assert decisions.better(Decision(example()["two-pulse"], counted(0.856, 0.9, 0.1), shares)) == ""


def test_nutation_that_grows_is_said_to_keep_the_requirement_for_a_while() -> None:
    """Before any pulse and again after the last one; the times end where a flight without pulses says."""
    stage = nutdamp.example("upper-stage")
    decided = decide(compare(stage, CLASSIC))
    assert decided is not None
    before, loop = decisions.notes(decided)
    assert before == (
        "Without a pulse the requirement is met up to 62.41 s: by then the nutation of 1 deg at t = 0 has grown to "
        "2 deg."
    )
    idle = Schedule(())
    assert math.degrees(seen_at(by_impulses(stage, idle, 62.41), 62.41).final.nutation) == pytest.approx(2.0, rel=1e-4)
    assert list(decisions.notes(decided, looped=True)) == []
    assert loop == "The plan is a schedule and is judged without the closed loop of the file (nutdamp loop)."
    wide = replace(decided, cases=replace(counted(1.0, 0.54, 0.1), probability=0.99))
    *_, after, _ = decisions.notes(wide)
    grown = "from 0.54 deg (not exceeded in 99 % of cases) to 2 deg in 117.9 s"
    assert after == f"After the last pulse what is left grows again: {grown}."
    slope = math.tan(math.radians(0.54)) / math.tan(stage.nutation)
    left = replace(stage, omega0=np.array([*(slope * stage.omega0[:2]), stage.omega0[2]]))
    assert math.degrees(seen_at(by_impulses(left, idle, 117.87), 117.87).final.nutation) == pytest.approx(2.0, rel=1e-3)


def test_nutation_that_decays_is_said_to_meet_the_requirement_by_itself_from_then_on() -> None:
    """An oblate body damps itself; the time is where a flight without pulses leaves just what is required."""
    stage = nutdamp.example("upper-stage")
    required = Requirement(nutation=math.radians(0.5))
    fast = np.array([5.0, 5.0, 1.0]) * stage.omega0
    body = replace(stage, inertia=Inertia((4200.0, 4200.0, 5000.0)), omega0=fast, requirement=required, loop=None)
    decided = decide(compare(body, CLASSIC))
    assert decided is not None
    (said,) = decisions.notes(decided)
    start, end = (
        "Without a pulse the requirement is met from ",
        " s on, before this plan ends: by then the nutation of ",
    )
    assert said.startswith(start)
    assert end in said
    after = float(said.removeprefix(start).partition(end)[0])
    left = seen_at(by_impulses(body, Schedule(()), after), after).final.nutation
    assert math.degrees(left) == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize(
    "change",
    [
        {"dissipation": None, "loop": None},
        {"inertia": Inertia((4200.0, 4200.0, 5000.0)), "loop": None},  # oblate: it decays
        {
            "requirement": Requirement(nutation=math.radians(5.0)),
            "loop": None,
        },  # kept up to the horizon
        {"requirement": Requirement(nutation=math.radians(0.5)), "loop": None},  # not kept at t = 0
        {"requirement": None, "loop": None},
        {"keep": (Keep("star", np.array([1.0, 0.0, 0.0]), 0.1),), "loop": None},
    ],
)
def test_where_nothing_grows_beyond_what_is_required_nothing_is_said(change: dict[str, Any]) -> None:
    decided = decide(compare(replace(nutdamp.example("upper-stage"), **change), CLASSIC))
    assert decided is not None
    assert list(decisions.notes(decided)) == []


def watched(least: float, body: Spacecraft | None = None) -> Spacecraft:
    """A body whose spin axis must stay ``least`` degrees from a star that is 20° from H."""
    body = body or nutdamp.example()
    return replace(body, keep=(Keep("star", body.direction_in_n(math.radians(20.0), 1.0), math.radians(least)),))


def test_a_cone_that_is_broken_is_not_met_whatever_is_left() -> None:
    kept, broken = (decide(compare(watched(least), CLASSIC)) for least in (10.0, 16.0))
    assert kept is not None
    assert broken is not None
    assert (kept.met, broken.met) == (True, False)
    assert decisions.verdict(kept) == "met with nominal values; dispersed cases were not flown"
    (found,) = broken.strays
    assert math.degrees(found.least) < 16.0
    said = decisions.verdict(broken)
    assert said.startswith(f"NOT met: the spin axis comes to {math.degrees(found.least):.4g}° from star")
    assert said.endswith("(min = 16°); otherwise met with nominal values; dispersed cases were not flown")
    rows = [[str(cell) for cell in column.cells] for column in decisions.decision_table(broken).columns]
    assert [column[-1] for column in rows] == [
        "axis from star",
        "≥ 16 deg",
        f"{math.degrees(found.least):.4g} deg",
        f"{math.degrees(found.least) - 16.0:.4g} deg",
        "NOT kept",
    ]
    flown = Decision(broken.plan, counted(0.714, 0.9, 0.1))  # cones count in each case; the row is of nominal values
    (verdict_column,) = (list(column.cells) for column in decisions.decision_table(flown).columns[-1:])
    assert str(verdict_column[-2]) == "NOT kept (nominal)"
    nothing_required = Decision(replace(broken.plan, spacecraft=replace(watched(16.0), requirement=None)))
    assert nothing_required.met is False


def test_the_warning_names_the_plans_that_keep_the_cones() -> None:
    """One-pulse leaves the axis where it no longer passes the star, but shifts H by more than is required."""
    star = nutdamp.example().direction_in_n(math.radians(8.0), math.radians(210.0))
    body = replace(nutdamp.example(), keep=(Keep("star", star, math.radians(5.2)),))
    compared = compare(body, CLASSIC)
    assert [plan.kept for plan in compared] == [True, False, False]
    (warning,) = verdicts.warnings(compared)
    assert warning.startswith("The spin axis comes to 5.0")
    assert warning.endswith("from star at 1.79 s (min = 5.2°); one-pulse keeps all cones.")
    assert verdicts.warnings(compared, beside_verdict=True) == ("Plans that keep all cones: one-pulse.",)
    alone = compare(body, ["two-pulse"])
    assert verdicts.warnings(alone, beside_verdict=True) == ("Plans that keep all cones: none.",)
    page = plain_page(compared)
    assert page.verdict.count("the spin axis comes to") == 1
    assert page.verdict.endswith("Plans that keep all cones: one-pulse.")
    assert verdicts.warnings(compare(body, ["one-pulse"]))[0].startswith("one-pulse does not meet the requirement.")
    assert verdicts.reason(compared) == "least propellant of the 2 plans that meet the requirement at the end"


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


@pytest.mark.usefixtures("plain_pages")
def test_a_broken_cone_is_on_every_screen_and_in_every_file(run: Run, tmp_path: Path) -> None:
    done = run("plan", "-q", "-", "--scheme", "two-pulse", "--json", "plan.json", stdin=FILE, columns=200)
    assert done.returncode == 4
    assert "axis from star  ≥ 3.5 deg" in done.stdout
    assert "NOT kept" in done.stdout
    found = json.loads((tmp_path / "plan.json").read_text("utf-8"))
    assert found["decision"]["met"] is False
    assert [one["kept"] for one in found["decision"]["aspects"]] == [False, True]
    assert any("from star" in warning for warning in found["warnings"])
    (verdict,) = (line for line in done.stdout.splitlines() if line.startswith("Requirement "))
    assert verdict == f"Requirement {found['decision']['verdict']}."

    page = run("report", "-q", "-", "--scheme", "two-pulse", "-o", "page.html", stdin=FILE)
    assert page.returncode == 4
    text = parsed((tmp_path / "page.html").read_text("utf-8")).text.replace("\N{NO-BREAK SPACE}", " ")
    assert "requirementNOT met: the spin axis comes to" in text
    assert "axis from star1.956" in text
    assert "at least 3.5 deg and at most 30 deg: NOT kept" in text
    assert "Sun8" in text


def test_simulate_says_whether_the_requirement_is_met(run: Run, tmp_path: Path) -> None:
    done = run("simulate", "-q", "-", "--scheme", "two-pulse", "--json", "a.json", stdin=FILE, columns=200)
    assert done.returncode == 4
    found = json.loads((tmp_path / "a.json").read_text("utf-8"))["decision"]
    assert f"\nRequirement {found['verdict']}.\n" in done.stdout
    assert found["verdict"].startswith("NOT met: the spin axis comes to")
    early = run("simulate", "-q", "-", "--scheme", "two-pulse", "--until", "1ms", "--json", "-", stdin=FILE)
    decided = json.loads(early.stdout)["decision"]
    assert decided["verdict"] == "NOT met with nominal values"  # so soon the axis has not come near the star
    assert decided["requirement"][0]["nominal_deg"] == pytest.approx(2.0, abs=0.1)
    free = run("simulate", "-q", "--scheme", "none", "--set", "requirement.nutation=6 deg", "--set", "keep=[]")
    assert "Requirement met with nominal values; dispersed cases were not flown." in free.stdout


def test_nothing_feasible_leaves_nothing_to_decide() -> None:
    assert decide(nutdamp.compare(nutdamp.example().with_(limits={"horizon": "1 ms"}), ["two-pulse"])) is None


def test_the_screen_has_the_decision_on_top(run: Run) -> None:
    lines = run("plan", "-q", columns=80).stdout.splitlines()
    assert lines[0] == "Sounder-1"
    assert lines[3] == "Requirement met with nominal values; dispersed cases were not flown."
    assert max(map(len, lines)) <= 80
    assert any(line.startswith("shift of H   ≤ 0.2 deg") and line.endswith("met") for line in lines[:12])


def test_json_says_what_the_screen_says(run: Run) -> None:
    found = json.loads(run("plan", "-q", "--scheme", "four-pulse", "--json", "-").stdout)["decision"]
    assert (found["scheme"], found["met"], found["cases"], found["better"]) == ("four-pulse", True, None, [])
    assert found["verdict"] == "met with nominal values; dispersed cases were not flown"
    shift = found["requirement"][1]
    assert shift["margin_deg"] == pytest.approx(shift["limit_deg"] - shift["nominal_deg"])
    assert found["final"]["spin_rad_s"] == pytest.approx(math.pi)


def test_the_table_of_schemes_is_that_of_the_json(run: Run, tmp_path: Path) -> None:
    done = run("plan", "-q", "--table", "schemes.csv", "--json", "plan.json")
    assert done.returncode == 0
    plans = json.loads((tmp_path / "plan.json").read_text("utf-8"))["plans"]
    rows = list(csv.DictReader(io.StringIO((tmp_path / "schemes.csv").read_text("utf-8"))))
    for row, plan in zip(rows, plans, strict=True):
        assert row["scheme"] == plan["scheme"]
        assert row["recommended"] == str(plan["scheme"] == "optimal").lower()
        assert row["meets_requirement"] == str(plan["meets_requirement"]).lower()
        assert int(row["pulses"]) == len(plan["pulses"])
        assert float(row["propellant_kg"]) == plan["propellant_kg"]
        assert float(row["momentum_shift_deg"]) == plan["flown"]["momentum_shift_deg"]
        assert float(row["axis_tilt_deg"]) == plan["final"]["axis"]["tilt_deg"]
        assert row["met_fraction"] == ""


@pytest.mark.deep
def test_the_table_of_schemes_has_the_cases_that_comply_and_what_is_infeasible(run: Run, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(run("init", "-").stdout.replace("max_on_time: 2 s", "max_on_time: 21 ms"))
    done = run("plan", "-q", "--robust", "--table", "-", "a.yaml", "--set", "limits.horizon=9s")
    assert done.returncode == 4
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    assert all(row["why"] and not row["end_s"] for row in rows if row["feasible"] == "false")
    shares = [float(row["met_fraction"]) for row in rows if row["feasible"] == "true"]
    assert shares
    assert all(0.0 <= share <= 1.0 for share in shares)


def test_the_comparison_has_rows_in_python() -> None:
    rows = example().to_numpy()
    assert rows["scheme"].tolist() == list(CLASSIC)
    assert rows["end_s"].tolist() == [plan.end for plan in example()]
    assert rows["recommended"].tolist().count("true") == 1
