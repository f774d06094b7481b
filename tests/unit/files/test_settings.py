"""Settings beside a spacecraft file: the same checks, the same messages, another place."""

from __future__ import annotations

import copy
import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.broken import BASE, THRUSTERS
from support.cases import spread

import nutdamp
from nutdamp.errors import BadRequest, Fault, FaultyFile
from nutdamp.files.examples import example_text
from nutdamp.files.settings import parse_setting
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.files.yaml_tree import KeyPath, dotted, read_tree
from nutdamp.spacecraft import Spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")

EXAMPLE = example_text()


def with_settings(text: str, *settings: str) -> Spacecraft:
    return read_spacecraft(text, "f.yaml", [parse_setting(one) for one in settings])


def faults_of(text: str, *settings: str) -> list[Fault]:
    with pytest.raises(FaultyFile) as caught:
        with_settings(text, *settings)
    return caught.value.faults


def leaves(value: Any, path: KeyPath = ()) -> Iterator[tuple[KeyPath, Any]]:
    """Every value of a file that holds no others."""
    steps = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for step, child in steps:
        yield from leaves(child, (*path, step))
    if not isinstance(value, dict | list):
        yield path, value


def changed(plain: Any, path: KeyPath, value: object) -> str:
    """The file with another value at ``path``, as JSON."""
    copied = copy.deepcopy(plain)
    holder = copied
    for step in path[:-1]:
        holder = holder[step]
    holder[path[-1]] = value
    return json.dumps(copied)


def contents(spacecraft: Spacecraft) -> str:
    """All that it holds."""
    return repr(dataclasses.asdict(spacecraft))


PLAIN = read_tree(EXAMPLE, "f.yaml")[0].plain()
LEAVES = list(leaves(PLAIN))


def test_the_example_has_many_values_to_set() -> None:
    assert len(LEAVES) > 40


@pytest.mark.deep
@spread("value", ["rubbish", 1e9, {"x": 1}, "-1 min", True, None, [1, 2], ""], quick=1)
def test_what_is_set_is_checked_as_the_file_is(value: object) -> None:
    """Each value of the example replaced in turn: the same faults, whether in the file or beside it."""
    placed: set[bool] = set()
    for path, _ in LEAVES:
        inside: list[tuple[str, str]] = []
        beside: list[tuple[str, str]] = []
        text = changed(PLAIN, path, value)
        try:
            there = read_spacecraft(text, "f.yaml")
        except FaultyFile as wrong:
            inside = sorted((fault.where, fault.problem) for fault in wrong.faults)
        try:
            here = with_settings(EXAMPLE, f"{dotted(path)}={json.dumps(value)}")
        except FaultyFile as wrong:
            beside = sorted((fault.where, fault.problem) for fault in wrong.faults)
            placed.add(any(fault.file.startswith("--set ") and fault.line == 0 for fault in wrong.faults))
        assert beside == inside, dotted(path)
        if not inside:
            assert contents(here) == contents(there)
    assert placed == {True}


def test_setting_every_value_to_itself_changes_nothing() -> None:
    chosen = [f"{dotted(path)}={json.dumps(value)}" for path, value in LEAVES]
    assert contents(with_settings(EXAMPLE, *chosen)) == contents(with_settings(EXAMPLE))


def test_entries_by_position_by_name_and_in_brackets() -> None:
    for key in ("thrusters[1].torque", "thrusters.T2.torque", "thrusters[T2].torque", "thrusters.'T2'.torque"):
        craft = with_settings(THRUSTERS, f"{key}=[0, -3, 0]")
        assert [tuple(channel.thrusters[0].torque) for channel in craft.channels][1] == (0, -3, 0)


def test_yaml_values_and_sections_that_the_file_does_not_have() -> None:
    craft = with_settings(BASE, "limits.blackout=[[10 s, 0.5 min], [40, 41]]", "limits.max_pulses=3")
    assert craft.limits.blackout == ((10.0, 30.0), (40.0, 41.0))
    assert craft.limits.max_pulses == 3
    assert with_settings(BASE, "mass=2", "mass=3 kg").mass == 3.0  # the later one counts


def test_a_single_number_of_a_list() -> None:
    assert tuple(with_settings(BASE, "omega0[1]=0.5").omega0) == (0.1, 0.5, 3.0)


def test_values_that_aliases_share_change_only_where_they_are_set() -> None:
    text = BASE + "thrusters:\n  - &t {name: T1, torque: &v [8, 0, 0]}\n  - {name: T2, torque: *v}\n"
    craft = with_settings(text, "thrusters.T2.torque[0]=-1")
    assert [channel.thrusters[0].torque[0] for channel in craft.channels] == [8.0, -1.0]


