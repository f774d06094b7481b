"""What thrust depends on besides commands: how cold the nozzle is, and the pressure in the tank."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True, slots=True)
class Cold:
    """The first pulse of each channel has ``first`` times the thrust; over ``pulses`` of them this decays to one.

    ``fired``: pulses by channel before t = 0.
    """

    first: float
    pulses: float
    fired: Mapping[str, int] = field(default_factory=dict)

    def factor(self, before: int) -> float:
        """Of the pulse that comes after so many ``before`` it: 1 - (1 - first) exp(-k/pulses)."""
        return 1.0 - (1.0 - self.first) * self.decay(before)

    def decay(self, before: int) -> float:
        """What is left of the difference to a warm nozzle then, over that of the first pulse."""
        return math.exp(-before / self.pulses)


@dataclass(frozen=True, slots=True)
class Tank:
    """A tank in blowdown: ``propellant`` kg, ``pressure`` when full and ``final_pressure`` Pa with nothing left.

    Thrust goes with the pressure to the power ``exponent``. ``isp`` are rows of pressure, Pa, rising, and specific
    impulse, s, between which it runs evenly; None leaves it to the thrusters. ``used`` kg were used before t = 0.
    """

    propellant: float
    pressure: float
    final_pressure: float
    exponent: float
    isp: tuple[tuple[float, float], ...] | None = None
    used: float = 0.0

    def pressure_after(self, used: Any) -> Any:
        """Pressure (Pa) of the gas once so many kg are ``used``, at most all of it: one number or an array.

        At constant temperature it expands from V0 to V0 + used/density, and final/initial pressure is
        V0/(V0 + propellant/density): p = p0/(1 + (p0/p1 - 1) used/propellant).
        """
        used = np.minimum(used, self.propellant) if np.ndim(used) else min(used, self.propellant)
        return self.pressure / (1.0 + (self.pressure / self.final_pressure - 1.0) * used / self.propellant)

    def thrust_factor(self, used: Any) -> Any:
        """Thrust over that of a full tank."""
        return (self.pressure_after(used) / self.pressure) ** self.exponent

    def isp_after(self, used: Any) -> Any:
        """Specific impulse, s; None where the thrusters have their own."""
        if self.isp is None:
            return None
        pressures, values = zip(*self.isp, strict=True)
        return np.interp(self.pressure_after(used), pressures, values)
