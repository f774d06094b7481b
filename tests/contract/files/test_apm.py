"""The strict reader of APMs: every form that the standard allows is read, what is wrong is reported by line."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from support.contract import Write, check_faults, faults, known, slips
from support.golden import check_text
from support.places import case

from nutdamp.errors import CannotRead, FaultyFile
from nutdamp.files.ccsds.message import MOST_BYTES
from nutdamp.files.ccsds.read import ApmContents, euler, imported, read_apm
from nutdamp.physics import attitude

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
SPIN = f"SPIN_START\n{ENDS}SPIN_ALPHA = 0\nSPIN_DELTA = 80\nSPIN_ANGLE = 45\nSPIN_ANGLE_VEL = 1\n{MOMENTUM}SPIN_STOP\n"
"""The example of annex F5.4."""

Read = Callable[[str | bytes], ApmContents]


@pytest.fixture
def read(write: Write) -> Read:
    """``read(text)``: the contents of a message."""
    return lambda text: read_apm(str(write(text, "a.apm")))


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
    assert (apm.name, apm.object_id, apm.frame) == ("SPINNER", "2026-031A", "EME2000")
    assert apm.epoch.text == "2026-03-01T12:00:00.500000000"
    assert apm.quaternion == pytest.approx([0.8, 0.0, 0.6, 0.0])
    assert apm.rates == pytest.approx(np.radians([8.0, 4.0, 180.0]))
    assert apm.tensor is not None
    assert apm.tensor.tolist() == [[120.0, -1.0, 2.0], [-1.0, 100.0, 0.0], [2.0, 0.0, 80.0]]
    first, second = apm.manoeuvres
    assert (first.start, first.duration, first.torque.tolist(), first.mass) == (1.5, 0.5, [6.0, 0.0, 0.0], -0.01)
    assert (second.start, second.duration, second.torque.tolist(), second.mass) == (3.5, 1.0, [0.0, -6.0, 0.0], None)
    assert apm.remarks == ()
    # Line ends of the standard.
    wrong = faults(read, edited("Q2 = 0.6", "Q2 = x"))
    for ending in ("\r\n", "\r", "\n\r"):
        assert len(read(GOOD.replace("\n", ending)).manoeuvres) == 2
        assert faults(read, edited("Q2 = 0.6", "Q2 = x").replace("\n", ending)) == wrong
    # No attitude, and another name for the axes.
    bare, renamed = read(without("QUAT").replace("EME2000", "ICRF")), read(GOOD.replace("EME2000", "ICRF"))
    assert (bare.quaternion, renamed.frame) == (None, "GCRF")
    # A spin block that says something else.
    spun = read(before("INERTIA", SPIN))
    assert spun.rates == pytest.approx(apm.rates)
    check_text("files.apm-remarks", "\n".join("\n".join(found.remarks) for found in (bare, renamed, spun)))


def test_the_spin_of_the_standards_example(read: Read) -> None:
    """Annex F5.4 prints the quaternion and the axis of H to four digits."""
    apm = read(SPIN_ALONE)
    assert apm.quaternion == pytest.approx([0.3812, 0.0805, 0.0334, 0.9204], abs=5e-5)
    axes = attitude.matrix(known(apm.quaternion))
    assert axes[:, 2] == pytest.approx([0.1736, 0.0, 0.9848], abs=5e-5)
    # 1 deg/s about the third axis and 0.01 deg/s about H make up the rates.
    expected = math.radians(1.0) * axes[:, 2] + math.radians(0.01) * np.array([0.3420201, 0.0, 0.9396926])
    assert axes @ apm.rates == pytest.approx(expected, rel=1e-7)
    # The other form of the block says the same: H is 10 deg from the axis, and goes round in 36000 s.
    h = axes.T @ np.array([math.cos(math.radians(70.0)), 0.0, math.sin(math.radians(70.0))])
    phase = math.degrees(math.atan2(-h[1], h[0]))
    other = f"NUTATION = 10\nNUTATION_PER = 36000\nNUTATION_PHASE = {phase}\n"
    assert read(edited(MOMENTUM, other, SPIN_ALONE)).rates == pytest.approx(apm.rates, rel=1e-12)
    assert read(edited(MOMENTUM, "", SPIN_ALONE)).rates == pytest.approx([0.0, 0.0, math.radians(1.0)], abs=1e-15)


def test_frames_the_other_way_round_and_rates_in_the_inertial_frame(read: Read) -> None:
    """From the body to the frame the quaternion is the inverse, and the rate that of the frame against the body."""
    turned = GOOD.replace(ENDS, "REF_FRAME_A = SC_BODY_1\nREF_FRAME_B = EME2000\n").replace("Q2 = 0.6", "Q2 = -0.6")
    inertial = edited("ANGVEL_FRAME = SC_BODY_1", "ANGVEL_FRAME = EME2000")
    rates = attitude.matrix(np.array([0.8, 0.0, 0.6, 0.0])) @ np.array([8.0, 4.0, 180.0])
    for axis, rate, seen in zip("XYZ", (8, 4, 180), rates.tolist(), strict=True):
        turned = edited(f"ANGVEL_{axis} = {rate} ", f"ANGVEL_{axis} = -{rate} ", turned)
        inertial = edited(f"ANGVEL_{axis} = {rate} ", f"ANGVEL_{axis} = {seen!r} ", inertial)
    assert read(turned).quaternion == pytest.approx([0.8, 0.0, 0.6, 0.0])
    for text in (turned, inertial):
        assert read(text).rates == pytest.approx(np.radians([8.0, 4.0, 180.0]), rel=1e-14)


def test_euler_angles(read: Read) -> None:
    """Turns of annex F3.2: about x, then the new y, then the new z."""
    angles = "EULER_ROT_SEQ = XYZ\nANGLE_1 = 20\nANGLE_2 = -30\nANGLE_3 = 140\n"
    apm = read(before("ANGVEL", f"EULER_START\n{ENDS}{angles}EULER_STOP\n", without("QUAT")))
    one, two, three = np.radians([20.0, -30.0, 140.0])
    about_x = np.array([[1, 0, 0], [0, math.cos(one), math.sin(one)], [0, -math.sin(one), math.cos(one)]])
    about_y = np.array([[math.cos(two), 0, -math.sin(two)], [0, 1, 0], [math.sin(two), 0, math.cos(two)]])
    about_z = np.array([[math.cos(three), math.sin(three), 0], [-math.sin(three), math.cos(three), 0], [0, 0, 1]])
    turned = attitude.matrix(known(apm.quaternion)).T
    assert turned == pytest.approx(about_z @ about_y @ about_x, abs=1e-15)
    assert euler("ZXZ", 0.0, 0.0, 0.0).tolist() == [1.0, 0.0, 0.0, 0.0]


BROKEN = (
    *(("EPOCH = 2026-03-01T12:00:00.5\n", edit) for edit in ("", "EPOCH = noon\n", "EPOCH =\n")),
    ("TIME_SYSTEM = UTC", "TIME_SYSTEM = UT1"),
    ("OBJECT_ID = 2026-031A\n", ""),
    ("OBJECT_ID = 2026-031A", "OBJECT_IDENT = 2026-031A"),
    ("ORIGINATOR = TEST", "ORIGINATOR = TEST\nORIGINATOR = TEST"),
    ("ORIGINATOR = TEST\nOBJECT_NAME = SPINNER", "OBJECT_NAME = SPINNER\nORIGINATOR = TEST"),
    ("EPOCH = 2026", "META_START\nMETA_STOP\nEPOCH = 2026"),
    ("Q2 = 0.6\n", ""),
    *(("Q2 = 0.6", f"Q2 = {value}") for value in ("0.7", "0,6", "nan", "1e999", "0.6 [deg]")),
    ("Q1 = 0.0\nQ2 = 0.6", "Q2 = 0.6\nQ1 = 0.0"),
    *((f"{ENDS}Q1", f"{ENDS}Q1".replace("EME2000", frame)) for frame in ("TOD", "GCRF")),
    *((f"{ENDS}Q1", f"{ENDS}Q1".replace("SC_BODY_1", frame)) for frame in ("GCRF", "SC_BODY_2")),
    ("QUAT_STOP\n", ""),
    ("QUAT_STOP", "ANGVEL_STOP"),
    ("QUAT_START\n", ""),
    ("ANGVEL_X = 8 [deg/s]", "ANGVEL_X = 8 [rad/s]"),
    ("ANGVEL_FRAME = SC_BODY_1", "ANGVEL_FRAME = GCRF"),
    *((f"{block}_REF_FRAME = SC_BODY_1", f"{block}_REF_FRAME = EME2000") for block in ("INERTIA", "MAN")),
    *(("MAN_DURATION = 0.5 [s]", f"MAN_DURATION = {value} [s]") for value in (-0.5, 0)),
    ("MAN_DELTA_MASS = -0.01", "MAN_DELTA_MASS = 0.01"),
    ("MAN_TOR_X = 6", "MAN_TOR_X = 0"),
    *(("MAN_EPOCH_START = 2026-03-01T12:00:02", f"MAN_EPOCH_START = 2026-03-01T12:00:0{s}") for s in (0, 5)),
    ("COMMENT first", "torque about axis 1"),
    ("MAN_DELTA_MASS = -0.01 [kg]", "MAN_DELTA_VEL = 1"),
)


def test_faults(read: Read) -> None:
    check_faults("files.apm", lambda edit: read(edited(*edit)), BROKEN)
    (angvel,) = re.findall("ANGVEL_START.*ANGVEL_STOP\n", GOOD, re.DOTALL)
    several = edited("MAN_DURATION = 1", "MAN_DURATION = -1", edited("IZZ = 80", "IZZ = 80 [g]"))
    blocks = {
        "no ANGVEL": without("ANGVEL"),
        "two of ANGVEL": before("INERTIA", angvel),
        "ANGVEL first": before("QUAT", angvel, without("ANGVEL")),
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
    others = ("", "hello\n", "CCSDS_AEM_VERS = 2.0\n", "CCSDS_APM_VERS = 1.0\nQ_FRAME_A = X\n", XML[0])
    check_faults("files.apm-none", read, others)
    for encoding in ("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"):
        for text in XML:
            assert faults(read, text.encode(encoding)) == faults(read, XML[0])
    assert faults(read_apm, str(case("crash-xml-encoding.apm.txt"))) == faults(read, XML[0])
    latin = "CCSDS_APM_VERS = 2.0\nORIGINATOR = MÜLLER\n".encode("latin-1")
    wrong = {"zeros": b"\xff\xfe\x00", "UTF-16": GOOD[:21].encode("utf-16"), "Latin-1": latin}
    check_faults("files.apm-encodings", read, wrong)
    for start in ("CCSDS_APM_VERS = 2.0\n", XML[0]):
        with Path("huge.apm").open("wb") as stream:
            stream.write(start.encode())
            stream.truncate(MOST_BYTES + 1)
        assert faults(read_apm, "huge.apm") == ["1:1: : larger than 16 MiB"]
    with pytest.raises(CannotRead):
        read_apm("missing.apm")


@pytest.mark.deep
@given(lines=slips(GOOD))
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_is_in_the_file_is_read_or_reported(read: Read, lines: list[str]) -> None:
    """Contents, or faults with lines; never anything else."""
    reported = [1]
    try:
        imported(read("".join(lines)), "a.apm")
    except FaultyFile as wrong:
        reported = [fault.line for fault in wrong.faults]
    assert reported
    assert min(reported) >= 1


def test_a_message_without_inertia_makes_no_spacecraft_file_of_its_own(read: Read) -> None:
    with pytest.raises(FaultyFile, match="--into"):
        imported(read(without("INERTIA")), "message.apm")
