"""The manoeuvre sheet: one page for those who fire: conditions to begin, a row a pulse or block,
what to do on hold.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nutdamp.common.results import note
from nutdamp.page import document
from nutdamp.page.document import FactList, Prose, Sheet, sheet
from nutdamp.planning.notes import ideal_code
from nutdamp.planning.plan import Plan
from nutdamp.planning.verdict import Verdict
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import channel_of
from nutdamp.spacecraft.equipment import Block
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


CHECKED = (
    24  # largest number of rows with a range of the nutation; of more evenly spaced ones have one
)
FINEST = 6  # largest number of decimals of times
DECIDED = 10.0  # s of a coast in which nobody can look at telemetry, decide and command a hold

ON_HOLD = (
    "Fire none of the rows that are left: they are void. Record spin, "
    "nutation and phase with their time. Plan again "
    "from that motion, and fire by a new sheet."
)


def manoeuvre_blocks(
    plan: Plan, judged: Verdict, identity: Sequence[tuple[str, str]], summary: str
) -> Iterator[document.Block]:
    """Blocks of the sheet of a plan: ``identity`` of document and file first, then the ``summary``
    of the verdict.

    Only a plan to fly has conditions to begin, limits to hold, boxes and signatures; ideal impulses
    have none either.
    """
    spacecraft = plan.spacecraft
    ideal = ideal_code(plan)
    if not plan.pulses.pulses:
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
    yield _fired(plan, judged, points, flies=flies)
    totals = [("totals", _totals(plan)), ("phase", _phase_note(spacecraft))]
    if not flies:
        yield FactList("Totals", tuple(totals))
        return
    yield FactList("Totals and hold", (totals[0], ("on hold", ON_HOLD), totals[1]))
    yield Sheet(
        "Signatures",
        tuple(Heading(name, number=False) for name in ("sheet", "name", "signature", "date")),
        (("prepared", "", "", ""), ("checked", "", "", "")),
    )


def _conditions(spacecraft: Spacecraft, points: Checkpoints | None) -> Iterator[tuple[str, str]]:
    """Spin, nutation and phase at which the first row may be fired."""
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
    yield "phase window", _window(spacecraft, points)


def _window(spacecraft: Spacecraft, points: Checkpoints) -> str:
    """Shift of all pulses in phase and in time with which enough cases comply; rounded towards
    none.
    """
    probability = required_share(spacecraft.requirement)
    share = exact_percent(probability)
    if not requirements.judged(spacecraft):
        return "not known: nothing is required"
    window = points.window(probability)
    if window is None:
        return f"none: fewer than {share} of the cases comply at the phases below"
    turn = abs(spacecraft.spin)
    digits = _decimals(spacecraft)
    phases = [_inwards(math.degrees(turn * shift), 1) for shift in window]
    times = [_inwards(shift, digits) for shift in window]
    return (
        f"{phases[0]} to {phases[1]} deg from those below ({times[0]} to {times[1]} s): "
        f"{share} of cases comply"
    )


def _inwards(value: float, digits: int) -> str:
    scale = 10.0**digits
    return f"{math.trunc(value * scale) / scale:+.{digits}f}"


class SheetRow(NamedTuple):
    """A pulse or block, from 0: its first pulse, Sun or spin phase at its start and nutation after
    it, rad.

    ``hold``: range of the nutation outside of which nothing more is fired, of the last row the
    limit to accept; ``decide``: time by which that must be known.
    """

    at: int
    pulse: Pulse
    block: Block | None
    phase: float
    nutation: float
    hold: str
    decide: str


def _fired(plan: Plan, judged: Verdict, points: Checkpoints | None, *, flies: bool) -> Sheet:
    """One row a pulse or block, as it is commanded, with the nutation after it."""
    flown, spacecraft, pulses = plan._flight, plan.spacecraft, plan.pulses.pulses
    blocks: Sequence[Block | None] = plan.pulses.blocks or [None] * len(pulses)
    own = plan.pulses.pulses_by_block
    counts = [numbers[-1] + 1 for numbers in own]
    firsts = [pulses[numbers[0]] for numbers in own]
    starts = np.array([pulse.loaded[0] for pulse in firsts])
    turned = phases(flown)[np.array([numbers[0] for numbers in own])]
    angles = flown.around_pulses()[1].nutation[np.array(counts) - 1].tolist()
    ends = [pulses[count - 1].over for count in counts]
    decide = [
        _deadline(spacecraft, end, start)
        for end, start in zip(ends, starts[1:].tolist(), strict=False)
    ]
    holds = ["not set"] * len(counts) if points is None else _ranges(points, counts, angles)
    limit = next(
        (line.bound.limit for line in judged.lines if line.bound.part is Part.NUTATION), angles[-1]
    )
    holds[-1] = f"accept ≤ {short_angle(limit)}"
    columns = zip(firsts, blocks, turned.tolist(), angles, holds, [*decide, MISSING], strict=True)
    rows = [SheetRow(index, *row) for index, row in enumerate(columns)]
    return sheet(
        DataTable("Fire" if flies else "Pulses", _columns(plan, rows), rows, flies),
        "sheet",
        folds=True,
    )


def _deadline(spacecraft: Spacecraft, end: float, start: float) -> str:
    """Time by which it must be known whether the next row is fired: its start; a short coast leaves
    no time.
    """
    if start - end < DECIDED:
        return "automatic"
    return clock(spacecraft, start) or f"{math.floor(10.0 * start) / 10.0:.1f} s"


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
        delay = partial(_counted, spacecraft, "delay")
        width = partial(_counted, spacecraft, "width")

        def by_sun(row: SheetRow) -> float | None:
            return None if row.block is None else row.block.delay_at(spacecraft.spin)

        fired = [
            Column("", Shared.FIRST_SUN_PULSE, "", attrgetter("block.first")),
            Column("", Shared.DELAY, unit, by_sun, delay),
            Column("", Shared.ON_TIME, unit, attrgetter("block.width"), width),
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


def _counted(spacecraft: Spacecraft, which: str, value: float) -> str:
    """A ``delay`` or ``width`` in s, and in counts of the steps of the commands, where the file has
    them.
    """
    counts = (
        f" ({spacecraft.commands.counts(which, value)})" if spacecraft.commands is not None else ""
    )
    return f"{value:.6g}{counts}"


def _ranges(points: Checkpoints, counts: Sequence[int], expected: Sequence[float]) -> list[str]:
    """Range of the nutation after each row that has one, of cases that end well, with that
    ``expected`` (rad) in it.
    """
    from nutdamp.planning.screening import even

    limit = limits(points.study.model.spacecraft)[0]
    rows = [number - 1 for number in even(len(counts), CHECKED)]
    texts = [MISSING] * len(counts)
    ranges = points.nutation_after([counts[row] for row in rows])
    for row, (low, high) in zip(rows, ranges, strict=True):
        bounds = min(low, expected[row]), max(high, expected[row])
        texts[row] = " to ".join(short_angle(bound, limit) for bound in bounds)
    return texts


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


def _phase_note(spacecraft: Spacecraft) -> str:
    if sun_phased(spacecraft):
        return (
            "Sun phase: angle from the Sun sensor to the Sun about axis 3, against the spin, "
            "at the commanded start."
        )
    falls = ", positive about +3, so that it falls with this spin" if spacecraft.spin < 0.0 else ""
    return (
        f"Spin phase: angle by which the body has turned about axis 3 since t = 0{falls}, "
        "at the commanded start."
    )


def _totals(plan: Plan) -> str:
    pulses = plan.pulses
    spacecraft = plan.spacecraft
    digits = _decimals(plan.spacecraft)
    on = math.fsum(pulse.loaded[1] for pulse in pulses)
    date = spacecraft.utc(pulses.end, min(digits, MILLISECONDS))
    ends = f"{pulses.end:.{digits}f} s" + (f" ({date})" if date else "")
    return (
        f"pulses: {len(pulses)}; on-time {on:.{digits}f} s; {spent(pulses)}; "
        f"the last ends at {ends}"
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
