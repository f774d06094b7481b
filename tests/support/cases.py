"""Which of many like cases run always (quick), in CI (deep), and by hand (weekly)."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pytest


def spread(
    names: str | Sequence[str],
    values: Iterable[Any],
    *,
    quick: int = 1,
    deep: int | None = None,
    **options: Any,
) -> pytest.MarkDecorator:
    """As ``pytest.mark.parametrize``, of whose cases ``quick``, evenly spread, run always.

    Of the others ``deep``, evenly spread (one in eight, where it is None), are marked deep, the
    rest weekly.
    """
    listed = list(values)
    always = _evenly(range(len(listed)), quick)
    others = [number for number in range(len(listed)) if number not in always]
    in_ci = _evenly(others, math.ceil(len(others) / 8) if deep is None else deep)
    alone = isinstance(names, str) and "," not in names
    for number, case in enumerate(listed):
        if number not in always:
            mark = pytest.mark.deep if number in in_ci else pytest.mark.weekly
            listed[number] = _marked(case, alone, mark)
    return pytest.mark.parametrize(names, listed, **options)


def deep(*values: Any) -> Any:
    """Values of one case that runs in CI."""
    return pytest.param(*values, marks=pytest.mark.deep)


def weekly(*values: Any) -> Any:
    """Values of one case that runs by hand."""
    return pytest.param(*values, marks=pytest.mark.weekly)


def _evenly(numbers: Sequence[int], count: int) -> set[int]:
    places = np.linspace(0, len(numbers) - 1, min(count, len(numbers))).round().astype(int)
    return {numbers[place] for place in places}


def _marked(case: Any, alone: bool, mark: pytest.MarkDecorator) -> Any:
    if isinstance(case, type(pytest.param())):
        return pytest.param(*case.values, id=case.id, marks=[*case.marks, mark])
    return pytest.param(*((case,) if alone else case), marks=mark)
