"""Spacecraft files with other values: set beside them, carried on by a flight, estimated by a fit;
their attitudes, and one mission in several frames.
"""

import copy
import dataclasses
import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.builders import noted, present
from support.cases import spread
from support.contract import BASE, THRUSTERS, check_parts
from support.dispersed import normal
from support.golden import check_text, refusal
from support.places import case
from support.process import Run
from support.telemetry import silent, told

import nutdamp
from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest, Fault, FaultyFile
from nutdamp.estimation.results import carried, correlations, replaced
from nutdamp.files.carried import fitted_text, later, notes
from nutdamp.files.ccsds.read import read_message
from nutdamp.files.ccsds.write import merge
from nutdamp.files.editing import as_before, parse_setting
from nutdamp.files.reader import Source, example_text, read_spacecraft, source_of
from nutdamp.files.telemetry import record_of
from nutdamp.files.yaml import KeyPath, dotted, read_tree
from nutdamp.flight.dynamics import supplied
from nutdamp.physics import attitude, frames
from nutdamp.spacecraft.model import SpinState
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.spacecraft.tolerances import Dispersions
from nutdamp.views.decisions import plan_json
from nutdamp.views.simulation import simulation_json

EXAMPLE = example_text()


def with_settings(text: str, *settings: str) -> nutdamp.Spacecraft:
    return read_spacecraft(text, "f.yaml", [parse_setting(one) for one in settings])


def faults_of(text: str, *settings: str) -> list[Fault]:
    try:
        with_settings(text, *settings)
    except FaultyFile as wrong:
        return wrong.faults
    return []


def leaves(value: Any, path: KeyPath = ()) -> Iterator[tuple[KeyPath, Any]]:
    """Every value of a file that holds no others."""
    steps = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
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


def contents(spacecraft: nutdamp.Spacecraft) -> str:
    return repr(dataclasses.asdict(dataclasses.replace(spacecraft, document=None)))


PLAIN = read_tree(EXAMPLE, "f.yaml")[0].plain()
LEAVES = list(leaves(PLAIN))


@pytest.mark.deep
@spread("value", ["rubbish", 1e9, {"x": 1}, "-1 min", True, None, [1, 2], ""], quick=1)
def test_what_is_set_is_checked_as_the_file_is(value: object) -> None:
    """Each value of the example replaced in turn: the same faults, whether in the file or beside
    it.
    """
    placed: set[bool] = set()
    for path, _ in LEAVES:
        text = changed(PLAIN, path, value)
        setting = f"{dotted(path)}={json.dumps(value)}"
        inside, beside = faults_of(text), faults_of(EXAMPLE, setting)
        pairs = [
            sorted((fault.where, fault.problem) for fault in faults) for faults in (inside, beside)
        ]
        assert pairs[0] == pairs[1], setting
        if beside:
            placed.add(any(fault.file.startswith("--set ") and fault.line == 0 for fault in beside))
        else:
            assert contents(with_settings(EXAMPLE, setting)) == contents(
                read_spacecraft(text, "f.yaml")
            )
    assert placed == {True}


def test_entries_of_lists_sections_that_are_not_there_and_the_later_of_two_settings() -> None:
    for key in (
        "thrusters[1].torque",
        "thrusters.T2.torque",
        "thrusters[T2].torque",
        "thrusters.'T2'.torque",
    ):
        craft = with_settings(THRUSTERS, f"{key}=[0, -3, 0]")
        assert tuple(craft.channels[1].thrusters[0].torque) == (0, -3, 0)
    craft = with_settings(
        BASE, "limits.blackout=[[10 s, 0.5 min], [40, 41]]", "limits.max_pulses=3", "omega0[1]=0.5"
    )
    assert (craft.limits.blackout, craft.limits.max_pulses) == (((10.0, 30.0), (40.0, 41.0)), 3)
    assert tuple(craft.omega0) == (0.1, 0.5, 3.0)
    assert with_settings(BASE, "mass=2", "mass=3 kg").mass == 3.0
    # What aliases share changes only where it is set.
    shared = "thrusters: [&t {name: T1, torque: &v [8, 0, 0]}, {name: T2, torque: *v}]\n"
    craft = with_settings(BASE + shared, "thrusters.T2.torque[0]=-1")
    assert [channel.thrusters[0].torque[0] for channel in craft.channels] == [8.0, -1.0]


def test_a_fault_names_the_setting_as_its_place() -> None:
    lines = list[str]()
    for setting in (
        "limits.horizon=-3 s",
        "limits.horizn=300s",
        "limits.earlist=300s",
        ("thrusters.T11.torque=[1, 0, 0]"),
        "thrusters.Z.torque=[1, 0, 0]",
        "thrusters[3].torque=[1, 0, 0]",
        "omega0.x=1",
        "limits.blackout[0]=[1, 2]",
        "name.x=1",
        "limits.blackout=[[1, 2]",
        "mass=",
        "limits.tick={a: 1, a: 2}",
        "name=!!python/object:os.system x",
        f"{'x.' * 40}y=1",
        "mass=\x1b[31m",
    ):
        faults = faults_of(THRUSTERS + "limits: {horizon: 120 s}\n", setting)
        assert faults
        assert all(
            fault.file.startswith("--set ") and not fault.line and str(fault).isprintable()
            for fault in faults
        )
        lines += map(str, faults)
    lines += map(str, faults_of(THRUSTERS, "thrusters[0].name=T2"))  # a name that another entry has
    check_text("files.settings", "\n".join(lines))
    for text in (
        "",
        "mass",
        "=3",
        "a..b=1",
        ".a=1",
        "a[=1",
        "a[1=2",
        "a]=1",
        "'a=1",
        "a.'\\x=1",
        "[]=1",
    ):
        with pytest.raises(ValueError, match=r"is not KEY=VALUE, such as limits\.horizon=300s"):
            parse_setting(text)


