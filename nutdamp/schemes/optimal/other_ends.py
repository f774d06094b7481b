"""Other ends than those the search over the whole horizon comes to.

Earlier ones at the same cost, for costs that are equal for a recommendation are so for the scheme optimal; and those of
shorter horizons, where the whole one leads to no schedule or to a dear one.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from nutdamp import work
from nutdamp.compliance import DAMPED_ANGLE, SAME_COST
from nutdamp.schedule import Schedule
from nutdamp.schemes.optimal.linear_program import Solution
from nutdamp.schemes.optimal.problem import Problem
from nutdamp.schemes.optimal.repair import UNMET

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

MOST = 900.0
"""Units that may be spent on all of them."""

ELSEWHERE = (0.85, 0.7, 0.55, 0.4)
"""Shares of the horizon that are tried in turn where a schedule is dear or was not found."""

MOST_ELSEWHERE = 1500.0
"""Units that may be spent on them."""


def elsewhere(
    problem: Problem, best: Schedule | None, first: Solution, cheapest: Callable[[float], Schedule | None]
) -> Schedule | None:
    """``best``; where there is none, or a dear one, the cheapest that is found with shorter horizons.

    ``first`` and ``cheapest`` as in `hastened`.
    """
    if first.unmet > UNMET:
        return best
    begin, horizon = problem.spacecraft.limits.earliest, problem.spacecraft.horizon
    with work.budget("other ends", MOST_ELSEWHERE):
        for share in ELSEWHERE:
            if work.exhausted() or not problem.dear(best, first.cost):
                break
            best = problem.cheaper(best, cheapest(begin + share * (horizon - begin)))
    return best


def hastened(
    problem: Problem, best: Schedule, first: Solution, cheapest: Callable[[float], Schedule | None]
) -> Schedule:
    """``best``, or one that ends earlier, costs and leaves as much, and has no more pulses.

    ``first`` is the program's solution for the whole horizon; ``cheapest`` gives the cheapest schedule found within a
    horizon, s. By how much earlier an end may be small angles tell; the horizons that are tried lie a little later.
    """
    if problem.options.least not in ("propellant", "impulse") or first.unmet > UNMET:
        return best
    begin, dearest = problem.spacecraft.limits.earliest, problem.price(best) * (1.0 + SAME_COST)
    small_angles = max(problem.price(best), first.cost) * (1.0 + ABOUT)
    left = problem.left(problem.flown(best)) + DAMPED_ANGLE

    def better(made: Schedule) -> bool:
        less = made.end < best.end and len(made) <= len(best)
        return less and problem.price(made) <= dearest and problem.left(problem.flown(made)) <= left

    with work.budget("an earlier end", MOST) as spent:

        def over() -> bool:
            return not len(best) or work.exhausted() or spent.done > EARLIER

        for _ in range(ROUNDS):
            span = best.end - begin
            share = None if over() else _least_share(problem, span, small_angles)
            later = () if share is None else (share + part * (1.0 - share) for part in PARTS)
            found = (cheapest(begin + part * span) for part in later if not over())
            made = next((one for one in found if one is not None and better(one)), None)
            if made is None:
                break
            best = made
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
