"""Messages read back by Orekit and ccsds-ndm-py, and where the Sun is seen."""

import math
import re
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import histories, messages
from support.builders import present
from support.contract import PUSHED, pushing, valved, velocity_change

from nutdamp.common.time import Epoch
from nutdamp.files.ccsds.read import read_message
from nutdamp.flight import propagation
from nutdamp.physics import attitude, sky
from nutdamp.views.exchange import export_text

pytestmark = [pytest.mark.orekit, pytest.mark.usefixtures("plans_shared")]

NOTATIONS = pytest.mark.parametrize("xml", [False, True], ids=["kvn", "xml"])
CASES = pytest.mark.parametrize("case", messages.CASES)

WITHOUT_RATES = 2e-3
"""deg; the same where a reader has directions alone to go by."""

MID_ARC = 1e-5
"""deg; how far an interpolated attitude may be off: 0.01 is promised, some 1e-7 is found."""

ROUNDED = 4e-12
"""rad; rounding of the angles in a message, as an interpolated rate has it over the step."""


@pytest.fixture
def _orekit() -> None:
    messages.start_or_skip()


@pytest.fixture
def reader() -> Any:
    try:
        return import_module("ccsds_ndm")
    except ImportError as reason:
        pytest.skip(f"NOT CHECKED against ccsds-ndm-py: pip install 'nutdamp[interop]' ({reason})")


def data_of(form: str, text: str) -> Any:
    """The data of a message of one segment as Orekit reads it."""
    return messages.parse(form, text).getSegments().get(0).getData()


@pytest.mark.usefixtures("_orekit")
@CASES
@NOTATIONS
def test_parameters(case: str, xml: bool) -> None:
    plan = messages.planned(case)
    body = plan.spacecraft
    data = data_of("apm", export_text(plan, "apm", xml=xml))
    state = data.getAttitude(None, None)
    frame = (present(body.attitude).frame or "").replace("J2000", "EME2000")
    assert str(state.getReferenceFrame().getName()).replace("J2000", "EME2000") == frame.replace(
        "J2000", "EME2000"
    )
    rates = messages.in_file_axes(body, body.initial.rates)
    assert messages.components(state.getSpin()) == pytest.approx(rates, rel=1e-12, abs=1e-14)
    axes = messages.columns(body, body.initial.quaternion)
    assert messages.body_axes(state.getRotation()) == pytest.approx(axes, abs=1e-14)
    # Orekit hands on the products as they stand in the message; by annex F6 the matrix has minus
    # them.
    matrix = np.array(data.getInertiaBlock().getInertiaMatrix().getData())
    assert matrix * (2.0 * np.eye(3) - 1.0) == pytest.approx(body.inertia.tensor, rel=1e-15)
    written = list(data.getManeuvers())
    assert len(written) == len(plan.pulses) > 0
    for manoeuvre, pulse in zip(written, plan.pulses, strict=True):
        assert manoeuvre.getEpochStart().durationFrom(data.getEpoch()) == pytest.approx(
            pulse.start, abs=0.51e-9
        )
        assert manoeuvre.getDuration() == pytest.approx(pulse.on_time, rel=1e-15)
        torque = messages.in_file_axes(body, present(pulse.torque))
        assert messages.components(manoeuvre.getTorque()) == pytest.approx(
            torque, rel=1e-14, abs=1e-14
        )
        if pulse.propellant is not None:
            assert manoeuvre.getDeltaMass() == pytest.approx(-pulse.propellant, rel=1e-15)


