"""Contents of a report, apart from their look: a page of sections, made of a few kinds of blocks.

The name of its class is that of the macro of the templates that shows a block.
"""

from __future__ import annotations

import base64
import os
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, NamedTuple

from nutdamp.errors import BadRequest
from nutdamp.planning.verdict import Line
from nutdamp.views.tables import DataTable, Heading
from nutdamp.views.text import sentence


class Sheet(NamedTuple):
    """A table with one row for each thing compared; the first column names it.

    ``mark`` is the row to stand out; ``folds``: on a phone each row is a list of its own.
    """

    title: str
    columns: tuple[Heading, ...]
    rows: tuple[tuple[str, ...], ...]
    mark: int | None = None
    folds: bool = False


class FactList(NamedTuple):
    """Names and their values."""

    title: str
    rows: tuple[tuple[str, str], ...]


class Prose(NamedTuple):
    """A paragraph; ``alarm``: it stands in a red frame."""

    text: str
    alarm: bool = False


class Points(NamedTuple):
    """A list of short paragraphs, each with the name of its subject, if any."""

    rows: tuple[tuple[str, str], ...]


class Picture(NamedTuple):
    """A title, if any, a caption, and two ``<svg>`` elements: that for wide screens and paper, and
    the ``narrow`` one for a phone.
    """

    title: str
    caption: str
    svg: str
    narrow: str


class Listing(NamedTuple):
    """Text as it is in a file or on a command line."""

    title: str
    text: str


class Download(NamedTuple):
    """A file that the page holds, to be saved from it."""

    name: str
    text: str

    @property
    def content(self) -> str:
        """The text as base64."""
        return base64.b64encode(self.text.encode()).decode()


class Details(NamedTuple):
    """Blocks behind their title, which a click opens; they are not printed."""

    title: str
    blocks: tuple[Block, ...]


class Moving(NamedTuple):
    """The view of the motion that a script moves: what is ``shown`` of it before, and the rows as
    the JSON ``data``.
    """

    shown: dict[str, Any]
    data: str


Block = Sheet | FactList | Prose | Points | Picture | Listing | Download | Moving | Details


class PageSection(NamedTuple):
    """A heading with its blocks; ``name`` is its id."""

    name: str
    title: str
    blocks: tuple[Block, ...]


class Control(NamedTuple):
    """Entries of configuration control on a document; empty where none is given."""

    title: str = ""
    document: str = ""
    issue: str = ""
    author: str = ""
    date: str = ""

    @property
    def number(self) -> str:
        """Number of the document and its issue."""
        return " ".join(filter(None, (self.document, self.issue and f"iss {self.issue}")))

    @property
    def line(self) -> str:
        """The entries but for the title, on one line."""
        return " · ".join(filter(None, (self.number, self.author, self.date)))


def controlled(**entries: str) -> Control:
    """Entries of configuration control on a page; the date defaults to SOURCE_DATE_EPOCH, where
    that is set.

    Raises BadRequest for other names, and for a SOURCE_DATE_EPOCH that is no number of seconds.
    """
    unknown = sorted({*entries} - {*Control._fields})
    if unknown:
        raise BadRequest(f"{unknown[0]}: expected one of {', '.join(Control._fields)}")
    control = Control(**entries)
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    if control.date or not epoch:
        return control
    try:
        return control._replace(date=datetime.fromtimestamp(int(epoch), UTC).date().isoformat())
    except (ValueError, OverflowError, OSError):
        raise BadRequest(
            f"SOURCE_DATE_EPOCH = {epoch!r}: expected a number of seconds since 1970"
        ) from None


UNCONTROLLED = Control()  # configuration control of a page without any entry


@dataclass(frozen=True, slots=True)
class Page:
    """A whole report: title, first screen with decision and motion, and sections.

    ``state``: value of the `Light` of the verdict; ``broken``: limits that the schedule of a file
    breaks. ``source``: the beginning of the hash of the input file. ``bounds`` have a bar in each
    row, from the ``lines`` of the verdict; ``pulses``: all, or the first and the last of
    ``count``. ``still``: picture where no script moves the view.
    """

    title: str
    control: Control
    source: str
    state: str
    headline: tuple[str, str]
    notes: tuple[str, ...]
    made_by: str
    verdict: str = ""
    broken: tuple[str, ...] = ()
    bounds: Sheet | None = None
    lines: tuple[Line, ...] = ()
    pulses: Sheet | None = None
    count: int = 0
    facts: FactList | None = None
    acceptance: Block | None = None
    warnings: tuple[str, ...] = ()
    motion: Moving | None = None
    still: Picture | None = None
    sections: tuple[PageSection, ...] = ()

    @property
    def summary(self) -> str:
        """Headline, verdict and warnings as one text."""
        parts = ("".join(self.headline), self.verdict, *self.warnings)
        return " ".join(sentence(part.removesuffix(".")) for part in parts if part)

    @property
    def footer(self) -> str:
        """Text at the foot of each sheet of paper, beside its number."""
        parts = (self.control.number or self.title, self.control.date, self.source, self.made_by)
        return ", ".join(filter(None, parts))


def sheet(table: DataTable, place: str = "page", **look: Any) -> Sheet:
    """A declared table as a `Sheet` with further fields of its ``look``."""
    first, *rest = table.headings(place)
    named = first._replace(name=first.name or "quantity")
    return Sheet(table.title, (named, *rest), table.cells(place), table.mark)._replace(**look)


def fact_list(title: str, named: Iterable[tuple[str, str]]) -> FactList:
    """Names and values as `FactList`; a value without a name continues the one before."""
    rows: list[tuple[str, str]] = []
    for name, value in named:
        if name or not rows:
            rows.append((name, value))
        else:
            rows[-1] = (rows[-1][0], f"{rows[-1][1]}; {value}")
    return FactList(title, tuple(rows))
