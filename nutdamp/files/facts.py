"""The raw tree of a spacecraft file as rules read it: what can be read is a value, what cannot is None."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.files.yaml_tree import KeyPath, Node
from nutdamp.units import parse

Vector = NDArray[np.float64]


MOMENT = re.compile(r"[IJ]_?([xyz]{1,2}|[123]{1,2})", re.IGNORECASE)
"""Keys for single parts of an inertia tensor, which a file gives as a whole."""


class Finding(NamedTuple):
    """Something wrong at ``path``, which need not exist; ``at_key`` points at the key and not at its value."""

    path: KeyPath
    problem: str
    at_key: bool = False


class Facts:
    """The values of a tree that can be read."""

    def __init__(self, root: Node) -> None:
        self.root = root

    def has(self, *path: str | int) -> bool:
        """Whether something is at ``path``."""
        return self.root.get(*path) is not None

    def text(self, *path: str | int) -> str | None:
        """The text at ``path``."""
        node = self.root.get(*path)
        return node.value if node is not None and isinstance(node.value, str) else None

    def number(self, kind: str, *path: str | int) -> float | None:
        """The quantity at ``path``, SI."""
        node = self.root.get(*path)
        try:
            return None if node is None else parse(node.plain(), kind)
        except ValueError:
            return None

    def vector(self, kind: str, size: int, *path: str | int) -> Vector | None:
        """The ``size`` quantities at ``path``, SI; None unless all can be read."""
        if len(self.children(*path)) != size:
            return None
        numbers = [self.number(kind, *path, index) for index in range(size)]
        return None if None in numbers else np.array(numbers, dtype=np.float64)

    def children(self, *path: str | int) -> list[tuple[str | int, Node]]:
        """Keys or positions at ``path``, and what is there."""
        node = self.root.get(*path)
        return [] if node is None else list(node.children())
