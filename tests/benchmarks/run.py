"""Benchmarks of the whole command and of the work inside, as ratios of one run.

    python tests/benchmarks/run.py [--runs 9] [--json FILE] [--markdown] [--jobs [WORD]]

Whole processes take turns with what they are compared with, after one unmeasured turn, so that a
machine that slows down slows them all; times are medians: of processor time, but of the time passed
where several threads work. `--markdown` prints a table. What a process works inside is timed by
`inside.py`, in a process of its own. `--jobs` measures instead the `JOBS` whose name has the word:
the least processor time, in units of one loop of Python. A limit that is missed is marked, and the
exit status is 1.
"""

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
    """A command, what it is compared with, and the most that its ratio and its peak memory (MiB)
    may be.

    ``threads``: several work, and the time that passes counts.
    """

    name: str
    arguments: tuple[str, ...]
    against: str
    limit: float | None = None
    memory: float | None = None
    threads: bool = False


class Job(NamedTuple):
    """A command, and the most processor time that it may take, in units of `LOOP`."""

    name: str
    arguments: tuple[str, ...]
    goal: float


class Row(NamedTuple):
    """A line of the table. ``ratio`` is to ``against``; ``limit`` the most it may be, or the least
    (``at_least``).
    """

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
        kept = self.limit is None or (
            self.ratio >= self.limit if self.at_least else self.ratio <= self.limit
        )
        return kept and (
            self.memory is None or self.memory_limit is None or self.memory <= self.memory_limit
        )


BASES = {
    "import click": ("-c", "import click"),
    "import numpy": ("-c", "import numpy"),
    "import scipy.optimize": ("-c", "import scipy.optimize"),
}

NUTDAMP = ("-m", "nutdamp")
DISPERSE = (*NUTDAMP, "disperse", "dispersed.yaml", "--scheme", "two-pulse", "--samples")

CASES = Path(__file__).parents[1] / "cases"
CONFIGS = Path(__file__).parents[2] / "configs"
SINK = ("--set", "dissipation={time_constant: 500 s}")


def plan(file: str, *arguments: str) -> tuple[str, ...]:
    """A plan of a file of this folder, or of one of `tests/cases`."""
    path = file if file in ("four.yaml", "sixteen.yaml", "dispersed.yaml") else str(CASES / file)
    return (*NUTDAMP, "plan", path, *arguments)


CLASSIC = tuple(
    part for name in ("one-pulse", "two-pulse", "four-pulse") for part in ("--scheme", name)
)
TO_270 = ("--target", "270deg,-66.56deg")

