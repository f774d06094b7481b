"""The page of `report`, without a browser: what stands on it, that nothing breaks out of it, that it needs nothing."""

from __future__ import annotations

import base64
import hashlib
import math
import re
from collections.abc import Callable

import numpy as np
import pytest
from support import places
from support.cases import spread
from support.markup import Node, parsed
from support.pages import plain_page

from nutdamp.comparison import Comparison, compare
from nutdamp.dispersion import study_of
from nutdamp.dispersion.study import Results, run
from nutdamp.files.examples import example_text
from nutdamp.files.plan_json import comparison_json
from nutdamp.files.spacecraft_file import read_spacecraft
from nutdamp.library.studies import trade
from nutdamp.presentation.figures import style
from nutdamp.presentation.page.content import Repeat, report_page
from nutdamp.presentation.page.craft import spacecraft_facts
from nutdamp.presentation.page.document import Page
from nutdamp.presentation.page.html import number_in, page_html
from nutdamp.schemes import CLASSIC

pytestmark = pytest.mark.usefixtures("plans_shared")

PAGE = places.ROOT / "nutdamp" / "presentation" / "page"

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


def compared(text: str, names: tuple[str, ...] = CLASSIC) -> Comparison:
    return compare(read_spacecraft(text, "craft.yaml"), names)


def page(text: str, make: Callable[..., Page] = plain_page) -> str:
    return page_html(make(compared(text), Repeat("nutdamp report 'a <b>.yaml'", "a <b>.yaml", text)))


@pytest.fixture(scope="module")
def example() -> str:
    return page(example_text(), report_page)


@pytest.fixture(scope="module")
def nasty() -> str:
    return page(NASTY, report_page)


def sheet(tree: Node, section: str, place: int = 0) -> tuple[list[str], list[list[Node]]]:
    """Headings and rows of a table of a section."""
    (found,) = (node for node in tree.all("section") if node.attributes["id"] == section)
    table = [node for node in found.all("table") if "sheet" in node.attributes["class"].split()][place]
    rows = [[cell for cell in row if cell.tag in ("th", "td")] for row in table.all("tr")]
    return [cell.text for cell in rows[0]], rows[1:]


def scripts(tree: Node) -> list[Node]:
    """What a browser would run: other types are data."""
    return [node for node in tree.all("script") if "type" not in node.attributes]


@pytest.mark.weekly
@spread("name", ["example", "nasty"], quick=1, deep=0)
def test_it_is_well_formed_and_needs_no_network(name: str, request: pytest.FixtureRequest) -> None:
    text = request.getfixturevalue(name)
    assert text.startswith("<!DOCTYPE html>\n<html lang=")
    tree = parsed(text.removeprefix("<!DOCTYPE html>"))
    ids = [node.attributes["id"] for node in tree if "id" in node.attributes]
    assert len(ids) == len(set(ids))
    for node in tree:
        for key, value in node.attributes.items():
            if key in ("href", "src", "xlink:href", "data", "srcset", "action"):
                assert value.startswith(("#", "data:,"))
                assert not value.startswith("#") or value[1:] in ids
            if not key.startswith("xmlns"):
                assert "//" not in value or key == "aria-label"
        for used in re.findall(r"url\((.*?)\)", " ".join(node.attributes.values())):
            assert used.strip("'\"").removeprefix("#") in ids
    (style_sheet,) = tree.all("style")
    assert "@import" not in style_sheet.text
    assert "url(" not in style_sheet.text


def test_every_table_has_a_caption_and_headings(example: str) -> None:
    tables = parsed(example).all("table")
    assert len(tables) >= 6
    for table in tables:
        assert len(table.all("caption")) == 1
        assert table.all("caption")[0].text
        for row in table.all("tr"):
            heads = [node for node in row if node.tag == "th"]
            assert heads
            assert all(head.attributes["scope"] in ("col", "row") and head.text for head in heads)
        widths = {len([cell for cell in row if cell.tag in ("th", "td")]) for row in table.all("tr")}
        assert len(widths) == 1


