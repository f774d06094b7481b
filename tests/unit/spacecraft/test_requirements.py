"""Bounds: what keeps them and how much of them is used, and the tolerance of a spin that is required."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.builders import judged, spinner

from nutdamp.spacecraft.model import SLACK, Goal, Keep, Requirement
from nutdamp.spacecraft.requirements import AIMED_SPIN, Bound, Part, cones, required, spin_tolerance, spins_at
from nutdamp.spacecraft.tolerances import SpinTolerance

CONE = Keep("star", np.array([1.0, 0.0, 0.0]), 0.1, 0.5)


def test_no_more_than_all_of_a_bound_that_is_kept_is_used() -> None:
    """Also over cases; edges of cones may be passed by rounding."""
    inner, outer = cones(replace(spinner(), keep=(CONE,)))
    end = Bound(Part.NUTATION, 0.2, True)
    for bound, kept, broken in (
        (end, (0.0, 0.1, 0.2), (0.2 + 1e-8, 3.0)),
        (inner, (3.0, 0.1, 0.1 - 0.9 * SLACK), (0.1 - 1.1 * SLACK, 0.0)),
        (outer, (0.0, 0.5, 0.5 + 0.9 * SLACK), (0.5 + 1.1 * SLACK, 3.0)),
    ):
        values = np.array([*kept, *broken])
        expected = [True] * len(kept) + [False] * len(broken)
        assert bound.met(values).tolist() == expected == [bool(bound.met(value)) for value in values]
        assert (bound.used(values) <= 1.0).tolist() == expected
        assert (bound.margin(values) >= -SLACK).tolist() == expected
    assert (inner.part, inner.inner, outer.inner) == (Part.CONE, True, False)
    (way,) = cones(replace(spinner(), keep=(Keep("H", None, most=0.3),)))
    assert (way.part, way.limit) == (Part.DURING, 0.3)


@pytest.mark.parametrize(
    ("goal", "tolerance", "size"),
    [
        (3.0, None, 0.03),  # 1 % of the goal
        (-3.0, None, 0.03),
        (3.0, SpinTolerance(0.005), 0.015),
        (3.0, SpinTolerance(0.1, relative=False), 0.1),
        (0.0, None, 0.02),  # of a halt: of the spin at t = 0
    ],
)
def test_a_spin_is_required_within_one_percent_of_the_goal_unless_the_file_says_otherwise(
    goal: float, tolerance: SpinTolerance | None, size: float
) -> None:
    requirement = Requirement(spin=tolerance)
    body = replace(spinner(spin=2.0, requirement=requirement), goal=Goal(spin=goal))
    (bound,) = required(body)
    assert (bound.part, bound.required) == (Part.SPIN, True)
    assert bound.limit == pytest.approx(size)
    for off, meets in ((-1.01, False), (-0.99, True), (0.0, True), (0.99, True), (1.01, False)):
        made = judged("a", 0.0, required=requirement, goal=body.goal, spin=goal + off * size)
        assert replace(made, spacecraft=body).meets_requirement is meets
        near = replace(body, omega0=np.array([0.0, 0.0, goal + off * AIMED_SPIN * size]))
        assert goal == 0.0 or spins_at(near, goal) is meets
    assert spin_tolerance(replace(body, requirement=None), 5.0) == 0.05
