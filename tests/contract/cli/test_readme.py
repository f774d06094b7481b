"""The README is true: its sessions give the output it shows, its file loads, its commands are those of CI; and the
smoke test of CI can fail: it sees tracebacks, wrong exit statuses, missing files and untried commands."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from support import places, smoke
from support.cases import spread
from support.process import Run

from nutdamp import __version__
from nutdamp.cli.main import COMMANDS
from nutdamp.files.reader import read_spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")

ROOT = places.ROOT
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
SESSIONS = re.findall(r"```console\n(.+?)```", TEXT, re.DOTALL)


def tidy(text: str) -> list[str]:
    return [line.rstrip() for line in text.strip().splitlines()]


@spread("session", SESSIONS, quick=1, deep=1, ids=lambda text: str(text).splitlines()[0])
def test_a_session_prints_what_the_readme_shows(run: Run, session: str) -> None:
    for part in re.split(r"^\$ ", session, flags=re.MULTILINE)[1:]:
        command, _, shown = part.partition("\n")
        name, *arguments = shlex.split(command)
        assert name == "nutdamp"
        ended = run(*arguments)
        assert ended.returncode in (0, 4), ended.stderr  # 4: the requirement is missed, which is part of a story
        assert tidy(ended.stdout) == tidy(shown)


def test_what_the_readme_shows_of_files_is_what_is_there() -> None:
    assert len(SESSIONS) >= 2
    (file,) = re.findall(r"```yaml\n(.+?)```", TEXT, re.DOTALL)
    assert read_spacecraft(file, "README.md").name == "Sounder-1"
    (picture,) = re.findall(r"!\[.*?\]\((.+?)\)", TEXT)
    assert (ROOT / picture).is_file()
    assert "<!-- test command -->" in TEXT
    assert "<!-- test command -->" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    example, sweep = re.findall(r"```python\n(.+?)```", TEXT, re.DOTALL)
    for name, code in (("library_example.py", example), ("library_sweep.py", sweep)):
        assert (places.TESTS / "support" / name).read_text(encoding="utf-8").endswith(code)
    assert len(sweep.splitlines()) <= 10  # as the README says
    assert f"nutdamp-{__version__}-py3-none-any.whl" in TEXT
    assert f"- {__version__}: " in TEXT.split("## What changed")[1]


PROGRAM = """#!/bin/sh
case "$*" in
  --version) echo 'Traceback (most recent call last):' >&2 ;;
  --help) printf 'Commands:\\n  fly  Go.\\n  plan  Go.\\n\\n  Exit status.\\n' ;;
esac
"""


@pytest.mark.parametrize(
    ("program", "faults"),
    [
        ("#!/bin/sh\nexit 7\n", ["nutdamp plan missing.yaml: exit status 7, expected 1",
                                "nutdamp --help lists no commands"]),
        (PROGRAM, [
            "nutdamp check smoke.yaml --json check.json: check.json begins with b''",
            "nutdamp --version:\nTraceback",
            "nutdamp fly is not tried here",
            "nutdamp plan --help: exit status 0",
        ]),
    ],
)  # fmt: skip
def test_the_smoke_test_sees_what_is_wrong(tmp_path: Path, program: str, faults: list[str]) -> None:
    path = tmp_path / "program"
    path.write_text(program)
    path.chmod(0o755)
    ended = subprocess.run([sys.executable, smoke.__file__, str(path)], capture_output=True, text=True, check=False)
    assert ended.returncode == 1
    assert [fault for fault in faults if f"FAILED: {fault}" not in ended.stderr] == []


def test_ci_tries_every_command_and_the_lowest_versions_that_are_declared() -> None:
    assert {line.split()[0].rstrip(";") for line in smoke.CALLS} >= set(COMMANDS)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for entry in project["dependencies"] + project["optional-dependencies"]["plot"]:
        # what .ci/run makes of it is then a requirement of exactly this version
        assert re.fullmatch(r"[a-z][a-z0-9-]*>=[0-9.]+", entry)
