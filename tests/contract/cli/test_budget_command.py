"""``nutdamp budget`` as a process: what it shows, writes and refuses."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from support import places
from support.cases import spread
from support.process import Run

pytestmark = pytest.mark.usefixtures("plans_shared")

CONFIGS = places.CONFIGS
STAGE = str(CONFIGS / "upper-stage.yaml")


@pytest.mark.deep
def test_a_budget_is_shown_and_written(run: Run, tmp_path: Path) -> None:
    pairs = ("--thresholds", "0.5deg,0.1deg", "--thresholds", "1 deg, 0.1 deg")
    done = run("budget", STAGE, *pairs, "--csv", "b.csv", "--json", "b.json", "--plot", "b.svg", columns=140)
    assert done.returncode == 0, done.stderr
    assert "Damping must begin within 62.41 s: from 1 deg now the nutation grows to 2 deg." in done.stdout
    found = json.loads((tmp_path / "b.json").read_text())
    assert found["until_largest_s"] == pytest.approx(62.41, abs=0.01)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "b.csv").read_text())))
    assert [float(row["start_deg"]) for row in rows] == pytest.approx([0.5, 1.0])
    for row, one in zip(rows, found["thresholds"], strict=True):
        assert float(row["pulses_per_day"]) == one["pulses_per_day"]
        assert f"{one['pulses_per_day']:.4g}" in done.stdout
        assert f"{one['propellant_kg_per_year']:.4g}" in done.stdout
        assert one["nutation_low_deg"] < one["stop_deg"] < one["start_deg"] < one["nutation_largest_deg"]
        assert row["meets_requirement"] == "true"
    picture = (tmp_path / "b.svg").read_text()
    for text in ("no firing", "0.5 to 0.1 deg", "1 to 0.1 deg", "pulses a day", "propellant, kg a year"):
        assert text in picture


@pytest.mark.deep
def test_the_same_seed_gives_the_same_budget(run: Run) -> None:
    one, same, other = (run("budget", STAGE, "-q", "--csv", "-", "--seed", seed).stdout for seed in ("3", "3", "4"))
    assert one == same
    assert one != other


@spread(
    ("changed", "said"),
    [
        ("inertia.C=6000 kg m^2", "No damping is needed: the nutation decays, e-fold in 90 s"),
        ("loop.start=0.05deg", None),
        ("requirement.nutation=0.8deg", "Damping must begin now: the nutation of 1 deg is already above 0.8 deg."),
        ("state.nutation=0deg", "There is no nutation yet that could grow."),
    ],
    quick=1,
    deep=0,
)
def test_what_is_particular_is_said(run: Run, changed: str, said: str | None, tmp_path: Path) -> None:
    more = () if said else ("--set", "loop.stop=0.01deg")
    done = run("budget", STAGE, "--set", changed, *more, "--plot", "b.png", columns=200)
    assert done.returncode == 0, done.stderr
    if said is None:
        for text in ("loop.start is below 0.0924 deg", "above loop.stop", "the loop never falls quiet"):
            assert text in done.stdout
    else:
        assert said in done.stdout
    assert (tmp_path / "b.png").read_bytes().startswith(b"\x89PNG")


def test_without_a_loop_it_says_when_damping_must_begin_and_what_is_missing(run: Run) -> None:
    done = run("budget", "-q", "--set", "dissipation.time_constant=600s", "--largest", "10deg", "--csv", "-")
    assert done.returncode == 0
    assert done.stdout.count("\n") == 1
    shown = run("budget", "-q", "--set", "dissipation.time_constant=600s", "--largest", "10deg", columns=200).stdout
    assert "Damping must begin within 420.5 s: from 5 deg now the nutation grows to 10 deg." in shown
    assert "need a closed loop: the key loop of the file" in shown


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        ((), 2, "dissipation: {time_constant: 600 s}"),
        ((STAGE, "--thresholds", "0.1deg,0.5deg"), 2, "expected START above STOP"),
        ((STAGE, "--thresholds", "0.1deg"), 2, "two angles"),
        ((STAGE, "--largest", "90deg"), 2, "between 0 and 90 deg"),
        ((STAGE, "--plot", "b.txt"), 2, ".png"),
        (("--set", "dissipation.time_constant=9s", "--thresholds", "1deg,0deg"), 2, "sensor: {kind: gyro"),
        ((STAGE, "--set", "loop.sensor.scale=-100%"), 3, "wired backwards against the sensor"),
        ((STAGE, "--set", "loop.faults.reversed=[N1]"), 3, "firings of N1 feed the nutation"),
        ((STAGE, "--set", "requirement.nutation=0.3deg"), 4, "NOT met"),
    ],
)
def test_what_is_refused(run: Run, arguments: tuple[str, ...], status: int, said: str) -> None:
    done = run("budget", *arguments, columns=200)
    assert done.returncode == status
    assert said in done.stdout + done.stderr
    assert "Traceback" not in done.stderr
