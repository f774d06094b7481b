"""Turns to a target axis: trains of pulses at a fixed inertial phase, two pulses, half cones."""

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
    events,
    fan,
    off_target,
    one_of,
    present,
    spinner,
)
from support.cases import spread
from support.checker import feasible_by, left
from support.golden import check_text
from support.places import case

from nutdamp.files.reader import example_text, load_spacecraft, read_spacecraft
from nutdamp.physics import precession
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import infeasibility
from nutdamp.planning.notes import plan_notes
from nutdamp.schemes.catalogue import Options, RhumbLineOptions
from nutdamp.schemes.correction import model_of
from nutdamp.spacecraft import directions
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Attitude, Limits, Spacecraft
from nutdamp.spacecraft.schedule import Schedule

TURN = 2.0 * math.pi / 3.0
"""s of the bodies here."""


def still(
    A: float = 120.0, C: float = 80.0, tilt: float = 20.0, azimuth: float = 0.0, **parts: Any
) -> Spacecraft:
    """A pure spin to be turned."""
    return aimed(spinner(A, C, degrees=0.0, **parts), tilt, azimuth)


def train(spacecraft: Spacecraft, *, near: float = 1e-9, **options: Any) -> planning.Plan:
    """The plan, which by the reference ends on target, with equal pulses behind the damping."""
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
            limits=Limits(
                earliest=2.0, gap=3.0, blackout=((8.0, 15.0), (20.0, 21.0)), horizon=200.0
            ),
        ),
        spinner(
            moments=(100.0, 116.0, 140.0),
            degrees=0.0,
            channels=cross(20.0),
            limits=Limits(horizon=400.0),
        ),
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
    """Along the great circle equal pulses cost C|ω3|β over sinc(ω3τ/2), and what is left of a pulse
    and two to spare.

    Their phases alone bring the nutation to nothing, which takes the pulses to spare.
    """
    body = still(tilt=60.0, channels=cross(torque), limits=Limits(horizon=2000.0))
    made = feasible_by("rhumb-line", body, Options(on_time=on_time)).pulses
    assert {pulse.on_time for pulse in made} == {on_time}
    turned = sum(pulse.magnitude * precession.arc_efficiency(3.0, pulse.on_time) for pulse in made)
    assert 1.0 < turned / body.turning_impulse < 1.0 + 3.0 / len(made)


@pytest.mark.deep
def test_fewer_pulses_than_close_by_themselves_are_trimmed_to_close() -> None:
    """The example to 14 deg: 53 pulses of 0.1328 s were made of 0.2 s before, where 42 do."""
    example = read_spacecraft(example_text(), "example.yaml")
    for azimuth, most in ((0.0, 42), (90.0, 33)):
        assert len(train(aimed(example, 14.0, azimuth), on_time=0.2).pulses) <= most


@pytest.mark.deep
def test_on_ticks_the_width_is_one_of_them_and_starts_leave_little() -> None:
    """What is left is the rounding of starts: 10 ms turn a pulse by 1.7 deg, of its 0.7 deg."""
    body = still(
        tilt=12.0, azimuth=45.0, channels=cross(20.0), limits=Limits(horizon=400.0, tick=0.01)
    )
    for on_time in (None, 0.15):
        plan = train(body, on_time=on_time, near=math.radians(0.05))
        ticks = np.array([pulse.on_time for pulse in equal(plan)]) / 0.01
        assert ticks == pytest.approx(np.rint(ticks), abs=1e-9)
        assert plan.pulses.total_impulse < 1.1 * body.turning_impulse
    check_text("rhumb.no-tick", why_not(body, on_time=0.152))


