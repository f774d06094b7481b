"""Body-fixed pulses at every alignment, Magnus 1970 section 4: spacing, sign rule, what is left coarse and fine."""

from __future__ import annotations

import itertools
import math
from functools import partial

import pytest
from support.builders import Outcome, channel, cross, fan, spinner, within
from support.cases import spread
from support.feasible import feasible_by, left

from nutdamp import planning
from nutdamp.errors import SenselessOption
from nutdamp.remarks import infeasibility, remarks
from nutdamp.schemes import Options
from nutdamp.schemes.options import FourPulseOptions
from nutdamp.spacecraft import Limits

NANODEGREE = math.radians(1e-9)
BODIES = [(120.0, 80.0), (80.0, 120.0), (100.0, 10.0), (100.0, 190.0)]
SPINS = [3.0, -3.0]


feasible = partial(feasible_by, "four-pulse")


def transverse_rate_after(plan: planning.Plan) -> float:
    return abs(plan.flight.settled.omega)


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_pulses_come_a_quarter_of_the_body_period_apart(A: float, C: float, spin: float) -> None:
    """To 1e-12 relative, with ±1, ±2 in the order in which ω passes them: mirrored for aω3 < 0."""
    plain = spinner(A, C, spin, 8.0)
    spacecraft = spinner(A, C, spin, 8.0, channels=cross(plain.least_impulse / plain.body_period * 4))
    plan = feasible(spacecraft, Options(on_time=plain.body_period / 100, coarse=True))
    assert len(plan.pulses) > 10
    gaps = [two.t - one.t for one, two in itertools.pairwise(plan.pulses)]
    assert gaps == pytest.approx([spacecraft.body_period / 4] * len(gaps), rel=1e-12)
    turn = ["+1", "-2", "-1", "+2"] if (A - C) * spin > 0 else ["+1", "+2", "-1", "-2"]
    order = [pulse.channel for pulse in plan.pulses]
    start = turn.index(order[0])
    assert order == [turn[(start + index) % 4] for index in range(len(order))]


@spread("spin", SPINS, quick=1)
@spread(("A", "C"), BODIES, quick=2)
def test_coarse_pulses_leave_at_most_half_a_pulse(A: float, C: float, spin: float) -> None:
    """|ω| <= J/(2A), and each pulse before takes |ω| down by J/A (times its width factor)."""
    for share in (0.013, 0.03, 0.1, 0.4):
        plain = spinner(A, C, spin, 8.0)
        on_time = plain.body_period / 50
        torque = share * plain.least_impulse / on_time
        spacecraft = spinner(A, C, spin, 8.0, channels=cross(torque))
        plan = feasible(spacecraft, Options(on_time=on_time, coarse=True))
        assert {pulse.on_time for pulse in plan.pulses} == {on_time}
        assert transverse_rate_after(plan) <= torque * on_time / (2 * A) * (1 + 1e-12)
        half = 0.5 * abs(spacecraft.inertia.a * spin) * on_time
        each = torque * on_time * math.sin(half) / half
        expected = abs(spacecraft.least_impulse - len(plan.pulses) * each)
        assert A * transverse_rate_after(plan) == pytest.approx(expected, abs=1e-10 * spacecraft.least_impulse)
        outcome = Outcome(spacecraft, plan.pulses)
        assert outcome.nutation == pytest.approx(left(plan).nutation, abs=1e-9)


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
@pytest.mark.parametrize("channels", [cross(3.0), fan(3, 4.0), fan(7, 2.0), cross(5.0)[:1]], ids=["±1±2", 3, 7, 1])
def test_fine_damping_leaves_nothing(A: float, C: float, spin: float, channels: object) -> None:
    """A last, shorter pulse of A|ω|, for any number and direction of transverse channels."""
    spacecraft = spinner(A, C, spin, 4.0, channels=channels)  # type: ignore[arg-type]
    plan = feasible(spacecraft)
    if transverse_rate_after(plan) > 1e-12:  # one weak channel may not be done within the horizon
        assert plan.pulses.end > spacecraft.horizon - 1.1 * spacecraft.body_period
        assert any("remain" in remark for remark in remarks(plan))
    else:
        assert left(plan).nutation < NANODEGREE
        last, full = plan.pulses.pulses[-1], plan.pulses.pulses[0]
        assert len(plan.pulses) == 1 or last.on_time < full.on_time


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
@pytest.mark.parametrize("degrees", [3.0, 3.3, 3.7, 4.1])
def test_fine_damping_with_a_shortest_pulse_leaves_nothing_or_half_of_it(
    A: float, C: float, spin: float, degrees: float
) -> None:
    """Zero, or <= J_min/(2A) where the rest is below the smallest pulse."""
    plain = spinner(A, C, spin, 4.0)
    shortest, longest = plain.body_period / 40, plain.body_period / 20
    torque = plain.least_impulse / (7.3 * longest)
    spacecraft = spinner(A, C, spin, degrees, channels=cross(torque, min_on_time=shortest, max_on_time=longest))
    plan = feasible(spacecraft)
    rest = transverse_rate_after(plan)
    assert left(plan).nutation < NANODEGREE or rest <= torque * shortest / (2 * A) * (1 + 1e-12)
    assert Outcome(spacecraft, plan.pulses).nutation == pytest.approx(left(plan).nutation, abs=2e-11)


