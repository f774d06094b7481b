"""The page of report and its moving view in a real browser. Needs the extra ``browser``."""

import json
import math
import re
from collections.abc import Callable
from functools import cache
from itertools import accumulate
from pathlib import Path
from typing import Any

import pytest
from support import places
from support.cases import spread
from support.shown import part

from nutdamp.files.reader import example_text, read_spacecraft
from nutdamp.page.moving import LEAD, NONE
from nutdamp.page.report import Repeat, page_html, report_page
from nutdamp.planning.decision import compare
from nutdamp.schemes.catalogue import CLASSIC

pytestmark = [pytest.mark.browser, pytest.mark.usefixtures("plans_shared")]

CONFIGS = places.CONFIGS
LEAP = (CONFIGS / "single-thruster.yaml").read_text(encoding="utf-8")
EXAMPLE = example_text()
TARGET = places.case("far-target.yaml").read_text(encoding="utf-8")

Browse = Callable[..., Any]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """The page of a spacecraft file, made once."""
    folder = tmp_path_factory.mktemp("pages")

    @cache
    def page(text: str, schemes: tuple[str, ...] = CLASSIC, name: str = "a") -> Path:
        compared = compare(read_spacecraft(text, f"{name}.yaml"), schemes)
        repeat = Repeat(f"nutdamp report {name}.yaml", f"{name}.yaml", text)
        target = folder / f"{len([*folder.iterdir()])}.html"
        target.write_text(page_html(report_page(compared, repeat)), encoding="utf-8")
        return target

    return page


def text(page: Any, name: str) -> str:
    found: str = part(page, name).text_content()
    return found


def row(page: Any) -> int:
    return int(part(page, "slider").input_value())


def data_of(page: Any) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(page.locator(".moving script").text_content())
    found["rows"] = {name: list(accumulate(steps)) for name, steps in found["columns"].items()}
    return found


def place(page: Any, which: str) -> tuple[float, float]:
    """Where the cursor of a panel is, in units of its SVG."""
    moved = part(page, which).locator("circle.cursor").get_attribute("transform")
    x, y = map(float, re.findall(r"[-\d.]+", moved))
    return x, y


def on_screen(page: Any, which: str, x: float, y: float) -> tuple[float, float]:
    """Where a place in a panel, in units of its SVG, lies in the window."""
    box = part(page, which).bounding_box()
    return box["x"] + x / 2000 * box["width"], box["y"] + y / 2000 * box["height"]


