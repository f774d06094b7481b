"""Which tolerance matters: first-order sensitivities of the outcome, and the shares that the drawn cases show.

First order is analytic: the kernel itself runs on numbers with an infinitesimal imaginary part (complex-step
differentiation, Squire & Trapp 1998), which carries each input's derivative through every operation to rounding,
without differences of nearby numbers. The shares from the cases are first-order Sobol indices, from the means of the
outcome over equally likely intervals of each input (the correlation ratio, Pearson 1905): they see curvature too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.cases import DispersedCases, Model
from nutdamp.dispersion.correlation import mixing
from nutdamp.dispersion.inputs import Input
from nutdamp.dispersion.kernel import ClosedForm, Ends
from nutdamp.dispersion.outputs import OUTPUTS, ROWS, VECTORS, vectors

Array = NDArray[np.float64]

STEP = 1e-30
"""Imaginary step, as a share of an input's size: nothing is subtracted, so nothing is lost however small it is."""

SHARE = 1e-3
"""Of an input's size, by which it is changed to either side where differences are taken."""

CLASSES = 128
"""Intervals of an input over which the cases are averaged, at most."""

CLASS_SIZE = 32
"""Cases in each of them, at least."""


@dataclass(frozen=True, eq=False)
class FirstOrder:
    """The outcome to first order about nominal values (and biases).

    ``jacobian`` (10, d): derivative of each row of `nutdamp.dispersion.outputs.vectors` by each drawn input, in its
    unit; ``sigmas`` (d,) standard deviations of the inputs. ``mixing`` (d, d), times its transpose, is their
    correlation; None where they are independent.
    """

    inputs: tuple[Input, ...]
    jacobian: Array
    mixing: Array | None = None

    @property
    def sigmas(self) -> Array:
        """Standard deviations of the inputs, (d,)."""
        return np.array([entry.sigma for entry in self.inputs])

    def covariance(self, output: str) -> Array:
        """Covariance of the vector behind ``output``."""
        scaled = self.independent(output)
        return np.asarray(scaled @ scaled.T)

    def independent(self, output: str) -> Array:
        """What one sigma of each input adds to that vector, (m, d); of correlated ones beyond those before it."""
        scaled = (self.jacobian * self.sigmas)[VECTORS[output]]
        return scaled if self.mixing is None else np.asarray(scaled @ self.mixing)

    def sigma(self, output: str) -> float:
        """Root mean square of that vector about its mean, rad (rad/s, kg)."""
        return float(np.sqrt(np.trace(self.covariance(output))))

    def effects(self, output: str) -> Array:
        """What each input alone does to ``output``, (d,): one sigma of it, or all of a bias."""
        sizes = np.array([entry.sigma or abs(entry.size) for entry in self.inputs])
        return np.asarray(np.linalg.norm((self.jacobian * sizes)[VECTORS[output]], axis=0))

    def shares(self, output: str) -> Array:
        """Share of each input in the variance of ``output``, (d,); all zero where nothing varies.

        Of inputs that are correlated each has what it adds to those before it; the sum over them is the group's.
        """
        squares = (self.independent(output) ** 2).sum(axis=0)
        total = squares.sum()
        return np.asarray(squares / total if total > 0.0 else squares)


ALIKE = 0.01
"""Share by which the derivatives of the closed form may differ from those of what is flown, and be used for them."""


def as_flown(model: Model, fly: Callable[[DispersedCases], Ends]) -> FirstOrder:
    """The derivatives of what ``fly`` flies: those of the closed form where they agree, for they have no rounding.

    By output and input; else central differences.
    """
    flown = by_differences(model, fly)
    if model.schedule.blocks or not flown.inputs:
        return flown
    closed, jacobian = first_order(model).jacobian, flown.jacobian.copy()
    for rows in VECTORS.values():
        apart, size = (np.linalg.norm(one[rows], axis=0) for one in (closed - jacobian, jacobian))
        alike = apart <= ALIKE * size
        jacobian[rows, alike] = closed[rows, alike]
    return FirstOrder(flown.inputs, jacobian, flown.mixing)


def by_differences(model: Model, fly: Callable[[DispersedCases], Ends]) -> FirstOrder:
    """The same by central differences of what ``fly`` flies, which no closed form has: blocks fired by Sun pulses."""
    inputs = model.inputs.drawn
    steps = np.array([SHARE * abs(entry.size) for entry in inputs])
    draws: dict[str, Array | float] = {}
    for index, entry in enumerate(inputs):
        draw = np.full(2 * len(inputs), entry.size if entry.kind == "bias" else 0.0)
        draw[2 * index : 2 * index + 2] += steps[index], -steps[index]
        draws[entry.name] = draw
    out = np.empty((ROWS, 2 * len(inputs)))
    if inputs:
        vectors(model, fly(model.cases(draws)), out)
    return FirstOrder(inputs, 0.5 * (out[:, ::2] - out[:, 1::2]) / steps, _mixing(model))


def first_order(model: Model) -> FirstOrder:
    """Derivatives of the outcome by every drawn input, by the closed form of ``model``."""
    inputs = model.inputs.drawn
    jacobian = np.zeros((ROWS, len(inputs)))
    if inputs:
        steps = np.array([STEP * abs(entry.size) for entry in inputs])
        draws: dict[str, NDArray[np.complex128]] = {}
        for index, entry in enumerate(inputs):
            draws[entry.name] = np.full(len(inputs), entry.size if entry.kind == "bias" else 0.0, dtype=complex)
            draws[entry.name][index] += 1j * steps[index]
        out = np.empty((ROWS, len(inputs)), dtype=complex)
        vectors(model, ClosedForm(model)(model.cases(draws)), out)  # type: ignore[arg-type]
        jacobian = out.imag / steps
    return FirstOrder(inputs, jacobian, _mixing(model))


def _mixing(model: Model) -> Array | None:
    return mixing(model.inputs.drawn, model.groups) if model.groups else None


def sampled_shares(draws: Mapping[str, Array], outcome: Array) -> dict[str, dict[str, float]]:
    """First-order Sobol index of each input, by output, from n cases.

    ``draws`` (n,) by input; ``outcome`` (10, n) as `outputs.vectors` gives it. What the averaging over few cases adds
    by chance, (classes - 1)/n of the variance, is taken off; nothing is below zero.
    """
    count = outcome.shape[1]
    centred = outcome - outcome.mean(axis=1, keepdims=True)
    variances = {name: float((centred[rows] ** 2).sum()) for name, rows in VECTORS.items()}
    found: dict[str, dict[str, float]] = {}
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
        found[name] = {
            output: max(0.0, (float(between[VECTORS[output]].sum()) / variances[output] - chance) / (1.0 - chance))
            if variances[output] > 0.0 and chance < 1.0
            else 0.0
            for output in OUTPUTS
        }
    return found
