"""Stability of the loop channel by channel, and first passage of its thresholds.

A firing that comes ε late against z leaves |z - J e^{iε}|: its gain is that over |z|, below 1 while
cos ε > J/(2|z|). Meanwhile energy dissipation lets the nutation grow by e^{κT} in a period T: the
loop damps where the product is below 1.

On a coast z runs as e^{(κ - iω)t}, ω the rate at which it turns back in the body. An estimate is Σ
h_j s_{k-j} of the samples s, which shows z times T = Σ h_j e^{-(κ - iω)jΔ}, a constant offset, and
of white noise w the sum Σ h_j w_{k-j}.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from nutdamp.control_loop.controller import GRID
from nutdamp.control_loop.law import Actuator, ComplexArray, Law
from nutdamp.control_loop.sensor import HARMONIC, Estimator, lag
from nutdamp.errors import Infeasible
from nutdamp.spacecraft.constraints import effective_on_time, shortest_on_time
from nutdamp.spacecraft.equipment import ACCELEROMETER, Loop, Sensor
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Bound, Part

NEVER = 1e3  # growth e^{κT} from which on further growth does not matter


@dataclass(frozen=True, slots=True)
class Margin:
    """Stability margin of a ``channel`` at a ``nutation`` (rad)."""

    channel: str
    nutation: float
    late: float  # largest delay, rad
    latest: float  # delay up to which it damps, rad
    gain: float  # share of the nutation that the largest delay leaves
    growth: float  # factor of a period
    # s by which it may come later still; negative: too late, minus infinity: no firing damps
    delay: float
    turned: bool  # sensor or channel, not both, reversed in the file: not counted in these figures

    @property
    def damps(self) -> bool:
        """True if a firing removes more than grows in a period."""
        return self.gain * self.growth < 1.0


def margins(
    spacecraft: Spacecraft, loop: Loop, nutation: float | None = None
) -> tuple[Margin, ...]:
    """Margin of each channel at a ``nutation`` (rad), default the start threshold; raises
    Infeasible as `Law`.
    """
    law = Law(spacecraft, loop)
    theta = loop.start if nutation is None else nutation
    return tuple(_margin(law, actuator, theta, spacecraft.spin) for actuator in law.actuators)


def feeding(spacecraft: Spacecraft, loop: Loop) -> Margin | None:
    """Channel that does not damp, at the start threshold or, if larger,
    at the nutation at t = 0.
    """
    angles = [loop.start, spacecraft.nutation] if spacecraft.nutation > loop.start else [loop.start]
    all_margins = (margin for theta in angles for margin in margins(spacecraft, loop, theta))
    return next((margin for margin in all_margins if not margin.damps), None)


def expect_in_time(spacecraft: Spacecraft, loop: Loop) -> None:
    """Raise Infeasible where firings would feed the nutation by how late they come."""
    late = feeding(spacecraft, loop)
    if late is not None:
        raise Infeasible(too_late(late))


def too_late(margin: Margin) -> str:
    """Message on a channel of a loop that does not damp."""
    late, latest, theta = np.degrees([margin.late, margin.latest, margin.nutation])
    what = (
        f"a firing of {margin.channel} leaves {100.0 * margin.gain:.4g} % of a nutation of "
        f"{theta:.4g} deg"
    )
    if margin.growth > 1.0:
        what += f", which grows by {100.0 * (margin.growth - 1.0):.3g} % in a period"
    if margin.delay == -np.inf:
        return f"the loop does not damp: {what}; raise start, or allow other on-times"
    return (
        f"the loop does not damp: {what}. It fires up to {late:.4g} deg late, and damps "
        f"up to {latest:.4g} deg; shorten the delays by {-margin.delay:.4g} s, or set "
        "predict: true"
    )


def _margin(law: Law, actuator: Actuator, theta: float, spin: float) -> Margin:
    loop = law.loop
    rate = abs(float(law.rate(spin)))
    size = law.size(theta, spin)
    firing = law.firing(actuator, complex(abs(loop.sensor.scale) * size), spin)
    growth = min(math.exp(min(law.growth * law.period, math.log(NEVER))), NEVER)
    pull = 0.0 if firing is None else abs(firing.acts) / size
    late = 0.0
    if firing is not None and not loop.predict:
        sampling = 0.0 if loop.sensor.rate is None else 1.0 / loop.sensor.rate
        late = abs(lag(law, loop.sensor, spin)) + rate * (firing.lead + sampling)
    latest = _most_late(pull, growth)
    turned = (loop.sensor.scale < 0.0) != (actuator.channel.name in loop.reversed)
    gain = abs(1.0 - pull * cmath.exp(1j * late))
    return Margin(
        actuator.channel.name, theta, late, latest, gain, growth, (latest - late) / rate, turned
    )


def _most_late(pull: float, growth: float) -> float:
    """Largest ε in [0, π] with which a firing that takes ``pull`` (of |z|) off damps; -inf where
    none does: |1 - p e^{iε}|² g² = (1 - 2p cos ε + p²) g² = 1 at its end.
    """
    if abs(1.0 - pull) * growth >= 1.0:
        return -math.inf
    square = growth * growth
    # Of a firing that takes nothing off any delay damps, as far as the nutation decays by itself.
    cosine = (square * (1.0 + pull * pull) - 1.0) / max(2.0 * pull * square, 1e-300)
    return math.acos(min(max(cosine, -1.0), 1.0))


class Band(NamedTuple):
    """Nutation, rad, left by a loop as it settles."""

    most: float  # in `SURELY` of the cases
    noise: float  # by the sensor
    step: float  # that the smallest pulse takes away
    tilt: float  # that gyros show of ω3, their axes being tilted


SURELY = 0.99  # share of the cases that keep the `Band`


def dead_band(spacecraft: Spacecraft, loop: Loop) -> Band:
    """Nutation that is left as the loop settles; raises Infeasible as `Law`.

    |z| is the stop threshold, bias, steps, and noise of which one of N samples exceeds
    σ sqrt(2 ln(N/p)) in a share p. Where half the smallest pulse is more, firings end there: noise
    counts in the size and in both parts of the firing.
    """
    law = Law(spacecraft, loop)
    spin = spacecraft.spin
    sensor = loop.sensor
    doubts = Estimator(law, sensor, 0.0).doubts
    looks = 1.0 if loop.sensor.rate is None else max(loop.sensor.rate * law.period, 1.0)
    noise = doubts.noise / math.sqrt(2.0) * math.sqrt(2.0 * math.log(looks / (1.0 - SURELY)))
    noise = (doubts.bias + doubts.steps + noise) / abs(loop.sensor.scale)
    steps = []
    for actuator in law.actuators:
        shortest = effective_on_time(
            actuator.channel, shortest_on_time(spacecraft, actuator.channel)
        )
        steps.append(abs(actuator.kick) * max(actuator.shortest, shortest))
    stop = law.size(loop.stop, spin) / abs(loop.sensor.scale)
    floor = 0.5 * max(steps)
    left_over = stop + noise if floor <= stop else floor + 3.0 * noise
    grown = math.exp(min(max(law.growth, 0.0) * loop.sensor.delay, math.log(NEVER)))
    unbiased = Estimator(law, replace(sensor, bias=0.0, second=None), 0.0)
    tilt = 0.0 if sensor.kind == ACCELEROMETER else abs(unbiased.standing(spin))
    angles = [
        float(law.nutation(size, spin)) for size in (left_over * grown, noise, max(steps), tilt)
    ]
    return Band(*angles)


HELD = 1.05
"""Nutation, over the start threshold, that a loop may let stand without a requirement: it grows
while the loop waits for the phase of its firing, by a twentieth where a time constant is ten
nutation periods (upper-stage: 0.1 %).
"""


def held_by(loop: Loop, band: Band, bound: Bound) -> Bound:
    """The bound itself; one of the nutation that nobody requires is by thresholds and dead band,
    rounded up to two digits of a degree.
    """
    if bound.required or bound.part is not Part.NUTATION:
        return bound
    limit = math.degrees(max(band.most, HELD * loop.start + band.noise))
    unit = 10.0 ** (math.floor(math.log10(limit)) - 1)
    return bound._replace(limit=math.radians(math.ceil(limit / unit) * unit), by_loop=True)


FORGOTTEN = 12.0  # time constants of the low-pass filter after which a sample counts no more
# samples of a nutation period that an accelerometer is followed by, at most about twice as many
ENOUGH = 64
LONGEST_RESPONSE = 4096  # samples that count, at most


class Transfer(NamedTuple):
    """An estimate of z by samples: it shows ``direct`` z + ``mirrored`` conj(z) + ``offset``, and
    noise.
    """

    step: float  # s from sample to sample
    weights: ComplexArray  # h (n,), the newest sample first
    direct: complex
    mirrored: complex
    offset: complex
    sigma: float  # of the noise in each direction, rad/s
    fresh: float  # share of it that is new in each sample, in the frame that turns with z
    scatter: tuple[
        float, float
    ]  # sigma of a sample by parts (real, imaginary), imaginary zero for an accelerometer
    grain: tuple[float, float]  # steps of a gyro by these
    first: float  # s after a pulse: the first estimate

    def mean(self, z: Any) -> Any:
        """Observed z without noise, numbers or arrays."""
        return self.direct * z + self.mirrored * np.conj(z) + self.offset


def transfer(law: Law, spin: float) -> Transfer:
    """Transfer of the estimates of a law at a spin of ``spin`` rad/s."""
    sensor = law.loop.sensor
    rate = float(law.rate(spin))
    estimator = Estimator(law, sensor, 0.0)
    accelerometer = sensor.kind == ACCELEROMETER
    every = 1
    if accelerometer and law.loop.predict and sensor.low_pass == 0.0:
        every = max(estimator.window // ENOUGH, 1)  # as good as all, each with so much less noise
    step = every * estimator.step or law.period / GRID
    smooth = _smoothing(sensor, step)
    weights = np.ones(1, dtype=complex)
    if accelerometer:
        weights = _fitted(law, spin, step, round(estimator.window / every))
    first = estimator.since + (len(weights) - 1) * step
    weights = np.convolve(weights, smooth)[:LONGEST_RESPONSE]
    if law.loop.predict:
        behind = complex(smooth @ np.exp(1j * rate * step * np.arange(len(smooth))))
        weights = weights * np.exp(-1j * rate * sensor.delay) / behind
    gain = complex(weights @ np.exp(-complex(law.growth, -rate) * step * np.arange(len(weights))))
    direct = gain * sensor.scale
    mirrored = 0j
    parts = law.gauge
    standing = sensor.bias + 0j if accelerometer else estimator.standing(spin)
    if accelerometer:
        shown = 0.5 * sensor.scale * spin * estimator.seen_gain
        image = complex(
            weights @ np.exp(-complex(law.growth, rate) * step * np.arange(len(weights)))
        )
        direct = gain * shown.conjugate()
        mirrored = image * shown
        parts = (1.0, 0.0)
    noise, grain = (
        (0.0, 0.0)
        if sensor.rate is None
        else (sensor.noise / math.sqrt(every), sensor.quantisation)
    )
    size = math.hypot(noise, grain / math.sqrt(12.0 * every))
    if accelerometer or len(weights) > 1:
        noise = size
        grain = 0.0
    power = float((abs(weights) ** 2).sum())
    lasting = complex(np.vdot(weights[:-1], weights[1:]) * np.exp(1j * rate * step)).real / power
    return Transfer(
        step=step,
        weights=weights,
        direct=direct,
        mirrored=mirrored,
        offset=complex(weights.sum()) * standing,
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
    count = min(math.ceil(FORGOTTEN * sensor.low_pass / step), LONGEST_RESPONSE)
    memory = math.exp(-step / sensor.low_pass)
    return np.asarray((1.0 - memory) * memory ** np.arange(count), dtype=complex)


def _fitted(law: Law, spin: float, step: float, size: int) -> ComplexArray:
    """Weights of the sine fitted to ``size`` samples of an accelerometer, over its gain for z."""
    angle = -float(law.rate(spin)) * step * np.arange(size)
    orders = (1, 2) if size >= HARMONIC else (1,)
    waves = [wave(order * angle) for order in orders for wave in (np.cos, np.sin)]
    rows = np.linalg.pinv(np.column_stack([np.ones(size), *waves]))
    return np.asarray(
        (rows[1] + 1j * rows[2]) / (np.conj(Estimator(law, law.loop.sensor, 0.0).seen_gain) * spin)
    )


# sizes of z at which the probability of an event is computed, far off and again near the threshold
FINE = 1500
FARTHEST = 1e-12  # share of a threshold below which a nutation is none
REACH = 12.0  # sigmas of noise within which sizes lie closer together
PHASES = 16  # directions of z against the bias over which a chance is averaged
CURVED = 12.0  # sigmas within which a size is so small that noise across it counts


class Odds:
    """First passage: an estimate of at least ``limit`` rad/s, while z grows by ``growth`` 1/s.

    The chances of the samples add up along a coast: an event is where the sum has come to an
    exponential number.
    """

    def __init__(self, seen: Transfer, limit: float, growth: float) -> None:
        gain, offset = abs(seen.direct), abs(seen.offset)
        reach = offset + REACH * seen.sigma + 1e-6 * limit
        wide = np.geomspace(FARTHEST * (limit + reach), 100.0 * (limit + reach), FINE)
        near = limit + reach * np.linspace(-1.0, 1.0, FINE)
        shown = np.union1d(wide, near[near > wide[0]])
        sigma = max(seen.sigma, 1e-9 * limit, 1e-300)
        phases = PHASES if offset > 0.0 else 1
        turns = np.exp(2j * np.pi * np.arange(phases) / phases)
        sizes = np.abs(shown[:, None] * turns + seen.offset)
        chance = exceeds(limit / sigma, sizes / sigma)
        chance = (chance * _clustered(seen.fresh, np.abs(limit - sizes) / sigma)).mean(axis=1)
        expected = -np.log1p(-np.minimum(chance, 1.0 - 1e-15)) / (growth * seen.step)
        self.sizes = np.log(shown / gain)
        pieces = 0.5 * (expected[1:] + expected[:-1]) * np.diff(self.sizes)
        self.sum = np.concatenate([[0.0], np.cumsum(pieces)])

    def size(self, now: Any, drawn: Any) -> Any:
        """Size |z| (rad/s) at the event, from ``now`` on, by exponential numbers; infinite where it
        does not come.
        """
        reached = np.interp(np.log(now), self.sizes, self.sum) + drawn
        sizes = np.maximum(np.exp(np.interp(reached, self.sum, self.sizes)), now)
        return np.where(reached > self.sum[-1], math.inf, sizes)


def _clustered(fresh: float, apart: Vector) -> Any:
    """Share of the samples beyond a threshold, ``apart`` sigmas off, that are the first of a
    cluster of such.

    Where ``fresh`` is the share of noise that is new in each sample: x²/2 ν(x), x = apart sqrt(2
    fresh), as of a random walk with drift, ν(x) = (2/x) (Φ(x/2) - 1/2) / (x/2 Φ(x/2) + φ(x/2))
    (Siegmund and Yakir 2007).
    """
    if fresh > 0.5:
        return 1.0
    from scipy.special import ndtr  # budgets

    half = 0.5 * np.maximum(apart, 1.0) * math.sqrt(2.0 * fresh)
    below = ndtr(half)
    return (
        2.0
        * half
        * (below - 0.5)
        / (half * below + np.exp(-0.5 * half * half) / math.sqrt(2.0 * math.pi))
    )


def exceeds(limit: float, shown: Vector) -> Vector:
    """Probability of |``shown`` + n| >= ``limit`` with n normal, one sigma in each direction:
    |shown + n|² is χ² of 2 degrees of freedom with the noncentrality shown² (Rice).
    """
    from scipy.special import chndtr, ndtr  # budgets

    near = (shown < CURVED) & (limit < 3.0 * CURVED)
    curved = 1.0 - chndtr(limit * limit, 2.0, np.where(near, shown, 0.0) ** 2)
    return np.asarray(np.where(near, curved, ndtr(shown - limit)))
