"""What thrust depends on besides commands: how cold the nozzle is, and the pressure in the tank."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

SMALL = 1e-9
"""Share of a pressure by which the slope of a table is taken."""


def possible(tank: Tank) -> Any:
    """Whether there is such a tank: one number, or of arrays each."""
    falls = (tank.final_pressure > 0.0) & (tank.final_pressure <= tank.pressure)
    return falls & (tank.propellant > 0.0) & (tank.exponent >= 0.0)


@dataclass(frozen=True, slots=True)
class Cold:
    """The first pulse of each channel has ``first`` times the thrust; over ``pulses`` of them this decays to one.

    ``fired``: pulses by channel before t = 0. The first two may be arrays, of cases.
    """

    first: Any
    pulses: Any
    fired: Mapping[str, int] = field(default_factory=dict)

    def factor(self, before: int) -> Any:
        """Of the pulse that comes after so many ``before`` it: 1 - (1 - first) exp(-k/pulses)."""
        return 1.0 - (1.0 - self.first) * self.decay(before)

    def decay(self, before: int) -> Any:
        """What is left of the difference to a warm nozzle then, over that of the first pulse."""
        return np.exp(-before / self.pulses) if np.ndim(self.pulses) else math.exp(-before / self.pulses)


@dataclass(frozen=True, slots=True)
class Tank:
    """A tank in blowdown: ``propellant`` kg, ``pressure`` when full and ``final_pressure`` Pa with nothing left.

    Thrust goes with the pressure to the power ``exponent``. ``isp`` are rows of pressure, Pa, rising, and specific
    impulse, s, between which it runs evenly; None leaves it to the thrusters. ``used`` kg were used before t = 0. The
    principal moments (I1, I2, I3) of the spacecraft fall by ``inertia_per_kg`` kg m² for each kg that is used; None:
    they stay. The first four may be arrays, of cases.
    """

    propellant: Any
    pressure: Any
    final_pressure: Any
    exponent: Any
    isp: tuple[tuple[float, float], ...] | None = None
    used: float = 0.0
    inertia_per_kg: tuple[float, float, float] | None = None

    @property
    def doubled(self) -> Tank:
        """One with twice the propellant, in which the pressure falls as in this one, and on."""
        low = self.pressure / (2.0 * self.pressure / self.final_pressure - 1.0)
        return replace(self, propellant=2.0 * self.propellant, final_pressure=low)

    def pressure_after(self, used: Any) -> Any:
        """Pressure (Pa) of the gas once so many kg are ``used``, at most all of it: one number or an array.

        At constant temperature it expands from V0 to V0 + used/density, and final/initial pressure is
        V0/(V0 + propellant/density): p = p0/(1 + (p0/p1 - 1) used/propellant).
        """
        many = np.ndim(used) or np.ndim(self.propellant)
        used = np.minimum(used, self.propellant) if many else min(used, self.propellant)
        return self.pressure / (1.0 + (self.pressure / self.final_pressure - 1.0) * used / self.propellant)

    def thrust_factor(self, used: Any) -> Any:
        """Thrust over that of a full tank."""
        return (self.pressure_after(used) / self.pressure) ** self.exponent

    def share(self, used: Any, more: Any) -> Any:
        """Share of a pulse that is fired which takes ``more`` kg after ``used``: 1, or as far as the propellant lasts.

        A pulse during which the tank runs empty is as long as commanded, and that much weaker.
        """
        left, many = self.propellant - used, np.ndim(used) or np.ndim(more) or np.ndim(self.propellant)
        if not many:
            return 1.0 if more <= left or more == 0.0 else max(left, 0.0) / more
        lasts = np.real(more) <= np.real(left)
        return np.where(lasts, 1.0, np.where(np.real(left) > 0.0, left, 0.0) / np.where(lasts, 1.0, more))

    def isp_after(self, used: Any) -> Any:
        """Specific impulse, s; None where the thrusters have their own."""
        if self.isp is None:
            return None
        pressures, values = zip(*self.isp, strict=True)
        pressure = self.pressure_after(used)
        found = np.interp(np.real(pressure), pressures, values)
        if not np.iscomplexobj(pressure):
            return found
        rising = np.interp(np.real(pressure) * (1.0 + SMALL), pressures, values) - found
        return found + 1j * np.imag(pressure) * rising / (SMALL * np.real(pressure))
