"""The guide that ``nutdamp explain`` shows, read from its Markdown pages; `nutdamp.views.explain`
finds words in them.

A page begins with ``# Title`` and a line of summary; its topic has the name of the file. On the
pages of `ENTRIES` each ``## name`` begins a topic of its own, again with a line of summary. Rows
are those of tables of two columns, and entries of lists that begin with ``**name**:``.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import NamedTuple

from nutdamp.errors import BadRequest, nearest

FOLDER = Path(__file__).parents[1] / "guide"  # folder of the pages

HEADING = re.compile(r"^##+ (.+)\n", re.MULTILINE)
ROW = re.compile(  # to the end of its last line, which is indented
    r"^(?:- \*\*|\| )(.+?)(?:\*\*: | \| )(.+?(?:\n  \S.*)*)(?: \|)?$(?!\n  \S)", re.MULTILINE
)
HEADS_OF_TABLE = re.compile(r"^\|.+\n\|[-|]+\n", re.MULTILINE)
FORMULA = re.compile(r"(?:^    .+\n?)+", re.MULTILINE)


class Topic(NamedTuple):
    """One thing to explain: the ``name`` to request it by, one line about it, and its ``text`` in
    Markdown.
    """

    name: str
    summary: str
    text: str

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Names and texts of all lists and tables."""
        return _rows(self.text)

    @property
    def sections(self) -> list[tuple[str, str]]:
        """Headings and the texts below them; the first text has none."""
        return _sections(self.text)

    @property
    def formulas(self) -> list[str]:
        """Indented lines, as they are."""
        return FORMULA.findall(self.text)


@cache  # pages are read for every word that is looked up
def _rows(text: str) -> list[tuple[str, str]]:
    return ROW.findall(HEADS_OF_TABLE.sub("", text))


@cache
def _sections(text: str) -> list[tuple[str, str]]:
    first, *others = HEADING.split(text)
    return [("", first), *zip(others[::2], others[1::2], strict=True)]


ENTRIES = ("schemes", "motion", "equations")  # pages whose sections are topics of their own


@cache
def page(name: str) -> Topic:
    """The page of that name; of a page of `ENTRIES` its introduction
    and the names of its topics.
    """
    if name not in ENTRIES:
        return _topic(_text(name))._replace(name=name)
    intro = _topic(_text(name).partition("\n## ")[0])
    listed = "\n".join(f"- **{topic.name}**: {topic.summary}" for topic in entries(name))
    return Topic(name, intro.summary, f"{intro.text}\n\n{listed}")


@cache
def entries(name: str) -> tuple[Topic, ...]:
    """The topics on a page of `ENTRIES`, in order."""
    return tuple(map(_topic, _text(name).split("\n## ")[1:]))


def _text(name: str) -> str:
    """The text of a page, without comments and pictures, and of links the words alone, which are
    names of topics.
    """
    text = (FOLDER / f"{name}.md").read_text(encoding="utf-8")
    text = re.sub(r"<!--.*?-->\n?|!\[.*?\]\(.*?\)\n?", "", text, flags=re.DOTALL)
    return re.sub(r"\[([^\]\n]+)\]\([^)\s]*\)", r"\1", text)


def _topic(text: str) -> Topic:
    """The topic of a text whose first line is its name,
    and whose first paragraph is the summary.
    """
    name, summary, *rest = text.strip("\n").split("\n\n", 2)
    return Topic(name, " ".join(summary.split()), "".join(rest))


PAGES = (  # the pages in groups
    ("To begin", ("tutorial", "reading", "cases", "glossary")),
    (
        "How to",
        (
            "pointing",
            "trade",
            "robust",
            "blocks",
            "valves",
            "loop",
            "budget",
            "campaign",
            "fit",
            "report",
            "library",
        ),
    ),
    ("Reference", ("commands", "file", "csv", "json", "notes", "units")),
    ("Theory", ("schemes", "motion", "equations", "symbols", "limits")),
    ("The project", ("contributing", "speed", "changes")),
)

