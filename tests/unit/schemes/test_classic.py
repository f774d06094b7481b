"""One pulse (21), two pulses (22) and pulses at every alignment, Magnus 1970."""

import cmath
import itertools
import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import reference
from support.builders import (
    Outcome,
    aimed,
    channel,
    codes,
    cross,
    fan,
    noted,
    present,
    spinner,
    transverse,
    within,
)
from support.cases import deep, spread, weekly
from support.checker import feasible_by, left, violations
from support.golden import check_text, refused
from support.places import case
from support.process import Run

from nutdamp.errors import SenselessOption
from nutdamp.files.reader import example_text, load_spacecraft, read_spacecraft
from nutdamp.flight import propagation
from nutdamp.physics import body as rigid_body
from nutdamp.physics import driven
from nutdamp.physics import inertia as principal_moments
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import infeasibility
from nutdamp.planning.notes import plan_notes
from nutdamp.schemes.catalogue import CLASSIC, FourPulseOptions, Options
from nutdamp.schemes.correction import model_of, steady_omega
from nutdamp.schemes.sequential import ImpulseBuilder
from nutdamp.spacecraft.constraints import worths
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Disturbance, Inertia, Limits, Requirement, Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.views.check import checked_json

NANODEGREE = math.radians(1e-9)
BODIES = [(120.0, 80.0), (80.0, 120.0), (100.0, 190.0), (100.0, 10.0)]
SPINS = [3.0, -3.0]
SPHERE = (100.0, 100.0)
each_body = spread(
    ("A", "C", "spin"), [(*body, spin) for body in BODIES for spin in SPINS], quick=4, deep=4
)
each_shape = pytest.mark.parametrize(
    ("A", "C", "spin"), [(*body, s) for body in [*BODIES, SPHERE] for s in SPINS]
)


def check_exact(
    spacecraft: Spacecraft, scheme: str, count: int, *, by_reference: bool = True
) -> planning.Plan:
    """No nutation is left, and of two pulses no shift of H, flown and by the reference."""
    plan = feasible_by(scheme, spacecraft)
    assert len(plan.pulses) == count
    ends = [(left(plan).nutation, left(plan).momentum_shift)]
    if by_reference:
        outcome = Outcome(spacecraft, plan.pulses)
        ends.append((outcome.nutation, outcome.shift))
    assert max(nutation for nutation, _ in ends) < NANODEGREE
    assert count != 2 or max(shift for _, shift in ends) < NANODEGREE
    return plan


def check_opposed(spacecraft: Spacecraft, made: Schedule) -> None:
    """Each effective impulse is straight against ω at its moment."""
    before, _ = propagation.by_impulses(spacecraft, made).around_pulses()
    for pulse, rates in zip(made, before.rates, strict=True):
        along = transverse(pulse.impulse) / transverse(rates)
        assert along.real < 0.0
        assert abs(along.imag) < 1e-12 * abs(along)


def rate_after(plan: planning.Plan) -> float:
    return abs(plan._flight.settled.omega)


def why_not(*cases: tuple[str, Spacecraft] | tuple[str, Spacecraft, Options]) -> str:
    plans = [planning.plan(spacecraft, scheme, *options) for scheme, spacecraft, *options in cases]
    assert not any(plan.feasible for plan in plans)
    return "\n".join(f"{plan.scheme}: {infeasibility(plan)}" for plan in plans)


def test_what_cannot_be_has_a_reason() -> None:
    axial = channel("spin-up", 1.0, 0.0, 5.0)
    soon = Limits(horizon=0.5)
    narrow = cross(5.0, min_on_time=0.1, max_on_time=0.5)
    early: dict[str, Any] = {"channels": cross(20.0), "limits": Limits(earliest=1e6)}
    first = [
        spinner(channels=cross(20.0, min_on_time=least)[:1], limits=soon) for least in (0.02, 0.0)
    ]
    check_text(
        "classic.why-not",
        why_not(
            *(
                (scheme, spinner(*SPHERE, channels=cross(8.0)[:1]))
                for scheme in ("one-pulse", "two-pulse")
            ),
            *((scheme, spinner(channels=(axial,))) for scheme in ("one-pulse", "two-pulse")),
            *((scheme, body) for scheme in ("one-pulse", "four-pulse") for body in first),
            ("one-pulse", spinner(degrees=0.1, channels=cross(20.0, min_on_time=1.0))),
            *(
                ("one-pulse", spinner(steerable=torquer, **early))
                for torquer in (None, Steerable(20.0))
            ),
            ("two-pulse", spinner(degrees=30.0, steerable=Steerable(1.0))),
            ("two-pulse", spinner(limits=Limits(max_pulses=1))),
            ("four-pulse", spinner()),
            *(
                ("four-pulse", spinner(channels=narrow), Options(on_time=on_time))
                for on_time in (0.05, 0.6)
            ),
        ),
    )
    plan = feasible_by("two-pulse", spinner(channels=(*cross(40.0), axial)))
    assert all(pulse.channel != "spin-up" for pulse in plan.pulses)


@pytest.mark.parametrize("scheme", ["one-pulse", "four-pulse"])
def test_the_horizon_that_is_named_is_long_enough(scheme: str) -> None:
    for torque in (3.0, 30.0, 300.0):
        jet = (channel("T", torque, 0.0, 0.0, min_on_time=0.02),)
        why = why_not((scheme, spinner(channels=jet, limits=Limits(horizon=0.3))))
        named = present(re.search(r"limits.horizon = (\S+) s is long enough", why), why)
        feasible_by(scheme, spinner(channels=jet, limits=Limits(horizon=float(named[1]))))


@pytest.mark.parametrize(
    ("scheme", "size"), [("one-pulse", 6.0), ("two-pulse", 5.0), ("four-pulse", 1.0)]
)
def test_skew_channels_change_the_spin_by_their_axial_impulse_over_c(
    scheme: str, size: float
) -> None:
    """The on-times count the changing spin,
    so that one-pulse and four-pulse still leave nothing.
    """
    torques = {"a": (6.0, 0.0, 0.5), "b": (-6.0, 1.0, 0.2), "c": (0.0, -5.0, -0.4)}
    spacecraft = spinner(
        channels=tuple(channel(name, *(size * one for one in T)) for name, T in torques.items())
    )
    plan = feasible_by(scheme, spacecraft)
    axial = math.fsum(pulse.impulse[2] for pulse in plan.pulses)
    outcome = Outcome(spacecraft, plan.pulses)
    assert axial != 0.0
    assert plan._spin_change == pytest.approx(axial / 80.0, rel=1e-9)
    assert outcome.spin - 3.0 == pytest.approx(axial / 80.0, abs=1e-11)
    assert outcome.nutation == pytest.approx(
        left(plan).nutation if scheme == "two-pulse" else 0.0, abs=1e-10
    )


