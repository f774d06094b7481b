"""Causes, as texts and notes: why there is no plan, what limits a schedule breaks, what keeps the
nutation of a plan from less, and which inputs decide its failing cases.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from nutdamp.common.numerics import RPM
from nutdamp.common.results import Note, note
from nutdamp.errors import Infeasible
from nutdamp.flight.cones import Aspect
from nutdamp.planning.plan import Plan, Worse
from nutdamp.planning.verdict import Verdict
from nutdamp.schemes.correction import steady_omega
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import Breach, Limit, breaches, rounded_off
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import NEGLIGIBLE, Part
from nutdamp.spacecraft.schedule import Schedule

CUT = "the search ended at its limit of work"
BUG = "internal error, please report"
"""Message on a plan whose scheme raised an unexpected exception, which follows by name."""


def infeasibility(plan: Plan) -> str:
    """Reason for the lack of a schedule; empty where there is one."""
    match plan._why:
        case None:
            return ""
        case Breach() as breach:
            why = f"the only schedule found breaks a limit: {_broken(breach)}"
        case Aspect() as aspect:
            why = strays(aspect)
            if math.isfinite(aspect.least_at):
                why += "; no way round it was found within the limits"
        case Worse(nutation, at):
            why = f"the best schedule found would leave {math.degrees(nutation):.3g}° of nutation"
            decayed = requirements.decayed(plan.spacecraft, at)
            if decayed < plan.spacecraft.nutation:
                why += (
                    f" at {at:.4g} s; without a pulse it decays to "
                    f"{math.degrees(decayed):.3g}° by then"
                )
        case Infeasible() as reason:
            why = str(reason)
        case failure:
            why = f"{BUG}: {type(failure).__name__}"
    return f"{why}; {CUT}" if plan._cut else why


def strays(aspect: Aspect) -> str:
    """Message on a broken cone."""
    assert aspect.broken_at is not None
    bound, angle, at = aspect.broken_at
    edge = "min" if bound.inner else "max"
    limit = f"{edge} = {math.degrees(bound.limit):.6g}°"
    shown = math.degrees(angle) if angle > NEGLIGIBLE else 0.0
    seen = f"{shown:.4g}°"
    if math.isinf(at):
        return f"the target is {seen} from {aspect.keep.name} ({limit})"
    return f"the spin axis comes to {seen} from {aspect.keep.name} at {at:.4g} s ({limit})"


def broken_limits(spacecraft: Spacecraft, schedule: Schedule) -> list[str]:
    """Broken limits of a schedule, each in a sentence with the first pulse that breaks it and the
    number of others.
    """
    grouped: dict[tuple[Limit, tuple[float, float] | None], list[Breach]] = {}
    for breach in breaches(spacecraft, schedule):
        grouped.setdefault((breach.limit, breach.window), []).append(breach)
    counts = [(_broken(broken[0]), len(broken) - 1) for broken in grouped.values()]
    return [f"{text}; further pulses alike: {more}" if more else text for text, more in counts]


def _broken(breach: Breach) -> str:
    """Message on a pulse that breaks a limit."""
    pulse = breach.pulse
    bound = f"{breach.bound:.6g} s"
    limit = breach.limit
    if limit is Limit.MAX_PULSES:
        return f"{breach.number} pulses are more than {breach.bound:.0f}"
    begins, ends = breach.window or (math.nan, math.nan)
    start, on_time = pulse.loaded
    on = f"is on for {on_time:.6g} s"
    early = (
        f"begins less than {bound} after the one before"
        if breach.bound
        else "starts before the one before ends"
    )
    how = {
        Limit.RESOLUTION: f"is too short: at its time numbers are {breach.by:.2g} s apart",
        Limit.EARLIEST: f"starts before {bound}",
        Limit.HORIZON: f"ends after the horizon of {bound}",
        Limit.GAP: early,
        Limit.BLACKOUT: f"lies in the blackout window {begins:.6g} s to {ends:.6g} s",
        Limit.MIN_ON_TIME: f"{on}, less than the shortest on-time of {bound}",
        Limit.MAX_ON_TIME: f"{on}, more than the longest on-time of {bound}",
        Limit.START_TICK: f"does not start on a tick of {bound}",
        Limit.ON_TIME_TICK: f"has an on-time that is not a multiple of the tick of {bound}",
    }[limit]
    return f"pulse {breach.number} ({pulse.channel}, {start:.6g} s to {pulse.over:.6g} s) {how}"


def hindrances(plan: Plan) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Keys of the file for the limits that certainly end a schedule, and for those that may.

    Certainty of the latter takes a plan without them. The horizon ends it where less than a
    nutation period is left.
    """
    spacecraft, limits = plan.spacecraft, plan.spacecraft.limits
    channels = {channel.name: channel for channel in spacecraft.channels}
    fired = [
        (channels[pulse.channel], pulse.loaded[1])
        for pulse in plan.pulses
        if pulse.channel in channels
    ]
    full = 0 < len(fired) == len(plan.pulses) and all(
        on >= each.max_on_time * (1.0 - 1e-9) for each, on in fired
    )
    late = spacecraft.horizon - plan.pulses.end < spacecraft.nutation_period
    ended = full or late
    least = not ended and any(
        0.0 < on <= channel.min_on_time * (1.0 + 1e-9) for channel, on in fired
    )
    certain = {"max_on_time": full, "limits.horizon": late, "min_on_time": least}
    possible = {
        "limits.tick": limits.tick is not None and not ended,
        "limits.blackout": bool(limits.blackout),
    }
    return tuple(key for key in certain if certain[key]), tuple(
        key for key in possible if possible[key]
    )


