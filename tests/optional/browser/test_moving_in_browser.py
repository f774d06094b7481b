"""The moving view in a real browser: slider, pointer, keys, globe, without script and in print."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import shlex
from collections.abc import Callable
from itertools import accumulate
from pathlib import Path
from typing import Any

import pytest
from support import places
from support.cases import spread
from support.places import case
from support.process import Run

from nutdamp.files.reader import example_text, read_spacecraft
from nutdamp.page.moving import LEAD
from nutdamp.page.report import Repeat, page_html, report_page
from nutdamp.planning.decision import compare
from nutdamp.schemes.catalogue import CLASSIC

pytestmark = [pytest.mark.browser, pytest.mark.usefixtures("plans_shared")]

CONFIGS = places.CONFIGS
LEAP = (CONFIGS / "single-thruster.yaml").read_text(encoding="utf-8")
EXAMPLE = example_text()
TARGET = case("far-target.yaml").read_text(encoding="utf-8")

Browse = Callable[..., Any]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The page of a spacecraft file, made once."""
    folder = tmp_path_factory.mktemp("moving")
    known: dict[str, Path] = {}

    def page(text: str) -> Path:
        if text not in known:
            made = report_page(compare(read_spacecraft(text, "a.yaml"), CLASSIC), Repeat("", "", ""))
            known[text] = folder / f"{len(known)}.html"
            known[text].write_text(page_html(made), encoding="utf-8")
        return known[text]

    return page


def part(page: Any, name: str) -> Any:
    return page.locator(f'.moving [data-part="{name}"]')


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
def test_its_numbers_are_those_of_simulate_at_ten_times(browse: Browse, written: Any, run: Run, file: str) -> None:
    with browse(written(file)) as page:
        (command,) = re.findall(r"nutdamp (simulate .*?) FILE", page.locator(".moving .how").text_content())
        done = run(*shlex.split(command.replace("SPACECRAFT", "-")), "-", "-q", stdin=file)
        track = list(csv.DictReader(io.StringIO(done.stdout)))
        last = int(part(page, "slider").get_attribute("max"))
        assert last == len(track) - 1
        for number in range(10):
            place = round(number * last / 9)
            part(page, "slider").fill(str(place))
            expected = track[place]
            digits = len(text(page, "t").removesuffix(" s").split(".")[1])
            assert digits >= 3
            assert text(page, "t") == f"{float(expected['t_s']):.{digits}f} s"
            for name, key in (("theta", "nutation_deg"), ("mu", "body_cone_deg"), ("lambda", "space_cone_deg")):
                assert text(page, name) == f"{float(expected[key]):z.4f}°"
            x, y, z = (float(expected[f"axis_{axis}"]) for axis in "xyz")
            across = math.hypot(x, y)
            framed = "attitude:" in file and file is not EXAMPLE
            height = math.degrees(math.atan2(z, across) if framed else math.atan2(across, z))
            shown = text(page, "angle2" if framed else "angle1")
            assert float(shown.removesuffix("°")) == pytest.approx(height, abs=6e-5)
            shown = text(page, "angle1" if framed else "angle2")
            if across > 1e-9:
                turned = (math.degrees(math.atan2(y, x)) - float(shown.removesuffix("°"))) % 360.0
                assert min(turned, 360.0 - turned) < 6e-5
            else:
                assert shown == "–"
            said = part(page, "slider").get_attribute("aria-valuetext")
            assert said.startswith(f"{text(page, 't')}, nutation {text(page, 'theta')}")
            if framed:
                date = read_spacecraft(file, "a.yaml").utc(float(expected["t_s"]), digits)
                assert text(page, "utc") == date
        assert (part(page, "utc").count() == 1) == framed


def test_one_cursor_moves_in_every_picture(browse: Browse, written: Any) -> None:
    with browse(written(EXAMPLE)) as page:
        data = data_of(page)
        rows = data["rows"]
        fired = set()
        for now in (0, 40, 200, next(r for r, on in enumerate(rows["firing"]) if on), len(rows["t"]) - 1):
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
    for text_, level in (((CONFIGS / "magnus-a03.yaml").read_text(encoding="utf-8"), True), (EXAMPLE, False)):
        with browse(written(text_)) as page:
            path = page.locator(".moving .angles path.theta").get_attribute("d")
            (x, y), (x_next, y_next) = (map(float, place.split()) for place in path[1:].split("L")[:2])
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


def test_pointing_at_the_globe_moves_the_cursor_and_dragging_turns_it(browse: Browse, written: Any) -> None:
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
        before, moment = place(page, "globe"), row(page)
        page.mouse.down()
        page.mouse.move(*on_screen(page, "globe", 1200, 1000), steps=4)
        page.mouse.up()
        assert row(page) == moment
        assert math.dist(before, place(page, "globe")) > 20
        mark = part(page, "globe").locator("path.target[d^='M0 -26']")
        assert mark.count() == 1
        assert "target" in part(page, "globe").text_content()


@spread("name", ["ace", "single-thruster", "communications-spinner"], quick=1)
def test_no_mark_of_the_motion_lies_over_a_name_on_the_globe(browse: Browse, written: Any, name: str) -> None:
    """ACE flies close to the Sun; the others point to where the equator has its numbers."""
    sun = "" if name == "ace" else "sun: [100 deg, 10 deg]\n"  # else there is no globe
    with browse(written((CONFIGS / f"{name}.yaml").read_text(encoding="utf-8") + sun)) as page:
        globe = part(page, "globe")
        boxes = """(marks) => marks.filter((one) => getComputedStyle(one).visibility !== "hidden")
          .map((one) => one.getBoundingClientRect()).map((one) => [one.left, one.top, one.right, one.bottom])"""
        names = globe.locator("text").evaluate_all(boxes)
        assert names
        for moment in (0, int(part(page, "slider").get_attribute("max"))):
            part(page, "slider").fill(str(moment))
            (mark,) = globe.locator("circle.cursor").evaluate_all(boxes)
            for left, top, right, bottom in names:
                assert mark[2] <= left or mark[0] >= right or mark[3] <= top or mark[1] >= bottom


