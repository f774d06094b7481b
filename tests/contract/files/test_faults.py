"""Spacecraft files that are refused or doubted: each gives exactly its faults, at their places,
with a cure.
"""

import json
import warnings
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from support import places
from support.builders import within
from support.cases import deep
from support.contract import BASE, BODY, BROKEN, SPIN, THRUSTERS, check_faults, slips
from support.golden import check_text

import nutdamp
from nutdamp.errors import Fault, FaultyFile
from nutdamp.files.editing import overlay, parse_setting, settings_of
from nutdamp.files.keys import SECTIONS
from nutdamp.files.reader import example_text, json_schema, load_spacecraft, read_spacecraft
from nutdamp.files.yaml import read_tree


def faults_of(text: str) -> list[Fault]:
    with pytest.raises(FaultyFile) as caught:
        read_spacecraft(text, "f.yaml")
    return caught.value.faults


@pytest.mark.parametrize("first", [0, deep(1)])
def test_broken_files(first: int) -> None:
    """Every other file from the first on."""
    assert len(BROKEN) >= 200
    wrong = {}
    for name, (text, expected) in islice(BROKEN.items(), first, None, 2):
        faults = faults_of(text)
        places = [f"{fault.line}:{fault.column}: {fault.where}" for fault in faults]
        alike = places == [": ".join(line.split(": ")[:2]) for line in expected]
        pairs = zip(faults, expected, strict=False)
        if not alike or not all(line.split(": ", 2)[2] in fault.problem for fault, line in pairs):
            wrong[name] = list(map(str, faults))
        assert not any("\n" in str(fault) for fault in faults)
    assert wrong == {}
    for text in (BASE, THRUSTERS):  # what they are made of is sound
        read_spacecraft(text, "f.yaml")


def test_all_faults_of_one_file_at_once_in_its_order() -> None:
    """In a value that is repeated they stand where it is written."""
    several = """\
name: Sat
mass: 0 kg
inertia: {A: 120 kg, C: 80 kg m^2}
state: {spin: 0 rpm, nutation: 95 deg}
thrusters:
  - {name: T1, torque: [0, 0, 0]}
  - {name: T1, torque: [0, 8, 0], isp: -1 s}
channels: {a: [T9]}
limits: {horizon: 10 s, earliest: 20 s, blackout: [[5 s, 2 s]]}
paintwork: red
"""
    repeated = BASE + "thrusters:\n- &t {name: T1, torque: [8, 0, 0], isp: 0}\n- *t\n"
    texts = (several, repeated, SPIN + "inertia: {A: 120 kg, C: 80}\n")
    check_text(
        "files.several-faults", "\n\n".join("\n".join(map(str, faults_of(text))) for text in texts)
    )


def test_very_many_faults_are_found_in_few_calls() -> None:
    names = ", ".join(f"N{number}" for number in range(300))
    thrusters = "".join(f"- {{name: T{number}, torque: [0, 0, 0]}}\n" for number in range(60))
    with within(420_000):  # 1,000 to 1,100 a fault, however many there are
        assert len(faults_of(f"{BASE}thrusters:\n{thrusters}channels: {{a: [{names}]}}\n")) == 360


def judge(outcome: Callable[[], nutdamp.Spacecraft]) -> None:
    """A sound spacecraft or faults; anything else that is raised is a bug."""
    try:
        spacecraft = outcome()
    except FaultyFile as error:
        said = list(map(str, error.faults))
    else:
        assert 0 < spacecraft.inertia.C <= 2 * spacecraft.inertia.A * (1 + 1e-9)
        assert spacecraft.spin != 0
        return
    assert said
    assert not any("\n" in fault for fault in said)
    assert all(fault.encode() for fault in said)


@pytest.mark.deep
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(lines=slips(example_text()), extra=st.binary(max_size=4), place=st.integers(0, 5000))
def test_a_mutated_example_is_read_or_refused(
    lines: list[str], extra: bytes, place: int, tmp_path: Path
) -> None:
    data = "".join(lines).encode("utf-8", "surrogatepass")
    path = tmp_path / "spacecraft.yaml"
    path.write_bytes(data[:place] + extra + data[place:])
    judge(lambda: load_spacecraft(path))


VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.floats()
    | st.sampled_from(["3 kg", "x", "1 s"]),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4)
    ),
    max_leaves=6,
)
DISTURBANCES = st.fixed_dictionaries(
    {"torque": VALUES | st.lists(st.floats(-1, 1) | st.just(0), min_size=3, max_size=3)},
    optional={
        "name": st.sampled_from(["a", "b", ""]) | VALUES,
        "kind": st.sampled_from(["constant", "rotating", "axial", "x"]) | VALUES,
        "rate": st.just("-3 rad/s") | VALUES,
        "fixed_in": st.sampled_from(["inertial", "body"]) | VALUES,
    },
)


