"""Attitude messages read: APMs in every form that the standard allows, histories of each kind,
merged into files and fitted; what is wrong is reported by line; there and back.
"""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support import histories, messages, reference
from support.builders import present
from support.cases import deep
from support.contract import CASES, Write, check_faults, check_parts, faults, slips
from support.golden import check_text
from support.histories import STEP
from support.places import case
from support.process import Run

import nutdamp
from nutdamp.errors import BadRequest, CannotRead, FaultyFile
from nutdamp.estimation.results import doubts
from nutdamp.files.ccsds.read import MOST_BYTES, Contents, read_message
from nutdamp.files.ccsds.write import contradictions, imported, merge
from nutdamp.files.reader import Source, read_spacecraft
from nutdamp.files.schedules import read_pulses
from nutdamp.flight import propagation
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.model import Limits, Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule
from nutdamp.views.exchange import export_text
from nutdamp.views.parts import pulse_table

pytestmark = pytest.mark.usefixtures("plans_shared")

GOOD = """\
CCSDS_APM_VERS = 2.0
CREATION_DATE = 2026-03-01T00:00:00
ORIGINATOR = TEST
OBJECT_NAME = SPINNER
OBJECT_ID = 2026-031A
TIME_SYSTEM = UTC
COMMENT of t = 0
EPOCH = 2026-03-01T12:00:00.5
QUAT_START
REF_FRAME_A = EME2000
REF_FRAME_B = SC_BODY_1
Q1 = 0.0
Q2 = 0.6
Q3 = 0.0
QC = 0.8
QUAT_STOP
ANGVEL_START
REF_FRAME_A = EME2000
REF_FRAME_B = SC_BODY_1
ANGVEL_FRAME = SC_BODY_1
ANGVEL_X = 8 [deg/s]
ANGVEL_Y = 4 [deg/s]
ANGVEL_Z = 180 [deg/s]
ANGVEL_STOP
INERTIA_START
INERTIA_REF_FRAME = SC_BODY_1
IXX = 120 [kg*m**2]
IYY = 100
IZZ = 80
IXY = 1
IXZ = -2
IYZ = 0
INERTIA_STOP
MAN_START
COMMENT first
MAN_EPOCH_START = 2026-03-01T12:00:02
MAN_DURATION = 0.5 [s]
MAN_REF_FRAME = SC_BODY_1
MAN_TOR_X = 6 [N*m]
MAN_TOR_Y = 0 [N*m]
MAN_TOR_Z = 0 [N*m]
MAN_DELTA_MASS = -0.01 [kg]
MAN_STOP
MAN_START
MAN_EPOCH_START = 2026-03-01T12:00:04
MAN_DURATION = 1
MAN_REF_FRAME = SC_BODY_1
MAN_TOR_X = 0
MAN_TOR_Y = -6
MAN_TOR_Z = 0
MAN_STOP
"""
ENDS = "REF_FRAME_A = EME2000\nREF_FRAME_B = SC_BODY_1\n"
MOMENTUM = "MOMENTUM_ALPHA = 0\nMOMENTUM_DELTA = 70\nNUTATION_VEL = 0.01\n"
SPIN = (
    f"SPIN_START\n{ENDS}SPIN_ALPHA = 0\nSPIN_DELTA = 80\nSPIN_ANGLE = 45\nSPIN_ANGLE_VEL = "
    f"1\n{MOMENTUM}SPIN_STOP\n"
)
"""The example of annex F5.4."""

Read = Callable[[str | bytes], Contents]


@pytest.fixture
def read(write: Write) -> Read:
    """``read(text)``: the contents of a message."""
    return lambda text: read_message(str(write(text, "a.apm")))


def without(*blocks: str) -> str:
    return re.sub(rf"({'|'.join(blocks)})_START.*?\1_STOP\n", "", GOOD, flags=re.DOTALL)


def edited(old: str, new: str, text: str = GOOD) -> str:
    assert old in text
    return text.replace(old, new, 1)


def before(start: str, block: str, text: str = GOOD) -> str:
    return edited(f"{start}_START", f"{block}\n{start}_START", text)


SPIN_ALONE = before("INERTIA", SPIN, without("QUAT", "ANGVEL"))


