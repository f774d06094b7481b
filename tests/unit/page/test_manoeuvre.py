"""The manoeuvre sheet: what is loaded, what gyros and Sun sensor should show, and when to abort."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from support import reference
from support.markup import Node, parsed
from support.pages import plain_page
from support.process import Run
from support.spinners import FILE

from nutdamp import planning
from nutdamp.comparison import compare
from nutdamp.dispersion import study_of
from nutdamp.dispersion.milestones import CASES, even, first_pulses, milestones
from nutdamp.dispersion.study import Results, run
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.flight import flown
from nutdamp.physics import attitude
from nutdamp.presentation.page.content import _reading
from nutdamp.presentation.page.html import page_html
from nutdamp.spacecraft import Goal

pytestmark = pytest.mark.usefixtures("plans_shared")

DISPERSED = (
    FILE
    + """
dispersions:
  A: {normal: 2 %}
  omega0: [{normal: 0.1 deg/s}, {normal: 0.1 deg/s}, {normal: 0.5 %}]
  thrust: {normal: 3 %}
"""
)


def sheet(text: str, scheme: str, degrees: float, cases: int = 0) -> Node:
    """The section of the page of a turn by some degrees, without pictures."""
    body = read_spacecraft(text, "f.yaml", ())
    body = body.replace(goal=Goal(body.direction_in_n(math.radians(degrees), math.radians(82.0))))
    compared = compare(body, [scheme])
    studied = {scheme: run(Results(study_of(body, compared[scheme].pulses), cases))} if cases else {}
    made = plain_page(compared, dispersed=studied)
    tree = parsed(page_html(made).removeprefix("<!DOCTYPE html>"))
    (found,) = (one for one in tree.all("section") if one.attributes["id"] == "manoeuvre")
    return found


def rows(found: Node, title: str) -> list[dict[str, str]]:
    (table,) = (one for one in found.all("table") if one.all("caption")[0].text.startswith(title))
    heads, *cells = [[cell.text for cell in row if cell.tag in ("th", "td")] for row in table.all("tr")]
    return [dict(zip(heads, row, strict=True)) for row in cells]


@pytest.mark.weekly
def test_blocks_phases_signature_and_criteria() -> None:
    found = sheet(DISPERSED, "command-block", 9.0, 500)
    body = read_spacecraft(FILE, "f.yaml", ())
    (block,) = rows(found, "Command blocks to load")
    fired = rows(found, "Pulses to fire")
    assert len(fired) == int(block["pulses"])
    for row in fired:  # without nutation the Sun phase is the delay
        assert float(row["Sun phase deg"]) == pytest.approx(float(block["delay deg"]), abs=0.3)
        time = float(row["time s"])  # rounded to 0.1 ms
        assert row["UTC"] in {body.utc(time + off, 3) for off in (-6e-5, 0.0, 6e-5)}
    start, after = rows(found, "What gyros")
    assert (start["coast"], after["coast"]) == ("before block 1", "after block 1")
    assert float(start["gyro, axis 3 rpm"]) == pytest.approx(12.0)
    rate = math.radians(float(after["gyro, square to it deg/s"]))
    shown = math.degrees(math.atan2(120.0 * rate, 180.0 * 12.0 * math.pi / 30.0))  # tan θ = A|ω|/(C|ω3|)
    assert float(after["nutation deg"]) == pytest.approx(shown, rel=1e-3)
    assert float(after["period of that rate s"]) == pytest.approx(10.0)  # 2π/(|a| ω3), a = -1/2
    criteria = rows(found, "Abort criteria")
    assert len(fired) > len(criteria) == 12
    assert [int(row["after pulse"]) for row in criteria] == even(len(fired), 12)
    assert "criteria after 12 pulses at most" in found.text
    assert "2,048 cases stay" in found.text
    for row in criteria:
        low, nominal, high = (
            float(row[name])
            for name in ("Sun angle: abort below deg", "Sun angle, nominal deg", "Sun angle: abort above deg")
        )
        assert low < nominal < high
        assert float(row["nutation, nominal deg"]) < float(row["nutation: abort above deg"])
        assert float(row["spin: abort below rpm"]) < 12.0 < float(row["spin: abort above rpm"])


@pytest.mark.deep
@pytest.mark.parametrize(("required", "strict"), [(0.05, True), (20.0, False)])
def test_after_the_last_pulse_no_more_than_the_requirement_counts(required: float, strict: bool) -> None:
    found = sheet(DISPERSED.replace("nutation: 0.3 deg", f"nutation: {required} deg"), "rhumb-line", 3.0, 100)
    *before, last = (float(row["nutation: abort above deg"]) for row in rows(found, "Abort criteria"))
    assert (last == required) == strict
    assert last <= required
    assert strict == ("the criterion of nutation is the requirement, which fewer cases meet" in found.text)
    assert strict == ("stay within each but the last of nutation" in found.text)
    assert strict != ("yet meets the requirement, needs no new plan" in found.text)
    assert max(before) > 0.05, "on the way the limits are those of the cases"
    assert "do not judge what is required of the error of H" in found.text


@pytest.mark.deep
def test_pulses_that_no_command_block_fires_are_called_so() -> None:
    body = read_spacecraft(FILE, "f.yaml", ())
    body = body.replace(goal=Goal(body.direction_in_n(math.radians(3.0), math.radians(82.0))))
    both = compare(body, ["command-block", "rhumb-line"])
    (said,) = _reading(both)
    assert said.startswith("Command blocks can fire the plan of command-block only")
    assert "No command block fires these pulses" in sheet(FILE, "rhumb-line", 3.0).text
    assert list(_reading(compare(body, ["rhumb-line"]))) == []


@pytest.mark.deep
def test_schemes_without_blocks_have_a_sheet_too_and_say_what_criteria_need() -> None:
    found = sheet(FILE, "rhumb-line", 3.0)
    fired, signature = rows(found, "Pulses to fire"), rows(found, "What gyros")
    assert len(signature) == len(fired) + 1
    assert signature[-1]["coast"] == f"after pulse {len(fired)}"
    assert "the file gives no dispersions" in found.text
    plain = FILE.partition("sun: epoch")[0]
    other = sheet(plain, "rhumb-line", 3.0)
    assert "Sun phase deg" not in rows(other, "Pulses to fire")[0]
    assert "Sun angle deg" not in rows(other, "What gyros")[0]


def test_ideal_impulses_are_loaded_by_size_and_direction(run: Run, tmp_path: Path) -> None:
    """They have no on-time to load; the page says beside the verdict that they are ideal."""
    assert run("init", "--from", "magnus-oblate", "oblate.yaml").returncode == 0
    compared = compare(read_spacecraft((tmp_path / "oblate.yaml").read_text(), "oblate.yaml", ()), ["two-pulse"])
    tree = parsed(page_html(plain_page(compared)).removeprefix("<!DOCTYPE html>"))
    (found,) = (one for one in tree.all("section") if one.attributes["id"] == "manoeuvre")
    for pulse, row in zip(compared["two-pulse"].pulses, rows(found, "Pulses to fire"), strict=True):
        assert row["on-time s"] == "ideal"
        assert float(row["impulse N m s"]) == pytest.approx(pulse.magnitude, rel=1e-3)
        towards = math.degrees(math.atan2(pulse.impulse[1], pulse.impulse[0])) % 360.0
        assert row["channel"] == f"steerable {towards:.2f}°"
    assert "the direction of its torque, from body axis +1 towards +2" in found.text
    assert "Two-pulse fires ideal impulses, which take no time: the file has no steerable.torque" in tree.text


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_the_command_writes_it(run: Run, tmp_path: Path) -> None:
    done = run("report", "-", "--target", "20deg,82deg", "--scheme", "rhumb-line", "-o", "page.html", stdin=FILE)
    assert done.returncode in (0, 4), done.stderr
    text = parsed((tmp_path / "page.html").read_text("utf-8")).text
    assert "Manoeuvre sheet: rhumb-line" in text
    assert "Sun phase deg" in text


def test_the_signature_is_that_of_the_reference() -> None:
    """Nutation and Sun angle after each pulse against Euler's equations by DOP853."""
    body = read_spacecraft(FILE, "f.yaml", ())
    body = body.replace(goal=Goal(axis=body.direction_in_n(math.radians(3.0), 0.5)))
    plan = planning.plan(body, "rhumb-line")
    assert body.sun is not None
    _, after = plan.flight.around_pulses()
    motion = reference.Motion(body.omega0, attitude.matrix(body.initial.quaternion))
    now, moments = 0.0, np.asarray(body.inertia.moments)
    for index, pulse in enumerate(plan.pulses):
        (motion,) = reference.coast(body.inertia.moments, motion, np.zeros(3), np.array([pulse.start - now]))
        assert pulse.torque is not None
        (motion,) = reference.coast(body.inertia.moments, motion, pulse.torque, np.array([pulse.on_time]))
        now = pulse.end
        momentum = motion.rotation @ (moments * motion.rates)
        assert float(after.nutation[index]) == pytest.approx(reference.angle(momentum, motion.rotation[:, 2]), abs=1e-7)
        seen = float(attitude.angle_between(after.momentum[index], body.sun))
        assert seen == pytest.approx(reference.angle(momentum, body.sun), abs=1e-7)


