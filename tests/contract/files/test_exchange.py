"""What is exported keeps the form of CCSDS 504.0-B-2 and 502.0-B-3; attitude histories."""

import ast
import csv
import io
import math
import re
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import simpson
from scipy.spatial.transform import Rotation
from support import messages, reference, spinners
from support.builders import aimed, channel, cross, events, present, spinner
from support.cases import spread
from support.contract import (
    CASES,
    PUSHED,
    VALVED,
    Write,
    motions,
    pushing,
    valved,
    velocity_change,
)
from support.golden import check_text, refusal

from nutdamp.common.time import Epoch
from nutdamp.errors import BadRequest
from nutdamp.files.ccsds.message import APM_BLOCKS
from nutdamp.files.ccsds.read import read_message
from nutdamp.files.ccsds.write import PRODUCTS, comment, label, number
from nutdamp.files.export import TURN, interpolated
from nutdamp.files.reader import read_spacecraft
from nutdamp.flight import propagation
from nutdamp.physics import attitude
from nutdamp.physics.thruster import Tank
from nutdamp.planning import plan as planning
from nutdamp.spacecraft.model import Disturbance, Inertia, Limits, Spacecraft
from nutdamp.spacecraft.schedule import Schedule, channel_pulse, on_command
from nutdamp.views.exchange import export_notes, export_text, lacking
from nutdamp.views.simulation import SPINS, spin_table

pytestmark = pytest.mark.usefixtures("plans_shared")

TANK = Tank(2.0, 22e5, 16e5, 1.0, inertia_per_kg=(0.4, 0.4, 0.3))


def varied(plan: planning.Plan, **fields: Any) -> planning.Plan:
    """The same schedule for a spacecraft with other fields."""
    return replace(plan, spacecraft=replace(plan.spacecraft, **fields))


@given(st.floats(-1e300, 1e300))
def test_numbers_have_sixteen_digits_and_read_back(value: float) -> None:
    text = number(value)
    assert re.fullmatch(r"-?[0-9]+\.[0-9]+|-?[0-9]\.[0-9]+E[+-][0-9]+", text)
    assert len(re.sub(r"E.*|[^0-9]", "", text)) <= 16
    assert float(text) == pytest.approx(value, rel=6e-16, abs=0.0)
    assert number(float(text)) == text


def test_numbers_and_texts_are_short_and_plain() -> None:
    short = {
        -0.0: "0.0",
        120.0: "120.0",
        0.25: "0.25",
        1e-9: "0.000000001",
        -2e-5: "-0.00002",
        1e22: "1.0E+22",
    }
    assert {value: number(value) for value in short} == short
    assert label("  Überflieger-1\tα ") == "UBERFLIEGER-1"
    assert label("卫星") == "UNKNOWN"
    assert comment("a\nb" + 300 * "é") == "a b" + 243 * "e"


@CASES
def test_lines_keywords_and_both_notations(case: str) -> None:
    plan = messages.planned(case)
    apm, aem = export_text(plan, "apm"), export_text(plan, "aem")
    for line in (*apm.splitlines(), *aem.splitlines()):
        assert (line.isascii() and line.isprintable(), len(line) <= 254) == (True, True)
    assert "[" not in aem  # units are not written in this message
    starts = re.findall("^([A-Z]+)_START$", apm, re.MULTILINE)
    expected = [
        "QUAT",
        "ANGVEL",
        *(["SPIN"] if plan.spacecraft.inertia.symmetric else []),
        "INERTIA",
    ]
    assert starts == [*expected, *["MAN"] * len(plan.pulses)]
    for name in set(starts):
        for body in re.findall(f"^{name}_START$(.*?)^{name}_STOP$", apm, re.MULTILINE | re.DOTALL):
            keywords = re.findall("^([A-Z0-9_]+) *=", body, re.MULTILINE)
            expected = [
                keyword.name
                for keyword in APM_BLOCKS[name].keywords
                if keyword.required or keyword.name in keywords
            ]
            assert keywords == expected
            assert "COMMENT" not in body.split("=", 1)[1]
    pairs = re.findall(r"^([A-Z0-9_]+) *= (.*?)(?: \[.*\])?$", apm, re.MULTILINE)
    top = (
        "CCSDS_APM_VERS CREATION_DATE ORIGINATOR MESSAGE_ID OBJECT_NAME OBJECT_ID TIME_SYSTEM EPOCH"
    )
    assert " ".join(keyword for keyword, _ in pairs[:8]) == top
    # The other notation holds the same.
    root = ElementTree.fromstring(export_text(plan, "apm", xml=True).split("\n", 1)[1])
    assert root.attrib == {"id": "CCSDS_APM_VERS", "version": "2.0"}
    leaves = [leaf for leaf in root.iter() if leaf.tag != "COMMENT"]
    tagged = [(leaf.tag, leaf.text) for leaf in leaves if leaf.text and leaf.text.strip()]
    volatile = ("CREATION_DATE", "MESSAGE_ID")
    plain, other = (
        [pair for pair in found if pair[0] not in volatile] for found in (pairs[1:], tagged)
    )
    assert plain == other
    root = ElementTree.fromstring(export_text(plan, "aem", xml=True).split("\n", 1)[1])
    states = [
        " ".join(leaf.text or "" for leaf in state.iter() if not len(leaf))
        for state in root.iter("attitudeState")
    ]
    assert states == re.findall(r"^([0-9]{4}-\S+ .*)$", aem, re.MULTILINE)


