"""Capability of the actuators before any plan: steps of each channel,
and best pair for two pulses.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from nutdamp.errors import Infeasible
from nutdamp.physics import body as rigid_body
from nutdamp.physics import driven, precession, response
from nutdamp.physics import inertia as principal_moments
from nutdamp.schemes import block_model
from nutdamp.schemes.block_model import acts
from nutdamp.spacecraft.constraints import (
    commandable_widths,
    effective_on_time,
    effective_on_times,
    longest_useful,
    shortest_on_time,
    usable,
)
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Disturbance, Spacecraft

RESONANT = 3.0  # beat period over horizon from which a disturbance counts as resonant

SHORTEST, GRID = 1e-6, 600
"""Part of the longest on-time from which on, and number of on-times among which, the largest step
is searched.
"""

DIGITS = (
    9  # digits of misses in rad that are no rounding: among equals the pair that is named first
)


class ChannelSteps(NamedTuple):
    """A channel and the nutation angles (rad) that its pulses take out or put in.

    ``smallest``: of `constraints.shortest_on_time`, 0 without any. ``largest``: of on-times up to
    `constraints.longest_useful`, a right angle where nothing bounds it.
    """

    channel: Channel
    smallest: float
    largest: float


class SunPhases(NamedTuple):
    """Sun pulses of the free motion: ``turn`` s apart on average, the ``first`` at s, or None and
    the ``refusal``.
    """

    turn: float
    first: float | None
    refusal: str = ""


def sun_clock(spacecraft: Spacecraft) -> SunPhases | None:
    """The Sun pulses; None where the file has no Sun or no sensor."""
    if spacecraft.sun is None or spacecraft.sun_sensor is None:
        return None
    turn = block_model.spin_turn(spacecraft)
    try:
        return SunPhases(turn, block_model.first_sun_pulse(spacecraft))
    except Infeasible as reason:
        return SunPhases(turn, None, str(reason))


class Turns(NamedTuple):
    """Turn of H by one pulse of a command block at the spin of t = 0: least and most, rad, and
    their widths, s.
    """

    channel: Channel
    smallest: float
    smallest_width: float
    largest: float
    largest_width: float


def turns(spacecraft: Spacecraft) -> tuple[Turns, ...]:
    """Turns of each channel that blocks can fire, in the order of the file; nothing where the file
    has no commands.
    """
    steps = []
    commands = spacecraft.commands
    spin = spacecraft.spin
    if commands is None:
        return ()
    for channel in usable(spacecraft):
        widths = commandable_widths(commands, channel)
        if len(widths):
            given = acts(channel, widths)
            momentum = abs(spacecraft.axial)
            each = precession.turned_by(
                momentum, abs(channel.transverse), given.on_time, spin, given.spread
            )
            least, most = int(np.argmin(each)), int(np.argmax(each))
            ends = (float(value[at]) for at in (least, most) for value in (each, widths))
            steps.append(Turns(channel, *ends))
    return tuple(steps)


class PairFit(NamedTuple):
    """Two channels for Magnus' two pulses at once: ``miss`` (rad) is the error of direction of the
    second.
    """

    first: Channel
    second: Channel
    miss: float


def channel_steps(spacecraft: Spacecraft) -> tuple[ChannelSteps, ...]:
    """Smallest and largest step of each channel, in the order of the file."""
    period = spacecraft.body_period
    steps = []
    for channel in spacecraft.channels:
        shortest = effective_on_time(channel, shortest_on_time(spacecraft, channel))
        longest = longest_useful(effective_on_times(channel)[1], period)
        on_times = [longest]  # where the spin changes during the pulse, another one may do more
        if channel.axial != 0.0 and 0.0 < longest < math.inf and longest > shortest:
            on_times += np.geomspace(max(shortest, SHORTEST * longest), longest, GRID).tolist()
        most = max(_step(spacecraft, channel, on_time) for on_time in on_times)
        steps.append(ChannelSteps(channel, _step(spacecraft, channel, shortest), most))
    return tuple(steps)


class Acting(NamedTuple):
    """Pulse of a command of ``on_time`` s: ``effective`` s of full thrust, N m s, ``centroid`` s
    after its start.
    """

    channel: Channel
    on_time: float
    effective: float
    impulse: float
    centroid: float


def acting(spacecraft: Spacecraft) -> tuple[Acting, ...]:
    """Pulses of the shortest and the longest command of each channel, of those that have valves."""
    pulses = []
    for channel in spacecraft.channels:
        for on_time in dict.fromkeys((shortest_on_time(spacecraft, channel), channel.max_on_time)):
            if channel.valve is not None and 0.0 < on_time < math.inf:
                thrust = channel.valve.thrust(on_time)
                impulse = channel.strength * thrust.on_time
                pulses.append(Acting(channel, on_time, thrust.on_time, impulse, thrust.centroid))
    return tuple(pulses)


def _step(spacecraft: Spacecraft, channel: Channel, on_time: float) -> float:
    if math.isinf(on_time):
        return 0.5 * math.pi
    slope = spacecraft.inertia.a * channel.axial / spacecraft.inertia.C
    factor = abs(response.width_factor(spacecraft.nutation_rate, slope, on_time))
    return math.atan2(abs(channel.transverse) * on_time * factor, abs(spacecraft.axial))


def mounting_angle(spacecraft: Spacecraft) -> float:
    """`inertia.mounting_angle` of the spacecraft, rad."""
    inertia, rate = spacecraft.inertia, spacecraft.transverse_rate
    return principal_moments.mounting_angle(
        inertia.A, inertia.C, rate, spacecraft.spin, inertia.wheel
    )


def nearest_pair(spacecraft: Spacecraft) -> PairFit | None:
    """The two channels whose directions come nearest to the turn between two half pulses; None
    without channels.
    """
    inertia, rate, spin = spacecraft.inertia, spacecraft.transverse_rate, spacecraft.spin
    needed = cmath.rect(
        1.0, rigid_body.turn_between_halves(inertia.A, inertia.C, rate, spin, inertia.wheel)
    )
    usable = [channel for channel in spacecraft.channels if channel.damps]
    torques = np.array([channel.transverse for channel in usable])
    best: PairFit | None = None
    for first, torque in zip(
        usable, torques, strict=True
    ):  # a row at a time: many channels have very many pairs
        misses = np.angle(torques * np.conj(torque * needed))
        index = int(np.argmin(np.abs(misses).round(DIGITS)))
        if best is None or round(abs(misses[index]), DIGITS) < round(abs(best.miss), DIGITS):
            best = PairFit(first, usable[index], float(misses[index]))
    return best


class Consequence(NamedTuple):
    """Effect of one disturbance in the long run.

    ``forced`` (rad/s) is the steady rate about which ω settles, K(14) fixed in the body, K(15)
    nearly fixed in space, ``tilt`` (rad) the angle between H and the spin axis that goes with it,
    Magnus 1970 (13)/(14). A torque fixed in space turns H by the ``precession`` M/|H| (rad/s);
    under any other H goes round, up to ``swing`` rad from the start. From rest the nutation swells
    to ``beat`` (rad) and back within ``beat_period`` s, (27). At resonance, (25), these are None
    and ``resonant`` holds the times (s) at which it has driven the nutation to `MARKS`. Of one that
    is over before that period is, there is only ``beat``: what it drives from rest to. An axial
    part changes the spin at ``spin_rate`` rad/s².
    """

    disturbance: Disturbance
    forced: float | None
    precession: float | None
    swing: float | None
    tilt: float | None
    beat: float | None
    beat_period: float
    resonant: tuple[tuple[float, float], ...]
    spin_rate: float


MARKS = tuple(math.radians(mark) for mark in (10.0, 30.0, 60.0))
"""Nutation angles for which the time is given that a resonant
disturbance takes to drive it there.
"""


def consequences(spacecraft: Spacecraft) -> Iterator[Consequence]:
    """Effect of each disturbance, in the order of the file."""
    A, C, turning = spacecraft.inertia.A, spacecraft.inertia.C, spacecraft.nutation_rate
    spin = spacecraft.inertia.equivalent(spacecraft.spin)
    omega0 = complex(*spacecraft.omega0[:2])
    for disturbance in spacecraft.disturbances:
        torque = disturbance.transverse
        spin_rate = disturbance.axial / C
        if torque == 0.0:
            yield Consequence(disturbance, 0.0, None, 0.0, 0.0, 0.0, math.inf, (), spin_rate)
            continue
        largest, period = driven.beat(A, turning, torque, disturbance.rate)
        lasts = disturbance.end - disturbance.begin
        if lasts < period:
            swelling = math.sin(math.pi * min(lasts / period, 0.5))
            driven_to = largest * swelling if swelling else abs(torque) / A * lasts
            grown = float(rigid_body.nutation_angle(A, C, driven_to, spin))
            yield Consequence(disturbance, None, None, None, None, grown, period, (), spin_rate)
            continue
        # A beat that takes longer than everything planned, several times over, is a resonance for
        # the user.
        if period > RESONANT * spacecraft.horizon:
            marks = [mark for mark in MARKS if mark > spacecraft.nutation]
            times = [
                (mark, driven.resonant_time(A, spacecraft.axial, omega0, torque, mark))
                for mark in marks
            ]
            yield Consequence(
                disturbance, None, None, None, None, None, period, tuple(times), spin_rate
            )
            continue
        steady = abs(driven.steady_response(A, turning, torque, disturbance.rate))
        turns = abs(spacecraft.spin + disturbance.rate)  # of the torque in space
        precession = abs(torque) / float(np.linalg.norm(spacecraft.momentum))
        steadily = turns * spacecraft.horizon < 1.0
        ways = precession if steadily else None, None if steadily else 2.0 * precession / turns
        tilt, swell = (
            float(rigid_body.nutation_angle(A, C, rate, spin)) for rate in (steady, largest)
        )
        yield Consequence(disturbance, steady, *ways, tilt, swell, period, (), spin_rate)


class SpinAxis(NamedTuple):
    """Principal axis 3 of inertia.

    ``kind`` of `inertia.axis_class`; ``exponent`` p² in 1/s² and ``growth_time`` s of
    `inertia.growth`; ``tilt`` rad against the third axis of the file; ``rates`` in the body, despun
    and inertially, K(7), K(10), K(13), rad/s.
    """

    kind: str
    exponent: float
    growth_time: float
    tilt: float
    rates: principal_moments.NutationRates


def spin_axis(spacecraft: Spacecraft) -> SpinAxis:
    """Class, stability and nutation rates of the spin axis."""
    inertia, spin = spacecraft.inertia, spacecraft.spin
    kind = principal_moments.axis_class(inertia.moments)
    grows = principal_moments.growth(inertia.moments, spin, inertia.wheel)
    rates = principal_moments.nutation_rates(
        inertia.A, inertia.C, spacecraft.transverse_rate, spin, inertia.wheel
    )
    return SpinAxis(
        kind,
        grows.squared_exponent,
        grows.growth_time,
        principal_moments.principal_tilt(inertia.axes),
        rates,
    )
