"""How near the spin axis comes to directions in space, and how far from them, in many cases at once.

On a free arc of a symmetric body the axis goes round H on a cone: with H at the angle β from the direction and the
axis at θ from H it comes as near as |β - θ| and as far as β + θ, if it goes so far round. Where dissipation changes θ
those turns that count are followed in steps, and any other motion all the way. Arrays carry the case last, as in
`rigid_cases`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.physics.rigid_cases import Stretch

Array = NDArray[np.float64]

ROWS = 24
"""Steps in each turn of the axis, where it is followed in steps."""

SECANTS = 2
"""Steps of the secant method to the moment between two steps at which the axis is nearest or farthest."""

CIRCLE = 2.0 * math.pi


@dataclass(frozen=True, slots=True, eq=False)
class AxisWatch:
    """The ``least`` and the ``largest`` angles (m, n) rad so far between the spin axis and ``directions`` (m, 3, n).

    The directions are inertial unit vectors. ``sense`` is the sign of the spin; ``rows``: which of the n cases those
    are that are given to it.
    """

    directions: Array
    least: Array
    largest: Array
    sense: float
    rows: Any = ...

    @classmethod
    def of(cls, directions: Array, sense: float) -> AxisWatch:
        """One that has seen nothing yet."""
        shape = len(directions), directions.shape[2]
        return cls(directions, np.full(shape, math.pi), np.zeros(shape), sense)

    @property
    def angles(self) -> Array:
        """Least and largest, (m, 2, n)."""
        return np.stack([self.least, self.largest], axis=1)

    def some(self, cases: Any) -> AxisWatch:
        """That of some of the cases (an index of arrays), to which it adds what it sees of them."""
        rows = np.arange(self.least.shape[1])[self.rows][cases]
        return AxisWatch(self.directions, self.least, self.largest, self.sense, rows)

    def motion(self, here: Stretch, duration: Array) -> None:
        """Take the motion that `rigid_cases.advance` makes with these arguments, which stay as they are."""
        bodies = here.bodies
        if here.torque is not None or not bodies.free:
            self._steps(here, duration)
        elif bodies.forcing.growth == 0.0:
            self._arc(bodies.moments, here.rates, here.quaternion, duration)
        else:
            self._slow(here, duration)

    def turn(self, here: Stretch) -> None:
        """Take one turn of the axis about H in a motion free of pulses."""
        first, second, _ = here.bodies.moments
        self.motion(here, CIRCLE * 0.5 * (first + second) / _momentum(here))

    def _take(self, number: int, least: Array, largest: Array, cases: Any = ...) -> None:
        rows = np.arange(self.least.shape[1])[self.rows][cases]
        self.least[number, rows] = np.minimum(self.least[number, rows], least)
        self.largest[number, rows] = np.maximum(self.largest[number, rows], largest)

    def _arc(self, moments: Array, rates: Array, quaternion: Array, duration: Array) -> None:
        """Begin and inner extremes of arcs; their ends are where others begin."""
        momentum, axis = _rotated(quaternion, moments * rates), self._axis(quaternion)
        size = np.sqrt(np.sum(momentum * momentum, axis=0))
        momentum, way = momentum / size, size / moments[0] * duration
        theta = _angles(momentum, axis)
        for number, direction in enumerate(self.directions[:, :, self.rows]):
            begins, beta = _angles(axis, direction), _angles(momentum, direction)
            along = np.sum(axis * direction, axis=0) - np.cos(theta) * np.cos(beta)
            ahead = np.sum(np.cross(momentum, axis, axis=0) * direction, axis=0)
            nearest = np.arctan2(ahead, along) % CIRCLE  # how far round from where it is the axis comes nearest
            farthest = (nearest + math.pi) % CIRCLE
            least, largest = np.abs(beta - theta), np.minimum(beta + theta, CIRCLE - beta - theta)
            self._take(number, np.where(way >= nearest, least, begins), np.where(way >= farthest, largest, begins))

    def _slow(self, here: Stretch, duration: Array) -> None:
        """Arcs with dissipation, of which the first turn and the last are followed in steps.

        H stays and θ grows, or falls, all the way: between those turns so do |β - θ| and β + θ, unless θ passes β or
        π - β, where all turns are followed.
        """
        turn = CIRCLE * here.bodies.moments[0] / _momentum(here)
        last = here.moved(here.since + np.maximum(duration - turn, 0.0))
        momentum = _rotated(here.quaternion, here.bodies.moments * here.rates)
        before, after = (_angles(momentum, self._axis(one.quaternion)) for one in (here, last))
        betas = np.array([_angles(momentum, one) for one in self.directions[:, :, self.rows]])
        passed = [(before - one) * (after - one) <= 0.0 for one in (*betas, *(math.pi - betas))]
        whole = (duration <= 2.0 * turn) | np.any(passed, axis=0)
        for cases, begins, lasts in ((whole, here, duration), (~whole, here, turn), (~whole, last, turn)):
            if cases.any():
                self.some(cases)._steps(begins.some(cases), lasts[cases])

    def _steps(self, here: Stretch, duration: Array) -> None:
        """Begin and end of each step, and extremes between them."""
        first, second, _ = here.bodies.moments
        pace = _momentum(here) / np.minimum(first, second)
        if not np.array_equal(first, second):
            pace = pace + np.abs(here.rates[2])
        count = max(math.ceil(float(np.max(pace * duration)) * ROWS / CIRCLE), 1)
        begin, step, nearing = here.since, duration / count, self._look(here, ...)
        for index in range(count):
            then, before, here = here, nearing, here.moved(begin + (index + 1) * step)
            nearing = self._look(here, ...)
            for number, (rise, fall) in enumerate(zip(before, nearing, strict=True)):
                cases = np.flatnonzero(rise * fall < 0.0)  # in between the axis comes nearest, or goes farthest
                if len(cases):
                    self._between(then.some(cases), step[cases], (rise[cases], fall[cases]), number, cases)

    def _between(self, then: Stretch, step: Array, rates: tuple[Array, Array], number: int, cases: Any) -> None:
        """Extremes between the ends of a step, by `SECANTS` from the rates (nearer, farther) there of one direction."""
        begin, end, (rise, fall) = np.zeros_like(step), step, rates
        for _ in range(SECANTS):
            way = begin + (end - begin) * rise / (rise - fall)
            here = self._look(then.moved(then.since + way), cases)[number]
            before = here * rise > 0.0
            begin, rise = np.where(before, way, begin), np.where(before, here, rise)
            end, fall = np.where(before, end, way), np.where(before, fall, here)

    def _look(self, here: Stretch, cases: Any) -> list[Array]:
        """Take the angles of one moment; returns at what rate the axis comes nearer, in cosines by s."""
        bodies, quaternion = here.bodies, here.quaternion
        axis, (first, second, _) = self._axis(quaternion), here.rates
        moving = self.sense * _rotated(quaternion, np.array([second, -first, np.zeros_like(first)]))  # ω × e3
        if bodies.forcing.growth != 0.0:  # the axis leaves H at θ' = κ sin θ cos θ
            momentum = _rotated(quaternion, bodies.moments * here.rates)
            momentum /= np.sqrt(np.sum(momentum * momentum, axis=0))
            cosine = np.sum(momentum * axis, axis=0)
            moving = moving + bodies.forcing.growth * cosine * (cosine * axis - momentum)
        nearing = []
        for number, directions in enumerate(self.directions[:, :, self.rows]):
            direction = directions[:, cases]
            angles = _angles(axis, direction)
            self._take(number, angles, angles, cases)
            nearing.append(np.asarray(np.sum(moving * direction, axis=0)))
        return nearing

    def _axis(self, quaternion: Array) -> Array:
        w, x, y, z = quaternion
        return self.sense * np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])


def _momentum(here: Stretch) -> Array:
    """Size (n,) of H, N m s."""
    return np.asarray(np.sqrt(np.sum((here.bodies.moments * here.rates) ** 2, axis=0)))


def _rotated(quaternion: Array, vector: Array) -> Array:
    """Vectors (3, n) turned by unit quaternions (4, n)."""
    w, axis = quaternion[0], quaternion[1:]
    once = np.cross(axis, vector, axis=0)
    return np.asarray(vector + 2.0 * (w * once + np.cross(axis, once, axis=0)))


def _angles(first: Array, second: Array) -> Array:
    """Angles (n,) between vectors (3, n), exact to rounding from 0 to π."""
    across = np.cross(first, second, axis=0)
    return np.asarray(np.arctan2(np.sqrt(np.sum(across * across, axis=0)), np.sum(first * second, axis=0)))
