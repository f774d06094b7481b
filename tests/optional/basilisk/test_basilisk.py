"""Flights by Basilisk against `propagation.flown`, which agree to 1e-8 rad, and by its script."""

import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import messages
from support.builders import present
from support.cases import spread
from support.golden import refused

from nutdamp.errors import BadRequest, Infeasible, MissingExtra
from nutdamp.files.reader import example_text, read_spacecraft
from nutdamp.flight import propagation
from nutdamp.flight.basilisk import BasiliskFlight, fly
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.schemes import catalogue, planner
from nutdamp.spacecraft.equipment import Channel, Thruster
from nutdamp.spacecraft.model import Attitude, Disturbance, Inertia, Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule
from nutdamp.views.exchange import export_text
from nutdamp.views.text import degrees

PROMISED = 1e-8
"""rad; for the direction of the axes and of H, and for the rates relative to |ω|."""

FOUND = 1e-11
"""The same as found with room for other compilers; more means that something has become worse."""

BODIES = {
    "prolate": ((120.0, 120.0, 80.0), 3.0),
    "oblate": ((80.0, 80.0, 120.0), 3.0),
    "reversed": ((120.0, 120.0, 80.0), -3.0),
    "oblate reversed": ((80.0, 80.0, 120.0), -3.0),
    "triaxial": ((120.0, 100.0, 80.0), 3.0),
    "triaxial oblate": ((80.0, 100.0, 130.0), -2.0),
    "pencil": ((100.0, 100.0, 2.0), 20.0),
}


@pytest.fixture(autouse=True)
def _installed(request: pytest.FixtureRequest) -> None:
    if request.node.get_closest_marker("basilisk"):
        pytest.importorskip(
            "Basilisk",
            reason=(
                "NOT CHECKED against Basilisk, which is not installed: "
                "pip install 'nutdamp[verify]'"
            ),
        )


def spinner(name: str, theta: float = math.radians(5.0), *, thrusters: bool = True) -> Spacecraft:
    moments, spin = BODIES[name]
    transverse = 0.5 * (moments[0] + moments[1])
    omega = moments[2] * abs(spin) * math.tan(theta) / transverse
    torque = transverse * omega  # about a second of firing takes the nutation out
    directions = {"+1": (1, 0, 0.1), "-1": (-1, 0, 0), "+2": (0, 1, 0), "-2": (0, -1, -0.1)}
    channels = [
        Channel(
            channel,
            (Thruster(channel, torque * np.array(direction, dtype=float), max_on_time=2.0),),
        )
        for channel, direction in directions.items()
    ]
    return Spacecraft(
        name=name,
        inertia=Inertia(moments),
        omega0=np.array([omega * math.cos(0.7), omega * math.sin(0.7), spin]),
        channels=tuple(channels) if thrusters else (),
    )


def difference(
    spacecraft: Spacecraft, schedule: Schedule, until: float, found: BasiliskFlight
) -> float:
    """Largest difference from the flown motion: H and body axes in rad, rates over |ω|."""
    rates, quaternion = propagation.flown(spacecraft, schedule, until).motion(found.t)
    inertia = spacecraft.inertia
    still = abs(inertia.wheel) / min(inertia.moments)
    worst = [
        np.linalg.norm(rates - found.rates, axis=1)
        / np.maximum(np.linalg.norm(rates, axis=1), still)
    ]
    pairs = [
        (inertia.momentum(rates), inertia.momentum(found.rates)),
        *((axis, axis) for axis in np.eye(3)),
    ]
    for mine, theirs in pairs:
        worst.append(
            attitude.angle_between(
                attitude.rotate(quaternion, mine), attitude.rotate(found.quaternion, theirs)
            )
        )
    return float(np.max(worst))


def overlapping() -> Schedule:
    """Pulses at times between nanoseconds: overlapping, nested, one with axial torque."""
    return Schedule(
        (
            pulse(1.0 / 3.0, 0.1 * math.pi, 20.0, -5.0, 0.0),
            pulse(0.5, 0.3, 0.0, 15.0, 30.0),
            pulse(math.e, 1.234567890123, 3.0, 4.0, -20.0),
            pulse(math.e + 0.1, 1e-10, 1000.0, 0.0, 0.0),
        )
    )


