"""What can be turned of a schedule of body-fixed channels: centre and on-time of each pulse."""

from __future__ import annotations

import numpy as np

from nutdamp import flight
from nutdamp.limits import longest_on_time, rooms
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.schemes.optimal import residual_equations
from nutdamp.schemes.optimal.residual_equations import Equations
from nutdamp.spacecraft import Spacecraft, Vector


class PulseParameters:
    """Centre and on-time of each pulse, as one vector: (c1, τ1, c2, τ2 …) s, its scale, and how far each may go."""

    def __init__(self, spacecraft: Spacecraft, made: Schedule) -> None:
        names = {channel.name: channel for channel in spacecraft.channels}
        self.channels = [names[pulse.channel] for pulse in made]
        self.made = made
        pace = 1.0 / abs(spacecraft.spin)
        self.room = rooms(spacecraft, made.pulses)
        start: list[float] = []
        scale: list[float] = []
        lower: list[float] = []
        upper: list[float] = []
        for pulse, channel, (begun, latest) in zip(made, self.channels, self.room, strict=True):
            before, after = max(pulse.start - begun, 0.0), max(latest - pulse.end, 0.0)
            start += [pulse.t, pulse.on_time]
            scale += [pace, min(pulse.on_time, pace)]
            lower += [pulse.t - 0.5 * before, min(channel.min_on_time, pulse.on_time)]
            most = min(longest_on_time(spacecraft, channel), pulse.on_time + min(before, after))
            upper += [pulse.t + 0.5 * after, max(most, pulse.on_time)]
        self.start, self.scale, self.lower, self.upper = map(np.array, (start, scale, lower, upper))

    def schedule(self, x: Vector) -> Schedule:
        """The schedule with these settings."""
        pairs = x.reshape(-1, 2)
        pulses = (
            channel_pulse(channel, float(t), float(on)) for channel, (t, on) in zip(self.channels, pairs, strict=True)
        )
        return Schedule(tuple(pulses), self.made.notes, self.made.bounds)

    def slopes(self, made: Schedule, flown: flight.Flight, equations: Equations, step: float) -> Vector:
        """What the scaled parameters change in the equations, (equations, 2k) N m s."""
        rows = residual_equations.along(flown, equations, step).rows
        columns = []
        begins, ends = (rows(np.array(times)) for times in zip(*((p.start, p.end) for p in made), strict=True))
        for index, channel in enumerate(self.channels):
            on, off = begins[index] @ channel.torque, ends[index] @ channel.torque
            columns += [off - on, 0.5 * (on + off)]
        return np.asarray(np.column_stack(columns) * self.scale)
