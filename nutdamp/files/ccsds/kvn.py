"""Keyword = value notation, CCSDS 504.0-B-2 section 6 (502.0-B-3 section 7 alike): messages as plain text."""

from __future__ import annotations

import re

from nutdamp.errors import Fault
from nutdamp.files.ccsds.message import APM_BLOCKS, Block, Entry, Message

_PAIR = re.compile(r"([A-Z0-9_]+)\s*=\s*(.*?)(?:\s+\[([^\]]*)\])?")
_WORD = re.compile(r"[A-Z0-9_]+")
_LINE_END = re.compile(r"\r\n|\n\r|\n|\r")


def to_kvn(message: Message) -> str:
    """The text of a message."""
    lines = [f"CCSDS_{message.kind}_VERS = {message.version}", *_block(message.header)]
    for segment in message.segments:
        metadata = _block(segment.metadata)
        if message.kind == "AEM":
            lines += ["", "META_START", *metadata, "META_STOP"]
        else:
            lines += ["", *metadata]
        for block in segment.blocks:
            inside, named = _block(block), block.name in APM_BLOCKS
            lines += ["", f"{block.name}_START", *inside, f"{block.name}_STOP"] if named else ["", *inside]
        if segment.records:
            lines += ["", "DATA_START", *(" ".join(record) for record in segment.records), "DATA_STOP"]
    return "\n".join(lines) + "\n"


def _block(block: Block) -> list[str]:
    width = max((len(entry.keyword) for entry in block.entries), default=0)
    return [
        *(f"COMMENT {comment}" for comment in block.comments),
        *(
            f"{entry.keyword:<{width}} = {entry.value}" + (f" [{entry.unit}]" if entry.unit else "")
            for entry in block.entries
        ),
    ]


def from_kvn(text: str, name: str) -> tuple[list[Block], list[Fault]]:
    """The blocks of an APM, the first of what is outside of blocks, and what is not of this notation.

    Lines count from 1; ``name`` is that of the file in faults.
    """
    outside: list[Entry] = []
    blocks: list[Block] = []
    faults: list[Fault] = []
    within: tuple[str, int] | None = None
    entries: list[Entry] = []
    for line, raw in enumerate(_LINE_END.split(text), start=1):
        content = raw.strip()
        if not content or content.split(maxsplit=1)[0] == "COMMENT":
            continue
        pair = _PAIR.fullmatch(content)
        if pair is not None:
            entry = Entry(pair[1], pair[2], pair[3] or "", line)
            (outside if within is None else entries).append(entry)
        elif _WORD.fullmatch(content) and content.endswith("_START"):
            if within is not None:
                faults.append(Fault(name, line, 1, content, f"{within[0]}_STOP is missing before it"))
                blocks.append(Block(within[0], tuple(entries), line=within[1]))
            within, entries = (content.removesuffix("_START"), line), []
        elif _WORD.fullmatch(content) and content.endswith("_STOP"):
            if within is None or content != f"{within[0]}_STOP":
                expected = "no block is open" if within is None else f"expected {within[0]}_STOP"
                faults.append(Fault(name, line, 1, content, expected))
            else:
                blocks.append(Block(within[0], tuple(entries), line=within[1]))
                within = None
        else:
            faults.append(Fault(name, line, 1, "", f"{content[:40]!r} is no KEYWORD = value"))
    if within is not None:
        faults.append(Fault(name, within[1], 1, f"{within[0]}_START", f"{within[0]}_STOP is missing"))
        blocks.append(Block(within[0], tuple(entries), line=within[1]))
    return [Block("", tuple(outside), line=1), *blocks], faults
