"""Dispersions in a spacecraft file, as the spacecraft carries them: SI, radians, fractions."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.broken import BASE
from support.contract import faults, known
from support.golden import check_text

from nutdamp.dispersion.inputs import reachable
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.spacecraft import Spacecraft
from nutdamp.tolerances import Dispersions, Tolerance

ACTUATORS = """\
thrusters:
  - {name: T1, position: [0, 0.3, 0.8], direction: [0, -1, 0], force: 10 N}
  - {name: T2, torque: [0, 8, 0], lever_arm: 800 mm}
  - {name: T3, torque: [0, -8, 0]}
steerable: {torque: 20 N m, lever_arm: 2 m}
"""
NAMES = ("T1", "T2", "T3", "steerable")
THREE_PERCENT = Tolerance("normal", 0.03, relative=True)


def read(dispersions: str, actuators: str = ACTUATORS) -> Spacecraft:
    return read_spacecraft(f"{BASE}{actuators}dispersions: {dispersions}\n", "f.yaml")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("{}", Dispersions()),
        *(
            (
                f"{{A: {{{kind}: 2 %}}, C: {{{kind}: 0.5 kg m^2}}, timing: {{{kind}: 5 ms}}}}",
                Dispersions(Tolerance(kind, 0.02, relative=True), Tolerance(kind, 0.5), timing=Tolerance(kind, 0.005)),
            )
            for kind in ("normal", "uniform", "triangular", "bias")
        ),
        (
            "{timing_offset: {bias: -2 ms}, attitude: {normal: 0}}",
            Dispersions(timing_offset=Tolerance("bias", -0.002), attitude=Tolerance("normal", 0.0)),
        ),
        ("{omega0: {normal: 0.1 rad/s}}", Dispersions(omega0=(Tolerance("normal", 0.1),) * 3)),
        (
            "{omega0: [{normal: 180 deg/s}, {bias: -0.01}, {uniform: 1 %}]}",
            Dispersions(
                omega0=(
                    Tolerance("normal", math.pi),
                    Tolerance("bias", -0.01),
                    Tolerance("uniform", 0.01, relative=True),
                )
            ),
        ),
        ("{thrust: {normal: 3 %}}", Dispersions(thrust=dict.fromkeys(NAMES, THREE_PERCENT))),
        ("{thrust: {T2: {normal: 3 %}}}", Dispersions(thrust={"T2": THREE_PERCENT})),
        # A thrust becomes a fraction: 10 N; 8 N m on 0.8 m; 20 N m on 2 m.
        (
            "{thrust: {T1: {normal: 0.3 N}, T2: {normal: 0.3 N}, steerable: {normal: 300 mN}}}",
            Dispersions(thrust=dict.fromkeys(("T1", "T2", "steerable"), THREE_PERCENT)),
        ),
        ("{thrust_per_pulse: {normal: 3 %}}", Dispersions(thrust_per_pulse=THREE_PERCENT)),
        ("{thrust_per_pulse: {normal: 0.03}}", Dispersions(thrust_per_pulse=THREE_PERCENT)),
        (
            "{thrust_direction: {normal: 0.5 rad}}",
            Dispersions(thrust_direction=dict.fromkeys(NAMES, Tolerance("normal", 0.5))),
        ),
        ("{position: {normal: 5 mm}}", Dispersions(position=dict.fromkeys(NAMES, Tolerance("normal", 0.005)))),
        ("{position: {T1: {normal: 5 mm}}}", Dispersions(position={"T1": Tolerance("normal", 0.005)})),
    ],
)
def test_what_is_read(text: str, expected: Dispersions) -> None:
    assert read(text).dispersions == expected


@pytest.mark.parametrize(
    ("actuators", "text", "name"),
    [
        ("", "{thrust: {normal: 3 %}}", "steerable"),  # the torquer that is assumed
        ("", "{thrust: {steerable: {normal: 3 %}}}", "steerable"),
        ("thrusters: [{name: normal, torque: [0, 8, 0]}]\n", "{thrust: {normal: {normal: 3 %}}}", "normal"),
    ],
)
def test_names_of_other_actuators(actuators: str, text: str, name: str) -> None:
    assert read(text, actuators).dispersions == Dispersions(thrust={name: THREE_PERCENT})


def test_positions_are_in_principal_axes_as_forces_and_torques_are() -> None:
    tensor = "name: S\ninertia: {tensor: [[120, 0, 4], [0, 100, 3], [4, 3, 80]]}\nomega0: [0, 0, 3]\n"
    craft = read_spacecraft(f"{tensor}{ACTUATORS}requirement: {{nutation: 1 deg, probability: 99.7 %}}\n", "f.yaml")
    first, second, *_ = (channel.thrusters[0] for channel in craft.channels)
    assert_allclose(craft.inertia.axes @ known(first.position), [0, 0.3, 0.8], atol=1e-15)
    assert_allclose(np.cross(known(first.position), known(first.force)), first.torque, atol=1e-14)
    assert second.position is None
    assert known(craft.requirement).probability == pytest.approx(0.997)
    assert craft.dispersions is None


def test_offsets_leave_a_body() -> None:
    text = "name: S\ninertia: {}\nomega0: [0, 0.1, 3]\ndispersions: {}\n"
    for inertia, dispersions in (
        ("{A: 60, C: 118}", "{A: {bias: -1 %}}"),  # 118 < 118.8
        ("{A: 60, C: 118}", "{A: {normal: 2 %}, C: {bias: 2 %}}"),  # random: draws will be looked at one by one
        ("{A: 60, C: 120}", "{A: {bias: 1 %}, C: {bias: 1 %}}"),  # stays a disc
    ):
        read_spacecraft(text.format(inertia, dispersions), "f.yaml")
    flat = text.format("{tensor: [[120, 0, 0], [0, 100, 0], [0, 0, 30]]}", "{A: {bias: 60 %}}")
    check_text("files.dispersions-no-body", "\n".join(faults(read_spacecraft, flat, "f.yaml")))


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
    names = [drawn.name for drawn in reachable(alone).drawn if not drawn.name.endswith("of each pulse")]
    assert len(names) > 25
    pairs = [(first, second, 0.1) for first, second in pairwise(names)]
    text = f"correlation: [{', '.join(f'[{first}, {second}, {size}]' for first, second, size in pairs)}]"
    dispersions = read(tolerances.replace("PAIRS", text), craft).dispersions
    assert known(dispersions).correlation == tuple(pairs)