@pytest.mark.weekly
@spread(
    ("degrees", "turn", "on_time"),
    [(0.5, 4.0, 0.2), (2.0, 6.0, 0.3), (1.0, 3.0, 0.1)],
    quick=1,
    deep=2,
)
def test_pulses_that_damp_make_up_for_unequal_moments_where_the_width_is_given(
    degrees: float, turn: float, on_time: float
) -> None:
    """By the last eight starts alone the end was off by up to 0.2 deg; what is left is said."""
    channels = tuple(
        channel(name, torque, 0.0, 0.0, max_on_time=0.4)
        for name, torque in (("P", 8.0), ("N", -8.0))
    )
    body = spinner(
        moments=(105.0, 135.0, 180.0),
        degrees=degrees,
        channels=channels,
        limits=Limits(horizon=600.0),
    )
    plan = train(aimed(body, turn, 45.0), on_time=on_time)
    assert {pulse.on_time for pulse in equal(plan)} == {on_time}
    assert "fixed-length" not in codes(plan_notes(plan))
    cut = replace(plan, schedule=replace(plan.pulses, pulses=plan.pulses.pulses[:-1]))
    off = math.degrees(max(present(cut.flown).nutation, present(cut._left).aim))
    assert one_of(plan_notes(cut), "fixed-length")["off_deg"] == pytest.approx(off)


@spread("per_turn", [1, 2, 3], quick=1)
def test_pulses_come_once_or_more_in_each_turn(per_turn: int) -> None:
    body = still(tilt=20.0, azimuth=45.0, channels=fan(3, 30.0))
    made = feasible_by("rhumb-line", body, Options(per_turn=per_turn)).pulses
    assert np.mean(np.diff([one.t for one in made])) == pytest.approx(TURN / per_turn, rel=0.05)
    assert len({pulse.channel for pulse in made}) == per_turn


@spread(("A", "C"), [(120.0, 80.0), (80.0, 120.0), (100.0, 93.0)], quick=1)
def test_equal_pulses_once_a_turn_leave_no_more_nutation_than_the_bound(A: float, C: float) -> None:
    """(angle per pulse)/|sin πa|, and the count chosen closes, by the reference integrator."""
    body = still(A, C, 10.0, channels=cross(20.0), limits=Limits(horizon=400.0))
    pulses = feasible_by("rhumb-line", body).pulses.pulses
    bound = pulses[0].magnitude / (C * 3.0) / abs(math.sin(math.pi * (1 - C / A)))
    start = reference.Motion(body.omega0, np.eye(3))
    starts = [pulse.start for pulse in pulses[1:]]
    motions = reference.path((A, A, C), start, events(pulses), starts)
    nutations = [reference.nutation((A, A, C), one.rates, 1.0) for one in motions]
    assert 0.7 * bound < max(nutations) < 1.02 * bound  # it is reached, so the bound is no idle one


def test_where_there_is_no_train_the_reason_is_said() -> None:
    """Pulses that meet the nutation in one phase, too little time, impossible lengths."""
    short: dict[str, Any] = {
        "channels": cross(60.0),
        "limits": Limits(horizon=60.0),
    }  # in 400 s C = 0.995 A closes
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
    """Small steps on the course at each point end on the target after the reported way."""
    here, target, sun = (
        axis / np.linalg.norm(axis) for axis in np.random.default_rng(seed).normal(size=(3, 3))
    )
    _, way = precession.course(here, target, sun)
    steps = 4000
    courses = []
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
    sun = directions.direction_in_n(body, math.radians(40.0), math.radians(60.0))
    direct, rhumb = train(body), train(replace(body, goal=replace(body.goal, sun=sun)))
    assert rhumb.pulses.total_impulse > 1.02 * direct.pulses.total_impulse
    assert [codes(plan_notes(plan))[0] for plan in (direct, rhumb)] == [*TRAINS]


@spread(
    ("turns", "pulses", "torque", "fixed"),
    [(2, 2, 15, False), (3, 2, 15, True), (8, 6, 5, True)],
    deep=2,
)
def test_in_a_short_horizon_pulses_are_long_but_less_than_half_a_turn(
    turns: int, pulses: int, torque: float, fixed: bool
) -> None:
    """Of the default length, a tenth of a turn or so, they would not reach the target in time.

    What a pulse adds in its second half of a turn it takes away from the first.
    """
    actuators: dict[str, Any] = (
        {"channels": cross(torque)} if fixed else {"steerable": Steerable(torque)}
    )
    made = train(
        still(80.0, 120.0, 3.0, 45.0, limits=Limits(horizon=turns * TURN), **actuators)
    ).pulses
    assert len(made) == pulses
    assert all(0.35 * TURN < pulse.on_time < 0.5 * TURN for pulse in made)


