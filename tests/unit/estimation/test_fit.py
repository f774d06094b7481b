"""Estimates against bodies that are known, by records that DOP853 made: what is claimed holds as
often as it should.
"""

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import binom, chi2
from support.builders import present, spinner
from support.cases import weekly
from support.synthetic import gyro_case
from support.telemetry_kinds import KINDS, telemetry

from nutdamp.estimation.fit import fit
from nutdamp.estimation.model import Model
from nutdamp.estimation.parameters import GYROS, Vector, moments, prior, quantisation
from nutdamp.estimation.search import Fit, residuals, search, units_of
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance


@pytest.mark.parametrize("rho", [0.0, 0.8, -0.5])
def test_the_prior_is_the_covariance_of_the_file(rho: float) -> None:
    """In A and C/A, to first order that of A and C with its correlation; its centre is that of the
    file.
    """
    given = Dispersions(
        A=Tolerance("normal", 0.02, True),
        C=Tolerance("normal", 0.01, True),
        correlation=(("A", "C", rho),),
    )
    body = replace(spinner(A=120.0, C=80.0), dispersions=given)
    made = list(moments(body))
    rows, values = prior(body, made)
    assert [one.name for one in made] == ["A", "C/A"]
    assert np.linalg.solve(rows, values) == pytest.approx([120.0, 80.0 / 120.0], rel=1e-12)
    of_moments = np.array([[1.0, 0.0], [80.0 / 120.0, 120.0]])  # derivatives of A and C
    covariance = of_moments @ np.linalg.inv(rows.T @ rows) @ of_moments.T
    expected = np.array([[2.4**2, rho * 2.4 * 0.8], [rho * 2.4 * 0.8, 0.8**2]])
    assert covariance == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert made[1].prior == pytest.approx(
        80 / 120 * math.sqrt(0.02**2 + 0.01**2 - 2 * rho * 0.02 * 0.01), rel=1e-12
    )


def off_by(fitted: Fit, truth: dict[str, float]) -> Vector:
    """The estimates less the true values."""
    named = truth | {"C/A": truth["C"] / truth["A"]}
    return np.asarray(fitted.values - [named[one.name] for one in fitted.model.parameters])


def of_gyros(seed: int) -> tuple[bool, float, float]:
    """Of one record: whether the true values are in the 95 % region; C/A off, over its sigma and
    over the bound.
    """
    case = gyro_case(seed)
    fitted = fit(case.spacecraft, case.record)
    assert not fitted.model.unequal
    off = off_by(fitted, case.truth)
    at = present(fitted.index("C/A"))
    inside = off @ np.linalg.solve(fitted.covariance, off) < chi2.ppf(0.95, len(off))
    # The Cramér-Rao bound at the true values, with the true noise, steps included.
    noise = np.hypot(
        case.noise,
        np.array([quantisation(case.record.signals[name]) for name in GYROS]) / math.sqrt(12.0),
    )
    slopes = derivatives(fitted, fitted.values - off) / noise[fitted.model.signal][:, None]
    rows = np.concatenate([slopes, fitted.model.prior[0]])
    scale = np.linalg.norm(rows, axis=0)
    bound = math.sqrt(float(np.linalg.inv((rows / scale).T @ (rows / scale))[at, at])) / scale[at]
    return bool(inside), float(off[at] / fitted.sigmas[at]), float(off[at] / bound)


def predicted(fitted: Fit, values: Vector) -> Vector:
    return fitted.model.predicted(
        dict(zip((one.name for one in fitted.model.parameters), values, strict=True))
    )


def derivatives(fitted: Fit, values: Vector) -> Vector:
    steps = np.diag([one.step for one in fitted.model.parameters])
    columns = [
        predicted(fitted, values + step) - predicted(fitted, values - step) for step in steps
    ]
    return np.column_stack(columns) / (2.0 * np.diag(steps))


@pytest.mark.parametrize(
    ("seeds", "least", "most"),
    [
        weekly(range(8), 7, 8),  # 7.6 are expected
        weekly(range(40), 33, 40),  # 38 are; fewer than 33 come once in 2,000 sets of seeds
        weekly(range(1000, 2000), 930, 970),
    ],
)
def test_the_true_values_are_in_the_95_percent_region_and_attain_the_bound(
    seeds: range, least: int, most: int
) -> None:
    inside, off, over_bound = np.array([of_gyros(seed) for seed in seeds]).T
    assert least <= np.sum(inside) <= most
    if len(seeds) >= 40:
        assert 0.7 < math.sqrt(np.mean(off**2)) < 1.35
    if len(seeds) >= 1000:
        assert math.sqrt(np.mean(over_bound**2)) < 1.2


