"""Labels of figures, placed where they cover neither each other nor curves and marks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from nutdamp.figures.style import INK, LEADER, SMALL, STAR, TARGET, TICK_SIZE
from nutdamp.spacecraft.model import Vector

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation
    from matplotlib.transforms import Bbox


class Meant(NamedTuple):
    """Points of a label, (n, 2), and points that it must not be taken for, (m, 2), in the units of its panel."""

    own: Vector
    others: Vector


_MEANT: WeakKeyDictionary[Artist, Meant] = WeakKeyDictionary()
"""Points meant by each label, until it is settled."""


def add(
    axes: Axes,
    text: str,
    place: Vector,
    colour: str,
    *,
    role: str = "label",
    short: str = "",
    meant: Meant | None = None,
) -> None:
    """A label near a point. `settle` moves it to where there is room, by its role, or takes it out.

    ``label`` goes anywhere around its point and may be left out; ``vital`` is never left out; ``bar`` is above the bar
    of a firing, and reads ``short`` where not all of them have room. The point ``meant`` is nearest to the label, or
    joined to it by a thin line.
    """
    at, vertical = (float(place[0]), float(place[1])), "bottom" if role == "bar" else "center_baseline"
    look: dict[str, Any] = {"color": colour, "fontsize": SMALL, "ha": "center", "va": vertical}
    note = axes.annotate(text, at, xytext=(0, 0), textcoords="offset points", annotation_clip=False, **look)
    note.set_label(f"_{role}{short}")  # begins so that no legend shows it
    if meant is not None:
        _MEANT[note] = meant


def meant(places: Vector, rows: Sequence[int]) -> Meant:
    """Some rows of ``places`` (n, 2), which are not to be taken for the others."""
    return Meant(places[rows], np.delete(places, rows, axis=0))


def target(axes: Axes, places: Vector, name: str = "target") -> None:
    """The star of the target (n, 2) with its label, and the ``name`` in the legend; none where there is none."""
    if len(places):
        axes.plot(*places.T, label=name, **TARGET)
        add(axes, "target", places[0], INK, role="vital")


PASSES = 8
"""Largest number of passes of the layout, until panels of equal scales move by less than a pixel."""

BAR_GAP = 2.0
"""Points between a bar and its label."""

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

FAR = 15.0
"""Points from which a line leads from a label to its point."""

_COVERED = {"_vital": np.inf, "_label": 14.0}
"""Points of curves, 4 pixels apart, that a label may cover."""


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
            box = _settle(note, taken, (curves, leads), window, points)
            if box is not None:
                leads = np.vstack([leads, _lead(note, box, points)])
            _MEANT.pop(note, None)
        bars: list[Any] = [note for note in axes.texts if str(note.get_label()).startswith("_bar")]
        if len(_in_rows(bars, window, points)) < len(bars):  # else all have room as they are
            for note in bars:
                note.set_text(str(note.get_label()).removeprefix("_bar"))
            fitting = _in_rows(bars, window, points)
            for note in bars:
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
    """Place of one label, which covers few of the curves and, if it can, none of the lines from other labels.

    ``inked``: points of curves, and of stars and lines of other labels; ``window`` is that of the panel, ``points`` the
    number of pixels in a point.
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
        if led and not _nearest(note, box, points):
            way = _way(note, box, points)
            covered += 3.0 if away[number] > FAR else 1e3
            covered += 1e3 * any(other.count_contains(way) for other in taken)
        if covered < least:
            best, least = number, covered
    if best is None:
        note.set_visible(False)
        return None
    note.set_position(offsets[best].tolist())
    taken.append(boxes[best])
    return taken[-1]


def _contained(boxes: Sequence[Bbox], places: Vector) -> Vector:
    """Number of ``places`` (n, 2) within each box."""
    corners = np.array([box.get_points() for box in boxes])
    x, y = ((corners[:, :1, axis] < places[:, axis]) & (places[:, axis] < corners[:, 1:, axis]) for axis in (0, 1))
    return np.asarray(np.count_nonzero(x & y, axis=1), dtype=np.float64)


NEARER, NEAR = 0.45, 8.0
"""The point of a label is nearer to it than this share of the distance to any it could be taken for, and than this
many points."""


def _nearest(note: Annotation, box: Bbox, points: float) -> bool:
    """True where a label in a ``box`` of pixels clearly belongs to the points it is meant for."""
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
    """The points, 4 pixels apart, from the points of a label to its ``box``."""
    axes: Any = note.axes
    tip = np.asarray(axes.transData.transform(note.xy))
    inner = box.padded(-1.5 * points)
    edge = np.clip(tip, [inner.x0, inner.y0], [inner.x1, inner.y1])
    return np.linspace(tip, edge, max(int(np.hypot(*(edge - tip)) / 4.0), 2))


def _lead(note: Annotation, box: Bbox, points: float) -> Vector:
    """The points, 4 pixels apart, of a thin line from a label to its point; none where that is nearest anyhow."""
    axes: Any = note.axes
    if _nearest(note, box, points):
        return np.empty((0, 2))
    way = _way(note, box, points)
    ends = np.asarray(axes.transData.inverted().transform(way[[0, -1]]))
    limits = axes.get_xlim(), axes.get_ylim()
    axes.plot(*ends.T, color=note.get_color(), linewidth=LEADER, label="_leader", zorder=2.5)
    axes.set(xlim=limits[0], ylim=limits[1])
    return way


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
