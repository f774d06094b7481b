"""Trim a schedule on the flown motion: adjust moments, on-times and directions until nothing is left.

A damped Gauss-Newton iteration with bounds for a handful of unknowns. scipy.optimize would do it too, but loading it
takes longer than a whole plan.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nutdamp import flight
from nutdamp.physics import attitude
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Spacecraft, Vector

CONVERGED = 1e-14
"""rad; a few roundings of the integration."""

DIFFERENCE = 1e-6
"""Step of the difference quotients, in scaled unknowns: the error of the slopes, far below their size."""

STEPS = 30

PROGRESS = 0.01
"""Least relative gain of a step; near a solution each step gains many digits, so less means a bound in the way."""


def misses(spacecraft: Spacecraft, schedule: Schedule) -> Vector:
    """What the flown schedule leaves, (4,) rad: tilt of H from the spin axis in body axes 1, 2; shift of H in two.

    All four are zero exactly when no nutation is left and H is back where it was.
    """
    flight_ = flight.flown(spacecraft, schedule)
    moments = np.asarray(flight_.moments)
    start = spacecraft.initial
    before = attitude.rotate(start.quaternion, start.rates * moments)
    body = flight_.settled.rates * moments
    after = attitude.rotate(flight_.settled.quaternion, body)
    return np.concatenate([body[:2], _across(before, after)]) / float(np.linalg.norm(body))


def _across(axis: Vector, vector: Vector) -> Vector:
    """The two components of ``vector`` square to ``axis``."""
    unit = axis / float(np.linalg.norm(axis))
    other = np.eye(3)[int(np.argmin(np.abs(unit)))]
    first = np.cross(unit, other)
    first /= float(np.linalg.norm(first))
    return np.array([first @ vector, np.cross(unit, first) @ vector])


def solve(
    residual: Callable[[Vector], Vector], start: Vector, scale: Vector, lower: Vector, upper: Vector
) -> tuple[Vector, float]:
    """Unknowns (n,) within bounds that make ``residual`` (m,) least in norm, and that norm.

    ``scale`` (n,) is a natural size of each unknown. With more unknowns than equations the nearest solution.
    """
    x = np.clip(start, lower, upper)
    value = residual(x)
    norm = float(np.linalg.norm(value))
    for _ in range(STEPS):
        if norm <= CONVERGED:
            break
        jacobian = _slopes(residual, x, value, scale)
        step = _step(jacobian, value, x, scale, lower, upper)
        best, best_value, best_norm = x, value, norm
        for shrink in range(8):
            trial = np.clip(x + step * 0.5**shrink, lower, upper)
            trial_value = residual(trial)
            trial_norm = float(np.linalg.norm(trial_value))
            if trial_norm < best_norm:
                best, best_value, best_norm = trial, trial_value, trial_norm
                break
        stalled = best_norm > norm * (1.0 - PROGRESS)
        x, value, norm = best, best_value, best_norm
        if stalled:
            break
    return x, norm


def _slopes(residual: Callable[[Vector], Vector], x: Vector, value: Vector, scale: Vector) -> Vector:
    """Jacobian by the scaled unknowns, (m, n)."""
    columns = []
    for index, size in enumerate(scale):
        moved = x.copy()
        moved[index] += DIFFERENCE * size
        columns.append((residual(moved) - value) / DIFFERENCE)
    return np.column_stack(columns)


def _step(jacobian: Vector, value: Vector, x: Vector, scale: Vector, lower: Vector, upper: Vector) -> Vector:
    """Least-squares step; an unknown that it would push out of its bounds stays where it is."""
    free = np.ones(len(x), dtype=bool)
    step = np.zeros(len(x))
    for _ in range(len(x)):
        step[:] = 0.0
        step[free] = -np.linalg.lstsq(jacobian[:, free], value, rcond=1e-10)[0] * scale[free]
        outward = free & (((x <= lower) & (step < 0.0)) | ((x >= upper) & (step > 0.0)))
        if not outward.any():
            break
        free &= ~outward
    return step
