"""Schedules, command blocks and telemetry that people wrote or edited: what is read, and every
fault with its place.
"""

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support import places
from support.builders import Outcome, present
from support.commands import result
from support.commands import rows as rows_of
from support.contract import Write, at, check_faults, check_parts, faults
from support.golden import check_text
from support.process import Run
from support.spinners import FILE

import nutdamp
from nutdamp.errors import CannotRead
from nutdamp.estimation.parameters import (
    ACCELERATION,
    AXIS,
    DIRECTION,
    GYROS,
    QUATERNION,
    SEEN,
    SUN_ASPECT,
    Record,
)
from nutdamp.files import tabular
from nutdamp.files.reader import example_text, read_spacecraft
from nutdamp.files.schedules import BLOCKS_HEADER, EFFECTIVE, read_blocks, read_pulses
from nutdamp.files.telemetry import read_telemetry
from nutdamp.flight import propagation
from nutdamp.physics.thruster import Cold, Tank, Trapezoid
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import infeasibility
from nutdamp.schemes.block_model import fired
from nutdamp.spacecraft.equipment import Block, Steerable
from nutdamp.spacecraft.model import Limits
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views.parts import pulse_table

pytestmark = pytest.mark.usefixtures("plans_shared")

EXAMPLE = read_spacecraft(example_text(), "example.yaml")
STEERED = replace(EXAMPLE, channels=(), steerable=Steerable(5.0, 220.0, 1.0))
TOP = "start_s,on_time_s,channel"
TORQUES, IMPULSES = (
    "torque_1_Nm,torque_2_Nm,torque_3_Nm",
    "impulse_1_Nms,impulse_2_Nms,impulse_3_Nms",
)
Read = Callable[..., tuple[Schedule, list[str]]]


@pytest.fixture
def read(write: Write) -> Read:
    """``read(text, body)``: a file of that text."""
    return lambda text, body=EXAMPLE: read_pulses(write(text, "s.csv"), body)


@pytest.fixture
def written() -> str:
    """The four pulses of the example as `plan --csv` writes them."""
    return pulse_table(planning.plan(EXAMPLE, "four-pulse")._flight).csv()


def test_a_longer_on_time_is_what_the_thruster_then_does(read: Read, written: str) -> None:
    """0.7 s instead of 0.564 s of pulse 4 leave 0.2477 deg, by the reference integrator too."""
    on_time = planning.plan(EXAMPLE, "four-pulse").pulses.pulses[3].on_time
    made, longer = read(written.replace(f",{on_time!r},-M2", ",0.7,-M2"))
    fired = {
        "on_time": 0.7,
        "channel": "-M2",
        "start": pytest.approx(4.884622381967264, abs=1e-15),
        "impulse": pytest.approx([0.0, -5.6, 0.0]),
        "propellant": pytest.approx(0.7 * 10.0 / (220.0 * 9.80665)),
    }
    check_parts(made.pulses[-1], fired)
    assert made.pulses[-1].force is not None
    left = propagation.flown(EXAMPLE, made).residual
    assert math.degrees(left.nutation) == pytest.approx(0.2477, abs=5e-5)
    assert left.nutation == pytest.approx(Outcome(EXAMPLE, made).nutation, abs=1e-9)
    # The columns that say otherwise are named once each.
    assert [re.search(r"\w+_\w+", text.partition(": ")[2])[0] for text in longer] == [  # type: ignore[index]
        "t_s",
        "impulse_2_Nms",
    ]
    _, unknown = read(f"{TOP},note,nutation_after_deg\n1,1,+M1,first,77\n")
    check_text("files.schedule-ignored", "\n".join(unknown))


def test_what_was_written_is_read_without_a_word_and_three_columns_are_enough(
    read: Read, written: str
) -> None:
    plan = planning.plan(EXAMPLE, "four-pulse")
    whole, warnings = read(written)
    assert propagation.flown(EXAMPLE, whole).residual == plan.flown
    assert whole.propellant == pytest.approx(plan.pulses.propellant, rel=1e-15)
    rows = "".join(f"{pulse.start!r},{pulse.on_time!r},{pulse.channel}\n" for pulse in whole)
    bare, more = read(f"{TOP}\n{rows}")
    for one, other in zip(bare, whole, strict=True):
        same = ("t", "on_time", "channel", "propellant", "impulse")
        check_parts(one, {name: at(other, name) for name in same})
    centres = "".join(f"{pulse.t!r},{pulse.on_time!r},{pulse.channel}\n" for pulse in whole)
    again, most = read(f"t_s,on_time_s,channel\n{centres}")
    assert [pulse.t for pulse in again] == [pulse.t for pulse in whole]
    assert [*warnings, *more, *most] == []
    # Where a start is left blank the centre counts.
    mixed, _ = read("start_s,t_s,on_time_s,channel\n,2,1,+M1\n4,,1,+M1\n")
    assert [pulse.start for pulse in mixed] == [1.5, 4.0]


