"""Distributions of an output over many cases: exact while they fit, in constant memory beyond.

Everything here is the same in whatever order or portions the cases come: exact values have their places, and the
sketch only counts.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EXACT_CASES = 10_000_000
"""Up to so many cases every value is kept, and percentiles are exact."""

SHARPNESS = 10
"""Leading bits of the mantissa that the sketch tells apart: bins 0.1 % wide, so their middles are 0.05 % off."""

OCTAVES = 64
"""The sketch tells sizes from 2^-64 to 2^64 apart; what is smaller counts as zero."""

PORTION = 16_384
"""Values that are counted at once, so that they stay in the cache."""

_SIZES = 2 * OCTAVES << SHARPNESS
_SHIFT = 52 - SHARPNESS
_LOWEST = (1023 - OCTAVES) << SHARPNESS


class Exact:
    """All values, in the order of the cases."""

    def __init__(self, values: Array) -> None:
        self.values = values

    @property
    def minimum(self) -> float:
        """Smallest value."""
        return float(self.values.min())

    @property
    def maximum(self) -> float:
        """Largest value."""
        return float(self.values.max())

    def quantiles(self, probabilities: Array) -> Array:
        """Values not exceeded with these probabilities (n,) from 0 to 1, to the last bit those of `numpy.quantile`.

        Each divides what lies above the last one.
        """
        places = np.asarray(probabilities) * (len(self.values) - 1)
        found = np.empty(len(places))
        rest, first = self.values.copy(), 0  # what lies above the last quantile, and its rank
        for index in np.argsort(places).tolist():
            rank = int(places[index])
            rest.partition(rank - first)
            rest, first = rest[rank - first :], rank
            share = places[index] - rank
            low, high = rest[0], rest[1:].min() if share else rest[0]
            found[index] = low + (high - low) * share if share < 0.5 else high - (high - low) * (1.0 - share)
        return found

    def histogram(self, edges: Array) -> Array:
        """Cases between each two of ``edges``."""
        return np.histogram(self.values, edges)[0].astype(float)


class Sketch:
    """Counts of values by sign, power of two and leading bits of the mantissa: 2 MiB whatever the number of cases.

    Quantiles are right to 0.05 % of their value; minimum and maximum are exact.
    """

    def __init__(self) -> None:
        self.counts = np.zeros(2 * _SIZES, dtype=np.int64)
        self.minimum, self.maximum = math.inf, -math.inf

    def add(self, values: Array) -> None:
        """Count more ``values`` (n,)."""
        for begin in range(0, len(values), PORTION):
            part = values[begin : begin + PORTION]
            bins = (np.abs(part).view(np.int64) >> _SHIFT) - _LOWEST
            np.clip(bins, 0, _SIZES - 1, out=bins)
            least, most = float(part.min()), float(part.max())
            if least < 0.0:
                # Negative values lie below the middle, mirrored, so that bins ascend with the value.
                np.copyto(bins, -1 - bins, where=part < 0.0)
            bins += _SIZES
            lowest = int(bins.min())
            found = np.bincount(bins - lowest)  # values lie close together: few bins to count
            self.counts[lowest : lowest + len(found)] += found
            self.minimum, self.maximum = min(self.minimum, least), max(self.maximum, most)

    def quantiles(self, probabilities: Array) -> Array:
        """Quantiles to 0.05 %."""
        below = np.cumsum(self.counts)
        ranks = np.floor(np.asarray(probabilities) * (below[-1] - 1)).astype(np.int64)
        values = _middles()[np.searchsorted(below, ranks, side="right")]
        values = np.where(ranks == below[-1] - 1, self.maximum, np.where(ranks == 0, self.minimum, values))
        return np.asarray(np.clip(values, self.minimum, self.maximum))

    def histogram(self, edges: Array) -> Array:
        """Cases between each two of ``edges``."""
        return np.histogram(_middles(), edges, weights=self.counts.astype(float))[0]


Distribution = Exact | Sketch
"""An output over all cases so far."""


def _middles() -> Array:
    """The value that represents each bin of a sketch."""
    low = ((np.arange(_SIZES, dtype=np.int64) + _LOWEST) << _SHIFT).view(np.float64)
    sizes = low * (1.0 + 0.5 ** (SHARPNESS + 1))
    sizes[0] = 0.0
    return np.concatenate([-sizes[::-1], sizes])


class Worst:
    """The cases of greatest severity, in a fixed order: the most severe first, then the lower number."""

    def __init__(self, keep: int) -> None:
        self.keep = keep
        self.cases = np.empty(0, dtype=np.int64)
        self.severities = np.empty(0)

    def add(self, first: int, severities: Array) -> None:
        """Consider the cases from number ``first`` on."""
        if len(self.cases) == self.keep:
            rows = np.flatnonzero(severities > self.severities[-1])
        elif len(severities) > self.keep:
            least = np.partition(severities, len(severities) - self.keep)[len(severities) - self.keep]
            rows = np.flatnonzero(severities >= least)
        else:
            rows = np.arange(len(severities))
        cases = np.concatenate([self.cases, first + rows])
        severities = np.concatenate([self.severities, severities[rows]])
        order = np.lexsort((cases, -severities))[: self.keep]
        self.cases, self.severities = cases[order], severities[order]
