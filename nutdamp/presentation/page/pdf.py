"""A page as PDF, printed by a browser of the Chromium family where one is installed."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from nutdamp.errors import CannotWrite

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge", "msedge")
"""What the executables are called on Linux and Windows."""

PLACES = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
)
"""Where macOS keeps them."""

VARIABLE = "NUTDAMP_BROWSER"
"""Environment variable that names another executable."""

PATIENCE = 120.0
"""Seconds after which a browser that has printed nothing is given up."""


def browser() -> str | None:
    """The executable of a browser that can print; None where there is none."""
    named = os.environ.get(VARIABLE)
    if named:
        return shutil.which(named)
    found = (shutil.which(name) for name in (*NAMES, *PLACES))
    return next((path for path in found if path is not None), None)


def needed_browser(path: str) -> str:
    """The executable of a browser that can print ``path``; raises CannotWrite where there is none."""
    executable = browser()
    if executable is None:
        raise CannotWrite(
            path,
            f"a browser prints the PDF, and none is found (looked for {', '.join(NAMES)}); set {VARIABLE} to one, "
            "or write an .html and print that",
        )
    return executable


def printed(page: str, path: str) -> bytes:
    """The HTML ``page`` printed to PDF; ``path`` is where it will go, for messages. Raises CannotWrite.

    The same page gives the same bytes with the same browser, whose version the PDF names.
    """
    executable = needed_browser(path)
    with tempfile.TemporaryDirectory(prefix="nutdamp-", ignore_cleanup_errors=True) as folder:
        source, target = Path(folder) / "page.html", Path(folder) / "page.pdf"
        source.write_text(page, encoding="utf-8")
        command = [
            *(executable, "--headless", "--disable-gpu", "--no-first-run", "--disable-extensions"),
            *(["--no-sandbox"] if _is_root() else []),  # as root its sandbox does not start
            f"--user-data-dir={folder}/profile",
            *("--no-pdf-header-footer", f"--print-to-pdf={target}", source.as_uri()),
        ]
        try:
            done = subprocess.run(command, capture_output=True, timeout=PATIENCE, check=False)
        except (OSError, subprocess.TimeoutExpired) as reason:
            raise CannotWrite(path, f"{executable} printed nothing: {reason}") from reason
        if done.returncode != 0 or not target.exists():
            said = done.stderr.decode(errors="replace").strip().splitlines()
            raise CannotWrite(path, f"{executable} printed nothing: {said[-1] if said else 'it said nothing'}")
        return _settled(target.read_bytes())


def _settled(document: bytes) -> bytes:
    """A PDF without the moment of its printing, and its nodes numbered from 1 on in their order.

    So the same page gives the same bytes. Nothing changes its length, so that the places of objects stay.
    """
    dated = re.sub(rb"/(?:CreationDate|ModDate) \(D:[^)]*\)", lambda found: b" " * len(found[0]), document)
    nodes = re.compile(rb"\(node(\d{8})\)")
    ranks = {number: rank for rank, number in enumerate(sorted(set(nodes.findall(dated))), start=1)}
    return nodes.sub(lambda found: b"(node%08d)" % ranks[found[1]], dated)


def _is_root() -> bool:
    return hasattr(os, "geteuid") and os.geteuid() == 0
