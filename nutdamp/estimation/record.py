"""What was measured in flight, and what was fired meanwhile."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from nutdamp.schedule import Pulse, Schedule

Vector = NDArray[np.float64]

GYROS = ("omega_1", "omega_2", "omega_3")
AXIS = ("axis_x", "axis_y", "axis_z")
ACCELERATION = "acceleration"
SUN_PULSE = "sun_pulse"

UNITS = {**dict.fromkeys(GYROS, "rad/s"), "axis": "rad", ACCELERATION: "m/s²", SUN_PULSE: "s"}
"""Of the signals, as they are compared with a model."""

STEPS = 4000
"""Values of a signal from which the step of its quantisation is found, at most."""

MULTIPLES = 0.9
"""Share of the differences of values that are multiples of a step, for it to be one."""


@dataclass(frozen=True, eq=False)
class Record:
    """Telemetry: ``signals`` by name, (n,) each, at ``times`` (n,) s that rise; NaN where there is no sample.

    Body rates (rad/s) are in the axes of the file, ``axis_x``, ``axis_y``, ``axis_z`` the inertial unit vector along
    the spin axis, ``acceleration`` is m/s². ``sun_pulses`` (k,) s are the times of Sun pulses, known to within
    ``sun_step`` s (full width). ``schedule`` was fired meanwhile. All times count from t = 0 of the file.
    """

    times: Vector
    signals: Mapping[str, Vector] = field(default_factory=dict)
    sun_pulses: Vector = field(default_factory=lambda: np.empty(0))
    sun_step: float = 0.0
    schedule: Schedule = field(default_factory=Schedule)

    @property
    def start(self) -> float:
        """When it begins, s."""
        return float(min([*self.times[:1], *self.sun_pulses[:1]]))

    @property
    def end(self) -> float:
        """When it ends, s."""
        return float(max([*self.times[-1:], *self.sun_pulses[-1:]]))

    @property
    def length(self) -> float:
        """How long it is, s."""
        return self.end - self.start

    @property
    def interval(self) -> float:
        """Usual time between two samples, s; of Sun pulses where there is nothing else."""
        times = self.times if len(self.times) > 1 else self.sun_pulses
        return float(np.median(np.diff(times)))

    @property
    def fired(self) -> tuple[Pulse, ...]:
        """The pulses of the schedule whose thrust falls in the record, wholly or in part."""
        return tuple(one for one in self.schedule if one.over > self.start and one.thrust[0] < self.end)

    def has(self, *names: str) -> bool:
        """Whether all of these signals are there."""
        return all(name in self.signals for name in names)


def quantisation(values: Vector) -> float:
    """Step of which the differences of the values (n,) are multiples, but for some; 0 where there is none."""
    distinct = np.unique(values[np.isfinite(values)][:STEPS])
    gaps = np.diff(distinct)
    gaps = gaps[gaps > 1e-9 * np.abs(distinct).max(initial=0.0)]
    if not len(gaps):
        return 0.0
    multiples = gaps / gaps.min()
    return float(gaps.min()) if np.mean(np.abs(multiples - np.rint(multiples)) < 1e-2) > MULTIPLES else 0.0
