"""The body that schemes plan on: symmetric, and moving as the true one does at small angles.

Three different moments turn in the body at another rate than their mean, on an ellipse instead of a circle; lasting
disturbances move the point about which ω turns. Both are taken out here, so that every scheme plans free motion of
a symmetric body, and put back in: the schedule is translated to the true actuators and corrected on the true motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from nutdamp.limits import Windows
from nutdamp.physics import attitude, forced
from nutdamp.schedule import Pulse, Schedule, channel_pulse, steerable_pulse
from nutdamp.spacecraft import Attitude, Channel, Disturbance, Inertia, Spacecraft, Steerable, Thruster, Vector


@dataclass(frozen=True, eq=False)
class SymmetricModel:
    """``body`` is planned on for ``spacecraft``; ``stretch`` (2,) leads from the ellipse of (ω1, ω2) to the circle."""

    spacecraft: Spacecraft
    body: Spacecraft
    stretch: Vector

    @property
    def exact(self) -> bool:
        """Whether the model moves as the spacecraft does, so that nothing has to be corrected."""
        return self.spacecraft.inertia.symmetric and not self.spacecraft.disturbances and self.spacecraft.growth == 0.0

    def translate(self, made: Schedule) -> Schedule:
        """The schedule with the true actuators."""
        if self.spacecraft.inertia.symmetric:
            return made
        channels = {channel.name: channel for channel in self.spacecraft.channels}
        windows, ready, pulses = Windows(self.spacecraft), self.spacecraft.limits.earliest, []
        for pulse in made:
            channel = channels.get(pulse.channel)
            if channel is None:
                pulses.append(self._steered(pulse, windows, ready))
            else:
                pulses.append(channel_pulse(channel, pulse.t, pulse.on_time))
            ready = pulses[-1].end + self.spacecraft.limits.gap
        return Schedule(tuple(pulses), made.notes, made.bounds)

    def _steered(self, pulse: Pulse, windows: Windows, ready: float) -> Pulse:
        """A steerable pulse of the true torquer: longer or shorter, and so moved where the limits require it."""
        torquer = self.spacecraft.torquer
        assert torquer is not None
        first, second = pulse.impulse[:2] / self.stretch
        impulse, angle = math.hypot(first, second), math.atan2(second, first)
        if torquer.torque is None:
            return steerable_pulse(torquer, pulse.t, angle, impulse=impulse)
        on_time = windows.on_time(impulse / torquer.torque, 0.0, math.inf)
        start = windows.earliest_start(on_time, max(pulse.start, ready))
        t = pulse.t if start is None else start + 0.5 * on_time
        return steerable_pulse(torquer, t, angle, on_time=on_time)


def model_of(spacecraft: Spacecraft, *, turning: bool = False) -> SymmetricModel:
    """The model of a spacecraft; of a symmetric body without disturbances it is the spacecraft itself.

    Its torques change ω as the true ones do; ``turning``: they turn H as the true ones do, and ω at t = 0 is as much
    larger or smaller on average, as the circle may be of any size.
    """
    undisturbed = _without_steady(spacecraft)
    inertia = spacecraft.inertia
    if inertia.symmetric:
        return SymmetricModel(spacecraft, _aimed(undisturbed, spacecraft), np.ones(2))
    from nutdamp.physics import triaxial  # a body of three moments needs it, and few plans are of one

    first, second, C = inertia.moments
    # a ω3 is the true nutation rate, and (s1 ω1, s2 ω2) moves on a circle (linearised Euler equations).
    A = C / (1.0 - triaxial.body_nutation_rate(inertia.moments, 1.0))
    circle = (first * (first - C) / (second * (second - C))) ** 0.25
    scale = np.array([circle, 1.0 / circle])
    stretch = scale * A / np.array([first, second])  # for torques and impulses
    size = float(np.mean(stretch)) if turning else 1.0
    body = replace(
        undisturbed,
        inertia=Inertia((A, A, C), inertia.axes),
        omega0=np.array([*(scale * undisturbed.omega0[:2] / size), undisturbed.omega0[2]]),
        channels=tuple(_stretched(channel, stretch if not turning else np.ones(2)) for channel in undisturbed.channels),
        steerable=_stretched_torquer(undisturbed.steerable, stretch),
        limits=replace(spacecraft.limits, horizon=spacecraft.horizon),
    )
    return SymmetricModel(spacecraft, _aimed(body, spacecraft), stretch)


def _aimed(body: Spacecraft, spacecraft: Spacecraft) -> Spacecraft:
    """The ``body`` with the attitude of the ``spacecraft``, and the target axis as far from its H as the true one is.

    Both have other rates, and so another H; what a plan has to do is the turn from H to the target.
    """
    if spacecraft.goal.axis is None or body is spacecraft:
        return body
    quaternion = spacecraft.initial.quaternion
    given = spacecraft.attitude or Attitude(quaternion)
    in_file_axes = attitude.multiply(quaternion, attitude.from_matrix(spacecraft.inertia.axes.T))
    held = replace(body, attitude=replace(given, quaternion=in_file_axes))
    before, after = (one / float(np.linalg.norm(one)) for one in (spacecraft.momentum, held.momentum))
    # The shortest turn from the one H to the other: two reflections, at the middle between both and at the second.
    middle = (before + after) / float(np.linalg.norm(before + after))
    axis = spacecraft.goal.axis - 2.0 * (middle @ spacecraft.goal.axis) * middle
    return replace(held, goal=replace(spacecraft.goal, axis=axis - 2.0 * (after @ axis) * after))


def _stretched(channel: Channel, stretch: Vector) -> Channel:
    def thruster(one: Thruster) -> Thruster:
        return replace(one, torque=one.torque * np.array([*stretch, 1.0]))

    return replace(channel, thrusters=tuple(thruster(one) for one in channel.thrusters), spends=channel.strength)


def _stretched_torquer(torquer: Steerable | None, stretch: Vector) -> Steerable | None:
    """The stretch differs by direction; its mean is near enough for a plan that is corrected."""
    if torquer is None or torquer.torque is None:
        return torquer
    return replace(torquer, torque=torquer.torque * float(np.mean(stretch)))


def _without_steady(spacecraft: Spacecraft) -> Spacecraft:
    """The spacecraft with ω counted from the steady response to its disturbances, which are then taken out.

    Axial disturbances stay, and transverse ones too slow against the nutation to be steady within the horizon.
    """
    if not spacecraft.disturbances:
        return spacecraft
    steady = steady_omega(spacecraft, 0.0)
    left = tuple(
        replace(one, transverse=0.0 + 0.0j) if settles(spacecraft, one) else one for one in spacecraft.disturbances
    )
    omega0 = spacecraft.omega0 - np.array([steady.real, steady.imag, 0.0])
    return replace(spacecraft, omega0=omega0, disturbances=tuple(one for one in left if one.axial or one.transverse))


def settles(spacecraft: Spacecraft, disturbance: Disturbance) -> bool:
    """Whether ω beats against the disturbance at least once within the horizon: else it is resonant for the plan."""
    detuning = abs(spacecraft.inertia.a * spacecraft.spin + disturbance.rate)
    return detuning * spacecraft.horizon > 2.0 * math.pi


def steady_omega(spacecraft: Spacecraft, time: float) -> complex:
    """ω of the steady response to the disturbances that settle, at ``time`` s: nothing is to be damped about it."""
    inertia = spacecraft.inertia
    return sum(
        (
            forced.steady_response(inertia.A, inertia.C, spacecraft.spin, one.transverse, one.rate)
            * complex(math.cos(one.rate * time), math.sin(one.rate * time))
            for one in spacecraft.disturbances
            if one.transverse and settles(spacecraft, one)
        ),
        0.0 + 0.0j,
    )
