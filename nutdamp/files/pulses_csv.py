"""Schedules as CSV: written by ``plan``, read by ``simulate --schedule``."""

from __future__ import annotations

import csv
import io
import math
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Fault, FaultyFile
from nutdamp.files.input import read_utf8
from nutdamp.files.output import csv_text, number
from nutdamp.flight import Flight
from nutdamp.schedule import STEERABLE, Pulse, Schedule
from nutdamp.spacecraft import Channel, Spacecraft, Steerable, Vector
from nutdamp.units import shown

HEADER = (
    "pulse",
    "t_s",
    "start_s",
    "on_time_s",
    "channel",
    "torque_1_Nm",
    "torque_2_Nm",
    "torque_3_Nm",
    "impulse_1_Nms",
    "impulse_2_Nms",
    "impulse_3_Nms",
    "propellant_kg",
    "nutation_before_deg",
    "nutation_after_deg",
)
UTC = "utc"
IMPULSE = HEADER[8:11]
TORQUE = HEADER[5:8]

AGREES = 1e-6
"""Relative difference up to which columns of a schedule say the same."""

LARGEST = 1e15
"""Larger magnitudes are no schedule of a spacecraft, and would overflow later."""


def pulses_array(flown: Flight) -> NDArray[np.void]:
    """The schedule of a flown flight, one row a pulse, fields as in `HEADER`; vectors in the axes of the file.

    What is not known is NaN: the torque of an ideal impulse, a propellant. With an epoch, a last field ``utc`` has the
    date and time of each start.
    """
    before, after = flown.around_pulses()
    body = flown.spacecraft
    dated = body.utc(0.0) is not None
    rows = [
        (
            index + 1,
            *(pulse.t, pulse.start, pulse.on_time),
            pulse.channel,
            *(np.full(3, math.nan) if pulse.torque is None else body.inertia.in_file(pulse.torque)),
            *body.inertia.in_file(pulse.impulse),
            math.nan if pulse.propellant is None else pulse.propellant,
            math.degrees(before.nutation[index]),
            math.degrees(after.nutation[index]),
            *([body.utc(pulse.start) or ""] if dated else []),
        )
        for index, pulse in enumerate(flown.schedule)
    ]
    longest = max((len(pulse.channel) for pulse in flown.schedule), default=1)
    kinds = {"pulse": "i8", "channel": f"U{longest}", UTC: "U30"}
    return np.array(rows, dtype=[(name, kinds.get(name, "f8")) for name in (*HEADER, UTC)[: None if dated else -1]])


def pulses_csv(flown: Flight) -> str:
    """The rows of `pulses_array` as CSV; what is not known is empty."""
    table = pulses_array(flown)
    texts = ([number(cell) if isinstance(cell, float) else str(cell) for cell in row] for row in table.tolist())
    return csv_text(table.dtype.names or HEADER, texts)


def read_pulses(path: str | Path, spacecraft: Spacecraft) -> tuple[Schedule, list[str]]:
    """A schedule from a CSV file, and warnings where other columns contradict t_s, impulse and on_time_s.

    Raises CannotRead, and FaultyFile with every fault of the file.
    """
    name = str(path)
    reader = csv.reader(io.StringIO(read_utf8(name), newline=""))
    try:
        rows = [(reader.line_num, row) for row in reader if row]
    except csv.Error as reason:
        raise FaultyFile([Fault(name, reader.line_num, 1, "", f"not CSV: {reason}")]) from reason
    if not rows:
        raise FaultyFile([Fault(name, 1, 1, "", f"empty; the first line names the columns: {','.join(HEADER)}")])
    return _Reader(name, spacecraft, [entry.strip() for entry in rows[0][1]]).read(rows[1:])


