"""Studies: what is counted, whatever threads and interruptions; percentiles, intervals; sensitivities and shares."""

import itertools
import math
import threading
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binomtest, norm
from support import dispersed
from support.builders import present
from support.cases import deep
from support.golden import refused

from nutdamp.errors import BadRequest
from nutdamp.montecarlo import study as dispersion
from nutdamp.montecarlo.cases import DispersedCases, DispersedModel
from nutdamp.montecarlo.inputs import BLOCK
from nutdamp.montecarlo.propagated import ClosedForm, Ends
from nutdamp.montecarlo.statistics import (
    CERTAIN,
    OUTPUTS,
    ROWS,
    SHOWN,
    VECTORS,
    Exact,
    FirstOrder,
    Sketch,
    Worst,
    cases_to_show,
    first_order,
    sampled_shares,
    share_interval,
    vectors,
)
from nutdamp.montecarlo.study import EARLY, PORTION, Results, Study, flown_in_stages, run, study_of
from nutdamp.spacecraft.model import Goal, Requirement
from nutdamp.spacecraft.schedule import Schedule
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance

MANY = BLOCK + 5_234
JETS = dispersed.with_jets()


def a_study(**changes: object) -> Study:
    model = dispersed.with_jets(scale=0.2)
    given: dict[str, object] = {"requirement": Requirement(0.0712, 0.0269, 0.85), **changes}
    return study_of(replace(model.spacecraft, **given), model.schedule, seed=5)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def plain() -> Results:
    return run(Results(a_study(), MANY))


def values_of(results: Results) -> np.ndarray:
    return present(results.values)


def same(first: Results, second: Results) -> None:
    assert (first.done, first.redrawn, first.met) == (second.done, second.redrawn, second.met)
    assert np.array_equal(values_of(first)[:, : first.done], values_of(second)[:, : second.done])
    assert first.worst.cases.tolist() == second.worst.cases.tolist()
    assert first.shares == second.shares


def stop_after(calls: int) -> Callable[[], bool]:
    left = iter(range(calls))
    return lambda: next(left, None) is None


def test_threads_change_nothing_and_what_is_done_is_told(plain: Results) -> None:
    seen: list[int] = []
    collected: list[tuple[int, int]] = []

    def collect(first: int, values: np.ndarray) -> None:
        collected.append((first, values.shape[1]))

    same(plain, run(Results(a_study(), MANY), threads=3, watch=seen.append, collect=collect))
    assert seen == sorted(seen)
    assert (seen[-1], collected) == (MANY, [(0, MANY)])


def test_a_stopped_run_keeps_the_first_cases_and_goes_on(plain: Results) -> None:
    stopped = run(Results(a_study(), MANY), stopped=stop_after(4))
    assert 0 < stopped.done < MANY
    assert stopped.done % PORTION == 0
    same(plain, run(stopped.extended(MANY)))


def test_cases_of_three_moments_do_not_depend_on_threads_or_interruptions() -> None:
    model = dispersed.with_jets(moments=(120.0, 110.0, 80.0))
    whole, parts = (Results(study_of(model.spacecraft, model.schedule), count) for count in (1_500, 700))
    same(run(whole), run(run(parts, threads=2).extended(1_500), threads=2))


