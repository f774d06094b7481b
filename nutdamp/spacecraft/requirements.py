"""End conditions: the requirement of the file, the spin rate of the goal, and the definition of damped.

The only definition of compliance, for one plan or many dispersed cases: all functions take numbers and arrays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from nutdamp.errors import BadRequest
from nutdamp.spacecraft.equipment import Loop
from nutdamp.spacecraft.model import Spacecraft

DAMPED_SHARE = 0.01
"""Fraction of the initial nutation (of the turn to a target axis) below which it counts as damped (reached)."""

DAMPED_ANGLE = math.radians(1e-3)  # rad that may be left in any case
SAME_COST = 1e-3  # costs that differ by less, relatively, are equal: then other things decide
NEGLIGIBLE = math.radians(1e-9)  # rad below which angles are rounding, and shown as nothing
SPIN_TOLERANCE = 1e-3  # relative tolerance of the spin at the end against the goal


class Part(Enum):
    """Bounded quantity: angles in rad, the spin rate in rad/s relative to the goal."""

    NUTATION = "nutation"
    SHIFT = "momentum_shift"
    DISTANCE = "axis_error"
    SPIN = "spin"

    @property
    def label(self) -> str:
        """Name in texts."""
        return "spin error" if self is Part.SPIN else self.value.replace("_", " ")


class Bound(NamedTuple):
    """Upper bound of a part; ``required`` by file or command line, else the definition of damped."""

    part: Part
    most: float
    required: bool


class Held(NamedTuple):
    """Bound, and the remaining value of its part in the same unit."""

    bound: Bound
    left: float

    @property
    def met(self) -> bool:
        """True if the bound is met."""
        return self.left <= self.bound.most


class Left(NamedTuple):
    """Residual: ``nutation`` and ``aim`` rad (H from the target axis, else from its start), ``spin`` rad/s.

    Each is a number or an array over cases.
    """

    nutation: Any
    aim: Any
    spin: Any


def aim(spacecraft: Spacecraft) -> Part:
    """Distance of H at the end from its goal: the target axis, or without one its start."""
    return Part.SHIFT if spacecraft.goal.axis is None else Part.DISTANCE


def required(spacecraft: Spacecraft) -> tuple[Bound, ...]:
    """Bounds of the requirement, and of the spin where the goal names one; empty without a requirement."""
    requested, goal = spacecraft.requirement, spacecraft.goal
    bounds = []
    if requested is not None and requested.nutation is not None:
        bounds.append(Bound(Part.NUTATION, requested.nutation, True))
    if requested is not None and requested.momentum_shift is not None:
        bounds.append(Bound(aim(spacecraft), requested.momentum_shift, True))
    if goal.spin is not None:
        bounds.append(Bound(Part.SPIN, SPIN_TOLERANCE * abs(goal.spin), True))
    return tuple(bounds)


def spins_at(spacecraft: Spacecraft, spin: float) -> bool:
    """True where the body spins at ``spin`` rad/s, within the tolerance of a goal."""
    return abs(spacecraft.spin - spin) <= SPIN_TOLERANCE * abs(spin)


def judged(spacecraft: Spacecraft) -> bool:
    """True if cases comply or not: something is required at the end, or cones are to be kept."""
    return bool(spacecraft.keep or required(spacecraft))


def bounds(spacecraft: Spacecraft) -> tuple[Bound, ...]:
    """Bounds `required`; for nutation and target axis without one, those that define damped."""
    limits = required(spacecraft)
    limited = {bound.part for bound in limits}
    if Part.NUTATION not in limited:
        limits += (Bound(Part.NUTATION, max(DAMPED_SHARE * spacecraft.nutation, DAMPED_ANGLE), False),)
    if Part.DISTANCE not in limited and spacecraft.goal.axis is not None:
        limits += (Bound(Part.DISTANCE, max(DAMPED_SHARE * spacecraft.to_turn, DAMPED_ANGLE), False),)
    return limits


def left_of(part: Part, left: Left, spacecraft: Spacecraft) -> Any:
    """Residual of a part, to be compared with the ``most`` of its bound."""
    if part is Part.NUTATION:
        return left.nutation
    if part is Part.SPIN:
        assert spacecraft.goal.spin is not None
        return abs(left.spin - spacecraft.goal.spin)
    return left.aim


def held(spacecraft: Spacecraft, left: Left) -> tuple[Held, ...]:
    """Residual of one motion beside each of the `bounds`."""
    return tuple(Held(bound, float(left_of(bound.part, left, spacecraft))) for bound in bounds(spacecraft))


def unaided(spacecraft: Spacecraft) -> bool:
    """True if the body keeps all `bounds` up to the horizon without a pulse.

    Dissipation leaves H where it is and lets tan θ grow or decay. With I1 ≠ I2 nutation runs to and fro, and its
    largest counts. False where it is not known: with disturbances, and with I1 ≠ I2 where there is dissipation or a
    final spin.
    """
    varying = spacecraft.growth != 0.0 or spacecraft.goal.spin is not None
    if spacecraft.disturbances or (varying and not spacecraft.inertia.symmetric):
        return False
    nutation = _idle(spacecraft, spacecraft.horizon)
    aim = 0.0 if spacecraft.goal.axis is None else spacecraft.to_turn
    # H stays, and H3 = |H| cos θ with it, so that spin and nutation are worst at one end of the time or the other.
    faster = math.cos(nutation) / math.cos(spacecraft.nutation)
    most, slower = max(nutation, spacecraft.nutation), spacecraft.inertia.wheel / spacecraft.inertia.C
    later = (spacecraft.spin + slower) * faster - slower
    ends = [Left(most, aim, spin) for spin in (spacecraft.spin, later)]
    return all(bound.met for left in ends for bound in held(spacecraft, left))


def decayed(spacecraft: Spacecraft, t: float) -> float:
    """Nutation, rad, of an oblate body at ``t`` s without control; θ0 where it does not decay.

    Also θ0 where it is not known: with disturbances or I1 ≠ I2.
    """
    if spacecraft.growth >= 0.0 or spacecraft.disturbances or not spacecraft.inertia.symmetric:
        return spacecraft.nutation
    return _idle(spacecraft, t)


def _idle(spacecraft: Spacecraft, t: float) -> float:
    return math.atan(math.tan(spacecraft.nutation) * math.exp(min(spacecraft.growth * t, 700.0)))


def reached(spacecraft: Spacecraft, nutation: float, now: float | None = None) -> float:
    """Time to a nutation (rad) without firing, s: ln(tan θ/tan θ0)/κ; 0 if reached, infinite if never.

    Growing nutation reaches it from below, decaying nutation from above; ``now``: θ0, default that at t = 0.
    """
    growth = spacecraft.growth
    now = spacecraft.nutation if now is None else now
    if (nutation <= now) if growth > 0.0 else (nutation >= now):
        return 0.0
    if growth == 0.0 or now == 0.0 or nutation == 0.0:
        return math.inf
    return math.log(math.tan(nutation) / math.tan(now)) / growth


def only_nutation(spacecraft: Spacecraft) -> bool:
    """True if nutation alone can keep a body without pulses from its requirement.

    H stays where it is and there is no final spin, no cone to keep; False where no pulse is needed anyway (`unaided`).
    """
    there = aim(spacecraft) is Part.SHIFT or all(bound.part is not Part.DISTANCE for bound in required(spacecraft))
    return there and spacecraft.goal.spin is None and not spacecraft.keep and not unaided(spacecraft)


def to_required(spacecraft: Spacecraft, nutation: float, *, growing: bool) -> float | None:
    """Time, s, until the ``nutation`` (rad) of an uncontrolled body is the required one, ``growing`` or decaying.

    None where it does not, where none is required, and where it is not known: with disturbances or I1 ≠ I2.
    """
    required, growth = spacecraft.requirement, spacecraft.growth
    if required is None or required.nutation is None or spacecraft.disturbances or not spacecraft.inertia.symmetric:
        return None
    return reached(spacecraft, required.nutation, nutation) if growth != 0.0 and (growth > 0.0) == growing else None


def missed(spacecraft: Spacecraft, nutation: Any, aim: Any) -> Any:
    """Residual, rad: nutation, or the distance ``aim`` from a target axis if there is one and it is larger.

    Numbers, or arrays over cases.
    """
    return nutation if spacecraft.goal.axis is None else np.maximum(nutation, aim)


def severity(spacecraft: Spacecraft, left: Left, used: Sequence[Any] = ()) -> Any:
    """Largest used fraction of a `required` bound: 1 or less complies.

    Without such bounds what is `missed`, rad. Where more than all of a cone, or of the propellant, is ``used`` (shares)
    on the way, it is no less than that.
    """
    parts: list[Any] = [left_of(bound.part, left, spacecraft) / bound.most for bound in required(spacecraft)]
    if not parts:
        parts = [missed(spacecraft, left.nutation, left.aim)]
    shares = np.asarray(np.maximum.reduce(np.broadcast_arrays(*parts)), dtype=float)
    if not len(used):
        return shares
    worst = np.maximum.reduce(np.broadcast_arrays(*used))
    return np.where(worst > 1.0, np.maximum(worst, shares), shares)


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
    """Raise BadRequest, with the keys to add, for a spacecraft whose nutation neither grows nor decays."""
    if spacecraft.dissipation is None:
        raise BadRequest(
            "the spacecraft file has no dissipation: it does not say how fast the nutation grows. For example:\n\n"
            "dissipation: {time_constant: 600 s}"
        )
