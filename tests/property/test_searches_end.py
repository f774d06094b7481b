"""Every search ends, whatever it is given: bounds count steps, and what is found within them keeps the limits."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.builders import aimed, channel, cross, fan, spinner, within
from support.cases import spread
from support.checker import violations
from support.places import case

from nutdamp import flight, planning
from nutdamp.errors import Infeasible
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.limits import Windows
from nutdamp.remarks import infeasibility, remarks
from nutdamp.schedule import TOUCHING, Schedule, channel_pulse
from nutdamp.schemes import CLASSIC, Options
from nutdamp.schemes.tools import steerable_pair
from nutdamp.schemes.tools.impulse_builder import MOST_PULSES, ImpulseBuilder
from nutdamp.spacecraft import Disturbance, Limits, Spacecraft, Steerable

PLENTY = 3_000_000
"""Calls of functions; a plan takes a tenth of that."""


def read(name: str) -> Spacecraft:
    return read_spacecraft(case(name).read_text(), name)


def test_alignments_that_a_disturbance_moves_before_the_gap_is_over_are_passed_by() -> None:
    """They were awaited in steps of a nanosecond."""
    body = read("never-returns.yaml")
    with within(PLENTY):
        plan = planning.plan(body, "four-pulse", Options(with_disturbances=True))
    assert plan.feasible
    assert violations(body, plan.pulses) == []
    assert plan.flown is not None
    assert plan.flown.nutation < 1e-9


@pytest.mark.parametrize("scheme", CLASSIC)
def test_on_times_of_a_nanosecond_are_fired_at_moments_of_their_own(scheme: str) -> None:
    """Such a pulse ends within the slack for rounding: the next alignment was the same one, again and again."""
    body = read("crash-max-on-time-1e-9-hang.yaml")
    with within(PLENTY):
        plan = planning.plan(body, scheme)
    assert plan.feasible
    moments = [pulse.t for pulse in plan.pulses]
    assert all(two > one for one, two in itertools.pairwise(moments))


@pytest.mark.deep
@spread("scheme", ["one-pulse", "four-pulse"], quick=1)
def test_no_more_pulses_are_laid_than_anybody_commands(scheme: str) -> None:
    body = spinner(channels=cross(8.0, max_on_time=1e-4), limits=Limits(horizon=1e7))
    with within(10 * PLENTY):
        plan = planning.plan(body, scheme)
    assert len(plan.pulses) == MOST_PULSES
    assert any(f"ends after {MOST_PULSES} pulses" in remark for remark in remarks(plan))


def power(rng: np.random.Generator, least: float, most: float) -> float:
    return float(10.0 ** rng.uniform(least, most))


def disturbed(rng: np.random.Generator) -> Spacecraft:
    """Any disturbances, gaps, ticks and windows: alignments wander, and some are never to be had."""
    A, a = power(rng, -1, 3), float(rng.choice([0.3, -0.5, 0.0, 1e-3, 0.9, -1.0]))
    body = spinner(A, A * (1 - a), float(rng.choice([3.0, -0.2])), float(rng.choice([0.1, 5.0, 60.0])))
    period, torque = min(body.body_period, body.inertial_period), body.least_impulse * body.inertial_period
    size = body.least_impulse / period
    turning = float(rng.choice([0.0, -body.spin, -body.inertia.a * body.spin, rng.normal()]))
    kicks = [
        Disturbance(power(rng, -4, 1) * size, 0.0, turning),
        Disturbance(0j, power(rng, -4, 0) * size * float(rng.choice([1.0, -1.0]))),
    ]
    ends = np.sort(rng.uniform(0.0, 20.0 * period, 8)).reshape(-1, 2)
    return replace(
        body,
        channels=fan(int(rng.integers(1, 6)), power(rng, -2, 1) * torque),
        disturbances=tuple(kicks[: rng.integers(0, 3)]),
        limits=Limits(
            horizon=power(rng, 0, 4) * period,
            gap=float(rng.choice([0.0, power(rng, -2, 1) * period])),
            earliest=float(rng.choice([0.0, 0.1 * period])),
            tick=float(rng.choice([1e-3, 0.3, 3.0])) * period if rng.random() < 0.3 else None,
            blackout=tuple((float(one), float(two)) for one, two in ends) if rng.random() < 0.5 else (),
        ),
    )


@pytest.mark.deep
def test_the_next_alignment_is_found_or_given_up() -> None:
    found = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        body = disturbed(rng)
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
                found += 1
                builder.fire(pulse)
    assert found > 500


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
    steps = 0

    def cost(points: np.ndarray) -> np.ndarray:
        nonlocal steps
        steps += 1
        return np.asarray(1.0 / (1.0 + np.exp(np.minimum(1e-9 * points[:, 0], 700.0))))

    with within(PLENTY):
        steerable_pair._descend(cost, np.array([0.0]), np.array([1.0]))
    assert steps <= steerable_pair.COMPASS_STEPS + 1


def test_a_channel_that_can_do_nothing_ends_the_walk() -> None:
    """No gain, no further pulse."""
    weak = channel("weak", 1e-30, 0.0, 0.0, max_on_time=0.1)
    with within(PLENTY):
        plan = planning.plan(spinner(channels=(weak,)), "four-pulse")
    assert not plan.feasible or math.isfinite(plan.pulses.end)


@pytest.mark.parametrize("scheme", CLASSIC)
def test_near_a_right_angle_of_nutation_there_is_an_answer(scheme: str) -> None:
    """Thrusters whose torque about axis 3 spins a needle up to hundreds of turns a minute: minutes, before."""
    body = read("slow-89-deg.yaml")
    with within(10 * PLENTY):
        plan = planning.plan(body, scheme)
        figures = plan.flown, plan.residual, plan.delta_v
    assert plan.feasible == (None not in figures)


@pytest.mark.weekly
@spread("degrees", [89.9, 89.999], quick=1, deep=1)
def test_up_to_a_right_angle_every_scheme_answers(degrees: float) -> None:
    for body in (spinner(degrees=degrees, channels=cross(5e3)), spinner(degrees=degrees, steerable=Steerable(1e4))):
        for scheme in (*CLASSIC, "half-cone", "rhumb-line"):
            with within(10 * PLENTY):
                plan = planning.plan(aimed(body, 30.0, 10.0) if scheme not in CLASSIC else body, scheme)
                left = plan.flown
            assert (left is None) == (infeasibility(plan) != "")


@pytest.mark.weekly
def test_a_planned_schedule_is_flown_in_so_many_steps_and_a_track_in_more() -> None:
    """One pulse that spins a needle up to turn after turn."""
    body = spinner(2.0, 2e-4, spin=1e-3, degrees=60.0)
    spin_up = Schedule((channel_pulse(channel("screw", 1e-5, 0.0, 1e-4), 500.0, 1000.0),))
    with pytest.raises(Infeasible, match="too many steps"):
        flight.flown(body, spin_up)
    short = Schedule((channel_pulse(channel("screw", 1e-5, 0.0, 1e-4), 50.0, 100.0),))
    assert 0 < flight.flown(body, short).steps <= flight.PLANNED_STEPS
    tumbling = spinner(moments=(100.0, 120.0, 80.0), degrees=5.0)
    assert flight.flown(tumbling, Schedule(), 30_000.0).steps > flight.PLANNED_STEPS
