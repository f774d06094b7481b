"""Messages read back by Orekit, an independent reader: every number that goes in comes out."""

from __future__ import annotations

import math
import re
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from support import messages, orekit

from nutdamp import flight
from nutdamp.errors import BadRequest
from nutdamp.files.exchange import export_text
from nutdamp.flight import Flight
from nutdamp.physics import attitude

pytestmark = [pytest.mark.orekit, pytest.mark.usefixtures("plans_shared")]

NOTATIONS = pytest.mark.parametrize("xml", [False, True], ids=["kvn", "xml"])
CASES = pytest.mark.parametrize("case", messages.CASES)

MID_ARC = 1e-5
"""deg; how far an interpolated attitude may be off: 0.01 is promised, some 1e-7 is found."""

ROUNDED = 4e-12
"""rad; rounding of the angles in a message, which a rate that is interpolated has in it over the step."""


@pytest.fixture(autouse=True)
def _installed() -> None:
    orekit.start_or_skip()


@pytest.fixture(params=[False, True], ids=["kvn", "xml"])
def data(request: pytest.FixtureRequest, case: str) -> Any:
    """The data of the APM of a case as Orekit reads it."""
    text = export_text(messages.planned(case), "apm", xml=request.param)
    return orekit.parse("apm", text).getSegments().get(0).getData()


@CASES
def test_state(case: str, data: Any) -> None:
    body = messages.spacecraft(case)
    found = data.getAttitude(None, None)
    assert body.attitude is not None
    frame = body.attitude.frame or ""
    assert str(found.getReferenceFrame().getName()).replace("J2000", "EME2000") == frame.replace("J2000", "EME2000")
    rates = messages.in_file_axes(body, body.initial.rates)
    assert orekit.components(found.getSpin()) == pytest.approx(rates, rel=1e-12, abs=1e-14)
    expected = messages.columns(body, body.initial.quaternion)
    assert orekit.body_axes(found.getRotation()) == pytest.approx(expected, abs=1e-14)
    # Orekit hands on the products as they stand in the message; by annex F6 the matrix has minus them.
    matrix = np.array(data.getInertiaBlock().getInertiaMatrix().getData())
    assert matrix * (2.0 * np.eye(3) - 1.0) == pytest.approx(body.inertia.tensor, rel=1e-15)


@CASES
def test_spin_and_nutation(case: str, data: Any) -> None:
    body = messages.spacecraft(case)
    spin = data.getSpinStabilizedBlock()
    if not body.inertia.symmetric:
        assert spin is None
        return
    A, C = body.inertia.A, body.inertia.C
    omega1, omega2, omega3 = body.omega0
    momentum = np.array([A * omega1, A * omega2, C * omega3])
    size = np.linalg.norm(momentum)
    assert spin.getNutation() == pytest.approx(math.acos(momentum[2] / size), abs=1e-8)
    assert spin.getNutation() == pytest.approx(body.nutation if omega3 > 0 else math.pi - body.nutation, rel=1e-14)
    assert spin.getNutationPeriod() == pytest.approx(2 * math.pi * A / size, rel=1e-14)
    side, phase = math.sin(spin.getNutation()), spin.getNutationPhase()
    assert side * np.array([math.cos(phase), -math.sin(phase)]) * size == pytest.approx(momentum[:2], rel=1e-12)
    # φ̇ about H and ψ̇ about the third axis make up the rates.
    assert size / A * math.cos(spin.getNutation()) + spin.getSpinAngleVel() == pytest.approx(omega3, rel=1e-14)


@CASES
@NOTATIONS
def test_spin_alone_gives_the_motion(case: str, xml: bool) -> None:
    body = messages.spacecraft(case)
    text = export_text(messages.planned(case), "apm", xml=xml)
    if not body.inertia.symmetric:
        assert "<spin>" not in text
        assert "SPIN_START" not in text
        return
    for block in ("<quaternionState>.*?</quaternionState>", "<angularVelocity>.*?</angularVelocity>"):
        text = re.sub(block, "", text, flags=re.DOTALL)
    text = re.sub(r"(QUAT|ANGVEL)_START.*?\1_STOP", "", text, flags=re.DOTALL)
    found = orekit.parse("apm", text).getSegments().get(0).getData().getAttitude(None, None)
    assert orekit.components(found.getSpin()) == pytest.approx(body.initial.rates, rel=1e-10, abs=1e-12)
    assert messages.turned(
        orekit.body_axes(found.getRotation()), messages.columns(body, body.initial.quaternion)
    ) == pytest.approx(0.0, abs=1e-10)


@CASES
def test_manoeuvres(case: str, data: Any) -> None:
    plan = messages.planned(case)
    found = list(data.getManeuvers())
    assert len(found) == len(plan.pulses) > 0
    for manoeuvre, pulse in zip(found, plan.pulses, strict=True):
        assert manoeuvre.getEpochStart().durationFrom(data.getEpoch()) == pytest.approx(pulse.start, abs=0.51e-9)
        assert manoeuvre.getDuration() == pytest.approx(pulse.on_time, rel=1e-15)
        assert pulse.torque is not None
        torque = messages.in_file_axes(plan.spacecraft, pulse.torque)
        assert orekit.components(manoeuvre.getTorque()) == pytest.approx(torque, rel=1e-14, abs=1e-14)
        if pulse.propellant is not None:
            assert manoeuvre.getDeltaMass() == pytest.approx(-pulse.propellant, rel=1e-15)