def test_everything_is_read(read: Read) -> None:
    apm = read(GOOD)
    written = {
        **{"name": "SPINNER", "object_id": "2026-031A", "frame": "EME2000", "remarks": ()},
        "epoch.text": "2026-03-01T12:00:00.500000000",
        "quaternions.0": pytest.approx([0.8, 0.0, 0.6, 0.0]),
        "rates.0": pytest.approx(np.radians([8.0, 4.0, 180.0])),
        "tensor": [[120.0, -1.0, 2.0], [-1.0, 100.0, 0.0], [2.0, 0.0, 80.0]],
        "manoeuvres.0.start": 1.5,
        "manoeuvres.0.duration": 0.5,
        "manoeuvres.0.torque": [6.0, 0.0, 0.0],
        "manoeuvres.0.mass": -0.01,
        "manoeuvres.1.start": 3.5,
        "manoeuvres.1.duration": 1.0,
        "manoeuvres.1.torque": [0.0, -6.0, 0.0],
        "manoeuvres.1.mass": None,
    }
    check_parts(apm, written)
    # Line ends of the standard.
    wrong = faults(read, edited("Q2 = 0.6", "Q2 = x"))
    for ending in ("\r\n", "\r", "\n\r"):
        assert len(read(GOOD.replace("\n", ending)).manoeuvres) == 2
        assert faults(read, edited("Q2 = 0.6", "Q2 = x").replace("\n", ending)) == wrong
    # No attitude, and another name for the axes.
    bare, renamed = (
        read(without("QUAT").replace("EME2000", "ICRF")),
        read(GOOD.replace("EME2000", "ICRF")),
    )
    assert np.isnan(bare.quaternions).all()
    assert renamed.frame == "GCRF"
    # A spin block that says something else.
    spun = read(before("INERTIA", SPIN))
    assert spun.at().rates[0] == pytest.approx(apm.at().rates[0])
    check_text(
        "files.apm-remarks", "\n".join("\n".join(found.remarks) for found in (bare, renamed, spun))
    )


def test_the_spin_of_the_standards_example(read: Read) -> None:
    """Annex F5.4 prints the quaternion and the axis of H to four digits."""
    apm = read(SPIN_ALONE)
    assert apm.at().quaternions[0] == pytest.approx([0.3812, 0.0805, 0.0334, 0.9204], abs=5e-5)
    axes = attitude.matrix(present(apm.at().quaternions[0]))
    assert axes[:, 2] == pytest.approx([0.1736, 0.0, 0.9848], abs=5e-5)
    # 1 deg/s about the third axis and 0.01 deg/s about H make up the rates.
    expected = math.radians(1.0) * axes[:, 2] + math.radians(0.01) * np.array(
        [0.3420201, 0.0, 0.9396926]
    )
    assert axes @ apm.at().rates[0] == pytest.approx(expected, rel=1e-7)
    # The other form of the block says the same: H is 10 deg from the axis, and goes round in 36000
    # s.
    h = axes.T @ np.array([math.cos(math.radians(70.0)), 0.0, math.sin(math.radians(70.0))])
    phase = math.degrees(math.atan2(-h[1], h[0]))
    other = f"NUTATION = 10\nNUTATION_PER = 36000\nNUTATION_PHASE = {phase}\n"
    assert read(edited(MOMENTUM, other, SPIN_ALONE)).at().rates[0] == pytest.approx(
        apm.at().rates[0], rel=1e-12
    )
    assert read(edited(MOMENTUM, "", SPIN_ALONE)).at().rates[0] == pytest.approx(
        [0.0, 0.0, math.radians(1.0)], abs=1e-15
    )


def test_frames_the_other_way_round_and_rates_in_the_inertial_frame(read: Read) -> None:
    """From the body to the frame the quaternion is the inverse, and the rate that of the frame
    against the body.
    """
    turned = GOOD.replace(ENDS, "REF_FRAME_A = SC_BODY_1\nREF_FRAME_B = EME2000\n").replace(
        "Q2 = 0.6", "Q2 = -0.6"
    )
    inertial = edited("ANGVEL_FRAME = SC_BODY_1", "ANGVEL_FRAME = EME2000")
    rates = attitude.matrix(np.array([0.8, 0.0, 0.6, 0.0])) @ np.array([8.0, 4.0, 180.0])
    for axis, rate, seen in zip("XYZ", (8, 4, 180), rates.tolist(), strict=True):
        turned = edited(f"ANGVEL_{axis} = {rate} ", f"ANGVEL_{axis} = -{rate} ", turned)
        inertial = edited(f"ANGVEL_{axis} = {rate} ", f"ANGVEL_{axis} = {seen!r} ", inertial)
    # The same turn by angles about x, the new y and the new z.
    about_y = 2.0 * math.degrees(math.acos(0.8))
    angle = f"EULER_ROT_SEQ = XYZ\nANGLE_1 = 0\nANGLE_2 = {about_y}\nANGLE_3 = 0"
    by_angles = before("ANGVEL", f"EULER_START\n{ENDS}{angle}\nEULER_STOP", without("QUAT"))
    for text in (turned, by_angles):
        assert read(text).at().quaternions[0] == pytest.approx([0.8, 0.0, 0.6, 0.0])
    for text in (turned, inertial, by_angles):
        assert read(text).at().rates[0] == pytest.approx(np.radians([8.0, 4.0, 180.0]), rel=1e-14)


