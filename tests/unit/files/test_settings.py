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
from support.golden import check_text

import nutdamp
from nutdamp.errors import BadRequest, Fault, FaultyFile
from nutdamp.files.editing import parse_setting
from nutdamp.files.fields import KeyPath
from nutdamp.files.reader import example_text, read_spacecraft
from nutdamp.files.yaml import dotted, read_tree
from nutdamp.spacecraft.model import Spacecraft

EXAMPLE = example_text()


def with_settings(text: str, *settings: str) -> Spacecraft:
    return read_spacecraft(text, "f.yaml", [parse_setting(one) for one in settings])


def faults_of(text: str, *settings: str) -> list[Fault]:
    try:
        with_settings(text, *settings)
    except FaultyFile as wrong:
        return wrong.faults
    return []


def leaves(value: Any, path: KeyPath = ()) -> Iterator[tuple[KeyPath, Any]]:
    """Every value of a file that holds no others."""
    steps = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for step, child in steps:
        yield from leaves(child, (*path, step))
    if not isinstance(value, dict | list):
        yield path, value


def changed(plain: Any, path: KeyPath, value: object) -> str:
    """The file with another value at ``path``, as JSON."""
    holder = copied = copy.deepcopy(plain)
    for step in path[:-1]:
        holder = holder[step]
    holder[path[-1]] = value
    return json.dumps(copied)


def contents(spacecraft: Spacecraft) -> str:
    return repr(dataclasses.asdict(spacecraft))


PLAIN = read_tree(EXAMPLE, "f.yaml")[0].plain()
LEAVES = list(leaves(PLAIN))


@pytest.mark.deep
@spread("value", ["rubbish", 1e9, {"x": 1}, "-1 min", True, None, [1, 2], ""], quick=1)
def test_what_is_set_is_checked_as_the_file_is(value: object) -> None:
    """Each value of the example replaced in turn: the same faults, whether in the file or beside it."""
    placed: set[bool] = set()
    for path, _ in LEAVES:
        text, setting = changed(PLAIN, path, value), f"{dotted(path)}={json.dumps(value)}"
        inside, beside = faults_of(text), faults_of(EXAMPLE, setting)
        pairs = [sorted((fault.where, fault.problem) for fault in faults) for faults in (inside, beside)]
        assert pairs[0] == pairs[1], setting
        if beside:
            placed.add(any(fault.file.startswith("--set ") and fault.line == 0 for fault in beside))
        else:
            assert contents(with_settings(EXAMPLE, setting)) == contents(read_spacecraft(text, "f.yaml"))
    assert placed == {True}


def test_setting_every_value_to_itself_changes_nothing() -> None:
    chosen = [f"{dotted(path)}={json.dumps(value)}" for path, value in LEAVES]
    assert len(chosen) > 40
    assert contents(with_settings(EXAMPLE, *chosen)) == contents(with_settings(EXAMPLE))


def test_entries_of_lists_sections_that_are_not_there_and_the_later_of_two_settings() -> None:
    for key in ("thrusters[1].torque", "thrusters.T2.torque", "thrusters[T2].torque", "thrusters.'T2'.torque"):
        craft = with_settings(THRUSTERS, f"{key}=[0, -3, 0]")
        assert tuple(craft.channels[1].thrusters[0].torque) == (0, -3, 0)
    craft = with_settings(BASE, "limits.blackout=[[10 s, 0.5 min], [40, 41]]", "limits.max_pulses=3", "omega0[1]=0.5")
    assert (craft.limits.blackout, craft.limits.max_pulses) == (((10.0, 30.0), (40.0, 41.0)), 3)
    assert tuple(craft.omega0) == (0.1, 0.5, 3.0)
    assert with_settings(BASE, "mass=2", "mass=3 kg").mass == 3.0


def test_values_that_aliases_share_change_only_where_they_are_set() -> None:
    text = BASE + "thrusters:\n  - &t {name: T1, torque: &v [8, 0, 0]}\n  - {name: T2, torque: *v}\n"
    craft = with_settings(text, "thrusters.T2.torque[0]=-1")
    assert [channel.thrusters[0].torque[0] for channel in craft.channels] == [8.0, -1.0]


