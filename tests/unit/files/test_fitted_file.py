"""The spacecraft file with the estimates of a fit: read back it is the body of the fit, and all else stays."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pytest
from support.builders import noted
from support.golden import check_text
from support.hand_made_fit import silent, told

from nutdamp.estimation.results import carried, correlations, replaced
from nutdamp.files.carried import fitted_text, notes
from nutdamp.files.editing import parse_setting
from nutdamp.files.reader import Source, read_spacecraft
from nutdamp.physics.thruster import Trapezoid
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

GYROS = ("omega_1", "omega_2", "omega_3")
FILE = """\
name: fitted  # its name
inertia: {A: 120 kg m^2, C: 80}  # moments
state:
  spin: 30 rpm
  nutation: 5 deg  # at t = 0
attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [0.9, 0.1, 0.2, 0.3]}
goal: {tilt: 20 deg, azimuth: 0.5}
valve: {open_delay: 10 ms, close_delay: 12 ms}
thrusters:
  - {name: T1, position: [0, 0.5, 0.8], direction: [0, -1, 0], force: 10 N, isp: 220 s}  # pushed
  - {name: T 2, torque: [0, 8 N m, 0], lever_arm: 1 m, isp: 220 s, valve: {open_delay: 0.02, close_delay: 0.02}}
  - {name: T3, torque: [0, -8, 0], lever_arm: 1 m, isp: 220 s}
tank: {propellant: 10 kg, pressure: 2e6, final_pressure: 1e6}
limits: {horizon: 90 s, earliest: 1 s}
loop:
  sensor: {kind: accelerometer, rate: 10 Hz, position: [0.8 m, 0, 0], axis: [0, 0, 1]}
  law: four-pulse
  start: 0.5 deg
  stop: 0.05 deg
dispersions:
  {A: {normal: 0.5 %}, C: {normal: 0.5 %}, thrust: {T1: {normal: 3 %}, T 2: {normal: 3 %}, T3: {normal: 2 %}}}