def test_faults(read: Read) -> None:
    check_faults(
        "files.apm",
        lambda edit: read(edited(*edit)),
        (
            *(
                ("EPOCH = 2026-03-01T12:00:00.5\n", edit)
                for edit in ("", "EPOCH = noon\n", "EPOCH =\n")
            ),
            ("TIME_SYSTEM = UTC", "TIME_SYSTEM = UT1"),
            ("OBJECT_ID = 2026-031A\n", ""),
            ("OBJECT_ID = 2026-031A", "OBJECT_IDENT = 2026-031A"),
            ("ORIGINATOR = TEST", "ORIGINATOR = TEST\nORIGINATOR = TEST"),
            ("EPOCH = 2026", "META_START\nMETA_STOP\nEPOCH = 2026"),
            ("Q2 = 0.6\n", ""),
            *(
                ("Q2 = 0.6", f"Q2 = {value}")
                for value in ("0.7", "0,6", "nan", "1e999", "0.6 [deg]")
            ),
            *((f"{ENDS}Q1", f"{ENDS}Q1".replace("EME2000", frame)) for frame in ("TOD", "GCRF")),
            *(
                (f"{ENDS}Q1", f"{ENDS}Q1".replace("SC_BODY_1", frame))
                for frame in ("GCRF", "SC_BODY_2")
            ),
            ("QUAT_STOP\n", ""),
            ("QUAT_STOP", "ANGVEL_STOP"),
            ("QUAT_START\n", ""),
            ("ANGVEL_X = 8 [deg/s]", "ANGVEL_X = 8 [rad/s]"),
            ("ANGVEL_FRAME = SC_BODY_1", "ANGVEL_FRAME = GCRF"),
            *(
                (f"{block}_REF_FRAME = SC_BODY_1", f"{block}_REF_FRAME = EME2000")
                for block in ("INERTIA", "MAN")
            ),
            *(("MAN_DURATION = 0.5 [s]", f"MAN_DURATION = {value} [s]") for value in (-0.5, 0)),
            ("MAN_DELTA_MASS = -0.01", "MAN_DELTA_MASS = 0.01"),
            ("MAN_TOR_X = 6", "MAN_TOR_X = 0"),
            ("MAN_EPOCH_START = 2026-03-01T12:00:02", "MAN_EPOCH_START = 2026-03-01T12:00:00"),
            ("COMMENT first", "torque about axis 1"),
            ("MAN_DELTA_MASS = -0.01 [kg]", "MAN_DELTA_VEL = 1"),
        ),
    )
    (angvel,) = re.findall("ANGVEL_START.*ANGVEL_STOP\n", GOOD, re.DOTALL)
    several = edited("MAN_DURATION = 1", "MAN_DURATION = -1", edited("IZZ = 80", "IZZ = 80 [g]"))
    blocks = {
        "no ANGVEL": without("ANGVEL"),
        "two of ANGVEL": before("INERTIA", angvel),
        "several faults at once": edited("Q2 = 0.6", "Q2 = x", several),
    }
    check_faults("files.apm-blocks", read, blocks)
    nutation = "NUTATION = 1\nNUTATION_PER = 2\nNUTATION_PHASE = 3\n"
    spins = (
        ("MOMENTUM_DELTA = 70\n", ""),
        ("MOMENTUM_ALPHA = 0\n", f"{nutation}MOMENTUM_ALPHA = 0\n"),
        (ENDS, "REF_FRAME_A = SC_BODY_1\nREF_FRAME_B = EME2000\n"),
        (MOMENTUM, nutation.replace("PER = 2", "PER = 0")),
    )
    check_faults("files.apm-spin", lambda edit: read(edited(edit[0], edit[1], SPIN_ALONE)), spins)


XML = ("<?xml version='1.0'?>\n<apm/>", " \n<apm", "<!DOCTYPE apm [<!ENTITY a 'b'>]>")


def test_what_is_no_such_message(read: Read) -> None:
    """Unreadable, another message, XML, too large."""
    others = (
        "",
        "hello\n",
        "CCSDS_AEM_VERS = 2.0\n",
        "CCSDS_APM_VERS = 1.0\nQ_FRAME_A = X\n",
        XML[0],
    )
    check_faults("files.apm-none", read, others)
    for encoding in ("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"):
        for text in XML:
            assert faults(read, text.encode(encoding)) == faults(read, XML[0])
    assert faults(read_message, str(case("crash-xml-encoding.apm.txt"))) == faults(read, XML[0])
    latin = "CCSDS_APM_VERS = 2.0\nORIGINATOR = MÜLLER\n".encode("latin-1")
    wrong = {"zeros": b"\xff\xfe\x00", "UTF-16": GOOD[:21].encode("utf-16"), "Latin-1": latin}
    check_faults("files.apm-encodings", read, wrong)
    for start in ("CCSDS_APM_VERS = 2.0\n", XML[0]):
        with Path("huge.apm").open("wb") as stream:
            stream.write(start.encode())
            stream.truncate(MOST_BYTES + 1)
        assert faults(read_message, "huge.apm") == ["0:0: : too large: more than 16 MiB"]
    with pytest.raises(CannotRead):
        read_message("missing.apm")