def test_cells_that_stand_alone_on_narrow_screens_say_column_and_unit(example: str) -> None:
    tables = [one for one in parsed(example).all("table") if "stacked" in one.attributes["class"].split()]
    named = 0
    for table in tables:
        heads, *rows = table.all("tr")
        columns = [head.text.replace(",", "") for head in heads if head.tag == "th"]
        named += sum(bool(head.all("span")) for head in heads if head.tag == "th")
        for row in rows:
            cells = [cell for cell in row if cell.tag in ("th", "td")]
            names = [cell.attributes["data-name"].replace("\xa0", " ") for cell in cells[1:]]
            assert [name.replace(",", "") for name in names] == columns[1:]
            if cells[0].attributes.get("class") == "number":
                assert cells[0].attributes["data-name"] == columns[0]
    assert named, "no column has a unit"


@pytest.mark.deep
def test_what_a_file_says_stays_text(nasty: str) -> None:
    tree = parsed(nasty.removeprefix("<!DOCTYPE html>"))
    assert tree.all("h1")[0].text.startswith('<b>&"|*: damping 5 deg')
    for tag in ("b", "i", "u"):
        assert all(node.text.rstrip(":") in CLASSIC or "Basilisk" in node.text for node in tree.all(tag))
    assert len(scripts(tree)) == 1
    assert '<i>"[x](y)' in {row[0].text for row in sheet(tree, "spacecraft")[1]}
    assert "<u>wind" in {row[0].text for row in sheet(tree, "spacecraft", 2)[1]}
    assert tree.all("pre")[1].text == "nutdamp report 'a <b>.yaml'"


def test_the_input_file_stands_there_to_the_letter(nasty: str, example: str) -> None:
    for text, source in ((nasty, NASTY), (example, example_text())):
        shown = parsed(text.removeprefix("<!DOCTYPE html>")).all("pre")[2].text
        assert shown == source.rstrip("\n")


def test_no_other_script_may_run(example: str) -> None:
    tree = parsed(example.removeprefix("<!DOCTYPE html>"))
    digest = base64.b64encode(hashlib.sha256(scripts(tree)[0].text.encode()).digest()).decode()
    (policy,) = (node.attributes["content"] for node in tree.all("meta") if "http-equiv" in node.attributes)
    assert policy.split("; ")[:3] == [
        "default-src 'none'",
        "style-src 'unsafe-inline'",
        f"script-src 'sha256-{digest}'",
    ]


@pytest.mark.deep
def test_the_same_input_gives_the_same_page(example: str) -> None:
    assert page(example_text(), report_page) == example


def test_the_comparison_says_what_the_json_says(example: str) -> None:
    data = comparison_json(compared(example_text()), {})
    heads, rows = sheet(parsed(example), "schemes")
    assert [row[0].text for row in rows] == [plan["scheme"] for plan in data["plans"]]
    for row, plan in zip(rows, data["plans"], strict=True):
        for head, expected in {
            "ends at s": plan["end_s"],
            "impulse N m s": plan["total_impulse_Nms"],
            "propellant g": 1e3 * plan["propellant_kg"],
            "nutation left deg": plan["flown"]["nutation_deg"],
            "shift of H deg": plan["flown"]["momentum_shift_deg"],
            "ΔV m/s": math.hypot(*plan["delta_v_m_s"]),
        }.items():
            cell = row[heads.index(head)]
            shown = float(cell.attributes.get("data-value", cell.text))
            assert shown == pytest.approx(expected, rel=1e-3, abs=1e-9)
        verdict = {True: "met", False: "NOT met"}[plan["meets_requirement"]]
        assert row[heads.index("nominal requirement")].text == verdict
    marks = [row.attributes.get("class") for row in parsed(example).all("tr")]
    assert marks.count("mark") == 1


