"""The motion as arrays: rates, attitude, spin axis, angular momentum and cone angles over time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from nutdamp.physics import attitude
from nutdamp.physics.arc_cones import arc_cones
from nutdamp.rounding import SAME_ANGLE
from nutdamp.spacecraft import Inertia

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Track:
    """The motion over n rows, in principal axes.

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
    moments: tuple[float, float, float],
    spin0: float,
    t: Array,
    rates: Array,
    quaternion: Array,
    pulse: NDArray[np.int64],
) -> Track:
    """Everything that follows from rates (n, 3) and attitude (n, 4) for a body with principal ``moments`` (kg m²).

    The spin axis is the end of body axis 3 about which the body spins at t = 0, by the sign of ``spin0``. The cone
    angles are those of each moment; with I1 ≠ I2 they swing, see `widest`.
    """
    sense = math.copysign(1.0, spin0)
    momentum = rates * np.asarray(moments)
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


def widest(track: Track, moments: tuple[float, float, float], spin0: float) -> Track:
    """The track with the cone angles at the largest nutation of the free motion through each row, as `make_track`."""
    if moments[0] == moments[1]:
        return track
    found = [arc_cones(moments, row, math.copysign(1.0, spin0)) for row in track.rates]
    nutation, body_cone = np.array(found, dtype=float).reshape(-1, 2).T
    return replace(track, nutation=nutation, body_cone=body_cone, space_cone=nutation - body_cone)


def in_file_axes(track: Track, inertia: Inertia) -> Track:
    """The track with rates and quaternion in the axes of the file."""
    rates, quaternion = inertia.in_file_axes(track.rates, track.quaternion)
    return replace(track, rates=rates, quaternion=quaternion)


@dataclass(frozen=True, slots=True)
class Extremes:
    """How far the spin axis strays, rad and s.

    ``farthest`` and ``nearest`` are angles from H at t = 0 with their times; ``x`` and ``y`` the range of the axis
    direction in the inertial frame, as angles from its y-z and x-z planes; ``right_ascension`` (the
    shortest range, which may pass 2π) and ``declination`` the same on the sphere.
    """

    farthest: tuple[float, float]
    nearest: tuple[float, float]
    x: tuple[float, float]
    y: tuple[float, float]
    right_ascension: tuple[float, float]
    declination: tuple[float, float]


def extremes(track: Track) -> Extremes:
    """Extremes of the axis track over its rows."""
    away = attitude.angle_between(track.axis, track.momentum[0])
    # The first of all that are equal but for rounding: after the last pulse of a good plan nothing moves any more.
    far = int(np.argmax(away >= away.max() - SAME_ANGLE))
    near = int(np.argmax(away <= away.min() + SAME_ANGLE))
    x, y = np.arcsin(np.clip(track.axis[:, :2].T, -1.0, 1.0))
    ascension = np.sort(np.arctan2(track.axis[:, 1], track.axis[:, 0]) % (2 * math.pi))
    # The widest gap between neighbouring values lies outside the range, across 0 or not.
    gaps = np.diff(ascension, append=ascension[0] + 2 * math.pi)
    widest = int(np.argmax(gaps))
    west = float(ascension[(widest + 1) % len(ascension)])
    declination = np.arctan2(track.axis[:, 2], np.hypot(track.axis[:, 0], track.axis[:, 1]))
    return Extremes(
        farthest=(float(away[far]), float(track.t[far])),
        nearest=(float(away[near]), float(track.t[near])),
        x=(float(x.min()), float(x.max())),
        y=(float(y.min()), float(y.max())),
        right_ascension=(west, west + 2 * math.pi - float(gaps[widest])),
        declination=(float(declination.min()), float(declination.max())),
    )
