"""Contents of a report, apart from their look: a page of sections, made of a few kinds of blocks;
and the manoeuvre sheet, made of them.

The name of its class is that of the macro of the templates that shows a block. The sheet is one
page for those who fire: conditions to begin, a row a pulse or block, what to do on hold.
"""

from __future__ import annotations

import base64
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

from nutdamp.common.results import note
from nutdamp.errors import BadRequest
from nutdamp.planning.notes import ideal_code
from nutdamp.planning.plan import Plan
from nutdamp.planning.verdict import Line, Verdict
from nutdamp.spacecraft import equipment, requirements
from nutdamp.spacecraft.constraints import channel_of
from nutdamp.spacecraft.model import Spacecraft, required_share
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import STEERABLE, Pulse
from nutdamp.views.glance import limits
from nutdamp.views.parts import MILLISECONDS, channel_text, clock, phases, sun_phased
from nutdamp.views.tables import TEXT, Column, DataTable, Heading, Shared
from nutdamp.views.text import MISSING, RPM, fixed, sentence, short_angle, text
from nutdamp.views.verdict import exact_percent, spent

if TYPE_CHECKING:
    from nutdamp.planning.screening import Checkpoints


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


# largest number of rows with a range of the nutation; of more evenly spaced ones have one
CHECKED = 24
FINEST = 6  # largest number of decimals of times
DECIDED = 10.0  # s of a coast in which nobody can look at telemetry, decide and command a hold

ON_HOLD = (
    "Fire none of the rows that are left: they are void. Record spin, "
    "nutation and phase with their time. Plan again "
    "from that motion, and fire by a new sheet."
)


def manoeuvre_blocks(
    plan: Plan, judged: Verdict, identity: Sequence[tuple[str, str]], summary: str
) -> Iterator[Block]:
    """Blocks of the sheet of a plan: ``identity`` of document and file first, then the ``summary``
    of the verdict.

    Only a plan to fly has conditions to begin, limits to hold, boxes and signatures; ideal impulses
    have none either.
    """
    spacecraft, pulses = plan.spacecraft, plan.pulses
    ideal = ideal_code(plan)
    if not pulses.pulses:
        yield Prose(summary, alarm=bool(judged.status.exit_status))
        return
    flies = judged.flies and not ideal
    if not judged.flies:
        yield Prose("NOT FOR FLIGHT", alarm=True)
    zero = spacecraft.utc(0.0, MILLISECONDS) or "no epoch in the file; times count from t = 0"
    yield FactList("Document and time", (*identity, ("UTC of t = 0", zero)))
    yield Prose(summary, alarm=not judged.flies)
    if ideal:
        yield Prose(sentence(text(note(ideal, scheme=plan.scheme))))
    points = None
    if flies and judged.results is not None:
        from nutdamp.planning.screening import Checkpoints

        points = Checkpoints(judged.results.study)
    if flies and points is None:
        yield Prose("Tolerances not checked.")
    if flies:
        title = "GO at t = 0 with (nominal)" if points is None else "GO at t = 0 with"
        yield FactList(title, tuple(_conditions(spacecraft, points)))
    rows = _rows(plan, judged, points)
    table = DataTable("Fire" if flies else "Pulses", _columns(plan, rows), rows, flies)
    yield sheet(table, "sheet", folds=True)
    digits = _decimals(spacecraft)
    date = spacecraft.utc(pulses.end, min(digits, MILLISECONDS))
    totals = (
        f"pulses: {len(pulses)}; on-time {math.fsum(each.loaded[1] for each in pulses):.{digits}f} "
        f"s; {spent(pulses)}; the last ends at {pulses.end:.{digits}f} s"
    )
    sense = ", positive about +3, so that it falls with this spin"
    phase = (
        "Sun phase: angle from the Sun sensor to the Sun about axis 3, against the spin"
        if sun_phased(spacecraft)
        else "Spin phase: angle by which the body has turned about axis 3 since t = 0"
        + (sense if spacecraft.spin < 0.0 else "")
    )
    told = [
        ("totals", totals + (f" ({date})" if date else "")),
        ("on hold", ON_HOLD),
        ("phase", f"{phase}, at the commanded start."),
    ]
    if not flies:
        yield FactList("Totals", (told[0], told[2]))
        return
    yield FactList("Totals and hold", tuple(told))
    yield Sheet(
        "Signatures",
        tuple(Heading(name, number=False) for name in ("sheet", "name", "signature", "date")),
        (("prepared", "", "", ""), ("checked", "", "", "")),
    )