def test_names_epochs_and_products_of_inertia_are_those_of_the_standard() -> None:
    said = {
        "prolate": ["OBJECT_ID   = UNKNOWN"],
        "steerable-stage": ["EPOCH = 2026-03-01T12:00:00.250000000"],
        "tilted tensor, backwards": [
            *("OBJECT_NAME = TILTED", "OBJECT_ID   = 2026-031A"),
            f"COMMENT {PRODUCTS}",
        ],
    }
    for name, lines in said.items():
        text = export_text(messages.planned(name), "apm")
        assert {*lines} <= {*text.splitlines()}
    tensor = dict(re.findall(r"^(I[XYZ]{2}) *= (\S+)", text, re.MULTILINE))
    assert tensor == {
        "IXX": "120.0",
        "IYY": "104.0",
        "IZZ": "80.0",
        "IXY": "-3.0",
        "IXZ": "-6.0",
        "IYZ": "4.0",
    }


def test_what_a_message_leaves_out_is_said() -> None:
    plan = messages.planned("prolate")
    usual = export_text(plan, "apm").splitlines()
    disturbed = varied(plan, disturbances=(Disturbance(0.01 + 0j),), dissipation=600.0)
    tilted = messages.planned("tilted tensor, backwards")
    wheeled = varied(plan, inertia=replace(plan.spacecraft.inertia, wheel=-4.0))
    heads = (
        export_text(other, "apm").partition("MAN_START")[0]
        for other in (disturbed, varied(plan, tank=TANK), tilted, wheeled)
    )
    comments = (
        line for head in heads for line in re.findall("^COMMENT (?!nutdamp).*", head, re.MULTILINE)
    )
    check_text("files.apm-comments", "\n".join(line for line in comments if line not in usual))


@pytest.mark.parametrize("xml", [False, True])
@pytest.mark.parametrize("form", ["apm", "opm"])
def test_comments_say_what_is_commanded_and_that_the_keywords_are_the_thrust(
    form: str, xml: bool
) -> None:
    plan = valved()
    text = export_text(plan, form, xml=xml)
    assert len(plan.pulses) > 1
    for pulse in plan.pulses:
        assert present(pulse.command).on_time == pytest.approx(pulse.on_time + 7e-3)
        utc = (plan.spacecraft.utc(present(pulse.command).start) or "").removesuffix("Z")
        assert f"Commanded: {present(pulse.command).on_time:.9g} s from {utc} on." in text
        assert f"those of the thrust: {pulse.on_time:.9g} s at the torque given." in text
    assert "Commanded" not in export_text(
        planning.plan(read_spacecraft(VALVED, "f.yaml"), "one-pulse"), form, xml=xml
    )


# --- orbit parameter messages
# ----------------------------------------------------------------------------------------


