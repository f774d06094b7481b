"""The page of `report`, without a browser: what stands on it, that nothing breaks out of it, that it needs nothing."""

from __future__ import annotations

import base64
import hashlib
import math
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rich.console import Group
from rich.table import Table
from rich.text import Text
from support import places
from support.cases import deep, weekly
from support.markup import Node
from support.pages import plain_page
from support.process import Run
from support.shown import cells, downloaded, section, sheet, tree

from nutdamp.api import trade
from nutdamp.figures import style
from nutdamp.files.reader import example_text, read_spacecraft
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.page.document import Prose, Sheet, blocks_of, number_in
from nutdamp.page.report import CONDITIONS, Repeat, assumptions, block_html, page_html, report_page
from nutdamp.planning.decision import Comparison, compare
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.views import guide
from nutdamp.views.decisions import comparison_json
from nutdamp.views.tables import Heading
from nutdamp.views.verdict import statement

pytestmark = pytest.mark.usefixtures("plans_shared")

VALVE = "valve: {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}\n"
TANK = "tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar, exponent: 1}\n"
CALM = "name: X\ninertia: {A: 120, C: 80}\nomega0: [0, 0, 3]\n"
NO_THRUSTERS = CALM.replace("[0, 0, 3]", "[0.1, 0, 3]")
NASTY = """# </pre><script>alert(1)</script> and `ticks` ``` in a comment
name: '<b>&"|*'
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg, phase: 40 deg}
thrusters:
  - {name: '<i>"[x](y)', torque: [8, 0, 0], isp: 220, lever_arm: 1}
  - {name: 'a|b', torque: [-8, 0, 0], isp: 220, lever_arm: 1}
  - {name: "'&amp;", torque: [0, 8, 0], isp: 220, lever_arm: 1}
  - {name: '$D$', torque: [0, -8, 0], isp: 220, lever_arm: 1}
disturbances:
  - {name: <u>wind, torque: [0.001, 0, 0]}
requirement: {nutation: 0.5 deg}
"""


@cache
def compared_text(text: str, schemes: tuple[str, ...] = CLASSIC, samples: int | None = 0) -> Comparison:
    """The comparison of schemes for the text of a spacecraft file, with nominal values if not told otherwise."""
    return compare(read_spacecraft(text, "craft.yaml"), schemes, samples=samples)


@cache
def page(text: str, *schemes: str, pictured: bool = False, samples: int | None = 0) -> str:
    make = report_page if pictured else plain_page
    repeat = Repeat("nutdamp report 'a <b>.yaml'", "a <b>.yaml", text)
    return page_html(make(compared_text(text, schemes or CLASSIC, samples), repeat))


@pytest.fixture
def nasty() -> Node:
    return tree(page(NASTY, "two-pulse"))


def scripts(node: Node) -> list[Node]:
    """What a browser would run: other types are data."""
    return [one for one in node.all("script") if "type" not in one.attributes]


def test_commands_name_the_spacecraft_by_its_file_if_there_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    keys = (("limits.gap", "1 s"), ("mass", "210"))
    repeat = Repeat("", "my craft.yaml", CALM, keys, ("--spin=keep",))
    assert repeat.craft() == Repeat("", "", "").craft() == "SPACECRAFT"
    Path(repeat.name).write_text(CALM, encoding="utf-8")
    assert repeat.craft() == "'my craft.yaml' '--set=limits.gap=1 s' --set=mass=210 --spin=keep"
    assert repeat.craft(built_in=True) == "'--set=limits.gap=1 s' --set=mass=210 --spin=keep"


