"""Plan several schemes, fly them, judge them against limits and requirement, recommend one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from nutdamp import flight, schemes
from nutdamp.errors import Infeasible
from nutdamp.flight import Flight, Residual
from nutdamp.physics import attitude
from nutdamp.rounding import cleaned_change
from nutdamp.schedule import Schedule
from nutdamp.schemes.model import steady_omega
from nutdamp.schemes.windows import SLACK
from nutdamp.spacecraft import Spacecraft, Vector

NO_NUTATION = 1e-12
"""Nutation angle in rad below which there is nothing to plan."""

AS_GOOD = math.radians(1e-3)
"""Flown nutation in rad below which plans count as equally good; likewise within twice the least."""

TELLING = math.radians(1e-6)
"""Nutation angle in rad from which what is left is worth a remark."""

LEGENDRE = ((-0.8611363115940526, 0.34785484513745385), (-0.33998104358485626, 0.6521451548625461))
"""Half of the four-point Gauss-Legendre rule on [-1, 1]: (node, weight); the other half is its mirror image."""


@dataclass(frozen=True, eq=False)
class Plan:
    """A scheme's schedule for a spacecraft, and how it was judged; without one, ``why``."""

    spacecraft: Spacecraft
    scheme: str
    schedule: Schedule | None
    why: str | None = None
    options: schemes.Options = field(default_factory=schemes.Options)

    @property
    def feasible(self) -> bool:
        """Whether the schedule keeps every limit and lowers the nutation."""
        return self.schedule is not None

    @property
    def pulses(self) -> Schedule:
        """The schedule; empty where the plan is infeasible."""
        return Schedule() if self.schedule is None else self.schedule

    @cached_property
    def residual(self) -> Residual | None:
        """What remains by the impulse sum (17)."""
        return None if self.schedule is None else flight.by_impulses(self.spacecraft, self.schedule).residual

    @cached_property
    def flight(self) -> Flight:
        """The schedule flown through its real pulse widths; free motion where the plan is infeasible."""
        return flight.flown(self.spacecraft, self.pulses)

    @property
    def flown(self) -> Residual | None:
        """What remains when the real pulse widths are flown."""
        return self.flight.residual if self.feasible else None

    @property
    def meets_requirement(self) -> bool | None:
        """Whether the flown residual keeps the requirement of the file; None without one or without a schedule.

        With a target axis the shift of H counts from there.
        """
        asked, left = self.spacecraft.requirement, self.flown
        if asked is None or left is None or (asked.nutation is None and asked.momentum_shift is None):
            return None
        return (asked.nutation is None or left.nutation <= asked.nutation) and (
            asked.momentum_shift is None or left.axis_error <= asked.momentum_shift
        )

    @property
    def spin_change(self) -> float | None:
        """ω3 at the end minus at the start, rad/s, flown."""
        before, after = self.spacecraft.spin, self.flight.settled.spin
        return cleaned_change(after - before, before) if self.feasible else None

    @cached_property
    def delta_v(self) -> Vector | None:
        """Velocity change in the inertial frame, (3,) m/s; None without mass or where a force is not known."""
        mass = self.spacecraft.mass
        if not self.feasible or mass is None or any(pulse.force is None for pulse in self.pulses):
            return None
        return _momentum_gained(self.flight) / mass

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """What a reader should know: remarks of the scheme, why nutation is left, what I1 ≠ I2 does."""
        if self.flown is None or not len(self.pulses):
            return self.pulses.notes
        return (*self.pulses.notes, *self._proof(), *self._remainder(), *self._asymmetry())

    def _proof(self) -> tuple[str, ...]:
        """How much cheaper another schedule could be."""
        bounds = self.pulses.bounds
        if bounds is None:
            return ()
        spent = self.pulses.propellant if bounds.unit == "kg" else self.pulses.total_impulse
        scale, unit = (1e3, "g") if bounds.unit == "kg" else (1.0, "N m s")
        if spent is None:
            return ()
        gap = 100.0 * (spent / bounds.first_order - 1.0)
        beside = f"gap {max(gap, 0.0):.2g} %" if gap > -1e-6 else f"{-gap:.2g} % more: that holds for small angles"
        proof = (
            ""
            if bounds.rigorous is None
            else f"; no schedule of the channels that leaves as little takes less than "
            f"{_down(scale * bounds.rigorous):.4g} {unit}"
        )
        return (
            f"{scale * spent:.4g} {unit}; first-order least within {bounds.within:.4g} s "
            f"{scale * bounds.first_order:.4g} {unit} ({beside}){proof}",
        )

    def _remainder(self) -> tuple[str, ...]:
        """Why nutation is left."""
        body, left = self.spacecraft, self.flight.residual.nutation
        if left < TELLING or self.options.coarse or self.options.literal:
            return ()
        limits = body.limits
        if body.disturbances and not self.options.with_disturbances:
            reason = "the plan does not know of the disturbances (--with-disturbances)"
        elif body.disturbances:
            steady = body.inertia.A * abs(steady_omega(body, self.pulses.end)) / (body.inertia.C * abs(body.spin))
            reason = f"{math.degrees(math.atan(steady)):.3g}° is the steady tilt under the disturbances"
        elif len(self.pulses) == limits.max_pulses:
            reason = f"limits.max_pulses = {limits.max_pulses} ends it"
        elif limits.tick is not None and left < 0.1 * body.nutation:
            reason = "the resolution of commands (limits.tick) or the shortest pulse leaves it"
        else:
            reason = "on-times, horizon or blackout windows allow no more"
        return (f"{_degrees(left)} of nutation remain: {reason}",)

    def _asymmetry(self) -> tuple[str, ...]:
        """What the same pulses would leave if I1 and I2 were their mean."""
        inertia = self.spacecraft.inertia
        if inertia.symmetric:
            return ()
        first, second, third = inertia.moments
        mean = replace(self.spacecraft, inertia=replace(inertia, moments=(inertia.A, inertia.A, third)))
        without = flight.flown(mean, self.pulses).residual.nutation
        left = self.flight.residual.nutation
        return (
            f"I1 ≠ I2 by {100 * abs(first - second) / inertia.A:.3g} % accounts for "
            f"{_degrees(abs(left - without))}: these pulses leave {_degrees(left)} of nutation, "
            f"and would leave {_degrees(without)} if both were their mean",
        )


