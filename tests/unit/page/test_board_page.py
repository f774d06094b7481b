"""What a board needs on the page of ``report``: the decision, the data, thresholds, how to repeat it, who signs."""

from __future__ import annotations

import hashlib
import math
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from support import places
from support.golden import check_text
from support.markup import Node
from support.pages import plain_page
from support.process import Run
from support.reference import Motion, coast
from support.shown import cells, facts, section, sheet, tree

import nutdamp
from nutdamp.flight import propagation
from nutdamp.flight.end_state import spin_phases
from nutdamp.page.document import Control
from nutdamp.page.report import Repeat
from nutdamp.physics.attitude import matrix
from nutdamp.planning.decision import Comparison, compare
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.spacecraft.model import Disturbance

pytestmark = pytest.mark.usefixtures("plans_shared")

ACE = places.CONFIGS / "ace.yaml"


@cache
def compared_ace() -> Comparison:
    return compare(nutdamp.load(ACE), ["two-pulse"], samples=0)


@cache
def ace(**control: str) -> Node:
    """The page of a body with an attitude and an epoch, without pictures."""
    repeat = Repeat("nutdamp report", "ace.yaml", ACE.read_text("utf-8"))
    return tree(plain_page(compared_ace(), repeat, control=Control(**control)))


@pytest.mark.deep
def test_what_the_board_asks_for_is_on_the_page() -> None:
    start = facts(ace(), "ACE")
    wanted = {"width": "in steps of 30 ms, 60 ms to 0.48 s"}
    assert wanted == {key: start[key] for key in wanted}
    assert start["Sun sensor"].startswith("at azimuth 0 deg")
    # With three moments the file's 0.6° is that of t = 0; pulses are measured by the largest on the arc.
    assert ace().all("h1")[0].text == "ACE · damp 0.6° nutation"
    assert [row["channel"] for row in sheet(ace(), "Pulses of")]


@pytest.mark.deep
def test_pulses_have_date_phase_and_cones() -> None:
    body, chosen = compared_ace().spacecraft, compared_ace().recommended
    assert chosen is not None
    assert body.sun is not None
    around = dict(zip(("before", "after"), chosen.flight.around_pulses(), strict=True))
    for index, (pulse, row) in enumerate(zip(chosen.pulses, sheet(ace(), "Pulses of"), strict=True)):
        assert f"T{row['start UTC']}Z" in (body.utc(pulse.start, 3) or "")
        x, y, _ = matrix(chosen.flight.motion(np.array([pulse.start]))[1][0]).T @ body.sun
        assert float(row["Sun phase deg"]) == pytest.approx(-math.degrees(math.atan2(y, x)) % 360.0, abs=0.051)
        for cone in ("nutation", "body_cone", "space_cone"):
            for when, track in around.items():
                shown = float(row[f"{cone.replace('_', ' ')} {when} deg"])
                assert shown == pytest.approx(math.degrees(getattr(track, cone)[index]), rel=1e-3)


def test_the_spin_phase_is_the_integral_of_the_spin() -> None:
    """Against Euler's equations by DOP853, with three moments and a torque about axis 3."""
    body = nutdamp.example().replace(disturbances=(Disturbance(0.0, 0.4),), dispersions=None)
    times = np.array([0.0, 3.0, 11.0, 40.0])
    phases = spin_phases(propagation.flown(body, nutdamp.plan(body, "none").pulses, 41.0), times)
    assert phases == pytest.approx(body.spin * times + 0.5 * 0.4 / body.inertia.C * times**2, rel=1e-12)
    uneven = nutdamp.load(ACE)
    made = propagation.flown(uneven, nutdamp.plan(uneven, "none").pulses, 61.0)
    grid = np.linspace(0.0, 60.0, 6001)
    motions = coast(made.moments, Motion(uneven.omega0, np.eye(3)), np.zeros(3), grid[1:])
    spins = np.array([uneven.spin, *(one.rates[2] for one in motions)])
    assert spin_phases(made, grid[[-1]])[0] == pytest.approx(np.trapezoid(spins, grid), rel=1e-7)


@pytest.mark.deep
def test_the_verification_is_a_line_and_the_equations_are_those_of_the_guide() -> None:
    verified = section(ace(), "verification")
    assert re.search(r"DOP853( and Basilisk)? agree \(within 1e-09 rad\)", verified.all("p")[0].text)
    checks = {row["method"]: row for row in sheet(verified, "Maximum differences")}
    assert float(checks["DOP853, the file alone"]["Δaxis rad"].removeprefix("< ")) <= 1e-9
    (listing,) = (one.text for one in ace().all("pre") if "M(17)" in one.text)
    for number in ("M(1)", "M(17)", "M(18)", "M(19)"):
        assert re.search(rf"^{re.escape(number)} ", listing, re.MULTILINE)
    symbols = facts(ace(), "Symbols")
    assert symbols["J_v"] == "impulse of pulse v, N m s: about axis 1, + i times that about axis 2"


