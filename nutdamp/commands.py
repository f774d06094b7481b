"""What a spinner is commanded with: a Sun sensor that starts the clock of each spin, and blocks of pulses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class SunSensor:
    """Gives a pulse in each spin, when the Sun passes its ``azimuth``: rad in the body, about axis 3 from axis 1.

    It sees the Sun at most ``half_width`` rad from ``elevation``, which is counted from the plane square to axis 3
    towards the spin axis. ``jitter`` s is one sigma of its pulses.
    """

    azimuth: float
    elevation: float = 0.0
    half_width: float = 0.5 * math.pi
    jitter: float = 0.0

    @property
    def sees_all(self) -> bool:
        """Whether no direction but those along the axis is out of its view, and so every passage of the Sun is seen."""
        return self.elevation == 0.0 and self.half_width >= 0.5 * math.pi

    def sees(self, sun_angle: Any) -> Any:
        """Whether it sees the Sun at this angle (rad) from the spin axis; of arrays each."""
        return abs(0.5 * math.pi - sun_angle - self.elevation) <= self.half_width


@dataclass(frozen=True, slots=True, eq=False)
class Commands:
    """What a block may hold: delays 0, ``delay_step``, … up to ``delay_max`` s, ``widths`` (n,) s, at most
    ``max_count`` pulses, one in ``every`` so many spins.
    """

    delay_step: float
    delay_max: float
    widths: NDArray[np.float64]
    max_count: int
    every: tuple[int, ...]
    width_step: float | None = None

    def delay_counts(self, delay: float) -> int:
        """Steps of a ``delay`` s."""
        return round(delay / self.delay_step)

    def width_counts(self, width: float) -> int:
        """Steps of a ``width`` s; of widths that are a list the number of the entry next to it, 1 the shortest."""
        if self.width_step is not None:
            return round(width / self.width_step)
        return 1 + int(np.abs(self.widths - width).argmin())

    def delay_of(self, counts: float) -> float:
        """The delay, s, of so many steps."""
        return counts * self.delay_step

    def width_of(self, counts: float) -> float | None:
        """The width, s, of so many steps, or of that number in the list; None where the list has no such number."""
        if self.width_step is not None:
            return counts * self.width_step
        return float(self.widths[int(counts) - 1]) if 1 <= counts <= len(self.widths) else None


@dataclass(frozen=True, slots=True)
class Block:
    """``count`` pulses of ``channel``, each ``width`` s long and begun ``delay`` s after a Sun pulse.

    ``first`` is the number of the Sun pulse of the first one, 1 the first after t = 0; from then on every
    ``every``-th Sun pulse fires one.
    """

    channel: str
    first: int
    delay: float
    width: float
    count: int
    every: int = 1

    @property
    def sun_pulses(self) -> range:
        """Numbers of the Sun pulses that fire it."""
        return range(self.first, self.first + self.count * self.every, self.every)
