"""Attitude ephemeris messages (AEM, version 2, in KVN) read, and messages merged into a spacecraft file.

Quaternions, with or without angular velocity, are read; the other forms of an ephemeris leave the rates open or hold
for symmetric bodies alone. A merge sets attitude, epoch and rates, and the inertia where that is asked for; all else of
the file stays, with its comments and units.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest, Fault, FaultyFile
from nutdamp.estimation.parameters import GYROS, Record, of_quaternions
from nutdamp.files.ccsds.message import (
    AEM_METADATA,
    BEFORE,
    BODY,
    QUATERNION_ANGVEL,
    SAME_AXES,
    UNIT,
    VERSION,
    Checked,
    Frames,
    Keyword,
    MessageBlock,
    expect_version,
    from_kvn,
    kvn_text,
    unit_length,
)
from nutdamp.files.ccsds.read import ApmContents
from nutdamp.files.editing import Edits, Later, attitude_edits, carry_text, epoch_after, inertia_edits, rate_edits
from nutdamp.files.reader import Source
from nutdamp.files.yaml import Node, read_bytes
from nutdamp.physics import attitude
from nutdamp.physics.body import principal_axes
from nutdamp.spacecraft.model import Attitude, Inertia, Spacecraft, SpinState, Vector
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


class MessageMotion(NamedTuple):
    """Motion at an ``epoch`` in body axes: ``quaternion`` (4,) body -> frame, ``rates`` (3,) rad/s, ``tensor`` (3, 3).

    None for what the message does not give.
    """

    epoch: Epoch
    frame: str | None
    quaternion: Vector | None
    rates: Vector | None
    tensor: Vector | None


def motion_of(message: ApmContents | History, at: float = 0.0) -> MessageMotion:
    """Motion in a message; of a history that of the first record from ``at`` s after its first on."""
    if isinstance(message, ApmContents):
        return MessageMotion(message.epoch, message.frame, message.quaternion, message.rates, message.tensor)
    index = message.at(at)
    rates = None if message.rates is None else message.rates[index]
    epoch = message.epoch.plus(float(message.times[index]))
    return MessageMotion(epoch, message.frame, message.quaternions[index], rates, None)


def merged_text(source: Source, motion: MessageMotion, *, inertia: bool) -> str:
    """The text of a spacecraft file with the ``motion`` of a message; with its ``inertia`` where that is asked for.

    Raises BadRequest where the message does not give what is asked for, or nothing; FaultyFile where the file would be
    none for nutdamp.
    """
    if inertia and motion.tensor is None:
        raise BadRequest("the message has no inertia to merge")
    if motion.quaternion is None and motion.rates is None:
        raise BadRequest("the message has neither an attitude nor rates to merge")
    before = source.read(lambda _: None)
    after = before
    if inertia and motion.tensor is not None:
        after = replace(after, inertia=Inertia(*principal_axes(motion.tensor), before.inertia.wheel))
    axes = after.inertia.axes
    rates = before.rates if motion.rates is None else motion.rates
    after = replace(after, omega0=axes.T @ rates)
    first, second, third = after.omega0.tolist()
    quaternion = before.initial.quaternion
    if motion.quaternion is not None:
        quaternion = attitude.multiply(motion.quaternion, attitude.from_matrix(axes))
        given = Attitude(motion.quaternion, epoch_after(motion.epoch.text, 0.0), motion.frame)
        after = replace(after, attitude=given)
    later = Later(before, after, SpinState(complex(first, second), third, quaternion))

    def edits(tree: Node) -> Edits:
        if inertia:
            yield from inertia_edits(tree, later)
        if motion.rates is not None:
            yield from rate_edits(tree, later)
        if motion.quaternion is not None:
            yield from attitude_edits(tree, later)

    text = carry_text(*source, edits)
    try:
        Source(text, source.name).read(lambda _: None)
    except FaultyFile as wrong:
        listed = "; ".join(f"{fault.where}: {fault.problem}" for fault in wrong.faults)
        raise BadRequest(f"the message does not fit {source.name}: {listed}") from None
    return text
