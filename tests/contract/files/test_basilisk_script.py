"""The script for Basilisk as it stands; `tests/optional/basilisk` runs it."""

from __future__ import annotations

import ast
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import messages
from support.contract import known

from nutdamp.files.exchange import export_text
from nutdamp.physics.arc_cones import arc_cones
from nutdamp.physics.feed import Tank

pytestmark = pytest.mark.usefixtures("plans_shared")


def test_it_is_python_with_the_schedule_in_the_axes_of_the_file() -> None:
    plan = messages.planned("tilted tensor, backwards")
    tank = Tank(2.0, 22e5, 16e5, 1.0)
    named = replace(plan, spacecraft=replace(plan.spacecraft, name='a """ name \\ of {many} parts', tank=tank))
    tree = ast.parse(export_text(named, "basilisk"))
    values = {
        node.targets[0].id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    schedule = ast.literal_eval(values["SCHEDULE"])
    firing = [(duration, torque) for name, duration, torque in schedule if name != "coast"]
    for (duration, torque), pulse in zip(firing, plan.pulses, strict=True):
        assert duration == pytest.approx(pulse.on_time, rel=1e-12)
        in_file = messages.in_file_axes(plan.spacecraft, known(pulse.torque))
        assert torque == pytest.approx(in_file, rel=1e-12, abs=1e-12)
    assert sum(duration for _, duration, _ in schedule) == pytest.approx(plan.pulses.end, rel=1e-14)


@pytest.mark.parametrize("moments", [(100.0, 130.0, 180.0), (130.0, 100.0, 80.0), (120.0, 120.0, 80.0)])
def test_the_cones_that_the_script_prints_are_those_of_the_residual(moments: tuple[float, float, float]) -> None:
    """The function alone, as it stands in the script."""
    parsed = ast.parse(export_text(messages.planned("prolate"), "basilisk"))
    (cones,) = (node for node in parsed.body if isinstance(node, ast.FunctionDef) and node.name == "largest_cones")
    names: dict[str, Any] = {"math": math, "PRINCIPAL_MOMENTS": np.array(moments)}
    exec(compile(ast.Module([cones], []), "fly.py", "exec"), names)
    for rates in ([0.4, 0.1, 2.0], [0.1, -0.4, -2.0], [1e-6, 1e-7, 2.0]):
        for sense in (1.0, -1.0):
            expected = tuple(arc_cones(moments, rates, sense))
            assert names["largest_cones"](np.array(rates), sense) == pytest.approx(expected, rel=1e-9)
