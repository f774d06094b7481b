"""Search over command blocks in closed form, and the flights of the best.

Every block of one channel, width, number of pulses and interval is looked at in closed form
(`block_model`), at the delays next to the two that serve best: one for the heading of H, one for
the nutation. Second and third blocks are looked for behind the most promising. The best dozen are
flown from the Sun pulses of the nutating body.
"""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import fields
from heapq import nsmallest
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.flight.end_state import left_by
from nutdamp.schemes.block_model import BlockModel, BlockState, Trial, acts, evenly, fire_all
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import Windows, commandable_widths, keeps_limits
from nutdamp.spacecraft.equipment import Block, Channel, Commands
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import SAME_COST, Left, Part, complies
from nutdamp.spacecraft.schedule import Schedule

GENTLE = (
    10  # multiple of `FLOWN`: sequences among which those with the smallest pulses are flown too
)
# blocks after one wait up to which all are looked at, and the cheapest of them behind which others
# are
ALL_BLOCKS = 400
ALL_FIRSTS = 300
LONGEST = 5000  # pulses of a block, at most: more would take the whole budget of work to fire
SOME_COUNTS = 256  # numbers of pulses that are looked at, where a block may have more
FEW_DELAYS = 16  # delays, up to which each is looked at
AROUND = (0, 1)  # steps of the delay that are looked at, from the one below the best delay
MOST_WIDTHS = (
    24  # widths that are looked at for a second and a third block, where more can be commanded
)
# share of a spin turn by which blocks in closed form keep away from blackout windows: nutation
# moves Sun pulses
BESIDE = 0.01
CHEAPER = (
    0.9  # multiple of the cost of a sequence below which one that leaves more is looked at, too
)
# multiple of the least cost of lowering the nutation above which further blocks are looked for
# though one complies
DEAR = 1.5
CORRECTED = 4  # flights whose neighbours are looked at where none complies
SURELY = (
    3.0  # largest difference of a block's length from the way to the target, over its end error
)
TOGETHER = 32  # sequences behind which others are looked for at once

Array = NDArray[np.float64]

WAITS = 24  # Sun pulses that may pass before a block, so that its nutation meets the one before
# blackout windows after which a block is begun, or before which one ends, at most: the first ones
WINDOWS = 8

FIRST = 24
"""First blocks behind which others are looked for: so many of the best, of small ones, and of parts
of the way.
"""

BLOCKS = 3  # blocks of a schedule, at most

DOUBTFUL, DOUBTS = 1.5, 100
"""Share of a bound up to which the closed form may err, and sequences flown since that would make
them good.
"""

ALIKE = 4  # sequences that may come with the same blocks, over those that are wanted

CLOSEST, FEW = 24, 4
"""Widths and numbers of later blocks that are looked at, by each of their merits, and pulses that
count as few.
"""

LOOKED = 2e-6  # units of `work` of a block that is looked at

Blocks = tuple[Block, ...]

FLOWN = 12  # sequences of blocks that are flown; as many more where none of them complies
DEARER = (
    1.01  # multiple of the cost of a sequence that complied in a flight from which on none is flown
)


class BlockSequence(NamedTuple):
    """Blocks, and their rank in closed form, the less, the better: the share of a bound, 0 where
    all are kept, then the cost, then the time of the end; and the ``share``.
    """

    blocks: Blocks
    rank: tuple[float, float, float]
    share: float = math.inf


class FlownSequence(NamedTuple):
    """Flight of a sequence; ``rank``: breaks a limit, share of a bound that is passed, cost, end in
    s.
    """

    rank: tuple[bool, float, float, float]
    schedule: Schedule
    sequence: BlockSequence


START = BlockSequence((), (math.inf, math.inf, math.inf))  # no blocks, before which all others come


