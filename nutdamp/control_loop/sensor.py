"""Sensor samples of a gyro or an accelerometer, and the on-board estimator.

A rate gyro shows ω1 and ω2. An accelerometer at r from the centre of mass, along the unit vector u,
shows

    s = u·(dω/dt × r + ω × (ω × r)) + u·F/m,

which in free motion is ω3-fold: for r = (x, y, z) the part that is linear in ω is K1 ω1 + K2 ω2
with

    K1 = ω3 [u3 x (1 + (I1 - I3)/I2) + u1 z (1 - (I1 - I3)/I2)],
    K2 = ω3 [u3 y (1 + (I2 - I3)/I1) + u2 z (1 - (I2 - I3)/I1)],

so that along axis 3 at radius x it is x ω1 ω3 (1 + a): nothing where C = 2A. The rest of s is even
(centripetal) or square in ω, of twice the nutation rate: offset, sine and a sine of twice the rate
are fitted over the last nutation period, and the first of the sines gives ω.
"""

from __future__ import annotations

import cmath
import copy
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.control_loop.law import ComplexArray, Law
from nutdamp.errors import Infeasible
from nutdamp.spacecraft.equipment import ACCELEROMETER, Sensor
from nutdamp.spacecraft.model import Spacecraft, Vector

BLOCK = 4096  # samples whose noise is drawn at a time

# time constants of the low-pass filter worked out at a time: the weights of more would overflow
FILTERED = 600.0

# samples a nutation period from which on the sine of twice its rate can be distinguished from the
# others
HARMONIC = 7

FITTED, UNFITTED = 1.4, 2.0
"""Factors of the sine fitted to a period on a sine of any rate: at most 4/π where the period is one
of whole samples, which leaves a tenth for those that are not; and where twice the rate is not
fitted too, or a filter is reckoned with.
"""

# time constants of the low-pass filter till samples are used: its beginning is forgotten to 1 %
SETTLED = 5.0

# share of |ω3| times the distance from the centre of mass below which an accelerometer shows
# nothing of ω
BLIND = 1e-6


def gain(moments: Sequence[float], position: Vector, axis: Vector) -> tuple[float, float]:
    """Gain (K1, K2)/ω3 of an accelerometer, m, for ω1 and ω2 in free motion."""
    first, second, third = moments
    (x, y, z), (u1, u2, u3) = position.tolist(), axis.tolist()
    p, q = (first - third) / second, (second - third) / first
    return u3 * x * (1.0 + p) + u1 * z * (1.0 - p), u3 * y * (1.0 + q) + u2 * z * (1.0 - q)


def is_blind(moments: Sequence[float], position: Vector, axis: Vector) -> bool:
    """True if an accelerometer does not see a small nutation."""
    return math.hypot(*gain(moments, position, axis)) <= BLIND * math.hypot(*position.tolist())


class Noise:
    """Normal numbers by sample number, independent of the order of access; ``key`` is seed and
    case.
    """

    def __init__(self, key: tuple[int, ...], sensor: Sensor) -> None:
        self.key = key
        self.columns = 1 if sensor.kind == ACCELEROMETER else 2
        self._blocks: dict[int, Vector] = {}

    def of(self, first: int, count: int) -> Vector:
        """Numbers of ``count`` samples from number ``first`` on, (count, columns)."""
        begin, end = first // BLOCK, max(first + count - 1, first) // BLOCK
        for block in range(begin, end + 1):
            if block not in self._blocks:
                self._blocks[block] = np.random.default_rng((*self.key, block)).normal(
                    size=(BLOCK, self.columns)
                )
        for block in [block for block in self._blocks if block < begin]:
            del self._blocks[block]
        drawn = self._blocks[begin]
        if end > begin:
            drawn = np.concatenate([self._blocks[block] for block in range(begin, end + 1)])
        return drawn[first - begin * BLOCK : first - begin * BLOCK + count]