def test_firing_stops_when_it_would_no_longer_help() -> None:
    """|ω| below J/(2A) from the start: no pulse, and the reason."""
    spacecraft = spinner(degrees=1.0, channels=cross(100.0))
    least = spacecraft.least_impulse
    why = infeasibility(planning.plan(spacecraft, "four-pulse", Options(on_time=2.1 * least / 100.0, coarse=True)))
    assert why is not None
    plan = feasible(spacecraft, Options(on_time=1.9 * least / 100.0, coarse=True))
    assert len(plan.pulses) == 1


def test_default_on_time_is_an_eighth_of_the_body_period_or_the_longest_allowed() -> None:
    spacecraft = spinner(channels=cross(1.0))
    assert feasible(spacecraft).pulses.pulses[0].on_time == pytest.approx(spacecraft.body_period / 8, rel=1e-15)
    shorter = spinner(channels=cross(1.0, max_on_time=0.3))
    assert feasible(shorter).pulses.pulses[0].on_time == 0.3


def test_on_time_outside_what_a_channel_allows_is_refused() -> None:
    for on_time in (0.05, 0.6):
        spacecraft = spinner(channels=cross(5.0, min_on_time=0.1, max_on_time=0.5))
        plan = planning.plan(spacecraft, "four-pulse", Options(on_time=on_time))
        assert not plan.feasible
        assert "outside what +1 allows: 0.1 s to 0.5 s" in infeasibility(plan)


@pytest.mark.parametrize("on_time", [0.0, -1.0, math.inf, math.nan])
def test_an_on_time_of_nothing_or_for_ever_is_no_option(on_time: float) -> None:
    with pytest.raises(SenselessOption, match="expected a time above zero"):
        FourPulseOptions(on_time=on_time)


def test_skew_channels_change_the_spin_by_their_axial_impulse_over_c() -> None:
    channels = tuple(
        channel(name, *torque) for name, torque in {"a": (6, 0, 0.5), "b": (-6, 1, 0.2), "c": (0, -5, -0.4)}.items()
    )
    spacecraft = spinner(degrees=6.0, channels=channels)
    plan = feasible(spacecraft)
    axial = math.fsum(pulse.impulse[2] for pulse in plan.pulses)
    assert axial != 0.0
    assert plan.spin_change == pytest.approx(axial / 80.0, rel=1e-9)
    # The builder counts the changing spin exactly, so fine damping still leaves nothing.
    assert Outcome(spacecraft, plan.pulses).nutation < 1e-10


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.25 * math.pi, 2.0, -2.5])
def test_on_a_sphere_two_channels_share_the_nutation(phase: float) -> None:
    """ω stands still: ±1, ±2 together cost |cos φ| + |sin φ| times A|ω0|, and leave nothing."""
    spacecraft = spinner(100.0, 100.0, 2.0, 5.0, phase, channels=cross(8.0))
    plan = feasible(spacecraft)
    cost = plan.pulses.total_impulse / spacecraft.least_impulse
    assert cost == pytest.approx(abs(math.cos(phase)) + abs(math.sin(phase)), rel=1e-12)
    assert left(plan).nutation < NANODEGREE
    assert Outcome(spacecraft, plan.pulses).nutation < NANODEGREE


