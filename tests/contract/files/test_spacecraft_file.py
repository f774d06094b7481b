"""Spacecraft files that are sound: what each key becomes, in SI and principal axes."""

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support import places, reference
from support.builders import cross, one_of, present
from support.cases import spread
from support.contract import BASE, Write, at, check_faults, check_parts
from support.golden import check_text

from nutdamp.errors import CannotRead, FaultyFile
from nutdamp.files.keys import SPACECRAFT
from nutdamp.files.reader import example_text, json_schema, load_spacecraft, read_spacecraft
from nutdamp.files.schedules import read_pulses
from nutdamp.flight import propagation
from nutdamp.flight.dynamics import supplied
from nutdamp.montecarlo.inputs import reachable
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.physics import attitude
from nutdamp.physics.thruster import Cold, Tank, Trapezoid
from nutdamp.planning import plan as planning
from nutdamp.planning.causes import broken_limits, infeasibility
from nutdamp.planning.decision import compare
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Disturbance, Limits, Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance
from nutdamp.units import STANDARD_GRAVITY

pytestmark = pytest.mark.usefixtures("plans_shared")

EVERYTHING = """\
name: Sounder-1
mass: 250 kg                               # optional
inertia: {A: 120 kg m^2, C: 80 kg m^2}
omega0: [0.12, 0.05, 3.0]
attitude:
  {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [2, 0, 0, 0]}
thrusters:
  - {name: T1, position: [0, 0.5, 0.8], direction: [2, 0, 0], force: 10 N,
     isp: 220 s, min_on_time: 20 ms, max_on_time: 2 s}
  - {name: T2, torque: [0, -8, 0], isp: 220 s, lever_arm: 0.8 m}
channels: {+M1: [T1, T2], 1: [T2]}
steerable: {torque: 20 N m, isp: 220 s, lever_arm: 1 m}
requirement: {nutation: 0.5 deg, momentum_shift: 0.2 deg}
limits: {horizon: 120 s, earliest: 5 s, gap: 0.5 s, tick: 1 ms, max_pulses: 8,
  blackout: [[10 s, 20 s], [1 min, 1 min]]}
"""
LEAST = "name: S, inertia: {A: 120, C: 80}, omega0: [0.1, 0.2, -3]"


def read(text: str) -> Spacecraft:
    return read_spacecraft(text, "f.yaml")


def of(lines: str, keys: str = LEAST) -> Spacecraft:
    """The spacecraft of a file with ``keys`` and ``lines``."""
    return read(f"{{{keys}, {lines}}}")


EVERY_PART = {
    "name": "Sounder-1",
    "mass": 250.0,
    "inertia.moments": (120.0, 120.0, 80.0),
    "inertia.aligned": True,
    "omega0": [0.12, 0.05, 3.0],
    "attitude.quaternion": [1, 0, 0, 0],
    "attitude.epoch": "2026-03-01T12:00:00Z",
    "attitude.frame": "EME2000",
    "channels.0.name": "+M1",
    "channels.0.thrusters.0.torque": pytest.approx([0.0, 8.0, -5.0], rel=1e-15),
    "channels.0.thrusters.0.force": [10, 0, 0],
    "channels.0.thrusters.0.thrust": 10.0,
    "channels.0.thrusters.0.isp": 220.0,
    "channels.0.thrusters.0.min_on_time": 0.02,
    "channels.0.thrusters.0.max_on_time": 2.0,
    "channels.1.name": "1",
    "channels.1.thrusters.0.torque": [0, -8, 0],
    "channels.1.thrusters.0.force": None,
    "channels.1.thrusters.0.thrust": 10.0,
    "channels.1.thrusters.0.min_on_time": 0.0,
    "channels.1.thrusters.0.max_on_time": math.inf,
    "channels.1.thrusters.0.mass_flow": pytest.approx(10.0 / (220.0 * STANDARD_GRAVITY)),
    "steerable": Steerable(20.0, 220.0, 1.0),
    "requirement.nutation": pytest.approx(math.radians(0.5)),
    "requirement.momentum_shift": pytest.approx(math.radians(0.2)),
    "limits": Limits(120.0, 5.0, 0.5, 0.001, 8, ((10.0, 20.0), (60.0, 60.0))),
}
NO_PARTS = {
    **dict.fromkeys(("mass", "attitude", "steerable", "requirement", "dissipation")),
    "channels": (),
    "limits": Limits(),
    "disturbances": (),
    "growth": 0.0,
    "torquer.torque": None,
}
TWO_THRUSTERS = "thrusters: [{name: a, torque: [1, 0, 0], isp: 220}, {name: b, torque: [0, 1, 0]}]"
DISTURBANCES = {
    "{name: T, torque: [20 mN m, 0.1, 1e-3]}": Disturbance(0.02 + 0.1j, 0.001, 0.0, "T"),
    "{kind: constant, torque: [0, 0, -1]}": Disturbance(0j, -1.0),
    "{kind: rotating, torque: [5 mN m, -1, 0], rate: 60 rpm}": Disturbance(
        0.005 - 1j, 0.0, 2 * math.pi
    ),
    "{torque: [0, 2, 0], rate: -3}": Disturbance(2j, 0.0, -3.0),
    "{kind: rotating, torque: [1, 0, 0], fixed_in: inertial}": Disturbance(1 + 0j, 0.0, 3.0),
    "{torque: [1, 0, 0], fixed_in: inertial}": Disturbance(1 + 0j, 0.0, 3.0),
    "{kind: axial, torque: -1 mN m}": Disturbance(0j, -0.001),
    "{kind: axial, torque: 2}": Disturbance(0j, 2.0),
    "{kind: axial, torque: [0, 0, 2 N m]}": Disturbance(0j, 2.0),
    "{torque: [1, 0, 1e-13], rate: 2}": Disturbance(
        1 + 0j, 1e-13, 2.0
    ),  # rounding, but not dropped
}
"""In the order of the file; with the name of a thruster, too."""