def pulse(t: float, on_time: float, *torque: float) -> Pulse:
    return Pulse(t, on_time, "by hand", np.array(torque) * on_time, np.array(torque))


@pytest.mark.basilisk
@spread("scheme", ["two-pulse", "four-pulse"], quick=1)
@spread("name", BODIES, quick=5)
def test_plans_with_real_widths(name: str, scheme: str) -> None:
    body = spinner(name)
    schedule = planner.schedule(scheme, body, catalogue.Options())
    assert schedule.pulses
    assert all(one.on_time > 0.0 for one in schedule)
    until = schedule.end + body.inertial_period
    assert difference(body, schedule, until, fly(body, schedule, until)) <= min(PROMISED, FOUND)


@pytest.mark.basilisk
def test_built_in_example(capfd: pytest.CaptureFixture[str]) -> None:
    body = read_spacecraft(example_text(), "example")
    schedule = planner.schedule("two-pulse", body, catalogue.Options())
    until = schedule.end + body.inertial_period
    found = fly(body, schedule, until)
    assert capfd.readouterr() == ("", "")
    assert difference(body, schedule, until, found) <= FOUND
    assert found.t[0] == 0.0
    assert found.t[-1] == until
    assert np.all(np.diff(found.t) > 0.0)
    assert {edge for one in schedule for edge in (one.start, one.end)} <= set(found.t)
    assert set(np.linspace(0.0, until, 50)) <= set(found.t)
    assert np.all(found.quaternion[:, 0] >= 0.0)
    assert np.linalg.norm(found.quaternion, axis=1) == pytest.approx(1.0, abs=1e-14)
    assert found.rates.shape == (len(found.t), 3)
    # What the plan is for: the nutation is gone and H is back, by a simulator that knows nothing of
    # the plan.
    last = found.rates[-1] * body.inertia.moments
    assert math.hypot(last[0], last[1]) / last[2] < 1e-8
    start = attitude.rotate(
        body.initial.quaternion, body.initial.rates * np.array(body.inertia.moments)
    )
    assert attitude.angle_between(start, attitude.rotate(found.quaternion[-1], last)) < 1e-8


@pytest.mark.basilisk
@pytest.mark.parametrize("name", BODIES)
def test_ideal_impulses_and_overlapping_pulses_off_the_nanosecond_grid(name: str) -> None:
    """Of a steerable torquer, and about every axis at any time."""
    steered, body = spinner(name, thrusters=False), spinner(name)
    schedule = planner.schedule("two-pulse", steered, catalogue.Options())
    assert [one.on_time for one in schedule] == [0.0, 0.0]
    until = schedule.end + steered.inertial_period
    assert difference(steered, schedule, until, fly(steered, schedule, until)) <= FOUND
    kicks = [
        (0.0, (5.0, 0.0, 3.0)),
        (1.1, (0.0, -4.0, 0.0)),
        (1.1, (1.0, 2.0, -30.0)),
        (4.0, (0.0, 7.0, 0.0)),
    ]
    schedule = Schedule(tuple(Pulse(t, 0.0, "by hand", np.array(impulse)) for t, impulse in kicks))
    found = fly(body, schedule, 4.0)
    assert difference(body, schedule, 4.0, found) <= FOUND
    assert found.rates[0] == pytest.approx(
        body.initial.rates + kicks[0][1] / np.array(body.inertia.moments)
    )
    assert difference(body, overlapping(), 8.0, fly(body, overlapping(), 8.0)) <= FOUND


