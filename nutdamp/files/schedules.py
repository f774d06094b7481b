"""Schedules and command blocks as CSV, written and read.

Three columns are enough, and rule: start_s (or t_s, the centre), on_time_s and channel. Torque and
impulse columns are read for pulses of the steerable torquer, ideal ones, and those of channels that
the spacecraft file does not know.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from nutdamp.errors import cure_of, printable
from nutdamp.files.tabular import CellFault, Row, Table
from nutdamp.flight.dynamics import Supply
from nutdamp.planning.causes import broken_limits
from nutdamp.planning.plan import Plan
from nutdamp.schemes.block_model import fired
from nutdamp.schemes.catalogue import SchemeOptions
from nutdamp.spacecraft.constraints import misfits
from nutdamp.spacecraft.equipment import ANGLE, Block, Channel, firings
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import (
    STEERABLE,
    TOUCHING,
    Pulse,
    Schedule,
    channel_pulse,
    on_command,
    overlapping,
)
from nutdamp.units import shown

TORQUE = ("torque_1_Nm", "torque_2_Nm", "torque_3_Nm")
IMPULSE = ("impulse_1_Nms", "impulse_2_Nms", "impulse_3_Nms")
PULSES_HEADER = (
    *("pulse", "t_s", "start_s", "on_time_s", "channel"),
    *TORQUE,
    *IMPULSE,
    *("propellant_kg", "nutation_before_deg", "nutation_after_deg"),
)
EFFECTIVE = ("effective_start_s", "effective_on_time_s")  # behind those, with valves

UTC = "utc"
SCHEDULE_HEADER = (*PULSES_HEADER, *EFFECTIVE, UTC)

BLOCKS_HEADER = (
    *("block", "channel", "first_sun_pulse", "first_utc"),
    *("delay_s", "delay_counts", "delay_deg"),
    *("width_s", "width_counts", "count", "every"),
    *("impulse_Nms", "nutation_after_deg"),
)

# pulses that the blocks of a file may fire: many more than any campaign, and flown within seconds
MOST_FIRED = 5_000
HIGHEST = {"first_sun_pulse": 100_000, "count": MOST_FIRED, "every": 100_000}
"""Columns of whole numbers from 1 on, and the highest of each."""


def read_blocks(
    path: str | Path | Table, spacecraft: Spacecraft
) -> tuple[tuple[Block, ...], list[str]]:
    """The blocks in a CSV file, and warnings: commands that the file of the spacecraft does not
    have.

    Of the columns of a delay or width the first that there is counts: delay_s, delay_counts,
    delay_deg, the last one first where the delays of the spacecraft file are angles. Counts need
    the steps of that file; every is 1 where it is left out. Raises CannotRead, and FaultyFile with
    every fault of the file.
    """
    table = path if isinstance(path, Table) else Table(path, BLOCKS_HEADER, "blocks")
    commands = spacecraft.commands
    columns = {}
    for name in TIMES:
        choice = [f"{name}_s", f"{name}_counts", *["delay_deg"] * (name == "delay")]
        if commands is not None and commands.delay_is == ANGLE:
            choice.sort(key=lambda column: column != "delay_deg")
        columns[name] = next((each for each in choice if each in table.header), f"{name}_s")
        if columns[name].endswith("_counts") and commands is None:
            table.fault(
                1,
                columns[name],
                f"the spacecraft file has no commands, which give the steps of {name}; expected "
                f"the column {name}_s",
            )
    table.expect("channel", "first_sun_pulse", *columns.values(), "count")
    pairs = table.read(lambda row: _block(row, spacecraft, columns))
    rows, read = [row for row, _ in pairs], tuple(block for _, block in pairs)
    for index, column, value, possible in misfits(spacecraft, read):
        rows[index].warn(
            column, f"{column} = {value} cannot be commanded, {possible}: flown as given"
        )
    total = sum(block.count for block in read)
    if total > MOST_FIRED:
        table.fault(1, "count", f"the blocks fire {total} pulses; expected at most {MOST_FIRED}")
    table.check()
    _expect_apart(rows, read, columns["delay"])
    table.check()
    return read, table.warned


TIMES = ("delay", "width")


def _expect_apart(rows: Sequence[Row], blocks: Sequence[Block], column: str) -> None:
    """Keep a fault in ``column`` of each block with a pulse that begins before another of the same
    Sun pulse is over; angles apart are times apart once they are flown.
    """
    overlaps = {
        after.at: (before, after)
        for before, after in reversed([*pairwise(firings(blocks))])
        if before.number == after.number
        and before.block.angle == after.block.angle
        and after.block.delay < before.block.delay + before.block.width - TOUCHING
    }
    for at, (before, after) in overlaps.items():
        line, over = rows[before.at].line, before.block.delay + before.block.width
        rows[at].fault(
            column,
            f"Sun pulse {after.number} fires it while the pulse of line {line} is on; expected "
            f"{over:.6g} s or more after the Sun pulse, or other Sun pulses",
        )


def _block(row: Row, spacecraft: Spacecraft, columns: Mapping[str, str]) -> Block:
    """The block of a row, with the ``columns`` of its times."""
    channels = [channel.name for channel in spacecraft.channels]
    name = row["channel"]
    if name not in channels:
        row.fault(
            "channel",
            f"the spacecraft file has no channel {shown(name)}; {cure_of(name, channels)}",
        )
    commands = spacecraft.commands
    row.setdefault("every", "1")
    numbers = dict.fromkeys((*TIMES, *HIGHEST), 1.0)
    for key, column in (*columns.items(), *((column, column) for column in HIGHEST)):
        value = row.number(column)
        if value is None:
            continue
        numbers[key] = value
        counted = column.endswith("_counts")
        if column in HIGHEST:
            if not (value.is_integer() and 1 <= value <= HIGHEST[column]):
                expected = f"a whole number from 1 to {HIGHEST[column]}"
                row.fault(column, f"expected {expected}, got {row[column]}")
        elif value < 0.0:
            row.fault(column, f"{row[column]} is negative; expected at least 0")
        elif counted and not value.is_integer():
            row.fault(column, f"expected a whole number of steps, got {row[column]}")
        elif counted and commands is not None:
            time = commands.time(key, value)
            if time is None:
                entries = f"the number of an entry of commands.width, 1 to {len(commands.widths)}"
                row.fault(column, f"expected {entries}, got {row[column]}")
            numbers[key] = 1.0 if time is None else time
        if key == "width" and numbers[key] == 0.0:
            row.fault(column, "0 s fires nothing; expected a time above 0")
    delay, width, first, count, every = numbers.values()
    angle = 0.0
    if columns["delay"] == "delay_deg":
        angle, delay = math.radians(delay), 0.0
    elif columns["delay"] == "delay_counts" and commands and commands.delay_is == ANGLE:
        angle, delay = abs(spacecraft.spin) * delay, 0.0
    return Block(name, int(first), delay, width, int(count), int(every), angle)


STARTS = ("start_s", "t_s")

AGREES = 1e-6  # relative difference up to which a torque is that of the torquer

CONTRADICTS = 1e-3
"""Share of torque, impulse or on-time by which a column must differ from what follows from start,
on-time and channel to be named: files by hand have four digits.
"""


def read_pulses(path: str | Path | Table, spacecraft: Spacecraft) -> tuple[Schedule, list[str]]:
    """A schedule from a CSV file, and warnings; raises CannotRead, and FaultyFile with every fault
    of the file.
    """
    table = path if isinstance(path, Table) else Table(path, SCHEDULE_HEADER, "pulses")
    if not {*STARTS} & {*table.header}:
        table.fault(
            1,
            STARTS[0],
            f"the column is missing (or {STARTS[1]}, the centre)" + table.misspelt(STARTS[0]),
        )
    # With torques or impulses a pulse without channel is one of the torquer.
    steered = {*TORQUE, *IMPULSE} & {*table.header}
    table.expect("on_time_s", *(() if steered else ("channel",)))
    channels = {channel.name: channel for channel in spacecraft.channels}
    pulses = table.read(lambda row: _pulse(row, spacecraft, channels))
    for line, other in overlapping([(row.line, pulse) for row, pulse in pulses]):
        table.fault(line, STARTS[0], f"its channel is still firing the pulse of line {other}")
    table.check()
    supply = Supply(spacecraft)
    if not supply.steady:  # pulses have the strength of their place in the sequence
        pulses.sort(key=lambda row: row[1].loaded[0])
    supplied = tuple(supply.fire(pulse, channels.get(pulse.channel)) for _, pulse in pulses)
    if supply.shortage is not None:
        table.rows[-1].warn("tank", f"{supply.shortage}: the last pulses do not fire")
    for (row, _), pulse in zip(pulses, supplied, strict=True):
        if pulse.channel in channels and pulse.torque is not None:
            _warn_of_contradictions(row, pulse, spacecraft.inertia.axes)
    return Schedule(supplied), table.warned


def _warn_of_contradictions(row: Row, pulse: Pulse, axes: Vector) -> None:
    """Name the columns of a row that say something else than its start, on-time and channel."""
    assert pulse.torque is not None
    follows = [("t_s", pulse.t, pulse.on_time)] if row.get("start_s") else []
    for columns, vector in ((TORQUE, axes @ pulse.torque), (IMPULSE, axes @ pulse.impulse)):
        size = math.hypot(*vector)
        follows += [(column, value, size) for column, value in zip(columns, vector, strict=True)]
    for column, value, size in follows:
        stated = row.number(column) if row.get(column) else None
        if stated is not None and abs(stated - value) > CONTRADICTS * size:
            rule = "start, on-time and channel rule"
            row.warn(column, f"{column} {row[column]} is ignored, {value:.6g} follows: {rule}")
            if column in TORQUE:
                return  # another torque has another impulse too


def read_plan(
    path: str | Path,
    spacecraft: Spacecraft,
    options: SchemeOptions | None = None,
    *,
    blocks: bool = False,
) -> tuple[Plan, tuple[str, ...]]:
    """A schedule file, of pulses, or of blocks where its columns or ``blocks`` say so, as a plan of
    that name, and warnings, of broken limits too; raises as `read_pulses` does, and Infeasible
    without Sun pulses.
    """
    columns = BLOCKS_HEADER if blocks else SCHEDULE_HEADER
    table = Table(path, columns, "blocks" if blocks else "pulses")
    if blocks or "first_sun_pulse" in table.header:
        table.columns = BLOCKS_HEADER
        commanded, warnings = read_blocks(table, spacecraft)
        pulses = fired(spacecraft, commanded)
    else:
        pulses, warnings = read_pulses(table, spacecraft)
    plan = Plan(
        spacecraft,
        printable(str(path)),
        pulses,
        options=options or SchemeOptions(),
        _from_file=True,
    )
    return plan, (*warnings, *broken_limits(spacecraft, pulses))


Channels = Mapping[str, Channel]


def _pulse(row: Row, spacecraft: Spacecraft, channels: Channels) -> Pulse | None:
    """The pulse of a row, with a full tank; None for numbers that are none. Raises CellFault.

    Starts and on-times are those of commands; the centre is that of the thrust, behind a valve too.
    """
    name = row.get("channel") or STEERABLE
    if not name.isprintable():
        raise CellFault(
            "channel", f"{shown(name)} is no name of a channel; printable characters are expected"
        )
    channel = channels.get(name)
    column = next((column for column in STARTS if row.get(column)), None)
    if column is None:
        raise CellFault(STARTS[0], "the time is missing")
    time, on_time = row.number(column), row.number("on_time_s")
    if time is None or on_time is None:
        return None
    if on_time < 0.0:
        raise CellFault(
            "on_time_s",
            f"{on_time:g} s is negative; 0 s or more is expected (0 for an ideal impulse)",
        )
    centre = 0.5 * on_time
    valve = None if channel is None or on_time == 0.0 else channel.valve
    if valve is not None:
        shortest, longest = valve.known
        if not shortest <= on_time <= longest:
            row.fault(
                "on_time_s",
                f"{on_time:g} s is outside the impulse_bit of {shown(name)}, {shortest:g} "
                f"s to {longest:g} s",
            )
        thrust = valve.thrust(on_time)
        if not thrust.ramps:
            row.warn(
                f"closed {name}",
                f"{on_time:g} s is too short for the valve of {shown(name)}: it does not open",
            )
        centre = thrust.centroid
    late = column != STARTS[0]
    start = time - centre if late else time
    if start < -1e-9:  # s; an earlier start is no rounding of 0
        raise CellFault(column, f"the pulse would start at {start:g} s; 0 s or later is expected")
    t = max(time, centre) if late else max(start, 0.0) + centre
    if not Pulse(t, on_time, "", np.zeros(3)).resolved:
        raise CellFault(
            "on_time_s",
            f"{on_time:g} s is too short at {t:g} s, where times are "
            f"{math.ulp(t + 0.5 * on_time):.2g} s apart",
        )
    if channel is not None and on_time > 0.0:
        if valve is None:
            return channel_pulse(channel, t, on_time)
        return on_command(channel, t - centre if late else max(start, 0.0), on_time)
    torque = _numbers(row, TORQUE) if on_time > 0.0 else None
    impulse = _numbers(row, IMPULSE) if torque is None else torque * on_time
    if impulse is None:
        raise CellFault("on_time_s" if channel else "channel", _missing(name, channels, on_time))
    principal = spacecraft.inertia.axes.T @ impulse
    push = None if on_time == 0.0 else principal / on_time
    propellant = None
    torquer = spacecraft.torquer
    if channel is not None:
        row.warn(
            f"ideal {name}",
            f"{shown(name)} has an on-time of 0: it is flown as an ideal impulse, with unknown "
            "propellant",
        )
    elif name != STEERABLE or torquer is None:
        names = ", ".join(map(shown, channels)) or STEERABLE
        row.warn(
            f"unknown {name}",
            f"channel {shown(name)} is not in the spacecraft file ({names}): flown as given, "
            "propellant unknown",
        )
    else:
        size = float(np.linalg.norm(principal))
        rated = None if torquer.torque is None else torquer.torque * on_time
        if rated and abs(size - rated) > AGREES * rated:
            row.warn(
                "steerable torque",
                f"{size / on_time:g} N m is not the torque of the steerable torquer, "
                f"{torquer.torque:g} N m: flown as given",
            )
        rate = torquer.propellant_per_impulse
        propellant = None if rate is None else rate * size
    return Pulse(t, on_time, name, principal, push, None, propellant)


def _missing(name: str, channels: Channels, on_time: float) -> str:
    """Columns missing in a row whose torque or impulse does not follow from the spacecraft file."""
    impulse, torque = (f"{columns[0]} to {columns[-1]}" for columns in (IMPULSE, TORQUE))
    columns = impulse if on_time == 0.0 else f"{torque} (or {impulse})"
    if name in channels:
        return (
            f"with an on-time of 0 {shown(name)} fires nothing, unless {columns} give an ideal "
            "impulse"
        )
    if name == STEERABLE:
        return f"a steered pulse needs {columns}"
    return f"{shown(name)}, not in the spacecraft file ({cure_of(name, channels)}), needs {columns}"


def _numbers(row: Row, columns: Sequence[str]) -> Vector | None:
    """Three numbers; None where none is given, or one is a fault."""
    if not any(row.get(column) for column in columns):
        return None
    numbers = [row.number(column) for column in columns]
    return None if None in numbers else np.array(numbers, dtype=float)
