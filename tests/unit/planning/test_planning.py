"""Plans judged: limits, requirement, figures against the reference integrator, and which one is recommended."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import simpson
from support import reference
from support.builders import channel, cross, events, judged, spinner
from support.cases import spread

from nutdamp import schemes
from nutdamp.actuators import STANDARD_GRAVITY
from nutdamp.comparison import compare
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.flight import by_impulses
from nutdamp.limits import Limit, Windows, breaches, keeps_limits
from nutdamp.outcome import seen_at
from nutdamp.planning import Plan, plan
from nutdamp.presentation import verdicts
from nutdamp.recommendation import Ground, Standing
from nutdamp.remarks import broken_limits, infeasibility, remarks
from nutdamp.schedule import Bounds, Schedule, channel_pulse
from nutdamp.schemes.options import OptimalOptions
from nutdamp.spacecraft import Channel, Limits, Requirement, Spacecraft, Steerable, Vector

CLASSIC = schemes.CLASSIC
HALF_A_DEGREE = Requirement(nutation=math.radians(0.5))
BOTH = Requirement(nutation=math.radians(0.5), momentum_shift=math.radians(0.2))

# --- the rule of the recommendation: the rule itself is tested in test_recommendation ---------------------------------


def test_compare_keeps_the_order_given_and_recommends_one_of_them() -> None:
    compared = compare(spinner(channels=cross(20.0), requirement=BOTH), CLASSIC)
    assert [one.scheme for one in compared.plans] == list(CLASSIC)
    # one-pulse and four-pulse move H by degrees: only two-pulse meets the shift required.
    assert [one.meets_requirement for one in compared.plans] == [False, True, False]
    assert compared.recommended is compared.plans[1]
    assert compared.recommendation.standing is Standing.COMPLIES
    assert compared.recommendation.ground is Ground.ONLY


# --- requirement -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("nutation", "shift", "meets"), [(0.5, 0.2, True), (0.51, 0.0, False), (0.0, 0.21, False), (0.51, 0.21, False)]
)
def test_requirement_is_met_where_every_part_is(nutation: float, shift: float, meets: bool) -> None:
    exact = math.radians(nutation) == BOTH.nutation and math.radians(shift) == BOTH.momentum_shift
    assert judged("a", nutation, shift=shift, required=BOTH).meets_requirement is meets
    assert exact == meets  # the bounds themselves are met


@pytest.mark.parametrize("required", [None, Requirement()])
def test_without_a_requirement_none_is_met_or_missed(required: Requirement | None) -> None:
    assert judged("a", 0.1, required=required).meets_requirement is None


def test_requirement_of_one_part_asks_nothing_of_the_other() -> None:
    assert judged("a", 0.1, shift=90.0, required=HALF_A_DEGREE).meets_requirement is True
    drift_only = Requirement(momentum_shift=math.radians(0.2))
    assert judged("a", 80.0, shift=0.1, required=drift_only).meets_requirement is True


def test_requirement_goes_by_the_flown_motion() -> None:
    """The printed two pulses leave no nutation, but 5.1° of shift."""
    made = plan(spinner(degrees=30.0, requirement=BOTH), "two-pulse", schemes.Options(literal=True))
    assert made.meets_requirement is False


# --- infeasible, and nothing to do -----------------------------------------------------------------------------------


def test_infeasible_plan_has_nulls_and_says_why() -> None:
    none = plan(spinner(mass=100.0, requirement=BOTH), "four-pulse")
    assert not none.feasible
    assert infeasibility(none)
    assert len(none.pulses) == 0
    figures = (none.residual, none.flown, none.spin_change, none.delta_v, none.meets_requirement)
    assert figures == (None,) * 5


@pytest.mark.parametrize("scheme", schemes.NAMES)
@pytest.mark.parametrize("degrees", [0.0, 1e-11])
def test_without_nutation_there_is_an_empty_schedule(scheme: str, degrees: float) -> None:
    done = plan(spinner(degrees=degrees, channels=cross(20.0), requirement=BOTH), scheme)
    assert done.feasible
    assert len(done.pulses) == 0
    assert done.meets_requirement is True
    assert done.pulses.total_impulse == 0.0


def test_a_plan_without_pulses_keeps_its_remarks() -> None:
    assert remarks(plan(spinner(degrees=0.0), "two-pulse")) == ("there is no nutation to damp",)


def test_remarks_tell_no_rounding() -> None:
    """With I1 ≠ I2 the trimmed pulses leave nothing: 1e-14 degrees are not worth a number."""
    body = spinner(channels=cross(8.0))
    first, second, third = body.inertia.moments
    uneven = replace(body, inertia=replace(body.inertia, moments=(1.01 * first, second, third)))
    (reported,) = [text for text in remarks(plan(uneven, "one-pulse")) if "I1 ≠ I2" in text]
    assert ": less than 1e-9° of nutation, " in reported


def test_a_cost_below_the_first_order_bound_says_why_that_can_be() -> None:
    body = spinner(channels=cross(8.0))
    cost = plan(body, "one-pulse").pulses.total_impulse
    for bound, said in (
        (1.01 * cost, "% more: that holds for small angles"),
        (cost, "(gap 0 %)"),
        (0.5 * cost, "gap 1"),
    ):
        made = replace(plan(body, "one-pulse").pulses, bounds=Bounds(bound, 0.1 * cost, "N m s", 60.0))
        assert any(said in text for text in remarks(Plan(body, "one-pulse", made)))


def test_none_is_free_motion() -> None:
    free = plan(spinner(degrees=5.0), "none")
    assert free.feasible
    assert len(free.pulses) == 0
    assert free.flown is not None
    assert math.degrees(free.flown.nutation) == pytest.approx(5.0, rel=1e-14)


def test_a_scheme_of_another_name_is_a_key_error() -> None:
    with pytest.raises(KeyError):
        plan(spinner(), "five-pulse")


def test_a_plan_that_would_not_lower_the_nutation_is_infeasible() -> None:
    """A single pulse for a needle whose axial torque reverses its spin."""
    body = spinner(100.0, 4.0, 0.5, 40.0, channels=(channel("skew", 10.0, 0.0, -9.0),))
    made = plan(body, "one-pulse")
    assert made.feasible or "would leave" in infeasibility(made)
    assert made.flown is None or made.flown.nutation < body.nutation


WEAK = (channel("A1", 0.0, -0.5, 0.0, min_on_time=0.01), channel("A2", 0.0, 0.5, 0.0, min_on_time=0.01))

SELF_DAMPING = replace(
    spinner(100.0, 150.0, math.tau / 6.0, 3.0, channels=WEAK),
    dissipation=20.0,
    requirement=Requirement(nutation=math.radians(0.05)),
)
"""Oblate: its nutation decays e-fold in 20 s."""


def idle(body: Spacecraft, t: float) -> float:
    """Nutation, rad, of a flight without pulses."""
    return seen_at(by_impulses(body, Schedule(), t), t).final.nutation


def test_a_plan_that_leaves_more_than_decay_alone_by_its_end_is_infeasible_and_says_so() -> None:
    body = SELF_DAMPING
    compared = compare(body, ("two-pulse",))
    (made,) = compared.plans
    assert made.worse is not None
    assert made.worse < 0.01 * body.nutation  # it does damp
    assert idle(body, made.worse_at) < made.worse
    said = infeasibility(made)
    assert said.startswith("the best schedule found would leave ")
    alone = float(said.partition("it decays to ")[2].partition("°")[0])
    assert math.degrees(idle(body, made.worse_at)) == pytest.approx(alone, rel=0.05)
    assert verdicts.reason(compared).endswith("; without a pulse the requirement is met from 81.91 s on")
    assert math.degrees(idle(body, 81.91)) == pytest.approx(0.05, rel=1e-3)


@given(
    st.floats(5.0, 100.0), st.floats(1e-3, 0.5), st.floats(0.5, 20.0), st.sampled_from(CLASSIC), st.floats(0.0, 60.0)
)
def test_plans_for_a_body_that_damps_itself_leave_less_than_decay_does(
    time_constant: float, least: float, degrees: float, scheme: str, earliest: float
) -> None:
    channels = (channel("A1", 0.0, -0.5, 0.0, min_on_time=least), channel("A2", 0.0, 0.5, 0.0, min_on_time=least))
    limits = Limits(earliest=earliest, horizon=240.0)
    body = spinner(100.0, 150.0, math.tau / 6.0, degrees, channels=channels, limits=limits)
    body = replace(body, dissipation=time_constant)
    made = plan(body, scheme)
    if made.flown is not None:
        assert made.flown.nutation < idle(body, made.end)


def test_an_earliest_time_beyond_the_horizon_is_named() -> None:
    made = plan(replace(SELF_DAMPING, limits=Limits(earliest=300.0)), "one-pulse")  # the default horizon is 240 s
    assert infeasibility(made) == "limits.earliest, or the pulses before, leave no time within limits.horizon"


def test_too_few_pulses_for_the_least_impulse_are_named_with_how_many_it_takes() -> None:
    body = spinner(channels=cross(2.0, max_on_time=0.5), limits=Limits(horizon=120.0, max_pulses=3))
    enough = math.ceil(body.least_impulse / 1.0)
    said = infeasibility(plan(body, "optimal"))
    assert said.startswith("limits.max_pulses = 3 is too few: so many pulses give at most 3 N m s, and taking out ")
    assert said.endswith(f"takes {body.least_impulse:.4g} N m s, {enough} pulses or more")
    more = replace(body, limits=replace(body.limits, max_pulses=2 * enough))
    assert plan(more, "optimal").feasible


THREE_MOMENTS = """
name: three moments
inertia: {tensor: [[100, 3, 1], [3, 80, -2], [1, -2, 45]]}
omega0: [0.1, -0.15, 2.5]
thrusters:
  - {name: A1, position: [0, 0.5, 0.8], direction: [1, 0, 0.1], force: 12 N, isp: 220 s, max_on_time: 1 s}
  - {name: A2, position: [0.5, 0, 0.8], direction: [0, -1, 0.2], force: 12 N, isp: 220 s, max_on_time: 1 s}