@pytest.mark.basilisk
@pytest.mark.parametrize(("spin", "wheel"), [(0.0, 90.0), (-1.0, 150.0), (2.0, -400.0)])
def test_a_wheel(spin: float, wheel: float) -> None:
    """A balanced wheel without motor torque; also of three moments, with axial pulses and kicks."""
    for name in ("prolate", next(each for each in BODIES if len(set(BODIES[each][0])) == 3)):
        body = spinner(name)
        body = replace(
            body,
            inertia=replace(body.inertia, wheel=wheel),
            omega0=np.array([*body.omega0[:2], spin]),
        )
        pulses = (*overlapping(), Pulse(4.0, 0.0, "by hand", np.array([5.0, -3.0, 4.0])))
        schedule = Schedule(pulses)
        assert difference(body, schedule, 12.0, fly(body, schedule, 12.0)) <= FOUND


@pytest.mark.basilisk
def test_flight_that_ends_within_a_pulse() -> None:
    body = spinner("prolate")
    found = fly(body, overlapping(), 2.5)
    assert found.t[-1] == 2.5
    assert difference(body, overlapping(), 2.5, found) <= FOUND
    at_once = fly(body, overlapping(), 0.0)
    assert at_once.t.tolist() == [0.0]
    assert at_once.rates[0] == pytest.approx(body.initial.rates, rel=1e-15)
    assert at_once.quaternion[0] == pytest.approx(body.initial.quaternion, abs=1e-15)


@pytest.mark.basilisk
@pytest.mark.parametrize(
    "quaternion", [(0, 1, 0, 0), (0, 0, 0, -1), (-0.5, 0.5, -0.5, 0.5), (1e-9, 0.6, 0.0, -0.8)]
)
def test_attitude_of_the_file_and_tilted_axes(
    quaternion: tuple[float, float, float, float],
) -> None:
    axes = attitude.matrix(np.array([math.cos(0.2), math.sin(0.2) * 0.6, math.sin(0.2) * 0.8, 0.0]))
    body = spinner("triaxial")
    turned = np.array(quaternion) / np.linalg.norm(quaternion)
    body = replace(body, inertia=Inertia(body.inertia.moments, axes), attitude=Attitude(turned))
    assert difference(body, overlapping(), 5.0, fly(body, overlapping(), 5.0)) <= FOUND


@pytest.mark.basilisk
@spread("name", BODIES, quick=1)
@spread(
    "disturbances",
    [
        (Disturbance(0.02 - 0.05j), Disturbance(0.0, axial=-0.1)),
        (
            Disturbance(0.05 + 0.02j, rate=-3.0),
            Disturbance(0.01j, rate=0.7, axial=0.02),
            Disturbance(0.03 + 0j),
        ),
    ],
    quick=1,
    ids=["constant", "turning"],
)
def test_disturbances(name: str, disturbances: tuple[Disturbance, ...]) -> None:
    body = replace(spinner(name), disturbances=disturbances)
    schedule = planner.schedule("two-pulse", body, catalogue.Options())
    until = schedule.end + 1.0
    assert difference(body, schedule, until, fly(body, schedule, until)) <= FOUND


@pytest.mark.basilisk
def test_error_falls_with_the_step() -> None:
    body = spinner("triaxial", math.radians(20.0))
    schedule = Schedule((pulse(4.0, 4.0, 10.0, 0.0, 5.0),))
    flights = [fly(body, schedule, 12.0, step=step, samples=2) for step in (0.5, 0.25, 0.125)]
    assert [found.step for found in flights] == [0.5, 0.25, 0.125]
    coarse, middle, fine = (difference(body, schedule, 12.0, found) for found in flights)
    assert coarse > 1e-7
    assert middle < coarse / 50.0  # the seventh or eighth order would give 128 or 256
    assert fine < middle / 50.0


@pytest.mark.basilisk
def test_error_of_turning_torques_falls_with_the_fourth_power_of_the_step() -> None:
    body = replace(spinner("triaxial"), disturbances=(Disturbance(0.5 + 0.2j, rate=2.0),))
    flights = [fly(body, Schedule(), 10.0, step=step, samples=2) for step in (0.1, 0.05, 0.025)]
    coarse, middle, fine = (difference(body, Schedule(), 10.0, found) for found in flights)
    assert coarse < 1e-4
    assert middle == pytest.approx(coarse / 16.0, rel=0.2)
    assert fine == pytest.approx(middle / 16.0, rel=0.2)


