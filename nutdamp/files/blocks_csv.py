"""Command blocks as CSV: ``plan --blocks`` writes them, ``simulate --blocks`` fires them, edited or not."""

from __future__ import annotations

import math
from itertools import accumulate
from pathlib import Path

from nutdamp.commands import Block
from nutdamp.errors import nearest
from nutdamp.files.output import csv_text, number
from nutdamp.files.table import Cells, Table
from nutdamp.flight import Flight
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

MOST_FIRED = 100_000
"""Pulses that the blocks of a file may fire."""


def blocks_csv(flown: Flight) -> str:
    """The blocks of a flown schedule, one row each; what is not known is empty."""
    body, commands = flown.spacecraft, flown.spacecraft.commands
    _, after = flown.around_pulses()
    strengths = {channel.name: channel.strength for channel in body.channels}
    pulses, rows = flown.schedule.pulses, []
    lasts = list(accumulate(block.count for block in flown.schedule.blocks))
    for index, (block, last) in enumerate(zip(flown.schedule.blocks, lasts, strict=True), start=1):
        rows.append(
            [
                str(index),
                block.channel,
                str(block.first),
                body.utc(pulses[last - block.count].start) or "",
                number(block.delay),
                _counts(block.delay, None if commands is None else commands.delay_step),
                number(math.degrees(block.delay * abs(body.spin))),
                number(block.width),
                ""
                if commands is None or commands.width_step is None
                else str(round(block.width / commands.width_step)),
                str(block.count),
                str(block.every),
                number(block.count * block.width * strengths[block.channel]),
                number(math.degrees(float(after.nutation[last - 1]))),
            ]
        )
    return csv_text(HEADER, rows)


def _counts(time: float, step: float | None) -> str:
    return "" if step is None else str(round(time / step))


def read_blocks(path: str | Path, spacecraft: Spacecraft) -> tuple[tuple[Block, ...], list[str]]:
    """The blocks in a CSV file, and warnings: commands that the file of the spacecraft does not have.

    Needed are channel, first_sun_pulse, delay_s, width_s and count; every is 1 where it is left out. What else `HEADER`
    names is not looked at. Raises CannotRead, and FaultyFile with every fault of the file.
    """
    table = Table(path, HEADER, "blocks")
    table.expect("channel", "first_sun_pulse", "delay_s", "width_s", "count")
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
        table.fault(1, "count", f"the blocks fire more than {MOST_FIRED} pulses")
    table.check()
    return tuple(blocks), table.warned


def _block(table: Table, line: int, cells: Cells, spacecraft: Spacecraft) -> Block | None:
    """The block of one row; None where it has faults."""
    faults, channels = len(table.faults), [channel.name for channel in spacecraft.channels]
    name = cells["channel"]
    if name not in channels:
        close = nearest(name, channels)
        cure = f"did you mean {shown(close)}?" if close else f"it has {', '.join(map(shown, channels)) or 'none'}"
        table.fault(line, "channel", f"the spacecraft file has no channel {shown(name)}; {cure}")
    delay, width = (_time(table, line, cells, column) for column in ("delay_s", "width_s"))
    if width == 0.0:
        table.fault(line, "width_s", "0 s fires nothing; expected a time above 0")
    first, count = (_whole(table, line, cells, column) for column in ("first_sun_pulse", "count"))
    every = _whole(table, line, cells, "every") if cells.get("every") else 1
    if len(table.faults) > faults or None in (delay, width, first, count, every):
        return None
    return Block(name, first or 1, delay or 0.0, width or 0.0, count or 1, every or 1)


def _time(table: Table, line: int, cells: Cells, column: str) -> float | None:
    value = table.number(line, cells, column)
    if value is not None and value < 0.0:
        table.fault(line, column, f"{value:g} s is negative; expected a time of at least 0")
        return None
    return value


def _whole(table: Table, line: int, cells: Cells, column: str) -> int | None:
    value = table.number(line, cells, column)
    if value is not None and not (value.is_integer() and 1 <= value <= MOST_FIRED):
        table.fault(line, column, f"expected a whole number from 1 to {MOST_FIRED}, got {cells[column]}")
        return None
    return None if value is None else int(value)


def _against_commands(table: Table, line: int, cells: Cells, block: Block, spacecraft: Spacecraft) -> None:
    """Warn of what cannot be commanded: it is flown as given."""
    commands = spacecraft.commands
    if commands is None:
        return
    steps = block.delay / commands.delay_step
    off = {
        "delay_s": abs(steps - round(steps)) > COUNTS or block.delay > commands.delay_max * (1.0 + COUNTS),
        "width_s": bool(abs(commands.widths - block.width).min() > COUNTS * block.width),
        "count": block.count > commands.max_count,
        "every": block.every not in commands.every,
    }
    for name, time, step in (("delay", block.delay, commands.delay_step), ("width", block.width, commands.width_step)):
        given = cells.get(f"{name}_counts", "")
        if given and step is not None and given != _counts(time, step):
            text = f"{name}_counts = {given} contradicts {name}_s = {time:g}, which is {_counts(time, step)}: ignored"
            table.warn(line, f"{name}_counts", text)
    for column in (column for column, is_off in off.items() if is_off):
        table.warn(line, column, f"{column} is none of the commands of the spacecraft file: flown as given")
