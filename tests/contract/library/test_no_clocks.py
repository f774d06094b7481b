"""No test depends on how fast the machine is: what has to end is counted in steps (`builders.within`)."""

from __future__ import annotations

import re
from pathlib import Path

from support import places

CLOCKS = re.compile(r"\btimeout *=|\bperf_counter\b|\bmonotonic\b|\btime\.time\b|\bprocess_time\b|\bsetitimer\b")
MEASURING = {"benchmarks", "mutants.py"}


def test_no_test_looks_at_a_clock() -> None:
    root = places.TESTS
    sources = [
        path
        for path in root.rglob("*.py")
        if path != Path(__file__) and not MEASURING & {*path.relative_to(root).parts}
    ]
    found = [
        f"{path.relative_to(root)}:{number}: {line.strip()}"
        for path in sources
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if CLOCKS.search(line)
    ]
    assert len(sources) > 50
    assert found == []
