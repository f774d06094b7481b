"""Command blocks against campaigns that were flown: how far they turned the spin axis, and how long they took."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import nutdamp
from nutdamp import flight
from nutdamp.commands import Block, SunSensor
from nutdamp.schemes.tools.sun_pulses import fired
from nutdamp.spacecraft import Spacecraft


def without_nutation(name: str, rpm: float, sun_angle: float) -> Spacecraft:
    """An example at rest but for its spin, with the Sun so many degrees from its spin axis."""
    body = nutdamp.example(name)
    body = replace(body, omega0=np.array([0.0, 0.0, rpm * math.pi / 30.0]))
    return replace(body, sun=body.direction_in_n(math.radians(sun_angle), 0.3), sun_sensor=SunSensor(0.0))


@pytest.mark.parametrize("channel", ["+M2", "-M2"])
def test_forty_pulses_of_lunar_prospector_turn_it_by_eight_and_a_half_degrees(channel: str) -> None:
    """Status report 30 of 1 May 1998. The arm of the thrusters in the file follows from these 8.5 deg by 40 straight
    pulses of the whole impulse; what differs is the Sun pulse, which bends the way, and the width of the pulses.
    """
    body = without_nutation("lunar-prospector", 11.96, 80.0)
    made = fired(body, (Block(channel, 1, 1.0, 0.2, 40),))
    left = flight.flown(body, made).residual
    assert math.degrees(left.momentum_shift) == pytest.approx(8.5, abs=0.15)  # found: 8.60 deg
    assert math.degrees(left.nutation) < 0.2
    assert made.end - made.pulses[0].start == pytest.approx(39 * 60.0 / 11.96 + 0.2, abs=0.5)


@pytest.mark.parametrize(
    ("count", "took", "before", "after", "sun_angle"),
    [
        (94, 1119.0, 5.0053, 5.0103, 6.78),
        (63, 747.0, 5.0407, 5.0443, 6.49),
        (99, 1162.0, 5.0807, 5.0856, 6.37),
        (39, 459.0, 5.0738, 5.0756, 14.04),
        (26, 306.0, 5.0794, 5.0805, 14.07),
    ],
)
def test_campaigns_of_ace_took_a_few_seconds_more_than_their_pulses(
    count: int, took: float, before: float, after: float, sun_angle: float
) -> None:
    """ACE weekly reports of 2011 to 2013: N pulses, s, rpm before and after, Sun angle before in deg.

    The times reported hold what comes before the first pulse and after the last: up to two spins.
    """
    body = without_nutation("ace", 0.5 * (before + after), sun_angle)
    made = fired(body, (Block("P1", 1, 1.0, 0.04, count),))
    mine = made.end - made.pulses[0].start
    assert 0.0 < took - mine < 24.0
