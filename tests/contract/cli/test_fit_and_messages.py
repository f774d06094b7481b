"""fit, export and import: telemetry and messages in; estimates, messages and files out."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import places
from support.builders import present
from support.commands import DATED, call, contents, refusals, result, written
from support.golden import check_text
from support.process import Run
from support.telemetry import Array, motion

import nutdamp
from nutdamp.errors import BadRequest
from nutdamp.files.reader import example_text
from nutdamp.flight.propagation import flown
from nutdamp.physics.thruster import Trapezoid

pytestmark = pytest.mark.usefixtures("plans_shared")

PROBE = "start_s,on_time_s,channel\n"
COMMENTS = [line.partition("#")[2] for line in example_text().splitlines() if "#" in line]


def write_rows(path: Path, header: str, rows: Array, digits: int = 5) -> None:
    """A CSV file of telemetry."""
    lines = [
        f"{row[0]:.6g}," + ",".join(f"{value:.{digits}f}" for value in row[1:]) for row in rows
    ]
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")


def flight(
    folder: Path, seed: int, *, every: int = 1, bias: float = 0.0, wide: bool = False
) -> tuple[float, float, Array]:
    """A minute of 10 Hz gyro data, 0.01 deg/s of noise, of the example or, ``wide``, of `WIDE`."""
    draw, (moments, degrees) = np.random.default_rng(seed), (0.005, 0.1) if wide else (0.002, 0.05)
    A, C = 120.0 * (1.0 + moments * draw.normal()), 80.0 * (1.0 + moments * draw.normal())
    rates = nutdamp.example().omega0 + math.radians(degrees) * draw.normal(size=3)
    rates = np.array([*rates[:2], rates[2]])
    times = np.arange(601) / 10.0
    shown = (
        np.degrees(motion((A, A, C), rates, times))
        + 0.01 * draw.normal(size=(601, 3))
        + [bias, 0.0, 0.0]
    )
    header = "t_s,omega_1_deg_s,omega_2_deg_s,omega_3_deg_s"
    write_rows(folder / "flight.csv", header, np.column_stack([times, shown])[::every])
    return A, C, rates


def fly_probe(
    run: Run, folder: Path, rows: str, until: int, *changed: str, samples: int = 151
) -> Array:
    """Time and rates in rad/s, (n, 4), of a flight in which probe.csv is fired."""
    (folder / "probe.csv").write_text(f"{PROBE}{rows}\n", encoding="utf-8")
    command = [
        "simulate",
        "-q",
        "--schedule",
        "probe.csv",
        "--flown",
        "--until",
        f"{until}s",
        "--csv",
        "t.csv",
    ]
    run(
        *command,
        "--samples",
        str(samples),
        *(part for each in changed for part in ("--set", each)),
        status=(0, 4),
    )
    return np.loadtxt(folder / "t.csv", delimiter=",", skiprows=1, usecols=range(4))


RATES = "t_s,omega_1_rad_s,omega_2_rad_s,omega_3_rad_s"


def fit(run: Run, *arguments: str, columns: int = 200) -> str:
    """What ``fit`` shows, on one line, of a record that can be fitted."""
    screen = run("fit", "-v", *arguments, columns=columns, status=0)
    return " ".join((screen.stdout + screen.stderr).split())


def results(folder: Path, name: str = "f.json") -> dict[str, Any]:
    return dict(json.loads((folder / name).read_text()))


def estimates(folder: Path) -> dict[str, dict[str, Any]]:
    return {row["quantity"]: row for row in results(folder)["estimates"]}


def test_estimates_are_shown_and_become_a_file_with_comments_and_settings_at_an_epoch(
    run: Run, tmp_path: Path
) -> None:
    A, C, rates = flight(tmp_path, 2, every=3)
    changed = ("--set", "thrusters.+M1.force=12N", "--set", "limits.horizon=90s")
    shown = fit(run, "flight.csv", "-o", "now.yaml", "--at", "90s", "--json", "f.json", *changed)
    for text in (
        "C/A only, never A and C apart",
        "bias of omega_3: kept as the file has it",
        "A and C +0.9992",
    ):
        assert text in shown
    rows = estimates(tmp_path)
    ratio = estimates(tmp_path)["C/A"]
    assert abs(ratio["value"] - C / A) < 4.0 * ratio["sigma"]
    assert ratio["sigma"] < 1e-4
    assert (ratio["from"], rows["bias_omega_3"]["from"]) == ("data", "file")
    assert [signal["white"] for signal in results(tmp_path)["record"]["signals"]] == [True] * 3
    assert f"{ratio['value']:.7g}"[:6] in shown
    before = example_text()
    after = (tmp_path / "now.yaml").read_text()
    assert [line.partition("#")[2] for line in after.splitlines() if "#" in line] == COMMENTS
    keys = [
        {line.split(":")[0] for line in text.splitlines() if line[:1].isalpha()}
        for text in (before, after)
    ]
    assert keys[0] | {"limits"} == keys[1]
    now = nutdamp.load(tmp_path / "now.yaml")
    assert now.limits.horizon == 90.0
    assert now.channels[0].thrusters[0].force == pytest.approx([0.0, -12.0, 0.0])
    known = present(now.dispersions)
    expected = motion((A, A, C), rates, np.array([0.0, 90.0]))[-1]
    for rate, other, tolerance in zip(now.omega0, expected, known.omega0, strict=True):
        assert abs(rate - other) < 4.0 * present(tolerance).size < 4.0 * math.radians(0.05)
    assert {pair[:2]: pair[2] for pair in known.correlation}["A", "C"] > 0.999


def test_the_picture_has_a_heading_and_shows_no_rounding_as_noise(run: Run, tmp_path: Path) -> None:
    """Without noise the third rate is constant: residuals and autocorrelations say nothing."""
    times = np.arange(201) / 10.0
    example = nutdamp.example()
    shown = motion((example.inertia.A, example.inertia.A, example.inertia.C), example.omega0, times)
    write_rows(tmp_path / "exact.csv", RATES, np.column_stack([times, shown]), digits=17)
    fit(run, "exact.csv", "--plot", "f.svg")
    picture = (tmp_path / "f.svg").read_text()
    for text in (f"{example.name}: fit of a free rigid body", "only rounding"):
        assert text in picture
    assert picture.count("only rounding") == 2, "in one panel, and below it of the other rates"
    assert "only rounding: omega_2, omega_3" in picture


def test_a_track_of_ideal_impulses_tells_what_they_do(run: Run, tmp_path: Path) -> None:
    """At an impulse it has two rows, of which neither is a sample; the first is at the start."""
    body = str(places.CONFIGS / "magnus-a03.yaml")
    run("plan", body, "--scheme", "two-pulse", "--csv", "pulses.csv")
    run("simulate", body, "--scheme", "two-pulse", "--flown", "--csv", "track.csv")
    fitted = run("fit", "track.csv", body, "--schedule", "pulses.csv", "--json", "f.json")
    assert fitted.returncode == 0
    rows = estimates(tmp_path)
    assert rows["thrust steerable"]["value"] == pytest.approx(1.0, abs=1e-6)
    assert rows["C/A"]["value"] == pytest.approx(0.7, abs=1e-7)
    assert run("fit", "track.csv", body).returncode == 2


@pytest.mark.parametrize(("spin", "said"), [(1.005, False), (1.03, True), (0.985, True)])
def test_a_spin_other_than_that_of_the_file_is_said_with_both(
    run: Run, tmp_path: Path, spin: float, said: bool
) -> None:
    times = np.arange(201) / 10.0
    rates = np.array([0.14, 0.12, spin * math.pi])
    shown = motion((120.0, 120.0, 80.0), rates, times) + 1e-4 * np.random.default_rng(1).normal(
        size=(201, 3)
    )
    write_rows(tmp_path / "gyro.csv", RATES, np.column_stack([times, shown]), digits=9)
    assert (
        run(
            "fit", "gyro.csv", "--json", "f.json", "--set", "dispersions.omega0={normal: 1 deg/s}"
        ).returncode
        == 0
    )
    values = [note["values"] for note in results(tmp_path)["notes"] if note["code"] == "fit-spin"]
    assert [pytest.approx({"spin_rpm": 30.0 * spin, "file_rpm": 30.0}, rel=1e-4)] * said == values


@pytest.mark.deep
def test_remarks_are_in_the_json_and_a_schedule_outside_the_record_is_doubted(
    run: Run, tmp_path: Path
) -> None:
    flight(tmp_path, 11, bias=0.05)
    assert run("fit", "flight.csv", "--schedule", "late.csv").returncode == 1
    (tmp_path / "late.csv").write_text(f"{PROBE}99,0.3,+M1\n", encoding="utf-8")
    shown = fit(run, "flight.csv", "--schedule", "late.csv", "--json", "f.json")
    notes = results(tmp_path)["notes"]
    check_text("fit.notes", "\n".join(note["text"] for note in notes))
    assert all(
        " ".join(f"{note['severity']}[{note['code']}]: {note['text']}".split()) in shown
        for note in notes
    )


@pytest.mark.deep
def test_a_channel_that_did_not_fire_is_not_calibrated(run: Run, tmp_path: Path) -> None:
    flight(tmp_path, 10, every=5)
    (tmp_path / "probe.csv").write_text(f"{PROBE}20,0.3,+M1\n", encoding="utf-8")
    refused = run(
        "fit", "flight.csv", "--schedule", "probe.csv", "-o", "now.yaml", "--json", "f.json"
    )
    assert (
        refused.returncode,
        (tmp_path / "now.yaml").exists(),
        (tmp_path / "f.json").exists(),
    ) == (3, False, True)
    shown = fit(run, "flight.csv", "--schedule", "probe.csv", "-o", "now.yaml", "--accept")
    assert "did it fire? Its force stays as it was" in shown
    assert "pulses fired meanwhile: 1" in shown
    now = nutdamp.load(tmp_path / "now.yaml")
    assert now.channels[0].thrusters[0].force == pytest.approx([0.0, -10.0, 0.0])
    assert present(now.dispersions).thrust["+M1"].size == 0.01


@pytest.mark.weekly
def test_a_schedule_that_does_not_match_the_record_is_doubted(run: Run, tmp_path: Path) -> None:
    """+M2 at 20 s: in the schedule a second late, of the channel across, or after the record."""
    rows = fly_probe(run, tmp_path, "20,0.5,+M2", 30)
    rows[:, 1:] += 1e-4 * np.random.default_rng(3).normal(size=(len(rows), 3))
    write_rows(tmp_path / "gyro.csv", RATES, rows, digits=7)
    shown = {}
    for name, row in (
        ("late", "21,0.5,+M2"),
        ("other", "20,0.5,-M2"),
        ("after", "20,0.5,+M2\n100,0.5,+M1"),
    ):
        (tmp_path / "s.csv").write_text(f"{PROBE}{row}\n", encoding="utf-8")
        shown[name] = fit(
            run, "gyro.csv", "--schedule", "s.csv", "-o", f"{name}.yaml", "--accept", columns=140
        )
        assert "e+0" not in shown[name]
    for name, text in (
        ("late", "delay of +M2 -1000 for 0 ms (-20.0)"),
        ("late", "the delay of +M2, -1000 ms, is not written"),
        (
            "other",
            "-M2 gave -100 % of its thrust: it pushes the other way: another channel, or reversed?",
        ),
        ("after", "pulses fired meanwhile: 1"),
        ("after", "1 of 2 pulses of the schedule are outside the record, 0 s to 30 s"),
    ):
        assert text in shown[name]
    assert "thrust factor of +M1" not in shown["after"]
    assert present(nutdamp.load(tmp_path / "after.yaml").dispersions).thrust["+M1"].size == 0.01


@pytest.mark.deep
def test_the_library_gives_the_same_file_and_fits_it_again_with_what_was_known(
    run: Run, tmp_path: Path
) -> None:
    """The second adds to the first: A keeps the sigma that two tolerances and the ratio leave."""
    flight(tmp_path, 8)
    fit(run, "flight.csv", "-q", "-o", "now.yaml", "--at", "80s", "--json", "f.json")
    first = nutdamp.fit(tmp_path / "flight.csv", nutdamp.example())
    assert first.text(80.0) == (tmp_path / "now.yaml").read_text()
    first.write(tmp_path / "library.yaml", 80.0)
    assert (tmp_path / "library.yaml").read_bytes() == (tmp_path / "now.yaml").read_bytes()
    assert len(first.figure().axes) >= 3
    assert json.loads(json.dumps(first.to_dict(80.0))) == results(tmp_path)
    assert first.spacecraft(80.0).omega0 == pytest.approx(
        nutdamp.load(tmp_path / "now.yaml").omega0, rel=1e-12
    )
    with pytest.raises(BadRequest):
        nutdamp.fit(tmp_path / "flight.csv", nutdamp.example().replace(mass=200.0)).text()
    again = nutdamp.fit(tmp_path / "flight.csv", first.spacecraft(0.0))
    before, after = ({row.key: row for row in each.estimates()} for each in (first, again))
    assert before["A"].sigma == pytest.approx(0.002 * 120.0 / math.sqrt(2.0), rel=0.02)
    assert after["A"].sigma == pytest.approx(before["A"].sigma, rel=0.01)
    assert after["A"].value == pytest.approx(before["A"].value, abs=0.05 * before["A"].sigma)
    assert after["C/A"].sigma == pytest.approx(before["C/A"].sigma / math.sqrt(2.0), rel=0.05)


@pytest.mark.weekly
def test_plans_from_the_estimate_meet_the_requirement_on_the_true_bodies(
    run: Run, tmp_path: Path
) -> None:
    for seed in range(30):
        A, C, rates = flight(tmp_path, 100 + seed)
        fit(run, "flight.csv", "-q", "-o", "now.yaml", "--at", "90s")
        now = nutdamp.load(tmp_path / "now.yaml")
        plan = present(nutdamp.compare(now).recommended)
        true = motion((A, A, C), rates, np.array([0.0, 90.0]))[-1]
        truth = now.with_(inertia={"A": A, "C": C}, state={"spin": float(true[2])}).replace(
            omega0=true
        )
        left = flown(truth, plan.pulses).residual
        assert left.nutation < math.radians(0.5)
        assert left.momentum_shift < math.radians(0.2)


@pytest.mark.weekly
def test_thrusters_are_calibrated_by_the_schedule_that_was_fired(run: Run, tmp_path: Path) -> None:
    changed = ("thrusters.+M1.force=9.6N", "inertia.C=80.3 kg m^2")
    rows = fly_probe(run, tmp_path, "8,0.3,+M1\n16,0.3,-M2", 24, *changed, samples=161)
    write_rows(tmp_path / "gyro.csv", RATES, rows, digits=17)
    fit(
        run,
        "gyro.csv",
        "-q",
        "--schedule",
        "probe.csv",
        "-o",
        "now.yaml",
        "--at",
        "30s",
        "--json",
        "f.json",
    )
    values = {name: row["value"] for name, row in estimates(tmp_path).items()}
    assert values["thrust +M1"] / values["A"] == pytest.approx(0.96 / 120.0, rel=1e-4)
    assert values["thrust -M2"] / values["A"] == pytest.approx(1.0 / 120.0, rel=1e-4)
    assert abs(values["delay +M1"]) < 0.1
    now = nutdamp.load(tmp_path / "now.yaml")
    force = {each.name: each.thrusters[0].force for each in now.channels}["+M1"]
    known = now.dispersions
    assert force == pytest.approx([0.0, -10.0 * values["thrust +M1"], 0.0])
    assert known is not None
    assert known.thrust["+M1"].size < 0.006
    assert known.thrust["-M1"].size == 0.01  # did not fire: stays as it was
    pairs = {frozenset(pair[:2]): pair[2] for pair in known.correlation}
    assert pairs[frozenset(("thrust +M1", "A"))] > 0.99


@pytest.mark.weekly
def test_a_delay_becomes_that_of_the_valve_and_a_second_fit_finds_none(
    run: Run, tmp_path: Path
) -> None:
    late = "valve={open_delay: 40 ms, close_delay: 40 ms}"
    rows = fly_probe(run, tmp_path, "8,0.3,+M1\n16,0.3,-M2", 24, late, samples=161)
    write_rows(tmp_path / "gyro.csv", RATES, rows, digits=17)
    assert "is not written" not in fit(run, "gyro.csv", "--schedule", "probe.csv", "-o", "now.yaml")
    valves = {
        channel.name: channel.valve for channel in nutdamp.load(tmp_path / "now.yaml").channels
    }
    fit(run, "gyro.csv", "now.yaml", "-q", "--schedule", "probe.csv", "--json", "f.json")
    for name in ("+M1", "-M2"):
        valve = valves[name]
        assert isinstance(valve, Trapezoid)
        assert (valve.open_delay, valve.close_delay) == pytest.approx((0.04, 0.04), abs=1e-5)
        assert abs(estimates(tmp_path)[f"delay {name}"]["value"]) < 0.01  # ms


# --- export and import

APM = "export dated.yaml --format apm --scheme two-pulse"
IDEAL = DATED.replace("steerable: {torque: 20 N m}\n", "")


@pytest.fixture(autouse=True)
def dated(tmp_path: Path) -> None:
    """A spacecraft with an epoch, and no mass."""
    written(tmp_path, dated_yaml=DATED)


def exported(run: Run, command: str, status: int = 0) -> str:
    """What a command prints."""
    return call(run, command, status=status).stdout


def test_the_plan_as_json_is_that_of_plan(run: Run) -> None:
    """By its dispersed cases, whether a scheme is named or not."""
    for scheme in ("--scheme four-pulse", ""):
        commands = ("export --format json -o -", "plan")
        status = 4 if scheme else 0
        data, planned = (result(run, f"{command} {scheme}", status=status) for command in commands)
        assert data["recommended"] == planned["recommended"]
        (plan,) = (plan for plan in planned["plans"] if plan["scheme"] == data["recommended"])
        (exported,) = data["plans"]
        assert exported == plan
        for key in ("status", "met", "requirement", "causes", "cases"):
            assert data["decision"][key] == planned["decision"][key]
        assert data["decision"]["met"] == plan["meets_requirement"] == (not scheme)
    assert data["recommended"] == "two-pulse"


def test_a_schedule_file_is_exported_as_it_is(run: Run) -> None:
    call(run, "plan dated.yaml --scheme one-pulse --csv pulses.csv")
    named = ("--schedule pulses.csv", "--scheme one-pulse")
    texts = (exported(run, f"export dated.yaml --format apm {name}") for name in named)
    assert len({text[text.index("MAN_START") :] for text in texts}) == 1


def test_what_a_format_needs_is_named_and_can_be_pasted(run: Run, tmp_path: Path) -> None:
    orbit = "orbit={position: [42164 km, 0, 0], velocity: [0, 3.0747 km/s, 0]}"
    written(tmp_path, ideal_yaml=IDEAL, out="before")
    said = refusals(
        run,
        tmp_path,
        [
            "export --format apm --scheme two-pulse -o out",
            "export ideal.yaml --format apm --scheme two-pulse -o out",
            "export dated.yaml --format opm --scheme one-pulse -o out",
            f"export --set '{orbit}' --format spin-table --scheme none",
        ],
    )
    check_text("cli.export.needs", said)
    lines = said[said.index("attitude:\n") : said.index("\n$ export ideal")]
    written(
        tmp_path, pasted_yaml="name: P\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n" + lines
    )
    for name in ("pasted", "ideal"):
        assert exported(run, f"export {name}.yaml --format aem --scheme one-pulse")


def test_an_imported_schedule_is_simulated(run: Run, tmp_path: Path) -> None:
    """The kind of a message need not be named."""
    call(run, f"{APM} -o there.apm")
    assert exported(run, "import there.apm -o back.yaml --schedule back.csv") == ""
    flown = call(run, "simulate back.yaml --schedule back.csv")
    assert (flown.returncode, flown.stderr) == (0, "")
    assert result(run, "simulate back.yaml --schedule back.csv")["flown"]["nutation_deg"] < 1e-6
    shown = call(run, "import apm there.apm")
    assert shown.stdout == (tmp_path / "back.yaml").read_text()
    comments = re.sub("^[^#]*", "", shown.stdout, flags=re.MULTILINE)
    check_text("cli.import.shown", f"{comments}\n{shown.stderr}")


def test_faults_of_a_message_are_reported_by_line(run: Run, tmp_path: Path) -> None:
    """What only a spacecraft file rules out points at the block that it came from."""
    text = exported(run, APM)
    flat = ("IZZ               = 80.0", "IZZ               = 800.0")
    written(
        tmp_path,
        keyword_apm=text.replace("QC ", "QD ").replace(*flat),
        flat_apm=text.replace(*flat),
    )
    written(tmp_path, still_apm=text.replace("ANGVEL_Z     = 180.0", "ANGVEL_Z     = 0.0"))
    written(tmp_path, there_xml=exported(run, f"{APM} --xml"))
    assert len(set(contents(tmp_path).values())) == 5
    files = ("keyword.apm", "flat.apm", "still.apm", "there.xml")
    check_text(
        "cli.import.faults",
        refusals(run, tmp_path, [f"import apm {file} -o out.yaml" for file in files]),
    )
    assert refusals(run, tmp_path, ["import opm flat.apm"])
