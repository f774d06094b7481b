"""Dispersion studies: many truths fly one schedule."""

from __future__ import annotations

from nutdamp.dispersion.study import Study
from nutdamp.dispersion.truth import Model
from nutdamp.errors import BadRequest
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Spacecraft

__all__ = ["study_of"]


def study_of(spacecraft: Spacecraft, schedule: Schedule, *, seed: int = 1, flown: bool = False) -> Study:
    """The study of ``schedule`` with the dispersions of ``spacecraft``, by the impulse sum or ``flown``.

    Raises BadRequest for a spacecraft without dispersions.
    """
    if spacecraft.dispersions is None:
        raise BadRequest("the spacecraft has no dispersions")
    model = Model(spacecraft, schedule)
    if not flown:
        return Study(model, seed)
    from nutdamp.dispersion.flown import RealWidths  # few studies need its integrator

    return Study(model, seed, RealWidths(model), flown=True)
