"""How near the spin axis comes to directions in space, against the reference integrator; and plans that keep cones."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support import reference
from support.builders import aimed, cross, events, spinner
from support.cases import spread
from support.process import Run
from support.spinners import commanded

from nutdamp import planning, remarks
from nutdamp.aspect import aspects
from nutdamp.flight import by_impulses, flown
from nutdamp.physics import attitude
from nutdamp.schedule import Pulse, Schedule
from nutdamp.spacecraft import Keep, Limits, Spacecraft

Array = NDArray[np.float64]

DENSE = 60
"""Samples of the reference in each turn of the axis, and between two edges of pulses."""


def pulse(t: float, on_time: float, impulse: Array) -> Pulse:
    return Pulse(t, on_time, "T", impulse, impulse / on_time if on_time > 0.0 else None)


def direction(rng: np.random.Generator) -> Array:
    some_way = rng.normal(size=3)
    return np.asarray(some_way / np.linalg.norm(some_way))


def axis_path(spacecraft: Spacecraft, made: Schedule, until: float, dense: int = DENSE) -> Array:
    """The spin axis (n, 3) from 0 to ``until`` s by the reference integrator, which is asked densely."""
    moments, sense = spacecraft.inertia.moments, math.copysign(1.0, spacecraft.spin)
    motion = reference.Motion(spacecraft.omega0, attitude.matrix(spacecraft.initial.quaternion))
    pushes = [one for one in events(made) if isinstance(one, reference.Push)]
    edges = sorted({0.0, until, *(one.start for one in pushes), *(one.end for one in pushes)})
    path = [motion.rotation[:, 2] * sense]
    for begin, end in pairwise(edges):
        torque = sum((one.torque for one in pushes if one.start < 0.5 * (begin + end) < one.end), np.zeros(3))
        count = dense * max(1, math.ceil((end - begin) / spacecraft.inertial_period))
        found = reference.coast(moments, motion, torque, np.linspace(begin, end, count + 1)[1:] - begin)
        path += [one.rotation[:, 2] * sense for one in found]
        motion = found[-1]
    return np.array(path)


@pytest.mark.parametrize("shape", [(120.0, 80.0), (80.0, 120.0), (100.0, 100.0), (80.0, 160.0)])
@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_in_free_motion_the_axis_stays_within_its_cone_about_H(shape: tuple[float, float], spin: float) -> None:
    """Seen from a direction β away from H: from |β - θ| to β + θ, since by default it goes round once."""
    body = spinner(*shape, spin=spin, degrees=7.0)
    for beta in (0.0, 3.0, 7.0, 50.0, 120.0, 180.0):
        keep = Keep("beacon", body.direction_in_n(math.radians(beta), 0.4))
        (found,) = aspects(flown(replace(body, keep=(keep,)), Schedule()))
        assert math.degrees(found.least) == pytest.approx(abs(beta - 7.0) if beta < 173 else beta - 7.0, abs=2e-4)
        assert math.degrees(found.largest) == pytest.approx(min(beta + 7.0, 360.0 - beta - 7.0), abs=2e-4)


@spread("moments", [(120.0, 120.0, 80.0), (90.0, 90.0, 140.0), (120.0, 100.0, 70.0)], quick=1)
def test_with_pulses_they_are_those_of_the_reference_integrator(moments: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(5)
    for _ in range(4):
        body = spinner(moments=moments, spin=rng.choice([-2.0, 2.0]), degrees=rng.uniform(1.0, 12.0))
        body = replace(body, keep=(Keep("one", direction(rng)), Keep("two", direction(rng))))
        pulses = tuple(pulse(4.0 * k + 2.0, rng.uniform(0.1, 2.0), rng.normal(size=3) * 6.0) for k in range(3))
        made = Schedule(pulses)
        found = aspects(flown(body, made), 14.0)
        path = axis_path(body, made, 14.0, 400)
        for one in found:
            apart = attitude.angle_between(path, one.keep.direction)
            assert one.least == pytest.approx(apart.min(), abs=1e-4)
            assert one.largest == pytest.approx(apart.max(), abs=1e-4)
            assert one.least < apart.min() + 1e-6  # the reference is asked at other moments
            assert one.largest > apart.max() - 1e-6
            at = reference.fly(
                moments, body.omega0, events(made), one.least_at, attitude.matrix(body.initial.quaternion)
            )
            seen = reference.angle(at.rotation[:, 2] * math.copysign(1.0, body.spin), one.keep.direction)
            assert seen == pytest.approx(one.least, abs=1e-6)


def test_a_jump_of_the_rates_is_no_peak() -> None:
    """Under ideal impulses the axis turns a corner, where a parabola through three rows would miss."""
    body = spinner(degrees=2.0)
    body = replace(body, keep=(Keep("beacon", body.direction_in_n(0.3, 1.0)),))
    made = Schedule((pulse(1.0, 0.0, np.array([30.0, 5.0, 0.0])),))
    (found,) = aspects(by_impulses(body, made), 5.0)
    for model in (by_impulses(body, made, 5.0), flown(body, made, 5.0)):
        apart = attitude.angle_between(model.sampled(20_001, 5.0).axis, found.keep.direction)
        assert found.least == pytest.approx(apart.min(), abs=1e-6)
        assert found.largest == pytest.approx(apart.max(), abs=1e-6)


def test_nothing_is_watched_unless_the_file_says_so() -> None:
    assert aspects(flown(spinner(), Schedule())) == ()


def cones(body: Spacecraft, *keeps: Keep) -> Spacecraft:
    return replace(body, keep=keeps, limits=Limits(horizon=900.0))


def between(body: Spacecraft, share: float) -> Array:
    """A direction on the great circle from H to the target."""
    start = body.momentum / np.linalg.norm(body.momentum)
    mixed = (1.0 - share) * start + share * body.target_axis
    return np.asarray(mixed / np.linalg.norm(mixed))


TURNING = aimed(spinner(80.0, 120.0, degrees=0.2, channels=cross(8.0, max_on_time=0.3)), 12.0, 30.0)


@pytest.mark.weekly
@spread("scheme", ["optimal", "rhumb-line"], quick=1, deep=0)
def test_a_cone_on_the_way_is_gone_round(scheme: str) -> None:
    free = planning.plan(cones(TURNING), scheme)
    assert free.feasible
    body = cones(TURNING, Keep("Sun", between(TURNING, 0.5), least=math.radians(3.0)))
    straight = planning.judged(body, scheme, free.pulses, free.options)
    assert straight.astray is not None  # what is planned without the cone breaks it
    assert "from Sun" in remarks.infeasibility(straight)
    routed = planning.plan(body, scheme)
    assert routed.feasible, remarks.infeasibility(routed)
    assert routed.left is not None
    assert routed.left.aim < 1e-6
    (found,) = routed.aspects
    assert found.kept
    path = axis_path(body, routed.pulses, routed.end + body.inertial_period)
    assert attitude.angle_between(path, found.keep.direction).min() > math.radians(3.0)
    assert any("way point" in remark for remark in remarks.remarks(routed))
    # 12 deg straight; round a cone of 3 deg about its middle 13.4 deg, by one dog-leg.
    assert 1.0 < routed.total_impulse / free.total_impulse < 1.3


@pytest.mark.deep
def test_the_axis_may_be_held_within_a_cone() -> None:
    centre = between(TURNING, 0.5)
    plan = planning.plan(cones(TURNING, Keep("Earth", centre, most=math.radians(8.0))), "rhumb-line")
    assert plan.feasible
    assert plan.aspects[0].largest < math.radians(8.0)


def test_a_target_within_the_forbidden_cone_is_refused_with_the_angle() -> None:
    body = cones(TURNING, Keep("Sun", TURNING.target_axis, least=math.radians(1.0)))
    plan = planning.plan(body, "rhumb-line")
    assert not plan.feasible
    assert "from Sun" in remarks.infeasibility(plan)
    assert "min = 1°" in remarks.infeasibility(plan)


def test_damping_without_a_target_is_only_warned_of() -> None:
    body = spinner(channels=cross(8.0))
    body = replace(body, keep=(Keep("Sun", body.direction_in_n(0.05, 0.0), least=0.1),))
    plan = planning.plan(body, "four-pulse")
    assert plan.feasible
    assert any("warning: the spin axis comes to" in remark for remark in remarks.remarks(plan))


def some_case(seed: int) -> Spacecraft:
    """A spinner that is to turn by 5 to 60 deg past one or two cones near its way."""
    rng = np.random.default_rng(seed)
    A, spin = 10 ** rng.uniform(1, 3), rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 4.0)
    C = A * rng.choice([rng.uniform(0.3, 0.8), rng.uniform(1.2, 1.8)])
    turn, torque = rng.uniform(5.0, 60.0), C * spin**2 * rng.uniform(0.02, 0.2)
    body = spinner(
        A, C, spin, rng.uniform(0.0, 1.0), rng.uniform(0.0, 6.0), channels=cross(torque, max_on_time=0.3 / abs(spin))
    )
    body = aimed(body, turn, rng.uniform(0.0, 360.0))
    keeps = []
    for number in range(rng.integers(1, 3)):
        aside = np.cross(between(body, 0.0), body.target_axis) / math.sin(math.radians(turn))
        centre = between(body, rng.uniform(0.2, 0.8)) + math.radians(turn) * rng.uniform(-0.3, 0.3) * aside
        centre /= np.linalg.norm(centre)
        clear = min(float(attitude.angle_between(centre, end)) for end in (between(body, 0.0), body.target_axis))
        keeps.append(Keep(f"cone {number}", centre, least=clear * rng.uniform(0.2, 0.8)))
    return replace(body, keep=tuple(keeps), limits=Limits(horizon=2000.0 / abs(spin)))


def enters(seed: int) -> bool | None:
    """Whether a plan of the case comes into a cone by the reference integrator; None where none is feasible."""
    body = some_case(seed)
    plan = planning.plan(body, "rhumb-line")
    if not plan.feasible:
        return None
    path = axis_path(body, plan.pulses, plan.end + body.inertial_period)
    return any(attitude.angle_between(path, keep.direction).min() < keep.least - 1e-6 for keep in body.keep)


@pytest.mark.weekly
@pytest.mark.parametrize("seeds", [range(first, first + 10) for first in range(0, 160, 10)], ids=str)
def test_in_random_cases_the_axis_never_enters_a_cone(seeds: Sequence[int]) -> None:
    """160 cases; with the 40 below they are 200."""
    found = [enters(seed) for seed in seeds]
    assert True not in found
    assert found.count(None) <= 0.3 * len(found)


def near_case(seed: int) -> Spacecraft:
    """A spinner of strong channels, nutating by 0.2 deg, that is to turn by 2 to 12 deg past a cone near its way."""
    rng = np.random.default_rng(seed)
    A, spin, turn = 10 ** rng.uniform(1, 3), rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 4.0), rng.uniform(2.0, 12.0)
    C = A * rng.choice([rng.uniform(0.3, 0.8), rng.uniform(1.2, 1.8)])
    channels = cross(C * spin**2, max_on_time=0.3 / abs(spin))
    body = aimed(spinner(A, C, spin, 0.2, rng.uniform(0.0, 6.0), channels=channels), turn, rng.uniform(0.0, 360.0))
    aside = np.cross(between(body, 0.0), body.target_axis) / math.sin(math.radians(turn))
    centre = between(body, rng.uniform(0.2, 0.8)) + math.radians(turn) * rng.uniform(-0.4, 0.4) * aside
    centre /= np.linalg.norm(centre)
    clear = min(float(attitude.angle_between(centre, end)) for end in (between(body, 0.0), body.target_axis))
    keep = Keep("cone", centre, least=clear * rng.uniform(0.2, 0.8))
    return replace(body, keep=(keep,), limits=Limits(horizon=600.0 / abs(spin)))


def in_sunlight(seed: int) -> Spacecraft:
    """`some_case` with command blocks, and the Sun in view, well off the spin axis."""
    body, rng = some_case(seed), np.random.default_rng(1000 + seed)
    aside = np.cross(body.axis, direction(rng))
    return commanded(body, aside / np.linalg.norm(aside) + rng.uniform(-0.8, 0.8) * body.axis)


OTHERS = [(scheme, first) for first in range(0, 20, 2) for scheme in ("half-cone", "optimal")]


@pytest.mark.weekly
@pytest.mark.parametrize(("scheme", "first"), OTHERS)
def test_nor_does_it_by_other_schemes_that_turn_it(scheme: str, first: int) -> None:
    """40 cases in all, nutation on the way included; where no way round is found there is no plan."""
    for seed in (first, first + 1):
        check_never_within(near_case(seed), scheme)


@pytest.mark.weekly
def test_nor_by_command_blocks() -> None:
    assert check_never_within(in_sunlight(0), "command-block")


def check_never_within(body: Spacecraft, scheme: str) -> bool:
    """That the axis of a plan comes into no cone by the reference integrator; whether there is a plan."""
    plan = planning.plan(body, scheme)
    if not plan.feasible:
        return False
    path = axis_path(body, plan.pulses, plan.end + body.inertial_period)
    for keep in body.keep:
        assert attitude.angle_between(path, keep.direction).min() >= keep.least - 1e-6
    return True


FILE = """
name: Spinner
inertia: {A: 80 kg m^2, C: 120 kg m^2}
state: {spin: 30 rpm, nutation: 0.2 deg}
attitude: {epoch: 2026-03-20T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}
thrusters: [{name: T1, torque: [8, 0, 0], isp: 220 s, lever_arm: 1 m, max_on_time: 300 ms}]
limits: {horizon: 600 s}
sun: epoch
keep: [{name: pole star, direction: [10 deg, 86 deg], min: 2 deg}]
"""


@pytest.mark.weekly
def test_screens_and_json_show_how_near_the_axis_comes(run: Run, tmp_path: Path) -> None:
    shown = run("plan", "-", "--target", "10deg,80deg", "--scheme", "rhumb-line", "--json", "plan.json", stdin=FILE)
    assert shown.returncode == 0, shown.stderr
    assert "axis from pole star" in shown.stdout
    assert "(at least 2 deg)" in " ".join(shown.stdout.split())
    assert "axis from Sun" in shown.stdout
    (plan,) = json.loads((tmp_path / "plan.json").read_text(encoding="utf-8"))["plans"]
    star, sun = plan["aspects"]
    assert star["kept"]
    assert star["least_deg"] >= 2.0
    assert sun["least_deg"] > 60.0  # at the equinox the Sun is square to the pole
    simulated = run("simulate", "-", "--scheme", "none", "--until", "5s", stdin=FILE)
    assert "axis from Sun" in simulated.stdout


BROKEN = """
name: Breaker
inertia: {A: 120 kg m^2, C: 180 kg m^2}
state: {spin: 30 rpm, nutation: 3 deg, phase: 20 deg}
attitude: {epoch: 2026-03-20T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}
thrusters:
  - {name: T1, torque: [8, 0, 0], isp: 220 s, lever_arm: 1 m, max_on_time: 400 ms}
  - {name: T2, torque: [-8, 0, 0], isp: 220 s, lever_arm: 1 m, max_on_time: 400 ms}
