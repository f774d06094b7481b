"""The JSON schema of spacecraft files: what it takes and what not, and that it explains every key."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from typing import Any

from jsonschema import Draft202012Validator

from nutdamp.files.reader import example_text, json_schema, read_spacecraft
from nutdamp.files.yaml import read_tree

SCHEMA = json_schema()
VALIDATOR = Draft202012Validator(SCHEMA)


def plain(text: str) -> Any:
    """What a text of YAML says."""
    return read_tree(text, "f.yaml")[0].plain()


EVERYTHING = plain("""\
name: Sat
mass: 250 kg
inertia: {A: 120 kg m², C: 80}
omega0: [0.1, 2 deg/s, 30rpm]
attitude: {quaternion: [1, 0, 0, 0], epoch: "2026-03-01T12:00:00Z", frame: GCRF}
thrusters:
  - {name: a, position: [0, 0, 0.8 m], direction: [1, 0, 0], force: 10 N, isp: 220 s}
  - {name: b, torque: [8 N m, 8 N*m, 0], lever_arm: 800 mm, min_on_time: 0, max_on_time: 2 s}
channels: {both: [a, b]}
steerable: {torque: 20 Nm, isp: 220, lever_arm: 1}
disturbances:
  - {name: leak, torque: [20 mN m, 0, 0.1]}
  - {kind: rotating, torque: [0.1, 0, 0], rate: -3 rad/s}
  - {torque: [0.1, 0, 0], fixed_in: inertial}
  - {kind: axial, torque: -1 mN m}
  - {kind: axial, torque: [0, 0, 1]}
  - {kind: constant, torque: [0, 0, 1]}
dissipation: {time_constant: 10 min}
requirement: {nutation: 0.5 deg, momentum_shift: 3 mrad, probability: 99.7 %}
dispersions:
  A: {normal: 2 %}
  C: {uniform: 1.6 kg m^2}
  omega0: [{normal: 0.1 deg/s}, {bias: -0.01}, {normal: 1 %}]
  thrust: {a: {normal: 0.3 N}, b: {triangular: 5 %}}
  thrust_per_pulse: {normal: 0.01}
  thrust_direction: {normal: 0.5 deg}
  position: {b: {normal: 5 mm}}
  timing: {uniform: 5 ms}
  timing_offset: {bias: -2 ms}
  attitude: {normal: 0.2 deg}
