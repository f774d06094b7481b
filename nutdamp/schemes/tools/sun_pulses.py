"""Sun pulses of the nutating body, and firing blocks of pulses from them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from nutdamp import work
from nutdamp.commands import Block, SunSensor
from nutdamp.dynamics import make_dynamics
from nutdamp.errors import Infeasible
from nutdamp.flight import Flight
from nutdamp.lightening import shed
from nutdamp.physics import attitude
from nutdamp.physics.rigid_cases import Bodies, Stretch
from nutdamp.physics.sun_clock import Push, SunClock
from nutdamp.schedule import Pulse, Schedule, on_command
from nutdamp.spacecraft import Spacecraft, Vector
from nutdamp.supply import Supply

SAMPLES = 32
"""Samples of the Sun's azimuth in each spin turn, between which a Sun pulse is found."""

ITERATIONS = 60
"""Steps by which the moment of a Sun pulse is found in a flight, at most; three or four are usual."""

EXACT = 1e-13
"""Share of a spin turn to which it is found."""

BLIND = 32
"""Spin turns in a row without a Sun pulse, after which none is waited for."""

FIRED, INTEGRATED = 1.0, 40.0
"""Units of `work` of a pulse that is fired, of a symmetric body and of one whose motion is integrated."""


def spin_turn(spacecraft: Spacecraft) -> float:
    """Time between two Sun pulses, s: the average one of the free motion.

    The body turns about H at |H|/A, and about its axis at aω3: together, and at small angles, at ω3.
    """
    inertia = spacecraft.inertia
    size = float(np.linalg.norm(spacecraft.momentum))
    return 2.0 * math.pi / abs(math.copysign(size / inertia.A, spacecraft.spin) + inertia.a * spacecraft.spin)


def sun_pulses(flown: Flight, until: float) -> Vector:
    """The times (n,) s from 0 to ``until`` s of the Sun pulses that the sensor gives; the flight must reach so far.

    Raises Infeasible where the sensor never sees the Sun.
    """
    body = flown.spacecraft
    sensor, turn = body.sun_sensor, spin_turn(body)
    assert sensor is not None
    assert body.sun is not None
    times = np.linspace(0.0, until, max(int(SAMPLES * until / turn), 2) + 1)
    # The Sun goes round in the body against the spin: what is left to the sensor's azimuth falls to zero.
    ahead = to_sun_pulse(flown, times)
    index = np.flatnonzero((ahead[:-1] < 0.5 * math.pi) & (ahead[1:] > 1.5 * math.pi))
    found = times[index] + ahead[index] * turn / (2.0 * math.pi)
    for _ in range(ITERATIONS):
        off = (to_sun_pulse(flown, np.minimum(found, until)) + math.pi) % (2.0 * math.pi) - math.pi
        found += off * turn / (2.0 * math.pi)
        if not len(found) or np.abs(off).max() < 2.0 * math.pi * EXACT:
            break
    found = found[(found >= 0.0) & (found <= until)]
    angles = attitude.angle_between(flown.axis(found), body.sun)
    seen = np.array([sensor.sees(angle) for angle in angles.tolist()], dtype=bool)
    if len(found) and not seen.any():
        _expect_seen(sensor, float(found[0]), float(angles[0]))
    return np.asarray(found[seen])


def _expect_seen(sensor: SunSensor, time: float, angle: float) -> None:
    """Raise Infeasible where the sensor does not see the Sun at this ``angle`` (rad) from the spin axis."""
    if not sensor.sees(angle):
        raise Infeasible(
            f"the Sun sensor does not see the Sun at {time:.4g} s, {math.degrees(angle):.4g}° from the spin axis: "
            "there is no Sun pulse"
        )


def to_sun_pulse(flown: Flight, times: Vector) -> Vector:
    """By what angle (n,) in [0, 2π) the body has to turn until the Sun passes the sensor."""
    body = flown.spacecraft
    assert body.sun_sensor is not None
    assert body.sun is not None
    _, quaternions = flown.motion(times)
    seen = attitude.rotate(attitude.conjugate(quaternions), body.sun)
    azimuth = np.arctan2(seen[:, 1], seen[:, 0])
    return np.asarray(math.copysign(1.0, body.spin) * (azimuth - body.sun_sensor.azimuth) % (2.0 * math.pi))


