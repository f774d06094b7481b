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
from support.markup import Node, parsed
from support.pages import plain_page
from support.process import Run
from support.reference import Motion, coast

import nutdamp
from nutdamp import flight, guide
from nutdamp.comparison import Comparison, compare
from nutdamp.outcome import spin_phases
from nutdamp.presentation.page.content import Repeat
from nutdamp.presentation.page.document import Control
from nutdamp.presentation.page.html import page_html
from nutdamp.spacecraft import Disturbance

pytestmark = pytest.mark.usefixtures("plans_shared")

ROOT = places.ROOT
ACE = ROOT / "configs" / "ace.yaml"


@cache
def compared_ace() -> Comparison:
    return compare(nutdamp.load(ACE), ["two-pulse", "four-pulse"])


@cache
def ace(**control: str) -> Node:
    """The page of a body with an attitude and an epoch, without pictures."""
    text = ACE.read_text("utf-8")
    made = plain_page(compared_ace(), Repeat("nutdamp report", "ace.yaml", text), control=Control(**control))
    return parsed(page_html(made).removeprefix("<!DOCTYPE html>"))


def table(tree: Node, title: str) -> list[list[str]]:
    """The rows of the table of that title, its headings first."""
    (found,) = (one for one in tree.all("table") if one.all("caption")[0].text.startswith(title))
    return [[cell.text for cell in row if cell.tag in ("th", "td")] for row in found.all("tr")]


def facts(tree: Node, title: str) -> dict[str, str]:
    return {row[0]: row[1] for row in table(tree, title)}


@pytest.mark.deep
def test_the_limits_are_those_of_the_readme() -> None:
    readme = (ROOT / "README.md").read_text("utf-8").partition("\n## Limits\n")[2].partition("\n## ")[0]
    assert guide.limits() == tuple(" ".join(part.split()) for part in f"\n{readme}".split("\n- ") if part.strip())
    assert len(guide.limits()) >= 8
    (section,) = (one for one in ace().all("section") if one.attributes["id"] == "assumptions")
    assert [item.text for item in section.all("li")] == [text.replace("`", "") for text in guide.limits()]


@pytest.mark.deep
def test_the_spacecraft_stands_there_whole() -> None:
    found = facts(ace(), "At t = 0")
    assert found["mass"] == "611.7 kg"
    assert found["epoch"] == "2012-11-13T12:00:00Z"
    assert found["frame"] == "EME2000"
    assert found["Sun sensor"].startswith("at azimuth 0 deg")
    assert found["width"] == "in steps of 30 ms, 60 ms to 0.48 s"
    heads, first, *_ = table(ace(), "Thrusters")
    assert dict(zip(heads, first, strict=True)) == {
        "thruster": "P1",
        "position m": "(0, 0.7, -0.5)",
        "force N": "(0, 0, 4.45)",
        "torque N m": "(3.115, 0, 0)",
        "isp s": "215",
        "on-time": "40 ms to 0.5 s",
        "channels": "P1",
    }


def test_where_it_points_is_what_the_json_says(run: Run) -> None:
    done = run("plan", str(ACE), "-q", "--scheme", "two-pulse", "--scheme", "four-pulse", "--json", "-")
    data = json.loads(done.stdout)
    final = data["decision"]["final"]
    ends = {row[0]: row[2] for row in table(ace(), "Where it points")}
    for what, key in (("spin axis", "axis"), ("H", "momentum")):
        for name in ("right_ascension", "declination"):
            shown = float(ends[f"{what}: {name.replace('_', ' ')}"].removesuffix(" deg"))
            assert shown == pytest.approx(final[key][f"{name}_deg"], abs=6e-5)
    tiles = {one.all("dt")[0].text: one.all("dd")[0].text for one in ace().all("div") if one.all("dt")}
    assert tiles["spin axis ends at"].startswith("right ascension ")


def test_pulses_have_date_phase_and_cones() -> None:
    body, chosen = compared_ace().spacecraft, compared_ace().recommended
    assert chosen is not None
    before, after = chosen.flight.around_pulses()
    heads, *rows = table(ace(), "Pulses of")
    for index, pulse in enumerate(chosen.pulses):
        row = dict(zip(heads, rows[index], strict=True))
        assert row["start UTC"] == body.utc(pulse.start, 3)
        spins = chosen.flight.motion(np.linspace(0.0, pulse.start, 20_001))[0][:, 2]
        turned = math.degrees(float(spins.mean()) * pulse.start) % 360.0
        assert float(row["spin phase deg"]) == pytest.approx(turned, abs=0.1)
        for cone in ("nutation", "body_cone", "space_cone"):
            for track, when in ((before, "before"), (after, "after")):
                shown = float(row[f"{cone.replace('_', ' ')} {when} deg"])
                assert shown == pytest.approx(math.degrees(getattr(track, cone)[index]), rel=1e-3)


