"""The README is true: its sessions give the output it shows, its file loads, its commands are those of CI."""

from __future__ import annotations

import re
import shlex

import pytest
from support import places
from support.cases import spread
from support.process import Run

from nutdamp import __version__
from nutdamp.files.spacecraft_file import read_spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")

ROOT = places.ROOT
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
SESSIONS = re.findall(r"```console\n(.+?)```", TEXT, re.DOTALL)


def tidy(text: str) -> list[str]:
    return [line.rstrip() for line in text.strip().splitlines()]


@spread("session", SESSIONS, quick=2, deep=0, ids=lambda text: str(text).splitlines()[0])
def test_a_session_prints_what_the_readme_shows(run: Run, session: str) -> None:
    for part in re.split(r"^\$ ", session, flags=re.MULTILINE)[1:]:
        command, _, shown = part.partition("\n")
        name, *arguments = shlex.split(command)
        assert name == "nutdamp"
        done = run(*arguments)
        assert done.returncode in (0, 4), done.stderr  # 4: the requirement is missed, which is part of a story
        assert tidy(done.stdout) == tidy(shown)


def test_there_are_sessions() -> None:
    assert len(SESSIONS) >= 2


def test_the_file_shown_is_a_good_one() -> None:
    (shown,) = re.findall(r"```yaml\n(.+?)```", TEXT, re.DOTALL)
    assert read_spacecraft(shown, "README.md").name == "Sounder-1"


def test_ci_runs_the_test_command_of_the_readme() -> None:
    assert "<!-- test command -->" in TEXT
    assert "<!-- test command -->" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def test_the_picture_is_there() -> None:
    (path,) = re.findall(r"!\[.*?\]\((.+?)\)", TEXT)
    assert (ROOT / path).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("index", "name"), [(0, "library_example.py"), (1, "library_sweep.py")])
def test_the_library_examples_are_those_that_are_run(index: int, name: str) -> None:
    shown = re.findall(r"```python\n(.+?)```", TEXT, re.DOTALL)
    assert len(shown) == 2
    assert (ROOT / "tests" / "support" / name).read_text(encoding="utf-8").endswith(shown[index])


def test_the_sweep_takes_at_most_ten_lines() -> None:
    assert len(re.findall(r"```python\n(.+?)```", TEXT, re.DOTALL)[1].splitlines()) <= 10


def test_the_wheel_and_the_changes_are_those_of_this_version() -> None:
    assert f"nutdamp-{__version__}-py3-none-any.whl" in TEXT
    assert f"- {__version__}: " in TEXT.split("## What changed")[1]
