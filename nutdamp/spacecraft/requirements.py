"""End conditions: the requirement of the file, the spin rate of the goal, and the definition of
damped.

The only definition of compliance, for one plan or many dispersed cases: all functions take numbers
and arrays.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from nutdamp.errors import BadRequest
from nutdamp.spacecraft.equipment import Loop
from nutdamp.spacecraft.model import SLACK, Keep, Spacecraft
from nutdamp.spacecraft.tolerances import SpinTolerance

DAMPED_SHARE = 0.01
"""Fraction of the initial nutation, or of the turn to a target, taken as damped or reached."""

DAMPED_ANGLE = math.radians(1e-3)  # rad that may be left in any case
SAME_COST = 1e-3  # costs that differ by less, relatively, are equal: then other things decide
NEGLIGIBLE = math.radians(1e-9)  # rad below which angles are rounding, and shown as nothing

AIMED_SPIN = 0.1
"""Fraction of the tolerance of the spin that plans use; the rest is for what disperses."""


class Part(Enum):
    """Bounded quantity: angles in rad, the spin rate in rad/s relative to the goal."""

    NUTATION = "nutation"
    SHIFT = "momentum_shift"
    DISTANCE = "axis_error"
    SPIN = "spin"
    DURING = "nutation_during"
    CONE = "cone"

    @property
    def label(self) -> str:
        """Name in texts."""
        return LABELS.get(self, self.value.replace("_", " "))


POINTING = "pointing error"  # what requirement.pointing bounds, in texts; of no bound, axis error
LABELS = {Part.SPIN: "spin error", Part.DURING: "nutation on the way"}


class Bound(NamedTuple):
    """Bound of a part: its value may not exceed ``limit``, or, of the inner edge of a cone, not
    fall below it.

    ``required`` by file or command line, else the definition of damped, or, ``by_loop``, what the
    thresholds of a loop let stand. ``keep``: the cone of a bound on the way.
    """

    part: Part
    limit: float
    required: bool
    keep: Keep | None = None
    inner: bool = False
    by_loop: bool = False

    @property
    def label(self) -> str:
        """Name in texts."""
        named = self.part is Part.CONE and self.keep is not None
        label = POINTING if self.part is Part.DISTANCE else self.part.label
        return f"axis from {self.keep.name}" if named and self.keep else label

    @property
    def key(self) -> str:
        """Name in files: that of its key where that bounds the part alone."""
        return "pointing" if self.part is Part.DISTANCE else self.part.value

    def met(self, value: Any) -> Any:
        """True where a value keeps the bound: numbers, or arrays over cases."""
        slack = 0.0 if self.keep is None else SLACK
        return value >= self.limit - slack if self.inner else value <= self.limit + slack

    def margin(self, value: Any) -> Any:
        """Distance of a value to the bound, positive where it keeps it."""
        return value - self.limit if self.inner else self.limit - value

    def used(self, value: Any) -> Any:
        """Used fraction of the bound: 1 or less where it is kept."""
        if self.keep is None:
            return value / self.limit
        return (
            (self.limit - SLACK) / np.maximum(value, SLACK)
            if self.inner
            else value / (self.limit + SLACK)
        )


class Held(NamedTuple):
    """Bound, and the remaining value of its part in the same unit."""

    bound: Bound
    left: float

    @property
    def met(self) -> bool:
        """True if the bound is met."""
        return bool(self.bound.met(self.left))

    @property
    def margin(self) -> float:
        """Distance to the bound."""
        return float(self.bound.margin(self.left))


class Left(NamedTuple):
    """Residual: ``nutation`` and ``aim`` rad (H from the target axis, else from its start),
    ``spin`` rad/s.

    ``angles`` (m, 2): least and largest angle, rad, from each of the m cones of the file on the
    way; None where they were not observed. Each is a number or an array over cases, the angles (m,
    2, n).
    """

    nutation: Any
    aim: Any
    spin: Any
    angles: Any = None


def aim(spacecraft: Spacecraft) -> Part:
    """Distance of H at the end from its goal: the target axis, or without one its start."""
    return Part.SHIFT if spacecraft.goal.axis is None else Part.DISTANCE


def spin_tolerance(spacecraft: Spacecraft, spin: float) -> float:
    """Tolerance, rad/s, about a required ``spin``; of a halt it counts from the initial spin."""
    requested = spacecraft.requirement
    tolerance = SpinTolerance() if requested is None or requested.spin is None else requested.spin
    return (
        tolerance.size * (abs(spin) or abs(spacecraft.spin))
        if tolerance.relative
        else tolerance.size
    )


def required(spacecraft: Spacecraft) -> tuple[Bound, ...]:
    """Bounds at the end by the requirement, and of the spin of a goal; else empty."""
    requested, goal = spacecraft.requirement, spacecraft.goal
    bounds = []
    if requested is not None and requested.nutation is not None:
        bounds.append(Bound(Part.NUTATION, requested.nutation, True))
    # For this version momentum_shift counts from a target, too, as pointing does.
    for limit in () if requested is None else (requested.momentum_shift, requested.pointing):
        if limit is not None:
            bounds.append(Bound(aim(spacecraft), limit, True))
    if goal.spin is not None:
        bounds.append(Bound(Part.SPIN, spin_tolerance(spacecraft, goal.spin), True))
    return tuple(bounds)


def reaches_spin(spacecraft: Spacecraft) -> bool:
    """True if the spin is that of the goal from the beginning."""
    goal = spacecraft.goal.spin
    return goal is None or spins_at(spacecraft, goal)


def spins_at(spacecraft: Spacecraft, spin: float) -> bool:
    """True where the body spins at ``spin`` rad/s as nearly as plans set it."""
    return abs(spacecraft.spin - spin) <= AIMED_SPIN * spin_tolerance(spacecraft, spin)


def judged(spacecraft: Spacecraft) -> bool:
    """True if cases comply or not: something is required at the end, or cones are to be kept."""
    return bool(spacecraft.keep or required(spacecraft))


def bounds(spacecraft: Spacecraft) -> tuple[Bound, ...]:
    """Bounds `required` at the end, or for nutation and target axis those that define damped."""
    limits = required(spacecraft)
    limited = {bound.part for bound in limits}
    if Part.NUTATION not in limited:
        limits += (
            Bound(Part.NUTATION, max(DAMPED_SHARE * spacecraft.nutation, DAMPED_ANGLE), False),
        )
    if Part.DISTANCE not in limited and spacecraft.goal.axis is not None:
        limits += (
            Bound(Part.DISTANCE, max(DAMPED_SHARE * spacecraft.to_turn, DAMPED_ANGLE), False),
        )
    return limits


def edges(keep: Keep) -> tuple[Bound, ...]:
    """Inner and outer bound of a cone; about H that of the nutation on the way."""
    part = Part.DURING if keep.direction is None else Part.CONE
    inner = (Bound(part, keep.least, True, keep, inner=True),) if keep.least > 0.0 else ()
    outer = (Bound(part, keep.most, True, keep),) if keep.most < math.pi else ()
    return inner + outer


def cones(spacecraft: Spacecraft) -> tuple[Bound, ...]:
    """Bounds of all cones on the way."""
    return tuple(bound for keep in spacecraft.keep for bound in edges(keep))


def left_of(bound: Bound, left: Left, spacecraft: Spacecraft) -> Any:
    """Residual to be compared with a bound."""
    if bound.keep is not None:
        return left.angles[spacecraft.keep.index(bound.keep)][0 if bound.inner else 1]
    if bound.part is Part.NUTATION:
        return left.nutation
    if bound.part is Part.SPIN:
        assert spacecraft.goal.spin is not None
        return abs(left.spin - spacecraft.goal.spin)
    return left.aim


def held(spacecraft: Spacecraft, left: Left) -> tuple[Held, ...]:
    """Residual of a motion beside each of the `bounds`, and the `cones` that were observed."""
    way = () if left.angles is None else cones(spacecraft)
    return tuple(
        Held(bound, float(left_of(bound, left, spacecraft)))
        for bound in (*bounds(spacecraft), *way)
    )


def unaided(spacecraft: Spacecraft) -> bool:
    """True if the body keeps all `bounds` up to the horizon without a pulse.

    Dissipation leaves H where it is and lets tan θ grow or decay. With I1 ≠ I2 nutation runs to and
    fro, and its largest counts. False where it is not known: with disturbances, and with I1 ≠ I2
    where there is dissipation or a final spin.
    """
    varying = spacecraft.growth != 0.0 or spacecraft.goal.spin is not None
    if spacecraft.disturbances or (varying and not spacecraft.inertia.symmetric):
        return False
    nutation = (
        spacecraft.nutation
        if spacecraft.growth == 0.0
        else float(idle(spacecraft, spacecraft.horizon))
    )
    aim = 0.0 if spacecraft.goal.axis is None else spacecraft.to_turn
    # H stays, and H3 = |H| cos θ with it, so that spin and nutation are worst at one end of the
    # time or the other.
    faster = math.cos(nutation) / math.cos(spacecraft.nutation)
    most = max(nutation, spacecraft.nutation)
    slower = spacecraft.inertia.wheel / spacecraft.inertia.C
    later = (spacecraft.spin + slower) * faster - slower
    ends = [Left(most, aim, spin) for spin in (spacecraft.spin, later)]
    return all(bound.met for left in ends for bound in held(spacecraft, left))


def decayed(spacecraft: Spacecraft, t: float) -> float:
    """Nutation, rad, of an oblate body at ``t`` s without control; θ0 where it does not decay.

    Also θ0 where it is not known: with disturbances or I1 ≠ I2.
    """
    if spacecraft.growth >= 0.0 or spacecraft.disturbances or not spacecraft.inertia.symmetric:
        return spacecraft.nutation
    return float(idle(spacecraft, t))


def idle(spacecraft: Spacecraft, t: Any) -> Any:
    """Nutation, rad, at ``t`` s without control or disturbance, where I1 = I2."""
    from nutdamp.physics import energy_sink  # dissipation

    sine = math.sin(spacecraft.nutation)
    cosine = math.cos(spacecraft.nutation)
    effect = energy_sink.course(spacecraft.growth, cosine, sine * sine, t, spacecraft.damper)
    return np.arctan2(sine * effect.transverse, effect.along)


def reached(spacecraft: Spacecraft, nutation: float, now: float | None = None) -> float:
    """Time to a nutation (rad) without firing, s; 0 if reached, infinite if never, as beyond the
    end of growth.

    ln(tan θ/tan θ0)/κ without a wheel.

    Growing nutation reaches it from below, decaying nutation from above; ``now``: θ0, default that
    at t = 0.
    """
    growth = spacecraft.growth
    now = spacecraft.nutation if now is None else now
    if (nutation <= now) if growth > 0.0 else (nutation >= now):
        return 0.0
    if growth == 0.0 or now == 0.0 or nutation == 0.0:
        return math.inf
    from nutdamp.physics import energy_sink  # dissipation

    return energy_sink.time_to_angle(growth, now, nutation, spacecraft.damper)


def slower(spacecraft: Spacecraft, nutation: float) -> float:
    """Time, s, by which a growing nutation comes later to an angle, rad, than at the rate of small
    angles.

    Infinite where growth ends before; without a wheel tan θ grows at that rate to the end.
    """
    if spacecraft.inertia.wheel == 0.0:
        return 0.0
    small = 1e-6 * nutation
    even = math.log(math.tan(nutation) / math.tan(small)) / spacecraft.growth
    return reached(spacecraft, nutation, small) - even


def only_nutation(spacecraft: Spacecraft) -> bool:
    """True if nutation alone can keep a body without pulses from its requirement.

    H stays where it is and there is no final spin, no cone to keep; False where no pulse is needed
    anyway (`unaided`).
    """
    there = aim(spacecraft) is Part.SHIFT or all(
        bound.part is not Part.DISTANCE for bound in required(spacecraft)
    )
    return (
        there and spacecraft.goal.spin is None and not spacecraft.keep and not unaided(spacecraft)
    )


def to_required(spacecraft: Spacecraft, nutation: float, *, growing: bool) -> float | None:
    """Time, s, until the ``nutation`` (rad) of an uncontrolled body is the required one,
    ``growing`` or decaying.

    None where it does not, where none is required, and where it is not known: with disturbances or
    I1 ≠ I2.
    """
    required, growth = spacecraft.requirement, spacecraft.growth
    if (
        required is None
        or required.nutation is None
        or spacecraft.disturbances
        or not spacecraft.inertia.symmetric
    ):
        return None
    return (
        reached(spacecraft, required.nutation, nutation)
        if growth != 0.0 and (growth > 0.0) == growing
        else None
    )


def missed(spacecraft: Spacecraft, nutation: Any, aim: Any) -> Any:
    """Residual, rad: nutation, or the distance ``aim`` from a target axis if there is one and it is
    larger.

    Numbers, or arrays over cases.
    """
    return nutation if spacecraft.goal.axis is None else np.maximum(nutation, aim)


def severity(spacecraft: Spacecraft, left: Left, drained: Any = 0.0) -> Any:
    """Largest used fraction of a `required` bound at the end: 1 or less complies; numbers, or
    arrays over cases.

    Without such bounds what is `missed`, rad. Where a cone is broken, or more than all propellant
    ``drained`` (a fraction), it is no less than that.
    """
    ends = [bound.used(left_of(bound, left, spacecraft)) for bound in required(spacecraft)]
    parts = ends or [missed(spacecraft, left.nutation, left.aim)]
    shares = np.asarray(np.maximum.reduce(np.broadcast_arrays(*parts)), dtype=float)
    way = () if left.angles is None else cones(spacecraft)
    used = [bound.used(left_of(bound, left, spacecraft)) for bound in way]
    worst = np.maximum.reduce(np.broadcast_arrays(np.real(drained), *used))
    return np.where(worst > 1.0, np.maximum(worst, shares), shares)


def complies(severity: Any) -> Any:
    """True where a `severity`, or the used fraction of a bound, is kept; elementwise."""
    return severity <= 1.0


def enough(low: float, high: float, probability: float) -> bool | None:
    """True if a share between ``low`` and ``high`` is enough, False for less, else None."""
    return True if low >= probability else False if high < probability else None


LOOP = """the spacecraft file has no loop: it names no sensor to fire by. For example:

loop:
  sensor: {kind: gyro, rate: 100 Hz, noise: 0.01 deg/s, delay: 20 ms}
  law: four-pulse
  start: 0.5 deg
  stop: 0.05 deg"""
"""Message for a file that should have a loop."""


def expect_loop(spacecraft: Spacecraft) -> Loop:
    """Loop of a spacecraft; raises BadRequest, with an example to write, where there is none."""
    if spacecraft.loop is None:
        raise BadRequest(LOOP)
    return spacecraft.loop


def expect_dissipation(spacecraft: Spacecraft) -> None:
    """Raise BadRequest, with the keys to add, where the nutation neither grows nor decays."""
    if spacecraft.dissipation is None:
        raise BadRequest(
            "the spacecraft file has no dissipation: it does not say how fast the nutation grows. "
            "For example:\n\n"
            "dissipation: {time_constant: 600 s}"
        )
