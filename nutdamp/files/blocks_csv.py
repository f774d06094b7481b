"""Command blocks as CSV: ``plan --blocks`` writes them, ``simulate --blocks`` fires them, edited or not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path

import numpy as np

from nutdamp.commands import Block
from nutdamp.epoch import Epoch
from nutdamp.errors import nearest
from nutdamp.files.output import csv_text, number
from nutdamp.files.table import Cells, Table
from nutdamp.flight import Flight
from nutdamp.schemes.tools.sun_pulses import fired, spin_turn
from nutdamp.spacecraft import Spacecraft
from nutdamp.units import shown

HEADER = (
    "block",
    "channel",
    "first_sun_pulse",
    "first_utc",
    "delay_s",
    "delay_counts",
    "delay_deg",
    "width_s",
    "width_counts",
    "count",
    "every",
    "impulse_Nms",
    "nutation_after_deg",
)

COUNTS = 1e-6
"""Share of a step by which a time may be off the commands that there are: the rounding of files."""

MOST_FIRED = 5_000
"""Pulses that the blocks of a file may fire: many more than any campaign, and flown within seconds."""

LATEST = 100_000
"""Number of the last Sun pulse that may fire a block."""


def blocks_csv(flown: Flight) -> str:
    """The blocks of a flown schedule, one row each; what is not known is empty."""
    body, commands = flown.spacecraft, flown.spacecraft.commands
    _, after = flown.around_pulses()
    pulses, rows = flown.schedule.pulses, []
    lasts = list(accumulate(block.count for block in flown.schedule.blocks))
    for index, (block, last) in enumerate(zip(flown.schedule.blocks, lasts, strict=True), start=1):
        rows.append(
            [
                str(index),
                block.channel,
                str(block.first),
                body.utc(pulses[last - block.count].loaded[0]) or "",
                number(block.delay),
                "" if commands is None else str(commands.delay_counts(block.delay)),
                _shown(math.degrees(block.delay * abs(body.spin))),
                number(block.width),
                "" if commands is None else str(commands.width_counts(block.width)),
                str(block.count),
                str(block.every),
                _shown(math.fsum(pulse.magnitude for pulse in pulses[last - block.count : last])),
                number(math.degrees(float(after.nutation[last - 1]))),
            ]
        )
    return csv_text(HEADER, rows)


def _shown(value: float) -> str:
    """A number for people, without the noise of its last digits."""
    return number(float(f"{value:.9g}"))


def read_blocks(path: str | Path, spacecraft: Spacecraft) -> tuple[tuple[Block, ...], list[str]]:
    """The blocks in a CSV file, and warnings: commands that the file of the spacecraft does not have.

    Needed are channel, first_sun_pulse, count, delay_s and width_s; delay_counts and width_counts do for the last two
    where the spacecraft file has the steps. every is 1 where it is left out. A first_utc must be that of a first
    pulse. Raises CannotRead, and FaultyFile with every fault of the file.
    """
    table = Table(path, HEADER, "blocks")
    times = [f"{name}_counts" if _counted(table, spacecraft, name) else f"{name}_s" for name in TIMES]
    table.expect("channel", "first_sun_pulse", *times, "count")
    blocks: list[Block] = []
    for line, row in table.rows:
        cells = table.cells(line, row)
        block = None if cells is None else _block(table, line, cells, spacecraft)
        if cells is None or block is None:
            continue
        before = blocks[-1] if blocks else None
        over = 0 if before is None else before.first + (before.count - 1) * before.every
        if block.first <= over:
            problem = f"Sun pulse {block.first} comes before the block before is over; expected {over + 1} or later"
            table.fault(line, "first_sun_pulse", problem)
        _against_commands(table, line, cells, block, spacecraft)
        blocks.append(block)
    if sum(block.count for block in blocks) > MOST_FIRED:
        fired = sum(block.count for block in blocks)
        table.fault(1, "count", f"the blocks fire {fired} pulses; expected at most {MOST_FIRED}")
    table.check()
    _expect_utc(table, spacecraft, blocks)
    return tuple(blocks), table.warned


def _expect_utc(table: Table, spacecraft: Spacecraft, blocks: Sequence[Block]) -> None:
    """Faults of a first_utc that is no time, or more than a spin turn from when the first pulse of its block begins.

    So much may a delay be edited by. Without an epoch only its form is looked at.
    """
    given = [(line, row[table.header.index("first_utc")]) for line, row in table.rows if "first_utc" in table.header]
    parsed: dict[int, Epoch] = {}
    for line, text in given:
        try:
            if text.strip():
                parsed[line] = Epoch.parse(text.strip())
        except ValueError:
            table.fault(line, "first_utc", f"{shown(text)} is no date and time; expected 2026-03-01T12:00:00Z")
    table.check()
    place = spacecraft.attitude
    if not parsed or place is None or place.epoch is None:
        return
    pulses, epoch, number = fired(spacecraft, blocks).pulses, Epoch.parse(place.epoch), 0
    for (line, _), block in zip(given, blocks, strict=True):
        begins = pulses[number].loaded[0]
        number += block.count
        if line in parsed and abs(parsed[line].since(epoch) - begins) > spin_turn(spacecraft):
            cure = "correct first_sun_pulse, or leave first_utc empty"
            table.fault(line, "first_utc", f"its first pulse begins at {spacecraft.utc(begins)}; {cure}")
    table.check()


TIMES = ("delay", "width")


def _counted(table: Table, spacecraft: Spacecraft, name: str) -> bool:
    """Whether delay or width of the blocks is given by counts alone, of the commands that the spacecraft file has."""
    alone = f"{name}_s" not in table.header and f"{name}_counts" in table.header
    if alone and spacecraft.commands is None:
        problem = f"the spacecraft file has no commands to count the {name} in; expected the column {name}_s"
        table.fault(1, f"{name}_counts", problem)
    return alone


def _block(table: Table, line: int, cells: Cells, spacecraft: Spacecraft) -> Block | None:
    """The block of one row; None where it has faults."""
    faults, channels = len(table.faults), [channel.name for channel in spacecraft.channels]
    name = cells["channel"]
    if name not in channels:
        close = nearest(name, channels)
        cure = f"did you mean {shown(close)}?" if close else f"it has {', '.join(map(shown, channels)) or 'none'}"
        table.fault(line, "channel", f"the spacecraft file has no channel {shown(name)}; {cure}")
    delay, width = (_time(table, line, cells, spacecraft, name) for name in TIMES)
    if width == 0.0:
        column = "width_s" if "width_s" in cells else "width_counts"
        table.fault(line, column, "0 s fires nothing; expected a time above 0")
    first, count = (_whole(table, line, cells, *one) for one in (("first_sun_pulse", LATEST), ("count", MOST_FIRED)))
    every = _whole(table, line, cells, "every", LATEST) if cells.get("every") else 1
    if len(table.faults) > faults or None in (delay, width, first, count, every):
        return None
    return Block(name, first or 1, delay or 0.0, width or 0.0, count or 1, every or 1)


def _time(table: Table, line: int, cells: Cells, spacecraft: Spacecraft, name: str) -> float | None:
    """A delay or width, s: as it is given, or so many steps."""
    column = f"{name}_s" if f"{name}_s" in cells else f"{name}_counts"
    value = table.number(line, cells, column)
    if value is None:
        return None
    if value < 0.0:
        unit = " s" if column.endswith("_s") else ""
        table.fault(
            line, column, f"{value:g}{unit} is negative; expected {'a time' if unit else 'a number'} of at least 0"
        )
        return None
    if column.endswith("_s"):
        return value
    if not value.is_integer():
        table.fault(line, column, f"expected a whole number of steps, got {cells[column]}")
        return None
    commands = spacecraft.commands
    if commands is None:
        return 0.0
    time = commands.delay_of(value) if name == "delay" else commands.width_of(value)
    if time is None:
        table.fault(
            line,
            column,
            f"expected the number of an entry of commands.width, 1 to {len(commands.widths)}, got {cells[column]}",
        )
    return time


def _whole(table: Table, line: int, cells: Cells, column: str, most: int) -> int | None:
    value = table.number(line, cells, column)
    if value is not None and not (value.is_integer() and 1 <= value <= most):
        table.fault(line, column, f"expected a whole number from 1 to {most}, got {cells[column]}")
        return None
    return None if value is None else int(value)


def _against_commands(table: Table, line: int, cells: Cells, block: Block, spacecraft: Spacecraft) -> None:
    """Warn of what cannot be commanded: it is flown as given."""
    commands = spacecraft.commands
    if commands is None:
        return
    longest = math.floor(commands.delay_max / commands.delay_step * (1.0 + COUNTS)) * commands.delay_step
    nearest_delay = min(round(block.delay / commands.delay_step) * commands.delay_step, longest)
    nearest_width = float(commands.widths[np.abs(commands.widths - block.width).argmin()])
    allowed = ", ".join(map(str, commands.every))
    off = {
        "delay_s": (block.delay, nearest_delay, COUNTS * commands.delay_step),
        "width_s": (block.width, nearest_width, COUNTS * block.width),
    }
    for column, (given, near, slack) in off.items():
        if abs(given - near) > slack:
            text = f"{column} = {given:.6g} s cannot be commanded, {near:.6g} s is the nearest: flown as given"
            table.warn(line, column, text)
    if block.count > commands.max_count:
        text = f"count = {block.count} cannot be commanded, {commands.max_count} is the most: flown as given"
        table.warn(line, "count", text)
    if block.every not in commands.every:
        table.warn(line, "every", f"every = {block.every} cannot be commanded, only {allowed}: flown as given")
    counted = (commands.delay_counts(block.delay), commands.width_counts(block.width))
    for name, time, right in zip(TIMES, (block.delay, block.width), counted, strict=True):
        counts = cells.get(f"{name}_counts", "")
        if counts and f"{name}_s" in cells and counts != str(right):
            text = f"{name}_counts = {counts} contradicts {name}_s = {time:g}, which is {right}: ignored"
            table.warn(line, f"{name}_counts", text)
