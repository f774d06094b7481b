"""What a file given as a spacecraft file is instead: kinds that nutdamp writes or imports, by their first lines."""

from __future__ import annotations

import re
from typing import NamedTuple

LOOKED_AT = 4000
"""Characters from the beginning that are looked at."""


class Kind(NamedTuple):
    """A kind of file: the ``pattern`` of its first lines, what it ``is``, and what to do with it."""

    pattern: str
    is_: str
    cure: str


KINDS = (
    Kind(
        r"[^\n]*\bstart_s\b[^\n]*,|[^\n]*\bt_s,[^\n]*\bon_time_s\b",
        "a schedule, as `plan --csv` writes it",
        "name it with --schedule, behind its spacecraft file",
    ),
    Kind(
        r"[^\n]*\bomega_1_rad_s\b",
        "a track, as `simulate --csv` writes it",
        "name the spacecraft file that it was made from",
    ),
    Kind(
        r'\s*\{\s*"nutdamp"',
        "a result in JSON, as nutdamp writes it",
        "name the spacecraft file that it was made from",
    ),
    Kind(
        r"\s*(?:COMMENT[^\n]*\n\s*)*CCSDS_APM_VERS",
        "a CCSDS attitude parameter message",
        "`nutdamp import FILE` makes a spacecraft file of it",
    ),
    Kind(
        r"\s*(?:COMMENT[^\n]*\n\s*)*CCSDS_\w+_VERS|\s*<\?xml|\s*<!DOCTYPE|\s*<html",
        "a CCSDS message, or another XML or HTML text",
        "a spacecraft file is in YAML; `nutdamp init` writes one to start from",
    ),
)
"""In this order, the first that fits."""


def foreign(text: str) -> str | None:
    """That a text is no spacecraft file but of another known kind, and the cure; None where nothing shows that."""
    for kind in KINDS:
        if re.match(kind.pattern, text[:LOOKED_AT]):
            return f"expected a spacecraft file, got {kind.is_}; {kind.cure}"
    return None
