"""Where the Sun is seen, against ERFA (golden/make_sun.py) and, where it runs, Orekit."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest
from support import orekit, places

from nutdamp.epoch import Epoch
from nutdamp.physics import attitude, sun

GOLDEN = (places.GOLDEN / "sun.csv").read_text(encoding="utf-8")
ROWS = list(csv.DictReader(GOLDEN.splitlines()))


def test_the_direction_is_right_to_a_hundredth_of_a_degree_from_1972_to_2100() -> None:
    assert len(ROWS) == 100
    for row in ROWS:
        expected = np.array([float(row[axis]) for axis in "xyz"])
        error = math.degrees(attitude.angle_between(sun.direction(float(row["days"])), expected))
        assert error < 0.01, row


def test_days_count_from_j2000_in_terrestrial_time() -> None:
    """TT is TAI + 32.184 s, and in 2000 TAI was UTC + 32 s."""
    assert Epoch.parse("2000-01-01T11:58:55.816Z").days_of_j2000 == 0.0
    assert Epoch.parse("2000-01-02T11:58:55.816Z").days_of_j2000 == 1.0
    assert Epoch.parse("1972-01-01T00:00:00Z").days_of_j2000 == pytest.approx(-10227.4995118, abs=1e-6)


@pytest.mark.orekit
@pytest.mark.parametrize("text", ["1998-01-07T02:28:44", "2026-03-20T12:00:00", "2026-09-11T06:30:00"])
def test_orekit_sees_it_there(text: str) -> None:
    """Its analytical Sun needs no ephemeris, and errs by up to 0.1 deg itself: a check of frame and time."""
    orekit.start_or_skip()
    provider = orekit.java("org.orekit.bodies.AnalyticalSolarPositionProvider")()
    frame = orekit.java("org.orekit.frames.FramesFactory").getEME2000()
    seen = orekit.components(provider.getPosition(orekit.date(text), frame))
    found = sun.direction(Epoch.parse(f"{text}Z").days_of_j2000)
    assert math.degrees(attitude.angle_between(seen, found)) < 0.1
