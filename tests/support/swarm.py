"""Many bodies at once for the tests, by an integrator that shares no formula and no line with nutdamp.

Euler's equations and rotation matrices of n bodies as one system for DOP853, from kick to kick: each body has its own
times, so time runs from 0 to 1 in every stretch. `reference.fly` is the same for one body.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]


def fly(moments: Array, rates: Array, times: Array, kicks: Array) -> tuple[Array, Array]:
    """Rates (n, 3) and rotations (n, 3, 3), body -> body at t = 0, just after the last kick.

    ``moments`` and ``rates`` (n, 3), ``times`` (k, n) s of the ``kicks`` (k, n, 3) N m s, in the order of time.
    """
    count = len(rates)
    w, rotation = np.array(rates), np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
    now = np.zeros(count)
    for time, kick in zip(times, kicks, strict=True):
        w, rotation = _coast(moments, w, rotation, time - now)
        w = w + kick / moments
        now = time
    return w, rotation


def _coast(moments: Array, rates: Array, rotation: Array, durations: Array) -> tuple[Array, Array]:
    count = len(rates)

    def slope(_: float, y: Array) -> Array:
        w, turned = y[: 3 * count].reshape(count, 3), y[3 * count :].reshape(count, 3, 3)
        rate = -np.cross(w, moments * w) / moments
        columns = np.cross(turned, w[:, None, :])  # each row r of R: (R [w]x) = r x w
        return np.concatenate([(rate * durations[:, None]).ravel(), (columns * durations[:, None, None]).ravel()])

    solved = solve_ivp(
        slope,
        (0.0, 1.0),
        np.concatenate([rates.ravel(), rotation.ravel()]),
        method="DOP853",
        t_eval=[1.0],
        rtol=2e-13,
        atol=1e-14,
    )
    assert solved.success
    y = solved.y[:, -1]
    return y[: 3 * count].reshape(count, 3), y[3 * count :].reshape(count, 3, 3)


def angles(first: Array, second: Array) -> Array:
    """Angles between vectors (n, 3), by the chord between unit vectors and its complement."""
    u = first / np.linalg.norm(first, axis=-1, keepdims=True)
    v = second / np.linalg.norm(second, axis=-1, keepdims=True)
    return np.asarray(2.0 * np.arctan2(np.linalg.norm(u - v, axis=-1), np.linalg.norm(u + v, axis=-1)))