PARTS: dict[str, tuple[str, dict[str, object]]] = {
    "everything": (EVERYTHING, EVERY_PART),
    "least": (f"{{{LEAST}}}", NO_PARTS),
    "empty sections": (
        f"{{{LEAST}, requirement: {{}}, disturbances: []}}",
        {"requirement": None, "disturbances": ()},
    ),
    "disturbances": (
        f"{{{LEAST}, thrusters: [{{name: T, torque: [1, 0, 0]}}], "
        f"disturbances: [{', '.join(DISTURBANCES)}]}}",
        {"disturbances": tuple(DISTURBANCES.values())},
    ),
    **{
        f"dissipation of A = {A}, C = {C}{says}": (
            f"{{name: S, inertia: {{A: {A}, C: {C}}}, state: {{spin: 0.5, nutation: 2 deg}}, "
            f"dissipation: {{time_constant: 100 s{says}}}}}",
            {"dissipation": 100.0, "growth": growth},
        )
        for A, C, says, growth in (
            (120, 80, "", 0.01),  # by its shape
            (80, 120, "", -0.01),
            (80, 80, "", 0.0),
            (80, 120, ", nutation: grows", 0.01),
            (120, 80, ", nutation: decays", -0.01),
        )
    },
    # Without channels each thruster is one; without a lever arm its thrust is open.
    "thrusters": (
        f"{{{LEAST}, {TWO_THRUSTERS}}}",
        {
            "channels.0.name": "a",
            "channels.0.thrusters.0.name": "a",
            "channels.0.thrusters.0.thrust": None,
            "channels.0.mass_flow": None,
            "channels.1.name": "b",
            "channels.1.thrusters.0.name": "b",
        },
    ),
}


def test_files_of_yaml_or_json_are_loaded_by_their_path(tmp_path: Path) -> None:
    path = tmp_path / "spacecraft.json"
    contents = {
        "name": "Sat ☉",
        "inertia": {"A": 1e2, "C": "80 kg m²"},
        "omega0": [0.1, 0, "30 rpm"],
    }
    path.write_text(json.dumps(contents, indent="\t"), "utf-8")
    assert load_spacecraft(path).name == "Sat ☉"
    assert load_spacecraft(path).spin == pytest.approx(math.pi)
    path.write_bytes(b"\xef\xbb\xbf" + EVERYTHING.replace("\n", "\r\n").encode())
    assert load_spacecraft(path).name == load_spacecraft(str(path)).name == "Sounder-1"
    with pytest.raises(CannotRead, match=r"none\.yaml"):
        load_spacecraft(tmp_path / "none.yaml")
    path.write_text("{}")
    with pytest.raises(FaultyFile, match=re.escape(f"{path}:1:1: name:")):
        load_spacecraft(path)
    for time in ("12:00", "12:00:00", "12:00:00.123456789Z", "23:59:59+01:00"):
        dated = of(f"attitude: {{quaternion: [1, 0, 0, 0], epoch: 2024-02-29T{time}}}").attitude
        assert present(dated).epoch == f"2024-02-29T{time}"  # as it is written


