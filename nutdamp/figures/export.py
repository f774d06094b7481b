"""Figures (matplotlib, the extra ``plot``) of a flight, as files and inline SVG.

Every function that makes a figure raises MissingExtra without matplotlib; none needs a window. ``track`` is always a
track of ``flight``; where its rows are too few for a smooth curve, a finer one is drawn.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from nutdamp.figures import geometry
from nutdamp.figures.certificate import certificate_figure
from nutdamp.figures.dispersion import dispersion_figure
from nutdamp.figures.image import ending, rendered, svg
from nutdamp.figures.overview import flight_figure
from nutdamp.figures.schemes import schemes_figure
from nutdamp.figures.trade import trade_figure
from nutdamp.flight import propagation

if TYPE_CHECKING:
    from nutdamp.flight.propagation import Flight
    from nutdamp.flight.track import Track
    from nutdamp.planning.plan import Plan


__all__ = [
    "certificate_figure",
    "dispersion_figure",
    "ending",
    "flight_figure",
    "rendered",
    "schemes_figure",
    "shown",
    "svg",
    "trade_figure",
    "until",
]

ROWS = 1000
"""Rows of the track of a plan; the figures draw a finer one where they need it."""


def shown(plan: Plan) -> tuple[Flight, Track]:
    """A plan flown through its real widths as far as its pictures reach."""
    until = geometry.shown_until(plan.spacecraft, plan.pulses)
    flown = replace(propagation.flown(plan.spacecraft, plan.pulses, until), scheme=plan.scheme)
    return flown, flown.sampled(ROWS, until)


def until(flight: Flight) -> float:
    """End of the time axis of a flight, s: that of the flight where it was named, else `geometry.shown_until`."""
    usual = flight.schedule.end + flight.spacecraft.inertial_period
    return flight.shown_to if flight.shown_to != usual else geometry.shown_until(flight.spacecraft, flight.schedule)
