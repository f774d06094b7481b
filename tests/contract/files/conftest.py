"""Fixtures of the tests of files."""

from pathlib import Path

import pytest
from support.contract import Write


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """``write(text, name)``: a file of that text in an empty folder, from which its name leads to
    it.
    """
    monkeypatch.chdir(tmp_path)

    def write(text: str | bytes, name: str = "in.csv") -> Path:
        Path(name).write_bytes(text if isinstance(text, bytes) else text.encode())
        return Path(name)

    return write
