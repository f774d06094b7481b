"""Euler's equations by scipy's DOP853: written apart from everything else that flies, so that it can judge it.

Cross products, a matrix for the tensor, in the axes of the file, and restarts at every edge of a pulse. Where the
moments fall with the propellant, what is used of it is one number more to be integrated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from nutdamp.errors import Infeasible
from nutdamp.lightening import shed
from nutdamp.physics import attitude
from nutdamp.schedule import Pulse, Schedule
from nutdamp.spacecraft import Spacecraft, SpinState, Vector

EVALUATIONS = 200_000
"""Evaluations of Euler's equations by DOP853, at most: a thousand turns, some 15 seconds."""

Push = tuple[Vector, Vector | None]
"""Torque (3,) N m, principal axes, as a stretch begins, and its slope, N m/s, None for none."""


class Equations:
    """Euler's equations of a spacecraft and its attitude; ``evaluations`` of them so far, ``most`` at most.

    A state (7,) holds the rates, rad/s, and the quaternion, both of the axes of the file; where the moments fall, (8,),
    the propellant used too, kg.
    """

    def __init__(self, spacecraft: Spacecraft, most: int | None = None) -> None:
        self.most = EVALUATIONS if most is None else most
        self.spacecraft, self.axes = spacecraft, spacecraft.inertia.axes
        self.tensor = self.axes @ np.diag(spacecraft.inertia.moments) @ self.axes.T
        self.inverse: Vector = np.asarray(np.linalg.inv(self.tensor), dtype=np.float64)
        per_kg = shed(spacecraft)
        self.shed = None if per_kg is None else self.axes @ np.diag(per_kg) @ self.axes.T
        self.evaluations = 0

    def state(self, motion: SpinState) -> Vector:
        """The state of a motion."""
        turned = attitude.multiply(motion.quaternion, attitude.from_matrix(self.axes.T))
        return np.concatenate([self.axes @ motion.rates, turned, [] if self.shed is None else [0.0]])

    def motion(self, states: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) and quaternions (n, 4) in principal axes of ``states`` (n, 7) or (n, 8)."""
        quaternion = states[:, 3:7] / np.linalg.norm(states[:, 3:7], axis=1, keepdims=True)
        return states[:, :3] @ self.axes, attitude.multiply(quaternion, attitude.from_matrix(self.axes))

    def kicked(self, state: Vector, impulse: Vector, propellant: float = 0.0) -> Vector:
        """The state after an ``impulse`` (3,) N m s in principal axes, which takes so many kg of ``propellant``."""
        _, inverse = self._body(state[7:] + 0.5 * propellant)
        return np.concatenate([state[:3] + inverse @ (self.axes @ impulse), state[3:7], state[7:] + propellant])

    def _body(self, used: Vector) -> tuple[Vector, Vector]:
        """The tensor and its inverse once so many kg are ``used``, (1,), or (0,) where they stay."""
        if self.shed is None:
            return self.tensor, self.inverse
        tensor: Vector = self.tensor - used[0] * self.shed
        return tensor, np.asarray(np.linalg.inv(tensor), dtype=np.float64)

    def solved(
        self,
        state: Vector,
        start: float,
        end: float,
        pushes: Iterable[Push],
        *,
        burn: tuple[float, float] = (0.0, 0.0),
        dense: bool = False,
    ) -> Any:
        """What solve_ivp gives from ``state`` at ``start`` to ``end`` s, with its interpolant where it is ``dense``.

        ``burn``: flow of propellant at ``start``, kg/s, and its slope, kg/s². Raises Infeasible where all of them
        together take more than ``most``.
        """
        from scipy.integrate import solve_ivp

        derivative = self._derivative(start, tuple(pushes), burn)
        return solve_ivp(derivative, (start, end), state, method="DOP853", rtol=1e-13, atol=1e-15, dense_output=dense)

    def _derivative(
        self, start: float, pushes: tuple[Push, ...], burn: tuple[float, float]
    ) -> Callable[[float, Vector], Vector]:
        constant = np.asarray(sum((torque for torque, _ in pushes), np.zeros(3)))
        slope = np.asarray(sum((slope for _, slope in pushes if slope is not None), np.zeros(3)))

        def derivative(t: float, y: Vector) -> Vector:
            self.evaluations += 1
            if self.evaluations > self.most:
                raise Infeasible(f"the motion takes more than {self.most} evaluations of Euler's equations")
            body, q = y[:3], y[3:7]
            tensor, inverse = self._body(y[7:])
            momentum = tensor @ body
            drive = self._sink(momentum)
            torque = self.axes @ (constant + slope * (t - start) + self._disturbed(t))
            spin = inverse @ (torque + drive - np.cross(body, momentum))
            # Nothing inside a body can turn H in space, so the body slips against it at the rate that undoes this.
            slip = np.cross(drive, momentum) / max(float(momentum @ momentum), 1e-300)
            turning = 0.5 * attitude.multiply(q, np.concatenate([[0.0], body + slip]))
            flow = [burn[0] + burn[1] * (t - start)]
            return np.concatenate([spin, turning, flow[: len(y) - 7]])

        return derivative

    def _disturbed(self, t: float) -> Vector:
        """Torque (3,) N m of the disturbances at ``t`` s, principal axes."""
        total = np.zeros(3)
        for one in self.spacecraft.disturbances:
            turned = one.transverse * complex(math.cos(one.rate * t), math.sin(one.rate * t))
            total += (turned.real, turned.imag, one.axial)
        return total

    def _sink(self, momentum: Vector) -> Vector:
        """What energy dissipation adds to dH/dt in the body, (3,) N m in the axes of the file, from H there.

        It turns axis 3 away from H (towards it for an oblate body) at κ sin θ cos θ and leaves H where it is in space.
        So in the body H is turned at that rate towards the plane square to axis 3: along the part of -axis 3 square to
        H.
        """
        axis, size = self.axes[:, 2], float(np.linalg.norm(momentum))
        if self.spacecraft.growth == 0.0 or size == 0.0:
            return np.zeros(3)
        direction = momentum / size
        across = direction * (direction @ axis) - axis  # of length sin θ
        return np.asarray(self.spacecraft.growth * size * (direction @ axis) * across)


def integrate(spacecraft: Spacecraft, schedule: Schedule, times: Vector) -> tuple[Vector, Vector]:
    """The motion under a schedule: rates (n, 3) and quaternions (n, 4) in principal axes at ``times`` (n,) s ascending.

    Raises Infeasible where that takes more than `EVALUATIONS`.
    """
    equations = Equations(spacecraft)
    state = equations.state(spacecraft.initial)
    edges = {0.0, float(times[-1]), *times.tolist()}
    edges |= {edge for pulse in schedule for edge in pulse.edges}
    knots = sorted(edge for edge in edges if edge <= times[-1])
    rows = {}
    for now, end in zip(knots, [*knots[1:], knots[-1]], strict=True):
        for pulse in schedule:
            if pulse.on_time == 0.0 and pulse.t == now:
                state = equations.kicked(state, pulse.impulse, pulse.propellant or 0.0)
        rows[now] = state
        if end > now:
            firing = [(pulse, push) for pulse in schedule if (push := pulse.push(now, end)) is not None]
            burn = np.sum([_flow(*one) for one in firing], axis=0) if firing else (0.0, 0.0)
            state = equations.solved(state, now, end, [push for _, push in firing], burn=(burn[0], burn[1])).y[:, -1]
    return equations.motion(np.array([rows[time] for time in times.tolist()]))


def _flow(pulse: Pulse, push: Push) -> tuple[float, float]:
    """Flow of propellant, kg/s, as a stretch of a pulse begins, and its slope, kg/s²: as the torque, over all of it."""
    torque, slope = push
    along = (pulse.propellant or 0.0) * pulse.impulse / float(pulse.impulse @ pulse.impulse)
    return float(along @ torque), 0.0 if slope is None else float(along @ slope)
