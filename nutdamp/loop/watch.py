"""The coast of a closed loop: what the law sees of it sample by sample, and when it decides to fire."""

from __future__ import annotations

import copy
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.dynamics import Dynamics
from nutdamp.loop.law import Actuator, ComplexArray, Firing, Law
from nutdamp.loop.sensor import Estimator, Signal
from nutdamp.motion import Path
from nutdamp.physics import rigid
from nutdamp.spacecraft import SpinState, Vector

GRID = 64
"""Moments in a nutation period at which a continuous signal is looked at, to find between which two it fires."""

LONGEST = 4096
"""Moments looked at together, at most."""

MOST = 20_000_000
"""Moments looked at in a flight, at most: two days of 100 Hz."""

SAMPLED = 1e-6
"""Part of the time between two samples by which one at the end of a pulse may come before it: rounding."""

REFINED = 60
"""Steps, at most, in which the moment of a firing is found between two of the `GRID`."""


class Seen(NamedTuple):
    """Some of the moments of a coast: ``times`` (n,) s of the samples, and when they are decided on, ``now`` (n,) s.

    ``z`` is what the law takes for the transverse rate then, ``best`` what is known of it at ``times``; ``spin`` ω3.
    ``shown`` (n,) rad is the nutation by ``z``; ``fires`` (channels, n): whether each comes to fire. ``size`` rad/s is
    |z| in truth at the last of the samples.
    """

    times: Vector
    now: Vector
    z: ComplexArray
    best: ComplexArray
    spin: Vector
    shown: Vector
    fires: NDArray[np.bool_]
    size: float


class Found(NamedTuple):
    """A firing that the law decides on ``now`` s, row ``row`` of what was seen: it starts at ``start`` s."""

    row: int
    now: float
    start: float
    actuator: Actuator
    firing: Firing


class Watch:
    """What the law makes of the samples of coasts from ``since`` s on, which is (cases, 1) where there are many.

    ``reach``: samples that are looked at together next.
    """

    def __init__(self, law: Law, since: Any) -> None:
        self.law, self.sensor = law, law.loop.sensor
        self.estimator = Estimator(law, self.sensor, since)
        step = self.estimator.step or law.period / GRID
        self.reach = min(max(round(0.5 * law.period / step), 2), LONGEST)
        self._waits: Vector | None = None

    @property
    def ahead(self) -> float:
        """How long before its start a firing is decided on, s: until the next sample, where the law predicts."""
        return self.estimator.step if self.law.loop.predict else 0.0

    @property
    def doubled(self) -> int:
        """Samples of the look after the next, at most."""
        return min(2 * self.reach, LONGEST)

    def first(self, since: Any) -> Any:
        """Number of the first sample of a coast from ``since`` s on."""
        assert self.sensor.rate is not None
        return np.ceil(since * self.sensor.rate - SAMPLED).astype(int)

    def judged(
        self, times: Vector, values: Vector, spin: Vector, active: NDArray[np.bool_]
    ) -> tuple[ComplexArray, ComplexArray, Vector, NDArray[np.bool_]]:
        """z on board, what is known of z, the nutation by it, and whether channels come to fire, (channels, ..., n).

        The latter only where the loop is ``active``, or where it may become so: it matters nowhere else.
        """
        raw = self.estimator.feed(times, values, spin)
        z, best = self.estimator.on_board(raw, spin), self.estimator.best(raw, spin)
        shown = self.law.nutation(np.abs(z), spin)
        fires = np.zeros((len(self.law.actuators), *times.shape), dtype=bool)
        awake = active | np.any(shown >= self.law.loop.start, axis=-1)
        before = np.full((*fires.shape[:-1], 1), math.nan) if self._waits is None else self._waits
        if np.all(awake):
            waits = self.waits(z, spin)
            fires = self.triggered(np.concatenate([before, waits], axis=-1))
            self._waits = waits[..., -1:]
        else:
            self._waits = self.waits(z[..., -1:], spin[..., -1:])
            if np.any(awake):
                waits = np.concatenate([before[:, awake], self.waits(z[awake], spin[awake])], axis=-1)
                fires[:, awake] = self.triggered(waits)
        return z, best, shown, fires

    def some(self, cases: NDArray[Any]) -> Watch:
        """That of some of the cases."""
        found = copy.copy(self)
        found.estimator = self.estimator.some(cases)
        found._waits = None if self._waits is None else self._waits[:, cases]
        return found

    def found(self, seen: Seen, row: int, channels: list[int]) -> Found | None:
        """The firing of those of the ``channels`` that comes first, decided on at ``row``."""
        fired = [self._firing(seen, row, self.law.actuators[index]) for index in channels]
        made = [one for one in fired if one is not None]
        return min(made, key=lambda one: one.start) if made else None

    def _firing(self, seen: Seen, row: int, actuator: Actuator) -> Found | None:
        now = float(seen.now[row])
        firing = self.law.firing(actuator, complex(seen.z[row]), float(seen.spin[row]))
        if firing is None:
            return None
        return Found(row, now, now + (max(firing.wait, 0.0) if self.law.loop.predict else 0.0), actuator, firing)

    def waits(self, z: ComplexArray, spin: Vector) -> Vector:
        """`Law.waits` of all channels, (channels, ..., n)."""
        return np.array([self.law.waits(one, z, spin) for one in self.law.actuators])

    def triggered(self, waits: Vector, ahead: float | None = None) -> NDArray[np.bool_]:
        """Whether each channel comes to fire at each moment but the first: its wait falls below `ahead`."""
        before, now, ahead = waits[..., :-1], waits[..., 1:], self.ahead if ahead is None else ahead
        falls = (now < ahead) & (before >= ahead) & (before - now < 0.5 * self.law.period)
        slack = 1e-12 * self.law.period
        begins = np.isnan(before) & (now >= -slack) & (now < max(ahead, slack))
        return np.asarray(falls | begins)


