"""Where output goes when standard output is full, closed or of a narrow encoding, and names that look like markup."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import IO

import pytest
from support.cases import spread
from support.process import Run

pytestmark = pytest.mark.usefixtures("plans_shared")

FULL = Path("/dev/full")

ODD_NAMES = """
name: "[red]Evil[/] [/] :rocket:"
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg}
thrusters:
  - {name: "[red]", torque: [8, 0, 0]}
  - {name: "[/]", torque: [0, 8, 0]}
  - {name: ":rocket:", torque: [-8, 0, 0]}
dispersions: {A: {normal: 1 %}, thrust: {normal: 2 %}}
"""


@pytest.fixture
def odd(tmp_path: Path) -> str:
    """A spacecraft whose names rich would take for markup."""
    (tmp_path / "odd.yaml").write_text(ODD_NAMES)
    return "odd.yaml"


@spread(
    "command",
    [
        ("plan",),
        ("plan", "--robust", "--scheme", "one-pulse"),
        ("check",),
        ("verify",),
        ("simulate", "--scheme", "two-pulse", "--show"),
        ("trade", "--points", "1"),
        ("disperse", "--samples", "100"),
        ("disperse", "--case", "1"),
    ],
    quick=4,
    ids=" ".join,
)
def test_names_that_look_like_markup_are_shown_as_they_are(run: Run, odd: str, command: tuple[str, ...]) -> None:
    done = run(*command, odd)
    assert "Traceback" not in done.stderr
    assert "[red]Evil[/] [/] :rocket:" in done.stdout


def test_thrusters_named_like_markup_keep_their_names_in_tables(run: Run, odd: str) -> None:
    rows = run("check", odd).stdout.splitlines()
    for name in ("[red]", "[/]", ":rocket:"):
        assert any(row.startswith(f"{name}  ") for row in rows)


def test_no_blanks_fill_up_lines_in_a_pipe(run: Run) -> None:
    for command in (("plan",), ("check",), ("simulate", "--scheme", "two-pulse")):
        assert not [line for line in run(*command).stdout.splitlines() if line != line.rstrip()]


@pytest.mark.skipif(not FULL.exists(), reason="no /dev/full here")
@spread("command", ["plan --quiet", "check --quiet", "plan --quiet --json -", "--help", "explain"], quick=2)
def test_a_full_standard_output_is_said_in_one_line(tmp_path: Path, command: str) -> None:
    with FULL.open("w") as full:
        done = _process(tmp_path, command, stdout=full)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert "cannot write" in done.stderr
    assert "No space left" in done.stderr


@pytest.mark.skipif(os.name != "posix", reason="closes a descriptor as a shell does")
@spread("command", ["plan --quiet", "plan --quiet --csv -"], quick=1)
def test_a_process_without_standard_output_does_its_work(tmp_path: Path, command: str) -> None:
    call = f'exec "{sys.executable}" -m nutdamp {command} --json pulses.json >&-'
    done = subprocess.run(["sh", "-c", call], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "pulses.json").exists()


def test_a_screen_without_greek_letters_gets_question_marks(tmp_path: Path) -> None:
    done = _process(tmp_path, "plan --quiet", stdout=subprocess.PIPE, PYTHONIOENCODING="latin-1", PYTHONUTF8="0")
    assert (done.returncode, done.stderr) == (0, "")
    assert "A|?0|" in done.stdout


def _process(folder: Path, command: str, *, stdout: int | IO[str], **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "nutdamp", *command.split()],
        cwd=folder,
        env={**os.environ, **more},
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        encoding="latin-1",
        check=False,
    )


# --- standard input ---------------------------------------------------------------------------------------------------


def test_a_spacecraft_comes_from_standard_input(run: Run) -> None:
    done = run("plan", "-", stdin=ODD_NAMES)
    assert done.returncode == 0
    assert "Evil" in done.stdout
    assert run("check", "-", stdin="name: 5").stderr.startswith("-:1:")


def test_a_schedule_comes_from_standard_input(run: Run) -> None:
    pulses = run("plan", "--csv", "-", "--quiet").stdout
    done = run("simulate", "--schedule", "-", "--quiet", stdin=pulses)
    assert done.returncode == 0
    assert "pulses begun" not in done.stdout  # all of them are
    assert re.search("^nutation  +< 1e-9 deg +< 1e-9 deg$", done.stdout, re.MULTILINE)


def test_an_empty_standard_input_is_a_faulty_file(run: Run) -> None:
    for command in (("plan", "-"), ("simulate", "--schedule", "-"), ("import", "apm", "-")):
        done = run(*command, stdin="")
        assert (done.returncode, done.stdout) == (2, "")
        assert "-:1:1: " in done.stderr


# --- places that cannot be written to are reported before the work ---------------------------------------------------


@pytest.mark.parametrize(
    "command",
    [
        "plan --csv no/x.csv",
        "simulate --scheme none --json no/x.json",
        "trade --points 1000 --csv no/x.csv",
        "disperse --samples 1e10 --json no/x.json",
        "animate -o no/x.gif --seconds 600",
        "report -o no/x.html",
        "export --format json -o no/x.json",
        "verify --json no/x.json",
    ],
)
def test_a_missing_folder_is_reported_before_the_work(run: Run, tmp_path: Path, command: str) -> None:
    done = run(*command.split(), "--quiet")
    assert (done.returncode, done.stdout) == (1, "")
    assert "cannot write no/x." in done.stderr
    assert "is no directory" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_bad_file_is_reported_before_a_missing_folder(run: Run, odd: str, tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text("name: 5")
    assert run("plan", "bad.yaml", "--csv", "no/x.csv").returncode == 2


def test_a_file_is_no_folder_for_schedules(run: Run, odd: str) -> None:
    done = run("trade", "--points", "1", "--schedules", odd)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "nutdamp: cannot write odd.yaml: it is there, and no directory"


def test_a_schedule_with_semicolons_is_sent_to_commas(run: Run, tmp_path: Path) -> None:
    pulses = run("plan", "--csv", "-", "--quiet").stdout
    done = run("simulate", "--schedule", "-", "--quiet", stdin=pulses.replace(",", ";"))
    assert done.returncode == 2
    assert done.stderr == "-:1:1: columns are separated by commas, not by semicolons or tabs\n"
