"""Constraints on schedules: earliest start, gap, blackout windows, horizon, on-times, ticks, number
of pulses.

`Windows` says when a pulse may be on; `breaches` judges whole schedules, for the schemes and for
the judge alike. It gives data; `nutdamp.planning.decision` has the words.
"""

from __future__ import annotations

import cmath
import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible, listed
from nutdamp.spacecraft.equipment import ANGLE, Block, Channel, Commands
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import (
    RESOLUTION,
    TOUCHING,
    Pulse,
    Schedule,
    channel_pulse,
    on_command,
    touching,
)

# share of a tick, or step of commands, by which times may be off it: the rounding of files
OFF_TICK = 1e-6


class Windows:
    """Limits of one spacecraft, for one pulse at a time."""

    def __init__(self, spacecraft: Spacecraft, *, endless: bool = False) -> None:
        """Windows of ``spacecraft``; ``endless`` drops the horizon."""
        self.limits = spacecraft.limits
        self.horizon = math.inf if endless else spacecraft.horizon

    def blocked_until(self, start: float, on_time: float) -> float | None:
        """End of the first blackout window that the pulse would touch; None where it is free."""
        if not self.limits.blackout:
            return None
        begins, over = self.dark
        # The first window that is not over when the pulse starts is the only one that it can touch
        # first.
        slack = touching(start + on_time)
        following = int(np.searchsorted(over, start + slack, side="right"))
        touched = following < len(over) and start + on_time > begins[following] + slack
        return float(over[following]) if touched else None

    def allows(self, start: float, on_time: float, ready: float) -> bool:
        """True if a pulse may be on from ``start`` for ``on_time`` s, actuators ``ready`` (s)."""
        slack = touching(start + on_time)
        within = ready - slack <= start and start + on_time <= self.horizon + slack
        return within and self.blocked_until(start, on_time) is None

    def allowed(self, starts: Vector, on_times: Vector, ready: Vector | float) -> NDArray[np.bool_]:
        """`allows` for many pulses at once, (n,) each; an on-time of NaN is not allowed."""
        ends = starts + on_times
        with np.errstate(invalid="ignore"):
            slack = np.maximum(TOUCHING, np.spacing(ends))  # `touching`
        free = (starts >= np.maximum(ready, 0.0) - slack) & (ends <= self.horizon + slack)
        if self.limits.blackout:
            free &= ~self.blocked(starts, ends, slack)
        return np.asarray(free)

    @cached_property
    def dark(self) -> tuple[Vector, Vector]:
        """Starts and ends of the blackout windows, s, in order; overlapping windows are merged."""
        merged: list[list[float]] = []
        for begins, ends in sorted(self.limits.blackout):
            if merged and begins < merged[-1][1]:
                merged[-1][1] = max(merged[-1][1], ends)
            else:
                merged.append([begins, ends])
        return np.array([begin for begin, _ in merged]), np.array([other for _, other in merged])

    def blocked(
        self, starts: Vector, ends: Vector, slack: Vector | float = 0.0
    ) -> NDArray[np.bool_]:
        """True where (``starts``, ``ends``) (n,) s is in blackouts for more than ``slack`` s."""
        begins, over = self.dark
        # The first window that is not over at the start is the only one that can be met first.
        following = np.searchsorted(over, starts + slack, side="right")
        return np.asarray(ends > np.append(begins, np.inf)[following] + slack)

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

    def tick_after(self, time: float) -> float:
        """First commandable time not before ``time``, but for rounding."""
        tick = self.limits.tick
        return time if tick is None else math.ceil((time - 0.5 * TOUCHING) / tick) * tick

    def on_time(self, needed: float, shortest: float, longest: float) -> float:
        """Commandable on-time nearest to ``needed`` s within the bounds, and not zero."""
        tick = self.limits.tick
        if tick is None:
            return min(max(needed, shortest), longest)
        least = max(math.ceil((shortest - TOUCHING) / tick), 1)
        most = math.inf if math.isinf(longest) else math.floor((longest + TOUCHING) / tick)
        return float(min(max(round(needed / tick), least), most)) * tick


