"""Sequences of command blocks as a table, and their flights in batches.

Each flies from the Sun pulses of its own nutating motion; what flights leave is exact where a free
motion keeps it, and the best is flown once more by its pulses alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.flight.end_state import left_by
from nutdamp.schemes.block_model import BlockState, fire_all
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import SAME_COST, Left, Part, complies
from nutdamp.spacecraft.schedule import Schedule

Array = NDArray[Any]
Index = NDArray[Any]  # whole numbers
Blocks = tuple[Block, ...]


class BlockSequences(NamedTuple):
    """Sequences of blocks, one a row.

    ``blocks`` (n, b, 5): kind (channel and interval), first Sun pulse, delay, width and number of
    pulses of each block; ``share`` of a bound that is used up, and the ``state`` of the motion
    behind.
    """

    blocks: Array
    share: Array
    state: BlockState

    def some(self, rows: Index) -> BlockSequences:
        """Subset of rows."""
        return BlockSequences(self.blocks[rows], self.share[rows], self.state.some(rows))

    @property
    def cost(self) -> Array:
        """Propellant, kg."""
        return np.asarray(self.state.cost)

    @property
    def ranked(self) -> Index:
        """Rows, the best first: those that comply by cost, then the others by what they leave."""
        missed = np.where(complies(self.share), 0.0, self.share)
        return np.lexsort((self.state.sun_pulse, self.cost, missed))


class FlownSequence(NamedTuple):
    """Flight of a sequence; ``rank``: breaks a limit, share of a bound that is passed, cost in
    steps of `SAME_COST`, number of pulses, end in s.
    """

    rank: tuple[bool, float, int, int, float]
    schedule: Schedule
    end: Array  # (11,) as in `SunPulses.ends`
    confirmed: bool = False

    @property
    def complies(self) -> bool:
        """True if it keeps limits and bounds."""
        return self.rank[:2] == (False, 0.0)


class BlockFlights:
    """Flights of sequences of one spacecraft, and the ``bounds`` that they are judged by.

    ``cheapest``: the least cost of one that complied.
    """

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.spacecraft = spacecraft
        self.damps = spacecraft.goal.axis is None and spacecraft.goal.spin is None
        self.of: dict[Blocks, FlownSequence] = {}
        self.cheapest = math.inf
        self.why: Infeasible | None = None
        self.bounds = []
        for bound in requirements.bounds(spacecraft):
            limit = bound.limit
            if bound.part is Part.NUTATION and self.damps:
                limit = min(limit, 0.98 * spacecraft.nutation)  # blocks without a goal lower it
            elif bound.part is Part.SPIN:
                limit = requirements.AIMED_SPIN * limit
            self.bounds.append(bound._replace(limit=limit))

    def share(self, residual: Left) -> Array:
        """Largest share of a bound: 1 or less keeps all."""
        return np.asarray(np.max(np.broadcast_arrays(*self.shares(residual).values()), axis=0))

    def shares(self, residual: Left) -> dict[Part, Array]:
        """Share of each bound that a residual uses up."""
        left_of, spacecraft = requirements.left_of, self.spacecraft
        return {
            bound.part: np.asarray(bound.used(left_of(bound, residual, spacecraft)))
            for bound in self.bounds
        }

    def fly(self, sequences: Iterable[Blocks]) -> None:
        """Fly sequences together, those that have not been flown."""
        new = [blocks for blocks in dict.fromkeys(sequences) if blocks not in self.of]
        if not new:
            return
        schedules, sun_pulses = fire_all(self.spacecraft, new)
        ends = sun_pulses.ends
        shares = self.share(sun_pulses.residual(self.spacecraft))
        for index, (blocks, schedule) in enumerate(zip(new, schedules, strict=True)):
            if isinstance(schedule, Infeasible):
                self.why = schedule
                continue
            rank = _rank(schedule, float(shares[index]))
            self.of[blocks] = FlownSequence(rank, schedule, ends[:, index])
        if self.of and self.best().complies:
            self.cheapest = min(self.cheapest, self.best().schedule.cost)

    def best(self) -> FlownSequence:
        """The best flight, confirmed by the limits and by the flight of its pulses alone."""
        while True:
            blocks, best = min(self.of.items(), key=lambda each: each[1].rank)
            if best.confirmed:
                return best
            schedule = best.schedule
            breaks = not keeps_limits(self.spacecraft, schedule)
            share = float(self.share(left_by(propagation.flown(self.spacecraft, schedule))))
            rank = _rank(schedule, share, breaks=breaks)
            self.of[blocks] = best._replace(rank=rank, confirmed=True)


def _rank(
    schedule: Schedule, share: float, *, breaks: bool = False
) -> tuple[bool, float, int, int, float]:
    """Rank of a flight; rounding is no reason to wait for a Sun pulse."""
    missed = 0.0 if complies(share) else float(f"{share:.9g}")
    steps = round(math.log(max(schedule.cost, 1e-300)) / SAME_COST)
    return breaks, missed, steps, len(schedule), schedule.end


def least(keys: Array, most: int) -> Index:
    """Indices (rows, n) of the ``most`` least keys of each row, in any order."""
    rows, count = keys.shape
    if most >= count:
        return np.tile(np.arange(count), (rows, 1))
    return np.asarray(np.argpartition(keys, most - 1, axis=1)[:, :most])


def first_of_each(order: Index, *keys: Array) -> Index:
    """Of rows in order the first of each value of the ``keys``, in order."""
    _, index = np.unique(np.array([key[order] for key in keys]), axis=1, return_index=True)
    return np.asarray(order[np.sort(index)])


def grid_size(turns: int, kinds: Sequence[tuple[int, int]], allowed: int, most: int) -> float:
    """Number of sequences of up to ``most`` blocks within so many ``turns``, each of up to
    ``allowed`` pulses; infinite where there are very many.

    ``kinds``: interval in turns, and number of blocks of one place and number of pulses.
    """
    if turns > 100:  # of one pulse each they are too many
        return math.inf
    spans = np.zeros(max(turns, 0) + 1)
    for every, blocks in kinds:
        for count in range(1, min(allowed, (turns - 1) // every + 1) + 1):
            spans[(count - 1) * every + 1] += blocks
    total = 0.0
    ends = np.zeros(len(spans))
    ends[0] = 1.0
    for _ in range(most):
        ends = np.convolve(np.cumsum(ends), spans)[: len(spans)]
        total += float(ends.sum())
    return total