@pytest.mark.basilisk
def test_body_at_rest() -> None:
    body = replace(
        spinner("triaxial"), omega0=np.zeros(3), attitude=Attitude(np.array([0.6, 0.0, 0.8, 0.0]))
    )
    found = fly(body, Schedule(), 3.0, samples=3)
    assert np.all(found.rates == 0.0)
    assert np.all(found.quaternion == found.quaternion[0])


def test_what_cannot_be_flown_is_refused_before_basilisk_is_requested(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It has a fixed step, so the count of steps is known before."""
    monkeypatch.setitem(sys.modules, "Basilisk", None)
    body = spinner("prolate")
    with refused(MissingExtra, "basilisk.missing"):
        fly(body, Schedule(), 1.0)
    with refused(Infeasible, "basilisk.dissipation"):
        fly(replace(body, dissipation=600.0), Schedule(), 1.0)
    with refused(Infeasible, "basilisk.too-long"):
        fly(body, Schedule(), 1e7)
    for until, step in ((-1.0, None), (math.nan, None), (math.inf, None), (1.0, 0.0), (1.0, -0.1)):
        with pytest.raises(BadRequest):
            fly(body, Schedule(), until, step=step)


# --- the script for Basilisk runs as it is, and ends with the residual that the plan has


kept_plans = pytest.mark.usefixtures("plans_shared")


def check(plan: planning.Plan, folder: Path) -> None:
    """The script prints the plan's residual in a process without nutdamp on its path."""
    script = folder / "fly.py"
    script.write_text(export_text(plan, "basilisk"), encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, "-I", str(script)], cwd=folder, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    lines = (line.split("  ", 1) for line in ran.stdout.splitlines() if "  " in line)
    left = present(plan.flown)
    assert {name.strip(): value.strip() for name, value in lines} == {
        "nutation left": degrees(left.nutation),
        "body cone": degrees(left.body_cone),
        "momentum shift": degrees(left.momentum_shift),
    }


@pytest.mark.basilisk
@kept_plans
@spread("case", messages.CASES, quick=4, deep=8)
def test_the_residual_is_that_of_the_plan(case: str, tmp_path: Path) -> None:
    check(messages.planned(case), tmp_path)


@pytest.mark.basilisk
@kept_plans
def test_ideal_impulses_and_disturbances(tmp_path: Path) -> None:
    ideal = planning.plan(replace(messages.spacecraft("prolate"), steerable=None), "one-pulse")
    assert all(pulse.torque is None for pulse in ideal.pulses)
    check(ideal, tmp_path)
    disturbances = (Disturbance(0.05 + 0.02j, axial=0.01), Disturbance(0.03j, rate=-3.0))
    disturbed = planning.plan(
        replace(messages.spacecraft("oblate"), disturbances=disturbances), "two-pulse"
    )
    assert present(disturbed.flown).nutation > math.radians(1e-3)
    check(disturbed, tmp_path)


@pytest.mark.basilisk
@kept_plans
@pytest.mark.parametrize("case", ["prolate", "tilted tensor, backwards", "ace"])
def test_a_schedule_that_leaves_nutation(case: str, tmp_path: Path) -> None:
    """Overlapping pulses with axial parts, at times that no clock of nanoseconds knows."""
    body = messages.spacecraft(case)
    scale = 0.1 * body.least_impulse
    pulses = tuple(
        Pulse(t, on_time, name, scale * np.array(torque) * on_time, scale * np.array(torque))
        for t, on_time, name, torque in (
            (1.0 / 3.0, 0.1 * math.pi, "A", [1.0, -0.5, 0.1]),
            (0.5, 0.3, "B", [0.0, 1.0, -0.2]),
            (math.e, 1.234567890123, 'it\'s "C"', [0.3, 0.4, 0.0]),
        )
    )
    check(planning.Plan(body, "by hand", Schedule(pulses)), tmp_path)
