"""``nutdamp disperse`` as a command: screen, JSON, CSV, statuses, and what an interruption leaves."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from support.cases import weekly
from support.commands import call, names, result, rows, transcript
from support.dispersed import FILE
from support.golden import check_text
from support.process import Run, environment

pytestmark = pytest.mark.usefixtures("plans_shared")

PERCENTS = ("50", "90", "95", "99", "99.7")
COLUMNS = ("nutation_deg", "momentum_shift_deg", "axis_error_deg", "spin_change_rad_s", "propellant_kg")
TWO = "disperse body.yaml --scheme two-pulse"


@pytest.fixture
def body(tmp_path: Path) -> Path:
    path = tmp_path / "body.yaml"
    path.write_text(FILE)
    return path


@pytest.mark.usefixtures("body")
def test_the_csv_has_every_case_and_the_json_what_they_amount_to(run: Run, tmp_path: Path) -> None:
    """By other means: percentiles of the table, shares of its rows, spreads of its inputs."""
    data = result(run, f"{TWO} --samples 4000 --seed 7 --csv s.csv")
    assert (data["scheme"], data["samples"], data["seed"], data["redrawn"]) == ("two-pulse", 4000, 7, 0)
    table = rows((tmp_path / "s.csv").read_text())
    assert [row["case"] for row in table] == [str(case) for case in range(1, 4001)]
    for column in COLUMNS:
        values = np.array([float(row[column]) for row in table])
        shares = [data["percentiles"][column][percent] for percent in PERCENTS]
        assert shares == pytest.approx(np.percentile(values, [float(percent) for percent in PERCENTS]), rel=1e-12)
        assert "max" in data["percentiles"][column]
    inputs = {name: np.array([float(row[name]) for row in table]) for name in ("A_kgm2", "thrust_pulse_1_factor")}
    assert inputs["A_kgm2"].mean() == pytest.approx(120.0, rel=1e-3)
    assert inputs["A_kgm2"].std() == pytest.approx(1.2, rel=0.045)  # four sigmas of 4,000 cases
    assert inputs["thrust_pulse_1_factor"].std() == pytest.approx(0.01, rel=0.045)
    assert {row["timing_offset_s"] for row in table} == {"0.002"}
    good = sum(float(row["nutation_deg"]) <= 0.6 and float(row["momentum_shift_deg"]) <= 0.4 for row in table)
    requirement = data["requirement"]
    assert requirement["low"] < requirement["met_fraction"] == good / 4000 < requirement["high"]
    assert requirement["confidence"] == 0.95
    assert sum(share["analytic"] for share in data["shares"]) == pytest.approx(1.0)
    assert {share["input"] for share in data["shares"]} > {"A", "C", "omega0_1", "thrust steerable", "timing pulse 2"}
    assert all(0.0 <= share["sampled"] <= 1.0 for share in data["shares"])
    assert data["unused"] == ["position steerable"]
    assert len(data["worst"]) == 5
    row = table[data["worst"][0]["case"] - 1]
    assert float(row["nutation_deg"]) == pytest.approx(data["worst"][0]["nutation_deg"], rel=1e-12)
    assert float(row["A_kgm2"]) == pytest.approx(data["worst"][0]["inputs"]["A"], rel=1e-12)


@pytest.mark.usefixtures("body")
def test_runs_agree_on_any_threads_and_a_worst_case_can_be_run_again(run: Run) -> None:
    data = result(run, f"{TWO} --seed 3 --samples 20000 --threads 1")
    assert data == result(run, f"{TWO} --seed 3 --samples 20000 --threads 2")
    worst = data["worst"][1]
    command = f"{TWO} --seed 3 --case {worst['case']}"
    again = result(run, command)
    assert again.pop("inputs") == pytest.approx(worst.pop("inputs"), rel=1e-12)
    assert {name: again[name] for name in worst} == pytest.approx(worst, rel=1e-12)
    check_text("cli.disperse.case", run(*command.split()).stdout)


FEW = f"{TWO} --samples 50 --set"
SCREENS = {
    "all cases": [f"{TWO} --samples 2000", f"{TWO} --samples 2000 -v"],
    "requirements": [f"{FEW} 'requirement={{nutation: 9 deg}}'; 4", f"{FEW} 'requirement={{nutation: 0.1 deg}}'; 4",
                     f"{FEW} 'requirement={{}}'"],
    "refused": [f"{FEW} 'dispersions.C={{bias: 250 %}}'; 2"],
    "weak": ["disperse body.yaml --samples 9 --set 'limits={horizon: 4 s}' --set 'requirement={}' "
             "--set 'steerable.torque=1 N m'"],
}  # fmt: skip


@pytest.mark.usefixtures("body")
@pytest.mark.parametrize("kind", SCREENS)
def test_the_screen(run: Run, kind: str) -> None:
    """What dominates and what is unused; 50 good cases show little; a recommended plan that does not damp is flown."""
    shown = transcript(run, SCREENS[kind], "" if kind == "all cases" else "equirement")
    check_text(f"cli.disperse.{kind}", shown)
    assert "…" not in shown
    assert all(len(line) <= 80 for line in shown.splitlines() if kind == "all cases" and not line.startswith("$"))


def test_what_is_dispersed_is_the_scheme_the_schedule_or_the_recommended_plan(run: Run, body: Path) -> None:
    """By so many cases as other commands do; and the example of dispersions, where there are none, can be pasted."""
    data = result(run, TWO)
    assert (data["scheme"], data["samples"], data["seed"]) == ("two-pulse", 20_000, 1)
    assert call(run, "plan body.yaml --scheme one-pulse --csv p.csv").returncode in (0, 4)
    assert result(run, "disperse body.yaml --schedule p.csv --samples 9", status=4)["scheme"] == "p.csv"
    free = "--samples 9 --set requirement={}"
    recommended = result(run, "plan body.yaml --set requirement={}")["recommended"]
    data = result(run, f"disperse body.yaml {free}")
    assert (data["scheme"], data["requirement"]) == (recommended, None)
    exact = FILE[: FILE.index("dispersions:")]
    body.write_text(exact)
    shown = transcript(run, [f"{TWO}; 2"])
    check_text("cli.disperse.exact", shown)
    body.write_text(exact + shown[shown.index("dispersions:\n") :])
    assert call(run, f"{TWO} {free}").returncode == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_tables_that_the_disk_does_not_hold_are_exit_1(run: Run, body: Path) -> None:
    """At once, where the number of their rows says so."""
    full = run(*TWO.split(), "--samples", "2000", "--csv", "/dev/full")
    assert (full.returncode, full.stdout) == (1, "")
    assert "cannot write /dev/full: No space left" in full.stderr
    big = run(*TWO.split(), "--samples", "1e12", "--csv", "big.csv")
    assert big.returncode == 1
    assert "cannot write big.csv" in big.stderr
    assert "GB are free" in big.stderr
    assert names(body.parent) == ["body.yaml"]


@pytest.mark.deep
def test_it_says_where_the_nominal_case_ends_and_where_it_should(run: Run, tmp_path: Path) -> None:
    goal = ("--scheme", "half-cone", "--target", "10deg,45deg")
    shown = run("disperse", *goal, "--samples", "200", "-v", "--json", "d.json").stdout
    simulated = result(run, " ".join(("simulate", *goal)), status=4)
    data = json.loads((tmp_path / "d.json").read_text())
    for name in ("axis", "momentum"):
        assert data["final"][name] == pytest.approx(simulated["final"][name], abs=1e-6)
    assert data["target"]["axis"] == pytest.approx({"tilt_deg": 10.0, "azimuth_deg": 45.0})
    assert re.search(r"^target +tilt 10\.0000 deg, azimuth 45\.0000 deg; H ends .+ deg off$", shown, re.MULTILINE)
    assert re.search(r"^spin axis ends at +tilt 1[01]\.[0-9]{4} deg", shown, re.MULTILINE)


def row_of(screen: str, name: str) -> list[float]:
    """Numbers of the row of that name."""
    (numbers,) = re.findall(rf"^{re.escape(name)}, \S+ +([\d.e -]+)$", screen, re.MULTILINE)
    return [float(number) for number in numbers.split()]


@pytest.mark.parametrize(
    ("file", "scheme", "lost"), [("sounder-1", "two-pulse", False), ("upper-stage", "one-pulse", True)]
)
def test_of_spin_changes_the_size_is_shown_and_files_have_the_sign(
    run: Run, tmp_path: Path, file: str, scheme: str, lost: bool
) -> None:
    """Up or down, the largest change is the worst."""
    command = [] if file == "sounder-1" else ["body.yaml"]
    run("init", "--from", "upper-stage", "body.yaml")
    files = ["--csv", "s.csv", "--json", "s.json"]
    shown = run("disperse", *command, "--scheme", scheme, "--samples", "400", "-q", "-v", *files, columns=140).stdout
    changes = np.array([float(row["spin_change_rad_s"]) for row in rows((tmp_path / "s.csv").read_text())])
    assert (changes.max() <= 0.0) == lost
    shares = np.array([float(percent) / 100.0 for percent in PERCENTS])
    sizes = 1e3 * np.abs(changes)
    assert row_of(shown, "|spin change|")[1:] == pytest.approx([*np.quantile(sizes, shares), sizes.max()], abs=1e-3)
    signed = json.loads((tmp_path / "s.json").read_text())["percentiles"]["spin_change_rad_s"]
    assert (signed["min"], signed["max"]) == pytest.approx((changes.min(), changes.max()))


def test_one_case_has_the_nominal_one_of_all(run: Run) -> None:
    for number in (["--samples", "100"], ["--case", "7"]):
        shift = row_of(run("disperse", "--scheme", "four-pulse", *number).stdout, "momentum shift")
        assert shift[0] == 0.1684


@pytest.mark.weekly
@pytest.mark.parametrize("number", [signal.SIGINT, weekly(signal.SIGTERM)])
def test_an_interrupted_run_keeps_what_is_done(run: Run, body: Path, number: signal.Signals) -> None:
    """The first cases are written, whole; and they are those of a run that requested no more."""
    command = [*TWO.split(), "--samples", "1e8", "--csv", "s.csv", "--json", "s.json"]
    process = subprocess.Popen(
        [sys.executable, "-m", "nutdamp", *command],
        cwd=body.parent,
        env={**os.environ, **environment(80)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while process.poll() is None and not any(path.stat().st_size > 0 for path in body.parent.glob("*.part*")):
        time.sleep(0.05)
    time.sleep(1.5)
    process.send_signal(number)
    out, err = process.communicate()
    assert process.returncode == 128 + number
    assert "interrupted: " in err
    assert "Traceback" not in err
    assert "\nrequirement " in out
    assert names(body.parent) == ["body.yaml", "s.csv", "s.json"]
    data = json.loads((body.parent / "s.json").read_text())
    assert data["interrupted"]
    assert 0 < data["samples"] < 1e8
    lines = (body.parent / "s.csv").read_text().splitlines()
    assert len(lines) == data["samples"] + 1
    assert lines[-1].startswith(f"{data['samples']},")
    whole = result(run, f"{TWO} --samples {data['samples']}")
    for key in ("samples", "redrawn", "requirement", "shares", "worst"):
        assert data[key] == whole[key]