@pytest.mark.parametrize(("key", "other"), [("ArrowLeft", "ArrowRight"), ("ArrowUp", "ArrowDown")])
def test_arrow_keys_turn_the_globe_and_home_turns_it_back(browse: Browse, written: Any, key: str, other: str) -> None:
    with browse(written(TARGET)) as page:
        globe = part(page, "globe")
        globe.focus()
        drawn = "(svg) => svg.querySelector('.grid path').getAttribute('d')"
        first, moment = globe.evaluate(drawn), row(page)
        page.keyboard.press(key)
        turned = globe.evaluate(drawn)
        assert turned != first
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
        for key, expected in (("ArrowRight", 1), ("ArrowRight", 2), ("ArrowLeft", 1), ("End", None), ("Home", 0)):
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
def test_it_plays_when_it_is_told_to_and_not_before(browse: Browse, written: Any, motion: str) -> None:
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
            """(node) => { window.fired = []; new MutationObserver(() => window.fired.push(node.textContent))
            .observe(node, {childList: true}); }"""
        )
        part(page, "speed").select_option(index=part(page, "speed").locator("option").count() - 1)
        part(page, "slider").fill("3")
        part(page, "play").click()
        until(page, lambda: text(page, "play") == "Play")
        assert any(said.startswith("2: ") for said in page.evaluate("window.fired"))


UNUSUAL = {
    "no-nutation": "inertia: {A: 120, C: 80}\nomega0: [0, 0, 3]\n",
    "single-pulse-spin-reversed": "inertia: {A: 80, C: 120}\nstate: {spin: -30 rpm, nutation: 3 deg}\n"
    "thrusters: [{name: T1, torque: [0, 12, 0]}]\nlimits: {max_pulses: 1}\n",
    "three-moments": "inertia: {tensor: [[120, 3, 0], [3, 100, 0], [0, 0, 60]]}\n"
    "state: {spin: 6 rpm, nutation: 20 deg}\n",
    "very-small": "inertia: {A: 120, C: 80}\nstate: {spin: 30 rpm, nutation: 4e-7 deg}\n",
    "dots": "inertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\nlimits: {earliest: 3000 s, horizon: 3600 s}\n",
    "sphere": "inertia: {A: 100, C: 100}\nomega0: [0.1, 0, 3]\n",
}


@spread("name", UNUSUAL, quick=1)
def test_unusual_motions_are_shown_too(browse: Browse, written: Any, name: str) -> None:
    with browse(written(f"name: {name}\n{UNUSUAL[name]}"), 800) as page:
        assert page.locator(".moving").is_visible()
        shapes = "[...document.querySelectorAll('.moving [d], .moving [transform]')].map((one) => one.outerHTML).join()"
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


def test_where_nothing_is_feasible_there_is_no_view(browse: Browse, written: Any) -> None:
    text = "name: X\ninertia: {A: 120, C: 80}\nomega0: [0.1, 0, 3]\nlimits: {horizon: 1 ms}\n"
    text += "thrusters: [{name: T, torque: [0, 5, 0], min_on_time: 1 s}]\n"
    with browse(written(text)) as page:
        assert page.locator(".moving").count() == 0
        assert page.locator("h1").is_visible()


def test_without_script_and_in_print_the_pictures_remain(browse: Browse, written: Any) -> None:
    with browse(written(EXAMPLE), java_script_enabled=False) as page:
        assert not page.locator(".moving").is_visible()
        assert page.locator("figure svg").first.is_visible()
    with browse(written(EXAMPLE)) as page:
        assert page.locator(".moving").is_visible()
        page.emulate_media(media="print")
        assert not page.locator(".moving").is_visible()
        assert page.locator("figure svg").first.is_visible()


@spread("width", [360, 400], quick=1)
def test_on_a_phone_the_buttons_stand_in_one_line(browse: Browse, written: Any, width: int) -> None:
    with browse(written(EXAMPLE), width) as page:
        tops = page.eval_on_selector_all(
            ".controls button, .controls select", "all => all.map((one) => one.getBoundingClientRect().y)"
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
            return box.width > 0 && !one.closest("defs") && (box.right > innerWidth + 0.5 || box.left < -0.5);
            }).map((one) => one.outerHTML.slice(0, 90))"""
        )
        assert cut == []
        covered = page.evaluate(
            """[...document.querySelectorAll(".moving .panel svg")].flatMap((svg) => {
            const boxes = [...svg.querySelectorAll("text")].filter((one) => one.closest("[data-part=globe]") === null)
              .map((one) => [one.textContent, one.getBoundingClientRect()]);
            return boxes.flatMap(([name, one], place) => boxes.slice(place + 1).filter(([, other]) =>
              one.left < other.right && other.left < one.right
              && one.top + 2 < other.bottom && other.top + 2 < one.bottom
            ).map(([other]) => [name, other]));
            })"""
        )
        assert covered == []
        height = page.evaluate(
            "[...document.querySelectorAll('.moving .panel text')].map((one) => one.getBoundingClientRect().height)"
        )
        assert min(height) > 9
