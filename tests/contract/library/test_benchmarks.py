"""The benchmarks stay runnable: files are sound, peers do the same work, the table says what was missed."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import pytest
from support import places

from nutdamp.dispersion.inputs import list_inputs
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.planning import plan

FOLDER = places.TESTS / "benchmarks"


@pytest.fixture(scope="module")
def run_py() -> dict[str, Any]:
    return runpy.run_path(str(FOLDER / "run.py"))


def test_the_dispersed_plan_has_eleven_inputs(run_py: dict[str, Any]) -> None:
    body = read_spacecraft(run_py["DISPERSED"], "dispersed.yaml")
    inputs = list_inputs(body, plan(body, "two-pulse").pulses)
    assert len(inputs.drawn) == 11
    assert inputs.unused == ()


@pytest.mark.parametrize(("channels", "periods"), [(4, 40.0), (16, 100.0)])
def test_the_files_for_the_scheme_optimal(run_py: dict[str, Any], channels: int, periods: float) -> None:
    body = read_spacecraft(run_py["fan"](channels, periods), "fan.yaml")
    assert len(body.channels) == channels
    assert body.horizon / body.body_period == pytest.approx(periods)


def test_peers_fly_the_same_cases(run_py: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "dispersed.yaml").write_text(run_py["DISPERSED"], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    works = runpy.run_path(str(FOLDER / "inside.py"))["works"]()  # compares solve_ivp with the flight on the way
    assert works["one flight"]() == works["solve_ivp"]() > 10


def test_the_files_of_the_benchmarks_are_there_and_each_is_compared_with_something(run_py: dict[str, Any]) -> None:
    names = {*run_py["BASES"], *(process.name for process in run_py["PROCESSES"])}
    for process in run_py["PROCESSES"]:
        assert process.against in names
        made = {"four.yaml", "sixteen.yaml", "dispersed.yaml"}
        files = [part for part in process.arguments if part.endswith(".yaml") and part not in made]
        assert all(Path(part).is_file() for part in files)


def test_the_table_of_the_readme(run_py: dict[str, Any]) -> None:
    rows = [run_py["Row"]("plan", 0.25, 3.04, "import numpy"), run_py["Row"]("a case", 3e-7, 5432.1, "faster than it")]
    assert run_py["markdown"](rows).splitlines()[2:] == [
        "| plan | 250 ms | 3.0 × import numpy |",
        "| a case | 300 ns | 5,432 × faster than it |",
    ]


def test_a_missed_limit_is_marked(run_py: dict[str, Any]) -> None:
    row, line = run_py["Row"], run_py["line"]
    assert "MISSED" not in line(row("name", 0.1, 1.4, "import numpy", 1.5, memory=200.0, memory_limit=250.0))
    assert "MISSED" in line(row("name", 0.1, 1.6, "import numpy", 1.5))
    assert "MISSED" in line(row("name", 0.1, 1.4, "import numpy", 1.5, memory=260.0, memory_limit=250.0))
    assert "MISSED" in line(row("name", 1e-7, 4000.0, "faster than solve_ivp", 5000.0, at_least=True))
    assert "MISSED" not in line(row("name", 1e-7, 6000.0, "faster than solve_ivp", 5000.0, at_least=True))
