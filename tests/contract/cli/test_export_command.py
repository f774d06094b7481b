"""``nutdamp export`` and ``nutdamp import`` as processes."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from pathlib import Path

import pytest
from support import places
from support.places import case
from support.process import Run

pytestmark = pytest.mark.usefixtures("plans_shared")

DATED = """
name: Dated
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg, phase: 40 deg}
attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [0.3, -0.2, 0.9, 0.1]}
steerable: {torque: 20 N m}
"""


@pytest.fixture
def dated(tmp_path: Path) -> Path:
    path = tmp_path / "dated.yaml"
    path.write_text(DATED)
    return path


def pulses(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


@pytest.mark.usefixtures("dated")
def test_messages_go_to_standard_output_or_a_file(run: Run, tmp_path: Path) -> None:
    done = run("export", "dated.yaml", "--format", "apm", "--scheme", "two-pulse")
    assert done.returncode == 0
    assert done.stdout.startswith("CCSDS_APM_VERS = 2.0\n")
    assert done.stdout.count("MAN_START") == 2
    again = run("export", "dated.yaml", "--format", "apm", "--scheme", "two-pulse", "--xml")
    assert again.stdout.startswith('<?xml version="1.0" encoding="UTF-8"?>\n<apm ')
    done = run("export", "dated.yaml", "--format", "aem", "--scheme", "two-pulse", "-o", "track.XML")
    assert done.stdout == ""
    assert "wrote track.XML: two-pulse, 2 pulses" in done.stderr
    assert "<quaternionAngVel>" in (tmp_path / "track.XML").read_text()
    quiet = run("export", "-q", "dated.yaml", "--format", "stk", "--scheme", "none", "-o", "free.a", "--until", "2 s")
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")
    assert (tmp_path / "free.a").read_text().splitlines()[-2].startswith("2.000000000 ")


def test_the_plan_as_json_is_that_of_plan(run: Run) -> None:
    exported = json.loads(run("export", "--format", "json", "--scheme", "four-pulse", "-o", "-").stdout)
    planned = json.loads(run("plan", "--scheme", "four-pulse", "--json", "-").stdout)
    assert exported["plans"] == planned["plans"]
    assert exported["recommended"] == planned["recommended"]
    recommended = json.loads(run("export", "--format", "json").stdout)
    assert recommended["recommended"] == json.loads(run("plan", "--json", "-").stdout)["recommended"]


@pytest.mark.usefixtures("dated")
def test_a_schedule_file_is_exported_as_it_is(run: Run) -> None:
    run("plan", "dated.yaml", "--scheme", "one-pulse", "--csv", "pulses.csv")
    done = run("export", "dated.yaml", "--format", "apm", "--schedule", "pulses.csv")
    assert done.returncode == 0
    direct = run("export", "dated.yaml", "--format", "apm", "--scheme", "one-pulse")
    start = "MAN_START"
    assert done.stdout[done.stdout.index(start) :] == direct.stdout[direct.stdout.index(start) :]


def test_without_epoch_and_frame_the_lines_to_add_are_shown(run: Run, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("before")
    done = run("export", "--format", "apm", "--scheme", "two-pulse", "-o", "out")
    assert done.returncode == 2
    for text in ("attitude.epoch", "attitude.frame", "\nattitude:\n", "\n  epoch: ", "\n  frame: ", "\n  quaternion: "):
        assert text in done.stderr
    assert (tmp_path / "out").read_text() == "before"
    # What is shown can be pasted.
    lines = done.stderr[done.stderr.index("attitude:\n") :]
    (tmp_path / "pasted.yaml").write_text("name: P\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n" + lines)
    assert run("export", "pasted.yaml", "--format", "aem", "--scheme", "one-pulse").returncode == 0


@pytest.mark.parametrize("epoch", ["9999-12-31T23:59:59Z", "9999-12-31T23:59:59.5Z"])
def test_dates_after_the_year_9999_are_refused_and_planned_without(run: Run, tmp_path: Path, epoch: str) -> None:
    (tmp_path / "late.yaml").write_text(DATED.replace("2026-03-01T12:00:00Z", epoch))
    for form in ("apm", "aem", "aem-spin", "opm", "stk"):
        done = run("export", "late.yaml", "--format", form, "--scheme", "two-pulse")
        assert (done.returncode, done.stdout) == (2, "")
        assert "late.yaml:5:19: attitude.epoch: " in done.stderr
        assert "the year 9999 is over" in done.stderr
        assert done.stderr.count("\n") == 1
    planned = run("plan", "late.yaml", "--scheme", "two-pulse", "--json", "-")
    assert planned.returncode == 0
    assert [pulse.get("utc") for pulse in json.loads(planned.stdout)["plans"][0]["pulses"]][1] is None
    assert run("plan", "late.yaml", "--scheme", "two-pulse").returncode == 0


def test_a_million_billion_seconds_have_no_date(run: Run, tmp_path: Path) -> None:
    (tmp_path / "far.yaml").write_text(DATED + "limits: {horizon: 1e15, earliest: 9e14}\n")
    done = run("plan", "far.yaml", "--scheme", "one-pulse")
    assert done.returncode in (0, 3)
    assert done.stderr == ""


def test_an_epoch_that_only_messages_cannot_hold_is_refused_with_its_place(run: Run, tmp_path: Path) -> None:
    (tmp_path / "old.yaml").write_text(DATED.replace("2026", "1960"))
    done = run("export", "old.yaml", "--format", "aem", "--scheme", "two-pulse")
    assert done.returncode == 2
    assert done.stderr.startswith("old.yaml:5:19: attitude.epoch: '1960-03-01T12:00:00Z' is before 1972")
    # What no file says has no place in one.
    for path, stdin in (("-", DATED.replace("2026", "1960")), ("old.yaml", None)):
        epoch = "1961-03-01T12:00:00Z" if stdin is None else "1960-03-01T12:00:00Z"
        setting = () if stdin is not None else ("--set", f"attitude.epoch={epoch}")
        done = run("export", path, "--format", "aem", "--scheme", "two-pulse", *setting, stdin=stdin)
        assert done.returncode == 2
        assert done.stderr.startswith(f"nutdamp: attitude.epoch: '{epoch}' is before 1972")


def test_formats_without_an_epoch_need_none(run: Run) -> None:
    for form in ("basilisk", "json"):
        assert run("export", "--format", form, "--scheme", "two-pulse").returncode == 0


@pytest.mark.usefixtures("dated")
def test_exit_statuses(run: Run, tmp_path: Path) -> None:
    assert run("export", "dated.yaml").returncode == 2
    assert run("export", "dated.yaml", "--format", "stk", "--xml").returncode == 2
    assert run("export", "dated.yaml", "--format", "apm", "--until", "3 s").returncode == 2
    assert run("export", "dated.yaml", "--format", "aem", "--until", "0 s").returncode == 2
    both = run("export", "dated.yaml", "--format", "apm", "--scheme", "two-pulse", "--schedule", "p.csv")
    assert both.returncode == 2
    assert run("export", "missing.yaml", "--format", "apm").returncode == 1
    unwritable = run("export", "dated.yaml", "--format", "apm", "--scheme", "two-pulse", "-o", "no/such/folder.apm")
    assert unwritable.returncode == 1
    assert "cannot write no/such/folder.apm" in unwritable.stderr
    (tmp_path / "short.yaml").write_text(DATED + "limits: {horizon: 1 ms}\n")
    infeasible = run("export", "short.yaml", "--format", "apm", "--scheme", "two-pulse", "-o", "none.apm")
    assert infeasible.returncode == 3
    assert not (tmp_path / "none.apm").exists()
    (tmp_path / "strict.yaml").write_text(DATED + "requirement: {momentum_shift: 0.1 deg}\n")
    missed = run("export", "strict.yaml", "--format", "apm", "--scheme", "one-pulse", "-o", "missed.apm")
    assert missed.returncode == 4
    assert "does not meet the requirement" in missed.stderr
    assert (tmp_path / "missed.apm").exists()
    assert run("export", "strict.yaml", "--format", "aem", "--scheme", "none").returncode == 0


def test_an_ideal_impulse_asks_for_a_torque(run: Run, tmp_path: Path) -> None:
    (tmp_path / "ideal.yaml").write_text(DATED.replace("steerable: {torque: 20 N m}\n", ""))
    done = run("export", "ideal.yaml", "--format", "apm", "--scheme", "two-pulse", "-o", "out.apm")
    assert done.returncode == 2
    assert "give the torquer a torque (steerable: {torque: 20 N m})" in done.stderr
    assert not (tmp_path / "out.apm").exists()
    assert run("export", "ideal.yaml", "--format", "aem", "--scheme", "two-pulse").returncode == 0


@pytest.mark.usefixtures("dated")
def test_an_orbit_makes_an_opm_whole_and_without_one_it_is_a_part(run: Run, tmp_path: Path) -> None:
    file = str(places.CONFIGS / "communications-spinner.yaml")
    part = run("export", file, "--format", "opm", "--scheme", "four-pulse")
    assert part.returncode == 0
    assert "warning: the spacecraft file has no orbit" in part.stderr
    assert "\nCOMMENT Only the part with the manoeuvres" in part.stdout
    orbit = ("--set", "orbit={position: [42164 km, 0, 0], velocity: [0, 3.0747 km/s, 0]}")
    whole = run("export", file, *orbit, "--format", "opm", "--scheme", "four-pulse", "-o", "whole.xml")
    assert (whole.returncode, "no orbit" in whole.stderr) == (0, False)
    text = (tmp_path / "whole.xml").read_text()
    assert '<X units="km">42164.0</X>' in text
    assert text.count("<maneuverParameters>") == part.stdout.count("MAN_EPOCH_IGNITION") > 0
    massless = run("export", "dated.yaml", "--format", "opm", "--scheme", "one-pulse", "-o", "none.opm")
    assert massless.returncode == 2
    assert "add the key mass" in massless.stderr
    assert not (tmp_path / "none.opm").exists()
    lost = run("export", "--set", orbit[1], "--format", "spin-table", "--scheme", "none")
    assert lost.returncode == 2
    assert "orbit: needs attitude.epoch and attitude.frame" in lost.stderr


def test_a_spin_table_needs_no_epoch_and_goes_on_as_requested(run: Run) -> None:
    done = run("export", "--format", "spin-table", "--scheme", "two-pulse", "--until", "9 s")
    assert done.returncode == 0
    rows = pulses(done.stdout)
    assert [row["spin"] for row in rows] == ["1", "2", "3", "4", "5"]
    assert sum(int(row["pulses"]) for row in rows) == 2
    assert run("export", "--format", "spin-table", "--scheme", "none", "--xml").returncode == 2
    assert run("export", "--format", "spin-table", "--scheme", "none", "--until", "1e9 s").returncode == 2


@pytest.mark.usefixtures("dated")
def test_an_imported_schedule_is_simulated(run: Run, tmp_path: Path) -> None:
    run("export", "dated.yaml", "--format", "apm", "--scheme", "two-pulse", "-o", "there.apm")
    run("import", "apm", "there.apm", "-o", "back.yaml", "--schedule", "back.csv")
    done = run("simulate", "back.yaml", "--schedule", "back.csv", "--json", "-")
    assert done.returncode == 0
    assert "warning" not in done.stderr
    assert json.loads(done.stdout)["flown"]["nutation_deg"] < 1e-6
    shown = run("import", "apm", "there.apm")
    assert shown.stdout.startswith("# From the attitude parameter message there.apm")
    assert "no thruster layout" in shown.stdout
    assert "2 manoeuvres; --schedule FILE writes them" in shown.stderr


def test_a_message_in_xml_is_refused_with_the_cure(run: Run, dated: Path) -> None:
    assert run("export", "dated.yaml", "--format", "apm", "--scheme", "two-pulse", "-o", "there.xml").returncode == 0
    done = run("import", "apm", "there.xml", "-o", "out.yaml")
    assert done.returncode == 2
    said = "XML is not read; write the message in keyword = value notation (KVN)"
    assert done.stderr == f"there.xml:1:1: {said}\n"
    assert not (dated.parent / "out.yaml").exists()


def test_faults_of_a_message_are_reported_by_line(run: Run, dated: Path) -> None:
    text = run("export", "dated.yaml", "--format", "apm", "--scheme", "two-pulse").stdout
    bad = text.replace("QC ", "QD ").replace("IZZ               = 80.0", "IZZ               = 800.0")
    (dated.parent / "bad.apm").write_text(bad)
    done = run("import", "apm", "bad.apm", "-o", "out.yaml")
    assert done.returncode == 2
    assert "bad.apm:" in done.stderr
    assert "QD: unknown keyword" in done.stderr
    assert not (dated.parent / "out.yaml").exists()
    # What only a spacecraft file rules out points at the block that it came from.
    (dated.parent / "flat.apm").write_text(text.replace("IZZ               = 80.0", "IZZ               = 800.0"))
    done = run("import", "apm", "flat.apm")
    line = text.splitlines().index("INERTIA_START") + 1
    assert done.returncode == 2
    assert done.stderr.startswith(f"flat.apm:{line}:1: INERTIA: ")
    still = text.replace("ANGVEL_Z     = 180.0", "ANGVEL_Z     = 0.0")
    (dated.parent / "still.apm").write_text(still)
    done = run("import", "apm", "still.apm")
    assert done.returncode == 2
    assert done.stderr.startswith(
        f"still.apm:{text.splitlines().index('ANGVEL_START') + 1}:1: ANGVEL: the spin is zero"
    )


def test_import_statuses(run: Run, dated: Path) -> None:
    assert run("import", "apm", "missing.apm").returncode == 1
    assert run("import", "aem", "missing.aem").returncode == 2
    (dated.parent / "a.apm").write_text(run("export", "dated.yaml", "--format", "apm", "--scheme", "none").stdout)
    assert run("import", "apm", "a.apm", "-o", "no/such/folder.yaml").returncode == 1
    assert run("import", "apm", "a.apm", "-o", "-", "--schedule", "-").returncode == 2
    assert "fires nothing" in run("import", "apm", "a.apm").stdout
    empty = run("import", "-q", "apm", "a.apm", "-o", "a.yaml", "--schedule", "-")
    assert empty.returncode == 0
    assert len(empty.stdout.splitlines()) == 1
    plan = json.loads(run("plan", "a.yaml", "--scheme", "one-pulse", "--json", "-").stdout)
    assert plan["spacecraft"]["nutation_deg"] == pytest.approx(5.0, rel=1e-13)
    assert math.isclose(plan["spacecraft"]["A_kgm2"], 120.0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("body.yaml", "apm"), "the format is an option: nutdamp export body.yaml --format apm"),
        (("AEM", "my body.yaml"), "the format is an option: nutdamp export 'my body.yaml' --format aem"),
        (("stk",), "the format is an option: nutdamp export --format stk"),
        ((), "name the format: --format apm, aem, aem-spin, opm, stk, spin-table, basilisk or json"),
        (("body.yaml", "other.yaml"), "got unexpected extra argument (other.yaml)"),
        (("body.yaml", "--format", "apm", "x", "y"), "got unexpected extra arguments (x y)"),
    ],
)
def test_a_format_without_its_option_says_how_to_name_it(run: Run, words: tuple[str, ...], said: str) -> None:
    done = run("export", *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.splitlines()[-1] == f"Error: {said}"


def test_messages_of_the_command_line_hold_no_escaped_tabs(run: Run) -> None:
    done = run("import")
    assert done.returncode == 2
    assert "\\t" not in done.stderr


def test_angles_that_are_rounding_are_written_as_0(run: Run) -> None:
    """The spin axis of this file lies on the equator of the frame, and body axis 1 along the node."""
    done = run("export", str(case("geo-target.yaml")), "--format", "apm", "--scheme", "four-pulse")
    angles = dict(re.findall(r"^(SPIN_[A-Z]+|NUTATION_PHASE) += (\S+) \[deg\]$", done.stdout, re.MULTILINE))
    assert (angles["SPIN_ALPHA"], angles["SPIN_DELTA"], angles["SPIN_ANGLE"]) == ("270.0", "0.0", "0.0")