@pytest.mark.parametrize("scheme", ["one-pulse", "two-pulse"])
def test_on_a_sphere_a_channel_opposite_to_omega_works(scheme: str) -> None:
    plan = check_exact(
        spinner(*SPHERE, phase=-0.5 * math.pi, channels=cross(8.0)),
        scheme,
        1 + (scheme == "two-pulse"),
    )
    assert {pulse.channel for pulse in plan.pulses} == {"+2"}


@each_shape
def test_one_ideal_steerable_impulse_at_once(A: float, C: float, spin: float) -> None:
    """J = A|ω| against ω at t = 0: no nutation, H moved by θ0."""
    for degrees in (2.0, 20.0, 60.0):
        plan = feasible_by("one-pulse", spinner(A, C, spin, degrees))
        (only,) = plan.pulses
        assert (only.t, only.on_time) == (0.0, 0.0)
        assert plan.pulses.total_impulse == pytest.approx(plan.spacecraft.least_impulse, rel=1e-15)
        assert left(plan).nutation < 1e-14
        assert left(plan).momentum_shift == pytest.approx(math.radians(degrees), rel=1e-13)


@each_shape
def test_one_steerable_pulse_of_real_width_or_a_train_where_the_torquer_is_too_weak(
    A: float, C: float, spin: float
) -> None:
    """Up to nine tenths of what one pulse can do at all, 2M/|aω3|; a train ends by what is left."""
    plain = spinner(A, C, spin, 8.0)
    rate = max(abs(plain.inertia.a * spin), 0.3)
    for share in (0.1, 0.9):
        torquer = Steerable(plain.least_impulse * rate / (2 * share))
        plan = check_exact(spinner(A, C, spin, 8.0, steerable=torquer), "one-pulse", 1)
        assert plan.pulses.pulses[0].start == pytest.approx(0.0, abs=1e-15)
        assert left(plan).momentum_shift < math.radians(8.0) * (1 + 1e-12)
    if A != C:
        weak = spinner(A, C, spin, 8.0, steerable=Steerable(plain.least_impulse * rate / 11))
        plan = feasible_by("one-pulse", weak)
        check_exact(weak, "one-pulse", len(plan.pulses))
        assert len(plan.pulses) > 5
        assert max(pulse.on_time for pulse in plan.pulses) <= 0.25 * plain.body_period * (
            1 + 1e-9
        )  # 10 % lost


def test_a_steerable_pulse_starts_no_sooner_than_it_may() -> None:
    """Not at -1e-17 s by rounding; 1.06 s fit neither before nor between windows."""
    for torque in range(5, 105):
        assert (
            planning.plan(spinner(steerable=Steerable(torque / 0.7)), "one-pulse")
            .pulses.pulses[0]
            .start
            >= 0.0
        )
    limits = Limits(earliest=1.0, blackout=((1.2, 4.0), (4.5, 5.0)))
    (only,) = feasible_by("one-pulse", spinner(steerable=Steerable(20.0), limits=limits)).pulses
    assert only.start == 5.0


@each_body
def test_a_fixed_pulse_waits_until_it_opposes_omega_and_short_ones_make_a_train(
    A: float, C: float, spin: float
) -> None:
    """Pulses of real width that leave nothing; equal ones, one body period apart."""
    for channels in (cross(60.0)[:1], cross(60.0), fan(3, 50.0), fan(6, 80.0)):
        spacecraft = spinner(A, C, spin, 2.0, channels=channels)
        check_opposed(spacecraft, check_exact(spacecraft, "one-pulse", 1).pulses)
    plain = spinner(A, C, spin, 6.0)
    period = plain.body_period
    longest = plain.least_impulse / 30.0 / 5.5
    jet = (channel("+2", 0.0, 30.0, 0.0, max_on_time=longest),)
    plan = feasible_by(
        "one-pulse", spinner(A, C, spin, 6.0, channels=jet, limits=Limits(horizon=30 * period))
    )
    count = len(plan.pulses)
    assert count >= 6
    assert np.diff([one.t for one in plan.pulses]) == pytest.approx(
        [period] * (count - 1), rel=1e-12
    )
    assert len({round(one.on_time / longest, 12) for one in plan.pulses}) == 1
    assert left(plan).nutation < NANODEGREE


def test_what_one_pulse_is_chosen_and_what_ticks_and_max_pulses_leave() -> None:
    """Of 5° half a tick of on-time in a second and of turning at 1 rad/s are left."""
    channels = (
        channel("weak", 0.0, 5.0, 0.0, max_on_time=0.2, isp=300.0, thrust=1.0),
        channel("thirsty", 40.0, 0.0, 0.0, isp=100.0, thrust=20.0),
        channel("thrifty", -40.0, 0.0, 0.0, isp=300.0, thrust=20.0),
    )
    assert [one.channel for one in feasible_by("one-pulse", spinner(channels=channels)).pulses] == [
        "thrifty"
    ]
    plan = feasible_by("one-pulse", spinner(channels=cross(20.0), limits=Limits(tick=0.01)))
    assert NANODEGREE < left(plan).nutation < math.radians(5.0) * 0.02
    jet = (channel("+2", 0.0, 30.0, 0.0, max_on_time=0.1),)
    plan = feasible_by("one-pulse", spinner(degrees=6.0, channels=jet, limits=Limits(max_pulses=3)))
    assert len(plan.pulses) == 3
    assert 120.0 * rate_after(plan) == pytest.approx(
        plan.spacecraft.least_impulse - 3 * 30.0 * 0.1, rel=1e-3
    )
    check_text("classic.max-pulses", noted(plan_notes(plan)))