@pytest.mark.usefixtures("_orekit")
@CASES
@NOTATIONS
def test_spin_and_nutation_alone_give_the_motion(case: str, xml: bool) -> None:
    body = messages.spacecraft(case)
    text = export_text(messages.planned(case), "apm", xml=xml)
    spin = data_of("apm", text).getSpinStabilizedBlock()
    if not body.inertia.symmetric:
        assert spin is None
        assert not re.search("<spin>|SPIN_START", text)
        return
    A, C = body.inertia.A, body.inertia.C
    omega1, omega2, omega3 = body.omega0
    momentum = np.array([A * omega1, A * omega2, C * omega3])
    size = np.linalg.norm(momentum)
    assert spin.getNutation() == pytest.approx(math.acos(momentum[2] / size), abs=1e-8)
    assert spin.getNutation() == pytest.approx(
        body.nutation if omega3 > 0 else math.pi - body.nutation, rel=1e-14
    )
    assert spin.getNutationPeriod() == pytest.approx(2 * math.pi * A / size, rel=1e-14)
    side = math.sin(spin.getNutation())
    phase = spin.getNutationPhase()
    assert side * np.array([math.cos(phase), -math.sin(phase)]) * size == pytest.approx(
        momentum[:2], rel=1e-12
    )
    # φ̇ about H and ψ̇ about the third axis make up the rates.
    assert size / A * math.cos(spin.getNutation()) + spin.getSpinAngleVel() == pytest.approx(
        omega3, rel=1e-14
    )
    for block in (
        "<quaternionState>.*?</quaternionState>",
        "<angularVelocity>.*?</angularVelocity>",
    ):
        text = re.sub(block, "", text, flags=re.DOTALL)
    text = re.sub(r"(QUAT|ANGVEL)_START.*?\1_STOP", "", text, flags=re.DOTALL)
    state = data_of("apm", text).getAttitude(None, None)
    assert messages.components(state.getSpin()) == pytest.approx(
        body.initial.rates, rel=1e-10, abs=1e-12
    )
    expected = messages.columns(body, body.initial.quaternion)
    assert messages.turned(messages.body_axes(state.getRotation()), expected) == pytest.approx(
        0.0, abs=1e-10
    )


@pytest.mark.usefixtures("_orekit")
def test_epochs_pass_a_leap_second() -> None:
    plan = messages.planned("single-thruster")
    data = data_of("apm", export_text(plan, "apm"))
    begins = messages.date("2016-12-31T23:59:50.000")
    assert data.getEpoch().durationFrom(begins) == 0.0
    first = next(iter(data.getManeuvers())).getEpochStart()
    assert first.durationFrom(begins) == pytest.approx(next(iter(plan.pulses)).start, abs=1e-9)
    assert plan.pulses.end > 11.0
    assert re.search("STOP_TIME += 2017-01-01T", export_text(plan, "aem"))


def ephemeris(case: str, xml: bool, form: str = "aem") -> tuple[propagation.Flight, Any, list[Any]]:
    """The flight, the epoch, and the segments of a history."""
    plan = messages.planned(case)
    epoch = data_of("apm", export_text(plan, "apm")).getEpoch()
    read = messages.parse("aem", export_text(plan, form, xml=xml))
    until = plan.pulses.end + plan.spacecraft.inertial_period
    return propagation.flown(plan.spacecraft, plan.pulses, until), epoch, list(read.getSegments())


