"""The page of `report` in a real browser: widths, sorting, colours, print. Needs the extra ``browser`` and Chromium."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from nutdamp.files.spacecraft_file import load_spacecraft
from nutdamp.planning import compare
from nutdamp.presentation.page import pdf
from nutdamp.presentation.page.content import Repeat, report_page
from nutdamp.presentation.page.html import page_html
from nutdamp.schemes import CLASSIC

pytestmark = pytest.mark.browser

CONFIGS = sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))
QUICK = ("ace", "kreisel-course", "lunar-prospector")
"""The most columns, the fewest, and a train of pulses; the others are slow only by their number."""

A4 = 186 / 25.4 * 96
"""Width in px between the margins of the page style."""

OVERFLOW = "document.scrollingElement.scrollWidth - innerWidth"

BEYOND = """(selector) => [...document.querySelectorAll(selector)]
  .filter((one) => one.getBoundingClientRect().right > innerWidth + 0.5)
  .map((one) => [one.getBoundingClientRect().right - innerWidth, one.textContent])"""
"""What stands out of the window, by how many px."""

SPILLED = """[...document.querySelectorAll(".figures dd")]
  .filter((one) => one.scrollWidth > one.clientWidth).map((one) => one.textContent)"""
"""Numbers that stand out of their box."""

Open = Callable[..., Any]
"""``open(name, width=1400, scheme="light")``: a page of a configuration in a new tab."""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """A running browser."""
    why = "NOT CHECKED in a browser: "
    playwright = pytest.importorskip(
        "playwright.sync_api", reason=f"{why}playwright is not installed: pip install 'nutdamp[browser]'"
    )
    executable = pdf.browser()
    if executable is None:
        pytest.skip(f"{why}no Chromium, Chrome or Edge is installed")
    root = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=executable, args=root)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The file of a configuration's page, made once."""
    folder = tmp_path_factory.mktemp("pages")

    def page(name: str) -> Path:
        target = folder / f"{name}.html"
        if not target.exists():
            source = next(path for path in CONFIGS if path.stem == name)
            compared = compare(load_spacecraft(source), CLASSIC)
            repeat = Repeat(f"nutdamp report {name}.yaml", source.name, source.read_text(encoding="utf-8"))
            target.write_text(page_html(report_page(compared, repeat, pictured=True)), encoding="utf-8")
        return target

    return page


@pytest.fixture
def tab(chromium: Any, pages: Callable[[str], Path]) -> Open:
    """Opens pages; whatever the browser complains of or fetches from elsewhere fails the test."""

    @contextmanager
    def opened(name: str, width: int = 1400, scheme: str = "light") -> Iterator[Any]:
        said: list[str] = []
        context = chromium.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
        page = context.new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: said.append(request.url) if request.url[:5] not in ("file:", "data:") else 0)
        page.goto(pages(name).as_uri())
        yield page
        context.close()
        assert said == []

    return opened


def everywhere() -> list[Any]:
    """All configurations; those not in `QUICK` are slow."""
    return [
        pytest.param(path.stem, marks=() if path.stem in QUICK else pytest.mark.slow, id=path.stem) for path in CONFIGS
    ]


@pytest.mark.parametrize("name", everywhere())
def test_it_fits_phones_screens_and_paper(tab: Open, name: str) -> None:
    for width in (400, 1400):
        for scheme in ("light", "dark"):
            with tab(name, width, scheme) as page:
                assert page.evaluate(OVERFLOW) <= 0
                outside = page.evaluate(BEYOND, "h1, h2, h3, p, dl, ul, .facts, .wide, figcaption")
                assert outside == []
                assert page.evaluate(SPILLED) == []
    with tab(name, round(A4)) as page:
        page.emulate_media(media="print")
        assert page.evaluate(BEYOND, "table, svg, pre") == []


@pytest.mark.parametrize("name", QUICK)
def test_it_prints_to_a_few_sheets_of_a4(tab: Open, name: str) -> None:
    with tab(name) as page:
        printed = page.pdf(prefer_css_page_size=True)
    sheets = re.findall(rb"/Type\s*/Page\b", printed)
    assert 3 <= len(sheets) <= 7
    boxes = {tuple(map(float, box.split())) for box in re.findall(rb"/MediaBox\s*\[(.*?)\]", printed)}
    for box in boxes:
        assert box == pytest.approx((0, 0, 210 / 25.4 * 72, 297 / 25.4 * 72), abs=0.5)


