"""disperse, loop, disperse --loop and budget as users run them."""

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
from support import places
from support.cases import weekly
from support.commands import CRAFTS, call, names, result, rows, words, written
from support.dispersed import FILE
from support.golden import check_text
from support.loops import follow_few_cycles
from support.process import Run, environment

import nutdamp
from nutdamp.views.dispersion import beside

pytestmark = pytest.mark.usefixtures("plans_shared")

STAGE = str(places.CONFIGS / "upper-stage.yaml")


@pytest.fixture(autouse=True)
def crafts(tmp_path: Path) -> None:
    written(tmp_path, **CRAFTS)


def table(path: Path) -> list[dict[str, str]]:
    return rows(path.read_text())


def test_a_loop_is_flown_and_written_and_fired_again(run: Run, tmp_path: Path) -> None:
    screen = run(
        "loop",
        "craft.yaml",
        "--json",
        "loop.json",
        "--csv",
        "pulses.csv",
        "--track",
        "track.csv",
        status=0,
    )
    check_text("loop.screen", screen.stdout)
    check_text("loop.full", run("loop", "craft.yaml", "-v").stdout)
    written = json.loads((tmp_path / "loop.json").read_text())
    assert (written["stopped"], written["channel"], written["meets_requirement"]) == (
        "end",
        None,
        True,
    )
    assert written["quiet_s"][0] > written["pulses"][-1]["start_s"]
    assert written["largest_since_quiet_deg"] <= written["dead_band_deg"]
    assert {each["damps"] for each in written["margins"]} == {True}
    assert [row["channel"] for row in table(tmp_path / "pulses.csv")] == [
        each["channel"] for each in written["pulses"]
    ]
    nutation = float(table(tmp_path / "track.csv")[-1]["nutation_deg"])
    assert nutation == pytest.approx(written["flown"]["nutation_deg"])
    replay = run(
        "simulate",
        "craft.yaml",
        "--schedule",
        "pulses.csv",
        "--flown",
        "--until",
        "40s",
        "--json",
        "-",
    )
    again = json.loads(replay.stdout)
    flown = json.loads(run("loop", "craft.yaml", "--until", "40s", "--json", "-").stdout)
    assert again["flown"]["nutation_deg"] == pytest.approx(flown["flown"]["nutation_deg"], rel=1e-9)
    for mine, other in zip(again["pulses"], flown["pulses"], strict=True):
        assert mine["nutation_after_deg"] == pytest.approx(other["nutation_after_deg"], rel=1e-9)


