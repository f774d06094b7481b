"""End state of a flight, and differences between models."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import compress, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nutdamp.common.numerics import gauss_legendre
from nutdamp.flight.propagation import Flight
from nutdamp.physics import attitude
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft, SpinState, Vector
from nutdamp.spacecraft.requirements import Left, Part
from nutdamp.spacecraft.schedule import Pulse, Schedule

if TYPE_CHECKING:
    from nutdamp.flight.cones import Aspect

SHARE = 0.1  # tolerance of the impulse sum, as a fraction of a bound of the requirement


def momentum_gained(flown: Flight) -> Vector:
    """∫ R(t) F dt over all pulses, (3,) N s."""
    gained = np.zeros(3)
    for leg in flown.legs:
        firing = [p for p in flown.schedule if p.thrust[0] <= leg.start and leg.end <= p.thrust[1]]
        if leg.end == leg.start or not any(p.force is not None and p.force.any() for p in firing):
            continue
        ends = leg.path.motion(np.array([leg.start, leg.end]))[0]
        times, weights = _quadrature(leg.start, leg.end, np.linalg.norm(ends, axis=1))
        gained += weights @ attitude.rotate(leg.path.motion(times)[1], _forces(firing, times))
    return gained


def _quadrature(begin: float, end: float, rates: Vector) -> tuple[Vector, Vector]:
    """Times (n,) s from ``begin`` to ``end`` and weights of Gauss and Legendre, on stretches of at
    most half a radian at the largest of ``rates``, rad/s.
    """
    nodes, weights = gauss_legendre(4)
    count = max(math.ceil(float(rates.max()) * (end - begin) / 0.5), 1)
    half = 0.5 * (end - begin) / count
    middles = begin + half * (2.0 * np.arange(count) + 1.0)
    return (middles[:, None] + half * nodes).ravel(), np.tile(half * weights, count)


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

    Over stretches of at most half a radian, exact where ω3 is constant or changes linearly.
    """
    last = float(times[-1]) if len(times) else 0.0
    edges = sorted({0.0, *times.tolist(), *(leg.end for leg in flight.legs if leg.end <= last)})
    phases = {0.0: 0.0}
    for begin, end in pairwise(edges):
        spins = np.abs(flight.motion(np.array([begin, end]))[0][:, 2])
        at, weights = _quadrature(begin, end, spins)
        phases[end] = phases[begin] + float(weights @ flight.motion(at)[0][:, 2])
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
