"""Blocks that were read, held against their tables: every keyword known, once, in order, of the right form."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from nutdamp.epoch import Epoch
from nutdamp.errors import Fault, nearest
from nutdamp.files.ccsds.message import Block, Entry, Keyword

LARGEST = 1e15
"""Larger magnitudes are nothing physical."""

_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


class Checked:
    """A block by keyword; what is wrong goes to ``faults``, and what cannot be read is then None."""

    def __init__(self, file: str, block: Block, keywords: tuple[Keyword, ...], faults: list[Fault]) -> None:
        self.file, self.block, self.faults = file, block, faults
        self.entries: dict[str, Entry] = {}
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

    def _form(self, entry: Entry, keyword: Keyword) -> None:
        """Whether the value is of the kind that the table has, in its unit."""
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
        found = [self.number(keyword) for keyword in keywords]
        return None if any(value is None for value in found) else [value for value in found if value is not None]

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
        """Whether all of ``keywords`` are here; some without the others is a fault."""
        expected = list(keywords)
        there = [keyword for keyword in expected if keyword in self.entries]
        if there and len(there) < len(expected):
            absent = next(keyword for keyword in expected if keyword not in there)
            self.fault(there[0], f"given without {absent}; {', '.join(expected)} go together")
            return False
        return bool(there)


def unit_length(parts: list[float], tolerance: float) -> bool:
    """Whether the parts are those of a unit vector, but for rounding of what was written."""
    return math.isclose(math.hypot(*parts), 1.0, abs_tol=tolerance)
