"""How light the propellant that is used leaves the body: principal moments that fall along a schedule."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from nutdamp.dynamics import Dynamics
from nutdamp.physics.rigid import Falling
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Inertia, Spacecraft, Vector


def shed(spacecraft: Spacecraft) -> Vector | None:
    """By how much the principal moments fall with each kg of propellant used, (3,) m²; None where they stay."""
    per_kg = None if spacecraft.tank is None else spacecraft.tank.inertia_per_kg
    return None if per_kg is None else np.array(per_kg)


def lightened(spacecraft: Spacecraft, used: float) -> Inertia:
    """The inertia once so many kg of propellant are ``used``."""
    per_kg, inertia = shed(spacecraft), spacecraft.inertia
    if per_kg is None or used == 0.0:
        return inertia
    first, second, third = (np.asarray(inertia.moments) - used * per_kg).tolist()
    return replace(inertia, moments=(first, second, third))


class Lightening:
    """How the moments of the body fall along a flight, as the propellant of the pulses is used."""

    def __init__(self, dynamics: Dynamics, spacecraft: Spacecraft, schedule: Schedule, edges: Sequence[float]) -> None:
        self.first, self.per_kg = dynamics.moments, shed(spacecraft)
        times = np.array([*edges, *(0.5 * (one + other) for one, other in pairwise(edges))])
        self.used = {} if self.per_kg is None else dict(zip(times.tolist(), schedule.used_by(times), strict=True))

    def halfway(self, dynamics: Dynamics, time: float) -> Dynamics:
        """The body amid what is used all at once at ``time`` s."""
        if self.per_kg is None:
            return dynamics
        before = max((used for when, used in self.used.items() if when < time), default=0.0)
        return dynamics.with_moments(self.first - 0.5 * (before + self.used[time]) * self.per_kg)

    def between(self, dynamics: Dynamics, start: float, end: float) -> tuple[Dynamics, Falling | None]:
        """The body at ``start`` s, and how its moments fall until ``end`` s, with no edge of a pulse in between.

        As no more than a quadratic of time: what is used by start, middle and end says all.
        """
        if self.per_kg is None:
            return dynamics, None
        before, length = self.used[start], end - start
        body = dynamics.with_moments(self.first - before * self.per_kg)
        if length == 0.0 or self.used[end] == before:
            return body, None
        half, whole = self.used[0.5 * (start + end)] - before, self.used[end] - before
        rate, growth = (4.0 * half - whole) / length, 4.0 * (whole - 2.0 * half) / length**2
        return body, Falling(-rate * self.per_kg, -growth * self.per_kg)
