"""APMs: every form that the standard allows is read, what is wrong is reported by line; there and
back.
"""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import messages
from support.builders import present
from support.cases import deep
from support.contract import CASES, Write, check_faults, check_parts, faults
from support.golden import check_text
from support.places import case

from nutdamp.errors import CannotRead, FaultyFile
from nutdamp.files.ccsds.read import MOST_BYTES, Contents, euler, read_message
from nutdamp.files.ccsds.write import contradictions, imported
from nutdamp.files.reader import read_spacecraft
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
    assert read(turned).at().quaternions[0] == pytest.approx([0.8, 0.0, 0.6, 0.0])
    for text in (turned, inertial):
        assert read(text).at().rates[0] == pytest.approx(np.radians([8.0, 4.0, 180.0]), rel=1e-14)


def test_euler_angles(read: Read) -> None:
    """Turns of annex F3.2: about x, then the new y, then the new z."""
    angles = "EULER_ROT_SEQ = XYZ\nANGLE_1 = 20\nANGLE_2 = -30\nANGLE_3 = 140\n"
    apm = read(before("ANGVEL", f"EULER_START\n{ENDS}{angles}EULER_STOP\n", without("QUAT")))
    one, two, three = np.radians([20.0, -30.0, 140.0])
    about_x = np.array(
        [[1, 0, 0], [0, math.cos(one), math.sin(one)], [0, -math.sin(one), math.cos(one)]]
    )
    about_y = np.array(
        [[math.cos(two), 0, -math.sin(two)], [0, 1, 0], [math.sin(two), 0, math.cos(two)]]
    )
    about_z = np.array(
        [[math.cos(three), math.sin(three), 0], [-math.sin(three), math.cos(three), 0], [0, 0, 1]]
    )
    turned = attitude.matrix(present(apm.at().quaternions[0])).T
    assert turned == pytest.approx(about_z @ about_y @ about_x, abs=1e-15)
    assert euler("ZXZ", 0.0, 0.0, 0.0).tolist() == [1.0, 0.0, 0.0, 0.0]


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


def test_a_message_without_inertia_makes_no_spacecraft_file_of_its_own(read: Read) -> None:
    with pytest.raises(FaultyFile, match="--into"):
        imported(read(without("INERTIA")), "message.apm")


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
    rates = messages.in_file_axes(body, body.initial.rates)
    stated = {
        "remarks": (),
        "rates.0": pytest.approx(rates, rel=1e-13, abs=1e-15),
        "tensor": pytest.approx(body.inertia.tensor, rel=1e-15),
    }
    check_parts(apm, stated)
    axes = attitude.matrix(apm.quaternions[0])
    assert axes == pytest.approx(messages.columns(body, body.initial.quaternion), abs=1e-14)
    same = {
        "omega0": pytest.approx(body.omega0, rel=1e-12, abs=1e-15),
        "inertia.tensor": pytest.approx(body.inertia.tensor, rel=1e-15),
        "inertia.moments": pytest.approx(body.inertia.moments, rel=1e-14),
        "nutation": pytest.approx(body.nutation, rel=1e-12),
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
