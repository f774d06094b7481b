"""A small linear program, by whichever of the solver's ways gets to its end."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from nutdamp.spacecraft import Vector

WAYS: tuple[tuple[Literal["highs-ds", "highs-ipm"], bool, float], ...] = (
    ("highs-ds", True, 1.0),
    ("highs-ds", False, 1.0),
    ("highs-ds", True, 1e3),
    ("highs-ipm", True, 1.0),
    ("highs-ds", False, 1e-2),
    ("highs-ipm", False, 1e3),
)
"""Method, presolving, and factor of the costs, tried in turn: where the dual simplex loses its way at one scale of the
costs, against which its tolerances count, it mostly does not at another; interior points do not know the trouble."""


MOST_STEPS = 100_000
"""Of the simplex or of the interior points, in one way of solving."""


class Optimum(NamedTuple):
    """Unknowns ``x`` (n,), and ``prices`` (m,): what one more of each right-hand side costs."""

    x: Vector
    prices: Vector


def least(cost: Vector, equal: Vector, right: Vector, most: Vector, below: Vector, limits: Vector) -> Optimum | None:
    """Least ``cost`` @ x with ``equal`` @ x = ``right``, ``below`` @ x ≤ ``limits``, 0 ≤ x ≤ ``most``.

    None where no way of solving it succeeds.
    """
    from scipy.optimize import linprog  # here, because it takes longer to load than most plans

    bounds = [(0.0, upper) for upper in most.tolist()]
    for method, presolve, factor in WAYS:
        found = linprog(
            factor * cost,
            A_eq=equal,
            b_eq=right,
            A_ub=below,
            b_ub=limits,
            bounds=bounds,
            method=method,
            options={"presolve": presolve, "maxiter": MOST_STEPS},
        )
        if found.success and found.x is not None:
            return Optimum(np.asarray(found.x), np.asarray(found.eqlin.marginals) / factor)
    return None
