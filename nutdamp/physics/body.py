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
from typing import Literal, NamedTuple, TypeVar

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


def mounting_angle(A: float, C: float, omega: float, spin: float, wheel: float = 0.0) -> float:
    """Angle in rad, [0, π), from the first to the second torque axis of two fixed actuators for
    `half_pulses`.

    Each must be able to push both ways; at small angles it is -σπA/C mod π (Magnus 1970 after
    (22)).
    """
    return turn_between_halves(A, C, omega, spin, wheel) % math.pi


def phase_to_oppose(omega: complex, torque: complex) -> float:
    """Remaining turn of ω, rad in (-π, π], at a ω3 > 0, until it points against ``torque``.

    For ±1, ±2 this is the table of Magnus 1970 before fig. 5 when a ω3 > 0, and its mirror image
    when a ω3 < 0, where the printed table would pump the nutation up.
    """
    return cmath.phase(-omega * torque.conjugate())


# relative difference up to which principal moments count as equal: a sphere, or a plane of free
# axes
DEGENERATE = 1e-9

Moments = tuple[float, float, float]


def settled(moments: ArrayLike) -> Moments:
    """Principal moments, those within `DEGENERATE` made exactly equal: I1 and I2 their mean, of a
    sphere all I3.
    """
    first, second, third = (float(moment) for moment in np.asarray(moments, dtype=float))
    rounding = DEGENERATE * max(first, second, third)
    if first != second and abs(first - second) <= rounding:
        first = second = 0.5 * (first + second)
    if max(abs(first - third), abs(second - third)) <= rounding:
        first = second = third
    return first, second, third


def ratio(A: float, C: float) -> float:
    """Inertia ratio a = (A - C)/A, Magnus 1970 (4); -1 (flat disc) <= a < 1 (needle)."""
    return (A - C) / A


def shape(A: float, C: float) -> str:
    """``prolate`` (A > C, "gestreckt"), ``oblate`` (A < C, "abgeplattet") or ``sphere`` (A = C)."""
    if A == C:
        return "sphere"
    return "prolate" if A > C else "oblate"


def principal_axes(tensor: Array) -> tuple[Moments, Array]:
    """Principal moments and axes of a symmetric 3×3 tensor (kg m²).

    Returns ((I1, I2, I3), axes): the columns of ``axes`` are the principal axes in the axes of the
    tensor, right handed. Axis 3 is the one nearest the third axis of the tensor, axis 1 the one
    nearest its first, also where moments coincide.
    """
    tensor = np.asarray(tensor, dtype=float)
    if np.count_nonzero(tensor - np.diag(np.diagonal(tensor))) == 0:
        first, second, third = (float(moment) for moment in np.diagonal(tensor))
        return (first, second, third), np.eye(3)
    values, vectors = np.linalg.eigh(tensor)
    e3 = _nearest(values, vectors, np.array([0.0, 0.0, 1.0]))
    # Axis 3 may lie anywhere in a plane of equal moments: axis 1 is sought in the plane square to
    # it.
    plane = np.linalg.svd(np.eye(3) - np.outer(e3, e3))[0][:, :2]
    values, turn = np.linalg.eigh(plane.T @ tensor @ plane)
    e1 = _nearest(values, plane @ turn, np.array([1.0, 0.0, 0.0]))
    e1 = e1 - e3 * (e3 @ e1)
    e1 /= np.linalg.norm(e1)
    axes = np.column_stack([e1, np.cross(e3, e1), e3])
    first, second, third = (float(axis @ tensor @ axis) for axis in axes.T)
    return (first, second, third), axes


def _nearest(moments: Array, vectors: Array, direction: Array) -> Array:
    """Unit vector nearest to ``direction`` among the eigenspaces; coinciding moments span one
    space.
    """
    best = vectors[:, 0]
    best_length = -1.0
    for moment in moments:
        space = vectors[:, np.abs(moments - moment) <= DEGENERATE * np.max(np.abs(moments))]
        projection = space @ (space.T @ direction)
        length = float(np.linalg.norm(projection))
        if length > best_length * (1 + 1e-12):
            best, best_length = projection, length
    if best_length == 0.0:
        return vectors[:, 0]
    return np.asarray(best / best_length, dtype=np.float64)


