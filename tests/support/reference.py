"""An integrator for the tests that shares no formula and no line with nutdamp.

Momentum in space, which only torques change, and the rotation matrix R (body -> inertial),

    dH/dt = R M,      dR/dt = R [I⁻¹ RᵀH]×,

from one edge of a pulse to the next by DOP853. Torques and impulses are fixed in the body. Angles
are compared by the chord between unit vectors, which is exact at both ends of the scale.

With energy dissipation the attitude turns besides by s, axis 3 away from H at κ sin θ cos θ; with a
wheel at κ sin θ D(θ)/D(0), D dE/dθ over |H| sin θ. No torque of dissipation stands in these
equations.

A ``wheel`` adds its constant momentum h e3 to I ω, wherever H stands.
"""

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]

RTOL = 1e-13
"""Relative tolerance of one step; over a flight of some hundred radians below 1e-11."""


class Push(NamedTuple):
    """A constant body torque (3,) N m from ``start`` to ``end`` s."""

    start: float
    end: float
    torque: Array


class Swell(NamedTuple):
    """A body torque that runs evenly from ``first`` (3,) N m at ``start`` s to ``last`` at ``end``
    s.
    """

    start: float
    end: float
    first: Array
    last: Array

    def at(self, t: float) -> Array:
        """The torque at ``t`` s."""
        return self.first + (self.last - self.first) * ((t - self.start) / (self.end - self.start))


class Kick(NamedTuple):
    """An ideal impulse (3,) N m s at ``t`` s."""

    t: float
    impulse: Array


class Motion(NamedTuple):
    """The motion at one moment: rates (3,) rad/s in the body, rotation (3, 3) body -> inertial."""

    rates: Array
    rotation: Array


def vector(*components: float) -> Array:
    """Shorthand for an array of floats."""
    return np.array(components, dtype=float)


def frame_n(moments: Sequence[float], rates: Array, wheel: float = 0.0) -> Array:
    """Rotation body -> N: z along H; the spin axis, or body axis 1, above x >= 0 of x-z."""
    h = np.asarray(moments) * rates + vector(0, 0, wheel)
    z = h / np.linalg.norm(h)
    spin_axis = vector(0, 0, math.copysign(1, h[2]))
    y = np.cross(z, spin_axis)
    if not y.any():
        y = np.cross(z, vector(1, 0, 0))
    y /= np.linalg.norm(y)
    return np.array([np.cross(y, z), y, z])


def momentum(moments: Sequence[float], motion: Motion, wheel: float = 0.0) -> Array:
    """H in the inertial frame, (3,) N m s."""
    return np.asarray(motion.rotation @ (np.asarray(moments) * motion.rates + vector(0, 0, wheel)))


def energy(moments: Sequence[float], rates: Array) -> float:
    """Kinetic energy of the rotation, J."""
    return 0.5 * float(np.asarray(moments) @ rates**2)


def angle(u: Array, v: Array) -> float:
    """Angle between two vectors, rad, by the chord from one to the other and the sum of both."""
    u, v = u / np.linalg.norm(u), v / np.linalg.norm(v)
    return 2 * math.atan2(float(np.linalg.norm(u - v)), float(np.linalg.norm(u + v)))


def nutation(moments: Sequence[float], rates: Array, sense: float, wheel: float = 0.0) -> float:
    """Angle between H and the spin axis ``sense``·e3, rad."""
    return angle(np.asarray(moments) * rates + vector(0, 0, wheel), vector(0, 0, sense))


def turned(first: Array, second: Array) -> float:
    """Angle of the rotation that leads from one attitude to another, rad; for small ones."""
    between = first.T @ second
    return 0.5 * float(
        np.linalg.norm(
            [
                between[2, 1] - between[1, 2],
                between[0, 2] - between[2, 0],
                between[1, 0] - between[0, 1],
            ]
        )
    )


def through_valve(
    start: float,
    on_time: float,
    torque: Array,
    *,
    opening: float,
    closing: float,
    rise: float,
    fall: float,
) -> list[Swell]:
    """What a command gives through a valve: the level rises at 1/rise while it is open and falls at
    1/fall once not.

    By the level at each moment, up to one; no formula for impulse or centroid stands here.
    """
    opened, closed = start + opening, start + on_time + closing
    if closed <= opened:
        return []
    peak = 1.0 if rise == 0.0 else min(1.0, (closed - opened) / rise)
    corners = [
        (opened, 0.0),
        (opened + peak * rise, peak),
        (closed, peak),
        (closed + peak * fall, 0.0),
    ]
    return [
        Swell(begin, end, low * torque, high * torque)
        for (begin, low), (end, high) in itertools.pairwise(corners)
        if end > begin
    ]


def rotation_rates(rotation: Sequence[float], p: float, q: float, r: float) -> list[float]:
    """R [ω]× row by row, (9,) 1/s."""
    a, b, c, d, e, f, g, h, i = rotation
    return [
        b * r - c * q, c * p - a * r, a * q - b * p,
        e * r - f * q, f * p - d * r, d * q - e * p,
        h * r - i * q, i * p - g * r, g * q - h * p,
    ]  # fmt: skip


