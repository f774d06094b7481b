"""Pole curve and axis track in the terminal: eight dots a character, square where it is twice as high as wide."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray
from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from nutdamp.figures import geometry
from nutdamp.flight.propagation import Flight, Track
from nutdamp.spacecraft.model import Vector

PATH, PULSE, MOMENTUM = "cyan", "bold red", "green"

SIDE_BY_SIDE = 76
"""Characters from which both panels fit side by side."""

WIDEST, LEAST, GAP = 70, 30, 2
"""Characters of one panel at most and at least, and between the two."""

ACROSS, DOWN = 2, 4
"""Dots in a character."""

# The Unicode block begins at U+2800; its bits count down the left column of dots, then the right, then the lowest row.
_FIRST = 0x2800
_BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])

FAINT = "dim"
"""Style of dots that give way to every curve."""

FRAME = 2
"""Characters between the numbers and the dots."""

MOST_DOTS = 200_000
"""Points along one curve at most."""


@dataclass
class BraillePanel:
    """A square panel with equal scales: ``columns`` characters of dots, ``half`` the width of the data from ``middle``.

    Curves lie over each other in the order they are drawn; marks lie over all curves.
    """

    columns: int
    middle: Vector
    half: float
    _layers: list[tuple[str, NDArray[np.bool_]]] = field(default_factory=list)
    _marks: dict[tuple[int, int], tuple[str, str]] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Lines of characters; as many dots as across."""
        return max(self.columns * ACROSS // DOWN, 1)

    def _dots(self, points: Vector) -> NDArray[np.int64]:
        """Dots (n, 2), right and down, of points of the data; those outside are beyond the edges."""
        size = np.array([self.columns * ACROSS, self.rows * DOWN]) - 1
        share = (points - self.middle) / (2.0 * self.half) * np.array([1.0, -1.0]) + 0.5
        return np.asarray(np.rint(share * size), dtype=np.int64)

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Line and column of the character that a point of the data falls into."""
        column, row = self._dots(np.array([[x, y]]))[0] // [ACROSS, DOWN]
        return int(row), int(column)

    def curve(self, points: Vector, style: str) -> None:
        """Draw a path (n, 2) without gaps."""
        size = 2.0 * self.half / (self.columns * ACROSS)
        length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        even = np.linspace(0.0, length[-1], min(math.ceil(2.0 * float(length[-1]) / size), MOST_DOTS) + 1)
        fine = np.column_stack([np.interp(even, length, column) for column in points.T])
        self.scatter(np.vstack([fine, points]), style)

    def scatter(self, points: Vector, style: str) -> None:
        """Draw points (n, 2) as dots."""
        dots = self._dots(points)
        inside = ((dots >= 0) & (dots < [self.columns * ACROSS, self.rows * DOWN])).all(axis=1)
        layer = np.zeros((self.rows * DOWN, self.columns * ACROSS), dtype=bool)
        layer[dots[inside, 1], dots[inside, 0]] = True
        self._layers.append((style, layer))

    def mark(self, point: Vector, text: str, style: str, *, at: bool = False) -> bool:
        """Write ``text`` at a point, in the first free place right, left, above or below; True where there is one.

        A text ``at`` the point itself gives way only to earlier marks.
        """
        row, column = self.cell(float(point[0]), float(point[1]))
        around = [(row, column + 1), (row, column - len(text)), (row - 1, column), (row + 1, column)]
        for line, begins in [(row, column)] if at else around:
            cells = [(line, begins + step) for step in range(len(text))]
            free = all(0 <= r < self.rows and 0 <= c < self.columns and (r, c) not in self._marks for r, c in cells)
            # Numbers that touch would read as one.
            alone = not any(((r, c - 1) in self._marks) or ((r, c + 1) in self._marks) for r, c in cells)
            if free and (alone or at):
                self._marks.update({cell: (sign, style) for cell, sign in zip(cells, text, strict=True)})
                return True
        return False

    def lines(self) -> list[Text]:
        """The panel as lines of ``columns`` characters."""
        codes = np.zeros((self.rows, self.columns), dtype=np.int64)
        styles = np.full((self.rows, self.columns), "", dtype=object)
        for style, layer in self._layers:
            cells = layer.reshape(self.rows, DOWN, self.columns, ACROSS)
            bits = np.einsum("rdca,da->rc", cells, _BITS)
            here = bits > 0
            faint = here & (styles == FAINT)
            codes[faint] = 0
            codes |= bits
            styles[here] = style
        drawn = []
        for row in range(self.rows):
            line = Text()
            for column in range(self.columns):
                sign, style = self._marks.get(
                    (row, column), (chr(_FIRST + int(codes[row, column])), styles[row, column])
                )
                line.append(" " if sign == chr(_FIRST) else sign, style or None)
            drawn.append(line)
        return drawn


def fitted(width: int, middle: Vector, half: float) -> BraillePanel:
    """The panel that with its frame and its numbers is ``width`` characters wide."""
    for margin in range(1, width):
        panel = BraillePanel(width - margin - FRAME, middle, half)
        if margin >= max(len(text) for text in _upright(panel).values()):
            return panel
    raise ValueError(f"no room for a panel in {width} characters")


def _upright(panel: BraillePanel) -> dict[int, str]:
    """Numbers of the upright scale by the line they are on."""
    low, high = float(panel.middle[1]) - panel.half, float(panel.middle[1]) + panel.half
    left = float(panel.middle[0]) - panel.half
    return {panel.cell(left, value)[0]: f"{value:.4g}" for value in geometry.ticks(low, high, max(panel.rows // 3, 2))}


def framed(panel: BraillePanel, title: str, x: str, y: str) -> list[Text]:
    """The panel with its title, its two scales and their quantities; all lines equally wide."""
    (left, low), (right, _) = panel.middle - panel.half, panel.middle + panel.half
    upright = _upright(panel)
    margin = max(len(text) for text in upright.values())
    width = margin + FRAME + panel.columns
    lines = [Text(title.center(width), "bold"), Text(y.ljust(width), FAINT)]
    for row, line in enumerate(panel.lines()):
        named = upright.get(row, "")
        lines.append(Text(named.rjust(margin) + (" ┤" if named else " │")) + line)
    rule, names = ["─"] * panel.columns, [" "] * width
    for value in geometry.ticks(left, right, max(panel.columns // 9, 2)):
        column, text = panel.cell(value, low)[1], f"{value:.4g}"
        begins = min(max(column + margin + FRAME - len(text) // 2, 0), width - len(text))
        if all(sign == " " for sign in names[max(begins - 1, 0) : begins + len(text) + 1]):
            names[begins : begins + len(text)] = text
            rule[column] = "┬"
    return [*lines, Text(" " * margin + " └" + "".join(rule)), Text("".join(names)), Text(x.rjust(width), FAINT)]


def motion_drawing(flight: Flight, track: Track) -> Drawing:
    """The two panels, as wide as the terminal lets them."""
    return Drawing(flight, geometry.drawn(flight, track))


@dataclass(frozen=True, eq=False)
class Drawing:
    """Two panels, rendered for the width of the console."""

    flight: Flight
    track: Track

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width = options.max_width
        beside = width >= SIDE_BY_SIDE
        each = max(min((width - GAP) // 2 if beside else width, WIDEST), LEAST)
        left, right = self.pole_curve(each), self.axis_track(each)
        yield Text()
        if beside:
            for left_line, right_line in zip_longest(left, right, fillvalue=Text(" " * each)):
                yield left_line + Text(" " * GAP) + right_line
        else:
            yield from (*left, Text(), *right)
        pulses = "   digits: firing" if len(self.flight.schedule) else ""
        target = "" if self.flight.spacecraft.goal.axis is None else "   * target"
        yield Text(f"o t = 0   x end   + H, first and after each firing{target}{pulses}", FAINT)

    def pole_curve(self, width: int) -> list[Text]:
        """The rotation vector in the body, as lines of ``width`` characters."""
        points = geometry.pole_path(self.track)
        panel = fitted(width, *geometry.room(points, 0.1, centre=True))
        self._path(panel, points)
        return framed(panel, "Pole curve", f"ω1, °/s{geometry.pole_note(self.flight)}".replace("−", "-"), "ω2, °/s")

    def axis_track(self, width: int) -> list[Text]:
        """The spin axis in space and the jumps of H, as lines of ``width`` characters."""
        points, momentum = geometry.sky_paths(self.flight, self.track)
        target = geometry.sky_target(self.flight, self.track)
        panel = fitted(width, *geometry.room(np.vstack([points, momentum, target]), 0.1))
        firings = [stretch for stretch in geometry.stretches(self.flight, self.track) if stretch.pulse is not None]
        for row in (0, *(stretch.last for stretch in firings)):
            panel.mark(momentum[row], "+", MOMENTUM, at=True)
        for point in target:
            panel.mark(point, "*", MOMENTUM, at=True)
        self._path(panel, points)
        sky = geometry.sky_names(self.flight)
        return framed(panel, "Axis track, H towards you", sky.x, sky.y)

    def _path(self, panel: BraillePanel, points: Vector) -> None:
        span = np.linspace(-panel.half, panel.half, panel.columns)
        panel.scatter(np.column_stack([panel.middle[0] + span, np.zeros(panel.columns)]), FAINT)
        panel.scatter(np.column_stack([np.zeros(panel.columns), panel.middle[1] + span]), FAINT)
        panel.mark(points[0], "o", PATH, at=True)
        panel.mark(points[-1], "x", PATH, at=True)
        for stretch in geometry.stretches(self.flight, self.track):
            rows = points[stretch.first : stretch.last + 1]
            panel.curve(rows, PATH if stretch.pulse is None else PULSE)
            if stretch.pulse is not None:
                middle = rows[len(rows) // 2] if len(rows) > 2 else rows.mean(axis=0)
                panel.mark(middle, str(stretch.pulse + 1), PULSE)