@settings(max_examples=40)
@given(
    entry=st.tuples(st.just("disturbances"), st.lists(DISTURBANCES, max_size=3))
    | st.tuples(
        st.sampled_from(
            [
                *[
                    "inertia",
                    "omega0",
                    "state",
                    "attitude",
                    "thrusters",
                    "channels",
                    "steerable",
                    "requirement",
                    "limits",
                ],
                "disturbances",
                "dissipation",
            ]
        ),
        VALUES,
    )
)
def test_any_value_of_any_shape_is_read_or_refused(entry: tuple[str, object]) -> None:
    key, value = entry
    lines = [line for line in BASE.splitlines() if not line.startswith(key)]
    judge(lambda: read_spacecraft("\n".join([*lines, f"{key}: {json.dumps(value)}"]), "f.yaml"))


# --- numbers without a unit that are hardly meant
# --------------------------------------------------------------------

THRUSTER = (
    "thrusters: [{{name: T, position: [0, {}, 0.8], direction: [1, 0, 0], force: 10, "
    "min_on_time: {}}}]\n"
)


def whole(lines: str) -> str:
    """A file that has these lines, and what else it needs before them."""
    return (
        lines
        if lines.startswith("name")
        else (BODY if lines.startswith(("state", "omega0")) else BASE) + lines
    )


def doubts_of(lines: str) -> list[Fault]:
    doubts: list[Fault] = []
    read_spacecraft(whole(lines), "f.yaml", warn=doubts.append)
    return doubts


def test_numbers_beyond_what_can_be_meant_are_taken_with_a_warning() -> None:
    said = (
        "\n    ".join(
            [lines.strip().replace("\n", " | "), *(doubt.as_warning for doubt in doubts_of(lines))]
        )
        for lines in (
            "state: {spin: 30, nutation: 0.1}",
            "state: {spin: 15, nutation: 0.1}",
            "state: {spin: -101.5, nutation: 0.1}",
            "state: {spin: 3, nutation: 0.1, phase: 40}",
            "omega0: [0.1, 0, 180]",
            "state: {spin: 3, nutation: 0.5}",
            "goal: {spin: 28}",
            THRUSTER.format(300, 0),
            THRUSTER.format(0.3, 20),
            THRUSTER.format(0.3, 0) + "valve: {open_delay: 8, close_delay: 12 ms}",
            THRUSTER.format("0.3", "0, impulse_bit: [[0.02, 0.15, 16], [0.04, 0.36, 30 s]]"),
            THRUSTER.format(0.3, "0, isp: 2200"),
            "steerable: {torque: 3, isp: 2200, lever_arm: 1}",
            THRUSTER.format(0.3, "0, isp: 200")
            + "tank: {propellant: 3, pressure: 22, final_pressure: 8 Pa}",
            "steerable: {torque: 3, lever_arm: 800}",
            "requirement: {nutation: 0.5}",
            "requirement: {nutation: 0.5 deg, momentum_shift: 0.2}",
            # In the order of the file.
            "omega0: [40, 0.2, 3]\n" + THRUSTER.format(300, 20) + "goal: {spin: 40}",
            # A turn takes 2.094 s at 3 rad/s.
            THRUSTER.format(0.3, "2.15"),
        )
    )
    check_text("files.doubts", "\n".join(said))
    # What is set on the command line is doubted too.
    doubts: list[Fault] = []
    read_spacecraft(BASE, "f.yaml", [parse_setting("requirement.nutation=0.5")], doubts.append)
    check_text("files.doubts-of-setting", "\n".join(doubt.as_warning for doubt in doubts))
    # A refused file gives its warnings too.
    wrong = f"{BASE}thrusters: [{{name: T, torque: [8, 0, 0], min_on_time: 20, max_on_time: 2 s}}]"
    with pytest.raises(FaultyFile) as caught:
        read_spacecraft(wrong, "f.yaml", warn=doubts.append)
    places = [fault.where for fault in (*caught.value.faults, doubts[-1])]
    assert places == ["thrusters[0].min_on_time"] * 2


