"""Inputs that vary together: a Gaussian copula over the draws of each.

Each input of a group is a monotonic function of a standard normal number, and the correlation given is that of these
numbers (Nelsen 2006, 5.2): of two normal inputs it is their own, of two uniform ones theirs is (6/π) asin(ρ/2).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.inputs import Input
from nutdamp.errors import BadRequest

Array = NDArray[np.float64]
Pair = tuple[str, str, float]
"""Names of two inputs, and their correlation."""

NODES = 96
"""Of the quadrature by which the correlation of values that are not normal is worked out."""


class Group(NamedTuple):
    """Inputs that are correlated with one another, directly or through others: ``matrix`` (m, m) of their normals."""

    names: tuple[str, ...]
    matrix: Array

    @property
    def factor(self) -> Array:
        """L (m, m), lower: L times independent standard normals has this correlation. The first stays as it is."""
        return np.asarray(np.linalg.cholesky(self.matrix))

    def among(self, names: Iterable[str]) -> Group:
        """Those of them that are among ``names``."""
        rows = [row for row, name in enumerate(self.names) if name in set(names)]
        return Group(tuple(self.names[row] for row in rows), self.matrix[np.ix_(rows, rows)])

    def mixed(self, independent: Sequence[Array]) -> list[Array]:
        """Correlated standard normals (m, n) of independent ones; each sum is taken in the same order for any n."""
        return [
            sum((entry * independent[at] for at, entry in enumerate(row[: index + 1])), np.zeros(()))
            for index, row in enumerate(self.factor.tolist())
        ]


def positive_definite(group: Group) -> bool:
    """Whether there are numbers with these correlations, none of which follows from the others."""
    try:
        return bool(np.all(np.isfinite(group.factor)))
    except np.linalg.LinAlgError:
        return False


def grouped(pairs: Iterable[Pair]) -> tuple[Group, ...]:
    """The groups that ``pairs`` connect, names in the order of their first pair."""
    pairs = list(pairs)
    members: list[list[str]] = []
    for first, second, _ in pairs:
        touched = [one for one in members if first in one or second in one]
        members = [one for one in members if one not in touched]
        members.append(list(dict.fromkeys([*(name for one in touched for name in one), first, second])))
    groups = []
    for names in members:
        matrix = np.eye(len(names))
        for first, second, size in pairs:
            if first in names:
                row, column = names.index(first), names.index(second)
                matrix[row, column] = matrix[column, row] = size
        groups.append(Group(tuple(names), matrix))
    return tuple(groups)


def groups_of(pairs: Iterable[Pair]) -> tuple[Group, ...]:
    """The same; raises BadRequest where they are not positive definite."""
    found = grouped(pairs)
    for group in found:
        if not positive_definite(group):
            raise BadRequest(f"the correlation of {', '.join(group.names)} is not positive definite")
    return found


def value_of(entry: Input, normal: Array) -> Array:
    """The deviation that belongs to a standard ``normal`` number, at the same level of its distribution."""
    if entry.kind == "normal":
        return entry.size * normal
    from scipy.special import ndtr  # few files have correlated inputs that are not normal

    if entry.kind == "uniform":
        return np.asarray(entry.size * (2.0 * ndtr(normal) - 1.0))
    return np.asarray(entry.size * np.sign(normal) * (1.0 - np.sqrt(2.0 * ndtr(-np.abs(normal)))))


def normal_of(entry: Input, value: Array) -> Array:
    """The inverse of `value_of`."""
    if entry.kind == "normal":
        return value / entry.size
    from scipy.special import ndtri  # as above

    share = value / entry.size
    below = 0.5 * (1.0 - np.abs(share)) if entry.kind == "uniform" else 0.5 * (1.0 - np.abs(share)) ** 2
    return np.asarray(-np.sign(share) * ndtri(np.maximum(below, np.finfo(float).tiny)))


def mixing(inputs: Sequence[Input], groups: Iterable[Group]) -> Array:
    """M (d, d): M Mᵀ is the correlation of the values of ``inputs``; the unit matrix where none is correlated.

    In a group, column k is what input k adds to those before it.
    """
    found, rows = np.eye(len(inputs)), {entry.name: row for row, entry in enumerate(inputs) if entry.sigma > 0.0}
    for group in groups:
        present = group.among(rows)
        members = [inputs[rows[name]] for name in present.names]
        if len(members) < 2:
            continue
        matrix = [
            [_of_values(one, other, rho) for other, rho in zip(members, line, strict=True)]
            for one, line in zip(members, present.matrix.tolist(), strict=True)
        ]
        at = [rows[name] for name in present.names]
        found[np.ix_(at, at)] = np.linalg.cholesky(np.array(matrix))
    return found


def independent(draws: Mapping[str, Array], inputs: Iterable[Input], groups: Iterable[Group]) -> dict[str, Array]:
    """The draws, where those of a group are the independent normals behind them: what each adds to those before it."""
    named, found = {entry.name: entry for entry in inputs}, dict(draws)
    for group in groups:
        present = group.among(draws)
        if len(present.names) < 2:
            continue
        normals = np.array([normal_of(named[name], draws[name]) for name in present.names])
        found.update(zip(present.names, np.linalg.solve(present.factor, normals), strict=True))
    return found


def together(inputs: Sequence[Input], groups: Iterable[Group]) -> list[list[int]]:
    """Rows of ``inputs``, those of a group in one list, in order."""
    rows = {entry.name: row for row, entry in enumerate(inputs) if entry.sigma > 0.0}
    found = [[rows[name] for name in group.among(rows).names] for group in groups]
    taken = {row for one in found for row in one}
    return sorted([one for one in found if one] + [[row] for row in range(len(inputs)) if row not in taken], key=min)


def _of_values(first: Input, second: Input, rho: float) -> float:
    """Correlation of the values of two inputs whose normals have ``rho``, by Gauss-Hermite quadrature."""
    if first.name == second.name:
        return 1.0
    if first.kind == second.kind == "normal":
        return rho
    if first.kind == second.kind == "uniform":
        return 6.0 / math.pi * math.asin(0.5 * rho)
    nodes, weights = _nodes()
    other = rho * nodes[:, None] + math.sqrt(1.0 - rho * rho) * nodes
    mean = weights @ (value_of(first, nodes)[:, None] * value_of(second, other)) @ weights
    return float(mean / (first.sigma * second.sigma))


@cache
def _nodes() -> tuple[Array, Array]:
    """Of the standard normal distribution."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    return nodes, weights / math.sqrt(2.0 * math.pi)
