"""Euler's equations and the attitude, integrated by Taylor series for piecewise constant body torques.

The equations are polynomials in rates and quaternion, so the Taylor coefficients of a solution follow from one
another by products of series. One step spans about two radians at rounding accuracy, for any principal moments, and
the series is its own dense output; closed forms and plans are checked against it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ORDER = 22
"""Order of the series; near -ln(eps)/2 the work per radian is least for rounding accuracy."""

REMAINDER = 2.0**-53
"""Size of the last terms kept, relative to the scale of rates and quaternion."""


@dataclass(frozen=True, slots=True)
class Piece:
    """Solution from ``start`` over ``duration`` s as polynomials in x = (t - start)/duration.

    ``rates`` (ORDER+1, 3) in rad/s, ``attitude`` (ORDER+1, 4).
    """

    start: float
    duration: float
    rates: Array
    attitude: Array

    def at(self, times: Array) -> tuple[Array, Array]:
        """Rates (n, 3) and unit quaternions (n, 4) at ``times`` (n,) s within the piece."""
        powers = ((np.asarray(times, dtype=float) - self.start) / self.duration)[:, None] ** np.arange(ORDER + 1)
        quaternion = powers @ self.attitude
        return powers @ self.rates, quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)

    @property
    def final(self) -> tuple[Array, Array]:
        """Rates (3,) and unit quaternion (4,) at the end."""
        quaternion = self.attitude.sum(axis=0)
        return self.rates.sum(axis=0), quaternion / np.linalg.norm(quaternion)


def integrate(
    moments: tuple[float, float, float],
    torque: Array,
    rates: Array,
    quaternion: Array,
    start: float,
    end: float,
) -> list[Piece]:
    """Motion of a rigid body under a constant body torque, from ``start`` to ``end`` s (> start).

    ``moments`` (I1, I2, I3) kg m², ``torque`` (3,) N m, ``rates`` (3,) rad/s, ``quaternion`` (4,) body -> inertial.
    """
    pieces: list[Piece] = []
    inertia = np.asarray(moments)
    acceleration = np.asarray(torque) / inertia
    coupling = np.array([moments[1] - moments[2], moments[2] - moments[0], moments[0] - moments[1]]) / inertia
    now = start
    while now < end:
        # Unit of time for the coefficients: about one radian, so that none over- or underflows.
        pace = float(np.linalg.norm(rates)) + math.sqrt(float(np.linalg.norm(acceleration)))
        unit = 1.0 / pace if pace > 0.0 else end - now
        series = _series(coupling, acceleration, rates, quaternion, unit)
        step = min(_reach(series, unit) * unit, end - now)
        if end - now - step < 1e-3 * step:  # no sliver of a step at the end
            step = end - now
        scaled = series * ((step / unit) ** np.arange(ORDER + 1))[:, None]
        piece = Piece(now, step, scaled[:, :3], scaled[:, 3:])
        pieces.append(piece)
        rates, quaternion = piece.final
        now = end if step == end - now else now + step
    return pieces


def _series(coupling: Array, acceleration: Array, rates: Array, quaternion: Array, unit: float) -> Array:
    """Taylor coefficients (ORDER+1, 7) of rates and quaternion in units of time ``unit``.

    dω1/dt = (I2 - I3)/I1 ω2 ω3 + M1/I1 and round, Magnus 1970 (1) for three different moments;
    dq/dt = q (0, ω)/2.
    """
    series = np.zeros((ORDER + 1, 7))
    series[0, :3], series[0, 3:] = rates, quaternion
    for k in range(ORDER):
        # (series of the product of any two components)_k, by rows and columns, in one matrix product
        w = series[: k + 1].T @ series[k::-1, :3]
        step = unit / (k + 1)
        following = series[k + 1]
        following[0] = step * coupling[0] * w[1, 2]
        following[1] = step * coupling[1] * w[2, 0]
        following[2] = step * coupling[2] * w[0, 1]
        following[3] = -0.5 * step * (w[4, 0] + w[5, 1] + w[6, 2])
        following[4] = 0.5 * step * (w[3, 0] + w[5, 2] - w[6, 1])
        following[5] = 0.5 * step * (w[3, 1] + w[6, 0] - w[4, 2])
        following[6] = 0.5 * step * (w[3, 2] + w[4, 1] - w[5, 0])
        if k == 0:
            following[:3] += unit * acceleration
    return series


def _reach(series: Array, unit: float) -> float:
    """How far the series holds to `REMAINDER`, in its unit of time, from its last two orders."""
    size = np.max(np.abs(series[-2:]) * np.array([unit] * 3 + [1.0] * 4), axis=1)
    reaches = [
        (REMAINDER / float(last)) ** (1.0 / order)
        for last, order in zip(size, (ORDER - 1, ORDER), strict=True)
        if last > 0.0
    ]
    return min(reaches, default=math.inf)
