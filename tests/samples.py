"""Which of many like cases run always; the others run where slow tests are requested."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pytest


def some(cases: Iterable[Any], *, always: int = 1) -> list[Any]:
    """All ``cases`` as parameters of a test: the first few as they are, the others marked slow."""
    return [case if number < always else slow(case) for number, case in enumerate(cases)]


def slow(*values: Any) -> Any:
    """Values of one case that is marked slow."""
    return pytest.param(*values, marks=pytest.mark.slow)


def mark_few(items: Sequence[pytest.Item]) -> None:
    """Of the cases of a test marked ``few(n)`` n, evenly spread from the first to the last, stay; others are slow."""
    cases: dict[tuple[object, str], list[pytest.Item]] = {}
    for item in items:
        if "few" in item.keywords and "slow" not in item.keywords:
            cases.setdefault((item.path, item.nodeid.partition("[")[0]), []).append(item)
    for those in cases.values():
        mark = those[0].get_closest_marker("few")
        assert mark is not None
        stay = set(np.linspace(0, len(those) - 1, mark.args[0]).round().astype(int).tolist())
        for number, item in enumerate(those):
            if number not in stay:
                item.add_marker(pytest.mark.slow)