def test_ideal_impulses_turn_a_few_degrees_each_where_there_are_too_few_moments() -> None:
    """Of a heavy body as of a light one."""
    for size in (1.0, 300.0):
        body = still(
            120.0 * size, 80.0 * size, 30.0, steerable=Steerable(), limits=Limits(horizon=0.5)
        )
        said = infeasibility(planning.plan(body, "rhumb-line"))
        assert re.search(r"takes 15 pulses", said), said


# --- two pulses and half cones to a target axis: exact from any motion, the free numbers for least
# impulse

BODIES = [(120.0, 80.0), (80.0, 120.0), (100.0, 100.0), (60.0, 119.0)]
TARGETS = [(1.0, 10.0), (10.0, 45.0), (60.0, -120.0), (120.0, 200.0)]


def floor(spacecraft: Spacecraft) -> float:
    return max(spacecraft.least_impulse, spacecraft.turning_impulse)


def acquired(
    spacecraft: Spacecraft,
    scheme: str = "two-pulse",
    *,
    cones: int | None = None,
    by_reference: bool = True,
) -> Schedule:
    """What ends on the target without nutation, as flown and by the reference."""
    plan = feasible_by(scheme, spacecraft, Options(cones=cones) if cones else None)
    assert len(plan.pulses) <= 2 or scheme != "two-pulse"
    assert max(left(plan).nutation, left(plan).axis_error) < 1e-9
    if by_reference:
        assert Outcome(spacecraft, plan.pulses).nutation < 1e-9
        assert off_target(spacecraft, plan.pulses) < 1e-9
    return plan.pulses


@spread("spin", [3.0, -3.0], quick=1)
@spread(("A", "C"), BODIES, quick=1)
@spread(("tilt", "azimuth"), TARGETS, quick=12)
def test_any_axis_from_any_nutation(
    tilt: float, azimuth: float, A: float, C: float, spin: float
) -> None:
    for degrees in (0.0, 1.0, 5.0, 20.0, 60.0):
        spacecraft = aimed(spinner(A, C, spin, degrees), tilt, azimuth)
        made = acquired(spacecraft, by_reference=degrees in (0.0, 5.0, 60.0))
        assert made.total_impulse >= floor(spacecraft) * (1 - 1e-12)


@pytest.mark.parametrize(("A", "C"), BODIES)
def test_back_to_h_is_the_damping_without_drift(A: float, C: float) -> None:
    """A target along H: half the nutation, half a turn, A|ω0| in all."""
    for degrees in (1.0, 10.0, 45.0):
        plain = spinner(A, C, degrees=degrees)
        (first, second), made = (
            planning.plan(plain, "two-pulse").pulses,
            acquired(aimed(plain, 0.0, 0.0)),
        )
        assert made.total_impulse == pytest.approx(plain.least_impulse, rel=1e-12)
        assert made.pulses[1].t - made.pulses[0].t == pytest.approx(second.t - first.t, rel=1e-12)
        assert [one.magnitude for one in made] == pytest.approx(
            [first.magnitude, second.magnitude], rel=1e-9
        )