def test_the_command_prints_the_same(chromium: Any, pages: Callable[[str], Path]) -> None:
    content = pdf.printed(pages("ace").read_text(encoding="utf-8"), "report.pdf")
    assert content.startswith(b"%PDF-")
    assert 3 <= len(re.findall(rb"/Type\s*/Page\b", content)) <= 7


def column(page: Any, heading: str) -> list[str]:
    """The cells of the scheme table under ``heading``, from the top."""
    cells: list[str] = page.evaluate(
        """(heading) => {
        const table = document.querySelector("#schemes table");
        const place = [...table.tHead.rows[0].cells].findIndex((head) => head.textContent === heading);
        return [...table.tBodies[0].rows].map((row) => row.cells[place].textContent);
        }""",
        heading,
    )
    return cells


def sorting(page: Any) -> list[str | None]:
    order: list[str | None] = page.evaluate(
        """[...document.querySelectorAll("#schemes thead th")].map((head) => head.getAttribute("aria-sort"))"""
    )
    return order


def test_a_click_sorts_and_another_turns_it(tab: Open) -> None:
    with tab("ace") as page:
        planned = column(page, "scheme")
        button = page.locator("#schemes thead button", has_text="shift of H")
        button.click()
        risen = column(page, "shift of H deg")
        assert risen == sorted(risen, key=float)
        assert [one for one in sorting(page) if one] == ["ascending"]
        button.click()
        assert column(page, "shift of H deg") == risen[::-1]
        assert [one for one in sorting(page) if one] == ["descending"]
        page.locator("#schemes thead button", has_text="scheme").click()
        assert column(page, "scheme") == sorted(planned)
        assert sorting(page)[0] == "ascending"
        assert [one for one in sorting(page) if one] == ["ascending"]
        marked = page.locator("#schemes tr.mark th").text_content()
        ace = next(path for path in CONFIGS if path.stem == "ace")
        recommended = compare(load_spacecraft(ace), CLASSIC).recommended
        assert recommended is not None
        assert marked == recommended.scheme


def test_numbers_sort_by_value_and_words_stay_last(tab: Open) -> None:
    with tab("kreisel-course") as page:  # four-pulse is infeasible there; angles are "< 1e-9" or degrees
        button = page.locator("#schemes thead button", has_text="shift of H")
        for expected in (["two-pulse", "one-pulse", "four-pulse"], ["one-pulse", "two-pulse", "four-pulse"]):
            button.click()
            assert column(page, "scheme") == expected


@pytest.mark.parametrize("key", ["Enter", "Space"])
def test_the_keyboard_sorts(tab: Open, key: str) -> None:
    with tab("ace") as page:
        page.locator("#schemes .wide").focus()
        page.keyboard.press("Tab")
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.textContent") == "pulses"
        outline = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
        assert outline == "solid"
        page.keyboard.press("Tab")
        page.keyboard.press(key)
        ends = column(page, "ends at s")
        assert ends == sorted(ends, key=float)
        assert sorting(page)[2] == "ascending"


def test_wide_tables_scroll_in_their_box(tab: Open) -> None:
    with tab("ace", 400) as page:
        box = page.locator("#schemes .wide")
        assert box.evaluate("(box) => box.scrollWidth > box.clientWidth")
        box.focus()
        for _ in range(5):
            page.keyboard.press("ArrowRight")
        for _ in range(
            100
        ):  # it scrolls smoothly; what waits inside the page would need eval, which its policy forbids
            if box.evaluate("(box) => box.scrollLeft") > 0:
                return
            page.wait_for_timeout(50)
        pytest.fail("the arrow keys scroll nothing")


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
def test_text_and_lines_are_read_on_either_ground(tab: Open, scheme: str) -> None:
    """Contrast by WCAG 2: 4.5 for text, 3 for the lines of pictures."""
    with tab("ace", scheme=scheme) as page:
        dark = page.evaluate("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
        assert dark == (scheme == "dark")
        texts = page.evaluate(CONTRAST, "h1, h2, p, li, a, dt, dd, th, td, caption, figcaption, pre, .unit")
        assert min(texts)[0] >= 4.5, min(texts)
        lines = page.evaluate(CONTRAST, '.picture path[style*="stroke-width: 1.3"]')
        assert lines
        assert min(lines)[0] >= 3.0, min(lines)