def coast(
    moments: Sequence[float],
    motion: Motion,
    torque: Array,
    times: Array,
    growing: Array | None = None,
    wheel: float = 0.0,
    growth: float = 0.0,
) -> list[Motion]:
    """The motion at ``times`` (n,) s > 0 under a body torque, ``growing`` by (3,) N m/s.

    A small nutation grows at the rate ``growth`` κ, 1/s.
    """
    A, B, C = (float(one) for one in moments)
    x, y, z = (float(one) for one in torque)
    gx, gy, gz = (0.0, 0.0, 0.0) if growing is None else (float(one) for one in growing)
    sense = math.copysign(1.0, C * float(motion.rates[2]) + wheel)

    def pace(size: float, cosine: float) -> float:
        """dE/dθ / (|H| sin θ) of E = H² sin²θ/(2A) + (H cos θ - h)²/(2C)."""
        return size * cosine * 2.0 / (A + B) - (size * cosine - wheel) / C

    def slope(t: float, state: Array) -> list[float]:
        # Component by component: quicker than small arrays.
        hx, hy, hz, a, b, c, d, e, f, g, h, i = state.tolist()
        # H in the body.
        u, v, w = a * hx + d * hy + g * hz, b * hx + e * hy + h * hz, c * hx + f * hy + i * hz
        sinks = 0.0
        if growth:  # s = κ (u·e3) (u × e3), u the direction of H in the body
            size = math.sqrt(hx * hx + hy * hy + hz * hz)
            cosine = sense * pace(size, w / size) / pace(size, sense) if wheel else w / size
            sinks = growth * cosine / size
        p, q, r = u / A + sinks * v, v / B - sinks * u, (w - wheel) / C
        mx, my, mz = x + gx * t, y + gy * t, z + gz * t
        pushes = [a * mx + b * my + c * mz, d * mx + e * my + f * mz, g * mx + h * my + i * mz]
        return [*pushes, *rotation_rates([a, b, c, d, e, f, g, h, i], p, q, r)]

    start = momentum(moments, motion, wheel)
    size = max(float(np.linalg.norm(start)), 1e-3 * C)
    solution = solve_ivp(
        slope,
        (0.0, float(times[-1])),
        np.concatenate([start, motion.rotation.ravel()]),
        method="DOP853",
        t_eval=times,
        rtol=RTOL,
        atol=0.01 * RTOL * np.array([size] * 3 + [1.0] * 9),
    )
    assert solution.success
    ends = [(state[:3], state[3:].reshape(3, 3)) for state in solution.y.T]
    inner = vector(0, 0, wheel)
    return [Motion((turn.T @ h - inner) / np.asarray(moments), turn) for h, turn in ends]


def path(
    moments: Sequence[float],
    start: Motion,
    events: Iterable[Push | Swell | Kick],
    times: Sequence[float] | Array,
    growth: float = 0.0,
    wheel: float = 0.0,
) -> list[Motion]:
    """The motion at ``times`` s >= 0, kicks included; restarts at every edge of a torque."""
    events = list(events)
    asked, places = np.unique(np.asarray(times, dtype=float), return_inverse=True)
    edges = {0.0, *asked[-1:].tolist()}
    for event in events:
        edges |= {event.t} if isinstance(event, Kick) else {event.start, event.end}
    motion, now, found = start, 0.0, list[Motion]()
    for edge in sorted(edge for edge in edges if edge <= asked[-1:].sum()):
        if edge > now:
            middle = 0.5 * (now + edge)
            pushing = [e.torque for e in events if isinstance(e, Push) and e.start < middle < e.end]
            torque = np.sum(pushing, axis=0) if pushing else np.zeros(3)
            swelling = [e for e in events if isinstance(e, Swell) and e.start < middle < e.end]
            growing = sum(((e.last - e.first) / (e.end - e.start) for e in swelling), np.zeros(3))
            torque = torque + sum((e.at(now) for e in swelling), np.zeros(3))
            spans = np.append(asked[(asked > now) & (asked < edge)], edge) - now
            *inside, motion = coast(moments, motion, torque, spans, growing, wheel, growth)
            found += inside
            now = edge
        for event in events:
            if isinstance(event, Kick) and event.t == edge:
                motion = Motion(motion.rates + event.impulse / np.asarray(moments), motion.rotation)
        found += [motion] * np.count_nonzero(asked == edge)
    return [found[place] for place in places]


def fly(
    moments: Sequence[float],
    rates: Array,
    events: Iterable[Push | Swell | Kick],
    until: float,
    rotation: Array | None = None,
    growth: float = 0.0,
    wheel: float = 0.0,
) -> Motion:
    """The motion at ``until`` s: `path` from the frame N, unless ``rotation`` says otherwise."""
    facing = frame_n(moments, rates, wheel) if rotation is None else rotation
    start = Motion(np.asarray(rates, dtype=float), facing)
    return path(moments, start, events, [until], growth, wheel)[0]