@spread("spin", [3.0, -3.0], quick=1)
@spread(("A", "C"), BODIES[:3], quick=1)
@spread("cones", [1, 3, 2, 5, 8], quick=2, deep=1)
def test_from_a_pure_spin_cones_cost_the_closed_form(
    cones: int, A: float, C: float, spin: float
) -> None:
    """2n C|ω3| tan(β/2n) in n + 1 pulses, half an inertial turn of the small cone apart."""
    for tilt in (0.1, 1.0, 30.0, 100.0):
        half = math.radians(tilt) / (2 * cones)
        wait = math.pi * A * math.cos(half) / (C * 3.0)
        for scheme in ("half-cone", "two-pulse") if cones == 1 else ("half-cone",):
            spacecraft = aimed(spinner(A, C, spin, 0.0), tilt, 45.0)
            made = acquired(
                spacecraft,
                scheme,
                cones=cones if scheme == "half-cone" else None,
                by_reference=tilt > 30,
            )
            assert len(made) == cones + 1
            assert made.pulses[0].t == 0.0
            assert made.total_impulse == pytest.approx(
                2 * cones * C * 3.0 * math.tan(half), rel=1e-10
            )
            assert np.diff([one.t for one in made]) == pytest.approx([wait] * cones, rel=1e-5)


def test_more_cones_cost_less_down_to_the_floor_and_as_many_are_taken_as_are_worth_it() -> None:
    """One more would save less than 1 %."""
    h = 240.0
    angle = math.radians(60.0)
    costs = [precession.half_cones_impulse(h, angle, cones) for cones in range(1, 200)]
    assert costs == sorted(costs, reverse=True)
    assert costs[0] == pytest.approx(2 * h * math.tan(math.radians(30.0)), rel=1e-15)
    assert h * angle < costs[-1] < h * angle * (1 + 1e-5)
    for tilt, cones in ((5.0, 1), (10.0, 1), (60.0, 3), (120.0, 4)):
        fewer, taken, more = (
            precession.half_cones_impulse(h, math.radians(tilt), max(number, 1))
            for number in range(cones - 1, cones + 2)
        )
        assert (
            len(feasible_by("half-cone", aimed(spinner(degrees=0.0), tilt, 0.0)).pulses)
            == cones + 1
        )
        assert more > 0.99 * taken
        assert cones == 1 or taken <= 0.99 * fewer


@spread(
    ("A", "C", "spin", "torque", "tilt", "cones"),
    [
        (
            100.0,
            150.0,
            -1.0,
            18.0,
            60.0,
            (6, 8, 12, 20),
        ),  # of half-cone-many.yaml: 8 cones take 85.3 g, 12 take 82.8 g
        (100.0, 150.0, -1.0, 36.0, 60.0, (4, 6, 10, 20)),
        (120.0, 80.0, 3.0, 60.0, 40.0, (5, 9)),
        (100.0, 100.0, 2.0, 50.0, 100.0, (10, 14)),
    ],
    quick=1,
    deep=3,
)
def test_cones_of_a_torquer_near_its_reach_are_alike(
    A: float, C: float, spin: float, torque: float, tilt: float, cones: tuple[int, ...]
) -> None:
    """2J of first and last and each half between, J = 2M/ω asin(ωh tan δ/2M): at most equals."""
    h = C * abs(spin)
    rate = 0.5 * abs(spin)
    taken = []
    body = aimed(
        spinner(A, C, spin, 0.0, steerable=Steerable(torque), limits=Limits(horizon=2000.0)),
        tilt,
        40.0,
    )
    for number in cones:
        jump = h * math.tan(math.radians(tilt) / (2 * number))
        one, two = (torque / rate * math.asin(rate * turn / torque) for turn in (jump, 2.0 * jump))
        taken.append(acquired(body, "half-cone", cones=number, by_reference=False).total_impulse)
        assert 0.97 < taken[-1] / (2.0 * one + (number - 1) * two) < 1.005
    assert taken == sorted(taken, reverse=True)


@spread("degrees", [1.0, 5.0, 20.0], quick=1)
@spread(("tilt", "azimuth"), [(10.0, 45.0), (60.0, -120.0)], quick=1)
def test_cones_take_a_nutation_along(degrees: float, tilt: float, azimuth: float) -> None:
    """The first pulse jumps straight onto the first cone: no dearer than damping first."""
    spacecraft = aimed(spinner(degrees=degrees), tilt, azimuth)
    for cones in (1, 2, 4):
        cost = acquired(spacecraft, "half-cone", cones=cones).total_impulse
        farthest = precession.half_cones_impulse(240.0, math.radians(tilt + degrees), cones)
        assert floor(spacecraft) <= cost <= spacecraft.least_impulse + farthest