def test_epochs_pass_a_leap_second() -> None:
    text = export_text(messages.planned("single-thruster"), "apm")
    data = orekit.parse("apm", text).getSegments().get(0).getData()
    assert data.getEpoch().durationFrom(orekit.date("2016-12-31T23:59:50.000")) == 0.0
    first = next(iter(data.getManeuvers())).getEpochStart()
    late = next(iter(messages.planned("single-thruster").pulses)).start
    assert first.durationFrom(orekit.date("2016-12-31T23:59:50.000")) == pytest.approx(late, abs=1e-9)
    ends = messages.planned("single-thruster").pulses.end
    assert ends > 11.0
    assert re.search("STOP_TIME += 2017-01-01T", export_text(messages.planned("single-thruster"), "aem"))


def ephemeris(case: str, xml: bool, form: str = "aem") -> tuple[Flight, Any, list[Any]]:
    plan = messages.planned(case)
    body = plan.spacecraft
    until = plan.pulses.end + body.inertial_period
    read = orekit.parse("aem", export_text(plan, form, xml=xml))
    assert body.attitude is not None
    epoch = orekit.parse("apm", export_text(plan, "apm")).getSegments().get(0).getData().getEpoch()
    return flight.flown(body, plan.pulses, until), epoch, list(read.getSegments())


def motion(flown: Flight, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Rates and columns of axes at ``t`` s, in the axes of the file."""
    leg = next(leg for leg in flown.legs if leg.start <= t <= leg.end and leg.end > leg.start)
    rates, quaternion = leg.path.motion(np.array([t]))
    body = flown.spacecraft
    return messages.in_file_axes(body, rates[0]), messages.columns(body, quaternion[0])


@CASES
@NOTATIONS
@pytest.mark.parametrize("form", ["aem", "aem-spin"])
def test_attitude_history(case: str, xml: bool, form: str) -> None:
    """Attitude and rates that come back are those flown, whether as quaternions or as spin, nutation and momentum."""
    if form == "aem-spin" and not messages.spacecraft(case).inertia.symmetric:
        with pytest.raises(BadRequest, match="symmetric about the third axis"):
            export_text(messages.planned(case), form, xml=xml)
        return
    flown, epoch, segments = ephemeris(case, xml, form)
    frame = orekit.java("org.orekit.frames.FramesFactory").getEME2000()
    if flown.spacecraft.attitude is not None and flown.spacecraft.attitude.frame == "GCRF":
        frame = orekit.java("org.orekit.frames.FramesFactory").getGCRF()
    worst_turn = worst_rate = 0.0
    for segment in segments:
        provider = segment.getAttitudeProvider()
        given = list(segment.getAngularCoordinates())
        times = [float(record.getDate().durationFrom(epoch)) for record in given]
        records = zip(times, given, strict=True)
        found = [(t, math.inf, record.getRotation(), record.getRotationRate()) for t, record in records]
        for one, two in pairwise(times):
            t = 0.5 * (one + two)
            between = provider.getAttitude(None, epoch.shiftedBy(t), frame)
            found.append((t, two - one, between.getRotation(), between.getSpin()))
        for t, step, rotation, spin in found:
            rates, axes = motion(flown, min(max(t, 0.0), flown.legs[-1].end))
            worst_turn = max(worst_turn, messages.turned(orekit.body_axes(rotation), axes))
            off = float(np.linalg.norm(orekit.components(spin) - rates)) - ROUNDED / step
            worst_rate = max(worst_rate, off / float(np.linalg.norm(rates)))
    assert worst_turn <= MID_ARC
    assert worst_rate <= 1e-6
    print(case, worst_turn, worst_rate)


@CASES
def test_segments_end_at_the_edges_of_pulses(case: str) -> None:
    flown, epoch, segments = ephemeris(case, xml=False)
    inner = (edge for pulse in flown.schedule for edge in (pulse.start, pulse.end) if edge > 1e-9)
    edges = sorted({0.0, flown.legs[-1].end, *inner})
    starts = [float(segment.getStart().durationFrom(epoch)) for segment in segments]
    stops = [float(segment.getStop().durationFrom(epoch)) for segment in segments]
    assert starts == pytest.approx([edge for edge in edges if edge < edges[-1]], abs=0.51e-9)
    assert stops == pytest.approx(edges[1:], abs=0.51e-9)
    # The torque that the rates of each segment ask for is what the pulses give.
    tensor = flown.spacecraft.inertia.tensor
    for segment, start, stop in zip(segments, starts, stops, strict=True):
        middle, step = 0.5 * (start + stop), 1e-3 * (stop - start)
        before, now, after = (motion(flown, middle + shift)[0] for shift in (-step, 0.0, step))
        requested = tensor @ (after - before) / (2 * step) + np.cross(now, tensor @ now)
        given = sum(
            (p.torque for p in flown.schedule if p.torque is not None and p.start < middle < p.end), np.zeros(3)
        )
        scale = max(float(np.linalg.norm(tensor @ now)), 1.0)
        assert requested == pytest.approx(messages.in_file_axes(flown.spacecraft, given), abs=1e-5 * scale)
        assert len(list(segment.getAngularCoordinates())) >= 4


def test_orekit_turns_as_the_standard_does() -> None:
    """The quaternion of annex F2.2 leads x of frame B to (0, 1, 0) of frame A."""
    half = math.sqrt(0.5)
    text = export_text(messages.planned("prolate"), "apm")
    for keyword, value in (("Q1", 0.0), ("Q2", 0.0), ("Q3", half), ("QC", half)):
        text = re.sub(rf"{keyword}( +)= .*", f"{keyword} = {value}", text)
    found = orekit.parse("apm", text).getSegments().get(0).getData().getAttitude(None, None)
    axes = orekit.body_axes(found.getRotation())
    assert axes == pytest.approx(attitude.matrix(np.array([half, 0.0, 0.0, half])), abs=1e-12)
    assert axes[:, 0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