PROCESSES = (
    Process("nutdamp --help", (*NUTDAMP, "--help"), "import click", 1.4),
    Process("nutdamp plan", (*NUTDAMP, "plan"), "import numpy", 4.5),
    Process("plan, three classic schemes", (*NUTDAMP, "plan", *CLASSIC), "import numpy", 3.0),
    Process(
        "optimal, 4 channels, 40 periods",
        plan("four.yaml", "--scheme", "optimal"),
        "import numpy",
        4.0,
    ),
    Process(
        "optimal, 16 channels, 100 periods",
        plan("sixteen.yaml", "--scheme", "optimal"),
        "import numpy",
        6.0,
    ),
    Process("plan, 4 channels", plan("four.yaml", *CLASSIC), "import numpy"),
    Process(
        "the same with dissipation", plan("four.yaml", *CLASSIC, *SINK), "plan, 4 channels", 1.5
    ),
    Process("geo-dissipation", plan("geo-dissipation.yaml"), "import numpy", 20.0),
    Process(
        "kick-stage, optimal", plan("kick-stage.yaml", "--scheme", "optimal"), "import numpy", 20.0
    ),
    Process("geo-target, 68 deg away", plan("geo-target.yaml", *TO_270), "import numpy", 20.0),
    *(
        Process(name, plan(f"{name}.yaml"), "import numpy", 100.0)
        for name in (
            "slow-89-deg",
            "slow-dissipation",
            "slow-dissipation-two-pulse",
            "slow-goal",
            "slow-optimal",
        )
    ),
    Process("disperse, 2e4 cases", (*DISPERSE, "2e4"), "import numpy", None, 250.0, True),
    Process("disperse, 1e5 cases", (*DISPERSE, "1e5"), "import numpy", None, 250.0, True),
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
"""Eleven dispersed inputs of a two-pulse plan: A, C, three rates, thrust of the torquer and of two
pulses, its direction, two shifts in time.
"""


def fan(channels: int, periods: float) -> str:
    """A file with so many channels, evenly spread,
    and a horizon of so many body nutation periods.
    """
    horizon = periods * 2 * math.pi / ((120 - 80) / 120 * 3.0)
    torques = (cmath.rect(8.0, 0.3 + 2 * math.pi * index / channels) for index in range(channels))
    lines = (
        f"  - {{name: T{at}, torque: [{torque.real}, {torque.imag}, 0]}}\n"
        for at, torque in enumerate(torques)
    )
    return f"{BODY}thrusters:\n{''.join(lines)}limits: {{horizon: {horizon} s}}\n"


LOOP = ("-c", "sum(i*i for i in range(2_000_000))")
"""The unit of jobs: the least processor time of fifteen such processes."""

JOBS = (
    Job("plan, cases counted", (*NUTDAMP, "plan"), 5.0),
    Job("plan --robust", (*NUTDAMP, "plan", "--robust"), 18.0),
    Job("trade", (*NUTDAMP, "trade"), 22.0),
    Job("report", (*NUTDAMP, "report", "-o", "report.html"), 28.0),
    Job("disperse, 2e4 cases", (*DISPERSE, "2e4"), 7.0),
    Job("disperse, 1e6 cases", (*DISPERSE, "1e6"), 50.0),
    Job("plan, ACE by blocks", (*NUTDAMP, "plan", str(CONFIGS / "ace.yaml")), 14.0),
    Job(
        "disperse --loop", (*NUTDAMP, "disperse", "--loop", str(CONFIGS / "upper-stage.yaml")), 80.0
    ),
    Job("verify --loop", (*NUTDAMP, "verify", "--loop", str(CONFIGS / "upper-stage.yaml")), 80.0),
    Job("loop", (*NUTDAMP, "loop", str(CONFIGS / "upper-stage.yaml")), 3.0),
    Job("budget", (*NUTDAMP, "budget", str(CONFIGS / "upper-stage.yaml")), 5.5),
    Job("check", (*NUTDAMP, "check", str(CONFIGS / "magnus-a03.yaml")), 2.2),
    Job("verify", (*NUTDAMP, "verify"), 9.0),
)


class Taken(NamedTuple):
    """Time passed and processor time, s, and peak memory, MiB, of one process."""

    passed: float
    worked: float
    memory: float


def measured(arguments: tuple[str, ...], folder: str) -> Taken:
    """What one process takes."""
    # Compiled modules are kept, as those of an installed program are: the unmeasured turn writes
    # them.
    environment = {
        name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"
    }
    start = time.perf_counter()
    with (Path(folder) / "errors").open("w+b") as errors:
        process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            env=environment,
        )
        _, status, used = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode not in (
            0,
            3,
            4,
        ):  # 3: no schedule is feasible, 4: the requirement is missed
            errors.seek(0)
            raise SystemExit(f"{' '.join(arguments)} failed:\n{errors.read().decode()}")
    return Taken(seconds, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0)


def processes(runs: int, folder: str) -> list[Row]:
    """All `PROCESSES`, in turn with what they are compared with."""
    commands = {**BASES, **{process.name: process.arguments for process in PROCESSES}}
    taken: dict[str, list[Taken]] = {name: [] for name in commands}
    for turn in range(runs + 1):
        for name, arguments in commands.items():
            one = measured(arguments, folder)
            if turn > 0:
                taken[name].append(one)

    def median(name: str, threads: bool) -> float:
        return statistics.median(one.passed if threads else one.worked for one in taken[name])

    return [
        Row(
            process.name,
            median(process.name, process.threads),
            median(process.name, process.threads) / median(process.against, process.threads),
            process.against,
            process.limit,
            memory=max(one.memory for one in taken[process.name]),
            memory_limit=process.memory,
        )
        for process in PROCESSES
    ]


