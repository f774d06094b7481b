"""The README and the guide are true: sessions give the output shown, files load, snippets run, links lead somewhere,
commands are those of CI; and the smoke test of CI can fail: it sees tracebacks, wrong exit statuses, missing files and
untried commands.

With `NUTDAMP_WRITE_TEXTS=1` in the environment the test of the sessions writes the output of today into the pages.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from support import places, smoke
from support.cases import spread
from support.golden import WRITE
from support.guide_pages import pages
from support.process import Run

from nutdamp import __version__
from nutdamp.cli.main import COMMANDS
from nutdamp.files.reader import read_spacecraft
from nutdamp.views import guide

pytestmark = pytest.mark.usefixtures("plans_shared")

ROOT = places.ROOT
README = ROOT / "README.md"
PAGES = (README, *sorted(guide.FOLDER.glob("*.md")))
TEXTS = {page: page.read_text(encoding="utf-8") for page in PAGES}
SESSION = re.compile(r"```console\n(\$ nutdamp .+?)\n```", re.DOTALL)
SESSIONS = [page.stem for page in PAGES if SESSION.search(TEXTS[page]) and page.stem != "motion"]
"""Pages with sessions; the commands of motion draw the figures of the source, and `test_explain` flies them."""
REST = "…"
"""Last line of an output of which only the beginning is shown."""


def tidy(text: str) -> list[str]:
    return [line.rstrip() for line in text.strip().splitlines()]


@spread("name", SESSIONS, quick=1, deep=len(SESSIONS), ids=str)
def test_sessions_print_what_the_pages_show(run: Run, name: str) -> None:
    """Those of a page one after the other, in one folder."""
    (page,) = (page for page in PAGES if page.stem == name)

    def flown(session: re.Match[str]) -> str:
        parts = re.split(r"^\$ ", session[1], flags=re.MULTILINE)[1:]
        return f"```console\n{''.join(outcome(run, part) for part in parts)}```"

    text = TEXTS[page]
    today = SESSION.sub(flown, text)
    if os.environ.get(WRITE):
        page.write_text(today, encoding="utf-8")
    else:
        assert today == text


def outcome(run: Run, part: str) -> str:
    """A command and the output of today, of which as many lines are shown as in ``part``."""
    command, _, shown = part.partition("\n")
    name, *arguments = shlex.split(command)
    assert name == "nutdamp"
    ended = run(*arguments)
    assert ended.returncode in (0, 4), ended.stderr  # 4: the requirement is missed, which is part of a story
    lines = tidy(ended.stdout)
    if (before := tidy(shown))[-1:] == [REST]:
        lines = [*lines[: len(before) - 1], REST]
    return "".join(f"{line}\n" for line in (f"$ {command}", *lines))


def test_what_the_readme_shows_of_files_is_what_is_there() -> None:
    text = TEXTS[README]
    assert len(text.encode()) <= 12_000
    assert "<!-- test command -->" in text
    assert "<!-- test command -->" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    (file,) = re.findall(r"```yaml\n(.+?)```", text, re.DOTALL)
    assert len(file.splitlines()) <= 10
    for page in PAGES:
        for shown in re.findall(r"```yaml\n(.+?)```", TEXTS[page], re.DOTALL):
            assert read_spacecraft(shown, page.name).name == "Sounder-1"
    assert f"- {__version__}: " in TEXTS[guide.FOLDER / "changes.md"]


def test_every_snippet_of_python_is_an_example_that_runs() -> None:
    """`tests/contract/library` runs those examples."""
    snippets = [code for text in TEXTS.values() for code in re.findall(r"```python\n(.+?)```", text, re.DOTALL)]
    examples = ("library_example.py", "library_sweep.py")
    for name, code in zip(examples, snippets, strict=True):
        assert (places.TESTS / "support" / name).read_text(encoding="utf-8").endswith(code)


def test_links_lead_to_pages_and_sections() -> None:
    for page, text in TEXTS.items():
        for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"```.*?```", "", text, flags=re.DOTALL)):
            path, _, section = target.partition("#")
            linked = page if not path else (page.parent / path).resolve()
            assert linked.exists(), (page.name, target)
            assert not section or section in anchors(TEXTS[linked]), (page.name, target)


def anchors(text: str) -> Iterator[str]:
    """The names by which headings can be linked, as GitHub makes them."""
    for heading in re.findall(r"^#+ (.+)$", text, re.MULTILINE):
        yield re.sub(r"[^\w\- ]", "", heading.casefold()).replace(" ", "-")


def test_every_page_is_linked_from_the_readme_and_listed() -> None:
    names = {page.stem for page in PAGES[1:]}
    assert names == {name for _, group in guide.PAGES for name in group}
    assert names <= set(re.findall(r"nutdamp/guide/(\w+)\.md", TEXTS[README]))


def test_pages_that_are_made_are_those_of_today() -> None:
    """`python tests/support/guide_pages.py` writes them."""
    for name, text in pages().items():
        assert TEXTS[guide.FOLDER / f"{name}.md"] == text


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
