"""Search over command blocks in closed form, and the flights of the best.

Every block of one channel, width, number of pulses and interval is looked at in closed form (`block_model`), at the
delays next to the two that serve best: one for the heading of H, one for the nutation. Second and third blocks are
looked for behind the most promising. The best dozen are flown from the Sun pulses of the nutating body.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import cached_property
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.flight.end_state import left_by
from nutdamp.schemes.block_model import BlockModel, BlockState, Trial, acts, evenly, fired
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import Windows, commandable_widths, keeps_limits
from nutdamp.spacecraft.equipment import Block, Channel, Commands
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import SAME_COST, Part
from nutdamp.spacecraft.schedule import Schedule

Array = NDArray[np.float64]

FLOWN = 12
"""Sequences of blocks that are flown; as many more where none of them complies."""

GENTLE = 10
"""Multiple of `FLOWN`: sequences among which those with the smallest pulses are flown too."""

ALL_DELAYS = 16
"""Delays up to which all are looked at, if there are no more."""

ALL_BLOCKS, ALL_FIRSTS = 400, 300
"""Blocks after one wait up to which all are looked at, and the cheapest of them behind which others are."""

AROUND = (0, 1)
"""Steps of the delay that are looked at, from the one below the best delay."""

WAITS, LATER_WAITS = 24, 12
"""Sun pulses that may pass before a first and before a later block, so that its nutation meets the one before."""

MOST_WIDTHS = 24
"""Widths that are looked at for a second and a third block, where more can be commanded."""

WINDOWS = 8
"""Blackout windows after which a block is begun, or before which one ends, at most: the first ones."""

BESIDE = 0.01
"""Share of a spin turn by which blocks in closed form keep away from blackout windows: nutation moves Sun pulses."""

SHARES = np.linspace(0.0, 1.0, 13)[1:]
"""Shares of the way that a first block may go, where others follow."""

FIRST = 24
"""First blocks behind which others are looked for: so many of the best, of small ones, and of parts of the way."""

BLOCKS = 3
"""Blocks of a schedule, at most."""

DOUBTFUL = 1.5
"""Share of a bound up to which the closed form may err, so that a flight has to tell whether it is kept."""

DOUBTS = 100
"""Sequences that are flown since they would be cheaper, if the closed form erred in their favour."""

CORRECTED = 4
"""Flights whose neighbours are looked at where none complies."""

SURELY = 3.0
"""Largest difference of a block's length from the way to the target, over its end error."""

LOWER = 0.98
"""Share of the nutation above which it does not count as lowered."""

LOOKED = 2e-6
"""Units of `work` of a block that is looked at."""


class BlockSequence(NamedTuple):
    """Blocks, the motion after them in closed form, and their rank: the less, the better.

    ``rank``: the share of a bound that is used up, zero where all are kept, then the cost, then the time of the end;
    ``share``: the share.
    """

    blocks: tuple[Block, ...]
    state: BlockState
    rank: tuple[float, float, float]
    share: float = math.inf


class FlownSequence(NamedTuple):
    """Flight of a sequence; ``rank``: breaks a limit, share of a bound that is passed, cost, end in s."""

    rank: tuple[bool, float, float, float]
    schedule: Schedule
    sequence: BlockSequence