VALVE = Trapezoid(0.008, 0.012, 0.005, 0.010)
WRITTEN: dict[str, tuple[nutdamp.Spacecraft, str]] = {
    # The thrust falls within the pulse, so that its centroid is before the middle.
    "from a falling tank": (replace(EXAMPLE, tank=Tank(0.03, 22e5, 8e5, 1.0)), "four-pulse"),
    "through valves, from cold nozzles": (
        replace(
            EXAMPLE,
            channels=tuple(
                replace(one, thrusters=(replace(one.thrusters[0], valve=VALVE),))
                for one in EXAMPLE.channels
            ),
            cold=Cold(0.9, 4.0),
        ),
        "one-pulse",
    ),
}


@pytest.mark.parametrize(("body", "scheme"), WRITTEN.values(), ids=WRITTEN)
def test_pulses_are_read_as_they_were_written(
    read: Read, body: nutdamp.Spacecraft, scheme: str
) -> None:
    plan = planning.plan(body, scheme)
    text = pulse_table(plan._flight).csv()
    again, warnings = read(text, body)
    assert warnings == []
    assert text.splitlines()[0].endswith(",".join(EFFECTIVE)) == (body.cold is not None)
    for one, other in zip(plan.pulses, again, strict=True):
        assert body.tank is None or one.t < one.loaded[0] + 0.4999 * one.loaded[1]
        assert other.loaded == pytest.approx(one.loaded, rel=1e-12)
        assert (other.t, other.on_time) == pytest.approx((one.t, one.on_time), rel=1e-12)
        assert other.impulse == pytest.approx(one.impulse, rel=1e-12)


STEERING: dict[str, tuple[nutdamp.Spacecraft, dict[str, Any]]] = {
    f"{TOP},{TORQUES}\n1,0.5,steerable,3,4,0\n": (
        STEERED,
        {"0.impulse": [1.5, 2.0, 0.0], "0.propellant": 2.5 / (220.0 * 9.80665)},
    ),
    f"{TOP},{IMPULSES}\n1,0.5,XX,1.5,2,0.25\n": (
        STEERED,
        {"0.torque": [3.0, 4.0, 0.5], "0.propellant": None},
    ),
    # The torque rules over the impulse, and is flown where it is not the torquer's.
    f"{TOP},{TORQUES},{IMPULSES}\n1,0.5,steerable,6,8,0,1.5,2,0\n": (
        STEERED,
        {"0.impulse": [3.0, 4.0, 0.0]},
    ),
    f"{TOP},{IMPULSES}\n1,0,+M1,4,0,0\n": (
        EXAMPLE,
        {"0.torque": None, "0.impulse": [4.0, 0.0, 0.0]},
    ),
}


def test_steered_pulses_and_ideal_impulses_have_a_torque_or_an_impulse(read: Read) -> None:
    said = []
    for text, (body, expected) in STEERING.items():
        made, warnings = read(text, body)
        check_parts(made.pulses, {path: pytest.approx(part) for path, part in expected.items()})
        said += warnings
    check_text("files.schedule-steered", "\n".join(said))


def test_on_times_off_the_limits_are_flown_with_a_warning(run: Run, tmp_path: Path) -> None:
    """Too short, too long, off the ticks: as given, and reported."""
    (tmp_path / "s.csv").write_text(f"{TOP}\n1,0.001,+M1\n5.0123456,3,+M2\n")
    flown = run(
        "simulate",
        "--schedule",
        "s.csv",
        "--set",
        "limits.tick=10 ms",
        "--samples",
        "2",
        "--json",
        "-",
        status=4,
    )
    pulses = json.loads(flown.stdout)["pulses"]
    fired = [[pulse["on_time_s"], *pulse["impulse_Nms"][:2]] for pulse in pulses]
    assert np.array(fired) == pytest.approx(np.array([[0.001, 0.008, 0.0], [3.0, 0.0, 24.0]]))
    check_text("files.schedule-limits", flown.stderr)


