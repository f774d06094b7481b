"""Fixtures for all tests."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest
from hypothesis import settings
from process import Run, apart, within

# The same examples in every run, however slow the machine: a failure in CI is a failure here.
settings.register_profile("project", deadline=None, derandomize=True)
settings.load_profile("project")


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Run the command line in an empty folder, within this process: ``run("plan", "--json", "-")``."""
    return functools.partial(within, tmp_path)


@pytest.fixture
def run_apart(tmp_path: Path) -> Run:
    """The same as a process of its own, for what only a process shows."""
    return functools.partial(apart, tmp_path)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """What could not be checked on this machine is said aloud, once for each reason."""
    skipped = terminalreporter.stats.get("skipped", [])
    reasons = {str(report.longrepr[2]) for report in skipped if isinstance(report.longrepr, tuple)}
    for reason in sorted(reason.removeprefix("Skipped: ") for reason in reasons if "NOT CHECKED" in reason):
        terminalreporter.write_line(reason, yellow=True)
