"""What a second of each channel is worth by the prices of a program, over its cost: how high that is, and what it adds
up to where it is above one.

By weak duality prices y prove that no schedule costs less than what they are worth at the goal, once no second of a
channel is worth more than it costs. A price that is too high somewhere is lowered until it is not, for channels that
act within a moment; from those that have to be on for long, what a stretch of them gains is taken off:
∫ max(0, q - 1) c dt. Between the times looked at, q is known by its curvature.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.limits import free_windows
from nutdamp.schedule import TOUCHING
from nutdamp.schemes.optimal.linear_program import Program
from nutdamp.spacecraft import Vector

QUARTERINGS = 9
"""Times that what lies between two times is looked at in quarters: to a 1e-5 of a slot."""

PARTS = 4
"""Parts of a slot in which the gain of a channel that is on for long is summed."""

LOWERINGS = (1.0, 1.0003, 1.0005, 1.001, 1.0016)
"""Factors by which prices are lowered for channels that are on for long. Solved with slots, they are up to w²/8 + w²/24
too high in the middle of a slot of w rad, which adds up over very many alignments; each factor gives a bound."""

ENOUGH = 1e-10
"""Relative height of a price that is not worth a closer look."""

ROUNDING = 1e-12
"""Share by which gains are lowered and prices raised, so that no bound is too high by the rounding of sums."""


class Lowered(NamedTuple):
    """The best ``bound`` by prices over a ``factor``; ``gained`` is what channels on for long gain by them."""

    bound: float
    factor: float
    gained: float


class SmallAngles:
    """The curve of the ``prices`` (equations,) of one N m s each in the ``program`` of small angles.

    ``begins`` and ``lengths`` (n,) s: stretches no longer than a slot; ``bends`` (channels,) per s²: what the second
    derivative of q does not exceed.
    """

    def __init__(self, program: Program, prices: Vector) -> None:
        self.program, self.prices, self.costs = program, prices, program.costs
        self.torques = np.array([channel.torque for channel in program.channels])
        self.begins, self.lengths = stretches(program, slackened(free_windows(program.spacecraft, program.end)))
        # Second derivative, at most: each pair of equations turns at its rate, and grows or decays slowly.
        rates = program.influence.turning
        bend = sum(
            float(np.linalg.norm(prices[rates == rate])) * (rate**2 + program.spacecraft.growth**2)
            for rate in sorted(set(rates.tolist()))
        )
        self.bends = bend * np.linalg.norm(self.torques, axis=1) / program.costs

    def at(self, times: Vector) -> Vector:
        """q at ``times`` (n,) s, (n, channels)."""
        worth = np.tensordot(self.program.influence.rows(times), self.prices, axes=(1, 0)) @ self.torques.T
        return np.asarray(worth / self.costs)

    def mean(self, centres: Vector, lengths: Vector) -> Vector:
        """Mean of q in stretches about ``centres`` (n,) s, ``lengths`` (n,) s long, (n, channels)."""
        lost = self.program.influence.widths(lengths)
        worth = np.einsum("ne,nek->nk", lost * self.prices, self.program.influence.rows(centres)) @ self.torques.T
        return np.asarray(worth / self.costs)


def stretches(program: Program, spans: Sequence[tuple[float, float]]) -> tuple[Vector, Vector]:
    """Begins and lengths, s, of stretches no longer than a slot into which ``spans`` (begin, end) s are cut."""
    edges = [
        np.linspace(begins, ends, max(math.ceil((ends - begins) / program.width), 1) + 1) for begins, ends in spans
    ]
    return np.concatenate([part[:-1] for part in edges]), np.concatenate([np.diff(part) for part in edges])


def slackened(windows: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The windows with what rounding may overstep."""
    return [(begin - TOUCHING, end + TOUCHING) for begin, end in windows]


def lowered(curve: SmallAngles, strong: NDArray[np.bool_], goal: float) -> Lowered | None:
    """What prices prove that are worth ``goal``; None where they prove nothing. ``strong``: act within a moment."""
    highest = max(_highest(curve, strong), 0.0 if strong.all() else 1.0)
    if highest <= 0.0:
        return None
    found = []
    for factor in map(float, highest * np.array([1.0] if strong.all() else LOWERINGS)):
        gained = _lasting(curve, ~strong, factor)
        found.append(Lowered((goal / factor - gained) * (1.0 - ROUNDING), factor, gained))
    best = max(found, key=lambda one: one.bound)
    return best if best.bound > 0.0 else None


