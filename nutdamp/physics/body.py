"""Moments of inertia, spin stability, nutation angle and periods, half pulses of rigid bodies.

``omega`` is the transverse rate |ω| = |ω1 + iω2| >= 0 and ``spin`` is ω3, signed, both in rad/s.
The sources print (12), (18)-(20), (22) for positive signs; here |ω3| and |a| make them hold for
both spin directions. Angles come from components by arctan2: arccos loses everything below 1e-8
rad.

A part of constant momentum h along axis 3, the ``wheel`` in N m s, puts H3 = Cω3 + h in the place
of Cω3; where it is not a parameter, ``spin`` may be H3/C. Then the spin axis is σ·e3 with σ the
sign of H3.

"Kreisel-Bewegungen" is cited as K(n): its J_xy is A, its J_z is C, its L is H.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Rate = TypeVar("Rate", float, Array)


class ConeAngles(NamedTuple):
    """Cone angles at one instant, rad: ``nutation`` θ and ``body`` cone μ."""

    nutation: float
    body: float

    @property
    def space(self) -> float:
        """Space cone λ = θ - μ, signed: negative for oblate bodies."""
        return self.nutation - self.body


def momentary(moments: ArrayLike, rates: ArrayLike, sense: float, wheel: float = 0.0) -> ConeAngles:
    """Instantaneous cones of any body: angles of H and of ω from the spin axis ``sense``·e3, up to
    π.

    ``moments`` (I1, I2, I3) in kg m², ``rates`` (3,) in rad/s.
    """
    w = np.asarray(rates, dtype=float)
    first, second, third = (np.asarray(moments, dtype=float) * w + (0.0, 0.0, wheel)).tolist()
    across = math.hypot(w[0], w[1])
    along = sense * float(w[2])
    return ConeAngles(
        math.atan2(math.hypot(first, second), sense * third), math.atan2(across, along)
    )


def nutation_angle(A: float, C: float, omega: Rate, spin: Rate) -> Rate:
    """Nutation angle θ = λ + μ in rad of the spin axis from H, 0 to π/2, Magnus 1970 (19): tan θ =
    A|ω| / (C|ω3|).
    """
    angle: Rate = np.arctan2(A * omega, C * np.abs(spin))
    return angle


def body_cone(omega: Rate, spin: Rate) -> Rate:
    """Half-angle μ of the body cone ("Polkegel") in rad, Magnus 1970 (18): tan μ = |ω| / |ω3|."""
    angle: Rate = np.arctan2(omega, np.abs(spin))
    return angle


def space_cone(A: float, C: float, omega: Rate, spin: Rate) -> Rate:
    """Half-angle λ of the space cone ("Spurkegel") in rad, signed: negative for oblate bodies.

    Magnus 1970 (20), whose print has a minus in the denominator and ω1² for |ω|²: with tan(λ + μ) =
    A|ω|/(C|ω3|) and tan μ = |ω|/|ω3| the difference of angles gives tan λ = (A - C)|ω||ω3| / (C ω3²
    + A|ω|²).
    """
    angle: Rate = np.arctan2(
        (A - C) * omega * np.abs(spin), C * np.square(spin) + A * np.square(omega)
    )
    return angle


def transverse_rate(A: float, C: float, nutation: float, spin: float) -> float:
    """Transverse rate |ω| in rad/s of a nutation angle in [0, π/2); inverse of `nutation_angle`."""
    return C * abs(spin) * math.tan(nutation) / A


def body_period(A: float, C: float, spin: float, wheel: float = 0.0) -> float:
    """Nutation period T_ω seen in the body, s, Magnus 1970 (12): 2π A / |(A - C) ω3 - h|; infinite
    for a sphere.
    """
    rate = abs((A - C) * spin - wheel)
    return 2 * math.pi * A / rate if rate > 0 else math.inf


def body_rate(A: float, C: float, spin: float, wheel: float = 0.0) -> float:
    """Rate ν = ω3 - H3/A in rad/s, signed, at which ω turns in the body; zero where a wheel leaves
    but rounding.
    """
    rate = (A - C) / A * spin - wheel / A
    return 0.0 if abs(rate) <= 1e-14 * abs(wheel / A) else rate


def inertial_rate(A: float, C: float, omega: float, spin: float) -> float:
    """Rate ω_n = |H|/A of the nutation seen inertially, rad/s: sqrt(|ω|² + (C/A)² ω3²), Magnus 1970
    before (22).
    """
    return math.hypot(omega, C / A * spin)


def inertial_period(A: float, C: float, omega: float, spin: float) -> float:
    """Nutation period seen inertially, 2π/ω_n, s."""
    return 2 * math.pi / inertial_rate(A, C, omega, spin)


class HalfPulses(NamedTuple):
    """Two impulses (N m s), each against ω at its moment, and the wait between them (s)."""

    first: float
    second: float
    wait: float


def half_pulses(A: float, C: float, omega: float, spin: float) -> HalfPulses:
    """Two pulses that leave no nutation and H where it was, exact at every angle.

    J1 = C|ω3|(tan θ - tan(θ/2)) halves the nutation angle; after half an inertial turn at that
    angle, Δt = π A cos(θ/2)/(C|ω3|), the spin axis is where H was, and J2 = C|ω3| tan(θ/2) brings H
    back there. J1 + J2 = A|ω|: no more than one pulse, Magnus 1970 (21). ``omega`` is |ω|, ``spin``
    ω3, rad/s.
    """
    theta = nutation_angle(A, C, omega, spin)
    axial = C * abs(spin)
    second = axial * math.tan(0.5 * theta)
    return HalfPulses(A * omega - second, second, math.pi * A * math.cos(0.5 * theta) / axial)


def half_pulses_as_printed(A: float, C: float, omega: float, spin: float) -> HalfPulses:
    """Two equal halves of Magnus 1970 (21), (22), with Δt, half an inertial period, from the motion
    before the first.

    A small-angle scheme: it leaves H displaced by 0.0016° at θ = 2°, 0.19° at 10°, 5.1° at 30°,
    whatever A/C.
    """
    half = 0.5 * A * omega
    return HalfPulses(half, half, math.pi / inertial_rate(A, C, omega, spin))


def turn_between_halves(A: float, C: float, omega: float, spin: float, wheel: float = 0.0) -> float:
    """Angle in rad by which ω turns in the body between the `half_pulses`: π(H3 - Aω3)/|H3|
    cos(θ/2), ``spin`` = ω3.
    """
    axial = C * spin + wheel
    theta = nutation_angle(A, C, omega, axial / C)
    return math.copysign(math.pi, axial) * (1.0 - A * spin / axial) * math.cos(0.5 * theta)


def phase_to_oppose(omega: complex, torque: complex) -> float:
    """Remaining turn of ω, rad in (-π, π], at a ω3 > 0, until it points against ``torque``.

    For ±1, ±2 this is the table of Magnus 1970 before fig. 5 when a ω3 > 0, and its mirror image
    when a ω3 < 0, where the printed table would pump the nutation up.
    """
    return cmath.phase(-omega * torque.conjugate())


def ratio(A: float, C: float) -> float:
    """Inertia ratio a = (A - C)/A, Magnus 1970 (4); -1 (flat disc) <= a < 1 (needle)."""
    return (A - C) / A


def shape(A: float, C: float) -> str:
    """``prolate`` (A > C, "gestreckt"), ``oblate`` (A < C, "abgeplattet") or ``sphere`` (A = C)."""
    if A == C:
        return "sphere"
    return "prolate" if A > C else "oblate"
