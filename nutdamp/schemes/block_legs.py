"""Schedules leg by leg, each planned on what the ones before it leave; and so spin and turn in one row of blocks.

The impulse that turns H goes with |H3|: H is turned while that is smaller, before the spin is raised or once it is
lowered. Trains that turn change the spin too where their channels have a torque about axis 3; the spin leg behind them
is planned on the spin that they leave, the one before them ahead by as much.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from nutdamp.common import work
from nutdamp.common.results import Note
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.flight.propellant import Supply
from nutdamp.schemes.block_flights import BlockFlights, BlockSequence, FlownSequence
from nutdamp.schemes.block_model import acts, fired, spin_turn, sun_pulses
from nutdamp.schemes.correction import FlownBuilder
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import commandable_widths
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import Schedule

LEGS = 6
"""Legs of a row of blocks, at most: spin and turn, and both mended twice."""

MARGIN = 0.97
"""Share of a bound that the turn may use up before the spin is changed, and the inverse for what that may add."""

SLOWEST = 0.01
"""Least share of |H3| that a spin leg is reckoned to leave."""

AMPLE = 1.5
"""Multiple of the time of the fewest pulses that a change of the spin is given."""

Searched = Callable[[Spacecraft, int | None], Schedule]
"""Blocks of one leg, of up to so many; raises Infeasible."""


class Legs:
    """Schedules for a spacecraft, one after the other: pulses, or the ``blocks`` that fire them."""

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.body, self.blocks = spacecraft, list[Block]()
        self._builder, self._supply = FlownBuilder(spacecraft), Supply(spacecraft)

    @property
    def here(self) -> Spacecraft:
        """Spacecraft after the legs so far, its time from there."""
        return self._supply.behind(self._builder.here)

    def fire(self, schedule: Schedule) -> None:
        """Take the schedule of one more leg, with times and Sun pulses counted from `here`."""
        now, builder = self._builder.now, self._builder
        if schedule.blocks and now > 0.0:
            passed = len(sun_pulses(propagation.flown(self.body, builder.schedule(), now), now))
            later = tuple(replace(block, first=block.first + passed) for block in schedule.blocks)
            schedule = replace(schedule, blocks=later)
        self.blocks += schedule.blocks
        builder.fire(schedule)
        self._supply.count(schedule)

    def schedule(self, *notes: Note) -> Schedule:
        """All of them in one, with the Sun pulses of the whole flight."""
        whole = fired(self.body, self.blocks) if self.blocks else self._builder.schedule()
        return replace(whole, notes=notes)


def spin_and_turn(spacecraft: Spacecraft, searched: Searched, most: int | None) -> FlownSequence:
    """Blocks, ``most`` of them, that bring the spin to its goal, and turn or damp: the best of the orders tried.

    The other order is tried where the cheaper one does not comply. Raises Infeasible with the first reason.
    """
    goal, inertia = spacecraft.goal.spin, spacecraft.inertia
    assert goal is not None
    turns_first = abs(inertia.axial(goal)) >= abs(spacecraft.axial)
    flights, why = BlockFlights(spacecraft), list[Infeasible]()
    for first in (turns_first, not turns_first):
        try:
            gained = _flown(spacecraft, flights, searched, most, goal, turns_first=first)
            if not first and gained != 0.0 and not work.exhausted():
                _flown(spacecraft, flights, searched, most, goal - gained, turns_first=first)
        except Infeasible as reason:
            why.append(reason)
        if flights.complies or work.exhausted():
            break
    if not flights.of:
        raise next(iter(why), Infeasible("no pulse is needed"))
    return flights.all[0]


def _flown(
    body: Spacecraft, flights: BlockFlights, searched: Searched, most: int | None, aim: float, *, turns_first: bool
) -> float:
    """Fly a row of legs, the first of the spin to ``aim`` rad/s; returns the change of the spin, rad/s, by a second
    leg that turned, where it takes the spin off its goal.
    """
    legs, goal, gained = Legs(body), body.goal.spin, 0.0
    assert goal is not None
    bounds = {bound.part: bound.most for bound in requirements.bounds(body)}
    nutation, shift = bounds[Part.NUTATION], bounds.get(requirements.aim(body))
    for number in range(LEGS):
        here, turns = legs.here, turns_first == (number % 2 == 0)
        here = replace(here, goal=replace(here.goal, axis=None if shift is None else here.goal.axis, spin=None))
        slower = min(max(abs(body.inertia.axial(goal) / here.axial), SLOWEST), 1.0)  # nutation opens by its inverse
        there = (
            here.nutation <= nutation and (shift is None or here.to_turn <= shift)
            if turns
            else requirements.spins_at(here, aim)
        )
        room = None if most is None else most - len(legs.blocks) - (number == 0)
        if turns and not requirements.spins_at(here, goal):
            allowed = MARGIN * slower * nutation, None if shift is None else MARGIN * shift
            horizon = max(here.horizon - _least_time(here, goal), 0.5 * here.horizon)
        elif turns:
            allowed, horizon = (nutation, shift), here.horizon
        else:
            opened, off = here.nutation / slower / MARGIN, here.to_turn / MARGIN
            allowed, horizon = (max(opened, nutation), None if shift is None else max(off, shift)), here.horizon
            spinning = tuple(channel for channel in here.channels if not channel.damps)
            here, aim = replace(here, goal=replace(here.goal, spin=aim), channels=spinning), goal
        if there or (room is not None and room < 1):
            continue
        try:
            leg = replace(here, requirement=Requirement(*allowed), limits=replace(here.limits, horizon=horizon))
            legs.fire(searched(leg, room))
        except Infeasible:
            if number < 2:
                raise
            break
        if turns and number == 1 and not requirements.spins_at(legs.here, goal):
            gained = legs.here.spin - here.spin
    if legs.blocks:
        flights.flown(BlockSequence(tuple(legs.blocks), (0.0, 0.0, 0.0)))
    return gained


def _least_time(body: Spacecraft, spin: float) -> float:
    """Time, s, that a change to ``spin`` rad/s takes, with some to spare; 0 where no channel gives it."""
    most, commands, change = 0.0, body.commands, spin - body.spin
    assert commands is not None
    for channel in body.channels:
        on_times = acts(channel, commandable_widths(commands, channel)).on_time
        most = max(most, channel.axial * math.copysign(np.max(on_times, initial=0.0), change))
    turns = 2.0 + AMPLE * abs(change) * body.inertia.C / most if most > 0.0 else 0.0
    return turns * spin_turn(body)
