"""Command blocks for spinners: channel, delay after the Sun pulse, width, number of pulses.

All blocks that can be commanded are examined in closed form (`block_model`): of one block every channel, width,
number of pulses and interval, each at the delays next to the two best ones, one for the heading of H and one for
the nutation. Where one does not do, a second and a third are sought behind the most promising. The best dozen are
flown from the Sun pulses of the nutating body, and the best of these is the schedule.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.errors import Infeasible, listed
from nutdamp.flight import propagation
from nutdamp.flight.end_state import left_by
from nutdamp.flight.propagation import shed
from nutdamp.schemes.block_model import BlockModel, BlockState, Trial, acts, evenly, fired, spin_turn
from nutdamp.schemes.catalogue import CommandBlockOptions
from nutdamp.schemes.sequential import at_hand
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import OFF_TICK, Windows, commandable_widths, keeps_limits, usable
from nutdamp.spacecraft.equipment import Block, Channel, Commands
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import SAME_COST, Left, Part
from nutdamp.spacecraft.schedule import Schedule

ANY = "finer steps of delay and width in commands, or a longer limits.horizon"
"""Advice where nothing is known to hinder."""


def searched(compared: str, form: Left, flown: Left, *, first: bool) -> str:
    """Note that nothing ``compared`` is better, with the difference of flight and closed form.

    ``first``: what was flown is the best in closed form.
    """
    nutation, end = (math.degrees(abs(float(term) - other)) for term, other in zip(form[:2], flown[:2], strict=True))
    scope = f"{compared} does better in closed form" if first else "of those flown none does better"
    return (
        f"{scope}; flown from the Sun pulses of the nutating body, nutation differs by {nutation:.2g}° and the end "
        f"of H by {end:.2g}°"
    )


def off_ticks(tick: float | None, commands: Commands) -> tuple[str, ...]:
    """Note on blocks that are on no ``tick`` (s), where their steps differ."""
    if tick is None:
        return ()
    steps = np.array([commands.delay_step, *commands.widths]) / tick
    if np.abs(steps - np.rint(steps)).max() <= OFF_TICK:
        return ()
    return (
        f"limits.tick = {tick:g} s is not kept: blocks have the steps of commands, delays of {commands.delay_step:g} s",
    )


def cures(
    model: BlockModel, channels: Sequence[Channel], missed: Mapping[Part, float], schedule: Schedule, more: list[str]
) -> str:
    """What of the file keeps the blocks ``schedule`` from leaving less, besides ``more``; ``missed``: bounds, rad."""
    named = [*more, *too_coarse(model, channels, missed), *used_up(model.body, schedule)]
    if shed(model.body) is not None:  # with other blocks the moments fall otherwise: no cure is sure to help
        return "what limits these blocks, if the moments of inertia did not fall: " + listed(named or [ANY])
    return "to leave less: " + listed(named or [ANY])


def too_coarse(model: BlockModel, channels: Sequence[Channel], missed: Mapping[Part, float]) -> Iterator[str]:
    """Steps of the commands that may, half of each, cost more than the bounds that are ``missed`` (rad) allow."""
    body, commands = model.body, model.body.commands
    assert commands is not None
    way, half = body.to_turn if body.goal.axis is not None else 0.0, 0.5 * commands.delay_step
    spin, damped = abs(body.spin), abs(model.rate * body.spin)
    aside = {Part.DISTANCE: half * spin * way, Part.NUTATION: half * damped * math.tan(body.nutation)}
    steps = [step for channel in channels for step in _steps(model, channel)]
    along = 0.5 * min(steps, default=0.0)
    for part, what in ((Part.DISTANCE, "the end of H"), (Part.NUTATION, "the nutation")):
        most = missed.get(part, math.inf)
        if aside[part] > most:
            angle = f"{math.degrees(2.0 * aside[part]):.2g}°"
            yield f"a finer commands.delay_step ({commands.delay_step:g} s changes {what} by {angle})"
    if along > min(missed.values(), default=math.inf):
        yield f"finer widths in commands.width (one step of one pulse turns H by {math.degrees(2.0 * along):.2g}°)"


def _steps(model: BlockModel, channel: Channel) -> Iterator[float]:
    """Least extra turn of H, rad, by one pulse of a channel over one of the next smaller width, or none."""
    assert model.body.commands is not None
    widths = commandable_widths(model.body.commands, channel)
    if len(widths):
        turned = np.sort(model.turned_by(channel, widths, model.body.spin))
        yield float(np.diff(turned, prepend=0.0).min())


def used_up(body: Spacecraft, schedule: Schedule) -> Iterator[str]:
    """Limits that the blocks of a schedule use up."""
    commands, limits = body.commands, body.limits
    assert commands is not None
    if body.horizon - schedule.end < 2.0 * spin_turn(body):
        yield f"a longer limits.horizon (the blocks end at {schedule.end:.4g} s of {body.horizon:.4g} s)"
    if limits.max_pulses is not None and len(schedule) >= limits.max_pulses:
        yield f"more limits.max_pulses ({limits.max_pulses})"
    if any(block.count == commands.max_count for block in schedule.blocks):
        yield f"a larger commands.max_count ({commands.max_count})"


Array = NDArray[np.float64]

FLOWN = 12
"""Sequences of blocks that are flown; as many more where none of them complies."""

GENTLE = 10
"""Times as many sequences of which these are those with the smallest pulses."""

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
"""Fraction of a bound up to which the closed form may err, so that a flight has to decide."""

SURELY = 3.0
"""Times its error by which the length of a block that ends at the target differs from the way there, at most."""

LOWER = 0.98
"""Fraction of the nutation above which it does not count as lowered."""

LOOKED = 2e-6
"""Units of `work` of an examined block."""


class BlockSequence(NamedTuple):
    """Blocks, the motion after them in closed form, and their rank: the less, the better.

    ``rank``: the share of a bound that is used up, zero where all are kept, then the cost, then the time of the end;
    ``share``: the share.
    """

    blocks: tuple[Block, ...]
    state: BlockState
    rank: tuple[float, float, float]
    share: float = math.inf


class BlockSearch:
    """Blocks of one spacecraft, and their rank in closed form."""

    def __init__(self, spacecraft: Spacecraft, channels: Sequence[Channel], commands: Commands) -> None:
        self.body, self.channels, self.commands = spacecraft, channels, commands
        self.model = BlockModel(spacecraft)
        self.bounds = [self._lowered(bound) for bound in requirements.bounds(spacecraft)]
        self.looked = 0
        self.most = math.inf  # what a sequence may cost
        self.doubtful: list[BlockSequence] = []  # those that may comply in a flight, the cheapest first
        limits = spacecraft.limits
        self.allowed = self.commands.max_count if limits.max_pulses is None else limits.max_pulses
        self.pause = math.ceil(limits.gap / self.model.turn)
        self.dark = Windows(spacecraft).dark
        self.earliest = max(math.ceil((limits.earliest - self.model.start.sun_pulse) / self.model.turn), 0)

    def _lowered(self, bound: requirements.Bound) -> requirements.Bound:
        """Bound of the nutation at its present value: without a target blocks are to lower it."""
        goal = self.body.goal
        if bound.part is not Part.NUTATION or goal.axis is not None or goal.spin is not None:
            return bound
        return bound._replace(most=min(bound.most, LOWER * self.body.nutation))

    def best(self, most: int) -> list[BlockSequence]:
        """Best few sequences of up to ``most`` blocks, to be flown."""
        start = BlockSequence((), self.model.start, (math.inf, math.inf, math.inf))
        sequences = self._single(start)
        firsts: list[BlockSequence] = []
        for number in range(2, most + 1):
            self.most = min((sequence.rank[1] for sequence in sequences if sequence.rank[0] <= 0.0), default=math.inf)
            if work.exhausted() or (self.most < math.inf and not self.small):
                break
            if number == 2:
                small = self.behind(start, self._rest(start), few=2) if abs(start.state.phasor) > 0.0 else ()
                firsts = [*_promising(sequences, FIRST), *_promising(small, FIRST), *islice(self._parts(start), FIRST)]
                firsts += self._all_firsts(start) if self.small else []
            else:
                firsts = _promising(firsts, FIRST // 2)
            firsts = [sequence for sequence in firsts if sequence.rank[1] < self.most]
            firsts = [more for first in firsts for more in self.behind(first, self._rest(first), few=4)]
            sequences += firsts
        self.most = math.inf
        self.doubtful = sorted(
            (sequence for sequence in sequences if sequence.share <= DOUBTFUL), key=lambda sequence: sequence.rank[1:]
        )
        # The flight differs a little, and the more the larger the nutation on the way: half of them are the cheapest
        # that comply, half those that do most clearly, and the best one of each number of blocks is among them.
        ranked = list(
            {sequence.blocks: sequence for sequence in sorted(sequences, key=lambda sequence: sequence.rank)}.values()
        )
        clear = sorted(ranked, key=lambda sequence: sequence.share)[: FLOWN // 2]
        each = {len(sequence.blocks): sequence for sequence in reversed(ranked)}.values()
        first = {sequence.blocks: sequence for sequence in (*ranked[: FLOWN // 2], *clear, *each)}
        # Nutation on the way goes with what one pulse turns H by: where all those miss, the gentlest of many follow.
        gentle = sorted(sorted(ranked, key=lambda sequence: sequence.share)[: GENTLE * FLOWN], key=self._largest_pulse)
        more = {
            sequence.blocks: sequence
            for sequence in (*of_each_kind(ranked)[:FLOWN], *gentle)
            if sequence.blocks not in first
        }
        return [*first.values(), *islice(more.values(), 2 * FLOWN)]

    def _largest_pulse(self, sequence: BlockSequence) -> float:
        """Largest turn of H by one of its pulses, rad."""
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
        """Best ``few`` of the ``trials`` of each channel, after the blocks ``before``.

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
            chosen += [*np.lexsort((cost.ravel(), doubted))[:few]]
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
        """Fraction of a ``bound`` that is ``left``: 1 or less keeps it."""
        return np.asarray(requirements.left_of(bound.part, left, self.body) / bound.most)

    def _spaced(self, every: int) -> bool:
        """True if pulses in one of ``every`` spins are as far apart as limits.gap requires."""
        return every * self.model.turn >= self.body.limits.gap + float(self.commands.widths[0])

    def _counts(self, start: BlockState, every: int) -> NDArray[np.int64]:
        """Numbers of pulses up to the horizon."""
        most = int((self.body.horizon - float(start.sun_pulse)) / (every * self.model.turn)) + 1
        if not self._spaced(every):
            return np.arange(0)
        return np.arange(1, max(min(most, self.commands.max_count, self.allowed), 0) + 1)

    def _single(self, start: BlockSequence) -> list[BlockSequence]:
        """Best single blocks, of all widths, numbers and intervals at the best delays.

        What surely ends worse than the best ones found is left out: see `_short_by`.
        """
        short = [
            (channel, every, self._short_by(start.state, channel, every))
            for channel in self.channels
            for every in self.commands.every
        ]
        most = max((shares.max() for _, _, shares in short if shares.size), default=0.0)
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
        """Least miss of blocks of each width and number (w, n), in fractions of the missed bound.

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
        """Blocks of the widths and numbers with an ``index`` (k, 2), after every wait and at the best delays."""
        if len(index):
            widths = commandable_widths(self.commands, channel)[index[:, 0]]
            counts = self._counts(state, every)[index[:, 1]]
            for wait in self._waits(state, self.earliest, WAITS if abs(state.phasor) > 0.0 else 1):
                yield self._at_delays(state, channel, wait, widths, counts, every)

    def _rest(self, before: BlockSequence) -> Iterator[tuple[Channel, Trial]]:
        """Blocks for the rest of the way, or of the nutation."""
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
            near = self.model.pulses(state, channel, widths, float(way) / step, self.commands.max_count)
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
        every = next((interval for interval in self.commands.every if self._spaced(interval)), None)
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
        """True if there are so few blocks that all are examined."""
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
        sequences = self.behind(start, self._grid(start.state, self.earliest), few=ALL_FIRSTS)
        return sorted(sequences, key=lambda sequence: sequence.rank[1])[:ALL_FIRSTS]

    def _waits(self, state: BlockState, least: int, few: int) -> list[int]:
        """Sun pulses that may be let pass before a block: the ``least`` few, and those up to the end of a blackout."""
        after = np.floor((self.dark[1] - float(state.sun_pulse)) / self.model.turn)
        later = after[(after > least) & (self.dark[1] < self.body.horizon)][:WINDOWS].astype(int).tolist()
        return sorted({begin + more for begin in (least, *later) for more in range(few + (begin != least))})

    def _longer_round(self, before: BlockState, after: BlockState) -> NDArray[np.bool_]:
        """True if H has gone round the Sun the longer way to the target, or once more."""
        if self.body.goal.axis is None:
            return np.zeros((), dtype=bool)
        return np.asarray(np.abs(after.longitude - before.longitude - self.model.ahead(before)) > math.pi)

    def _dark(self, state: BlockState, channel: Channel, trial: Trial, after: BlockState) -> NDArray[np.bool_]:
        """True if a pulse of the blocks would be on in a blackout window, or just beside it."""
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
        """Blocks at the best delays for the heading, and at those for the nutation."""
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
        """Nearest delay that can be commanded, of those within a spin turn."""
        step, longest = self.commands.delay_step, min(self.commands.delay_max, self.model.turn)
        most = math.floor(longest / step * (1.0 + 1e-12))
        return np.asarray(np.clip(np.rint(delay / step), 0, most) * step)


def of_each_kind(ranked: Iterable[BlockSequence]) -> list[BlockSequence]:
    """First of each kind of sequence: their flights may differ much though their closed forms do not."""
    kinds: dict[tuple[tuple[str, int], ...], BlockSequence] = {}
    for sequence in ranked:
        kinds.setdefault(tuple((block.channel, block.every) for block in sequence.blocks), sequence)
    return list(kinds.values())


def _promising(sequences: Iterable[BlockSequence], most: int) -> list[BlockSequence]:
    """Sequences of least residual, and others of least residual at their cost: ``most`` of each."""
    ranked, front = sorted(sequences, key=lambda sequence: sequence.rank), list[BlockSequence]()
    for sequence in ranked:
        if not front or sequence.rank[1] < front[-1].rank[1]:
            front.append(sequence)
    return list({sequence.blocks: sequence for sequence in (*ranked[:most], *front[:most])}.values())


FLOWN_PULSES = 1000
"""Pulses that are flown, after which no further sequence is."""

DOUBTS = 100
"""Sequences that are flown since they would be cheaper, if the closed form erred in their favour."""

CORRECTED = 4
"""Flights whose neighbours are looked at where none complies."""

ROUNDS = 3
"""Rounds, each from the best flights so far."""


class FlownSequence(NamedTuple):
    """Sequence as flown, with its rank: broken limits last, then the earlier end; and its pulses."""

    rank: tuple[bool, float, float, float]
    made: Schedule
    found: BlockSequence


def schedule(spacecraft: Spacecraft, options: CommandBlockOptions) -> Schedule:
    """Blocks that meet the requirement with the least propellant, else those of least residual.

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
    channels = [channel for channel in able if commandable_widths(commands, channel).size]
    if not channels:
        raise Infeasible("no width that can be commanded (commands.width) is one that a channel allows")
    search = Search(spacecraft, channels, commands)
    flights: list[FlownSequence] = []
    outside = " outside the blackout windows" if spacecraft.limits.blackout else ""
    why = f"no block that can be commanded ends within the horizon{outside}; a longer limits.horizon may help"
    best = search.best(options.max_blocks or BLOCKS)
    for round_ in range(ROUNDS + 1):
        for number, sequence in enumerate(best if round_ == 0 else search.nearer(flights)):
            met = any(flight.rank[:2] == (False, 0.0) for flight in flights)
            pulses = sum(len(flight.made) for flight in flights)
            if pulses > FLOWN_PULSES * (1 + round_) or work.exhausted() or (met and number >= FLOWN * (round_ == 0)):
                break
            try:
                flights.append(search.flown(sequence))
            except Infeasible as reason:
                why = f"the best block in closed form cannot be flown: {reason}" if not flights else why
    search.doubted(flights)
    if not flights:
        raise Infeasible(why)
    chosen = _cheapest(flights)
    first = chosen.found.rank[:2] <= best[0].rank[:2]
    notes = [search.note(chosen, first=first), *off_ticks(tick, commands)]
    if chosen.rank[1] > 1.0:
        notes.insert(1, search.cures(chosen, options.max_blocks or BLOCKS))
    return replace(chosen.made, notes=tuple(notes))


