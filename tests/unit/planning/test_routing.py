"""Ways round cones: on the sphere, and flown leg by leg by the cheapest scheme that points."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support.builders import aimed, spinner

from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Keep, Limits, Spacecraft, Vector

SUN = math.radians(3.0)
BODY = replace(
    aimed(spinner(80.0, 120.0, degrees=0.2), 12.0, 30.0), steerable=Steerable(), limits=Limits(horizon=900.0)
)
"""A turn of 12 deg."""
START = BODY.momentum / np.linalg.norm(BODY.momentum)


def watched(direction: Vector, least: float = SUN) -> Spacecraft:
    return replace(BODY, keep=(Keep("Sun", direction / np.linalg.norm(direction), least=least),))


def length(route: tuple[Vector, ...]) -> float:
    return sum(float(attitude.angle_between(*leg)) for leg in pairwise((START, *route)))


def test_routes_lead_to_the_target_clear_of_the_cone_the_shortest_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two legs that touch a circle of 3 deg and its margin of 0.5 deg about the middle of 12 deg, as in a plane."""
    monkeypatch.setattr(planning, "MARGINS", planning.MARGINS[:2])
    body = watched(START + BODY.target_axis)
    found = planning.routes(body)
    assert 4 <= len(found) <= planning.ROUTES
    for route in found:
        assert np.allclose(route[-1], body.target_axis)
        for one, two in pairwise((START, *route)):
            shares = np.linspace(0.0, 1.0, 50)[:, None]
            points = (1.0 - shares) * one + shares * two  # chords of short legs lie next to their great circles
            assert attitude.angle_between(points, np.asarray(body.keep[0].direction)).min() > SUN
    lengths = list(map(length, found))
    assert np.all(np.diff(lengths) > -2e-3)
    clear = math.degrees(SUN + planning.MARGINS[0])
    bend = clear / math.sqrt(1.0 - (clear / 6.0) ** 2)
    assert 1.0 < lengths[0] / math.radians(2.0 * math.hypot(6.0, bend)) < 1.03
    assert not any(len(route) < 2 for route in found)
    for route in planning.routes(watched(-body.target_axis)):  # without a cone in the way they are next to straight
        assert length(route) == pytest.approx(math.radians(12.0), rel=1e-3)


def test_a_plan_goes_round_where_the_straight_way_breaks_the_cone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The Sun stands where the axis would be half-way on its half cone."""
    monkeypatch.setattr(planning, "MARGINS", planning.MARGINS[:1])
    free = planning.plan(BODY, "half-cone")
    track = free.fly(free.end, samples=101).track
    body = watched(track.axis[len(track.t) // 2], math.radians(1.0))
    assert planning.judged(body, "half-cone", free.pulses, free.options).astray is not None
    routed = planning.plan(body, "half-cone")
    assert routed.feasible
    (aspect,) = routed.aspects
    assert aspect.kept
    assert routed.left is not None
    assert routed.left.aim < 1e-6
    assert routed.total_impulse < 1.6 * free.total_impulse
