"""The pictures of a flight by their names; one of them shows all on one sheet."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nutdamp.figures import geometry, history, labels, motion, sphere, style
from nutdamp.figures.legends import legend, titled
from nutdamp.flight.propagation import Flight
from nutdamp.flight.track import Track

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@style.styled
def flight_figure(name: str, flight: Flight, track: Track, *, narrow: bool = False) -> Figure:
    """The figure ``overview``, ``motion``, ``sphere``, ``history`` or ``timeline``; raises KeyError for others.

    ``narrow``: for a phone, which has ``history`` and ``timeline`` alone.
    """
    seen = geometry.drawn(flight, track)
    figure = (NARROW if narrow else DRAWN)[name](flight, seen)
    until, end = float(seen.t[-1]), float(track.t[-1])
    cut = until < 0.99 * end
    for axes in figure.axes:
        if axes.get_xlabel() == history.TIME and cut:
            axes.set_xlabel(f"{history.TIME} (the first {until:.4g} of {end:.4g})")
    part = f"; drawn: the first {until:.4g} s of {end:.4g} s" if cut else ""
    titled(figure, motion.title(flight) + part)
    labels.settle(figure)
    return figure


def overview(flight: Flight, track: Track) -> Figure:
    """Pole curve, axis track, cones, rates and cone angles over time, firings: one sheet of A4 across, or longer."""
    channels = len({pulse.channel for pulse in flight.schedule})
    heights = [1.0, 1.0, 0.3 + 0.25 * max(channels, 2)]
    figure = style.sheet(11.0, 5.9 + sum(heights))
    halves = figure.subfigures(2, 1, height_ratios=[4.4, 1.5 + sum(heights)], squeeze=False)[:, 0]
    upper, lower = halves[0], halves[1]
    body, space, cones = upper.subplots(1, 3)
    motion.pole_curve(body, flight, track)
    motion.axis_track(space, flight, track)
    sphere.cones_in_space(cones, flight, track)
    legend(upper, [body, space, cones])
    rates, angles, firings = lower.subplots(3, 1, sharex=True, height_ratios=heights)
    history.rate_history(rates, flight, track)
    history.cone_history(angles, flight, track)
    history.firings(firings, flight, float(track.t[-1]), brief=channels > 2 or len(flight.schedule) > 8)
    firings.set_xlabel(history.TIME)
    legend(lower, [rates, angles, firings])
    return figure


DRAWN = {
    "overview": overview,
    "motion": motion.motion,
    "sphere": sphere.sphere,
    "history": history.history,
    "timeline": history.timeline,
}
NARROW = {"history": partial(history.history, narrow=True), "timeline": partial(history.timeline, narrow=True)}
