"""A run of ``nutdamp disperse`` that is interrupted keeps what is done."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.cases import weekly
from support.dispersed import FILE
from support.process import Run


@pytest.fixture
def body(tmp_path: Path) -> Path:
    path = tmp_path / "body.yaml"
    path.write_text(FILE)
    return path


def interrupted(body: Path, number: signal.Signals, *arguments: str, wait: str) -> tuple[int, str, str]:
    """Start a long run, end it by a signal some time after a file whose name contains ``wait`` is there."""
    environment = {**os.environ, "COLUMNS": "80", "NO_COLOR": "1", "PYTHONUTF8": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", "nutdamp", "disperse", "body.yaml", "--scheme", "two-pulse", *arguments],
        cwd=body.parent,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while process.poll() is None:
        if any(wait in path.name and path.stat().st_size > 0 for path in body.parent.iterdir()):
            time.sleep(1.5)
            break
        time.sleep(0.05)
    process.send_signal(number)
    out, err = process.communicate()
    return process.returncode, out, err


@pytest.mark.weekly
@pytest.mark.parametrize("number", [signal.SIGINT, weekly(signal.SIGTERM)])
def test_an_interrupted_run_keeps_what_is_done(run: Run, body: Path, number: signal.Signals) -> None:
    """The first cases are written, whole; and they are those of a run that requested no more."""
    files = ("--csv", "s.csv", "--json", "s.json")
    status, out, err = interrupted(body, number, "--samples", "1e8", *files, wait=".part")
    assert status == 128 + number
    assert "interrupted: " in err
    assert "Traceback" not in err
    assert "Requirement" in out
    assert sorted(path.name for path in body.parent.iterdir()) == ["body.yaml", "s.csv", "s.json"]
    data = json.loads((body.parent / "s.json").read_text())
    count = data["samples"]
    assert data["interrupted"]
    assert 0 < count < 1e8
    rows = (body.parent / "s.csv").read_text().splitlines()
    assert len(rows) == count + 1
    assert rows[-1].startswith(f"{count},")
    requested = ("--scheme", "two-pulse", "--samples", str(count), "--json", "-")
    whole = json.loads(run("disperse", "body.yaml", *requested).stdout)
    for key in ("samples", "redrawn", "requirement", "shares", "worst"):
        assert data[key] == whole[key]
