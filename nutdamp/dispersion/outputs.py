"""What a study reports of each case: five numbers, and the small vectors of which two are the lengths."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.elementwise import Cases, Triple, parts_of
from nutdamp.dispersion.kernel import Ends

Array = NDArray[np.float64]

OUTPUTS = ("nutation", "momentum_shift", "axis_error", "spin_change", "propellant")
"""In rad, rad, rad, rad/s and kg; the angles are called as the values of `nutdamp.compliance.Part`."""


VECTORS = {
    "nutation": slice(0, 2),
    "momentum_shift": slice(2, 5),
    "axis_error": slice(5, 8),
    "spin_change": slice(8, 9),
    "propellant": slice(9, 10),
}
"""Which rows of `vectors` belong to each output."""

ROWS = 10
"""Rows of `vectors`."""


def measure(model: Model, ends: Ends, out: Array) -> None:
    """The `OUTPUTS` of cases into ``out`` (5, n); propellant is NaN where it is not known."""
    x, y, z = ends.momentum
    sense = math.copysign(1.0, model.spacecraft.spin)
    out[0] = np.arctan2(np.sqrt(x * x + y * y), sense * z) if ends.nutation is None else ends.nutation
    out[1] = angle(ends.before, ends.after)
    out[2] = angle(parts_of(model.target), ends.pointed)
    out[3] = ends.spin_change
    out[4] = np.nan if ends.propellant is None else ends.propellant


def vectors(model: Model, ends: Ends, out: NDArray[Any]) -> None:
    """What varies linearly for small dispersions, into ``out`` (10, n); `VECTORS` names the rows.

    Nutation is the length of the transverse momentum over the axial one, the shift of H that of the change of its
    direction, the axis error that of its direction's distance from the target: lengths of vectors that are zero, or
    nearly, for a good plan, so that they have no derivative themselves. All are in the body axes of t = 0.
    """
    x, y, z = ends.momentum
    sense = math.copysign(1.0, model.spacecraft.spin)
    out[0], out[1] = x * sense / z, y * sense / z
    before, after, pointed = (_unit(vector) for vector in (ends.before, ends.after, ends.pointed))
    for row in range(3):
        out[2 + row] = after[row] - before[row]
        out[5 + row] = pointed[row] - model.target[row]
    out[8] = ends.spin_change
    out[9] = 0.0 if ends.propellant is None else ends.propellant


def _unit(vector: Triple) -> Triple:
    x, y, z = vector
    size = 1.0 / np.sqrt(x * x + y * y + z * z)
    return x * size, y * size, z * size


def angle(first: Triple, second: Triple) -> Cases:
    """Angle between vectors, exact to rounding from 0 to π."""
    (a, b, c), (x, y, z) = first, second
    i, j, k = b * z - c * y, c * x - a * z, a * y - b * x
    return np.arctan2(np.sqrt(i * i + j * j + k * k), a * x + b * y + c * z)
