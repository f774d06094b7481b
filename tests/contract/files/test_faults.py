"""Broken files: each must give exactly its faults, at their places, with a cure."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.broken import BASE, BROKEN, SPIN, THRUSTERS

from nutdamp.errors import Fault, FaultyFile
from nutdamp.files.examples import example_text
from nutdamp.files.spacecraft_file import load_spacecraft, read_spacecraft
from nutdamp.spacecraft import Spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")


def faults_of(text: str) -> list[Fault]:
    with pytest.raises(FaultyFile) as caught:
        read_spacecraft(text, "f.yaml")
    return caught.value.faults


@pytest.mark.parametrize(("text", "expected"), BROKEN.values(), ids=BROKEN)
def test_broken_file(text: str, expected: list[str]) -> None:
    faults = faults_of(text)
    places = [f"{fault.line}:{fault.column}: {fault.where}" for fault in faults]
    assert places == [": ".join(line.split(": ")[:2]) for line in expected]
    for fault, line in zip(faults, expected, strict=True):
        assert line.split(": ", 2)[2] in fault.problem
        assert "\n" not in str(fault)


def test_there_are_many_broken_files() -> None:
    assert len(BROKEN) >= 100


@pytest.mark.parametrize("text", [BASE, THRUSTERS])
def test_what_the_broken_files_are_made_of_is_sound(text: str) -> None:
    assert isinstance(read_spacecraft(text, "f.yaml"), Spacecraft)


def test_all_faults_of_one_file_at_once_in_its_order() -> None:
    text = """\
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
    faults = faults_of(text)
    assert [(fault.line, fault.where) for fault in faults] == [
        (2, "mass"),
        (3, "inertia.A"),
        (4, "state.spin"),
        (4, "state.nutation"),
        (6, "thrusters[0].torque"),
        (7, "thrusters[1].name"),
        (7, "thrusters[1].isp"),
        (8, "channels.a[0]"),
        (9, "limits.earliest"),
        (9, "limits.blackout[0]"),
        (10, "paintwork"),
    ]


def test_a_fault_reads_as_one_line_with_its_place() -> None:
    assert str(faults_of(SPIN + "inertia: {A: 120 kg, C: 80}\n")[0]) == (
        "f.yaml:3:14: inertia.A: '120 kg' is a mass; expected a moment of inertia: "
        "a number in kg m^2, or a text in kg m^2"
    )


def test_faults_in_a_repeated_value_stand_where_it_is_written() -> None:
    text = BASE + "thrusters:\n- &t {name: T1, torque: [8, 0, 0], isp: 0}\n- *t\n"
    assert [(fault.line, fault.column, fault.where) for fault in faults_of(text)] == [
        (5, 13, "thrusters[1].name"),
        (5, 41, "thrusters[0].isp"),
        (5, 41, "thrusters[1].isp"),
    ]


def test_very_many_faults_are_found_in_good_time() -> None:
    names = ", ".join(f"N{number}" for number in range(4000))
    thrusters = "".join(f"- {{name: T{number}, torque: [0, 0, 0]}}\n" for number in range(800))
    assert len(faults_of(f"{BASE}thrusters:\n{thrusters}channels: {{a: [{names}]}}\n")) == 4800


EXAMPLE = example_text()
LINES = EXAMPLE.splitlines(keepends=True)
SLIPS = ["", "~", "true", ".nan", "1e999", "-1", "0", "[]", "{}", "'", "\t", "*a", "&a x", "!!x y", "5 Hz", "- a"]


@st.composite
def mutated(draw: st.DrawFn) -> bytes:
    """The example after some slips of hand, on lines, characters, values and bytes."""
    lines = list(LINES)
    for _ in range(draw(st.integers(1, 4))):
        if not lines:
            break
        index = draw(st.integers(0, len(lines) - 1))
        match draw(st.sampled_from(["drop", "double", "truncate", "value", "uncomment", "indent", "insert"])):
            case "drop":
                del lines[index]
            case "double":
                lines.insert(index, lines[index])
            case "truncate":
                lines[index] = lines[index][: draw(st.integers(0, len(lines[index])))]
            case "value":
                key = lines[index].partition(":")[0]
                lines[index] = f"{key}: {draw(st.sampled_from(SLIPS) | st.text(max_size=10))}\n"
            case "uncomment":
                lines[index] = lines[index].replace("# ", "", 1)
            case "indent":
                lines[index] = draw(st.sampled_from([" ", "  ", "\t"])) + lines[index]
            case "insert":
                place = draw(st.integers(0, len(lines[index])))
                lines[index] = lines[index][:place] + draw(st.text(max_size=3)) + lines[index][place:]
    data = "".join(lines).encode("utf-8", "surrogatepass")
    place = draw(st.integers(0, len(data)))
    return data[:place] + draw(st.just(b"") | st.binary(max_size=4)) + data[place:]


def judge(outcome: Callable[[], Spacecraft]) -> None:
    """A sound spacecraft or faults; anything else that is raised is a bug."""
    try:
        spacecraft = outcome()
    except FaultyFile as error:
        faults = error.faults
    else:
        assert 0 < spacecraft.inertia.C <= 2 * spacecraft.inertia.A * (1 + 1e-9)
        assert spacecraft.spin != 0
        return
    assert faults
    for fault in faults:
        assert "\n" not in str(fault)
        assert str(fault).encode()


@pytest.mark.deep
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=mutated())
def test_a_mutated_example_is_read_or_refused(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "spacecraft.yaml"
    path.write_bytes(data)
    judge(lambda: load_spacecraft(path))


SECTIONS = ["inertia", "omega0", "state", "attitude", "thrusters", "channels", "steerable", "requirement", "limits"]
SECTIONS += ["disturbances", "dissipation"]
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**20), 10**20) | st.floats() | st.sampled_from(["3 kg", "x", "1 s"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
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


@settings(max_examples=200, deadline=None)
@given(entries=st.lists(DISTURBANCES, max_size=3))
def test_any_disturbances_are_read_or_refused(entries: list[object]) -> None:
    judge(lambda: read_spacecraft(f"{BASE}disturbances: {json.dumps(entries)}", "f.yaml"))


@settings(max_examples=200, deadline=None)
@given(key=st.sampled_from(SECTIONS), value=VALUES)
def test_any_value_of_any_shape_is_read_or_refused(key: str, value: object) -> None:
    lines = [line for line in BASE.splitlines() if not line.startswith(key)]
    judge(lambda: read_spacecraft("\n".join([*lines, f"{key}: {json.dumps(value)}"]), "f.yaml"))
