"""Attitude messages read: APM, AEM and ACM in KVN, and attitude files of the Systems Tool Kit.

Lines become tokens, tokens blocks, and blocks fields by the tables of `message`; every fault has
its line and field, and nothing is guessed. Attitude and rates follow from the fields by annex F of
CCSDS 504.0-B-2. A parameter message is a history of one record.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest, Fault, FaultyFile, listed, nearest
from nutdamp.files.ccsds import message
from nutdamp.files.ccsds.message import FORMS, VERSION, Form, Keyword, Layout, names
from nutdamp.files.export import AXES, FRAME_NAMES, MONTHS
from nutdamp.files.fields import LONGEST_NAME
from nutdamp.files.yaml import decode, read_bytes, read_limited
from nutdamp.physics import attitude
from nutdamp.spacecraft.model import Vector

MOST_BYTES = 16 << 20  # size of a message, many times more than its most manoeuvres take
LARGEST = 1e15  # larger magnitudes are nothing physical
UNIT = 1e-4  # deviation from length one up to which a quaternion counts as rounded
AGREES = 1e-4  # up to which SPIN agrees with other blocks of an APM: rad, and relative for rates

BEFORE = b"\xef\xbb\xbf\xff\xfe\0 \t\r\n"
"""Bytes that may come before the first character of a text, in UTF-8 and UTF-16."""

BODY = re.compile(r"SC_BODY(_[A-Z0-9]+)?")  # frames fixed in the body
_STK = re.compile(r"stk\.v\.[0-9.]+", re.IGNORECASE)

_PAIR = re.compile(r"([A-Z0-9_]+)\s*=\s*(.*?)(?:\s+\[([^\]]*)\])?")
_EDGE = re.compile(r"([A-Z0-9_]+)_(START|STOP)")
_LINE_END = re.compile(r"\r\n|\n\r|\n|\r")
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_DATE = re.compile(rf"([0-9]{{1,2}}) ({'|'.join(MONTHS)}) ([0-9]{{4}}) (\S+)")

RADIANS_BETWEEN = 2.0
"""rad; records that the body turns by more from one to the other tell no rates: beyond half a turn
it is not even known which way.
"""


class Manoeuvre(NamedTuple):
    """A torque (3,) N m fixed in the body from ``start`` s after the epoch for ``duration`` s;
    ``mass`` kg or None.
    """

    start: float
    duration: float
    torque: Vector
    mass: float | None


class Contents(NamedTuple):
    """Contents of a message, in body axes: records at ``times`` (n,) s after ``epoch``.

    ``quaternions`` (n, 4) body -> frame, scalar first, ``rates`` (n, 3) rad/s and ``nutations``
    (n,) rad, NaN where the message has none; ``stretches`` (n,) numbers of motions without jumps.
    ``tensor`` kg m²; ``mass`` kg; ``lines`` where blocks begin; ``remarks`` for the user.
    """

    name: str
    object_id: str | None
    epoch: Epoch
    frame: str | None
    times: Vector
    quaternions: Vector
    rates: Vector
    nutations: Vector
    stretches: Vector
    tensor: Vector | None
    mass: float | None
    manoeuvres: tuple[Manoeuvre, ...]
    lines: dict[str, int]
    remarks: tuple[str, ...]

    def at(self, time: float = 0.0, spin: float = 0.0) -> Contents:
        """The first record from ``time`` s on, of a body that spins at about ``spin`` rad/s.

        Rates that it has not are those of the polynomial through the turns to the four records
        nearest, or of the spin alone. Raises BadRequest where there is no record.
        """
        index = int(np.searchsorted(self.times, time))
        if index == len(self.times):
            last = f"{self.times[-1]:.6g} s after its first record" if index else "without records"
            raise BadRequest(f"the history ends {last}: expected a time within it")
        rates, remarks = self.rates[index], self.remarks
        unknown = np.isnan(rates)
        speed = abs(spin if unknown[2] else rates[2])
        first, last = np.searchsorted(self.stretches, self.stretches[index] + np.arange(2)).tolist()
        begin = max(min(index - 2, last - 5), first)
        near = np.arange(begin, min(begin + 5, last))
        near = near[np.abs(self.times[near] - self.times[index]) * speed < RADIANS_BETWEEN]
        span = self.times[near] - self.times[index]
        if unknown.any() and len(near) > 1:
            turns = attitude.multiply(
                attitude.conjugate(self.quaternions[index]), self.quaternions[near]
            )
            turns = turns * np.where(turns[:, :1] < 0.0, -1.0, 1.0)
            sines = np.linalg.norm(turns[:, 1:], axis=1)
            angles = 2.0 * np.arctan2(sines, turns[:, 0])
            vectors = turns[:, 1:] * (angles / np.where(sines > 0.0, sines, 1.0))[:, None]
            # Weights that differentiate every polynomial through these moments.
            scale = np.abs(span).max()
            powers = np.vander(span / scale, increasing=True)
            weights = np.linalg.solve(powers.T, np.eye(len(near))[1]) / scale
            rates = np.where(unknown, weights @ vectors, rates)
            remarks += ("the message lacks rates; they follow from its attitudes near the record",)
        elif not unknown[2]:
            rates = np.nan_to_num(rates)
        epoch = self.epoch.plus(float(self.times[index]))
        if len(self.times) > 1:
            remarks = (
                f"record used: {self.times[index] - self.times[0]:.6g} s after the first, at "
                f"{epoch.text}Z",
                *remarks,
            )
        return self._replace(
            epoch=epoch,
            times=np.zeros(1),
            quaternions=self.quaternions[[index]],
            rates=rates[None],
            nutations=self.nutations[[index]],
            stretches=self.stretches[[index]],
            remarks=remarks,
        )


Entry = tuple[int, str, str, str | None]  # line, keyword, value and unit


class BlockLines(NamedTuple):
    """Entries and data lines of a block, which begins in ``line``; without name those outside."""

    name: str
    line: int
    entries: list[Entry]
    rows: list[tuple[int, list[str]]]


class MessageReader:
    """Reader of one message: its tokens, and what its blocks share.

    Raises CannotRead, or FaultyFile for XML.
    """

    def __init__(self, path: str) -> None:
        self.path, self.remarks = path, list[str]()
        self.faults: dict[tuple[int, str], Fault] = {}
        self.system = "UTC"
        self.frames: dict[bool, str] = {}  # True: fixed in the body
        self.epochs: list[Epoch] = []
        self.motions: list[Motion] = []
        self.lines: dict[str, int] = {}
        data = read_limited(path, MOST_BYTES)
        if data.lstrip(BEFORE).startswith(b"<"):
            self.fault(1, "", "XML is not read; convert to KVN (keyword = value notation)")
            raise FaultyFile([*self.faults.values()])
        self.tokens = [
            (line, raw.strip())
            for line, raw in enumerate(_LINE_END.split(decode(data, path)), start=1)
            if raw.strip() and raw.split(maxsplit=1)[0] != "COMMENT"
        ]

    def fault(self, line: int, where: str, problem: str) -> None:
        """Keep a fault of the message, the first of each field."""
        self.faults.setdefault((line, where), Fault(self.path, line, 1, where, problem))

    def value(self, keyword: Keyword, text: str) -> Any:
        """The value in a text by the kind of its keyword; raises ValueError, which says what is
        wrong.
        """
        if not text:
            raise ValueError("empty; expected a value")
        if keyword.words and text not in keyword.words:
            raise ValueError(f"{text!r} is not read; expected {listed(keyword.words, 'or')}")
        match keyword.kind:
            case "epoch":
                return Epoch.parse(text, self.system)
            case "date":
                parts = _DATE.fullmatch(text)
                if parts is None:
                    raise ValueError(f"{text!r}: expected a date such as 1 Mar 2026 12:00:00.000")
                day, month, year, clock = parts.groups()
                return Epoch.parse(f"{year}-{1 + MONTHS.index(month):02d}-{day:0>2}T{clock}")
            case "system":
                self.system = text
                if text != "UTC":
                    self.remarks.append(f"times are {text}; the spacecraft file has them in UTC")
                return text
            case "frame" | "body":
                return self._frame(text, keyword.kind == "body")
            case "sequence":
                if not re.fullmatch("[XYZ]{3}", text) or text[1] in (text[0], text[2]):
                    raise ValueError(f"{text!r} is no sequence of three turns, such as ZXZ")
                return text
        if keyword.unit is None:
            return text
        numbers = text.split() if keyword.kind == "vector" else [text]
        for number in numbers:
            if not _NUMBER.fullmatch(number):
                raise ValueError(f"{number[:40]!r} is not a number")
            if not abs(float(number)) <= LARGEST:
                raise ValueError(f"{number[:40]} is beyond anything physical")
        first = float(numbers[0])
        if (keyword.kind == "above" and first <= 0.0) or (keyword.kind == "most" and first > 0.0):
            expected = "more than 0" if keyword.kind == "above" else "0 or less"
            raise ValueError(f"{first:g} {keyword.unit}: expected {expected}")
        return first

    def _frame(self, name: str, fixed: bool) -> bool:
        """True for a frame fixed in the body; one body and one inertial frame is all there is."""
        in_body = BODY.fullmatch(name) is not None
        frame = name if in_body else FRAME_NAMES.get(name)
        if fixed and not in_body:
            raise ValueError(f"{name!r} is not a body frame; expected SC_BODY_1")
        if frame is None:
            raise ValueError(
                f"{name!r} is no frame known here; expected SC_BODY_1 or one of "
                f"{', '.join(FRAME_NAMES)}"
            )
        shared = self.frames.setdefault(in_body, frame)
        if AXES.get(shared, shared) != AXES.get(frame, frame):
            raise ValueError(f"{name!r} here, {shared!r} in another block; expected one frame")
        if frame != name:
            self.remarks.append(f"{name} is taken as {frame}, whose axes are the same")
        return in_body


class Fields:
    """Values of a block by keyword, checked against its table: problems are faults of the message,
    and an unreadable value is then absent.

    ``forward``: the block leads from the inertial frame to the body, not back.
    """

    def __init__(
        self, reader: MessageReader, section: BlockLines, keywords: tuple[Keyword, ...]
    ) -> None:
        self.reader, self.section = reader, section
        self.values: dict[str, Any] = {}
        entries: dict[str, Entry] = {}
        table = names(keywords)
        for entry in section.entries:
            line, name, *_ = entry
            if name not in table:
                close = nearest(name, table)
                cure = f"did you mean {close}?" if close else f"known here: {', '.join(table)}"
                reader.fault(line, name, f"unknown keyword; {cure}")
            elif name in entries:
                reader.fault(line, name, f"given again, first in line {entries[name][0]}")
            else:
                entries[name] = entry
        self.lines = {name: line for name, (line, *_) in entries.items()}
        inside = f" in this {section.name} block" if section.name else ""
        for keyword in keywords:
            if keyword.name not in entries:
                if keyword.required:
                    self.fault(keyword.name, f"missing{inside}")
                continue
            _, name, text, unit = entries[keyword.name]
            if unit and unit != keyword.unit:
                expected = f"[{keyword.unit}]" if keyword.unit else "no unit"
                self.fault(name, f"expected {expected}, got [{unit}]")
            try:
                self.values[name] = reader.value(keyword, text)
            except ValueError as wrong:
                self.fault(name, str(wrong))
        self.forward: bool = self.values.get("REF_FRAME_B", True)
        if self.forward is self.values.get("REF_FRAME_A"):
            self.fault("REF_FRAME_B", "one of the two frames must be the body, SC_BODY_1")

    def fault(self, keyword: str, problem: str) -> None:
        """Something wrong with a keyword, or, where it is missing, with the block."""
        self.reader.fault(self.lines.get(keyword, self.section.line), keyword, problem)

    def columns(self, keywords: tuple[Keyword, ...]) -> dict[str, Vector]:
        """Numbers of keywords that go together, (1,) each as one data line has them; empty where
        one is absent.
        """
        absent = [name for name in names(keywords) if name not in self.lines]
        if 0 < len(absent) < len(keywords):
            self.fault(absent[0], f"missing; {', '.join(names(keywords))} go together")
        if not all(name in self.values for name in names(keywords)):
            return {}
        return {name: np.array([self.values[name]]) for name in names(keywords)}

    def attitudes(self, columns: Mapping[str, Vector], lines: Sequence[int]) -> Vector:
        """Quaternions (n, 4) body -> frame of the records in ``lines``."""
        if "Q1" in columns:
            parts = np.column_stack([columns[name] for name in ("QC", "Q1", "Q2", "Q3")])
            lengths = np.linalg.norm(parts, axis=1)
            for index in np.flatnonzero(np.abs(lengths - 1.0) > UNIT).tolist():
                self.reader.fault(
                    lines[index],
                    "Q1",
                    f"the quaternion has length {lengths[index]:.6g}; expected 1",
                )
            turn = parts / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        elif "ANGLE_1" in columns:
            if "EULER_ROT_SEQ" not in self.lines:
                self.fault("EULER_ROT_SEQ", "missing; the angles need their sequence of axes")
            angles = [np.radians(columns[name]) for name in names(message.ANGLES)]
            turn = euler(self.values.get("EULER_ROT_SEQ", "ZXZ"), *angles)
        else:
            if not self.forward:
                self.fault(
                    "REF_FRAME_A",
                    "the body comes first; this block leads from the inertial frame to the body",
                )
            alpha, delta, angle = (
                np.radians(columns[name]) for name in names(message.SPIN_AXIS)[:3]
            )
            turn = euler("ZXZ", alpha + 0.5 * math.pi, 0.5 * math.pi - delta, angle)
        return turn if self.forward else attitude.conjugate(turn)

    def rates(self, columns: Mapping[str, Vector], quaternions: Vector) -> Vector:
        """Rates (n, 3) of the body in its axes, rad/s, NaN for those that no field tells."""
        if "SPIN_ANGLE_VEL" in columns:
            return spin_rates(columns, quaternions)
        if "ANGVEL_X" not in columns:
            return np.full((len(quaternions), 3), math.nan)
        rates = np.radians(np.column_stack([columns[name] for name in names(message.ANGVEL)]))
        # The rate "from A to B" is that of B against A (annex F4).
        rates = rates if self.forward else -rates
        if self.values.get("ANGVEL_FRAME", self.forward):
            return rates
        return attitude.rotate(attitude.conjugate(quaternions), rates)


def euler(sequence: str, *angles: Vector | float) -> Vector:
    """Quaternions (..., 4) of successive turns by ``angles`` (...) rad about the axes of the turned
    body (annex F3).
    """
    turn = np.array([1.0, 0.0, 0.0, 0.0])
    for axis, angle in zip(sequence, angles, strict=True):
        half = 0.5 * np.asarray(angle)
        step = np.zeros((*half.shape, 4))
        step[..., 0], step[..., 1 + "XYZ".index(axis)] = np.cos(half), np.sin(half)
        turn = attitude.multiply(turn, step)
    return turn


def tensor_of(columns: Mapping[str, Vector]) -> Vector | None:
    """Inertia (3, 3) of the six fields in their order, kg m²; None of none."""
    if not columns:
        return None
    xx, yy, zz, xy, xz, yz = (float(part[0]) for part in columns.values())
    # Off the diagonal is minus the product (annex F6); + 0.0 makes 0 of -0.
    return np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]]) + 0.0


def spin_rates(columns: Mapping[str, Vector], quaternions: Vector) -> Vector:
    """Rates (n, 3) by SPIN_ANGLE_VEL about axis 3 and the nutation about H (annex F5), rad/s; those
    across axis 3 are NaN where the nutation is not told.
    """
    own = np.radians(columns["SPIN_ANGLE_VEL"])
    if "NUTATION" in columns:
        tilt, phase = np.radians(columns["NUTATION"]), np.radians(columns["NUTATION_PHASE"])
        side = np.sin(tilt)
        about = 2.0 * math.pi / columns["NUTATION_PER"]
        momentum = np.array([side * np.cos(phase), -side * np.sin(phase), np.cos(tilt)])
    elif "NUTATION_VEL" in columns:
        right, up, about = (np.radians(columns[name]) for name in names(message.MOMENTUM))
        towards = [np.cos(up) * np.cos(right), np.cos(up) * np.sin(right), np.sin(up)]
        momentum = attitude.rotate(attitude.conjugate(quaternions), np.array(towards).T).T
    else:
        return np.column_stack([np.full((len(own), 2), math.nan), own])
    return np.asarray((about * momentum).T + np.outer(own, [0.0, 0.0, 1.0]))


# Quaternions (n, 4), rates (n, 3) rad/s and nutations (n,) rad of records without jumps; NaN where
# they are not told.
Motion = tuple[Vector, Vector, Vector]


def is_message(path: str) -> bool:
    """True for a file that begins as a message or as XML does, not for standard input; raises
    CannotRead.
    """
    beginning = (b"" if path == "-" else read_bytes(path, 200)).lstrip(BEFORE)
    return beginning[:6].lower() in (b"ccsds_", b"stk.v.") or beginning.startswith(b"<")


def read_message(path: str) -> Contents:
    """The contents of an attitude message; raises CannotRead, or FaultyFile with every fault of the
    file.
    """
    reader = MessageReader(path)
    line, first = reader.tokens[0] if reader.tokens else (1, "")
    if _STK.fullmatch(first):
        return _stk(reader)
    word, _, version = (part.strip() for part in first.partition("="))
    if word not in FORMS or version != VERSION:
        reader.fault(
            line,
            "",
            f"{first[:40]!r} does not begin a known message; expected {listed([*FORMS], 'or')} = "
            f"{VERSION}, or stk.v.11.0 (.a)",
        )
        raise FaultyFile([*reader.faults.values()])
    form = FORMS[word]
    outside, *blocks = _sections(reader, form)
    about = Fields(reader, outside, form.outside)
    return {"APM": _apm, "AEM": _aem, "ACM": _acm}[form.name](reader, about, blocks)


def _sections(reader: MessageReader, form: Form) -> list[BlockLines]:
    """Blocks of a message in KVN in their order, behind what is outside of them."""
    sections = [BlockLines("", 1, [], [])]
    within: BlockLines | None = None
    for line, content in reader.tokens[1:]:
        edge, pair = _EDGE.fullmatch(content), _PAIR.fullmatch(content)
        layout = form.blocks.get(within.name, Layout("")) if within else Layout("")
        if within is not None and content == f"{within.name}_STOP":
            within = None
        elif layout.skipped:
            continue
        elif pair is not None:
            (within or sections[0]).entries.append((line, pair[1], pair[2], pair[3]))
        elif edge is not None and edge[2] == "START":
            if within is not None:
                reader.fault(line, content, f"{within.name}_STOP is missing before it")
            within = BlockLines(edge[1], line, [], [])
            if edge[1] not in form.blocks:
                starts = ", ".join(f"{name}_START" for name in form.blocks)
                reader.fault(line, content, f"unknown block; known are {starts}")
                continue
            if edge[1] in reader.lines and not form.blocks[edge[1]].repeated:
                reader.fault(line, edge[1], "a second block of this kind; remove one of the two")
            if form.blocks[edge[1]].skipped:
                reader.remarks.append(f"{edge[1]} blocks are not read")
            sections.append(within)
            reader.lines.setdefault(edge[1], line)
        elif edge is not None:
            reader.fault(
                line, content, f"expected {within.name}_STOP" if within else "no block is open"
            )
        elif within is not None and layout.rows:
            within.rows.append((line, content.split()))
        else:
            reader.fault(line, "", f"{content[:40]!r} is no KEYWORD = value")
    if within is not None:
        reader.fault(within.line, f"{within.name}_START", f"{within.name}_STOP is missing")
    return sections


def _take_rows(
    reader: MessageReader,
    block: Fields,
    section: BlockLines,
    keywords: tuple[Keyword, ...],
    zero: Epoch | None = None,
) -> None:
    """Take the records of data lines: a time, or s after ``zero``, and a number for each of the
    ``keywords``.
    """
    lines: list[int] = []
    table: list[list[float]] = []
    for line, (first, *cells) in section.rows:
        where = section.name
        try:
            if len(cells) != len(keywords):
                raise ValueError(
                    f"{len(cells)} numbers behind the time; expected a time and "
                    f"{', '.join(names(keywords))}"
                )
            values = []
            for keyword, cell in zip(keywords, cells, strict=True):
                where = keyword.name
                values.append(reader.value(keyword, cell))
            where = "EPOCH"
            if zero is None or not _NUMBER.fullmatch(first):
                time = Epoch.parse(first, reader.system)
            else:
                time = zero.plus(float(first))
            if reader.epochs and time < reader.epochs[-1]:
                raise ValueError("comes before the record above; put them in order")
        except ValueError as wrong:
            reader.fault(line, where, str(wrong))
            continue
        if not reader.epochs or time > reader.epochs[-1]:  # blocks begin where others end
            reader.epochs.append(time)
            lines.append(line)
            table.append(values)
    if table:
        columns = dict(zip(names(keywords), np.array(table).T, strict=True))
        quaternions = block.attitudes(columns, lines)
        nutations = np.radians(columns.get("NUTATION", np.full(len(table), math.nan)))
        reader.motions.append((quaternions, block.rates(columns, quaternions), nutations))


def _contents(
    reader: MessageReader,
    about: Fields,
    tensor: Vector | None = None,
    mass: float | None = None,
    manoeuvres: tuple[Manoeuvre, ...] = (),
) -> Contents:
    """Contents of the message with the records taken; raises FaultyFile."""
    if not reader.faults and not reader.motions and tensor is None:
        reader.fault(1, "", "no records of attitude")
    if reader.faults:
        raise FaultyFile([*reader.faults.values()])
    motions = [(np.empty((0, 4)), np.empty((0, 3)), np.empty(0)), *reader.motions]
    quaternions, rates, nutations = (np.concatenate(part) for part in zip(*motions, strict=True))
    identity = about.values.get("OBJECT_ID", about.values.get("INTERNATIONAL_DESIGNATOR"))
    epoch = reader.epochs[0]
    return Contents(
        name=about.values.get("OBJECT_NAME", "UNKNOWN")[:LONGEST_NAME],
        object_id=None if identity in (None, "UNKNOWN") else identity[:LONGEST_NAME],
        epoch=epoch,
        frame=reader.frames.get(False),
        times=np.array([each.since(epoch) for each in reader.epochs])[: len(rates)],
        quaternions=quaternions,
        rates=rates,
        nutations=nutations,
        stretches=np.repeat(np.arange(len(motions)), [len(part[1]) for part in motions]),
        tensor=tensor,
        mass=mass,
        manoeuvres=manoeuvres,
        lines=reader.lines,
        remarks=tuple(dict.fromkeys(reader.remarks)),
    )


def _apm(reader: MessageReader, about: Fields, sections: list[BlockLines]) -> Contents:
    """Attitude and rates from QUAT (or EULER) and ANGVEL, or else from SPIN."""
    order = list(message.APM_BLOCKS)
    epoch: Epoch | None = about.values.get("EPOCH")
    quaternion, rates, nutation = (np.full(shape, math.nan) for shape in ((1, 4), (1, 3), 1))
    tensor: Vector | None = None
    manoeuvres: list[Manoeuvre] = []
    for section in sorted(sections, key=lambda section: order.index(section.name)):
        block = Fields(reader, section, message.APM_BLOCKS[section.name].keywords)
        columns = block.columns(message.APM_GROUPS[section.name])
        if not columns:
            continue
        match section.name:
            case "QUAT" | "EULER" if np.isnan(quaternion).any():
                quaternion = block.attitudes(columns, [block.lines.get("Q1", 1)])
            case "ANGVEL":
                rates = block.rates(columns, quaternion)
                if np.isnan(rates).any():
                    block.fault(
                        "ANGVEL_FRAME",
                        "rates in an inertial frame need the attitude of another block",
                    )
            case "SPIN":
                nutating, turning = (
                    block.columns(keywords) for keywords in (message.NUTATION, message.MOMENTUM)
                )
                if nutating and turning:
                    block.fault(
                        "MOMENTUM_ALPHA", "given together with NUTATION; keep one set of the two"
                    )
                columns |= nutating or turning
                turn = block.attitudes(columns, [])
                spun = np.nan_to_num(spin_rates(columns, turn))
                where = f"line {section.line}: SPIN gives"
                # The product of quaternions is the cosine of half the angle between them.
                if abs(float(np.vdot(quaternion, turn))) < 1.0 - AGREES**2 / 8.0:
                    reader.remarks.append(
                        f"{where} a different attitude from the blocks before it, which count"
                    )
                if np.linalg.norm(rates - spun) > AGREES * np.linalg.norm(rates):
                    reader.remarks.append(f"{where} different rates from ANGVEL, which counts")
                if np.isnan(rates).any():
                    rates, nutation = spun, np.radians(columns.get("NUTATION", nutation))
                quaternion = np.where(np.isnan(quaternion), turn, quaternion)
            case "INERTIA":
                tensor = tensor_of(columns)
            case "MAN":
                torque = np.concatenate(list(columns.values()))
                start, duration, used = (
                    block.values.get(f"MAN_{key}")
                    for key in ("EPOCH_START", "DURATION", "DELTA_MASS")
                )
                if not torque.any():
                    block.fault(
                        "MAN_TOR_X", "the torque is zero; expected a component other than 0"
                    )
                if epoch is not None and start is not None and start < epoch:
                    block.fault("MAN_EPOCH_START", "begins before EPOCH, the start of the motion")
                elif epoch is not None and start is not None:
                    manoeuvres.append(Manoeuvre(start.since(epoch), duration or 0.0, torque, used))
    if np.isnan(rates).any() and not reader.faults:
        reader.fault(
            1, "ANGVEL", "missing; without an ANGVEL or a SPIN block the motion is not known"
        )
    if np.isnan(quaternion).any():
        reader.remarks.append("the message gives no attitude: frame and epoch are left out")
    reader.epochs += [] if epoch is None else [epoch]
    reader.motions.append((quaternion, rates, nutation))
    manoeuvres.sort(key=lambda manoeuvre: manoeuvre.start)
    return _contents(reader, about, tensor, manoeuvres=tuple(manoeuvres))


def _aem(reader: MessageReader, about: Fields, sections: list[BlockLines]) -> Contents:
    """Blocks of metadata, each with the data lines that follow it."""
    expected = ["META", "DATA"] * max(len(sections) // 2, 1)
    if [section.name for section in sections] != expected:
        reader.fault(1, "META_START", "expected pairs of META_START … and DATA_START …")
        raise FaultyFile([*reader.faults.values()])
    for metadata, data in zip(sections[::2], sections[1::2], strict=True):
        block = Fields(reader, metadata, message.AEM_METADATA)
        Fields(reader, data, ())
        about = about if "OBJECT_NAME" in about.values else block
        kind = block.values.get("ATTITUDE_TYPE")
        if kind is None:
            continue
        if kind.endswith("ANGVEL") and "ANGVEL_FRAME" not in block.lines:
            block.fault("ANGVEL_FRAME", f"missing; {kind} needs the frame of the rates")
        _take_rows(reader, block, data, message.AEM_RECORDS[kind].keywords[1:])
    return _contents(reader, about)


def _acm(reader: MessageReader, about: Fields, sections: list[BlockLines]) -> Contents:
    """Attitude of ATT, mass and inertia of PHYS; covariances and manoeuvres are not read."""
    missing = BlockLines("META", 1, [], [])
    metadata = next((part for part in sections if part.name == "META"), missing)
    about = Fields(reader, metadata, message.ACM_BLOCKS["META"].keywords)
    zero = about.values.get("EPOCH_TZERO")
    tensor = mass = None
    for section in sections:
        block = Fields(reader, section, message.ACM_BLOCKS[section.name].keywords)
        if section.name == "PHYS":
            tensor = tensor_of(block.columns(message.INERTIA))
            mass = block.values.get("WET_MASS")
            if "CP" in block.values:
                reader.remarks.append(
                    "CP is the center of pressure, from the center of mass: not used"
                )
        elif "ATT_TYPE" in block.values:
            rates = message.ACM_RATES[block.values.get("RATE_TYPE", "NONE")]
            keywords = (*message.ACM_ATTITUDES[block.values["ATT_TYPE"]], *rates)
            if block.values.get("NUMBER_STATES", len(keywords)) != len(keywords):
                block.fault(
                    "NUMBER_STATES", f"expected {len(keywords)}: {', '.join(names(keywords))}"
                )
            _take_rows(reader, block, section, keywords, zero)
    reader.epochs += [] if zero is None or reader.epochs else [zero]
    return _contents(reader, about, tensor, mass)


def _stk(reader: MessageReader) -> Contents:
    """Keywords, the line that names the columns, and data lines; case does not count."""
    spelling = {word.casefold(): word for word in (*names(message.STK_KEYWORDS), *message.STK_ROWS)}
    keywords, data = BlockLines("", 1, [], []), BlockLines("", 1, [], [])
    for line, content in reader.tokens[1:]:
        first, *rest = content.partition("#")[0].split() or ["begin"]
        word = spelling.get(first.casefold(), first)
        if word.casefold() == "end":
            break
        if data.name:
            data.rows.append((line, [first, *rest]))
        elif word.casefold().startswith("attitudetime"):
            data = data._replace(name=word, line=line)
        elif word.casefold() != "begin":
            keywords.entries.append((line, word, " ".join(rest), None))
    block = Fields(reader, keywords, message.STK_KEYWORDS)
    if data.name not in message.STK_ROWS:
        reader.fault(
            data.line,
            data.name,
            f"no columns that are read; expected a line {listed(list(message.STK_ROWS), 'or')}",
        )
        raise FaultyFile([*reader.faults.values()])
    if block.values.get("NumberOfAttitudePoints", len(data.rows)) != len(data.rows):
        block.fault("NumberOfAttitudePoints", f"there are {len(data.rows)}")
    _take_rows(reader, block, data, message.STK_ROWS[data.name], block.values.get("ScenarioEpoch"))
    return _contents(reader, block)