def _down(value: float) -> float:
    """The largest number of four digits that is not above ``value``: a bound must not be rounded up."""
    if value <= 0.0 or not math.isfinite(value):
        return value
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return math.floor(value / step * (1.0 + 1e-12)) * step


def _degrees(angle: float) -> str:
    """An angle given in rad, as remarks tell it; what is below 1e-9 deg is rounding."""
    return f"{math.degrees(angle):.3g}°" if math.degrees(angle) >= 1e-9 else "less than 1e-9°"


def _momentum_gained(flown: Flight) -> Vector:
    """∫ R(t) F dt over all pulses, (3,) N s, by Gauss-Legendre over stretches of at most half a radian."""
    gained = np.zeros(3)
    for leg in flown.legs:
        firing = [p.force for p in flown.schedule if p.force is not None and p.start <= leg.start and leg.end <= p.end]
        force = np.asarray(sum(firing, np.zeros(3)))
        if leg.end == leg.start or not force.any():
            continue
        ends = leg.path.motion(np.array([leg.start, leg.end]))[0]
        turned = float(np.linalg.norm(ends, axis=1).max()) * (leg.end - leg.start)
        edges = np.linspace(leg.start, leg.end, math.ceil(turned / 0.5) + 1)
        middles, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * (edges[1] - edges[0])
        for node, weight in (*LEGENDRE, *((-node, weight) for node, weight in LEGENDRE)):
            _, quaternions = leg.path.motion(middles + node * half)
            gained += weight * half * attitude.rotate(quaternions, force).sum(axis=0)
    return gained


def plan(spacecraft: Spacecraft, scheme: str, options: schemes.Options | None = None) -> Plan:
    """Plan one scheme and judge it; an infeasible plan says why.

    Raises KeyError for a name not in `schemes.NAMES`.
    """
    if spacecraft.nutation < NO_NUTATION and spacecraft.to_turn < NO_NUTATION and spacecraft.goal.spin is None:
        return Plan(spacecraft, scheme, Schedule(notes=("there is no nutation to damp",)))
    options = options or schemes.Options()
    try:
        return judged(spacecraft, scheme, schemes.schedule(scheme, known(spacecraft, options), options), options)
    except Infeasible as reason:
        return Plan(spacecraft, scheme, None, str(reason))


