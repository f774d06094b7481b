"""All that a schedule must keep: earliest start, gap, blackout windows, horizon, on-times, ticks, number of pulses.

`Windows` says when a pulse may be on; `keeps_limits` and `broken_limits` judge whole schedules: the first
by start and end alone, for the schemes, the second by everything, for the reader.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from nutdamp.schedule import Pulse, Schedule, channel_pulse, touching
from nutdamp.spacecraft import Channel, Spacecraft, Vector

SLACK = 1e-9
"""Seconds by which rounding may overstep a limit; far below any command resolution."""


class Windows:
    """The limits of one spacecraft, asked about one pulse at a time."""

    def __init__(self, spacecraft: Spacecraft, *, endless: bool = False) -> None:
        """``endless`` drops the horizon, to tell what a longer one would allow."""
        self.limits = spacecraft.limits
        self.horizon = math.inf if endless else spacecraft.horizon
        self._dark: tuple[Vector, Vector] | None = None

    def blocked_until(self, start: float, on_time: float) -> float | None:
        """End of the first blackout window that the pulse would touch; None where it is free."""
        if not self.limits.blackout:
            return None
        begins, over = self._merged()
        # The first window that is not over when the pulse starts is the only one that it can touch first.
        following = int(np.searchsorted(over, start + SLACK, side="right"))
        touched = following < len(over) and start + on_time > begins[following] + SLACK
        return float(over[following]) if touched else None

    def allows(self, start: float, on_time: float, ready: float) -> bool:
        """Whether a pulse may be on from ``start`` for ``on_time`` s when the actuators are ``ready`` (s)."""
        return (
            start >= ready - SLACK
            and start + on_time <= self.horizon + SLACK
            and self.blocked_until(start, on_time) is None
        )

    def allowed(self, starts: Vector, on_times: Vector, ready: Vector | float) -> NDArray[np.bool_]:
        """`allows` for many pulses at once, (n,) each; a pulse whose on-time is not a number is not allowed."""
        ends = starts + on_times
        free = (starts >= np.maximum(ready, 0.0) - SLACK) & (ends <= self.horizon + SLACK)
        if self.limits.blackout:
            begins, over = self._merged()
            following = np.searchsorted(over, starts + SLACK, side="right")  # as in `blocked_until`
            free &= ends <= np.append(begins, np.inf)[following] + SLACK
        return np.asarray(free)

    def _merged(self) -> tuple[Vector, Vector]:
        """Begins and ends of the blackout windows in order, those that overlap as one."""
        if self._dark is None:
            merged: list[list[float]] = []
            for begins, ends in sorted(self.limits.blackout):
                if merged and begins < merged[-1][1]:
                    merged[-1][1] = max(merged[-1][1], ends)
                else:
                    merged.append([begins, ends])
            self._dark = np.array([one for one, _ in merged]), np.array([other for _, other in merged])
        return self._dark

    def earliest_start(self, on_time: float, ready: float) -> float | None:
        """First allowed start, s, on a tick; None where the horizon comes first."""
        start = self.tick_after(ready)
        for _ in range(len(self.limits.blackout)):  # none blocks twice
            free = self.blocked_until(start, on_time)
            if free is None:
                break
            start = self.tick_after(free)
        return start if self.allows(start, on_time, ready) else None

    def nearest_tick(self, time: float) -> float:
        """``time`` rounded to the resolution of commands."""
        tick = self.limits.tick
        return time if tick is None else round(time / tick) * tick

    def nearest_ticks(self, times: Vector) -> Vector:
        """`nearest_tick` of many times (n,)."""
        tick = self.limits.tick
        return times if tick is None else np.rint(times / tick) * tick

    def tick_after(self, time: float) -> float:
        """First commandable time not before ``time``, but for rounding."""
        tick = self.limits.tick
        return time if tick is None else math.ceil((time - 0.5 * SLACK) / tick) * tick

    def ticks_after(self, times: Vector) -> Vector:
        """`tick_after` of many times (n,)."""
        tick = self.limits.tick
        return times if tick is None else np.ceil((times - 0.5 * SLACK) / tick) * tick

    def on_time(self, wanted: float, shortest: float, longest: float) -> float:
        """Commandable on-time nearest to ``wanted`` s within the bounds, and not zero."""
        tick = self.limits.tick
        if tick is None:
            return min(max(wanted, shortest), longest)
        least = max(math.ceil((shortest - SLACK) / tick), 1)
        most = math.inf if math.isinf(longest) else math.floor((longest + SLACK) / tick)
        return float(min(max(round(wanted / tick), least), most)) * tick


def free_windows(spacecraft: Spacecraft, horizon: float | None = None) -> list[tuple[float, float]]:
    """When pulses may be on, (begin, end) s in order: from the earliest start to the horizon, blackout left out.

    ``horizon`` s, where given, replaces that of the spacecraft. Windows that only touch leave a moment free between
    them.
    """
    limits, until = spacecraft.limits, spacecraft.horizon if horizon is None else horizon
    now = limits.earliest
    free: list[tuple[float, float]] = []
    for dark, light in sorted(limits.blackout):
        if now >= until:
            return free
        if dark >= now:
            free.append((now, min(dark, until)))
        now = max(now, light)
    return [*free, (now, max(now, until))] if now < until or not limits.blackout else free


def rooms(spacecraft: Spacecraft, pulses: Sequence[Pulse]) -> list[tuple[float, float]]:
    """(begin, end) s between which each of the ``pulses``, in order, may move; the room between two is halved."""
    limits, ready, bounds = spacecraft.limits, spacecraft.limits.earliest, []
    for pulse in pulses:
        latest = min([spacecraft.horizon, *(begin for begin, _ in limits.blackout if begin >= pulse.end - SLACK)])
        begun = max([ready, *(end for _, end in limits.blackout if end <= pulse.start + SLACK)])
        bounds.append([begun, latest])
        ready = pulse.end + limits.gap
    for index in range(len(bounds) - 1):
        off, on = pulses[index].end, pulses[index + 1].start
        half = 0.5 * max(on - off - limits.gap, 0.0)
        bounds[index][1] = min(bounds[index][1], off + half)
        bounds[index + 1][0] = max(bounds[index + 1][0], on - half)
    return [(begun, latest) for begun, latest in bounds]


def usable(spacecraft: Spacecraft, *, axial: bool = False) -> list[Channel]:
    """The channels that schemes fire: more transverse than ``axial`` (or either), with a commandable on-time."""
    tick, time = spacecraft.limits.tick, spacecraft.horizon - spacecraft.limits.earliest

    def has_on_time(channel: Channel) -> bool:
        least = channel.min_on_time if tick is None else max(math.ceil((channel.min_on_time - SLACK) / tick), 1) * tick
        return least <= min(channel.max_on_time, time) + SLACK

    return [channel for channel in spacecraft.channels if (channel.damps or axial) and has_on_time(channel)]


def longest_on_time(spacecraft: Spacecraft, channel: Channel) -> float:
    """Longest useful on-time, s: a torque across the spin axis works against itself after half a nutation period."""
    return min(channel.max_on_time, 0.5 * spacecraft.body_period if channel.damps else math.inf)


PAIRED = 24
"""Directions about which channels are looked at in pairs."""


def for_pairs(spacecraft: Spacecraft) -> list[Channel]:
    """`usable`, but of very many channels only the cheapest about each of `PAIRED` directions: pairs are many."""
    channels = usable(spacecraft)
    if len(channels) <= PAIRED:
        return channels
    cheapest: dict[int, Channel] = {}
    for channel in sorted(channels, key=lambda one: (one.price, -abs(one.transverse))):
        cheapest.setdefault(_about(channel), channel)
    return [channel for channel in channels if cheapest.get(_about(channel)) is channel]


def _about(channel: Channel) -> int:
    """Number of the direction that a channel is about."""
    return round(cmath.phase(channel.transverse) / (2.0 * math.pi) * PAIRED) % PAIRED


def channel_of(spacecraft: Spacecraft, pulse: Pulse) -> Channel | None:
    """The channel that fires the pulse; None for a steerable torquer."""
    return next((channel for channel in spacecraft.channels if channel.name == pulse.channel), None)


def commandable(spacecraft: Spacecraft, pulse: Pulse) -> Pulse:
    """The pulse with start and on-time on the ticks of the commands."""
    if spacecraft.limits.tick is None:
        return pulse
    windows, channel = Windows(spacecraft), channel_of(spacecraft, pulse)
    bounds = (0.0, math.inf) if channel is None else (channel.min_on_time, channel.max_on_time)
    on_time = 0.0 if pulse.on_time == 0.0 else windows.on_time(pulse.on_time, *bounds)
    t = windows.nearest_tick(pulse.start) + 0.5 * on_time
    if channel is not None:
        return channel_pulse(channel, t, on_time)
    scale = 1.0 if pulse.on_time == 0.0 else on_time / pulse.on_time
    propellant = None if pulse.propellant is None else pulse.propellant * scale
    return replace(pulse, t=t, on_time=on_time, impulse=pulse.impulse * scale, propellant=propellant)


def keeps_limits(spacecraft: Spacecraft, pulses: tuple[Pulse, ...]) -> bool:
    """Whether pulses, in order, keep earliest start, gap, blackout windows and horizon; on-times are not judged."""
    windows = Windows(spacecraft)
    ready = windows.limits.earliest
    for pulse in pulses:
        if pulse.start < 0.0 or not windows.allows(pulse.start, pulse.on_time, ready):
            return False
        ready = pulse.end + windows.limits.gap
    return True


def broken_limits(spacecraft: Spacecraft, made: Schedule) -> list[str]:
    """What a schedule does that limits or on-times forbid, in words; empty where it keeps them all.

    Each limit is named once, with the first pulse that breaks it and the number of others that do.
    """
    broken: dict[str, list[str]] = {}
    for limit, text in _breaches(spacecraft, made):
        broken.setdefault(limit, []).append(text)
    most = spacecraft.limits.max_pulses
    if most is not None and len(made) > most:
        broken["max_pulses"] = [f"{len(made)} pulses are more than {most}"]
    return [first + _likewise(len(others)) for first, *others in broken.values()]


def _likewise(others: int) -> str:
    return f"; likewise {others} more pulse{'s' * (others > 1)}" if others else ""


def _breaches(spacecraft: Spacecraft, made: Schedule) -> Iterator[tuple[str, str]]:
    """Each limit that a pulse breaks, and how, in words."""
    limits, horizon = spacecraft.limits, spacecraft.horizon
    channels = {channel.name: channel for channel in spacecraft.channels}
    previous_end = -math.inf
    for number, pulse in enumerate(made, start=1):
        slack = touching(pulse.end)
        name = f"pulse {number} ({pulse.channel}, {pulse.start:.6g} s to {pulse.end:.6g} s)"
        if not pulse.resolved:
            yield "resolution", f"{name} is too short for its time, where times are {math.ulp(pulse.end):.2g} s apart"
        if pulse.start < min(limits.earliest, 0.0) - slack or pulse.start < limits.earliest - slack:
            yield "earliest", f"{name} starts before {limits.earliest:.6g} s"
        if pulse.end > horizon + slack:
            yield "horizon", f"{name} ends after the horizon of {horizon:.6g} s"
        if pulse.start < previous_end + limits.gap - slack:
            yield "gap", f"{name} comes less than {limits.gap:.6g} s after the one before"
        for begins, ends in limits.blackout:
            if pulse.start < ends - slack and pulse.end > begins + slack:
                yield f"blackout {begins}", f"{name} lies in the blackout window {begins:.6g} s to {ends:.6g} s"
        channel = channels.get(pulse.channel)
        if channel is not None and pulse.on_time < channel.min_on_time - slack:
            least = f"less than the shortest on-time of {channel.min_on_time:.6g} s"
            yield "min_on_time", f"{name} is on for {pulse.on_time:.6g} s, {least}"
        if channel is not None and pulse.on_time > channel.max_on_time + slack:
            most = f"more than the longest on-time of {channel.max_on_time:.6g} s"
            yield "max_on_time", f"{name} is on for {pulse.on_time:.6g} s, {most}"
        if limits.tick is not None:
            for value, what in ((pulse.start, "starts"), (pulse.on_time, "is on for a time")):
                if abs(value - round(value / limits.tick) * limits.tick) > slack + 1e-6 * limits.tick:
                    yield what, f"{name} {what} off the ticks of {limits.tick:.6g} s"
        previous_end = max(previous_end, pulse.end)