# --- spacecraft files from messages: there and back keeps state, inertia and manoeuvres, and plans
# the same schedule


PLANNED_ALIKE = 1e-6
"""Relative difference of two schedules that were trimmed from states
that differ in the last digit.
"""

Taken = tuple[Contents, str, Spacecraft, Schedule]
Take = Callable[[str | planning.Plan], Taken]


@pytest.fixture
def take(write: Write) -> Take:
    """``take(message)``, or that of a plan: what is read, the file it becomes, its spacecraft and
    schedule.
    """

    def take(message: str | planning.Plan) -> Taken:
        contents = read_message(
            str(
                write(message if isinstance(message, str) else export_text(message, "apm"), "a.apm")
            )
        )
        return contents, *imported(contents, "a.apm")

    return take


@CASES
def test_state_inertia_and_manoeuvres_come_back(case: str, take: Take) -> None:
    plan = messages.planned(case)
    body = plan.spacecraft
    apm, text, back, schedule = take(plan)
    same = {
        "omega0": pytest.approx(body.omega0, rel=1e-12, abs=1e-15),
        "inertia.tensor": pytest.approx(body.inertia.tensor, rel=1e-15),
        "object_id": body.object_id,
        "name": body.name.upper(),
        "attitude.frame": present(body.attitude).frame,
    }
    check_parts(back, same)
    mine, theirs = (attitude.matrix(spacecraft.initial.quaternion) for spacecraft in (body, back))
    assert theirs == pytest.approx(mine, abs=1e-13)
    assert "no thruster layout" in text
    for manoeuvre, one, two in zip(apm.manoeuvres, plan.pulses, schedule, strict=True):
        assert manoeuvre.torque == pytest.approx(
            messages.in_file_axes(body, present(one.torque)), rel=1e-14, abs=1e-15
        )
        assert [manoeuvre.start, two.start] == pytest.approx([one.start] * 2, abs=0.51e-9)
        assert [manoeuvre.duration, two.on_time] == pytest.approx([one.on_time] * 2, rel=1e-15)
        assert two.impulse == pytest.approx(one.impulse, rel=1e-12, abs=1e-12)
        assert two.propellant == (one.propellant and pytest.approx(one.propellant, rel=1e-15))
    # The schedule, flown from what came back, leaves what the plan leaves, and is read as a file
    # without warnings.
    flown = propagation.flown(back, schedule)
    left = ("nutation", "momentum_shift")
    expected = {name: pytest.approx(getattr(plan.flown, name), abs=1e-9) for name in left}
    check_parts(flown.residual, expected)
    Path("back.csv").write_text(pulse_table(flown).csv(), encoding="utf-8")
    again, warnings = read_pulses(Path("back.csv"), back)
    assert warnings == []
    assert [pulse.start for pulse in again] == pytest.approx(
        [pulse.start for pulse in schedule], abs=1e-14
    )


@pytest.mark.parametrize("scheme", ["one-pulse", "two-pulse"])
@pytest.mark.parametrize(
    "case",
    ["steerable-stage", "prolate, backwards", "oblate, backwards", deep("oblate"), deep("sphere")],
)
def test_a_steerable_torquer_plans_the_same_again(case: str, scheme: str, take: Take) -> None:
    body = replace(messages.spacecraft(case), limits=Limits(earliest=1.5))
    plan = planning.plan(body, scheme)
    assert plan.feasible
    _, text, back, _ = take(plan)
    assert present(back.steerable).torque == pytest.approx(
        present(present(body.steerable).torque), rel=1e-14
    )
    again = planning.plan(read_spacecraft(text, "back.yaml"), scheme)
    for one, two in zip(plan.pulses, again.pulses, strict=True):
        assert (two.t, two.on_time) == pytest.approx((one.t, one.on_time), rel=PLANNED_ALIKE)
        assert two.impulse == pytest.approx(one.impulse, abs=PLANNED_ALIKE * one.magnitude)


def test_torques_of_several_kinds_are_suggested_as_thrusters(take: Take) -> None:
    plan = planning.plan(messages.spacecraft("tilted tensor, backwards"), "four-pulse")
    _, text, back, _ = take(plan)
    assert back.steerable is None
    assert "    - [120.0 kg m^2, 3.0 kg m^2, 6.0 kg m^2]\n" in text
    taken = read_spacecraft(
        text.replace("# thrusters:", "thrusters:").replace("#   - {", "  - {"), "taken.yaml"
    )
    torques = {
        tuple(np.round(taken.inertia.axes @ channel.torque, 12)) for channel in taken.channels
    }
    fired = [
        messages.in_file_axes(plan.spacecraft, pulse.torque)
        for pulse in plan.pulses
        if pulse.torque is not None
    ]
    assert torques == {tuple(np.round(torque, 12)) for torque in fired}


