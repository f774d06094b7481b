"""Motion without jumps between two moments: the coast of a symmetric body in closed form, or Taylor pieces."""

from __future__ import annotations

import cmath
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from nutdamp.physics import attitude, energy_sink
from nutdamp.physics.rigid import Piece
from nutdamp.spacecraft import SpinState, Vector


class Path(Protocol):
    """Motion without jumps."""

    @property
    def steps(self) -> int:
        """Steps of integration that it took."""
        ...

    def motion(self, times: Vector) -> tuple[Vector, Vector]:
        """Rates (n, 3) in rad/s and quaternions (n, 4) at ``times`` (n,) s."""
        ...


@dataclass(frozen=True, slots=True)
class Arc:
    """Coast of a symmetric body in closed form, from ``state`` at ``start`` s; ``growth`` 1/s: `energy_sink`'s κ."""

    A: float
    C: float
    start: float
    state: SpinState
    growth: float = 0.0

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
                self.A, self.C, self.growth, state.quaternion, state.omega, state.spin, since
            )
            return np.column_stack([omega.real, omega.imag, spin]), quaternion
        omega = state.omega * np.exp(-1j * (self.A - self.C) / self.A * state.spin * since)
        quaternion = attitude.arc(self.A, self.C, state.quaternion, state.omega, state.spin, since)
        return np.column_stack([omega.real, omega.imag, np.full(len(since), state.spin)]), quaternion

    def end(self, time: float) -> SpinState:
        """The motion at ``time`` s."""
        A, C, state, since = self.A, self.C, self.state, time - self.start
        if self.growth != 0.0:
            return SpinState(*energy_sink.arc_end(A, C, self.growth, state.quaternion, state.omega, state.spin, since))
        turned = cmath.exp(-1j * (A - C) / A * state.spin * since)
        quaternion = attitude.arc_end(A, C, state.quaternion, state.omega, state.spin, since)
        return SpinState(state.omega * turned, state.spin, quaternion)


@dataclass(frozen=True, slots=True)
class Integrated:
    """Motion under a constant torque, or of a body with three different moments, as Taylor pieces."""

    pieces: tuple[Piece, ...]

    @property
    def steps(self) -> int:
        """Steps of integration that it took."""
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
