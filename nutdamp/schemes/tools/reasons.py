"""Why a scheme cannot work, and what it leaves, in words."""

from __future__ import annotations

import cmath
import math

from nutdamp.errors import Infeasible, TooShort
from nutdamp.limits import longest_useful, usable
from nutdamp.schedule import Pulse
from nutdamp.schemes.tools.impulse_builder import ImpulseBuilder
from nutdamp.spacecraft import Channel, Spacecraft
from nutdamp.words import listed

FADED = 1e-6
"""Share of the nutation below which there is nothing left for pulses to do: dissipation has taken it out before."""


def no_channels(spacecraft: Spacecraft) -> str:
    """No body-fixed channel can damp."""
    if any(channel.damps for channel in spacecraft.channels):
        ticks = "" if spacecraft.limits.tick is None else ", as a multiple of limits.tick"
        time = spacecraft.horizon - spacecraft.limits.earliest
        if time <= 0.0:  # by the file, or where other pulses of the scheme come first
            return "limits.earliest, or the pulses before, leave no time within limits.horizon"
        return (
            f"no channel can be on for as long as its min_on_time requires{ticks}, at most for its max_on_time, within "
            f"the {time:.4g} s from limits.earliest to limits.horizon"
        )
    if spacecraft.channels:
        return "no channel has a torque more transverse than axial, so none can damp a nutation"
    return "the file names no thrusters, and this scheme fires body-fixed ones"


def bounded_by(spacecraft: Spacecraft) -> str:
    """The limits that a schedule of its channels has to keep, by name: the horizon, and those that the file sets."""
    limits, channels = spacecraft.limits, spacecraft.channels
    there = {
        "on-times": any(one.min_on_time > 0.0 or math.isfinite(one.max_on_time) for one in channels),
        "gap": limits.gap > 0.0,
        "ticks": limits.tick is not None,
        "blackout windows": bool(limits.blackout),
    }
    names = [f"the horizon of {spacecraft.horizon:.4g} s", *(name for name in there if there[name])]
    return listed(names)


def at_hand(spacecraft: Spacecraft, channels: list[Channel]) -> list[Channel]:
    """The ``channels`` that can damp; raises Infeasible where there are none."""
    if not channels:
        raise Infeasible(no_channels(spacecraft))
    return channels


def expect_aim(spacecraft: Spacecraft) -> None:
    """Raises Infeasible without a target to which a scheme could turn the spin axis, or without what could do it."""
    if spacecraft.goal.axis is None:
        raise Infeasible("needs a target axis: --target, or goal in the file")
    if spacecraft.torquer is None:
        at_hand(spacecraft, usable(spacecraft))


def no_alignment(spacecraft: Spacecraft, channels: list[Channel]) -> Infeasible:
    """That no channel can be fired against ω within the limits, with the cure."""
    omega = complex(spacecraft.omega0[0], spacecraft.omega0[1])
    if spacecraft.inertia.a == 0.0:
        off = {channel.name: abs(cmath.phase(-omega * channel.transverse.conjugate())) for channel in channels}
        nearest = min(off, key=lambda name: off[name])
        return Infeasible(
            "in a sphere (a = 0) ω does not turn in the body, so waiting brings no channel to oppose it; "
            f"nearest is {nearest}, {math.degrees(off[nearest]):.4g}° off. four-pulse combines channels"
        )
    builder = ImpulseBuilder(spacecraft, endless=True)
    pulses = [builder.align(channel, max(channel.min_on_time, 1e-6 * builder.period)) for channel in channels]
    there = [pulse for pulse in pulses if pulse is not None]
    if not there:
        flat = ": dissipation brings the body into flat spin before, where ω does not turn in it"
        return Infeasible(f"no channel ever opposes the nutation{flat * builder.growing}")
    by_name = {channel.name: channel for channel in channels}
    ends = [_end(builder, by_name[pulse.channel], pulse) for pulse in there if builder.helps(pulse)]
    if not ends:
        best = min(there, key=builder.left_after)
        left = builder.A * abs(builder.omega_at(best.t))
        if left < FADED * builder.left:
            return Infeasible(
                f"dissipation takes the nutation out before a channel comes to oppose it, at {best.t:.4g} s"
            )
        return Infeasible(
            f"every channel's shortest pulse is too strong: there are {turn_of(spacecraft, left)} of nutation, and "
            f"firing would leave {turn_of(spacecraft, builder.left_after(best))}; lower min_on_time"
        )
    if min(ends) <= spacecraft.horizon:
        return Infeasible("channels oppose the nutation within the horizon, but the pulses planned increase it")
    return TooShort(
        f"no channel opposes the nutation before the horizon of {spacecraft.horizon:.4g} s",
        f"the first pulse that does would end at {min(ends):.6g} s: set limits.horizon beyond that",
    )


def in_phase(spacecraft: Spacecraft, per_turn: int, fewest: int, most: int, left: float) -> str:
    """That trains of ``fewest`` to ``most`` pulses leave nutation: the best of them ``left`` rad."""
    ratio = spacecraft.inertia.C / (spacecraft.inertia.A * per_turn)
    off, least = abs(ratio - round(ratio)), math.degrees(left)
    if off * most >= 1.0:
        return (
            f"of {fewest} to {most} pulses, as many as limits and on-times allow, no number brings the nutation "
            f"back to nothing: {least:.3g}° would be left; a longer horizon or another --per-turn can help"
        )
    return (
        f"C/(A × pulses per turn) = {ratio:.4g} is so near a whole number that pulse after pulse meets the "
        f"nutation in nearly the same phase: even the best train, of {fewest} to {most} pulses, "
        f"would leave {least:.3g}°; another --per-turn, a longer horizon, half-cone or two-pulse can help"
    )


def turn_of(spacecraft: Spacecraft, impulse: float) -> str:
    """By how many degrees an ``impulse`` across the spin axis, N m s, turns H; of A|ω|, the nutation."""
    return f"{math.degrees(math.atan2(impulse, spacecraft.inertia.C * abs(spacecraft.spin))):.4g} deg"


def _end(builder: ImpulseBuilder, channel: Channel, shortest: Pulse) -> float:
    """End in s of the first pulse of a channel that is as long as it takes; of the ``shortest`` where none has room."""
    needed = builder.on_time_for(channel, builder.left)
    most = longest_useful(channel.max_on_time, builder.period)
    pulse = builder.align(channel, most if needed is None else min(needed, most))
    return shortest.end if pulse is None else max(pulse.end, shortest.end)
