"""Vectorised flight of many bodies: Euler's equations and the attitude through pulses of real
width.

Arrays carry the case last. Each case has its own moments, motion, torques and edges. A stretch
between two edges is an arc in closed form where the body is symmetric and no external torque acts,
with energy dissipation too; else a Taylor series as in `taylor`, with an order and a number of
steps common to a block of cases that stays in the cache.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import cos_sin
from nutdamp.errors import Infeasible
from nutdamp.physics import attitude, energy_sink, taylor
from nutdamp.physics.taylor import AT_REST, LONGEST, NOTHING, Forcing

Array = NDArray[np.float64]

# largest order of a series; a step that has not converged by then is repeated in shorter steps
LARGEST_ORDER = 30
REMAINDER = 1e-15  # size of the last terms kept, relative to the scale of rates and quaternion


class Series:
    """Taylor coefficients of rates and quaternion in x = (t - now)/step, for the cases of a block;
    see `taylor`.

    ``rates`` (order+1, 5, n) holds ω1, ω2, ω3, ω1, ω2, so that the products in Euler's equations
    are one product of two slices; ``turns`` (order+1, 4, n) is the quaternion.
    """

    def __init__(
        self, here: MotionStretch, step: Array, acceleration: Array, jerk: Array | None
    ) -> None:
        bodies, now, rates, quaternion = here[:4]
        moments = bodies.moments
        forcing = bodies.forcing
        count = len(step)
        first, second, third = moments
        self.now, self.step, self.acceleration, self.jerk, self.moments = (
            now,
            step,
            acceleration,
            jerk,
            moments,
        )
        self.coupling = np.stack(
            [(second - third) / first, (third - first) / second, (first - second) / third]
        )
        self.coupled = bool(self.coupling[2].any())
        self.rates = np.empty((LARGEST_ORDER + 1, 5, count))
        self.turns = np.empty((LARGEST_ORDER + 1, 4, count))
        self.rates[0, :3], self.rates[0, 3:], self.turns[0] = rates, rates[:2], quaternion
        self.turning = [
            (size * np.exp(1j * rate * now), 1j * rate * step) for size, rate in forcing.turning
        ]
        self.sink = (
            None
            if forcing.growth == 0.0
            else _DampingSeries(moments, forcing, acceleration, rates, step)
        )
        self.wheel = (
            np.stack([-forcing.wheel / first, forcing.wheel / second])
            if np.any(forcing.wheel)
            else None
        )
        # The spin of a symmetric body changes evenly: its series ends after two terms or one: short
        # sums.
        self.even_spin = not self.coupled and self.sink is None and jerk is None
        self.spins = 2 if acceleration[2].any() else 1
        self.order = 0

    def converges(self) -> bool:
        """Add orders until converged; False if `LARGEST_ORDER` is not enough."""
        span = float(np.max(np.abs(self.rates[0] * self.step)))
        # before which terms are not that small
        scale = REMAINDER * max(1.0, span)
        early = 3.0 + 4.0 * span
        small = 0
        while self.order < LARGEST_ORDER and small < 2:
            self._next()
            if self.order < early:
                continue
            terms = self.rates[self.order, :3] * self.step, self.turns[self.order]
            size = max(float(size) for part in terms for size in (part.max(), -part.min()))
            small = small + 1 if size < scale else 0
        return small == 2

    def end(self) -> tuple[Array, Array]:
        """Rates (3, n) and unit quaternions (4, n) at the end of the step."""
        rates, quaternion = (
            part[: self.order + 1].sum(axis=0) for part in (self.rates[:, :3], self.turns)
        )
        return rates, quaternion / np.sqrt(np.sum(quaternion * quaternion, axis=0))

    def at(self, way: Array, cases: Any) -> tuple[Array, Array]:
        """Rates (3, m), unit quaternions (4, m) of ``cases`` after a ``way`` (m,) in shares of the
        step.
        """
        rates, turns = (
            part[: self.order + 1].take(cases, axis=2) for part in (self.rates, self.turns)
        )
        rate, quaternion = rates[-1], turns[-1]
        for order in range(self.order - 1, -1, -1):
            rate, quaternion = rate * way + rates[order], quaternion * way + turns[order]
        return rate[:3], quaternion / np.sqrt(np.sum(quaternion * quaternion, axis=0))

    def along(self, ways: Array) -> tuple[Array, Array]:
        """Rates (k, 3, n), quaternions (k, 4, n), of unit length to rounding, after each of the
        ``ways`` (k,).
        """
        powers = ways[:, None] ** np.arange(self.order + 1)
        rates, turns = (
            np.tensordot(powers, part[: self.order + 1], 1) for part in (self.rates, self.turns)
        )
        return rates[:, :3], turns

    def _next(self) -> None:
        """Append the next order: products of series are sums over the orders so far."""
        k, rates, turns = self.order, self.rates, self.turns
        scale = self.step / (k + 1)
        following = rates[k + 1, :3]
        parts = 3 if self.coupled else 2
        spins = min(k + 1, self.spins) if self.even_spin else k + 1
        if self.even_spin:
            latest = rates[k - spins + 1 : k + 1, 1::-1]  # ω2 and ω1
            products = np.einsum("kn,kcn->cn", rates[spins - 1 :: -1, 2], latest)
        else:
            products = np.einsum(
                "kcn,kcn->cn", rates[: k + 1, 1 : 1 + parts], rates[k::-1, 2 : 2 + parts]
            )
        np.multiply(self.coupling[:parts], products, out=following[:parts])
        following[parts:] = 0.0
        if self.wheel is not None:
            following[:2] += self.wheel * rates[k, 1::-1]
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
        by_first, by_second = (
            np.einsum("kcn,kn->cn", turns[: k + 1], speeds[k::-1, axis]) for axis in (0, 1)
        )
        by_third = np.einsum("kcn,kn->cn", turns[k - spins + 1 : k + 1], speeds[spins - 1 :: -1, 2])
        half = 0.5 * scale
        turns[k + 1, 0] = half * -(by_first[1] + by_second[2] + by_third[3])
        turns[k + 1, 1] = half * (by_first[0] + by_third[2] - by_second[3])
        turns[k + 1, 2] = half * (by_second[0] + by_first[3] - by_third[1])
        turns[k + 1, 3] = half * (by_third[0] + by_second[1] - by_first[2])
        self.order = k + 1


class _DampingSeries:
    """Energy dissipation as series, see `taylor._Sink`: torque on H and slip of the body."""

    def __init__(
        self, moments: Array, forcing: Forcing, acceleration: Array, rates: Array, step: Array
    ) -> None:
        self.moments = moments
        self.growth = forcing.growth
        self.wheel = forcing.wheel
        A = 0.5 * (moments[0] + moments[1])
        self.with_wheel = bool(np.any(self.wheel))
        self.by_body = (moments[2] - A) / A if self.with_wheel else 1.0
        self.by_wheel = forcing.sense * forcing.wheel
        self.size, self.below = np.zeros(
            (2, LARGEST_ORDER, len(step))
        )  # |H| and the denominator of the quotient
        self.momentum, self.slip = np.zeros((2, LARGEST_ORDER, 3, len(step)))
        self.squares, self.quotient = np.zeros((2, LARGEST_ORDER, len(step)))  # |H|² and H3/|H|²
        largest = self.moments * (np.abs(rates) + np.abs(acceleration) * step)
        largest[2] += np.abs(self.wheel)
        self.floor = AT_REST**2 * np.sum(largest * largest, axis=0)

    def acceleration(self, rates: Array, k: int) -> Array:
        """Coefficient k of H × s, (3, n) N m; stores that of ``slip`` s. ``rates`` (3, n):
        coefficient k.
        """
        momentum, slip = self.momentum, self.slip
        momentum[k] = rates * self.moments
        momentum[k, 2] += self.wheel if k == 0 else 0.0
        self.squares[k] = np.einsum("kcn,kcn->n", momentum[: k + 1], momentum[k::-1])
        if k == 0:
            self.squares[0] += np.where(self.squares[0] + self.floor > 0.0, self.floor, 1.0)
        above, self.below[k] = momentum[k, 2], self.squares[k]
        if self.with_wheel:
            if k == 0:
                self.size[0] = np.sqrt(self.squares[0])
            else:
                between = np.einsum("kn,kn->n", self.size[1:k], self.size[1:k][::-1])
                self.size[k] = 0.5 * (self.squares[k] - between) / self.size[0]
            above = self.by_body * above + (self.wheel if k == 0 else 0.0)
            self.below[k] = self.by_body * self.squares[k] + self.by_wheel * self.size[k]
        before = np.einsum("kn,kn->n", self.below[1 : k + 1], self.quotient[:k][::-1])
        self.quotient[k] = (above - before) / self.below[0]
        slip[k, 0] = self.growth * np.einsum("kn,kn->n", self.quotient[k::-1], momentum[: k + 1, 1])
        slip[k, 1] = -self.growth * np.einsum(
            "kn,kn->n", self.quotient[k::-1], momentum[: k + 1, 0]
        )
        by_first, by_second = (
            np.einsum("kcn,kn->cn", momentum[: k + 1], slip[k::-1, axis]) for axis in (0, 1)
        )
        return np.stack([-by_second[2], by_first[2], by_second[0] - by_first[1]])


# cases flown together: enough to hide the cost of calls, few enough that their series stay in the
# cache
BLOCK = 2048
STRIDE = 2.5  # largest step, rad; the work per radian is least there

FEW = 256
"""Cases up to which many steps of symmetric bodies are summed at once: beyond, the sums cost more
than the calls.
"""

TOO_FAST = "the motion of a dispersed case changes too fast to be integrated"


@dataclass(frozen=True, slots=True)
class Bodies:
    """Bodies with principal ``moments`` (3, n) kg m²; ``constant`` torque (3,) N m and ``forcing``
    act on all.
    """

    moments: Array
    constant: Array
    forcing: Forcing = NOTHING

    @property
    def free(self) -> bool:
        """True if every coast is an arc of a symmetric body without external torque."""
        alone = not self.constant.any() and not self.forcing.turning
        return alone and bool(np.array_equal(self.moments[0], self.moments[1]))

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
        return self if by is None else Bodies(self.moments - by, self.constant, self.forcing)


@dataclass(frozen=True, slots=True)
class Pulses:
    """Rectangular pulses; the moments fall half as one begins and half as it ends, which errs in
    second order.
    """

    starts: Array  # (k, n) s
    on_times: Array  # (k, n) s, or (k, 1) for all cases; 0: an ideal impulse
    impulses: Array  # torque × on-time, (k, 3, n) N m s
    leans: Array | None = (
        None  # (k, n): torques run evenly from 1 - lean to 1 + lean times their mean
    )
    sheds: Array | None = None  # decrease of the moments, (k, 3, n) kg m²

    def some(self, cases: Any) -> Pulses:
        """Subset of ``cases`` (an index of arrays)."""
        on_times = self.on_times if self.on_times.shape[1] == 1 else self.on_times[:, cases]
        leans = None if self.leans is None else self.leans[:, cases]
        sheds = None if self.sheds is None else self.sheds[:, :, cases]
        return Pulses(self.starts[:, cases], on_times, self.impulses[:, :, cases], leans, sheds)

    @property
    def slopes(self) -> Array | None:
        """Slope of each torque, (k, 3, n) N m/s; None where all are constant."""
        if self.leans is None or not self.leans.any():
            return None
        lasts = np.where(self.on_times == 0.0, 1.0, self.on_times)
        return np.asarray(self.impulses * (2.0 * self.leans / lasts**2)[:, None])

    @property
    def edges(self) -> Array:
        """Starts and ends in turn, (2k, n) s."""
        ends = self.starts + self.on_times
        return np.stack([self.starts, ends], axis=1).reshape(-1, self.starts.shape[1])

    @property
    def jumps(self) -> tuple[Array, Array]:
        """Jump at each edge, (2k, 3, n) each: of the torque in N m,
        and of the momentum in N m s.
        """
        on_times = self.on_times[:, None]
        ideal = on_times == 0.0
        first = last = np.where(ideal, 0.0, self.impulses / np.where(ideal, 1.0, on_times))
        kick = np.where(ideal, self.impulses, 0.0)
        if (
            self.leans is not None
        ):  # what begins at its first value, less than its mean, ends at its last
            leans = self.leans[:, None]
            first, last = (1.0 - leans) * first, (1.0 + leans) * last
        return _edgewise(first, -last), _edgewise(kick, 0.0 * kick)


def _edgewise(begins: Array, ends: Array) -> Array:
    """Values at starts and ends (k, 3, n) interleaved, (2k, 3, n)."""
    return np.stack([begins, ends], axis=1).reshape(-1, *begins.shape[1:])


class MotionStretch(NamedTuple):
    """Motion of ``bodies`` under one torque, None for a coast, from ``since`` on."""

    bodies: Bodies
    since: Array  # (n,) s
    rates: Array  # (3, n) rad/s, at ``since``, as all below
    quaternion: Array  # (4, n)
    torque: Array | None = None  # (3, n) N m
    slope: Array | None = None  # of the torque, (3, n) N m/s

    def some(self, cases: Any) -> MotionStretch:
        """Subset of ``cases`` (an index of arrays)."""
        torque, slope = (None if vector is None else vector[:, cases] for vector in self[4:])
        motion = self.since[cases], self.rates[:, cases], self.quaternion[:, cases]
        return MotionStretch(self.bodies.some(cases), *motion, torque, slope)

    def moved(self, times: Array) -> MotionStretch:
        """Copy propagated to ``times`` (n,) s."""
        gone = times - self.since
        torque = self.torque
        if torque is not None and self.slope is not None:
            torque = torque + self.slope * gone
        later = self._replace(rates=self.rates.copy(), quaternion=self.quaternion.copy())
        advance(later, gone)
        return later._replace(since=times, torque=torque)


class DenseStretch(NamedTuple):
    """Motion from a ``start`` for ``length`` (n,) s, that is known all the way: by a ``series``, or
    in closed form.
    """

    start: MotionStretch
    length: Array
    series: Series | None = None

    def at(self, way: Array, cases: Any) -> MotionStretch:
        """Motion of ``cases`` after a ``way`` (m,), as a share of the length."""
        here = self.start.some(cases)
        since = here.since + way * self.length[cases]
        if self.series is None:
            return here.moved(since)
        rates, quaternion = self.series.at(way, cases)
        return here._replace(since=since, rates=rates, quaternion=quaternion)

    def steps(self, count: int) -> Iterator[MotionStretch]:
        """Motion at the end of each of ``count`` steps of equal length."""
        ways = np.arange(1, count + 1) / count
        times = self.start.since + ways[:, None] * self.length
        if self.series is None:
            yield from map(self.start.moved, times)
            return
        for since, rates, quaternion in zip(times, *self.series.along(ways), strict=True):
            yield self.start._replace(since=since, rates=rates, quaternion=quaternion)


def pieces(here: MotionStretch, duration: Array) -> Iterator[DenseStretch]:
    """Motion that `advance` makes with these arguments, which stay as they are, one piece after the
    other.
    """
    if here.torque is None and here.bodies.free:
        yield DenseStretch(here, duration)
        return
    begun = here._replace(rates=here.rates.copy(), quaternion=here.quaternion.copy())
    for series in _series(begun, duration, *_pushed(here)):
        start = here._replace(
            since=series.now, rates=series.rates[0, :3], quaternion=series.turns[0]
        )
        yield DenseStretch(start, series.step, series)


class Observer(Protocol):
    """Observer of the motion of cases; see `sky`."""

    def some(self, cases: Any) -> Observer:
        """Observer of a subset of ``cases`` (an index of arrays)."""

    def motion(self, here: MotionStretch, duration: Array) -> None:
        """Receive the motion that `advance` is about to make with the same arguments."""


def fly(
    bodies: Bodies, rates: Array, quaternion: Array, pulses: Pulses, watch: Observer | None = None
) -> tuple[Array, Array]:
    """Rates (3, n) rad/s and unit quaternions (4, n), body -> inertial, as the last pulse of each
    case ends.

    ``rates`` and ``quaternion`` at t = 0; ``watch`` sees the motion until then. Exact to some 1e-13
    rad for each hundred radians flown. Pulses may overlap and come in any order. Raises Infeasible
    beyond `taylor.LONGEST` rad.
    """
    rates, quaternion = np.array(rates, dtype=float), np.array(quaternion, dtype=float)
    for begin in range(0, rates.shape[1], BLOCK):
        cases = slice(begin, begin + BLOCK)
        seen = None if watch is None else watch.some(cases)
        _fly_block(
            bodies.some(cases), rates[:, cases], quaternion[:, cases], pulses.some(cases), seen
        )
    return rates, quaternion


def _fly_block(
    bodies: Bodies, rates: Array, quaternion: Array, pulses: Pulses, watch: Observer | None
) -> None:
    """Fly one block, in place."""
    edges = pulses.edges
    if not len(edges):
        return
    usual = np.argsort(edges.mean(axis=1), kind="stable")
    sorted_alike = np.all(np.diff(edges[usual], axis=0) >= 0.0, axis=0)
    if sorted_alike.all():
        _fly_alike(bodies, rates, quaternion, pulses, watch, usual)
        return
    for cases, alike in (
        (np.flatnonzero(sorted_alike), True),
        (np.flatnonzero(~sorted_alike), False),
    ):
        if len(cases):
            flown, turned = rates[:, cases], quaternion[:, cases]
            chosen = (
                bodies.some(cases),
                flown,
                turned,
                pulses.some(cases),
                watch and watch.some(cases),
            )
            if alike:
                _fly_alike(*chosen, usual)
            else:
                _fly_each(*chosen)
            rates[:, cases], quaternion[:, cases] = flown, turned


def _fly_alike(
    bodies: Bodies,
    rates: Array,
    quaternion: Array,
    pulses: Pulses,
    watch: Observer | None,
    order: NDArray[np.intp],
) -> None:
    """Fly cases whose edges have the same ``order``, in place: between pulses all of them coast."""
    edges, (turns, kicks), slopes = pulses.edges, pulses.jumps, pulses.slopes
    half = None if pulses.sheds is None else 0.5 * pulses.sheds
    now = np.zeros(rates.shape[1])
    on = set[int]()
    for edge in order.tolist():
        torque = np.sum(turns[sorted(on)], axis=0) if on else None
        slope = None
        if torque is not None and slopes is not None:
            rising = [first // 2 for first in sorted(on)]
            slope = np.sum(slopes[rising], axis=0)
            torque = torque + sum(slopes[number] * (now - edges[2 * number]) for number in rising)
        advance(
            MotionStretch(bodies, now, rates, quaternion, torque, slope), edges[edge] - now, watch
        )
        now = edges[edge]
        number, ends = divmod(edge, 2)
        bodies = bodies.lighter(None if half is None else half[number])
        if not np.any(pulses.on_times[number]):
            rates += kicks[edge] / bodies.moments
        elif ends:
            on.remove(edge - 1)
        else:
            on.add(edge)


def _fly_each(
    bodies: Bodies, rates: Array, quaternion: Array, pulses: Pulses, watch: Observer | None
) -> None:
    """Fly cases with different orders of edges, in place.

    Those that coast from one edge to the next go on in closed form: with times widely dispersed one
    coast may be long where another case has a pulse on, whose steps it would take.
    """
    edges = pulses.edges
    order = np.argsort(edges, axis=0, kind="stable")
    on = np.cumsum(1 - 2 * (order % 2), axis=0)  # pulses that are on behind each edge
    edges = np.take_along_axis(edges, order, axis=0)
    of_each = order[:, None, :]
    turns, kicks = (np.take_along_axis(jump, of_each, axis=0) for jump in pulses.jumps)
    slopes = pulses.slopes
    slope = None
    half = None
    if pulses.sheds is not None:
        half = np.take_along_axis(np.repeat(0.5 * pulses.sheds, 2, axis=0), of_each, axis=0)
    bends = (
        None if slopes is None else np.take_along_axis(_edgewise(slopes, -slopes), of_each, axis=0)
    )
    now = np.zeros(rates.shape[1])
    torque = np.zeros_like(rates)
    for number, (edge, turn, kick) in enumerate(zip(edges, turns, kicks, strict=True)):
        here = MotionStretch(bodies, now, rates, quaternion, torque, slope)
        coasts = on[number - 1] == 0 if number else np.ones(len(now), dtype=bool)
        groups = (
            (np.flatnonzero(coasts), np.flatnonzero(~coasts))
            if bodies.free
            else (np.arange(len(now)),)
        )
        for cases in filter(len, groups):
            part = here.some(cases)
            if bodies.free and coasts[cases[0]]:
                part = part._replace(torque=None, slope=None)
            advance(part, (edge - now)[cases], watch and watch.some(cases))
            rates[:, cases], quaternion[:, cases] = part.rates, part.quaternion
        torque = torque + turn if slope is None else torque + slope * (edge - now) + turn
        now = edge
        if bends is not None:
            slope = bends[number] if slope is None else slope + bends[number]
        bodies = bodies.lighter(None if half is None else half[number])
        rates += kick / bodies.moments


def advance(here: MotionStretch, duration: Array, watch: Observer | None = None) -> None:
    """Propagate rates and quaternion by ``duration`` (n,) s, in place; ``watch`` sees the motion
    before that.
    """
    if watch is not None:
        watch.motion(here, duration)
    if not duration.any():
        return
    moments, forcing = here.bodies.moments, here.bodies.forcing
    if here.torque is None and here.bodies.free:
        _arc(moments, forcing, here.rates, here.quaternion, duration)
        return
    acceleration, jerk = _pushed(here)
    if (
        jerk is None
        and len(here.since) <= FEW
        and forcing.growth == 0.0
        and np.array_equal(moments[0], moments[1])
    ):
        _integrate_symmetric(here, duration, acceleration)
        return
    for _ in _series(here, duration, acceleration, jerk):
        pass


def _pushed(here: MotionStretch) -> tuple[Array, Array | None]:
    """Constant angular acceleration (3, n) rad/s², and its slope, rad/s³, or None."""
    bodies, torque, slope = here.bodies, here.torque, here.slope
    acceleration = (bodies.constant[:, None] + (0.0 if torque is None else torque)) / bodies.moments
    return acceleration, None if slope is None or not slope.any() else slope / bodies.moments


def _arc(
    moments: Array, forcing: Forcing, rates: Array, quaternion: Array, duration: Array
) -> None:
    """Exact arc of symmetric bodies, in place; see `attitude.arc`, and `energy_sink.arc` with
    dissipation.

    R(t) = R(0) Rot(H(0)/A t) Rot3(νt), with H in body axes and ν = ω3 - H3/A.
    """
    A, _, C = moments
    x = rates[0]
    y = rates[1]
    growth = forcing.growth
    wheel = forcing.wheel / A
    axial = C / A * rates[2] + wheel
    size = np.sqrt(x * x + y * y + axial * axial)
    cosine, sine = cos_sin(0.5 * size * duration)
    sine /= np.where(size > 0.0, size, 1.0)
    turned = attitude.product(quaternion, (cosine, sine * x, sine * y, sine * axial))
    angle = ((1.0 - C / A) * rates[2] - wheel) * duration
    cosine, sine = cos_sin(0.5 * angle)
    p, a, b, c = turned
    quaternion[0], quaternion[3] = p * cosine - c * sine, c * cosine + p * sine
    quaternion[1], quaternion[2] = a * cosine + b * sine, b * cosine - a * sine
    quaternion /= np.sqrt(np.sum(quaternion * quaternion, axis=0))
    # ω turns by minus the whole angle, whose cosine and sine follow from those of its half.
    cosine, sine = 1.0 - 2.0 * sine * sine, 2.0 * sine * cosine
    rates[0], rates[1] = x * cosine + y * sine, y * cosine - x * sine
    if growth == 0.0:
        return
    moving = np.where(size > 0.0, size, 1.0)  # |H|/A
    cosine = np.where(size > 0.0, axial / moving, 1.0)
    h1, h2 = rates[0] / moving, rates[1] / moving
    shares = energy_sink.damper(A, C, forcing.wheel, A * size, forcing.sense)
    effect = energy_sink.courses(growth, cosine, h1 * h1 + h2 * h2, duration, shares)
    behind = (A / C - 1.0) * size * (effect.travel - cosine * duration)
    quaternion[:] = attitude.product(quaternion, energy_sink.slip(effect, h1, h2, behind, cos_sin))
    cosine, sine = cos_sin(behind)
    x, y = rates[0] * effect.transverse, rates[1] * effect.transverse
    rates[0], rates[1] = x * cosine + y * sine, y * cosine - x * sine
    rates[2] = (A * size * effect.along - forcing.wheel) / C


def _series(
    here: MotionStretch, duration: Array, acceleration: Array, jerk: Array | None
) -> Iterator[Series]:
    """Taylor series over ``duration`` in place, each in turn; ``acceleration`` (3, n) rad/s² at its
    start, ``jerk``.
    """
    forcing, moments = here.bodies.forcing, here.bodies.moments
    strength = np.sqrt(np.sum(acceleration * acceleration, axis=0))
    if jerk is not None:
        last = acceleration + jerk * duration
        strength = np.maximum(strength, np.sqrt(np.sum(last * last, axis=0)))
    strength = strength + sum(abs(size) for size, _ in forcing.turning) / moments.min(axis=0)
    fastest = max((abs(rate) for _, rate in forcing.turning), default=0.0) + np.abs(
        forcing.wheel
    ) / moments.min(axis=0)
    pace = (
        np.sqrt(np.sum(here.rates * here.rates, axis=0))
        + np.sqrt(strength)
        + fastest
        + abs(forcing.growth)
    )
    _expect_short(span := float(np.max(pace * duration)))
    steps = max(1, math.ceil(span / STRIDE))
    for number in range(steps):
        gone = duration * (number / steps)
        push = acceleration if jerk is None else acceleration + jerk * gone
        yield from _step(here._replace(since=here.since + gone), duration / steps, push, jerk)


def _expect_short(span: float) -> None:
    """Raise Infeasible for motions over too many radians."""
    if not span <= LONGEST:
        raise Infeasible(
            f"the motion of a dispersed case runs over {span:.2g} rad, too many to be integrated; "
            "shorten the time, "
            f"or look for a torque or rate that is too large"
        )


def _integrate_symmetric(here: MotionStretch, duration: Array, acceleration: Array) -> None:
    """`_series` for I1 = I2 without dissipation or jerk, at its end: many steps at once, see
    `taylor.steps`.
    """
    bodies, rates, quaternion = here.bodies, here.rates, here.quaternion
    A, _, C = bodies.moments
    drive = taylor.Drive.of(1.0 - C / A, acceleration, bodies.forcing, A)
    omega = rates[0] + 1j * rates[1]
    spin = rates[2]
    _expect_short(float(np.max(drive.pace(omega, spin, duration) * duration)))
    turned = np.stack([quaternion[0] + 1j * quaternion[3], quaternion[1] + 1j * quaternion[2]])
    try:
        omega, rates[2], (first, second) = taylor.end(
            drive, omega, spin, turned, here.since, duration
        )
    except taylor.NotConverged:
        raise Infeasible(TOO_FAST) from None
    rates[:2] = omega.real, omega.imag
    quaternion[:] = first.real, second.real, second.imag, first.imag


def _step(
    here: MotionStretch, step: Array, acceleration: Array, jerk: Array | None, halvings: int = 12
) -> Iterator[Series]:
    """Series of one step of ``step`` (n,) s, in place; halved where it does not converge."""
    series = Series(here, step, acceleration, jerk)
    if series.converges():
        yield series
        here.rates[:], here.quaternion[:] = series.end()
        return
    if halvings == 0:
        raise Infeasible(TOO_FAST)
    for begin in (0.0, 0.5):
        push = acceleration if jerk is None else acceleration + jerk * (begin * step)
        yield from _step(
            here._replace(since=here.since + begin * step), 0.5 * step, push, jerk, halvings - 1
        )
