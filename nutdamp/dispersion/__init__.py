"""Dispersion studies: many dispersed cases fly one schedule."""

from __future__ import annotations

from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.study import Study
from nutdamp.errors import BadRequest
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Spacecraft

__all__ = ["SAMPLES", "SEED", "study_of"]

SAMPLES = 20_000
"""Cases that are flown where nothing else is said."""

BY_SUN_PULSES = (
    "--impulses flies pulses at planned times, and command blocks are fired from the Sun pulses of each case; leave "
    "--impulses out, or name another scheme with --scheme"
)
"""Why command blocks are not flown by the impulse sum."""

SEED = 1
"""Of their draws, likewise."""


def study_of(spacecraft: Spacecraft, schedule: Schedule, *, seed: int = SEED, flown: bool = True) -> Study:
    """The study of ``schedule`` with the dispersions of ``spacecraft``, ``flown`` or by the impulse sum.

    Command blocks are fired in each case from its own Sun pulses, which only real widths do. Raises BadRequest for a
    spacecraft without dispersions, and for command blocks by the impulse sum.
    """
    if spacecraft.dispersions is None:
        raise BadRequest("the spacecraft has no dispersions")
    if schedule.blocks and not flown:
        raise BadRequest(BY_SUN_PULSES)
    model = Model(spacecraft, schedule)
    if not flown:
        return Study(model, seed)
    from nutdamp.dispersion.flown import RealWidths  # closed forms need no integrator

    return Study(model, seed, RealWidths(model), flown=True)