@pytest.mark.parametrize(
    ("degrees", "tilt", "azimuth"), [(5.0, 10.0, 45.0), (20.0, 60.0, 200.0), (40.0, 15.0, -90.0)]
)
def test_both_free_numbers_are_the_best_on_a_grid(
    degrees: float, tilt: float, azimuth: float
) -> None:
    """Start anywhere on the cone, H on the line of equal distance: written out once more."""
    spacecraft = aimed(spinner(degrees=degrees), tilt, azimuth)
    h = 80.0 * 3.0
    target = spacecraft.target_axis
    momentum = spacecraft.momentum
    pole = momentum / np.linalg.norm(momentum)
    east = np.array([0.0, 1.0, 0.0])
    theta = math.radians(degrees)
    best = math.inf
    for phase in np.linspace(0.0, 2 * math.pi, 721):
        across = math.cos(phase) * np.cross(east, pole) + math.sin(phase) * east
        spin_axis = math.cos(theta) * pole + math.sin(theta) * across
        line = np.cross(spin_axis, target)
        foot = np.linalg.lstsq(np.vstack([spin_axis, target]), np.array([h, h]), rcond=None)[0]
        places = np.linspace(-2.0, 2.0, 801)[:, None] * h * line / np.linalg.norm(line) + foot
        cost = np.linalg.norm(places - momentum, axis=1) + np.linalg.norm(
            places - h * target, axis=1
        )
        best = min(best, float(cost.min()))
    assert (
        best * (1 - 1e-4) <= acquired(spacecraft).total_impulse <= best * (1 + 1e-12)
    )  # the grid comes near
    if degrees == 5.0:  # literally the target is left alone
        literal = planning.plan(spacecraft, "two-pulse", Options(literal=True))
        assert left(literal).axis_error == pytest.approx(math.radians(tilt), abs=1e-2)


def test_ticks_leave_no_more_than_their_resolution() -> None:
    body = aimed(spinner(steerable=Steerable(200.0), limits=Limits(tick=1e-3)), 10.0, 45.0)
    residual = left(feasible_by("two-pulse", body))
    most = 2 * 3.0 * 1e-3 * math.radians(15.0) + 200.0 * 1e-3 / (80.0 * 3.0)
    assert max(residual.nutation, residual.axis_error) < most


ON_CONE = aimed(spinner(channels=cross(500.0)), 5.0, 45.0)
"""A target on the cone of the spin axis itself: a real pulse has two widths to trim."""