def free_windows(spacecraft: Spacecraft, horizon: float | None = None) -> list[tuple[float, float]]:
    """Windows (begin, end) s in which pulses may be on: from the earliest start to the horizon
    without blackouts.

    ``horizon`` s, where given, replaces that of the spacecraft. Windows that only touch leave a
    moment free between them.
    """
    earliest = spacecraft.limits.earliest
    until = spacecraft.horizon if horizon is None else horizon
    begins, over = Windows(spacecraft).dark
    edges = zip(
        [earliest, *np.maximum(over, earliest).tolist()], [*begins.tolist(), math.inf], strict=True
    )
    free = [(begin, min(end, until)) for begin, end in edges if begin <= end and begin < until]
    return free if len(begins) or free else [(earliest, earliest)]


def rooms(spacecraft: Spacecraft, pulses: Sequence[Pulse]) -> list[tuple[float, float]]:
    """(begin, end) s within which each of the ``pulses``, in order, may move; gaps are halved."""
    limits = spacecraft.limits
    ready = spacecraft.limits.earliest
    bounds = []
    begins, over = (part.tolist() for part in Windows(spacecraft).dark)
    for pulse in pulses:
        before = bisect_right(over, pulse.start + TOUCHING)
        after = bisect_left(begins, pulse.end - TOUCHING)
        bounds.append(
            [max([ready, *over[:before][-1:]]), min([spacecraft.horizon, *begins[after:][:1]])]
        )
        ready = pulse.end + limits.gap
    for index in range(len(bounds) - 1):
        off, on = pulses[index].end, pulses[index + 1].start
        half = 0.5 * max(on - off - limits.gap, 0.0)
        bounds[index][1] = min(bounds[index][1], off + half)
        bounds[index + 1][0] = max(bounds[index + 1][0], on - half)
    return [(begun, latest) for begun, latest in bounds]


def usable(spacecraft: Spacecraft, *, axial: bool = False) -> list[Channel]:
    """Channels that schemes fire: more transverse than ``axial`` (or either), with a commandable
    on-time.

    One whose torques cancel is none of them.
    """
    time = spacecraft.horizon - spacecraft.limits.earliest
    return [
        channel
        for channel in spacecraft.channels
        if (channel.damps or (axial and channel.torque.any()))
        and shortest_on_time(spacecraft, channel) <= min(channel.max_on_time, time) + TOUCHING
    ]


def at_hand(spacecraft: Spacecraft, channels: list[Channel]) -> list[Channel]:
    """Damping ``channels``; raises Infeasible where there are none."""
    if channels:
        return channels
    if not spacecraft.channels:
        raise Infeasible("the file has no thrusters, and this scheme needs body-fixed thrusters")
    if not any(channel.damps for channel in spacecraft.channels):
        raise Infeasible("no channel can damp nutation: each has more axial than transverse torque")
    ticks = "" if spacecraft.limits.tick is None else ", as a multiple of limits.tick"
    time = spacecraft.horizon - spacecraft.limits.earliest
    if time <= 0.0:  # by the file, or where other pulses of the scheme come first
        raise Infeasible(
            "no time is left before limits.horizon, after limits.earliest or the pulses before"
        )
    raise Infeasible(
        f"no channel can be on for its min_on_time{ticks}, at most its max_on_time, "
        f"within the {time:.4g} s from limits.earliest to limits.horizon"
    )


def bounded_by(spacecraft: Spacecraft) -> str:
    """Limits on a schedule of its channels, by name: the horizon, and those that the file sets."""
    limits, channels = spacecraft.limits, spacecraft.channels
    there = {
        f"the horizon of {spacecraft.horizon:.4g} s": True,
        "on-times": any(
            channel.min_on_time > 0.0 or math.isfinite(channel.max_on_time) for channel in channels
        ),
        "gap": limits.gap > 0.0,
        "ticks": limits.tick is not None,
        "blackout windows": bool(limits.blackout),
    }
    return listed([name for name in there if there[name]])


