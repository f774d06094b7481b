"""Command blocks to load, and their effect on Sun angle, spin and nutation."""

from __future__ import annotations

import math
from itertools import accumulate

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.views.end_tables import angle_names, angle_texts, spin_text
from nutdamp.views.layout import columns, facts
from nutdamp.views.text import degrees, mass, moment, quantity


def blocks_screen(flown: Flight, velocity: Vector | None) -> RenderableType:
    """The blocks of a flown schedule, its figures before and after, and its ``velocity`` change (3,) m/s."""
    return Group(Text("Command blocks", style="bold"), blocks_table(flown), Text(), _effects(flown, velocity))


def blocks_table(flown: Flight, *, named: bool = False) -> Table:
    """One row a block, as it is loaded: times in s and in counts of the steps of the commands.

    ``named``: every column has a name, for pages; on screens those of one quantity share it.
    """
    body, commands = flown.spacecraft, flown.spacecraft.commands
    names = ["block", "channel", "first Sun", "delay", "", "", "width", "", "pulses", "every"]
    units = ["", "", "pulse", "s", "counts", "deg", "s", "counts", "", "spin"]
    if named:
        names[2], units[2], names[4:6], names[7] = "first Sun pulse", "", ["delay", "delay"], "width"
    table = columns(*(f"{name}\n{unit}" for name, unit in zip(names, units, strict=True)), text=("channel\n",))
    for index, block in enumerate(flown.schedule.blocks, start=1):
        table.add_row(
            str(index),
            block.channel,
            str(block.first),
            f"{block.delay:.6g}",
            "" if commands is None else str(commands.delay_counts(block.delay)),
            f"{math.degrees(block.delay * abs(body.spin)):.2f}",
            f"{block.width:.6g}",
            "" if commands is None else str(commands.width_counts(block.width)),
            str(block.count),
            str(block.every),
        )
    return table


TOLD = 8
"""Largest number of pulses of a block on a screen: the first, the last, and evenly some between."""


def shown_pulses(schedule: Schedule) -> list[int]:
    """Pulses (from 0) that a screen shows: all, but of long blocks only some."""
    if not schedule.blocks:
        return list(range(len(schedule)))
    shown: list[int] = []
    for last, block in zip(accumulate(block.count for block in schedule.blocks), schedule.blocks, strict=True):
        step = max(math.ceil((block.count - 1) / (TOLD - 1)), 1)
        shown += sorted({*range(last - block.count, last, step), last - 1})
    return [index for index in shown if index < len(schedule)]  # a track may end before the last one


def _effects(flown: Flight, velocity: Vector | None) -> Table:
    body, schedule, final = flown.spacecraft, flown.schedule, flown.final
    before, after = flown.around_pulses()
    table = facts()
    for name, pulse in (("first pulse", schedule.pulses[0]), ("last pulse", schedule.pulses[-1])):
        start = pulse.loaded[0]
        dated = body.utc(start, 3)
        table.add_row(name, f"starts at {moment(start)}" + (f", {dated}" if dated else ""))
    for name, before_, after_ in zip(
        angle_names(body), angle_texts(body, body.momentum), angle_texts(body, final.momentum), strict=True
    ):
        table.add_row(f"H: {name}", f"{before_} to {after_}")
    table.add_row("Sun angle of H", f"{_sun_angle(body, body.momentum)} to {_sun_angle(body, final.momentum)}")
    table.add_row("spin", f"{spin_text(body.spin)} to {spin_text(final.spin)}")
    largest = float(max(before.nutation.max(), after.nutation.max()))
    table.add_row("nutation", f"{degrees(body.nutation)} to {degrees(final.nutation)}; largest {degrees(largest)}")
    used = schedule.propellant
    tank = body.tank
    left = "" if used is None or tank is None else f" of {mass(tank.propellant)}; {mass(tank.propellant - used)} left"
    weighs = "" if used is None or body.mass is None else f"; mass {body.mass:.6g} kg to {body.mass - used:.6g} kg"
    table.add_row("propellant", f"{mass(used)}{left}{weighs}")
    if velocity is not None:
        table.add_row("|ΔV|", quantity(float(np.linalg.norm(velocity)), "m/s"))
    return table


def _sun_angle(body: Spacecraft, direction: Vector) -> str:
    assert body.sun is not None
    return degrees(float(attitude.angle_between(direction, body.sun)))
