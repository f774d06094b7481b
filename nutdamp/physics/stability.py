"""Stability of spin about a principal axis, and the nutation seen in three frames.

"Kreisel-Bewegungen" is cited as K(n): its J_xy is A, its J_z is C, its L is H.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nutdamp.physics import cones, inertia

AxisClass = Literal["minimum", "maximum", "intermediate", "degenerate", "sphere"]


class Stability(NamedTuple):
    """Spin about axis 3: p² in 1/s², whether a small nutation stays small, and the growth time 1/p in s."""

    squared_exponent: float
    stable: bool
    growth_time: float


class NutationRates(NamedTuple):
    """Rate of a nutation in rad/s: in the body and in the despun frame with the sign of turn, inertially |H|/A."""

    body: float
    despun: float
    inertial: float


def axis_class(moments: ArrayLike) -> AxisClass:
    """Kind of axis 3 among the principal moments (I1, I2, I3).

    Equal moments are those of `inertia.settled`. I1 = I2 leaves axis 3 the minimum or the maximum;
    ``degenerate`` means I3 equal to one of the others alone, so that any axis of their plane would do.
    """
    first, second, third = inertia.settled(moments)
    if first == second == third:
        return "sphere"
    if min(abs(first - third), abs(second - third)) <= inertia.DEGENERATE * max(first, second, third):
        return "degenerate"
    if third < min(first, second):
        return "minimum"
    return "maximum" if third > max(first, second) else "intermediate"


def growth(moments: ArrayLike, spin: float) -> Stability:
    """What becomes of a small nutation about axis 3 of a rigid body: e^{pt}, p² = -(I3 - I1)(I3 - I2)ω3²/(I1 I2).

    "Kreiseltheorie" 24.4, which prints p² <= 0 for bounded. With p = 0 about an axis of two equal moments ω grows
    linearly (I2 = I3: ω1 stays, dω2/dt = (I3 - I1)/I2 ω3 ω1), with no time of growth of its own: unstable. On a
    sphere, and without spin, nothing couples the two rates: they stay, which is bounded too. Equal moments are those
    of `axis_class`. Spin about the axis of least moment is stable only as long as nothing dissipates energy.
    """
    first, second, third = (float(moment) for moment in np.asarray(moments, dtype=float))
    kind = axis_class(moments)
    if spin == 0.0 or kind == "sphere":
        return Stability(0.0, True, math.inf)
    if kind == "degenerate":
        return Stability(0.0, False, math.inf)
    square = -((third - first) / first) * ((third - second) / second) * spin**2
    return Stability(square, square < 0.0, 1.0 / math.sqrt(square) if square > 0.0 else math.inf)


def principal_tilt(axes: ArrayLike) -> float:
    """Angle in rad, 0 to π/2, between principal axis 3 and the third axis of the file: the wobble of a pure spin.

    ``axes`` (3, 3) has the principal axes as columns, as `inertia.principal_axes` returns them.
    """
    x, y, z = (float(component) for component in np.asarray(axes, dtype=float)[:, 2])
    return math.atan2(math.hypot(x, y), abs(z))


def nutation_rates(A: float, C: float, omega: float, spin: float) -> NutationRates:
    """The nutation of a symmetric body seen in the body, in the despun frame and inertially.

    ω turns at K(7), (J_z - J_xy)/J_xy ω_z = -aω3, in the body and at K(10), Cω3/A, in the frame that follows the
    body's transverse motion without spinning: body = despun - ω3. Inertially the axis goes round H at K(13), |H|/A,
    always positive; its K(12) is a small-angle form. ``omega`` is |ω|, ``spin`` ω3 in rad/s.
    """
    return NutationRates((C - A) / A * spin, C / A * spin, cones.inertial_rate(A, C, omega, spin))
