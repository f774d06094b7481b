"""What blocks of pulses fired from the Sun pulse do, in closed form, for very many blocks at once.

H follows a rhumb line about the Sun (`physics.sun_train`), and the nutation is the impulse sum (17) over pulses at even
times. What is left out: that the nutation jitters the Sun pulses, and what is of second order in the turn by one pulse.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from nutdamp.compliance import Left
from nutdamp.errors import Infeasible
from nutdamp.physics import sun_train
from nutdamp.schemes.tools.sun_pulses import first_sun_pulse, spin_turn
from nutdamp.spacecraft import Channel, Spacecraft


class Trial(NamedTuple):
    """Blocks that are tried, as arrays that broadcast.

    ``wait`` Sun pulses are let pass first; ``delay`` and ``width`` in s, ``count`` pulses, one in ``every`` spins.
    """

    wait: Any
    delay: Any
    width: Any
    count: Any
    every: Any


@dataclass(frozen=True)
class State:
    """The motion between two blocks: one, or many at once.

    ``sun_angle`` and ``longitude`` of H about the Sun, rad; ``sun_pulse``: when the next one comes, s; ``phasor``:
    A ω (N m s) at that moment; ``spin`` rad/s.
    """

    sun_angle: Any
    longitude: Any
    phasor: Any
    sun_pulse: Any
    spin: Any


class BlockModel:
    """The closed form of one spacecraft, and what of its motion it is judged by."""

    def __init__(self, spacecraft: Spacecraft) -> None:
        sun, sensor = spacecraft.sun, spacecraft.sun_sensor
        if sun is None or sensor is None:
            raise Infeasible("blocks are fired from the Sun pulse: the file needs sun and sun_sensor")
        self.body, self.inertia, self.sensor = spacecraft, spacecraft.inertia, sensor
        self.sense = math.copysign(1.0, spacecraft.spin)
        start = spacecraft.momentum / float(np.linalg.norm(spacecraft.momentum))
        # About the Sun: longitudes count from the meridian of H at t = 0, right-handed.
        sine = float(np.linalg.norm(np.cross(sun, start)))
        if sine < 1e-6:
            raise Infeasible("the spin axis points to the Sun or away from it: it has no Sun pulse")
        self._frame = np.array([np.cross(np.cross(sun, start), sun) / sine, np.cross(sun, start) / sine, sun])
        self.goal = self._frame @ spacecraft.target_axis
        self.rate = self.inertia.body_rate
        first = first_sun_pulse(spacecraft)
        rate = self.rate * spacecraft.spin
        self.start = State(
            sun_angle=math.atan2(sine, float(sun @ start)),
            longitude=0.0,
            phasor=self.inertia.A * complex(*spacecraft.omega0[:2].tolist()) * cmath.exp(-1j * rate * first),
            sun_pulse=first,
            spin=spacecraft.spin,
        )
        self.turn = spin_turn(spacecraft)

    def turned_by(self, channel: Channel, width: Any, spin: Any) -> Any:
        """By how much one pulse turns H, rad."""
        return sun_train.turned_by(self.inertia.C * abs(spin), abs(channel.transverse), width, spin)

    def heading(self, channel: Channel, delay: Any, width: Any) -> Any:
        """Heading of H from the direction away from the Sun, right-handed about H, rad: the same for all pulses.

        At the centre of a pulse the Sun has turned in the body by -ω3 (delay + width/2) from the sensor.
        """
        from_sun = cmath.phase(channel.transverse) - self.sensor.azimuth + self.body.spin * (delay + 0.5 * width)
        return self.sense * (from_sun - math.pi)

    def delay(self, channel: Channel, heading: Any, width: Any) -> Any:
        """The delay in [0, one spin turn) s that gives a ``heading``: the inverse of `heading`."""
        azimuth = self.sense * heading + math.pi - cmath.phase(channel.transverse) + self.sensor.azimuth
        return (azimuth / self.body.spin - 0.5 * width) % (2.0 * math.pi / abs(self.body.spin))

    def damping_delay(self, state: State, channel: Channel, trial: Trial) -> Any:
        """The first delay, s, at which blocks take most of the nutation; ``trial.delay`` is not looked at.

        The kicks of the block, each carried to the first one, add up to a phasor; ω must then point against it.
        """
        interval, rate = trial.every * self.turn, self.rate * self.body.spin
        kicks = channel.transverse * sun_train.phasor_sum(trial.count, rate * interval)
        to_go = np.angle(-kicks / (state.phasor * np.exp(-1j * rate * trial.wait * self.turn)))
        return (-to_go / rate - 0.5 * trial.width) % (2.0 * math.pi / abs(rate)) if rate != 0.0 else 0.0 * to_go

    def course(self, state: State) -> tuple[Any, Any]:
        """Heading to the target axis, and the way along the rhumb line, rad."""
        goal_angle = math.atan2(math.hypot(self.goal[0], self.goal[1]), self.goal[2])
        goal_longitude = math.atan2(self.goal[1], self.goal[0])
        ahead = (goal_longitude - state.longitude + math.pi) % (2.0 * math.pi) - math.pi
        return sun_train.rhumb_course(state.sun_angle, goal_angle, ahead)

    def after(self, state: State, channel: Channel, trial: Trial) -> State:
        """The motion after blocks of a ``channel`` from ``state``."""
        gained = channel.axial * trial.width / self.inertia.C
        spin = state.spin + 0.5 * trial.count * gained  # on average along the block
        step = self.turned_by(channel, trial.width, spin)
        heading = self.heading(channel, trial.delay, trial.width)
        rhumb = sun_train.rhumb_end(state.sun_angle, heading, trial.count * step)
        turn = self.turn * np.abs(self.body.spin / spin)
        # As H goes round the Sun, its meridian turns about H, and the Sun pulse comes later by as much.
        interval = trial.every * turn + rhumb.turn / trial.count * turn / (2.0 * math.pi)
        first = state.sun_pulse + trial.wait * self.turn * np.abs(self.body.spin / state.spin)
        following = first + (trial.count - 1) * interval + turn
        rate = self.rate * spin
        kick = channel.transverse * trial.width * np.sinc(0.5 * rate * trial.width / np.pi)
        since_last = turn - trial.delay - 0.5 * trial.width
        gathered = kick * np.exp(-1j * rate * since_last) * sun_train.phasor_sum(trial.count, -rate * interval)
        return State(
            sun_angle=rhumb.sun_angle,
            longitude=state.longitude + rhumb.longitude,
            phasor=state.phasor * np.exp(-1j * rate * (following - state.sun_pulse)) + gathered,
            sun_pulse=following,
            spin=state.spin + trial.count * gained,
        )

    def left(self, state: State) -> Left:
        """What of it is left, as `compliance` takes it."""
        across = np.sin(state.sun_angle)
        axis = np.stack(
            np.broadcast_arrays(
                across * np.cos(state.longitude), across * np.sin(state.longitude), np.cos(state.sun_angle)
            ),
            axis=-1,
        )
        apart = np.arctan2(np.linalg.norm(np.cross(axis, self.goal), axis=-1), axis @ self.goal)
        nutation = np.arctan2(np.abs(state.phasor), self.inertia.C * np.abs(state.spin))
        return Left(nutation, apart, state.spin)
