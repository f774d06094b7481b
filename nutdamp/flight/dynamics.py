"""Motion between two pulses: coasts of symmetric bodies in closed form, else Taylor pieces; falling moments."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np

from nutdamp.common import work
from nutdamp.physics import attitude, energy_sink, taylor, triaxial
from nutdamp.physics.taylor import Falling, Forcing, TaylorPiece
from nutdamp.spacecraft.model import Inertia, Spacecraft, SpinState, Vector
from nutdamp.spacecraft.schedule import Schedule


class Path(Protocol):
    """Motion without jumps."""

    @property
    def steps(self) -> int:
        """Steps of integration."""
        ...

    def motion(self, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) in rad/s and quaternions (n, 4) at ``times`` (n,) s."""
        ...


@dataclass(frozen=True, slots=True)
class Arc:
    """Coast of a symmetric body in closed form, from ``state`` at ``start`` s.

    ``growth`` 1/s is `energy_sink`'s κ, ``wheel`` h in N m s.
    """

    A: float
    C: float
    start: float
    state: SpinState
    growth: float = 0.0
    wheel: float = 0.0

    @classmethod
    def of(cls, inertia: Inertia, state: SpinState, start: float = 0.0) -> Arc:
        """Coast of a body without dissipation."""
        return cls(inertia.A, inertia.C, start, state, wheel=inertia.wheel)

    @property
    def steps(self) -> int:
        """A closed form takes none."""
        return 0

    def motion(self, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) in rad/s and quaternions (n, 4) at ``times`` (n,) s."""
        since = np.asarray(times) - self.start
        state = self.state
        if self.growth != 0.0:
            omega, spin, quaternion = energy_sink.arc(
                self.A, self.C, self.growth, state.quaternion, state.omega, state.spin, since, self.wheel
            )
            return np.column_stack([omega.real, omega.imag, spin]), quaternion
        turning = (self.A - self.C) / self.A * state.spin - self.wheel / self.A
        omega = state.omega * np.exp(-1j * turning * since)
        quaternion = attitude.arc(self.A, self.C, state.quaternion, state.omega, state.spin, since, self.wheel)
        return np.column_stack([omega.real, omega.imag, np.full(len(since), state.spin)]), quaternion

    def end(self, time: float) -> SpinState:
        """State at ``time`` s."""
        A, C, state, since, wheel = self.A, self.C, self.state, time - self.start, self.wheel
        motion = state.quaternion, state.omega, state.spin, since, wheel
        if self.growth != 0.0:
            return SpinState(*energy_sink.arc_end(A, C, self.growth, *motion))
        turned = cmath.exp(-1j * ((A - C) / A * state.spin - wheel / A) * since)
        quaternion = attitude.arc_end(A, C, *motion)
        return SpinState(state.omega * turned, state.spin, quaternion)


@dataclass(frozen=True, slots=True)
class FreeCoast:
    """Coast of a rigid body with any principal ``moments`` in closed form, from ``state`` at ``start`` s."""

    moments: tuple[float, float, float]
    start: float
    state: SpinState

    @property
    def steps(self) -> int:
        """A closed form takes none."""
        return 0

    def motion(self, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) in rad/s and quaternions (n, 4) at ``times`` (n,) s."""
        since, rates = np.asarray(times) - self.start, self.state.rates
        turned = triaxial.free_attitude(self.moments, rates, self.state.quaternion, since)
        return triaxial.free_rates(self.moments, rates, since), turned


