"""Keywords of messages checked against their tables, and the frames between which their attitudes lead.

Every fault has its line. Other readers take what breaks the standard in silence: swapped frames, quaternions of any
length, no epoch. Here nothing is guessed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from nutdamp.common.time import UNIFORM, Epoch
from nutdamp.errors import Fault, FaultyFile, listed, nearest
from nutdamp.files.ccsds.message import Keyword, MessageBlock, MessageEntry
from nutdamp.files.export import FRAMES
from nutdamp.files.yaml import read_limited, utf8_text

LARGEST = 1e15
"""Larger magnitudes are nothing physical."""

MOST_BYTES = 16 << 20
"""Size of a message, many times more than its most manoeuvres take."""


BEFORE = b"\xef\xbb\xbf\xff\xfe\0 \t\r\n"
"""Bytes that may come before the first character of a text, in UTF-8 and UTF-16."""

VERSIONS = re.compile("CCSDS_[A-Z]+_VERS")
"""First keywords of messages."""


def kvn_text(path: str) -> str:
    """Text of a message in keyword = value notation; raises CannotRead, or FaultyFile for XML."""
    data = read_limited(path, MOST_BYTES)
    if data.lstrip(BEFORE).startswith(b"<"):
        cure = "write the message in keyword = value notation (KVN)"
        raise FaultyFile([Fault(path, 1, 1, "", f"XML is not read; {cure}")])
    return utf8_text(data, path)


def expect_version(path: str, outside: MessageBlock, keyword: str, version: str, faults: list[Fault]) -> None:
    """Raise FaultyFile for another message, or another version of it, which makes no sense by these tables."""
    first = outside.entries[0] if outside.entries else None
    if first is None or not VERSIONS.fullmatch(first.keyword):
        kind = keyword.split("_")[1]
        raise FaultyFile([*faults, Fault(path, 1, 1, "", f"not an {kind}: its first line is {keyword} = {version}")])
    if first.keyword != keyword:
        raise FaultyFile([Fault(path, first.line, 1, first.keyword, f"another message; expected {keyword}")])
    if first.value != version:
        problem = f"version {first.value!r} is not read, its keywords are others; expected version {version}"
        raise FaultyFile([Fault(path, first.line, 1, keyword, problem)])


_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


class Checked:
    """A block by keyword; problems go to ``faults``, and an unreadable value is then None."""

    def __init__(self, file: str, block: MessageBlock, keywords: tuple[Keyword, ...], faults: list[Fault]) -> None:
        self.file, self.block, self.faults = file, block, faults
        self.entries: dict[str, MessageEntry] = {}
        self._known = {keyword.name: keyword for keyword in keywords}
        self._fill()
        for keyword in keywords:
            if keyword.required and keyword.name not in self.entries:
                self.fault(keyword.name, f"missing{f' in this {block.name} block' if block.name else ''}")

    def _fill(self) -> None:
        order = list(self._known)
        last = ""
        for entry in self.block.entries:
            name = entry.keyword
            if name not in self._known:
                close = nearest(name, order)
                cure = f"did you mean {close}?" if close else f"known here: {', '.join(order)}"
                self.faults.append(Fault(self.file, entry.line, 1, name, f"unknown keyword; {cure}"))
            elif name in self.entries:
                first = self.entries[name].line
                self.faults.append(Fault(self.file, entry.line, 1, name, f"given again, first in line {first}"))
            else:
                self.entries[name] = entry
                if last and order.index(name) < order.index(last):
                    self.fault(name, f"comes after {last}; the order of the standard is {', '.join(order)}")
                else:
                    last = name
                self._form(entry, self._known[name])

    def _form(self, entry: MessageEntry, keyword: Keyword) -> None:
        """Check that the value is of the kind in the table, and in its unit."""
        if not entry.value:
            self.fault(keyword.name, "empty; expected a value")
        elif not keyword.text and not _NUMBER.fullmatch(entry.value):
            self.fault(keyword.name, f"{entry.value[:40]!r} is not a number")
        elif not keyword.text and not abs(float(entry.value)) <= LARGEST:
            self.fault(keyword.name, f"{entry.value[:40]} is beyond anything physical")
        if entry.unit and entry.unit != keyword.unit:
            expected = f"[{keyword.unit}]" if keyword.unit else "no unit"
            self.fault(keyword.name, f"expected {expected}, got [{entry.unit}]")

    def fault(self, keyword: str, problem: str) -> None:
        """Something wrong with a keyword, or, where it is missing, with the block."""
        entry = self.entries.get(keyword)
        line = self.block.line if entry is None else entry.line
        self.faults.append(Fault(self.file, line, 1, keyword, problem))

    def text(self, keyword: str) -> str | None:
        """The value as it is; None where it is missing or empty."""
        entry = self.entries.get(keyword)
        return entry.value or None if entry else None

    def number(self, keyword: str) -> float | None:
        """The value as a number."""
        text = self.text(keyword)
        if text is None or not _NUMBER.fullmatch(text) or not abs(float(text)) <= LARGEST:
            return None
        return float(text)

    def numbers(self, *keywords: str) -> list[float] | None:
        """Several numbers; None where one cannot be read."""
        values = [self.number(keyword) for keyword in keywords]
        return None if None in values else [value for value in values if value is not None]

    def epoch(self, keyword: str, system: str) -> Epoch | None:
        """The value as a moment of a time system, see `Epoch.parse`."""
        text = self.text(keyword)
        if text is None:
            return None
        try:
            return Epoch.parse(text, system)
        except ValueError as wrong:
            self.fault(keyword, str(wrong))
            return None

    def has(self, keywords: Iterable[str]) -> bool:
        """True where all of ``keywords`` are here; some without the others is a fault."""
        expected = list(keywords)
        there = [keyword for keyword in expected if keyword in self.entries]
        if there and len(there) < len(expected):
            absent = next(keyword for keyword in expected if keyword not in there)
            self.fault(there[0], f"given without {absent}; {', '.join(expected)} go together")
            return False
        return bool(there)


def unit_length(parts: list[float], tolerance: float) -> bool:
    """True where the parts are those of a unit vector, but for rounding in the message."""
    return math.isclose(math.hypot(*parts), 1.0, abs_tol=tolerance)


UNIT = 1e-4
"""Deviation from length one up to which a quaternion counts as rounded."""

SAME_AXES = {"ICRF": "GCRF"}
"""Frames whose axes are those of another that a spacecraft file knows."""

BODY = re.compile(r"SC_BODY(_[A-Z0-9]+)?")
"""Frames fixed in the body."""


class Frames:
    """Inertial and body frame of all blocks of one message, and its time system; problems go to the blocks."""

    def __init__(self) -> None:
        self.remarks: list[str] = []
        self.body: str | None = None
        self.frame: str | None = None
        self.system = "UTC"

    def take_system(self, block: Checked) -> None:
        """Take the time system of the metadata."""
        self.system = block.text("TIME_SYSTEM") or "UTC"
        if self.system not in ("UTC", *UNIFORM):
            block.fault("TIME_SYSTEM", f"expected UTC, {listed(list(UNIFORM), 'or')}, got {self.system!r}")
            self.system = "UTC"
        elif self.system != "UTC":
            self.remark(f"times are {self.system}; the spacecraft file has them in UTC")

    def endpoints(self, block: Checked, *, reversible: bool = True) -> bool | None:
        """True where the block leads from inertial frame to body, False for the reverse; None for other frames."""
        first, second = block.text("REF_FRAME_A"), block.text("REF_FRAME_B")
        if first is None or second is None:
            return None
        forward = BODY.fullmatch(second) is not None
        inertial, body = (first, second) if forward else (second, first)
        keyword = "REF_FRAME_A" if forward else "REF_FRAME_B"
        if not BODY.fullmatch(body):
            block.fault("REF_FRAME_B", f"{second!r}: one of the two frames must be the body, SC_BODY_1")
            return None
        if inertial not in (*FRAMES, *SAME_AXES):
            block.fault(keyword, f"{inertial!r} is no inertial frame known here; expected one of {', '.join(FRAMES)}")
            return None
        if not forward and not reversible:
            block.fault("REF_FRAME_A", "the body comes first; this block leads from the inertial frame to the body")
            return None
        self.body_frame(block, "REF_FRAME_B" if forward else "REF_FRAME_A", body)
        known = SAME_AXES.get(inertial, inertial)
        if known != inertial:
            self.remark(f"{inertial} is taken as {known}, whose axes are the same")
        if self.frame not in (None, known):
            block.fault(keyword, f"{inertial!r} here, {self.frame!r} in another block; expected one frame")
        self.frame = self.frame or known
        return forward

    def body_frame(self, block: Checked, keyword: str, frame: str | None) -> None:
        """Every block must mean the same body axes."""
        if frame is None:
            return
        if not BODY.fullmatch(frame):
            block.fault(keyword, f"{frame!r} is no frame fixed in the body; expected SC_BODY_1")
        elif self.body not in (None, frame):
            block.fault(keyword, f"{frame!r} here, {self.body!r} in another block; expected one body frame")
        else:
            self.body = frame

    def remark(self, text: str) -> None:
        """Take a remark for the reader, once."""
        if text not in self.remarks:
            self.remarks.append(text)
