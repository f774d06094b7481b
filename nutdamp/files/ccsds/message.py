"""Messages on attitude or orbit, whatever their notation: blocks of keywords, their tables, and KVN
and XML.

The tables are those of CCSDS 504.0-B-2: 3-1 to 3-3 (APM), 4-2 to 4-4 (AEM), 7-3 and 7-5 (tags in
XML); and of CCSDS 502.0-B-3: 3-1 to 3-3 (OPM). Keyword = value notation (KVN) follows CCSDS
504.0-B-2 section 6 (502.0-B-3 section 7 alike), XML section 7. Keywords are checked against their
tables, and every fault has its line: nothing is guessed.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Sequence
from decimal import Decimal
from itertools import groupby
from operator import attrgetter
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from nutdamp.common.time import UNIFORM, Epoch
from nutdamp.errors import Fault, FaultyFile, listed, nearest
from nutdamp.files.export import FRAMES
from nutdamp.files.yaml import decode, read_limited
from nutdamp.spacecraft.model import Vector

VERSION = "2.0"  # of APM and AEM in issue 2 of their standard; version 1 has other keywords

VERSION_OF = {"APM": VERSION, "AEM": VERSION, "OPM": "3.0"}

BODY_FRAME = "SC_BODY_1"

LONGEST_LINE = 254  # ASCII characters that a line may have
SIGNIFICANT = 16  # most digits that a number may have


class Keyword(NamedTuple):
    """One row of a table: its unit (None of texts), whether it must be there, and the XML tag
    besides the block's.
    """

    name: str
    unit: str | None = None
    required: bool = True
    tag: str = ""


class Layout:
    """A block: its tag in XML and its keywords in their order."""

    def __init__(self, tag: str, *keywords: Keyword) -> None:
        self.tag, self.keywords = tag, keywords


def _rows(
    *names: str, unit: str | None = None, required: bool = True, tag: str = ""
) -> tuple[Keyword, ...]:
    return tuple(Keyword(name, unit, required, tag) for name in names)


_FRAMES = _rows("REF_FRAME_A", "REF_FRAME_B")
_QUATERNION = _rows("Q1", "Q2", "Q3", "QC", unit="", tag="quaternion")
ANGVEL = ("ANGVEL_X", "ANGVEL_Y", "ANGVEL_Z")

_SPIN = (
    *_rows("SPIN_ALPHA", "SPIN_DELTA", "SPIN_ANGLE", unit="deg"),
    *_rows("SPIN_ANGLE_VEL", unit="deg/s"),
)
MOMENTUM = (
    "MOMENTUM_ALPHA",
    "MOMENTUM_DELTA",
    "NUTATION_VEL",
)  # direction of H, rate of the spin axis about it

HEADER = (
    *_rows("CLASSIFICATION", required=False),
    *_rows("CREATION_DATE", "ORIGINATOR"),
    *_rows("MESSAGE_ID", required=False),
)

APM_METADATA = (
    *_rows("OBJECT_NAME", "OBJECT_ID"),
    *_rows("CENTER_NAME", required=False),
    *_rows("TIME_SYSTEM"),
)

APM_BLOCKS: dict[str, Layout] = {
    "QUAT": Layout(
        "quaternionState",
        *_FRAMES,
        *_QUATERNION,
        *_rows(
            "Q1_DOT", "Q2_DOT", "Q3_DOT", "QC_DOT", unit="1/s", required=False, tag="quaternionDot"
        ),
    ),
    "EULER": Layout(
        "eulerAngleState",
        *_FRAMES,
        *_rows("EULER_ROT_SEQ"),
        *_rows("ANGLE_1", "ANGLE_2", "ANGLE_3", unit="deg"),
        *_rows("ANGLE_1_DOT", "ANGLE_2_DOT", "ANGLE_3_DOT", unit="deg/s", required=False),
    ),
    "ANGVEL": Layout(
        "angularVelocity", *_FRAMES, *_rows("ANGVEL_FRAME"), *_rows(*ANGVEL, unit="deg/s")
    ),
    "SPIN": Layout(
        "spin",
        *_FRAMES,
        *_SPIN,
        *_rows("NUTATION", unit="deg", required=False),
        *_rows("NUTATION_PER", unit="s", required=False),
        *_rows("NUTATION_PHASE", *MOMENTUM[:2], unit="deg", required=False),
        *_rows(MOMENTUM[2], unit="deg/s", required=False),
    ),
    "INERTIA": Layout(
        "inertia",
        *_rows("INERTIA_REF_FRAME"),
        *_rows("IXX", "IYY", "IZZ", "IXY", "IXZ", "IYZ", unit="kg*m**2"),
    ),
    "MAN": Layout(
        "maneuverParameters",
        *_rows("MAN_EPOCH_START"),
        *_rows("MAN_DURATION", unit="s"),
        *_rows("MAN_REF_FRAME"),
        *_rows("MAN_TOR_X", "MAN_TOR_Y", "MAN_TOR_Z", unit="N*m"),
        *_rows("MAN_DELTA_MASS", unit="kg", required=False),
    ),
}
"""The blocks of an APM's data, in their order."""

