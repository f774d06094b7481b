"""Plans judged, and why there is none; their numbers; ways round cones."""

import itertools
import math
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import simpson
from support import reference
from support.builders import (
    BOTH,
    HALF_A_DEGREE,
    aimed,
    channel,
    codes,
    cross,
    events,
    judged,
    noted,
    present,
    spinner,
)
from support.cases import deep, weekly
from support.golden import check_text

from nutdamp.files.reader import read_spacecraft
from nutdamp.flight import end_state
from nutdamp.flight.cones import Aspect
from nutdamp.flight.propagation import by_impulses
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import broken_limits, infeasibility
from nutdamp.planning.decision import compare
from nutdamp.planning.notes import plan_notes, reasons
from nutdamp.planning.plan import Plan, Worse, plan
from nutdamp.schemes import catalogue, routes, two_pulse
from nutdamp.spacecraft.constraints import Limit, Windows, breaches, keeps_limits
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Keep, Limits, Requirement, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.units import STANDARD_GRAVITY

DRIFT_ONLY = Requirement(momentum_shift=math.radians(0.2))
KEPT = catalogue.OptimalOptions(free_axis=False)
"""H ends where it was, though nothing in the file asks for it."""


def test_a_requirement_is_met_where_every_part_of_it_is_by_the_flown_motion() -> None:
    for required, nutation, shift, meets in (
        (BOTH, 0.5, 0.2, True),  # the bounds themselves are met
        (BOTH, 0.51, 0.0, False),
        (BOTH, 0.0, 0.21, False),
        (HALF_A_DEGREE, 0.1, 90.0, True),
        (DRIFT_ONLY, 80.0, 0.1, True),
        (DRIFT_ONLY, 0.0, 0.3, False),
        (None, 0.1, 0.0, None),
        (Requirement(), 0.1, 0.0, None),
    ):
        assert judged("a", nutation, shift=shift, required=required).meets_requirement is meets
    # The printed two pulses leave no nutation, but 5.1° of shift.
    made = plan(
        spinner(degrees=30.0, requirement=BOTH), "two-pulse", catalogue.Options(literal=True)
    )
    assert made.meets_requirement is False


def test_an_infeasible_plan_has_nulls_and_says_why_and_an_unknown_scheme_is_a_key_error() -> None:
    none = plan(spinner(mass=100.0, requirement=BOTH), "four-pulse")
    figures = (none.residual, none.flown, none._spin_change, none._delta_v, none.meets_requirement)
    assert (none.feasible, bool(infeasibility(none)), len(none.pulses), *figures) == (
        False,
        True,
        0,
        *[None] * 5,
    )
    with pytest.raises(KeyError):
        plan(spinner(), "five-pulse")
    with pytest.raises(KeyError):  # what a user can cure is no bug
        compare(spinner(), ("two-pulse", "five-pulse"))


def test_without_nutation_there_is_an_empty_schedule_and_none_is_free_motion() -> None:
    """Nor are 1e-14 degrees, which trimmed pulses leave with I1 ≠ I2, worth a number."""
    for scheme in catalogue.NAMES:
        for degrees in (0.0, 1e-11):
            made = plan(spinner(degrees=degrees, channels=cross(20.0), requirement=BOTH), scheme)
            assert (made.feasible, len(made.pulses), made.meets_requirement) == (True, 0, True)
        assert codes(plan_notes(made)) == ["no-nutation"]
    free = plan(spinner(degrees=5.0), "none")
    assert len(free.pulses) == 0
    assert math.degrees(present(free.flown).nutation) == pytest.approx(5.0, rel=1e-14)
    body = spinner(moments=(121.2, 120.0, 80.0), channels=cross(8.0))
    assert codes(plan_notes(plan(body, "one-pulse"))) == []


def raising(error: type[Exception]) -> Callable[..., object]:
    def broken(*_: object) -> object:
        raise error

    return broken


