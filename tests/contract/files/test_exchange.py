"""What is exported keeps the form of CCSDS 504.0-B-2 and 502.0-B-3, both notations alike; what cannot be is refused."""

from __future__ import annotations

import ast
import math
import re
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import messages
from support.builders import channel, spinner
from support.cases import spread
from support.contract import CASES, PUSHED, VALVED, known, pushing, valved, velocity_change
from support.golden import check_text

from nutdamp.errors import BadRequest
from nutdamp.files.ccsds.message import APM_BLOCKS, comment, label, number
from nutdamp.files.reader import read_spacecraft
from nutdamp.physics.thruster import Tank
from nutdamp.physics.triaxial import arc_cones
from nutdamp.planning import plan as planning
from nutdamp.planning.plan import Plan
from nutdamp.spacecraft.model import Disturbance
from nutdamp.spacecraft.schedule import Schedule, channel_pulse
from nutdamp.views.exchange import export_text, lacking

pytestmark = pytest.mark.usefixtures("plans_shared")

TANK = Tank(2.0, 22e5, 16e5, 1.0, inertia_per_kg=(0.4, 0.4, 0.3))


def varied(plan: Plan, **fields: Any) -> Plan:
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
    short = {-0.0: "0.0", 120.0: "120.0", 0.25: "0.25", 1e-9: "0.000000001", -2e-5: "-0.00002", 1e22: "1.0E+22"}
    assert {value: number(value) for value in short} == short
    assert label("  Überflieger-1\tα ") == "UBERFLIEGER-1"
    assert label("卫星") == "UNKNOWN"
    assert comment("a\nb" + 300 * "é") == "a b" + 243 * "e"


@CASES
def test_lines_keywords_and_both_notations(case: str) -> None:
    plan = messages.planned(case)
    apm, aem = export_text(plan, "apm"), export_text(plan, "aem")
    for line in (*apm.splitlines(), *aem.splitlines()):
        assert len(line) <= 254
        assert line.isascii()
        assert line.isprintable()
    assert "[" not in aem  # units are not written in this message
    starts = re.findall("^([A-Z]+)_START$", apm, re.MULTILINE)
    expected = ["QUAT", "ANGVEL", *(["SPIN"] if plan.spacecraft.inertia.symmetric else []), "INERTIA"]
    assert starts == [*expected, *["MAN"] * len(plan.pulses)]
    for name in set(starts):
        for body in re.findall(f"^{name}_START$(.*?)^{name}_STOP$", apm, re.MULTILINE | re.DOTALL):
            keywords = re.findall("^([A-Z0-9_]+) *=", body, re.MULTILINE)
            allowed = [keyword.name for keyword in APM_BLOCKS[name].keywords]
            assert keywords == [keyword for keyword in allowed if keyword in keywords]
            assert {keyword.name for keyword in APM_BLOCKS[name].keywords if keyword.required} <= set(keywords)
            assert "COMMENT" not in body.split("=", 1)[1]
    pairs = re.findall(r"^([A-Z0-9_]+) *= (.*?)(?: \[.*\])?$", apm, re.MULTILINE)
    top = "CCSDS_APM_VERS CREATION_DATE ORIGINATOR MESSAGE_ID OBJECT_NAME OBJECT_ID TIME_SYSTEM EPOCH"
    assert " ".join(keyword for keyword, _ in pairs[:8]) == top
    # The other notation holds the same.
    root = ElementTree.fromstring(export_text(plan, "apm", xml=True).split("\n", 1)[1])
    assert root.attrib == {"id": "CCSDS_APM_VERS", "version": "2.0"}
    leaves = [leaf for leaf in root.iter() if leaf.tag != "COMMENT"]
    tagged = [(leaf.tag, leaf.text) for leaf in leaves if leaf.text and leaf.text.strip()]
    volatile = ("CREATION_DATE", "MESSAGE_ID")
    plain, other = ([pair for pair in found if pair[0] not in volatile] for found in (pairs[1:], tagged))
    assert plain == other
    root = ElementTree.fromstring(export_text(plan, "aem", xml=True).split("\n", 1)[1])
    states = [
        " ".join(leaf.text or "" for leaf in state.iter() if not len(leaf)) for state in root.iter("attitudeState")
    ]
    assert states == re.findall(r"^([0-9]{4}-\S+ .*)$", aem, re.MULTILINE)


