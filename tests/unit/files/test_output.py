"""Files are written whole or not at all, and what killed runs left behind is cleared away."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from nutdamp.errors import CannotWrite
from nutdamp.files.output import PREFIX, SUFFIX, json_text, make_folder, whole_file, write_whole

pytestmark = pytest.mark.usefixtures("plans_shared")

KILLED = """
import os, signal
from nutdamp.files.output import whole_file

with whole_file("x.csv") as stream:
    stream.write(b"half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def temporary(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.name.startswith("."))


@pytest.mark.skipif(os.name != "posix", reason="kills a process")
def test_the_next_write_removes_what_a_killed_run_left(tmp_path: Path) -> None:
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", KILLED], cwd=tmp_path, check=False)
        assert done.returncode == -signal.SIGKILL
        assert len(temporary(tmp_path)) == 1  # that of the second run alone: it removed the first
    (tmp_path / ".x.csv.mine").write_text("a hidden file of somebody else")
    write_whole(str(tmp_path / "another.csv"), "1")
    assert temporary(tmp_path) == [".x.csv.mine"]
    assert not (tmp_path / "x.csv").exists()


def test_a_file_that_is_being_written_is_no_leftover(tmp_path: Path) -> None:
    with whole_file(str(tmp_path / "slow.csv")) as stream:
        stream.write(b"slow")
        write_whole(str(tmp_path / "quick.csv"), "quick")
        assert len(temporary(tmp_path)) == 1
    assert (tmp_path / "slow.csv").read_text() == "slow"
    assert (tmp_path / "quick.csv").read_text() == "quick"
    assert temporary(tmp_path) == []


def test_what_cannot_be_removed_is_no_hindrance(tmp_path: Path) -> None:
    (tmp_path / f"{PREFIX}folder{SUFFIX}").mkdir()
    (tmp_path / f"{PREFIX}link{SUFFIX}").symlink_to(tmp_path / "mine")
    (tmp_path / "mine").write_text("mine")
    write_whole(str(tmp_path / "x.csv"), "1")
    assert (tmp_path / "mine").read_text() == "mine"
    assert (tmp_path / "x.csv").read_text() == "1"


def test_names_as_long_as_the_system_allows(tmp_path: Path) -> None:
    path = tmp_path / ("x" * 251 + ".csv")
    write_whole(str(path), "1")
    assert path.read_text() == "1"


def test_a_failure_leaves_what_was_there_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("before")

    def fill_the_disk() -> None:
        with whole_file(str(path)) as stream:
            stream.write(b"half")
            raise OSError(28, "no room")

    with pytest.raises(CannotWrite, match="no room"):
        fill_the_disk()
    assert path.read_text() == "before"
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.csv"]


def test_modes_of_files_stay_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("before")
    path.chmod(0o640)
    write_whole(str(path), "after")
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_name_that_is_not_utf_8_comes_back_from_json(tmp_path: Path) -> None:
    name = os.fsdecode(b"d\xfcse.yaml")
    write_whole(str(tmp_path / "x.json"), json_text({"file": name, "umlaut": "ü"}))
    assert json.loads((tmp_path / "x.json").read_text(encoding="utf-8")) == {"file": name, "umlaut": "ü"}


@pytest.mark.parametrize("write", [write_whole, lambda path, _: make_folder(path)])
def test_a_zero_byte_is_no_path(write: Callable[[str, str], object]) -> None:
    with pytest.raises(CannotWrite):
        write("a\0b", "1")