def _conditions(spacecraft: Spacecraft, points: Checkpoints | None) -> Iterator[tuple[str, str]]:
    """Spin, nutation and phase at which the first row may be fired.

    The phase window is the shift of all pulses in phase and in time with which enough cases comply,
    rounded towards none.
    """
    spin = f"{spacecraft.spin * RPM:.5g}"
    nutation = short_angle(spacecraft.tilt)
    if points is None:
        yield "spin", f"{spin} rpm"
        yield "nutation", f"{nutation} deg"
        yield "phase window", "not set: tolerances not checked"
        return
    spins = f"{points.spin.least * RPM:.5g} to {points.spin.most * RPM:.5g} rpm"
    angles = f"{short_angle(points.nutation.least)} to {short_angle(points.nutation.most)} deg"
    yield "spin", f"{spins} (nominal {spin})"
    yield "nutation", f"{angles} (nominal {nutation})"
    probability = required_share(spacecraft.requirement)
    share = exact_percent(probability)
    window = points.window(probability)

    def inwards(unit: float, digits: int) -> str:
        scale = 10.0**digits
        ends = (math.trunc(unit * shift * scale) / scale for shift in window or ())
        return " to ".join(f"{end:+.{digits}f}" for end in ends)

    phases = inwards(math.degrees(abs(spacecraft.spin)), 1)
    times = inwards(1.0, _decimals(spacecraft))
    said = f"{phases} deg from those below ({times} s): {share} of cases comply"
    if window is None:
        said = f"none: fewer than {share} of the cases comply at the phases below"
    if not requirements.judged(spacecraft):
        said = "not known: nothing is required"
    yield "phase window", said


class SheetRow(NamedTuple):
    """A pulse or block, from 0: its first pulse, Sun or spin phase at its start and nutation after
    it, rad.

    ``hold``: range of the nutation outside of which nothing more is fired, of the last row the
    limit to accept; ``decide``: time by which that must be known.
    """

    at: int
    pulse: Pulse
    block: equipment.Block | None
    phase: float
    nutation: float
    hold: str
    decide: str


def _deadline(spacecraft: Spacecraft, end: float, start: float) -> str:
    """Time by which it must be known whether the next row is fired: its start; a short coast leaves
    no time.
    """
    if start - end < DECIDED:
        return "automatic"
    return clock(spacecraft, start) or f"{math.floor(10.0 * start) / 10.0:.1f} s"


def _rows(plan: Plan, judged: Verdict, points: Checkpoints | None) -> list[SheetRow]:
    """One row a pulse or block, as it is commanded, with the nutation after it; its range is that
    of cases that end well, with the nominal value in it.
    """
    flown, spacecraft, pulses = plan._flight, plan.spacecraft, plan.pulses.pulses
    own = plan.pulses.pulses_by_block
    blocks: Sequence[equipment.Block | None] = plan.pulses.blocks or [None] * len(own)
    turned = phases(flown)
    angles = flown.around_pulses()[1].nutation
    counts = [numbers[-1] + 1 for numbers in own]
    after = [float(angles[count - 1]) for count in counts]
    holds = ["not set" if points is None else MISSING] * len(own)
    largest = limits(spacecraft)[0]
    if points is not None:
        from nutdamp.planning.screening import even

        shown = [number - 1 for number in even(len(own), CHECKED)]
        ranges = points.nutation_after([counts[row] for row in shown])
        for row, (low, high) in zip(shown, ranges, strict=True):
            bounds = min(low, after[row]), max(high, after[row])
            holds[row] = " to ".join(short_angle(bound, largest) for bound in bounds)
    limit = next(
        (line.bound.limit for line in judged.lines if line.bound.part is Part.NUTATION), after[-1]
    )
    holds[-1] = f"accept ≤ {short_angle(limit)}"
    rows = []
    for at, (numbers, block) in enumerate(zip(own, blocks, strict=True)):
        following = [pulses[first].loaded[0] for first, *_ in own[at + 1 : at + 2]]
        ended = pulses[numbers[-1]].over
        decide = "".join(_deadline(spacecraft, ended, start) for start in following) or MISSING
        first, phase = pulses[numbers[0]], float(turned[numbers[0]])
        rows.append(SheetRow(at, first, block, phase, after[at], holds[at], decide))
    return rows