class _Reader:
    """Rows of one file into pulses, collecting faults and warnings."""

    def __init__(self, name: str, spacecraft: Spacecraft, header: list[str]) -> None:
        self.name, self.spacecraft, self.header = name, spacecraft, header
        self.channels = {channel.name: channel for channel in spacecraft.channels}
        self.faults: list[Fault] = []
        self.warnings: list[str] = []

    def read(self, rows: list[tuple[int, list[str]]]) -> tuple[Schedule, list[str]]:
        if len(self.header) == 1 and re.search(r"[;\t]", self.header[0]):
            raise FaultyFile([Fault(self.name, 1, 1, "", "columns are separated by commas, not by semicolons or tabs")])
        for column in ("t_s", "on_time_s", *IMPULSE):
            if column not in self.header:
                self._fault(1, column, "the column is missing")
        for column in {entry for entry in self.header if self.header.count(entry) > 1}:
            self._fault(1, column, "the column stands twice")
        if self.faults:
            raise FaultyFile(self.faults)
        pulses = [pulse for line, row in rows if (pulse := self._pulse(line, row)) is not None]
        self._overlaps(pulses)
        if self.faults:
            raise FaultyFile(self.faults)
        return Schedule(tuple(pulse for _, pulse in pulses)), self.warnings

    def _fault(self, line: int, where: str, problem: str) -> None:
        self.faults.append(Fault(self.name, line, 1, where, problem))

    def _pulse(self, line: int, row: list[str]) -> tuple[int, Pulse] | None:
        if len(row) != len(self.header):
            self._fault(line, "", f"{len(row)} values under {len(self.header)} columns")
            return None
        cells = dict(zip(self.header, (entry.strip() for entry in row), strict=True))
        t, on_time = self._number(line, cells, "t_s"), self._number(line, cells, "on_time_s")
        impulse = [self._number(line, cells, column) for column in IMPULSE]
        if t is None or on_time is None or any(part is None for part in impulse):
            return None
        if on_time < 0.0:
            self._fault(line, "on_time_s", f"{on_time:g} s is negative; an ideal impulse has 0")
            return None
        if t - 0.5 * on_time < -1e-9:
            self._fault(line, "t_s", f"the pulse would start at {t - 0.5 * on_time:g} s, before t = 0")
            return None
        t = max(t, 0.5 * on_time)
        given = self.spacecraft.inertia.axes.T @ np.array(impulse, dtype=float)
        torque = None if on_time == 0.0 else given / on_time
        name = cells.get("channel", "") or STEERABLE
        if not name.isprintable():
            self._fault(line, "channel", f"{shown(name)} is no name of a channel; printable characters are expected")
            return None
        self._compare(line, cells, t, on_time, torque)
        force, propellant = self._means(line, name, torque, on_time, given)
        return line, Pulse(t, on_time, name, given, torque, force, propellant)

    def _number(self, line: int, cells: dict[str, str], column: str) -> float | None:
        text = cells[column]
        try:
            value = float(text)
        except ValueError:
            self._fault(line, column, f"{text!r} is not a number")
            return None
        if not abs(value) <= LARGEST:
            self._fault(line, column, f"{text} is not a finite number of sensible size")
            return None
        return value

    def _means(
        self, line: int, name: str, torque: Vector | None, on_time: float, impulse: Vector
    ) -> tuple[Vector | None, float | None]:
        """Net force and propellant of the channel that fires."""
        channel: Channel | None = self.channels.get(name)
        if channel is None:
            torquer: Steerable | None = self.spacecraft.torquer
            if name != STEERABLE or torquer is None:
                known = ", ".join(self.channels) or STEERABLE
                self._warn(line, f"channel {name!r} is not in the spacecraft file ({known}); its propellant is unknown")
                return None, None
            rate = torquer.propellant_per_impulse
            return None, None if rate is None else rate * float(np.linalg.norm(impulse))
        if torque is None:
            self._warn(line, f"{name} has an on-time of 0: flown as an ideal impulse, its propellant is unknown")
            return None, None
        if np.linalg.norm(torque - channel.torque) > AGREES * np.linalg.norm(channel.torque):
            self._warn(line, f"impulse and on-time give {name} another torque than the file; flown as given here")
            scale = float(np.linalg.norm(torque) / np.linalg.norm(channel.torque))
            force = None if channel.force is None else channel.force * scale
            return force, None if channel.mass_flow is None else channel.mass_flow * on_time * scale
        flow = channel.mass_flow
        return channel.force, None if flow is None else flow * on_time

    def _compare(self, line: int, cells: dict[str, str], t: float, on_time: float, torque: Vector | None) -> None:
        """Warn where start_s or the torque columns say something else."""
        start = self._optional(cells, "start_s")
        if start is not None and abs(start - (t - 0.5 * on_time)) > AGREES * max(abs(t), on_time):
            self._warn(line, f"start_s = {start:g} contradicts t_s - on_time_s/2 = {t - 0.5 * on_time:g}; t_s counts")
        given = [self._optional(cells, column) for column in TORQUE]
        if torque is None or any(part is None for part in given):
            return
        expected = self.spacecraft.inertia.axes @ torque
        if np.linalg.norm(np.array(given, dtype=float) - expected) > AGREES * np.linalg.norm(expected):
            self._warn(line, "torque columns contradict impulse / on_time_s; impulse and on-time count")

    def _optional(self, cells: dict[str, str], column: str) -> float | None:
        try:
            value = float(cells.get(column, ""))
        except ValueError:
            return None
        return value if math.isfinite(value) else None

    def _warn(self, line: int, text: str) -> None:
        self.warnings.append(f"{self.name}:{line}: {text}")

    def _overlaps(self, pulses: list[tuple[int, Pulse]]) -> None:
        """Pulses of one channel never overlap."""
        last: dict[str, tuple[int, Pulse]] = {}
        for line, pulse in sorted(pulses, key=lambda entry: entry[1].start):
            if pulse.channel in last and pulse.start < last[pulse.channel][1].end - 1e-9:
                other = last[pulse.channel][0]
                self._fault(line, "t_s", f"{pulse.channel} is still firing the pulse of line {other}")
            last[pulse.channel] = (line, pulse)
