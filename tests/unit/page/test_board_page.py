"""What a board needs on the page of ``report``: the decision, the data, thresholds, how to repeat it, who signs."""

from __future__ import annotations

import hashlib
import json
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
from nutdamp.page.content import Repeat
from nutdamp.page.document import Control
from nutdamp.planning.decision import Comparison, compare
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.spacecraft.model import Disturbance
from nutdamp.views import guide

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
def test_the_spacecraft_its_limits_and_its_angles_stand_there_whole() -> None:
    readme = (places.ROOT / "README.md").read_text("utf-8").partition("\n## Limits\n")[2].partition("\n## ")[0]
    assert guide.limits() == tuple(" ".join(part.split()) for part in f"\n{readme}".split("\n- ") if part.strip())
    assert len(guide.limits()) >= 8
    assumed = [item.text for item in section(ace(), "assumptions").all("li")]
    assert assumed == [text.replace("`", "") for text in guide.limits()]
    start = facts(ace(), "At t = 0")
    wanted = {"mass": "611.7 kg", "epoch": "2012-11-13T12:00:00Z", "frame": "EME2000"}
    assert wanted | {"width": "in steps of 30 ms, 60 ms to 0.48 s"} == {key: start[key] for key in (*wanted, "width")}
    assert start["Sun sensor"].startswith("at azimuth 0 deg")
    assert sheet(ace(), "Thrusters")[0] == {
        "thruster": "P1",
        "position m": "(0, 0.7, -0.5)",
        "force N": "(0, 0, 4.45)",
        "torque N m": "(3.115, 0, 0)",
        "isp s": "215",
        "on-time": "40 ms to 0.5 s",
        "channels": "P1",
    }
    # With three moments the file's 0.6° is that of t = 0; pulses are measured by the largest on the arc.
    assert ace().all("h1")[0].text == "ACE: damping 0.6 deg of nutation"
    ends = facts(ace(), "Where it points")
    assert ends["nutation at that time"] == "0.6 deg"
    assert ends["largest nutation from then on, without pulses"] == "0.6015 deg"
    assert "nutation" not in ends


@pytest.mark.deep
def test_where_it_points_is_what_the_json_says(run: Run) -> None:
    screen = run("plan", str(ACE), "-q", "--nominal", "--scheme", "two-pulse", "--json", "-")
    final = json.loads(screen.stdout)["decision"]["final"]
    ends = {what: shown for what, _, shown, *_ in (list(row.values()) for row in sheet(ace(), "Where it points"))}
    for what, key in (("spin axis", "axis"), ("H", "momentum")):
        for name in ("right_ascension", "declination"):
            shown = float(ends[f"{what}: {name.replace('_', ' ')}"].removesuffix(" deg"))
            assert shown == pytest.approx(final[key][f"{name}_deg"], abs=6e-5)
    assert tiles(ace())["spin axis ends at"][0].startswith("right ascension ")


@pytest.mark.deep
def test_pulses_have_date_phase_and_cones() -> None:
    body, chosen = compared_ace().spacecraft, compared_ace().recommended
    assert chosen is not None
    around = dict(zip(("before", "after"), chosen.flight.around_pulses(), strict=True))
    for index, (pulse, row) in enumerate(zip(chosen.pulses, sheet(ace(), "Pulses of"), strict=True)):
        assert row["start UTC"] == body.utc(pulse.start, 3)
        spins = chosen.flight.motion(np.linspace(0.0, pulse.start, 20_001))[0][:, 2]
        turned = math.degrees(float(spins.mean()) * pulse.start) % 360.0
        assert float(row["spin phase deg"]) == pytest.approx(turned, abs=0.1)
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
def test_a_verification_names_what_it_takes_to_pass_and_the_equations_are_those_of_the_guide() -> None:
    checks = {next(iter(row.values())): [*row.values()] for row in sheet(ace(), "Checks")}
    check = checks["DOP853, full tensor"]
    assert check[2] == "1e-09 rad; rates 1e-09 of their size"
    assert float(check[3]) <= 1e-9
    assert check[4] == checks["|H| on coasts"][4] == "pass"
    assert checks["impulse sum (17): nutation"][2] == "0.01 deg"  # a tenth of the requirement
    (listing,) = (one.text for one in ace().all("pre") if "M(17)" in one.text)
    for number in ("M(1)", "M(17)", "M(18)", "M(19)"):
        assert re.search(rf"^{re.escape(number)} ", listing, re.MULTILINE)
    symbols = facts(ace(), "Symbols")
    assert symbols["J_v"] == "impulse of pulse v, N m s: about axis 1, + i times that about axis 2"
    assert symbols["A|ω0|"].endswith("no floor here, with I1 ≠ I2")


