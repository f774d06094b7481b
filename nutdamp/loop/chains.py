"""Many cycles of a closed loop that are followed side by side: where each is, and what it has added up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.loop.law import ComplexArray
from nutdamp.spacecraft import Vector

Rows = NDArray[np.int64]


class Cycle(NamedTuple):
    """What goes on in the limit cycle; rates are 1/s.

    ``pulses``, ``cycles`` (from pause to pause; 0 where the loop never pauses), ``impulse`` N m s/s and ``propellant``
    kg/s (None where it is not known), ``spin_rate`` rad/s², ``doubt``: one sigma of ``pulses`` over it. Nutation, rad:
    ``high`` as firings begin (mean), ``low`` as they have ended (geometric mean), of each cycle, and the ``largest``.
    """

    pulses: float
    cycles: float
    impulse: float
    propellant: float | None
    spin_rate: float
    doubt: float
    high: float
    low: float
    largest: float


class Sums(NamedTuple):
    """What a chain has added up by a moment: time (s) of the last pulse, and its largest and last |z|, rad/s."""

    time: float = 0.0
    pulses: float = 0.0
    impulse: float = 0.0
    propellant: float = 0.0
    spin: float = 0.0
    cycles: float = 0.0
    largest: float = 0.0
    last: float = 0.0


ADDED = 6
"""Columns of `Sums` of which differences count."""


@dataclass(eq=False)
class Chains:
    """Where each chain is: z at the sample ``number``, what its channels waited before, the noise of its samples.

    ``fresh``: at the first estimate after a firing. ``ready`` s: from when on it may fire again.
    """

    z: ComplexArray
    number: Rows
    active: NDArray[np.bool_]
    fresh: NDArray[np.bool_]
    ready: Vector
    carried: Vector
    white: ComplexArray
    sums: list[Sums]
    firings: list[list[Sums]]
    cycles: list[list[Sums]]

    def some(self, rows: list[int]) -> Chains:
        """What some of them have added up."""
        return replace(self, firings=[self.firings[row] for row in rows], cycles=[self.cycles[row] for row in rows])