def test_names_epochs_and_products_of_inertia_are_those_of_the_standard() -> None:
    text = export_text(messages.planned("tilted tensor, backwards"), "apm")
    assert "OBJECT_NAME = TILTED" in text
    assert "OBJECT_ID   = 2026-031A" in text
    assert "OBJECT_ID   = UNKNOWN" in export_text(messages.planned("prolate"), "apm")
    assert "EPOCH = 2026-03-01T12:00:00.250000000" in export_text(messages.planned("steerable-stage"), "apm")
    tensor = dict(re.findall(r"^(I[XYZ]{2}) *= (\S+)", text, re.MULTILINE))
    assert tensor == {"IXX": "120.0", "IYY": "104.0", "IZZ": "80.0", "IXY": "-3.0", "IXZ": "-6.0", "IYZ": "4.0"}


def test_sixty_rpm_of_a_flat_body_spin_backwards_about_the_axis() -> None:
    """C/A = 1.5 at 360 deg/s: the body turns at -180 deg/s about its axis, which turns about H."""
    body = messages.spacecraft("oblate")
    text = export_text(Plan(replace(body, omega0=body.omega0 * 2.0), "none", Schedule()), "apm")
    (about_axis,) = re.findall(r"SPIN_ANGLE_VEL = (\S+)", text)
    assert float(about_axis) == pytest.approx(-180.0, rel=1e-14)
    assert "MAN_START" not in text


def test_what_a_message_leaves_out_is_said() -> None:
    plan = messages.planned("prolate")
    usual = export_text(plan, "apm").splitlines()
    disturbed = varied(plan, disturbances=(Disturbance(0.01 + 0j),), dissipation=600.0)
    tilted = messages.planned("tilted tensor, backwards")
    said = []
    wheeled = varied(plan, inertia=replace(plan.spacecraft.inertia, wheel=-4.0))
    for other in (disturbed, varied(plan, tank=TANK), tilted, wheeled):
        lines = export_text(other, "apm").partition("MAN_START")[0].splitlines()
        said += [line for line in lines if re.match("COMMENT (?!nutdamp)", line) and line not in usual]
    check_text("files.apm-comments", "\n".join(said))


@pytest.mark.parametrize("xml", [False, True])
@pytest.mark.parametrize("form", ["apm", "opm"])
def test_comments_say_what_is_commanded_and_that_the_keywords_are_the_thrust(form: str, xml: bool) -> None:
    plan = valved()
    text = export_text(plan, form, xml=xml)
    assert len(plan.pulses) > 1
    for pulse in plan.pulses:
        assert known(pulse.command).on_time == pytest.approx(pulse.on_time + 7e-3)
        utc = (plan.spacecraft.utc(known(pulse.command).start) or "").removesuffix("Z")
        assert f"Commanded: {known(pulse.command).on_time:.9g} s from {utc} on." in text
        assert f"those of the thrust: {pulse.on_time:.9g} s at the torque given." in text
    assert "Commanded" not in export_text(planning.plan(read_spacecraft(VALVED, "f.yaml"), "one-pulse"), form, xml=xml)


# --- orbit parameter messages ----------------------------------------------------------------------------------------


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
        assert float(manoeuvre["MAN_DELTA_MASS"]) == pytest.approx(-known(pulse.propellant), rel=1e-15)
        total += velocity
    assert total == pytest.approx(known(plan.delta_v), rel=1e-9, abs=1e-15)


def test_without_an_orbit_only_the_manoeuvres_are_written() -> None:
    plans = [pushing("couples-minisat", orbit=orbit) for orbit in (True, False)]
    whole, part = (export_text(plan, "opm") for plan in plans)
    assert lacking(plans[0], "opm") is None
    keywords = [re.findall(r"^(\w+) +=", text, re.MULTILINE) for text in (whole, part)]
    state = ["EPOCH", "X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT"]
    assert [word for word in keywords[0] if word not in (*state, "CENTER_NAME")] == keywords[1]
    head = ["CREATION_DATE", "ORIGINATOR", "MESSAGE_ID", "OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME"]
    assert keywords[0][:17] == ["CCSDS_OPM_VERS", *head, "TIME_SYSTEM", *state, "MASS"]
    assert manoeuvres(whole) == manoeuvres(part)
    only = [line for line in part.splitlines() if line.startswith("COMMENT") and line not in whole]
    check_text("files.opm-without-orbit", "\n".join([*only, lacking(plans[1], "opm") or ""]))
    assert "<stateVector>" not in export_text(plans[1], "opm", xml=True)


# --- what cannot be exported -----------------------------------------------------------------------------------------

