"""Style of all pictures: colours, sizes, axes, and labels that keep out of each other's way."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from nutdamp.errors import MissingExtra
from nutdamp.planning.verdict import Light
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import Part, required
from nutdamp.views.text import digits

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

# Okabe & Ito's palette for colour-blind readers (jfly.uni-koeln.de/color); line styles differ too,
# for grey print.
# Spin axis, body cone and other motion of the spacecraft; firings; angular momentum and space
# cone.
MOTION, PULSE, MOMENTUM = "#0072B2", "#D55E00", "#009E73"

# Words about firings and about H: dark enough to be read on white (5.3:1, WCAG 2.1 requires
# 4.5:1).
FIRED, TURNED = "#B34700", "#007a58"

# A verdict that says not to fly, and nothing else; one by nominal values alone.
MISSED, UNCHECKED = "#b00020", "#8a5a00"

# Text and second curves; limits and axes; the circles of the sphere.
INK, GREY, FAINT = "#1a1a1a", "#767676", "#7676764d"

# Colours of the title of a picture by its verdict.
LIGHTS = {Light.GREEN: INK, Light.AMBER: UNCHECKED, Light.RED: MISSED}

# Mark of the target axis: larger than the marks of ends of paths there, and over them.
TARGET: dict[str, Any] = {
    "marker": "*",
    "color": INK,
    "markersize": 13.0,
    "markerfacecolor": "none",
    "linestyle": "",
    "zorder": 4,
}

PATH_OF_H: dict[str, Any] = {
    "color": MOMENTUM,
    "linewidth": 1.0,
    "linestyle": (0, (3, 1.5)),
}  # look of the path of H

# Look of a bound of the requirement.
LIMIT: dict[str, Any] = {
    "color": GREY,
    "linewidth": 1.3,
    "linestyle": (0, (6, 2)),
    "label": "required",
    "zorder": 1.5,
}

# Look of what keeps a bound, and of a dead band.
BAND: dict[str, Any] = {"facecolor": GREY, "alpha": 0.16, "linewidth": 0.0}

# Ground under a hollow mark; in a page, its background.
PAPER = "#fefefe"

LEAST = 1e-9  # degrees or deg/s below which a motion is drawn as a point
LINE, THIN = 1.3, 0.7  # line widths, points
SMALL, TICK_SIZE = 7.5, 8  # sizes of labels inside a panel and of those of its ticks, points
NOTE: dict[str, Any] = {"fontsize": SMALL, "fontweight": "normal"}  # look of a remark above a panel
FIGURES = 3  # significant figures of the numbers in a picture

_SETTINGS: dict[str, Any] = {
    "font.family": "sans-serif",
    # The first comes with matplotlib and has the Greek letters; in SVG the others of its width
    # stand in for it.
    "font.sans-serif": ["DejaVu Sans", "Bitstream Vera Sans", "Verdana"],
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    # else matplotlib measures all tick labels of a panel once more for each title
    "axes.titley": 1.0,
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


@contextmanager
def styled() -> Iterator[None]:
    """Draw in this style, whatever the settings of the user's matplotlib; raises MissingExtra
    without one.
    """
    require()
    from matplotlib import style

    with style.context(["default", _SETTINGS]), warnings.catch_warnings():
        # A name that is long leaves no room, and one may have no glyphs in SVG: no reader can mend
        # that.
        warnings.simplefilter("ignore", UserWarning)
        yield


# Fonts that draw what `DejaVu Sans` does not, where they are installed.
OTHER_SCRIPTS = (
    "Noto Sans CJK JP",
    "WenQuanYi Zen Hei",
    "Unifont",
    "Noto Emoji",
    "Arial Unicode MS",
    "MS Gothic",
)


def legible(figure: Figure) -> None:
    """Draw texts of a figure with the fonts that are installed, and "?" for characters that none of
    them has.
    """
    from matplotlib import font_manager, text

    files = {entry.name: entry.fname for entry in font_manager.fontManager.ttflist}
    names = [name for name in ("DejaVu Sans", *OTHER_SCRIPTS) if name in files]
    drawn = {ord("\n")}.union(*(font_manager.get_font(files[name]).get_charmap() for name in names))
    for each in figure.findobj(text.Text):
        shown = "".join(sign if ord(sign) in drawn else "?" for sign in each.get_text())
        each.set(text=shown, fontfamily=names)


# width of a figure for narrow screens, inches: its smallest text is 10 px high where 360 px show it
PHONE = 3.7


def sheet(width: float, height: float) -> Figure:
    """An empty figure, inches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=200, layout="constrained")
    figure.get_layout_engine().set(h_pad=0.07)  # type: ignore[union-attr, call-arg]
    return figure


