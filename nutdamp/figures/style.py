"""The one style of all figures: colours, sizes, marks, numbers, headings and legends."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from functools import wraps
from importlib.util import find_spec
from textwrap import fill
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from nutdamp.errors import MissingExtra
from nutdamp.figures.geometry import room
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Part, required
from nutdamp.views.text import digits

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure


# Okabe & Ito's palette for colour-blind readers (jfly.uni-koeln.de/color); line styles differ too, for grey print.
MOTION, PULSE, MOMENTUM = "#0072B2", "#D55E00", "#009E73"
"""Spin axis, body cone and other motion of the spacecraft; firings; angular momentum and space cone."""

FIRED, TURNED = "#B34700", "#007a58"
"""Words about firings and about H: dark enough to be read on white (5.3:1, WCAG 2.1 requires 4.5:1)."""

MISSED, UNCHECKED = "#b00020", "#8a5a00"
"""A requirement that is NOT met, and nothing else; one that is met while the file has no tolerances to check."""

INK, GREY, FAINT = "#1a1a1a", "#767676", "#7676764d"
"""Text and second curves; limits and axes; the circles of the sphere."""

STAR = 13.0
"""Points across of the star of the target."""

TARGET: dict[str, Any] = {
    "marker": "*", "color": INK, "markersize": STAR, "markerfacecolor": "none", "linestyle": "", "zorder": 4
}  # fmt: skip
"""Mark of the target axis: larger than the marks of ends of paths there, and over them."""

PATH_OF_H: dict[str, Any] = {"color": MOMENTUM, "linewidth": 1.0, "linestyle": (0, (3, 1.5))}
"""Look of the path of H."""

LIMIT: dict[str, Any] = {"color": GREY, "linewidth": 1.3, "linestyle": (0, (6, 2)), "label": "required", "zorder": 1.5}
"""Look of a bound of the requirement."""

PAPER = "#fefefe"
"""Ground under a hollow mark; in a page, its background."""

LINE, THIN, LEADER = 1.3, 0.7, 0.5
"""Line widths, points; the last is that from a label to its point."""

SMALL, TICK_SIZE = 7.5, 8
"""Sizes of labels inside a panel and of those of its ticks, points."""

NOTE: dict[str, Any] = {"fontsize": SMALL, "fontweight": "normal"}
"""Look of a remark above a panel."""

FIGURES = 3
"""Significant figures of the numbers in a picture."""

_SETTINGS: dict[str, Any] = {
    "font.family": ["DejaVu Sans"],  # comes with matplotlib, has the Greek letters
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titley": 1.0,  # else matplotlib measures all tick labels of a panel once more for each title
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.6,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.facecolor": "none",
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.unicode_minus": True,
    "figure.titlesize": 9.5,
    "figure.titleweight": "bold",
    "figure.facecolor": "white",
    "grid.color": GREY,
    "grid.alpha": 0.3,  # matplotlib overlooks the one in a colour
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "legend.labelspacing": 0.9,  # marks reach into no other line
    "lines.linewidth": LINE,
    "lines.solid_capstyle": "round",
    "text.color": INK,
    "text.parse_math": False,  # names may hold a dollar sign
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.labelsize": TICK_SIZE,
    "ytick.labelsize": TICK_SIZE,
    "svg.fonttype": "none",  # text stays text: it can be found, copied and read aloud
    "svg.hashsalt": "nutdamp",  # the same flight gives the same file
}


def require() -> None:
    """Raise MissingExtra where matplotlib is not installed."""
    if find_spec("matplotlib") is None:
        raise MissingExtra("plot", "a picture")


Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def styled(draw: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Draw in this style, whatever the settings of the user's matplotlib; raises MissingExtra without one."""

    @wraps(draw)
    def drawn(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        require()
        from matplotlib import style

        with style.context(["default", _SETTINGS]), warnings.catch_warnings():
            # A name in another script is drawn as boxes, one that is too long leaves no room: no reader can mend that.
            warnings.simplefilter("ignore", UserWarning)
            return draw(*args, **kwargs)

    return drawn


PHONE = 3.7
"""Width of a figure for narrow screens, inches: its smallest text is 10 px high where 360 px show it."""


def sheet(width: float, height: float) -> Figure:
    """An empty figure, inches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=200, layout="constrained")
    figure.get_layout_engine().set(h_pad=0.07)  # type: ignore[union-attr, call-arg]
    return figure


def heads(axes: Axes, path: Vector, places: Sequence[int], colour: str, size: float = 9.0) -> None:
    """Arrowheads along a ``path`` (n, 2) that show its sense, at some of its rows."""
    look = {"arrowstyle": "-|>", "color": colour, "linewidth": 0, "mutation_scale": size, "shrinkA": 0, "shrinkB": 0}
    for row in places:
        if 0 < row < len(path) and np.any(path[row] != path[row - 1]):
            (x0, y0), (x1, y1) = path[row - 1].tolist(), path[row].tolist()
            axes.annotate("", (x1, y1), (x0, y0), annotation_clip=False, arrowprops=look)


def words(axes: Axes, text: str) -> None:
    """Words in a panel that has nothing to show; no ticks, since there is no scale to read."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center")
    axes.set(xticks=[], yticks=[])


