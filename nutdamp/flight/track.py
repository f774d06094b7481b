"""Track: rates, attitude, spin axis, angular momentum and cone angles over time, as arrays."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common.numerics import SAME_ANGLE
from nutdamp.physics import attitude
from nutdamp.physics.triaxial import widest_cones
from nutdamp.spacecraft.model import Inertia

Array = NDArray[np.float64]

PIECE = 20_000
"""Rows of a track that are held at a time where many are written."""

BINS = 7200
"""Parts of a turn by which a range of right ascension is distinguished from a whole turn: 0.05 deg."""


@dataclass(frozen=True, slots=True)
class Track:
    """Motion over n rows, in principal axes.

    ``t`` (n,) s; ``rates`` (n, 3) rad/s; ``quaternion`` (n, 4) body -> inertial; ``axis`` (n, 3) spin axis and
    ``momentum`` (n, 3) N m s in the inertial frame; ``nutation``, ``body_cone``, ``space_cone`` (n,) rad;
    ``pulse`` (n,) pulses completed.
    """

    t: Array
    rates: Array
    quaternion: Array
    axis: Array
    momentum: Array
    nutation: Array
    body_cone: Array
    space_cone: Array
    pulse: NDArray[np.int64]


def make_track(
    moments: Array,
    sense: float,
    wheel: float,
    t: Array,
    rates: Array,
    quaternion: Array,
    pulse: NDArray[np.int64],
) -> Track:
    """Everything that follows from rates (n, 3) and attitude (n, 4) for a body with principal ``moments`` (kg m²).

    These are (3,), or (n, 3) where they change; ``wheel`` is h in N m s. The spin axis is ``sense``·e3. The cone angles
    are those of each moment; with I1 ≠ I2 they swing, see `widest`.
    """
    momentum = rates * moments + np.array([0.0, 0.0, wheel])
    nutation = np.arctan2(np.hypot(momentum[:, 0], momentum[:, 1]), sense * momentum[:, 2])
    body_cone = np.arctan2(np.hypot(rates[:, 0], rates[:, 1]), sense * rates[:, 2])
    return Track(
        t=t,
        rates=rates,
        quaternion=quaternion,
        axis=attitude.rotate(quaternion, np.array([0.0, 0.0, sense])),
        momentum=attitude.rotate(quaternion, momentum),
        nutation=nutation,
        body_cone=body_cone,
        space_cone=nutation - body_cone,
        pulse=pulse,
    )


def widest(track: Track, moments: Array, sense: float, wheel: float) -> Track:
    """Track with the cone angles at the largest nutation of the free motion through each row, as `make_track`."""
    if np.array_equal(moments[..., 0], moments[..., 1]):
        return track
    nutation, body_cone = widest_cones(np.broadcast_to(moments, track.rates.shape).T, track.rates.T, sense, wheel)
    return replace(track, nutation=nutation, body_cone=body_cone, space_cone=nutation - body_cone)


def in_file_axes(track: Track, inertia: Inertia) -> Track:
    """Track with rates and quaternion in the axes of the file."""
    rates, quaternion = inertia.in_file_axes(track.rates, track.quaternion)
    return replace(track, rates=rates, quaternion=quaternion)


class EvenTimes(NamedTuple):
    """Part of the even times (n,) s within a stretch; ``first`` and ``last`` part of it."""

    times: Array
    first: bool
    last: bool


def even_times(samples: int, until: float, start: float, end: float) -> Iterator[EvenTimes]:
    """Members of ``samples`` even times from 0 to ``until`` s between ``start`` and ``end``, `PIECE` at a time.

    There is one part at least, which may be empty. The times are those of np.linspace.
    """
    step = until / max(samples - 1, 1)
    low, high = (min(max(int(time / step) + more, 0), samples) for time, more in ((start, -1), (end, 2)))
    for begin in range(low, max(high, low + 1), PIECE):
        index = np.arange(begin, min(begin + PIECE, high))
        times: Array = np.asarray(index * step, dtype=np.float64)
        if samples > 1:
            times[index == samples - 1] = until
        inside = times[(times > start) & (times < end)]
        yield EvenTimes(inside, begin == low, begin + PIECE >= high)


@dataclass(frozen=True, slots=True)
class Extremes:
    """Excursion of the spin axis over ``rows`` rows from 0 to ``until`` s, rad and s.

    ``farthest`` and ``nearest`` are angles from H at t = 0 with their times; ``x`` and ``y`` the range of the axis
    direction in the inertial frame, as angles from its y-z and x-z planes; ``right_ascension`` (the
    shortest range, which may pass 2π) and ``declination`` the same on the sphere.
    """

    rows: int
    until: float
    farthest: tuple[float, float]
    nearest: tuple[float, float]
    x: tuple[float, float]
    y: tuple[float, float]
    right_ascension: tuple[float, float]
    declination: tuple[float, float]


def extremes(pieces: Iterable[Track]) -> Extremes:
    """Extremes of the axis track over the rows of its pieces, at least one."""
    rows, until, start = 0, 0.0, np.zeros(3)
    far, near = _Record(), _Record()
    ranges, ascension = _Range(3), _Circle()
    for piece in pieces:
        if not len(piece.t):
            continue
        start = piece.momentum[0] if rows == 0 else start
        rows, until = rows + len(piece.t), float(piece.t[-1])
        away = attitude.angle_between(piece.axis, start)
        far.add(away, piece.t)
        near.add(-away, piece.t)
        declination = np.arctan2(piece.axis[:, 2], np.hypot(piece.axis[:, 0], piece.axis[:, 1]))
        ranges.add(np.column_stack([np.arcsin(np.clip(piece.axis[:, :2], -1.0, 1.0)), declination]))
        ascension.add(np.arctan2(piece.axis[:, 1], piece.axis[:, 0]))
    nearest, when = near.first
    x, y, declinations = ranges.pairs
    return Extremes(rows, until, far.first, (-nearest, when), x, y, ascension.shortest, declinations)


class _Record:
    """Running maximum, and the first time it was reached, but for rounding.

    After the last pulse of a good plan nothing moves any more: values that differ by rounding are one.
    """

    def __init__(self) -> None:
        self.values, self.times = np.empty(0), np.empty(0)

    def add(self, values: Array, times: Array) -> None:
        """Update by the values of further rows."""
        before = self.values[-1] if len(self.values) else -math.inf
        so_far = np.maximum.accumulate(np.concatenate([[before], values]))
        new = values > so_far[:-1]
        self.values, self.times = np.append(self.values, values[new]), np.append(self.times, times[new])
        kept = self.values >= so_far[-1] - SAME_ANGLE
        self.values, self.times = self.values[kept], self.times[kept]

    @property
    def first(self) -> tuple[float, float]:
        return float(self.values[0]), float(self.times[0])


class _Range:
    """Least and largest of some quantities."""

    def __init__(self, count: int) -> None:
        self.low, self.high = np.full(count, math.inf), np.full(count, -math.inf)

    def add(self, values: Array) -> None:
        self.low, self.high = np.minimum(self.low, values.min(axis=0)), np.maximum(self.high, values.max(axis=0))

    @property
    def pairs(self) -> list[tuple[float, float]]:
        return list(zip(self.low.tolist(), self.high.tolist(), strict=True))


class _Circle:
    """Shortest arc that holds many angles: its complement is the widest gap between neighbours.

    Of the angles in each `BINS`-th of a turn the least and the largest are kept; gaps within one are not looked at.
    """

    def __init__(self) -> None:
        self.low, self.high = np.full(BINS, math.inf), np.full(BINS, -math.inf)

    def add(self, angles: Array) -> None:
        turned = angles % (2.0 * math.pi)
        bins = np.minimum((turned * (BINS / (2.0 * math.pi))).astype(int), BINS - 1)
        np.minimum.at(self.low, bins, turned)
        np.maximum.at(self.high, bins, turned)

    @property
    def shortest(self) -> tuple[float, float]:
        used = self.high >= self.low
        low, high = self.low[used], self.high[used]
        gaps = np.append(low[1:], low[0] + 2.0 * math.pi) - high
        widest = int(np.argmax(gaps))
        west = float(low[(widest + 1) % len(low)])
        return west, west + 2.0 * math.pi - float(gaps[widest])
