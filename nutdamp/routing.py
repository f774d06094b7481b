"""Ways round the cones that the spin axis has to keep: a scheme that points is planned leg by leg over way points.

A route is a row of great circles: straight to the target in shorter legs, which swing the axis less, or by one or two
dog-legs round what is in the way. Routes are found on the sphere, with a margin for nutation; whether the
axis keeps the cones is for the flight to say.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from nutdamp import flight, schemes, work
from nutdamp.commands import Block
from nutdamp.demands import Keep
from nutdamp.errors import Infeasible
from nutdamp.physics import attitude, pointing
from nutdamp.schedule import Schedule
from nutdamp.schemes.tools import commanding
from nutdamp.schemes.tools.flown_builder import FlownBuilder
from nutdamp.schemes.tools.sun_pulses import fired, sun_pulses
from nutdamp.spacecraft import Spacecraft, Vector
from nutdamp.supply import Supply
from nutdamp.words import listed

MARGINS = tuple(math.radians(margin) for margin in (0.5, 2.0, 5.0, 10.0))
"""rad by which a route keeps clear of the cones."""

BENDS = tuple(sign * math.radians(0.1 * 1.1**step) for step in range(72) for sign in (1.0, -1.0))
"""rad to either side of the great circle at which way points may lie, up to 87 deg, the smallest first."""

PLACES = ((0.5,), (0.25, 0.75))
"""Where the way points of one and of two dog-legs lie, as shares of the way to the target."""

PARTS = (1, 2, 4)
"""Into how many each leg of a route is divided."""

ROUTES = 16
"""Routes that are tried, at most."""

STEPS = 64
"""Points of a leg at which the cones are looked at."""

Route = tuple[Vector, ...]


def schedules(spacecraft: Spacecraft, scheme: str, options: schemes.SchemeOptions) -> Iterator[Schedule]:
    """Schedules of a ``scheme`` over routes that keep clear of the cones, the likeliest first.

    Each is found when it is needed, as long as there is budget of `work`; routes that the scheme cannot fly are left
    out.
    """
    as_it_is = not spacecraft.thrust_laws or schemes.SCHEMES[scheme].on_true_body
    body = spacecraft if as_it_is else commanding.plain(spacecraft)
    for route in routes(spacecraft):
        if work.exhausted():
            return
        try:
            made = _over(body, scheme, options, route)
            yield made if as_it_is else schemes.as_commands(scheme, spacecraft, made, options)
        except Infeasible:
            continue


def routes(spacecraft: Spacecraft) -> list[Route]:
    """Way points from H at t = 0, the target last, at most `ROUTES`; the shortest first."""
    start = spacecraft.momentum / np.linalg.norm(spacecraft.momentum)
    found: dict[tuple[float, ...], Route] = {}
    for parts in PARTS:
        for margin in MARGINS:
            for places in ((), *PLACES):
                bent = _bent(start, spacecraft.target_axis, places, spacecraft.keep, margin)
                if bent is not None and len(bent) * parts > 1:
                    route = _divided(start, bent, parts)
                    found.setdefault(tuple(np.concatenate(route).round(9).tolist()), route)
    return sorted(found.values(), key=lambda route: (round(_length((start, *route)), 3), len(route)))[:ROUTES]


def _length(corners: Route) -> float:
    return math.fsum(float(attitude.angle_between(*leg)) for leg in pairwise(corners))


def _bent(
    start: Vector, target: Vector, places: tuple[float, ...], keeps: Sequence[Keep], margin: float
) -> Route | None:
    """The least bent route with way points at ``places`` that is clear by ``margin`` rad; None where there is none."""
    if not places:
        return (target,) if _clear((start, target), keeps, margin) else None
    for bend in BENDS:
        route = (*(_aside(start, target, place, bend) for place in places), target)
        if _clear((start, *route), keeps, margin):
            return route
    return None


def _aside(start: Vector, target: Vector, place: float, bend: float) -> Vector:
    """The point at a share of the way, ``bend`` rad to the left of the great circle."""
    on_the_way = _along(start, target, np.array([place]))[0]
    normal = np.cross(start, target)
    size = float(np.linalg.norm(normal))
    left = normal / size if size > 0.0 else pointing.square_to(start)
    return np.asarray(math.cos(bend) * on_the_way + math.sin(bend) * left)


def _along(start: Vector, end: Vector, shares: Vector) -> Vector:
    """Points (n, 3) at ``shares`` (n,) of the great circle between two unit vectors that are not opposite."""
    angle = float(attitude.angle_between(start, end))
    if angle == 0.0:
        return np.tile(end, (len(shares), 1))
    weights = np.column_stack([np.sin((1.0 - shares) * angle), np.sin(shares * angle)]) / math.sin(angle)
    return np.asarray(weights @ np.array([start, end]))


def _clear(corners: Route, keeps: Sequence[Keep], margin: float) -> bool:
    """Whether great circles between the ``corners`` keep the cones, by ``margin`` rad or as clearly as their ends."""
    shares = np.linspace(0.0, 1.0, STEPS)
    points = np.concatenate([_along(*leg, shares) for leg in pairwise(corners)])
    for keep in keeps:
        apart = attitude.angle_between(points, keep.direction)
        room = np.minimum(apart - keep.least, keep.most - apart)
        if min(room[0], room[-1]) < 0.0 or room.min() < min(margin, room[0], room[-1]):
            return False
    return True


def _divided(start: Vector, route: Route, parts: int) -> Route:
    """The ``route`` with each leg in ``parts``."""
    shares = np.arange(1, parts + 1) / parts
    return tuple(point for leg in pairwise((start, *route)) for point in _along(*leg, shares))


def _over(spacecraft: Spacecraft, scheme: str, options: schemes.SchemeOptions, route: Route) -> Schedule:
    """The schedule of a ``scheme`` that goes by way of the points of a ``route``; raises Infeasible with the reason.

    Each leg has the share of the horizon that it has of the way.
    """
    builder, goal, blocks, supply = FlownBuilder(spacecraft), spacecraft.goal, list[Block](), Supply(spacecraft)
    for number, point in enumerate(route, start=1):
        here = builder.here
        to_go = _length((here.momentum, point, *route[number:]))
        share = _length((here.momentum, point)) / to_go if to_go > 0.0 else 1.0
        spin = goal.spin if number == len(route) else None
        leg = replace(
            here,
            goal=replace(goal, axis=point, spin=spin),
            limits=replace(here.limits, horizon=share * here.horizon),
        )
        made = schemes.schedule(scheme, supply.behind(leg), options)
        passed = _sun_pulses(spacecraft, builder) if made.blocks else 0
        blocks += [replace(block, first=block.first + passed) for block in made.blocks]
        builder.fire(made)
        supply.count(made)
    names, count = listed([keep.name for keep in spacecraft.keep]), len(route) - 1
    points = f"{count} way point{'s' * (count > 1)}"
    note = f"goes by {points}, so that the spin axis keeps its distance from {names}"
    return replace(fired(spacecraft, blocks), notes=(note,)) if blocks else builder.schedule(note)


def _sun_pulses(spacecraft: Spacecraft, builder: FlownBuilder) -> int:
    """How many Sun pulses came until the pulses of a ``builder`` are over: those of its next leg count from there."""
    flown = flight.flown(spacecraft, builder.schedule(), builder.now)
    return len(sun_pulses(flown, builder.now)) if builder.now > 0.0 else 0