requirement: {nutation: 0.3 deg, momentum_shift: 2 deg}
limits: {horizon: 120 s, tick: 1 ms, max_pulses: 6}
"""


@spread("horizon", [120.0, 90.0, 150.0], quick=1)
def test_a_longer_horizon_has_a_schedule_too_and_no_dearer_one(horizon: float) -> None:
    """Within 90 s the search itself found one of 16.9 g, within 120 s none; one of 15.5 g ends at 64 s."""
    body = read_spacecraft(THREE_MOMENTS, "f.yaml", ())
    made = plan(replace(body, limits=replace(body.limits, horizon=horizon)), "optimal")
    assert made.meets_requirement
    assert made.pulses.cost_in("kg") < 0.016


def test_optimal_looks_within_the_time_that_there_is_where_it_begins_late() -> None:
    """Half the horizon ends before the first pulse may begin."""
    made = plan(replace(SELF_DAMPING, limits=Limits(earliest=130.0, horizon=240.0)), "optimal")
    assert made.feasible, infeasibility(made)
    assert made.pulses.pulses[0].start >= 130.0


@pytest.mark.parametrize(
    ("channels", "horizon", "freed"),
    [
        (cross(2.0), 2.0, False),
        (cross(2.0), 6.0, False),
        (cross(2.0)[:1], 2.0, False),
        (cross(15.0)[:2], 2.0, False),
        (cross(15.0), 1.4, False),
        (cross(15.0), 1.6, True),
    ],
)
def test_the_horizon_that_is_named_as_long_enough_is(
    channels: tuple[Channel, ...], horizon: float, freed: bool
) -> None:
    body = spinner(channels=channels, limits=Limits(horizon=horizon))
    short = plan(body, "optimal")
    said = infeasibility(short)
    named = said.partition("; limits.horizon = ")[2].partition(" s is long enough")[0]
    enough = replace(body, limits=Limits(horizon=float(named)))
    assert plan(enough, "optimal").feasible, said
    assert ("or use --free-axis" in said) is freed
    assert plan(body, "optimal", OptimalOptions(free_axis=True)).feasible is freed


# --- limits ----------------------------------------------------------------------------------------------------------

TIGHT = Limits(horizon=20.0, earliest=1.0, gap=0.5, max_pulses=3, blackout=((6.0, 7.0),))


def fired(*times: tuple[float, float]) -> Schedule:
    """Pulses of +1 by centre and on-time."""
    return Schedule(tuple(channel_pulse(cross(20.0)[0], t, on_time) for t, on_time in times))


@pytest.mark.parametrize(
    ("pulses", "complaint"),
    [
        ([(1.5, 1.0), (2.75, 0.5), (5.5, 1.0)], None),
        ([(1.4, 1.0)], "starts before 1 s"),
        ([(19.6, 1.0)], "ends after the horizon of 20 s"),
        ([(2.0, 1.0), (3.2, 1.0)], "less than 0.5 s after the one before"),
        ([(6.5, 0.2)], "blackout window 6 s to 7 s"),
        ([(5.8, 0.6)], "blackout window 6 s to 7 s"),
        ([(2.0, 0.1)], "is on for 0.1 s, less than the shortest on-time of 0.2 s"),
        ([(4.0, 3.0)], "is on for 3 s, more than the longest on-time of 2 s"),
        ([(2.0, 0.5), (4.0, 0.5), (8.0, 0.5), (10.0, 0.5)], "4 pulses are more than 3"),
    ],
)
def test_broken_limits_are_named(pulses: list[tuple[float, float]], complaint: str | None) -> None:
    body = spinner(channels=cross(20.0, min_on_time=0.2, max_on_time=2.0), limits=TIGHT)
    broken = broken_limits(body, fired(*pulses))
    if complaint is None:
        assert broken == []
    else:
        assert len(broken) == 1
        assert complaint in broken[0]


def test_every_broken_limit_is_named() -> None:
    body = spinner(channels=cross(20.0, min_on_time=0.2, max_on_time=2.0), limits=TIGHT)
    assert broken_limits(body, fired((0.5, 0.1), (0.8, 0.5), (6.5, 0.2), (25.0, 9.0))) == [
        "pulse 1 (+1, 0.45 s to 0.55 s) starts before 1 s; likewise 1 more pulse",
        "pulse 1 (+1, 0.45 s to 0.55 s) is on for 0.1 s, less than the shortest on-time of 0.2 s",
        "pulse 2 (+1, 0.55 s to 1.05 s) comes less than 0.5 s after the one before",
        "pulse 3 (+1, 6.4 s to 6.6 s) lies in the blackout window 6 s to 7 s",
        "pulse 4 (+1, 20.5 s to 29.5 s) ends after the horizon of 20 s",
        "pulse 4 (+1, 20.5 s to 29.5 s) is on for 9 s, more than the longest on-time of 2 s",
        "4 pulses are more than 3",
    ]


def test_breaches_say_which_limit_which_pulse_and_by_how_much() -> None:
    limits = replace(TIGHT, tick=0.05)
    body = spinner(channels=cross(20.0, min_on_time=0.2, max_on_time=2.0), limits=limits)
    made = fired((0.5, 0.1), (6.5, 0.2), (6.98, 0.3), (25.0, 9.0))
    found = [(one.limit, one.number, one.bound, round(one.by, 9)) for one in breaches(body, made)]
    assert found == [
        (Limit.EARLIEST, 1, 1.0, 0.55),
        (Limit.MIN_ON_TIME, 1, 0.2, 0.1),
        (Limit.BLACKOUT, 2, 6.0, 0.6),
        (Limit.GAP, 3, 0.5, 0.27),
        (Limit.START_TICK, 3, 0.05, 0.02),
        (Limit.BLACKOUT, 3, 6.0, 0.17),
        (Limit.HORIZON, 4, 20.0, 9.5),
        (Limit.MAX_ON_TIME, 4, 2.0, 7.0),
        (Limit.MAX_PULSES, 4, 3.0, 1.0),
    ]


@pytest.mark.parametrize(
    ("limits", "pulses"),
    [
        (Limits(horizon=20.0), [(4.0, 0.1)]),
        (Limits(horizon=20.0), [(4.0, 3.0)]),
        (Limits(horizon=20.0, tick=0.3), [(4.0, 0.5)]),
        (Limits(horizon=20.0, max_pulses=1), [(4.0, 0.5), (6.0, 0.5)]),
        (Limits(horizon=1e17), [(1e16, 0.5)]),
        (Limits(horizon=20.0, gap=0.5), [(4.0, 2.0), (4.1, 0.2), (5.2, 0.3)]),
    ],
)
def test_schemes_and_judge_go_by_the_same_limits(limits: Limits, pulses: list[tuple[float, float]]) -> None:
    """What the judge would refuse no scheme may take for good: on-times, ticks, their number, and overlaps."""
    body = spinner(channels=cross(20.0, min_on_time=0.2, max_on_time=2.0), limits=limits)
    assert broken_limits(body, fired(*pulses))
    assert not keeps_limits(body, fired(*pulses))


@given(st.integers(0, 40), st.sampled_from([-4.0, -2.0, -0.5, 0.0, 0.5, 2.0, 4.0]), st.integers(0, 3))
def test_one_slack_for_windows_and_breaches(exponent: int, off: float, which: int) -> None:
    """A pulse that `Windows` allows breaks nothing, however late: both let times err by their resolution."""
    late = 2.0**exponent
    limits = Limits(horizon=4.0 * late, earliest=late, gap=0.5, blackout=((2.0 * late, 3.0 * late),))
    body = spinner(channels=cross(20.0), limits=limits)
    pulse = fired((0.0, 2.0**-10 * late)).pulses[0]
    edge = (late, 2.0 * late - pulse.on_time, 3.0 * late, 4.0 * late - pulse.on_time)[which]
    pulse = replace(pulse, t=edge + off * max(1e-9, math.ulp(edge)) + 0.5 * pulse.on_time)
    windows = Windows(body)
    allowed = windows.allows(pulse.start, pulse.on_time, late)
    assert keeps_limits(body, (pulse,)) == allowed
    assert windows.allowed(np.array([pulse.start]), np.array([pulse.on_time]), late).tolist() == [allowed]


def test_a_limit_that_many_pulses_break_is_named_once() -> None:
    body = spinner(channels=cross(20.0), limits=Limits(horizon=20.0))
    found = broken_limits(body, fired(*((21.0 + number, 0.5) for number in range(222))))
    assert found == ["pulse 1 (+1, 20.75 s to 21.25 s) ends after the horizon of 20 s; likewise 221 more pulses"]


# --- figures of a plan -----------------------------------------------------------------------------------------------


def flown_force(body: Spacecraft, made: Schedule) -> Vector:
    """∫ R(t) F dt over all pulses by Simpson's rule on the reference motion."""
    moments = body.inertia.moments
    rotation = reference.frame_n(moments, body.omega0)
    gained = np.zeros(3)
    for pulse in made:
        assert pulse.force is not None
        start = reference.fly(moments, body.omega0, events(made), pulse.start, rotation)
        times = np.linspace(0.0, pulse.on_time, 8001)
        assert pulse.torque is not None
        motions = [start, *reference.coast(moments, start, pulse.torque, times[1:])]
        gained += simpson(np.array([motion.rotation @ pulse.force for motion in motions]), x=times, axis=0)
    return gained


