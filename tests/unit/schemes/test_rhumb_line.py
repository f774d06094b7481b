"""Trains of pulses at a fixed inertial phase: what they cost, what nutation they leave, and where they fail."""

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import reference
from support.builders import Outcome, aimed, channel, codes, cross, events, fan, off_target, one_of, present, spinner
from support.cases import spread
from support.feasible import feasible_by
from support.golden import check_text

from nutdamp.files.reader import example_text, read_spacecraft
from nutdamp.physics import precession
from nutdamp.planning import plan as planning
from nutdamp.planning.notes import infeasibility, plan_notes
from nutdamp.schemes.catalogue import Options, RhumbLineOptions
from nutdamp.schemes.rhumb_line import Train
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Limits, Spacecraft

TURN = 2.0 * math.pi / 3.0
"""s of the bodies here."""


def still(A: float = 120.0, C: float = 80.0, tilt: float = 20.0, azimuth: float = 0.0, **parts: Any) -> Spacecraft:
    """A pure spin to be turned."""
    return aimed(spinner(A, C, degrees=0.0, **parts), tilt, azimuth)


def train(spacecraft: Spacecraft, *, near: float = 1e-9, **options: Any) -> planning.Plan:
    """The plan, which by the reference ends on the target with equal pulses behind what damps the nutation."""
    plan = feasible_by("rhumb-line", spacecraft, Options(**options))
    sizes = np.array([pulse.on_time or pulse.magnitude for pulse in equal(plan)])
    assert sizes == pytest.approx(sizes[:1].repeat(len(sizes)), rel=1e-12)
    assert Outcome(spacecraft, plan.pulses).nutation < near
    assert off_target(spacecraft, plan.pulses) < near
    return plan


TRAINS = ("great-circle-train", "rhumb-line-train")


def equal(plan: planning.Plan) -> tuple[Any, ...]:
    """The pulses that are said to be equal."""
    (count,) = (entry.values["count"] for entry in plan_notes(plan) if entry.code in TRAINS)
    assert isinstance(count, int)
    return plan.pulses.pulses[-count:]


def why_not(spacecraft: Spacecraft, **options: Any) -> str:
    plan = planning.plan(spacecraft, "rhumb-line", RhumbLineOptions(**options))
    assert not plan.feasible
    return infeasibility(plan)


@spread("spin", [3.0, -3.0], quick=1)
@spread(("A", "C"), [(120.0, 80.0), (80.0, 120.0), (100.0, 35.0)], quick=1)
@spread("per_turn", [1, 2], quick=1)
def test_ends_on_the_target(per_turn: int, A: float, C: float, spin: float) -> None:
    for actuators in ({"channels": cross(60.0)}, {"steerable": Steerable(60.0)}, {}):
        train(aimed(spinner(A, C, spin, 0.0, **actuators), 12.0, 45.0), per_turn=per_turn)
    ideal = still(A, C, 20.0, 100.0)  # comes down to the floor
    assert 1.0 <= train(ideal).pulses.total_impulse / ideal.turning_impulse < 1.002


@spread(
    "body",
    [
        spinner(degrees=1.0, channels=cross(60.0)),
        spinner(degrees=20.0, channels=(channel("+1", 60.0, 0.0, 0.0),)),
        spinner(
            degrees=1.0,
            channels=cross(40.0),
            limits=Limits(earliest=2.0, gap=3.0, blackout=((8.0, 15.0), (20.0, 21.0)), horizon=200.0),
        ),
        spinner(moments=(100.0, 116.0, 140.0), degrees=0.0, channels=cross(20.0), limits=Limits(horizon=400.0)),
    ],
    quick=1,
    deep=3,
    ids=["along", "first", "limits", "three moments"],
)
def test_a_nutation_limits_and_unequal_moments_are_no_hindrance(body: Spacecraft) -> None:
    """A nutation goes along or first; unequal moments change the width of all pulses alike."""
    train(aimed(body, 10.0, 45.0))


