"""Taylor series of the motion of rigid bodies: Euler's equations and the attitude.

The equations are polynomials in rates and quaternion, so that the coefficients of a solution follow
from one another by products of series,

    dω1/dt = (I2 - I3)/I1 ω2 ω3 - h/I1 ω2 + M1/I1 and round,    dq/dt = q (0, ω + s)/2,

Magnus 1970 (1) for three different moments and a wheel of momentum h, with the slip s of
`energy_sink`. Arrays carry the body last; those of one body have no such axis.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from nutdamp.physics.energy_sink import SinkSeries

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LARGEST_ORDER = 30  # of a series; a step that has not converged by then is repeated in halves
REMAINDER = 1e-15  # size of the last terms, relative to the scale of rates and quaternion


class Torque(NamedTuple):
    """Torque from ``begin`` to ``end`` s: a ``vector`` (3,) N m, or (3, n) of many bodies, that
    turns about axis 3 at ``rate`` rad/s from t = 0.
    """

    vector: Array
    rate: float = 0.0
    begin: float = -math.inf
    end: float = math.inf


class Forcing(NamedTuple):
    """Forcing of a body besides a constant torque."""

    turning: tuple[
        tuple[Any, float], ...
    ] = ()  # torques M e^{irt} about axis 3: M1 + iM2 in N m at t = 0, r rad/s
    growth: float = 0.0  # κ of `energy_sink`, 1/s, at which a small nutation grows; negative: decay
    wheel: Any = 0.0  # constant momentum h along axis 3 besides I3 ω3, N m s; (n,) of many bodies
    sense: float = 1.0  # σ of the spin axis σ·e3, where κ holds
    timed: tuple[Torque, ...] = ()  # those that begin or end, see `motion.between_edges`

    @property
    def edges(self) -> list[float]:
        """Times, s, at which torques begin or end, in order."""
        times = {edge for torque in self.timed for edge in (torque.begin, torque.end)}
        return sorted(time for time in times if 0.0 < time < math.inf)


NOTHING = Forcing()


def driven_by(
    torques: Sequence[Torque], constant: Array, forcing: Forcing
) -> tuple[Array, Forcing]:
    """Constant torque and forcing of bodies on which ``torques`` act too."""
    turning = forcing.turning
    for vector, rate, *_ in torques:
        if rate != 0.0:
            turning = (*turning, (vector[0] + 1j * vector[1], rate))
            vector = np.stack([0.0 * vector[0], 0.0 * vector[1], vector[2]])
        constant = constant + vector
    return constant, forcing._replace(turning=turning)


class Falling(NamedTuple):
    """Changing principal moments: ``rate`` (3,) kg m²/s at the start of a stretch, ``growth`` (3,)
    kg m²/s² of it.

    Expelled mass takes along the angular momentum that it has there: I dω/dt = M - ω × (I ω), I as
    it falls.
    """

    rate: Array
    growth: Array


@dataclass(frozen=True, slots=True)
class Bodies:
    """Bodies with principal ``moments`` (3, n) kg m², or (3,) of one; ``constant`` torque (3,) N m
    and ``forcing`` act on all, or (3, n) and sizes (n,) on each.
    """

    moments: Array
    constant: Array
    forcing: Forcing = NOTHING

    @property
    def symmetric(self) -> bool:
        """True if I1 = I2 of all."""
        return bool(np.array_equal(self.moments[0], self.moments[1]))

    @property
    def driven(self) -> bool:
        """True if external torques act on them."""
        return bool(self.constant.any() or self.forcing.turning or self.forcing.timed)

    @property
    def free(self) -> bool:
        """True if every coast is an arc of a symmetric body without external torque."""
        return not self.driven and self.symmetric

    def between(self, first: float, last: float) -> Bodies:
        """Bodies as they are driven from ``first`` to ``last`` s, between two edges of their
        forcing.
        """
        timed = self.forcing.timed
        acting = [each for each in timed if each.begin <= first and last <= each.end]
        driven = driven_by(acting, self.constant, self.forcing._replace(timed=()))
        return Bodies(self.moments, *driven)

    def momentum(self, rates: Array) -> Array:
        """Angular momentum (3, n) N m s in body axes at ``rates`` (3, n) rad/s."""
        momentum = self.moments * rates
        momentum[2] += self.forcing.wheel
        return momentum

    def some(self, cases: Any) -> Bodies:
        """Subset of ``cases`` (an index of arrays)."""

        def part(values: Any, own: int) -> Any:
            return values[..., cases] if np.ndim(values) == own else values

        wheel, turning, timed = self.forcing.wheel, self.forcing.turning, self.forcing.timed
        forcing = self.forcing._replace(
            wheel=part(wheel, 1),
            turning=tuple((part(size, 1), rate) for size, rate in turning),
            timed=tuple(each._replace(vector=part(each.vector, 2)) for each in timed),
        )
        return Bodies(self.moments[:, cases], part(self.constant, 2), forcing)

    def lighter(self, by: Array | None) -> Bodies:
        """Copy with moments smaller ``by`` (3, n) kg m²; None: unchanged."""
        return self if by is None else replace(self, moments=self.moments - by)


class Polynomial(NamedTuple):
    """Motion from ``start`` over ``duration`` s as a polynomial in x = (t - start)/duration.

    ``terms`` (order+1, 7, n) are those of the quaternion, then of the rates.
    """

    start: Any
    duration: Any
    terms: Array

    def end(self) -> tuple[Array, Array]:
        """Rates (3, n) rad/s and unit quaternions (4, n) at the end."""
        total = self.terms.sum(axis=0)
        return total[4:], total[:4] / np.sqrt(np.sum(total[:4] * total[:4], axis=0))

    def at(self, ways: Array, cases: Any) -> tuple[Array, Array]:
        """Rates (3, m), unit quaternions (4, m) of ``cases`` after ``ways`` (m,) in shares of the
        duration.
        """
        terms = self.terms.take(cases, axis=2)
        total = terms[-1]
        for term in terms[-2::-1]:
            total = total * ways + term
        return total[4:], total[:4] / np.sqrt(np.sum(total[:4] * total[:4], axis=0))

    def along(self, ways: Array) -> tuple[Array, Array]:
        """Rates (k, 3, n), quaternions (k, 4, n), of unit length to rounding, after each of the
        ``ways`` (k,).
        """
        powers = ways[:, None] ** np.arange(len(self.terms))
        total = np.tensordot(powers, self.terms, 1)
        return total[:, 4:], total[:, :4]

    def motion(self, times: Array) -> tuple[Array, Array]:
        """Rates (m, 3) and unit quaternions (m, 4) of one body at ``times`` (m,) s."""
        ways = (np.asarray(times, dtype=float) - self.start) / self.duration
        rates, quaternion = self.along(ways)
        return rates, quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)


class Series:
    """Taylor coefficients in x = (t - since)/step of the motion of ``bodies`` over ``step`` (n,) s.

    From ``rates`` and ``quaternion`` at ``since`` (n,) s, by an angular ``acceleration`` (3, n)
    rad/s² and its slope ``jerk``.

    ``terms`` (order+1, 9, n) hold the quaternion, then ω1, ω2, ω3, ω1, ω2, so that the products in
    Euler's equations are one product of two slices. Those of one body are summed by matrices and
    joined as plain numbers, a quarter of the cost of arrays. ``floor``: see `SinkSeries`.
    """

    def __init__(
        self,
        bodies: Bodies,
        since: Any,
        step: Any,
        rates: Array,
        quaternion: Array,
        acceleration: Array,
        jerk: Array | None,
        falling: Falling | None,
        floor: Any,
    ) -> None:
        moments, forcing = bodies.moments, bodies.forcing
        self.since, self.step, self.order = since, step, 0
        self.one = moments.ndim == 1
        self.terms = np.empty((LARGEST_ORDER + 1, 9, *moments.shape[1:]))
        start = self.terms[0]
        start[:4], start[4:7], start[7:] = quaternion, rates, rates[:2]
        # The spin of a symmetric body changes evenly: its series ends after two terms or one.
        even = falling is None and jerk is None and forcing.growth == 0.0
        self.spins = LARGEST_ORDER
        if even and not self.one and bodies.symmetric:
            self.spins = 2 if acceleration[2].any() else 1
        self.moments: Any = moments.tolist() if self.one else moments
        self.coupling = _differences(self.moments, self.moments)
        self.pushes: list[Any] = [acceleration, jerk]
        if self.one:
            self.pushes = [None if push is None else push.tolist() for push in self.pushes]
        exp: Any = cmath.exp if self.one else np.exp
        self.turning = [
            (size * exp(1j * rate * since), 1j * rate * step) for size, rate in forcing.turning
        ]
        self.wheel = None
        if forcing.wheel if self.one else np.any(forcing.wheel):
            self.wheel = forcing.wheel / self.moments[0], forcing.wheel / self.moments[1]
        parts: list[Any] = [moments]
        if falling is not None:
            rate, growth = falling
            parts += [step * rate, 0.5 * step**2 * growth]
        self.products = list[Any]()  # coefficients of ω2 ω3, ω3 ω1, ω1 ω2
        self.sink: SinkSeries | None = None
        if forcing.growth != 0.0:
            from nutdamp.physics.energy_sink import SinkSeries  # dissipation

            self.sink = SinkSeries(
                parts, forcing.growth, forcing.wheel, forcing.sense, floor, LARGEST_ORDER
            )
        self.parts = [part.tolist() for part in parts] if self.one else parts

    def converges(self) -> bool:
        """Add orders until converged; False if `LARGEST_ORDER` is not enough."""
        span = self._largest(self.terms[0, 4:7], self.step)
        # before which terms are not that small
        scale = REMAINDER * max(1.0, span)
        early = 3.0 + 4.0 * span
        small = 0
        while self.order < LARGEST_ORDER and small < 2:
            self._next()
            if self.order < early:
                continue
            term = self.terms[self.order]
            size = max(self._largest(term[4:7], self.step), self._largest(term[:4], 1.0))
            small = small + 1 if size < scale else 0
        return small == 2

    def _largest(self, values: Array, unit: Any) -> float:
        """Largest size of ``values`` (k, n) times a ``unit`` (n,)."""
        if self.one:
            return float(unit * max(map(abs, values.tolist())))
        scaled = values * unit
        return float(max(scaled.max(), -scaled.min()))

    @property
    def polynomial(self) -> Polynomial:
        """Motion over the step."""
        return Polynomial(self.since, self.step, self.terms[: self.order + 1, :7])

    def _next(self) -> None:
        """Append the next order: products of series are sums over the orders so far."""
        k, step, moments = self.order, self.step, self.moments
        terms = self.terms[: k + 1]
        turns: Any
        if self.one:
            # of all components and rates at once
            table = (terms.T @ terms[::-1, 4:7]).tolist()
            product = table[5][2], table[6][0], table[4][1]
            turns = table[:4]
        elif self.spins == LARGEST_ORDER:
            product = tuple(np.einsum("kcn,kcn->cn", terms[:, 5:8], terms[::-1, 6:9]))
        else:
            few = terms[-self.spins :, 5:3:-1]  # ω2 and ω1
            product = *np.einsum("kn,kcn->cn", terms[len(few) - 1 :: -1, 6], few), 0.0
        self.products.append(product)
        by_first, by_second, by_third = self.coupling
        change = [by_first * product[0], by_second * product[1], by_third * product[2]]
        if self.wheel is not None:
            change[0] -= self.wheel[0] * terms[k, 5]
            change[1] += self.wheel[1] * terms[k, 4]
        if k < 2 and self.pushes[k] is not None:
            for axis, push in enumerate(self.pushes[k]):
                change[axis] += step * push if k else push
        for index, (size, turn) in enumerate(self.turning):
            change[0] += size.real / moments[0]
            change[1] += size.imag / moments[1]
            self.turning[index] = (size * turn / (k + 1), turn)
        # I = I0 + I1 x + I2 x²: step Σ ΔI_j (ω ω)_(k-j) = Σ (k + 1 - j) I_j ω_(k+1-j)
        for order in range(1, min(k + 1, len(self.parts))):
            part = self.parts[order]
            for axis, difference in enumerate(_differences(part, moments)):
                slower = (k + 1 - order) * part[axis] * self.terms[k + 1 - order, 4 + axis]
                change[axis] += difference * self.products[k - order][axis]
                change[axis] -= slower / (step * moments[axis])
        speeds = terms[:, 4:7]
        if self.sink is not None:
            for axis, torque in enumerate(self.sink.torque(k, speeds)):
                change[axis] += torque / moments[axis]
            speeds = speeds + self.sink.slip[: k + 1]
            if self.one:
                turns = self.sink.products(terms[:, :4], speeds)
        if not self.one:
            turns = self._turns(terms[:, :4], speeds)
        w, x, y, z = turns
        scale = step / (k + 1)
        half = 0.5 * scale
        first, second = scale * change[0], scale * change[1]
        following = (
            half * -(x[0] + y[1] + z[2]),
            half * (w[0] + y[2] - z[1]),
            half * (w[1] + z[0] - x[2]),
            half * (w[2] + x[1] - y[0]),
            first,
            second,
            scale * change[2],
            first,
            second,
        )
        if self.one:
            self.terms[k + 1] = following
        else:
            for row, values in zip(self.terms[k + 1], following, strict=True):
                row[:] = values
        self.order = k + 1

    def _turns(self, turns: Array, speeds: Array) -> Any:
        """Coefficient of the products of quaternion and ``speeds``, (4, 3, n), of many bodies."""
        few = turns[-self.spins :]
        by_first, by_second, by_third = (
            np.einsum("kcn,kn->cn", part, speeds[len(part) - 1 :: -1, axis])
            for axis, part in enumerate((turns, turns, few))
        )
        return zip(by_first, by_second, by_third, strict=True)


def _differences(moments: Any, over: Any) -> tuple[Any, Any, Any]:
    """(I2 - I3)/J1 and round, of (parts of) moments I and moments J."""
    (first, second, third), (x, y, z) = moments, over
    return (second - third) / x, (third - first) / y, (first - second) / z
