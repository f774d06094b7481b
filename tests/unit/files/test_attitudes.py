"""Attitudes of files: by the direction of an axis and a phase, or merged from messages."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.builders import present
from support.places import case
from support.process import Run

import nutdamp
from nutdamp.errors import BadRequest, FaultyFile
from nutdamp.files.ccsds.read import merged_text, read_apm, read_history
from nutdamp.files.reader import Source
from nutdamp.physics import attitude

SPACECRAFT = """
name: Sounder  # flown twice
inertia: {A: 120 kg m^2, C: 80 kg m^2}
omega0: [0.2 rad/s, 5 deg/s, 30 rpm]   # as released
attitude: {quaternion: [0.9, 0.1, -0.2, 0.3], epoch: 2026-03-01T12:00:00Z, frame: EME2000}
thrusters:
  - {name: P, torque: [8, 0, 0], max_on_time: 1 s}
"""
SKEW = SPACECRAFT.replace("{A: 120 kg m^2, C: 80 kg m^2}", "{tensor: [[120, 2, 1], [2, 110, 0.5], [1, 0.5, 80]]}")


def exported(tmp_path: Path, text: str, form: str, until: float = 20.0) -> tuple[Path, nutdamp.Plan]:
    plan = nutdamp.plan(nutdamp.read(text), "none")
    path = tmp_path / f"message.{form}"
    nutdamp.export(plan, form, path, until=until if form == "aem" else None)
    return path, plan


def turned(first: np.ndarray, second: np.ndarray) -> float:
    return float(2.0 * np.linalg.norm(attitude.multiply(attitude.conjugate(first), second)[1:]))


def quaternion(spacecraft: nutdamp.Spacecraft) -> np.ndarray:
    return present(spacecraft.attitude).quaternion


@pytest.mark.parametrize("text", [SPACECRAFT, SKEW], ids=["symmetric", "tensor"])
def test_a_history_is_read_as_it_was_written(tmp_path: Path, text: str) -> None:
    path, plan = exported(tmp_path, text, "aem")
    history = read_history(str(path))
    rates, quaternions = plan.spacecraft.inertia.in_file_axes(*plan.reaching(20.0).motion(history.times))
    assert np.allclose(present(history.rates), rates, rtol=0.0, atol=1e-9)
    assert max(turned(*pair) for pair in zip(history.quaternions, quaternions, strict=True)) < 1e-9
    assert history.times[-1] == pytest.approx(20.0, abs=1e-6)


@pytest.mark.parametrize(("form", "at"), [("apm", None), ("aem", None), ("aem", "7s")])
@pytest.mark.parametrize("text", [SPACECRAFT, SKEW], ids=["symmetric", "tensor"])
def test_a_message_is_merged_into_a_file(run: Run, tmp_path: Path, text: str, form: str, at: str | None) -> None:
    """Into a file with another motion: then it moves as the one that the message is of."""
    path, plan = exported(tmp_path, text, form)
    other = text.replace("[0.2 rad/s, 5 deg/s, 30 rpm]", "[0.1 rad/s, 2 deg/s, 29 rpm]").replace("[0.9, 0.1,", "[1, 0,")
    (tmp_path / "other.yaml").write_text(other)
    more = () if at is None else ("--at", at)
    run("import", path.name, "--into", "other.yaml", "-o", "merged.yaml", *more, status=0)
    merged = nutdamp.load(tmp_path / "merged.yaml")
    since = float(present(present(merged.attitude).epoch).removesuffix("Z")[17:])
    assert since >= (0.0 if at is None else 7.0)
    rates, quaternions = plan.spacecraft.inertia.in_file_axes(*plan.reaching(20.0).motion(np.array([since])))
    assert np.allclose(merged.rates, rates[0], rtol=0.0, atol=1e-9)
    assert turned(quaternion(merged), quaternions[0]) < 1e-8
    lines = (tmp_path / "merged.yaml").read_text().splitlines()
    assert lines[1] == "name: Sounder  # flown twice"
    assert lines[3].endswith("rpm]   # as released")


def test_inertia_is_merged_only_where_it_is_asked_for(run: Run, tmp_path: Path) -> None:
    path, _ = exported(tmp_path, SKEW, "apm")
    (tmp_path / "other.yaml").write_text(SPACECRAFT)
    for flag, moment in ((), 120.0), (("--inertia",), 110.0):
        run("import", path.name, "--into", "other.yaml", "-o", "merged.yaml", *flag, status=0)
        assert nutdamp.load(tmp_path / "merged.yaml").inertia.tensor[1, 1] == pytest.approx(moment)


def test_the_nutation_of_a_message_stays_whatever_the_ratio_of_the_file(run: Run, tmp_path: Path) -> None:
    """NUTATION = 5 became 4.62 deg at exit 0; spin, nutation and period of the message are those of C/A = 1.2009."""
    text = case("apm-into.yaml").read_text()
    for moment, doubt in (("1300", "C/A = 1.201, and the file has 1.3:"), ("1200.9", "")):
        (tmp_path / "other.yaml").write_text(text.replace("1300", moment))
        result = run("import", str(case("spin-nutation.apm.txt")), "--into", "other.yaml", "-o", "merged.yaml")
        assert (result.returncode, "warning" in result.stderr) == (0, bool(doubt))
        assert doubt in result.stderr
        merged = nutdamp.load(tmp_path / "merged.yaml")
        assert math.degrees(merged.nutation) == pytest.approx(5.0, rel=1e-12)
        assert merged.spin == pytest.approx(-math.pi / 10.0 + 2.0 * math.pi / 3.3333333 * math.cos(math.radians(5.0)))


def test_an_attitude_is_written_as_the_message_has_it(tmp_path: Path) -> None:
    """Without the rounding of a turn to the principal axes and back."""
    path, _ = exported(tmp_path, SPACECRAFT.replace("[0.9, 0.1, -0.2, 0.3]", "[0.8, 0, 0.6, 0]"), "apm")
    assert "quaternion: [0.8, 0, 0.6, 0]," in merged_text(Source(SKEW, "f.yaml"), read_apm(str(path)), inertia=True)


def test_a_file_without_attitude_gets_one(run: Run, tmp_path: Path) -> None:
    path, plan = exported(tmp_path, SPACECRAFT, "apm")
    lines = [line for line in SPACECRAFT.splitlines() if not line.startswith("attitude")]
    (tmp_path / "other.yaml").write_text("\n".join(lines))
    assert run("import", path.name, "--into", "other.yaml", "-o", "merged.yaml").returncode == 0
    assert turned(quaternion(nutdamp.load(tmp_path / "merged.yaml")), quaternion(plan.spacecraft)) < 1e-8


def test_a_history_is_telemetry(tmp_path: Path) -> None:
    path, plan = exported(tmp_path, SPACECRAFT, "aem")
    guessed = plan.spacecraft.with_(inertia={"C": 82.0}, omega0=[0.18, 0.09, 3.1])
    estimate = nutdamp.fit(path, guessed, ignored=print).spacecraft()
    assert pytest.approx(80.0 / 120.0, rel=1e-4) == estimate.inertia.C / estimate.inertia.A
    assert estimate.omega0 == pytest.approx(plan.spacecraft.omega0, abs=1e-4)


def test_a_history_in_another_frame_is_no_telemetry(tmp_path: Path) -> None:
    path, _ = exported(tmp_path, SPACECRAFT, "aem")
    with pytest.raises(BadRequest, match="expected one frame"):
        nutdamp.fit(path, nutdamp.read(SPACECRAFT.replace("EME2000", "GCRF")), ignored=print)


@pytest.mark.parametrize(("old", "new", "problem"), [
    ("= QUATERNION/ANGVEL", "= SPIN/NUTATION", "is not read"),
    ("CCSDS_AEM_VERS = 2.0", "CCSDS_AEM_VERS = 1.0", "version"),
    ("DATA_STOP", "", "DATA_STOP"),
    ("REF_FRAME_A          = EME2000", "REF_FRAME_A          = MOON_ME", "no inertial frame"),
])  # fmt: skip
def test_faults_of_a_history_are_named(tmp_path: Path, old: str, new: str, problem: str) -> None:
    path, _ = exported(tmp_path, SPACECRAFT, "aem")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(FaultyFile, match=problem):
        read_history(str(path))


def test_records_out_of_order_and_of_wrong_length_are_faults_with_lines(tmp_path: Path) -> None:
    path, _ = exported(tmp_path, SPACECRAFT, "aem")
    lines = path.read_text().splitlines()
    first = lines.index("DATA_START") + 1
    lines[first], lines[first + 1] = lines[first + 1], lines[first]
    lines[first + 3] += " 1.0"
    for end in ("\n", "\r\n", "\r", "\n\r"):  # those of the standard
        path.write_bytes(end.join(lines).encode())
        with pytest.raises(FaultyFile) as wrong:
            read_history(str(path))
        assert [fault.line for fault in wrong.value.faults] == [first + 2, first + 4]


@pytest.mark.parametrize(("arguments", "status"), [
    (("import", "m.aem"), 2), (("import", "m.aem", "--at", "3s"), 2), (("import", "m.aem", "--inertia"), 2),
    (("import", "m.aem", "--into", "s.yaml", "--inertia"), 2),
    (("import", "m.aem", "--into", "s.yaml", "--at", "99s"), 2),
    (("import", "m.aem", "--into", "s.yaml", "--schedule", "p.csv"), 2),
])  # fmt: skip
def test_what_cannot_be_merged_is_refused(run: Run, tmp_path: Path, arguments: tuple[str, ...], status: int) -> None:
    path, _ = exported(tmp_path, SPACECRAFT, "aem")
    path.rename(tmp_path / "m.aem")
    (tmp_path / "s.yaml").write_text(SPACECRAFT)
    assert run(*arguments, "-o", "out.yaml").returncode == status
    assert not (tmp_path / "out.yaml").exists()


# --- by the direction of the spin axis, or of the angular momentum, and a phase about it

ANGLES = st.floats(-180.0, 180.0)
DECLINATIONS = st.floats(-89.0, 89.0)
TENSOR = "{tensor: [[120, 2, 1], [2, 110, 0.5], [1, 0.5, 80]]}"
SYMMETRIC = "{A: 120, C: 80}"


def body(given: str, *, spin: float = 3.0, inertia: str = SYMMETRIC, more: str = "") -> nutdamp.Spacecraft:
    return nutdamp.read(f"name: b\ninertia: {inertia}\nomega0: [0.1, -0.2, {spin}]\nattitude: {{{given}}}\n{more}")


def direction(right_ascension: float, declination: float) -> np.ndarray:
    ra, dec = math.radians(right_ascension), math.radians(declination)
    return np.array([math.cos(dec) * math.cos(ra), math.cos(dec) * math.sin(ra), math.sin(dec)])


def angle_about(axis: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    """Angle about an axis from one vector to another as they are seen along it, deg."""
    first, second = (vector - axis * (axis @ vector) for vector in (start, end))
    return math.degrees(math.atan2(axis @ np.cross(first, second), first @ second))


def same_angle(first: float, second: float) -> bool:
    return abs((first - second + 180.0) % 360.0 - 180.0) < 1e-7


@given(ANGLES, DECLINATIONS, ANGLES, st.sampled_from([3.0, -3.0]), st.sampled_from([SYMMETRIC, TENSOR]))
def test_the_phase_counts_from_the_ascending_node_to_body_axis_1(
    ra: float, dec: float, phase: float, spin: float, inertia: str
) -> None:
    spacecraft = body(f"spin_axis: [{ra} deg, {dec} deg], phase: {phase} deg", spin=spin, inertia=inertia)
    axis = direction(ra, dec)
    assert np.allclose(spacecraft.axis, axis, rtol=0.0, atol=1e-12)
    first = attitude.rotate(quaternion(spacecraft), np.array([1.0, 0.0, 0.0]))
    assert same_angle(angle_about(axis, np.cross([0.0, 0.0, 1.0], axis), first), phase)


@given(ANGLES, DECLINATIONS, st.sampled_from([3.0, -3.0]), st.sampled_from([SYMMETRIC, TENSOR]))
def test_it_may_be_that_of_the_angular_momentum(ra: float, dec: float, spin: float, inertia: str) -> None:
    spacecraft = body(f"spin_axis: [{ra} deg, {dec} deg], of: momentum", spin=spin, inertia=inertia)
    momentum = spacecraft.momentum / np.linalg.norm(spacecraft.momentum)
    assert np.allclose(momentum, direction(ra, dec), rtol=0.0, atol=1e-12)


@given(ANGLES, DECLINATIONS, ANGLES)
def test_the_phase_may_count_from_the_side_of_the_sun(ra: float, dec: float, phase: float) -> None:
    sun = (ra + 40.0, 0.5 * dec)
    given = f"spin_axis: [{ra} deg, {dec} deg], sun_phase: {phase} deg"
    spacecraft = body(given, more=f"sun: [{sun[0]} deg, {sun[1]} deg]")
    first = attitude.rotate(quaternion(spacecraft), np.array([1.0, 0.0, 0.0]))
    assert same_angle(angle_about(direction(ra, dec), direction(*sun), first), phase)


@pytest.mark.parametrize("dec", [90.0, -90.0])
def test_at_a_pole_the_phase_counts_from_x(dec: float) -> None:
    spacecraft = body(f"spin_axis: [10 deg, {dec} deg], phase: 30 deg")
    first = attitude.rotate(quaternion(spacecraft), np.array([1.0, 0.0, 0.0]))
    assert same_angle(
        angle_about(np.array([0.0, 0.0, math.copysign(1.0, dec)]), np.array([1.0, 0.0, 0.0]), first), 30.0
    )


def test_a_file_carried_on_holds_a_quaternion_instead() -> None:
    spacecraft = body("spin_axis: [120 deg, -15 deg], phase: 20 deg, epoch: 2026-03-01T12:00:00Z")
    carried = nutdamp.plan(spacecraft, "none").carried(10.0)
    flight = nutdamp.plan(spacecraft, "none").fly(10.0).track
    turned = attitude.multiply(attitude.conjugate(quaternion(carried)), flight.quaternion[-1])
    assert np.linalg.norm(turned[1:]) < 1e-10
    assert present(carried.attitude).epoch == "2026-03-01T12:00:10Z"
