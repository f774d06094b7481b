"""``nutdamp fit`` as a process: telemetry in, estimates and a spacecraft file out, and a plan from there."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from support.process import Run
from support.synthetic import Array, motion

import nutdamp
from nutdamp.files.examples import example_text
from nutdamp.flight import flown
from nutdamp.physics.valve import Trapezoid

pytestmark = pytest.mark.usefixtures("plans_shared")


def flight(folder: Path, seed: int, *, phase: float = 0.0) -> tuple[float, float, Array]:
    """A minute of 10 Hz gyro data with 0.01 deg/s of noise, of the example with A and C 0.5 % off: A, C, rates."""
    draw = np.random.default_rng(seed)
    A, C = 120.0 * (1.0 + 0.005 * draw.normal()), 80.0 * (1.0 + 0.005 * draw.normal())
    rates = nutdamp.example().omega0 + math.radians(0.1) * draw.normal(size=3)
    rates = np.array([*(rates[:2] * math.cos(phase)), rates[2]])
    times = np.arange(601) / 10.0
    shown = np.degrees(motion((A, A, C), rates, times)) + 0.01 * draw.normal(size=(601, 3))
    lines = ["t_s,omega_1_deg_s,omega_2_deg_s,omega_3_deg_s"]
    lines += [f"{time:.1f}," + ",".join(f"{one:.5f}" for one in row) for time, row in zip(times, shown, strict=True)]
    (folder / "flight.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return A, C, rates


def test_estimates_are_shown_and_written(run: Run, tmp_path: Path) -> None:
    A, C, _ = flight(tmp_path, 1)
    done = run("fit", "flight.csv", "--json", "f.json", "--plot", "f.svg", columns=120)
    assert done.returncode == 0, done.stderr
    assert "A coast fixes C/A only, never A and C apart" in done.stdout
    assert "The data do not tell bias of omega_3: kept as the file has it." in done.stdout
    assert "A and C +0.9999" in done.stdout
    found = json.loads((tmp_path / "f.json").read_text())
    rows = {one["quantity"]: one for one in found["estimates"]}
    ratio = rows["C/A"]
    assert abs(ratio["value"] - C / A) < 4.0 * ratio["sigma"]
    assert ratio["sigma"] < 1e-4
    assert ratio["from"] == "data"
    assert rows["bias_omega_3"]["from"] == "file"
    assert [one["white"] for one in found["record"]["signals"]] == [True] * 3
    assert f"{ratio['value']:.7g}"[:6] in done.stdout
    picture = (tmp_path / "f.svg").read_text()
    for text in ("omega_1, deg/s", "residual, deg/s", "autocorrelation", "3 sigma", "95 % of white noise"):
        assert text in picture


def test_the_file_written_keeps_comments_and_moves_to_an_epoch(run: Run, tmp_path: Path) -> None:
    A, C, rates = flight(tmp_path, 2)
    done = run("fit", "flight.csv", "-o", "now.yaml", "--at", "90s")
    assert done.returncode == 0, done.stderr
    before, after = example_text(), (tmp_path / "now.yaml").read_text()
    comments = [line.partition("#")[2] for line in before.splitlines() if "#" in line]
    assert [line.partition("#")[2] for line in after.splitlines() if "#" in line] == comments
    old = {line.split(":")[0] for line in before.splitlines() if line[:1].isalpha()}
    assert {line.split(":")[0] for line in after.splitlines() if line[:1].isalpha()} == old
    now = nutdamp.load(tmp_path / "now.yaml")
    expected = motion((A, A, C), rates, np.array([0.0, 90.0]))[-1]
    known = now.dispersions
    assert known is not None
    for one, other, tolerance in zip(now.omega0, expected, known.omega0, strict=True):
        assert tolerance is not None
        assert abs(one - other) < 4.0 * tolerance.size
        assert tolerance.size < math.radians(0.05)
    assert {(one, other): value for one, other, value in known.correlation}["A", "C"] > 0.999


@pytest.mark.weekly
def test_fit_plan_disperse_complies_where_the_blind_plan_does_not(run: Run, tmp_path: Path) -> None:
    blind = run("disperse", "-q", "--set", "requirement.probability=99.7%", "--json", "blind.json")
    assert blind.returncode == 4
    shares = {}
    for seed in (3, 4):
        flight(tmp_path, seed)
        assert run("fit", "flight.csv", "-q", "-o", "now.yaml", "--at", "90s").returncode == 0
        done = run("disperse", "now.yaml", "-q", "--set", "requirement.probability=99.7%", "--json", "after.json")
        assert done.returncode == 0, done.stdout
        shares[seed] = json.loads((tmp_path / "after.json").read_text())["requirement"]["met_fraction"]
    assert min(shares.values()) >= 0.997
    assert json.loads((tmp_path / "blind.json").read_text())["requirement"]["met_fraction"] < 0.88


@pytest.mark.weekly
def test_plans_from_the_estimate_meet_the_requirement_on_the_true_bodies(run: Run, tmp_path: Path) -> None:
    met = 0
    for seed in range(30):
        A, C, rates = flight(tmp_path, 100 + seed)
        assert run("fit", "flight.csv", "-q", "-o", "now.yaml", "--at", "90s").returncode == 0
        now = nutdamp.load(tmp_path / "now.yaml")
        plan = nutdamp.compare(now).recommended
        assert plan is not None
        true = motion((A, A, C), rates, np.array([0.0, 90.0]))[-1]
        truth = now.with_(inertia={"A": A, "C": C}, state={"spin": float(true[2])}).replace(omega0=true)
        left = flown(truth, plan.pulses).residual
        met += left.nutation < math.radians(0.5) and left.momentum_shift < math.radians(0.2)
    assert met == 30


def test_faults_and_records_without_content(run: Run, tmp_path: Path) -> None:
    (tmp_path / "bad.csv").write_text("t_s,omega_1\n0,1\n")
    done = run("fit", "bad.csv")
    assert done.returncode == 2
    assert "bad.csv:1:1: omega_1: 'omega_1' is no column of telemetry; expected omega_1_rad_s" in done.stderr
    (tmp_path / "short.csv").write_text(
        "t_s,omega_1_rad_s,omega_2_rad_s\n" + "".join(f"{0.05 * at:.2f},{0.1 + 0.001 * at},0.1\n" for at in range(20))
    )
    done = run("fit", "short.csv", "-o", "now.yaml")
    assert done.returncode == 3
    assert "the record is too short" in done.stderr
    assert not (tmp_path / "now.yaml").exists()
    assert run("fit", "none.csv").returncode == 1
    flight(tmp_path, 1)
    assert run("fit", "flight.csv", "-o", "flight.csv").returncode == 2


def test_settings_become_part_of_the_file(run: Run, tmp_path: Path) -> None:
    flight(tmp_path, 5)
    done = run(
        "fit", "flight.csv", "-q", "-o", "now.yaml", "--set", "thrusters.+M1.force=12N", "--set", "limits.horizon=90s"
    )
    assert done.returncode == 0, done.stderr
    now = nutdamp.load(tmp_path / "now.yaml")
    assert now.limits.horizon == 90.0
    assert now.channels[0].thrusters[0].force == pytest.approx([0.0, -12.0, 0.0])


@pytest.mark.deep
def test_what_a_longer_coast_or_a_probe_pulse_would_leave(run: Run, tmp_path: Path) -> None:
    flight(tmp_path, 6)
    tight = "requirement.nutation=0.1 deg"
    done = run("fit", "flight.csv", "-q", "--next", "--at", "90s", "--json", "f.json", "--set", tight, columns=100)
    assert done.returncode == 0, done.stderr
    ahead = json.loads((tmp_path / "f.json").read_text())["next"]
    coasts = [one for one in ahead["prospects"] if one["probe"] is None]
    assert [one["coast_s"] for one in coasts] == pytest.approx([15.0, 30.0, 60.0, 120.0, 240.0])
    # C/A is told to the bias of the third gyro by any of them, and the nutation that is left comes from the thrust.
    assert ahead["longer_coast_s"] is None
    said = " ".join(done.stdout.split())
    assert "a coast of 240 s would leave" in said
    assert "it does not pay" in said
    probes = [one for one in ahead["prospects"] if one["probe"] is not None]
    assert ahead["probe"] in {one["probe"] for one in probes}
    assert f"One probe pulse of {ahead['probe']}" in said
    now = coasts[2]["nutation_deg"]
    assert min(one["nutation_deg"] for one in probes) < 0.9 * now
    # 2 % of thrust becomes what is left of it beside A, whose scale no record tells.
    assert all(0.0034 < one["sigma_thrust"] < 0.006 for one in probes)


@pytest.mark.deep
def test_the_nutation_shown_is_that_of_as_many_cases_as_the_file_requires(run: Run, tmp_path: Path) -> None:
    flight(tmp_path, 6)
    limits = ("--set", "requirement.nutation=0.1 deg", "--set", "requirement.probability=90%")
    done = run("fit", "flight.csv", "-q", "--next", "--at", "90s", "--json", "f.json", *limits, columns=100)
    assert done.returncode == 0, done.stderr
    said, ahead = " ".join(done.stdout.split()), json.loads((tmp_path / "f.json").read_text())["next"]
    assert ahead["probability"] == 0.9
    assert "in 90 % of cases" in said
    assert "99.7 %" not in said
    probes = [one for one in ahead["prospects"] if one["probe"] is not None]
    assert all(0.0 < one["propellant_kg"] < ahead["propellant_kg"] for one in probes)
    assert all(one["propellant_kg"] is None for one in ahead["prospects"] if one["probe"] is None)
    if ahead["probe"] is not None:
        assert "The probe pulse takes" in said


@pytest.mark.deep
def test_nothing_pays_where_as_many_cases_comply_as_must(run: Run, tmp_path: Path) -> None:
    flight(tmp_path, 6)
    done = run("fit", "flight.csv", "-q", "--next", "--at", "90s", "--json", "f.json")
    said = " ".join(done.stdout.split())
    assert "(99.7 % required): neither a longer coast nor a probe pulse is needed." in said
    assert "pays" not in said
    ahead = json.loads((tmp_path / "f.json").read_text())["next"]
    assert (ahead["longer_coast_s"], ahead["probe"]) == (None, None)


@pytest.mark.deep
def test_the_prospect_of_the_record_as_it_is_agrees_with_its_fit(tmp_path: Path) -> None:
    flight(tmp_path, 7)
    found = nutdamp.fit(tmp_path / "flight.csv", nutdamp.example())
    sigma = next(one.sigma for one in found.estimates() if one.key == "C/A")
    assert found.outlook(90.0).now.ratio == pytest.approx(sigma, rel=0.02)


@pytest.mark.deep
def test_the_library_gives_the_same_file(run: Run, tmp_path: Path) -> None:
    flight(tmp_path, 8)
    assert run("fit", "flight.csv", "-q", "-o", "now.yaml", "--at", "80s", "--json", "f.json").returncode == 0
    found = nutdamp.fit(tmp_path / "flight.csv", nutdamp.example())
    assert found.text(80.0) == (tmp_path / "now.yaml").read_text()
    found.write(tmp_path / "library.yaml", 80.0)
    assert (tmp_path / "library.yaml").read_bytes() == (tmp_path / "now.yaml").read_bytes()
    assert len(found.figure().axes) >= 3
    assert json.loads(json.dumps(found.to_dict(80.0))) == json.loads((tmp_path / "f.json").read_text())
    assert found.spacecraft(80.0).omega0 == pytest.approx(nutdamp.load(tmp_path / "now.yaml").omega0, rel=1e-12)
    with pytest.raises(nutdamp.errors.BadRequest, match="no field replaced"):
        nutdamp.fit(tmp_path / "flight.csv", nutdamp.example().replace(mass=200.0)).text()


@pytest.mark.deep
def test_a_fitted_file_is_fitted_again_with_what_was_known(run: Run, tmp_path: Path) -> None:
    """The second fit adds to the first: A keeps the sigma that two tolerances and the ratio leave it."""
    flight(tmp_path, 9)
    assert run("fit", "flight.csv", "-q", "-o", "now.yaml").returncode == 0
    first = nutdamp.fit(tmp_path / "flight.csv", nutdamp.example())
    again = nutdamp.fit(tmp_path / "flight.csv", nutdamp.load(tmp_path / "now.yaml"))
    one, other = ({row.key: row for row in found.estimates()} for found in (first, again))
    assert one["A"].sigma == pytest.approx(0.005 * 120.0 / math.sqrt(2.0), rel=0.02)
    assert other["A"].sigma == pytest.approx(one["A"].sigma, rel=0.01)
    assert other["A"].value == pytest.approx(one["A"].value, abs=0.05 * one["A"].sigma)
    assert other["C/A"].sigma == pytest.approx(one["C/A"].sigma / math.sqrt(2.0), rel=0.05)


@pytest.mark.weekly
def test_thrusters_are_calibrated_by_the_schedule_that_was_fired(run: Run, tmp_path: Path) -> None:
    (tmp_path / "probe.csv").write_text("start_s,on_time_s,channel\n8,0.3,+M1\n16,0.3,-M2\n", encoding="utf-8")
    flown_so = ("--set", "thrusters.+M1.force=9.5N", "--set", "inertia.C=80.3 kg m^2")
    made = run(
        "simulate", "-q", "--schedule", "probe.csv", "--flown", "--until", "24s", "--samples", "161", "--csv", "t.csv",
        *flown_so,
    )  # fmt: skip
    assert made.returncode in (0, 4), made.stderr
    rows = [line.split(",")[:4] for line in (tmp_path / "t.csv").read_text().splitlines()]
    (tmp_path / "gyro.csv").write_text("\n".join(",".join(row) for row in rows) + "\n", encoding="utf-8")
    done = run("fit", "gyro.csv", "-q", "--schedule", "probe.csv", "-o", "now.yaml", "--at", "30s", "--json", "f.json")
    assert done.returncode == 0, done.stderr
    rows_ = {one["quantity"]: one for one in json.loads((tmp_path / "f.json").read_text())["estimates"]}
    assert rows_["thrust +M1"]["value"] / rows_["A"]["value"] == pytest.approx(0.95 / 120.0, rel=1e-4)
    assert rows_["thrust -M2"]["value"] / rows_["A"]["value"] == pytest.approx(1.0 / 120.0, rel=1e-4)
    assert abs(rows_["delay +M1"]["value"]) < 0.1
    now = nutdamp.load(tmp_path / "now.yaml")
    force = {one.name: one.thrusters[0].force for one in now.channels}["+M1"]
    assert force == pytest.approx([0.0, -10.0 * rows_["thrust +M1"]["value"], 0.0])
    known = now.dispersions
    assert known is not None
    assert known.thrust["+M1"].size < 0.006
    assert known.thrust["-M1"].size == 0.02  # did not fire: stays as it was
    pairs = {frozenset(one[:2]): one[2] for one in known.correlation}
    assert pairs[frozenset(("thrust +M1", "A"))] > 0.99


@pytest.mark.weekly
def test_a_delay_becomes_that_of_the_valve_and_a_second_fit_finds_none(run: Run, tmp_path: Path) -> None:
    (tmp_path / "probe.csv").write_text("start_s,on_time_s,channel\n8,0.3,+M1\n16,0.3,-M2\n", encoding="utf-8")
    late = "valve={open_delay: 40 ms, close_delay: 40 ms}"
    made = run(
        "simulate", "-q", "--schedule", "probe.csv", "--flown", "--until", "24s", "--samples", "161", "--csv", "t.csv",
        "--set", late,
    )  # fmt: skip
    assert made.returncode in (0, 4), made.stderr
    lines = [line.split(",")[:4] for line in (tmp_path / "t.csv").read_text().splitlines()]
    (tmp_path / "gyro.csv").write_text("\n".join(",".join(row) for row in lines) + "\n", encoding="utf-8")
    done = run("fit", "gyro.csv", "--schedule", "probe.csv", "-o", "now.yaml", "--json", "f.json")
    assert done.returncode == 0, done.stderr
    assert "is not written" not in done.stderr
    for name in ("+M1", "-M2"):
        valve = next(one for one in nutdamp.load(tmp_path / "now.yaml").channels if one.name == name).valve
        assert isinstance(valve, Trapezoid)
        assert (valve.open_delay, valve.close_delay) == pytest.approx((0.04, 0.04), abs=1e-5)
    done = run("fit", "gyro.csv", "now.yaml", "-q", "--schedule", "probe.csv", "--json", "f.json")
    assert done.returncode == 0, done.stderr
    rows = {one["quantity"]: one for one in json.loads((tmp_path / "f.json").read_text())["estimates"]}
    assert max(abs(rows[f"delay {name}"]["value"]) for name in ("+M1", "-M2")) < 0.01  # ms


@pytest.mark.deep
def test_remarks_are_in_the_json_and_biases_without_a_key_are_named(run: Run, tmp_path: Path) -> None:
    flight(tmp_path, 11)
    lines = (tmp_path / "flight.csv").read_text().splitlines()
    moved = [f"{t},{float(x) + 0.05:.5f},{y},{z}" for t, x, y, z in (line.split(",") for line in lines[1:])]
    (tmp_path / "biased.csv").write_text("\n".join([lines[0], *moved]) + "\n", encoding="utf-8")
    done = run("fit", "biased.csv", "--schedule", "late.csv", "--json", "f.json")
    assert done.returncode == 1
    (tmp_path / "late.csv").write_text("start_s,on_time_s,channel\n99,0.3,+M1\n", encoding="utf-8")
    done = run("fit", "biased.csv", "--schedule", "late.csv", "--json", "f.json", columns=200)
    assert done.returncode == 0, done.stderr
    said = json.loads((tmp_path / "f.json").read_text())["notes"]
    assert any(one.startswith("the whole schedule is outside the record") for one in said)
    assert any(one.startswith("a coast fixes C/A only") for one in said)
    flat = " ".join((done.stdout + done.stderr).split()).lower()
    assert all(" ".join(one.split()).lower() in flat for one in said)


@pytest.mark.weekly
def test_a_schedule_that_does_not_match_the_record_is_doubted(run: Run, tmp_path: Path) -> None:
    """Pulses of +M2 at 20 s: in the schedule a second late, of the channel across, or after the record."""
    (tmp_path / "fired.csv").write_text("start_s,on_time_s,channel\n20,0.5,+M2\n", encoding="utf-8")
    made = run(
        "simulate", "-q", "--schedule", "fired.csv", "--flown", "--until", "30s", "--samples", "151", "--csv", "t.csv"
    )
    assert made.returncode in (0, 4), made.stderr
    table = [line.split(",")[:4] for line in (tmp_path / "t.csv").read_text().splitlines()]
    draw = np.random.default_rng(3)
    noisy = [[row[0], *(f"{float(one) + 1e-4 * draw.normal():.7f}" for one in row[1:])] for row in table[1:]]
    (tmp_path / "gyro.csv").write_text("\n".join(",".join(row) for row in [table[0], *noisy]) + "\n", encoding="utf-8")
    said = {}
    for name, row in (("late", "21,0.5,+M2"), ("other", "20,0.5,-M2"), ("after", "20,0.5,+M2\n100,0.5,+M1")):
        (tmp_path / "s.csv").write_text(f"start_s,on_time_s,channel\n{row}\n", encoding="utf-8")
        done = run("fit", "gyro.csv", "--schedule", "s.csv", "-o", f"{name}.yaml", columns=140)
        assert done.returncode == 0, done.stderr
        assert "e+0" not in done.stdout + done.stderr
        said[name] = " ".join((done.stdout + done.stderr).split())
    assert (
        "The times of +M2 in the schedule are 1.000 s late against the record: do both count from the same t = 0? The"
        in said["late"]
    )
    assert "the delay of +M2, -1000 ms, is not written" in said["late"]
    assert "it pushes the other way: another channel, or reversed?" in said["other"]
    assert "-M2 gave -100 % of its thrust: it pushes the other way" in said["other"]
    assert "schedule 1 pulse fired meanwhile" in said["after"]
    assert "1 of 2 pulses of the schedule is outside the record, 0 s to 30 s" in said["after"]
    assert "thrust factor of +M1" not in said["after"]
    thrust = nutdamp.load(tmp_path / "after.yaml").dispersions
    assert thrust is not None
    assert thrust.thrust["+M1"].size == 0.02


@pytest.mark.deep
def test_a_channel_that_did_not_fire_is_not_calibrated(run: Run, tmp_path: Path) -> None:
    flight(tmp_path, 10)
    (tmp_path / "probe.csv").write_text("start_s,on_time_s,channel\n20,0.3,+M1\n", encoding="utf-8")
    lines = (tmp_path / "flight.csv").read_text().splitlines()
    (tmp_path / "few.csv").write_text("\n".join(lines[:1] + lines[1::5]) + "\n", encoding="utf-8")
    done = run("fit", "few.csv", "--schedule", "probe.csv", "-o", "now.yaml")
    assert done.returncode == 0, done.stderr
    assert "did it fire? Its force stays as it was" in done.stderr
    now = nutdamp.load(tmp_path / "now.yaml")
    assert now.channels[0].thrusters[0].force == pytest.approx([0.0, -10.0, 0.0])
    assert now.dispersions is not None
    assert now.dispersions.thrust["+M1"].size == 0.02


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("omega_3_rad_s", 180.0, "is 57.3 times the spin of the spacecraft file (3.142 rad/s): are the values of"),
        ("omega_3_rad_s", 30.0, "this column in rpm?"),
        ("omega_3_deg_s", math.pi, "this column in rad/s?"),
        ("omega_3_deg_s", -30.0, "this column in rpm?"),
        ("omega_3_rad_s", math.pi**2 / 180.0, "is the spin of the file in deg/s?"),
    ],
)
def test_rates_in_another_unit_are_a_fault_of_their_column(
    run: Run, tmp_path: Path, column: str, value: float, said: str
) -> None:
    rows = "".join(f"{at},{0.1 * math.cos(at)},{value * (1.0 + 1e-3 * math.sin(at))}\n" for at in range(40))
    (tmp_path / "unit.csv").write_text(f"t_s,omega_1_{column[8:]},{column}\n{rows}", encoding="utf-8")
    done = run("fit", "unit.csv")
    assert done.returncode == 2
    assert f"unit.csv:1:1: {column}: its median" in done.stderr
    assert said in done.stderr


def test_of_many_faults_of_a_column_the_first_are_listed(run: Run, tmp_path: Path) -> None:
    rows = "".join(f"{at},x,{'y' if at < 6 else 0.1}\n" for at in range(601))
    (tmp_path / "bad.csv").write_text(f"t_s,omega_1_rad_s,omega_2_rad_s\n{rows}", encoding="utf-8")
    done = run("fit", "bad.csv")
    assert done.returncode == 2
    of_first, of_second = ([line for line in done.stderr.splitlines() if name in line] for name in ("_1_", "_2_"))
    assert len(of_first) == 6
    assert of_first[-1] == "bad.csv:7:1: omega_1_rad_s: and 596 more such rows"
    assert len(of_second) == 6
    assert "more" not in of_second[-1]


def test_the_picture_has_a_heading_and_shows_no_rounding_as_noise(run: Run, tmp_path: Path) -> None:
    """Of data without noise the third rate is constant: neither residuals nor autocorrelations say anything."""
    times, example = np.arange(601) / 10.0, nutdamp.example()
    A, C = example.inertia.A, example.inertia.C
    rates = motion((A, A, C), example.omega0, times)
    lines = ["t_s,omega_1_rad_s,omega_2_rad_s,omega_3_rad_s"]
    lines += [f"{time:.1f}," + ",".join(map(repr, row.tolist())) for time, row in zip(times, rates, strict=True)]
    (tmp_path / "flight.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = run("fit", "flight.csv", "--plot", "f.svg")
    assert done.returncode == 0, done.stderr
    picture = (tmp_path / "f.svg").read_text()
    for text in (f"{example.name}: telemetry and fit", "only rounding:", "no autocorrelation"):
        assert text in picture
    assert picture.count(">time, s<") == 1  # of the data; the panels of residuals are words, which have no scale