WASTEFUL = 0.5
"""Share of the nutation that the best channel takes away at the same cost, below which another one
wastes.

The nutation turns past every channel, so the best one can do all. Its longest useful pulse, half a
nutation turn, still acts with 2/π = 0.64 of its impulse: a channel below that costs more, however
long the pulses of the best. One half spares channels that are alike but for tolerances. R1 and R2
of weak-doubled.yaml, which push past the centre of mass, have an eighteenth.
"""


def worths(spacecraft: Spacecraft, channels: Sequence[Channel]) -> list[float]:
    """Small nutation that each channel takes away for propellant (impulse where that of one is
    unknown), over that of the best.
    """
    weighed = all(channel.mass_flow is not None for channel in channels)
    circle = spacecraft.inertia.circle(spacecraft.spin)
    rates = [
        float(np.linalg.norm(circle * channel.torque[:2]))
        / channel.cost_rate(by_propellant=weighed)
        for channel in channels
    ]
    return [rate / max(rates) for rate in rates]


def without_waste(spacecraft: Spacecraft, channels: Sequence[Channel]) -> list[Channel]:
    """Channels but for those of a worth below `WASTEFUL`."""
    shares = zip(channels, worths(spacecraft, channels), strict=True)
    return [channel for channel, share in shares if share >= WASTEFUL]


SOME_WIDTHS = 500  # of a range in finer steps so many, evenly spread: then neighbours of the best


def commandable_widths(
    commands: Commands,
    channel: Channel,
    least: float = 0.0,
    most: float = math.inf,
    count: int = SOME_WIDTHS,
) -> Vector:
    """Widths (n,) s from ``least`` to ``most`` that blocks may have and that give thrust."""
    least = max(least, channel.min_on_time - 1e-12)
    most = min(most, channel.max_on_time + 1e-12)
    widths = commands.some_widths(least, most, count)
    if channel.valve is None:
        return widths
    return widths[[effective_on_time(channel, width) > 0.0 for width in widths.tolist()]]


def rounded_off(spacecraft: Spacecraft, pulses: Iterable[Pulse]) -> list[float]:
    """Effect of half a tick in start and on-time of each pulse, rad, summed by squares."""
    half = 0.5 * (spacecraft.limits.tick or 0.0)
    rate = spacecraft.fastest
    size = abs(spacecraft.axial)
    lengths = (
        (pulse.magnitude, 1.0 / pulse.on_time if pulse.on_time > 0.0 else 0.0) for pulse in pulses
    )
    return [half * magnitude * math.hypot(share, rate) / size for magnitude, share in lengths]


def shortest_on_time(spacecraft: Spacecraft, channel: Channel) -> float:
    """Shortest on-time that can be commanded, s: min_on_time rounded up to ticks, at least one."""
    tick = spacecraft.limits.tick
    return (
        channel.min_on_time
        if tick is None
        else max(math.ceil((channel.min_on_time - TOUCHING) / tick), 1) * tick
    )


def longest_on_time(spacecraft: Spacecraft, channel: Channel) -> float:
    """Longest useful on-time of a channel, s; see `longest_useful`."""
    longest = effective_on_times(channel)[1]
    return longest_useful(longest, spacecraft.body_period) if channel.damps else longest


def effective_on_times(channel: Channel) -> tuple[float, float]:
    """Bounds (s) of the pulses that a channel can give, in effective on-times."""
    return effective_on_time(channel, channel.min_on_time), effective_on_time(
        channel, channel.max_on_time
    )


def effective_on_time(channel: Channel, on_time: float) -> float:
    """Time (s) of full thrust that a command of ``on_time`` s acts for: its impulse over the
    torque.

    An ``on_time`` of 0 is the shortest there is: a valve that closes later than it opens gives
    thrust for a while.
    """
    valve = channel.valve
    return (
        on_time
        if valve is None or math.isinf(on_time)
        else valve.thrust(on_time or TOUCHING).on_time
    )


def longest_useful(max_on_time: float, period: float) -> float:
    """Longest useful on-time, s: a torque across the spin axis works against itself after half a
    nutation ``period``.

    That is the one in the body, s, at the spin with which the pulse begins.
    """
    return min(max_on_time, 0.5 * period)


PAIRED = 24  # directions about which channels are looked at in pairs


