"""Benchmarks of the whole command and of the work inside, as ratios of one run.

    python tests/benchmarks/run.py [--runs 9] [--json FILE]

Whole processes take turns with what they are compared with, after one unmeasured turn, so that a machine that slows
down slows them all; times are medians. What a process works inside is timed by `inside.py`, in a process of its own.
A limit that is missed is marked, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import cmath
import json
import math
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple


class Process(NamedTuple):
    """A command, what it is compared with, and the most that its ratio and its peak memory (MiB) may be."""

    name: str
    arguments: tuple[str, ...]
    against: str
    limit: float | None = None
    memory: float | None = None


class Row(NamedTuple):
    """A line of the table. ``ratio`` is to ``against``; ``limit`` the most it may be, or the least (``at_least``)."""

    name: str
    seconds: float
    ratio: float
    against: str
    limit: float | None = None
    at_least: bool = False
    memory: float | None = None
    memory_limit: float | None = None

    @property
    def holds(self) -> bool:
        """Whether the limits are kept."""
        kept = self.limit is None or (self.ratio >= self.limit if self.at_least else self.ratio <= self.limit)
        return kept and (self.memory is None or self.memory_limit is None or self.memory <= self.memory_limit)


BASES = {
    "import click": ("-c", "import click"),
    "import numpy": ("-c", "import numpy"),
    "import scipy.optimize": ("-c", "import scipy.optimize"),
}

NUTDAMP = ("-m", "nutdamp")
DISPERSE = (*NUTDAMP, "disperse", "dispersed.yaml", "--scheme", "two-pulse", "--samples")

PROCESSES = (
    Process("nutdamp --help", (*NUTDAMP, "--help"), "import click", 1.5),
    Process("nutdamp plan", (*NUTDAMP, "plan"), "import numpy", 4.0),
    Process(
        "optimal, 4 channels, 40 periods",
        (*NUTDAMP, "plan", "four.yaml", "--scheme", "optimal"),
        "import scipy.optimize",
        2.5,
    ),
    Process(
        "optimal, 16 channels, 100 periods",
        (*NUTDAMP, "plan", "sixteen.yaml", "--scheme", "optimal"),
        "import scipy.optimize",
        5.0,
    ),
    Process("disperse --impulses, 1e5 cases", (*DISPERSE, "1e5", "--impulses"), "import numpy", None, 250.0),
    Process("disperse --impulses, 1e6 cases", (*DISPERSE, "1e6", "--impulses"), "import numpy", 15.0, 250.0),
    Process("disperse, 2e4 cases", (*DISPERSE, "2e4"), "import numpy", None, 250.0),
    Process("disperse, 1e5 cases", (*DISPERSE, "1e5"), "import numpy", None, 250.0),
)

BODY = """\
name: Benchmark
inertia: {A: 120, C: 80}
state: {spin: 3 rad/s, nutation: 5 deg, phase: 0.7 rad}
"""

DISPERSED = (
    BODY
    + """\
steerable: {torque: 20 N m, isp: 220 s, lever_arm: 1 m}
requirement: {nutation: 1 deg}
dispersions:
  A: {normal: 2 %}
  C: {normal: 2 %}
  omega0: {normal: 0.1 deg/s}
  thrust: {normal: 3 %}
  thrust_per_pulse: {normal: 1 %}
  thrust_direction: {normal: 0.5 deg}
  timing: {uniform: 5 ms}
