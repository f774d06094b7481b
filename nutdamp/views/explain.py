"""Topics of ``explain``: pages, sections, words with a paragraph each, keys of the file; and their
screens.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from itertools import islice
from typing import ClassVar

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.constrain import Constrain
from rich.markdown import CodeBlock, Heading, Markdown, MarkdownElement, TableElement
from rich.padding import Padding
from rich.table import Table
from rich.text import Text
from rich.theme import Theme

from nutdamp.errors import BadRequest, nearest
from nutdamp.views import guide
from nutdamp.views.guide import Topic


@cache
def _notes() -> list[tuple[str, str]]:
    notes = []
    for heading, entry in guide.page("notes").sections[1:]:
        words = " ".join(entry.replace("\n> ", " ").split()).removeprefix("> ")
        shown = re.sub(
            r"\{(\w+?)(_[a-zA-Z]+)?\}", lambda name: f"[{name[1].replace('_', ' ')}]", words
        )
        notes.append((heading.partition(" (")[0], shown))
    return notes


WORDS: tuple[tuple[str, Callable[[], Iterable[tuple[str, str]]]], ...] = (
    ("glossary", lambda: guide.page("glossary").rows),
    ("column of CSV", lambda: guide.page("csv").rows),
    ("name in JSON", lambda: guide.page("json").rows),
    ("symbol", lambda: guide.page("symbols").rows),
    ("note", _notes),
)
"""Sources of words, each with its kind: pairs of names, separated by commas,
and their paragraph.
"""

ALIKE = ("glossary", "symbol")  # kinds whose names of one paragraph mean the same

_UNIT = re.compile(  # end of a heading with hyphens for blanks: its unit
    r"([-,]+(N-m(-s)?|ft-lbf(-s)?|kg-m²|deg(/s)?|m?rad(/s)?|rpm|s|m|N|g|kg|%|relative|sigmas?|counts|turn|(1|%|kg)/(day|year)))$|[-,≤≥]+$"
)


def explained(
    requested: str, named: Callable[[str], Iterator[Topic]] = lambda _: iter(())
) -> Topic:
    """Words, page and keys of the file of that name as one topic, else the first that is ``named``
    so in a spacecraft; raises BadRequest, which names a near one.
    """
    name, _, below = requested.partition(".")
    if name.casefold() == guide.FILE and below:
        return file_topic(below)
    wanted = _folded(requested)
    texts = list(_texts(requested))
    keys = [
        (path, text)
        for path, text in file_keys()
        if wanted in (_folded(path.rpartition(".")[2]), _folded(path))
    ]
    try:
        topic = guide.topic_of(requested)
    except BadRequest:
        if not texts and not keys:
            if section := next(_sections(wanted), None):
                return section
            parts = requested.split(": ")  # such as "spin axis: tilt"
            rows = [(part, text) for part in parts for _, text in islice(_texts(part), 1)]
            if len(rows) == len(parts) > 1:
                return Topic(requested, " of ".join(parts[::-1]), _listed(rows))
            if own := next(named(requested), None):
                return own
            if guide.NUMBER.fullmatch(requested.strip().casefold()):
                raise
            if passages := _passages(requested):
                return Topic(requested, "where the guide has it", _listed(passages))
            near = guide.meant(nearest(wanted, guide.NAMES) or wanted, tuple(names()))
            raise BadRequest(f"there is no topic {requested!r}; {near}") from None
        if not texts and len(keys) == 1:
            return file_topic(keys[0][0])
        (_, summary), *texts = texts or [("", "keys of the spacecraft file")]
        topic = Topic(requested, summary, "")
    parts = [_listed(texts), topic.text]
    if keys:
        parts += [
            "## In the spacecraft file",
            _listed((f"{guide.FILE}.{path}", text) for path, text in keys),
        ]
    return topic._replace(text="\n\n".join(filter(None, parts)))


def _listed(rows: Iterable[tuple[str, str]]) -> str:
    """Names and their texts as a list in Markdown."""
    return "\n".join(f"- **{name}**: {text}" for name, text in rows)


def names() -> Iterator[str]:
    """Every name that `explained` finds, but for sections of pages."""
    yield from guide.NAMES
    for _, source in WORDS:
        for entry, _ in source():
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
    return re.sub(
        r"[\s_]+", "-", name.strip() if len(name.strip()) == 1 else name.strip().casefold()
    )


@cache
def _bare(name: str) -> str:
    """A name as `_folded`, without the unit at its end."""
    hyphened = re.sub(r"[\s_]+", "-", name.strip())
    while (bare := _UNIT.sub("", hyphened)) not in ("", hyphened):
        hyphened = bare
    return _folded(hyphened)


def _texts(requested: str) -> Iterator[tuple[str, str]]:
    """Kinds and texts of the words of that name, as written, else folded or without unit unless the
    glossary has it.
    """
    seen: set[str] = set()
    for kind, source in WORDS:
        words = [([*entry.split(", "), entry], entry, text) for entry, text in source()]
        forms = (str,) if seen else (str, _folded, _bare)
        tiers = (
            [word for word in words if form(requested) in map(form, word[0])] for form in forms
        )
        for _, entry, text in next(filter(None, tiers), []):
            if text not in seen:
                seen.add(text)
                yield kind, text if kind in ALIKE or ", " not in entry else f"{entry}: {text}"


def _sections(wanted: str) -> Iterator[Topic]:
    """Sections of pages of that title, folded, or whose title begins so."""
    for begins in (False, True):
        for name in guide.NAMES:
            for title, text in guide.page_or_topic(name).sections if name != guide.FILE else ():
                folded = _folded(title)
                if folded == wanted or (begins and len(wanted) > 3 and folded.startswith(wanted)):
                    yield Topic(title, f"in explain {name}", text)


PASSAGES = 6  # most passages shown of a word that is no topic: few are read to the end


def _passages(requested: str) -> list[tuple[str, str]]:
    """Entries and paragraphs of the guide that have the words ``requested``, and their names."""
    wanted = requested.strip().casefold()
    word = re.compile(rf"(?<!\w){re.escape(wanted)}(?!\w)")
    having = (entry for entry, folded in _guide() if wanted in folded and word.search(folded))
    return [*islice(having, PASSAGES)]


@cache
def _guide() -> list[tuple[tuple[str, str], str]]:
    """Names and texts of entries and paragraphs, and both folded to small letters."""
    entries = [entry for _, source in WORDS for entry in source()]
    pages = ((name, guide.page_or_topic(name).text) for name in guide.NAMES)
    for name, page in pages:
        entries += [(name, text) for text in re.split(r"\n\n|\n(?=- )", page)]
    plain = ((name, " ".join(text.split())) for name, text in (*entries, *file_keys()))
    return [(entry, ": ".join(entry).casefold()) for entry in plain]


def file_keys() -> Iterator[tuple[str, str]]:
    """Paths and texts of the keys of the file, but for those within a tolerance, which are all
    alike.
    """
    for title, text in guide.page(guide.FILE).sections:
        if ":" not in title:
            for name, meaning in Topic(title, "", text).rows:
                yield f"{title}.{name}".lstrip("."), meaning


def file_topic(below: str) -> Topic:
    """A key of the file such as ``thrusters.force`` and those below it; raises BadRequest, which
    names a near one.
    """
    keys = dict(file_keys())
    if below not in keys:
        paths = tuple(f"{guide.FILE}.{path}" for path in keys)
        same = (path for path in paths if path.rpartition(".")[2] == below.rpartition(".")[2])
        near = guide.meant(next(same, f"{guide.FILE}.{below}"), paths, "nutdamp explain file")
        raise BadRequest(f"the spacecraft file has no key {below!r}; {near}")
    parent, _, name = below.rpartition(".")
    parts = [keys[below]]
    for title, text in guide.page(guide.FILE).sections:
        alike, _, named = title.partition(": each of ")
        if f"{title}.".startswith((f"{below}.", f"{below}:")) or (
            alike == parent and name in named.split(", ")
        ):
            parts.append(f"## {title}\n\n{text}")
    return Topic(f"{guide.FILE}.{below}", "a key of the spacecraft file", "\n\n".join(parts))


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
    """A text of the guide."""

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
    for group, names in guide.PAGES:
        rows = tuple((name, guide.page(name).summary) for name in names)
        parts += [Text(group, style="bold"), Padding(_pairs(rows), (0, 0, 0, 2))]
    others = (
        ("Schemes", ", ".join(topic.name for topic in guide.SCHEMES)),
        ("Motion", ", ".join(topic.name for topic in guide.MOTION)),
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
