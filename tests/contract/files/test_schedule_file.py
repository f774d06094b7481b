"""Schedules that people wrote or edited: start_s, on_time_s and channel are enough, and rule."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.builders import Outcome
from support.contract import check_faults, faults, known
from support.golden import check_text
from support.process import Run

from nutdamp import flight, planning
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
STEERED = replace(EXAMPLE, channels=(), steerable=Steerable(5.0, 220.0, 1.0))
TOP = "start_s,on_time_s,channel"
TORQUES, IMPULSES = "torque_1_Nm,torque_2_Nm,torque_3_Nm", "impulse_1_Nms,impulse_2_Nms,impulse_3_Nms"
Read = Callable[..., tuple[Schedule, list[str]]]


@pytest.fixture
def read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Read:
    """``read(text, body)``: a file of that text."""
    monkeypatch.chdir(tmp_path)

    def read(text: str, body: Spacecraft = EXAMPLE) -> tuple[Schedule, list[str]]:
        Path("s.csv").write_text(text, newline="")
        return read_pulses(Path("s.csv"), body)

    return read


@pytest.fixture
def written() -> str:
    """The four pulses of the example as `plan --csv` writes them."""
    return pulses_csv(planning.plan(EXAMPLE, "four-pulse").flight)


def edited(text: str, *numbers: int, **cells: str) -> str:
    """With other cells in the rows of these numbers, from 1."""
    rows = list(csv.DictReader(io.StringIO(text)))
    for number in numbers:
        rows[number - 1].update(cells)
    stream = io.StringIO()
    writer = csv.DictWriter(stream, rows[0].keys())
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def test_a_longer_on_time_is_what_the_thruster_then_does(read: Read, written: str) -> None:
    """0.7 s instead of 0.564 s of pulse 4 leave 0.2477 deg, by the reference integrator too."""
    made, longer = read(edited(written, 4, on_time_s="0.7"))
    last = made.pulses[-1]
    assert (last.on_time, last.channel) == (0.7, "-M2")
    assert last.start == pytest.approx(4.884622381967264, abs=1e-15)
    assert last.impulse.tolist() == pytest.approx([0.0, -5.6, 0.0])
    assert last.propellant == pytest.approx(0.7 * 10.0 / (220.0 * 9.80665))
    assert last.force is not None
    left = flight.flown(EXAMPLE, made).residual
    assert math.degrees(left.nutation) == pytest.approx(0.2477, abs=5e-5)
    assert left.nutation == pytest.approx(Outcome(EXAMPLE, made).nutation, abs=1e-9)
    # Each kind of column that contradicts is reported once: centre, impulse, propellant.
    _, contradicting = read(edited(written, 1, 2, 3, torque_1_Nm="1", torque_2_Nm="x", propellant_kg=""))
    _, unknown = read(f"{TOP},note,nutation_after_deg\n1,1,+M1,first,77\n")
    check_text("files.schedule-ignored", "\n".join([*longer, *contradicting, *unknown]))


def test_what_was_written_is_read_without_a_word_and_three_columns_are_enough(read: Read, written: str) -> None:
    plan = planning.plan(EXAMPLE, "four-pulse")
    whole, warnings = read(written)
    assert flight.flown(EXAMPLE, whole).residual == plan.flown
    assert whole.propellant == pytest.approx(plan.pulses.propellant, rel=1e-15)
    rows = "".join(f"{pulse.start!r},{pulse.on_time!r},{pulse.channel}\n" for pulse in whole)
    bare, more = read(f"{TOP}\n{rows}")
    for one, other in zip(bare, whole, strict=True):
        for name in ("t", "on_time", "channel", "propellant"):
            assert getattr(one, name) == getattr(other, name)
        assert np.array_equal(one.impulse, other.impulse)
    centres = "".join(f"{pulse.t!r},{pulse.on_time!r},{pulse.channel}\n" for pulse in whole)
    again, most = read(f"t_s,on_time_s,channel\n{centres}")
    assert [pulse.t for pulse in again] == [pulse.t for pulse in whole]
    assert [*warnings, *more, *most] == []
    # Where a start is left blank the centre counts.
    mixed, _ = read("start_s,t_s,on_time_s,channel\n,2,1,+M1\n4,,1,+M1\n")
    assert [pulse.start for pulse in mixed] == [1.5, 4.0]


def test_steered_pulses_and_ideal_impulses_have_a_torque_or_an_impulse(read: Read) -> None:
    made, warnings = read(f"{TOP},{TORQUES}\n1,0.5,steerable,3,4,0\n", STEERED)
    assert warnings == []
    assert made.pulses[0].impulse.tolist() == pytest.approx([1.5, 2.0, 0.0])
    assert made.pulses[0].propellant == pytest.approx(2.5 / (220.0 * 9.80665))
    made, unknown = read(f"{TOP},{IMPULSES}\n1,0.5,XX,1.5,2,0.25\n", STEERED)
    assert known(made.pulses[0].torque).tolist() == pytest.approx([3.0, 4.0, 0.5])
    assert made.propellant is None
    # The torque rules over the impulse, and is flown where it is not the torquer's.
    made, ruled = read(f"{TOP},{TORQUES},{IMPULSES}\n1,0.5,steerable,6,8,0,1.5,2,0\n", STEERED)
    assert made.pulses[0].impulse.tolist() == pytest.approx([3.0, 4.0, 0.0])
    made, ideal = read(f"{TOP},{IMPULSES}\n1,0,+M1,4,0,0\n")
    assert made.pulses[0].torque is None
    assert made.pulses[0].impulse.tolist() == [4.0, 0.0, 0.0]
    check_text("files.schedule-steered", "\n".join([*unknown, *ruled, *ideal]))


def test_on_times_off_the_limits_are_flown_with_a_warning(run: Run, tmp_path: Path) -> None:
    """Too short, too long, off the ticks: as given, and reported."""
    (tmp_path / "s.csv").write_text(f"{TOP}\n1,0.001,+M1\n5.0123456,3,+M2\n")
    flown = run("simulate", "--schedule", "s.csv", "--set", "limits.tick=10 ms", "--samples", "2", "--json", "-")
    assert flown.returncode == 4, flown.stderr
    pulses = json.loads(flown.stdout)["pulses"]
    assert [pulse["on_time_s"] for pulse in pulses] == [0.001, 3.0]
    assert [pulse["impulse_Nms"][:2] for pulse in pulses] == [[pytest.approx(0.008), 0], [0, pytest.approx(24.0)]]
    check_text("files.schedule-limits", flown.stderr)


FAULTY = (
    f"{TOP}\n1,1,steerable\n3,1,XX\n",
    f"{TOP},{IMPULSES}\n1,0,+M1,,,\n",
    f"{TOP}\n1,1,\x1b[31mred\n",
    f"{TOP}\n1e15,0.3,+M1\n",  # shorter than the clock tells
    f"{TOP}\n9,1e-14,+M1\n",
    f"{TOP}\n1,0.5,+m1\n",
    f"{TOP}\n1,0.5,engine\n",
    f"{TOP}\n1,-1,+M1\n-2,0.5,+M1\n1e16,1,+M1\n",
    "start_s,on_time,chanel\n",
    "start,on_time_s,channel\n",
)


def test_faults_say_what_would_be_right(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    check_faults("files.schedule", read, FAULTY)
    assert len(read(f"{TOP}\n1e15,2000,+M1\n9,1e-9,+M1\n")[0]) == 2
    with Path("huge.csv").open("wb") as stream:
        stream.truncate(table.MOST_BYTES + 1)
    huge = faults(read_pulses, Path("huge.csv"), EXAMPLE)
    monkeypatch.setattr(table, "MOST_ROWS", 3)
    rows = "".join(f"{start},0.5,+M1\n" for start in range(4))
    assert len(read(f"{TOP}\n{rows.partition('3,')[0]}")[0]) == 3
    check_text("files.schedule-size", "\n".join([*huge, *faults(read, f"{TOP}\n{rows}")]))


@pytest.mark.parametrize("start", [0.0, 1e6, 1e15 - 1e5])
def test_pulses_of_one_channel_never_overlap(read: Read, start: float) -> None:
    """Side by side is allowed at any time, a hundredth of the on-time too early at none."""
    on_time = 4096.0 if start else 0.5
    text = f"{TOP}\n{{!r}},{on_time!r},+M1\n{start!r},{on_time!r},+M1\n{start!r},{on_time!r},-M1\n"
    assert len(read(text.format(start + on_time))[0]) == 3
    assert [fault.partition(":1: ")[::2] for fault in faults(read, text.format(start + on_time * 0.99))] == [
        ("2", "start_s: its channel is still firing the pulse of line 3")
    ]


def test_an_overlap_behind_a_shorter_pulse_is_seen() -> None:
    """The long pulse still fires when the third begins, whatever came in between."""
    times = {"a": (0.0, 10.0), "b": (1.0, 1.0), "c": (5.0, 1.0)}
    pulses = [(name, Pulse(start + 0.5 * on, on, "T", np.zeros(3))) for name, (start, on) in times.items()]
    assert overlapping(pulses) == [("b", "a"), ("c", "a")]


@pytest.mark.parametrize("late", [1e14, 1e15 - 1000.0])
def test_schemes_plan_no_pulse_that_the_clock_cannot_tell(late: float) -> None:
    """It was planned, left nutation, and the on-times were said to be why."""
    body = replace(EXAMPLE, limits=Limits(horizon=late + 1000.0, earliest=late))
    plans = [planning.plan(body, scheme) for scheme in ("one-pulse", "two-pulse", "four-pulse")]
    assert not any(plan.feasible for plan in plans)
    (reason,) = {(infeasibility(plan) or "").rpartition(") ")[2] for plan in plans}  # which pulse hangs on rounding
    check_text(f"files.schedule-late-{late:.0e}", reason)
