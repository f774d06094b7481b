"""The script for Basilisk runs as it is, and ends with the residual that the plan has."""

from __future__ import annotations

import ast
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import messages
from support.cases import spread

from nutdamp import planning
from nutdamp.errors import BadRequest
from nutdamp.files.exchange import export_text
from nutdamp.physics.arc_cones import arc_cones
from nutdamp.physics.feed import Tank
from nutdamp.planning import Plan
from nutdamp.presentation.text import degrees
from nutdamp.schedule import Pulse, Schedule
from nutdamp.spacecraft import Disturbance

pytestmark = pytest.mark.usefixtures("plans_shared")


@pytest.fixture(autouse=True)
def _installed(request: pytest.FixtureRequest) -> None:
    if request.node.get_closest_marker("basilisk"):
        pytest.importorskip(
            "Basilisk", reason="NOT CHECKED against Basilisk, which is not installed: pip install 'nutdamp[verify]'"
        )


def run(plan: Plan, folder: Path) -> dict[str, str]:
    """What the script prints, by name; it runs in a process without nutdamp's folder on the path."""
    script = folder / "fly.py"
    script.write_text(export_text(plan, "basilisk"), encoding="utf-8")
    done = subprocess.run([sys.executable, "-I", str(script)], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return dict(line.split("  ", 1) for line in done.stdout.splitlines() if "  " in line)


def check(plan: Plan, folder: Path) -> None:
    printed = {name.strip(): value.strip() for name, value in run(plan, folder).items()}
    left = plan.flown
    assert left is not None
    assert printed == {
        "nutation left": degrees(left.nutation),
        "body cone": degrees(left.body_cone),
        "shift of H": degrees(left.momentum_shift),
    }


@pytest.mark.deep
@pytest.mark.basilisk
@spread("case", messages.CASES, quick=4)
def test_the_residual_is_that_of_the_plan(case: str, tmp_path: Path) -> None:
    check(messages.planned(case), tmp_path)


@pytest.mark.deep
@pytest.mark.basilisk
def test_ideal_impulses_and_disturbances(tmp_path: Path) -> None:
    ideal = planning.plan(replace(messages.spacecraft("prolate"), steerable=None), "one-pulse")
    assert all(pulse.torque is None for pulse in ideal.pulses)
    check(ideal, tmp_path)
    disturbances = (Disturbance(0.05 + 0.02j, axial=0.01), Disturbance(0.03j, rate=-3.0))
    disturbed = planning.plan(replace(messages.spacecraft("oblate"), disturbances=disturbances), "two-pulse")
    assert disturbed.flown is not None
    assert disturbed.flown.nutation > math.radians(1e-3)
    check(disturbed, tmp_path)


@pytest.mark.deep
@pytest.mark.basilisk
@pytest.mark.parametrize("case", ["prolate", "tilted tensor, backwards", "ace"])
def test_a_schedule_that_leaves_nutation(case: str, tmp_path: Path) -> None:
    """Overlapping pulses with axial parts, at times that no clock of nanoseconds knows."""
    body = messages.spacecraft(case)
    scale = 0.1 * body.least_impulse
    pulses = tuple(
        Pulse(t, on_time, name, scale * np.array(torque) * on_time, scale * np.array(torque))
        for t, on_time, name, torque in (
            (1.0 / 3.0, 0.1 * math.pi, "A", [1.0, -0.5, 0.1]),
            (0.5, 0.3, "B", [0.0, 1.0, -0.2]),
            (math.e, 1.234567890123, 'it\'s "C"', [0.3, 0.4, 0.0]),
        )
    )
    check(Plan(body, "by hand", Schedule(pulses)), tmp_path)


def test_it_is_python_with_the_schedule_in_the_axes_of_the_file() -> None:
    plan = messages.planned("tilted tensor, backwards")
    named = replace(plan, spacecraft=replace(plan.spacecraft, name='a """ name \\ of {many} parts'))
    tree = ast.parse(export_text(named, "basilisk"))
    values = {
        node.targets[0].id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    schedule = ast.literal_eval(values["SCHEDULE"])
    firing = [(duration, torque) for name, duration, torque in schedule if name != "coast"]
    assert len(firing) == len(plan.pulses)
    for (duration, torque), pulse in zip(firing, plan.pulses, strict=True):
        assert duration == pytest.approx(pulse.on_time, rel=1e-12)
        assert pulse.torque is not None
        assert torque == pytest.approx(messages.in_file_axes(plan.spacecraft, pulse.torque), rel=1e-12, abs=1e-12)
    assert sum(duration for _, duration, _ in schedule) == pytest.approx(plan.pulses.end, rel=1e-14)


def test_dissipation_is_refused() -> None:
    plan = messages.planned("prolate")
    with pytest.raises(BadRequest, match="leave dissipation out"):
        export_text(replace(plan, spacecraft=replace(plan.spacecraft, dissipation=600.0)), "basilisk")


def test_falling_moments_are_refused() -> None:
    plan = messages.planned("prolate")
    tank = Tank(2.0, 22e5, 16e5, 1.0, inertia_per_kg=(0.4, 0.4, 0.3))
    with pytest.raises(BadRequest, match=r"leave tank\.inertia_per_kg out"):
        export_text(replace(plan, spacecraft=replace(plan.spacecraft, tank=tank)), "basilisk")
    assert export_text(
        replace(plan, spacecraft=replace(plan.spacecraft, tank=replace(tank, inertia_per_kg=None))), "basilisk"
    )


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("moments", [(100.0, 130.0, 180.0), (130.0, 100.0, 80.0), (120.0, 120.0, 80.0)])
def test_the_cones_that_the_script_prints_are_those_of_the_residual(
    moments: tuple[float, float, float], sense: float
) -> None:
    """Without Basilisk: the function alone, as it stands in the script."""
    script = export_text(planning.plan(messages.spacecraft("prolate"), "one-pulse"), "basilisk")
    wanted: list[ast.stmt] = [
        node for node in ast.parse(script).body if isinstance(node, ast.FunctionDef) and node.name == "largest_cones"
    ]
    names: dict[str, Any] = {"math": math, "PRINCIPAL_MOMENTS": np.array(moments)}
    exec(compile(ast.Module(wanted, []), "fly.py", "exec"), names)
    for rates in ([0.4, 0.1, 2.0], [0.1, -0.4, -2.0], [1e-6, 1e-7, 2.0]):
        expected = arc_cones(moments, rates, sense)
        assert names["largest_cones"](np.array(rates), sense) == pytest.approx(tuple(expected), rel=1e-9)