@dataclass(frozen=True, slots=True)
class Integrated:
    """Motion under a constant torque, or of a body with three different moments, as Taylor pieces."""

    pieces: tuple[TaylorPiece, ...]

    @property
    def steps(self) -> int:
        """Steps of integration."""
        return len(self.pieces)

    def motion(self, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) in rad/s and quaternions (n, 4) at ``times`` (n,) s."""
        times = np.asarray(times, dtype=float)
        starts = np.array([piece.start for piece in self.pieces])
        owner = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(starts) - 1)
        body, quaternion = np.empty((len(times), 3)), np.empty((len(times), 4))
        for index in np.flatnonzero(np.bincount(owner)):  # np.unique would load numpy.ma
            rows = owner == index
            body[rows], quaternion[rows] = self.pieces[index].at(times[rows])
        return body, quaternion


LONG = 20.0
"""Turn, rad, from which a free coast of a body with three moments is flown in closed form: Taylor pieces cost more."""

LEG, PULSE = 0.03, 0.4
"""Units of `work` of a leg of a flight, and additional ones of an integrated leg."""

SPUN_STEP, STEP, SUNK_STEP = 0.012, 0.2, 0.7
"""Units of a step of a symmetric body, of any other, and of one with dissipation."""

REMEMBERED = 1000
"""Legs that are remembered, before all are forgotten."""


class Push(NamedTuple):
    """Torque on a leg besides the permanent ones; see `Dynamics.path`."""

    torques: Sequence[Vector]
    slope: Vector | None
    falling: Falling | None


@dataclass(frozen=True, slots=True)
class Dynamics:
    """Body as flown by one of the two models, with all torques besides the pulses.

    ``known``: the legs flown before, where they are remembered: see `remembering`.
    """

    moments: tuple[float, float, float]
    constant: Vector
    forcing: Forcing
    known: dict[bytes, tuple[Path, SpinState]] | None = None

    def remembering(self) -> Dynamics:
        """Copy with a cache for trial schedules: each flies anew only from the first changed pulse."""
        return replace(self, known={})

    @property
    def free(self) -> bool:
        """True if coasts are arcs of a symmetric body without external torque, known in closed form."""
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
        """Motion from ``state`` at ``start`` to ``end`` s under the sum of ``torques``, and its final state.

        With a ``slope`` (3,) N m/s the torque runs evenly from that sum; the moments may be ``falling``. Raises
        Infeasible where it takes more than ``most`` steps of integration.
        """
        push = Push(torques, slope, falling)
        if self.known is None:
            return self._path(state, start, end, push, most)
        more = (*(() if slope is None else (slope,)), *(falling or ()))
        leg = np.concatenate([self.moments, state.rates, state.quaternion, (start, end), *torques, *more]).tobytes()
        path = self.known.get(leg)
        if path is None or path[0].steps > most:
            if len(self.known) >= REMEMBERED:
                self.known.clear()
            path = self.known[leg] = self._path(state, start, end, push, most)
        return path

    def _path(self, state: SpinState, start: float, end: float, push: Push, most: int) -> tuple[Path, SpinState]:
        work.spend(LEG)
        torques, slope, falling = push
        if end == start or (self.free and not torques and falling is None):
            arc = Arc(self.moments[0], self.moments[2], start, state, self.forcing.growth, self.forcing.wheel)
            return arc, state if end == start else arc.end(end)
        torque = np.asarray(sum(torques, self.constant))
        long = float(np.linalg.norm(state.rates)) * (end - start) > LONG
        if long and falling is None and slope is None and not torque.any() and self.forcing == Forcing():
            coast = FreeCoast(self.moments, start, state)
            (rates,), (quaternion,) = coast.motion(np.array([end]))
            work.spend(PULSE)
            return coast, SpinState(complex(rates[0], rates[1]), float(rates[2]), quaternion)
        pieces = taylor.integrate(
            self.moments, torque, state.rates, state.quaternion, start, end, self.forcing, most, slope, falling
        )
        work.spend(PULSE + self.step_cost * len(pieces))
        rates_, quaternion_ = pieces[-1].final
        return Integrated(tuple(pieces)), SpinState(complex(rates_[0], rates_[1]), float(rates_[2]), quaternion_)

    def with_moments(self, moments: Vector) -> Dynamics:
        """Copy with these principal moments (3,) kg m²."""
        first, second, third = moments.tolist()
        return replace(self, moments=(first, second, third))

    def kicked(self, state: SpinState, impulse: Vector) -> SpinState:
        """State after an ``impulse`` (3,) N m s."""
        body = state.rates + impulse / np.asarray(self.moments)
        return SpinState(complex(body[0], body[1]), float(body[2]), state.quaternion)


def make_dynamics(spacecraft: Spacecraft) -> Dynamics:
    """Dynamics of the true principal moments and disturbances."""
    disturbances = spacecraft.disturbances
    fixed = [disturbance for disturbance in disturbances if disturbance.rate == 0.0]
    transverse = sum(disturbance.transverse for disturbance in fixed)
    return Dynamics(
        moments=spacecraft.inertia.moments,
        constant=np.array(
            [transverse.real, transverse.imag, math.fsum(disturbance.axial for disturbance in disturbances)]
        ),
        forcing=Forcing(
            turning=tuple(
                (disturbance.transverse, disturbance.rate) for disturbance in disturbances if disturbance.rate != 0.0
            ),
            growth=spacecraft.growth,
            wheel=spacecraft.inertia.wheel,
        ),
    )


def shed(spacecraft: Spacecraft) -> Vector | None:
    """Decrease of the principal moments per kg of propellant used, (3,) m²; None where they stay."""
    per_kg = None if spacecraft.tank is None else spacecraft.tank.inertia_per_kg
    return None if per_kg is None else np.array(per_kg)


def lightened(spacecraft: Spacecraft, used: float) -> Inertia:
    """Inertia once ``used`` kg of propellant are gone."""
    per_kg, inertia = shed(spacecraft), spacecraft.inertia
    if per_kg is None or used == 0.0:
        return inertia
    first, second, third = (np.asarray(inertia.moments) - used * per_kg).tolist()
    return replace(inertia, moments=(first, second, third))


class Lightening:
    """Mass-property change along a flight, as the propellant of the pulses is used."""

    def __init__(self, dynamics: Dynamics, spacecraft: Spacecraft, schedule: Schedule, edges: Sequence[float]) -> None:
        self.first, self.per_kg = dynamics.moments, shed(spacecraft)
        times = np.array([*edges, *(0.5 * (start + other) for start, other in pairwise(edges))])
        self.used = {} if self.per_kg is None else dict(zip(times.tolist(), schedule.used_by(times), strict=True))

    def halfway(self, dynamics: Dynamics, time: float) -> Dynamics:
        """Body with half of the propellant gone that is used at once at ``time`` s."""
        if self.per_kg is None:
            return dynamics
        before = max((used for when, used in self.used.items() if when < time), default=0.0)
        return dynamics.with_moments(self.first - 0.5 * (before + self.used[time]) * self.per_kg)

    def between(self, dynamics: Dynamics, start: float, end: float) -> tuple[Dynamics, Falling | None]:
        """Body at ``start`` s, and the fall of its moments until ``end`` s, with no edge of a pulse in between.

        As no more than a quadratic of time: what is used by start, middle and end says all.
        """
        if self.per_kg is None:
            return dynamics, None
        before, length = self.used[start], end - start
        body = dynamics.with_moments(self.first - before * self.per_kg)
        if length == 0.0 or self.used[end] == before:
            return body, None
        half, whole = self.used[0.5 * (start + end)] - before, self.used[end] - before
        rate, growth = (4.0 * half - whole) / length, 4.0 * (whole - 2.0 * half) / length**2
        return body, Falling(-rate * self.per_kg, -growth * self.per_kg)
