"""Valves, impulse bits, cold nozzles, tanks and dispersions in spacecraft files: what is read, and every fault."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.broken import BASE
from support.builders import one_of
from support.contract import Write, check_faults, known
from support.golden import check_text

from nutdamp.files import study_rules, thruster_rules
from nutdamp.files.reader import read_spacecraft
from nutdamp.files.rules import Facts
from nutdamp.files.schedules import EFFECTIVE, read_pulses
from nutdamp.files.thruster_rules import thrusts
from nutdamp.flight.dynamics import supplied
from nutdamp.montecarlo.inputs import reachable
from nutdamp.physics.thruster import Cold, Measured, Tank, Trapezoid
from nutdamp.planning import plan as planning
from nutdamp.planning.notes import infeasibility
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance
from nutdamp.views.parts import pulse_table

pytestmark = pytest.mark.usefixtures("plans_shared")

THRUSTER = "  - {name: N, torque: [X, Y, 0], lever_arm: 0.8, isp: 220, min_on_time: 20 ms, max_on_time: 50 ms}\n"
BODY = """\
name: Sat
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 0.4 deg, phase: 40 deg}
thrusters:
""" + "".join(
    THRUSTER.replace("N,", f"{name},", 1).replace("X", x).replace("Y", y)
    for name, x, y in (("a", "8", "0"), ("b", "-8", "0"), ("c", "0", "8"), ("d", "0", "-8"))
)
VALVE = "valve: {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}\n"
TANK = "tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar}\n"
TABLE = "impulse_bit: [[20 ms, 0.15 N s, 16 ms], [40 ms, 0.36 N s, 30 ms]]"
COLD = "cold: {first: 90 %, pulses: 4}\n"
ReadRows = Callable[..., tuple[Schedule, list[str]]]


def read(*lines: str, body: str = BODY) -> Spacecraft:
    return read_spacecraft(body + "".join(lines), "sat.yaml")


def with_table(table: str = TABLE) -> str:
    return BODY.replace("name: a,", f"name: a, {table},")


@pytest.fixture
def read_rows(write: Write) -> ReadRows:
    """``read_rows(body, row, …)``: a schedule of rows of start, on-time and channel."""
    top = "start_s,on_time_s,channel"
    return lambda body, *rows: read_pulses(write("\n".join((top, *rows)), "rows.csv"), body)


def test_valves_impulse_bits_cold_nozzles_and_tanks_are_read() -> None:
    body = read(VALVE, COLD, body=BODY.replace("b,", "b, valve: {open_delay: 1 ms, on_time_is: effective},", 1))
    every = Trapezoid(0.008, 0.012, 0.005, 0.010)
    assert [channel.valve for channel in body.channels] == [every, Trapezoid(0.001, effective=True), every, every]
    assert (body.cold, body.tank) == (Cold(0.9, 4.0), None)
    first, *others = read(VALVE, body=with_table()).channels
    assert isinstance(first.valve, Measured)
    assert [row[1] for row in first.valve.rows] == pytest.approx([0.015, 0.036])  # 8 N m at 0.8 m are 10 N
    assert (first.min_on_time, first.max_on_time) == (0.02, 0.04)
    assert [other.valve for other in others] == [every] * 3
    rows = ", isp: [[8 bar, 215 s], [22 bar, 228 s]]}"
    by_pressure = read(TANK.replace("}", rows), body=BODY.replace("isp: 220, ", ""))
    assert by_pressure.tank == Tank(30.0, 22e5, 8e5, 1.0, ((8e5, 215.0), (22e5, 228.0)))
    assert by_pressure.cold is None


def test_valves_of_no_times_are_none_and_plans_the_same_to_the_last_bit() -> None:
    zero = read("valve: {open_delay: 0, close_delay: 0 s, rise_time: 0, fall_time: 0, on_time_is: effective}\n")
    for scheme in ("one-pulse", "four-pulse"):
        one, other = (planning.plan(body, scheme).pulses for body in (read(), zero))
        assert [repr(pulse) for pulse in one] == [repr(pulse) for pulse in other]


FAULTY = (
    "valve: {open_delay: -1 ms}",
    "valve: {opening: 1 ms}",
    "valve: {on_time_is: comand}",
    "valve: {rise_time: 5 N}",
    "cold: {first: 0, pulses: 4}",
    "cold: {first: -10 %, pulses: 4}",
    "cold: {first: 90 %}",
    "cold: {first: 90 %, pulses: 0}",
    "tank: {propellant: 30 kg, pressure: 8 bar, final_pressure: 22 bar}",
    "tank: {propellant: 30 kg, pressure: 8 N, final_pressure: 8 bar}",
    TANK.replace("}", ", exponent: -1}"),
    TANK.replace("}", ", isp: [[8 bar, 215 s], [8 bar, 228 s]]}"),
    TANK.replace("}", ", inertia_per_kg: 0.4}"),
    f"{TANK}mass: 20 kg",
    TANK.replace("30 kg", "0"),
    f"channels: {{both: [a, c], other: [b, d]}}\n{VALVE}",
)
FAULTY_TABLES = (
    "impulse_bit: [[20 ms, 0.15 N s, 16 ms]]",
    "impulse_bit: [[20 ms, 0.15 N s], [40 ms, 0.36 N s, 30 ms]]",
    "impulse_bit: [[20 ms, 0.15 kg, 16 ms], [40 ms, 0.36 N s, 30 ms]]",
    "impulse_bit: [[20 ms, 0.15 N s, 16 ms], [20 ms, 0.36 N s, 30 ms]]",
    "impulse_bit: [[20 ms, 0.4 N s, 26 ms], [40 ms, 0.36 N s, 30 ms]]",
    "impulse_bit: [[20 ms, 0.15 N s, 35 ms], [40 ms, 0.36 N s, 30 ms]]",
    f"valve: {{open_delay: 1 ms}}, {TABLE}",
)


def test_faults_have_their_place() -> None:
    # The last, of thrusters that fire as one with different valves, is none where all have the same.
    read(FAULTY[-1])
    check_faults("files.thrust", lambda lines: read(lines, body=BODY if "both" not in lines else with_table()), FAULTY)
    check_faults("files.thrust-impulse-bit", lambda table: read(body=with_table(table)), FAULTY_TABLES)
    others = {
        "a tank that cannot know what is used": (TANK, ", lever_arm: 0.8, isp: 220", ""),
        "an impulse bit without thrust": ("", "0], lever_arm: 0.8, isp: 220", f"0], {TABLE}"),
        "no thrusters": ("", BODY[BODY.index("thrusters") :], VALVE + COLD),
    }
    check_faults("files.thrust-others", lambda edit: read(edit[0], body=BODY.replace(edit[1], edit[2], 1)), others)


def test_the_thrusts_of_a_file_are_looked_up_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def counted(facts: Facts) -> dict[str, float | None]:
        calls.append(facts)
        return thrusts(facts)

    for rules in (study_rules, thruster_rules):
        monkeypatch.setattr(rules, "thrusts", counted)
    read(body=with_table())
    assert len(calls) == 1


def test_a_plan_in_blowdown_leaves_nothing_and_says_the_pressure() -> None:
    body = read(VALVE, "mass: 40 kg\n", TANK.replace("30 kg", "5 g"))
    plan = planning.plan(body, "one-pulse")
    assert known(plan.flown).nutation < math.radians(1e-6)
    used = 0.0
    for pulse in plan.pulses:
        thrust, taken = np.linalg.norm(known(pulse.torque)) / 8.0, known(pulse.propellant)
        ends = [known(body.tank).thrust_factor(used + more) for more in (0.0, taken)]
        assert ends[1] < thrust < ends[0]  # the mean, as the pressure falls
        assert thrust == pytest.approx(math.sqrt(ends[0] * ends[1]), rel=1e-3)
        used += taken
    assert 15.0 < 1e-5 * known(body.tank).pressure_after(used) < 17.0
    values = one_of(plan.pulses.notes, "pressure-falls")
    assert values == pytest.approx({"full_bar": 22.0, "left_bar": 1e-5 * known(body.tank).pressure_after(used)})


def test_velocity_grows_as_the_mass_falls() -> None:
    """The rocket equation: one long pulse along the spin axis."""
    body = read_spacecraft(
        "name: Sat\ninertia: {A: 120, C: 80}\nomega0: [0.001, 0, 3]\nmass: 10 kg\n"
        "thrusters:\n  - {name: a, position: [0.001, 0, 0], direction: [0, 0, 1], force: 100, isp: 200}\n"
        "tank: {propellant: 5 kg, pressure: 1e6, final_pressure: 1e6}\n",
        "sat.yaml",
    )
    fired = tuple(channel_pulse(body.channels[0], 0.2 + 0.4 * number, 0.4) for number in range(100))
    gained = planning.Plan(body, "file", Schedule(supplied(body, fired))).delta_v
    used = math.fsum(pulse.propellant or 0.0 for pulse in fired)
    rocket = 200.0 * 9.80665 * math.log(10.0 / (10.0 - used))
    assert float(np.linalg.norm(known(gained))) == pytest.approx(rocket, rel=1e-4)
    assert rocket > 1.1 * 100.0 * 40.0 / 10.0


def test_csv_has_commands_and_effective_times_and_is_read_back(tmp_path: Path) -> None:
    body = read(VALVE, COLD)
    plan = planning.plan(body, "one-pulse")
    path = tmp_path / "pulses.csv"
    path.write_text(pulse_table(plan.flight).csv(), encoding="utf-8")
    again, warnings = read_pulses(path, body)
    assert warnings == []
    assert path.read_text().splitlines()[0].endswith(",".join(EFFECTIVE))
    for one, other in zip(plan.pulses, again, strict=True):
        assert other.loaded == pytest.approx(one.loaded, rel=1e-15)
        assert (other.t, other.on_time) == pytest.approx((one.t, one.on_time), rel=1e-13)
        assert other.impulse == pytest.approx(one.impulse, rel=1e-13)
    left = planning.Plan(body, "file", again).flown
    assert known(left).nutation < math.radians(1e-6)


def test_rows_of_a_schedule_are_commands(read_rows: ReadRows) -> None:
    (pulse,), _ = read_rows(read(VALVE), "1.0,0.03,a")
    assert pulse.loaded == (1.0, 0.03)
    assert pulse.on_time == pytest.approx(0.03 + 0.012 - 0.008 + 0.0025)
    assert pulse.thrust[0] == pytest.approx(1.008)
    # One too short for the valve gives nothing.
    body = read("valve: {open_delay: 30 ms}\n")
    (pulse,), too_short = read_rows(body, "1.0,0.025,a")
    assert not pulse.impulse.any()
    left = planning.Plan(body, "file", Schedule((pulse,))).flown
    assert known(left).nutation == pytest.approx(body.nutation, rel=1e-12)
    # Nor can a tank give more than it has.
    body = read(TANK.replace("30 kg", "0.1 g"))
    plan = planning.plan(body, "one-pulse")
    assert not plan.feasible
    _, too_much = read_rows(body, "1.0,0.05,a", "2.0,0.05,a")
    check_text("files.thrust-rows", "\n".join([*too_short, *too_much, infeasibility(plan) or ""]))
    rows = {
        "outside the impulse bit": (read(body=with_table()), "1.0,0.05,a"),
        "before the thrust is over": (read(VALVE), "1.0,0.03,a", "1.035,0.03,a"),
    }
    check_faults("files.thrust-faulty-rows", lambda given: read_rows(*given), rows)


# --- dispersions -----------------------------------------------------------------------------------------------------

ACTUATORS = """\
thrusters:
  - {name: T1, position: [0, 0.3, 0.8], direction: [0, -1, 0], force: 10 N}
  - {name: T2, torque: [0, 8, 0], lever_arm: 800 mm}
  - {name: T3, torque: [0, -8, 0]}
