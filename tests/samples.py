"""Which of many like cases run always; the others run where slow tests are requested."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def some(cases: Iterable[Any], *, always: int = 1) -> list[Any]:
    """All ``cases`` as parameters of a test: the first few as they are, the others marked slow."""
    return [case if number < always else slow(case) for number, case in enumerate(cases)]


def slow(*values: Any) -> Any:
    """Values of one case that is marked slow."""
    return pytest.param(*values, marks=pytest.mark.slow)
