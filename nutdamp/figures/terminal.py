"""Pole curve and axis track in the terminal."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from nutdamp.figures import geometry
from nutdamp.figures.braille import FAINT, BraillePanel, fitted, framed
from nutdamp.flight.propagation import Flight
from nutdamp.flight.track import Track
from nutdamp.spacecraft.model import Vector

PATH, PULSE, MOMENTUM = "cyan", "bold red", "green"

SIDE_BY_SIDE = 76
"""Characters from which both panels fit side by side."""

WIDEST, LEAST, GAP = 70, 30, 2
"""Characters of one panel at most and at least, and between the two."""


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
        body = self.flight.spacecraft
        note = "" if body.inertia.aligned else ", principal axes"
        note += ", spin about -3" if body.spin < 0.0 else ""
        return framed(panel, "Pole curve", f"ω1, °/s{note}", "ω2, °/s")

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
