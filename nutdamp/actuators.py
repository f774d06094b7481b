"""What a spacecraft can fire: thrusters, channels of them, and Magnus' steerable torquer. SI, in principal axes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # few spacecraft have valves, and none else needs to load them
    from nutdamp.physics.valve import Valve

Vector = NDArray[np.float64]

STANDARD_GRAVITY = 9.80665
"""m/s², exact by definition (3rd CGPM, 1901); turns a specific impulse in seconds into m/s."""


@dataclass(frozen=True, slots=True)
class Thruster:
    """One thruster: ``torque`` (3,) N m, ``thrust`` N or None, ``isp`` s or None.

    ``force`` (3,) N and ``position`` (3,) m, where it acts, are None for a thruster known by its torque only.
    ``valve`` is what it makes of commands; None gives full thrust from the start of a command to its end.
    """

    name: str
    torque: Vector
    force: Vector | None = None
    thrust: float | None = None
    isp: float | None = None
    min_on_time: float = 0.0
    max_on_time: float = math.inf
    position: Vector | None = None
    valve: Valve | None = None

    @property
    def mass_flow(self) -> float | None:
        """Propellant flow in kg/s; None where thrust or specific impulse is not known."""
        if self.thrust is None or self.isp is None:
            return None
        return self.thrust / (self.isp * STANDARD_GRAVITY)


CANCELLED = 1e-12
"""Share of the largest torque of its thrusters below which that of a channel is rounding."""


@dataclass(frozen=True, slots=True)
class Channel:
    """Thrusters that fire together, as one body-fixed torque.

    ``spends`` N m s is the impulse that a second of it counts for, where the torque is not the true one.
    """

    name: str
    thrusters: tuple[Thruster, ...]
    spends: float | None = None

    def of(self, **changed: Any) -> Channel:
        """The same of thrusters with these fields ``changed`` in each."""
        return replace(self, thrusters=tuple(replace(one, **changed) for one in self.thrusters))

    @property
    def torque(self) -> Vector:
        """Sum of the torques, (3,) N m; zero where they cancel, as of a pair for velocity changes, but for rounding."""
        torques = np.array([thruster.torque for thruster in self.thrusters], dtype=np.float64)
        total = torques.sum(axis=0)
        return np.asarray(np.where(np.abs(total) > CANCELLED * np.abs(torques).max(), total, 0.0))

    @property
    def valve(self) -> Valve | None:
        """That of its thrusters, which all have the same."""
        return self.thrusters[0].valve

    @property
    def transverse(self) -> complex:
        """M1 + i M2 in N m."""
        torque = self.torque
        return complex(torque[0], torque[1])

    @property
    def axial(self) -> float:
        """M3 in N m, which changes the spin."""
        return float(self.torque[2])

    @property
    def strength(self) -> float:
        """Impulse that a second of it costs, N m s: the size of the torque."""
        return float(np.linalg.norm(self.torque)) if self.spends is None else self.spends

    @property
    def damps(self) -> bool:
        """Whether the torque is more transverse than axial; thrusters for the spin are left alone."""
        return abs(self.transverse) > abs(self.axial)

    @property
    def min_on_time(self) -> float:
        """Largest of the thrusters' minima, s."""
        return max(thruster.min_on_time for thruster in self.thrusters)

    @property
    def max_on_time(self) -> float:
        """Smallest of the thrusters' maxima, s."""
        return min(thruster.max_on_time for thruster in self.thrusters)

    @property
    def mass_flow(self) -> float | None:
        """Propellant flow of all thrusters in kg/s; None where one of them is not known."""
        flows = [thruster.mass_flow for thruster in self.thrusters]
        known = [flow for flow in flows if flow is not None]
        return math.fsum(known) if len(known) == len(flows) else None

    @property
    def price(self) -> float:
        """Propellant, kg (impulse, N m s, where that is not known), for one N m s of transverse impulse."""
        return self.cost_rate(by_propellant=True) / abs(self.transverse)

    def cost_rate(self, *, by_propellant: bool) -> float:
        """Propellant, kg/s, of firing; impulse, N m, where that is not known or not what counts."""
        flow = self.mass_flow
        return flow if by_propellant and flow is not None else self.strength

    @property
    def force(self) -> Vector | None:
        """Sum of the forces in body axes, (3,) N; None where the direction of one is not known."""
        known = [thruster.force for thruster in self.thrusters if thruster.force is not None]
        return np.sum(known, axis=0) if len(known) == len(self.thrusters) else None


@dataclass(frozen=True, slots=True)
class Steerable:
    """Magnus' actuator: a torque about any transverse axis, body-fixed during one pulse.

    ``torque`` in N m; None is an ideal impulse of no width.
    """

    torque: float | None = None
    isp: float | None = None
    lever_arm: float | None = None

    @property
    def propellant_per_impulse(self) -> float | None:
        """kg for each N m s; None where specific impulse or lever arm is not known."""
        if self.isp is None or self.lever_arm is None:
            return None
        return 1.0 / (self.lever_arm * self.isp * STANDARD_GRAVITY)