def test_a_scheme_with_a_bug_leaves_the_others_also_where_it_shows_when_judged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    body = spinner(channels=cross(20.0))
    whole = compare(body, catalogue.CLASSIC)
    for error in (ZeroDivisionError, IndexError):
        monkeypatch.setattr(two_pulse, "schedule", raising(error))
        compared = compare(body, catalogue.CLASSIC)
        (failed,) = compared.failed
        assert (failed.scheme, type(failed._failure)) == ("two-pulse", error)
        assert error.__name__ in infeasibility(failed)
        for one, other in zip(compared.plans, whole.plans, strict=True):
            assert (
                one.scheme == "two-pulse" or one.pulses.total_impulse == other.pulses.total_impulse
            )
        assert compared.recommended is not None
    monkeypatch.setattr(end_state, "momentum_gained", raising(IndexError))
    jet = channel("T", 0.0, 8.0, 0.0, isp=220.0, thrust=10.0, force=(10.0, 0.0, 0.0))
    compared = compare(spinner(channels=(jet,), mass=100.0), ("one-pulse",))
    assert ([type(one._failure) for one in compared.failed], compared.recommended) == (
        [IndexError],
        None,
    )


def test_a_plan_that_would_not_lower_the_nutation_is_infeasible() -> None:
    """A push along the transverse rate, and one against it."""
    body = spinner(channels=cross(40.0), phase=0.0)
    along, against = (
        planning.judged(
            body, "one-pulse", Schedule((channel_pulse(one, 0.05, 0.1),)), catalogue.SchemeOptions()
        )
        for one in body.channels[:2]
    )
    assert (along.feasible, against.feasible) == (False, True)
    assert isinstance(along._why, Worse)
    assert along._why.nutation > body.nutation


def weak(least: float = 0.01) -> tuple[Channel, ...]:
    return (
        channel("A1", 0.0, -0.5, 0.0, min_on_time=least),
        channel("A2", 0.0, 0.5, 0.0, min_on_time=least),
    )


SELF_DAMPING = replace(
    spinner(100.0, 150.0, math.tau / 6.0, 3.0, channels=weak()),
    dissipation=20.0,
    requirement=Requirement(nutation=math.radians(0.05)),
)
"""Oblate: its nutation decays e-fold in 20 s."""


def idle(body: Spacecraft, t: float) -> float:
    """Nutation, rad, of a flight without pulses."""
    return end_state.seen_at(by_impulses(body, Schedule(), t), t).final.nutation


def test_a_plan_that_leaves_more_than_decay_alone_by_its_end_is_infeasible_and_says_so() -> None:
    compared = compare(replace(SELF_DAMPING, limits=Limits(horizon=180.0)), ("two-pulse",))
    (made,) = compared.plans
    assert isinstance(made._why, Worse)
    assert made._why.nutation < 0.01 * SELF_DAMPING.nutation  # it does damp
    assert idle(SELF_DAMPING, made._why.at) < made._why.nutation
    check_text("plan.worse-than-decay", f"{infeasibility(made)}\n{noted(reasons(compared))}")
    assert math.degrees(idle(SELF_DAMPING, 81.91)) == pytest.approx(
        0.05, rel=1e-3
    )  # the time that the text names
    late = plan(
        replace(SELF_DAMPING, limits=Limits(earliest=300.0)), "one-pulse"
    )  # the default horizon is 240 s
    check_text("plan.earliest-after-horizon", infeasibility(late))


@given(
    st.floats(5.0, 100.0),
    st.floats(1e-3, 0.5),
    st.floats(0.5, 20.0),
    st.sampled_from(catalogue.CLASSIC),
    st.floats(0.0, 60.0),
)
@settings(max_examples=10)
@pytest.mark.deep
def test_plans_for_a_body_that_damps_itself_leave_less_than_decay_does(
    time_constant: float, least: float, degrees: float, scheme: str, earliest: float
) -> None:
    limits = Limits(earliest=earliest, horizon=240.0)
    body = spinner(100.0, 150.0, math.tau / 6.0, degrees, channels=weak(least), limits=limits)
    made = plan(replace(body, dissipation=time_constant), scheme)
    assert made.flown is None or made.flown.nutation < idle(made.spacecraft, made.end)


@pytest.mark.weekly
def test_optimal_looks_within_the_time_that_there_is_where_it_begins_late() -> None:
    """Half the horizon ends before the first pulse may begin."""
    made = plan(replace(SELF_DAMPING, limits=Limits(earliest=130.0, horizon=240.0)), "optimal")
    assert made.feasible, infeasibility(made)
    assert made.pulses.pulses[0].start >= 130.0