def manoeuvres(text: str) -> list[dict[str, str]]:
    """Keywords and values of each manoeuvre of a message in KVN."""
    parts = text.split("COMMENT pulse ")[1:]
    return [dict(re.findall(r"^(MAN_\w+) += (\S+)", part, re.MULTILINE)) for part in parts]


@spread("name", PUSHED[::-1], quick=1, deep=2)
def test_velocity_changes_are_those_of_each_pulse(name: str) -> None:
    plan = pushing(name)
    written = manoeuvres(export_text(plan, "opm"))
    assert len(written) == len(plan.pulses) > 1
    total = np.zeros(3)
    for manoeuvre, pulse in zip(written, plan.pulses, strict=True):
        velocity = 1e3 * np.array([float(manoeuvre[f"MAN_DV_{axis}"]) for axis in (1, 2, 3)])
        assert velocity == pytest.approx(velocity_change(plan, pulse), rel=1e-7, abs=1e-12)
        assert float(manoeuvre["MAN_DURATION"]) == pytest.approx(pulse.on_time, rel=1e-15)
        assert float(manoeuvre["MAN_DELTA_MASS"]) == pytest.approx(
            -present(pulse.propellant), rel=1e-15
        )
        total += velocity
    assert total == pytest.approx(present(plan._delta_v), rel=1e-9, abs=1e-15)


def test_without_an_orbit_only_the_manoeuvres_are_written() -> None:
    plans = [pushing("couples-minisat", orbit=orbit) for orbit in (True, False)]
    whole, part = (export_text(plan, "opm") for plan in plans)
    assert lacking(plans[0], "opm") is None
    keywords = [re.findall(r"^(\w+) +=", text, re.MULTILINE) for text in (whole, part)]
    state = ["EPOCH", "X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT"]
    assert [word for word in keywords[0] if word not in (*state, "CENTER_NAME")] == keywords[1]
    head = [
        "CREATION_DATE",
        "ORIGINATOR",
        "MESSAGE_ID",
        "OBJECT_NAME",
        "OBJECT_ID",
        "CENTER_NAME",
        "REF_FRAME",
    ]
    assert keywords[0][:17] == ["CCSDS_OPM_VERS", *head, "TIME_SYSTEM", *state, "MASS"]
    assert manoeuvres(whole) == manoeuvres(part)
    only = [line for line in part.splitlines() if line.startswith("COMMENT") and line not in whole]
    check_text("files.opm-without-orbit", "\n".join([*only, lacking(plans[1], "opm") or ""]))
    assert "<stateVector>" not in export_text(plans[1], "opm", xml=True)


# --- what cannot be exported
# -----------------------------------------------------------------------------------------


def test_what_cannot_be_exported_is_refused() -> None:
    plan = messages.planned("prolate")
    ideal = planning.plan(replace(messages.spacecraft("prolate"), steerable=None), "two-pulse")
    assert "2026-03-01T12" in export_text(ideal, "aem")
    attitude = present(plan.spacecraft.attitude)
    brake = channel("brake", 0.0, 0.0, -400.0)
    halted = Schedule((channel_pulse(brake, 0.4, 0.6),))  # 80 kg m² × 3 rad/s = 400 N m × 0.6 s
    orbital = {
        name: planning.plan(read_spacecraft(VALVED.replace(*edit), "f.yaml"), "four-pulse")
        for name, edit in {
            "velocity not known": (
                "position: [0, 0.5, 0.8], direction: [1, 0, 0], force: 10 N",
                "torque: [8, 0, 0]",
            ),
            "propellant not known": (
                "direction: [1, 0, 0], force: 10 N, isp: 220 s",
                "direction: [1, 0, 0], force: 10 N",
            ),
            "no mass": ("mass: 250 kg\n", ""),
        }.items()
    }
    cases: dict[str, tuple[planning.Plan, str, dict[str, Any]]] = {
        "an ideal impulse": (ideal, "apm", {}),
        **{
            f"no attitude, {form}": (varied(plan, attitude=None), form, {})
            for form in ("apm", "aem", "stk")
        },
        "no epoch": (varied(plan, attitude=replace(attitude, epoch=None)), "apm", {}),
        "a frame that no format knows": (
            varied(plan, attitude=replace(attitude, frame="TEME")),
            "apm",
            {},
        ),
        "XML for STK": (plan, "stk", {"xml": True}),
        "an end of an APM": (plan, "apm", {"until": 3.0}),
        "a late end": (plan, "aem", {"until": 1e7}),
        "after the year 9999": (plan, "aem", {"until": 1e12}),
        **{name: (other, "opm", {}) for name, other in orbital.items()},
        "very many spins": (
            planning.Plan(spinner(), "none", Schedule()),
            "spin-table",
            {"until": 1e6},
        ),
        "no spin": (
            planning.Plan(spinner(degrees=0.0, channels=(brake,)), "by hand", halted),
            "spin-table",
            {"until": 1.0},
        ),
        "dissipation for Basilisk": (varied(plan, dissipation=600.0), "basilisk", {}),
        "falling moments for Basilisk": (varied(plan, tank=TANK), "basilisk", {}),
    }
    said = (
        f"{name}: {refusal(BadRequest, export_text, other, form, **options)}"
        for name, (other, form, options) in cases.items()
    )
    check_text(
        "files.not-exported", re.sub("[0-9]{8,} records", "very many records", "\n".join(said))
    )


