"""Correlated inputs: what is drawn, what it does to the outcome, and what is left as it was."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.stats import kstest, multivariate_normal, norm, triang, uniform
from support import dispersed
from support.cases import spread

from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.correlation import grouped, groups_of, mixing, normal_of, together, value_of
from nutdamp.dispersion.draws import BLOCK, Source
from nutdamp.dispersion.inputs import Input
from nutdamp.dispersion.study import Results, Study, run
from nutdamp.errors import BadRequest
from nutdamp.spacecraft import Spacecraft

KINDS = ("normal", "uniform", "triangular")


def an_input(name: str, kind: str = "normal", size: float = 1.0) -> Input:
    return Input(name, name, kind, size, 0.0, "")


def drawn(*inputs: Input, pairs: tuple[tuple[str, str, float], ...] = (), seed: int = 1) -> dict[str, np.ndarray]:
    draws, _ = Source(inputs, seed, lambda _: True, groups_of(pairs)).block(0)
    return {name: np.array(draw) for name, draw in draws.items()}


def correlated(body: Spacecraft, *pairs: tuple[str, str, float]) -> Spacecraft:
    assert body.dispersions is not None
    return replace(body, dispersions=replace(body.dispersions, correlation=pairs))


def test_normal_draws_have_the_correlation_and_the_others_stay_to_the_last_bit() -> None:
    inputs = [an_input(name, size=size) for name, size in zip("ABCD", (1.0, 2.0, 0.1, 3.0), strict=True)]
    plain = drawn(*inputs)
    found = drawn(*inputs, pairs=(("A", "B", 0.9), ("B", "C", -0.4)))
    matrix = np.corrcoef([found[name] for name in "ABCD"])
    expected = [[1.0, 0.9, 0.0, 0.0], [0.9, 1.0, -0.4, 0.0], [0.0, -0.4, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    assert matrix == pytest.approx(np.array(expected), abs=4.0 / math.sqrt(BLOCK))
    for name in "AD":  # the first of a group, and what is in none
        assert np.array_equal(found[name], plain[name])
    for entry in inputs:
        assert kstest(found[entry.name] / entry.size, norm.cdf).pvalue > 1e-3


@pytest.mark.parametrize("kinds", list(itertools.combinations_with_replacement(KINDS, 2)))
def test_each_keeps_its_distribution_and_the_correlation_of_values_is_known(kinds: tuple[str, str]) -> None:
    """The share of cases with both above a level is that of the bivariate normal law, which the copula is."""
    first, second = (an_input(name, kind, 2.0) for name, kind in zip("AB", kinds, strict=True))
    pair = ("A", "B", 0.8)
    draws = [drawn(first, second, pairs=(pair,), seed=seed) for seed in range(1, 9)]
    values = [np.concatenate([one[name] for one in draws]) for name in "AB"]
    laws = {"normal": norm(scale=2.0), "uniform": uniform(-2.0, 4.0), "triangular": triang(0.5, -2.0, 4.0)}
    for kind, value in zip(kinds, values, strict=True):
        assert kstest(value, laws[kind].cdf).pvalue > 1e-3
    both = np.mean(
        [(value > law.ppf(0.7)) for value, law in zip(values, (laws[kind] for kind in kinds), strict=True)], axis=0
    )
    law = multivariate_normal(cov=[[1.0, 0.8], [0.8, 1.0]])
    assert np.mean(both == 1.0) == pytest.approx(law.cdf([norm.ppf(0.3)] * 2), abs=0.006)
    matrix = mixing([first, second], grouped([pair]))
    assert (matrix @ matrix.T)[0, 1] == pytest.approx(np.corrcoef(values)[0, 1], abs=0.01)


@pytest.mark.deep
@spread("kinds", [("uniform", "uniform"), ("normal", "uniform"), ("uniform", "triangular")], quick=1)
def test_the_correlation_of_values_is_the_integral_over_both(kinds: tuple[str, str]) -> None:
    first, second = (an_input(name, kind) for name, kind in zip("AB", kinds, strict=True))
    rho = -0.6

    def integrand(y: float, x: float) -> float:
        other = rho * x + math.sqrt(1.0 - rho**2) * y
        product = value_of(first, np.array(x)) * value_of(second, np.array(other))
        return float(product) * float(norm.pdf(x) * norm.pdf(y))

    integral, _ = dblquad(integrand, -7.0, 7.0, -7.0, 7.0, epsabs=1e-6, epsrel=1e-6)
    matrix = mixing([first, second], grouped([("A", "B", rho)]))
    assert (matrix @ matrix.T)[0, 1] == pytest.approx(integral / (first.sigma * second.sigma), abs=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_normals_and_values_are_inverse(kind: str) -> None:
    entry, normals = an_input("A", kind, 0.3), np.linspace(-5.0, 5.0, 101)
    assert normal_of(entry, value_of(entry, normals)) == pytest.approx(normals, abs=1e-9)


def test_which_others_are_drawn_makes_no_difference() -> None:
    """A case is the same body for every schedule, whichever thrusters it fires."""
    inputs = [an_input(name) for name in ("A", "thrust T1", "thrust T2")]
    pairs = (("thrust T1", "A", 0.5), ("thrust T2", "thrust T1", 0.7))
    whole = drawn(*inputs, pairs=pairs)
    for name in ("A", "thrust T2"):
        alone = drawn(*(one for one in inputs if one.name == name), pairs=pairs)
        assert np.array_equal(alone[name], whole[name])


def test_a_case_drawn_again_is_correlated_too() -> None:
    inputs = [an_input("A"), an_input("B")]
    source = Source(inputs, 1, lambda draws: np.asarray(draws["A"]) > 0.0, groups_of([("A", "B", 0.95)]))
    draws, redrawn = source.block(0)
    assert len(redrawn) > BLOCK // 2
    residual = np.asarray(draws["B"]) - 0.95 * np.asarray(draws["A"])
    assert residual.mean() == pytest.approx(0.0, abs=0.01)
    assert residual.std() == pytest.approx(math.sqrt(1.0 - 0.95**2), rel=0.02)


def test_what_cannot_be_is_refused() -> None:
    pairs = (("A", "B", 0.9), ("B", "C", 0.9), ("A", "C", -0.5))
    with pytest.raises(BadRequest, match="the correlation of A, B, C is not positive definite"):
        groups_of(pairs)
    assert [group.names for group in groups_of([*pairs[:1], ("D", "E", 0.1)])] == [("A", "B"), ("D", "E")]


@pytest.mark.parametrize("rho", [0.95, -0.95, 0.0])
def test_the_budget_of_a_pair_is_the_variance_of_what_both_do_together(rho: float) -> None:
    """Of A and C with one relative size, most cancels where they are correlated: the motion knows only C/A."""
    study = dispersed.exact_two_pulse(0.02)
    body = study.model.spacecraft
    study = Study(Model(correlated(body, ("C", "A", rho)), study.model.schedule), seed=3)
    results = run(Results(study, 2 * BLOCK))
    first = study.first_order
    names = [entry.name for entry in first.inputs]
    pair = [names.index(name) for name in "AC"]
    effects = first.jacobian[:2, pair] * first.sigmas[pair]  # what one sigma of each does to the nutation
    variance = (effects**2).sum() + 2.0 * rho * (effects[:, 0] @ effects[:, 1])
    others = (first.effects("nutation")[[row for row in range(len(names)) if row not in pair]] ** 2).sum()
    share = variance / (variance + others)
    assert first.shares("nutation")[pair].sum() == pytest.approx(share, rel=1e-9)
    assert first.shares("nutation").sum() == pytest.approx(1.0, rel=1e-12)
    sampled = sum(results.shares[name]["nutation"] for name in "AC")
    assert sampled == pytest.approx(share, abs=0.03)
    vectors = results.early[:2, : results.done]
    assert np.sqrt(vectors.var(axis=1).sum()) == pytest.approx(first.sigma("nutation"), rel=0.03)
    assert together(first.inputs, study.model.groups)[0] == pair[::-1]
