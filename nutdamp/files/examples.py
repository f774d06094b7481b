"""Spacecraft files to start from, which ship with the package: the built-in example, and those of ``configs/``."""

from __future__ import annotations

from functools import cache
from pathlib import Path

BUILT_IN = "example"
"""Name of the built-in example, which commands plan where no file is named, and which `init` writes by default."""

_PACKAGE = Path(__file__).parents[1]


@cache
def _places() -> dict[str, Path]:
    """Where the file of each name lies: an installed package holds the folder ``configs``, a checkout has it beside."""
    folders = (_PACKAGE / "data" / "configs", _PACKAGE.parent / "configs")
    shipped = next((sorted(folder.glob("*.yaml")) for folder in folders if folder.is_dir()), [])
    return {path.stem: path for path in (_PACKAGE / "data" / f"{BUILT_IN}.yaml", *shipped)}


def example_names() -> tuple[str, ...]:
    """Names of all files, the built-in example first."""
    return tuple(_places())


def example_text(name: str = BUILT_IN) -> str:
    """The text of the file of that ``name``; KeyError for any other."""
    return _places()[name].read_text(encoding="utf-8")


def example_subject(name: str) -> str:
    """What the file of that ``name`` is about: the comment it begins with, up to the line that ends a sentence."""
    lines: list[str] = []
    for line in example_text(name).splitlines():
        lines.append(line.removeprefix("#").strip())
        if line.endswith("."):
            break
    return " ".join(lines).rstrip(".")