AxisClass = Literal["minimum", "maximum", "intermediate", "degenerate", "sphere"]


class Stability(NamedTuple):
    """Spin about axis 3: p² in 1/s², boundedness of a small nutation,
    and the growth time 1/p in s.
    """

    squared_exponent: float
    stable: bool
    growth_time: float


class NutationRates(NamedTuple):
    """Rate of a nutation in rad/s: in the body and in the despun frame with the sign of turn,
    inertially |H|/A.
    """

    body: float
    despun: float
    inertial: float


def axis_class(moments: ArrayLike) -> AxisClass:
    """Kind of axis 3 among the principal moments (I1, I2, I3), equal ones as of `settled`.

    ``degenerate`` means I3 equal to one of the others alone, so that any axis of their plane would
    do.
    """
    first, second, third = settled(moments)
    if first == second == third:
        return "sphere"
    if min(abs(first - third), abs(second - third)) <= DEGENERATE * max(first, second, third):
        return "degenerate"
    if third < min(first, second):
        return "minimum"
    return "maximum" if third > max(first, second) else "intermediate"


def growth(moments: ArrayLike, spin: float, wheel: float = 0.0) -> Stability:
    """Growth of a small nutation about axis 3 of a rigid body: e^{pt}, p² = -(I3 - I1)(I3 -
    I2)ω3²/(I1 I2).

    "Kreiseltheorie" 24.4, which prints p² <= 0 for bounded. With p = 0 about an axis of two equal
    moments ω grows linearly (I2 = I3: ω1 stays, dω2/dt = (I3 - I1)/I2 ω3 ω1), with no time of
    growth of its own: unstable. On a sphere, and without spin, nothing couples the two rates: they
    stay, which is bounded too. Equal moments are those of `axis_class`. Spin about the axis of
    least moment is stable only as long as nothing dissipates energy. With a wheel p² = -(H3 -
    I1ω3)(H3 - I2ω3)/(I1 I2).
    """
    first, second, third = (float(moment) for moment in np.asarray(moments, dtype=float))
    kind = axis_class(moments)
    if wheel != 0.0:
        axial = third * spin + wheel
        square = -((axial - first * spin) / first) * ((axial - second * spin) / second)
    elif spin == 0.0 or kind in ("sphere", "degenerate"):
        return Stability(0.0, spin == 0.0 or kind == "sphere", math.inf)
    else:
        square = -((third - first) / first) * ((third - second) / second) * spin**2
    return Stability(square, square < 0.0, 1.0 / math.sqrt(square) if square > 0.0 else math.inf)


def principal_tilt(axes: ArrayLike) -> float:
    """Angle in rad, 0 to π/2, of principal axis 3 from the third axis of the file, by the
    `principal_axes` (3, 3).
    """
    x, y, z = (float(component) for component in np.asarray(axes, dtype=float)[:, 2])
    return math.atan2(math.hypot(x, y), abs(z))


def nutation_rates(
    A: float, C: float, omega: float, spin: float, wheel: float = 0.0
) -> NutationRates:
    """Rates of the nutation of a symmetric body in the body, in the despun frame and inertially.

    ω turns at K(7), (J_z - J_xy)/J_xy ω_z = -aω3, in the body and at K(10), Cω3/A, in the frame
    that follows the body's transverse motion without spinning: body = despun - ω3. Inertially the
    axis goes round H at K(13), |H|/A, always positive; its K(12) is a small-angle form. ``omega``
    is |ω|, ``spin`` ω3 in rad/s.
    """
    axial = (C * spin + wheel) / A
    inertial = inertial_rate(A, C, omega, spin + wheel / C)
    return NutationRates((C - A) / A * spin + wheel / A, axial, inertial)