def test_one_pulse_allowed_where_more_are_needed_does_what_one_can() -> None:
    """The longest useful pulse, half a body period, and no error.

    With some torques rounding puts the most a pulse can do beyond itself; the on-time stays finite.
    """
    torques = (
        31.45693363119974,
        7.351789651391229,
        4.901146515066305,
        0.8803215669495988,
        22.257278416867518,
    )
    A = 111.32708414993223
    for torque, ratio, phase, axial in itertools.product(
        torques, (0.8, 2.0, 1.25, 1 / 3), (0.1, 1.0, 2.0), (0.0, 9.0)
    ):
        jet = (channel("+1", torque, 0.0, axial if torque > 10 else 0.0),)
        body = spinner(
            A, A * ratio, 1.0648047448322029, 50.0, phase, channels=jet, limits=Limits(max_pulses=1)
        )
        made = planning.plan(body, "one-pulse").pulses
        assert 0.0 < made.pulses[0].on_time <= 0.5 * body.body_period * (1 + 1e-9)
        assert len(made) == 1


@pytest.mark.parametrize("spin", SPINS)
@spread("a", [round(0.1 * tenth, 1) for tenth in range(-9, 10)], quick=7, deep=12)
def test_two_ideal_pulses_are_exact_at_every_angle_for_the_impulse_of_the_floor(
    a: float, spin: float
) -> None:
    """Nutation and shift of H below 1e-9 deg by (17) for θ0 = 2…60°; Σ|J| = A|ω0| to 1e-12."""
    for degrees in (2.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0):
        by_reference = degrees in (2.0, 60.0) and a in (-0.9, 0.0, 0.3)
        spacecraft = spinner(
            100.0, 100.0 * (1 - a), spin, degrees
        )  # no actuator named: an ideal steerable impulse
        plan = check_exact(spacecraft, "two-pulse", 2, by_reference=by_reference)
        assert (
            max(present(plan.residual).nutation, present(plan.residual).momentum_shift) < NANODEGREE
        )
        assert plan.pulses.total_impulse == pytest.approx(spacecraft.least_impulse, rel=1e-12)


@pytest.mark.parametrize("spin", SPINS)
@pytest.mark.parametrize(("A", "C"), [*BODIES[:2], SPHERE])
def test_two_pulses_of_real_width_are_exact(A: float, C: float, spin: float) -> None:
    """Directions, on-times and moments are trimmed:
    pulses as long as half the wait leave nothing.
    """
    for torque in (200.0, 30.0):
        check_exact(spinner(A, C, spin, degrees=10.0, steerable=Steerable(torque)), "two-pulse", 2)


@spread("spin", SPINS, quick=2)
@spread(("A", "C"), [*BODIES[:3], (100.0, 80.0), (100.0, 133.0), (100.0, 35.0)], quick=1, deep=5)
def test_two_pulses_of_fixed_channels_are_exact_after_trimming(
    A: float, C: float, spin: float
) -> None:
    """No nutation and H back where it was, on the real widths, with ±1, ±2 or five directions."""
    for degrees in (0.5, 5.0, 15.0):
        check_exact(
            spinner(A, C, spin, degrees, channels=cross(150.0)),
            "two-pulse",
            2,
            by_reference=degrees == 5.0,
        )
    check_exact(spinner(A, C, spin, channels=fan(5, 150.0)), "two-pulse", 2, by_reference=False)


@pytest.mark.parametrize("spin", SPINS)
def test_literal_reproduces_the_printed_scheme(spin: float) -> None:
    """Equal halves, Δt from the ω before the first: no nutation, but H displaced."""
    for degrees, displaced, digit in ((2.0, 0.0016, 5e-5), (10.0, 0.19, 5e-3), (30.0, 5.1, 0.05)):
        plan = feasible_by("two-pulse", spinner(120.0, 80.0, spin, degrees), Options(literal=True))
        first, second = plan.pulses
        half = 0.5 * plan.spacecraft.least_impulse
        omega = plan.spacecraft.transverse_rate
        assert (first.magnitude, second.magnitude) == pytest.approx((half, half), rel=1e-15)
        assert second.t - first.t == pytest.approx(
            math.pi / math.hypot(omega, 80.0 / 120.0 * spin), rel=1e-14
        )
        assert left(plan).nutation < NANODEGREE
        assert math.degrees(left(plan).momentum_shift) == pytest.approx(displaced, abs=digit)


def test_the_second_waits_for_a_later_half_turn_where_a_window_or_gap_rules_out_the_first() -> None:
    half = rigid_body.half_pulses(120.0, 80.0, spinner().transverse_rate, 3.0).wait
    assert check_exact(spinner(), "two-pulse", 2).pulses.end == pytest.approx(half, rel=1e-12)
    covered = spinner(limits=Limits(blackout=((0.5 * half, 2.0 * half),), earliest=0.0))
    assert check_exact(covered, "two-pulse", 2).pulses.end >= 2.0 * half
    apart = spinner(degrees=3.0, channels=cross(60.0), limits=Limits(gap=20.0, horizon=300.0))
    for literal in (False, True):
        first, second = feasible_by("two-pulse", apart, Options(literal=literal)).pulses
        assert second.start - first.end >= 20.0 - 1e-9


@pytest.mark.parametrize("spin", SPINS)
def test_where_fixed_channels_never_line_up_the_cost_is_that_of_the_physics_sheet(
    spin: float,
) -> None:
    """A/C = 1.25 with ±1, ±2 costs 1/cos 18° = 1.051 × A|ω0| at any horizon, pulses short."""
    for horizon in (None, 500.0):
        body = spinner(
            100.0, 80.0, spin, 0.1, channels=cross(1000.0), limits=Limits(horizon=horizon)
        )
        cost = check_exact(body, "two-pulse", 2, by_reference=False).pulses.total_impulse
        assert cost / body.least_impulse == pytest.approx(1 / math.cos(math.radians(18)), rel=1e-4)


def test_channels_at_the_mounting_angle_need_no_more_than_the_floor() -> None:
    """Two fixed actuators that push both ways: half a turn apart, for A|ω0| and the width."""
    omega, wait = (
        spinner().transverse_rate,
        rigid_body.half_pulses(120.0, 80.0, spinner().transverse_rate, 3.0).wait,
    )
    angle = principal_moments.mounting_angle(120.0, 80.0, omega, 3.0)
    turns = 2000.0 * np.exp(1j * np.array([0.0, math.pi, angle, angle + math.pi]))
    pair = tuple(channel(f"T{number}", one.real, one.imag, 0.0) for number, one in enumerate(turns))
    made = feasible_by("two-pulse", spinner(channels=pair)).pulses
    assert made.pulses[1].t - made.pulses[0].t == pytest.approx(wait, abs=1e-3)
    assert made.total_impulse == pytest.approx(spinner().least_impulse, rel=1e-5)