# --- form ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "scheme", "pictured"),
    [
        (NO_THRUSTERS, "four-pulse", False),
        deep(NASTY, "two-pulse", False),
        *(weekly(text, "two-pulse", True) for text in (CALM, NASTY, example_text())),
    ],
)
def test_it_is_well_formed_and_needs_no_network(text: str, scheme: str, pictured: bool) -> None:
    content = page(text, scheme, pictured=pictured)
    assert ("NO PULSE needed" in content) == (text is CALM)
    assert content.startswith("<!DOCTYPE html>\n<html lang=")
    shown = tree(content)
    ids = [node.attributes["id"] for node in shown if "id" in node.attributes]
    assert len(ids) == len(set(ids))
    for node in shown:
        for key, value in node.attributes.items():
            if key in ("href", "src", "xlink:href", "data", "srcset", "action"):
                assert value.startswith(("#", "data:,", "data:text/yaml;base64,"))
                assert not value.startswith("#") or value[1:] in ids
            if not key.startswith("xmlns") and not value.startswith("data:"):
                assert "//" not in value or key == "aria-label"
        for used in re.findall(r"url\((.*?)\)", " ".join(node.attributes.values())):
            assert used.strip("'\"").removeprefix("#") in ids
    (style_sheet,) = shown.all("style")
    assert not re.search(r"@import|url\(", style_sheet.text)
    for table in shown.all("table"):
        (caption,) = table.all("caption")
        assert caption.text
        for row in table.all("tr"):
            heads = [node for node in row if node.tag == "th"]
            assert heads
            assert all(head.attributes["scope"] in ("col", "row") and head.text for head in heads)
        assert len({len(row) for row in cells(table)}) == 1
    digest = base64.b64encode(hashlib.sha256(scripts(shown)[0].text.encode()).digest()).decode()
    (policy,) = (node.attributes["content"] for node in shown.all("meta") if "http-equiv" in node.attributes)
    wanted = ["default-src 'none'", "style-src 'unsafe-inline'", f"script-src 'sha256-{digest}'"]
    assert policy.split("; ")[:3] == wanted


@pytest.mark.deep
def test_what_a_file_says_stays_text(nasty: Node) -> None:
    assert nasty.all("h1")[0].text == '<b>&"|*: damp 5° nutation'.replace(": ", " · ")
    assert not nasty.all("u")
    assert not any(node.text for node in nasty.all("i"))
    for node in nasty.all("b"):
        assert node.text.rstrip(":") in (*CLASSIC, "warning", "FLY") or "Basilisk" in node.text
    assert len(scripts(nasty)) == 1
    named = [row[0].text for table in section(nasty, "background").all("table") for row in cells(table)]
    assert {'<i>"[x](y)', "<u>wind"} <= set(named)
    assert nasty.all("pre")[1].text == "nutdamp report 'a <b>.yaml'"
    (link,) = nasty.all("a")
    assert (link.attributes["download"], link.text) == ("a <b>.yaml", "Download a <b>.yaml")
    assert downloaded(link) == NASTY


@pytest.mark.weekly
def test_the_same_input_gives_the_same_page(run: Run, tmp_path: Path) -> None:
    contents = []
    for _ in range(2):
        assert run("report", "--disperse", "3e3", "--scheme", "two-pulse", "-o", "page.html").returncode == 0
        contents.append((tmp_path / "page.html").read_bytes())
    assert contents[0] == contents[1]


@pytest.mark.weekly
def test_pictures_are_inside_and_described() -> None:
    figures = tree(page(example_text(), pictured=True, samples=500)).all("figure")
    drawn = [svg for figure in figures for svg in figure.all("svg")]
    assert len(drawn) >= 5  # motion, history and its narrow form, cases, where H ends
    assert all(one.attributes["aria-label"] and one.attributes["role"] == "img" for one in drawn)
    assert all("viewbox" in one.attributes for one in drawn)


def test_dark_pages_lighten_the_colours_that_the_pictures_use() -> None:
    css = (places.ROOT / "nutdamp" / "page" / "page.css").read_text(encoding="utf-8")
    used = (style.MOTION, style.PULSE, style.MOMENTUM, style.FIRED, style.TURNED, style.MISSED, style.UNCHECKED)
    assert set(re.findall(r"(?:stroke|fill): (#\w+)\"\]", css)) == {colour.lower() for colour in used}


