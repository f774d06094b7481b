"""disperse, loop, disperse --loop and budget as users run them."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import places
from support.cases import deep, spread, weekly
from support.commands import call, names, result, rows, transcript, words
from support.dispersed import FILE
from support.golden import check_text
from support.loops import follow_few_cycles
from support.process import Run, environment

import nutdamp
from nutdamp.views.dispersion import beside

pytestmark = pytest.mark.usefixtures("plans_shared")

BODY = """
name: Upper
inertia: {A: 100 kg m^2, C: 70 kg m^2}
omega0: [0.042 rad/s, 0.036 rad/s, 3 rad/s]
thrusters:
  - {name: +M1, torque: [ 20, 0, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms,
     max_on_time: 50 ms}
  - {name: -M1, torque: [-20, 0, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms,
     max_on_time: 50 ms}
  - {name: +M2, torque: [0,  20, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms,
     max_on_time: 50 ms}
  - {name: -M2, torque: [0, -20, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms,
     max_on_time: 50 ms}
requirement: {nutation: 0.3 deg}
"""
LOOP = """
loop:
  sensor: {kind: gyro, rate: 100 Hz, noise: 0.01 deg/s, bias: 0.02 deg/s, delay: 20 ms}
  start: 0.2 deg
  stop: 0.05 deg
  min_interval: 0.5 s
"""
STAGE = str(places.CONFIGS / "upper-stage.yaml")


@pytest.fixture
def file(tmp_path: Path) -> str:
    (tmp_path / "craft.yaml").write_text(BODY + LOOP)
    return "craft.yaml"


@pytest.fixture
def stage(run: Run, tmp_path: Path) -> Path:
    run("init", "--from", "upper-stage", "stage.yaml")
    return tmp_path / "stage.yaml"


def settings(*each: str) -> list[str]:
    return [part for setting in each for part in ("--set", setting)]


def table(path: Path) -> list[dict[str, str]]:
    return rows(path.read_text())


def test_a_loop_is_flown_and_written_and_fired_again(run: Run, file: str, tmp_path: Path) -> None:
    screen = run(
        "loop", file, "--json", "loop.json", "--csv", "pulses.csv", "--track", "track.csv", status=0
    )
    check_text("loop.screen", screen.stdout)
    check_text("loop.full", run("loop", file, "-v").stdout)
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
        "simulate", file, "--schedule", "pulses.csv", "--flown", "--until", "40s", "--json", "-"
    )
    again = json.loads(replay.stdout)
    flown = json.loads(run("loop", file, "--until", "40s", "--json", "-").stdout)
    assert again["flown"]["nutation_deg"] == pytest.approx(flown["flown"]["nutation_deg"], rel=1e-9)
    for mine, other in zip(again["pulses"], flown["pulses"], strict=True):
        assert mine["nutation_after_deg"] == pytest.approx(other["nutation_after_deg"], rel=1e-9)


@pytest.mark.parametrize("command", [("loop", "craft.yaml"), ("budget", STAGE)])
def test_seeds_are_other_noise(
    run: Run, file: str, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    follow_few_cycles(monkeypatch)
    first, same, other = (
        run(*command, "-q", "--csv", "-", "--seed", seed).stdout for seed in ("3", "3", "4")
    )
    assert first == same != other


@pytest.mark.parametrize("setting", ["loop.faults.reversed=[+M1]", "loop.sensor.scale=-100%"])
def test_what_is_wired_backwards_is_named(
    run: Run, file: str, tmp_path: Path, setting: str
) -> None:
    screen = run("loop", file, "--set", setting, "--json", "loop.json", status=3)
    written = json.loads((tmp_path / "loop.json").read_text())
    checked = run("check", file, "--set", setting, status=0)
    wired, code = (
        ("channel", "channels-reversed") if "faults" in setting else ("sensor", "sensor-reversed")
    )
    check_text(
        f"loop.wired-{wired}",
        "\n".join([screen.stderr, *(note["code"] for note in written["notes"])]),
    )
    assert written["notes"][0]["severity"] == "warning"
    assert f"warning[{written['notes'][0]['code']}]: the loop was stopped" in words(screen.stdout)
    assert f"warning[{code}]: " in checked.stdout
    assert (written["decision"]["status"], written["meets_requirement"]) == ("no-plan", None)


def test_too_late_is_refused_with_what_is_allowed(run: Run, file: str) -> None:
    late = settings("loop.predict=false", "loop.sensor.delay=2s")
    screen = run("loop", file, *late)
    assert (screen.returncode, screen.stdout) == (3, "")
    check_text("loop.refused-too-late", screen.stderr)
    assert "warning[loop-does-not-damp]: " in words(run("check", file, *late).stdout)
    margins = json.loads(run("check", file, *late, "--json", "-").stdout)["files"][0]["loop"]
    assert {each["damps"] for each in margins} == {False}
    assert margins[0]["delay_margin_s"] < 0.0


@pytest.mark.deep
def test_a_loop_that_is_never_quiet_misses_the_requirement(
    run: Run, file: str, tmp_path: Path
) -> None:
    never = (*settings("loop.stop=1e-8 deg"), "--until", "60s")
    screen = run("loop", file, *never, "--json", "loop.json")
    written = json.loads((tmp_path / "loop.json").read_text())
    assert (screen.returncode, written["meets_requirement"], written["quiet_s"]) == (4, False, [])
    assert written["flown"]["nutation_deg"] < 0.3
    assert "NOT ENOUGH: the loop is never down to its stop threshold" in words(screen.stdout)
    cases = (*settings("dispersions={A: {normal: 0.01 %}}"), "--samples", "20", "--json", "-", "-q")
    study = json.loads(run("disperse", file, "--loop", *never, *cases).stdout)
    assert study["requirement"]["met_fraction"] == 0.0
    screen = run("loop", file, "--set", "loop.stop=0")
    assert (screen.returncode, "never: loop.stop is 0" in screen.stdout) == (0, True)
    assert "it never shows the start threshold" in words(
        run("loop", file, "--set", "omega0=[0, 0, 3]").stdout
    )


def test_a_requirement_or_a_cone_that_is_missed_is_exit_4(
    run: Run, file: str, tmp_path: Path
) -> None:
    sky = "attitude: {quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: EME2000}\n"
    near = "keep: [{name: star, direction: [0 deg, 85 deg], min: 8 deg}]\n"
    (tmp_path / "seen.yaml").write_text(BODY + LOOP + sky + near)
    (tmp_path / "free.yaml").write_text(BODY + LOOP + sky + near.replace("8 deg", "1 deg"))
    missed = settings("requirement.nutation=1e-4 deg")
    for name, more, status in ((file, missed, 4), ("seen.yaml", [], 4), ("free.yaml", [], 0)):
        screen = run("loop", name, *more, "--until", "30s", "--json", "loop.json")
        assert (screen.returncode, "NOT met" in screen.stdout) == (status, status == 4)
        assert json.loads((tmp_path / "loop.json").read_text())["meets_requirement"] is (
            status == 0
        )


def test_where_nutation_grows_the_default_end_comes_after_a_cycle(run: Run, file: str) -> None:
    shown = run("loop", file, "--set", "dissipation={time_constant: 600 s}", "--json", "-").stdout
    assert len(json.loads(shown)["quiet_s"]) >= 2
    assert json.loads(shown)["pulses"][-1]["start_s"] > 500.0


def test_start_below_the_smallest_pulse_is_warned_of(run: Run, file: str) -> None:
    shown = words(
        run(
            "loop", file, *settings("loop.start=0.02deg", "loop.stop=0.001deg"), "--until", "5s"
        ).stdout
    )
    assert "warning[start-below-pulse]: loop.start, 0.02 deg, is below 0.02728 deg" in shown
    assert "noise, bias, tilt and steps of the sensor" in shown


@pytest.mark.deep
@spread(
    "sensor", ["{kind: gyro}", "{kind: accelerometer, rate: 20 Hz, position: [1, 0, 0]}"], quick=1
)
def test_picture(run: Run, file: str, tmp_path: Path, sensor: str) -> None:
    run("loop", file, "--set", f"loop.sensor={sensor}", "--plot", "l.svg", status=0)
    assert "start" in (tmp_path / "l.svg").read_text()


SENSELESS = (
    "dispersions.sensor_bias={normal: 0.01 deg/s}",
    "dispersions.sensor_bias={normal: 3 kg}",
    "dispersions.sensor_scale={normal: 60 %}",
    "dispersions.sensor_noise={normal: -5 %}",
    "dispersions.sensor_noise={uniform: 120 %}",
    "dispersions.sensor_delay={normal: 5 ms, uniform: 5 ms}",
    "dispersions.sensor_dealy={normal: 5 ms}",
)


def test_senseless_numbers_of_loop_and_sensor_are_refused(run: Run, stage: Path) -> None:
    check = ("check", "stage.yaml", "--set")
    screens = (run(*check, setting, columns=200, status=2).stderr for setting in SENSELESS)
    lines = (line for screen in screens for line in screen.splitlines() if "warning" not in line)
    check_text("loop.senseless", "\n".join(lines))
    assert (
        run("check", "stage.yaml", "--set", "loop.sensor.bias=3m/s^2").returncode == 0
    )  # it is fitted


def test_what_a_file_lacks_and_what_does_not_go_together_is_said(
    run: Run, stage: Path, tmp_path: Path
) -> None:
    (tmp_path / "bare.yaml").write_text(BODY)
    text = stage.read_text()
    (tmp_path / "exact.yaml").write_text(text.partition("dispersions:\n")[0])
    (tmp_path / "none.yaml").write_text(
        text[: text.index("\nloop:")] + "\n" + text[text.index("dispersions:") :]
    )
    disperse = ("disperse", "stage.yaml")
    texts = []
    for command in (
        ("loop", "bare.yaml"),
        ("loop", "bare.yaml", "--until", "-1s"),
        ("loop", "bare.yaml", "--plot", "x.txt"),
        ("loop", "exact.yaml", "--case", "3"),
        ("check", "none.yaml"),
        ("disperse", "bare.yaml", "--loop"),
        ("disperse", "exact.yaml", "--loop"),
        (*disperse, "--loop", "--scheme", "two-pulse"),
        (*disperse, "--loop", "--threads", "2"),
        (*disperse, "--loop", "--plot", "x.svg", "--figure", "cases"),
        (*disperse, "--until", "9s"),
        (*disperse, "--loop", "--until", "0s"),
        ("budget", "bare.yaml"),
        ("budget", "stage.yaml", "--thresholds", "0.1deg,0.5deg"),
        ("budget", "stage.yaml", "--thresholds", "0.1deg"),
        ("budget", "stage.yaml", "--largest", "90deg"),
        ("budget", "stage.yaml", "--plot", "b.txt"),
        (
            "budget",
            "bare.yaml",
            *settings("dissipation.time_constant=9s"),
            "--thresholds",
            "1deg,0deg",
        ),
    ):
        screen = run(*command, columns=200)
        assert (screen.returncode, screen.stdout) == (2, "")
        texts += [
            line
            for line in screen.stderr.splitlines()
            if line and not line.startswith(("Usage", "Try"))
        ]
    check_text("loop.refused", "\n".join(texts))


@pytest.mark.deep
def test_cases_their_table_their_files(run: Run, stage: Path, tmp_path: Path) -> None:
    command = (
        "disperse",
        "stage.yaml",
        "--loop",
        "--until",
        "8s",
        "--samples",
        "120",
        "--worst",
        "2",
    )
    # So few cases do not show it.
    screen = run(*command, "-v", "--csv", "c.csv", "--json", "c.json", "--plot", "c.svg", status=4)
    brief = run(*command).stdout
    assert len(brief.splitlines()) <= 40
    assert (
        f"--case {json.loads((tmp_path / 'c.json').read_text())['worst'][0]['case']} (worst)"
        in words(brief)
    )
    check_text("loop.cases-brief", brief.split("\n\n")[0])
    verdicts, inputs = screen.stdout.split("\n\n")[2:4]
    check_text("loop.cases", "\n".join([verdicts, *inputs.splitlines()[-3:]]))
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
    alone = json.loads(run(*command[:-4], "--case", str(worst["case"]), "--json", "-").stdout)
    assert alone["inputs"] == worst["inputs"]
    assert alone["largest_nutation_deg"] == pytest.approx(worst["largest_nutation_deg"], rel=1e-12)
    loop = run(
        "loop",
        "stage.yaml",
        "--until",
        "8s",
        "--case",
        str(worst["case"]),
        "--json",
        "l.json",
        status=0,
    )
    assert f"dispersed case {worst['case']} of seed 1: ENOUGH: " in words(loop.stdout)
    flown = json.loads((tmp_path / "l.json").read_text())
    assert (flown["seed"], flown["case"], len(flown["pulses"])) == (
        1,
        worst["case"],
        worst["firings"],
    )
    assert flown["quiet_s"][0] == pytest.approx(worst["settled_s"], abs=1e-9)
    assert flown["propellant_kg"] == pytest.approx(worst["propellant_kg"], rel=1e-9)


def test_the_csv_has_the_angles_to_cones_at_the_end_of_its_rows(
    run: Run, stage: Path, tmp_path: Path
) -> None:
    command = (
        "disperse",
        "stage.yaml",
        "--loop",
        "--until",
        "6s",
        "--samples",
        "12",
        "--csv",
        "c.csv",
    )
    run(*command)
    plain = (tmp_path / "c.csv").read_text().splitlines()
    attitude = "attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}\n"
    cones = "keep: [{name: North Star, direction: [30 deg, 80 deg], min: 1 deg}]\n"
    stage.write_text(
        f"{stage.read_text()}\n{attitude * ('attitude:' not in stage.read_text())}{cones}"
    )
    study = json.loads(run(*command, "--worst", "12", "--json", "-").stdout)
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


def test_the_library_gives_the_numbers_of_the_command(run: Run, stage: Path) -> None:
    options = ("--until", "7s", "--samples", "20", "--seed", "3", "--json", "-")
    made = nutdamp.disperse_loop(nutdamp.load(stage), 20, until=7.0, seed=3)
    shown = json.loads(run("disperse", "stage.yaml", "--loop", *options).stdout)
    assert shown == json.loads(json.dumps(made.to_dict(), allow_nan=False))
    assert made.core.settled == made.core.done
    assert made.met_fraction == 1.0


def test_a_case_alone_shows_its_inputs(run: Run, stage: Path) -> None:
    shown = run(
        "disperse", "stage.yaml", "--loop", "--until", "8s", "--case", "7", "--seed", "4", status=0
    )
    check_text("loop.case", shown.stdout)


def test_a_requirement_missed_and_faults_are_said(run: Run, stage: Path) -> None:
    command = ("disperse", "stage.yaml", "--loop", "--until", "8s", "--samples", "8")
    strict = run(*command, "--set", "requirement.nutation=0.001deg")
    assert (strict.returncode, "NOT met" in strict.stdout) == (4, True)
    wrong = run(*command, "--set", "loop.faults={reversed: [N1, N2]}")
    assert (wrong.returncode, "Of the others: stopped in" in wrong.stdout) == (4, True)
    assert "Falls quiet and is not stopped, in" in words(wrong.stdout)
    late = run(*command, *settings("loop.predict=false", "loop.sensor.delay=600ms"))
    assert (late.returncode, late.stdout) == (3, "")
    priced = run(*command[:-1], "2", "--set", "disturbances=[{torque: [0, 0.1 N m, 0]}]")
    assert (priced.returncode, "NOT SHOWN: 100.0 % of cases" in priced.stdout) == (4, True)
    assert "the cases fly one by one" in words(priced.stderr)


def test_a_dispersed_case_is_headed_so_and_changes_of_spin_have_no_sign(
    run: Run, file: str
) -> None:
    dispersed = (*settings("dispersions={A: {normal: 1 %}}"), "--until", "20s")
    assert (
        "\ndispersed case 2 of seed 1: ENOUGH: "
        in run("loop", file, *dispersed, "--case", "2").stdout
    )
    shown = run("disperse", file, "--loop", *dispersed, "--samples", "20").stdout
    (row,) = (line for line in shown.splitlines() if line.startswith("|spin off|, mrad/s"))
    assert "-" not in row.removeprefix("|spin off|, mrad/s")
    assert beside(-1e-9, 1.0) == "0.000"


def test_a_schedule_does_not_use_what_is_of_the_sensor(run: Run, stage: Path) -> None:
    shown = run(
        "disperse", "stage.yaml", "--scheme", "one-pulse", "--samples", "10", "--json", "-"
    ).stdout
    check_text("loop.unused", json.loads(shown)["unused_because"]["sensor delay"])
    assert "sensor delay" in run("check", "stage.yaml", "-v").stdout


def test_a_budget_is_shown_and_written(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    follow_few_cycles(monkeypatch)
    pairs = ("--thresholds", "0.5deg,0.1deg", "--thresholds", "1 deg, 0.1 deg")
    screen = run(
        "budget",
        STAGE,
        *pairs,
        "--csv",
        "b.csv",
        "--json",
        "b.json",
        "--plot",
        "b.svg",
        columns=140,
        status=0,
    )
    assert (
        "Damping must begin within 62.41 s: from 1 deg now the nutation grows to 2 deg."
        in screen.stdout
    )
    written: dict[str, Any] = json.loads((tmp_path / "b.json").read_text())
    assert written["until_largest_s"] == pytest.approx(62.41, abs=0.01)
    rows = table(tmp_path / "b.csv")
    assert [float(row["start_deg"]) for row in rows] == pytest.approx([0.5, 1.0])
    for row, held in zip(rows, written["thresholds"], strict=True):
        assert float(row["pulses_per_day"]) == held["pulses_per_day"]
        for name in ("pulses_per_day", "propellant_kg_per_year"):
            assert f"{held[name]:.4g}" in screen.stdout
        assert (
            held["nutation_low_deg"]
            < held["stop_deg"]
            < held["start_deg"]
            < held["nutation_largest_deg"]
        )
        assert row["meets_requirement"] == "true"
    picture = (tmp_path / "b.svg").read_text()
    assert all(
        text in picture
        for text in ("no firing", "0.500° to 0.100°", "1.00° to 0.100°", "largest allowed")
    )


PARTICULAR = {
    "never quiet": ("loop.start=0.05deg", "loop.stop=0.01deg"),
    "above already": ("requirement.nutation=0.8deg",),
    "missed": ("requirement.nutation=0.3deg",),
    "no nutation": ("state.nutation=0deg",),
    "decays": ("inertia.C=6000 kg m^2",),
    "reversed sensor": ("loop.sensor.scale=-100%",),
    "reversed channel": ("loop.faults.reversed=[N1]",),
}


@pytest.mark.parametrize("name", [*map(deep, [*PARTICULAR][:3]), *[*PARTICULAR][3:]])
def test_what_is_particular_of_a_budget_is_said(
    run: Run, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    follow_few_cycles(monkeypatch)
    screen = run("budget", STAGE, *settings(*PARTICULAR[name]), columns=200)
    lines = [
        line
        for line in screen.stdout.splitlines()
        if line.endswith(".") or line.startswith("warning")
    ]
    text = f"exit {screen.returncode}{', NOT met' * ('NOT met' in screen.stdout)}\n"
    check_text(f"budget.{name.replace(' ', '-')}", text + "\n".join(lines))


def test_without_a_loop_a_budget_says_what_is_missing(run: Run) -> None:
    growing = ("budget", "-q", *settings("dissipation.time_constant=600s"), "--largest", "10deg")
    check_text("budget.without-loop", run(*growing).stdout)
    written = run(*growing, "--csv", "-")
    assert (written.returncode, written.stdout.count("\n")) == (0, 1)


def test_thresholds_without_a_unit_are_read_and_said(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    follow_few_cycles(monkeypatch)
    assert "warning: --thresholds:" in run("budget", STAGE, "--thresholds", "1,0.5").stderr


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


@pytest.fixture
def body(tmp_path: Path) -> Path:
    path = tmp_path / "body.yaml"
    path.write_text(FILE)
    return path


@pytest.mark.usefixtures("body")
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
    "requirements": [
        f"{FEW} 'requirement={{nutation: 9 deg}}'; 4",
        f"{FEW} 'requirement={{nutation: 0.1 deg}}'; 4",
        f"{FEW} 'requirement={{}}'",
    ],
    "refused": [f"{FEW} 'dispersions.C={{bias: 250 %}}'; 2"],
    "weak": [
        "disperse body.yaml --samples 9 --set 'limits={horizon: 4 s}' --set 'requirement={}' "
        "--set 'steerable.torque=1 N m'"
    ],
}


@pytest.mark.usefixtures("body")
@pytest.mark.parametrize("kind", SCREENS)
def test_the_screen(run: Run, kind: str) -> None:
    """What dominates and what is unused; 50 good cases show little."""
    shown = transcript(run, SCREENS[kind], "" if kind == "all cases" else "equirement")
    check_text(f"cli.disperse.{kind}", shown)
    assert "…" not in shown
    assert all(
        len(line) <= 80
        for line in shown.splitlines()
        if kind == "all cases" and not line.startswith("$")
    )


def test_what_is_dispersed_is_the_scheme_the_schedule_or_the_recommended_plan(
    run: Run, body: Path
) -> None:
    """As many cases as other commands fly; the example of dispersions can be pasted."""
    data = result(run, TWO)
    assert (data["scheme"], data["samples"], data["seed"]) == ("two-pulse", 20_000, 1)
    assert call(run, "plan body.yaml --scheme one-pulse --csv p.csv").returncode in (0, 4)
    assert (
        result(run, "disperse body.yaml --schedule p.csv --samples 9", status=4)["scheme"]
        == "p.csv"
    )
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
    big = run(*TWO.split(), "--samples", "1e12", "--csv", "big.csv", status=1)
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
    assert re.search(
        r"^target +tilt 10\.0000 deg, azimuth 45\.0000 deg; H ends .+ deg off$", shown, re.MULTILINE
    )
    assert re.search(r"^spin axis ends at +tilt 1[01]\.[0-9]{4} deg", shown, re.MULTILINE)


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
    shares = np.array([float(percent) / 100.0 for percent in PERCENTS])
    sizes = 1e3 * np.abs(changes)
    assert row_of(shown, "|spin change|")[1:] == pytest.approx(
        [*np.quantile(sizes, shares), sizes.max()], abs=1e-3
    )
    signed = json.loads((tmp_path / "s.json").read_text())["percentiles"]["spin_change_rad_s"]
    assert (signed["min"], signed["max"]) == pytest.approx((changes.min(), changes.max()))


def test_one_case_has_the_nominal_one_of_all(run: Run) -> None:
    for number in (["--samples", "100"], ["--case", "7"]):
        shift = row_of(run("disperse", "--scheme", "four-pulse", *number).stdout, "momentum shift")
        assert shift[0] == 0.1684


@pytest.mark.weekly
@pytest.mark.parametrize("number", [signal.SIGINT, weekly(signal.SIGTERM)])
def test_an_interrupted_run_keeps_what_is_done(
    run: Run, body: Path, number: signal.Signals
) -> None:
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
    while process.poll() is None and not any(
        path.stat().st_size > 0 for path in body.parent.glob("*.part*")
    ):
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
