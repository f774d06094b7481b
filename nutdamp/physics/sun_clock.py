"""Sun pulses of nutating bodies and what fires from them, many at once: each pulse moves the Sun pulses after it.

A Sun pulse comes when the Sun passes the azimuth of the sensor in the body: as the body moves, not as it would without
nutation. Arrays carry the case last, as in `rigid_cases`, by which everything moves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.physics.rigid_cases import Stretch

Array = NDArray[np.float64]

ITERATIONS = 40
"""Newton steps by which a Sun pulse is found, at most; three or four are usual."""

EXACT = 1e-13
"""Share of a spin turn to which it is found."""

AHEAD = 8
"""Sun pulses after which the next one is looked for, at most: from there on it is foreseen by the mean rate."""

CIRCLE = 2.0 * math.pi


class Push(NamedTuple):
    """Torque that runs evenly from ``first`` (3, n) N m at ``begin`` s to ``last`` at ``end``; times (n,) or one."""

    begin: Any
    end: Any
    first: Array
    last: Array


class SunClock:
    """Bodies on their way from Sun pulse to Sun pulse, which count from 1, the first after t = 0.

    ``sun`` (3, n) are inertial unit vectors, ``azimuth`` rad is that of the sensor about axis 3 from axis 1, ``sense``
    the sign of the spin. ``time`` (n,) s is that of the last Sun pulse looked for, ``lost`` (n,) where there was none:
    the Sun is too near to the axis to go round in the body. ``over`` (n,) s: when the last pulse, command and
    thrust, is over.
    """

    def __init__(self, start: Stretch, sun: Array, sense: float, azimuth: float) -> None:
        self.sun, self.sense, self.azimuth = sun, sense, azimuth
        self._stretches, self.over = [start], start.since
        ahead, _ = self._ahead(start, sun)
        self._number, self.time = 0, start.since + (ahead - CIRCLE) / self._pace  # as if one had come before t = 0
        self.lost = np.zeros(len(start.since), dtype=bool)

    @property
    def here(self) -> Stretch:
        """The motion since the last pulse was over."""
        return self._stretches[-1]

    @property
    def passed(self) -> Iterator[tuple[Stretch, Array]]:
        """The motion from the end of the last pulse but one to that of the last, each stretch with its end."""
        return zip(self._stretches, (one.since for one in self._stretches[1:]), strict=False)

    def fire(
        self, found: Stretch, delay: Array, width: float, pushes: Sequence[Push], sheds: Array | None = None
    ) -> Array:
        """Fire a command of ``width`` s, the ``delay`` (n,) s after the Sun pulse ``found``, the last one.

        ``pushes`` are the torques that follow it, s after its start; the moments fall by ``sheds`` (3, n) kg m², half
        as the first begins. Returns the starts (n,) s of the commands: not before the pulse before is over.
        """
        before, half = self.here, None if sheds is None else 0.5 * sheds
        starts = np.maximum(found.since + delay, self.over)
        lasts: Any = width
        for push in pushes:
            lasts = np.maximum(lasts, push.end)
        self.over = starts + lasts
        if not pushes:
            return starts
        begun = found.moved(starts + pushes[0].begin)
        late = np.flatnonzero(found.since < before.since)  # it came while the pulse before was on
        if len(late):
            again = before.some(late).moved(begun.since[late])
            begun.rates[:, late], begun.quaternion[:, late] = again.rates, again.quaternion
        begun = begun._replace(bodies=before.bodies.lighter(half))
        self._stretches = [before]
        for push in pushes:
            length = np.where(push.end - push.begin == 0.0, 1.0, push.end - push.begin)
            slope = None if np.array_equal(push.first, push.last) else (push.last - push.first) / length
            firing = begun._replace(since=starts + push.begin, torque=push.first, slope=slope)
            begun = firing.moved(starts + push.end)._replace(torque=None, slope=None)
            self._stretches.append(firing)
        self._stretches.append(begun._replace(bodies=begun.bodies.lighter(half)))
        return starts

    def sun_pulse(self, number: int) -> Stretch:
        """The motion as the Sun pulse of this ``number`` comes, if nothing is fired before; none goes back."""
        found = self.here
        while self._number < number:
            step = min(number - self._number, AHEAD)
            pace, (ahead, _) = self._pace, self._ahead(self.here, self.sun)
            passed = np.rint((pace * (self.here.since - self.time) + ahead) / CIRCLE)
            expected = self.here.since + (ahead + CIRCLE * (step - passed)) / pace
            found = self._root(self.here.moved(expected), pace, self.sun)
            self._look_back(found, expected, pace)
            off, rate = self._off(found, self.sun)
            astray = np.abs(found.since - expected) * pace > math.pi
            self.lost |= astray | (rate <= 0.0) | ~(np.abs(off) < 1e-6)
            self._number, self.time = self._number + step, found.since
        return found

    def angle(self, here: Stretch) -> Array:
        """Between spin axis and Sun, (n,) rad."""
        w, x, y, z = here.quaternion
        axis = self.sense * np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])
        across = np.linalg.norm(np.cross(axis, self.sun, axis=0), axis=0)
        return np.asarray(np.arctan2(across, np.sum(axis * self.sun, axis=0)))

    @property
    def _pace(self) -> Array:
        """Mean rate (n,) rad/s at which the Sun goes round in the free body.

        The body turns about H at |H|/A, and about its axis at aω3: together, and at small angles, at ω3.
        """
        first, second, C = self.here.bodies.moments
        A, spin = 0.5 * (first + second), self.here.rates[2]
        size = np.sqrt(np.sum((self.here.bodies.moments * self.here.rates) ** 2, axis=0))
        return np.asarray(np.abs(self.sense * size / A + (1.0 - C / A) * spin))

    def _look_back(self, found: Stretch, expected: Array, pace: Array) -> None:
        """Where a Sun pulse came before the last pulse was over, look again in the motion then, in place."""
        for stretch, over in zip(self._stretches[-2::-1], self._stretches[:0:-1], strict=True):
            cases = np.flatnonzero(found.since < over.since)
            if not len(cases):
                return
            start = stretch.some(cases).moved(np.minimum(expected, over.since)[cases])
            again = self._root(start, pace[cases], self.sun[:, cases])
            for whole, part in zip(found[1:4], again[1:4], strict=True):
                whole[..., cases] = part

    def _root(self, start: Stretch, pace: Array, sun: Array) -> Stretch:
        """The motion as the Sun passes the sensor, at the moment next to that of ``start``: by Newton's method."""
        here = start
        for _ in range(ITERATIONS):
            off, rate = self._off(here, sun)
            # Where the Sun is near the axis its azimuth may not change for a moment: then by the mean rate.
            here = here.moved(here.since + off / np.where(rate > 0.1 * pace, rate, pace))
            if np.all(np.abs(off) < CIRCLE * EXACT):
                break
        return here

    def _off(self, here: Stretch, sun: Array) -> tuple[Array, Array]:
        """By what angle (n,) in [-π, π) the body has to turn until the Sun passes the sensor, and at what rate."""
        ahead, rate = self._ahead(here, sun)
        return (ahead + math.pi) % CIRCLE - math.pi, rate

    def _ahead(self, here: Stretch, sun: Array) -> tuple[Array, Array]:
        """The same in [0, 2π)."""
        return ahead(here.rates, here.quaternion, sun, self.azimuth, self.sense)


def ahead(rates: Array, quaternion: Array, sun: Array, azimuth: float, sense: float) -> tuple[Array, Array]:
    """By what angle (n,) in [0, 2π) bodies have to turn until the Sun passes the sensor, and at what rate, rad/s.

    ``rates`` (3, n) rad/s, ``quaternion`` (4, n) body -> inertial, ``sun`` (3, n) inertial unit vectors; ``azimuth``
    rad and ``sense`` are those of a `SunClock`.
    """
    w, x, y, z = quaternion
    s1, s2, s3 = sun
    # The Sun as the body sees it: turned by the conjugate quaternion.
    i, j, k = z * s2 - y * s3, x * s3 - z * s1, y * s1 - x * s2
    s1, s2, s3 = (
        s1 + 2.0 * (w * i + z * j - y * k),
        s2 + 2.0 * (w * j + x * k - z * i),
        s3 + 2.0 * (w * k + y * i - x * j),
    )
    first, second, third = rates
    turning = s1 * (s3 * first - s1 * third) - s2 * (s2 * third - s3 * second)  # ds/dt = s × ω
    return sense * (np.arctan2(s2, s1) - azimuth) % CIRCLE, -sense * turning / (s1 * s1 + s2 * s2)
