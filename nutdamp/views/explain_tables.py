"""The screens of ``explain``: topics of the guide, laid out for the width at hand."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.constrain import Constrain
from rich.padding import Padding
from rich.text import Text

from nutdamp.views.guide import MOTION, PAGES, SCHEMES, SOURCES, Block, CommandHelp, Formula, Topic, TopicRows, page
from nutdamp.views.layout import facts

WIDEST = 100
"""Largest width of a text in columns: longer lines are hard to read."""

NARROW = 60
"""Columns below which names are above their texts, and not beside them."""


def topics_screen() -> RenderableType:
    """All pages with a line about each, and what else can be asked for."""
    parts: list[RenderableType] = [Text("The guide: nutdamp explain TOPIC")]
    for group, names in PAGES:
        rows = tuple((name, page(name).summary) for name in names)
        parts += [Text(group, style="bold"), Padding(_Pairs(rows), (0, 0, 0, 2))]
    others = (
        ("Schemes", ", ".join(topic.name for topic in SCHEMES)),
        ("Motion", ", ".join(topic.name for topic in MOTION)),
        ("Equations", "17, K7, 24.4"),
        ("Words", "any heading of a table, column, name in JSON, symbol, or key of the file, as in: explain tilt"),
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
        parts.append(Text())
        if part.title:
            parts.append(Text(part.title, style="bold"))
        for number, block in enumerate(part.blocks):
            parts += [Text()] * (number > 0) + [_block(block)]
    return Constrain(Group(*parts), WIDEST)


def equations_screen() -> RenderableType:
    """Every numbered equation: its subject, its place in the code, its differences from the print."""
    from nutdamp.views.guide import EQUATIONS

    rows = [(entry.number, "\n".join([f"{entry.subject}: {entry.place}", *entry.remarks])) for entry in EQUATIONS]
    hint = Text("Formula, symbols and units of one: nutdamp explain 17, explain K7, explain 24.4")
    return Constrain(Group(*(Text(source) for source in SOURCES), hint, Text(), _Pairs(tuple(rows))), WIDEST)


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
        table = facts()
        for name, text in self.rows:
            table.add_row(name, Text(text))
        yield table


class _Typed:
    """Command lines, broken as a shell allows where they are longer than the screen is wide."""

    def __init__(self, commands: CommandHelp) -> None:
        self.commands = commands

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for parts in self.commands.lines:
            for line in _broken(parts, options.max_width - 2):
                yield Padding(Text(line, overflow="fold"), (0, 0, 0, 2))


def _broken(parts: tuple[str, ...], width: int) -> Iterator[str]:
    """The ``parts`` of a command in lines of up to ``width`` characters; longer parts have a line each."""
    line = ""
    for part in parts:
        if line and len(line) + len(part) + 3 > width:
            yield f"{line} \\"
            line = f"  {part}"
        else:
            line = f"{line} {part}" if line else part
    yield line
