"""Linear programs that grow by columns, solved by HiGHS, and a test of reachability.

All that slots can supply is a convex set, and the point of it that is farthest in a direction is known at once: every
slot whole that helps that way. Wolfe (1976, Mathematical Programming 11) finds the point nearest to the goal from such
corners: it is the goal itself, or its direction proves that the goal lies beyond.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import highspy
import numpy as np

from nutdamp.common import work
from nutdamp.spacecraft.model import Vector

WAYS: tuple[tuple[Literal["simplex", "ipm"], bool, float], ...] = (
    ("simplex", False, 1.0),
    ("simplex", True, 1.0),
    ("simplex", True, 1e3),
    ("ipm", True, 1.0),
    ("simplex", False, 1e-2),
    ("ipm", False, 1e3),
)
"""Method, presolving, and factor of the costs, tried in turn: where the dual simplex loses its way at one scale of the
costs, against which its tolerances count, it mostly does not at another; interior points do not know the trouble."""

MOST_STEPS = 100_000
"""Steps of the simplex or of the interior points, in one way of solving."""

SMALL, NONZERO = 10_000, 1e-2
"""Coefficients other than zero up to which a solution counts for nothing here, and units of `work` of each above it."""


class Optimum(NamedTuple):
    """Unknowns ``x`` (n,), and ``prices`` (m,) of one more of each right-hand side of the equations.

    ``shadows`` are the same of the limits, at most zero.
    """

    x: Vector
    prices: Vector
    shadows: Vector


class GrowingProgram:
    """Least cost @ x with equations and upper limits, 0 ≤ x ≤ most; each column added counts from the next solution on.

    Begins without columns: ``right`` (m,) of the equations, ``limits`` (k,) of the rows that come below them. Equations
    are divided by their ``level`` (m,), which should be about the largest of their coefficients.
    """

    def __init__(self, right: Vector, limits: Vector, level: Vector) -> None:
        self._level = level
        self._costs = np.zeros(0)
        self._highs = _SilentSolver()
        least = np.concatenate([right / level, np.full(len(limits), -highspy.kHighsInf)])
        for lower, upper in zip(least.tolist(), [*(right / level).tolist(), *limits.tolist()], strict=True):
            self._highs.addRow(lower, upper, 0, np.zeros(0, dtype=np.int32), np.zeros(0))

    def add(self, cost: Vector, rows: Vector, most: Vector) -> None:
        """More unknowns: ``cost`` (n,), coefficients ``rows`` (m + k, n) and the ``most`` (n,) that they may be."""
        rows = rows / np.concatenate([self._level, np.ones(len(rows) - len(self._level))])[:, None]
        column, row = np.nonzero(rows.T)
        starts = np.searchsorted(column, np.arange(len(cost))).astype(np.int32)
        values = np.ascontiguousarray(rows.T[column, row])
        self._costs = np.concatenate([self._costs, cost])
        zeros = np.zeros(len(cost))
        self._highs.addCols(len(cost), cost, zeros, most, len(values), starts, row.astype(np.int32), values)

    def limit(self, row: Vector, most: float) -> None:
        """One more limit, of the unknowns (n,) that there are: row @ x ≤ most."""
        used = np.flatnonzero(row)
        self._highs.addRow(-highspy.kHighsInf, most, len(used), used.astype(np.int32), row[used])

    def optimum(self) -> Optimum | None:
        """The cheapest solution, from the last one's basis if there is one; None where no way of solving succeeds."""
        optimum = self._solved(*WAYS[0])
        for way in WAYS:
            if optimum is not None:
                break
            self._highs.clearSolver()
            optimum = self._solved(*way)
        return optimum

    def _solved(self, method: str, presolve: bool, factor: float) -> Optimum | None:
        highs = self._highs
        highs.setOptionValue("solver", method)
        highs.setOptionValue("presolve", "on" if presolve else "off")
        every = np.arange(len(self._costs), dtype=np.int32)
        if factor != 1.0:
            highs.changeColsCost(len(every), every, factor * self._costs)
        work.spend(NONZERO * max(highs.getNumNz() - SMALL, 0))
        if highs.run() == highspy.HighsStatus.kError:
            # Threads are set once in a process, by whoever solves first; zero takes what there is.
            highs.setOptionValue("threads", 0)
            highs.run()
        optimum = None
        if highs.getModelStatus() == highspy.HighsModelStatus.kOptimal:
            solution = highs.getSolution()
            prices, shadows = np.split(np.array(solution.row_dual) / factor, [len(self._level)])
            optimum = Optimum(np.array(solution.col_value), prices / self._level, shadows)
        if factor != 1.0:
            highs.changeColsCost(len(every), every, self._costs)
        return optimum


class _SilentSolver(highspy.Highs):
    """A solver that prints nothing, on one thread, with a bound on its steps."""

    def __init__(self) -> None:
        highspy.Highs.__init__(self)
        self.setOptionValue("output_flag", False)
        self.setOptionValue("threads", 1)
        self.setOptionValue("parallel", "off")
        self.setOptionValue("simplex_iteration_limit", MOST_STEPS)
        self.setOptionValue("ipm_iteration_limit", MOST_STEPS)
        self.setOptionValue("dual_feasibility_tolerance", 1e-9)
        self.setOptionValue("primal_feasibility_tolerance", 1e-9)

    def enableCallbacks(self) -> None:
        """No banner: in highspy 1.16 the constructor calls this, which prints one to stdout, where CSV and JSON go."""
        self.setOptionValue("output_flag", False)
        highspy.Highs.enableCallbacks(self)


CORNERS, FLAT = 3000, 1e-12
"""Corners that are looked at, at most, and share of the weight of one below which it is none."""

MET, BEYOND = 3e-8, 1e-6
"""Distance from the goal that counts as none, over all there is to do, and the share of it by which the goal must lie
beyond the set, for that to be proved in spite of rounding."""


def supplies(most: Vector, goal: Vector, off: float = 0.0) -> bool | None:
    """True where some parts between 0 and 1 of the columns ``most`` (m, n) add up to ``goal`` (m,).

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
        weights_of = np.linalg.lstsq(system, right, rcond=None)[0][1:]
        if np.all(weights_of > FLAT):
            return corners, weights_of / weights_of.sum()
        falling = weights_of <= FLAT
        steps = weights[falling] / np.maximum(weights[falling] - weights_of[falling], 1e-300)
        share = min(float(steps.min()), 1.0)
        weights = (1.0 - share) * weights + share * weights_of
        kept = weights > FLAT
        kept[np.flatnonzero(falling)[int(np.argmin(steps))]] = False
        corners, weights = corners[kept], weights[kept] / weights[kept].sum()
