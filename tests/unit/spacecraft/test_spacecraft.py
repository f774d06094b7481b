"""When a pulse may be on, where the center of mass is, and what keeps a bound."""

import cmath
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import reference
from support.builders import channel, fan, judged, present, spinner

import nutdamp
from nutdamp.files.carried import later
from nutdamp.flight.dynamics import Supply
from nutdamp.flight.propagation import flown
from nutdamp.montecarlo.cases import DispersedModel
from nutdamp.physics import attitude, frames
from nutdamp.spacecraft import directions
from nutdamp.spacecraft.constraints import (
    Windows,
    commandable,
    for_pairs,
    free_windows,
    longest_on_time,
    rooms,
)
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import SLACK, Attitude, Goal, Keep, Limits, Requirement
from nutdamp.spacecraft.requirements import (
    AIMED_SPIN,
    Bound,
    Part,
    cones,
    required,
    spin_tolerance,
    spins_at,
)
from nutdamp.spacecraft.schedule import TOUCHING, Schedule, channel_pulse, steerable_pulse
from nutdamp.spacecraft.tolerances import SpinTolerance

THRUSTER = channel("T", 8.0, 0.0, 0.0)


def windows(**limits: object) -> Windows:
    return Windows(spinner(limits=Limits(**{"horizon": 100.0, **limits})))  # type: ignore[arg-type]


def test_where_a_pulse_is_allowed() -> None:
    """Within the horizon, actuators ready; it may touch a blackout window by its edges only."""
    free, dark = windows(), windows(blackout=((10.0, 20.0),))
    endless = Windows(spinner(limits=Limits(horizon=10.0, blackout=((20.0, 30.0),))), endless=True)
    for within, start, on_time, ready, allowed in [
        *[(free, 99.0, 1.0, 0.0, True), (free, 99.01, 1.0, 0.0, False)],
        *[(free, 5.0, 1.0, 5.0, True), (free, 5.0, 1.0, 5.01, False)],
        *[(dark, 9.0, 1.0, 0.0, True), (dark, 20.0, 1.0, 0.0, True), (dark, 9.0, 12.0, 0.0, False)],
        *[(dark, start, 1.0, 0.0, False) for start in (9.5, 10.0, 15.0, 19.9)],
        *[(dark, 9.5, 0.0, 0.0, True), (dark, 12.0, 0.0, 0.0, False)],  # ideal impulses
        *[(endless, 1e9, 5.0, 0.0, True), (endless, 25.0, 5.0, 0.0, False)],
    ]:
        assert within.allows(start, on_time, ready) == allowed
    assert [dark.blocked_until(start, 1.0) for start in (9.5, 10.0, 15.0, 19.9)] == [20.0] * 4


def test_earliest_start() -> None:
    """Out of one blackout into no other: overlapping, out of order, a hole too short; on ticks."""
    dark = windows(blackout=((8.0, 12.0), (1.0, 5.0), (4.0, 7.5)))
    ticking = windows(tick=0.25, blackout=((1.1, 2.1),))
    for within, on_time, ready, start in [
        *[
            (windows(), 1.0, 0.0, 0.0),
            (windows(), 1.0, 99.5, None),
            (windows(blackout=((1.0, 100.0),)), 0.5, 2.0, None),
        ],
        *[(dark, 0.5, 0.0, 0.0), (dark, 0.5, 0.8, 7.5), (dark, 1.0, 0.8, 12.0)],
        *[(ticking, 0.25, 0.3, 0.5), (ticking, 0.25, 1.0, 2.25)],
    ]:
        assert within.earliest_start(on_time, ready) == start
    assert [ticking.nearest_tick(0.62), ticking.tick_after(0.51), ticking.tick_after(0.5)] == [
        0.5,
        0.75,
        0.5,
    ]


