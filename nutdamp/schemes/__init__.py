"""The schemes by name. Each lives in one module with ``schedule(spacecraft, options) -> Schedule``."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple, cast

if TYPE_CHECKING:  # so that the command line can know the names without loading numpy
    from nutdamp.schedule import Schedule
    from nutdamp.spacecraft import Spacecraft

CLASSIC = ("one-pulse", "two-pulse", "four-pulse")
"""The schemes of Magnus 1970, planned when none is named."""

NAMES = (*CLASSIC, "none")


class Options(NamedTuple):
    """What a user may ask of the schemes; each reads what concerns it.

    ``on_time`` s, pulse length of four-pulse (None: min(max_on_time, T_ω/8)). ``coarse``: four-pulse without a
    last, shorter pulse. ``literal``: two-pulse as printed in Magnus 1970.
    """

    on_time: float | None = None
    coarse: bool = False
    literal: bool = False


def schedule(name: str, spacecraft: Spacecraft, options: Options) -> Schedule:
    """Pulses of the scheme ``name``.

    Raises Infeasible with the reason where the scheme cannot work on this spacecraft within its limits, and
    KeyError for a name not in `NAMES`.
    """
    if name not in NAMES:
        raise KeyError(name)
    module = import_module(f"nutdamp.schemes.{name.replace('-', '_')}")
    return cast("Schedule", module.schedule(spacecraft, options))
