"""Tables declared once: each column has a name in files, a heading for people, a unit, and a value
of a row.

Screens, pages, CSV, JSON and arrays are made from the same declaration, so that a number that
stands in several places is computed, named and rounded in one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from io import StringIO
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
    """A table with a line a row, however narrow the screen is.

    Where its columns do not fit side by side, those with a rank are left out if it may be
    ``shortened``, the largest rank first; if it is ``told``, a last line names them. What still
    does not fit goes on below, beside the first column again.
    """

    ranks: tuple[int, ...] = ()
    shortened = False
    told = False

    def texts(self) -> list[list[str]]:
        """Heading and cells of each column."""
        return [[_plain_text(each.header), *map(_plain_text, each.cells)] for each in self.columns]

    def left_out(self, room: int) -> list[int]:
        """Places of the columns that ``room`` characters leave out."""
        texts = self.texts()
        shown = list(range(len(texts)))
        while self.shortened and not fitted([texts[at] for at in shown], room, words=False):
            ranked = max(shown, key=self.ranks.__getitem__)
            if not self.ranks[ranked]:
                break
            shown.remove(ranked)
        return [at for at in range(len(texts)) if at not in shown]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        every = list(self.columns)
        texts = self.texts()
        room = options.max_width
        left_out = self.left_out(room)
        shown = [at for at in range(len(every)) if at not in left_out]
        while shown:
            count = len(shown)
            while count > 2 and not fitted([texts[at] for at in shown[:count]], room):
                count -= 1
            part, below = shown[:count], shown[count:]
            widths, gap = fitted([texts[at] for at in part], room) or ([None] * count, 1)
            self.columns = [
                replace(every[at], width=width, _index=place)  # by it rich finds the last one
                for place, (at, width) in enumerate(zip(part, widths, strict=True))
            ]
            self.padding = (0, gap, 0, 0)
            yield from super().__rich_console__(console, options)
            if below:
                yield Text()
            shown = [0, *below] if below else []
        self.columns = every
        if self.told and left_out:
            names = (" ".join(texts[at][0].split()) for at in left_out)
            words = f"left out: {', '.join(names)}"
            cure = " (-v or a wider screen)"
            yield Text(words + cure if len(words + cure) <= room else words, style="dim")


def fitted(
    columns: list[list[str]], room: int, *, words: bool = True
) -> tuple[Sequence[int | None], int] | None:
    """Characters for each column, whose first text is its heading, and between two; None without
    ``room``.

    The gap narrows before headings take two lines; then with ``words`` these are what stays whole,
    else all rows do. Room to spare goes to the names of rows, then to what stands last, such as
    reasons.
    """
    whole = [_longest(texts) for texts in columns]
    lines = [
        max(min(map(_longest, _halves(heading))), _longest(cells)) for heading, *cells in columns
    ]
    parts = [_longest(word for text in texts for word in WORD.findall(text)) for texts in columns]
    for least in (whole, lines, *([parts] if words else [])):
        for gap in GAPS:
            spare = room - sum(least) - gap * (len(columns) - 1)
            if spare < 0:
                continue
            widths = list(least)
            for wider in (lines, whole):
                for at in (0, *range(len(widths) - 1, 0, -1)):
                    more = max(min(wider[at] - widths[at], spare), 0)
                    widths[at] += more
                    spare -= more
            return widths, gap
    return None


def _plain_text(cell: RenderableType) -> str:
    return cell.plain if isinstance(cell, Text) else str(cell)


def _halves(heading: str) -> Iterator[tuple[str, str]]:
    """A heading on one line, and on two broken at each of its blanks."""
    words = heading.split(" ")
    return ((" ".join(words[:at]), " ".join(words[at:])) for at in range(1, len(words) + 1))


def _longest(texts: Iterable[str]) -> int:
    """Characters of the longest line."""
    return max((cell_len(line) for text in texts for line in text.split("\n")), default=0)


def columns(*names: str, text: tuple[str, ...] = ()) -> FittedColumns:
    """A table of numbers, flush right under their headings, but for the first column and those
    named ``text``.
    """
    table = FittedColumns(box=None, pad_edge=False, header_style="bold")
    for index, name in enumerate(names):
        justify: JustifyMethod = "left" if index == 0 or name in text else "right"
        table.add_column(name, justify=justify, overflow="fold")
    table.ranks = (0,) * len(names)
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


def _named_value(name: str) -> tuple[str, Callable[[Any], Any]]:
    key, _, path = name.partition("=")
    path = path or UNIT.sub("", key)
    return key, angle_of(path) if key.endswith("_deg") else lambda row: value_at(row, path)


def values_of(source: Any, *names: str) -> dict[str, Any]:
    """Values for JSON by their names: ``key`` of an attribute and its unit, or ``key=path``; angles
    are degrees.
    """
    return {key: _plain(value(source)) for key, value in map(_named_value, names)}


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
        key, value = _named_value(name)
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

    def screen(self, place: str, *, between: str = " ", first: int | None = None) -> FittedColumns:
        """A table of a screen; ``between`` heading and unit, and of many rows the ``first`` ones
        and the last.
        """
        shown = self.at(place)
        headed = [(column.headed(between), column) for column in shown]
        text = tuple(name for name, column in headed if column.kind == TEXT)
        table = columns(*(name for name, _ in headed), text=text)
        table.ranks = tuple(column.rank for column in shown)
        last = len(self.rows) - 1
        cut = last if first is None or last < first + 2 else first
        for index, row in enumerate(self.rows):
            if index < cut or index == last:
                table.add_row(
                    *(self._cell(column, row, index, at == 0) for at, column in enumerate(shown))
                )
            elif index == cut:
                table.add_row(f"… {last - cut} more")
        return table

    def _cell(self, column: Column, row: Any, index: int, first: bool) -> Text:
        met = None if column.met is None else column.met(row)
        return Text(column.shown(row), "bold" if first and index == self.mark else COLOURS[met])

    def transposed(self, place: str, corner: str = "", names: str = "dim") -> FittedColumns:
        """Quantities down and rows across, named by the first column; ``corner``: heading,
        ``names``: their style.
        """
        name, *shown = self.at(place)
        table = columns(corner, *map(name.shown, self.rows))
        for column in shown:
            cells = (
                self._cell(column, row, index, first=False) for index, row in enumerate(self.rows)
            )
            table.add_row(Text(column.headed(", "), style=names), *cells)
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
        return [
            {column.key.replace("#", ""): _plain(column.value(row)) for column in shown}
            for row in self.rows
        ]

    def _fields(self) -> tuple[list[str], list[str], list[tuple[Any, ...]]]:
        """Names, kinds and rows of the file, a vector in three columns."""
        shown = self.at("csv")
        names = [name for column in shown for name in _names(column)]
        kinds = [
            TEXT if column.kind == YES_NO else column.kind
            for column in shown
            for _ in _names(column)
        ]
        return (
            names,
            kinds,
            [tuple(part for column in shown for part in _parts(column, row)) for row in self.rows],
        )


def _names(column: Column) -> list[str]:
    return (
        [column.key.replace("#", f"_{axis}") for axis in (1, 2, 3)]
        if "#" in column.key
        else [column.key]
    )


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
