"""``nutdamp plan --robust``: the screen, the files and the exit statuses."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from process import Run

BODY = """\
name: Sat
inertia: {A: 120, C: 80}
state: {spin: 3 rad/s, nutation: 5 deg, phase: 40 deg}
thrusters:
  - {name: a, torque: [8, 0, 0], lever_arm: 0.8, isp: 220}
  - {name: b, torque: [-8, 0, 0], lever_arm: 0.8, isp: 220}
  - {name: c, torque: [0, 8, 0], lever_arm: 0.8, isp: 220}
  - {name: d, torque: [0, -8, 0], lever_arm: 0.8, isp: 220}
"""
UNTRUSTED = "dispersions: {A: {normal: 0.1 %}, thrust: {b: {normal: 30 %}}}\n"


@pytest.fixture
def sat(tmp_path: Path) -> Path:
    path = tmp_path / "sat.yaml"
    path.write_text(BODY + UNTRUSTED, encoding="utf-8")
    return path


def test_the_screen_the_json_and_the_csv_tell_of_the_same_plan(run: Run, sat: Path, tmp_path: Path) -> None:
    done = run("plan", "sat.yaml", "--scheme", "four-pulse", "--robust", "--json", "plan.json", "--csv", "pulses.csv")
    assert done.returncode == 0, done.stderr
    words = " ".join(done.stdout.split())
    assert "20,000 dispersed truths (seed 1) fly each plan, by the impulse sum (17)" in words
    assert "Against four-pulse, recommended for the estimate:" in words
    assert "Robust plan: four-pulse, without b" in words
    found = json.loads((tmp_path / "plan.json").read_text("utf-8"))
    assert found["recommended"] == "four-pulse"
    best, usual = found["robust"]["recommended"], found["robust"]["against"]
    assert (best["variant"], usual["variant"]) == ("without b", "as planned")
    assert best["nutation_deg"] < usual["nutation_deg"]
    cost = found["robust"]["cost"]
    assert cost["propellant_kg"] == pytest.approx(best["propellant_kg"] - usual["propellant_kg"])
    assert cost["end_s"] == pytest.approx(best["end_s"] - usual["end_s"])
    rows = list(csv.DictReader(io.StringIO((tmp_path / "pulses.csv").read_text("utf-8"))))
    assert [row["channel"] for row in rows] == [pulse["channel"] for pulse in best["plan"]["pulses"]]
    assert "b" not in {row["channel"] for row in rows}


def test_the_same_again(run: Run, sat: Path) -> None:
    arguments = ("plan", "sat.yaml", "--scheme", "four-pulse", "--robust", "--json", "-")
    assert run(*arguments).stdout == run(*arguments).stdout


@pytest.mark.parametrize(("degrees", "status"), [(3.0, 0), (0.001, 4)])
def test_the_requirement_with_its_probability(run: Run, sat: Path, degrees: float, status: int) -> None:
    requirement = f"requirement: {{nutation: {degrees} deg, probability: 95 %}}\n"
    sat.write_text(BODY + UNTRUSTED + requirement, encoding="utf-8")
    done = run("plan", "sat.yaml", "--scheme", "four-pulse", "--robust")
    assert done.returncode == status, done.stdout
    assert "95 %" in done.stdout


def test_without_dispersions_it_says_what_to_write(run: Run, sat: Path, tmp_path: Path) -> None:
    sat.write_text(BODY, encoding="utf-8")
    done = run("plan", "sat.yaml", "--robust", "--json", "plan.json")
    assert done.returncode == 2
    assert "dispersions:" in done.stderr
    assert not (tmp_path / "plan.json").exists()


def test_nothing_feasible(run: Run, sat: Path) -> None:
    sat.write_text(BODY + UNTRUSTED + "limits: {horizon: 1 ms}\n", encoding="utf-8")
    done = run("plan", "sat.yaml", "--robust")
    assert done.returncode == 3
    assert "No recommendation: no scheme is feasible." in done.stdout
    assert "one-pulse: infeasible:" in " ".join(done.stdout.split())