class BlockSearch:
    """The command blocks of one spacecraft and their ranking in closed form."""

    def __init__(self, spacecraft: Spacecraft, channels: Sequence[Channel], commands: Commands) -> None:
        self.body, self.channels, self.commands = spacecraft, channels, commands
        self.model = BlockModel(spacecraft)
        self.bounds = [self._lowered(bound) for bound in requirements.bounds(spacecraft)]
        self.looked = 0
        self.most = math.inf  # what a sequence may cost
        self._flights: dict[tuple[Block, ...], FlownSequence] = {}
        self.doubtful: list[BlockSequence] = []  # those that may comply in a flight, the cheapest first
        limits = spacecraft.limits
        self.allowed = self.commands.max_count if limits.max_pulses is None else limits.max_pulses
        self.pause = math.ceil(limits.gap / self.model.turn)
        self.dark = Windows(spacecraft).dark
        self.earliest = max(math.ceil((limits.earliest - self.model.start.sun_pulse) / self.model.turn), 0)

    def _lowered(self, bound: requirements.Bound) -> requirements.Bound:
        """A bound of the nutation that there is no more than already: without a target blocks are to lower it."""
        goal = self.body.goal
        if bound.part is not Part.NUTATION or goal.axis is not None or goal.spin is not None:
            return bound
        return bound._replace(most=min(bound.most, LOWER * self.body.nutation))

    def best(self, most: int) -> list[BlockSequence]:
        """The best few sequences of up to ``most`` blocks, those that are flown."""
        start = BlockSequence((), self.model.start, (math.inf, math.inf, math.inf))
        sequences = self._single(start)
        firsts: list[BlockSequence] = []
        for number in range(2, most + 1):
            self.most = self.least_cost(sequences)
            if work.exhausted() or (self.most < math.inf and not self.small):
                break
            if number == 2:
                small = self.behind(start, self._rest(start), few=2) if abs(start.state.phasor) > 0.0 else ()
                firsts = [*_promising(sequences, FIRST), *_promising(small, FIRST), *islice(self._parts(start), FIRST)]
                firsts += self._all_firsts(start) if self.small else []
            else:
                firsts = _promising(firsts, FIRST // 2)
            firsts = [first for first in firsts if first.rank[1] < self.most]
            firsts = [more for first in firsts for more in self.behind(first, self._rest(first), few=4)]
            sequences += firsts
        self.most = math.inf
        unsure = _by_blocks(sequence for sequence in sequences if sequence.share <= DOUBTFUL)
        self.doubtful = sorted(unsure.values(), key=lambda sequence: sequence.rank[1:])
        # The flight differs a little, and the more the larger the nutation on the way: half of them are the cheapest
        # that comply, half those that do most clearly, and the best one of each number of blocks is among them.
        ranked = list(_by_blocks(sorted(sequences, key=lambda sequence: sequence.rank)).values())
        clear = sorted(ranked, key=lambda sequence: sequence.share)[: FLOWN // 2]
        each = {len(sequence.blocks): sequence for sequence in reversed(ranked)}.values()
        first = _by_blocks((*ranked[: FLOWN // 2], *clear, *each))
        # Nutation on the way goes with what one pulse turns H by: where all those miss, the gentlest of many follow.
        gentle = sorted(sorted(ranked, key=lambda sequence: sequence.share)[: GENTLE * FLOWN], key=self._largest_pulse)
        more = _by_blocks((*of_each_kind(ranked)[:FLOWN], *gentle))
        others = (sequence for blocks, sequence in more.items() if blocks not in first)
        return [*first.values(), *islice(others, 2 * FLOWN)]

    def least_cost(self, sequences: Iterable[BlockSequence]) -> float:
        """Least cost, kg, of the sequences that comply in closed form and when flown; infinite where none is known."""
        complying = _by_blocks(sequence for sequence in sequences if sequence.rank[0] <= 0.0)
        cheapest = sorted(complying.values(), key=lambda sequence: sequence.rank)
        for sequence in islice(cheapest, DOUBTS if self.small else FLOWN):
            if work.exhausted():
                break
            with suppress(Infeasible):
                if self.flown(sequence).rank[:2] == (False, 0.0):
                    return sequence.rank[1]
        return math.inf

    def _largest_pulse(self, sequence: BlockSequence) -> float:
        """The most by which one of its pulses turns H, rad."""
        named = {channel.name: channel for channel in self.channels}
        spin = self.body.spin
        return max(float(self.model.turned_by(named[block.channel], block.width, spin)) for block in sequence.blocks)

    def behind(
        self,
        before: BlockSequence,
        trials: Iterator[tuple[Channel, Trial]],
        few: int = FLOWN,
        off: BlockState | None = None,
    ) -> Iterator[BlockSequence]:
        """The best ``few`` of the ``trials`` of each channel, after the blocks ``before``.

        ``off``: by how much they end elsewhere than the closed form says, as far as that is known.
        """
        number = 1
        for block in before.blocks[-1:]:
            number = block.first + (block.count - 1) * block.every + 1
        tank = self.body.tank
        for channel, trial in trials:
            state = self.model.after(before.state, channel, trial)
            left = self.model.left(state if off is None else state.shifted(off))
            shape = np.shape(left.nutation)
            self.looked += int(np.prod(shape))
            work.spend(LOOKED * float(np.prod(shape)))
            severity = np.max(np.broadcast_arrays(*(self.share(bound, left) for bound in self.bounds)), axis=0)
            over = np.asarray(state.sun_pulse) > self.body.horizon + self.model.turn
            over = over | self._dark(before.state, channel, trial, state) | self._longer_round(before.state, state)
            over = over if tank is None else over | (state.used > tank.propellant)
            cost = np.broadcast_to(state.cost, shape)
            severity = np.where(np.isnan(severity) | over | (cost >= self.most), np.inf, severity)
            failed = np.where(severity <= 1.0, 0.0, severity).ravel()
            doubted = np.where(severity <= DOUBTFUL, 0.0, severity).ravel()
            chosen = [*np.lexsort((cost.ravel(), failed))[:few], *np.argsort(severity, axis=None)[: few // 2]]
            chosen += [*np.lexsort((cost.ravel(), doubted))[: DOUBTS if self.small else few]]
            for index in dict.fromkeys(chosen):
                if math.isfinite(failed[index]):
                    at = np.unravel_index(index, shape)
                    wait, delay, width, count, every = (np.broadcast_to(part, shape)[at].item() for part in trial)
                    interval = every if count > 1 else self.commands.every[0]
                    block = Block(channel.name, number + wait, round(delay, 12), round(width, 12), count, interval)
                    here = state.at(at, shape)
                    rank = float(failed[index]), float(cost.ravel()[index]), float(here.sun_pulse)
                    yield BlockSequence((*before.blocks, block), here, rank, float(severity.ravel()[index]))

    def share(self, bound: requirements.Bound, left: requirements.Left) -> Array:
        """Share of a ``bound`` that is ``left``: 1 or less keeps it."""
        return np.asarray(requirements.left_of(bound.part, left, self.body) / bound.most)

    def _spaced(self, every: int) -> bool:
        """True where pulses in one of ``every`` spins keep limits.gap."""
        return every * self.model.turn >= self.body.limits.gap + float(self.commands.widths[0])

    def _counts(self, start: BlockState, every: int) -> NDArray[np.int64]:
        """Numbers of pulses up to the horizon."""
        most = int((self.body.horizon - float(start.sun_pulse)) / (every * self.model.turn)) + 1
        if not self._spaced(every):
            return np.arange(0)
        return np.arange(1, max(min(most, self.commands.max_count, self.allowed), 0) + 1)

    def _single(self, start: BlockSequence) -> list[BlockSequence]:
        """The best single blocks, of all widths, numbers and intervals at the delays that serve best.

        What surely ends worse than the best ones found is left out: see `_short_by`.
        """
        short = [
            (channel, every, self._short_by(start.state, channel, every))
            for channel in self.channels
            for every in self.commands.every
        ]
        most = max((lacks.max() for _, _, lacks in short if lacks.size), default=0.0)
        within = SURELY
        while True:
            trials = (
                (channel, trial)
                for channel, every, lacks in short
                for trial in self._chosen(start.state, channel, every, np.argwhere(lacks <= within))
            )
            sequences = sorted(self.behind(start, trials), key=lambda sequence: sequence.rank)
            enough = SURELY * max(sequences[0].rank[0], 1.0) if sequences else math.inf
            if enough <= within or within >= most or work.exhausted():
                return sequences
            within = min(enough, 10.0 * within, most)

    def _short_by(self, state: BlockState, channel: Channel, every: int) -> Array:
        """Least miss of blocks of each width and number, (w, n), in shares of its bound.

        Where the spin is to change, the spin. With a target the length of the rhumb line: a block that is longer or
        shorter than the way ends no nearer than a third of the difference. Else the nutation, which they can lower by
        the sum of their kicks at most.
        """
        widths, counts = commandable_widths(self.commands, channel)[:, None], self._counts(state, every)[None, :]
        bounds = {bound.part: bound.most for bound in self.bounds}
        if self.body.goal.spin is not None:
            gained = channel.axial * acts(channel, widths).on_time * counts / self.model.inertia.C
            return np.asarray(np.abs(self.body.goal.spin - self.body.spin - gained) / bounds[Part.SPIN])
        if self.body.goal.axis is None:
            trial, step = Trial(0, 0.0, widths, counts, every), self.model.rate * self.body.spin * self.model.turn
            kicks = abs(channel.transverse) * np.abs(self.model.kicks(state, channel, trial, every * step))
            left = np.abs(np.abs(state.phasor) - kicks) / (self.model.inertia.C * abs(self.body.spin))
            return np.asarray(np.maximum(left, 0.0) / bounds[Part.NUTATION])
        way = float(self.model.course(state)[1])
        full, _ = self.model.full_pulses(state, channel, widths, counts)
        length = full * self.model.turned_by(channel, widths, self.body.spin)
        return np.asarray(np.abs(length - way) / bounds[Part.DISTANCE])

    def _chosen(self, state: BlockState, channel: Channel, every: int, index: NDArray[np.int64]) -> Iterator[Trial]:
        """The blocks of the widths and numbers with an ``index`` (k, 2), after every wait and at the best delays."""
        if len(index):
            widths = commandable_widths(self.commands, channel)[index[:, 0]]
            counts = self._counts(state, every)[index[:, 1]]
            for wait in self._waits(state, self.earliest, WAITS if abs(state.phasor) > 0.0 else 1):
                yield self._at_delays(state, channel, wait, widths, counts, every)

    def _rest(self, before: BlockSequence) -> Iterator[tuple[Channel, Trial]]:
        """Blocks that go the rest of the way, or take the nutation that is left."""
        state, least = before.state, self.pause if before.blocks else self.earliest
        if self.small:
            yield from self._grid(state, least)
            return
        _, way = self.model.course(state)
        for channel in self.channels:
            widths = evenly(commandable_widths(self.commands, channel), MOST_WIDTHS)
            if not len(widths):
                continue
            step = self.model.turned_by(channel, widths, float(state.spin))
            full = np.divide(float(way), step, out=np.zeros_like(step), where=step > 0.0)  # none of a torque along spin
            near = self.model.pulses(state, channel, widths, full, self.commands.max_count)
            near = np.rint(near)[:, None] + np.arange(-1, 2)
            few = np.broadcast_to(np.arange(1, 5), (len(widths), 4))
            counts = np.concatenate([near, few], axis=1).clip(1, self.commands.max_count).astype(int)
            for every in self.commands.every:
                if not self._spaced(every):
                    continue
                for wait in self._waits(state, least, LATER_WAITS):
                    yield channel, self._at_delays(state, channel, wait, widths[:, None], counts, every)

    def _parts(self, start: BlockSequence) -> Iterator[BlockSequence]:
        """First blocks that go a part of the way to the target."""
        heading, way = self.model.course(start.state)
        every = next((spins for spins in self.commands.every if self._spaced(spins)), None)
        if self.body.goal.axis is None or every is None:
            return
        for channel in self.channels:
            widths = evenly(commandable_widths(self.commands, channel), 3)
            for width in widths.tolist():
                step = float(self.model.turned_by(channel, width, float(start.state.spin)))
                delay = self.commanded(self.model.delay(channel, heading, width))
                first = float(start.state.sun_pulse) + float(delay) + float(acts(channel, width).over)
                fits = (self.dark[0][:WINDOWS] - first) / (every * self.model.turn) - self.earliest / every
                counts = np.rint([*SHARES * float(way) / step, *np.floor(fits), *np.floor(fits) + 1.0])
                for count in np.unique(counts.clip(1, self.commands.max_count).astype(int)).tolist():
                    for wait in self._waits(start.state, self.earliest, 1):
                        trial = Trial(wait, delay, width, count, every)
                        yield from self.behind(start, iter([(channel, trial)]), few=1)

    @cached_property
    def small(self) -> bool:
        """True where blocks are so few that all are looked at."""
        widths = sum(len(commandable_widths(self.commands, channel)) for channel in self.channels)
        return len(self._delays) <= ALL_DELAYS and widths * len(self._delays) * len(self._all_counts) <= ALL_BLOCKS

    @property
    def _delays(self) -> Array:
        """All delays that can be commanded."""
        most = round(float(self.commanded(np.array(math.inf))) / self.commands.delay_step)
        return np.asarray(np.arange(most + 1) * self.commands.delay_step, dtype=np.float64)

    @property
    def _all_counts(self) -> NDArray[np.int64]:
        return np.arange(1, min(self.commands.max_count, self.allowed) + 1)

    def _grid(self, state: BlockState, least: int) -> Iterator[tuple[Channel, Trial]]:
        """All blocks of each channel, from ``least`` Sun pulses on: by wait, delay, width and number of pulses."""
        waits = np.array(self._waits(state, least, LATER_WAITS))[:, None, None, None]
        for channel in self.channels:
            widths = commandable_widths(self.commands, channel)[:, None]
            parts = waits, self._delays[:, None, None], widths, self._all_counts
            shape = np.broadcast_shapes(*map(np.shape, parts))
            wait, delay, width, count = (np.broadcast_to(part, shape) for part in parts)
            for every in filter(self._spaced, self.commands.every):
                yield channel, Trial(wait, delay, width, count, every)

    def _all_firsts(self, start: BlockSequence) -> list[BlockSequence]:
        """First blocks that cost less than is known to do, the cheapest of each channel, width and number first."""
        firsts = self.behind(start, self._grid(start.state, self.earliest), few=ALL_FIRSTS)
        return sorted(firsts, key=lambda first: first.rank[1])[:ALL_FIRSTS]

    def _waits(self, state: BlockState, least: int, few: int) -> list[int]:
        """Sun pulses that may be let pass before a block: the ``least`` few, and those up to the end of a blackout."""
        after = np.floor((self.dark[1] - float(state.sun_pulse)) / self.model.turn)
        later = after[(after > least) & (self.dark[1] < self.body.horizon)][:WINDOWS].astype(int).tolist()
        return sorted({begin + more for begin in (least, *later) for more in range(few + (begin != least))})

    def _longer_round(self, before: BlockState, after: BlockState) -> NDArray[np.bool_]:
        """True where H has gone round the Sun the longer way to the target, or once more."""
        if self.body.goal.axis is None:
            return np.zeros((), dtype=bool)
        return np.asarray(np.abs(after.longitude - before.longitude - self.model.ahead(before)) > math.pi)

    def _dark(self, state: BlockState, channel: Channel, trial: Trial, after: BlockState) -> NDArray[np.bool_]:
        """True where a pulse of the blocks is on in a blackout window, or just beside it."""
        shape = np.shape(after.sun_pulse)
        dark = np.zeros(shape, dtype=bool)
        if not len(self.dark[0]):
            return dark
        work.spend(LOOKED * dark.size * len(self.dark[0]))
        turn = self.model.turn
        first = state.sun_pulse + trial.wait * turn
        interval = (after.sun_pulse - turn - first) / np.maximum(trial.count - 1, 1)
        interval = np.where(np.asarray(trial.count) > 1, interval, turn)
        aside, lasts = BESIDE * turn, acts(channel, trial.width).over
        for begins, ends in zip(*self.dark, strict=True):
            low = np.ceil((begins - aside - lasts - first - trial.delay) / interval)
            high = np.floor((ends + aside - first - trial.delay) / interval)
            dark |= np.maximum(low, 0.0) <= np.minimum(high, trial.count - 1)
        return dark

    def _at_delays(
        self, state: BlockState, channel: Channel, wait: int, widths: Array, counts: NDArray[np.int64], every: int
    ) -> Trial:
        """The blocks at the delays that serve the heading best, and at those that serve the nutation best."""
        widths, counts = np.broadcast_arrays(widths, counts)
        chosen = []
        if self.body.goal.axis is not None:
            heading, _ = self.model.course(state)
            chosen.append(self.model.delay(channel, heading, widths))
        if abs(state.phasor) > 0.0:
            chosen.append(self.model.damping_delay(state, channel, Trial(wait, 0.0, widths, counts, every)))
        if not chosen:
            chosen.append(np.zeros(widths.shape))
        if len(self._delays) <= ALL_DELAYS:
            delay = np.broadcast_to(self._delays, (*widths.shape, len(self._delays)))
        else:  # and none at all: what is best just before a Sun pulse
            near = [np.floor(delay / self.commands.delay_step)[..., None] + AROUND for delay in chosen]
            steps = np.concatenate([*near, np.zeros((*widths.shape, 1))], axis=-1)
            delay = self.commanded(steps * self.commands.delay_step)
        return Trial(wait, delay, widths[..., None], counts[..., None], every)

    def commanded(self, delay: Array) -> Array:
        """The nearest delay that can be commanded, of those within a spin turn."""
        step, longest = self.commands.delay_step, min(self.commands.delay_max, self.model.turn)
        most = math.floor(longest / step * (1.0 + 1e-12))
        return np.asarray(np.clip(np.rint(delay / step), 0, most) * step)

    def flown(self, sequence: BlockSequence) -> FlownSequence:
        """The flight of the blocks, with its rank. Raises Infeasible where they cannot be flown."""
        if sequence.blocks in self._flights:
            return self._flights[sequence.blocks]
        schedule = fired(self.body, sequence.blocks)
        left = left_by(propagation.flown(self.body, schedule))
        share = max(float(self.share(bound, left)) for bound in self.bounds)
        missed = float(f"{share:.9g}") if share > 1.0 else 0.0  # rounding is no reason to wait for another Sun pulse
        rank = not keeps_limits(self.body, schedule), missed, schedule.cost, schedule.end
        self._flights[sequence.blocks] = FlownSequence(rank, schedule, sequence)
        return self._flights[sequence.blocks]

    def doubted(self, flights: list[FlownSequence]) -> None:
        """Fly sequences cheaper than the best of ``flights``, the cheapest first, until one complies; add them."""
        best = min((flight.rank for flight in flights if not flight.rank[0]), default=None)
        most = math.inf if best is None or best[1] > 0.0 else best[2] * (1.0 - SAME_COST)
        known = {flight.sequence.blocks for flight in flights}
        cheaper = (sequence for sequence in self.doubtful if sequence.rank[1] < most and sequence.blocks not in known)
        for sequence in islice(cheaper, DOUBTS if self.small else FLOWN):
            if work.exhausted():
                return
            with suppress(Infeasible):
                flights.append(self.flown(sequence))
                if flights[-1].rank[:2] == (False, 0.0):
                    return

    def nearer(self, flights: Sequence[FlownSequence]) -> list[BlockSequence]:
        """Neighbours of the best of ``flights`` that leave least where the closed form errs as it does for those.

        Nutation on the way, which that form leaves out, is much the same then.
        """
        named, sequences = {channel.name: channel for channel in self.channels}, list[BlockSequence]()
        distinct = {flight.sequence.blocks: flight for flight in sorted(flights, key=lambda flight: flight.rank)}
        best = of_each_kind([flight.sequence for flight in distinct.values()])
        for flight in (distinct[each.blocks] for each in best[:CORRECTED]):
            *earlier, last = flight.sequence.blocks
            state, number, channel = self.model.start, 1, named[last.channel]
            for block in earlier:
                trial = Trial(block.first - number, block.delay, block.width, block.count, block.every)
                state = self.model.after(state, named[block.channel], trial)
                number = block.first + (block.count - 1) * block.every + 1
            before = BlockSequence(tuple(earlier), state, (math.inf, math.inf, math.inf))
            off = self.model.apart(flight.sequence.state, propagation.flown(self.body, flight.schedule))
            trials = iter([(channel, self._around(before, channel, last, number))])
            sequences += self.behind(before, trials, off=off)
        known = {flight.sequence.blocks for flight in flights}
        other = (sequence for sequence in sequences if sequence.blocks not in known)
        ranked = _by_blocks(sorted(other, key=lambda sequence: sequence.rank))
        chosen = (*islice(ranked.values(), FLOWN // 2), *of_each_kind(ranked.values()))
        return [self._in_form(sequence) for sequence in _by_blocks(chosen).values()]

    def _in_form(self, sequence: BlockSequence) -> BlockSequence:
        """The sequence, ranked by the closed form alone."""
        left = self.model.left(sequence.state)
        share = max(float(self.share(bound, left)) for bound in self.bounds)
        return sequence._replace(rank=(share if share > 1.0 else 0.0, *sequence.rank[1:]), share=share)

    def _around(self, before: BlockSequence, channel: Channel, last: Block, number: int) -> Trial:
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


def _by_blocks(sequences: Iterable[BlockSequence]) -> dict[tuple[Block, ...], BlockSequence]:
    """Sequences by their blocks, the last of equal ones at the place of the first."""
    return {sequence.blocks: sequence for sequence in sequences}


def of_each_kind(ranked: Iterable[BlockSequence]) -> list[BlockSequence]:
    """The first sequence of each kind: flights may differ where closed forms do not."""
    kinds: dict[tuple[tuple[str, int], ...], BlockSequence] = {}
    for sequence in ranked:
        kinds.setdefault(tuple((block.channel, block.every) for block in sequence.blocks), sequence)
    return list(kinds.values())


def _promising(sequences: Iterable[BlockSequence], most: int) -> list[BlockSequence]:
    """Sequences that leave least, and the front of miss against cost: ``most`` of each."""
    ranked, front = sorted(sequences, key=lambda sequence: sequence.rank), list[BlockSequence]()
    for sequence in ranked:
        if not front or sequence.rank[1] < front[-1].rank[1]:
            front.append(sequence)
    return list(_by_blocks((*ranked[:most], *front[:most])).values())
