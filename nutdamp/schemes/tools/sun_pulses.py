"""Firing blocks of pulses from the Sun pulses of the nutating body.

The Sun pulse comes when the Sun passes the azimuth of the sensor in the body: as the body moves, not as it would
without nutation. So each pulse moves the Sun pulses after it, and a block is flown firing by firing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from nutdamp import flight
from nutdamp.commands import Block
from nutdamp.errors import Infeasible
from nutdamp.flight import Flight
from nutdamp.physics import attitude
from nutdamp.schedule import Pulse, Schedule, channel_pulse
from nutdamp.schemes.tools.flown_builder import FlownBuilder
from nutdamp.spacecraft import Channel, Spacecraft, Vector

SAMPLES = 32
"""Samples of the Sun's azimuth in each spin turn, between which a Sun pulse is found."""

ITERATIONS = 60
"""Steps by which the moment of a Sun pulse is found, at most; three or four are usual."""

EXACT = 1e-13
"""Share of a spin turn to which it is found."""

ON_TIME = 1e-6
"""Share of a spin turn after a Sun pulse within which another one is the same."""


def spin_turn(spacecraft: Spacecraft) -> float:
    """Time between two Sun pulses, s: the average one of the free motion.

    The body turns about H at |H|/A, and about its axis at aω3: together, and at small angles, at ω3.
    """
    inertia = spacecraft.inertia
    size = float(np.linalg.norm(spacecraft.momentum))
    return 2.0 * math.pi / abs(math.copysign(size / inertia.A, spacecraft.spin) + inertia.a * spacecraft.spin)


def sun_pulses(flown: Flight, until: float) -> Vector:
    """The times (n,) s from 0 to ``until`` s at which the Sun passes the sensor; the flight must reach so far.

    Raises Infeasible where the sensor does not see the Sun then.
    """
    body = flown.spacecraft
    sensor, turn = body.sun_sensor, spin_turn(body)
    assert sensor is not None
    assert body.sun is not None
    times = np.linspace(0.0, until, max(int(SAMPLES * until / turn), 2) + 1)
    # The Sun goes round in the body against the spin: what is left to the sensor's azimuth falls to zero.
    ahead = _ahead(flown, times)
    index = np.flatnonzero((ahead[:-1] < 0.5 * math.pi) & (ahead[1:] > 1.5 * math.pi))
    found = times[index] + ahead[index] * turn / (2.0 * math.pi)
    for _ in range(ITERATIONS):
        off = (_ahead(flown, np.minimum(found, until)) + math.pi) % (2.0 * math.pi) - math.pi
        found += off * turn / (2.0 * math.pi)
        if not len(found) or np.abs(off).max() < 2.0 * math.pi * EXACT:
            break
    found = found[(found >= 0.0) & (found <= until)]
    for time, angle in zip(found.tolist(), attitude.angle_between(flown.axis(found), body.sun).tolist(), strict=True):
        if not sensor.sees(angle):
            raise Infeasible(
                f"the Sun sensor does not see the Sun at {time:.4g} s, {math.degrees(angle):.4g}° from the spin axis: "
                "there is no Sun pulse"
            )
    return found


def _ahead(flown: Flight, times: Vector) -> Vector:
    """By what angle (n,) in [0, 2π) the body has to turn until the Sun passes the sensor."""
    body = flown.spacecraft
    assert body.sun_sensor is not None
    assert body.sun is not None
    _, quaternions = flown.motion(times)
    seen = attitude.rotate(attitude.conjugate(quaternions), body.sun)
    azimuth = np.arctan2(seen[:, 1], seen[:, 0])
    return np.asarray(math.copysign(1.0, body.spin) * (azimuth - body.sun_sensor.azimuth) % (2.0 * math.pi))


def fired(spacecraft: Spacecraft, blocks: Sequence[Block], seed: int | None = None) -> Schedule:
    """The pulses that ``blocks`` fire, with the Sun pulses of the motion that they make.

    With a ``seed`` the Sun pulses have the jitter of the sensor, which the nominal motion is without. Raises Infeasible
    where there is no Sun pulse, where a channel is not known, and where a pulse would begin before the one before is
    over.
    """
    channels = {channel.name: channel for channel in spacecraft.channels}
    builder, clock = FlownBuilder(spacecraft), Clock(spacecraft)
    sensor, errors = spacecraft.sun_sensor, np.random.default_rng(seed)
    jitter = 0.0 if seed is None or sensor is None else sensor.jitter
    for block in blocks:
        channel = channels.get(block.channel)
        if channel is None:
            raise Infeasible(f"the spacecraft has no channel {block.channel}")
        for number in range(block.first, block.first + block.count * block.every, block.every):
            start = clock.time_of(number) + jitter * errors.standard_normal() + block.delay
            _fire(builder, clock, channel, start, block.width)
    return replace(builder.schedule(), blocks=tuple(blocks))


def _fire(builder: FlownBuilder, clock: Clock, channel: Channel, start: float, width: float) -> None:
    begin = start - builder.now
    if begin < -1e-9:
        raise Infeasible(f"a pulse of {channel.name} would begin at {start:.6g} s, before the one before is over")
    pulse = channel_pulse(channel, max(begin, 0.0) + 0.5 * width, width)
    clock.fire(builder.here, builder.now, pulse)
    builder.fire((pulse,))


class Clock:
    """The Sun pulses so far, counted from 1; those to come are those of the motion if nothing more is fired."""

    def __init__(self, spacecraft: Spacecraft) -> None:
        if spacecraft.sun_sensor is None or spacecraft.sun is None:
            raise Infeasible("there is no Sun pulse; the file needs sun and sun_sensor")
        self._times: list[float] = []
        self._turn = spin_turn(spacecraft)
        self._here, self._now, self._pulses = spacecraft, 0.0, Schedule()

    def time_of(self, number: int) -> float:
        """When the Sun pulse of that ``number`` comes, s."""
        while len(self._times) < number:
            self._look(number - len(self._times))
        return self._times[number - 1]

    def fire(self, here: Spacecraft, now: float, pulse: Pulse) -> None:
        """``pulse`` is fired, with its time from ``now`` s, when the spacecraft is as ``here``."""
        start = now + pulse.start
        self._times = [time for time in self._times if time <= start]
        if not self._times or self._times[-1] < start - 0.9 * self._turn:
            self._look_until(start)  # which later ones cannot, when they count from here
        self._here, self._now, self._pulses = here, now, Schedule((pulse,))

    def _look(self, more: int) -> None:
        """Find so many ``more`` Sun pulses, or at least one."""
        last = max(self._times[-1] if self._times else 0.0, self._now)
        before = len(self._times)
        self._look_until(last + (more + 0.5) * self._turn)
        if len(self._times) == before:
            self._look_until(last + (more + 2.0) * self._turn)
        if len(self._times) == before:
            raise Infeasible(f"no Sun pulse comes after {last:.4g} s: the spin axis is too near to the Sun")

    def _look_until(self, time: float) -> None:
        until = max(time - self._now, self._pulses.end)
        found = sun_pulses(flight.flown(self._here, self._pulses, until), until) + self._now
        last = self._times[-1] if self._times else -math.inf
        self._times += [one for one in found.tolist() if one > last + ON_TIME * self._turn]
