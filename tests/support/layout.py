"""What stands where in a figure: every text that is drawn, none cut, none over another."""

from itertools import combinations
from unittest import mock

import numpy as np
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.text import Text

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
