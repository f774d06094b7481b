"""Pole curve and axis track in the terminal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from nutdamp.flight import Flight
from nutdamp.report import geometry
from nutdamp.report.braille import FAINT, Panel, framed
from nutdamp.spacecraft import Vector
from nutdamp.track import Track

PATH, PULSE, MOMENTUM = "cyan", "bold red", "green"

SIDE_BY_SIDE = 76
"""Characters from which both panels stand in one row."""

WIDEST, GAP, SCALE = 70, 2, 9
"""Characters of one panel at most, between the two, and for the numbers of the upright scale."""


def motion_drawing(flight: Flight, track: Track) -> Drawing:
    """The two panels, as wide as the terminal lets them."""
    return Drawing(flight, geometry.drawn(flight, track))


@dataclass(frozen=True, eq=False)
class Drawing:
    """Renders itself for the width of the console."""

    flight: Flight
    track: Track

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width = options.max_width
        beside = width >= SIDE_BY_SIDE
        columns = max(min((width - GAP) // 2 if beside else width, WIDEST) - SCALE, 10)
        left, right = self._pole_curve(columns), self._axis_track(columns)
        yield Text()
        if beside:
            widest = max(len(line) for line in left)
            for one, other in zip(left, right, strict=True):
                one.pad_right(widest + GAP - len(one))
                yield one + other
        else:
            yield from (*left, Text(), *right)
        pulses = "   digits: pulse" if len(self.flight.schedule) else ""
        yield Text(f"o t = 0   x end   + H at the start and after each pulse{pulses}", FAINT)

    def _pole_curve(self, columns: int) -> list[Text]:
        points = geometry.pole_path(self.track)
        panel = Panel(columns, *geometry.room(points, 0.1, centre=True))
        self._path(panel, points)
        body = self.flight.spacecraft
        told = "" if body.inertia.aligned else ", principal axes"
        told += ", spin about -3" if body.spin < 0.0 else ""
        return framed(panel, "Pole curve", f"ω1, deg/s{told}", "ω2, deg/s")

    def _axis_track(self, columns: int) -> list[Text]:
        points, momentum = geometry.sky_paths(self.flight, self.track)
        panel = Panel(columns, *geometry.room(np.vstack([points, momentum]), 0.1))
        firings = [stretch for stretch in geometry.stretches(self.flight, self.track) if stretch.pulse is not None]
        for row in (0, *(stretch.last for stretch in firings)):
            panel.mark(momentum[row], "+", MOMENTUM, at=True)
        self._path(panel, points)
        x, y = geometry.sky_names(self.flight)
        return framed(panel, "Axis track", x, y)

    def _path(self, panel: Panel, points: Vector) -> None:
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
