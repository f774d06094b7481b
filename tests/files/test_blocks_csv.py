"""Command blocks in files: what `plan` writes is what `simulate` fires, and faults of edited ones have their place."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from process import Run
from spinners import FILE

from nutdamp.errors import FaultyFile
from nutdamp.files.blocks_csv import HEADER, read_blocks
from nutdamp.files.spacecraft_file import read_spacecraft

CRAFT = read_spacecraft(FILE, "f.yaml")
TOP = "channel,first_sun_pulse,delay_s,width_s,count\n"
GOAL = ("--target", "20deg,82deg")


def problems(text: str, folder: Path) -> list[str]:
    path = folder / "blocks.csv"
    path.write_text(text)
    with pytest.raises(FaultyFile) as caught:
        read_blocks(path, CRAFT)
    return [f"{fault.line}: {fault.where}: {fault.problem}" for fault in caught.value.faults]


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
    assert done.returncode == 0
    assert "blocks.csv:2: delay_s is none of the commands of the spacecraft file: flown as given" in done.stderr
    assert "blocks.csv:3: count is none of the commands" in done.stderr
    assert "304" in done.stdout


def test_the_jitter_of_the_sun_pulse_moves_the_pulses_and_is_the_same_each_time(run: Run, tmp_path: Path) -> None:
    (tmp_path / "blocks.csv").write_text(TOP + "T1,1,1,0.1,40\n")
    shaky = FILE.replace("{azimuth: 35 deg}", "{azimuth: 35 deg, jitter: 5 ms}")
    starts = []
    for text, name in ((FILE, "still"), (shaky, "first"), (shaky, "second")):
        done = run("simulate", "-", "--blocks", "blocks.csv", "--json", f"{name}.json", "--samples", "2", stdin=text)
        assert done.returncode == 0
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
        "3: count: expected a whole number from 1 to 100000, got 1.5",
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
