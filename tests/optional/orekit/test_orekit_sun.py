"""Where the Sun is seen, against Orekit."""

from __future__ import annotations

import math

import pytest
from support import orekit

from nutdamp.common.time import Epoch
from nutdamp.physics import attitude, sky


@pytest.mark.orekit
@pytest.mark.parametrize("text", ["1998-01-07T02:28:44", "2026-03-20T12:00:00", "2026-09-11T06:30:00"])
def test_orekit_sees_it_there(text: str) -> None:
    """Its analytical Sun needs no ephemeris, and errs by up to 0.1 deg itself: a check of frame and time."""
    orekit.start_or_skip()
    provider = orekit.java("org.orekit.bodies.AnalyticalSolarPositionProvider")()
    frame = orekit.java("org.orekit.frames.FramesFactory").getEME2000()
    seen = orekit.components(provider.getPosition(orekit.date(text), frame))
    expected = sky.direction(Epoch.parse(f"{text}Z").days_of_j2000)
    assert math.degrees(attitude.angle_between(seen, expected)) < 0.1
