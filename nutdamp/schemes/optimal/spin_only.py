"""Schedules that set the spin and leave the nutation that the requirement allows: one channel, as long as it takes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from nutdamp import compliance
from nutdamp.flight import Flight
from nutdamp.limits import keeps_limits
from nutdamp.outcome import left_by
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.spacecraft import Channel, Spacecraft

STARTS = 8
"""Starts in a nutation period that are tried of a channel that has a transverse torque, too."""

CORRECTED = 4
"""Flights by which the length is corrected."""

MOST = 200
"""Pulses at most."""


def schedules(spacecraft: Spacecraft, fly: Callable[[Schedule], Flight]) -> Iterator[Schedule]:
    """Those that keep limits and requirement, flown by ``fly``; none where H has a target."""
    if spacecraft.goal.spin is None or spacecraft.goal.axis is not None:
        return
    for channel in spacecraft.channels:
        if (spacecraft.goal.spin - spacecraft.spin) * channel.axial <= 0.0:
            continue
        starts = STARTS if abs(channel.transverse) > 1e-12 * abs(channel.axial) else 1
        for number in range(starts):
            start = spacecraft.limits.earliest + number / starts * spacecraft.nutation_period
            for turns in (0.0, 2.0 * math.pi / abs(spacecraft.spin)):
                made = _schedule(spacecraft, channel, start, turns, fly)
                if made is not None:
                    yield made


def _schedule(
    spacecraft: Spacecraft, channel: Channel, start: float, turn: float, fly: Callable[[Schedule], Flight]
) -> Schedule | None:
    """The pulses of a ``channel`` from ``start`` s on, one each ``turn`` s or one after the other; else None."""
    goal, tick = spacecraft.goal.spin, spacecraft.limits.tick
    assert goal is not None
    rate = channel.axial / spacecraft.inertia.C
    whole = (goal - spacecraft.spin) / rate
    count = math.ceil(whole / channel.max_on_time * (1.0 - 1e-9)) if math.isfinite(channel.max_on_time) else 1
    if count > MOST or (count == 1 and turn > 0.0):
        return None
    for _ in range(CORRECTED):
        on_time = whole / count
        if tick is not None:
            on_time = round(on_time / tick) * tick
        if not channel.min_on_time <= on_time <= channel.max_on_time * (1.0 + 1e-12):
            return None
        apart = max(turn, on_time + spacecraft.limits.gap)
        if tick is not None:
            start, apart = math.ceil(start / tick - 1e-9) * tick, math.ceil(apart / tick - 1e-9) * tick
        made = Schedule(tuple(channel_pulse(channel, start + k * apart + 0.5 * on_time, on_time) for k in range(count)))
        if made.end > spacecraft.horizon:
            return None
        flight = fly(made)
        missed = goal - flight.settled.spin
        if tick is not None or abs(missed) < 1e-12 * abs(goal):
            break
        whole += missed / rate
    held = compliance.held(spacecraft, left_by(flight))
    return made if all(one.met for one in held) and keeps_limits(spacecraft, made) else None
