"""Figures (matplotlib, the extra ``plot``) of a flight, and what becomes of them: files and inline SVG.

Every function that makes a figure raises MissingExtra without matplotlib; none needs a window. ``track`` is always a
track of ``flight``; where its rows are too few for a smooth curve, a finer one is drawn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nutdamp import flight as flights
from nutdamp.presentation.figures.dispersion import dispersion_figure
from nutdamp.presentation.figures.export import ending, rendered, svg
from nutdamp.presentation.figures.history import history_figure, timeline_figure
from nutdamp.presentation.figures.motion import motion_figure
from nutdamp.presentation.figures.overview import overview_figure
from nutdamp.presentation.figures.sphere import sphere_figure
from nutdamp.presentation.figures.trade import trade_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.flight import Flight
    from nutdamp.planning import Plan
    from nutdamp.track import Track

__all__ = [
    "dispersion_figure",
    "ending",
    "history_figure",
    "motion_figure",
    "named",
    "overview_figure",
    "picture",
    "plan_picture",
    "rendered",
    "sphere_figure",
    "svg",
    "timeline_figure",
    "trade_figure",
]

ROWS = 1000
"""Rows of the track of a plan."""


def named(name: str, flight: Flight, track: Track) -> Figure:
    """The figure ``overview``, ``motion``, ``sphere``, ``history`` or ``timeline``; raises KeyError for others."""
    if name == "timeline":
        return timeline_figure(flight)
    draw = {"overview": overview_figure, "motion": motion_figure, "sphere": sphere_figure, "history": history_figure}
    return draw[name](flight, track)


def picture(name: str, flight: Flight, track: Track, path: str) -> bytes:
    """A figure by its name, as the content of the file ``path``; raises as `rendered`."""
    ending(path)
    return rendered(named(name, flight, track), path)


def plan_picture(name: str, plan: Plan, path: str) -> bytes:
    """A figure of a plan, flown through its real widths to one inertial period after the last pulse."""
    end = plan.pulses.end + plan.spacecraft.inertial_period
    flown = flights.flown(plan.spacecraft, plan.pulses, end)
    return picture(name, flown, flown.sampled(ROWS, end), path)