def test_the_spin_phase_is_the_integral_of_the_spin() -> None:
    """Against Euler's equations by DOP853, with three moments and a torque about axis 3."""
    body = nutdamp.example().replace(disturbances=(Disturbance(0.0, 0.4),), dispersions=None)
    times = np.array([0.0, 3.0, 11.0, 40.0])
    found = spin_phases(flight.flown(body, nutdamp.plan(body, "none").pulses, 41.0), times)
    assert found == pytest.approx(body.spin * times + 0.5 * 0.4 / body.inertia.C * times**2, rel=1e-12)
    uneven = nutdamp.load(ACE)
    flown = flight.flown(uneven, nutdamp.plan(uneven, "none").pulses, 61.0)
    moments = flown.moments
    grid = np.linspace(0.0, 60.0, 6001)
    motions = coast(moments, Motion(uneven.omega0, np.eye(3)), np.zeros(3), grid[1:])
    spins = np.array([uneven.spin, *(one.rates[2] for one in motions)])
    assert spin_phases(flown, grid[[-1]])[0] == pytest.approx(np.trapezoid(spins, grid), rel=1e-7)


def test_a_verification_names_what_it_takes_to_pass() -> None:
    rows = {row[0]: row for row in table(ace(), "Checks")}
    check = rows["DOP853, full tensor"]
    assert check[2] == "1e-09 rad; rates 1e-09 of their size"
    assert float(check[3]) <= 1e-9
    assert check[4] == "pass"
    assert rows["|H| on coasts"][4] == "pass"
    assert rows["impulse sum (17): nutation"][2] == "0.01 deg"  # a tenth of the requirement


def test_equations_and_symbols_are_those_of_the_guide() -> None:
    (listing,) = (one.text for one in ace().all("pre") if "M(17)" in one.text)
    for number in ("M(1)", "M(17)", "M(18)", "M(19)"):
        assert re.search(rf"^{re.escape(number)} ", listing, re.MULTILINE)
    assert facts(ace(), "Symbols")["J_v"] == "impulse of pulse v, N m s: about axis 1, + i times that about axis 2"


@pytest.mark.deep
def test_configuration_control_is_written_as_given() -> None:
    tree = ace(title="ACE <1>", document="ND-7", issue='2 "b"', author="M. Ö", date="2026-03-01")
    assert tree.all("h1")[0].text == "ACE <1>"
    (control,) = (one for one in tree.all("dl") if one.attributes.get("class") == "control")
    pairs = {one.all("dt")[0].text: one.all("dd")[0].text for one in control.all("div")}
    assert pairs == {"document": "ND-7", "issue": '2 "b"', "author": "M. Ö", "date": "2026-03-01"}
    assert r'content: "ND\2d 7\2c \20 issue\20 2\20 \22 b\22 \2c \20 2026\2d 03\2d 01"' in tree.all("style")[0].text
    assert not [one for one in ace().all("dl") if one.attributes.get("class") == "control"]


@pytest.mark.usefixtures("plain_pages")
def test_the_input_is_known_by_its_digest(run: Run, tmp_path: Path) -> None:
    assert run("init", "craft.yaml").returncode == 0
    assert run("report", "craft.yaml", "--scheme", "two-pulse", "-o", "page.html").returncode == 0
    digest = hashlib.sha256((tmp_path / "craft.yaml").read_bytes()).hexdigest()
    tree = parsed((tmp_path / "page.html").read_text("utf-8"))
    assert facts(tree, "Input")["SHA-256 of the input file"] == digest


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_the_date_is_that_of_the_build_where_none_is_given(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1772366400")
    for name, more, said in (("a", (), "2026-03-01"), ("b", ("--date", "1 May 2026"), "1 May 2026")):
        assert run("report", "--scheme", "two-pulse", "-o", f"{name}.html", *more).returncode == 0
        assert f"<dt>date</dt><dd>{said}</dd>" in (tmp_path / f"{name}.html").read_text("utf-8")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    done = run("report", "-o", "c.html")
    assert done.returncode == 2
    assert "SOURCE_DATE_EPOCH = 'yesterday': expected a number of seconds" in done.stderr


@pytest.mark.deep
@pytest.mark.usefixtures("plain_pages")
def test_the_tile_of_the_dispersed_example_says_not_met(run: Run, tmp_path: Path) -> None:
    """And so does the screen, in the same words."""
    done = run("report", "--disperse", "2e3", "-o", "page.html")
    assert done.returncode == 4
    tree = parsed((tmp_path / "page.html").read_text("utf-8").removeprefix("<!DOCTYPE html>"))
    (tile,) = (one for one in tree.all("div") if one.attributes.get("class") == "bad")
    said = tile.all("dd")[0].text
    assert re.fullmatch(r"NOT met: [\d.]+ % of cases comply \(99.7 % required\)", said)
    assert not [one for one in tree.all("div") if one.attributes.get("class") == "good"]
    assert f"Requirement {said}." in done.stderr
    found, *_ = tree.all("table")
    assert [row.all("td")[-1].text for row in found.all("tr")[1:]][::2] == ["NOT met", "NOT met"]
    heads, *rows = table(tree, "What each scheme costs")
    shares = {row[0]: float(row[heads.index("cases that comply %")]) for row in rows}
    assert max(shares, key=lambda name: shares[name]) == "two-pulse"
    assert f"More cases comply with two-pulse ({shares['two-pulse']:.1f} %)" in tree.text
    assert "To look for a plan with which more cases comply: nutdamp plan --robust." in tree.text
    assert tree.text.count(said) == 3  # verdict, tile, dispersion


@pytest.mark.weekly
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("lunar-prospector", "Command-block can be sent as command blocks, which optimal cannot, for "),
        ("magnus-a03", "fires real pulse widths, for "),
    ],
)
def test_the_headline_names_the_plan_that_can_be_sent_or_fired_as_it_stands(
    run: Run, tmp_path: Path, name: str, said: str
) -> None:
    assert run("init", "--from", name, "craft.yaml").returncode == 0
    assert run("report", "craft.yaml", "-o", "page.html").returncode == 0
    tree = parsed((tmp_path / "page.html").read_text("utf-8").removeprefix("<!DOCTYPE html>"))
    (headline,) = (one for one in tree.all("p") if "verdict" in one.attributes.get("class", ""))
    assert said in headline.text