def test_on_times_too_short_leave_a_remainder_and_say_so() -> None:
    """±1, ±2 of 5 N m for at most a second: half of what 21 N m s ask for, at most."""
    plan = feasible_by("two-pulse", spinner(channels=cross(5.0, max_on_time=1.0)))
    assert {pulse.on_time for pulse in plan.pulses} == {1.0}
    assert left(plan).nutation > math.radians(1)
    check_text("classic.too-short", noted(plan_notes(plan)))


@spread(
    "channels",
    [fan(3, 8.0), fan(5, 8.0), cross(8.0, max_on_time=2.0)],
    deep=2,
    ids=["3", "5", "±1±2"],
)
def test_of_pairs_that_cost_about_the_same_the_first_to_end_is_taken(
    channels: tuple[Channel, ...],
) -> None:
    """Of three channels the cheapest pair saves 0.04 % and ends 2.4 s after the first exact one."""
    spacecraft = spinner(channels=channels)
    weighed = planning.alternatives(spacecraft, "two-pulse")
    taken = feasible_by("two-pulse", spacecraft).pulses
    assert len(weighed) > 2
    for plan in weighed:
        assert violations(spacecraft, plan.pulses) == []
        assert len(plan.pulses) == 2
        assert left(plan).nutation < spacecraft.nutation
    assert any(
        np.allclose([one.t for one in plan.pulses], [one.t for one in taken]) for plan in weighed
    )
    if len(channels) % 2:
        cheapest = min(weighed, key=lambda plan: plan.pulses.total_impulse).pulses
        ends = [
            one.end for one in weighed if one.pulses.total_impulse <= 1.01 * cheapest.total_impulse
        ]
        assert len(ends) > 2
        assert ends == sorted(ends)
        assert taken.end == ends[0] != cheapest.end
    # With a torquer, by another scheme or without nutation there is nothing to weigh.
    still = spinner(degrees=0.0, channels=channels)
    for body, scheme in ((spinner(), "two-pulse"), (spacecraft, "one-pulse"), (still, "two-pulse")):
        assert planning.alternatives(body, scheme) == ()


@each_body
def test_pulses_come_a_quarter_of_the_body_period_apart(A: float, C: float, spin: float) -> None:
    """To 1e-12 relative, with ±1, ±2 in the order in which ω passes them: mirrored for aω3 < 0."""
    plain = spinner(A, C, spin, 8.0)
    spacecraft = spinner(
        A, C, spin, 8.0, channels=cross(plain.least_impulse / plain.body_period * 4)
    )
    made = feasible_by(
        "four-pulse", spacecraft, Options(on_time=plain.body_period / 100, coarse=True)
    ).pulses
    assert len(made) > 10
    gaps = np.diff([one.t for one in made])
    assert gaps == pytest.approx([plain.body_period / 4] * len(gaps), rel=1e-12)
    turn = ["+1", "-2", "-1", "+2"] if (A - C) * spin > 0 else ["+1", "+2", "-1", "-2"]
    order = [pulse.channel for pulse in made]
    assert (
        order
        == list(itertools.islice(itertools.cycle(turn), 4 + len(order)))[turn.index(order[0]) :][
            : len(order)
        ]
    )


@spread(("A", "C", "spin"), [(*body, spin) for body in BODIES for spin in SPINS], quick=1, deep=2)
def test_coarse_pulses_leave_at_most_half_a_pulse(A: float, C: float, spin: float) -> None:
    """|ω| <= J/(2A), and each pulse before takes |ω| down by J/A (times its width factor)."""
    for share in (0.013, 0.03, 0.1, 0.4):
        plain = spinner(A, C, spin, 8.0)
        on_time = plain.body_period / 50
        least = plain.least_impulse
        impulse = share * least
        spacecraft = spinner(A, C, spin, 8.0, channels=cross(impulse / on_time))
        plan = feasible_by("four-pulse", spacecraft, Options(on_time=on_time, coarse=True))
        assert {pulse.on_time for pulse in plan.pulses} == {on_time}
        assert rate_after(plan) <= impulse / (2 * A) * (1 + 1e-12)
        half = 0.5 * abs(spacecraft.inertia.a * spin) * on_time
        expected = abs(least - len(plan.pulses) * impulse * math.sin(half) / half)
        assert A * rate_after(plan) == pytest.approx(expected, abs=1e-10 * least)
        assert Outcome(spacecraft, plan.pulses).nutation == pytest.approx(
            left(plan).nutation, abs=1e-9
        )


@each_body
def test_fine_damping_leaves_nothing(A: float, C: float, spin: float) -> None:
    """A last, shorter pulse of A|ω|, for any number and direction of transverse channels."""
    for channels in (cross(3.0), fan(3, 4.0), fan(12, 2.0), cross(5.0)[:1]):
        plan = feasible_by("four-pulse", spinner(A, C, spin, 4.0, channels=channels))
        if rate_after(plan) > 1e-12:  # one weak channel may not be done within the horizon
            assert plan.pulses.end > plan.spacecraft.horizon - 1.1 * plan.spacecraft.body_period
            assert any(code.startswith("remains-") for code in codes(plan_notes(plan)))
        else:
            assert left(plan).nutation < NANODEGREE
            assert (
                len(plan.pulses) == 1
                or plan.pulses.pulses[-1].on_time < plan.pulses.pulses[0].on_time
            )


@each_body
def test_fine_damping_with_a_shortest_pulse_leaves_nothing_or_half_of_it(
    A: float, C: float, spin: float
) -> None:
    """Zero, or <= J_min/(2A) where the rest is below the smallest pulse."""
    plain = spinner(A, C, spin, 4.0)
    shortest, longest = plain.body_period / 40, plain.body_period / 20
    torque = plain.least_impulse / (7.3 * longest)
    channels = cross(torque, min_on_time=shortest, max_on_time=longest)
    for degrees in (3.0, 3.3, 3.7, 4.1):
        plan = feasible_by("four-pulse", spinner(A, C, spin, degrees, channels=channels))
        assert left(plan).nutation < NANODEGREE or rate_after(plan) <= torque * shortest / (
            2 * A
        ) * (1 + 1e-12)
    assert Outcome(plan.spacecraft, plan.pulses).nutation == pytest.approx(
        left(plan).nutation, abs=2e-11
    )


