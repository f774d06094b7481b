"""All pictures of a flight on one sheet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nutdamp.flight import Flight
from nutdamp.presentation import geometry
from nutdamp.presentation.figures import history, motion, sphere, style
from nutdamp.track import Track

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@style.styled
def overview_figure(flight: Flight, track: Track) -> Figure:
    """Pole curve, axis track, cones, rates and cone angles over time, firings: one sheet of A4 across."""
    whole, track = track, geometry.drawn(flight, track)
    figure = style.sheet(11.0, 7.8)
    halves = figure.subfigures(2, 1, height_ratios=[1.05, 1.0], squeeze=False)[:, 0]
    upper, lower = halves[0], halves[1]
    body, space, cones = upper.subplots(1, 3)
    motion.pole_curve(body, flight, track)
    motion.axis_track(space, flight, track)
    sphere.sphere(cones, flight, track)
    style.legend(upper, [body, space, cones])
    rows = len({pulse.channel for pulse in flight.schedule})
    rates, angles, firings = lower.subplots(3, 1, sharex=True, height_ratios=[2, 2, 0.6 + 0.4 * min(max(rows, 1), 6)])
    history.rate_history(rates, flight, track)
    history.cone_history(angles, flight, track)
    history.timeline(firings, flight, float(track.t[-1]), brief=rows > 2 or len(flight.schedule) > 8)
    firings.set_xlabel(history.time_label(whole, track))
    style.legend(lower, [rates, angles, firings])
    figure.suptitle(motion.title(flight))
    style.settle(figure)
    return figure
