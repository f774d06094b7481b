"""XML notation, CCSDS 504.0-B-2 section 7."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from nutdamp.files.ccsds.message import APM_BLOCKS, OPM_BLOCKS, Block, Entry, Keyword, Message

SCHEMA_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"


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
