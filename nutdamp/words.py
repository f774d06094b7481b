"""Lists and spans as sentences have them."""

from __future__ import annotations

import math
from collections.abc import Sequence


def listed(words: Sequence[str], last: str = "and") -> str:
    """``a``, ``a and b``, ``a, b and c``; ``last`` takes the place of "and"."""
    return f" {last} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def span(least: float, most: float, unit: str) -> str:
    """``0.2 s to 5 s``, or ``at least 0.2 s`` where there is no ``most``."""
    return f"at least {least:.4g} {unit}" if math.isinf(most) else f"{least:.4g} {unit} to {most:.4g} {unit}"