# fmt: off
FAULTY = (
    "limits.horizon=-3 s", "limits.horizn=300s", "limits.earlist=300s", "thrusters.T11.torque=[1, 0, 0]",
    "thrusters.Z.torque=[1, 0, 0]", "thrusters[3].torque=[1, 0, 0]", "omega0.x=1", "limits.blackout[0]=[1, 2]",
    "name.x=1", "limits.blackout=[[1, 2]", "mass=", "limits.tick={a: 1, a: 2}", "name=!!python/object:os.system x",
    f"{'x.' * 40}y=1", "mass=\x1b[31m",
)
NO_SETTINGS = ("", "mass", "=3", "a..b=1", ".a=1", "a[=1", "a[1=2", "a]=1", "'a=1", "a.'\\x=1", "[]=1")
# fmt: on


def test_a_fault_names_the_setting_as_its_place() -> None:
    lines = list[str]()
    for setting in FAULTY:
        faults = faults_of(THRUSTERS + "limits: {horizon: 120 s}\n", setting)
        assert faults
        assert all(fault.file.startswith("--set ") and not fault.line and str(fault).isprintable() for fault in faults)
        lines += map(str, faults)
    lines += map(str, faults_of(THRUSTERS, "thrusters[0].name=T2"))  # a name that another entry has
    check_text("files.settings", "\n".join(lines))
    for text in NO_SETTINGS:
        with pytest.raises(ValueError, match=r"is not KEY=VALUE, such as limits\.horizon=300s"):
            parse_setting(text)


def test_faults_of_file_and_settings_come_together_and_are_the_same() -> None:
    (fault,) = faults_of(BASE, "state={spin: 3, nutation: 8 deg}")
    (there,) = faults_of(BASE + "state: {spin: 3, nutation: 8 deg}\n")
    assert (fault.where, fault.problem) == (there.where, there.problem)
    faults = faults_of(BASE + "mass: -1 kg\n", "limits.tick=0 s", "limits.gap=-1 s")
    places = [(fault.where, fault.file[:5]) for fault in faults]
    assert places == [("limits.gap", "--set"), ("limits.tick", "--set"), ("mass", "f.yam")]


CHARACTERS = st.text("aZ09_+-. []{}'\"\\=:#,\t\n\x00\x1b\x85\u2028\ud83dé漢😀", min_size=1, max_size=12)
STEPS = st.one_of(st.integers(0, 99), CHARACTERS.filter(lambda text: text.strip() == text))


@given(st.lists(STEPS, min_size=1, max_size=5).filter(lambda path: isinstance(path[0], str)), CHARACTERS)
def test_a_key_as_messages_write_it_can_be_set(path: list[str | int], value: str) -> None:
    setting = parse_setting(f"{dotted(tuple(path))}={value}")
    assert (setting.path, setting.value) == (tuple(path), value)
    assert setting.label.isprintable()


KEYS = st.sampled_from([dotted(path) for path, _ in LEAVES] + ["thrusters", "limits", "goal.spin", "x.y[0]", "limits"])
VALUES = st.one_of(st.text(max_size=12), st.text("[]{}:,&*!'\"#-1e9 .xmNd\n\t|>%@", max_size=24))


@pytest.mark.deep
@settings(max_examples=200)
@given(st.lists(st.tuples(KEYS, VALUES), min_size=1, max_size=3))
def test_whatever_is_set_is_a_spacecraft_or_faults_on_one_line_each(chosen: list[tuple[str, str]]) -> None:
    assert all(str(fault).isprintable() for fault in faults_of(EXAMPLE, *(f"{key}={value}" for key, value in chosen)))


def test_the_library_sets_too(tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_text(THRUSTERS, encoding="utf-8")
    values = {"limits.horizon": "300 s", "thrusters.T1.torque": (9, 0, 0), "limits.blackout": [["1 s", 2]], "mass": 50}
    craft = nutdamp.load(file, set=values)
    assert (craft.limits.horizon, craft.limits.blackout, craft.mass) == (300.0, ((1.0, 2.0),), 50.0)
    assert craft.channels[0].thrusters[0].torque[0] == 9.0
    lines = []
    for wrong, error in (({"limits.tick": -1.5}, FaultyFile), ({"a=b": 1}, BadRequest), ({"mass": object}, BadRequest)):
        with pytest.raises(error) as caught:
            nutdamp.load(file, set=wrong)
        lines.append(str(caught.value))
    check_text("files.settings-library", "\n".join(lines))
