"""Commands as users run them: what refused ones say, and the JSON, CSV and folders of others."""

import csv
import io
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rich.console import Console, RenderableType
from support.process import Run, Status, environment

EXACT = "name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n"
"""The shortest spacecraft file: ideal impulses, and no requirement."""
DATED = """
name: Dated
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg, phase: 40 deg}
attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [0.3, -0.2, 0.9, 0.1]}
steerable: {torque: 20 N m}
"""
WIDER = {
    "A": "0.5 %", "C": "0.5 %", "omega0": "0.1 deg/s", "thrust": "2 %", "thrust_per_pulse": "1 %",
    "thrust_direction": "0.5 deg", "position": "5 mm", "attitude": "0.2 deg",
}  # fmt: skip
"""Tolerances of the built-in example with which no nominal plan complies often enough."""
WIDE = [
    part
    for key, size in WIDER.items()
    for part in ("--set", f"dispersions.{key}={{normal: {size}}}")
]
"""Sets them."""
BUILT_IN = "warning: no spacecraft file given: using the built-in example (see `nutdamp init`)\n"
"""First line of standard error where no file is named, with -q too."""
SCHEDULE = "t_s,on_time_s,channel,impulse_1_Nms,impulse_2_Nms,impulse_3_Nms\n1,0,steerable,4,0,0\n"


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a folder, by its path there."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def names(folder: Path) -> list[str]:
    """What is in a folder."""
    return sorted(path.name for path in folder.iterdir())


def written(folder: Path, **files: str) -> None:
    """Write files: ``written(folder, craft_yaml="name: X")`` writes craft.yaml."""
    for name, text in files.items():
        (folder / name.replace("_", ".")).write_text(text, encoding="utf-8")


def refusals(
    run: Run, folder: Path, commands: Iterable[str], status: int = 2, stdin: str | None = None
) -> str:
    """What each of the commands says, behind it; none prints a result or touches a file."""
    before = contents(folder)
    said = []
    for command in commands:
        refused = run(*shlex.split(command.replace("FOLDER", str(folder))), stdin=stdin)
        assert (refused.returncode, refused.stdout) == (status, ""), command
        assert "Traceback" not in refused.stderr, command
        assert contents(folder) == before, command
        shown = (
            refused.stderr.removeprefix(BUILT_IN)
            .rpartition("\nError: ")[2]
            .replace(str(folder), "FOLDER")
            .rstrip("\n")
        )
        shown = re.sub(
            "^No such option.*", "No such option", shown
        )  # each version of click says more in its own way
        said.append(f"$ {command}\n{shown}")
    return "\n".join(said)


def transcript(run: Run, commands: Iterable[str], only: str = "") -> str:
    """What commands print, behind each of them; behind a semicolon the exit status that is right,
    where it is not 0.

    Of their results only paragraphs that have what ``only`` is a pattern of.
    """
    shown = ""
    for line in commands:
        command, _, status = line.partition("; ")
        ended = call(run, command, status=int(status or 0))
        kept = "\n\n".join(
            part for part in ended.stdout.split("\n\n") if re.search(only, part)
        ).rstrip()
        shown += f"$ {command}\n{kept}\n{ended.stderr}\n"
    return shown


def words(text: str) -> str:
    """A text without its line breaks."""
    return " ".join(text.split())


def call(run: Run, command: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run one command line, given as one text."""
    return run(*shlex.split(command), **options)


def result(run: Run, command: str, *, status: Status = 0, stdin: str | None = None) -> Any:
    """The JSON that a command prints, and nothing else,
    with ``--json -`` where it is not export.
    """
    line = command if command.startswith("export") else f"{command} --json -"
    return json.loads(call(run, line, stdin=stdin, status=status).stdout)


def printed(shown: RenderableType, width: int = 80) -> list[str]:
    """The lines of what is printed on a screen without colours, without blanks at their ends."""
    console = Console(width=width, file=io.StringIO(), markup=False, emoji=False, highlight=False)
    with console.capture() as captured:
        console.print(shown)
    return [line.rstrip() for line in captured.get().splitlines()]


def rows(text: str) -> list[dict[str, str]]:
    """Rows of a CSV text."""
    return list(csv.DictReader(text.splitlines()))


def python(
    folder: Path, code: str, *arguments: str, status: int = 0
) -> subprocess.CompletedProcess[str]:
    """Run code in a Python of its own."""
    ended = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=folder,
        env={**os.environ, **environment(80)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == status, ended.stderr
    return ended
