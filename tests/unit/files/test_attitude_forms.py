"""Attitude of a file by the direction of the spin axis, or of the angular momentum, and a phase about it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nutdamp
from nutdamp.physics import attitude
from nutdamp.spacecraft.model import Spacecraft

ANGLES = st.floats(-180.0, 180.0)
DECLINATIONS = st.floats(-89.0, 89.0)
TENSOR = "{tensor: [[120, 2, 1], [2, 110, 0.5], [1, 0.5, 80]]}"
SYMMETRIC = "{A: 120, C: 80}"


def body(given: str, *, spin: float = 3.0, inertia: str = SYMMETRIC, more: str = "") -> Spacecraft:
    return nutdamp.read(f"name: b\ninertia: {inertia}\nomega0: [0.1, -0.2, {spin}]\nattitude: {{{given}}}\n{more}")


def quaternion(spacecraft: Spacecraft) -> np.ndarray:
    assert spacecraft.attitude is not None
    return spacecraft.attitude.quaternion


def direction(right_ascension: float, declination: float) -> np.ndarray:
    ra, dec = math.radians(right_ascension), math.radians(declination)
    return np.array([math.cos(dec) * math.cos(ra), math.cos(dec) * math.sin(ra), math.sin(dec)])


def angle_about(axis: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    """Angle about an axis from one vector to another as they are seen along it, deg."""
    first, second = (vector - axis * (axis @ vector) for vector in (start, end))
    return math.degrees(math.atan2(axis @ np.cross(first, second), first @ second))


def same_angle(first: float, second: float) -> bool:
    return abs((first - second + 180.0) % 360.0 - 180.0) < 1e-7


@given(ANGLES, DECLINATIONS, ANGLES, st.sampled_from([3.0, -3.0]), st.sampled_from([SYMMETRIC, TENSOR]))
def test_the_phase_counts_from_the_ascending_node_to_body_axis_1(
    ra: float, dec: float, phase: float, spin: float, inertia: str
) -> None:
    spacecraft = body(f"spin_axis: [{ra} deg, {dec} deg], phase: {phase} deg", spin=spin, inertia=inertia)
    axis = direction(ra, dec)
    assert np.allclose(spacecraft.axis, axis, rtol=0.0, atol=1e-12)
    first = attitude.rotate(quaternion(spacecraft), np.array([1.0, 0.0, 0.0]))
    assert same_angle(angle_about(axis, np.cross([0.0, 0.0, 1.0], axis), first), phase)


@given(ANGLES, DECLINATIONS, st.sampled_from([3.0, -3.0]), st.sampled_from([SYMMETRIC, TENSOR]))
def test_it_may_be_that_of_the_angular_momentum(ra: float, dec: float, spin: float, inertia: str) -> None:
    spacecraft = body(f"spin_axis: [{ra} deg, {dec} deg], of: momentum", spin=spin, inertia=inertia)
    momentum = spacecraft.momentum / np.linalg.norm(spacecraft.momentum)
    assert np.allclose(momentum, direction(ra, dec), rtol=0.0, atol=1e-12)


@given(ANGLES, DECLINATIONS, ANGLES)
def test_the_phase_may_count_from_the_side_of_the_sun(ra: float, dec: float, phase: float) -> None:
    sun = (ra + 40.0, 0.5 * dec)
    given = f"spin_axis: [{ra} deg, {dec} deg], sun_phase: {phase} deg"
    spacecraft = body(given, more=f"sun: [{sun[0]} deg, {sun[1]} deg]")
    first = attitude.rotate(quaternion(spacecraft), np.array([1.0, 0.0, 0.0]))
    assert same_angle(angle_about(direction(ra, dec), direction(*sun), first), phase)


@pytest.mark.parametrize("dec", [90.0, -90.0])
def test_at_a_pole_the_phase_counts_from_x(dec: float) -> None:
    spacecraft = body(f"spin_axis: [10 deg, {dec} deg], phase: 30 deg")
    first = attitude.rotate(quaternion(spacecraft), np.array([1.0, 0.0, 0.0]))
    assert same_angle(
        angle_about(np.array([0.0, 0.0, math.copysign(1.0, dec)]), np.array([1.0, 0.0, 0.0]), first), 30.0
    )


def test_a_file_carried_on_holds_a_quaternion_instead() -> None:
    spacecraft = body("spin_axis: [120 deg, -15 deg], phase: 20 deg, epoch: 2026-03-01T12:00:00Z")
    carried = nutdamp.plan(spacecraft, "none").carried(10.0)
    flight = nutdamp.plan(spacecraft, "none").fly(10.0).track
    turned = attitude.multiply(attitude.conjugate(quaternion(carried)), flight.quaternion[-1])
    assert np.linalg.norm(turned[1:]) < 1e-10
    assert carried.attitude is not None
    assert carried.attitude.epoch == "2026-03-01T12:00:10Z"
