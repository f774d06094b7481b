"""Every key of ``loop:`` with senseless values: each is refused where it stands, with what would be right."""

from __future__ import annotations

from support.contract import check_faults, faults
from support.golden import check_text

from nutdamp.files.loop_models import LoopFaultsSection, LoopSection, LoopSensorSection
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.spacecraft import Spacecraft

BODY = """\
name: Upper
inertia: {A: 100 kg m^2, C: 70 kg m^2}
omega0: [0.042 rad/s, 0.036 rad/s, 3 rad/s]
thrusters:
  - {name: +M1, torque: [20, 0, 0], min_on_time: 5 ms, max_on_time: 50 ms}
  - {name: -M2, torque: [0, -20, 0], min_on_time: 5 ms, max_on_time: 50 ms}
"""
GYRO = {"kind": "gyro", "rate": "100 Hz"}
ACCELEROMETER = {"kind": "accelerometer", "rate": "100 Hz", "position": "[1 m, 0, 0]"}

SENSELESS = {
    "sensor.kind": "star; 1",
    "sensor.rate": "0; -1; .nan; 100 m; 0.5 Hz; 1e9",
    "sensor.quantisation": "-1e-3; .inf; 2 deg/s; 1 m/s^2",
    "sensor.noise": "-1 deg/s; .nan; 1.0; 2 rpm; 1 m/s^2",
    "sensor.bias": ".inf; -2 deg/s; 1 m/s^2",
    "sensor.scale": "0; .inf; 2000 %; -0.01",
    "sensor.delay": "-1; .nan; 1e6; 1 deg",
    "sensor.low_pass": "-1; .inf; 1e6",
    "sensor.position": "[1, 0, 0]",
    "sensor.axis": "[0, 0, 1]",
    "law": "three-pulse",
    "start": "0; 2; 90 deg; .nan",
    "stop": "0.2 deg; -1 deg; .inf",
    "settle": "-1; 1e6",
    "min_interval": "-1; 1e9",
    "predict": "1",
    "alias": "'no'",
    "on_time": "0; 1 s; .inf",
    "faults.reversed": "[X]; +M1; [+M1, +M1]",
}
OF_ACCELEROMETER = {
    "sensor.quantisation": "1e3; 1 deg/s",
    "sensor.noise": "-1; 1 m/s^2; 1 deg/s",
    "sensor.bias": "1e9",
    "sensor.position": "[0, 0, 0]; [1, 0]; [1e9 m, 0, 0]",
    "sensor.axis": "[0, 0, 0]; [1, 1]",
}


def read(sensor: dict[str, str], key: str = "", value: str = "") -> Spacecraft:
    """A body with a loop, one key of which has another value."""
    section, _, last = key.rpartition(".")
    loop = {"sensor": dict(sensor), "start": "0.2 deg"}
    inner = loop.setdefault(section, {}) if section else loop
    if key:
        inner[last] = value
    return read_spacecraft(f"{BODY}loop: {flow(loop)}\n", "craft.yaml")


def flow(section: object) -> str:
    """A mapping on one line of YAML."""
    if isinstance(section, dict):
        return "{" + ", ".join(f"{key}: {flow(value)}" for key, value in section.items()) + "}"
    return str(section)


def test_senseless_values_of_every_key_are_refused_where_they_stand() -> None:
    keys = {key for key in LoopSection.fields() if key not in ("sensor", "faults")}
    keys |= {f"sensor.{key}" for key in LoopSensorSection.fields()}
    assert set(SENSELESS) == keys | {f"faults.{key}" for key in LoopFaultsSection.fields()}
    for name, sensor, table in (("gyro", GYRO, SENSELESS), ("accelerometer", ACCELEROMETER, OF_ACCELEROMETER)):
        assert read(sensor).loop is not None
        cases = [(key, value) for key, values in table.items() for value in values.split("; ")]
        check_faults(f"files.loop-{name}", lambda case, sensor=sensor: read(sensor, *case), cases)


def test_a_bias_that_may_be_larger_than_start_is_refused() -> None:
    text = f"{BODY}loop: {{sensor: {{kind: gyro, rate: 100 Hz}}, start: 0.2 deg}}\n"
    dispersed = f"{text}dispersions: {{sensor_bias: {{normal: 100 deg/s}}}}\n"
    check_text("files.loop-bias", "\n".join(faults(read_spacecraft, dispersed, "f.yaml")))