@pytest.mark.parametrize(
    "inertia", ["A: 120, C: 80", "tensor: [[100, 0, 0], [0, 130, 0], [0, 0, 180]]"]
)
def test_the_nutation_of_a_state_is_the_angle_of_h_and_the_spin_axis(inertia: str) -> None:
    """In vectors, with I1 ≠ I2 too; the mean of both moments would be up to 1.5 deg off."""
    for spin, phase, nutation in product(
        (3.0, -3.0), (0.0, 40.0, 90.0, -200.0), (0.0, 1e-9, 10.0, 89.0)
    ):
        state = f"state: {{spin: {spin}, nutation: {nutation} deg, phase: {phase} deg}}"
        craft = of(state, f"name: S, inertia: {{{inertia}}}")
        assert craft.spin == spin
        assert math.degrees(craft.tilt) == pytest.approx(nutation, rel=1e-13)
        momentum = np.array(craft.inertia.moments) * craft.omega0
        angle = math.degrees(
            reference.angle(momentum, np.array([0.0, 0.0, math.copysign(1.0, spin)]))
        )
        assert angle == pytest.approx(nutation, rel=1e-13, abs=1e-15)
        if nutation:
            turns = (math.atan2(craft.omega0[1], craft.omega0[0]) - math.radians(phase)) / (
                2 * math.pi
            )
            assert turns == pytest.approx(round(turns), abs=1e-15)
    craft = of("state: {spin: 30 rpm, nutation: 5 deg}", f"name: S, inertia: {{{inertia}}}")
    assert craft.omega0[0] > craft.omega0[1] == 0.0  # the phase that is not given


def test_a_state_is_about_the_principal_axis_and_its_nutation_is_the_largest() -> None:
    craft = of(
        "state: {spin: -2, nutation: 5 deg}",
        "name: S, inertia: {tensor: [[2, 0, 0.1], [0, 2, 0], [0.1, 0, 3]]}",
    )
    assert craft.spin == -2.0
    assert craft.tilt == pytest.approx(math.radians(5), rel=1e-12)
    assert craft.nutation > 1.005 * craft.tilt


def test_a_pair_for_velocity_changes_is_flown_and_never_fired_to_damp() -> None:
    """Two thrusters along axis 3 on both sides: their torques cancel, with 3 mm of tolerance in
    position not quite.
    """
    body = load_spacecraft(places.case("lp71-dv-pair.yaml"))
    (pair,) = body.channels
    assert not pair.torque.any()
    assert not pair.damps
    assert not pair.axial
    assert not any(plan.feasible for plan in compare(body, CLASSIC))
    pulses = Schedule((channel_pulse(pair, 21.75, 43.5),))
    assert propagation.flown(body, pulses).residual.nutation == pytest.approx(
        body.nutation, rel=1e-9
    )
    burn = run(Results(study_of(body, pulses), 500)).distribution("nutation")
    assert burn is not None
    assert burn.quantiles(np.array([0.95]))[0] > 1.2 * body.nutation
    both = replace(body, channels=(*cross(8.0), pair), dispersions=None)
    assert pair.name not in {
        pulse.channel for plan in compare(both, CLASSIC) for pulse in plan.pulses
    }


def test_bodies_at_the_edge_of_what_can_be() -> None:
    for moments in (
        "A: 1, C: 2",
        "tensor: [[1, 0, 0], [0, 1, 0], [0, 0, 2]]",
        "A: 1e-3, C: 2e-3",
    ):  # a flat disc
        assert read(f"{{name: S, inertia: {{{moments}}}, omega0: [0, 0, 1]}}").inertia.a == -1.0
    for tensor in (  # a spin about an outer axis, or of a sphere
        "[[120, 0, 0], [0, 80, 0], [0, 0, 79.999]]",
        "[[120, 0, 0], [0, 80, 0], [0, 0, 120.001]]",
        "[[120, 0, 0], [0, 120, 0], [0, 0, 80]]",
        "[[80, 0, 0], [0, 80.00000001, 0], [0, 0, 80.00000002]]",
        "[[80, 0, 0], [0, 80, 0], [0, 0, 80]]",
        "[[80, 1e-9, 0], [1e-9, 80, 2e-9], [0, 2e-9, 80]]",
    ):
        spin = read(f"{{name: S, inertia: {{tensor: {tensor}}}, omega0: [0, 0.1, 1]}}").spin
        assert spin == pytest.approx(1.0, rel=0.2)
    rounded = (
        "{name: S, inertia: {tensor: [[200, 10, 0], [10.0000001, 200, 0], [0, 0, 300]]}, "
        "omega0: [0, 0, 1]}"
    )
    assert_allclose(read(rounded).inertia.moments, [190.0, 210.0, 300.0], rtol=1e-8)


