"""The screen of ``budget``: time until damping must begin, and cost of holding the nutation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.control_loop.budget import DAY, NOISY, WIDENED, YEAR, Budget, HeldNutation
from nutdamp.control_loop.limit_cycle import Cycle
from nutdamp.views.layout import columns, facts
from nutdamp.views.loop_tables import described, warnings
from nutdamp.views.plan_tables import header
from nutdamp.views.text import MISSING, degrees, lasting, most, quantity

SLOW = 0.1
"""Share of its spin by which a year may change it before figures of the present spin mislead."""


def budget_screen(budget: Budget) -> RenderableType:
    """All tables and notes of ``budget``."""
    body = budget.spacecraft
    parts: list[RenderableType] = [header(body), Text()]
    if body.loop is not None and budget.held:
        parts += [Text(described(body.loop, thresholds=False), style="bold"), Text()]
    parts += [Text(line) for line in _outlook(budget)]
    parts += [Text.assemble(("Warning: ", "bold red"), f"{warning}.") for warning in _warnings(budget)]
    if budget.held:
        parts += [Text(), _table(budget), Text(), _notes(budget)]
    return Group(*parts)


def _outlook(budget: Budget) -> Iterator[str]:
    """Course of the nutation without firing, and the time when damping must begin."""
    body, limit = budget.spacecraft, budget.largest
    now = degrees(body.nutation)
    if body.growth == 0.0:
        yield f"The nutation stays at {now}: a sphere has no energy to lose. No damping is needed to hold it."
    elif body.growth < 0.0:
        then = "" if limit is None else _falls(budget, limit)
        decays = f"the nutation decays, e-fold in {lasting(-1.0 / body.growth)}"
        yield f"No damping is needed: {decays}{then}."
    elif body.nutation == 0.0:
        yield "There is no nutation yet that could grow."
    elif limit is None:
        yield "No largest nutation is named: give requirement.nutation or --largest, to see when damping must begin."
    elif budget.until_largest == 0.0:
        yield f"Damping must begin now: the nutation of {now} is already above {most(limit)}."
    else:
        yield (
            f"Damping must begin within {lasting(budget.until_largest)}: "
            f"from {now} now the nutation grows to {most(limit)}."
        )
    if body.growth > 0.0 and body.loop is None:
        yield "Pulses a day and propellant a year need a closed loop: the key loop of the file (nutdamp explain loop)."


def _falls(budget: Budget, limit: float) -> str:
    time = budget.until_largest
    return f"; it is below {most(limit)}" + (" already" if time == 0.0 else f" in {lasting(time)}")


def _warnings(budget: Budget) -> Iterator[str]:
    """Warnings of thresholds that waste propellant, of the present spin, and of a missing limit cycle."""
    body, seen = budget.spacecraft, set()
    for row in budget.held:
        named = f"{_pair(row)}: " if len(budget.held) > 1 else ""
        loop = body.loop
        assert loop is not None
        pair = replace(loop, start=row.thresholds.start, stop=row.thresholds.stop)
        texts = [row.why] if row.why else list(warnings(replace(body, loop=pair)))
        if row.cycle is not None and row.cycle.cycles == 0.0:
            texts.append("the loop never falls quiet: it fires whenever a channel comes into line")
            if loop.sensor.noise == 0.0 and loop.stop > 0.0:
                texts.append("without noise the number of its pulses is known to a factor of two only")
        if row.noisy:
            texts.append(
                f"the noise of the sensor is above {100.0 * NOISY:g} % of loop.start: the loop fires more often than "
                f"the figures say, which are known to {100.0 * WIDENED:g} % only"
            )
        if row.other is not None and row.cycle is not None:
            texts.append(_second(row.cycle, row.other))
        for text in texts:
            if text not in seen:
                seen.add(text)
                yield f"{named}{text}"
    changes = [row.slows for row in budget.held if row.slows is not None]
    if changes and max(map(abs, changes)) > SLOW:
        worst = max(changes, key=abs) * DAY / YEAR
        yield f"the spin changes by up to {100.0 * worst:.3g} % a day: the figures are those of the present spin"
    if body.disturbances and budget.held:
        yield "disturbances of the file are left out"


def _second(cycle: Cycle, other: Cycle) -> str:
    """Note on another limit cycle and its cost."""
    kept, takes = (
        "falls quiet between firings" if each.cycles > 0.0 else "never falls quiet" for each in (cycle, other)
    )
    yearly = None if other.propellant is None else other.propellant * YEAR
    takes += f", with {other.pulses * DAY:.4g} pulses a day"
    takes += "" if yearly is None else f" and {quantity(yearly, 'kg')} a year"
    return f"the loop has two limit cycles: the figures are those in which it {kept}; in the other one it {takes}"


def _pair(row: HeldNutation) -> str:
    return f"{most(row.thresholds.start)} to {most(row.thresholds.stop)}"


def _table(budget: Budget) -> Table:
    """A row for each pair of thresholds."""
    tank, required = budget.spacecraft.tank is not None, budget.meets_requirement is not None
    names = [
        "start\ndeg",
        "stop\ndeg",
        "pulses\n1/day",
        "propellant\nkg/year",
        "cycle\n",
        "low\ndeg",
        "high\ndeg",
    ]
    names += ["max\ndeg", "spin\n%/day", *["tank\ndays"] * tank, *["verdict\n"] * required]
    table = columns(*names, text=("verdict\n",))
    for held in budget.held:
        cycle, spin = held.cycle, budget.spacecraft.spin
        row = [f"{math.degrees(angle):.4g}" for angle in held.thresholds]
        if cycle is None:
            row += [MISSING] * (len(names) - 2 - required)
        else:
            yearly = None if cycle.propellant is None else cycle.propellant * YEAR
            row += [f"{cycle.pulses * DAY:.4g}", quantity(yearly, "").strip()]
            row.append(lasting(1.0 / cycle.cycles) if cycle.cycles > 0.0 else "no pause")
            row += [f"{math.degrees(angle):.3g}" for angle in (cycle.low, cycle.high, cycle.largest)]
            row += [f"{100.0 * cycle.spin_rate * DAY / spin:.2g}", *[_days(held.lasts)] * tank]
        row += ["met" if held.meets_requirement else "NOT met"] * required
        table.add_row(*row)
    return table


def _days(time: float | None) -> str:
    return quantity(None if time is None else time / DAY, "").strip()


def _notes(budget: Budget) -> Table:
    """Notes on the bounds of the limit cycle, and on the accuracy of the figures."""
    table = facts()
    band = next((row.band for row in budget.held if row.band is not None), None)
    if band is not None:
        table.add_row(
            "smallest pulse", f"takes away {degrees(band.step)}; below {degrees(0.5 * band.step)} no firing helps"
        )
        table.add_row("sensor", f"noise, bias and steps of up to {degrees(band.noise)} in a nutation period")
    for begins in dict.fromkeys(row.begins for row in budget.held):
        starts = ", ".join(most(row.thresholds.start) for row in budget.held if row.begins == begins)
        never = "when noise shows it, with no nutation that could grow" if math.isinf(begins) else ""
        table.add_row("first firing", never or ("now" if begins == 0.0 else f"in {lasting(begins)}, at {starts}"))
    known = [row.cycle.doubt for row in budget.held if row.cycle is not None]
    if known:
        table.add_row("known to", f"{100.0 * max(known):.1g} % (one sigma), at the present spin")
    table.add_row("low, high", "mean nutation after and before the firings of a cycle; max: the largest of all")
    if budget.spacecraft.tank is not None:
        table.add_row("tank", "days until it is empty; pulses and propellant are those of the full tank")
    if budget.spacecraft.cold is not None:
        table.add_row("nozzles", "taken as warm")
    return table
