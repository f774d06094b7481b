"""Other values of C/A that equal sampling allows, and what is said of the body, for fits that are
given.
"""

import math

import numpy as np
import pytest
from support.hand_made_fit import silent, told

import nutdamp
from nutdamp.estimation.initial_guess import neighbours, nutation_rate
from nutdamp.estimation.results import estimates

BODY = nutdamp.example().with_(dispersions={"A": {"normal": "30 %"}, "C": {"normal": "30 %"}})
"""Of 30 rpm: sampled every 10 s, multiples of 0.2 of C/A look alike."""


PLAIN, MIRRORED = [0.55, 0.95, 0.35, 1.15, 0.15, 1.35], [0.65, 0.55, 0.85, 0.45, 0.95, 0.35]


@pytest.mark.parametrize(
    ("signals", "until", "ratios"),
    [
        (("omega_1", "omega_2", "omega_3"), 600.0, PLAIN),
        (("omega_1", "axis_x", "axis_y", "axis_z"), 600.0, PLAIN),
        (("axis_x", "axis_y", "axis_z"), 600.0, PLAIN),
        # One transverse signal does not show the sense of the rate, however fast it is sampled.
        (("omega_2", "omega_3"), 600.0, MIRRORED),
        (("omega_2", "omega_3"), 6.0, [1.25]),
    ],
)
def test_values_of_the_ratio_that_look_alike_the_nearest_to_the_file_first(
    signals: tuple[str, ...], until: float, ratios: list[float]
) -> None:
    fit = told(BODY, silent(*signals, until=until, count=61), {"C/A": 0.75}, {})
    at = fit.index("C/A")
    others = neighbours(fit.model, fit.values)
    assert [one[at] for one in others] == pytest.approx(ratios)
    for one in others:
        assert np.array_equal(np.delete(one, at or 0), np.delete(fit.values, at or 0))


def test_ratio_and_moments_are_told_with_their_sigmas_and_those_of_the_file() -> None:
    """C = A·(C/A); what the file says of C/A is both moments together."""
    fit = told(
        BODY,
        silent("omega_1", "omega_2", "omega_3"),
        {"A": 118.0, "C/A": 0.68},
        {"A": 2.0, "C/A": 1e-3},
    )
    rows = {one.key: one for one in estimates(fit, 0.0)}
    both = 2.0 / 3.0 * math.hypot(0.3, 0.3)
    assert {key: rows[key].value for key in ("C/A", "a", "A", "C")} == pytest.approx(
        {"C/A": 0.68, "a": 0.32, "A": 118.0, "C": 118.0 * 0.68}
    )
    assert {key: rows[key].sigma for key in ("C/A", "a", "A", "C")} == pytest.approx(
        {"C/A": 1e-3, "a": 1e-3, "A": 2.0, "C": math.hypot(2.0 * 0.68, 0.118)}
    )
    assert {key: rows[key].prior for key in ("C/A", "a", "A", "C")} == pytest.approx(
        {"C/A": both, "a": both, "A": 36.0, "C": 24.0}
    )
    assert rows["A"].change == pytest.approx(-2.0 / 36.0)
    assert (rows["a"].source, rows["A"].file) == ("data", 120.0)
    sure = told(nutdamp.example().replace(dispersions=None), silent("omega_1", "omega_2"), {}, {})
    assert {one.key for one in estimates(sure, 0.0)} & {"C/A", "a", "A", "C"} == {"C/A", "a", "C"}


def test_the_nutation_rate_is_that_of_the_spin_estimated_or_of_the_file() -> None:
    seen = told(BODY, silent("omega_1", "omega_2", "omega_3"), {"C/A": 0.75, "omega_3": 2.0}, {})
    assert nutation_rate(seen.model, seen.values) == pytest.approx(0.25 * 2.0)