def _columns(plan: Plan, rows: Sequence[SheetRow]) -> list[Column]:
    """Columns of pulses or of blocks; starts in UTC where there is an epoch, else from t = 0."""
    spacecraft = plan.spacecraft
    digits = _decimals(plan.spacecraft)
    blocks = plan.pulses.blocks
    limit, _ = limits(spacecraft)

    def seconds(time: float) -> str:
        return f"{time:.{digits}f}"

    def start(row: SheetRow) -> str | None:
        return clock(spacecraft, row.pulse.loaded[0], min(digits, MILLISECONDS))

    if all(map(start, rows)):
        begin = Column("", Shared.START, "UTC", start, kind=TEXT)
    else:
        begin = Column("", Shared.START, "s", lambda row: row.pulse.loaded[0], seconds)
    if blocks:
        unit = "s" if spacecraft.commands is None else "s (counts)"

        def by_sun(row: SheetRow) -> float | None:
            return None if row.block is None else row.block.delay_at(spacecraft.spin)

        def counted(which: str, value: float) -> str:
            commands = spacecraft.commands
            counts = "" if commands is None else f" ({commands.counts(which, value)})"
            return f"{value:.6g}{counts}"

        fired = [
            Column("", Shared.FIRST_SUN_PULSE, "", attrgetter("block.first")),
            Column("", Shared.DELAY, unit, by_sun, partial(counted, "delay")),
            Column("", Shared.ON_TIME, unit, attrgetter("block.width"), partial(counted, "width")),
            Column("", Shared.PULSES, "", attrgetter("block.count")),
            Column("", Shared.EVERY, "spin", attrgetter("block.every")),
        ]
    elif plan.pulses.idealised:
        size = attrgetter("pulse.magnitude")
        fired = [Column("", Shared.IMPULSE, "N m s", size, "{:.4g}".format)]
    else:
        fired = [Column("", Shared.ON_TIME, "s", lambda row: row.pulse.loaded[1], seconds)]
    columns = [
        Column("", "block" if blocks else "pulse", "", lambda row: row.at + 1),
        begin,
        Column(
            "",
            "Sun phase" if sun_phased(spacecraft) else "spin phase",
            "deg",
            lambda row: math.degrees(row.phase) % 360.0,
            lambda angle: fixed(angle, 1, 360.0),
        ),
        Column("", Shared.THRUSTERS, "", lambda row: _thrusters(row.pulse, spacecraft), kind=TEXT),
        *fired,
        Column(
            "",
            Shared.NUTATION_AFTER,
            "deg",
            attrgetter("nutation"),
            lambda angle: short_angle(angle, limit),
        ),
        Column("", "hold if outside", "deg", attrgetter("hold"), when=bool),
        Column("", "decide before", "", attrgetter("decide"), when=bool),
        Column("", "done", "", lambda _: "☐", kind=TEXT, when=bool),
    ]
    return [column._replace(where="sheet") for column in columns]


def _thrusters(pulse: Pulse, spacecraft: Spacecraft) -> str:
    """Channel of a pulse, with its thrusters where they have other names."""
    if pulse.channel == STEERABLE:
        return channel_text(pulse, spacecraft)
    channel = channel_of(spacecraft, pulse)
    members = [] if channel is None else [thruster.name for thruster in channel.thrusters]
    return (
        pulse.channel
        if members in ([], [pulse.channel])
        else f"{pulse.channel} ({', '.join(members)})"
    )


def _decimals(spacecraft: Spacecraft) -> int:
    """Decimals of times in s: as many as the steps of commands need, else no finer than the
    tolerance of timing.
    """
    tick, dispersions = spacecraft.limits.tick, spacecraft.dispersions
    if tick is not None:
        fine = (
            digits
            for digits in range(FINEST)
            if math.isclose(tick, round(tick, digits), rel_tol=1e-9)
        )
        return next(fine, FINEST)
    timings = () if dispersions is None else (dispersions.timing, dispersions.timing_offset)
    coarsest = max((abs(entry.size) for entry in timings if entry is not None), default=0.0)
    if coarsest == 0.0:
        return MILLISECONDS
    return min(max(math.ceil(-math.log10(coarsest) - 1e-9), 0), FINEST)
