"""Estimates from telemetry against bodies that are known: by records that DOP853 made, not the closed forms."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import pytest
from scipy.stats import chi2
from support.synthetic import Case, gyro_case

from nutdamp.estimation.fit import Fit, fit
from nutdamp.estimation.model import Model, Vector
from nutdamp.estimation.record import GYROS, quantisation


class Score(NamedTuple):
    """Of one record: whether the true values are in the 95 % region; C/A off, over its sigma and over the bound."""

    inside: bool
    off: float
    over_bound: float


def truth_of(found: Fit, case: Case) -> Vector:
    named = case.truth | {"C/A": case.truth["C"] / case.truth["A"]}
    return np.array([named[one.name] for one in found.model.parameters])


def score(case: Case) -> Score:
    found = fit(case.spacecraft, case.record)
    assert not found.model.unequal
    truth = truth_of(found, case)
    off = found.values - truth
    inside = off @ np.linalg.solve(found.covariance, off) < chi2.ppf(0.95, len(off))
    at = found.index("C/A")
    assert at is not None
    # The Cramér-Rao bound at the true values, with the true noise, steps included.
    steps = [quantisation(case.record.signals[name]) for name in GYROS]
    noise = np.hypot(case.noise, np.array(steps) / math.sqrt(12.0))
    slopes = derivatives(found.model, truth) / noise[found.model.signal][:, None]
    rows = np.concatenate([slopes, found.model.prior[0]])
    scale = np.linalg.norm(rows, axis=0)
    bound = math.sqrt(float(np.linalg.inv((rows / scale).T @ (rows / scale))[at, at])) / scale[at]
    return Score(bool(inside), float(off[at] / found.sigmas[at]), float(off[at] / bound))


def derivatives(model: Model, values: np.ndarray) -> np.ndarray:
    columns = []
    for index, one in enumerate(model.parameters):
        step = np.zeros(len(values))
        step[index] = one.step
        ends = [
            model.predicted(dict(zip((p.name for p in model.parameters), values + sign * step, strict=True)))
            for sign in (1.0, -1.0)
        ]
        columns.append((ends[0] - ends[1]) / (2.0 * one.step))
    return np.column_stack(columns)


def scores(seeds: Iterable[int]) -> list[Score]:
    return [score(gyro_case(seed)) for seed in seeds]


@pytest.mark.weekly
def test_the_true_values_of_eight_records_are_in_the_95_percent_region() -> None:
    """All but one at most: 7.6 are expected."""
    assert sum(one.inside for one in scores(range(8))) >= 7


@pytest.mark.weekly
def test_the_true_values_are_in_the_95_percent_region() -> None:
    found = scores(range(40))
    # 38 of 40 are expected; fewer than 33 come once in 2,000 sets of seeds.
    assert sum(one.inside for one in found) >= 33
    assert 0.7 < math.sqrt(np.mean([one.off**2 for one in found])) < 1.35


@pytest.mark.weekly
def test_a_thousand_records_are_in_their_regions_and_attain_the_bound() -> None:
    found = scores(range(1000, 2000))
    assert 0.93 <= np.mean([one.inside for one in found]) <= 0.97
    assert math.sqrt(np.mean([one.over_bound**2 for one in found])) < 1.2