limits: {horizon: 2 min, earliest: 5, gap: 0.5, tick: 1 ms, max_pulses: 8, blackout: [[10, 20]]}
""")


def changed(path: str, value: object) -> dict[str, Any]:
    """`EVERYTHING` with one value changed, or left out where ``value`` is None."""
    contents: dict[str, Any] = copy.deepcopy(EVERYTHING)
    *parents, last = (int(step) if step.isdigit() else step for step in path.split("."))
    at: Any = contents
    for step in parents:
        at = at[step]
    if value is None:
        del at[last]
    else:
        at[last] = value
    return contents


def nodes(schema: object) -> Iterator[dict[str, Any]]:
    """All mappings within a schema."""
    if isinstance(schema, dict):
        yield schema
    inner = schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ()
    for part in inner:
        yield from nodes(part)


def test_it_is_a_schema_of_2020_12_in_plain_json() -> None:
    Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert json.loads(json.dumps(SCHEMA)) == SCHEMA


SLIPS = """
mas: [250 kg]
limits.horizn: [5]
thrusters.0: [{name: a, position: [0, 0, 0.8], direction: [1, 0, 0]}, {name: a, torque: [8, 0, 0], force: 10}]
thrusters.0.forse: [5]
thrusters.0.torque: [[8, 0, 0]]
thrusters.0.lever_arm: [1]
name: [null, "", 5]
inertia: [null, {A: 120}, {A: 0, C: 80}, {A: 120 kg, C: 80}, {A: 1, C: 1, tensor: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}]
mass: [true, "250"]
omega0: [null, [1, 2], [1, 2, 20 Hz]]
state: [{spin: 3, nutation: 0}]
attitude.frame: [ICRF]
attitude.epoch: ["2026-03-01"]
attitude.quaternion: [["1", 0, 0, 0]]
channels: [{}, {both: []}]
disturbances.0.torque: [null, 20 mN m, [1, 2]]
disturbances.0.kind: [Constant, rotating]
disturbances.0.nme: [leak]
disturbances.1.rate: [null, -3 rad]
disturbances.1.fixed_in: [inertial]
disturbances.1.kind: [constant]
disturbances.1.torque: [1]
disturbances.2.fixed_in: [body]
disturbances.2.kind: [axial]
disturbances.3.kind: [null]
disturbances.3.torque: [1 N]
disturbances.3.rate: [3]
dissipation: [600, {}, {time_constant: 0}, {time_constant: 600 N}]
requirement: [{nutation: 2.0}, {nutation: 0.1, probability: 1}]
limits: [{max_pulses: 0}, {max_pulses: 1.5}, {blackout: [10, 20]}]
dispersions.A: [2 %, {}, {normal: 2 mm}, {sigma: 2 %}, {normal: -1}, {normal: 2 %, bias: 1 %}]
dispersions.omega0: [[{normal: 1}, {normal: 1}]]
dispersions.thrust.a: [0.3]
dispersions.position: [{}]
dispersions.timing: [{normal: 5 %}]
dispersions.tming: [{normal: 5 ms}]
"""
SPELLINGS = """
thrusters.0.position: [[30 cm, 0.001 km, 5mm]]
thrusters.0.min_on_time: [0.02 sec]
limits.horizon: [2 hours]
omega0.2: [30 RPM]
omega0.1: [2 degrees/sec, 2°/s]
requirement.nutation: [0.5°, 0.5 degrees]
dispersions: [{omega0: {normal: 0.1}, thrust: {normal: 3 %}, A: {bias: -1}}]
dispersions.timing: [{normal: 0.1 sec}]
"""


def test_what_validates_and_what_not() -> None:
    VALIDATOR.validate(plain(example_text()))
    VALIDATOR.validate(EVERYTHING)
    VALIDATOR.validate({"name": "S", "inertia": {"tensor": [[1, 0, 0]] * 3}, "state": {"spin": 3, "nutation": 0}})
    for expected, table in ((True, SPELLINGS), (False, SLIPS)):
        for path, values in plain(table).items():
            for value in values:
                assert VALIDATOR.is_valid(changed(path, value)) == expected, (path, value)


def test_keywords_are_in_the_order_of_the_alphabet_and_keys_in_that_of_the_file() -> None:
    for section in [SCHEMA, *SCHEMA["$defs"].values()]:
        for key, field in section["properties"].items():
            assert list(field) == sorted(field), key
    names = list(SCHEMA["properties"])
    assert names.index("name") < names.index("inertia") < names.index("thrusters") < names.index("limits")


def test_every_key_is_explained_and_has_an_example_that_is_valid() -> None:
    """Each example alone, and all of those of the root that go together; no key takes null."""
    sections = [SCHEMA, *SCHEMA["$defs"].values()]
    assert sum(len(section["properties"]) for section in sections) > 60
    for section in sections:
        assert section["additionalProperties"] is False
        assert section["description"]
        for key, field in section["properties"].items():
            assert len(field["description"]) > 5, key
            assert field["examples"], key
            validator = Draft202012Validator({**field, "$defs": SCHEMA["$defs"]})
            for example in field["examples"]:
                validator.validate(example)
    keys = SCHEMA["properties"].items()
    root = {key: field["examples"][0] for key, field in keys if key not in ("omega0", "channels")}
    assert read_spacecraft(json.dumps(root), "examples").name == root["name"]
    assert not any(node.get("type") == "null" or node.get("default", 0) is None for node in nodes(SCHEMA))
