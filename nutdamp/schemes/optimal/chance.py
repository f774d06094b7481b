"""Least-cost firing that meets a requirement with a margin of so many sigmas: the cones of `chance_model`, cut by cut.

The linear program has tangents of the cones, added where its solution breaks them (Kelley 1960), and columns by price.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp import work
from nutdamp.schemes.optimal import lp_solver
from nutdamp.schemes.optimal.chance_model import ChanceModel, Complex, Limit, Spread, Tangent, Uncertain
from nutdamp.schemes.optimal.columns import Burn, Columns, alone, burns
from nutdamp.schemes.optimal.linear_program import COLUMN, SOLVED, Program
from nutdamp.spacecraft import Vector

DIRECTIONS = 72
"""In which the cones of two equations are looked at."""

BEGUN = 16
"""Of them, tangents to begin with, without margin."""

WORST = 3
"""Tangents added to a cone at a time."""

BEST = 200
"""Columns taken in at a time."""

TIGHT = 1e-3
"""Share of a limit by which a solution may pass it."""

PRICE = 1e-6
"""Relative reduced cost below which a column does not enter."""

ROUNDS = 40
"""Of the linear program, each with more tangents or columns."""

EXCESS = 10.0
"""Cost of passing all limits by themselves, over that of all there is to do: done where hardly anything else helps."""

SOME = 1e-9
"""Share of what is needed below which an on-time is rounding."""


class Sure(NamedTuple):
    """Burns of least cost; ``excess``: share by which limits are passed, ``left`` (5,) N m s: what is left then."""

    burns: tuple[Burn, ...]
    excess: float
    left: Vector


class ChanceProgram:
    """The program of margins for the channels and slots of a ``program`` of small angles."""

    def __init__(self, program: Program, uncertain: Uncertain, limits: tuple[Limit, ...], goal: Vector) -> None:
        self.program, self.limits = program, limits
        self.model = ChanceModel(program, uncertain, limits, goal)
        self.scale = max(float(np.linalg.norm(goal)), max(one.most for one in limits))
        self.unit = self.scale / np.hypot(np.abs(uncertain.effect), uncertain.axial)
        self.cost = program.costs * self.unit
        self.dearest = float(self.cost.max())
        self.strong = self.unit < program.width
        self._kept: dict[tuple[int, int], tuple[Complex, NDArray[np.int_]]] = {}

    def solve(self, margin: float) -> Sure:
        """The cheapest burns with so many sigmas of margin; where there are none, those that pass limits by least."""
        tangents = [self.model.plain(limit, u) for limit in self.limits for u in directions_of(limit, BEGUN)]
        columns = self._begin()
        rights = np.array([self.model.right(one, margin) for one in tangents]) / self.scale
        master = lp_solver.GrowingProgram(np.zeros(0), rights, np.zeros(0))
        excess = np.array([[-one.limit.most / self.scale] for one in tangents])
        master.add(np.array([EXCESS]), excess, np.array([np.inf]))
        self._add(master, tangents, columns, margin)
        found, taken = None, columns
        for _ in range(ROUNDS):
            work.spend(SOLVED + COLUMN * len(columns.t))
            better = master.optimum()
            if better is None or work.exhausted():
                break
            found, taken = better, columns
            on_times = self._on_times(columns, found.x[1:])
            new = self._broken(columns, on_times, margin, float(found.x[0]))
            for one in new:
                row = np.concatenate([[-one.limit.most / self.scale], self._coefficients(one, columns, margin)])
                master.limit(row, self.model.right(one, margin) / self.scale)
            priced = self._priced(tangents, found.shadows, columns, margin)
            tangents += new
            if not len(priced.t) and not new:
                break
            if len(priced.t):
                self._add(master, tangents, priced, margin)
                columns = columns.joined(priced)
        if found is None:
            return Sure((), np.inf, np.zeros(5))
        on_times = self._on_times(taken, found.x[1:])
        used, left = on_times > 0.0, self.model.left(taken, on_times)
        return Sure(
            burns(self.program.channels, taken.of(used), on_times[used], 1.01 * self.program.width),
            float(found.x[0]),
            np.array([left[0].real, left[0].imag, left[1].real, left[1].imag, left[2].real]),
        )

    def _on_times(self, columns: Columns, amounts: Vector) -> Vector:
        """On-times (n,) s of amounts in units, without rounding."""
        return np.where(amounts > SOME, amounts, 0.0) * self.unit[columns.channel]

    def _coefficients(self, tangent: Tangent, columns: Columns, margin: float) -> Vector:
        """Of a tangent, for one unit of each column, over the scale."""
        return self.model.row(tangent, columns, margin) * self.unit[columns.channel] / self.scale

    def _broken(self, columns: Columns, on_times: Vector, margin: float, excess: float) -> list[Tangent]:
        """Tangents where the cones are passed, the worst of each."""
        used = on_times > 0.0
        columns, on_times = columns.of(used), on_times[used]
        left, found = self.model.left(columns, on_times), []
        for limit in self.limits:
            spread = self.model.spread(limit.kind, columns, on_times)

            def passed(directions: Complex, limit: Limit = limit, spread: Spread = spread) -> Vector:
                along = (np.conj(directions) * left[limit.kind]).real + margin * spread.within(directions)
                return np.asarray(along - (1.0 + excess + TIGHT) * limit.most)

            directions = directions_of(limit, DIRECTIONS)
            by = passed(directions)
            peaked = np.flatnonzero((by > 0.0) & (by >= np.roll(by, 1)) & (by >= np.roll(by, -1)))
            for index in peaked[np.argsort(-by[peaked])][:WORST].tolist():
                u = complex(directions[index])
                length = max(float(spread.within(directions[[index]])[0]), 1e-300)
                own = np.column_stack([spread.pulses, (np.conj(u) * spread.own).real / length])
                found.append(Tangent(limit, u, (np.conj(u) * spread.shared).real / length, own))
        return found

    def _begin(self) -> Columns:
        """Columns to begin with: those that pull along the goal, or back."""
        model = self.model
        toward = np.conj(model.goal[0] or model.goal[1] or 1.0)
        worth = np.abs((toward * model.turns(0, self._all())[None, :] * model.uncertain.effect[:, None]).real)
        worth = np.where(self.program.forbidden, 0.0, worth * (self.unit / self.scale)[:, None])
        channel, slot = np.nonzero(worth > 0.8 * worth.max(initial=0.0))
        some = np.unique(np.linspace(0, len(slot) - 1, min(2 * BEST, len(slot))).astype(int))
        return self._slots(channel[some], slot[some])

    def _all(self, channel: int = 0) -> Columns:
        centres = self.program.centres
        width = 0.0 if self.strong[channel] else self.program.width
        return alone(np.full(len(centres), channel), centres, np.full(len(centres), width))

    def _slots(self, channel: NDArray[np.int_], slot: NDArray[np.int_]) -> Columns:
        return alone(channel, self.program.centres[slot], np.where(self.strong[channel], 0.0, self.program.width))

    def _add(self, master: lp_solver.GrowingProgram, tangents: list[Tangent], new: Columns, margin: float) -> None:
        most = np.where(new.width > 0.0, new.width / self.unit[new.channel], np.inf)
        rows = np.array([self._coefficients(one, new, margin) for one in tangents]).reshape(len(tangents), -1)
        master.add(self.cost[new.channel] / self.dearest, rows, most)

    def _priced(self, tangents: list[Tangent], shadows: Vector, taken: Columns, margin: float) -> Columns:
        """Slots that would lower the cost, the best; of channels that act at once the best moments too."""
        cost = self.cost / self.dearest
        active = [(one, price) for one, price in zip(tangents, shadows.tolist(), strict=True) if price < -1e-12]
        worth = np.array([self._worth(channel, active, margin) - cost[channel] for channel in range(len(cost))])
        worth[self.program.forbidden] = -np.inf
        worth[taken.channel, np.searchsorted(self.program.centres, taken.t - 0.25 * self.program.width)] = -np.inf
        channel_, slot = np.nonzero(worth > PRICE)
        if len(slot) > BEST:
            best = np.argpartition(worth[channel_, slot], -BEST)[-BEST:]
            channel_, slot = channel_[best], slot[best]
        return self._slots(channel_, slot)

    def _worth(self, channel: int, active: list[tuple[Tangent, float]], margin: float) -> Vector:
        """What one unit of a channel in each slot is worth by tangents and their prices."""
        worth = np.zeros(len(self.program.centres))
        for kind in {limit.kind for limit in self.limits}:
            turned, turn = self._slots_of(kind, channel)
            fixed, rate, own = self.model.weights(kind, channel, active, margin)
            worth += (turned * (fixed + rate * self.program.centres + own[turn])).real
        return np.asarray(worth * (self.unit[channel] / self.scale))

    def _slots_of(self, kind: int, channel: int) -> tuple[Complex, NDArray[np.int_]]:
        """Turns of all slots of a channel, see `ChanceModel.turns` and `ChanceModel.turn_of`; remembered."""
        if (kind, channel) not in self._kept:
            every = self._all(channel)
            self._kept[kind, channel] = self.model.turns(kind, every), self.model.turn_of(every.t)
        return self._kept[kind, channel]


def directions_of(limit: Limit, count: int) -> Complex:
    """Unit vectors (n,), ``count`` or the two that there are, in which a limit is looked at."""
    return np.array([1.0, -1.0], dtype=complex) if limit.kind == 2 else np.exp(2j * np.pi * np.arange(count) / count)
