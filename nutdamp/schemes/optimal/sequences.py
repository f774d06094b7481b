"""Sequences of pulses flown many at a time: what each leaves of the equations, costs, and has to keep."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from nutdamp import work
from nutdamp.dynamics import make_dynamics
from nutdamp.physics import attitude, rigid_cases
from nutdamp.schemes.optimal import residual_equations
from nutdamp.schemes.optimal.residual_equations import Equations
from nutdamp.spacecraft import Channel, Spacecraft, Vector

Indices = NDArray[np.int_]

SIDES = 32
"""Sides of the polygon within which H may end off its target, where it may."""

DIFFERENCE = 1e-6
"""Step of the difference quotients, in scaled unknowns."""

FLIGHT, CASE = 0.05, 0.0003
"""Units of `work` of a stretch of a flight of many sequences, and of each of them."""


@dataclass(frozen=True, eq=False)
class Sequences:
    """``which`` (b, n): the channels of b sequences of n pulses, by number.

    ``begins`` and ``ends`` (b, n) s: the window of each pulse; ``shortest`` and ``longest`` (b, n) s: its on-time.
    """

    which: Indices
    begins: Vector
    ends: Vector
    shortest: Vector
    longest: Vector

    def of(self, rows: Any) -> Self:
        """Some of the sequences."""
        return type(self)(*(getattr(self, field.name)[rows] for field in fields(self)))


class Task:
    """What is to be done by ``channels`` at ``costs`` per second, see `Equations`; H may end ``off`` N m s off target.

    Unknowns x (b, 2n) of a sequence are the starts of its pulses, then their on-times, s; two more where H may end
    off its target: how far, over ``off``.
    """

    def __init__(
        self, body: Spacecraft, equations: Equations, channels: tuple[Channel, ...], costs: Vector, off: float = 0.0
    ) -> None:
        self.body, self.channels, self.costs = body, channels, costs
        self.chosen = equations.chosen
        self.torques = np.array([channel.torque for channel in channels])
        self.off = off if equations.shift else 0.0
        self.loose = 2 if self.off > 0.0 else 0
        self.momentum = float(np.linalg.norm(body.momentum))
        self.spin = body.spin if body.goal.spin is None else body.goal.spin
        size = max(body.least_impulse, body.turning_impulse, body.inertia.C * abs(self.spin - body.spin))
        self.unit = size / np.linalg.norm(self.torques, axis=1)
        """s of each channel that are worth all there is to do"""
        self.least = float(np.min(costs * self.unit))
        self.pace = min(1.0 / abs(body.spin), body.inertial_period)
        dynamics, start = make_dynamics(body), body.initial
        self._forced = dynamics.constant, dynamics.forcing
        self._coasting = np.zeros(3), dynamics.forcing._replace(turning=())
        self._start = np.asarray(dynamics.moments, dtype=float), start.rates, start.quaternion
        self._target, self._across = body.target_axis, residual_equations.square_to_target(body)

    def misses(self, which: Indices, x: Vector, kicks: int) -> Vector:
        """What the flights of ``x`` (b, …) leave of the equations, (b, equations), over |H|.

        Pulses act as so many ``kicks`` spread over them, without disturbances; 0 is the true motion.
        """
        parts = [slice(begin, begin + rigid_cases.BLOCK) for begin in range(0, len(x) or 1, rigid_cases.BLOCK)]
        return np.concatenate([self._misses(which[part], x[part], kicks) for part in parts])

    def _misses(self, which: Indices, x: Vector, kicks: int) -> Vector:
        count, n = which.shape
        work.spend(n * (max(kicks, 1) + 1) * (FLIGHT + CASE * count))
        moments, rates, turn = (np.repeat(part[:, None], count, axis=1) for part in self._start)
        bodies = rigid_cases.Bodies(moments, *(self._coasting if kicks else self._forced))
        now = np.zeros(count)
        for pulse in range(n):
            begin, on_time, torque = x[:, pulse], x[:, n + pulse], self.torques[which[:, pulse]].T
            for kick in range(kicks):
                t = begin + on_time * ((kick + 0.5) / kicks)
                rigid_cases.advance(rigid_cases.Stretch(bodies, now, rates, turn), t - now)
                rates += torque * (on_time / kicks) / moments
                now = t
            if not kicks:
                rigid_cases.advance(rigid_cases.Stretch(bodies, now, rates, turn), begin - now)
                rigid_cases.advance(rigid_cases.Stretch(bodies, begin, rates, turn, torque), on_time)
                now = begin + on_time
        momentum = rates * moments
        inertial = attitude.rotate(turn.T, momentum.T)
        shift = inertial @ self._across.T
        shift[inertial @ self._target < 0.0] += self.momentum  # the other way round is no solution
        if self.loose:
            shift = shift - self.off * x[:, -2:]
        every = np.column_stack([momentum[:2].T, shift, self.body.inertia.C * (rates[2] - self.spin)])
        return np.asarray(every[:, self.chosen] / self.momentum)

    def slopes(self, which: Indices, x: Vector, scale: Vector, here: Vector, kicks: int) -> Vector:
        """What the unknowns in units of ``scale`` (b, …) change in the misses, ``here`` now: (b, equations, …)."""
        number = x.shape[1]
        moved = x[:, None, :] + DIFFERENCE * scale[:, None, :] * np.eye(number)
        there = self.misses(np.repeat(which, number, axis=0), moved.reshape(-1, number), kicks)
        changes = there.reshape(*moved.shape[:2], len(self.chosen)) - here[:, None, :]
        return np.swapaxes(changes, 1, 2) / DIFFERENCE

    def price(self, which: Indices, on: Vector) -> Vector:
        """What sequences cost with on-times ``on`` (…, n) s."""
        return np.asarray(np.sum(self.costs[which] * on, axis=-1))

    def scale(self, which: Indices) -> Vector:
        """Natural sizes of the unknowns, (b, …)."""
        count, n = which.shape
        return np.hstack([np.full((count, n), self.pace), self.unit[which], np.ones((count, self.loose))])

    def bounds(self, sequences: Sequences) -> tuple[Vector, Vector]:
        """Rows (r, …) and levels (b, r): rows @ x >= levels keeps gap, windows, on-times and ``off``."""
        count, n = sequences.which.shape
        one, none = np.eye(n), np.zeros((n, n))
        after = one - np.eye(n, k=-1)
        rows = [
            np.hstack([after, -np.eye(n, k=-1)])[1:],
            np.hstack([one, none]),
            np.hstack([-one, -one]),
            np.hstack([none, one]),
            np.hstack([none, -one]),
        ]
        levels = [np.full((count, n - 1), self.body.limits.gap), sequences.begins, -sequences.ends]
        levels += [sequences.shortest, -sequences.longest]
        matrix = np.vstack(rows)
        if self.loose:
            angles = 2 * math.pi / SIDES * np.arange(SIDES)
            sides = np.hstack([np.zeros((SIDES, 2 * n)), -np.column_stack([np.cos(angles), np.sin(angles)])])
            matrix = np.vstack([np.hstack([matrix, np.zeros((len(matrix), 2))]), sides])
            levels.append(np.full((count, SIDES), -math.cos(math.pi / SIDES)))
        return matrix, np.hstack(levels)
