"""The guide that ``nutdamp explain`` shows: topics by name, read from Markdown files; `explain_tables` lays them out.

The numbered equations of the sources are in `equations.md`, their symbols in `symbols.md`; the units of files and
options come from the table that reads them.

``# name :: summary`` begins a topic and ``## title`` a part of it. Blank lines separate blocks: lines indented by four
are a formula, ``- name :: text`` a row, ``$`` a command line (two blanks where it may be broken), all else a paragraph.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple, cast

from nutdamp.errors import BadRequest, nearest
from nutdamp.units import KINDS, Kind


class Formula(NamedTuple):
    """Lines of a formula, in plain Unicode."""

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


def _page(file: str) -> str:
    """The text of a Markdown file of the guide."""
    return (Path(__file__).parents[1] / "guide" / file).read_text(encoding="utf-8")


def topics(file: str) -> tuple[Topic, ...]:
    """The topics of ``file``, in order."""
    text = _page(file)
    return tuple(map(_topic, _sections(text, "# ")[1:]))


def _sections(text: str, mark: str) -> list[str]:
    """Text before the first line that begins with ``mark``, and behind each of them."""
    return f"\n{text}".split(f"\n{mark}")


def _topic(text: str) -> Topic:
    name, _, rest = text.partition(" :: ")
    summary, _, body = rest.partition("\n")
    first, *others = _sections(body, "## ")
    parts = [("", first)] if first.strip() else []
    titled = (tuple(other.split("\n", 1)) for other in others)
    return Topic(name, summary, tuple(TopicPart(title, _blocks(blocks)) for title, blocks in (*parts, *titled)))


def _blocks(text: str) -> tuple[Block, ...]:
    return tuple(map(_block, re.split(r"\n\n+", text.strip("\n"))))


def _block(text: str) -> Block:
    lines = text.split("\n")
    if text.startswith("    "):
        return Formula(tuple(line[4:] for line in lines))
    if text.startswith("$ "):
        return CommandHelp(tuple(tuple(line[2:].split("  ")) for line in lines))
    if text.startswith("- "):
        named = (row.replace("\n  ", " ").partition(" :: ") for row in text[2:].split("\n- "))
        return TopicRows(tuple((name, meaning) for name, _, meaning in named))
    return " ".join(lines)


def _line(kind: Kind) -> str:
    """The SI unit first, then the others and their values in it."""
    if not kind.factors:
        return "no unit"
    named = ((unit, "" if factor == 1.0 else f" = {factor:.6g} {kind.si}") for unit, factor in kind.factors.items())
    others = [f"{unit}{worth}".rstrip() for unit, worth in named if unit != kind.si]
    return "; ".join([kind.si, *others] if kind.si else others)


def units_topic() -> Topic:
    """Every unit that is accepted."""
    rows = tuple((kind.noun.partition(" ")[2], _line(kind)) for kind in KINDS.values())
    return Topic(
        "units",
        "units of the spacecraft file and of options",
        (
            TopicPart(
                "",
                (
                    "A value is a number in SI (the first unit of a line) or a text with a unit, such as 60 rpm, 20 ms "
                    "or 5 deg. On the command line the blank may be left out: --until 90s, --set state.spin=60rpm.",
                    TopicRows(rows),
                    "Blanks within a unit may be left out or written as * or ·, and ^2 as ²: kgm², N*m. degrees, "
                    "degree and ° are read as deg, sec as s, hour as hours, rpm in any case. A unit of another kind, "
                    "or one that is not listed, is an error that names those allowed; Hz is for sampling rates "
                    "alone, and revolutions are no unit here, since nobody can tell whether they count turns or "
                    "radians.",
                    "Reports show degrees, CSV and JSON name the unit in the column or key, such as t_s, nutation_deg.",
                ),
            ),
            TopicPart("See also", ("explain file",)),
        ),
    )


__all__ = ["FILE", "NAMES", "OVERVIEW", "SOURCES", "SUMMARIES", "found", "limits", "meant"]

SCHEMES, MOTION = topics("schemes.md"), topics("motion.md")
CODE = topics("contributing.md")

SOURCES = (
    'M(n): K. Magnus, "Untersuchungen über zeitabhängig selbsterregte, symmetrische Kreisel", 1970',
    'K(n): lecture text "Kreisel-Bewegungen"',
    '24.4: lecture text "Kreiseltheorie", section 24.4',
)

FILE = "file"
"""Name of the topic on the spacecraft file, which is made from the models that read it (`nutdamp.views.file_guide`)."""

OVERVIEW = "equations"
"""Name of the table of all equations."""

SUMMARIES: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    ("Schemes", tuple((topic.name, topic.summary) for topic in SCHEMES)),
    (
        "Motion",
        (
            *((topic.name, topic.summary) for topic in MOTION),
            (OVERVIEW, "the numbered equations of the sources, and where they are in the code"),
            ("17", "one of them: M(1) to M(27) as 1 to 27, K(5) to K(15) as K5 to K15, 24.4"),
        ),
    ),
    (
        "Files",
        (
            (FILE, "every key of the spacecraft file; file.thrusters, file.limits.tick: a part of it"),
            ("units", "units of the spacecraft file and of options"),
        ),
    ),
    ("Code", tuple((topic.name, topic.summary) for topic in CODE)),
)
"""All topics with a line about each, in groups."""

NAMES = tuple(name for _, group in SUMMARIES for name, _ in group)

_NUMBER = re.compile(r"(?P<source>m|k|§)?\s*\(?\s*(?P<number>[0-9]+(\.[0-9]+)?)\s*\)?")
_FIGURE = re.compile(r"(abb|fig)[a-z]*\.?-?[0-9]*")


def found(requested: str) -> Topic:
    """The topic by its name or by the number of an equation, but for `FILE` and `OVERVIEW`.

    Raises BadRequest, which names a near one, where there is none.
    """
    name = re.sub(r"[\s_]+", "-", requested.strip().casefold())
    known = {topic.name: topic for topic in (*SCHEMES, *MOTION, *CODE)}
    if name in known:
        return known[name]
    if name == "units":
        return units_topic()
    if name == "energy-sink":
        return known["dissipation"]
    if _FIGURE.fullmatch(name):
        return known["figures"]
    if match := _NUMBER.fullmatch(requested.strip().casefold()):
        return _equation(match["source"] or "", match["number"])
    raise BadRequest(f"there is no topic {requested!r}; {meant(name, NAMES)}")


def _equation(source: str, number: str) -> Topic:
    """The topic of the equation of that ``source`` (m, k or §, empty: Magnus) and ``number``; raises BadRequest."""

    section = "." in number
    name = number if section else f"{source.upper() if source == 'k' else 'M'}({number})"
    for equation in EQUATIONS:
        if equation.number == name:
            return equation.topic
    raise BadRequest(f"there is no equation {name}; there are M(1) to M(27), K(5) to K(15) and 24.4")


def meant(name: str, known: tuple[str, ...], listed: str = "nutdamp explain") -> str:
    """``did you mean 'nutation'?``, or the command by which they are ``listed``."""
    close = nearest(name, known)
    return f"did you mean {close!r}?" if close else f"`{listed}` lists them"


def limits() -> tuple[str, ...]:
    """Assumptions and limits, a paragraph each; the README has the same ones."""

    text = _page("limits.md")
    return tuple(" ".join(part.split()) for part in re.split(r"^- ", text, flags=re.MULTILINE) if part.strip())


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
        symbols = tuple(facts["symbols"].split())
        return cls(topic.name, topic.summary, cast("Formula", formula), symbols, facts["place"], tuple(changed))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Differences from the print, in words."""
        return tuple(block for block in self.changed if isinstance(block, str))

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


(_symbols,) = topics("symbols.md")
SYMBOLS = dict(cast("TopicRows", _symbols.parts[0].blocks[0]).rows)
"""Symbols of the sources with their units."""

EQUATIONS = tuple(map(Equation.of, topics("equations.md")))
"""Equations of Magnus 1970, of the lecture texts "Kreisel-Bewegungen" and "Kreiseltheorie", and of nutdamp itself."""
