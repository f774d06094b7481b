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
from support.cases import spread
from support.places import case
from support.process import Run

from nutdamp import planning, rounding
from nutdamp.files.plan_json import final_json, plan_json, target_json
from nutdamp.physics import attitude
from nutdamp.presentation import figures
from nutdamp.presentation.plan_tables import channel_text, pulse_table
from nutdamp.presentation.text import longitude, steering, vector
from nutdamp.schedule import Schedule, steerable_pulse
from nutdamp.spacecraft import Attitude, Steerable

pytestmark = pytest.mark.usefixtures("plans_shared")

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
    back = attitude.on_sphere(ascension or 0.0, declination)
    assert np.linalg.norm(back - direction) < 2e-11
    body = spinner(degrees=10.0)
    azimuth, tilt = body.angles_of(direction)
    assert np.linalg.norm(body.direction_in_n(tilt, azimuth or 0.0) - direction) < 2e-11


def test_the_smallest_negative_angle_is_no_full_turn() -> None:
    assert attitude.full_turn(-1e-20) == 0.0
    assert attitude.full_turn(-0.25) == pytest.approx(2 * math.pi - 0.25)
    assert longitude(math.radians(359.99999)) == "0.0000 deg"
    assert longitude(math.radians(-1.5)) == "358.5000 deg"
    assert longitude(None) == "–"


def test_final_is_where_the_reference_integrator_ends() -> None:
    """Without an attitude: tilt and azimuth in the frame N, which the integrator builds by itself."""
    body = aimed(spinner(degrees=6.0, spin=-3.0, steerable=Steerable(60.0)), 3.0, 200.0)
    plan = planning.plan(body, "two-pulse")
    assert plan.feasible
    outcome = Outcome(body, plan.pulses)
    ends = {
        "axis": outcome.motion.rotation @ np.array([0.0, 0.0, -1.0]),
        "momentum": reference.momentum(body.inertia.moments, outcome.motion),
    }
    final = final_json(plan.flight)
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
    plan = planning.plan(body, "two-pulse")
    assert final_json(plan.flight)["momentum"]["azimuth_deg"] is None
    assert target_json(body) is None
    none = plan_json(planning.Plan(body, "two-pulse", None, "why"))
    assert none["final"] is None
    assert none["target"] is None


@pytest.mark.deep
@spread("command", ["plan", "simulate", "verify"], quick=1)
def test_every_json_says_where_it_ends(run: Run, command: str) -> None:
    name = str(case("tensor-microsat.yaml"))
    options = (name, "--scheme", "half-cone", "--target", "350deg,20deg", "--json", "-", "--quiet")
    data = json.loads(run(command, *options).stdout)
    found = data["plans"][0] if command == "plan" else data
    assert found["target"]["axis"] == pytest.approx({"right_ascension_deg": 350.0, "declination_deg": 20.0})
    for which in ("axis", "momentum"):
        assert found["final"][which]["right_ascension_deg"] == pytest.approx(350.0, abs=1.0)
        assert found["final"][which]["declination_deg"] == pytest.approx(20.0, abs=1.0)
    assert found["final"]["spin_rad_s"] == pytest.approx(0.7, abs=0.01)
    assert set(found["final"]) == {"axis", "momentum", "spin_rad_s", "nutation_deg"}


def test_every_screen_says_where_it_ends(run: Run) -> None:
    """The command that shows both models gives the angles of each, one a row."""
    name = str(case("tensor-microsat.yaml"))
    options = (name, "--scheme", "half-cone", "--target", "350deg,20deg", "--quiet")
    screens = {command: run(command, *options).stdout for command in ("plan", "simulate")}
    for text in ("spin axis ends at", "H ends at"):
        line = next(line for line in screens["plan"].splitlines() if line.startswith(text))
        ascension, declination = map(float, re.findall(r"-?[0-9]+\.[0-9]{4}", line))
        assert ascension == pytest.approx(350.0, abs=1.0)
        assert declination == pytest.approx(20.0, abs=1.0)
    for what in ("spin axis", "H"):
        for angle, aim in (("right ascension", 350.0), ("declination", 20.0)):
            found = re.search(rf"^{what}: {angle} +([0-9.]+) deg +([0-9.]+) deg$", screens["simulate"], re.MULTILINE)
            assert found is not None
            assert float(found[2]) == pytest.approx(aim, abs=1.0)
    for screen in screens.values():
        assert re.search(r"^target +right ascension 350\.0000 deg, declination 20\.0000 deg$", screen, re.MULTILINE)


def test_the_range_of_right_ascension_goes_through_zero(run: Run) -> None:
    done = run("simulate", str(case("geo-target.yaml")), "--scheme", "none", "--json", "-", "--quiet")
    body = json.loads(done.stdout)["axis_track"]
    for angle in body["right_ascension_deg"] or ():
        assert 0.0 <= angle < 360.0
    name = str(case("tensor-microsat.yaml"))
    west, east = json.loads(
        run("simulate", name, "--scheme", "none", "--until", "1000", "--json", "-", "--quiet").stdout
    )["axis_track"]["right_ascension_deg"]
    assert 340.0 < west < 360.0
    assert 0.0 <= east < 10.0


