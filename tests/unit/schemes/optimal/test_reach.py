"""What firings for so long at most can supply, against a linear program of another make."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog
from support.builders import cross, spinner
from support.cases import spread

from nutdamp.schemes.optimal import problem, reach
from nutdamp.schemes.options import OptimalOptions
from nutdamp.spacecraft import Limits


@pytest.mark.parametrize("rows", [2, 4, 5])
@pytest.mark.parametrize("seed", range(12))
def test_goals_within_and_beyond_reach_are_told_apart(seed: int, rows: int) -> None:
    """Goals just within and just beyond the farthest multiple that the program reaches."""
    rng = np.random.default_rng(seed)
    most = rng.normal(size=(rows, 300)) * rng.uniform(0.0, 0.02, 300)
    goal = rng.normal(size=rows)
    goal /= np.linalg.norm(goal)
    # The largest s with most @ x = s goal, 0 <= x <= 1.
    equal = np.hstack([most, -goal[:, None]])
    found = linprog([*np.zeros(300), -1.0], A_eq=equal, b_eq=np.zeros(rows), bounds=[(0, 1)] * 300 + [(0, None)])
    assert found.x is not None
    size = float(found.x[-1])
    assert size > 0.01
    for share in (0.3, 0.99, 0.9999):
        assert reach.supplies(most / size, share * goal)
    for share in (1.0001, 1.01, 3.0):
        assert reach.supplies(most / size, share * goal) is False


def test_by_so_much_the_goal_may_be_missed() -> None:
    most, goal = np.eye(4) * 0.5, np.array([0.5, 0.5, 0.9, 0.5])
    assert reach.supplies(most, goal) is False
    assert reach.supplies(most, goal, 0.39) is False
    assert reach.supplies(most, goal, 0.41)


@pytest.mark.deep
@spread("torque", [0.05, 0.02], quick=1)
def test_the_shortest_horizon_is_that_of_the_program(torque: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """By bisection with the linear program alone, and with what is known without it."""
    body = spinner(channels=cross(torque), limits=Limits(horizon=3000.0))
    quick = problem.Problem(body, OptimalOptions())
    assert quick.program(quick.within(200.0)).reachable() is not None
    known = quick.least_horizon(10.0, 3000.0, 1e-3)
    monkeypatch.setattr("nutdamp.schemes.optimal.linear_program.supplies", lambda *_: None)
    assert problem.Problem(body, OptimalOptions()).least_horizon(10.0, 3000.0, 1e-3) == known