def test_vectors_of_a_tensor_file_are_turned_to_principal_axes() -> None:
    turn = attitude.matrix(
        np.array([0.98, 0.1, -0.12, 0.12]) / np.linalg.norm([0.98, 0.1, -0.12, 0.12])
    )
    tensor = turn @ np.diag([130.0, 120.0, 80.0]) @ turn.T
    position, direction = np.array([0.1, 0.5, 0.8]), np.array([1.0, -0.2, 0.1])
    omega0, torque = np.array([0.12, 0.05, 3.0]), np.array([0.0, -8.0, 1.0])
    pushed = {"position": (turn @ position).tolist(), "direction": (turn @ direction).tolist()}
    contents = {
        "name": "Sat",
        "inertia": {"tensor": tensor.tolist()},
        "omega0": (turn @ omega0).tolist(),
        "attitude": {"quaternion": [0.5, 0.5, -0.5, 0.5]},
        "thrusters": [
            {"name": "a", "force": 10, **pushed},
            {"name": "b", "torque": (turn @ torque).tolist()},
        ],
    }
    craft = read(json.dumps(contents))
    # Principal axes have no sense of their own: the file's may come out turned by 180 degrees.
    signs = np.diag(np.round(craft.inertia.axes.T @ turn))
    force = 10 * direction / np.linalg.norm(direction)
    expected = {
        "inertia.axes": turn * signs,
        "inertia.moments": [130.0, 120.0, 80.0],
        "omega0": omega0 * signs,
        "channels.0.thrusters.0.position": position * signs,
        "channels.0.thrusters.0.force": force * signs,
        "channels.0.thrusters.0.torque": np.cross(position, force) * signs,
        "channels.1.thrusters.0.torque": torque * signs,
    }
    for path, values in expected.items():
        assert_allclose(at(craft, path), values, rtol=1e-13, atol=1e-12)
    # The attitude stays that of the file's axes; the initial state is that of the principal ones.
    momentum = np.diag(craft.inertia.moments) @ craft.omega0
    in_frame = attitude.rotate(present(craft.attitude).quaternion, tensor @ turn @ omega0)
    assert_allclose(attitude.rotate(craft.initial.quaternion, momentum), in_frame, rtol=1e-12)
    # A diagonal tensor changes nothing.
    whole = read(EVERYTHING)
    aligned = read(
        EVERYTHING.replace(
            "A: 120 kg m^2, C: 80 kg m^2", "tensor: [[120, 0, 0], [0, 120, 0], [0, 0, 80]]"
        )
    )
    same = ("inertia.moments", "omega0", "channels.0.torque")
    check_parts(aligned, {"inertia.aligned": True, **{path: at(whole, path) for path in same}})


def test_disturbances_are_turned_to_principal_axes_with_nothing_dropped() -> None:
    craft = read(
        "{name: S, inertia: {tensor: [[120, 0, 3], [0, 118, 2], [3, 2, 80]]}, omega0: [0.1, 0.2, "
        "3], disturbances: ["
        "{torque: [0.1, 0.2, 0.3]}, {torque: [0.1, 0.2, 0], rate: 2}, {torque: [0.1, 0.2, 0], "
        "fixed_in: inertial}, "
        "{kind: axial, torque: 0.3}]}"
    )
    assert [disturbance.rate for disturbance in craft.disturbances] == [0.0, 2.0, -craft.spin, 0.0]
    torques = [(0.1, 0.2, 0.3), (0.1, 0.2, 0), (0.1, 0.2, 0), (0, 0, 0.3)]
    for disturbance, torque in zip(craft.disturbances, torques, strict=True):
        principal = np.array(
            [disturbance.transverse.real, disturbance.transverse.imag, disturbance.axial]
        )
        assert np.all(principal != 0.0)
        assert_allclose(craft.inertia.axes @ principal, torque, atol=1e-16)
    # A turn about axis 3 alone leaves no axial dust.
    craft = read(
        "{name: S, inertia: {tensor: [[120, 3, 0], [3, 118, 0], [0, 0, 80]]}, omega0: [0.1, 0.2, "
        "3], "
        "disturbances: [{torque: [0.1, 0.2, 0], rate: 2}, {kind: axial, torque: 1}]}"
    )
    turning, axial = craft.disturbances
    assert turning.axial == 0.0
    assert abs(turning.transverse) == pytest.approx(math.hypot(0.1, 0.2))
    assert (axial.transverse, axial.axial) == (0.0, 1.0)


