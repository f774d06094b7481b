"""The budget of holding the nutation: time until damping must begin, and a row for each pair of thresholds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from nutdamp.control_loop.budget import DAY, NOISY, WIDENED, YEAR, Budget, HeldNutation
from nutdamp.views.decisions import VERDICT, heading
from nutdamp.views.loop import described, warnings
from nutdamp.views.summary import opening, summary, warnings_of
from nutdamp.views.tables import TEXT, YES_NO, Column, DataTable, Shared, angle_of, to_figures
from nutdamp.views.text import degrees, lasting, most, quantity

SLOW = 0.1  # share of its spin by which a year may change it before figures of the present spin mislead


def _of_cycle(name: str, scale: float = 1.0) -> Callable[[HeldNutation], float | None]:
    """A figure of the limit cycle times ``scale``; None without one."""

    def value(held: HeldNutation) -> float | None:
        figure = None if held.cycle is None else getattr(held.cycle, name)
        return None if figure is None else scale * figure

    return value


FILES, EVERYWHERE = "csv json", "screen csv json"


HELD = (
    Column("start_deg", Shared.START, "deg", angle_of("thresholds.start"), to_figures(4), EVERYWHERE),
    Column("stop_deg", "stop", "deg", angle_of("thresholds.stop"), to_figures(4), EVERYWHERE),
    Column("first_firing_s", "", "", lambda held: held.begins, where=FILES),
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
    Column("noise_deg", "", "", angle_of("band.noise"), where=FILES),
    Column("smallest_pulse_deg", "", "", angle_of("band.step"), where=FILES),
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
    warned: set[str] = set()
    for row in budget.held:
        named = f"{most(row.thresholds.start)} to {most(row.thresholds.stop)}: " if len(budget.held) > 1 else ""
        for text in _warnings_of_row(row, budget):
            if text not in warned:
                warned.add(text)
                yield f"{named}{text}"
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
    body, table = budget.spacecraft, budget_table(budget)
    others = replace(table, rows=[replace(held, cycle=held.other) for held in budget.held])
    return {
        **heading(body),
        "growth_1_s": body.growth,
        "largest_deg": None if budget.largest is None else math.degrees(budget.largest),
        "until_largest_s": budget.until_largest,
        "law": None if body.loop is None else body.loop.law,
        "meets_requirement": budget.meets_requirement,
        "thresholds": [
            row | {"other": None if held.other is None else rates}
            for held, row, rates in zip(budget.held, table.json(), others.json("other"), strict=True)
        ],
    }