def head(axes: Axes, path: Vector, row: int, colour: str, size: float = 9.0) -> None:
    """An arrowhead at a row of a ``path`` (n, 2) that shows its sense; none at the first one."""
    look = {
        "arrowstyle": "-|>",
        "color": colour,
        "linewidth": 0,
        "mutation_scale": size,
        "shrinkA": 0,
        "shrinkB": 0,
    }
    if 0 < row < len(path) and np.any(path[row] != path[row - 1]):
        (x0, y0), (x1, y1) = path[row - 1].tolist(), path[row].tolist()
        axes.annotate("", (x1, y1), (x0, y0), annotation_clip=False, arrowprops=look)


def words(axes: Axes, text: str) -> None:
    """Words in a panel that has nothing to show; no ticks, since there is no scale to read."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center")
    axes.set(xticks=[], yticks=[])


def room(points: Vector, margin: float, *, centre: bool = False) -> tuple[Vector, float]:
    """Middle (2,) and half the side of a square with room for ``points`` (n, 2); ``centre``: zero
    in the middle.
    """
    low = points.min(axis=0)
    high = points.max(axis=0)
    middle = np.zeros(2) if centre else 0.5 * (low + high)
    half = (1.0 + margin) * float(np.abs(points - middle).max())
    return middle, half if half > LEAST else 1.0


def square(
    axes: Axes, points: Vector, *, margin: float, centre: bool = False
) -> tuple[Vector, float]:
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

    ``turns``: how many; by default as many as a circle of the size of the path would make of its
    length.
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
    """Indices of ``count`` things to be numbered: the first, the last, and between them those of
    round numbers.
    """
    steps = (many * 10**power for power in range(10) for many in (1, 2, 5))
    step = next(step for step in steps if count <= step * (most - 1))
    return [
        n - 1
        for n in range(1, count + 1)
        if n in (1, count) or (n % step == 0 and 2 * (count - n) >= step)
    ]


def log_axis(axis: Axis) -> None:
    """Plain numbers on a log axis whose limits are set: at the decades, over fewer than two of them
    at 1, 2 and 5 of each, and evenly within one.
    """
    from matplotlib.ticker import LogLocator, MaxNLocator, NullLocator

    low, high = sorted(axis.get_view_interval())
    if high < 10.0 * low:
        axis.set_major_locator(MaxNLocator(5))
        axis.set_minor_locator(NullLocator())
    elif high < 100.0 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("")


def log_angles(axes: Axes, low: float, high: float) -> None:
    """Log axis of the nutation, degrees."""
    axes.set_yscale("log")
    axes.set_ylim(low, high)
    log_axis(axes.yaxis)
    axes.set_ylabel("θ, ° (log)")
    axes.grid(visible=True)  # without the word it would turn off one that is there


def off_scale(axes: Axes, text: str) -> None:
    """An arrow at the right edge of a panel towards a limit beyond it, with its ``text``."""
    place = axes.transAxes
    axes.text(0.99, 0.02, f"{text} →", transform=place, ha="right", color=INK, fontsize=SMALL)


def number(value: float) -> str:
    """A number with `FIGURES` significant figures."""
    return digits(value, FIGURES)


def angle(radians: float) -> str:
    """An angle given in rad, in degrees; below 1e-6° it is nothing to be seen."""
    shown = math.degrees(radians)
    if abs(shown) >= 1e-6:
        return f"{number(shown)}°"
    return "< 1e-6°" if shown else "0°"


def limit_of(spacecraft: Spacecraft, part: Part) -> float | None:
    """The bound that the file requires of an angle, deg; None without one."""
    return next(
        (math.degrees(bound.limit) for bound in required(spacecraft) if bound.part is part), None
    )


_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5, 1, 1.5)), (0, (5, 1.5)), ":")
# Colour, mark and line of curves of one kind, in turn: those beside each other differ in all.
LOOKS = tuple(
    (colour, mark, _DASHES[(row + turn) % len(_DASHES)])
    for turn in range(3)
    for row, (colour, mark) in enumerate(((MOTION, "o"), (MOMENTUM, "^"), (INK, "s"), (GREY, "v")))
)

LETTERS = 11.0  # bold letters of a heading that fit in an inch
LONGEST_NAME = 40  # characters of a name that fit above a picture


def finished(
    figure: Figure, spacecraft: Spacecraft, text: str, verdict: tuple[str, Light] | None = None
) -> Figure:
    """The figure with the lines above it, broken by its width: the name of the spacecraft,
    ``text``, a verdict in colour; and with all labels in their places.
    """
    whole = f"{short(spacecraft.name)}: {text}"
    figure.set_label(whole)  # for pages, which break it by their own width, and have the verdict
    colour = INK
    if verdict is not None:
        whole = f"{whole}\n{verdict[0]}"
        colour = LIGHTS[verdict[1]]
    lines = (fill(line, int(LETTERS * figure.get_figwidth())) for line in whole.split("\n"))
    figure.suptitle("\n".join(lines), color=colour)
    settle(figure)
    return figure


def short(name: str) -> str:
    """A name of a spacecraft or a file, cut where it is too long for a heading."""
    name = " ".join(name.split())
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1].rstrip()}…"


DOT = 4.0  # points that a mark of a legend measures at least, where a curve has smaller ones
LETTER = 4.6  # points that a letter of a legend takes, about
# points to the left of the text in a legend, its line or mark, and between columns
HANDLE, GAP = 25.0, 11.0


def legend(figure: Figure, axes: Iterable[Axes]) -> None:
    """One legend under all panels, each name once, where no curve can run into it, in as many
    columns as fit.
    """
    handles: dict[str, Artist] = {}
    for panel in axes:
        for handle, name in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(name, handle)
    if handles:
        across = HANDLE + LETTER * max(map(len, handles)) + GAP
        fit = int((72.0 * figure.get_figwidth() + GAP) / across)
        drawn = figure.legend(
            list(handles.values()),
            list(handles),
            loc="outside lower center",
            ncols=max(min(fit, len(handles)), 1),
            handlelength=2.2,
            borderpad=0.2,
            columnspacing=1.4,
        )
        for mark in drawn.get_lines():
            mark.set_markersize(max(mark.get_markersize(), DOT))


def add(axes: Axes, text: str, place: Vector, colour: str, *, role: str = "label") -> None:
    """A label beside a point, which `settle` lays into the quadrant of the point that has room for
    it.

    A ``label`` may be left out, a ``vital`` one never; a ``bar`` is above the bar of a firing, and
    ends before its colon where not all of them have room.
    """
    at = (float(place[0]), float(place[1]))
    look: dict[str, Any] = {"color": colour, "fontsize": SMALL, "annotation_clip": False}
    note = axes.annotate(text, at, xytext=(0, 0), textcoords="offset points", **look)
    note.set_label(f"_{role}")  # begins so that no legend shows it


def target(axes: Axes, places: Vector, name: str = "target") -> None:
    """The star of the target (n, 2) with its label, and the ``name`` in the legend; none where
    there is none.
    """
    if len(places):
        axes.plot(*places.T, label=name, **TARGET)
        add(axes, "target", places[0], INK, role="vital")


# offsets from a point to the nearest corner of its label, points
QUADRANTS = [
    (x * away, y * away)
    for away in (3.5, 7.0, 12.0, 24.0, 36.0)
    for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1))
]

# Offsets by role, in the order in which labels are laid: numbers stay near their points, and the
# middle, the begin or the end of the label of a bar is above the middle of the bar.
OFFSETS = {
    "_vital": QUADRANTS,
    "_label": QUADRANTS[:8],
    "_bar": [(0.0, 2.0), (0.1, 2.0), (-0.1, 2.0)],
}

SAME = 5.0  # points within which labels have one place: less than the height of a letter
LISTED = 3  # largest number of labels of one place that are listed; of more the first and the last
PASSES = 3  # passes of the layout before the last one: panels of equal scales need them
# cost of a place on another label or outside the panel, and on a mark; on a line it is 1
NO_ROOM, ON_MARK = 1000.0, 10.0


def settle(figure: Figure) -> None:
    """Lay out the panels, and each label where it covers least; labels of one place become one, and
    those for which there is no room are taken out.
    """
    for axes in figure.axes:
        # Drawn later outside this style, as many ticks fit between labels of the same size.
        axes.tick_params(labelsize=TICK_SIZE)
        # They lie within the panel and its ticks.
        axes.spines[["left", "right", "top"]].set_in_layout(False)
        for artist in axes.texts:
            artist.set_in_layout(False)
    for _ in range(PASSES):
        figure.get_layout_engine().execute(figure)  # type: ignore[union-attr]
    figure.draw_without_rendering()
    figure.set_layout_engine(None)  # labels are put where panels are now
    for axes in figure.axes:
        notes: dict[tuple[str, ...], list[Any]] = {}
        for role in OFFSETS:
            for note in (text for text in axes.texts if text.get_label() == role):
                place = axes.transData.transform(note.xy) * 72.0 / figure.dpi  # type: ignore[attr-defined]
                notes.setdefault((role, *map(str, np.round(place / SAME))), []).append(note)
        for (role, *_), (first, *others) in notes.items():
            texts = [note.get_text() for note in (first, *others)]
            if role == "_label" and len(texts) > LISTED:
                texts = [f"{texts[0]} … {texts[-1]}"]
            first.set_text(("\n" if role == "_vital" else ", ").join(texts))
            for note in others:
                if note.get_color() != first.get_color():
                    first.set_color(INK)
                note.remove()
        laid = [first for first, *_ in notes.values()]
        bars = [note for note in laid if note.get_label() == "_bar"]
        if laid and not _lay(axes, laid) and bars:
            for note in bars:
                note.set_text(note.get_text().partition(":")[0])
            _lay(axes, laid)


def _lay(axes: Axes, notes: Sequence[Annotation]) -> bool:
    """Lay the labels of a panel, each where it covers least of what is there; True if all have
    room.
    """
    from matplotlib.transforms import Bbox

    window = axes.get_window_extent()
    point = axes.figure.dpi / 72.0
    lines = [(line, line.get_path().transformed(line.get_transform())) for line in axes.lines]
    curves = [path for line, path in lines if line.get_linestyle() != "None"]
    marks = [
        Bbox([[x, y], [x, y]]).padded(0.5 * point * line.get_markersize())
        for line, path in lines
        if line.get_marker() not in ("", "None")
        for x, y in np.asarray(path.vertices).tolist()
    ]
    taken: list[Bbox] = []

    def cost(note: Annotation, offset: tuple[float, float]) -> float:
        across = "left" if offset[0] > 0.0 else "right" if offset[0] < 0.0 else "center"
        note.set(
            position=offset, ha=across, va="bottom" if offset[1] > 0.0 else "top", visible=True
        )
        box = note.get_window_extent().padded(point)
        outside = not (window.contains(*box.min) and window.contains(*box.max))
        crossed = sum(path.intersects_bbox(box, filled=False) for path in curves)
        return (
            NO_ROOM * (2 * outside + box.count_overlaps(taken))
            + ON_MARK * box.count_overlaps(marks)
            + crossed
        )

    for note in notes:
        role = str(note.get_label())
        least = cost(note, min(OFFSETS[role], key=partial(cost, note)))
        note.set_visible(role == "_vital" or least < NO_ROOM)
        if note.get_visible():
            taken.append(note.get_window_extent())
    return all(note.get_visible() for note in notes)
