"""Fixtures for all tests. Nothing is shared between tests but what a test asks for by name."""

import functools
import os
from collections import defaultdict
from collections.abc import Generator, Iterator
from pathlib import Path

# Matrices are small here: several threads to multiply them wait for each other, the more the busier
# the machine is.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import HealthCheck, settings
from support.process import Planner, Run, apart, unpictured, within

from nutdamp.schemes import planner

# The same examples in every run, however slow the machine: a failure in CI is a failure here.
settings.register_profile(
    "project",
    deadline=None,
    derandomize=True,
    max_examples=25,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("project")


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Run the command line in an empty folder, within this process: ``run("plan", "--json",
    "-")``.
    """
    return functools.partial(within, tmp_path)


@pytest.fixture
def run_apart(tmp_path: Path) -> Run:
    """The same as a process of its own, for signals and streams."""
    return functools.partial(apart, tmp_path)


@pytest.fixture(scope="session")
def planned() -> Planner:
    """Plans kept for the session: ``planned(spacecraft, "two-pulse")`` searches once for each body
    and scheme.
    """
    return Planner()


@pytest.fixture
def plans_shared(planned: Planner, monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands and library calls of this test take their schedules from `planned`."""
    monkeypatch.setattr(planner, "schedule", planned.schedule)


@pytest.fixture
def plain_pages() -> Iterator[None]:
    """Pages of `report` have no pictures."""
    with unpictured():
        yield


def pytest_addoption(parser: pytest.Parser) -> None:
    """The option ``--cpu``."""
    parser.addoption(
        "--cpu", type=int, default=0, help="list the N test functions that take most CPU time"
    )


_cpu: dict[str, float] = defaultdict(float)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """CPU time of each function, fixtures included, summed over its cases."""
    start = sum(os.times()[:4])
    try:
        return (yield)
    finally:
        _cpu[item.nodeid.partition("[")[0]] += sum(os.times()[:4]) - start


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """What takes longest, where that is asked for; what could not be checked here is said aloud,
    once a reason.
    """
    if most := terminalreporter.config.getoption("cpu"):
        terminalreporter.write_line(
            f"{sum(_cpu.values()):8.2f} s of CPU in {len(_cpu)} functions (of this process)"
        )
        for name, spent in sorted(_cpu.items(), key=lambda entry: -entry[1])[:most]:
            terminalreporter.write_line(f"{spent:8.2f} s  {name}")
    skipped = terminalreporter.stats.get("skipped", [])
    reasons = {str(report.longrepr[2]) for report in skipped if isinstance(report.longrepr, tuple)}
    for reason in sorted(
        reason.removeprefix("Skipped: ") for reason in reasons if "NOT CHECKED" in reason
    ):
        terminalreporter.write_line(reason, yellow=True)
