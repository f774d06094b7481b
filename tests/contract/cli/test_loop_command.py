"""``nutdamp loop`` as a process: what it shows, writes, refuses and names."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from support.cases import spread
from support.process import Run

from nutdamp.presentation.dispersion_tables import beside

pytestmark = pytest.mark.usefixtures("plans_shared")

BODY = """
name: Upper
inertia: {A: 100 kg m^2, C: 70 kg m^2}
omega0: [0.042 rad/s, 0.036 rad/s, 3 rad/s]
thrusters:
  - {name: +M1, torque: [ 20, 0, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms, max_on_time: 50 ms}
  - {name: -M1, torque: [-20, 0, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms, max_on_time: 50 ms}
  - {name: +M2, torque: [0,  20, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms, max_on_time: 50 ms}
  - {name: -M2, torque: [0, -20, 0], isp: 220 s, lever_arm: 1 m, min_on_time: 5 ms, max_on_time: 50 ms}
requirement: {nutation: 0.3 deg}
"""
LOOP = """
loop:
  sensor: {kind: gyro, rate: 100 Hz, noise: 0.01 deg/s, bias: 0.02 deg/s, delay: 20 ms}
  start: 0.2 deg
  stop: 0.05 deg
  min_interval: 0.5 s
"""


@pytest.fixture
def file(tmp_path: Path) -> str:
    (tmp_path / "craft.yaml").write_text(BODY + LOOP)
    return "craft.yaml"


def test_a_loop_is_flown_and_written(run: Run, file: str, tmp_path: Path) -> None:
    done = run("loop", file, "--json", "loop.json", "--csv", "pulses.csv", "--track", "track.csv")
    assert done.returncode == 0, done.stderr
    for text in ("Loop: four-pulse, from gyros (100 Hz)", "met with nominal values", "first quiet", "dead band"):
        assert text in done.stdout
    found = json.loads((tmp_path / "loop.json").read_text())
    assert found["stopped"] == "end"
    assert found["channel"] is None
    assert found["meets_requirement"] is True
    assert found["quiet_s"][0] > found["pulses"][-1]["start_s"]
    assert found["largest_since_quiet_deg"] <= found["dead_band_deg"]
    assert {one["damps"] for one in found["margins"]} == {True}
    rows = list(csv.DictReader(io.StringIO((tmp_path / "pulses.csv").read_text())))
    assert [row["channel"] for row in rows] == [one["channel"] for one in found["pulses"]]
    track = list(csv.DictReader(io.StringIO((tmp_path / "track.csv").read_text())))
    assert float(track[-1]["nutation_deg"]) == pytest.approx(found["flown"]["nutation_deg"])


def test_the_pulses_fired_again_give_the_same_flight(run: Run, file: str) -> None:
    flown = json.loads(run("loop", file, "--until", "40s", "--csv", "p.csv", "--json", "-").stdout)
    again = json.loads(run("simulate", file, "--schedule", "p.csv", "--flown", "--until", "40s", "--json", "-").stdout)
    assert again["flown"]["nutation_deg"] == pytest.approx(flown["flown"]["nutation_deg"], rel=1e-9)
    for one, other in zip(again["pulses"], flown["pulses"], strict=True):
        assert one["nutation_after_deg"] == pytest.approx(other["nutation_after_deg"], rel=1e-9)


def test_seeds_are_other_noise(run: Run, file: str) -> None:
    one, same, other = (run("loop", file, "-q", "--csv", "-", "--seed", seed).stdout for seed in ("3", "3", "4"))
    assert one == same
    assert one != other


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ("loop.faults.reversed=[+M1]", "channel +M1 is wired backwards"),
        ("loop.sensor.scale=-100%", "the sensor is reversed"),
    ],
)
def test_what_is_wired_backwards_is_named(run: Run, file: str, tmp_path: Path, setting: str, named: str) -> None:
    done = run("loop", file, "--set", setting, "--json", "loop.json")
    assert done.returncode == 3
    assert named in done.stderr
    assert "Stopped: after" in done.stdout
    checked = run("check", file, "--set", setting)
    assert checked.returncode == 0
    assert "Warning: loop" in checked.stdout
    assert json.loads((tmp_path / "loop.json").read_text())["meets_requirement"] is False


def test_too_late_is_refused_with_what_is_allowed(run: Run, file: str) -> None:
    late = ("--set", "loop.predict=false", "--set", "loop.sensor.delay=2s")
    done = run("loop", file, *late)
    assert (done.returncode, done.stdout) == (3, "")
    assert "shorten the delays by 0.8" in done.stderr
    checked = " ".join(run("check", file, *late).stdout.split())
    assert "Warning: the loop does not damp" in checked
    found = json.loads(run("check", file, *late, "--json", "-").stdout)["files"][0]["loop"]
    assert {one["damps"] for one in found} == {False}
    assert found[0]["delay_margin_s"] < 0.0


def test_a_requirement_that_is_missed_is_said(run: Run, file: str) -> None:
    done = run("loop", file, "--set", "requirement.nutation=1e-4 deg")
    assert done.returncode == 4
    assert "NOT met" in done.stdout


@pytest.mark.deep
def test_a_loop_that_is_never_quiet_misses_the_requirement_alone_as_in_a_study(run: Run, file: str) -> None:
    never = ("--set", "loop.stop=1e-8 deg", "--until", "60s")
    done = run("loop", file, *never, "--json", "-", "-q")
    found = json.loads(done.stdout)
    assert (done.returncode, found["meets_requirement"], found["quiet_s"]) == (4, False, [])
    assert found["flown"]["nutation_deg"] < 0.3
    assert "Requirement NOT met: the loop is never down to its stop threshold" in run("loop", file, *never).stdout
    cases = ("--set", "dispersions={A: {normal: 0.01 %}}", "--samples", "20", "--json", "-", "-q")
    found = json.loads(run("disperse", file, "--loop", *never, *cases).stdout)
    assert found["requirement"]["met_fraction"] == 0.0
    done = run("loop", file, "--set", "loop.stop=0")
    assert (done.returncode, "never: loop.stop is 0" in done.stdout) == (0, True)
    still = run("loop", file, "--set", "omega0=[0, 0, 3]").stdout
    assert "it never shows the start threshold" in " ".join(still.split())


def test_a_dispersed_case_is_headed_so_and_changes_of_spin_have_no_sign(run: Run, file: str) -> None:
    spread = ("--set", "dispersions={A: {normal: 1 %}}", "--until", "20s")
    head = next(line for line in run("loop", file, *spread, "--case", "2").stdout.splitlines() if " limit " in line)
    assert "this case" in head
    assert "nominal" not in head
    shown = run("disperse", file, "--loop", *spread, "--samples", "50").stdout
    (row,) = (line for line in shown.splitlines() if line.startswith("spin off, mrad/s"))
    assert "-" not in row.removeprefix("spin off, mrad/s")
    assert beside(-1e-9, 1.0) == "0.000"
    stopped = run("disperse", file, "--loop", *spread, "--samples", "50", "--set", "loop.faults.reversed=[+M1]").stdout
    assert "Falls quiet and is not stopped, in" in " ".join(stopped.split())


def test_a_cone_that_is_broken_on_the_way_is_no_met_requirement(run: Run, file: str, tmp_path: Path) -> None:
    sky = "attitude: {quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: EME2000}\n"
    near = "keep: [{name: star, direction: [0 deg, 85 deg], min: 8 deg}]\n"
    (tmp_path / "seen.yaml").write_text(BODY + LOOP + sky + near)
    done = run("loop", "seen.yaml", "--json", "loop.json")
    assert done.returncode == 4
    assert "NOT met" in done.stdout
    assert json.loads((tmp_path / "loop.json").read_text())["meets_requirement"] is False
    (tmp_path / "seen.yaml").write_text(BODY + LOOP + sky + near.replace("8 deg", "1 deg"))
    assert run("loop", "seen.yaml").returncode == 0


def test_where_nutation_grows_the_default_end_comes_after_a_cycle(run: Run, file: str) -> None:
    found = json.loads(run("loop", file, "--set", "dissipation={time_constant: 600 s}", "--json", "-").stdout)
    assert len(found["quiet_s"]) >= 2
    assert found["pulses"][-1]["start_s"] > 500.0


def test_a_file_without_a_loop_is_told_what_to_write(run: Run, tmp_path: Path) -> None:
    (tmp_path / "bare.yaml").write_text(BODY)
    done = run("loop", "bare.yaml")
    assert (done.returncode, done.stdout) == (2, "")
    assert "sensor: {kind: gyro" in done.stderr
    assert run("loop", "bare.yaml", "--until", "-1s").returncode == 2
    assert run("loop", "bare.yaml", "--plot", "x.txt").returncode == 2


def test_start_below_the_smallest_pulse_is_warned_of(run: Run, file: str) -> None:
    done = run("loop", file, "--set", "loop.start=0.02deg", "--set", "loop.stop=0.001deg")
    shown = " ".join(done.stdout.split())
    assert "loop.start is below 0.02728 deg, which the smallest pulse takes away" in shown
    assert "noise, bias and steps of the sensor" in shown


@pytest.mark.deep
@spread("sensor", ["{kind: gyro}", "{kind: accelerometer, rate: 20 Hz, position: [1, 0, 0]}"], quick=1)
def test_picture(run: Run, file: str, tmp_path: Path, sensor: str) -> None:
    done = run("loop", file, "--set", f"loop.sensor={sensor}", "--plot", "l.svg")
    assert done.returncode == 0, done.stderr
    assert "start" in (tmp_path / "l.svg").read_text()


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            "loop.sensor.rate=1e9Hz",
            "more than a million samples a nutation period of 1.273 s; expected at most 7.857e+05 Hz",
        ),
        ("loop.sensor.delay=1e6s", "nutation periods; expected at most 20 of them, 25.45 s"),
        ("loop.sensor.low_pass=30s", "low_pass: 30 s is 23.6 nutation periods"),
        ("loop.settle=30s", "settle: 30 s is 23.6 nutation periods"),
        ("loop.sensor.scale=2000%", "2000 % is no scale of a sensor; expected 10 % to 1000 %"),
        ("loop.sensor.scale=-1%", "-1 % is no scale of a sensor"),
        ("loop.sensor={kind: gyro, bias: 2 deg/s}", "bias: 2 deg/s hides start, which shows as 0.6732 deg/s"),
    ],
)
def test_senseless_numbers_are_refused(run: Run, setting: str, message: str) -> None:
    run("init", "--from", "upper-stage", "stage.yaml")
    done = run("check", "stage.yaml", "--set", setting)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert run("check", "stage.yaml", "--set", "loop.sensor.bias=3m/s^2").returncode == 0  # it is fitted