def felt(sensor: Sensor, moments: Any, rates: Any, torque: Any = None) -> tuple[Any, ...]:
    """True signal, by columns: rad/s of two gyros, or m/s² of an accelerometer in free motion.

    Of principal ``moments`` and body ``rates``, three numbers or arrays each; a ``torque`` N m
    changes the rates.
    """
    x, y, z = rates
    if sensor.kind != ACCELEROMETER:
        return tuple(
            along * x + across * y + axial * z for along, across, axial in sensor.axes.tolist()
        )
    first, second, third = moments
    m1, m2, m3 = (0.0, 0.0, 0.0) if torque is None else torque
    turned = (
        (second - third) * y * z + m1,
        (third - first) * z * x + m2,
        (first - second) * x * y + m3,
    )
    changes = (turned[0] / first, turned[1] / second, turned[2] / third)
    at, axis = sensor.position.tolist(), sensor.axis.tolist()
    # u·(dω/dt × r) = dω/dt·(r × u), and u·(ω × (ω × r)) = (ω·u)(ω·r) - (u·r)ω².
    arm = np.cross(sensor.position, sensor.axis).tolist()
    value = sum(change * part for change, part in zip(changes, arm, strict=True))
    along, out = (
        sum(rate * part for rate, part in zip(rates, vector, strict=True)) for vector in (axis, at)
    )
    return (value + along * out - float(sensor.position @ sensor.axis) * (x * x + y * y + z * z),)


class Signal:
    """Samples of a sensor on a true ``spacecraft``, with the noise of a ``key``: seed, and case if
    any.
    """

    def __init__(self, spacecraft: Spacecraft, sensor: Sensor, key: tuple[int, ...]) -> None:
        self.sensor = sensor
        self.moments = spacecraft.inertia.moments
        self.noise = Noise(key, sensor)

    def shown(self, rates: Vector) -> Vector:
        """Signal without noise and steps, (n, 2) rad/s or (n, 1) m/s², at body ``rates`` (n, 3) of
        free motion.
        """
        values = np.column_stack(felt(self.sensor, self.moments, rates.T))
        return np.asarray(self.sensor.scales * values + self.sensor.biases)

    def sampled(self, numbers: NDArray[np.int64], shown: Vector) -> Vector:
        """Samples by their rising ``numbers`` (n,), that at t = 0 is 0: ``shown`` with noise and
        steps.
        """
        sensor = self.sensor
        first = int(numbers[0])
        if sensor.noise > 0.0:
            shown = (
                shown
                + sensor.noise * self.noise.of(first, int(numbers[-1]) - first + 1)[numbers - first]
            )
        return stepped(sensor, shown)


def stepped(sensor: Sensor, values: Vector) -> Vector:
    """Values in steps of the quantisation."""
    return (
        values
        if sensor.quantisation == 0.0
        else np.rint(values / sensor.quantisation) * sensor.quantisation
    )


class Doubt(NamedTuple):
    """Uncertainty of an estimate of z, rad/s."""

    noise: float  # root mean square, of both components
    bias: float  # of a coast, which does not turn with z
    steps: float  # by the quantisation, at most
    scale: float  # share by which it may be off: two sigma of the dispersions


WINDOW = 1_000_000
"""Samples over which an accelerometer's sine may be fitted: its weights and a window of values take
0.1 GB.
"""


