"""Two pulses, Magnus 1970 (22): exact at any angle with a steerable torquer; searched and trimmed with fixed ones."""

from __future__ import annotations

import itertools
import math
from functools import partial

import numpy as np
import pytest
from support.builders import Outcome, channel, cross, fan, spinner, transverse, within
from support.checker import violations
from support.feasible import feasible_by, left

from nutdamp import flight, planning
from nutdamp.physics import damping
from nutdamp.remarks import infeasibility, remarks
from nutdamp.schedule import Schedule
from nutdamp.schemes import Options
from nutdamp.spacecraft import Limits, Steerable

NANODEGREE = math.radians(1e-9)
SPINS = [3.0, -3.0]
RATIOS = [round(a, 1) for a in np.arange(-0.9, 0.91, 0.1)]
"""a from -0.9 to 0.9, the sphere included."""


feasible = partial(feasible_by, "two-pulse")


# --- steerable -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize("a", RATIOS)
def test_exact_at_every_angle_for_the_impulse_of_the_floor(a: float, spin: float) -> None:
    """Nutation and shift of H below 1e-9 deg by (17) for θ0 = 2…60°; Σ|J| = A|ω0| to 1e-12."""
    for degrees in (2.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0):
        spacecraft = spinner(100.0, 100.0 * (1 - a), spin, degrees)  # no actuator named: an ideal steerable impulse
        plan = feasible(spacecraft)
        assert plan.residual is not None
        assert plan.residual.nutation < NANODEGREE
        assert plan.residual.momentum_shift < NANODEGREE
        assert plan.pulses.total_impulse == pytest.approx(spacecraft.least_impulse, rel=1e-12)


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize("a", [-0.9, -0.3, 0.0, 0.3, 0.9])
@pytest.mark.parametrize("degrees", [2.0, 60.0])
def test_exact_by_the_reference_integrator_too(a: float, spin: float, degrees: float) -> None:
    spacecraft = spinner(100.0, 100.0 * (1 - a), spin, degrees)
    outcome = Outcome(spacecraft, feasible(spacecraft).pulses)
    # DOP853 adds up some 1e-12 rad over the half turn.
    assert outcome.nutation < NANODEGREE
    assert outcome.shift < NANODEGREE


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize("torque", [200.0, 30.0])
@pytest.mark.parametrize(("A", "C"), [(120.0, 80.0), (80.0, 120.0), (100.0, 100.0)])
def test_exact_with_real_widths(A: float, C: float, torque: float, spin: float) -> None:
    """Directions, on-times and moments are trimmed: pulses as long as half the wait leave nothing."""
    spacecraft = spinner(A, C, spin, degrees=10.0, steerable=Steerable(torque))
    plan = feasible(spacecraft)
    assert left(plan).nutation < NANODEGREE
    assert left(plan).momentum_shift < NANODEGREE
    outcome = Outcome(spacecraft, plan.pulses)
    assert outcome.nutation < NANODEGREE
    assert outcome.shift < NANODEGREE


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(
    ("degrees", "displaced", "digit"), [(2.0, 0.0016, 5e-5), (10.0, 0.19, 5e-3), (30.0, 5.1, 0.05)]
)
def test_literal_reproduces_the_printed_scheme(degrees: float, displaced: float, digit: float, spin: float) -> None:
    """Equal halves, Δt from the ω before the first: no nutation, but H displaced."""
    spacecraft = spinner(120.0, 80.0, spin, degrees)
    plan = feasible(spacecraft, Options(literal=True))
    first, second = plan.pulses
    assert first.magnitude == pytest.approx(0.5 * spacecraft.least_impulse, rel=1e-15)
    assert second.magnitude == pytest.approx(0.5 * spacecraft.least_impulse, rel=1e-15)
    omega, spin_ = spacecraft.transverse_rate, spacecraft.spin
    assert second.t - first.t == pytest.approx(math.pi / math.hypot(omega, 80.0 / 120.0 * spin_), rel=1e-14)
    assert left(plan).nutation < NANODEGREE
    assert math.degrees(left(plan).momentum_shift) == pytest.approx(displaced, abs=digit)


