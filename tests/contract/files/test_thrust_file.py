"""Valves, impulse bits and cold nozzles in spacecraft files and schedules: what is read, and every fault."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from nutdamp import planning
from nutdamp.errors import FaultyFile
from nutdamp.files import thrust_rules
from nutdamp.files.dispersion_rules import thrusts
from nutdamp.files.facts import Facts
from nutdamp.files.pulses_csv import EFFECTIVE, pulses_csv
from nutdamp.files.schedule_file import read_pulses
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.physics.feed import Cold, Tank
from nutdamp.physics.valve import Measured, Trapezoid
from nutdamp.remarks import infeasibility
from nutdamp.schedule import Schedule, channel_pulse
from nutdamp.spacecraft import Spacecraft
from nutdamp.supply import supplied

pytestmark = pytest.mark.usefixtures("plans_shared")

BODY = """\
name: Sat
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 0.4 deg, phase: 40 deg}
thrusters:
  - {name: a, torque: [8, 0, 0], lever_arm: 0.8, isp: 220, min_on_time: 20 ms, max_on_time: 50 ms}
  - {name: b, torque: [-8, 0, 0], lever_arm: 0.8, isp: 220, min_on_time: 20 ms, max_on_time: 50 ms}
  - {name: c, torque: [0, 8, 0], lever_arm: 0.8, isp: 220, min_on_time: 20 ms, max_on_time: 50 ms}
  - {name: d, torque: [0, -8, 0], lever_arm: 0.8, isp: 220, min_on_time: 20 ms, max_on_time: 50 ms}