def alternatives(spacecraft: Spacecraft, scheme: str, options: schemes.Options | None = None) -> tuple[Plan, ...]:
    """Feasible plans by schedules that the scheme weighs against the one that `plan` gives; it may be among them.

    Raises KeyError for a name not in `schemes.NAMES`.
    """
    options = options or schemes.Options()
    try:
        made = schemes.alternatives(scheme, known(spacecraft, options), options)
        plans = [judged(spacecraft, scheme, schedule, options) for schedule in made]
    except Infeasible:
        return ()
    return tuple(one for one in plans if one.feasible)


def known(spacecraft: Spacecraft, options: schemes.Options) -> Spacecraft:
    """The spacecraft as the schemes are to know it: with its disturbances only where they are asked for."""
    return spacecraft if options.with_disturbances else replace(spacecraft, disturbances=())


def judged(spacecraft: Spacecraft, scheme: str, made: Schedule, options: schemes.Options) -> Plan:
    """The plan of a schedule: infeasible where it breaks a limit or does not help. Raises Infeasible on flat spin."""
    if spacecraft.disturbances:  # which the scheme need not have known
        made = made.without_proof
    flown = Plan(spacecraft, scheme, made, options=options)
    left = flown.flown
    broken = broken_limits(spacecraft, made)
    if broken:
        return Plan(spacecraft, scheme, None, f"the only schedule found breaks a limit: {broken[0]}")
    if scheme != "none" and left is not None and not _helps(flown, left):
        angle = math.degrees(left.nutation)
        return Plan(spacecraft, scheme, None, f"the best schedule found would leave {angle:.3g}° of nutation")
    return flown


def _helps(judged: Plan, left: Residual) -> bool:
    """Whether nutation, distance from the target axis or from the final spin asked for is less than without pulses."""
    body = judged.spacecraft
    if body.goal.spin is not None and abs(judged.flight.settled.spin - body.goal.spin) < abs(
        body.spin - body.goal.spin
    ):
        return True
    return left.nutation < body.nutation or left.axis_error < body.to_turn


def unrounded(plan_: Plan) -> Schedule | None:
    """The schedule as it would be with commands of any resolution; None where there is no tick, or no such schedule."""
    body = plan_.spacecraft
    if body.limits.tick is None:
        return None
    smooth = plan(replace(body, limits=replace(body.limits, tick=None)), plan_.scheme, plan_.options)
    return smooth.schedule


def broken_limits(spacecraft: Spacecraft, made: Schedule) -> list[str]:
    """What a schedule does that limits or on-times forbid, in words; empty where it keeps them all."""
    limits, horizon = spacecraft.limits, spacecraft.horizon
    channels = {channel.name: channel for channel in spacecraft.channels}
    broken: list[str] = []
    previous_end = -math.inf
    for number, pulse in enumerate(made, start=1):
        name = f"pulse {number} ({pulse.channel}, {pulse.start:.6g} s to {pulse.end:.6g} s)"
        if pulse.start < min(limits.earliest, 0.0) - SLACK or pulse.start < limits.earliest - SLACK:
            broken.append(f"{name} starts before {limits.earliest:.6g} s")
        if pulse.end > horizon + SLACK:
            broken.append(f"{name} ends after the horizon of {horizon:.6g} s")
        if pulse.start < previous_end + limits.gap - SLACK:
            broken.append(f"{name} comes less than {limits.gap:.6g} s after the one before")
        for begins, ends in limits.blackout:
            if pulse.start < ends - SLACK and pulse.end > begins + SLACK:
                broken.append(f"{name} lies in the blackout window {begins:.6g} s to {ends:.6g} s")
        channel = channels.get(pulse.channel)
        if channel is not None and not (channel.min_on_time - SLACK <= pulse.on_time <= channel.max_on_time + SLACK):
            broken.append(f"{name} is on for {pulse.on_time:.6g} s, outside what the channel allows")
        if limits.tick is not None:
            for value, what in ((pulse.start, "starts"), (pulse.on_time, "is on for a time")):
                if abs(value - round(value / limits.tick) * limits.tick) > SLACK + 1e-6 * limits.tick:
                    broken.append(f"{name} {what} off the ticks of {limits.tick:.6g} s")
        previous_end = max(previous_end, pulse.end)
    if limits.max_pulses is not None and len(made) > limits.max_pulses:
        broken.append(f"{len(made)} pulses are more than {limits.max_pulses}")
    return broken