def _cheapest(flights: Sequence[FlownSequence]) -> FlownSequence:
    """Best flight; of equal costs within `SAME_COST` the fewest pulses, then the earlier end."""
    best = min(flights, key=lambda flight: flight.rank)
    broken, missed, cost, _ = best.rank
    equal = [
        flight
        for flight in flights
        if flight.rank[:2] == (broken, missed) and flight.rank[2] <= cost * (1.0 + SAME_COST)
    ]
    return min(equal, key=lambda flight: (len(flight.made), flight.made.end, flight.rank))


class Search(BlockSearch):
    """Block search with flights."""

    def flown(self, sequence: BlockSequence) -> FlownSequence:
        """Rank of the blocks when flown. Raises Infeasible where they cannot be."""
        schedule = fired(self.body, sequence.blocks)
        left = left_by(propagation.flown(self.body, schedule))
        share = max(float(self.share(bound, left)) for bound in self.bounds)
        missed = float(f"{share:.9g}") if share > 1.0 else 0.0  # rounding is no reason to wait for another Sun pulse
        rank = not keeps_limits(self.body, schedule), missed, schedule.cost, schedule.end
        return FlownSequence(rank, schedule, sequence)

    def doubted(self, flights: list[FlownSequence]) -> None:
        """Fly sequences that would be cheaper than the best of the ``flights`` if they complied, and add them."""
        best = min((flight.rank for flight in flights if not flight.rank[0]), default=None)
        most = math.inf if best is None or best[1] > 0.0 else best[2] * (1.0 - SAME_COST)
        known = {flight.found.blocks for flight in flights}
        cheaper = (sequence for sequence in self.doubtful if sequence.rank[1] < most and sequence.blocks not in known)
        for sequence in islice(cheaper, DOUBTS if self.small else FLOWN):
            if work.exhausted():
                return
            with suppress(Infeasible):
                flights.append(self.flown(sequence))
                if flights[-1].rank[:2] == (False, 0.0):
                    return

    def nearer(self, flights: Sequence[FlownSequence]) -> list[BlockSequence]:
        """Neighbours of the best of ``flights`` of least residual if the closed form errs as it does for those.

        Nutation on the way, which that form leaves out, is much the same then.
        """
        named, sequences = {channel.name: channel for channel in self.channels}, list[BlockSequence]()
        by_blocks = {flight.found.blocks: flight for flight in sorted(flights, key=lambda flight: flight.rank)}
        best = of_each_kind([flight.found for flight in by_blocks.values()])
        for flight in (by_blocks[each.blocks] for each in best[:CORRECTED]):
            *earlier, last = flight.found.blocks
            state, number, channel = self.model.start, 1, named[last.channel]
            for block in earlier:
                trial = Trial(block.first - number, block.delay, block.width, block.count, block.every)
                state = self.model.after(state, named[block.channel], trial)
                number = block.first + (block.count - 1) * block.every + 1
            before = BlockSequence(tuple(earlier), state, (math.inf, math.inf, math.inf))
            off = self.model.apart(flight.found.state, propagation.flown(self.body, flight.made))
            trials = iter([(channel, self._around(before, channel, last, number))])
            sequences += self.behind(before, trials, off=off)
        known = {flight.found.blocks for flight in flights}
        ranked = {
            sequence.blocks: sequence
            for sequence in sorted(sequences, key=lambda sequence: sequence.rank)
            if sequence.blocks not in known
        }
        chosen = (*islice(ranked.values(), FLOWN // 2), *of_each_kind(ranked.values()))
        return [self._in_form(sequence) for sequence in {sequence.blocks: sequence for sequence in chosen}.values()]

    def _in_form(self, sequence: BlockSequence) -> BlockSequence:
        """Sequence ranked by the closed form alone."""
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

    def cures(self, chosen: FlownSequence, most: int) -> str:
        """Factors that keep ``chosen`` from leaving less, of up to ``most`` blocks."""
        left = left_by(propagation.flown(self.body, chosen.made))
        missed = {bound.part: bound.most for bound in self.bounds if float(self.share(bound, left)) > 1.0}
        more = [f"--max-blocks {BLOCKS}"] * (len(chosen.made.blocks) == most < BLOCKS)
        return cures(self.model, self.channels, missed, chosen.made, more)

    def note(self, chosen: FlownSequence, *, first: bool) -> str:
        """Note on the search, and on the difference of flight and closed form; ``first``: best in that form."""
        schedule, form = chosen.made, self.model.left(chosen.found.state)
        compared = (
            f"none of the {self.looked:,} sequences compared" if len(schedule.blocks) > 1 else "no other single block"
        )
        return searched(compared, form, left_by(propagation.flown(self.body, schedule)), first=first)
