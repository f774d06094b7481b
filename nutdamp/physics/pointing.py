"""Turning the angular momentum H and the spin axis S of a symmetric body to a target axis by transverse impulses.

Such an impulse is square to S, so that H·S = C|ω3| = h never changes; between impulses S goes round H at |H|/A. All
that follows from these two sentences is exact at any angle, and the same for both spin directions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.physics import attitude, sun_train

Array = NDArray[np.float64]


class TwoJumps(NamedTuple):
    """Two jumps of H that leave it and the spin axis on the target, one row for each start: n rows.

    ``middle`` (n, 3) is H between them, N m s; ``first`` and ``second`` (n,) their sizes, N m s; ``wait`` (n,) s from
    one to the other, or ``turn`` (n,) s more for each further turn of the spin axis.
    """

    middle: Array
    first: Array
    second: Array
    wait: Array
    turn: Array

    @property
    def cost(self) -> Array:
        """Sum of both, (n,) N m s."""
        return self.first + self.second


def two_jumps(
    A: float,
    h: float,
    momentum: Array,
    axes: Array,
    target: Array,
    aside: Array | float = 0.0,
    straight: bool = False,
) -> TwoJumps:
    """The two jumps from H = ``momentum`` (3,), spin axes ``axes`` (n, 3), to the unit vector ``target`` (3,).

    Between the jumps H must have the same component h along S, which it keeps, and along the target, onto which it is
    to jump: it lies on the line where the planes H·S = h and H·T = h meet. The sum of both jumps is least
    where the straight way from one end to the other crosses that line when both planes are laid flat. ``aside``
    (n,) moves H along the line from there, N m s; ``straight`` takes the foot of the line instead, on the great circle
    from S to T. With T along H this is Magnus 1970 (22) without drift.
    """
    along = np.cross(axes, target)
    size = np.linalg.norm(along, axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(size > 0.0, along / size, square_to(target))
        foot = h * (axes + target) / (1.0 + axes @ target)[:, None]  # of the line, nearest to hS and to hT
        place = along @ momentum
        to_line = np.linalg.norm(momentum - foot - place[:, None] * along, axis=-1)
        from_line = np.linalg.norm(h * target - foot, axis=-1)
        both = to_line + from_line
        crossing = 0.0 if straight else np.where(both > 0.0, place * from_line / both, 0.0)
        middle = foot + (crossing + aside * np.ones(len(axes)))[:, None] * along
    return TwoJumps(
        middle,
        np.linalg.norm(middle - momentum, axis=-1),
        np.linalg.norm(h * target - middle, axis=-1),
        *coast(A, middle, axes, target),
    )


def coast(A: float, momentum: Array, axes: Array, target: Array) -> tuple[Array, Array]:
    """Time in s until the spin axes ``axes`` (n, 3) come past ``target`` (3,) about ``momentum`` (n, 3); and one turn.

    Both must lie on the same cone about H.
    """
    size = np.linalg.norm(momentum, axis=-1)
    unit = momentum / size[:, None]
    sine = np.sum(unit * np.cross(axes, target), axis=-1)
    cosine = axes @ target - np.sum(unit * axes, axis=-1) * (unit @ target)
    turn = 2.0 * math.pi * A / size
    return np.arctan2(sine, cosine) % (2.0 * math.pi) / (2.0 * math.pi) * turn, turn


def half_cone(h: float, axes: Array, target: Array, cones: int) -> tuple[Array, Array]:
    """H (n, 3) for the first of ``cones`` half cones from spin axes ``axes`` (n, 3) to ``target`` (3,), and the rest.

    Half cones of half-angle δ = β/2n lie in a row on the great circle from S to T. The rest (n,) N m s is what the
    jumps after the first cost: (2n - 1) h tan δ.
    """
    angle = np.arctan2(np.linalg.norm(np.cross(axes, target), axis=-1), axes @ target)
    half = angle / (2 * cones)
    sideways = target - (axes @ target)[:, None] * axes
    size = np.linalg.norm(sideways, axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        sideways = np.where(size > 0.0, sideways / size, square_to(target))
    return h * (axes + np.tan(half)[:, None] * sideways), (2 * cones - 1) * h * np.tan(half)


def half_cones_impulse(h: float, angle: float, cones: int) -> float:
    """What ``cones`` half cones cost from a pure spin, N m s: 2n h tan(β/2n), with β = ``angle`` in rad below nπ.

    Three times the angle of one cone costs less in three: as n grows it comes down to the floor hβ.
    """
    return 2 * cones * h * math.tan(angle / (2 * cones))


def arc_efficiency(spin: float, on_time: float) -> float:
    """Share of a pulse's impulse that turns H, for a torque fixed in the body: sinc(ω3τ/2), sinc x = sin x / x."""
    half = 0.5 * spin * on_time
    return math.sin(half) / half if half != 0.0 else 1.0


def reach(torque: float, spin: float, longest: float) -> float:
    """Most by which one pulse of up to ``longest`` s turns H, N m s: 2M/|ω3| in half a spin turn."""
    half = 0.5 * abs(spin)
    return torque / half * math.sin(min(half * longest, 0.5 * math.pi))


def on_times_to_turn(impulses: Array, torque: float, spin: float) -> Array:
    """On-times (n,) s of pulses that turn H like ``impulses`` (n,) N m s: (2/ω3) asin(ω3J/2M).

    Not a number beyond 2M/ω3, the most that a torque fixed in the body can turn H at a time.
    """
    rate = 0.5 * abs(spin)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.arcsin(rate * impulses / torque) / rate)


def square_to(vector: Array) -> Array:
    """Some unit vector square to ``vector`` (3,)."""
    other = np.eye(3)[int(np.argmin(np.abs(vector)))]
    square = np.cross(vector, other)
    return np.asarray(square / np.linalg.norm(square))


def course(momentum: Array, target: Array, sun: Array | None) -> tuple[Array, float]:
    """Unit vector (3,) square to H = ``momentum`` (3,) in which H is to go to ``target`` (3,), and the way, rad.

    Without ``sun`` (3,) along the great circle. With it along the rhumb line, which keeps its angle to the direction
    of the Sun (`sun_train.rhumb_course`). Raises Infeasible where an axis points to the Sun or away from it.
    """
    here = momentum / float(np.linalg.norm(momentum))
    if sun is None:
        ahead = target - (target @ here) * here
        size = float(np.linalg.norm(ahead))
        angle = float(attitude.angle_between(here, target))
        return (ahead / size if size > 0.0 else ahead), angle
    gammas = [float(attitude.angle_between(axis, sun)) for axis in (here, target)]
    if min(*gammas, *(math.pi - gamma for gamma in gammas)) < 1e-6:
        raise Infeasible("the spin axis points to the Sun or away from it, at t = 0 or on the target: it has no phase")
    dark = np.cross(sun, here)  # along growing longitude
    away = np.cross(dark, here)
    longitude = math.atan2(
        float(target @ dark) / math.sin(gammas[0]), float(target @ np.cross(dark, sun)) / math.sin(gammas[0])
    )
    heading, way = sun_train.rhumb_course(gammas[0], gammas[1], longitude)
    direction = math.cos(heading) * away / np.linalg.norm(away) + math.sin(heading) * dark / np.linalg.norm(dark)
    return np.asarray(direction), float(way)
