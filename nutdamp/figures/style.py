"""Style of all pictures: colours, sizes, axes, and labels that keep out of each other's way."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from textwrap import fill
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

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
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

# Okabe & Ito's palette for colour-blind readers (jfly.uni-koeln.de/color); line styles differ too, for grey print.
MOTION, PULSE, MOMENTUM = "#0072B2", "#D55E00", "#009E73"
"""Spin axis, body cone and other motion of the spacecraft; firings; angular momentum and space cone."""

FIRED, TURNED = "#B34700", "#007a58"
"""Words about firings and about H: dark enough to be read on white (5.3:1, WCAG 2.1 requires 4.5:1)."""

MISSED, UNCHECKED = "#b00020", "#8a5a00"
"""A requirement that is NOT met, and nothing else; one that is met while the file has no tolerances to check."""

INK, GREY, FAINT = "#1a1a1a", "#767676", "#7676764d"
"""Text and second curves; limits and axes; the circles of the sphere."""

STAR = 13.0  # points across of the star of the target

TARGET: dict[str, Any] = {
    "marker": "*", "color": INK, "markersize": STAR, "markerfacecolor": "none", "linestyle": "", "zorder": 4
}  # fmt: skip
"""Mark of the target axis: larger than the marks of ends of paths there, and over them."""

PATH_OF_H: dict[str, Any] = {"color": MOMENTUM, "linewidth": 1.0, "linestyle": (0, (3, 1.5))}  # look of the path of H

LIMIT: dict[str, Any] = {"color": GREY, "linewidth": 1.3, "linestyle": (0, (6, 2)), "label": "required", "zorder": 1.5}
"""Look of a bound of the requirement."""

PAPER = "#fefefe"
"""Ground under a hollow mark; in a page, its background."""

LINE, THIN, LEADER = 1.3, 0.7, 0.5  # line widths, points; the last is that from a label to its point
SMALL, TICK_SIZE = 7.5, 8  # sizes of labels inside a panel and of those of its ticks, points
NOTE: dict[str, Any] = {"fontsize": SMALL, "fontweight": "normal"}  # look of a remark above a panel
FIGURES = 3  # significant figures of the numbers in a picture

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


@contextmanager
def styled() -> Iterator[None]:
    """Draw in this style, whatever the settings of the user's matplotlib; raises MissingExtra without one."""
    require()
    from matplotlib import style

    with style.context(["default", _SETTINGS]), warnings.catch_warnings():
        # A name in another script is drawn as boxes, one that is too long leaves no room: no reader can mend that.
        warnings.simplefilter("ignore", UserWarning)
        yield


PHONE = 3.7  # width of a figure for narrow screens, inches: its smallest text is 10 px high where 360 px show it


