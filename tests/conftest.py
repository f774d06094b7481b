"""Fixtures for all tests."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# Matrices are small here: several threads to multiply them wait for each other, the more the busier the machine is.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import HealthCheck, settings
from pages import unpictured
from planned_once import Planner
from process import Run, apart, within
from samples import mark_few

from nutdamp import schemes

PLANNED_ONCE = (
    "cli",
    "presentation",
    "files",
    "test_library_results.py",
    "test_readme.py",
    "test_verification.py",
    "test_where_it_points.py",
)
"""Folders and modules of tests of what is made of plans: these may share them."""

# The same examples in every run, however slow the machine: a failure in CI is a failure here.
settings.register_profile("project", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("project")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What the marks ``few``, ``orekit`` and ``browser`` say.

    Orekit's Java machine and the solver do not share a process well, and a browser takes as long as a sixth of all
    other tests: these run when they are requested.
    """
    mark_few(items)
    for mark, what in (("orekit", "against Orekit"), ("browser", "in a browser")):
        if mark not in config.getoption("markexpr"):
            for item in items:
                if mark in item.keywords:
                    item.add_marker(pytest.mark.skip(reason=f"NOT CHECKED {what} here: pytest -m {mark}"))


@pytest.fixture(autouse=True, scope="module")
def _nothing_kept(request: pytest.FixtureRequest) -> Iterator[None]:
    """What functions of a module of tests have cached (hundreds of figures) goes with the last test of the module."""
    yield
    for found in vars(request.module).values():
        if hasattr(found, "cache_clear") and found.__module__ == request.module.__name__:
            found.cache_clear()


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Run the command line in an empty folder, within this process: ``run("plan", "--json", "-")``."""
    return functools.partial(within, tmp_path)


@pytest.fixture
def run_apart(tmp_path: Path) -> Run:
    """The same as a process of its own, for what only a process shows."""
    return functools.partial(apart, tmp_path)


@pytest.fixture
def plain_pages() -> Iterator[None]:
    """Pages of `report` have no pictures."""
    with unpictured():
        yield


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """A running browser."""
    from browser_finder import browser as found

    why = "NOT CHECKED in a browser: "
    playwright = pytest.importorskip(
        "playwright.sync_api", reason=f"{why}playwright is not installed: pip install 'nutdamp[browser]'"
    )
    executable = found()
    if executable is None:
        pytest.skip(f"{why}no Chromium, Chrome or Edge is installed")
    root = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=executable, args=root)
        yield browser
        browser.close()


@pytest.fixture
def browse(chromium: Any) -> Callable[..., Any]:
    """Opens a file in a new tab; whatever the browser complains of or fetches from elsewhere fails the test.

    ``browse(path, width=1400, scheme="light", **context)`` is entered with ``with``.
    """

    @contextmanager
    def opened(path: Path, width: int = 1400, scheme: str = "light", **options: Any) -> Iterator[Any]:
        said: list[str] = []
        context = chromium.new_context(
            viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True, **options
        )
        page = context.new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: said.append(request.url) if request.url[:5] not in ("file:", "data:") else 0)
        page.goto(path.as_uri())
        yield page
        context.close()
        assert said == []

    return opened


_planner = Planner()


@pytest.fixture(autouse=True)
def _planned_once(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """In some folders, what is planned once is kept for all tests there; the mark ``plans_anew`` says which do not."""
    folders = request.path.relative_to(Path(__file__).parent).parts
    if folders[0] in PLANNED_ONCE and "plans_anew" not in request.keywords:
        monkeypatch.setattr(schemes, "schedule", _planner.schedule)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """What could not be checked on this machine is said aloud, once for each reason."""
    skipped = terminalreporter.stats.get("skipped", [])
    reasons = {str(report.longrepr[2]) for report in skipped if isinstance(report.longrepr, tuple)}
    for reason in sorted(reason.removeprefix("Skipped: ") for reason in reasons if "NOT CHECKED" in reason):
        terminalreporter.write_line(reason, yellow=True)
