"""Motion of rigid bodies, one or many at once: coasts and powered stretches.

Arrays carry the body last; those of one body have no such axis. Coasts of symmetric bodies without
external torque are arcs in closed form, with energy dissipation too (`arc`); free bodies with three
different moments move in Jacobi's functions (`triaxial.coasts`). All else are Taylor series, in
steps of up to `STRIDE` rad. `pieces` is where this is decided: each `Piece` gives the motion at any
time within it.

Euler's equations and the attitude are polynomials in rates and quaternion, so that the coefficients
of a series follow from one another by products of series,

    dω1/dt = (I2 - I3)/I1 ω2 ω3 - h/I1 ω2 + M1/I1 and round,    dq/dt = q (0, ω + s)/2,

Magnus 1970 (1) for three different moments and a wheel of momentum h, with the slip s of
`energy_sink`.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import TINY, cos_sin
from nutdamp.errors import Infeasible
from nutdamp.physics import attitude

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


@dataclass(frozen=True)
class Bodies:
    """Bodies with principal ``moments`` (3, n) kg m², or (3,) of one; ``constant`` torque (3,) N m
    and ``forcing`` act on all, or (3, n) and sizes (n,) on each.
    """

    moments: Array
    constant: Array
    forcing: Forcing = NOTHING

    @cached_property
    def symmetric(self) -> bool:
        """True if I1 = I2 of all."""
        return bool(np.array_equal(self.moments[0], self.moments[1]))

    @cached_property
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


# --- stretches

STRIDE = 2.5  # largest step, rad; the work per radian is least there
# H that passes zero turns about within `AT_REST` of the time: 2^-40 of a step resolves that
HALVINGS = 40
# share of the largest |H| of a motion below which H counts as at rest for energy dissipation
AT_REST = 1e-9
LONGEST = 3e5  # largest angle of one integration, rad: some hundred thousand steps
MOST_STEPS = 400_000  # of one integration: enough for `LONGEST` whatever the rates on the way


# cases flown together: enough to hide the cost of calls, few enough that their series stay in the
# cache
BLOCK = 2048


class MotionStretch(NamedTuple):
    """Motion of ``bodies`` under one torque, None for a coast, from ``since`` on."""

    bodies: Bodies
    since: Any  # (n,) s, a number for one body
    rates: Array  # (3, n) rad/s, at ``since``, as all below
    quaternion: Array  # (4, n) body -> inertial
    torque: Array | None = None  # (3, n) N m
    slope: Array | None = None  # of the torque, (3, n) N m/s
    falling: Falling | None = None  # of the moments

    def some(self, cases: Any) -> MotionStretch:
        """Subset of ``cases`` (an index of arrays)."""
        torque, slope = (None if vector is None else vector[:, cases] for vector in self[4:6])
        motion = self.since[cases], self.rates[:, cases], self.quaternion[:, cases]
        return MotionStretch(self.bodies.some(cases), *motion, torque, slope)

    def moved(self, times: Array) -> MotionStretch:
        """Copy propagated to ``times`` (n,) s."""
        later = self._replace(rates=self.rates.copy(), quaternion=self.quaternion.copy())
        advance(later, times - self.since)
        torque = self.torque_after(times - self.since)
        return later._replace(since=times, torque=torque)

    def torque_after(self, gone: Any) -> Array | None:
        """Torque (3, n) N m after ``gone`` (n,) s."""
        if self.torque is None or self.slope is None:
            return self.torque
        return np.asarray(self.torque + self.slope * gone)

    @property
    def acceleration(self) -> Array:
        """Constant part of the angular acceleration (3, n), rad/s²."""
        bodies = self.bodies
        constant = bodies.constant
        if bodies.moments.ndim > 1:
            constant = constant.reshape(3, -1)
        torque = constant if self.torque is None else constant + self.torque
        return np.asarray(torque / bodies.moments)

    @property
    def jerk(self) -> Array | None:
        """Slope of `acceleration`, rad/s³, or None."""
        slope = self.slope
        return None if slope is None or not slope.any() else slope / self.bodies.moments

    def later(self, gone: Any, rates: Array, quaternion: Array) -> MotionStretch:
        """The same after ``gone`` (n,) s, where ``rates`` and ``quaternion`` are these."""
        bodies, falling = self.bodies, self.falling
        if falling is not None:
            rate, growth = falling
            moments = bodies.moments + gone * (rate + 0.5 * gone * growth)
            bodies = replace(bodies, moments=moments)
            falling = Falling(rate + gone * growth, growth)
        now = self.since + gone
        return MotionStretch(
            bodies, now, rates, quaternion, self.torque_after(gone), self.slope, falling
        )


def arc(
    A: Any, C: Any, forcing: Forcing, rates: Sequence[Any], quaternion: Sequence[Any], time: Any
) -> tuple[tuple[Any, Any, Any], tuple[Any, Any, Any, Any]]:
    """Coast of symmetric bodies, exact: rates (3) and quaternions (4) after ``time`` s.

    R(t) = R(0) Rot(H(0)/A t) Rot3(νt), H in body axes: a frame turns about H at |H|/A, and the body
    in it about its own axis at ν = ω3 - H3/A (Poinsot's rolling cones, Magnus 1970 fig. 4). Without
    dissipation the rates stay in that frame; with it they and the frame slip as in `energy_sink`.
    Numbers, or arrays that broadcast; at a ``time`` that is a float, plain numbers, a tenth of the
    cost of arrays.
    """
    _, growth, wheel, sense, _ = forcing
    number = isinstance(time, float)
    sqrt: Any = math.sqrt if number else np.sqrt
    turn: Any = _cos_sin if number else cos_sin
    x, y, spin = rates
    axial = C / A * spin + wheel / A
    size = sqrt(x * x + y * y + axial * axial) + TINY  # |H|/A
    cosine, sine = turn(0.5 * size * time)
    sine = sine / size
    turned = attitude.product(quaternion, (cosine, sine * x, sine * y, sine * axial))
    angle = ((1.0 - C / A) * spin - wheel / A) * time
    if growth != 0.0:
        from nutdamp.physics import energy_sink  # dissipation

        first, second, along = x / size, y / size, axial / size
        across = (x + TINY) / size  # at rest, as of flat spin
        shares = energy_sink.damper(A, C, wheel, A * size, sense)
        sine_squared = across * across + second * second
        effect = energy_sink.course(growth, along, sine_squared, time, shares)
        slip = (effect.cosine, effect.sine * second, -effect.sine * first, 0.0)
        turned = attitude.product(turned, slip)
        x, y = x * effect.transverse, y * effect.transverse
        spin = (A * size * effect.along - wheel) / C
        angle = ((A - C) * size * effect.travel - wheel * time) / C
    cosine, sine = turn(0.5 * angle)
    p, a, b, c = turned
    turned = (
        p * cosine - c * sine,
        a * cosine + b * sine,
        b * cosine - a * sine,
        c * cosine + p * sine,
    )
    # ω turns by minus the whole angle, whose cosine and sine follow from those of its half.
    cosine, sine = 1.0 - 2.0 * sine * sine, 2.0 * sine * cosine
    return (x * cosine + y * sine, y * cosine - x * sine, spin), turned


def _cos_sin(angle: float) -> tuple[float, float]:
    return math.cos(angle), math.sin(angle)


class Piece(NamedTuple):
    """Motion from its ``begin`` for ``duration`` (n,) s.

    ``terms`` (order+1, 7, n) are those of a polynomial in the share of the duration, of the
    quaternion, then of the rates; None: a coast in closed form.
    """

    begin: MotionStretch
    duration: Any
    terms: Array | None = None

    @property
    def start(self) -> Any:
        """Time of its begin, (n,) s."""
        return self.begin.since

    @property
    def steps(self) -> int:
        """Steps of integration."""
        return 0 if self.terms is None else 1

    def end(self) -> tuple[Array, Array]:
        """Rates (3, n) rad/s and unit quaternions (4, n) at the end."""
        if self.terms is None:
            return self._coasted(self.duration)
        total = self.terms.sum(axis=0)
        return total[4:], total[:4] / _size(total[:4])

    def at(self, ways: Array, cases: Any) -> MotionStretch:
        """Motion of ``cases`` after ``ways`` (m,) in shares of the duration."""
        start = self.begin.some(cases)
        times = start.since + ways * self.duration[cases]
        if self.terms is None:
            return start.moved(times)
        terms = self.terms.take(cases, axis=2)
        total = terms[-1]
        for term in terms[-2::-1]:
            total = total * ways + term
        quaternion = total[:4] / _size(total[:4])
        return start._replace(since=times, rates=total[4:], quaternion=quaternion)

    def along(self, count: int) -> Iterator[MotionStretch]:
        """Motion at the end of each of ``count`` steps of equal length."""
        ways = np.arange(1, count + 1) / count
        times = self.start + ways[:, None] * self.duration
        if self.terms is None:
            yield from map(self.begin.moved, times)
            return
        for time, total in zip(times, self._sums(ways), strict=True):
            yield self.begin._replace(since=time, rates=total[4:], quaternion=total[:4])

    def motion(self, times: Array) -> tuple[Array, Array]:
        """Rates (m, 3) and unit quaternions (m, 4) of one body at ``times`` (m,) s."""
        since = np.asarray(times, dtype=float) - self.start
        if self.terms is None:
            rates, quaternion = self._coasted(since)
            return rates.T, quaternion.T
        total = self._sums(since / self.duration)
        quaternion = total[:, :4]
        return total[:, 4:], quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)

    def _sums(self, ways: Array) -> Array:
        """Polynomials (k, 7, n) after each of the ``ways`` (k,); quaternions to rounding."""
        assert self.terms is not None
        powers = ways[:, None] ** np.arange(len(self.terms))
        return np.asarray(np.tensordot(powers, self.terms, 1))

    def _coasted(self, time: Any) -> tuple[Array, Array]:
        """Rates (3, n) and unit quaternions (4, n) of a coast in closed form after ``time`` s:
        (n,), or of one body any number of times.
        """
        bodies, _, rates, quaternion, *_ = self.begin
        if not bodies.symmetric:
            from nutdamp.physics import triaxial  # three different moments

            begin = [part.reshape(len(part), -1) for part in (bodies.moments, rates, quaternion)]
            coasted = triaxial.coasts(begin[0], begin[1], begin[2], np.atleast_1d(time))
            return coasted[0].reshape(3, *np.shape(time)), coasted[1].reshape(4, *np.shape(time))
        A, _, C = bodies.moments
        if isinstance(time, float) and rates.ndim == 1:
            A, C = float(A), float(C)
            later, turned = arc(A, C, bodies.forcing, rates.tolist(), quaternion.tolist(), time)
            return np.array(later), np.array(turned)
        motion = np.empty((7, *np.shape(time)))
        later, turned = arc(A, C, bodies.forcing, tuple(rates), tuple(quaternion), time)
        for row, values in enumerate((*later, *turned)):
            motion[row] = values
        return motion[:3], motion[3:] / _size(motion[3:])


def between_edges(here: MotionStretch, duration: Any) -> Iterator[tuple[MotionStretch, Any]]:
    """Parts of a motion over ``duration`` (n,) s, positive or negative, in which the same torques
    act, and the duration of each, which is 0 for cases that move in others.

    All hold the arrays of ``here``: move these on before the next part is taken.
    """
    start, goal = here.since, here.since + duration
    spans = list(pairwise([-math.inf, *here.bodies.forcing.edges, math.inf]))
    for ordered, onward in ((spans, np.maximum), (spans[::-1], np.minimum)):
        for first, last in ordered:
            begin = np.clip(start, first, last)
            length = onward(np.clip(goal, first, last) - begin, 0.0)
            if np.any(length):
                part = here.later(begin - start, here.rates, here.quaternion)
                bodies = part.bodies.between(first, last)
                yield part._replace(since=begin, bodies=bodies), length


def advance(here: MotionStretch, duration: Any) -> None:
    """Propagate rates and quaternions by ``duration`` (n,) s, in place."""
    if np.any(duration):
        # A single step of the series costs as much as the closed form of three moments.
        for piece in pieces(here, duration, MOST_STEPS, STRIDE):
            last = piece
        here.rates[:], here.quaternion[:] = last.end()


def pieces(
    here: MotionStretch, duration: Any, most: int = MOST_STEPS, far: float = math.inf
) -> Iterator[Piece]:
    """Motion over ``duration`` (n,) s in pieces, one after the other.

    Free bodies with three different moments that turn more than ``far`` rad coast in closed form.
    Between edges of torques the arrays of ``here`` move on. Raises Infeasible beyond `LONGEST` rad
    or ``most`` steps.
    """
    bodies, forcing = here.bodies, here.bodies.forcing
    if forcing.timed:
        for part, length in between_edges(here, duration):
            begun = part._replace(rates=part.rates.copy(), quaternion=part.quaternion.copy())
            for piece in pieces(begun, length, most, far):
                most -= piece.steps
                yield piece
            here.rates[:], here.quaternion[:] = piece.end()
        return
    closed = here.torque is None and here.falling is None and not bodies.driven
    if closed and not bodies.symmetric:
        turned = np.max(_size(here.rates) * np.abs(duration))
        closed = bool(turned > far) and forcing.growth == 0.0 and not np.any(forcing.wheel)
    if closed:
        yield Piece(here, duration)
    else:
        yield from polynomials(here, duration, most)


def polynomials(here: MotionStretch, duration: Any, most: int = MOST_STEPS) -> Iterator[Piece]:
    """`pieces` by series, under the same torques throughout.

    Raises Infeasible beyond `LONGEST` rad or ``most`` steps.
    """
    moments, forcing = here.bodies.moments, here.bodies.forcing
    rates, quaternion = here.rates, here.quaternion
    acceleration, jerk = here.acceleration, here.jerk
    strength = _size(acceleration)
    if jerk is not None:
        strength = np.maximum(strength, _size(acceleration + jerk * duration))
    lightest = moments.min(axis=0)
    pushed = abs(forcing.growth)
    if forcing.turning:
        strength = strength + sum(abs(size) for size, _ in forcing.turning) / lightest
    pushed = pushed + np.sqrt(strength)
    turning = np.abs(forcing.wheel) / lightest
    turning = max((abs(rate) for _, rate in forcing.turning), default=0.0) + turning
    angle = float(np.max(np.maximum(_size(rates) + pushed, turning) * duration))
    floor = 0.0
    if forcing.growth != 0.0:
        size = _size(moments * rates) + np.abs(forcing.wheel)
        floor = np.square(AT_REST * (size + strength * moments.max(axis=0) * duration)) + TINY
    ahead = 1.0  # share of the duration
    share = 1.0  # of the step that the pace of the motion allows
    for _ in range(most):
        if not angle * ahead <= LONGEST:
            raise _refused(here, duration, angle * ahead)
        length = share * ahead / max(math.ceil(angle * ahead / STRIDE), 1)
        now = here.later((1.0 - ahead) * duration, rates, quaternion)
        step = Series(
            now.bodies,
            now.since,
            length * duration,
            rates,
            quaternion,
            now.acceleration,
            now.jerk,
            now.falling,
            floor,
        )
        if not step.converges():
            share *= 0.5
            if share < 0.5**HALVINGS:
                break
            continue
        piece = Piece(now, length * duration, step.terms[: step.order + 1, :7])
        yield piece
        share = min(2.0 * share, 1.0)
        ahead -= length
        if ahead == 0.0:
            return
        rates, quaternion = piece.end()
        angle = float(np.max(np.maximum(_size(rates) + pushed, turning) * duration))
    raise _refused(here, duration)


def _size(vectors: Array) -> Any:
    """Length (n,) of vectors (3, n)."""
    if vectors.ndim == 1:
        return math.hypot(*vectors.tolist())
    return np.sqrt(np.sum(vectors * vectors, axis=0))


def _refused(here: MotionStretch, duration: Any, angle: float | None = None) -> Infeasible:
    """Error of a motion over too large an ``angle`` rad, or None of too many steps."""
    why = "takes too many steps" if angle is None else f"runs over {angle:.2g} rad, too many"
    whose = "of a dispersed case"
    if here.rates.ndim == 1:
        whose = f"from {here.since:.4g} s to {here.since + duration:.4g} s"
    return Infeasible(
        f"the motion {whose} {why} to be integrated; shorten the time, "
        "or look for a torque or rate that is too large"
    )