@pytest.mark.weekly
@spread("on_time", [0.1, 0.3, 0.6], quick=1, deep=2)
@spread("torque", [40.0, 10.0], quick=1, deep=2)
def test_arc_efficiency(torque: float, on_time: float) -> None:
    """Along the great circle equal pulses cost C|ω3|β over sinc(ω3τ/2), and what is left of a pulse and two to spare.

    Their phases alone bring the nutation to nothing, which takes the pulses to spare.
    """
    body = still(tilt=60.0, channels=cross(torque), limits=Limits(horizon=2000.0))
    made = feasible_by("rhumb-line", body, Options(on_time=on_time)).pulses
    assert {pulse.on_time for pulse in made} == {on_time}
    turned = sum(pulse.magnitude * precession.arc_efficiency(3.0, pulse.on_time) for pulse in made)
    assert 1.0 < turned / body.turning_impulse < 1.0 + 3.0 / len(made)


@pytest.mark.weekly
def test_an_on_time_is_kept_exactly_or_the_nearest_that_works_is_named() -> None:
    """Of turns by some tens of pulses of a length that is requested."""
    kept, named = 0, 0
    for seed in range(16):
        rng = np.random.default_rng(seed)
        spin, C, degrees = float(rng.choice([3.0, -3.0])), rng.uniform(30.0, 190.0), float(rng.choice([0.0, 1.0, 5.0]))
        channels = cross(float(rng.uniform(5.0, 20.0)), max_on_time=1.0)
        body = spinner(100.0, C, spin, degrees, channels=channels, limits=Limits(horizon=400.0))
        on_time, per_turn = float(rng.uniform(0.05, 0.6)), int(rng.integers(1, 3))
        body = aimed(body, float(rng.uniform(5.0, 40.0)), float(rng.uniform(-180.0, 180.0)))
        plan = planning.plan(body, "rhumb-line", RhumbLineOptions(on_time=on_time, per_turn=per_turn))
        if not plan.feasible:
            said = re.search(r"--on-time ([0-9.]+)s works, with ([0-9]+) pulses in all$", infeasibility(plan))
            assert said or infeasibility(plan).endswith("no other length was found that works"), infeasibility(plan)
            if said:
                plan = feasible_by("rhumb-line", body, Options(on_time=float(said[1]), per_turn=per_turn))
                assert len(plan.pulses) == int(said[2])
                named += 1
        else:
            kept += 1
            assert {pulse.on_time for pulse in equal(plan)} == {on_time}, seed
        assert plan.flown is None or max(plan.flown.nutation, plan.flown.axis_error) < 1e-8
    assert kept > 8
    assert named > 1


@pytest.mark.deep
def test_fewer_pulses_than_close_by_themselves_are_trimmed_to_close() -> None:
    """The example to 14 deg: 53 pulses of 0.1328 s were made of 0.2 s before, where 42 do."""
    example = read_spacecraft(example_text(), "example.yaml")
    for azimuth, most in ((0.0, 42), (90.0, 33)):
        assert len(train(aimed(example, 14.0, azimuth), on_time=0.2).pulses) <= most


@pytest.mark.deep
def test_on_ticks_the_width_is_one_of_them_and_starts_leave_little() -> None:
    """What is left is the rounding of starts: by 10 ms a pulse is turned by 1.7 deg, of its 0.7 deg."""
    body = still(tilt=12.0, azimuth=45.0, channels=cross(20.0), limits=Limits(horizon=400.0, tick=0.01))
    for on_time in (None, 0.15):
        plan = train(body, on_time=on_time, near=math.radians(0.05))
        ticks = np.array([pulse.on_time for pulse in equal(plan)]) / 0.01
        assert ticks == pytest.approx(np.rint(ticks), abs=1e-9)
        assert plan.pulses.total_impulse < 1.1 * body.turning_impulse
    check_text("rhumb.no-tick", why_not(body, on_time=0.152))