@pytest.mark.deep
def test_configuration_control_is_written_as_given() -> None:
    given = {"document": "ND-7", "issue": '2 "b"', "author": "M. Ö", "date": "2026-03-01"}
    controlled = ace(title="ACE <1>", **given)
    assert controlled.all("h1")[0].text == "ACE <1>"
    (control,) = (one for one in controlled.all("dl") if one.attributes.get("class") == "control")
    assert {one.all("dt")[0].text: one.all("dd")[0].text for one in control.all("div")} == given
    footer = r'content: "ND\2d 7\2c \20 issue\20 2\20 \22 b\22 \2c \20 2026\2d 03\2d 01"'
    assert footer in controlled.all("style")[0].text
    assert not [one for one in ace().all("dl") if one.attributes.get("class") == "control"]


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
        assert f"<dt>date</dt><dd>{said}</dd>" in content
        assert facts(tree(content), "Input")["SHA-256 of the input file"] == digest
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    screen = run("report", "-o", "c.html")
    assert screen.returncode == 2
    check_text("page.date", screen.stderr)


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
@pytest.mark.parametrize("met", [False, True])
def test_the_tile_of_the_dispersed_example_says_whether_enough_comply_and_so_does_the_screen(
    run: Run, tmp_path: Path, met: bool
) -> None:
    """With the tolerances of the file they do with one scheme; with A known to 1 %, one sigma, with none."""
    loose = () if met else ("--set", "dispersions.A={normal: 1 %}")
    schemes = [part for name in CLASSIC for part in ("--scheme", name)]
    screen = run("report", "--disperse", "2e3", *schemes, *loose, "-o", "page.html")
    assert screen.returncode == (0 if met else 4)
    shown = tree((tmp_path / "page.html").read_text("utf-8"))
    tiles = {kind: [one for one in shown.all("div") if one.attributes.get("class") == kind] for kind in ("good", "bad")}
    (tile,) = tiles["good" if met else "bad"]
    assert not tiles["bad" if met else "good"]
    said = tile.all("dd")[0].text
    assert re.fullmatch(rf"{'met' if met else 'NOT met'}: [\d.]+ % of cases comply \(99.7 % required\)", said)
    assert (f"Requirement {said}." in screen.stderr) is not met
    verdicts = [row[-1].text for row in cells(shown.all("table")[0])[1:]]
    assert [verdicts[0], verdicts[-1]] == ["met" if met else "NOT met"] * 2
    rows = sheet(shown, "Cost and residuals of each scheme")
    shares = {row["scheme"]: float(row["cases that comply %"]) for row in rows}  # all have flown so few
    best = max(shares, key=lambda name: shares[name])
    assert (f"Recommended: {best} \N{EN DASH} " in shown.text, best == "two-pulse") == (True, met)
    assert [row["verdict"] for row in rows] == ["met" if met and row["scheme"] == best else "NOT met" for row in rows]
    assert ("plan --robust searches a plan made for the tolerances" in shown.text) is not met
    assert shown.text.count(said) == 3  # verdict, tile, dispersion


@pytest.mark.weekly
@pytest.mark.parametrize("name", ["lunar-prospector", "magnus-a03"])
def test_the_headline_names_the_plan_that_can_be_sent_or_fired_as_it_stands(
    run: Run, tmp_path: Path, name: str
) -> None:
    assert run("init", "--from", name, "craft.yaml").returncode == 0
    assert run("report", "craft.yaml", "-o", "page.html").returncode == 0
    paragraphs = tree((tmp_path / "page.html").read_text("utf-8")).all("p")
    (headline,) = (one.text for one in paragraphs if "verdict" in one.attributes.get("class", ""))
    said = {"lunar-prospector": "Command-block can be sent as command blocks, which optimal cannot, for "}
    assert said.get(name, "fires real pulse widths, for ") in headline


def tiles(node: Node) -> dict[str, list[str]]:
    """What stands below the name of each."""
    boxes = [tile for one in node.all("dl") if one.attributes.get("class") == "figures" for tile in one.all("div")]
    plain = {tile.all("dt")[0].text: [one.text for one in tile.all("dd")] for tile in boxes}
    return {name: [text.replace("\N{NO-BREAK SPACE}", " ") for text in texts] for name, texts in plain.items()}


@pytest.mark.deep
def test_a_turn_is_compared_with_what_the_symbols_explain_and_its_target_stands_beside_its_end() -> None:
    """A body that is to turn to a target 10° away; within 9 s there is no plan, and the tiles say what was required."""
    body = nutdamp.example().with_(goal={"tilt": "10 deg", "azimuth": "45 deg"}, limits={"horizon": "100 s"})
    shown = tree(plain_page(compare(body, ["rhumb-line"], samples=0)))
    row, *_ = sheet(shown, "Cost and residuals of each scheme")
    for name in ("A|ω0|", "C|ω3|β"):
        whole, _, said = facts(shown, "Symbols")[name].partition(" N m s, ")
        share = float(row["impulse N m s"]) / float(whole)
        assert share == pytest.approx(float(row[f"impulse over {name}"]), rel=1e-3)
        assert said.endswith("no schedule that does so takes less")
    for name in ("spin axis ends at", "H ends at"):
        value, note = tiles(shown)[name]
        assert value == "tilt 10.0000 deg, azimuth 45.0000 deg"
        assert re.fullmatch(rf"target: {value}; .* deg off", note)
    late = tiles(tree(plain_page(compare(body.with_(limits={"horizon": "9 s"}), ["rhumb-line"]))))
    assert late["requirement"][0] == "NOT met: no scheme is feasible"
    assert late["target"] == ["tilt 10.0000 deg, azimuth 45.0000 deg", "10 deg from H at t = 0"]
