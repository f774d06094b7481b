"""The last digits of a schedule: move and lengthen its pulses until the flown motion leaves nothing.

A quasi-Newton iteration for the nearest solution. The slopes are those of `residual_equations`, which cost no
flights, corrected by what each step shows (Broyden 1965).
Room is shared between neighbours beforehand, so that no limit can be broken.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nutdamp.flight import Flight
from nutdamp.schedule import Schedule
from nutdamp.schemes.optimal import residual_equations
from nutdamp.schemes.optimal.pulse_parameters import PulseParameters
from nutdamp.schemes.optimal.residual_equations import Equations
from nutdamp.schemes.optimal.rounding import on_ticks
from nutdamp.schemes.tools.least_squares import bounded_step
from nutdamp.spacecraft import Spacecraft, Vector

CONVERGED = 1e-13
"""Share of |H| that is left: a few roundings of the flight."""

STEPS = 25


def refine(
    spacecraft: Spacecraft,
    made: Schedule,
    equations: Equations,
    aside: Vector,
    step: float,
    fly: Callable[[Schedule], Flight],
) -> Schedule:
    """``made`` with centres and on-times of all its pulses moved, as little as it takes, towards ``equations`` met.

    ``fly`` flies schedules of the ``spacecraft``; ``aside`` (equations,) N m s is what is to be left of them. What it
    leaves is for the caller to judge.
    """
    parameters = PulseParameters(spacecraft, made)
    size = float(np.linalg.norm(spacecraft.momentum))

    def left(schedule: Schedule) -> tuple[Vector, Flight]:
        flown = fly(schedule)
        return (residual_equations.misses(flown, equations) - aside) / size, flown

    def slopes_of(schedule: Schedule, flown: Flight) -> Vector:
        return parameters.slopes(schedule, flown, equations, step) / size

    x = parameters.start
    value, flown = left(made)
    slopes = slopes_of(made, flown)
    for _ in range(STEPS):
        norm = float(np.linalg.norm(value))
        if norm <= CONVERGED:
            break
        move = bounded_step(slopes, value, x, parameters.scale, parameters.lower, parameters.upper)
        for shrink in range(5):
            trial = np.clip(x + move * 0.5**shrink, parameters.lower, parameters.upper)
            following, _ = left(parameters.schedule(trial))
            if np.linalg.norm(following) < norm:
                break
        moved = (trial - x) / parameters.scale
        if not moved.any():
            break
        slopes = slopes + np.outer(following - value - slopes @ moved, moved) / (moved @ moved)
        if np.linalg.norm(following) >= norm:
            break
        x, value = trial, following
    if spacecraft.limits.tick is None:
        return parameters.schedule(x)
    return on_ticks(spacecraft, parameters, x, left, slopes_of)
