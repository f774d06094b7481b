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

Array = NDArray[np.float64]

_BACK = np.array([1.0, -1.0, -1.0, -1.0])


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


def rotate(quaternion: Array, vector: Array) -> Array:
    """Inertial components of a body vector, (..., 4) and (..., 3) -> (..., 3)."""
    parts = (quaternion[..., index] for index in range(4))
    return np.stack(turned(parts, (vector[..., index] for index in range(3))), axis=-1)


def turned(quaternion: Iterable[Any], vector: Iterable[Any]) -> tuple[Any, Any, Any]:
    """`rotate` by components, each a number or an array."""
    # Written out: np.cross takes several times as long for a few vectors.
    w, x, y, z = quaternion
    v1, v2, v3 = vector
    t1, t2, t3 = 2.0 * (y * v3 - z * v2), 2.0 * (z * v1 - x * v3), 2.0 * (x * v2 - y * v1)
    return (
        v1 + w * t1 + y * t3 - z * t2,
        v2 + w * t2 + z * t1 - x * t3,
        v3 + w * t3 + x * t2 - y * t1,
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
    parts = (np.moveaxis(np.asarray(vector), -1, 0) for vector in (first, second))
    return np.asarray(angle_of_parts(*parts), dtype=np.float64)


def angle_of_parts(first: Iterable[Any], second: Iterable[Any]) -> Any:
    """`angle_between` by components, each a number or an array."""
    (a, b, c), (x, y, z) = first, second
    i, j, k = b * z - c * y, c * x - a * z, a * y - b * x
    return np.arctan2(np.sqrt(i * i + j * j + k * k), a * x + b * y + c * z)


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


def unit(vector: Array) -> Array:
    """The vector (3,) at length 1."""
    return np.asarray(vector / np.linalg.norm(vector))


def square_to(vector: Array) -> Array:
    """Some unit vector perpendicular to ``vector`` (3,)."""
    other = np.eye(3)[int(np.argmin(np.abs(vector)))]
    square = np.cross(vector, other)
    return np.asarray(square / np.linalg.norm(square))


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