def jet(name: str, position: tuple[float, float, float], force: tuple[float, float, float]) -> Channel:
    torque = np.cross(position, force)
    return channel(name, *torque, isp=220.0, thrust=float(np.linalg.norm(force)), force=force)


JETS = (
    jet("T1", (0.0, 0.5, 0.8), (0.0, 10.0, 1.0)),
    jet("T2", (0.5, 0.0, 0.8), (8.0, 2.0, 0.0)),
    jet("T3", (0.0, -0.5, 0.8), (0.0, -10.0, -3.0)),
)


@spread("scheme", CLASSIC, quick=1)
@spread("spin", [3.0, -3.0], quick=2)
def test_delta_v_is_the_force_turned_into_the_inertial_frame_over_the_mass(scheme: str, spin: float) -> None:
    made = plan(spinner(spin=spin, channels=JETS, mass=250.0), scheme)
    assert made.feasible, infeasibility(made)
    expected = flown_force(made.spacecraft, made.pulses) / 250.0
    assert made.delta_v is not None
    assert made.delta_v == pytest.approx(expected, abs=1e-10 * float(np.linalg.norm(expected)))


def test_delta_v_of_a_pulse_that_spins_the_body_up() -> None:
    """Stretches are cut by how fast the body turns at either end of the pulse, not as it begins."""
    body = spinner(2.0, 1.0, 0.1, 5.0, mass=10.0)
    spinning_up = channel("up", 0.0, 1.2, 1.0, force=(1.0, 0.0, 0.5), thrust=1.0)
    made = Plan(body, "by hand", Schedule((channel_pulse(spinning_up, 5.0, 10.0),)))
    expected = flown_force(body, made.pulses) / 10.0
    assert made.delta_v is not None
    assert made.delta_v == pytest.approx(expected, abs=1e-9 * float(np.linalg.norm(expected)))


