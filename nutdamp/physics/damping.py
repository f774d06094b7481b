"""Closed forms of nutation damping: what to fire, when, and the least that any schedule needs."""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

from nutdamp.physics import cones


class HalfPulses(NamedTuple):
    """Two impulses (N m s), each against ω at its moment, and the wait between them (s)."""

    first: float
    second: float
    wait: float


def half_pulses(A: float, C: float, omega: float, spin: float) -> HalfPulses:
    """Two pulses that leave no nutation and H where it was, exact at every angle.

    J1 = C|ω3|(tan θ - tan(θ/2)) halves the nutation angle, so that H jumps onto the cone's half-angle; after half an
    inertial turn at that angle, Δt = π A cos(θ/2)/(C|ω3|), the spin axis is where H was, and
    J2 = C|ω3| tan(θ/2) brings H back there. J1 + J2 = A|ω|: no more than one pulse, Magnus 1970 (21).

    ``omega`` is |ω|, ``spin`` ω3 (rad/s).
    """
    theta = cones.nutation_angle(A, C, omega, spin)
    axial = C * abs(spin)
    second = axial * math.tan(0.5 * theta)
    return HalfPulses(A * omega - second, second, math.pi * A * math.cos(0.5 * theta) / axial)


def half_pulses_as_printed(A: float, C: float, omega: float, spin: float) -> HalfPulses:
    """The two equal halves of Magnus 1970 (21), (22), with Δt from the motion before the first pulse.

    A small-angle scheme: it leaves H displaced by 0.0016° at θ = 2°, 0.19° at 10°, 5.1° at 30°, whatever A/C.
    """
    half = 0.5 * A * omega
    return HalfPulses(half, half, cones.half_turn(A, C, omega, spin))


def turn_between_halves(A: float, C: float, omega: float, spin: float) -> float:
    """Angle in rad by which ω turns in the body between the two `half_pulses`: σπ(1 - A/C)cos(θ/2)."""
    theta = cones.nutation_angle(A, C, omega, spin)
    return math.copysign(math.pi, spin) * (1.0 - A / C) * math.cos(0.5 * theta)


def mounting_angle(A: float, C: float, omega: float, spin: float) -> float:
    """Angle in rad, [0, π), from the first to the second torque axis of two fixed actuators for `half_pulses`.

    Each must be able to push both ways; at small angles it is -σπA/C mod π (Magnus 1970 after (22)).
    """
    return turn_between_halves(A, C, omega, spin) % math.pi


def phase_to_oppose(omega: complex, torque: complex) -> float:
    """Angle in rad, (-π, π], by which ω has still to turn back, at a ω3 > 0, to point against ``torque``.

    The best moment for a body-fixed torque direction d is arg ω = arg d + π. For ±1, ±2 this is the table of
    Magnus 1970 before fig. 5 when a ω3 > 0, and its mirror image when a ω3 < 0, where the printed table would
    pump the nutation up.
    """
    return cmath.phase(-omega * torque.conjugate())
