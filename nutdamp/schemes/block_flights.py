"""Sequences of command blocks as a table, and their flights in batches.

Flights of a batch go on together from Sun pulse to Sun pulse, each of its own motion. What they
leave is exact where a free motion keeps it; the best is flown once more by its pulses alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
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

COLUMNS = ("parent", "kind", "first", "delay", "width", "count", "share")


@dataclass(frozen=True, eq=False)
class BlockSequences:
    """Sequences of blocks, one a row: the last block behind a row of those ``before``.

    ``kind``: channel and interval; ``share`` of a bound that is used up, and the ``state`` of the
    motion behind.
    """

    before: BlockSequences | None
    parent: Index
    kind: Index
    first: Index
    delay: Array
    width: Array
    count: Index
    share: Array
    state: BlockState

    @property
    def cost(self) -> Array:
        """Propellant, kg."""
        return np.asarray(self.state.cost)

    def some(self, rows: Index) -> BlockSequences:
        """Subset of rows."""
        columns: dict[str, Any] = {name: getattr(self, name)[rows] for name in COLUMNS}
        return replace(self, **columns, state=self.state.some(rows))

    def pulses(self, rows: Index) -> Index:
        """Number of pulses of rows."""
        count = self.count[rows]
        if self.before is None:
            return count
        return np.asarray(count + self.before.pulses(self.parent[rows]))

    @property
    def ranked(self) -> Index:
        """Rows, the best first: those that comply by cost, then the others by what they leave."""
        missed = np.where(complies(self.share), 0.0, self.share)
        return np.lexsort((self.state.sun_pulse, self.cost, missed))


class FlownSequence(NamedTuple):
    """Flight of a sequence; ``rank``: breaks a limit, share of a bound that is passed, cost, end in
    s. ``reckoned``: its cost in closed form.
    """

    rank: tuple[bool, float, float, float]
    schedule: Schedule
    end: Array  # (11,) as in `SunPulses.ends`
    reckoned: float = 0.0
    confirmed: bool = False

    @property
    def complies(self) -> bool:
        """True if it keeps limits and bounds."""
        return self.rank[:2] == (False, 0.0)


class BlockFlights:
    """Flights of sequences of one spacecraft, and the ``bounds`` that they are judged by.

    ``cheapest``: the least cost in closed form of one that complied.
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

    def fly(self, sequences: Sequence[Blocks], costs: Sequence[float]) -> None:
        """Fly sequences together, those that have not been flown."""
        new = {
            blocks: cost
            for blocks, cost in zip(sequences, costs, strict=True)
            if blocks not in self.of
        }
        if not new:
            return
        try:
            schedules, sun_pulses = fire_all(self.spacecraft, list(new))
        except Infeasible as reason:  # the motion of one of them cannot be followed
            self.why = reason
            if len(new) > 1:
                for blocks, cost in new.items():
                    self.fly([blocks], [cost])
            return
        ends = sun_pulses.ends
        shares = self.share(sun_pulses.residual(self.spacecraft))
        for index, (blocks, cost) in enumerate(new.items()):
            schedule = schedules[index]
            if isinstance(schedule, Infeasible):
                self.why = schedule
                continue
            rank = _rank(schedule, float(shares[index]))
            self.of[blocks] = FlownSequence(rank, schedule, ends[:, index], cost)
        if self.of and self.best().complies:
            self.cheapest = min(self.cheapest, self.best().reckoned)

    def best(self) -> FlownSequence:
        """The best flight, confirmed by the limits and by the flight of its pulses alone."""
        while True:
            blocks, best = min(self.of.items(), key=lambda each: each[1].rank)
            if best.confirmed:
                return best
            self.of[blocks] = self._confirmed(best)

    def _confirmed(self, flight: FlownSequence) -> FlownSequence:
        """The flight with its true rank."""
        schedule = flight.schedule
        breaks = not keeps_limits(self.spacecraft, schedule)
        share = float(self.share(left_by(propagation.flown(self.spacecraft, schedule))))
        rank = _rank(schedule, share, breaks=breaks)
        return flight._replace(rank=rank, confirmed=True)

    def chosen(self) -> FlownSequence:
        """Of those that cost as much as the best the one of the fewest pulses, then of the earlier
        end.
        """
        best = self.best()
        broken, missed, cost, _ = best.rank
        alike = [
            flight
            for flight in self.of.values()
            if flight.rank[:2] <= (broken, missed) and flight.rank[2] <= cost * (1.0 + SAME_COST)
        ]
        alike.sort(key=lambda each: (len(each.schedule), each.schedule.end, each.rank))
        for flight in alike:
            confirmed = flight if flight.confirmed else self._confirmed(flight)
            if confirmed.rank[:2] <= (broken, missed):
                return confirmed
        return best


def _rank(
    schedule: Schedule, share: float, *, breaks: bool = False
) -> tuple[bool, float, float, float]:
    """Rank of a flight; rounding is no reason to wait for a Sun pulse."""
    missed = 0.0 if complies(share) else float(f"{share:.9g}")
    return breaks, missed, schedule.cost, schedule.end


def joined(before: BlockSequences, parts: Sequence[BlockSequences]) -> BlockSequences:
    """Sequences of several tables in one."""
    if not parts:
        return before.some(np.zeros(0, dtype=np.intp))
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS
    }
    state = BlockState.joined([part.state for part in parts])
    _, rows = np.unique(np.array(list(columns.values())), axis=1, return_index=True)
    return BlockSequences(before, **columns, state=state).some(rows)


def least(keys: Array, most: int) -> Index:
    """Indices (rows, n) of the ``most`` least keys of each row, in any order."""
    rows, count = keys.shape
    if most >= count:
        return np.tile(np.arange(count), (rows, 1))
    return np.asarray(np.argpartition(keys, most - 1, axis=1)[:, :most])


def front(costs: Array, share: float) -> Index:
    """Of costs in order those less than a ``share`` of all before them."""
    rows = list[int]()
    cheapest = math.inf
    while True:
        lower = np.flatnonzero(costs < share * cheapest)
        if not len(lower):
            return np.array(rows, dtype=np.intp)
        rows.append(int(lower[0]))
        cheapest = float(costs[lower[0]])


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