class Coast(Watch):
    """The motion of one body from ``state`` at ``since`` s on without firing, and what is seen of it."""

    def __init__(self, law: Law, signal: Signal, dynamics: Dynamics, state: SpinState, since: float) -> None:
        super().__init__(law, since)
        self.signal, self.dynamics = signal, dynamics
        self.path: Path | None = None
        self.state, self.since = state, since
        self._from = self._until = since
        self._number = 0 if self.sensor.rate is None else int(self.first(np.float64(since)))

    def look(self, until: float, *, active: bool) -> Seen | None:
        """The next moments of the coast; None where all have been looked at, up to a decision at ``until`` s."""
        begins, end = self._until, until - self.signal.sensor.delay
        numbers: NDArray[np.int64] | None = None
        if self.sensor.rate is None:
            end = min(begins + self.reach * self.law.period / GRID, end)
            if end <= begins:
                return None
            count = max(math.ceil((end - begins) / self.law.period * GRID), 2)
            times: Vector = np.asarray(np.linspace(begins, end, count + 1)[self.path is not None :], dtype=np.float64)
        else:
            last = min(self._number + self.reach - 1, math.floor(end * self.sensor.rate + SAMPLED))
            if last < self._number:
                return None
            numbers = np.arange(self._number, last + 1)
            times = np.asarray(numbers * self.estimator.step, dtype=np.float64)
            self._number, end = last + 1, max(float(times[-1]), begins)
        self._go_to(end)
        self.reach = self.doubled
        assert self.path is not None
        rates, _ = self.path.motion(times)
        values = self.signal.shown(rates)
        if numbers is not None:
            values = self.signal.sampled(numbers, values)
        spin = rates[:, 2]
        z, best, shown, fires = self.judged(times, values, spin, np.array(active))
        size = abs(complex(self.law.seen(complex(*rates[-1, :2]))))
        return Seen(times, times + self.signal.sensor.delay, z, best, spin, shown, fires, size)

    def _go_to(self, end: float) -> None:
        """Has a path that reaches from the last moment looked at to ``end`` s."""
        if self.path is None or not self.dynamics.free:
            state = self.state if self.path is None else self.at(self._until)
            self._from = self._until
            self.path, _ = self.dynamics.path(state, self._from, end, most=rigid.MOST_STEPS)
        self._until = end

    def at(self, time: float) -> SpinState:
        """The motion at ``time`` s, which has been looked at or lies within a nutation period behind that."""
        if time == self.since or self.path is None:
            return self.state
        if time > self._until and not self.dynamics.free:
            self._go_to(time)
        rates, quaternion = self.path.motion(np.array([time]))
        first, second, third = rates[0].tolist()
        return SpinState(complex(first, second), third, quaternion[0])

    def _firing(self, seen: Seen, row: int, actuator: Actuator) -> Found | None:
        if self.sensor.rate is not None:
            return super()._firing(seen, row, actuator)
        now, step = float(seen.now[row]), self.law.period / GRID
        return self._refined(row, now - 2.0 * step, now + step, now, actuator)

    def _refined(self, row: int, low: float, high: float, now: float, actuator: Actuator) -> Found | None:
        """The moment at which the wait of a continuous signal is over, by Newton's steps: it falls by 1 s a second."""
        low = max(low, self.estimator.since + self.signal.sensor.delay)
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
        time = now - self.signal.sensor.delay
        assert self.path is not None
        rates, _ = self.path.motion(np.array([time]))
        z = self.estimator.feed(np.array([time]), self.signal.shown(rates), rates[:, 2])
        return self.law.firing(actuator, complex(self.estimator.on_board(z, rates[:, 2])[0]), float(rates[0, 2]))
