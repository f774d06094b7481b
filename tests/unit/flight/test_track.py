"""The motion as arrays, and how far the spin axis strays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from support import reference
from support.builders import spinner

from nutdamp import flight, track
from nutdamp.physics import attitude
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Attitude, Vector

EPS = float(np.finfo(float).eps)


def pointing(axes: list[tuple[float, float]]) -> track.Track:
    """Rows whose spin axis has these right ascensions and declinations in degrees; H at the start along z."""
    rows = len(axes)
    unit = np.array(
        [
            (math.cos(d) * math.cos(r), math.cos(d) * math.sin(r), math.sin(d))
            for r, d in (np.radians(pair) for pair in axes)
        ]
    )
    nothing = np.zeros(rows)
    return track.Track(
        t=np.arange(float(rows)),
        rates=np.zeros((rows, 3)),
        quaternion=np.tile([1.0, 0.0, 0.0, 0.0], (rows, 1)),
        axis=unit,
        momentum=np.tile([0.0, 0.0, 5.0], (rows, 1)),
        nutation=nothing,
        body_cone=nothing,
        space_cone=nothing,
        pulse=np.zeros(rows, dtype=np.int64),
    )


def degrees(pair: tuple[float, float]) -> list[float]:
    return [math.degrees(angle) for angle in pair]


def test_ranges_of_right_ascension_and_declination() -> None:
    found = track.extremes([pointing([(10, 5), (50, -20), (30, 40)])])
    assert degrees(found.right_ascension) == pytest.approx([10, 50], abs=1e-12)
    assert degrees(found.declination) == pytest.approx([-20, 40], abs=1e-12)


def test_right_ascension_that_wraps_is_the_short_way_round() -> None:
    """From 350° over 0° to 20°: not from 0° to 355°."""
    found = track.extremes([pointing([(350, 0), (355, 1), (5, 2), (20, 0)])])
    assert degrees(found.right_ascension) == pytest.approx([350, 380], abs=1e-12)


def test_right_ascension_of_a_standing_axis_is_a_point() -> None:
    found = track.extremes([pointing([(200, 10), (200, 10)])])
    assert degrees(found.right_ascension) == pytest.approx([200, 200], abs=1e-12)


def test_angles_from_the_planes_of_the_frame() -> None:
    """x and y: how far the axis leans out of the y-z and the x-z plane."""
    found = track.extremes([pointing([(0, 80), (90, 70), (180, 60), (270, 85)])])
    assert degrees(found.x) == pytest.approx([-30, 10], abs=1e-12)
    assert degrees(found.y) == pytest.approx([-5, 20], abs=1e-12)


def test_farthest_and_nearest_to_h_at_the_start_with_their_times() -> None:
    found = track.extremes([pointing([(0, 80), (90, 70), (180, 60), (270, 85)])])
    assert found.farthest == pytest.approx((math.radians(30), 2.0), rel=1e-14)
    assert found.nearest == pytest.approx((math.radians(5), 3.0), rel=1e-14)


@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_free_nutation_circles_h_at_the_nutation_angle(spin: float) -> None:
    spacecraft = spinner(spin=spin, degrees=12.0)
    until = spacecraft.inertial_period
    found = track.extremes([flight.flown(spacecraft, Schedule(), until).sampled(4001, until)])
    assert degrees(found.x) == pytest.approx([-12, 12], abs=1e-4)  # samples 0.09° apart on the circle
    assert degrees(found.y) == pytest.approx([-12, 12], abs=1e-4)
    assert math.degrees(found.farthest[0]) == pytest.approx(12.0, abs=1e-12)
    assert math.degrees(found.nearest[0]) == pytest.approx(12.0, abs=1e-12)


@pytest.mark.parametrize("right_ascension", [0.0, 90.0, 358.0])
def test_extremes_in_the_frame_of_the_file(right_ascension: float) -> None:
    """H towards a place on the equator: the axis circles it at 12°, across the zero of right ascension or not."""
    spacecraft = spinner(degrees=12.0)
    in_n = attitude.matrix(spacecraft.initial.quaternion)
    r = math.radians(right_ascension)
    # Rows: z of N to the equator at r, x of N to the pole.
    place: Vector = np.array([[0, math.sin(r), math.cos(r)], [0, -math.cos(r), math.sin(r)], [1, 0, 0]])
    there = spinner(degrees=12.0, attitude=Attitude(attitude.from_matrix(place @ in_n)))
    until = spacecraft.inertial_period
    found = track.extremes([flight.flown(there, Schedule(), until).sampled(4001, until)])
    assert degrees(found.declination) == pytest.approx([-12, 12], abs=1e-4)
    west, east = degrees(found.right_ascension)
    assert [west, east] == pytest.approx([(right_ascension - 12) % 360, (right_ascension - 12) % 360 + 24], abs=1e-4)


def test_track_has_axis_and_momentum_in_the_inertial_frame() -> None:
    spacecraft = spinner(spin=-3.0, degrees=20.0)
    rows = flight.flown(spacecraft, Schedule(), 10.0).sampled(20, 10.0)
    moments = np.array(spacecraft.inertia.moments)
    for quaternion, rates, axis, h in zip(rows.quaternion, rows.rates, rows.axis, rows.momentum, strict=True):
        rotation = attitude.matrix(quaternion)
        assert axis == pytest.approx(rotation @ [0, 0, -1.0], abs=4 * EPS)
        assert h == pytest.approx(
            reference.momentum(spacecraft.inertia.moments, reference.Motion(rates, rotation)), rel=1e-14
        )
        assert float(np.linalg.norm(h)) == pytest.approx(float(np.linalg.norm(moments * spacecraft.omega0)), rel=1e-14)