def test_on_times_of_four_pulse() -> None:
    """An eighth of the body period or the longest allowed; |ω| below J/(2A) at first: no pulse."""
    for longest, expected in ((math.inf, spinner().body_period / 8), (0.3, 0.3)):
        made = feasible_by("four-pulse", spinner(channels=cross(1.0, max_on_time=longest))).pulses
        assert made.pulses[0].on_time == pytest.approx(expected, rel=1e-15)
    for senseless in (0.0, -1.0, math.inf, math.nan):
        with refused(SenselessOption, f"classic.senseless{senseless:g}"):
            FourPulseOptions(on_time=senseless)
    body = spinner(degrees=1.0, channels=cross(100.0))
    too_long, useful = (
        Options(on_time=share * body.least_impulse / 100.0, coarse=True) for share in (2.1, 1.9)
    )
    assert why_not(("four-pulse", body, too_long))
    assert len(feasible_by("four-pulse", body, useful).pulses) == 1


STRONG = cross(4.0, max_on_time=0.3, isp=220.0, thrust=1.0)[:2]
LONG = math.tan(math.radians(5.0)) * 80.0 * 3.0 / 4.0  # s of firing that STRONG needs: A|ω0|/M


def wasting(share: float) -> tuple[Channel, ...]:
    """Two strong channels, and two beside them with a ``share`` of the arm."""
    return (*STRONG, *cross(share * 4.0, "R", max_on_time=0.3, isp=220.0, thrust=1.0)[2:])


@pytest.mark.parametrize(("share", "limits", "options", "firing"), [
    (0.51, Limits(), Options(), 4),
    (0.49, Limits(), Options(), 2),
    (0.05, Limits(), Options(coarse=True), 2),
    (0.05, Limits(), Options(least="impulse"), 2),
    (0.49, Limits(), Options(least="time"), 4),  # they help to end earlier
    (0.49, Limits(horizon=52.0), Options(), 4),  # too short for two
])  # fmt: skip
def test_a_channel_that_wastes_fires_where_the_others_are_not_enough(
    share: float, limits: Limits, options: Options, firing: int
) -> None:
    """Against the plan of the strong channels alone, which takes A|ω0| over their torque."""
    allowed = math.radians(0.3)
    body = spinner(channels=wasting(share), limits=limits, requirement=Requirement(allowed))
    plan = feasible_by("four-pulse", body, options)
    assert len({pulse.channel for pulse in plan.pulses}) == firing
    assert plan._flight.residual.nutation <= allowed
    alone = planning.plan(replace(body, channels=STRONG), "four-pulse", options).pulses
    if firing == 2:
        assert [pulse.t for pulse in plan.pulses] == [pulse.t for pulse in alone]
        assert sum(pulse.on_time for pulse in alone) == pytest.approx(LONG, rel=0.03)
    else:
        assert plan.pulses.end < alone.end


def test_weak_channels_of_three_moments_keep_the_ticks() -> None:
    """A schedule laid on the true motion leaves less, but starts on no tick."""
    for degrees in (2.0, 12.0):
        body = spinner(moments=(100.0, 140.0, 80.0), degrees=degrees, channels=STRONG)
        limits = Limits(horizon=60.0 if degrees == 2.0 else 30.0, tick=0.01)
        weak = tuple(each.of(torque=0.25 * each.torque) for each in STRONG)
        feasible_by("four-pulse", replace(body, channels=weak, limits=limits))


def test_the_worth_of_a_channel_is_the_nutation_that_it_makes_at_its_cost() -> None:
    """By arm, isp and moment of its axis: largest nutation of DOP853 after a kick of a pure spin;
    an impulse takes as much away.
    """
    body = spinner(moments=(90.0, 150.0, 60.0), degrees=0.0)
    channels = [
        channel("1", 4.0, 0.0, 0.0, isp=200.0, thrust=1.0),
        channel("2", 0.0, -2.0, 0.0, isp=300.0, thrust=0.5),
    ]
    made = []
    for each in channels:
        kick = 1e-4 * each.torque / present(each.mass_flow) / np.array(body.inertia.moments)
        start = reference.Motion(body.omega0 + kick, np.eye(3))
        times = np.linspace(0.0, body.body_period, 400)[1:]
        path = reference.coast(body.inertia.moments, start, np.zeros(3), times)
        angles = [reference.nutation(body.inertia.moments, each.rates, 1.0) for each in path]
        made.append(max(angles))
    assert worths(body, channels) == pytest.approx([each / max(made) for each in made], rel=1e-3)


def test_with_a_wheel_at_no_spin_a_pair_closes_that_stands_still_in_space() -> None:
    """None was found from 3 deg on; -M2 for 1.1492 s and +M2 for 1.1478 s leave 0.002 deg."""
    body = load_spacecraft(case("two-pulse-despun.yaml"))
    for omega3 in (0.0, 0.003, -0.003):
        plan = feasible_by("two-pulse", replace(body, omega0=np.array([*body.omega0[:2], omega3])))
        assert [pulse.channel for pulse in plan.pulses] == ["-M2", "+M2"]
        assert math.degrees(left(plan).nutation) < 0.003
        assert math.degrees(left(plan).momentum_shift) < (0.02 if omega3 else 0.003)


@pytest.mark.parametrize(
    ("scheme", "count"), [("one-pulse", 2), ("two-pulse", 4), ("four-pulse", 2)]
)
def test_where_omega_stands_still_channels_take_its_components(scheme: str, count: int) -> None:
    """ν = 0 but for rounding made a period of 2 Gyr, and "would leave 90 deg"."""
    body = load_spacecraft(case("standing-gyrostat.yaml"))
    assert (body.nutation_rate, body.body_period) == (0.0, math.inf)
    for craft in (body, spinner(*SPHERE, 2.0, 5.0, 0.6, channels=cross(8.0))):
        plan, (first, second) = feasible_by(scheme, craft), craft.omega0[:2]
        assert (len(plan.pulses), left(plan).nutation < NANODEGREE) == (count, True)
        assert left(plan).momentum_shift < NANODEGREE or scheme != "two-pulse"
        assert plan.pulses.total_impulse == pytest.approx(
            craft.inertia.A * (abs(first) + abs(second)), rel=1e-3
        )


