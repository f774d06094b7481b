"""XML notation, CCSDS 504.0-B-2 section 7."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from xml.etree.ElementTree import Element, SubElement, indent, tostring
from xml.parsers import expat

from nutdamp.errors import Fault
from nutdamp.files.ccsds.message import AEM_RECORD, APM_BLOCKS, VERSION, Block, Entry, Keyword, Message

SCHEMA_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"

_TAGS = {layout.tag: name for name, layout in APM_BLOCKS.items()}
_STRUCTURE = ("header", "body", "segment", "metadata", "data")
_WRAPS = {keyword.tag for layout in APM_BLOCKS.values() for keyword in layout.keywords if keyword.tag}


def to_xml(message: Message) -> str:
    """The text of a message."""
    # Namespace and attributes are written as the standard prints them.
    root = Element(message.kind.lower(), {"xmlns:xsi": SCHEMA_INSTANCE, "id": f"CCSDS_{message.kind}_VERS"})
    root.set("version", VERSION)
    _fill(SubElement(root, "header"), message.header)
    body = SubElement(root, "body")
    for segment in message.segments:
        place = SubElement(body, "segment")
        _fill(SubElement(place, "metadata"), segment.metadata)
        data = SubElement(place, "data")
        for block in segment.blocks:
            layout = APM_BLOCKS.get(block.name)
            if layout is None:
                _fill(data, block)
            else:
                _fill(SubElement(data, layout.tag), block, layout.keywords)
        for record in segment.records:
            state = SubElement(SubElement(data, "attitudeState"), "quaternionAngVel")
            entries = (Entry(row.name, value, row.unit) for row, value in zip(AEM_RECORD, record, strict=True))
            _entries(state, entries, AEM_RECORD)
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, encoding="unicode")}\n'


def _fill(place: Element, block: Block, keywords: tuple[Keyword, ...] = ()) -> None:
    for comment in block.comments:
        SubElement(place, "COMMENT").text = comment
    _entries(place, block.entries, keywords)


def _entries(place: Element, entries: Iterable[Entry], keywords: tuple[Keyword, ...]) -> None:
    wraps = {keyword.name: keyword.tag for keyword in keywords}
    for tag, group in groupby(entries, lambda entry: wraps.get(entry.keyword, "")):
        parent = SubElement(place, tag) if tag else place
        for entry in group:
            SubElement(parent, entry.keyword, {"units": entry.unit} if entry.unit else {}).text = entry.value


class _Foreign(Exception):
    """XML that is refused as a whole."""


def from_xml(text: str, name: str) -> tuple[list[Block], list[Fault]]:
    """The blocks of an APM, the first of what stands outside of blocks, and what is not of this notation.

    Lines count from 1; ``name`` stands for the file in faults. Document types, and with them entities, are refused.
    """
    reader = _Reader(name)
    try:
        reader.parser.Parse(text.encode(), True)
    except expat.ExpatError as wrong:
        reader.faults.append(
            Fault(name, wrong.lineno, wrong.offset + 1, "", f"not XML: {expat.ErrorString(wrong.code)}")
        )
    except _Foreign as wrong:
        reader.faults.append(Fault(name, reader.parser.CurrentLineNumber, 1, "", str(wrong)))
    return [Block("", tuple(reader.outside), line=1), *reader.blocks], reader.faults


class _Reader:
    """Collects keywords with their lines; what wraps them is of no account but for the blocks."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.outside: list[Entry] = []
        self.blocks: list[Block] = []
        self.faults: list[Fault] = []
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._data
        self.parser.StartDoctypeDeclHandler = self._doctype
        self._block: tuple[str, int] | None = None
        self._entries: list[Entry] = []
        self._open: tuple[str, str, int] | None = None
        self._text: list[str] = []
        self._depth = 0

    def _doctype(self, *_: object) -> None:
        raise _Foreign("a document type stands in the file; a message has none")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        self._depth += 1
        if self._depth == 1:
            if tag != "apm":
                raise _Foreign(f"<{tag}> stands where <apm> is wanted")
            self.outside.append(Entry("CCSDS_APM_VERS", attributes.get("version", ""), "", line))
        elif self._open is not None:
            self.faults.append(Fault(self.name, line, 1, tag, f"stands within {self._open[0]}, which holds a value"))
        elif tag in _TAGS and self._block is None:
            self._block, self._entries = (_TAGS[tag], line), []
        elif tag.upper() == tag:
            self._open, self._text = (tag, attributes.get("units", ""), line), []
        elif tag not in _STRUCTURE and tag not in _WRAPS:
            self.faults.append(Fault(self.name, line, 1, tag, "unknown tag"))

    def _data(self, text: str) -> None:
        if self._open is not None:
            self._text.append(text)

    def _end(self, tag: str) -> None:
        self._depth -= 1
        if self._open is not None and tag == self._open[0]:
            keyword, unit, line = self._open
            if keyword != "COMMENT":
                entry = Entry(keyword, "".join(self._text).strip(), unit, line)
                (self.outside if self._block is None else self._entries).append(entry)
            self._open = None
        elif self._block is not None and _TAGS.get(tag) == self._block[0]:
            self.blocks.append(Block(self._block[0], tuple(self._entries), line=self._block[1]))
            self._block = None
