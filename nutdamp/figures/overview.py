"""The pictures of a flight by their names; one of them shows all on one sheet. ``track`` is a track of ``flight``."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from nutdamp.figures import geometry, history, labels, motion, sphere, style
from nutdamp.flight import propagation
from nutdamp.flight.propagation import Flight, Track, model_name
from nutdamp.spacecraft import requirements
from nutdamp.views.spacecraft import angle_names, angle_texts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nutdamp.planning.plan import Plan


ROWS = 1000
"""Rows of the track of a plan; the figures draw a finer one where they need it."""

TALL = 4.0
"""Inches of the two planes of the motion on the sheet with all."""


@style.styled
def flight_figure(name: str, flight: Flight, track: Track, *, narrow: bool = False) -> Figure:
    """The figure ``overview``, ``motion``, ``sphere`` or ``history``; raises KeyError for others.

    Where the rows of ``track`` are too few for a smooth curve, a finer one is drawn. ``narrow``: for a phone, which has
    ``history`` alone. Raises MissingExtra without matplotlib.
    """
    seen = geometry.drawn(flight, track)
    figure = (NARROW if narrow else DRAWN)[name](flight, seen)
    until, end = float(seen.t[-1]), float(track.t[-1])
    part = f"; drawn: the first {until:.4g} s of {end:.4g} s" if until < 0.99 * end else ""
    style.heading(figure, flight.spacecraft, title(flight) + part)
    labels.settle(figure)
    return figure


def title(flight: Flight) -> str:
    """Heading of every sheet after the spacecraft's name: scheme, model and result."""
    left, count, body = flight.residual, len(flight.schedule), flight.spacecraft
    how = " ".join(filter(None, (flight.scheme, f"by {model_name([flight.schedule], flight.model)}")))
    fired = f"firings: {count} until {style.number(flight.schedule.end)} s" if count else "no firing"
    swings = "" if body.inertia.symmetric else "at most "  # between two angles, H standing still
    goal, turn = body.goal.axis, ""
    if goal is not None:
        angles = zip(angle_names(body), angle_texts(body, goal), strict=True)
        target = ", ".join(f"{name} {text.removesuffix(' deg').rstrip('0').rstrip('.')}°" for name, text in angles)
        turn = f"H turned {style.angle(body.to_turn)} to the target, {target}\n"
    result = f"nutation {swings}{style.angle(body.nutation)} → {style.angle(left.nutation)}"
    return f"{how}, {fired}\n{turn}{result}, {style.part_name(requirements.aim(body))} {style.angle(left.axis_error)}"


def overview(flight: Flight, track: Track) -> Figure:
    """Motion above history: one sheet of A4 across, or longer."""
    sizes = history.heights(flight, track)
    figure = style.sheet(9.6, TALL + 1.6 + sum(sizes))
    ratio = motion.ROOM if geometry.momentum_inset(flight, track) is not None else 1.0
    grid = figure.add_gridspec(1 + len(sizes), 2, height_ratios=[TALL, *sizes], width_ratios=[1.0, ratio])
    motion.planes(figure, [grid[0, 0], grid[0, 1]], flight, track)
    cells = [grid[row + 1, :] for row in range(len(sizes))]
    style.legend(figure, history.courses(figure, cells, flight, track))
    return figure


DRAWN = {"overview": overview, "motion": motion.motion, "sphere": sphere.sphere, "history": history.history}
NARROW = {"history": partial(history.history, narrow=True)}


def shown(plan: Plan) -> tuple[Flight, Track]:
    """A plan flown through its real widths as far as its pictures reach."""
    end = geometry.shown_until(plan.spacecraft, plan.pulses)
    flown = replace(propagation.flown(plan.spacecraft, plan.pulses, end), scheme=plan.scheme)
    return flown, flown.sampled(ROWS, end)


def until(flight: Flight) -> float:
    """End of the time axis of a flight, s: that of the flight where it was named, else `geometry.shown_until`."""
    usual = flight.schedule.end + flight.spacecraft.inertial_period
    return flight.shown_to if flight.shown_to != usual else geometry.shown_until(flight.spacecraft, flight.schedule)
