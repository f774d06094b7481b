"""Topics of ``explain``: pages, sections, words with a paragraph each, keys of the file; and their screens."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Literal, NamedTuple, get_args, get_origin

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.constrain import Constrain
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from nutdamp.errors import BadRequest, listed, nearest
from nutdamp.files import fields
from nutdamp.files.fields import Quantity, Section, section_of
from nutdamp.files.keys import SpacecraftFile
from nutdamp.files.study_keys import QUANTITIES, ToleranceSection, unit_kinds
from nutdamp.units import KINDS
from nutdamp.views import guide
from nutdamp.views.guide import Block, CommandHelp, Formula, Topic, TopicPart, TopicRows


def _notes() -> Iterator[tuple[str, str]]:
    for code, entry in guide.note_entries().items():
        sentence = re.sub(r"\{(\w+?)(_[a-zA-Z]+)?\}", lambda name: f"[{name[1].replace('_', ' ')}]", entry.sentence)
        yield code, f"{sentence} {entry.paragraph}"


WORDS: tuple[tuple[str, Callable[[], Iterable[tuple[str, str]]]], ...] = (
    ("glossary", lambda: guide.page("glossary").rows),
    ("column of CSV", lambda: guide.page("csv").rows),
    ("name in JSON", lambda: guide.page("json").rows),
    ("symbol", lambda: guide.page("symbols").rows),
    ("note", _notes),
)
"""Sources of words, each with its kind: pairs of names, separated by commas, and their paragraph."""

ALIKE = ("glossary", "symbol")  # kinds whose names of one paragraph mean the same

_UNIT = re.compile(  # end of a heading with hyphens for blanks: its unit
    r"([-,]+(N-m(-s)?|kg-m²|deg(/s)?|m?rad(/s)?|rpm|s|m|N|g|kg|%|relative|sigmas?|(1|%|kg)/(day|year)))$|[-,≤≥]+$"
)


def explained(requested: str) -> Topic:
    """Words, page and keys of the file of that name as one topic; raises BadRequest, which names a near one."""
    name, _, below = requested.partition(".")
    if name.casefold() == guide.FILE:
        return file_topic(below)
    try:
        topic = guide.found(requested)
    except BadRequest:
        topic = None
    wanted = _folded(requested)
    keys = [key for key in _plain_keys() if wanted in (_folded(key.name), _folded(key.path))]
    texts = list(_texts(requested))
    if topic is None and not texts:
        if not keys:
            if (section := next(_sections(wanted), None)) is not None:
                return section
            if re.fullmatch(r"[mk(]*[0-9]+\)?", requested.casefold()):
                return guide.found(requested)  # raises, and says which equations there are
            near = guide.meant(nearest(wanted, guide.NAMES) or wanted, tuple(names()))
            raise BadRequest(f"there is no topic {requested!r}; {near}")
        if len(keys) == 1:
            return file_topic(keys[0].path)
    summary = "keys of the spacecraft file" if topic is None else topic.summary
    if topic is None and texts:
        (_, summary), *texts = texts
    parts = [TopicPart("", (TopicRows(tuple(texts)),))] if texts else []
    parts += () if topic is None else topic.parts
    if keys:
        rows = tuple((f"{guide.FILE}.{key.path}", key.field.description) for key in keys)
        parts.append(TopicPart("In the spacecraft file", (TopicRows(rows),)))
    return Topic(requested if topic is None else topic.name, summary, tuple(parts))


def names() -> Iterator[str]:
    """Every name that `explained` finds, but for sections of pages."""
    yield from guide.NAMES
    for _, source in WORDS:
        for entry, _ in source():
            yield from entry.split(", ")
    yield from (key.path for key in _plain_keys())


def _folded(name: str) -> str:
    """A name in small letters with hyphens; a single letter, which is a symbol, as it is."""
    return re.sub(r"[\s_]+", "-", name.strip() if len(name.strip()) == 1 else name.strip().casefold())


def _bare(name: str) -> str:
    hyphened = re.sub(r"[\s_]+", "-", name.strip())
    while (bare := _UNIT.sub("", hyphened)) not in ("", hyphened):
        hyphened = bare
    return _folded(hyphened)


def _texts(requested: str) -> Iterator[tuple[str, str]]:
    """Kinds and texts of the words of that name, as written, else folded or without unit unless the glossary has it."""
    seen: set[str] = set()
    for kind, source in WORDS:
        words = [(_spelt(entry), entry, text) for entry, text in source()]
        forms = (str,) if seen else (str, _folded, _bare)
        tiers = ([word for word in words if form(requested) in map(form, word[0])] for form in forms)
        for _, entry, text in next(filter(None, tiers), []):
            if text not in seen:
                seen.add(text)
                yield kind, text if kind in ALIKE or ", " not in entry else f"{entry}: {text}"


def _spelt(entry: str) -> list[str]:
    """The names of a list; some have a comma of their own."""
    names = entry.split(", ")
    spans = ((first, last) for first in range(len(names)) for last in range(first + 1, len(names) + 1))
    return [", ".join(names[first:last]) for first, last in spans]


def _plain_keys() -> Iterator[KeyGuide]:
    """Keys of the file, but for those within a tolerance, which are all alike."""
    return (key for key in keys() if not key.parent.startswith("dispersions."))


def _sections(wanted: str) -> Iterator[Topic]:
    """Sections of pages of that title, folded, or whose title begins so."""
    for begins in (False, True):
        for name in guide.NAMES:
            for part in guide.found(name).parts if name not in (guide.FILE, guide.OVERVIEW) else ():
                title = _folded(part.title)
                if title == wanted or (begins and len(wanted) > 3 and title.startswith(wanted)):
                    yield Topic(part.title, f"in explain {name}", (TopicPart("", part.blocks),))


class KeyGuide(NamedTuple):
    """A key of the file: its ``path`` as `explain` takes it, such as ``thrusters.force``, and its declaration.

    ``section`` is the model of its value, where that is a mapping or a list of mappings.
    """

    path: str
    field: fields.Key
    section: type[Section] | None

    @property
    def parent(self) -> str:
        """Path of the mapping it is in; empty at the root."""
        return self.path.rpartition(".")[0]

    @property
    def name(self) -> str:
        """Last step of the path."""
        return self.path.rpartition(".")[2]

    @property
    def row(self) -> tuple[str, str]:
        """The key, and its description, unit, default and example."""
        unit, default, example = "", "", next(iter(self.field.examples), None)
        if self.section is ToleranceSection:
            names = [unit for kind in unit_kinds(QUANTITIES[self.name]) for unit in KINDS[kind].factors]
            unit = f"unit {listed([*dict.fromkeys(names)], 'or')}"
        elif self.section is None:
            unit = _what(self.field)
        value = self.field.default
        if value is fields.REQUIRED:
            default = "required"
        elif "default" not in self.field.description.casefold():
            default = "default none" if value is None or value == [] else f"default {value:g}"
        facts = [unit, default, "" if example is None else f"example: {flow(example)}"]
        return self.name, "\n".join([self.field.description, "; ".join(filter(None, facts))])


def keys(model: type[Section] = SpacecraftFile, prefix: str = "") -> Iterator[KeyGuide]:
    """All keys of the file, each before those below it."""
    for name, field in model.fields().items():
        section = section_of(field.type)
        yield KeyGuide(f"{prefix}{name}", field, section)
        if section is not None:
            yield from keys(section, f"{prefix}{name}.")


def file_topic(below: str = "") -> Topic:
    """The keys of the file, or below one such as ``thrusters.force``; raises BadRequest, which names a near one."""
    every = list(keys())
    if not below:
        roots = [key for key in every if not key.parent]
        parts = [TopicPart("", (INTRODUCTION, TopicRows(tuple(key.row for key in roots))))]
        for key in roots:
            parts += _key_sections(key, every)
        return Topic(guide.FILE, SpacecraftFile.__doc__ or "", (*parts, _SEE))
    requested = next((key for key in every if key.path == below), None)
    if requested is None:
        paths = tuple(f"{guide.FILE}.{key.path}" for key in _plain_keys())
        same = (path for path in paths if path.rpartition(".")[2] == below.rpartition(".")[2])
        near = guide.meant(next(same, f"{guide.FILE}.{below}"), paths, "nutdamp explain file")
        raise BadRequest(f"the spacecraft file has no key {below!r}; {near}")
    return Topic(
        f"{guide.FILE}.{below}",
        "a key of the spacecraft file",
        (TopicPart("", (TopicRows((requested.row,)),)), *_key_sections(requested, every), _SEE),
    )


INTRODUCTION = (
    "A value is a number in SI or a text with a unit. Any key can also be given as --set KEY=VALUE, entries of a list "
    "by name or position: --set thrusters.T1.force=12N, --set omega0[2]=3."
)


_SEE = TopicPart("See also", ("explain units, nutdamp init, nutdamp schema",))


def _key_sections(key: KeyGuide, every: list[KeyGuide]) -> Iterator[TopicPart]:
    """The keys below ``key``, section by section; those of tolerances, which are all alike, once."""
    if key.section is None:
        return
    children = [entry for entry in every if entry.parent == key.path]
    about = " ".join((key.section.__doc__ or "").split())
    yield TopicPart(key.path, (about, TopicRows(tuple(child.row for child in children))))
    below = [child for child in children if child.section is not None]
    if below and all(child.section is ToleranceSection for child in below):
        alike = [entry for entry in every if entry.parent == below[0].path]
        names = ", ".join(child.name for child in below)
        yield TopicPart(f"{key.path}: each of {names}", (TopicRows(tuple(entry.row for entry in alike)),))
        return
    for child in below:
        yield from _key_sections(child, every)


def _what(field: fields.Key) -> str:
    parts = list(_within(field.type))
    quantity = next((part for part in parts if isinstance(part, Quantity)), None)
    if quantity is not None:
        factors = KINDS[quantity.kind].factors
        return f"unit {listed([*factors], 'or')}" if factors else "plain numbers, without unit"
    choices = next((get_args(part) for part in parts if get_origin(part) is Literal), ())
    plain = next((part for part in parts if get_origin(part) in (list, dict) or isinstance(part, type)), None)
    return listed(choices, "or") if choices else "a whole number" if plain is int else "a text" if plain is str else ""


def _within(annotation: Any) -> Iterator[Any]:
    yield annotation
    for part in get_args(annotation):
        yield from _within(part)


def flow(value: object) -> str:
    """A value as YAML on one line."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {flow(held)}" for key, held in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(flow, value)) + "]"
    return str(value)


