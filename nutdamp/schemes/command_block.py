"""Blocks of pulses as spinners are commanded: channel, delay after the Sun pulse, width, number of pulses.

All blocks that can be commanded are looked at in closed form (`tools.block_model`): of one block every channel, width,
number of pulses and interval, each at the delays next to the two that serve best, one for the heading of H and one for
the nutation. Where one does not do, a second and a third are looked for behind the most promising. The best dozen are
flown from the Sun pulses of the nutating body, and the best of these is the schedule.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp import flight, work
from nutdamp.commands import Block
from nutdamp.compliance import SAME_COST
from nutdamp.errors import Infeasible
from nutdamp.limits import commandable_widths, keeps_limits, usable
from nutdamp.outcome import left_by
from nutdamp.schedule import Schedule
from nutdamp.schemes.options import CommandBlockOptions
from nutdamp.schemes.tools import block_notes
from nutdamp.schemes.tools.block_model import Trial, acts, evenly
from nutdamp.schemes.tools.block_search import BLOCKS, FLOWN, MOST_WIDTHS, BlockSearch, Found, of_each_kind
from nutdamp.schemes.tools.reasons import at_hand
from nutdamp.schemes.tools.sun_pulses import fired
from nutdamp.spacecraft import Channel, Spacecraft

Array = NDArray[np.float64]

FLOWN_PULSES = 1000
"""Pulses that are flown, after which no further sequence is."""

DOUBTS = 100
"""Sequences that are flown since they would be cheaper, if the closed form erred in their favour."""

CORRECTED = 4
"""Flights whose neighbours are looked at where none complies."""

ROUNDS = 3
"""How often, each time from the best flights so far."""


class Flown(NamedTuple):
    """What was found, flown: how good it is, those that break a limit last, then the earlier end, and its pulses."""

    rank: tuple[bool, float, float, float]
    made: Schedule
    found: Found


def schedule(spacecraft: Spacecraft, options: CommandBlockOptions) -> Schedule:
    """The blocks that meet the requirement with the least propellant, else those that leave least.

    ``options.max_blocks``: how many there may be. Raises Infeasible with the reason.
    """
    commands = spacecraft.commands
    if commands is None or spacecraft.sun_sensor is None or spacecraft.sun is None:
        raise Infeasible("the file describes no commands: command blocks need the keys sun, sun_sensor and commands")
    tick, spacecraft = spacecraft.limits.tick, replace(spacecraft, limits=replace(spacecraft.limits, tick=None))
    spun = spacecraft.goal.spin is not None
    if spun and spacecraft.goal.axis is not None:
        raise Infeasible("sets the spin or turns H, not both; optimal does")
    able = at_hand(spacecraft, usable(spacecraft, axial=spun))
    channels = [one for one in able if commandable_widths(commands, one).size]
    if not channels:
        raise Infeasible("no width that can be commanded (commands.width) is one that a channel allows")
    search = Search(spacecraft, channels, commands)
    flights: list[Flown] = []
    outside = " outside the blackout windows" if spacecraft.limits.blackout else ""
    why = f"no block that can be commanded ends within the horizon{outside}; a longer limits.horizon may help"
    best = search.best(options.max_blocks or BLOCKS)
    for round_ in range(ROUNDS + 1):
        for number, found in enumerate(best if round_ == 0 else search.nearer(flights)):
            met = any(one.rank[:2] == (False, 0.0) for one in flights)
            pulses = sum(len(one.made) for one in flights)
            if pulses > FLOWN_PULSES * (1 + round_) or work.exhausted() or (met and number >= FLOWN * (round_ == 0)):
                break
            try:
                flights.append(search.flown(found))
            except Infeasible as reason:
                why = f"the best block in closed form cannot be flown: {reason}" if not flights else why
    search.doubted(flights)
    if not flights:
        raise Infeasible(why)
    chosen = _cheapest(flights)
    first = chosen.found.rank[:2] <= best[0].rank[:2]
    notes = [search.note(chosen, first=first), *block_notes.off_ticks(tick, commands)]
    if chosen.rank[1] > 1.0:
        notes.insert(1, search.cures(chosen, options.max_blocks or BLOCKS))
    return replace(chosen.made, notes=tuple(notes))


def _cheapest(flights: Sequence[Flown]) -> Flown:
    """The best flight; of those that cost as much within `SAME_COST`, the fewest pulses, then the earlier end."""
    best = min(flights, key=lambda one: one.rank)
    broken, missed, cost, _ = best.rank
    equal = [one for one in flights if one.rank[:2] == (broken, missed) and one.rank[2] <= cost * (1.0 + SAME_COST)]
    return min(equal, key=lambda one: (len(one.made), one.made.end, one.rank))


class Search(BlockSearch):
    """The same, flown."""

    def flown(self, found: Found) -> Flown:
        """How good the blocks are when they are flown. Raises Infeasible where they cannot be."""
        made = fired(self.body, found.blocks)
        left = left_by(flight.flown(self.body, made))
        share = max(float(self.share(bound, left)) for bound in self.bounds)
        missed = float(f"{share:.9g}") if share > 1.0 else 0.0  # rounding is no reason to wait for another Sun pulse
        rank = not keeps_limits(self.body, made), missed, made.cost, made.end
        return Flown(rank, made, found)

    def doubted(self, flights: list[Flown]) -> None:
        """Fly what would be cheaper than the best of the ``flights`` if it complied, the cheapest first, and add it."""
        best = min((one.rank for one in flights if not one.rank[0]), default=None)
        most = math.inf if best is None or best[1] > 0.0 else best[2] * (1.0 - SAME_COST)
        known = {one.found.blocks for one in flights}
        cheaper = (one for one in self.doubtful if one.rank[1] < most and one.blocks not in known)
        for found in islice(cheaper, DOUBTS if self.small else FLOWN):
            if work.exhausted():
                return
            with suppress(Infeasible):
                flights.append(self.flown(found))
                if flights[-1].rank[:2] == (False, 0.0):
                    return

    def nearer(self, flights: Sequence[Flown]) -> list[Found]:
        """Neighbours of the best of ``flights`` that leave least where the closed form errs as it does for those.

        Nutation on the way, which that form leaves out, is much the same then.
        """
        named, found = {one.name: one for one in self.channels}, list[Found]()
        made = {one.found.blocks: one for one in sorted(flights, key=lambda one: one.rank)}
        best = of_each_kind([one.found for one in made.values()])
        for one in (made[each.blocks] for each in best[:CORRECTED]):
            *earlier, last = one.found.blocks
            state, number, channel = self.model.start, 1, named[last.channel]
            for block in earlier:
                trial = Trial(block.first - number, block.delay, block.width, block.count, block.every)
                state = self.model.after(state, named[block.channel], trial)
                number = block.first + (block.count - 1) * block.every + 1
            before = Found(tuple(earlier), state, (math.inf, math.inf, math.inf))
            off = self.model.apart(one.found.state, flight.flown(self.body, one.made))
            trials = iter([(channel, self._around(before, channel, last, number))])
            found += self.behind(before, trials, off=off)
        known = {one.found.blocks for one in flights}
        ranked = {one.blocks: one for one in sorted(found, key=lambda one: one.rank) if one.blocks not in known}
        chosen = (*islice(ranked.values(), FLOWN // 2), *of_each_kind(ranked.values()))
        return [self._in_form(one) for one in {one.blocks: one for one in chosen}.values()]

    def _in_form(self, found: Found) -> Found:
        """The same, ranked by the closed form alone."""
        left = self.model.left(found.state)
        share = max(float(self.share(bound, left)) for bound in self.bounds)
        return found._replace(rank=(share if share > 1.0 else 0.0, *found.rank[1:]), share=share)

    def _around(self, before: Found, channel: Channel, last: Block, number: int) -> Trial:
        """Blocks about as long and as late as the ``last`` one, from the Sun pulse of that ``number`` on."""
        every = commandable_widths(self.commands, channel)
        at = int(np.argmin(np.abs(every - last.width)))
        widths = np.union1d(evenly(every, MOST_WIDTHS), every[max(at - 3, 0) : at + 4])
        as_long = np.rint(last.count * acts(channel, np.array([last.width])).on_time / acts(channel, widths).on_time)
        least = self.pause if before.blocks else self.earliest
        waits = np.arange(-1, 2) + (last.first - number)
        delays = self.commanded(np.asarray(last.delay + np.arange(-3, 4) * self.commands.delay_step, dtype=np.float64))
        most = min(self.commands.max_count, self.allowed)
        counts = (as_long[:, None] + np.arange(-2, 3)).clip(1, most).astype(int)
        waits = waits[waits >= least][:, None, None, None]
        shape = np.broadcast_shapes(waits.shape, (len(delays), 1, 1), counts.shape)
        parts = waits, delays[:, None, None], widths[:, None], counts
        wait, delay, width, count = (np.broadcast_to(part, shape) for part in parts)
        return Trial(wait, delay, width, count, last.every)

    def cures(self, chosen: Flown, most: int) -> str:
        """What keeps ``chosen`` from leaving less, of up to ``most`` blocks."""
        left = left_by(flight.flown(self.body, chosen.made))
        missed = {bound.part: bound.most for bound in self.bounds if float(self.share(bound, left)) > 1.0}
        more = [f"--max-blocks {BLOCKS}"] * (len(chosen.made.blocks) == most < BLOCKS)
        return block_notes.cures(self.model, self.channels, missed, chosen.made, more)

    def note(self, chosen: Flown, *, first: bool) -> str:
        """What was looked at, and how far flight and closed form are apart; ``first``: it is the best in that form."""
        made, form = chosen.made, self.model.left(chosen.found.state)
        compared = (
            f"none of the {self.looked:,} sequences compared" if len(made.blocks) > 1 else "no other single block"
        )
        return block_notes.searched(compared, form, left_by(flight.flown(self.body, made)), first=first)
