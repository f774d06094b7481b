"""When a sensor first shows more, or less, than a threshold, by its noise: chances of samples along a coast."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from nutdamp.loop.transfer import Transfer
from nutdamp.spacecraft import Vector

FINE = 1500
"""Sizes of z for which it is worked out how likely an event is, far off and again near the threshold."""

FARTHEST = 1e-12
"""Share of a threshold below which a nutation is none."""

REACH = 12.0
"""Sigmas of noise within which sizes lie closer together."""

PHASES = 16
"""Directions of z against the bias over which a chance is averaged."""

CURVED = 12.0
"""Sigmas within which a size is so small that noise across it counts."""


class Odds:
    """The chance that an estimate shows at least ``limit`` rad/s, or at most that (``below``), while z grows.

    ``growth`` (1/s) is that of z. The chances of the samples add up along a coast: an event is there where the sum has
    come to an exponential number.
    """

    def __init__(self, seen: Transfer, limit: float, growth: float, *, below: bool) -> None:
        gain, offset = abs(seen.direct), abs(seen.offset)
        reach = offset + REACH * seen.sigma + 1e-6 * limit
        wide = np.geomspace(FARTHEST * (limit + reach), 100.0 * (limit + reach), FINE)
        near = limit + reach * np.linspace(-1.0, 1.0, FINE)
        shown = np.union1d(wide, near[near > wide[0]])
        sigma = max(seen.sigma, 1e-9 * limit, 1e-300)
        turns = np.exp(2j * np.pi * np.arange(PHASES) / PHASES)
        sizes = np.abs(shown[:, None] * turns + seen.offset)
        chance = _exceeds(limit / sigma, sizes / sigma)
        chance = 1.0 - chance if below else chance
        chance = (chance * _clustered(seen.fresh, np.abs(limit - sizes) / sigma)).mean(axis=1)
        expected = -np.log1p(-np.minimum(chance, 1.0 - 1e-15)) / (growth * seen.step)
        self.sizes = np.log(shown / gain)
        pieces = 0.5 * (expected[1:] + expected[:-1]) * np.diff(self.sizes)
        self.sum = np.concatenate([[0.0], np.cumsum(pieces)])

    def size(self, now: Any, drawn: Any) -> Any:
        """|z| (rad/s) at which the event comes, from ``now`` on, by exponential numbers; infinite where it does not."""
        reached = np.interp(np.log(now), self.sizes, self.sum) + drawn
        found = np.maximum(np.exp(np.interp(reached, self.sum, self.sizes)), now)
        return np.where(reached > self.sum[-1], math.inf, found)


def _clustered(fresh: float, apart: Vector) -> Any:
    """Share of the samples beyond a threshold, ``apart`` sigmas off, that are the first of a cluster of such.

    Where ``fresh`` is the share of noise that is new in each sample: x²/2 ν(x), x = apart sqrt(2 fresh), as of a random
    walk with drift, ν(x) = (2/x) (Φ(x/2) - 1/2) / (x/2 Φ(x/2) + φ(x/2)) (Siegmund and Yakir 2007).
    """
    from scipy.special import ndtr

    if fresh > 0.5:
        return 1.0
    half = 0.5 * np.maximum(apart, 1.0) * math.sqrt(2.0 * fresh)
    below = ndtr(half)
    return 2.0 * half * (below - 0.5) / (half * below + np.exp(-0.5 * half * half) / math.sqrt(2.0 * math.pi))


def _exceeds(limit: float, shown: Vector) -> Vector:
    """Chance that |``shown`` + n| >= ``limit`` with n normal, of one sigma in each direction (Rice's distribution)."""
    from scipy.special import chndtr, ndtr

    found, near = np.asarray(ndtr(shown - limit)), shown < CURVED
    if limit < 3.0 * CURVED and near.any():
        found[near] = 1.0 - chndtr(limit * limit, 2.0, shown[near] ** 2)
    return np.clip(found, 0.0, 1.0)