"""

VALVE = "valve: {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}\n"

TANK = "tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar}\n"

TABLE = "impulse_bit: [[20 ms, 0.15 N s, 16 ms], [40 ms, 0.36 N s, 30 ms]]"


def read(*lines: str, body: str = BODY) -> Spacecraft:
    return read_spacecraft(body + "".join(lines), "sat.yaml")


def faults(*lines: str, body: str = BODY) -> list[str]:
    with pytest.raises(FaultyFile) as caught:
        read(*lines, body=body)
    return [f"{fault.line}:{fault.column}: {fault.where}: {fault.problem}" for fault in caught.value.faults]


def with_table(table: str = TABLE, of: str = "a") -> str:
    return BODY.replace(f"name: {of},", f"name: {of}, {table},")


def test_a_valve_of_all_and_one_of_its_own() -> None:
    body = read(VALVE, body=BODY.replace("name: b,", "name: b, valve: {open_delay: 1 ms, on_time_is: effective},"))
    valves = [channel.valve for channel in body.channels]
    every = Trapezoid(0.008, 0.012, 0.005, 0.010)
    assert valves == [every, Trapezoid(0.001, effective=True), every, every]


def test_an_impulse_bit_counts_in_full_thrust_and_bounds_on_times() -> None:
    first, *others = read(VALVE, body=with_table()).channels
    assert isinstance(first.valve, Measured)
    assert [row[1] for row in first.valve.rows] == pytest.approx([0.015, 0.036])  # 8 N m at 0.8 m are 10 N
    assert (first.min_on_time, first.max_on_time) == (0.02, 0.04)
    assert all(isinstance(other.valve, Trapezoid) for other in others)


@pytest.mark.deep
def test_valves_of_no_times_are_none_and_plans_the_same_to_the_last_bit() -> None:
    plain = read()
    zero = read("valve: {open_delay: 0, close_delay: 0 s, rise_time: 0, fall_time: 0, on_time_is: effective}\n")
    for scheme in ("one-pulse", "four-pulse", "optimal"):
        one, other = (planning.plan(body, scheme).pulses for body in (plain, zero))
        assert [repr(pulse) for pulse in one] == [repr(pulse) for pulse in other]


def test_cold_nozzles() -> None:
    assert read("cold: {first: 90 %, pulses: 4}\n").cold == Cold(0.9, 4.0)
    assert read().cold is None


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (
            "valve: {open_delay: -1 ms}\n",
            "9:21: valve.open_delay: '-1 ms' is out of range; expected a time of at",
        ),
        ("valve: {open_delay: 60 ms}\n", "9:21: valve.open_delay: 0.06 s is not less than max_on_time + close_delay"),
        ("valve: {opening: 1 ms}\n", "9:9: valve.opening: unknown key"),
        ("valve: {on_time_is: comand}\n", "9:21: valve.on_time_is: expected 'command' or 'effective', got 'comand'"),
        ("valve: {rise_time: 5 N}\n", "9:20: valve.rise_time: '5 N' is a force; expected a time"),
        ("cold: {first: 0, pulses: 4}\n", "9:15: cold.first: 0 is out of range; expected a ratio above 0"),
        ("cold: {first: -10 %, pulses: 4}\n", "9:15: cold.first: '-10 %' is out of range"),
        ("cold: {first: 90 %}\n", "9:1: cold.pulses: missing"),
        ("cold: {first: 90 %, pulses: 0}\n", "9:29: cold.pulses: 0 is out of range"),
        (
            "tank: {propellant: 30 kg, pressure: 8 bar, final_pressure: 22 bar}\n",
            "9:60: tank.final_pressure: 22 bar exceeds",
        ),
        ("tank: {propellant: 30 kg, pressure: 8 N, final_pressure: 8 bar}\n", "9:37: tank.pressure: '8 N' is a force"),
        (TANK.replace("}", ", exponent: -1}"), "9:78: tank.exponent: -1 is out of range"),
        (TANK.replace("}", ", isp: [[8 bar, 215 s], [8 bar, 228 s]]}"), "9:91: tank.isp[1][0]: 8 bar is not above"),
        (
            TANK.replace("}", ", isp: [[1 bar, 215 s], [2 bar, 228 s]]}"),
            "9:73: tank.isp: 1 bar to 2 bar leave out",
        ),
        (
            TANK.replace("}", ", inertia_per_kg: 0.4}"),
            "9:84: tank.inertia_per_kg: expected a list [value, …] or a mapping {key: value, …}, got 0.4",
        ),
        (TANK + "mass: 20 kg\n", "9:20: tank.propellant: 30 kg is not less than the mass, 20 kg"),
        (TANK.replace("30 kg", "0"), "9:20: tank.propellant: 0 is out of range"),
    ],
)
def test_faults_of_valve_and_cold(lines: str, expected: str) -> None:
    found = faults(lines)
    assert any(one.startswith(expected) for one in found), found


def test_a_valve_that_opens_for_some_thrusters_and_not_for_others_is_a_fault() -> None:
    found = faults("valve: {open_delay: 60 ms}\n", body=BODY.replace("max_on_time: 50 ms", "max_on_time: 90 ms", 1))
    assert len(found) == 1
    assert found[0].endswith("of b: its valve closes before it opens, and no command gives thrust")


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ("impulse_bit: [[20 ms, 0.15 N s, 16 ms]]", "expected at least 2 entries, got 1"),
        ("impulse_bit: [[20 ms, 0.15 N s], [40 ms, 0.36 N s, 30 ms]]", "expected 3 entries, got 2"),
        ("impulse_bit: [[20 ms, 0.15 kg, 16 ms], [40 ms, 0.36 N s, 30 ms]]", "is a mass; expected an impulse"),
        ("impulse_bit: [[20 ms, 0.15 N s, 16 ms], [20 ms, 0.36 N s, 30 ms]]", "on-time 0.02 s is not above"),
        ("impulse_bit: [[20 ms, 0.4 N s, 26 ms], [40 ms, 0.36 N s, 30 ms]]", "impulse 0.36 N s is not above"),
        (
            "impulse_bit: [[20 ms, 0.15 N s, 35 ms], [40 ms, 0.36 N s, 30 ms]]",
            "centroid 0.03 s is before that of the row",
        ),
        ("impulse_bit: [[20 ms, 0.15 N s, 2 ms], [40 ms, 0.36 N s, 30 ms]]", "0.002 s is too early: 0.15 N s take"),
        ("impulse_bit: [[60 ms, 0.5 N s, 40 ms], [90 ms, 0.8 N s, 60 ms]]", "0.05 s is not above the first on-time"),
        (f"valve: {{open_delay: 1 ms}}, {TABLE}", "given together with valve; keep one of the two"),
    ],
)
def test_faults_of_impulse_bit(table: str, expected: str) -> None:
    found = faults(body=with_table(table))
    assert any(expected in one and one.startswith("5:") for one in found), found


def test_an_impulse_bit_needs_the_thrust() -> None:
    (found,) = faults(body=with_table().replace(", lever_arm: 0.8, isp: 220, min", ", min", 1))
    assert "thrusters[0].impulse_bit: needs the thrust; give lever_arm" in found


def test_thrusters_of_one_channel_have_the_same_valve() -> None:
    (found,) = faults(VALVE, "channels: {both: [a, c], other: [b, d]}\n", body=with_table())
    assert "channels.both: a and c make different pulses of a command" in found


def test_the_thrusts_of_a_file_are_looked_up_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def counted(facts: Facts) -> dict[str, float | None]:
        calls.append(facts)
        return thrusts(facts)

    monkeypatch.setattr(thrust_rules, "thrusts", counted)
    read(body=with_table())
    assert len(calls) == 1


def test_a_valve_without_thrusters() -> None:
    bare = "".join(BODY.splitlines(keepends=True)[:3])
    found = faults(VALVE, "cold: {first: 90 %, pulses: 4}\n", body=bare)
    assert [one.partition(": applies to thrusters")[0] for one in found] == ["4:1: valve", "5:1: cold"]


def test_a_tank_needs_to_know_what_is_used() -> None:
    found = faults(TANK, body=BODY.replace(", lever_arm: 0.8, isp: 220, min", ", min", 1))
    assert [one.partition(";")[0] for one in found] == [
        "5:5: thrusters[0].isp: missing",
        "5:5: thrusters[0].lever_arm: missing",
    ]
    by_pressure = TANK.replace("}", ", isp: [[8 bar, 215 s], [22 bar, 228 s]]}")
    assert read(by_pressure, body=BODY.replace(", isp: 220", "")).tank == Tank(
        30.0, 22e5, 8e5, 1.0, ((8e5, 215.0), (22e5, 228.0))
    )


@pytest.mark.deep
def test_a_plan_in_blowdown_leaves_nothing_and_says_the_pressure() -> None:
    body = read(VALVE, "mass: 40 kg\n", TANK.replace("30 kg", "5 g"))
    made = planning.plan(body, "optimal")
    assert made.flown is not None
    assert made.flown.nutation < math.radians(1e-6)
    assert body.tank is not None
    used = 0.0
    for pulse in made.pulses:
        assert pulse.torque is not None
        assert np.linalg.norm(pulse.torque) == pytest.approx(8.0 * body.tank.thrust_factor(used), rel=1e-12)
        used += pulse.propellant or 0.0
    assert 15.0 < 1e-5 * body.tank.pressure_after(used) < 17.0
    assert any(note.startswith("tank pressure falls from 22 to 16.") for note in made.pulses.notes)


def test_more_propellant_than_the_tank_has(tmp_path: Path) -> None:
    body = read(TANK.replace("30 kg", "0.1 g"))
    made = planning.plan(body, "one-pulse")
    assert not made.feasible
    assert "of propellant, and the tank has 0.0001 kg" in infeasibility(made)
    _, warnings = read_rows(tmp_path, body, "1.0,0.05,a", "2.0,0.05,a")
    assert any("kg of propellant, and the tank has 0.0001 kg" in warning for warning in warnings)


def test_velocity_grows_as_the_mass_falls() -> None:
    """The rocket equation: one long pulse along the spin axis."""
    text = BODY.replace("state: {spin: 30 rpm, nutation: 0.4 deg, phase: 40 deg}", "omega0: [0.001, 0, 3]\nmass: 10 kg")
    pushed = text.split("thrusters:")[0] + (
        "thrusters:\n  - {name: a, position: [0.001, 0, 0], direction: [0, 0, 1], force: 100, isp: 200}\n"
        "tank: {propellant: 5 kg, pressure: 1e6, final_pressure: 1e6}\n"
    )
    body = read_spacecraft(pushed, "sat.yaml")
    thrown = tuple(channel_pulse(body.channels[0], 0.05 + 0.1 * number, 0.1) for number in range(400))
    gained = planning.Plan(body, "file", Schedule(supplied(body, thrown))).delta_v
    assert gained is not None
    used = math.fsum(pulse.propellant or 0.0 for pulse in thrown)
    rocket = 200.0 * 9.80665 * math.log(10.0 / (10.0 - used))
    assert float(np.linalg.norm(gained)) == pytest.approx(rocket, rel=1e-4)
    assert rocket > 1.1 * 100.0 * 40.0 / 10.0


@pytest.mark.deep
def test_csv_has_commands_and_effective_times_and_is_read_back(tmp_path: Path) -> None:
    body = read(VALVE, "cold: {first: 90 %, pulses: 4}\n")
    made = planning.plan(body, "optimal")
    text = pulses_csv(made.flight)
    path = tmp_path / "pulses.csv"
    path.write_text(text, encoding="utf-8")
    again, warnings = read_pulses(path, body)
    assert warnings == []
    assert text.splitlines()[0].endswith(",".join(EFFECTIVE))
    for one, other in zip(made.pulses, again, strict=True):
        assert other.loaded == pytest.approx(one.loaded, rel=1e-15)
        assert (other.t, other.on_time) == pytest.approx((one.t, one.on_time), rel=1e-13)
        assert other.impulse == pytest.approx(one.impulse, rel=1e-13)
    left = planning.Plan(body, "file", again).flown
    assert left is not None
    assert left.nutation < math.radians(1e-6)


def read_rows(tmp_path: Path, body: Spacecraft, *rows: str) -> tuple[Schedule, list[str]]:
    path = tmp_path / "rows.csv"
    path.write_text("\n".join(("start_s,on_time_s,channel", *rows)), encoding="utf-8")
    return read_pulses(path, body)


def test_three_columns_are_commands(tmp_path: Path) -> None:
    (only,), _ = read_rows(tmp_path, read(VALVE), "1.0,0.03,a")
    assert only.loaded == (1.0, 0.03)
    assert only.on_time == pytest.approx(0.03 + 0.012 - 0.008 + 0.0025)
    assert only.thrust[0] == pytest.approx(1.008)


def test_a_command_too_short_for_the_valve_gives_nothing_and_a_warning(tmp_path: Path) -> None:
    body = read("valve: {open_delay: 30 ms}\n")
    (only,), warnings = read_rows(tmp_path, body, "1.0,0.025,a")
    assert not only.impulse.any()
    assert any("it does not open" in warning for warning in warnings)
    left = planning.Plan(body, "file", Schedule((only,))).flown
    assert left is not None
    assert left.nutation == pytest.approx(body.nutation, rel=1e-12)


def test_a_command_outside_the_table_is_a_fault(tmp_path: Path) -> None:
    with pytest.raises(FaultyFile, match=r"outside the impulse_bit of 'a', 0\.02 s to 0\.04 s"):
        read_rows(tmp_path, read(body=with_table()), "1.0,0.05,a")


def test_pulses_of_a_channel_may_not_overlap_until_the_thrust_is_over(tmp_path: Path) -> None:
    with pytest.raises(FaultyFile, match="still firing"):
        read_rows(tmp_path, read(VALVE), "1.0,0.03,a", "1.035,0.03,a")
