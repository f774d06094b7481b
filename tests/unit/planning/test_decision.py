"""The decision: margins and verdicts follow from the numbers of plan and cases, and read the same everywhere."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.builders import codes, one_of
from support.golden import check_text
from support.markup import parsed
from support.places import case
from support.process import Run

import nutdamp
from nutdamp.flight.end_state import seen_at
from nutdamp.flight.propagation import by_impulses
from nutdamp.montecarlo.study import Results, study_of
from nutdamp.montecarlo.study import run as fly
from nutdamp.planning.decision import Comparison, Decision, compare, decide
from nutdamp.planning.notes import comparison_warnings, decision_notes, reasons
from nutdamp.planning.plan import Plan, Share, plan
from nutdamp.planning.screening import Cases, PlanCandidate, cases_of
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.spacecraft.model import Goal, Inertia, Keep, Requirement, Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import Pulse, Schedule
from nutdamp.views import decisions


@cache
def example() -> Comparison:
    return compare(nutdamp.example(), CLASSIC, samples=0)


def counted(share: float, nutation: float, shift: float = 0.1, probability: float = 0.997) -> Cases:
    """Cases of which ``share`` comply, with what 99.7 % do not exceed, in degrees."""
    levels = {Part.NUTATION: math.radians(nutation), Part.SHIFT: math.radians(shift)}
    return Cases(1000, 1000, 7, share, probability, levels)


def met_lines(decided: Decision) -> list[bool | None]:
    return [line.met for line in decided.lines]


def test_a_margin_is_what_may_be_left_minus_what_is() -> None:
    one = example()["four-pulse"]
    assert one.flown is not None
    nominal, dispersed = (
        {line.bound.part: line for line in Decision(one, cases).lines} for cases in (None, counted(0.7, 0.9, 0.15))
    )
    assert nominal[Part.SHIFT].margin == math.radians(0.2) - one.flown.momentum_shift
    assert nominal[Part.SHIFT].dispersed is None
    assert math.degrees(dispersed[Part.NUTATION].margin) == pytest.approx(0.5 - 0.9)
    assert math.degrees(dispersed[Part.SHIFT].margin) == pytest.approx(0.2 - 0.15)
    assert (dispersed[Part.NUTATION].met, dispersed[Part.SHIFT].met) == (False, True)


def test_the_share_of_cases_decides_where_nominal_values_comply() -> None:
    lines = []
    for scheme, cases, met, parts in (
        ("two-pulse", counted(0.998, 0.4), True, [True, True]),
        ("two-pulse", counted(0.997, 0.5), True, [True, True]),
        ("two-pulse", counted(0.996, 0.6), False, [False, True]),
        ("two-pulse", counted(0.996, 0.4), False, [True, True]),  # each part alone would do
        ("one-pulse", counted(0.999, 0.1), False, [True, False]),  # it misses nominally, whatever the cases
        ("two-pulse", None, True, [True, True]),  # not flown
    ):
        decided = Decision(example()[scheme], cases)
        assert (decided.met, met_lines(decided)) == (met, parts)
        lines.append(decisions.verdict(decided))
    one = example()["two-pulse"]
    sure = Decision(replace(one, spacecraft=replace(one.spacecraft, dispersions=None)))
    assert (Decision(one).undispersed, sure.undispersed) == (True, False)
    free = nutdamp.example().replace(requirement=None, dispersions=None)
    idle = decided_of(free, "two-pulse")
    pointed = Decision(replace(one, spacecraft=replace(free, goal=Goal(axis=free.direction_in_n(1e-9, 0.0)))))
    for decided in (idle, pointed):  # where nothing is required the verdict does not say met
        assert (decided.met, {line.bound.required for line in decided.lines}) == (None, {False})
    lines += [decisions.verdict(decided) for decided in (sure, idle, pointed)]
    check_text("plan.verdicts", "\n".join(lines))


def test_one_part_says_what_the_count_says_though_the_percentile_lies_between_two_cases() -> None:
    body = replace(nutdamp.example(), requirement=Requirement(nutation=math.radians(0.5)))
    for share, level in ((0.9969, 0.4999), (0.9971, 0.5001)):
        decided = Decision(replace(example()["two-pulse"], spacecraft=body), counted(share, level))
        assert [line.met for line in decided.lines if line.bound.required] == [decided.met] == [share > 0.997]


def test_the_levels_are_those_of_the_cases() -> None:
    one = example()["two-pulse"]
    results = fly(Results(study_of(one.spacecraft, one.pulses), 500))
    cases, values = cases_of(results), results.values
    assert values is not None
    expected = [np.quantile(values[row], 0.997) for row in (0, 1)]
    assert [cases.levels[part] for part in (Part.NUTATION, Part.SHIFT)] == expected
    kept = (values[0] <= math.radians(0.5)) & (values[1] <= math.radians(0.2))
    assert (cases.complying, cases.samples) == (kept.mean(), 500)


def with_cases(scheme: str, cases: Cases | None) -> Comparison:
    """The comparison of one scheme, where cases decide; None: they cannot be flown."""
    one, flown = example()[scheme], dict[Plan, PlanCandidate]()
    if cases is not None:
        known = cases.decided and cases.complying is not None
        flown[one] = PlanCandidate(one, "", cases)
        low, high = (cases.complying or 0.0,) * 2 if known else (0.9, 1.0)
        flown[one].share = Share(low, high, cases.probability)
    return Comparison(example().spacecraft, (one,), flown)


def test_the_recommended_plan_is_decided_by_its_own_cases_once_all_have_flown() -> None:
    half = replace(counted(0.999, 0.4), samples=500)
    lines = []
    for scheme, cases, met, unknown in (
        ("two-pulse", counted(0.998, 0.4), True, False),
        ("two-pulse", counted(0.996, 0.6), False, False),
        ("two-pulse", half, False, True),
        ("two-pulse", None, False, True),
        ("one-pulse", counted(0.999, 0.1), False, False),  # it misses nominally
        ("one-pulse", half, False, True),
    ):
        compared = with_cases(scheme, cases)
        decided = decide(compared)
        assert decided is not None
        assert (decided.met, decided.unknown, decided.undispersed) == (met, unknown, False)
        assert decided.cases is (None if unknown else cases)
        assert compared.meets(compared.plans[0]) is met
        lines.append(decisions.verdict(decided))
    check_text("plan.verdicts-by-cases", "\n".join(lines))
    assert (half.decided, half.met, replace(half, samples=1000).decided) == (False, True, True)
    none = decide(example())
    assert none is not None
    assert (none.met, none.unknown, none.cases, none.undispersed) == (True, False, None, True)


def test_what_a_plan_does_to_axis_and_spin_that_nothing_asks_for_is_noted() -> None:
    """Beyond 0.1° and a digit of the spin shown; not where the shift is limited, or target or spin are asked for."""
    free = nutdamp.example().replace(requirement=Requirement(nutation=math.radians(0.5)))
    turning, steady = (Decision(plan(free, scheme)) for scheme in ("one-pulse", "two-pulse"))
    assert turning.flight.residual.momentum_shift > math.radians(0.1) > steady.flight.residual.momentum_shift
    body = turning.plan.spacecraft
    goal = replace(turning.plan, spacecraft=replace(body, goal=Goal(axis=body.direction_in_n(0.1, 0.0))))
    judged = (turning, steady, Decision(goal), Decision(example()["one-pulse"]))
    assert [one for one in judged if "momentum-shift" in codes(decision_notes(one))] == [turning]
    shift = one_of(decision_notes(turning), "momentum-shift")["momentum_shift_deg"]
    assert shift == math.degrees(turning.flight.residual.momentum_shift)
    up = nutdamp.load(case("genesis-spinup.yaml"))
    for share, change in ((5e-5, False), (8e-5, True), (-8e-5, True)):
        fired = Pulse(1.0, 0.0, "T", np.array([0.0, 0.0, share * up.spin * up.inertia.C]))
        for asked in (False, True):
            aimed = replace(up, goal=Goal(spin=up.spin * (1.0 + share)) if asked else Goal())
            made = Decision(Plan(aimed, "trial", Schedule((fired,))))
            assert made.flight.final.spin == pytest.approx(up.spin * (1.0 + share))
            assert ("spin-change" in codes(decision_notes(made))) == (change and not asked)
            if change and not asked:
                values = one_of(decision_notes(made), "spin-change")
                assert values["before_rpm"] == pytest.approx(1.6)
                assert values["after_rpm"] == pytest.approx(1.6 * (1.0 + share))
                assert values["cause"] == f"T {1.6 * share:+.3g} rpm"


STAGE = nutdamp.example("upper-stage")
OBLATE = Inertia((4200.0, 4200.0, 5000.0))


def decided_of(body: Spacecraft, *schemes: str) -> Decision:
    decision = decide(compare(body, schemes or CLASSIC, samples=0))
    assert decision is not None
    return decision


def idle(body: Spacecraft, degrees: float, t: float) -> float:
    """Degrees that ``degrees`` of nutation come to in ``t`` s without a pulse, by a flight."""
    slope = math.tan(math.radians(degrees)) / math.tan(body.nutation)
    left = replace(body, omega0=np.array([*(slope * body.omega0[:2]), body.omega0[2]]))
    return math.degrees(seen_at(by_impulses(left, Schedule(()), t), t).final.nutation)


def test_nutation_that_grows_or_decays_is_said_to_keep_the_requirement_for_a_while_or_from_when_on() -> None:
    """Before any pulse and again after the last one; the times end where a flight without pulses says."""
    decided = decided_of(STAGE, "two-pulse")
    wide = replace(decided, cases=counted(1.0, 0.54, probability=0.99))
    after, before = (one_of(decision_notes(wide), code) for code in ("grows-again-in-cases", "met-without-pulse-until"))
    assert codes(decision_notes(decided)) == ["tolerances-not-checked", "met-without-pulse-until", "loop-not-judged"]
    assert codes(decision_notes(decided, looped=True)) == ["tolerances-not-checked"]
    assert [after["left_deg"], after["after_s"]] == pytest.approx([0.54, decided.plan.end])
    for start, lasting in ((1.0, before["until_s"]), (0.54, after["lasting_s"])):
        assert isinstance(lasting, float)
        assert idle(STAGE, start, lasting) == pytest.approx(2.0, rel=1e-4)
    body = replace(STAGE, inertia=OBLATE, omega0=np.array([5.0, 5.0, 1.0]) * STAGE.omega0, loop=None)
    body = replace(body, requirement=Requirement(nutation=math.radians(0.5)))
    decays = one_of(decision_notes(decided_of(body, "two-pulse")), "met-without-pulse-from")
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
    assert set(codes(decision_notes(Decision(plan(body, "two-pulse"))))) <= {"no-tolerances"}


def watched(least: float, tilt: float = 20.0, azimuth: float = math.degrees(1.0)) -> Spacecraft:
    """The example, whose spin axis must stay ``least`` degrees from a star that is ``tilt`` from H."""
    body = nutdamp.example()
    star = body.direction_in_n(math.radians(tilt), math.radians(azimuth))
    return replace(body, keep=(Keep("star", star, math.radians(least)),))


def test_a_cone_that_is_broken_is_not_met_whatever_is_left_and_plans_that_keep_them_are_named() -> None:
    kept, broken = (decided_of(watched(least), "four-pulse") for least in (10.0, 16.0))
    assert (kept.met, broken.met, broken.nominal) == (True, False, True)
    assert (kept.plan.meets_requirement, broken.plan.meets_requirement, broken.plan.ends_well) == (True, False, True)
    (stray,) = broken.strays
    assert math.degrees(stray.least) < 16.0
    flown = Decision(broken.plan, counted(0.714, 0.9))  # cones count in each case; the row is of nominal values
    rows = [decisions.decision_table(one).cells("screen")[-1 if one is broken else -2] for one in (broken, flown)]
    assert f"{math.degrees(stray.least) - 16.0:.4g} deg" in rows[0]
    assert Decision(replace(broken.plan, spacecraft=replace(watched(16.0), requirement=None))).met is False
    # One-pulse leaves the axis where it no longer passes the star, but shifts H by more than is required.
    compared = compare(watched(5.2, 8.0, 210.0), CLASSIC, samples=0)
    assert [one.kept for one in compared] == [True, False, False]
    alone = Comparison(compared.spacecraft, (compared["two-pulse"],))
    assert [one_of(comparison_warnings(one), "plans-keep-cones")["schemes"] for one in (compared, alone)] == [
        "one-pulse",
        "none",
    ]
    assert "cone-broken" in codes(comparison_warnings(compared))
    assert "cone-broken" not in codes(comparison_warnings(compared, tabulated=True))
    assert codes(reasons(compared)) == ["cheapest-at-end"]
    check_text("plan.cones", "\n".join([decisions.verdict(broken), *(" | ".join(row) for row in rows)]))


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
BOTH = ("plan", "-v", "-q", "--scheme", "two-pulse", "--scheme", "four-pulse")


def test_a_broken_cone_is_on_every_screen_and_in_every_file(run: Run, tmp_path: Path) -> None:
    shown = {
        name: run(name, *TWO, *["-v"] * (name == "plan"), "--json", f"{name}.json", stdin=FILE, columns=200)
        for name in ("plan", "simulate")
    }
    for name, done in shown.items():
        decision = json.loads((tmp_path / f"{name}.json").read_text("utf-8"))["decision"]
        assert [decision["met"], *(one["kept"] for one in decision["aspects"])] == [False, False, True]
        assert done.returncode == 4
        assert f"\nRequirement {decision['verdict']}.\n" in done.stdout
    row = next(line for line in shown["plan"].stdout.splitlines() if line.startswith("axis from star"))
    check_text("plan.cone-screen", f"{decision['verdict']}\n{row}")
    early = json.loads(run("simulate", *TWO, "--until", "1ms", "--json", "-", stdin=FILE).stdout)["decision"]
    assert [early["met"], *(one["kept"] for one in early["aspects"])] == [False, True, True]
    assert early["requirement"][0]["nominal_deg"] == pytest.approx(2.0, abs=0.1)


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_a_broken_cone_is_on_the_page(run: Run, tmp_path: Path) -> None:
    assert run("report", *TWO, "-o", "page.html", stdin=FILE).returncode == 4
    text = parsed((tmp_path / "page.html").read_text("utf-8")).text.replace("\N{NO-BREAK SPACE}", " ")
    assert "NOT ENOUGH: " in text
    assert "axis from star" in text
    assert "nominal 1.956 deg" in text


def csv_rows(text: str) -> Iterator[dict[str, str]]:
    return iter(csv.DictReader(io.StringIO(text)))


def test_json_and_the_table_of_schemes_say_what_the_screen_has_on_top(run: Run, tmp_path: Path) -> None:
    done = run(*BOTH, "--nominal", "--table", "schemes.csv", "--json", "plan.json", columns=80)
    lines, content = done.stdout.splitlines(), json.loads((tmp_path / "plan.json").read_text("utf-8"))
    decision, shift = content["decision"], content["decision"]["requirement"][1]
    told = (decision["scheme"], decision["met"], decision["cases"])
    assert (done.returncode, *told) == (0, "four-pulse", True, None)
    assert (lines[0], lines[2]) == ("Sounder-1", f"Requirement {decision['verdict']}.")
    assert max(map(len, lines)) <= 80
    assert any(line.startswith("momentum shift  ≤ 0.2 deg") and line.endswith("met") for line in lines[:16])
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
def test_the_table_of_schemes_has_the_cases_that_comply_and_what_is_infeasible(run: Run) -> None:
    rows = list(csv_rows(run(*BOTH, "--robust", "--table", "-", "--set", "limits.horizon=4s").stdout))
    assert {row["feasible"] for row in rows} == {"true", "false"}
    for row in rows:
        assert bool(row["why"]) == (not row["end_s"]) == (row["feasible"] == "false")
        assert row["feasible"] == "false" or 0.0 <= float(row["met_fraction"]) <= 1.0


@pytest.mark.deep
def test_the_table_of_schemes_goes_by_the_cases_and_has_the_share_where_all_have_flown(run: Run) -> None:
    done = run(*BOTH, "--table", "-", "--json", "plan.json")
    two, four = csv_rows(done.stdout)
    assert done.returncode == 0
    assert [(row["recommended"], row["meets_requirement"]) for row in (two, four)] == [("true", "true"), ("false",) * 2]
    assert float(two["met_fraction"]) == pytest.approx(0.99995, abs=1e-4)
    assert four["met_fraction"] == ""


def test_the_comparison_has_rows_in_python_and_nothing_feasible_leaves_nothing_to_decide() -> None:
    rows = example().to_numpy()
    assert rows["scheme"].tolist() == list(CLASSIC)
    assert rows["end_s"].tolist() == [one.end for one in example()]
    assert rows["recommended"].tolist().count("true") == 1
    nothing = nutdamp.compare(nutdamp.example().with_(limits={"horizon": "1 ms"}), ["two-pulse"])
    assert (decide(nothing), nothing.flown, nothing.shares) == (None, {}, {})
