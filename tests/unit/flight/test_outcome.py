"""What has become of a body by a given time, and what is said where two models of a flight are apart."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import reference
from support.builders import aimed, cross, events, spinner
from support.cases import deep
from support.process import Run

import nutdamp
from nutdamp import flight, planning
from nutdamp.compliance import Part
from nutdamp.flight import Flight
from nutdamp.outcome import ANGLE, deviations, seen_at, tolerated
from nutdamp.presentation.figures.motion import title
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Disturbance, Goal, Limits, Requirement, Spacecraft, Steerable

Fly = Callable[[Spacecraft, Schedule, float], Flight]


@pytest.fixture(scope="module")
def four() -> planning.Plan:
    body = spinner(channels=cross(8.0, max_on_time=0.75), limits=Limits(horizon=60.0))
    plan = planning.plan(body, "four-pulse")
    assert len(plan.pulses) > 3
    return plan


@pytest.mark.parametrize("when", ["before the first", "within the second", "between", "long after"])
def test_it_is_the_motion_of_the_reference_integrator_at_that_time(four: planning.Plan, when: str) -> None:
    body, pulses = four.spacecraft, four.pulses
    first, second, third = pulses.pulses[:3]
    time, begun = {
        "before the first": (0.5 * first.start, 0),
        "within the second": (second.t, 2),
        "between": (0.5 * (second.end + third.start), 2),
        "long after": (pulses.end + 7.0, len(pulses)),
    }[when]
    seen = seen_at(flight.flown(body, pulses, time), time)
    moments = body.inertia.moments
    rotation = reference.frame_n(moments, body.omega0)
    motion = reference.fly(moments, body.omega0, events(pulses), time, rotation)
    start = reference.momentum(moments, reference.Motion(body.omega0, rotation))
    momentum = reference.momentum(moments, motion)
    assert len(seen.schedule) == len(seen.spans) == begun
    assert seen.residual.nutation == pytest.approx(reference.nutation(moments, motion.rates, 1.0), abs=1e-9)
    assert seen.residual.momentum_shift == pytest.approx(reference.angle(start, momentum), abs=1e-9)
    assert seen.final.axis == pytest.approx(motion.rotation[:, 2], abs=1e-9)
    assert seen.final.spin == pytest.approx(motion.rates[2], abs=1e-9)
    _, after = seen.around_pulses()
    assert np.all(after.t <= time)


@pytest.mark.parametrize("fly", [flight.flown, flight.by_impulses])
def test_dissipation_and_disturbances_go_on_after_the_last_pulse(fly: Fly) -> None:
    """tan θ grows e-fold in the time constant; a torque about axis 3 spins the body up."""
    sinking = replace(spinner(), dissipation=50.0)
    grown = seen_at(fly(sinking, Schedule(), 60.0), 60.0)
    expected = math.atan(math.tan(math.radians(5.0)) * math.exp(60.0 / 50.0))
    assert grown.residual.nutation == pytest.approx(expected, rel=1e-10)
    assert grown.final.nutation == grown.residual.nutation
    turned = replace(spinner(), disturbances=(Disturbance(0.0j, axial=0.4),))
    assert seen_at(fly(turned, Schedule(), 60.0), 60.0).final.spin == pytest.approx(3.0 + 0.4 / 80.0 * 60.0, rel=1e-12)


def test_what_an_ideal_impulse_does_is_there_at_its_own_time() -> None:
    plan = planning.plan(spinner(steerable=Steerable()), "one-pulse")
    (pulse,) = plan.pulses.pulses
    for fly in (flight.flown, flight.by_impulses):
        seen = seen_at(fly(plan.spacecraft, plan.pulses, pulse.t), pulse.t)
        assert len(seen.schedule) == 1
        assert seen.residual.nutation < 1e-9


def test_models_may_differ_by_a_tenth_of_what_is_required() -> None:
    required = spinner(requirement=Requirement(nutation=0.02))
    assert tolerated(required) == pytest.approx({Part.NUTATION: 0.002, Part.SHIFT: ANGLE})
    assert tolerated(spinner()) == {Part.NUTATION: ANGLE, Part.SHIFT: ANGLE}
    spun = replace(aimed(spinner(), 3.0, 0.0), goal=Goal(axis=np.array([0.0, 0.0, 1.0]), spin=3.0))
    assert set(tolerated(spun)) == {Part.NUTATION, Part.DISTANCE, Part.SPIN}


def test_what_differs_is_named_part_by_part(four: planning.Plan) -> None:
    impulses, flown = (fly(four.spacecraft, four.pulses, 0.0) for fly in (flight.by_impulses, flight.flown))
    (shift,) = deviations(impulses, flown)
    assert shift.part is Part.SHIFT
    assert shift.error == abs(impulses.residual.momentum_shift - flown.residual.momentum_shift)
    assert deviations(flown, flown) == ()


def test_a_library_flight_ends_where_its_track_does() -> None:
    body = nutdamp.read("name: X\ninertia: {A: 120, C: 80}\nomega0: [0.2, 0, 3]\ndissipation: {time_constant: 100 s}\n")
    flown = nutdamp.plan(body, "none").fly(until=60.0)
    assert flown.residual.nutation == pytest.approx(flown.track.nutation[-1], rel=1e-12)
    assert flown.residual.nutation > 1.5 * body.nutation
    assert "→" in title(flown)


NUTATION = r"^nutation +([<0-9.e -]+) deg +([<0-9.e -]+) deg$"


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


@pytest.mark.parametrize("options", [(), ("--flown",)])
@pytest.mark.parametrize("until", [deep("0.2 s"), "2 s", deep("60 s")])
@pytest.mark.parametrize(
    "changes", [(), ("dissipation={time_constant: 50 s}",), ("disturbances=[{torque: [0, 0, 0.4 N m]}]",)]
)
def test_screen_json_and_last_row_of_the_track_are_one(
    run: Run, tmp_path: Path, options: tuple[str, ...], until: str, changes: tuple[str, ...]
) -> None:
    scheme = "none" if changes else "four-pulse"
    common = ("--scheme", scheme, "--until", until, *options, *(f"--set={change}" for change in changes))
    data = json.loads(run("simulate", *common, "--csv", "track.csv", "--json", "-").stdout)
    last = rows((tmp_path / "track.csv").read_text())[-1]
    named = "flown" if options else "residual"
    final = data["final"] if options else data["final_by_impulses"]
    assert data["propagated"] == named
    assert data["until_s"] == float(last["t_s"]) == float(until.split()[0])
    for key in ("nutation_deg", "body_cone_deg", "space_cone_deg"):
        assert data[named][key] == pytest.approx(float(last[key]), abs=1e-9)
    assert final["spin_rad_s"] == pytest.approx(float(last["omega_3_rad_s"]), rel=1e-12)
    x, y, z = (float(last[f"axis_{part}"]) for part in "xyz")
    assert final["axis"]["tilt_deg"] == pytest.approx(math.degrees(math.atan2(math.hypot(x, y), z)), abs=1e-9)
    assert len(data["pulses"]) >= int(last["pulse"])
    assert all(pulse["start_s"] < data["until_s"] for pulse in data["pulses"])
    screen = run("simulate", *common).stdout
    assert f"at {data['until_s']:.3f} s" in screen
    found = re.search(NUTATION, screen, re.MULTILINE)
    assert found is not None
    both = [data["residual"]["nutation_deg"], data["flown"]["nutation_deg"]]
    if min(both) > 1e-9:
        assert [float(cell) for cell in found.groups()] == pytest.approx(both, rel=1e-3)


def test_nutation_that_grows_e_fold_is_shown_at_the_end(run: Run) -> None:
    screen = run("simulate", "--scheme", "none", "--until", "60 s", "--set", "dissipation={time_constant: 60 s}").stdout
    found = re.search(NUTATION, screen, re.MULTILINE)
    assert found is not None
    assert found.groups() == ("13.38", "13.38")


@pytest.mark.deep
def test_where_the_models_end_apart_is_shown_for_each_and_warned_of(run: Run) -> None:
    """The target is met through real widths; the impulse sum ends 2 deg from it."""
    options = ("simulate", "--scheme", "half-cone", "--target", "10deg,45deg")
    done = run(*options)
    table = {line[:22].strip(): line[22:].split() for line in done.stdout.splitlines()}
    assert table["spin axis: tilt"] == ["11.9392", "deg", "10.0000", "deg"]
    assert table["spin axis: azimuth"] == ["49.0449", "deg", "45.0000", "deg"]
    assert "Warning: the impulse sum (17) and real widths differ by 2.1 deg of error of H" in done.stdout
    silent = run(*options, "--json", "-")
    assert "warning: the impulse sum (17) and real widths differ by 2.1 deg" in silent.stderr
    data = json.loads(silent.stdout)
    assert data["differ"] == ["axis_error"]
    assert data["final"]["axis"]["tilt_deg"] == pytest.approx(10.0, abs=1e-6)
    assert data["final_by_impulses"]["axis"]["tilt_deg"] == pytest.approx(11.94, abs=0.01)
    assert "Warning" not in run("simulate", "--scheme", "none").stdout


def test_pulses_after_the_end_are_not_shown(run: Run) -> None:
    screen = run("simulate", "--scheme", "four-pulse", "--until", "2 s", "--flown").stdout
    assert "the track ends at 2.000 s, with 2 of 4 pulses begun" in screen
    assert "3.6667" not in screen


def test_a_plan_says_when_its_end_is_not_the_last_word(run: Run) -> None:
    """Where dissipation or disturbances go on after the last pulse, the time is reported for which the end holds."""
    words = " ".join(run("plan", "--scheme", "four-pulse", "--set", "dissipation={time_constant: 50 s}").stdout.split())
    assert re.search(r"as the last pulse ends, at [0-9.]+ s; changed further by dissipation", words)
    assert "changed further" not in run("plan", "--scheme", "four-pulse").stdout
