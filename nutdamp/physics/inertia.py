"""Moments of inertia: the ratio a, shapes, principal axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

DEGENERATE = 1e-9
"""Principal moments that differ by no more, relative to the largest, are equal: a sphere, or a plane of free axes."""

Moments = tuple[float, float, float]


def settled(moments: ArrayLike) -> Moments:
    """Principal moments (I1, I2, I3), those within `DEGENERATE` of each other made exactly equal.

    I1 and I2 become their mean; of a sphere all are I3. So whatever is decided by comparing moments, a sphere, symmetry
    or the class of an axis, is decided alike everywhere, and nothing divides by a difference that is rounding.
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


def principal_axes(
    tensor: NDArray[np.float64],
) -> tuple[Moments, NDArray[np.float64]]:
    """Principal moments and axes of a symmetric 3×3 tensor (kg m²).

    Returns ((I1, I2, I3), axes): the columns of ``axes`` are the principal axes in the axes of the tensor, right
    handed. Axis 3 is the one nearest the third axis of the tensor, axis 1 the one nearest its first; where
    moments coincide, so that the axes are free, they are laid along those of the tensor.
    """
    tensor = np.asarray(tensor, dtype=float)
    if np.count_nonzero(tensor - np.diag(np.diagonal(tensor))) == 0:
        first, second, third = (float(moment) for moment in np.diagonal(tensor))
        return (first, second, third), np.eye(3)
    values, vectors = np.linalg.eigh(tensor)
    e3 = _nearest(values, vectors, np.array([0.0, 0.0, 1.0]))
    # Axis 3 may lie anywhere in a plane of equal moments: axis 1 is sought in the plane square to it.
    plane = np.linalg.svd(np.eye(3) - np.outer(e3, e3))[0][:, :2]
    values, turn = np.linalg.eigh(plane.T @ tensor @ plane)
    e1 = _nearest(values, plane @ turn, np.array([1.0, 0.0, 0.0]))
    e1 = e1 - e3 * (e3 @ e1)
    e1 /= np.linalg.norm(e1)
    axes = np.column_stack([e1, np.cross(e3, e1), e3])
    first, second, third = (float(axis @ tensor @ axis) for axis in axes.T)
    return (first, second, third), axes


def _nearest(
    moments: NDArray[np.float64], vectors: NDArray[np.float64], direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Unit vector nearest to ``direction`` among the eigenspaces; coinciding moments span one space."""
    best, best_length = vectors[:, 0], -1.0
    for moment in moments:
        space = vectors[:, np.abs(moments - moment) <= DEGENERATE * np.max(np.abs(moments))]
        projection = space @ (space.T @ direction)
        length = float(np.linalg.norm(projection))
        if length > best_length * (1 + 1e-12):
            best, best_length = projection, length
    if best_length == 0.0:
        return vectors[:, 0]
    return np.asarray(best / best_length, dtype=np.float64)