def test_beyond_what_is_kept_singly_all_is_counted(plain: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if 10,000 were the most: percentiles to 0.1 %, the same counts."""
    monkeypatch.setattr(dispersion, "EXACT_CASES", 10_000)
    counted = run(Results(a_study(), MANY), threads=2)
    assert counted.values is None
    assert not counted.exact
    assert (counted.met, counted.redrawn) == (plain.met, plain.redrawn)
    assert counted.worst.cases.tolist() == plain.worst.cases.tolist()
    at = np.array([0.5, 0.9, 0.95, 0.99, 0.997, 1.0])
    for output in OUTPUTS:
        rough, exact = counted.distribution(output), plain.distribution(output)
        assert rough is not None
        assert exact is not None
        assert rough.quantiles(at) == pytest.approx(exact.quantiles(at), rel=1e-3)


def test_a_case_is_the_same_alone(plain: Results) -> None:
    study, values = plain.study, values_of(plain)
    for case in (0, BLOCK - 1, BLOCK, MANY - 1, int(plain.worst.cases[0])):
        assert study.outputs_of(study.draws_of(case)) == pytest.approx(values[:, case], rel=1e-12, abs=1e-14)
        assert {
            name: float(np.ravel(draw)[0]) for name, draw in study.draws_of_all(np.array([case])).items()
        } == study.draws_of(case)


def test_the_worst_miss_the_requirement_most(plain: Results) -> None:
    nutation, shift, *_ = values_of(plain)
    severity = np.maximum(nutation / 0.0712, shift / 0.0269)
    assert plain.worst.cases[0] == np.argmax(severity)
    assert plain.met == np.count_nonzero(severity <= 1.0)
    assert plain.met_fraction == plain.met / MANY
    low, high = plain.interval()
    assert low < plain.met_fraction < high
    free = run(Results(a_study(requirement=None), 1_000))
    assert (free.met_fraction, free.shown()) == (None, True)
    assert free.worst.cases[0] == np.argmax(values_of(free)[0])


def test_a_share_is_shown_beyond_its_interval_at_first_of_all_but_a_millionth_at_last_of_95_percent() -> None:
    for met, early, last in (
        (950, True, True),
        (880, None, True),
        (850, None, None),
        (820, None, False),
        (750, False, False),
    ):
        results = Results(a_study(), 1_000, 1_000, met=met)
        assert (results.shown(certain=True), results.shown()) == (early, last)


# Cases asked for, share of them that complies where 0.85 must, units a case; the stages flown.
STAGED: list[tuple[int | None, float, float, list[int]]] = [
    (None, 0.5, 1e-9, [2_048, 8_192, 20_000]),  # one share is shown, of as many cases, however early it is decided
    (None, 0.85, 1e-9, [2_048, 8_192, 20_000, 40_000, 80_000, 160_000]),
    (None, 0.85, 0.2, [2_048, 8_192, 20_000, 40_000]),  # within the budget for more cases
    (None, 0.86, 1e-9, [2_048, 8_192, 20_000, 40_000]),
    (None, 0.85, 2.0, [2_048, 8_192]),  # within that of the default number
    (None, 0.85, 1e9, [2_048]),  # the first are flown in any case
    (1_000, 0.85, 1e9, [1_000]),
    (3_000, 0.85, 1e-9, [2_048, 3_000]),
    (60_000, 0.85, 1e-9, [60_000]),  # they are counted and not kept: all at once
]


@pytest.mark.parametrize(("samples", "share", "effort", "stages"), STAGED)
def test_cases_are_flown_in_stages_until_the_share_is_shown(
    samples: int | None, share: float, effort: float, stages: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    if samples == 60_000:
        monkeypatch.setattr(dispersion, "EXACT_CASES", 50_000)
    study, seen = a_study(), list[int]()
    vars(study)["flies"] = SimpleNamespace(effort=effort)

    def fly(results: Results) -> None:
        results.done = results.requested
        results.met = round(share * results.done)
        seen.append(results.done)

    assert flown_in_stages(study, samples, fly=fly).done == stages[-1]
    assert seen == stages
    assert flown_in_stages(study, samples, fly=fly, stopped=lambda: True).done == 0


def test_with_a_target_the_distance_from_it_counts_and_not_the_shift() -> None:
    """H shifts by 0.027 rad, and ends 0.098 to 0.105 rad from the target."""
    goal = Goal(axis=np.array([math.sin(0.1), 0.0, math.cos(0.1)]))
    results = run(Results(a_study(goal=goal, requirement=Requirement(momentum_shift=0.1)), 1_000))
    shift, distance = (values_of(results)[OUTPUTS.index(name)] for name in ("momentum_shift", "axis_error"))
    assert results.worst.cases[0] == np.argmax(distance) != np.argmax(shift)
    assert results.worst.severities[0] == pytest.approx(np.max(distance) / 0.1, rel=1e-12)
    assert results.met == np.count_nonzero(distance <= 0.1) < np.count_nonzero(shift <= 0.1)


def test_unphysical_draws_are_counted() -> None:
    """C > 200 = 2A lies 10/9.5 sigmas off: 14.6 % are drawn again, of those as many again."""
    body = dispersed.with_jets(moments=(100.0, 100.0, 190.0)).spacecraft
    study = study_of(replace(body, dispersions=Dispersions(C=Tolerance("normal", 0.05, True))), JETS.schedule)
    expected = MANY * 0.1463 / (1 - 0.1463)
    assert run(Results(study, MANY), threads=2).redrawn == pytest.approx(expected, rel=0.05)


def test_a_failure_in_a_thread_is_a_failure_of_the_run() -> None:
    def fail(_: object) -> None:
        raise ZeroDivisionError

    study = a_study()
    vars(study)["flies"] = fail
    with pytest.raises(ZeroDivisionError):
        run(Results(study, MANY), threads=2)


def test_an_interrupt_does_not_wait_for_the_cases_that_are_in_work() -> None:
    """The flight of the first portion goes on until the interrupt has come out."""
    study, begun, over = a_study(), threading.Event(), threading.Event()
    real = study.flies

    def fly(cases: DispersedCases) -> Ends:
        begun.set()
        over.wait(60.0)
        return real(cases)

    def interrupt(_: int) -> None:
        assert begun.wait(60.0)
        raise KeyboardInterrupt

    vars(study)["flies"] = fly
    with pytest.raises(KeyboardInterrupt):
        run(Results(study, 2_048), watch=interrupt)
    assert not over.is_set()
    over.set()


def test_biases_alone_no_dispersions_and_unknown_propellant() -> None:
    body = replace(JETS.spacecraft, dispersions=Dispersions(A=Tolerance("bias", 0.01, True)))
    nutation = run(Results(study_of(body, JETS.schedule), 2_000)).distribution("nutation")
    assert nutation is not None
    assert nutation.minimum == nutation.maximum
    with refused(BadRequest, "montecarlo.no-dispersions"):
        study_of(replace(body, dispersions=None), JETS.schedule)
    pulses = Schedule(tuple(replace(pulse, propellant=None) for pulse in JETS.schedule))
    assert run(Results(Study(DispersedModel(JETS.spacecraft, pulses)), 10)).distribution("propellant") is None


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
def test_sketched_percentiles_are_right_to_a_thousandth_whatever_the_portions_and_order(scale: float) -> None:
    generator, size = np.random.default_rng(2), 50_000
    draws = (generator.lognormal(sigma=2.0, size=size), generator.normal(size=size), -generator.rayleigh(size=size))
    for values in (scale * one for one in draws):
        whole = sketched(values)
        rough = whole.quantiles(PROBABILITIES)
        assert rough == pytest.approx(np.quantile(values, PROBABILITIES, method="lower"), rel=0.0005)
        assert (rough[0], rough[-1]) == (values.min(), values.max())
        for other in (sketched(values, 7), sketched(values[::-1].copy(), 3)):
            assert np.array_equal(whole.counts, other.counts)
            assert (whole.minimum, whole.maximum) == (other.minimum, other.maximum)
    extremes = sketched(np.array([0.0, 0.0, -0.0, 1e-300, 1e300]))
    assert extremes.quantiles(np.array([0.5, 1.0])).tolist() == [0.0, 1e300]
    assert int(extremes.counts.sum()) == 5


@pytest.mark.parametrize("shift", [-9.0, 0.3, 9.0])
def test_sizes_are_those_of_the_values(shift: float) -> None:
    """Of a sketch as exact as its other percentiles; of both signs, of losses alone, of gains alone."""
    values = np.random.default_rng(6).normal(size=50_001) + shift
    assert np.array_equal(Exact(values).sizes().values, np.abs(values))
    rough, upper = sketched(values).sizes(), PROBABILITIES[PROBABILITIES > 0.4]
    assert rough.quantiles(upper) == pytest.approx(np.quantile(np.abs(values), upper, method="lower"), rel=0.0005)
    assert int(rough.counts.sum()) == len(values)
    assert rough.maximum == np.abs(values).max()
    assert 0.0 <= rough.minimum <= np.abs(values).min()


@pytest.mark.parametrize("trials", [1, 2, 20, 1000, 10**6, 10**7])
def test_the_interval_is_that_of_scipy(trials: int) -> None:
    """Wilson's, and all where nothing was tried; as many good cases as it takes show a share."""
    some = np.random.default_rng(trials).integers(trials + 1, size=4).tolist()
    for seen in {0, 1, trials // 2, round(0.997 * trials), trials - 1, trials, *some}:
        for sigmas, confidence in ((SHOWN, 0.95), (CERTAIN, 1.0 - 1e-6), (1.0, norm.cdf(1.0) - norm.cdf(-1.0))):
            expected = binomtest(seen, trials).proportion_ci(confidence, method="wilson")
            assert share_interval(seen, trials, sigmas) == pytest.approx(expected, rel=1e-9, abs=1e-15)
    assert share_interval(0, 0) == (0.0, 1.0)
    few = cases_to_show(0.997)
    assert share_interval(few, few)[0] >= 0.997 > share_interval(few - 1, few - 1)[0]


def test_the_worst_cases_are_found_whatever_the_portions() -> None:
    severities = np.round(np.random.default_rng(5).normal(size=5_000), 2)  # with many ties
    order = sorted(range(5_000), key=lambda case: (-severities[case], case))[:40]
    for cuts in ([], [1], [10, 2000, 2001], list(range(0, 5000, 77))):
        worst = Worst(40)
        for begin, end in itertools.pairwise([0, *cuts, 5_000]):
            worst.add(begin, severities[begin:end])
        assert worst.cases.tolist() == order
        assert worst.severities.tolist() == [severities[case] for case in order]


def outcomes(
    model: DispersedModel, draws: dict[str, np.ndarray], fly: Callable[[DispersedCases], Ends] | None = None
) -> np.ndarray:
    """What the closed form leaves, or what ``fly`` flies."""
    return vectors(model, (fly or ClosedForm(model))(model.cases(draws)), len(next(iter(draws.values()))))


@pytest.mark.parametrize(
    "model",
    [JETS, dispersed.steered(spin=-3.0), dispersed.sinking(JETS), dispersed.with_jets(moments=(120.0, 105.0, 80.0))],
    ids=["jets", "steered", "jets, dissipation", "three moments"],
)
def test_derivatives_agree_with_central_differences(model: DispersedModel) -> None:
    first = first_order(model)
    for column, entry in enumerate(first.inputs):
        step = 1e-4 * entry.size
        ends = outcomes(model, {entry.name: np.array([-step, step])})
        scale = np.abs(first.jacobian[:, column]).max()
        assert scale > 0.0 or entry.name == "position T1 y", entry.name  # which moves the force along itself
        slope = (ends[:, 1] - ends[:, 0]) / (2.0 * step)
        assert first.jacobian[:, column] == pytest.approx(slope, abs=1e-6 * scale), entry.name


def covariance_of(first: FirstOrder, output: str) -> np.ndarray:
    """That of the vector behind the output."""
    return np.asarray(first.independent(output) @ first.independent(output).T)


@pytest.mark.parametrize("study", [dispersed.exact_two_pulse(0.02), Study(dispersed.with_jets(scale=0.02))])
def test_covariances_of_the_cases_agree_within_3_percent_for_small_dispersions(study: Study) -> None:
    """Of those flown through real widths with the budget of the study, of the closed form with its own derivatives."""
    draws = dispersed.first_cases(study, BLOCK)
    for first, fly in ((study.first_order, study.flies), (first_order(study.model), None)):
        flown = outcomes(study.model, draws, fly)
        for output in OUTPUTS:
            analytic = covariance_of(first, output)
            drawn = np.atleast_2d(np.cov(flown[VECTORS[output]]))
            assert np.linalg.norm(drawn - analytic) <= 0.03 * np.linalg.norm(analytic), output


def test_the_percentile_of_a_small_nutation_follows_from_the_covariance() -> None:
    """The length of a plane normal vector, by its covariance alone: 99 % percentile within 3 %."""
    tolerance = Tolerance("normal", 1e-5, True)
    study = dispersed.exact_two_pulse(0.02, timing=None, timing_offset=None, A=tolerance)
    covariance = covariance_of(study.first_order, "nutation")
    normal = np.random.default_rng(6).multivariate_normal(np.zeros(2), covariance, 200_000)
    nutation = run(Results(study, 50_000)).distribution("nutation")
    assert nutation is not None
    expected = np.quantile(np.linalg.norm(normal, axis=1), 0.99)
    assert nutation.quantiles(np.array([0.99]))[0] == pytest.approx(expected, rel=0.03)


def test_shares_sum_to_one_a_bias_has_none_and_the_attitude_moves_only_where_the_axis_points() -> None:
    biased = replace(present(JETS.spacecraft.dispersions), C=Tolerance("bias", 0.8))
    first = first_order(DispersedModel(replace(JETS.spacecraft, dispersions=biased), JETS.schedule))
    names = [entry.name for entry in first.inputs]
    for output in OUTPUTS:
        assert first.shares(output).sum() == pytest.approx(1.0)
        assert first.shares(output)[names.index("C")] == 0.0
        effect = first.effects(output)[names.index("attitude x")]
        assert effect > 1e-3 if output == "axis_error" else effect == pytest.approx(0.0, abs=1e-15)
    assert first.effects("nutation")[names.index("C")] > 0.0
    nothing = first_order(DispersedModel(replace(JETS.spacecraft, dispersions=None), JETS.schedule))
    assert nothing.jacobian.shape == (ROWS, 0)
    assert nothing.sigma("nutation") == 0.0


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
    for count in (1, 2, 63, 64, 5000):  # few cases give no nonsense
        few = sampled_shares({name: draw[:count] for name, draw in draws.items()}, out[:, :count])
        assert all(0.0 <= share[output] <= 1.0 for share in few.values())


@pytest.mark.parametrize(("scale", "within"), [deep(0.02, 0.02), (0.3, 0.05)])
def test_the_first_order_shares_are_those_of_the_cases_as_far_as_it_is_linear(scale: float, within: float) -> None:
    results = run(Results(dispersed.exact_two_pulse(scale), EARLY))
    first = results.study.first_order
    for output in ("nutation", "momentum_shift", "axis_error"):
        sampled = [results.shares[entry.name][output] for entry in first.inputs]
        assert sampled == pytest.approx(first.shares(output), abs=within)