def test_waits_for_a_later_half_turn_where_a_blackout_covers_the_first() -> None:
    free = feasible(spinner())
    half = damping.half_pulses(120.0, 80.0, spinner().transverse_rate, 3.0).wait
    end = 2.0 * half
    covered = feasible(spinner(limits=Limits(blackout=((0.5 * half, end),), earliest=0.0)))
    assert free.pulses.end == pytest.approx(half, rel=1e-12)
    assert covered.pulses.pulses[0].t >= end or covered.pulses.end >= end
    assert left(covered).nutation < NANODEGREE
    assert left(covered).momentum_shift < NANODEGREE


def test_a_torquer_too_weak_for_half_the_nutation_says_what_is_needed() -> None:
    plan = planning.plan(spinner(degrees=30.0, steerable=Steerable(1.0)), "two-pulse")
    assert not plan.feasible
    assert "needs a torque above" in infeasibility(plan)


def test_one_pulse_allowed_is_too_few() -> None:
    plan = planning.plan(spinner(limits=Limits(max_pulses=1)), "two-pulse")
    assert infeasibility(plan) == "two pulses are needed, and limits.max_pulses allows 1"


def test_a_blackout_to_the_horizon_is_found_hopeless_at_once() -> None:
    """Not every odd number of half turns within 10⁷ s is tried."""
    limits = Limits(horizon=1e7, blackout=((0.0, 1e7),))
    with within(1_000_000):
        plan = planning.plan(spinner(steerable=Steerable(8.0), limits=limits), "two-pulse")
    assert not plan.feasible


# --- body-fixed ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(
    ("A", "C"), [(120.0, 80.0), (80.0, 120.0), (100.0, 80.0), (100.0, 133.0), (100.0, 35.0), (100.0, 190.0)]
)
@pytest.mark.parametrize("degrees", [0.5, 5.0, 15.0])
def test_fixed_channels_are_exact_after_trimming(A: float, C: float, spin: float, degrees: float) -> None:
    """No nutation and H back where it was, on the real widths, with ±1, ±2."""
    spacecraft = spinner(A, C, spin, degrees, channels=cross(150.0))
    plan = feasible(spacecraft)
    assert len(plan.pulses) == 2
    assert left(plan).nutation < NANODEGREE
    assert left(plan).momentum_shift < NANODEGREE


@pytest.mark.parametrize("spin", SPINS)
def test_fixed_channels_are_exact_by_the_reference_integrator(spin: float) -> None:
    spacecraft = spinner(spin=spin, degrees=5.0, channels=fan(5, 40.0))
    outcome = Outcome(spacecraft, feasible(spacecraft).pulses)
    assert outcome.nutation < 5e-11  # what DOP853 adds up over the wait
    assert outcome.shift < 5e-11


@pytest.mark.parametrize("spin", SPINS)
def test_where_fixed_channels_never_line_up_the_cost_is_that_of_the_physics_sheet(spin: float) -> None:
    """A/C = 1.25 with ±1, ±2 costs 1/cos 18° = 1.051 × A|ω0| at any horizon: small angle, pulses short."""
    for horizon in (None, 500.0):
        spacecraft = spinner(100.0, 80.0, spin, 0.1, channels=cross(1000.0), limits=Limits(horizon=horizon))
        plan = feasible(spacecraft)
        cost = plan.pulses.total_impulse / spacecraft.least_impulse
        assert cost == pytest.approx(1 / math.cos(math.radians(18)), rel=1e-4)
        assert left(plan).momentum_shift < NANODEGREE


