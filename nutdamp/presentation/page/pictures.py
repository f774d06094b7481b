"""The pictures of a page: what the recommended schedule does, drawn from its flight through the real widths."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nutdamp import flight
from nutdamp.planning import Plan
from nutdamp.presentation import figures
from nutdamp.presentation.page.document import Picture

if TYPE_CHECKING:
    from nutdamp.dispersion.study import Results

SAMPLES = 1000
"""Rows of the track; the figures draw a finer one where they need it."""


def pictures_of(plan: Plan) -> tuple[Picture, ...]:
    """Pole curve and axis track, cones in space, rates and angles over time, firings; raises MissingExtra."""
    body, pulses = plan.spacecraft, plan.pulses
    until = pulses.end + body.inertial_period
    flown = flight.flown(body, pulses, until)
    track = flown.sampled(SAMPLES, until)
    drawn = [
        (
            figures.motion_figure(flown, track),
            "Left: the tip of the rotation vector ω in the 1-2 plane of the body, with the pulses that move it. "
            "Right: the direction of the spin axis in space, with the places of the angular momentum H.",
            "Pole curve in the body and track of the spin axis in space",
        ),
        (
            figures.sphere_figure(flown, track),
            "The cones in space: the body cone rolls on the space cone about H.",
            "Spherical view of body cone, space cone, angular momentum and spin axis",
        ),
        (
            figures.history_figure(flown, track),
            "Body rates and cone angles over time; bars mark the pulses.",
            "Body rates and cone angles over time",
        ),
    ]
    if len(pulses):
        drawn.append(
            (figures.timeline_figure(flown), "Which channel fires, when and for how long.", "Timeline of the firings")
        )
    return tuple(Picture(figures.svg(figure), caption, described) for figure, caption, described in drawn)


def dispersion_picture_of(dispersed: Results, scheme: str) -> Picture:
    """How the cases of a study are distributed; raises MissingExtra."""
    return Picture(
        figures.svg(figures.dispersion_figure(dispersed, scheme=scheme)),
        "How many cases leave how much nutation, and how far H has moved, with what is required. "
        "Right: the share of cases beyond.",
        "Histograms and distribution functions of nutation and shift of H",
    )
