"""What ``nutdamp check`` says of dispersions: what could be drawn, and what touches nothing that can fire."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.process import Run

pytestmark = pytest.mark.usefixtures("plans_shared")

DISPERSED = """\
name: Sat
inertia: {A: 120, C: 80}
omega0: [0.1, 0.2, 3]
thrusters:
  - {name: left 1, position: [0, 0.3, 0.8], direction: [0, -1, 0], force: 10 N}
  - {name: T2, torque: [0, 8, 0]}
  - {name: T3, torque: [0, -8, 0]}
channels: {+: [left 1], -: [T2]}
dispersions:
  A: {normal: 0}
  thrust: {normal: 3 %}
  thrust_direction: {normal: 0.5 deg}
  timing: {uniform: 5 ms}
"""


def test_the_table_of_dispersions(run: Run, tmp_path: Path) -> None:
    (tmp_path / "sat.yaml").write_text(DISPERSED, encoding="utf-8")
    done = run("check", "sat.yaml")
    assert done.returncode == 0
    rows = [" ".join(line.split()) for line in done.stdout.splitlines()]
    assert "thrust normal 3 % left 1, T2" in rows
    assert "thrust direction normal 0.5 deg left 1" in rows
    assert "timing uniform 2.89 ms" in rows
    idle = "\n".join(rows[rows.index("Dispersions without effect on anything that fires") :])
    assert "A its size is zero" in idle
    assert "direction T2 the file gives only its torque" in idle
    assert "thrust T3, direction T3 no channel fires T3" in idle


def test_the_same_as_json(run: Run, tmp_path: Path) -> None:
    (tmp_path / "sat.yaml").write_text(DISPERSED, encoding="utf-8")
    found = json.loads(run("check", "sat.yaml", "--json", "-").stdout)["files"][0]["dispersions"]
    assert [entry["name"] for entry in found["inputs"]] == [
        "thrust left 1",
        "thrust T2",
        "direction left 1 a",
        "direction left 1 b",
        "timing of each pulse",
    ]
    assert set(found["unused"]) == {"A", "thrust T3", "direction T2", "direction T3"}


def test_a_file_without_dispersions(run: Run, tmp_path: Path) -> None:
    (tmp_path / "sat.yaml").write_text(DISPERSED.partition("dispersions:")[0], encoding="utf-8")
    assert "dispersion" not in run("check", "sat.yaml").stdout
    assert json.loads(run("check", "sat.yaml", "--json", "-").stdout)["files"][0]["dispersions"] is None