def test_channels_at_the_mounting_angle_need_no_more_than_the_floor() -> None:
    """Two fixed actuators that push both ways: half a turn apart, for A|ω0| and the width."""
    reference = spinner(degrees=5.0)
    angle = damping.mounting_angle(120.0, 80.0, reference.transverse_rate, 3.0)
    d = 2000.0 * complex(math.cos(angle), math.sin(angle))
    pair = (
        channel("a+", 2000.0, 0.0, 0.0),
        channel("a-", -2000.0, 0.0, 0.0),
        channel("b+", d.real, d.imag, 0.0),
        channel("b-", -d.real, -d.imag, 0.0),
    )
    spacecraft = spinner(degrees=5.0, channels=pair)
    plan = feasible(spacecraft)
    first, second = plan.pulses
    wait = damping.half_pulses(120.0, 80.0, spacecraft.transverse_rate, 3.0).wait
    assert second.t - first.t == pytest.approx(wait, abs=1e-3)
    assert plan.pulses.total_impulse == pytest.approx(spacecraft.least_impulse, rel=1e-5)


def test_on_times_too_short_leave_a_remainder_and_say_so() -> None:
    """±1, ±2 of 10 N m for at most a second: half of what 21 N m s ask for, at most."""
    spacecraft = spinner(degrees=5.0, channels=cross(5.0, max_on_time=1.0))
    plan = feasible(spacecraft)
    assert {pulse.on_time for pulse in plan.pulses} == {1.0}
    assert left(plan).nutation > math.radians(1)
    assert any("the allowed on-times miss the impulse needed by" in remark for remark in remarks(plan))


def test_skew_channels_change_the_spin_by_their_axial_impulse_over_c() -> None:
    channels = tuple(
        channel(name, *torque) for name, torque in {"a": (30, 0, 2), "b": (-30, 5, 1), "c": (0, -25, -3)}.items()
    )
    spacecraft = spinner(degrees=4.0, channels=channels)
    plan = feasible(spacecraft)
    axial = math.fsum(pulse.impulse[2] for pulse in plan.pulses)
    assert axial != 0.0
    assert plan.spin_change == pytest.approx(axial / 80.0, rel=1e-10)
    outcome = Outcome(spacecraft, plan.pulses)
    assert outcome.spin - 3.0 == pytest.approx(axial / 80.0, abs=1e-11)
    assert outcome.nutation == pytest.approx(left(plan).nutation, abs=5e-11)


def test_sphere_with_fixed_channels_says_why_not() -> None:
    plan = planning.plan(spinner(100.0, 100.0, channels=cross(8.0)), "two-pulse")
    assert "sphere" in infeasibility(plan)
    assert "does not turn" in infeasibility(plan)


def test_sphere_with_a_channel_opposite_to_omega_works() -> None:
    spacecraft = spinner(100.0, 100.0, phase=math.pi, degrees=5.0, channels=(channel("+1", 8.0, 0.0, 0.0),))
    plan = feasible(spacecraft)
    assert left(plan).nutation < NANODEGREE
    assert left(plan).momentum_shift < NANODEGREE


def test_only_channels_more_transverse_than_axial_are_fired() -> None:
    spacecraft = spinner(channels=(*cross(40.0), channel("spin-up", 1.0, 0.0, 5.0)))
    assert all(pulse.channel != "spin-up" for pulse in feasible(spacecraft).pulses)
    alone = planning.plan(spinner(channels=(channel("spin-up", 1.0, 0.0, 5.0),)), "two-pulse")
    assert infeasibility(alone) == "no channel has a torque more transverse than axial, so none can damp a nutation"


@pytest.mark.parametrize("literal", [False, True])
def test_a_gap_longer_than_the_cheapest_waits_is_kept(literal: bool) -> None:
    spacecraft = spinner(degrees=3.0, channels=cross(60.0), limits=Limits(gap=20.0, horizon=300.0))
    plan = feasible(spacecraft, Options(literal=literal))
    first, second = plan.pulses
    assert second.start - first.end >= 20.0 - 1e-9


