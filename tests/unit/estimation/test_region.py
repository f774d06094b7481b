"""Regions of 95 % where the spin is that of the file: ω3 and C/A lie on the curve of one nutation
rate.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2
from support.cases import weekly
from support.places import case
from support.telemetry_kinds import KINDS, telemetry

import nutdamp
from nutdamp.estimation.fit import fit
from nutdamp.estimation.results import estimates
from nutdamp.estimation.search import Fit
from nutdamp.files.telemetry import read_telemetry

TRUTH = {"A": 245.46318647216307, "C/A": 0.6375167123394947, "omega_1": 0.05008703651230487,
         "omega_2": -0.05178266663244872, "omega_3": 1.0639010316988404, "growth": 0.0,
         "bias_acceleration": 8.362307728901711e-05}  # fmt: skip
"""Of the record of an accelerometer alone."""


def within(fitted: Fit, truth: dict[str, float]) -> tuple[bool, bool]:
    """Whether true values are in the 95 % ellipsoid of the region, and in that of the covariance at
    the minimum.
    """
    off = fitted.values - [truth[one.name] for one in fitted.model.parameters]
    least = chi2.ppf(0.95, len(off))
    inside, plain = (
        bool(off @ np.linalg.solve(one, off) < least) for one in (fitted.region, fitted.covariance)
    )
    return inside, plain


def test_the_region_of_an_accelerometer_alone_is_as_wide_as_its_curve() -> None:
    body = nutdamp.load(case("accelerometer.yaml"))
    fitted = fit(body, read_telemetry(case("accelerometer.csv"), body)[0])
    assert within(fitted, TRUTH) == (True, False)
    (rate,) = (one for one in estimates(fitted, 0.0) if one.key == "rate")
    assert (
        abs(rate.value - (1.0 - TRUTH["C/A"]) * TRUTH["omega_3"])
        < 3.0 * rate.sigma
        < 1e-3 * rate.value
    )


@pytest.mark.parametrize(
    "kind", [weekly(kind) for kind in (("omega_12",), ("omega_1",), ("acceleration",))]
)
def test_regions_hold_as_often_as_they_say(kind: tuple[str, ...], tmp_path: Path) -> None:
    """Of 60 records 57 are expected; fewer than 51 come once in 500 sets."""
    first = KINDS.index(kind)
    records = [telemetry(tmp_path, 1300 + first + len(KINDS) * at) for at in range(60)]
    assert sum(within(fit(one.spacecraft, one.record), one.truth)[0] for one in records) >= 51
