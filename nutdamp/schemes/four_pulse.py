"""Body-fixed pulses at every alignment, Magnus 1970 section 4 and fig. 5: for ±1, ±2 one every T_ω/4."""

from __future__ import annotations

import itertools
import math

from nutdamp.errors import Infeasible, span
from nutdamp.schemes.catalogue import DEFAULT_SHARE, FourPulseOptions
from nutdamp.schemes.sequential import ImpulseBuilder, at_hand, no_alignment
from nutdamp.spacecraft.constraints import usable
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse


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
        _standing(builder, channels, options)
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


def _standing(builder: ImpulseBuilder, channels: list[Channel], options: FourPulseOptions) -> None:
    """Pulses on a sphere: ω does not turn, so the channels beside -ω share it, |cos φ| + |sin φ| for ±1, ±2."""
    for channel, impulse in _shares(channels, -builder.A * builder.omega):
        unit = impulse / abs(channel.transverse)
        longest = channel.max_on_time if options.on_time is None else options.on_time
        count = 1 if math.isinf(longest) else max(math.ceil(unit / longest - 1e-9), 1)
        for _ in range(count):
            needed = longest if options.coarse and not math.isinf(longest) else unit / count
            on_time = builder.windows.on_time(needed, channel.min_on_time, channel.max_on_time)
            start = builder.windows.earliest_start(on_time, builder.ready)
            if builder.full or start is None:
                return
            pulse = channel_pulse(channel, start + 0.5 * on_time, on_time)
            if not builder.helps(pulse):
                break
            builder.fire(pulse)


def _shares(channels: list[Channel], target: complex) -> list[tuple[Channel, float]]:
    """Impulses >= 0 (N m s) along channel directions that sum to ``target`` with least total; else the nearest."""
    best: list[tuple[Channel, float]] = []
    least = math.inf
    for left, right in itertools.combinations(channels, 2):
        d1, d2 = (channel.transverse / abs(channel.transverse) for channel in (left, right))
        area = (d1.conjugate() * d2).imag
        if abs(area) < 1e-9:
            continue
        first, second = (target.conjugate() * d2).imag / area, (d1.conjugate() * target).imag / area
        if min(first, second) >= -1e-12 * abs(target) and first + second < least:
            least = first + second
            best = [(left, first), (right, second)]
    if not best:
        along = [(target * channel.transverse.conjugate()).real / abs(channel.transverse) for channel in channels]
        best = [max(zip(channels, along, strict=True), key=lambda share: share[1])]
    return [(channel, impulse) for channel, impulse in best if impulse > 1e-12 * abs(target)]
