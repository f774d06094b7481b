"""The decision: margins and verdicts follow from the numbers of plan and cases, and read the same everywhere."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cases import deep
from support.golden import check_text
from support.markup import parsed
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
from nutdamp.planning import plan
from nutdamp.presentation import decisions, verdicts
from nutdamp.schedule import Schedule
from nutdamp.schemes import CLASSIC
from nutdamp.spacecraft import Goal, Inertia, Keep, Requirement, Spacecraft


@cache
def example() -> Comparison:
    return compare(nutdamp.example(), CLASSIC)


def counted(share: float, nutation: float, shift: float = 0.1) -> Cases:
    """Cases of which ``share`` comply, with what 99.7 % do not exceed, in degrees."""
    levels = {Part.NUTATION: math.radians(nutation), Part.SHIFT: math.radians(shift)}
    return Cases(1000, 7, share, 0.997, levels)


def decided_of(body: Spacecraft, *schemes: str) -> Decision:
    found = decide(compare(body, schemes or CLASSIC))
    assert found is not None
    return found


def test_a_margin_is_what_may_be_left_minus_what_is() -> None:
    one = example()["four-pulse"]
    assert one.flown is not None
    nominal = {line.bound.part: line for line in Decision(one).lines}
    assert nominal[Part.SHIFT].margin == math.radians(0.2) - one.flown.momentum_shift
    assert nominal[Part.SHIFT].dispersed is None
    dispersed = {line.bound.part: line for line in Decision(one, counted(0.7, 0.9, 0.15)).lines}
    assert math.degrees(dispersed[Part.NUTATION].margin) == pytest.approx(0.5 - 0.9)
    assert math.degrees(dispersed[Part.SHIFT].margin) == pytest.approx(0.2 - 0.15)
    assert (dispersed[Part.NUTATION].met, dispersed[Part.SHIFT].met) == (False, True)


@pytest.mark.parametrize(
    ("scheme", "cases", "met", "lines", "key"),
    [
        ("two-pulse", counted(0.998, 0.4), True, [True, True], "met"),
        ("two-pulse", counted(0.997, 0.5), True, [True, True], "just"),
        ("two-pulse", counted(0.996, 0.6), False, [False, True], "share"),
        ("two-pulse", counted(0.996, 0.4), False, [True, True], "together"),  # each part alone would do
        ("one-pulse", counted(0.999, 0.1), False, [True, False], "nominal"),  # it misses nominally, whatever the cases
        ("two-pulse", None, True, [True, True], "not-flown"),
    ],
)
def test_the_share_of_cases_decides_where_nominal_values_comply(
    scheme: str, cases: Cases | None, met: bool, lines: list[bool], key: str
) -> None:
    decided = Decision(example()[scheme], cases)
    assert decided.met is met
    assert [line.met for line in decided.lines] == lines
    check_text(f"plan.verdict-{key}", decisions.verdict(decided))


def test_one_part_says_what_the_count_says_though_the_percentile_lies_between_two_cases() -> None:
    body = replace(nutdamp.example(), requirement=Requirement(nutation=math.radians(0.5)))
    for share, level in ((0.9969, 0.4999), (0.9971, 0.5001)):
        decided = Decision(replace(example()["two-pulse"], spacecraft=body), counted(share, level))
        assert [line.met for line in decided.lines if line.bound.required] == [decided.met]
        assert decided.met is (share > 0.997)


def test_without_dispersions_no_cases_are_missed() -> None:
    one = example()["two-pulse"]
    sure = Decision(replace(one, spacecraft=replace(one.spacecraft, dispersions=None)))
    assert (Decision(one).undispersed, sure.undispersed) == (True, False)
    check_text("plan.verdict-sure", decisions.verdict(sure))


@pytest.mark.parametrize("target", [None, deep(10.0)])
def test_where_nothing_is_required_the_verdict_does_not_say_met(target: float | None) -> None:
    body = replace(nutdamp.example(), requirement=None, dispersions=None)
    body = body if target is None else replace(body, goal=Goal(axis=body.direction_in_n(math.radians(target), 0.0)))
    decided = decided_of(body, "two-pulse" if target is None else "half-cone")
    assert decided.met is None
    assert {line.bound.required for line in decided.lines} == {False}
    check_text(f"plan.verdict-of-{'nutation' if target is None else 'target'}", decisions.verdict(decided))


def test_the_levels_are_those_of_the_cases() -> None:
    one = example()["two-pulse"]
    results = fly(Results(study_of(one.spacecraft, one.pulses), 500))
    found = cases_of(results)
    assert results.values is not None
    for row, part in ((0, Part.NUTATION), (1, Part.SHIFT)):
        assert found.levels[part] == np.quantile(results.values[row], 0.997)
    kept = (results.values[0] <= math.radians(0.5)) & (results.values[1] <= math.radians(0.2))
    assert (found.complying, found.samples) == (kept.mean(), 500)


def test_schemes_that_comply_more_often_are_named() -> None:
    shares = {"one-pulse": 0.1, "two-pulse": 0.856, "four-pulse": 0.714}
    four, two = (
        Decision(example()[f"{name}-pulse"], counted(shares[f"{name}-pulse"], 0.9), shares) for name in ("four", "two")
    )
    assert (four.better, two.better) == ((("two-pulse", 0.856),), ())
    check_text("plan.better", decisions.better(four))
    assert decisions.better(two) == ""


STAGE = nutdamp.example("upper-stage")
OBLATE = Inertia((4200.0, 4200.0, 5000.0))


def idle(body: Spacecraft, degrees: float, t: float) -> float:
    """Degrees that ``degrees`` of nutation come to in ``t`` s without a pulse, by a flight."""
    slope = math.tan(math.radians(degrees)) / math.tan(body.nutation)
    left = replace(body, omega0=np.array([*(slope * body.omega0[:2]), body.omega0[2]]))
    return math.degrees(seen_at(by_impulses(left, Schedule(()), t), t).final.nutation)


def test_nutation_that_grows_is_said_to_keep_the_requirement_for_a_while() -> None:
    """Before any pulse and again after the last one; the times end where a flight without pulses says."""
    decided = decided_of(STAGE)
    wide = replace(decided, cases=replace(counted(1.0, 0.54), probability=0.99))
    before, after, loop = decisions.notes(wide)
    assert [before, loop] == list(decisions.notes(decided))
    assert list(decisions.notes(decided, looped=True)) == []
    check_text("plan.grows", "\n".join((before, after, loop)))  # with the two times that follow
    assert idle(STAGE, 1.0, 62.41) == pytest.approx(2.0, rel=1e-4)
    assert idle(STAGE, 0.54, 117.87) == pytest.approx(2.0, rel=1e-3)


def test_nutation_that_decays_is_said_to_meet_the_requirement_by_itself_from_then_on() -> None:
    """An oblate body damps itself; the time is where a flight without pulses leaves just what is required."""
    body = replace(STAGE, inertia=OBLATE, omega0=np.array([5.0, 5.0, 1.0]) * STAGE.omega0, loop=None)
    body = replace(body, requirement=Requirement(nutation=math.radians(0.5)))
    (said,) = decisions.notes(decided_of(body))
    check_text("plan.decays", said)
    after = re.search(r"from (\S+) s", said)
    assert after
    assert idle(body, math.degrees(body.nutation), float(after[1])) == pytest.approx(0.5, rel=1e-3)


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
    assert list(decisions.notes(Decision(plan(replace(STAGE, loop=None, **change), "two-pulse")))) == []


def watched(least: float) -> Spacecraft:
    """The example, whose spin axis must stay ``least`` degrees from a star that is 20° from H."""
    body = nutdamp.example()
    return replace(body, keep=(Keep("star", body.direction_in_n(math.radians(20.0), 1.0), math.radians(least)),))


def test_a_cone_that_is_broken_is_not_met_whatever_is_left() -> None:
    kept, broken = (decided_of(watched(least)) for least in (10.0, 16.0))
    assert (kept.met, broken.met, broken.nominal) == (True, False, True)
    assert (kept.plan.meets_requirement, broken.plan.meets_requirement, broken.plan.ends_well) == (True, False, True)
    (found,) = broken.strays
    assert math.degrees(found.least) < 16.0
    flown = Decision(broken.plan, counted(0.714, 0.9))  # cones count in each case; the row is of nominal values
    last = [
        [str(list(column.cells)[-1 if one is broken else -2]) for column in decisions.decision_table(one).columns]
        for one in (broken, flown)
    ]
    check_text("plan.cone", "\n".join((decisions.verdict(broken), *(" | ".join(row) for row in last))))
    assert f"{math.degrees(found.least) - 16.0:.4g} deg" in last[0]
    assert Decision(replace(broken.plan, spacecraft=replace(watched(16.0), requirement=None))).met is False


def test_the_warning_names_the_plans_that_keep_the_cones() -> None:
    """One-pulse leaves the axis where it no longer passes the star, but shifts H by more than is required."""
    star = nutdamp.example().direction_in_n(math.radians(8.0), math.radians(210.0))
    body = replace(nutdamp.example(), keep=(Keep("star", star, math.radians(5.2)),))
    compared = compare(body, CLASSIC)
    assert [one.kept for one in compared] == [True, False, False]
    alone = Comparison(body, (compared["two-pulse"],))
    beside = [verdicts.warnings(one, beside_verdict=True)[0] for one in (compared, alone)]
    check_text("plan.cones", "\n".join((verdicts.reason(compared), *verdicts.warnings(compared), *beside)))


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


def test_a_broken_cone_is_on_every_screen_and_in_every_file(run: Run, tmp_path: Path) -> None:
    done = run("plan", *TWO, "--json", "plan.json", stdin=FILE, columns=200)
    flown = run("simulate", *TWO, "--json", "flown.json", stdin=FILE, columns=200)
    for shown, file in ((done, "plan.json"), (flown, "flown.json")):
        found = json.loads((tmp_path / file).read_text("utf-8"))["decision"]
        assert [found["met"], *(one["kept"] for one in found["aspects"])] == [False, False, True]
        assert shown.returncode == 4
        assert f"\nRequirement {found['verdict']}.\n" in shown.stdout
    row = next(line for line in done.stdout.splitlines() if line.startswith("axis from star"))
    check_text("plan.cone-screen", f"{found['verdict']}\n{row}")
    early = json.loads(run("simulate", *TWO, "--until", "1ms", "--json", "-", stdin=FILE).stdout)["decision"]
    assert [early["met"], *(one["kept"] for one in early["aspects"])] == [False, True, True]
    assert early["requirement"][0]["nominal_deg"] == pytest.approx(2.0, abs=0.1)


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_a_broken_cone_is_on_the_page(run: Run, tmp_path: Path) -> None:
    assert run("report", *TWO, "-o", "page.html", stdin=FILE).returncode == 4
    text = parsed((tmp_path / "page.html").read_text("utf-8")).text.replace("\N{NO-BREAK SPACE}", " ")
    assert "requirementNOT met" in text
    assert "axis from star1.956" in text


def test_nothing_feasible_leaves_nothing_to_decide() -> None:
    assert decide(nutdamp.compare(nutdamp.example().with_(limits={"horizon": "1 ms"}), ["two-pulse"])) is None


def test_json_and_the_table_of_schemes_say_what_the_screen_has_on_top(run: Run, tmp_path: Path) -> None:
    schemes = [part for name in ("two-pulse", "four-pulse") for part in ("--scheme", name)]
    done = run("plan", "-q", *schemes, "--table", "schemes.csv", "--json", "plan.json", columns=80)
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    content = json.loads((tmp_path / "plan.json").read_text("utf-8"))
    found, plans = content["decision"], content["plans"]
    assert (found["scheme"], found["met"], found["cases"], found["better"]) == ("four-pulse", True, None, [])
    assert (lines[0], lines[3]) == ("Sounder-1", f"Requirement {found['verdict']}.")
    assert max(map(len, lines)) <= 80
    assert any(line.startswith("shift of H   ≤ 0.2 deg") and line.endswith("met") for line in lines[:12])
    shift = found["requirement"][1]
    assert shift["margin_deg"] == pytest.approx(shift["limit_deg"] - shift["nominal_deg"])
    assert found["final"]["spin_rad_s"] == pytest.approx(math.pi)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "schemes.csv").read_text("utf-8"))))
    for row, one in zip(rows, plans, strict=True):
        told = (row["scheme"], row["recommended"], row["meets_requirement"], row["met_fraction"])
        yes = [str(value).lower() for value in (one["scheme"] == "four-pulse", one["meets_requirement"])]
        assert told == (one["scheme"], *yes, "")
        assert (int(row["pulses"]), float(row["propellant_kg"])) == (len(one["pulses"]), one["propellant_kg"])
        assert float(row["momentum_shift_deg"]) == one["flown"]["momentum_shift_deg"]
        assert float(row["axis_tilt_deg"]) == one["final"]["axis"]["tilt_deg"]


@pytest.mark.deep
def test_the_table_of_schemes_has_the_cases_that_comply_and_what_is_infeasible(run: Run) -> None:
    schemes = [part for name in ("two-pulse", "four-pulse") for part in ("--scheme", name)]
    done = run("plan", "-q", "--robust", "--table", "-", *schemes, "--set", "limits.horizon=4s")
    rows = list(csv.DictReader(io.StringIO(done.stdout)))
    assert {row["feasible"] for row in rows} == {"true", "false"}
    for row in rows:
        assert bool(row["why"]) == (not row["end_s"]) == (row["feasible"] == "false")
        assert row["feasible"] == "false" or 0.0 <= float(row["met_fraction"]) <= 1.0


def test_the_comparison_has_rows_in_python() -> None:
    rows = example().to_numpy()
    assert rows["scheme"].tolist() == list(CLASSIC)
    assert rows["end_s"].tolist() == [one.end for one in example()]
    assert rows["recommended"].tolist().count("true") == 1
