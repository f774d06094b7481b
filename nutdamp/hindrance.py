"""What keeps a schedule from leaving less nutation: disturbances, limits of the file, or the scheme itself.

It gives data; `nutdamp.remarks` and `nutdamp.presentation.verdicts` have the words.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from nutdamp.limits import rounded_off
from nutdamp.schedule import Schedule
from nutdamp.schemes.tools.symmetric_model import steady_omega
from nutdamp.spacecraft import Spacecraft

WORST = math.hypot(1.0, 1.5)
"""What ticks leave at worst, over what chance leaves: the centre is off by half the on-time's error and the start's."""


class Obstacle(Enum):
    """What keeps a plan from leaving less nutation."""

    UNPLANNED_DISTURBANCES = "disturbances that the plan was made without"
    STEADY_TILT = "disturbances, under which a tilt stays"
    MAX_PULSES = "limits.max_pulses"
    RESOLUTION = "limits.tick"
    LIMITS = "limits of the file that bind"
    SCHEME = "the scheme"


@dataclass(frozen=True, eq=False)
class Hindrance:
    """What hinders ``pulses``, which leave ``nutation`` rad; ``aware``: planned with the disturbances."""

    spacecraft: Spacecraft
    pulses: Schedule
    aware: bool
    nutation: float

    @property
    def obstacle(self) -> Obstacle:
        """What counts most."""
        body, limits = self.spacecraft, self.spacecraft.limits
        if self.full and self.to_the_end:
            return Obstacle.LIMITS
        if body.disturbances:
            return Obstacle.STEADY_TILT if self.aware else Obstacle.UNPLANNED_DISTURBANCES
        if self.nutation <= self.rounding:
            return Obstacle.RESOLUTION
        if len(self.pulses) == limits.max_pulses:
            return Obstacle.MAX_PULSES
        return Obstacle.LIMITS if self.binding or self.suspected else Obstacle.SCHEME

    @property
    def binding(self) -> tuple[str, ...]:
        """Keys of the file that name the limits which the schedule itself shows to end it."""
        found = {"max_on_time": self.full, "limits.horizon": self.to_the_end}
        if not any(found.values()):
            found["min_on_time"] = self.shortest
        return tuple(key for key in found if found[key])

    @property
    def suspected(self) -> tuple[str, ...]:
        """Keys of those that the file gives and that may end it: to know it takes a plan without them."""
        limits = self.spacecraft.limits
        ticks = limits.tick is not None and not self.full and not self.to_the_end
        found = {"limits.tick": ticks, "limits.blackout": bool(limits.blackout)}
        return tuple(key for key in found if found[key])

    @property
    def full(self) -> bool:
        """Whether every pulse is as long as its channel may be on; never where nothing says how long that is."""
        longest = {channel.name: channel.max_on_time for channel in self.spacecraft.channels}
        most = [longest.get(pulse.channel, math.inf) for pulse in self.pulses]
        return bool(most) and all(
            one.loaded[1] >= long * (1.0 - 1e-9) for one, long in zip(self.pulses, most, strict=True)
        )

    @property
    def shortest(self) -> bool:
        """Whether a pulse is no longer than its channel has to be on."""
        least = {channel.name: channel.min_on_time for channel in self.spacecraft.channels}
        return any(0.0 < one.loaded[1] <= least.get(one.channel, 0.0) * (1.0 + 1e-9) for one in self.pulses)

    @property
    def to_the_end(self) -> bool:
        """Whether less than one nutation period is left of the horizon after the last pulse."""
        body = self.spacecraft
        return body.horizon - self.pulses.end < body.nutation_period

    @property
    def rounding(self) -> float:
        """The most, rad, that starts and on-times half a tick off leave, to first order; 0 without ticks."""
        return WORST * math.fsum(rounded_off(self.spacecraft, self.pulses))

    @property
    def steady_tilt(self) -> float:
        """Angle in rad at which the disturbances hold the body once the pulses are over."""
        inertia, spin = self.spacecraft.inertia, self.spacecraft.spin
        return math.atan(inertia.A * abs(steady_omega(self.spacecraft, self.pulses.end)) / (inertia.C * abs(spin)))
