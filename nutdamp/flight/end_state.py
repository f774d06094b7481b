"""End state of a flight, differences between models, extreme angles to exclusion cones."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import compress, pairwise
from typing import NamedTuple

import numpy as np

from nutdamp.flight import propagation
from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Keep, Spacecraft, SpinState, Vector
from nutdamp.spacecraft.requirements import Bound, Left, Part
from nutdamp.spacecraft.schedule import Pulse, Schedule

SHARE = 0.1  # tolerance of the impulse sum, as a fraction of a bound of the requirement
TRIED = 8  # turns of the axis that are examined closely

LEGENDRE = ((-0.8611363115940526, 0.34785484513745385), (-0.33998104358485626, 0.6521451548625461))
"""Half of the four-point Gauss-Legendre rule on [-1, 1]: (node, weight); the other half is its
mirror image.
"""


def momentum_gained(flown: Flight) -> Vector:
    """∫ R(t) F dt over all pulses, (3,) N s, by Gauss-Legendre over stretches of at most half a
    radian.
    """
    gained = np.zeros(3)
    nodes, weights = np.array(
        [(sign * node, weight) for node, weight in LEGENDRE for sign in (1.0, -1.0)]
    ).T
    for leg in flown.legs:
        firing = [p for p in flown.schedule if p.thrust[0] <= leg.start and leg.end <= p.thrust[1]]
        if leg.end == leg.start or not any(p.force is not None and p.force.any() for p in firing):
            continue
        ends = leg.path.motion(np.array([leg.start, leg.end]))[0]
        turned = float(np.linalg.norm(ends, axis=1).max()) * (leg.end - leg.start)
        edges = np.linspace(leg.start, leg.end, math.ceil(turned / 0.5) + 1)
        middles, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * (edges[1] - edges[0])
        times = (middles[:, None] + half * nodes).ravel()
        pushes = attitude.rotate(leg.path.motion(times)[1], _forces(firing, times)).reshape(
            -1, len(nodes), 3
        )
        gained += half * np.einsum("snc,n->c", pushes, weights)
    return gained


def _forces(firing: Iterable[Pulse], times: Vector) -> Vector:
    """Force (3,) N of pulses, or (n, 3) at the ``times`` (n,) s where that of one of them rises or
    falls.
    """
    total = np.zeros(3)
    for pulse in firing:
        if pulse.force is None:
            continue
        if pulse.command is None:
            total = total + pulse.force
            continue
        corners = [(ramp.begin, ramp.first) for ramp in pulse.command.ramps]
        corners += [(ramp.end, ramp.last) for ramp in pulse.command.ramps]
        places, levels = np.array(sorted(corners, key=lambda corner: corner[0])).T
        total = total + np.interp(times, places, levels)[:, None] * pulse.force
    return np.asarray(total)


ANGLE = math.radians(0.01)  # tolerance where nothing is required, rad


class Deviation(NamedTuple):
    """Error of the impulse sum in a part, and the ``most`` that is tolerated (rad, rad/s)."""

    part: Part
    error: float
    most: float

    def __str__(self) -> str:
        if self.part is Part.SPIN:
            return f"{self.error:.2g} rad/s of {self.part.label}"
        return f"{math.degrees(self.error):.2g} deg of {self.part.label}"


def seen_at(flight: Flight, time: float) -> Flight:
    """Flight truncated at ``time`` s, which it must reach, with the pulses that have begun."""
    rates, quaternion = flight.motion(np.array([time]))
    begun = [begins < time or begins == ends == time for begins, ends in flight.spans]
    return replace(
        flight,
        schedule=flight.schedule
        if all(begun)
        else Schedule(tuple(compress(flight.schedule, begun))),
        settled=SpinState.of(rates[0], quaternion[0]),
        spans=tuple((begins, min(ends, time)) for begins, ends in compress(flight.spans, begun)),
        until=time,
    )


def spin_phases(flight: Flight, times: Vector) -> Vector:
    """Magnus 1970 (2): α = ∫ω3 dt from t = 0 to each of the ascending ``times`` (n,) s, rad.

    By Simpson's rule over stretches of at most half a radian, exact where ω3 is constant or changes
    linearly.
    """
    last = float(times[-1]) if len(times) else 0.0
    edges = sorted({0.0, *times.tolist(), *(leg.end for leg in flight.legs if leg.end <= last)})
    phases = {0.0: 0.0}
    phase = 0.0
    for begin, end in pairwise(edges):
        spins = abs(flight.motion(np.array([begin, end]))[0][:, 2])
        count = 2 * math.ceil(float(spins.max()) * (end - begin) / 0.5) + 2
        spin = flight.motion(np.linspace(begin, end, count + 1)[:-1])[0][:, 2]
        final = flight.motion(np.array([np.nextafter(end, begin)]))[0][
            0, 2
        ]  # before a jump at the end
        weights = np.ones(count)
        weights[1::2], weights[2::2] = 4.0, 2.0
        phase += (end - begin) / (3.0 * count) * float(weights @ spin + final)
        phases[end] = phase
    return np.array([phases[time] for time in times.tolist()])


def left_by(flight: Flight) -> Left:
    """Residual of a flight for `requirements`."""
    residual = flight.residual
    return Left(residual.nutation, residual.axis_error, flight.settled.spin)


def left_on_the_way(flight: Flight, observed: Sequence[Aspect]) -> Left:
    """`left_by` a flight, with the angles ``observed`` to the cones that the file keeps."""
    cones = observed[: len(flight.spacecraft.keep)]
    return left_by(flight)._replace(angles=[(aspect.least, aspect.largest) for aspect in cones])


def tolerated(spacecraft: Spacecraft) -> dict[Part, float]:
    """Tolerated difference between models, by part: `SHARE` of what is required, `ANGLE` where
    nothing bounds it.
    """
    required = {bound.part: SHARE * bound.limit for bound in requirements.required(spacecraft)}
    return {Part.NUTATION: ANGLE, requirements.aim(spacecraft): ANGLE, **required}


def deviations(flown: Flight, other: Flight) -> tuple[Deviation, ...]:
    """Parts in which two flights of one spacecraft end farther apart than `tolerated`."""
    ends = [left_by(flight) for flight in (flown, other)]
    differences = []
    for part, most in tolerated(flown.spacecraft).items():
        values = (
            {Part.NUTATION: end.nutation, Part.SPIN: end.spin}.get(part, end.aim) for end in ends
        )
        first, second = values
        if abs(first - second) > most:
            differences.append(Deviation(part, abs(first - second), most))
    return tuple(differences)


ROWS = 48
"""Rows in each nutation period; between them the extreme is estimated by a parabola and then
searched about it.
"""

CLOSE, LOOKS, FINER = 3, 3, 9
"""Extremes that are refined, rounds of refinement, points of each: a pulse on the way bends the
curve.
"""


class Aspect(NamedTuple):
    """Angles ``least`` and ``largest``, rad, from the direction of ``keep`` to the spin axis, with
    their times (s).
    """

    keep: Keep
    least: float
    least_at: float
    largest: float
    largest_at: float

    @property
    def broken_at(self) -> tuple[Bound, float, float] | None:
        """First bound that is broken, the angle, rad, and its time, s; None for a cone that is
        kept.
        """
        for bound in requirements.edges(self.keep):
            angle, at = (
                (self.least, self.least_at) if bound.inner else (self.largest, self.largest_at)
            )
            if not bound.met(angle):
                return bound, angle, at
        return None

    @property
    def kept(self) -> bool:
        """True if the axis keeps both bounds."""
        return self.broken_at is None


def aspects(flown: Flight, until: float | None = None) -> tuple[Aspect, ...]:
    """For each direction that the spacecraft watches, from t = 0 to ``until`` s.

    Default: one inertial nutation period after the last pulse. Raises Infeasible as
    `propagation.flown` does.
    """
    spacecraft = flown.spacecraft
    if not spacecraft.watched:
        return ()
    end = flown.schedule.end + spacecraft.inertial_period if until is None else until
    if flown.legs[-1].end < end:
        fly = (
            propagation.by_impulses if flown.model == propagation.IMPULSE_SUM else propagation.flown
        )
        flown = fly(spacecraft, flown.schedule, end)
    symmetric = (
        spacecraft.inertia.symmetric
    )  # else the axis wobbles on its way round H as the body turns, too
    period = (
        spacecraft.inertial_period
        if symmetric
        else min(spacecraft.inertial_period, spacecraft.body_period)
    )
    pieces = flown.pieces(max(int(ROWS * end / period), ROWS), end)
    rows = [
        (piece.t, piece.axis, piece.momentum) for piece in pieces
    ]  # the other columns are let go
    times, axis, momentum = (np.concatenate(column) for column in zip(*rows, strict=True))
    del rows
    momentum /= np.linalg.norm(momentum, axis=-1, keepdims=True)
    observed = []
    for keep in spacecraft.watched:
        towards = (
            momentum if keep.direction is None else np.broadcast_to(keep.direction, axis.shape)
        )
        nearness = np.sum(axis * towards, axis=-1)
        tops = [
            _closer(flown, keep, way, _peaks(times, way * nearness), period / ROWS, end)
            for way in (1.0, -1.0)  # farthest from a direction is nearest to the opposite one
        ]
        extremes = [
            int(np.argmax(nearness)),
            int(np.argmin(nearness)),
        ]  # before a jump, or at a kink of the angle from H
        looked = np.concatenate([*tops, times[extremes]])
        angles = attitude.angle_between(*_axis_and_direction(flown, keep, looked[: -len(extremes)]))
        angles = np.concatenate([angles, attitude.angle_between(axis[extremes], towards[extremes])])
        near, far = int(np.argmin(angles)), int(np.argmax(angles))
        observed.append(
            Aspect(
                keep,
                float(angles[near]),
                float(looked[near]),
                float(angles[far]),
                float(looked[far]),
            )
        )
    return tuple(observed)


def broken(spacecraft: Spacecraft, flown: Flight) -> Aspect | None:
    """First violated cone; None where there is none."""
    return (
        next((aspect for aspect in aspects(flown) if not aspect.kept), None)
        if spacecraft.keep
        else None
    )


def at_target(spacecraft: Spacecraft) -> Aspect | None:
    """First cone violated by an axis on the target; None where there is none, or no target."""
    target = spacecraft.goal.axis
    angles = (
        []
        if target is None
        else [_seen(target, target, keep, math.inf) for keep in spacecraft.keep]
    )
    return next((aspect for aspect in angles if not aspect.kept), None)


def at_start(spacecraft: Spacecraft) -> tuple[Aspect, ...]:
    """Angles of the watched directions from the spin axis at t = 0."""
    return tuple(
        _seen(spacecraft.axis, spacecraft.momentum, keep, 0.0) for keep in spacecraft.watched
    )


def _seen(axis: Vector, momentum: Vector, keep: Keep, time: float) -> Aspect:
    direction = momentum if keep.direction is None else keep.direction
    angle = float(attitude.angle_between(axis, direction))
    return Aspect(keep, angle, time, angle, time)


def _axis_and_direction(flown: Flight, keep: Keep, times: Vector) -> tuple[Vector, Vector]:
    """Spin axis at ``times`` (n,) s, and the direction of a cone: unit vectors (n, 3), the second
    perhaps (3,).
    """
    if keep.direction is not None:
        return flown.axis(times), keep.direction
    rates, quaternion = flown.motion(times)
    momentum = attitude.rotate(
        quaternion, rates * flown.moments_at(times) + (0.0, 0.0, flown.spacecraft.inertia.wheel)
    )
    momentum /= np.linalg.norm(momentum, axis=-1, keepdims=True)
    return flown.axis(times), momentum


def _closer(
    flown: Flight, keep: Keep, way: float, times: Vector, width: float, end: float
) -> Vector:
    """Moments up to ``end`` within ``width`` s of ``times`` (n,) at which the axis is nearest to
    ``way``·direction.
    """

    def apart_at(moments: Vector) -> Vector:
        """Square of the distance between axis and direction, as points of a sphere."""
        axis, direction = _axis_and_direction(flown, keep, moments)
        return np.asarray(np.sum((axis - way * direction) ** 2, axis=-1))

    times = times[np.argsort(apart_at(times), kind="stable")[:CLOSE]]
    for _ in range(
        LOOKS
    ):  # each among places a quarter as far apart, with a parabola in the square of the distance
        places = np.clip(times[:, None] + width * np.linspace(-1.0, 1.0, FINER), 0.0, end)
        apart = apart_at(places.ravel()).reshape(places.shape)
        best = np.argmin(apart, axis=1, keepdims=True)
        middle = np.clip(best, 1, FINER - 2)
        before, here, after = (
            np.take_along_axis(apart, middle + step, axis=1) for step in (-1, 0, 1)
        )
        bend = before - 2.0 * here + after
        inside = best == middle
        shift = np.divide(
            0.5 * (before - after), bend, out=np.zeros_like(bend), where=inside & (bend > 0.0)
        )
        width *= 2.0 / (FINER - 1)
        times = np.clip(np.take_along_axis(places, best, axis=1) + width * shift, 0.0, end)[:, 0]
    return times


def _peaks(times: Vector, values: Vector) -> Vector:
    """Times of the largest of ``values`` (n,), and of the `TRIED` highest parabolas with the top
    between their rows.
    """
    before, after = np.diff(times)[:-1], np.diff(times)[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        rise, fall = np.diff(values)[:-1] / before, np.diff(values)[1:] / after
        way = 0.5 * (rise * after + fall * before) / (rise - fall)
        peaked = np.flatnonzero(
            (before > 0.0) & (after > 0.0) & (rise > fall) & (-before < way) & (way < after)
        )
    before, after, rise, fall, way = (values[peaked] for values in (before, after, rise, fall, way))
    heights = values[1 + peaked] + (rise - fall) / (before + after) * way**2
    highest = np.argsort(-heights)[:TRIED]
    return np.append((times[1 + peaked] + way)[highest], times[int(np.argmax(values))])
