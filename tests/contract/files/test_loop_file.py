"""Every key of ``loop:`` with senseless values: each is refused where it stands, with what would be right."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

import nutdamp
from nutdamp.errors import NutdampError
from nutdamp.files.loop_models import LoopFaultsSection, LoopSection, LoopSensorSection

pytestmark = pytest.mark.usefixtures("plans_shared")

BODY = """
name: Upper
inertia: {A: 100 kg m^2, C: 70 kg m^2}
omega0: [0.042 rad/s, 0.036 rad/s, 3 rad/s]
thrusters:
  - {name: +M1, torque: [20, 0, 0], min_on_time: 5 ms, max_on_time: 50 ms}
  - {name: -M2, torque: [0, -20, 0], min_on_time: 5 ms, max_on_time: 50 ms}
"""
GYRO = {"kind": "gyro", "rate": "100 Hz"}
ACCELEROMETER = {"kind": "accelerometer", "rate": "100 Hz", "position": ["1 m", 0, 0]}
INF, NAN = float("inf"), float("nan")
LATE = "nutation periods; expected at most 20 of them, 139.6 s"
UNIT = "not in a unit of a gyro: rad/s, deg/s or rpm"

SENSELESS: dict[str, list[tuple[Any, str]]] = {
    "sensor.kind": [("star", "expected 'gyro' or 'accelerometer'"), (1, "expected 'gyro'")],
    "sensor.rate": [
        (0, "above 0"),
        (-1, "above 0"),
        (NAN, "not a finite number"),
        ("100 m", "is a length"),
        ("0.5 Hz", "below four times the nutation frequency; expected at least 0.573 Hz"),
        (1e9, "more than a million samples a nutation period of 6.981 s; expected at most 1.432e+05 Hz"),
    ],
    "sensor.quantisation": [
        (-1e-3, "-0.001 is out of range; expected at least 0"),
        (INF, "not a finite number"),
        ("2 deg/s", "2 deg/s hides start, which shows as 0.42 deg/s; expected at most 0.84 deg/s"),
        ("1 m/s^2", UNIT),
    ],
    "sensor.noise": [
        ("-1 deg/s", "'-1 deg/s' is out of range; expected at least 0"),
        (NAN, "not a finite number"),
        (1.0, "1 rad/s hides start, which shows as 0.00733 rad/s"),
        ("2 rpm", "2 rpm hides start, which shows as 0.07 rpm"),
        ("1 m/s^2", UNIT),
    ],
    "sensor.bias": [
        (INF, "not a finite number"),
        ("-2 deg/s", "-2 deg/s hides start, which shows as 0.42 deg/s"),
        ("1 m/s^2", UNIT),
    ],
    "sensor.scale": [(0, "shows nothing"), (INF, "not a finite"), ("2000 %", "10 % to 1000 %"), (-0.01, "no scale")],
    "sensor.delay": [(-1, "at least 0"), (NAN, "not a finite number"), (1e6, LATE), ("1 deg", "is an angle")],
    "sensor.low_pass": [(-1, "at least 0"), (INF, "not a finite number"), (1e6, LATE)],
    "sensor.position": [([1, 0, 0], "is for kind: accelerometer")],
    "sensor.axis": [([0, 0, 1], "is for kind: accelerometer")],
    "law": [("three-pulse", "expected 'four-pulse', 'one-pulse' or 'bang'")],
    "start": [
        (0, "above 0 and below 90 deg"),
        (2, "read as radians; write 2 deg"),
        ("90 deg", "below 90 deg"),
        (NAN, "not a finite number"),
    ],
    "stop": [
        ("0.2 deg", "is not below start; expected less than 0.2 deg"),
        ("-1 deg", "at least 0"),
        (INF, "not a finite number"),
    ],
    "settle": [(-1, "at least 0"), (1e6, LATE)],
    "min_interval": [(-1, "at least 0"), (1e9, "expected at most 10000 of them")],
    "predict": [(1, "expected true or false")],
    "alias": [("no", "expected true or false")],
    "on_time": [
        (0, "is outside what +M1 allows: 0.005 s to 0.05 s"),
        ("1 s", "outside what +M1 allows"),
        (INF, "finite"),
    ],
    "faults.reversed": [
        (["X"], "no channel is called 'X'"),
        ("+M1", "expected a list"),
        (["+M1", "+M1"], "'+M1' is named twice"),
    ],
}
OF_ACCELEROMETER: dict[str, list[tuple[Any, str]]] = {
    "sensor.quantisation": [(1e3, "1000 m/s^2 hides start"), ("1 deg/s", "unit of an accelerometer: m/s^2")],
    "sensor.noise": [(-1, "-1 is out of range"), ("1 m/s^2", "hides start"), ("1 deg/s", "an accelerometer: m/s^2")],
    "sensor.bias": [(1e9, "no bias of an accelerometer; expected at most 1000 m/s^2")],
    "sensor.position": [([0, 0, 0], "blind"), ([1, 0], "expected 3 entries"), (["1e9 m", 0, 0], "at most 1000 m")],
    "sensor.axis": [([0, 0, 0], "zero; expected a direction"), ([1, 1], "expected 3 entries")],
}


def cases() -> Iterator[tuple[dict[str, Any], str, Any, str]]:
    for sensor, table in ((GYRO, SENSELESS), (ACCELEROMETER, OF_ACCELEROMETER)):
        for key, rows in table.items():
            for value, message in rows:
                yield sensor, key, value, message


def body(sensor: dict[str, Any], key: str = "", value: Any = None, **more: Any) -> dict[str, Any]:
    loop: dict[str, Any] = {"sensor": dict(sensor), "start": "0.2 deg"}
    if key:
        *path, last = key.split(".")
        section = loop
        for name in path:
            section = section.setdefault(name, {})
        section[last] = value
    return {**yaml.safe_load(BODY), "loop": loop, **more}


def test_every_key_of_a_loop_is_tried() -> None:
    keys = {key for key in LoopSection.fields() if key not in ("sensor", "faults")}
    keys |= {f"sensor.{key}" for key in LoopSensorSection.fields()} | {
        f"faults.{key}" for key in LoopFaultsSection.fields()
    }
    assert set(SENSELESS) == keys
    for sensor in (GYRO, ACCELEROMETER):
        assert nutdamp.load(body(sensor)).loop is not None


@pytest.mark.parametrize(("sensor", "key", "value", "message"), list(cases()))
def test_a_senseless_value_is_refused_where_it_stands(
    sensor: dict[str, Any], key: str, value: Any, message: str, tmp_path: Path
) -> None:
    (tmp_path / "craft.yaml").write_text(yaml.safe_dump(body(sensor, key, value)))
    with pytest.raises(NutdampError) as raised:
        nutdamp.load(tmp_path / "craft.yaml")
    said = str(raised.value)
    assert f"loop.{key}" in said
    assert message in said


def test_a_bias_that_may_be_larger_than_start_is_refused() -> None:
    with pytest.raises(NutdampError, match=r"sensor_bias\.normal: 100 deg/s hides start, which shows as 0\.42 deg/s"):
        nutdamp.load(body(GYRO, dispersions={"sensor_bias": {"normal": "100 deg/s"}}))
