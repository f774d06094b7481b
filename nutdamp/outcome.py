"""What has become of a body by a given time, and how far two models of the same flight are apart."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from nutdamp import compliance
from nutdamp.compliance import Left, Part
from nutdamp.flight import Flight
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Spacecraft, SpinState, Vector

SHARE = 0.1
"""Of a bound of the requirement, by which the impulse sum may err."""

ANGLE = math.radians(0.01)
"""rad by which it may err where nothing is required."""


class Deviation(NamedTuple):
    """By how much the impulse sum errs in a part, and the ``most`` by which it may (rad, rad/s)."""

    part: Part
    error: float
    most: float

    def __str__(self) -> str:
        if self.part is Part.SPIN:
            return f"{self.error:.2g} rad/s of {self.part.label}"
        return f"{math.degrees(self.error):.2g} deg of {self.part.label}"


def seen_at(flight: Flight, time: float) -> Flight:
    """The flight as it has come by ``time`` s, which it must reach: residual, final state and rows end there.

    Of the pulses those that have begun; what is after one that is still on is the motion at ``time``.
    """
    rates, quaternion = flight.motion(np.array([time]))
    first, second, third = rates[0].tolist()
    begun = [begins < time or begins == ends == time for begins, ends in flight.spans]
    kept = [index for index, one in enumerate(begun) if one]
    return replace(
        flight,
        schedule=flight.schedule
        if len(kept) == len(flight.schedule)
        else Schedule(tuple(flight.schedule.pulses[index] for index in kept)),
        settled=SpinState(complex(first, second), third, quaternion[0]),
        spans=tuple((flight.spans[index][0], min(flight.spans[index][1], time)) for index in kept),
        until=time,
    )


def spin_phases(flight: Flight, times: Vector) -> Vector:
    """Magnus 1970 (2): α = ∫ω3 dt from t = 0 to each of the ascending ``times`` (n,) s, rad.

    By Simpson's rule over stretches of at most half a radian, exact where ω3 is constant or changes linearly.
    """
    last = float(times[-1]) if len(times) else 0.0
    edges = sorted({0.0, *times.tolist(), *(leg.end for leg in flight.legs if leg.end <= last)})
    phases, phase = {0.0: 0.0}, 0.0
    for begin, end in itertools.pairwise(edges):
        spins = abs(flight.motion(np.array([begin, end]))[0][:, 2])
        count = 2 * math.ceil(float(spins.max()) * (end - begin) / 0.5) + 2
        spin = flight.motion(np.linspace(begin, end, count + 1)[:-1])[0][:, 2]
        final = flight.motion(np.array([np.nextafter(end, begin)]))[0][0, 2]  # before a jump at the end
        weights = np.ones(count)
        weights[1::2], weights[2::2] = 4.0, 2.0
        phase += (end - begin) / (3.0 * count) * float(weights @ spin + final)
        phases[end] = phase
    return np.array([phases[time] for time in times.tolist()])


def left_by(flight: Flight) -> Left:
    """What a flight leaves, as `compliance` takes it."""
    residual = flight.residual
    return Left(residual.nutation, residual.axis_error, flight.settled.spin)


def tolerated(spacecraft: Spacecraft) -> dict[Part, float]:
    """By how much models may differ in nutation, in the direction of H, and in the spin where the goal names one.

    A tenth of what is required; `ANGLE` for a part that nothing bounds.
    """
    required = {bound.part: SHARE * bound.most for bound in compliance.required(spacecraft)}
    return {Part.NUTATION: ANGLE, compliance.aim(spacecraft): ANGLE, **required}


def deviations(one: Flight, other: Flight) -> tuple[Deviation, ...]:
    """In what two flights of one spacecraft end farther apart than is `tolerated`."""
    body = one.spacecraft
    ends = [left_by(flight) for flight in (one, other)]
    found = []
    for part, most in tolerated(body).items():
        first, second = (end.spin if part is Part.SPIN else compliance.left_of(part, end, body) for end in ends)
        if abs(first - second) > most:
            found.append(Deviation(part, abs(first - second), most))
    return tuple(found)
