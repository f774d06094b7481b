"""What is left after firing, to first order in the dispersed inputs: cones in the on-times, and their tangents.

What is left is linear in the on-times τ and in the inputs x, of one sigma each: r = Σ G τ - g + (D0 + Σ D τ) x. In each
direction u it is to keep u·r + k |(D0 + Σ D τ)ᵀ u| ≤ L, a second-order cone in τ (Boyd & Vandenberghe 2004, 4.4.2).
For every w with |w| ≤ 1 that implies the tangent u·(Σ G τ - g) + k w·(D0 + Σ D τ)ᵀ u ≤ L, linear in τ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.schemes.optimal.columns import Columns
from nutdamp.schemes.optimal.linear_program import Program
from nutdamp.spacecraft import Vector

Complex = NDArray[np.complex128]

KINDS = ("nutation", "shift", "spin")
"""What may be left, see `Limit`."""

TURNS = 100_000
"""More than there are turns in a horizon: pulses are numbered by channel and turn."""


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


class Tangent(NamedTuple):
    """A tangent of a cone: direction ``u``; unit vector ``shared`` (d,) along the inputs and ``own`` (pulses, 1 + d).

    ``own`` begins with the number of the pulse, see `ChanceModel.pulse`.
    """

    limit: Limit
    u: complex
    shared: Vector
    own: Vector


class Spread(NamedTuple):
    """What one sigma of each input leaves: ``shared`` (d,), and of each of the ``pulses`` (g,) its ``own`` (g, d)."""

    shared: Complex
    pulses: NDArray[np.int_]
    own: Complex

    def within(self, directions: Complex) -> Vector:
        """Standard deviation in each of the ``directions`` (n,), N m s."""
        size = float((np.abs(self.shared) ** 2).sum() + (np.abs(self.own) ** 2).sum())
        double = complex((self.shared**2).sum() + (self.own**2).sum())
        return np.sqrt(np.maximum(0.5 * (size + (np.conj(directions) ** 2 * double).real), 0.0))


class Weights(NamedTuple):
    """Of a channel and a kind, what priced tangents add up to: Re(E(t) (``fixed`` + ``rate`` t + ``own`` of the turn)).

    E is what `ChanceModel.turns` gives; ``own`` (turns,).
    """

    fixed: complex
    rate: complex
    own: Complex


class ChanceModel:
    """The cones of a ``program`` of small angles; ``goal`` (5,) N m s is what firing is to add."""

    def __init__(self, program: Program, uncertain: Uncertain, limits: tuple[Limit, ...], goal: Vector) -> None:
        self.program, self.uncertain, self.limits = program, uncertain, limits
        body = program.spacecraft
        self.pace = np.array([body.inertia.a * body.spin, body.spin])
        self.goal = np.array([complex(goal[0], goal[1]), complex(goal[2], goal[3]), goal[4]])
        self.turn = 2.0 * np.pi / max(abs(self.pace[0]), abs(self.pace[1]))
        self.count = int(self.turn_of(np.array([program.end]))[0]) + 1

    def turn_of(self, times: Vector) -> NDArray[np.int_]:
        """Number from 0 of the turn, of the faster of both rates, in which ``times`` (n,) s lie."""
        turn = np.floor((times - self.program.spacecraft.limits.earliest) / self.turn).astype(int)
        return np.asarray(np.maximum(turn, 0))

    def pulse(self, columns: Columns) -> NDArray[np.int_]:
        """Number of the pulse to which each column belongs: those of one channel within one turn are one."""
        return np.asarray(columns.channel * TURNS + self.turn_of(columns.t))

    def turns(self, kind: int, columns: Columns) -> Complex:
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

    def effects(self, kind: int) -> tuple[Complex, Complex]:
        """Of the channels, N m: what they do (K,), and by what inputs change it but for the rate, (K, d)."""
        one = self.uncertain
        if kind == 2:
            return one.axial.astype(complex), one.axial_torque.astype(complex)
        return one.effect, one.torque + (1j * self.pace[kind] * one.late - one.less) * one.effect[:, None]

    def rates(self, kind: int) -> Vector:
        """By what inputs change the rate at which effects turn, (d,) rad/s."""
        return self.uncertain.rates[kind] if kind < 2 else np.zeros(len(self.uncertain.own))

    def start(self, kind: int) -> Complex:
        """By what inputs change what is left without any firing, (d,) N m s."""
        one = self.uncertain
        return one.spin.astype(complex) if kind == 2 else one.begin[kind] + one.less * self.goal[kind]

    def plain(self, limit: Limit, u: complex) -> Tangent:
        """The tangent in a direction that knows of no dispersion."""
        count = len(self.uncertain.own)
        return Tangent(limit, complex(u), np.zeros(count), np.zeros((0, 1 + count)))

    def row(self, tangent: Tangent, columns: Columns, margin: float) -> Vector:
        """What a second of each column adds to a tangent, N m, (n,)."""
        kind = tangent.limit.kind
        effects, changes = self.effects(kind)
        effect = effects[columns.channel]
        total = effect + margin * (changes @ tangent.shared)[columns.channel]
        rate = float(self.rates(kind) @ tangent.shared)
        if rate:
            total = total + margin * 1j * rate * columns.t * effect
        if len(tangent.own):
            pulses = self.pulse(columns)
            at = np.searchsorted(tangent.own[:, 0], pulses)
            known = (at < len(tangent.own)) & (tangent.own[np.minimum(at, len(tangent.own) - 1), 0] == pulses)
            weights = tangent.own[at[known], 1:]
            total[known] += margin * (changes[columns.channel[known]] * weights).sum(axis=1)
        return np.asarray((np.conj(tangent.u) * self.turns(kind, columns) * total).real)

    def right(self, tangent: Tangent, margin: float) -> float:
        """What the columns of a tangent may add up to, N m s."""
        kind = tangent.limit.kind
        taken = (np.conj(tangent.u) * (margin * self.start(kind) @ tangent.shared - self.goal[kind])).real
        return float(tangent.limit.most - taken)

    def left(self, columns: Columns, on_times: Vector) -> Complex:
        """What is left of nutation, shift and spin, (3,) N m s."""
        each = [self.turns(kind, columns) * self.effects(kind)[0][columns.channel] @ on_times for kind in range(3)]
        return np.asarray(np.array(each, dtype=np.complex128) - self.goal)

    def spread(self, kind: int, columns: Columns, on_times: Vector) -> Spread:
        """What one sigma of each input leaves, N m s, after columns have been on for ``on_times`` (n,) s."""
        shared = ~self.uncertain.own
        effect, changed = (part[columns.channel] for part in self.effects(kind))
        each = (self.turns(kind, columns) * on_times)[:, None]
        changed = changed + 1j * columns.t[:, None] * effect[:, None] * self.rates(kind)
        total: Complex = np.where(shared, (each * changed).sum(axis=0) + self.start(kind), 0j)
        pulses, at = np.unique(self.pulse(columns), return_inverse=True)
        own = np.zeros((len(pulses), len(shared)), dtype=complex)
        np.add.at(own, at, np.where(shared, 0.0, each * changed))
        return Spread(total, pulses, own)

    def weights(self, kind: int, channel: int, priced: Sequence[tuple[Tangent, float]], margin: float) -> Weights:
        """What a second of a channel is worth by tangents of one kind and their prices."""
        effects, changes = (part[channel] for part in self.effects(kind))
        fixed = rate = 0j
        own = np.zeros(self.count, dtype=complex)
        for one, price in priced:
            if one.limit.kind != kind:
                continue
            weight = price * np.conj(one.u)
            fixed += weight * (effects + margin * changes @ one.shared)
            rate += weight * margin * 1j * (self.rates(kind) @ one.shared) * effects
            pulses = one.own[:, 0].astype(int)
            mine = pulses // TURNS == channel
            own[pulses[mine] % TURNS] += weight * margin * (one.own[mine, 1:] @ changes)
        return Weights(complex(fixed), complex(rate), own)
