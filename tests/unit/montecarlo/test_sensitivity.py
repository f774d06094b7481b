"""First-order sensitivities against differences and against the cases; shares of the variance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support import dispersed
from support.cases import deep

from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.draws import BLOCK
from nutdamp.dispersion.kernel import ClosedForm
from nutdamp.dispersion.outputs import OUTPUTS, ROWS, VECTORS, vectors
from nutdamp.dispersion.sensitivity import first_order, sampled_shares
from nutdamp.dispersion.study import EARLY, Results, Study, run
from nutdamp.tolerances import Tolerance

JETS = dispersed.with_jets()


def outcomes(model: Model, draws: dict[str, np.ndarray]) -> np.ndarray:
    out = np.empty((ROWS, len(next(iter(draws.values())))))
    vectors(model, ClosedForm(model)(model.cases(draws)), out)
    return out


@pytest.mark.parametrize(
    "model",
    [JETS, dispersed.steered(spin=-3.0), dispersed.sinking(JETS), dispersed.with_jets(moments=(120.0, 105.0, 80.0))],
    ids=["jets", "steered", "jets, dissipation", "three moments"],
)
def test_derivatives_agree_with_central_differences(model: Model) -> None:
    first = first_order(model)
    for column, entry in enumerate(first.inputs):
        step = 1e-4 * entry.size
        ends = outcomes(model, {entry.name: np.array([-step, step])})
        scale = np.abs(first.jacobian[:, column]).max()
        assert scale > 0.0 or entry.name == "position T1 y", entry.name  # which moves the force along itself
        slope = (ends[:, 1] - ends[:, 0]) / (2.0 * step)
        assert first.jacobian[:, column] == pytest.approx(slope, abs=1e-6 * scale), entry.name


@pytest.mark.parametrize("study", [dispersed.exact_two_pulse(0.02), Study(dispersed.with_jets(scale=0.02))])
def test_covariances_of_the_cases_agree_within_3_percent_for_small_dispersions(study: Study) -> None:
    flown = outcomes(study.model, dispersed.first_cases(study, BLOCK))
    for output in OUTPUTS:
        analytic = study.first_order.covariance(output)
        drawn = np.atleast_2d(np.cov(flown[VECTORS[output]]))
        assert np.linalg.norm(drawn - analytic) <= 0.03 * np.linalg.norm(analytic), output


def test_the_percentile_of_a_small_nutation_follows_from_the_covariance() -> None:
    """The length of a plane normal vector, by its covariance alone: 99 % percentile within 3 %."""
    tolerance = Tolerance("normal", 1e-5, True)
    study = dispersed.exact_two_pulse(0.02, timing=None, timing_offset=None, A=tolerance)
    covariance = study.first_order.covariance("nutation")
    normal = np.random.default_rng(6).multivariate_normal(np.zeros(2), covariance, 200_000)
    nutation = run(Results(study, 50_000)).distribution("nutation")
    assert nutation is not None
    expected = np.quantile(np.linalg.norm(normal, axis=1), 0.99)
    assert nutation.quantiles(np.array([0.99]))[0] == pytest.approx(expected, rel=0.03)


def test_shares_sum_to_one_and_a_bias_has_none() -> None:
    requested = JETS.spacecraft.dispersions
    assert requested is not None
    biased = replace(requested, C=Tolerance("bias", 0.8))
    first = first_order(Model(replace(JETS.spacecraft, dispersions=biased), JETS.schedule))
    at = [entry.name for entry in first.inputs].index("C")
    for output in OUTPUTS:
        assert first.shares(output).sum() == pytest.approx(1.0)
        assert first.shares(output)[at] == 0.0
    assert first.effects("nutation")[at] > 0.0


def test_nothing_dispersed_has_no_sensitivities() -> None:
    first = first_order(Model(replace(JETS.spacecraft, dispersions=None), JETS.schedule))
    assert first.jacobian.shape == (ROWS, 0)
    assert first.sigma("nutation") == 0.0


def test_the_attitude_moves_only_where_the_axis_points() -> None:
    first = first_order(JETS)
    at = [entry.name for entry in first.inputs].index("attitude x")
    effects = {output: first.effects(output)[at] for output in OUTPUTS}
    assert effects.pop("axis_error") > 1e-3
    assert list(effects.values()) == pytest.approx([0.0] * 4, abs=1e-15)


@pytest.mark.parametrize(
    ("row", "output", "expected", "within"),
    [
        (0, "nutation", [9 / 14, 4 / 14, 1 / 14, 0.0], 0.015),  # a linear sum has its shares, what does nothing none
        (8, "spin_change", [2 / 3, 0.0, 0.0, 0.0], 0.03),  # curvature counts, interplay does not
        ((0, 1), "nutation", [0.8, 0.2, 0.0, 0.0], 0.015),  # a plane vector counts as one outcome
    ],
)
def test_sampled_shares(row: int | tuple[int, int], output: str, expected: list[float], within: float) -> None:
    draws = dict(zip("xyzn", np.random.default_rng(7).normal(size=(4, EARLY)), strict=True))
    x, y, z, _ = draws.values()
    made = {"nutation": 3.0 * x + 2.0 * y + z, "spin_change": x**2 + y * z}[output]
    out = np.zeros((ROWS, EARLY))
    out[row, :] = (2.0 * x, y) if isinstance(row, tuple) else made
    shares = sampled_shares(draws, out)
    assert [share[output] for share in shares.values()] == pytest.approx(expected, abs=within)
    assert shares["x"]["axis_error"] == 0.0


@pytest.mark.parametrize("count", [1, 2, 63, 64, 5000])
def test_few_cases_give_no_nonsense(count: int) -> None:
    draws, out = {"1": np.random.default_rng(10).normal(size=count)}, np.zeros((ROWS, count))
    out[0] = draws["1"]
    assert 0.0 <= sampled_shares(draws, out)["1"]["nutation"] <= 1.0


@pytest.mark.parametrize(("scale", "within"), [deep(0.02, 0.02), (0.3, 0.05)])
def test_the_first_order_shares_are_those_of_the_cases_as_far_as_it_is_linear(scale: float, within: float) -> None:
    results = run(Results(dispersed.exact_two_pulse(scale), EARLY))
    first = results.study.first_order
    for output in ("nutation", "momentum_shift", "axis_error"):
        sampled = [results.shares[entry.name][output] for entry in first.inputs]
        assert sampled == pytest.approx(first.shares(output), abs=within)
