"""Where max_on_time ends a pulse before its half turn does: several of one channel, side by side."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from support.builders import Outcome, cross, spinner
from support.cases import deep
from support.places import case

from nutdamp.comparison import compare
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.planning import plan
from nutdamp.remarks import broken_limits, infeasibility
from nutdamp.schedule import Schedule
from nutdamp.schemes.optimal import repair
from nutdamp.schemes.optimal.columns import Burn
from nutdamp.schemes.optimal.linear_program import Program
from nutdamp.schemes.optimal.problem import Problem
from nutdamp.schemes.options import OptimalOptions
from nutdamp.spacecraft import Limits

NOTHING_DAMPS = case("nothing-damps.yaml").read_text(encoding="utf-8")


def pauses(made: Schedule) -> list[float]:
    """Times in s for which a channel is off between two of its pulses."""
    names = {pulse.channel for pulse in made}
    each = ([pulse for pulse in made if pulse.channel == name] for name in names)
    return [after.start - before.end for pulses in each for before, after in itertools.pairwise(pulses)]


@pytest.mark.deep
@pytest.mark.parametrize(
    ("changed", "most"),
    [("", 1.03), deep("limits: {gap: 100 ms}\n", 1.09), deep("limits: {tick: 1 ms}\n", 1.03)],
    ids=["plain", "gap", "tick"],
)
def test_several_short_pulses_in_each_half_turn_damp(changed: str, most: float) -> None:
    """Pulses of 0.2 s, where 0.4 s are needed in each half turn: one at a time leaves 4 of 8 deg."""
    body = read_spacecraft(NOTHING_DAMPS + changed, "nothing-damps.yaml")
    made = plan(body, "optimal")
    assert made.feasible, infeasibility(made)
    assert broken_limits(body, made.pulses) == []
    outcome = Outcome(body, made.pulses)
    resolved = 1e-4 if body.limits.tick else 1e-8
    assert math.degrees(max(outcome.nutation, outcome.shift)) < resolved
    shortest = max(channel.min_on_time for channel in body.channels)
    assert min(pauses(made.pulses)) > max(0.9 * shortest, body.limits.gap - 1e-9)
    bounds = made.pulses.bounds
    assert bounds is not None
    assert bounds.first_order is not None
    assert (made.pulses.propellant or math.inf) < most * bounds.first_order


@pytest.mark.deep
def test_it_is_recommended_over_what_leaves_half() -> None:
    body = read_spacecraft(NOTHING_DAMPS, "nothing-damps.yaml")
    assert plan(body, "four-pulse").severity > math.radians(4.0)
    compared = compare(body, ("four-pulse", "optimal"))
    assert compared.recommended is not None
    assert compared.recommended.scheme == "optimal"


@pytest.mark.parametrize(("longest", "gap", "shortest"), [(0.3, 0.0, 0.0), (0.21, 0.1, 0.0), (0.5, 0.02, 0.13)])
def test_no_slots_are_left_that_join_to_more_than_a_pulse_may_last(longest: float, gap: float, shortest: float) -> None:
    body = spinner(channels=cross(8.0, min_on_time=shortest, max_on_time=longest), limits=Limits(horizon=30.0, gap=gap))
    program = Problem(body, OptimalOptions()).program()
    channel = body.channels[1]
    long = tuple(Burn(channel, t, on) for t, on in ((2.0, 1.1), (5.3, 0.7), (17.0, 2.0)))
    assert repair._divide(program, (*long, Burn(body.channels[0], 9.0, 0.9 * longest)))
    assert not program.forbidden[[0, 2, 3]].any()  # nothing is too long there
    runs = [(key, len(list(group))) for key, group in itertools.groupby(program.forbidden[1].tolist())]
    assert max(count for key, count in runs if not key) * program.width <= longest + 1e-12
    assert min(count for key, count in runs[1:-1] if key) * program.width >= max(gap, shortest) - 1e-12
    for burn in long:
        assert windows_about(program, burn) >= 0.6 * burn.on_time


def windows_about(program: Program, burn: Burn) -> float:
    """Seconds that are left for a burn within the time from its begin to its end, and a half of it beside it."""
    near = np.abs(program.centres - burn.t) <= 0.75 * burn.on_time
    return float(np.count_nonzero(~program.forbidden[1] & near)) * program.width


def test_what_no_pulses_can_do_is_said() -> None:
    """At 25 deg the channels cannot do it at all: divided pulses are no way round the program."""
    far = read_spacecraft(NOTHING_DAMPS.replace("8 deg", "25 deg"), "nothing-damps.yaml")
    assert "cannot take out the nutation" in infeasibility(plan(far, "optimal"))
    few = replace(far, limits=Limits(max_pulses=20))
    assert not plan(few, "optimal").feasible
