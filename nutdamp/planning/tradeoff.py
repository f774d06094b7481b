"""Pareto fronts of cost and time by the scheme optimal, and certificates of least cost.

A certificate holds the prices of a program of small angles, and its primer curve q(t) of each
channel: the worth of a second by the prices, over its cost. Where q exceeds one nowhere, no
schedule costs less than the worth of the goal (weak duality; Lawden 1963, the primer vector); the
program fires where q is one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from nutdamp.common import results, work
from nutdamp.errors import BadRequest, Infeasible
from nutdamp.planning.causes import infeasibility
from nutdamp.planning.decision import by_propellant, compare, usual
from nutdamp.planning.plan import Plan, judge, plan
from nutdamp.planning.verdict import Verdict
from nutdamp.schemes import planner, valve_commands
from nutdamp.schemes.catalogue import OPTIMAL, OptimalOptions, Options
from nutdamp.schemes.correction import model_of
from nutdamp.schemes.optimal import bounds
from nutdamp.schemes.optimal.bounds import Proof, SmallAngles
from nutdamp.schemes.optimal.linear_program import Burn, Program
from nutdamp.schemes.optimal.problem import LEFT, UNMET, Problem
from nutdamp.schemes.optimal.refinement import growth_from
from nutdamp.spacecraft.constraints import free_windows
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import SAME_COST, Part
from nutdamp.spacecraft.roles import as_known, with_limits
from nutdamp.spacecraft.schedule import Bounds

SAME = 1e-9  # relative difference up to which a bound is that of the plan

ROWS = ("nutation_1", "nutation_2", "shift_1", "shift_2", "spin")  # subjects of the equations
LOOKS, MOST_LOOKS = (
    32,
    6_000,
)  # moments of the primer curve in a turn of the faster of its two parts, and of all of it


@dataclass(frozen=True, eq=False)
class Certificate:
    """Proof of a lower cost bound for a plan of optimal, by a ``program`` of small angles and its
    ``burns``.

    ``problem`` has the unit of the cost; its spacecraft is the symmetric body that the scheme plans
    on.
    """

    plan: Plan
    problem: Problem
    program: Program
    burns: tuple[Burn, ...]
    proof: Proof

    @property
    def rows(self) -> list[str]:
        """Subject of each equation, see `ROWS`."""
        return [ROWS[row] for row in self.problem.equations.chosen]

    @property
    def windows(self) -> list[tuple[float, float]]:
        """Windows for pulses, (begin, end) s."""
        return free_windows(self.spacecraft, self.program.end)

    def primer(self, times: Vector) -> Vector:
        """q at ``times`` (n,) s of each channel of the program, (n, channels)."""
        return SmallAngles(self.program, self.proof.prices).at(times)

    @property
    def spacecraft(self) -> Spacecraft:
        """Body of the program."""
        return self.program.spacecraft

    @property
    def last(self) -> float:
        """Time, s, from which pulses count in full against decaying nutation; 0 where it grows or
        stays.
        """
        return growth_from(self.spacecraft)

    @property
    def cost(self) -> float:
        """Cost of the burns."""
        price = dict(
            zip(
                (channel.name for channel in self.program.channels),
                self.program.costs.tolist(),
                strict=True,
            )
        )
        return math.fsum(price[burn.channel.name] * burn.on_time for burn in self.burns)

    def moments(self) -> list[Vector]:
        """Even moments (n,) s in each window, many in a turn unless there are too many turns."""
        spacecraft, spans = self.spacecraft, self.windows
        turns = spacecraft.fastest / (2.0 * math.pi)
        total = sum(end - begin for begin, end in spans)
        pace = min(LOOKS * turns, MOST_LOOKS / max(total, 1e-9))
        return [
            np.linspace(begin, end, math.ceil((end - begin) * pace) + 2) for begin, end in spans
        ]


def certificate(plan: Plan) -> Certificate:
    """Certificate of a plan of optimal; raises BadRequest where there is none, with the reason."""
    known = plan.pulses.bounds
    if plan.scheme != OPTIMAL.name:
        raise BadRequest(f"a certificate needs a plan of {OPTIMAL.name}, not of {plan.scheme}")
    if not plan.feasible or known is None or known.first_order is None:
        raise BadRequest(
            f"{OPTIMAL.name} has no least cost to prove here: {plan.why or 'there is no such plan'}"
        )
    chosen = planner.settled(OPTIMAL, plan.options, plan.spacecraft)
    modelled = as_known(plan.spacecraft, disturbed=chosen.with_disturbances)
    if modelled.thrust_laws:
        chosen = valve_commands.options(modelled, chosen)
        modelled = valve_commands.without_valves(modelled)
    modelled = model_of(modelled, three_moments=True).symmetric
    assert isinstance(chosen, OptimalOptions)
    try:
        problem = Problem(with_limits(modelled, horizon=known.within), chosen)
        program = problem.program()
        solution = program.solve()
    except Infeasible as reason:
        raise BadRequest(f"{OPTIMAL.name} has no least cost to prove here: {reason}") from None
    proof = bounds.first_order(program, solution.prices)
    if solution.unmet > UNMET or abs(proof.bound - known.first_order) > SAME * abs(
        known.first_order
    ):
        raise BadRequest(
            "the plan combines several linear programs, and none of them bounds the cost of all"
        )
    return Certificate(plan, problem, program, solution.burns, proof)


class Point(NamedTuple):
    """Schedule of a front: a ``plan``, the ``horizon`` (s) of its search, the ``unit`` of costs (kg
    or N m s).

    ``nominal``: it is judged by nominal values alone.
    """

    plan: Plan
    horizon: float
    unit: str
    nominal: bool = False

    @property
    def verdict(self) -> Verdict:
        """Judgement of the schedule, as of any other."""
        return judge(self.plan, nominal=True) if self.nominal else self.plan.verdict

    @property
    def cost(self) -> float:
        """Cost of the schedule, in its unit."""
        return self.plan.pulses.cost_in(self.unit)

    @property
    def off(self) -> float:
        """Distance of H from its target at the end, rad."""
        return self.plan._flight.residual.axis_error

    def serves(self, other: Point) -> bool:
        """True if the schedule costs as little as another one,
        ends as soon and leaves H as near.
        """
        return self.off <= other.off and self.plan.end <= other.plan.end and self.cost <= other.cost

    @property
    def bounds(self) -> Bounds:
        """Lower bounds on other schedules within the same horizon; unknown for schemes other than
        optimal.
        """
        return self.plan.pulses.bounds or Bounds(None, None, self.unit, self.horizon)


@dataclass(frozen=True, eq=False)
class Front:
    """Schedules of which none is beaten in end and cost at once; H may end ``shift`` rad off its
    target.

    ``why`` says why there is none, or, beside points of other schemes, none of optimal.
    """

    shift: float
    points: tuple[Point, ...]
    why: str | None = None

    def least(self, point: Point) -> float | None:
        """First-order lower bound for a ``point``; no more than those of points that have less
        time.
        """
        first, within = point.bounds.first_order, point.bounds.within
        known = [each.bounds.first_order for each in self.points if each.bounds.within <= within]
        return (
            None
            if first is None
            else min(first, *(bound for bound in known if bound is not None), math.inf)
        )


def fronts(
    spacecraft: Spacecraft,
    options: OptimalOptions,
    *,
    count: int,
    shifts: Sequence[float],
    nominal: bool = False,
    compared: Sequence[Plan] = (),
) -> tuple[Front, ...]:
    """Fronts for each of the ``shifts`` (rad, infinite for any), of at most ``count`` searches
    each.

    What is traded is propellant, with ``options.least`` of impulse that (then pulses do not tell
    their propellant). A schedule counts for every front whose shift it keeps; that of the whole
    horizon is what `plan` finds. Where optimal finds none, those of the other schemes count that
    comply but for where H ends. ``nominal``: see `Point`. Plans ``compared`` for the same question
    are not searched again. The count × len(shifts) searches are the steps of the task.
    """
    if options.least == "impulse":
        # The search for the fastest saves time, and counts in kg whatever it can: one unit for all
        # points.
        spacecraft = replace(
            spacecraft, channels=tuple(channel.of(isp=None) for channel in spacecraft.channels)
        )
    compared = [each for each in compared if each.spacecraft is spacecraft]
    ordered = sorted(set(shifts))
    done = 0
    unspent = work.FRONTS
    entries: list[tuple[float, Plan, float]] = []
    why: dict[float, str] = {}

    def search(spacecraft: Spacecraft, chosen: OptimalOptions) -> Plan:
        # The fastest schedule, from which on the others lie, may cost what a scheme may; of what
        # is left, all searches to come have equal shares.
        nonlocal done
        share = 1 if chosen.least == "time" else count * len(ordered) - done
        with work.budget("a point", work.left() / share):
            planned = plan(spacecraft, OPTIMAL.name, chosen)
        done += 1
        work.reach(done)
        return planned

    for number, shift in enumerate(ordered, start=1):
        anywhere = math.isinf(shift)
        allowing = replace(
            options, free_axis=anywhere, shift=None if anywhere or shift == 0.0 else shift
        )
        # The very search of `plan`, with its budget: one question, one answer.
        asked = planner.settled(OPTIMAL, allowing, spacecraft)
        same = (each for each in compared if each.scheme == OPTIMAL.name and each.options == asked)
        whole = next(same, None) or plan(spacecraft, OPTIMAL.name, allowing)
        done += 1
        work.reach(done)
        if whole.schedule is None or whole.schedule.bounds is None:
            why[shift] = infeasibility(whole) or "there is nothing to do"
        else:
            entries.append((shift, whole, spacecraft.horizon))
            with work.budget("the fronts", unspent) as spent:
                entries += [(shift, *entry) for entry in _sooner(whole, allowing, count, search)]
            unspent -= spent.done
        done = count * number
    others: list[Plan] = []
    if why:
        names = [name for name in usual(spacecraft) if name != OPTIMAL.name]
        chosen = Options(with_disturbances=options.with_disturbances)
        ends = {Part.SHIFT, Part.DISTANCE}
        others = [
            each
            for each in compared or compare(spacecraft, names, chosen, samples=0)
            if each.scheme in names
            and len(each.pulses)
            and {bound.part for bound in each._shortfalls} <= ends
        ]
    plans = [*(plan for _, plan, _ in entries), *others]
    counted = [plan.pulses.bounds for plan in plans if plan.pulses.bounds is not None]
    in_kg = (
        options.least != "impulse"
        and by_propellant(plans)
        and all(known.unit == "kg" for known in counted)
    )
    unit = "kg" if in_kg else "N m s"
    made_for = [(kept, Point(plan, horizon, unit, nominal)) for kept, plan, horizon in entries]
    rivals = [Point(plan, spacecraft.horizon, unit, nominal) for plan in others]
    return tuple(_fronts(ordered, made_for, rivals, why))


def _fronts(
    shifts: Sequence[float],
    made_for: Sequence[tuple[float, Point]],
    others: Sequence[Point],
    why: dict[float, str],
) -> Iterator[Front]:
    """Fronts of the ``shifts``, the strictest first, of points ``made_for`` one of them; of the
    ``others`` without.
    """
    kept: tuple[Point, ...] = ()
    for shift in shifts:
        own = [point for asked, point in made_for if asked <= shift]
        looser = [point for asked, point in made_for if asked > shift]
        # One that is nowhere worse than another stands for it: ticks prevent exact ends.
        points = own + [
            point for point in looser if point.off <= shift + LEFT or any(map(point.serves, own))
        ]
        kept = undominated(points or [point for point in others if point.off <= shift + LEFT], kept)
        by_others = all(point.plan.scheme != OPTIMAL.name for point in kept)
        yield Front(shift, kept, why.get(shift) if by_others else None)


def _sooner(
    whole: Plan,
    options: OptimalOptions,
    count: int,
    search: Callable[[Spacecraft, OptimalOptions], Plan],
) -> Iterator[tuple[Plan, float]]:
    """The fastest schedule, and those up to that of the ``whole`` horizon, with horizons in s."""
    spacecraft = whole.spacecraft
    fastest = search(spacecraft, replace(options, least="time")) if count > 1 else whole
    if fastest.schedule is None or not len(fastest.schedule):
        return
    yield fastest, spacecraft.horizon
    begin = spacecraft.limits.earliest
    end = fastest.pulses.end
    last = max(whole.pulses.end, fastest.pulses.end)
    for share in np.linspace(0.0, 1.0, count)[1:-1]:
        horizon = begin + (end - begin) * ((last - begin) / (end - begin)) ** float(share)
        planned = search(with_limits(spacecraft, horizon=horizon), options)
        if planned.schedule is not None and planned.schedule.bounds is not None:
            yield planned, horizon


def undominated(points: Sequence[Point], stricter: Sequence[Point] = ()) -> tuple[Point, ...]:
    """Points that cost less than all that end no later, by `SAME_COST`; those of a ``stricter``
    front by anything.
    """
    given = {id(point.plan) for point in stricter}
    kept: list[Point] = []
    for point in sorted(points, key=lambda point: (point.plan.pulses.end, point.cost)):
        saved = 0.0 if id(point.plan) in given else SAME_COST
        if not kept or point.cost < kept[-1].cost * (1.0 - saved):
            kept.append(point)
    return tuple(kept)


def numbered(all_fronts: Sequence[Front]) -> Iterator[tuple[int, Front, Point]]:
    """All points of all fronts, numbered from 1."""
    numbers = itertools.count(1)
    return ((next(numbers), front, point) for front in all_fronts for point in front.points)


@dataclass(frozen=True, eq=False, repr=False)
class Trade(results.Data, results.Written):
    """Time against cost for a ``spacecraft``: ``fronts`` of schedules of the scheme optimal, one
    for each momentum shift allowed, rad.

    ``recommended``: the plan that ``nutdamp plan`` recommends, if any.
    """

    spacecraft: Spacecraft
    fronts: tuple[Front, ...]
    recommended: Plan | None = None

    def __repr__(self) -> str:
        return (
            f"<Trade of {self.spacecraft.name}, fronts: {len(self.fronts)}, schedules: "
            f"{len(self.plans)}>"
        )

    @property
    def plans(self) -> tuple[Plan, ...]:
        """Plans of all points, front after front, each from its earliest end to its latest."""
        return tuple(point.plan for _, _, point in numbered(self.fronts))


def trade(
    spacecraft: Spacecraft,
    options: OptimalOptions,
    *,
    count: int,
    shifts: Sequence[float],
    nominal: bool = False,
) -> Trade:
    """Trade of the `fronts`, with the plan that a comparison of the usual schemes recommends."""
    usual_options = Options(least=options.least, with_disturbances=options.with_disturbances)
    compared = compare(spacecraft, options=usual_options, samples=0 if nominal else None)
    traded = fronts(
        spacecraft,
        options,
        count=count,
        shifts=shifts,
        nominal=nominal,
        compared=compared.plans,
    )
    return Trade(spacecraft, traded, compared.recommended)
