"""Command blocks: pulses as spinners are commanded, by channel, delay after the Sun pulse, width
and number.

Spin and turn are made leg by leg in one row of blocks. The impulse that turns H goes with |H3|: H
is turned while that is smaller, before the spin is raised or once it is lowered. Trains that turn
change the spin too where their channels have a torque about axis 3: a spin leg behind them is
planned on what they leave.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import accumulate

import numpy as np

from nutdamp.common import work
from nutdamp.common.results import Note, note
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.flight.end_state import left_by
from nutdamp.schemes.block_flights import BlockFlights, FlownSequence
from nutdamp.schemes.block_model import acts, spin_turn
from nutdamp.schemes.block_search import (
    BLOCKS,
    LONGEST,
    BlockSearch,
)
from nutdamp.schemes.catalogue import CommandBlockOptions
from nutdamp.schemes.legs import Legs
from nutdamp.schemes.sequential import NO_AXIAL
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import OFF_TICK, at_hand, commandable_widths, usable
from nutdamp.spacecraft.equipment import ANGLE, Block
from nutdamp.spacecraft.model import Requirement, Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import Schedule

SLOWEST = 0.01  # least share of |H3| that a spin leg is reckoned to leave
AMPLE = 1.5  # multiple of the time of the fewest pulses that a change of the spin is given
FLOWN_PULSES = 2000  # pulses that are flown, after which no further sequence is


def cures(search: BlockSearch, chosen: FlownSequence, most: int) -> list[Note]:
    """Keys of the file that keep the blocks ``chosen``, of up to ``most``, from leaving less.

    Steps of the commands are among them that may, half of each, cost more than the bounds that are
    missed allow.
    """
    spacecraft, commands, model = search.spacecraft, search.commands, search.model
    shares = search.flights.shares(left_by(propagation.flown(spacecraft, chosen.schedule)))
    missed = {
        bound.part: bound
        for bound in search.flights.bounds
        if not requirements.complies(shares[bound.part])
    }
    named = [note("more-blocks", blocks=BLOCKS)] * (len(chosen.schedule.blocks) == most < BLOCKS)
    way = spacecraft.to_turn if spacecraft.goal.axis is not None else 0.0
    half = 0.5 * commands.delay_step
    damped = abs(model.rate(spacecraft.spin)) * math.tan(spacecraft.nutation)
    aside = {Part.DISTANCE: half * abs(spacecraft.spin) * way, Part.NUTATION: half * damped}
    for part, angle in aside.items():
        if part in missed and not missed[part].met(angle):
            step = note(
                "finer-delay-step",
                delay_step_s=commands.delay_step,
                part=requirements.POINTING if part is Part.DISTANCE else part.label,
                change_deg=math.degrees(2.0 * angle),
            )
            named.append(step)
    # The least by which pulses of neighbouring widths differ in turning H; none is a width too.
    turned = [
        model.turned_by(channel, commandable_widths(commands, channel), spacecraft.spin)
        for channel in search.channels
    ]
    along = 0.5 * min(float(np.diff(np.sort(turns), prepend=0.0).min()) for turns in turned)
    if not all(bound.met(along) for bound in missed.values()):
        named.append(note("finer-widths", change_deg=math.degrees(2.0 * along)))
    return [*named, *used_up(spacecraft, chosen.schedule)] or [note("finer-commands")]


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
    if options.per_turn > 2:
        raise Infeasible("blocks fire at most two pulses a turn: give --per-turn 1 or 2")
    tick = spacecraft.limits.tick
    commands = replace(commands, per_turn=max(options.per_turn, commands.per_turn))
    spacecraft = replace(with_limits(spacecraft, tick=None), commands=commands)
    goal, most = spacecraft.goal.spin, options.max_blocks
    nutation = next(
        bound for bound in requirements.bounds(spacecraft) if bound.part is Part.NUTATION
    )
    alone = goal is None or (
        spacecraft.goal.axis is None and bool(nutation.met(spacecraft.nutation))
    )
    if goal is not None:
        expect_spin(spacecraft, goal, alone=alone)
    chosen = None if spacecraft.goal.axis is not None else opposite_blocks(spacecraft, most)
    if chosen is None and alone:
        chosen = _searched(spacecraft, most)
    elif chosen is None or not chosen.complies:
        try:
            in_legs = spin_and_turn(spacecraft, most)
        except Infeasible:
            if chosen is None:
                raise
        else:
            notes = [note("blocks-in-legs")]
            if not requirements.complies(in_legs.rank[1]):
                notes += [*used_up(spacecraft, in_legs.schedule)] or [note("finer-commands")]
            in_legs = in_legs._replace(schedule=replace(in_legs.schedule, notes=tuple(notes)))
            chosen = min(filter(None, (chosen, in_legs)), key=lambda each: each.rank)
    steps = np.array([commands.delay_step, *commands.widths, commands.width_step or 0.0]) / (
        tick or 1.0
    )
    notes = [*chosen.schedule.notes]
    if tick is not None and np.abs(steps - np.rint(steps)).max() > OFF_TICK:
        notes.append(note("tick-not-kept", tick_s=tick, delay_step_s=commands.delay_step))
    return replace(chosen.schedule, notes=tuple(notes))


def expect_spin(spacecraft: Spacecraft, spin: float, *, alone: bool) -> None:
    """Raise Infeasible where no blocks bring the spin to ``spin`` rad/s; ``alone``: they may turn H
    more than that.
    """
    change = spin - spacecraft.spin
    if spin * spacecraft.spin <= 0.0:
        raise Infeasible(
            "blocks cannot reverse the spin: a body that does not spin gives no Sun pulse"
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
    # Opposite blocks undo what a torque about axis 3 does to the spin, and a last leg mends it.
    axial = spacecraft.goal.spin is not None or commands.per_turn > 1
    able = at_hand(spacecraft, usable(spacecraft, axial=axial))
    channels = [channel for channel in able if commandable_widths(commands, channel).size]
    if not channels:
        raise Infeasible(
            "no channel allows a width of commands.width; check its min_on_time and max_on_time"
        )
    search = BlockSearch(spacecraft, channels, most or BLOCKS)
    search.run()
    flights = search.flights
    if not flights.of:
        outside = " outside the blackout windows" if spacecraft.limits.blackout else ""
        why = f"no block ends within the horizon{outside}; a longer limits.horizon may help"
        if flights.why is not None:
            why = f"the best block in closed form cannot be flown: {flights.why}"
        elif work.exhausted():
            why = "the budget of work was used up before a block was found"
        raise Infeasible(why)
    chosen = flights.best()
    # Flight against closed form.
    form = search.model.left(search.rows[chosen.schedule.blocks])
    flown = left_by(propagation.flown(spacecraft, chosen.schedule))
    nutation, end = np.degrees(np.abs(np.ravel(form[:2]) - flown[:2])).tolist()
    figures = {"compared": search.looked, "nutation_deg": nutation, "end_deg": end}
    notes = [note("blocks-compared" if search.whole else "blocks-found", **figures)]
    if not requirements.complies(chosen.rank[1]):
        notes += cures(search, chosen, most or BLOCKS)
    return chosen._replace(schedule=replace(chosen.schedule, notes=tuple(notes)))


PHASES = 12  # delays of opposite blocks that are looked at, where the nutation makes a difference


def opposite_blocks(spacecraft: Spacecraft, most: int | None) -> FlownSequence | None:
    """The best flown of the pairs of like blocks half a turn apart that bring the spin to its goal,
    of the fewest pulses that comply; None where none keeps all limits and bounds but that of the
    nutation, which further blocks may damp.

    What one pulse turns H by, the opposite one turns it back, but for what the spin changes
    between them. By several delays, where there is nutation to be taken along.
    """
    commands, goal = spacecraft.commands, spacecraft.goal.spin
    if commands is None or commands.per_turn < 2 or goal is None or most == 1:
        return None
    search = BlockSearch(spacecraft, usable(spacecraft, axial=True), 2)
    change = (goal - spacecraft.spin) * spacecraft.inertia.C
    first, half = search.earliest + 1, 0.5 * search.model.turn
    phases = half / PHASES * np.arange(PHASES if spacecraft.nutation > 0.0 else 1)
    delays = [
        [commands.after_sun_pulse(delay, spacecraft.spin) for delay in opposite]
        for opposite in search.commanded(np.array([phases, phases + half]).T).tolist()
    ]
    pairs = list[tuple[Block, ...]]()
    for channel in search.channels:
        most_pulses = search.allowed if channel.axial * change > 0.0 else 0
        for count in range(1, most_pulses // 2 + 1):
            on_time = change / (2.0 * count * channel.axial)
            loaded = on_time if channel.valve is None else channel.valve.on_time_for(on_time)
            width = round(commands.nearest_width(loaded), 12)
            able = commandable_widths(commands, channel, width - 1e-12, width + 1e-12, 1).size
            if able and width + spacecraft.limits.gap <= half:
                pairs += [
                    tuple(
                        Block(channel.name, first, delay, width, count, 1, angle)
                        for delay, angle in opposite
                    )
                    for opposite in delays
                ]
    pairs.sort(key=lambda pair: pair[0].count)
    totals = accumulate(2 * pair[0].count for pair in pairs)
    some = [pair for pair, total in zip(pairs, totals, strict=True) if total <= FLOWN_PULSES]
    flights = search.flights
    for begin in range(0, len(some), PHASES):
        if not math.isfinite(flights.cheapest) and not work.exhausted():
            batch = some[begin : begin + PHASES]
            flights.fly(batch)
    if not flights.of:
        return None
    chosen = flights.best()
    shares = flights.shares(left_by(propagation.flown(spacecraft, chosen.schedule)))
    shares.pop(Part.NUTATION, None)
    if chosen.rank[0] or not all(map(requirements.complies, shares.values())):
        return None
    scope = note("blocks-opposite", flown=len(flights.of))
    return chosen._replace(schedule=replace(chosen.schedule, notes=(scope,)))


LEGS = 6  # legs of a row of blocks, at most: spin and turn, and both mended twice

# Share of a bound that the turn may use up before the spin is changed, and the inverse for what
# that may add.
MARGIN = 0.97


def spin_and_turn(spacecraft: Spacecraft, most: int | None) -> FlownSequence:
    """Blocks, ``most`` of them, that bring the spin to its goal, and turn or damp: the best of the
    rows of legs tried.

    The other order is tried where the cheaper one does not comply; where its turn takes the spin
    off the goal, once more with that taken off before. Raises Infeasible with the first reason.
    """
    goal = spacecraft.goal.spin
    assert goal is not None
    turns_first = abs(spacecraft.inertia.axial(goal)) >= abs(spacecraft.axial)
    flights = BlockFlights(spacecraft)
    rows = [(turns_first, goal), (not turns_first, goal)]
    reasons = list[Infeasible]()
    for turns, aim in rows:  # which one more may join
        legs = Legs(spacecraft)
        gained = 0.0
        try:
            for number in range(LEGS):
                at_leg = legs.at_leg
                turning = turns == (number % 2 == 0)
                spin = aim if number < 2 else goal
                due = leg(spacecraft, at_leg, None if turning else spin)
                room = None if most is None else most - len(legs.blocks) - (number == 0)
                if due is None or (room is not None and room < 1):
                    continue
                try:
                    best = None if turning else opposite_blocks(due, room)
                    legs.fire((best or _searched(due, room)).schedule)
                except Infeasible:
                    if number < 2:
                        raise
                    break
                if turning and number == 1 and not requirements.spins_at(legs.at_leg, goal):
                    gained = legs.at_leg.spin - at_leg.spin
            if legs.blocks:
                flights.fly([tuple(legs.blocks)])
        except Infeasible as reason:
            reasons.append(reason)
        if math.isfinite(flights.cheapest) or work.exhausted():
            break
        if len(rows) == 2 and (turns, aim) == rows[1] and gained != 0.0 and not turns_first:
            rows.append((turns, goal - gained))
    if not flights.of:
        raise next(iter(reasons), flights.why or Infeasible("no pulse is needed"))
    return flights.best()


def leg(spacecraft: Spacecraft, at_leg: Spacecraft, aim: float | None) -> Spacecraft | None:
    """Spacecraft of a leg with its own goal and requirement: one that brings the spin to ``aim``
    rad/s, on channels that do that alone, or else turns or damps, with room for the change of spin
    that is to follow. None where nothing is to be done.
    """
    goal, commands = spacecraft.goal.spin, at_leg.commands
    assert goal is not None
    assert commands is not None
    bounds = {bound.part: bound for bound in requirements.bounds(spacecraft)}
    damped, aimed = bounds[Part.NUTATION], bounds.get(requirements.aim(spacecraft))
    nutation = damped.limit
    shift = None if aimed is None else aimed.limit
    horizon, channels = at_leg.horizon, at_leg.channels
    # Share of |H3| that a change of spin leaves: the nutation opens by its inverse.
    share = abs(float(spacecraft.inertia.axial(goal)) / at_leg.axial)
    slower = min(max(share, SLOWEST), 1.0)
    if aim is not None:
        if requirements.spins_at(at_leg, aim):
            return None
        nutation = max(at_leg.nutation / slower / MARGIN, nutation)
        shift = None if shift is None else max(at_leg.to_turn / MARGIN, shift)
        channels = tuple(channel for channel in channels if not channel.damps)
    elif damped.met(at_leg.nutation) and (aimed is None or aimed.met(at_leg.to_turn)):
        return None
    elif not requirements.spins_at(at_leg, goal):
        nutation *= MARGIN * slower
        shift = None if shift is None else MARGIN * shift
        change = goal - at_leg.spin
        strongest = 0.0
        for channel in channels:
            on_times = acts(channel, commandable_widths(commands, channel)).on_time
            longest = math.copysign(np.max(on_times, initial=0.0), change)
            strongest = max(strongest, channel.axial * longest)
        if strongest > 0.0:
            pulses = 2.0 + AMPLE * abs(change) * at_leg.inertia.C / strongest
            horizon = max(horizon - pulses * spin_turn(at_leg), 0.5 * horizon)
    if commands.delay_is == ANGLE:  # steps of angle as at t = 0
        longer = abs(spacecraft.spin / at_leg.spin)
        step, most = commands.delay_step * longer, commands.delay_max * longer
        commands = replace(commands, delay_step=step, delay_max=most)
    axis = None if shift is None else at_leg.goal.axis
    return replace(
        at_leg,
        channels=channels,
        goal=replace(at_leg.goal, axis=axis, spin=aim),
        commands=commands,
        requirement=Requirement(nutation, shift),
        limits=replace(at_leg.limits, horizon=horizon),
    )
