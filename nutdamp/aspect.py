"""How near the spin axis comes to directions such as the Sun's, and how far from them, nutation included."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from nutdamp import flight
from nutdamp.demands import SLACK, Keep
from nutdamp.flight import Flight
from nutdamp.physics import attitude
from nutdamp.spacecraft import Spacecraft, Vector

ROWS = 48
"""Rows in each nutation period; between them the moment is found by a parabola, and then looked for about it."""

CLOSE, LOOKS, FINER = 3, 3, 9
"""About so many moments it is looked so many times, at so many places: a pulse on its way bends the curve there."""

TRIED = 8
"""Of the turns of the axis those at which it is looked at closely."""


class Aspect(NamedTuple):
    """The ``least`` and the ``largest`` angle, rad, from the direction of ``keep`` to the spin axis, and when (s)."""

    keep: Keep
    least: float
    least_at: float
    largest: float
    largest_at: float

    @property
    def too_near(self) -> bool:
        """Whether the axis comes nearer than it may."""
        return self.least < self.keep.least - SLACK

    @property
    def kept(self) -> bool:
        """Whether the axis stays as near and as far as it is to."""
        return bool(self.keep.used(self.least, self.largest) <= 1.0)


def aspects(flown: Flight, until: float | None = None) -> tuple[Aspect, ...]:
    """For each direction that the spacecraft watches, from t = 0 to ``until`` s.

    Default: one inertial nutation period after the last pulse. A flight that ends earlier is flown on by its model.
    Raises Infeasible as `flight.flown` does.
    """
    body = flown.spacecraft
    if not body.watched:
        return ()
    end = flown.schedule.end + body.inertial_period if until is None else until
    if flown.legs[-1].end < end:
        fly = flight.by_impulses if flown.model == flight.IMPULSE_SUM else flight.flown
        flown = fly(body, flown.schedule, end)
    period = min(body.inertial_period, body.body_period)
    pieces = list(flown.pieces(max(int(ROWS * end / period), ROWS), end))
    times = np.concatenate([piece.t for piece in pieces])
    axis = np.concatenate([piece.axis for piece in pieces])
    found = []
    for keep in body.watched:
        nearness = axis @ keep.direction
        tops = [
            _closer(flown, way * keep.direction, _peaks(times, way * nearness), period / ROWS, end)
            for way in (1.0, -1.0)  # farthest from a direction is nearest to the opposite one
        ]
        looked = np.concatenate(tops)
        angles = attitude.angle_between(flown.axis(looked), keep.direction)
        near, far = int(np.argmin(angles)), int(np.argmax(angles))
        found.append(Aspect(keep, float(angles[near]), float(looked[near]), float(angles[far]), float(looked[far])))
    return tuple(found)


def broken(spacecraft: Spacecraft, flown: Flight) -> Aspect | None:
    """The first of the directions to which the axis comes too near, or from which too far; None where there is none."""
    return next((one for one in aspects(flown) if not one.kept), None) if spacecraft.keep else None


def at_target(spacecraft: Spacecraft) -> Aspect | None:
    """The first cone that an axis on the target breaks, at no time; None where there is none, or no target."""
    if spacecraft.goal.axis is None:
        return None
    found = (_seen(spacecraft.goal.axis, keep, math.inf) for keep in spacecraft.keep)
    return next((one for one in found if not one.kept), None)


def at_start(spacecraft: Spacecraft) -> tuple[Aspect, ...]:
    """Each direction that the spacecraft watches, from the spin axis at t = 0."""
    return tuple(_seen(spacecraft.axis, keep, 0.0) for keep in spacecraft.watched)


def _seen(axis: Vector, keep: Keep, time: float) -> Aspect:
    angle = float(attitude.angle_between(axis, keep.direction))
    return Aspect(keep, angle, time, angle, time)


def _closer(flown: Flight, direction: Vector, times: Vector, width: float, end: float) -> Vector:
    """Moments up to ``end`` within ``width`` s of the ``times`` (n,) at which the axis is nearest.

    Each look is among places a quarter as far apart as before, with a parabola in the square of the distance.
    """
    rough = attitude.angle_between(flown.axis(times), direction)
    times = times[np.argsort(rough, kind="stable")[:CLOSE]]
    for _ in range(LOOKS):
        places = np.clip(times[:, None] + width * np.linspace(-1.0, 1.0, FINER), 0.0, end)
        apart = np.sum((flown.axis(places.ravel()) - direction) ** 2, axis=1).reshape(places.shape)
        best = np.argmin(apart, axis=1, keepdims=True)
        middle = np.clip(best, 1, FINER - 2)
        before, here, after = (np.take_along_axis(apart, middle + step, axis=1) for step in (-1, 0, 1))
        bend, inside = before - 2.0 * here + after, best == middle
        way = np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=inside & (bend > 0.0))
        width *= 2.0 / (FINER - 1)
        times = np.clip(np.take_along_axis(places, best, axis=1) + width * way, 0.0, end)[:, 0]
    return times


def _peaks(times: Vector, values: Vector) -> Vector:
    """The times at which ``values`` (n,) may be largest: of the largest row, and on parabolas through three in a row.

    Of the parabolas with their top between the three the `TRIED` highest count. Rows at the same time, before and after
    a jump, are no neighbours.
    """
    before, after = np.diff(times)[:-1], np.diff(times)[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        rise, fall = np.diff(values)[:-1] / before, np.diff(values)[1:] / after
        way = 0.5 * (rise * after + fall * before) / (rise - fall)
        peaked = np.flatnonzero((before > 0.0) & (after > 0.0) & (rise > fall) & (-before < way) & (way < after))
    before, after, rise, fall, way = (one[peaked] for one in (before, after, rise, fall, way))
    heights = values[1 + peaked] + (rise - fall) / (before + after) * way**2
    highest = np.argsort(-heights)[:TRIED]
    return np.append((times[1 + peaked] + way)[highest], times[int(np.argmax(values))])
