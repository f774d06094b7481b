"""Free motion: nothing is fired."""

from __future__ import annotations

from nutdamp.schemes.catalogue import SchemeOptions
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule


def schedule(spacecraft: Spacecraft, options: SchemeOptions) -> Schedule:  # noqa: ARG001 - the signature of a scheme
    """No pulses."""
    return Schedule()