@pytest.mark.deep
def test_configuration_control_is_written_as_given() -> None:
    given = {"document": "ND-7", "issue": '2 "b"', "author": "M. Ö", "date": "2026-03-01"}
    controlled = ace(title="ACE <1>", **given)
    assert controlled.all("h1")[0].text == "ACE <1>"
    digest = hashlib.sha256(ACE.read_bytes()).hexdigest()
    for node, expected in ((controlled, 'ND-7 iss 2 "b" · M. Ö · 2026-03-01 · '), (ace(), "")):
        (line,) = (one.text for one in node.all("p") if one.attributes.get("class") == "control")
        assert line == f"{expected}input {digest[:8]}"
    footer = r'content: "ND\2d 7\20 iss\20 2\20 \22 b\22 \2c \20 2026\2d 03\2d 01\2c \20 input\20 '
    assert footer in controlled.all("style")[0].text


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_input_is_known_by_its_digest_and_the_date_is_that_of_the_build_where_none_is_given(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert run("init", "craft.yaml").returncode == 0
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1772366400")
    digest = hashlib.sha256((tmp_path / "craft.yaml").read_bytes()).hexdigest()
    for more, said in (((), "2026-03-01"), (("--date", "1 May 2026"), "1 May 2026")):
        asked = ("report", "craft.yaml", "--nominal", "--scheme", "two-pulse", "-o", "page.html", *more)
        assert run(*asked).returncode == 0
        content = (tmp_path / "page.html").read_text("utf-8")
        assert f'<p class="control">{said} · input {digest[:8]}</p>' in content
        assert facts(tree(content), "Versions")["input file"] == f"craft.yaml, SHA-256 {digest}"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    screen = run("report", "-o", "c.html")
    assert screen.returncode == 2
    check_text("page.date", screen.stderr)


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
@pytest.mark.parametrize(("tolerances", "state"), [((), "met"), (("--set", "dispersions.A={normal: 1 %}"), "missed")])
def test_the_top_of_the_page_has_the_bounds_of_the_screen(
    run: Run, tmp_path: Path, tolerances: tuple[str, ...], state: str
) -> None:
    """With the tolerances of the file enough cases comply with one scheme; with A known to 1 % with none."""
    schemes = [part for name in CLASSIC for part in ("--scheme", name)]
    run("report", *schemes, *tolerances, "-o", "page.html")
    lines = run("plan", *schemes, *tolerances, columns=120).stdout.splitlines()
    page = tree((tmp_path / "page.html").read_text("utf-8"))
    decision = section(page, "decision")
    assert decision.attributes["class"] == state
    assert [node.text for node in decision.all("p")[:2]] == lines[1:3]
    rows = {row[0].text: [cell.text for cell in row[2:]] for row in cells(decision.all("table")[0])}
    for line in (line for line in lines if line.partition("  ")[0] in rows):
        label, limit, nominal, level, alone, margin, word = re.split(r"  +", line)
        bounds = [f"nominal {nominal}", f"99.7 % within {level}", f"limit {limit}", f"margin {margin}"]
        assert rows.pop(label) == [*bounds, f"{alone} keep it", word]
    assert rows == {}
    (chosen,) = (one.text for one in page.all("li") if one.attributes.get("class") == "mark")
    assert chosen.startswith(lines[1].partition(": pulses")[0].split()[-1])


@pytest.mark.weekly
@pytest.mark.parametrize("name", ["lunar-prospector", "magnus-a03"])
def test_the_notes_name_the_plan_that_can_be_sent_or_fired_as_it_stands(run: Run, tmp_path: Path, name: str) -> None:
    assert run("init", "--from", name, "craft.yaml").returncode == 0
    assert run("report", "craft.yaml", "-o", "page.html").returncode == 0
    shown = section(tree((tmp_path / "page.html").read_text("utf-8")), "decision")
    told = {"lunar-prospector": "FLY command-block: ", "magnus-a03": "two-pulse fires ideal impulses"}
    assert told[name] in shown.text


@pytest.mark.deep
def test_a_turn_is_in_the_title() -> None:
    """A body that is to turn to a target 10° away; within 9 s there is no plan, and the page says so."""
    body = nutdamp.example().with_(goal={"tilt": "10 deg", "azimuth": "45 deg"}, limits={"horizon": "100 s"})
    shown = tree(plain_page(compare(body, ["rhumb-line"], samples=0)))
    assert shown.all("h1")[0].text == "Sounder-1 · damp 5° nutation, turn by 10°"
    late = plain_page(compare(body.with_(limits={"horizon": "9 s"}), ["rhumb-line"]))
    assert (late.state, late.headline[0]) == ("missed", "NO PLAN")
