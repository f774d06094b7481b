"""Start-up benchmark: whole processes, taken in turn, as ratios of one run.

    python tests/benchmarks/startup.py [--runs 15] [--json FILE]

Each command runs once unmeasured, then all take turns, so that a machine that slows down slows them all. The
ratios are of medians; a limit that is missed is marked, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple


class Case(NamedTuple):
    """A command, what it is compared with, and the most that its ratio may be."""

    name: str
    arguments: tuple[str, ...]
    against: str
    limit: float


BASES = {
    "import click": ("-c", "import click"),
    "import numpy": ("-c", "import numpy"),
}
CASES = (
    Case("nutdamp --help", ("-m", "nutdamp", "--help"), "import click", 1.5),
    Case("nutdamp plan", ("-m", "nutdamp", "plan"), "import numpy", 4.0),
)


def seconds(arguments: tuple[str, ...], folder: str) -> float:
    """Wall time of one process."""
    start = time.perf_counter()
    subprocess.run([sys.executable, *arguments], cwd=folder, check=True, capture_output=True, env={**os.environ})
    return time.perf_counter() - start


def main() -> int:
    """Measure, print the table, and tell whether every limit holds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    commands = {**BASES, **{case.name: case.arguments for case in CASES}}
    times: dict[str, list[float]] = {name: [] for name in commands}
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(chosen.runs + 1):
            for name, arguments in commands.items():
                taken = seconds(arguments, folder)
                if turn > 0:
                    times[name].append(taken)
    medians = {name: statistics.median(values) for name, values in times.items()}
    print(f"Python {platform.python_version()}, {platform.machine()}, {os.cpu_count()} cores, {chosen.runs} runs")
    ratios = {case.name: medians[case.name] / medians[case.against] for case in CASES}
    for case in CASES:
        verdict = "" if ratios[case.name] <= case.limit else "  MISSED"
        print(
            f"{case.name:16} {1e3 * medians[case.name]:7.1f} ms = {ratios[case.name]:.2f} x "
            f"{case.against} (limit {case.limit}){verdict}"
        )
    if chosen.json is not None:
        chosen.json.write_text(json.dumps({"median_s": medians, "ratio": ratios}, indent=2) + "\n", encoding="utf-8")
    return 0 if all(ratios[case.name] <= case.limit for case in CASES) else 1


if __name__ == "__main__":
    sys.exit(main())
