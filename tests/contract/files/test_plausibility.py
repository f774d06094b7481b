"""Numbers without a unit that are hardly meant: a warning with place and likely unit, or a hint in the fault."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest
from support import places
from support.broken import BASE, BODY

import nutdamp
from nutdamp.errors import Fault, FaultyFile
from nutdamp.files.examples import example_text
from nutdamp.files.settings import parse_setting
from nutdamp.files.spacecraft_file import read_spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")

CONFIGS = sorted((places.CONFIGS).glob("*.yaml"))
DATED = "attitude: {quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: GCRF}\n"
THRUSTER = "thrusters: [{{name: T, position: [0, {}, 0.8], direction: [1, 0, 0], force: 10, min_on_time: {}}}]\n"


def doubts_of(text: str) -> list[str]:
    found: list[Fault] = []
    read_spacecraft(text, "f.yaml", warn=found.append)
    return [doubt.as_warning for doubt in found]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            BODY + "state: {spin: 30, nutation: 0.1}\n",
            "f.yaml:3:15: state.spin: warning: 30 is read as 30 rad/s; write 30 rpm if that is meant, else 30 rad/s",
        ),
        (
            BODY + "state: {spin: -101.5, nutation: 0.1}\n",
            "f.yaml:3:15: state.spin: warning: -101.5 is read as -101.5 rad/s; write -101.5 rpm if",
        ),
        (
            BODY + "state: {spin: 3, nutation: 0.1, phase: 40}\n",
            "f.yaml:3:40: state.phase: warning: 40 is read as 40 rad (2292 deg); write 40 deg if that is meant",
        ),
        (
            BODY + "omega0: [0.1, 0, 180]\n",
            "f.yaml:3:18: omega0[2]: warning: 180 is read as 180 rad/s; write 180 deg/s if that is meant",
        ),
        (
            BODY + "state: {spin: 3, nutation: 0.5}\n",
            "f.yaml:3:28: state.nutation: warning: 0.5 is read as 0.5 rad (28.65 deg); write 0.5 deg if that is meant",
        ),
        (
            BASE
            + "requirement: {nutation: 0.3 deg}\nthrusters: [{name: T, torque: [1, 0, 0]}]\n"
            + "loop: {sensor: {kind: gyro, rate: 20 Hz}, start: 0.5 deg, stop: 0.1 deg}\n",
            "f.yaml:6:50: loop.start: warning: 0.5 deg is above requirement.nutation, 0.3 deg",
        ),
        (BASE + "goal: {spin: 28}\n", "f.yaml:4:14: goal.spin: warning: 28 is read as 28 rad/s; write 28 rpm"),
        (
            BASE + THRUSTER.format(300, 0),
            "f.yaml:4:37: thrusters[0].position[1]: warning: 300 is read as 300 m; write 300 mm if that is meant",
        ),
        (
            BASE + THRUSTER.format(0.3, 20),
            "thrusters[0].min_on_time: warning: 20 is read as 20 s; write 20 ms if that is meant, else 20 s",
        ),
        (
            BASE + THRUSTER.format(0.3, 0) + "valve: {open_delay: 8, close_delay: 12 ms}\n",
            "f.yaml:5:21: valve.open_delay: warning: 8 is read as 8 s; write 8 ms if that is meant, else 8 s",
        ),
        (
            BASE + THRUSTER.format("0.3", "0, impulse_bit: [[0.02, 0.15, 16], [0.04, 0.36, 30 s]]"),
            "thrusters[0].impulse_bit[0][2]: warning: 16 is read as 16 s; write 16 ms if that is meant",
        ),
        (
            BASE + THRUSTER.format(0.3, "0, isp: 200") + "tank: {propellant: 3, pressure: 22, final_pressure: 8 Pa}\n",
            "f.yaml:5:33: tank.pressure: warning: 22 is read as 22 Pa; write 22 bar if that is meant, else 22 Pa",
        ),
        (
            BASE + THRUSTER.format(0.3, 0) + "cold: {first: 90, pulses: 4}\n",
            "f.yaml:5:15: cold.first: warning: 90 is read as 90 times the thrust of a warm nozzle; write 90 % if",
        ),
        (
            BASE + "steerable: {torque: 3, lever_arm: 800}\n",
            "f.yaml:4:35: steerable.lever_arm: warning: 800 is read as 800 m; write 800 mm",
        ),
        (
            BASE + DATED + "orbit: {position: [0, 7000, 0], velocity: [0, 0, 7500]}\n",
            "f.yaml:5:23: orbit.position[1]: warning: 7000 is read as 7000 m; write 7000 km if that is meant",
        ),
        (
            BASE + DATED + "orbit: {position: [0, 7000 km, 0], velocity: [0, 0, -7.5]}\n",
            "f.yaml:5:53: orbit.velocity[2]: warning: -7.5 is read as -7.5 m/s; write -7.5 km/s if that is meant",
        ),
        (
            BASE + "requirement: {nutation: 0.5}\n",
            "f.yaml:4:25: requirement.nutation: warning: 0.5 is read as 0.5 rad (28.65 deg); write 0.5 deg if that",
        ),
        (
            BASE + "requirement: {nutation: 0.5 deg, momentum_shift: 0.2}\n",
            "f.yaml:4:50: requirement.momentum_shift: warning: 0.2 is read as 0.2 rad (11.46 deg); write 0.2 deg",
        ),
        (
            BODY + "state: {spin: 3, nutation: 2 deg}\nrequirement: {nutation: 0.05}\n",  # 2.9 deg, more than there is
            "f.yaml:4:25: requirement.nutation: warning: 0.05 is read as 0.05 rad (2.865 deg); write 0.05 deg",
        ),
        (
            BODY + "omega0: [0.02, 0, 3]\nrequirement: {nutation: 0.05}\n",
            "f.yaml:4:25: requirement.nutation: warning: 0.05 is read",
        ),
        (
            "name: X\ninertia: {tensor: [[120, 0, 0], [0, 110, 0], [0, 0, 80]]}\nomega0: [0.02, 0, 3]\n"
            "requirement: {nutation: 0.05}\n",
            "f.yaml:4:25: requirement.nutation: warning: 0.05 is read",
        ),
        (
            BASE + THRUSTER.format(0.3, "20 ms, max_on_time: 2000"),
            "thrusters[0].max_on_time: warning: 2000 is read as 2000 s; write 2000 ms if that is meant, else 2000 s",
        ),
    ],
)
def test_a_number_beyond_what_can_be_meant_is_taken_with_a_warning(text: str, expected: str) -> None:
    (found,) = doubts_of(text)
    assert expected in found


@pytest.mark.parametrize(
    "text",
    [
        BODY + "state: {spin: 30 rad/s, nutation: 0.1, phase: 40 rad}\n",
        BODY + "state: {spin: 300 rpm, nutation: 89 deg, phase: 400 deg}\n",
        BODY + "state: {spin: 27.4, nutation: 0.1, phase: 6.2}\n",
        BODY + "state: {spin: 19, nutation: 0.1, phase: -6.2}\n",
        BASE + THRUSTER.format("300 m", "20 s"),
        BASE + THRUSTER.format(49, 2.0),
        BASE + "goal: {tilt: 2.0, azimuth: 5, spin: 12}\n",
        BASE + "requirement: {nutation: 0.01, momentum_shift: 0.09}\n",
        BASE + "requirement: {nutation: 28 deg, momentum_shift: 0.2 rad}\n",
        BASE + THRUSTER.format(0.3, "20 ms, max_on_time: 2000 s"),
        BASE + THRUSTER.format(0.3, "20 ms, max_on_time: 100"),  # 48 spin turns
    ],
)
def test_units_and_common_numbers_give_no_warning(text: str) -> None:
    assert doubts_of(text) == []


@pytest.mark.parametrize(
    ("on_times", "doubted"),
    [
        ("2.05", []),
        ("2.15", ["min_on_time"]),
        ("20 ms, max_on_time: 103", []),
        ("20 ms, max_on_time: 106", ["max_on_time"]),
    ],
)
def test_on_times_are_doubted_from_one_turn_and_from_fifty(on_times: str, doubted: list[str]) -> None:
    """At 3 rad/s a turn takes 2.094 s, and fifty 104.7 s."""
    found = doubts_of(BASE + THRUSTER.format(0.3, on_times))
    assert [key for text in found for key in ("min_on_time", "max_on_time") if f".{key}: warning" in text] == doubted


def test_a_shortest_firing_is_judged_by_the_spin() -> None:
    slow = BASE.replace("3]", "0.3]") + THRUSTER.format(0.3, 20)
    assert doubts_of(slow) == []  # a turn takes 20.9 s


def test_what_is_set_on_the_command_line_is_doubted_too() -> None:
    found: list[Fault] = []
    read_spacecraft(BASE, "f.yaml", [parse_setting("requirement.nutation=0.5")], found.append)
    (doubt,) = found
    assert doubt.as_warning.startswith("--set requirement.nutation=0.5: requirement.nutation: warning: 0.5 is read as")


def test_warnings_come_in_the_order_of_the_file() -> None:
    text = BASE.replace("0.1", "40") + THRUSTER.format(300, 20) + "goal: {spin: 40}\n"
    assert [doubt.split(": ")[1] for doubt in doubts_of(text)] == [
        "omega0[0]",
        "thrusters[0].position[1]",
        "thrusters[0].min_on_time",
        "goal.spin",
    ]


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: str(path.name))
def test_no_file_that_comes_along_is_doubted(path: Path) -> None:
    assert doubts_of(path.read_text(encoding="utf-8")) == []
    assert doubts_of(example_text()) == []


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("state: {spin: 3, nutation: 5}", "below 90 deg (read as radians; write 5 deg)"),
        ("requirement: {nutation: 2}", "below 90 deg (read as radians; write 2 deg)"),
        ("goal: {tilt: 30, azimuth: 0}", "below 180 deg (read as radians; write 30 deg)"),
        ("goal: {right_ascension: 1, declination: -22.5}", "(read as radians; write -22.5 deg)"),
    ],
)
def test_an_angle_too_large_is_refused_with_its_likely_unit(line: str, hint: str) -> None:
    text = (BODY if line.startswith("state") else BASE) + line + "\n"
    with pytest.raises(FaultyFile) as caught:
        read_spacecraft(text, "f.yaml")
    assert any(hint in fault.problem for fault in caught.value.faults)


@pytest.mark.parametrize("value", ["95", "-0.1", "95 deg", "2 rad"])
def test_no_hint_where_degrees_are_no_cure(value: str) -> None:
    with pytest.raises(FaultyFile) as caught:
        read_spacecraft(f"{BODY}state: {{spin: 3, nutation: {value}}}\n", "f.yaml")
    assert "radians" not in str(caught.value)


def test_a_refused_file_gives_its_warnings_too() -> None:
    found: list[Fault] = []
    with pytest.raises(FaultyFile, match=r"min_on_time: 20 s exceeds max_on_time"):
        read_spacecraft(
            BASE + "thrusters: [{name: T, torque: [8, 0, 0], min_on_time: 20, max_on_time: 2 s}]\n",
            "f.yaml",
            warn=found.append,
        )
    assert [doubt.where for doubt in found] == ["thrusters[0].min_on_time"]


def test_python_warns_where_the_library_was_called(tmp_path: Path) -> None:
    text = BODY + "state: {spin: 30, nutation: 0.1}\n"
    (tmp_path / "f.yaml").write_text(text)
    for name in ("text", "file"):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            _ = nutdamp.read(text) if name == "text" else nutdamp.load(tmp_path / "f.yaml")
        assert "state.spin: warning: 30 is read as 30 rad/s" in str(caught[0].message)
        assert caught[0].filename == __file__


@pytest.mark.parametrize("keys", ["Ixx: 120, Iyy: 118, Izz: 80", "I1: 1, I2: 2, I3: 2", "ixx: 1, Jyy: 1, I_zz: 1"])
def test_single_moments_are_sent_to_the_tensor(keys: str) -> None:
    with pytest.raises(FaultyFile) as caught:
        read_spacecraft(f"name: X\ninertia: {{{keys}}}\nomega0: [0.1, 0, 3]\n", "f.yaml")
    assert len(caught.value.faults) == 3
    for fault in caught.value.faults:
        assert "unknown key; write tensor: [[Ixx, Ixy, Ixz], " in fault.problem