WIDEST = 100  # largest width of a text in columns: longer lines are hard to read
NARROW = 60  # columns below which names are above their texts, and not beside them


def topics_screen() -> RenderableType:
    """All pages with a line about each, and what else can be asked for."""
    parts: list[RenderableType] = [Text("The guide: nutdamp explain TOPIC")]
    for group, names in guide.PAGES:
        rows = tuple((name, guide.page(name).summary) for name in names)
        parts += [Text(group, style="bold"), Padding(_Pairs(rows), (0, 0, 0, 2))]
    others = (
        ("Schemes", ", ".join(topic.name for topic in guide.SCHEMES)),
        ("Motion", ", ".join(topic.name for topic in guide.MOTION)),
        ("Equations", "17, K7, 24.4"),
        ("Words", "any heading, column, name in JSON, symbol or key: explain tilt"),
    )
    return Constrain(Group(*parts, _Pairs(others)), WIDEST)


def examples_screen(rows: tuple[tuple[str, str], ...]) -> RenderableType:
    """The spacecraft to start from, each with its subject."""
    title = Text("Spacecraft to start from: nutdamp init --from NAME [FILE]")
    return Constrain(Group(title, Text(), _Pairs(rows)), WIDEST)


def topic_screen(topic: Topic) -> RenderableType:
    """One topic."""
    parts: list[RenderableType] = [Text.assemble((topic.name, "bold"), f" – {topic.summary}")]
    for part in topic.parts:
        parts += [Text(), *[Text(part.title, style="bold")] * bool(part.title)]
        for number, block in enumerate(part.blocks):
            parts += [Text()] * (number > 0) + [_block(block)]
    return Constrain(Group(*parts), WIDEST)