def motion(flown: propagation.Flight, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Rates and columns of axes at ``t`` s, in the axes of the file."""
    leg = next(leg for leg in flown.legs if leg.start <= t <= leg.end and leg.end > leg.start)
    rates, quaternion = leg.path.motion(np.array([t]))
    body = flown.spacecraft
    return messages.in_file_axes(body, rates[0]), messages.columns(body, quaternion[0])


@pytest.mark.usefixtures("_orekit")
@CASES
@NOTATIONS
@pytest.mark.parametrize("form", ["aem", "aem-spin"])
def test_attitude_history(case: str, xml: bool, form: str) -> None:
    """Attitude and rates that come back are those flown, whether as quaternions or as spin,
    nutation and momentum.

    The spin alone, of bodies that are not symmetric, has no transverse rates.
    """
    alone = form == "aem-spin" and not messages.spacecraft(case).inertia.symmetric
    flown, epoch, segments = ephemeris(case, xml, form)
    frames = messages.java("org.orekit.frames.FramesFactory")
    frame = (
        frames.getGCRF()
        if present(flown.spacecraft.attitude).frame == "GCRF"
        else frames.getEME2000()
    )
    worst_turn = worst_rate = 0.0
    for segment in segments:
        provider = segment.getAttitudeProvider()
        given = list(segment.getAngularCoordinates())
        times = [float(record.getDate().durationFrom(epoch)) for record in given]
        records = zip(times, given, strict=True)
        seen = [
            (t, math.inf, record.getRotation(), record.getRotationRate()) for t, record in records
        ]
        for one, two in pairwise(times):
            t = 0.5 * (one + two)
            between = provider.getAttitude(None, epoch.shiftedBy(t), frame)
            seen.append((t, two - one, between.getRotation(), between.getSpin()))
        for t, step, rotation, spin in seen:
            rates, axes = motion(flown, min(max(t, 0.0), flown.legs[-1].end))
            worst_turn = max(worst_turn, messages.turned(messages.body_axes(rotation), axes))
            off = (
                0.0
                if alone
                else float(np.linalg.norm(messages.components(spin) - rates)) - ROUNDED / step
            )
            worst_rate = max(worst_rate, off / float(np.linalg.norm(rates)))
    assert worst_turn <= (WITHOUT_RATES if alone else MID_ARC)
    assert worst_rate <= 1e-6


@pytest.mark.usefixtures("_orekit")
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
        torques = (
            p.torque for p in flown.schedule if p.torque is not None and p.start < middle < p.end
        )
        given = messages.in_file_axes(flown.spacecraft, sum(torques, np.zeros(3)))
        assert requested == pytest.approx(
            given, abs=1e-5 * max(float(np.linalg.norm(tensor @ now)), 1.0)
        )
        assert len(list(segment.getAngularCoordinates())) >= 4


@pytest.mark.usefixtures("_orekit")
def test_orekit_turns_as_the_standard_does() -> None:
    """The quaternion of annex F2.2 leads x of frame B to (0, 1, 0) of frame A."""
    half = math.sqrt(0.5)
    text = export_text(messages.planned("prolate"), "apm")
    for keyword, value in (("Q1", 0.0), ("Q2", 0.0), ("Q3", half), ("QC", half)):
        text = re.sub(rf"{keyword}( +)= .*", f"{keyword} = {value}", text)
    axes = messages.body_axes(data_of("apm", text).getAttitude(None, None).getRotation())
    assert axes == pytest.approx(attitude.matrix(np.array([half, 0.0, 0.0, half])), abs=1e-12)
    assert axes[:, 0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)


@pytest.mark.usefixtures("_orekit")
@pytest.mark.parametrize("name", PUSHED)
@NOTATIONS
def test_orbit_messages(name: str, xml: bool) -> None:
    plan = pushing(name)
    (segment,) = messages.parse("opm", export_text(plan, "opm", xml=xml)).getSegments()
    data = segment.getData()
    assert (
        str(segment.getMetadata().getReferenceFrame().getName())
        == present(plan.spacecraft.attitude).frame
    )
    state = data.getStateVectorBlock()
    coordinates = state.toTimeStampedPVCoordinates()
    assert messages.components(coordinates.getPosition()) == pytest.approx(
        [7e6, -12e3, 3.5e3], rel=1e-15
    )
    assert messages.components(coordinates.getVelocity()) == pytest.approx(
        [100.0, 7400.0, 120.0], rel=1e-15
    )
    assert data.getMass() == plan.spacecraft.mass
    for manoeuvre, pulse in zip(data.getManeuvers(), plan.pulses, strict=True):
        ignition = manoeuvre.getEpochIgnition().durationFrom(state.getEpoch())
        assert ignition == pytest.approx(pulse.start, abs=0.51e-9)
        assert manoeuvre.getDuration() == pytest.approx(pulse.on_time, rel=1e-15)
        change = velocity_change(plan, pulse)
        assert messages.components(manoeuvre.getDV()) == pytest.approx(change, rel=1e-7, abs=1e-12)
        assert (
            str(manoeuvre.getReferenceFrame().getName()) == present(plan.spacecraft.attitude).frame
        )
        assert manoeuvre.getDeltaMass() == pytest.approx(-(pulse.propellant or 0.0), rel=1e-15)


@pytest.mark.usefixtures("_orekit")
@NOTATIONS
def test_pulses_through_valves(xml: bool) -> None:
    plan = valved()
    for form in ("apm", "opm"):
        written = list(data_of(form, export_text(plan, form, xml=xml)).getManeuvers())
        durations = [manoeuvre.getDuration() for manoeuvre in written]
        assert durations == pytest.approx([pulse.on_time for pulse in plan.pulses], rel=1e-15)
        assert all(
            "Commanded" in " ".join(map(str, manoeuvre.getComments())) for manoeuvre in written
        )


@CASES
@pytest.mark.parametrize("notation", ["kvn", "xml"])
def test_the_second_reader(reader: Any, case: str, notation: str) -> None:
    plan = messages.planned(case)

    def parsed(kind: str, form: str) -> Any:
        message = getattr(reader, kind).from_str(
            export_text(plan, form, xml=notation == "xml"), notation
        )
        message.validate()
        return message

    data = parsed("Apm", "apm").segment.data
    (block, *_), tensor = data.inertia, plan.spacecraft.inertia.tensor
    assert [block.ixx, block.iyy, block.izz] == pytest.approx(np.diag(tensor).tolist(), rel=1e-15)
    assert [block.ixy, block.ixz, block.iyz] == pytest.approx(
        [-tensor[0, 1], -tensor[0, 2], -tensor[1, 2]], rel=1e-15
    )
    durations = [manoeuvre.man_duration for manoeuvre in data.maneuver_parameters]
    assert durations == pytest.approx([pulse.on_time for pulse in plan.pulses], rel=1e-15)
    for form in ("aem", "aem-spin"):
        text = export_text(plan, form)
        segments = parsed("Aem", form).segments
        assert len(segments) == text.count("META_START")
        rows = len(re.findall(r"^[0-9]{4}-\S+ ", text, re.MULTILINE))
        assert sum(len(segment.data.attitude_states) for segment in segments) == rows


@pytest.mark.parametrize("notation", ["kvn", "xml"])
def test_the_second_reader_of_orbit_messages(reader: Any, notation: str) -> None:
    plan = pushing("ace")
    message = reader.Opm.from_str(export_text(plan, "opm", xml=notation == "xml"), notation)
    message.validate()
    assert len(message.segment.data.maneuver_parameters) == len(plan.pulses)


READ = (*histories.KINDS, "ACM")


@pytest.mark.usefixtures("_orekit")
@pytest.mark.parametrize("kind", READ)
def test_histories_that_are_read(kind: str, tmp_path: Path) -> None:
    """Attitudes and rates of every record are those that Orekit reads."""
    text = histories.history(kind, histories.flown(9))
    (tmp_path / "history.txt").write_text(text)
    contents = read_message(str(tmp_path / "history.txt"))
    segments = list(messages.parse("acm" if kind == "ACM" else "aem", text).getSegments())
    if kind == "ACM":
        data = segments[0].getData()
        records = list(data.getAttitudeBlocks().get(0).getAttitudeStates())
        seen = [(state.getDate(), state.toAngular(None)) for state in records]
        physical = data.getPhysicBlock()
        assert physical.getWetMass() == contents.mass
        matrix = np.array(physical.getInertiaMatrix().getData())
        assert matrix * (2.0 * np.eye(3) - 1.0) == pytest.approx(present(contents.tensor))
    else:
        parts = [list(segment.getAngularCoordinates()) for segment in segments]
        seen = [(record.getDate(), record) for record in [*parts[0], *parts[1][1:]]]
    assert len(seen) == len(contents.times)
    start = messages.date(contents.epoch.text)
    for index, (date, record) in enumerate(seen):
        assert date.durationFrom(start) == pytest.approx(contents.times[index], abs=1e-9)
        axes = attitude.matrix(contents.quaternions[index])
        assert messages.turned(messages.body_axes(record.getRotation()), axes) < 1e-9
        if kind in histories.RATED:
            rate = messages.components(record.getRotationRate())
            if kind == "QUATERNION/ANGVEL":  # in J2000, which Orekit hands on as they stand
                rate = axes.T @ rate
            assert rate == pytest.approx(contents.rates[index], abs=1e-10)


@pytest.mark.parametrize("kind", READ)
def test_the_second_reader_of_histories(reader: Any, kind: str, tmp_path: Path) -> None:
    text = histories.history(kind, histories.flown(9))
    (tmp_path / "history.txt").write_text(text)
    contents = read_message(str(tmp_path / "history.txt"))
    if kind == "ACM":
        data = reader.Acm.from_str(text, "kvn").segment.data
        rows = np.array(data.att[0].att_lines)
        assert rows[:, 0] == pytest.approx(contents.times)
        assert rows[:, [4, 1, 2, 3]] == pytest.approx(contents.quaternions)
        assert np.radians(rows[:, 5:]) == pytest.approx(contents.rates)
        assert data.phys.wet_mass == contents.mass
        assert -data.phys.ixz == present(contents.tensor)[0, 2]
        return
    message = reader.Aem.from_str(text, "kvn")
    message.validate()
    states = [state for segment in message.segments for state in segment.data.attitude_states]
    assert len(states) == len(contents.times) + 1  # of two segments that share a record


@pytest.mark.orekit
@pytest.mark.parametrize(
    "text", ["1998-01-07T02:28:44", "2026-03-20T12:00:00", "2026-09-11T06:30:00"]
)
def test_orekit_sees_it_there(text: str) -> None:
    """Its analytical Sun errs by up to 0.1 deg itself: a check of frame and time."""
    messages.start_or_skip()
    provider = messages.java("org.orekit.bodies.AnalyticalSolarPositionProvider")()
    frame = messages.java("org.orekit.frames.FramesFactory").getEME2000()
    seen = messages.components(provider.getPosition(messages.date(text), frame))
    expected = sky.sun_direction(Epoch.parse(f"{text}Z").days_of_j2000)
    assert math.degrees(attitude.angle_between(seen, expected)) < 0.1
