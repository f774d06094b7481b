"""What tests of files share: the plans that are exported, and the faults of what must be refused as one text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import pytest
from support import messages
from support.cases import deep
from support.golden import check_text

from nutdamp.errors import FaultyFile, printable

QUICK = ("steerable-stage", "tilted tensor, backwards", "oblate, backwards")
CASES = pytest.mark.parametrize("case", [name if name in QUICK else deep(name) for name in messages.CASES])
"""Names of the plans of `support.messages`."""


def faults(read: Callable[..., object], *given: Any) -> list[str]:
    """All that is wrong with what ``read(*given)`` must refuse, each as ``LINE:COLUMN: KEY: problem``."""
    try:
        read(*given)
    except FaultyFile as wrong:
        return [f"{fault.line}:{fault.column}: {fault.where}: {fault.problem}" for fault in wrong.faults]
    pytest.fail(f"taken without a fault: {given}")


def check_faults(key: str, read: Callable[[Any], object], inputs: Iterable[Any] | Mapping[str, Any]) -> None:
    """Fails where ``read`` takes one of the inputs, or finds other faults in it than the text kept as ``key`` says.

    The text has each input, or its name where they have some, and below it the faults.
    """
    named = inputs.items() if isinstance(inputs, Mapping) else [(given, given) for given in inputs]
    lines = []
    for name, given in named:
        shown = name if isinstance(name, str) else " -> ".join(map(str, name))
        lines += [printable(shown.strip().replace("\n", " | ")), *(f"    {fault}" for fault in faults(read, given))]
    check_text(key, "\n".join(lines))
