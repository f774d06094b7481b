"""Dispersions in a spacecraft file, as the spacecraft carries them: SI, radians, fractions."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.broken import BASE

from nutdamp.dispersion.inputs import reachable
from nutdamp.errors import FaultyFile
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.spacecraft import Spacecraft
from nutdamp.tolerances import Dispersions, Tolerance

pytestmark = pytest.mark.usefixtures("plans_shared")

ACTUATORS = """\
thrusters:
  - {name: T1, position: [0, 0.3, 0.8], direction: [0, -1, 0], force: 10 N}
  - {name: T2, torque: [0, 8, 0], lever_arm: 800 mm}
  - {name: T3, torque: [0, -8, 0]}
steerable: {torque: 20 N m, lever_arm: 2 m}
"""

NAMES = ("T1", "T2", "T3", "steerable")


def read(dispersions: str, actuators: str = ACTUATORS) -> Spacecraft:
    return read_spacecraft(f"{BASE}{actuators}dispersions: {dispersions}\n", "f.yaml")


def dispersed(dispersions: str, actuators: str = ACTUATORS) -> Dispersions:
    found = read(dispersions, actuators).dispersions
    assert found is not None
    return found


def test_without_the_key_nothing_is_dispersed() -> None:
    assert read_spacecraft(BASE, "f.yaml").dispersions is None
    assert dispersed("{}") == Dispersions()


@pytest.mark.parametrize("kind", ["normal", "uniform", "triangular", "bias"])
def test_the_kinds_and_percent_or_value(kind: str) -> None:
    found = dispersed(f"{{A: {{{kind}: 2 %}}, C: {{{kind}: 0.5 kg m^2}}, timing: {{{kind}: 5 ms}}}}")
    assert found == Dispersions(
        A=Tolerance(kind, 0.02, relative=True), C=Tolerance(kind, 0.5), timing=Tolerance(kind, 0.005)
    )


def test_an_offset_may_be_negative_and_a_sigma_zero() -> None:
    found = dispersed("{timing_offset: {bias: -2 ms}, attitude: {normal: 0}}")
    assert found == Dispersions(timing_offset=Tolerance("bias", -0.002), attitude=Tolerance("normal", 0.0))


def test_rates_alike_or_one_by_one() -> None:
    assert dispersed("{omega0: {normal: 0.1 rad/s}}").omega0 == (Tolerance("normal", 0.1),) * 3
    first, *found = dispersed("{omega0: [{normal: 0.1 deg/s}, {bias: -0.01}, {uniform: 1 %}]}").omega0
    assert first is not None
    assert first.size == pytest.approx(math.radians(0.1), rel=1e-15)
    assert found == [Tolerance("bias", -0.01), Tolerance("uniform", 0.01, relative=True)]


def test_one_thrust_for_all_thrusters_and_the_torquer() -> None:
    assert dispersed("{thrust: {normal: 3 %}}").thrust == dict.fromkeys(NAMES, Tolerance("normal", 0.03, relative=True))
    assert set(dispersed("{thrust_direction: {normal: 1 deg}}").thrust_direction) == set(NAMES)
    assert set(dispersed("{position: {normal: 5 mm}}").position) == set(NAMES)


def test_the_torquer_assumed_without_actuators_counts_too() -> None:
    assert set(dispersed("{thrust: {normal: 3 %}}", "").thrust) == {"steerable"}
    assert set(dispersed("{thrust: {steerable: {normal: 3 %}}}", "").thrust) == {"steerable"}


def test_by_name_only_those_named() -> None:
    found = dispersed("{thrust: {T2: {normal: 3 %}}, position: {T1: {normal: 5 mm}}}")
    assert found.thrust == {"T2": Tolerance("normal", 0.03, relative=True)}
    assert found.position == {"T1": Tolerance("normal", 0.005)}


def test_a_thruster_may_be_called_normal() -> None:
    thruster = "thrusters: [{name: normal, torque: [0, 8, 0]}]\n"
    found = dispersed("{thrust: {normal: {normal: 3 %}}}", thruster)
    assert found.thrust == {"normal": Tolerance("normal", 0.03, relative=True)}


def test_a_thrust_in_newtons_becomes_a_fraction_of_each_thruster_s() -> None:
    found = dispersed("{thrust: {T1: {normal: 0.3 N}, T2: {normal: 0.3 N}, steerable: {normal: 500 mN}}}").thrust
    # 10 N; 8 N m on 0.8 m; 20 N m on 2 m
    expected = {"T1": 0.03, "T2": 0.03, "steerable": 0.05}
    assert {name: tolerance.size for name, tolerance in found.items()} == pytest.approx(expected)
    assert all(tolerance.relative for tolerance in found.values())


def test_the_factor_of_each_pulse_is_a_ratio() -> None:
    for text in ("1 %", "0.01"):
        found = dispersed(f"{{thrust_per_pulse: {{normal: {text}}}}}")
        assert found.thrust_per_pulse == Tolerance("normal", 0.01, relative=True)


def test_the_probability_of_the_requirement() -> None:
    craft = read_spacecraft(f"{BASE}requirement: {{momentum_shift: 1 deg, probability: 99.7 %}}\n", "f.yaml")
    assert craft.requirement is not None
    assert craft.requirement.probability == pytest.approx(0.997)


def test_positions_are_in_principal_axes_as_forces_and_torques_are() -> None:
    tensor = "name: S\ninertia: {tensor: [[120, 0, 4], [0, 100, 3], [4, 3, 80]]}\nomega0: [0, 0, 3]\n"
    craft = read_spacecraft(tensor + ACTUATORS, "f.yaml")
    first, second, *_ = (channel.thrusters[0] for channel in craft.channels)
    assert first.position is not None
    assert first.force is not None
    assert_allclose(craft.inertia.axes @ first.position, [0, 0.3, 0.8], atol=1e-15)
    assert_allclose(np.cross(first.position, first.force), first.torque, atol=1e-14)
    assert second.position is None


@pytest.mark.parametrize(
    ("body", "dispersions"),
    [
        ("{A: 60, C: 118}", "{A: {bias: -1 %}}"),  # 118 < 118.8
        ("{A: 60, C: 118}", "{A: {normal: 2 %}, C: {bias: 2 %}}"),  # random: draws will be looked at one by one
        ("{A: 60, C: 120}", "{A: {bias: 1 %}, C: {bias: 1 %}}"),  # stays a disc
    ],
)
def test_offsets_that_leave_a_body(body: str, dispersions: str) -> None:
    read_spacecraft(f"name: S\ninertia: {body}\nomega0: [0, 0.1, 3]\ndispersions: {dispersions}\n", "f.yaml")


def test_offsets_of_a_tensor_that_leave_no_body() -> None:
    text = "name: S\ninertia: {tensor: [[120, 0, 0], [0, 100, 0], [0, 0, 30]]}\nomega0: [0, 0.1, 3]\n"
    with pytest.raises(FaultyFile, match=r"dispersions\.A\.bias: .* not physically possible"):
        read_spacecraft(f"{text}dispersions: {{A: {{bias: 60 %}}}}\n", "f.yaml")


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
    alone = read(tolerances.replace(", PAIRS", ""), craft)
    names = [one.name for one in reachable(alone).drawn if not one.name.endswith("of each pulse")]
    assert len(names) > 25
    pairs = [(first, second, 0.1) for first, second in pairwise(names)]
    text = f"correlation: [{', '.join(f'[{one}, {other}, {size}]' for one, other, size in pairs)}]"
    found = read(tolerances.replace("PAIRS", text), craft).dispersions
    assert found is not None
    assert found.correlation == tuple(pairs)
