"""Contents of a report, apart from their look: a page of sections, made of a few kinds of blocks."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, NamedTuple

from rich.console import Group
from rich.table import Table
from rich.text import Text

from nutdamp.errors import BadRequest
from nutdamp.views.tables import DataTable, Heading

if TYPE_CHECKING:
    from nutdamp.page.scales import Panel, Strip
    from nutdamp.page.workbench import Workbench
    from nutdamp.spacecraft.model import Vector


@dataclass(frozen=True, slots=True)
class Sheet:
    """A table with one row for each thing compared; the first column names it.

    ``mark`` is the row to stand out; ``sortable``: the rows of a column have one unit. ``stacked``: where there is
    little room each row becomes a block, so that nothing has to be scrolled.
    """

    title: str
    columns: tuple[Heading, ...]
    rows: tuple[tuple[str, ...], ...]
    mark: int | None = None
    sortable: bool = True
    stacked: bool = False


@dataclass(frozen=True, slots=True)
class FactList:
    """Names and their values."""

    title: str
    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Prose:
    """A paragraph."""

    text: str


@dataclass(frozen=True, slots=True)
class Remarks:
    """Remarks, each with the name of its subject."""

    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Points:
    """A list of short paragraphs."""

    rows: tuple[str, ...]


LONG = 550.0
"""Units of a drawing of which text of 7.5 units is 9 px high on a page of 720 px."""


@dataclass(frozen=True, slots=True)
class Picture:
    """An ``<svg>`` element, its title, a caption, and a description for those who do not see it.

    For narrow screens there is another drawing, ``narrow``, or ``views``: panels and entries of the legend as view
    boxes on the group called ``name`` in it, which are shown as wide as they are at most, in px.
    """

    svg: str
    title: str
    caption: str
    described: str
    narrow: str = ""
    name: str = ""
    views: tuple[tuple[str, int], ...] = ()

    @property
    def long(self) -> bool:
        """True where its text is too small to read where the page is little wider than a narrow screen."""
        return float(self.svg.split('viewBox="', 1)[1].split()[2]) > LONG


@dataclass(frozen=True, slots=True)
class Listing:
    """Text as it is in a file or on a command line."""

    title: str
    text: str


class Circle(NamedTuple):
    """A circle of ``radius`` rad on the globe; ``kind`` styles it."""

    name: str
    radius: float
    kind: str


class NamedDirection(NamedTuple):
    """A direction on the globe, (3,) inertial unit vector, with circles around it; ``kind`` styles it.

    ``watched``: the angle from it to the spin axis is shown.
    """

    name: str
    axis: Vector
    kind: str
    circles: tuple[Circle, ...] = ()
    watched: bool = False


@dataclass(frozen=True, slots=True)
class Moving:
    """Fixed parts of the moving view, and its moving parts as the JSON ``data``.

    ``longitude``: name of the numbers of the globe; ``how``: the model that is flown; ``absent``: the reason for
    which there is no ``workbench``; ``command``: that which writes the same rows.
    """

    panels: tuple[Panel, ...]
    strip: Strip
    speeds: tuple[tuple[float, str], ...]
    speed: float
    angles: tuple[str, str]
    named: tuple[NamedDirection, ...]
    dated: bool
    longitude: str
    steep: bool
    how: str
    workbench: Workbench | None
    absent: str
    command: tuple[str, ...]
    data: str


Block = Sheet | FactList | Prose | Remarks | Points | Picture | Moving | Listing


class PageSection(NamedTuple):
    """A heading with its blocks; ``name`` is the target of links."""

    name: str
    title: str
    blocks: tuple[Block, ...]


class Figure(NamedTuple):
    """One of the few numbers to read first; ``note``: the number to compare it with."""

    name: str
    value: str
    note: str = ""


class Control(NamedTuple):
    """Entries of configuration control on a document; empty where none is given."""

    title: str = ""
    document: str = ""
    issue: str = ""
    author: str = ""
    date: str = ""

    @property
    def named(self) -> tuple[tuple[str, str], ...]:
        """Names and values of the entries given, but for the title."""
        pairs = zip(self._fields[1:], self[1:], strict=True)
        return tuple((name, value) for name, value in pairs if value)


def controlled(**given: str) -> Control:
    """Entries of configuration control on a page; the date defaults to SOURCE_DATE_EPOCH, where that is set.

    Raises BadRequest for other names, and for a SOURCE_DATE_EPOCH that is no number of seconds.
    """
    unknown = sorted({*given} - {*Control._fields})
    if unknown:
        raise BadRequest(f"{unknown[0]}: expected one of {', '.join(Control._fields)}")
    control, epoch = Control(**given), os.environ.get("SOURCE_DATE_EPOCH", "")
    if control.date or not epoch:
        return control
    try:
        return control._replace(date=datetime.fromtimestamp(int(epoch), UTC).date().isoformat())
    except (ValueError, OverflowError, OSError):
        raise BadRequest(f"SOURCE_DATE_EPOCH = {epoch!r}: expected a number of seconds since 1970") from None


UNCONTROLLED = Control()
"""Configuration control of a page without any entry."""


@dataclass(frozen=True, slots=True)
class Page:
    """A whole report: title, verdict, the decision, numbers to read first, sections.

    ``met``: whether the requirement is, None where nothing is required; ``good``: nothing is missed at all.
    """

    title: str
    control: Control
    verdict: str
    met: bool | None
    good: bool
    decision: tuple[Block, ...]
    figures: tuple[Figure, ...]
    sections: tuple[PageSection, ...]
    made_by: str

    @property
    def footer(self) -> str:
        """Text at the foot of each sheet of paper, beside its number."""
        document, issue, date = self.control.document, self.control.issue, self.control.date
        return ", ".join(filter(None, (document or self.title, issue and f"issue {issue}", date)))


def sheet(title: str, table: DataTable, place: str = "page") -> Sheet:
    """A declared table as a `Sheet`."""
    return Sheet(title, table.headings(place), table.cells(place), table.mark)


def sheet_of(title: str, table: Table) -> Sheet:
    """A table of a screen as a `Sheet`: the same cells; a heading in two lines is name and unit.

    Where the first column has no heading, each row is a quantity of its own unit.
    """
    columns = []
    for column in table.columns:
        name, _, unit = plain(column.header).partition("\n")
        columns.append(Heading(name, unit, column.justify == "right"))
    first = columns[0]
    headed = (first._replace(name=first.name or "quantity"), *columns[1:])
    return Sheet(title, headed, _rows(table), sortable=bool(first.name))


def facts_of(title: str, table: Table) -> FactList:
    """A screen's list of names and values as `FactList`; a row without a name continues the one before."""
    rows: list[tuple[str, str]] = []
    for name, value in _rows(table):
        if name or not rows:
            rows.append((name, value))
        else:
            rows[-1] = (rows[-1][0], f"{rows[-1][1]}; {value}")
    return FactList(title, tuple(rows))


def blocks_of(title: str, screen: Group) -> Iterator[Block]:
    """Blocks of a screen: a line straight above a table is its title, else ``title`` is."""
    above = ""
    for part in screen.renderables:
        if isinstance(part, Table):
            maker = sheet_of if part.show_header else facts_of
            yield maker(above or title, part)
            above = ""
            continue
        if above:
            yield Prose(above)
        above = plain(part)
    if above:
        yield Prose(above)


def _rows(table: Table) -> tuple[tuple[str, ...], ...]:
    cells: list[Iterable[str]] = [map(plain, column.cells) for column in table.columns]
    return tuple(zip(*cells, strict=True))


def plain(cell: object) -> str:
    """The text of a cell, which in the tables of the screens is a text with or without a style."""
    return cell.plain if isinstance(cell, Text) else str(cell)
