"""Least-cost firing of body-fixed channels as a linear program over channels and firing times.

With impulses J >= 0 along directions d_c at times t, small angles:
Σ J d_c e^{iaω3t} = -Aω0 (no nutation left; exact at any angle) and Σ J d_c e^{iω3t} = Δh (shift of H, first order).
Time is cut into slots in which a channel can give at most its torque times the slot, so that long burns and what their
width loses come out right. Slots enter the program by their price: four equations need few of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.spacecraft import Channel, Spacecraft, Vector

SLOTS = 64
"""Slots in the faster of the two turns, at ω3 and at aω3."""

MOST_SLOTS = 400_000
"""Slots of all channels together: a horizon of more is looked at as far as they reach."""

SLACK_COST = 1e3
"""Cost of what no slot supplies, over the dearest channel's: used only where there is no solution."""

PRICE = 1e-7
"""Relative reduced cost below which a slot cannot lower the cost any more."""

BEST = 300
"""Slots taken in per round, the best priced first."""

ROUNDS = 60


PEAK = 0.05
"""Peaks of the price this far below zero are looked at more closely between the centres of slots."""


class Column(NamedTuple):
    """One unknown of the program: an impulse of a channel at ``t`` s, spread over ``width`` s (0: none)."""

    channel: int
    t: float
    width: float


@dataclass(frozen=True, slots=True)
class Burn:
    """Neighbouring slots of one channel taken together: centre and on-time in s."""

    channel: Channel
    t: float
    on_time: float


@dataclass(frozen=True, slots=True)
class Solution:
    """Burns of least ``cost`` in time order; ``unmet`` is what the slots could not supply, over A|ω0|."""

    burns: tuple[Burn, ...]
    cost: float
    unmet: float