class Estimator:
    """From samples to z, the rate that the `Law` works on, along a coast from ``since`` s on,
    (cases, 1) for many.

    Samples are the last axis of times, spins and estimates, the last but one of values (..., n,
    columns).
    """

    def __init__(self, law: Law, sensor: Sensor, since: Any) -> None:
        self.law, self.sensor = law, sensor
        self.since = since + max(law.loop.settle, SETTLED * sensor.low_pass)
        self.step = 0.0 if sensor.rate is None else 1.0 / sensor.rate
        self._memory = (
            math.exp(-self.step / sensor.low_pass) if sensor.low_pass > 0.0 else 0.0
        )  # from sample to sample
        # The law turns the gyros about axis 3 to the principal axes, and takes what they show of ω3
        # for nutation.
        self._across = np.linalg.inv(sensor.axes[:, :2])
        self._filtered: Vector | None = None
        self._kept: tuple[
            Any, ...
        ] = ()  # last samples of the coast: times, values, number of usable ones
        self._fit: tuple[Any, ...] = ()  # see `_fit`

    def some(self, cases: NDArray[Any]) -> Estimator:
        """Subset of the cases."""
        subset = copy.copy(self)
        subset.since = self.since[cases]
        subset._filtered = None if self._filtered is None else self._filtered[cases]
        subset._kept, subset._fit = (
            tuple(part[cases] for part in parts) for parts in (self._kept, self._fit)
        )
        return subset

    @property
    def window(self) -> int:
        """Samples of a nutation period, over which an accelerometer's sine is fitted."""
        return max(round(self.law.period / self.step), 4)

    @property
    def first(self) -> Any:
        """Time of the first estimate after the last firing, s."""
        return self.since + (self.law.period if self.sensor.kind == ACCELEROMETER else 0.0)

    def feed(self, times: Vector, values: Vector, spin: Vector) -> ComplexArray:
        """z at the ``times`` (s) of further samples ``values``, at a ``spin`` ω3, filtered; NaN
        where none yet.

        Raises Infeasible for an accelerometer with more than `WINDOW` samples in a nutation period.
        """
        smooth = self._low_pass(values)
        if self.sensor.kind == ACCELEROMETER:
            # The law knows how far out the sensor is and the spin, which dissipation changes: by
            # more than ω shows.
            x, y, _ = (self.sensor.position * self.sensor.axis).tolist()
            return self._fitted(times, smooth[..., 0] + (x + y) * spin * spin, spin)
        across = smooth @ self._across.T
        seen = self.law.seen(across[..., 0] + 1j * across[..., 1])
        return np.asarray(np.where(times >= self.since, seen, math.nan))

    def on_board(self, z: ComplexArray, spin: Vector) -> ComplexArray:
        """Estimate of z at the decision, the delay after the sample: propagated to then where the
        law predicts.
        """
        if not self.law.loop.predict:
            return z
        best = self.best(z, spin)
        if self.sensor.delay == 0.0:
            return best
        return np.asarray(best * np.exp(-1j * self.law.rate(spin) * self.sensor.delay))

    def best(self, z: Any, spin: Any) -> ComplexArray:
        """Estimate of z corrected for the steady-state response of the filter."""
        if self.sensor.low_pass == 0.0:
            return np.asarray(z)
        fresh = 1.0 - self._memory
        return np.asarray(
            z * (1.0 - self._memory * np.exp(1j * self.law.rate(spin) * self.step)) / fresh
        )

    def _low_pass(self, values: Vector) -> Vector:
        """Low-pass filter y = βy' + (1 - β)x over the samples; restarted with the first one after a
        firing.
        """
        count = values.shape[-2]
        if self.sensor.low_pass == 0.0 or not count:
            return values
        memory = self._memory
        before = values[..., :1, :] if self._filtered is None else self._filtered
        filtered = np.empty_like(values)
        size = max(int(FILTERED * self.sensor.low_pass / self.step), 1)
        for begin in range(0, count, size):
            part = values[..., begin : begin + size, :]
            weights = memory ** -np.arange(1.0, part.shape[-2] + 1.0)[:, None]
            sums = np.cumsum(part * (1.0 - memory) * weights, axis=-2)
            filtered[..., begin : begin + size, :] = (before + sums) / weights
            before = filtered[..., begin + part.shape[-2] - 1 : begin + part.shape[-2], :]
        self._filtered = before
        return filtered

    def _fitted(self, times: Vector, values: Vector, spin: Vector) -> ComplexArray:
        """z by an offset and a sine of the nutation rate, fitted to the even samples of the last
        period.

        A fixed combination of their sum and of the sums of their products with sines of the rate
        and of twice it.
        """
        if not times.shape[-1]:
            return np.empty(times.shape, dtype=complex)
        if self.window > WINDOW:
            raise Infeasible(
                "the fit of an accelerometer takes the samples of a nutation period: "
                f"{self.window:.2g} at this rate, of at most {WINDOW:.0e}; lower "
                "loop.sensor.rate"
            )
        self._fit = self._fit or _fit(
            np.asarray(self.law.rate(spin[..., :1])), self.step, self.window
        )
        (rate, weights), fresh, size = self._fit, times.shape[-1], self.window
        used = np.cumsum(times >= self.since, axis=-1)
        if self._kept:
            earlier, seen, before = self._kept
            used = used + before
            times, values = (
                np.concatenate([earlier, times], axis=-1),
                np.concatenate([seen, values], axis=-1),
            )
        self._kept = times[..., -size:], values[..., -size:], used[..., -1:]
        turns = np.exp(-1j * rate * (times - times[..., :1]))
        sums = [_windows(values, size, fresh)]
        for power in (1, 2) if weights.shape[-1] == 5 else (1,):
            turned = turns if power == 1 else turns * turns
            # The sum over the window of v e^{-iφ}, with φ from its last sample.
            both = _windows(values * turned, size, fresh) * turned[..., -fresh:].conj()
            sums += [both.real, -both.imag]
        sine = sum(total * weights[..., place, None] for place, total in enumerate(sums))
        estimate = sine / (np.conj(self.seen_gain) * spin)
        return np.asarray(np.where(used >= size, estimate, math.nan))

    @property
    def seen_gain(self) -> complex:
        """Gain of the accelerometer for z, over ω3."""
        first, second = gain(self.law.inertia.moments, self.sensor.position, self.sensor.axis)
        return complex(first / self.law.gauge[0], second / self.law.gauge[1])

    def overestimate(self, truth: Spacecraft, size: float) -> float:
        """Largest factor of an estimate on a true |z| of up to ``size`` rad/s of a symmetric body;
        see `FITTED`.
        """
        sensor = self.sensor
        if sensor.kind != ACCELEROMETER:
            return 1.0
        if self.window < HARMONIC or sensor.low_pass > 0.0:
            return UNFITTED
        seen = abs(self.seen_gain)
        gained = math.hypot(*gain(truth.inertia.moments, sensor.position, sensor.axis))
        square = 2.0 * math.hypot(*sensor.position.tolist()) * size / abs(truth.spin)
        return FITTED * (gained + square) / seen if seen > 0.0 else math.inf

    def standing(self, spin: float) -> complex:
        """z that gyros show without nutation at a ``spin`` ω3, rad/s: by their bias, and by ω3
        along tilted axes.
        """
        shown = (
            np.array(self.sensor.biases)
            + np.array(self.sensor.scales) * self.sensor.axes[:, 2] * spin
        )
        return complex(self.law.seen(complex(*(self._across @ shown))))

    @property
    def doubts(self) -> Doubt:
        """Uncertainties of the estimates."""
        sensor = self.sensor
        memory = self._memory
        spin = self.law.spacecraft.spin
        dispersions = self.law.spacecraft.dispersions
        tolerance = None if dispersions is None else dispersions.sensor_scale
        scale = 0.0 if tolerance is None else 2.0 * abs(tolerance.size)
        # What a constant is lifted by, as `best` inverts the filter for z.
        lift = max(abs(complex(self.best(1.0, spin))), 1.0)
        if sensor.kind == ACCELEROMETER:
            gained = abs(self.seen_gain) * abs(spin)
            noise = 2.0 * sensor.noise * lift / (math.sqrt(self.window) * gained)
            return Doubt(noise, 0.0, sensor.quantisation * lift / gained, scale)
        widest = max(self.law.gauge)
        filtered = lift * math.sqrt((1.0 - memory) / (1.0 + memory))
        return Doubt(
            noise=sensor.noise * math.sqrt(2.0) * widest * filtered,
            bias=abs(self.standing(spin)) * lift,
            steps=sensor.quantisation / math.sqrt(2.0) * lift * widest,
            scale=scale,
        )


