"""Euler's equations and the attitude, integrated by Taylor series for piecewise constant body torques.

The equations are polynomials in rates and quaternion, so the Taylor coefficients of a solution follow from one
another by products of series. One step spans about two radians at rounding accuracy, for any principal moments, and
the series is its own dense output; closed forms and plans are checked against it.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible

Array = NDArray[np.float64]

ORDER = 22
"""Order of the series; near -ln(eps)/2 the work per radian is least for rounding accuracy."""

FLAT = 0.02
"""Cosine of the nutation angle below which dissipation counts as having reached flat spin (88.9°)."""

LONGEST = 3e5
"""Radians that one integration may run over: some two hundred thousand steps."""

REMAINDER = 2.0**-53
"""Size of the last terms kept, relative to the scale of rates and quaternion."""


class Forcing(NamedTuple):
    """What acts on a body besides a constant torque.

    ``turning``: torques M e^{irt} about axis 3 of the body, as (M = M1 + iM2 in N m at t = 0, r in rad/s).
    ``growth``: rate 1/τ in 1/s at which energy dissipation lets H1 and H2 grow (negative: decay). ``keep_momentum``:
    internal dissipation cannot change |H|, so H3 gives way; False is the linear law of the closed forms, ω3 constant.
    """

    turning: tuple[tuple[complex, float], ...] = ()
    growth: float = 0.0
    keep_momentum: bool = True


NOTHING = Forcing()


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
    forcing: Forcing = NOTHING,
) -> list[Piece]:
    """Motion of a rigid body under a constant body torque and ``forcing``, from ``start`` to ``end`` s (> start).

    ``moments`` (I1, I2, I3) kg m², ``torque`` (3,) N m, ``rates`` (3,) rad/s, ``quaternion`` (4,) body -> inertial.
    Raises Infeasible where dissipation drives the body into flat spin, and for motions over more than `LONGEST` rad.
    """
    pieces: list[Piece] = []
    inertia = np.asarray(moments)
    acceleration = np.asarray(torque) / inertia
    strength = float(np.linalg.norm(acceleration)) + sum(abs(size) for size, _ in forcing.turning) / min(moments)
    fastest = max((abs(rate) for _, rate in forcing.turning), default=0.0)
    now = start
    while now < end:
        if forcing.growth > 0.0 and forcing.keep_momentum:
            _refuse_flat_spin(inertia * rates, now)
        # Unit of time for the coefficients: about one radian, so that none over- or underflows.
        pace = float(np.linalg.norm(rates)) + math.sqrt(strength) + fastest + abs(forcing.growth)
        if pace * (end - now) > LONGEST:
            raise Infeasible(
                f"the motion from {now:.4g} s to {end:.4g} s runs over {pace * (end - now):.2g} rad, too many to be "
                f"integrated; shorten the time, or look for a torque or rate that is too large"
            )
        unit = 1.0 / pace if pace > 0.0 else end - now
        series = _series(moments, acceleration, forcing, now, np.concatenate([rates, quaternion]), unit)
        step = min(_reach(series, unit) * unit, end - now)
        if end - now - step < 1e-3 * step:  # no sliver of a step at the end
            step = end - now
        scaled = series * ((step / unit) ** np.arange(ORDER + 1))[:, None]
        piece = Piece(now, step, scaled[:, :3], scaled[:, 3:])
        pieces.append(piece)
        rates, quaternion = piece.final
        now = end if step == end - now else now + step
    return pieces


def _refuse_flat_spin(momentum: Array, now: float) -> None:
    if abs(momentum[2]) < FLAT * float(np.linalg.norm(momentum)):
        raise Infeasible(f"energy dissipation drives the body into flat spin within {now:.4g} s")


def _series(
    moments: tuple[float, float, float], acceleration: Array, forcing: Forcing, now: float, state: Array, unit: float
) -> Array:
    """Taylor coefficients (ORDER+1, 7) of rates and quaternion in units of time ``unit``.

    dω1/dt = (I2 - I3)/I1 ω2 ω3 + M1/I1 and round, Magnus 1970 (1) for three different moments;
    dq/dt = q (0, ω)/2, and the terms of `_Sink` where energy is dissipated.
    """
    first, second, third = moments
    coupling = ((second - third) / first, (third - first) / second, (first - second) / third)
    series = np.zeros((ORDER + 1, 7))
    series[0] = state
    turning = [(size * cmath.exp(1j * rate * now), 1j * rate * unit) for size, rate in forcing.turning]
    sink = None if forcing.growth == 0.0 else _Sink(np.asarray(moments), forcing)
    for k in range(ORDER):
        # (series of the product of any two components)_k, by rows and columns, in one matrix product
        w = series[: k + 1].T @ series[k::-1, :3]
        step = unit / (k + 1)
        following = series[k + 1]
        following[0] = step * coupling[0] * w[1, 2]
        following[1] = step * coupling[1] * w[2, 0]
        following[2] = step * coupling[2] * w[0, 1]
        if k == 0:
            following[:3] += unit * acceleration
        for index, (size, turn) in enumerate(turning):
            following[0] += step * size.real / first
            following[1] += step * size.imag / second
            turning[index] = (size * turn / (k + 1), turn)
        if sink is not None:
            following[:3] += step * sink.acceleration(series, k, w)
            w = series[: k + 1].T @ (series[k::-1, :3] + sink.slip[k::-1])
        following[3] = -0.5 * step * (w[4, 0] + w[5, 1] + w[6, 2])
        following[4] = 0.5 * step * (w[3, 0] + w[5, 2] - w[6, 1])
        following[5] = 0.5 * step * (w[3, 1] + w[6, 0] - w[4, 2])
        following[6] = 0.5 * step * (w[3, 2] + w[4, 1] - w[5, 0])
    return series


class _Sink:
    """Energy dissipation inside the body, as series: what it does to H in body axes, and how the body turns under it.

    D = (H1, H2, -(H1² + H2²)/H3)/τ is added to dH/dt in the body (the linear law drops its third part). An internal
    process cannot turn H in space: the body slips against it at D × H/|H|², beside ω = H/I.
    """

    def __init__(self, moments: Array, forcing: Forcing) -> None:
        self.moments, self.forcing = moments, forcing
        self.drive = np.zeros((ORDER, 3))  # D
        self.slip = np.zeros((ORDER, 3))  # D × H/|H|²
        self.lost = np.zeros(ORDER)  # (H1² + H2²)/H3

    def acceleration(self, series: Array, k: int, w: Array) -> Array:
        """Coefficient k of D/I, (3,); makes that of ``slip`` on the way. ``w`` as in `_series`."""
        first, second = self.moments[:2]
        momentum = series[: k + 1, :3] * self.moments
        self.drive[k, :2] = self.forcing.growth * momentum[k, :2]
        if self.forcing.keep_momentum:
            transverse = first**2 * w[0, 0] + second**2 * w[1, 1]
            self.lost[k] = (transverse - momentum[1:, 2] @ self.lost[k - 1 :: -1][:k]) / momentum[0, 2]
            self.drive[k, 2] = -self.forcing.growth * self.lost[k]
        crossed = np.cross(self.drive[: k + 1], momentum[::-1]).sum(axis=0)
        squares = np.array([momentum[: j + 1].ravel() @ momentum[j::-1].ravel() for j in range(k + 1)])
        self.slip[k] = (crossed - squares[1:] @ self.slip[k - 1 :: -1][:k]) / squares[0]
        return np.asarray(self.drive[k] / self.moments)


def _reach(series: Array, unit: float) -> float:
    """How far the series holds to `REMAINDER`, in its unit of time, from its last two orders."""
    size = np.max(np.abs(series[-2:]) * np.array([unit] * 3 + [1.0] * 4), axis=1)
    reaches = [
        (REMAINDER / float(last)) ** (1.0 / order)
        for last, order in zip(size, (ORDER - 1, ORDER), strict=True)
        if last > 0.0
    ]
    return min(reaches, default=math.inf)