def test_units_and_common_numbers_give_no_warning_nor_does_any_file_that_comes_along() -> None:
    configs = [path.read_text(encoding="utf-8") for path in sorted(places.CONFIGS.glob("*.yaml"))]
    for lines in (
        *(
            "state: {spin: 30 rad/s, nutation: 0.1, phase: 40 rad}",
            "state: {spin: 300 rpm, nutation: 89 deg, phase: 400 deg}",
            "state: {spin: 27.4, nutation: 0.1, phase: 6.2}",
            "state: {spin: -12, nutation: 0.1, phase: -6.2}",
            THRUSTER.format("300 m", "20 s"),
            THRUSTER.format(49, 2.0),
            "goal: {tilt: 2.0, azimuth: 5, spin: 12}",
            "requirement: {nutation: 0.01, momentum_shift: 0.09}",
            "requirement: {nutation: 28 deg, momentum_shift: 0.2 rad}",
            THRUSTER.format(0.3, "2.05"),
            THRUSTER.format(0.3, "0, isp: 2200 s"),
            THRUSTER.format(0.3, "0, isp: 460"),
            "omega0: [0.1, 0.2, 0.3]\n" + THRUSTER.format(0.3, 20),  # a turn takes 20.9 s
            example_text(),
        ),
        *configs,
    ):
        text = lines if "inertia:" in lines else whole(lines)
        doubts: list[Fault] = []
        read_spacecraft(text, "f.yaml", warn=doubts.append)
        assert doubts == []


def test_an_angle_too_large_is_refused_with_its_likely_unit_where_degrees_are_a_cure() -> None:
    angles = (
        "state: {spin: 3, nutation: 5}",
        "requirement: {nutation: 2}",
        "goal: {tilt: 30, azimuth: 0}",
        "goal: {right_ascension: 1, declination: -22.5}",
        *(f"state: {{spin: 3, nutation: {value}}}" for value in ("95", "-0.1", "95 deg", "2 rad")),
        *(
            f"name: X\ninertia: {{{keys}}}\nomega0: [0.1, 0, 3]"
            for keys in (
                "Ixx: 120, Iyy: 118, Izz: 80",
                "I1: 1, I2: 2, I3: 2",
                "ixx: 1, Jyy: 1, I_zz: 1",
            )
        ),
    )
    check_faults(
        "files.likely-units", lambda lines: read_spacecraft(whole(lines), "f.yaml"), angles
    )


def test_python_warns_where_the_library_was_called(tmp_path: Path) -> None:
    text = whole("state: {spin: 30, nutation: 0.1}\n")
    (tmp_path / "f.yaml").write_text(text)
    for name in ("text", "file"):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            _ = nutdamp.read(text) if name == "text" else nutdamp.load(tmp_path / "f.yaml")
        assert "state.spin" in str(caught[0].message)
        assert caught[0].filename == __file__


# --- loops
# --------------------------------------------------------------------------------------------------

LOOPING = """\
name: Upper
inertia: {A: 100 kg m^2, C: 70 kg m^2}
omega0: [0.042 rad/s, 0.036 rad/s, 3 rad/s]
thrusters:
  - {name: +M1, torque: [20, 0, 0], min_on_time: 5 ms, max_on_time: 50 ms}
  - {name: -M2, torque: [0, -20, 0], min_on_time: 5 ms, max_on_time: 50 ms}
"""
GYRO = "{kind: gyro, rate: 100 Hz}"
ACCELEROMETER = "{kind: accelerometer, rate: 100 Hz, position: [1 m, 0, 0]}"

SENSELESS = {
    "sensor.kind": "star; 1",
    "sensor.axes": "body",
    "sensor.rate": "0; -1; .nan; 100 m; 0.5 Hz",
    "sensor.quantisation": "-1e-3; .inf; 1 m/s^2",
    "sensor.noise": "-1 deg/s; .nan; 1 m/s^2",
    "sensor.bias": ".inf; 1 m/s^2",
    "sensor.scale": "0; .inf",
    "sensor.delay": "-1; .nan; 1 deg",
    "sensor.low_pass": "-1; .inf",
    "sensor.position": "[1, 0, 0]",
    "sensor.axis": "[0, 0, 1]",
    "law": "three-pulse",
    "start": "0; 2; 90 deg; .nan",
    "stop": "0.2 deg; -1 deg; .inf",
    "settle": "-1",
    "min_interval": "-1",
    "predict": "1",
    "alias": "'no'",
    "on_time": "0; 1 s; .inf",
    "faults.reversed": "[X]; +M1; [+M1, +M1]",
}


def looped(sensor: str, *settings: str) -> nutdamp.Spacecraft:
    """A body with a loop, keys of which have other values."""
    text = f"{LOOPING}loop: {{sensor: {sensor}, start: 0.2 deg}}\n"
    return read_spacecraft(text, "craft.yaml", [parse_setting(f"loop.{key}") for key in settings])