@pytest.mark.weekly
def test_the_same_input_gives_the_same_bytes(run: Run, tmp_path: Path) -> None:
    contents = []
    for _ in range(2):
        done = run("report", "--disperse", "1e3", "--scheme", "two-pulse", "-o", "page.html")
        assert done.returncode == 4, done.stderr
        contents.append((tmp_path / "page.html").read_bytes())
    assert contents[0] == contents[1]


def test_with_three_moments_each_nutation_angle_is_named() -> None:
    """The file's 0.6° is that of t = 0; the angle that pulses are measured by is the largest on the arc."""
    assert ace().all("h1")[0].text == "ACE: damping 0.6 deg of nutation"
    rows = {row[0]: row[1] for row in table(ace(), "Where it points")}
    assert rows["nutation at that time"] == "0.6 deg"
    assert rows["largest nutation from then on, without pulses"] == "0.6015 deg"
    assert "nutation" not in rows


@cache
def turned(horizon: str) -> Node:
    """A body that is to turn to a target 10° away, within a horizon."""
    body = nutdamp.example().with_(goal={"tilt": "10 deg", "azimuth": "45 deg"}, limits={"horizon": horizon})
    made = plain_page(compare(body, ["rhumb-line"]))
    return parsed(page_html(made).removeprefix("<!DOCTYPE html>"))


def cards(tree: Node) -> dict[str, list[str]]:
    """The tiles: what stands below the name of each."""
    tiles = [tile for one in tree.all("dl") if one.attributes.get("class") == "figures" for tile in one.all("div")]
    plain = {tile.all("dt")[0].text: [one.text for one in tile.all("dd")] for tile in tiles}
    return {name: [text.replace("\N{NO-BREAK SPACE}", " ") for text in texts] for name, texts in plain.items()}


@pytest.mark.deep
def test_impulses_are_compared_with_what_the_symbols_explain() -> None:
    heads, row, *_ = table(turned("300 s"), "What each scheme costs")
    shown = dict(zip(heads, row, strict=True))
    symbols = facts(turned("300 s"), "Symbols")
    for name in ("A|ω0|", "C|ω3|β"):
        whole, _, said = symbols[name].partition(" N m s, ")
        assert float(shown["impulse N m s"]) / float(whole) == pytest.approx(
            float(shown[f"impulse × {name}"]), rel=1e-3
        )
        assert said.endswith("no schedule that does so takes less")
    assert facts(ace(), "Symbols")["A|ω0|"].endswith("no floor here, with I1 ≠ I2")


@pytest.mark.deep
def test_the_target_stands_beside_where_it_ends() -> None:
    shown = cards(turned("300 s"))
    for name in ("spin axis ends at", "H ends at"):
        value, note = shown[name]
        assert value == "tilt 10.0000 deg, azimuth 45.0000 deg"
        assert note.startswith("target: tilt 10.0000 deg, azimuth 45.0000 deg; ")
        assert note.endswith(" deg off")


@pytest.mark.deep
def test_without_a_plan_the_tiles_say_what_was_required() -> None:
    shown = cards(turned("9 s"))
    assert shown["requirement"][0] == "NOT met: no scheme is feasible"
    assert shown["target"] == ["tilt 10.0000 deg, azimuth 45.0000 deg", "10 deg from H at t = 0"]
