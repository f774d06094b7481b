"""Stability of the loop channel by channel: nutation removed by a firing against its growth until the next.

A firing that comes ε late against z leaves |z - J e^{iε}|: its gain is that over |z|, below 1 while cos ε > J/(2|z|).
Meanwhile energy dissipation lets the nutation grow by e^{κT} in a period T: the loop damps where the
product is below 1.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from nutdamp.control_loop.law import Actuator, Law
from nutdamp.control_loop.sensor import Estimator, lag
from nutdamp.spacecraft.constraints import effective_on_time, shortest_on_time
from nutdamp.spacecraft.equipment import Loop
from nutdamp.spacecraft.model import Spacecraft

HALVINGS = 60
"""Steps in which the largest lateness that still damps is found."""

NEVER = 1e3
"""Growth e^{κT} from which on further growth does not matter."""


class Cause(NamedTuple):
    """Causes that reverse firings of a channel: the sensor, or that the channel is ``backwards``."""

    sensor: bool
    backwards: bool

    @property
    def turned(self) -> bool:
        """True if a firing feeds the nutation: two errors cancel."""
        return self.sensor != self.backwards


@dataclass(frozen=True, slots=True)
class Margin:
    """Channel at a ``nutation`` (rad): its largest delay ``late`` (rad), and the share (``gain``) that this leaves.

    It damps while no later than ``latest`` rad. ``growth`` is the factor of a period. ``delay``: s by which it may come
    later still; negative where it comes too late, minus infinity where no firing damps. ``cause``: faults in the file,
    not counted in these figures.
    """

    channel: str
    nutation: float
    late: float
    latest: float
    gain: float
    growth: float
    delay: float
    cause: Cause

    @property
    def damps(self) -> bool:
        """True if a firing removes more than grows in a period."""
        return self.gain * self.growth < 1.0


def margins(spacecraft: Spacecraft, loop: Loop, nutation: float | None = None) -> tuple[Margin, ...]:
    """Margin of each channel at a ``nutation`` (rad), default the start threshold; raises Infeasible as `Law`."""
    law = Law(spacecraft, loop)
    theta = loop.start if nutation is None else nutation
    return tuple(_margin(law, actuator, theta, spacecraft.spin) for actuator in law.actuators)


def feeding(spacecraft: Spacecraft, loop: Loop) -> Margin | None:
    """Channel that does not damp, at the start threshold or, if larger, at the nutation at t = 0."""
    angles = [loop.start, spacecraft.nutation] if spacecraft.nutation > loop.start else [loop.start]
    all_margins = (margin for theta in angles for margin in margins(spacecraft, loop, theta))
    return next((margin for margin in all_margins if not margin.damps), None)


def too_late(margin: Margin) -> str:
    """Message on a channel of a loop that does not damp."""
    degrees = np.degrees(margin.late)
    theta = np.degrees(margin.nutation)
    what = f"a firing of {margin.channel} leaves {100.0 * margin.gain:.4g} % of a nutation of {theta:.4g} deg"
    if margin.growth > 1.0:
        what += f", which grows by {100.0 * (margin.growth - 1.0):.3g} % in a period"
    if margin.delay == -np.inf:
        return f"the loop does not damp: {what}; raise start, or allow other on-times"
    late = f"it comes up to {degrees:.4g} deg late, and damps up to {np.degrees(margin.latest):.4g} deg"
    return f"the loop does not damp: {what}: {late}; shorten the delays by {-margin.delay:.4g} s, or set predict: true"


def _margin(law: Law, actuator: Actuator, theta: float, spin: float) -> Margin:
    loop, rate = law.loop, abs(float(law.rate(spin)))
    size = law.size(theta, spin)
    firing = law.firing(actuator, complex(abs(loop.sensor.scale) * size), spin)
    growth = min(math.exp(min(law.growth * law.period, math.log(NEVER))), NEVER)
    pull = 0.0 if firing is None else abs(firing.acts) / size
    late = 0.0
    if firing is not None and not loop.predict:
        sampling = 0.0 if loop.sensor.rate is None else 1.0 / loop.sensor.rate
        late = abs(lag(law, loop.sensor, spin)) + rate * (firing.lead + sampling)
    most = _most_late(pull, growth)
    cause = Cause(loop.sensor.scale < 0.0, actuator.channel.name in loop.reversed)
    gain = abs(1.0 - pull * cmath.exp(1j * late))
    return Margin(actuator.channel.name, theta, late, most, gain, growth, (most - late) / rate, cause)


def _most_late(pull: float, growth: float) -> float:
    """Largest ε in [0, π] with which a firing that takes ``pull`` (of |z|) off damps; -inf where none does."""
    if abs(1.0 - pull) * growth >= 1.0:
        return -math.inf
    low, high = 0.0, math.pi
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        damps = abs(1.0 - pull * cmath.exp(1j * middle)) * growth < 1.0
        low, high = (middle, high) if damps else (low, middle)
    return low


class Band(NamedTuple):
    """Nutation, rad, left by a loop as it settles: at most ``most`` in `SURELY` of the cases.

    ``noise`` is what the sensor adds to it, ``step`` what the smallest pulse takes away.
    """

    most: float
    noise: float
    step: float


SURELY = 0.99
"""Share of the cases that keep the `Band`."""


def dead_band(spacecraft: Spacecraft, loop: Loop) -> Band:
    """Nutation that is left as the loop settles; raises Infeasible as `Law`.

    The sensor shows no more than the stop threshold in one sample of a period: |z| is that and bias, steps, and noise
    of which one of N samples exceeds σ sqrt(2 ln(N/p)) in a share p. Where half the smallest pulse
    is more than the stop threshold, firings end there, the noise counted in the size and in both parts of the firing.
    """
    law, spin = Law(spacecraft, loop), spacecraft.spin
    estimator = Estimator(law, loop.sensor, 0.0)
    looks = 1.0 if loop.sensor.rate is None else max(loop.sensor.rate * law.period, 1.0)
    noise = estimator.offset + estimator.doubt / math.sqrt(2.0) * math.sqrt(2.0 * math.log(looks / (1.0 - SURELY)))
    noise /= abs(loop.sensor.scale)
    steps = [abs(actuator.kick) * _shortest(spacecraft, actuator) for actuator in law.actuators]
    stop = law.size(loop.stop, spin) / abs(loop.sensor.scale)
    floor = 0.5 * max(steps)
    most = stop + noise if floor <= stop else floor + 3.0 * noise
    grown = math.exp(min(max(law.growth, 0.0) * loop.sensor.delay, math.log(NEVER)))
    angles = [float(law.nutation(size, spin)) for size in (most * grown, noise, max(steps))]
    return Band(*angles)


def _shortest(spacecraft: Spacecraft, actuator: Actuator) -> float:
    least = shortest_on_time(spacecraft, actuator.channel)
    return max(actuator.shortest, effective_on_time(actuator.channel, least))