steerable: {torque: 20 N m, lever_arm: 2 m}
"""
NAMES = ("T1", "T2", "T3", "steerable")
THREE_PERCENT = Tolerance("normal", 0.03, relative=True)


def dispersed(dispersions: str, actuators: str = ACTUATORS) -> Spacecraft:
    return read_spacecraft(f"{BASE}{actuators}dispersions: {dispersions}\n", "f.yaml")


RATES = (Tolerance("normal", math.pi), Tolerance("bias", -0.01), Tolerance("uniform", 0.01, relative=True))
DISPERSED: tuple[tuple[str, dict[str, Any]], ...] = (
    ("{}", {}),
    ("{timing_offset: {bias: -2 ms}}", {"timing_offset": Tolerance("bias", -0.002)}),
    ("{attitude: {normal: 0}}", {"attitude": Tolerance("normal", 0.0)}),
    ("{omega0: {normal: 0.1 rad/s}}", {"omega0": (Tolerance("normal", 0.1),) * 3}),
    ("{omega0: [{normal: 180 deg/s}, {bias: -0.01}, {uniform: 1 %}]}", {"omega0": RATES}),
    ("{thrust: {normal: 3 %}}", {"thrust": dict.fromkeys(NAMES, THREE_PERCENT)}),
    ("{thrust: {T2: {normal: 3 %}}}", {"thrust": {"T2": THREE_PERCENT}}),
    # A thrust becomes a fraction: 10 N; 8 N m on 0.8 m; 20 N m on 2 m.
    ("{thrust: {T1: {normal: 0.3 N}, T2: {normal: 300 mN}}}", {"thrust": dict.fromkeys(("T1", "T2"), THREE_PERCENT)}),
    ("{thrust: {steerable: {normal: 0.3 N}}}", {"thrust": {"steerable": THREE_PERCENT}}),
    ("{thrust_per_pulse: {normal: 3 %}}", {"thrust_per_pulse": THREE_PERCENT}),
    ("{thrust_per_pulse: {normal: 0.03}}", {"thrust_per_pulse": THREE_PERCENT}),
    ("{thrust_direction: {normal: 0.5 rad}}", {"thrust_direction": dict.fromkeys(NAMES, Tolerance("normal", 0.5))}),
    ("{position: {normal: 5 mm}}", {"position": dict.fromkeys(NAMES, Tolerance("normal", 0.005))}),
    ("{position: {T1: {normal: 5 mm}}}", {"position": {"T1": Tolerance("normal", 0.005)}}),
)
OF_OTHERS = (
    ("", "{thrust: {normal: 3 %}}", "steerable"),  # the torquer that is assumed
    ("", "{thrust: {steerable: {normal: 3 %}}}", "steerable"),
    ("thrusters: [{name: normal, torque: [0, 8, 0]}]\n", "{thrust: {normal: {normal: 3 %}}}", "normal"),
)


def test_dispersions_are_read_in_si() -> None:
    for text, fields in DISPERSED:
        assert dispersed(text).dispersions == Dispersions(**fields), text
    for kind in ("normal", "uniform", "triangular", "bias"):
        text = f"{{A: {{{kind}: 2 %}}, C: {{{kind}: 0.5 kg m^2}}, timing: {{{kind}: 5 ms}}}}"
        percent, value, time = Tolerance(kind, 0.02, relative=True), Tolerance(kind, 0.5), Tolerance(kind, 0.005)
        assert dispersed(text).dispersions == Dispersions(A=percent, C=value, timing=time)
    for actuators, text, name in OF_OTHERS:
        assert dispersed(text, actuators).dispersions == Dispersions(thrust={name: THREE_PERCENT})


def test_positions_are_in_principal_axes_as_forces_and_torques_are() -> None:
    tensor = "name: S\ninertia: {tensor: [[120, 0, 4], [0, 100, 3], [4, 3, 80]]}\nomega0: [0, 0, 3]\n"
    craft = read_spacecraft(f"{tensor}{ACTUATORS}requirement: {{nutation: 1 deg, probability: 99.7 %}}\n", "f.yaml")
    first, second, *_ = (channel.thrusters[0] for channel in craft.channels)
    assert_allclose(craft.inertia.axes @ known(first.position), [0, 0.3, 0.8], atol=1e-15)
    assert_allclose(np.cross(known(first.position), known(first.force)), first.torque, atol=1e-14)
    assert second.position is None
    assert known(craft.requirement).probability == pytest.approx(0.997)
    assert craft.dispersions is None


EVERYTHING = """\
{A: {normal: 1 %}, C: {normal: 1 %}, omega0: {normal: 0.01}, thrust: {normal: 1 %}, thrust_per_pulse: {normal: 1 %},
 thrust_direction: {normal: 1 deg}, position: {normal: 1 mm}, timing: {normal: 1 ms}, timing_offset: {normal: 1 ms},
 attitude: {normal: 1 deg}, open_delay: {normal: 1 ms}, cold: {normal: 1 %}, cold_pulses: {normal: 1 %},
 tank_propellant: {normal: 1 %}, tank_final_pressure: {normal: 1 %}, inertia_per_kg: {normal: 1 %},
 sensor_bias: {normal: 0.01 SENSED}, sensor_scale: {normal: 1 %}, sensor_noise: {normal: 1 %}, PAIRS}
