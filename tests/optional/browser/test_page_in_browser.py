"""The page of `report` in a real browser: length, paper, widths, colours, keyboard. Needs the extra ``browser``."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support import places

from nutdamp.files.reader import example_text, read_spacecraft
from nutdamp.page.document import Page
from nutdamp.page.report import Repeat, page_html, report_page
from nutdamp.planning.decision import compare

pytestmark = [pytest.mark.browser, pytest.mark.usefixtures("plans_shared")]

CONFIGS = sorted((places.CONFIGS).glob("*.yaml"))
EXAMPLE, LONG, UNPLANNED = "example", "20 pulses", "no plan"
QUICK = (EXAMPLE, "ace", "lunar-prospector", "magnus-a03", LONG, UNPLANNED)
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

Browse = Callable[..., Any]
"""``tab(name, width=1400, scheme="light")``: a page of a configuration in a new tab."""


def made(name: str) -> Page:
    """The page of a configuration."""
    source = next((path.read_text(encoding="utf-8") for path in CONFIGS if path.stem == name), example_text())
    source = {LONG: source.replace("max_on_time: 2 s", "max_on_time: 0.14 s"), UNPLANNED: BARE}.get(name, source)
    schemes = {LONG: ("four-pulse",), UNPLANNED: ("four-pulse",)}.get(name, ())
    compared = compare(read_spacecraft(source, f"{name}.yaml"), schemes)
    return report_page(compared, Repeat(f"nutdamp report {name}.yaml", f"{name}.yaml", source))


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The file of a configuration's page, made once."""
    folder = tmp_path_factory.mktemp("pages")

    def page(name: str) -> Path:
        target = folder / f"{name}.html"
        if not target.exists():
            target.write_text(page_html(made(name)), encoding="utf-8")
        return target

    return page


@pytest.fixture
def tab(browse: Browse, pages: Callable[[str], Path]) -> Browse:
    """Opens the page of a configuration by its name."""
    return lambda name, *width_and_scheme, **more: browse(pages(name), *width_and_scheme, **more)


def everywhere() -> list[Any]:
    """All configurations; those not in `QUICK` are slow."""
    names = dict.fromkeys((*QUICK, *(path.stem for path in CONFIGS)))
    groups = {name: pytest.mark.xdist_group(name) for name in names}  # the page is made by one process
    return [
        pytest.param(name, marks=groups[name] if name in QUICK else (groups[name], pytest.mark.deep), id=name)
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
                assert page.evaluate(BEYOND, "h1, h2, h3, p, dl, ul, .facts, .margins, .wide, figcaption") == []


@pytest.mark.parametrize("name", everywhere())
def test_it_fits_paper_and_prints_to_four_pages_of_a4_besides_the_sheet(tab: Browse, name: str) -> None:
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
    boxes = {tuple(map(float, box.split())) for box in re.findall(rb"/MediaBox\s*\[(.*?)\]", printed)}
    for box in boxes:
        assert box == pytest.approx((0, 0, 210 / 25.4 * 72, 297 / 25.4 * 72), abs=0.5)


def test_the_input_file_is_saved_from_the_page_without_a_network(tab: Browse) -> None:
    """The policy of the page allows it."""
    with tab(EXAMPLE) as page:
        page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
        with page.expect_download() as saved:
            page.locator("a[download]").click()
        assert saved.value.suggested_filename == "example.yaml"
        assert Path(saved.value.path()).read_text(encoding="utf-8") == example_text()


def test_the_sheet_has_a_row_for_each_of_twenty_pulses(tab: Browse) -> None:
    with tab(LONG, 1280) as page:
        assert (
            page.evaluate("document.querySelectorAll('#manoeuvre .wide')[0].querySelectorAll('tbody tr').length") == 20
        )


@pytest.mark.parametrize("name", everywhere())
def test_an_accessibility_checker_finds_nothing(tab: Browse, name: str) -> None:
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright",
        reason="NOT CHECKED for accessibility: axe is not installed: pip install 'nutdamp[browser]'",
    ).Axe()

    def found(page: Any, *rules: str) -> list[tuple[str, str]]:
        response = axe.run(
            page, options={"resultTypes": ["violations"], **({"runOnly": rules} if rules else {})}
        ).response
        return [(one["id"], node["html"][:200]) for one in response["violations"] for node in one["nodes"]]

    for width in (1280, 400):
        with tab(name, width) as page:
            page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
            assert found(page) == []
            page.emulate_media(color_scheme="dark")
            assert found(page, "color-contrast") == []
            page.evaluate("document.querySelector('html').removeAttribute('lang')")
            assert [rule for rule, _ in found(page, "html-has-lang")] == ["html-has-lang"]  # it does look


