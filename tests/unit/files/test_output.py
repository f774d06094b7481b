"""Files are written whole or not at all, and what killed runs left behind is cleared away."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from nutdamp.errors import CannotWrite
from nutdamp.files.tabular import PREFIX, SUFFIX, json_text, make_folder, whole_file, write_whole

KILLED = """
import os, signal
from nutdamp.files.tabular import whole_file

with whole_file("x.csv") as stream:
    stream.write(b"half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def hidden(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if path.name.startswith("."))


@pytest.mark.skipif(os.name != "posix", reason="kills a process")
def test_the_next_write_removes_what_a_killed_run_left_and_nothing_else(tmp_path: Path) -> None:
    killed = subprocess.run([sys.executable, "-c", KILLED], cwd=tmp_path, check=False)
    assert (killed.returncode, len(hidden(tmp_path))) == (-signal.SIGKILL, 1)
    (tmp_path / ".x.csv.mine").write_text("a hidden file of somebody else")
    (tmp_path / f"{PREFIX}folder{SUFFIX}").mkdir()  # what cannot be removed is no hindrance
    (tmp_path / f"{PREFIX}link{SUFFIX}").symlink_to(tmp_path / "mine")
    (tmp_path / "mine").write_text("mine")
    write_whole(str(tmp_path / "another.csv"), "1")
    assert hidden(tmp_path) == [f"{PREFIX}folder{SUFFIX}", f"{PREFIX}link{SUFFIX}", ".x.csv.mine"]
    assert [(tmp_path / name).read_text() for name in ("another.csv", "mine")] == ["1", "mine"]
    assert not (tmp_path / "x.csv").exists()


def test_a_file_that_is_being_written_is_no_leftover(tmp_path: Path) -> None:
    with whole_file(str(tmp_path / "slow.csv")) as stream:
        stream.write(b"slow")
        write_whole(str(tmp_path / "quick.csv"), "quick")
        assert len(hidden(tmp_path)) == 1
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"slow.csv": "slow", "quick.csv": "quick"}


def test_a_failure_leaves_what_was_there_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "x.csv").write_text("before")

    def fill_the_disk() -> None:
        with whole_file(str(tmp_path / "x.csv")) as stream:
            stream.write(b"half")
            raise OSError(28, "no room")

    with pytest.raises(CannotWrite, match="no room"):
        fill_the_disk()
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"x.csv": "before"}
    with pytest.raises(CannotWrite):  # a zero byte is no path
        write_whole("a\0b", "1")
    with pytest.raises(CannotWrite):
        make_folder("a\0b")


def test_modes_stay_names_may_be_as_long_as_the_system_allows_and_need_not_be_utf_8_in_json(tmp_path: Path) -> None:
    path = tmp_path / ("x" * 251 + ".csv")
    path.write_text("before")
    path.chmod(0o640)
    write_whole(str(path), "after")
    assert (path.read_text(), path.stat().st_mode & 0o777) == ("after", 0o640)
    content = {"file": os.fsdecode(b"d\xfcse.yaml"), "umlaut": "ü"}
    write_whole(str(tmp_path / "x.json"), json_text(content))
    assert json.loads((tmp_path / "x.json").read_text(encoding="utf-8")) == content
