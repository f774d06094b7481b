"""Numbers without a unit that are hardly meant: a warning with place and likely unit, or a hint in the fault."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest
from support import places
from support.broken import BASE, BODY
from support.contract import check_faults
from support.golden import check_text

import nutdamp
from nutdamp.errors import Fault, FaultyFile
from nutdamp.files.examples import example_text
from nutdamp.files.settings import parse_setting
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.spacecraft import Spacecraft

DATED = "attitude: {quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: GCRF}\n"
THRUSTER = "thrusters: [{{name: T, position: [0, {}, 0.8], direction: [1, 0, 0], force: 10, min_on_time: {}}}]\n"
TENSOR = "name: X\ninertia: {tensor: [[120, 0, 0], [0, 110, 0], [0, 0, 80]]}\n"


def whole(lines: str) -> str:
    """A file that has these lines, and what else it needs before them."""
    return lines if lines.startswith("name") else (BODY if lines.startswith(("state", "omega0")) else BASE) + lines


def read(lines: str) -> Spacecraft:
    return read_spacecraft(whole(lines), "f.yaml")


def doubts_of(lines: str) -> list[Fault]:
    doubts: list[Fault] = []
    read_spacecraft(whole(lines), "f.yaml", warn=doubts.append)
    return doubts


DOUBTED = (
    "state: {spin: 30, nutation: 0.1}",
    "state: {spin: -101.5, nutation: 0.1}",
    "state: {spin: 3, nutation: 0.1, phase: 40}",
    "omega0: [0.1, 0, 180]",
    "state: {spin: 3, nutation: 0.5}",
    "requirement: {nutation: 0.3 deg}\nthrusters: [{name: T, torque: [1, 0, 0]}]\n"
    "loop: {sensor: {kind: gyro, rate: 20 Hz}, start: 0.5 deg, stop: 0.1 deg}",
    "goal: {spin: 28}",
    THRUSTER.format(300, 0),
    THRUSTER.format(0.3, 20),
    THRUSTER.format(0.3, 0) + "valve: {open_delay: 8, close_delay: 12 ms}",
    THRUSTER.format("0.3", "0, impulse_bit: [[0.02, 0.15, 16], [0.04, 0.36, 30 s]]"),
    THRUSTER.format(0.3, "0, isp: 200") + "tank: {propellant: 3, pressure: 22, final_pressure: 8 Pa}",
    THRUSTER.format(0.3, 0) + "cold: {first: 90, pulses: 4}",
    THRUSTER.format(0.3, "20 ms, max_on_time: 2000"),
    "steerable: {torque: 3, lever_arm: 800}",
    f"{DATED}orbit: {{position: [0, 7000, 0], velocity: [0, 0, 7500]}}",
    f"{DATED}orbit: {{position: [0, 7000 km, 0], velocity: [0, 0, -7.5]}}",
    "requirement: {nutation: 0.5}",
    "requirement: {nutation: 0.5 deg, momentum_shift: 0.2}",
    "state: {spin: 3, nutation: 2 deg}\nrequirement: {nutation: 0.05}",  # 2.9 deg, more than there is
    "omega0: [0.02, 0, 3]\nrequirement: {nutation: 0.05}",
    f"{TENSOR}omega0: [0.02, 0, 3]\nrequirement: {{nutation: 0.05}}",
    # In the order of the file.
    "omega0: [40, 0.2, 3]\n" + THRUSTER.format(300, 20) + "goal: {spin: 40}",
    # A turn takes 2.094 s at 3 rad/s, and fifty 104.7 s.
    THRUSTER.format(0.3, "2.15"),
    THRUSTER.format(0.3, "20 ms, max_on_time: 106"),
)
UNDOUBTED = (
    "state: {spin: 30 rad/s, nutation: 0.1, phase: 40 rad}",
    "state: {spin: 300 rpm, nutation: 89 deg, phase: 400 deg}",
    "state: {spin: 27.4, nutation: 0.1, phase: 6.2}",
    "state: {spin: 19, nutation: 0.1, phase: -6.2}",
    THRUSTER.format("300 m", "20 s"),
    THRUSTER.format(49, 2.0),
    "goal: {tilt: 2.0, azimuth: 5, spin: 12}",
    "requirement: {nutation: 0.01, momentum_shift: 0.09}",
    "requirement: {nutation: 28 deg, momentum_shift: 0.2 rad}",
    THRUSTER.format(0.3, "20 ms, max_on_time: 2000 s"),
    THRUSTER.format(0.3, "2.05"),
    THRUSTER.format(0.3, "20 ms, max_on_time: 103"),
    "omega0: [0.1, 0.2, 0.3]\n" + THRUSTER.format(0.3, 20),  # a turn takes 20.9 s
    example_text(),
)


def test_numbers_beyond_what_can_be_meant_are_taken_with_a_warning() -> None:
    said = []
    for lines in DOUBTED:
        said += [lines.strip().replace("\n", " | "), *(f"    {doubt.as_warning}" for doubt in doubts_of(lines))]
    check_text("files.doubts", "\n".join(said))
    # What is set on the command line is doubted too.
    doubts: list[Fault] = []
    read_spacecraft(BASE, "f.yaml", [parse_setting("requirement.nutation=0.5")], doubts.append)
    check_text("files.doubts-of-setting", "\n".join(doubt.as_warning for doubt in doubts))


def test_units_and_common_numbers_give_no_warning_nor_does_any_file_that_comes_along() -> None:
    configs = [path.read_text(encoding="utf-8") for path in sorted(places.CONFIGS.glob("*.yaml"))]
    for lines in (*UNDOUBTED, *configs):
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
            for keys in ("Ixx: 120, Iyy: 118, Izz: 80", "I1: 1, I2: 2, I3: 2", "ixx: 1, Jyy: 1, I_zz: 1")
        ),
    )
    check_faults("files.likely-units", read, angles)


def test_a_refused_file_gives_its_warnings_too() -> None:
    doubts: list[Fault] = []
    text = f"{BASE}thrusters: [{{name: T, torque: [8, 0, 0], min_on_time: 20, max_on_time: 2 s}}]\n"
    with pytest.raises(FaultyFile) as caught:
        read_spacecraft(text, "f.yaml", warn=doubts.append)
    places = [fault.where for fault in (*caught.value.faults, *doubts)]
    assert places == ["thrusters[0].min_on_time"] * 2


def test_python_warns_where_the_library_was_called(tmp_path: Path) -> None:
    text = whole("state: {spin: 30, nutation: 0.1}\n")
    (tmp_path / "f.yaml").write_text(text)
    for name in ("text", "file"):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            _ = nutdamp.read(text) if name == "text" else nutdamp.load(tmp_path / "f.yaml")
        assert "state.spin" in str(caught[0].message)
        assert caught[0].filename == __file__
