"""The guide that ``nutdamp explain`` shows, read from its Markdown pages; `nutdamp.views.explain` lays them out.

A page begins with ``# Title`` and a line of summary; its topic has the name of the file. On the pages of `ENTRIES` each
``## name`` begins a topic of its own, again with a line of summary, and ``### title`` a part of it; on the others
``## title`` begins a part. Blocks are what the web shows: paragraphs, tables, code, and lists, in which
``- **name**: text`` is a row.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple, cast

from nutdamp.errors import BadRequest, nearest

FOLDER = Path(__file__).parents[1] / "guide"  # folder of the pages


class Formula(NamedTuple):
    """Lines of a formula or of a screen, in plain Unicode, as they are."""

    lines: tuple[str, ...]


class TopicRows(NamedTuple):
    """Names and their texts."""

    rows: tuple[tuple[str, str], ...]


class CommandHelp(NamedTuple):
    """Command lines to copy: each may be broken into parts only between its entries."""

    lines: tuple[tuple[str, ...], ...]


Block = str | Formula | TopicRows | CommandHelp
"""A paragraph, or one of the forms above."""


class TopicPart(NamedTuple):
    """Blocks under a heading; the first part of a topic has none."""

    title: str
    blocks: tuple[Block, ...]


class Topic(NamedTuple):
    """One thing to explain: the ``name`` to request it by, one line about it, and its parts."""

    name: str
    summary: str
    parts: tuple[TopicPart, ...]

    @property
    def blocks(self) -> Iterator[Block]:
        """Blocks of all parts."""
        return (block for part in self.parts for block in part.blocks)

    @property
    def rows(self) -> Iterator[tuple[str, str]]:
        """Rows of all lists and tables."""
        return (row for block in self.blocks if isinstance(block, TopicRows) for row in block.rows)


ENTRIES = ("schemes", "motion", "equations")  # pages whose sections are topics of their own


@cache
def page(name: str) -> Topic:
    """The page of that name; of a page of `ENTRIES` its introduction and the names of its topics."""
    first, *sections = _sections(_text(name), "## ")
    _, _, body = first.lstrip("\n").partition("\n")
    intro = _topic(f"{name}\n{body}", "### ")
    if name in ENTRIES:
        rows = TopicRows(tuple((topic.name, topic.summary) for topic in entries(name)))
        return intro._replace(parts=(*intro.parts, TopicPart("", (rows,))))
    return intro._replace(parts=(*intro.parts, *map(_part, sections)))


@cache
def entries(name: str) -> tuple[Topic, ...]:
    """The topics on a page of `ENTRIES`, in order."""
    return tuple(_topic(section, "### ") for section in _sections(_text(name), "## ")[1:])


def _text(name: str) -> str:
    """The text of a page, without comments and pictures."""
    text = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    return re.sub(r"<!--.*?-->\n?|!\[.*?\]\(.*?\)\n?", "", text, flags=re.DOTALL)


def _sections(text: str, mark: str) -> list[str]:
    """Text before the first line that begins with ``mark``, and behind each of them."""
    return f"\n{text}".split(f"\n{mark}")


def _topic(text: str, mark: str) -> Topic:
    """The topic of a text whose first line is its name, and whose first paragraph is the summary."""
    first, *others = _sections(text, mark)
    name, _, rest = first.strip("\n").partition("\n")
    summary, *body = _blocks(rest)
    opening = (TopicPart("", tuple(body)),) if body else ()
    return Topic(name, str(summary), (*opening, *map(_part, others)))


def _part(text: str) -> TopicPart:
    title, _, body = text.partition("\n")
    return TopicPart(title, tuple(_blocks(body)))


def _blocks(text: str) -> Iterator[Block]:
    for number, part in enumerate(re.split(r"^```(.*\n(?:.*\n)*?)```$", text, flags=re.MULTILINE)):
        lines = part.rstrip("\n").split("\n")[1:]
        if number % 2 and all(line.startswith("$ ") for line in lines):  # command lines alone
            yield CommandHelp(tuple(tuple(re.split(r" (?=--?[a-z])", line[2:])) for line in lines))
        elif number % 2:
            yield Formula(tuple(lines))
        else:
            yield from map(_block, filter(str.strip, re.split(r"\n\n+", part.strip("\n"))))


def _block(text: str) -> Block:
    lines = text.split("\n")
    if text.startswith("    "):
        return Formula(tuple(line[4:] for line in lines))
    if text.startswith("| "):
        return _table(lines)
    if text.startswith("- "):
        named = (_plain(row).partition("**: ") for row in text[2:].split("\n- "))
        return TopicRows(tuple((name[2:], meaning) if mark else ("·", name) for name, mark, meaning in named))
    return _plain(text)


def _table(lines: list[str]) -> TopicRows:
    """The rows of a table: the first cell as name; further ones under their headings where there are several."""
    (_, *heads), _, *cells = (
        [_plain(cell.strip()).replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines
    )
    leads = [f"{head}: " if len(heads) > 1 else "" for head in heads]
    texts = ([f"{lead}{text}" for lead, text in zip(leads, row, strict=True) if text] for _, *row in cells)
    return TopicRows(tuple((row[0], "\n".join(text)) for row, text in zip(cells, texts, strict=True)))


_LINK = re.compile(r"(?P<before>explain |, )?\[(?P<text>[^\]]+)\]\((?P<page>[^)#]*?)(\.md)?(#(?P<entry>[^)]*))?\)")


def _plain(text: str) -> str:
    """A text on one line, with links as the commands that show where they lead."""

    def shown(link: re.Match[str]) -> str:
        before, words, entry = link["before"] or "", link["text"], link["entry"] or Path(link["page"]).name
        known = before or "/" in link["page"] or ":" in link["page"] or words.casefold() == entry
        return f"{before}{words}" if known else f"{words} (explain {entry})"

    return _LINK.sub(shown, " ".join(text.split()))


PAGES = (  # the pages in groups
    ("To begin", ("tutorial", "reading", "cases", "glossary")),
    (
        "How to",
        ("pointing", "trade", "robust", "blocks", "valves", "loop", "budget", "campaign", "fit", "report", "library"),
    ),
    ("Reference", ("commands", "file", "csv", "json", "notes", "units")),
    ("Theory", ("schemes", "motion", "equations", "symbols", "limits")),
    ("The project", ("contributing", "speed", "changes")),
)

FILE = "file"  # name of the topic on the spacecraft file, made from the models that read it (`views.explain`)
SCHEMES, MOTION = entries("schemes"), entries("motion")

SOURCES = (
    'M(n): K. Magnus, "Untersuchungen über zeitabhängig selbsterregte, symmetrische Kreisel", 1970',
    'K(n): lecture text "Kreisel-Bewegungen"',
    '24.4: lecture text "Kreiseltheorie", section 24.4',
)

OVERVIEW = "equations"  # name of the table of all equations

NAMES = (*(name for _, names in PAGES for name in names), *(topic.name for topic in (*SCHEMES, *MOTION)))
"""Names of pages, and of the topics on them that are no equations."""

_NUMBER = re.compile(r"(?P<source>m|k|§)?\s*\(?\s*(?P<number>[0-9]+(\.[0-9]+)?)\s*\)?")
_FIGURE = re.compile(r"(abb|fig)[a-z]*\.?-?[0-9]*")


def found(requested: str) -> Topic:
    """The page or topic by its name or by the number of an equation, but for `FILE` and `OVERVIEW`.

    Raises BadRequest, which names a near one, where there is none.
    """
    name = re.sub(r"[\s_]+", "-", requested.strip().casefold())
    name = {"energy-sink": "dissipation", "gyrostat": "wheel"}.get(name, name)
    if name in NAMES or _FIGURE.fullmatch(name):
        return page_or_topic(name if name in NAMES else "figures")
    if match := _NUMBER.fullmatch(requested.strip().casefold()):
        number = match["number"]
        called = number if "." in number else f"{'K' if match['source'] == 'k' else 'M'}({number})"
        if equation := next((entry for entry in EQUATIONS if entry.number == called), None):
            return equation.topic
        raise BadRequest(f"there is no equation {called}; there are M(1) to M(27), K(5) to K(15) and 24.4")
    raise BadRequest(f"there is no topic {requested!r}; {meant(name, NAMES)}")


def page_or_topic(name: str) -> Topic:
    """The entry of `NAMES`."""
    return next((topic for topic in (*SCHEMES, *MOTION) if topic.name == name), None) or page(name)


def meant(name: str, known: tuple[str, ...], listed: str = "nutdamp explain") -> str:
    """``did you mean 'nutation'?``, or the command by which they are ``listed``."""
    close = nearest(name, known)
    return f"did you mean {close!r}?" if close else f"`{listed}` lists them"


def limits() -> tuple[str, ...]:
    """Assumptions and limits, a paragraph each."""
    return tuple(text for _, text in page("limits").rows)


class Equation(NamedTuple):
    """A numbered equation as printed, and its use in nutdamp.

    ``symbols`` are names of `SYMBOLS`; ``changed`` tells the differences from the print, with the formula used instead
    where there is one; ``place`` is the dotted name of the code that holds it.
    """

    number: str
    subject: str
    formula: Formula
    symbols: tuple[str, ...]
    place: str
    changed: tuple[Block, ...]

    @classmethod
    def of(cls, topic: Topic) -> Equation:
        """The equation of a topic of `equations.md`: its formula, symbols and place, and its changes."""
        ((_, (formula, rows, *changed)),) = topic.parts
        facts = dict(cast("TopicRows", rows).rows)
        formula, symbols = cast("Formula", formula), tuple(facts["symbols"].split())
        return cls(topic.name, topic.summary, formula, symbols, facts["place"], tuple(changed))

    @property
    def topic(self) -> Topic:
        """The equation as a topic of the guide."""
        parts = (
            TopicPart("", (self.formula,)),
            TopicPart("Symbols", (TopicRows(tuple((name, SYMBOLS[name]) for name in self.symbols)),)),
            TopicPart("What nutdamp changes", self.changed or ("Nothing: it is used as printed.",)),
            TopicPart("In the code", (self.place,)),
        )
        return Topic(self.number, self.subject, parts)


SYMBOLS = dict(page("symbols").rows)  # symbols of the sources with their units

EQUATIONS = tuple(map(Equation.of, entries("equations")))
"""Equations of Magnus 1970, of the lecture texts "Kreisel-Bewegungen" and "Kreiseltheorie", and of nutdamp itself."""


class NoteEntry(NamedTuple):
    """A code of the catalogue: its severity, its sentence with names of values in braces, and what it means."""

    severity: str
    sentence: str
    paragraph: str


NOTE_ENTRY = re.compile(r"^## (\S+) \((\w+)\)\n\n((?:> [^\n]*\n)+)\n(.*?)(?=\n## |\Z)", re.MULTILINE | re.DOTALL)


@cache
def note_entries() -> dict[str, NoteEntry]:
    """All codes."""
    entries = NOTE_ENTRY.findall((FOLDER / "notes.md").read_text(encoding="utf-8"))
    return {
        code: NoteEntry(severity, " ".join(quoted[2:-1].split("\n> ")), " ".join(paragraph.split()))
        for code, severity, quoted, paragraph in entries
    }