OPM_METADATA = _rows("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM")

OPM_BLOCKS: dict[str, Layout] = {
    "STATE": Layout(
        "stateVector",
        *_rows("EPOCH"),
        *_rows("X", "Y", "Z", unit="km"),
        *_rows("X_DOT", "Y_DOT", "Z_DOT", unit="km/s"),
    ),
    "SPACECRAFT": Layout("spacecraftParameters", *_rows("MASS", unit="kg", required=False)),
    "MANEUVER": Layout(
        "maneuverParameters",
        *_rows("MAN_EPOCH_IGNITION"),
        *_rows("MAN_DURATION", unit="s"),
        *_rows("MAN_DELTA_MASS", unit="kg"),
        *_rows("MAN_REF_FRAME"),
        *_rows("MAN_DV_1", "MAN_DV_2", "MAN_DV_3", unit="km/s"),
    ),
}
"""Keywords written in the blocks of an OPM, in their order; the names of the blocks are not in the
message.
"""

LAYOUTS = {**APM_BLOCKS, **OPM_BLOCKS}


AEM_METADATA = (
    *_rows("OBJECT_NAME", "OBJECT_ID"),
    *_rows("CENTER_NAME", required=False),
    *_rows("REF_FRAME_A", "REF_FRAME_B", "TIME_SYSTEM", "START_TIME"),
    *_rows("USEABLE_START_TIME", "USEABLE_STOP_TIME", required=False),
    *_rows("STOP_TIME", "ATTITUDE_TYPE"),
    *_rows("ANGVEL_FRAME", "INTERPOLATION_METHOD", "INTERPOLATION_DEGREE", required=False),
)
"""Table 4-3, but for the keywords of Euler angles."""

QUATERNION_ANGVEL, SPIN, SPIN_NUTATION_MOM = "QUATERNION/ANGVEL", "SPIN", "SPIN/NUTATION_MOM"
"""Values of ATTITUDE_TYPE."""

AEM_RECORDS = {
    QUATERNION_ANGVEL: Layout(
        "quaternionAngVel",
        *_rows("EPOCH"),
        *_QUATERNION,
        *_rows(*ANGVEL, unit="deg/s", tag="angVel"),
    ),
    SPIN: Layout("spin", *_rows("EPOCH"), *_SPIN),
    SPIN_NUTATION_MOM: Layout(
        "spinNutationMom",
        *_rows("EPOCH"),
        *_SPIN,
        *_rows(*MOMENTUM[:2], unit="deg"),
        *_rows(MOMENTUM[2], unit="deg/s"),
    ),
}
"""A data line of each ATTITUDE_TYPE (table 4-4)."""


class MessageEntry(NamedTuple):
    """A keyword (none in data lines) with its value, as texts.

    ``tag`` wraps it in XML besides that of the block; ``line`` counts from 1 in a message that was
    read.
    """

    keyword: str
    value: str
    unit: str | None = None
    tag: str = ""
    line: int = 0


