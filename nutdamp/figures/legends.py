"""The heading of a figure, and its legend in as many columns as fit."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from nutdamp.spacecraft.model import Spacecraft

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure


LETTERS = 11.0
"""Bold letters of a heading that fit in an inch."""

LONGEST_NAME = 40
"""Characters of a name that fit above a picture."""


def heading(figure: Figure, spacecraft: Spacecraft, text: str) -> None:
    """The line above a picture, and more of them where it is long: the name of the spacecraft, then ``text``."""
    titled(figure, f"{short_name(spacecraft)}: {text}")


def titled(figure: Figure, text: str) -> None:
    """``text`` above a picture, in as many lines as its width takes."""
    figure.suptitle("\n".join(fill(line, int(LETTERS * figure.get_figwidth())) for line in text.split("\n")))
    figure.set_label(text)  # for pages, which break it by their own width


def short_name(spacecraft: Spacecraft) -> str:
    """The name of the spacecraft, cut where it is too long for a heading."""
    name = " ".join(spacecraft.name.split())
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1].rstrip()}…"


def legend(figure: Figure | SubFigure, axes: Sequence[Axes], columns: int = 8) -> None:
    """One legend under all panels, each name once, where no curve can run into it, in as many columns as fit."""
    handles: dict[str, Artist] = {}
    for panel in axes:
        for handle, name in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(name, handle)
    if handles:
        room = 72.0 * figure.bbox.width / figure.dpi
        fitting = (many for many in range(min(columns, len(handles)), 1, -1) if _across(list(handles), many) <= room)
        drawn = figure.legend(
            list(handles.values()), list(handles), loc="outside lower center", ncols=next(fitting, 1), handlelength=2.2,
            borderpad=0.2, columnspacing=1.4,
        )  # fmt: skip
        for mark in drawn.get_lines():
            mark.set_markersize(max(mark.get_markersize(), DOT))


DOT = 4.0
"""Points that a mark of a legend measures at least, where a curve has smaller ones."""

LETTER = 4.6
"""Points that a letter of a legend takes, about."""

HANDLE = 25.0
"""Points to the left of the text in a legend: its line or mark."""


def _across(names: Sequence[str], columns: int) -> float:
    """Approximate width of a legend that is filled column by column, points."""
    deep, more = divmod(len(names), columns)
    ends = np.cumsum([deep + (index < more) for index in range(columns)]).tolist()
    parts = [names[begin:end] for begin, end in zip([0, *ends[:-1]], ends, strict=True)]
    return sum(HANDLE + LETTER * max(map(len, part)) for part in parts) + 11.0 * (columns - 1)
