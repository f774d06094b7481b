"""The exact interval for a probability of which so many of so many cases were seen; by the standard library alone."""

from __future__ import annotations

import math

STEPS = 200
"""Newton steps and halvings in which a quantile is found, at most; half a dozen do mostly."""

ACCURACY = 4e-16
"""Relative change of a quantile, or of a continued fraction, that is rounding."""

TINY = 1e-300
"""In place of a denominator of zero."""

LARGE = 20.0
"""Argument from which Stirling's series of the logarithm of Γ is exact to rounding."""


def binomial_interval(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """The exact interval for a probability of which ``successes`` of ``trials`` were seen, Clopper & Pearson 1934.

    It holds the true probability at least as often as ``confidence`` says, whatever that probability is.
    """
    tail = 0.5 * (1.0 - confidence)
    failures = trials - successes
    low = 0.0 if successes == 0 else _quantile(successes, failures + 1, tail, upper=False)
    high = 1.0 if failures == 0 else _quantile(successes + 1, failures, tail, upper=True)
    return low, high


def cases_to_show(probability: float, confidence: float = 0.95) -> int:
    """Fewest cases, all good, after which the lower end of `binomial_interval` reaches ``probability``."""
    return math.ceil(math.log(0.5 * (1.0 - confidence)) / math.log(probability))


def _quantile(a: float, b: float, tail: float, *, upper: bool) -> float:
    """Where a beta distribution has ``tail`` below (``upper``: above): by Newton's steps, halving where they fail."""
    low, high, x = 0.0, 1.0, a / (a + b)
    for _ in range(STEPS):
        below, above, density = _beta(a, b, x)
        excess = tail - above if upper else below - tail
        low, high = (low, x) if excess > 0.0 else (x, high)
        new = x - excess / density if density > 0.0 else low
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - x) <= ACCURACY * x:
            return new
        x = new
    return x


def _beta(a: float, b: float, x: float) -> tuple[float, float, float]:
    """Shares of a beta distribution below and above ``x``, and its density (Abramowitz & Stegun 26.5.1, 26.5.8)."""
    n = a + b
    off = x * n - a
    power = a * _logarithm(off / a, x * n / a) + b * _logarithm(-off / b, (1.0 - x) * n / b)
    kernel = math.exp(power + 0.5 * math.log(a * b / (2.0 * math.pi * n)) + _rest(n) - _rest(a) - _rest(b))
    if x * (n + 2.0) < a + 1.0:
        below = kernel / a * _fraction(a, b, x)
        return below, 1.0 - below, kernel / (x * (1.0 - x))
    above = kernel / b * _fraction(b, a, 1.0 - x)
    return 1.0 - above, above, kernel / (x * (1.0 - x))


def _logarithm(more: float, ratio: float) -> float:
    """The logarithm of a ``ratio`` that is 1 + ``more``, whichever of the two is the more exact."""
    return math.log1p(more) if abs(more) < 0.5 else math.log(ratio)


def _rest(z: float) -> float:
    """What Stirling's formula lacks: ln Γ(z) - (z - 1/2) ln z + z - ln(2π)/2."""
    if z < LARGE:
        return math.lgamma(z) - (z - 0.5) * math.log(z) + z - 0.5 * math.log(2.0 * math.pi)
    square = 1.0 / (z * z)
    return (1 / 12 - square * (1 / 360 - square * (1 / 1260 - square * (1 / 1680 - square / 1188)))) / z


def _fraction(a: float, b: float, x: float) -> float:
    """The continued fraction of the incomplete beta function, by Lentz's method; it takes some √(a + b) terms."""
    c, d = 1.0, 1.0 / _not_zero(1.0 - (a + b) * x / (a + 1.0))
    value = d
    for m in range(1, 100 + 20 * math.isqrt(int(a + b))):
        for term in (
            m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m)),
            -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0)),
        ):
            c, d = _not_zero(1.0 + term / c), 1.0 / _not_zero(1.0 + term * d)
            value *= c * d
        if abs(c * d - 1.0) <= ACCURACY:
            break
    return value


def _not_zero(value: float) -> float:
    return value if abs(value) > TINY else TINY
