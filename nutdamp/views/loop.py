"""Screens and data of the closed loop: firings, dead band and margins, and the budget of holding the nutation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from rich.console import Group, RenderableType
from rich.text import Text

from nutdamp.control_loop.budget import DAY, NOISY, WIDENED, YEAR, Budget, HeldNutation
from nutdamp.control_loop.controller import Fired
from nutdamp.control_loop.evaluation import AGREE, LoopPlan, LoopVerification
from nutdamp.control_loop.law import Ending
from nutdamp.control_loop.simulation import LoopRun
from nutdamp.control_loop.stability import SURELY, Margin, dead_band, feeding, margins, too_late
from nutdamp.planning.decision import Decision
from nutdamp.planning.notes import decision_notes
from nutdamp.spacecraft.equipment import GYRO, Loop
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views import decisions, tables
from nutdamp.views.decisions import VERDICT, heading
from nutdamp.views.parts import Remark, opening, pulse_table, seconds, summary, warnings_of
from nutdamp.views.tables import TEXT, WHOLE, YES_NO, Column, DataTable, Shared, angle_of, facts, to_figures
from nutdamp.views.text import degrees, duration, lasting, moment, most, quantity, small_angle

SHOWN = 40  # largest number of firings in a table of a screen
ROUNDING = 1e-12  # share of the nutation that a firing leaves by rounding alone


class FiringRow(NamedTuple):
    """A firing, from 0, with the nutation before and after it, rad; ``apart``: start, on-time, nutation by DOP853."""

    at: int
    firing: Fired
    before: float
    after: float = math.nan
    apart: tuple[float, float, float] = (math.nan, math.nan, math.nan)


APART = "{:.1e}".format  # text of a difference

FIRINGS = (
    Column("", "firing", "", lambda row: row.at + 1, where="screen verified", kind=WHOLE),
    Column("channel", Shared.CHANNEL, "", lambda row: row.firing.pulse.channel, where="verified verified_json",
           kind=TEXT),
    Column("", Shared.START, "s", lambda row: row.firing.pulse.start, seconds, "screen"),
    Column("start_s", Shared.START, "s", lambda row: row.firing.pulse.loaded[0], seconds, "verified verified_json"),
    Column("start_difference_s", "differs by", "s", lambda row: row.apart[0], APART, "verified verified_json"),
    Column("", Shared.ON_TIME, "s", lambda row: row.firing.pulse.on_time, seconds, "screen"),
    Column("on_time_s", Shared.ON_TIME, "s", lambda row: row.firing.pulse.loaded[1], seconds, "verified verified_json"),
    Column("on_time_difference_s", "differs by", "s", lambda row: row.apart[1], APART, "verified verified_json"),
    Column("", Shared.CHANNEL, "", lambda row: row.firing.pulse.channel, where="screen", kind=TEXT),
    *tables.file_columns("json", "decided_s=firing.decided"),
    Column("seen_deg", "nutation seen", "deg", angle_of("firing.seen"), small_angle, "screen json"),
    Column("", "before", "deg", angle_of("before"), small_angle, "screen"),
    Column("", "after", "deg", angle_of("after"), small_angle, "screen"),
    Column("", "nutation", "deg", angle_of("firing.true_nutation"), small_angle, "verified"),
    Column("nutation_difference_deg", "differs by", "deg", lambda row: math.degrees(row.apart[2]), APART,
           "verified verified_json"),
)  # fmt: skip


def firing_table(run: LoopRun) -> DataTable:
    """The firings of a run."""
    before, after = run.flight.around_pulses()
    angles = zip(run.fired, before.nutation.tolist(), after.nutation.tolist(), strict=True)
    return DataTable("Firings", FIRINGS, [FiringRow(index, *row) for index, row in enumerate(angles)])


MARGINS = (
    Column("channel", Shared.CHANNEL, "", lambda row: row.channel, where="screen json", kind=TEXT),
    Column("late_deg", "late", "deg", angle_of("late"), to_figures(4), "screen json"),
    *tables.file_columns("json", "latest_deg"),
    Column("gain", "remaining", "%", lambda row: row.gain,
           lambda gain: f"{100.0 * gain:.4g}" if gain >= ROUNDING else "0", "screen json"),
    Column("growth", "growth in a period", "%", lambda row: row.growth, lambda growth: f"{100.0 * (growth - 1.0):.3g}",
           "screen json"),
    Column("", "delay margin", "", lambda row: row.delay, lambda delay: "none" if delay < 0.0 else duration(delay),
           "screen"),
    *tables.file_columns("json", "delay_margin_s=delay", "damps", "reversed=turned"),
)  # fmt: skip


def margin_table(rows: tuple[Margin, ...]) -> DataTable:
    """Margin of each channel before it feeds the nutation, at the start threshold."""
    return DataTable("Margins", MARGINS, rows)


def loop_screen(plan: LoopPlan, *, verbose: bool = True) -> RenderableType:
    """The screen of ``loop``."""
    run, decision = plan.flown_run, Decision(plan)
    (_, spent), (_, end) = decisions.cost(decision)
    fired = f"{spent}, last ends at {end}" if run.fired else "no firing"
    headline = Text.assemble("LOOP ", (run.loop.law, "bold"), f": {fired}; first quiet {_settled(run)}")
    head = [*opening(plan.spacecraft, verbose), headline, *_verdict(plan, decision)]
    head += warnings_of(warnings(plan.spacecraft))
    head += decisions.margin_lines(decision, Shared.THIS_CASE if run.case else Shared.NOMINAL)
    return summary(
        head,
        partial(firing_table(run).screen, "screen", first=SHOWN - 1) if run.fired else None,
        _remarks(plan, decision),
        "--plot loop.png · nutdamp disperse --loop",
        more=[margin_table(plan.margins).screen("screen"), facts(decisions.end_rows(plan.flight, plan.aspects))],
        verbose=verbose,
    )


def _remarks(plan: LoopPlan, decision: Decision) -> Iterator[Remark]:
    run = plan.flown_run
    yield from decision_notes(decision, looped=True)
    band = f"dead band at most {degrees(plan.band.most)} in {100.0 * SURELY:g} % of cases as it falls quiet"
    largest, when = plan.largest
    since = f"; largest nutation since first quiet {degrees(largest)} at {moment(when)}"
    yield band if run.settled is None else band + since
    least = min(plan.margins, key=lambda margin: margin.delay, default=None)
    if least is not None and least.delay >= 0.0:
        yield f"least delay margin before a firing feeds the nutation: {duration(least.delay)}, of {least.channel}"
    yield described(run.loop)
    case = "" if run.case is None else f", dispersed case {run.case}"
    yield f"flown 0 to {moment(run.until)}, noise of seed {run.seed}{case}"


def _verdict(plan: LoopPlan, decision: Decision) -> Iterator[Text]:
    run = plan.flown_run
    if run.stop.fault:
        yield Text.assemble(("Stopped: ", "bold red"), f"{stopped(run)}.")
    elif run.case is not None:
        met = {None: "", True: " meets the requirement", False: " does NOT meet the requirement"}
        yield Text(f"Dispersed case {run.case} of seed {run.seed}{met[plan.meets_requirement]}.")
    elif run.lost and decision.nominal and not decision.strays:
        full = run.stop is Ending.FULL
        why = "limits.max_pulses is reached" if full else "the loop is never down to its stop threshold"
        yield Text.assemble("Requirement ", (f"NOT met: {why}", "bold red"), ".")
    else:
        yield decisions.statement(decision)


def described(loop: Loop, *, thresholds: bool = True) -> str:
    """The loop in a line: law, sensor, thresholds."""
    sensor = loop.sensor
    kind = "gyros" if sensor.kind == GYRO else "an accelerometer"
    rate = "a continuous signal" if sensor.rate is None else f"{sensor.rate:g} Hz"
    timing = "firings centred on their moments" if loop.predict else "firings begun as the sensor shows their moment"
    band = f"; fires from {most(loop.start)} down to {most(loop.stop)}" if thresholds else ""
    return f"Loop: {loop.law}, from {kind} ({rate}){band}; {timing}"


def stopped(run: LoopRun) -> str:
    """The reason why the loop was stopped; empty where it was flown to its end."""
    if not run.stop.fault:
        return ""
    after = f"at {moment(run.fired[-1].pulse.end)}, firings: {len(run.fired)}: " if run.fired else ""
    name, fired = run.channel, " and ".join(dict.fromkeys(firing.pulse.channel for firing in run.fired))
    reasons = {
        Ending.EMPTY: "the tank is empty, and nothing fires any more",
        Ending.SENSOR: f"the sensor is reversed, or else {fired} are all wired backwards: each firing changed what the "
        "sensor shows against what it should",
        Ending.CHANNEL: f"channel {name} is wired backwards: it fed the nutation, and another channel damps it",
        Ending.UNCLEAR: f"channel {name} is wired backwards, or the sensor is reversed: no other channel fired to tell",
        Ending.IDLE: f"channel {name} does nothing, or much less than its torque should",
        Ending.FED: "the firings feed the nutation: sensor or channels are reversed, or they come at the wrong time; "
        "bias, noise or delay hide which",
        Ending.FEEDS: f"a firing of {name} fed the nutation: it came at the wrong time",
    }
    return after + reasons[run.stop]


def warnings(spacecraft: Spacecraft) -> Iterator[str]:
    """Parts of the loop in the file that will feed the nutation, or waste propellant: before it is flown."""
    loop = spacecraft.loop
    if loop is None:
        return
    per_channel = margins(spacecraft, loop)
    turned = [margin.channel for margin in per_channel if margin.turned]
    if turned and len(turned) == len(per_channel) and loop.sensor.scale < 0.0:
        scale = f"loop.sensor.scale = {100.0 * loop.sensor.scale:g} %"
        yield f"{scale} is a reversed sensor: every firing feeds the nutation"
    elif turned:
        yield f"loop: firings feed the nutation, wired backwards against the sensor: {' and '.join(turned)}"
    late = feeding(spacecraft, loop)
    if late is not None:
        yield too_late(late)
    band = dead_band(spacecraft, loop)
    if band.step > loop.start * (1.0 + 1e-9):
        yield (
            f"loop.start is below {degrees(band.step)}, which the smallest pulse takes away: such a firing leaves "
            "up to as much as before; a start above it needs less propellant"
        )
    if 0.5 * band.step > loop.stop > 0.0:
        yield (
            f"half of {degrees(band.step)}, which the smallest pulse takes away, is above loop.stop: a firing may "
            "leave more than stop that no pulse lowers, and the loop then never pauses"
        )
    noise = f"noise, bias and steps of the sensor, {degrees(band.noise)}, are above"
    if band.noise > loop.start:
        yield f"{noise} loop.start: they set off firings"
    elif band.noise > loop.stop > 0.0:
        yield f"{noise} loop.stop"


def _settled(run: LoopRun) -> str:
    if run.settled is not None:
        return f"at {moment(run.settled)}"
    if not run.fired and not run.lost:
        return "always: it never shows the start threshold"
    return "never: the loop is not down to the stop threshold" if run.loop.stop > 0.0 else "never: loop.stop is 0"


def verification_screen(verification: LoopVerification) -> RenderableType:
    """The loop beside the same by DOP853."""
    run, other = verification.run, verification.other
    parts = [*opening(run.flight.spacecraft, verbose=True), Text(described(run.loop), style="bold"), Text()]
    if other is None:
        return Group(*parts, Text(f"NOT CONFIRMED by DOP853, full tensor: {verification.missing}."))
    result = f"DOP853 on the full tensor, {verification.evaluations:,} evaluations, fires "
    if verification.agree:
        result += f"alike: {len(run.fired)} firings, times within {verification.worst:.1g} s ({AGREE:g} s allowed)."
    elif verification.same:
        result += f"DIFFERENTLY: times differ by up to {verification.worst:.2g} s ({AGREE:g} s allowed)."
    else:
        result += f"DIFFERENTLY: {len(other.fired)} firings instead of {len(run.fired)}, or other channels."
    return Group(*parts, _differences(verification).screen("verified", first=SHOWN - 1), Text(), Text(result))


def _differences(verification: LoopVerification) -> DataTable:
    pairs = enumerate(zip(verification.run.fired, verification.pairs, strict=False))
    rows = [FiringRow(index, firing, firing.true_nutation, apart=apart) for index, (firing, apart) in pairs]
    return DataTable("Differences by DOP853", FIRINGS, rows)


def loop_json(plan: LoopPlan) -> dict[str, Any]:
    """Firings with the nutation seen, final motion, dead band, and margin of each channel before it feeds."""
    run, body = plan.flown_run, plan.spacecraft
    pulses = zip(pulse_table(run.flight).json("flown"), firing_table(run).json(), strict=True)
    return {
        **heading(body),
        **tables.values_of(run, "law=loop.law", "seed", "case", "until_s"),
        "stopped": run.stop.name.lower(),
        "channel": run.channel,
        "meets_requirement": False if run.stop.fault else plan.meets_requirement,
        "requirement": decisions.requirement_json(plan),
        "quiet_s": list(run.quiet),
        "largest_since_quiet_deg": None if run.settled is None else math.degrees(plan.largest[0]),
        "dead_band_deg": math.degrees(plan.band.most),
        "pulses": [pulse | firing for pulse, firing in pulses],
        **tables.values_of(plan, "total_impulse_Nms", "propellant_kg", "end_s"),
        "flown": decisions.residual_json(plan.flight.residual),
        "final": decisions.final_json(plan.flight),
        "target": decisions.target_json(body),
        "margins": margin_table(plan.margins).json(),
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


SLOW = 0.1  # share of its spin by which a year may change it before figures of the present spin mislead


def _of_cycle(name: str, scale: float = 1.0) -> Callable[[HeldNutation], float | None]:
    """A figure of the limit cycle times ``scale``; None without one."""

    def value(held: HeldNutation) -> float | None:
        figure = tables.value_at(held.cycle, name)
        return None if figure is None else scale * float(figure)

    return value


FILES, EVERYWHERE = "csv json", "screen csv json"


HELD = (
    Column("start_deg", Shared.START, "deg", angle_of("thresholds.start"), to_figures(4), EVERYWHERE),
    Column("stop_deg", "stop", "deg", angle_of("thresholds.stop"), to_figures(4), EVERYWHERE),
    *tables.file_columns(FILES, "first_firing_s=begins"),
    Column("pulses_per_day", Shared.PULSES, "1/day", _of_cycle("pulses", DAY), to_figures(4), f"{EVERYWHERE} other"),
    Column("cycles_per_day", "", "", _of_cycle("cycles", DAY), where=f"{FILES} other"),
    Column("impulse_Nms_per_year", "", "", _of_cycle("impulse", YEAR), where=FILES),
    Column("propellant_kg_per_year", Shared.PROPELLANT, "kg/year", _of_cycle("propellant", YEAR), to_figures(4),
           f"{EVERYWHERE} other"),
    Column("sigma", "", "", _of_cycle("doubt"), where=FILES),
    Column("", "cycle", "", _of_cycle("cycles"),
           lambda cycles: lasting(1.0 / cycles) if cycles > 0.0 else "no pause", "screen"),
    Column("spin_change_rad_s_per_day", "", "", _of_cycle("spin_rate", DAY), where=FILES),
    Column("nutation_low_deg", "after firing", "deg", angle_of("cycle.low"), to_figures(3), EVERYWHERE),
    Column("nutation_high_deg", "before firing", "deg", angle_of("cycle.high"), to_figures(3), EVERYWHERE),
    Column("nutation_largest_deg", Shared.MOST, "deg", angle_of("cycle.largest"), to_figures(3), EVERYWHERE),
    Column("", Shared.SPIN, "%/day", lambda held: None if held.slows is None else 100.0 * held.slows * DAY / YEAR,
           to_figures(2), "screen"),
    *tables.file_columns(FILES, "noise_deg=band.noise", "smallest_pulse_deg=band.step"),
    Column("tank_lasts_days", "tank", "days", lambda held: None if held.lasts is None else held.lasts / DAY,
           to_figures(4), "screen", lambda budget: budget.spacecraft.tank is not None),
    Column("tank_lasts_days", "", "", lambda held: None if held.lasts is None else held.lasts / DAY, where=FILES),
    Column("", Shared.VERDICT, "", lambda held: VERDICT[bool(held.meets_requirement)], where="screen", kind=TEXT,
           when=lambda budget: budget.meets_requirement is not None, met=lambda held: held.meets_requirement),
    Column("meets_requirement", "", "", lambda held: held.meets_requirement, where=FILES, kind=YES_NO),
    Column("why", "", "", lambda held: held.why or None, where=FILES, kind=TEXT),
)  # fmt: skip


def budget_table(budget: Budget) -> DataTable:
    """A row for each pair of thresholds."""
    return DataTable("Limit cycles", HELD, budget.held, budget)


def budget_screen(budget: Budget, *, verbose: bool = True) -> RenderableType:
    """The screen of ``budget``."""
    first, *others = _outlook(budget)
    head = [*opening(budget.spacecraft, verbose), Text(first, style="bold"), *map(Text, others)]
    head += warnings_of(_warnings(budget))
    rows = partial(budget_table(budget).screen, "screen") if budget.held else None
    remarks = _notes(budget) if budget.held else ()
    return summary(head, rows, remarks, "--csv budget.csv · --plot budget.png · nutdamp loop", verbose=verbose)


def _outlook(budget: Budget) -> Iterator[str]:
    body, limit = budget.spacecraft, budget.largest
    now = degrees(body.nutation)
    if body.growth == 0.0:
        yield f"The nutation stays at {now}: a sphere has no energy to lose. No damping is needed to hold it."
    elif body.growth < 0.0:
        already, then = budget.until_largest == 0.0, ""
        if limit is not None:
            then = f"; it is below {most(limit)} " + ("already" if already else f"in {lasting(budget.until_largest)}")
        yield f"No damping is needed: the nutation decays, e-fold in {lasting(-1.0 / body.growth)}{then}."
    elif body.nutation == 0.0:
        yield "There is no nutation yet that could grow."
    elif limit is None:
        yield "No largest nutation is named: give requirement.nutation or --largest, to see when damping must begin."
    elif budget.until_largest == 0.0:
        yield f"Damping must begin now: the nutation of {now} is not below {most(limit)}."
    else:
        within = lasting(budget.until_largest)
        yield f"Damping must begin within {within}: from {now} now the nutation grows to {most(limit)}."
    if body.growth > 0.0 and body.loop is None:
        yield "Pulses a day and propellant a year need a closed loop: the key loop of the file (nutdamp explain loop)."


def _warnings(budget: Budget) -> Iterator[str]:
    body = budget.spacecraft
    warned: dict[str, str] = {}
    for row in budget.held:
        named = f"{most(row.thresholds.start)} to {most(row.thresholds.stop)}: " if len(budget.held) > 1 else ""
        for text in _warnings_of_row(row, budget):
            warned.setdefault(text, f"{named}{text}")
    yield from warned.values()
    changes = [row.slows for row in budget.held if row.slows is not None]
    if changes and max(map(abs, changes)) > SLOW:
        worst = max(changes, key=abs) * DAY / YEAR
        yield f"the spin changes by up to {100.0 * worst:.3g} % a day: the figures are those of the present spin"
    if body.disturbances and budget.held:
        yield "disturbances of the file are left out"


def _warnings_of_row(row: HeldNutation, budget: Budget) -> Iterator[str]:
    body, loop = budget.spacecraft, budget.spacecraft.loop
    assert loop is not None
    if row.why:
        yield row.why
    else:
        yield from warnings(replace(body, loop=replace(loop, start=row.thresholds.start, stop=row.thresholds.stop)))
    if row.cycle is not None and row.cycle.cycles == 0.0:
        yield "the loop never falls quiet: it fires whenever a channel comes into line"
        if loop.sensor.noise == 0.0 and loop.stop > 0.0:
            yield "without noise the number of its pulses is known to a factor of two only"
    if row.noisy:
        yield (
            f"the noise of the sensor is above {100.0 * NOISY:g} % of loop.start: the loop fires more often than "
            f"the figures say, which are known to {100.0 * WIDENED:g} % only"
        )
    if row.other is not None and row.cycle is not None:
        words = ("never falls quiet", "falls quiet between firings")
        kept, takes = (words[cycle.cycles > 0.0] for cycle in (row.cycle, row.other))
        takes += f", with {row.other.pulses * DAY:.4g} pulses a day"
        takes += "" if row.other.propellant is None else f" and {quantity(row.other.propellant * YEAR, 'kg')} a year"
        yield f"the loop has two limit cycles: the figures are those in which it {kept}; in the other one it {takes}"


def _notes(budget: Budget) -> Iterator[str]:
    known = [row.cycle.doubt for row in budget.held if row.cycle is not None]
    if known:
        yield f"accuracy: {100.0 * max(known):.1g} % (one sigma), at the present spin"
    yield "after, before firing: mean nutation of a cycle; max: the largest of all"
    band = next((row.band for row in budget.held if row.band is not None), None)
    if band is not None:
        yield f"smallest pulse: takes away {degrees(band.step)}; below {degrees(0.5 * band.step)} no firing helps"
    for begins in dict.fromkeys(row.begins for row in budget.held):
        starts = ", ".join(most(row.thresholds.start) for row in budget.held if row.begins == begins)
        never = "when noise shows it, with no nutation that could grow" if math.isinf(begins) else ""
        yield f"first firing: {never or ('now' if begins == 0.0 else f'in {lasting(begins)}, at {starts}')}"
    if band is not None:
        yield f"sensor: noise, bias and steps of up to {degrees(band.noise)} in a nutation period"
    if budget.spacecraft.tank is not None:
        yield "tank: days until it is empty; pulses and propellant are those of the full tank"
    if budget.spacecraft.cold is not None:
        yield "nozzles: taken as warm"
    if budget.spacecraft.loop is not None:
        yield described(budget.spacecraft.loop, thresholds=False)


def budget_csv(budget: Budget) -> str:
    """One row for each pair of thresholds; unknown values stay empty."""
    return budget_table(budget).csv()


def budget_json(budget: Budget) -> dict[str, Any]:
    """Growth of the nutation, and every row."""
    table = budget_table(budget)
    others = replace(table, rows=[replace(held, cycle=held.other) for held in budget.held])
    return {
        **heading(budget.spacecraft),
        **tables.values_of(
            budget, "growth_1_s=spacecraft.growth", "largest_deg", "until_largest_s", "law=spacecraft.loop.law"
        ),
        "meets_requirement": budget.meets_requirement,
        "thresholds": [
            row | {"other": None if held.other is None else rates}
            for held, row, rates in zip(budget.held, table.json(), others.json("other"), strict=True)
        ],
    }
