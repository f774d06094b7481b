"""Where spin axis and H end, the target beside them, UTC of the pulses, and what is shown as 0."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import reference
from support.builders import Outcome, aimed, spinner
from support.cases import deep
from support.places import case
from support.process import Run

from nutdamp import planning, rounding
from nutdamp.files.examples import example_text
from nutdamp.files.plan_json import final_json, plan_json, target_json
from nutdamp.physics import attitude
from nutdamp.presentation import figures
from nutdamp.presentation.plan_tables import channel_text, pulse_table
from nutdamp.presentation.text import longitude, steering, vector
from nutdamp.schedule import Pulse, Schedule, steerable_pulse
from nutdamp.spacecraft import Attitude, Spacecraft, Steerable

pytestmark = pytest.mark.usefixtures("plans_shared")

POINTED = """
name: Pointed
inertia: {A: 120 kg m^2, C: 80 kg m^2}
state: {spin: 3 rad/s, nutation: 6 deg}
attitude: {quaternion: [0.809017, 0.081804, 0.582065, 0], epoch: 2016-12-31T23:59:59Z, frame: EME2000}
steerable: {torque: 60 N m}
"""
"""Its axis is 2 or 3 deg from right ascension 350 deg, declination 20 deg, and dated a second before a leap second."""

part = st.floats(-1.0, 1.0, allow_subnormal=False)


@given(st.tuples(part, part, part))
def test_angles_of_a_direction_name_it(parts: tuple[float, float, float]) -> None:
    direction = np.array(parts)
    if np.linalg.norm(direction) < 1e-6:
        return
    direction /= np.linalg.norm(direction)
    ascension, declination = attitude.sphere_angles(direction)
    if ascension is None:
        assert abs(declination) > 0.5 * math.pi - 1e-10
    else:
        assert 0.0 <= ascension < 2.0 * math.pi
        assert 0.0 <= math.degrees(ascension) < 360.0
    assert np.linalg.norm(attitude.on_sphere(ascension or 0.0, declination) - direction) < 2e-11
    body = spinner(degrees=10.0)
    azimuth, tilt = body.angles_of(direction)
    assert np.linalg.norm(body.direction_in_n(tilt, azimuth or 0.0) - direction) < 2e-11


def test_the_smallest_negative_angle_is_no_full_turn() -> None:
    assert attitude.full_turn(-1e-20) == 0.0
    assert attitude.full_turn(-0.25) == pytest.approx(2 * math.pi - 0.25)
    shown = [longitude(math.radians(359.99999)), longitude(math.radians(-1.5)), longitude(None), steering([1.0, -1e-9])]
    assert shown == ["0.0000 deg", "358.5000 deg", "–", "0.00°"]


def test_final_is_where_the_reference_integrator_ends() -> None:
    """Without an attitude: tilt and azimuth in the frame N, which the integrator builds by itself."""
    body = aimed(spinner(degrees=6.0, spin=-3.0, steerable=Steerable(60.0)), 3.0, 200.0)
    plan = planning.plan(body, "two-pulse")
    assert plan.feasible
    outcome, final = Outcome(body, plan.pulses), final_json(plan.flight)
    ends = {
        "axis": outcome.motion.rotation @ np.array([0.0, 0.0, -1.0]),
        "momentum": reference.momentum(body.inertia.moments, outcome.motion),
    }
    for name, (x, y, z) in ends.items():
        assert final[name]["tilt_deg"] == pytest.approx(math.degrees(math.atan2(math.hypot(x, y), z)), abs=1e-7)
        assert final[name]["azimuth_deg"] == pytest.approx(math.degrees(math.atan2(y, x)) % 360.0, abs=1e-5)
    assert final["spin_rad_s"] == pytest.approx(outcome.spin, rel=1e-10)
    assert final["nutation_deg"] == pytest.approx(math.degrees(outcome.nutation), abs=1e-7)
    target = target_json(body)
    assert target is not None
    assert target["axis"] == {"tilt_deg": pytest.approx(3.0), "azimuth_deg": pytest.approx(200.0)}
    assert final["axis"]["azimuth_deg"] == pytest.approx(200.0, abs=0.1)


def test_a_plan_that_keeps_h_has_no_azimuth_and_one_that_fails_no_end() -> None:
    body = spinner(steerable=Steerable())
    assert final_json(planning.plan(body, "two-pulse").flight)["momentum"]["azimuth_deg"] is None
    assert target_json(body) is None
    infeasible = plan_json(planning.Plan(body, "two-pulse", None, "why"))
    assert (infeasible["final"], infeasible["target"]) == (None, None)


@pytest.mark.parametrize("command", ["plan", "simulate", deep("verify")])
def test_every_json_and_screen_says_where_it_ends(run: Run, tmp_path: Path, command: str) -> None:
    """The command that shows both models gives the angles of each, one a row."""
    options = ("--scheme", "two-pulse", "--target", "350deg,20deg", "--json", "end.json", "--quiet")
    screen = run(command, "-", *options, stdin=POINTED).stdout
    written = json.loads((tmp_path / "end.json").read_text())
    written = written["plans"][0] if command == "plan" else written
    assert written["target"]["axis"] == pytest.approx({"right_ascension_deg": 350.0, "declination_deg": 20.0})
    final = written["final"]
    assert set(final) == {"axis", "momentum", "spin_rad_s", "nutation_deg"}
    assert final["spin_rad_s"] == pytest.approx(3.0, abs=0.01)
    for end, name in (("axis", "spin axis"), ("momentum", "H")):
        angles = [final[end]["right_ascension_deg"], final[end]["declination_deg"]]
        assert angles == pytest.approx([350.0, 20.0], abs=0.5)
        if command == "plan":
            line = next(line for line in screen.splitlines() if line.startswith(f"{name} ends at"))
            assert [float(number) for number in re.findall(r"[0-9]+\.[0-9]{4}", line)] == pytest.approx(
                angles, abs=1e-4
            )
        elif command == "simulate":
            for angle in ("right ascension", "declination"):
                row = re.search(rf"^{name}: {angle} +([0-9.]+) deg +([0-9.]+) deg$", screen, re.MULTILINE)
                assert row is not None
                assert float(row[1]) == pytest.approx(angles.pop(0), abs=0.5)
    if command != "verify":
        assert re.search(r"^target +right ascension 350\.0000 deg, declination 20\.0000 deg$", screen, re.MULTILINE)


def test_the_range_of_right_ascension_goes_through_zero(run: Run) -> None:
    shown = run("simulate", "-", "--scheme", "none", "--json", "-", "-q", stdin=POINTED.replace("6 deg", "20 deg"))
    west, east = json.loads(shown.stdout)["axis_track"]["right_ascension_deg"]
    assert 300.0 < west < 360.0
    assert 0.0 <= east < 60.0


# --- dates ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("epoch", "last"), [(59.6, "2017-01-01T00:00:00"), (58.8, "2016-12-31T23:59:60")])
def test_pulses_say_when_they_start_in_utc(run: Run, tmp_path: Path, epoch: float, last: str) -> None:
    """Across a leap second, which a clock that adds seconds to a date would miss."""
    (tmp_path / "leap.yaml").write_text(POINTED.replace("23:59:59Z", f"23:59:{epoch}Z"))
    screen = run("plan", "leap.yaml", "--scheme", "two-pulse", "--csv", "pulses.csv", "--json", "plan.json", "-q")
    assert screen.returncode == 0, screen.stderr
    rows = list(csv.DictReader(io.StringIO((tmp_path / "pulses.csv").read_text())))
    pulses = json.loads((tmp_path / "plan.json").read_text())["plans"][0]["pulses"]
    for row, pulse in zip(rows, pulses, strict=True):
        seconds = float(row["start_s"]) + epoch
        minute = "2016-12-31T23:59" if seconds < 61.0 else "2017-01-01T00:00"
        whole = f"{minute}:{seconds if seconds < 61.0 else seconds - 61.0:012.9f}Z"
        assert row["utc"] == pulse["utc"] == whole
    assert rows[-1]["utc"].startswith(last)
    # What was written is read again, and the times of a file without an epoch stay as they are.
    assert run("simulate", "leap.yaml", "--schedule", "pulses.csv").stderr == ""
    assert "utc" not in run("plan", "-", "--scheme", "two-pulse", "--csv", "-", stdin=example_text()).stdout


def dated(epoch: str | None) -> Spacecraft:
    return replace(spinner(steerable=Steerable(5.0)), attitude=Attitude(np.array([1.0, 0.0, 0.0, 0.0]), epoch, "GCRF"))


def steered(start: float, angle: float = 0.0) -> Pulse:
    return steerable_pulse(Steerable(5.0), start + 0.25, angle, on_time=0.5)


def test_a_screen_rounds_a_date_to_the_millisecond() -> None:
    """The start of each pulse is at most half a millisecond from the date shown, and the day is that of what is shown.

    The first pulse starts 0.3 ms before midnight: it is shown at midnight, on the next day.
    """
    pulses = Schedule(tuple(map(steered, (1.0, 2.0009, 3.0004))))
    table = pulse_table(planning.Plan(dated("2026-03-01T23:59:58.9997Z"), "x", pulses))
    column = next(column for column in table.columns if str(column.header).startswith("UTC"))
    assert column.header == "UTC\n2026-03-02"
    assert list(column.cells) == ["00:00:00.000", "00:00:01.001", "00:00:02.000"]


def test_dates_that_no_calendar_has_are_left_out() -> None:
    bodies = [spinner(), *map(dated, (None, "1960-01-01T00:00:00Z", "9999-12-31T23:59:59Z"))]
    assert [body.utc(10.0) for body in bodies] == [None] * 4


# --- what is shown --------------------------------------------------------------------------------------------------


def test_a_steering_angle_is_the_same_everywhere() -> None:
    body, pulse = spinner(steerable=Steerable(5.0)), steered(0.75, math.radians(-70.123))
    assert channel_text(pulse, body) == "steerable 289.88°"
    figure = figures.flight_figure("timeline", *figures.shown(planning.Plan(body, "x", Schedule((pulse,)))))
    assert any("289.88°" in text.get_text() for text in figure.axes[0].texts)


def test_what_is_rounding_beside_its_neighbours_is_zero(run: Run) -> None:
    """Vectors of a track and a check have components of the order of one, or zero."""
    noisy = np.array([[1.0, -4.484e-18, 0.0], [1e-20, 2e-20, -0.0], [5.0, 6e-13, -4.9e-13]])
    cleaned = rounding.cleaned(noisy)
    assert cleaned.tolist() == [[1.0, 0.0, 0.0], [1e-20, 2e-20, 0.0], [5.0, 6e-13, 0.0]]
    assert not np.signbit(cleaned).any()
    assert vector([4.484e-18, -0.0, 8.0]) == "(0, 0, 8)"
    assert [rounding.cleaned_change(change, 3.0) for change in (4e-16, -4e-12)] == [0.0, -4e-12]
    tilted = str(case("tensor-microsat.yaml"))
    rows = list(csv.reader(io.StringIO(run("simulate", tilted, "--scheme", "none", "--csv", "-").stdout)))
    file = json.loads(run("check", tilted, "--json", "-").stdout)["files"][0]
    vectors = [channel["torque_Nm"] for channel in file["channels"]] + file["spacecraft"]["principal_axes"]
    parts = [float(cell) for row in rows[1:] for cell in row[4:8]] + [value for each in vectors for value in each]
    assert not [value for value in parts if 0.0 < abs(value) < 1e-14]