class BlockFlights:
    """Flights of sequences of one spacecraft: ``of`` each, and the least cost that is ``known`` to
    comply.

    ``bounds``: what they are judged by; ``damps``: where the nutation alone is to be lowered.
    """

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.spacecraft = spacecraft
        self.known = math.inf
        self.damps = spacecraft.goal.axis is None and spacecraft.goal.spin is None
        lower = (
            0.98 * spacecraft.nutation if self.damps else math.inf
        )  # blocks without a goal are to lower it
        self.bounds = []
        for bound in requirements.bounds(spacecraft):
            if bound.part is Part.NUTATION:
                bound = bound._replace(limit=min(bound.limit, lower))
            elif bound.part is Part.SPIN:
                bound = bound._replace(limit=requirements.AIMED_SPIN * bound.limit)
            self.bounds.append(bound)
        self.of: dict[Blocks, FlownSequence] = {}
        self._fired: dict[Blocks, Schedule | Infeasible] = {}

    def share(self, left: Left) -> NDArray[np.float64]:
        """Largest share of a bound that is ``left``: 1 or less keeps all."""
        return np.asarray(np.max(np.broadcast_arrays(*self.shares(left).values()), axis=0))

    def shares(self, left: Left) -> dict[Part, NDArray[np.float64]]:
        """Share of each bound that is ``left``."""
        left_of, spacecraft = requirements.left_of, self.spacecraft
        return {
            bound.part: np.asarray(bound.used(left_of(bound, left, spacecraft)))
            for bound in self.bounds
        }

    def fired(self, sequences: Sequence[BlockSequence]) -> Iterator[BlockSequence]:
        """The sequences that cost no more than one that complied in a flight; a dozen of them are
        fired together.
        """
        for begin in range(0, len(sequences), FLOWN):
            some = [
                each
                for each in sequences[begin : begin + FLOWN]
                if each.rank[1] <= self.known * DEARER
            ]
            new = [sequence.blocks for sequence in some if sequence.blocks not in self._fired]
            if new:
                self._fired.update(zip(new, self._together(new), strict=True))
            yield from (each for each in some if each.rank[1] <= self.known * DEARER)

    def _together(self, some: Sequence[Blocks]) -> Sequence[Schedule | Infeasible]:
        """Pulses of sequences; one by one where the motion of one of them cannot be followed."""
        try:
            return fire_all(self.spacecraft, some)[0]
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
            share = float(self.share(left_by(propagation.flown(self.spacecraft, schedule))))
            missed = (
                0.0 if complies(share) else float(f"{share:.9g}")
            )  # rounding is no reason to wait for a Sun pulse
            rank = not keeps_limits(self.spacecraft, schedule), missed, schedule.cost, schedule.end
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
    """The first sequence of each kind, by the fields of its blocks that are named; default channel
    and interval.
    """
    kinds: dict[tuple[object, ...], BlockSequence] = {}
    fields = operator.attrgetter(*(names or ("channel", "every")))
    for sequence in ranked:
        kinds.setdefault(tuple(map(fields, sequence.blocks)), sequence)
    return list(kinds.values())


