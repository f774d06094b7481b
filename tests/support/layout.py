"""Texts and colours of a figure: every text is whole, apart from others, and visible."""

import re
from itertools import combinations
from pathlib import Path
from unittest import mock

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backend_bases import RendererBase
from matplotlib.colors import to_hex, to_rgb, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

from nutdamp.figures import image
from nutdamp.figures.style import FAINT, GREY, INK, PAPER
from nutdamp.spacecraft.model import Vector

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
