"""What has become of a body by a given time, and what is said where two models of a flight are apart."""

import csv
import itertools
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import reference
from support.builders import aimed, cross, events, present, spinner
from support.cases import spread
from support.golden import check_text
from support.planner import Planner
from support.process import Run

import nutdamp
from nutdamp.figures.overview import title
from nutdamp.flight import propagation
from nutdamp.flight.end_state import ANGLE, deviations, seen_at, tolerated
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Disturbance, Goal, Limits, Requirement
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

BODY = spinner(channels=cross(8.0, max_on_time=0.75), limits=Limits(horizon=60.0))
FLIES = (propagation.flown, propagation.by_impulses)


@pytest.mark.parametrize("when", ["before the first", "within the second", "between", "long after"])
def test_it_is_the_motion_of_the_reference_integrator_at_that_time(planned: Planner, when: str) -> None:
    pulses = planned(BODY, "four-pulse").pulses
    first, second, third, *_ = pulses.pulses
    time, begun = {
        "before the first": (0.5 * first.start, 0),
        "within the second": (second.t, 2),
        "between": (0.5 * (second.end + third.start), 2),
        "long after": (pulses.end + 7.0, len(pulses)),
    }[when]
    seen = seen_at(propagation.flown(BODY, pulses, time), time)
    moments, start = BODY.inertia.moments, reference.frame_n(BODY.inertia.moments, BODY.omega0)
    motion = reference.fly(moments, BODY.omega0, events(pulses), time, start)
    before, after = (reference.momentum(moments, one) for one in (reference.Motion(BODY.omega0, start), motion))
    assert len(seen.schedule) == len(seen.spans) == begun
    assert seen.residual.nutation == pytest.approx(reference.nutation(moments, motion.rates, 1.0), abs=1e-9)
    assert seen.residual.momentum_shift == pytest.approx(reference.angle(before, after), abs=1e-9)
    assert seen.final.axis == pytest.approx(motion.rotation[:, 2], abs=1e-9)
    assert seen.final.spin == pytest.approx(motion.rates[2], abs=1e-9)
    assert np.all(seen.around_pulses()[1].t <= time)


@pytest.mark.parametrize("fly", FLIES)
def test_dissipation_and_disturbances_go_on_after_the_last_pulse(fly: object) -> None:
    """tan θ grows e-fold in the time constant; a torque about axis 3 spins the body up."""
    grown = seen_at(fly(replace(spinner(), dissipation=50.0), Schedule(), 60.0), 60.0)  # type: ignore[operator]
    expected = math.atan(math.tan(math.radians(5.0)) * math.exp(60.0 / 50.0))
    assert grown.residual.nutation == pytest.approx(expected, rel=1e-10)
    assert grown.final.nutation == grown.residual.nutation
    turned = replace(spinner(), disturbances=(Disturbance(0.0j, axial=0.4),))
    spin = seen_at(fly(turned, Schedule(), 60.0), 60.0).final.spin  # type: ignore[operator]
    assert spin == pytest.approx(3.0 + 0.4 / 80.0 * 60.0, rel=1e-12)


def test_what_an_ideal_impulse_does_is_there_at_its_own_time() -> None:
    plan = planning.plan(spinner(steerable=Steerable()), "one-pulse")
    for fly in FLIES:
        seen = seen_at(fly(plan.spacecraft, plan.pulses, plan.pulses.end), plan.pulses.end)
        assert len(seen.schedule) == 1
        assert seen.residual.nutation < 1e-9


def test_models_may_differ_by_a_tenth_of_what_is_required(planned: Planner) -> None:
    required = tolerated(spinner(requirement=Requirement(nutation=0.02)))
    assert required == pytest.approx({Part.NUTATION: 0.002, Part.SHIFT: ANGLE})
    assert tolerated(spinner()) == {Part.NUTATION: ANGLE, Part.SHIFT: ANGLE}
    spun = replace(aimed(spinner(), 3.0, 0.0), goal=Goal(axis=np.array([0.0, 0.0, 1.0]), spin=3.0))
    assert set(tolerated(spun)) == {Part.NUTATION, Part.DISTANCE, Part.SPIN}
    flown, impulses = (fly(BODY, planned(BODY, "four-pulse").pulses, 0.0) for fly in FLIES)
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


NUTATION = re.compile(r"^nutation +([<0-9.e -]+) deg +([<0-9.e -]+) deg$", re.MULTILINE)


def nutations(screen: str) -> list[str]:
    """By the impulse sum and through real widths, as a screen shows them."""
    shown = present(NUTATION.search(screen))
    return list(shown.groups())