def test_on_times_lie_within_the_bounds_on_ticks_and_are_never_nothing() -> None:
    free, ticking = windows(), windows(tick=0.1)
    for within, wanted, shortest, longest, on_time in [
        *[(ticking, 0.34, 0.0, math.inf, 0.3), (ticking, 0.01, 0.0, math.inf, 0.1)],
        *[(ticking, 0.34, 0.38, math.inf, 0.4), (ticking, 0.9, 0.0, 0.57, 0.5)],
        # Bounds that are multiples themselves, but for rounding: 3 × 0.1 > 0.3.
        *[(ticking, 0.9, 0.0, 0.3, 0.3), (ticking, 0.1, 0.3, 5.0, 0.3)],
        *[
            (free, 0.3456, 0.0, math.inf, 0.3456),
            (free, 0.3, 0.5, 2.0, 0.5),
            (free, 3.0, 0.5, 2.0, 2.0),
        ],
    ]:
        assert within.on_time(wanted, shortest, longest) == pytest.approx(on_time, rel=1e-15)


@given(
    st.floats(0.0, 50.0),
    st.floats(0.0, 5.0),
    st.sampled_from([None, 1e-3, 0.1, 0.25, 1.7]),
    st.lists(st.tuples(st.floats(0.0, 60.0), st.floats(0.0, 10.0)), max_size=5),
)
def test_earliest_start_is_allowed_and_nothing_before_it_is(
    ready: float, on_time: float, tick: float | None, holes: list[tuple[float, float]]
) -> None:
    dark = windows(tick=tick, blackout=tuple((begin, begin + length) for begin, length in holes))
    start = dark.earliest_start(on_time, ready)
    if start is not None:
        assert start >= ready - TOUCHING
        assert dark.allows(start, on_time, ready)
        assert tick is None or abs(start / tick - round(start / tick)) < 1e-9
    step = tick or 0.05
    last = 100.0 - on_time if start is None else start
    for index in range(math.ceil(ready / step), math.floor(last / step)):
        if ready <= index * step < last - 10 * TOUCHING:
            assert not dark.allows(index * step, on_time, ready)


def test_of_very_many_channels_pairs_are_made_of_the_cheapest_about_each_direction() -> None:
    some = for_pairs(spinner(channels=fan(200, 5.0)))
    assert len(some) == 24
    assert (
        max(np.diff(sorted(cmath.phase(channel.transverse) for channel in some)))
        < 2 * math.tau / 24
    )
    few = spinner(channels=fan(9, 5.0))
    assert for_pairs(few) == list(few.channels)


def test_a_pulse_across_the_spin_axis_is_useful_for_half_a_nutation_period() -> None:
    """π/|aω3| with a = 1/3 and ω3 = 3 rad/s; about the spin axis only max_on_time bounds it."""
    for axis, longest, useful in (
        (0, math.inf, math.pi),
        (0, 2.0, 2.0),
        (2, math.inf, math.inf),
        (2, 9.0, 9.0),
    ):
        thruster = channel("T", *(8.0 * np.eye(3)[axis]).tolist(), max_on_time=longest)
        assert longest_on_time(spinner(), thruster) == pytest.approx(useful, rel=1e-12)


def test_pulses_of_a_torquer_are_put_on_ticks_with_the_impulse_of_their_on_time() -> None:
    body = spinner(limits=Limits(tick=0.1))
    ideal = commandable(body, steerable_pulse(Steerable(), 0.33, 0.4, impulse=3.0))
    assert (ideal.on_time, ideal.t, ideal.magnitude) == pytest.approx((0.0, 0.3, 3.0))
    exact = steerable_pulse(Steerable(20.0, 220.0, 0.8), 1.02, 0.4, on_time=0.26)
    wide = commandable(body, exact)
    assert (wide.start, wide.on_time, wide.magnitude) == pytest.approx((0.9, 0.3, 20.0 * 0.3))
    assert wide.propellant == pytest.approx(present(exact.propellant) * 0.3 / 0.26)


