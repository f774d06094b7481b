"""Of schedules that cost the same, optimal takes one that ends early and has few pulses."""

from __future__ import annotations

from collections.abc import Callable
from unittest import mock

from support import places
from support.cases import spread

import nutdamp
from nutdamp import planning, work
from nutdamp.compliance import DAMPED_ANGLE, SAME_COST
from nutdamp.schedule import Schedule
from nutdamp.schemes.optimal import search
from nutdamp.schemes.optimal.linear_program import Solution
from nutdamp.schemes.optimal.problem import Problem

CONFIGS = places.CONFIGS


def as_found(_problem: Problem, best: Schedule, _first: Solution, _cheapest: Callable[[float], object]) -> Schedule:
    """What the search over the whole horizon finds."""
    return best


@spread(("name", "latest"), [("lunar-prospector", 19.0), ("magnus-a09", 12.0), ("single-thruster", 68.0)], quick=1)
def test_an_earlier_end_costs_and_leaves_as_much_and_takes_no_more_pulses(name: str, latest: float) -> None:
    body = nutdamp.load(CONFIGS / f"{name}.yaml")
    made = planning.plan(body, "optimal")
    with mock.patch.object(search, "hastened", as_found):
        before = planning.plan(body, "optimal")
    assert made.flown is not None
    assert before.flown is not None
    assert made.end <= latest
    assert made.end < 0.8 * before.end
    assert len(made) <= len(before)
    assert made.pulses.cost <= before.pulses.cost * (1.0 + SAME_COST)
    assert made.flown.nutation <= before.flown.nutation + DAMPED_ANGLE


def test_the_example_takes_one_more_linear_program_and_no_more_flights() -> None:
    body = nutdamp.example()
    with work.budget("with", 1e9) as spent:
        made = planning.plan(body, "optimal")
    with mock.patch.object(search, "hastened", as_found), work.budget("without", 1e9) as without:
        before = planning.plan(body, "optimal")
    assert made.end == before.end
    assert spent.done - without.done < 6.0
