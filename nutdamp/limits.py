"""When a pulse may be on: earliest start, gap, blackout windows, horizon, and the resolution of commands."""

from __future__ import annotations

import cmath
import math

import numpy as np
from numpy.typing import NDArray

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


def usable(spacecraft: Spacecraft, *, axial: bool = False) -> list[Channel]:
    """The channels that schemes fire: more transverse than ``axial`` (or either), with a commandable on-time."""
    tick, time = spacecraft.limits.tick, spacecraft.horizon - spacecraft.limits.earliest

    def commandable(channel: Channel) -> bool:
        least = channel.min_on_time if tick is None else max(math.ceil((channel.min_on_time - SLACK) / tick), 1) * tick
        return least <= min(channel.max_on_time, time) + SLACK

    return [channel for channel in spacecraft.channels if (channel.damps or axial) and commandable(channel)]


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