def test_senseless_values_of_every_key_are_refused_where_they_stand() -> None:
    keys = {key for key in SECTIONS["Loop"].keys if key not in ("sensor", "faults")}
    keys |= {f"sensor.{key}" for key in SECTIONS["LoopSensor"].keys}
    assert set(SENSELESS) == keys | {f"faults.{key}" for key in SECTIONS["LoopFaults"].keys}
    for name, sensor, table in (
        ("gyro", GYRO, SENSELESS),
        (
            "accelerometer",
            ACCELEROMETER,
            {
                "sensor.axes": "principal",
                "sensor.quantisation": "1 deg/s",
                "sensor.noise": "-1; 1 deg/s",
                "sensor.position": "[0, 0, 0]; [1, 0]",
                "sensor.axis": "[0, 0, 0]; [1, 1]",
            },
        ),
    ):
        assert looped(sensor).loop is not None
        cases = [(key, value) for key, values in table.items() for value in values.split("; ")]
        texts = {f"{key} -> {value}": (sensor, f"{key}={value}") for key, value in cases}
        check_faults(f"files.loop-{name}", lambda case: looped(*case), texts)


# --- the JSON schema: what it takes and what not, and that it explains every key

SCHEMA = json_schema()
VALIDATOR = Draft202012Validator(SCHEMA)


def plain(text: str, changes: dict[str, object] | None = None) -> Any:
    """The values in a text of YAML, some of them changed."""
    return overlay(read_tree(text, "f.yaml")[0], settings_of(changes or {}))[0].plain()


EVERYTHING = """\
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
"""


def nodes(schema: object) -> Iterator[dict[str, Any]]:
    """All mappings within a schema."""
    if isinstance(schema, dict):
        yield schema
    inner = (
        schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ()
    )
    for part in inner:
        yield from nodes(part)


SLIPS_OF_KEYS = """
mas: [250 kg]
limits.horizn: [5]
thrusters[0]: [{name: a, position: [0, 0, 0.8], direction: [1, 0, 0]},
  {name: a, torque: [8, 0, 0], force: 10}]
thrusters[0].forse: [5]
thrusters[0].torque: [[8, 0, 0]]
thrusters[0].lever_arm: [1]
name: [null, "", 5]
inertia: [null, {A: 120}, {A: 0, C: 80}, {A: 120 kg, C: 80},
  {A: 1, C: 1, tensor: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}]
mass: [true, "250"]
omega0: [null, [1, 2], [1, 2, 20 Hz]]
state: [{spin: 3, nutation: 0}]
attitude.frame: [ICRF]
attitude.epoch: ["2026-03-01"]
attitude.quaternion: [["1", 0, 0, 0]]
channels: [{}, {both: []}]
disturbances[0].torque: [null, 20 mN m, [1, 2]]
disturbances[0].kind: [Constant, rotating]
disturbances[0].nme: [leak]
disturbances[1].rate: [null, -3 rad]
disturbances[1].fixed_in: [inertial]
disturbances[1].kind: [constant]
disturbances[1].torque: [1]
disturbances[2].fixed_in: [body]
disturbances[2].kind: [axial]
disturbances[3].kind: [null]
disturbances[3].torque: [1 N]
disturbances[3].rate: [3]
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
thrusters[0].position: [[30 cm, 0.001 km, 5mm]]
thrusters[0].min_on_time: [0.02 sec]
limits.horizon: [2 hours]
omega0[2]: [30 RPM]
omega0[1]: [2 degrees/sec, 2°/s]
requirement.nutation: [0.5°, 0.5 degrees]
dispersions: [{omega0: {normal: 0.1}, thrust: {normal: 3 %}, A: {bias: -1}}]
dispersions.timing: [{normal: 0.1 sec}]
"""


def test_what_validates_and_what_not() -> None:
    Draft202012Validator.check_schema(SCHEMA)
    assert SCHEMA["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert json.loads(json.dumps(SCHEMA)) == SCHEMA
    VALIDATOR.validate(plain(example_text()))
    VALIDATOR.validate(plain(EVERYTHING))
    VALIDATOR.validate(
        {"name": "S", "inertia": {"tensor": [[1, 0, 0]] * 3}, "state": {"spin": 3, "nutation": 0}}
    )
    for expected, table in ((True, SPELLINGS), (False, SLIPS_OF_KEYS)):
        for path, values in plain(table).items():
            for value in values:
                assert (
                    VALIDATOR.is_valid(plain(EVERYTHING, {path: json.dumps(value)})) == expected
                ), (
                    path,
                    value,
                )
    order = ("name", "inertia", "thrusters", "limits")
    assert [name for name in SCHEMA["properties"] if name in order] == [*order]


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
    assert not any(
        node.get("type") == "null" or node.get("default", 0) is None for node in nodes(SCHEMA)
    )