@pytest.mark.deep
def test_too_few_pulses_for_the_least_impulse_are_named_with_how_many_it_takes() -> None:
    body = spinner(channels=cross(4.0, max_on_time=1.0), limits=Limits(horizon=60.0, max_pulses=3))
    enough = math.ceil(body.least_impulse / 4.0)
    said = infeasibility(plan(body, "optimal", KEPT))
    check_text("plan.too-few-pulses", said)
    assert f"{100.0 * 3 * 4.0 / body.least_impulse:.4g} %" in said
    assert f"{enough} or more" in said
    assert plan(
        replace(body, limits=replace(body.limits, max_pulses=2 * enough)), "optimal", KEPT
    ).feasible


THREE_MOMENTS = """
name: three moments
inertia: {tensor: [[100, 3, 1], [3, 80, -2], [1, -2, 45]]}
omega0: [0.1, -0.15, 2.5]
thrusters:
  - {name: A1, position: [0, 0.5, 0.8], direction: [1, 0, 0.1], force: 12 N, isp: 220 s,
     max_on_time: 1 s}
  - {name: A2, position: [0.5, 0, 0.8], direction: [0, -1, 0.2], force: 12 N, isp: 220 s,
     max_on_time: 1 s}
requirement: {nutation: 0.3 deg, momentum_shift: 2 deg}
limits: {horizon: 120 s, tick: 1 ms, max_pulses: 6}
"""


@pytest.mark.weekly
@pytest.mark.parametrize("horizon", [90.0, 120.0, 150.0])
def test_a_longer_horizon_has_a_schedule_too_and_no_dearer_one(horizon: float) -> None:
    """Within 90 s the search itself found one of 16.9 g, within 120 s none; one of 15.5 g ends at
    64 s.
    """
    body = read_spacecraft(THREE_MOMENTS, "f.yaml", ())
    made = plan(replace(body, limits=replace(body.limits, horizon=horizon)), "optimal")
    assert made.meets_requirement
    assert made.pulses.cost_in("kg") < 0.016


@pytest.mark.parametrize(
    ("channels", "horizon", "freed"),
    [
        *(
            weekly(cross(2.0), 2.0, False),
            weekly(cross(2.0), 6.0, False),
            weekly(cross(2.0)[:1], 2.0, False),
        ),
        *(
            weekly(cross(15.0)[:2], 2.0, False),
            weekly(cross(15.0), 1.4, False),
            deep(cross(15.0), 1.6, True),
        ),
    ],
)
def test_the_horizon_that_is_named_as_long_enough_is(
    channels: tuple[Channel, ...], horizon: float, freed: bool
) -> None:
    body = spinner(channels=channels, limits=Limits(horizon=horizon))
    said = infeasibility(plan(body, "optimal", KEPT))
    named = re.search(r"limits\.horizon = (\S+) s", said)
    assert named
    assert plan(replace(body, limits=Limits(horizon=float(named[1]))), "optimal", KEPT).feasible, (
        said
    )
    assert ("--free-axis" in said) is freed
    assert plan(body, "optimal", catalogue.OptimalOptions(free_axis=True)).feasible is freed


TIGHT = Limits(horizon=20.0, earliest=1.0, gap=0.5, max_pulses=3, blackout=((6.0, 7.0),))
TICKING, FAR = Limits(horizon=20.0, tick=0.3), Limits(horizon=1e17)


def fired(*times: tuple[float, float]) -> Schedule:
    """Pulses of +1 by centre and on-time."""
    return Schedule(tuple(channel_pulse(cross(20.0)[0], t, on_time) for t, on_time in times))


def within(limits: Limits) -> Spacecraft:
    return spinner(channels=cross(20.0, min_on_time=0.2, max_on_time=2.0), limits=limits)


