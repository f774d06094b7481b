"""Where the files of a command line lie: no output may take the place of what is read, or of another output."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING

import click

from nutdamp.cli.common import DEFAULT_FILE, Input

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence

STANDARD = "-"
"""File name that means standard input or standard output."""


def expect_outputs(*read: Input | str | None, **written: str | Sequence[str] | None) -> bool:
    """Whether an output file is standard output, so that nothing else may go there.

    A usage error where an output, given by its option, is one of the files ``read`` or another output, under whatever
    name: relative, or through links.
    """
    outputs = [
        (f"--{option}", path)
        for option, paths in written.items()
        for path in ([paths] if isinstance(paths, str) else paths or ())
    ]
    standard = [option for option, path in outputs if path == STANDARD]
    if len(standard) > 1:
        raise click.UsageError(f"{' and '.join(standard)} cannot both go to standard output")
    taken: dict[Hashable, str] = {}
    if not standard:
        taken[_identity(STANDARD, 1)] = "standard output goes to this file"
    for given in read:
        path = _path_of(given)
        if path is not None:
            taken[_identity(path, 0)] = "this command reads this file"
    for option, path in outputs:
        identity = _identity(path, 1)
        if identity is not None and identity in taken:
            raise click.UsageError(f"{option} {path}: {taken[identity]}; name another")
        taken[identity] = f"{option} goes to this file"
    return bool(standard)


def _path_of(given: Input | str | None) -> str | None:
    """The file that is read, if any."""
    if not isinstance(given, Input):
        return given
    return DEFAULT_FILE if given.path is None and Path(DEFAULT_FILE).exists() else given.path


def _identity(path: str, standard: int) -> Hashable:
    """What tells one file from all others; None for what is no file, such as a terminal or /dev/null.

    ``standard`` is the descriptor that ``-`` means.
    """
    try:
        status = os.fstat(standard) if path == STANDARD else Path(path).stat()
    except OSError:
        return None if path == STANDARD else os.path.realpath(path)
    return (status.st_dev, status.st_ino) if stat.S_ISREG(status.st_mode) else None
