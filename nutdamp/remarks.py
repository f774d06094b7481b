"""What a reader should know of a plan, in sentences: what its scheme says, its bounds, why nutation is left, I1 ≠ I2.

Also why there is no schedule, and which limits a schedule breaks. The plan gives the data; what is said of several
plans together is in `nutdamp.presentation.verdicts`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from nutdamp import compliance
from nutdamp.aspect import Aspect
from nutdamp.compliance import NEGLIGIBLE
from nutdamp.hindrance import Hindrance, Obstacle
from nutdamp.limits import Breach, Limit, breaches
from nutdamp.planning import Plan
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Spacecraft

TELLING = math.radians(1e-6)
"""Nutation angle in rad from which what is left is worth a remark."""


CUT = "the search ended at its limit of work"


def remarks(plan: Plan, *, cones: bool = True) -> tuple[str, ...]:
    """All of them, what the scheme says first; without ``cones`` where those that are broken are named elsewhere."""
    notes = plan.pulses.notes
    if plan.cut:
        notes = (*notes, f"{CUT}: this is the best schedule found so far")
    if plan.flown is None or not len(plan.pulses):
        return notes
    return (
        *notes,
        *_bounds(plan),
        *_remainder(plan),
        *_asymmetry(plan),
        *_given_length(plan),
        *(_cones(plan) if cones else ()),
    )


def _cones(plan: Plan) -> tuple[str, ...]:
    """Cones that a plan without a target does not keep: it is not its task to."""
    return tuple(f"warning: {strays(one)}" for one in plan.aspects if not one.kept)


def infeasibility(plan: Plan) -> str:
    """Why there is no schedule; empty where there is one."""
    why = _infeasibility(plan)
    return f"{why}; {CUT}" if why and plan.cut else why


def _infeasibility(plan: Plan) -> str:
    if plan.breach is not None:
        return f"the only schedule found breaks a limit: {_broken(plan.breach)}"
    if plan.astray is not None and math.isinf(plan.astray.least_at):
        return strays(plan.astray)
    if plan.astray is not None:
        return f"{strays(plan.astray)}; no way round it was found within the limits"
    if plan.worse is not None:
        return f"the best schedule found would leave {math.degrees(plan.worse):.3g}° of nutation{_by_itself(plan)}"
    return plan.refusal or ""


def _by_itself(plan: Plan) -> str:
    decayed = compliance.decayed(plan.spacecraft, plan.worse_at)
    if decayed >= plan.spacecraft.nutation:
        return ""
    return f" at {plan.worse_at:.4g} s; without a pulse it decays to {math.degrees(decayed):.3g}° by then"


def strays(found: Aspect) -> str:
    """How the spin axis breaks a cone."""
    keep = found.keep
    angle, at, bound = (
        (found.least, found.least_at, f"min = {math.degrees(keep.least):.6g}°")
        if found.too_near
        else (found.largest, found.largest_at, f"max = {math.degrees(keep.most):.6g}°")
    )
    seen = f"{math.degrees(angle) if angle > NEGLIGIBLE else 0.0:.4g}°"
    if math.isinf(at):
        return f"the target is {seen} from {keep.name} ({bound})"
    return f"the spin axis comes to {seen} from {keep.name} at {at:.4g} s ({bound})"


def said(plan: Plan) -> tuple[str, ...]:
    """Why there is no schedule, or the `remarks` on it."""
    return remarks(plan) if plan.feasible else (infeasibility(plan),)


def broken_limits(spacecraft: Spacecraft, made: Schedule) -> list[str]:
    """What a schedule does that limits or on-times forbid, a sentence each; empty where it keeps them all.

    Each limit is named once, with the first pulse that breaks it and the number of others that do.
    """
    found: dict[tuple[Limit, tuple[float, float] | None], list[Breach]] = {}
    for breach in breaches(spacecraft, made):
        found.setdefault((breach.limit, breach.window), []).append(breach)
    return [_broken(first) + _likewise(len(others)) for first, *others in found.values()]


def _likewise(others: int) -> str:
    return f"; likewise {others} more pulse{'s' * (others > 1)}" if others else ""


def _broken(breach: Breach) -> str:
    """The pulse that breaks a limit, and how."""
    pulse, bound, limit = breach.pulse, f"{breach.bound:.6g} s", breach.limit
    if limit is Limit.MAX_PULSES:
        return f"{breach.number} pulses are more than {breach.bound:.0f}"
    begins, ends = breach.window or (math.nan, math.nan)
    start, on_time = pulse.loaded
    on = f"is on for {on_time:.6g} s"
    early = f"comes less than {bound} after the one before" if breach.bound else "starts before the one before ends"
    how = {
        Limit.RESOLUTION: f"is too short for its time, where times are {breach.by:.2g} s apart",
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


def _bounds(plan: Plan) -> Iterator[str]:
    """How much cheaper another schedule could be."""
    bounds = plan.pulses.bounds
    if bounds is None or (bounds.unit == "kg" and plan.pulses.propellant is None):
        return
    spent = plan.pulses.cost_in(bounds.unit)
    scale, unit = (1e3, "g") if bounds.unit == "kg" else (1.0, "N m s")
    parts = [f"{scale * spent:.4g} {unit}"]
    # Where the nutation damps itself, waiting makes any cost small: the least of ideal pulses says nothing.
    if bounds.first_order is not None and bounds.first_order > 0.0 and plan.spacecraft.growth >= 0.0:
        gap = 100.0 * (spent / bounds.first_order - 1.0)
        rest = plan.flight.residual.nutation > TELLING
        holds = "that leaves no nutation" if rest else "that holds for small angles"
        beside = f"gap {max(gap, 0.0):.2g} %" if gap > -1e-6 else f"{-gap:.2g} % more: {holds}"
        parts.append(
            f"first-order least within {bounds.within:.4g} s {scale * bounds.first_order:.4g} {unit} ({beside})"
        )
    if bounds.rigorous is not None and bounds.rigorous > 0.0:
        least = f"{down(scale * bounds.rigorous):.4g} {unit}"
        parts.append(f"no schedule of the channels that leaves as little takes less than {least}")
    if bounds.keeping is not None:
        parts.append(f"keeping H would take {scale * bounds.keeping:.4g} {unit} by small angles")
    if len(parts) > 1:
        yield "; ".join(parts)


def _remainder(plan: Plan) -> Iterator[str]:
    """Why nutation is left."""
    left = plan.flight.residual.nutation
    if left < TELLING or plan.options.uncorrected:
        return
    why = obstacle(plan)
    if plan.spacecraft.goal.spin is not None and plan.meets_requirement:
        why = "the requirement allows it, where the spin is to change"
    yield f"{_degrees(left)} of nutation remain: {why}"


def obstacle(plan: Plan) -> str:
    """What keeps a plan from leaving less nutation, as a clause."""
    found = plan.hindrance
    return {
        Obstacle.UNPLANNED_DISTURBANCES: "the plan was made without the disturbances (--with-disturbances)",
        Obstacle.STEADY_TILT: f"the disturbances leave a steady tilt of {_degrees(found.steady_tilt)}",
        Obstacle.MAX_PULSES: f"limits.max_pulses = {plan.spacecraft.limits.max_pulses} allows no more pulses",
        Obstacle.RESOLUTION: f"rounding to limits.tick can leave up to {_degrees(found.rounding)}",
        Obstacle.LIMITS: f"{plan.scheme} {_limited(found)}",
        Obstacle.SCHEME: f"with these channels {plan.scheme} removes no more",
    }[found.obstacle]


def _limited(found: Hindrance) -> str:
    """By which limits a schedule is limited, and by which it may be."""
    certain = f"is limited by {' and '.join(found.binding)}" if found.binding else ""
    possible = f"may be limited by {' and '.join(found.suspected)}" if found.suspected else ""
    return ", and ".join(text for text in (certain, possible) if text)


def _asymmetry(plan: Plan) -> Iterator[str]:
    """What the same pulses would leave if I1 and I2 were their mean."""
    without, inertia = plan.left_if_symmetric, plan.spacecraft.inertia
    if without is None:
        return
    first, second, _ = inertia.moments
    left = plan.flight.residual.nutation
    yield (
        f"I1 ≠ I2 by {100 * abs(first - second) / inertia.A:.3g} % changes what these pulses leave by "
        f"{_degrees(abs(left - without))}: {_degrees(left)} of nutation, {_degrees(without)} if both were their mean"
    )


def _given_length(plan: Plan) -> Iterator[str]:
    """That equal pulses of a given length do not end exactly, where they were planned on a simpler motion."""
    options, body, left = plan.options, plan.spacecraft, plan.left
    simple = body.inertia.symmetric and not body.disturbances and body.growth == 0.0
    if left is None or simple or not options.equal or options.resizable or options.uncorrected:
        return
    off = float(compliance.missed(body, left.nutation, left.aim))
    if off >= TELLING:
        yield (
            f"the end is off by {_degrees(off)}, nutation or direction of H, whichever is more: the pulses are planned "
            "on the free motion of a symmetric body, and of a fixed length their starts alone cannot make up for all "
            "of the difference; without --on-time their length is corrected too"
        )


def down(value: float) -> float:
    """The largest number of four digits that is not above ``value``: a bound must not be rounded up."""
    if value <= 0.0 or not math.isfinite(value):
        return value
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return math.floor(value / step * (1.0 + 1e-12)) * step


def _degrees(angle: float) -> str:
    """An angle given in rad, as remarks show it; what is below 1e-9 deg is rounding."""
    return f"{math.degrees(angle):.3g}°" if math.degrees(angle) >= 1e-9 else "less than 1e-9°"