class BlockSearch:
    """The command blocks of one spacecraft and their ranking in closed form."""

    def __init__(
        self, spacecraft: Spacecraft, channels: Sequence[Channel], commands: Commands
    ) -> None:
        self.spacecraft, self.channels, self.commands = spacecraft, channels, commands
        self.model = BlockModel(spacecraft)
        self.flights = BlockFlights(spacecraft)
        self._most = {bound.part: bound.limit for bound in self.flights.bounds}
        self._named = {channel.name: channel for channel in channels}
        self.looked = 0
        self.most = math.inf  # what a sequence may cost
        self._states: dict[Blocks, BlockState] = {(): self.model.start}
        self.doubtful: list[
            BlockSequence
        ] = []  # those that may comply in a flight, the cheapest first
        limits, turn, step = spacecraft.limits, self.model.turn, commands.delay_step
        self.allowed = min(commands.max_count, LONGEST, limits.max_pulses or LONGEST)
        self.pause = math.ceil(limits.gap / turn)
        self.dark = Windows(spacecraft).dark
        self.earliest = max(math.ceil((limits.earliest - self.model.start.sun_pulse) / turn), 0)
        # Where the nutation alone is to be lowered, and H may end anywhere, delays alone meet
        # phases: fewer waits do.
        self._damps = self.flights.damps
        self._waiting = WAITS // 3 if self._damps and Part.SHIFT not in self._most else WAITS
        self._every = [
            every
            for every in commands.every
            if every * turn >= limits.gap + float(commands.widths[0])
        ]
        self._kinds = list(itertools.product(channels, self._every))
        last_delay = math.floor(min(commands.delay_max, turn) / step * (1.0 + 1e-12))
        self._last_delay = last_delay
        self._few_delays = last_delay < FEW_DELAYS
        few = min(last_delay + 1, FEW_DELAYS)
        self._delays = np.asarray(
            np.arange(few) * step, dtype=np.float64
        )  # all that can be commanded, where few
        widths = sum(len(commandable_widths(commands, channel)) for channel in channels)
        # So few blocks after one wait that all are looked at.
        self.small = self._few_delays and widths * few * self.allowed <= ALL_BLOCKS

    def best(self, most: int) -> list[BlockSequence]:
        """The best few sequences of up to ``most`` blocks, those that are flown."""
        sequences = self._single()
        firsts: list[BlockSequence] = []
        for number in range(2, most + 1):
            complying = (sequence for sequence in sequences if sequence.rank[0] <= 0.0)
            cheapest = by_blocks(nsmallest(ALIKE * DOUBTS, complying, key=_rank))
            self.most = self._first_complying(list(cheapest.values()))
            if work.exhausted() or (self.most < math.inf and not (self.small or self._dear)):
                break
            if number == 2:
                small = self._further([START], few=2) if abs(self.model.start.phasor) > 0.0 else []
                firsts = [
                    *_promising(sequences, FIRST),
                    *_promising(small, FIRST),
                    *self._parts()[:FIRST],
                ]
                if self.small:  # the 300 cheapest of all
                    grid = self._grid(self.model.start, self.earliest)
                    every = self.behind([START], self.model.start, grid, ALL_FIRSTS)
                    firsts += sorted(every, key=lambda first: first.rank[1])[:ALL_FIRSTS]
            else:
                firsts = _promising(firsts, FIRST // 2)
            firsts = self._further([first for first in firsts if first.rank[1] < self.most], few=4)
            sequences += firsts
        self.most = math.inf
        unsure = (each for each in sequences if each.share <= DOUBTFUL)
        self.doubtful = list(
            by_blocks(nsmallest(ALIKE * DOUBTS, unsure, key=lambda each: each.rank[1:])).values()
        )
        # The flight differs a little, and the more the larger the nutation on the way: half of them
        # are the cheapest that comply, half those that do most clearly, and the best one of each
        # number of blocks is among them.
        ranked = [
            next(alike) for _, alike in itertools.groupby(sorted(sequences, key=_rank), _blocks)
        ]
        clear = nsmallest(GENTLE * FLOWN, ranked, key=_share)
        each = {len(sequence.blocks): sequence for sequence in reversed(ranked)}.values()
        first = by_blocks((*ranked[: FLOWN // 2], *clear[: FLOWN // 2], *each))
        # Nutation on the way goes with what one pulse turns H by: where all those miss, the
        # gentlest of many follow.
        gentle = sorted(clear, key=self._largest_pulse)
        more = by_blocks((*_front(ranked)[:FLOWN], *of_each_kind(ranked)[:FLOWN], *gentle))
        others = (sequence for blocks, sequence in more.items() if blocks not in first)
        return [*first.values(), *islice(others, 4 * FLOWN)]

    def _first_complying(self, sequences: Sequence[BlockSequence]) -> float:
        """Fly sequences until one complies, and return its cost, kg; infinite where none does."""
        for sequence in self.flights.fired(sequences[: DOUBTS if self.small else FLOWN]):
            if work.exhausted():
                break
            with suppress(Infeasible):
                if self.flights.flown(sequence).rank[:2] == (False, 0.0):
                    return sequence.rank[1]
        return math.inf

    @property
    def _dear(self) -> bool:
        """True where the nutation alone has to be lowered, and more blocks may cost much less than
        those that comply.

        The least is what kicks cost that all point against ω, or two pulses.
        """
        if self._waiting == WAITS:
            return False
        kicked = abs(self.model.start.phasor) - math.tan(self._most[Part.NUTATION]) * abs(
            self.spacecraft.axial
        )
        least = math.inf
        for channel in filter(lambda each: each.transverse, self.channels):
            shortest = float(
                acts(channel, commandable_widths(self.commands, channel)).on_time.min()
            )
            lasts = max(kicked / abs(channel.transverse), 2.0 * shortest)
            least = min(least, channel.cost_rate(by_propellant=True) * lasts)
        return self.most > DEAR * least

    def _largest_pulse(self, sequence: BlockSequence) -> float:
        """The most by which one of its pulses turns H, rad."""
        pulses = ((self._named[block.channel], block.width) for block in sequence.blocks)
        return max(float(self.model.turned_by(*pulse, self.spacecraft.spin)) for pulse in pulses)

    def state(self, blocks: Blocks) -> BlockState:
        """Motion after blocks, in closed form."""
        if blocks not in self._states:
            *before, last = blocks
            trial = Trial(
                last.first - _following(before), last.delay, last.width, last.count, last.every
            )
            self._states[blocks] = self.model.after(
                self.state(tuple(before)), self._named[last.channel], trial
            )
        return self._states[blocks]

    def _motions(self, before: Sequence[BlockSequence]) -> BlockState:
        """Motions after some sequences in one,
        with three more axes behind that of the sequences.
        """
        states = [self.state(sequence.blocks) for sequence in before]
        if len(states) == 1:
            return states[0]
        names = [field.name for field in fields(BlockState)][:-1]  # of numbers
        columns: dict[str, Any] = {
            name: np.array([getattr(state, name) for state in states]) for name in names
        }
        return BlockState(**{name: column[:, None, None, None] for name, column in columns.items()})

    def behind(
        self,
        before: Sequence[BlockSequence],
        state: BlockState,
        trials: Iterable[tuple[Channel, Trial]],
        few: int = FLOWN,
        off: BlockState | None = None,
    ) -> list[BlockSequence]:
        """The best of the ``trials`` of each channel, after the blocks ``before``, from their
        `_motions`, ``state``.

        The axes of trials are the sequences before, and three more: the best ``few`` are chosen
        along the last two. ``off``: by how much they end elsewhere than the closed form says.
        """
        following = np.array([_following(each.blocks) for each in before])
        sequences = list[BlockSequence]()
        for channel, trial in trials:
            after = self.model.after(state, channel, trial)
            left = self.model.left(after if off is None else after.shifted(off))
            shape = np.broadcast_shapes(
                (len(before), 1, 1, 1), *map(np.shape, (*trial, left.nutation))
            )
            self.looked += math.prod(shape)
            work.spend(LOOKED * math.prod(shape))
            share = self.flights.share(
                left
            )  # largest one of a bound; infinite for blocks that may not be
            over = np.asarray(after.sun_pulse) > self.spacecraft.horizon + self.model.turn
            over = over | self._dark(state, channel, trial, after)
            if (
                self.spacecraft.goal.axis is not None
            ):  # H has gone round the Sun the longer way to the target, or once more
                over = over | (
                    np.abs(after.longitude - state.longitude - self.model.ahead(state)) > math.pi
                )
            over = (
                over
                if self.spacecraft.tank is None
                else over | (after.used > self.spacecraft.tank.propellant)
            )
            share = np.where(over | np.isnan(share) | (after.cost >= self.most), np.inf, share)
            table = shape[0] * shape[1], shape[2] * shape[3]
            severity, cost = (
                np.broadcast_to(part, shape).reshape(table) for part in (share, after.cost)
            )
            doubted = np.where(severity <= DOUBTFUL, cost, np.inf)
            keys = (
                (_in_order(severity, cost), few),
                (severity, DOUBTS if self.small else few // 2),
                (doubted, DOUBTS if self.small else few),
            )
            index = np.unique(np.concatenate([_least_of_all(*key) for key in keys]))
            at = np.unravel_index(index, shape)
            wait, delay, width, count, every = (np.broadcast_to(part, shape)[at] for part in trial)
            every = np.where(count > 1, every, self.commands.every[0])
            share, ends = severity.ravel()[index], np.broadcast_to(after.sun_pulse, shape)[at]
            ranks = np.where(complies(share), 0.0, share), cost.ravel()[index], ends
            columns = (
                following[at[0]] + wait,
                np.round(delay, 12),
                np.round(width, 12),
                count,
                every,
            )
            lists = zip(
                *(column.tolist() for column in (at[0], share, *ranks, *columns)), strict=True
            )
            for parent, severe, failed, spent, end, *block in lists:
                blocks = (*before[parent].blocks, Block(channel.name, *block))
                sequences.append(BlockSequence(blocks, (failed, spent, end), severe))
        return sequences

    def _counts(self, state: BlockState, every: int) -> NDArray[np.int64]:
        """Numbers of pulses up to the horizon."""
        most = (
            int(
                (self.spacecraft.horizon - float(np.min(state.sun_pulse)))
                / (every * self.model.turn)
            )
            + 1
        )
        most = max(min(most, self.allowed), 0)
        if most > SOME_COUNTS:
            return np.unique(np.geomspace(1, most, SOME_COUNTS).round().astype(int))
        return np.arange(1, most + 1)

    def _single(self) -> list[BlockSequence]:
        """The best single blocks at the delays that serve best, without those that surely end worse
        by `_short_by`.
        """
        start = self.model.start
        waits = self._waits(start, self.earliest, self._waiting if abs(start.phasor) > 0.0 else 1)
        short = [
            (channel, every, self._short_by(start, channel, every))
            for channel, every in self._kinds
        ]
        most = max((lacks.max() for _, _, lacks in short if lacks.size), default=0.0)
        within = surely = DOUBTFUL if self._damps else SURELY
        while True:
            trials = (
                (
                    channel,
                    self._at_delays(
                        start, channel, waits, np.flatnonzero(lacks[0] <= within)[None], every
                    ),
                )
                for channel, every, lacks in short
                if np.any(lacks <= within)
            )
            sequences = sorted(self.behind([START], start, trials), key=_rank)
            enough = surely * max(sequences[0].rank[0], 1.0) if sequences else math.inf
            if enough <= within or within >= most or work.exhausted():
                return sequences
            within = min(enough, 10.0 * within, most)

    def _short_by(self, state: BlockState, channel: Channel, every: int) -> Array:
        """Least miss of blocks of each width and number, (k, w n) after each of k motions, in
        shares of its bound.

        Of the spin where it is to change; with a target of the length of the rhumb line, of which a
        block ends no nearer than a third of the difference; else of the nutation, lowered by the
        sum of their kicks at most.
        """
        widths = commandable_widths(self.commands, channel)[:, None]
        counts = self._counts(state, every)
        work.spend(LOOKED * widths.size * counts.size * np.size(state.phasor))
        if self._damps:
            return self._undamped(state, channel, every)
        if self.spacecraft.goal.spin is not None:
            gained = channel.axial * acts(channel, widths).on_time * counts / self.model.inertia.C
            lacks = np.abs(self.spacecraft.goal.spin - state.spin - gained) / self._most[Part.SPIN]
        else:
            full, _ = self.model.full_pulses(state, channel, widths, counts)
            length = full * self.model.turned_by(channel, widths, self.spacecraft.spin)
            lacks = np.abs(length - self.model.course(state)[1]) / self._most[Part.DISTANCE]
        return np.asarray(lacks).reshape(-1, len(widths) * len(counts))

    def _undamped(self, state: BlockState, channel: Channel, every: int) -> Array:
        """Nutation that is left at least, as in `_short_by`."""
        widths = commandable_widths(self.commands, channel)[:, None]
        counts = self._counts(state, every)
        trial = Trial(0, 0.0, widths, counts, every)
        step = self.model.rate(self.spacecraft.spin) * self.model.turn
        kicks = abs(channel.transverse) * np.abs(
            self.model.kicks(state, channel, trial, every * step)
        )
        left = np.abs(np.abs(state.phasor) - kicks) / abs(self.spacecraft.axial)
        return np.asarray(left / self._most.get(Part.NUTATION, math.inf)).reshape(
            -1, len(widths) * len(counts)
        )

    def _further(self, before: Sequence[BlockSequence], few: int) -> list[BlockSequence]:
        """Blocks behind those ``before`` that go the rest of the way, or take the nutation that is
        left.
        """
        step = TOGETHER if self.model.steady and not len(self.dark[0]) else 1
        least = self.pause if before and before[0].blocks else self.earliest
        sequences = list[BlockSequence]()
        for begin in range(0, len(before), step):
            some = before[begin : begin + step]
            state = self._motions(some)
            trials = self._grid(state, least) if self.small else self._rest(state, least)
            sequences += self.behind(some, state, trials, few)
        return sequences

    def _rest(self, state: BlockState, least: int) -> Iterator[tuple[Channel, Trial]]:
        """Blocks of the widths and numbers that may miss least, the cheapest and the nearest, and
        of few pulses.
        """
        waits = self._waits(state, least, self._waiting)
        for channel, every in self._kinds:
            lacks = self._short_by(state, channel, every)
            counts = self._counts(state, every)
            if not lacks.size:
                continue
            widths = commandable_widths(self.commands, channel)
            spent = np.multiply.outer(acts(channel, widths).on_time, counts).ravel()
            gentle = np.tile(counts <= FEW, len(widths))
            damping = np.where(
                gentle, lacks if self._damps else self._undamped(state, channel, every), np.inf
            )
            nearest = np.concatenate(
                [_least(_in_order(lacks, spent), CLOSEST), _least(lacks, CLOSEST)], axis=1
            )
            some = evenly(np.flatnonzero(gentle), CLOSEST if len(lacks) > 1 else FEW * CLOSEST)
            for index in (nearest, _least(damping, CLOSEST), some[None]):
                yield channel, self._at_delays(state, channel, waits, index, every)

    def _parts(self) -> list[BlockSequence]:
        """First blocks that go a part of the way to the target."""
        start = self.model.start
        sequences = list[BlockSequence]()
        heading, way = self.model.course(start)
        if self.spacecraft.goal.axis is None or not self._every:
            return sequences
        every, shares = self._every[0], np.linspace(0.0, 1.0, 13)[1:]
        for channel in (channel for channel in self.channels if channel.transverse):
            for width in evenly(commandable_widths(self.commands, channel), 3).tolist():
                step = float(self.model.turned_by(channel, width, start.spin))
                delay = self.commanded(self.model.delay(channel, heading, width))
                first = start.sun_pulse + float(delay) + float(acts(channel, width).over)
                fits = (self.dark[0][:WINDOWS] - first) / (
                    every * self.model.turn
                ) - self.earliest / every
                counts = np.rint(
                    [*shares * float(way) / step, *np.floor(fits), *np.floor(fits) + 1.0]
                )
                counts = np.unique(counts.clip(1, self.allowed).astype(int))
                rows = np.meshgrid(self._waits(start, self.earliest, 1), counts)
                wait, count = (row.reshape(-1, 1, 1) for row in rows)
                sequences += self.behind(
                    [START], start, [(channel, Trial(wait, delay, width, count, every))], 1
                )
        return sequences

    def _grid(self, state: BlockState, least: int) -> Iterator[tuple[Channel, Trial]]:
        """All blocks, from ``least`` Sun pulses on: by wait, width and number of pulses, and by
        delay.
        """
        for channel, every in self._kinds:
            widths = commandable_widths(self.commands, channel)
            counts = np.arange(1, self.allowed + 1)
            parts = np.meshgrid(self._waits(state, least, WAITS), widths, counts)
            wait, width, count = (part.reshape(-1, 1) for part in parts)
            yield channel, Trial(wait, self._delays, width, count, every)

    def _waits(self, state: BlockState, least: int, few: int) -> list[int]:
        """Sun pulses that may be let pass before a block: the ``least`` few, and those up to the
        end of a blackout.
        """
        after = np.floor((self.dark[1] - np.min(state.sun_pulse)) / self.model.turn)
        later = (
            after[(after > least) & (self.dark[1] < self.spacecraft.horizon)][:WINDOWS]
            .astype(int)
            .tolist()
        )
        return sorted(
            {begin + more for begin in (least, *later) for more in range(few + (begin != least))}
        )

    def _dark(
        self, state: BlockState, channel: Channel, trial: Trial, after: BlockState
    ) -> NDArray[np.bool_]:
        """True where a pulse of the blocks is on in a blackout window, or just beside it."""
        dark = np.zeros(np.shape(after.sun_pulse), dtype=bool)
        if not len(self.dark[0]):
            return dark
        work.spend(LOOKED * dark.size * len(self.dark[0]))
        turn = self.model.turn
        first = state.sun_pulse + trial.wait * turn
        interval = (after.sun_pulse - turn - first) / np.maximum(trial.count - 1, 1)
        interval = np.where(np.asarray(trial.count) > 1, interval, turn)
        # aside: nutation moves Sun pulses
        aside = BESIDE * turn
        lasts = acts(channel, trial.width).over
        for begins, ends in zip(*self.dark, strict=True):
            low = np.ceil((begins - aside - lasts - first - trial.delay) / interval)
            high = np.floor((ends + aside - first - trial.delay) / interval)
            dark |= np.maximum(low, 0.0) <= np.minimum(high, trial.count - 1)
        return dark

    def _at_delays(
        self,
        state: BlockState,
        channel: Channel,
        waits: Sequence[int],
        index: NDArray[np.intp],
        every: int,
    ) -> Trial:
        """Blocks after each of the ``waits`` at the delays that serve the heading best, and the
        nutation best.

        ``index`` (k, m): widths and numbers as in `_short_by`, for each of k motions.
        """
        counts = self._counts(state, every)
        widths = commandable_widths(self.commands, channel)[index // len(counts)][:, None, :, None]
        wait, count = np.array(waits)[:, None, None], counts[index % len(counts)][:, None, :, None]
        trial = Trial(wait, self._delays, widths, count, every)
        if self._few_delays:
            return trial
        best = list[Array]()
        if self.spacecraft.goal.axis is not None:
            best.append(self.model.delay(channel, self.model.course(state)[0], widths))
        if np.any(state.phasor):
            best.append(self.model.damping_delay(state, channel, trial._replace(delay=0.0)))
        steps = [
            np.floor(delay / self.commands.delay_step) + more for delay in best for more in AROUND
        ]
        alike = np.broadcast_arrays(
            *steps, np.zeros((1, 1, 1, 1))
        )  # none at all: best just before a Sun pulse
        return trial._replace(
            delay=self.commanded(np.concatenate(alike, axis=-1) * self.commands.delay_step)
        )

    def commanded(self, delay: Array) -> Array:
        """The nearest delay that can be commanded, of those within a spin turn."""
        step = self.commands.delay_step
        counts = np.clip(np.rint(delay / step), 0, self._last_delay)
        return np.asarray((counts + 0.0) * step)  # 0, not -0

    def doubted(self) -> None:
        """Fly sequences cheaper than the best of the flights, the cheapest first, until one
        complies.
        """
        most = self.flights.known * (1.0 - SAME_COST)
        flown = self.flights.of
        self._first_complying(
            [each for each in self.doubtful if each.rank[1] < most and each.blocks not in flown]
        )

    def nearer(self) -> list[BlockSequence]:
        """Neighbours of the best of the flights that leave least where the closed form errs as it
        does for those.
        """
        sequences = list[BlockSequence]()
        best = of_each_kind(flight.sequence for flight in self.flights.all)
        for flight in (self.flights.of[each.blocks] for each in best[:CORRECTED]):
            *earlier, last = flight.sequence.blocks
            before = START._replace(blocks=tuple(earlier))
            state = self.state(tuple(earlier))
            off = self.model.apart(
                self.state(flight.sequence.blocks),
                propagation.flown(self.spacecraft, flight.schedule),
            )
            trials = [(self._named[last.channel], self._around(before, last))]
            sequences += self.behind([before], state, trials, off=off)
        other = (sequence for sequence in sequences if sequence.blocks not in self.flights.of)
        ranked = by_blocks(sorted(other, key=_rank))
        clear = nsmallest(FLOWN // 2, ranked.values(), key=_share)
        first = islice(ranked.values(), FLOWN // 2)
        chosen = by_blocks((*first, *clear, *of_each_kind(ranked.values())))
        for blocks, sequence in chosen.items():  # ranked by the closed form alone
            share = float(self.flights.share(self.model.left(self.state(blocks))))
            missed = 0.0 if complies(share) else share
            chosen[blocks] = sequence._replace(rank=(missed, *sequence.rank[1:]), share=share)
        return list(chosen.values())

    def _around(self, before: BlockSequence, last: Block) -> Trial:
        """Blocks about as long and as late as the ``last`` one, behind those ``before``."""
        channel = self._named[last.channel]
        number = _following(before.blocks)
        every = commandable_widths(self.commands, channel)
        at = int(np.argmin(np.abs(every - last.width)))
        near = every[max(at - 3, 0)] - 1e-12, every[min(at + 3, len(every) - 1)] + 1e-12
        closer = commandable_widths(self.commands, channel, *near, count=MOST_WIDTHS)
        widths = np.union1d(evenly(every, MOST_WIDTHS), closer)
        as_long = np.rint(
            last.count
            * acts(channel, np.array([last.width])).on_time
            / acts(channel, widths).on_time
        )
        waits = np.arange(-1, 2) + (last.first - number)
        waits = waits[waits >= (self.pause if before.blocks else self.earliest)]
        delays = self.commanded(
            np.asarray(last.delay + np.arange(-3, 4) * self.commands.delay_step, dtype=np.float64)
        )
        counts = (as_long[:, None] + np.arange(-2, 3)).clip(1, self.allowed).astype(int)
        parts = np.broadcast_arrays(waits[:, None, None], widths[:, None], counts)
        wait, width, count = (part.reshape(-1, 1) for part in parts)
        return Trial(wait, delays, width, count, last.every)


_rank, _share, _blocks = map(operator.attrgetter, ("rank", "share", "blocks"))


def _following(blocks: Sequence[Block]) -> int:
    """Number of the first Sun pulse after blocks."""
    return blocks[-1].sun_pulses[-1] + 1 if blocks else 1


def _least(keys: Array, most: int) -> NDArray[np.intp]:
    """Indices of the ``most`` least keys of each row, in any order."""
    rows, count = keys.shape
    if most >= count:
        return np.tile(np.arange(count), (rows, 1))
    return np.asarray(np.argpartition(keys, most - 1, axis=1)[:, :most])


def _least_of_all(keys: Array, most: int) -> NDArray[np.intp]:
    """Indices into all keys of the ``most`` least of each row, but for infinite ones."""
    index = (_least(keys, most) + keys.shape[1] * np.arange(len(keys))[:, None]).ravel()
    return np.asarray(index[np.isfinite(keys.ravel()[index])])


def _in_order(shares: Array, cost: Array) -> Array:
    """Keys that put first what keeps its bounds, by cost, and then what does not, by the share of a
    bound.
    """
    dearest = float(np.max(cost, where=np.isfinite(cost), initial=1e-300))
    return np.where(complies(shares), cost / dearest - 2.0 + 1e-9 * shares, shares)


def _promising(sequences: Iterable[BlockSequence], most: int) -> list[BlockSequence]:
    """Sequences that leave least, and a front of miss against cost: ``most`` of each."""
    ranked = of_each_kind(sorted(sequences, key=_rank), "width", "count", "every")
    return list(
        by_blocks((*ranked[:most], *_front(ranked)[:most], *_front(ranked, 1.0)[:most])).values()
    )


def _front(ranked: Iterable[BlockSequence], share: float = CHEAPER) -> list[BlockSequence]:
    """Of sequences in order of their rank those that cost less than a ``share`` of the cost of all
    before them.
    """
    front = list[BlockSequence]()
    for sequence in ranked:
        if not front or sequence.rank[1] < share * front[-1].rank[1]:
            front.append(sequence)
    return front