def uncommented(text: str, *keys: str) -> str:
    """The example with the commented blocks of ``keys`` taken into use."""
    for key in keys:
        block = present(re.search(rf"^# {key}:.*\n(#  .*\n)*", text, re.MULTILINE))
        text = text.replace(block[0], re.sub(r"^# ", "", block[0], flags=re.MULTILINE))
    return text


def test_the_example_is_the_one_it_describes_and_shows_every_key() -> None:
    craft = read(example_text())
    described = {
        "name": "Sounder-1",
        "mass": 250.0,
        "inertia.moments": (120.0, 120.0, 80.0),
        "spin": pytest.approx(math.pi),
        "nutation": pytest.approx(math.radians(5)),
    }
    check_parts(craft, described)
    torques = {channel.name: channel.torque.tolist() for channel in craft.channels}
    assert torques == {"+M1": [8, 0, 0], "-M1": [-8, 0, 0], "+M2": [0, 8, 0], "-M2": [0, -8, 0]}
    # A handful of pulses of an eighth of the nutation period each removes the nutation.
    assert 2 < craft.least_impulse / (8.0 * craft.body_period / 8) < 6
    sections = [json_schema(), *json_schema()["$defs"].values()]
    assert sections[0]["properties"].keys() == SPACECRAFT.keys.keys()
    for section in sections:
        for key in section["properties"]:
            assert re.search(rf"\b{key}:", example_text()), key


def test_what_the_example_shows_in_comments_works() -> None:
    keys = ("attitude", "channels", "steerable", "limits", "disturbances", "dissipation")
    craft = read(uncommented(example_text(), *keys).replace("  # - {", "  - {"))
    assert None not in (craft.attitude, craft.steerable)
    shown = {
        "channels.0.name": "upper",
        "channels.1.name": "lower",
        "limits.horizon": 120.0,
        "limits.blackout": ((10.0, 20.0),),
        "dissipation": 600.0,
        "dispersions.timing_offset": Tolerance("bias", 0.002),
    }
    check_parts(craft, shown)
    rates = {disturbance.name: disturbance.rate for disturbance in craft.disturbances}
    assert rates == {"leak": 0.0, "pump": -3.0, "sunlight": -craft.spin, "drag": 0.0, "burn": 0.0}
    assert craft.spin_drift(10.0, 20.0) == -0.001 / 80
    thrusters = ["+M1", "-M1", "+M2", "-M2", "spin-up", "steerable"]
    assert [*present(craft.dispersions).thrust] == thrusters
    others = re.sub(r"^(state|inertia): .*\n", "", example_text(), flags=re.MULTILINE)
    nutation = read(uncommented(others, "inertia", "omega0")).nutation
    assert nutation == pytest.approx(math.radians(5), rel=0.05)


# --- the files in configs/
# -------------------------------------------------------------------------------------------

FILES = sorted(places.CONFIGS.glob("*.yaml"))


def test_they_name_their_sources() -> None:
    assert len(FILES) >= 8
    for path in FILES:
        lines = path.read_text(encoding="utf-8").splitlines()[:30]
        comment = [line.lower() for line in lines if line.startswith("#")]
        assert len(comment) >= 3
        assert "assumed" in "".join(comment)


@spread("path", FILES[::-1], quick=1, deep=len(FILES), ids=lambda path: str(path.stem))
def test_it_is_planned(path: Path) -> None:
    spacecraft = load_spacecraft(path)
    compared = compare(spacecraft, CLASSIC)
    best = compared.recommended
    assert present(present(best).flown).nutation < 0.1 * spacecraft.nutation
    assert present(best).meets_requirement is not False
    for plan in compared.plans:
        assert plan.feasible or infeasibility(plan)
        assert broken_limits(spacecraft, plan.pulses) == []
        if plan.feasible and spacecraft.inertia.symmetric and plan.residual is not None:
            # Nothing beats the floor down to what is left: A|ω0| - C|ω3| tan θ.
            left = spacecraft.inertia.C * abs(spacecraft.spin) * math.tan(plan.residual.nutation)
            assert plan.pulses.total_impulse >= (spacecraft.least_impulse - left) * (1 - 1e-3)


# --- valves, impulse bits, cold nozzles, tanks and dispersions

THRUSTER = (
    "  - {name: N, torque: [X, Y, 0], lever_arm: 0.8, isp: 220, min_on_time: 20 ms, "
    "max_on_time: 50 ms}\n"
)
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


def read_lines(*lines: str, body: str = BODY) -> Spacecraft:
    return read_spacecraft(body + "".join(lines), "sat.yaml")