ORBITAL = {
    "velocity not known": ("position: [0, 0.5, 0.8], direction: [1, 0, 0], force: 10 N", "torque: [8, 0, 0]"),
    "propellant not known": ("direction: [1, 0, 0], force: 10 N, isp: 220 s", "direction: [1, 0, 0], force: 10 N"),
    "no mass": ("mass: 250 kg\n", ""),
}


def test_what_cannot_be_exported_is_refused() -> None:
    plan = messages.planned("prolate")
    ideal = planning.plan(replace(messages.spacecraft("prolate"), steerable=None), "two-pulse")
    assert "2026-03-01T12" in export_text(ideal, "aem")
    attitude = known(plan.spacecraft.attitude)
    brake = channel("brake", 0.0, 0.0, -400.0)
    halted = Schedule((channel_pulse(brake, 0.4, 0.6),))  # 80 kg m² × 3 rad/s = 400 N m × 0.6 s
    orbital = {
        name: planning.plan(read_spacecraft(VALVED.replace(*edit), "f.yaml"), "four-pulse")
        for name, edit in ORBITAL.items()
    }
    cases: dict[str, tuple[Plan, str, dict[str, Any]]] = {
        "an ideal impulse": (ideal, "apm", {}),
        **{f"no attitude, {form}": (varied(plan, attitude=None), form, {}) for form in ("apm", "aem", "stk")},
        "no epoch": (varied(plan, attitude=replace(attitude, epoch=None)), "apm", {}),
        "a frame that no format knows": (varied(plan, attitude=replace(attitude, frame="TEME")), "apm", {}),
        "XML for STK": (plan, "stk", {"xml": True}),
        "an end of an APM": (plan, "apm", {"until": 3.0}),
        "a late end": (plan, "aem", {"until": 1e7}),
        "after the year 9999": (plan, "aem", {"until": 1e12}),
        **{name: (other, "opm", {}) for name, other in orbital.items()},
        "very many spins": (Plan(spinner(), "none", Schedule()), "spin-table", {"until": 1e6}),
        "no spin": (Plan(spinner(degrees=0.0, channels=(brake,)), "by hand", halted), "spin-table", {"until": 1.0}),
        "dissipation for Basilisk": (varied(plan, dissipation=600.0), "basilisk", {}),
        "falling moments for Basilisk": (varied(plan, tank=TANK), "basilisk", {}),
    }
    said = []
    for name, (other, form, options) in cases.items():
        with pytest.raises(BadRequest) as refused:
            export_text(other, form, **options)
        said.append(f"{name}: {refused.value}")
    check_text("files.not-exported", re.sub("[0-9]{8,} records", "very many records", "\n".join(said)))


# --- the script for Basilisk, which tests/optional/basilisk runs -----------------------------------------------------


def test_it_is_python_with_the_schedule_in_the_axes_of_the_file() -> None:
    plan = messages.planned("tilted tensor, backwards")
    tank = Tank(2.0, 22e5, 16e5, 1.0)
    named = replace(plan, spacecraft=replace(plan.spacecraft, name='a """ name \\ of {many} parts', tank=tank))
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
        in_file = messages.in_file_axes(plan.spacecraft, known(pulse.torque))
        assert torque == pytest.approx(in_file, rel=1e-12, abs=1e-12)
    assert sum(duration for _, duration, _ in schedule) == pytest.approx(plan.pulses.end, rel=1e-14)


@pytest.mark.parametrize("moments", [(100.0, 130.0, 180.0), (130.0, 100.0, 80.0), (120.0, 120.0, 80.0)])
def test_the_cones_that_the_script_prints_are_those_of_the_residual(moments: tuple[float, float, float]) -> None:
    """The function alone, as it stands in the script."""
    parsed = ast.parse(export_text(messages.planned("prolate"), "basilisk"))
    (cones,) = (node for node in parsed.body if isinstance(node, ast.FunctionDef) and node.name == "largest_cones")
    names: dict[str, Any] = {"math": math, "PRINCIPAL_MOMENTS": np.array(moments)}
    exec(compile(ast.Module([cones], []), "fly.py", "exec"), names)
    for rates in ([0.4, 0.1, 2.0], [0.1, -0.4, -2.0], [1e-6, 1e-7, 2.0]):
        for sense in (1.0, -1.0):
            expected = tuple(arc_cones(moments, rates, sense))
            assert names["largest_cones"](np.array(rates), sense) == pytest.approx(expected, rel=1e-9)
