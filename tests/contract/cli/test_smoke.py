"""The smoke test of CI can fail: it sees tracebacks, wrong exit statuses, missing files and untried commands."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from support import places, smoke

from nutdamp.cli.root import COMMANDS

ROOT = places.ROOT


@pytest.mark.parametrize(
    ("script", "fault"),
    [
        ("exit 0", "nutdamp check smoke.yaml --json check.json: check.json begins with b''"),
        ("exit 0", "nutdamp --help lists no commands"),
        ("echo 'Traceback (most recent call last):' >&2", "nutdamp --version:\nTraceback"),
        ("exit 7", "nutdamp plan missing.yaml: exit status 7, expected 1"),
        ("printf 'Commands:\\n  fly  Go.\\n\\n  Exit status.\\n'", "nutdamp fly is not tried here"),
        ("printf 'Commands:\\n  plan  Go.\\n'", "nutdamp plan --help: exit status 0"),
    ],
)
def test_what_is_wrong_is_seen(tmp_path: Path, script: str, fault: str) -> None:
    program = tmp_path / "program"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    done = subprocess.run([sys.executable, smoke.__file__, str(program)], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert f"FAILED: {fault}" in done.stderr


def test_every_command_is_tried() -> None:
    assert {line.split()[0].rstrip(";") for line in smoke.CALLS} >= set(COMMANDS)


def test_ci_tries_the_lowest_versions_that_are_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for entry in project["dependencies"] + project["optional-dependencies"]["plot"]:
        # what .ci/run makes of it is then a requirement of exactly this version
        assert re.fullmatch(r"[a-z][a-z0-9-]*>=[0-9.]+", entry)
