"""What the actuators can do, before any plan: steps of each channel, and how well two of them suit a pair."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

from nutdamp.physics import damping, rates
from nutdamp.spacecraft import Channel, Spacecraft


@dataclass(frozen=True, slots=True)
class ChannelSteps:
    """A channel and the nutation angles (rad) that its shortest and longest pulse take out or put in.

    ``smallest`` counts the command resolution too, and is 0 without any least on-time; ``largest`` is that of
    max_on_time, or of half a body nutation period where that is shorter, infinite where neither bounds it.
    """

    channel: Channel
    smallest: float
    largest: float


@dataclass(frozen=True, slots=True)
class PairFit:
    """Two channels for Magnus' two pulses at once: ``miss`` (rad) is how far the second is off the direction asked."""

    first: Channel
    second: Channel
    miss: float


def channel_steps(spacecraft: Spacecraft) -> tuple[ChannelSteps, ...]:
    """Smallest and largest step of each channel, in the order of the file."""
    period = spacecraft.body_period
    steps = []
    for channel in spacecraft.channels:
        shortest = max(channel.min_on_time, spacecraft.limits.tick or 0.0)
        longest = min(channel.max_on_time, 0.5 * period)
        steps.append(ChannelSteps(channel, _step(spacecraft, channel, shortest), _step(spacecraft, channel, longest)))
    return tuple(steps)


def _step(spacecraft: Spacecraft, channel: Channel, on_time: float) -> float:
    if math.isinf(on_time):
        return 0.5 * math.pi
    inertia, spin = spacecraft.inertia, spacecraft.spin
    factor = abs(rates.width_factor(inertia.a, spin, channel.axial / inertia.C, on_time))
    return math.atan2(abs(channel.transverse) * on_time * factor, inertia.C * abs(spin))


def mounting_angle(spacecraft: Spacecraft) -> float:
    """`damping.mounting_angle` of the spacecraft, rad."""
    inertia = spacecraft.inertia
    return damping.mounting_angle(inertia.A, inertia.C, spacecraft.transverse_rate, spacecraft.spin)


def nearest_pair(spacecraft: Spacecraft) -> PairFit | None:
    """The two channels whose directions come nearest to the turn between two half pulses; None without channels."""
    wanted = cmath.rect(
        1.0,
        damping.turn_between_halves(
            spacecraft.inertia.A, spacecraft.inertia.C, spacecraft.transverse_rate, spacecraft.spin
        ),
    )
    usable = [channel for channel in spacecraft.channels if channel.damps]
    pairs = [
        PairFit(one, two, cmath.phase(two.transverse * (one.transverse * wanted).conjugate()))
        for one in usable
        for two in usable
    ]
    return min(pairs, key=lambda pair: abs(pair.miss), default=None)