requirement: {nutation: 0.5 deg}
keep: [{name: Star, direction: [0 deg, 86 deg], min: 4 deg, max: 60 deg}]
dispersions: {thrust: {normal: 5 %}}
"""


@pytest.mark.parametrize("scheme", ["one-pulse", "four-pulse"])
def test_no_screen_calls_the_requirement_met_where_a_cone_is_broken(run: Run, scheme: str) -> None:
    shown = run("plan", "-", "--scheme", scheme, stdin=BROKEN)
    assert shown.returncode == 4
    text = " ".join(shown.stdout.split())
    assert "it meets the requirement at the end." in text
    rows = [line.split() for line in shown.stdout.splitlines()]
    assert ["requirement:", "NOT", "met"] in rows
    assert any(row[:6] == ["from", "Star", "≥", "4", "deg", "✗"] for row in rows)
    assert any(row[:5] == ["from", "Star", "≤", "60", "deg"] and "✗" not in row for row in rows)


def test_disperse_shows_one_angle_of_the_nominal_case_and_no_warning_of_numpy(run: Run) -> None:
    """Thrust alone is dispersed: derivatives are of the pulses, and not of body or rates."""
    done = run("disperse", "-", "--scheme", "four-pulse", "--samples", "300", stdin=BROKEN)
    text = " ".join(done.stdout.split())
    assert "ComplexWarning" not in done.stderr
    least, largest = re.findall(r"axis from Star ✗ (\S+) deg at \S+ s to (\S+) deg", text)[0]
    assert f"{least} deg to {largest} deg in the nominal one." in text