@dataclass(eq=False)
class Program:
    """The linear program of one spacecraft.

    ``costs`` (channels,) of one N m s each. ``momentum``: H is to shift by ``target`` (2,) N m s along e1(0), e2(0);
    else wherever it likes. ``ideal``: channels give any impulse at any moment, which no real one can do cheaper.
    ``haste`` is by how much (relatively) the end of the horizon seems dearer than its beginning: among equals the
    early moments are taken. ``forbidden`` (channels, slots) marks slots that may not be used.
    """

    spacecraft: Spacecraft
    channels: tuple[Channel, ...]
    costs: Vector
    momentum: bool = True
    target: Vector = field(default_factory=lambda: np.zeros(2))
    ideal: bool = False
    haste: float = 0.0
    width: float = field(init=False)
    centres: Vector = field(init=False)
    forbidden: NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        body = self.spacecraft
        nutation, spin = body.inertia.a * body.spin, body.spin
        limits = body.limits
        slot = 2 * math.pi / max(abs(nutation), abs(spin)) / SLOTS
        horizon = min(body.horizon, limits.earliest + MOST_SLOTS // len(self.channels) * slot)
        count = max(math.ceil((horizon - limits.earliest) / slot), 1)
        edges = np.linspace(limits.earliest, horizon, count + 1)
        self.width = float(edges[1] - edges[0])
        self.centres = 0.5 * (edges[1:] + edges[:-1])
        blocked = np.zeros(count, dtype=bool)
        for begins, ends in limits.blackout:
            blocked |= (edges[:-1] < ends) & (edges[1:] > begins)
        self.forbidden = np.tile(blocked, (len(self.channels), 1))
        # What a slot loses to its width on each of the two equations.
        losses = np.sinc(np.array([nutation, spin]) * self.width / (2 * math.pi))
        phases = np.exp(1j * np.outer([nutation, spin], self.centres)) * losses[:, None]
        self._phases = phases if self.momentum else phases[:1]
        self._rates = np.array([nutation, spin][: len(self._phases)])
        torques = np.array([channel.transverse for channel in self.channels])
        self._strength = np.abs(torques)
        self._directions = torques / self._strength
        start = -body.inertia.A * complex(body.omega0[0], body.omega0[1])
        self._scale = abs(start)
        self._goal = np.array([start.real, start.imag, *self.target][: 2 * len(self._phases)]) / self._scale
        # A channel that gives all that is needed within one slot fires impulses, at any moment.
        self._strong = self._strength * (np.inf if self.ideal else self.width) > self._scale

    def solve(self) -> Solution:
        """Least cost over what is not forbidden, by column generation."""
        from scipy.optimize import linprog  # here, because it takes longer to load than most plans

        dearest = float(np.max(self.costs))
        taken = set(self._first())
        slack = np.hstack([np.eye(len(self._goal)), -np.eye(len(self._goal))])
        for _ in range(ROUNDS):
            columns = sorted(taken)
            channels = np.array([column.channel for column in columns], dtype=int)
            times, widths = np.array([(column.t, column.width) for column in columns]).reshape(-1, 2).T
            cost = np.concatenate(
                [self.costs[channels] / dearest * self._dearness(times), np.full(slack.shape[1], SLACK_COST)]
            )
            most = np.where(widths > 0.0, self._strength[channels] * self.width / self._scale, np.inf)
            bounds = np.column_stack([np.zeros(len(cost)), np.concatenate([most, np.full(slack.shape[1], np.inf)])])
            matrix = np.hstack([self._coefficients(channels, times, widths), slack])
            found = linprog(cost, A_eq=matrix, b_eq=self._goal, bounds=bounds.tolist(), method="highs-ds")
            if not found.success:
                raise RuntimeError(f"the linear program ended with: {found.message}")
            new = set(self._priced(np.asarray(found.eqlin.marginals), dearest)) - taken
            if not new:
                break
            taken |= new
        amounts = np.asarray(found.x)[: len(columns)] * self._scale
        return Solution(
            self._burns(channels, times, amounts),
            float(self.costs[channels] @ amounts),
            float(np.asarray(found.x)[len(columns) :].sum()),
        )

    def _dearness(self, times: Vector) -> Vector:
        return 1.0 + self.haste * times / float(self.centres[-1])

    def _coefficients(self, channels: NDArray[np.int_], times: Vector, widths: Vector) -> Vector:
        """What one unit of each column does in the equations, (equations, n)."""
        rates = self._rates[:, None]
        losses = np.sinc(rates * widths / (2 * math.pi))
        turned = self._directions[channels] * np.exp(1j * rates * times) * losses
        return np.vstack([part for row in turned for part in (row.real, row.imag)])

    def _first(self) -> list[Column]:
        """A coarse start: every eighth slot that may be used."""
        return [
            self._column(int(channel), int(slot))
            for channel, slot in np.argwhere(~self.forbidden)
            if slot % (SLOTS // 8) == 0
        ]

    def _column(self, channel: int, slot: int) -> Column:
        return Column(channel, float(self.centres[slot]), 0.0 if self._strong[channel] else self.width)

    def _priced(self, duals: Vector, dearest: float) -> list[Column]:
        """Columns worth more than they cost: whole slots of a weak channel, the best moments of a strong one."""
        weights = duals[0::2] - 1j * duals[1::2]
        gain = (self._directions[:, None] * (weights @ self._phases)).real
        gain -= (self.costs / dearest)[:, None] * self._dearness(self.centres)
        gain[self.forbidden] = -np.inf
        best = np.argsort(gain.ravel())[::-1][:BEST]
        weak = [divmod(int(index), gain.shape[1]) for index in best if gain.ravel()[index] > PRICE]
        found = [self._column(channel, slot) for channel, slot in weak if not self._strong[channel]]
        for channel in np.flatnonzero(self._strong):
            padded = np.concatenate([[-np.inf], gain[channel], [-np.inf]])
            peaks = np.flatnonzero(
                (padded[1:-1] >= padded[:-2]) & (padded[1:-1] >= padded[2:]) & np.isfinite(gain[channel])
            )
            tops = peaks[gain[channel][peaks] > -PEAK]
            times = self._climb(weights, int(channel), self.centres[tops])
            worth = self._worth(weights, int(channel), times)[0]
            worth = worth - self.costs[channel] / dearest * self._dearness(times)
            order = np.argsort(worth)[::-1][:BEST]
            found += [Column(int(channel), float(times[i]), 0.0) for i in order if worth[i] > PRICE]
        return found

    def _worth(self, weights: NDArray[np.complex128], channel: int, times: Vector) -> tuple[Vector, Vector, Vector]:
        """What an impulse is worth at ``times`` by the duals, with its first and second derivative."""
        rates = self._rates[:, None]
        terms = weights[:, None] * self._directions[channel] * np.exp(1j * rates * times)
        return (
            np.asarray(terms.sum(axis=0).real),
            np.asarray((1j * rates * terms).sum(axis=0).real),
            np.asarray((-(rates**2) * terms).sum(axis=0).real),
        )

    def _climb(self, weights: NDArray[np.complex128], channel: int, times: Vector) -> Vector:
        """Moments near ``times``, each within its slot, at which the worth is largest."""
        low, high = times - 0.5 * self.width, times + 0.5 * self.width
        for _ in range(4):
            _, slope, bend = self._worth(weights, channel, times)
            newton = np.where(bend < 0.0, -slope / np.where(bend < 0.0, bend, 1.0), np.sign(slope) * self.width)
            times = np.clip(times + newton, low, high)
        return times

    def _burns(self, channels: NDArray[np.int_], times: Vector, amounts: Vector) -> tuple[Burn, ...]:
        """Neighbouring columns of a channel as one burn about their common centre."""
        burns: list[Burn] = []
        for index, channel in enumerate(self.channels):
            mine = np.flatnonzero((channels == index) & (amounts > 1e-12 * self._scale))
            if not len(mine):
                continue
            apart = np.flatnonzero(np.diff(times[mine]) > 1.01 * self.width) + 1
            for group in np.split(mine, apart):
                total = float(amounts[group].sum())
                centre = float(amounts[group] @ times[group]) / total
                burns.append(Burn(channel, centre, total / float(self._strength[index])))
        return tuple(sorted(burns, key=lambda burn: burn.t))

    def forbid(self, channel: Channel | None, start: float, end: float) -> None:
        """Forbid the slots of a channel (of all channels) that lie within ``start`` to ``end`` s."""
        inside = (self.centres > start) & (self.centres < end)
        rows = slice(None) if channel is None else self.channels.index(channel)
        self.forbidden[rows, inside] = True

    def keep(self, burns: Sequence[Burn]) -> None:
        """Forbid all slots but those about ``burns``, which may grow by an eighth of the faster turn on each side."""
        kept = np.zeros_like(self.forbidden)
        for burn in burns:
            reach = 0.5 * burn.on_time + SLOTS // 8 * self.width
            kept[self.channels.index(burn.channel)] |= np.abs(self.centres - burn.t) < reach
        self.forbidden |= ~kept
