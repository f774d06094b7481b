"""Reading texts that people or other tools wrote."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

from nutdamp.errors import CannotRead, Fault, FaultyFile

STDIN = "-"
"""File name that means standard input."""


def read_bytes(path: str, most: int = -1) -> bytes:
    """What is in a file, at most ``most`` bytes of it; ``-`` is standard input. Raises CannotRead."""
    try:
        if path == STDIN:
            if sys.stdin is None:
                raise CannotRead(path, "there is no standard input")
            return sys.stdin.buffer.read(most)
        if _is_device(Path(path)):
            raise CannotRead(path, "it is a device; expected a file, a pipe or -")
        with Path(path).open("rb") as stream:
            return stream.read(most)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or str(error)
        raise CannotRead(path, reason.lower()) from error


def _is_device(path: Path) -> bool:
    """Whether reading may go on for ever, or do something: a device that is no terminal, or a socket."""
    mode = path.stat().st_mode
    if stat.S_ISCHR(mode):
        with path.open("rb") as stream:
            return not stream.isatty()
    return stat.S_ISBLK(mode) or stat.S_ISSOCK(mode)


def read_limited(path: str, most: int) -> bytes:
    """What is in a file of at most ``most`` bytes; raises CannotRead, or FaultyFile where it is larger."""
    data = read_bytes(path, most + 1)
    if len(data) > most:
        raise FaultyFile([Fault(path, 1, 1, "", f"larger than {most >> 20} MiB")])
    return data


def read_utf8(path: str, most: int) -> str:
    """The text of a file of at most ``most`` bytes, without a byte order mark; raises CannotRead or FaultyFile."""
    return utf8_text(read_limited(path, most), path)


def utf8_text(data: bytes, name: str) -> str:
    """The text of UTF-8 bytes, without a byte order mark; raises FaultyFile, which calls the file ``name``."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        raise FaultyFile([Fault(name, 1, 1, "", f"not UTF-8 text (byte {reason.start})")]) from reason