"""
)
"""Eleven dispersed inputs of a two-pulse plan: A, C, three rates, thrust of the torquer and of two pulses, its
direction, two shifts in time."""


def fan(channels: int, periods: float) -> str:
    """A file with so many channels, evenly spread, and a horizon of so many body nutation periods."""
    horizon = periods * 2 * math.pi / ((120 - 80) / 120 * 3.0)
    thrusters = []
    for index in range(channels):
        torque = cmath.rect(8.0, 0.3 + 2 * math.pi * index / channels)
        thrusters.append(f"  - {{name: T{index}, torque: [{torque.real}, {torque.imag}, 0]}}\n")
    return f"{BODY}thrusters:\n{''.join(thrusters)}limits: {{horizon: {horizon} s}}\n"


def measured(arguments: tuple[str, ...], folder: str) -> tuple[float, float]:
    """Wall time in s and peak memory in MiB of one process."""
    start = time.perf_counter()
    with (Path(folder) / "errors").open("w+b") as errors:
        process = subprocess.Popen(
            [sys.executable, *arguments], cwd=folder, stdout=subprocess.DEVNULL, stderr=errors, env={**os.environ}
        )
        _, status, used = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode not in (0, 4):  # 4: done, and the requirement is missed
            errors.seek(0)
            raise SystemExit(f"{' '.join(arguments)} failed:\n{errors.read().decode()}")
    return seconds, used.ru_maxrss / 1024.0


def processes(runs: int, folder: str) -> list[Row]:
    """All `PROCESSES`, in turn with what they are compared with."""
    commands = {**BASES, **{process.name: process.arguments for process in PROCESSES}}
    times: dict[str, list[float]] = {name: [] for name in commands}
    memory: dict[str, float] = dict.fromkeys(commands, 0.0)
    for turn in range(runs + 1):
        for name, arguments in commands.items():
            seconds, peak = measured(arguments, folder)
            memory[name] = max(memory[name], peak)
            if turn > 0:
                times[name].append(seconds)
    medians = {name: statistics.median(values) for name, values in times.items()}
    return [
        Row(
            process.name,
            medians[process.name],
            medians[process.name] / medians[process.against],
            process.against,
            process.limit,
            memory=memory[process.name],
            memory_limit=process.memory,
        )
        for process in PROCESSES
    ]


def inside(folder: str) -> list[Row]:
    """What `inside.py` measures."""
    script = Path(__file__).with_name("inside.py")
    done = subprocess.run([sys.executable, str(script)], cwd=folder, check=True, capture_output=True, text=True)
    return [Row(**row) for row in json.loads(done.stdout)]


def line(row: Row) -> str:
    """A row as people read it."""
    scale, unit = next((s, u) for s, u in ((1.0, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns")) if row.seconds * s >= 1.0)
    ratio = f"{row.ratio:,.2f}" if row.ratio < 100 else f"{row.ratio:,.0f}"
    limit = "" if row.limit is None else f" (at {'least' if row.at_least else 'most'} {row.limit:,g})"
    peak = "" if row.memory is None else f"{row.memory:5.0f} MiB"
    text = f"{row.name:34} {row.seconds * scale:7.1f} {unit:2} {peak:9}  {ratio:>9} x {row.against}{limit}"
    return text + ("" if row.holds else "  MISSED")


def machine() -> dict[str, Any]:
    """What the numbers belong to."""
    processor = platform.processor() or platform.machine()
    known = Path("/proc/cpuinfo")
    if known.exists():
        names = [text for text in known.read_text("utf-8").splitlines() if text.startswith("model name")]
        processor = names[0].partition(":")[2].strip() if names else processor
    return {"processor": processor, "cores": os.cpu_count(), "python": platform.python_version()}


def main() -> int:
    """Measure, print the table, and tell whether every limit holds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    on = machine()
    print(f"{on['processor']}, {on['cores']} cores, Python {on['python']}, {chosen.runs} runs", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for name, text in (("dispersed", DISPERSED), ("four", fan(4, 40)), ("sixteen", fan(16, 100))):
            (Path(folder) / f"{name}.yaml").write_text(text, encoding="utf-8")
        rows = [*processes(chosen.runs, folder), *inside(folder)]
    for row in rows:
        print(line(row))
    if chosen.json is not None:
        table = [{**row._asdict(), "holds": row.holds} for row in rows]
        chosen.json.write_text(json.dumps({"machine": on, "rows": table}, indent=2) + "\n", encoding="utf-8")
    return 0 if all(row.holds for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