def _highest(curve: SmallAngles, which: NDArray[np.bool_]) -> float:
    """The highest q of ``which`` channels at any time; a little more where that is not exact."""
    which_ones = np.flatnonzero(which)
    if not len(which_ones):
        return 0.0
    before, after = (part[:, which] for part in _ends(curve, curve.begins, curve.lengths))
    tops = _top(before, after, curve.bends[which_ones], curve.lengths[:, None])
    best = float(max(before.max(), after.max()))
    slot, index = np.nonzero(tops > best + ENOUGH * abs(best))
    begins, lengths, channel = curve.begins[slot], curve.lengths[slot], which_ones[index]
    highest = tops[slot, index]
    for _ in range(QUARTERINGS):
        if not len(begins):
            return best + ENOUGH * abs(best)
        lengths, channel = np.repeat(0.25 * lengths, 4), np.repeat(channel, 4)
        begins = np.repeat(begins, 4) + lengths * np.tile(np.arange(4), len(begins))
        every = np.arange(len(begins))
        before, after = (part[every, channel] for part in _ends(curve, begins, lengths))
        highest = _top(before, after, curve.bends[channel], lengths)
        best = max(best, float(before.max()), float(after.max()))
        there = highest > best + ENOUGH * abs(best)
        begins, lengths, channel, highest = begins[there], lengths[there], channel[there], highest[there]
    return max(best + ENOUGH * abs(best), float(highest.max(initial=-math.inf)))


def _ends(curve: SmallAngles, begins: Vector, lengths: Vector) -> list[Vector]:
    """q at both ends of stretches, (n, channels) each."""
    return [curve.at(begins), curve.at(begins + lengths)]


def _lasting(curve: SmallAngles, which: NDArray[np.bool_], factor: float) -> float:
    """What ``which`` channels gain by being on whenever it pays, with prices lowered by a ``factor``."""
    which_ones = np.flatnonzero(which)
    if not len(which_ones):
        return 0.0
    costs, bends = curve.costs[which_ones], curve.bends[which_ones] / factor
    ends = [one[:, which_ones] / factor - 1.0 for one in _ends(curve, curve.begins, curve.lengths)]
    pays = np.flatnonzero((_top(ends[0], ends[1], bends, curve.lengths[:, None]) > 0.0).any(axis=1))
    begins, lengths = curve.begins[pays], curve.lengths[pays] / PARTS
    total, before = 0.0, ends[0][pays]
    for part in range(PARTS):
        after = curve.at(begins + (part + 1) * lengths)[:, which_ones] / factor - 1.0
        mean = curve.mean(begins + (part + 0.5) * lengths, lengths)[:, which_ones] / factor - 1.0
        arch = bends * lengths[:, None] ** 2
        gained = np.where(-_top(-before, -after, bends, lengths[:, None]) >= 0.0, mean, 0.0)
        crossing = _top(before, after, bends, lengths[:, None]) > 0.0
        gained = np.where(crossing & (gained == 0.0), _positive_mean(before, after) + arch / 12.0, gained)
        total += float((gained * lengths[:, None] @ costs).sum())
        before = after
    return total


def _top(before: Vector, after: Vector, bend: Vector, length: Vector) -> Vector:
    """The most that a function of second derivative up to ``bend`` can be between its values at two ends."""
    arch = 0.5 * bend * length**2
    with np.errstate(divide="ignore", invalid="ignore"):
        within = 0.5 * (before + after) + 0.25 * arch + 0.25 * (after - before) ** 2 / arch
    return np.asarray(np.where(np.abs(after - before) < arch, within, np.maximum(before, after)))


def _positive_mean(before: Vector, after: Vector) -> Vector:
    """Mean of the positive part of a straight line from one value to another."""
    most, least = np.maximum(before, after), np.minimum(before, after)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = 0.5 * most**2 / (most - least)
    return np.asarray(np.where(most <= 0.0, 0.0, np.where(least >= 0.0, 0.5 * (most + least), crossing)))
