"""Broken files: each must give exactly its faults, at their places, with a cure."""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import islice
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.broken import BASE, BROKEN, SPIN, THRUSTERS
from support.builders import within
from support.cases import deep
from support.golden import check_text

from nutdamp.errors import Fault, FaultyFile
from nutdamp.files.examples import example_text
from nutdamp.files.spacecraft_file import load_spacecraft, read_spacecraft
from nutdamp.spacecraft import Spacecraft


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
    check_text("files.several-faults", "\n\n".join("\n".join(map(str, faults_of(text))) for text in texts))


def test_very_many_faults_are_found_in_few_calls() -> None:
    names = ", ".join(f"N{number}" for number in range(300))
    thrusters = "".join(f"- {{name: T{number}, torque: [0, 0, 0]}}\n" for number in range(60))
    with within(420_000):  # 1,000 to 1,100 a fault, however many there are
        assert len(faults_of(f"{BASE}thrusters:\n{thrusters}channels: {{a: [{names}]}}\n")) == 360


LINES = example_text().splitlines(keepends=True)
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
@given(data=mutated())
def test_a_mutated_example_is_read_or_refused(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "spacecraft.yaml"
    path.write_bytes(data)
    judge(lambda: load_spacecraft(path))


SECTIONS = ["inertia", "omega0", "state", "attitude", "thrusters", "channels", "steerable", "requirement", "limits"]
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


@settings(max_examples=40)
@given(
    entry=st.tuples(st.just("disturbances"), st.lists(DISTURBANCES, max_size=3))
    | st.tuples(st.sampled_from([*SECTIONS, "disturbances", "dissipation"]), VALUES)
)
def test_any_value_of_any_shape_is_read_or_refused(entry: tuple[str, object]) -> None:
    key, value = entry
    lines = [line for line in BASE.splitlines() if not line.startswith(key)]
    judge(lambda: read_spacecraft("\n".join([*lines, f"{key}: {json.dumps(value)}"]), "f.yaml"))
