"""Reads the topics of the guide from the Markdown files beside this module.

``# name :: summary`` begins a topic and ``## title`` a part of it. Blank lines separate blocks: lines indented by four
are a formula, ``- name :: text`` a row, ``$`` a command line (two blanks where it may be broken), all else a paragraph.
"""

from __future__ import annotations

import re
from pathlib import Path

from nutdamp.guide.topic import Block, Commands, Formula, Part, Rows, Topic


def topics(file: str) -> tuple[Topic, ...]:
    """The topics of ``file``, in order."""
    text = Path(__file__).with_name(file).read_text(encoding="utf-8")
    return tuple(map(_topic, _sections(text, "# ")[1:]))


def _sections(text: str, mark: str) -> list[str]:
    """What comes before the first line that begins with ``mark``, and behind each of them."""
    return f"\n{text}".split(f"\n{mark}")


def _topic(text: str) -> Topic:
    name, _, rest = text.partition(" :: ")
    summary, _, body = rest.partition("\n")
    first, *others = _sections(body, "## ")
    parts = [("", first)] if first.strip() else []
    titled = (tuple(other.split("\n", 1)) for other in others)
    return Topic(name, summary, tuple(Part(title, _blocks(blocks)) for title, blocks in (*parts, *titled)))


def _blocks(text: str) -> tuple[Block, ...]:
    return tuple(map(_block, re.split(r"\n\n+", text.strip("\n"))))


def _block(text: str) -> Block:
    lines = text.split("\n")
    if text.startswith("    "):
        return Formula(tuple(line[4:] for line in lines))
    if text.startswith("$ "):
        return Commands(tuple(tuple(line[2:].split("  ")) for line in lines))
    if text.startswith("- "):
        named = (row.replace("\n  ", " ").partition(" :: ") for row in text[2:].split("\n- "))
        return Rows(tuple((name, meaning) for name, _, meaning in named))
    return " ".join(lines)
