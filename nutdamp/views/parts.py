"""Parts that all screens and pages share: the line and the angles of a spacecraft, pulses and
blocks, notes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from rich.console import Console, ConsoleOptions, RenderableType, RenderResult
from rich.text import Text

from nutdamp.common.results import Note
from nutdamp.errors import listed
from nutdamp.flight.end_state import spin_phases
from nutdamp.flight.propagation import Flight, Track, to_sun_pulse
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Keep, Spacecraft, Vector
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import STEERABLE, Pulse, Schedule
from nutdamp.views.tables import (
    TEXT,
    WHOLE,
    WIDTH,
    Column,
    DataTable,
    FittedColumns,
    Shared,
    lines_of,
    to_figures,
)
from nutdamp.views.text import (
    RPM,
    WARNING,
    degrees,
    digits,
    fixed,
    is_detail,
    limit_text,
    longitude,
    moment,
    ordered,
    pointing,
    quantity,
    quiet,
    rank,
    screen_line,
    severity,
    short_angle,
    small_angle,
    steering,
    with_file,
)

if TYPE_CHECKING:
    from nutdamp.flight.cones import Aspect

MILLISECONDS = 3  # digits of a second that tables show of a date


RESIDUALS = ("nutation", "body_cone", "space_cone", "momentum_shift", "axis_error")
"""Angles that are left, as `Residual` has them; the last one with a target."""


class PulseRow(NamedTuple):
    """A pulse of the ``spacecraft``, counted from 0; motion just before and after all pulses; spin
    phase at its start, rad.
    """

    at: int
    pulse: Pulse
    spacecraft: Spacecraft
    before: Track | None = None
    after: Track | None = None
    phase: float = 0.0


def channel_text(pulse: Pulse, spacecraft: Spacecraft) -> str:
    """The channel of a pulse; a steerable one is named by the angle of its torque too."""
    if pulse.channel != STEERABLE:
        return pulse.channel
    return f"{STEERABLE} {steering(spacecraft.inertia.in_file(pulse.impulse).tolist())}"


def seconds(value: float) -> str:
    """A time within a schedule to a tenth of a millisecond."""
    return fixed(value, 4)


def _cone(name: str, when: str, where: str) -> Column:
    def value(row: PulseRow) -> float:
        return math.degrees(getattr(getattr(row, when), name)[row.at])

    return Column(
        f"{name}_{when}_deg", f"{name.replace('_', ' ')} {when}", "deg", value, small_angle, where
    )


def _vector(name: str, unit: str) -> Column:
    def components(row: PulseRow) -> Any:
        vector = getattr(row.pulse, name)
        return None if vector is None else row.spacecraft.inertia.in_file(vector)

    return Column(f"{name}#_{unit}", name, unit, components, where=FILES)


def clock(spacecraft: Spacecraft, time: float, digits: int = MILLISECONDS) -> str | None:
    """Time of day in UTC, with the day where it is another one than at t = 0; None without an
    epoch.
    """
    zero, date = spacecraft.utc(0.0, digits), spacecraft.utc(time, digits)
    if date is None or zero is None:
        return None
    day, of_day = date.removesuffix("Z").split("T")
    return of_day if zero.startswith(day) else f"{day[5:]} {of_day}"


def sun_phased(spacecraft: Spacecraft) -> bool:
    """True where phases count from the Sun sensor, else from t = 0."""
    return spacecraft.sun is not None and spacecraft.sun_sensor is not None


def phases(flown: Flight) -> Vector:
    """Phase of the body at the commanded start of each pulse, rad: from the Sun sensor to the Sun,
    or since t = 0.
    """
    starts = np.array([pulse.loaded[0] for pulse in flown.schedule])
    return (
        -to_sun_pulse(flown, starts) if sun_phased(flown.spacecraft) else spin_phases(flown, starts)
    )


def _valves(schedule: Schedule) -> bool:
    return any(pulse.through_valve for pulse in schedule)


PEOPLE, FILES = "screen full simulate page", "csv json flown"
PULSES = (
    Column("pulse", "pulse", "", lambda row: row.at + 1, where=f"{PEOPLE} csv", kind=WHOLE),
    Column.named("t_s=pulse.t", "centre", "s", seconds, FILES),
    Column("start_s", Shared.START, "s", lambda row: row.pulse.loaded[0], seconds, FILES),
    Column(
        "on_time_s",
        Shared.ON_TIME,
        "s",
        lambda row: row.pulse.loaded[1],
        lambda value: seconds(value) if value else "ideal",
        f"{PEOPLE} {FILES}",
    ),
    Column("", Shared.EFFECTIVE, "s", lambda row: row.pulse.on_time, seconds, "full page", _valves),
    Column.named(
        "channel=pulse.channel",
        Shared.CHANNEL,
        "",
        where=f"{PEOPLE} {FILES}",
        kind=TEXT,
        words=lambda row: channel_text(row.pulse, row.spacecraft),
    ),
    _vector("torque", "Nm"),
    _vector("impulse", "Nms"),
    Column.named("propellant_kg=pulse.propellant", Shared.PROPELLANT, "kg", where=FILES),
    Column(
        "",
        Shared.IMPULSE,
        "N m s",
        lambda row: row.pulse.magnitude,
        lambda size: digits(size, 4),
        "full page",
    ),
    _cone("nutation", "before", "full simulate page csv flown"),
    _cone("nutation", "after", "full simulate page csv flown"),
    _cone("body_cone", "before", "page flown"),
    _cone("body_cone", "after", "simulate page flown"),
    _cone("space_cone", "before", "page flown"),
    _cone("space_cone", "after", "simulate page flown"),
    Column.named("effective_start_s=pulse.start", "", "", where=FILES, when=_valves),
    Column.named("effective_on_time_s=pulse.on_time", "", "", where=FILES, when=_valves),
    Column(
        "utc", "", "", lambda row: row.spacecraft.utc(row.pulse.loaded[0]), where=FILES, kind=TEXT
    ),
)


def commanded(schedule: Schedule, spacecraft: Spacecraft) -> DataTable:
    """The pulses as they are commanded, without the motion that they cause."""
    rows = [PulseRow(index, pulse, spacecraft) for index, pulse in enumerate(schedule)]
    return DataTable("Pulses", _dated(spacecraft), rows, schedule)


def pulse_table(flown: Flight, *, scheme: str = "", limit: float = math.inf) -> DataTable:
    """The pulses of a flight with the cone angles before and after each.

    ``scheme``: its name, on pages; ``limit``: that of the nutation, rad, on default screens.
    """
    before, after = flown.around_pulses()
    pulses, spacecraft = flown.schedule.pulses, flown.spacecraft
    phased = enumerate(zip(pulses, phases(flown).tolist(), strict=True))
    rows = [
        PulseRow(index, pulse, spacecraft, before, after, phase) for index, (pulse, phase) in phased
    ]
    nutation = Column(
        "",
        Shared.NUTATION_AFTER,
        "deg",
        lambda row: float(row.after.nutation[row.at]),
        lambda angle: short_angle(angle, limit),
        "screen",
    )
    return DataTable(f"Pulses of {scheme}", (*_dated(spacecraft), nutation), rows, flown.schedule)


def _dated(spacecraft: Spacecraft) -> tuple[Column, ...]:
    """The columns for a spacecraft: one time of the start for people, UTC where there is an epoch,
    and one phase.
    """
    if spacecraft.utc(0.0) is None:
        start = Column("", Shared.START, "s", lambda row: row.pulse.loaded[0], seconds, PEOPLE)
        columns = tuple(column for column in PULSES if column.key != "utc")
    else:
        start = Column(
            "",
            Shared.START,
            "UTC",
            lambda row: clock(row.spacecraft, row.pulse.loaded[0]),
            where=PEOPLE,
            kind=TEXT,
        )
        columns = PULSES
    phase = Column(
        "",
        "Sun phase" if sun_phased(spacecraft) else "spin phase",
        "deg",
        lambda row: math.degrees(row.phase) % 360.0,
        lambda angle: fixed(angle, 1, 360.0),
        PEOPLE,
        rank=1,
    )
    return (columns[0], start, phase, *columns[1:])


class BlockRow(NamedTuple):
    """A command block of the ``spacecraft``, from 0: its pulses, the nutation after the last of
    them, rad.
    """

    at: int
    block: Block
    spacecraft: Spacecraft
    pulses: tuple[Pulse, ...]
    nutation: float


def _counts(name: str, row: BlockRow) -> int | None:
    commands = row.spacecraft.commands
    time = _delay(row) if name == "delay" else row.block.width
    return None if commands is None else commands.counts(name, time)


def _delay(row: BlockRow) -> float:
    """Delay of a block, s; of an angle that at the spin of t = 0."""
    return row.block.delay_at(row.spacecraft.spin)


def _nine(value: float) -> float:
    """A number to nine figures, without the noise of its last digits."""
    return float(f"{value:.9g}")


EVERYWHERE = "screen page csv"
BLOCKS = (
    Column("block", "block", "", lambda row: row.at + 1, where=EVERYWHERE, kind=WHOLE),
    Column.named("channel=block.channel", Shared.CHANNEL, "", where=EVERYWHERE, kind=TEXT),
    Column.named(
        "first_sun_pulse=block.first", Shared.FIRST_SUN_PULSE, "", where=EVERYWHERE, kind=WHOLE
    ),
    Column(
        "first_utc",
        "first pulse",
        "UTC",
        lambda row: row.spacecraft.utc(row.pulses[0].loaded[0]),
        where="csv page",
        kind=TEXT,
    ),
    Column("delay_s", Shared.DELAY, "s", _delay, to_figures(6), EVERYWHERE),
    Column(
        "delay_counts",
        Shared.DELAY,
        "counts",
        partial(_counts, "delay"),
        where=EVERYWHERE,
        kind=WHOLE,
        rank=1,
    ),
    Column(
        "delay_deg",
        Shared.DELAY,
        "deg",
        lambda row: _nine(
            math.degrees(row.block.angle + row.block.delay * abs(row.spacecraft.spin))
        ),
        lambda angle: f"{angle:.2f}",
        EVERYWHERE,
        rank=3,
    ),
    Column.named("width_s=block.width", Shared.ON_TIME, "s", to_figures(6), EVERYWHERE),
    Column(
        "width_counts",
        Shared.ON_TIME,
        "counts",
        partial(_counts, "width"),
        where=EVERYWHERE,
        kind=WHOLE,
        rank=2,
    ),
    Column.named("count=block.count", Shared.PULSES, "", where=EVERYWHERE, kind=WHOLE),
    Column.named("every=block.every", Shared.EVERY, "turn", where=EVERYWHERE, kind=WHOLE),
    Column(
        "impulse_Nms",
        Shared.IMPULSE,
        "N m s",
        lambda row: _nine(math.fsum(pulse.magnitude for pulse in row.pulses)),
        to_figures(6),
        "csv page",
    ),
    Column.named(
        "nutation_after_deg=nutation", Shared.NUTATION_AFTER, "deg", small_angle, "csv page"
    ),
)


def block_table(flown: Flight) -> DataTable:
    """The blocks of a flown schedule as they are loaded: times in s and in counts of the steps of
    the commands.
    """
    _, after = flown.around_pulses()
    pulses = flown.schedule.pulses
    spacecraft = flown.spacecraft
    rows = []
    numbers = flown.schedule.pulses_by_block
    for index, (block, own) in enumerate(zip(flown.schedule.blocks, numbers, strict=False)):
        fired = tuple(pulses[number] for number in own)
        rows.append(BlockRow(index, block, spacecraft, fired, float(after.nutation[own[-1]])))
    return DataTable("Command blocks", BLOCKS, rows, flown.schedule)


LINES = (40, 40)  # of a default screen, and of one narrower than `WIDTH`
NOTES = 3  # on it, at most, warnings among them
ROWS = 14  # before the last one of its table, at most: further ones are alike
STEP = " · "  # between two steps to take next
BREAK = re.compile("[,;:] ")  # where `Clauses` may be broken


class Clauses:
    """A line of text that is broken behind commas, where it does not fit and that takes no more
    lines, so that values stay with their units.
    """

    def __init__(self, line: Text) -> None:
        self.line = line

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width = options.max_width
        lines = [Text()]
        for clause in self.line.divide(mark.end() for mark in BREAK.finditer(self.line.plain)):
            if lines[-1] and len(lines[-1]) + len(clause.plain.rstrip()) > width:
                lines.append(Text())
            lines[-1].append_text(clause)
        whole = lines_of(*lines, width=width) <= lines_of(self.line, width=width)
        yield from lines if whole else [self.line]


@dataclass(frozen=True)
class Summary:
    """The screen of every result: its ``head``, ``tables``, notes by what they change, and
    ``steps`` to take next.

    A default screen has at most so many ``lines``. As many notes and then rows are on it as these
    hold, which is measured when it is shown: ``tables`` takes the number of rows ``first`` of a
    table that may be long, before its last one. ``verbose``: all rows and notes, and no steps.
    """

    head: Sequence[RenderableType]
    tables: Callable[..., Sequence[RenderableType]]
    notes: Sequence[Note] = ()
    steps: str = ""
    verbose: bool = False
    lines: tuple[int, int] = LINES

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        notes = sorted(ordered(self.notes), key=rank)
        if self.verbose:
            below = [line for part in self.tables() for line in (Text(), part)]
            yield from (*self.head, *below, *([Text()] if notes else []), *map(screen_line, notes))
            return
        width = options.max_width
        limit = self.lines[width < WIDTH]
        warned = min(sum(severity(entry) == WARNING for entry in notes), NOTES)
        for blanks, count in product((True, False), range(NOTES, warned - 1, -1)):
            spare = limit - lines_of(*self._parts(1, notes, count, width, blanks), width=width)
            if spare >= 0:
                break
        yield from self._parts(min(1 + max(spare, 0), ROWS), notes, count, width, blanks)

    def _parts(
        self, rows: int, notes: Sequence[Note], count: int, width: int, blanks: bool
    ) -> list[RenderableType]:
        """Parts of a default screen with so many rows before the last one, and so many notes."""
        tables = self.tables(first=rows)
        told = [screen_line(entry) for entry in notes if not is_detail(entry)]
        told = told if quiet() else told[:count]
        between = [Text()] if tables else []
        head = [Clauses(part) if isinstance(part, Text) else part for part in self.head]
        parts = [*head, *between, *tables, *(between if told else []), *told]
        for part in parts:
            if isinstance(part, FittedColumns):
                part.brief = True
        if not quiet():
            hidden = len(notes) - len(told)
            last = "-v all values" + (f" ({hidden} more)" if hidden else "")
            for step in map(with_file, self.steps.split(STEP)):
                if len(last) + len(STEP) + len(step) <= width:
                    last += STEP + step
            parts.append(Text(last, style="dim"))
        return [part for part in parts if blanks or not isinstance(part, Text) or part.plain]


def title(spacecraft: Spacecraft) -> Text:
    """Name of a spacecraft and its motion at t = 0."""
    nutation = short_angle(spacecraft.widest.nutation)
    spin = f"{spacecraft.spin * RPM:.4g} rpm"
    return named(spacecraft, f"   {spacecraft.inertia.shape}, {spin}, nutation {nutation} deg")


def named(spacecraft: Spacecraft, *more: str | tuple[str, str]) -> Text:
    """Name of a spacecraft, with a word where it is one that nobody asked for, and ``more`` text
    after it.
    """
    origin = " (built-in example)" if spacecraft.built_in else ""
    return Text.assemble((spacecraft.name, "bold"), origin, *more)


def direction_columns(spacecraft: Spacecraft) -> tuple[Column, Column]:
    """The two angles of an inertial direction (3,): along and above the equator, or from H(0) and
    about it.
    """

    def angle(at: int, direction: Vector) -> float | None:
        value = spacecraft.angles_of(direction)[at]
        return None if value is None else math.degrees(value)

    around = partial(angle, 0)
    other = partial(angle, 1)
    if spacecraft.attitude is None:
        return (
            Column("tilt_deg", "tilt", "deg", other, pointing, "json"),
            Column("azimuth_deg", "azimuth", "deg", around, longitude, "json"),
        )
    names = ("right ascension", "declination")
    if spacecraft.attitude.ecliptic:
        names = ("longitude", "latitude")
    first, second = (f"{name.replace(' ', '_')}_deg" for name in names)
    return (
        Column(first, names[0], "deg", around, longitude, "json"),
        Column(second, names[1], "deg", other, pointing, "json"),
    )


def direction_text(spacecraft: Spacecraft, direction: Vector) -> str:
    """An inertial direction (3,) by name and number of its angles."""
    return ", ".join(
        f"{column.heading} {column.worded(direction)}" for column in direction_columns(spacecraft)
    )


def target_text(spacecraft: Spacecraft) -> str:
    """The target axis, and its angle from the Sun where it was asked for so."""
    assert spacecraft.goal.axis is not None
    return f"{direction_text(spacecraft, spacecraft.goal.axis)}{by_the_sun(spacecraft)}"


def by_the_sun(spacecraft: Spacecraft) -> str:
    """Clause on the Sun angle of a target that was asked for so; else empty."""
    angle = spacecraft.goal.sun_angle
    return "" if angle is None else f", Sun angle {degrees(angle)}"


def spin_text(spin: float) -> str:
    """A spin rate given in rad/s, in rpm too."""
    return f"{spin * RPM:.6g} rpm ({quantity(spin, 'rad/s')})"


def aspect_facts(aspects: Iterable[Aspect]) -> Iterator[tuple[str, str]]:
    """Least angle of the spin axis from each direction that is watched, and its limit; ✗ where it
    is broken.
    """
    for aspect in aspects:
        keep = aspect.keep
        mark = "" if aspect.kept else "✗ "
        bounds = bounds_text(keep)
        near, far = (
            f"{degrees(angle)} at {moment(at)}" for angle, at in (aspect[1:3], aspect[3:5])
        )
        moves = aspect.largest_at > 0.0 or aspect.least_at > 0.0
        seen = f"{near} to {far}" if moves else f"{degrees(aspect.least)} at t = 0"
        yield f"axis from {keep.name}", f"{mark}{seen}" + (f" ({bounds})" if bounds else "")


def bounds_text(keep: Keep) -> str:
    """Limits of the spin axis to a direction; empty where it is only watched."""
    inner = f"at least {limit_text(keep.least)}" if keep.least > 0.0 else ""
    outer = f"at most {limit_text(keep.most)}" if keep.most < math.pi else ""
    return " and ".join(filter(None, (inner, outer)))


def requested(spacecraft: Spacecraft) -> str:
    """The requirement and the cones to keep, on one line; empty where there are none."""
    cones = [f"axis {bounds_text(keep)} from {keep.name}" for keep in spacecraft.keep]
    return listed([*filter(None, [required(spacecraft)]), *cones])


def required(spacecraft: Spacecraft) -> str:
    """The requirement, on one line; empty where there is none."""
    texts = []
    for bound in requirements.required(spacecraft):
        if bound.part is Part.SPIN:
            spin = (spacecraft.goal.spin or 0.0) * RPM
            texts.append(f"spin within {RPM * bound.limit:.4g} rpm of {spin:.5g} rpm")
        else:
            texts.append(f"{bound.label} within {limit_text(bound.limit)}")
    return listed(texts)


def changing(spacecraft: Spacecraft) -> list[str]:
    """Causes that change the motion while nothing fires."""
    causes = []
    if spacecraft.growth != 0.0:
        causes.append("dissipation")
    if spacecraft.disturbances:
        causes.append("disturbances")
    return causes