def sheet(width: float, height: float) -> Figure:
    """An empty figure, inches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=200, layout="constrained")
    figure.get_layout_engine().set(h_pad=0.07)  # type: ignore[union-attr, call-arg]
    return figure


def head(axes: Axes, path: Vector, row: int, colour: str, size: float = 9.0) -> None:
    """An arrowhead at a row of a ``path`` (n, 2) that shows its sense; none at the first one."""
    look = {"arrowstyle": "-|>", "color": colour, "linewidth": 0, "mutation_scale": size, "shrinkA": 0, "shrinkB": 0}
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


def limit_of(spacecraft: Spacecraft, part: Part) -> float | None:
    """The bound that the file requires of an angle, deg; None without one."""
    return next((math.degrees(bound.most) for bound in required(spacecraft) if bound.part is part), None)


LETTERS = 11.0  # bold letters of a heading that fit in an inch
LONGEST_NAME = 40  # characters of a name that fit above a picture


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


DOT = 4.0  # points that a mark of a legend measures at least, where a curve has smaller ones
LETTER = 4.6  # points that a letter of a legend takes, about
HANDLE = 25.0  # points to the left of the text in a legend: its line or mark


def _across(names: Sequence[str], columns: int) -> float:
    """Approximate width of a legend that is filled column by column, points."""
    deep, more = divmod(len(names), columns)
    ends = np.cumsum([deep + (index < more) for index in range(columns)]).tolist()
    parts = [names[begin:end] for begin, end in zip([0, *ends[:-1]], ends, strict=True)]
    return sum(HANDLE + LETTER * max(map(len, part)) for part in parts) + 11.0 * (columns - 1)


Meant = tuple[Vector, Vector]
"""Points of a label, (n, 2), and points that it must not be taken for, (m, 2), in the units of its panel."""

_MEANT: WeakKeyDictionary[Artist, Meant] = WeakKeyDictionary()


def add(axes: Axes, text: str, place: Vector, colour: str, *, role: str = "label", meant: Meant | None = None) -> None:
    """A label near a point. `settle` moves it to where there is room, by its role, or takes it out.

    ``label`` goes anywhere around its point and may be left out; ``vital`` is never left out; ``bar`` is above the bar
    of a firing, and ends before its colon where not all of them have room. The point ``meant`` is nearest to the label,
    or joined to it by a thin line.
    """
    at, vertical = (float(place[0]), float(place[1])), "bottom" if role == "bar" else "center_baseline"
    look: dict[str, Any] = {"color": colour, "fontsize": SMALL, "ha": "center", "va": vertical}
    note = axes.annotate(text, at, xytext=(0, 0), textcoords="offset points", annotation_clip=False, **look)
    note.set_label(f"_{role}")  # begins so that no legend shows it
    if meant is not None:
        _MEANT[note] = meant


def meant(places: Vector, row: int) -> Meant:
    """A row of ``places`` (n, 2), which is not to be taken for the others."""
    return places[[row]], np.delete(places, row, axis=0)


def target(axes: Axes, places: Vector, name: str = "target") -> None:
    """The star of the target (n, 2) with its label, and the ``name`` in the legend; none where there is none."""
    if len(places):
        axes.plot(*places.T, label=name, **TARGET)
        add(axes, "target", places[0], INK, role="vital")


PASSES = 8  # largest number of passes of the layout, until panels of equal scales move by less than a pixel
BAR_GAP = 2.0  # points between a bar and its label

_AROUND = [
    (step * x, step * y)
    for step in (7.0, 11.0, 16.0)
    for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1), (1.3, 0), (-1.3, 0), (0, 1.3), (0, -1.3))
]
_FAR = [
    (step * math.cos(turn), step * math.sin(turn))
    for step in (24.0, 34.0, 46.0, 60.0, 76.0)
    for turn in np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
]
_OFFSETS = {"_vital": [*_AROUND, *_FAR], "_label": _AROUND[:16]}

FAR = 15.0  # points from which a line leads from a label to its point
_COVERED = {"_vital": np.inf, "_label": 14.0}  # points of curves, 4 pixels apart, that a label may cover


def panels(figure: Figure) -> list[Axes]:
    """The panels of a figure, and those inset in them."""
    inset: list[Any] = [panel for axes in figure.axes for panel in axes.child_axes]
    return [*figure.axes, *inset]


def _lay_out(figure: Figure) -> None:
    """Lay the panels out as drawing the figure would, without drawing their contents."""
    figure.get_layout_engine().execute(figure)  # type: ignore[union-attr]
    for axes in figure.axes:
        axes.apply_aspect()
    for axes in panels(figure):
        locator = axes.get_axes_locator()
        if locator is not None:  # an inset lies in its panel
            axes.apply_aspect(locator(axes, None))  # type: ignore[arg-type]


def settle(figure: Figure) -> None:
    """Lay labels where they cover neither each other nor a curve; take out those for which there is no room."""
    for axes in panels(figure):  # drawn later outside this style, as many ticks fit between labels of the same size
        axes.tick_params(labelsize=TICK_SIZE)
        # They lie within the panel and its ticks.
        axes.spines[["left", "right", "top"]].set_in_layout(False)
        for artist in (*axes.texts, *axes.child_axes):
            artist.set_in_layout(False)
    size = np.tile(figure.bbox.size, 2)
    begun: Vector | None = None
    ended: Vector | None = None
    for _ in range(PASSES if any(axes.get_aspect() != "auto" for axes in figure.axes) else 1):
        _lay_out(figure)
        now = np.array([axes.get_position(original=True).bounds for axes in figure.axes])
        if ended is not None and np.abs((now - ended) * size).max() < 1.0:
            break
        ended = now
        if begun is not None:  # a pass leaves a quarter of the way to go
            now = now + (now - begun) / 3.0
            for axes, place in zip(figure.axes, now.tolist(), strict=True):
                axes.set_position(place, "original")
                axes.set_in_layout(True)
        begun = now
    figure.set_layout_engine("none")  # labels are put where panels are now
    for axes in panels(figure):
        notes: list[Any] = [note for role in _OFFSETS for note in axes.texts if note.get_label() == role]
        curves = _inked(axes) if notes else np.empty((0, 2))
        taken: list[Bbox] = []
        leads = _stars(axes)
        window, points = axes.get_window_extent(), figure.dpi / 72.0
        for note in notes:
            leads = np.vstack([leads, _settle(note, taken, (curves, leads), window, points)])
        bars: list[Any] = [note for note in axes.texts if note.get_label() == "_bar"]
        if not _all_fit(bars, window, points):
            for note in bars:
                note.set(text=note.get_text().partition(":")[0], visible=True)
            _all_fit(bars, window, points)


def _all_fit(notes: list[Annotation], window: Bbox, points: float) -> bool:
    """Put labels above their bars, within the panel; hide those that meet another of their row; True if none does."""
    ends: dict[float, float] = {}
    for note in notes:
        note.set_position((0.0, BAR_GAP))
        here, row = note.get_window_extent(), float(note.xy[1])
        shift = max(window.x0 + points - here.x0, 0.0) - max(here.x1 - window.x1 + points, 0.0)
        note.set_position((shift / points, BAR_GAP))
        note.set_visible(here.x0 + shift >= ends.get(row, -np.inf) + 3.0 * points)
        if note.get_visible():
            ends[row] = here.x1 + shift
    return all(note.get_visible() for note in notes)


def _settle(note: Annotation, taken: list[Bbox], inked: tuple[Vector, Vector], window: Bbox, points: float) -> Vector:
    """Place one label, which covers few of the curves and, if it can, none of the lines from other labels.

    ``inked``: points of curves, and of stars and lines of other labels; ``window`` is that of the panel, ``points`` the
    number of pixels in a point. Returns the points of a line to the label.
    """
    role = str(note.get_label())
    here = note.get_window_extent().padded(1.5 * points)
    best, least = None, _COVERED[role]
    led = note in _MEANT
    steps = np.array([*_AROUND, *_FAR] if led else _OFFSETS[role])
    # Sideways offsets are counted from the edge of the text, so that long names are as near as short ones.
    offsets = steps + np.sign(steps) * (max(0.5 * here.width / points - 4.5, 0.0), 0.0)
    boxes = [here.translated(x * points, y * points) for x, y in offsets.tolist()]
    curves, leads = (_contained(boxes, part) for part in inked)
    away = np.hypot(*steps.T)
    for number in np.argsort(covers := curves + 30.0 * (leads > 0) + 0.04 * away, kind="stable").tolist():
        covered, box = float(covers[number]), boxes[number]
        if covered >= least:
            break
        out = max(window.x0 - box.x0, box.x1 - window.x1, window.y0 - box.y0, box.y1 - window.y1, 0.0)
        if out > 0.0 or any(box.overlaps(other) for other in taken):
            if role != "_vital":
                continue
            covered += 1e4 * (1.0 + out)
        if led and len(way := _way(note, box, points)):
            covered += 3.0 if away[number] > FAR else 1e3
            covered += 1e3 * any(other.count_contains(way) for other in taken)
        if covered < least:
            best, least = number, covered
    if best is None:
        note.set_visible(False)
        return np.empty((0, 2))
    note.set_position(offsets[best].tolist())
    taken.append(boxes[best])
    way = _way(note, boxes[best], points)
    if len(way):
        axes: Any = note.axes
        ends, limits = axes.transData.inverted().transform(way[[0, -1]]), (axes.get_xlim(), axes.get_ylim())
        axes.plot(*ends.T, color=note.get_color(), linewidth=LEADER, label="_leader", zorder=2.5)
        axes.set(xlim=limits[0], ylim=limits[1])
    return way


def _contained(boxes: Sequence[Bbox], places: Vector) -> Vector:
    """Number of ``places`` (n, 2) within each box."""
    corners = np.array([box.get_points() for box in boxes])
    x, y = ((corners[:, :1, axis] < places[:, axis]) & (places[:, axis] < corners[:, 1:, axis]) for axis in (0, 1))
    return np.asarray(np.count_nonzero(x & y, axis=1), dtype=np.float64)


NEARER, NEAR = 0.45, 8.0
"""The point of a label is nearer to it than this share of the distance to any it could be taken for, and than this
many points."""


def _way(note: Annotation, box: Bbox, points: float) -> Vector:
    """Points, 4 pixels apart, from the point of a label to its ``box``; none where it clearly belongs to its points."""
    axes: Any = note.axes
    tip, inner = np.asarray(axes.transData.transform(note.xy)), box.padded(-1.5 * points)
    if note in _MEANT:
        own, others = (_away(box, np.asarray(axes.transData.transform(part))) for part in _MEANT[note])
        near = own < min(NEARER * others, NEAR * points)
    else:
        near = _away(box, tip) <= FAR * points
    if near:
        return np.empty((0, 2))
    edge = np.clip(tip, [inner.x0, inner.y0], [inner.x1, inner.y1])
    return np.linspace(tip, edge, max(int(np.hypot(*(edge - tip)) / 4.0), 2))


def _away(box: Bbox, places: Vector) -> float:
    """Distance of the nearest of some ``places`` (n, 2) from a box; infinite where there are none."""
    beyond = np.maximum(np.maximum([box.x0, box.y0] - places, places - [box.x1, box.y1]), 0.0)
    return float(np.hypot(*beyond.T).min(initial=np.inf))


def _inked(axes: Axes) -> Vector:
    """Points of all curves and bars in pixels, close enough together that none passes a label unseen."""
    points = [np.empty((0, 2))]
    outlines = [np.asarray(line.get_transform().transform(line.get_xydata())) for line in axes.lines]
    for bars in axes.collections:
        outlines += [np.asarray(bars.get_transform().transform(path.vertices)) for path in bars.get_paths()]
    for path in outlines:
        path = path[np.isfinite(path).all(axis=1)]
        if len(path) > 1:
            steps = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
            even = np.linspace(0.0, steps[-1], min(int(steps[-1] / 4.0) + 2, 20_000))
            points.append(np.column_stack([np.interp(even, steps, column) for column in path.T]))
    return np.concatenate(points)


def _stars(axes: Axes) -> Vector:
    """Points (n, 2), pixels, within all marks as large as a star."""
    spot = np.exp(2j * math.pi * np.arange(16) / 16)
    stars = [np.empty((0, 2))]
    for line in axes.lines:
        if line.get_marker() not in ("", "None", None) and line.get_markersize() >= STAR:
            round_it = 0.5 * line.get_markersize() * axes.figure.dpi / 72.0 * np.outer([0.5, 0.9], spot).ravel()
            for place in np.asarray(line.get_transform().transform(line.get_xydata())):
                stars.append(place + np.column_stack([round_it.real, round_it.imag]))
    return np.concatenate(stars)
