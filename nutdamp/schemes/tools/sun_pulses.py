"""Firing blocks of pulses from the Sun pulses of the nutating body."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from nutdamp import work
from nutdamp.commands import Block
from nutdamp.dynamics import make_dynamics
from nutdamp.errors import Infeasible
from nutdamp.physics.rigid_cases import Bodies
from nutdamp.physics.sun_clock import Stretch, SunClock
from nutdamp.schedule import Pulse, Schedule, channel_pulse
from nutdamp.spacecraft import Spacecraft

FIRED = 1.0
"""Units of `work` of a pulse that is fired."""


def spin_turn(spacecraft: Spacecraft) -> float:
    """Time between two Sun pulses, s: the average one of the free motion.

    The body turns about H at |H|/A, and about its axis at aω3: together, and at small angles, at ω3.
    """
    inertia = spacecraft.inertia
    size = float(np.linalg.norm(spacecraft.momentum))
    return 2.0 * math.pi / abs(math.copysign(size / inertia.A, spacecraft.spin) + inertia.a * spacecraft.spin)


def sun_pulse(spacecraft: Spacecraft, clock: SunClock, number: int) -> Stretch:
    """The motion as a Sun pulse comes that the sensor sees; raises Infeasible where it sees none."""
    before, found = float(clock.time[0]), clock.sun_pulse(number)
    if clock.lost[0]:
        raise Infeasible(f"no Sun pulse comes after {max(before, 0.0):.4g} s: the spin axis is too near to the Sun")
    angle = float(clock.angle(found)[0])
    assert spacecraft.sun_sensor is not None
    if not spacecraft.sun_sensor.sees(angle):
        raise Infeasible(
            f"the Sun sensor does not see the Sun at {found.since[0]:.4g} s, {math.degrees(angle):.4g}° from the spin "
            "axis: there is no Sun pulse"
        )
    return found


def sun_clock(spacecraft: Spacecraft) -> SunClock:
    """The Sun pulses of a spacecraft from t = 0; raises Infeasible where it has none."""
    sensor, sun = spacecraft.sun_sensor, spacecraft.sun
    if sensor is None or sun is None:
        raise Infeasible("there is no Sun pulse; the file needs sun and sun_sensor")
    dynamics, start = make_dynamics(spacecraft), spacecraft.initial
    bodies = Bodies(np.array(dynamics.moments)[:, None], dynamics.constant, dynamics.forcing)
    state = Stretch(np.zeros(1), start.rates[:, None], start.quaternion[:, None])
    return SunClock(bodies, state, sun[:, None], math.copysign(1.0, spacecraft.spin), sensor.azimuth)


def fired(spacecraft: Spacecraft, blocks: Sequence[Block], seed: int | None = None) -> Schedule:
    """The pulses that ``blocks`` fire, with the Sun pulses of the motion that they make.

    With a ``seed`` the Sun pulses have the jitter of the sensor, which the nominal motion is without. Raises Infeasible
    where there is no Sun pulse, where a channel is not known, and where a pulse would begin before the one before is
    over.
    """
    channels = {channel.name: channel for channel in spacecraft.channels}
    clock, sensor, errors = sun_clock(spacecraft), spacecraft.sun_sensor, np.random.default_rng(seed)
    jitter = 0.0 if seed is None or sensor is None else sensor.jitter
    pulses: list[Pulse] = []
    for block in blocks:
        channel = channels.get(block.channel)
        if channel is None:
            raise Infeasible(f"the spacecraft has no channel {block.channel}")
        for number in block.sun_pulses:
            work.spend(FIRED)
            found, over = sun_pulse(spacecraft, clock, number), clock.here.since[0]
            delay = found.since * 0.0 + jitter * errors.standard_normal() + block.delay
            due = float(found.since[0] + delay[0])
            if due < over - 1e-9:
                raise Infeasible(f"a pulse of {channel.name} would begin at {due:.6g} s, before the one before is over")
            start = float(clock.fire(found, delay, block.width, channel.torque[:, None])[0])
            pulses.append(channel_pulse(channel, start + 0.5 * block.width, block.width))
    return Schedule(tuple(pulses), blocks=tuple(blocks))
