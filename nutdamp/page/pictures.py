"""The pictures of a page: the recommended schedule, drawn from its flight through the real widths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from nutdamp.figures import dispersion, geometry, overview, trade
from nutdamp.figures.overview import NARROW
from nutdamp.page.document import Picture
from nutdamp.page.panels import picture
from nutdamp.physics import attitude
from nutdamp.planning.decision import Comparison
from nutdamp.planning.plan import Plan
from nutdamp.planning.tradeoff import Front
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.requirements import Part
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.views.text import degrees

if TYPE_CHECKING:
    from nutdamp.flight.track import Track
    from nutdamp.montecarlo.study import Results


UNEQUAL = " With I1 ≠ I2 the space cone is what ω traces about H in free motion: not circular, nor closed."
"""Note on cones that are not circular."""


def pictures_of(plan: Plan) -> tuple[Picture, ...]:
    """Pole curve and axis track, cones in space, nutation, firings and rates over time; raises MissingExtra."""
    flown, track = overview.shown(plan)
    drawn = [
        (
            "motion",
            "Pole curve: the tip of the rotation vector ω in the 1-2 plane of the body, with the firings that move it. "
            "Axis track: the direction of the spin axis in space, with the places of the angular momentum H"
            + (", enlarged in an inset." if geometry.momentum_inset(flown, track) is not None else ".")
            + _wanders(plan, track),
            "Pole curve in the body and track of the spin axis in space",
        ),
        (
            "sphere",
            f"The cones in space: {'the inside of ' * (plan.spacecraft.inertia.a < 0.0)}the body cone rolls on the "
            "space cone about H." + UNEQUAL * (not plan.spacecraft.inertia.symmetric),
            "Spherical view of body cone, space cone, angular momentum and spin axis",
        ),
        (
            "history",
            "Nutation on a log axis with what is required, the firings of each channel, and body rates over time."
            + " The on-times are effective ones, impulse over full torque: the manoeuvre sheet has the commands."
            * plan.pulses.through_valves
            + " Angles are those of the torque of the steerable torquer, from body axis +1 towards +2."
            * any(pulse.channel == STEERABLE for pulse in plan.pulses),
            "Nutation, firings and body rates over time",
        ),
    ]
    return tuple(
        picture(
            overview.flight_figure(name, flown, track),
            caption,
            described,
            overview.flight_figure(name, flown, track, narrow=True) if name in NARROW else None,
        )
        for name, caption, described in drawn
    )


def _wanders(plan: Plan, track: Track) -> str:
    """Note on the distance that H goes between the pulses, where its end is bounded by less; empty elsewhere."""
    body = plan.spacecraft
    most_of = {bound.part: bound.most for bound in requirements.required(body)}
    if requirements.aim(body) is not Part.SHIFT or Part.SHIFT not in most_of:
        return ""
    farthest = float(attitude.angle_between(track.momentum[:1], track.momentum).max())
    if farthest <= most_of[Part.SHIFT]:
        return ""
    return f" Between the pulses H is up to {degrees(farthest)} from where it was: what is required is for the end."


def trade_picture_of(compared: Comparison, fronts: Sequence[Front]) -> Picture:
    """Time against cost, with the recommended plan among the schedules of the fronts; raises MissingExtra."""
    wide, narrow = (
        trade.trade_figure(compared.spacecraft, fronts, compared.recommended, narrow=narrow) for narrow in (False, True)
    )
    return picture(
        wide,
        "What an earlier end costs: each mark is a schedule for one of the end times tried, numbered along each front; "
        "between them a schedule may cost less than the line.",
        "Cost of schedules over the end of the last pulse",
        narrow,
    )


def dispersion_pictures_of(dispersed: Results, scheme: str) -> tuple[Picture, ...]:
    """Distribution of the cases of a study, and final H; raises MissingExtra."""
    body = dispersed.study.model.spacecraft
    bounded = any(bound.part is requirements.aim(body) for bound in requirements.required(body))
    drawn = (
        (
            "cases",
            "Share of the cases that leave no more than so much nutation, and no more than so much momentum shift, "
            "over a histogram, with what is required.",
            "Distribution functions and histograms of nutation and momentum shift",
        ),
        (
            "momentum",
            "Where H ends in each case, with the ellipse that holds as many cases as must comply"
            + (", and what is required of it." if bounded else ".")
            + " The momentum shift is counted from where H was at t = 0 in that case." * (body.goal.axis is None),
            "Scatter of the final angular momentum with ellipse" + " and requirement" * bounded,
        ),
    )
    return tuple(
        picture(dispersion.dispersion_figure(name, dispersed, scheme=scheme), caption, described)
        for name, caption, described in drawn
    )
