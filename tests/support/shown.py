"""What figures and pages show, as tests read it; texts and colours that are whole and visible."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from html.parser import HTMLParser
from itertools import combinations
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.colors import to_hex, to_rgb, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Annotation, Text
from support.builders import aimed, cross, fan, spinner

from nutdamp.figures import geometry, image, overview
from nutdamp.figures.style import FAINT, GREY, INK, PAPER
from nutdamp.files.reader import read_spacecraft
from nutdamp.flight.propagation import Flight, Track
from nutdamp.montecarlo.study import Results, run, study_of
from nutdamp.page.document import Page
from nutdamp.page.report import page_html
from nutdamp.planning import plan as planning
from nutdamp.planning.decision import Comparison, compare
from nutdamp.planning.screening import Dispersion
from nutdamp.schemes.catalogue import CLASSIC
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Attitude, Limits, Requirement, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Schedule, channel_pulse, steerable_pulse

# --- a small reader of HTML for tests: balanced tags, attributes, text; no browser

VOID = {"meta", "link", "br", "img", "hr", "input"}


def part(page: Any, name: str) -> Any:
    """A part of the moving view in a browser."""
    return page.locator(f'.moving [data-part="{name}"]')


@dataclass
class Node:
    """An element with its attributes and what stands in it."""

    tag: str
    attributes: dict[str, str]
    children: list[Node | str] = field(default_factory=list)

    def __iter__(self) -> Iterator[Node]:
        """All elements in it, at any depth."""
        for child in self.children:
            if isinstance(child, Node):
                yield child
                yield from child

    def all(self, tag: str) -> list[Node]:
        return [node for node in self if node.tag == tag]

    @property
    def text(self) -> str:
        return "".join(child if isinstance(child, str) else child.text for child in self.children)


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.root = Node("", {})
        self.stack = [self.root]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names)), f"<{tag}> has an attribute twice: {names}"
        node = Node(tag, {name: value or "" for name, value in attrs})
        self.stack[-1].children.append(node)
        if tag not in VOID:
            self.stack.append(node)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.stack.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.stack[-1].tag == tag, f"</{tag}> ends <{self.stack[-1].tag}>"
        self.stack.pop()

    def handle_data(self, data: str) -> None:
        self.stack[-1].children.append(data)


def parsed(text: str) -> Node:
    """The tree of an HTML text; fails where a tag is left open or closed wrongly."""
    reader = _Reader()
    reader.feed(text)
    reader.close()
    assert reader.stack == [reader.root], f"left open: {[node.tag for node in reader.stack[1:]]}"
    return reader.root


# --- what figures and pages show, as tests read it

WIDE = spinner(channels=cross(20.0))
BODY = spinner(channels=cross(20.0), requirement=Requirement(0.01, 0.005))


def kicks(body: Spacecraft, count: int, step: float, on_time: float) -> Schedule:
    """So many short pulses of all channels in turn, whatever they do."""
    channels = body.channels
    return Schedule(
        tuple(
            channel_pulse(channels[n % len(channels)], 0.5 + n * step, on_time)
            for n in range(count)
        )
    )


NAMES = ("overview", "motion", "course")  # the last one is the picture of the report
TORQUER = Steerable(50.0)
STEERED = spinner(steerable=TORQUER, requirement=Requirement(0.01))
SIXTEEN = spinner(degrees=8.0, channels=fan(16, 20.0))
H_MARKS = "H"

CASES: dict[str, tuple[Spacecraft, Schedule | str]] = {
    "wide pulses": (BODY, "two-pulse"),
    "three moments": (
        spinner(moments=(120, 100, 80), degrees=25.0, channels=cross(40.0)),
        "two-pulse",
    ),
    "three moments, oblate": (
        spinner(moments=(80, 90, 120), degrees=10.0, channels=cross(1.0)),
        Schedule(),
    ),
    "34 pulses": (spinner(degrees=8.0, channels=cross(20.0, max_on_time=0.05)), "four-pulse"),
    "120 pulses": (BODY, kicks(BODY, 120, 0.4, 0.01)),
    "16 channels": (SIXTEEN, kicks(SIXTEEN, 32, 0.45, 0.05)),
    "oblate": (spinner(80, 120, 3.0, 10.0, channels=cross(20.0)), kicks(WIDE, 4, 1.1, 0.2)),
    "reversed": (spinner(120, 80, -3.0, 10.0, channels=cross(20.0)), kicks(WIDE, 4, 1.1, 0.2)),
    "oblate, reversed": (spinner(80, 120, -3.0, 10.0, channels=cross(20.0)), "four-pulse"),
    "needle at 60°": (spinner(239, 6.01, 4.2, 60.0, channels=cross(40.0)), "four-pulse"),
    "ideal impulses": (spinner(80, 120, 3.0, 75.0, steerable=Steerable()), "two-pulse"),
    "0.01°": (spinner(degrees=0.01, channels=cross(1.0)), "two-pulse"),
    "sphere": (spinner(100, 100, 3.0, 10.0, steerable=TORQUER), "two-pulse"),
    "blackouts": (
        spinner(
            channels=cross(20.0),
            limits=Limits(earliest=1.0, blackout=((3.0, 4.5), (6.0, 7.0), (20.0, 25.0))),
        ),
        "four-pulse",
    ),
    "far target": (aimed(spinner(steerable=Steerable()), 110.0, 20.0), "two-pulse"),
    "celestial": (
        replace(BODY, attitude=Attitude(np.array([0.7, 0.1, 0.7, 0.1]))),
        kicks(BODY, 5, 0.9, 0.2),
    ),
    "one pulse": (BODY, kicks(BODY, 1, 1.0, 0.3)),
    "one pulse at once": (STEERED, Schedule((steerable_pulse(TORQUER, 0.2, 1.0, impulse=20.0),))),
    "steered": (
        STEERED,
        Schedule(
            tuple(steerable_pulse(TORQUER, t, t, on_time=0.01) for t in (0.005, 0.9, 1.8, 2.6))
        ),
    ),
    "no pulses": (WIDE, Schedule()),
    "no nutation": (spinner(degrees=0.0, channels=cross(20.0)), Schedule()),
    "long name": (replace(WIDE, name="$x$ of a\nprogramme_with 測 " * 5), "one-pulse"),
}


@cache
def flown(case: str) -> tuple[Flight, Track]:
    """The flight of a case, as far as its pictures reach."""
    body, pulses = CASES[case]
    pulses = planning.plan(body, pulses).pulses if isinstance(pulses, str) else pulses
    made, track = overview.shown(planning.Plan(body, "trial", pulses))
    return made, geometry.drawn(made, track)


@cache
def drawn(name: str, case: str) -> Figure:
    """A figure of a case."""
    return figure_of(name, *flown(case))


def flight_picture(name: str, body: Spacecraft, pulses: Schedule | str = "two-pulse") -> Figure:
    """A figure of a schedule, or of the one of a scheme."""
    plan = (
        planning.plan(body, pulses)
        if isinstance(pulses, str)
        else planning.Plan(body, "trial", pulses)
    )
    return figure_of(name, *overview.shown(plan))


def figure_of(name: str, flight: Flight, track: Track) -> Figure:
    """One of `NAMES`."""
    return overview.flight_figure(name, flight, track)


def studied(body: Spacecraft, count: int, scheme: str = "two-pulse") -> Dispersion:
    """Dispersed cases of the plan of a scheme, flown."""
    plan = planning.plan(body, scheme)
    return Dispersion(run(Results(study_of(body, plan.pulses), count), threads=1), plan=plan)


def points(axes: Axes, label: str) -> Vector:
    """The points of the line of that label, without the gaps."""
    (data,) = (
        np.asarray(one.get_xydata(), dtype=np.float64)
        for one in axes.lines
        if one.get_label() == label
    )
    return np.asarray(data[np.isfinite(data).all(axis=1)])


def legend_words(figure: Figure) -> set[str]:
    """What the legends of a figure and of its parts say."""
    legends = [one for part in (figure, *figure.subfigs) for one in part.legends]
    return {text.get_text() for one in legends for text in one.get_texts()}


def heading(figure: Figure) -> str:
    """The title of a figure in one line."""
    return " ".join(figure.get_suptitle().split())


def notes(axes: Axes) -> list[Annotation]:
    """Labels that are to be seen in a panel."""
    return [one for one in axes.texts if isinstance(one, Annotation) and one.get_visible()]


def check_star(axes: Axes, place: Vector, radius: float) -> None:
    """Fails where a word lies under a star at a place, whose radius is in points."""
    middle = axes.transData.transform(place)
    for note in axes.texts:
        box = note.get_window_extent()
        assert (
            np.hypot(*(np.clip(middle, box.min, box.max) - middle))
            > radius * axes.figure.dpi / 72.0
        ), note.get_text()


@cache
def compared_text(text: str, names: tuple[str, ...] = CLASSIC) -> Comparison:
    """The comparison of schemes for the text of a spacecraft file."""
    return compare(read_spacecraft(text, "craft.yaml"), names)


def tree(page: Page | str) -> Node:
    """What a page holds."""
    return parsed(
        (page if isinstance(page, str) else page_html(page)).removeprefix("<!DOCTYPE html>")
    )


def downloaded(link: Node) -> str:
    """The text of the file that a link holds."""
    head, _, content = link.attributes["href"].partition(",")
    assert head == "data:text/yaml;base64"
    return base64.b64decode(content).decode()


def section(page: Node, name: str) -> Node:
    """The section of that id."""
    (node,) = (node for node in page.all("section") if node.attributes["id"] == name)
    return node


def cells(table: Node) -> list[list[Node]]:
    """The rows of a table, its headings first."""
    return [[cell for cell in row if cell.tag in ("th", "td")] for row in table.all("tr")]


def sheet(node: Node, title: str) -> list[dict[str, str]]:
    """The rows of the table of that title, by their headings."""
    (table,) = (one for one in node.all("table") if one.all("caption")[0].text.startswith(title))
    heads, *rows = [[cell.text for cell in row] for row in cells(table)]
    return [dict(zip(heads, row, strict=True)) for row in rows]


def facts(node: Node, title: str) -> dict[str, str]:
    """The table of that title, which says one thing a row."""
    (table,) = (one for one in node.all("table") if one.all("caption")[0].text.startswith(title))
    return {name.text: value.text for name, value, *_ in cells(table)}


# --- texts and colours of a figure: every text is whole, apart from others, and visible

KEPT = "texts of the tests"
"""Where a figure keeps what it was drawn for."""


def texts(figure: Figure) -> list[tuple[Text, Vector]]:
    """Every text that is drawn, with its box in pixels; a figure is drawn for it once."""
    if KEPT not in vars(figure):
        vars(figure)[KEPT] = list(_drawn(figure).items())
    kept: list[tuple[Text, Vector]] = vars(figure)[KEPT]
    return kept


def _drawn(figure: Figure) -> dict[Text, Vector]:
    found: dict[Text, Vector] = {}
    draw = Text.draw

    def noted(text: Text, renderer: RendererBase) -> None:
        draw(text, renderer)
        if text.get_visible() and text.get_text().strip():
            found[text] = np.array(text.get_window_extent().extents)

    with mock.patch.object(Text, "draw", noted):
        figure.draw_without_rendering()
    return found


def check_layout(figure: Figure) -> None:
    """Fails where a text is cut by the edge of the sheet or covers another."""
    width, height = figure.bbox.size
    found = [(text.get_text(), box) for text, box in texts(figure)]
    for text, (left, low, right, high) in found:
        assert left >= -1.0, text
        assert low >= -1.0, text
        assert right <= width + 1.0, text
        assert high <= height + 1.0, text
    for (text, one), (other_text, other) in combinations(found, 2):
        overlap = np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2])
        assert not (overlap > 1.5).all(), f"{text!r} and {other_text!r}"


PAGE = Path(image.__file__).parents[1] / "page" / "page.css"

Colour = str | tuple[str, float]


def pages() -> list[tuple[str, dict[str, str]]]:
    """Paper, and what colours become on it, of the light and of the dark page."""
    css = PAGE.read_text(encoding="utf-8")
    papers = re.findall(r"--paper: (#\w+)", css)
    inks = re.findall(r"--ink: (#\w+)", css)
    assert len(papers) == len(inks) == 2
    lighter = {INK: inks[1], PAPER: papers[1]}
    for kind in ("fill", "stroke"):
        for selectors, colour in re.findall(
            rf"^\s*(\[style[^{{]*)\{{ {kind}: (#\w+) !important", css, re.MULTILINE
        ):
            for one in re.findall(rf"{kind}: (#\w+)", selectors):
                assert lighter.setdefault(one, colour) == colour
    return [(papers[0], {INK: inks[0], PAPER: papers[0]}), (papers[1], lighter)]


def contrast(one: Colour, other: str) -> float:
    """Ratio of WCAG 2.1 of a colour, which may be translucent, on a paper."""
    *under, alpha = to_rgba(one)
    bright = []
    for parts in (
        np.array(to_rgb(other)),
        alpha * np.array(under) + (1.0 - alpha) * np.array(to_rgb(other)),
    ):
        linear = np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        bright.append(float(np.dot(linear, (0.2126, 0.7152, 0.0722))))
    return (max(bright) + 0.05) / (min(bright) + 0.05)


def best(handle: Artist, paper: str, shades: dict[str, str]) -> float:
    """How well a swatch of a legend is seen: by its fill, edge or line, whichever is best."""
    if isinstance(handle, Line2D):
        colours = [handle.get_color()] if handle.get_linestyle() != "None" else []
        colours += [handle.get_markeredgecolor()] if handle.get_marker() != "None" else []
    else:
        assert isinstance(handle, Patch)
        colours = [
            handle.get_facecolor(),
            *[handle.get_edgecolor()] * (handle.get_linewidth() > 0.0),
        ]
    found = []
    for colour in colours:
        *_, alpha = to_rgba(colour)
        alpha *= handle.get_alpha() or 1.0 if isinstance(handle, Line2D) else 1.0
        name = to_hex(colour)
        found.append(contrast((shades.get(name, name), alpha), paper))
    return max(found)


def check_colours(figure: Figure) -> None:
    """Fails where a word or a swatch cannot be seen on the light or on the dark page."""
    for paper, shades in pages():
        for text, _ in texts(figure):
            colour = to_hex(text.get_color())
            assert contrast(shades.get(colour, colour), paper) >= 4.5, text.get_text()
        for part in (
            figure,
            *figure.subfigs,
            *(inner for outer in figure.subfigs for inner in outer.subfigs),
        ):
            for legend in part.legends:
                for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True):
                    assert handle is not None
                    assert best(handle, paper, shades) >= 3.0, (text.get_text(), paper)
        for axes in figure.axes:
            for one in axes.lines:
                if one.get_color() not in (FAINT, GREY):
                    assert best(one, paper, shades) >= 3.0, one.get_label()
