"""Statistics of a study: output vectors, percentiles, intervals of shares, sensitivities.

First-order sensitivities are central differences of the cases as flown. The shares from the cases
are first-order Sobol indices, from the means of the outcome over equally likely intervals of each
input (the correlation ratio, Pearson 1905).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nutdamp.montecarlo.cases import DispersedCases, DispersedModel
from nutdamp.montecarlo.inputs import DispersedInput, Group, mixing
from nutdamp.montecarlo.propagated import Ends
from nutdamp.physics.attitude import angle_of_parts

SHOWN, CERTAIN = 1.9599639845400536, 4.891638475714779
"""Standard deviations of a normal distribution within which 95 % of it lie, and all but a
millionth.
"""


def share_interval(successes: int, trials: int, sigmas: float = SHOWN) -> tuple[float, float]:
    """Confidence interval of a probability from ``successes`` of ``trials``, Wilson 1927; all
    without a trial.
    """
    if trials == 0:
        return 0.0, 1.0
    share, spread = successes / trials, sigmas * sigmas / trials
    middle = (share + 0.5 * spread) / (1.0 + spread)
    half = math.sqrt(spread * (share * (1.0 - share) + 0.25 * spread)) / (1.0 + spread)
    low = middle - half if successes else 0.0
    return low, middle + half if successes < trials else 1.0


def cases_to_show(probability: float) -> int:
    """Fewest cases, all good, after which the lower end of `share_interval` reaches ``probability``
    (below 1).
    """
    return math.ceil(SHOWN * SHOWN * probability / (1.0 - probability))


Array = NDArray[np.float64]

VECTORS = {
    "nutation": slice(0, 2),
    "momentum_shift": slice(2, 5),
    "axis_error": slice(5, 8),
    "spin_change": slice(8, 9),
    "propellant": slice(9, 10),
    "spin": slice(10, 11),
}
"""Rows of `vectors` by output, and of the spin at the end."""

OUTPUTS = tuple(VECTORS)[:5]
"""In rad, rad, rad, rad/s and kg; the angles are called as the values of
`nutdamp.spacecraft.requirements.Part`.
"""
ANGLES = 3  # of the outputs, in front

ROWS = 11  # rows of `vectors`


def measure(model: DispersedModel, ends: Ends, count: int) -> Array:
    """The `OUTPUTS` (5, n) of ``count`` cases; propellant is NaN where unknown."""
    x, y, z = ends.momentum
    nutation = np.arctan2(np.hypot(x, y), model.spacecraft.sense * z)
    rows = (
        nutation if ends.nutation is None else ends.nutation,
        angle_of_parts(ends.before, ends.after),
        angle_of_parts(model.target, ends.pointed),
        ends.spin_change,
        np.nan if ends.propellant is None else ends.propellant,
    )
    return np.array([np.broadcast_to(row, count) for row in rows])


def vectors(model: DispersedModel, ends: Ends, count: int) -> Array:
    """Quantities (11, n) of ``count`` cases that are linear for small dispersions; `VECTORS` names
    the rows.

    Nutation is the transverse momentum over the axial one, the momentum shift the change of its
    direction, the axis error that direction less the target, in the body axes of t = 0.
    """
    before, after, pointed = (
        vector / np.linalg.norm(vector, axis=0)
        for vector in (ends.before, ends.after, ends.pointed)
    )
    rows = (
        *(ends.momentum[:2] * model.spacecraft.sense / ends.momentum[2]),
        *(after - before),
        *(pointed - model.target[:, None]),
        ends.spin_change,
        0.0 if ends.propellant is None else ends.propellant,
        ends.spin,
    )
    return np.array([np.broadcast_to(row, count) for row in rows])


EXACT_CASES = (
    1_000_000  # number of cases up to which every value is kept, and percentiles are exact
)

SHARPNESS = 13
"""Leading bits of the mantissa that the sketch tells apart: bins 0.012 % wide, so their middles are
0.006 % off.
"""

OCTAVES = 64  # octaves of the sketch: sizes from 2^-64 to 2^64; smaller ones count as zero
PORTION = 16_384  # values that are counted at once, so that they stay in the cache

_SIZES = 2 * OCTAVES << SHARPNESS
_SHIFT = 52 - SHARPNESS
_LOWEST = (1023 - OCTAVES) << SHARPNESS


class Exact:
    """All values, in the order of the cases."""

    def __init__(self, values: Array) -> None:
        self.values, self.minimum, self.maximum = values, float(values.min()), float(values.max())

    def quantiles(self, probabilities: Array) -> Array:
        """Values not exceeded with these probabilities (n,) from 0 to 1, to the last bit those of
        `numpy.quantile`.
        """
        places = np.asarray(probabilities) * (len(self.values) - 1)
        ranks = places.astype(int)
        share = places - ranks
        above = np.ceil(places).astype(int)
        ordered = np.partition(
            self.values, sorted({*ranks.tolist(), *above.tolist()})
        )  # np.unique loads numpy.ma
        low, high = ordered[ranks], ordered[above]
        return np.asarray(
            np.where(share < 0.5, low + (high - low) * share, high - (high - low) * (1.0 - share))
        )

    def sizes(self) -> Exact:
        """Distribution of the absolute values."""
        return Exact(np.abs(self.values))


class Sketch:
    """Counts of values by sign, power of two and leading bits of the mantissa: 16 MiB; the two
    extremes are exact.
    """

    def __init__(self) -> None:
        self.counts = np.zeros(2 * _SIZES, dtype=np.int64)
        self.minimum = math.inf
        self.maximum = -math.inf

    def add(self, values: Array) -> None:
        """Count more ``values`` (n,)."""
        for begin in range(0, len(values), PORTION):
            part = values[begin : begin + PORTION]
            bins = np.clip((np.abs(part).view(np.int64) >> _SHIFT) - _LOWEST, 0, _SIZES - 1)
            # Negative values lie below the middle, mirrored, so that bins ascend with the value.
            np.copyto(bins, -1 - bins, where=part < 0.0)
            lowest = int(bins.min())
            counts = np.bincount(bins - lowest)  # values lie close together: few bins to count
            self.counts[_SIZES + lowest : _SIZES + lowest + len(counts)] += counts
            self.minimum = min(self.minimum, float(part.min()))
            self.maximum = max(self.maximum, float(part.max()))

    def quantiles(self, probabilities: Array) -> Array:
        """Quantiles to 0.006 % of their value."""
        below = np.cumsum(self.counts)
        ranks = np.floor(np.asarray(probabilities) * (below[-1] - 1)).astype(np.int64)
        lows = ((np.arange(_SIZES, dtype=np.int64) + _LOWEST) << _SHIFT).view(
            np.float64
        )  # of the bins
        middles = lows * (1.0 + 0.5 ** (SHARPNESS + 1))
        middles[0] = 0.0
        values = np.concatenate([-middles[::-1], middles])[
            np.searchsorted(below, ranks, side="right")
        ]
        values = np.where(
            ranks == below[-1] - 1, self.maximum, np.where(ranks == 0, self.minimum, values)
        )
        return np.asarray(np.clip(values, self.minimum, self.maximum))

    def sizes(self) -> Sketch:
        """Distribution of the absolute values; its minimum is 0 where there are both signs."""
        folded = Sketch()
        folded.counts[_SIZES:] = self.counts[_SIZES:] + self.counts[:_SIZES][::-1]
        folded.minimum = max(self.minimum, -self.maximum, 0.0)
        folded.maximum = max(self.maximum, -self.minimum)
        return folded


Distribution = Exact | Sketch  # an output over all cases so far


class Worst:
    """Cases of greatest severity, in a fixed order: the most severe first,
    then the lower number.
    """

    def __init__(self, keep: int) -> None:
        self.keep, self.cases, self.severities = keep, np.empty(0, dtype=np.int64), np.empty(0)

    def add(self, first: int, severities: Array) -> None:
        """Consider the cases from number ``first`` on."""
        threshold = -math.inf
        spare = len(severities) - self.keep
        if len(self.cases) == self.keep:
            threshold = self.severities[-1]
        elif spare > 0:
            threshold = np.partition(severities, spare)[spare]
        rows = np.flatnonzero(~(severities < threshold))
        cases = np.concatenate([self.cases, first + rows])
        severities = np.concatenate([self.severities, severities[rows]])
        order = np.lexsort((cases, -severities))[: self.keep]
        self.cases, self.severities = cases[order], severities[order]


SHARE = 1e-3  # step of central differences, as a share of an input's size
CLASSES = 128  # intervals of an input over which the cases are averaged, at most
CLASS_SIZE = 32  # cases in each of them, at least


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """Outcome to first order about nominal values (and biases)."""

    inputs: tuple[DispersedInput, ...]
    jacobian: Array  # derivative of each row of `vectors` by each input, in its unit, (11, d)
    groups: tuple[Group, ...]  # of correlated inputs

    @property
    def sigmas(self) -> Array:
        """Standard deviations of the inputs, (d,)."""
        return np.array([entry.sigma for entry in self.inputs])

    def independent(self, output: str) -> Array:
        """Effect of one sigma of each input on that vector, (m, d); of correlated ones beyond those
        before it.
        """
        scaled = (self.jacobian * self.sigmas)[VECTORS[output]]
        return np.asarray(scaled @ mixing(self.inputs, self.groups)) if self.groups else scaled

    def sigma(self, output: str) -> float:
        """Root mean square of that vector about its mean, rad (rad/s, kg)."""
        scaled = self.independent(output)
        return float(np.sqrt(np.trace(scaled @ scaled.T)))

    def effects(self, output: str) -> Array:
        """Effect of each input alone on ``output``, (d,): one sigma of it, or all of a bias."""
        sizes = np.array([entry.sigma or abs(entry.size) for entry in self.inputs])
        return np.asarray(np.linalg.norm((self.jacobian * sizes)[VECTORS[output]], axis=0))

    def shares(self, output: str) -> Array:
        """Share of each input in the variance of ``output``, (d,), as of `independent`; zero where
        nothing varies.
        """
        squares = (self.independent(output) ** 2).sum(axis=0)
        return np.asarray(squares / (squares.sum() or 1.0))


# change of a row of `vectors` by two steps, rad, rad/s or kg, below which it is rounding: an
# attitude changes no nutation, and left 1e-15
ROUNDING = 1e-12


def first_order(model: DispersedModel, fly: Callable[[DispersedCases], Ends]) -> FirstOrder:
    """Derivatives about nominal values (and biases) of the model that ``fly`` flies, by central
    differences: each input in turn is off by a step of either sign.
    """
    inputs = model.inputs.drawn
    if not inputs:
        return FirstOrder(inputs, np.empty((ROWS, 0)), model.groups)
    draws, steps = stepped(inputs)
    out = vectors(model, fly(model.cases(draws)), 2 * len(inputs))
    apart = out[:, ::2] - out[:, 1::2]
    apart[np.abs(apart) < ROUNDING] = 0.0
    return FirstOrder(inputs, 0.5 * apart / steps, model.groups)


def stepped(inputs: Sequence[DispersedInput]) -> tuple[dict[str, Array], Array]:
    """Draws (2 d,) about nominal values and biases for central differences: each of d inputs in
    turn is off by a step up, then down; and the steps (d,), in the units of the inputs.
    """
    steps = np.array([SHARE * abs(entry.size) for entry in inputs])
    draws = {}
    for index, entry in enumerate(inputs):
        draws[entry.name] = np.full(2 * len(inputs), entry.size if entry.kind == "bias" else 0.0)
        draws[entry.name][2 * index : 2 * index + 2] += steps[index], -steps[index]
    return draws, steps


def sampled_shares(draws: Mapping[str, Array], outcome: Array) -> dict[str, dict[str, float]]:
    """First-order Sobol index of each input, by output, from ``draws`` (n,) and the outcome (11, n)
    of `vectors`.

    What the averaging over few cases adds by chance, (classes - 1)/n of the variance, is taken off;
    nothing is below 0.
    """
    count = outcome.shape[1]
    shares = dict[str, dict[str, float]]()
    centred = outcome - outcome.mean(axis=1, keepdims=True)
    variances = {name: float((centred[rows] ** 2).sum()) for name, rows in VECTORS.items()}
    classes = min(CLASSES, max(count // CLASS_SIZE, 1))
    ranks = np.linspace(0, count, classes + 1).astype(int)[1:-1]
    for name, draw in draws.items():
        order = np.argsort(draw)
        sorted_ = draw[order]
        starts = np.append(0, np.searchsorted(sorted_, sorted_[ranks]))
        starts = starts[np.diff(starts, append=count) > 0]  # equal draws are of one class
        sums = np.add.reduceat(centred.take(order, axis=1), starts, axis=1)
        between = (sums**2 / np.diff(starts, append=count)).sum(axis=1)
        chance = (len(starts) - 1) / count
        shares[name] = dict.fromkeys(VECTORS, 0.0)
        for output, rows in VECTORS.items():
            if variances[output] > 0.0 and chance < 1.0:
                share = float(between[rows].sum()) / variances[output]
                shares[name][output] = max(0.0, (share - chance) / (1.0 - chance))
    return shares


def correlated_shares(draws: Mapping[str, Array], values: Array) -> dict[str, float]:
    """Squared correlation of each input's ``draws`` (n,) with ``values`` (n,), less what chance
    adds; for angles to cones and loops, which have no derivatives. Empty where the values do not
    vary.
    """
    if len(values) < 3 or np.ptp(values) <= 1e-12 * np.abs(values).max():
        return {}
    chance = 1.0 / (len(values) - 1)
    squares = {name: float(np.corrcoef(draw, values)[0, 1] ** 2) for name, draw in draws.items()}
    return {name: max((square - chance) / (1.0 - chance), 0.0) for name, square in squares.items()}