def remaining(plan: Plan) -> Note:
    """Nutation that remains, and the dominant obstacle to less of it."""
    spacecraft, nutation, (certain, possible) = (
        plan.spacecraft,
        plan._flight.residual.nutation,
        hindrances(plan),
    )
    left = math.degrees(nutation)
    if not {"max_on_time", "limits.horizon"} <= {*certain}:
        if spacecraft.disturbances and not plan.options.with_disturbances:
            return note("remains-unplanned", nutation_deg=left)
        steady = abs(steady_omega(spacecraft, plan.pulses.end))
        if steady:
            tilt = math.atan(spacecraft.inertia.A * steady / abs(spacecraft.axial))
            return note("remains-steady-tilt", nutation_deg=left, tilt_deg=math.degrees(tilt))
        # Worst over root mean square: the centre is off by half the on-time's error and the
        # start's.
        rounding = math.hypot(1.0, 1.5) * math.fsum(rounded_off(spacecraft, plan.pulses))
        if nutation <= rounding:
            return note("remains-rounding", nutation_deg=left, rounding_deg=math.degrees(rounding))
        if len(plan.pulses) == spacecraft.limits.max_pulses:
            return note(
                "remains-max-pulses", nutation_deg=left, pulses=spacecraft.limits.max_pulses
            )
    if not certain and not possible:
        return note("remains-scheme", nutation_deg=left)
    sure, unsure = (", ".join(keys) or "none" for keys in (certain, possible))
    return note("remains-limits", nutation_deg=left, certain=sure, possible=unsure)


def main_causes(verdict: Verdict) -> Iterator[Note]:
    """Inputs that decide the failing cases."""
    if verdict.causes and verdict.tightest is not None:
        part = verdict.tightest.bound.label
        causes = ", ".join(
            f"{cause.input} ({100.0 * cause.share:.3g} %)" for cause in verdict.causes
        )
        if verdict.met is False:
            yield note("causes-of-failure", part=part, causes=causes)
        else:
            yield note("main-causes", part=part, causes=causes)


def shortfalls(plan: Plan, *, tabulated: bool) -> Iterator[Note]:
    """Bounds that the end of a plan breaks; ``tabulated``: but those required."""
    left = plan._left
    assert left is not None
    for bound in plan._shortfalls:
        if bound.required and tabulated:
            continue
        if bound.part is Part.SPIN:
            goal = plan.spacecraft.goal.spin or 0.0
            yield note(
                "spin-missed", scheme=plan.scheme, spin_rpm=RPM * left.spin, goal_rpm=RPM * goal
            )
            continue
        yield note(
            "requirement-missed" if bound.required else "not-damped",
            scheme=plan.scheme,
            left_deg=math.degrees(requirements.left_of(bound, left, plan.spacecraft)),
            part=bound.label,
            limit_deg=math.degrees(bound.limit),
        )


def obstacles(plan: Plan) -> Iterator[Note]:
    """Obstacles to less nutation, unless these are disturbances that the plan leaves out."""
    cause, least = remaining(plan), plan.spacecraft.least_impulse
    if cause.code == "remains-unplanned":
        return
    reached = [limit for limits in hindrances(plan) for limit in limits]
    short = plan.pulses.total_impulse < least and cause.code != "remains-max-pulses"
    if not (reached and short):
        yield cause.of(plan.scheme)
        return
    yield note(
        "pulses-at-limits",
        given_Nms=plan.pulses.total_impulse,
        needed_Nms=least,
        end_s=plan.pulses.end,
        horizon_s=plan.spacecraft.horizon,
        limits=", ".join(reached),
    )