"""
CRAFT = """\
thrusters:
  - {name: T1, position: [0, 0.3, 0.8], direction: [0, -1, 0], force: 10 N, isp: 220 s, min_on_time: 20 ms}
  - {name: T 2, position: [0, -0.3, 0.8], direction: [0, 1, 0], force: 10 N, isp: 220 s, min_on_time: 20 ms}
valve: {open_delay: 20 ms, close_delay: 20 ms}
cold: {first: 90 %, pulses: 4}
tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar, inertia_per_kg: {A: 0.1 m^2, C: 0.1 m^2}}
loop: {sensor: {kind: KIND, rate: 10 Hz, noise: 0.01 SENSED}, start: 0.5 deg}
"""


@pytest.mark.parametrize(("kind", "unit"), [("gyro", "deg/s"), ("accelerometer, position: [1, 0, 0]", "m/s^2")])
def test_whatever_any_schedule_or_loop_draws_once_may_be_correlated(kind: str, unit: str) -> None:
    """The file names inputs as the study does, each beside the next."""
    craft, tolerances = (text.replace("KIND", kind).replace("SENSED", unit) for text in (CRAFT, EVERYTHING))
    alone = dispersed(tolerances.replace(", PAIRS", ""), craft)
    names = [drawn.name for drawn in reachable(alone).drawn if not drawn.name.endswith("of each pulse")]
    assert len(names) > 25
    pairs = [(first, second, 0.1) for first, second in pairwise(names)]
    text = f"correlation: [{', '.join(f'[{first}, {second}, {size}]' for first, second, size in pairs)}]"
    dispersions = dispersed(tolerances.replace("PAIRS", text), craft).dispersions
    assert known(dispersions).correlation == tuple(pairs)
