"""The unknowns of the linear program of `optimal`: how long to fire a channel at a moment, or in a slot of time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.spacecraft import Vector


class Columns(NamedTuple):
    """Unknowns of the program, n each: index of the channel, moment in s, width in s (0: an impulse).

    Columns of the same ``burn``, a number from 0 on, are together on for no longer than their channel may be.
    """

    channel: NDArray[np.int_]
    t: Vector
    width: Vector
    burn: NDArray[np.int_]

    def of(self, which: NDArray[np.bool_] | NDArray[np.int_]) -> Columns:
        """Some of the columns."""
        return Columns(self.channel[which], self.t[which], self.width[which], self.burn[which])

    def joined(self, other: Columns) -> Columns:
        """These columns and others."""
        return Columns(
            np.concatenate([self.channel, other.channel]),
            np.concatenate([self.t, other.t]),
            np.concatenate([self.width, other.width]),
            np.concatenate([self.burn, other.burn]),
        )


def alone(channel: NDArray[np.int_], t: Vector, width: Vector) -> Columns:
    """Columns that belong to no burn."""
    return Columns(channel, t, width, np.full(len(t), -1))