def test_overlapping_manoeuvres_keep_apart_and_stand_in_the_order_of_their_starts(
    take: Take,
) -> None:
    """A long pulse that begins first may have its centre after a short one."""
    text = export_text(messages.planned("prolate"), "apm")
    first = text.index("MAN_START")
    second = text.rindex("MAN_START")
    _, _, back, schedule = take(text[:second] + text[first:second] + text[second:])
    assert [pulse.channel for pulse in schedule] == ["steerable", "MAN2", "steerable"]
    assert propagation.flown(back, schedule).settled.spin == pytest.approx(math.pi)
    torque = np.array([1.0, 0.0, 0.0])
    pulses = Schedule(
        (
            Pulse(2.0, 2.0, "long", 2.0 * torque, torque),
            Pulse(1.5, 0.2, "short", 0.4 * torque, 2 * torque),
        )
    )
    assert [pulse.channel for pulse in pulses] == ["short", "long"]
    _, _, back, schedule = take(planning.Plan(messages.spacecraft("prolate"), "by hand", pulses))
    assert back.steerable is None  # of two torques there is none
    assert sorted(pulse.start for pulse in schedule) == pytest.approx([1.0, 1.4])


def test_names_are_quoted_and_epochs_written_plainly(take: Take) -> None:
    plan = messages.planned("prolate")
    _, text, back, _ = take(replace(plan, spacecraft=replace(plan.spacecraft, name='No: "1" #x')))
    assert back.name == 'NO: "1" #X'
    assert "  epoch: 2026-03-01T12:00:00Z\n" in text
    assert "epoch: 2026-03-01T12:00:00.25Z" in take(messages.planned("steerable-stage"))[1]


def test_what_no_spacecraft_can_be_points_at_the_block(take: Take) -> None:
    text = export_text(messages.planned("prolate"), "apm")
    edits = (
        ("IZZ               = 80.0", "IZZ               = 800.0"),
        ("IZZ               = 80.0", "IZZ               = -80.0"),
        ("ANGVEL_Z     = 180.0", "ANGVEL_Z     = 0.0"),
    )
    assert all(old in text for old, _ in edits)
    check_faults("files.apm-no-spacecraft", lambda edit: take(text.replace(*edit)), edits)
    with pytest.raises(FaultyFile, match="--into"):
        take(without("INERTIA"))


def test_times_of_another_system_become_utc_and_a_nutation_that_contradicts_is_said(
    take: Take,
) -> None:
    """A period of 720 s is none of this inertia, so that 0.1 deg cannot be."""
    text = case("mms1.apm.txt").read_text(encoding="utf-8")
    moments = []
    for system in ("UTC", "TAI", "TT"):
        apm, _, body, pulses = take(text.replace("= UTC", f"= {system}"))
        moments.append(apm.epoch)
        assert [pulse.start for pulse in pulses] == [3600.0]
        (said,) = contradictions(apm, body, "this one")
        assert said.code == "message-contradicts"
        assert said.values["stated_deg"] == pytest.approx(0.1)
        assert (
            contradictions(apm._replace(nutations=np.array([body.widest.nutation])), body, "") == []
        )
    assert [moments[0].since(moment) for moment in moments[1:]] == [37.0, 37.0 + 32.184]


# --- histories

DISC = """
name: Disc  # as weighed
mass: 25 kg
inertia: {A: 1.6 kg m^2, C: 2.1 kg m^2}
omega0: [0, 1 deg/s, -108 deg/s]
attitude: {quaternion: [1, 0, 0, 0], epoch: 2006-03-31T05:00:00Z, frame: EME2000}
thrusters:
  - {name: P, torque: [0.1, 0, 0], max_on_time: 1 s}
"""

BETWEEN = 2e-3
"""Share of |ω| across the axis by which rates that follow from attitudes 14 deg apart may err."""


def rates_across(motion: reference.Motion) -> float:
    return float(np.hypot(*motion.rates[:2]))