"""
# fmt: off
EVERYTHING = {
    "A": 121.0, "C/A": 0.7, "omega_1": 0.1, "omega_2": -0.2, "omega_3": 3.1, "attitude_1": 0.01, "attitude_2": -0.02,
    "attitude_3": 0.3, "bias_omega_1": 1e-3, "wobble_2": 2e-3, "bias_acceleration": 0.03, "thrust T1": 0.96,
    "thrust T 2": 1.05, "delay T1": 0.005, "delay T 2": -0.015,
}
# fmt: on
SIGMAS = {"A": 0.4, "C/A": 1e-3, "omega_1": 1e-3, "thrust T1": 0.01, "attitude_1": 2e-3, "attitude_2": 2e-3}


def test_the_file_holds_all_that_is_known_now() -> None:
    settings = (parse_setting("thrusters.T3.torque[1]=-9"), parse_setting("mass=200 kg"))
    body = Source(FILE, "f.yaml", settings).read()
    fired = Schedule(tuple(channel_pulse(one, t, 0.5) for one, t in zip(body.channels, (3.0, 6.0), strict=False)))
    record = silent(*GYROS, "axis_x", "axis_y", "axis_z", "acceleration", schedule=fired)
    fit = told(body, record, EVERYTHING, SIGMAS)
    known = carried(fit, 7.5)
    text = fitted_text(fit, known)
    now = read_spacecraft(text, "now.yaml")
    expected = replaced(body, known)
    assert now.inertia.moments == pytest.approx((121.0, 121.0, 84.7))
    assert now.omega0 == pytest.approx(expected.omega0, rel=1e-9)
    assert (now.attitude is not None, now.mass) == (True, 200.0)
    assert abs(now.initial.quaternion @ expected.initial.quaternion) == pytest.approx(1.0, abs=1e-12)
    assert now.target_axis == pytest.approx(body.target_axis, abs=1e-9)  # though t = 0 is another now
    assert now.attitude is not None
    assert (now.attitude.epoch or "").startswith("2026-03-01T12:00:07.5")
    thrusters = [one.thrusters[0] for one in now.channels]
    assert [one.torque[1] for one in thrusters[1:]] == pytest.approx([8.0 * 1.05, -9.0])
    assert thrusters[0].force == pytest.approx([0.0, -9.6, 0.0])
    valves = [one.valve for one in thrusters]
    assert all(isinstance(one, Trapezoid) for one in valves)
    delays = [(one.open_delay, one.close_delay) for one in valves if isinstance(one, Trapezoid)]
    assert np.ravel(delays) == pytest.approx([0.015, 0.017, 0.005, 0.005, 0.01, 0.012])
    assert now.loop is not None
    assert now.loop.sensor.bias == pytest.approx(0.03)
    spread, sigmas = now.dispersions, dict(zip(known.names, known.sigmas, strict=True))
    assert spread is not None
    assert spread.A is not None
    assert spread.A.size == pytest.approx(0.4 / 121.0, rel=1e-5)
    sizes = [tolerance and tolerance.size for tolerance in (*spread.omega0, spread.attitude)]
    rates = [sigmas[f"omega0_{axis}"] for axis in (1, 2, 3)]
    assert sizes == pytest.approx([*rates, known.tilt], rel=1e-5)
    assert {name: one.size for name, one in spread.thrust.items()} == pytest.approx(
        {"T1": 0.01 / 0.96, "T 2": 1e-7 / 1.05, "T3": 0.02}, rel=1e-5
    )
    assert spread.correlation == correlations(known, body.dispersions)
    assert re.findall("#.*", text) == re.findall("#.*", FILE)
    units = "kg m^2", "rpm", "deg", "N", "N m", "ms"
    assert [bool(re.search(rf"[\d.] {re.escape(unit)}\b", text)) for unit in units] == [True] * 6
    check_text("files.fitted-notes", noted(notes(fit, known)))


CASES: dict[str, tuple[str, Mapping[str, float], bool]] = {
    "three moments, other axes": ("inertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 5 deg}\n", {}, True),
    "tensor": ("inertia: {tensor: [[120, 0, 1], [0, 110, 2], [1, 2, 80]]}\nomega0: [0.1, 10 deg/s, 3]\n", {}, True),
    "decay": ("inertia: {A: 80, C: 120}\nomega0: [0.1, 0.2, 3]\ndissipation: {time_constant: 5 min}\n", {}, False),
    "odd": ("inertia: {A: 80, C: 120}\nomega0: [0.1, 0.2, 3]\n", {"growth": 0.002}, False),
    "not seen": ("inertia: {A: 80, C: 120}\nomega0: [0.1, 0.2, 3]\n", {"growth": 1e-8}, False),
}


@pytest.mark.parametrize("name", CASES)
def test_bodies_of_any_kind_are_written_as_the_file_has_them(name: str) -> None:
    """Tensors and rates where A, C and angles do not tell it; a growth that dissipation would not cause is said."""
    text, given, unequal = CASES[name]
    text = "name: x\n" + text
    body = Source(text, "f.yaml").read()
    values = {"omega_1": 0.11, "omega_3": -2.9 if "axes" in name else 3.2, **given}
    values |= {"unequal_1": 0.05, "unequal_2": 0.02} if unequal else {"growth": -0.002, **given}
    fit = told(body, silent(*GYROS), values, {}, unequal=unequal)
    known = carried(fit, 4.0)
    written = fitted_text(fit, known)
    now = read_spacecraft(written, "now.yaml")
    bodies = now.inertia, known.body.inertia
    tensors = [body.axes @ np.diag(body.moments) @ body.axes.T for body in bodies]
    assert tensors[0] == pytest.approx(tensors[1], rel=1e-9, abs=1e-8)
    assert now.inertia.axes @ now.omega0 == pytest.approx(known.values[2:5], rel=1e-9)
    if not unequal:
        assert now.growth == pytest.approx(values["growth"] if name != "not seen" else 0.0)
    shape = re.sub(r"\b\d[\d.e-]*", "#", written.partition("dispersions")[0])
    check_text(f"files.fitted-{name.split()[0]}", shape + noted(notes(fit, known)))


def test_thrusters_that_did_not_fire_and_delays_that_no_valve_has_are_said() -> None:
    body = Source(FILE, "f.yaml").read()
    fired = Schedule(tuple(channel_pulse(one, t, 0.5) for one, t in zip(body.channels, (2.0, 4.0, 6.0), strict=True)))
    values = {"thrust T1": 0.01, "thrust T 2": -0.9, "delay T1": -0.5, "delay T3": -0.02}
    fit = told(body, silent(*GYROS, schedule=fired), values, {})
    known = carried(fit, 0.0)
    check_text("files.fitted-doubts", noted(notes(fit, known)))
    text = fitted_text(fit, known)
    now = read_spacecraft(text, "now.yaml")
    assert "epoch: 2026-03-01T12:00:00Z" in text  # as it was
    assert [one.thrusters[0].torque for one in now.channels[:2]] == [
        pytest.approx(one.thrusters[0].torque) for one in body.channels[:2]
    ]
    assert [one.valve for one in now.channels] == [one.valve for one in body.channels]