def test_the_requirement_is_given_once() -> None:
    names = [name for name, _ in spacecraft_facts(read_spacecraft(example_text(), "example")).rows]
    assert names.count("requirement") == 1
    assert names[-1] == "horizon"


def test_the_schedule_is_the_recommended_one(example: str) -> None:
    chosen = compared(example_text()).recommended
    assert chosen is not None
    heads, rows = sheet(parsed(example), "schedule")
    assert len(rows) == len(chosen.pulses)
    for row, pulse in zip(rows, chosen.pulses, strict=True):
        assert row[heads.index("channel")].text == pulse.channel
        assert float(row[heads.index("start s")].text) == pytest.approx(pulse.start, abs=1e-4)
        assert float(row[heads.index("on-time s")].text) == pytest.approx(pulse.on_time, abs=1e-4)


def test_pictures_are_inside_and_described(example: str) -> None:
    drawn = [svg for figure in parsed(example).all("figure") for svg in figure.all("svg")]
    views = [svg for svg in drawn if "role" not in svg.attributes]  # panels of these, for narrow screens
    assert len(views) >= 6
    pictures = [svg for svg in drawn if svg not in views]
    assert len(pictures) == 7  # schemes, motion, cones, history, timeline, and the last two for narrow screens
    for picture in pictures:
        assert picture.attributes["aria-label"]
        assert picture.attributes["role"] == "img"
        assert "viewbox" in picture.attributes


def test_dark_pages_lighten_the_colours_that_the_pictures_use() -> None:
    lightened = set(re.findall(r"(?:stroke|fill): (#\w+)\"\]", (PAGE / "page.css").read_text(encoding="utf-8")))
    assert lightened == {
        colour.lower() for colour in (style.MOTION, style.PULSE, style.MOMENTUM, style.FIRED, style.TURNED)
    }


@pytest.mark.deep
def test_valves_and_tank_are_among_what_the_spacecraft_is() -> None:
    more = (
        "valve: {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}\n"
        "tank: {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar, exponent: 1}\n"
    )
    plain, text = page(example_text()), page(example_text() + more)
    for said in ("Valves: what the shortest and the longest command", "Tank: 22 bar full; 11.73 bar"):
        assert said not in plain
        assert said in text


@pytest.mark.weekly
def test_with_valves_commanded_and_effective_on_times_are_told_apart() -> None:
    """In the columns of both tables, and above the picture, whose bars are the effective ones."""
    valve = "valve: {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}\n"
    for text, through in ((example_text(), False), (example_text() + valve, True)):
        made = report_page(compared(text, ("four-pulse",)), Repeat("", "", ""))
        tree = parsed(page_html(made).removeprefix("<!DOCTYPE html>"))
        for section in ("schedule", "manoeuvre"):
            heads = [head.split(" s")[0] for head in sheet(tree, section)[0]]
            assert ("on-time, commanded" in heads) == through
            assert ("on-time" in heads) != through
        words = " ".join(one.text for one in tree.all("text"))
        assert ("Firings: effective on-times, not the commands" in words) == through
        assert ("The on-times are effective ones" in tree.text) == through
        assert "Firings" in words


def test_without_a_feasible_plan_the_page_says_why() -> None:
    text = page("name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n").replace("two-pulse", "")
    assert "No recommendation" not in text
    only = compared("name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n", ("four-pulse",))
    made = report_page(only, Repeat("", "", ""))
    assert not made.good
    assert [section.name for section in made.sections] == ["spacecraft", "method", "schemes", "assumptions", "repeat"]
    tree = parsed(page_html(made).removeprefix("<!DOCTYPE html>"))
    assert sheet(tree, "schemes")[1][0][1].text == "no thrusters"
    assert "the file names no thrusters" in tree.text


@pytest.mark.weekly
def test_without_nutation_there_is_nothing_to_fire() -> None:
    text = page("name: X\ninertia: {A: 120, C: 80}\nomega0: [0, 0, 3]\n", report_page)
    assert "No pulse is needed." in text
    assert parsed(text.removeprefix("<!DOCTYPE html>")).all("svg")


