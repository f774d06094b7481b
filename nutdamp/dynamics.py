"""How a body moves from one moment to the next: the arcs and Taylor pieces of which flights are made."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from nutdamp import work
from nutdamp.motion import Arc, Integrated, Path
from nutdamp.physics import rigid
from nutdamp.physics.rigid import Falling, Forcing
from nutdamp.spacecraft import Spacecraft, SpinState, Vector

LEG, PULSE = 0.03, 0.4
"""Units of `work` of a leg of a flight, and of one that is integrated besides its steps."""

SPUN_STEP, STEP, SUNK_STEP = 0.012, 0.2, 0.7
"""Units of a step of a symmetric body, of any other, and of one with dissipation."""

REMEMBERED = 1000
"""Legs that are remembered, before all are forgotten."""


class Push(NamedTuple):
    """What acts on a leg besides what always does; see `Dynamics.path`."""

    torques: Sequence[Vector]
    slope: Vector | None
    falling: Falling | None


@dataclass(frozen=True, slots=True)
class Dynamics:
    """The body as one of the two models flies it, and what acts on it besides the pulses.

    ``known``: the legs flown before, where they are remembered: see `remembering`.
    """

    moments: tuple[float, float, float]
    constant: Vector
    forcing: Forcing
    known: dict[bytes, tuple[Path, SpinState]] | None = None

    def remembering(self) -> Dynamics:
        """The same, for the flights of trial schedules: each flies anew only from the first pulse that has changed."""
        return replace(self, known={})

    @property
    def free(self) -> bool:
        """Whether coasts are arcs of a symmetric body without torque from outside, known in closed form."""
        return self.moments[0] == self.moments[1] and not self.constant.any() and not self.forcing.turning

    @property
    def step_cost(self) -> float:
        """Units of `work` of one step of integration."""
        if self.forcing.growth != 0.0:
            return SUNK_STEP
        return SPUN_STEP if self.moments[0] == self.moments[1] else STEP

    def path(
        self,
        state: SpinState,
        start: float,
        end: float,
        torques: Sequence[Vector] = (),
        slope: Vector | None = None,
        *,
        most: int,
        falling: Falling | None = None,
    ) -> tuple[Path, SpinState]:
        """Motion from ``state`` at ``start`` to ``end`` s under the sum of ``torques``, and the state it ends in.

        With a ``slope`` (3,) N m/s the torque runs evenly from that sum; the moments may be ``falling``. Raises
        Infeasible where it takes more than ``most`` steps of integration.
        """
        push = Push(torques, slope, falling)
        if self.known is None:
            return self._path(state, start, end, push, most)
        more = (*(() if slope is None else (slope,)), *(falling or ()))
        leg = np.concatenate([self.moments, state.rates, state.quaternion, (start, end), *torques, *more]).tobytes()
        found = self.known.get(leg)
        if found is None or found[0].steps > most:
            if len(self.known) >= REMEMBERED:
                self.known.clear()
            found = self.known[leg] = self._path(state, start, end, push, most)
        return found

    def _path(self, state: SpinState, start: float, end: float, push: Push, most: int) -> tuple[Path, SpinState]:
        work.spend(LEG)
        torques, slope, falling = push
        if end == start or (self.free and not torques and falling is None):
            arc = Arc(self.moments[0], self.moments[2], start, state, self.forcing.growth)
            return arc, state if end == start else arc.end(end)
        torque = np.asarray(sum(torques, self.constant))
        pieces = rigid.integrate(
            self.moments, torque, state.rates, state.quaternion, start, end, self.forcing, most, slope, falling
        )
        work.spend(PULSE + self.step_cost * len(pieces))
        rates_, quaternion_ = pieces[-1].final
        return Integrated(tuple(pieces)), SpinState(complex(rates_[0], rates_[1]), float(rates_[2]), quaternion_)

    def with_moments(self, moments: Vector) -> Dynamics:
        """The same with these principal moments (3,) kg m²."""
        first, second, third = moments.tolist()
        return replace(self, moments=(first, second, third))

    def kicked(self, state: SpinState, impulse: Vector) -> SpinState:
        """The state after an ``impulse`` (3,) N m s."""
        body = state.rates + impulse / np.asarray(self.moments)
        return SpinState(complex(body[0], body[1]), float(body[2]), state.quaternion)


def make_dynamics(spacecraft: Spacecraft) -> Dynamics:
    """What is flown: the true principal moments, and what acts besides the pulses."""
    disturbances = spacecraft.disturbances
    fixed = [disturbance for disturbance in disturbances if disturbance.rate == 0.0]
    transverse = sum(disturbance.transverse for disturbance in fixed)
    return Dynamics(
        moments=spacecraft.inertia.moments,
        constant=np.array([transverse.real, transverse.imag, math.fsum(one.axial for one in disturbances)]),
        forcing=Forcing(
            turning=tuple((one.transverse, one.rate) for one in disturbances if one.rate != 0.0),
            growth=spacecraft.growth,
        ),
    )