def test_pulses_say_when_they_start_in_utc(run: Run, tmp_path: Path) -> None:
    """Across a leap second, which a clock that adds seconds to a date would miss."""
    text = case("tensor-microsat.yaml").read_text().replace("2026-05-01T00:00:00Z", "2016-12-31T23:59:50Z")
    (tmp_path / "leap.yaml").write_text(text)
    done = run("plan", "leap.yaml", "--scheme", "two-pulse", "--csv", "pulses.csv", "--json", "plan.json", "--quiet")
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader(io.StringIO((tmp_path / "pulses.csv").read_text())))
    pulses = json.loads((tmp_path / "plan.json").read_text())["plans"][0]["pulses"]
    for row, pulse in zip(rows, pulses, strict=True):
        assert row["utc"] == pulse["utc"]
        # 10 s to midnight, and a 61st second in the last minute of the year.
        seconds = float(row["start_s"]) + 50.0
        minute = "2016-12-31T23:59" if seconds < 61.0 else "2017-01-01T00:00"
        whole = f"{minute}:{seconds if seconds < 61.0 else seconds - 61.0:012.9f}Z"
        assert row["utc"] == whole
    assert {row["utc"][:4] for row in rows} == {"2016", "2017"}
    assert re.search(r"2016-12-31\s.*23:59:58\.000", done.stdout, re.DOTALL)
    # What was written is read again, and the times of a file without an epoch stay as they are.
    assert run("simulate", "leap.yaml", "--schedule", "pulses.csv").stderr == ""
    plain = run("plan", "--csv", "-").stdout.splitlines()[0]
    assert "utc" not in plain


def test_a_screen_rounds_a_date_to_the_millisecond() -> None:
    """The start of each pulse is at most half a millisecond from the date shown, and the day is that of what is shown.

    The first pulse starts 0.3 ms before midnight: it is shown at midnight, on the next day.
    """
    body = replace(
        spinner(steerable=Steerable(5.0)),
        attitude=Attitude(np.array([1.0, 0.0, 0.0, 0.0]), "2026-03-01T23:59:58.9997Z", "GCRF"),
    )
    torquer = body.steerable
    assert torquer is not None
    starts = (1.0, 2.0009, 3.0004)
    pulses = tuple(steerable_pulse(torquer, start + 0.25, 0.0, on_time=0.5) for start in starts)
    table = pulse_table(planning.Plan(body, "x", Schedule(pulses)))
    column = next(column for column in table.columns if str(column.header).startswith("UTC"))
    assert column.header == "UTC\n2026-03-02"
    assert list(column.cells) == ["00:00:00.000", "00:00:01.001", "00:00:02.000"]


def test_dates_that_no_calendar_has_are_left_out() -> None:
    body = spinner()
    for epoch in (None, "1960-01-01T00:00:00Z", "9999-12-31T23:59:59Z"):
        dated = replace(body, attitude=Attitude(np.array([1.0, 0.0, 0.0, 0.0]), epoch, "GCRF"))
        assert dated.utc(10.0) is None
    assert body.utc(1.0) is None


def test_a_steering_angle_is_the_same_everywhere() -> None:
    body = spinner(steerable=Steerable(5.0))
    torquer = body.steerable
    assert torquer is not None
    pulse = steerable_pulse(torquer, 1.0, math.radians(-70.123), on_time=0.5)
    assert channel_text(pulse, body) == "steerable 289.88°"
    figure = figures.flight_figure("timeline", *figures.shown(planning.Plan(body, "x", Schedule((pulse,)))))
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert any("289.88°" in text for text in texts)
    assert steering([1.0, -1e-9]) == "0.00°"


def test_what_is_rounding_beside_its_neighbours_is_zero() -> None:
    noisy = np.array([[1.0, -4.484e-18, 0.0], [1e-20, 2e-20, -0.0], [5.0, 6e-13, -4.9e-13]])
    expected = [[1.0, 0.0, 0.0], [1e-20, 2e-20, 0.0], [5.0, 6e-13, 0.0]]
    found = rounding.cleaned(noisy)
    assert found.tolist() == expected
    assert not np.signbit(found).any()
    assert vector([4.484e-18, -0.0, 8.0]) == "(0, 0, 8)"
    assert rounding.cleaned_change(4e-16, 3.0) == 0.0
    assert rounding.cleaned_change(-4e-12, 3.0) == -4e-12


def test_no_rounding_is_written(run: Run, tmp_path: Path) -> None:
    """Vectors of a plan, a track and a check; their components are of the order of one, or zero."""
    text = case("tensor-microsat.yaml").read_text()
    (tmp_path / "tilted.yaml").write_text(text)
    rows = list(csv.reader(io.StringIO(run("simulate", "tilted.yaml", "--scheme", "none", "--csv", "-").stdout)))
    quaternion = [float(cell) for row in rows[1:] for cell in row[4:8]]
    assert not [value for value in quaternion if 0.0 < abs(value) < 1e-14]
    checked = json.loads(run("check", "tilted.yaml", "--json", "-").stdout)["files"][0]
    torques = [part for channel in checked["channels"] for part in channel["torque_Nm"]]
    torques += [part for axis in checked["spacecraft"]["principal_axes"] for part in axis]
    assert not [value for value in torques if 0.0 < abs(value) < 1e-14]