def test_cells_are_numbers_and_options_and_relations_stay_in_one_line() -> None:
    for text, value in (("5", 5.0), ("< 1e-9", 0.0), ("-0.25", -0.25), ("–", None), ("ideal", None), ("", None)):
        assert number_in(text) == value
    made = Sheet("a", (Heading("b"), Heading("c", "s")), (("1", "4"), ("2", "1"), ("3", "–")), dots=("c",))
    assert [[cell.dot for cell in row] for row in made.cells] == [[None, 100.0], [None, 25.0], [None, None]]
    shares = Sheet("a", (Heading("b"), Heading("c", "%")), (("1", "40.4"), ("2", "bias")), bars=("c",))
    assert [row[1].bar for row in shares.cells] == [40.4, None]
    assert block_html(shares).count('<b style="width:40.4%"></b>') == 1
    shown = block_html(Prose("report --disperse flies them; < 1e-9 deg is left, a-b breaks"))
    assert '<span class="whole-word">--disperse</span> flies' in shown
    assert '<span class="whole-word">&lt; 1e-9 deg</span> is left, a-b breaks' in shown


# --- schemes and schedule --------------------------------------------------------------------------------------------


@pytest.mark.deep
@pytest.mark.parametrize(("samples", "recommended"), [(0, "four-pulse"), (None, "two-pulse")])
def test_comparison_and_schedule_say_what_the_json_says(samples: int | None, recommended: str) -> None:
    both = compared_text(example_text(), CLASSIC, samples)
    shown, data = tree(page(example_text(), samples=samples)), comparison_json(both)
    for row, plan in zip(sheet(section(shown, "schemes"), "Cost and residuals"), data["plans"], strict=True):
        assert row["scheme"] == plan["scheme"]
        for head, expected in {
            "end s": plan["end_s"],
            "propellant g": 1e3 * plan["propellant_kg"],
            "momentum shift deg": plan["flown"]["momentum_shift_deg"],
        }.items():
            assert number_in(row[head]) == pytest.approx(expected, rel=1e-3, abs=1e-9)
        assert (row["verdict"] == "met") is (plan["status"] == "fly")
    (marked,) = (one for one in shown.all("tr") if one.attributes.get("class") == "mark")
    assert marked.all("th")[0].text == data["recommended"] == recommended
    assert both.recommended is not None
    fired = sheet(section(shown, "background"), "Pulses of")
    for shot, pulse in zip(fired, both.recommended.pulses, strict=True):
        assert shot["channel"] == pulse.channel
        times = (float(shot["start s"]), float(shot["on-time s"]))
        assert times == pytest.approx((pulse.start, pulse.on_time), abs=1e-4)


@pytest.mark.deep
def test_valves_and_tank_are_told_and_commanded_on_times_apart_from_effective_ones() -> None:
    plain, valved = (page(example_text() + more, "two-pulse") for more in ("", VALVE + TANK))
    told = "11.73 bar"
    assert (told in plain, told in valved) == (False, True)
    for text, through in ((plain, False), (valved, True)):
        heads = sheet(section(tree(text), "background"), "Pulses of")[0]
        assert ("on-time s" in heads, "effective on-time s" in heads) == (True, through)


def test_only_assumptions_that_apply_are_told() -> None:
    texts = [*assumptions(compared_text(CALM, ("one-pulse",)))]
    assert len(texts) == len(guide.limits()) - len(CONDITIONS)
    assert [text for text in texts if text.startswith("Rigid body")]
    several = [*assumptions(compared_text(NASTY, ("two-pulse",)))]
    assert [text.split()[0] for text in several if text not in texts] == ["Disturbances", "two-pulse"]
    for begin in CONDITIONS:
        assert [text for text in guide.limits() if text.startswith(begin)], begin


