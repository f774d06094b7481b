"""Files are written whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from nutdamp.errors import CannotWrite
from nutdamp.files.tabular import json_text, make_folder, whole_file, write_whole


def hidden(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.startswith(".")]


def test_what_another_run_is_writing_is_left_alone(tmp_path: Path) -> None:
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
