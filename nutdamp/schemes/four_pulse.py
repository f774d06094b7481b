"""Body-fixed pulses at every alignment, Magnus 1970 section 4 and fig. 5: for ±1, ±2 one every
T_ω/4.
"""

from __future__ import annotations

import math

from nutdamp.errors import Infeasible, span
from nutdamp.schemes.catalogue import DEFAULT_SHARE, FourPulseOptions
from nutdamp.schemes.sequential import ImpulseBuilder, fire_components, no_alignment
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import at_hand, usable, without_waste
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import Schedule

# share of the nutation allowed that channels left out may leave: the tolerances need the other half
FILLED = 0.5


# End of a schedule without the channels that waste, over that with all, up to which it is taken
# where values are dispersed: errors of the moments of inertia grow with time. At 1.44 times 81 % of
# the cases complied in place of 91 %, at 2.3 times 95 % in place of all.
LATER = 1.25


def schedule(spacecraft: Spacecraft, options: FourPulseOptions) -> Schedule:
    """Fire each channel whenever it opposes ω and firing helps, until it no longer does.

    Coarse: equal pulses leave at most J/(2A). Fine: a last, shorter pulse leaves nothing, or at
    most J_min/(2A) where the rest is below the smallest pulse. The sign rule holds for both signs
    of a ω3. Channels that waste fire only what the others leave, unless that misses the nutation
    required, takes more of ``options.least`` or, in dispersed cases, ends much `LATER`. Raises
    Infeasible where no pulse fits or helps, or ``options.on_time`` is not within a channel's
    bounds.
    """
    channels = at_hand(spacecraft, usable(spacecraft))
    thrifty = without_waste(spacecraft, channels)
    if spacecraft.nutation_rate == 0.0:
        builder = ImpulseBuilder(spacecraft)
        fire_components(builder, channels, options.on_time, coarse=options.coarse)
        builders = [builder]
    else:
        builders = [_fired(spacecraft, options, channels, channels)]
        if len(thrifty) < len(channels):
            builders.insert(0, _fired(spacecraft, options, thrifty, channels))
    laid = [builder for builder in builders if builder.pulses]
    if not laid:
        raise no_alignment(spacecraft, channels)
    enough = [builder.schedule() for builder in laid if suffices(spacecraft, builder.nutation)]
    if enough:
        soonest = min(schedule.end for schedule in enough)
        if spacecraft.dispersions is not None:
            enough = [schedule for schedule in enough if schedule.end <= LATER * soonest]
        return min(enough, key=lambda schedule: schedule.spent(options.least))
    return min(laid, key=lambda builder: builder.left).schedule()


def _fired(
    spacecraft: Spacecraft,
    options: FourPulseOptions,
    first: list[Channel],
    channels: list[Channel],
) -> ImpulseBuilder:
    """Pulses of the channels that are ``first``, then of all where those leave too much."""
    builder = ImpulseBuilder(spacecraft)
    on_times = {
        channel.name: full_on_time(builder.period, channel, options.on_time) for channel in channels
    }
    for firing in (first, channels):
        enough = options.coarse and suffices(spacecraft, builder.nutation)
        if builder.pulses and enough:
            break
        while not builder.full and not builder.settled:  # whichever helpful channel comes first
            pulses = []
            for channel in firing:  # a full one, or in fine damping one of the remaining size
                full = on_times[channel.name]
                just_enough = (
                    None if options.coarse else builder.on_time_for(channel, builder.left, full)
                )
                pulses.append(builder.align(channel, full if just_enough is None else just_enough))
            helpful = [pulse for pulse in pulses if pulse is not None and builder.helps(pulse)]
            if not helpful:
                break
            builder.fire(min(helpful, key=lambda pulse: pulse.t))
    return builder


def suffices(spacecraft: Spacecraft, nutation: float) -> bool:
    """True if a ``nutation`` (rad) uses no more than `FILLED` of what is allowed at the end."""
    bounds = requirements.bounds(spacecraft)
    return all(bound.met(nutation / FILLED) for bound in bounds if bound.part is Part.NUTATION)


def full_on_time(period: float, channel: Channel, requested: float | None) -> float:
    """Length of a full pulse of ``channel``, s."""
    if requested is None:
        return max(min(channel.max_on_time, DEFAULT_SHARE * period), channel.min_on_time)
    if not (channel.min_on_time <= requested <= channel.max_on_time and 0.0 < requested < math.inf):
        raise Infeasible(
            f"an on-time of {requested:.4g} s is outside what {channel.name} allows: "
            f"{span(channel.min_on_time, channel.max_on_time, 's')}"
        )
    return requested
