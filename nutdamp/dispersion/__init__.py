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

SEED = 1
"""Of their draws, likewise."""


def study_of(spacecraft: Spacecraft, schedule: Schedule, *, seed: int = SEED) -> Study:
    """The study of ``schedule`` with the dispersions of ``spacecraft``; raises BadRequest where it has none."""
    if spacecraft.dispersions is None:
        raise BadRequest("the spacecraft has no dispersions")
    return Study(Model(spacecraft, schedule), seed)