def with_table(table: str = TABLE) -> str:
    return BODY.replace("name: a,", f"name: a, {table},")


@pytest.fixture
def read_rows(write: Write) -> ReadRows:
    """``read_rows(body, row, …)``: a schedule of rows of start, on-time and channel."""
    top = "start_s,on_time_s,channel"
    return lambda body, *rows: read_pulses(write("\n".join((top, *rows)), "rows.csv"), body)


EVERY_VALVE = Trapezoid(0.008, 0.012, 0.005, 0.010)
OWN_VALVE = BODY.replace("b,", "b, valve: {open_delay: 1 ms, on_time_is: effective},", 1)
BY_PRESSURE = TANK.replace("}", ", isp: [[8 bar, 215 s], [22 bar, 228 s]]}")
ACTUATED: dict[str, tuple[str, dict[str, object]]] = {
    "valves and cold nozzles": (
        OWN_VALVE + VALVE + COLD,
        {
            "channels.0.valve": EVERY_VALVE,
            "channels.1.valve": Trapezoid(0.001, effective=True),
            "channels.2.valve": EVERY_VALVE,
            "cold": Cold(0.9, 4.0),
            "tank": None,
        },
    ),
    "impulse bits, of 8 N m at 0.8 m": (
        with_table() + VALVE,
        {
            "channels.0.valve.rows": pytest.approx(
                np.array([(0.02, 0.015, 0.016), (0.04, 0.036, 0.03)])
            ),
            "channels.0.min_on_time": 0.02,
            "channels.0.max_on_time": 0.04,
            "channels.1.valve": EVERY_VALVE,
        },
    ),
    "specific impulse by pressure": (
        BODY.replace("isp: 220, ", "") + BY_PRESSURE,
        {"tank": Tank(30.0, 22e5, 8e5, 1.0, ((8e5, 215.0), (22e5, 228.0))), "cold": None},
    ),
}


@pytest.mark.parametrize(("text", "parts"), (PARTS | ACTUATED).values(), ids=PARTS | ACTUATED)
def test_parts_of_a_file_are_read(text: str, parts: dict[str, object]) -> None:
    check_parts(read(text), parts)


def test_valves_of_no_times_are_none_and_plans_the_same_to_the_last_bit() -> None:
    zero = read_lines(
        "valve: {open_delay: 0, close_delay: 0 s, rise_time: 0, fall_time: 0, on_time_is: "
        "effective}\n"
    )
    for scheme in ("one-pulse", "four-pulse"):
        one, other = (planning.plan(body, scheme).pulses for body in (read_lines(), zero))
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


def test_faults_have_their_place() -> None:
    # The last, of thrusters that fire as one with different valves, is none where all have the
    # same.
    read_lines(FAULTY[-1])
    check_faults(
        "files.thrust",
        lambda lines: read_lines(lines, body=BODY if "both" not in lines else with_table()),
        FAULTY,
    )
    check_faults(
        "files.thrust-impulse-bit",
        lambda table: read_lines(body=with_table(table)),
        (
            "impulse_bit: [[20 ms, 0.15 N s, 16 ms]]",
            "impulse_bit: [[20 ms, 0.15 N s], [40 ms, 0.36 N s, 30 ms]]",
            "impulse_bit: [[20 ms, 0.15 kg, 16 ms], [40 ms, 0.36 N s, 30 ms]]",
            "impulse_bit: [[20 ms, 0.15 N s, 16 ms], [20 ms, 0.36 N s, 30 ms]]",
            "impulse_bit: [[20 ms, 0.4 N s, 26 ms], [40 ms, 0.36 N s, 30 ms]]",
            "impulse_bit: [[20 ms, 0.15 N s, 35 ms], [40 ms, 0.36 N s, 30 ms]]",
            f"valve: {{open_delay: 1 ms}}, {TABLE}",
        ),
    )
    others = {
        "a tank that cannot know what is used": (TANK, ", lever_arm: 0.8, isp: 220", ""),
        "an impulse bit without thrust": ("", "0], lever_arm: 0.8, isp: 220", f"0], {TABLE}"),
        "no thrusters": ("", BODY[BODY.index("thrusters") :], VALVE + COLD),
    }
    check_faults(
        "files.thrust-others",
        lambda edit: read_lines(edit[0], body=BODY.replace(edit[1], edit[2], 1)),
        others,
    )


