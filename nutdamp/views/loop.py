"""Screens and data of the closed loop: firings, dead band and margins, and the budget of holding
the nutation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from operator import attrgetter
from typing import Any, NamedTuple

from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.common.results import Note, note
from nutdamp.control_loop.budget import DAY, NOISY, WIDENED, YEAR, Budget, HeldNutation
from nutdamp.control_loop.controller import Ending, Fired
from nutdamp.control_loop.evaluation import AGREE, LoopPlan, LoopVerification
from nutdamp.control_loop.simulation import LoopRun
from nutdamp.control_loop.stability import SURELY, Margin, dead_band, feeding, margins, too_late
from nutdamp.planning.notes import verdict_notes
from nutdamp.planning.verdict import Verdict
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.equipment import GYRO, Loop
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views import decisions, glance, tables
from nutdamp.views import verdict as verdicts
from nutdamp.views.decisions import heading, opening
from nutdamp.views.parts import Summary, pulse_table, seconds
from nutdamp.views.tables import (
    TEXT,
    WHOLE,
    YES_NO,
    Column,
    DataTable,
    Shared,
    angle_of,
    facts,
    to_figures,
)
from nutdamp.views.text import (
    duration,
    lasting,
    limit_text,
    moment,
    note_json,
    ordered,
    quantity,
    screen_line,
    sentences,
    small_angle,
)

SHOWN = 40  # largest number of firings in a table of a screen
ROUNDING = 1e-12  # share of the nutation that a firing leaves by rounding alone
# share of start below which what tilted gyros show of the spin does not matter, whatever stop
TILTED = 1e-3


class FiringRow(NamedTuple):
    """A firing, from 0, with the nutation before and after it, rad; ``apart``: start, on-time,
    nutation by DOP853.
    """

    at: int
    firing: Fired
    before: float
    after: float = math.nan
    apart: tuple[float, float, float] = (math.nan, math.nan, math.nan)


APART = "{:.1e}".format  # text of a difference

FIRINGS = (
    Column("", "firing", "", lambda row: row.at + 1, where="screen verified", kind=WHOLE),
    Column.named(
        "channel=firing.pulse.channel",
        Shared.CHANNEL,
        "",
        where="verified verified_json",
        kind=TEXT,
    ),
    Column("", Shared.START, "s", lambda row: row.firing.pulse.start, seconds, "screen"),
    Column(
        "start_s",
        Shared.START,
        "s",
        lambda row: row.firing.pulse.loaded[0],
        seconds,
        "verified verified_json",
    ),
    Column(
        "start_difference_s",
        "differs by",
        "s",
        lambda row: row.apart[0],
        APART,
        "verified verified_json",
    ),
    Column("", Shared.ON_TIME, "s", lambda row: row.firing.pulse.on_time, seconds, "screen"),
    Column(
        "on_time_s",
        Shared.ON_TIME,
        "s",
        lambda row: row.firing.pulse.loaded[1],
        seconds,
        "verified verified_json",
    ),
    Column(
        "on_time_difference_s",
        "differs by",
        "s",
        lambda row: row.apart[1],
        APART,
        "verified verified_json",
    ),
    Column("", Shared.CHANNEL, "", lambda row: row.firing.pulse.channel, where="screen", kind=TEXT),
    *tables.file_columns("json", "decided_s=firing.decided"),
    Column.named("seen_deg=firing.seen", "nutation seen", "deg", small_angle, "screen json"),
    Column("", "before", "deg", angle_of("before"), small_angle, "screen"),
    Column("", "after", "deg", angle_of("after"), small_angle, "screen"),
    Column("", "nutation", "deg", angle_of("firing.true_nutation"), small_angle, "verified"),
    Column(
        "nutation_difference_deg",
        "differs by",
        "deg",
        lambda row: math.degrees(row.apart[2]),
        APART,
        "verified verified_json",
    ),
)


def firing_table(run: LoopRun) -> DataTable:
    """The firings of a run."""
    before, after = run.flight.around_pulses()
    angles = zip(run.fired, before.nutation.tolist(), after.nutation.tolist(), strict=True)
    return DataTable(
        "Firings", FIRINGS, [FiringRow(index, *row) for index, row in enumerate(angles)]
    )


MARGINS = (
    Column.named("channel", Shared.CHANNEL, "", where="screen json", kind=TEXT),
    Column.named("late_deg", "late", "deg", to_figures(4), "screen json"),
    *tables.file_columns("json", "latest_deg"),
    Column.named(
        "gain",
        "remaining",
        "%",
        lambda gain: f"{100.0 * gain:.4g}" if gain >= ROUNDING else "0",
        "screen json",
    ),
    Column.named(
        "growth",
        "growth in a period",
        "%",
        lambda growth: f"{100.0 * (growth - 1.0):.3g}",
        "screen json",
    ),
    Column(
        "",
        "delay margin",
        "",
        lambda row: row.delay,
        lambda delay: "none" if delay < 0.0 else duration(delay),
        "screen",
    ),
    *tables.file_columns("json", "delay_margin_s=delay", "damps", "reversed=turned"),
)


def margin_table(rows: tuple[Margin, ...]) -> DataTable:
    """Margin of each channel before it feeds the nutation, at the start threshold."""
    return DataTable("Margins", MARGINS, rows)


def loop_screen(plan: LoopPlan, *, verbose: bool = True) -> RenderableType:
    """The screen of ``loop``."""
    run, judged = plan.flown_run, plan.verdict
    schedule = plan._flight.schedule
    spent = f"{verdicts.spent(schedule)}, pulses: {len(schedule)}"
    fired = f"{spent}, last ends at {moment(schedule.end)}" if run.fired else "no firing"
    if run.settled is not None:
        quiet = f"at {moment(run.settled)}"
    elif not run.fired and not run.lost:
        quiet = "always: it never shows the start threshold"
    elif run.loop.stop > 0.0:
        quiet = "never: the loop is not down to the stop threshold"
    else:
        quiet = "never: loop.stop is 0"
    words = verdicts.loop_sentence(judged)
    if run.lost:
        full = run.stop is Ending.FULL
        why = (
            "limits.max_pulses is reached"
            if full
            else "the loop is never down to its stop threshold"
        )
        words = f"{verdicts.lead(judged)}: {why}"
    if run.case is not None:
        words = f"dispersed case {run.case} of seed {run.seed}: {words}"
    stated = verdicts.coloured(words, judged.light)
    head = [
        *opening(plan.spacecraft, verbose),
        Text.assemble("LOOP ", (run.loop.law, "bold"), f": {fired}; first quiet {quiet}"),
        screen_line(stopped(run)) if run.stop.fault else stated,
        verdicts.bound_table(judged).screen("screen"),
    ]
    ends = facts(glance.end_rows(plan._flight, plan._aspects))
    more = [margin_table(plan.margins).screen("screen"), ends] if verbose else []

    def tables(first: int = SHOWN - 1) -> list[RenderableType]:
        firings = [firing_table(run).screen("screen", first=first)] if run.fired else []
        return [*firings, *more]

    steps = "--plot loop.png · nutdamp disperse --loop"
    return Summary(head, tables, [*_notes(plan, judged)], steps, verbose)


def _notes(plan: LoopPlan, judged: Verdict) -> Iterator[Note]:
    run = plan.flown_run
    band = math.degrees(plan.band.most)
    share = 100.0 * SURELY
    yield from warnings(plan.spacecraft)
    yield from verdict_notes(judged, plan, looped=True)
    if run.settled is None:
        yield note("dead-band", band_deg=band, cases_share=share)
    else:
        largest = math.degrees(plan.largest[0])
        when = plan.largest[1]
        yield note(
            "dead-band-held", band_deg=band, cases_share=share, largest_deg=largest, at_s=when
        )
    first = min(plan.margins, key=lambda margin: margin.delay, default=None)
    if first is not None and first.delay >= 0.0:
        yield note("delay-margin", margin_s=first.delay, channel=first.channel)
    yield note("loop-in-file", loop=described(run.loop))
    if run.case is None:
        yield note("loop-flown", until_s=run.until, seed=run.seed)
    else:
        yield note("loop-case-flown", until_s=run.until, seed=run.seed, case=run.case)


def described(loop: Loop, *, thresholds: bool = True) -> str:
    """The loop in a line: law, sensor, thresholds."""
    sensor = loop.sensor
    kind = "gyros" if sensor.kind == GYRO else "an accelerometer"
    rate = "a continuous signal" if sensor.rate is None else f"{sensor.rate:g} Hz"
    timing = (
        "firings centred on their moments"
        if loop.predict
        else "firings begun as the sensor shows their moment"
    )
    band = (
        f"; fires from {limit_text(loop.start)} down to {limit_text(loop.stop)}"
        if thresholds
        else ""
    )
    return f"Loop: {loop.law}, from {kind} ({rate}){band}; {timing}"


STOPS = {  # codes of notes on a loop that was stopped
    Ending.EMPTY: "loop-tank-empty",
    Ending.SENSOR: "loop-all-reversed",
    Ending.CHANNEL: "loop-channel-reversed",
    Ending.UNCLEAR: "loop-channel-or-sensor",
    Ending.FED: "loop-feeds",
}


def stopped(run: LoopRun) -> Note:
    """The reason why the loop was stopped by a fault."""
    channels = ", ".join(dict.fromkeys(firing.pulse.channel for firing in run.fired))
    at = run.fired[-1].pulse.end if run.fired else 0.0
    return note(
        STOPS[run.stop], at_s=at, firings=len(run.fired), channel=run.channel, channels=channels
    )


def warnings(spacecraft: Spacecraft) -> Iterator[Note]:
    """Parts of the loop in the file that will feed the nutation, or waste propellant: before it is
    flown.
    """
    loop = spacecraft.loop
    if loop is None:
        return
    per_channel = margins(spacecraft, loop)
    turned = [margin.channel for margin in per_channel if margin.turned]
    if turned and len(turned) == len(per_channel) and loop.sensor.scale < 0.0:
        yield note("sensor-reversed", scale_percent=100.0 * loop.sensor.scale)
    elif turned:
        yield note("channels-reversed", channels=", ".join(turned))
    late = feeding(spacecraft, loop)
    if late is not None:
        yield note("loop-does-not-damp", why=too_late(late))
    band = dead_band(spacecraft, loop)
    start = math.degrees(loop.start)
    stop = math.degrees(loop.stop)
    step, noise = math.degrees(band.step), math.degrees(band.noise)
    if band.step > loop.start * (1.0 + 1e-9):
        yield note("start-below-pulse", start_deg=start, step_deg=step)
    if 0.5 * band.step > loop.stop > 0.0:
        yield note("stop-below-pulse", stop_deg=stop, step_deg=step)
    if band.tilt > max(0.5 * loop.stop, TILTED * loop.start):
        yield note("gyros-tilted", tilt_deg=math.degrees(band.tilt), stop_deg=stop)
    if band.noise > loop.start:
        yield note("start-below-noise", start_deg=start, noise_deg=noise)
    elif band.noise > loop.stop > 0.0:
        yield note("stop-below-noise", stop_deg=stop, noise_deg=noise)


def verification_screen(verification: LoopVerification) -> RenderableType:
    """The loop beside the same by DOP853."""
    run, other = verification.run, verification.other
    parts = [
        *opening(run.flight.spacecraft, verbose=True),
        Text(described(run.loop), style="bold"),
        Text(),
    ]
    if other is None:
        return Group(*parts, Text(f"NOT CONFIRMED by DOP853: {verification.missing}."))
    result = f"DOP853, the file alone, {verification.evaluations:,} evaluations, fires "
    if verification.agree:
        result += (
            f"alike: {len(run.fired)} firings, times within {verification.worst:.1g} s "
            f"({AGREE:g} s allowed)."
        )
    elif verification.same:
        result += (
            f"DIFFERENTLY: times differ by up to {verification.worst:.2g} s ({AGREE:g} s allowed)."
        )
    else:
        result += (
            f"DIFFERENTLY: {len(other.fired)} firings instead of {len(run.fired)}, "
            "or other channels."
        )
    return Group(
        *parts, _differences(verification).screen("verified", first=SHOWN - 1), Text(), Text(result)
    )


def _differences(verification: LoopVerification) -> DataTable:
    pairs = enumerate(zip(verification.run.fired, verification.pairs, strict=False))
    rows = [
        FiringRow(index, firing, firing.true_nutation, apart=apart)
        for index, (firing, apart) in pairs
    ]
    return DataTable("Differences by DOP853", FIRINGS, rows)


def loop_json(plan: LoopPlan) -> dict[str, Any]:
    """Firings with the nutation seen, final motion, dead band, margin of each channel before it
    feeds, and notes.
    """
    run, spacecraft = plan.flown_run, plan.spacecraft
    pulses = zip(pulse_table(run.flight).json("flown"), firing_table(run).json(), strict=True)
    faults = [stopped(run)] if run.stop.fault else []
    return {
        **heading(spacecraft),
        **tables.values_of(run, "law=loop.law", "seed", "case", "until_s"),
        "stopped": run.stop.name.lower(),
        "channel": run.channel,
        "meets_requirement": plan.verdict.met,
        "decision": verdicts.verdict_json(plan.verdict),
        "quiet_s": list(run.quiet),
        "largest_since_quiet_deg": None if run.settled is None else math.degrees(plan.largest[0]),
        "dead_band_deg": math.degrees(plan.band.most),
        "pulses": [pulse | firing for pulse, firing in pulses],
        **tables.values_of(plan, "total_impulse_Nms", "propellant_kg", "end_s"),
        "flown": decisions.residual_json(plan._flight.residual),
        "final": decisions.final_json(plan._flight),
        "target": decisions.target_json(spacecraft),
        "margins": margin_table(plan.margins).json(),
        "notes": [note_json(entry) for entry in (*faults, *ordered(_notes(plan, plan.verdict)))],
    }


def verified_json(verification: LoopVerification) -> dict[str, Any]:
    """The object of ``verify --loop --json``: of each firing the difference by DOP853."""
    return {
        **heading(verification.run.flight.spacecraft),
        "scheme": "loop",
        "agree": None if verification.missing else verification.agree,
        "missing": verification.missing or None,
        **tables.values_of(verification, "evaluations", "until_s=run.until"),
        "firings": _differences(verification).json("verified_json"),
    }


# share of its spin by which a year may change it before figures of the present spin mislead
SLOW = 0.1


def _of_cycle(name: str, scale: float = 1.0) -> Callable[[HeldNutation], float | None]:
    """A figure of the limit cycle times ``scale``; None without one."""
    figure = attrgetter(f"cycle.{name}")
    return lambda held: (
        None if held.cycle is None or figure(held) is None else scale * float(figure(held))
    )


FILES, EVERYWHERE = "csv json", "screen csv json"


HELD = (
    Column.named("start_deg=thresholds.start", Shared.START, "deg", to_figures(4), EVERYWHERE),
    Column.named("stop_deg=thresholds.stop", "stop", "deg", to_figures(4), EVERYWHERE),
    *tables.file_columns(FILES, "first_firing_s=begins"),
    Column(
        "pulses_per_day",
        Shared.PULSES,
        "1/day",
        _of_cycle("pulses", DAY),
        to_figures(4),
        f"{EVERYWHERE} other",
    ),
    Column("cycles_per_day", "", "", _of_cycle("cycles", DAY), where=f"{FILES} other"),
    Column("impulse_Nms_per_year", "", "", _of_cycle("impulse", YEAR), where=FILES),
    Column(
        "propellant_kg_per_year",
        Shared.PROPELLANT,
        "kg/year",
        _of_cycle("propellant", YEAR),
        to_figures(4),
        f"{EVERYWHERE} other",
    ),
    Column("sigma", "", "", _of_cycle("doubt"), where=FILES),
    Column(
        "",
        "cycle",
        "",
        _of_cycle("cycles"),
        lambda cycles: lasting(1.0 / cycles) if cycles > 0.0 else "no pause",
        "screen",
        rank=1,
    ),
    Column("spin_change_rad_s_per_day", "", "", _of_cycle("spin_rate", DAY), where=FILES),
    Column.named(
        "nutation_low_deg=cycle.low", "after firing", "deg", to_figures(3), EVERYWHERE, rank=4
    ),
    Column.named(
        "nutation_high_deg=cycle.high", "before firing", "deg", to_figures(3), EVERYWHERE, rank=3
    ),
    Column.named(
        "nutation_largest_deg=cycle.largest", Shared.MOST, "deg", to_figures(3), EVERYWHERE, rank=2
    ),
    Column(
        "",
        Shared.SPIN,
        "%/day",
        lambda held: None if held.slows is None else 100.0 * held.slows * DAY / YEAR,
        to_figures(2),
        "screen",
        rank=5,
    ),
    *tables.file_columns(FILES, "noise_deg=band.noise", "smallest_pulse_deg=band.step"),
    Column(
        "tank_lasts_days",
        "tank",
        "days",
        lambda held: None if held.lasts is None else held.lasts / DAY,
        to_figures(4),
        "screen",
        lambda budget: budget.spacecraft.tank is not None,
    ),
    Column(
        "tank_lasts_days",
        "",
        "",
        lambda held: None if held.lasts is None else held.lasts / DAY,
        where=FILES,
    ),
    Column(
        "",
        Shared.VERDICT,
        "",
        lambda held: verdicts.MET[bool(held.meets_requirement)],
        where="screen",
        kind=TEXT,
        when=lambda budget: budget.meets_requirement is not None,
        met=lambda held: held.meets_requirement,
    ),
    Column.named("meets_requirement", "", "", where=FILES, kind=YES_NO),
    Column("why", "", "", lambda held: held.why or None, where=FILES, kind=TEXT),
)


def budget_table(budget: Budget) -> DataTable:
    """A row for each pair of thresholds."""
    return DataTable("Limit cycles", HELD, budget.held, budget)


def budget_screen(budget: Budget, *, verbose: bool = True) -> RenderableType:
    """The screen of ``budget``."""
    head = [
        *opening(budget.spacecraft, verbose),
        *(Text(line, "bold") for line in sentences(_outlook(budget))),
    ]

    def tables(first: int | None = None) -> list[RenderableType]:
        return [budget_table(budget).screen("screen", first=first)] if budget.held else []

    steps = "--csv budget.csv · --plot budget.png · nutdamp loop"
    return Summary(head, tables, [*_budget_notes(budget)], steps, verbose)


def _outlook(budget: Budget) -> Iterator[Note]:
    spacecraft = budget.spacecraft
    limit = None if budget.largest is None else math.degrees(budget.largest)
    now = math.degrees(spacecraft.nutation)
    until = budget.until_largest
    if spacecraft.growth == 0.0:
        yield note("nutation-stays", nutation_deg=now)
    elif spacecraft.growth < 0.0:
        decay = -1.0 / spacecraft.growth
        if limit is None:
            yield note("nutation-decays", e_fold_lasting_s=decay)
        elif until == 0.0:
            yield note("nutation-decayed", e_fold_lasting_s=decay, limit_deg=limit)
        else:
            yield note(
                "nutation-decays-below",
                e_fold_lasting_s=decay,
                limit_deg=limit,
                until_lasting_s=until,
            )
    elif spacecraft.nutation == 0.0:
        yield note("no-nutation-yet")
    elif limit is None:
        yield note("no-largest-nutation")
    elif until == 0.0:
        yield note("damping-due", nutation_deg=now, limit_deg=limit)
    elif until is not None and math.isinf(until):
        end = math.degrees(float(requirements.idle(spacecraft, 1e3 / spacecraft.growth)))
        yield note("damping-never", nutation_deg=now, end_deg=end, limit_deg=limit)
    else:
        yield note("damping-within", until_lasting_s=until, nutation_deg=now, limit_deg=limit)
    if spacecraft.growth > 0.0 and spacecraft.loop is None:
        yield note("budget-needs-loop")


def _budget_notes(budget: Budget) -> Iterator[Note]:
    """Warnings of each pair of thresholds, then what the figures rest on; none without any pair."""
    spacecraft = budget.spacecraft
    if not budget.held:
        return
    for row in budget.held:
        yield from _row_warnings(row, budget)
    changes = [row.slows for row in budget.held if row.slows is not None]
    if changes and max(map(abs, changes)) > SLOW:
        yield note("spin-changes", change_percent=100.0 * max(changes, key=abs) * DAY / YEAR)
    if spacecraft.disturbances:
        yield note("disturbances-left-out")
    sigmas = [row.cycle.doubt for row in budget.held if row.cycle is not None]
    if sigmas:
        yield note("budget-accuracy", sigma=f"{100.0 * max(sigmas):.2g} %")
    yield note("cycle-angles")
    band = next((row.band for row in budget.held if row.band is not None), None)
    if band is not None:
        step = math.degrees(band.step)
        yield note("smallest-pulse", step_deg=step, least_deg=0.5 * step)
    for begins in dict.fromkeys(row.begins for row in budget.held):
        starts = ", ".join(
            limit_text(row.thresholds.start) for row in budget.held if row.begins == begins
        )
        if math.isinf(begins):
            yield note("first-firing-by-noise")
        elif begins == 0.0:
            yield note("first-firing-now", thresholds=starts)
        else:
            yield note("first-firing", thresholds=starts, after_lasting_s=begins)
    if band is not None:
        yield note("sensor-noise", noise_deg=math.degrees(band.noise))
    if spacecraft.tank is not None:
        yield note("tank-days")
    if spacecraft.cold is not None:
        yield note("nozzles-warm")
    if spacecraft.loop is not None:
        yield note("loop-in-file", loop=described(spacecraft.loop, thresholds=False))


def _row_warnings(row: HeldNutation, budget: Budget) -> Iterator[Note]:
    spacecraft, loop = budget.spacecraft, budget.spacecraft.loop
    assert loop is not None
    start, stop = math.degrees(row.thresholds.start), math.degrees(row.thresholds.stop)
    if row.why:
        yield note("no-limit-cycle", why=row.why, start_deg=start, stop_deg=stop)
    else:
        yield from warnings(
            replace(
                spacecraft, loop=replace(loop, start=row.thresholds.start, stop=row.thresholds.stop)
            )
        )
    if row.cycle is not None and row.cycle.cycles == 0.0:
        yield note("never-quiet", start_deg=start, stop_deg=stop)
    if row.noisy:
        yield note(
            "start-noisy", start_deg=start, noise_share=100.0 * NOISY, known_share=100.0 * WIDENED
        )
    if row.other is not None and row.cycle is not None:
        words = ("never falls quiet", "falls quiet between firings")
        held, other = (words[cycle.cycles > 0.0] for cycle in (row.cycle, row.other))
        used = None if row.other.propellant is None else row.other.propellant * YEAR
        yield note(
            "two-limit-cycles",
            held=held,
            held_percent=100.0 * row.share,
            other=other,
            start_deg=start,
            stop_deg=stop,
            pulses=f"{row.other.pulses * DAY:.4g}",
            propellant=quantity(used, "kg"),
        )


def budget_csv(budget: Budget) -> str:
    """One row for each pair of thresholds; unknown values stay empty."""
    return budget_table(budget).csv()


def budget_json(budget: Budget) -> dict[str, Any]:
    """Growth of the nutation, every row, and notes."""
    table = budget_table(budget)
    others = replace(table, rows=[replace(held, cycle=held.other) for held in budget.held])
    return {
        **heading(budget.spacecraft),
        "notes": [
            note_json(entry) for entry in (*_outlook(budget), *ordered(_budget_notes(budget)))
        ],
        **tables.values_of(
            budget,
            "growth_1_s=spacecraft.growth",
            "largest_deg",
            "until_largest_s",
            "law=spacecraft.loop.law",
        ),
        "status": budget.status.value,
        "meets_requirement": budget.meets_requirement,
        "thresholds": [
            row | {"other": None if held.other is None else rates}
            for held, row, rates in zip(
                budget.held, table.json(), others.json("other"), strict=True
            )
        ],
    }
