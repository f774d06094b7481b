"""The directions that the spin axis keeps its distance from, as dispersed cases see them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.demands import Keep
from nutdamp.dispersion.cases import DispersedCases, Model
from nutdamp.dispersion.elementwise import rotated
from nutdamp.physics import attitude
from nutdamp.physics.axis_watch import AxisWatch
from nutdamp.spacecraft import Spacecraft, Vector

Tilt = tuple[Any, Any]


def watch_of(model: Model, cases: DispersedCases) -> AxisWatch:
    """What sees the angles from the spin axis to the directions of the cones, in each of the ``cases``."""
    return watch_over(model.spacecraft, cases.tilt, number_of(cases))


def watch_over(body: Spacecraft, tilt: Tilt, count: int) -> AxisWatch:
    """The same in so many cases of a ``body`` that begin with their axes off by a ``tilt``, rad, about its 1 and 2."""
    directions = np.array([in_body(body, tilt, count, one.direction) for one in body.keep])
    return AxisWatch.of(directions.reshape(-1, 3, count), math.copysign(1.0, body.spin))


def in_body(body: Spacecraft, tilt: Tilt, count: int, direction: Vector) -> NDArray[np.float64]:
    """An inertial ``direction`` (3,) in the true axes of t = 0 of bodies off by a ``tilt``, (3, n)."""
    x, y, z = attitude.rotate(attitude.conjugate(body.initial.quaternion), direction).tolist()
    return np.array([np.broadcast_to(part, count) for part in rotated((x, y, z), (-tilt[0], -tilt[1]))])


def cones_used(keep: Sequence[Keep], aspects: NDArray[np.float64]) -> NDArray[np.float64]:
    """By cone and case (m, n): what is used up of a cone, see `Keep.used`, by angles (m, 2, n) on the way."""
    return np.array([one.used(*angles) for one, angles in zip(keep, aspects, strict=True)]).reshape(aspects[:, 0].shape)


def number_of(cases: DispersedCases) -> int:
    """How many cases there are."""
    parts = (*cases.moments, *cases.omega0, *cases.starts, *cases.tilt, *(cases.spent or ()), *(cases.per_kg or ()))
    return max(np.size(part) for part in (*parts, *(part for pulse in cases.impulses for part in pulse)))