@pytest.mark.weekly
@spread(("degrees", "turn", "on_time"), [(0.5, 4.0, 0.2), (2.0, 6.0, 0.3), (1.0, 3.0, 0.1)], quick=1, deep=2)
def test_pulses_that_damp_make_up_for_unequal_moments_where_the_width_is_given(
    degrees: float, turn: float, on_time: float
) -> None:
    """By the starts of the last eight pulses alone the end was off by up to 0.2 deg; what is left is said."""
    channels = tuple(channel(name, torque, 0.0, 0.0, max_on_time=0.4) for name, torque in (("P", 8.0), ("N", -8.0)))
    body = spinner(moments=(105.0, 135.0, 180.0), degrees=degrees, channels=channels, limits=Limits(horizon=600.0))
    plan = train(aimed(body, turn, 45.0), on_time=on_time)
    assert {pulse.on_time for pulse in equal(plan)} == {on_time}
    assert "fixed-length" not in codes(plan_notes(plan))
    cut = replace(plan, schedule=replace(plan.pulses, pulses=plan.pulses.pulses[:-1]))
    off = math.degrees(max(present(cut.flown).nutation, present(cut.left).aim))
    assert one_of(plan_notes(cut), "fixed-length")["off_deg"] == pytest.approx(off)


@spread("per_turn", [1, 2, 3], quick=1)
def test_pulses_come_once_or_more_in_each_turn(per_turn: int) -> None:
    body = still(tilt=20.0, azimuth=45.0, channels=fan(3, 30.0))
    made = feasible_by("rhumb-line", body, Options(per_turn=per_turn)).pulses
    assert np.mean(np.diff([one.t for one in made])) == pytest.approx(TURN / per_turn, rel=0.05)
    assert len({pulse.channel for pulse in made}) == per_turn


@spread(("A", "C"), [(120.0, 80.0), (80.0, 120.0), (100.0, 93.0)], quick=1)
def test_equal_pulses_once_a_turn_leave_no_more_nutation_than_the_bound(A: float, C: float) -> None:
    """(angle per pulse)/|sin πa|, and the count chosen closes: flown by the reference integrator."""
    body = still(A, C, 10.0, channels=cross(20.0), limits=Limits(horizon=400.0))
    pulses = feasible_by("rhumb-line", body).pulses.pulses
    bound = pulses[0].magnitude / (C * 3.0) / abs(math.sin(math.pi * (1 - C / A)))
    nutations = []
    for number in range(1, len(pulses)):
        moving = reference.fly((A, A, C), body.omega0, events(pulses[:number]), pulses[number].start)
        nutations.append(reference.nutation((A, A, C), moving.rates, 1.0))
    assert 0.7 * bound < max(nutations) < 1.02 * bound  # it is reached, so the bound is no idle one


def test_where_there_is_no_train_the_reason_is_said() -> None:
    """Where every pulse meets the nutation in the same phase, of too little time, and of lengths no pulse can have."""
    short: dict[str, Any] = {"channels": cross(60.0), "limits": Limits(horizon=60.0)}  # in 400 s C = 0.995 A closes
    whole = [still(100.0, C, 10.0, **short) for C in (100.0, 99.5, 200.0, 199.0)]
    facing = still(tilt=50.0, channels=cross(60.0))
    reasons = [
        *map(why_not, whole),
        why_not(still(tilt=30.0, channels=cross(1.0, max_on_time=0.2))),
        why_not(still(tilt=10.0, channels=cross(60.0)[:1]), per_turn=2),
        why_not(replace(facing, goal=replace(facing.goal, sun=facing.target_axis))),
        why_not(still(channels=cross(60.0)), on_time=1.1),
        why_not(still(channels=cross(60.0, min_on_time=1.2))),
        why_not(still(channels=cross(60.0, max_on_time=0.3)), on_time=0.4),
        why_not(still(), on_time=0.2),
        why_not(spinner()),
    ]
    check_text("rhumb.why-not", "\n".join(reasons))
    train(still(100.0, 100.0, 10.0, channels=cross(60.0)), per_turn=2)  # two a turn cure the sphere


