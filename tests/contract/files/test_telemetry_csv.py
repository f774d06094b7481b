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
from nutdamp.estimation.signals import ACCELERATION, AXIS, GYROS, Record
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
    "t_s,omega_1_rad_s\n0,fast\n",
    "t_s,omega_1_rad_s\n0,1,2\n",
    "t_s,sun_pulse\n0,0\n1,2\n",
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