def for_pairs(spacecraft: Spacecraft) -> list[Channel]:
    """`usable`, but of very many channels only the cheapest about each of `PAIRED` directions."""
    channels = usable(spacecraft)
    if len(channels) <= PAIRED:
        return channels
    cheapest: dict[int, Channel] = {}
    for channel in sorted(channels, key=lambda channel: (channel.price, -abs(channel.transverse))):
        about = round(cmath.phase(channel.transverse) / (2.0 * math.pi) * PAIRED) % PAIRED
        cheapest.setdefault(about, channel)
    return [channel for channel in channels if any(channel is other for other in cheapest.values())]


def channel_of(spacecraft: Spacecraft, pulse: Pulse) -> Channel | None:
    """Channel that fires the pulse; None for a steerable torquer."""
    return next((channel for channel in spacecraft.channels if channel.name == pulse.channel), None)


def misfits(spacecraft: Spacecraft, blocks: Sequence[Block]) -> Iterator[tuple[int, str, str, str]]:
    """Values of blocks that are no command of the file: number of the block, from 0, column, value,
    what is near or allowed.
    """
    commands = spacecraft.commands
    if commands is None:
        return
    longest = (
        math.floor(commands.delay_max / commands.delay_step * (1.0 + OFF_TICK))
        * commands.delay_step
    )
    for index, block in enumerate(blocks):
        delay = block.delay_at(spacecraft.spin)
        nearest_delay = min(round(delay / commands.delay_step) * commands.delay_step, longest)
        nearest_width = commands.nearest_width(block.width)
        for column, value, near, slack in (
            ("delay_s", delay, nearest_delay, OFF_TICK * commands.delay_step),
            ("width_s", block.width, nearest_width, OFF_TICK * block.width),
        ):
            if abs(value - near) > slack:
                yield index, column, f"{value:.6g} s", f"{near:.6g} s is the nearest"
        if block.delay and commands.delay_is == ANGLE:
            yield index, "delay_s", f"{block.delay:.6g} s", "commands.delay_is is angle"
        if block.angle and commands.delay_is != ANGLE:
            angle = math.degrees(block.angle)
            yield index, "delay_deg", f"{angle:.6g} deg", "commands.delay_is is time"
        if block.count > commands.max_count:
            yield index, "count", str(block.count), f"{commands.max_count} is the most"
        if block.every not in commands.every:
            yield index, "every", str(block.every), f"only {', '.join(map(str, commands.every))}"
        together = sum(each.first <= block.first <= each.sun_pulses[-1] for each in blocks)
        if together > commands.per_turn:
            allowed = f"{together} blocks fire in the same turns, commands.per_turn allows"
            yield index, "first_sun_pulse", str(block.first), f"{allowed} {commands.per_turn}"


def commandable(spacecraft: Spacecraft, pulse: Pulse) -> Pulse:
    """Pulse with start and on-time on the ticks of the commands."""
    if spacecraft.limits.tick is None:
        return pulse
    windows = Windows(spacecraft)
    channel = channel_of(spacecraft, pulse)
    bounds = (0.0, math.inf) if channel is None else (channel.min_on_time, channel.max_on_time)
    if channel is not None and pulse.command is not None:
        start, on_time = pulse.loaded
        return on_command(channel, windows.nearest_tick(start), windows.on_time(on_time, *bounds))
    on_time = 0.0 if pulse.on_time == 0.0 else windows.on_time(pulse.on_time, *bounds)
    t = windows.nearest_tick(pulse.start) + 0.5 * on_time
    if channel is not None:
        return channel_pulse(channel, t, on_time)
    scale = 1.0 if pulse.on_time == 0.0 else on_time / pulse.on_time
    propellant = None if pulse.propellant is None else pulse.propellant * scale
    return replace(
        pulse, t=t, on_time=on_time, impulse=pulse.impulse * scale, propellant=propellant
    )