def test_pulses_share_the_time_between_them_but_for_the_gap() -> None:
    """From 10 to 11 s and from 20 to 22 s: 8 of the 9 s between them are shared, 1 s is the gap."""
    body = spinner(
        limits=Limits(horizon=100.0, earliest=0.5, gap=1.0, blackout=((2.0, 3.0), (30.0, 40.0)))
    )
    pulses = (channel_pulse(THRUSTER, 10.5, 1.0), channel_pulse(THRUSTER, 21.0, 2.0))
    assert rooms(body, pulses) == [(3.0, pytest.approx(15.0)), (pytest.approx(16.0), 30.0)]
    assert rooms(spinner(limits=Limits(horizon=100.0, earliest=0.5)), pulses[:1]) == [(0.5, 100.0)]
    # Three, one second each, from 10, 20 and 40 s on: 9 s and 19 s between them are halved.
    three = [channel_pulse(THRUSTER, begin + 0.5, 1.0) for begin in (10.0, 20.0, 40.0)]
    shared = rooms(spinner(limits=Limits(horizon=100.0)), three)
    assert np.array(shared) == pytest.approx(np.array([(0.0, 15.5), (15.5, 30.5), (30.5, 100.0)]))


def test_rooms_and_blocked_slots_are_found_among_many_windows_as_by_looking_at_each() -> None:
    rng = np.random.default_rng(5)
    free = 0
    begins = np.sort(rng.uniform(0.0, 100.0, 60))
    dark = list(zip(begins.tolist(), (begins + rng.uniform(0.0, 1.5, 60)).tolist(), strict=True))
    shuffled = tuple((begin, end) for begin, end in rng.permutation(dark).tolist())
    body = spinner(limits=Limits(horizon=95.0, earliest=1.0, blackout=shuffled))
    for t in rng.uniform(2.0, 94.0, 200).tolist():
        pulse = channel_pulse(THRUSTER, t, 0.05)
        if Windows(body).allows(pulse.start, pulse.on_time, 1.0):
            free += 1
            begin = max([1.0, *(end for _, end in dark if end <= pulse.start)])
            end = min([95.0, *(one for one, _ in dark if one >= pulse.end)])
            assert rooms(body, (pulse,)) == [(begin, end)]
    assert free > 30
    edges = np.linspace(0.0, 110.0, 400)
    each = [
        any(low < end and high > begin for begin, end in dark)
        for low, high in itertools.pairwise(edges)
    ]
    assert Windows(body).blocked(edges[:-1], edges[1:]).tolist() == each
    assert 50 < sum(each) < 350
    assert not Windows(spinner()).blocked(edges[:-1], edges[1:]).any()


def test_windows_behind_the_horizon_leave_no_empty_window_at_its_end() -> None:
    body = spinner(limits=Limits(horizon=100.0, blackout=((10.0, 100.0), (105.0, 110.0))))
    assert free_windows(body) == [(0.0, 10.0)]
    assert free_windows(body, 107.0) == [(0.0, 10.0), (100.0, 105.0)]


# --- center of mass: arms of the thrusters, its travel with the propellant, and how far it may be
# off

TEXT = """
name: b
mass: 250 kg
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg, phase: 20 deg}
thrusters:
  - {name: P, position: [0.1, 0.5, 1.2], direction: [0, -1, 0], force: 10 N, isp: 220 s,
     max_on_time: 2 s}
  - {name: N, position: [0.1, -0.5, 1.2], direction: [0, 1, 0], force: 10 N, isp: 220 s,
     max_on_time: 2 s}
center_of_mass: [0.1 m, 0, 40 cm]
"""
MOVING = f"{TEXT}center_of_mass_per_kg: [0, 0, -50 mm/kg]\n"
TENSOR = "{tensor: [[120, 2, 1], [2, 110, 0.5], [1, 0.5, 80]]}"


def test_arms_count_from_the_center_of_mass() -> None:
    """Of thrusters and of an accelerometer; a force through it turns nothing."""
    loop = (
        "loop: {sensor: {kind: accelerometer, rate: 10 Hz, position: [0.9, 0, 0.4]}, "
        "start: 1 deg, stop: 0.1 deg}\n"
    )
    body = nutdamp.read(TEXT + loop)
    for one, side in zip(body.channels, (0.5, -0.5), strict=True):
        assert one.torque == pytest.approx(np.cross([0.0, side, 0.8], [0.0, -20.0 * side, 0.0]))
    assert present(body.loop).sensor.position == pytest.approx([0.8, 0.0, 0.0])
    with pytest.raises(nutdamp.errors.FaultyFile, match="centre of mass"):
        nutdamp.read(TEXT.replace("direction: [0, -1, 0]", "direction: [0, 0.5, 0.8]"))


