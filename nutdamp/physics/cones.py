"""Nutation angle, body cone, space cone, and the periods of the nutation.

``omega`` is the transverse rate |ω| = |ω1 + iω2| >= 0 in rad/s, ``spin`` for ω3 in rad/s, signed. The
sources print (12), (18)-(20), (22) for positive signs; here |ω3| and |a| make them hold for both spin directions.
Angles come from components by arctan2: arccos loses everything below 1e-8 rad.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Rate = TypeVar("Rate", float, Array)


class Cones(NamedTuple):
    """The cone angles of one instant, rad: ``nutation`` θ and ``body`` cone μ."""

    nutation: float
    body: float

    @property
    def space(self) -> float:
        """Space cone λ = θ - μ, signed: negative for oblate bodies."""
        return self.nutation - self.body


def momentary(moments: ArrayLike, rates: ArrayLike, sense: float) -> Cones:
    """The cones of any body now: angles of H and of ω from the spin axis ``sense``·e3, up to π.

    ``moments`` (I1, I2, I3) in kg m², ``rates`` (3,) in rad/s.
    """
    w = np.asarray(rates, dtype=float)
    first, second, third = (np.asarray(moments, dtype=float) * w).tolist()
    across, along = math.hypot(w[0], w[1]), sense * float(w[2])
    return Cones(math.atan2(math.hypot(first, second), sense * third), math.atan2(across, along))


def nutation_angle(A: float, C: float, omega: Rate, spin: Rate) -> Rate:
    """Nutation angle θ = λ + μ in rad between spin axis and angular momentum, Magnus 1970 (19).

    tan θ = A|ω| / (C|ω3|), from 0 (pure spin) to π/2 (no spin).
    """
    found: Rate = np.arctan2(A * omega, C * np.abs(spin))
    return found


def body_cone(omega: Rate, spin: Rate) -> Rate:
    """Half-angle μ of the body cone ("Polkegel") in rad, Magnus 1970 (18): tan μ = |ω| / |ω3|.

    The form of (18), for symmetric bodies; flights take their cones from `momentary`.
    """
    found: Rate = np.arctan2(omega, np.abs(spin))
    return found


def space_cone(A: float, C: float, omega: Rate, spin: Rate) -> Rate:
    """Half-angle λ of the space cone ("Spurkegel") in rad, signed: negative for oblate bodies; the form of (20).

    Magnus 1970 (20), whose print has a minus in the denominator and ω1² for |ω|²: with tan(λ + μ) = A|ω|/(C|ω3|) and
    tan μ = |ω|/|ω3| the difference of angles gives tan λ = (A - C)|ω||ω3| / (C ω3² + A|ω|²).
    """
    found: Rate = np.arctan2((A - C) * omega * np.abs(spin), C * np.square(spin) + A * np.square(omega))
    return found


def transverse_rate(A: float, C: float, nutation: float, spin: float) -> float:
    """|ω| in rad/s that belongs to a nutation angle in [0, π/2); the inverse of `nutation_angle`."""
    return C * abs(spin) * math.tan(nutation) / A


def body_period(A: float, C: float, spin: float) -> float:
    """Nutation period T_ω seen in the body, s, Magnus 1970 (12): 2π A / |(A - C) ω3|; infinite for a sphere."""
    rate = abs((A - C) * spin)
    return 2 * math.pi * A / rate if rate > 0 else math.inf


def inertial_rate(A: float, C: float, omega: float, spin: float) -> float:
    """Rate ω_n = |H|/A of the nutation seen inertially, rad/s: sqrt(|ω|² + (C/A)² ω3²), Magnus 1970 before (22)."""
    return math.hypot(omega, C / A * spin)


def inertial_period(A: float, C: float, omega: float, spin: float) -> float:
    """Nutation period seen inertially, 2π/ω_n, s."""
    return 2 * math.pi / inertial_rate(A, C, omega, spin)


def half_turn(A: float, C: float, omega: float, spin: float) -> float:
    """Half an inertial nutation period in s: the wait between two half pulses, Magnus 1970 (22)."""
    return math.pi / inertial_rate(A, C, omega, spin)
