"""The pattern of screens: headline, requirement, one table, notes, next steps, in `LINES` lines of `WIDTH` columns.

What gives way stands on the full screen (``-v``): rows in the middle of the table, then notes, the last ones first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.common.results import Note
from nutdamp.planning.decision import Decision
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views.decisions import decision_table
from nutdamp.views.end_tables import title
from nutdamp.views.layout import lines_of
from nutdamp.views.notes import NOTE, WARNING, screen_line
from nutdamp.views.plan_tables import header

LINES = 40
"""Lines of a default screen."""

SIZES = ((14, 3), (8, 3), (4, 3), (4, 2), (4, 1), (1, 0))
"""Rows of the table before the last one, and notes: the first pair that fits is shown."""

Rows = Callable[..., RenderableType]
"""A table; with ``first`` only of so many rows, and the last one."""


def opening(body: Spacecraft, verbose: bool) -> Iterator[RenderableType]:
    """Name and motion of a spacecraft at t = 0; ``verbose``: all its derived quantities."""
    if verbose:
        yield from (header(body), Text())
        return
    yield from title(body)


Remark = str | Note
"""A note of the catalogue, or a sentence of one screen."""


def line_of(remark: Remark, level: str = NOTE) -> Text:
    """A remark as a line of a screen; ``level``: severity of a sentence."""
    if isinstance(remark, Note):
        return screen_line(remark)
    return Text.assemble((f"{level}: ", "bold red" if level == WARNING else "bold"), remark.removesuffix("."))


def warnings_of(remarks: Iterable[Remark]) -> list[Text]:
    """Warnings, each once."""
    return [line_of(remark, WARNING) for remark in dict.fromkeys(remarks)]


def margin_lines(decision: Decision, values: str = "nominal") -> list[RenderableType]:
    """The margins of a flight, where there are any; ``values`` heads the residuals."""
    return [decision_table(decision, values)] if decision.lines or decision.aspects else []


def summary(
    head: Sequence[RenderableType],
    table: Rows | None,
    remarks: Iterable[Remark],
    steps: str,
    *,
    more: Iterable[RenderableType] = (),
    verbose: bool = False,
) -> RenderableType:
    """A default screen, with ``steps`` to take next; ``verbose``: with all rows and remarks, and ``more`` parts."""
    notes = [line_of(remark) for remark in dict.fromkeys(remarks) if remark]
    if verbose:
        body = [Text(), table()] if table is not None else []
        for part in more:
            body += [Text(), part]
        return Group(*head, *body, *[Text()] * bool(notes), *notes)

    def screen(rows: int, count: int) -> Group:
        body = [Text(), table(first=rows)] if table is not None else []
        hidden = f" ({len(notes) - count} more)" if len(notes) > count else ""
        last = Text(f"-v all values{hidden} · {steps}", style="dim")
        return Group(*head, *body, *[Text()] * bool(body), *notes[:count], last)

    sizes = (screen(*size) for size in SIZES)
    return next((shown for shown in sizes if lines_of(shown) <= LINES), screen(*SIZES[-1]))
