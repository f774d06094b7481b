"""Pictures of a page: their titles as text above them, and another look for screens that are narrower than they are."""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING

from nutdamp.figures import image
from nutdamp.figures.image import FONTS
from nutdamp.page.document import Picture

if TYPE_CHECKING:
    from matplotlib.backend_bases import RendererBase
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox


POINTS = 72.0
"""Units of an SVG in an inch."""

MARGIN = 3.0
"""Units about a panel."""

HANDLE = 25.0
"""Units from the left edge of an entry of a legend to its text."""

ENLARGED = 1.35
"""Largest number of pixels of a narrow screen for a unit: text of 7.5 units is then 10 pixels high."""


def picture(figure: Figure, caption: str, described: str, narrow: Figure | None = None) -> Picture:
    """The picture of a ``figure``, and of the one to show instead on a narrow screen.

    Without such a one its columns of panels are shown below each other there. Those are views of the same drawing,
    which has an id for them: so they take a line each and not a second picture.
    """
    title, svg = str(figure.get_label()) or figure.get_suptitle(), _untitled(figure)
    if narrow is not None:
        return Picture(svg, title, caption, described, narrow=_untitled(narrow))
    views = _views(figure)
    if not views:
        return Picture(svg, title, caption, described)
    name = "p" + hashlib.sha256(svg.encode()).hexdigest()[:8]
    begin, end = svg.index(">") + 1, svg.rindex("</svg>")
    drawing = f'{svg[:begin]}<g id="{name}" style="font-family: {FONTS}">{svg[begin:end]}</g></svg>'
    return Picture(drawing, title, caption, described, name=name, views=views)


def _untitled(figure: Figure) -> str:
    """The SVG of a figure without the line above it, which breaks where it must as text of the page."""
    title = figure._suptitle  # type: ignore[attr-defined]  # there is no other way to it
    if title is None:
        return image.svg(figure)
    top = POINTS * (figure.get_figheight() - title.get_window_extent(_renderer(figure)).y0 / figure.dpi)
    title.set_visible(False)
    box = f"0 {top:.1f} {POINTS * figure.get_figwidth():.1f} {POINTS * figure.get_figheight() - top:.1f}"
    return re.sub(r'(?<=\bviewBox=")[^"]*', box, image.svg(figure), count=1)


def _renderer(figure: Figure) -> RendererBase:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    renderer: RendererBase = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    return renderer


def _views(figure: Figure) -> tuple[tuple[str, int], ...]:
    """The views of columns and of entries of legends, from the top; none for a single column."""
    from matplotlib.transforms import Bbox

    figure.draw_without_rendering()  # entries of legends are where they were drawn last, in the units of an SVG
    renderer = _renderer(figure)
    columns: list[Bbox] = []
    for axes in sorted(figure.axes, key=lambda panel: float(panel.get_position().x0)):
        box = axes.get_tightbbox(renderer)
        if box is None:
            continue
        if columns and box.x0 < columns[-1].x1:
            box = Bbox.union([columns.pop(), box])
        columns.append(box)
    if len(columns) < 2:
        return ()
    texts = [text.get_window_extent(renderer) for legend in figure.legends for text in legend.get_texts()]
    handle = HANDLE * figure.dpi / POINTS
    entries = [Bbox.from_extents(box.x0 - handle, box.y0, box.x1, box.y1) for box in texts]
    return tuple(_view(figure, box) for box in (*columns, *entries))


def _view(figure: Figure, box: Bbox) -> tuple[str, int]:
    """A box in pixels of a figure as the ``viewBox`` of its SVG, and its largest width in px."""
    scale = POINTS / figure.dpi
    left, top = scale * box.x0 - MARGIN, POINTS * figure.get_figheight() - scale * box.y1 - MARGIN
    sizes = (scale * box.width + 2.0 * MARGIN, scale * box.height + 2.0 * MARGIN)
    return " ".join(f"{value:.1f}" for value in (left, top, *sizes)), round(ENLARGED * sizes[0])
