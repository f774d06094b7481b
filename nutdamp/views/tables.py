"""Tables declared once: each column has a name in files, a heading for people, a unit, and a value
of a row.

Screens, pages, CSV, JSON and arrays are made from the same declaration, so that a number that
stands in several places is computed, named and rounded in one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from io import StringIO
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.cells import cell_len
from rich.console import (
    Console,
    ConsoleOptions,
    JustifyMethod,
    RenderableType,
    RenderResult,
)
from rich.table import Table
from rich.text import Text

from nutdamp.common.numerics import MISSING
from nutdamp.units import screen_unit
from nutdamp.views.text import quiet

GAPS = (2, 1)  # characters between two columns, and where there is little room
WORD = re.compile(
    r"(?:[<≤≥✗] )?\S+(?: %(?!\S))?"
)  # pattern of the words that a column keeps on one line
WIDTH = 80  # columns of a default screen


def lines_of(*parts: RenderableType, width: int = WIDTH) -> int:
    """Lines that parts take on a screen of ``width`` columns."""
    console = Console(width=width, file=StringIO(), markup=False, emoji=False, highlight=False)
    return sum(len(console.render_lines(part)) for part in parts)


def facts(rows: Iterable[Sequence[RenderableType]]) -> Table:
    """Names to the left, their values to the right."""
    table = Table.grid(padding=(0, 2))
    table.add_column(style="dim", overflow="fold")
    for row in rows:
        table.add_row(*row)
    return table


class Shared:
    """Headings that several tables have; every other heading stands in one module."""

    CASES = "cases"
    CHANNEL = "channel"
    DELAY = "delay"
    EFFECTIVE = "effective on-time"
    END = "ends at"
    EVERY = "every"
    FIRST_SUN_PULSE = "first Sun pulse"
    IMPULSE = "impulse"
    INPUT = "input"
    LINEAR = "linear"
    MOST = "max"
    NOMINAL = "nominal"
    NUTATION_AFTER = "nutation after"
    ON_TIME = "on-time"
    PROPELLANT = "propellant"
    PULSES = "pulses"
    SCHEME = "scheme"
    SPIN = "spin"
    START = "start"
    THIS_CASE = "this case"
    THRUSTERS = "thrusters"
    VERDICT = "verdict"


class FittedColumns(Table):
    """A table that leaves out columns where they do not fit side by side, those with the largest
    rank first, of one rank the last first, and names them below.

    ``brief``: those with a rank go before a cell takes a second line; else after that.
    """

    ranks: tuple[int, ...] = ()
    brief = False

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        every = list(self.columns)
        texts = [[_plain_text(each.header), *map(_plain_text, each.cells)] for each in every]
        kept = sorted(range(len(every)), key=lambda at: (self.ranks[at], at))
        while True:
            shown = sorted(kept)
            whole = self.brief and self.ranks[kept[-1]] > 0
            fit = fitted([texts[at] for at in shown], options.max_width, words=not whole)
            if fit is not None or len(kept) <= 2:
                break
            kept.pop()
        widths, gap = fit or ([None] * len(shown), 1)
        self.columns = [
            replace(every[at], width=width, _index=place)  # by it rich finds the last one
            for place, (at, width) in enumerate(zip(shown, widths, strict=True))
        ]
        self.padding = (0, gap, 0, 0)
        yield from super().__rich_console__(console, options)
        self.columns = every
        names = [" ".join(texts[at][0].split()) for at in range(len(every)) if at not in shown]
        if names and not quiet():
            cure = " (-v or a wider screen)" if self.brief else " (a wider screen)"
            yield Text(f"left out: {', '.join(names)}{cure}", style="dim")


def fitted(
    columns: list[list[str]], room: int, *, words: bool
) -> tuple[Sequence[int | None], int] | None:
    """Characters for each column, whose first text is its heading, and between two; None without
    ``room``.

    The gap narrows before headings take two lines; then with ``words`` these are what stays whole,
    else all rows do. Room to spare goes to the names of rows, then to what stands last, such as
    reasons.
    """
    whole = [_longest(texts) for texts in columns]
    lines = []
    for heading, *cells in columns:
        blanks = [at for at, letter in enumerate(heading) if letter == " "]
        halves = [_longest((heading[:at], heading[at + 1 :])) for at in (*blanks, len(heading))]
        lines.append(max(min(halves), _longest(cells)))
    parts = [_longest(word for text in texts for word in WORD.findall(text)) for texts in columns]
    for least, gap in product((whole, lines, *([parts] if words else [])), GAPS):
        spare = room - sum(least) - gap * (len(columns) - 1)
        if spare >= 0:
            widths = list(least)
            for wider, at in product((lines, whole), (0, *range(len(widths) - 1, 0, -1))):
                more = max(min(wider[at] - widths[at], spare), 0)
                widths[at] += more
                spare -= more
            return widths, gap
    return None


def _plain_text(cell: RenderableType) -> str:
    return cell.plain if isinstance(cell, Text) else str(cell)


def _longest(texts: Iterable[str]) -> int:
    """Characters of the longest line."""
    return max((cell_len(line) for text in texts for line in text.split("\n")), default=0)


def _columns(names: Iterable[tuple[str, bool]]) -> FittedColumns:
    """A table without rows, of columns by their headings; all but the first one and those of texts
    are flush right.
    """
    table = FittedColumns(box=None, pad_edge=False, header_style="bold")
    for index, (name, is_text) in enumerate(names):
        justify: JustifyMethod = "left" if index == 0 or is_text else "right"
        table.add_column(name, justify=justify, overflow="fold")
    table.ranks = (0,) * len(table.columns)
    return table


TEXT, REAL, WHOLE, YES_NO = "U", "f8", "i8", "bool"
"""Kinds of values: text, number, whole number, and yes or no."""


COLOURS = {None: "", True: "green", False: "bold red"}  # of a cell, by `Column.met`

UNIT = re.compile(
    r"_(deg|rad_s|s|kg|Nms?|kgm2|Pa)$"
)  # ends of names in files that are no part of an attribute


def value_at(row: Any, path: str) -> Any:
    """Value of a row at a dotted ``path`` of attributes; None where one is None."""
    for name in path.split("."):
        row = None if row is None else getattr(row, name)
    return row


def angle_of(path: str) -> Callable[[Any], float | None]:
    """Value of a column: the angle of a row at a ``path`` as `value_at` takes it, in degrees."""

    def value(row: Any) -> float | None:
        angle = value_at(row, path)
        return None if angle is None else math.degrees(angle)

    return value


def values_of(source: Any, *columns: str | Column) -> dict[str, Any]:
    """Values for JSON by their keys: of columns, or of ``key`` for an attribute and its unit, or
    ``key=path``; angles are degrees.
    """
    every = (Column.named(each, "", "") if isinstance(each, str) else each for each in columns)
    return {column.key.replace("#", ""): _plain(column.value(source)) for column in every}


def file_columns(where: str, *names: str) -> list[Column]:
    """Columns of numbers in files alone, with names as in `values_of`."""
    return [Column.named(name, "", "", where=where) for name in names]


def to_figures(count: int, scale: float = 1.0) -> Callable[[float], str]:
    """Text of a column: ``scale`` times a number, to ``count`` figures."""
    return lambda value: f"{scale * value:.{count}g}"


class Column(NamedTuple):
    """One column.

    ``key``: its name in CSV and JSON; ``#`` stands for the three components of a vector, which CSV
    has in columns of their own. ``value`` of a row in the unit of the key, or of the heading
    without a key; None where it is not known. ``text``: the value as people read it, in the unit of
    screens; ``words``: where that takes more than the value, the text of a row. ``where``: the
    places that have the column, separated by blanks. ``when``: tables that have it, by their
    source, else all. ``met``: whether a requirement is met, where a verdict is coloured. ``rank``:
    default screens that are too narrow leave the column out, the largest rank first; 0: never.
    """

    key: str
    heading: str
    unit: str
    value: Callable[[Any], Any]
    text: Callable[[Any], str] = str
    where: str = ""
    when: Callable[[Any], bool] | None = None
    kind: str = REAL
    met: Callable[[Any], bool | None] | None = None
    words: Callable[[Any], str | None] | None = None
    rank: int = 0

    @classmethod
    def named(
        cls,
        name: str,
        heading: str,
        unit: str,
        text: Callable[[Any], str] = str,
        where: str = "",
        **more: Any,
    ) -> Column:
        """Column whose key and value are those of `values_of` by a ``name``."""
        key, _, path = name.partition("=")
        path = path or UNIT.sub("", key)
        value = angle_of(path) if key.endswith("_deg") else lambda row: value_at(row, path)
        return cls(key, heading, unit, value, text, where, **more)

    def shown(self, row: Any) -> str:
        """The value of a row as people read it."""
        if self.words is not None:
            return self.words(row) or MISSING
        value = self.value(row)
        if value is None:
            return MISSING
        factor = screen_unit(self.unit)[1]
        return self.text(value if factor == 1.0 else np.multiply(factor, value))

    def worded(self, row: Any) -> str:
        """The value of a row with its unit."""
        text = self.shown(row)
        return text if text == MISSING else f"{text} {screen_unit(self.unit)[0]}"

    def headed(self, between: str) -> str:
        """Heading and unit of screens."""
        return f"{self.heading}{between}{screen_unit(self.unit)[0]}" if self.unit else self.heading


class Heading(NamedTuple):
    """Heading of a column for people; ``number``: flush right, and sorted by value; ``rank`` as of
    `Column`.
    """

    name: str
    unit: str = ""
    number: bool = True
    rank: int = 0


@dataclass(frozen=True)
class DataTable:
    """Rows of one result under their columns; ``source`` decides which there are, ``mark`` is a row
    to stand out.
    """

    title: str
    columns: Sequence[Column]
    rows: Sequence[Any]
    source: Any = None
    mark: int | None = None

    def at(self, place: str) -> list[Column]:
        """Columns that a place has."""
        return [
            column
            for column in self.columns
            if place in column.where.split() and (column.when is None or column.when(self.source))
        ]

    def headings(self, place: str) -> tuple[Heading, ...]:
        """Headings for people."""
        return tuple(
            Heading(column.heading, screen_unit(column.unit)[0], column.kind != TEXT, column.rank)
            for column in self.at(place)
        )

    def cells(self, place: str) -> tuple[tuple[str, ...], ...]:
        """Texts for people, row by row."""
        shown = self.at(place)
        return tuple(tuple(column.shown(row) for column in shown) for row in self.rows)

    def screen(self, place: str, *, first: int | None = None) -> FittedColumns:
        """A table of a screen; of many rows the ``first`` ones and the last."""
        shown = self.at(place)
        table = _columns((column.headed(" "), column.kind == TEXT) for column in shown)
        table.ranks = tuple(column.rank for column in shown)
        last = len(self.rows) - 1
        cut = last if first is None or last < first + 2 else first
        for index, row in enumerate(self.rows):
            if index < cut or index == last:
                cells = [_cell(column, row) for column in shown]
                if index == self.mark:
                    cells[0].style = "bold"
                table.add_row(*cells)
            elif index == cut:
                table.add_row(f"… {last - cut} more")
        return table

    def transposed(self, place: str, corner: str = "") -> FittedColumns:
        """Quantities down and rows across, named by the first column; ``corner``: heading."""
        name, *shown = self.at(place)
        table = _columns((head, False) for head in (corner, *map(name.shown, self.rows)))
        if self.mark is not None:
            table.ranks = (0, *(int(index != self.mark) for index in range(len(self.rows))))
        for column in shown:
            cells = (_cell(column, row) for row in self.rows)
            table.add_row(Text(column.headed(", "), style="dim"), *cells)
        return table

    def array(self) -> NDArray[np.void]:
        """Fields as in CSV files; unknown values are NaN or empty."""
        names, kinds, rows = self._fields()
        longest = [
            max([1, *(len(row[at]) for row in rows)]) if kind == TEXT else ""
            for at, kind in enumerate(kinds)
        ]
        types = [f"{kind}{length}" for kind, length in zip(kinds, longest, strict=True)]
        return np.array(rows, dtype=list(zip(names, types, strict=True)))

    def csv(self) -> str:
        """A CSV file; unknown values are empty."""
        from nutdamp.files.tabular import csv_text, number

        names, _, rows = self._fields()
        texts = (
            [number(cell) if isinstance(cell, float) else str(cell) for cell in row] for row in rows
        )
        return csv_text(names, texts)

    def json(self, place: str = "json") -> list[dict[str, Any]]:
        """A dict a row; vectors are lists, unknown values None."""
        shown = self.at(place)
        return [values_of(row, *shown) for row in self.rows]

    def _fields(self) -> tuple[list[str], list[str], list[tuple[Any, ...]]]:
        """Names, kinds and rows of the file, a vector in three columns."""
        names, kinds = list[str](), list[str]()
        shown = self.at("csv")
        for column in shown:
            axes = ("_1", "_2", "_3") if "#" in column.key else ("",)
            names += [column.key.replace("#", axis) for axis in axes]
            kinds += [TEXT if column.kind == YES_NO else column.kind for _ in axes]
        return (
            names,
            kinds,
            [tuple(part for column in shown for part in _parts(column, row)) for row in self.rows],
        )


def _cell(column: Column, row: Any) -> Text:
    return Text(column.shown(row), COLOURS[None if column.met is None else column.met(row)])


def _parts(column: Column, row: Any) -> list[Any]:
    value = column.value(row)
    if "#" in column.key:
        return [math.nan] * 3 if value is None else [float(part) for part in value]
    if column.kind == YES_NO:
        return ["" if value is None else str(value).lower()]
    if column.kind == TEXT:
        return [value or ""]
    return [math.nan if value is None else value]


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
