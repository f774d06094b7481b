"""Taylor series of the motion of rigid bodies: Euler's equations and the attitude.

The equations are polynomials in rates and quaternion, so that the coefficients of a solution follow
from one another by products of series,

    dω1/dt = (I2 - I3)/I1 ω2 ω3 - h/I1 ω2 + M1/I1 and round,    dq/dt = q (0, ω + s)/2,

Magnus 1970 (1) for three different moments and a wheel of momentum h, with the slip s of
`energy_sink`. Arrays carry the body last; those of one body have no such axis.

Without dissipation the rates of a symmetric body are linear in their drive whatever its attitude:
ω' = -iaω3 ω + M/A with ω3 linear in time, Magnus 1970 (1). The rates at the ends of all steps
follow from sums, and the steps of the attitude are independent of each other: arrays carry the
steps and the cases, and the turns of the steps are multiplied at the end. A quaternion (w, x, y, z)
is a pair of complex numbers there, p = w + iz and r = x + iy: dq/dt = q (0, ω)/2 becomes p' = (iω3
p - ω̄ r)/2 and r' = (ω p - iω3 r)/2, and the product of two is (p p* - r r̄*, p r* + r p̄*).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LARGEST_ORDER = 30  # of a series; a step that has not converged by then is repeated in halves
REMAINDER = 1e-15  # size of the last terms, relative to the scale of rates and quaternion


class Forcing(NamedTuple):
    """Forcing of a body besides a constant torque."""

    turning: tuple[
        tuple[complex, float], ...
    ] = ()  # torques M e^{irt} about axis 3: M1 + iM2 in N m at t = 0, r rad/s
    growth: float = 0.0  # κ of `energy_sink`, 1/s, at which a small nutation grows; negative: decay
    wheel: Any = 0.0  # constant momentum h along axis 3 besides I3 ω3, N m s; (n,) of many bodies
    sense: float = 1.0  # σ of the spin axis σ·e3, where κ holds


NOTHING = Forcing()


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
    and ``forcing`` act on all.
    """

    moments: Array
    constant: Array
    forcing: Forcing = NOTHING

    @property
    def symmetric(self) -> bool:
        """True if I1 = I2 of all."""
        return bool(np.array_equal(self.moments[0], self.moments[1]))

    @property
    def free(self) -> bool:
        """True if every coast is an arc of a symmetric body without external torque."""
        alone = not self.constant.any() and not self.forcing.turning
        return alone and self.symmetric

    def momentum(self, rates: Array) -> Array:
        """Angular momentum (3, n) N m s in body axes at ``rates`` (3, n) rad/s."""
        momentum = self.moments * rates
        momentum[2] += self.forcing.wheel
        return momentum

    def some(self, cases: Any) -> Bodies:
        """Subset of ``cases`` (an index of arrays)."""
        forcing = self.forcing
        if np.ndim(forcing.wheel):
            forcing = forcing._replace(wheel=forcing.wheel[cases])
        return Bodies(self.moments[:, cases], self.constant, forcing)

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
    joined as plain numbers, a quarter of the cost of arrays. ``floor``: see `_Sink`.
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
        self.sink = None
        if forcing.growth != 0.0:
            self.sink = _Sink(parts, forcing, floor)
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
                turns = _products(terms[:, :4], speeds)
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


def _products(left: Array, right: Array) -> Any:
    """Coefficients of the products of series (k, a, n) and (k, b, n), (a, b, n)."""
    if left.ndim == 2:
        return (left.T @ right[::-1]).tolist()
    return np.einsum("kan,kbn->abn", left, right[::-1])


def _product(left: Array, right: Array) -> Any:
    """Coefficient of the product of two series (k, n)."""
    return left @ right[::-1] if left.ndim == 1 else np.einsum("kn,kn->n", left, right[::-1])


