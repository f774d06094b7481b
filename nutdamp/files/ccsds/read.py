"""Attitude messages read in KVN, turned into a spacecraft file and a schedule, or merged into a
spacecraft file.

In a parameter message (APM) attitude and rates come from QUAT (or EULER) and ANGVEL, or else from
SPIN by annex F5. A history (AEM) gives quaternions, and rates where it has them; the other forms of
an ephemeris leave the rates open or hold for symmetric bodies alone. A merge sets attitude, epoch
and rates, and the inertia where that is asked for; all else of the file stays, with its comments
and units.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from nutdamp.common.time import DIGITS, Epoch
from nutdamp.errors import BadRequest, Fault, FaultyFile, printable
from nutdamp.files.ccsds import message
from nutdamp.files.ccsds.message import (
    QUATERNION_ANGVEL,
    Checked,
    Keyword,
    MessageBlock,
    MessageReader,
)
from nutdamp.files.editing import (
    Edits,
    Later,
    attitude_edits,
    carry_text,
    epoch_after,
    inertia_edits,
    rate_edits,
)
from nutdamp.files.fields import LONGEST_NAME
from nutdamp.files.reader import Source, read_spacecraft
from nutdamp.files.yaml import Node, read_bytes
from nutdamp.physics import attitude
from nutdamp.physics.body import principal_axes
from nutdamp.spacecraft.model import Attitude, Inertia, Spacecraft, Vector
from nutdamp.spacecraft.schedule import STEERABLE, Pulse, Schedule

AGREES = (
    1e-4  # difference up to which SPIN agrees with the other blocks: rad, and relative for rates
)

_VERSION = "CCSDS_APM_VERS"
_OUTSIDE = (Keyword(_VERSION), *message.HEADER, *message.APM_METADATA, Keyword("EPOCH"))
_NUTATION = ("NUTATION", "NUTATION_PER", "NUTATION_PHASE")


class Manoeuvre(NamedTuple):
    """A torque (3,) N m fixed in the body from ``start`` s after the epoch for ``duration`` s;
    ``mass`` kg or None.
    """

    start: float
    duration: float
    torque: Vector
    mass: float | None


class ApmContents(NamedTuple):
    """Contents of a message, in body axes: ``quaternion`` body -> frame, scalar first; ``rates``
    rad/s.

    ``tensor`` kg m²; ``nutation`` rad as SPIN states it, where its rates count; ``lines`` where
    blocks begin; ``remarks`` for the reader.
    """

    name: str
    object_id: str | None
    epoch: Epoch
    frame: str | None
    quaternion: Vector | None
    rates: Vector
    tensor: Vector | None
    nutation: float | None
    manoeuvres: tuple[Manoeuvre, ...]
    lines: dict[str, int]
    remarks: tuple[str, ...]


def read_apm(path: str) -> ApmContents:
    """The contents of a message; raises CannotRead, or FaultyFile with every fault of the file."""
    return _ApmReader(path).read()


class _ApmReader(MessageReader):
    def __init__(self, path: str) -> None:
        super().__init__(path, _VERSION)
        self.about = Checked(self, self.outside, _OUTSIDE)
        self.by_name: dict[str, list[Checked]] = {name: [] for name in message.APM_BLOCKS}
        self.nutation: float | None = None
        order = list(message.APM_BLOCKS)
        last = ""
        for block in self.blocks:
            name, line = block.name, block.line
            if name not in message.APM_BLOCKS:
                known = ", ".join(f"{each}_START" for each in order)
                self.fault(line, f"{name}_START", f"unknown block; known are {known}")
                continue
            if last and order.index(name) < order.index(last):
                self.fault(line, name, f"comes after {last}; the order is {', '.join(order)}")
            elif self.by_name[name] and name != "MAN":
                self.fault(line, name, "a second block of this kind; which one counts is not said")
            last = name
            self.by_name[name].append(Checked(self, block, message.APM_BLOCKS[name].keywords))

    def _first(self, name: str) -> Checked | None:
        return next(iter(self.by_name[name]), None)

    def read(self) -> ApmContents:
        outside = self.about
        self.take_system(outside)
        epoch = outside.epoch("EPOCH", self.system)
        quaternion = self._attitude()
        quaternion, rates = self._spin(quaternion, self._rates(quaternion))
        tensor = self._inertia()
        manoeuvres = self._manoeuvres(epoch)
        if rates is None and not self.faults:
            self.fault(
                1, "ANGVEL", "missing; without an ANGVEL or a SPIN block the motion is not known"
            )
        if self.faults or epoch is None or rates is None:
            raise FaultyFile(self.faults)
        if quaternion is None:
            self.remarks.append("the message gives no attitude: frame and epoch are left out")
        object_id = outside.text("OBJECT_ID")
        return ApmContents(
            name=(outside.text("OBJECT_NAME") or "UNKNOWN")[:LONGEST_NAME],
            object_id=None if object_id in (None, "UNKNOWN") else object_id[:LONGEST_NAME],
            epoch=epoch,
            frame=self.frame,
            quaternion=quaternion,
            rates=rates,
            tensor=tensor,
            nutation=self.nutation,
            manoeuvres=manoeuvres,
            lines={name: blocks[0].block.line for name, blocks in self.by_name.items() if blocks},
            remarks=tuple(self.remarks),
        )

    def _attitude(self) -> Vector | None:
        """Quaternion body -> frame of QUAT, or of EULER."""
        turn: Vector | None = None
        forward: bool | None = None
        block = self._first("QUAT")
        if block is not None:
            forward = self.endpoints(block)
            parts = block.numbers("QC", "Q1", "Q2", "Q3")
            try:
                turn = None if parts is None else message.unit_quaternion(parts)
            except ValueError as wrong:
                block.fault("Q1", str(wrong))
        elif (block := self._first("EULER")) is not None:
            forward = self.endpoints(block)
            parts = block.numbers("ANGLE_1", "ANGLE_2", "ANGLE_3")
            sequence = block.text("EULER_ROT_SEQ") or ""
            if not re.fullmatch("[XYZ]{3}", sequence) or sequence[1] in (sequence[0], sequence[2]):
                block.fault(
                    "EULER_ROT_SEQ", f"{sequence!r} is no sequence of three turns, such as ZXZ"
                )
            elif parts is not None:
                turn = euler(sequence, *map(math.radians, parts))
        if turn is None or forward is None:
            return None
        return turn if forward else attitude.conjugate(turn)

    def _rates(self, quaternion: Vector | None) -> Vector | None:
        """Rates of the body against the frame, in body axes, rad/s."""
        block = self._first("ANGVEL")
        if block is None:
            return None
        forward = self.endpoints(block)
        parts = block.numbers(*message.ANGVEL)
        axes = block.text("ANGVEL_FRAME")
        if parts is None or axes is None or forward is None:
            return None
        # The rate "from A to B" is that of B against A (annex F4).
        rates = np.radians(parts) if forward else -np.radians(parts)
        faults = len(self.faults)
        if self.rates_in_body(block, axes):
            self.body_frame(block, "ANGVEL_FRAME", axes)
            return rates
        if quaternion is not None:
            return np.asarray(attitude.matrix(quaternion).T @ rates)
        if len(self.faults) == faults:
            block.fault(
                "ANGVEL_FRAME", f"rates in {axes} need an attitude, and the message gives none"
            )
        return None

    def _spin(
        self, quaternion: Vector | None, rates: Vector | None
    ) -> tuple[Vector | None, Vector | None]:
        """Fill in values that the other blocks lack; remark where SPIN contradicts them."""
        block = self._first("SPIN")
        if block is None or self.endpoints(block, reversible=False) is None:
            return quaternion, rates
        angles = block.numbers("SPIN_ALPHA", "SPIN_DELTA", "SPIN_ANGLE", "SPIN_ANGLE_VEL")
        nutating, with_momentum = block.has(_NUTATION), block.has(message.MOMENTUM)
        if nutating and with_momentum:
            block.fault("MOMENTUM_ALPHA", "given together with NUTATION; keep one set of the two")
        if angles is None:
            return quaternion, rates
        alpha, delta, angle, about_axis = map(math.radians, angles)
        turn = euler("ZXZ", alpha + 0.5 * math.pi, 0.5 * math.pi - delta, angle)
        rate = np.array([0.0, 0.0, about_axis])
        if nutating and (values := block.numbers(*_NUTATION)) is not None:
            tilt, phase = math.radians(values[0]), math.radians(values[2])
            if values[1] <= 0.0:
                block.fault("NUTATION_PER", f"{values[1]:g} s is no period; expected more than 0")
                return quaternion, rates
            self.nutation = tilt if rates is None else None
            side = math.sin(tilt)
            momentum = np.array([side * math.cos(phase), -side * math.sin(phase), math.cos(tilt)])
            rate += 2.0 * math.pi / values[1] * momentum
        elif with_momentum and (values := block.numbers(*message.MOMENTUM)) is not None:
            right, up, about_momentum = map(math.radians, values)
            rate += about_momentum * (attitude.matrix(turn).T @ attitude.on_sphere(right, up))
        off = (
            0.0
            if quaternion is None
            else min(np.linalg.norm(quaternion - sign * turn) for sign in (1.0, -1.0))
        )
        if off > 0.5 * AGREES:
            self.remark(
                f"line {block.block.line}: SPIN gives another attitude than the blocks before it, "
                "which count"
            )
        if rates is not None and not np.allclose(
            rates, rate, rtol=0.0, atol=AGREES * np.linalg.norm(rates)
        ):
            self.remark(
                f"line {block.block.line}: SPIN gives other rates than ANGVEL, which counts"
            )
        return turn if quaternion is None else quaternion, rate if rates is None else rates

    def _inertia(self) -> Vector | None:
        block = self._first("INERTIA")
        if block is None:
            return None
        self.body_frame(block, "INERTIA_REF_FRAME", block.text("INERTIA_REF_FRAME"))
        parts = block.numbers("IXX", "IYY", "IZZ", "IXY", "IXZ", "IYZ")
        if parts is None:
            return None
        xx, yy, zz, xy, xz, yz = parts
        # Off the diagonal is minus the product (annex F6); + 0.0 makes 0 of -0.
        return np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]]) + 0.0

    def _manoeuvres(self, epoch: Epoch | None) -> tuple[Manoeuvre, ...]:
        manoeuvres: list[Manoeuvre] = []
        last: tuple[Epoch, int] | None = None
        for block in self.by_name["MAN"]:
            begins = block.epoch("MAN_EPOCH_START", self.system)
            duration = block.number("MAN_DURATION")
            torque = block.numbers("MAN_TOR_X", "MAN_TOR_Y", "MAN_TOR_Z")
            mass = block.number("MAN_DELTA_MASS")
            frame = block.text("MAN_REF_FRAME")
            self.body_frame(block, "MAN_REF_FRAME", frame)
            if duration is not None and duration <= 0.0:
                block.fault("MAN_DURATION", f"{duration:g} s is no duration; expected more than 0")
            if mass is not None and mass > 0.0:
                block.fault("MAN_DELTA_MASS", f"{mass:g} kg would be gained; expected 0 or less")
            if torque is not None and not any(torque):
                block.fault(
                    "MAN_TOR_X", "the torque is zero; expected at least one component other than 0"
                )
            if begins is not None:
                if epoch is not None and begins < epoch:
                    block.fault("MAN_EPOCH_START", "begins before EPOCH, the start of the motion")
                if last is not None and begins < last[0]:
                    block.fault(
                        "MAN_EPOCH_START",
                        f"begins before the block of line {last[1]}; put them in order",
                    )
                last = begins, block.block.line
            if (
                begins is not None
                and epoch is not None
                and duration is not None
                and torque is not None
            ):
                manoeuvres.append(Manoeuvre(begins.since(epoch), duration, np.array(torque), mass))
        return tuple(manoeuvres)


def euler(sequence: str, *angles: float) -> Vector:
    """Quaternion of successive turns by ``angles`` (rad) about the axes of the turned body (annex
    F3).
    """
    turn = np.array([1.0, 0.0, 0.0, 0.0])
    for axis, angle in zip(sequence, angles, strict=True):
        step = np.zeros(4)
        step[0], step[1 + "XYZ".index(axis)] = math.cos(0.5 * angle), math.sin(0.5 * angle)
        turn = attitude.multiply(turn, step)
    return turn


AEM_VERSION = "CCSDS_AEM_VERS"  # keyword of the first line
COLUMNS = {
    "QUATERNION": 4,
    QUATERNION_ANGVEL: 7,
}  # numbers in a record of each ATTITUDE_TYPE read, besides its time


class History(NamedTuple):
    """Attitude of an object at ``times`` (n,) s after ``epoch``: ``quaternions`` (n, 4) body ->
    frame, scalar first.

    ``rates`` (n, 3) rad/s in body axes, or None where the message has none.
    """

    name: str
    epoch: Epoch
    frame: str | None
    times: Vector
    quaternions: Vector
    rates: Vector | None
    remarks: tuple[str, ...]

    def at(self, time: float) -> tuple[Epoch, Vector, Vector | None]:
        """Epoch, quaternion and rates of the first record from ``time`` s on; raises BadRequest
        past the last.
        """
        index = int(np.searchsorted(self.times, time))
        if index == len(self.times):
            raise BadRequest(
                f"the history ends {self.times[-1]:.6g} s after its first record: "
                "expected a time in it"
            )
        rates = None if self.rates is None else self.rates[index]
        return self.epoch.plus(float(self.times[index])), self.quaternions[index], rates


def is_history(path: str) -> bool:
    """True for a file that begins as an AEM does, not for standard input; raises CannotRead."""
    beginning = b"" if path == "-" else read_bytes(path, 200)
    return beginning.lstrip(message.BEFORE).startswith(AEM_VERSION.encode())


def read_history(path: str) -> History:
    """The history in a message; raises CannotRead, or FaultyFile with its faults."""
    reader = _HistoryReader(path)
    segments = [block for block in reader.blocks if block.name in ("META", "DATA")]
    for metadata, records in zip(segments[::2], segments[1::2], strict=False):
        if (metadata.name, records.name) != ("META", "DATA"):
            reader.fault(metadata.line, metadata.name, "expected META_START … META_STOP, then data")
            break
        reader.take(metadata, records)
    if not segments or len(segments) % 2:
        reader.fault(1, "DATA_START", "missing; each block of metadata is followed by data")
    if not reader.faults and not reader.times:
        reader.fault(segments[0].line, "DATA_START", "no records")
    if reader.faults:
        raise FaultyFile(reader.faults)
    first = reader.times[0]
    times, turns = (
        np.array([time.since(first) for time in reader.times]),
        np.array(reader.quaternions),
    )
    rates = None if reader.rates is None else np.array(reader.rates)
    return History(reader.name, first, reader.frame, times, turns, rates, tuple(reader.remarks))


class _HistoryReader(MessageReader):
    def __init__(self, path: str) -> None:
        super().__init__(path, AEM_VERSION)
        self.name = "UNKNOWN"
        self.times: list[Epoch] = []
        self.quaternions: list[Vector] = []
        self.rates: list[Vector] | None = []

    def take(self, metadata: MessageBlock, records: MessageBlock) -> None:
        block = Checked(self, metadata, message.AEM_METADATA)
        self.name = (block.text("OBJECT_NAME") or self.name)[:LONGEST_NAME]
        self.take_system(block)
        forward = self.endpoints(block)
        kind = block.text("ATTITUDE_TYPE")
        if kind is not None and kind not in COLUMNS:
            block.fault("ATTITUDE_TYPE", f"{kind!r} is not read; expected {' or '.join(COLUMNS)}")
        axes = block.text("ANGVEL_FRAME")
        turning = kind == QUATERNION_ANGVEL
        if turning and axes is None:
            block.fault(
                "ANGVEL_FRAME", f"missing; {QUATERNION_ANGVEL} needs the frame of the rates"
            )
        in_body = not turning or axes is None or self.rates_in_body(block, axes)
        if self.faults or kind is None or forward is None:
            return
        if not turning:
            self.rates = None
        for record in records.entries:
            self._record(
                record.line, record.value.split(), COLUMNS[kind], forward=forward, in_body=in_body
            )

    def _record(
        self, line: int, cells: list[str], columns: int, *, forward: bool, in_body: bool
    ) -> None:
        try:
            time = Epoch.parse(cells[0], self.system)
            numbers = [float(cell) for cell in cells[1:]]
            if len(numbers) != columns or not all(map(math.isfinite, numbers)):
                raise ValueError(f"expected a time and {columns} numbers")
            parts = message.unit_quaternion([numbers[3], *numbers[:3]])
        except ValueError as wrong:
            self.fault(line, "DATA", str(wrong))
            return
        if self.times and time == self.times[-1]:  # a segment begins where the one before ends
            return
        if self.times and time < self.times[-1]:
            self.fault(line, "DATA", "comes before the record above; put them in order")
            return
        quaternion = parts if forward else attitude.conjugate(parts)
        self.times.append(time)
        self.quaternions.append(quaternion)
        if self.rates is not None:
            rates = np.radians(numbers[4:]) * (1.0 if forward else -1.0)
            self.rates.append(
                rates if in_body else np.asarray(attitude.matrix(quaternion).T @ rates)
            )


ALIKE = 1e-9  # relative difference up to which torques count as transverse, and as of one magnitude

_BLOCKS = {"inertia": "INERTIA", "omega0": "ANGVEL", "attitude": "EPOCH", "steerable": "MAN"}
"""Block of the message behind each part of the spacecraft file."""


SAME_NUTATION, ROUNDED = 0.01, 1e-5
"""Share of a nutation, and rad besides, by which that of the inertia may differ: messages round."""


def imported(contents: ApmContents, path: str) -> tuple[str, Spacecraft, Schedule]:
    """Text of the spacecraft file, the spacecraft, and the manoeuvres; FaultyFile, by lines of the
    message.
    """
    if contents.tensor is None:
        problem = (
            "missing; a spacecraft file needs moments of inertia: "
            "--into merges the message into one that has"
        )
        raise FaultyFile([Fault(path, 1, 1, "INERTIA", f"{problem} them")])
    _, axes = principal_axes(contents.tensor)
    torques = [axes.T @ manoeuvre.torque for manoeuvre in contents.manoeuvres]
    sizes = [float(np.linalg.norm(torque)) for torque in torques]
    transverse = all(
        abs(torque[2]) <= ALIKE * size for torque, size in zip(torques, sizes, strict=True)
    )
    alike = sizes and transverse and max(sizes) - min(sizes) <= ALIKE * max(sizes)
    # Texts are in double quotes, in which JSON and YAML agree.
    lines = [
        f"# From the attitude parameter message {printable(path)}; numbers as given there.",
        "# An APM knows no thruster layout, no mass, no requirement and no limits: add them.",
        f"name: {json.dumps(contents.name, ensure_ascii=False)}",
    ]
    if contents.object_id is not None:
        lines.append(f"object_id: {json.dumps(contents.object_id, ensure_ascii=False)}")
    rates = ", ".join(f"{math.degrees(rate)!r} deg/s" for rate in contents.rates.tolist())
    lines += [*_inertia(contents.tensor), f"omega0: [{rates}]"]
    if contents.quaternion is not None:
        lines += [
            "attitude:",
            f"  epoch: {contents.epoch.text.rstrip('0').rstrip('.')}Z",
            f"  frame: {contents.frame}",
            f"  quaternion: {contents.quaternion.tolist()}   # body -> frame, scalar first",
        ]
    lines += _actuators(contents.manoeuvres, sizes[0] if alike else None)
    text = "\n".join(lines) + "\n"
    # Pulses of the steerable torquer; one that overlaps another has a name of its own.
    pulses: list[Pulse] = []
    free = 0.0
    for number, (manoeuvre, torque) in enumerate(
        zip(contents.manoeuvres, torques, strict=True), start=1
    ):
        start, lasts, used = manoeuvre.start, manoeuvre.duration, manoeuvre.mass
        alone = start >= free - 1e-9
        spent = None if used is None else -used
        channel = STEERABLE if alone else f"MAN{number}"
        pulses.append(
            Pulse(start + 0.5 * lasts, lasts, channel, torque * lasts, torque, propellant=spent)
        )
        free = max(free, start + lasts) if alone else free
    try:
        return text, read_spacecraft(text, path), Schedule(tuple(pulses))
    except FaultyFile as wrong:  # its faults are those of the message
        faults = []
        for fault in wrong.faults:
            block = _BLOCKS.get(fault.where.partition(".")[0].partition("[")[0], "")
            line = contents.lines.get(
                block, contents.lines.get("SPIN", 1) if block == "ANGVEL" else 1
            )
            faults.append(Fault(path, line, 1, block or fault.where, fault.problem))
        raise FaultyFile(faults) from None


def contradictions(contents: ApmContents, spacecraft: Spacecraft) -> list[str]:
    """Contradictions between the nutation stated in the message and that by inertia and period."""
    stated, follows = contents.nutation, spacecraft.widest.nutation
    if stated is None or abs(follows - abs(stated)) <= ROUNDED + SAME_NUTATION * abs(stated):
        return []
    return [
        f"SPIN says a nutation of {math.degrees(abs(stated)):.4g} deg, "
        "but with this INERTIA NUTATION_PER gives one "
        f"of {math.degrees(follows):.4g} deg, which the file has; one of the three is wrong"
    ]


def ratio_doubts(contents: ApmContents, spacecraft: Spacecraft) -> list[str]:
    """Doubt where spin, nutation and period of SPIN are those of another C/A than that of the
    ``body`` merged into.
    """
    if not contents.nutation or spacecraft.spin == 0.0:
        return []
    first, second, third = contents.rates.tolist()
    implied = math.hypot(first, second) / (abs(third) * math.tan(abs(contents.nutation)))
    ratio = abs(spacecraft.axial / (spacecraft.inertia.A * spacecraft.spin))
    if abs(implied - ratio) <= SAME_NUTATION * ratio:
        return []
    return [
        f"spin, nutation and period of SPIN are those of C/A = {implied:.4g}, "
        f"and the file has {ratio:.4g}: "
        f"the spin and the nutation of {math.degrees(abs(contents.nutation)):.4g} deg are kept, "
        "not the period"
    ]


def _inertia(tensor: Vector) -> list[str]:
    first, second, third = np.diag(tensor).tolist()
    if first == second and not (tensor - np.diag(np.diag(tensor))).any():
        return [f"inertia: {{A: {first!r} kg m^2, C: {third!r} kg m^2}}"]
    rows = (", ".join(f"{part!r} kg m^2" for part in row) for row in tensor.tolist())
    return ["inertia:", "  tensor:", *(f"    - [{row}]" for row in rows)]


def _actuators(manoeuvres: tuple[Manoeuvre, ...], torquer: float | None) -> list[str]:
    if not manoeuvres:
        return [
            "# The message fires nothing; without thrusters an ideal steerable impulse is assumed."
        ]
    if torquer is not None:
        first = round(manoeuvres[0].start, DIGITS)
        return [
            (
                "# All manoeuvres of the message are transverse and of one torque, "
                "as a steerable torquer gives them."
            ),
            f"steerable: {{torque: {torquer!r} N m}}",
            *[f"limits: {{earliest: {first!r} s}}   # the first manoeuvre begins then"]
            * bool(first),
        ]
    distinct = {tuple(manoeuvre.torque.tolist()): None for manoeuvre in manoeuvres}
    return [
        (
            "# The torques that the message fires, as thrusters to begin with; without any, "
            "an ideal steerable impulse is"
        ),
        "# assumed.",
        "# thrusters:",
        *(
            (
                f"#   - {{name: MAN{number}, torque: "
                f"[{', '.join(f'{part!r} N m' for part in torque)}]}}"
            )
            for number, torque in enumerate(distinct, start=1)
        ),
    ]


def merged_text(
    source: Source, contents: ApmContents | History, at: float = 0.0, *, inertia: bool
) -> str:
    """The text of a spacecraft file with the motion of a message, of a history the record from
    ``at`` s on.

    Of SPIN with a nutation the spin and the angle; see `ratio_doubts`.

    Raises BadRequest where the message has no ``inertia`` to merge, and where the file would be
    none for nutdamp.
    """
    given: Vector | None
    if isinstance(contents, ApmContents):
        epoch, turn, given, tensor = (
            contents.epoch,
            contents.quaternion,
            contents.rates,
            contents.tensor,
        )
    else:
        (epoch, turn, given), tensor = contents.at(at), None
    if inertia and tensor is None:
        raise BadRequest("the message has no inertia to merge")
    before = source.read(lambda _: None)
    after = before
    if inertia and tensor is not None:
        after = replace(after, inertia=Inertia(*principal_axes(tensor), before.inertia.wheel))
    axes = after.inertia.axes
    after = replace(after, omega0=axes.T @ (before.rates if given is None else given))
    if isinstance(contents, ApmContents) and contents.nutation:
        first, second, third = after.inertia.momentum(after.omega0).tolist()
        share = abs(third) * math.tan(abs(contents.nutation)) / math.hypot(first, second)
        after = replace(
            after, omega0=after.omega0 * (share, share, 1.0)
        )  # the angle stays, whatever C/A the file has
    quaternion = before.initial.quaternion
    if turn is not None:
        quaternion = attitude.multiply(turn, attitude.from_matrix(axes))
        after = replace(
            after, attitude=Attitude(turn, epoch_after(epoch.text, 0.0), contents.frame)
        )
    later = Later(before, after, quaternion)

    def edits(tree: Node) -> Edits:
        if inertia:
            yield from inertia_edits(tree, later)
        if given is not None:
            yield from rate_edits(tree, later)
        if turn is not None:
            yield from attitude_edits(tree, later)

    text = carry_text(*source[:3], edits)
    try:
        Source(text, source.name).read(lambda _: None)
    except FaultyFile as wrong:
        listed = "; ".join(f"{fault.where}: {fault.problem}" for fault in wrong.faults)
        raise BadRequest(f"the message does not fit {source.name}: {listed}") from None
    return text
