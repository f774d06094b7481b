"""Flights that several packages look at: the spin axis on its way, dispersed command blocks."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from support import reference
from support.builders import channel, cross, events, spinner
from support.dispersed import normal
from support.spinners import commanded

from nutdamp.montecarlo.cases import DispersedModel
from nutdamp.physics import attitude
from nutdamp.schemes.block_model import fired
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.spacecraft.tolerances import Dispersions

Array = NDArray[np.float64]


def axis_path(spacecraft: Spacecraft, made: Schedule, until: float, dense: int = 60) -> Array:
    """The spin axis (n, 3) from 0 to ``until`` s by the reference integrator.

    It is asked ``dense`` times in each turn of the axis, and between two edges of pulses.
    """
    moments = spacecraft.inertia.moments
    sense = math.copysign(1.0, spacecraft.spin)
    motion = reference.Motion(spacecraft.omega0, attitude.matrix(spacecraft.initial.quaternion))
    pushes = [one for one in events(made) if isinstance(one, reference.Push)]
    edges = sorted({0.0, until, *(one.start for one in pushes), *(one.end for one in pushes)})
    path = [motion.rotation[:, 2] * sense]
    for begin, end in pairwise(edges):
        torque = sum(
            (one.torque for one in pushes if one.start < 0.5 * (begin + end) < one.end), np.zeros(3)
        )
        count = dense * max(1, math.ceil((end - begin) / spacecraft.inertial_period))
        motions = reference.coast(
            moments, motion, torque, np.linspace(begin, end, count + 1)[1:] - begin
        )
        path += [one.rotation[:, 2] * sense for one in motions]
        motion = motions[-1]
    return np.array(path)


BODY_ERRORS = Dispersions(
    A=normal(0.03, relative=True),
    C=normal(0.03, relative=True),
    omega0=(normal(0.01), normal(0.01), normal(0.05)),
)
"""Errors of the body alone: then `sun_pulses.fired` fires the same pulses."""


def by_blocks(
    dispersions: Dispersions = BODY_ERRORS,
    *,
    spin: float = -2.0,
    moments: tuple[float, float, float] = (110.0, 110.0, 150.0),
    **fields: Any,
) -> DispersedModel:
    """Three blocks of two thrusters, one with axial torque, of an oblate body with 2 deg."""
    body = spinner(
        moments=moments, spin=spin, degrees=2.0, channels=(channel("T", 8.0, 3.0, 2.0), *cross(9.0))
    )
    turn = 2.0 * math.pi / abs(spin)
    blocks = (
        Block("T", 2, 0.3 * turn, 0.05 * turn, 6, 1),
        Block("+1", 19, 0.96 * turn, 0.07 * turn, 4, 1),  # still on when the next Sun pulse comes
        Block("-2", 26, 0.1 * turn, 0.03 * turn, 5, 2),
    )
    body = replace(commanded(body, np.array([1.0, 0.3, -0.4])), dispersions=dispersions, **fields)
    return DispersedModel(body, fired(body, blocks))
