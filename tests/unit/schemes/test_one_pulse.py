"""One pulse, Magnus 1970 (21): at once with a steerable torquer, at the right moment with fixed thrusters."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import replace
from functools import partial

import pytest
from support.builders import Outcome, channel, cross, fan, spinner, transverse
from support.feasible import feasible_by, left

from nutdamp import flight, planning
from nutdamp.remarks import infeasibility, remarks
from nutdamp.spacecraft import Limits, Spacecraft, Steerable

NANODEGREE = math.radians(1e-9)
SPINS = [3.0, -3.0]
BODIES = [(120.0, 80.0), (80.0, 120.0), (100.0, 190.0), (100.0, 20.0)]


feasible = partial(feasible_by, "one-pulse")


def infeasible(spacecraft: Spacecraft) -> str:
    plan = planning.plan(spacecraft, "one-pulse")
    assert not plan.feasible
    return infeasibility(plan)


# --- steerable -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize("degrees", [2.0, 20.0, 60.0])
@pytest.mark.parametrize(("A", "C"), [*BODIES, (100.0, 100.0)])
def test_ideal_steerable_impulse_at_once(A: float, C: float, degrees: float, spin: float) -> None:
    """J = A|ω| against ω at t = 0: no nutation, H moved by θ0."""
    spacecraft = spinner(A, C, spin, degrees)
    plan = feasible(spacecraft)
    (only,) = plan.pulses
    assert (only.t, only.on_time) == (0.0, 0.0)
    assert plan.pulses.total_impulse == pytest.approx(spacecraft.least_impulse, rel=1e-15)
    assert left(plan).nutation < 1e-14
    assert left(plan).momentum_shift == pytest.approx(math.radians(degrees), rel=1e-13)


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), [*BODIES, (100.0, 100.0)])
@pytest.mark.parametrize("share", [0.1, 0.9], ids=["short", "long"])
def test_steerable_pulse_with_a_real_width_leaves_no_nutation(A: float, C: float, spin: float, share: float) -> None:
    """Up to nine tenths of what one pulse can do at all, 2M/|aω3|."""
    plain = spinner(A, C, spin, 8.0)
    rate = max(abs(plain.inertia.a * spin), 0.3)
    torque = plain.least_impulse * rate / (2 * share)
    spacecraft = spinner(A, C, spin, 8.0, steerable=Steerable(torque))
    plan = feasible(spacecraft)
    assert len(plan.pulses) == 1
    assert plan.pulses.pulses[0].start == pytest.approx(0.0, abs=1e-15)
    assert left(plan).nutation < NANODEGREE
    assert Outcome(spacecraft, plan.pulses).nutation < NANODEGREE
    assert left(plan).momentum_shift < math.radians(8.0) * (1 + 1e-12)


def test_no_steerable_pulse_starts_before_zero_by_rounding() -> None:
    """The on-time worked out anew as impulse over torque would round, and start some at -1e-17 s."""
    for torque in range(5, 105):
        made = planning.plan(spinner(steerable=Steerable(torque / 0.7)), "one-pulse").pulses
        assert made.pulses[0].start >= 0.0


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_steerable_torquer_too_weak_for_one_pulse_fires_a_train(A: float, C: float, spin: float) -> None:
    plain = spinner(A, C, spin, 8.0)
    torque = plain.least_impulse * abs(plain.inertia.a * spin) / 11
    spacecraft = spinner(A, C, spin, 8.0, steerable=Steerable(torque))
    plan = feasible(spacecraft)
    assert len(plan.pulses) > 5
    assert max(pulse.on_time for pulse in plan.pulses) <= 0.25 * plain.body_period * (1.0 + 1e-9)  # 10 % lost to width
    assert left(plan).nutation < NANODEGREE
    # The last of a train of equal impulses stands against what is then left of ω, like all before it.
    assert Outcome(spacecraft, plan.pulses).nutation < NANODEGREE


def test_steerable_pulse_waits_for_the_end_of_a_blackout() -> None:
    spacecraft = spinner(steerable=Steerable(20.0), limits=Limits(earliest=1.0, blackout=((1.2, 4.0), (4.5, 5.0))))
    (only,) = feasible(spacecraft).pulses
    # A pulse of 1.06 s fits neither before 1.2 s nor between the windows.
    assert only.start == 5.0


# --- body-fixed ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
@pytest.mark.parametrize("channels", [cross(60.0)[:1], cross(60.0), fan(3, 50.0), fan(6, 80.0)], ids=[1, 4, 3, 6])
def test_fixed_pulse_waits_until_it_opposes_omega(A: float, C: float, spin: float, channels: object) -> None:
    """A single pulse of real width that leaves nothing; its centre is where ω stands against the torque."""
    spacecraft = spinner(A, C, spin, 2.0, channels=channels)  # type: ignore[arg-type]
    plan = feasible(spacecraft)
    (only,) = plan.pulses
    assert left(plan).nutation < NANODEGREE
    assert Outcome(spacecraft, plan.pulses).nutation < NANODEGREE
    (before,), _ = (track.rates for track in flight.by_impulses(spacecraft, plan.pulses).around_pulses())
    opposed = transverse(only.impulse) / transverse(before)
    assert opposed.real < 0.0
    assert abs(opposed.imag) < 1e-12 * abs(opposed)


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), BODIES)
def test_short_on_times_make_a_train_at_successive_alignments(A: float, C: float, spin: float) -> None:
    """Equal pulses one body period apart; the flown nutation is nothing."""
    plain = spinner(A, C, spin, 6.0)
    channels = (channel("+2", 0.0, 30.0, 0.0, max_on_time=plain.least_impulse / 30.0 / 5.5),)
    spacecraft = spinner(A, C, spin, 6.0, channels=channels, limits=Limits(horizon=30 * plain.body_period))
    plan = feasible(spacecraft)
    assert len(plan.pulses) >= 6
    gaps = [two.t - one.t for one, two in itertools.pairwise(plan.pulses)]
    assert gaps == pytest.approx([spacecraft.body_period] * len(gaps), rel=1e-12)
    on_times = [pulse.on_time for pulse in plan.pulses]
    assert on_times == pytest.approx([on_times[0]] * len(on_times), rel=1e-12)
    assert left(plan).nutation < NANODEGREE


def test_train_keeps_the_number_of_pulses_allowed_and_says_what_is_left() -> None:
    channels = (channel("+2", 0.0, 30.0, 0.0, max_on_time=0.1),)
    spacecraft = spinner(degrees=6.0, channels=channels, limits=Limits(max_pulses=3))
    plan = feasible(spacecraft)
    assert len(plan.pulses) == 3
    taken = 3 * 30.0 * 0.1
    assert 120.0 * abs(plan.flight.settled.omega) == pytest.approx(spacecraft.least_impulse - taken, rel=1e-3)
    assert any("limits.max_pulses = 3" in remark for remark in remarks(plan))


def test_the_channel_that_needs_fewest_pulses_is_taken_then_least_propellant_then_earliest() -> None:
    """Of two strong ones the thriftier."""
    channels = (
        channel("weak", 0.0, 5.0, 0.0, max_on_time=0.2, isp=300.0, thrust=1.0),
        channel("thirsty", 40.0, 0.0, 0.0, isp=100.0, thrust=20.0),
        channel("thrifty", -40.0, 0.0, 0.0, isp=300.0, thrust=20.0),
    )
    assert [pulse.channel for pulse in feasible(spinner(channels=channels)).pulses] == ["thrifty"]


def test_skew_torque_changes_the_spin_and_still_leaves_next_to_nothing() -> None:
    """The on-time counts the changing spin, so ω goes to zero; reported spin change is J3/C."""
    spacecraft = spinner(channels=(channel("skew", 0.0, 40.0, 8.0),))
    plan = feasible(spacecraft)
    (only,) = plan.pulses
    assert plan.spin_change == pytest.approx(8.0 * only.on_time / 80.0, rel=1e-12)
    outcome = Outcome(spacecraft, plan.pulses)
    assert outcome.spin == pytest.approx(3.0 + 8.0 * only.on_time / 80.0, abs=1e-11)
    assert outcome.nutation < NANODEGREE


def test_a_tick_rounds_start_and_on_time_and_leaves_little() -> None:
    spacecraft = spinner(channels=cross(20.0), limits=Limits(tick=0.01))
    plan = feasible(spacecraft)
    # Half a tick of on-time in about a second, half a tick of turning at 1 rad/s, of 5°.
    assert left(plan).nutation < math.radians(5.0) * 0.02
    assert left(plan).nutation > NANODEGREE


def test_sphere_with_fixed_channels_says_why_not() -> None:
    why = infeasible(spinner(100.0, 100.0, channels=cross(8.0)))
    assert "sphere" in why
    assert "four-pulse combines channels" in why


def test_sphere_with_a_channel_opposite_to_omega_works() -> None:
    plan = feasible(spinner(100.0, 100.0, phase=-0.5 * math.pi, channels=cross(8.0)))
    assert [pulse.channel for pulse in plan.pulses] == ["+2"]
    assert left(plan).nutation < NANODEGREE


def test_without_transverse_channels_there_is_a_reason() -> None:
    why = infeasible(spinner(channels=(channel("axial", 0.0, 0.1, 5.0),)))
    assert why == "no channel has a torque more transverse than axial, so none can damp a nutation"


def test_horizon_before_the_first_alignment_names_the_horizon_that_would_do() -> None:
    """Also where any on-time is allowed, and a shortest pulse has no length."""
    for shortest in (0.02, 0.0):
        body = spinner(channels=cross(20.0, min_on_time=shortest)[:1], limits=Limits(horizon=0.5))
        why = infeasible(body)
        assert "before the horizon of 0.5 s" in why


def test_a_shortest_pulse_too_strong_says_so() -> None:
    why = infeasible(spinner(degrees=0.1, channels=cross(20.0, min_on_time=1.0)))
    assert "too strong" in why
    assert "lower min_on_time" in why


@pytest.mark.parametrize("phase", [0.1, 1.0, 2.0])
@pytest.mark.parametrize("axial", [0.0, 9.0])
def test_one_pulse_allowed_where_more_are_needed_does_what_one_can(phase: float, axial: float) -> None:
    """The longest useful pulse, half a body period, and no error.

    With some torques rounding puts the most a pulse can do beyond itself; the on-time stays finite.
    """
    for torque in (31.45693363119974, 7.351789651391229, 4.901146515066305, 0.8803215669495988, 22.257278416867518):
        for ratio in (0.8, 2.0, 1.25, 1 / 3):
            spacecraft = spinner(
                111.32708414993223,
                111.32708414993223 * ratio,
                1.0648047448322029,
                50.0,
                phase,
                channels=(channel("+1", torque, 0.0, axial if torque > 10 else 0.0),),
                limits=Limits(max_pulses=1),
            )
            plan = feasible(spacecraft)
            assert plan.pulses.pulses[0].on_time <= 0.5 * spacecraft.body_period * (1 + 1e-9)


@pytest.mark.parametrize("steerable", [None, Steerable(20.0)])
def test_earliest_beyond_the_default_horizon_is_infeasible(steerable: Steerable | None) -> None:
    limits = Limits(earliest=1e6)
    assert infeasible(spinner(channels=cross(20.0), steerable=steerable, limits=limits))


@pytest.mark.parametrize("scheme", ["one-pulse", "four-pulse"])
@pytest.mark.parametrize("torque", [3.0, 30.0, 300.0])
@pytest.mark.parametrize("min_on_time", [0.0, 0.02])
def test_the_horizon_that_is_named_is_long_enough(scheme: str, torque: float, min_on_time: float) -> None:
    """What ends there is the pulse that it takes, not the shortest that there is."""
    body = spinner(degrees=5.0, channels=(channel("T", torque, 0.0, 0.0, min_on_time=min_on_time),))
    short = planning.plan(replace(body, limits=Limits(horizon=0.3)), scheme)
    found = re.search(r"would end at (\S+) s: set limits.horizon beyond that", infeasibility(short))
    assert found is not None, infeasibility(short)
    longer = planning.plan(replace(body, limits=Limits(horizon=float(found[1]) * (1.0 + 1e-5))), scheme)
    assert longer.feasible, infeasibility(longer)
