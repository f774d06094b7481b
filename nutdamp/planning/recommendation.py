"""Ranking rules, limiting factors.

Which of several plans to fly: the rule, on what the plans leave when flown and on what they cost.

It gives data; `nutdamp.views.verdicts` has the words.

What keeps a schedule from leaving less nutation: disturbances, limits of the file, or the scheme itself.

It gives data; `nutdamp.planning.decision` and `nutdamp.views.verdicts` have the words.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Generic, Protocol, TypeVar

from nutdamp.flight.propagation import Residual
from nutdamp.schemes.sequential import steady_omega
from nutdamp.spacecraft.constraints import rounded_off
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import DAMPED_ANGLE, NEGLIGIBLE, SAME_COST, Part, missed, required
from nutdamp.spacecraft.schedule import Schedule

SAME_ANGLE = 1e-9
"""rad by which shifts of H may differ and be equal: the rounding of a flight."""

SAME_SPEED = 1e-5
"""m/s by which ΔV may differ and be equal."""

STEADIER_SHIFT = 0.2
"""Share of the recommended plan's shift of H below which another plan keeps H so much better..."""

STEADIER_COST = 1.1
"""... that it is worth a remark, if it costs at most so many times as much."""

FEWER_PULSES = 0.5
"""Share of the recommended plan's pulses up to which another one is so much simpler..."""

FEWER_COST = 1.05
"""... that it is worth a remark, if it costs at most so many times as much."""

SOONER_END = 0.5
"""Share of the recommended plan's end up to which another one, a nutation period earlier at least, is so much sooner...
"""

SOONER_COST = 1.05
"""... that it is worth a remark, if it costs at most so many times as much."""

REAL_COST = 1.1
"""So many times as much a plan may cost that fires real pulse widths beside one of ideal impulses, for a remark."""


class Standing(Enum):
    """What the recommended plan reaches, and so what it was chosen among; from the best down."""

    COMPLIES = "complies"
    """Meets the requirement, and damps what that does not bound."""
    MEETS = "meets"
    """Meets the requirement, but leaves more of what that does not bound than counts as damped."""
    MISSES = "misses"
    """Does not meet the requirement; without one: does not damp."""


@dataclass(frozen=True, slots=True)
class Share:
    """The share of all dispersed cases that comply with a plan: from ``low`` to ``high``, equal where all have flown.

    ``probability``: the share that must.
    """

    low: float
    high: float
    probability: float

    @property
    def exact(self) -> float | None:
        """The share; None where not all cases have flown."""
        return self.low if self.low == self.high else None

    @property
    def met(self) -> bool | None:
        """Whether as many comply as must; None where the cases flown do not decide it."""
        return True if self.low >= self.probability else False if self.high < self.probability else None


class Ground(Enum):
    """What decided among the plans of one standing."""

    ONLY = "only"
    CASES = "cases"
    """Most cases comply, where too few do with each plan."""
    LEFT = "left"
    NEAREST = "nearest"
    COST = "cost"
    NOMINAL = "nominal"
    PULSES = "pulses"
    DELTA_V = "delta-v"
    SHIFT = "shift"
    END = "end"


class Gain(Enum):
    """In what another plan is much better than the recommended one."""

    STEADIER = "steadier"
    """It keeps H."""
    SIMPLER = "simpler"
    """It takes far fewer pulses."""
    SOONER = "sooner"
    """It ends far sooner."""
    REAL = "real"
    """It fires real pulse widths, where the recommended one fires ideal impulses."""
    COMMANDED = "commanded"
    """It can be sent as command blocks, where the recommended one is fired pulse by pulse."""


class Judged(Hashable, Protocol):
    """A plan with what the rule goes by."""

    @property
    def spacecraft(self) -> Spacecraft:
        """What it was planned for."""
        ...

    @property
    def pulses(self) -> Schedule:
        """Its schedule."""
        ...

    @property
    def flown(self) -> Residual | None:
        """What it leaves, flown; None where it is infeasible."""
        ...

    @property
    def standing(self) -> Standing:
        """What it reaches."""
        ...

    @property
    def kept(self) -> bool | None:
        """Whether the spin axis keeps its cones; None where there are none."""
        ...

    @property
    def delta_v(self) -> Vector | None:
        """Velocity change, (3,) m/s; None where it is not known."""
        ...

    @property
    def severity(self) -> float:
        """See `nutdamp.spacecraft.requirements.severity`."""
        ...


Plan = TypeVar("Plan", bound=Judged)


@dataclass(frozen=True, eq=False)
class Recommendation(Generic[Plan]):
    """The plan to fly; None, as ``standing`` and ``ground``, where none is feasible.

    It was chosen among ``count`` plans of its ``standing``, by propellant or, not ``by_propellant``, by impulse.
    ``alternatives``: the cheapest plan that gains so much.
    """

    plan: Plan | None = None
    standing: Standing | None = None
    ground: Ground | None = None
    count: int = 0
    by_propellant: bool = True
    alternatives: Mapping[Gain, Plan] = field(default_factory=dict)


