"""Schedules beside those of the linear program: simple spin changes, other ends, other schemes as starts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.flight.end_state import left_by
from nutdamp.flight.propagation import Flight
from nutdamp.schemes.catalogue import HalfConeOptions, RhumbLineOptions, SchemeOptions, TwoPulseOptions
from nutdamp.schemes.optimal.linear_program import Solution
from nutdamp.schemes.optimal.problem import UNMET, Problem
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import DAMPED_ANGLE, SAME_COST
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

STARTS = 8
"""Starts in a nutation period that are tried of a channel that has a transverse torque, too."""

CORRECTED = 4
"""Flights by which the length is corrected."""

MOST_PULSES = 200
"""Pulses at most."""


def spin_changes(spacecraft: Spacecraft, fly: Callable[[Schedule], Flight]) -> Iterator[Schedule]:
    """Simple spin changes that keep limits and requirement, flown by ``fly``; none where H has a target."""
    if spacecraft.goal.spin is None or spacecraft.goal.axis is not None:
        return
    for channel in spacecraft.channels:
        if (spacecraft.goal.spin - spacecraft.spin) * channel.axial <= 0.0:
            continue
        starts = STARTS if abs(channel.transverse) > 1e-12 * abs(channel.axial) else 1
        for number in range(starts):
            start = spacecraft.limits.earliest + number / starts * spacecraft.nutation_period
            for turns in (0.0, 2.0 * math.pi / spacecraft.fastest):
                schedule = _schedule(spacecraft, channel, start, turns, fly)
                if schedule is not None:
                    yield schedule


def _schedule(
    spacecraft: Spacecraft, channel: Channel, start: float, turn: float, fly: Callable[[Schedule], Flight]
) -> Schedule | None:
    """The pulses of a ``channel`` from ``start`` s on, one each ``turn`` s or one after the other; else None."""
    goal, tick = spacecraft.goal.spin, spacecraft.limits.tick
    assert goal is not None
    rate = channel.axial / spacecraft.inertia.C
    whole = (goal - spacecraft.spin) / rate
    count = math.ceil(whole / channel.max_on_time * (1.0 - 1e-9)) if math.isfinite(channel.max_on_time) else 1
    if count > MOST_PULSES or (count == 1 and turn > 0.0):
        return None
    for _ in range(CORRECTED):
        on_time = whole / count
        if tick is not None:
            on_time = round(on_time / tick) * tick
        if not channel.min_on_time <= on_time <= channel.max_on_time * (1.0 + 1e-12):
            return None
        apart = max(turn, on_time + spacecraft.limits.gap)
        if tick is not None:
            start, apart = math.ceil(start / tick - 1e-9) * tick, math.ceil(apart / tick - 1e-9) * tick
        schedule = Schedule(
            tuple(channel_pulse(channel, start + k * apart + 0.5 * on_time, on_time) for k in range(count))
        )
        if schedule.end > spacecraft.horizon:
            return None
        flight = fly(schedule)
        missed = goal - flight.settled.spin
        if tick is not None or abs(missed) < 1e-12 * abs(goal):
            break
        whole += missed / rate
    held = requirements.held(spacecraft, left_by(flight))
    return schedule if all(bound.met for bound in held) and keeps_limits(spacecraft, schedule) else None


CLEARLY = 0.8
"""Share of the end at which small angles must allow the same cost, for an earlier end to be looked for."""

ABOUT = 0.002
"""Share by which their cost may be more: it is not that of the true motion."""

BISECTIONS = 3
"""Steps in which the earliest end is found that they allow."""

ROUNDS = 3
"""Earlier ends that are looked for one after the other."""

PARTS = (0.2, 0.4, 0.6)
"""Horizons that are tried in turn, as parts of the way from the earliest end that they allow to the end there is."""

EARLIER = 300.0
"""Units of `work` after which no other one is looked for."""

MOST_ENDS = 900.0
"""Units that may be spent on all of them."""

ELSEWHERE = (0.85, 0.7, 0.55, 0.4)
"""Shares of the horizon that are tried in turn where a schedule is dear or was not found."""

MOST_ELSEWHERE = 1500.0
"""Units that may be spent on them."""


def elsewhere(
    problem: Problem, best: Schedule | None, first: Solution, cheapest: Callable[[float], Schedule | None]
) -> Schedule | None:
    """The ``best``; where there is none, or a dear one, the cheapest with shorter horizons.

    ``first`` and ``cheapest`` as in `hastened`.
    """
    if first.unmet > UNMET:
        return best
    begin, horizon = problem.spacecraft.limits.earliest, problem.spacecraft.horizon
    with work.budget("other ends", MOST_ELSEWHERE):
        for share in ELSEWHERE:
            sooner = begin + share * (horizon - begin)
            if work.exhausted() or not problem.dear(best, first.cost) or not problem.feasible(sooner):
                break
            best = problem.cheaper(best, cheapest(sooner))
    return best


def hastened(
    problem: Problem, best: Schedule, first: Solution, cheapest: Callable[[float], Schedule | None]
) -> Schedule:
    """The ``best``, or one that ends earlier, costs and leaves as much, and has no more pulses.

    ``first`` is the program's solution for the whole horizon; ``cheapest`` gives the cheapest schedule found within a
    horizon, s. By how much earlier an end may be small angles tell; the horizons that are tried lie a little later.
    """
    if problem.options.least not in ("propellant", "impulse") or first.unmet > UNMET:
        return best
    begin, dearest = problem.spacecraft.limits.earliest, problem.price(best) * (1.0 + SAME_COST)
    small_angles = max(problem.price(best), first.cost) * (1.0 + ABOUT)
    left = problem.left(problem.flown(best)) + DAMPED_ANGLE

    def better(schedule: Schedule) -> bool:
        less = schedule.end < best.end and len(schedule) <= len(best)
        return less and problem.price(schedule) <= dearest and problem.left(problem.flown(schedule)) <= left

    with work.budget("an earlier end", MOST_ENDS) as spent:

        def over() -> bool:
            return not len(best) or work.exhausted() or spent.done > EARLIER

        for _ in range(ROUNDS):
            span = best.end - begin
            share = None if over() else _least_share(problem, span, small_angles)
            later = () if share is None else (share + part * (1.0 - share) for part in PARTS)
            schedules = (cheapest(begin + part * span) for part in later if not over())
            earlier = next((schedule for schedule in schedules if schedule is not None and better(schedule)), None)
            if earlier is None:
                break
            best = earlier
    return best


def _least_share(problem: Problem, span: float, most: float) -> float | None:
    """The least share of the ``span`` s that small angles allow at a cost of ``most``; None for one above `CLEARLY`.

    Nor may it cost them more than `ABOUT` over what they cost in all of the span.
    """

    def cost(share: float) -> float:
        horizon = problem.spacecraft.limits.earliest + share * span
        solution = problem.program(problem.within(horizon)).solve()
        return solution.cost if solution.unmet <= UNMET else math.inf

    clearly = cost(CLEARLY)
    if clearly > most or clearly > (most := min(most, cost(1.0) * (1.0 + ABOUT))):
        return None
    low, high = 0.0, CLEARLY
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if cost(middle) <= most else (middle, high)
    return high


CONES = (12, 6, 3)
"""Half cones in a row that are tried beside the number that the scheme takes."""


def by_other_schemes(spacecraft: Spacecraft, *, shift: bool) -> Iterator[Schedule]:
    """Schedules by the channels of the ``spacecraft`` for the same goal, one after the other; ``shift``: H counts.

    The later ones take longer to plan, and are rarely better.
    """
    from nutdamp.schemes import half_cone, one_pulse, rhumb_line, two_pulse

    # The Sun keeps the phase of trains alone.
    body = replace(spacecraft, steerable=None, goal=replace(spacecraft.goal, sun=None))
    plans: list[Callable[[], Schedule | Iterable[Schedule]]] = []
    if not shift:
        plans.append(partial(one_pulse.schedule, body, SchemeOptions()))
    elif body.goal.axis is None:
        plans.append(partial(two_pulse.alternatives, body, TwoPulseOptions()))
    else:
        plans.append(partial(two_pulse.schedule, body, TwoPulseOptions()))
        if body.spin != 0.0:
            plans.append(partial(rhumb_line.schedule, body, RhumbLineOptions()))
        plans += [partial(half_cone.schedule, body, HalfConeOptions(cones=cones)) for cones in (None, *CONES)]
    for plan in plans:
        if work.exhausted():
            return
        try:
            planned = plan()
            every = [planned] if isinstance(planned, Schedule) else list(planned)
        except Infeasible:
            continue
        yield from (schedule for schedule in every if keeps_limits(spacecraft, schedule))
