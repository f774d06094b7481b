"""Command blocks: pulses as spinners are commanded, by channel, delay after the Sun pulse, width
and number.

Spin and turn are made leg by leg in one row of blocks. The impulse that turns H goes with |H3|: H
is turned while that is smaller, before the spin is raised or once it is lowered. Trains that turn
change the spin too where their channels have a torque about axis 3: the spin leg behind them is
planned on what they leave, one before them ahead by as much.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from nutdamp.common import work
from nutdamp.common.results import Note, note
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.flight.end_state import left_by
from nutdamp.schemes.block_model import BlockModel, acts, spin_turn
from nutdamp.schemes.block_search import (
    BLOCKS,
    FLOWN,
    LONGEST,
    BlockFlights,
    BlockSearch,
    BlockSequence,
    FlownSequence,
)
from nutdamp.schemes.catalogue import CommandBlockOptions
from nutdamp.schemes.sequential import NO_AXIAL, at_hand
from nutdamp.schemes.valve_commands import Legs
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import OFF_TICK, commandable_widths, usable
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.spacecraft.requirements import SAME_COST, Left, Part, left_of
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import Schedule

SLOWEST = 0.01  # least share of |H3| that a spin leg is reckoned to leave
AMPLE = 1.5  # multiple of the time of the fewest pulses that a change of the spin is given
FLOWN_PULSES = 2000  # pulses that are flown, after which no further sequence is


def scope_note(search: BlockSearch, chosen: FlownSequence, *, first: bool) -> Note:
    """Scope of the search, and flight against closed form; ``first``:
    it is the best in that form.
    """
    form = search.model.left(search.state(chosen.sequence.blocks))
    flown = left_by(propagation.flown(search.spacecraft, chosen.schedule))
    nutation, end = (
        math.degrees(abs(float(a) - b)) for a, b in zip(form[:2], flown[:2], strict=True)
    )
    if first:
        return note("blocks-compared", compared=search.looked, nutation_deg=nutation, end_deg=end)
    return note("blocks-flown", nutation_deg=nutation, end_deg=end)


def cures(search: BlockSearch, chosen: FlownSequence, most: int) -> list[Note]:
    """Keys of the file that keep the blocks ``chosen``, of up to ``most``, from leaving less."""
    left = left_by(propagation.flown(search.spacecraft, chosen.schedule))
    shares = search.flights.shares(left)
    broken = [
        bound for bound in search.flights.bounds if not requirements.complies(shares[bound.part])
    ]
    missed = {bound.part: bound.limit for bound in broken}
    more = [note("more-blocks", blocks=BLOCKS)] * (len(chosen.schedule.blocks) == most < BLOCKS)
    named = [
        *more,
        *too_coarse(search.model, search.channels, missed),
        *used_up(search.spacecraft, chosen.schedule),
    ]
    return named or [note("finer-commands")]


def too_coarse(
    model: BlockModel, channels: Sequence[Channel], missed: Mapping[Part, float]
) -> Iterator[Note]:
    """Steps of the commands that may, half of each, cost more than the bounds that are ``missed``
    (rad) allow.
    """
    spacecraft, commands = model.spacecraft, model.spacecraft.commands
    assert commands is not None
    way = spacecraft.to_turn if spacecraft.goal.axis is not None else 0.0
    half = 0.5 * commands.delay_step
    spin, damped = abs(spacecraft.spin), abs(model.rate(spacecraft.spin))
    aside = {
        Part.DISTANCE: half * spin * way,
        Part.NUTATION: half * damped * math.tan(spacecraft.nutation),
    }
    # The least by which pulses of neighbouring widths differ in turning H; none is a width too.
    turned = [
        model.turned_by(channel, commandable_widths(commands, channel), spacecraft.spin)
        for channel in channels
    ]
    along = 0.5 * min(float(np.diff(np.sort(turns), prepend=0.0).min()) for turns in turned)
    for part in (Part.DISTANCE, Part.NUTATION):
        if aside[part] > missed.get(part, math.inf):
            change = math.degrees(2.0 * aside[part])
            yield note(
                "finer-delay-step",
                delay_step_s=commands.delay_step,
                part=part.label,
                change_deg=change,
            )
    if along > min(missed.values(), default=math.inf):
        yield note("finer-widths", change_deg=math.degrees(2.0 * along))


def used_up(spacecraft: Spacecraft, schedule: Schedule) -> Iterator[Note]:
    """Limits that the blocks of a schedule use up."""
    commands, limits = spacecraft.commands, spacecraft.limits
    assert commands is not None
    if spacecraft.horizon - schedule.end < 2.0 * spin_turn(spacecraft):
        yield note("longer-horizon", end_s=schedule.end, horizon_s=spacecraft.horizon)
    if limits.max_pulses is not None and len(schedule) >= limits.max_pulses:
        yield note("more-pulses", pulses=limits.max_pulses)
    if any(block.count == commands.max_count for block in schedule.blocks):
        yield note("larger-count", count=commands.max_count)
    elif any(block.count >= LONGEST for block in schedule.blocks):
        yield note("longest-block", count=LONGEST)


def schedule(spacecraft: Spacecraft, options: CommandBlockOptions) -> Schedule:
    """The blocks that meet the requirement with the least propellant, else those that leave least.

    ``options.max_blocks``: how many there may be. Raises Infeasible with the reason.
    """
    commands = spacecraft.commands
    if commands is None or spacecraft.sun_sensor is None or spacecraft.sun is None:
        raise Infeasible(
            "the file describes no commands: command blocks need the keys sun, "
            "sun_sensor and commands"
        )
    tick = spacecraft.limits.tick
    spacecraft = with_limits(spacecraft, tick=None)
    goal, most = spacecraft.goal.spin, options.max_blocks
    nutation = next(
        bound for bound in requirements.bounds(spacecraft) if bound.part is Part.NUTATION
    )
    alone = goal is None or (
        spacecraft.goal.axis is None and bool(nutation.met(spacecraft.nutation))
    )
    if goal is not None:
        expect_spin(spacecraft, goal, alone=alone)
    if alone:
        chosen = _searched(spacecraft, most)
    else:
        chosen = spin_and_turn(spacecraft, most)
        missed = [*used_up(spacecraft, chosen.schedule)] or [note("finer-commands")]
        in_legs = (note("blocks-in-legs"), *missed * (not requirements.complies(chosen.rank[1])))
        chosen = chosen._replace(schedule=replace(chosen.schedule, notes=in_legs))
    steps = np.array([commands.delay_step, *commands.widths, commands.width_step or 0.0]) / (
        tick or 1.0
    )
    notes = chosen.schedule.notes
    if tick is not None and np.abs(steps - np.rint(steps)).max() > OFF_TICK:
        notes = (*notes, note("tick-not-kept", tick_s=tick, delay_step_s=commands.delay_step))
    return replace(chosen.schedule, notes=notes)


def expect_spin(spacecraft: Spacecraft, spin: float, *, alone: bool) -> None:
    """Raise Infeasible where no blocks bring the spin to ``spin`` rad/s; ``alone``: they may turn H
    more than that.
    """
    change = spin - spacecraft.spin
    if spin * spacecraft.spin <= 0.0:
        raise Infeasible(
            "cannot reverse the spin: where the body does not turn there is no Sun pulse"
        )
    if requirements.spins_at(spacecraft, spin):
        return
    if not any(channel.axial for channel in spacecraft.channels):
        raise Infeasible(NO_AXIAL)
    able = [channel for channel in spacecraft.channels if channel.axial * change > 0.0]
    if not any(alone or not channel.damps for channel in able):
        across = "" if alone else ", and less across it"
        raise Infeasible(
            f"no channel has a torque about axis 3 in the sense of the change of spin{across}"
        )


def _searched(spacecraft: Spacecraft, most: int | None) -> FlownSequence:
    """The best of the sequences of up to ``most`` blocks that were looked at together, with notes
    on its schedule.
    """
    commands = spacecraft.commands
    assert commands is not None
    able = at_hand(spacecraft, usable(spacecraft, axial=spacecraft.goal.spin is not None))
    channels = [channel for channel in able if commandable_widths(commands, channel).size]
    if not channels:
        raise Infeasible(
            "no width that can be commanded (commands.width) is one that a channel allows"
        )
    search = BlockSearch(spacecraft, channels, commands)
    outside = " outside the blackout windows" if spacecraft.limits.blackout else ""
    why = (
        f"no block that can be commanded ends within the horizon{outside}; "
        "a longer limits.horizon may help"
    )
    best = search.best(most or BLOCKS)
    if not best and work.exhausted():
        why = "the budget of work is spent before a block is found"
    for round_ in range(4):  # the best ones, and three searches near the best flights so far
        if round_ > 0 and search.flights.complies:
            break
        for number, sequence in enumerate(
            search.flights.fired(best if round_ == 0 else search.nearer())
        ):
            pulses = sum(len(flight.schedule) for flight in search.flights.of.values())
            enough = search.flights.complies and number >= FLOWN * (round_ == 0)
            spent = pulses > FLOWN_PULSES * (1 + round_) or (work.exhausted() and pulses > 0)
            if spent or enough:
                break
            try:
                search.flights.flown(sequence)
            except Infeasible as reason:
                why = f"the best block in closed form cannot be flown: {reason}"
    search.doubted()
    if not search.flights.of:
        raise Infeasible(why)
    # Of those that cost as much as the best the fewest pulses, then the earlier end.
    broken, missed, cost, _ = search.flights.all[0].rank
    alike = [flight for flight in search.flights.all if flight.rank[:2] == (broken, missed)]
    equal = [flight for flight in alike if flight.rank[2] <= cost * (1.0 + SAME_COST)]
    chosen = min(equal, key=lambda flight: (len(flight.schedule), flight.schedule.end, flight.rank))
    first = chosen.sequence.rank[:2] <= best[0].rank[:2]
    notes = [scope_note(search, chosen, first=first)]
    if not requirements.complies(chosen.rank[1]):
        notes += cures(search, chosen, most or BLOCKS)
    return chosen._replace(schedule=replace(chosen.schedule, notes=tuple(notes)))


LEGS = 6  # legs of a row of blocks, at most: spin and turn, and both mended twice

MARGIN = 0.97
"""Share of a bound that the turn may use up before the spin is changed, and the inverse for what
that may add.
"""


def spin_and_turn(spacecraft: Spacecraft, most: int | None) -> FlownSequence:
    """Blocks, ``most`` of them, that bring the spin to its goal, and turn or damp: the best of the
    orders tried.

    The other order is tried where the cheaper one does not comply. Raises Infeasible with the first
    reason.
    """
    goal, inertia = spacecraft.goal.spin, spacecraft.inertia
    assert goal is not None
    turns_first = abs(inertia.axial(goal)) >= abs(spacecraft.axial)
    flights = BlockFlights(spacecraft)
    why = list[Infeasible]()
    for first in (turns_first, not turns_first):
        try:
            gained = _flown(spacecraft, flights, most, goal, turns_first=first)
            if not first and gained != 0.0 and not work.exhausted():
                _flown(spacecraft, flights, most, goal - gained, turns_first=first)
        except Infeasible as reason:
            why.append(reason)
        if flights.complies or work.exhausted():
            break
    if not flights.of:
        raise next(iter(why), Infeasible("no pulse is needed"))
    return flights.all[0]


def _flown(
    spacecraft: Spacecraft,
    flights: BlockFlights,
    most: int | None,
    aim: float,
    *,
    turns_first: bool,
) -> float:
    """Fly a row of legs, the first of the spin to ``aim`` rad/s; returns the change of the spin,
    rad/s, by a second leg that turned, where it takes the spin off its goal.
    """
    legs = Legs(spacecraft)
    goal = spacecraft.goal.spin
    gained = 0.0
    assert goal is not None
    ends = [bound for bound in requirements.bounds(spacecraft) if bound.part is not Part.SPIN]
    bounds = {bound.part: bound.limit for bound in ends}
    nutation = bounds[Part.NUTATION]
    shift = bounds.get(requirements.aim(spacecraft))
    for number in range(LEGS):
        at_leg = legs.at_leg
        turns = turns_first == (number % 2 == 0)
        at_leg = replace(
            at_leg,
            goal=replace(at_leg.goal, axis=None if shift is None else at_leg.goal.axis, spin=None),
        )
        slower = min(
            max(abs(spacecraft.inertia.axial(goal) / at_leg.axial), SLOWEST), 1.0
        )  # nutation opens by its inverse
        there = requirements.spins_at(at_leg, aim)
        if turns:
            now = Left(at_leg.nutation, at_leg.to_turn, at_leg.spin)
            there = all(bool(bound.met(left_of(bound, now, spacecraft))) for bound in ends)
        room = None if most is None else most - len(legs.blocks) - (number == 0)
        if turns and not requirements.spins_at(at_leg, goal):
            allowed = MARGIN * slower * nutation, None if shift is None else MARGIN * shift
            horizon = max(at_leg.horizon - _least_time(at_leg, goal), 0.5 * at_leg.horizon)
        elif turns:
            allowed = (nutation, shift)
            horizon = at_leg.horizon
        else:
            opened, off = at_leg.nutation / slower / MARGIN, at_leg.to_turn / MARGIN
            allowed = (max(opened, nutation), None if shift is None else max(off, shift))
            horizon = at_leg.horizon
            spinning = tuple(channel for channel in at_leg.channels if not channel.damps)
            at_leg = replace(at_leg, goal=replace(at_leg.goal, spin=aim), channels=spinning)
            aim = goal
        if there or (room is not None and room < 1):
            continue
        try:
            leg = replace(
                at_leg,
                requirement=Requirement(*allowed),
                limits=replace(at_leg.limits, horizon=horizon),
            )
            legs.fire(_searched(leg, room).schedule)
        except Infeasible:
            if number < 2:
                raise
            break
        if turns and number == 1 and not requirements.spins_at(legs.at_leg, goal):
            gained = legs.at_leg.spin - at_leg.spin
    if legs.blocks:
        flights.flown(BlockSequence(tuple(legs.blocks), (0.0, 0.0, 0.0)))
    return gained


def _least_time(spacecraft: Spacecraft, spin: float) -> float:
    """Time, s, that a change to ``spin`` rad/s takes, with some to spare; 0 where no channel gives
    it.
    """
    most = 0.0
    commands = spacecraft.commands
    change = spin - spacecraft.spin
    assert commands is not None
    for channel in spacecraft.channels:
        on_times = acts(channel, commandable_widths(commands, channel)).on_time
        most = max(most, channel.axial * math.copysign(np.max(on_times, initial=0.0), change))
    return (
        (2.0 + AMPLE * abs(change) * spacecraft.inertia.C / most) * spin_turn(spacecraft)
        if most > 0.0
        else 0.0
    )
