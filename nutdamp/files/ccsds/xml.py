"""XML notation, CCSDS 504.0-B-2 section 7."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable
from itertools import groupby
from xml.etree.ElementTree import Element, SubElement, indent, tostring
from xml.parsers import expat

from nutdamp.errors import Fault
from nutdamp.files.ccsds.message import APM_BLOCKS, OPM_BLOCKS, Block, Entry, Keyword, Message

SCHEMA_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"

_TAGS = {layout.tag: name for name, layout in APM_BLOCKS.items()}
_BEGINNINGS = {
    codecs.BOM_UTF16_LE + b"<\0": "utf-16",
    codecs.BOM_UTF16_BE + b"\0<": "utf-16",
    b"<\0": "utf-16-le",
    b"\0<": "utf-16-be",
    codecs.BOM_UTF8 + b"<": "utf-8-sig",
}
"""First bytes of a document, by which its encoding is known before it is declared."""

_DECLARED = re.compile(rb"""\s*<\?xml\s[^>]*?\bencoding\s*=\s*["']([A-Za-z][A-Za-z0-9._-]*)["']""")
_STRUCTURE = ("header", "body", "segment", "metadata", "data")
_WRAPS = {keyword.tag for layout in APM_BLOCKS.values() for keyword in layout.keywords if keyword.tag}


def to_xml(message: Message) -> str:
    """The text of a message."""
    # Namespace and attributes are written as the standard prints them.
    root = Element(message.kind.lower(), {"xmlns:xsi": SCHEMA_INSTANCE, "id": f"CCSDS_{message.kind}_VERS"})
    root.set("version", message.version)
    _fill(SubElement(root, "header"), message.header)
    body = SubElement(root, "body")
    for segment in message.segments:
        place = SubElement(body, "segment")
        _fill(SubElement(place, "metadata"), segment.metadata)
        data = SubElement(place, "data")
        for block in segment.blocks:
            layout = {**APM_BLOCKS, **OPM_BLOCKS}.get(block.name)
            if layout is None:
                _fill(data, block)
            else:
                _fill(SubElement(data, layout.tag), block, layout.keywords)
        for record in segment.records:
            assert segment.record is not None
            tag, rows = segment.record
            entries = (Entry(row.name, value, row.unit) for row, value in zip(rows, record, strict=True))
            _entries(SubElement(SubElement(data, "attitudeState"), tag), entries, rows)
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


def is_xml(data: bytes) -> bool:
    """Whether the content of a file begins as XML does, in whatever encoding."""
    return data.lstrip().startswith((b"<", *_BEGINNINGS))


def from_xml(data: bytes, name: str) -> tuple[list[Block], list[Fault]]:
    """The blocks of an APM, the first of what is outside of blocks, and what is not of this notation.

    Lines count from 1; ``name`` is that of the file in faults. The encoding is the one declared, any that Python has a
    codec for. Document types, and with them entities, are refused.
    """
    encoding = _encoding(data)
    reader = _Reader(name)
    try:
        reader.parser.Parse(data.decode(encoding).encode(), True)
    except LookupError:
        reader.faults.append(Fault(name, 1, 1, "", f"the encoding {encoding!r} is not known; save it as UTF-8"))
    except UnicodeError as wrong:
        place = f" (byte {wrong.start})" if isinstance(wrong, UnicodeDecodeError) else ""
        reader.faults.append(Fault(name, 1, 1, "", f"the text is not {encoding}, as it says{place}; save it as UTF-8"))
    except expat.ExpatError as wrong:
        reader.faults.append(
            Fault(name, wrong.lineno, wrong.offset + 1, "", f"not XML: {expat.ErrorString(wrong.code)}")
        )
    except _Foreign as wrong:
        reader.faults.append(Fault(name, reader.parser.CurrentLineNumber, 1, "", str(wrong)))
    return [Block("", tuple(reader.outside), line=1), *reader.blocks], reader.faults


def _encoding(data: bytes) -> str:
    """The encoding of an XML text: by its first bytes, else the one declared, else UTF-8."""
    for beginning, encoding in _BEGINNINGS.items():
        if data.startswith(beginning):
            return encoding
    declared = _DECLARED.match(data)
    return declared[1].decode("ascii") if declared else "utf-8"


class _Reader:
    """Collects keywords with their lines; what wraps them is of no account but for the blocks."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.outside: list[Entry] = []
        self.blocks: list[Block] = []
        self.faults: list[Fault] = []
        self.parser = expat.ParserCreate("utf-8")  # whatever is declared: the text has been decoded
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
        raise _Foreign("the file has a document type; a message has none")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self.parser.CurrentLineNumber
        self._depth += 1
        if self._depth == 1:
            if tag != "apm":
                raise _Foreign(f"expected <apm>, got <{tag}>")
            self.outside.append(Entry("CCSDS_APM_VERS", attributes.get("version", ""), "", line))
        elif self._open is not None:
            self.faults.append(Fault(self.name, line, 1, tag, f"lies within {self._open[0]}, which holds a value"))
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
