"""Chance-constrained program: least-cost firing that meets a requirement with a margin of k sigmas.

The end error is linear in the on-times τ and in the inputs x, of one sigma each: r = Σ G τ - g +
(D0 + Σ D τ) x. In each direction u it keeps u·r + k |(D0 + Σ D τ)ᵀ u| ≤ L, a second-order cone in τ
(Boyd & Vandenberghe 2004, 4.4.2). For every w with |w| ≤ 1 that implies the tangent u·(Σ G τ - g) +
k w·(D0 + Σ D τ)ᵀ u ≤ L, linear in τ. The linear program has tangents of the cones, added where its
solution breaks them (Kelley 1960), and columns by price.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.schemes.optimal import linear_program
from nutdamp.schemes.optimal.linear_program import (
    Burn,
    GrowingProgram,
    Program,
    ProgramColumns,
    above,
    alone,
    burns,
)
from nutdamp.spacecraft.model import Vector

TIGHT = 1e-3  # share of a limit by which a solution may pass it
# cost of passing all limits by themselves, over that of all there is to do: done where hardly
# anything else helps
EXCESS = 10.0
SOME = 1e-9  # share of what is needed below which an on-time is rounding

Complex = NDArray[np.complex128]

TURNS = 100_000  # more than there are turns in a horizon: pulses are numbered by channel and turn


@dataclass(frozen=True, eq=False)
class Uncertain:
    """Effects of d dispersed inputs of one sigma, for each of K channels; (3,): of nutation, shift
    and spin.

    ``effects`` (3, K) N m of the channels, with biases, and ``changes`` (3, K, d) of these, but for
    those of the ``rates`` (3, d) rad/s at which they turn; ``start`` (3, d) N m s: changes of the
    end error without firing. Angles that are left are smaller where H is longer. ``own`` (d,):
    whether each pulse draws it anew. ``delay`` (K,) s: bias of the moment. ``goal`` (3,) N m s:
    required sum of the firing.
    """

    effects: Complex
    changes: Complex
    rates: Vector
    start: Complex
    own: NDArray[np.bool_]
    delay: Vector
    goal: Complex


class ChanceLimit(NamedTuple):
    """The most that may be left, N m s, of equation ``kind``: 0 nutation, 1 shift, 2 spin."""

    kind: int
    most: float


class Tangent(NamedTuple):
    """A tangent of a cone: direction ``u``; unit vector ``shared`` (d,) along the inputs and
    ``own`` (pulses, 1 + d).

    ``own`` begins with the number of the pulse, see `ChanceProgram.pulse`.
    """

    limit: ChanceLimit
    u: complex
    shared: Vector
    own: Vector


class Spread(NamedTuple):
    """End error by one sigma of each input: ``shared`` (d,), and of each of the ``pulses`` (g,) its
    ``own`` (g, d).
    """

    shared: Complex
    pulses: NDArray[np.int_]
    own: Complex

    def within(self, directions: Complex) -> Vector:
        """Standard deviation in each of the ``directions`` (n,), N m s."""
        size = float((np.abs(self.shared) ** 2).sum() + (np.abs(self.own) ** 2).sum())
        double = complex((self.shared**2).sum() + (self.own**2).sum())
        return np.sqrt(np.maximum(0.5 * (size + (np.conj(directions) ** 2 * double).real), 0.0))


DIRECTIONS, BEGUN = (
    72,
    16,
)  # in which the cone of two equations is looked at, and of its first tangents
WORST, ROUNDS = (
    3,
    40,
)  # tangents added to a cone at a time, and rounds with more tangents or columns
BEST, PRICE = (
    200,
    1e-6,
)  # columns taken in at a time, and the relative reduced cost below which none enters


class Sure(NamedTuple):
    """Burns of least cost; ``excess``: share by which limits are passed, ``left`` (5,) N m s: end
    errors.
    """

    burns: tuple[Burn, ...]
    excess: float
    left: Vector


class ChanceProgram:
    """The program of margins for the channels and slots of a ``program`` of small angles; ``size``
    of the goal.
    """

    def __init__(
        self, program: Program, uncertain: Uncertain, limits: tuple[ChanceLimit, ...], size: float
    ) -> None:
        self.program = program
        self.limits = limits
        self.uncertain = uncertain
        spacecraft = program.spacecraft
        self.turn = 2.0 * np.pi / spacecraft.fastest
        self.effects, self.changes, self.rates = (
            uncertain.effects,
            uncertain.changes,
            uncertain.rates,
        )
        self.scale = max(size, max(limit.most for limit in limits))
        self.unit: Vector = self.scale / np.hypot(
            np.abs(uncertain.effects[0]), uncertain.effects[2].real
        )
        cost = program.costs * self.unit
        self.cost = cost / float(cost.max())
        self.width = np.where(
            self.unit < program.width, 0.0, program.width
        )  # strong ones act at a moment
        every = np.arange(len(program.centres))
        self.slots = [self._slots(np.full(len(every), k), every) for k in range(len(cost))]

    def turn_of(self, times: Vector) -> NDArray[np.int_]:
        """Number from 0 of the turn, of the faster of both rates, in which ``times`` (n,) s lie."""
        turn = np.floor((times - self.program.spacecraft.limits.earliest) / self.turn).astype(int)
        return np.asarray(np.maximum(turn, 0))

    def pulse(self, columns: ProgramColumns) -> NDArray[np.int_]:
        """Number of the pulse to which each column belongs: those of one channel within one turn
        are one.
        """
        return np.asarray(columns.channel * TURNS + self.turn_of(columns.t))

    def turns(self, kind: int, columns: ProgramColumns) -> Complex:
        """Effect of one unit of torque in each column (n,), without dispersion: turned back, less
        losses to widths.
        """
        if kind == 2:
            return np.ones(len(columns.t), dtype=complex)
        spacecraft = self.program.spacecraft
        late = self.uncertain.delay[columns.channel]
        rate = (spacecraft.nutation_rate, spacecraft.spin)[kind]
        turned = np.exp(1j * rate * (columns.t + late)) * np.sinc(
            rate * columns.width / (2.0 * np.pi)
        )
        if kind == 0 and spacecraft.growth:
            rows = self.program.influence.rows(columns.t)[:, :2, 0]
            turned *= np.hypot(rows[:, 0], rows[:, 1])
        return np.asarray(turned)

    def row(self, tangent: Tangent, columns: ProgramColumns, margin: float) -> Vector:
        """Coefficients of a tangent for one unit of each column, over the scale, (n,)."""
        kind = tangent.limit.kind
        effect, changes = self.effects[kind, columns.channel], self.changes[kind]
        total = effect + margin * (changes @ tangent.shared)[columns.channel]
        total += margin * 1j * float(self.rates[kind] @ tangent.shared) * columns.t * effect
        if len(tangent.own):
            pulses = self.pulse(columns)
            mine = tangent.own[:, 0]
            at = np.minimum(np.searchsorted(mine, pulses), len(mine) - 1)
            known = mine[at] == pulses
            weights = tangent.own[at[known], 1:]
            total[known] += margin * (changes[columns.channel[known]] * weights).sum(axis=1)
        per_second = (np.conj(tangent.u) * self.turns(kind, columns) * total).real
        return np.asarray(per_second * self.unit[columns.channel] / self.scale)

    def right(self, tangent: Tangent, margin: float) -> float:
        """Upper limit of the sum of a tangent over its columns, over the scale."""
        kind, inputs = tangent.limit.kind, self.uncertain
        taken = np.conj(tangent.u) * (
            margin * inputs.start[kind] @ tangent.shared - inputs.goal[kind]
        )
        return float(tangent.limit.most - taken.real) / self.scale

    def left(self, columns: ProgramColumns, on_times: Vector) -> Complex:
        """End errors of nutation, shift and spin, (3,) N m s."""
        each = [
            self.turns(kind, columns) * self.effects[kind, columns.channel] @ on_times
            for kind in range(3)
        ]
        return np.asarray(np.array(each, dtype=np.complex128) - self.uncertain.goal)

    def spread(self, kind: int, columns: ProgramColumns, on_times: Vector) -> Spread:
        """End error by one sigma of each input, N m s, with columns on for ``on_times`` (n,) s."""
        shared = ~self.uncertain.own
        effect, changed = (part[kind, columns.channel] for part in (self.effects, self.changes))
        each = (self.turns(kind, columns) * on_times)[:, None]
        changed = changed + 1j * columns.t[:, None] * effect[:, None] * self.rates[kind]
        total: Complex = np.where(
            shared, (each * changed).sum(axis=0) + self.uncertain.start[kind], 0j
        )
        pulses, at = np.unique(self.pulse(columns), return_inverse=True)
        own = np.zeros((len(pulses), len(shared)), dtype=complex)
        np.add.at(own, at, np.where(shared, 0.0, each * changed))
        return Spread(total, pulses, own)

    def solve(self, margin: float) -> Sure:
        """The cheapest burns with so many sigmas of margin; where there are none, those that pass
        limits by least.
        """
        inputs = len(self.uncertain.own)
        plain = np.zeros(inputs), np.zeros((0, 1 + inputs))  # tangents that know of no dispersion
        tangents = [
            Tangent(limit, complex(u), *plain)
            for limit in self.limits
            for u in directions_of(limit, BEGUN)
        ]
        # Columns to begin with: those that pull along the goal, or back.
        toward = np.conj(self.uncertain.goal[0] or self.uncertain.goal[1] or 1.0)
        worth = np.abs(
            (toward * self.turns(0, self.slots[0])[None, :] * self.effects[0][:, None]).real
        )
        worth = np.where(self.program.forbidden, 0.0, worth * (self.unit / self.scale)[:, None])
        channel, slot = np.nonzero(worth > 0.8 * worth.max(initial=0.0))
        some = np.linspace(0, len(slot) - 1, min(2 * BEST, len(slot))).astype(int)
        columns = self._slots(channel[some], slot[some])
        rights = np.array([self.right(tangent, margin) for tangent in tangents])
        master = GrowingProgram(np.zeros(0), rights, np.zeros(0))
        # Dense, but solved anew from the last basis: 4 ms each in single-thruster.yaml.
        master.charge = 0.0
        excess = np.array([[-tangent.limit.most / self.scale] for tangent in tangents])
        # To pass all limits costs ten times all there is to do: that is done where hardly anything
        # else helps.
        master.add(np.array([EXCESS]), excess, np.array([np.inf]))
        self._add(master, tangents, columns, margin)
        best = None
        taken = columns
        for _ in range(ROUNDS):
            work.spend(linear_program.SOLVED + linear_program.COLUMN * len(columns.t))
            better = master.optimum()
            if better is None or work.exhausted():
                break
            best, taken = better, columns
            on_times = np.where(best.x[1:] > SOME, best.x[1:], 0.0) * self.unit[columns.channel]
            new = self._broken(columns, on_times, margin, float(best.x[0]))
            for tangent in new:
                row = np.concatenate(
                    [[-tangent.limit.most / self.scale], self.row(tangent, columns, margin)]
                )
                master.limit(row, self.right(tangent, margin))
            priced = self._priced(tangents, best.shadows, columns, margin)
            tangents += new
            if not len(priced.t) and not new:
                break
            if len(priced.t):
                self._add(master, tangents, priced, margin)
                columns = columns.joined(priced)
        if best is None:
            return Sure((), np.inf, np.zeros(5))
        used = on_times > 0.0
        left = self.left(taken, on_times)
        fired = burns(
            self.program.channels, taken.of(used), on_times[used], 1.01 * self.program.width
        )
        return Sure(fired, float(best.x[0]), left.view(float)[:5])

    def _broken(
        self, columns: ProgramColumns, on_times: Vector, margin: float, excess: float
    ) -> list[Tangent]:
        """Tangents where the cones are passed, the worst of each."""
        used = on_times > 0.0
        columns = columns.of(used)
        on_times = on_times[used]
        left = self.left(columns, on_times)
        tangents = []
        for limit in self.limits:
            spread = self.spread(limit.kind, columns, on_times)
            directions = directions_of(limit, DIRECTIONS)
            along = (np.conj(directions) * left[limit.kind]).real + margin * spread.within(
                directions
            )
            by = along - (1.0 + excess + TIGHT) * limit.most  # a little more passes
            peaked = np.flatnonzero((by > 0.0) & (by >= np.roll(by, 1)) & (by >= np.roll(by, -1)))
            for index in peaked[np.argsort(-by[peaked])][:WORST].tolist():
                u = complex(directions[index])
                length = max(float(spread.within(directions[[index]])[0]), 1e-300)
                own = np.column_stack([spread.pulses, (np.conj(u) * spread.own).real / length])
                tangents.append(Tangent(limit, u, (np.conj(u) * spread.shared).real / length, own))
        return tangents

    def _slots(self, channel: NDArray[np.int_], slot: NDArray[np.int_]) -> ProgramColumns:
        return alone(channel, self.program.centres[slot], self.width[channel])

    def _add(
        self, master: GrowingProgram, tangents: list[Tangent], new: ProgramColumns, margin: float
    ) -> None:
        most = np.where(new.width > 0.0, new.width / self.unit[new.channel], np.inf)
        rows = np.array([self.row(tangent, new, margin) for tangent in tangents]).reshape(
            len(tangents), -1
        )
        master.add(self.cost[new.channel], rows, most)

    def _priced(
        self, tangents: list[Tangent], shadows: Vector, taken: ProgramColumns, margin: float
    ) -> ProgramColumns:
        """Slots that would lower the cost, the best; of channels that act at once the best moments
        too.
        """
        worth = np.tile(-self.cost[:, None], (1, len(self.program.centres)))
        for tangent, price in zip(tangents, shadows.tolist(), strict=True):
            if price < -1e-12:
                rows = (self.row(tangent, columns, margin) for columns in self.slots)
                worth += price * np.array(list(rows))
        worth[self.program.forbidden] = -np.inf
        worth[
            taken.channel,
            np.searchsorted(self.program.centres, taken.t - 0.25 * self.program.width),
        ] = -np.inf
        return self._slots(*above(worth, PRICE, BEST))


def directions_of(limit: ChanceLimit, count: int) -> Complex:
    """Unit vectors (n,), ``count`` or the two that there are, in which a limit is looked at."""
    return (
        np.array([1.0, -1.0], dtype=complex)
        if limit.kind == 2
        else np.exp(2j * np.pi * np.arange(count) / count)
    )