@pytest.mark.parametrize("kind", histories.ALL)
@pytest.mark.parametrize("index", [0, 5, 8])
def test_the_state_of_a_record_is_that_of_the_motion(
    run: Run, tmp_path: Path, kind: str, index: int
) -> None:
    """Against DOP853; rates that a history has not come from its attitudes."""
    motions = histories.flown(17)
    (tmp_path / "history.txt").write_text(histories.history(kind, motions))
    (tmp_path / "disc.yaml").write_text(DISC)
    at = () if index == 0 else ("--at", f"{STEP * index - 0.01}s")
    shown = run("import", "history.txt", "--into", "disc.yaml", *at, "-o", "now.yaml", status=0)
    rated = kind in histories.RATED
    assert ("follow from its attitudes" in shown.stderr) == (not rated)
    assert "name: Disc  # as weighed\nmass: 25 kg\n" in (tmp_path / "now.yaml").read_text()
    now = nutdamp.load(tmp_path / "now.yaml")
    turned = attitude.matrix(present(now.attitude).quaternion)
    assert reference.turned(motions[index].rotation, turned) < 1e-9
    off = float(np.linalg.norm(now.rates - motions[index].rates))
    assert off < (1e-9 if rated else BETWEEN * rates_across(motions[index]))
    assert present(now.attitude).frame == "EME2000"  # J2000 has the same axes
    expected = (histories.START + index * timedelta(seconds=STEP)).isoformat()
    assert present(now.attitude).epoch == f"{expected.rstrip('0')}Z"


@pytest.mark.parametrize(
    "kind", [kind if kind in ("SPIN", "ACM") else deep(kind) for kind in histories.ALL]
)
def test_every_history_is_telemetry(write: Write, kind: str) -> None:
    """C/A of 1.3125 from 25 s of it, though the file says 1.25."""
    motions = histories.flown(200)
    path = write(histories.history(kind, motions), "telemetry.txt")
    guess = nutdamp.read(DISC.replace("2.1 kg", "2.0 kg").replace("05:00:00Z", "05:00:00.071Z"))
    guess = guess.with_(dispersions={"C": {"normal": "5 %"}})
    estimate = nutdamp.fit(path, guess, ignored=print).spacecraft()
    assert pytest.approx(1.3125, abs=2e-5) == estimate.inertia.C / estimate.inertia.A
    assert estimate.omega0 == pytest.approx(motions[0].rates, abs=2e-5)


@pytest.mark.parametrize(
    ("year", "far"), [("2006-03", False), ("2006-01", True), ("2004-03", True)]
)
def test_a_history_months_from_the_file_is_named(
    run: Run, tmp_path: Path, year: str, far: bool
) -> None:
    (tmp_path / "history.txt").write_text(histories.acm(histories.flown(161)))
    dated = DISC.replace("2006-03", year)
    (tmp_path / "disc.yaml").write_text(dated)
    into = ("import", "history.txt", "--into", "disc.yaml", "-o", "now.yaml")
    shown = run(*into, "--at", "0s", status=0).stderr
    assert ("warning[record-far]" in shown) == far
    assert "record used: 0 s after the first, at 2006-03-31T05:00:00.071" in shown
    used = run(*into, "--at", "0.3s", status=0).stderr
    assert "record used: 0.375 s after the first" in used
    assert "12.5s" in run(*into, "--at", "-1s", status=2).stderr
    spacecraft = nutdamp.read(dated).with_(dispersions={"C": {"normal": "5 %"}})
    fitted = nutdamp.fit(tmp_path / "history.txt", spacecraft, ignored=print)
    assert ("record-far" in {note.code for note in doubts(fitted.core)}) == far


def test_physical_properties_are_merged_where_asked_for(run: Run, tmp_path: Path) -> None:
    """Figure G-8 has nothing else: products are minus the entries off the diagonal, and CP is no
    center of mass.
    """
    (tmp_path / "disc.yaml").write_text(DISC)
    (tmp_path / "phys.acm").write_text(
        histories.HEADER.format(kind="ACM") + histories.ACM + histories.PHYSICAL
    )
    into = ("import", "phys.acm", "--into", "disc.yaml", "-o", "now.yaml")
    assert run(*into).returncode == 2
    shown = run(*into, "--inertia", status=0)
    assert "center of pressure" in shown.stderr
    tensor = np.array([[1.62, -0.013, 0.021], [-0.013, 1.58, -0.034], [0.021, -0.034, 2.11]])
    weighed = {"mass": 24.7, "inertia.tensor": pytest.approx(tensor, rel=1e-11)}
    rates = pytest.approx(nutdamp.read(DISC).rates)
    check_parts(nutdamp.load(tmp_path / "now.yaml"), {**weighed, "rates": rates})
    # With a history it makes a file of its own.
    (tmp_path / "whole.acm").write_text(histories.acm(histories.flown(9)))
    run("import", "whole.acm", "-o", "new.yaml", status=0)
    named = {"object_id": "2026-031C", "name": "DISC-3"}
    spun = {"rates": pytest.approx(histories.SPUN, abs=1e-12)}
    check_parts(nutdamp.load(tmp_path / "new.yaml"), {**weighed, **named, **spun})


