"""Command blocks in files: what `plan` writes is what `simulate` fires, and faults of edited ones have their place."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support.contract import check_faults, faults
from support.golden import check_text
from support.process import Run
from support.spinners import FILE

from nutdamp.cli.flown import JITTER_SEED
from nutdamp.commands import Block
from nutdamp.files.blocks_csv import HEADER, read_blocks
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.schemes.tools.sun_pulses import fired
from nutdamp.spacecraft import Spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")

CRAFT = read_spacecraft(FILE, "f.yaml")
WIDTHS = FILE.replace("width: {step: 10 ms, min: 100 ms, max: 500 ms}", "width: [500 ms, 100 ms, 300 ms]")
TOP = "channel,first_sun_pulse,delay_s,width_s,count\n"
COUNTS = "channel,first_sun_pulse,delay_counts,width_counts,count\n"
GOAL = ("--target", "10deg,89deg")
BLOCKS = ("--blocks", "blocks.csv")
Read = Callable[..., tuple[tuple[Block, ...], list[str]]]


@pytest.fixture
def read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Read:
    """``read(text, body)``: a file of that text."""
    monkeypatch.chdir(tmp_path)

    def read(text: str, body: Spacecraft = CRAFT) -> tuple[tuple[Block, ...], list[str]]:
        Path("blocks.csv").write_text(text)
        return read_blocks(Path("blocks.csv"), body)

    return read


def rows_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(path.read_text())))


def test_what_plan_writes_is_what_simulate_fires(run: Run, tmp_path: Path) -> None:
    """The screen has what an operator compares before and after."""
    text = FILE + "tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar, exponent: 1}\n"
    planned = run("plan", "-", *GOAL, "--scheme", "command-block", *BLOCKS, "--csv", "pulses.csv", stdin=text)
    assert planned.returncode == 0, planned.stderr
    (row,) = rows_of(tmp_path / "blocks.csv")
    assert tuple(row) == HEADER
    assert float(row["delay_s"]) == pytest.approx(2e-3 * int(row["delay_counts"]))
    assert float(row["delay_deg"]) == pytest.approx(72.0 * float(row["delay_s"]))
    assert float(row["width_s"]) == pytest.approx(1e-2 * int(row["width_counts"]))
    pulses = rows_of(tmp_path / "pulses.csv")
    assert row["first_utc"] == pulses[0]["utc"]
    assert len(pulses) == int(row["count"])
    flown = run("simulate", "-", *GOAL, *BLOCKS, "--samples", "2", stdin=text)
    assert flown.returncode == 0, flown.stderr
    assert flown.stderr == ""
    blocks = flown.stdout[flown.stdout.index("Command blocks") :].split("\npulse ")[0].strip()
    assert blocks.partition("\n\n")[0] in planned.stdout
    check_text("files.blocks-screen", blocks)


def test_an_edited_block_is_fired(run: Run, tmp_path: Path) -> None:
    (tmp_path / "blocks.csv").write_text(TOP + "T1,3,1.001,0.1,4\nT1,20,1.5,0.1,40\n")
    flown = run("simulate", "-", *BLOCKS, "--samples", "2", stdin=FILE)
    assert flown.returncode == 4
    lines = flown.stdout.splitlines()
    assert sum(line.split()[:1] in (["1"], ["4"], ["44"]) for line in lines) >= 3
    cut = next(line for line in lines if "of 44 pulses" in line)
    check_text("files.blocks-edited", f"{flown.stderr}{cut}")


def test_counts_alone_are_read_where_the_spacecraft_file_has_the_steps(read: Read) -> None:
    """Of a list of widths they count the entries, the shortest first."""
    (block,), warned = read(COUNTS + "T1,3,500,12,4\n")
    assert [block.delay, block.width] == pytest.approx([1.0, 0.12], rel=1e-12)
    assert warned == []
    listed = read_spacecraft(WIDTHS, "f.yaml")
    (block,), _ = read(COUNTS + "T1,1,500,2,4\n", listed)
    assert (block.delay, block.width) == (1.0, 0.3)
    check_faults("files.blocks-widths", lambda text: read(text, listed), [COUNTS + "T1,1,500,4,4\n"])
    bare = read_spacecraft("\n".join(row for row in FILE.splitlines() if not row.startswith("commands")), "f.yaml")
    check_faults("files.blocks-no-commands", lambda text: read(text, bare), [COUNTS + "T1,1,500,2,4\n"])


def test_widths_of_a_list_are_written_by_their_number(run: Run, tmp_path: Path) -> None:
    assert run("plan", "-", *GOAL, "--scheme", "command-block", *BLOCKS, stdin=WIDTHS).returncode in (0, 4)
    rows = rows_of(tmp_path / "blocks.csv")
    assert rows
    assert {(row["width_s"], row["width_counts"]) for row in rows} <= {("0.1", "1"), ("0.3", "2"), ("0.5", "3")}


FAULTY = (
    TOP + "T2,1,1,0.1,4\nT1,0,-1,0,1.5\nT1,4,1,0.1,10\nT1,8,1,0.1,2\nT1,30,x,0.1,1\n",
    TOP + "T1,1,1,0.1,3000\nT1,3001,1,0.1,3000\n",
    TOP + "T1,1,1,0.1,100000\n",
    COUNTS + "T1,3,-4,0,4\nT1,9,2.5,3,4\n",
    "channel,delay\nT1,1\n",
)


def test_all_faults_of_a_file_are_listed_and_what_cannot_be_commanded_is_named(read: Read) -> None:
    check_faults("files.blocks", read, FAULTY)
    assert [block.count for block in read(TOP + "T1,1,1,0.1,5000\n")[0]] == [5000]
    every = TOP.replace("\n", ",every\n")
    check_text("files.blocks-warned", "\n".join(read(every + "T1,3,4.899,0.153,4,3\nT1,20,1.001,0.1,300,1\n")[1]))


def test_a_first_utc_that_is_none_or_another_is_a_fault_with_its_place(read: Read) -> None:
    text = TOP.strip() + ",first_utc\nT1,3,1.0,0.1,4,"
    begins = CRAFT.utc(fired(CRAFT, read(f"{text}\n")[0]).pulses[0].loaded[0])
    assert read(f"{text}{begins}\n")[1] == []
    wrong = [fault for utc in ("yesterday", "1998-01-07T13:00:00Z") for fault in faults(read, f"{text}{utc}\n")]
    check_text("files.blocks-first-utc", "\n".join(wrong).replace(str(begins), "UTC"))


def test_the_jitter_of_the_sun_pulse_moves_the_pulses_and_is_the_same_each_time(run: Run, read: Read) -> None:
    blocks, _ = read(TOP + "T1,1,1,0.1,40\n")
    shaky = FILE.replace("{azimuth: 35 deg}", "{azimuth: 35 deg, jitter: 5 ms}")
    flown = run("simulate", "-", *BLOCKS, "--json", "-", "--samples", "2", stdin=shaky)
    assert flown.returncode == 4  # it leaves more nutation than the requirement allows
    check_text("files.blocks-jitter", flown.stderr)
    starts = [pulse["start_s"] for pulse in json.loads(flown.stdout)["pulses"]]
    again = fired(read_spacecraft(shaky, "f.yaml"), blocks, JITTER_SEED)
    assert starts == [pulse.start for pulse in again.pulses]
    still = [pulse.start for pulse in fired(CRAFT, blocks).pulses]
    assert 0.003 < np.std(np.subtract(starts, still)) < 0.007


def test_where_no_blocks_can_be_written_or_fired(run: Run, tmp_path: Path) -> None:
    refused = [run("plan", "-", *GOAL, "--scheme", "rhumb-line", *BLOCKS, stdin=FILE)]
    assert not (tmp_path / "blocks.csv").exists()
    (tmp_path / "blocks.csv").write_text(TOP + "+M1,1,0.1,0.1,4\n")
    refused += [run("simulate", *BLOCKS), run("simulate", *BLOCKS, "--scheme", "none")]
    # Sun along the axis, delay longer than a spin, no width, rising pressure, min > max of a cone.
    bad = FILE.replace("sun: epoch", "sun: [0 deg, 90 deg]").replace("delay_max: 4.9 s", "delay_max: 6 s")
    bad = bad.replace("width: {step: 10 ms, min: 100 ms, max: 500 ms}", "width: []")
    bad += "keep: [{name: Moon, direction: [10 deg, 5 deg], min: 20 deg, max: 4 deg}]\n"
    bad += "tank: {propellant: 30 kg, pressure: 8 bar, final_pressure: 22 bar}\n"
    blind = FILE.replace("{azimuth: 35 deg}", "{azimuth: 35 deg, elevation: 60 deg, half_width: 20 deg}")
    refused += [run("plan", "-", stdin=bad), run("check", "-", stdin=blind)]
    assert [screen.returncode for screen in refused] == [2, 3, 2, 2, 2]
    check_text("files.blocks-refused", "\n".join(screen.stderr.rpartition("\n\n")[2] for screen in refused))


@pytest.mark.deep
def test_disperse_and_verify_fire_the_blocks_of_a_file(run: Run) -> None:
    """The same cases as of the plan from which the file was written: each from its own Sun pulses."""
    text = FILE + "dispersions: {thrust: {normal: 3 %}, A: {normal: 1 %}}\n"
    scheme = ("--scheme", "command-block")
    assert run("plan", "-", *GOAL, *scheme, *BLOCKS, stdin=text).returncode in (0, 4)
    flown = []
    for source in (BLOCKS, scheme):
        screen = run("disperse", "-", *GOAL, *source, "--samples", "100", "--json", "-", stdin=text)
        assert screen.returncode in (0, 4), screen.stderr
        flown.append(json.loads(screen.stdout))
    assert flown[0]["requirement"] == flown[1]["requirement"]
    for name, percentiles in flown[0]["percentiles"].items():
        assert percentiles == pytest.approx(flown[1]["percentiles"][name], rel=1e-9, abs=1e-9)
    verified = run("verify", "-", *GOAL, *BLOCKS, stdin=text)
    assert verified.returncode == 0, verified.stderr
    assert "blocks.csv" in verified.stdout
    assert run("verify", "-", *GOAL, *BLOCKS, "--schedule", "blocks.csv", stdin=text).returncode == 2