def square(axes: Axes, points: Vector, *, margin: float, centre: bool = False) -> tuple[Vector, float]:
    """Equal scales on both axes, and `room` for all ``points`` (n, 2), which is returned."""
    middle, half = room(points, margin, centre=centre)
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal", adjustable="box")
    axes.locator_params(nbins=6)
    axes.grid()
    return middle, half


def thickness(path: Vector, turns: float | None = None) -> float:
    """Width of the line of a ``path`` (n, 2), points: thinner where many turns lie side by side.

    ``turns``: how many; by default as many as a circle of the size of the path would make of its length.
    """
    if turns is None:
        length = float(np.hypot(*np.diff(path, axis=0).T).sum())
        turns = length / max(math.pi * float(np.ptp(path, axis=0).max()), 1e-300)
    return LINE if turns < 10 else THIN if turns < 50 else 0.4


def joined(pieces: Sequence[Vector]) -> Vector:
    """Paths (n, 2) as one, with a gap between them."""
    gap = np.full((1, 2), np.nan)
    parts = [part for piece in pieces for part in (piece, gap)]
    return np.concatenate(parts[:-1]) if parts else np.empty((0, 2))


def thinned(count: int, most: int = 24) -> list[int]:
    """Indices of ``count`` things to be numbered: the first, the last, and between them those of round numbers."""
    steps = (many * 10**power for power in range(10) for many in (1, 2, 5))
    step = next(step for step in steps if count <= step * (most - 1))
    return [n - 1 for n in range(1, count + 1) if n in (1, count) or (n % step == 0 and 2 * (count - n) >= step)]


def log_axis(axis: Axis) -> None:
    """Plain numbers at the decades of a log axis, none between them."""
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("")


def log_angles(axes: Axes, low: float, high: float) -> None:
    """Log axis of the nutation, degrees."""
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    log_axis(axes.yaxis)
    axes.set_ylabel("θ, ° (log)")
    axes.grid()


def number(value: float) -> str:
    """A number with `FIGURES` significant figures."""
    return digits(value, FIGURES)


def angle(radians: float) -> str:
    """An angle given in rad, in degrees; below 1e-6° it is nothing to be seen."""
    shown = math.degrees(radians)
    return f"{number(shown)}°" if abs(shown) >= 1e-6 else "< 1e-6°" if shown else "0°"


def part_name(part: Part) -> str:
    """Name of a quantity that a requirement bounds."""
    return "momentum shift" if part is Part.SHIFT else part.label


def limit_of(spacecraft: Spacecraft, part: Part) -> float | None:
    """The bound that the file requires of an angle, deg; None without one."""
    return next((math.degrees(bound.most) for bound in required(spacecraft) if bound.part is part), None)


LETTERS = 11.0
"""Bold letters of a heading that fit in an inch."""

LONGEST_NAME = 40
"""Characters of a name that fit above a picture."""


def heading(figure: Figure, spacecraft: Spacecraft, text: str) -> None:
    """The lines above a picture, broken by its width: the name of the spacecraft, then ``text``."""
    whole = f"{short_name(spacecraft)}: {text}"
    figure.suptitle("\n".join(fill(line, int(LETTERS * figure.get_figwidth())) for line in whole.split("\n")))
    figure.set_label(whole)  # for pages, which break it by their own width


def short_name(spacecraft: Spacecraft) -> str:
    """The name of the spacecraft, cut where it is too long for a heading."""
    name = " ".join(spacecraft.name.split())
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1].rstrip()}…"


def legend(figure: Figure, axes: Sequence[Axes], columns: int = 8) -> None:
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