def test_on_a_sphere_channels_share_the_nutation() -> None:
    """ω stands still: ±1, ±2 together cost |cos φ| + |sin φ| times A|ω0|, and leave nothing."""

    def on_a_sphere(phase: float, channels: tuple[Channel, ...], **expected: Any) -> planning.Plan:
        spacecraft = spinner(*SPHERE, 2.0, 5.0, phase, channels=channels)
        plan = feasible_by("four-pulse", spacecraft)
        outcome = math.atan(rate_after(plan) / 2.0)
        assert outcome == pytest.approx(
            math.atan(expected.get("left", 0.0) / 2.0), rel=1e-12, abs=NANODEGREE
        )
        assert Outcome(spacecraft, plan.pulses).nutation == pytest.approx(outcome, abs=NANODEGREE)
        return plan

    for phase in (0.0, 0.3, 0.25 * math.pi, 2.0, -2.5):
        plan = on_a_sphere(phase, cross(8.0))
        cost = plan.pulses.total_impulse / plan.spacecraft.least_impulse
        assert cost == pytest.approx(abs(math.cos(phase)) + abs(math.sin(phase)), rel=1e-12)
    # The two next to the opposite of ω are the cheapest: at 171° and 223°, on either side of 220°.
    assert {pulse.channel for pulse in on_a_sphere(0.7, fan(7, 8.0)).pulses} == {"T3", "T4"}
    assert max(one.on_time for one in on_a_sphere(0.3, cross(8.0, max_on_time=0.25)).pulses) <= 0.25
    # One channel alone takes out the component along it.
    on_a_sphere(
        math.pi - 0.4,
        cross(8.0)[:1],
        left=math.sin(0.4) * spinner(*SPHERE, 2.0, 5.0).transverse_rate,
    )


def test_what_a_tick_leaves_does_not_make_another_thruster_dearer() -> None:
    """The dear one is on a tick and leaves nothing; the cheap one leaves some 0.1 %."""
    channels = tuple(
        channel(name, *torque, 0.0, thrust=8.0, isp=isp)
        for name, torque, isp in (("dear", (8.0, 0.0), 100.0), ("cheap", (0.0, 8.0), 220.0))
    )
    body = spinner(channels=channels, limits=Limits(horizon=60.0, tick=0.01))
    assert body.inertia.a * body.spin == pytest.approx(
        1.0
    )  # rad/s: the pulse from 2 to 2.5 s has its centre at 2.25 s
    aligned = -16.0 * math.sin(0.25) / 120.0 * cmath.exp(2.25j)
    body = replace(body, omega0=np.array([aligned.real, aligned.imag, 3.0]))
    alone = planning.plan(replace(body, channels=channels[:1]), "one-pulse").pulses
    assert [pulse.loaded for pulse in alone] == [pytest.approx((2.0, 0.5))]
    (pulse,) = planning.plan(body, "one-pulse").pulses
    assert pulse.channel == "cheap"


# --- bodies that are not as the schemes' model has them: unequal moments, disturbances,
# dissipation, nearly spheres

EXAMPLE = read_spacecraft(example_text(), "example.yaml")
DISTURBED = Options(with_disturbances=True)
NEARLY_NOTHING = math.radians(1e-7)


def body(*moments: float, steerable: bool = False) -> Spacecraft:
    changed = replace(EXAMPLE, inertia=Inertia((moments[0], moments[1], moments[2])))
    return (
        replace(changed, channels=(), steerable=Steerable(20.0, 220.0, 1.0))
        if steerable
        else changed
    )


def under(*disturbances: Disturbance) -> Spacecraft:
    return replace(EXAMPLE, disturbances=disturbances)


def left_by(spacecraft: Spacecraft, scheme: str, options: Options | None = None) -> float:
    return left(planning.plan(spacecraft, scheme, options)).nutation


def test_the_model_turns_at_the_true_nutation_rate() -> None:
    """0.775 rad/s for 120, 100, 80 kg m² and 3 rad/s, which the mean (0.818) misses."""
    spacecraft = replace(body(120.0, 100.0, 80.0), omega0=np.array([0.1, 0.05, 3.0]))
    assert model_of(spacecraft).symmetric.inertia.a * 3.0 == pytest.approx(0.775, abs=5e-4)
    assert spacecraft.inertia.a * 3.0 == pytest.approx(0.818, abs=5e-4)
    assert model_of(EXAMPLE).symmetric is EXAMPLE
    assert model_of(EXAMPLE).exact


@spread(
    "moments", [(123.0, 117.0, 80.0), (80.0, 84.0, 120.0), (120.0, 100.0, 80.0)], quick=1, deep=2
)
@pytest.mark.parametrize("scheme", ["one-pulse", "two-pulse"])
def test_unequal_moments_are_trimmed_away(moments: tuple[float, ...], scheme: str) -> None:
    for steerable in (False, True):
        residual = left(planning.plan(body(*moments, steerable=steerable), scheme))
        assert residual.nutation < NEARLY_NOTHING
        assert residual.momentum_shift < NEARLY_NOTHING or scheme == "one-pulse"


@pytest.mark.parametrize("moments", [(120.0, 120.0, 80.0), (80.0, 80.0, 120.0)])
def test_dissipation_is_planned_for(moments: tuple[float, ...]) -> None:
    for scheme in ("one-pulse", "two-pulse"):
        damping = replace(body(*moments, steerable=True), dissipation=120.0)
        assert left_by(damping, scheme) < NEARLY_NOTHING
    for scheme in ("two-pulse", "half-cone"):  # a target on the spin axis takes one impulse
        facing = planning.plan(
            aimed(replace(spinner(steerable=Steerable()), dissipation=1000.0), 5.0, 0.0), scheme
        )
        assert len(facing.pulses) == 1
        assert max(left(facing).nutation, left(facing).axis_error) < 1e-12
    growing = planning.plan(
        replace(EXAMPLE, dissipation=60.0), "one-pulse"
    )  # a train fires once more
    assert len(growing.pulses) > len(planning.plan(EXAMPLE, "one-pulse").pulses)
    assert left(growing).nutation < NEARLY_NOTHING


