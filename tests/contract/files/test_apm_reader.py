"""The strict reader of APMs: every form that the standard allows is read, what is wrong is reported by line."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support import messages

from nutdamp.errors import FaultyFile
from nutdamp.files.apm_import import imported
from nutdamp.files.ccsds.apm_reader import ApmContents, euler, read_apm
from nutdamp.files.exchange import export_text
from nutdamp.physics import attitude

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

SPIN = """
SPIN_START
REF_FRAME_A = EME2000
REF_FRAME_B = SC_BODY_1
SPIN_ALPHA = 0
SPIN_DELTA = 80
SPIN_ANGLE = 45
SPIN_ANGLE_VEL = 1
MOMENTUM_ALPHA = 0
MOMENTUM_DELTA = 70
NUTATION_VEL = 0.01
SPIN_STOP
"""
"""The example of annex F5.4."""


def without(block: str, text: str = GOOD) -> str:
    return re.sub(rf"{block}_START.*?{block}_STOP\n", "", text, flags=re.DOTALL)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def read(text: str, folder: Path) -> ApmContents:
    (folder / "a.apm").write_text(text, encoding="utf-8")
    return read_apm("a.apm")


def faults(text: str, folder: Path) -> list[str]:
    with pytest.raises(FaultyFile) as wrong:
        read(text, folder)
    return str(wrong.value).splitlines()


def line_of(text: str, start: str) -> int:
    return next(number for number, line in enumerate(text.splitlines(), start=1) if line.startswith(start))


def test_everything_is_read(folder: Path) -> None:
    found = read(GOOD, folder)
    assert (found.name, found.object_id, found.frame) == ("SPINNER", "2026-031A", "EME2000")
    assert found.epoch.text == "2026-03-01T12:00:00.500000000"
    assert found.quaternion == pytest.approx([0.8, 0.0, 0.6, 0.0])
    assert found.rates == pytest.approx(np.radians([8.0, 4.0, 180.0]))
    assert found.tensor.tolist() == [[120.0, -1.0, 2.0], [-1.0, 100.0, 0.0], [2.0, 0.0, 80.0]]
    first, second = found.manoeuvres
    assert (first.start, first.duration, first.torque.tolist(), first.mass) == (1.5, 0.5, [6.0, 0.0, 0.0], -0.01)
    assert (second.start, second.duration, second.torque.tolist(), second.mass) == (3.5, 1.0, [0.0, -6.0, 0.0], None)
    assert found.remarks == ()


@pytest.mark.parametrize("ending", ["\r\n", "\r", "\n\r"])
def test_line_ends_of_the_standard(folder: Path, ending: str) -> None:
    (folder / "a.apm").write_bytes(GOOD.replace("\n", ending).encode())
    assert len(read_apm("a.apm").manoeuvres) == 2
    (folder / "a.apm").write_bytes(GOOD.replace("Q2 = 0.6", "Q2 = x").replace("\n", ending).encode())
    with pytest.raises(FaultyFile, match=f"a.apm:{line_of(GOOD, 'Q2')}:1: Q2: 'x' is not a number"):
        read_apm("a.apm")


@pytest.mark.parametrize("case", messages.CASES)
def test_what_was_exported_comes_back(folder: Path, case: str) -> None:
    plan = messages.planned(case)
    body = plan.spacecraft
    found = read(export_text(plan, "apm"), folder)
    assert found.remarks == ()
    assert found.rates == pytest.approx(messages.in_file_axes(body, body.initial.rates), rel=1e-13, abs=1e-15)
    assert found.quaternion is not None
    assert attitude.matrix(found.quaternion) == pytest.approx(
        messages.columns(body, body.initial.quaternion), abs=1e-14
    )
    assert found.tensor == pytest.approx(body.inertia.tensor, rel=1e-15)
    for manoeuvre, pulse in zip(found.manoeuvres, plan.pulses, strict=True):
        assert pulse.torque is not None
        assert manoeuvre.start == pytest.approx(pulse.start, abs=0.51e-9)
        assert manoeuvre.duration == pytest.approx(pulse.on_time, rel=1e-15)
        assert manoeuvre.torque == pytest.approx(messages.in_file_axes(body, pulse.torque), rel=1e-14, abs=1e-15)


def test_the_spin_of_the_standards_example(folder: Path) -> None:
    """Annex F5.4 prints the quaternion and the axis of H to four digits."""
    text = without("QUAT", without("ANGVEL")).replace("INERTIA_START", SPIN.strip() + "\n\nINERTIA_START")
    found = read(text, folder)
    assert found.quaternion is not None
    assert found.quaternion == pytest.approx([0.3812, 0.0805, 0.0334, 0.9204], abs=5e-5)
    axes = attitude.matrix(found.quaternion)
    assert axes[:, 2] == pytest.approx([0.1736, 0.0, 0.9848], abs=5e-5)
    # 1 deg/s about the third axis and 0.01 deg/s about H make up the rates.
    expected = math.radians(1.0) * axes[:, 2] + math.radians(0.01) * np.array([0.3420201, 0.0, 0.9396926])
    assert axes @ found.rates == pytest.approx(expected, rel=1e-7)
    # The other form of the block says the same: H is 10 deg from the axis, and goes round in 36000 s.
    h = axes.T @ np.array([math.cos(math.radians(70.0)), 0.0, math.sin(math.radians(70.0))])
    phase = math.degrees(math.atan2(-h[1], h[0]))
    other = re.sub(
        "MOMENTUM_ALPHA.*NUTATION_VEL = 0.01",
        f"NUTATION = 10\nNUTATION_PER = 36000\nNUTATION_PHASE = {phase}",
        text,
        flags=re.DOTALL,
    )
    assert read(other, folder).rates == pytest.approx(found.rates, rel=1e-12)
    plain = re.sub("MOMENTUM_ALPHA.*NUTATION_VEL = 0.01\n", "", text, flags=re.DOTALL)
    assert read(plain, folder).rates == pytest.approx([0.0, 0.0, math.radians(1.0)], abs=1e-15)


def test_frames_the_other_way_round(folder: Path) -> None:
    """From the body to the frame the quaternion is the inverse, and the rate that of the frame against the body."""
    turned = GOOD.replace(
        "REF_FRAME_A = EME2000\nREF_FRAME_B = SC_BODY_1", "REF_FRAME_A = SC_BODY_1\nREF_FRAME_B = EME2000"
    )
    turned = turned.replace("Q2 = 0.6", "Q2 = -0.6")
    for axis, rate in (("X", 8), ("Y", 4), ("Z", 180)):
        turned = turned.replace(f"ANGVEL_{axis} = {rate} ", f"ANGVEL_{axis} = -{rate} ")
    one, two = read(GOOD, folder), read(turned, folder)
    assert two.quaternion == pytest.approx(one.quaternion)
    assert two.rates == pytest.approx(one.rates)


def test_rates_in_the_inertial_frame(folder: Path) -> None:
    rates = attitude.matrix(np.array([0.8, 0.0, 0.6, 0.0])) @ np.array([8.0, 4.0, 180.0])
    text = GOOD.replace("ANGVEL_FRAME = SC_BODY_1", "ANGVEL_FRAME = EME2000")
    for axis, old, new in zip("XYZ", (8, 4, 180), rates.tolist(), strict=True):
        text = text.replace(f"ANGVEL_{axis} = {old} ", f"ANGVEL_{axis} = {new!r} ")
    assert read(text, folder).rates == pytest.approx(np.radians([8.0, 4.0, 180.0]), rel=1e-14)


def test_euler_angles(folder: Path) -> None:
    """Turns of annex F3.2: about x, then the new y, then the new z."""
    angles = "EULER_ROT_SEQ = XYZ\nANGLE_1 = 20\nANGLE_2 = -30\nANGLE_3 = 140"
    block = f"EULER_START\nREF_FRAME_A = EME2000\nREF_FRAME_B = SC_BODY_1\n{angles}\nEULER_STOP\n"
    found = read(without("QUAT").replace("ANGVEL_START", f"{block}\nANGVEL_START", 1), folder)
    one, two, three = np.radians([20.0, -30.0, 140.0])
    about_x = np.array([[1, 0, 0], [0, math.cos(one), math.sin(one)], [0, -math.sin(one), math.cos(one)]])
    about_y = np.array([[math.cos(two), 0, -math.sin(two)], [0, 1, 0], [math.sin(two), 0, math.cos(two)]])
    about_z = np.array([[math.cos(three), math.sin(three), 0], [-math.sin(three), math.cos(three), 0], [0, 0, 1]])
    assert found.quaternion is not None
    turned = attitude.matrix(found.quaternion).T
    assert turned == pytest.approx(about_z @ about_y @ about_x, abs=1e-15)
    assert euler("ZXZ", 0.0, 0.0, 0.0).tolist() == [1.0, 0.0, 0.0, 0.0]


def test_a_spin_block_that_says_something_else_is_reported(folder: Path) -> None:
    text = GOOD.replace("INERTIA_START", SPIN.strip() + "\n\nINERTIA_START")
    found = read(text, folder)
    line = line_of(text, "SPIN_START")
    assert [remark.partition(": ")[0] for remark in found.remarks] == [f"line {line}"] * 2
    assert found.rates == pytest.approx(np.radians([8.0, 4.0, 180.0]))


def test_no_attitude_and_another_name_for_the_axes(folder: Path) -> None:
    found = read(without("QUAT").replace("EME2000", "ICRF"), folder)
    assert found.quaternion is None
    assert any("no attitude" in remark for remark in found.remarks)
    found = read(GOOD.replace("EME2000", "ICRF"), folder)
    assert found.frame == "GCRF"
    assert found.remarks == ("ICRF is taken as GCRF, whose axes are the same",)


BROKEN = [
    ("EPOCH = 2026-03-01T12:00:00.5\n", "", "1:1: EPOCH: missing"),
    ("EPOCH = 2026-03-01T12:00:00.5", "EPOCH = noon", "EPOCH: 'noon' is no epoch"),
    ("EPOCH = 2026-03-01T12:00:00.5", "EPOCH =", "EPOCH: empty"),
    ("TIME_SYSTEM = UTC", "TIME_SYSTEM = UT1", "expected UTC, TAI, GPS, TT or TDB, got 'UT1'"),
    ("OBJECT_ID = 2026-031A\n", "", "OBJECT_ID: missing"),
    ("OBJECT_ID = 2026-031A", "OBJECT_IDENT = 2026-031A", "OBJECT_IDENT: unknown keyword; did you mean OBJECT_ID?"),
    ("ORIGINATOR = TEST", "ORIGINATOR = TEST\nORIGINATOR = TEST", "ORIGINATOR: given again, first in line 3"),
    (
        "ORIGINATOR = TEST\n\nOBJECT_NAME = SPINNER",
        "OBJECT_NAME = SPINNER\n\nORIGINATOR = TEST",
        "comes after OBJECT_NAME",
    ),
    ("EPOCH = 2026", "META_START\nMETA_STOP\nEPOCH = 2026", "META_START: unknown block"),
    ("Q2 = 0.6\n", "", "Q2: missing in this QUAT block"),
    ("Q2 = 0.6", "Q2 = 0.7", "the quaternion has length 1.0630"),
    ("Q2 = 0.6", "Q2 = 0,6", "'0,6' is not a number"),
    ("Q2 = 0.6", "Q2 = nan", "'nan' is not a number"),
    ("Q2 = 0.6", "Q2 = 1e999", "beyond anything physical"),
    ("Q1 = 0.0\nQ2 = 0.6", "Q2 = 0.6\nQ1 = 0.0", "Q1: comes after Q2; the order of the standard is"),
    (
        "REF_FRAME_A = EME2000\nREF_FRAME_B = SC_BODY_1\nQ1",
        "REF_FRAME_A = TOD\nREF_FRAME_B = SC_BODY_1\nQ1",
        "'TOD' is no inertial frame",
    ),
    ("REF_FRAME_B = SC_BODY_1\nQ1", "REF_FRAME_B = GCRF\nQ1", "one of the two frames must be the body"),
    ("REF_FRAME_B = SC_BODY_1\nQ1", "REF_FRAME_B = SC_BODY_2\nQ1", "expected one body frame"),
    (
        "REF_FRAME_A = EME2000\nREF_FRAME_B = SC_BODY_1\nQ1",
        "REF_FRAME_A = GCRF\nREF_FRAME_B = SC_BODY_1\nQ1",
        "expected one frame",
    ),
    ("QUAT_STOP\n", "", "QUAT_STOP is missing before it"),
    ("QUAT_STOP", "ANGVEL_STOP", "ANGVEL_STOP: expected QUAT_STOP"),
    ("QUAT_START\n", "", "QUAT_STOP: no block is open"),
    ("ANGVEL_X = 8 [deg/s]", "ANGVEL_X = 8 [rad/s]", "expected [deg/s], got [rad/s]"),
    ("Q2 = 0.6", "Q2 = 0.6 [deg]", "expected no unit, got [deg]"),
    ("ANGVEL_FRAME = SC_BODY_1", "ANGVEL_FRAME = GCRF", "'GCRF' is neither REF_FRAME_A nor REF_FRAME_B"),
    ("INERTIA_REF_FRAME = SC_BODY_1", "INERTIA_REF_FRAME = EME2000", "'EME2000' is no frame fixed in the body"),
    ("MAN_REF_FRAME = SC_BODY_1", "MAN_REF_FRAME = EME2000", "'EME2000' is no frame fixed in the body"),
    ("MAN_DURATION = 0.5 [s]", "MAN_DURATION = -0.5 [s]", "-0.5 s is no duration"),
    ("MAN_DURATION = 0.5 [s]", "MAN_DURATION = 0 [s]", "0 s is no duration"),
    ("MAN_DELTA_MASS = -0.01", "MAN_DELTA_MASS = 0.01", "0.01 kg would be gained"),
    ("MAN_TOR_X = 6", "MAN_TOR_X = 0", "the torque is zero"),
    ("MAN_EPOCH_START = 2026-03-01T12:00:02", "MAN_EPOCH_START = 2026-03-01T12:00:00", "begins before EPOCH"),
    ("MAN_EPOCH_START = 2026-03-01T12:00:02", "MAN_EPOCH_START = 2026-03-01T12:00:05", "put them in order"),
    ("COMMENT first", "torque about axis 1", "'torque about axis 1' is no KEYWORD = value"),
    ("MAN_DELTA_MASS = -0.01 [kg]", "MAN_DELTA_VEL = 1", "unknown keyword; did you mean MAN_DELTA_MASS?"),
]


@pytest.mark.parametrize(("old", "new", "problem"), BROKEN, ids=[problem for _, _, problem in BROKEN])
def test_faults(folder: Path, old: str, new: str, problem: str) -> None:
    assert old in GOOD
    found = faults(GOOD.replace(old, new, 1), folder)
    assert any(problem in line for line in found), found
    for line in found:
        assert re.match(r"a\.apm:[0-9]+:1: ", line)


def test_blocks_missing_repeated_and_out_of_order(folder: Path) -> None:
    assert "INERTIA: missing" in faults(without("INERTIA"), folder)[0]
    assert "ANGVEL: missing" in faults(without("ANGVEL"), folder)[0]
    angvel = re.search("ANGVEL_START.*ANGVEL_STOP\n", GOOD, re.DOTALL)
    assert angvel is not None
    assert (
        "a second block of this kind" in faults(GOOD.replace("INERTIA_START", angvel[0] + "INERTIA_START"), folder)[0]
    )
    moved = angvel[0] + "QUAT_START"
    found = faults(without("ANGVEL").replace("QUAT_START", moved), folder)
    assert "QUAT: comes after ANGVEL" in found[0]


def test_spin_blocks_that_cannot_be(folder: Path) -> None:
    text = without("QUAT", without("ANGVEL")).replace("INERTIA_START", SPIN.strip() + "\n\nINERTIA_START")
    for old, new, problem in (
        ("MOMENTUM_DELTA = 70\n", "", "MOMENTUM_ALPHA: given without MOMENTUM_DELTA"),
        (
            "MOMENTUM_ALPHA = 0",
            "NUTATION = 1\nNUTATION_PER = 2\nNUTATION_PHASE = 3\nMOMENTUM_ALPHA = 0",
            "keep one set",
        ),
        (
            "REF_FRAME_A = EME2000\nREF_FRAME_B = SC_BODY_1",
            "REF_FRAME_A = SC_BODY_1\nREF_FRAME_B = EME2000",
            "the body comes first",
        ),
        (
            "MOMENTUM_ALPHA = 0\nMOMENTUM_DELTA = 70\nNUTATION_VEL = 0.01",
            "NUTATION = 1\nNUTATION_PER = 0\nNUTATION_PHASE = 3",
            "0 s is no period",
        ),
    ):
        assert old in text
        assert any(problem in line for line in faults(text.replace(old, new), folder)), problem


def test_all_faults_at_once_with_their_lines(folder: Path) -> None:
    text = (
        GOOD.replace("Q2 = 0.6", "Q2 = x")
        .replace("IZZ = 80", "IZZ = 80 [g]")
        .replace("MAN_DURATION = 1", "MAN_DURATION = -1")
    )
    found = faults(text, folder)
    lines = [line_of(text, start) for start in ("Q2", "IZZ", "MAN_DURATION = -1")]
    assert [line.split(":")[1] for line in found] == [str(line) for line in lines]


@pytest.mark.deep
@given(data=st.data())
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_is_in_the_file_is_read_or_reported(folder: Path, data: st.DataObject) -> None:
    """Lines dropped, doubled, swapped and changed: contents, or faults with lines; never anything else."""
    lines = GOOD.splitlines()
    for _ in range(data.draw(st.integers(1, 4))):
        place, other = (data.draw(st.integers(0, len(lines) - 1)) for _ in range(2))
        match data.draw(st.integers(0, 3)):
            case 0 if len(lines) > 1:
                del lines[place]
            case 1:
                lines.insert(place, lines[other])
            case 2:
                lines[place], lines[other % len(lines)] = lines[other % len(lines)], lines[place]
            case _:
                cut = data.draw(st.integers(0, len(lines[place % len(lines)])))
                lines[place % len(lines)] = lines[place % len(lines)][:cut] + data.draw(st.text(max_size=3))
    (folder / "a.apm").write_text("\n".join(lines), encoding="utf-8")
    reported: list[int] = [1]
    try:
        imported(read_apm("a.apm"), "a.apm")
    except FaultyFile as wrong:
        reported = [fault.line for fault in wrong.faults]
    assert reported
    assert min(reported) >= 1
