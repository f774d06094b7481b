"""Precession of H and the spin axis to a target axis: impulses, half cones, rhumb lines.

A transverse impulse is perpendicular to the spin axis S of a symmetric body, so that H·S = C|ω3| =
h never changes; between impulses S goes round H at |H|/A. Two jumps and half cones follow exactly
at any angle, for both spin directions. Trains of pulses triggered by the Sun pulse fire at one
phase of the spin against the Sun, so that H keeps its heading to the direction of the Sun: a rhumb
line on the sphere about the Sun.

Angles are in rad, impulses in N m s; arrays of any shape broadcast.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.physics import attitude


def rhumb_end(sun_angle: Any, heading: Any, length: Any) -> tuple[Any, Any, Any]:
    """End of a rhumb line from ``sun_angle`` γ at a ``heading`` from the direction away from the
    Sun, right-handed.

    Angle from the Sun, growth of the longitude about it, and the angle by which the meridian of the
    Sun has turned about the axis against a parallel-transported direction, ∫ cos γ dλ: γ2 = γ + s
    cos χ, Δλ = tan χ ln[tan(γ2/2)/tan(γ/2)] and ∫ cos γ dλ = tan χ ln[sin γ2 / sin γ], written
    without the division by cos χ. Not a number where it passes the Sun or the point opposite to it.
    """
    change = length * np.cos(heading)
    end = sun_angle + change
    aside = length * np.sin(heading)
    with np.errstate(invalid="ignore", divide="ignore"):
        end = np.where((end > 0.0) & (end < np.pi), end, np.nan)
        short = np.abs(change) < 1e-5
        safe = np.where(short, 1.0, change)
        middle = sun_angle + 0.5 * change
        per_longitude = np.where(
            short, 1.0 / np.sin(middle), np.log(np.tan(0.5 * end) / np.tan(0.5 * sun_angle)) / safe
        )
        per_turn = np.where(
            short, 1.0 / np.tan(middle), np.log(np.sin(end) / np.sin(sun_angle)) / safe
        )
    return end, aside * per_longitude, aside * per_turn


def rhumb_course(sun_angle: Any, goal_angle: Any, ahead: Any) -> tuple[Any, Any]:
    """Heading χ (as in `rhumb_end`) and length of the rhumb line to ``goal_angle``, ``ahead`` in
    longitude.

    tan χ = Δλ/Δψ with ψ = ln tan(γ/2); the length is Δγ/cos χ, and sin γ |Δλ| along a parallel.
    """
    rise = np.log(np.tan(0.5 * goal_angle)) - np.log(np.tan(0.5 * sun_angle))
    heading = np.arctan2(ahead, rise)
    parallel = np.abs(np.cos(heading)) < 1e-6
    along = (goal_angle - sun_angle) / np.where(parallel, 1.0, np.cos(heading))
    return heading, np.abs(np.where(parallel, np.sin(sun_angle) * ahead, along))


def turned_by(momentum: Any, torque: float, width: Any, spin: Any, spread: Any = None) -> Any:
    """Mean turn of H of size ``momentum``, rad, by a pulse of a ``torque`` (N m) fixed in the body
    that lasts ``width`` s, in which the body turns at ``spin`` rad/s; ``spread`` s replaces the
    width in the mean over the turn.
    """
    return (
        torque
        * width
        * np.sinc(0.5 * spin * (width if spread is None else spread) / np.pi)
        / momentum
    )


def phasor_sum(count: Any, step: Any) -> Any:
    """Σ e^{i k ``step``} over k = 0 … ``count`` - 1: e^{i(N-1)ψ/2} sin(Nψ/2)/sin(ψ/2); N where ψ is
    a whole turn.
    """
    half = 0.5 * step
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.sin(count * half) / np.sin(half)
    whole = np.abs(np.sin(half)) < 1e-9
    # Near a whole turn, ψ = 2πm, both sines vanish: their ratio is N (-1)^{m(N-1)}.
    sign = np.where(np.rint(half / np.pi) * (count - 1) % 2 == 0, 1.0, -1.0)
    return np.exp(1j * (count - 1) * half) * np.where(whole, sign * count, ratio)


Array = NDArray[np.float64]


class TwoJumps(NamedTuple):
    """Two jumps of H that bring it and the spin axis to the target, one row per start: n rows."""

    middle: Array  # H between them, (n, 3) N m s
    first: Array  # size, (n,) N m s
    second: Array
    wait: Array  # (n,) s from one to the other
    turn: Array  # (n,) s more for each further turn of the spin axis

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
    """Two jumps from H = ``momentum`` (3,), spin axes ``axes`` (n, 3), to the unit vector
    ``target`` (3,).

    Between the jumps H must have the same component h along S and along the target: it lies on the
    line where the planes H·S = h and H·T = h meet. The sum of both jumps is least where the
    straight way from one end to the other crosses that line when both planes are laid flat.
    ``aside`` (n,) moves H along the line from there, N m s; ``straight`` takes the foot of the line
    instead, on the great circle from S to T. With T along H this is Magnus 1970 (22) without drift.
    """
    along = np.cross(axes, target)
    size = np.linalg.norm(along, axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = np.where(size > 0.0, along / size, attitude.square_to(target))
        foot = (
            h * (axes + target) / (1.0 + axes @ target)[:, None]
        )  # of the line, nearest to hS and to hT
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
    """Time in s until ``axes`` (n, 3) pass ``target`` (3,), on the same cone about ``momentum`` (n,
    3); one period.
    """
    size = np.linalg.norm(momentum, axis=-1)
    unit = momentum / size[:, None]
    sine = np.sum(unit * np.cross(axes, target), axis=-1)
    cosine = axes @ target - np.sum(unit * axes, axis=-1) * (unit @ target)
    turn = 2.0 * math.pi * A / size
    return np.arctan2(sine, cosine) % (2.0 * math.pi) / (2.0 * math.pi) * turn, turn


def half_cone(
    h: float, axes: Array, target: Array, cones: int, more: Array | float = 0.0
) -> tuple[Array, Array]:
    """H (n, 3) in the first of ``cones`` half cones from ``axes`` (n, 3) to ``target`` (3,), and h
    tan δ, N m s.

    Half cones of half-angle δ = β/2n lie in a row on the great circle from S to T: n - 1 further
    jumps are 2h tan δ, the last h tan δ. H is ``more`` (n,) rad further ahead than δ.
    """
    angle = np.arctan2(np.linalg.norm(np.cross(axes, target), axis=-1), axes @ target)
    half = angle / (2 * cones)
    sideways = target - (axes @ target)[:, None] * axes
    size = np.linalg.norm(sideways, axis=-1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        sideways = np.where(size > 0.0, sideways / size, attitude.square_to(target))
    return h * (axes + np.tan(half + more)[:, None] * sideways), h * np.tan(half)


def half_cones_impulse(h: float, angle: float, cones: int) -> float:
    """Cost of n = ``cones`` half cones, N m s: 2n h tan(β/2n), with β = ``angle`` in rad below nπ;
    hβ as n grows.
    """
    return 2 * cones * h * math.tan(angle / (2 * cones))


def arc_efficiency(spin: float, on_time: float) -> float:
    """Share of a pulse's impulse that turns H, for a torque fixed in the body: sinc(ω3τ/2), sinc x
    = sin x / x.
    """
    half = 0.5 * spin * on_time
    return math.sin(half) / half if half != 0.0 else 1.0


def reach(torque: float, spin: float, longest: float) -> float:
    """Largest turn of H by one pulse of up to ``longest`` s, N m s: 2M/|ω3| in half a spin turn."""
    half = 0.5 * abs(spin)
    if half == 0.0:
        return torque * longest
    return torque / half * math.sin(min(half * longest, 0.5 * math.pi))


def on_times_to_turn(impulses: Array, torque: float, spin: float) -> Array:
    """On-times (n,) s of pulses that turn H like ``impulses`` (n,) N m s: (2/ω3) asin(ω3J/2M), NaN
    beyond 2M/ω3.
    """
    rate = 0.5 * abs(spin)
    if rate == 0.0:
        return impulses / torque
    with np.errstate(invalid="ignore"):
        return np.asarray(np.arcsin(rate * impulses / torque) / rate)


def course(momentum: Array, target: Array, sun: Array | None) -> tuple[Array, float]:
    """Unit vector (3,) perpendicular to H = ``momentum`` (3,) towards ``target`` (3,), and the
    length of the way, rad.

    Without ``sun`` (3,) along the great circle, with it along the rhumb line, which keeps its angle
    to the direction of the Sun (`rhumb_course`). Raises Infeasible where an axis points to the Sun
    or away from it.
    """
    here = momentum / float(np.linalg.norm(momentum))
    if sun is None:
        ahead = target - (target @ here) * here
        size = float(np.linalg.norm(ahead))
        angle = float(attitude.angle_between(here, target))
        return (ahead / size if size > 0.0 else ahead), angle
    gammas = [float(attitude.angle_between(axis, sun)) for axis in (here, target)]
    if min(*gammas, *(math.pi - gamma for gamma in gammas)) < 1e-6:
        raise Infeasible(
            "the spin axis points to the Sun or away from it, at t = 0 or on the target: "
            "it has no phase"
        )
    dark = np.cross(sun, here)  # along growing longitude
    away = np.cross(dark, here)
    longitude = math.atan2(
        float(target @ dark) / math.sin(gammas[0]),
        float(target @ np.cross(dark, sun)) / math.sin(gammas[0]),
    )
    heading, way = rhumb_course(gammas[0], gammas[1], longitude)
    direction = math.cos(heading) * away / np.linalg.norm(away) + math.sin(
        heading
    ) * dark / np.linalg.norm(dark)
    return np.asarray(direction), float(way)