@pytest.mark.parametrize(
    ("limits", "pulses", "broken"),
    [
        (TIGHT, [(1.5, 1.0), (2.75, 0.5), (5.5, 1.0)], None),
        (TIGHT, [(1.4, 1.0)], Limit.EARLIEST),
        (TIGHT, [(19.6, 1.0)], Limit.HORIZON),
        (TIGHT, [(2.0, 1.0), (3.2, 1.0)], Limit.GAP),
        (TIGHT, [(6.5, 0.2)], Limit.BLACKOUT),
        (TIGHT, [(5.8, 0.6)], Limit.BLACKOUT),
        (TIGHT, [(2.0, 0.1)], Limit.MIN_ON_TIME),
        (TIGHT, [(4.0, 3.0)], Limit.MAX_ON_TIME),
        (TIGHT, [(2.0, 0.5), (4.0, 0.5), (8.0, 0.5), (10.0, 0.5)], Limit.MAX_PULSES),
        (TICKING, [(4.05, 0.9)], None),
        (TICKING, [(4.0, 0.9)], Limit.START_TICK),
        (TICKING, [(4.15, 0.5)], Limit.ON_TIME_TICK),
        (FAR, [(1e16, 0.5)], Limit.RESOLUTION),
        (Limits(horizon=20.0, gap=0.5), [(4.0, 2.0), (5.2, 0.3)], Limit.GAP),  # they overlap
    ],
)
def test_schemes_and_judge_go_by_the_same_limits(
    limits: Limits, pulses: list[tuple[float, float]], broken: Limit | None
) -> None:
    """What the judge would refuse no scheme may take for good."""
    assert [one.limit for one in breaches(within(limits), fired(*pulses))] == (
        [] if broken is None else [broken]
    )
    assert keeps_limits(within(limits), fired(*pulses)) is (broken is None)


def test_breaches_say_which_limit_which_pulse_and_by_how_much_each_limit_once() -> None:
    body = within(replace(TIGHT, tick=0.05))
    made = fired((0.5, 0.1), (6.5, 0.2), (6.98, 0.3), (25.0, 9.0))
    lines = [
        f"{one.limit.name} {one.number} {one.bound:g} {one.by:.9g}" for one in breaches(body, made)
    ]
    check_text("plan.breaches", "\n".join([*lines, *broken_limits(body, made)]))
    many = fired(*((21.0 + number, 0.5) for number in range(222)))
    check_text("plan.breaches-many", "\n".join(broken_limits(within(Limits(horizon=20.0)), many)))


@given(
    st.integers(0, 40), st.sampled_from([-4.0, -2.0, -0.5, 0.0, 0.5, 2.0, 4.0]), st.integers(0, 3)
)
def test_one_slack_for_windows_and_breaches(exponent: int, off: float, which: int) -> None:
    """A pulse that `Windows` allows breaks nothing, however late: both let times err by their
    resolution.
    """
    late = 2.0**exponent
    limits = Limits(
        horizon=4.0 * late, earliest=late, gap=0.5, blackout=((2.0 * late, 3.0 * late),)
    )
    body = spinner(channels=cross(20.0), limits=limits)
    pulse = fired((0.0, 2.0**-10 * late)).pulses[0]
    edge = (late, 2.0 * late - pulse.on_time, 3.0 * late, 4.0 * late - pulse.on_time)[which]
    pulse = replace(pulse, t=edge + off * max(1e-9, math.ulp(edge)) + 0.5 * pulse.on_time)
    windows = Windows(body)
    allowed = windows.allows(pulse.start, pulse.on_time, late)
    assert keeps_limits(body, (pulse,)) == allowed
    assert windows.allowed(np.array([pulse.start]), np.array([pulse.on_time]), late).tolist() == [
        allowed
    ]


# --- Δv, spin change, propellant and impulse, against the reference integrator and by hand


def jet(
    name: str, position: tuple[float, float, float], force: tuple[float, float, float]
) -> Channel:
    return channel(
        name,
        *np.cross(position, force),
        isp=220.0,
        thrust=float(np.linalg.norm(force)),
        force=force,
    )


JETS = (
    jet("T1", (0.0, 0.5, 0.8), (0.0, 10.0, 1.0)),
    jet("T2", (0.5, 0.0, 0.8), (8.0, 2.0, 0.0)),
    jet("T3", (0.0, -0.5, 0.8), (0.0, -10.0, -3.0)),
)
BODY, REVERSED = spinner(channels=JETS, mass=250.0), spinner(spin=-3.0, channels=JETS, mass=250.0)


