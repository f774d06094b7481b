"""What time costs: schedules of the scheme optimal from the shortest that is found to the longest that still saves."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from nutdamp import work
from nutdamp.planning import Plan, plan
from nutdamp.remarks import infeasibility
from nutdamp.schedule import Bounds
from nutdamp.schemes.options import OptimalOptions
from nutdamp.schemes.registry import OPTIMAL
from nutdamp.spacecraft import Spacecraft

SAVES = 1e-3
"""Share of the cost that a later end must save to count as another point."""

EVERYWHERE = math.inf
"""Shift of H allowed that requires nothing."""


class Point(NamedTuple):
    """One schedule of a front: a ``plan`` that ends in time, and the ``horizon`` (s) it was looked for within."""

    plan: Plan
    horizon: float

    @property
    def cost(self) -> float:
        """What the schedule costs, in the unit of its bounds."""
        return self.plan.pulses.cost_in(self.bounds.unit)

    @property
    def bounds(self) -> Bounds:
        """What other schedules within the same horizon must cost."""
        bounds = self.plan.pulses.bounds
        assert bounds is not None
        return bounds


@dataclass(frozen=True, eq=False)
class Front:
    """Schedules none of which is both later and dearer than another; H may end ``shift`` rad off its target.

    ``why`` says why there is none.
    """

    shift: float
    points: tuple[Point, ...]
    why: str | None = None


def fronts(
    spacecraft: Spacecraft,
    options: OptimalOptions,
    *,
    count: int,
    shifts: Sequence[float],
    progress: Callable[[int], None] = lambda _: None,
) -> tuple[Front, ...]:
    """One front for each of the ``shifts`` (rad, `EVERYWHERE` for any), of at most ``count`` searches each.

    What is traded is propellant, with ``options.least`` of impulse that (then pulses do not tell their propellant).
    A schedule that keeps a smaller shift counts for the larger ones too, where none beats it. ``progress`` is called
    with how many of the count × len(shifts) searches are done.
    """
    if options.least == "impulse":
        # The search for the fastest saves time, and counts in kg whatever it can: one unit for all points.
        spacecraft = _of_unknown_propellant(spacecraft)
    made: list[Front] = []
    ordered = sorted(set(shifts))
    with work.budget("the fronts", work.FRONTS) as spent:
        searches = _Searches(count * len(ordered), spent, progress)
        for shift in ordered:
            front = _front(spacecraft, _allowing(options, shift), count, shift, searches)
            points = (*front.points, *(point for other in made for point in other.points))
            made.append(Front(shift, _undominated(points), None if points else front.why))
            searches.done = count * len(made)
    return tuple(made)


def _of_unknown_propellant(spacecraft: Spacecraft) -> Spacecraft:
    channels = (
        replace(channel, thrusters=tuple(replace(thruster, isp=None) for thruster in channel.thrusters))
        for channel in spacecraft.channels
    )
    return replace(spacecraft, channels=tuple(channels))


@dataclass(eq=False)
class _Searches:
    """The searches of all fronts, within their ``budget``.

    The fastest schedule of each, without which there is no front, may cost what a scheme may; of what that leaves, all
    searches to come have equal shares.
    """

    count: int
    budget: work.Budget
    progress: Callable[[int], None]
    done: int = 0

    def __call__(self, spacecraft: Spacecraft, options: OptimalOptions) -> Plan:
        left = self.budget.most - self.budget.done
        with work.budget("a point", left if options.least == "time" else left / (self.count - self.done)):
            found = plan(spacecraft, OPTIMAL.name, options)
        self.done += 1
        self.progress(self.done)
        return found


def _allowing(options: OptimalOptions, shift: float) -> OptimalOptions:
    anywhere = math.isinf(shift)
    return replace(options, free_axis=anywhere, shift=None if anywhere or shift == 0.0 else shift)


def _front(spacecraft: Spacecraft, options: OptimalOptions, count: int, shift: float, searches: _Searches) -> Front:
    """The fastest schedule, then horizons from its end to that of the file, evenly by their ratios."""
    fastest = searches(spacecraft, replace(options, least="time"))
    if fastest.schedule is None or fastest.schedule.bounds is None:
        return Front(shift, (), infeasibility(fastest) or "there is nothing to do")
    points = [Point(fastest, spacecraft.horizon)]
    begin, end = spacecraft.limits.earliest, fastest.pulses.end
    for share in np.linspace(0.0, 1.0, count)[1:]:
        horizon = begin + (end - begin) * ((spacecraft.horizon - begin) / (end - begin)) ** float(share)
        body = replace(spacecraft, limits=replace(spacecraft.limits, horizon=horizon))
        found = searches(body, options)
        if found.schedule is not None and found.schedule.bounds is not None:
            points.append(Point(found, horizon))
    return Front(shift, tuple(points))


def _undominated(points: Sequence[Point]) -> tuple[Point, ...]:
    """In the order of their ends, those that cost clearly less than all that end before."""
    kept: list[Point] = []
    for point in sorted(points, key=lambda one: (one.plan.pulses.end, one.cost)):
        if not kept or point.cost < kept[-1].cost * (1.0 - SAVES):
            kept.append(point)
    return tuple(kept)


def numbered(found: Sequence[Front]) -> Iterator[tuple[int, Front, Point]]:
    """All points of all fronts, numbered from 1."""
    pairs = ((front, point) for front in found for point in front.points)
    return ((index, front, point) for index, (front, point) in enumerate(pairs, start=1))
