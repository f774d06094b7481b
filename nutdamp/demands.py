"""What is demanded of a plan: what it reaches, and what it keeps on the way. SI and rad, in principal axes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

SLACK = 1e-9
"""rad by which a bound of `Keep` may be passed: rounding."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """What must be met at the end: nutation angle and shift of the angular momentum, rad; None requires nothing.

    ``probability`` (0 to 1) is how surely a dispersed flight must meet it.
    """

    nutation: float | None = None
    momentum_shift: float | None = None
    probability: float | None = None


PROBABILITY = 0.997
"""Share of cases that must comply where the requirement gives none."""


def required_share(requirement: Requirement | None) -> float:
    """Share of dispersed cases that must comply, 0 to 1."""
    given = None if requirement is None else requirement.probability
    return PROBABILITY if given is None else given


@dataclass(frozen=True, slots=True)
class Goal:
    """Where the motion is to end, besides without nutation.

    ``axis`` (3,) is the unit vector, inertial, along which the angular momentum and the spin axis are to lie; None is
    where the angular momentum is at t = 0. ``spin`` is ω3 in rad/s, signed; None takes it as it comes. ``sun`` (3,) is
    the inertial direction by which a train of pulses keeps its phase; None is along the great circle to ``axis``.
    """

    axis: Vector | None = None
    spin: float | None = None
    sun: Vector | None = None


@dataclass(frozen=True, slots=True)
class Limits:
    """What every schedule keeps, in seconds: ``blackout`` holds the windows in which no pulse may be on.

    ``horizon`` None means `Spacecraft.horizon`'s default.
    """

    horizon: float | None = None
    earliest: float = 0.0
    gap: float = 0.0
    tick: float | None = None
    max_pulses: int | None = None
    blackout: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Keep:
    """The spin axis is to stay from ``least`` to ``most`` rad away from an inertial unit vector ``direction`` (3,)."""

    name: str
    direction: Vector
    least: float = 0.0
    most: float = math.pi

    def used(self, least: Any, largest: Any) -> Any:
        """The share of a bound that is used up where the angles on the way are from ``least`` to ``largest`` rad.

        1 or less is kept. Numbers, or arrays over cases.
        """
        near = (self.least - SLACK) / np.maximum(least, SLACK)
        return np.maximum(near, largest / (self.most + SLACK))