class _Sink:
    """`energy_sink` as series: torque of dissipation on H in body axes, and slip of the body.

    With q = H3/|H|² the slip is s = κq (H2, -H1, 0), and H × s is added to dH/dt in the body.
    ``floor`` keeps q regular where external torques bring H to rest: there is nothing to dissipate
    there. With a wheel q is ((C - A)H3 + Ah)/((C - A)|H|² + σAh|H|). The moments may fall:
    ``parts`` are their series.
    """

    def __init__(self, parts: list[Array], forcing: Forcing, floor: Any) -> None:
        _, self.growth, self.wheel, self.sense = forcing
        self.parts, self.floor = parts, floor
        self.with_wheel = bool(np.any(self.wheel))
        self.by_wheel = [0.5 * (part[0] + part[1]) for part in parts]
        self.by_body = [part[2] - A for part, A in zip(parts, self.by_wheel, strict=True)]
        shape = parts[0].shape
        self.momentum, self.slip = np.zeros((2, LARGEST_ORDER, *shape))  # H and s
        # |H|², |H|, the denominator of q, and q
        tables = np.zeros((4, LARGEST_ORDER, *shape[1:]))
        self.squares, self.size, self.below, self.quotient = tables

    def torque(self, k: int, rates: Array) -> tuple[Any, Any, Any]:
        """Coefficient k of H × s, (3, n), from those of ω up to it, (k+1, 3, n); stores that of
        ``slip``.
        """
        momentum, slip = self.momentum[: k + 1], self.slip[: k + 1]
        momentum[k] = self.parts[0] * rates[k]
        for order, part in enumerate(self.parts[1 : k + 1], 1):
            momentum[k] += part * rates[k - order]
        if k == 0:
            momentum[0, 2] += self.wheel
        if rates.ndim == 2:
            self.squares[k] = momentum.ravel() @ momentum[::-1].ravel()
        else:
            self.squares[k] = np.einsum("kcn,kcn->n", momentum, momentum[::-1])
        if k == 0:
            self.squares[0] += self.floor
        above, self.below[k] = momentum[k, 2], self.squares[k]
        if self.with_wheel:
            if k == 0:
                self.size[0] = np.sqrt(self.squares[0])
            else:
                between = _product(self.size[1:k], self.size[1:k])
                self.size[k] = 0.5 * (self.squares[k] - between) / self.size[0]
            above = self.by_wheel[k] * self.wheel if k < len(self.parts) else 0.0
            self.below[k] = 0.0
            for order, apart in enumerate(self.by_body[: k + 1]):
                above = above + apart * momentum[k - order, 2]
                by_wheel = self.sense * self.wheel * self.by_wheel[order]
                self.below[k] += apart * self.squares[k - order] + by_wheel * self.size[k - order]
        before = _product(self.below[1 : k + 1], self.quotient[:k])
        quotient = self.quotient[: k + 1]
        quotient[k] = (above - before) / self.below[0]
        slip[k, 0] = self.growth * _product(quotient, momentum[:, 1])
        slip[k, 1] = -self.growth * _product(quotient, momentum[:, 0])
        first, second, third = _products(momentum, slip[:, :2])
        return -third[1], third[0], first[1] - second[0]


# --- symmetric bodies under constant and turning torques: many steps at once

DRIVEN_ORDER = 22  # largest order of the series; a step that needs more is halved
DRIVEN_STRIDE = 1.7  # largest step, rad of the fastest rotation: 1.7^22/22! is rounding
DRIVEN_REMAINDER = 2.0**-53  # size of the last two terms, relative to that of rates and quaternion
TOGETHER = 1024  # steps times cases summed together: few enough that their series stay in the cache
DRIVEN_HALVINGS = 12  # largest number of halvings of the steps where the series does not converge


class NotConverged(ArithmeticError):
    """The motion changes too fast for steps of any reasonable length."""


@dataclass(frozen=True, slots=True)
class Drive:
    """Drive of n symmetric bodies, (n,) each."""

    a: Array  # (A - C)/A
    transverse: ComplexArray  # M/A, rad/s²
    axial: Array  # M3/C, rad/s²
    turning: tuple[
        tuple[ComplexArray | complex, float], ...
    ] = ()  # (M/A, r) of torques M e^{irt}, r in rad/s
    wheel: Array | float = (
        0.0  # h/A, rad/s, of a constant momentum h along axis 3: ω turns at aω3 - h/A
    )

    def pace(self, omega: ComplexArray, spin: Array, duration: Array) -> Array:
        """Upper bound (n,) in rad/s on all rates during the ``duration`` (n,) s."""
        fastest = np.maximum(np.abs(spin), np.abs(spin + self.axial * duration))
        strength = np.hypot(np.abs(self.transverse), self.axial)
        strength = strength + sum(np.abs(size) for size, _ in self.turning)
        rate = max((abs(rate) for _, rate in self.turning), default=0.0)
        turning = np.maximum(1.0, np.abs(self.a)) * fastest + rate + np.abs(self.wheel)
        # Across axis 3 a torque drives ω for as long as it keeps its direction to it: about a turn.
        return np.asarray(np.abs(omega) + turning + np.sqrt(strength))


