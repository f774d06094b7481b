"""Bodies, sensors and thresholds of closed loops in one line each; angles are given in degrees."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.builders import channel, cross, fan, spinner

from nutdamp.control_loop import budget
from nutdamp.physics.attitude import matrix
from nutdamp.spacecraft.equipment import Channel, Loop, Sensor
from nutdamp.spacecraft.model import Spacecraft, Vector

rad = math.radians


def four(
    torque: float = 6.0, least: float = 0.002, most: float = 0.3, **given: Any
) -> tuple[Channel, ...]:
    """The channels of Magnus 1970."""
    return cross(torque, "M", min_on_time=least, max_on_time=most, **given)


def around(
    count: int, torque: float, first: float = 0.0, least: float = 0.002
) -> tuple[Channel, ...]:
    """Channels ``T0``, ``T1`` … with torques evenly round axis 3."""
    return fan(count, torque, first, min_on_time=least, max_on_time=1.0)


FOUR = four()
AXIAL = tuple(
    channel(name, *torque, min_on_time=0.002, max_on_time=0.3)
    for name, torque in {"a": (6, 1, 0.5), "b": (-5, 3, -0.8), "c": (0, -7, 0.2)}.items()
)
"""Three channels with axial parts."""


def fired_by(
    degrees: float = 2.0, channels: tuple[Channel, ...] = FOUR, **given: Any
) -> Spacecraft:
    """A spinner with these channels; ``loop`` and ``dissipation`` may be given too."""
    fields = {name: given.pop(name) for name in ("loop", "dissipation") if name in given}
    return replace(spinner(degrees=degrees, channels=channels, **given), **fields)


def fires(
    sensor: Sensor | None = None, start: float = 0.3, stop: float = 0.1, **given: Any
) -> Loop:
    """A loop with the two thresholds; of an ideal gyro by default."""
    return Loop(sensor or Sensor(), start=rad(start), stop=rad(stop), **given)


def ideal(**given: Any) -> Loop:
    """A loop that sees everything and fires at any nutation."""
    return replace(Loop(Sensor(), start=1e-7, stop=0.0), **given)


def turned(*angles: float) -> Vector:
    """Axes (3, 3) turned by three angles, rad, about the axes 1, 2, 3 in this order."""
    axes = np.eye(3)
    for axis, angle in enumerate(angles):
        axes = (
            matrix(np.array([math.cos(0.5 * angle), *(math.sin(0.5 * angle) * np.eye(3)[axis])]))
            @ axes
        )
    return axes


def transverse_size(rates: Vector) -> float:
    """|ω1 + i ω2|."""
    return math.hypot(rates[0], rates[1])


def follow_few_cycles(patch: pytest.MonkeyPatch) -> None:
    """Budgets by 16 loops of 3 cycles or 30 firings: known to 2 %, their texts the same."""
    patch.setattr(budget.Cycles.attractors, "__defaults__", (0j, 16, 3))
    patch.setattr(budget, "FIRINGS", 30)
    patch.setattr(budget, "ENTRIES", 2)
