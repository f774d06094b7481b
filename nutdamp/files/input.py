"""Reading texts that people or other tools wrote."""

from __future__ import annotations

from pathlib import Path

from nutdamp.errors import CannotRead, Fault, FaultyFile


def read_utf8(path: str) -> str:
    """The text of a file, without a byte order mark; raises CannotRead, or FaultyFile where it is not UTF-8."""
    try:
        return Path(path).read_bytes().decode("utf-8-sig")
    except OSError as reason:
        raise CannotRead(path, reason.strerror or str(reason)) from reason
    except UnicodeDecodeError as reason:
        raise FaultyFile([Fault(path, 1, 1, "", f"not UTF-8 text (byte {reason.start})")]) from reason
