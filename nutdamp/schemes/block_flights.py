"""Flights of command blocks: what is fired from the Sun pulses of the nutating body, a dozen sequences together."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.flight.end_state import left_by
from nutdamp.schemes.block_model import fire_all
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import Schedule

Blocks = tuple[Block, ...]

FLOWN = 12
"""Sequences of blocks that are flown; as many more where none of them complies."""

DEARER = 1.01
"""Multiple of the cost of a sequence that complied in a flight from which on none is flown."""

LOWER = 0.98
"""Share of the nutation above which it does not count as lowered."""


class BlockSequence(NamedTuple):
    """Blocks and their rank in closed form: the less, the better.

    ``rank``: the share of a bound that is used up, zero where all are kept, then the cost, then the time of the end;
    ``share``: the share.
    """

    blocks: Blocks
    rank: tuple[float, float, float]
    share: float = math.inf


class FlownSequence(NamedTuple):
    """Flight of a sequence; ``rank``: breaks a limit, share of a bound that is passed, cost, end in s."""

    rank: tuple[bool, float, float, float]
    schedule: Schedule
    sequence: BlockSequence


START = BlockSequence((), (math.inf, math.inf, math.inf))
"""No blocks, before which all others come."""


class BlockFlights:
    """Flights of sequences of one spacecraft: ``of`` each, and the least cost that is ``known`` to comply.

    ``bounds``: what they are judged by.
    """

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.body, self.known = spacecraft, math.inf
        self.bounds = [self._lowered(bound) for bound in requirements.bounds(spacecraft)]
        self.of: dict[Blocks, FlownSequence] = {}
        self._fired: dict[Blocks, Schedule | Infeasible] = {}

    def _lowered(self, bound: requirements.Bound) -> requirements.Bound:
        """A bound of the nutation that there is no more than already: without a target blocks are to lower it."""
        goal = self.body.goal
        if bound.part is not Part.NUTATION or goal.axis is not None or goal.spin is not None:
            return bound
        return bound._replace(most=min(bound.most, LOWER * self.body.nutation))

    def share(self, left: requirements.Left) -> NDArray[np.float64]:
        """Largest share of a bound that is ``left``: 1 or less keeps all."""
        return np.asarray(np.max(np.broadcast_arrays(*self.shares(left).values()), axis=0))

    def shares(self, left: requirements.Left) -> dict[Part, NDArray[np.float64]]:
        """Share of each bound that is ``left``."""
        return {
            bound.part: np.asarray(requirements.left_of(bound.part, left, self.body) / bound.most)
            for bound in self.bounds
        }

    def fired(self, sequences: Sequence[BlockSequence]) -> Iterator[BlockSequence]:
        """The sequences, one after the other, but for those that cost more than one that complied in a flight.

        The pulses of a dozen of them are fired together.
        """
        for begin in range(0, len(sequences), FLOWN):
            some = [each for each in sequences[begin : begin + FLOWN] if each.rank[1] <= self.known * DEARER]
            new = [sequence.blocks for sequence in some if sequence.blocks not in self._fired]
            if new:
                self._fired.update(zip(new, self._together(new), strict=True))
            yield from (each for each in some if each.rank[1] <= self.known * DEARER)

    def _together(self, some: Sequence[Blocks]) -> Sequence[Schedule | Infeasible]:
        """Pulses of sequences; one by one where the motion of one of them cannot be followed."""
        try:
            return fire_all(self.body, some)[0]
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
            share = float(self.share(left_by(propagation.flown(self.body, schedule))))
            missed = float(f"{share:.9g}") if share > 1.0 else 0.0  # rounding is no reason to wait for a Sun pulse
            rank = not keeps_limits(self.body, schedule), missed, schedule.cost, schedule.end
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
    """The first sequence of each kind, blocks with the same values of these fields: flights may differ.

    By default the channel and the interval, where closed forms do not differ.
    """
    kinds: dict[tuple[object, ...], BlockSequence] = {}
    fields = operator.attrgetter(*(names or ("channel", "every")))
    for sequence in ranked:
        kinds.setdefault(tuple(map(fields, sequence.blocks)), sequence)
    return list(kinds.values())
