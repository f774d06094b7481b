"""``nutdamp disperse --loop`` and ``loop --case`` as users run them."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from support.process import Run

import nutdamp

pytestmark = pytest.mark.usefixtures("plans_shared")


@pytest.fixture
def stage(run: Run, tmp_path: Path) -> Path:
    run("init", "--from", "upper-stage", "stage.yaml")
    return tmp_path / "stage.yaml"


@pytest.mark.deep
def test_cases_their_table_their_files(run: Run, stage: Path, tmp_path: Path) -> None:
    command = ("disperse", "stage.yaml", "--loop", "--until", "8s", "--samples", "120", "--worst", "2")
    done = run(*command, "--csv", "c.csv", "--json", "c.json", "--plot", "c.svg")
    assert done.returncode == 0, done.stderr
    shown = " ".join(done.stdout.split())
    assert "Falls quiet in 100.0 % of cases" in shown
    assert "Dead band (at most 0.1281 deg, from the nominal sensor): kept in" in shown
    assert "Requirement (nutation within 2 deg) met:" in shown
    assert "Each firing draws anew, one sigma or bias: thrust per pulse 1 %." in shown
    found = json.loads((tmp_path / "c.json").read_text())
    assert found["settled"]["fraction"] == 1.0
    assert found["until_s"] == 8.0
    assert found["percentiles"]["settled_s"]["50"] == pytest.approx(5.4, abs=0.3)
    assert set(found["shares"]["propellant_kg"]) >= {"omega0_1", "sensor bias", "sensor delay"}
    rows = list(csv.DictReader((tmp_path / "c.csv").read_text().splitlines()))
    assert [row["case"] for row in rows] == [str(number) for number in range(1, 121)]
    worst = found["worst"][0]
    row = rows[worst["case"] - 1]
    assert float(row["largest_nutation_deg"]) == worst["largest_nutation_deg"]
    assert max(float(one["largest_nutation_deg"]) for one in rows) == worst["largest_nutation_deg"]
    assert float(row["sensor_delay_s"]) == worst["inputs"]["sensor delay"]
    assert "<svg" in (tmp_path / "c.svg").read_text()[:2000]
    again = run(*command[:-4], "--case", str(worst["case"]), "--json", "-")
    alone = json.loads(again.stdout)
    assert alone["inputs"] == worst["inputs"]
    assert alone["largest_nutation_deg"] == pytest.approx(worst["largest_nutation_deg"], rel=1e-12)
    loop = run("loop", "stage.yaml", "--until", "8s", "--case", str(worst["case"]), "--json", "l.json")
    assert loop.returncode == 0, loop.stderr
    assert f"Dispersed case {worst['case']} of seed 1 meets the requirement." in " ".join(loop.stdout.split())
    flown = json.loads((tmp_path / "l.json").read_text())
    assert (flown["seed"], flown["case"]) == (1, worst["case"])
    assert flown["quiet_s"][0] == pytest.approx(worst["settled_s"], abs=1e-9)
    assert len(flown["pulses"]) == worst["firings"]
    assert flown["propellant_kg"] == pytest.approx(worst["propellant_kg"], rel=1e-9)


def test_the_csv_has_the_angles_to_cones_at_the_end_of_its_rows(run: Run, stage: Path, tmp_path: Path) -> None:
    command = ("disperse", "stage.yaml", "--loop", "--until", "6s", "--samples", "20", "--csv", "c.csv")
    run(*command)
    plain = (tmp_path / "c.csv").read_bytes().splitlines()
    attitude = "attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}\n"
    cones = "keep: [{name: North Star, direction: [30 deg, 80 deg], min: 1 deg}]\n"
    stage.write_text(f"{stage.read_text()}\n{attitude * ('attitude:' not in stage.read_text())}{cones}")
    found = json.loads(run(*command, "--worst", "20", "--json", "-").stdout)
    watched = (tmp_path / "c.csv").read_bytes().splitlines()
    assert [line.rsplit(b",", 2)[0] for line in watched] == plain
    rows = list(csv.DictReader(line.decode() for line in watched))
    assert list(rows[0])[-2:] == ["North_Star_least_deg", "North_Star_largest_deg"]
    assert len(found["worst"]) == 20
    for worst in found["worst"]:
        row, (angles,) = rows[worst["case"] - 1], worst["aspects"]
        assert float(row["North_Star_least_deg"]) == angles["least_deg"] < angles["largest_deg"]
        assert float(row["North_Star_largest_deg"]) == angles["largest_deg"]


def test_the_library_gives_the_numbers_of_the_command(run: Run, stage: Path) -> None:
    shown = run("disperse", "stage.yaml", "--loop", "--until", "7s", "--samples", "40", "--seed", "3", "--json", "-")
    made = nutdamp.disperse_loop(nutdamp.load(stage), 40, until=7.0, seed=3)
    assert json.loads(shown.stdout) == json.loads(json.dumps(made.to_dict(), allow_nan=False))
    assert made.settled_fraction == made.met_fraction == 1.0
    with pytest.raises(nutdamp.errors.BadRequest, match="seed"):
        nutdamp.disperse_loop(nutdamp.load(stage), 40, seed=-1)


def test_a_case_alone_shows_its_inputs(run: Run, stage: Path) -> None:
    done = run("disperse", "stage.yaml", "--loop", "--until", "8s", "--case", "7", "--seed", "4")
    assert done.returncode == 0, done.stderr
    assert "loop, seed 4, case 7" in done.stdout
    assert "sensor delay" in done.stdout
    assert "nutdamp loop --seed 4 --case 7" in done.stdout


def test_a_requirement_missed_and_faults_are_said(run: Run, stage: Path) -> None:
    command = ("disperse", "stage.yaml", "--loop", "--until", "8s", "--samples", "30")
    strict = run(*command, "--set", "requirement.nutation=0.001deg")
    assert strict.returncode == 4
    assert "NOT met" in strict.stdout
    wrong = run(*command, "--set", "loop.faults={reversed: [N1, N2]}")
    assert wrong.returncode == 4
    assert "Of the others: stopped in" in wrong.stdout
    late = run(*command, "--set", "loop.predict=false", "--set", "loop.sensor.delay=600ms")
    assert (late.returncode, late.stdout) == (3, "")
    assert "does not damp" in late.stderr


def test_cases_that_fly_one_by_one_say_their_price(run: Run, stage: Path) -> None:
    command = ("disperse", "stage.yaml", "--loop", "--until", "6s", "--samples", "3")
    done = run(*command, "--set", "disturbances=[{torque: [0, 0.1 N m, 0]}]")
    assert done.returncode == 0, done.stderr
    said = " ".join(done.stderr.split())
    assert "disturbances: the cases fly one by one, and look at about" in said
    assert "which takes about" in said


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--loop", "--scheme", "two-pulse"), "--loop flies the loop of the file, all in one way: leave --scheme out"),
        (("--loop", "--threads", "2"), "leave --threads out"),
        (("--loop", "--plot", "x.svg", "--figure", "budget"), "leave --figure out"),
        (("--until", "9s"), "--until is for --loop"),
        (("--loop", "--until", "0s"), "expected a time after t = 0"),
    ],
)
def test_what_does_not_go_together_is_refused(run: Run, stage: Path, options: tuple[str, ...], message: str) -> None:
    done = run("disperse", "stage.yaml", *options)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())


def test_what_a_file_lacks_is_said(run: Run, stage: Path, tmp_path: Path) -> None:
    run("init", "plain.yaml")
    assert "the spacecraft file has no loop" in run("disperse", "plain.yaml", "--loop").stderr
    (tmp_path / "exact.yaml").write_text(stage.read_text().partition("dispersions:\n")[0])
    assert "dispersions" in run("disperse", "exact.yaml", "--loop").stderr
    assert run("loop", "exact.yaml", "--case", "3").returncode == 2


def test_a_schedule_does_not_use_what_is_of_the_sensor(run: Run, stage: Path) -> None:
    done = run("disperse", "stage.yaml", "--scheme", "one-pulse", "--samples", "50", "--json", "-")
    unused = json.loads(done.stdout)["unused_because"]
    assert unused["sensor delay"] == "a schedule is fired whatever a sensor shows: --loop flies the loop"


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("dispersions.sensor_bias={normal: 0.01 deg/s}", "is not in the unit of the sensor: m/s^2"),
        ("dispersions.sensor_bias={normal: 3 kg}", "is a mass; expected an angular rate"),
        ("dispersions.sensor_scale={normal: 60 %}", "expected one sigma of at most 50 %"),
        ("dispersions.sensor_noise={normal: -5 %}", "is negative"),
        ("dispersions.sensor_noise={uniform: 120 %}", "below 100 %"),
        ("dispersions.sensor_delay={bias: -30 ms}", "with this offset the delay is -0.01 s"),
        ("dispersions.sensor_delay={normal: 5 ms, uniform: 5 ms}", "given together with normal"),
        ("dispersions.sensor_dealy={normal: 5 ms}", "sensor_delay"),
    ],
)
def test_senseless_numbers_of_the_sensor_are_refused(run: Run, stage: Path, setting: str, message: str) -> None:
    done = run("check", "stage.yaml", "--set", setting)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())


def test_dispersions_of_a_sensor_need_a_loop_and_are_shown_by_check(run: Run, stage: Path, tmp_path: Path) -> None:
    shown = run("check", "stage.yaml").stdout
    assert "sensor delay" in shown
    text = stage.read_text()
    begin = text.index("\nloop:")
    (tmp_path / "none.yaml").write_text(text[:begin] + "\n" + text[text.index("dispersions:") :])
    done = run("check", "none.yaml")
    assert done.returncode == 2
    assert "is of the sensor of a loop, and the file has no loop" in done.stderr
