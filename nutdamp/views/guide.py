"""The guide that ``nutdamp explain`` shows: Markdown pages, their topics, words and keys of the
file, and their screens.

A page begins with ``# Title`` and a line of summary; its topic has the name of the file. On the
pages of `ENTRIES` each ``## name`` begins a topic of its own, again with a line of summary. Rows
are those of tables of two columns, and entries of lists that begin with ``**name**:``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from itertools import islice
from pathlib import Path
from typing import ClassVar, NamedTuple

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.constrain import Constrain
from rich.markdown import CodeBlock, Heading, Markdown, MarkdownElement, TableElement
from rich.padding import Padding
from rich.table import Table
from rich.text import Text
from rich.theme import Theme

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
        return ROW.findall(HEADS_OF_TABLE.sub("", self.text))

    @property
    def sections(self) -> list[tuple[str, str]]:
        """Headings and the texts below them; the first text has none."""
        first, *others = HEADING.split(self.text)
        return [("", first), *zip(others[::2], others[1::2], strict=True)]

    @property
    def formulas(self) -> list[str]:
        """Indented lines, as they are."""
        return FORMULA.findall(self.text)


def listed(rows: Iterable[tuple[str, str]]) -> str:
    """Names and their texts as a list in Markdown."""
    return "\n".join(f"- **{name}**: {text}" for name, text in rows)


ENTRIES = ("schemes", "motion", "equations")  # pages whose sections are topics of their own


@cache
def page(name: str) -> Topic:
    """The page of that name; of a page of `ENTRIES` its introduction
    and the names of its topics.
    """
    if name not in ENTRIES:
        return _topic(_text(name))._replace(name=name)
    intro = _topic(_text(name).partition("\n## ")[0])
    names = listed((topic.name, topic.summary) for topic in entries(name))
    return Topic(name, intro.summary, f"{intro.text}\n\n{names}")


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
    name = "figures" if _FIGURE.fullmatch(name) else name
    if name in NAMES:
        return page_or_topic(name)
    match = NUMBER.fullmatch(requested.strip().casefold())
    if match:
        source = "K" if match["source"] == "k" else "M"
        number = match["number"]
        called = number if "." in number else f"{source}({number})"
        if called in EQUATIONS:
            return EQUATIONS[called]
        raise BadRequest(
            f"there is no equation {called}; there are M(1) to M(27), K(5) to K(15) and 24.4"
        )
    raise BadRequest(f"there is no topic {requested!r}; {meant(name, NAMES)}")


def page_or_topic(name: str) -> Topic:
    """The entry of `NAMES`."""
    return next((topic for topic in (*SCHEMES, *MOTION) if topic.name == name), None) or page(name)


def meant(name: str, names: tuple[str, ...], command: str = "nutdamp explain") -> str:
    """``did you mean 'nutation'?``, or the ``command`` that lists them."""
    close = nearest(name, names)
    return f"did you mean {close!r}?" if close else f"`{command}` lists them"


def limits() -> tuple[str, ...]:
    """Assumptions and limits, a paragraph each."""
    return tuple(" ".join(text.split()) for text in f"\n{page('limits').text}".split("\n- ")[1:])


def equation(entry: Topic) -> Topic:
    """Topic of an entry of ``equations.md``: the equation as printed, its symbols, the differences
    from the print, with the formula used instead where there is one, and the dotted name of the
    code that holds it.
    """
    facts = dict(entry.rows)
    changed = entry.text.partition(facts["place"])[2].strip("\n")
    parts = (
        entry.text.partition("\n\n")[0],
        f"### Symbols\n\n{listed((name, SYMBOLS[name]) for name in facts['symbols'].split())}",
        f"### What nutdamp changes\n\n{changed or 'Nothing: it is used as printed.'}",
        f"### In the code\n\n`{facts['place']}`",
    )
    return entry._replace(text="\n\n".join(parts))


SYMBOLS = dict(page("symbols").rows)  # symbols of the sources with their units

EQUATIONS = {entry.name: equation(entry) for entry in entries("equations")}
"""Equations of Magnus 1970, of the lecture texts "Kreisel-Bewegungen" and "Kreiseltheorie", and of
nutdamp itself, by their numbers.
"""

# --- words


def _notes() -> Iterator[tuple[str, str]]:
    for heading, entry in page("notes").sections[1:]:
        words = " ".join(entry.replace("\n> ", " ").split()).removeprefix("> ")
        shown = re.sub(
            r"\{(\w+?)(_[a-zA-Z]+)?\}", lambda name: f"[{name[1].replace('_', ' ')}]", words
        )
        yield heading.partition(" (")[0], shown


WORDS: dict[str, Callable[[], Iterable[tuple[str, str]]]] = {
    "glossary": lambda: page("glossary").rows,
    "column of CSV": lambda: page("csv").rows,
    "name in JSON": lambda: page("json").rows,
    "symbol": lambda: page("symbols").rows,
    "note": _notes,
}
"""Sources of words by their kind: pairs of names, separated by commas, and their paragraph."""

ALIKE = ("glossary", "symbol")  # kinds whose names of one paragraph mean the same


@cache  # deep tests look up every word of every screen
def words_of(kind: str) -> list[tuple[str, str]]:
    """Words of a kind of `WORDS`."""
    return [*WORDS[kind]()]


_UNIT = re.compile(  # end of a heading with hyphens for blanks: its unit
    r"([-,]+(N-m(-s)?|ft-lbf(-s)?|kg-m²|deg(/s)?|m?rad(/s)?|rpm|s|m|N|g|kg|%|relative|sigmas?|counts|turn|(1|%|kg)/(day|year)))$|[-,≤≥]+$"
)


def explained(requested: str, named: Callable[[str], Topic | None] = lambda _: None) -> Topic:
    """Words, page and keys of the file of that name as one topic, else what is ``named`` so in a
    spacecraft; raises BadRequest, which names a near one.
    """
    name, _, below = requested.partition(".")
    if name.casefold() == FILE and below:
        return file_topic(below)
    wanted = _folded(requested)
    texts = [*_texts(requested)]
    keys = [
        (path, text)
        for path, text in file_keys()
        if wanted in (_folded(path.rpartition(".")[2]), _folded(path))
    ]
    try:
        topic = topic_of(requested)
    except BadRequest:
        if not texts and not keys:
            other = _elsewhere(requested, named)
            if other is not None:
                return other
            if NUMBER.fullmatch(requested.strip().casefold()):
                raise
            near = meant(nearest(wanted, NAMES) or wanted, tuple(names()))
            raise BadRequest(f"there is no topic {requested!r}; {near}") from None
        if not texts and len(keys) == 1:
            return file_topic(keys[0][0])
        (_, summary), *texts = texts or [("", "keys of the spacecraft file")]
        topic = Topic(requested, summary, "")
    parts = [listed(texts), topic.text]
    if keys:
        in_file = listed((f"{FILE}.{path}", text) for path, text in keys)
        parts += ["## In the spacecraft file", in_file]
    return topic._replace(text="\n\n".join(filter(None, parts)))


PASSAGES = 6  # most passages shown of a word that is no topic: few are read to the end


def _elsewhere(requested: str, named: Callable[[str], Topic | None]) -> Topic | None:
    """Topic of what has no name in the guide: a section by its title or the begin of it, words with
    ": " between, what is ``named`` so, or the passages that have it, but for a number.
    """
    wanted = _folded(requested)
    begun = None
    for name in NAMES:
        for title, text in page_or_topic(name).sections if name != FILE else ():
            if _folded(title) == wanted:
                return Topic(title, f"in explain {name}", text)
            if begun is None and len(wanted) > 3 and _folded(title).startswith(wanted):
                begun = Topic(title, f"in explain {name}", text)
    if begun is not None:
        return begun
    parts = requested.split(": ")  # such as "spin axis: tilt"
    rows = [(part, text) for part in parts for _, text in islice(_texts(part), 1)]
    if len(rows) == len(parts) > 1:
        return Topic(requested, " of ".join(parts[::-1]), listed(rows))
    own = named(requested)
    if own is not None or NUMBER.fullmatch(requested.strip().casefold()):
        return own
    entries = [entry for kind in WORDS for entry in words_of(kind)]
    for name in NAMES:
        entries += [(name, text) for text in re.split(r"\n\n|\n(?=- )", page_or_topic(name).text)]
    plain = ((name, " ".join(text.split())) for name, text in (*entries, *file_keys()))
    word = re.compile(rf"(?<!\w){re.escape(requested.strip())}(?!\w)", re.IGNORECASE)
    passages = [*islice((entry for entry in plain if word.search(": ".join(entry))), PASSAGES)]
    return Topic(requested, "where the guide has it", listed(passages)) if passages else None


def names() -> Iterator[str]:
    """Every name that `explained` finds, but for sections of pages."""
    yield from NAMES
    for kind in WORDS:
        for entry, _ in words_of(kind):
            yield from entry.split(", ")
    yield from (path for path, _ in file_keys())


def completed(begun: str) -> list[str]:
    """Names that begin so, with hyphens for blanks."""
    hyphened = {name.replace(" ", "-") for name in names()}
    return sorted(name for name in hyphened if name.startswith(begun))


def completed_keys(begun: str) -> list[str]:
    """Keys of the file that begin so, as ``--set`` takes them; entries of lists, which each file
    names, are not.
    """
    keys = [path for path, _ in file_keys()]
    lists = tuple(path.removesuffix("name") for path in keys if path.endswith(".name"))
    return [f"{path}=" for path in keys if path.startswith(begun) and not path.startswith(lists)]


@cache
def _folded(name: str) -> str:
    """Names in small letters with hyphens; a single letter, which is a symbol, as it is."""
    name = name.strip()
    return name if len(name) == 1 else re.sub(r"[\s_]+", "-", name.casefold())


@cache
def _bare(name: str) -> str:
    """A name as `_folded`, without the units at its end."""
    hyphened = re.sub(r"[\s_]+", "-", name.strip())
    bare = _UNIT.sub("", hyphened)
    return _bare(bare) if bare not in ("", hyphened) else _folded(hyphened)


def _texts(requested: str) -> Iterator[tuple[str, str]]:
    """Kinds and texts of the words of that name, as written, else folded or without unit unless the
    glossary has it.
    """
    seen: set[str] = set()
    for kind in WORDS:
        for form in (str,) if seen else (str, _folded, _bare):
            alike = [
                (entry, text)
                for entry, text in words_of(kind)
                if form(requested) in map(form, (entry, *entry.split(", ")))
            ]
            if alike:
                break
        for entry, text in alike:
            if text not in seen:
                seen.add(text)
                yield kind, text if kind in ALIKE or ", " not in entry else f"{entry}: {text}"


def file_keys() -> Iterator[tuple[str, str]]:
    """Paths and texts of the keys of the file, but for those within a tolerance, which are all
    alike.
    """
    for title, text in page(FILE).sections:
        if ":" not in title:
            for name, meaning in Topic(title, "", text).rows:
                yield f"{title}.{name}".lstrip("."), meaning


def file_topic(below: str) -> Topic:
    """A key of the file such as ``thrusters.force`` and those below it; raises BadRequest, which
    names a near one.
    """
    keys = dict(file_keys())
    if below not in keys:
        paths = tuple(f"{FILE}.{path}" for path in keys)
        same = (path for path in paths if path.rpartition(".")[2] == below.rpartition(".")[2])
        near = meant(next(same, f"{FILE}.{below}"), paths, "nutdamp explain file")
        raise BadRequest(f"the spacecraft file has no key {below!r}; {near}")
    parent, _, name = below.rpartition(".")
    parts = [keys[below]]
    for title, text in page(FILE).sections:
        alike, _, named = title.partition(": each of ")
        if f"{title}.".startswith((f"{below}.", f"{below}:")) or (
            alike == parent and name in named.split(", ")
        ):
            parts.append(f"## {title}\n\n{text}")
    return Topic(f"{FILE}.{below}", "a key of the spacecraft file", "\n\n".join(parts))


WIDEST = 100  # largest width of a text in columns: longer lines are hard to read


class _AsItIs(CodeBlock):
    """A formula, a command or a screen."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield Padding(Text(str(self.text).rstrip(), overflow="fold"), (0, 0, 0, 2))


