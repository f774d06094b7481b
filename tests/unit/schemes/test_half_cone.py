"""Half cones in a row: the closed form from a pure spin, exact ends from any motion, with torquer and channels."""

from __future__ import annotations

import itertools
import math

import pytest
from support.builders import Outcome, aimed, channel, cross, fan, off_target, spinner
from support.cases import spread
from support.checker import violations

from nutdamp import planning
from nutdamp.physics import pointing
from nutdamp.remarks import infeasibility
from nutdamp.schemes import Options
from nutdamp.spacecraft import Limits, Spacecraft, Steerable


def row(spacecraft: Spacecraft, cones: int | None = None) -> planning.Plan:
    plan = planning.plan(spacecraft, "half-cone", Options(cones=cones))
    assert plan.feasible, infeasibility(plan)
    assert violations(spacecraft, plan.pulses) == []
    return plan


def ends_on_the_target(plan: planning.Plan) -> None:
    assert Outcome(plan.spacecraft, plan.pulses).nutation < 1e-9
    assert off_target(plan.spacecraft, plan.pulses) < 1e-9


@spread("spin", [3.0, -3.0], quick=1)
@spread(("A", "C"), [(120.0, 80.0), (80.0, 120.0), (100.0, 100.0)], quick=1)
@spread("cones", [1, 3, 2, 5, 8], quick=3)
def test_from_a_pure_spin_n_cones_cost_the_closed_form(cones: int, A: float, C: float, spin: float) -> None:
    """2n C|ω3| tan(β/2n) in n + 1 pulses, half an inertial turn of the small cone apart."""
    for tilt in (1.0, 30.0, 100.0):
        plan = row(aimed(spinner(A, C, spin, 0.0), tilt, 45.0), cones)
        half = math.radians(tilt) / (2 * cones)
        assert len(plan.pulses) == cones + 1
        assert plan.pulses.total_impulse == pytest.approx(2 * cones * C * 3.0 * math.tan(half), rel=1e-10)
        wait = math.pi * A * math.cos(half) / (C * 3.0)
        waits = [two.t - one.t for one, two in itertools.pairwise(plan.pulses)]
        assert waits == pytest.approx([wait] * cones, rel=1e-5)
    ends_on_the_target(plan)


def test_more_cones_cost_less_down_to_the_floor() -> None:
    h, angle = 240.0, math.radians(60.0)
    costs = [pointing.half_cones_impulse(h, angle, cones) for cones in range(1, 200)]
    assert costs == sorted(costs, reverse=True)
    assert costs[0] == pytest.approx(2 * h * math.tan(math.radians(30.0)), rel=1e-15)
    assert costs[-1] == pytest.approx(h * angle, rel=1e-5)
    assert costs[-1] > h * angle


@pytest.mark.parametrize(("tilt", "cones"), [(5.0, 1), (10.0, 1), (60.0, 3), (120.0, 4)])
def test_as_many_cones_as_are_worth_it(tilt: float, cones: int) -> None:
    """One more would save less than 1 %: by the closed form."""
    made = row(aimed(spinner(degrees=0.0), tilt, 0.0)).pulses
    costs = [pointing.half_cones_impulse(240.0, math.radians(tilt), number) for number in (cones, cones + 1)]
    assert len(made) == cones + 1
    assert costs[1] > 0.99 * costs[0]
    if cones > 1:
        assert costs[0] <= 0.99 * pointing.half_cones_impulse(240.0, math.radians(tilt), cones - 1)


@spread("degrees", [1.0, 5.0, 20.0], quick=1)
@spread(("tilt", "azimuth"), [(10.0, 45.0), (60.0, -120.0)], quick=1)
def test_a_nutation_is_taken_along(degrees: float, tilt: float, azimuth: float) -> None:
    """The first pulse jumps straight onto the first cone: no more than damping first and turning then."""
    spacecraft = aimed(spinner(degrees=degrees), tilt, azimuth)
    for cones in (1, 2, 4):
        plan = row(spacecraft, cones)
        ends_on_the_target(plan)
        farthest = math.radians(tilt + degrees)
        assert plan.pulses.total_impulse <= spacecraft.least_impulse + pointing.half_cones_impulse(
            240.0, farthest, cones
        )
        assert plan.pulses.total_impulse >= max(spacecraft.least_impulse, spacecraft.turning_impulse)


@spread("cones", [1, 2, 5], quick=1)
@spread("degrees", [0.0, 5.0], quick=1)
def test_channels_wait_for_their_phase(degrees: float, cones: int) -> None:
    for channels in (cross(500.0), fan(3, 500.0)):
        spacecraft = aimed(spinner(degrees=degrees, channels=channels), 30.0, -120.0)
        plan = row(spacecraft, cones)
        assert len(plan.pulses) == cones + 1
        assert plan.pulses.total_impulse < 1.2 * max(spacecraft.turning_impulse, spacecraft.least_impulse)
    ends_on_the_target(plan)


@pytest.mark.parametrize("degrees", [0.0, 5.0])
def test_real_widths(degrees: float) -> None:
    ends_on_the_target(row(aimed(spinner(degrees=degrees, steerable=Steerable(60.0)), 15.0, 45.0)))


@pytest.mark.deep
def test_a_nutation_beyond_one_pulse_is_damped_first() -> None:
    """8 N m turn H by 1.3° at most; 5° of nutation are 21 N m s."""
    spacecraft = aimed(spinner(degrees=5.0, channels=cross(8.0, max_on_time=2.0)), 10.0, 45.0)
    ends_on_the_target(row(spacecraft))


def test_limits() -> None:
    limits = Limits(earliest=1.0, gap=0.4, blackout=((2.0, 4.0), (6.0, 6.5)), max_pulses=5)
    ends_on_the_target(row(aimed(spinner(degrees=3.0, limits=limits), 40.0, 10.0)))
    few = planning.plan(aimed(spinner(limits=Limits(max_pulses=3)), 40.0, 10.0), "half-cone", Options(cones=3))
    assert infeasibility(few) == "3 half cones take 4 pulses, and limits.max_pulses leaves 3"
    short = planning.plan(aimed(spinner(limits=Limits(horizon=1.0)), 40.0, 10.0), "half-cone")
    assert "horizon" in infeasibility(short)


def test_without_a_target_it_says_so() -> None:
    for scheme in ("half-cone", "rhumb-line"):
        assert infeasibility(planning.plan(spinner(), scheme)) == "needs a target axis: --target, or goal in the file"


def test_no_time_left_is_not_reported_as_a_negative_time() -> None:
    """What takes the nutation out first ends so late that the gap reaches past the horizon."""
    body = spinner(
        2.373744652338654,
        2.6800748046618628,
        -0.462832262592392,
        0.05,
        0.3283535213204525,
        channels=(
            channel("T0", -0.0002798774275361531, -9.312022413487486e-05, 0.0, min_on_time=0.12),
            channel("T1", 0.0002781184471714144, 9.824907088693092e-05, 0.0),
        ),
        limits=Limits(horizon=8.41668748101266, gap=0.6011919629294757),
    )
    why = infeasibility(planning.plan(aimed(body, 0.05, 197.04), "half-cone"))
    assert why == "limits.earliest, or the pulses before, leave no time within limits.horizon"
