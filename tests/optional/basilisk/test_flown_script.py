"""The script for Basilisk runs as it is, and ends with the residual that the plan has."""

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import messages
from support.builders import present
from support.cases import spread

from nutdamp.planning import plan as planning
from nutdamp.spacecraft.model import Disturbance
from nutdamp.spacecraft.schedule import Pulse, Schedule
from nutdamp.views.exchange import export_text
from nutdamp.views.text import degrees

pytestmark = [pytest.mark.basilisk, pytest.mark.usefixtures("plans_shared")]


@pytest.fixture(autouse=True)
def _installed() -> None:
    reason = "NOT CHECKED against Basilisk, which is not installed: pip install 'nutdamp[verify]'"
    pytest.importorskip("Basilisk", reason=reason)


def check(plan: planning.Plan, folder: Path) -> None:
    """The script prints the plan's residual in a process without nutdamp on its path."""
    script = folder / "fly.py"
    script.write_text(export_text(plan, "basilisk"), encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, "-I", str(script)], cwd=folder, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    lines = (line.split("  ", 1) for line in ran.stdout.splitlines() if "  " in line)
    left = present(plan.flown)
    assert {name.strip(): value.strip() for name, value in lines} == {
        "nutation left": degrees(left.nutation),
        "body cone": degrees(left.body_cone),
        "momentum shift": degrees(left.momentum_shift),
    }


@spread("case", messages.CASES, quick=4, deep=8)
def test_the_residual_is_that_of_the_plan(case: str, tmp_path: Path) -> None:
    check(messages.planned(case), tmp_path)


def test_ideal_impulses_and_disturbances(tmp_path: Path) -> None:
    ideal = planning.plan(replace(messages.spacecraft("prolate"), steerable=None), "one-pulse")
    assert all(pulse.torque is None for pulse in ideal.pulses)
    check(ideal, tmp_path)
    disturbances = (Disturbance(0.05 + 0.02j, axial=0.01), Disturbance(0.03j, rate=-3.0))
    disturbed = planning.plan(
        replace(messages.spacecraft("oblate"), disturbances=disturbances), "two-pulse"
    )
    assert present(disturbed.flown).nutation > math.radians(1e-3)
    check(disturbed, tmp_path)


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
    check(planning.Plan(body, "by hand", Schedule(pulses)), tmp_path)