def test_faults_of_file_and_settings_come_together_and_are_the_same() -> None:
    (fault,) = faults_of(BASE, "state={spin: 3, nutation: 8 deg}")
    (there,) = faults_of(BASE + "state: {spin: 3, nutation: 8 deg}\n")
    assert (fault.where, fault.problem) == (there.where, there.problem)
    faults = faults_of(BASE + "mass: -1 kg\n", "limits.tick=0 s", "limits.gap=-1 s")
    places = [(fault.where, fault.file[:5]) for fault in faults]
    assert places == [("limits.gap", "--set"), ("limits.tick", "--set"), ("mass", "f.yam")]


CHARACTERS = st.text(
    "aZ09_+-. []{}'\"\\=:#,\t\n\x00\x1b\x85\u2028\ud83dé漢😀", min_size=1, max_size=12
)
STEPS = st.one_of(st.integers(0, 99), CHARACTERS.filter(lambda text: text.strip() == text))


@given(
    st.lists(STEPS, min_size=1, max_size=5).filter(lambda path: isinstance(path[0], str)),
    CHARACTERS,
)
def test_a_key_as_messages_write_it_can_be_set(path: list[str | int], value: str) -> None:
    setting = parse_setting(f"{dotted(tuple(path))}={value}")
    assert (setting.path, setting.value) == (tuple(path), value)
    assert setting.label.isprintable()


KEYS = st.sampled_from(
    [dotted(path) for path, _ in LEAVES] + ["thrusters", "limits", "goal.spin", "x.y[0]", "limits"]
)
VALUES = st.one_of(st.text(max_size=12), st.text("[]{}:,&*!'\"#-1e9 .xmNd\n\t|>%@", max_size=24))


@pytest.mark.deep
@settings(max_examples=200)
@given(st.lists(st.tuples(KEYS, VALUES), min_size=1, max_size=3))
def test_whatever_is_set_is_a_spacecraft_or_faults_on_one_line_each(
    chosen: list[tuple[str, str]],
) -> None:
    assert all(
        str(fault).isprintable()
        for fault in faults_of(EXAMPLE, *(f"{key}={value}" for key, value in chosen))
    )


