"""Recommendation among plans, by flown residuals and cost, and factors that limit a schedule.

It gives data; `nutdamp.planning.decision` and `nutdamp.views.decisions` have the words.
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
"""Share of the recommended plan's momentum shift below which another plan keeps H so much better..."""

STEADIER_COST = 1.1
"""Largest cost ratio at which that is worth a note."""

FEWER_PULSES = 0.5
"""Share of the recommended plan's pulses up to which another one is so much simpler..."""

FEWER_COST = 1.05
"""Largest cost ratio at which that is worth a note."""

SOONER_END = 0.5
"""Share of the recommended plan's end up to which another one, a nutation period earlier at least, is so much sooner...
"""

SOONER_COST = 1.05
"""Largest cost ratio at which that is worth a note."""

REAL_COST = 1.1
"""Largest cost ratio of a plan with real widths beside one of ideal impulses that is worth a note."""


class Standing(Enum):
    """Standing of the recommended plan, and of those it was chosen among; from the best down."""

    COMPLIES = "complies"
    """Meets the requirement, and damps the parts that it does not bound."""
    MEETS = "meets"
    """Meets the requirement, but leaves other parts undamped."""
    MISSES = "misses"
    """Does not meet the requirement; without one: does not damp."""


@dataclass(frozen=True, slots=True)
class Share:
    """Share of all dispersed cases that comply with a plan: from ``low`` to ``high``, equal where all have flown.

    ``probability``: the share that must.
    """

    low: float
    high: float
    probability: float

    @property
    def exact(self) -> float | None:
        """Share; None where not all cases have flown."""
        return self.low if self.low == self.high else None

    @property
    def met(self) -> bool | None:
        """Compliance in enough cases; None where the flown ones do not decide it."""
        return True if self.low >= self.probability else False if self.high < self.probability else None


class Ground(Enum):
    """Deciding ground among the plans of one standing."""

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
    """Advantage of another plan over the recommended one."""

    STEADIER = "steadier"
    """Keeps H."""
    SIMPLER = "simpler"
    """Far fewer pulses."""
    SOONER = "sooner"
    """Ends far sooner."""
    REAL = "real"
    """Real pulse widths, where the recommended one fires ideal impulses."""
    COMMANDED = "commanded"
    """Command blocks, where the recommended one is fired pulse by pulse."""


class Judged(Hashable, Protocol):
    """Interface of a plan for the ranking."""

    @property
    def spacecraft(self) -> Spacecraft:
        """Spacecraft of the plan."""
        ...

    @property
    def pulses(self) -> Schedule:
        """Schedule."""
        ...

    @property
    def flown(self) -> Residual | None:
        """Flown residual; None where it is infeasible."""
        ...

    @property
    def standing(self) -> Standing:
        """Standing."""
        ...

    @property
    def kept(self) -> bool | None:
        """True if the spin axis keeps its cones; None where there are none."""
        ...

    @property
    def delta_v(self) -> Vector | None:
        """Velocity change, (3,) m/s; None where unknown."""
        ...

    @property
    def severity(self) -> float:
        """See `nutdamp.spacecraft.requirements.severity`."""
        ...


Plan = TypeVar("Plan", bound=Judged)


