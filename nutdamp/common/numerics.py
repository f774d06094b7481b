"""Numerics: Gauss-Legendre quadrature, rounding of bounds, and removal of rounding noise from shown numbers."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

RPM = 30.0 / math.pi
"""Turns a minute of one rad/s."""

MISSING = "–"
"""Text of a number that is not known."""

NOISE = 1e-13
"""Part of the largest component below which another component of a vector counts as rounding."""

SAME_ANGLE = 1e-11
"""rad; angles closer than this count as equal, and a direction this near a pole has no longitude."""


@functools.cache
def gauss_legendre(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Nodes and weights, (count,) each, of quadrature on [-1, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return nodes, weights


def cleaned(vectors: ArrayLike) -> NDArray[np.float64]:
    """Vectors (..., n) with 0 for components that are rounding beside the largest, and for -0."""
    values = np.asarray(vectors, dtype=float)
    largest = np.abs(values).max(axis=-1, keepdims=True, initial=0.0)
    return np.where(np.abs(values) < NOISE * largest, 0.0, values) + 0.0


def cleaned_change(change: float, whole: float) -> float:
    """Difference of two numbers of the size of ``whole``; 0 where it is rounding beside them."""
    return float(cleaned([change, whole])[0])


def finite(data: dict[str, Any]) -> dict[str, Any]:
    """Data with None for numbers that are not finite."""
    return {key: _finite(entry) for key, entry in data.items()}


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return finite(value)
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def down(value: float) -> float:
    """Value rounded down to four digits: a bound must not be rounded up."""
    if value <= 0.0 or not math.isfinite(value):
        return value
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return math.floor(value / step * (1.0 + 1e-12)) * step