@spread("file", [EXAMPLE, LEAP, TARGET], quick=1, ids=["example", "leap", "target"])
def test_its_numbers_are_those_of_its_rows(browse: Browse, written: Any, file: str) -> None:
    with browse(written(file)) as page:
        data = data_of(page)
        rows, digits = data["rows"], data["digits"]
        last = len(rows["t"]) - 1
        assert part(page, "slider").get_attribute("max") == str(last)
        assert (part(page, "utc").count() == 1) == (data["utc"] is not None)
        for now in (0, last // 7, last // 3, last // 2, last):
            part(page, "slider").fill(str(now))
            for name, kind, unit in (
                ("t", "t", " s"),
                *((angle, "cone", "°") for angle in ("theta", "mu", "lambda")),
                *((angle, "angle", "°") for angle in ("angle1", "angle2")),
            ):
                number = f"{rows[name][now] / 10 ** digits[kind]:z.{digits[kind]}f}{unit}"
                assert text(page, name) == ("–" if rows[name][now] == NONE else number)
            said = part(page, "slider").get_attribute("aria-valuetext")
            assert said.startswith(f"{text(page, 't')}, nutation {text(page, 'theta')}")
            if data["utc"] is not None:
                assert text(page, "utc") == data["utc"]["head"] + data["utc"]["tails"][now]


def test_one_cursor_moves_in_every_picture(browse: Browse, written: Any) -> None:
    with browse(written(EXAMPLE)) as page:
        data = data_of(page)
        rows = data["rows"]
        fired = set()
        for now in (
            0,
            40,
            200,
            next(r for r, on in enumerate(rows["firing"]) if on),
            len(rows["t"]) - 1,
        ):
            part(page, "slider").fill(str(now))
            assert place(page, "pole") == (rows["pole1"][now], rows["pole2"][now])
            assert place(page, "sky") == (rows["sky1"][now], rows["sky2"][now])
            left = part(page, "time").evaluate("(line) => parseFloat(line.style.left)")
            share = rows["t"][now] / 10 ** data["digits"]["t"] / data["until"]
            assert left == pytest.approx(100 * (LEAD + (1 - LEAD) * share), abs=1e-3)
            assert text(page, "firing") == data["firings"][rows["firing"][now]]
            fired.add(text(page, "firing") == "none")
            on = part(page, "pole-curves").evaluate("(group) => group.classList.contains('on')")
            assert on == (text(page, "firing") != "none")
        assert fired == {True, False}


def test_the_thumb_of_the_slider_stays_below_the_cursor(browse: Browse, written: Any) -> None:
    """Half of the thumb, 8 px, is within the track on either side."""
    with browse(written(EXAMPLE)) as page:
        last = int(part(page, "slider").get_attribute("max"))
        for now, side in ((0, 8.0), (last, -8.0)):
            part(page, "slider").fill(str(now))
            slider, line = part(page, "slider").bounding_box(), part(page, "time").bounding_box()
            end = slider["x"] if now == 0 else slider["x"] + slider["width"]
            assert end + side == pytest.approx(line["x"] + 0.5 * line["width"], abs=1.0)


def test_what_an_impulse_at_t_zero_changes_is_drawn_before_it(browse: Browse, written: Any) -> None:
    """Its curve begins at the left edge, level to t = 0; that of other flights begins at t = 0."""
    for text_, level in (
        ((CONFIGS / "magnus-a03.yaml").read_text(encoding="utf-8"), True),
        (EXAMPLE, False),
    ):
        with browse(written(text_)) as page:
            path = page.locator(".moving .angles path.theta").get_attribute("d")
            (x, y), (x_next, y_next) = (
                map(float, place.split()) for place in path[1:].split("L")[:2]
            )
            assert x == (0.0 if level else 2000.0 * LEAD)
            assert (x_next == 2000.0 * LEAD and y_next == y) == level


def test_pointing_at_a_curve_moves_the_cursor_there(browse: Browse, written: Any) -> None:
    with browse(written(EXAMPLE)) as page:
        page.locator(".moving").scroll_into_view_if_needed()
        rows = data_of(page)["rows"]
        for panel in ("pole", "sky"):
            part(page, panel).scroll_into_view_if_needed()
            for wanted in (40, 90, 150):
                x, y = rows[f"{panel}1"][wanted], rows[f"{panel}2"][wanted]
                page.mouse.move(*on_screen(page, panel, x, y))
                assert math.dist(place(page, panel), (x, y)) < 30
            before = row(page)
            page.mouse.move(*on_screen(page, panel, 1900, 30))  # far from every curve
            assert row(page) == before
        strip = part(page, "strip")
        strip.scroll_into_view_if_needed()
        box = strip.bounding_box()
        for fraction in (0.25, 0.5, 0.9):
            page.mouse.move(box["x"] + fraction * box["width"], box["y"] + 20)
            expected = (fraction - LEAD) / (1 - LEAD) * rows["t"][-1]
            assert rows["t"][row(page)] == pytest.approx(expected, abs=0.005 * rows["t"][-1])


def test_pointing_at_the_globe_moves_the_cursor_and_dragging_turns_it(
    browse: Browse, written: Any
) -> None:
    with browse(written(TARGET)) as page:
        part(page, "globe").scroll_into_view_if_needed()
        last = int(part(page, "slider").get_attribute("max"))
        part(page, "slider").fill(str(last // 3))
        spot = place(page, "globe")
        part(page, "slider").fill("0")
        assert math.dist(spot, place(page, "globe")) > 40
        part(page, "globe").scroll_into_view_if_needed()
        page.mouse.move(*on_screen(page, "globe", *spot))
        assert math.dist(spot, place(page, "globe")) < 40
        page.mouse.move(*on_screen(page, "globe", 1000, 1000))
        before = place(page, "globe")
        moment = row(page)
        page.mouse.down()
        page.mouse.move(*on_screen(page, "globe", 1200, 1000), steps=4)
        page.mouse.up()
        assert row(page) == moment
        assert math.dist(before, place(page, "globe")) > 20
        assert part(page, "globe").locator("path.target[d^='M0 -26']").count() == 1
        assert "target" in part(page, "globe").text_content()


@spread("name", ["ace", "single-thruster", "communications-spinner"], quick=1)
def test_no_mark_of_the_motion_lies_over_a_name_on_the_globe(
    browse: Browse, written: Any, name: str
) -> None:
    """ACE flies close to the Sun; the others point to where the equator has its numbers."""
    sun = "" if name == "ace" else "sun: [100 deg, 10 deg]\n"  # else there is no globe
    with browse(written((CONFIGS / f"{name}.yaml").read_text(encoding="utf-8") + sun)) as page:
        globe = part(page, "globe")
        boxes = """(marks) => marks.filter((one) => getComputedStyle(one).visibility !== "hidden")
          .map((one) => one.getBoundingClientRect())
          .map((one) => [one.left, one.top, one.right, one.bottom])"""
        names = globe.locator("text").evaluate_all(boxes)
        assert names
        for moment in (0, int(part(page, "slider").get_attribute("max"))):
            part(page, "slider").fill(str(moment))
            (mark,) = globe.locator("circle.cursor").evaluate_all(boxes)
            for left, top, right, bottom in names:
                assert mark[2] <= left or mark[0] >= right or mark[3] <= top or mark[1] >= bottom


@pytest.mark.parametrize(("key", "other"), [("ArrowLeft", "ArrowRight"), ("ArrowUp", "ArrowDown")])
def test_arrow_keys_turn_the_globe_and_home_turns_it_back(
    browse: Browse, written: Any, key: str, other: str
) -> None:
    with browse(written(TARGET)) as page:
        globe = part(page, "globe")
        globe.focus()
        drawn = "(svg) => svg.querySelector('.grid path').getAttribute('d')"
        first = globe.evaluate(drawn)
        moment = row(page)
        page.keyboard.press(key)
        assert globe.evaluate(drawn) != first
        page.keyboard.press(other)
        assert globe.evaluate(drawn) == first
        page.keyboard.press(other)
        page.keyboard.press("Home")
        assert globe.evaluate(drawn) == first
        assert row(page) == moment
        assert globe.evaluate("(svg) => getComputedStyle(svg).outlineStyle") == "solid"


def test_keys_move_the_slider(browse: Browse, written: Any) -> None:
    with browse(written(EXAMPLE)) as page:
        slider = part(page, "slider")
        slider.focus()
        assert slider.evaluate("(one) => getComputedStyle(one).outlineStyle") == "solid"
        times = [text(page, "t")]
        for key, expected in (
            ("ArrowRight", 1),
            ("ArrowRight", 2),
            ("ArrowLeft", 1),
            ("End", None),
            ("Home", 0),
        ):
            page.keyboard.press(key)
            assert row(page) == (int(slider.get_attribute("max")) if expected is None else expected)
            times.append(text(page, "t"))
        assert times[0] == times[-1] == "0.000 s"
        assert len(set(times)) == 4
        part(page, "on").click()
        first = row(page)
        assert text(page, "firing").startswith("1: ")
        part(page, "on").click()
        assert text(page, "firing").startswith("2: ")
        part(page, "back").click()
        assert row(page) == first


def until(page: Any, happened: Callable[[], bool]) -> None:
    """Wait for the page; what waits inside it would need eval, which its policy forbids."""
    for _ in range(200):
        if happened():
            return
        page.wait_for_timeout(50)
    pytest.fail("it does not happen")


@pytest.mark.parametrize("motion", ["no-preference", "reduce"])
def test_it_plays_when_it_is_told_to_and_not_before(
    browse: Browse, written: Any, motion: str
) -> None:
    with browse(written(EXAMPLE), reduced_motion=motion) as page:
        page.locator(".moving").scroll_into_view_if_needed()
        page.wait_for_timeout(300)
        assert row(page) == 0
        part(page, "slider").focus()
        page.keyboard.press("Space")
        assert text(page, "play") == "Pause"
        until(page, lambda: row(page) > 3)
        page.keyboard.press("Space")
        assert text(page, "play") == "Play"
        held = row(page)
        page.wait_for_timeout(200)
        assert row(page) == held
        part(page, "speed").select_option(index=part(page, "speed").locator("option").count() - 1)
        seen = set()
        part(page, "play").click()

        def over() -> bool:
            seen.add(text(page, "firing"))
            return text(page, "play") == "Play"

        until(page, over)
        assert row(page) == int(part(page, "slider").get_attribute("max"))
        part(page, "play").click()  # from the beginning again
        until(page, lambda: row(page) < 300)


def test_no_pulse_is_passed_over_while_it_plays(browse: Browse, written: Any) -> None:
    """However short a pulse is, a frame shows that it fires."""
    with browse(written(TARGET)) as page:  # by impulses without any length
        part(page, "firing").evaluate(
            """(node) => {
            window.fired = [];
            const observer = new MutationObserver(() => window.fired.push(node.textContent));
            observer.observe(node, {childList: true});
            }"""
        )
        part(page, "speed").select_option(index=part(page, "speed").locator("option").count() - 1)
        part(page, "slider").fill("3")
        part(page, "play").click()
        until(page, lambda: text(page, "play") == "Play")
        assert any(said.startswith("2: ") for said in page.evaluate("window.fired"))


UNUSUAL = {
    "no-nutation": "inertia: {A: 120, C: 80}\nomega0: [0, 0, 3]\n",
    "single-pulse-spin-reversed": "inertia: {A: 80, C: 120}\n"
    "state: {spin: -30 rpm, nutation: 3 deg}\n"
    "thrusters: [{name: T1, torque: [0, 12, 0]}]\nlimits: {max_pulses: 1}\n",
    "three-moments": "inertia: {tensor: [[120, 3, 0], [3, 100, 0], [0, 0, 60]]}\n"
    "state: {spin: 6 rpm, nutation: 20 deg}\n",
    "very-small": "inertia: {A: 120, C: 80}\nstate: {spin: 30 rpm, nutation: 4e-7 deg}\n",
    "dots": (
        "inertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\n"
        "limits: {earliest: 3000 s, horizon: 3600 s}\n"
    ),
    "sphere": "inertia: {A: 100, C: 100}\nomega0: [0.1, 0, 3]\n",
}


@spread("name", UNUSUAL, quick=1)
def test_unusual_motions_are_shown_too(browse: Browse, written: Any, name: str) -> None:
    with browse(written(f"name: {name}\n{UNUSUAL[name]}"), 800) as page:
        assert page.locator(".moving").is_visible()
        shapes = (
            "[...document.querySelectorAll('.moving [d], .moving [transform]')]"
            ".map((one) => one.outerHTML).join()"
        )
        for key in ("End", "Home", "PageUp", "End"):
            part(page, "slider").focus()
            page.keyboard.press(key)
            drawn = page.evaluate(shapes)
            assert "NaN" not in drawn
            assert "undefined" not in drawn
        said = page.locator(".moving dl").text_content()
        assert "NaN" not in said
        assert "undefined" not in said
        assert row(page) == int(part(page, "slider").get_attribute("max"))


@spread("width", [360, 400], quick=1)
def test_on_a_phone_the_buttons_stand_in_one_line(browse: Browse, written: Any, width: int) -> None:
    with browse(written(EXAMPLE), width) as page:
        tops = page.eval_on_selector_all(
            ".controls button, .controls select",
            "all => all.map((one) => one.getBoundingClientRect().y)",
        )
        assert len(tops) == 4
        assert max(tops) - min(tops) < 3.0


@spread("width", [400, 800, 1280], quick=1)
def test_nothing_of_it_is_cut(browse: Browse, written: Any, width: int) -> None:
    with browse(written(TARGET), width) as page:
        part(page, "slider").fill("100")
        cut = page.evaluate(
            """[...document.querySelectorAll(".moving *")].filter((one) => {
            const box = one.getBoundingClientRect();
            const beside = box.right > innerWidth + 0.5 || box.left < -0.5;
            return box.width > 0 && !one.closest("defs") && beside;
            }).map((one) => one.outerHTML.slice(0, 90))"""
        )
        assert cut == []
        covered = page.evaluate(
            """[...document.querySelectorAll(".moving .panel svg")].flatMap((svg) => {
            const boxes = [...svg.querySelectorAll("text")]
              .filter((one) => one.closest("[data-part=globe]") === null)
              .map((one) => [one.textContent, one.getBoundingClientRect()]);
            const overlap = (one, other) => one.left < other.right && other.left < one.right
              && one.top + 2 < other.bottom && other.top + 2 < one.bottom;
            return boxes.flatMap(([name, one], place) => boxes.slice(place + 1)
              .filter(([, other]) => overlap(one, other))
              .map(([other]) => [name, other]));
            })"""
        )
        assert covered == []
        height = page.evaluate(
            "[...document.querySelectorAll('.moving .panel text')].map((one) => "
            "one.getBoundingClientRect().height)"
        )
        assert min(height) > 9


# --- the page: length, paper, widths, colours, keyboard

CONFIG_FILES = sorted((places.CONFIGS).glob("*.yaml"))
BUILT_IN, LONG, UNPLANNED = "example", "20 pulses", "no plan"
QUICK = (BUILT_IN, "ace", "lunar-prospector", "magnus-a03", LONG, UNPLANNED)
"""Dispersed cases, the most columns, command blocks, ideal impulses, and the ends of the range."""

BARE = "name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\nrequirement: {nutation: 0.5 deg}\n"
"""A file without thrusters."""

A4 = 186 / 25.4 * 96
"""Width in px between the margins of the page style."""

OVERFLOW = "document.scrollingElement.scrollWidth - innerWidth"

BEYOND = """(selector) => [...document.querySelectorAll(selector)]
  .filter((one) => one.checkVisibility() && !one.closest(".unseen"))
  .filter((one) => one.getBoundingClientRect().right > innerWidth + 0.5)
  .map((one) => [one.getBoundingClientRect().right - innerWidth, one.textContent])"""
"""What stands out of the window, by how many px."""

"""``tab(name, width=1400, scheme="light")``: a page of a configuration in a new tab."""


@pytest.fixture
def pages(written: Callable[..., Path]) -> Callable[[str], Path]:
    """The file of a configuration's page."""

    def page(name: str) -> Path:
        long = EXAMPLE.replace("max_on_time: 2 s", "max_on_time: 0.14 s")
        if name in (LONG, UNPLANNED):
            return written(long if name == LONG else BARE, ("four-pulse",), name)
        files = {path.stem: path.read_text(encoding="utf-8") for path in CONFIG_FILES}
        return written(files.get(name, EXAMPLE), (), name)

    return page


@pytest.fixture
def tab(browse: Browse, pages: Callable[[str], Path]) -> Browse:
    """Opens the page of a configuration by its name."""
    return lambda name, *width_and_scheme, **more: browse(pages(name), *width_and_scheme, **more)


def everywhere() -> list[Any]:
    """All configurations; those not in `QUICK` are slow."""
    names = dict.fromkeys((*QUICK, *(path.stem for path in CONFIG_FILES)))
    groups = {
        name: pytest.mark.xdist_group(name) for name in names
    }  # the page is made by one process
    return [
        pytest.param(
            name, marks=groups[name] if name in QUICK else (groups[name], pytest.mark.deep), id=name
        )
        for name in names
    ]


@pytest.mark.parametrize("name", everywhere())
def test_it_is_five_screens_at_most_and_fits_phones(tab: Browse, name: str) -> None:
    for width in (400, 1280):
        with tab(name, width) as page:
            assert width < 1280 or page.evaluate("document.documentElement.scrollHeight") <= 5 * 800
            for scheme in ("light", "dark"):
                page.emulate_media(color_scheme=scheme)
                assert page.evaluate(OVERFLOW) <= 0
                assert (
                    page.evaluate(
                        BEYOND, "h1, h2, h3, p, dl, ul, .facts, .margins, .wide, figcaption"
                    )
                    == []
                )


@pytest.mark.parametrize("name", everywhere())
def test_it_fits_paper_and_prints_to_four_pages_of_a4_besides_the_sheet(
    tab: Browse, name: str
) -> None:
    with tab(name, round(A4)) as page:
        page.emulate_media(media="print")
        assert page.evaluate(BEYOND, "table, svg, pre") == []
        printed = page.pdf(prefer_css_page_size=True)
        fires = page.evaluate("document.querySelectorAll('#manoeuvre table').length > 0")
        page.evaluate("document.querySelector('#manoeuvre')?.remove()")
        rest = page.pdf(prefer_css_page_size=True)
    pages, besides = (len(re.findall(rb"/Type\s*/Page\b", text)) for text in (printed, rest))
    assert besides <= 4
    assert pages == besides + fires
    boxes = {
        tuple(map(float, box.split())) for box in re.findall(rb"/MediaBox\s*\[(.*?)\]", printed)
    }
    for box in boxes:
        assert box == pytest.approx((0, 0, 210 / 25.4 * 72, 297 / 25.4 * 72), abs=0.5)


def test_the_input_file_is_saved_from_the_page_without_a_network(tab: Browse) -> None:
    """The policy of the page allows it."""
    with tab(BUILT_IN) as page:
        page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
        with page.expect_download() as saved:
            page.locator("a[download]").click()
        assert saved.value.suggested_filename == "example.yaml"
        assert Path(saved.value.path()).read_text(encoding="utf-8") == example_text()


@pytest.mark.parametrize("name", everywhere())
def test_an_accessibility_checker_finds_nothing(
    tab: Browse, violations: Callable[..., Any], name: str
) -> None:
    for width in (1280, 400):
        with tab(name, width) as page:
            page.evaluate(
                "document.querySelectorAll('details').forEach((one) => { one.open = true; })"
            )
            assert violations(page) == []
            page.emulate_media(color_scheme="dark")
            assert violations(page, "color-contrast") == []
            page.evaluate("document.querySelector('html').removeAttribute('lang')")
            assert [rule for rule, _ in violations(page, "html-has-lang")] == [
                "html-has-lang"
            ]  # it does look


def test_no_stop_of_the_keyboard_does_nothing(tab: Browse) -> None:
    """At 1280 px no table or picture scrolls or is a stop; on a phone those that scroll are."""
    stops = """[...document.querySelectorAll("[tabindex='0'], summary, button, input, select, a")]
      .filter((one) => one.checkVisibility() && !one.closest(".moving"))
      .map((one) => one.className || one.tagName)"""
    with tab(BUILT_IN, 1280) as page:
        assert set(page.evaluate(stops)) == {"SUMMARY"}
    with tab(BUILT_IN, 400) as page:
        page.locator("#background summary", has_text="Pulses").click()  # a table with all values
        page.wait_for_function("document.querySelectorAll('.wide[tabindex]').length > 0")
        assert page.evaluate(
            "[...document.querySelectorAll('.wide[tabindex]')]"
            ".every((one) => one.scrollWidth > one.clientWidth)"
        )
        box = page.locator("#background .wide[tabindex]").first
        assert box.get_attribute("aria-label")
        box.focus()
        for _ in range(5):
            page.keyboard.press("ArrowRight")
        page.wait_for_timeout(1000)  # it scrolls smoothly
        assert box.evaluate("(box) => box.scrollLeft") > 0
        first = box.locator("tbody th").first.bounding_box()
        assert first["x"] == pytest.approx(box.bounding_box()["x"], abs=1.0)


@pytest.mark.parametrize("name", [BUILT_IN, "ace"])
def test_without_a_script_and_on_paper_there_is_a_still_picture(tab: Browse, name: str) -> None:
    shown = (
        "[...document.querySelectorAll('.still svg')].filter((one) => one.checkVisibility()).length"
    )
    with tab(name, 1280, "light", java_script_enabled=False) as page:
        assert page.evaluate(shown) == 1
        assert not page.locator(".moving").first.is_visible()
    with tab(name, 1280) as page:
        assert page.evaluate(shown) == 0
        page.emulate_media(media="print")
        assert page.evaluate(shown) == 1
        assert (
            page.evaluate(
                "[...document.querySelectorAll('details')].some((one) => one.checkVisibility())"
            )
            is False
        )


@pytest.mark.parametrize(
    ("name", "state"), [(BUILT_IN, "met"), ("ace", "caution"), (UNPLANNED, "missed")]
)
def test_the_frame_of_the_decision_says_it_in_colour(tab: Browse, name: str, state: str) -> None:
    """Red where it is not met and nowhere else, amber where tolerances were not checked."""
    with tab(name, 1280) as page:
        frame = page.evaluate(
            "getComputedStyle(document.querySelector('#decision')).borderTopColor"
        )
        text = page.evaluate("document.querySelector('#decision').className")
    assert (text, frame) == (
        state,
        {"met": "rgb(0, 114, 178)", "caution": "rgb(138, 90, 0)", "missed": "rgb(180, 35, 24)"}[
            state
        ],
    )


@pytest.mark.parametrize("name", everywhere())
def test_a_page_is_small_enough_to_send(pages: Callable[[str], Path], name: str) -> None:
    assert pages(name).stat().st_size <= 700_000
