"""Command blocks flown, a dozen sequences together, and planned leg by leg on what the ones before leave.

What is fired follows from the Sun pulses of the nutating body. Legs make spin and turn in one row of blocks. The
impulse that turns H goes with |H3|: H is turned while that is smaller, before the spin is raised or once it is lowered.
Trains that turn change the spin too where their channels have a torque about axis 3; the spin leg behind them is
planned on the spin that they leave, the one before them ahead by as much.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.common.results import Note
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.flight.dynamics import Supply
from nutdamp.flight.end_state import left_by
from nutdamp.schemes.block_model import acts, fire_all, fired, spin_turn, sun_pulses
from nutdamp.schemes.correction import FlownBuilder
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import commandable_widths, keeps_limits
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import Schedule

Blocks = tuple[Block, ...]

FLOWN = 12
"""Sequences of blocks that are flown; as many more where none of them complies."""

DEARER = 1.01
"""Multiple of the cost of a sequence that complied in a flight from which on none is flown."""


class BlockSequence(NamedTuple):
    """Blocks and their rank in closed form: the less, the better.

    ``rank``: the share of a bound that is used up, zero where all are kept, then the cost, then the time of the end;
    ``share``: the share.
    """

    blocks: Blocks
    rank: tuple[float, float, float]
    share: float = math.inf


class FlownSequence(NamedTuple):
    """Flight of a sequence; ``rank``: breaks a limit, share of a bound that is passed, cost, end in s."""

    rank: tuple[bool, float, float, float]
    schedule: Schedule
    sequence: BlockSequence


START = BlockSequence((), (math.inf, math.inf, math.inf))
"""No blocks, before which all others come."""


class BlockFlights:
    """Flights of sequences of one spacecraft: ``of`` each, and the least cost that is ``known`` to comply.

    ``bounds``: what they are judged by.
    """

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.body, self.known = spacecraft, math.inf
        self.bounds, lower = list(requirements.bounds(spacecraft)), 0.98 * spacecraft.nutation
        if spacecraft.goal.axis is None and spacecraft.goal.spin is None:  # then blocks are to lower the nutation
            for index, bound in enumerate(self.bounds):
                if bound.part is Part.NUTATION:
                    self.bounds[index] = bound._replace(most=min(bound.most, lower))
        self.of: dict[Blocks, FlownSequence] = {}
        self._fired: dict[Blocks, Schedule | Infeasible] = {}

    def share(self, left: requirements.Left) -> NDArray[np.float64]:
        """Largest share of a bound that is ``left``: 1 or less keeps all."""
        return np.asarray(np.max(np.broadcast_arrays(*self.shares(left).values()), axis=0))

    def shares(self, left: requirements.Left) -> dict[Part, NDArray[np.float64]]:
        """Share of each bound that is ``left``."""
        return {
            bound.part: np.asarray(requirements.left_of(bound.part, left, self.body) / bound.most)
            for bound in self.bounds
        }

    def fired(self, sequences: Sequence[BlockSequence]) -> Iterator[BlockSequence]:
        """The sequences, one after the other, but for those that cost more than one that complied in a flight.

        The pulses of a dozen of them are fired together.
        """
        for begin in range(0, len(sequences), FLOWN):
            some = [each for each in sequences[begin : begin + FLOWN] if each.rank[1] <= self.known * DEARER]
            new = [sequence.blocks for sequence in some if sequence.blocks not in self._fired]
            if new:
                self._fired.update(zip(new, self._together(new), strict=True))
            yield from (each for each in some if each.rank[1] <= self.known * DEARER)

    def _together(self, some: Sequence[Blocks]) -> Sequence[Schedule | Infeasible]:
        """Pulses of sequences; one by one where the motion of one of them cannot be followed."""
        try:
            return fire_all(self.body, some)[0]
        except Infeasible as reason:
            return [reason] if len(some) == 1 else [self._together([blocks])[0] for blocks in some]

    def flown(self, sequence: BlockSequence) -> FlownSequence:
        """The flight of the blocks, with its rank. Raises Infeasible where they cannot be flown."""
        if sequence.blocks not in self.of:
            if sequence.blocks not in self._fired:
                self._fired[sequence.blocks] = self._together([sequence.blocks])[0]
            schedule = self._fired[sequence.blocks]
            if isinstance(schedule, Infeasible):
                raise schedule
            share = float(self.share(left_by(propagation.flown(self.body, schedule))))
            missed = float(f"{share:.9g}") if share > 1.0 else 0.0  # rounding is no reason to wait for a Sun pulse
            rank = not keeps_limits(self.body, schedule), missed, schedule.cost, schedule.end
            self.of[sequence.blocks] = FlownSequence(rank, schedule, sequence)
            if rank[:2] == (False, 0.0):
                self.known = min(self.known, sequence.rank[1])
        return self.of[sequence.blocks]

    @property
    def all(self) -> list[FlownSequence]:
        """All flights so far, the best first."""
        return sorted(self.of.values(), key=lambda flight: flight.rank)

    @property
    def complies(self) -> bool:
        """True if a sequence complied in its flight."""
        return math.isfinite(self.known)


def by_blocks(sequences: Iterable[BlockSequence]) -> dict[tuple[Block, ...], BlockSequence]:
    """Sequences by their blocks, the last of equal ones at the place of the first."""
    return {sequence.blocks: sequence for sequence in sequences}


def of_each_kind(ranked: Iterable[BlockSequence], *names: str) -> list[BlockSequence]:
    """The first sequence of each kind, blocks with the same values of these fields: flights may differ.

    By default the channel and the interval, where closed forms do not differ.
    """
    kinds: dict[tuple[object, ...], BlockSequence] = {}
    fields = operator.attrgetter(*(names or ("channel", "every")))
    for sequence in ranked:
        kinds.setdefault(tuple(map(fields, sequence.blocks)), sequence)
    return list(kinds.values())


LEGS = 6
"""Legs of a row of blocks, at most: spin and turn, and both mended twice."""

MARGIN = 0.97
"""Share of a bound that the turn may use up before the spin is changed, and the inverse for what that may add."""

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
        slower = min(max(abs(body.inertia.axial(goal) / here.axial), 0.01), 1.0)  # nutation opens by its inverse
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
    return (2.0 + 1.5 * abs(change) * body.inertia.C / most) * spin_turn(body) if most > 0.0 else 0.0
