"""Axes of frames against astropy, where it is installed: pip install 'nutdamp[interop]'."""

from importlib import import_module
from typing import Any

import numpy as np
import pytest

from nutdamp.common.time import Epoch
from nutdamp.physics import attitude, frames

pytestmark = pytest.mark.orekit

DATES = ("1972-06-01T00:00:00Z", "2014-07-02T15:00:00Z", "2050-12-31T06:30:00Z")
BOUNDS = {"ECLIPJ2000": 2e-5, "ECLIPDATE": 1e-4, "MOD": 1e-4}  # deg; astropy's has the frame bias


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("date", DATES)
@pytest.mark.parametrize("frame", BOUNDS)
def test_directions_are_those_of_astropy(frame: str, date: str) -> None:
    coordinates = pytest.importorskip(
        "astropy.coordinates", reason="NOT CHECKED against astropy: pip install 'nutdamp[interop]'"
    )
    moment = import_module("astropy.time").Time(date.rstrip("Z"), scale="utc")
    around, above = np.meshgrid(np.arange(10.0, 360.0, 50.0), [-80.0, -20.0, 0.0, 35.0, 89.0])
    angles = {"unit": "deg", "frame": _frame(coordinates, frame, moment)}
    stars = coordinates.SkyCoord(around.ravel(), above.ravel(), **angles)
    equator = stars.transform_to(
        coordinates.FK5(equinox="J2000") if frame == "MOD" else coordinates.GCRS(obstime=moment)
    )
    expected = np.array([equator.cartesian.x, equator.cartesian.y, equator.cartesian.z]).T
    stated = np.array([stars.cartesian.x, stars.cartesian.y, stars.cartesian.z]).T
    seen = stated @ frames.frame_axes(frame, Epoch.parse(date).days_of_j2000).T
    assert np.degrees(attitude.angle_between(seen, expected)).max() < BOUNDS[frame]


def _frame(coordinates: Any, frame: str, moment: Any) -> Any:
    if frame == "MOD":
        return coordinates.FK5(equinox=moment)
    equinox = "J2000" if frame == "ECLIPJ2000" else moment
    return coordinates.GeocentricMeanEcliptic(equinox=equinox, obstime=moment)