def test_a_plan_in_blowdown_leaves_nothing_and_says_the_pressure() -> None:
    body = read_lines(VALVE, "mass: 40 kg\n", TANK.replace("30 kg", "5 g"))
    plan = planning.plan(body, "one-pulse")
    assert present(plan.flown).nutation < math.radians(1e-6)
    used = present(plan.propellant)
    assert 15.0 < 1e-5 * present(body.tank).pressure_after(used) < 17.0
    values = one_of(plan.pulses.notes, "pressure-falls")
    assert values == pytest.approx(
        {"full_bar": 22.0, "left_bar": 1e-5 * present(body.tank).pressure_after(used)}
    )


def test_velocity_grows_as_the_mass_falls() -> None:
    """The rocket equation: one long pulse along the spin axis."""
    body = read_spacecraft(
        "name: Sat\ninertia: {A: 120, C: 80}\nomega0: [0.001, 0, 3]\nmass: 10 kg\n"
        "thrusters:\n  - {name: a, position: [0.001, 0, 0], direction: [0, 0, 1], force: 100, isp: "
        "200}\n"
        "tank: {propellant: 5 kg, pressure: 1e6, final_pressure: 1e6}\n",
        "sat.yaml",
    )
    fired = tuple(channel_pulse(body.channels[0], 0.2 + 0.4 * number, 0.4) for number in range(100))
    gained = planning.Plan(body, "file", Schedule(supplied(body, fired)))._delta_v
    used = math.fsum(pulse.propellant or 0.0 for pulse in fired)
    rocket = 200.0 * 9.80665 * math.log(10.0 / (10.0 - used))
    assert float(np.linalg.norm(present(gained))) == pytest.approx(rocket, rel=1e-4)
    assert rocket > 1.1 * 100.0 * 40.0 / 10.0


def test_rows_of_a_schedule_are_commands(read_rows: ReadRows) -> None:
    (pulse,), _ = read_rows(read_lines(VALVE), "1.0,0.03,a")
    assert pulse.loaded == (1.0, 0.03)
    assert pulse.on_time == pytest.approx(0.03 + 0.012 - 0.008 + 0.0025)
    assert pulse.thrust[0] == pytest.approx(1.008)
    # One too short for the valve gives nothing.
    body = read_lines("valve: {open_delay: 30 ms}\n")
    (pulse,), too_short = read_rows(body, "1.0,0.025,a")
    assert not pulse.impulse.any()
    left = planning.Plan(body, "file", Schedule((pulse,))).flown
    assert present(left).nutation == pytest.approx(body.nutation, rel=1e-12)
    # Nor can a tank give more than it has.
    body = read_lines(TANK.replace("30 kg", "0.1 g"))
    plan = planning.plan(body, "one-pulse")
    assert not plan.feasible
    _, too_much = read_rows(body, "1.0,0.05,a", "2.0,0.05,a")
    check_text("files.thrust-rows", "\n".join([*too_short, *too_much, infeasibility(plan) or ""]))
    rows = {
        "outside the impulse bit": (read_lines(body=with_table()), "1.0,0.05,a"),
        "before the thrust is over": (read_lines(VALVE), "1.0,0.03,a", "1.035,0.03,a"),
    }
    check_faults("files.thrust-faulty-rows", lambda given: read_rows(*given), rows)


# --- dispersions
# --------------------------------------------------------------------------------------------------

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


RATES = (
    Tolerance("normal", math.pi),
    Tolerance("bias", -0.01),
    Tolerance("uniform", 0.01, relative=True),
)
DISPERSED: tuple[tuple[str, dict[str, Any]], ...] = (
    ("{}", {}),
    ("{timing_offset: {bias: -2 ms}}", {"timing_offset": Tolerance("bias", -0.002)}),
    ("{attitude: {normal: 0}}", {"attitude": Tolerance("normal", 0.0)}),
    ("{omega0: {normal: 0.1 rad/s}}", {"omega0": (Tolerance("normal", 0.1),) * 3}),
    ("{omega0: [{normal: 180 deg/s}, {bias: -0.01}, {uniform: 1 %}]}", {"omega0": RATES}),
    ("{thrust: {normal: 3 %}}", {"thrust": dict.fromkeys(NAMES, THREE_PERCENT)}),
    ("{thrust: {T2: {normal: 3 %}}}", {"thrust": {"T2": THREE_PERCENT}}),
    # A thrust becomes a fraction: 10 N; 8 N m on 0.8 m; 20 N m on 2 m.
    (
        "{thrust: {T1: {normal: 0.3 N}, T2: {normal: 300 mN}}}",
        {"thrust": dict.fromkeys(("T1", "T2"), THREE_PERCENT)},
    ),
    ("{thrust: {steerable: {normal: 0.3 N}}}", {"thrust": {"steerable": THREE_PERCENT}}),
    ("{thrust_per_pulse: {normal: 3 %}}", {"thrust_per_pulse": THREE_PERCENT}),
    ("{thrust_per_pulse: {normal: 0.03}}", {"thrust_per_pulse": THREE_PERCENT}),
    (
        "{thrust_direction: {normal: 0.5 rad}}",
        {"thrust_direction": dict.fromkeys(NAMES, Tolerance("normal", 0.5))},
    ),
    ("{position: {normal: 5 mm}}", {"position": dict.fromkeys(NAMES, Tolerance("normal", 0.005))}),
    ("{position: {T1: {normal: 5 mm}}}", {"position": {"T1": Tolerance("normal", 0.005)}}),
)


