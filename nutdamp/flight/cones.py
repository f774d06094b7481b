"""Extreme angles of a flown spin axis from directions, and the cones about these that it keeps."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nutdamp.flight import propagation
from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Keep, Spacecraft, Vector
from nutdamp.spacecraft.requirements import Bound

TRIED = 8  # turns of the axis that are examined closely

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
    end = spacecraft.watched_until(flown.schedule.end) if until is None else until
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
        edges = [time for time in spacecraft.edges if time <= end]
        looked = np.concatenate([*tops, edges, times[extremes]])
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