def test_delta_v_of_couples_is_nothing_and_of_overlapping_pulses_their_sum() -> None:
    body = spinner(mass=250.0)
    one, two = (channel_pulse(jet_, t, 1.0) for jet_, t in zip(JETS, (2.0, 2.4), strict=False))
    together = Plan(body, "by hand", Schedule((one, two))).delta_v
    assert together is not None
    rotation = reference.frame_n(body.inertia.moments, body.omega0)
    gained = np.zeros(3)
    edges = [one.start, two.start, one.end, two.end]
    for begin, end in itertools.pairwise(edges):
        start = reference.fly(body.inertia.moments, body.omega0, events((one, two)), begin, rotation)
        pushing = [pulse for pulse in (one, two) if pulse.start <= begin and end <= pulse.end]
        torque = np.sum([pulse.torque for pulse in pushing if pulse.torque is not None], axis=0)
        force = np.sum([pulse.force for pulse in pushing if pulse.force is not None], axis=0)
        times = np.linspace(0.0, end - begin, 4001)
        motions = [start, *reference.coast(body.inertia.moments, start, torque, times[1:])]
        gained += simpson(np.array([motion.rotation @ force for motion in motions]), x=times, axis=0)
    assert together == pytest.approx(gained / 250.0, abs=1e-12)
    couple = channel("couple", 0.0, 20.0, 0.0, force=(0.0, 0.0, 0.0), thrust=20.0)
    balanced = Plan(body, "by hand", Schedule((channel_pulse(couple, 2.0, 1.0),))).delta_v
    assert balanced is not None
    assert not balanced.any()


