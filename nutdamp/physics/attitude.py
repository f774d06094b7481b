"""Attitude quaternions: convention, products, rotations.

A quaternion (w, x, y, z) is a unit quaternion, scalar first, that leads from body axes to the
inertial frame: v_inertial = rotate(q, v_body). ``multiply(p, q)`` turns by q first, then by p.
Arrays may carry leading axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import numerics
from nutdamp.errors import BadRequest

Array = NDArray[np.float64]

_BACK = np.array([1.0, -1.0, -1.0, -1.0])

PRECESSED = ("ECLIPJ2000", "ECLIPDATE", "MOD")
"""Frames that no message and no other program is written in; the last two are of date."""

ARCSECOND = math.radians(1.0 / 3600.0)

PRECESSION = (
    (0.0000000260, -0.000002788, -0.00031238, 0.4932044, 10.556403, 0.0),
    (-0.0000000176, -0.000000440, 0.00053289, 0.0511269, -46.811015, 84381.406),
    (-0.0000000148, -0.000026452, -0.00018522, 1.5584176, 5038.481507, 0.0),
    (-0.0000000434, -0.000000576, 0.00200340, -0.0001831, -46.836769, 84381.406),
)
"""Angles γ, φ and ψ of Fukushima and Williams and the obliquity of date, arcseconds, by powers of
the centuries since J2000.0 from the highest down: precession IAU 2006, N. Capitaine, P. T. Wallace
and J. Chapront 2003, A&A 412, 567, as in ``iauP06e`` of SOFA.
"""

BIAS = (-0.0146, -0.016617, -0.0068192)
"""dα0, ξ0 and η0 of GCRF, arcseconds: IERS Conventions 2003, chapter 5."""


def multiply(left: Array, right: Array) -> Array:
    """Product of two quaternions, (..., 4) each: the turn ``right``, then the turn ``left``."""
    return np.stack(
        product(np.moveaxis(np.asarray(left), -1, 0), np.moveaxis(np.asarray(right), -1, 0)),
        axis=-1,
    )


def product(left: Iterable[Any], right: Iterable[Any]) -> tuple[Any, Any, Any, Any]:
    """`multiply` by components, each a number or an array."""
    p, a, b, c = left
    w, x, y, z = right
    return (
        p * w - a * x - b * y - c * z,
        p * x + a * w + b * z - c * y,
        p * y - a * z + b * w + c * x,
        p * z + a * y - b * x + c * w,
    )


POLE = 1e-9  # rad from a pole of the frame, up to which an axis has no ascending node


def rotate(quaternion: Array, vector: Array) -> Array:
    """Inertial components of a body vector, (..., 4) and (..., 3) -> (..., 3)."""
    # Written out: np.cross takes several times as long for a few vectors.
    w, x, y, z = (quaternion[..., index] for index in range(4))
    v1, v2, v3 = (vector[..., index] for index in range(3))
    t1, t2, t3 = 2.0 * (y * v3 - z * v2), 2.0 * (z * v1 - x * v3), 2.0 * (x * v2 - y * v1)
    return np.stack(
        [
            v1 + w * t1 + y * t3 - z * t2,
            v2 + w * t2 + z * t1 - x * t3,
            v3 + w * t3 + x * t2 - y * t1,
        ],
        axis=-1,
    )


def conjugate(quaternion: Array) -> Array:
    """Inverse rotation, (..., 4)."""
    return np.asarray(quaternion * _BACK)


def matrix(quaternion: Array) -> Array:
    """Rotation matrix body -> inertial, (4,) -> (3, 3); its columns are the body axes in the
    inertial frame.
    """
    return rotate(quaternion, np.eye(3)).T


def from_matrix(rotation: Array) -> Array:
    """Unit quaternion of a rotation matrix, (3, 3) -> (4,), scalar part not negative."""
    diagonal = np.diagonal(rotation)
    squares = 0.25 * np.array([1 + diagonal.sum(), *(1 - diagonal.sum() + 2 * diagonal)])
    largest = int(
        np.argmax(squares)
    )  # the largest component is taken first, so that none is lost to cancellation
    off = 0.25 * (rotation - rotation.T)
    mixed = 0.25 * (rotation + rotation.T)
    w_times = np.array([off[2, 1], off[0, 2], off[1, 0]])
    if largest == 0:
        products = np.array([squares[0], *w_times])
    else:
        axis = largest - 1
        products = np.array([w_times[axis], *mixed[axis]])
        products[largest] = squares[largest]
    quaternion = products / math.sqrt(squares[largest])
    quaternion /= np.linalg.norm(quaternion)
    return np.asarray(-quaternion if quaternion[0] < 0 else quaternion, dtype=np.float64)


def angle_between(first: Array, second: Array) -> Array:
    """Angle in rad between vectors (..., 3), exact to rounding from 0 to π."""
    cross = np.linalg.norm(np.cross(first, second), axis=-1)
    return np.asarray(np.arctan2(cross, np.sum(first * second, axis=-1)), dtype=np.float64)


def angle_of_parts(first: Iterable[Any], second: Iterable[Any]) -> Any:
    """`angle_between` by components, each a number or an array."""
    (a, b, c), (x, y, z) = first, second
    i, j, k = b * z - c * y, c * x - a * z, a * y - b * x
    return np.arctan2(np.sqrt(i * i + j * j + k * k), a * x + b * y + c * z)


def angular_momentum(A: float, C: float, omega: complex, spin: float, wheel: float = 0.0) -> Array:
    """H = (A ω1, A ω2, C ω3 + h) in body axes, (3,) N m s; ``wheel`` is h."""
    return np.array([A * omega.real, A * omega.imag, C * spin + wheel])


def frame_n(A: float, C: float, omega: complex, spin: float) -> Array:
    """Quaternion body -> N, the inertial frame of a file that gives none.

    N has z along H, and the spin axis σ·e3 (σ the sign of the spin) in the half plane x >= 0 of
    x-z; without nutation x lies along body axis 1. Written so that nothing cancels at small angles.
    """
    sense = math.copysign(1.0, spin)
    transverse, axial = A * abs(omega), C * abs(spin)
    total = math.hypot(transverse, axial)
    sine, cosine = transverse / total, axial / total
    unit = omega / abs(omega) if omega != 0 else -1.0 + 0.0j
    x = np.array([-cosine * unit.real, -cosine * unit.imag, sense * sine])
    z = np.array([sine * unit.real, sine * unit.imag, sense * cosine])
    return from_matrix(np.array([x, np.cross(z, x), z]))


def about_axis(body_axis: Array, body_side: Array, axis: Array, side: Array, phase: float) -> Array:
    """Quaternion (4,) body -> inertial that lays a ``body_axis`` (3,) along an inertial ``axis``
    (3,), unit vectors.

    ``phase`` rad about it leads from an inertial ``side`` (3,) to a ``body_side`` (3,), both seen
    along the axis.
    """
    frames = []
    for along, towards in ((body_axis, body_side), (axis, side)):
        across = np.cross(along, towards)
        across /= np.linalg.norm(across)
        frames.append(np.column_stack([np.cross(across, along), across, along]))
    cosine = math.cos(phase)
    sine = math.sin(phase)
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return from_matrix(frames[1] @ turn @ frames[0].T)


def phase_about(towards: Array, axis: Array, side: Array) -> float:
    """Angle, rad, about an inertial ``axis`` (3,) from a ``side`` to a direction (3,), both seen
    along it: the phase of `about_axis`.
    """
    sine = np.dot(axis, np.cross(side, towards))
    cosine = np.dot(side, towards) - np.dot(side, axis) * np.dot(towards, axis)
    return math.atan2(sine, cosine)


def ascending_node(axis: Array) -> Array:
    """Direction (3,) of the ascending node of an inertial unit ``axis`` (3,): z × axis; x at a
    pole.
    """
    node = np.array([-axis[1], axis[0], 0.0])
    return node if np.linalg.norm(node) > POLE else np.array([1.0, 0.0, 0.0])


def full_turn(angle: float) -> float:
    """Angle reduced to [0, 2π)."""
    turned = angle % (2.0 * math.pi)
    return (
        turned if turned < 2.0 * math.pi else 0.0
    )  # of a tiny negative angle the remainder rounds up to 2π


def sphere_angles(vector: Array) -> tuple[float | None, float]:
    """Right ascension in [0, 2π), None at the poles, and declination of ``vector`` (3,), rad."""
    x, y, z = numerics.cleaned(vector).tolist()
    across = math.hypot(x, y)
    declination = math.atan2(z, across)
    polar = abs(math.atan2(across, abs(z))) < numerics.SAME_ANGLE
    return None if polar else full_turn(math.atan2(y, x)), declination


def on_sphere(right_ascension: float, declination: float) -> Array:
    """Unit vector (3,) towards ``right_ascension`` and ``declination``, rad."""
    across = math.cos(declination)
    return np.array(
        [
            across * math.cos(right_ascension),
            across * math.sin(right_ascension),
            math.sin(declination),
        ]
    )


def unit(vector: Array) -> Array:
    """The vector (3,) at length 1."""
    return np.asarray(vector / np.linalg.norm(vector))


def square_to(vector: Array) -> Array:
    """Some unit vector perpendicular to ``vector`` (3,)."""
    other = np.eye(3)[int(np.argmin(np.abs(vector)))]
    square = np.cross(vector, other)
    return np.asarray(square / np.linalg.norm(square))


def frame_axes(frame: str | None, days: float = 0.0) -> Array:
    """(3, 3), whose columns are the axes of a ``frame`` in EME2000; None is EME2000, as is J2000.

    ``days``: the date of frames of date, since J2000.0 (TT). Raises BadRequest for an unknown one.
    """
    if frame in (None, "EME2000", "J2000"):
        return np.eye(3)
    if frame == "GCRF":
        ascension, xi, eta = (ARCSECOND * part for part in BIAS)
        return _about(0, -eta) @ _about(1, xi) @ _about(2, ascension)
    if frame not in PRECESSED:
        raise BadRequest(f"{frame!r} is no frame whose axes are known here")
    centuries = 0.0 if frame == "ECLIPJ2000" else days / 36525.0
    angles = [ARCSECOND * float(np.polyval(row, centuries)) for row in PRECESSION]
    gamma, phi, psi, obliquity = angles
    from_equator = _about(2, -psi) @ _about(0, phi) @ _about(2, gamma)
    if frame == "MOD":
        from_equator = _about(0, -obliquity) @ from_equator
    return np.asarray(from_equator.T)


def _about(axis: int, angle: float) -> Array:
    """(3, 3): components in axes turned by ``angle`` rad about one of them, from those before."""
    half = np.zeros(4)
    half[0], half[axis + 1] = math.cos(0.5 * angle), math.sin(0.5 * angle)
    return matrix(half).T
