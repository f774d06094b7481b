"""What is written keeps the form of CCSDS 504.0-B-2: numbers, texts, lines, order of keywords, both notations alike."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import messages
from support.cases import spread

from nutdamp.errors import BadRequest
from nutdamp.files.ccsds.message import APM_BLOCKS, comment, label, number
from nutdamp.files.exchange import export_text
from nutdamp.physics.feed import Tank
from nutdamp.planning import Plan
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Disturbance

pytestmark = pytest.mark.usefixtures("plans_shared")

CASES = pytest.mark.parametrize("case", messages.CASES)
FIXED = r"-?[0-9]+\.[0-9]+"
FLOATING = r"-?[0-9]\.[0-9]+E[+-][0-9]+"


@given(st.floats(-1e300, 1e300))
def test_numbers_have_sixteen_digits_and_read_back(value: float) -> None:
    text = number(value)
    assert re.fullmatch(f"{FIXED}|{FLOATING}", text)
    assert len(re.sub(r"E.*|[^0-9]", "", text)) <= 16
    assert float(text) == pytest.approx(value, rel=6e-16, abs=0.0)
    assert number(float(text)) == text
    assert value != 0.0 or text == "0.0"


@pytest.mark.parametrize(
    ("value", "text"),
    [(-0.0, "0.0"), (120.0, "120.0"), (0.25, "0.25"), (1e-9, "0.000000001"), (-2e-5, "-0.00002"), (1e22, "1.0E+22")],
)
def test_numbers_are_short_where_they_can_be(value: float, text: str) -> None:
    assert number(value) == text


def test_texts_are_capitals_of_ascii() -> None:
    assert label("  Überflieger-1\tα ") == "UBERFLIEGER-1"
    assert label("卫星") == "UNKNOWN"
    assert comment("a\nb" + 300 * "é") == "a b" + 243 * "e"


@CASES
@spread("form", ["apm", "aem"], quick=8)
def test_lines_are_short_printable_ascii(case: str, form: str) -> None:
    for line in export_text(messages.planned(case), form).splitlines():
        assert len(line) <= 254
        assert line.isascii()
        assert line.isprintable()
        if form == "aem":
            assert "[" not in line  # units are not written in this message


@CASES
def test_keywords_stand_in_the_order_of_the_tables(case: str) -> None:
    plan = messages.planned(case)
    text = export_text(plan, "apm")
    starts = re.findall("^([A-Z]+)_START$", text, re.MULTILINE)
    expected = ["QUAT", "ANGVEL", *(["SPIN"] if plan.spacecraft.inertia.symmetric else []), "INERTIA"]
    assert starts == [*expected, *["MAN"] * len(plan.pulses)]
    for name in set(starts):
        for body in re.findall(f"^{name}_START$(.*?)^{name}_STOP$", text, re.MULTILINE | re.DOTALL):
            keywords = re.findall("^([A-Z0-9_]+) *=", body, re.MULTILINE)
            allowed = [keyword.name for keyword in APM_BLOCKS[name].keywords]
            assert keywords == [keyword for keyword in allowed if keyword in keywords]
            assert {keyword.name for keyword in APM_BLOCKS[name].keywords if keyword.required} <= set(keywords)
            assert "COMMENT" not in body.split("=", 1)[1]
    top = [line.split()[0] for line in text[: text.index("QUAT_START")].splitlines() if "=" in line]
    assert top == [
        *("CCSDS_APM_VERS", "CREATION_DATE", "ORIGINATOR", "MESSAGE_ID"),
        *("OBJECT_NAME", "OBJECT_ID", "TIME_SYSTEM", "EPOCH"),
    ]


@pytest.mark.deep
@CASES
def test_both_notations_hold_the_same(case: str) -> None:
    plan = messages.planned(case)
    volatile = ("CREATION_DATE", "MESSAGE_ID")
    plain = re.findall(r"^([A-Z0-9_]+) *= (.*?)(?: \[.*\])?$", export_text(plan, "apm"), re.MULTILINE)
    root = ElementTree.fromstring(export_text(plan, "apm", xml=True).split("\n", 1)[1])
    assert root.attrib == {"id": "CCSDS_APM_VERS", "version": "2.0"}
    tagged = [(one.tag, one.text) for one in root.iter() if one.text and one.text.strip() and one.tag != "COMMENT"]
    assert [pair for pair in plain[1:] if pair[0] not in volatile] == [
        pair for pair in tagged if pair[0] not in volatile
    ]
    rows = re.findall(r"^([0-9]{4}-\S+ .*)$", export_text(plan, "aem"), re.MULTILINE)
    root = ElementTree.fromstring(export_text(plan, "aem", xml=True).split("\n", 1)[1])
    states = [
        " ".join(leaf.text or "" for leaf in state.iter() if not len(leaf)) for state in root.iter("attitudeState")
    ]
    assert states == rows


def test_the_epoch_names_are_those_of_the_file() -> None:
    text = export_text(messages.planned("tilted tensor, backwards"), "apm")
    assert "OBJECT_NAME = TILTED" in text
    assert "OBJECT_ID   = 2026-031A" in text
    assert "OBJECT_ID   = UNKNOWN" in export_text(messages.planned("prolate"), "apm")
    assert "EPOCH = 2026-03-01T12:00:00.250000000" in export_text(messages.planned("steerable-stage"), "apm")
    assert "EPOCH = 2027-06-21T04:30:00.000000000" in export_text(messages.planned("couples-minisat"), "apm")


def test_products_of_inertia_have_the_sign_of_the_standard() -> None:
    text = export_text(messages.planned("tilted tensor, backwards"), "apm")
    found = dict(re.findall(r"^(I[XYZ]{2}) *= (\S+)", text, re.MULTILINE))
    assert found == {"IXX": "120.0", "IYY": "104.0", "IZZ": "80.0", "IXY": "-3.0", "IXZ": "-6.0", "IYZ": "4.0"}


def test_sixty_rpm_of_a_flat_body_spin_backwards_about_the_axis() -> None:
    """C/A = 1.5 at 360 deg/s: the body turns at -180 deg/s about its axis, which turns about H."""
    body = messages.spacecraft("oblate")
    fast = replace(body, omega0=body.omega0 * 2.0)
    text = export_text(Plan(fast, "none", Schedule()), "apm")
    found = re.search(r"SPIN_ANGLE_VEL = (\S+)", text)
    assert found is not None
    assert float(found[1]) == pytest.approx(-180.0, rel=1e-14)
    assert "MAN_START" not in text


def test_what_a_message_leaves_out_is_said() -> None:
    plan = messages.planned("prolate")
    body = replace(plan.spacecraft, disturbances=(Disturbance(0.01 + 0j),), dissipation=600.0)
    text = export_text(replace(plan, spacecraft=body), "apm")
    assert "COMMENT The disturbances of the spacecraft file are not in this message." in text
    assert "COMMENT The energy dissipation" in text
    tank = Tank(2.0, 22e5, 16e5, 1.0, inertia_per_kg=(0.4, 0.4, 0.3))
    text = export_text(replace(plan, spacecraft=replace(plan.spacecraft, tank=tank)), "apm")
    assert "COMMENT INERTIA is that at EPOCH: the principal moments fall by 0.4, 0.4, 0.3 kg*m**2 for each" in text
    assert "COMMENT No SPIN block" in export_text(messages.planned("ace"), "apm")
    assert "COMMENT No SPIN block" not in text


def test_an_ideal_impulse_is_refused() -> None:
    body = replace(messages.spacecraft("prolate"), steerable=None)
    from nutdamp import planning

    plan = planning.plan(body, "two-pulse")
    with pytest.raises(BadRequest, match=r"pulse 1 is an ideal impulse .* give the torquer a torque"):
        export_text(plan, "apm")
    assert "2026-03-01T12" in export_text(plan, "aem")


@pytest.mark.parametrize("form", ["apm", "aem", "stk"])
def test_what_is_missing_is_shown_as_lines_to_add(form: str) -> None:
    plan = messages.planned("prolate")
    bare = replace(plan, spacecraft=replace(plan.spacecraft, attitude=None))
    with pytest.raises(BadRequest, match=r"attitude\.epoch and attitude\.frame") as wrong:
        export_text(bare, form)
    assert [line.split(":")[0] for line in str(wrong.value).splitlines()[1:]] == [
        "attitude",
        "  epoch",
        "  frame",
        "  quaternion",
    ]
    assert plan.spacecraft.attitude is not None
    undated = replace(plan, spacecraft=replace(plan.spacecraft, attitude=replace(plan.spacecraft.attitude, epoch=None)))
    with pytest.raises(BadRequest, match=r"attitude\.epoch, which") as wrong:
        export_text(undated, form)
    assert [line.split(":")[0] for line in str(wrong.value).splitlines()[1:]] == ["attitude", "  epoch"]


def test_frames_and_epochs_that_no_format_knows_are_refused() -> None:
    plan = messages.planned("prolate")
    assert plan.spacecraft.attitude is not None
    for attitude, problem in (
        (
            replace(plan.spacecraft.attitude, frame="TEME"),
            "'TEME' is no frame that the format knows; expected one of",
        ),
        (replace(plan.spacecraft.attitude, epoch="1969-07-20T20:17:40Z"), "before 1972"),
    ):
        with pytest.raises(BadRequest, match=problem):
            export_text(replace(plan, spacecraft=replace(plan.spacecraft, attitude=attitude)), "apm")


def test_notation_and_end_belong_to_some_formats() -> None:
    plan = messages.planned("prolate")
    with pytest.raises(BadRequest, match="stk has no XML"):
        export_text(plan, "stk", xml=True)
    with pytest.raises(BadRequest, match="apm has no end time"):
        export_text(plan, "apm", until=3.0)
    with pytest.raises(BadRequest, match="choose an earlier end"):
        export_text(plan, "aem", until=1e7)
