"""What no firing costs less than that keeps the cones of `chance_model` with a margin: weak duality.

Primal: least c·τ over on-times τ ≥ 0, no more than one second of a channel in a second, that keep all cones. Each
tangent j of a cone, a_j·τ ≤ b_j, holds for all of them. Dual: prices y_j ≥ 0 of tangents, worth -Σ y_j b_j; the worth
of a second of a channel at t over its cost is q(t) = -Σ y_j a_j(t) / c. For any τ

    c·τ ≥ c·τ + Σ y_j (a_j·τ - b_j) = -Σ y_j b_j - ∫ c (q - 1) dτ ≥ -Σ y_j b_j - ∫ max(0, q - 1) c dt,

where channels that act at once have no such integral, but q ≤ 1. The inputs that each pulse draws anew are of a channel
and a turn: q is smooth within turns, with steps between them.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from nutdamp.limits import free_windows
from nutdamp.schemes.optimal.chance import PROVING, ChanceProgram, directions_of
from nutdamp.schemes.optimal.chance_model import ChanceModel, Tangent
from nutdamp.schemes.optimal.columns import Columns, alone
from nutdamp.schemes.optimal.primer import lowered, slackened, stretches
from nutdamp.spacecraft import Vector

KEPT = 1e-9
"""Share of limits that may be passed where they count as kept."""

LOOKS = 720
"""Directions in which a firing is looked at."""

LEAST = 1e-9
"""Share of the largest price below which one is rounding."""


class SureProof(NamedTuple):
    """Cost that no firing goes below, ``bound``, by ``prices`` of ``tangents``, cost per N m s.

    ``gained`` is taken off. ``columns`` and ``on_times`` (n,) s: a firing that keeps the cones for little more, but for
    the share of limits ``passed``.
    """

    bound: float
    gained: float
    tangents: tuple[Tangent, ...]
    prices: Vector
    columns: Columns
    on_times: Vector
    passed: float


class ChanceCurve:
    """q by ``prices`` of ``tangents``, at a margin of so many sigmas: a `primer.Curve`."""

    def __init__(self, model: ChanceModel, tangents: Sequence[Tangent], prices: Vector, margin: float) -> None:
        program = model.program
        self.model, self.costs = model, program.costs
        self.begins, self.lengths = stretches(program, slackened(spans(model)))
        kinds = sorted({one.kind for one in model.limits})
        priced = list(zip(tangents, (-prices).tolist(), strict=True))
        channels = range(len(self.costs))
        self._weights = {(kind, at): model.weights(kind, at, priced, margin) for kind in kinds for at in channels}
        last, growth = float(self.begins[-1] + self.lengths[-1]), abs(program.spacecraft.growth)
        bends = np.zeros(len(self.costs))
        for (kind, at), (fixed, rate, own) in self._weights.items():
            turning = 0.0 if kind == 2 else float(np.hypot(model.pace[kind], growth))
            most = abs(fixed) + abs(rate) * last + float(np.abs(own).max())
            bends[at] += turning**2 * most + 2.0 * turning * abs(rate)
        self.bends = bends / self.costs

    def at(self, times: Vector, within: Vector) -> Vector:
        """q at ``times`` (n,) s, in the turns of the moments ``within`` (n,) s, (n, channels)."""
        turn = np.minimum(self.model.turn_of(within), self.model.count - 1)
        worth = np.zeros((len(times), len(self.costs)))
        for (kind, at), (fixed, rate, own) in self._weights.items():
            turned = self.model.turns(kind, alone(np.full(len(times), at), times, np.zeros(len(times))))
            worth[:, at] += (turned * (fixed + rate * times + own[turn])).real
        return np.asarray(worth / self.costs)

    def mean(self, centres: Vector, lengths: Vector) -> Vector:
        """Mean of q in stretches, or a little more: by its ends and its curvature, (n, channels)."""
        ends = self.at(centres - 0.5 * lengths, centres) + self.at(centres + 0.5 * lengths, centres)
        return 0.5 * ends + self.bends * lengths[:, None] ** 2 / 12.0


def windows(model: ChanceModel) -> list[tuple[float, float]]:
    """When the program may fire, (begin, end) s: the windows, until first order is no good any more."""
    program = model.program
    free = np.flatnonzero(~program.forbidden.all(axis=0))
    last = float(program.centres[free[-1]] + 0.5 * program.width) if len(free) else program.spacecraft.limits.earliest
    return free_windows(program.spacecraft, min(last, program.end))


def spans(model: ChanceModel) -> list[tuple[float, float]]:
    """The windows, cut where turns begin."""
    earliest, found = model.program.spacecraft.limits.earliest, []
    for begin, end in windows(model):
        cuts = earliest + model.turn * np.arange(1, model.count + 1)
        edges = [begin, *cuts[(cuts > begin) & (cuts < end)].tolist(), end]
        found += list(itertools.pairwise(edges))
    return found


def prove(chance: ChanceProgram, margin: float) -> SureProof | None:
    """The proof of the least cost at a margin of so many sigmas; None where no firing keeps it, or none is found."""
    found = chance.solved(margin, PROVING)
    if found is None or found.excess > KEPT:
        return None
    chosen = np.flatnonzero(found.prices > LEAST * found.prices.max(initial=0.0))
    tangents, prices = tuple(found.tangents[at] for at in chosen.tolist()), found.prices[chosen]
    goal = -float(prices @ np.array([chance.model.right(one, margin) for one in tangents]))
    best = lowered(ChanceCurve(chance.model, tangents, prices, margin), chance.strong, goal) if len(chosen) else None
    if best is None:
        return None
    used = found.on_times > 0.0
    columns, on_times = found.columns.of(used), found.on_times[used]
    passed = _passed(chance.model, columns, on_times, margin)
    return SureProof(best.bound, best.gained, tangents, prices / best.factor, columns, on_times, passed)


def _passed(model: ChanceModel, columns: Columns, on_times: Vector, margin: float) -> float:
    """Share by which a firing passes the limit that it keeps least; 0 where it keeps all."""
    left, most = model.left(columns, on_times), 0.0
    for limit in model.limits:
        u = directions_of(limit, LOOKS)
        spread = model.spread(limit.kind, columns, on_times).within(u)
        most = max(most, float(((np.conj(u) * left[limit.kind]).real + margin * spread).max()) / limit.most - 1.0)
    return most