def flown_force(body: Spacecraft, made: Schedule) -> Vector:
    """∫ R(t) F dt by Simpson's rule on the reference motion, from each moment that a pulse begins
    or ends to the next.

    Pulses may overlap: forces add.
    """
    moments = body.inertia.moments
    gained = np.zeros(3)
    start = reference.Motion(body.omega0, reference.frame_n(moments, body.omega0))
    edges = sorted({edge for pulse in made for edge in (pulse.start, pulse.end)})
    for begin, end in itertools.pairwise(edges):
        forces = [one.force for one in made if one.start < 0.5 * (begin + end) < one.end]
        times = np.linspace(begin, end, 2001)
        motions = reference.path(moments, start, events(made), times)
        force = np.sum([np.zeros(3), *map(present, forces)], axis=0)
        gained += simpson([motion.rotation @ force for motion in motions], x=times, axis=0)
    return gained


@pytest.mark.parametrize(
    ("body", "fired"),
    [
        *((BODY, "one-pulse"), deep(BODY, "two-pulse"), deep(BODY, "four-pulse")),
        *(deep(REVERSED, "one-pulse"), deep(REVERSED, "two-pulse"), (REVERSED, "four-pulse")),
        # Stretches are cut by how fast the body turns at either end of the pulse, not as it begins.
        (
            spinner(2.0, 1.0, 0.1, mass=10.0),
            [(channel("up", 0.0, 1.2, 1.0, force=(1.0, 0.0, 0.5)), 5.0, 10.0)],
        ),
        (BODY, [(JETS[0], 2.0, 1.0), (JETS[1], 2.4, 1.0)]),  # overlapping
        (BODY, [(channel("couple", 0.0, 20.0, 0.0, force=(0.0, 0.0, 0.0)), 2.0, 1.0)]),
    ],
)
def test_delta_v_is_the_force_turned_into_the_inertial_frame_over_the_mass(
    body: Spacecraft, fired: str | list[tuple[Channel, float, float]]
) -> None:
    by_hand = isinstance(fired, list)
    made = (
        Plan(body, "", Schedule(tuple(channel_pulse(*one) for one in fired)))
        if by_hand
        else plan(body, str(fired))
    )
    expected = flown_force(made.spacecraft, made.pulses) / (body.mass or 0.0)
    assert made._delta_v == pytest.approx(
        expected, abs=(1e-9 if by_hand else 1e-10) * float(np.linalg.norm(expected))
    )
    assert replace(made, spacecraft=replace(body, mass=None))._delta_v is None
    unknown = replace(made.pulses.pulses[0], force=None)
    assert replace(made, schedule=Schedule((unknown, *made.pulses.pulses[1:])))._delta_v is None


@pytest.mark.parametrize("scheme", catalogue.CLASSIC)
def test_spin_change_and_propellant(scheme: str) -> None:
    """By the reference integrator, by the sum of axial impulses, and by F t / (Isp g0)."""
    made = plan(BODY, scheme)
    end = reference.fly(BODY.inertia.moments, BODY.omega0, events(made.pulses), made.pulses.end)
    assert made._spin_change == pytest.approx(end.rates[2] - 3.0, abs=1e-11)
    assert made._spin_change == pytest.approx(
        math.fsum(one.impulse[2] for one in made.pulses) / 80.0, abs=1e-13
    )
    thrust = {one.name: one.thrusters[0].thrust or 0.0 for one in JETS}
    expected = math.fsum(
        thrust[pulse.channel] * pulse.on_time / (220.0 * 9.80665) for pulse in made.pulses
    )
    assert made.pulses.propellant == pytest.approx(expected, rel=1e-14)
    assert STANDARD_GRAVITY == 9.80665


def test_propellant_of_a_channel_and_by_lever_arms_and_one_unknown_makes_the_sum_unknown() -> None:
    pulse = channel_pulse(Channel("both", tuple(one.thrusters[0] for one in JETS[:2])), 3.0, 2.0)
    thrust = math.hypot(10.0, 1.0) + math.hypot(8.0, 2.0)
    assert pulse.propellant == pytest.approx(thrust * 2.0 / (220.0 * 9.80665), rel=1e-15)
    assert np.array_equal(pulse.impulse, 2.0 * (JETS[0].torque + JETS[1].torque))
    assert (None if pulse.force is None else pulse.force.tolist()) == [8.0, 12.0, 1.0]
    unknown = channel_pulse(cross(20.0)[0], 6.0, 1.0)
    known = [Schedule(some).propellant is not None for some in ((), (pulse,), (pulse, unknown))]
    assert known == [True, True, False]
    made = plan(
        spinner(steerable=Steerable(torque=20.0, isp=220.0, lever_arm=0.8)), "two-pulse"
    ).pulses
    assert made.propellant == pytest.approx(made.total_impulse / 0.8 / (220.0 * 9.80665), rel=1e-14)
    assert plan(spinner(steerable=Steerable(20.0)), "two-pulse").pulses.propellant is None


