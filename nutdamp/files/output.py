"""Writing: whole files or none, and numbers that read back as they were."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import re
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from nutdamp.errors import CannotWrite
from nutdamp.rounding import finite

if sys.platform != "win32":
    import fcntl

STDOUT = "-"
"""File name that means standard output."""

PREFIX, SUFFIX = ".nutdamp-", ".part"
"""How the names of temporary files begin and end."""

ATTEMPTS = 10
"""Temporary files that are made before giving up, where others remove them."""


def write_whole(path: str, content: str | bytes | Callable[[IO[bytes]], object]) -> None:
    """Write ``content`` to ``path``, or leave what was there; ``-`` is standard output. Raises CannotWrite.

    What is long writes itself: it is called with the stream. Text becomes UTF-8; what has no place there, such as a
    byte of a file name that is not UTF-8, becomes \\udcff.
    """
    with whole_file(path) as stream:
        if callable(content):
            content(stream)
        else:
            stream.write(content.encode(errors="backslashreplace") if isinstance(content, str) else content)


@contextmanager
def whole_file(path: str) -> Iterator[IO[bytes]]:
    """A file to write piece by piece, which takes its place at ``path`` when the block ends well, or never.

    Until then it is a temporary file in the same folder. What is no plain file (a pipe, /dev/null, standard output
    as ``-``) is written to directly. Raises CannotWrite.
    """
    try:
        if path == STDOUT:
            sys.stdout.flush()
            yield sys.stdout.buffer
            sys.stdout.buffer.flush()
            return
        target = check_place(path)
        if target.exists() and not target.is_file():
            with target.open("wb") as stream:
                yield stream
            return
        with _replacing(target) as stream:
            yield stream
    except BrokenPipeError:
        raise
    except OSError as reason:
        raise CannotWrite(path, reason.strerror or str(reason)) from reason


def check_place(path: str) -> Path:
    """Where a file is to stand, behind links; seen before long work to be a place that can be written to.

    Raises CannotWrite where it cannot: also where links go round in a circle, or the name cannot be one.
    """
    if path == STDOUT:
        return Path(path)
    try:
        target = Path(path).resolve()
        if target.is_symlink() or target.parent.is_symlink():  # `resolve` may give up on a circle without a word
            raise CannotWrite(path, "too many levels of symbolic links")
        if target.is_dir():
            raise CannotWrite(path, "it is a directory")
        if not target.parent.is_dir():
            raise CannotWrite(path, f"{target.parent} is no directory")
        if not os.access(target if target.exists() else target.parent, os.W_OK):
            raise CannotWrite(path, "permission denied")
    except (OSError, RuntimeError, ValueError) as reason:  # RuntimeError: links in a circle; ValueError: a zero byte
        raise CannotWrite(path, _said(reason)) from reason
    return target


def _said(reason: Exception) -> str:
    """What the system says, without the path."""
    return getattr(reason, "strerror", None) or str(reason).partition(" from ")[0]


def make_folder(path: str) -> None:
    """Make the folder ``path`` unless it is there. Raises CannotWrite."""
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except FileExistsError as reason:
        raise CannotWrite(path, "it is there, and no directory") from reason
    except (OSError, ValueError) as reason:
        raise CannotWrite(path, _said(reason)) from reason


@contextmanager
def _replacing(target: Path) -> Iterator[IO[bytes]]:
    remove_abandoned(target.parent)
    handle, temporary = _locked_file(target.parent)
    try:
        with os.fdopen(handle, "wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
            if target.exists():
                temporary.chmod(target.stat().st_mode & 0o7777)
            else:
                mask = os.umask(0)
                os.umask(mask)
                temporary.chmod(0o666 & ~mask)
            if sys.platform == "win32":
                stream.close()  # there an open file cannot be renamed; here it keeps its lock until it is
            temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _locked_file(folder: Path) -> tuple[int, Path]:
    """A new temporary file in ``folder``, open, and locked until it is closed or the process ends."""
    for _ in range(ATTEMPTS):
        handle, name = tempfile.mkstemp(prefix=PREFIX, suffix=SUFFIX, dir=folder)
        with suppress(OSError):  # of a file system that knows no locks
            _lock(handle)
        if Path(name).exists():
            return handle, Path(name)
        os.close(handle)  # another run took it for abandoned just before it was locked
    raise FileNotFoundError(f"temporary files in {folder} are removed as soon as they are made")


def remove_abandoned(folder: Path) -> None:
    """Remove the temporary files of runs that were killed: those that no process has locked."""
    if sys.platform == "win32":
        return
    for path in folder.glob(f"{PREFIX}*{SUFFIX}"):
        with suppress(OSError):
            handle = os.open(path, os.O_RDWR | os.O_NOFOLLOW)
            try:
                _lock(handle)
                path.unlink()
            finally:
                os.close(handle)


def _lock(handle: int) -> None:
    """Lock an open file until it is closed or the process ends. Raises OSError, also where another process has."""
    if sys.platform != "win32":
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def number(value: float | None) -> str:
    """A number with 17 significant digits at most, the shortest text that reads back the same; None is empty."""
    return "" if value is None or not math.isfinite(value) else repr(float(value))


def truth(value: bool | None) -> str:
    """Yes or no as CSV has it; None is empty."""
    return "" if value is None else str(value).lower()


def csv_text(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table as RFC 4180 CSV."""
    stream = io.StringIO()
    writer = csv.writer(stream)
    writer.writerow(header)
    writer.writerows(rows)
    return stream.getvalue()


def json_text(data: dict[str, Any]) -> str:
    """JSON with numbers that are not finite as null, characters that control a terminal escaped, newline at the end."""
    text = json.dumps(finite(data), indent=2, ensure_ascii=False, allow_nan=False)
    # Those below a blank are escaped already.
    return re.sub("[\x7f-\x9f\u2028\u2029]", lambda found: f"\\u{ord(found[0]):04x}", text) + "\n"
