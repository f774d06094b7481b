"""Motion of rigid bodies, one or many at once: coasts and powered stretches.

Arrays carry the body last; those of one body have no such axis. Coasts of symmetric bodies without
external torque are arcs in closed form, with energy dissipation too (`arc`); free bodies with three
different moments move in Jacobi's functions (`triaxial.coasts`). All else are the Taylor series of
`series`, in steps of up to `STRIDE` rad.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import TINY, cos_sin
from nutdamp.errors import Infeasible
from nutdamp.physics import attitude
from nutdamp.physics.series import Bodies, Falling, Forcing, Polynomial, Series

Array = NDArray[np.float64]

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

    Numbers, or arrays that broadcast; at a ``time`` that is a float, plain numbers, a tenth of the
    cost of arrays.
    """
    (x, y, spin), (p, a, b, c), angle = nutated(A, C, forcing, rates, quaternion, time)
    turn: Any = _cos_sin if isinstance(time, float) else cos_sin
    cosine, sine = turn(0.5 * angle)
    turned = (
        p * cosine - c * sine,
        a * cosine + b * sine,
        b * cosine - a * sine,
        c * cosine + p * sine,
    )
    # ω turns by minus the whole angle, whose cosine and sine follow from those of its half.
    cosine, sine = 1.0 - 2.0 * sine * sine, 2.0 * sine * cosine
    return (x * cosine + y * sine, y * cosine - x * sine, spin), turned


def nutated(
    A: Any, C: Any, forcing: Forcing, rates: Sequence[Any], quaternion: Sequence[Any], time: Any
) -> tuple[tuple[Any, Any, Any], tuple[Any, Any, Any, Any], Any]:
    """`arc` in the frame that turns with the nutation, and the angle of the body about axis 3.

    R(t) = R(0) Rot(H(0)/A t) Rot3(νt), H in body axes: the frame turns about H at |H|/A, and the
    body in it about its own axis at ν = ω3 - H3/A (Poinsot's rolling cones, Magnus 1970 fig. 4).
    Without dissipation the rates stay in that frame; with it they and the frame slip as in
    `energy_sink`. Real or complex: a complex step gives derivatives.
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
    if growth == 0.0:
        return (x, y, spin), turned, ((1.0 - C / A) * spin - wheel / A) * time
    from nutdamp.physics import energy_sink  # dissipation

    course: Any = energy_sink.course if number else energy_sink.courses
    first, second, along = x / size, y / size, axial / size
    across = (x + TINY) / size  # at rest, as of flat spin
    shares = energy_sink.damper(A, C, wheel, A * size, sense)
    effect = course(growth, along, across * across + second * second, time, shares)
    slip = (effect.cosine, effect.sine * second, -effect.sine * first, 0.0)
    slowed = x * effect.transverse, y * effect.transverse, (A * size * effect.along - wheel) / C
    angle = ((A - C) * size * effect.travel - wheel * time) / C
    return slowed, attitude.product(turned, slip), angle


def _cos_sin(angle: float) -> tuple[float, float]:
    return math.cos(angle), math.sin(angle)


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
    if not np.any(duration):
        return
    if here.bodies.forcing.timed:
        for part, length in between_edges(here, duration):
            advance(part, length)
        return
    bodies, rates, quaternion = here.bodies, here.rates, here.quaternion
    if here.torque is None and bodies.free and here.falling is None:
        A, _, C = bodies.moments
        start = tuple(rates), tuple(quaternion)
        rates[:], quaternion[:] = arc(A, C, bodies.forcing, *start, duration)
        quaternion /= np.sqrt(np.sum(quaternion * quaternion, axis=0))
        return
    # A single step of the series costs as much as the closed form.
    far = quaternion.ndim == 2 and np.max(_size(rates) * np.abs(duration)) > STRIDE
    if far and _left_alone(here):
        from nutdamp.physics import triaxial  # three different moments

        rates[:], quaternion[:] = triaxial.coasts(bodies.moments, rates, quaternion, duration)
        return
    for piece in polynomials(here, duration):
        last = piece
    rates[:], quaternion[:] = last.end()


def _left_alone(here: MotionStretch) -> bool:
    """True for bodies without wheel, torque or dissipation."""
    forcing = here.bodies.forcing
    pure = forcing.growth == 0.0 and not np.any(forcing.wheel) and not here.bodies.driven
    return pure and here.torque is None and here.falling is None


def polynomials(here: MotionStretch, duration: Any, most: int = MOST_STEPS) -> Iterator[Polynomial]:
    """Motion under the same torques over ``duration`` (n,) s in pieces, one after the other.

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
        yield step.polynomial
        share = min(2.0 * share, 1.0)
        ahead -= length
        if ahead == 0.0:
            return
        rates, quaternion = step.polynomial.end()
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
