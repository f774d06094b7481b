"""Principal moments and axes, stability of a spin about one of them, and rates of its nutation.

"Kreisel-Bewegungen" is cited as K(n): its J_xy is A, its J_z is C, its L is H.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nutdamp.physics import body

Array = NDArray[np.float64]


def mounting_angle(A: float, C: float, omega: float, spin: float, wheel: float = 0.0) -> float:
    """Angle in rad, [0, π), from the first to the second torque axis of two fixed actuators for
    `half_pulses`.

    Each must be able to push both ways; at small angles it is -σπA/C mod π (Magnus 1970 after
    (22)).
    """
    return body.turn_between_halves(A, C, omega, spin, wheel) % math.pi


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
    inertial = body.inertial_rate(A, C, omega, spin + wheel / C)
    return NutationRates((C - A) / A * spin + wheel / A, axial, inertial)
