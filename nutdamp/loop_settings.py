"""A closed loop as the file describes it: the sensor, the law that fires by it, and faults to fly with. SI, rad."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

GYRO, ACCELEROMETER = "gyro", "accelerometer"
"""Kinds of sensor: rate gyros about the body axes 1 and 2, or one accelerometer."""

FOUR_PULSE, ONE_PULSE, BANG = "four-pulse", "one-pulse", "bang"
"""Laws: pulses up to a length in proportion to what is left; one pulse for all that is left; pulses all alike."""


@dataclass(frozen=True, slots=True, eq=False)
class Sensor:
    """What the loop sees: ``scale`` times the truth plus ``bias``, with ``noise`` (one sigma), in steps.

    ``bias``, ``noise`` and the steps of ``quantisation`` are rad/s of a gyro, m/s² of an accelerometer, which is at
    ``position`` (3,) m from the centre of mass and measures along the unit vector ``axis`` (3,), both in principal
    axes. ``rate`` Hz is that of its samples, None is a continuous signal; ``delay`` s until a sample can be used;
    ``low_pass`` s the time constant of a first-order filter over the samples, 0 is none. ``second`` is what the gyro
    about axis 2 has as scale and bias, where that differs.
    """

    kind: str = GYRO
    rate: float | None = None
    quantisation: float = 0.0
    noise: float = 0.0
    bias: float = 0.0
    scale: float = 1.0
    delay: float = 0.0
    low_pass: float = 0.0
    position: Vector = field(default_factory=lambda: np.zeros(3))
    axis: Vector = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    second: tuple[float, float] | None = None

    @property
    def scales(self) -> tuple[float, ...]:
        """Scale of each column of the signal."""
        return self._each(self.scale, 0)

    @property
    def biases(self) -> tuple[float, ...]:
        """Bias of each column, rad/s or m/s²."""
        return self._each(self.bias, 1)

    def _each(self, value: float, which: int) -> tuple[float, ...]:
        if self.kind == ACCELEROMETER:
            return (value,)
        return (value, value if self.second is None else self.second[which])


@dataclass(frozen=True, slots=True)
class Loop:
    """Fire by what ``sensor`` shows, from where the nutation reaches ``start`` rad until it is down to ``stop`` rad.

    ``law`` is one of the names above; ``on_time`` s is the longest pulse of four-pulse (None: as the scheme) and every
    pulse of bang. After a firing the sensor is not looked at for ``settle`` s, and the next one begins ``min_interval``
    s later at the earliest. ``predict``: delay, filter and half the on-time are compensated. ``reversed``: channels
    that in truth push the other way.
    """

    sensor: Sensor
    law: str = FOUR_PULSE
    start: float = 0.0
    stop: float = 0.0
    settle: float = 0.0
    min_interval: float = 0.0
    predict: bool = True
    on_time: float | None = None
    reversed: tuple[str, ...] = ()
