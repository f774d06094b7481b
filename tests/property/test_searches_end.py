"""Every search ends, whatever it is given: bounds count steps, and what is found within them keeps the limits."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.builders import aimed, channel, cross, fan, spinner, within
from support.cases import spread
from support.checker import violations
from support.places import case
from support.random_bodies import disturbed_spacecraft, power

from nutdamp import flight, planning
from nutdamp.errors import Infeasible
from nutdamp.files.spacecraft_file import load_spacecraft
from nutdamp.limits import Windows
from nutdamp.remarks import infeasibility, remarks
from nutdamp.schedule import TOUCHING, Schedule, channel_pulse
from nutdamp.schemes import CLASSIC, Options
from nutdamp.schemes.tools import steerable_pair
from nutdamp.schemes.tools.impulse_builder import MOST_PULSES, ImpulseBuilder
from nutdamp.spacecraft import Limits, Spacecraft, Steerable

PLENTY = 3_000_000
"""Calls of functions; a plan takes a tenth of that."""

ENDLESS = {
    **{f"a = {a}": (spinner(120.0, 120.0 * (1 - a), channels=cross(8.0)), None) for a in (1e-6, 1e-10, 1e-15)},
    "116 days": (spinner(channels=cross(8.0), limits=Limits(horizon=1e7)), True),
    "dark for 116 days": (
        spinner(steerable=Steerable(8.0), limits=Limits(horizon=1e7, blackout=((0.0, 1e7),))),
        False,
    ),
    # On-times and moments are bounded, so that no trial flies for 10⁵ s under torque.
    "trims that run away": (
        spinner(
            27.184196833257793,
            54.36839366651559,
            0.1298681271574343,
            2.4666967171796332,
            phase=0.0,
            channels=(
                channel("T0", 0.0, 0.07812199696304258, 0.0),
                channel("T1", 0.0017921515598551382, -0.004499826153832031, 0.00026736933327888593, min_on_time=0.0352),
                channel(
                    "T2", -0.0058350853171264165, -0.022754617512655954, 0.00035239014198196254, min_on_time=0.0038
                ),
            ),
            limits=Limits(horizon=2194.4435233461004, earliest=1844.9859185150808),
        ),
        None,
    ),
}
"""Bodies whose closings of H, half turns or trials two-pulse does not lay out one by one, and what is feasible."""


def planned(body: Spacecraft, scheme: str, options: Options | None = None, most: int = PLENTY) -> planning.Plan:
    """The plan, which is judged within so many calls too."""
    with within(most):
        plan = planning.plan(body, scheme, options)
        figures = plan.flown, plan.residual, plan.delta_v
    assert plan.feasible == (None not in figures[:2]) == (infeasibility(plan) == "")
    assert violations(body, plan.pulses) == []
    return plan


@pytest.mark.parametrize(("body", "feasible"), ENDLESS.values(), ids=ENDLESS)
def test_two_pulses_are_planned_or_declined_in_no_time(body: Spacecraft, feasible: bool | None) -> None:
    assert planned(body, "two-pulse").feasible in ((True, False) if feasible is None else (feasible,))


def test_alignments_that_a_disturbance_moves_before_the_gap_is_over_are_passed_by() -> None:
    """They were awaited in steps of a nanosecond."""
    body = load_spacecraft(case("never-returns.yaml"))
    left = planned(body, "four-pulse", Options(with_disturbances=True)).flown
    assert left is not None
    assert left.nutation < 1e-9


@pytest.mark.parametrize("scheme", CLASSIC)
def test_on_times_of_a_nanosecond_are_fired_at_moments_of_their_own(scheme: str) -> None:
    """Such a pulse ends within the slack for rounding: the next alignment was the same one, again and again."""
    plan = planned(load_spacecraft(case("crash-max-on-time-1e-9-hang.yaml")), scheme)
    assert plan.feasible
    assert all(two.t > one.t for one, two in itertools.pairwise(plan.pulses))


@pytest.mark.deep
@spread("scheme", ["one-pulse", "four-pulse"], quick=1)
def test_no_more_pulses_are_laid_than_anybody_commands(scheme: str) -> None:
    body = spinner(channels=cross(8.0, max_on_time=1e-4), limits=Limits(horizon=1e7))
    with within(10 * PLENTY):
        plan = planning.plan(body, scheme)
    assert len(plan.pulses) == MOST_PULSES
    assert any(f"ends after {MOST_PULSES} pulses" in remark for remark in remarks(plan))


@pytest.mark.deep
def test_the_next_alignment_is_found_or_given_up() -> None:
    pulses = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        body = disturbed_spacecraft(rng)
        builder = ImpulseBuilder(body)
        for one in body.channels:
            on_time = power(rng, -6, 0) * min(body.body_period, body.inertial_period)
            for _ in range(3):
                with within(200_000):
                    pulse = builder.align(one, on_time)
                if pulse is None:
                    break
                assert pulse.start >= builder.ready - TOUCHING, seed
                assert not builder.pulses or pulse.t > builder.now, seed
                assert builder.windows.allows(pulse.start, pulse.on_time, builder.ready), seed
                pulses += 1
                builder.fire(pulse)
    assert pulses > 500


@given(
    st.floats(0.0, 1e6),
    st.sampled_from([1e-9, 1e-3, 0.1, 0.25, 1.0 / 3.0, 1.7]),
    st.lists(st.tuples(st.integers(0, 10_000), st.sampled_from([-2, -1, -0.5, 0, 0.5, 1, 2])), max_size=20),
)
def test_windows_that_end_beside_a_tick_are_left_behind(
    ready: float, tick: float, holes: list[tuple[int, float]]
) -> None:
    """An end a slack beside a tick is where rounding may call the tick neither before it nor after it."""
    blackout = tuple((number * tick, (number + 3) * tick + part * TOUCHING) for number, part in holes)
    windows = Windows(spinner(limits=Limits(horizon=1e9, tick=tick, blackout=blackout)))
    with within(20_000):
        start = windows.earliest_start(0.5 * tick, ready)
    assert start is not None
    assert windows.allows(start, 0.5 * tick, ready)


def test_a_search_that_gains_a_little_in_every_step_ends() -> None:
    steps = itertools.count()

    def cost(points: np.ndarray) -> np.ndarray:
        next(steps)
        return np.asarray(1.0 / (1.0 + np.exp(np.minimum(1e-9 * points[:, 0], 700.0))))

    with within(PLENTY):
        steerable_pair._descend(cost, np.array([0.0]), np.array([1.0]))
    assert next(steps) <= steerable_pair.COMPASS_STEPS + 1


def test_a_channel_that_can_do_nothing_ends_the_walk() -> None:
    """No gain, no further pulse."""
    plan = planned(spinner(channels=(channel("weak", 1e-30, 0.0, 0.0, max_on_time=0.1),)), "four-pulse")
    assert not plan.feasible or math.isfinite(plan.pulses.end)


@pytest.mark.parametrize("scheme", CLASSIC)
def test_near_a_right_angle_of_nutation_there_is_an_answer(scheme: str) -> None:
    """Thrusters whose torque about axis 3 spins a needle up to hundreds of turns a minute: minutes, before."""
    planned(load_spacecraft(case("slow-89-deg.yaml")), scheme, most=10 * PLENTY)


@pytest.mark.weekly
@spread("degrees", [89.9, 89.999], quick=1, deep=1)
def test_up_to_a_right_angle_every_scheme_answers(degrees: float) -> None:
    for body in (spinner(degrees=degrees, channels=cross(5e3)), spinner(degrees=degrees, steerable=Steerable(1e4))):
        for scheme in (*CLASSIC, "half-cone", "rhumb-line"):
            planned(body if scheme in CLASSIC else aimed(body, 30.0, 10.0), scheme, most=10 * PLENTY)


@pytest.mark.weekly
def test_a_planned_schedule_is_flown_in_so_many_steps_and_a_track_in_more() -> None:
    """One pulse that spins a needle up to turn after turn."""
    body, screw = spinner(2.0, 2e-4, spin=1e-3, degrees=60.0), channel("screw", 1e-5, 0.0, 1e-4)
    with pytest.raises(Infeasible, match="too many steps"):
        flight.flown(body, Schedule((channel_pulse(screw, 500.0, 1000.0),)))
    assert 0 < flight.flown(body, Schedule((channel_pulse(screw, 50.0, 100.0),))).steps <= flight.PLANNED_STEPS
    tumbling = spinner(moments=(100.0, 120.0, 80.0), degrees=5.0)
    assert flight.flown(tumbling, Schedule(), 30_000.0).steps > flight.PLANNED_STEPS


def test_pulses_of_no_length_are_not_fired_for_ever_where_a_tick_is_longer_than_a_channel_may_fire() -> None:
    """Nor is the multiple below the shortest on-time, or the plan thrown away for it: such channels are left out."""
    for times in ({"max_on_time": 0.05}, {"min_on_time": 0.12, "max_on_time": 0.19}):
        channels = (*fan(4, 3.0, 0.0), channel("odd", 2.0, 2.0, 0.0, **times))
        plan = planned(spinner(channels=channels, limits=Limits(tick=0.1)), "four-pulse")
        assert plan.feasible
        assert all(pulse.channel != "odd" for pulse in plan.pulses)
