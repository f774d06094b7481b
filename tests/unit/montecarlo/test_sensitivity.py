"""First-order sensitivities against differences and against the cases; shares of the variance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support import dispersed

from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.draws import BLOCK
from nutdamp.dispersion.kernel import ClosedForm
from nutdamp.dispersion.outputs import OUTPUTS, ROWS, VECTORS, vectors
from nutdamp.dispersion.sensitivity import first_order, sampled_shares
from nutdamp.dispersion.study import EARLY, Results, Study, run
from nutdamp.tolerances import Tolerance


def outcome(model: Model, draws: dict[str, float]) -> np.ndarray:
    out = np.empty((ROWS, 1))
    vectors(model, ClosedForm(model)(model.cases({name: np.array([draw]) for name, draw in draws.items()})), out)
    return out[:, 0]


@pytest.mark.parametrize(
    "model",
    [dispersed.with_jets(), dispersed.steered(spin=-3.0), dispersed.sinking(dispersed.with_jets())],
    ids=["jets", "steered", "jets, dissipation"],
)
def test_derivatives_agree_with_central_differences(model: Model) -> None:
    found = first_order(model)
    for column, entry in enumerate(found.inputs):
        step = 1e-4 * entry.size
        slope = (outcome(model, {entry.name: step}) - outcome(model, {entry.name: -step})) / (2.0 * step)
        scale = np.abs(found.jacobian[:, column]).max()
        assert scale > 0.0 or entry.name == "position T1 y", entry.name  # which moves the force along itself
        assert found.jacobian[:, column] == pytest.approx(slope, abs=1e-6 * scale), entry.name


@pytest.mark.parametrize("study", [dispersed.exact_two_pulse(0.02), Study(dispersed.with_jets(scale=0.02))])
def test_covariances_of_the_cases_agree_within_3_percent_for_small_dispersions(study: Study) -> None:
    model, found = study.model, np.empty((ROWS, BLOCK))
    vectors(model, ClosedForm(model)(model.cases(dispersed.first_cases(study, BLOCK))), found)
    for output in OUTPUTS:
        analytic = study.first_order.covariance(output)
        drawn = np.atleast_2d(np.cov(found[VECTORS[output]]))
        assert np.linalg.norm(drawn - analytic) <= 0.03 * np.linalg.norm(analytic), output


def test_the_percentile_of_a_small_nutation_follows_from_the_covariance() -> None:
    """The length of a plane normal vector, by its covariance alone: 99 % percentile within 3 %."""
    tolerance = Tolerance("normal", 1e-5, True)
    study = dispersed.exact_two_pulse(0.02, timing=None, timing_offset=None, A=tolerance)
    results = run(Results(study, 200_000))
    normal = np.random.default_rng(6).multivariate_normal(
        np.zeros(2), study.first_order.covariance("nutation"), 400_000
    )
    expected = np.quantile(np.linalg.norm(normal, axis=1), 0.99)
    found = results.distribution("nutation")
    assert found is not None
    assert found.quantiles(np.array([0.99]))[0] == pytest.approx(expected, rel=0.03)


def test_shares_sum_to_one_and_a_bias_has_none() -> None:
    model = dispersed.with_jets()
    requested = model.spacecraft.dispersions
    assert requested is not None
    body = replace(model.spacecraft, dispersions=replace(requested, C=Tolerance("bias", 0.8)))
    found = first_order(Model(body, model.schedule))
    names = [entry.name for entry in found.inputs]
    for output in OUTPUTS:
        assert found.shares(output).sum() == pytest.approx(1.0)
        assert found.shares(output)[names.index("C")] == 0.0
    assert found.effects("nutation")[names.index("C")] > 0.0


def test_nothing_dispersed_has_no_sensitivities() -> None:
    body = replace(dispersed.with_jets().spacecraft, dispersions=None)
    found = first_order(Model(body, dispersed.with_jets().schedule))
    assert found.jacobian.shape == (ROWS, 0)
    assert found.sigma("nutation") == 0.0


def test_the_attitude_moves_only_where_the_axis_points() -> None:
    found = first_order(dispersed.with_jets())
    names = [entry.name for entry in found.inputs]
    for output in OUTPUTS:
        effect = found.effects(output)[names.index("attitude x")]
        assert (effect > 1e-3) if output == "axis_error" else effect == pytest.approx(0.0, abs=1e-15)


def test_sampled_shares_of_a_linear_sum_are_its_shares() -> None:
    """y = 3 x1 + 2 x2 + x3 with equal spreads: 9/14, 4/14, 1/14; and an input that does nothing has none."""
    generator = np.random.default_rng(7)
    draws = {name: generator.normal(size=EARLY) for name in ("1", "2", "3", "idle")}
    out = np.zeros((ROWS, EARLY))
    out[0] = 3.0 * draws["1"] + 2.0 * draws["2"] + draws["3"]
    found = sampled_shares(draws, out)
    assert [found[name]["nutation"] for name in draws] == pytest.approx([9 / 14, 4 / 14, 1 / 14, 0.0], abs=0.015)
    assert found["1"]["axis_error"] == 0.0


def test_sampled_shares_see_curvature_and_leave_out_interplay() -> None:
    """y = x1² + x2 x3: the first has 2/3 of the variance (within classes a little is lost), the others none."""
    generator = np.random.default_rng(8)
    draws = {name: generator.normal(size=EARLY) for name in ("1", "2", "3")}
    out = np.zeros((ROWS, EARLY))
    out[8] = draws["1"] ** 2 + draws["2"] * draws["3"]
    found = sampled_shares(draws, out)
    assert [found[name]["spin_change"] for name in draws] == pytest.approx([2 / 3, 0.0, 0.0], abs=0.03)


def test_a_plane_vector_counts_as_one_outcome() -> None:
    generator = np.random.default_rng(9)
    draws = {name: generator.normal(size=EARLY) for name in ("1", "2")}
    out = np.zeros((ROWS, EARLY))
    out[0], out[1] = 2.0 * draws["1"], draws["2"]
    assert [found["nutation"] for found in sampled_shares(draws, out).values()] == pytest.approx([0.8, 0.2], abs=0.015)


@pytest.mark.parametrize("count", [1, 2, 63, 64, 5000])
def test_few_cases_give_no_nonsense(count: int) -> None:
    draws = {"1": np.random.default_rng(10).normal(size=count)}
    out = np.zeros((ROWS, count))
    out[0] = draws["1"]
    share = sampled_shares(draws, out)["1"]["nutation"]
    assert 0.0 <= share <= 1.0


@pytest.mark.parametrize("spread", [0.02, 0.3])
def test_the_first_order_shares_are_those_of_the_cases_as_far_as_it_is_linear(spread: float) -> None:
    results = run(Results(dispersed.exact_two_pulse(spread), EARLY))
    first = results.study.first_order
    for index, entry in enumerate(first.inputs):
        for output in ("nutation", "momentum_shift", "axis_error"):
            share = results.shares[entry.name][output]
            assert share == pytest.approx(first.shares(output)[index], abs=0.02 if spread < 0.1 else 0.05)
