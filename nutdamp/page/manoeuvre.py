"""The manoeuvre sheet: one page for those who fire: conditions to begin, a row a pulse or block, what to do on hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nutdamp.common.results import note
from nutdamp.flight.end_state import spin_phases
from nutdamp.page import document
from nutdamp.page.document import FactList, Prose, Sheet, sheet
from nutdamp.planning.decision import Decision
from nutdamp.planning.notes import ideal_code
from nutdamp.planning.plan import Plan
from nutdamp.schemes.block_model import to_sun_pulse
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import channel_of
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Spacecraft, required_share
from nutdamp.spacecraft.schedule import STEERABLE, Pulse
from nutdamp.views import decisions
from nutdamp.views.glance import limits
from nutdamp.views.parts import MILLISECONDS, channel_text
from nutdamp.views.tables import TEXT, Column, DataTable, Heading, Shared
from nutdamp.views.text import MISSING, RPM, fixed, sentence, short_angle, text

if TYPE_CHECKING:
    from nutdamp.montecarlo.study import Checkpoints, Results


CHECKED = 24  # largest number of rows with a range of the nutation; of more evenly spaced ones have one
FINEST = 6  # largest number of decimals of times

ON_HOLD = (
    "Fire none of the rows that are left: they are void. Record spin, nutation and phase with their time. Plan again "
    "from that motion, and fire by a new sheet."
)


def manoeuvre_blocks(
    decision: Decision, dispersed: Results | None, identity: Sequence[tuple[str, str]], summary: str
) -> Iterator[document.Block]:
    """Blocks of the sheet of a plan: ``identity`` of document and file first, then the ``summary`` of the decision."""
    plan, body = decision.plan, decision.plan.spacecraft
    obstacles = [] if plan.commandable else [sentence(text(note("not-commandable", scheme=plan.scheme)))]
    if code := ideal_code(plan):
        obstacles.append(f"{plan.scheme} cannot be commanded: {text(note(code, scheme=plan.scheme))}.")
    if obstacles or not len(plan.pulses):
        yield Prose(" ".join(obstacles) or summary, alarm=bool(obstacles))
        return
    zero = body.utc(0.0, MILLISECONDS) or "no epoch in the file; times count from t = 0"
    yield FactList("Document and time", (*identity, ("UTC of t = 0", zero)))
    yield Prose(summary, alarm=decision.met is False)
    points = None
    if dispersed is not None:
        from nutdamp.montecarlo.study import Checkpoints

        points = Checkpoints(dispersed.study)
    yield FactList("GO at t = 0 with", tuple(_conditions(decision, points)))
    yield _fired(plan, points)
    yield FactList("Totals and hold", (("totals", _totals(plan)), ("on hold", ON_HOLD), ("phase", _phase_note(body))))
    yield Sheet(
        "Signatures",
        tuple(Heading(name, number=False) for name in ("sheet", "name", "signature", "date")),
        (("prepared", "", "", ""), ("checked", "", "", "")),
    )


def _conditions(decision: Decision, points: Checkpoints | None) -> Iterator[tuple[str, str]]:
    """Spin, nutation and phase at which the first row may be fired."""
    body = decision.plan.spacecraft
    spin, nutation = f"{body.spin * RPM:.5g}", short_angle(body.tilt)
    if points is None:
        why = "dispersed cases were not flown" if body.dispersions is not None else "the file gives no dispersions"
        yield "spin", f"{spin} rpm nominal"
        yield "nutation", f"{nutation} deg nominal"
        yield "phase window", f"not known: {why}"
        return
    spins = f"{points.spin.least * RPM:.5g} to {points.spin.most * RPM:.5g} rpm"
    angles = f"{short_angle(points.nutation.least)} to {short_angle(points.nutation.most)} deg"
    yield "spin", f"{spins} (nominal {spin})"
    yield "nutation", f"{angles} (nominal {nutation})"
    yield "phase window", _window(body, points)


def _window(body: Spacecraft, points: Checkpoints) -> str:
    """Shift of all pulses in phase and in time with which enough cases comply; rounded towards none."""
    probability = required_share(body.requirement)
    share = decisions.exact_percent(probability)
    if not requirements.judged(body):
        return "not known: nothing is required"
    window = points.window(probability)
    if window is None:
        return f"none: fewer than {share} of the cases comply at the phases below"
    turn, digits = abs(body.spin), _decimals(body)
    phases = [_inwards(math.degrees(turn * shift), 1) for shift in window]
    times = [_inwards(shift, digits) for shift in window]
    return f"{phases[0]} to {phases[1]} deg from those below ({times[0]} to {times[1]} s): {share} of cases comply"


def _inwards(value: float, digits: int) -> str:
    scale = 10.0**digits
    return f"{math.trunc(value * scale) / scale:+.{digits}f}"


class SheetRow(NamedTuple):
    """A pulse or block, from 0: its first pulse, Sun or spin phase at its start and nutation after it, rad.

    ``hold``: range of the nutation outside of which nothing more is fired.
    """

    at: int
    pulse: Pulse
    block: Block | None
    phase: float
    nutation: float
    hold: str


def _fired(plan: Plan, points: Checkpoints | None) -> Sheet:
    """One row a pulse or block, as it is commanded, with the nutation after it."""
    flown, pulses = plan.flight, plan.pulses.pulses
    blocks: Sequence[Block | None] = plan.pulses.blocks or [None] * len(pulses)
    counts = [*accumulate(1 if block is None else block.count for block in blocks)]
    firsts = [pulses[count] for count in (0, *counts[:-1])]
    starts = np.array([pulse.loaded[0] for pulse in firsts])
    phases = -to_sun_pulse(flown, starts) if _senses(plan.spacecraft) else spin_phases(flown, starts)
    angles = flown.around_pulses()[1].nutation[np.array(counts) - 1].tolist()
    holds = [MISSING] * len(counts) if points is None else _ranges(points, counts, angles)
    rows = [*map(SheetRow, range(len(counts)), firsts, blocks, phases.tolist(), angles, holds)]
    return sheet(DataTable("Fire", [*_columns(plan, rows)], rows, points), "sheet", folds=True)


def _columns(plan: Plan, rows: Sequence[SheetRow]) -> Iterator[Column]:
    """Columns of pulses or of blocks; starts in UTC where there is an epoch, else from t = 0."""
    body, digits, blocks = plan.spacecraft, _decimals(plan.spacecraft), plan.pulses.blocks

    def column(name: str, unit: str, value: Callable[[Any], Any], shown: Callable[[Any], str] = str) -> Column:
        return Column("", name, unit, value, shown, "sheet")

    def seconds(time: float) -> str:
        return f"{time:.{digits}f}"

    def date(row: SheetRow) -> str | None:
        return body.utc(row.pulse.loaded[0], min(digits, MILLISECONDS))

    yield column("block" if blocks else "pulse", "", lambda row: row.at + 1)
    if all(map(date, rows)):
        yield column(Shared.START, "UTC", date)._replace(kind=TEXT)
    else:
        yield column(Shared.START, "s", lambda row: row.pulse.loaded[0], seconds)
    phase = "Sun phase" if _senses(body) else "spin phase"
    yield column(phase, "deg", lambda row: math.degrees(row.phase) % 360.0, lambda angle: fixed(angle, 1, 360.0))
    yield column(Shared.THRUSTERS, "", lambda row: _thrusters(row.pulse, body))._replace(kind=TEXT)
    if blocks:
        counts = " (counts)" * (body.commands is not None)
        yield column(Shared.FIRST_SUN_PULSE, "", lambda row: row.block.first)
        yield column(Shared.DELAY, f"s{counts}", lambda row: _counted(body, "delay", row.block.delay))
        yield column(Shared.ON_TIME, f"s{counts}", lambda row: _counted(body, "width", row.block.width))
        yield column(Shared.PULSES, "", lambda row: row.block.count)
        yield column(Shared.EVERY, "spin", lambda row: row.block.every)
    else:
        yield column(Shared.ON_TIME, "s", lambda row: row.pulse.loaded[1], seconds)
    least, _ = limits(body)
    yield column(Shared.NUTATION_AFTER, "deg", lambda row: row.nutation, lambda angle: short_angle(angle, least))
    yield column("hold if outside", "deg", lambda row: row.hold)._replace(when=lambda points: points is not None)
    yield column("done", "", lambda _: "☐")._replace(kind=TEXT)


def _counted(body: Spacecraft, which: str, value: float) -> str:
    """A ``delay`` or ``width`` in s, and in counts of the steps of the commands, where the file has them."""
    counts = f" ({body.commands.counts(which, value)})" if body.commands is not None else ""
    return f"{value:.6g}{counts}"


def _ranges(points: Checkpoints, counts: Sequence[int], expected: Sequence[float]) -> list[str]:
    """Range of the nutation in flown cases after each row that has one, with that ``expected`` (rad) in it."""
    from nutdamp.montecarlo.study import even

    limit = limits(points.study.model.spacecraft)[0]
    rows = [number - 1 for number in even(len(counts), CHECKED)]
    texts = [MISSING] * len(counts)
    for row, (least, most) in zip(rows, points.nutation_after([counts[row] for row in rows]), strict=True):
        bounds = min(least, expected[row]), max(most, expected[row])
        texts[row] = " to ".join(short_angle(bound, limit) for bound in bounds)
    return texts


def _thrusters(pulse: Pulse, body: Spacecraft) -> str:
    """Channel of a pulse, with its thrusters where they have other names."""
    if pulse.channel == STEERABLE:
        return channel_text(pulse, body)
    channel = channel_of(body, pulse)
    members = [] if channel is None else [thruster.name for thruster in channel.thrusters]
    return pulse.channel if members in ([], [pulse.channel]) else f"{pulse.channel} ({', '.join(members)})"


def _senses(body: Spacecraft) -> bool:
    return body.sun is not None and body.sun_sensor is not None


def _phase_note(body: Spacecraft) -> str:
    if _senses(body):
        return "Sun phase: angle from the Sun sensor to the Sun about axis 3, against the spin, at the commanded start."
    falls = ", positive about +3, so that it falls with this spin" * (body.spin < 0.0)
    return f"Spin phase: angle by which the body has turned about axis 3 since t = 0{falls}, at the commanded start."


def _totals(plan: Plan) -> str:
    pulses, body, digits = plan.pulses, plan.spacecraft, _decimals(plan.spacecraft)
    on = math.fsum(pulse.loaded[1] for pulse in pulses)
    date = body.utc(pulses.end, min(digits, MILLISECONDS))
    ends = f"{pulses.end:.{digits}f} s" + (f" ({date})" if date else "")
    return f"pulses: {len(pulses)}; on-time {on:.{digits}f} s; {decisions.spent(pulses)}; the last ends at {ends}"


def _decimals(body: Spacecraft) -> int:
    """Decimals of times in s: as many as the steps of commands need, else no finer than the tolerance of timing."""
    tick, given = body.limits.tick, body.dispersions
    if tick is not None:
        fine = (digits for digits in range(FINEST) if math.isclose(tick, round(tick, digits), rel_tol=1e-9))
        return next(fine, FINEST)
    sizes = [] if given is None else [each.size for each in (given.timing, given.timing_offset) if each is not None]
    coarsest = max(map(abs, sizes), default=0.0)
    return MILLISECONDS if coarsest == 0.0 else min(max(math.ceil(-math.log10(coarsest) - 1e-9), 0), FINEST)