@pytest.mark.parametrize("a", [1e-6, 1e-10, 1e-15])
def test_near_spheres_are_planned_or_declined_in_no_time(a: float) -> None:
    """The default horizon is 20 T_ω: its 20/a closings of H are not laid out one by one."""
    spacecraft = spinner(120.0, 120.0 * (1 - a), channels=cross(8.0))
    with within(3_000_000):
        plan = planning.plan(spacecraft, "two-pulse")
    assert plan.feasible or infeasibility(plan)


def test_a_long_horizon_costs_no_time() -> None:
    """10⁷ s are 116 days."""
    with within(3_000_000):
        plan = planning.plan(spinner(channels=cross(8.0), limits=Limits(horizon=1e7)), "two-pulse")
    assert plan.feasible


def test_trimming_does_not_run_away() -> None:
    """On-times and moments are bounded, so that no trial flies for 10⁵ s under torque."""
    body = spinner(
        27.184196833257793,
        54.36839366651559,
        0.1298681271574343,
        2.4666967171796332,
        phase=0.0,
        channels=(
            channel("T0", 0.0, 0.07812199696304258, 0.0),
            channel("T1", 0.0017921515598551382, -0.004499826153832031, 0.00026736933327888593, min_on_time=0.0352),
            channel("T2", -0.0058350853171264165, -0.022754617512655954, 0.00035239014198196254, min_on_time=0.0038),
        ),
        limits=Limits(horizon=2194.4435233461004, earliest=1844.9859185150808),
    )
    with within(3_000_000):
        plan = planning.plan(body, "two-pulse")
    assert plan.feasible or infeasibility(plan)


def test_pulses_oppose_omega_together() -> None:
    """At small angles each effective impulse of a perfect pair is straight against ω at its moment."""
    spacecraft = spinner(degrees=0.01)
    made = Schedule(feasible(spacecraft).pulses.pulses)
    before, _ = flight.by_impulses(spacecraft, made).around_pulses()
    for pulse, rates in itertools.zip_longest(made, before.rates):
        along = transverse(pulse.impulse) / transverse(rates)
        assert along.real < 0.0
        assert abs(along.imag) < 1e-12 * abs(along)


@pytest.mark.parametrize("count", [3, 5])
def test_of_pairs_that_cost_about_the_same_the_first_to_end(count: int) -> None:
    """With three channels the cheapest pair saves 0.04 % and ends 2.4 s later than the first exact one."""
    spacecraft = spinner(channels=fan(count, 8.0))
    weighed = [plan.pulses for plan in planning.alternatives(spacecraft, "two-pulse")]
    least = min(made.total_impulse for made in weighed)
    ends = [made.end for made in weighed if made.total_impulse <= 1.01 * least]
    assert len(ends) > 2
    assert ends == sorted(ends)
    assert feasible(spacecraft).pulses.end == ends[0]
    assert min(weighed, key=lambda made: made.total_impulse).end != ends[0]


def test_the_schedules_weighed_keep_the_limits_and_hold_the_one_taken() -> None:
    spacecraft = spinner(channels=cross(8.0, max_on_time=2.0))
    weighed = planning.alternatives(spacecraft, "two-pulse")
    assert len(weighed) > 2
    for plan in weighed:
        assert violations(spacecraft, plan.pulses) == []
        assert len(plan.pulses) == 2
        assert left(plan).nutation < spacecraft.nutation
    taken = feasible(spacecraft).pulses
    assert any(np.allclose([pulse.t for pulse in plan.pulses], [pulse.t for pulse in taken]) for plan in weighed)


def test_a_steerable_torquer_leaves_nothing_to_weigh() -> None:
    assert planning.alternatives(spinner(), "two-pulse") == ()
    assert planning.alternatives(spinner(channels=cross(8.0)), "one-pulse") == ()


def test_without_nutation_there_is_nothing_to_weigh() -> None:
    assert planning.alternatives(spinner(degrees=0.0, channels=cross(8.0)), "two-pulse") == ()