def inside(folder: str) -> list[Row]:
    """What `inside.py` measures."""
    script = Path(__file__).with_name("inside.py")
    done = subprocess.run(
        [sys.executable, str(script)], cwd=folder, check=True, capture_output=True, text=True
    )
    return [Row(**row) for row in json.loads(done.stdout)]


def jobs(runs: int, folder: str, word: str) -> bool:
    """Print the least processor time of the `JOBS` with a ``word`` in their names; True if all keep
    their goals.
    """
    chosen = [job for job in JOBS if word in job.name]
    loop = math.inf
    least = dict.fromkeys(chosen, math.inf)
    for _ in range(runs):
        loop = min(loop, *(measured(LOOP, folder).worked for _ in range(math.ceil(15 / runs))))
        for job in chosen:
            least[job] = min(least[job], measured(job.arguments, folder).worked)
    for job, seconds in least.items():
        missed = "" if seconds <= job.goal * loop else "  MISSED"
        print(f"{job.name:34} {seconds / loop:7.1f} u  (goal {job.goal:g} u){missed}")
    return all(seconds <= job.goal * loop for job, seconds in least.items())


def line(row: Row) -> str:
    """A row as people read it."""
    scale, unit = next(
        (s, u)
        for s, u in ((1.0, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns"))
        if row.seconds * s >= 1.0
    )
    ratio = f"{row.ratio:,.2f}" if row.ratio < 100 else f"{row.ratio:,.0f}"
    limit = (
        "" if row.limit is None else f" (at {'least' if row.at_least else 'most'} {row.limit:,g})"
    )
    peak = "" if row.memory is None else f"{row.memory:5.0f} MiB"
    text = (
        f"{row.name:34} {row.seconds * scale:7.1f} {unit:2} {peak:9}  {ratio:>9} x "
        f"{row.against}{limit}"
    )
    return text + ("" if row.holds else "  MISSED")


def markdown(rows: list[Row]) -> str:
    """The rows as a table in Markdown."""
    lines = ["| what | time | ratio |", "|---|---|---|"]
    for row in rows:
        scale, unit = next(
            (s, u)
            for s, u in ((1.0, "s"), (1e3, "ms"), (1e6, "µs"), (1e9, "ns"))
            if row.seconds * s >= 1
        )
        ratio = f"{row.ratio:.1f}" if row.ratio < 100 else f"{row.ratio:,.0f}"
        lines.append(f"| {row.name} | {row.seconds * scale:.3g} {unit} | {ratio} × {row.against} |")
    return "\n".join(lines)


def machine() -> dict[str, Any]:
    """What the numbers belong to."""
    processor = platform.processor() or platform.machine()
    known = Path("/proc/cpuinfo")
    if known.exists():
        names = [
            text for text in known.read_text("utf-8").splitlines() if text.startswith("model name")
        ]
        processor = names[0].partition(":")[2].strip() if names else processor
    return {"processor": processor, "cores": os.cpu_count(), "python": platform.python_version()}


def main() -> int:
    """Measure, print the table, and tell whether every limit holds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--markdown", action="store_true")
    parser.add_argument("--jobs", metavar="WORD", nargs="?", const="")
    chosen = parser.parse_args()
    on = machine()
    print(
        f"{on['processor']}, {on['cores']} cores, Python {on['python']}, {chosen.runs} runs",
        flush=True,
    )
    with tempfile.TemporaryDirectory() as folder:
        for name, text in (
            ("dispersed", DISPERSED),
            ("four", fan(4, 40)),
            ("sixteen", fan(16, 100)),
        ):
            (Path(folder) / f"{name}.yaml").write_text(text, encoding="utf-8")
        if chosen.jobs is not None:
            return 0 if jobs(chosen.runs, folder, chosen.jobs) else 1
        rows = [*processes(chosen.runs, folder), *inside(folder)]
    if chosen.markdown:
        print(markdown(rows))
    else:
        print(*(line(row) for row in rows), sep="\n")
    if chosen.json is not None:
        table = [{**row._asdict(), "holds": row.holds} for row in rows]
        chosen.json.write_text(
            json.dumps({"machine": on, "rows": table}, indent=2) + "\n", encoding="utf-8"
        )
    return 0 if all(row.holds for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
