"""Velocity changes as manoeuvres of an orbit parameter message: against quadrature on the reference integrator."""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from support import messages, orekit, reference
from support.builders import events

from nutdamp import planning
from nutdamp.errors import BadRequest
from nutdamp.files.exchange import export_text, lacking
from nutdamp.files.settings import parse_setting
from nutdamp.files.spacecraft_file import load_spacecraft, read_spacecraft
from nutdamp.planning import Plan
from nutdamp.schedule import Pulse
from nutdamp.spacecraft import Vector

pytestmark = pytest.mark.usefixtures("plans_shared")

ORBIT = "orbit={position: [7000 km, -12 km, 3.5 km], velocity: [0.1 km/s, 7400, 120 m/s], center: earth}"
NAMES = ("ace", "communications-spinner", "couples-minisat")
CASES = pytest.mark.parametrize("name", NAMES)
NOTATIONS = pytest.mark.parametrize("xml", [False, True], ids=["kvn", "xml"])
DATED = """
name: {name}
mass: 250 kg
inertia: {{A: 120, C: 80}}
state: {{spin: 30 rpm, nutation: 5 deg, phase: 40 deg}}
attitude: {{epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [0.3, -0.2, 0.9, 0.1]}}
thrusters:
  - {{name: T1, {first}}}
  - {{name: T2, position: [0.8, 0, 0.3], direction: [0, -1, 0.2], force: 9 N, isp: 220 s, max_on_time: 2 s}}
"""


@cache
def planned(name: str, orbit: bool) -> Plan:
    settings = [parse_setting(ORBIT)] if orbit else []
    body = load_spacecraft(messages.CONFIGS / f"{name}.yaml", settings)
    plan = planning.plan(body, "four-pulse")
    assert plan.feasible
    return plan


def by_quadrature(plan: Plan, pulse: Pulse) -> Vector:
    """∫ R F dt / m of one pulse, m/s, by Simpson on attitudes of the reference integrator."""
    body = plan.spacecraft
    assert pulse.force is not None
    assert body.mass is not None
    start = messages.columns(body, body.initial.quaternion) @ body.inertia.axes
    times = np.linspace(pulse.start, pulse.end, 33)
    pushes = []
    for time in times:
        moved = reference.fly(body.inertia.moments, body.omega0, events(plan.pulses), float(time), start)
        pushes.append(moved.rotation @ pulse.force)
    weights = np.array([1, *[4, 2] * 15, 4, 1]) * pulse.on_time / 96.0
    return np.asarray(weights @ np.array(pushes) / body.mass)


def manoeuvres(text: str) -> list[dict[str, str]]:
    """Keywords and values of each manoeuvre of a message in KVN."""
    parts = text.split("COMMENT pulse ")[1:]
    return [dict(re.findall(r"^(MAN_\w+) += (\S+)", part, re.MULTILINE)) for part in parts]


@pytest.mark.deep
@CASES
def test_velocity_changes_are_those_of_each_pulse(name: str) -> None:
    plan = planned(name, orbit=True)
    found = manoeuvres(export_text(plan, "opm"))
    assert len(found) == len(plan.pulses) > 1
    total = np.zeros(3)
    for one, pulse in zip(found, plan.pulses, strict=True):
        velocity = 1e3 * np.array([float(one[f"MAN_DV_{axis}"]) for axis in (1, 2, 3)])
        assert velocity == pytest.approx(by_quadrature(plan, pulse), rel=1e-7, abs=1e-12)
        assert float(one["MAN_DURATION"]) == pytest.approx(pulse.on_time, rel=1e-15)
        assert pulse.propellant is not None
        assert float(one["MAN_DELTA_MASS"]) == pytest.approx(-pulse.propellant, rel=1e-15)
        total += velocity
    assert plan.delta_v is not None
    assert total == pytest.approx(plan.delta_v, rel=1e-9, abs=1e-15)


