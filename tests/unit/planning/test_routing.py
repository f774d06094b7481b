"""Ways round cones: on the sphere, and flown leg by leg by the cheapest scheme that points."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from support.builders import aimed, spinner

from nutdamp import planning, routing
from nutdamp.physics import attitude
from nutdamp.spacecraft import Keep, Limits, Spacecraft, Steerable

SUN = math.radians(3.0)


def watched(least: float = SUN) -> Spacecraft:
    """A turn of 12 deg with the Sun on the middle of the way."""
    body = aimed(spinner(80.0, 120.0, degrees=0.2), 12.0, 30.0)
    start = body.momentum / np.linalg.norm(body.momentum)
    middle = start + body.target_axis
    keep = Keep("Sun", middle / np.linalg.norm(middle), least=least)
    return replace(body, steerable=Steerable(), keep=(keep,), limits=Limits(horizon=900.0))


def test_routes_lead_to_the_target_clear_of_the_cone_the_shortest_first() -> None:
    body = watched()
    found = routing.routes(body)
    start = body.momentum / np.linalg.norm(body.momentum)
    assert 4 <= len(found) <= routing.ROUTES
    lengths = []
    for route in found:
        assert np.allclose(route[-1], body.target_axis)
        corners = (start, *route)
        for one, two in pairwise(corners):
            shares = np.linspace(0.0, 1.0, 50)[:, None]
            points = (1.0 - shares) * one + shares * two  # chords of short legs lie next to their great circles
            assert attitude.angle_between(points, body.keep[0].direction).min() > SUN
        lengths.append(sum(float(attitude.angle_between(*leg)) for leg in pairwise(corners)))
    assert np.all(np.diff(lengths) > -2e-3)
    # Two legs that touch a circle of 3 deg and its margin of 0.5 deg about the middle of 12 deg, as in a plane.
    clear = math.degrees(SUN + routing.MARGINS[0])
    bend = clear / math.sqrt(1.0 - (clear / 6.0) ** 2)
    assert 1.0 < lengths[0] / math.radians(2.0 * math.hypot(6.0, bend)) < 1.03
    assert not any(len(route) < 2 for route in found)


def test_without_a_cone_in_the_way_routes_are_next_to_straight() -> None:
    body = watched()
    aside = replace(body, keep=(replace(body.keep[0], direction=-body.target_axis),))
    start = body.momentum / np.linalg.norm(body.momentum)
    for route in routing.routes(aside):
        length = sum(float(attitude.angle_between(*leg)) for leg in pairwise((start, *route)))
        assert length == pytest.approx(math.radians(12.0), rel=1e-3)


def test_a_plan_goes_round_where_the_straight_way_breaks_the_cone() -> None:
    """The Sun stands where the axis would be half-way on its half cone."""
    body = replace(watched(), keep=())
    free = planning.plan(body, "half-cone")
    track = free.fly(free.end, samples=101).track
    body = replace(body, keep=(Keep("Sun", track.axis[len(track.t) // 2], least=math.radians(1.0)),))
    assert planning.judged(body, "half-cone", free.pulses, free.options).astray is not None
    routed = planning.plan(body, "half-cone")
    assert routed.feasible
    (aspect,) = routed.aspects
    assert aspect.kept
    assert routed.left is not None
    assert routed.left.aim < 1e-6
    assert routed.total_impulse < 1.6 * free.total_impulse