def cost(fitted: Fit, values: Vector) -> float:
    """-2 ln(likelihood), but for a constant, with the noise of the fit."""
    left = (fitted.model.measured - predicted(fitted, values)) / fitted.noise[fitted.model.signal]
    rows, nominal = fitted.model.prior
    return float(np.sum(left[fitted.used] ** 2) + np.sum((rows @ values - nominal) ** 2))


def of_kind(folder: Path, seed: int) -> tuple[bool, float, float]:
    """Whether the true values are in the 95 % region of the likelihood; two values over their
    sigmas.

    Not the ellipsoid of the covariance: where the spin is known from the file alone, only (1 - C/A)
    ω3 is told, and its region is a thin curved one.
    """
    case = telemetry(folder, seed)
    fitted = fit(case.spacecraft, case.record)  # raises where it refuses
    assert not fitted.model.unequal, (seed, case.kind)
    off = off_by(fitted, case.truth)
    at = fitted.index("attitude_3")
    if at is not None:
        off[at] = math.remainder(off[at], 2.0 * math.pi)
    within = cost(fitted, fitted.values - off) - cost(fitted, fitted.values) < chi2.ppf(
        0.95, len(off)
    )
    off = off / fitted.sigmas
    return within, float(off[fitted.index("C/A") or 0]), float(off[fitted.index("omega_1") or 0])


def of_kinds(folder: Path, seeds: Iterable[int]) -> tuple[float, Vector]:
    """Share of the records whose region holds the true values, and the errors (n, 2) over their
    sigmas.
    """
    scores = np.array([of_kind(folder, seed) for seed in seeds], dtype=float)
    return float(np.mean(scores[:, 0])), scores[:, 1:]


@pytest.mark.weekly
def test_of_each_kind_of_column_one_record_is_in_its_region(tmp_path: Path) -> None:
    """All but two at most of 13: 12.35 are expected, and fewer than 11 once in 40."""
    assert of_kinds(tmp_path, range(len(KINDS)))[0] >= (len(KINDS) - 2) / len(KINDS)


@pytest.mark.weekly
def test_two_hundred_records_of_every_kind_are_in_their_regions(tmp_path: Path) -> None:
    count = 16 * len(KINDS)
    share, off = of_kinds(tmp_path, range(1300, 1300 + count))
    low, high = (int(binom.ppf(level, count, 0.95)) / count for level in (0.005, 0.995))
    assert 0.90 <= low <= share <= high <= 1.0
    # Of so many normal numbers the mean square is within 1 ± 0.35 in 999 of 1000 sets.
    assert np.mean(off**2, axis=0) == pytest.approx(1.0, abs=0.35)


@pytest.mark.weekly
@pytest.mark.parametrize("seed", [1311, 1323, 12, 220])
def test_records_with_sun_pulses_converge_whatever_the_body_is_turned_by(
    tmp_path: Path, seed: int
) -> None:
    """Turned by whole turns besides, or from far off: the search must reach the least cost there
    is.
    """
    within, ratio, omega = of_kind(tmp_path, seed)
    assert within
    assert max(abs(ratio), abs(omega)) < 4.0


@pytest.mark.parametrize(
    ("seed", "robust", "near"),
    [(1, True, True), (4, True, False), (7, False, True), (10, False, False)],
)
def test_a_search_ends_where_least_squares_of_scipy_do(seed: int, robust: bool, near: bool) -> None:
    case = gyro_case(seed)
    model = Model(case.spacecraft, case.record)
    units = units_of(model)
    every = np.ones(len(model.measured), dtype=bool)
    begin = fit(case.spacecraft, case.record)
    named = {each.name: each.file for each in model.parameters} | begin.named
    start = np.array([named[each.name] for each in model.parameters])
    start += (
        3.0
        * np.random.default_rng(seed).normal(size=len(start))
        * np.where(units < math.inf, 1e-2 * units, 0.0)
    )
    bound = model.prior[0] * units
    nominal = model.prior[1]

    def errors(scaled: Vector) -> Vector:
        left = residuals(model, scaled * units) / begin.noise[model.signal]
        return np.concatenate([left, bound @ scaled - nominal])

    values, cost = search(model, start, begin.noise, every, robust=robust, near=near)
    other = least_squares(
        errors, start / units, loss="soft_l1" if robust else "linear", xtol=1e-10, ftol=1e-10
    )
    assert cost <= other.cost * (1.0 + 1e-6)
    assert errors(values / units) @ errors(values / units) < errors(start / units) @ errors(
        start / units
    )