CASES = {
    "limits.horizon=-3 s": "limits.horizon: '-3 s' is out of range; expected a time above 0",
    "limits.horizn=300s": "limits.horizn: unknown key; did you mean 'horizon'?",
    "limits.earlist=300s": "limits.earlist: unknown key; did you mean 'earliest'?",
    "thrusters.T11.torque=[1, 0, 0]": "no entry of thrusters has the name 'T11'; did you mean 'T1'?",
    "thrusters.Z.torque=[1, 0, 0]": "no entry of thrusters has the name 'Z'; there are 'T1', 'T2', 'T3'",
    "thrusters[3].torque=[1, 0, 0]": "thrusters has entries 0 to 2 only",
    "omega0.x=1": "expected a position, such as omega0[0]",
    "limits.blackout[0]=[1, 2]": "there is no list at limits.blackout; give all of it",
    "name.x=1": "there are no keys at name, which holds 'Sat'",
    "limits.blackout=[[1, 2]": "not YAML: a comma or the closing bracket is missing",
    "mass=": "mass: empty; give a value",
    "limits.tick={a: 1, a: 2}": "duplicate key",
    "name=!!python/object:os.system x": "does not fit here",
    f"{'x.' * 40}y=1": "nested more than",
    "mass=\x1b[31m": r"'\x1b[31m'",
}


@pytest.mark.parametrize(("setting", "expected"), CASES.items(), ids=CASES)
def test_a_fault_names_the_setting_as_its_place(setting: str, expected: str) -> None:
    faults = faults_of(THRUSTERS + "limits: {horizon: 120 s}\n", setting)
    assert any(expected in str(fault) for fault in faults)
    assert all(fault.file.startswith("--set ") and not fault.line for fault in faults)
    assert all(str(fault).isprintable() for fault in faults)


def test_the_state_beside_omega0_is_the_same_fault_as_in_the_file() -> None:
    (fault,) = faults_of(BASE, "state={spin: 3, nutation: 8 deg}")
    (there,) = faults_of(BASE + "state: {spin: 3, nutation: 8 deg}\n")
    assert (fault.where, fault.problem) == (there.where, there.problem)


def test_a_name_that_is_taken_names_the_setting_that_took_it() -> None:
    (fault,) = faults_of(THRUSTERS, "thrusters[0].name=T2")
    assert str(fault).startswith("f.yaml:6:12: thrusters[1].name: duplicate name; thrusters[0] has it already (--set")


def test_faults_of_file_and_settings_come_together() -> None:
    faults = faults_of(BASE + "mass: -1 kg\n", "limits.tick=0 s", "limits.gap=-1 s")
    assert [fault.where for fault in faults] == ["limits.gap", "limits.tick", "mass"]
    assert [fault.file[:5] for fault in faults] == ["--set", "--set", "f.yam"]


@pytest.mark.parametrize(
    "text", ["", "mass", "=3", "a..b=1", ".a=1", "a[=1", "a[1=2", "a]=1", "'a=1", "a.'\\x=1", "[]=1"]
)
def test_what_is_no_setting(text: str) -> None:
    with pytest.raises(ValueError, match=r"is not KEY=VALUE, such as limits\.horizon=300s"):
        parse_setting(text)


STEPS = st.one_of(st.integers(0, 99), st.text(min_size=1, max_size=12).filter(lambda text: text.strip() == text))


@given(st.lists(STEPS, min_size=1, max_size=5).filter(lambda path: isinstance(path[0], str)), st.text(max_size=20))
def test_a_key_as_messages_write_it_can_be_set(path: list[str | int], value: str) -> None:
    setting = parse_setting(f"{dotted(tuple(path))}={value}")
    assert setting.path == tuple(path)
    assert setting.value == value
    assert setting.label.isprintable()


KEYS = st.sampled_from([dotted(path) for path, _ in LEAVES] + ["thrusters", "limits", "goal.spin", "x.y[0]", "limits"])
VALUES = st.one_of(st.text(max_size=12), st.text("[]{}:,&*!'\"#-1e9 .xmNd\n\t|>%@", max_size=24))


@pytest.mark.deep
@settings(max_examples=200)
@given(st.lists(st.tuples(KEYS, VALUES), min_size=1, max_size=3))
def test_whatever_is_set_is_a_spacecraft_or_faults_on_one_line_each(chosen: list[tuple[str, str]]) -> None:
    try:
        with_settings(EXAMPLE, *(f"{key}={value}" for key, value in chosen))
    except FaultyFile as wrong:
        for fault in wrong.faults:
            assert str(fault).isprintable()


def test_the_library_sets_too(tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_text(THRUSTERS, encoding="utf-8")
    craft = nutdamp.load(
        file,
        set={"limits.horizon": "300 s", "thrusters.T1.torque": (9, 0, 0), "limits.blackout": [["1 s", 2]], "mass": 50},
    )
    assert craft.limits.horizon == 300.0
    assert craft.limits.blackout == ((1.0, 2.0),)
    assert craft.channels[0].thrusters[0].torque[0] == 9.0
    assert craft.mass == 50.0
    with pytest.raises(FaultyFile, match=r"^set limits\.tick=-1\.5: limits\.tick: -1\.5 is out of range"):
        nutdamp.load(file, set={"limits.tick": -1.5})
    with pytest.raises(BadRequest, match="'a=b' is not a key"):
        nutdamp.load(file, set={"a=b": 1})
    with pytest.raises(BadRequest, match="expected a number, a text, a list or a mapping, got object"):
        nutdamp.load(file, set={"mass": object()})