def test_impulses_and_the_end_of_a_schedule_in_the_order_of_its_centres() -> None:
    body = spinner(degrees=5.0)
    made = plan(body, "two-pulse").pulses
    assert body.least_impulse == pytest.approx(80.0 * 3.0 * math.tan(math.radians(5.0)), rel=1e-15)
    assert made.total_impulse == math.fsum(float(np.linalg.norm(one.impulse)) for one in made)
    ordered = Schedule((channel_pulse(JETS[0], 9.0, 4.0), channel_pulse(JETS[1], 8.0, 0.5)))
    assert ([pulse.t for pulse in ordered], ordered.end) == ([8.0, 9.0], 11.0)


# --- ways round cones: on the sphere, and flown leg by leg by the cheapest scheme that points

SUN = math.radians(3.0)
TURNED = replace(
    aimed(spinner(80.0, 120.0, degrees=0.2), 12.0, 30.0),
    steerable=Steerable(),
    limits=Limits(horizon=900.0),
)
"""A turn of 12 deg."""
START = TURNED.momentum / np.linalg.norm(TURNED.momentum)


def watched(direction: Vector, least: float = SUN) -> Spacecraft:
    return replace(TURNED, keep=(Keep("Sun", direction / np.linalg.norm(direction), least=least),))


def length(route: tuple[Vector, ...]) -> float:
    return sum(float(attitude.angle_between(*leg)) for leg in itertools.pairwise((START, *route)))


def test_routes_lead_to_the_target_clear_of_the_cone_the_shortest_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two legs that touch a circle of 3 deg and its margin of 0.5 deg about the middle of 12 deg,
    as in a plane.
    """
    monkeypatch.setattr(routes, "MARGINS", routes.MARGINS[:2])
    body = watched(START + TURNED.target_axis)
    found = routes.routes(body)
    assert 4 <= len(found) <= routes.ROUTES
    for route in found:
        assert np.allclose(route[-1], body.target_axis)
        for one, two in itertools.pairwise((START, *route)):
            shares = np.linspace(0.0, 1.0, 50)[:, None]
            points = (
                1.0 - shares
            ) * one + shares * two  # chords of short legs lie next to their great circles
            assert attitude.angle_between(points, np.asarray(body.keep[0].direction)).min() > SUN
    lengths = list(map(length, found))
    assert np.all(np.diff(lengths) > -2e-3)
    clear = math.degrees(SUN + routes.MARGINS[0])
    bend = clear / math.sqrt(1.0 - (clear / 6.0) ** 2)
    assert 1.0 < lengths[0] / math.radians(2.0 * math.hypot(6.0, bend)) < 1.03
    assert not any(len(route) < 2 for route in found)
    for route in routes.routes(
        watched(-body.target_axis)
    ):  # without a cone in the way they are next to straight
        assert length(route) == pytest.approx(math.radians(12.0), rel=1e-3)


def test_a_plan_goes_round_where_the_straight_way_breaks_the_cone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The Sun stands where the axis would be half-way on its half cone."""
    monkeypatch.setattr(routes, "MARGINS", routes.MARGINS[:1])
    free = planning.plan(TURNED, "half-cone")
    track = free.fly(free.end, samples=101).track
    body = watched(track.axis[len(track.t) // 2], math.radians(1.0))
    astray = planning.judged(body, "half-cone", free.pulses, free.options)
    assert isinstance(astray._why, Aspect)
    routed = planning.plan(body, "half-cone")
    assert routed.feasible
    (aspect,) = routed._aspects
    assert aspect.kept
    assert present(routed._left).aim < 1e-6
    assert routed.total_impulse < 1.6 * free.total_impulse
