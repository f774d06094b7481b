"""A browser for the tests of pages: playwright with Chromium, Chrome or Edge."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

NAMES = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "microsoft-edge",
    "msedge",
)
"""What the executables are called on Linux and Windows."""

PLACES = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
)
"""Where macOS keeps them."""


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """A running browser."""
    why = "NOT CHECKED in a browser: "
    playwright = pytest.importorskip(
        "playwright.sync_api",
        reason=f"{why}playwright is not installed: pip install 'nutdamp[browser]'",
    )
    places = (shutil.which(name) for name in (*NAMES, *PLACES))
    executable = next((path for path in places if path is not None), None)
    if executable is None:
        pytest.skip(f"{why}no Chromium, Chrome or Edge is installed")
    root = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=executable, args=root)
        yield browser
        browser.close()


@pytest.fixture
def browse(chromium: Any) -> Callable[..., Any]:
    """Opens a file in a new tab; whatever the browser complains of or fetches from elsewhere fails
    the test.

    ``browse(path, width=1400, scheme="light", **context)`` is entered with ``with``.
    """

    @contextmanager
    def opened(
        path: Path, width: int = 1400, scheme: str = "light", **options: Any
    ) -> Iterator[Any]:
        said: list[str] = []
        context = chromium.new_context(
            viewport={"width": width, "height": 900}, color_scheme=scheme, offline=True, **options
        )
        page = context.new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on(
            "request",
            lambda request: (
                said.append(request.url) if request.url[:5] not in ("file:", "data:") else 0
            ),
        )
        page.goto(path.as_uri())
        yield page
        context.close()
        assert said == []

    return opened


@pytest.fixture
def violations() -> Callable[..., list[tuple[str, str]]]:
    """What an accessibility checker finds on a page, by some ``rules`` alone or all: rule and
    element.
    """
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright",
        reason="NOT CHECKED for accessibility: axe is not installed: "
        "pip install 'nutdamp[browser]'",
    ).Axe()

    def found(page: Any, *rules: str) -> list[tuple[str, str]]:
        options = {"resultTypes": ["violations"], **({"runOnly": rules} if rules else {})}
        broken = axe.run(page, options=options).response["violations"]
        return [(one["id"], node["html"][:200]) for one in broken for node in one["nodes"]]

    return found
