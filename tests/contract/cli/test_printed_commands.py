"""Every command that a screen or a page prints runs: next steps, commands of notes, those of the report."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.cases import deep
from support.commands import call
from support.markup import parsed
from support.process import Run

from nutdamp.files.reader import example_text
from nutdamp.schemes.catalogue import NAMES

pytestmark = pytest.mark.usefixtures("plans_shared")

VALUE = rf"""(?:"[^"]*"|'[^']*'|FILE|FOLDER|{"|".join(NAMES)}|[^\s;,()]*[\d.=][^\s;,()]*)"""
OPTIONS = rf"(?: --?[a-z][\w-]*(?: {VALUE})?)*"
COMMAND = re.compile(rf"nutdamp (?!explain|init)([a-z]+\b(?: (?:SPACECRAFT|\S+\.yaml))?{OPTIONS})")
INSPECTED = re.compile(r"Inspect one: (?:nutdamp disperse, as here, with )?(?=--)")
NAMES_OF_FILES = {"SPACECRAFT": "spacecraft.yaml", "FILE": "file.csv", "FOLDER": "folder"}


def printed(command: str, shown: str) -> Iterator[str]:
    """The commands of what a ``command`` shows; next steps that are options are added to it."""
    for line in INSPECTED.sub(f"nutdamp {command} ", shown).splitlines():
        yield from COMMAND.findall(line)
        for step in line.split(" · ") if " · " in line else []:
            options = re.findall(f"^{OPTIONS}", f" {step}")
            yield from (command + each for each in options if each)


def check_commands(run: Run, commands: Iterator[str]) -> int:
    """Fails where one of the commands is refused, or is not to be understood; the number of them."""
    named = {re.sub("|".join(NAMES_OF_FILES), lambda name: NAMES_OF_FILES[name[0]], each) for each in commands}
    for command in sorted(named):
        ended = call(run, command)
        assert ended.returncode in (0, 3, 4), f"{command}\n{ended.stderr}"
        assert "Traceback" not in ended.stderr, command
    return len(named)


@pytest.mark.usefixtures("plain_pages")
@pytest.mark.parametrize(
    ("craft", "command", "count"),
    [
        ("example", "plan --scheme two-pulse", 4),
        deep("example", "plan --scheme four-pulse", 4),
        deep("example", "simulate --scheme two-pulse --samples 20", 4),
        ("example", "disperse --scheme two-pulse --samples 50", 3),
        ("example", "disperse --scheme two-pulse --samples 50 -v", 1),
        deep("example", "trade --points 2", 4),
        deep("example", "check", 3),
        deep("lunar-prospector", "plan --scheme command-block", 4),
        deep("upper-stage", "loop --until 8s", 4),
        deep("upper-stage", "disperse --loop --until 6s --samples 20", 3),
        ("upper-stage", "disperse --loop --until 6s --samples 20 -v", 2),
        ("upper-stage", "disperse --loop --until 6s --case 3", 1),
        deep("upper-stage", "budget", 4),
    ],
)
def test_every_command_on_a_screen_runs(run: Run, tmp_path: Path, craft: str, command: str, count: int) -> None:
    """In a folder with that spacecraft file, since next steps name none."""
    (tmp_path / "spacecraft.yaml").write_text(example_text(craft))
    ended = call(run, command, columns=400)
    assert check_commands(run, printed(command, ended.stdout + ended.stderr)) == count


@pytest.mark.deep
@pytest.mark.parametrize("craft", ["example", "lunar-prospector"])
def test_every_command_on_a_page_runs(run: Run, tmp_path: Path, craft: str) -> None:
    (tmp_path / "spacecraft.yaml").write_text(example_text(craft))
    assert call(run, "report spacecraft.yaml --nominal --trade 2 -q").returncode == 0
    assert call(run, "plan spacecraft.yaml --nominal --csv edited.csv").returncode == 0
    page = parsed((tmp_path / "report.html").read_text(encoding="utf-8"))
    texts = (" ".join(node.text.split()) for node in page if node.tag in ("p", "pre", "li", "td"))
    assert check_commands(run, printed("report", "\n".join(texts))) >= 2