REACHED = [
    ("two-pulse", None, aimed(spinner(steerable=Steerable(100.0)), 5.0, 45.0), math.inf),
    ("two-pulse", None, ON_CONE, math.inf),
    # On a sphere ω stands still in the body, but from a pure spin nothing has to be waited for.
    (
        "two-pulse",
        None,
        aimed(spinner(100.0, 100.0, degrees=0.0, channels=cross(500.0)), 10.0, 45.0),
        math.inf,
    ),
    # 8 N m take 5° of nutation out within half a body period; they turn H by next to nothing
    # meanwhile.
    *(
        ("two-pulse", None, aimed(spinner(channels=cross(8.0)), tilt, 45.0), math.inf)
        for tilt in (0.0, 0.5)
    ),
    # Or by 1.3° at most in one pulse: 5° of nutation are 21 N m s, and damped first.
    (
        "half-cone",
        None,
        aimed(spinner(channels=cross(8.0, max_on_time=2.0)), 10.0, 45.0),
        math.inf,
    ),
    *(
        ("two-pulse", None, aimed(spinner(limits=limits), 10.0, 45.0), math.inf)
        for limits in (
            Limits(earliest=3.3),
            Limits(blackout=((0.0, 2.0), (3.0, 5.5))),
            Limits(gap=4.0),
            Limits(blackout=tuple((0.9 * n + 0.2, 0.9 * n + 0.9) for n in range(100))),
            Limits(horizon=2.2),
        )
    ),
    (
        "half-cone",
        None,
        aimed(
            spinner(
                limits=Limits(
                    earliest=1.0, gap=0.4, blackout=((2.0, 4.0), (6.0, 6.5)), max_pulses=5
                )
            ),
            40.0,
            45.0,
        ),
        math.inf,
    ),
    *(  # channels of cones wait for their phase
        (
            "half-cone",
            cones,
            aimed(spinner(degrees=degrees, channels=jets), 30.0, -120.0),
            1.2,
        )
        for cones in (1, 2, 5)
        for degrees in (0.0, 5.0)
        for jets in (cross(500.0), fan(3, 500.0))
    ),
    *(
        (
            "two-pulse",
            None,
            aimed(spinner(A, C, spin, degrees, channels=jets), tilt, azimuth),
            1.3,
        )
        for A, C in BODIES[:2]
        for spin in (3.0, -3.0)
        for degrees, tilt, azimuth in ((0.0, 5.0, 70.0), (5.0, 10.0, 45.0), (20.0, 40.0, -120.0))
        for jets in (cross(500.0), fan(3, 800.0))
    ),
    *(  # real widths are trimmed
        (
            "two-pulse",
            None,
            aimed(spinner(A, C, degrees=degrees, steerable=Steerable(torque)), 8.0, 45.0),
            1.5,
        )
        for A, C in BODIES[:3]
        for degrees in (0.0, 5.0)
        for torque in (500.0, 80.0)
    ),
    *(
        (
            "half-cone",
            None,
            aimed(spinner(degrees=degrees, steerable=Steerable(60.0)), 15.0, 45.0),
            math.inf,
        )
        for degrees in (0.0, 5.0)
    ),
]


@spread(("scheme", "cones", "body", "most"), REACHED, quick=12, deep=20)
def test_targets_are_reached_within_limits(
    scheme: str, cones: int | None, body: Spacecraft, most: float
) -> None:
    """Exactly, at no more than ``most`` times the floor."""
    made = acquired(body, scheme, cones=cones)
    assert cones is None or len(made) == cones + 1
    assert made.total_impulse < most * floor(body)


def test_why_not() -> None:
    """What one pulse can do is said, 2M/|ω3|; and that damping first leaves no time."""
    weak = channel("+1", 1.0, 0.0, 0.0)
    late: dict[str, Any] = {
        "channels": (
            channel("T0", -0.0002798774275361531, -9.312022413487486e-05, 0.0, min_on_time=0.12),
            channel("T1", 0.0002781184471714144, 9.824907088693092e-05, 0.0),
        ),
        "limits": Limits(horizon=8.41668748101266, gap=0.6011919629294757),
    }
    no_time = spinner(
        2.373744652338654, 2.6800748046618628, -0.462832262592392, 0.05, 0.3283535213204525, **late
    )
    torquer = spinner(degrees=0.0, steerable=Steerable(10.0))
    plans = [
        planning.plan(body, scheme, Options(cones=cones))
        for scheme, cones, body in (
            ("two-pulse", None, aimed(torquer, 40.0, 0.0)),
            ("two-pulse", None, aimed(spinner(degrees=0.0, channels=(weak,)), 10.0, 45.0)),
            (
                "two-pulse",
                None,
                aimed(spinner(degrees=0.0, channels=cross(500.0, max_on_time=0.002)), 10.0, 45.0),
            ),
            (
                "two-pulse",
                None,
                aimed(spinner(channels=(channel("spin", 1.0, 0.0, 5.0),)), 10.0, 45.0),
            ),
            ("half-cone", None, spinner()),
            ("half-cone", 3, aimed(spinner(limits=Limits(max_pulses=3)), 40.0, 10.0)),
            ("half-cone", None, aimed(spinner(limits=Limits(horizon=1.0)), 40.0, 10.0)),
            ("half-cone", None, aimed(no_time, 0.05, 197.04)),
        )
    ]
    assert f"{math.degrees(math.atan(2.0 * 10.0 / 3.0 / 240.0)):.4g} deg at most" in infeasibility(
        plans[0]
    )
    check_text("pointing.why-not", "\n".join(infeasibility(plan) for plan in plans))