@pytest.mark.parametrize("command", [("loop", "craft.yaml"), ("budget", STAGE)])
def test_seeds_are_other_noise(
    run: Run, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    follow_few_cycles(monkeypatch)
    first, same, other = (
        run(*command, "-q", "--csv", "-", "--seed", seed).stdout for seed in ("3", "3", "4")
    )
    assert first == same != other


@pytest.mark.deep
def test_cases_their_table_their_files(run: Run, tmp_path: Path) -> None:
    command = "disperse stage.yaml --loop --until 8s"
    few = f"{command} --samples 120 --worst 2"  # which do not show it
    screen = call(run, f"{few} -v --csv c.csv --json c.json --plot c.svg", status=4)
    brief = call(run, few).stdout
    assert len(brief.splitlines()) <= 40
    assert (
        f"--case {json.loads((tmp_path / 'c.json').read_text())['worst'][0]['case']} (worst)"
        in words(brief)
    )
    check_text("loop.cases-brief", brief.split("\n\n")[0])
    head, _, *inputs = screen.stdout.split("\n\n")
    verdicts = head.partition(" moments\n")[2]
    check_text("loop.cases", "\n".join([verdicts, *"\n".join(inputs[:2]).splitlines()[-3:]]))
    study = json.loads((tmp_path / "c.json").read_text())
    assert (study["settled"]["fraction"], study["until_s"]) == (1.0, 8.0)
    assert study["percentiles"]["settled_s"]["50"] == pytest.approx(5.4, abs=0.3)
    assert set(study["shares"]["propellant_kg"]) >= {"omega0_1", "sensor bias", "sensor delay"}
    rows = table(tmp_path / "c.csv")
    worst = study["worst"][0]
    assert [row["case"] for row in rows] == [str(number) for number in range(1, 121)]
    row = rows[worst["case"] - 1]
    assert float(row["largest_nutation_deg"]) == worst["largest_nutation_deg"]
    assert (
        max(float(each["largest_nutation_deg"]) for each in rows) == worst["largest_nutation_deg"]
    )
    assert float(row["sensor_delay_s"]) == worst["inputs"]["sensor delay"]
    assert "<svg" in (tmp_path / "c.svg").read_text()[:2000]
    alone = result(run, f"{command} --case {worst['case']}")
    assert alone["inputs"] == worst["inputs"]
    assert alone["largest_nutation_deg"] == pytest.approx(worst["largest_nutation_deg"], rel=1e-12)
    loop = call(run, f"loop stage.yaml --until 8s --case {worst['case']} --json l.json", status=0)
    assert f"dispersed case {worst['case']} of seed 1: ENOUGH: " in words(loop.stdout)
    flown = json.loads((tmp_path / "l.json").read_text())
    assert (flown["seed"], flown["case"], len(flown["pulses"])) == (
        1,
        worst["case"],
        worst["firings"],
    )
    assert flown["quiet_s"][0] == pytest.approx(worst["settled_s"], abs=1e-9)
    assert flown["propellant_kg"] == pytest.approx(worst["propellant_kg"], rel=1e-9)


def test_the_csv_has_the_angles_to_cones_at_the_end_of_its_rows(run: Run, tmp_path: Path) -> None:
    command = "disperse stage.yaml --loop --until 6s --samples 12 --csv c.csv"
    call(run, command)
    plain = (tmp_path / "c.csv").read_text().splitlines()
    attitude = "attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}\n"
    cones = "keep: [{name: North Star, direction: [30 deg, 80 deg], min: 1 deg}]\n"
    written(tmp_path, stage_yaml=f"{CRAFTS['stage_yaml']}\n{attitude}{cones}")
    study = result(run, f"{command} --worst 12", status=4)
    assert [
        line.rsplit(",", 2)[0] for line in (tmp_path / "c.csv").read_text().splitlines()
    ] == plain
    rows = table(tmp_path / "c.csv")
    names = ["North_Star_least_deg", "North_Star_largest_deg"]
    assert ([*rows[0]][-2:], len(study["worst"])) == (names, 12)
    for worst in study["worst"]:
        (angles,) = worst["aspects"]
        assert angles["least_deg"] < angles["largest_deg"]
        assert [float(rows[worst["case"] - 1][name]) for name in names] == [
            angles["least_deg"],
            angles["largest_deg"],
        ]


def test_the_library_gives_the_numbers_of_the_command(run: Run, tmp_path: Path) -> None:
    options = ("--until", "7s", "--samples", "20", "--seed", "3", "--json", "-")
    made = nutdamp.disperse_loop(nutdamp.load(tmp_path / "stage.yaml"), 20, until=7.0, seed=3)
    shown = json.loads(run("disperse", "stage.yaml", "--loop", *options).stdout)
    assert shown == json.loads(json.dumps(made.to_dict(), allow_nan=False))
    assert made.core.settled == made.core.done
    assert made.met_fraction == 1.0


# --- disperse of a plan: screen, JSON, CSV, statuses, and what an interruption leaves

PERCENTS = ("50", "90", "95", "99", "99.7")
COLUMNS = (
    "nutation_deg",
    "momentum_shift_deg",
    "axis_error_deg",
    "spin_change_rad_s",
    "propellant_kg",
)
TWO = "disperse body.yaml --scheme two-pulse"


def test_the_csv_has_every_case_and_the_json_what_they_amount_to(run: Run, tmp_path: Path) -> None:
    """By other means: percentiles of the table, shares of its rows, spreads of its inputs."""
    data = result(run, f"{TWO} --samples 4000 --seed 7 --csv s.csv")
    assert (data["scheme"], data["samples"], data["seed"], data["redrawn"]) == (
        "two-pulse",
        4000,
        7,
        0,
    )
    table = rows((tmp_path / "s.csv").read_text())
    assert [row["case"] for row in table] == [str(case) for case in range(1, 4001)]
    for column in COLUMNS:
        values = np.array([float(row[column]) for row in table])
        shares = [data["percentiles"][column][percent] for percent in PERCENTS]
        assert shares == pytest.approx(
            np.percentile(values, [float(percent) for percent in PERCENTS]), rel=1e-12
        )
        assert "max" in data["percentiles"][column]
    inputs = {
        name: np.array([float(row[name]) for row in table])
        for name in ("A_kgm2", "thrust_pulse_1_factor")
    }
    assert inputs["A_kgm2"].mean() == pytest.approx(120.0, rel=1e-3)
    assert inputs["A_kgm2"].std() == pytest.approx(1.2, rel=0.045)  # four sigmas of 4,000 cases
    assert inputs["thrust_pulse_1_factor"].std() == pytest.approx(0.01, rel=0.045)
    assert {row["timing_offset_s"] for row in table} == {"0.002"}
    good = sum(
        float(row["nutation_deg"]) <= 0.6 and float(row["momentum_shift_deg"]) <= 0.4
        for row in table
    )
    requirement = data["requirement"]
    assert requirement["low"] < requirement["met_fraction"] == good / 4000 < requirement["high"]
    assert requirement["confidence"] == 0.95
    assert sum(share["analytic"] for share in data["shares"]) == pytest.approx(1.0)
    assert {share["input"] for share in data["shares"]} > {
        "A",
        "C",
        "omega0_1",
        "thrust steerable",
        "timing pulse 2",
    }
    assert all(0.0 <= share["sampled"] <= 1.0 for share in data["shares"])
    assert data["unused"] == ["position steerable"]
    assert len(data["worst"]) == 5
    row = table[data["worst"][0]["case"] - 1]
    assert float(row["nutation_deg"]) == pytest.approx(data["worst"][0]["nutation_deg"], rel=1e-12)
    assert float(row["A_kgm2"]) == pytest.approx(data["worst"][0]["inputs"]["A"], rel=1e-12)


def test_runs_agree_on_any_threads_and_a_worst_case_can_be_run_again(run: Run) -> None:
    data = result(run, f"{TWO} --seed 3 --samples 20000 --threads 1")
    assert data == result(run, f"{TWO} --seed 3 --samples 20000 --threads 2")
    worst = data["worst"][1]
    command = f"{TWO} --seed 3 --case {worst['case']}"
    again = result(run, command)
    assert again.pop("inputs") == pytest.approx(worst.pop("inputs"), rel=1e-12)
    assert {name: again[name] for name in worst} == pytest.approx(worst, rel=1e-12)
    check_text("cli.disperse.case", run(*command.split()).stdout)


def test_the_example_of_dispersions_can_be_pasted(run: Run, tmp_path: Path) -> None:
    exact = FILE[: FILE.index("dispersions:")]
    (tmp_path / "body.yaml").write_text(exact)
    shown = call(run, TWO, status=2).stderr
    check_text("cli.disperse.exact", shown)
    (tmp_path / "body.yaml").write_text(exact + shown[shown.index("dispersions:\n") :])
    assert call(run, f"{TWO} --samples 9 --set requirement={{}}").returncode == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_tables_that_the_disk_does_not_hold_are_exit_1(run: Run, tmp_path: Path) -> None:
    full = run(*TWO.split(), "--samples", "2000", "--csv", "/dev/full")
    assert (full.returncode, full.stdout) == (1, "")
    assert "cannot write /dev/full: No space left" in full.stderr
    assert names(tmp_path) == sorted(name.replace("_", ".") for name in CRAFTS)


def row_of(screen: str, name: str) -> list[float]:
    """Numbers of the row of that name."""
    (numbers,) = re.findall(rf"^{re.escape(name)}, \S+ +([\d.e -]+)$", screen, re.MULTILINE)
    return [float(number) for number in numbers.split()]


@pytest.mark.parametrize(
    ("file", "scheme", "lost"),
    [("sounder-1", "two-pulse", False), ("upper-stage", "one-pulse", True)],
)
def test_of_spin_changes_the_size_is_shown_and_files_have_the_sign(
    run: Run, tmp_path: Path, file: str, scheme: str, lost: bool
) -> None:
    """Up or down, the largest change is the worst."""
    command = [] if file == "sounder-1" else ["body.yaml"]
    run("init", "--from", "upper-stage", "body.yaml")
    files = ["--csv", "s.csv", "--json", "s.json"]
    shown = run(
        "disperse",
        *command,
        "--scheme",
        scheme,
        "--samples",
        "400",
        "-q",
        "-v",
        *files,
        columns=140,
    ).stdout
    changes = np.array(
        [float(row["spin_change_rad_s"]) for row in rows((tmp_path / "s.csv").read_text())]
    )
    assert (changes.max() <= 0.0) == lost
    assert beside(-1e-9, 1.0) == "0.000"
    shares = np.array([float(percent) / 100.0 for percent in PERCENTS])
    sizes = 1e3 * np.abs(changes)
    assert row_of(shown, "|spin change|")[1:] == pytest.approx(
        [*np.quantile(sizes, shares), sizes.max()], abs=1e-3
    )
    signed = json.loads((tmp_path / "s.json").read_text())["percentiles"]["spin_change_rad_s"]
    assert (signed["min"], signed["max"]) == pytest.approx((changes.min(), changes.max()))


@pytest.mark.weekly
@pytest.mark.parametrize("number", [signal.SIGINT, weekly(signal.SIGTERM)])
def test_an_interrupted_run_keeps_what_is_done(
    run: Run, tmp_path: Path, number: signal.Signals
) -> None:
    """The first cases are written, whole; and they are those of a run that requested no more."""
    command = [*TWO.split(), "--samples", "1e8", "--csv", "s.csv", "--json", "s.json"]
    process = subprocess.Popen(
        [sys.executable, "-m", "nutdamp", *command],
        cwd=tmp_path,
        env={**os.environ, **environment(80)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while process.poll() is None and not any(
        path.stat().st_size > 0 for path in tmp_path.glob("*.part*")
    ):
        time.sleep(0.05)
    time.sleep(1.5)
    process.send_signal(number)
    out, err = process.communicate()
    assert process.returncode == 128 + number
    assert "interrupted: " in err
    assert "Traceback" not in err
    assert "\nrequirement " in out
    fresh = set(names(tmp_path)) - {name.replace("_", ".") for name in CRAFTS}
    assert fresh == {"s.csv", "s.json"}
    data = json.loads((tmp_path / "s.json").read_text())
    assert data["interrupted"]
    assert 0 < data["samples"] < 1e8
    lines = (tmp_path / "s.csv").read_text().splitlines()
    assert len(lines) == data["samples"] + 1
    assert lines[-1].startswith(f"{data['samples']},")
    whole = result(run, f"{TWO} --samples {data['samples']}")
    for key in ("samples", "redrawn", "requirement", "shares", "worst"):
        assert data[key] == whole[key]
