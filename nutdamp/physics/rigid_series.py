"""Taylor series of Euler's equations and the attitude for many bodies at once, as `rigid_cases` sums them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nutdamp.physics.rigid import AT_REST, Forcing

Array = NDArray[np.float64]

LARGEST_ORDER = 30
"""Of the series; what has not converged by then is done again in shorter steps."""

REMAINDER = 1e-15
"""Size of the last terms kept, relative to the scale of rates and quaternion."""


class Series:
    """Taylor coefficients of rates and quaternion in x = (t - now)/step, for the cases of a block.

    ``rates`` (order+1, 5, n) holds ω1, ω2, ω3, ω1, ω2, so that the products that Euler's equations need are one product
    of two slices; ``turns`` (order+1, 4, n) is the quaternion. The equations are those of `rigid`.
    """

    def __init__(
        self,
        moments: Array,
        forcing: Forcing,
        rates: Array,
        quaternion: Array,
        now: Array,
        step: Array,
        acceleration: Array,
        jerk: Array | None = None,
    ) -> None:
        first, second, third = moments
        count = len(step)
        self.step, self.acceleration, self.jerk, self.moments = step, acceleration, jerk, moments
        self.coupling = np.stack([(second - third) / first, (third - first) / second, (first - second) / third])
        self.coupled = bool(self.coupling[2].any())
        self.rates = np.empty((LARGEST_ORDER + 1, 5, count))
        self.turns = np.empty((LARGEST_ORDER + 1, 4, count))
        self.rates[0, :3], self.rates[0, 3:], self.turns[0] = rates, rates[:2], quaternion
        self.turning = [(size * np.exp(1j * rate * now), 1j * rate * step) for size, rate in forcing.turning]
        self.sink = None if forcing.growth == 0.0 else _Sink(moments, forcing.growth, acceleration, rates, step)
        # The spin of a symmetric body changes evenly: its series ends after two terms, and sums with it are short.
        self.even_spin = not self.coupled and self.sink is None and jerk is None
        self.order = 0

    def converges(self) -> bool:
        """Take in as many orders as it needs; whether that is no more than there may be."""
        scale = REMAINDER * max(1.0, float(np.max(np.abs(self.rates[0] * self.step))))
        small = 0
        while self.order < LARGEST_ORDER and small < 2:
            self._next()
            small = small + 1 if self.order >= 3 and self._size(self.order) < scale else 0
        return small == 2

    def end(self) -> tuple[Array, Array]:
        """Rates (3, n) and unit quaternions (4, n) at the end of the step."""
        rates = self.rates[: self.order + 1, :3].sum(axis=0)
        quaternion = self.turns[: self.order + 1].sum(axis=0)
        return rates, quaternion / np.sqrt(np.sum(quaternion * quaternion, axis=0))

    def _size(self, order: int) -> float:
        """Size of the terms of one order."""
        turned = self.rates[order, :3] * self.step
        return max(float(np.max(np.abs(turned))), float(np.max(np.abs(self.turns[order]))))

    def _next(self) -> None:
        """The next order: products of series are sums over the orders so far."""
        k, rates, turns = self.order, self.rates, self.turns
        scale = self.step / (k + 1)
        following = rates[k + 1, :3]
        parts = 3 if self.coupled else 2
        spins = min(k + 1, 2) if self.even_spin else k + 1
        if self.even_spin:
            latest = rates[k - spins + 1 : k + 1, 1::-1]  # ω2 and ω1
            products = np.einsum("kn,kcn->cn", rates[spins - 1 :: -1, 2], latest)
        else:
            products = np.einsum("kcn,kcn->cn", rates[: k + 1, 1 : 1 + parts], rates[k::-1, 2 : 2 + parts])
        np.multiply(self.coupling[:parts], products, out=following[:parts])
        following[parts:] = 0.0
        if k == 0:
            following += self.acceleration
        elif k == 1 and self.jerk is not None:
            following += self.step * self.jerk
        for index, (size, turn) in enumerate(self.turning):
            following[0] += size.real / self.moments[0]
            following[1] += size.imag / self.moments[1]
            self.turning[index] = (size * turn / (k + 1), turn)
        speeds = rates[:, :3]
        if self.sink is not None:
            following += self.sink.acceleration(rates[k, :3], k) / self.moments
            speeds = rates[: k + 1, :3] + self.sink.slip[: k + 1]
        following *= scale
        rates[k + 1, 3:] = following[:2]
        by_first, by_second = (np.einsum("kcn,kn->cn", turns[: k + 1], speeds[k::-1, axis]) for axis in (0, 1))
        by_third = np.einsum("kcn,kn->cn", turns[k - spins + 1 : k + 1], speeds[spins - 1 :: -1, 2])
        half = 0.5 * scale
        turns[k + 1, 0] = half * -(by_first[1] + by_second[2] + by_third[3])
        turns[k + 1, 1] = half * (by_first[0] + by_third[2] - by_second[3])
        turns[k + 1, 2] = half * (by_second[0] + by_first[3] - by_third[1])
        turns[k + 1, 3] = half * (by_third[0] + by_second[1] - by_first[2])
        self.order = k + 1


class _Sink:
    """Energy dissipation as series, see `rigid._Sink`: what it does to H, and how the body slips against it."""

    def __init__(self, moments: Array, growth: float, acceleration: Array, rates: Array, step: Array) -> None:
        self.moments, self.growth = moments, growth
        count = len(step)
        self.momentum = np.zeros((LARGEST_ORDER, 3, count))
        self.squares = np.zeros((LARGEST_ORDER, count))  # |H|²
        self.quotient = np.zeros((LARGEST_ORDER, count))  # H3/|H|²
        self.slip = np.zeros((LARGEST_ORDER, 3, count))
        largest = self.moments * (np.abs(rates) + np.abs(acceleration) * step)
        self.floor = AT_REST**2 * np.sum(largest * largest, axis=0)

    def acceleration(self, rates: Array, k: int) -> Array:
        """Coefficient k of H × s, (3, n) N m; makes that of ``slip`` s on the way. ``rates`` (3, n): coefficient k."""
        momentum, slip = self.momentum, self.slip
        momentum[k] = rates * self.moments
        self.squares[k] = np.einsum("kcn,kcn->n", momentum[: k + 1], momentum[k::-1])
        if k == 0:
            self.squares[0] += np.where(self.squares[0] + self.floor > 0.0, self.floor, 1.0)
        before = np.einsum("kn,kn->n", self.squares[1 : k + 1], self.quotient[:k][::-1])
        self.quotient[k] = (momentum[k, 2] - before) / self.squares[0]
        slip[k, 0] = self.growth * np.einsum("kn,kn->n", self.quotient[k::-1], momentum[: k + 1, 1])
        slip[k, 1] = -self.growth * np.einsum("kn,kn->n", self.quotient[k::-1], momentum[: k + 1, 0])
        by_first, by_second = (np.einsum("kcn,kn->cn", momentum[: k + 1], slip[k::-1, axis]) for axis in (0, 1))
        return np.stack([-by_second[2], by_first[2], by_second[0] - by_first[1]])
