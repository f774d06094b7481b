"""``nutdamp export`` and ``nutdamp import``."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest
from support import places
from support.commands import DATED, call, contents, refusals, result, rows, written
from support.golden import check_text
from support.process import Run

from nutdamp.files.ccsds.read import read_apm

pytestmark = pytest.mark.usefixtures("plans_shared")

APM = "export dated.yaml --format apm --scheme two-pulse"
IDEAL = DATED.replace("steerable: {torque: 20 N m}\n", "")


@pytest.fixture(autouse=True)
def dated(tmp_path: Path) -> None:
    """A spacecraft with an epoch, and no mass."""
    written(tmp_path, dated_yaml=DATED)


def exported(run: Run, command: str, status: int = 0) -> str:
    """What a command prints."""
    ended = call(run, command)
    assert ended.returncode == status, ended.stderr
    return ended.stdout


def test_messages_go_to_standard_output_or_a_file(run: Run, tmp_path: Path) -> None:
    assert exported(run, APM).startswith("CCSDS_APM_VERS = 2.0\n")
    assert exported(run, APM).count("MAN_START") == 2
    assert exported(run, f"{APM} --xml").startswith('<?xml version="1.0" encoding="UTF-8"?>\n<apm ')
    track = call(run, "export dated.yaml --format aem --scheme two-pulse -o track.XML")
    assert (track.stdout, "wrote track.XML: two-pulse, 2 pulses" in track.stderr) == ("", True)
    assert "<quaternionAngVel>" in (tmp_path / "track.XML").read_text()
    quiet = run("export", "-q", "dated.yaml", "--format", "stk", "--scheme", "none", "-o", "free.a", "--until", "2 s")
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")
    assert (tmp_path / "free.a").read_text().splitlines()[-2].startswith("2.000000000 ")
    assert exported(run, "export --format basilisk --scheme two-pulse")  # needs no epoch


def test_the_plan_as_json_is_that_of_plan(run: Run) -> None:
    """By its dispersed cases, whether a scheme is named or not."""
    for scheme in ("--scheme four-pulse", ""):
        commands, status = ("export --format json -o -", "plan"), 4 if scheme else 0
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
    written(tmp_path, pasted_yaml="name: P\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n" + lines)
    for name in ("pasted", "ideal"):
        assert exported(run, f"export {name}.yaml --format aem --scheme one-pulse")


def test_epochs_that_messages_cannot_hold_are_refused_with_their_place(run: Run, tmp_path: Path) -> None:
    """And planned without dates. What no file says has no place in one."""
    late = DATED.replace("2026-03-01T12:00:00Z", "9999-12-31T23:59:59.5Z")
    written(tmp_path, late_yaml=late, old_yaml=DATED.replace("2026", "1960"))
    commands = [f"export late.yaml --format {form} --scheme two-pulse" for form in ("apm", "aem", "opm", "stk")]
    commands.append("export late.yaml --format aem-spin --scheme two-pulse --set attitude.epoch=9999-12-31T23:59:59Z")
    aem = "--format aem --scheme two-pulse"
    commands += [f"export old.yaml {aem}", f"export old.yaml {aem} --set attitude.epoch=1961-03-01T12:00:00Z"]
    commands += ["check old.yaml", "plan late.yaml --scheme two-pulse -o later.yaml --at 1s"]
    said = refusals(run, tmp_path, commands)
    check_text("cli.export.epochs", said + "\n" + call(run, "check late.yaml -q").stdout)
    pulses = result(run, "plan late.yaml --scheme two-pulse")["plans"][0]["pulses"]
    assert pulses[1]["utc"] is None
    assert call(run, "plan late.yaml --scheme two-pulse").returncode == 0
    far = run("plan", "-", "--scheme", "one-pulse", stdin=DATED + "limits: {horizon: 1e15, earliest: 9e14}\n")
    assert (far.returncode in (0, 3), far.stderr) == (True, "")


def test_a_plan_that_misses_the_requirement_is_exported_and_an_infeasible_one_not(run: Run, tmp_path: Path) -> None:
    written(tmp_path, short_yaml=DATED + "limits: {horizon: 1 ms}\n")
    written(tmp_path, strict_yaml=DATED + "requirement: {momentum_shift: 0.1 deg}\n")
    infeasible = call(run, "export short.yaml --format apm --scheme two-pulse -o none.apm")
    assert (infeasible.returncode, (tmp_path / "none.apm").exists()) == (3, False)
    missed = call(run, "export strict.yaml --format apm --scheme one-pulse -o missed.apm")
    assert (missed.returncode, (tmp_path / "missed.apm").exists()) == (4, True)
    assert "warning: one-pulse: NOT ENOUGH: " in missed.stderr
    assert exported(run, "export strict.yaml --format aem --scheme none")


def test_an_orbit_makes_an_opm_whole_and_without_one_it_is_a_part(run: Run, tmp_path: Path) -> None:
    command = (
        "export",
        str(places.CONFIGS / "communications-spinner.yaml"),
        "--format",
        "opm",
        "--scheme",
        "four-pulse",
    )
    part = run(*command)
    assert part.returncode == 0
    assert "warning: the spacecraft file has no orbit" in part.stderr
    assert "\nCOMMENT Only the part with the manoeuvres" in part.stdout
    orbit = "orbit={position: [42164 km, 0, 0], velocity: [0, 3.0747 km/s, 0]}"
    whole = run(*command, "--set", orbit, "-o", "whole.xml")
    assert (whole.returncode, "no orbit" in whole.stderr) == (0, False)
    text = (tmp_path / "whole.xml").read_text()
    assert '<X units="km">42164.0</X>' in text
    assert text.count("<maneuverParameters>") == part.stdout.count("MAN_EPOCH_IGNITION") > 0


def test_a_spin_table_needs_no_epoch_and_goes_on_as_requested(run: Run) -> None:
    table = rows(run("export", "--format", "spin-table", "--scheme", "two-pulse", "--until", "9 s").stdout)
    assert [row["spin"] for row in table] == ["1", "2", "3", "4", "5"]
    assert sum(int(row["pulses"]) for row in table) == 2


def test_angles_that_are_rounding_are_written_as_0(run: Run) -> None:
    """The spin axis of this file lies on the equator of the frame, and body axis 1 along the node."""
    text = exported(run, f"export {places.case('geo-target.yaml')} --format apm --scheme four-pulse")
    angles = dict(re.findall(r"^(SPIN_[A-Z]+|NUTATION_PHASE) += (\S+) \[deg\]$", text, re.MULTILINE))
    assert (angles["SPIN_ALPHA"], angles["SPIN_DELTA"], angles["SPIN_ANGLE"]) == ("270.0", "0.0", "0.0")


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


def test_a_message_that_fires_nothing_gives_an_empty_schedule(run: Run, tmp_path: Path) -> None:
    written(tmp_path, a_apm=exported(run, "export dated.yaml --format apm --scheme none"))
    assert "fires nothing" in exported(run, "import apm a.apm")
    assert len(exported(run, "import -q apm a.apm -o a.yaml --schedule -").splitlines()) == 1
    written(tmp_path, b_apm=(tmp_path / "a.apm").read_text().replace("= UTC", "= TAI"))
    (said,) = read_apm(str(tmp_path / "b.apm")).remarks
    loud, quiet = (call(run, f"import apm b.apm -o b.yaml{more}").stderr for more in ("", " -q"))
    assert said in loud
    assert said not in quiet
    spacecraft = result(run, "plan a.yaml --scheme one-pulse")["spacecraft"]
    assert spacecraft["nutation_deg"] == pytest.approx(5.0, rel=1e-13)
    assert math.isclose(spacecraft["A_kgm2"], 120.0)


def test_faults_of_a_message_are_reported_by_line(run: Run, tmp_path: Path) -> None:
    """What only a spacecraft file rules out points at the block that it came from."""
    text, flat = exported(run, APM), ("IZZ               = 80.0", "IZZ               = 800.0")
    written(tmp_path, keyword_apm=text.replace("QC ", "QD ").replace(*flat), flat_apm=text.replace(*flat))
    written(tmp_path, still_apm=text.replace("ANGVEL_Z     = 180.0", "ANGVEL_Z     = 0.0"))
    written(tmp_path, there_xml=exported(run, f"{APM} --xml"))
    assert len(set(contents(tmp_path).values())) == 5
    files = ("keyword.apm", "flat.apm", "still.apm", "there.xml")
    check_text("cli.import.faults", refusals(run, tmp_path, [f"import apm {file} -o out.yaml" for file in files]))
    assert refusals(run, tmp_path, ["import opm flat.apm"])
