"""Where the Sun is seen, to 0.01 deg between 1972 and 2100: enough for the phase of a Sun pulse and for cones."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

OBLIQUITY = math.radians(23.43928)
"""Of the ecliptic at J2000.0."""

ABERRATION = 20.4898 / 3600.0
"""deg by which the Sun is seen behind where it is, at its mean distance (Meeus, 25.10)."""

TILTING, NODE = math.radians(0.013056), math.radians(174.876)
"""How far the ecliptic tilts in a century, and the longitude about which it does."""


def direction(days: float) -> NDArray[np.float64]:
    """Geocentric unit vector (3,) to the apparent Sun in the mean equator and equinox of J2000.0.

    ``days`` since J2000.0 (2000-01-01T12:00 TT). Longitude by J. Meeus, Astronomical Algorithms, 2nd ed., chapter 25,
    "low accuracy", with aberration, taken from ecliptic and equinox of date to those of J2000.0 (chapter 21).
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
    x, y, z = math.cos(latitude) * math.cos(longitude), math.cos(latitude) * math.sin(longitude), math.sin(latitude)
    cosine, sine = math.cos(OBLIQUITY), math.sin(OBLIQUITY)
    return np.array([x, cosine * y - sine * z, sine * y + cosine * z])