def test_the_library_sets_too(tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_text(THRUSTERS, encoding="utf-8")
    values = {
        "limits.horizon": "300 s",
        "thrusters.T1.torque": (9, 0, 0),
        "limits.blackout": [["1 s", 2]],
        "mass": 50,
    }
    craft = nutdamp.load(file, set=values)
    assert (craft.limits.horizon, craft.limits.blackout, craft.mass) == (300.0, ((1.0, 2.0),), 50.0)
    assert craft.channels[0].thrusters[0].torque[0] == 9.0
    wrong = (
        ({"limits.tick": -1.5}, FaultyFile),
        ({"a=b": 1}, BadRequest),
        ({"mass": object}, BadRequest),
    )
    said = (refusal(error, nutdamp.load, file, set=setting) for setting, error in wrong)
    check_text("files.settings-library", "\n".join(said))


# --- carried on: it flies as the flight that it was taken from does, and keeps its comments

SOUNDER = """
name: Sounder  # flown twice
inertia: {A: 120 kg m^2, C: 80 kg m^2}
state: {spin: 30 rpm, nutation: 5 deg, phase: 20 deg}   # as released
thrusters:
  - {name: P, torque: [8, 0, 0], isp: 220 s, lever_arm: 0.8 m, max_on_time: 1 s}
  - {name: N, torque: [-8, 0, 0], isp: 220 s, lever_arm: 0.8 m, max_on_time: 1 s}
"""
ATTITUDE = (
    "attitude: {quaternion: [0.9, 0.1, -0.2, 0.3], epoch: 2026-03-01T12:00:00Z, frame: EME2000}\n"
)
TENSOR = "{tensor: [[120, 2, 1], [2, 110, 0.5], [1, 0.5, 80]]}"
TANK = (
    "tank: {propellant: 0.5 kg, pressure: 22 bar, final_pressure: 8 bar, inertia_per_kg: {A: 3, "
    "C: 5}}\nmass: 250 kg\n"
)
LEAK = "disturbances: [{name: leak, torque: [5 mN m, 2 mN m, 0], rate: -1.3 rad/s}]\n"
BURNS = """
disturbances:
- {name: past, torque: [5 N m, 0, 0], until: 39 s}
- {name: burn, torque: [0, 3 N m, 0], rate: 1, from: 30 s, until: 50}
- {name: next, torque: [0, 3 N m, 1 N m], from: 0.9 min}
- {name: on, torque: [0, 20 mN m, 0], until: 55 s}  # so long
"""

TEXTS = {
    "symmetric": SOUNDER + ATTITUDE,
    "tensor": SOUNDER.replace("{A: 120 kg m^2, C: 80 kg m^2}", TENSOR) + ATTITUDE,
    "rates": SOUNDER.replace(
        "state: {spin: 30 rpm, nutation: 5 deg, phase: 20 deg}", "omega0: [0.2, 5 deg/s, 3]"
    )
    + ATTITUDE,
    "tank": SOUNDER + ATTITUDE + TANK,
    "turning torque": SOUNDER + ATTITUDE + LEAK,
    "turning torque, tensor": SOUNDER.replace("{A: 120 kg m^2, C: 80 kg m^2}", TENSOR)
    + ATTITUDE
    + LEAK.replace("2 mN m, 0]", "2 mN m, 90 mN m]"),
    "torques that end": SOUNDER + ATTITUDE + BURNS,
    "torques that end, indented": SOUNDER + ATTITUDE + BURNS.replace("- {", "  - {"),
}


def planned(text: str) -> nutdamp.Plan:
    return nutdamp.plan(nutdamp.read(text), "two-pulse")


def turned(first: np.ndarray, second: np.ndarray) -> float:
    """Angle between two attitudes, rad."""
    return float(2.0 * np.linalg.norm(attitude.multiply(attitude.conjugate(first), second)[1:]))


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_the_file_carried_on_flies_as_the_plan_does(text: str) -> None:
    plan = planned(text)
    carried = plan.carried(40.0)
    expected, flight = plan.fly(70.0).track, nutdamp.plan(carried, "none").fly(30.0).track
    assert np.allclose(flight.rates[-1], expected.rates[-1], rtol=0.0, atol=1e-10)
    assert turned(flight.quaternion[-1], expected.quaternion[-1]) < 1e-9
    assert present(carried.attitude).epoch == "2026-03-01T12:00:40Z"


def test_tank_and_mass_are_those_left() -> None:
    plan = planned(TEXTS["tank"])
    used = plan.propellant or 0.0
    carried = plan.carried()
    before, after = present(plan.spacecraft.tank), present(carried.tank)
    assert (after.propellant, carried.mass) == pytest.approx((0.5 - used, 250.0 - used))
    assert after.pressure == pytest.approx(before.pressure_after(used))
    # What is left acts as the rest of the same tank.
    assert after.thrust_factor(0.1) * after.pressure == pytest.approx(
        before.pressure_after(used + 0.1)
    )
    assert carried.inertia.moments == pytest.approx(
        (120.0 - 3.0 * used, 120.0 - 3.0 * used, 80.0 - 5.0 * used)
    )


def test_a_target_stays_where_it_is_in_space() -> None:
    """Without an attitude a file knows space by the motion at t = 0, which is another one in the
    file carried on.
    """
    plan = nutdamp.plan(nutdamp.read(SOUNDER + "goal: {tilt: 10 deg, azimuth: 45 deg}\n"), "none")
    moved_on = later(plan._reaching(33.0), 33.0)
    carried = plan.carried(33.0)
    seen = [
        attitude.rotate(attitude.conjugate(moved_on.quaternion), plan.spacecraft.target_axis),
        attitude.rotate(attitude.conjugate(carried.initial.quaternion), carried.target_axis),
    ]
    assert np.allclose(seen[0], seen[1], rtol=0.0, atol=1e-10)


def test_comments_and_units_are_kept() -> None:
    carried = planned(SOUNDER).carried(40.0)
    assert isinstance(carried.source, Source)
    text = re.sub(r"nutation: [^,]+ deg, phase: [^}]+ deg", "…", carried.source.text)
    assert text == re.sub(r"nutation: 5 deg, phase: 20 deg", "…", SOUNDER)


def test_what_no_file_can_hold_is_refused() -> None:
    plan = planned(SOUNDER)
    body = nutdamp.read(SOUNDER + TANK.replace("0.5 kg", "1 g"))
    long = supplied(body, [channel_pulse(body.channels[0], 3.0, 5.0)])
    light: nutdamp.Spacecraft = plan.spacecraft.replace(mass=3.0)
    rows: tuple[tuple[nutdamp.Plan, float | None, str], ...] = (
        (plan, plan.pulses[0].t, "is on at"),
        (nutdamp.Plan(body, "by hand", Schedule(long)), None, "no propellant"),
        *((plan, time, "after t = 0") for time in (-3.0, math.nan, math.inf)),
        (nutdamp.plan(light, "two-pulse"), None, "no field replaced"),
    )
    for flown, time, problem in rows:
        assert problem in refusal(BadRequest, flown.carried, time)


@pytest.mark.parametrize(("command", "lasts"), [
    (("plan", "--nominal", "--scheme", "two-pulse"), 3.0),
    (("simulate", "--scheme", "two-pulse", "--until", "20s"), 20.0),
])  # fmt: skip
def test_commands_write_it(
    run: Run, tmp_path: Path, command: tuple[str, ...], lasts: float
) -> None:
    (tmp_path / "now.yaml").write_text(TEXTS["symmetric"])
    run(*command, "now.yaml", "-o", "next.yaml", status=0)
    carried = nutdamp.load(tmp_path / "next.yaml")
    assert float(present(present(carried.attitude).epoch)[17:19]) >= lasts
    assert "-o" in run("simulate", "now.yaml", "--scheme", "none", "--at", "5s", status=2).stderr


# --- the estimates of a fit: read back it is the body of the fit, and all else stays

GYROS = ("omega_1", "omega_2", "omega_3")
FILE = """\
name: fitted  # its name
inertia: {A: 120 kg m^2, C: 80}  # moments
state:
  spin: 30 rpm
  nutation: 5 deg  # at t = 0
attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [0.9, 0.1, 0.2, 0.3]}
goal: {tilt: 20 deg, azimuth: 0.5}
valve: {open_delay: 10 ms, close_delay: 12 ms}
thrusters:
  - {name: T1, position: [0, 0.5, 0.8], direction: [0, -1, 0], force: 10 N, isp: 220 s}  # pushed
  - {name: T 2, torque: [0, 8 N m, 0], lever_arm: 1 m, isp: 220 s,
     valve: {open_delay: 0.02, close_delay: 0.02}}
  - {name: T3, torque: [0, -8, 0], lever_arm: 1 m, isp: 220 s}
tank: {propellant: 10 kg, pressure: 2e6, final_pressure: 1e6}
limits: {horizon: 90 s, earliest: 1 s}
loop:
  sensor: {kind: accelerometer, rate: 10 Hz, position: [0.8 m, 0, 0], axis: [0, 0, 1]}
  law: four-pulse
  start: 0.5 deg
  stop: 0.05 deg
dispersions:
  {A: {normal: 0.5 %}, C: {normal: 0.5 %},
   thrust: {T1: {normal: 3 %}, T 2: {normal: 3 %}, T3: {normal: 2 %}}}
"""


def as_written(value: Any) -> Any:
    """Numbers as they come back from a text."""
    return pytest.approx(value) if isinstance(value, float | tuple | list) else value


def test_the_file_holds_all_that_is_known_now() -> None:
    settings = (parse_setting("thrusters.T3.torque[1]=-9"), parse_setting("mass=200 kg"))
    body = Source(FILE, "f.yaml", settings).read()
    fired = Schedule(
        tuple(channel_pulse(one, t, 0.5) for one, t in zip(body.channels, (3.0, 6.0), strict=False))
    )
    record = silent(*GYROS, "axis_x", "axis_y", "axis_z", "acceleration", schedule=fired)
    fit = told(
        body,
        record,
        {
            "A": 121.0,
            "C/A": 0.7,
            "omega_1": 0.1,
            "omega_2": -0.2,
            "omega_3": 3.1,
            "attitude_1": 0.01,
            "attitude_2": -0.02,
            "attitude_3": 0.3,
            "bias_omega_1": 1e-3,
            "wobble_2": 2e-3,
            "bias_acceleration": 0.03,
            "thrust T1": 0.96,
            "thrust T 2": 1.05,
            "delay T1": 0.005,
            "delay T 2": -0.015,
        },
        {
            "A": 0.4,
            "C/A": 1e-3,
            "omega_1": 1e-3,
            "thrust T1": 0.01,
            "attitude_1": 2e-3,
            "attitude_2": 2e-3,
        },
    )
    known = carried(fit, 7.5)
    text = fitted_text(fit, known)
    now = read_spacecraft(text, "now.yaml")
    expected = replaced(body, known)
    assert abs(now.initial.quaternion @ expected.initial.quaternion) == pytest.approx(
        1.0, abs=1e-12
    )
    sigmas = dict(zip(known.names, known.sigmas, strict=True))
    spread = present(now.dispersions)
    thrust = {name: one.size for name, one in spread.thrust.items()}
    assert thrust == pytest.approx({"T1": 0.01 / 0.96, "T 2": 1e-7 / 1.05, "T3": 0.02}, rel=1e-5)
    estimated: dict[str, Any] = {
        "inertia.moments": (121.0, 121.0, 84.7),
        "omega0": pytest.approx(expected.omega0, rel=1e-9),
        "mass": 200.0,
        "target_axis": pytest.approx(body.target_axis, abs=1e-9),  # though t = 0 is another now
        "attitude.epoch": "2026-03-01T12:00:07.5Z",
        "channels.0.thrusters.0.force": [0.0, -9.6, 0.0],
        "channels.1.thrusters.0.torque.1": 8.0 * 1.05,
        "channels.2.thrusters.0.torque.1": -9.0,
        "channels.0.valve.open_delay": 0.015,
        "channels.0.valve.close_delay": 0.017,
        "channels.1.valve.open_delay": 0.005,
        "channels.1.valve.close_delay": 0.005,
        "channels.2.valve.open_delay": 0.01,
        "channels.2.valve.close_delay": 0.012,
        "loop.sensor.bias": 0.03,
        "dispersions.A.size": pytest.approx(0.4 / 121.0, rel=1e-5),
        "dispersions.omega0.0.size": pytest.approx(sigmas["omega0_1"], rel=1e-5),
        "dispersions.omega0.1.size": pytest.approx(sigmas["omega0_2"], rel=1e-5),
        "dispersions.omega0.2.size": pytest.approx(sigmas["omega0_3"], rel=1e-5),
        "dispersions.attitude.size": pytest.approx(known.tilt, rel=1e-5),
    }
    check_parts(now, {path: as_written(value) for path, value in estimated.items()})
    assert spread.correlation == correlations(known, body.dispersions)
    # A file of the whole tensor has no inputs of the names A and C.
    drawn = correlations(known, Dispersions(inertia_tensor=normal(0.01, relative=True)))
    assert drawn == tuple(pair for pair in spread.correlation if not {"A", "C"} & {*pair[:2]})
    assert re.findall("#.*", text) == re.findall("#.*", FILE)
    units = "kg m^2", "rpm", "deg", "N", "N m", "ms"
    assert [bool(re.search(rf"[\d.] {re.escape(unit)}\b", text)) for unit in units] == [True] * 6
    check_text("files.fitted-notes", noted(notes(fit, known)))


CASES: dict[str, tuple[str, Mapping[str, float], bool]] = {
    "three moments, other axes": (
        "inertia: {A: 120, C: 80}\nstate: {spin: 3, nutation: 5 deg}\n",
        {},
        True,
    ),
    "tensor": (
        "inertia: {tensor: [[120, 0, 1], [0, 110, 2], [1, 2, 80]]}\nomega0: [0.1, 10 deg/s, 3]\n",
        {},
        True,
    ),
    "decay": (
        "inertia: {A: 80, C: 120}\nomega0: [0.1, 0.2, 3]\ndissipation: {time_constant: 5 min}\n",
        {},
        False,
    ),
    "odd": ("inertia: {A: 80, C: 120}\nomega0: [0.1, 0.2, 3]\n", {"growth": 0.002}, False),
    "not seen": ("inertia: {A: 80, C: 120}\nomega0: [0.1, 0.2, 3]\n", {"growth": 1e-8}, False),
}


@pytest.mark.parametrize("name", CASES)
def test_bodies_of_any_kind_are_written_as_the_file_has_them(name: str) -> None:
    """Tensors and rates where A, C and angles do not tell it; a growth that dissipation would not
    cause is said.
    """
    text, given, unequal = CASES[name]
    text = "name: x\n" + text
    body = Source(text, "f.yaml").read()
    values = {"omega_1": 0.11, "omega_3": -2.9 if "axes" in name else 3.2, **given}
    values |= {"unequal_1": 0.05, "unequal_2": 0.02} if unequal else {"growth": -0.002, **given}
    fit = told(body, silent(*GYROS), values, {}, unequal=unequal)
    known = carried(fit, 4.0)
    written = fitted_text(fit, known)
    now = read_spacecraft(written, "now.yaml")
    bodies = now.inertia, known.body.inertia
    tensors = [body.axes @ np.diag(body.moments) @ body.axes.T for body in bodies]
    assert tensors[0] == pytest.approx(tensors[1], rel=1e-9, abs=1e-8)
    assert now.inertia.axes @ now.omega0 == pytest.approx(known.values[2:5], rel=1e-9)
    if not unequal:
        assert now.growth == pytest.approx(values["growth"] if name != "not seen" else 0.0)
    shape = re.sub(r"\b\d[\d.e-]*", "#", written.partition("dispersions")[0])
    check_text(f"files.fitted-{name.split()[0]}", shape + noted(notes(fit, known)))


def test_thrusters_that_did_not_fire_and_delays_that_no_valve_has_are_said() -> None:
    body = Source(FILE, "f.yaml").read()
    fired = Schedule(
        tuple(
            channel_pulse(one, t, 0.5)
            for one, t in zip(body.channels, (2.0, 4.0, 6.0), strict=True)
        )
    )
    values = {"thrust T1": 0.01, "thrust T 2": -0.9, "delay T1": -0.5, "delay T3": -0.02}
    fit = told(body, silent(*GYROS, schedule=fired), values, {})
    known = carried(fit, 0.0)
    check_text("files.fitted-doubts", noted(notes(fit, known)))
    text = fitted_text(fit, known)
    now = read_spacecraft(text, "now.yaml")
    assert "epoch: 2026-03-01T12:00:00Z" in text  # as it was
    assert [one.thrusters[0].torque for one in now.channels[:2]] == [
        pytest.approx(one.thrusters[0].torque) for one in body.channels[:2]
    ]
    assert [one.valve for one in now.channels] == [one.valve for one in body.channels]


# --- attitudes of files: by the direction of an axis and a phase, or merged from messages

SPACECRAFT = """
name: Sounder  # flown twice
inertia: {A: 120 kg m^2, C: 80 kg m^2}
omega0: [0.2 rad/s, 5 deg/s, 30 rpm]   # as released
attitude: {quaternion: [0.9, 0.1, -0.2, 0.3], epoch: 2026-03-01T12:00:00Z, frame: EME2000}
thrusters:
  - {name: P, torque: [8, 0, 0], max_on_time: 1 s}
"""
SKEW = SPACECRAFT.replace(
    "{A: 120 kg m^2, C: 80 kg m^2}", "{tensor: [[120, 2, 1], [2, 110, 0.5], [1, 0.5, 80]]}"
)


def exported(
    tmp_path: Path, text: str, form: str, until: float = 20.0
) -> tuple[Path, nutdamp.Plan]:
    plan = nutdamp.plan(nutdamp.read(text), "none")
    path = tmp_path / f"message.{form}"
    nutdamp.export(plan, form, path, until=until if form == "aem" else None)
    return path, plan


def quaternion(spacecraft: nutdamp.Spacecraft) -> np.ndarray:
    return present(spacecraft.attitude).quaternion


def test_the_nutation_of_a_message_stays_whatever_the_ratio_of_the_file(
    run: Run, tmp_path: Path
) -> None:
    """NUTATION = 5 became 4.62 deg at exit 0; spin, nutation and period of the message are those of
    C/A = 1.2009.
    """
    text = case("apm-into.yaml").read_text()
    for moment, doubt in (("1300", "message-contradicts"), ("1200.9", "")):
        (tmp_path / "other.yaml").write_text(text.replace("1300", moment))
        result = run(
            "import",
            str(case("spin-nutation.apm.txt")),
            "--into",
            "other.yaml",
            "-o",
            "merged.yaml",
        )
        assert (result.returncode, "warning" in result.stderr) == (0, bool(doubt))
        assert doubt in result.stderr
        merged = nutdamp.load(tmp_path / "merged.yaml")
        assert math.degrees(merged.nutation) == pytest.approx(5.0, rel=1e-12)
        assert merged.spin == pytest.approx(
            -math.pi / 10.0 + 2.0 * math.pi / 3.3333333 * math.cos(math.radians(5.0))
        )


def test_an_attitude_is_written_as_the_message_has_it(tmp_path: Path) -> None:
    """Without the rounding of a turn to the principal axes and back."""
    path, _ = exported(
        tmp_path, SPACECRAFT.replace("[0.9, 0.1, -0.2, 0.3]", "[0.8, 0, 0.6, 0]"), "apm"
    )
    assert (
        "quaternion: [0.8, 0, 0.6, 0],"
        in merge(Source(SKEW, "f.yaml"), read_message(str(path)), inertia=True)[0]
    )


def test_a_file_without_attitude_gets_one(run: Run, tmp_path: Path) -> None:
    path, plan = exported(tmp_path, SPACECRAFT, "apm")
    lines = [line for line in SPACECRAFT.splitlines() if not line.startswith("attitude")]
    (tmp_path / "other.yaml").write_text("\n".join(lines))
    assert run("import", path.name, "--into", "other.yaml", "-o", "merged.yaml").returncode == 0
    assert (
        turned(quaternion(nutdamp.load(tmp_path / "merged.yaml")), quaternion(plan.spacecraft))
        < 1e-8
    )


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (("import", "m.aem"), 2),
        (("import", "m.aem", "--at", "3s"), 2),
        (("import", "m.aem", "--inertia"), 2),
        (("import", "m.aem", "--into", "s.yaml", "--inertia"), 2),
        (("import", "m.aem", "--into", "s.yaml", "--at", "99s"), 2),
        (("import", "m.aem", "--into", "s.yaml", "--schedule", "p.csv"), 2),
    ],
)
def test_what_cannot_be_merged_is_refused(
    run: Run, tmp_path: Path, arguments: tuple[str, ...], status: int
) -> None:
    path, _ = exported(tmp_path, SPACECRAFT, "aem")
    path.rename(tmp_path / "m.aem")
    (tmp_path / "s.yaml").write_text(SPACECRAFT)
    assert run(*arguments, "-o", "out.yaml").returncode == status
    assert not (tmp_path / "out.yaml").exists()


