"""Command blocks in dispersed cases: each case fires from the Sun pulses of its own nutating body, many at once.

What `schemes.tools.sun_pulses` does for one body, vectorised over cases: a pulse begins its delay after a Sun pulse,
which comes when the Sun passes the azimuth of the sensor as that case moves, and each pulse moves the Sun pulses after
it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.cases import DispersedCases, Model, rotated
from nutdamp.physics import attitude, rigid_cases
from nutdamp.physics.rigid_cases import Bodies, advance

Array = NDArray[np.float64]

ITERATIONS = 40
"""Newton steps by which a Sun pulse is found, at most; three or four are usual."""

EXACT = 1e-13
"""Share of a spin turn to which it is found."""

AHEAD = 8
"""Sun pulses after which the next one is looked for, at most: from there on it is foreseen by the mean rate."""

CIRCLE = 2.0 * math.pi


class Fired(NamedTuple):
    """How cases move as their last pulse ends, and what was fired.

    ``rates`` (3, n) rad/s, ``quaternion`` (4, n); ``starts`` (k, n) s of the pulses; ``seen`` (k, n): whether the
    sensor saw the Sun, without which nothing fires.
    """

    rates: Array
    quaternion: Array
    starts: Array
    seen: NDArray[np.bool_]


class Stretch(NamedTuple):
    """Motion under one ``torque`` (3, n) N m, None for a coast, from ``since`` (n,) s on."""

    since: Array
    rates: Array
    quaternion: Array
    torque: Array | None

    def some(self, cases: NDArray[np.intp]) -> Stretch:
        """That of some cases."""
        torque = None if self.torque is None else self.torque[:, cases]
        return Stretch(self.since[cases], self.rates[:, cases], self.quaternion[:, cases], torque)

    def moved(self, bodies: Bodies, times: Array) -> Stretch:
        """The same from ``times`` (n,) s on."""
        rates, quaternion = self.rates.copy(), self.quaternion.copy()
        advance(bodies, rates, quaternion, self.since, times - self.since, self.torque)
        return Stretch(times, rates, quaternion, self.torque)


def fly(model: Model, bodies: Bodies, rates: Array, quaternion: Array, cases: DispersedCases) -> Fired:
    """The pulses of the blocks of ``model``, fired in each case from its own Sun pulses.

    A pulse that is due while the one before is on begins as that ends.
    """
    count = rates.shape[1]
    made = Fired(rates.copy(), quaternion.copy(), np.empty((len(model.schedule), count)), np.empty((0, count), bool))
    seen = np.empty((len(model.schedule), count), dtype=bool)
    sun = _sun(model, cases, count)
    shifts = [start - pulse.start for start, pulse in zip(cases.starts, model.schedule, strict=True)]
    for begin in range(0, count, rigid_cases.BLOCK):
        rows = slice(begin, min(begin + rigid_cases.BLOCK, count))

        def part(value: object, rows: slice = rows) -> Array:
            return np.broadcast_to(np.asarray(value, dtype=float), count)[rows]

        flight = _Flight(model, bodies.some(rows), rates[:, rows], quaternion[:, rows], sun[:, rows])
        for index, (number, delay, width) in enumerate(commanded(model)):
            impulse = np.array([part(one) for one in cases.impulses[index]])
            found = flight.fire(number, delay + part(shifts[index]), width, impulse)
            made.starts[index, rows], seen[index, rows] = found
        made.rates[:, rows], made.quaternion[:, rows] = flight.here.rates, flight.here.quaternion
    return made._replace(seen=seen)


def commanded(model: Model) -> list[tuple[int, float, float]]:
    """Number of the Sun pulse, delay and width (s) of each pulse of the blocks, in order."""
    return [
        (number, block.delay, block.width)
        for block in model.schedule.blocks
        for number in range(block.first, block.first + block.count * block.every, block.every)
    ]


def _sun(model: Model, cases: DispersedCases, count: int) -> Array:
    """The direction to the Sun in the true body axes of t = 0, (3, n)."""
    body = model.spacecraft
    assert body.sun is not None
    estimated = attitude.rotate(attitude.conjugate(body.initial.quaternion), body.sun)
    x, y, z = estimated.tolist()
    first, second = cases.tilt
    return np.array([np.broadcast_to(part, count) for part in rotated((x, y, z), (-first, -second))])


class _Flight:
    """A block of cases on its way from Sun pulse to Sun pulse."""

    def __init__(self, model: Model, bodies: Bodies, rates: Array, quaternion: Array, sun: Array) -> None:
        sensor = model.spacecraft.sun_sensor
        assert sensor is not None
        self.bodies, self.sensor, self.sun = bodies, sensor, sun
        self.sense = math.copysign(1.0, model.spacecraft.spin)
        self.stretches = [Stretch(np.zeros(rates.shape[1]), rates, quaternion, None)]
        ahead, _ = self._ahead(self.here, sun)
        self.number, self.last = 0, (ahead - CIRCLE) / self._pace  # as if there had been one before t = 0

    @property
    def here(self) -> Stretch:
        """The motion after the last pulse."""
        return self.stretches[-1]

    @property
    def _pace(self) -> Array:
        """Mean rate (n,) rad/s, positive, at which the Sun goes round in the body: see `sun_pulses.spin_turn`."""
        first, second, C = self.bodies.moments
        A, spin = 0.5 * (first + second), self.here.rates[2]
        size = np.sqrt(np.sum((self.bodies.moments * self.here.rates) ** 2, axis=0))
        return np.asarray(np.abs(self.sense * size / A + (1.0 - C / A) * spin))

    def fire(self, number: int, delay: Array, width: float, impulse: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Fire ``impulse`` (3, n) N m s the ``delay`` (n,) s after the Sun pulse of this number: when, and where."""
        before = self.here
        found = self._sun_pulse(number)
        seen = self._sees(found)
        starts = np.maximum(self.last + delay, before.since)
        late = np.flatnonzero(found.since < before.since)  # it came while the pulse before was on
        begun = found.moved(self.bodies, starts)
        if len(late):
            again = before.some(late).moved(self.bodies.some(late), starts[late])
            begun.rates[:, late], begun.quaternion[:, late] = again.rates, again.quaternion
        torque = np.where(seen, impulse, 0.0) / width
        firing = begun._replace(torque=torque)
        after = firing.moved(self.bodies, starts + width)._replace(torque=None)
        self.stretches = [before, firing, after]
        return starts, seen

    def _sun_pulse(self, number: int) -> Stretch:
        """The motion as the Sun pulse of this ``number`` comes."""
        found = self.here
        while self.number < number:
            step = min(number - self.number, AHEAD)
            ahead, _ = self._ahead(self.here, self.sun)
            passed = np.rint((self._pace * (self.here.since - self.last) + ahead) / CIRCLE)
            expected = self.here.since + (ahead + CIRCLE * (step - passed)) / self._pace
            found = self._root(self.bodies, self.here.moved(self.bodies, expected), self._pace, self.sun)
            self._look_back(found, expected)
            self.number, self.last = self.number + step, found.since
        return found

    def _look_back(self, found: Stretch, expected: Array) -> None:
        """Where a Sun pulse came before the last pulse was over, look again in the motion then, in place."""
        for stretch, over in zip(self.stretches[-2::-1], self.stretches[:0:-1], strict=True):
            cases = np.flatnonzero(found.since < over.since)
            if not len(cases):
                return
            bodies = self.bodies.some(cases)
            start = stretch.some(cases).moved(bodies, np.minimum(expected, over.since)[cases])
            again = self._root(bodies, start, self._pace[cases], self.sun[:, cases])
            for whole, part in zip(found[:3], again[:3], strict=True):
                whole[..., cases] = part

    def _root(self, bodies: Bodies, start: Stretch, pace: Array, sun: Array) -> Stretch:
        """The motion as the Sun passes the sensor, at the moment next to that of ``start``: by Newton's method."""
        here = start
        for _ in range(ITERATIONS):
            ahead, rate = self._ahead(here, sun)
            off = (ahead + math.pi) % CIRCLE - math.pi
            # Where the Sun is near the axis its azimuth may stand still for a moment: then by the mean rate.
            step = off / np.where(rate > 0.1 * pace, rate, pace)
            here = here.moved(bodies, here.since + step)
            if np.all(np.abs(off) < CIRCLE * EXACT):
                break
        return here

    def _ahead(self, here: Stretch, sun: Array) -> tuple[Array, Array]:
        """By what angle (n,) in [0, 2π) the body has to turn until the Sun passes the sensor, and at what rate."""
        w, x, y, z = here.quaternion
        s1, s2, s3 = sun
        # The Sun as the body sees it: the rotation by the conjugate quaternion.
        i, j, k = z * s2 - y * s3, x * s3 - z * s1, y * s1 - x * s2
        s1, s2, s3 = (
            s1 + 2.0 * (w * i + z * j - y * k),
            s2 + 2.0 * (w * j + x * k - z * i),
            s3 + 2.0 * (w * k + y * i - x * j),
        )
        first, second, third = here.rates
        across = s1 * s1 + s2 * s2
        azimuth_rate = (s1 * (s3 * first - s1 * third) - s2 * (s2 * third - s3 * second)) / across
        ahead = self.sense * (np.arctan2(s2, s1) - self.sensor.azimuth) % CIRCLE
        return ahead, -self.sense * azimuth_rate

    def _sees(self, here: Stretch) -> NDArray[np.bool_]:
        """Whether the sensor sees the Sun, (n,)."""
        _, x, y, z = here.quaternion
        w = here.quaternion[0]
        axis = self.sense * np.array([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)])
        angle = np.arctan2(np.linalg.norm(np.cross(axis, self.sun, axis=0), axis=0), np.sum(axis * self.sun, axis=0))
        return np.asarray(np.abs(0.5 * math.pi - angle - self.sensor.elevation) <= self.sensor.half_width)
