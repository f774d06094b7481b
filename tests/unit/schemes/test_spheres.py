"""Bodies within rounding of a sphere are planned as the sphere, by every scheme and whatever moment is the odd one."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from support.builders import aimed, cross, spinner, within
from support.cases import spread
from support.places import case

from nutdamp import planning
from nutdamp.files.check_json import checked_json
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.physics import inertia
from nutdamp.remarks import infeasibility
from nutdamp.schemes import CLASSIC
from nutdamp.spacecraft import Inertia, Spacecraft, Steerable

NEARLY = {
    "first": (100.00000003, 100.0, 100.0),
    "second": (100.0, 100.00000003, 100.0),
    "third": (100.0, 100.0, 100.00000003),
    "third in the middle": (100.0, 100.00000006, 100.00000003),
}


@pytest.mark.parametrize("moments", NEARLY.values(), ids=NEARLY)
def test_plan_and_check_agree_that_it_is_a_sphere(moments: tuple[float, float, float], tmp_path: Path) -> None:
    text = case("near-sphere-2.yaml").read_text()
    rows = np.diag(moments).tolist()
    line = next(one for one in text.splitlines() if one.startswith("inertia"))
    body = read_spacecraft(text.replace(line, f"inertia: {{tensor: {rows}}}"), "near.yaml")
    assert body.inertia.a == 0.0
    assert body.inertia.symmetric
    assert body.inertia.shape == "sphere"
    assert math.isinf(body.body_period)
    found = checked_json("near.yaml", body)
    assert found["spin_axis"]["class"] == "sphere"
    for scheme in ("one-pulse", "two-pulse", "four-pulse"):
        plan = planning.plan(body, scheme)
        assert plan.feasible, infeasibility(plan)
        assert plan.flown is not None
        assert plan.flown.nutation < 1e-9


@pytest.mark.parametrize("name", ["near-sphere-1.yaml", "near-sphere-2.yaml"])
def test_moments_equal_to_a_rounding_are_planned(name: str) -> None:
    plan = planning.plan(read_spacecraft(case(name).read_text(), name), "two-pulse")
    assert plan.flown is not None, infeasibility(plan)
    assert plan.flown.nutation < 1e-9


def bodies(moments: tuple[float, float, float]) -> list[Spacecraft]:
    plain = [
        spinner(moments=moments, phase=math.pi, channels=cross(8.0)),
        spinner(moments=moments, phase=0.7, channels=cross(8.0), spin=-3.0),
        spinner(moments=moments, degrees=60.0, steerable=Steerable(20.0)),
    ]
    return [*plain, *(aimed(body, 10.0, 30.0) for body in plain)]


@spread("scheme", [*CLASSIC, "half-cone", "rhumb-line"], quick=1)
@spread("off", [1e-15, 0.9e-9, 1.1e-9, 1e-12, 1e-8], quick=3)
def test_on_either_side_of_the_tolerance_every_scheme_answers(off: float, scheme: str) -> None:
    """The sphere within it; beyond it a body whose nutation takes years to turn in the body."""
    for moments in (
        (100.0 * (1 + off), 100.0, 100.0),
        (100.0, 100.0 * (1 + 2 * off), 100.0 * (1 + off)),
        (100.0, 100.0, 100.0 * (1 - off)),
    ):
        if off > inertia.DEGENERATE and moments[0] != moments[1]:
            continue  # no spin about an axis of the middle moment
        assert (Inertia(moments).a == 0.0) == (off <= inertia.DEGENERATE)
        for body in bodies(moments):
            with within(10_000_000):
                plan = planning.plan(body, scheme)
                left = plan.flown
            assert (left is None) == (infeasibility(plan) != "")
            if left is not None:
                assert np.isfinite([left.nutation, left.momentum_shift, left.axis_error]).all()