class MessageBlock(NamedTuple):
    """Keywords that belong together; ``name`` is that of the layout, empty outside of blocks."""

    name: str
    entries: tuple[MessageEntry, ...]
    comments: tuple[str, ...] = ()
    line: int = 0


class Segment(NamedTuple):
    """Metadata and the data that they describe: blocks (APM), or records of the layout ``record``
    (AEM).
    """

    metadata: MessageBlock
    blocks: tuple[MessageBlock, ...] = ()
    records: tuple[tuple[str, ...], ...] = ()
    record: Layout | None = None


class Message(NamedTuple):
    """A whole message; ``kind`` is APM, AEM or OPM."""

    kind: str
    header: MessageBlock
    segments: tuple[Segment, ...]


Values = Sequence[str | float | None]


def block(name: str, keywords: tuple[Keyword, ...], values: Values, *comments: str) -> MessageBlock:
    """A block of ``values`` of the first ``keywords``, None where one is left out; numbers in the
    unit of the table.
    """
    entries = tuple(
        MessageEntry(
            keyword.name,
            value if isinstance(value, str) else number(value),
            keyword.unit,
            keyword.tag,
        )
        for keyword, value in zip(keywords, values, strict=False)
        if value is not None
    )
    return MessageBlock(name, entries, tuple(comment(text) for text in comments))


def number(value: float) -> str:
    """A number as the standard has it: at most 16 digits, at least one on either side of the point,
    no -0.
    """
    if value == 0.0:
        return "0.0"
    exact = Decimal(repr(float(value)))
    if len(exact.as_tuple().digits) > SIGNIFICANT:
        exact = Decimal(f"{value:.{SIGNIFICANT - 1}e}")
    exact = exact.normalize()
    fixed = f"{exact:f}"
    if "." not in fixed:
        fixed += ".0"
    if sum(character.isdigit() for character in fixed) <= SIGNIFICANT:
        return fixed
    sign, digits, _ = exact.as_tuple()
    first, *rest = (str(digit) for digit in digits)
    return f"{'-' * sign}{first}.{''.join(rest) or '0'}E{exact.adjusted():+03d}"


def label(text: str) -> str:
    """A name as a value of the standard: printable ASCII in capitals; UNKNOWN where nothing is
    left.
    """
    return " ".join(_ascii(text).upper().split())[:200] or "UNKNOWN"


def comment(text: str) -> str:
    """A comment as the standard has it: printable ASCII, short enough for one line."""
    return _ascii(text)[: LONGEST_LINE - len("COMMENT ")]