def recommend(plans: Sequence[Plan], shares: Mapping[Plan, Share] | None = None) -> Recommendation[Plan]:
    """The plan to fly.

    Of the plans that meet the requirement, and damp where it bounds nothing, the cheapest, see `cheapest`. Where there
    is none, that with least nutation left (least distance from a target axis where that is more). Where plans that
    reach as much differ in whether the spin axis keeps its cones, those that do count alone. With ``shares`` a plan
    meets the requirement in enough dispersed cases or not at all; where none does, it is that with which most comply.
    """
    feasible = [one for one in plans if one.flown is not None]
    if not feasible:
        return Recommendation()
    reached = {one: one.standing if not shares or shares[one].met else Standing.MISSES for one in feasible}
    standing = next(one for one in Standing if one in reached.values())
    those = [one for one in feasible if reached[one] is standing]
    those = [one for one in those if one.kept is not False] or those
    if standing is Standing.COMPLIES:
        best, ground = cheapest(those)
        return Recommendation(best, standing, ground, len(those), by_propellant(those), _alternatives(best, those))
    most = max(shares[one].low for one in those) if shares else 0.0
    if shares and standing is Standing.MISSES and most > 0.0 and len(those) > 1:
        best, _ = cheapest([one for one in those if shares[one].low >= most])
        return Recommendation(best, standing, Ground.CASES, len(those), by_propellant(those))
    best, ground = _nearest(those)
    return Recommendation(best, standing, ground, len(those), by_propellant(those))


def cheapest(plans: Sequence[Plan], usual: Plan | None = None) -> tuple[Plan, Ground]:
    """The plan of least propellant (impulse where one is not known), and what decided.

    Costs within `SAME_COST` are equal: then the ``usual`` one, if it is among them, else that with fewer pulses, less
    ΔV, less shift of H (distance from the target axis), the earlier end; the first of these that leaves one decides.
    """
    if len(plans) == 1:
        return plans[0], Ground.ONLY
    known = by_propellant(plans)
    least = min(_cost(one, known) for one in plans)
    equal = [one for one in plans if _cost(one, known) <= least * (1.0 + SAME_COST)]
    if len(equal) == 1:
        return equal[0], Ground.COST
    if usual is not None and any(one is usual for one in equal):
        return usual, Ground.NOMINAL
    for ground, measure, same in (
        (Ground.PULSES, lambda one: float(len(one.pulses)), 0.0),
        (Ground.DELTA_V, _speed, SAME_SPEED),
        (Ground.SHIFT, _off, SAME_ANGLE),
    ):
        values = [value for one in equal if (value := measure(one)) is not None]
        if len(values) < len(equal):  # not known of all
            continue
        least = min(values) + same
        equal = [one for one, value in zip(equal, values, strict=True) if value <= least]
        if len(equal) == 1:
            return equal[0], ground
    return min(equal, key=lambda one: one.pulses.end), Ground.END


def _nearest(plans: Sequence[Plan]) -> tuple[Plan, Ground]:
    """The plan that leaves least, and what decided; of those that leave as little the nearest to the requirement.

    Angles within `DAMPED_ANGLE` are as little; of those as near, but for 0.1 % or rounding, the one by `cheapest`.
    """
    if len(plans) == 1:
        return plans[0], Ground.ONLY
    least = min(map(_missed, plans))
    as_little = [one for one in plans if _missed(one) <= least + DAMPED_ANGLE]
    if len(as_little) == 1:
        return as_little[0], Ground.LEFT
    body = as_little[0].spacecraft
    least = min(one.severity for one in as_little)
    rounding = NEGLIGIBLE / min((bound.most for bound in required(body) if bound.part is not Part.SPIN), default=1.0)
    near = [one for one in as_little if one.severity <= least * (1.0 + SAME_COST) + rounding]
    return (near[0], Ground.NEAREST) if len(near) == 1 else cheapest(near)


def _alternatives(best: Plan, plans: Sequence[Plan]) -> dict[Gain, Plan]:
    """The cheapest of the ``plans`` that gains so much on the ``best``, by what it gains.

    For little more; one of command blocks for whatever it costs, since the spacecraft may fire nothing else.
    """
    known, body = by_propellant(plans), best.spacecraft
    few, soon = FEWER_PULSES * len(best.pulses), SOONER_END * best.pulses.end
    found: dict[Gain, Plan] = {}
    for gain, times, gains in (
        (Gain.STEADIER, STEADIER_COST, lambda one: _off(one) < STEADIER_SHIFT * _off(best)),
        (Gain.SIMPLER, FEWER_COST, lambda one: len(one.pulses) <= few),
        (Gain.SOONER, SOONER_COST, lambda one: one.pulses.end <= min(soon, best.pulses.end - body.inertial_period)),
        (Gain.REAL, REAL_COST, lambda one: not one.pulses.idealised),
        (Gain.COMMANDED, math.inf, lambda one: bool(one.pulses.blocks)),
    ):
        if gain is Gain.STEADIER and (body.goal.axis is not None or _off(best) <= DAMPED_ANGLE):
            continue
        if (gain is Gain.REAL and not best.pulses.idealised) or (gain is Gain.COMMANDED and best.pulses.blocks):
            continue
        most = times * _cost(best, known)
        those = [one for one in plans if len(one.pulses) and gains(one) and _cost(one, known) <= most]
        if those:
            found[gain] = min(those, key=lambda one: _cost(one, known))
    return found