@pytest.mark.parametrize(
    ("text", "value"), [("5", 5.0), ("< 1e-9", 1e-9), ("-0.25", -0.25), ("–", None), ("ideal", None), ("", None)]
)
def test_numbers_are_found_in_cells(text: str, value: float | None) -> None:
    assert number_in(text) == value


@pytest.mark.weekly
def test_what_an_earlier_end_costs_stands_on_the_page_with_the_recommended_plan_marked() -> None:
    found = compared(example_text())
    fronts = trade(found.spacecraft, 3).fronts
    made = report_page(found, Repeat("", "", ""), traded=fronts)
    tree = parsed(page_html(made).removeprefix("<!DOCTYPE html>"))
    (section,) = (node for node in tree.all("section") if node.attributes["id"] == "trade")
    assert len(section.all("table")) == 2
    rows = [row for number in (0, 1) for row in sheet(tree, "trade", number)[1]]
    assert [row[0].text for row in rows] == [str(n) for n in range(1, 1 + sum(len(front.points) for front in fronts))]
    words = {text.text for text in section.all("text")}
    assert found.recommended is not None
    (bound,) = (word for word in words if word.startswith("lower bound of cost, same nutation left: "))
    other = "" if found.recommended.scheme == "optimal" else " (not traded)"
    assert {f"recommended: {found.recommended.scheme}{other}", "H ends where it was", bound} <= words
    assert "H may end anywhere" in section.text
    assert 'id="trade"' not in page_html(plain_page(found))


DISPERSED = """name: Wide
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 5 deg}
steerable: {torque: 20 N m}
requirement: {nutation: 0.5 deg, probability: 90 %}
dispersions: {A: {normal: SIGMA}}
"""


@pytest.mark.weekly
@pytest.mark.parametrize(("sigma", "good"), [("0.1 %", True), ("5 %", False)])
def test_dispersions_enter_the_verdict(sigma: str, good: bool) -> None:
    found = compared(DISPERSED.replace("SIGMA", sigma), ("two-pulse",))
    assert found.recommended is not None
    assert found.recommended.meets_requirement
    results = Results(study_of(found.spacecraft, found.recommended.pulses), 1000)
    run(results, threads=1)
    make = report_page if good else plain_page
    made = make(found, Repeat("", "", ""), dispersed={"two-pulse": results})
    assert made.good == good
    assert results.met_fraction is not None
    share = f"{100 * results.met_fraction:.1f} % of cases comply (90 % required)"
    said = f"met: {share}" if good else f"NOT met: {share}"
    assert made.verdict.startswith(f"Requirement {said}. ")
    assert {one.name: one.value for one in made.figures}["requirement"] == said  # the tile does not contradict the page
    tree = parsed(page_html(made).removeprefix("<!DOCTYPE html>"))
    heads, rows = sheet(tree, "dispersion")
    assert heads[:2] == ["quantity", "nominal"]
    shown = dict(zip(heads, (cell.text for cell in rows[0]), strict=True))
    assert shown["quantity"] == "nutation, deg"
    distribution = results.distribution("nutation")
    assert distribution is not None
    assert float(shown["90 %"]) == pytest.approx(math.degrees(distribution.quantiles(np.array([0.9]))[0]), rel=2e-3)
    assert float(shown["all"]) == pytest.approx(math.degrees(distribution.maximum), rel=1e-3)
    (section,) = (node for node in tree.all("section") if node.attributes["id"] == "dispersion")
    tables = [node.attributes["class"] for node in section.all("table")]
    assert tables[0] == "sheet"  # each row has a unit of its own: nothing to sort
    assert "sheet sortable" in tables
    assert bool(section.all("svg")) == good  # of the good one pictures are made
    assert "A" in {row[0].text for row in sheet(tree, "dispersion", 1)[1]}
