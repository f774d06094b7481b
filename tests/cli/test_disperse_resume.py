"""A run of ``nutdamp disperse`` that is interrupted keeps what is done, and is resumed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from dispersed import FILE
from process import Run
from samples import slow


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


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, slow(signal.SIGTERM)])
def test_an_interrupted_run_keeps_what_is_done(run: Run, body: Path, number: signal.Signals) -> None:
    """The first cases are written, whole; and they are those of a run that requested no more."""
    files = ("--csv", "s.csv", "--json", "s.json", "--resume", "kept.npz")
    status, out, err = interrupted(body, number, "--flown", "--samples", "1e8", *files, wait=".part")
    assert status == 128 + number
    assert "interrupted: " in err
    assert "Traceback" not in err
    assert "Requirement" in out
    assert sorted(path.name for path in body.parent.iterdir()) == ["body.yaml", "kept.npz", "s.csv", "s.json"]
    data = json.loads((body.parent / "s.json").read_text())
    count = data["samples"]
    assert data["interrupted"]
    assert 0 < count < 1e8
    rows = (body.parent / "s.csv").read_text().splitlines()
    assert len(rows) == count + 1
    assert rows[-1].startswith(f"{count},")
    arguments = (
        "disperse",
        "body.yaml",
        "--scheme",
        "two-pulse",
        "--flown",
        "--samples",
        str(count + 700),
        "--json",
        "-",
    )
    resumed = json.loads(run(*arguments, "--resume", "kept.npz").stdout)
    whole = json.loads(run(*arguments).stdout)
    for key in ("samples", "redrawn", "requirement", "shares", "worst"):
        assert resumed[key] == whole[key]


@pytest.mark.slow
def test_a_finished_study_is_resumed_and_extended(run: Run, body: Path) -> None:
    arguments = (
        "disperse",
        "body.yaml",
        "--scheme",
        "two-pulse",
        "--csv",
        "s.csv",
        "--json",
        "-",
        "--resume",
        "kept.npz",
    )
    first = json.loads(run(*arguments, "--samples", "1000").stdout)
    assert json.loads(run(*arguments, "--samples", "1000").stdout) == first
    more = json.loads(run(*arguments, "--samples", "30000").stdout)
    rows = (body.parent / "s.csv").read_text()
    assert more == json.loads(run(*arguments[:-2], "--samples", "30000").stdout)
    assert rows == (body.parent / "s.csv").read_text()
    fewer = run(*arguments, "--samples", "10")
    assert fewer.returncode == 2
    assert "30000 cases are done already" in fewer.stderr
    other = run(*arguments, "--samples", "40000", "--seed", "9")
    assert other.returncode == 2
    assert "another study" in other.stderr