def by_propellant(plans: Sequence[Plan]) -> bool:
    """Whether the plans are compared by propellant: it is known for all of them; else by impulse."""
    return all(one.pulses.propellant is not None for one in plans)


def _cost(plan: Judged, known: bool) -> float:
    """Propellant in kg where it is ``known`` for all plans compared, else impulse in N m s."""
    return plan.pulses.cost_in("kg" if known else "N m s")


def _speed(plan: Judged) -> float | None:
    """|ΔV| in m/s; None where it is not known."""
    return None if plan.delta_v is None else math.hypot(*plan.delta_v.tolist())


def _off(plan: Judged) -> float:
    assert plan.flown is not None
    return plan.flown.axis_error


def _missed(plan: Judged) -> float:
    assert plan.flown is not None
    return float(missed(plan.spacecraft, plan.flown.nutation, plan.flown.axis_error))


WORST = math.hypot(1.0, 1.5)
"""What ticks leave at worst, over what chance leaves: the centre is off by half the on-time's error and the start's."""


class Obstacle(Enum):
    """What keeps a plan from leaving less nutation."""

    UNPLANNED_DISTURBANCES = "disturbances that the plan was made without"
    STEADY_TILT = "disturbances, under which a tilt stays"
    MAX_PULSES = "limits.max_pulses"
    RESOLUTION = "limits.tick"
    LIMITS = "limits of the file that bind"
    SCHEME = "the scheme"


@dataclass(frozen=True, eq=False)
class Hindrance:
    """What hinders ``pulses``, which leave ``nutation`` rad; ``aware``: planned with the disturbances."""

    spacecraft: Spacecraft
    pulses: Schedule
    aware: bool
    nutation: float

    @property
    def obstacle(self) -> Obstacle:
        """What counts most."""
        body, limits = self.spacecraft, self.spacecraft.limits
        if self.full and self.to_the_end:
            return Obstacle.LIMITS
        if body.disturbances:
            return Obstacle.STEADY_TILT if self.aware else Obstacle.UNPLANNED_DISTURBANCES
        if self.nutation <= self.rounding:
            return Obstacle.RESOLUTION
        if len(self.pulses) == limits.max_pulses:
            return Obstacle.MAX_PULSES
        return Obstacle.LIMITS if self.binding or self.suspected else Obstacle.SCHEME

    @property
    def binding(self) -> tuple[str, ...]:
        """Keys of the file that name the limits which the schedule itself shows to end it."""
        found = {"max_on_time": self.full, "limits.horizon": self.to_the_end}
        if not any(found.values()):
            found["min_on_time"] = self.shortest
        return tuple(key for key in found if found[key])

    @property
    def suspected(self) -> tuple[str, ...]:
        """Keys of those that the file gives and that may end it: to know it takes a plan without them."""
        limits = self.spacecraft.limits
        ticks = limits.tick is not None and not self.full and not self.to_the_end
        found = {"limits.tick": ticks, "limits.blackout": bool(limits.blackout)}
        return tuple(key for key in found if found[key])

    @property
    def full(self) -> bool:
        """Whether every pulse is as long as its channel may be on; never where nothing says how long that is."""
        longest = {channel.name: channel.max_on_time for channel in self.spacecraft.channels}
        most = [longest.get(pulse.channel, math.inf) for pulse in self.pulses]
        return bool(most) and all(
            one.loaded[1] >= long * (1.0 - 1e-9) for one, long in zip(self.pulses, most, strict=True)
        )

    @property
    def shortest(self) -> bool:
        """Whether a pulse is no longer than its channel has to be on."""
        least = {channel.name: channel.min_on_time for channel in self.spacecraft.channels}
        return any(0.0 < one.loaded[1] <= least.get(one.channel, 0.0) * (1.0 + 1e-9) for one in self.pulses)

    @property
    def to_the_end(self) -> bool:
        """Whether less than one nutation period is left of the horizon after the last pulse."""
        body = self.spacecraft
        return body.horizon - self.pulses.end < body.nutation_period

    @property
    def rounding(self) -> float:
        """The most, rad, that starts and on-times half a tick off leave, to first order; 0 without ticks."""
        return WORST * math.fsum(rounded_off(self.spacecraft, self.pulses))

    @property
    def steady_tilt(self) -> float:
        """Angle in rad at which the disturbances hold the body once the pulses are over."""
        inertia, spin = self.spacecraft.inertia, self.spacecraft.spin
        return math.atan(inertia.A * abs(steady_omega(self.spacecraft, self.pulses.end)) / (inertia.C * abs(spin)))
