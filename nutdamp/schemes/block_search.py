"""Search over command blocks: a beam in closed form, and flights in batches.

Block after block, each sequence of the beam is continued by blocks of every channel and interval:
pairs of width and number of pulses by their merits, after some waits, at the delays next to the two
that serve best: one for the heading of H, one for the nutation. `BlockModel` gives the motion of
all of them at once. The most promising are flown together, each from the Sun pulses of its own
nutating motion; what they leave is exact where a free motion keeps it, and the best is flown once
more by its pulses alone. Grids of up to `WHOLE` sequences are searched whole: of these no pair,
wait or delay is left out but what surely misses, or costs more than a flight that complies.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.schemes.block_flights import (
    Array,
    BlockFlights,
    Blocks,
    BlockSequences,
    Index,
    first_of_each,
    grid_size,
    least,
)
from nutdamp.schemes.block_model import BlockModel, BlockState, Trial, acts, evenly
from nutdamp.spacecraft.constraints import Windows, commandable_widths
from nutdamp.spacecraft.equipment import Block, Channel, Commands
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import SAME_COST, Part, complies

BLOCKS = 3  # blocks of a schedule, at most
WHOLE = 5_000_000  # sequences of a grid that is searched whole, at most: some ten seconds
LONGEST = 5000  # pulses of a block, at most: more would take the whole budget of work to fire
SOME_COUNTS = 256  # numbers of pulses that are looked at, where a block may have more
FEW_DELAYS = 16  # delays, up to which each is looked at
AROUND = np.array([0.0, 1.0])  # steps from the one below the best delay that are looked at
WAITS = 24  # Sun pulses that may pass before a block, so that its nutation meets the one before
# blackout windows after which a block is begun, or before which one ends, at most: the first ones
WINDOWS = 8
# share of a spin turn by which blocks in closed form keep away from blackout windows: nutation
# moves Sun pulses
BESIDE = 0.01
# Pairs of width and number that are looked at by each merit, for the first block and others.
FIRST_PAIRS, PAIRS = 256, 16
GENTLE = 4  # pulses of a block that is gentle
# Cheapest pairs that are looked at not only where they damp most, but at as many delays: the next
# block takes what they leave only if its pulse is as large as that.
PHASED, PHASES = 4, 12
BEAM = 32  # sequences that are continued, by each merit
COARSE = 300  # cheapest sequences that are continued where delays are few: as in cb5030
DOUBTFUL = 1.5  # share of a bound up to which the closed form may err
FLOWN = 64  # sequences that are flown together, by each merit
FIRST = 12  # sequences that are flown first
LEVEL = 0.1  # relative step of the cost, of each of which the nearest sequence is continued
BATCHES = 16  # multiple of `FLOWN` of doubtful sequences that are flown, the cheapest first
FLOWN_PULSES = 4000  # pulses of a batch of flights, at most: it then takes less than a second
# multiple of the least cost above which further blocks are looked for though one complies
DEAR = 1.5
CHUNK = 200_000  # trials whose motion is computed at once: arrays that the caches hold
LOOKED = 1e-6  # units of `work` of a block that is looked at


class BlockSearch:
    """Search of the command blocks of one spacecraft, of up to ``most`` blocks.

    ``looked``: sequences compared; ``whole``: these are all there are.
    """

    def __init__(self, spacecraft: Spacecraft, channels: Sequence[Channel], most: int) -> None:
        commands = spacecraft.commands
        assert commands is not None
        self.spacecraft, self.channels, self.most = spacecraft, channels, most
        self.commands: Commands = commands
        self.model = BlockModel(spacecraft)
        self.flights = BlockFlights(spacecraft)
        self.limit = {bound.part: bound.limit for bound in self.flights.bounds}
        self.rows = dict[Blocks, BlockState]()  # closed form of those that are flown
        limits, turn, step = spacecraft.limits, self.model.turn, commands.delay_step
        self.allowed = min(commands.max_count, LONGEST, limits.max_pulses or LONGEST)
        self.pause = math.ceil(limits.gap / turn)
        self.dark = Windows(spacecraft).dark
        self.earliest = max(math.ceil((limits.earliest - self.model.start.sun_pulse) / turn), 0)
        self.last_delay = math.floor(min(commands.delay_max, turn) / step * (1.0 + 1e-12))
        shortest = float(commands.widths[0])
        every = [each for each in commands.every if each * turn >= limits.gap + shortest]
        self.kinds = list(itertools.product(channels, every))
        self.intervals = max(len(every), 1)
        self.widths = [commandable_widths(commands, channel) for channel, _ in self.kinds]
        turns = (spacecraft.horizon - self.model.start.sun_pulse) / turn + 1.0
        one_of = [
            (every, len(widths) * (self.last_delay + 1))
            for (_, every), widths in zip(self.kinds, self.widths, strict=True)
        ]
        size = grid_size(int(turns) - self.earliest, one_of, self.allowed, most)
        self.coarse = self.last_delay < FEW_DELAYS
        self.whole = size <= WHOLE and self.coarse
        self.looked = round(size) if self.whole else 0

    @property
    def start(self) -> BlockSequences:
        """The sequence of no blocks."""
        return BlockSequences(np.zeros((1, 0, 5)), np.array([math.inf]), self.model.start.some([0]))

    def run(self) -> None:
        """Search, and fly what is promising; ``flights`` has the results."""
        beam = self.start
        for number in range(1, self.most + 1):
            sequences = self.continued(beam, last=number == self.most)
            if not len(sequences.share):
                break
            self.fly(sequences)
            if work.exhausted() or not (self.coarse or self._dear):
                break
            beam = sequences if self.whole else self.beam(sequences)
            if not len(beam.share):
                break

    @property
    def _dear(self) -> bool:
        """True where more blocks may cost much less than those that comply.

        The least is what kicks cost that all point against ω, or two pulses; or what the straight
        way to the target costs. A bound on the shift may take any more than that.
        """
        if self.spacecraft.goal.spin is not None or self.flights.cheapest == math.inf:
            return self.flights.cheapest == math.inf
        allowed = math.tan(self.limit[Part.NUTATION]) * abs(self.spacecraft.axial)
        kicked = abs(self.model.start.phasor) - allowed
        costs = []
        for (channel, _), widths in zip(self.kinds, self.widths, strict=True):
            if channel.transverse and len(widths):
                on_times = acts(channel, widths).on_time
                lasts = max(kicked / abs(channel.transverse), 2.0 * float(on_times.min()))
                if self.spacecraft.goal.axis is not None:
                    turns = self.model.turned_by(channel, widths, self.spacecraft.spin)
                    way = self.spacecraft.to_turn - self.limit[Part.DISTANCE]
                    lasts = max(way * float(np.min(on_times / turns)), float(on_times.min()))
                costs.append(channel.cost_rate(by_propellant=True) * lasts)
        return self.flights.cheapest > DEAR * min(costs, default=math.inf)

    # --- the beam

    def continued(self, before: BlockSequences, *, last: bool) -> BlockSequences:
        """Sequences of one block more."""
        first = not before.blocks.shape[1]
        earliest = self.earliest if first else self.pause
        # Together go those that have used as much of the supply, or all; where there are blackouts
        # each has waits of its own.
        keys: Array = np.zeros((1, len(before.share)))
        if len(self.dark[0]) > 0 and not self.whole:
            keys = np.arange(len(before.share))[None]
        elif not self.model.steady:
            keys = np.array([before.state.used, *before.state.fired.values()])
        distinct, key = np.unique(keys, axis=1, return_inverse=True)
        none = np.zeros((0, before.blocks.shape[1] + 1, 5))
        parts = [before.some(np.zeros(0, dtype=int))._replace(blocks=none)]
        for number in range(distinct.shape[1]):
            if work.exhausted() and len(parts) > 1:
                break
            group = before.some(np.flatnonzero(key.ravel() == number))
            for kind in range(len(self.kinds)):
                pairs = self.pairs(group, kind, first=first, last=last)
                waits = self.waits(group.state, earliest)
                parts += self.behind(group, kind, pairs, waits, last=last)
                if self.flights.damps and not (last or self.whole):
                    cheap = np.flatnonzero(pairs[2] <= 2)
                    cheap = cheap[np.argsort(pairs[1][cheap] * pairs[2][cheap], kind="stable")]
                    cheap = cheap[:PHASED]
                    some = pairs[0][cheap], pairs[1][cheap], pairs[2][cheap]
                    steps = np.linspace(0.0, self.last_delay, PHASES) * self.commands.delay_step
                    delays = self.commanded(steps)
                    early = waits[: WAITS // 3]
                    parts += self.behind(group, kind, some, early, last=last, delays=delays)
        blocks = np.concatenate([part.blocks for part in parts])
        share = np.concatenate([part.share for part in parts])
        joined = BlockSequences(blocks, share, BlockState.joined([part.state for part in parts]))
        _, distinct = np.unique(blocks, axis=0, return_index=True)
        return joined.some(distinct)

    def pairs(
        self, before: BlockSequences, kind: int, *, first: bool, last: bool
    ) -> tuple[Index, Array, Index]:
        """Rows of those ``before``, widths and numbers of the blocks that are looked at behind
        them.
        """
        channel, every = self.kinds[kind]
        counts = self.counts(before.state, every)
        widths = self.widths[kind]
        rows = np.arange(len(before.share))
        width, count = np.repeat(widths, len(counts)), np.tile(counts, len(widths))
        if kind % self.intervals:  # one pulse has no interval
            width, count = width[count > 1], count[count > 1]
        size = len(width)
        if not size:
            return rows[:0], width, count
        spent = count * acts(channel, width).on_time
        chosen = np.full((len(rows), size), self.whole and not last)
        if not (self.whole and not last):
            misses = self.misses(before.state, channel, every, width, count)
        if self.whole:
            if last:
                chosen = misses <= max(DOUBTFUL, float(misses.min()))
            if self.model.steady:
                price = channel.cost_rate(by_propellant=True)
                chosen &= before.cost[:, None] + price * spent < self.flights.cheapest
        else:
            # The few cheapest that do, the nearest, the gentle that damp most, and some of these.
            few = FIRST_PAIRS if first else PAIRS
            gentle = np.flatnonzero(count <= GENTLE)
            if self.flights.damps:
                damped = misses[:, gentle]
            else:
                some = width[gentle], count[gentle]
                damped = self.damping_misses(before.state, channel, every, *some)
            at_row = rows[:, None]
            in_order = np.where(complies(misses), spent / spent.max() - 2.0 + 1e-9 * misses, misses)
            chosen[at_row, least(in_order, few)] = True
            chosen[at_row, least(misses, few)] = True
            chosen[at_row, gentle[least(damped, few)]] = True
            chosen[:, evenly(gentle, few)] = True
        at = np.nonzero(chosen)
        return rows[at[0]], width[at[1]], count[at[1]]

    def beam(self, sequences: BlockSequences) -> BlockSequences:
        """The promising sequences, with the motion of their flights."""
        rows = self._fly(sequences, self.promising(sequences))
        flights = [self.flights.of.get(blocks) for blocks in self.blocks(sequences, rows)]
        beam = sequences.some(rows[[flight is not None for flight in flights]])
        if not len(beam.share):
            return beam
        ends = np.array([flight.end for flight in flights if flight is not None]).T
        return beam._replace(state=beam.state.shifted(self.model.apart(beam.state, ends)))

    def promising(self, sequences: BlockSequences) -> Index:
        """Rows that are continued: the best of each width, number and interval, of each cost, and
        the gentle; with a target those that have gone each of equal parts of the way to it, else
        those of which one gentle block more may be the cheapest that do.
        """
        order = sequences.ranked
        cost = sequences.cost
        order = order[cost[order] < self.flights.cheapest]
        kind, _, _, width, count = sequences.blocks[:, -1].T
        distinct = first_of_each(order, width, count, kind % self.intervals)
        nearest = order[np.argsort(sequences.share[order], kind="stable")]
        level = np.floor(np.log(np.maximum(cost, 1e-300)) / LEVEL)
        rows = [
            distinct[:BEAM],
            distinct[count[distinct] <= GENTLE][:BEAM],
            first_of_each(nearest, level)[:BEAM],
        ]
        if self.coarse:
            rows.append(order[np.argsort(cost[order], kind="stable")][:COARSE])
        if self.spacecraft.goal.axis is not None and len(order):
            way = self.model.course(sequences.state)[1]
            rows.append(
                first_of_each(distinct, np.floor(BEAM * way / max(way[order].max(), 1e-300)))
            )
        if self.flights.damps:
            totals = np.full(len(cost), np.inf)
            for number, (channel, every) in enumerate(self.kinds):
                widths = np.repeat(self.widths[number], GENTLE)
                counts = np.tile(np.arange(1, GENTLE + 1), len(self.widths[number]))
                misses = self.damping_misses(sequences.state, channel, every, widths, counts)
                price = acts(channel, widths).on_time * channel.cost_rate(by_propellant=True)
                total = np.where(complies(misses), cost[:, None] + price * counts, np.inf)
                totals = np.minimum(totals, total.min(axis=1, initial=np.inf))
            able = order[np.isfinite(totals[order])]
            cheapest = first_of_each(able, np.round(totals, 12), kind)
            rows.append(cheapest[np.argsort(totals[cheapest], kind="stable")][: 2 * BEAM])
        return np.unique(np.concatenate(rows))

    # --- the kernel

    def behind(
        self,
        before: BlockSequences,
        kind: int,
        pairs: tuple[Index, Array, Index],
        waits: Index,
        *,
        last: bool,
        delays: Array | None = None,
    ) -> Iterator[BlockSequences]:
        """Blocks of ``pairs`` behind the rows ``before``, after ``waits``: of each pair the best
        two, or in whole searches all that may be of use.

        ``delays`` s: default those that serve best.
        """
        channel, every = self.kinds[kind]
        size = len(waits) * (self.last_delay + 1 if self.whole else 4)
        step = max(CHUNK // size, 1)
        for begin in range(0, len(pairs[0]), step):
            rows, width, count = (part[begin : begin + step] for part in pairs)
            state = before.state.some(rows).shaped()
            trial = Trial(waits[:, None], 0.0, width[:, None, None], count[:, None, None], every)
            best = self.delays(state, channel, trial) if delays is None else delays
            trial = trial._replace(delay=best)
            after = self.model.after(state, channel, trial)
            residual = self.model.left(after)
            share = self.flights.share(residual)
            shape = np.broadcast_shapes((len(rows), len(waits), 1), np.shape(share))
            work.spend(LOOKED * math.prod(shape))
            if not self.whole:
                self.looked += math.prod(shape)
            share = np.where(self._barred(state, channel, trial, after), np.inf, share)
            share = np.where(np.isnan(share), np.inf, share)
            table = np.broadcast_to(share, shape).reshape(len(rows), -1)
            if self.whole and not last:
                pair, rest = np.nonzero(np.isfinite(table))
            elif self.whole:
                nearest = least(table.reshape(1, -1), 8 * FLOWN)
                use = table <= DOUBTFUL
                use.ravel()[nearest] = True
                pair, rest = np.nonzero(use & np.isfinite(table))
            else:
                rest = least(table, 2 if last or delays is None else table.shape[1])
                # Of those that comply alike the first to end, too.
                ends = np.broadcast_to(after.sun_pulse, shape).reshape(len(rows), -1)
                soonest = np.where(complies(table), ends, np.inf).argmin(axis=1)
                rest = np.concatenate([rest, soonest[:, None]], axis=1)
                pair = np.repeat(np.arange(len(rows)), rest.size // len(rows))
                rest = rest.ravel()
                finite = np.isfinite(table[pair, rest])
                pair, rest = pair[finite], rest[finite]
            at: tuple[Index, ...] = (pair, rest // shape[2], rest % shape[2])

            def picked(values: object, at: Any = at, shape: Any = shape) -> Array:
                return np.asarray(np.broadcast_to(np.asarray(values), shape)[at])

            blocks = before.blocks[rows[pair]]
            first = np.ones(len(pair))
            if blocks.shape[1]:
                intervals = np.array([interval for _, interval in self.kinds])
                number = blocks[:, -1, 0].astype(int)
                first = blocks[:, -1, 1] + (blocks[:, -1, 4] - 1) * intervals[number] + 1
            block = [
                np.full(len(pair), kind),
                first + picked(trial.wait),
                np.round(picked(trial.delay), 12),
                np.round(picked(trial.width), 12),
                picked(trial.count),
            ]
            blocks = np.concatenate([blocks, np.column_stack(block)[:, None]], axis=1)
            yield BlockSequences(blocks, table[pair, rest], after.map(picked))

    def _barred(
        self, state: BlockState, channel: Channel, trial: Trial, after: BlockState
    ) -> NDArray[np.bool_]:
        """True for blocks that may not be, or cost more than a flight that complies."""
        barred = np.asarray(after.sun_pulse > self.spacecraft.horizon + self.model.turn)
        barred = barred | (after.cost >= self.flights.cheapest * (1.0 - SAME_COST))
        if self.spacecraft.goal.axis is not None:
            # H has gone round the Sun the longer way to the target, or once more.
            way = after.longitude - state.longitude - self.model.ahead(state)
            barred = barred | (np.abs(way) > math.pi)
        if self.spacecraft.tank is not None:
            barred = barred | (after.used > self.spacecraft.tank.propellant)
        turn = self.model.turn
        first = state.sun_pulse + trial.wait * turn
        interval = (after.sun_pulse - turn - first) / np.maximum(trial.count - 1, 1)
        interval = np.where(np.asarray(trial.count) > 1, interval, turn)
        aside = BESIDE * turn
        lasts = acts(channel, trial.width).over
        for begins, ends in zip(*self.dark, strict=True):
            low = np.ceil((begins - aside - lasts - first - trial.delay) / interval)
            high = np.floor((ends + aside - first - trial.delay) / interval)
            barred = barred | (np.maximum(low, 0.0) <= np.minimum(high, trial.count - 1))
        return np.asarray(barred)

    def counts(self, state: BlockState, every: int) -> Index:
        """Numbers of pulses up to the horizon."""
        time = self.spacecraft.horizon - float(np.min(state.sun_pulse))
        most = max(min(int(time / (every * self.model.turn)) + 1, self.allowed), 0)
        if most > SOME_COUNTS:
            return np.unique(np.geomspace(1, most, SOME_COUNTS).round().astype(int))
        return np.arange(1, most + 1)

    def waits(self, state: BlockState, earliest: int) -> Index:
        """Sun pulses that may be let pass before a block: the ``earliest`` few, and those up to the
        end of a blackout; in whole searches all.
        """
        since = float(np.min(state.sun_pulse))
        if self.whole:
            turns = int((self.spacecraft.horizon - since) / self.model.turn) + 1
            return np.arange(earliest, max(turns, earliest) + 1)
        few = WAITS
        if not np.any(state.phasor):
            few = 1
        elif self.flights.damps and Part.SHIFT not in self.limit:
            few = WAITS // 3  # delays alone meet the phase of the nutation, H may end anywhere
        after = np.floor((self.dark[1] - since) / self.model.turn)
        later = (after > earliest) & (self.dark[1] < self.spacecraft.horizon)
        ends = after[later][:WINDOWS].astype(int)
        waits = [
            np.arange(earliest, earliest + few),
            *(np.arange(end, end + few + 1) for end in ends),
        ]
        return np.unique(np.concatenate(waits))

    def delays(self, state: BlockState, channel: Channel, trial: Trial) -> Array:
        """Delays that can be commanded: all where few, else those that serve the heading best, and
        the nutation best.
        """
        if self.last_delay < FEW_DELAYS:
            return self.commanded(np.arange(self.last_delay + 1.0) * self.commands.delay_step)
        best = list[Array]()
        if self.spacecraft.goal.axis is not None:
            ahead = self.model.delay(channel, self.model.course(state)[0], trial.width)
            turn = 2.0 * math.pi / abs(self.spacecraft.spin)
            best.append((ahead - self.model.late(state, trial)) % turn)
        if np.any(state.phasor):
            best.append(self.model.damping_delay(state, channel, trial))
        if not best:  # just before a Sun pulse
            return np.zeros((1, 1, 1))
        step = self.commands.delay_step
        steps = np.broadcast_arrays(*(np.floor(delay / step) + AROUND for delay in best))
        return self.commanded(np.concatenate(steps, axis=-1) * step)

    def commanded(self, delay: Array) -> Array:
        """The nearest delay that can be commanded, of those within a spin turn."""
        step = self.commands.delay_step
        steps = np.clip(np.rint(delay / step), 0, self.last_delay)
        return np.asarray((steps + 0.0) * step)  # 0, not -0

    def misses(
        self, state: BlockState, channel: Channel, every: int, width: Array, count: Index
    ) -> Array:
        """Least miss (k, n) of n blocks after each of k motions, in shares of its bound.

        Of the spin where it is to change; with a target of the length of the rhumb line, of which a
        block ends no nearer than a third of the difference; else of the nutation.
        """
        if self.flights.damps:
            return self.damping_misses(state, channel, every, width, count)
        shaped = state.shaped(1)
        if self.spacecraft.goal.spin is not None:
            gained = channel.axial * acts(channel, width).on_time * count / self.model.inertia.C
            change = self.spacecraft.goal.spin - shaped.spin - gained
            misses = np.abs(change) / self.limit[Part.SPIN]
        else:
            full, _ = self.model.full_pulses(shaped, channel, width, count)
            length = full * self.model.turned_by(channel, width, self.spacecraft.spin)
            misses = np.abs(length - self.model.course(shaped)[1]) / self.limit[Part.DISTANCE]
            misses = misses / 3.0
        return np.asarray(misses).reshape(-1, len(width))

    def damping_misses(
        self, state: BlockState, channel: Channel, every: int, width: Array, count: Index
    ) -> Array:
        """Nutation (k, n) beyond what n blocks take at most, or what they add, as in `misses`."""
        shaped = state.shaped(1)
        step = self.model.rate(self.spacecraft.spin) * self.model.turn
        trial = Trial(0, 0.0, width, count, every)
        kicks = np.abs(self.model.kicks(shaped, channel, trial, every * step))
        remains = np.abs(np.abs(shaped.phasor) - abs(channel.transverse) * kicks)
        share = remains / abs(self.spacecraft.axial) / self.limit.get(Part.NUTATION, math.inf)
        return np.asarray(share).reshape(-1, len(width))

    # --- flights

    def fly(self, sequences: BlockSequences) -> None:
        """Fly what is promising, batch by batch, as long as it may cost less than what complies:
        where the search is whole all that may comply, the cheapest first.

        Nutation on the way goes with what one pulse turns H by: where all those miss, the gentlest
        of many may not. Where the closed form errs by much, the cheapest that comply are far
        behind.
        """
        share, cost = sequences.share, sequences.cost
        doubtful = np.lexsort((share, cost, share > DOUBTFUL))
        some = int(np.sum(share <= DOUBTFUL))
        if self.whole:
            order = doubtful[: max(some, 8 * FLOWN)]
        else:
            kind, _, _, width, _ = sequences.blocks[:, -1].T
            strengths = np.array([abs(channel.transverse) for channel, _ in self.kinds])
            largest = strengths[kind.astype(int)] * width
            clear = np.argsort(share, kind="stable")
            gentle = clear[: 8 * FLOWN]
            gentle = gentle[np.argsort(largest[gentle], kind="stable")]
            ranked = sequences.ranked
            mixed = np.array([each[:FLOWN] for each in (ranked, clear, gentle, doubtful)]).T.ravel()
            rest = doubtful[FLOWN : min(BATCHES * FLOWN, some)]
            order = np.concatenate([ranked[:8], clear[:4], mixed, rest])
            order = order[np.sort(np.unique(order, return_index=True)[1])]
        begin = 0
        # A few at first: those of the others that cost more than one that complies are not flown.
        size = 8 * FLOWN if self.whole else FIRST
        while begin < len(order) and not (begin and work.exhausted()):
            batch = order[begin : begin + size]
            batch = batch[cost[batch] < self.flights.cheapest * (1.0 - SAME_COST)]
            if len(batch):
                self._fly(sequences, batch)
            elif self.whole:
                break
            begin += size
            size = 2 * FLOWN

    def _fly(self, sequences: BlockSequences, rows: Index) -> Index:
        """Fly rows, and return those that were: the first ones, if all have too many pulses."""
        pulses = np.cumsum(sequences.blocks[rows, :, 4].sum(axis=1))
        rows = rows[(pulses <= FLOWN_PULSES) | (np.arange(len(rows)) < 8)]
        flown = self.blocks(sequences, rows)
        for blocks, row in zip(flown, rows.tolist(), strict=True):
            self.rows[blocks] = sequences.state.some([row])
        self.flights.fly(flown)
        return rows

    def blocks(self, sequences: BlockSequences, rows: Index) -> list[Blocks]:
        """Blocks of rows."""
        found = list[Blocks]()
        for row in sequences.blocks[rows].tolist():
            blocks = list[Block]()
            for kind, first, delay, width, count in row:
                channel, every = self.kinds[int(kind)]
                every = every if count > 1 else self.commands.every[0]
                delay, angle = self.commands.after_sun_pulse(delay, self.spacecraft.spin)
                blocks.append(
                    Block(channel.name, int(first), delay, width, int(count), every, angle)
                )
            found.append(tuple(blocks))
        return found
