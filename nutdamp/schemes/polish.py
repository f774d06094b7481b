"""The last digits of a schedule: move and lengthen its pulses until the flown motion leaves nothing.

A quasi-Newton iteration for the nearest solution. The slopes are those of `influence`, which cost no flights, mended
by what each step shows (Broyden 1965). Room is shared between neighbours beforehand, so that no limit can be broken.
"""

from __future__ import annotations

import math

import numpy as np

from nutdamp import flight
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.schemes import influence
from nutdamp.schemes.influence import Equations
from nutdamp.schemes.trim import bounded_step
from nutdamp.schemes.windows import Windows
from nutdamp.spacecraft import Spacecraft, Vector

CONVERGED = 1e-13
"""Share of |H| that is left: a few roundings of the flight."""

STEPS = 25

SWEEPS = 20
"""Times that the ticks of all pulses are gone through."""


def polish(spacecraft: Spacecraft, made: Schedule, equations: Equations, off: Vector, step: float) -> Schedule:
    """``made`` with centres and on-times of all its pulses moved, as little as it takes, towards ``equations`` met.

    ``off`` (2,) N m s is where H is to end beside its target. What it leaves is for the caller to judge.
    """
    knobs = _Knobs(spacecraft, made)
    size = float(np.linalg.norm(spacecraft.momentum))
    aside = np.zeros(len(equations.chosen))
    if equations.shift:
        aside[2:4] = off

    def left(schedule: Schedule) -> tuple[Vector, flight.Flight]:
        flown = flight.flown(spacecraft, schedule)
        return (influence.misses(flown, equations) - aside) / size, flown

    x = knobs.start
    value, flown = left(made)
    slopes = knobs.slopes(made, flown, equations, step) / size
    for _ in range(STEPS):
        norm = float(np.linalg.norm(value))
        if norm <= CONVERGED:
            break
        move = bounded_step(slopes, value, x, knobs.scale, knobs.lower, knobs.upper)
        for shrink in range(5):
            trial = np.clip(x + move * 0.5**shrink, knobs.lower, knobs.upper)
            following, _ = left(knobs.schedule(trial))
            if np.linalg.norm(following) < norm:
                break
        moved = (trial - x) / knobs.scale
        if not moved.any():
            break
        slopes = slopes + np.outer(following - value - slopes @ moved, moved) / (moved @ moved)
        if np.linalg.norm(following) >= norm:
            break
        x, value = trial, following
    best = knobs.schedule(x)
    return best if spacecraft.limits.tick is None else _on_ticks(spacecraft, best, knobs, slopes, value, x)


def _on_ticks(
    spacecraft: Spacecraft, best: Schedule, knobs: _Knobs, slopes: Vector, value: Vector, x: Vector
) -> Schedule:
    """Starts and on-times on ticks: each rounded, then stepped to and fro while the linear model says it helps."""
    tick, windows = spacecraft.limits.tick or 0.0, Windows(spacecraft)
    on_times = np.array(
        [
            windows.on_time(pulse.on_time, channel.min_on_time, channel.max_on_time)
            for pulse, channel in zip(best, knobs.channels, strict=True)
        ]
    )
    starts = np.array([windows.nearest_tick(pulse.start) for pulse in best])
    per_s = slopes / knobs.scale

    def settings() -> Vector:
        return np.ravel(np.column_stack([starts + 0.5 * on_times, on_times]))

    missing = value + per_s @ (settings() - x)
    for _ in range(SWEEPS):
        before = float(np.linalg.norm(missing))
        for index, channel in enumerate(knobs.channels):
            bounds = ((starts, 0.0, math.inf), (on_times, channel.min_on_time, channel.max_on_time))
            for values, low, high in bounds:
                for change in (tick, -tick):
                    if not low - 1e-9 <= values[index] + change <= high + 1e-9:
                        continue
                    values[index] += change
                    trial = value + per_s @ (settings() - x)
                    inside = knobs.inside(index, starts[index], on_times[index])
                    if inside and on_times[index] > 0.5 * tick and np.linalg.norm(trial) < np.linalg.norm(missing):
                        missing = trial
                    else:
                        values[index] -= change
        if np.linalg.norm(missing) > 0.999 * before:
            break
    ticks = np.rint(np.column_stack([starts, on_times]) / tick) * tick
    return knobs.schedule(np.ravel(np.column_stack([ticks[:, 0] + 0.5 * ticks[:, 1], ticks[:, 1]])))


class _Knobs:
    """Centre and on-time of each pulse, as one vector: (c1, τ1, c2, τ2 …) s, its scale, and how far each may go."""

    def __init__(self, spacecraft: Spacecraft, made: Schedule) -> None:
        limits, names = spacecraft.limits, {channel.name: channel for channel in spacecraft.channels}
        self.channels = [names[pulse.channel] for pulse in made]
        self.made = made
        pace = 1.0 / abs(spacecraft.spin)
        longest = 0.5 * spacecraft.body_period  # beyond that a pulse works against itself
        ready, bounds = limits.earliest, []
        for pulse in made:
            latest = min([spacecraft.horizon, *(begin for begin, _ in limits.blackout if begin >= pulse.end - 1e-9)])
            begun = max([ready, *(end for _, end in limits.blackout if end <= pulse.start + 1e-9)])
            bounds.append([begun, latest])
            ready = pulse.end + limits.gap
        for index in range(len(bounds) - 1):
            off, on = made.pulses[index].end, made.pulses[index + 1].start
            half = 0.5 * max(on - off - limits.gap, 0.0)
            bounds[index][1] = min(bounds[index][1], off + half)
            bounds[index + 1][0] = max(bounds[index + 1][0], on - half)
        self.room = bounds
        start: list[float] = []
        scale: list[float] = []
        lower: list[float] = []
        upper: list[float] = []
        for pulse, channel, (begun, latest) in zip(made, self.channels, bounds, strict=True):
            before, after = max(pulse.start - begun, 0.0), max(latest - pulse.end, 0.0)
            start += [pulse.t, pulse.on_time]
            scale += [pace, min(pulse.on_time, pace)]
            lower += [pulse.t - 0.5 * before, min(channel.min_on_time, pulse.on_time)]
            most = min(channel.max_on_time, max(longest, pulse.on_time), pulse.on_time + min(before, after))
            upper += [pulse.t + 0.5 * after, max(most, pulse.on_time)]
        self.start, self.scale, self.lower, self.upper = map(np.array, (start, scale, lower, upper))

    def inside(self, index: int, start: float, on_time: float) -> bool:
        """Whether a pulse keeps to its share of the room."""
        begun, latest = self.room[index]
        return bool(start >= begun - 1e-9 and start + on_time <= latest + 1e-9)

    def schedule(self, x: Vector) -> Schedule:
        """The schedule with these settings."""
        pairs = x.reshape(-1, 2)
        pulses = (
            channel_pulse(channel, float(t), float(on)) for channel, (t, on) in zip(self.channels, pairs, strict=True)
        )
        return Schedule(tuple(pulses), self.made.notes, self.made.bounds)

    def slopes(self, made: Schedule, flown: flight.Flight, equations: Equations, step: float) -> Vector:
        """What the scaled knobs change in the equations, (equations, 2k) N m s."""
        rows = influence.along(flown, equations, step).rows
        columns = []
        begins, ends = (rows(np.array(times)) for times in zip(*((p.start, p.end) for p in made), strict=True))
        for index, channel in enumerate(self.channels):
            on, off = begins[index] @ channel.torque, ends[index] @ channel.torque
            columns += [off - on, 0.5 * (on + off)]
        return np.asarray(np.column_stack(columns) * self.scale)
