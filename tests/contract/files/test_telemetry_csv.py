"""Telemetry files: what is read, and every fault with its place."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.contract import Write, check_faults, faults
from support.golden import check_text

import nutdamp
from nutdamp.errors import CannotRead
from nutdamp.estimation.parameters import ACCELERATION, AXIS, DIRECTION, GYROS, QUATERNION, SEEN, SUN_ASPECT, Record
from nutdamp.files import tabular
from nutdamp.files.telemetry import read_telemetry

BODY = nutdamp.example()
DATED = BODY.with_(attitude={"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"})
Read = Callable[..., tuple[Record, list[str]]]


@pytest.fixture
def read(write: Write) -> Read:
    """``read(text, body, sun)``: a file of that text, and one of the times of Sun pulses."""
    return lambda text, body=BODY, sun="": read_telemetry(
        write(text, "flight.csv"), body, write(sun, "sun.csv") if sun else None
    )


def test_signals_in_all_their_units(read: Read) -> None:
    record, warnings = read("t_s,omega_1_deg_s,omega_3_rad_s\n0,1.5,3\n0.1,,3.1\n0.3,-2,nan\n")
    assert warnings == []
    assert_array_equal(record.times, [0.0, 0.1, 0.3])
    assert_allclose(record.signals[GYROS[0]], np.radians([1.5, math.nan, -2.0]))
    assert_array_equal(record.signals[GYROS[2]], [3.0, 3.1, math.nan])
    # Dates count from the epoch of the spacecraft file.
    text = "utc,axis_ra_deg,axis_dec_deg\n2026-03-01T12:00:01Z,90,0\n2026-03-01T13:00:02.5+01:00,0,30\n"
    record, _ = read(text, DATED)
    assert_array_equal(record.times, [1.0, 2.5])
    axis = np.column_stack([record.signals[name] for name in AXIS])
    assert_allclose(axis, [[0.0, 1.0, 0.0], [math.cos(math.pi / 6), 0.0, 0.5]], atol=1e-15)


def test_sun_pulses_by_samples_and_by_a_file_of_their_own(read: Read) -> None:
    """They lie between the samples that first show them."""
    record, _ = read("t_s,sun_pulse\n0,0\n1,1\n2,1\n3,0\n3.5,1\n")
    assert_allclose(record.sun_pulses, [0.5, 3.25])
    assert (record.sun_step, record.signals) == (1.0, {})
    record, _ = read("t_s,acceleration_m_s2\n0,0.1\n1,0.2\n", sun="t_s\n0.7\n2.8\n")
    assert_array_equal(record.sun_pulses, [0.7, 2.8])
    assert_array_equal(record.signals[ACCELERATION], [0.1, 0.2])


def test_a_crossing_is_of_the_direction_in_its_row_or_of_the_sun(read: Read) -> None:
    sunny = DATED.with_(sun="epoch")
    assert sunny.sun is not None
    crossed = "crossing_azimuth_deg,crossing_elevation_deg"
    record, _ = read(f"t_s,{crossed},crossing_ra_deg,crossing_dec_deg\n0,90,0,0,-90\n1,0,30,,\n2,,,,\n", sunny)
    times, rows = record.samples((*SEEN, *DIRECTION))
    assert_array_equal(times, [0.0, 1.0])
    assert_allclose(rows[:, :3], [[0.0, 1.0, 0.0], [math.cos(math.pi / 6), 0.0, 0.5]], atol=1e-15)
    assert_allclose(rows[:, 3:], np.array([[0.0, 0.0, -1.0], sunny.sun.tolist()]), atol=1e-15)
    record, _ = read(f"t_s,{crossed}\n0,90,0\n", sunny)
    assert_allclose(record.samples(DIRECTION)[1], [sunny.sun])


def test_quaternions_give_the_axis_and_the_turn_in_place_of_an_axis(read: Read) -> None:
    half = math.sqrt(0.5)
    record, _ = read(f"t_s,q_w,q_x,q_y,q_z,axis_x,axis_y,axis_z\n0,{half},{half},0,0,1,0,0\n1,,,,,1,0,0\n")
    times, turned = record.samples(QUATERNION)
    assert_array_equal(times, [0.0])
    assert_allclose(turned, [[half, half, 0.0, 0.0]])
    assert_allclose(record.samples(AXIS)[1], [[0.0, -1.0, 0.0]], atol=1e-15)


def test_sun_aspect_angles_are_those_of_their_rows_or_of_the_pulses_in_a_file(read: Read) -> None:
    record, _ = read("t_s,sun_aspect_deg\n0,60\n2,\n")
    assert_allclose(record.signals[SUN_ASPECT], [math.pi / 3, math.nan])
    record, _ = read("t_s,omega_1_rad_s\n0,0.1\n1,0.2\n2,0.3\n", sun="t_s,sun_aspect_deg\n0.5,90\n1,60\n")
    assert_array_equal(record.times, [0.0, 0.5, 1.0, 2.0])
    assert_array_equal(record.sun_pulses, [0.5, 1.0])
    assert_allclose(record.signals[SUN_ASPECT], [math.nan, math.pi / 2, math.pi / 3, math.nan])
    assert_array_equal(record.signals[GYROS[0]], [0.1, math.nan, 0.2, 0.3])


FAULTY = (
    "omega_1_rad_s\n1\n",
    "t_s\n1\n",
    "t_s,omega_1\n1,2\n",
    "t_s,omega_1_rpm,omega_2_rad_s\n1,2,3\n",
    "t_s,omega_1_rad_s,omega_1_deg_s\n1,2,3\n",
    "t_s,axis_x,axis_y\n1,1,0\n",
    "t_s,utc,omega_1_rad_s\n1,2,3\n",
    "t_s,axis_x,axis_y,axis_z\n0,1,0,0\n1,1,1,0\n",
    "t_s,axis_ra_deg,axis_dec_deg\n0,1,100\n",
    "t_s,omega_1_rad_s\n0,1\n2,1\n1,1\n1,2\n",
    "t_s,omega_1_rad_s,pulse\n0,1,0\n0,2,1\n",
    "t_s,omega_1_rad_s\n0,fast\n",
    "t_s,omega_1_rad_s\n0,1,2\n",
    "t_s,sun_pulse\n0,0\n1,2\n",
    "t_s,q_w,q_x,q_y\n0,1,0,0\n",
    "t_s,q_w,q_x,q_y,q_z\n0,1,0,0,\n1,2,0,0,0\n",
    "t_s,q_w,q_x,q_y,q_z\n0,2,0,0,0\n",
    "t_s,crossing_azimuth_deg\n0,1\n",
    "t_s,crossing_ra_deg,crossing_dec_deg\n0,1,2\n",
    "t_s,crossing_azimuth_deg,crossing_elevation_deg\n0,400,0\n1,5,-91\n",
    "t_s,crossing_azimuth_deg,crossing_elevation_deg\n0,5,\n1,5,1\n",
    "t_s,crossing_azimuth_deg,crossing_elevation_deg,crossing_ra_deg,crossing_dec_deg\n0,5,1,,4\n",
    "t_s,crossing_az_deg,sun_aspect,q_1\n0,5,1,1\n",
    "t_s,sun_aspect_deg\n0,181\n",
    "t_s;omega_1_rad_s\n0;1\n",
    "t_s,omega_1_rad_s\n",
    "utc,omega_1_rad_s\n2026-03-01T12:00:00Z,1\n",
)


def test_faults_have_their_place_and_columns_not_known_are_said(read: Read, tmp_path: Path) -> None:
    check_faults("files.telemetry", read, FAULTY)
    for many in (1, 2):  # one more than is shown is shown too, of two more their number
        rows = "".join(f"{number},x\n" for number in range(tabular.MOST_FAULTS + many))
        shown = faults(read, f"t_s,omega_1_rad_s\n{rows}")
        assert len(shown) == tabular.MOST_FAULTS + 1
        assert ("such rows" in shown[-1]) == (many == 2)
    _, warnings = read("t_s,omega_1_rad_s,temperature\n0,1,20\n1,2,21\n")
    check_text("files.telemetry-column", "\n".join(warnings))
    with pytest.raises(CannotRead):
        read_telemetry(tmp_path / "none.csv", BODY)
