"""The two forms of all screens: lists of facts and tables of numbers."""

from __future__ import annotations

import re
from io import StringIO

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

NARROW = 60
"""Characters below which a table becomes one block a row."""

GAP = 2
"""Characters between two columns."""

WORD = re.compile(r"(?:[<≤≥✗] )?\S+(?: %(?!\S))?")
"""Pattern of the words that a column keeps on one line."""


WIDTH = 80
"""Columns of a default screen."""


def lines_of(*parts: RenderableType) -> int:
    """Lines that parts take on a screen of `WIDTH` columns."""
    console = Console(width=WIDTH, file=StringIO(), markup=False, emoji=False, highlight=False)
    return sum(len(console.render_lines(part)) for part in parts)


def facts() -> Table:
    """Names to the left, their values to the right."""
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim", overflow="fold")
    table.add_column(overflow="fold")
    return table


class FittedColumns(Table):
    """A table of numbers; where the screen is too narrow to show them whole, each row is a block of its own."""

    whole: tuple[str, ...] = ()
    """Headings of columns whose cells stay on one line."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        room = options.max_width - GAP * (len(self.columns) - 1)
        widths = _widths(self._texts, room, [str(column.header) in self.whole for column in self.columns])
        if options.max_width < NARROW or widths is None:
            yield from self._blocks()
            return
        for column, width in zip(self.columns, widths, strict=True):
            column.width = width
        yield from super().__rich_console__(console, options)

    @property
    def _texts(self) -> list[list[str]]:
        """Heading and cells of each column."""
        return [[str(column.header), *(_text(cell).plain for cell in column.cells)] for column in self.columns]

    def _blocks(self) -> RenderResult:
        names = [str(column.header).replace("\n", ", ").strip(", ") for column in self.columns]
        for row in zip(*(column.cells for column in self.columns), strict=True):
            first, *others = map(_text, row)
            if first.plain.strip():
                named = f"{names[0]}:" if " " in names[0] else names[0]
                yield Text(f"{named} {first.plain.strip()}".strip(), style="bold")
            block = facts()
            for name, cell in zip(names[1:], others, strict=True):
                if cell.plain.strip():
                    block.add_row(name, cell)
            if block.row_count:
                yield Padding(block, (0, 0, 0, 2))


def _text(cell: RenderableType) -> Text:
    return cell if isinstance(cell, Text) else Text(str(cell))


def _widths(columns: list[list[str]], room: int, unbroken: list[bool]) -> list[int] | None:
    """Characters for each column such that no word is cut; None where there is no ``room`` for that.

    A number with its sign, as in "< 1e-9", or with its percent sign is one word; so are cells of ``unbroken`` columns.
    """
    least = [max((cell_len(word) for text in texts for word in WORD.findall(text)), default=0) for texts in columns]
    whole = [max(cell_len(line) for text in texts for line in text.split("\n")) for texts in columns]
    least = [most if kept else fewest for fewest, most, kept in zip(least, whole, unbroken, strict=True)]
    spare = room - sum(least)
    if spare < 0:
        return None
    widths = []
    for most, fewest in zip(whole, least, strict=True):
        widths.append(fewest + min(most - fewest, spare))
        spare -= widths[-1] - fewest
    return widths


def columns(*names: str, text: tuple[str, ...] = ()) -> FittedColumns:
    """A table of numbers, flush right under their headings, but for the first column and those named ``text``."""
    table = FittedColumns(box=None, pad_edge=False, header_style="bold", padding=(0, GAP, 0, 0))
    for index, name in enumerate(names):
        table.add_column(name, justify="left" if index == 0 or name in text else "right")
    return table
