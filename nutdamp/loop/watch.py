"""The coast of a closed loop: what the law sees of it sample by sample, and when it decides to fire."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from nutdamp.loop.law import Actuator, ComplexArray, Firing, Law
from nutdamp.loop.sensor import Estimator, Signal
from nutdamp.loop_settings import Sensor
from nutdamp.motion import Path
from nutdamp.physics import rigid
from nutdamp.spacecraft import SpinState, Vector

GRID = 64
"""Moments in a nutation period at which a continuous signal is looked at, to find between which two it fires."""

LONGEST = 20_000
"""Moments looked at together, at most."""

MOST = 20_000_000
"""Moments looked at in a flight, at most: two days of 100 Hz."""

SAMPLED = 1e-6
"""Part of the time between two samples by which one at the end of a pulse may come before it: rounding."""

REFINED = 60
"""Steps, at most, in which the moment of a firing is found between two of the `GRID`."""


class Mover(Protocol):
    """What flies a loop: `dynamics.Dynamics`, or another integrator in its place."""

    @property
    def moments(self) -> tuple[float, float, float]:
        """Principal moments, kg m²."""
        ...

    @property
    def free(self) -> bool:
        """Whether coasts are known in closed form, so that one may look at any of their moments."""
        ...

    def path(
        self,
        state: SpinState,
        start: float,
        end: float,
        torques: Sequence[Vector] = (),
        slope: Vector | None = None,
        *,
        most: int,
    ) -> tuple[Path, SpinState]:
        """See `dynamics.Dynamics.path`."""
        ...


class Seen(NamedTuple):
    """Some of the moments of a coast: ``times`` (n,) s of the samples, and when they are decided on, ``now`` (n,) s.

    ``z`` is what the law takes for the transverse rate then, ``best`` what is known of it at ``times``; ``spin`` ω3.
    """

    times: Vector
    now: Vector
    z: ComplexArray
    best: ComplexArray
    spin: Vector

    def up_to(self, row: int) -> Seen:
        """The same up to a row."""
        end = row + 1
        return Seen(self.times[:end], self.now[:end], self.z[:end], self.best[:end], self.spin[:end])


class Found(NamedTuple):
    """A firing that the law decides on ``now`` s, row ``row`` of what was seen: it starts at ``start`` s."""

    row: int
    now: float
    start: float
    actuator: Actuator
    firing: Firing


class Coast:
    """The motion from ``state`` at ``since`` s on without firing, and the signal of the sensor along it."""

    def __init__(
        self, law: Law, signal: Signal, dynamics: Mover, state: SpinState, since: float, before: Vector | None = None
    ) -> None:
        self.law, self.signal, self.dynamics = law, signal, dynamics
        self.sensor: Sensor = signal.sensor
        self.estimator = Estimator(law, self.sensor, since)
        self.looked_at = 0
        self.path: Path | None = None
        self.state, self.since = state, since
        self._from = since
        self._until = since
        self._number = 0 if self.sensor.rate is None else math.ceil(since * self.sensor.rate - SAMPLED)
        self._span = 0.5 * law.period
        self._waits = before

    @property
    def ahead(self) -> float:
        """How long before its start a firing is decided on, s: until the next sample, where the law predicts."""
        return self.estimator.step if self.law.loop.predict else 0.0

    def look(self, until: float) -> Seen | None:
        """The next moments of the coast; None where all have been looked at, up to a decision at ``until`` s."""
        begins, end = self._until, min(self._until + self._span, until - self.sensor.delay)
        if end <= begins and self.path is not None:
            return None
        end, numbers = max(end, begins), None
        if self.sensor.rate is None:
            count = min(max(math.ceil((end - begins) / self.law.period * GRID), 2), LONGEST)
            times: Vector = np.asarray(np.linspace(begins, end, count + 1)[self.path is not None :], dtype=np.float64)
        else:
            last = math.floor(end / self.estimator.step)
            if last >= self._number + LONGEST:
                last = self._number + LONGEST - 1
                end = last * self.estimator.step
            numbers = np.arange(self._number, last + 1)
            times = np.asarray(numbers * self.estimator.step, dtype=np.float64)
            self._number = max(last + 1, self._number)
        self._go_to(end)
        return self._seen(times, numbers)

    def _go_to(self, end: float) -> None:
        """Has a path that reaches from the last moment looked at to ``end`` s."""
        if self.path is None or not self.dynamics.free:
            state = self.state if self.path is None else self.at(self._until)
            self._from = self._until
            self.path, _ = self.dynamics.path(state, self._from, end, most=rigid.MOST_STEPS)
        self._until = end
        self._span = min(2.0 * self._span, LONGEST * (self.estimator.step or self.law.period / GRID))

    def at(self, time: float) -> SpinState:
        """The motion at ``time`` s, which has been looked at or lies within a nutation period behind that."""
        if time == self.since or self.path is None:
            return self.state
        if time > self._until and not self.dynamics.free:
            self._go_to(time)
        rates, quaternion = self.path.motion(np.array([time]))
        first, second, third = rates[0].tolist()
        return SpinState(complex(first, second), third, quaternion[0])

    def _seen(self, times: Vector, numbers: np.ndarray[tuple[int, ...], np.dtype[np.int64]] | None) -> Seen:
        assert self.path is not None
        self.looked_at += len(times)
        if not len(times):
            return Seen(times, times, times.astype(complex), times.astype(complex), times)
        rates, _ = self.path.motion(times)
        values = self.signal.shown(rates)
        if numbers is not None:
            values = self.signal.sampled(numbers, values)
        spin = rates[:, 2]
        z = self.estimator.feed(times, values, spin)
        board, best = self.estimator.on_board(z, spin), self.estimator.best(z, spin)
        return Seen(times, times + self.sensor.delay, board, best, spin)

    def waits(self, seen: Seen) -> Vector:
        """`Law.waits` of all channels, (channels, n), and in a first column those of the moment before, if any."""
        found = np.array([self.law.waits(one, seen.z, seen.spin) for one in self.law.actuators])
        before = np.full((len(found), 1), math.nan) if self._waits is None else self._waits
        joined = np.concatenate([before, found], axis=1)
        if found.shape[1]:
            self._waits = found[:, -1:]
        return joined

    def triggered(self, waits: Vector) -> Vector:
        """Whether each channel (rows) comes to fire at each moment (columns): its wait falls below `ahead`."""
        before, now = waits[:, :-1], waits[:, 1:]
        falls = (now < self.ahead) & (before >= self.ahead) & (before - now < 0.5 * self.law.period)
        slack = 1e-12 * self.law.period
        begins = np.isnan(before) & (now >= -slack) & (now < max(self.ahead, slack))
        return np.asarray(falls | begins)

    def found(self, seen: Seen, row: int, channels: list[int]) -> Found | None:
        """The firing of those of the ``channels`` that comes first, decided on at ``row``."""
        fired = [self._firing(seen, row, self.law.actuators[index]) for index in channels]
        made = [one for one in fired if one is not None]
        return min(made, key=lambda one: one.start) if made else None

    def _firing(self, seen: Seen, row: int, actuator: Actuator) -> Found | None:
        now = float(seen.now[row])
        if self.sensor.rate is None:
            step = self.law.period / GRID
            return self._refined(row, now - 2.0 * step, now + step, now, actuator)
        firing = self.law.firing(actuator, complex(seen.z[row]), float(seen.spin[row]))
        if firing is None:
            return None
        return Found(row, now, now + (max(firing.wait, 0.0) if self.law.loop.predict else 0.0), actuator, firing)

    def _refined(self, row: int, low: float, high: float, now: float, actuator: Actuator) -> Found | None:
        """The moment at which the wait of a continuous signal is over, by Newton's steps: it falls by 1 s a second."""
        low = max(low, self.estimator.since + self.sensor.delay)
        firing = None
        for _ in range(REFINED):
            firing = self._wait_at(now, actuator)
            if firing is None:
                return None
            if firing.wait > 0.0:
                low = now
            else:
                high = now
            following = now + firing.wait
            following = following if low <= following <= high else 0.5 * (low + high)
            if abs(following - now) <= 2.0 * math.ulp(now):
                break
            now = following
        assert firing is not None
        return Found(row, now, now, actuator, firing)

    def _wait_at(self, now: float, actuator: Actuator) -> Firing | None:
        time = now - self.sensor.delay
        assert self.path is not None
        rates, _ = self.path.motion(np.array([time]))
        z = self.estimator.feed(np.array([time]), self.signal.shown(rates), rates[:, 2])
        return self.law.firing(actuator, complex(self.estimator.on_board(z, rates[:, 2])[0]), float(rates[0, 2]))