def test_delta_v_needs_mass_and_every_force() -> None:
    made = plan(spinner(channels=JETS, mass=250.0), "four-pulse")
    assert replace(made, spacecraft=replace(made.spacecraft, mass=None)).delta_v is None
    unknown = replace(made.pulses.pulses[0], force=None)
    assert replace(made, schedule=Schedule((unknown, *made.pulses.pulses[1:]))).delta_v is None


@pytest.mark.parametrize("scheme", CLASSIC)
def test_spin_change_is_that_of_the_reference_integrator(scheme: str) -> None:
    made = plan(spinner(channels=JETS), scheme)
    end = reference.fly(made.spacecraft.inertia.moments, made.spacecraft.omega0, events(made.pulses), made.pulses.end)
    assert made.spin_change == pytest.approx(end.rates[2] - 3.0, abs=1e-11)
    axial = math.fsum(pulse.impulse[2] for pulse in made.pulses)
    assert made.spin_change == pytest.approx(axial / 80.0, abs=1e-13)


@pytest.mark.parametrize("scheme", CLASSIC)
def test_propellant_is_force_times_on_time_over_isp_and_standard_gravity(scheme: str) -> None:
    made = plan(spinner(channels=JETS), scheme)
    thrust = {one.name: one.thrusters[0].thrust or 0.0 for one in JETS}
    expected = math.fsum(thrust[pulse.channel] * pulse.on_time / (220.0 * 9.80665) for pulse in made.pulses)
    assert made.pulses.propellant == pytest.approx(expected, rel=1e-14)
    assert STANDARD_GRAVITY == 9.80665