@spread(
    "disturbance",
    [
        Disturbance(0.3 + 0.1j),
        Disturbance(0.2j, rate=-EXAMPLE.spin),
        Disturbance(0.05 + 0j, rate=2.0),
    ],
    deep=2,
    ids=["constant", "space-fixed", "turning"],
)
def test_with_disturbances_only_their_steady_tilt_is_left(disturbance: Disturbance) -> None:
    spacecraft = under(disturbance)
    tilt = (
        spacecraft.inertia.A
        * abs(steady_omega(spacecraft, 0.0))
        / (spacecraft.inertia.C * spacecraft.spin)
    )
    for scheme in CLASSIC:
        made, nominal = (
            planning.plan(spacecraft, scheme, DISTURBED),
            planning.plan(spacecraft, scheme),
        )
        assert left(made).nutation == pytest.approx(math.atan(tilt), rel=2e-3, abs=1e-9)
        assert "remains-steady-tilt" in codes(plan_notes(made))
        # Plans stay nominal unless disturbances are asked for.
        assert [pulse.t for pulse in nominal.pulses] == [
            pulse.t for pulse in planning.plan(EXAMPLE, scheme).pulses
        ]
        assert "remains-unplanned" in codes(plan_notes(nominal))


def test_an_axial_or_a_resonant_disturbance_is_fought() -> None:
    """The latter has no steady tilt."""
    axial = under(Disturbance(0j, axial=0.05))
    resonant = under(Disturbance(0.1 + 0j, rate=-EXAMPLE.inertia.a * EXAMPLE.spin))
    assert steady_omega(resonant, 0.0) == 0.0
    for scheme in CLASSIC:
        assert left_by(axial, scheme, DISTURBED) < NEARLY_NOTHING
        assert left_by(axial, scheme) > 100 * NEARLY_NOTHING
    for scheme in ("one-pulse", "two-pulse"):
        assert left_by(resonant, scheme, DISTURBED) < NEARLY_NOTHING
        assert left_by(resonant, scheme) > math.radians(0.02)


def test_steady_omega_is_the_forced_term_where_the_disturbance_beats_within_the_horizon() -> None:
    spacecraft = under(Disturbance(0.3 + 0.1j, rate=2.0))
    times = np.linspace(0.0, 5.0, 7)
    shape = spacecraft.inertia
    start = steady_omega(spacecraft, 0.0)
    torque = np.array([0.3 + 0.1j]), np.array([2.0])
    moved = driven.rotating_torques(
        times, start, shape.nutation_rate(spacecraft.spin), shape.A, *torque
    )
    assert moved == pytest.approx(
        np.array([steady_omega(spacecraft, time) for time in times]), rel=1e-12
    )
    for beats, settles in ((0.9, False), (1.1, True)):
        rate = 2.0 * math.pi * beats / EXAMPLE.horizon - EXAMPLE.inertia.a * EXAMPLE.spin
        assert (steady_omega(under(Disturbance(0.1 + 0j, rate=rate)), 0.0) != 0.0) is settles


@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_a_walk_goes_on_while_the_spin_drifts(spin: float) -> None:
    """Half a second at 12 s; 2 N m about axis 3: the spin by a quarter, the phase by 3.75 rad."""
    axial = np.array([0.0, 0.0, 2.0])
    jet = channel("T", 8.0, 3.0, 0.0)
    drifting = replace(
        spinner(spin=spin, channels=(jet,)), disturbances=(Disturbance(0j, axial=2.0),)
    )
    builder = ImpulseBuilder(drifting)
    pulse = channel_pulse(jet, 12.0, 0.5)

    def flown(end: float) -> complex:
        pushes = [
            reference.Push(0.0, 30.0, axial),
            reference.Push(pulse.start, pulse.end, jet.torque),
        ]
        return transverse(
            reference.fly(drifting.inertia.moments, drifting.omega0, pushes, end).rates
        )

    assert builder.omega_at(10.0) == pytest.approx(flown(10.0), rel=1e-10)
    builder.fire(pulse)
    for time in (pulse.end, 30.0):
        assert builder.omega_at(time) == pytest.approx(flown(time), rel=1e-10)
    assert builder.spin == pytest.approx(spin + 2.0 / drifting.inertia.C * 12.0, rel=1e-14)


def test_within_rounding_of_a_sphere_plan_and_check_agree_that_it_is_one() -> None:
    """Whatever moment is the odd one."""
    text = case("near-sphere-2.yaml").read_text()
    off = 3e-8
    line = next(one for one in text.splitlines() if one.startswith("inertia"))
    for odd in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 2, 1)):
        rows = np.diag([100.0 + off * one for one in odd]).tolist()
        sphere = read_spacecraft(text.replace(line, f"inertia: {{tensor: {rows}}}"), "near.yaml")
        assert (sphere.inertia.a, sphere.inertia.symmetric, sphere.inertia.shape) == (
            0.0,
            True,
            "sphere",
        )
        assert math.isinf(sphere.body_period)
        assert checked_json("near.yaml", sphere)["spin_axis"]["class"] == "sphere"
        for scheme in CLASSIC:
            assert left_by(sphere, scheme) < 1e-9
    assert left_by(load_spacecraft(case("near-sphere-1.yaml")), "two-pulse") < 1e-9


@spread("scheme", [*CLASSIC, "half-cone", "rhumb-line"], quick=1)
@spread("off", [1e-15, 0.9e-9, 1.1e-9, 1e-12, 1e-8], quick=3)
def test_on_either_side_of_the_tolerance_every_scheme_answers(off: float, scheme: str) -> None:
    """The sphere within it; beyond it a body whose nutation takes years to turn in the body."""
    for first, second, third in ((1 + off, 1, 1), (1, 1 + 2 * off, 1 + off), (1, 1, 1 - off)):
        if off > principal_moments.DEGENERATE and first != second:
            continue  # no spin about an axis of the middle moment
        moments = 100.0 * first, 100.0 * second, 100.0 * third
        assert (Inertia(moments).a == 0.0) == (off <= principal_moments.DEGENERATE)
        for plain in (
            spinner(moments=moments, phase=math.pi, channels=cross(8.0)),
            spinner(moments=moments, phase=0.7, channels=cross(8.0), spin=-3.0),
            spinner(moments=moments, degrees=60.0, steerable=Steerable(20.0)),
        ):
            for spacecraft in (plain, aimed(plain, 10.0, 30.0)):
                with within(10_000_000):
                    made = planning.plan(spacecraft, scheme)
                    residual = made.flown
                assert (residual is None) == (infeasibility(made) != "")
                if residual is not None:
                    assert np.isfinite(
                        [residual.nutation, residual.momentum_shift, residual.axis_error]
                    ).all()