@pytest.mark.deep
def test_the_last_milestone_is_what_the_study_says_of_the_end() -> None:
    body = read_spacecraft(DISPERSED, "f.yaml", ())
    body = body.replace(goal=Goal(axis=body.direction_in_n(math.radians(5.0), 0.5)))
    for scheme in ("command-block", "rhumb-line"):
        study = study_of(body, planning.plan(body, scheme).pulses)
        results = run(Results(study, CASES))
        *_, last = milestones(study, [3, len(study.model.schedule)], 0.95)
        assert results.values is not None
        left = results.values[0]
        assert last.nutation == pytest.approx(float(np.quantile(left, 0.95)), rel=1e-9)


def test_the_first_pulses_are_those_of_the_first_blocks() -> None:
    body = read_spacecraft(FILE, "f.yaml", ())
    body = body.replace(goal=Goal(axis=body.direction_in_n(math.radians(5.0), 0.5)))
    made = planning.plan(body, "command-block").pulses
    part = first_pulses(made, 4)
    assert [block.count for block in part.blocks] == [4]
    assert part.pulses == made.pulses[:4]
    assert flown(body, part).settled.spin == pytest.approx(body.spin)
    assert even(1, 8) == [1]
    assert even(3, 8) == [1, 2, 3]
    assert (even(57, 8)[0], even(57, 8)[-1]) == (1, 57)
    assert even(10, 12) == list(range(1, 11))
    assert len(even(57, 8)) == 8