# --- by the direction of the spin axis, or of the angular momentum, and a phase about it

ANGLES = st.floats(-180.0, 180.0)
DECLINATIONS = st.floats(-89.0, 89.0)
SYMMETRIC = "{A: 120, C: 80}"


def body(
    given: str, *, spin: float = 3.0, inertia: str = SYMMETRIC, more: str = ""
) -> nutdamp.Spacecraft:
    return nutdamp.read(
        f"name: b\ninertia: {inertia}\nomega0: [0.1, -0.2, {spin}]\nattitude: {{{given}}}\n{more}"
    )


def direction(right_ascension: float, declination: float) -> np.ndarray:
    ra, dec = math.radians(right_ascension), math.radians(declination)
    return np.array([math.cos(dec) * math.cos(ra), math.cos(dec) * math.sin(ra), math.sin(dec)])


def angle_about(axis: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    """Angle about an axis from one vector to another as they are seen along it, deg."""
    first, second = (vector - axis * (axis @ vector) for vector in (start, end))
    return math.degrees(math.atan2(axis @ np.cross(first, second), first @ second))


def same_angle(first: float, second: float) -> bool:
    return abs((first - second + 180.0) % 360.0 - 180.0) < 1e-7


@pytest.mark.parametrize("by", ["phase", "of: momentum, phase", "sun_phase"])
@given(
    ANGLES, DECLINATIONS, ANGLES, st.sampled_from([3.0, -3.0]), st.sampled_from([SYMMETRIC, TENSOR])
)
def test_the_phase_counts_from_the_ascending_node_or_the_sun_to_body_axis_1(
    by: str, ra: float, dec: float, phase: float, spin: float, inertia: str
) -> None:
    """About the spin axis, or the angular momentum."""
    given = f"spin_axis: [{ra} deg, {dec} deg], {by}: {phase} deg"
    sun = f"sun: [{ra + 40.0} deg, {0.5 * dec} deg]"
    spacecraft = body(given, spin=spin, inertia=inertia, more=sun)
    axis = direction(ra, dec)
    stated = attitude.unit(spacecraft.momentum) if "momentum" in by else spacecraft.axis
    assert np.allclose(stated, axis, rtol=0.0, atol=1e-12)
    start = np.cross([0.0, 0.0, 1.0], axis)
    if by == "sun_phase":
        start = direction(ra + 40.0, 0.5 * dec)
    first = attitude.rotate(quaternion(spacecraft), np.array([1.0, 0.0, 0.0]))
    assert same_angle(angle_about(axis, start, first), phase)


@pytest.mark.parametrize("dec", [90.0, -90.0])
def test_at_a_pole_the_phase_counts_from_x(dec: float) -> None:
    spacecraft = body(f"spin_axis: [10 deg, {dec} deg], phase: 30 deg")
    first = attitude.rotate(quaternion(spacecraft), np.array([1.0, 0.0, 0.0]))
    assert same_angle(
        angle_about(
            np.array([0.0, 0.0, math.copysign(1.0, dec)]), np.array([1.0, 0.0, 0.0]), first
        ),
        30.0,
    )


@pytest.mark.parametrize(
    "of",
    [
        "phase: 20 deg",
        "phase: 20 deg, of: momentum",
        "sun_phase: 20 deg",
        "sun_phase: 20 deg, of: momentum",
    ],
)
@pytest.mark.parametrize("inertia", [SYMMETRIC, TENSOR])
@pytest.mark.parametrize("spin", [3.0, -3.0])
def test_a_file_carried_on_holds_spin_axis_and_phase(of: str, inertia: str, spin: float) -> None:
    """A phase from the side of the Sun becomes one from the ascending node."""
    keys = f"spin_axis: [120 deg, -15 deg], {of}, epoch: 2026-03-01T12:00:00Z"
    spacecraft = body(keys, spin=spin, inertia=inertia, more="sun: epoch")
    plan = nutdamp.plan(spacecraft, "none")
    carried = plan.carried(10.0)
    flown = plan.fly(10.0).track.quaternion[-1]
    turned = attitude.multiply(attitude.conjugate(quaternion(carried)), flown)
    assert np.linalg.norm(turned[1:]) < 1e-10
    assert isinstance(carried.source, Source)
    words = set(carried.source.text.replace("{", " ").replace("[", " ").split())
    assert {"spin_axis:", "phase:"} <= words
    assert words.isdisjoint({"quaternion:", "sun_phase:"})
    assert present(carried.attitude).epoch == "2026-03-01T12:00:10Z"


# --- one mission in several frames: plans alike, directions of the file, exports in EME2000

EPOCH = "2026-03-01T12:00:00Z"
DAYS = Epoch.parse(EPOCH).days_of_j2000
OTHER = ("ECLIPJ2000", "ECLIPDATE", "MOD", "GCRF")
SOLID = 1e-9  # rad and shares: rounding, grown by the search for a plan


def mission(frame: str) -> dict[str, Any]:
    """The keys of a file in a ``frame``, whose directions are the same in space."""

    def turned(vector: list[float]) -> list[float]:
        return list(map(float, frames.frame_axes(frame, DAYS).T @ np.array(vector)))

    def angles(right_ascension: float, declination: float) -> list[float]:
        direction = frames.on_sphere(*np.radians([right_ascension, declination]))
        x, y, z = turned(direction.tolist())
        return [math.atan2(y, x), math.atan2(z, math.hypot(x, y))]

    right_ascension, declination = angles(45.0, 33.0)
    return {
        "name": "Framed",
        "mass": 250,
        "inertia": {"A": 120, "C": 150},
        "state": {"spin": "15 rpm", "nutation": "3 deg"},
        "attitude": {
            "spin_axis": angles(40.0, 30.0),
            "sun_phase": "20 deg",
            "epoch": EPOCH,
            "frame": frame,
        },
        "sun": "epoch",
        "keep": [{"name": "star", "direction": angles(80.0, -10.0), "min": "20 deg"}],
        "goal": {"right_ascension": right_ascension, "declination": declination},
        "orbit": {"position": turned([7e6, 1e6, -2e6]), "velocity": turned([-1e3, 7e3, 5e2])},
        "thrusters": [
            {
                "name": "T1",
                "position": [0, 0.5, 0.8],
                "direction": [1, 0, 0],
                "force": 2,
                "isp": 220,
            },
            {
                "name": "T2",
                "position": [0, -0.5, 0.8],
                "direction": [1, 0, 0],
                "force": 2,
                "isp": 220,
            },
        ],
    }


def framed(frame: str) -> nutdamp.Plan:
    return nutdamp.plan(nutdamp.load(mission(frame)), "half-cone")


@pytest.fixture(scope="module")
def plain() -> nutdamp.Plan:
    return framed("J2000")


@pytest.mark.parametrize("frame", OTHER)
def test_the_frame_of_a_file_moves_nothing(plain: nutdamp.Plan, frame: str) -> None:
    plan = framed(frame)
    assert len(plan.pulses) == len(plain.pulses) > 2
    for pulse, other in zip(plan.pulses, plain.pulses, strict=True):
        assert pulse.channel == other.channel
        times = (other.t, other.on_time)
        assert (pulse.t, pulse.on_time) == pytest.approx(times, abs=SOLID)
    assert plan.propellant == pytest.approx(plain.propellant, rel=SOLID)
    for aspect, same in zip(plan._aspects, plain._aspects, strict=True):
        assert (aspect.least, aspect.largest) == pytest.approx((same.least, same.largest))


@pytest.mark.parametrize("frame", OTHER)
def test_directions_are_shown_in_the_frame_of_the_file(frame: str) -> None:
    plan = framed(frame)
    names = ("right_ascension_deg", "declination_deg")
    if frame.startswith("ECLIP"):
        names = ("longitude_deg", "latitude_deg")
    goal = [math.degrees(angle) for angle in mission(frame)["goal"].values()]
    end = plan_json(plan)["final"]["axis"]
    assert [end[name] for name in names] == pytest.approx(goal, abs=1e-6)
    track = simulation_json(nutdamp.simulate(plan))["axis_track"]
    assert (track["frame"], [*names]) == (frame, [*track][-2:])


WRITTEN = re.compile(r"(?m)^(CREATION_DATE|MESSAGE_ID|COMMENT).*\n")
NUMBER = re.compile(r"(?<![\w.:-])[-+]?\d+\.\d+(?:[eE][-+]?\d+)?(?![\w:-])")


@pytest.mark.parametrize("form", ["apm", "aem", "aem-spin", "opm", "stk"])
@pytest.mark.parametrize("frame", ["ECLIPJ2000", "ECLIPDATE", "MOD"])
def test_exports_are_those_of_eme2000(
    plain: nutdamp.Plan, tmp_path: Path, frame: str, form: str
) -> None:
    texts = []
    for name, plan in (("one", framed(frame)), ("two", plain)):
        nutdamp.export(plan, form, tmp_path / name)
        text = WRITTEN.sub("", (tmp_path / name).read_text())
        texts.append(text.replace("= J2000", "= EME2000"))
    one, two = ([*map(float, NUMBER.findall(text))] for text in texts)
    assert len(two) > 10
    # on-times and starts are written to nanoseconds, and rows follow them
    assert one == pytest.approx(two, rel=1e-7, abs=1e-7)
    assert NUMBER.sub("", texts[0]) == NUMBER.sub("", texts[1])


def test_what_is_merged_stays_in_the_frame(tmp_path: Path) -> None:
    plan = framed("ECLIPDATE")
    nutdamp.export(framed("J2000"), "apm", tmp_path / "a.apm")
    source = source_of(mission("ECLIPDATE"))
    merged, _, _ = merge(source, read_message(str(tmp_path / "a.apm")), inertia=False)
    after = Source(merged, "f.yaml").read()
    assert present(after.attitude).frame == "ECLIPDATE"
    assert turn(after) == pytest.approx(turn(plan.spacecraft), abs=SOLID)


@pytest.mark.parametrize("frame", OTHER)
def test_a_file_carried_on_is_in_the_frame_of_its_date(frame: str) -> None:
    """The axes of date turn by 0.96 arcsec in a week."""
    plan = nutdamp.plan(nutdamp.load(mission(frame)), "none")
    time = 7.0 * 86400.0
    after = plan.carried(time)
    assert present(after.attitude).frame == frame
    state = SpinState.of(*(part[0] for part in plan._reaching(time).motion(np.array([time]))))
    end = replace(present(plan.spacecraft.attitude), quaternion=state.quaternion)
    expected = end.axes @ attitude.matrix(end.quaternion)
    seen = present(after.attitude).axes @ attitude.matrix(after.initial.quaternion)
    assert seen == pytest.approx(expected, abs=1e-10)  # numbers of the file have 12 digits


def turn(spacecraft: nutdamp.Spacecraft) -> np.ndarray:
    return attitude.matrix(spacecraft.initial.quaternion)


def test_a_history_of_eme2000_is_telemetry_in_the_frame_of_the_file(tmp_path: Path) -> None:
    plan = framed("ECLIPDATE")
    nutdamp.export(plan, "aem", tmp_path / "a.aem", until=20.0)
    record = record_of(read_message(str(tmp_path / "a.aem")), plan.spacecraft, Schedule())
    axis = np.array([record.signals[f"axis_{name}"][0] for name in "xyz"])
    assert attitude.angle_between(axis, plan.spacecraft.axis) < SOLID


@pytest.mark.parametrize(
    ("text", "expected"),
    [("18h 12m 33s", "30 deg"), ("2 h", "30 deg"), ("60 arcmin", "1800 arcmin"), ("1 rad", None)],
)
def test_an_angle_is_written_in_the_unit_of_the_file(text: str, expected: str | None) -> None:
    (node,) = (child for _, child in read_tree(f"phase: {text}", "f.yaml")[0].children())
    value = math.radians(30.0)
    assert as_before(node, value, "angle") == (expected or f"{value:.12g} rad")