def test_records_too_far_apart_tell_no_rates(write: Write) -> None:
    """165 deg from one to the next: of a spin the rate about the axis is left, of attitudes
    nothing.
    """
    for kind, rates in (("SPIN", [0.0, 0.0, -110.0]), ("QUATERNION", [0.0, 1.0, -108.0])):
        text = histories.history(kind, histories.flown(33))
        lines = [line for line in text.splitlines() if not line.startswith("2006-")]
        rows = [line for line in text.splitlines() if line.startswith("2006-")][:17:12]
        lines[lines.index("COMMENT filter KF-2") + 1 :] = [*rows, "DATA_STOP"]
        contents = read_message(str(write("\n".join(lines) + "\n", "sparse.aem")))
        merged = nutdamp.read(merge(Source(DISC, "disc.yaml"), contents, inertia=False)[0])
        assert np.degrees(merged.rates) == pytest.approx(rates, abs=0.02)


def test_faults_have_their_line_and_field(write: Write) -> None:
    texts = {kind: histories.history(kind, histories.flown(5)) for kind in histories.ALL}
    edits = (
        ("SPIN", r"(2006-090T05:00:00.196000 \S+ \S+) \S+", r"\1 x"),
        ("SPIN", r"(2006-090T05:00:00.196000 \S+ \S+) \S+", r"\1"),
        ("SPIN", "2006-090T05:00:00.196000", "2006-090T04:00:00"),
        ("SPIN", "SC_BODY_1", "SC_BODY"),
        ("SPIN", r"J2000\nREF_FRAME_B   = SC_BODY_1", r"SC_BODY_1\nREF_FRAME_B   = J2000"),
        ("SPIN", "J2000", "TOD"),
        ("SPIN", "= SPIN", "= SPIN/NUTATION"),
        ("SPIN", "DATA_START", "META_START"),
        ("SPIN/NUTATION", r"(?s)(.*:00.196000(?: \S+){5}) (\S+)", r"\1 -\2"),
        ("EULER_ANGLE", "EULER_ROT_SEQ = ZXZ\n", ""),
        ("EULER_ANGLE", "= ZXZ", "= ZZX"),
        ("QUATERNION", r"(2006-090T05:00:00.196000) \S+", r"\1 0.9"),
        ("QUATERNION/ANGVEL", "ANGVEL_FRAME = J2000\n", ""),
        ("ACM", "NUMBER_STATES = 7", "NUMBER_STATES = 4"),
        ("ACM", "RATE_TYPE = ANGVEL", "RATE_TYPE = OMEGA"),
        ("ACM", "IXY .*\n", ""),
        ("ACM", "0.01 -0.02 0.05", "0.01 -0.02 up"),
        ("ACM", "(?s)META_START.*META_STOP", ""),
        ("STK", "CoordinateAxes J2000", "CoordinateAxes Fixed"),
        ("STK", "31 Mar 2006", "2006-03-31"),
        ("STK", "(?s)0.375.*", ""),
        ("STK", "AttitudeTimeQuatAngVels", "AttitudeTimeEulerAngles"),
        ("STK", "CentralBody", "CentralBodies"),
        ("STK", "CentralBody Earth", "TimeFormat UTCG"),
    )
    cases = {}
    for kind, old, new in edits:
        text = re.sub(old, new, texts[kind], count=1)
        assert text != texts[kind], old
        cases[f"{kind}: {old} -> {new}"] = text
    check_faults(
        "files.histories", lambda text: read_message(str(write(text, "history.txt"))), cases
    )


def test_a_parameter_message_is_no_telemetry(write: Write) -> None:
    plan = messages.planned("prolate")
    path = write(export_text(plan, "apm"), "message.apm")
    with pytest.raises(BadRequest, match="no history of attitudes"):
        nutdamp.fit(path, plan.spacecraft, ignored=print)
    with pytest.raises(FaultyFile, match="convert to KVN"):
        nutdamp.fit(
            write(export_text(plan, "aem", xml=True), "message.xml"),
            plan.spacecraft,
            ignored=print,
        )


def test_a_spin_angle_vel_says_what_it_is() -> None:
    """C/A = 4/3 at 15 rpm: -30 deg/s beside 90 deg/s."""
    body = nutdamp.read(
        messages.STEERED.format(name="Oblate", A=90, C=120, spin="15 rpm").replace(
            "5 deg", "1e-9 deg"
        )
    )
    plan = nutdamp.plan(body, "none")
    said = r"COMMENT SPIN_ANGLE_VEL is the Euler rate .*: -30 deg/s\. .* w3, is 90 deg/s\.\n"
    for form in ("apm", "aem-spin"):
        assert re.search(said, export_text(plan, form))
    assert "Euler rate" not in export_text(plan, "aem")


# --- there and back: every message in KVN and every .a that is written

SHARE = st.floats(0.0, 1.0)