def test_faults_say_what_would_be_right(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    check_faults(
        "files.schedule",
        read,
        (
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
        ),
    )
    assert len(read(f"{TOP}\n1e15,2000,+M1\n9,1e-9,+M1\n")[0]) == 2
    with Path("huge.csv").open("wb") as stream:
        stream.truncate(tabular.MOST_BYTES + 1)
    huge = faults(read_pulses, Path("huge.csv"), EXAMPLE)
    monkeypatch.setattr(tabular, "MOST_ROWS", 3)
    rows = "".join(f"{start},0.5,+M1\n" for start in range(4))
    assert len(read(f"{TOP}\n{rows.partition('3,')[0]}")[0]) == 3
    check_text("files.schedule-size", "\n".join([*huge, *faults(read, f"{TOP}\n{rows}")]))


@pytest.mark.parametrize("start", [0.0, 1e6, 1e15 - 1e5])
def test_pulses_of_one_channel_never_overlap(read: Read, start: float) -> None:
    """Side by side is allowed at any time, a hundredth of the on-time too early at none."""
    on_time = 4096.0 if start else 0.5
    text = f"{TOP}\n{{!r}},{on_time!r},+M1\n{start!r},{on_time!r},+M1\n{start!r},{on_time!r},-M1\n"
    assert len(read(text.format(start + on_time))[0]) == 3
    assert [
        fault.partition(":1: ")[::2] for fault in faults(read, text.format(start + on_time * 0.99))
    ] == [("2", "start_s: its channel is still firing the pulse of line 3")]
    # A long pulse still fires when the third begins, whatever came in between.
    long = faults(read, f"{TOP}\n0,10,+M1\n1,1,+M1\n5,1,+M1\n")
    assert [fault[0] for fault in long] == ["3", "4"]
    assert all(fault.endswith("the pulse of line 2") for fault in long)


@pytest.mark.parametrize("late", [1e14, 1e15 - 1000.0])
def test_schemes_plan_no_pulse_that_the_clock_cannot_tell(late: float) -> None:
    """It was planned, left nutation, and the on-times were said to be why."""
    body = replace(EXAMPLE, limits=Limits(horizon=late + 1000.0, earliest=late))
    plans = [planning.plan(body, scheme) for scheme in ("one-pulse", "two-pulse", "four-pulse")]
    assert not any(plan.feasible for plan in plans)
    (reason,) = {  # pairs of channels that cannot be told apart are none
        (infeasibility(plan) or "").rpartition(") ")[2] for plan in (plans[0], plans[2])
    }  # which pulse hangs on rounding
    check_text(f"files.schedule-late-{late:.0e}", reason)


# --- command blocks
# --------------------------------------------------------------------------------------------------

CRAFT = read_spacecraft(FILE, "f.yaml")
WIDTHS = FILE.replace(
    "width: {step: 10 ms, min: 100 ms, max: 500 ms}", "width: [500 ms, 100 ms, 300 ms]"
)
HEAD = "channel,first_sun_pulse,delay_s,width_s,count\n"
COUNTS = "channel,first_sun_pulse,delay_counts,width_counts,count\n"
GOAL = ("--target", "10deg,89deg")
BLOCKS = ("--blocks", "blocks.csv")
ReadBlocks = Callable[..., tuple[tuple[Block, ...], list[str]]]


@pytest.fixture
def blocks(write: Write) -> ReadBlocks:
    """``blocks(text, body)``: a file of that text."""
    return lambda text, body=CRAFT: read_blocks(write(text, "blocks.csv"), body)


def test_what_plan_writes_is_what_simulate_fires(run: Run, tmp_path: Path) -> None:
    """The screen has what an operator compares before and after."""
    text = (
        FILE + "tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar, exponent: 1}\n"
    )
    planned = run(
        "plan",
        "-v",
        "-",
        *GOAL,
        "--scheme",
        "command-block",
        *BLOCKS,
        "--csv",
        "pulses.csv",
        stdin=text,
        status=0,
    )
    (row,) = rows_of((tmp_path / "blocks.csv").read_text())
    assert tuple(row) == BLOCKS_HEADER
    for column, factor, other in (
        ("delay_s", 2e-3, "delay_counts"),
        ("delay_deg", 72.0, "delay_s"),
        ("width_s", 1e-2, "width_counts"),
    ):
        assert float(row[column]) == pytest.approx(factor * float(row[other]))
    pulses = rows_of((tmp_path / "pulses.csv").read_text())
    assert row["first_utc"] == pulses[0]["utc"]
    assert len(pulses) == int(row["count"])
    flown = run("simulate", "-", "-v", *GOAL, *BLOCKS, "--samples", "2", stdin=text, status=0)
    assert flown.stderr == ""
    table, effects, *_ = flown.stdout[flown.stdout.index("Command blocks") :].split("\n\n")
    assert table in planned.stdout
    check_text("files.blocks-screen", f"{table}\n\n{effects}")


def test_an_edited_block_is_fired(run: Run, tmp_path: Path) -> None:
    (tmp_path / "blocks.csv").write_text(HEAD + "T1,3,1.001,0.1,4\nT1,20,1.5,0.1,40\n")
    flown = run("simulate", "-", "-v", *BLOCKS, "--samples", "2", stdin=FILE, columns=120, status=4)
    lines = flown.stdout.splitlines()
    assert sum(line.split()[:1] in (["1"], ["4"], ["44"]) for line in lines) >= 3
    cut = next(line for line in lines if "of 44 pulses" in line)
    check_text("files.blocks-edited", f"{flown.stderr}{cut}")


def test_counts_alone_are_read_where_the_spacecraft_file_has_the_steps(blocks: ReadBlocks) -> None:
    """Of a list of widths they count the entries, the shortest first."""
    listed = read_spacecraft(WIDTHS, "f.yaml")
    rows = ("T1,3,500,12,4", CRAFT, 0.12), ("T1,1,500,2,4", listed, 0.3)
    for row, craft, width in rows:
        (block,), warned = blocks(f"{COUNTS}{row}\n", craft)
        assert [block.delay, block.width, *warned] == pytest.approx([1.0, width], rel=1e-12)
    lines = [row for row in FILE.splitlines() if not row.startswith("commands")]
    faulty = {
        "T1,1,500,4,4 of a list of three widths": ("T1,1,500,4,4", listed),
        "T1,1,500,2,4 without commands": (
            "T1,1,500,2,4",
            read_spacecraft("\n".join(lines), "f.yaml"),
        ),
    }
    check_faults(
        "files.blocks-counts", lambda case: blocks(f"{COUNTS}{case[0]}\n", case[1]), faulty
    )


def test_widths_of_a_list_are_written_by_their_number(run: Run, tmp_path: Path) -> None:
    assert run(
        "plan", "-", *GOAL, "--scheme", "command-block", *BLOCKS, stdin=WIDTHS
    ).returncode in (0, 4)
    rows = rows_of((tmp_path / "blocks.csv").read_text())
    assert rows
    assert {(row["width_s"], row["width_counts"]) for row in rows} <= {
        ("0.1", "1"),
        ("0.3", "2"),
        ("0.5", "3"),
    }


def test_all_faults_of_a_file_are_listed_and_what_cannot_be_commanded_is_named(
    blocks: ReadBlocks,
) -> None:
    check_faults(
        "files.blocks",
        blocks,
        (
            HEAD + "T2,1,1,0.1,4\nT1,0,-1,0,1.5\nT1,4,1,0.1,10\nT1,8,1,0.1,2\nT1,30,x,0.1,1\n",
            HEAD + "T1,1,1,0.1,3000\nT1,3001,1,0.1,3000\n",
            HEAD + "T1,1,1,0.1,100000\n",
            COUNTS + "T1,3,-4,0,4\nT1,9,2.5,3,4\n",
            "channel,delay\nT1,1\n",
            HEAD + "T1,4,1,0.1,10\nT1,8,1.06,0.1,2\nT1,1,0.95,0.1,5\n",
        ),
    )
    assert [block.count for block in blocks(HEAD + "T1,1,1,0.1,5000\n")[0]] == [5000]
    every = HEAD.replace("\n", ",every\n")
    check_text(
        "files.blocks-warned",
        "\n".join(blocks(every + "T1,3,4.899,0.153,4,3\nT1,20,1.001,0.1,300,1\n")[1]),
    )
    by_angle = replace(CRAFT, commands=replace(present(CRAFT.commands), delay_is="angle"))
    interleaved = HEAD + "T1,3,1,0.1,9\nT1,4,2,0.1,4\nT1,5,3,0.1,4\n"
    check_text("files.blocks-interleaved", "\n".join(blocks(interleaved, by_angle)[1]))


def test_two_blocks_a_turn_are_written_as_they_are_fired(run: Run, tmp_path: Path) -> None:
    """Half a turn of the Sun apart, and a block behind them; --schedule reads blocks too."""
    changed = ("state.nutation=1deg", "commands.per_turn=2", "commands.delay_is=angle")
    options = ("--spin", "20rpm", *(word for value in changed for word in ("--set", value)))
    source = str(places.case("two-pulses-a-turn.yaml"))
    scheme = ("--scheme", "command-block")
    planned = run("plan", source, *options, *scheme, *BLOCKS, "--csv", "pulses.csv", status=0)
    assert "FLY" in planned.stdout
    rows = rows_of((tmp_path / "blocks.csv").read_text())
    before, after = rows[-2:]
    assert before["first_sun_pulse"] == after["first_sun_pulse"]
    assert float(after["delay_deg"]) - float(before["delay_deg"]) == pytest.approx(180.0, abs=0.05)
    assert len(rows) > 2
    starts = [float(pulse["start_s"]) for pulse in rows_of((tmp_path / "pulses.csv").read_text())]
    for option in ("--blocks", "--schedule"):
        output = (option, "blocks.csv", "--json", "-", "--samples", "2")
        flown = run("simulate", source, *options, *output, status=0)
        again = json.loads(flown.stdout)
        assert [pulse["start_s"] for pulse in again["pulses"]] == pytest.approx(starts, abs=1e-6)
        codes = re.findall(r"warning\[(.*?)\]", flown.stderr)
        assert set(codes) <= {"models-differ"}  # the schedule is read as it was written


def test_a_single_flight_has_no_jitter_of_the_sun_pulses(run: Run, blocks: ReadBlocks) -> None:
    """Its verdict would be that of one draw; `disperse` gives each case its own."""
    read, _ = blocks(HEAD + "T1,1,1,0.1,40\n")
    shaky = FILE.replace("{azimuth: 35 deg}", "{azimuth: 35 deg, jitter: 5 ms}")
    # It leaves more nutation than the requirement allows.
    flown = run("simulate", "-", *BLOCKS, "--json", "-", "--samples", "2", stdin=shaky, status=4)
    starts = [pulse["start_s"] for pulse in json.loads(flown.stdout)["pulses"]]
    assert starts == [pulse.start for pulse in fired(CRAFT, read).pulses]


def test_where_no_blocks_can_be_written_or_fired(run: Run, tmp_path: Path) -> None:
    refused = [run("plan", "-", *GOAL, "--scheme", "rhumb-line", *BLOCKS, stdin=FILE)]
    assert not (tmp_path / "blocks.csv").exists()
    (tmp_path / "blocks.csv").write_text(HEAD + "+M1,1,0.1,0.1,4\n")
    refused += [run("simulate", *BLOCKS), run("simulate", *BLOCKS, "--scheme", "none")]
    # Delay longer than a spin, no width, rising pressure, min > max of a cone.
    late = FILE.replace("delay_max: 4.9 s", "delay_max: 6 s")
    bad = late.replace("width: {step: 10 ms, min: 100 ms, max: 500 ms}", "width: []") + (
        "keep: [{name: Moon, direction: [10 deg, 5 deg], min: 20 deg, max: 4 deg}]\n"
        "tank: {propellant: 30 kg, pressure: 8 bar, final_pressure: 22 bar}\n"
    )
    refused.append(run("plan", "-", stdin=bad))
    assert [screen.returncode for screen in refused] == [2, 3, 2, 2]
    check_text(
        "files.blocks-refused", "\n".join(screen.stderr.rpartition("\n\n")[2] for screen in refused)
    )


@pytest.mark.deep
def test_disperse_and_verify_fire_the_blocks_of_a_file(run: Run) -> None:
    """The same cases as of the plan from which the file was written:
    each from its own Sun pulses.
    """
    text = FILE + "dispersions: {thrust: {normal: 3 %}, A: {normal: 1 %}}\n"
    scheme = ("--scheme", "command-block")
    assert run("plan", "-", *GOAL, *scheme, *BLOCKS, stdin=text).returncode in (0, 4)
    by_file, by_scheme = (
        result(
            run, f"disperse - {' '.join((*GOAL, *source))} --samples 100", stdin=text, status=(0, 4)
        )
        for source in (BLOCKS, scheme)
    )
    assert by_file["requirement"] == by_scheme["requirement"]
    for name, percentiles in by_file["percentiles"].items():
        assert percentiles == pytest.approx(by_scheme["percentiles"][name], rel=1e-9, abs=1e-9)
    assert "blocks.csv" in run("verify", "-", *GOAL, *BLOCKS, stdin=text, status=0).stdout
    assert (
        run("verify", "-", *GOAL, *BLOCKS, "--schedule", "blocks.csv", stdin=text).returncode == 2
    )


# --- telemetry

BODY = nutdamp.example()
DATED = BODY.with_(
    attitude={"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"}
)
TIMES, PULSES = ("t",), ("sun pulses",)
ReadRecord = Callable[..., tuple[Record, list[str]]]


@pytest.fixture
def read_record(write: Write) -> ReadRecord:
    """``read(text, body, sun)``: a file of that text, and one of the times of Sun pulses."""
    return lambda text, body=BODY, sun="": read_telemetry(
        write(text, "flight.csv"), body, write(sun, "sun.csv") if sun else None
    )


HALF = math.sqrt(0.5)
TILTED = [math.cos(math.pi / 6), 0.0, 0.5]
NAN = math.nan
SUNNY = DATED.with_(sun="epoch")
SUN = present(SUNNY.sun).tolist()
CROSSED = "t_s,crossing_azimuth_deg,crossing_elevation_deg"
AXES = "t_s,q_w,q_x,q_y,q_z,axis_x,axis_y,axis_z"
RECORDS: dict[str, tuple[str, nutdamp.Spacecraft, str, dict[tuple[str, ...], Any]]] = {
    "rates in their units": (
        "t_s,omega_1_deg_s,omega_3_rad_s\n0,1.5,3\n0.1,,3.1\n0.3,-2,nan\n",
        BODY,
        "",
        {
            TIMES: [[0.0], [0.1], [0.3]],
            GYROS[:1]: np.radians([[1.5], [NAN], [-2.0]]),
            GYROS[2:]: [[3.0], [3.1], [NAN]],
        },
    ),
    "dates count from the epoch of the spacecraft file": (
        "utc,axis_ra_deg,axis_dec_deg\n"
        "2026-03-01T12:00:01Z,90,0\n2026-03-01T13:00:02.5+01:00,0,30\n",
        DATED,
        "",
        {TIMES: [[1.0], [2.5]], AXIS: [[0.0, 1.0, 0.0], TILTED]},
    ),
    "Sun pulses lie between the samples that first show them": (
        "t_s,sun_pulse\n0,0\n1,1\n2,1\n3,0\n3.5,1\n",
        BODY,
        "",
        {PULSES: [[0.5], [3.25]]},
    ),
    "Sun pulses of a file of their own": (
        "t_s,acceleration_m_s2\n0,0.1\n1,0.2\n",
        BODY,
        "t_s\n0.7\n2.8\n",
        {PULSES: [[0.7], [2.8]], (ACCELERATION,): [[0.1], [0.2]]},
    ),
    "a crossing is of the direction in its row or of the Sun": (
        f"{CROSSED},crossing_ra_deg,crossing_dec_deg\n0,90,0,0,-90\n1,0,30,,\n2,,,,\n",
        SUNNY,
        "",
        {
            SEEN: [[0.0, 1.0, 0.0], TILTED, [NAN] * 3],
            DIRECTION: [[0.0, 0.0, -1.0], SUN, SUN],
        },
    ),
    "a crossing of the Sun": (f"{CROSSED}\n0,90,0\n", SUNNY, "", {DIRECTION: [SUN]}),
    "quaternions give the axis and the turn in place of an axis": (
        f"{AXES}\n0,{HALF},{HALF},0,0,1,0,0\n1,,,,,1,0,0\n",
        BODY,
        "",
        {QUATERNION: [[HALF, HALF, 0, 0], [NAN] * 4], AXIS: [[0, -1, 0], [NAN] * 3]},
    ),
    "Sun aspect angles of their rows": (
        "t_s,sun_aspect_deg\n0,60\n2,\n",
        BODY,
        "",
        {(SUN_ASPECT,): [[math.pi / 3], [NAN]]},
    ),
    "Sun aspect angles of the pulses in a file": (
        "t_s,omega_1_rad_s\n0,0.1\n1,0.2\n2,0.3\n",
        BODY,
        "t_s,sun_aspect_deg\n0.5,90\n1,60\n",
        {
            TIMES: [[0.0], [0.5], [1.0], [2.0]],
            PULSES: [[0.5], [1.0]],
            (SUN_ASPECT,): [[NAN], [math.pi / 2], [math.pi / 3], [NAN]],
            GYROS[:1]: [[0.1], [NAN], [0.2], [0.3]],
        },
    ),
}
"""Text, spacecraft, text of the Sun pulses, and the columns that are read by their names."""


@pytest.mark.parametrize("name", RECORDS)
def test_a_record_is_read(read_record: ReadRecord, name: str) -> None:
    text, body, sun, expected = RECORDS[name]
    record, warnings = read_record(text, body, sun)
    columns = {"t": record.times, "sun pulses": record.sun_pulses, **record.signals}
    assert warnings == []
    for names, rows in expected.items():
        read = np.column_stack([columns[name] for name in names])
        assert_allclose(read, rows, atol=1e-15)


def test_faults_have_their_place_and_columns_not_known_are_said(
    read_record: ReadRecord, tmp_path: Path
) -> None:
    check_faults(
        "files.telemetry",
        read_record,
        (
            "omega_1_rad_s\n1\n",
            "t_s\n1\n",
            "t_s,omega_1\n1,2\n",
            "t_s,omega_1_rad_s,omega_1_deg_s\n1,2,3\n",
            "t_s,axis_x,axis_y\n1,1,0\n",
            "t_s,utc,omega_1_rad_s\n1,2,3\n",
            "t_s,axis_x,axis_y,axis_z\n0,1,0,0\n1,1,1,0\n",
            "t_s,axis_x,axis_y,axis_z\n0,0,0,0\n",
            "t_s,axis_ra_deg,axis_dec_deg\n0,1,100\n",
            "t_s,omega_1_rad_s\n0,1\n2,1\n1,1\n1,2\n",
            "t_s,omega_1_rad_s,pulse\n0,1,0\n0,2,1\n",
            "t_s,omega_1_rad_s\n0,fast\n",
            "t_s,omega_1_rad_s\n0,1,2\n",
            "t_s,sun_pulse\n0,0\n1,2\n",
            "t_s,q_w,q_x,q_y\n0,1,0,0\n",
            "t_s,q_w,q_x,q_y,q_z\n0,2,0,0,0\n",
            "t_s,crossing_azimuth_deg\n0,1\n",
            "t_s,crossing_ra_deg,crossing_dec_deg\n0,1,2\n",
            "t_s,crossing_azimuth_deg,crossing_elevation_deg,crossing_ra_deg,crossing_dec_deg\n"
            "0,400,0,1,1\n1,5,-91,1,1\n",
            "t_s,crossing_az_deg,sun_aspect,q_1\n0,5,1,1\n",
            "t_s,sun_aspect_deg\n0,181\n",
            "t_s;omega_1_rad_s\n0;1\n",
            "t_s,omega_1_rad_s\n",
            "utc,omega_1_rad_s\n2026-03-01T12:00:00Z,1\n",
        ),
    )
    for many in (1, 2):  # one more than is shown is shown too, of two more their number
        rows = "".join(f"{number},x\n" for number in range(tabular.MOST_FAULTS + many))
        shown = faults(read_record, f"t_s,omega_1_rad_s\n{rows}")
        assert len(shown) == tabular.MOST_FAULTS + 1
        assert ("such rows" in shown[-1]) == (many == 2)
    _, warnings = read_record("t_s,omega_1_rad_s,temperature\n0,1,20\n1,2,21\n")
    check_text("files.telemetry-column", "\n".join(warnings))
    with pytest.raises(CannotRead):
        read_telemetry(tmp_path / "none.csv", BODY)
