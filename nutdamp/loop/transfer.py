"""What a `Law` takes for z, as a filter over the samples of its sensor: of the nutation a factor, of noise weights.

On a coast z runs as e^{(κ - iω)t}, ω the rate at which it turns back in the body. An estimate is Σ h_j s_{k-j} of the
samples s, which shows z times T = Σ h_j e^{-(κ - iω)jΔ}, a constant offset, and of white noise w the sum Σ h_j w_{k-j}.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from nutdamp.loop.law import ComplexArray, Law
from nutdamp.loop.sensor import HARMONIC, Estimator
from nutdamp.loop.watch import GRID
from nutdamp.loop_settings import ACCELEROMETER, Sensor

FORGOTTEN = 12.0
"""Time constants of the low-pass filter after which a sample counts no more."""

ENOUGH = 64
"""Samples of a nutation period that an accelerometer is followed by, at most about twice as many."""

LONGEST = 4096
"""Samples that count, at most."""


class Transfer(NamedTuple):
    """An estimate of z by samples ``step`` s apart: ``weights`` h (n,), the newest sample first.

    It shows ``direct`` z + ``mirrored`` conj(z) + ``offset``, and noise of ``sigma`` rad/s in each direction, of which
    in the frame that turns with z the share ``fresh`` is new in each sample. ``scatter``: sigma of a sample by parts
    (real, imaginary), the imaginary zero for an accelerometer. ``first`` s after a pulse is the first estimate.
    """

    step: float
    weights: ComplexArray
    direct: complex
    mirrored: complex
    offset: complex
    sigma: float
    fresh: float
    scatter: tuple[float, float]
    grain: tuple[float, float]
    first: float

    def mean(self, z: Any) -> Any:
        """What is seen of z without noise, numbers or arrays."""
        return self.direct * z + self.mirrored * np.conj(z) + self.offset

    def noise(self, white: ComplexArray) -> ComplexArray:
        """Noise of the estimates (m, k) by that of the samples (m, n + k), of which the oldest is older than needed."""
        count = len(self.weights)
        if count == 1:
            return np.asarray(self.weights[0] * white[:, :-1])
        parts = np.lib.stride_tricks.sliding_window_view(white[:, :-1], count, axis=1)
        return np.asarray(parts @ self.weights[::-1])

    def drawn(self, rng: np.random.Generator, rows: int, count: int) -> ComplexArray:
        """White noise of samples, (rows, count)."""
        real, other = self.scatter
        if real == other == 0.0:
            return np.zeros((rows, count), dtype=complex)
        found = (real * rng.standard_normal((rows, count))).astype(complex)
        return found + 1j * other * rng.standard_normal((rows, count)) if other > 0.0 else found

    def stepped(self, seen: ComplexArray) -> ComplexArray:
        """What is seen, in steps of a gyro."""
        if not any(self.grain):
            return seen
        raw, (first, second) = seen / self.weights[0], self.grain
        return np.asarray(
            self.weights[0] * (np.rint(raw.real / first) * first + 1j * np.rint(raw.imag / second) * second)
        )

    def change(self, white: ComplexArray, towards: complex, level: float) -> ComplexArray:
        """What makes the noise of the newest estimate ``level`` rad/s in a direction, as likely as it can be."""
        newest = self.weights[::-1]
        pull = newest.conj() * towards
        real, other = (one * one for one in self.scatter)
        missing = level - (complex(newest @ white) * towards.conjugate()).real
        along = real * pull.real + 1j * other * pull.imag
        return np.asarray(missing / float((along.real * pull.real + along.imag * pull.imag).sum()) * along)


def transfer(law: Law, spin: float) -> Transfer:
    """The estimates of a law at a spin of ``spin`` rad/s."""
    sensor, rate = law.loop.sensor, float(law.rate(spin))
    estimator, accelerometer = Estimator(law, sensor, 0.0), sensor.kind == ACCELEROMETER
    every = 1
    if accelerometer and law.loop.predict and sensor.low_pass == 0.0:
        every = max(estimator.window // ENOUGH, 1)  # as good as all, each with so much less noise
    step = every * estimator.step or law.period / GRID
    smooth, weights = _smoothing(sensor, step), np.ones(1, dtype=complex)
    if accelerometer:
        weights = _fitted(law, spin, step, round(estimator.window / every))
    first = estimator.since + (len(weights) - 1) * step
    weights = np.convolve(weights, smooth)[:LONGEST]
    if law.loop.predict:
        behind = complex(smooth @ np.exp(1j * rate * step * np.arange(len(smooth))))
        weights = weights * np.exp(-1j * rate * sensor.delay) / behind
    gain = complex(weights @ np.exp(-complex(law.growth, -rate) * step * np.arange(len(weights))))
    direct, mirrored, parts = gain * sensor.scale, 0j, law.gauge
    if accelerometer:
        shown = 0.5 * sensor.scale * spin * estimator.seen_gain
        image = complex(weights @ np.exp(-complex(law.growth, rate) * step * np.arange(len(weights))))
        direct, mirrored, parts = gain * shown.conjugate(), image * shown, (1.0, 0.0)
    noise, grain = (0.0, 0.0) if sensor.rate is None else (sensor.noise / math.sqrt(every), sensor.quantisation)
    size = math.hypot(noise, grain / math.sqrt(12.0 * every))
    if accelerometer or len(weights) > 1:
        noise, grain = size, 0.0
    power = float((abs(weights) ** 2).sum())
    lasting = complex(np.vdot(weights[:-1], weights[1:]) * np.exp(1j * rate * step)).real / power
    return Transfer(
        step=step,
        weights=weights,
        direct=direct,
        mirrored=mirrored,
        offset=complex(weights.sum()) * sensor.bias * complex(*parts),
        sigma=size * math.hypot(*parts) * math.sqrt(0.5 * power),
        fresh=min(max(1.0 - lasting, 1e-6), 1.0),
        scatter=(noise * parts[0], noise * parts[1]),
        grain=(grain * parts[0], grain * parts[1]),
        first=first,
    )


def _smoothing(sensor: Sensor, step: float) -> ComplexArray:
    """Weights of the low-pass filter, newest sample first."""
    if sensor.low_pass == 0.0:
        return np.ones(1, dtype=complex)
    count = min(math.ceil(FORGOTTEN * sensor.low_pass / step), LONGEST)
    memory = math.exp(-step / sensor.low_pass)
    return np.asarray((1.0 - memory) * memory ** np.arange(count), dtype=complex)


def _fitted(law: Law, spin: float, step: float, size: int) -> ComplexArray:
    """Weights of the sine that is fitted to ``size`` samples of an accelerometer, over what it shows of z."""
    angle = -float(law.rate(spin)) * step * np.arange(size)
    orders = (1, 2) if size >= HARMONIC else (1,)
    waves = [wave(order * angle) for order in orders for wave in (np.cos, np.sin)]
    rows = np.linalg.pinv(np.column_stack([np.ones(size), *waves]))
    return np.asarray((rows[1] + 1j * rows[2]) / (np.conj(Estimator(law, law.loop.sensor, 0.0).seen_gain) * spin))
