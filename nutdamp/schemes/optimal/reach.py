"""Whether firings for at most so long each supply a goal: the nearest point of what they can supply.

All that slots can supply is a convex set, and the point of it that is farthest in a direction is known at once: every
slot whole that helps that way. Wolfe (1976, Mathematical Programming 11) finds the point nearest to the goal from such
corners: it is the goal itself, or its direction proves that the goal lies beyond.
"""

from __future__ import annotations

import numpy as np

from nutdamp.spacecraft import Vector

CORNERS = 3000
"""Corners that are looked at, at most."""

MET = 3e-8
"""Distance from the goal that counts as none, over all there is to do."""

BEYOND = 1e-6
"""Share of the distance by which the goal must lie beyond the set, for that to be proved in spite of rounding."""

FLAT = 1e-12
"""Share of a corner's weight below which it is none."""


def supplies(most: Vector, goal: Vector, off: float = 0.0) -> bool | None:
    """Whether some parts between 0 and 1 of the columns ``most`` (m, n) add up to ``goal`` (m,).

    ``off``: by how much its rows 2 and 3 may be missed, in norm. None where that is not known after `CORNERS`.
    """

    def corner(direction: Vector) -> Vector:
        """The point of what can be supplied, less the goal, that lies least far along ``direction``."""
        point = most @ (direction @ most < 0.0) - goal
        if off > 0.0 and (size := float(np.linalg.norm(direction[2:4]))) > 0.0:
            point[2:4] -= off / size * direction[2:4]
        return np.asarray(point)

    corners = -goal[None, :]
    weights = np.ones(1)
    for _ in range(CORNERS):
        nearest = weights @ corners
        distance = float(np.linalg.norm(nearest))
        if distance <= MET:
            return True
        new = corner(nearest / distance)
        ahead = float(nearest @ new) / distance
        if ahead > BEYOND * distance and ahead > MET:
            return False
        if ahead >= distance * (1.0 - FLAT):
            return None
        corners, weights = _nearest(np.vstack([corners, new]), np.append(weights, 0.0))
    return None


def _nearest(corners: Vector, weights: Vector) -> tuple[Vector, Vector]:
    """Corners (k, m) and weights (k,) of the point nearest to zero in their hull, those without weight left out."""
    while True:
        count = len(corners)
        system = np.ones((count + 1, count + 1))
        system[0, 0] = 0.0
        system[1:, 1:] = corners @ corners.T
        right = np.zeros(count + 1)
        right[0] = 1.0
        found = np.linalg.lstsq(system, right, rcond=None)[0][1:]
        if np.all(found > FLAT):
            return corners, found / found.sum()
        falling = found <= FLAT
        steps = weights[falling] / np.maximum(weights[falling] - found[falling], 1e-300)
        share = min(float(steps.min()), 1.0)
        weights = (1.0 - share) * weights + share * found
        kept = weights > FLAT
        kept[np.flatnonzero(falling)[int(np.argmin(steps))]] = False
        corners, weights = corners[kept], weights[kept] / weights[kept].sum()
