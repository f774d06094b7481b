"""Broken spacecraft files at the command line: exit 2, every place named, no traceback, nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.broken import BROKEN
from support.process import Run

pytestmark = pytest.mark.usefixtures("plans_shared")

BYTES = {
    "binary": bytes(range(256)),
    "latin 1": "name: Düse\n".encode("latin-1"),
    "UTF-16": "name: X\n".encode("utf-16"),
    "NUL bytes": b"name: X\0\n",
}


@pytest.mark.parametrize(("text", "expected"), BROKEN.values(), ids=BROKEN)
def test_a_broken_file_stops_the_plan(run: Run, tmp_path: Path, text: str, expected: list[str]) -> None:
    (tmp_path / "broken.yaml").write_text(text, encoding="utf-8")
    done = run("plan", "broken.yaml", "--csv", "pulses.csv", "--json", "plan.json")
    assert done.returncode == 2
    lines = done.stderr.splitlines()
    assert len(lines) == len(expected)
    for line, fault in zip(lines, expected, strict=True):
        assert line.startswith(f"broken.yaml:{':'.join(fault.split(':')[:2])}: ")
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert [path.name for path in tmp_path.iterdir()] == ["broken.yaml"]


@pytest.mark.parametrize("content", BYTES.values(), ids=BYTES)
def test_what_is_no_text_is_refused(run: Run, tmp_path: Path, content: bytes) -> None:
    (tmp_path / "broken.yaml").write_bytes(content)
    done = run("plan", "broken.yaml")
    assert done.returncode == 2
    assert done.stderr.startswith("broken.yaml:1:")
    assert "Traceback" not in done.stderr
