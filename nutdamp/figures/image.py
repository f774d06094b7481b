"""Figures as files and as inline SVG."""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nutdamp.errors import BadRequest
from nutdamp.figures import style
from nutdamp.figures.labels import panels
from nutdamp.figures.style import INK, PAPER

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FORMATS = ("png", "svg", "pdf")

POINTS = 72.0
"""Units of an SVG in an inch."""

LONG = 30
"""Points of a polyline from which an inline SVG has it in tenths of a point, half a pixel at four times its size."""

FONT = "'DejaVu Sans'"
FONTS = f"{FONT}, 'Bitstream Vera Sans', Verdana, sans-serif"
"""Fonts of text in SVG: that of the layout, and a substitute of the same width where that is not installed."""

# No dates in the file, so that the same flight gives the same picture.
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": "nutdamp"},
    "svg": {"Date": None, "Creator": "nutdamp"},
    "pdf": {"CreationDate": None, "Creator": "nutdamp"},
}


def ending(path: str, option: str = "--plot", formats: Sequence[str] = FORMATS) -> str:
    """The format of a picture by the ending of its file, the first of ``formats`` for standard output.

    Raises BadRequest for other endings, MissingExtra without matplotlib.
    """
    suffix = formats[0] if path == "-" else Path(path).suffix.lstrip(".").lower()
    if suffix not in formats:
        raise BadRequest(f"{option} {path}: the ending says the format; use one of .{', .'.join(formats)}")
    style.require()
    return suffix


@style.styled
def rendered(figure: Figure, path: str) -> bytes:
    """The figure as the content of a file, vector or not by the ending of ``path``; raises BadRequest for others."""
    kind = ending(path)
    stream = io.BytesIO()
    figure.savefig(stream, format=kind, metadata=_METADATA[kind])
    content = stream.getvalue()
    return content.replace(FONT.encode(), FONTS.encode()) if kind == "svg" else content


def _brief(path: str) -> str:
    """The data of a path to 0.01 points; of long polylines the steps from point to point in tenths of a point.

    Places are rounded, not steps, so that errors do not add up.
    """
    parts = [(part[0], part[1:].split()) for part in re.findall(r"[A-Za-z][^A-Za-z]*", path)]
    if len(parts) < LONG or {letter for letter, _ in parts} - {"M", "L"}:
        return re.sub(r"(\.\d\d)\d+", r"\1", path.replace(" \n", "").rstrip())
    brief, (x, y), before = "", (0, 0), ""
    for letter, numbers in parts:
        to = round(10.0 * float(numbers[0])), round(10.0 * float(numbers[1]))
        step = to if letter == "M" else (to[0] - x, to[1] - y)
        across, along = (f"{value / 10:g}" for value in step)
        name = letter if letter == "M" else "l" if before == "M" else "" if across[0] == "-" else " "
        brief += name + across + (along if along[0] == "-" else " " + along)
        (x, y), before = to, letter
    return brief


def _joined(alike: re.Match[str]) -> str:
    """Neighbouring paths of one look, each in a group of its own, as one path."""
    paths = "".join(re.findall(r' d="([^"]*)"', alike[0]))
    return f'<path d="{paths}"{alike[1]}/>'


@style.styled
def svg(figure: Figure) -> str:
    """The figure as an inline ``<svg>`` element, as wide as its container, on no background.

    Text and frames take the colour of the text around it, so that it suits light and dark pages. Its ids begin with a
    digest of its content: several may be in one page.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    stream = io.StringIO()
    for patch in (figure.patch, *(axes.patch for axes in panels(figure))):
        patch.set(facecolor="none", edgecolor="none")
    # Not by `savefig`, which draws the figure twice.
    FigureCanvasSVG(figure).print_svg(stream, metadata={"Date": None})  # type: ignore[no-untyped-call]
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    # The style of matplotlib for all elements would hold for the whole page; its metadata are no part of the picture.
    text = re.sub(r"<metadata>.*?</metadata>|<style.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r">\s+<", "><", text)
    text = re.sub(r'\s(?:width|height)="[^"]*"', "", text, count=2)
    text = re.sub(r'(?<=\sd=")[^"]*', lambda path: _brief(path[0]), text)
    text = re.sub(rf"font-family: {FONT}; |(?<=\" ) ?transform=\"rotate\(-0 [^)]*\)\"", "", text)
    text = re.sub(r'(?<=\s[xy]=")[^"]*', lambda place: re.sub(r"(\.\d\d)\d+", r"\1", place[0]), text)
    ours = f'<svg width="100%" role="img" style="stroke-linejoin: round; stroke-linecap: butt; font-family: {FONTS}" '
    text = text.replace("<svg ", ours, 1).replace(INK, "currentColor").replace(PAPER, "var(--paper, #fff)")
    # Roles of labels end up as ids, several times over: only ids that something refers to stay.
    used = set(re.findall(r'(?:url\(#|href="#)([^)"]+)', text))
    text = re.sub(r'\sid="([^"]*)"', lambda match: match[0] if match[1] in used else "", text)
    text = re.sub(r'<path d="[^"]*"([^>]*)/>(?:</g><g><path d="[^"]*"\1/>)+', _joined, text)
    mark = "n" + hashlib.sha256(text.encode()).hexdigest()[:8] + "-"
    return re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{mark}", text)


def untitled_svg(figure: Figure) -> str:
    """The SVG of a figure without the line above it, which breaks where it must as text of the page."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    title = figure._suptitle  # type: ignore[attr-defined]  # there is no other way to it
    if title is None:
        return svg(figure)
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    figure.set_layout_engine("none")  # which would move the panels to where the title was
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    top = POINTS * (figure.get_figheight() - title.get_window_extent(renderer).y0 / figure.dpi)
    title.set_visible(False)
    box = f"0 {top:.1f} {POINTS * figure.get_figwidth():.1f} {POINTS * figure.get_figheight() - top:.1f}"
    return re.sub(r'(?<=\bviewBox=")[^"]*', box, svg(figure), count=1)