@dataclass(frozen=True, eq=False)
class Comparison:
    """Several plans for one spacecraft, the recommended one and the reason for it."""

    spacecraft: Spacecraft
    plans: tuple[Plan, ...]
    recommended: Plan | None
    reason: str


def usual(spacecraft: Spacecraft) -> tuple[str, ...]:
    """The schemes to compare where none is named: the classic ones, with a target those that can point."""
    return schemes.CLASSIC if spacecraft.goal.axis is None else schemes.POINTING


def compare(spacecraft: Spacecraft, names: Sequence[str], options: schemes.Options | None = None) -> Comparison:
    """Plan the schemes named and recommend one."""
    plans = tuple(plan(spacecraft, name, options) for name in names)
    recommended, reason = recommend(plans)
    return Comparison(spacecraft, plans, recommended, reason)


def recommend(plans: Sequence[Plan]) -> tuple[Plan | None, str]:
    """The plan to fly, and why.

    Of the plans that meet the requirement (all feasible ones without one), those within twice the least flown nutation
    or below 1e-3 deg; of these least propellant (impulse where unknown), then less shift of H, then earlier end. If
    none meets it, least flown nutation. With a target axis the distance from it counts where it exceeds the nutation.
    """
    judged = [(one, one.flown) for one in plans]
    feasible = [(one, left) for one, left in judged if left is not None]
    if not feasible:
        return None, "no scheme is feasible"
    least = min(missed(one, left) for one, left in feasible)
    asked = any(one.meets_requirement is not None for one, _ in feasible)
    meeting = [(one, left) for one, left in feasible if one.meets_requirement is not False]
    if not meeting:
        best = next(one for one, left in feasible if missed(one, left) == least)
        nearest = "leaves least nutation" if best.spacecraft.goal.axis is None else "comes nearest to the target"
        return best, f"no feasible plan meets the requirement; this one {nearest}"
    least = min(missed(one, left) for one, left in meeting)
    close = [(one, left) for one, left in meeting if missed(one, left) <= max(2.0 * least, AS_GOOD)]
    those = "meet the requirement" if asked else "are feasible"
    if len(meeting) == 1:
        return meeting[0][0], f"the only plan that {'meets the requirement' if asked else 'is feasible'}"
    if len(close) == 1:
        return close[0][0], f"leaves least nutation of the {len(meeting)} plans that {those}"
    known = all(one.pulses.propellant is not None for one, _ in close)

    def cost(one: Plan) -> float:
        propellant = one.pulses.propellant
        return propellant if known and propellant is not None else one.pulses.total_impulse

    cheapest = min(cost(one) for one, _ in close)
    equal = [(one, left) for one, left in close if cost(one) <= cheapest * (1.0 + 1e-6)]
    what = "propellant" if known else "impulse"
    if len(equal) == 1:
        even = all(missed(one, left) <= AS_GOOD for one, left in close)
        leave = "leave least nutation" if even else "leave at most twice the least nutation"
        return equal[0][0], f"least {what} of the {len(close)} plans that {those} and {leave}"
    least_shift = min(left.axis_error for _, left in equal)
    still = [one for one, left in equal if left.axis_error <= least_shift + 1e-9]
    best = min(still, key=lambda one: one.pulses.end)
    if len(still) == 1:
        return best, f"as little {what} as any, and less shift of H"
    return best, f"as little {what} and shift of H as any, and ends first"


def missed(judged: Plan, left: Residual) -> float:
    """What a plan leaves, rad: nutation, or the distance from a target axis where that is more."""
    return left.nutation if judged.spacecraft.goal.axis is None else max(left.nutation, left.axis_error)