def equations_screen() -> RenderableType:
    """Every numbered equation: its subject, its place in the code, its differences from the print."""
    rows = []
    for entry in guide.EQUATIONS:
        remarks = [block for block in entry.changed if isinstance(block, str)]
        rows.append((entry.number, "\n".join([f"{entry.subject}: {entry.place}", *remarks])))
    hint = Text("Formula, symbols and units of one: nutdamp explain 17, explain K7, explain 24.4")
    return Constrain(Group(*(Text(source) for source in guide.SOURCES), hint, Text(), _Pairs(tuple(rows))), WIDEST)


def _block(block: Block) -> RenderableType:
    if isinstance(block, Formula):
        return Padding(Group(*(Text(line) for line in block.lines)), (0, 0, 0, 2))
    if isinstance(block, TopicRows):
        return _Pairs(block.rows)
    if isinstance(block, CommandHelp):
        return _Typed(block)
    return Text(block)


class _Pairs:
    """Names to the left and their texts to the right, or above and below each other where there is little room."""

    def __init__(self, rows: tuple[tuple[str, str], ...]) -> None:
        self.rows = rows

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        longest = max(len(name) for name, _ in self.rows)
        if options.max_width < NARROW or longest > 0.45 * options.max_width:
            for name, text in self.rows:
                yield Text(name, style="dim", overflow="fold")
                yield Padding(Text(text, overflow="fold"), (0, 0, 0, 2))
            return
        table = Table.grid(padding=(0, 2))
        table.add_column(style="dim", overflow="fold")
        for name, text in self.rows:
            table.add_row(name, Text(text, overflow="fold"))
        yield table


class _Typed:
    """Command lines, broken as a shell allows where they are longer than the screen is wide."""

    def __init__(self, commands: CommandHelp) -> None:
        self.commands = commands

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for first, *parts in self.commands.lines:
            lines = [first]
            for part in parts:
                if len(lines[-1]) + len(part) + 3 > options.max_width - 2:
                    lines[-1:] = [f"{lines[-1]} \\", f"  {part}"]
                else:
                    lines[-1] += f" {part}"
            yield Padding(Text("\n".join(lines), overflow="fold"), (0, 0, 0, 2))
