"""Schedules of a scheme over routes that keep clear of exclusion cones.

A route is a row of great circles, a leg each: straight to the target in shorter legs, which swing
the axis less, or by dog-legs. It is sought on the sphere, with a margin for nutation; the flight
judges the cones.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from nutdamp.common import work
from nutdamp.common.results import note
from nutdamp.errors import Infeasible
from nutdamp.physics import attitude
from nutdamp.schemes import catalogue, planner, valve_commands
from nutdamp.schemes.legs import Legs
from nutdamp.spacecraft.model import Keep, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule

# rad by which a route keeps clear of the cones.
MARGINS = tuple(math.radians(margin) for margin in (0.5, 2.0, 5.0, 10.0))

# rad to either side of the great circle at which way points may lie, up to 87 deg, the smallest
# first.
BENDS = tuple(sign * math.radians(0.1 * 1.1**step) for step in range(72) for sign in (1.0, -1.0))

# Way points without, of one and of two dog-legs, as shares of the way to the target; numbers of
# parts of each leg.
PLACES, PARTS = ((), (0.5,), (0.25, 0.75)), (1, 2, 4)

ROUTES = 16  # routes that are tried, at most
STEPS = 64  # points of a leg at which the cones are looked at

Route = tuple[Vector, ...]


def schedules(
    spacecraft: Spacecraft, scheme: str, options: catalogue.SchemeOptions
) -> Iterator[Schedule]:
    """Schedules of a ``scheme`` over routes that keep clear of the cones, the likeliest first.

    Each is found when needed, as long as there is budget of `work`, of those routes that the scheme
    can fly.
    """
    as_it_is = not spacecraft.thrust_laws or catalogue.SCHEMES[scheme].on_true_body
    flown_by = spacecraft if as_it_is else valve_commands.without_valves(spacecraft)
    for route in routes(spacecraft):
        if work.exhausted():
            return
        try:
            legs = Legs(flown_by)
            goal = spacecraft.goal
            for number, point in enumerate(route, start=1):  # each leg has its share of the horizon
                at_leg = legs.at_leg
                to_go = _length((at_leg.momentum, point, *route[number:]))
                share = _length((at_leg.momentum, point)) / to_go if to_go > 0.0 else 1.0
                spin = goal.spin if number == len(route) else None
                limits = replace(at_leg.limits, horizon=share * at_leg.horizon)
                leg = replace(at_leg, goal=replace(goal, axis=point, spin=spin), limits=limits)
                legs.fire(planner.schedule(scheme, leg, options))
            names = ", ".join(keep.name for keep in spacecraft.keep)
            whole = legs.schedule(note("goes-round", points=len(route) - 1, directions=names))
            yield whole if as_it_is else planner.as_commands(scheme, spacecraft, whole, options)
        except Infeasible:
            continue


def routes(spacecraft: Spacecraft) -> list[Route]:
    """Way points from H at t = 0, the target last, at most `ROUTES`; the shortest first."""
    start = spacecraft.momentum / np.linalg.norm(spacecraft.momentum)
    target = spacecraft.target_axis
    normal = np.cross(start, target)
    size = float(np.linalg.norm(normal))
    left = normal / size if size > 0.0 else attitude.square_to(start)
    shortest: dict[tuple[float, ...], Route] = {}
    for parts, margin, places in product(PARTS, MARGINS, PLACES):
        on_the_way = [_along(start, target, np.array([place]))[0] for place in places]
        bends = (  # the least bent route that is clear
            (*(math.cos(bend) * point + math.sin(bend) * left for point in on_the_way), target)
            for bend in (BENDS if places else BENDS[:1])
        )
        clear = (route for route in bends if _clear((start, *route), spacecraft.keep, margin))
        bent = next(clear, None)
        if bent is not None and len(bent) * parts > 1:
            shares = np.arange(1, parts + 1) / parts
            route = tuple(
                point for leg in pairwise((start, *bent)) for point in _along(*leg, shares)
            )
            shortest.setdefault(tuple(np.concatenate(route).round(9).tolist()), route)
    return sorted(
        shortest.values(), key=lambda route: (round(_length((start, *route)), 3), len(route))
    )[:ROUTES]


def _length(corners: Route) -> float:
    return math.fsum(float(attitude.angle_between(*leg)) for leg in pairwise(corners))


def _along(start: Vector, end: Vector, shares: Vector) -> Vector:
    """Points (n, 3) at ``shares`` (n,) of the great circle between two unit vectors that are not
    opposite.
    """
    angle = float(attitude.angle_between(start, end))
    if angle == 0.0:
        return np.tile(end, (len(shares), 1))
    weights = np.column_stack([np.sin((1.0 - shares) * angle), np.sin(shares * angle)]) / math.sin(
        angle
    )
    return np.asarray(weights @ np.array([start, end]))


def _clear(corners: Route, keeps: Sequence[Keep], margin: float) -> bool:
    """True if great circles between the ``corners`` keep the cones, by ``margin`` rad or as clearly
    as their ends.
    """
    shares = np.linspace(0.0, 1.0, STEPS)
    points = np.concatenate([_along(*leg, shares) for leg in pairwise(corners)])
    for keep in keeps:
        if keep.direction is None:
            continue
        apart = attitude.angle_between(points, keep.direction)
        room = np.minimum(apart - keep.least, keep.most - apart)
        if min(room[0], room[-1]) < 0.0 or room.min() < min(margin, room[0], room[-1]):
            return False
    return True