@dataclass(frozen=True, eq=False)
class Recommendation(Generic[Plan]):
    """Recommended plan; None, as ``standing`` and ``ground``, where none is feasible.

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
    """Recommendation among plans.

    Of the plans that meet the requirement, and damp where it bounds nothing, the cheapest, see `cheapest`. Where there
    is none, that with least nutation left (least distance from a target axis where that is more). Where plans that
    reach as much differ in whether the spin axis keeps its cones, those that do count alone. With ``shares`` a plan
    meets the requirement in enough dispersed cases or not at all; where none does, it is that with which most comply.
    """
    feasible = [plan for plan in plans if plan.flown is not None]
    if not feasible:
        return Recommendation()
    reached = {plan: plan.standing if not shares or shares[plan].met else Standing.MISSES for plan in feasible}
    standing = next(standing for standing in Standing if standing in reached.values())
    those = [plan for plan in feasible if reached[plan] is standing]
    those = [plan for plan in those if plan.kept is not False] or those
    if standing is Standing.COMPLIES:
        best, ground = cheapest(those)
        return Recommendation(best, standing, ground, len(those), by_propellant(those), _alternatives(best, those))
    most = max(shares[plan].low for plan in those) if shares else 0.0
    if shares and standing is Standing.MISSES and most > 0.0 and len(those) > 1:
        best, _ = cheapest([plan for plan in those if shares[plan].low >= most])
        return Recommendation(best, standing, Ground.CASES, len(those), by_propellant(those))
    best, ground = _nearest(those)
    return Recommendation(best, standing, ground, len(those), by_propellant(those))


def cheapest(plans: Sequence[Plan], usual: Plan | None = None) -> tuple[Plan, Ground]:
    """Plan of least propellant (impulse where one is unknown), and the deciding ground.

    Costs within `SAME_COST` are equal: then the ``usual`` one, if it is among them, else that with fewer pulses, less
    ΔV, less momentum shift (distance from the target axis), the earlier end; the first of these that leaves one
    decides.
    """
    if len(plans) == 1:
        return plans[0], Ground.ONLY
    known = by_propellant(plans)
    least = min(_cost(plan, known) for plan in plans)
    equal = [plan for plan in plans if _cost(plan, known) <= least * (1.0 + SAME_COST)]
    if len(equal) == 1:
        return equal[0], Ground.COST
    if usual is not None and any(plan is usual for plan in equal):
        return usual, Ground.NOMINAL
    for ground, measure, same in (
        (Ground.PULSES, lambda plan: float(len(plan.pulses)), 0.0),
        (Ground.DELTA_V, _speed, SAME_SPEED),
        (Ground.SHIFT, _off, SAME_ANGLE),
    ):
        values = [value for plan in equal if (value := measure(plan)) is not None]
        if len(values) < len(equal):  # not known of all
            continue
        least = min(values) + same
        equal = [plan for plan, value in zip(equal, values, strict=True) if value <= least]
        if len(equal) == 1:
            return equal[0], ground
    return min(equal, key=lambda plan: plan.pulses.end), Ground.END


def _nearest(plans: Sequence[Plan]) -> tuple[Plan, Ground]:
    """Plan of least residual, and the deciding ground; of equal ones the nearest to the requirement.

    Angles within `DAMPED_ANGLE` are as little; of those as near, but for 0.1 % or rounding, the one by `cheapest`.
    """
    if len(plans) == 1:
        return plans[0], Ground.ONLY
    least = min(map(_missed, plans))
    as_little = [plan for plan in plans if _missed(plan) <= least + DAMPED_ANGLE]
    if len(as_little) == 1:
        return as_little[0], Ground.LEFT
    body = as_little[0].spacecraft
    least = min(plan.severity for plan in as_little)
    rounding = NEGLIGIBLE / min((bound.most for bound in required(body) if bound.part is not Part.SPIN), default=1.0)
    near = [plan for plan in as_little if plan.severity <= least * (1.0 + SAME_COST) + rounding]
    return (near[0], Ground.NEAREST) if len(near) == 1 else cheapest(near)


def _alternatives(best: Plan, plans: Sequence[Plan]) -> dict[Gain, Plan]:
    """Cheapest of the ``plans`` with each sufficient gain on the ``best``, by gain.

    For little more; one of command blocks for whatever it costs, since the spacecraft may fire nothing else.
    """
    known, body = by_propellant(plans), best.spacecraft
    few, soon = FEWER_PULSES * len(best.pulses), SOONER_END * best.pulses.end
    gains_of: dict[Gain, Plan] = {}
    for gain, times, gains in (
        (Gain.STEADIER, STEADIER_COST, lambda plan: _off(plan) < STEADIER_SHIFT * _off(best)),
        (Gain.SIMPLER, FEWER_COST, lambda plan: len(plan.pulses) <= few),
        (Gain.SOONER, SOONER_COST, lambda plan: plan.pulses.end <= min(soon, best.pulses.end - body.inertial_period)),
        (Gain.REAL, REAL_COST, lambda plan: not plan.pulses.idealised),
        (Gain.COMMANDED, math.inf, lambda plan: bool(plan.pulses.blocks)),
    ):
        if gain is Gain.STEADIER and (body.goal.axis is not None or _off(best) <= DAMPED_ANGLE):
            continue
        if (gain is Gain.REAL and not best.pulses.idealised) or (gain is Gain.COMMANDED and best.pulses.blocks):
            continue
        most = times * _cost(best, known)
        those = [plan for plan in plans if len(plan.pulses) and gains(plan) and _cost(plan, known) <= most]
        if those:
            gains_of[gain] = min(those, key=lambda plan: _cost(plan, known))
    return gains_of


def by_propellant(plans: Sequence[Plan]) -> bool:
    """True if propellant is known for all plans, which are compared by it; else by impulse."""
    return all(plan.pulses.propellant is not None for plan in plans)


def _cost(plan: Judged, known: bool) -> float:
    """Propellant in kg where it is ``known`` for all plans compared, else impulse in N m s."""
    return plan.pulses.cost_in("kg" if known else "N m s")


def _speed(plan: Judged) -> float | None:
    """|ΔV| in m/s; None where unknown."""
    return None if plan.delta_v is None else math.hypot(*plan.delta_v.tolist())


def _off(plan: Judged) -> float:
    assert plan.flown is not None
    return plan.flown.axis_error


def _missed(plan: Judged) -> float:
    assert plan.flown is not None
    return float(missed(plan.spacecraft, plan.flown.nutation, plan.flown.axis_error))


WORST = math.hypot(1.0, 1.5)
"""Worst over root-mean-square effect of ticks: the centre is off by half the on-time's error and the start's."""


class Obstacle(Enum):
    """Obstacle to less nutation."""

    UNPLANNED_DISTURBANCES = "disturbances that the plan was made without"
    STEADY_TILT = "disturbances, under which a tilt stays"
    MAX_PULSES = "limits.max_pulses"
    RESOLUTION = "limits.tick"
    LIMITS = "limits of the file that bind"
    SCHEME = "the scheme"


@dataclass(frozen=True, eq=False)
class Hindrance:
    """Limiting factors of ``pulses``, which leave ``nutation`` rad; ``aware``: planned with the disturbances."""

    spacecraft: Spacecraft
    pulses: Schedule
    aware: bool
    nutation: float

    @property
    def obstacle(self) -> Obstacle:
        """Dominant obstacle."""
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
        """Keys of the file for the limits that certainly end the schedule."""
        ends = {"max_on_time": self.full, "limits.horizon": self.to_the_end}
        if not any(ends.values()):
            ends["min_on_time"] = self.shortest
        return tuple(key for key in ends if ends[key])

    @property
    def suspected(self) -> tuple[str, ...]:
        """Keys of the file for limits that may end it: certainty takes a plan without them."""
        limits = self.spacecraft.limits
        ticks = limits.tick is not None and not self.full and not self.to_the_end
        suspects = {"limits.tick": ticks, "limits.blackout": bool(limits.blackout)}
        return tuple(key for key in suspects if suspects[key])

    @property
    def full(self) -> bool:
        """True if every pulse is as long as its channel may be on; False without such a limit."""
        longest = {channel.name: channel.max_on_time for channel in self.spacecraft.channels}
        most = [longest.get(pulse.channel, math.inf) for pulse in self.pulses]
        return bool(most) and all(
            pulse.loaded[1] >= long * (1.0 - 1e-9) for pulse, long in zip(self.pulses, most, strict=True)
        )

    @property
    def shortest(self) -> bool:
        """True if a pulse is no longer than its channel has to be on."""
        least = {channel.name: channel.min_on_time for channel in self.spacecraft.channels}
        return any(0.0 < pulse.loaded[1] <= least.get(pulse.channel, 0.0) * (1.0 + 1e-9) for pulse in self.pulses)

    @property
    def to_the_end(self) -> bool:
        """True if less than one nutation period is left of the horizon after the last pulse."""
        body = self.spacecraft
        return body.horizon - self.pulses.end < body.nutation_period

    @property
    def rounding(self) -> float:
        """Largest effect, rad, of half a tick in starts and on-times, to first order; 0 without ticks."""
        return WORST * math.fsum(rounded_off(self.spacecraft, self.pulses))

    @property
    def steady_tilt(self) -> float:
        """Angle in rad at which the disturbances hold the body once the pulses are over."""
        body = self.spacecraft
        return math.atan(body.inertia.A * abs(steady_omega(body, self.pulses.end)) / abs(body.axial))
