"""Messages of pulses through valves: thrust in the keywords, what is commanded for it in comments."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support import orekit

from nutdamp import planning
from nutdamp.files.ccsds.apm_reader import read_apm
from nutdamp.files.exchange import export_text
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.planning import Plan

pytestmark = pytest.mark.usefixtures("plans_shared")

VALVE = ", valve: {open_delay: 15 ms, close_delay: 8 ms}"
FILE = """
name: Valved
object_id: 2026-031A
mass: 250 kg
inertia: {A: 120 kg m^2, C: 80 kg m^2}
state: {spin: 30 rpm, nutation: 5 deg}
attitude: {epoch: 2026-03-01T12:00:00Z, frame: EME2000, quaternion: [1, 0, 0, 0]}
orbit: {position: [7000 km, -12 km, 3.5 km], velocity: [0.1 km/s, 7400, 120 m/s], center: earth}
thrusters:
  - {name: T1, position: [0, 0.5, 0.8], direction: [1, 0, 0], force: 10 N, isp: 220 s, valve}
  - {name: T2, position: [0, -0.5, 0.8], direction: [-1, 0, 0], force: 10 N, isp: 220 s, valve}
"""
NOTATIONS = pytest.mark.parametrize("xml", [False, True], ids=["kvn", "xml"])


def planned(valve: str = VALVE) -> Plan:
    return planning.plan(read_spacecraft(FILE.replace(", valve", valve), "f.yaml"), "four-pulse")


@NOTATIONS
@pytest.mark.parametrize("form", ["apm", "opm"])
def test_comments_say_what_is_commanded_and_that_the_keywords_are_the_thrust(form: str, xml: bool) -> None:
    plan = planned()
    text = export_text(plan, form, xml=xml)
    assert len(plan.pulses) > 1
    epoch = plan.spacecraft.utc
    for pulse in plan.pulses:
        assert pulse.command is not None
        assert pulse.command.on_time == pytest.approx(pulse.on_time + 7e-3)
        utc = (epoch(pulse.command.start) or "").removesuffix("Z")
        assert f"Commanded: {pulse.command.on_time:.9g} s from {utc} on." in text
        assert f"those of the thrust: {pulse.on_time:.9g} s at the torque given." in text
    assert "Commanded" not in export_text(planned(""), form, xml=xml)


def test_they_are_read_back_unharmed(tmp_path: Path) -> None:
    plan = planned()
    path = tmp_path / "valved"
    path.write_text(export_text(plan, "apm"), encoding="utf-8")
    found = read_apm(str(path)).manoeuvres
    assert [one.duration for one in found] == [pulse.on_time for pulse in plan.pulses]
    for one, pulse in zip(found, plan.pulses, strict=True):
        assert pulse.torque is not None
        assert np.allclose(one.torque, plan.spacecraft.inertia.in_file(pulse.torque), rtol=1e-14)


@pytest.mark.orekit
@NOTATIONS
def test_orekit_reads_them_too(xml: bool) -> None:
    orekit.start_or_skip()
    plan = planned()
    apm, opm = (orekit.parse(form, export_text(plan, form, xml=xml)) for form in ("apm", "opm"))
    for read in (apm, opm):
        found = list(read.getSegments().get(0).getData().getManeuvers())
        assert [one.getDuration() for one in found] == pytest.approx(
            [pulse.on_time for pulse in plan.pulses], rel=1e-15
        )
        assert all("Commanded" in " ".join(map(str, one.getComments())) for one in found)
