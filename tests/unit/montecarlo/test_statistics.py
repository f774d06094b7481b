"""Percentiles, exact and sketched; exact binomial intervals; the worst cases."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.special import betaincinv

from nutdamp.dispersion.binomial import binomial_interval, cases_to_show
from nutdamp.dispersion.statistics import Exact, Sketch, Worst

PROBABILITIES = np.array([0.0, 0.003, 0.5, 0.9, 0.95, 0.99, 0.997, 1.0])


def sketched(values: np.ndarray, portions: int = 1) -> Sketch:
    sketch = Sketch()
    for part in np.array_split(values, portions):
        sketch.add(part)
    return sketch


def test_exact_percentiles_are_those_of_numpy_and_leave_the_order_of_cases() -> None:
    values = np.random.default_rng(1).normal(size=1001)
    before = values.copy()
    assert np.array_equal(Exact(values).quantiles(PROBABILITIES), np.quantile(before, PROBABILITIES))
    assert np.array_equal(values, before)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e6])
def test_sketched_percentiles_are_right_to_a_thousandth(scale: float) -> None:
    generator, size = np.random.default_rng(2), 50_000
    for values in (
        scale * generator.lognormal(sigma=2.0, size=size),
        scale * generator.normal(size=size),
        -scale * generator.rayleigh(size=size),
    ):
        rough = sketched(values).quantiles(PROBABILITIES)
        assert rough == pytest.approx(np.quantile(values, PROBABILITIES, method="lower"), rel=0.0005)
        assert (rough[0], rough[-1]) == (values.min(), values.max())


def test_a_sketch_does_not_depend_on_portions_or_order() -> None:
    values = np.random.default_rng(3).normal(size=50_000)
    whole = sketched(values)
    for other in (sketched(values, 7), sketched(values[::-1].copy(), 3)):
        assert np.array_equal(whole.counts, other.counts)
        assert (whole.minimum, whole.maximum) == (other.minimum, other.maximum)


def test_a_sketch_takes_zeros_and_extremes() -> None:
    sketch = sketched(np.array([0.0, 0.0, -0.0, 1e-300, 1e300]))
    assert sketch.quantiles(np.array([0.5, 1.0])).tolist() == [0.0, 1e300]
    assert int(sketch.counts.sum()) == 5


def test_histograms_of_both_agree() -> None:
    values, edges = np.random.default_rng(4).rayleigh(size=100_000), np.linspace(0.0, 4.0, 21)
    exact, rough = Exact(values).histogram(edges), sketched(values).histogram(edges)
    assert exact.sum() == np.count_nonzero(values <= 4.0)
    # Each edge may be off by 0.05 % of its value x, where x times the density is 2/e at most.
    assert rough == pytest.approx(exact, abs=2 * 0.0005 * 2 / math.e * len(values))


def test_the_interval_at_the_ends() -> None:
    """0 and n of n in closed form, 1 - (α/2)^(1/n)."""
    for successes, trials, ends in (
        (0, 10, (0.0, 1.0 - 0.025**0.1)),
        (10, 10, (0.025**0.1, 1.0)),
        (1, 1, (0.025, 1.0)),
    ):
        assert binomial_interval(successes, trials) == pytest.approx(ends, rel=1e-12)


@pytest.mark.parametrize(("successes", "trials"), [(5, 10), (1, 100), (299, 300)])
def test_the_interval_leaves_half_the_doubt_on_each_side(successes: int, trials: int) -> None:
    """Its ends are where so many or more, or so few or fewer, have a probability of 2.5 %: by exact summation."""

    def at_most(count: int, p: float) -> float:
        # In integers: p as a fraction of a power of ten.
        part, whole = round(p * 10**15), 10**15
        terms = (math.comb(trials, k) * part**k * (whole - part) ** (trials - k) for k in range(count + 1))
        return float(Fraction(sum(terms), whole**trials))

    low, high = binomial_interval(successes, trials)
    assert 1.0 - at_most(successes - 1, low) == pytest.approx(0.025, rel=1e-9)
    assert at_most(successes, high) == pytest.approx(0.025, rel=1e-9)


@pytest.mark.parametrize("trials", [1, 2, 20, 1000, 10**6, 10**7])
def test_the_interval_is_that_of_scipy(trials: int) -> None:
    """Whose inverse of the incomplete beta function comes from Boost, and shares nothing with nutdamp's."""
    some = np.random.default_rng(trials).integers(trials + 1, size=4).tolist()
    within = 1e-12 + 1e-15 * trials
    for seen in {0, 1, trials // 2, round(0.997 * trials), trials - 1, trials, *some}:
        for confidence in (0.9, 0.95, 0.997):
            low, high = binomial_interval(seen, trials, confidence)
            tail, failures = 0.5 * (1.0 - confidence), trials - seen
            assert low == pytest.approx(betaincinv(seen, failures + 1, tail) if seen else 0.0, rel=within)
            assert high == pytest.approx(betaincinv(seen + 1, failures, 1.0 - tail) if failures else 1.0, rel=within)


def test_how_many_cases_it_takes_to_show_a_probability() -> None:
    few = cases_to_show(0.997)
    assert binomial_interval(few, few)[0] >= 0.997 > binomial_interval(few - 1, few - 1)[0]


def test_the_worst_cases_are_found_whatever_the_portions() -> None:
    severities = np.round(np.random.default_rng(5).normal(size=5_000), 2)  # with many ties
    order = sorted(range(5_000), key=lambda case: (-severities[case], case))[:40]
    for cuts in ([], [1], [10, 2000, 2001], list(range(0, 5000, 77))):
        worst = Worst(40)
        for begin, end in itertools.pairwise([0, *cuts, 5_000]):
            worst.add(begin, severities[begin:end])
        assert worst.cases.tolist() == order
        assert worst.severities.tolist() == [severities[case] for case in order]
