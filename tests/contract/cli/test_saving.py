"""What cannot be saved keeps back no result, and what ends a run early leaves nothing half done."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support.cases import deep, spread, weekly
from support.process import Run

pytestmark = pytest.mark.usefixtures("plans_shared")

LIMITED = 'ulimit -f 64; exec "$0" -m nutdamp "$@"'
"""For a shell: a run that may write no file beyond 32 KiB, as on a disk that is nearly full."""

POSIX = pytest.mark.skipif(os.name != "posix", reason="needs limits and signals of POSIX")


def limited(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-c", LIMITED, sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "COLUMNS": "80", "NO_COLOR": "1"},
        capture_output=True,
        text=True,
        check=False,
    )


@POSIX
@pytest.mark.parametrize(
    ("command", "result"),
    [
        weekly("simulate --scheme two-pulse --csv big.csv --json small.json", "flown, real widths"),
        ("simulate --scheme two-pulse --show --csv big.csv --json small.json", "pole curve"),
        ("disperse --scheme two-pulse --samples 2000 --csv big.csv --json small.json", "Tolerance budget"),
        weekly("plan --plot big.svg --json small.json", "Recommended"),
        weekly("trade --points 1 --plot big.png --json small.json", "H may end anywhere"),
    ],
)
def test_the_result_is_shown_where_a_file_cannot_be_saved(tmp_path: Path, command: str, result: str) -> None:
    done = limited(tmp_path, *command.split(), "--quiet")
    assert done.returncode == 1, done.stderr
    assert result.lower() in done.stdout.lower()
    assert "nutdamp: cannot write big." in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["small.json"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_each_file_that_cannot_be_saved_is_named(run: Run) -> None:
    done = run("plan", "--quiet", "--csv", "/dev/full", "--json", "/dev/full")
    assert done.returncode == 1
    assert "Recommended" in done.stdout
    assert done.stderr == 2 * "nutdamp: cannot write /dev/full: No space left on device\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@spread("command", ["verify --json", "disperse --samples 100 --json", "disperse --case 1 --json"], quick=1)
def test_a_full_disk_leaves_the_screen(run: Run, command: str) -> None:
    done = run(*command.split(), "/dev/full", "--quiet")
    assert (done.returncode, done.stderr) == (1, "nutdamp: cannot write /dev/full: No space left on device\n")
    assert "Sounder-1" in done.stdout


def test_schedules_without_a_folder_leave_the_fronts(run: Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = run("trade", "--points", "1", "--schedules", "file", "--quiet")
    assert (done.returncode, done.stderr) == (1, "nutdamp: cannot write file: it is there, and no directory\n")
    assert "H may end anywhere" in done.stdout


TERMINATED = """
import os, signal, sys
from nutdamp.cli import root
from nutdamp.files import {module}

made = {module}.{function}

def slow(*given, **named):
    os.kill(os.getpid(), signal.SIGTERM)
    return made(*given, **named)

{module}.{function} = slow
sys.argv = ["nutdamp", *{arguments!r}.split()]
root.main()
"""


@POSIX
@spread(
    ("arguments", "module", "function"),
    [
        ("plan --json x.json --csv x.csv", "output", "json_text"),
        deep("plan spacecraft.yaml --json x.json", "spacecraft_file", "read_spacecraft"),
        deep("simulate --scheme two-pulse --csv x.csv --json x.json", "output", "json_text"),
        ("verify --json x.json", "verification_json", "verification_json"),
        deep("report -o x.html", "spacecraft_file", "read_spacecraft"),
        deep("export --format json -o x.json", "output", "json_text"),
        ("check --json x.json", "check_json", "check_json"),
    ],
    quick=1,
)
def test_sigterm_ends_a_command_in_order(tmp_path: Path, arguments: str, module: str, function: str) -> None:
    (tmp_path / "spacecraft.yaml").write_text("name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n")
    code = TERMINATED.format(arguments=arguments, module=module, function=function)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 128 + signal.SIGTERM
    assert done.stderr.splitlines()[-1] == "terminated"
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["spacecraft.yaml"]


WRITING = """
import os, signal, sys
import click
from nutdamp.cli.boundary import run
from nutdamp.files.output import whole_file

@click.group()
def group(): ...

@group.command()
def write():
    with whole_file("x.csv") as stream:
        stream.write(b"half")
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)  # the second one does not disturb

sys.argv = ["nutdamp", "write"]
run(group)
"""


@POSIX
def test_sigterm_while_a_file_is_written_leaves_what_was_there(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("before")
    done = subprocess.run([sys.executable, "-c", WRITING], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (143, "terminated\n")
    assert [path.name for path in tmp_path.iterdir()] == ["x.csv"]
    assert (tmp_path / "x.csv").read_text() == "before"