CHANGES = ("", "dissipation={time_constant: 50 s}", "disturbances=[{torque: [0, 0, 0.4 N m]}]")


@spread(("options", "change", "until"), itertools.product([(), ("--flown",)], CHANGES, (2, 0.2, 60)), quick=4, deep=14)
def test_screen_json_and_last_row_of_the_track_are_one(
    run: Run, tmp_path: Path, options: tuple[str, ...], change: str, until: float
) -> None:
    given = ("--scheme", "none", "--set", change) if change else ("--scheme", "four-pulse")
    files = ("--csv", "track.csv", "--json", "flight.json")
    screen = run("simulate", *given, *options, "--until", f"{until} s", *files).stdout
    data = json.loads((tmp_path / "flight.json").read_text())
    *_, last = csv.DictReader((tmp_path / "track.csv").read_text().splitlines())
    named, final = ("flown", "final") if options else ("residual", "final_by_impulses")
    assert data["propagated"] == named
    assert data["until_s"] == float(last["t_s"]) == until
    for key in ("nutation_deg", "body_cone_deg", "space_cone_deg"):
        assert data[named][key] == pytest.approx(float(last[key]), abs=1e-9)
    assert data[final]["spin_rad_s"] == pytest.approx(float(last["omega_3_rad_s"]), rel=1e-12)
    x, y, z = (float(last[f"axis_{part}"]) for part in "xyz")
    tilt = math.degrees(math.atan2(math.hypot(x, y), z))
    assert data[final]["axis"]["tilt_deg"] == pytest.approx(tilt, abs=1e-9)
    assert len(data["pulses"]) >= int(last["pulse"])
    assert all(pulse["start_s"] < until for pulse in data["pulses"])
    assert f"0 to {until:.3f} s" in " ".join(screen.split())
    both = [data["residual"]["nutation_deg"], data["flown"]["nutation_deg"]]
    if min(both) > 1e-9:
        assert [float(cell) for cell in nutations(screen)] == pytest.approx(both, rel=1e-3)


def test_what_a_screen_says_of_the_end(run: Run) -> None:
    grows = run("simulate", "--scheme", "none", "--until", "60 s", "--set", "dissipation={time_constant: 60 s}")
    assert nutations(grows.stdout) == ["13.38", "13.38"]  # e-fold in the time constant
    ends = run("simulate", "--scheme", "four-pulse", "--until", "2 s", "--flown").stdout
    (line,) = (line for line in ends.splitlines() if "begun" in line)
    check_text("flight.pulses-begun", line)
    assert "3.6667" not in ends  # nor is any pulse after that shown
    # Where dissipation goes on after the last pulse, a plan reports the time for which its end holds.
    words = " ".join(run("plan", "--scheme", "four-pulse", "--set", CHANGES[1]).stdout.split())
    assert re.search(r"at [0-9.]+ s; then changing by dissipation", words)
    assert "then changing" not in run("plan", "--scheme", "four-pulse").stdout


@pytest.mark.deep
def test_where_the_models_end_apart_is_shown_for_each_and_warned_of(run: Run, tmp_path: Path) -> None:
    """The target is met through real widths; the impulse sum ends 2 deg from it."""
    options = ("simulate", "--scheme", "half-cone", "--target", "10deg,45deg")
    screen = run(*options, "--json", "flight.json").stdout
    table = {line[:22].strip(): line[22:].split() for line in screen.splitlines()}
    assert table["spin axis: tilt"] == ["11.9392", "deg", "10.0000", "deg"]
    assert table["spin axis: azimuth"] == ["49.0449", "deg", "45.0000", "deg"]
    for text in (" ".join(screen.split()), run(*options, "--json", "-").stderr):
        assert "warning[models-differ]: impulse sum (17) and flown motion differ by 2.085 deg of" in text
    data = json.loads((tmp_path / "flight.json").read_text())
    assert data["differ"] == ["axis_error"]
    assert data["final"]["axis"]["tilt_deg"] == pytest.approx(10.0, abs=1e-6)
    assert data["final_by_impulses"]["axis"]["tilt_deg"] == pytest.approx(11.94, abs=0.01)
    assert "models-differ" not in run("simulate", "--scheme", "none").stdout


def test_widths_are_named_where_any_pulse_has_one() -> None:
    wide = channel_pulse(BODY.channels[0], 1.0, 0.2)
    kick = replace(wide, on_time=0.0)
    both, kicks = Schedule((wide, kick)), Schedule((kick,))
    for schedules in ([both], [kicks, both], [Schedule((wide,)), kicks]):
        assert propagation.model_name(schedules) == propagation.REAL_WIDTHS
    assert propagation.model_name([kicks, Schedule()]) == propagation.IDEAL_IMPULSES
