"""One pulse of A|ω| against ω, Magnus 1970 (21): the nutation goes, H moves to the spin axis, by θ0."""

from __future__ import annotations

import math
from collections.abc import Callable

from nutdamp.errors import Infeasible
from nutdamp.physics import rates
from nutdamp.schedule import Pulse, Schedule
from nutdamp.schemes import Options
from nutdamp.schemes.advice import no_alignment, no_channels, remainder
from nutdamp.schemes.walk import Walk
from nutdamp.spacecraft import Channel, Spacecraft, Steerable

TRAIN_SHARE = 0.25
"""Longest pulse of a train, as a share of T_ω: it loses 10 % of its impulse to its width."""


def schedule(spacecraft: Spacecraft, options: Options) -> Schedule:  # noqa: ARG001 - the signature of a scheme
    """One pulse, or a train of equal ones where on-times are too short or the torque too weak for one.

    A steerable torquer fires at once. A body-fixed channel waits until it opposes ω; the channel that needs
    the fewest pulses, then the least propellant (impulse where unknown), then ends first, is taken.
    """
    torquer = spacecraft.torquer
    if torquer is not None:
        walk = _steered(spacecraft, torquer)
        if walk.pulses:
            return walk.schedule(*remainder(walk))
        raise Infeasible(f"no pulse of the steerable torquer fits before the horizon of {spacecraft.horizon:.4g} s")
    channels = [channel for channel in spacecraft.channels if channel.damps]
    if not channels:
        raise Infeasible(no_channels(spacecraft))
    walks = [walk for walk in (_fixed(spacecraft, channel) for channel in channels) if walk.pulses]
    if not walks:
        raise Infeasible(no_alignment(spacecraft, channels))
    best = min(walks, key=_preference)
    return best.schedule(*remainder(best))


def _preference(walk: Walk) -> tuple[bool, int, float, float]:
    chosen = walk.schedule()
    cost = chosen.total_impulse if chosen.propellant is None else chosen.propellant
    return not walk.settled and walk.left > 0.01 * walk.spacecraft.least_impulse, len(chosen), cost, chosen.end


def _fixed(spacecraft: Spacecraft, channel: Channel) -> Walk:
    """Pulses of one channel at its successive alignments."""
    walk = Walk(spacecraft)

    def fire(impulse: float) -> Pulse | None:
        on_time = walk.on_time_for(channel, impulse)
        return walk.align(channel, channel.max_on_time if on_time is None else on_time)

    spin_rate = channel.axial / walk.C
    _train(walk, abs(channel.transverse), spin_rate, channel.max_on_time, fire)
    return walk


def _steered(spacecraft: Spacecraft, torquer: Steerable) -> Walk:
    """Pulses of a steerable torquer, one behind the other."""
    walk = Walk(spacecraft)
    torque = math.inf if torquer.torque is None else torquer.torque
    _train(walk, torque, 0.0, math.inf, lambda impulse: walk.steer(torquer, impulse))
    return walk


def _train(
    walk: Walk, torque: float, spin_rate: float, max_on_time: float, fire: Callable[[float], Pulse | None]
) -> None:
    """Fire the fewest equal pulses that take out what is left; stop where the limits end it or nothing is gained."""

    def capacity(on_time: float) -> float:
        if math.isinf(torque) or math.isinf(on_time):
            return math.inf
        return torque * on_time * abs(rates.width_factor(walk.a, walk.spin, spin_rate, on_time))

    longest = min(max_on_time, 0.5 * walk.period)
    count = 1
    if walk.left > capacity(longest):
        count = math.ceil(walk.left / capacity(min(max_on_time, TRAIN_SHARE * walk.period)))
        most = walk.spacecraft.limits.max_pulses
        if most is not None and count > most:  # rather longer pulses than too many
            count = min(most, math.ceil(walk.left / capacity(longest)))
    for remaining in range(count, 0, -1):
        pulse = fire(min(walk.left / remaining, capacity(longest)))
        if pulse is None or walk.left_after(pulse) >= walk.left:
            return
        walk.fire(pulse)