@pytest.mark.parametrize(
    "moments", [(120.0, 110.0, 80.0), (80.0, 85.0, 120.0)], ids=["prolate", "oblate"]
)
def test_three_different_moments(moments: tuple[float, float, float]) -> None:
    for actuators in ({"steerable": Steerable(500.0)}, {"channels": cross(500.0)}):
        acquired(aimed(spinner(moments=moments, degrees=4.0, **actuators), 6.0, 45.0))
    truth = aimed(
        spinner(moments=(120.0, 100.0, 80.0)), 10.0, 45.0
    )  # the model has the turn that the body has
    model = model_of(truth).symmetric
    assert model.to_turn == pytest.approx(truth.to_turn, rel=1e-12)
    shifts = [
        one.target_axis - one.momentum / np.linalg.norm(one.momentum) for one in (model, truth)
    ]
    assert reference.angle(*shifts) < 0.05
    assert model.initial.quaternion == pytest.approx(truth.initial.quaternion, abs=1e-12)


def test_a_target_by_right_ascension_in_a_given_attitude() -> None:
    """The same body seen from another frame: the same pulses."""
    plain = aimed(spinner(), 10.0, 45.0)
    turned = replace(plain, attitude=Attitude(np.array([0.5, 0.5, -0.5, 0.5])))
    turned = replace(
        turned,
        goal=replace(
            plain.goal, axis=directions.direction_in_n(turned, math.radians(10), math.radians(45))
        ),
    )
    pairs = zip(
        feasible_by("two-pulse", plain).pulses, feasible_by("two-pulse", turned).pulses, strict=True
    )
    for one, other in pairs:
        assert other.t == pytest.approx(one.t, abs=1e-6)
        assert other.impulse == pytest.approx(one.impulse, abs=1e-4)


def test_arc_efficiency_is_the_mean_of_the_turning_torque_and_on_time_its_inverse() -> None:
    mean = abs(np.exp(3j * (np.arange(200_000) + 0.5) / 200_000 * 0.6).mean())
    assert precession.arc_efficiency(3.0, 0.6) == pytest.approx(mean, rel=1e-9)
    assert precession.arc_efficiency(0.0, 0.6) == 1.0
    enough, too_far = precession.on_times_to_turn(np.array([40.0 * 0.6 * mean, 100.0]), 40.0, -3.0)
    assert enough == pytest.approx(0.6, rel=1e-9)
    assert np.isnan(too_far)


@pytest.mark.parametrize("name", ["crash-target-is-spin-axis", "crash-tilt-equals-nutation"])
@pytest.mark.parametrize("scheme", ["two-pulse", "half-cone", "rhumb-line"])
def test_a_target_that_the_spin_axis_meets_by_itself_takes_one_impulse_when_it_is_there(
    name: str, scheme: str
) -> None:
    """At t = 0, or on its way about H a quarter turn later: damped then and there, at A|ω0|."""
    body = load_spacecraft(case(f"{name}.yaml"))
    quarters = float("tilt" in name)
    made = planning.plan(body, scheme).pulses
    moments = np.asarray(body.inertia.moments)
    (pulse,) = made
    round_h = 2.0 * math.pi * moments[0] / float(np.linalg.norm(moments * body.omega0))
    assert pulse.t == pytest.approx(0.25 * quarters * round_h, abs=1e-9)
    assert pulse.magnitude == pytest.approx(body.least_impulse, rel=1e-9)
    after = reference.fly(body.inertia.moments, body.omega0, events(made), made.end + 1.0)
    tilt = math.radians(5.0)
    azimuth = 0.5 * math.pi * quarters
    target = np.array(
        [math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)]
    )
    assert reference.angle(after.rotation[:, 2], target) < 1e-8
    assert reference.angle(reference.momentum(body.inertia.moments, after), target) < 1e-8
