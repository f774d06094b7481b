"""Command blocks in files: what `plan` writes is what `simulate` fires, and faults of edited ones have their place."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from support.process import Run
from support.spinners import FILE

from nutdamp.errors import FaultyFile
from nutdamp.files.blocks_csv import HEADER, read_blocks
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.schemes.tools.sun_pulses import fired

pytestmark = pytest.mark.usefixtures("plans_shared")

CRAFT = read_spacecraft(FILE, "f.yaml")
TOP = "channel,first_sun_pulse,delay_s,width_s,count\n"
GOAL = ("--target", "20deg,82deg")


def problems(text: str, folder: Path) -> list[str]:
    path = folder / "blocks.csv"
    path.write_text(text)
    with pytest.raises(FaultyFile) as caught:
        read_blocks(path, CRAFT)
    return [f"{fault.line}: {fault.where}: {fault.problem}" for fault in caught.value.faults]


@pytest.mark.deep
def test_what_plan_writes_is_what_simulate_fires(run: Run, tmp_path: Path) -> None:
    made = run("plan", "-", *GOAL, "--blocks", "blocks.csv", "--csv", "pulses.csv", stdin=FILE)
    assert made.returncode == 0, made.stderr
    for text in (
        "Recommended: command-block",
        "first Sun",
        "Sun angle of H",
        "no other single block",
        "mass 300 kg to",
    ):
        assert text in made.stdout
    text = (tmp_path / "blocks.csv").read_text()
    (row,) = csv.DictReader(io.StringIO(text))
    assert tuple(row) == HEADER
    assert float(row["delay_s"]) == pytest.approx(2e-3 * int(row["delay_counts"]))
    assert float(row["delay_deg"]) == pytest.approx(72.0 * float(row["delay_s"]))
    assert float(row["width_s"]) == pytest.approx(1e-2 * int(row["width_counts"]))
    pulses = list(csv.DictReader(io.StringIO((tmp_path / "pulses.csv").read_text())))
    assert row["first_utc"] == pulses[0]["utc"]
    assert len(pulses) == int(row["count"])
    fired = run("simulate", "-", *GOAL, "--blocks", "blocks.csv", "--json", "end.json", stdin=FILE)
    assert fired.returncode == 0, fired.stderr
    assert f"{float(pulses[-1]['t_s']):.4f}" in fired.stdout
    assert "warning" not in fired.stderr


def test_an_edited_block_is_fired_and_what_cannot_be_commanded_is_named(run: Run, tmp_path: Path) -> None:
    (tmp_path / "blocks.csv").write_text(TOP + "T1,3,1.001,0.1,4\nT1,20,1.5,0.1,300\n")
    done = run("simulate", "-", "--blocks", "blocks.csv", stdin=FILE)
    assert done.returncode == 4
    assert "blocks.csv:2: delay_s = 1.001 s cannot be commanded, 1 s is the nearest: flown as given" in done.stderr
    assert "blocks.csv:3: count = 300 cannot be commanded, 255 is the most: flown as given" in done.stderr
    assert "of 304 pulses; --json writes all" in done.stdout
    assert sum(line.split()[:1] in (["1"], ["4"], ["304"]) for line in done.stdout.splitlines()) >= 3
    assert len(done.stdout.splitlines()) < 100
    assert "Requirement NOT met" in done.stdout


def test_counts_alone_are_read_where_the_spacecraft_file_has_the_steps(tmp_path: Path) -> None:
    path = tmp_path / "blocks.csv"
    path.write_text("channel,first_sun_pulse,delay_counts,width_counts,count\nT1,3,500,12,4\n")
    (block,), warned = read_blocks(path, CRAFT)
    assert [block.delay, block.width] == pytest.approx([1.0, 0.12], rel=1e-12)
    assert not warned
    path.write_text("channel,first_sun_pulse,delay_s,width_s,count,every\nT1,3,4.899,0.153,4,3\n")
    assert [text.partition(": ")[2] for text in read_blocks(path, CRAFT)[1]] == [
        "delay_s = 4.899 s cannot be commanded, 4.9 s is the nearest: flown as given",
        "width_s = 0.153 s cannot be commanded, 0.15 s is the nearest: flown as given",
        "every = 3 cannot be commanded, only 1, 2: flown as given",
    ]


def test_faults_of_counts(tmp_path: Path) -> None:
    top = "channel,first_sun_pulse,delay_counts,width_counts,count\n"
    assert problems(top + "T1,3,-4,0,4\nT1,9,2.5,3,4\n", tmp_path) == [
        "2: delay_counts: -4 is negative; expected a number of at least 0",
        "2: width_counts: 0 s fires nothing; expected a time above 0",
        "3: delay_counts: expected a whole number of steps, got 2.5",
    ]
    path = tmp_path / "blocks.csv"
    bare = read_spacecraft("\n".join(row for row in FILE.splitlines() if not row.startswith("commands")), "f.yaml")
    with pytest.raises(FaultyFile, match="no commands to count the width in; expected the column width_s"):
        read_blocks(path, bare)


def test_very_many_pulses_are_refused_at_once(tmp_path: Path) -> None:
    assert problems(TOP + "T1,1,1,0.1,3000\nT1,3001,1,0.1,3000\n", tmp_path) == [
        "1: count: the blocks fire 6000 pulses; expected at most 5000"
    ]
    assert problems(TOP + "T1,1,1,0.1,100000\n", tmp_path) == [
        "2: count: expected a whole number from 1 to 5000, got 100000"
    ]
    (tmp_path / "most.csv").write_text(TOP + "T1,1,1,0.1,5000\n")
    assert [block.count for block in read_blocks(tmp_path / "most.csv", CRAFT)[0]] == [5000]


def test_the_jitter_of_the_sun_pulse_moves_the_pulses_and_is_the_same_each_time(run: Run, tmp_path: Path) -> None:
    (tmp_path / "blocks.csv").write_text(TOP + "T1,1,1,0.1,40\n")
    shaky = FILE.replace("{azimuth: 35 deg}", "{azimuth: 35 deg, jitter: 5 ms}")
    starts = []
    for text, name in ((FILE, "still"), (shaky, "first"), (shaky, "second")):
        done = run("simulate", "-", "--blocks", "blocks.csv", "--json", f"{name}.json", "--samples", "2", stdin=text)
        assert done.returncode == 4  # it leaves more nutation than the requirement allows
        assert ("a jitter of 0.005 s" in done.stderr) == (text == shaky)
        pulses = json.loads((tmp_path / f"{name}.json").read_text())["pulses"]
        starts.append(np.array([one["start_s"] for one in pulses]))
    still, first, second = starts
    assert np.array_equal(first, second)
    assert 0.003 < np.std(first - still) < 0.007


def test_all_faults_of_a_file_are_listed(tmp_path: Path) -> None:
    rows = "T2,1,1,0.1,4\nT1,0,-1,0,1.5\nT1,4,1,0.1,10\nT1,8,1,0.1,2\nT1,30,x,0.1,1\n"
    assert problems(TOP + rows, tmp_path) == [
        "2: channel: the spacecraft file has no channel 'T2'; it has 'T1'",
        "3: delay_s: -1 s is negative; expected a time of at least 0",
        "3: width_s: 0 s fires nothing; expected a time above 0",
        "3: first_sun_pulse: expected a whole number from 1 to 100000, got 0",
        "3: count: expected a whole number from 1 to 5000, got 1.5",
        "5: first_sun_pulse: Sun pulse 8 comes before the block before is over; expected 14 or later",
        "6: delay_s: 'x' is not a number",
    ]
    assert problems("channel,delay\nT1,1\n", tmp_path)[0] == "1: first_sun_pulse: the column is missing"


def test_schemes_without_blocks_write_none(run: Run, tmp_path: Path) -> None:
    done = run("plan", "-", *GOAL, "--scheme", "rhumb-line", "--blocks", "blocks.csv", stdin=FILE)
    assert done.returncode == 2
    assert "no plan is made of command blocks" in done.stderr
    assert not (tmp_path / "blocks.csv").exists()


def test_blocks_need_a_sun_pulse(run: Run, tmp_path: Path) -> None:
    (tmp_path / "blocks.csv").write_text(TOP.replace("\n", ",every\n") + "+M1,1,0.1,0.1,4,\n")
    done = run("simulate", "--blocks", "blocks.csv")
    assert done.returncode == 3
    assert "sun_sensor" in done.stderr
    assert run("simulate", "--blocks", "blocks.csv", "--scheme", "none").returncode == 2


def test_everything_that_keeps_blocks_from_being_fired_is_listed(run: Run) -> None:
    """Sun along the axis, delay longer than a spin, no width, rising pressure, min > max of a cone; a blind sensor."""
    bad = FILE.replace("sun: epoch", "sun: [0 deg, 90 deg]").replace("delay_max: 4.9 s", "delay_max: 6 s")
    bad = bad.replace("width: {step: 10 ms, min: 100 ms, max: 500 ms}", "width: []")
    bad += "keep: [{name: Moon, direction: [10 deg, 5 deg], min: 20 deg, max: 4 deg}]\n"
    done = run("plan", "-", stdin=bad + "tank: {propellant: 30 kg, pressure: 8 bar, final_pressure: 22 bar}\n")
    assert done.returncode == 2
    for text in (
        "sun: lies along the spin axis at t = 0",
        "commands.delay_max: 6 s is not less than a spin turn of 5 s",
        "commands.width: empty",
        "keep[0].min: 20 deg exceeds max",
        "tank.final_pressure: 22 bar exceeds pressure",
    ):
        assert text in done.stderr
    blind = FILE.replace("{azimuth: 35 deg}", "{azimuth: 35 deg, elevation: 60 deg, half_width: 20 deg}")
    done = run("check", "-", stdin=blind)
    assert done.returncode == 2
    assert "sun_sensor: never sees the Sun, which is 112.4 deg from the spin axis at t = 0" in done.stderr


@pytest.mark.weekly
def test_disperse_and_verify_fire_the_blocks_of_a_file(run: Run) -> None:
    """The same cases as of the plan from which the file was written: each from its own Sun pulses."""
    text = FILE + "dispersions: {thrust: {normal: 3 %}, A: {normal: 1 %}}\n"
    assert run("plan", "-", *GOAL, "--blocks", "blocks.csv", stdin=text).returncode in (0, 4)
    flown = []
    for source in (("--blocks", "blocks.csv"), ("--scheme", "command-block")):
        done = run("disperse", "-", *GOAL, *source, "--samples", "200", "--json", "-", stdin=text)
        assert done.returncode in (0, 4), done.stderr
        flown.append({**json.loads(done.stdout), "scheme": ""})
    assert flown[0]["requirement"] == flown[1]["requirement"]
    for name, percentiles in flown[0]["percentiles"].items():
        assert percentiles == pytest.approx(flown[1]["percentiles"][name], rel=1e-9, abs=1e-9)
    verified = run("verify", "-", *GOAL, "--blocks", "blocks.csv", stdin=text)
    assert verified.returncode == 0, verified.stderr
    assert "blocks.csv" in verified.stdout
    both = run("verify", "-", *GOAL, "--blocks", "blocks.csv", "--schedule", "blocks.csv", stdin=text)
    assert both.returncode == 2


@pytest.mark.deep
def test_widths_of_a_list_are_counted_by_their_number(run: Run, tmp_path: Path) -> None:
    """What the file of blocks says in counts alone, the blocks are: entry 2 of 100, 300 and 500 ms is 300 ms."""
    text = FILE.replace("width: {step: 10 ms, min: 100 ms, max: 500 ms}", "width: [500 ms, 100 ms, 300 ms]")
    assert run("plan", "-", *GOAL, "--blocks", "blocks.csv", stdin=text).returncode in (0, 4)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "blocks.csv").read_text())))
    widths = {"0.1": "1", "0.3": "2", "0.5": "3"}
    assert rows
    assert all(row["width_counts"] == widths[row["width_s"]] for row in rows)
    craft = read_spacecraft(text, "f.yaml")
    path = tmp_path / "counts.csv"
    path.write_text("channel,first_sun_pulse,delay_counts,width_counts,count\nT1,1,500,2,4\n")
    (block,), _ = read_blocks(path, craft)
    assert (block.delay, block.width) == (1.0, 0.3)
    path.write_text("channel,first_sun_pulse,delay_counts,width_counts,count\nT1,1,500,4,4\n")
    with pytest.raises(FaultyFile, match=r"the number of an entry of commands\.width, 1 to 3, got 4"):
        read_blocks(path, craft)


def test_the_screen_has_what_an_operator_compares_before_and_after(run: Run, tmp_path: Path) -> None:
    text = FILE + "tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar, exponent: 1}\n"
    (tmp_path / "blocks.csv").write_text(TOP + "T1,1,1,0.3,12\n")
    for columns in (80, 140):
        done = run("simulate", "-", *GOAL, "--blocks", "blocks.csv", stdin=text, columns=columns)
        shown = done.stdout[done.stdout.index("Command blocks") :].splitlines()
        rows = {name: next(row for row in shown if row.startswith(name)) for name in ("H: right", "H: decl", "propell")}
        assert " to " in rows["H: right"]
        assert "H: declination      90" in rows["H: decl"]
        assert " g of 30 kg; 29.98" in rows["propell"]
        assert "mass 300 kg to 299.98" in rows["propell"]
        assert any(row.startswith("|ΔV|") and row.endswith(" m/s") for row in shown)


def test_a_first_utc_that_is_none_or_another_is_a_fault_with_its_place(tmp_path: Path) -> None:
    top, row = TOP.strip() + ",first_utc\n", "T1,3,1.0,0.1,4,{}\n"
    (found,) = problems(top + row.format("yesterday"), tmp_path)
    assert found.startswith("2: first_utc: 'yesterday' is no date and time")
    (found,) = problems(top + row.format("1998-01-07T13:00:00Z"), tmp_path)
    begins = CRAFT.utc(fired(CRAFT, read_blocks(edited(tmp_path, top + row.format("")), CRAFT)[0]).pulses[0].loaded[0])
    assert found == (
        f"2: first_utc: its first pulse begins at {begins}; correct first_sun_pulse, or leave first_utc empty"
    )
    assert not read_blocks(edited(tmp_path, top + row.format(begins)), CRAFT)[1]


def edited(folder: Path, text: str) -> Path:
    path = folder / "edited.csv"
    path.write_text(text)
    return path
