"""Body-fixed pulses at every alignment, Magnus 1970 section 4 and fig. 5: for ±1, ±2 one every
T_ω/4.
"""

from __future__ import annotations

import math

import numpy as np

from nutdamp.common import work
from nutdamp.errors import Infeasible, span
from nutdamp.flight import propagation
from nutdamp.schemes.catalogue import DEFAULT_SHARE, FourPulseOptions
from nutdamp.schemes.sequential import ImpulseBuilder, at_hand, fire_components, no_alignment
from nutdamp.spacecraft.constraints import Windows, usable
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule, channel_pulse

MOST_FLOWN = 200  # pulses that are laid one by one on the true motion, at most


def schedule(spacecraft: Spacecraft, options: FourPulseOptions) -> Schedule:
    """Fire each channel whenever it opposes ω and firing helps, until it no longer does.

    Coarse: equal pulses leave at most J/(2A). Fine: a last, shorter pulse leaves nothing, or at
    most J_min/(2A) where the rest is below the smallest pulse. The sign rule holds for both signs
    of a ω3. Raises Infeasible where no pulse fits or helps, or ``options.on_time`` is not within a
    channel's bounds.
    """
    channels = at_hand(spacecraft, usable(spacecraft))
    builder = ImpulseBuilder(spacecraft)
    on_times = {
        channel.name: _on_time(builder.period, channel, options.on_time) for channel in channels
    }
    turns = spacecraft.nutation_rate != 0.0
    if not turns:
        fire_components(builder, channels, options.on_time, coarse=options.coarse)
    while (
        turns and not builder.full and not builder.settled
    ):  # whichever helpful channel comes first
        pulses = []
        for channel in channels:  # a full one, or in fine damping one of the remaining size
            full = on_times[channel.name]
            just_enough = (
                None if options.coarse else builder.on_time_for(channel, builder.left, full)
            )
            pulses.append(builder.align(channel, full if just_enough is None else just_enough))
        helpful = [pulse for pulse in pulses if pulse is not None and builder.helps(pulse)]
        if not helpful:
            break
        builder.fire(min(helpful, key=lambda pulse: pulse.t))
    if not builder.pulses:
        raise no_alignment(spacecraft, channels)
    return builder.schedule()


# moments in a period at which pulses are looked at, shares of a full one
LOOKS = 240
SHARES = 0.88 ** np.arange(40)
LIKE, LEFT = (
    0.5,
    1e-4,
)  # share of the largest gain with which an earlier pulse is fired; rad left to correction


def on_true_motion(spacecraft: Spacecraft, options: FourPulseOptions) -> Schedule:
    """The law of ideal rate gyros for three moments, whose large nutation turns unevenly and at a
    rate of its own.

    Each pulse is one that lowers, as an impulse, the largest nutation of the motion that follows
    most.
    """
    from nutdamp.schemes.valve_commands import FlownBuilder

    channels = at_hand(spacecraft, usable(spacecraft))
    builder = FlownBuilder(spacecraft)
    most = spacecraft.limits.max_pulses or MOST_FLOWN
    while len(builder.pulses) < most and builder.at_leg.nutation > LEFT and not work.exhausted():
        pulse = _best_pulse(builder.at_leg, channels, options.on_time)
        after = builder.fork()
        if pulse is None:
            break
        after.fire([pulse])
        if after.at_leg.nutation >= builder.at_leg.nutation:
            break
        builder = after
    return builder.schedule()


def _best_pulse(
    at_leg: Spacecraft, channels: list[Channel], requested: float | None
) -> Pulse | None:
    """The pulse to fire next, within a period of the motion;
    None where none lowers the nutation.
    """
    from nutdamp.physics.triaxial import widest_cones

    windows = Windows(at_leg)
    earliest = at_leg.limits.earliest
    period = min(at_leg.motion_period, at_leg.horizon)
    times = earliest + np.linspace(0.0, period, LOOKS)
    rates = propagation.flown(at_leg, Schedule(), float(times[-1])).motion(times)[0].T
    moments = np.tile(np.array(at_leg.inertia.moments)[:, None], LOOKS)
    best = list[tuple[float, Pulse]]()
    for channel in channels:
        full = _on_time(period, channel, requested)
        tried = list[tuple[float, float, float]]()
        for on_time in dict.fromkeys(
            windows.on_time(full * share, channel.min_on_time, full) for share in SHARES
        ):
            after = rates + channel.torque[:, None] * on_time / moments
            left = widest_cones(moments, after, at_leg.sense, at_leg.inertia.wheel)[0]
            starts = times - 0.5 * on_time
            left[~windows.allowed(starts, np.full(LOOKS, on_time), earliest)] = math.inf
            at = int(np.argmin(left))
            tried.append((float(left[at]), float(times[at]), on_time))
        left_over, t, on_time = min(tried)
        best.append((at_leg.nutation - left_over, channel_pulse(channel, t, on_time)))
    most = max(gain for gain, _ in best)
    good = [pulse for gain, pulse in best if gain >= LIKE * most]
    return min(good, key=lambda pulse: pulse.t) if most > 0.0 else None


def _on_time(period: float, channel: Channel, requested: float | None) -> float:
    """Length of a full pulse of ``channel``, s."""
    if requested is None:
        return max(min(channel.max_on_time, DEFAULT_SHARE * period), channel.min_on_time)
    if not (channel.min_on_time <= requested <= channel.max_on_time and 0.0 < requested < math.inf):
        raise Infeasible(
            f"an on-time of {requested:.4g} s is outside what {channel.name} allows: "
            f"{span(channel.min_on_time, channel.max_on_time, 's')}"
        )
    return requested
