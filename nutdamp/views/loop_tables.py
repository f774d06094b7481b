"""The screen of ``loop``, and the lines of ``check`` on a loop: verdict, firings, dead band, margins before feeding."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.control_loop.evaluation import AGREE, LoopPlan, LoopVerification
from nutdamp.control_loop.law import Ending
from nutdamp.control_loop.simulation import LoopRun
from nutdamp.control_loop.stability import SURELY, Margin, dead_band, feeding, margins, too_late
from nutdamp.planning.decision import Decision
from nutdamp.spacecraft.equipment import GYRO, Loop
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.views.decisions import cost, decision_table, requirement
from nutdamp.views.end_tables import end_table
from nutdamp.views.layout import columns, facts
from nutdamp.views.plan_tables import header
from nutdamp.views.text import degrees, duration, in_degrees, moment, most

SHOWN = 40
"""Largest number of firings in the table."""


def loop_screen(plan: LoopPlan) -> RenderableType:
    """All tables of ``loop``."""
    run, decision = plan.flown_run, Decision(plan)
    parts: list[RenderableType] = [header(plan.spacecraft), Text(), Text(described(run.loop), style="bold")]
    why = stopped(run)
    if why:
        parts.append(Text.assemble(("Stopped: ", "bold red"), f"{why}."))
    elif run.case is not None:
        met = "" if plan.meets_requirement is None else " meets" if plan.meets_requirement else " does NOT meet"
        parts.append(Text(f"Dispersed case {run.case} of seed {run.seed}{met and met + ' the requirement'}."))
    elif run.lost and decision.nominal and not decision.strays:
        why = (
            "limits.max_pulses is reached"
            if run.stop is Ending.FULL
            else "the loop is never down to its stop threshold"
        )
        parts.append(Text.assemble("Requirement ", (f"NOT met: {why}", "bold red"), "."))
    else:
        parts += list(requirement(decision, looped=True))
    parts += [Text.assemble(("Warning: ", "bold red"), f"{warning}.") for warning in warnings(plan.spacecraft)]
    parts += [Text(), decision_table(decision, "nominal" if run.case is None else "this case"), Text(), _outcome(plan)]
    if run.fired:
        parts += [Text(), _firings(run)]
        if len(run.fired) > SHOWN:
            parts.append(Text(f"{len(run.fired) - SHOWN} more firings: --csv writes all", style="dim"))
    parts += [Text(), margin_table(plan.margins), Text(), end_table(plan.flight, plan.aspects)]
    return Group(*parts)


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
    count, after = len(run.fired), ""
    if run.fired:
        after = f"after {count} firing{'s' * (count != 1)}, at {moment(run.fired[-1].pulse.end)}: "
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
    turned = [margin.channel for margin in per_channel if margin.cause.turned]
    if turned and len(turned) == len(per_channel) and loop.sensor.scale < 0.0:
        scale = f"loop.sensor.scale = {100.0 * loop.sensor.scale:g} %"
        yield f"{scale} is a reversed sensor: every firing feeds the nutation"
    elif turned:
        how, feed = ("is", "feeds") if len(turned) == 1 else ("are", "feed")
        yield f"loop: {' and '.join(turned)} {how} wired backwards against the sensor, and {feed} the nutation"
    late = feeding(spacecraft, loop)
    if late is not None:
        yield too_late(late)
    band = dead_band(spacecraft, loop)
    if band.step > loop.start * (1.0 + 1e-9):
        yield (
            f"loop.start is below {degrees(band.step)}, which the smallest pulse takes away: such a firing leaves "
            "up to as much as it found; a start above it needs less propellant"
        )
    if 0.5 * band.step > loop.stop > 0.0:
        yield (
            f"half of {degrees(band.step)}, which the smallest pulse takes away, is above loop.stop: a firing may "
            "leave more than stop that no pulse lowers, and the loop then never pauses"
        )
    if band.noise > loop.start:
        yield f"noise, bias and steps of the sensor, {degrees(band.noise)}, are above loop.start: they set off firings"
    elif band.noise > loop.stop > 0.0:
        yield f"noise, bias and steps of the sensor, {degrees(band.noise)}, are above loop.stop"


def _outcome(plan: LoopPlan) -> Table:
    run, band = plan.flown_run, plan.band
    table = facts()
    settled = _settled(run)
    table.add_row("first quiet", settled)
    if run.settled is not None:
        largest, when = plan.largest
        table.add_row("largest nutation since", f"{degrees(largest)} at {moment(when)}")
    table.add_row("dead band", f"at most {degrees(band.most)} in {100.0 * SURELY:g} % of cases as it falls quiet")
    for name, value in cost(Decision(plan)):
        table.add_row(name, value)
    case = "" if run.case is None else f", dispersed case {run.case}"
    table.add_row("flown", f"0 to {moment(run.until)}, noise of seed {run.seed}{case}")
    return table


def _settled(run: LoopRun) -> str:
    """The time when the loop was first quiet."""
    if run.settled is not None:
        return f"at {moment(run.settled)}"
    if not run.fired and not run.lost:
        return "always: it never shows the start threshold"
    return "never down to the stop threshold" if run.loop.stop > 0.0 else "never: loop.stop is 0"


def _firings(run: LoopRun) -> Table:
    heads = ("firing\n", "start\ns", "on-time\ns", "channel\n", "nutation seen\ndeg", "before\ndeg", "after\ndeg")
    table = columns(*heads, text=("channel\n",))
    before, after = run.flight.around_pulses()
    for index, firing in enumerate(run.fired[:SHOWN]):
        angles = (firing.seen, float(before.nutation[index]), float(after.nutation[index]))
        shown = (in_degrees(angle) for angle in angles)
        pulse = firing.pulse
        table.add_row(str(index + 1), f"{pulse.start:.4f}", f"{pulse.on_time:.4f}", pulse.channel, *shown)
    return table


def verification_screen(verification: LoopVerification) -> RenderableType:
    """The loop beside the same by DOP853."""
    run, other = verification.run, verification.other
    parts: list[RenderableType] = [header(run.spacecraft), Text(), Text(described(run.loop), style="bold"), Text()]
    if other is None:
        return Group(*parts, Text(f"NOT CONFIRMED by DOP853, full tensor: {verification.missing}."))
    heads = ("start\ns", "differs by\ns", "on-time\ns", "differs by\ns", "nutation\ndeg", "differs by\ndeg")
    table = columns("firing\n", "channel\n", *heads, text=("channel\n",))
    for index, (firing, apart) in enumerate(zip(run.fired[:SHOWN], verification.pairs, strict=False), start=1):
        start, on_time = firing.pulse.loaded
        what = (f"{start:.4f}", _apart(apart[0]), f"{on_time:.4f}", _apart(apart[1]))
        nutation = in_degrees(firing.true_nutation)
        table.add_row(str(index), firing.pulse.channel, *what, nutation, _apart(math.degrees(apart[2])))
    result = f"DOP853 on the full tensor, {verification.evaluations:,} evaluations, fires "
    if verification.agree:
        result += f"alike: {len(run.fired)} firings, times within {verification.worst:.1g} s ({AGREE:g} s allowed)."
    elif verification.same:
        result += f"DIFFERENTLY: times differ by up to {verification.worst:.2g} s ({AGREE:g} s allowed)."
    else:
        result += f"DIFFERENTLY: {len(other.fired)} firings instead of {len(run.fired)}, or other channels."
    return Group(*parts, table, Text(), Text(result))


def _apart(value: float) -> str:
    return f"{value:.1e}"


ROUNDING = 1e-12
"""Share of the nutation that a firing leaves by rounding alone."""


def margin_table(margins: tuple[Margin, ...]) -> Table:
    """Margin of each channel before it feeds the nutation."""
    table = columns("channel\n", "late\ndeg", "a firing leaves\n%", "growth in a period\n%", "delay margin\n")
    for row in margins:
        margin = "none" if row.delay < 0.0 else duration(row.delay)
        growth = f"{100.0 * (row.growth - 1.0):.3g}"
        left = 0.0 if row.gain < ROUNDING else 100.0 * row.gain
        table.add_row(row.channel, f"{math.degrees(row.late):.4g}", f"{left:.4g}", growth, margin)
    return table
