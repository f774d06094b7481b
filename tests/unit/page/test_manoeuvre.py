"""The manoeuvre sheet: what is loaded, what gyros and Sun sensor should show, and when to abort."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from support import places, reference
from support.markup import Node
from support.pages import plain_page
from support.process import Run
from support.shown import section, sheet, tree
from support.spinners import FILE

from nutdamp.files.reader import load_spacecraft, read_spacecraft
from nutdamp.flight.propagation import flown
from nutdamp.montecarlo.checkpoints import CASES, even, first_pulses, milestones
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.page.content import _reading
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import compare
from nutdamp.spacecraft.model import Goal, Spacecraft

pytestmark = pytest.mark.usefixtures("plans_shared")

DISPERSED = f"""{FILE}
dispersions:
  A: {{normal: 2 %}}
  omega0: [{{normal: 0.1 deg/s}}, {{normal: 0.1 deg/s}}, {{normal: 0.5 %}}]
  thrust: {{normal: 3 %}}
"""


def turning(text: str, degrees: float, azimuth: float = math.radians(82.0)) -> Spacecraft:
    """The spacecraft of a file, with a target so many degrees away."""
    body = read_spacecraft(text, "f.yaml", ())
    return body.replace(goal=Goal(axis=body.direction_in_n(math.radians(degrees), azimuth)))


def manoeuvre(text: str, scheme: str, degrees: float, cases: int = 0) -> Node:
    """The section of the page of a turn by some degrees, without pictures."""
    return section(tree(plain_page(compare(turning(text, degrees), [scheme], samples=cases))), "manoeuvre")


@pytest.mark.weekly
def test_blocks_phases_signature_and_criteria() -> None:
    shown = manoeuvre(DISPERSED, "command-block", 9.0, 500)
    body = read_spacecraft(FILE, "f.yaml", ())
    (block,) = sheet(shown, "Command blocks to load")
    fired = sheet(shown, "Pulses to fire")
    assert len(fired) == int(block["pulses"])
    for row in fired:  # without nutation the Sun phase is the delay
        assert float(row["Sun phase deg"]) == pytest.approx(float(block["delay deg"]), abs=0.3)
        time = float(row["time s"])  # rounded to 0.1 ms
        assert row["UTC"] in {body.utc(time + off, 3) for off in (-6e-5, 0.0, 6e-5)}
    start, after = sheet(shown, "What gyros")
    assert (start["coast"], after["coast"]) == ("before block 1", "after block 1")
    assert float(start["gyro, axis 3 rpm"]) == pytest.approx(12.0)
    rate = math.radians(float(after["gyro, square to it deg/s"]))
    nutation = math.degrees(math.atan2(120.0 * rate, 180.0 * 12.0 * math.pi / 30.0))  # tan θ = A|ω|/(C|ω3|)
    assert float(after["nutation deg"]) == pytest.approx(nutation, rel=1e-3)
    assert float(after["period of that rate s"]) == pytest.approx(10.0)  # 2π/(|a| ω3), a = -1/2
    criteria = sheet(shown, "Abort criteria")
    assert len(fired) > len(criteria) == 12
    assert [int(row["after pulse"]) for row in criteria] == even(len(fired), 12)
    assert "criteria after 12 pulses at most" in shown.text
    assert "2,048 cases stay" in shown.text
    angles = ("Sun angle: abort below deg", "Sun angle, nominal deg", "Sun angle: abort above deg")
    for row in criteria:
        low, nominal, high = (float(row[name]) for name in angles)
        assert low < nominal < high
        assert float(row["nutation, nominal deg"]) < float(row["nutation: abort above deg"])
        assert float(row["spin: abort below rpm"]) < 12.0 < float(row["spin: abort above rpm"])


@pytest.mark.deep
@pytest.mark.parametrize(("required", "strict"), [(0.05, True), (20.0, False)])
def test_after_the_last_pulse_no_more_than_the_requirement_counts(required: float, strict: bool) -> None:
    text = DISPERSED.replace("nutation: 0.3 deg", f"nutation: {required} deg")
    shown = manoeuvre(text, "rhumb-line", 3.0, 100)
    *before, last = (float(row["nutation: abort above deg"]) for row in sheet(shown, "Abort criteria"))
    assert last <= required
    assert max(before) > 0.05, "on the way the limits are those of the cases"
    said = [
        "the criterion of nutation is the requirement, which fewer cases meet" in shown.text,
        "stay within each but the last of nutation" in shown.text,
        "yet meets the requirement, needs no new plan" not in shown.text,
        last == required,
    ]
    assert said == [strict] * 4
    assert "do not judge what is required of the axis error" in shown.text


@pytest.mark.deep
def test_schemes_without_blocks_have_a_sheet_too_and_say_what_it_lacks() -> None:
    shown = manoeuvre(FILE, "rhumb-line", 3.0)
    fired, signature = sheet(shown, "Pulses to fire"), sheet(shown, "What gyros")
    assert len(signature) == len(fired) + 1
    assert signature[-1]["coast"] == f"after pulse {len(fired)}"
    assert "Sun phase deg" in fired[0]
    assert "No command block fires these pulses" in shown.text
    assert "the file gives no dispersions" in shown.text
    (said,) = _reading(compare(turning(FILE, 3.0), ["command-block", "rhumb-line"]))
    assert said.startswith("Command blocks can fire the plan of command-block only")
    assert list(_reading(compare(turning(FILE, 3.0), ["rhumb-line"]))) == []
    without = manoeuvre(FILE.partition("sun: epoch")[0], "rhumb-line", 3.0)
    assert "Sun phase deg" not in sheet(without, "Pulses to fire")[0]
    assert "Sun angle deg" not in sheet(without, "What gyros")[0]


@pytest.mark.deep
def test_ideal_impulses_are_loaded_by_size_and_direction() -> None:
    """They have no on-time to load; the page says beside the verdict that they are ideal."""
    compared = compare(load_spacecraft(str(places.CONFIGS / "magnus-oblate.yaml")), ["two-pulse"])
    page = tree(plain_page(compared))
    for pulse, row in zip(
        compared["two-pulse"].pulses, sheet(section(page, "manoeuvre"), "Pulses to fire"), strict=True
    ):
        assert row["on-time s"] == "ideal"
        assert float(row["impulse N m s"]) == pytest.approx(pulse.magnitude, rel=1e-3)
        towards = math.degrees(math.atan2(pulse.impulse[1], pulse.impulse[0])) % 360.0
        assert row["channel"] == f"steerable {towards:.2f}°"
    assert "the direction of its torque, from body axis +1 towards +2" in section(page, "manoeuvre").text
    assert "Two-pulse fires ideal impulses, which take no time: the file has no steerable.torque" in page.text


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_the_command_writes_it(run: Run, tmp_path: Path) -> None:
    screen = run("report", "-", "--target", "20deg,82deg", "--scheme", "rhumb-line", "-o", "page.html", stdin=FILE)
    assert screen.returncode in (0, 4), screen.stderr
    assert "Manoeuvre sheet: rhumb-line" in tree((tmp_path / "page.html").read_text("utf-8")).text


def test_the_signature_is_that_of_the_reference() -> None:
    """Nutation and Sun angle after each pulse against Euler's equations by DOP853."""
    body = turning(FILE, 3.0, 0.5)
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
@pytest.mark.parametrize("scheme", ["command-block", "rhumb-line"])
def test_the_last_milestone_is_what_the_study_says_of_the_end(scheme: str) -> None:
    body = turning(DISPERSED, 5.0, 0.5)
    study = study_of(body, planning.plan(body, scheme).pulses)
    results = run(Results(study, CASES))
    *_, last = milestones(study, [3, len(study.model.schedule)], 0.95)
    assert results.values is not None
    assert last.nutation == pytest.approx(float(np.quantile(results.values[0], 0.95)), rel=1e-9)


def test_milestones_are_even_and_the_first_pulses_are_those_of_the_first_blocks() -> None:
    body = turning(FILE, 3.0, 0.5)
    made = planning.plan(body, "command-block").pulses
    part = first_pulses(made, 4)
    assert [block.count for block in part.blocks] == [4]
    assert part.pulses == made.pulses[:4]
    assert flown(body, part).settled.spin == pytest.approx(body.spin)
    assert (even(1, 8), even(3, 8), even(10, 12)) == ([1], [1, 2, 3], list(range(1, 11)))
    assert (even(57, 8)[0], even(57, 8)[-1], len(even(57, 8))) == (1, 57, 8)
