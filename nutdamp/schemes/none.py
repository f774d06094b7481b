"""Free motion: nothing is fired."""

from __future__ import annotations

from nutdamp.schedule import Schedule
from nutdamp.schemes.options import SchemeOptions
from nutdamp.spacecraft import Spacecraft


def schedule(spacecraft: Spacecraft, options: SchemeOptions) -> Schedule:  # noqa: ARG001 - the signature of a scheme
    """No pulses."""
    return Schedule()