def test_propellant_of_a_channel_is_that_of_all_its_thrusters() -> None:
    both = Channel("both", tuple(one.thrusters[0] for one in JETS[:2]))
    thrust = math.hypot(10.0, 1.0) + math.hypot(8.0, 2.0)
    pulse = channel_pulse(both, 3.0, 2.0)
    assert pulse.propellant == pytest.approx(thrust * 2.0 / (220.0 * 9.80665), rel=1e-15)
    assert np.array_equal(pulse.impulse, 2.0 * (JETS[0].torque + JETS[1].torque))
    assert pulse.force is not None
    assert np.array_equal(pulse.force, [8.0, 12.0, 1.0])


def test_one_pulse_of_unknown_propellant_makes_the_sum_unknown() -> None:
    one, two = channel_pulse(JETS[0], 3.0, 1.0), channel_pulse(cross(20.0)[0], 6.0, 1.0)
    assert Schedule((one,)).propellant is not None
    assert Schedule((one, two)).propellant is None
    assert Schedule().propellant == 0.0


def test_propellant_of_a_steerable_torquer_is_by_its_lever_arm() -> None:
    torquer = Steerable(torque=20.0, isp=220.0, lever_arm=0.8)
    made = plan(spinner(steerable=torquer), "two-pulse")
    expected = made.pulses.total_impulse / 0.8 / (220.0 * 9.80665)
    assert made.pulses.propellant == pytest.approx(expected, rel=1e-14)
    assert plan(spinner(steerable=Steerable(20.0)), "two-pulse").pulses.propellant is None


def test_total_and_least_impulse() -> None:
    made = plan(spinner(degrees=5.0), "two-pulse")
    assert made.spacecraft.least_impulse == pytest.approx(80.0 * 3.0 * math.tan(math.radians(5.0)), rel=1e-15)
    assert made.pulses.total_impulse == math.fsum(float(np.linalg.norm(one.impulse)) for one in made.pulses)
    assert made.pulses.end == max(pulse.end for pulse in made.pulses)


def test_a_schedule_is_in_the_order_of_its_centres() -> None:
    late, early = channel_pulse(JETS[0], 9.0, 4.0), channel_pulse(JETS[1], 8.0, 0.5)
    made = Schedule((late, early))
    assert [pulse.t for pulse in made] == [8.0, 9.0]
    assert made.end == 11.0
    assert broken_limits(spinner(channels=JETS), made)  # they overlap