@pytest.mark.parametrize("form", ["apm", "aem", "aem-spin", "stk"])
@given(
    ratio=st.one_of(st.floats(0.3, 0.9), st.floats(1.1, 1.9)),
    apart=st.one_of(st.just(0.0), SHARE),
    lean=st.one_of(st.just(0.0), st.floats(0.0, 0.3)),
    backwards=st.booleans(),
    tilt=st.floats(0.001, 0.3),
    phase=st.floats(-3.1, 3.1),
    turn=st.tuples(*[st.floats(-180.0, 180.0)] * 3),
    share=SHARE,
)
@settings(max_examples=12)
def test_what_is_written_is_read_with_the_motion_that_it_is_of(
    form: str,
    ratio: float,
    apart: float,
    lean: float,
    backwards: bool,
    tilt: float,
    phase: float,
    turn: tuple[float, float, float],
    share: float,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """Over random bodies, prolate and oblate, backwards, with three moments and with products,
    against DOP853: attitude and rates at any record, and the inertia of an APM.
    """
    spread = 0.2 * apart * min(abs(1.0 - ratio), 2.0 - ratio)
    moments = 100.0 * np.array([1.0 + spread, 1.0 - spread, ratio])
    axes = Rotation.from_euler("XY", [lean, -0.5 * lean]).as_matrix()
    tensor = axes @ np.diag(moments) @ axes.T
    spin = -2.0 if backwards else 2.0
    side = 100.0 * ratio * abs(spin) * math.tan(tilt) / 100.0
    rates = axes @ [side * math.cos(phase), side * math.sin(phase), spin]
    scalar_last = Rotation.from_euler("ZXZ", turn, degrees=True).as_quat().tolist()
    text = "\n".join(
        [
            "name: random",
            f"inertia: {{tensor: {tensor.tolist()}}}"
            if lean or spread
            else f"inertia: {{A: 100, C: {100.0 * ratio}}}",
            f"omega0: {rates.tolist()}",
            "attitude:",
            "  epoch: 2026-03-01T12:00:00Z",
            "  frame: GCRF",
            f"  quaternion: {[scalar_last[3], *scalar_last[:3]]}",
        ]
    )
    plan = nutdamp.plan(nutdamp.read(text), "none")
    path = tmp_path_factory.mktemp("there") / "message.txt"
    until = 3.0
    path.write_text(export_text(plan, form, until=None if form == "apm" else until))
    contents = read_message(str(path))
    time = 0.0 if form == "apm" else share * until
    record = contents.at(time, spin)
    since = float(contents.times[np.searchsorted(contents.times, time)])
    body = plan.spacecraft
    start = reference.Motion(body.omega0, attitude.matrix(body.initial.quaternion))
    (moved,) = reference.path(body.inertia.moments, start, [], [since])
    columns = moved.rotation @ body.inertia.axes.T
    assert reference.turned(columns, attitude.matrix(record.quaternions[0])) < 2e-9
    off = float(np.linalg.norm(record.rates[0] - body.inertia.axes @ moved.rates))
    alone = form == "aem-spin" and bool(lean or spread)
    assert off < (2e-5 * float(np.linalg.norm(moved.rates)) if alone else 1e-9)
    if form == "apm":
        assert present(contents.tensor) == pytest.approx(body.inertia.tensor, rel=1e-12, abs=1e-12)
    other = Source(re.sub("omega0.*", f"omega0: [0.1, 0, {spin}]", text), "other.yaml")
    merged = nutdamp.read(merge(other, contents, time, inertia=form == "apm")[0])
    assert merged.rates == pytest.approx(record.rates[0], abs=1e-9)
    assert reference.turned(columns, attitude.matrix(present(merged.attitude).quaternion)) < 1e-8


@pytest.mark.deep
@pytest.mark.parametrize(
    "kind", ["QUATERNION/ANGVEL", "EULER_ANGLE", "SPIN/NUTATION", "ACM", "STK"]
)
@given(data=st.data())
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_is_in_the_file_is_read_or_reported(
    write: Write, kind: str, data: st.DataObject
) -> None:
    """Contents, or faults with lines; never anything else."""
    if kind == "APM":
        whole = export_text(messages.planned("tilted tensor, backwards"), "apm")
    else:
        whole = histories.history(kind, histories.flown(3))
    reported = [1]
    try:
        contents = read_message(str(write("".join(data.draw(slips(whole))), "message.txt")))
        assert len(contents.times) == len(contents.quaternions) == len(contents.rates)
        imported(contents, "message.txt")
    except FaultyFile as wrong:
        reported = [fault.line for fault in wrong.faults]
    assert reported
    assert min(reported) >= 1


def test_remarks_name_what_is_not_read(write: Write) -> None:
    blocks = "COV_START\nCOV_TYPE = ANGLE\n0.0 1e-9 1e-9 1e-9\nCOV_STOP\n"
    sensors = "AD_START\nAD_METHOD = EKF\nSENSOR_START\nSENSOR_NUMBER = 1\nSENSOR_STOP\nAD_STOP\n"
    contents = read_message(
        str(write(histories.acm(histories.flown(5)) + blocks + sensors, "a.acm"))
    )
    check_text("files.history-remarks", "\n".join(contents.remarks))
