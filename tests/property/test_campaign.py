"""ACE follows the Sun by a turn a week, each planned from the file of the one before."""

import math

import pytest
from support.builders import present
from support.cases import weekly

import nutdamp

WEEK = 7 * 86400.0


@pytest.mark.deep
@pytest.mark.parametrize("weeks", [2, weekly(52)])
def test_weekly_turns_keep_the_cone_and_their_propellant_adds_up(weeks: int) -> None:
    spacecraft = nutdamp.example("ace")
    first = present(spacecraft.mass)
    used = 0.0
    for _ in range(weeks):
        x, y, z = present(spacecraft.sun).tolist()
        spacecraft = nutdamp.plan(spacecraft, "none").carried(WEEK)
        goal = {"right_ascension": math.atan2(y, x), "declination": math.asin(z)}
        plan = nutdamp.plan(spacecraft.with_(goal=goal), "command-block")
        assert plan.meets_requirement
        assert plan.kept
        assert 0.017 < present(plan.propellant) < 0.022
        used += present(plan.propellant)
        spacecraft = plan.carried()
    assert spacecraft.mass == pytest.approx(first - used, rel=1e-9)
    if weeks == 52:
        assert used == pytest.approx(0.99, abs=0.02)
