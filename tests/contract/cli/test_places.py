"""An output that would take the place of an input, or of another output, is a usage error; nothing is written."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from support.process import Run

pytestmark = pytest.mark.usefixtures("plans_shared")

BODY = "name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\ndispersions: {A: {normal: 1 %}}\n"


def contents(folder: Path) -> Mapping[str, str]:
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A spacecraft, a schedule and links to them."""
    for name in ("in.yaml", "point-1.csv", "s.csv"):
        (tmp_path / name).write_text(BODY)
    (tmp_path / "deep").mkdir()
    (tmp_path / "symbolic.yaml").symlink_to("in.yaml")
    for name in ("hard.yaml", "in.html", "film.gif"):
        (tmp_path / name).hardlink_to(tmp_path / "in.yaml")
    (tmp_path / "dangling").symlink_to("new.csv")
    return tmp_path


@pytest.mark.parametrize(
    ("command", "problem"),
    [
        ("plan in.yaml --csv in.yaml", "--csv in.yaml: this command reads this file; name another"),
        ("plan in.yaml --json in.yaml", "--json in.yaml: this command reads this file"),
        ("plan in.yaml --plot in.yaml", "--plot in.yaml: this command reads this file"),
        ("plan in.yaml --csv ./in.yaml", "--csv ./in.yaml: this command reads this file"),
        ("plan in.yaml --csv deep/../in.yaml", "this command reads this file"),
        ("plan in.yaml --csv {folder}/in.yaml", "this command reads this file"),
        ("plan in.yaml --csv symbolic.yaml", "--csv symbolic.yaml: this command reads this file"),
        ("plan symbolic.yaml --csv in.yaml", "--csv in.yaml: this command reads this file"),
        ("plan in.yaml --csv hard.yaml", "--csv hard.yaml: this command reads this file"),
        ("plan in.yaml --csv new.csv --json new.csv", "--json new.csv: --csv goes to this file; name another"),
        ("plan in.yaml --csv new.csv --json deep/../new.csv", "--json deep/../new.csv: --csv goes to this file"),
        ("plan in.yaml --csv new.csv --json dangling", "--json dangling: --csv goes to this file"),
        ("simulate in.yaml --schedule s.csv --csv s.csv", "--csv s.csv: this command reads this file"),
        ("simulate in.yaml --schedule s.csv --json in.yaml", "--json in.yaml: this command reads this file"),
        ("disperse in.yaml --schedule s.csv --json s.csv", "--json s.csv: this command reads this file"),
        ("verify in.yaml --schedule s.csv --json s.csv", "this command reads this file"),
        ("check a.yaml in.yaml --json in.yaml", "--json in.yaml: this command reads this file"),
        ("trade in.yaml --csv new.csv --json new.csv", "--json new.csv: --csv goes to this file"),
        ("trade point-1.csv --schedules .", "--schedules point-1.csv: this command reads this file"),
        (
            "trade in.yaml --csv deep/point-3.csv --schedules deep",
            "--schedules deep/point-3.csv: --csv goes to this file",
        ),
        ("export in.yaml --format json -o in.yaml", "--output in.yaml: this command reads this file"),
        ("export in.yaml --format json --schedule s.csv -o s.csv", "--output s.csv: this command reads this file"),
        ("report in.html -o in.html", "--output in.html: this command reads this file"),
        ("animate in.yaml -o film.gif --schedule film.gif", "--output film.gif: this command reads this file"),
        ("import apm in.yaml -o in.yaml", "--output in.yaml: this command reads this file"),
        ("import apm in.yaml -o new.csv --schedule new.csv", "--schedule new.csv: --output goes to this file"),
    ],
)
def test_one_file_for_two_purposes_is_refused(run: Run, files: Path, command: str, problem: str) -> None:
    before = contents(files)
    done = run(*command.format(folder=files).split())
    assert (done.returncode, done.stdout) == (2, "")
    assert problem in " ".join(done.stderr.split())
    assert contents(files) == before


def test_the_file_that_is_read_unnamed_is_not_overwritten(run: Run, tmp_path: Path) -> None:
    assert run("plan", "--quiet", "--csv", "spacecraft.yaml").returncode == 0  # nothing there yet: the example is read
    (tmp_path / "spacecraft.yaml").write_text(BODY)
    done = run("plan", "--csv", "spacecraft.yaml")
    assert done.returncode == 2
    assert (tmp_path / "spacecraft.yaml").read_text() == BODY


def test_what_is_no_file_may_be_named_twice(run: Run) -> None:
    done = run("plan", "--quiet", "--csv", os.devnull, "--json", os.devnull)
    assert (done.returncode, done.stderr) == (0, "")


def test_standard_output_counts_too(run: Run, tmp_path: Path) -> None:
    for arguments in (["--csv", "out"], ["--csv", "-", "--json", "out"]):
        with (tmp_path / "out").open("w") as out:
            done = subprocess.run(
                [sys.executable, "-m", "nutdamp", "plan", *arguments],
                cwd=tmp_path,
                stdout=out,
                stderr=subprocess.PIPE,
                text=True,
                check=False,
            )
        assert done.returncode == 2
        assert "goes to this file" in done.stderr
