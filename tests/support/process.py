"""Running the command line: within this process, which is quick, or as a process of its own."""

import contextlib
import io
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from nutdamp.cli.main import main

Run = Callable[..., "subprocess.CompletedProcess[str]"]
"""``run("plan", "--json", "-", stdin=…, columns=80, status=0)`` of the fixtures."""

Status = int | tuple[int, ...] | None
"""The exit status that is right, or all of them; any where it is None."""


def environment(columns: int) -> dict[str, str]:
    """Environment of a command: a screen of ``columns`` without colours."""
    return {"COLUMNS": str(columns), "NO_COLOR": "1", "PYTHONUTF8": "1"}


def checked(
    ended: subprocess.CompletedProcess[str], status: Status
) -> subprocess.CompletedProcess[str]:
    """The command that has ended; fails where its status is not the right one."""
    right = status if isinstance(status, tuple) else (status,)
    assert status is None or ended.returncode in right, (ended.returncode, ended.stderr)
    return ended


def within(
    folder: Path,
    *arguments: str,
    stdin: str | None = None,
    columns: int = 80,
    status: Status = None,
) -> subprocess.CompletedProcess[str]:
    """Run the command line in this process, in ``folder``; a bug of nutdamp is raised."""
    out, err = (
        io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2)
    )
    given = io.TextIOWrapper(io.BytesIO((stdin or "").encode()), encoding="utf-8")
    handler = signal.getsignal(signal.SIGTERM)
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        patch.setattr(sys, "argv", ["nutdamp", *arguments])
        patch.setattr(sys, "stdin", given)
        patch.chdir(folder)
        for name, value in environment(columns).items():
            patch.setenv(name, value)
        try:
            main()
        except SystemExit as leave:
            code = leave.code
        finally:
            signal.signal(signal.SIGTERM, handler)
    assert isinstance(code, int)
    # As a text stream of a process would give them.
    texts = [stream.buffer.getvalue().decode().replace("\r\n", "\n") for stream in (out, err)]
    return checked(subprocess.CompletedProcess(["nutdamp", *arguments], code, *texts), status)


def apart(
    folder: Path,
    *arguments: str,
    stdin: str | None = None,
    columns: int = 80,
    status: Status = None,
) -> subprocess.CompletedProcess[str]:
    """Run the command line as a process of its own in ``folder``."""
    ended = subprocess.run(
        [sys.executable, "-m", "nutdamp", *arguments],
        cwd=folder,
        env={**os.environ, **environment(columns)},
        input=stdin,
        capture_output=True,
        text=True,
        check=False,
    )
    return checked(ended, status)
