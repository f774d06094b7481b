"""Body-fixed pulses at every alignment, Magnus 1970 section 4 and fig. 5: for ±1, ±2 one every T_ω/4."""

from __future__ import annotations

import math

from nutdamp.errors import Infeasible, span
from nutdamp.schemes.catalogue import DEFAULT_SHARE, FourPulseOptions
from nutdamp.schemes.sequential import ImpulseBuilder, at_hand, fire_components, no_alignment
from nutdamp.spacecraft.constraints import usable
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule


def schedule(spacecraft: Spacecraft, options: FourPulseOptions) -> Schedule:
    """Fire each channel whenever it opposes ω and firing helps, until it no longer does.

    Coarse: equal pulses leave at most J/(2A). Fine: a last, shorter pulse leaves nothing, or at most J_min/(2A) where
    the rest is below the smallest pulse. The sign rule holds for both signs of a ω3. Raises
    Infeasible where no pulse fits or helps, or ``options.on_time`` is not within a channel's bounds.
    """
    channels = at_hand(spacecraft, usable(spacecraft))
    builder = ImpulseBuilder(spacecraft)
    on_times = {channel.name: _on_time(builder, channel, options.on_time) for channel in channels}
    turns = spacecraft.nutation_rate != 0.0
    if not turns:
        fire_components(builder, channels, options.on_time, coarse=options.coarse)
    while turns and not builder.full and not builder.settled:  # whichever helpful channel comes first
        pulses = []
        for channel in channels:  # a full one, or in fine damping one of the remaining size
            full = on_times[channel.name]
            just_enough = None if options.coarse else builder.on_time_for(channel, builder.left, full)
            pulses.append(builder.align(channel, full if just_enough is None else just_enough))
        helpful = [pulse for pulse in pulses if pulse is not None and builder.helps(pulse)]
        if not helpful:
            break
        builder.fire(min(helpful, key=lambda pulse: pulse.t))
    if not builder.pulses:
        raise no_alignment(spacecraft, channels)
    return builder.schedule()


def _on_time(builder: ImpulseBuilder, channel: Channel, requested: float | None) -> float:
    """Length of a full pulse of ``channel``, s."""
    if requested is None:
        return max(min(channel.max_on_time, DEFAULT_SHARE * builder.period), channel.min_on_time)
    if not (channel.min_on_time <= requested <= channel.max_on_time and 0.0 < requested < math.inf):
        raise Infeasible(
            f"an on-time of {requested:.4g} s is outside what {channel.name} allows: "
            f"{span(channel.min_on_time, channel.max_on_time, 's')}"
        )
    return requested