def jets(torque: float, count: int = 4, longest: float = math.inf) -> tuple[Channel, ...]:
    """+1, -1, +2, -2, or the first of these."""
    along = [(torque, 0.0), (-torque, 0.0), (0.0, torque), (0.0, -torque)]
    return tuple(
        channel(f"M{n}", *one, 0.0, max_on_time=longest) for n, one in enumerate(along[:count])
    )


def random_body(seed: int) -> Spacecraft:
    """Prolate or oblate, 1 to 50 degrees, one to four channels, τ of 1 to 1000 inertial periods."""
    draw = np.random.default_rng(seed)
    C = 100.0 * (draw.uniform(0.2, 0.85) if draw.random() < 0.5 else draw.uniform(1.15, 1.95))
    spin = draw.choice([-1.0, 1.0]) * draw.uniform(0.5, 5.0)
    degrees = float(draw.choice([1.0, 3.0, 10.0, 30.0, 50.0]))
    size = C * abs(spin) * math.tan(math.radians(degrees)) * draw.uniform(0.5, 2.0) * abs(spin)
    channels = jets(size, int(draw.integers(1, 5)))
    body = spinner(
        A=100.0, C=C, spin=spin, degrees=degrees, phase=draw.uniform(0.0, 6.28), channels=channels
    )
    return replace(body, dissipation=body.inertial_period * 10.0 ** draw.uniform(0.0, 3.0))


@pytest.mark.parametrize(
    "scheme", ["one-pulse", deep("four-pulse"), weekly("two-pulse"), weekly("optimal")]
)
def test_random_bodies_are_damped_and_the_flight_is_true(scheme: str) -> None:
    damped = 0
    for seed in range(8):
        one = planning.plan(random_body(seed), scheme)
        if one.flown is None:
            continue
        ended = Outcome(one.spacecraft, one.pulses)
        assert (one.flown.nutation, one.flown.momentum_shift) == pytest.approx(
            (ended.nutation, ended.shift), abs=1e-9
        )
        # What the impulse sum misses of a width is of the order of what dissipation does within one
        # turn.
        slow = abs(one.spacecraft.growth) * one.spacecraft.inertial_period
        assert present(one.residual).nutation == pytest.approx(
            ended.nutation, abs=0.03 * slow * one.spacecraft.nutation
        )
        damped += one.flown.nutation < NEARLY_NOTHING
    assert damped >= 7


@pytest.mark.parametrize("C", [40.0, 80.0, 150.0])
@pytest.mark.parametrize("spin", [2.0, -2.0])
def test_a_walk_coasts_as_the_flight_does(C: float, spin: float) -> None:
    body = replace(spinner(100.0, C, spin, degrees=50.0), dissipation=12.0)
    times = np.linspace(0.0, 40.0, 9)
    rates, _ = propagation.flown(body, Schedule(), 40.0).motion(times)
    omegas = [ImpulseBuilder(body).omega_at(float(time)) for time in times]
    assert omegas == pytest.approx(rates[:, 0] + 1j * rates[:, 1], abs=1e-12)


def test_alignments_are_found_while_the_spin_falls_and_none_in_flat_spin() -> None:
    """At 50 degrees, τ = 12 s, the turns of ω in the body get longer and then there are none."""
    (jet,), moments = jets(5.0, 1), list[float]()
    for earliest in np.arange(0.0, 60.0, 2.0):
        limits = Limits(horizon=1e5, earliest=float(earliest))
        body = replace(
            spinner(100.0, 40.0, 3.0, 50.0, channels=(jet,), limits=limits), dissipation=12.0
        )
        builder = ImpulseBuilder(body)
        pulse = builder.align(jet, 0.01)
        if pulse is None:
            break
        assert abs(cmath.phase(-builder.omega_at(pulse.t) * builder.acts(pulse).conjugate())) < 1e-9
        assert pulse.start >= earliest
        moments.append(pulse.t)
    waits = np.diff(np.unique(np.round(moments, 6)))
    assert 3 < len(moments) < 30
    assert waits[-1] > 1.5 * waits[0]


@pytest.mark.deep
@pytest.mark.parametrize(("A", "C"), [(80.0, 120.0), (120.0, 80.0)], ids=["oblate", "prolate"])
def test_the_first_order_least_knows_dissipation(A: float, C: float) -> None:
    """Small angles: with κ the optimum waits (oblate) or hurries (prolate), as the program says."""
    body = spinner(A, C, degrees=0.5, channels=jets(5.0, longest=0.5), limits=Limits(horizon=60.0))
    one = planning.plan(replace(body, dissipation=100.0), "optimal")
    bounds = present(one.pulses.bounds)
    assert bounds.first_order is not None
    assert bounds.rigorous is None
    assert one.pulses.total_impulse == pytest.approx(bounds.first_order, rel=0.01)
    assert (bounds.first_order < 0.6 * body.least_impulse) == (A < C)
    assert Outcome(one.spacecraft, one.pulses).nutation < 1e-9


@spread(
    ("name", "options", "status", "said"),
    [
        (
            "crash-hang-near-sphere-dissipation",
            (),
            3,
            r"no pair of the channels.*? damps it",
        ),
        ("crash-dissipation-near-sphere-overflow", (), 3, ""),
        ("crash-halfcone-trim-crash", (), 0, ""),
        ("crash-target-ideal-torquer-dissipation", ("--target", "5deg,0deg"), 0, ""),
        ("crash-dissipation-short", (), 0, r"the nutation grows.*? rough"),
    ],
    quick=2,
)
def test_files_that_went_wrong(
    run: Run, name: str, options: tuple[str, ...], status: int, said: str
) -> None:
    """Near a sphere ω takes days to turn in the body, and dissipation minutes to take it out."""
    done = run("plan", "-v", str(case(f"{name}.yaml")), *options)
    assert done.returncode == status, done.stderr
    assert "Traceback" not in done.stderr
    assert "nan" not in done.stdout.split()
    sentence = present(re.search(said, " ".join(done.stdout.split())))
    if said:
        check_text(f"dissipation.{name.removeprefix('crash-')}", sentence.group())