@pytest.mark.parametrize("inertia", ["{A: 120, C: 80}", TENSOR])
def test_it_moves_with_the_propellant_used(inertia: str) -> None:
    """By the moment of force about where it is in the middle of the pulse."""
    body = nutdamp.read(MOVING.replace("{A: 120, C: 80}", inertia))
    supply = Supply(body)
    channel = body.channels[0]
    supply.draw(3.0)
    fired = supply.fire(channel_pulse(channel, 10.0, 1.0), channel)
    used = 3.0 + 0.5 * (channel.mass_flow or 0.0)
    center = np.array([0.1, 0.0, 0.4 - 0.05 * used])
    expected = np.cross(np.array([0.1, 0.5, 1.2]) - center, [0.0, -10.0, 0.0])
    assert body.inertia.axes @ present(fired.torque) == pytest.approx(expected, abs=1e-12)


def test_plans_are_corrected_for_its_travel() -> None:
    """Propellant of a thousandth of the isp: the arm changes by a tenth within a plan."""
    body = nutdamp.read(MOVING.replace("isp: 220 s", "isp: 0.5 s"))
    plan = nutdamp.plan(body, "four-pulse")
    assert present(plan.flown).nutation < 1e-6
    sizes = {
        round(float(np.linalg.norm(pulse.torque)), 6)
        for pulse in plan.pulses
        if pulse.torque is not None
    }
    assert len(sizes) == len(plan.pulses)
    fixed = flown(
        body,
        Schedule(
            tuple(
                channel_pulse(body.channels[int(pulse.channel == "N")], pulse.t, pulse.on_time)
                for pulse in plan.pulses
            )
        ),
    )
    assert fixed.residual.nutation > 1e-4


def test_a_file_carried_on_has_it_where_it_is_then() -> None:
    plan = nutdamp.plan(nutdamp.read(MOVING), "four-pulse")
    used = plan.propellant or 0.0
    carried = plan.carried()
    assert used > 0.0
    assert carried.center_of_mass == pytest.approx([0.1, 0.0, 0.4 - 0.05 * used], abs=1e-12)
    assert later(plan._flight, plan.end).after.center_of_mass == pytest.approx(
        [0.1, 0.0, 0.4 - 0.05 * used]
    )


def test_dispersed_it_moves_all_arms_alike() -> None:
    body = nutdamp.read(TEXT + "dispersions: {center_of_mass: {normal: 2 mm}}\n")
    plan = nutdamp.plan(body, "four-pulse")
    model = DispersedModel(body, plan.pulses)
    assert [entry.name for entry in model.inputs.drawn] == [
        f"center of mass {axis}" for axis in "xyz"
    ]
    off = np.array([0.01, -0.02, 0.03])
    draws = {
        f"center of mass {axis}": np.array([value]) for axis, value in zip("xyz", off, strict=True)
    }
    cases = model.cases(draws)
    for pulse, impulse in zip(plan.pulses, cases.impulses, strict=True):
        shifted = nutdamp.read(
            TEXT.replace("[0.1 m, 0, 40 cm]", f"[{0.1 + off[0]}, {off[1]}, {0.4 + off[2]}]")
        )
        channel = next(each for each in shifted.channels if each.name == pulse.channel)
        assert np.concatenate([np.atleast_1d(part) for part in impulse]) == pytest.approx(
            channel.torque * pulse.on_time
        )


# --- bounds: what keeps them and how much of them is used, and the tolerance of a spin that is
# required

CONE = Keep("star", np.array([1.0, 0.0, 0.0]), 0.1, 0.5)


