"""What a gyro or an accelerometer shows of the motion, and what the law on board makes of it.

A rate gyro shows ω1 and ω2. An accelerometer at r from the centre of mass, along the unit vector u, shows

    s = u·(dω/dt × r + ω × (ω × r)) + u·F/m,

which in free motion is ω3-fold: for r = (x, y, z) the part that is linear in ω is K1 ω1 + K2 ω2 with

    K1 = ω3 [u3 x (1 + (I1 - I3)/I2) + u1 z (1 - (I1 - I3)/I2)],
    K2 = ω3 [u3 y (1 + (I2 - I3)/I1) + u2 z (1 - (I2 - I3)/I1)],

so that along axis 3 at radius x it is x ω1 ω3 (1 + a): nothing where C = 2A. The rest of s is even (centripetal) or
square in ω, of twice the nutation rate: offset, sine and a sine of twice the rate are fitted over the last nutation
period, and the first of the sines gives ω.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from nutdamp.loop.law import ComplexArray, Law
from nutdamp.loop_settings import ACCELEROMETER, Sensor
from nutdamp.spacecraft import Spacecraft, Vector

BLOCK = 4096
"""Samples whose noise is drawn at a time."""

FILTERED = 600.0
"""Time constants of the low-pass filter that are worked out at a time: the weights of more would overflow."""

HARMONIC = 7
"""Samples a nutation period from which on the sine of twice its rate can be told from the others."""

SETTLED = 5.0
"""Time constants of the low-pass filter until its beginning is forgotten to 1 %: till then samples are not used."""

BLIND = 1e-6
"""Share of |ω3| times the distance from the centre of mass below which an accelerometer shows nothing of ω."""


def gain(moments: Sequence[float], position: Vector, axis: Vector) -> tuple[float, float]:
    """(K1, K2)/ω3 of an accelerometer, m: what it shows of ω1 and ω2 in free motion."""
    first, second, third = moments
    (x, y, z), (u1, u2, u3) = position.tolist(), axis.tolist()
    p, q = (first - third) / second, (second - third) / first
    return u3 * x * (1.0 + p) + u1 * z * (1.0 - p), u3 * y * (1.0 + q) + u2 * z * (1.0 - q)


def is_blind(moments: Sequence[float], position: Vector, axis: Vector) -> bool:
    """Whether an accelerometer shows nothing of a small nutation."""
    return math.hypot(*gain(moments, position, axis)) <= BLIND * math.hypot(*position.tolist())


class Signal:
    """The samples of a sensor on a ``spacecraft``, as it is in truth, with the noise of a ``seed``."""

    def __init__(self, spacecraft: Spacecraft, sensor: Sensor, seed: int) -> None:
        self.sensor, self.seed = sensor, seed
        self.moments, self.mass = np.asarray(spacecraft.inertia.moments), spacecraft.mass
        self.columns = 1 if sensor.kind == ACCELEROMETER else 2
        self._blocks: dict[int, Vector] = {}

    def shown(self, rates: Vector, torque: Vector | None = None, force: Vector | None = None) -> Vector:
        """The signal without noise and steps, (n, 2) rad/s or (n, 1) m/s², at body ``rates`` (n, 3)."""
        sensor = self.sensor
        if sensor.kind != ACCELEROMETER:
            return sensor.scale * rates[:, :2] + sensor.bias
        momentum = rates * self.moments
        change = (-np.cross(rates, momentum) + (0.0 if torque is None else torque)) / self.moments
        at = np.broadcast_to(sensor.position, rates.shape)
        felt = np.cross(change, at) + np.cross(rates, np.cross(rates, at))
        if force is not None and self.mass is not None:
            felt = felt + force / self.mass
        return sensor.scale * (felt @ sensor.axis)[:, None] + sensor.bias

    def sampled(self, numbers: NDArray[np.int64], shown: Vector) -> Vector:
        """Samples by their ``numbers`` (n,) from 0 at t = 0: ``shown`` with noise and steps."""
        sensor = self.sensor
        values = shown + sensor.noise * self._noise(numbers) if sensor.noise > 0.0 else shown
        return values if sensor.quantisation == 0.0 else np.rint(values / sensor.quantisation) * sensor.quantisation

    def _noise(self, numbers: NDArray[np.int64]) -> Vector:
        """Normal numbers (n, columns), the same for the same sample however it is come by."""
        first, last = int(numbers[0]) // BLOCK, int(numbers[-1]) // BLOCK
        for block in range(first, last + 1):
            if block not in self._blocks:
                self._blocks[block] = np.random.default_rng((self.seed, block)).normal(size=(BLOCK, self.columns))
        for block in [one for one in self._blocks if one < first]:
            del self._blocks[block]
        drawn = np.concatenate([self._blocks[block] for block in range(first, last + 1)])
        return drawn[numbers - first * BLOCK]


class Estimator:
    """From samples to z, the rate that the `Law` works on, along one coast that begins at ``since`` s."""

    def __init__(self, law: Law, sensor: Sensor, since: float) -> None:
        self.law, self.sensor = law, sensor
        self.since = since + max(law.loop.settle, SETTLED * sensor.low_pass)
        self.step = 0.0 if sensor.rate is None else 1.0 / sensor.rate
        self._filtered: Vector | None = None
        self._kept: tuple[Vector, Vector] = (np.empty(0), np.empty(0))
        self._rate: float | None = None

    @property
    def window(self) -> int:
        """Samples of a nutation period, over which an accelerometer's sine is fitted."""
        return max(round(self.law.period / self.step), 4)

    @property
    def first(self) -> float:
        """When the first estimate is there after the last firing, s."""
        return self.since + (self.law.period if self.sensor.kind == ACCELEROMETER else 0.0)

    def feed(self, times: Vector, values: Vector, spin: Vector) -> ComplexArray:
        """z (n,) at the times of the samples (n,), filter reckoned with; NaN where there is none yet.

        ``values`` (n, 2) or (n, 1) are the samples, ``spin`` (n,) is ω3; call by call they go on.
        """
        smooth = self._low_pass(values)
        if self.sensor.kind == ACCELEROMETER:
            # The law knows how far out the sensor is and the spin, which dissipation changes: by more than ω shows.
            x, y, _ = (self.sensor.position * self.sensor.axis).tolist()
            found = self._fitted(times, smooth[:, 0] + (x + y) * spin * spin, spin)
        else:
            found = np.where(times >= self.since, self.law.seen(smooth[:, 0] + 1j * smooth[:, 1]), math.nan)
        return np.asarray(found)

    def on_board(self, z: ComplexArray, spin: Vector) -> ComplexArray:
        """What the law takes for z as it decides, the delay after the sample: brought up to then where it predicts."""
        if not self.law.loop.predict:
            return z
        return np.asarray(self.best(z, spin) * np.exp(-1j * self.law.rate(spin) * self.sensor.delay))

    def best(self, z: ComplexArray, spin: Vector) -> ComplexArray:
        """z without what the filter does to it in the steady state."""
        if self.sensor.low_pass == 0.0:
            return z
        fresh = 1.0 - self._memory
        return np.asarray(z * (1.0 - self._memory * np.exp(1j * self.law.rate(spin) * self.step)) / fresh)

    @property
    def _memory(self) -> float:
        """What the filter keeps of its value from sample to sample."""
        return math.exp(-self.step / self.sensor.low_pass)

    def _low_pass(self, values: Vector) -> Vector:
        """y = βy' + (1 - β)x over the samples; it begins anew with the first one after a firing."""
        if self.sensor.low_pass == 0.0 or not len(values):
            return values
        memory = self._memory
        before = values[0] if self._filtered is None else self._filtered
        found = np.empty_like(values)
        size = max(int(FILTERED * self.sensor.low_pass / self.step), 1)
        for begin in range(0, len(values), size):
            part = values[begin : begin + size]
            weights = memory ** -np.arange(1.0, len(part) + 1.0)
            sums = np.cumsum(part * (1.0 - memory) * weights[:, None], axis=0)
            found[begin : begin + size] = (before + sums) / weights[:, None]
            before = found[begin + len(part) - 1]
        self._filtered = before
        return found

    def _fitted(self, times: Vector, values: Vector, spin: Vector) -> ComplexArray:
        """z by an offset and a sine of the nutation rate, fitted to the samples of the last period."""
        if self._rate is None:
            self._rate = float(self.law.rate(float(spin[0])))
        used = times >= self.since
        all_times = np.concatenate([self._kept[0], times[used]])
        all_values = np.concatenate([self._kept[1], values[used]])
        fresh, count, size = int(used.sum()), len(all_times), self.window
        found = np.full(len(times), math.nan, dtype=complex)
        self._kept = all_times[-size:], all_values[-size:]
        if not fresh:
            return found
        angle = self._rate * (all_times - all_times[0])
        turns = np.exp(1j * angle[:, None] * (np.array([1.0, 2.0]) if size >= HARMONIC else np.array([1.0])))
        basis = np.column_stack([np.ones(count), turns.real, turns.imag])
        sines = 1 + turns.shape[1]
        normal = np.cumsum(basis[:, :, None] * basis[:, None, :], axis=0)
        right = np.cumsum(basis * all_values[:, None], axis=0)
        last = np.arange(count - fresh, count)
        first = last - size
        inside = first >= 0
        window, moment = normal[last], right[last]
        window[inside] -= normal[first[inside]]
        moment[inside] -= right[first[inside]]
        enough = last + 1 >= size
        sine = np.full(fresh, math.nan, dtype=complex)
        if enough.any():
            fit = np.linalg.solve(window[enough], moment[enough][:, :, None])[:, :, 0]
            sine[enough] = (fit[:, 1] + 1j * fit[:, sines]) * np.exp(-1j * angle[last][enough])
        found[used] = sine / (np.conj(self._seen_gain) * spin[used])
        return found

    @property
    def _seen_gain(self) -> complex:
        """What the accelerometer shows of z, over ω3."""
        one, other = gain(self.law.inertia.moments, self.sensor.position, self.sensor.axis)
        return complex(one / self.law.gauge[0], other / self.law.gauge[1])

    def doubt(self, samples: int) -> float:
        """One sigma of the mean of so many estimates of |z|, rad/s, by the noise of the sensor."""
        if self.sensor.kind != ACCELEROMETER:
            return self.sensor.noise * math.sqrt(2.0 / max(samples, 1)) * max(self.law.gauge)
        return 2.0 * self.sensor.noise / (math.sqrt(self.window) * self._least_gain)

    @property
    def offset(self) -> float:
        """By how much |z| may be off in every estimate, rad/s: by bias and steps of the sensor."""
        sensor = self.sensor
        if sensor.kind != ACCELEROMETER:
            return (math.sqrt(2.0) * abs(sensor.bias) + sensor.quantisation / math.sqrt(2.0)) * max(self.law.gauge)
        return sensor.quantisation / self._least_gain

    @property
    def _least_gain(self) -> float:
        return abs(self._seen_gain) * 2.0 * math.pi / (self.law.period * abs(self.law.inertia.body_rate))


def lag(law: Law, sensor: Sensor, spin: float) -> float:
    """Angle, rad, by which z has turned on while filter and delay bring a sample to the law; signed."""
    rate = float(law.rate(spin))
    behind = rate * sensor.delay
    if sensor.low_pass > 0.0 and sensor.rate is not None:
        memory = math.exp(-1.0 / (sensor.rate * sensor.low_pass))
        behind += cmath.phase((1.0 - memory) / (1.0 - memory * cmath.exp(1j * rate / sensor.rate)))
    return behind
