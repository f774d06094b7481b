"""One spacecraft in several roles, each with a name that parameters and variables bear everywhere.

=================  ===============================================================================
``spacecraft``     as its caller has it: for schemes what they plan for
``as_known``       as schemes know it: with disturbances only if these are to be allowed for
``at_leg``         at the end of the pulses chosen so far, as if its time began there
``symmetric``      with two equal moments instead of three: what the equations of Magnus are of
``without_valves`` with the thrust that valves and cold nozzles give as if it came at once
``truth``          as the flight of a loop or of a dispersed case has it: unlike what is known
``limited``        under other limits
=================  ===============================================================================
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft

ROLES = ("spacecraft", "as_known", "at_leg", "symmetric", "without_valves", "truth", "limited")
"""Names that a parameter of type `Spacecraft` may have."""


def as_known(spacecraft: Spacecraft, *, disturbed: bool) -> Spacecraft:
    """Spacecraft as schemes know it: ``disturbed`` or not, without a goal of a spin that stays."""
    known = spacecraft if disturbed else replace(spacecraft, disturbances=())
    axial = any(channel.axial for channel in known.channels)
    axial = axial or any(disturbance.axial for disturbance in known.disturbances)
    if known.goal.spin is None or axial:
        return known
    return (
        replace(known, goal=replace(known.goal, spin=None))
        if requirements.reaches_spin(known)
        else known
    )


def with_limits(spacecraft: Spacecraft, **limits: Any) -> Spacecraft:
    """Spacecraft with other ``limits``, by name: ``horizon``, ``earliest``, ``tick``, ``gap``."""
    return replace(spacecraft, limits=replace(spacecraft.limits, **limits))
