"""What is recommended, and the exit status: dispersed cases, command blocks, needless pulses, spin changes, free H."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from support.golden import check_text
from support.places import case
from support.process import Run

import nutdamp
from nutdamp.common import work
from nutdamp.files.reader import example_text
from nutdamp.planning.decision import Comparison

LOOSE = "dispersions.A={normal: 1 %}"
"""A tolerance of the built-in example with which no plan compared complies in enough cases."""

QUICK = ("--scheme", "two-pulse", "--scheme", "four-pulse")


def planned(run: Run, *arguments: str, status: int = 0) -> dict[str, Any]:
    """The JSON of ``plan``."""
    ended = run("plan", "--json", "-", *arguments)
    assert ended.returncode == status, ended.stderr
    found: dict[str, Any] = json.loads(ended.stdout)
    found["by scheme"] = {one["scheme"]: one for one in found["plans"]}
    return found


def test_dispersed_cases_decide_unless_nominal_values_shall(run: Run) -> None:
    found = planned(run, *QUICK)
    assert found["recommended"] == "two-pulse"
    two, four = found["by scheme"]["two-pulse"], found["by scheme"]["four-pulse"]
    assert two["meets_requirement"] is True
    assert four["meets_requirement"] is False
    assert four["cases"]["samples"] == 2_048  # it was flown no further than it took to know
    assert four["cases"]["high"] < 0.997
    assert two["cases"]["samples"] == 20_000
    nominal = planned(run, *QUICK, "--nominal")
    assert nominal["recommended"] == "four-pulse"
    assert "cases" not in nominal["by scheme"]["four-pulse"]


def test_the_share_is_the_same_on_every_screen(run: Run) -> None:
    share = planned(run, *QUICK)["decision"]["cases"]["met_fraction"]
    assert json.loads(run("disperse", "--scheme", "two-pulse", "-q", "--json", "-").stdout)["requirement"][
        "met_fraction"
    ] == pytest.approx(share)


@pytest.mark.deep
def test_a_robust_plan_is_compared_by_the_same_cases(run: Run) -> None:
    share = planned(run, "--scheme", "two-pulse")["decision"]["cases"]["met_fraction"]
    robust = planned(run, "--scheme", "two-pulse", "--robust")["robust"]
    assert robust["against"]["met_fraction"] == pytest.approx(share)


def test_no_plan_complies_often_enough(run: Run) -> None:
    ended = run("plan", *QUICK, "--set", LOOSE)
    assert (ended.returncode, "warning[too-few-cases]: " in ended.stdout) == (4, True)
    assert run("plan", *QUICK, "--set", LOOSE, "--nominal").returncode == 0


def test_an_undecided_share_does_not_meet(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work, "CASES", 1.0)
    found = planned(run, "--scheme", "two-pulse", status=4)
    assert (found["decision"]["status"], found["decision"]["met"]) == ("not-shown", False)


def test_no_requirement_no_cases(run: Run) -> None:
    text = example_text().replace("\nrequirement:", "\n# requirement:")
    ended = run("plan", "-", *QUICK, "--json", "-", stdin=text)
    assert json.loads(ended.stdout)["decision"]["cases"] is None


def test_no_pulse_where_none_is_needed(run: Run) -> None:
    found = planned(run, "--set", "state.nutation=0.2 deg")
    assert found["recommended"] == "none"
    assert found["no_pulse_needed"] is True
    assert found["by scheme"]["none"]["pulses"] == []
    written = run("plan", "--set", "state.nutation=0.2 deg", "--csv", "-")
    assert written.returncode == 0
    assert len(written.stdout.splitlines()) == 1
    # With tolerances that need pulses it is not.
    assert planned(run, "--set", "state.nutation=0.49 deg")["recommended"] != "none"


def test_a_spacecraft_with_commands_fires_command_blocks(run: Run) -> None:
    body = str(case("cbp1004.yaml"))
    schemes = ("--scheme", "command-block", "--scheme", "two-pulse")
    found = planned(run, body, *schemes)
    assert found["recommended"] == "command-block"
    assert found["by scheme"]["two-pulse"]["can_be_commanded"] is False
    assert found["by scheme"]["two-pulse"]["propellant_kg"] < found["by scheme"]["command-block"]["propellant_kg"]
    assert {each["code"] for each in found["decision"]["cheaper"]} == {"why-single-pulses"}
    assert planned(run, body, *schemes, "--timed")["recommended"] == "two-pulse"
    named = planned(run, body, "--scheme", "two-pulse", status=4)
    assert (named["recommended"], named["decision"]["status"]) == ("two-pulse", "not-commandable")
    assert "CANNOT BE COMMANDED" in run("plan", body, "--scheme", "two-pulse").stdout


def test_no_plan_can_be_commanded() -> None:
    body = nutdamp.load(case("cbp1004.yaml"))
    compared = Comparison(body, (nutdamp.plan(body, "two-pulse"),))
    assert compared.recommended is None
    check_text("decision.none-commanded", compared.reason)
    assert replace(compared, timed=True).recommended is compared.plans[0]
    assert replace(compared, named=True).recommended is compared.plans[0]


@pytest.mark.deep
@pytest.mark.parametrize(
    ("name", "settings", "most_g"),
    [
        ("cb5030", (), 0.2741),
        ("cb5030", ("--set", "commands.max_count=2"), 0.2368),
        ("cb1015", (), 0.05),
        ("cbp1004", (), 6.30),
        ("cbp1115", (), 3.25),
    ],
)
def test_the_cheapest_blocks(run: Run, name: str, settings: tuple[str, ...], most_g: float) -> None:
    plan = planned(run, str(case(f"{name}.yaml")), "--scheme", "command-block", *settings)["plans"][0]
    assert plan["meets_requirement"] is True
    assert 1e3 * plan["propellant_kg"] <= most_g


def test_the_axis_is_kept_where_something_asks_for_it(run: Run) -> None:
    free = planned(run, "--scheme", "optimal", "--nominal", "--set", "requirement={nutation: 0.5 deg}")["plans"][0]
    kept = planned(run, "--scheme", "optimal", "--nominal")["plans"][0]
    assert free["bounds"]["keeping"] == pytest.approx(kept["bounds"]["first_order"], rel=1e-6)
    assert kept["bounds"]["keeping"] is None
    assert kept["flown"]["momentum_shift_deg"] < 0.2
    freed = planned(run, "--scheme", "optimal", "--nominal", "--free-axis")["plans"][0]
    assert freed["propellant_kg"] <= kept["propellant_kg"] * 1.001


@pytest.mark.deep
@pytest.mark.parametrize("least", ["propellant", "pulses", "time"])
def test_what_the_requirement_allows_is_left_where_the_spin_changes(run: Run, least: str) -> None:
    asked = ("--spin", "10rpm", "--scheme", "optimal", "--least", least)
    plan = planned(run, str(case("genesis-spinup.yaml")), *asked)["plans"][0]
    assert [pulse["channel"] for pulse in plan["pulses"]] == ["UP"]
    assert plan["meets_requirement"] is True


@pytest.mark.deep
def test_command_blocks_set_the_spin(run: Run) -> None:
    found = planned(run, str(case("isee3-spinup.yaml")), "--spin", "19.733rpm")
    assert found["recommended"] == "command-block"
    assert all(found["by scheme"][name]["meets_requirement"] for name in ("command-block", "optimal"))


@pytest.mark.parametrize(("name", "more"), [("tail_pulse", ("--at", "60s")), ("fit-dead-gyro", ())])
def test_motion_is_no_outlier_and_a_stuck_gyro_no_motion(run: Run, name: str, more: tuple[str, ...]) -> None:
    ended = run("fit", str(case(f"{name}.csv")), str(case(f"{name}.yaml")), *more)
    assert ended.returncode == 3
    check_text(f"fit.{name}", ended.stderr)