@pytest.mark.deep
@spread("seed", range(20), quick=1)
def test_course_and_way_of_a_rhumb_line(seed: int) -> None:
    """Small steps on the course as it is at each point end on the target after the way reported at first."""
    here, target, sun = (axis / np.linalg.norm(axis) for axis in np.random.default_rng(seed).normal(size=(3, 3)))
    _, way = precession.course(here, target, sun)
    steps, courses = 4000, []
    for number in range(steps):
        ahead, left = precession.course(here, target, sun)
        assert left == pytest.approx(way * (1 - number / steps), abs=2e-3 * way + 1e-6)
        if left > 0.05 * way:  # its angle to the Sun is the same all the way
            bright = sun - (sun @ here) * here
            courses.append(math.atan2(ahead @ np.cross(here, bright), ahead @ bright))
        here = here + ahead * way / steps
        here /= np.linalg.norm(here)
    assert reference.angle(here, target) < 2e-3
    assert np.ptp(np.unwrap(courses)) < 2e-2


@pytest.mark.deep
def test_a_fixed_sun_phase_is_longer_and_arrives_too() -> None:
    body = still(tilt=50.0, channels=cross(60.0), limits=Limits(horizon=400.0))
    sun = body.direction_in_n(math.radians(40.0), math.radians(60.0))
    direct, rhumb = train(body), train(replace(body, goal=replace(body.goal, sun=sun)))
    assert rhumb.pulses.total_impulse > 1.02 * direct.pulses.total_impulse
    assert [codes(plan_notes(plan))[0] for plan in (direct, rhumb)] == [*TRAINS]


@spread(("turns", "pulses", "torque", "fixed"), [(2, 2, 15, False), (3, 2, 15, True), (8, 6, 5, True)], deep=2)
def test_in_a_short_horizon_pulses_are_long_but_less_than_half_a_turn(
    turns: int, pulses: int, torque: float, fixed: bool
) -> None:
    """Of the default length, a tenth of a turn or so, they would not reach the target in time.

    What a pulse adds in its second half of a turn it takes away from the first.
    """
    actuators: dict[str, Any] = {"channels": cross(torque)} if fixed else {"steerable": Steerable(torque)}
    made = train(still(80.0, 120.0, 3.0, 45.0, limits=Limits(horizon=turns * TURN), **actuators)).pulses
    assert len(made) == pulses
    assert all(0.35 * TURN < pulse.on_time < 0.5 * TURN for pulse in made)


def test_a_train_keeps_the_narrowest_bounds_of_its_channels() -> None:
    jets = cross(8.0)
    bounded = (jets[0].of(min_on_time=0.02, max_on_time=0.9), jets[1].of(min_on_time=0.05, max_on_time=1.0), *jets[2:])
    train = Train(aimed(spinner(channels=bounded), 5.0, 0.0), RhumbLineOptions(per_turn=len(jets)))
    assert (train.shortest, train.longest) == (0.05, 0.9)


def test_a_shortest_pulse_next_to_nothing_bounds_the_number_of_pulses_as_none_does() -> None:
    """More of them would be needed than a float can hold."""
    plans = [train(still(channels=(channel("T", 8.0, 0.0, 0.0, min_on_time=least),))) for least in (0.0, 1e-320)]
    any_length, shortest = ([(pulse.t, pulse.on_time) for pulse in plan.pulses] for plan in plans)
    assert any_length == shortest


def test_ideal_impulses_turn_a_few_degrees_each_where_there_are_too_few_moments() -> None:
    """Of a heavy body as of a light one."""
    for size in (1.0, 300.0):
        body = still(120.0 * size, 80.0 * size, 30.0, steerable=Steerable(), limits=Limits(horizon=0.5))
        said = infeasibility(planning.plan(body, "rhumb-line"))
        assert re.search(r"takes 15 pulses", said), said
