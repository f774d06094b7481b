"""Search over command blocks: a beam in closed form, and flights in batches.

Block after block, each sequence of the beam is continued by blocks of every channel and interval:
pairs of width and number of pulses by their merits, after some waits, at the delays next to the two
that serve best: one for the heading of H, one for the nutation. `BlockModel` gives the motion of
all of them at once. The most promising are flown together from the Sun pulses of the nutating body.
Grids of up to `WHOLE` sequences are searched whole: of these no pair, wait or delay is left out but
what surely misses, or costs more than a flight that complies.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
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
    front,
    grid_size,
    joined,
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
        self.rows = dict[Blocks, tuple[BlockSequences, int]]()  # of those that are flown
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
        row = np.zeros(1, dtype=np.intp)
        state = self.model.start.some(row)
        return BlockSequences(
            None, row, row, row + 1, row + 0.0, row + 0.0, row, row + math.inf, state
        )

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
        first = before.before is None
        earliest = self.earliest if first else self.pause
        parts = list[BlockSequences]()
        for rows in self._groups(before.state):
            if work.exhausted() and parts:
                break
            group = before.some(rows)
            for kind in range(len(self.kinds)):
                pairs = self.pairs(group, kind, first=first, last=last)
                waits = self.waits(group.state, earliest)
                pairs = rows[pairs[0]], *pairs[1:]
                parts += self.behind(before, kind, pairs, waits, last=last)
                if self.flights.damps and not (last or self.whole):
                    cheap = np.flatnonzero(pairs[2] <= 2)
                    cheap = cheap[np.argsort(pairs[1][cheap] * pairs[2][cheap], kind="stable")]
                    cheap = cheap[:PHASED]
                    some = pairs[0][cheap], pairs[1][cheap], pairs[2][cheap]
                    steps = np.linspace(0.0, self.last_delay, PHASES) * self.commands.delay_step
                    delays = self.commanded(steps)
                    early = waits[: WAITS // 3]
                    parts += self.behind(before, kind, some, early, last=last, delays=delays)
        return joined(before, parts)

    def _groups(self, state: BlockState) -> list[Index]:
        """Rows that are continued together: after as much propellant, and waits of their own
        where there are blackouts.
        """
        rows = np.arange(len(state.sun_pulse))
        if len(self.dark[0]) > 0 and not self.whole:
            return list(rows[:, None])
        if self.model.steady or not len(rows):
            return [rows]
        supplies = np.array([state.used, *state.fired.values()])
        _, group = np.unique(supplies, axis=1, return_inverse=True)
        group = group.ravel()
        return [np.flatnonzero(group == number) for number in range(int(group.max()) + 1)]

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
        flights = [self.flights.of.get(self.blocks(sequences, int(row))) for row in rows]
        rows = rows[[flight is not None for flight in flights]]
        beam = sequences.some(rows)
        if not len(rows):
            return beam
        ends = np.array([flight.end for flight in flights if flight is not None]).T
        return replace(beam, state=beam.state.shifted(self.model.apart(beam.state, ends)))

    def promising(self, sequences: BlockSequences) -> Index:
        """Rows that are continued: the best of each width, number and interval, those that leave
        least for their cost, and the gentle.
        """
        order = sequences.ranked
        order = order[sequences.cost[order] < self.flights.cheapest]
        kinds = np.array([sequences.width, sequences.count, sequences.kind % self.intervals])
        _, index = np.unique(kinds[:, order].T, axis=0, return_index=True)
        distinct = order[np.sort(index)]
        gentle = distinct[sequences.count[distinct] <= GENTLE]
        costs = sequences.cost[distinct]
        fronts = [distinct[front(costs, share)[:BEAM]] for share in (0.9, 1.0)]
        rows = (distinct[:BEAM], *fronts, gentle[:BEAM])
        spread = self._spread(sequences, order if self.flights.damps else distinct)
        cheap = order[np.argsort(sequences.cost[order], kind="stable")]
        cheap = cheap[: COARSE if self.coarse else 0]
        return np.unique(np.concatenate([*rows, spread, cheap]))

    def _spread(self, sequences: BlockSequences, order: Index) -> Index:
        """Of rows in order the best that have gone each of equal parts of the way to the target, or
        those of which one gentle block more may be the cheapest that do.
        """
        state = sequences.state.some(order)
        if not self.flights.damps:
            if self.spacecraft.goal.axis is None or not len(order):
                return order[:0]
            way = self.model.course(state)[1]
            part = np.floor(BEAM * way / max(float(np.max(way, initial=0.0)), 1e-300))
            _, index = np.unique(part, return_index=True)
            return np.asarray(order[index])
        totals = np.full(len(order), np.inf)
        for kind, (channel, every) in enumerate(self.kinds):
            width = np.repeat(self.widths[kind], GENTLE)
            count = np.tile(np.arange(1, GENTLE + 1), len(self.widths[kind]))
            misses = self.damping_misses(state, channel, every, width, count)
            spent = acts(channel, width).on_time * count * channel.cost_rate(by_propellant=True)
            total = np.where(complies(misses), state.cost[:, None] + spent, np.inf)
            totals = np.minimum(totals, total.min(axis=1, initial=np.inf))
        both = np.array([np.round(totals, 12), sequences.kind[order]])
        _, index = np.unique(both, axis=1, return_index=True)
        index = index[np.isfinite(totals[index])][: 2 * BEAM]
        return np.asarray(order[index])

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
                first = np.where(complies(table), ends, np.inf).argmin(axis=1)
                rest = np.concatenate([rest, first[:, None]], axis=1)
                pair = np.repeat(np.arange(len(rows)), rest.size // len(rows))
                rest = rest.ravel()
                finite = np.isfinite(table[pair, rest])
                pair, rest = pair[finite], rest[finite]
            at: tuple[Index, ...] = (pair, rest // shape[2], rest % shape[2])

            def picked(values: object, at: Any = at, shape: Any = shape) -> Array:
                return np.asarray(np.broadcast_to(np.asarray(values), shape)[at])

            parent = rows[pair]
            wait = picked(trial.wait)
            yield BlockSequences(
                before,
                parent,
                np.full(len(pair), kind),
                self._following(before, parent) + wait,
                np.round(picked(trial.delay), 12),
                np.round(picked(trial.width), 12),
                picked(trial.count),
                table[pair, rest],
                after.map(picked),
            )

    def _following(self, before: BlockSequences, rows: Index) -> Index:
        """Number of the first Sun pulse after sequences."""
        every = np.array([every for _, every in self.kinds])[before.kind[rows]]
        count = before.count[rows]
        passed = np.where(count > 0, (count - 1) * every + 1, 0)
        return np.asarray(before.first[rows] + passed)

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
            largest = np.zeros(len(share))
            for kind, (channel, _) in enumerate(self.kinds):
                rows = np.flatnonzero(sequences.kind == kind)
                turns = self.model.turned_by(channel, sequences.width[rows], self.spacecraft.spin)
                largest[rows] = turns
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
        pulses = np.cumsum(sequences.pulses(rows))
        rows = rows[(pulses <= FLOWN_PULSES) | (np.arange(len(rows)) < 8)]
        blocks = [self.blocks(sequences, int(row)) for row in rows]
        for each, row in zip(blocks, rows.tolist(), strict=True):
            self.rows[each] = sequences, row
        self.flights.fly(blocks, sequences.cost[rows].tolist())
        return rows

    def blocks(self, sequences: BlockSequences, row: int) -> Blocks:
        """Blocks of a row."""
        if sequences.before is None:
            return ()
        channel, every = self.kinds[int(sequences.kind[row])]
        count = int(sequences.count[row])
        delay = float(sequences.delay[row])
        delay, angle = self.commands.after_sun_pulse(delay, self.spacecraft.spin)
        block = Block(
            channel.name,
            int(sequences.first[row]),
            delay,
            float(sequences.width[row]),
            count,
            every if count > 1 else self.commands.every[0],
            angle,
        )
        return (*self.blocks(sequences.before, int(sequences.parent[row])), block)