class Steps(NamedTuple):
    """Series of s steps of n bodies in x from 0 to 1 within each."""

    starts: Array  # (s, n) s
    duration: Array  # (n,) s
    omega: ComplexArray  # (k, s, n) rad/s
    spin: Array  # (2, s, n) rad/s
    turn: ComplexArray  # (k, 2, s, n), p and r of the turn since the start of the step


def steps(
    drive: Drive, omega: ComplexArray, spin: Array, start: Array, duration: Array, count: int
) -> Iterator[Steps]:
    """Motion over ``duration`` (n,) s from ``start`` (n,) s in ``count`` equal steps or a multiple,
    in groups.

    ``omega`` and ``spin`` (n,) rad/s at the start. Raises NotConverged.
    """
    step = duration / count
    done = 0
    halvings = 0
    while done < count:
        some = min(max(TOGETHER // len(spin), 1), count - done)
        series = _driven_series(drive, omega, spin, start + done * step, step, some)
        if series is None:
            if halvings == DRIVEN_HALVINGS:
                raise NotConverged
            halvings = halvings + 1
            step = 0.5 * step
            done = 2 * done
            count = 2 * count
            continue
        yield series
        done += some
        omega, spin = series.omega[:, -1].sum(axis=0), series.spin[:, -1].sum(axis=0)


def end(
    drive: Drive,
    omega: ComplexArray,
    spin: Array,
    turned: ComplexArray,
    start: Array,
    duration: Array,
) -> tuple[ComplexArray, Array, ComplexArray]:
    """ω (n,), ω3 (n,), turn (2, n) after ``duration`` (n,) s, from those at ``start`` (n,) s;
    raises NotConverged.
    """
    for series in steps(
        drive, omega, spin, start, duration, count_for(drive, omega, spin, duration)
    ):
        turned = product(turned, whole(series.turn.sum(axis=0)))
        omega, spin = series.omega[:, -1].sum(axis=0), series.spin[:, -1].sum(axis=0)
    return omega, spin, turned / np.sqrt(np.sum(turned.real**2 + turned.imag**2, axis=0))


def count_for(drive: Drive, omega: ComplexArray, spin: Array, duration: Array) -> int:
    """Steps of the slowest of the bodies, if the series converges as its pace promises."""
    return max(
        1, math.ceil(float(np.max(drive.pace(omega, spin, duration) * duration)) / DRIVEN_STRIDE)
    )


def _driven_series(
    drive: Drive, omega: ComplexArray, spin: Array, now: Array, step: Array, count: int
) -> Steps | None:
    """Next ``count`` steps of ``step`` (n,) s from ``now`` (n,) s; None where `DRIVEN_ORDER` terms
    are too few.
    """
    number = np.arange(count)[:, None]
    starts = now + number * step
    gained = drive.axial * step
    spins = np.stack([spin + gained * number, np.broadcast_to(gained, starts.shape)])
    parts = [
        (size * np.exp(1j * rate * starts) * step, 1j * rate * step) for size, rate in drive.turning
    ]
    forces = _powers(np.broadcast_to(drive.transverse * step, starts.shape), parts)
    turning, wheel = -1j * drive.a * step, 1j * drive.wheel * step
    pace = float(np.max(drive.pace(omega, spin, step * count) * step))
    order = _order(pace)
    if count > 1:
        # All steps from rest; then ω at the start of each, by the phases that it has turned through
        # until then.
        driven = _rates(np.zeros_like(forces[0]), turning, spins, wheel, forces, DRIVEN_ORDER).sum(
            axis=0
        )
        turned = np.cumsum(drive.a * step * (spins[0] + 0.5 * gained) - drive.wheel * step, axis=0)
        sums = omega + np.cumsum(np.exp(1j * turned) * driven, axis=0)
        omega_starts = np.concatenate([omega[None], sums[:-1] * np.exp(-1j * turned[:-1])])
    else:
        omega_starts = np.broadcast_to(omega, starts.shape)
    while True:
        rates = _rates(omega_starts, turning, spins, wheel, forces, order)
        turns = _turns(rates, spins, step, order)
        last = max(float(np.abs(rates[-2:] * step).max()), float(np.abs(turns[-2:]).max()))
        if last <= DRIVEN_REMAINDER:
            return Steps(starts, step, rates, spins, turns)
        if not math.isfinite(last) or order == DRIVEN_ORDER:
            return None
        order = min(order + 4, DRIVEN_ORDER)


def _order(pace: float) -> int:
    """Order at which the terms of an exponential over ``pace`` rad are rounding."""
    term = 1.0
    for order in range(1, DRIVEN_ORDER + 1):
        term *= pace / order
        if term <= DRIVEN_REMAINDER:
            return min(max(order + 1, 4), DRIVEN_ORDER)
    return DRIVEN_ORDER


def _powers(constant: ComplexArray, turning: list[tuple[Any, Any]]) -> list[Any]:
    """Terms of the drive of ω in a step, times the step: the ``constant`` in the first only."""
    if not turning:
        return [constant]
    terms = list[Any]()
    sizes = [size for size, _ in turning]
    for order in range(DRIVEN_ORDER):
        terms.append(sum(sizes))
        sizes = [size * turn / (order + 1) for size, (_, turn) in zip(sizes, turning, strict=True)]
    terms[0] = terms[0] + constant
    return terms


def _rates(
    omega: ComplexArray, turning: Any, spins: Array, wheel: Any, forces: list[Any], order: int
) -> ComplexArray:
    """Series of ω (order+1, s, n) from its start (s, n)."""
    series = np.empty((order + 1, *omega.shape), dtype=complex)
    series[0] = omega
    level = turning * spins[0] + wheel
    slope = turning * spins[1]
    slanted = bool(slope.any())
    for k in range(order):
        following = level * series[k]
        if slanted and k > 0:
            following += slope * series[k - 1]
        if k < len(forces):
            following += forces[k]
        series[k + 1] = following / (k + 1)
    return series


def _turns(rates: ComplexArray, spins: Array, step: Array, order: int) -> ComplexArray:
    """Series of the turn (order+1, 2, s, n) since the start of each step."""
    series = np.empty((order + 1, 2, *rates.shape[1:]), dtype=complex)
    series[0, 0], series[0, 1] = 1.0, 0.0
    half = 0.5 * step
    across = np.stack([-rates.conj(), rates], axis=1) * half
    axial = np.stack([1j * half * spins, -1j * half * spins], axis=1)
    slanted = bool(spins[1].any())
    for k in range(order):
        following = np.einsum("kcsn,kcsn->csn", across[: k + 1], series[k::-1, ::-1])
        following += axial[0] * series[k]
        if slanted and k > 0:
            following += axial[1] * series[k - 1]
        series[k + 1] = following / (k + 1)
    return series


def product(left: ComplexArray, right: ComplexArray) -> ComplexArray:
    """Product of turns, (2, ...) each: the turn ``right``, then the turn ``left``."""
    p, r = left
    v, w = right
    return np.stack([p * v - r * w.conj(), p * w + r * v.conj()])


def in_turn(turns: ComplexArray) -> ComplexArray:
    """Turns (2, s, n) from the start to the end of each step, (2, s, n), from those of the steps
    alone.
    """
    done = turns
    reach = 1
    while reach < done.shape[1]:
        done = np.concatenate([done[:, :reach], product(done[:, :-reach], done[:, reach:])], axis=1)
        reach *= 2
    return done


def whole(turns: ComplexArray) -> ComplexArray:
    """Product (2, n) of the turns of all steps (2, s, n), one after the other."""
    while turns.shape[1] > 1:
        even = turns.shape[1] // 2 * 2
        pairs = product(turns[:, 0:even:2], turns[:, 1:even:2])
        turns = np.concatenate([pairs, turns[:, even:]], axis=1)
    return turns[:, 0]