def test_on_a_sphere_the_two_channels_next_to_the_opposite_of_omega_are_the_cheapest() -> None:
    """Of seven directions; the cost is that of the parallelogram."""
    spacecraft = spinner(100.0, 100.0, 2.0, 5.0, phase=0.7, channels=fan(7, 8.0))
    plan = feasible(spacecraft)
    assert {pulse.channel for pulse in plan.pulses} == {"T3", "T4"}  # at 171° and 223°, on either side of 220°
    assert left(plan).nutation < NANODEGREE


def test_on_a_sphere_on_times_are_kept_by_more_pulses() -> None:
    spacecraft = spinner(100.0, 100.0, 2.0, 5.0, phase=0.3, channels=cross(8.0, max_on_time=0.25))
    plan = feasible(spacecraft)
    assert max(pulse.on_time for pulse in plan.pulses) <= 0.25
    assert left(plan).nutation < NANODEGREE


def test_on_a_sphere_one_channel_takes_out_its_share() -> None:
    """The component along it: sin of the angle between is left."""
    spacecraft = spinner(100.0, 100.0, 2.0, 5.0, phase=math.pi - 0.4, channels=cross(8.0)[:1])
    plan = feasible(spacecraft)
    expected = math.sin(0.4) * spacecraft.transverse_rate
    assert transverse_rate_after(plan) == pytest.approx(expected, rel=1e-12)


def test_pulses_of_different_channels_do_not_overlap() -> None:
    """At seven channels alignments are closer together than pulses are long."""
    spacecraft = spinner(degrees=20.0, channels=fan(12, 6.0))
    plan = feasible(spacecraft, Options(on_time=1.0))
    for one, two in itertools.pairwise(plan.pulses):
        assert two.start >= one.end - 1e-9


def test_a_tick_longer_than_a_channel_may_fire_leaves_that_channel_out() -> None:
    """And does not fire pulses of no length for ever, at one moment."""
    channels = (*cross(3.0), channel("brief", 2.0, 2.0, 0.0, max_on_time=0.05))
    with within(1_000_000):
        plan = feasible(spinner(channels=channels, limits=Limits(tick=0.1)))
    assert all(pulse.channel != "brief" for pulse in plan.pulses)


def test_no_multiple_of_the_tick_within_the_bounds_leaves_the_channel_out() -> None:
    """The multiple below the shortest must not be fired, nor the plan be thrown away for it."""
    channels = (*cross(3.0), channel("narrow", 2.0, 2.0, 0.0, min_on_time=0.12, max_on_time=0.19))
    plan = feasible(spinner(channels=channels, limits=Limits(tick=0.1)))
    assert all(pulse.channel != "narrow" for pulse in plan.pulses)


def test_horizon_before_the_first_alignment_names_the_horizon_that_would_do() -> None:
    """Also where any on-time is allowed, and a shortest pulse has no length."""
    for shortest in (0.02, 0.0):
        body = spinner(channels=cross(20.0, min_on_time=shortest)[:1], limits=Limits(horizon=0.5))
        why = infeasibility(planning.plan(body, "four-pulse"))
        assert why is not None
        assert "before the horizon of 0.5 s" in why


def test_fires_thrusters_only() -> None:
    plan = planning.plan(spinner(), "four-pulse")
    assert infeasibility(plan) == "the file names no thrusters, and this scheme fires body-fixed ones"
