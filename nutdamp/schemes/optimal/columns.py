"""The unknowns of the linear program of `optimal`: how long to fire a channel at a moment, or in a slot of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.spacecraft import Channel, Vector


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


@dataclass(frozen=True, slots=True)
class Burn:
    """Neighbouring slots of one channel taken together: centre and on-time in s."""

    channel: Channel
    t: float
    on_time: float

    @property
    def impulse(self) -> float:
        """Torque times on-time, N m s."""
        return self.on_time * float(np.linalg.norm(self.channel.torque))


def burns(channels: Sequence[Channel], columns: Columns, on_times: Vector, apart: float) -> tuple[Burn, ...]:
    """Columns of a channel that are less than ``apart`` s from one another as one burn about their common centre."""
    found: list[Burn] = []
    for index in np.flatnonzero(np.bincount(columns.channel)).tolist():
        mine = np.flatnonzero(columns.channel == index)
        mine = mine[np.argsort(columns.t[mine], kind="stable")]
        cut = (np.diff(columns.t[mine]) > apart) | (np.diff(columns.burn[mine]) != 0)
        for group in np.split(mine, np.flatnonzero(cut) + 1):
            total = float(on_times[group].sum())
            found.append(Burn(channels[index], float(on_times[group] @ columns.t[group]) / total, total))
    return tuple(sorted(found, key=lambda burn: burn.t))


def peaks(times: Vector, worth: Vector) -> tuple[Vector, Vector]:
    """Moments (n,) s at which what is worth ``worth`` (n, 5) at even ``times`` (n, 5) s is worth most, and how much.

    By the parabola through the best of the five and those beside it; at an end of them, that end.
    """
    best = np.argmax(worth, axis=1)
    every, inner = np.arange(len(best)), np.clip(best, 1, 3)
    low, top, high = (worth[every, inner + shift] for shift in (-1, 0, 1))
    bend = low - 2.0 * top + high
    aside = np.divide(0.5 * (low - high), bend, out=np.zeros_like(bend), where=bend < 0.0)
    aside = np.where(best == inner, aside, best - inner)
    most = np.where(best == inner, top - 0.25 * (low - high) * aside, worth[every, best])
    return times[every, inner] + aside * (times[:, 1] - times[:, 0]), most
