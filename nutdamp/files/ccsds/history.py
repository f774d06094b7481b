"""Attitude ephemeris messages (AEM, version 2, in KVN) read: attitude and rates at many times.

Quaternions, with or without angular velocity, are read; the other forms of an ephemeris leave the rates open or hold
for symmetric bodies alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest, Fault, FaultyFile
from nutdamp.estimation.signals import GYROS, Record, of_quaternions
from nutdamp.files.ccsds.checked import (
    BEFORE,
    BODY,
    SAME_AXES,
    UNIT,
    Checked,
    Frames,
    expect_version,
    kvn_text,
    unit_length,
)
from nutdamp.files.ccsds.message import AEM_METADATA, QUATERNION_ANGVEL, VERSION, Keyword, MessageBlock, from_kvn
from nutdamp.files.yaml import read_bytes
from nutdamp.physics import attitude
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule

AEM_VERSION = "CCSDS_AEM_VERS"
"""Keyword of the first line."""

COLUMNS = {"QUATERNION": 4, QUATERNION_ANGVEL: 7}
"""Numbers in a record of each ATTITUDE_TYPE that is read, besides its time."""

_OPTIONAL = {"ANGVEL_FRAME", "INTERPOLATION_METHOD", "INTERPOLATION_DEGREE"}
_BEFORE = {"REF_FRAME_A": ("CENTER_NAME",), "STOP_TIME": ("USEABLE_START_TIME", "USEABLE_STOP_TIME")}
_METADATA = tuple(
    row
    for keyword in AEM_METADATA
    for row in (
        *(Keyword(name, required=False, text=True) for name in _BEFORE.get(keyword.name, ())),
        keyword._replace(required=keyword.name not in _OPTIONAL),
    )
)
"""Table 4-3, but for the keywords of Euler angles."""


@dataclass(frozen=True, slots=True)
class History:
    """Attitude of an object at ``times`` (n,) s after ``epoch``: ``quaternions`` (n, 4) body -> frame, scalar first.

    ``rates`` (n, 3) rad/s in body axes, or None where the message has none.
    """

    name: str
    epoch: Epoch
    frame: str | None
    times: Vector
    quaternions: Vector
    rates: Vector | None
    remarks: tuple[str, ...]

    def at(self, time: float) -> int:
        """Index of the first record from ``time`` s on; raises BadRequest past the last."""
        index = int(np.searchsorted(self.times, time))
        if index == len(self.times):
            raise BadRequest(f"the history ends {self.times[-1]:.6g} s after its first record: expected a time in it")
        return index


def is_history(path: str) -> bool:
    """True for a file that begins as an AEM does, not for standard input; raises CannotRead."""
    beginning = b"" if path == "-" else read_bytes(path, 200)
    return beginning.lstrip(BEFORE).startswith(AEM_VERSION.encode())


def read_history(path: str) -> History:
    """The history in a message; raises CannotRead, or FaultyFile with its faults."""
    text = kvn_text(path)
    lines, data = text.splitlines(), list[tuple[int, str]]()
    inside = False
    for number, line in enumerate(lines):
        word = line.strip()
        if word in ("DATA_START", "DATA_STOP"):
            inside = word == "DATA_START"
        elif inside and word and word.split(maxsplit=1)[0] != "COMMENT":
            data.append((number + 1, word))
            lines[number] = ""
    blocks, faults = from_kvn("\n".join(lines), path)
    expect_version(path, blocks[0], AEM_VERSION, VERSION, faults)
    reader = _HistoryReader(path, faults)
    segments = [block for block in blocks[1:] if block.name in ("META", "DATA")]
    ends = [block.line for block in segments[2::2]] + [len(lines) + 1]
    for metadata, records, end in zip(segments[::2], segments[1::2], ends, strict=False):
        if (metadata.name, records.name) != ("META", "DATA"):
            faults.append(Fault(path, metadata.line, 1, metadata.name, "expected META_START … META_STOP, then data"))
            break
        reader.take(metadata, [row for row in data if records.line < row[0] < end])
    if not segments or len(segments) % 2:
        faults.append(Fault(path, 1, 1, "DATA_START", "missing; each block of metadata is followed by data"))
    if not faults and not reader.times:
        faults.append(Fault(path, segments[0].line, 1, "DATA_START", "no records"))
    if faults:
        raise FaultyFile(faults)
    first = reader.times[0]
    rates = None if reader.rates is None else np.array(reader.rates)
    return History(
        reader.name,
        first,
        reader.frame,
        np.array([time.since(first) for time in reader.times]),
        np.array(reader.quaternions),
        rates,
        tuple(reader.remarks),
    )


class _HistoryReader(Frames):
    """Segments of one message; problems go to ``faults``."""

    def __init__(self, path: str, faults: list[Fault]) -> None:
        super().__init__()
        self.path, self.faults = path, faults
        self.name = "UNKNOWN"
        self.times: list[Epoch] = []
        self.quaternions: list[Vector] = []
        self.rates: list[Vector] | None = []

    def take(self, metadata: MessageBlock, rows: list[tuple[int, str]]) -> None:
        """Read a segment."""
        block = Checked(self.path, metadata, _METADATA, self.faults)
        self.name = block.text("OBJECT_NAME") or self.name
        self.take_system(block)
        forward, kind = self.endpoints(block), block.text("ATTITUDE_TYPE")
        if kind is not None and kind not in COLUMNS:
            block.fault("ATTITUDE_TYPE", f"{kind!r} is not read; expected {' or '.join(COLUMNS)}")
        axes = block.text("ANGVEL_FRAME")
        turning = kind == QUATERNION_ANGVEL
        if turning and axes is None:
            block.fault("ANGVEL_FRAME", f"missing; {QUATERNION_ANGVEL} needs the frame of the rates")
        in_body = axes is None or BODY.fullmatch(axes) is not None
        if turning and not in_body and SAME_AXES.get(axes or "", axes) != self.frame:
            block.fault("ANGVEL_FRAME", f"{axes!r} is neither REF_FRAME_A nor REF_FRAME_B")
        if self.faults or kind is None or forward is None:
            return
        if not turning:
            self.rates = None
        for line, row in rows:
            self._record(line, row.split(), COLUMNS[kind], forward=forward, in_body=in_body)

    def _record(self, line: int, cells: list[str], columns: int, *, forward: bool, in_body: bool) -> None:
        try:
            time, numbers = Epoch.parse(cells[0], self.system), [float(cell) for cell in cells[1:]]
            if len(numbers) != columns or not all(map(math.isfinite, numbers)):
                raise ValueError(f"expected a time and {columns} numbers")
            if not unit_length(numbers[:4], UNIT):
                raise ValueError(f"the quaternion has length {math.hypot(*numbers[:4]):.6g}; expected 1")
        except ValueError as wrong:
            self.faults.append(Fault(self.path, line, 1, "DATA", str(wrong)))
            return
        if self.times and time == self.times[-1]:  # a segment begins where the one before ends
            return
        if self.times and time < self.times[-1]:
            self.faults.append(Fault(self.path, line, 1, "DATA", "comes before the record above; put them in order"))
            return
        parts = np.array([numbers[3], *numbers[:3]]) / math.hypot(*numbers[:4])
        quaternion = parts if forward else attitude.conjugate(parts)
        self.times.append(time)
        self.quaternions.append(quaternion)
        if self.rates is not None:
            rates = np.radians(numbers[4:]) * (1.0 if forward else -1.0)
            self.rates.append(rates if in_body else np.asarray(attitude.matrix(quaternion).T @ rates))


def record_of(history: History, spacecraft: Spacecraft, schedule: Schedule) -> Record:
    """Telemetry of a history for the fit of a spacecraft: the attitude, and the rates if given.

    Times count from attitude.epoch of the file; raises BadRequest where it has none.
    """
    given = spacecraft.attitude
    if given is None or given.epoch is None:
        raise BadRequest("the spacecraft file has no attitude.epoch to count the times of a history from")
    if history.frame is not None and given.frame not in (None, history.frame):
        raise BadRequest(f"the history is in {history.frame}, the spacecraft file in {given.frame}: expected one frame")
    signals = of_quaternions(history.quaternions, spacecraft)
    if history.rates is not None:
        signals |= dict(zip(GYROS, history.rates.T, strict=True))
    times = history.times + history.epoch.since(Epoch.parse(given.epoch))
    return Record(times, signals, np.empty(0), 0.0, schedule)