def test_no_more_than_all_of_a_bound_that_is_kept_is_used() -> None:
    """Also over cases; edges of cones may be passed by rounding."""
    inner, outer = cones(replace(spinner(), keep=(CONE,)))
    end = Bound(Part.NUTATION, 0.2, True)
    for bound, kept, broken in (
        (end, (0.0, 0.1, 0.2), (0.2 + 1e-8, 3.0)),
        (inner, (3.0, 0.1, 0.1 - 0.9 * SLACK), (0.1 - 1.1 * SLACK, 0.0)),
        (outer, (0.0, 0.5, 0.5 + 0.9 * SLACK), (0.5 + 1.1 * SLACK, 3.0)),
    ):
        values = np.array([*kept, *broken])
        expected = [True] * len(kept) + [False] * len(broken)
        assert (
            bound.met(values).tolist() == expected == [bool(bound.met(value)) for value in values]
        )
        assert (bound.used(values) <= 1.0).tolist() == expected
        assert (bound.margin(values) >= -SLACK).tolist() == expected
    assert (inner.part, inner.inner, outer.inner) == (Part.CONE, True, False)
    (way,) = cones(replace(spinner(), keep=(Keep("H", None, most=0.3),)))
    assert (way.part, way.limit) == (Part.DURING, 0.3)


@pytest.mark.parametrize(
    ("goal", "tolerance", "size"),
    [
        (3.0, None, 0.03),  # 1 % of the goal
        (-3.0, None, 0.03),
        (3.0, SpinTolerance(0.005), 0.015),
        (3.0, SpinTolerance(0.1, relative=False), 0.1),
        (0.0, None, 0.02),  # of a halt: of the spin at t = 0
    ],
)
def test_a_spin_is_required_within_one_percent_of_the_goal_unless_the_file_says_otherwise(
    goal: float, tolerance: SpinTolerance | None, size: float
) -> None:
    requirement = Requirement(spin=tolerance)
    body = replace(spinner(spin=2.0, requirement=requirement), goal=Goal(spin=goal))
    (bound,) = required(body)
    assert (bound.part, bound.required) == (Part.SPIN, True)
    assert bound.limit == pytest.approx(size)
    for off, meets in ((-1.01, False), (-0.99, True), (0.0, True), (0.99, True), (1.01, False)):
        made = judged("a", 0.0, required=requirement, goal=body.goal, spin=goal + off * size)
        assert replace(made, spacecraft=body).meets_requirement is meets
        near = replace(body, omega0=np.array([0.0, 0.0, goal + off * AIMED_SPIN * size]))
        assert goal == 0.0 or spins_at(near, goal) is meets
    assert spin_tolerance(replace(body, requirement=None), 5.0) == 0.05


# --- goal by the Sun


@given(st.floats(0.0, 1.0), st.integers(0, 1000))
def test_no_axis_at_a_sun_angle_is_nearer_than_that_on_the_great_circle(
    share: float, seed: int
) -> None:
    """Brute force over the cone, in steps of a quarter of a degree."""
    draw = np.random.default_rng(seed)
    sun, north = draw.normal(size=(2, 3))
    sun /= np.linalg.norm(sun)
    angle = math.pi * share
    body = replace(spinner(), attitude=Attitude(attitude.unit(draw.normal(size=4))), sun=sun)
    axis = directions.at_sun_angle(body, angle)
    assert np.linalg.norm(axis) == pytest.approx(1.0, abs=1e-14)
    assert reference.angle(axis, sun) == pytest.approx(angle, abs=1e-7)
    across = attitude.unit(np.cross(sun, north))
    about = np.linspace(0.0, 2.0 * math.pi, 1441)[:, None]
    around = np.cos(about) * across + np.sin(about) * np.cross(sun, across)
    cone = math.cos(angle) * sun + math.sin(angle) * around
    momentum = attitude.unit(body.momentum)
    assert momentum @ axis >= (cone @ momentum).max() - 1e-14


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(
    ("sun", "side"),
    [([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0])],
)
def test_with_h_along_the_sun_the_axis_goes_north(
    way: float, sun: list[float], side: list[float]
) -> None:
    body = spinner()
    along = attitude.unit(body.inertia.momentum(body.omega0))
    towards = way * np.array(sun)
    turn = frames.about_axis(along, np.array([1.0, 0, 0]), towards, np.array([0, 1.0, 0]), 0.3)
    body = replace(body, attitude=Attitude(turn), sun=np.array(sun))
    expected = math.cos(1.0) * np.array(sun) + math.sin(1.0) * np.array(side)
    assert directions.at_sun_angle(body, 1.0) == pytest.approx(expected, abs=1e-12)
