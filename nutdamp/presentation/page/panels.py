"""The panels of a picture one by one, for screens too narrow to show them side by side."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from nutdamp.presentation import figures
from nutdamp.presentation.figures.export import FONTS
from nutdamp.presentation.page.document import Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

POINTS = 72.0
"""Units of an SVG in an inch."""

MARGIN = 3.0
"""Units about a panel."""


def apart(figure: Figure, caption: str, described: str) -> Picture:
    """The picture of a ``figure``, whose columns of panels are shown below each other where there is little room.

    Those are views of the same drawing, which has an id for them: so they take a line each and not a second picture.
    """
    svg = figures.svg(figure)
    name = "p" + hashlib.sha256(svg.encode()).hexdigest()[:8]
    begin, end = svg.index(">") + 1, svg.rindex("</svg>")
    return Picture(
        f'{svg[:begin]}<g id="{name}" style="font-family: {FONTS}">{svg[begin:end]}</g></svg>',
        caption,
        described,
        name,
        _boxes(figure),
    )


def _boxes(figure: Figure) -> tuple[str, ...]:
    """The views of title, columns and legends, from the top; none for a single column. The figure has been drawn."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.transforms import Bbox

    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    columns: list[Bbox] = []
    for axes in sorted(figure.axes, key=lambda one: float(one.get_position().x0)):
        box = axes.get_tightbbox(renderer)
        if box is None:
            continue
        if columns and box.x0 < columns[-1].x1:
            box = Bbox.union([columns.pop(), box])
        columns.append(box)
    if len(columns) < 2:
        return ()
    title = figure._suptitle  # type: ignore[attr-defined]  # there is no other way to it
    titles = [] if title is None else [title.get_window_extent(renderer)]
    legends = [legend.get_window_extent(renderer) for legend in figure.legends]
    return tuple(_view(figure, box) for box in (*titles, *columns, *legends))


def _view(figure: Figure, box: Bbox) -> str:
    """A box in pixels of a figure as the ``viewBox`` of its SVG."""
    scale = POINTS / figure.dpi
    left, top = scale * box.x0 - MARGIN, POINTS * figure.get_figheight() - scale * box.y1 - MARGIN
    sizes = (scale * box.width + 2.0 * MARGIN, scale * box.height + 2.0 * MARGIN)
    return " ".join(f"{value:.1f}" for value in (left, top, *sizes))
