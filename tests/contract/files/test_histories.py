"""Attitude histories of spinners: each kind is read, merged into files and fitted, and faults have
their line and field.
"""

import math
import re
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
from support.contract import Write, check_faults, check_parts, slips
from support.golden import check_text
from support.histories import STEP
from support.process import Run

import nutdamp
from nutdamp.errors import BadRequest, FaultyFile
from nutdamp.estimation.results import doubts
from nutdamp.files.ccsds.read import read_message
from nutdamp.files.ccsds.write import imported, merge
from nutdamp.files.reader import Source
from nutdamp.physics import attitude
from nutdamp.views.exchange import export_text

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
