"""Telemetry files: what is read, and every fault with its place."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import nutdamp
from nutdamp.errors import CannotRead, FaultyFile
from nutdamp.estimation.record import ACCELERATION, AXIS, GYROS
from nutdamp.files.telemetry_csv import read_telemetry
from nutdamp.spacecraft import Spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")

WITH_EPOCH = {"attitude": {"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"}}


@pytest.fixture
def body() -> Spacecraft:
    return nutdamp.example()


def written(folder: Path, text: str) -> Path:
    path = folder / "flight.csv"
    path.write_text(text, encoding="utf-8")
    return path


def faults(folder: Path, text: str, body: Spacecraft) -> list[str]:
    with pytest.raises(FaultyFile) as wrong:
        read_telemetry(written(folder, text), body)
    return [f"{one.line}:{one.column}: {one.where}: {one.problem}" for one in wrong.value.faults]


def test_rates_in_either_unit_with_missing_samples(tmp_path: Path, body: Spacecraft) -> None:
    text = "t_s,omega_1_deg_s,omega_3_rad_s\n0,1.5,3\n0.1,,3.1\n0.3,-2,nan\n"
    record, warnings = read_telemetry(written(tmp_path, text), body)
    assert warnings == []
    np.testing.assert_array_equal(record.times, [0.0, 0.1, 0.3])
    np.testing.assert_allclose(record.signals[GYROS[0]], np.radians([1.5, math.nan, -2.0]))
    np.testing.assert_array_equal(record.signals[GYROS[2]], [3.0, 3.1, math.nan])


def test_dates_count_from_the_epoch_of_the_file(tmp_path: Path) -> None:
    body = nutdamp.example().with_(**WITH_EPOCH)
    text = "utc,axis_ra_deg,axis_dec_deg\n2026-03-01T12:00:01Z,90,0\n2026-03-01T13:00:02.5+01:00,0,30\n"
    record, _ = read_telemetry(written(tmp_path, text), body)
    np.testing.assert_array_equal(record.times, [1.0, 2.5])
    axis = np.column_stack([record.signals[name] for name in AXIS])
    np.testing.assert_allclose(axis, np.array([[0.0, 1.0, 0.0], [math.cos(math.pi / 6), 0.0, 0.5]]), atol=1e-15)


def test_sun_pulses_lie_between_the_samples_that_first_show_them(tmp_path: Path, body: Spacecraft) -> None:
    text = "t_s,sun_pulse\n0,0\n1,1\n2,1\n3,0\n3.5,1\n"
    record, _ = read_telemetry(written(tmp_path, text), body)
    np.testing.assert_allclose(record.sun_pulses, [0.5, 3.25])
    assert record.sun_step == 1.0
    assert record.signals == {}


def test_a_file_of_sun_pulses_and_an_acceleration(tmp_path: Path, body: Spacecraft) -> None:
    times = tmp_path / "sun.csv"
    times.write_text("t_s\n0.7\n2.8\n", encoding="utf-8")
    text = "t_s,acceleration_m_s2\n0,0.1\n1,0.2\n"
    record, _ = read_telemetry(written(tmp_path, text), body, times)
    np.testing.assert_array_equal(record.sun_pulses, [0.7, 2.8])
    np.testing.assert_array_equal(record.signals[ACCELERATION], [0.1, 0.2])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("omega_1_rad_s\n1\n", ["1:1: t_s: the column is missing (or utc)"]),
        ("t_s\n1\n", ["1:1: : no column of samples; expected some of omega_1_rad_s"]),
        ("t_s,omega_1\n1,2\n", ["1:1: omega_1: 'omega_1' is no column of telemetry; expected omega_1_rad_s …"]),
        ("t_s,omega_1_rpm,omega_2_rad_s\n1,2,3\n", ["1:1: omega_1_rpm: 'omega_1_rpm' is no column of telemetry"]),
        ("t_s,omega_1_rad_s,omega_1_deg_s\n1,2,3\n", ["1:1: omega_1_deg_s: given twice, also as omega_1_rad_s"]),
        ("t_s,axis_x,axis_y\n1,1,0\n", ["1:1: axis_z: the column is missing beside axis_x"]),
        ("t_s,utc,omega_1_rad_s\n1,2,3\n", ["1:1: utc: two columns of times"]),
        ("t_s,axis_x,axis_y,axis_z\n0,1,0,0\n1,1,1,0\n", ["3:1: axis_x: the axis has length 1.414"]),
        ("t_s,axis_ra_deg,axis_dec_deg\n0,1,100\n", ["2:1: axis_dec_deg: expected an angle of at most 90 deg"]),
        (
            "t_s,omega_1_rad_s\n0,1\n2,1\n1,1\n1,2\n",
            ["4:1: t_s: 1 does not rise: the sample before is at 2 s", "5:1: t_s: 1 does not rise"],
        ),
        ("t_s,omega_1_rad_s\n0,fast\n", ["2:1: omega_1_rad_s: 'fast' is not a number"]),
        ("t_s,omega_1_rad_s\n0,1,2\n", ["2:1: : 3 values under 2 columns"]),
        ("t_s,sun_pulse\n0,0\n1,2\n", ["3:1: sun_pulse: expected 0 or 1, got 2"]),
        ("t_s;omega_1_rad_s\n0;1\n", ["1:1: : columns are separated by commas"]),
        ("t_s,omega_1_rad_s\n", ["1:1: : no rows of samples"]),
        ("utc,omega_1_rad_s\n2026-03-01T12:00:00Z,1\n", ["1:1: utc: the spacecraft file has no attitude.epoch"]),
    ],
)
def test_faults_have_their_place(tmp_path: Path, body: Spacecraft, text: str, expected: list[str]) -> None:
    found = faults(tmp_path, text, body)
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        assert one.startswith(other)


def test_other_columns_are_ignored_and_said(tmp_path: Path, body: Spacecraft) -> None:
    text = "t_s,omega_1_rad_s,temperature\n0,1,20\n1,2,21\n"
    _, warnings = read_telemetry(written(tmp_path, text), body)
    assert len(warnings) == 1
    assert warnings[0].endswith("the column 'temperature' is not known: ignored")


def test_a_file_that_is_not_there(tmp_path: Path, body: Spacecraft) -> None:
    with pytest.raises(CannotRead):
        read_telemetry(tmp_path / "none.csv", body)