class SunPulses:
    """The Sun pulses of a spacecraft as its sensor gives them, one after the other.

    ``seen``: whether the sensor saw each passage of the Sun through its azimuth so far; those that it saw count. Raises
    Infeasible where there is no Sun or no sensor.
    """

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.clock, self.seen, self._count = sun_clock(spacecraft), list[bool](), 0
        assert spacecraft.sun_sensor is not None
        self._sensor = spacecraft.sun_sensor

    def next(self, number: int) -> Stretch:
        """The motion as the Sun pulse of this ``number`` comes, 1 the first after t = 0; none goes back.

        Raises Infeasible where there is none: the axis is too near to the Sun, or the sensor sees it no more.
        """
        found, sensor = self.clock.here, self._sensor
        if sensor.sees_all:
            before = float(self.clock.time[0])
            self.seen += [True] * (number - len(self.seen))
            found = self.clock.sun_pulse(number)
            self._expect_found(before)
            return found
        unseen: list[tuple[float, float]] = []
        while self._count < number:
            before = float(self.clock.time[0])
            found = self.clock.sun_pulse(len(self.seen) + 1)
            self._expect_found(before)
            angle = float(self.clock.angle(found)[0])
            self.seen.append(bool(sensor.sees(angle)))
            self._count += self.seen[-1]
            unseen = [] if self.seen[-1] else [*unseen, (float(found.since[0]), angle)]
            if len(unseen) > BLIND:
                _expect_seen(sensor, *unseen[0])
        return found

    def _expect_found(self, before: float) -> None:
        if self.clock.lost[0]:
            raise Infeasible(f"no Sun pulse comes after {max(before, 0.0):.4g} s: the spin axis is too near to the Sun")


def sun_clock(spacecraft: Spacecraft) -> SunClock:
    """The Sun pulses of a spacecraft from t = 0; raises Infeasible where it has none."""
    sensor, sun = spacecraft.sun_sensor, spacecraft.sun
    if sensor is None or sun is None:
        raise Infeasible("there is no Sun pulse; the file needs sun and sun_sensor")
    dynamics, start = make_dynamics(spacecraft), spacecraft.initial
    bodies = Bodies(np.array(dynamics.moments)[:, None], dynamics.constant, dynamics.forcing)
    state = Stretch(bodies, np.zeros(1), start.rates[:, None], start.quaternion[:, None])
    return SunClock(state, sun[:, None], math.copysign(1.0, spacecraft.spin), sensor.azimuth)


def pushes(pulse: Pulse, torque: Vector) -> list[Push]:
    """The torques of a pulse, from when its command begins, that has the ``torque`` (3, n) N m of cases."""
    if pulse.command is None:
        return [Push(0.0, pulse.on_time, torque, torque)]
    back, ramps = pulse.command.start, pulse.command.ramps
    return [Push(one.begin - back, one.end - back, torque * one.first, torque * one.last) for one in ramps]


def first_sun_pulse(spacecraft: Spacecraft) -> float:
    """When the first Sun pulse comes, s; raises Infeasible where there is none."""
    return float(SunPulses(spacecraft).next(1).since[0])


def fired(spacecraft: Spacecraft, blocks: Sequence[Block], seed: int | None = None) -> Schedule:
    """The pulses that ``blocks`` fire, see `fire`."""
    return fire(spacecraft, blocks, seed)[0]


def fire(spacecraft: Spacecraft, blocks: Sequence[Block], seed: int | None = None) -> tuple[Schedule, list[bool]]:
    """The pulses that ``blocks`` fire, with the Sun pulses of the motion that they make, and `SunPulses.seen`.

    With a ``seed`` the Sun pulses have the jitter of the sensor, which the nominal motion is without. Raises Infeasible
    where there is no Sun pulse, where a channel is not known, where a pulse would begin before the one before is over,
    and where the propellant does not last.
    """
    channels = {channel.name: channel for channel in spacecraft.channels}
    sun_pulses, sensor, errors = SunPulses(spacecraft), spacecraft.sun_sensor, np.random.default_rng(seed)
    clock = sun_pulses.clock
    jitter = 0.0 if seed is None or sensor is None else sensor.jitter
    supply, pulses, per_kg = Supply(spacecraft), list[Pulse](), shed(spacecraft)
    for block in blocks:
        channel = channels.get(block.channel)
        if channel is None:
            raise Infeasible(f"the spacecraft has no channel {block.channel}")
        for number in block.sun_pulses:
            work.spend(FIRED if spacecraft.inertia.symmetric and not spacecraft.disturbances else INTEGRATED)
            found, over = sun_pulses.next(number), clock.over[0]
            delay = found.since * 0.0 + jitter * errors.standard_normal() + block.delay
            due = float(found.since[0] + delay[0])
            if due < over - 1e-9:
                raise Infeasible(f"a pulse of {channel.name} would begin at {due:.6g} s, before the one before is over")
            given = supply.fire(on_command(channel, 0.0, block.width), channel)
            sheds = None if per_kg is None else (per_kg * (given.propellant or 0.0))[:, None]
            torque = np.zeros(3) if given.torque is None else given.torque
            start = float(clock.fire(found, delay, block.width, pushes(given, torque[:, None]), sheds)[0])
            pulses.append(given.moved(start))
    supply.expect_to_last()
    return Schedule(tuple(pulses), blocks=tuple(blocks)), sun_pulses.seen
