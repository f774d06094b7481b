"""Least-cost firing that meets a requirement with a margin of so many sigmas: cones, cut by cut.

What is left is linear in the on-times τ and, to first order, in the dispersed inputs x: r = G τ - g + (D0 + Σ τ D) x.
In each direction u it is to keep u·r + k |(D0 + Σ τ D)ᵀ u| ≤ L, a second-order cone in τ (Boyd & Vandenberghe 2004,
4.4.2). The linear program has tangents of the cones, added where its solution breaks them (Kelley 1960), and columns
by price.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp import work
from nutdamp.schemes.optimal import lp_solver
from nutdamp.schemes.optimal.columns import Burn, Columns, alone, burns
from nutdamp.schemes.optimal.linear_program import COLUMN, SOLVED, Program
from nutdamp.spacecraft import Vector

Complex = NDArray[np.complex128]

ROUNDS = 40
"""Solutions of the linear program, each with more tangents or columns."""

DIRECTIONS = 72
"""In which the cones of two equations are looked at."""

BEGUN = 16
"""Of them, tangents to begin with, without margin."""

TIGHT = 1e-3
"""Share of a limit by which a solution may pass it."""

WORST = 3
"""Tangents added to a cone at a time."""

EXCESS = 10.0
"""Cost of passing all limits by themselves, over that of all there is to do: where hardly anything else helps."""

PRICE = 1e-6
"""Relative reduced cost below which a column does not enter."""

BEST = 200
"""Columns taken in at a time."""

SOME = 1e-9
"""Share of what is needed below which an on-time is rounding."""


@dataclass(frozen=True, eq=False)
class Uncertain:
    """How d dispersed inputs of one sigma act, for each of K channels; what is (2,) is of nutation and shift.

    ``effect`` (K,) and ``axial`` (K,): torque about the transverse axes (complex) and axis 3, N m, with biases.
    ``begin`` (2, d) complex N m s: by what each changes what is to be undone; ``rates`` (2, d) rad/s: the two rates.
    ``torque`` (K, d) complex and ``axial_torque`` (K, d) N m; ``late`` (K, d) s: by how much a pulse comes later.
    ``own`` (d,): whether each pulse draws it anew. ``spin`` (d,) N m s. ``delay`` (K,) s: bias of the moment. ``less``
    (d,): by what share each makes angles smaller that are left, as H is longer then.
    """

    effect: Complex
    axial: Vector
    begin: Complex
    rates: Vector
    torque: Complex
    axial_torque: Vector
    late: Vector
    own: NDArray[np.bool_]
    spin: Vector
    delay: Vector
    less: Vector


class Limit(NamedTuple):
    """The most that may be left, N m s, of equation ``kind``: 0 nutation, 1 shift, 2 spin."""

    kind: int
    most: float


class _Tangent(NamedTuple):
    """A tangent of a cone: direction ``u``, unit vector ``shared`` (d,) along the inputs, ``own`` (groups, d)."""

    limit: Limit
    u: complex
    shared: Vector
    own: Vector


class Sure(NamedTuple):
    """Burns of least cost; ``excess``: share by which limits are passed, ``left`` (5,) N m s: what is left then."""

    burns: tuple[Burn, ...]
    excess: float
    left: Vector


class ChanceProgram:
    """The program of margins for the channels and slots of a ``program`` of small angles."""

    def __init__(self, program: Program, uncertain: Uncertain, limits: tuple[Limit, ...], goal: Vector) -> None:
        self.program, self.uncertain, self.limits = program, uncertain, limits
        self.scale = max(float(np.linalg.norm(goal)), max(one.most for one in limits))
        body = program.spacecraft
        self.pace = np.array([body.inertia.a * body.spin, body.spin])
        self.goal = np.array([complex(goal[0], goal[1]), complex(goal[2], goal[3]), goal[4]])
        strength = np.hypot(np.abs(uncertain.effect), uncertain.axial)
        self.unit = self.scale / strength
        self.cost = program.costs * self.unit
        self.dearest = float(self.cost.max())
        self.strong = self.unit < program.width
        self._late = 2.0 * np.pi / max(abs(self.pace[0]), abs(self.pace[1]))
        each = [self._group(self._all(channel)) for channel in range(len(self.unit))]
        self._pulses = np.unique(np.concatenate(each))
        self._kept: dict[tuple[int, int], tuple[Complex, NDArray[np.int_]]] = {}

    def solve(self, margin: float) -> Sure:
        """The cheapest burns with so many sigmas of margin; where there are none, those that pass limits by least."""
        tangents = [self._first(limit, u) for limit in self.limits for u in self._directions(limit, BEGUN)]
        columns = self._begin()
        master = lp_solver.GrowingProgram(
            np.zeros(0), np.array([self._right(one, margin) for one in tangents]), np.zeros(0)
        )
        excess = np.array([[-one.limit.most / self.scale] for one in tangents])
        master.add(np.array([EXCESS]), excess, np.array([np.inf]))
        self._add(master, tangents, columns, margin)
        found = None
        for _ in range(ROUNDS):
            work.spend(SOLVED + COLUMN * len(columns.t))
            better = master.optimum()
            if better is None or work.exhausted():
                break
            found = better
            amounts = found.x[1:]
            new = self._broken(columns, amounts, margin, found.x[0])
            for one in new:
                row = np.concatenate([[-one.limit.most / self.scale], self._coefficients(one, columns, margin)])
                master.limit(row, self._right(one, margin))
            priced = self._priced(tangents, found.shadows, columns, margin)
            tangents += new
            if not new and not len(priced.t):
                break
            if len(priced.t):
                self._add(master, tangents, priced, margin)
                columns = columns.joined(priced)
        if found is None:
            return Sure((), np.inf, np.zeros(5))
        amounts = np.zeros(len(columns.t))
        amounts[: len(found.x) - 1] = found.x[1:]
        used = amounts > SOME
        on_times = amounts[used] * self.unit[columns.channel[used]]
        left = self._left(columns, amounts)
        return Sure(
            burns(self.program.channels, columns.of(used), on_times, 1.01 * self.program.width),
            float(found.x[0]),
            np.array([left[0].real, left[0].imag, left[1].real, left[1].imag, left[2].real]) * self.scale,
        )

    def _directions(self, limit: Limit, count: int) -> Complex:
        return (
            np.array([1.0, -1.0], dtype=complex) if limit.kind == 2 else np.exp(2j * np.pi * np.arange(count) / count)
        )

    def _first(self, limit: Limit, u: complex) -> _Tangent:
        count = len(self.uncertain.own)
        return _Tangent(limit, complex(u), np.zeros(count), np.zeros((0, count)))

    def _turns(self, kind: int, columns: Columns) -> Complex:
        """What one unit of torque in each column (n,) does, before any dispersion: turned back, and lost to widths."""
        if kind == 2:
            return np.ones(len(columns.t), dtype=complex)
        body, late = self.program.spacecraft, self.uncertain.delay[columns.channel]
        rate = self.pace[kind]
        turned = np.exp(1j * rate * (columns.t + late)) * np.sinc(rate * columns.width / (2.0 * np.pi))
        if kind == 0 and body.growth:
            rows = self.program.influence.rows(columns.t)[:, :2, 0]
            turned *= np.hypot(rows[:, 0], rows[:, 1])
        return np.asarray(turned)

    def _group(self, columns: Columns) -> NDArray[np.int_]:
        """Which columns are of the same pulse: of one channel within one turn."""
        turn = np.floor((columns.t - self.program.spacecraft.limits.earliest) / self._late).astype(int)
        return np.asarray(columns.channel * 100_000 + np.maximum(turn, 0))

    def _effects(self, kind: int) -> tuple[Complex, Complex]:
        """Of the channels: what they do (K,), and by what inputs change it but for the rate, (K, d)."""
        one = self.uncertain
        if kind == 2:
            return one.axial.astype(complex), one.axial_torque.astype(complex)
        return one.effect, one.torque + (1j * self.pace[kind] * one.late - one.less) * one.effect[:, None]

    def _start(self, kind: int) -> Complex:
        """By what inputs change what is left without any firing, (d,)."""
        one = self.uncertain
        return one.spin.astype(complex) if kind == 2 else one.begin[kind] + one.less * self.goal[kind]

    def _coefficients(self, tangent: _Tangent, columns: Columns, margin: float) -> Vector:
        """Of a tangent, for one unit of each column, over the scale."""
        kind, one = tangent.limit.kind, self.uncertain
        effects, changes = self._effects(kind)
        effect = effects[columns.channel]
        total = effect + margin * (changes @ tangent.shared)[columns.channel]
        if kind < 2:
            rate = float(one.rates[kind] @ tangent.shared)
            total = total + margin * 1j * rate * columns.t * effect
        if len(tangent.own):
            groups = self._group(columns)
            at = np.searchsorted(tangent.own[:, 0], groups)
            known = (at < len(tangent.own)) & (tangent.own[np.minimum(at, len(tangent.own) - 1), 0] == groups)
            weights = tangent.own[at[known], 1:]
            total[known] += margin * (changes[columns.channel[known]] * weights).sum(axis=1)
        worth = (np.conj(tangent.u) * self._turns(kind, columns) * total).real
        return np.asarray(worth * self.unit[columns.channel] / self.scale)

    def _right(self, tangent: _Tangent, margin: float) -> float:
        """What the columns of a tangent may add up to, over the scale."""
        kind = tangent.limit.kind
        taken = (np.conj(tangent.u) * (margin * self._start(kind) @ tangent.shared - self.goal[kind])).real
        return float((tangent.limit.most - taken) / self.scale)

    def _left(self, columns: Columns, amounts: Vector) -> Complex:
        """What is left of nutation, shift and spin, over the scale."""
        left: list[complex] = []
        for kind in range(3):
            effect = self._effects(kind)[0][columns.channel]
            added = self._turns(kind, columns) * effect @ (amounts * self.unit[columns.channel])
            left.append(complex(added - self.goal[kind]) / self.scale)
        return np.array(left, dtype=np.complex128)

    def _spread(self, kind: int, columns: Columns, amounts: Vector) -> tuple[Complex, NDArray[np.int_], Complex]:
        """D: of shared inputs (d,), and of those that each pulse draws anew by group (g,) and input (g, d)."""
        one, shared = self.uncertain, ~self.uncertain.own
        effect, changed = (part[columns.channel] for part in self._effects(kind))
        each = (self._turns(kind, columns) * amounts * self.unit[columns.channel])[:, None]
        if kind < 2:
            changed = changed + 1j * columns.t[:, None] * effect[:, None] * one.rates[kind]
        total: Complex = np.where(shared, (each * changed).sum(axis=0) + self._start(kind), 0j)
        groups, at = np.unique(self._group(columns), return_inverse=True)
        own = np.zeros((len(groups), len(shared)), dtype=complex)
        np.add.at(own, at, np.where(shared, 0.0, each * changed))
        return np.asarray(total / self.scale), groups, np.asarray(own / self.scale)

    def _broken(self, columns: Columns, amounts: Vector, margin: float, excess: float) -> list[_Tangent]:
        """Tangents where the cones are passed, the worst of each."""
        used = amounts > SOME
        columns, amounts = columns.of(used), amounts[used]
        left, found = self._left(columns, amounts), []
        for limit in self.limits:
            shared, groups, own = self._spread(limit.kind, columns, amounts)
            directions = self._directions(limit, DIRECTIONS)
            along = (np.conj(directions)[:, None] * shared).real
            alone_ = (np.conj(directions)[:, None, None] * own).real
            size = np.sqrt((along**2).sum(axis=1) + (alone_**2).sum(axis=(1, 2)))
            passed = (np.conj(directions) * left[limit.kind]).real + margin * size
            passed -= (1.0 + excess + TIGHT) * limit.most / self.scale
            peaks = np.flatnonzero((passed > 0.0) & (passed >= np.roll(passed, 1)) & (passed >= np.roll(passed, -1)))
            for index in peaks[np.argsort(-passed[peaks])][:WORST].tolist():
                length = max(float(size[index]), 1e-300)
                table = np.column_stack([groups, alone_[index] / length])
                found.append(_Tangent(limit, complex(directions[index]), along[index] / length, table))
        return found

    def _begin(self) -> Columns:
        """Columns to begin with: those that pull along the goal, or back."""
        toward = np.conj(self.goal[0] or self.goal[1] or 1.0)
        worth = np.abs((toward * self._turns(0, self._all())[None, :] * self.uncertain.effect[:, None]).real)
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

    def _add(self, master: lp_solver.GrowingProgram, tangents: list[_Tangent], new: Columns, margin: float) -> None:
        most = np.where(new.width > 0.0, new.width / self.unit[new.channel], np.inf)
        rows = np.array([self._coefficients(one, new, margin) for one in tangents]).reshape(len(tangents), -1)
        master.add(self.cost[new.channel] / self.dearest, rows, most)

    def _priced(self, tangents: list[_Tangent], shadows: Vector, taken: Columns, margin: float) -> Columns:
        """Slots that would lower the cost, the best."""
        worth = np.array([-np.full(len(self.program.centres), cost / self.dearest) for cost in self.cost])
        active = [(one, price) for one, price in zip(tangents, shadows.tolist(), strict=True) if price < -1e-12]
        for kind in {limit.kind for limit in self.limits}:
            own = [(one, price) for one, price in active if one.limit.kind == kind]
            for channel in range(len(worth)):
                worth[channel] += self._worth(kind, channel, own, margin)
        worth[self.program.forbidden] = -np.inf
        worth[taken.channel, np.searchsorted(self.program.centres, taken.t - 0.25 * self.program.width)] = -np.inf
        channel_, slot = np.nonzero(worth > PRICE)
        if len(slot) > BEST:
            best = np.argpartition(worth[channel_, slot], -BEST)[-BEST:]
            channel_, slot = channel_[best], slot[best]
        return self._slots(channel_, slot)

    def _worth(self, kind: int, channel: int, active: list[tuple[_Tangent, float]], margin: float) -> Vector:
        """What one unit of a channel in each slot is worth by tangents of one kind and their prices."""
        turned, groups = self._slots_of(kind, channel)
        effects, changes = (part[channel] for part in self._effects(kind))
        fixed = rate = 0j
        own = np.zeros(len(self._pulses), dtype=complex)
        for one, price in active:
            weight = price * np.conj(one.u)
            fixed += weight * (effects + margin * changes @ one.shared)
            rate += weight * margin * 1j * (self.uncertain.rates[kind] @ one.shared if kind < 2 else 0.0) * effects
            if len(one.own):
                at = np.searchsorted(self._pulses, one.own[:, 0])
                own[at] += weight * margin * (one.own[:, 1:] @ changes)
        total = turned * (fixed + rate * self.program.centres + own[groups])
        return np.asarray(total.real * self.unit[channel] / self.scale)

    def _slots_of(self, kind: int, channel: int) -> tuple[Complex, NDArray[np.int_]]:
        """`_turns` of all slots of a channel, and the place of their pulse among all there are; remembered."""
        if (kind, channel) not in self._kept:
            every = self._all(channel)
            self._kept[kind, channel] = self._turns(kind, every), np.searchsorted(self._pulses, self._group(every))
        return self._kept[kind, channel]