def _ascii(text: str) -> str:
    """Text in ASCII: accents and other characters are dropped."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return "".join(character if character.isprintable() else " " for character in plain)


SCHEMA_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"


def to_xml(message: Message) -> str:
    """The text of a message."""
    # Namespace and attributes are written as the standard prints them.
    versioned = {"id": f"CCSDS_{message.kind}_VERS", "version": VERSION_OF[message.kind]}
    root = Element(message.kind.lower(), {"xmlns:xsi": SCHEMA_INSTANCE, **versioned})
    _fill(SubElement(root, "header"), message.header)
    body = SubElement(root, "body")
    for segment in message.segments:
        place = SubElement(body, "segment")
        _fill(SubElement(place, "metadata"), segment.metadata)
        data = SubElement(place, "data")
        for part in segment.blocks:
            _fill(SubElement(data, LAYOUTS[part.name].tag) if part.name else data, part)
        for record in segment.records:
            assert segment.record is not None
            place = SubElement(SubElement(data, "attitudeState"), segment.record.tag)
            _fill(place, block("", segment.record.keywords, record))
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, encoding="unicode")}\n'


def _fill(place: Element, block: MessageBlock) -> None:
    for comment in block.comments:
        SubElement(place, "COMMENT").text = comment
    for tag, group in groupby(block.entries, attrgetter("tag")):
        parent = SubElement(place, tag) if tag else place
        for entry in group:
            SubElement(
                parent, entry.keyword, {"units": entry.unit} if entry.unit else {}
            ).text = entry.value


_PAIR = re.compile(r"([A-Z0-9_]+)\s*=\s*(.*?)(?:\s+\[([^\]]*)\])?")
_WORD = re.compile(r"[A-Z0-9_]+")
_LINE_END = re.compile(r"\r\n|\n\r|\n|\r")


def to_kvn(message: Message) -> str:
    """The text of a message."""
    lines = [f"CCSDS_{message.kind}_VERS = {VERSION_OF[message.kind]}", *_block(message.header)]
    for segment in message.segments:
        metadata = _block(segment.metadata)
        lines += (
            ["", "META_START", *metadata, "META_STOP"] if message.kind == "AEM" else ["", *metadata]
        )
        for block in segment.blocks:
            inside = _block(block)
            named = block.name in APM_BLOCKS
            lines += (
                ["", f"{block.name}_START", *inside, f"{block.name}_STOP"]
                if named
                else ["", *inside]
            )
        if segment.records:
            lines += [
                "",
                "DATA_START",
                *(" ".join(record) for record in segment.records),
                "DATA_STOP",
            ]
    return "\n".join(lines) + "\n"


def _block(block: MessageBlock) -> list[str]:
    width = max((len(entry.keyword) for entry in block.entries), default=0)
    return [
        *(f"COMMENT {comment}" for comment in block.comments),
        *(
            f"{word:<{width}} = {value}" + (f" [{unit}]" if unit else "")
            for word, value, unit, *_ in block.entries
        ),
    ]


LARGEST = 1e15  # larger magnitudes are nothing physical
MOST_BYTES = 16 << 20  # size of a message, many times more than its most manoeuvres take


BEFORE = b"\xef\xbb\xbf\xff\xfe\0 \t\r\n"
"""Bytes that may come before the first character of a text, in UTF-8 and UTF-16."""

VERSIONS = re.compile("CCSDS_[A-Z]+_VERS")  # first keywords of messages


_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


class Checked:
    """A block by keyword; problems are faults of its message,
    and an unreadable value is then None.
    """

    def __init__(
        self, message: MessageReader, block: MessageBlock, keywords: tuple[Keyword, ...]
    ) -> None:
        self.message, self.block = message, block
        self.entries: dict[str, MessageEntry] = {}
        self._numbers: dict[str, float] = {}
        known = {keyword.name: keyword for keyword in keywords}
        order = list(known)
        last = ""
        for entry in block.entries:
            name = entry.keyword
            if name not in known:
                close = nearest(name, order)
                cure = f"did you mean {close}?" if close else f"known here: {', '.join(order)}"
                message.fault(entry.line, name, f"unknown keyword; {cure}")
            elif name in self.entries:
                message.fault(
                    entry.line, name, f"given again, first in line {self.entries[name].line}"
                )
            else:
                self.entries[name] = entry
                if last and order.index(name) < order.index(last):
                    self.fault(
                        name, f"comes after {last}; the order of the standard is {', '.join(order)}"
                    )
                else:
                    last = name
                unit = known[name].unit
                if not entry.value:
                    self.fault(name, "empty; expected a value")
                elif unit is not None and not _NUMBER.fullmatch(entry.value):
                    self.fault(name, f"{entry.value[:40]!r} is not a number")
                elif unit is not None and not abs(float(entry.value)) <= LARGEST:
                    self.fault(name, f"{entry.value[:40]} is beyond anything physical")
                elif unit is not None:
                    self._numbers[name] = float(entry.value)
                if entry.unit and entry.unit != unit:
                    expected = f"[{unit}]" if unit else "no unit"
                    self.fault(name, f"expected {expected}, got [{entry.unit}]")
        for keyword in keywords:
            if keyword.required and keyword.name not in self.entries:
                self.fault(
                    keyword.name, f"missing{f' in this {block.name} block' if block.name else ''}"
                )

    def fault(self, keyword: str, problem: str) -> None:
        """Something wrong with a keyword, or, where it is missing, with the block."""
        self.message.fault(self.entries.get(keyword, self.block).line, keyword, problem)

    def text(self, keyword: str) -> str | None:
        """The value as it is; None where it is missing or empty."""
        return self.entries[keyword].value or None if keyword in self.entries else None

    def number(self, keyword: str) -> float | None:
        """The value as a number."""
        return self._numbers.get(keyword)

    def numbers(self, *keywords: str) -> list[float] | None:
        """Several numbers; None where one cannot be read."""
        values = [self._numbers[keyword] for keyword in keywords if keyword in self._numbers]
        return values if len(values) == len(keywords) else None

    def epoch(self, keyword: str, system: str) -> Epoch | None:
        """The value as a moment of a time system, see `Epoch.parse`."""
        text = self.text(keyword)
        try:
            return None if text is None else Epoch.parse(text, system)
        except ValueError as wrong:
            self.fault(keyword, str(wrong))
            return None

    def has(self, keywords: Sequence[str]) -> bool:
        """True where all of ``keywords`` are here; some without the others is a fault."""
        there = [keyword for keyword in keywords if keyword in self.entries]
        absent = [keyword for keyword in keywords if keyword not in there]
        if there and absent:
            self.fault(there[0], f"given without {absent[0]}; {', '.join(keywords)} go together")
        return not absent


UNIT = 1e-4  # deviation from length one up to which a quaternion counts as rounded


def unit_quaternion(parts: list[float]) -> Vector:
    """The quaternion (4,) of a message, made length one; raises ValueError where it is off by more
    than rounding.
    """
    length = math.hypot(*parts)
    if not math.isclose(length, 1.0, abs_tol=UNIT):
        raise ValueError(f"the quaternion has length {length:.6g}; expected 1")
    return np.array(parts) / length


SAME_AXES = {"ICRF": "GCRF"}  # frames whose axes are those of another that a spacecraft file knows
BODY = re.compile(r"SC_BODY(_[A-Z0-9]+)?")  # frames fixed in the body


class MessageReader:
    """Reader of a message in KVN that begins with ``keyword``: its blocks, which share frames and a
    time system.

    Raises CannotRead, or FaultyFile for XML, another message, and another version, which makes no
    sense by the tables.
    """

    def __init__(self, path: str, keyword: str) -> None:
        self.path, self.faults, self.remarks = path, list[Fault](), list[str]()
        self.body: str | None = None
        self.frame: str | None = None
        self.system = "UTC"
        data = read_limited(path, MOST_BYTES)
        if data.lstrip(BEFORE).startswith(b"<"):
            cure = "write the message in keyword = value notation (KVN)"
            raise FaultyFile([Fault(path, 1, 1, "", f"XML is not read; {cure}")])
        begun: list[tuple[str, int, list[MessageEntry]]] = [("", 1, [])]
        within: str | None = None
        for line, raw in enumerate(_LINE_END.split(decode(data, path)), start=1):
            content = raw.strip()
            if not content or content.split(maxsplit=1)[0] == "COMMENT":
                continue
            pair = _PAIR.fullmatch(content)
            entries = begun[0 if within is None else -1][2]
            if within == "DATA" and content not in ("DATA_START", "DATA_STOP"):
                entries.append(MessageEntry("", content, line=line))
            elif pair is not None:
                entries.append(MessageEntry(pair[1], pair[2], pair[3], line=line))
            elif _WORD.fullmatch(content) and content.endswith("_START"):
                if within is not None:
                    self.fault(line, content, f"{within}_STOP is missing before it")
                within = content.removesuffix("_START")
                begun.append((within, line, []))
            elif within is not None and content == f"{within}_STOP":
                within = None
            elif _WORD.fullmatch(content) and content.endswith("_STOP"):
                self.fault(
                    line,
                    content,
                    "no block is open" if within is None else f"expected {within}_STOP",
                )
            else:
                self.fault(line, "", f"{content[:40]!r} is no KEYWORD = value")
        if within is not None:
            self.fault(begun[-1][1], f"{within}_START", f"{within}_STOP is missing")
        blocks = [MessageBlock(word, tuple(entries), line=line) for word, line, entries in begun]
        self.outside, *self.blocks = blocks  # first what is in no block
        first = next(iter(self.outside.entries), None)
        if first is None or not VERSIONS.fullmatch(first.keyword):
            self.fault(
                1, "", f"not an {keyword.split('_')[1]}: its first line is {keyword} = {VERSION}"
            )
            raise FaultyFile(self.faults)
        if first.keyword != keyword:
            raise FaultyFile(
                [Fault(path, first.line, 1, first.keyword, f"another message; expected {keyword}")]
            )
        if first.value != VERSION:
            problem = (
                f"version {first.value!r} is not read, its keywords are others; "
                f"expected version {VERSION}"
            )
            raise FaultyFile([Fault(path, first.line, 1, keyword, problem)])

    def fault(self, line: int, where: str, problem: str) -> None:
        """Keep a fault of the message."""
        self.faults.append(Fault(self.path, line, 1, where, problem))

    def take_system(self, block: Checked) -> None:
        """Take the time system of the metadata."""
        self.system = block.text("TIME_SYSTEM") or "UTC"
        if self.system not in ("UTC", *UNIFORM):
            block.fault(
                "TIME_SYSTEM", f"expected UTC, {listed(list(UNIFORM), 'or')}, got {self.system!r}"
            )
            self.system = "UTC"
        elif self.system != "UTC":
            self.remark(f"times are {self.system}; the spacecraft file has them in UTC")

    def endpoints(self, block: Checked, *, reversible: bool = True) -> bool | None:
        """True where the block leads from inertial frame to body, False for the reverse; None for
        other frames.
        """
        first, second = block.text("REF_FRAME_A"), block.text("REF_FRAME_B")
        if first is None or second is None:
            return None
        forward = BODY.fullmatch(second) is not None
        inertial, body = (first, second) if forward else (second, first)
        keyword, other = ("REF_FRAME_A", "REF_FRAME_B")[:: 1 if forward else -1]
        if not BODY.fullmatch(body):
            block.fault(
                "REF_FRAME_B", f"{second!r}: one of the two frames must be the body, SC_BODY_1"
            )
            return None
        if inertial not in (*FRAMES, *SAME_AXES):
            block.fault(
                keyword,
                (
                    f"{inertial!r} is no inertial frame known here; "
                    f"expected one of {', '.join(FRAMES)}"
                ),
            )
            return None
        if not forward and not reversible:
            block.fault(
                "REF_FRAME_A",
                "the body comes first; this block leads from the inertial frame to the body",
            )
            return None
        self.body_frame(block, other, body)
        known = SAME_AXES.get(inertial, inertial)
        if known != inertial:
            self.remark(f"{inertial} is taken as {known}, whose axes are the same")
        if self.frame not in (None, known):
            block.fault(
                keyword, f"{inertial!r} here, {self.frame!r} in another block; expected one frame"
            )
        self.frame = self.frame or known
        return forward

    def body_frame(self, block: Checked, keyword: str, frame: str | None) -> None:
        """Every block must mean the same body axes."""
        if frame is None:
            return
        if not BODY.fullmatch(frame):
            block.fault(keyword, f"{frame!r} is no frame fixed in the body; expected SC_BODY_1")
        elif self.body not in (None, frame):
            block.fault(
                keyword, f"{frame!r} here, {self.body!r} in another block; expected one body frame"
            )
        else:
            self.body = frame

    def rates_in_body(self, block: Checked, axes: str) -> bool:
        """True for rates along the axes of the body, False for those of the inertial frame, a fault
        for others.
        """
        in_body = BODY.fullmatch(axes) is not None
        if not in_body and SAME_AXES.get(axes, axes) != self.frame:
            block.fault("ANGVEL_FRAME", f"{axes!r} is neither REF_FRAME_A nor REF_FRAME_B")
        return in_body

    def remark(self, text: str) -> None:
        """Take a remark for the reader, once."""
        if text not in self.remarks:
            self.remarks.append(text)