def test_without_an_orbit_only_the_manoeuvres_are_written() -> None:
    whole, part = (export_text(planned("ace", orbit), "opm") for orbit in (True, False))
    assert lacking(planned("ace", orbit=True), "opm") is None
    assert "no whole message" in (lacking(planned("ace", orbit=False), "opm") or "")
    keywords = [re.findall(r"^(\w+) +=", text, re.MULTILINE) for text in (whole, part)]
    state = ["EPOCH", "X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT"]
    assert [word for word in keywords[0] if word not in (*state, "CENTER_NAME")] == keywords[1]
    head = ["CREATION_DATE", "ORIGINATOR", "MESSAGE_ID", "OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME"]
    assert keywords[0][:17] == ["CCSDS_OPM_VERS", *head, "TIME_SYSTEM", *state, "MASS"]
    assert manoeuvres(whole) == manoeuvres(part)
    assert "COMMENT Only the part with the manoeuvres: the spacecraft file has no orbit." in part
    assert "COMMENT Only" not in whole
    assert "<stateVector>" not in export_text(planned("ace", orbit=False), "opm", xml=True)


@pytest.mark.parametrize(
    ("first", "setting", "said"),
    [
        ("torque: [8, 0, 0], isp: 220 s, lever_arm: 1 m", None, r"velocity change by pulse 1 \(T1\) is not known"),
        ("position: [0, 0.3, 0.8], direction: [0, -1, 0], force: 9 N", None, "propellant of pulse 1 .T1. is not known"),
        ("position: [0, 0.3, 0.8], direction: [0, -1, 0], force: 9 N", "mass=", "add the key mass"),
    ],
)
def test_what_is_not_known_is_named(first: str, setting: str | None, said: str) -> None:
    text = DATED.format(name="Dated", first=first)
    body = read_spacecraft(text.replace("mass: 250 kg\n", "") if setting else text, "f.yaml")
    with pytest.raises(BadRequest, match=said):
        export_text(planning.plan(body, "one-pulse"), "opm")


@pytest.mark.orekit
@CASES
@NOTATIONS
def test_orekit_reads_it_back(name: str, xml: bool) -> None:
    orekit.start_or_skip()
    plan = planned(name, orbit=True)
    read = orekit.parse("opm", export_text(plan, "opm", xml=xml))
    data = read.getSegments().get(0).getData()
    frame = str(read.getSegments().get(0).getMetadata().getReferenceFrame().getName())
    assert plan.spacecraft.attitude is not None
    assert frame == plan.spacecraft.attitude.frame
    coordinates = data.getStateVectorBlock().toTimeStampedPVCoordinates()
    assert orekit.components(coordinates.getPosition()) == pytest.approx([7e6, -12e3, 3.5e3], rel=1e-15)
    assert orekit.components(coordinates.getVelocity()) == pytest.approx([100.0, 7400.0, 120.0], rel=1e-15)
    assert data.getMass() == plan.spacecraft.mass
    found = list(data.getManeuvers())
    assert len(found) == len(plan.pulses)
    epoch = data.getStateVectorBlock().getEpoch()
    for one, pulse in zip(found, plan.pulses, strict=True):
        assert one.getEpochIgnition().durationFrom(epoch) == pytest.approx(pulse.start, abs=0.51e-9)
        assert one.getDuration() == pytest.approx(pulse.on_time, rel=1e-15)
        assert orekit.components(one.getDV()) == pytest.approx(by_quadrature(plan, pulse), rel=1e-7, abs=1e-12)
        assert str(one.getReferenceFrame().getName()) == plan.spacecraft.attitude.frame
        assert one.getDeltaMass() == pytest.approx(-(pulse.propellant or 0.0), rel=1e-15)


@pytest.mark.orekit
@NOTATIONS
def test_the_second_reader_finds_its_form_right(xml: bool) -> None:
    try:
        reader: Any = import_module("ccsds_ndm")
    except ImportError as reason:
        pytest.skip(f"NOT CHECKED against ccsds-ndm-py: pip install 'nutdamp[interop]' ({reason})")
    message = reader.Opm.from_str(export_text(planned("ace", orbit=True), "opm", xml=xml), "xml" if xml else "kvn")
    message.validate()
    assert len(message.segment.data.maneuver_parameters) == len(planned("ace", orbit=True).pulses)
