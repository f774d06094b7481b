"""The pattern of screens: headline, requirement, one table, notes, next steps, in `LINES` lines of `WIDTH` columns.

What gives way stands on the full screen (``-v``): rows in the middle of the table, then notes, the last ones first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.common.results import Note
from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.views.pulses import block_table
from nutdamp.views.spacecraft import angle_names, angle_texts, derived_table, spin_text, title
from nutdamp.views.tables import facts, lines_of
from nutdamp.views.text import NOTE, WARNING, degrees, mass, moment, quantity, screen_line

LINES = 40  # lines of a default screen
SIZES = ((14, 3), (8, 3), (4, 3), (4, 2), (4, 1), (1, 0))  # rows before the last one, and notes: the first that fits


Rows = Callable[..., RenderableType]
"""A table; with ``first`` only of so many rows, and the last one."""


def opening(body: Spacecraft, verbose: bool) -> Iterator[RenderableType]:
    """Name and motion of a spacecraft at t = 0; ``verbose``: all its derived quantities."""
    yield from (Text(body.name, style="bold"), derived_table(body), Text()) if verbose else title(body)


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


def blocks_screen(flown: Flight, velocity: Vector | None) -> RenderableType:
    """The blocks of a flown schedule, its figures before and after, and its ``velocity`` change (3,) m/s."""
    table = block_table(flown)
    return Group(Text(table.title, style="bold"), table.screen("screen"), Text(), facts(_effects(flown, velocity)))


def _effects(flown: Flight, velocity: Vector | None) -> Iterator[tuple[str, str]]:
    body, schedule, final = flown.spacecraft, flown.schedule, flown.final
    before, after = flown.around_pulses()
    for name, pulse in (("first pulse", schedule.pulses[0]), ("last pulse", schedule.pulses[-1])):
        start = pulse.loaded[0]
        dated = body.utc(start, 3)
        yield name, f"starts at {moment(start)}" + (f", {dated}" if dated else "")
    for name, before_, after_ in zip(
        angle_names(body), angle_texts(body, body.momentum), angle_texts(body, final.momentum), strict=True
    ):
        yield f"H: {name}", f"{before_} to {after_}"
    assert body.sun is not None
    ends = (attitude.angle_between(momentum, body.sun) for momentum in (body.momentum, final.momentum))
    yield "Sun angle of H", " to ".join(degrees(float(angle)) for angle in ends)
    yield "spin", f"{spin_text(body.spin)} to {spin_text(final.spin)}"
    largest = float(max(before.nutation.max(), after.nutation.max()))
    yield "nutation", f"{degrees(body.nutation)} to {degrees(final.nutation)}; largest {degrees(largest)}"
    used, tank, spent = schedule.propellant, body.tank, mass(schedule.propellant)
    if used is not None and tank is not None:
        spent += f" of {mass(tank.propellant)}; {mass(tank.propellant - used)} left"
    if used is not None and body.mass is not None:
        spent += f"; mass {quantity(body.mass, 'kg', 6)} to {quantity(body.mass - used, 'kg', 6)}"
    yield "propellant", spent
    if velocity is not None:
        yield "|ΔV|", quantity(float(np.linalg.norm(velocity)), "m/s")
