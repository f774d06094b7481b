"""The one style of all figures: colours, sizes, marks, labels that make room for each other."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from functools import wraps
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from nutdamp.errors import MissingExtra
from nutdamp.presentation.geometry import room
from nutdamp.spacecraft import Vector

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox

# Okabe & Ito's palette for colour-blind readers (jfly.uni-koeln.de/color); line styles differ too, for grey print.
MOTION, PULSE, MOMENTUM = "#0072B2", "#D55E00", "#009E73"
"""Spin axis, body cone and what moves; firings; angular momentum and space cone."""

FIRED = "#B34700"
"""Numbers of pulses: as `PULSE`, dark enough to be read on white (5.5:1, WCAG 2.1 requires 4.5:1)."""

TURNED = "#007a58"
"""Words about H: as `MOMENTUM`, dark enough to be read on white (5.3:1)."""

INK, GREY, FAINT = "#1a1a1a", "#767676", "#7676764d"
"""Text and ω; marks; the circles of the sphere."""

TARGET: dict[str, Any] = {
    "marker": "*", "color": INK, "markersize": 12, "markerfacecolor": "none", "linestyle": "", "zorder": 4
}  # fmt: skip
"""Mark of the target axis: larger than the marks of what ends there, and over them."""

PAPER = "#fefefe"
"""What lies under a hollow mark; in a page, its background."""

LINE, THIN, LEADER = 1.3, 0.7, 0.5
"""Line widths, points; the last is that from a label to what it is of."""

SMALL = 7.5
"""Size of labels inside a panel, points."""

ON_PAPER: dict[str, Any] = {"fontsize": SMALL, "bbox": {"facecolor": PAPER, "edgecolor": "none", "pad": 0.8}}
"""Look of words that a line may pass behind."""

_SETTINGS: dict[str, Any] = {
    "font.family": ["DejaVu Sans"],  # comes with matplotlib, has the Greek letters
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
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
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "svg.fonttype": "none",  # text stays text: it can be found, copied and read aloud
    "svg.hashsalt": "nutdamp",  # the same flight gives the same file
}


def require() -> None:
    """Raises MissingExtra where matplotlib is not installed."""
    if find_spec("matplotlib") is None:
        raise MissingExtra("plot", "a picture")


Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


def styled(draw: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Draws in this style, whatever the settings of the user's matplotlib; raises MissingExtra without one."""

    @wraps(draw)
    def drawn(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        require()
        from matplotlib import style

        with style.context(["default", _SETTINGS]), warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing from")  # a name in another script is drawn as boxes
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
    """Arrowheads along a ``path`` (n, 2) that show where it goes, at some of its rows."""
    look = {"arrowstyle": "-|>", "color": colour, "linewidth": 0, "mutation_scale": size, "shrinkA": 0, "shrinkB": 0}
    for row in places:
        if 0 < row < len(path) and np.any(path[row] != path[row - 1]):
            (x0, y0), (x1, y1) = path[row - 1].tolist(), path[row].tolist()
            axes.annotate("", (x1, y1), (x0, y0), annotation_clip=False, arrowprops=look)


def words(axes: Axes, text: str) -> None:
    """Words in a panel that has nothing to show; no ticks, since there is no scale to read."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center")
    axes.set(xticks=[], yticks=[])


def square(axes: Axes, points: Vector, *, margin: float, centre: bool = False) -> None:
    """Equal scales on both axes, and room for all ``points`` (n, 2); ``centre`` puts zero in the middle."""
    middle, half = room(points, margin, centre=centre)
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal", adjustable="box")
    axes.locator_params(nbins=6)
    axes.grid()


class Meant(NamedTuple):
    """What a label is of, (n, 2), and what it must not be taken for, (m, 2): points in the units of its panel."""

    own: Vector
    others: Vector


_MEANT: WeakKeyDictionary[Artist, Meant] = WeakKeyDictionary()
"""By label, until it is settled."""


def label(
    axes: Axes,
    text: str,
    place: Vector,
    colour: str = INK,
    *,
    role: str = "label",
    short: str = "",
    meant: Meant | None = None,
) -> None:
    """A label near a point. `settle` moves it to where there is room, by its role, or takes it out.

    ``label`` goes anywhere around its point and may be left out; ``number`` stays where it is put, along the edge of a
    panel; ``vital`` is never left out; ``bar`` is above the bar of a firing, and reads ``short`` where not all of
    them have room. What is ``meant`` is nearest to the label, or joined to it by a thin line.
    """
    note = axes.annotate(
        text,
        (float(place[0]), float(place[1])),
        xytext=(0, 0),
        textcoords="offset points",
        color=colour,
        fontsize=SMALL,
        ha="center",
        va="bottom" if role in ("bar", "number") else "center_baseline",
        annotation_clip=False,
    )
    note.set_label(f"_{role}{short}")  # begins so that no legend shows it
    if meant is not None:
        _MEANT[note] = meant


PASSES = 8
"""Of the layout at most, until panels of equal scales move by less than a pixel."""

BAR_GAP = 2.0
"""Points between a bar and its label."""

_AROUND = [
    (step * x, step * y)
    for step in (7.0, 11.0, 16.0)
    for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1), (1.3, 0), (-1.3, 0), (0, 1.3), (0, -1.3))
]
_FAR = [
    (step * math.cos(turn), step * math.sin(turn))
    for step in (24.0, 34.0, 46.0)
    for turn in np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
]
_OFFSETS = {
    "_vital": [*_AROUND, *_FAR],
    "_label": _AROUND[:16],
    "_number": [(0.0, 3.0)],
}
FAR = 15.0
"""Points from which a line leads from a label to its point."""

_COVERED = {"_vital": np.inf, "_label": 14.0, "_number": np.inf}
"""Points of curves, 4 pixels apart, that a label may cover."""


def _lay_out(figure: Figure) -> None:
    """Lay the panels out as drawing the figure would, without drawing what is in them."""
    figure.get_layout_engine().execute(figure)  # type: ignore[union-attr]
    for axes in figure.axes:
        axes.apply_aspect()


def settle(figure: Figure) -> None:
    """Lay labels where they cover neither each other nor a curve; take out those for which there is no room."""
    for axes in figure.axes:  # drawn later outside this style, as many ticks fit between labels of the same size
        axes.tick_params(labelsize=_SETTINGS["xtick.labelsize"])
    before = np.zeros(1)
    for _ in range(PASSES):
        _lay_out(figure)
        now = np.array([axes.get_window_extent().extents for axes in figure.axes])
        if now.shape == before.shape and np.abs(now - before).max(initial=0.0) < 1.0:
            break
        before = now
    figure.set_layout_engine("none")  # labels are put where panels are now
    order = list(_OFFSETS)
    for axes in figure.axes:
        notes: list[Any] = sorted(
            (note for note in axes.texts if note.get_label() in order),
            key=lambda note: order.index(str(note.get_label())),
        )
        curves = _inked(axes) if notes else np.empty((0, 2))
        taken: list[Bbox] = []
        leads = np.empty((0, 2))
        window, points = axes.get_window_extent(), figure.dpi / 72.0
        for note in notes:
            box = _settle(note, taken, (curves, leads), window, points)
            if box is not None:
                leads = np.vstack([leads, _lead(note, box, points)])
            _MEANT.pop(note, None)
        bars: list[Any] = [note for note in axes.texts if str(note.get_label()).startswith("_bar")]
        if bars:
            _settle_bars(bars, window, points)


def _settle_bars(notes: list[Annotation], window: Bbox, points: float) -> None:
    """Labels of bars as they are where all have room in their rows, else as many of the short ones as have."""
    if len(_in_rows(notes, window, points)) == len(notes):
        return
    for note in notes:
        note.set_text(str(note.get_label()).removeprefix("_bar"))
    fitting = _in_rows(notes, window, points)
    for note in notes:
        note.set_visible(note in fitting)


def _in_rows(notes: list[Annotation], window: Bbox, points: float) -> set[Annotation]:
    """Put labels above their bars, no farther than the edges of the panel; those that meet none before in their row."""
    ends: dict[float, float] = {}
    fitting = set()
    for note in notes:
        note.set_position((0.0, BAR_GAP))
        here = note.get_window_extent()
        shift = max(window.x0 + points - here.x0, 0.0) - max(here.x1 - window.x1 + points, 0.0)
        note.set_position((shift / points, BAR_GAP))
        row = float(note.xy[1])
        if here.x0 + shift >= ends.get(row, -np.inf) + 3.0 * points:
            ends[row] = here.x1 + shift
            fitting.add(note)
    return fitting


def _settle(
    note: Annotation, taken: list[Bbox], inked: tuple[Vector, Vector], window: Bbox, points: float
) -> Bbox | None:
    """Where one label is put, which covers few of the curves and, if it can, none of the lines from other labels.

    ``inked``: points of both; ``window`` is that of the panel, ``points`` how many pixels a point is.
    """
    role = str(note.get_label())
    here = note.get_window_extent().padded(1.5 * points)
    best, least = None, np.inf
    led = note in _MEANT
    for x, y in [*_AROUND, *_FAR] if led else _OFFSETS[role]:
        # Sideways offsets are counted from the edge of the text, so that long names are as near as short ones.
        offset = (x + np.sign(x) * max(0.5 * here.width / points - 4.5, 0.0), y)
        box = here.translated(offset[0] * points, offset[1] * points)
        curves, leads = (box.count_contains(part) for part in inked)
        covered = float(curves) + 30.0 * float(leads > 0) + 0.04 * float(np.hypot(x, y))
        out = max(window.x0 - box.x0, box.x1 - window.x1, window.y0 - box.y0, box.y1 - window.y1, 0.0)
        out = 0.0 if role == "_number" else out
        if led and not _nearest(note, box, points):
            way = _way(note, box, points)
            covered += 3.0 if np.hypot(x, y) > FAR else 1e3
            covered += 1e3 * any(other.count_contains(way) for other in taken)
        if out > 0.0 or any(box.overlaps(other) for other in taken):
            if role != "_vital":
                continue
            covered += 1e4 * (1.0 + out)
        if covered < min(least, _COVERED[role]):
            best, least = (offset, box), covered
    if best is None:
        note.set_visible(False)
        return None
    note.set_position(best[0])
    taken.append(best[1])
    return best[1]


NEARER, NEAR = 0.45, 8.0
"""What a label is of is nearer to it than this share of the distance to anything it could be taken for, and than this
many points."""


def _nearest(note: Annotation, box: Bbox, points: float) -> bool:
    """Whether a label in a ``box`` of pixels is clearly that of what it is meant for."""
    axes: Any = note.axes
    if note not in _MEANT:
        return _away(box, axes.transData.transform([note.xy])) <= FAR * points
    own, others = (_away(box, np.asarray(axes.transData.transform(part))) for part in _MEANT[note])
    return own < min(NEARER * others, NEAR * points)


def _away(box: Bbox, places: Vector) -> float:
    """Distance of the nearest of some ``places`` (n, 2) from a box; infinite where there are none."""
    beyond = np.maximum(np.maximum([box.x0, box.y0] - places, places - [box.x1, box.y1]), 0.0)
    return float(np.hypot(*beyond.T).min(initial=np.inf))


def _way(note: Annotation, box: Bbox, points: float) -> Vector:
    """The points, 4 pixels apart, from what a label is of to its ``box``."""
    axes: Any = note.axes
    tip = np.asarray(axes.transData.transform(note.xy))
    inner = box.padded(-1.5 * points)
    edge = np.clip(tip, [inner.x0, inner.y0], [inner.x1, inner.y1])
    return np.linspace(tip, edge, max(int(np.hypot(*(edge - tip)) / 4.0), 2))


def _lead(note: Annotation, box: Bbox, points: float) -> Vector:
    """The points, 4 pixels apart, of a thin line from a label to what it is of; none where that is nearest anyhow."""
    axes: Any = note.axes
    if _nearest(note, box, points):
        return np.empty((0, 2))
    way = _way(note, box, points)
    ends = np.asarray(axes.transData.inverted().transform(way[[0, -1]]))
    limits = axes.get_xlim(), axes.get_ylim()
    axes.plot(*ends.T, color=note.get_color(), linewidth=LEADER, label="_leader", zorder=2.5)
    axes.set(xlim=limits[0], ylim=limits[1])
    return way


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


STAR = 13.0
"""Points across of the star of what is recommended: labels keep off marks as large as they keep off curves."""


def _inked(axes: Axes) -> Vector:
    """Points of all curves and bars in pixels, close enough together that none passes a label unseen."""
    points = [np.empty((0, 2))]
    outlines = [np.asarray(line.get_transform().transform(line.get_xydata())) for line in axes.lines]
    for bars in axes.collections:
        outlines += [np.asarray(bars.get_transform().transform(path.vertices)) for path in bars.get_paths()]
    spot = np.exp(2j * math.pi * np.arange(16) / 16)
    for line in axes.lines:
        if line.get_marker() not in ("", "None", None) and line.get_markersize() >= STAR:
            round_it = 0.5 * line.get_markersize() * axes.figure.dpi / 72.0 * np.outer([0.5, 0.9], spot).ravel()
            for place in np.asarray(line.get_transform().transform(line.get_xydata())):
                points.append(place + np.column_stack([round_it.real, round_it.imag]))
    for path in outlines:
        path = path[np.isfinite(path).all(axis=1)]
        if len(path) > 1:
            steps = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
            even = np.linspace(0.0, steps[-1], min(int(steps[-1] / 4.0) + 2, 20_000))
            points.append(np.column_stack([np.interp(even, steps, column) for column in path.T]))
    return np.concatenate(points)


def thinned(count: int, most: int = 24) -> list[int]:
    """Which of ``count`` things to number, from 0: the first, the last, and between them those of round numbers."""
    steps = (many * 10**power for power in range(10) for many in (1, 2, 5))
    step = next(step for step in steps if count <= step * (most - 1))
    return [n - 1 for n in range(1, count + 1) if n in (1, count) or (n % step == 0 and 2 * (count - n) >= step)]
