"""The benchmarks stay runnable, and no test depends on how fast the machine is (see `builders.within`)."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import Any

import pytest
from support import places

from nutdamp.dispersion.inputs import list_inputs
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.planning import plan

FOLDER = places.TESTS / "benchmarks"
CLOCKS = re.compile(r"\btimeout *=|\bperf_counter\b|\bmonotonic\b|\btime\.time\b|\bprocess_time\b|\bsetitimer\b")
MEASURING = {"benchmarks", "mutants.py", Path(__file__).name}


@pytest.fixture(scope="module")
def run_py() -> dict[str, Any]:
    return runpy.run_path(str(FOLDER / "run.py"))


def test_their_files_are_sound(run_py: dict[str, Any]) -> None:
    body = read_spacecraft(run_py["DISPERSED"], "dispersed.yaml")
    inputs = list_inputs(body, plan(body, "two-pulse").pulses)
    assert (len(inputs.drawn), inputs.unused) == (11, ())
    for channels, periods in ((4, 40.0), (16, 100.0)):
        body = read_spacecraft(run_py["fan"](channels, periods), "fan.yaml")
        assert len(body.channels) == channels
        assert body.horizon / body.body_period == pytest.approx(periods)
    names = {*run_py["BASES"], *(process.name for process in run_py["PROCESSES"])}
    for process in run_py["PROCESSES"]:
        assert process.against in names
        files = {part for part in process.arguments if part.endswith(".yaml")}
        assert all(Path(part).is_file() for part in files - {"four.yaml", "sixteen.yaml", "dispersed.yaml"})


def test_peers_fly_the_same_cases(run_py: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "dispersed.yaml").write_text(run_py["DISPERSED"], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    works = runpy.run_path(str(FOLDER / "inside.py"))["works"]()  # compares solve_ivp with the flight on the way
    assert works["one flight"]() == works["solve_ivp"]() > 10


def test_the_table_of_the_readme_and_missed_limits(run_py: dict[str, Any]) -> None:
    row, line = run_py["Row"], run_py["line"]
    rows = [row("plan", 0.25, 3.04, "import numpy"), row("a case", 3e-7, 5432.1, "faster than it")]
    assert run_py["markdown"](rows).splitlines()[2:] == [
        "| plan | 250 ms | 3.0 × import numpy |",
        "| a case | 300 ns | 5,432 × faster than it |",
    ]
    for ratio, memory, missed in ((1.4, 200.0, False), (1.6, 200.0, True), (1.4, 260.0, True)):
        text = line(row("name", 0.1, ratio, "import numpy", 1.5, memory=memory, memory_limit=250.0))
        assert ("MISSED" in text) is missed
    for ratio, missed in ((4000.0, True), (6000.0, False)):
        assert ("MISSED" in line(row("name", 1e-7, ratio, "faster than it", 5000.0, at_least=True))) is missed


def test_no_test_looks_at_a_clock() -> None:
    sources = [path for path in places.TESTS.rglob("*.py") if not MEASURING & {*path.relative_to(places.TESTS).parts}]
    lines = [
        f"{path}:{number}: {line.strip()}"
        for path in sources
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if CLOCKS.search(line)
    ]
    assert len(sources) > 50
    assert lines == []