KINDS = [
    (
        f"{{A: {{{kind}: 2 %}}, C: {{{kind}: 0.5 kg m^2}}, timing: {{{kind}: 5 ms}}}}",
        {
            "A": Tolerance(kind, 0.02, relative=True),
            "C": Tolerance(kind, 0.5),
            "timing": Tolerance(kind, 0.005),
        },
    )
    for kind in ("normal", "uniform", "triangular", "bias")
]


def test_dispersions_are_read_in_si() -> None:
    for text, fields in (*DISPERSED, *KINDS):
        assert dispersed(text).dispersions == Dispersions(**fields), text
    for actuators, text, name in (
        ("", "{thrust: {normal: 3 %}}", "steerable"),  # the torquer that is assumed
        ("", "{thrust: {steerable: {normal: 3 %}}}", "steerable"),
        (
            "thrusters: [{name: normal, torque: [0, 8, 0]}]\n",
            "{thrust: {normal: {normal: 3 %}}}",
            "normal",
        ),
    ):
        assert dispersed(text, actuators).dispersions == Dispersions(thrust={name: THREE_PERCENT})


EVERY_TOLERANCE = """\
{A: {normal: 1 %}, C: {normal: 1 %}, omega0: {normal: 0.01}, thrust: {normal: 1 %},
 thrust_per_pulse: {normal: 1 %}, thrust_direction: {normal: 1 deg}, position: {normal: 1 mm},
 timing: {normal: 1 ms}, timing_offset: {normal: 1 ms}, attitude: {normal: 1 deg},
 open_delay: {normal: 1 ms}, cold: {normal: 1 %}, cold_pulses: {normal: 1 %},
 tank_propellant: {normal: 1 %}, tank_final_pressure: {normal: 1 %}, inertia_per_kg: {normal: 1 %},
 sensor_bias: {normal: 0.01 SENSED}, sensor_scale: {normal: 1 %}, sensor_noise: {normal: 1 %},
 PAIRS}
"""
CRAFT = """\
thrusters:
  - {name: T1, position: [0, 0.3, 0.8], direction: [0, -1, 0], force: 10 N, isp: 220 s,
     min_on_time: 20 ms}
  - {name: T 2, position: [0, -0.3, 0.8], direction: [0, 1, 0], force: 10 N, isp: 220 s,
     min_on_time: 20 ms}
valve: {open_delay: 20 ms, close_delay: 20 ms}
cold: {first: 90 %, pulses: 4}
tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar,
  inertia_per_kg: {A: 0.1 m^2, C: 0.1 m^2}}
loop: {sensor: {kind: KIND, rate: 10 Hz, noise: 0.01 SENSED}, start: 0.5 deg}
"""


@pytest.mark.parametrize(
    ("kind", "unit"), [("gyro", "deg/s"), ("accelerometer, position: [1, 0, 0]", "m/s^2")]
)
def test_whatever_any_schedule_or_loop_draws_once_may_be_correlated(kind: str, unit: str) -> None:
    """The file names inputs as the study does, each beside the next."""
    craft, tolerances = (
        text.replace("KIND", kind).replace("SENSED", unit) for text in (CRAFT, EVERY_TOLERANCE)
    )
    alone = dispersed(tolerances.replace(",\n PAIRS", ""), craft)
    names = [
        drawn.name for drawn in reachable(alone).drawn if not drawn.name.endswith("of each pulse")
    ]
    assert len(names) > 25
    pairs = [(first, second, 0.1) for first, second in pairwise(names)]
    text = (
        "correlation: "
        f"[{', '.join(f'[{first}, {second}, {size}]' for first, second, size in pairs)}]"
    )
    dispersions = dispersed(tolerances.replace("PAIRS", text), craft).dispersions
    assert present(dispersions).correlation == tuple(pairs)
