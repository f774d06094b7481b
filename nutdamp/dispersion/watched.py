"""The directions that the spin axis keeps its distance from, as dispersed cases see them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.cases import DispersedCases, Model
from nutdamp.dispersion.elementwise import rotated
from nutdamp.physics import attitude
from nutdamp.physics.axis_watch import AxisWatch
from nutdamp.spacecraft import Vector


def watch_of(model: Model, cases: DispersedCases) -> AxisWatch:
    """What sees the angles from the spin axis to the directions of the cones, in each of the ``cases``."""
    body, count = model.spacecraft, number_of(cases)
    directions = np.array([in_body(model, cases, count, one.direction) for one in body.keep])
    return AxisWatch.of(directions, math.copysign(1.0, body.spin))


def in_body(model: Model, cases: DispersedCases, count: int, direction: Vector) -> NDArray[np.float64]:
    """An inertial ``direction`` (3,) in the true body axes of t = 0, (3, n)."""
    x, y, z = attitude.rotate(attitude.conjugate(model.spacecraft.initial.quaternion), direction).tolist()
    first, second = cases.tilt
    return np.array([np.broadcast_to(part, count) for part in rotated((x, y, z), (-first, -second))])


def number_of(cases: DispersedCases) -> int:
    """How many cases there are."""
    parts = (*cases.moments, *cases.omega0, *cases.starts, *cases.tilt, *(cases.spent or ()), *(cases.per_kg or ()))
    return max(np.size(part) for part in (*parts, *(part for pulse in cases.impulses for part in pulse)))
