"""Vectors and quotients elementwise over cases: one number for all cases, or an array."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from nutdamp.physics.energy_sink import TINY
from nutdamp.physics.rigid_cases import cos_sin
from nutdamp.spacecraft import Vector

Cases = Any
"""One number for all cases, or an array (n,): real, or complex where a derivative is taken by a complex step."""

Triple = tuple[Cases, Cases, Cases]


def plus(first: Cases, second: Cases) -> Cases:
    """A sum that costs nothing where one side is exactly zero for all cases."""
    if nothing(first):
        return second
    return first if nothing(second) else first + second


def times(first: Cases, second: Cases) -> Cases:
    """A product that costs nothing where one side is exactly zero for all cases."""
    return 0.0 if nothing(first) or nothing(second) else first * second


def nothing(value: Cases) -> bool:
    """Whether it is exactly zero for all cases."""
    return isinstance(value, float) and value == 0.0


def cross(first: Sequence[Cases], second: Sequence[Cases]) -> Triple:
    """Vector product by components."""
    (a, b, c), (x, y, z) = first, second
    return (
        plus(times(b, z), times(-1.0, times(c, y))),
        plus(times(c, x), times(-1.0, times(a, z))),
        plus(times(a, y), times(-1.0, times(b, x))),
    )


def added(first: Sequence[Cases], second: Sequence[Cases]) -> Triple:
    """Sum of vectors."""
    return triple(map(plus, first, second))


def scaled(vector: Sequence[Cases], factor: Cases) -> Triple:
    """A vector times a factor."""
    return triple(times(part, factor) for part in vector)


def triple(parts: Iterable[Cases]) -> Triple:
    """Three components, one for all cases or an array each."""
    x, y, z = parts
    return x, y, z


def parts_of(vector: Vector) -> Triple:
    """The components of one vector (3,)."""
    return triple(vector.tolist())


def tilt_axes(force: Vector) -> tuple[Vector, Vector]:
    """The two unit axes across a force about which it is tilted: ``a`` square to axis 3 (or 1) too, ``b`` to both."""
    along = force / np.linalg.norm(force)
    reference = np.array([0.0, 0.0, 1.0]) if abs(along[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(along, reference)
    first /= np.linalg.norm(first)
    return first, np.cross(along, first)


def tilted(first: Cases, second: Cases) -> tuple[Cases, Cases]:
    """cos φ and sin φ / φ of the rotation vector with these two components."""
    angle = np.sqrt(first * first + second * second) + TINY
    cosine, sine = cos_sin(angle)
    return cosine, sine / angle


def rotated(vector: Sequence[Cases], tilt: tuple[Cases, Cases]) -> Triple:
    """``vector`` turned by the rotation vector (``tilt``, 0)."""
    if all(map(nothing, tilt)):
        return triple(vector)
    first, second = tilt
    cosine, ratio = tilted(first, second)
    # Rodrigues: v cos φ + (u × v) sin φ + u (u·v)(1 - cos φ), with u = tilt/φ and (1 - cos φ)/φ² = ratio²/(1 + cos φ)
    along = (first * vector[0] + second * vector[1]) * ratio * ratio / (1.0 + cosine)
    turned = added(scaled(vector, cosine), scaled(cross((first, second, 0.0), vector), ratio))
    return added(turned, (first * along, second * along, 0.0))


def turned(matrix: Vector, vector: Sequence[Cases]) -> Triple:
    """Matrix times vector, elementwise over cases."""
    rows = []
    for row in matrix.tolist():
        total: Cases = 0.0
        for entry, part in zip(row, vector, strict=True):
            total = plus(total, part if entry == 1.0 else times(entry, part))
        rows.append(total)
    return triple(rows)
