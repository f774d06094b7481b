"""Direction of the Sun from the Earth, and the angle by which it is ahead of a sensor."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OBLIQUITY = math.radians(23.43928)  # obliquity of the ecliptic at J2000.0
ABERRATION = 20.4898 / 3600.0  # mean aberration of the Sun, deg (Meeus, 25.10)

TILTING, NODE = math.radians(0.013056), math.radians(174.876)
"""Tilt of the ecliptic per century, and the longitude of its axis."""


def direction(days: float) -> Array:
    """Geocentric unit vector (3,) to the apparent Sun in the mean equator and equinox of J2000.0.

    ``days`` since J2000.0 (2000-01-01T12:00 TT). To 0.01 deg from 1972 to 2100. By J. Meeus,
    Astronomical Algorithms, 2nd ed., chapter 25, "low accuracy", with aberration, taken to ecliptic
    and equinox of J2000.0 (21).
    """
    centuries = days / 36525.0
    mean_longitude = 280.46646 + centuries * (36000.76983 + centuries * 0.0003032)
    anomaly = math.radians(357.52911 + centuries * (35999.05029 - centuries * 0.0001537))
    eccentricity = 0.016708634 - centuries * (0.000042037 + centuries * 0.0000001267)
    centre = (
        (1.914602 - centuries * (0.004817 + centuries * 0.000014)) * math.sin(anomaly)
        + (0.019993 - centuries * 0.000101) * math.sin(2.0 * anomaly)
        + 0.000289 * math.sin(3.0 * anomaly)
    )
    seen = centre - ABERRATION * (1.0 + eccentricity * math.cos(anomaly + math.radians(centre)))
    longitude = math.radians(mean_longitude + seen - centuries * (1.396971 + centuries * 0.0003086))
    latitude = centuries * TILTING * math.sin(longitude - NODE)
    x = math.cos(latitude) * math.cos(longitude)
    y = math.cos(latitude) * math.sin(longitude)
    z = math.sin(latitude)
    cosine = math.cos(OBLIQUITY)
    sine = math.sin(OBLIQUITY)
    return np.array([x, cosine * y - sine * z, sine * y + cosine * z])


def ahead(
    rates: Array, quaternion: Array, sun: Array, azimuth: float, sense: float
) -> tuple[Array, Array]:
    """Angle (n,) in [0, 2π) by which bodies have to turn until the Sun passes the sensor, and its
    rate, rad/s.

    ``rates`` (3, n) rad/s, ``quaternion`` (4, n) body -> inertial; the others are those of a
    `SunPulseClock`.
    """
    w, x, y, z = quaternion
    s1, s2, s3 = sun
    # The Sun as the body sees it: turned by the conjugate quaternion.
    i, j, k = z * s2 - y * s3, x * s3 - z * s1, y * s1 - x * s2
    s1, s2, s3 = (
        s1 + 2.0 * (w * i + z * j - y * k),
        s2 + 2.0 * (w * j + x * k - z * i),
        s3 + 2.0 * (w * k + y * i - x * j),
    )
    first, second, third = rates
    turning = s1 * (s3 * first - s1 * third) - s2 * (s2 * third - s3 * second)  # ds/dt = s × ω
    return sense * (np.arctan2(s2, s1) - azimuth) % (2.0 * math.pi), -sense * turning / (
        s1 * s1 + s2 * s2
    )