def test_no_stop_of_the_keyboard_does_nothing(tab: Browse) -> None:
    """At 1280 px no table or picture scrolls, and none is a stop; on a phone those that scroll are."""
    stops = """[...document.querySelectorAll("[tabindex='0'], summary, button, input, select, a")]
      .filter((one) => one.checkVisibility() && !one.closest(".moving")).map((one) => one.className || one.tagName)"""
    with tab(EXAMPLE, 1280) as page:
        assert set(page.evaluate(stops)) == {"SUMMARY"}
    with tab(EXAMPLE, 400) as page:
        page.wait_for_function("document.querySelectorAll('.wide[tabindex]').length > 0")
        assert page.evaluate(
            "[...document.querySelectorAll('.wide[tabindex]')].every((one) => one.scrollWidth > one.clientWidth)"
        )
        box = page.locator("#schemes .wide").first
        assert box.get_attribute("aria-label")
        box.focus()
        for _ in range(5):
            page.keyboard.press("ArrowRight")
        page.wait_for_timeout(1000)  # it scrolls smoothly
        assert box.evaluate("(box) => box.scrollLeft") > 0
        first = box.locator("tbody th").first.bounding_box()
        assert first["x"] == pytest.approx(box.bounding_box()["x"], abs=1.0)


@pytest.mark.parametrize("name", [EXAMPLE, "ace"])
def test_without_a_script_and_on_paper_there_is_a_still_picture(tab: Browse, name: str) -> None:
    shown = "[...document.querySelectorAll('.still svg')].filter((one) => one.checkVisibility()).length"
    with tab(name, 1280, "light", java_script_enabled=False) as page:
        assert page.locator(".still svg").first.is_visible()
        assert not page.locator(".moving").first.is_visible()
    with tab(name, 1280) as page:
        assert page.evaluate(shown) == 0
        page.emulate_media(media="print")
        assert page.evaluate(shown) >= 2
        assert page.evaluate("[...document.querySelectorAll('details')].some((one) => one.checkVisibility())") is False


@pytest.mark.parametrize(("name", "state"), [(EXAMPLE, "met"), ("ace", "caution"), (UNPLANNED, "missed")])
def test_the_frame_of_the_decision_says_it_in_colour(tab: Browse, name: str, state: str) -> None:
    """Red where it is not met and nowhere else, amber where tolerances were not checked."""
    with tab(name, 1280) as page:
        frame = page.evaluate("getComputedStyle(document.querySelector('#decision')).borderTopColor")
        text = page.evaluate("document.querySelector('#decision').className")
    assert (text, frame) == (
        state,
        {"met": "rgb(0, 114, 178)", "caution": "rgb(138, 90, 0)", "missed": "rgb(180, 35, 24)"}[state],
    )


@pytest.mark.parametrize("name", everywhere())
def test_a_page_is_small_enough_to_send(pages: Callable[[str], Path], name: str) -> None:
    assert pages(name).stat().st_size <= 700_000


CONTRAST = """(selector) => {
  const colour = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = (rgb) => {
    const part = rgb.slice(0, 3).map((c) => (c /= 255) <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
    return 0.2126 * part[0] + 0.7152 * part[1] + 0.0722 * part[2];
  };
  const behind = (node) => {
    for (; node; node = node.parentElement) {
      const found = colour(getComputedStyle(node).backgroundColor);
      if (found.length < 4 || found[3] > 0) return found;
    }
    return [255, 255, 255];
  };
  return [...document.querySelectorAll(selector)].map((node) => {
    const style = getComputedStyle(node);
    const ink = node instanceof SVGElement ? (style.fill !== "none" ? style.fill : style.stroke) : style.color;
    const [one, other] = [light(colour(ink)), light(behind(node))].sort();
    const ratio = (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);
    return [ratio, node.tagName + "." + (node.className.baseVal ?? node.className) + " " + ink];
  });
}"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_read_on_either_ground(tab: Browse, scheme: str) -> None:
    """Contrast by WCAG 2: 4.5 for text."""
    with tab(EXAMPLE, 1280, scheme) as page:
        dark = page.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
        assert dark == (scheme == "dark")
        texts = page.evaluate(CONTRAST, "h1, h2, h3, p, li, summary, th, td, caption, figcaption, pre, .unit")
        assert min(texts)[0] >= 4.5, min(texts)