def test_with_a_wheel_the_page_says_what_its_equations_mean() -> None:
    for wheel in ("", "\nwheel: {momentum: 40 N m s}\n"):
        made = report_page(compared_text(example_text() + wheel, ("one-pulse",)), Repeat("", "", ""))
        assert ("H3 = Cω3 + h" in section(tree(made), "background").text) == bool(wheel)


def test_without_a_feasible_plan_the_page_says_why() -> None:
    only = compared_text(NO_THRUSTERS, ("four-pulse",))
    made = report_page(only, Repeat("", "", ""))
    assert (made.state, made.headline[0]) == ("missed", "NO PLAN")
    assert [one.name for one in made.sections] == ["schemes", "background"]
    assert cells(section(tree(made), "schemes").all("table")[0])[1][-1].text == "no thrusters"
    assert "the file names no thrusters" in tree(made).text


@pytest.mark.weekly
def test_what_an_earlier_end_costs_stands_on_the_page_with_the_recommended_plan_marked() -> None:
    both = compared_text(example_text())
    fronts = trade(both.spacecraft, 3).fronts
    part = section(tree(report_page(both, Repeat("", "", ""), traded=fronts)), "trade")
    tables = part.all("table")
    assert len(tables) == 2
    numbers = [row[0].text for table in tables for row in cells(table)[1:]]
    assert numbers == [str(n) for n in range(1, 1 + sum(len(front.points) for front in fronts))]
    words = {text.text for text in part.all("text")}
    assert both.recommended is not None
    other = "" if both.recommended.scheme == "optimal" else " (not traded)"
    assert {f"recommended: {both.recommended.scheme}{other}", "H ends where it was"} <= words
    assert len([word for word in words if word.startswith("lower bound, ")]) == 1
    assert "H may end anywhere" in part.text
    assert 'id="trade"' not in page(example_text())


DISPERSED = """name: Wide
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg}
steerable: {torque: 20 N m}
requirement: {nutation: 0.5 deg, probability: 90 %}
dispersions: {A: {normal: SIGMA}}
"""


@pytest.mark.parametrize(("sigma", "good"), [deep("5 %", False), weekly("0.1 %", True)])
def test_dispersions_enter_the_verdict(sigma: str, good: bool) -> None:
    both = compared_text(DISPERSED.replace("SIGMA", sigma), ("two-pulse",), 1000)
    assert both.recommended is not None
    assert both.recommended.meets_requirement
    results = run(Results(study_of(both.spacecraft, both.recommended.pulses), 1000), threads=1)
    distribution, made = (
        results.distribution("nutation"),
        (report_page if good else plain_page)(both, Repeat("", "", "")),
    )
    assert distribution is not None
    assert (made.verdict, made.state) == (statement(both.verdict), "met" if good else "missed")
    (margin,) = made.margins
    assert (both.verdict.met, margin.met, margin.used[1] <= 1.0) == (good, good, good)
    part = section(tree(made), "dispersion")
    first = sheet(part, "What is left")[0]
    assert first["quantity"] == "nutation, deg"
    assert float(first["90 %"]) == pytest.approx(math.degrees(distribution.quantiles(np.array([0.9]))[0]), rel=2e-3)
    assert float(first["max"]) == pytest.approx(math.degrees(distribution.maximum), rel=1e-3)
    assert bool(part.all("svg")) == good  # of the good one pictures are made
    assert "A" in {row["input"] for row in sheet(part, "Tolerance budget")}
    assert [one.text for one in part.all("caption")].count("Requirement") == 1


def test_of_several_lines_above_a_table_the_last_is_its_title() -> None:
    table = Table("name", "value")
    table.add_row("nutation", "1")
    first, sheet_, last = blocks_of("usual", Group(Text("a line"), Text("a title"), table, Text("below")))
    assert (first, last) == (Prose("a line"), Prose("below"))
    assert isinstance(sheet_, Sheet)
    assert sheet_.title == "a title"