# --- the script for Basilisk, which tests/optional/basilisk runs
# -----------------------------------------------------


def test_it_is_python_with_the_schedule_in_the_axes_of_the_file() -> None:
    plan = messages.planned("tilted tensor, backwards")
    tank = Tank(2.0, 22e5, 16e5, 1.0)
    named = replace(
        plan, spacecraft=replace(plan.spacecraft, name='a """ name \\ of {many} parts', tank=tank)
    )
    tree = ast.parse(export_text(named, "basilisk"))
    values = {
        node.targets[0].id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    schedule = ast.literal_eval(values["SCHEDULE"])
    firing = [(duration, torque) for name, duration, torque in schedule if name != "coast"]
    for (duration, torque), pulse in zip(firing, plan.pulses, strict=True):
        assert duration == pytest.approx(pulse.on_time, rel=1e-12)
        in_file = messages.in_file_axes(plan.spacecraft, present(pulse.torque))
        assert torque == pytest.approx(in_file, rel=1e-12, abs=1e-12)
    assert sum(duration for _, duration, _ in schedule) == pytest.approx(plan.pulses.end, rel=1e-14)


@pytest.mark.parametrize(
    "moments", [(100.0, 130.0, 180.0), (130.0, 100.0, 80.0), (120.0, 120.0, 80.0)]
)
def test_the_cones_that_the_script_prints_are_those_of_the_residual(
    moments: tuple[float, float, float],
) -> None:
    """The function alone, as it stands in the script."""
    parsed = ast.parse(export_text(messages.planned("prolate"), "basilisk"))
    (cones,) = (
        node
        for node in parsed.body
        if isinstance(node, ast.FunctionDef) and node.name == "largest_cones"
    )
    names: dict[str, Any] = {"math": math, "PRINCIPAL_MOMENTS": np.array(moments)}
    exec(compile(ast.Module([cones], []), "fly.py", "exec"), names)
    for rates in ([0.4, 0.1, 2.0], [0.1, -0.4, -2.0], [1e-6, 1e-7, 2.0]):
        for sense in (1.0, -1.0):
            expected = tuple(Inertia(moments).cones(np.array(rates), sense))
            assert names["largest_cones"](np.array(rates), sense) == pytest.approx(
                expected, rel=1e-9
            )


# --- histories of the attitude: fine enough for whoever interpolates, and the motion of the
# integrator

HEADER = [column.key for column in SPINS]


def flown_on(plan: planning.Plan) -> propagation.Flight:
    """The flight to the end of a track."""
    return propagation.flown(
        plan.spacecraft, plan.pulses, plan.pulses.end + plan.spacecraft.inertial_period
    )


@CASES
def test_records_are_close_and_continuous(case: str) -> None:
    flown = flown_on(messages.planned(case))
    track = list(interpolated(flown, flown.legs[-1].end))
    assert track[0].t[0] == 0.0
    assert track[-1].t[-1] == pytest.approx(flown.legs[-1].end, abs=0.51e-9)
    for one, two in pairwise(track):
        assert two.t[0] == pytest.approx(one.t[-1], abs=4e-9)
    quaternion = np.concatenate([stretch.quaternion for stretch in track])
    assert np.all(np.sum(quaternion[1:] * quaternion[:-1], axis=1) > 0.9)  # no jumps of sign
    ends = [pulse.end for pulse in flown.schedule]
    worst = 0.0
    for stretch in track:
        assert stretch.completed == sum(end <= stretch.t[0] + 1e-9 for end in ends)
        assert len(stretch.t) >= 4
        assert np.all(np.diff(stretch.t) > 0.0)
        assert stretch.t.tolist() == (np.rint(stretch.t * 1e9) / 1e9).tolist()
        turns = np.linalg.norm(stretch.rates, axis=1)[1:] * np.diff(stretch.t)
        assert turns.max() <= 1.02 * TURN < math.radians(18.0)
        # Readers that look at quaternions only take one turn about a fixed axis from record to
        # record.
        middle = stretch.quaternion[1:] + stretch.quaternion[:-1]  # half of the turn
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        leg = next(
            leg
            for leg in flown.legs
            if leg.start - 1e-9 <= stretch.t[0] and stretch.t[-1] <= leg.end + 1e-9
        )
        _, truth = leg.path.motion(0.5 * (stretch.t[1:] + stretch.t[:-1]))
        for one, two in zip(middle, truth, strict=True):
            worst = max(
                worst,
                messages.turned(attitude.matrix(one), messages.columns(flown.spacecraft, two)),
            )
    assert worst <= 0.01


@CASES
@pytest.mark.parametrize("form", ["aem", "aem-spin", "stk"])
def test_histories_have_the_motion_through_the_pulses(case: str, form: str, write: Write) -> None:
    """By the reader, which other histories hold that are not nutdamp's, and the
    reference integrator; edges of pulses are among the records.
    """
    plan = messages.planned(case)
    body = plan.spacecraft
    contents = read_message(str(write(export_text(plan, form), "history.txt")))
    times, axes = contents.times, body.inertia.axes
    assert contents.epoch == Epoch.parse(present(present(body.attitude).epoch))
    assert (contents.frame == "GCRF") == (present(body.attitude).frame == "GCRF")
    edges = np.array([edge for pulse in plan.pulses for edge in (pulse.start, pulse.end)])
    assert np.abs(times[:, None] - edges).min(axis=0).max() <= 0.51e-9
    columns = messages.columns(body, body.initial.quaternion) @ axes
    moved = motions(body, plan.pulses, times[::6].tolist(), columns)
    alone = form == "aem-spin" and not body.inertia.symmetric
    for motion, turn, rates in zip(
        moved, contents.quaternions[::6], contents.rates[::6], strict=True
    ):
        assert reference.turned(motion.rotation @ axes.T, attitude.matrix(turn)) <= 2e-8
        told = ~np.isnan(rates)
        assert told.tolist() == [not alone, not alone, True]
        assert rates[told] == pytest.approx(axes[told] @ motion.rates, abs=4e-8)


def test_ideal_impulses_let_the_rates_jump_within_a_nanosecond(write: Write) -> None:
    plan = planning.plan(replace(messages.spacecraft("prolate"), steerable=None), "two-pulse")
    assert all(pulse.torque is None for pulse in plan.pulses)
    contents = read_message(str(write(export_text(plan, "stk"), "history.a")))
    jumps = np.flatnonzero(np.diff(contents.times) < 1e-8)
    assert contents.times[jumps] == pytest.approx([pulse.t for pulse in plan.pulses if pulse.t])
    changes = [pulse.impulse / plan.spacecraft.inertia.moments for pulse in plan.pulses if pulse.t]
    assert contents.rates[jumps + 1] - contents.rates[jumps] == pytest.approx(
        np.array(changes), abs=1e-8
    )


def test_only_a_message_without_nutation_is_remarked_upon() -> None:
    """That of three moments, and of a symmetry axis 1 deg off the third axis of the file."""
    turn = Rotation.from_euler("X", 1.0, degrees=True).as_matrix()
    tensor = (turn @ np.diag([120.0, 120.0, 80.0]) @ turn.T).tolist()
    leaning = messages.BODIES["prolate"].replace("{A: 120, C: 80}", f"{{tensor: {tensor}}}")
    plans = [
        messages.planned("prolate"),
        messages.planned("tilted tensor, backwards"),
        planning.Plan(read_spacecraft(leaning, "leaning"), "none", Schedule()),
    ]
    codes = [[note.code for note in export_notes(plan, "aem-spin")] for plan in plans]
    assert codes == [[], ["spin-alone"], ["spin-alone"]]
    assert export_notes(plans[1], "aem") == []


# --- a schedule spin by spin
# -----------------------------------------------------------------------------------------

SUNLIT = spinners.FILE.replace("C: 180", "C: 150")


def table(text: str) -> list[dict[str, str]]:
    assert text.splitlines()[0] == ",".join(HEADER)
    return list(csv.DictReader(io.StringIO(text)))


def turned(body: Spacecraft, pulses: Schedule, ends: list[float]) -> Iterable[float]:
    """∫ω3 dt from 0 to each of ``ends`` s by Simpson on the reference integrator, rad."""
    inner = (edge for pulse in pulses for edge in (pulse.start, pulse.end) if edge < ends[-1])
    grids = [
        np.linspace(a, b, 2 * math.ceil(60 * (b - a)) + 41)
        for a, b in pairwise(sorted({0.0, *ends, *inner}))
    ]
    moved = iter(motions(body, pulses, np.concatenate(grids).tolist(), np.eye(3)))
    total = 0.0
    for grid in grids:
        total += float(simpson([next(moved).rates[2] for _ in grid], x=grid))
        if grid[-1] in ends:
            yield total


@pytest.mark.parametrize(
    ("moments", "spin"),
    [((120.0, 120.0, 80.0), 3.0), ((120.0, 120.0, 80.0), -3.0), ((100.0, 116.0, 140.0), 3.0)],
)
def test_a_spin_is_a_turn_about_axis_3_and_a_phase_the_angle_since_it_began(
    moments: tuple[float, float, float], spin: float
) -> None:
    """With thrusters that change the spin, and for a body on whose arcs ω3 waves; the phase is not
    the share of the time of a spin, never 360, and none at its end.
    """
    screw = channel("screw", 6.0, 0.0, math.copysign(9.0, spin))
    body = spinner(spin=spin, moments=moments, degrees=8.0, channels=(screw,))
    turn = 2.0 * math.pi / abs(spin)
    times = (turn * (1.0 - 1e-13), 2.2 * turn, 3.3 * turn)
    pulses = Schedule(tuple(channel_pulse(screw, t + 0.4, 0.8) for t in times))
    rows = table(spin_table(body, pulses, 9.0))
    starts, periods = ([float(row[name]) for row in rows] for name in ("start_s", "period_s"))
    assert len(rows) > 4
    assert starts[-1] <= 9.0 < starts[-1] + periods[-1]
    assert [(row["spin"], row["start_utc"]) for row in rows] == [
        (str(number + 1), "") for number in range(len(rows))
    ]
    ends = [start + period for start, period in zip(starts, periods, strict=True)]
    angles = [abs(angle) for angle in turned(body, pulses, ends)]
    assert angles == pytest.approx([turn * abs(spin) * (n + 1) for n in range(len(rows))], abs=2e-8)
    assert abs(periods[-1] / periods[0] - 1.0) > 0.01
    fired = [(index, float(row["phase_deg"])) for index, row in enumerate(rows) if row["channel"]]
    assert len(fired) == 3
    if moments[0] == moments[1]:
        begun = turned(body, pulses, [pulse.start for pulse in pulses])
        whole = [360.0 * index + phase for index, phase in fired]
        assert whole == pytest.approx([abs(math.degrees(angle)) for angle in begun], abs=1e-7)
        assert fired[0] == (1, 0.0)


def test_every_pulse_is_in_its_spin() -> None:
    """With its phase, also several in one spin."""
    body = aimed(
        spinner(degrees=0.0, channels=cross(60.0), limits=Limits(earliest=7.0)), 12.0, 45.0
    )
    plan = planning.plan(body, "rhumb-line")
    rows = table(export_text(plan, "spin-table"))
    fired: list[tuple[str, float, float]] = []
    for row in rows:
        cells = [row[name].split("; ") if row[name] else [] for name in HEADER[-3:]]
        assert [len(cell) for cell in cells] == 3 * [int(row["pulses"])]
        for name, phase, on_time in zip(*cells, strict=True):
            start = float(row["start_s"]) + float(row["period_s"]) * float(phase) / 360.0
            fired.append((name, start, float(on_time)))
    expected = [(pulse.channel, pulse.start, pulse.on_time) for pulse in plan.pulses]
    assert [name for name, *_ in fired] == [name for name, *_ in expected]
    times = np.array([numbers for _, *numbers in fired])
    assert times == pytest.approx(np.array([numbers for _, *numbers in expected]), abs=1e-8)
    assert float(rows[-1]["start_s"]) < expected[-1][1]


def sun_azimuth(body: Spacecraft, pulses: Schedule, time: float) -> float:
    """Azimuth of the Sun in the body, deg, by the reference integrator."""
    moved = reference.fly(body.inertia.moments, body.omega0, events(pulses), time, np.eye(3))
    seen = moved.rotation.T @ present(body.sun)
    return math.degrees(math.atan2(seen[1], seen[0]))


def test_with_a_sensor_spins_are_counted_by_sun_pulses() -> None:
    """At each the Sun is at the azimuth of the sensor,
    and blocks are numbered and delayed alike.
    """
    body = read_spacecraft(SUNLIT, "sunlit.yaml")
    goal = replace(body.goal, axis=np.array([0.0, math.sin(0.03), math.cos(0.03)]))
    plan = planning.plan(replace(body, goal=goal), "command-block")
    assert plan.feasible
    rows = table(export_text(plan, "spin-table"))
    assert [rows[0][name] for name in HEADER[:3]] == ["0", "1998-01-07T12:00:00.000000000Z", "0.0"]
    for row in rows[1::3]:
        seen = sun_azimuth(body, plan.pulses, float(row["start_s"]))
        assert seen == pytest.approx(35.0, abs=1e-6)
    fired = {int(row["spin"]): row for row in rows if row["pulses"] != "0"}
    blocks = plan.pulses.blocks
    assert sorted(fired) == [
        block.first + index * block.every for block in blocks for index in range(block.count)
    ]
    row = fired[blocks[0].first]
    assert plan.pulses[0].start - float(row["start_s"]) == pytest.approx(blocks[0].delay, abs=1e-8)
    seen = sun_azimuth(body, plan.pulses, plan.pulses[0].start)
    assert float(row["phase_deg"]) == pytest.approx((35.0 - seen) % 360.0, abs=1e-6)
    assert float(row["on_time_s"]) == pytest.approx(blocks[0].width, rel=1e-12)


def test_a_pulse_before_the_first_sun_pulse_is_in_spin_0_and_commands_are_those_of_valves() -> None:
    body = read_spacecraft(SUNLIT, "sunlit.yaml")
    (row,) = table(spin_table(body, Schedule((channel_pulse(body.channels[0], 0.3, 0.2),)), 1.0))
    period = float(row["period_s"])
    assert row["spin"] == "0"
    assert period == pytest.approx(5.0, rel=1e-3)
    first = float(table(spin_table(body, Schedule(), 1.0 + period))[1]["start_s"])
    assert float(row["phase_deg"]) == pytest.approx(360.0 * (1.0 - (first - 0.2) / period), abs=1.0)
    # Through valves on-times and phases are those commanded.
    valve = "valve: {open_delay: 15 ms, close_delay: 5 ms, rise_time: 10 ms, fall_time: 2 ms}\n"
    body = read_spacecraft(SUNLIT + valve, "sunlit.yaml")
    pulse = on_command(body.channels[0], 6.0, 0.2)
    assert pulse.on_time == pytest.approx(0.186, rel=1e-12)
    (row,) = [
        row for row in table(spin_table(body, Schedule((pulse,)), 10.0)) if row["pulses"] == "1"
    ]
    assert float(row["on_time_s"]) == 0.2
    phase = 35.0 - sun_azimuth(body, Schedule(), 6.0)
    assert float(row["phase_deg"]) == pytest.approx(phase % 360.0, abs=1e-6)
