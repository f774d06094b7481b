"""All pictures of a flight on one sheet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nutdamp.flight import Flight
from nutdamp.report.figures import history, motion, sphere, style
from nutdamp.track import Track

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@style.styled
def overview_figure(flight: Flight, track: Track) -> Figure:
    """Pole curve, axis track, cones, rates and cone angles over time, firings: one sheet of A4 across."""
    figure = style.sheet(11.0, 7.8)
    halves = figure.subfigures(2, 1, height_ratios=[1.05, 1.0], squeeze=False)[:, 0]
    upper, lower = halves[0], halves[1]
    body, space, cones = upper.subplots(1, 3)
    motion.pole_curve(body, flight, track)
    motion.axis_track(space, flight, track)
    sphere.sphere(cones, flight, track)
    rates, angles, firings = lower.subplots(3, 1, sharex=True, height_ratios=[2, 2, 1.6])
    history.rate_history(rates, flight, track)
    history.cone_history(angles, flight, track)
    history.timeline(firings, flight, float(track.t[-1]))
    firings.set_xlabel("time, s")
    figure.suptitle(motion.title(flight))
    style.legend(figure, [body, space, cones, rates, angles], 8)
    style.settle(figure)
    return figure