def _fit(rate: Vector, step: float, size: int) -> tuple[Vector, ComplexArray]:
    """Rate and weights, of sums by 1, cos φ, sin φ, cos 2φ, sin 2φ, of a sine fitted to ``size``
    even samples.
    """
    angle = rate[..., None] * (step * np.arange(1.0 - size, 1.0))[:, None]
    powers = np.arange(1.0, 3.0 if size >= HARMONIC else 2.0)
    turns = np.stack([np.cos(angle * powers), np.sin(angle * powers)], axis=-1)
    basis = np.concatenate([np.ones(angle.shape), turns.reshape(*angle.shape[:-1], -1)], axis=-1)
    inverse = np.linalg.inv(np.swapaxes(basis, -1, -2) @ basis)
    return rate, inverse[..., 1, :] + 1j * inverse[..., 2, :]


def _windows(values: Any, size: int, fresh: int) -> Any:
    """Sums of the last ``size`` values at each of the last ``fresh``; of fewer, where there are no
    more.
    """
    sums = np.cumsum(values, axis=-1)
    count = sums.shape[-1]
    sums_of = sums[..., count - fresh :].copy()
    later = max(count - fresh, size)
    if later < count:
        sums_of[..., later - count :] -= sums[..., later - size : count - size]
    return sums_of


def lag(law: Law, sensor: Sensor, spin: float) -> float:
    """Angle, rad, by which z has turned on while filter and delay bring a sample to the law;
    signed.
    """
    rate = float(law.rate(spin))
    behind = rate * sensor.delay
    if sensor.low_pass > 0.0 and sensor.rate is not None:
        memory = math.exp(-1.0 / (sensor.rate * sensor.low_pass))
        behind += cmath.phase((1.0 - memory) / (1.0 - memory * cmath.exp(1j * rate / sensor.rate)))
    return behind