class Limit(Enum):
    """Limit that a schedule may break; ``limits.…`` are keys of the file."""

    RESOLUTION = "resolution of times"
    EARLIEST = "limits.earliest"
    HORIZON = "limits.horizon"
    GAP = "limits.gap"
    BLACKOUT = "limits.blackout"
    MIN_ON_TIME = "min_on_time"
    MAX_ON_TIME = "max_on_time"
    START_TICK = "limits.tick of starts"
    ON_TIME_TICK = "limits.tick of on-times"
    MAX_PULSES = "limits.max_pulses"


class Breach(NamedTuple):
    """Breach of a ``limit`` by the pulse ``number`` (from 1), which exceeds its ``bound`` s ``by``
    so many s.

    For `Limit.MAX_PULSES` both count pulses, and the pulse is the last one. ``window``: the
    blackout window, s; the pulse would have to end before its begin, the ``bound``, or to start
    after its end, whichever is nearer.
    """

    limit: Limit
    number: int
    pulse: Pulse
    bound: float
    by: float
    window: tuple[float, float] | None = None


def breaches(spacecraft: Spacecraft, pulses: Iterable[Pulse]) -> Iterator[Breach]:
    """Breaches of the limits and on-times of the file by ``pulses``, in order, pulse by pulse.

    What is within rounding (`touching`) is no breach; but no pulse may start before t = 0 by
    anything. Command blocks have steps of their own, from a Sun pulse that comes on no tick:
    limits.tick is not theirs.
    """
    windows = Windows(spacecraft)
    previous_end = -math.inf
    number = 0
    if isinstance(pulses, Schedule) and pulses.blocks:
        windows.limits = replace(windows.limits, tick=None)
    channels = {channel.name: channel for channel in spacecraft.channels}
    for number, pulse in enumerate(pulses, start=1):
        for limit, bound, by, allowed in _margins(
            windows, channels.get(pulse.channel), pulse, previous_end
        ):
            if by > allowed:
                yield Breach(limit, number, pulse, bound, by)
        start = pulse.loaded[0]
        lasts = pulse.on_time if pulse.command is None else pulse.over - start
        if windows.blocked_until(start, lasts) is not None:
            for begins, ends in windows.limits.blackout:
                by = min(ends - start, pulse.over - begins)
                if by > touching(pulse.over):
                    yield Breach(Limit.BLACKOUT, number, pulse, begins, by, (begins, ends))
        previous_end = max(previous_end, pulse.over)
    most = spacecraft.limits.max_pulses
    if most is not None and number > most:
        yield Breach(Limit.MAX_PULSES, number, pulse, most, number - most)


def _margins(
    windows: Windows, channel: Channel | None, pulse: Pulse, previous_end: float
) -> Iterator[tuple[Limit, float, float, float]]:
    """Limits other than blackout windows: each with its bound, the excess of a pulse, and the
    allowed excess, s.

    Starts, on-times and ticks are those of the command; horizon and gap wait until its thrust is
    over too.
    """
    limits = windows.limits
    slack = touching(pulse.over)
    start, on_time = pulse.loaded
    if on_time > 0.0:
        coarsest = RESOLUTION * on_time
        yield Limit.RESOLUTION, coarsest, math.ulp(pulse.over), coarsest
    yield Limit.EARLIEST, limits.earliest, limits.earliest - start, 0.0 if start < 0.0 else slack
    yield Limit.HORIZON, windows.horizon, pulse.over - windows.horizon, slack
    yield Limit.GAP, limits.gap, previous_end + limits.gap - start, slack
    if channel is not None:
        yield Limit.MIN_ON_TIME, channel.min_on_time, channel.min_on_time - on_time, slack
        yield Limit.MAX_ON_TIME, channel.max_on_time, on_time - channel.max_on_time, slack
    if limits.tick is not None:
        for limit, value in ((Limit.START_TICK, start), (Limit.ON_TIME_TICK, on_time)):
            yield (
                limit,
                limits.tick,
                abs(value - windows.nearest_tick(value)),
                slack + OFF_TICK * limits.tick,
            )


def keeps_limits(spacecraft: Spacecraft, pulses: Iterable[Pulse]) -> bool:
    """True if ``pulses``, in order, break nothing: see `breaches`."""
    return next(breaches(spacecraft, pulses), None) is None