FILE = "file"  # name of the page on the spacecraft file
SCHEMES, MOTION = entries("schemes"), entries("motion")

SOURCE = (
    'M(n): K. Magnus, "Untersuchungen über zeitabhängig selbsterregte, symmetrische Kreisel", 1970'
)

NAMES = (
    *(name for _, names in PAGES for name in names),
    *(topic.name for topic in (*SCHEMES, *MOTION)),
)
"""Names of pages, and of the topics on them that are no equations."""

NUMBER = re.compile(r"(?P<source>m|k|§)?\s*\(?\s*(?P<number>[0-9]+(\.[0-9]+)?)\s*\)?")
_FIGURE = re.compile(r"(abb|fig)[a-z]*\.?-?[0-9]*")


def topic_of(requested: str) -> Topic:
    """The page or topic by its name or by the number of an equation.

    Raises BadRequest, which names a near one, where there is none.
    """
    name = re.sub(r"[\s_]+", "-", requested.strip().casefold())
    name = {"energy-sink": "dissipation", "gyrostat": "wheel"}.get(name, name)
    if name in NAMES or _FIGURE.fullmatch(name):
        return page_or_topic(name if name in NAMES else "figures")
    match = NUMBER.fullmatch(requested.strip().casefold())
    if match:
        source = "K" if match["source"] == "k" else "M"
        number = match["number"]
        called = number if "." in number else f"{source}({number})"
        if equation := next((entry for entry in EQUATIONS if entry.number == called), None):
            return equation.topic
        raise BadRequest(
            f"there is no equation {called}; there are M(1) to M(27), K(5) to K(15) and 24.4"
        )
    raise BadRequest(f"there is no topic {requested!r}; {meant(name, NAMES)}")


def page_or_topic(name: str) -> Topic:
    """The entry of `NAMES`."""
    return next((topic for topic in (*SCHEMES, *MOTION) if topic.name == name), None) or page(name)


def meant(name: str, names: tuple[str, ...], listed: str = "nutdamp explain") -> str:
    """``did you mean 'nutation'?``, or the command by which they are ``listed``."""
    close = nearest(name, names)
    return f"did you mean {close!r}?" if close else f"`{listed}` lists them"


def limits() -> tuple[str, ...]:
    """Assumptions and limits, a paragraph each."""
    return tuple(" ".join(text.split()) for text in f"\n{page('limits').text}".split("\n- ")[1:])


class Equation(NamedTuple):
    """A numbered equation as printed, and its use in nutdamp.

    ``symbols`` are names of `SYMBOLS`; ``changed`` tells the differences from the print, with the
    formula used instead where there is one; ``place`` is the dotted name of the code that holds it.
    """

    number: str
    subject: str
    formula: str
    symbols: tuple[str, ...]
    place: str
    changed: str

    @classmethod
    def of(cls, topic: Topic) -> Equation:
        """The equation of a topic of `equations.md`: its formula, symbols and place, and its
        changes.
        """
        facts = dict(topic.rows)
        changed = topic.text.partition(facts["place"])[2].strip("\n")
        formula = topic.text.partition("\n\n")[0]
        symbols = tuple(facts["symbols"].split())
        return cls(topic.name, topic.summary, formula, symbols, facts["place"], changed)

    @property
    def topic(self) -> Topic:
        """The equation as a topic of the guide."""
        symbols = "\n".join(f"- **{name}**: {SYMBOLS[name]}" for name in self.symbols)
        changed = self.changed or "Nothing: it is used as printed."
        parts = (
            self.formula,
            f"### Symbols\n\n{symbols}",
            f"### What nutdamp changes\n\n{changed}",
            f"### In the code\n\n`{self.place}`",
        )
        return Topic(self.number, self.subject, "\n\n".join(parts))


SYMBOLS = dict(page("symbols").rows)  # symbols of the sources with their units

EQUATIONS = tuple(map(Equation.of, entries("equations")))
"""Equations of Magnus 1970, of the lecture texts "Kreisel-Bewegungen" and "Kreiseltheorie", and of
nutdamp itself.
"""
