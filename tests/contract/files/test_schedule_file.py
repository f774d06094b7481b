"""Schedules that people wrote or edited: start_s, on_time_s and channel are enough, and rule."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.builders import Outcome
from support.process import Run

from nutdamp import flight, planning
from nutdamp.errors import FaultyFile
from nutdamp.files import table
from nutdamp.files.examples import example_text
from nutdamp.files.pulses_csv import pulses_csv
from nutdamp.files.schedule_file import read_pulses
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.remarks import infeasibility
from nutdamp.schedule import Pulse, Schedule, overlapping
from nutdamp.spacecraft import Limits, Spacecraft, Steerable

pytestmark = pytest.mark.usefixtures("plans_shared")

EXAMPLE = read_spacecraft(example_text(), "example.yaml")


@pytest.fixture(name="written")
def _written(tmp_path: Path) -> Path:
    """The four pulses of the example as `plan --csv` writes them."""
    path = tmp_path / "pulses.csv"
    path.write_text(pulses_csv(planning.plan(EXAMPLE, "four-pulse").flight))
    return path


def edited(path: Path, row: int, **cells: str) -> None:
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    rows[row - 1].update(cells)
    with path.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)


def read(text: str, folder: Path, body: Spacecraft = EXAMPLE) -> tuple[Schedule, list[str]]:
    path = folder / "s.csv"
    path.write_text(text)
    made, warnings = read_pulses(path, body)
    return made, [warning.removeprefix(str(folder)) for warning in warnings]


def problems(text: str, folder: Path, body: Spacecraft = EXAMPLE) -> list[str]:
    with pytest.raises(FaultyFile) as wrong:
        read(text, folder, body)
    return [f"{fault.line}: {fault.where}: {fault.problem}" for fault in wrong.value.faults]


def test_a_longer_on_time_is_what_the_thruster_then_does(written: Path) -> None:
    """0.7 s instead of 0.564 s of pulse 4 leave 0.2477 deg, by the reference integrator too."""
    edited(written, 4, on_time_s="0.7")
    made, warnings = read_pulses(written, EXAMPLE)
    last = made.pulses[-1]
    assert (last.on_time, last.channel) == (0.7, "-M2")
    assert last.start == pytest.approx(4.884622381967264, abs=1e-15)
    assert last.impulse.tolist() == pytest.approx([0.0, -5.6, 0.0])
    assert last.propellant == pytest.approx(0.7 * 10.0 / (220.0 * 9.80665))
    assert last.force is not None
    left = flight.flown(EXAMPLE, made).residual
    assert math.degrees(left.nutation) == pytest.approx(0.2477, abs=5e-5)
    assert left.nutation == pytest.approx(Outcome(EXAMPLE, made).nutation, abs=1e-9)
    # Each kind of column is reported once: centre, impulse, propellant.
    starts = [warning.partition(":5: ")[2].split()[0] for warning in warnings]
    assert starts == ["t_s", "impulse_1_Nms", "propellant_kg"]
    assert all(warning.endswith("ignored") for warning in warnings)


def test_columns_that_contradict_in_many_rows_are_reported_once(written: Path) -> None:
    for row in (1, 2, 3):
        edited(written, row, torque_1_Nm="1", torque_2_Nm="x", propellant_kg="")
    _, warnings = read_pulses(written, EXAMPLE)
    assert len(warnings) == 1
    assert ":2: torque_1_Nm to torque_3_Nm = (1, 'x', 0) contradicts that of '-M1'" in warnings[0]
    assert warnings[0].endswith("ignored (and so in 2 more rows)")


def test_what_was_written_is_read_without_a_word(written: Path) -> None:
    plan = planning.plan(EXAMPLE, "four-pulse")
    made, warnings = read_pulses(written, EXAMPLE)
    assert warnings == []
    assert flight.flown(EXAMPLE, made).residual == plan.flown
    assert made.propellant == pytest.approx(plan.pulses.propellant, rel=1e-15)


def test_three_columns_are_enough(tmp_path: Path, written: Path) -> None:
    full, _ = read_pulses(written, EXAMPLE)
    rows = "".join(f"{pulse.start!r},{pulse.on_time!r},{pulse.channel}\n" for pulse in full)
    bare, warnings = read(f"start_s,on_time_s,channel\n{rows}", tmp_path)
    assert warnings == []
    for one, other in zip(bare, full, strict=True):
        assert (one.t, one.on_time, one.channel, one.propellant) == (
            other.t,
            other.on_time,
            other.channel,
            other.propellant,
        )
        assert np.array_equal(one.impulse, other.impulse)
    centres = "".join(f"{pulse.t!r},{pulse.on_time!r},{pulse.channel}\n" for pulse in full)
    again, warnings = read(f"t_s,on_time_s,channel\n{centres}", tmp_path)
    assert warnings == []
    assert [pulse.t for pulse in again] == [pulse.t for pulse in full]
    # Where a start is left blank the centre counts.
    mixed, _ = read("start_s,t_s,on_time_s,channel\n,2,1,+M1\n4,,1,+M1\n", tmp_path)
    assert [pulse.start for pulse in mixed] == [1.5, 4.0]


def test_steered_pulses_and_unknown_channels_need_a_torque_or_an_impulse(tmp_path: Path) -> None:
    header = "start_s,on_time_s,channel"
    assert problems(f"{header}\n1,1,steerable\n3,1,XX\n", tmp_path) == [
        "2: channel: a steered pulse needs torque_1_Nm to torque_3_Nm (or impulse_1_Nms to impulse_3_Nms)",
        "3: channel: 'XX', not in the spacecraft file (it has '+M1', '-M1', '+M2', '-M2'), needs torque_1_Nm to "
        "torque_3_Nm (or impulse_1_Nms to impulse_3_Nms)",
    ]
    torques = "torque_1_Nm,torque_2_Nm,torque_3_Nm"
    impulses = "impulse_1_Nms,impulse_2_Nms,impulse_3_Nms"
    body = replace(EXAMPLE, channels=(), steerable=Steerable(5.0, 220.0, 1.0))
    made, warnings = read(f"{header},{torques}\n1,0.5,steerable,3,4,0\n", tmp_path, body)
    assert warnings == []
    assert made.pulses[0].impulse.tolist() == pytest.approx([1.5, 2.0, 0.0])
    assert made.pulses[0].propellant == pytest.approx(2.5 / (220.0 * 9.80665))
    made, warnings = read(f"{header},{impulses}\n1,0.5,XX,1.5,2,0.25\n", tmp_path, body)
    torque = made.pulses[0].torque
    assert torque is not None
    assert torque.tolist() == pytest.approx([3.0, 4.0, 0.5])
    assert made.propellant is None
    assert "channel 'XX' is not in the spacecraft file (steerable): flown as given" in warnings[0]
    # The torque rules over the impulse, and is flown where it is not the torquer's.
    made, warnings = read(f"{header},{torques},{impulses}\n1,0.5,steerable,6,8,0,1.5,2,0\n", tmp_path, body)
    assert made.pulses[0].impulse.tolist() == pytest.approx([3.0, 4.0, 0.0])
    assert (
        "impulse_1_Nms to impulse_3_Nms = (1.5, 2, 0) contradicts torque × on_time_s, (3, 4, 0): ignored" in warnings[0]
    )
    assert "10 N m is not the torque of the steerable torquer, 5 N m: flown as given" in warnings[1]


def test_an_ideal_impulse_of_a_channel(tmp_path: Path) -> None:
    header = "start_s,on_time_s,channel,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms"
    made, warnings = read(f"{header}\n1,0,+M1,4,0,0\n", tmp_path)
    assert made.pulses[0].torque is None
    assert "'+M1' has an on-time of 0: flown as an ideal impulse" in warnings[0]
    (problem,) = problems(f"{header}\n1,0,+M1,,,\n", tmp_path)
    assert "with an on-time of 0 '+M1' fires nothing" in problem


def test_on_times_off_the_limits_are_flown_with_a_warning(run: Run, tmp_path: Path) -> None:
    """Too short, too long, off the ticks: as given, and reported."""
    (tmp_path / "s.csv").write_text("start_s,on_time_s,channel\n1,0.001,+M1\n5.0123456,3,+M2\n")
    done = run("simulate", "--schedule", "s.csv", "--set", "limits.tick=10 ms", "--json", "-")
    assert done.returncode == 4, done.stderr
    pulses = json.loads(done.stdout)["pulses"]
    assert [pulse["on_time_s"] for pulse in pulses] == [0.001, 3.0]
    assert [pulse["impulse_Nms"][:2] for pulse in pulses] == [[pytest.approx(0.008), 0], [0, pytest.approx(24.0)]]
    for text in ("is on for 0.001 s", "is on for 3 s", "does not start on a tick of 0.01 s"):
        assert text in done.stderr


def test_columns_that_are_not_known_are_reported(tmp_path: Path) -> None:
    _, warnings = read("start_s,on_time_s,channel,note,nutation_after_deg\n1,1,+M1,first,77\n", tmp_path)
    assert [warning.rpartition(":1: ")[2] for warning in warnings] == ["the column 'note' is not known: ignored"]


def test_names_that_cannot_be_shown_are_refused(tmp_path: Path) -> None:
    (problem,) = problems("start_s,on_time_s,channel\n1,1,\x1b[31mred\n", tmp_path)
    assert problem == "2: channel: '\\x1b[31mred' is no name of a channel; printable characters are expected"


# --- the clock -------------------------------------------------------------------------------------------------------


def test_a_pulse_shorter_than_the_clock_tells_is_refused(tmp_path: Path) -> None:
    header = "start_s,on_time_s,channel\n"
    (problem,) = problems(f"{header}1e15,0.3,+M1\n", tmp_path)
    assert problem == "2: on_time_s: 0.3 s is too short at 1e+15 s, where times are 0.12 s apart"
    assert len(problems(f"{header}9,1e-14,+M1\n", tmp_path)) == 1
    made, _ = read(f"{header}1e15,2000,+M1\n9,1e-9,+M1\n", tmp_path)
    assert len(made) == 2


@pytest.mark.parametrize("start", [0.0, 1e6, 1e15 - 1e5])
def test_pulses_of_one_channel_never_overlap(tmp_path: Path, start: float) -> None:
    """Side by side is allowed at any time, a hundredth of the on-time too early at none."""
    on_time = 4096.0 if start else 0.5
    header = "start_s,on_time_s,channel\n"
    for early, faults in ((0.0, 0), (0.01, 1)):
        second = start + on_time * (1.0 - early)
        text = f"{header}{second!r},{on_time!r},+M1\n{start!r},{on_time!r},+M1\n{start!r},{on_time!r},-M1\n"
        if faults:
            assert problems(text, tmp_path) == ["2: start_s: its channel is still firing the pulse of line 3"]
        else:
            made, _ = read(text, tmp_path)
            assert len(made) == 3


def test_an_overlap_behind_a_shorter_pulse_is_seen() -> None:
    """The long pulse still fires when the third begins, whatever came in between."""

    def pulse(start: float, on_time: float) -> Pulse:
        return Pulse(start + 0.5 * on_time, on_time, "T", np.zeros(3))

    assert overlapping([("a", pulse(0.0, 10.0)), ("b", pulse(1.0, 1.0)), ("c", pulse(5.0, 1.0))]) == [
        ("b", "a"),
        ("c", "a"),
    ]


@pytest.mark.parametrize("late", [1e14, 1e15 - 1000.0])
def test_schemes_plan_no_pulse_that_the_clock_cannot_tell(late: float) -> None:
    """It was planned, left nutation, and the on-times were said to be why."""
    body = replace(EXAMPLE, limits=Limits(horizon=late + 1000.0, earliest=late))
    for scheme in ("one-pulse", "two-pulse", "four-pulse"):
        made = planning.plan(body, scheme)
        assert not made.feasible
        assert "too short for its time, where times are" in str(infeasibility(made))


# --- size ------------------------------------------------------------------------------------------------------------


def test_a_schedule_that_is_no_schedule_by_its_size_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "huge.csv"
    with path.open("wb") as stream:
        stream.truncate(table.MOST_BYTES + 1)
    with pytest.raises(FaultyFile, match="larger than 32 MiB"):
        read_pulses(path, EXAMPLE)
    monkeypatch.setattr(table, "MOST_ROWS", 3)
    rows = "".join(f"{start},0.5,+M1\n" for start in range(4))
    assert problems(f"start_s,on_time_s,channel\n{rows}", tmp_path) == ["5: : more than 3 pulses"]


def test_faults_say_what_would_be_right(tmp_path: Path) -> None:
    header = "start_s,on_time_s,channel\n"
    assert problems(f"{header}1,0.5,+m1\n", tmp_path)[0].startswith(
        "2: channel: '+m1', not in the spacecraft file (did you mean '+M1'?), needs"
    )
    assert "(it has '+M1', '-M1', '+M2', '-M2')" in problems(f"{header}1,0.5,engine\n", tmp_path)[0]
    assert problems(f"{header}1,-1,+M1\n-2,0.5,+M1\n1e16,1,+M1\n", tmp_path) == [
        "2: on_time_s: -1 s is negative; 0.02 s to 2 s is expected (0 for an ideal impulse)",
        "3: start_s: the pulse would start at -2 s; 0 s or later is expected",
        "4: start_s: '1e16' is out of range, -1e+15 to 1e+15",
    ]
    assert problems("start_s,on_time,chanel\n", tmp_path) == [
        "1: on_time_s: the column is missing; rename 'on_time' if that is meant",
        "1: channel: the column is missing; rename 'chanel' if that is meant",
    ]
    assert problems("start,on_time_s,channel\n", tmp_path) == [
        "1: start_s: the column is missing (or t_s, the centre); rename 'start' if that is meant"
    ]
