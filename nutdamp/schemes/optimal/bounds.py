"""Lower bounds of the cost of a schedule, by duality and by the length of the way.

The rigorous ones hold at any angle for a symmetric body left alone: no dissipation, no
disturbances, no goal for the spin. They concern schedules that leave no more than `Allowed`, and
know of no gaps, ticks and on-times, which can only raise the cost.

*Nutation.* w = A ω e^{iφ} with φ = a ∫ω3 dt obeys dw/dt = M e^{iφ}, at any angle. Let y be complex
  with
Re(y* m e^{iφ}) ≤ c for the torque m and the cost c per second of every channel, and every phase φ
at which it may be
on. Then Σ ∫ c dt ≥ Re(y* (w(end) - w(0))) ≥ -Re(y* A ω0) - |y| A |ω(end)|. Axial torque changes ω3,
and so the phases,
by no more than what a schedule of a given cost can give to the spin.

*Turn.* Where ω3 stays, H·e3 = Cω3, so H never comes nearer to the origin than r = C|ω3|. From |H0|
  = r/cos θ0 the
shortest way round that sphere to the direction of the target is the tangent, r tan θ0, and an arc
of the sphere.

*First order*, the primer: q is the worth of a second of a channel by prices y, over its cost, in
  the program of small
angles. By weak duality no schedule costs less than their worth at the goal, once q ≤ 1 everywhere.
Prices that are too
high somewhere are lowered for channels that act within a moment; for those that have to be on for
long, the gain of
each stretch is taken off: ∫ max(0, q - 1) c dt. Between the times looked at, q is known by its
curvature.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.schemes.optimal.linear_program import Program
from nutdamp.spacecraft.constraints import free_windows, usable
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import TOUCHING

# Subdivisions of a span into quarters, to 1e-5 of a slot; parts of a slot in which a long gain is
# summed.
QUARTERINGS, PARTS = 9, 4

# Factors by which prices are lowered for channels that are on for long. Solved with slots, they are
# up to w²/8 + w²/24 too high in the middle of a slot of w rad, which adds up over very many
# alignments; each factor gives a bound.
LOWERINGS = (1.0, 1.0003, 1.0005, 1.001, 1.0016)

# Relative height of a price that is not worth a closer look, and share by which gains are lowered
# and prices raised, so that no bound is too high by the rounding of sums.
ENOUGH, ROUNDING = 1e-10, 1e-12


class SmallAngles:
    """The curve of the ``prices`` (equations,) of one N m s each in the ``program`` of small
    angles.

    ``begins`` and ``lengths`` (n,) s: stretches no longer than a slot; ``bends`` (channels,) per
    s²: what the second derivative of q does not exceed.
    """

    def __init__(self, program: Program, prices: Vector) -> None:
        self.program = program
        self.prices = prices
        self.costs = program.costs
        self.torques = np.array([channel.torque for channel in program.channels])
        spans = [
            (begin - TOUCHING, end + TOUCHING)
            for begin, end in free_windows(program.spacecraft, program.end)
        ]
        edges = [
            np.linspace(*span, max(math.ceil((span[1] - span[0]) / program.width), 1) + 1)
            for span in spans
        ]
        self.begins = np.concatenate([part[:-1] for part in edges])
        self.lengths = np.concatenate([np.diff(part) for part in edges])
        # Second derivative, at most: each pair of equations turns at its rate, and grows or decays
        # slowly.
        rates, growth = program.influence.turning, program.spacecraft.growth
        pairs = (
            (rate, float(np.linalg.norm(prices[rates == rate])))
            for rate in sorted(set(rates.tolist()))
        )
        bend = sum(size * (rate**2 + growth**2) for rate, size in pairs)
        self.bends = bend * np.linalg.norm(self.torques, axis=1) / program.costs

    def at(self, times: Vector) -> Vector:
        """q at ``times`` (n,) s, (n, channels)."""
        worth = (
            np.tensordot(self.program.influence.rows(times), self.prices, axes=(1, 0))
            @ self.torques.T
        )
        return np.asarray(worth / self.costs)

    def mean(self, centres: Vector, lengths: Vector) -> Vector:
        """Mean of q in stretches about ``centres`` (n,) s, ``lengths`` (n,) s long, (n,
        channels).
        """
        lost = self.program.influence.widths(lengths)
        worth = (
            np.einsum("ne,nek->nk", lost * self.prices, self.program.influence.rows(centres))
            @ self.torques.T
        )
        return np.asarray(worth / self.costs)


def _highest(curve: SmallAngles, which: NDArray[np.bool_]) -> float:
    """The highest q of ``which`` channels at any time; a little more where that is not exact."""
    if not which.any():
        return 0.0
    before, after = (
        curve.at(times)[:, which] for times in (curve.begins, curve.begins + curve.lengths)
    )
    tops = _top(before, after, curve.bends[which], curve.lengths[:, None])
    best = float(max(before.max(), after.max()))
    slot, index = np.nonzero(tops > best + ENOUGH * abs(best))
    begins, lengths, channel = curve.begins[slot], curve.lengths[slot], np.flatnonzero(which)[index]
    highest = tops[slot, index]
    for _ in range(QUARTERINGS):
        lengths, channel = np.repeat(0.25 * lengths, 4), np.repeat(channel, 4)
        begins = np.repeat(begins, 4) + lengths * np.tile(np.arange(4), len(begins))
        before, after = (
            curve.at(times)[np.arange(len(times)), channel] for times in (begins, begins + lengths)
        )
        highest = _top(before, after, curve.bends[channel], lengths)
        best = max(float(edge.max(initial=best)) for edge in (before, after))
        there = highest > best + ENOUGH * abs(best)
        begins, lengths, channel, highest = (
            begins[there],
            lengths[there],
            channel[there],
            highest[there],
        )
    return max(best + ENOUGH * abs(best), float(highest.max(initial=-math.inf)))


def _lasting(curve: SmallAngles, which: NDArray[np.bool_], factor: float) -> float:
    """Gain of ``which`` channels that are on whenever it pays,
    with prices lowered by a ``factor``.
    """
    if not which.any():
        return 0.0
    costs = curve.costs[which]
    bends = curve.bends[which] / factor

    def gain(times: Vector) -> Vector:
        return np.asarray(curve.at(times)[:, which] / factor - 1.0)

    before, after = gain(curve.begins), gain(curve.begins + curve.lengths)
    pays = np.flatnonzero((_top(before, after, bends, curve.lengths[:, None]) > 0.0).any(axis=1))
    begins = curve.begins[pays]
    lengths = curve.lengths[pays] / PARTS
    total = 0.0
    before = before[pays]
    for part in range(PARTS):
        after = gain(begins + (part + 1) * lengths)
        mean = curve.mean(begins + (part + 0.5) * lengths, lengths)[:, which] / factor - 1.0
        gained = np.where(-_top(-before, -after, bends, lengths[:, None]) >= 0.0, mean, 0.0)
        crossing = _top(before, after, bends, lengths[:, None]) > 0.0
        most = _positive_mean(before, after) + bends * lengths[:, None] ** 2 / 12.0
        gained = np.where(crossing & (gained == 0.0), most, gained)
        total += float((gained * lengths[:, None] @ costs).sum())
        before = after
    return total


def _top(before: Vector, after: Vector, bend: Vector, length: Vector) -> Vector:
    """The most that a function of second derivative up to ``bend`` can be between its values at two
    ends.
    """
    arch = 0.5 * bend * length**2
    with np.errstate(divide="ignore", invalid="ignore"):
        within = 0.5 * (before + after) + 0.25 * arch + 0.25 * (after - before) ** 2 / arch
    return np.asarray(np.where(np.abs(after - before) < arch, within, np.maximum(before, after)))


def _positive_mean(before: Vector, after: Vector) -> Vector:
    """Mean of the positive part of a straight line from one value to another."""
    most = np.maximum(before, after)
    least = np.minimum(before, after)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = 0.5 * most**2 / (most - least)
    return np.asarray(
        np.where(most <= 0.0, 0.0, np.where(least >= 0.0, 0.5 * (most + least), crossing))
    )


LOOKS, NARROWINGS = (
    33,
    9,
)  # directions looked at at once, and narrowings of the search to a sixteenth: to 1e-11 rad


class Allowed(NamedTuple):
    """Largest end errors: ``nutation`` and distance ``off`` the target, rad."""

    nutation: float = 0.0
    off: float = 0.0


def rigorous(
    spacecraft: Spacecraft, prices: dict[str, float], cost: float, allowed: Allowed, *, shift: bool
) -> float | None:
    """Cost that no schedule of the channels of a symmetric body goes below; None where nothing is
    known to hold.

    ``prices`` per second by the names of the channels, ``cost`` that of a schedule known, which
    leaves as much as is ``allowed``; ``shift``: H counts, not only the nutation.
    """
    channels = usable(spacecraft, axial=True)
    if (
        spacecraft.disturbances
        or spacecraft.growth != 0.0
        or any(channel.name not in prices for channel in channels)
        or spacecraft.goal.spin is not None
        or not spacecraft.inertia.symmetric
        or allowed.nutation >= 0.5 * math.pi  # the spin axis points away from H
    ):
        return None
    costs = np.array([prices[channel.name] for channel in channels])
    torques = np.array([channel.torque for channel in channels])
    lower_bounds = [_nutation(spacecraft, torques, costs, cost, allowed)]
    if shift and not torques[:, 2].any():
        # The way of H to the direction of the target, round the sphere of radius |H3|.
        nutation = spacecraft.nutation
        beta = max(spacecraft.to_turn - allowed.off, 0.0)
        way = (
            math.tan(nutation) + beta - nutation
            if beta > nutation
            else math.sin(beta) / math.cos(nutation)
        )
        dearest = float((np.hypot(torques[:, 0], torques[:, 1]) / costs).max())
        lower_bounds.append(abs(spacecraft.axial) * way / dearest * (1.0 - ROUNDING))
    best = max(lower_bounds)
    return best if math.isfinite(best) else None


def _nutation(
    spacecraft: Spacecraft, torques: Vector, costs: Vector, cost: float, allowed: Allowed
) -> float:
    """Least cost of taking the nutation out, at the phases at which the channels may be on."""
    inertia = spacecraft.inertia
    faster = cost * float((np.abs(torques[:, 2]) / costs).max()) / inertia.C
    goal = -inertia.A * complex(spacecraft.omega0[0], spacecraft.omega0[1])
    stays = (abs(spacecraft.axial) + inertia.C * faster) * math.tan(allowed.nutation)
    if abs(goal) <= stays:
        return 0.0
    edges = np.array(free_windows(spacecraft)).T + np.array([[-TOUCHING], [TOUCHING]])
    wider = abs(inertia.a) * faster * np.maximum(edges[1] - spacecraft.limits.earliest, 0.0)
    phases = np.sort(spacecraft.nutation_rate * edges, axis=0) + np.array([-wider, wider])
    # Arcs that these phases cover, joined: begins in [0, 2π) and lengths, rad.
    lows, highs = np.array(
        sorted((begin % math.tau, begin % math.tau + end - begin) for begin, end in phases.T)
    ).T
    over = np.maximum.accumulate(highs)
    first = np.append(True, lows[1:] > over[:-1])
    low = lows[first]
    wide = np.minimum(over[np.append(first[1:], True)] - low, math.tau)
    points = (torques[:, 0] + 1j * torques[:, 1]) / costs
    strength = np.abs(points)
    angle = np.angle(points)
    best = 0.0
    middle = float(np.angle(goal))
    reach = math.acos(stays / abs(goal))
    for _ in range(NARROWINGS):  # the bound has one peak in these directions of y
        directions = middle + reach * np.linspace(-1.0, 1.0, LOOKS)
        # From the begin of each arc to the direction, for each channel: inside, the whole strength
        # is to be had.
        apart = np.mod(directions[:, None, None] - angle[:, None] - low, math.tau)
        beside = np.maximum(np.cos(apart), np.cos(apart - wide))
        effect = (strength * np.where(apart <= wide, 1.0, beside).max(axis=2)).max(axis=1)
        effect += ROUNDING * float(strength.max())
        gain = abs(goal) * (np.cos(directions - np.angle(goal)) - ROUNDING) - stays
        with np.errstate(divide="ignore", invalid="ignore"):
            values = np.where(gain <= 0.0, 0.0, np.where(effect > 0.0, gain / effect, np.inf))
        index = int(np.argmax(values))
        best = max(best, float(values[index]))
        middle = float(directions[index])
        reach = 2.0 * reach / (LOOKS - 1)
    return best


class Proof(NamedTuple):
    """Cost that no schedule goes below, ``bound``, and the ``prices`` (equations,) of one N m s
    each that prove it.

    ``gained`` is what channels that are on for long gain by these prices, and is taken off.
    """

    bound: float
    prices: Vector
    gained: float = 0.0


def first_order(program: Program, prices: Vector) -> Proof:
    """Lower bound of the ``program`` of small angles, by ``prices`` (equations,) of one N m s each.

    Any prices give a bound; the best are those of a solution. The proof's are no higher than what
    it costs.
    """
    best = Proof(0.0, np.zeros_like(prices))
    strong = program.strong
    if not prices.any():
        return best
    goal = float(prices @ program.influence.goal) - program.off * float(np.linalg.norm(prices[2:4]))
    curve = SmallAngles(program, prices)
    highest = max(_highest(curve, strong), 0.0 if strong.all() else 1.0)
    for lowering in LOWERINGS[: 1 if strong.all() else None] if highest > 0.0 else ():
        factor = highest * lowering
        gained = _lasting(curve, ~strong, factor)
        proof = Proof((goal / factor - gained) * (1.0 - ROUNDING), prices / factor, gained)
        best = max(best, proof, key=lambda proof: proof.bound)
    return best
