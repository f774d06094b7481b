"""What no schedule can beat: lower bounds of the cost, by duality and by the length of the way.

The rigorous ones hold at any angle for a symmetric body left alone: no dissipation, no disturbances. They concern
schedules that leave no more than `Allowed`, and none of them knows of gaps, ticks and on-times, which can only raise
the cost.

*Nutation.* w = A ω e^{iφ} with φ = a ∫ω3 dt obeys dw/dt = M e^{iφ}, at any angle. Let y be complex with
Re(y* m e^{iφ}) ≤ c for the torque m and the cost c per second of every channel, and for every phase φ at which it may
be on. Then the cost Σ ∫ c dt of a schedule is at least Re(y* (w(end) - w(0))) ≥ -Re(y* A ω0) - |y| A |ω(end)|. The best
such y is the optimum of the dual of a linear program; each is a bound.

*Axial torque* changes ω3, and so the phases: by no more than what a schedule of a given cost can give to the spin.
Schedules that cost more need no bound.

*Spin.* A final spin costs impulse too: with M3 in place of one component, and |m| in place of the other.

*First order.* The same for the program of small angles, with all its equations: see `primer`.

*Turn.* Where ω3 stays, H·e3 = Cω3, so H never comes nearer to the origin than r = C|ω3|. From |H0| = r/cos θ0 the
shortest way round that sphere to the direction of the target is the tangent, r tan θ0, and an arc of the sphere.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from nutdamp.limits import free_windows, usable
from nutdamp.schemes.optimal.linear_program import Program
from nutdamp.schemes.optimal.primer import ROUNDING, SmallAngles, lowered, slackened
from nutdamp.spacecraft import Channel, Spacecraft, Vector

TURN = 2.0 * math.pi

LOOKS = 33
"""Directions looked at at once where the best is looked for."""

NARROWINGS = 9
"""Times that the search is narrowed to a sixteenth: to 1e-11 rad."""


class Allowed(NamedTuple):
    """What may be left: ``nutation`` and distance ``off`` the target in rad, ``spin`` as a share of the final one."""

    nutation: float = 0.0
    off: float = 0.0
    spin: float = 0.0


def rigorous(
    spacecraft: Spacecraft, prices: dict[str, float], cost: float, allowed: Allowed, *, shift: bool
) -> float | None:
    """Cost that no schedule of the channels of a symmetric body goes below; None where nothing is known to hold.

    ``prices`` per second by the names of the channels, ``cost`` that of a schedule known, which leaves as much as is
    ``allowed``; ``shift``: H counts, not only the nutation.
    """
    channels = usable(spacecraft, axial=True)
    if spacecraft.disturbances or spacecraft.growth != 0.0 or any(one.name not in prices for one in channels):
        return None
    if allowed.nutation >= 0.5 * math.pi:  # the spin axis points away from H
        return None
    costs = np.array([prices[channel.name] for channel in channels])
    torques = np.array([channel.torque for channel in channels])
    axial = bool(torques[:, 2].any())
    found = [_nutation(spacecraft, channels, costs, cost, allowed)]
    if spacecraft.goal.spin is not None:
        found.append(_nutation_and_spin(spacecraft, torques, costs, allowed))
    if shift and not axial:
        found.append(_turn(spacecraft, torques, costs, allowed))
    best = max(found)
    return best if math.isfinite(best) else None


def _nutation(spacecraft: Spacecraft, channels: list[Channel], costs: Vector, cost: float, allowed: Allowed) -> float:
    """Least cost of taking the nutation out, at the phases at which the channels may be on."""
    inertia, limits = spacecraft.inertia, spacecraft.limits
    faster = cost * float(max(abs(one.axial) / price for one, price in zip(channels, costs, strict=True))) / inertia.C
    goal = -inertia.A * complex(spacecraft.omega0[0], spacecraft.omega0[1])
    stays = inertia.C * (abs(spacecraft.spin) + faster) * math.tan(allowed.nutation)
    if abs(goal) <= stays:
        return 0.0
    low, wide = _arcs(
        [
            (min(phases) - wider, max(phases) + wider)
            for begins, ends in slackened(free_windows(spacecraft))
            for phases in [(inertia.a * spacecraft.spin * begins, inertia.a * spacecraft.spin * ends)]
            for wider in [abs(inertia.a) * faster * max(ends - limits.earliest, 0.0)]
        ]
    )
    points = np.array([channel.transverse for channel in channels]) / costs
    strength, angle = np.abs(points), np.angle(points)

    def value(directions: Vector) -> Vector:
        # From the begin of each arc to the direction, for each channel: inside, the whole strength is to be had.
        apart = np.mod(directions[:, None, None] - angle[:, None] - low, TURN)
        beside = np.maximum(np.cos(apart), np.cos(apart - wide))
        reach = (strength * np.where(apart <= wide, 1.0, beside).max(axis=2)).max(axis=1)
        return _ratio(abs(goal) * np.cos(directions - np.angle(goal)) - stays, abs(goal), reach, float(strength.max()))

    return _largest(value, float(np.angle(goal)), math.acos(stays / abs(goal)))


def _nutation_and_spin(spacecraft: Spacecraft, torques: Vector, costs: Vector, allowed: Allowed) -> float:
    """Least cost of taking the nutation out and changing the spin, whatever the phases."""
    final = spacecraft.goal.spin
    assert final is not None
    C, off = spacecraft.inertia.C, abs(final) * allowed.spin
    stays = C * (abs(final) + off) * math.tan(allowed.nutation)
    change = final - spacecraft.spin
    change = math.copysign(max(abs(change) - off, 0.0), change)
    goal = complex(max(spacecraft.least_impulse - stays, 0.0), C * change)
    if goal == 0.0:
        return 0.0
    points = np.column_stack([np.hypot(torques[:, 0], torques[:, 1]), torques[:, 2]]) / costs[:, None]

    def value(directions: Vector) -> Vector:
        inside = np.clip(directions, -0.5 * math.pi, 0.5 * math.pi)  # more than is needed may be taken of the nutation
        toward = np.array([np.cos(inside), np.sin(inside)])
        gain = np.array([goal.real, goal.imag]) @ toward
        return _ratio(gain, abs(goal), (points @ toward).max(axis=0), float(np.abs(points).max()))

    return _largest(value, float(np.angle(goal)), 0.5 * math.pi)


def _turn(spacecraft: Spacecraft, torques: Vector, costs: Vector, allowed: Allowed) -> float:
    """Least cost of the way of H to the direction of the target, round the sphere of radius C|ω3|."""
    nutation, beta = spacecraft.nutation, max(spacecraft.to_turn - allowed.off, 0.0)
    way = math.tan(nutation) + beta - nutation if beta > nutation else math.sin(beta) / math.cos(nutation)
    dearest = float((np.hypot(torques[:, 0], torques[:, 1]) / costs).max())
    return spacecraft.inertia.C * abs(spacecraft.spin) * way / dearest * (1.0 - ROUNDING)


def _arcs(spans: list[tuple[float, float]]) -> tuple[Vector, Vector]:
    """Begins in [0, 2π) and lengths, rad, of the arcs that ``spans`` of phases (begin, end) cover, joined."""
    merged: list[list[float]] = []
    for low, high in sorted((begin % TURN, begin % TURN + end - begin) for begin, end in spans):
        if merged and low <= merged[-1][1]:
            merged[-1][1] = max(merged[-1][1], high)
        else:
            merged.append([low, high])
    begins, ends = np.array(merged).T
    return begins, np.minimum(ends - begins, TURN)


def _ratio(gain: Vector, most: float, reach: Vector, strongest: float) -> Vector:
    """Cost (n,) of a ``gain`` of up to ``most``, where one unit of cost reaches up to ``strongest``, here ``reach``."""
    gain, reach = gain - ROUNDING * most, reach + ROUNDING * strongest
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(gain <= 0.0, 0.0, np.where(reach > 0.0, gain / reach, np.inf))


def _largest(value: Callable[[Vector], Vector], middle: float, reach: float) -> float:
    """The largest ``value`` (n,) -> (n,) of directions up to ``reach`` rad from ``middle``; it has one peak there."""
    best = 0.0
    for _ in range(NARROWINGS):
        directions = middle + reach * np.linspace(-1.0, 1.0, LOOKS)
        values = value(directions)
        index = int(np.argmax(values))
        best = max(best, float(values[index]))
        middle, reach = float(directions[index]), 2.0 * reach / (LOOKS - 1)
    return best


class Proof(NamedTuple):
    """Cost that no schedule goes below, ``bound``, and the ``prices`` (equations,) of one N m s each that prove it.

    ``gained`` is what channels that are on for long gain by these prices, and is taken off.
    """

    bound: float
    prices: Vector
    gained: float = 0.0


def first_order(program: Program, prices: Vector) -> Proof:
    """What the ``program`` of small angles cannot go below, by ``prices`` (equations,) of one N m s each.

    Any prices give a bound; the best are those of a solution. The proof's are no higher than what it costs.
    """
    goal = float(prices @ program.influence.goal) - program.off * float(np.linalg.norm(prices[2:4]))
    found = lowered(SmallAngles(program, prices), program.strong, goal) if prices.any() else None
    if found is None:
        return Proof(0.0, np.zeros_like(prices))
    return Proof(found.bound, prices / found.factor, found.gained)