class _BoldHeading(Heading):
    """A heading in a line of its own."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield Text(self.text.plain, "bold")


class _FoldedTable(TableElement):
    """A table that cuts no word short."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for table in super().__rich_console__(console, options):
            assert isinstance(table, Table)
            for column in table.columns:
                column.overflow = "fold"
            yield table


class _Page(Markdown):
    """A text of the"""

    elements: ClassVar[dict[str, type[MarkdownElement]]] = {
        **Markdown.elements,
        "fence": _AsItIs,
        "code_block": _AsItIs,
        "heading_open": _BoldHeading,
        "table_open": _FoldedTable,
    }

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        with console.use_theme(
            Theme({"markdown.code": "bold"})
        ):  # no dark boxes on light terminals
            yield from super().__rich_console__(console, options)


def topics_screen() -> RenderableType:
    """All pages with a line about each, and what else can be asked for."""
    parts: list[RenderableType] = [Text("The guide: nutdamp explain TOPIC")]
    for group, names in PAGES:
        rows = tuple((name, page(name).summary) for name in names)
        parts += [Text(group, style="bold"), Padding(_pairs(rows), (0, 0, 0, 2))]
    others = (
        ("Schemes", ", ".join(topic.name for topic in SCHEMES)),
        ("Motion", ", ".join(topic.name for topic in MOTION)),
        ("Equations", "17, K7, 24.4"),
        ("Words", "any heading, column, name in JSON, symbol or key: explain tilt"),
    )
    return Constrain(Group(*parts, _pairs(others)), WIDEST)


def examples_screen(rows: tuple[tuple[str, str], ...]) -> RenderableType:
    """The spacecraft to start from, each with its subject."""
    title = Text("Spacecraft to start from: nutdamp init --from NAME [FILE]")
    return Constrain(Group(title, Text(), _pairs(rows)), WIDEST)


def topic_screen(topic: Topic) -> RenderableType:
    """One topic."""
    return Constrain(
        _Page(f"**{topic.name}** – {topic.summary}\n\n{topic.text}", hyperlinks=False), WIDEST
    )


def _pairs(rows: Iterable[tuple[str, str]]) -> Table:
    """Names to the left and their texts to the right."""
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim", overflow="fold")
    for name, text in rows:
        table.add_row(name, Text(text, overflow="fold"))
    return table
