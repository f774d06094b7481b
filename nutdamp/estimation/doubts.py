"""What makes a fit doubtful though its sigmas are small: in words, or as the reason why there is none."""

from __future__ import annotations

from collections.abc import Iterator

from nutdamp.estimation import aliases
from nutdamp.estimation.fit import Fit


def doubts(found: Fit) -> Iterator[str]:
    """Remarks on a fit: what it rests on besides the data, and where record, schedule and file disagree."""
    if aliases.too_slow(found.model, found.values):
        yield (
            f"sampled below the nutation rate, every {aliases.interval(found.model):.4g} s: which C/A it is rests on "
            "the tolerance of the file (are the times in seconds?)"
        )
