"""Studies: what is counted, whatever threads and interruptions; percentiles, intervals;
sensitivities and shares.
"""

import itertools
import math
import signal
import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.spatial.transform import Rotation
from scipy.stats import binomtest, kstest, multivariate_normal, norm, triang, uniform
from support import dispersed
from support.builders import channel, present, spinner
from support.cases import deep
from support.flights import flown_outputs
from support.golden import check_text, refused

from nutdamp.common import work
from nutdamp.errors import BadRequest
from nutdamp.files.reader import read_spacecraft
from nutdamp.flight.dynamics import supplied
from nutdamp.flight.propagation import flown
from nutdamp.montecarlo import study as dispersion
from nutdamp.montecarlo.cases import DispersedModel, rotated, tilt_axes
from nutdamp.montecarlo.inputs import (
    BLOCK,
    DispersedInput,
    DrawSource,
    grouped,
    groups_of,
    list_inputs,
    mixing,
    normal_of,
    together,
    value_of,
)
from nutdamp.montecarlo.propagated import Ends, RealWidths
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
from nutdamp.montecarlo.study import (
    EARLY,
    STRIDE,
    Results,
    Study,
    affordable,
    effort,
    flown_in_stages,
    run,
    study_of,
)
from nutdamp.physics.inertia import principal_axes
from nutdamp.physics.thruster import Cold, Measured, Tank, Trapezoid, Valve
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Goal, Inertia, Requirement, Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule, channel_pulse, on_command, steerable_pulse
from nutdamp.spacecraft.tolerances import Dispersions, Tolerance
from nutdamp.views.dispersion import in_words, size_text

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
    assert (seen[-1], collected) == (MANY, [(0, BLOCK), (BLOCK, MANY - BLOCK)])


def test_a_stopped_run_keeps_the_first_cases_and_goes_on(plain: Results) -> None:
    stopped = run(Results(a_study(), MANY), stopped=stop_after(4))
    assert 0 < stopped.done < MANY
    assert stopped.done % STRIDE == 0
    same(plain, run(stopped.extended(MANY)))


def test_beyond_what_is_kept_singly_all_is_counted(
    plain: Results, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    study = plain.study
    values = values_of(plain)
    for case in (0, BLOCK - 1, BLOCK, MANY - 1, int(plain.worst.cases[0])):
        assert study.outputs_of(study.draws_of(case)) == pytest.approx(
            values[:, case], rel=1e-12, abs=1e-14
        )
        assert {
            name: float(np.ravel(draw)[0])
            for name, draw in study.draws_of_all(np.array([case])).items()
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


def test_a_share_is_shown_beyond_its_interval_of_all_but_a_millionth_then_of_95_percent() -> None:
    for met, early, last in (
        (950, True, True),
        (880, None, True),
        (850, None, None),
        (820, None, False),
        (750, False, False),
    ):
        results = Results(a_study(), 1_000, 1_000, met=met)
        assert (results.shown(certain=True), results.shown()) == (early, last)


def test_cases_cost_the_work_of_whole_strides() -> None:
    study = a_study()
    price = effort(study, 1)
    assert price == effort(study, STRIDE) == pytest.approx(study.flies.effort * STRIDE)
    assert effort(study, STRIDE + 1) == 2.0 * price
    with work.budget("cases", 1.5 * price):
        assert affordable(study, STRIDE)
        assert not affordable(study, STRIDE + 1)


@pytest.mark.parametrize(
    ("samples", "share", "price", "stages"),
    [
        # Cases asked for, share of them that complies where 0.85 must, units a case; the stages
        # flown.
        (
            None,
            0.5,
            1e-9,
            [2_048, 8_192, 20_000],
        ),  # one share is shown, of as many cases, however early it is decided
        (None, 0.85, 1e-9, [2_048, 8_192, 20_000, 40_000, 80_000, 160_000]),
        (None, 0.85, 0.2, [2_048, 8_192, 20_000, 40_000]),  # within the budget for more cases
        (None, 0.86, 1e-9, [2_048, 8_192, 20_000, 40_000]),
        (None, 0.85, 2.0, [2_048, 8_192]),  # within that of the default number
        (None, 0.85, 1e9, [2_048]),  # the first are flown in any case
        (1_000, 0.85, 1e9, [1_000]),
        (3_000, 0.85, 1e-9, [2_048, 3_000]),
        (60_000, 0.85, 1e-9, [60_000]),  # they are counted and not kept: all at once
    ],
)
def test_cases_are_flown_in_stages_until_the_share_is_shown(
    samples: int | None,
    share: float,
    price: float,
    stages: list[int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if samples == 60_000:
        monkeypatch.setattr(dispersion, "EXACT_CASES", 50_000)
    study = a_study()
    seen = list[int]()
    vars(study)["flies"] = SimpleNamespace(effort=price)

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
    shift, distance = (
        values_of(results)[OUTPUTS.index(name)] for name in ("momentum_shift", "axis_error")
    )
    assert results.worst.cases[0] == np.argmax(distance) != np.argmax(shift)
    assert results.worst.severities[0] == pytest.approx(np.max(distance) / 0.1, rel=1e-12)
    assert results.met == np.count_nonzero(distance <= 0.1) < np.count_nonzero(shift <= 0.1)


def test_unphysical_draws_are_counted() -> None:
    """C > 200 = 2A lies 10/9.5 sigmas off: 14.6 % are drawn again, of those as many again."""
    body = dispersed.with_jets(moments=(100.0, 100.0, 190.0)).spacecraft
    study = study_of(
        replace(body, dispersions=Dispersions(C=Tolerance("normal", 0.05, True))), JETS.schedule
    )
    expected = MANY * 0.1463 / (1 - 0.1463)
    assert run(Results(study, MANY), threads=2).redrawn == pytest.approx(expected, rel=0.05)


def test_failures_and_interrupts_end_the_run_at_once() -> None:
    """The flight of the first stride goes on until the interrupt has come out."""
    study, over = a_study(), threading.Event()

    def fail(_: object) -> None:
        raise ZeroDivisionError

    def interrupted(_: object) -> None:
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        over.wait(60.0)

    for fly, failure, threads in (
        (fail, ZeroDivisionError, 2),
        (interrupted, KeyboardInterrupt, 1),
    ):
        vars(study)["flies"] = fly
        with pytest.raises(failure):
            run(Results(study, MANY), threads=threads)
    over.set()


def test_biases_alone_no_dispersions_and_unknown_propellant() -> None:
    body = replace(JETS.spacecraft, dispersions=Dispersions(A=Tolerance("bias", 0.01, True)))
    nutation = run(Results(study_of(body, JETS.schedule), 2_000)).distribution("nutation")
    assert nutation is not None
    assert nutation.minimum == nutation.maximum
    with refused(BadRequest, "montecarlo.no-dispersions"):
        study_of(replace(body, dispersions=None), JETS.schedule)
    pulses = Schedule(tuple(replace(pulse, propellant=None) for pulse in JETS.schedule))
    assert (
        run(Results(Study(DispersedModel(JETS.spacecraft, pulses)), 10)).distribution("propellant")
        is None
    )


PROBABILITIES = np.array([0.0, 0.003, 0.5, 0.9, 0.95, 0.99, 0.997, 1.0])


def sketched(values: np.ndarray, portions: int = 1) -> Sketch:
    sketch = Sketch()
    for part in np.array_split(values, portions):
        sketch.add(part)
    return sketch


def test_exact_percentiles_are_those_of_numpy_and_leave_the_order_of_cases() -> None:
    values = np.random.default_rng(1).normal(size=1001)
    before = values.copy()
    assert np.array_equal(
        Exact(values).quantiles(PROBABILITIES), np.quantile(before, PROBABILITIES)
    )
    assert np.array_equal(values, before)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e6])
def test_sketched_percentiles_are_right_to_a_thousandth_whatever_the_portions_and_order(
    scale: float,
) -> None:
    generator = np.random.default_rng(2)
    size = 50_000
    draws = (
        generator.lognormal(sigma=2.0, size=size),
        generator.normal(size=size),
        -generator.rayleigh(size=size),
    )
    for values in (scale * one for one in draws):
        whole = sketched(values)
        rough = whole.quantiles(PROBABILITIES)
        assert rough == pytest.approx(
            np.quantile(values, PROBABILITIES, method="lower"), rel=0.0005
        )
        assert (rough[0], rough[-1]) == (values.min(), values.max())
        for other in (sketched(values, 7), sketched(values[::-1].copy(), 3)):
            assert np.array_equal(whole.counts, other.counts)
            assert (whole.minimum, whole.maximum) == (other.minimum, other.maximum)
    extremes = sketched(np.array([0.0, 0.0, -0.0, 1e-300, 1e300]))
    assert extremes.quantiles(np.array([0.5, 1.0])).tolist() == [0.0, 1e300]
    assert int(extremes.counts.sum()) == 5


@pytest.mark.parametrize("shift", [-9.0, 0.3, 9.0])
def test_sizes_are_those_of_the_values(shift: float) -> None:
    """Of a sketch as exact as its other percentiles; of both signs, of losses alone, of gains
    alone.
    """
    values = np.random.default_rng(6).normal(size=50_001) + shift
    assert np.array_equal(Exact(values).sizes().values, np.abs(values))
    rough = sketched(values).sizes()
    upper = PROBABILITIES[PROBABILITIES > 0.4]
    assert rough.quantiles(upper) == pytest.approx(
        np.quantile(np.abs(values), upper, method="lower"), rel=0.0005
    )
    assert int(rough.counts.sum()) == len(values)
    assert rough.maximum == np.abs(values).max()
    assert 0.0 <= rough.minimum <= np.abs(values).min()


@pytest.mark.parametrize("trials", [1, 2, 20, 1000, 10**6, 10**7])
def test_the_interval_is_that_of_scipy(trials: int) -> None:
    """Wilson's, and all where nothing was tried; as many good cases as it takes show a share."""
    some = np.random.default_rng(trials).integers(trials + 1, size=4).tolist()
    for seen in {0, 1, trials // 2, round(0.997 * trials), trials - 1, trials, *some}:
        for sigmas, confidence in (
            (SHOWN, 0.95),
            (CERTAIN, 1.0 - 1e-6),
            (1.0, norm.cdf(1.0) - norm.cdf(-1.0)),
        ):
            expected = binomtest(seen, trials).proportion_ci(confidence, method="wilson")
            assert share_interval(seen, trials, sigmas) == pytest.approx(
                expected, rel=1e-9, abs=1e-15
            )
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
    model: DispersedModel,
    draws: dict[str, np.ndarray],
) -> np.ndarray:
    """What the cases leave."""
    count = len(next(iter(draws.values())))
    return vectors(model, RealWidths(model)(model.cases(draws)), count)


@pytest.mark.parametrize(
    "model",
    [
        JETS,
        dispersed.steered(spin=-3.0),
        dispersed.sinking(JETS),
        dispersed.with_jets(moments=(120.0, 105.0, 80.0)),
    ],
    ids=["jets", "steered", "jets, dissipation", "three moments"],
)
def test_derivatives_agree_with_central_differences(model: DispersedModel) -> None:
    """Of a third of the step, which leaves a ninth of the error."""
    first = first_order(model, RealWidths(model))
    for column, entry in enumerate(first.inputs):
        step = 3e-4 * entry.size
        ends = outcomes(model, {entry.name: np.array([-step, step])})
        scale = np.abs(first.jacobian[:, column]).max()
        assert scale > 0.0 or entry.name == "position T1 y", (
            entry.name
        )  # which moves the force along itself
        slope = (ends[:, 1] - ends[:, 0]) / (2.0 * step)
        assert first.jacobian[:, column] == pytest.approx(slope, abs=1e-6 * scale), entry.name


def covariance_of(first: FirstOrder, output: str) -> np.ndarray:
    """That of the vector behind the output."""
    return np.asarray(first.independent(output) @ first.independent(output).T)


@pytest.mark.parametrize(
    "study", [dispersed.exact_two_pulse(0.02), Study(dispersed.with_jets(scale=0.02))]
)
def test_covariances_of_the_cases_agree_within_3_percent_for_small_dispersions(
    study: Study,
) -> None:
    draws = dispersed.first_cases(study, BLOCK)
    flown = outcomes(study.model, draws)
    for output in OUTPUTS:
        analytic = covariance_of(study.first_order, output)
        drawn = np.atleast_2d(np.cov(flown[VECTORS[output]]))
        assert np.linalg.norm(drawn - analytic) <= 0.03 * np.linalg.norm(analytic), output


def test_shares_sum_to_one_a_bias_has_none_and_attitude_moves_only_the_axis() -> None:
    biased = replace(present(JETS.spacecraft.dispersions), C=Tolerance("bias", 0.8))
    first = Study(
        DispersedModel(replace(JETS.spacecraft, dispersions=biased), JETS.schedule)
    ).first_order
    names = [entry.name for entry in first.inputs]
    for output in OUTPUTS:
        assert first.shares(output).sum() == pytest.approx(1.0)
        assert first.shares(output)[names.index("C")] == 0.0
        effect = first.effects(output)[names.index("attitude x")]
        assert effect > 1e-3 if output == "axis_error" else effect == pytest.approx(0.0, abs=1e-15)
    assert first.effects("nutation")[names.index("C")] > 0.0
    nothing = Study(
        DispersedModel(replace(JETS.spacecraft, dispersions=None), JETS.schedule)
    ).first_order
    assert nothing.jacobian.shape == (ROWS, 0)
    assert nothing.sigma("nutation") == 0.0


@pytest.mark.parametrize(
    ("row", "output", "expected", "within"),
    [
        (
            0,
            "nutation",
            [9 / 14, 4 / 14, 1 / 14, 0.0],
            0.015,
        ),  # a linear sum has its shares, what does nothing none
        (8, "spin_change", [2 / 3, 0.0, 0.0, 0.0], 0.03),  # curvature counts, interplay does not
        ((0, 1), "nutation", [0.8, 0.2, 0.0, 0.0], 0.015),  # a plane vector counts as one outcome
    ],
)
def test_sampled_shares(
    row: int | tuple[int, int], output: str, expected: list[float], within: float
) -> None:
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
def test_the_first_order_shares_are_those_of_the_cases_as_far_as_it_is_linear(
    scale: float, within: float
) -> None:
    results = run(Results(dispersed.exact_two_pulse(scale), EARLY))
    first = results.study.first_order
    for output in ("nutation", "momentum_shift", "axis_error"):
        sampled = [results.shares[entry.name][output] for entry in first.inputs]
        assert sampled == pytest.approx(first.shares(output), abs=within)


# --- what a dispersed case is, against vector algebra for single cases; draws, their distributions
# and correlations


def test_a_tilted_and_moved_force_gives_its_torque() -> None:
    """(r + δr) × (Rot(tilt) F) times both factors and the on-time, each thruster of the channel
    with its own.
    """
    model = dispersed.with_jets()
    draws = {
        "thrust T1": 0.1, "thrust T2": -0.05, "thrust pulse 3": 0.02,
        "direction T1 a": 0.2, "direction T1 b": -0.1, "direction T2 b": 0.3,
        "position T1 x": 0.01, "position T1 z": -0.02, "position T2 y": 0.03,
    }  # fmt: skip
    torque = np.zeros(3)
    flow = 0.0
    for jet in dispersed.JETS:
        sizes = (draws.get(f"direction {jet.name} {axis}", 0.0) for axis in "ab")
        tilt = sum(
            (size * axis for size, axis in zip(sizes, tilt_axes(present(jet.force)), strict=True)),
            np.zeros(3),
        )
        arm = present(jet.position) + [
            draws.get(f"position {jet.name} {axis}", 0.0) for axis in "xyz"
        ]
        factor = (1.0 + draws[f"thrust {jet.name}"]) * 1.02
        torque += factor * np.cross(arm, Rotation.from_rotvec(tilt).apply(present(jet.force)))
        flow += factor * present(jet.mass_flow)
    *others, both = model.schedule
    cases = model.cases(draws)
    assert cases.impulses[2][..., 0] == pytest.approx(torque * both.on_time, rel=1e-13)
    used = sum(
        (one.propellant or np.nan) * (1.0 + draws[f"thrust {one.channel}"]) for one in others
    )
    assert cases.propellant == pytest.approx(flow * both.on_time + used, rel=1e-13)


def test_rotations_of_forces_and_of_the_attitude() -> None:
    for force in (np.array([0.0, 0.0, 5.0]), np.array([3.0, -4.0, 12.0])):
        axes = np.array([*tilt_axes(force), force / np.linalg.norm(force)])
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-15)
    vector, tilt = (
        np.array([[1.0, 0.2], [-0.3, 0.5], [2.0, 3.0]]),
        np.array([[0.3, 0.0], [-0.4, 0.7]]),
    )
    expected = Rotation.from_rotvec(np.column_stack([*tilt, np.zeros(2)])).apply(vector.T)
    assert pytest.approx(expected, abs=1e-14) == rotated(vector, tilt).T


def test_a_steerable_pulse_is_turned_in_the_1_2_plane() -> None:
    torquer = Steerable(20.0, 220.0, 0.8)
    made = Schedule((steerable_pulse(torquer, 1.0, 0.4, on_time=0.5),))
    cases = DispersedModel(spinner(steerable=torquer), made).cases(
        {"thrust steerable": 0.1, "thrust pulse 1": 0.01, "direction steerable": 0.3}
    )
    size = 10.0 * 1.1 * 1.01
    assert cases.impulses[0][..., 0] == pytest.approx([size * np.cos(0.7), size * np.sin(0.7), 0.0])
    assert cases.propellant == pytest.approx(present(made.propellant) * 1.1 * 1.01)


def test_a_pulse_that_the_file_does_not_explain_keeps_its_impulse() -> None:
    """A schedule file may give a channel another torque: thrust scales what it gives, tilts come on
    top.
    """
    body = spinner(channels=(channel("T1", 8.0, 0.0, 0.0, isp=200.0, thrust=10.0),))
    pulse = replace(channel_pulse(body.channels[0], 1.0, 0.5), impulse=np.array([3.0, 1.0, 0.0]))
    unknown = replace(pulse, channel="elsewhere", propellant=None)
    for fired, name in ((pulse, "thrust T1"), (unknown, "thrust pulse 1")):
        cases = DispersedModel(body, Schedule((fired,))).cases({name: 0.1})
        assert cases.impulses[0][..., 0] == pytest.approx([3.3, 1.1, 0.0])
        assert (cases.propellant is None) == (fired is unknown)


def test_rates_and_positions_are_in_the_axes_of_the_file() -> None:
    moments, axes = principal_axes(
        np.array([[120.0, 3.0, 0.0], [3.0, 110.0, 2.0], [0.0, 2.0, 80.0]])
    )
    jet = dispersed.jet("T1", (0.1, 0.3, 0.8), (0.0, -10.0, 1.0))  # in principal axes
    body = replace(
        spinner(moments=moments, channels=(Channel("T1", (jet,)),)), inertia=Inertia(moments, axes)
    )
    model = DispersedModel(body, Schedule((channel_pulse(body.channels[0], 1.0, 0.5),)))
    cases = model.cases(
        {"omega0_1": 0.01, "omega0_3": 0.02, "position T1 y": 0.05, "A": 0.01 * body.inertia.A}
    )
    assert cases.omega0[..., 0] == pytest.approx(body.omega0 + axes.T @ [0.01, 0.0, 0.02])
    more = 0.5 * np.cross(axes.T @ [0.0, 0.05, 0.0], [0.0, -10.0, 1.0])
    assert cases.impulses[0][..., 0] == pytest.approx(0.5 * jet.torque + more)
    # A scales both transverse moments, and is their mean.
    assert cases.moments[..., 0] == pytest.approx(
        [1.01 * moments[0], 1.01 * moments[1], moments[2]]
    )
    assert cases.moments[:2].mean() == pytest.approx(0.505 * (moments[0] + moments[1]))


@pytest.mark.parametrize(
    ("moments", "name", "off", "physical"),
    [
        ((100.0, 100.0, 180.0), "A", [0.0, -9.9, -10.1, -101.0], [True, True, False, False]),
        ((100.0, 100.0, 180.0), "thrust T1", [0.0, -1.0, -1.01], [True, True, False]),
        ((100.0, 100.0, 180.0), "timing offset", [-3.0], True),
        ((10.0, 100.0, 95.0), "C", [0.0, -6.0, 16.0], [True, False, False]),
        ((50.0, 50.0, 100.0), "C", [0.0, 1e-6], [True, False]),  # the flat disc itself can be
    ],
)
def test_bodies_and_thrusts_that_cannot_be_are_told(
    moments: tuple[float, float, float], name: str, off: list[float], physical: object
) -> None:
    assert (
        np.asarray(dispersed.with_jets(moments=moments).physical({name: np.array(off)})).tolist()
        == physical
    )


def test_every_tolerance_is_drawn_or_listed_as_unused() -> None:
    inputs = dispersed.with_jets().inputs
    names = {entry.name for entry in inputs.drawn}
    assert len(names) == len(inputs.drawn) == 5 + 2 + 3 + 4 + 6 + 3 + 1 + 2
    assert not inputs.unused
    assert {
        "A",
        "omega0_1",
        "thrust T1",
        "thrust pulse 2",
        "direction T1 a",
        "position T1 x",
    } < names
    assert {"timing pulse 1", "timing offset", "attitude x"} < names


def test_what_touches_nothing_is_unused_with_its_reason() -> None:
    """Idle thrusters, thrusters known by torque, sizes of zero, a torquer that gives a torque
    wherever it sits.
    """
    tolerance = Tolerance("normal", 0.01)
    torquer = Steerable(20.0)
    by_torque = spinner(
        degrees=0.0, channels=(channel("T1", 8.0, 0.0, 0.0), channel("T2", 0.0, 8.0, 0.0))
    )
    of_jets = Dispersions(
        C=Tolerance("normal", 0.0),
        omega0=(Tolerance("normal", 0.1, True), None, None),
        thrust={"T1": tolerance, "T2": tolerance},
        thrust_direction={"T1": tolerance},
        position={"T1": tolerance},
        timing=tolerance,
    )
    of_torquer = Dispersions(
        thrust_direction={"steerable": tolerance}, position={"steerable": tolerance}
    )
    late = replace(of_torquer, timing=tolerance, timing_offset=tolerance)
    by_jet = channel_pulse(by_torque.channels[0], 1.0, 0.5)
    by_torquer = steerable_pulse(torquer, 1.0, 0.3, on_time=0.2)
    reasons = []
    for body, requested, pulses, expected in (
        (by_torque, of_jets, (by_jet,), ["thrust T1", "timing pulse 1"]),
        (spinner(steerable=torquer), of_torquer, (by_torquer,), ["direction steerable"]),
        (spinner(steerable=torquer), late, (), []),
    ):
        inputs = list_inputs(replace(body, dispersions=requested), Schedule(pulses))
        assert [entry.name for entry in inputs.drawn] == expected
        reasons += [f"{name}: {reason}" for name, reason in inputs.unused]
    check_text("montecarlo.unused-inputs", "\n".join(reasons))
    # Relative sizes are shares of the nominal value.
    relative = Dispersions(
        A=Tolerance("normal", 0.02, True), omega0=(None, None, Tolerance("bias", 0.01, True))
    )
    inputs = list_inputs(replace(spinner(A=120.0, spin=-3.0), dispersions=relative), Schedule())
    sizes = {entry.name: (entry.size, entry.sigma) for entry in inputs.drawn}
    assert sizes == {"A": pytest.approx((2.4, 2.4)), "omega0_3": pytest.approx((-0.03, 0.0))}


LAWS = {
    "normal": norm(scale=2.0),
    "uniform": uniform(-2.0, 4.0),
    "triangular": triang(0.5, -2.0, 4.0),
}
"""Of inputs of size 2."""

Pair = tuple[str, str, float]


def an_input(name: str = "A", kind: str = "normal", size: float = 1.0) -> DispersedInput:
    return DispersedInput(name, name, kind, size, 100.0, "kg m²")


def drawn(
    *inputs: DispersedInput, pairs: tuple[Pair, ...] = (), seed: int = 1, block: int = 0
) -> dict[str, np.ndarray]:
    draws, _ = DrawSource(inputs, seed, lambda _: True, groups_of(pairs)).block(block)
    return {name: np.asarray(draw) for name, draw in draws.items()}


@pytest.mark.parametrize(
    ("kind", "excess"), [("normal", 0.0), ("uniform", -1.2), ("triangular", -0.6)]
)
def test_draws_have_the_moments_of_their_kind(kind: str, excess: float) -> None:
    entry = an_input(kind=kind, size=2.0)
    values = np.concatenate([drawn(entry, block=block)["A"] for block in range(12)])
    assert abs(values.mean()) < 4.0 * entry.sigma / np.sqrt(len(values))
    assert values.std() == pytest.approx(entry.sigma, rel=0.01)
    assert ((values / entry.sigma) ** 3).mean() == pytest.approx(0.0, abs=0.03)
    assert ((values / entry.sigma) ** 4).mean() - 3.0 == pytest.approx(excess, abs=0.06)
    assert kind == "normal" or 1.9 < np.abs(values).max() <= 2.0
    assert DrawSource((an_input(kind="bias", size=-0.3),), 1, lambda _: True).block(0)[0] == {
        "A": -0.3
    }


def test_neighbours_are_independent() -> None:
    """Inputs, blocks and seeds: correlations of 16,384 numbers stay within four times their
    scatter.
    """
    both = an_input("A"), an_input("C")
    rows = [*drawn(*both).values(), drawn(*both, block=1)["A"], drawn(*both, seed=2)["A"]]
    assert np.abs(np.corrcoef(rows) - np.eye(4)).max() < 4.0 / np.sqrt(BLOCK)


def test_other_tolerances_do_not_change_the_draws_of_one() -> None:
    """A case is the same body whatever else is drawn, with correlated inputs among it."""
    others = an_input("A", "uniform", 5.0), an_input("C", size=2.0), an_input("x", "bias")
    assert np.array_equal(2.0 * drawn(an_input("C"), block=3)["C"], drawn(*others, block=3)["C"])
    pairs = (("thrust T1", "A", 0.5), ("thrust T2", "thrust T1", 0.7))
    whole = drawn(*map(an_input, ("A", "thrust T1", "thrust T2")), pairs=pairs)
    for name in ("A", "thrust T2"):
        assert np.array_equal(drawn(an_input(name), pairs=pairs)[name], whole[name])


def test_what_cannot_be_is_drawn_again_and_reported() -> None:
    """Values above one sigma are refused: 15.87 % are drawn again, of those again 15.87 % and so
    on.
    """
    draws, redrawn = DrawSource([an_input()], 1, lambda draws: np.asarray(draws["A"]) <= 1.0).block(
        0
    )
    values = np.array(draws["A"])
    free = drawn(an_input())["A"]
    kept = free <= 1.0
    assert values.max() <= 1.0
    assert len(redrawn) == pytest.approx(BLOCK * 0.15866 / (1.0 - 0.15866), rel=0.05)
    assert np.array_equal(values[kept], free[kept])
    assert set(np.flatnonzero(~kept)) == set(redrawn.tolist())
    # A normal cut at one sigma has the mean -φ(1)/Φ(1).
    assert values.mean() == pytest.approx(-0.24197 / 0.84134, abs=0.02)
    again = DrawSource([an_input()], 1, lambda draws: np.asarray(draws["A"]) <= 1.0)
    again.block(5)
    assert np.array_equal(values, again.block(0)[0]["A"])
    nothing = DrawSource(
        [an_input()], 1, lambda draws: np.zeros(len(np.asarray(draws["A"])), dtype=bool)
    )
    with refused(BadRequest, "montecarlo.nothing-possible"):
        nothing.block(0)


def test_normal_draws_have_the_correlation_and_the_others_stay_to_the_last_bit() -> None:
    inputs = [
        an_input(name, size=size) for name, size in zip("ABCD", (1.0, 2.0, 0.1, 3.0), strict=True)
    ]
    plain = drawn(*inputs)
    correlated = drawn(*inputs, pairs=(("A", "B", 0.9), ("B", "C", -0.4)))
    expected = [
        [1.0, 0.9, 0.0, 0.0],
        [0.9, 1.0, -0.4, 0.0],
        [0.0, -0.4, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
    assert np.corrcoef(list(correlated.values())) == pytest.approx(
        np.array(expected), abs=4.0 / math.sqrt(BLOCK)
    )
    for name in "AD":  # the first of a group, and what is in none
        assert np.array_equal(correlated[name], plain[name])
    for entry in inputs:
        assert kstest(correlated[entry.name] / entry.size, norm.cdf).pvalue > 1e-3


@pytest.mark.parametrize("kinds", list(itertools.combinations_with_replacement(LAWS, 2)))
def test_each_keeps_its_distribution_and_the_correlation_of_values_is_known(
    kinds: tuple[str, str],
) -> None:
    """The share of cases with both above a level is that of the bivariate normal law, which the
    copula is.
    """
    inputs = [an_input(name, kind, 2.0) for name, kind in zip("AB", kinds, strict=True)]
    pairs = (("A", "B", 0.8),)
    values = np.hstack(
        [list(drawn(*inputs, pairs=pairs, seed=seed).values()) for seed in range(1, 9)]
    )
    laws = [LAWS[kind] for kind in kinds]
    for law, value in zip(laws, values, strict=True):
        assert kstest(value, law.cdf).pvalue > 1e-3
    both = (values[0] > laws[0].ppf(0.7)) & (values[1] > laws[1].ppf(0.7))
    expected = multivariate_normal(cov=[[1.0, 0.8], [0.8, 1.0]]).cdf([norm.ppf(0.3)] * 2)
    assert both.mean() == pytest.approx(expected, abs=0.006)
    matrix = mixing(inputs, grouped(pairs))
    assert (matrix @ matrix.T)[0, 1] == pytest.approx(np.corrcoef(values)[0, 1], abs=0.01)


@pytest.mark.parametrize(
    "kinds", [("uniform", "uniform"), ("normal", "uniform"), ("uniform", "triangular")]
)
def test_the_correlation_of_values_is_the_integral_over_both(kinds: tuple[str, str]) -> None:
    inputs = [an_input(name, kind) for name, kind in zip("AB", kinds, strict=True)]
    rho = -0.6
    for entry in inputs:  # normals and values are inverse
        normals = np.linspace(-5.0, 5.0, 101)
        assert normal_of(entry, value_of(entry, normals)) == pytest.approx(normals, abs=1e-9)

    def integrand(y: float, x: float) -> float:
        other = rho * x + math.sqrt(1.0 - rho**2) * y
        product = value_of(inputs[0], np.array(x)) * value_of(inputs[1], np.array(other))
        return float(product) * math.exp(-0.5 * (x * x + y * y)) / (2.0 * math.pi)

    integral, _ = dblquad(integrand, -7.0, 7.0, -7.0, 7.0, epsabs=1e-6, epsrel=1e-6)
    matrix = mixing(inputs, grouped([("A", "B", rho)]))
    assert (matrix @ matrix.T)[0, 1] == pytest.approx(
        integral / (inputs[0].sigma * inputs[1].sigma), abs=1e-4
    )


def test_a_case_drawn_again_is_correlated_too() -> None:
    groups = groups_of([("A", "B", 0.95)])
    source = DrawSource(
        [an_input("A"), an_input("B")], 1, lambda draws: np.asarray(draws["A"]) > 0.0, groups
    )
    draws, redrawn = source.block(0)
    assert len(redrawn) > BLOCK // 2
    residual = np.asarray(draws["B"]) - 0.95 * np.asarray(draws["A"])
    assert residual.mean() == pytest.approx(0.0, abs=0.01)
    assert residual.std() == pytest.approx(math.sqrt(1.0 - 0.95**2), rel=0.02)


def test_correlations_make_groups_or_are_refused() -> None:
    assert [group.names for group in groups_of([("A", "B", 0.9), ("D", "E", 0.1)])] == [
        ("A", "B"),
        ("D", "E"),
    ]
    with refused(BadRequest, "montecarlo.impossible-correlation"):
        groups_of((("A", "B", 0.9), ("B", "C", 0.9), ("A", "C", -0.5)))


@pytest.mark.parametrize("rho", [0.95, deep(-0.95), deep(0.0)])
def test_the_budget_of_a_pair_is_the_variance_of_what_both_do_together(rho: float) -> None:
    """Of A and C with one relative size, most cancels where they are correlated: the motion knows
    only C/A.
    """
    model = dispersed.exact_two_pulse(0.02).model
    tolerances = replace(present(model.spacecraft.dispersions), correlation=(("C", "A", rho),))
    study = Study(
        DispersedModel(replace(model.spacecraft, dispersions=tolerances), model.schedule), seed=3
    )
    results = run(Results(study, BLOCK))
    first = study.first_order
    names = [entry.name for entry in first.inputs]
    pair = [names.index(name) for name in "AC"]
    effects = (
        first.jacobian[:2, pair] * first.sigmas[pair]
    )  # what one sigma of each does to the nutation
    variance = (effects**2).sum() + 2.0 * rho * (effects[:, 0] @ effects[:, 1])
    others = (
        first.effects("nutation")[[row for row in range(len(names)) if row not in pair]] ** 2
    ).sum()
    share = variance / (variance + others)
    assert first.shares("nutation")[pair].sum() == pytest.approx(share, rel=1e-9)
    assert first.shares("nutation").sum() == pytest.approx(1.0, rel=1e-12)
    assert sum(results.shares[name]["nutation"] for name in "AC") == pytest.approx(share, abs=0.03)
    vectors = results.early[:2, : results.done]
    assert np.sqrt(vectors.var(axis=1).sum()) == pytest.approx(first.sigma("nutation"), rel=0.03)
    assert together(first.inputs, study.model.groups)[0] == pair[::-1]


# --- valves, cold nozzles and tanks: a case against the flight of a body that has them so

SLOW = Trapezoid(0.008, 0.012, 0.005, 0.010)
TABLE = Measured(((0.01, 0.008, 0.011), (0.05, 0.047, 0.036), (0.2, 0.198, 0.11)))
LATER = Measured(((0.01, 0.008, 0.016), (0.05, 0.047, 0.046), (0.2, 0.198, 0.16)))
"""With room for half the impulses again before the command."""

COLD = Cold(0.9, 4.0)
TORQUES = {"a": (8.0, 0.0, 0.1), "b": (-8.0, 0.0, 0.1), "c": (0.0, 8.0, 0.1)}


def through(
    valve: Valve, other: Valve | None = None, cold: Cold | None = None, tank: Tank | None = None
) -> Spacecraft:
    """A body with this valve on its thrusters, and an ``other`` on the first of them."""
    channels = tuple(
        channel(name, *torque, min_on_time=0.02, max_on_time=0.09, isp=220.0, thrust=10.0).of(
            valve=other if other is not None and name == "a" else valve
        )
        for name, torque in TORQUES.items()
    )
    return replace(spinner(spin=math.pi, degrees=0.4, channels=channels), cold=cold, tank=tank)


def commands(body: Spacecraft, on_time: float = 0.06) -> list[Pulse]:
    """One of each thruster, at full pressure."""
    return [on_command(one, 1.0 + 0.7 * at, on_time) for at, one in enumerate(body.channels)]


def fires(body: Spacecraft, pulses: Iterable[Pulse]) -> Schedule:
    """The same commands to a body that may not be as they were made for."""
    channels = {one.name: one for one in body.channels}
    return Schedule(
        supplied(body, [on_command(channels[pulse.channel], *pulse.loaded) for pulse in pulses])
    )


def ends_of(model: DispersedModel, draws: Mapping[str, float]) -> Ends:
    made = model.cases({name: np.full(2, draw) for name, draw in draws.items()})
    return RealWidths(model)(made)


def nutation(model: DispersedModel, draws: Mapping[str, float]) -> float:
    """Of the case of these draws."""
    x, y, z = ends_of(model, draws).momentum
    return float(np.arctan2(np.hypot(x, y), z)[0])


def table(valve: Measured, factor: float) -> Measured:
    return Measured(
        tuple((on_time, factor * acts, centroid) for on_time, acts, centroid in valve.rows)
    )


CHANGES: dict[str, tuple[dict[str, float], Valve, Valve, Cold]] = {
    "opens late": ({"open_delay a": 0.002}, SLOW, replace(SLOW, open_delay=0.010), COLD),
    "opens early": ({"open_delay a": -0.003}, SLOW, replace(SLOW, open_delay=0.005), COLD),
    "closes late": ({"close_delay a": 0.002}, SLOW, replace(SLOW, close_delay=0.014), COLD),
    "opens as much later as it closes": (
        {"open_delay a": 0.004, "close_delay a": 0.004},
        SLOW,
        replace(SLOW, open_delay=0.012, close_delay=0.016),
        COLD,
    ),
    "opens later than it closes": (
        {"open_delay a": 0.012},
        SLOW,
        replace(SLOW, open_delay=0.020),
        COLD,
    ),
    "rises slowly": ({"rise_time a": 0.004}, SLOW, replace(SLOW, rise_time=0.009), COLD),
    "falls at once": ({"fall_time a": -0.010}, SLOW, replace(SLOW, fall_time=0.0), COLD),
    "all of it": (
        {
            "open_delay a": 0.003,
            "close_delay a": -0.002,
            "rise_time a": 0.040,
            "fall_time a": 0.005,
        },
        SLOW,
        Trapezoid(0.011, 0.010, 0.045, 0.015),
        COLD,
    ),
    "larger bits": ({"impulse_bit a": 0.05}, TABLE, table(TABLE, 1.05), COLD),
    "half the bits again": ({"impulse_bit a": 0.5}, LATER, table(LATER, 1.5), COLD),
    "colder": ({"cold": -0.05}, SLOW, SLOW, Cold(0.85, 4.0)),
    "colder for longer": ({"cold": -0.05, "cold_pulses": 2.0}, SLOW, SLOW, Cold(0.85, 6.0)),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_case_is_the_flight_of_such_a_body(change: str) -> None:
    draws, valve, other, cold = CHANGES[change]
    body = through(valve, cold=COLD)
    model = DispersedModel(body, fires(body, commands(body)))
    true = through(valve, other, cold)
    expected = flown(true, fires(true, model.schedule)).residual.nutation
    assert abs(nutation(model, {"cold": 0.0}) - expected) > math.radians(1e-4)
    assert nutation(model, draws) == pytest.approx(expected, rel=1e-9)
    assert flown_outputs(model, dict(draws))[0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("late", [-0.01, 0.01, 0.03, 0.05, 0.2])
def test_a_valve_that_opens_so_late_that_the_thrust_does_not_rise_or_there_is_none(
    late: float,
) -> None:
    slow = Trapezoid(0.02, 0.012, 0.05, 0.08)
    body = through(slow)
    model = DispersedModel(body, fires(body, commands(body)[:1]))
    true = through(slow, replace(slow, open_delay=0.02 + late))
    given = fires(true, model.schedule)
    assert (given.total_impulse == 0.0) == (late == 0.2)
    outputs = flown_outputs(model, {"open_delay a": late})
    assert outputs[0] == pytest.approx(flown(true, given).residual.nutation, rel=1e-9)
    assert outputs[4] == pytest.approx(given.propellant, rel=1e-9, abs=1e-15)


TANK = Tank(
    0.001, 22e5, 16e5, 1.0, ((8e5, 215.0), (30e5, 228.0)), inertia_per_kg=(3000.0, 3000.0, 1500.0)
)
TANKS: dict[str, tuple[dict[str, float], Tank]] = {
    "more pressure": ({"tank pressure": 1e5}, replace(TANK, pressure=23e5)),
    "falls further": ({"tank final_pressure": -2e5}, replace(TANK, final_pressure=14e5)),
    "less in it": ({"tank propellant": -0.0002}, replace(TANK, propellant=0.0008)),
    "other power": (
        {"tank exponent": 0.1, "tank pressure": -1e5},
        replace(TANK, exponent=1.1, pressure=21e5),
    ),
    "sheds more": ({"inertia_per_kg": 0.2}, replace(TANK, inertia_per_kg=(3600.0, 3600.0, 1800.0))),
}


@pytest.mark.parametrize("change", TANKS)
def test_a_case_of_another_tank_is_the_flight_of_such_a_body(change: str) -> None:
    """The file gives the thrust at its own pressure: at another one all pulses are stronger or
    weaker.
    """
    draws, other = TANKS[change]
    body = through(SLOW, tank=TANK)
    model = DispersedModel(body, fires(body, commands(body)))
    higher = (other.pressure / TANK.pressure) ** other.exponent
    stronger = (one.of(torque=higher * one.torque, thrust=higher * 10.0) for one in body.channels)
    true = replace(body, channels=tuple(stronger), tank=other)
    given = fires(true, model.schedule)
    expected = flown(true, given).residual.nutation
    nominal = flown(body, model.schedule).residual.nutation
    assert nutation(model, {"tank pressure": 0.0}) == pytest.approx(nominal, abs=1e-6)
    assert abs(expected - nominal) > math.radians(1e-4)
    # Half of what a ramp takes off the moments counts as it begins: of second order.
    assert nutation(model, draws) == pytest.approx(expected, abs=1e-6)
    # A pulse falls as the nominal one does, whatever the tank of the case: of second order, too.
    own = flown_outputs(model, dict(draws))
    assert own[0] == pytest.approx(expected, abs=2e-7)
    assert own[4] == pytest.approx(given.propellant, rel=1e-9)


STEADY = replace(TANK, exponent=0.0, isp=None, inertia_per_kg=None)
"""A tank that is all the same until it is empty."""


@pytest.mark.parametrize("short", [0.3, 0.7, 1.2])
def test_with_an_empty_tank_nothing_fires_any_more(short: float) -> None:
    """A case is the flight of the pulses that the propellant goes round for, the last of them
    weakened.
    """
    body = through(SLOW)
    pulses = commands(body)
    each = pulses[0].propellant or math.nan
    model = DispersedModel(
        replace(body, tank=replace(STEADY, propellant=3.0 * each)), Schedule(tuple(pulses))
    )
    draws, (whole, part) = {"tank propellant": -short * each}, divmod(3.0 - short, 1.0)
    weak = pulses[int(whole)]
    weak = replace(weak, torque=part * present(weak.torque), impulse=part * weak.impulse)
    expected = flown(body, Schedule((*pulses[: int(whole)], weak))).residual.nutation
    assert nutation(model, {"tank pressure": 0.0}) != pytest.approx(expected, rel=1e-2)
    assert nutation(model, draws) == pytest.approx(expected, rel=1e-9)
    assert ends_of(model, draws).drained == pytest.approx(3.0 / (3.0 - short), rel=1e-9)
    assert flown_outputs(model, draws)[[0, 4]] == pytest.approx(
        [expected, (3.0 - short) * each], rel=1e-9
    )


def test_what_a_schedule_takes_beyond_the_tank_does_not_fire() -> None:
    body = through(SLOW)
    pulses = commands(body)
    each = pulses[0].propellant or math.nan
    given = supplied(replace(body, tank=replace(STEADY, propellant=1.5 * each)), pulses)
    for share, one, whole in zip((1.0, 0.5, 0.0), given, pulses, strict=True):
        assert one.propellant == pytest.approx(share * each, rel=1e-9)
        assert one.impulse == pytest.approx(share * whole.impulse, rel=1e-9)


def test_cases_whose_tank_runs_empty_are_counted_and_do_not_comply() -> None:
    pulses = commands(through(SLOW))[:1]
    used = pulses[0].propellant or math.nan
    body = replace(
        through(SLOW, tank=replace(STEADY, propellant=1.1 * used)),
        requirement=Requirement(nutation=math.radians(5.0)),
        dispersions=Dispersions(tank_propellant=Tolerance("uniform", 0.2, relative=True)),
    )
    study = study_of(body, Schedule(supplied(body, pulses)), seed=3)
    results = run(Results(study, 3000))
    empty = np.flatnonzero(study.source().block(0)[0]["tank propellant"][:3000] < -0.1 * used)  # type: ignore[index]
    assert results.emptied == len(empty)
    assert 0.15 < results.emptied / 3000 < 0.35
    assert results.met == 3000 - results.emptied
    assert set(results.worst.cases[: results.emptied].tolist()) == set(empty.tolist())


def test_no_case_is_left_without_a_body_when_the_tank_is_empty() -> None:
    """Moments less all of the propellant: drawn again where no rigid body has them."""
    shed = np.array([9000.0, 9000.0, 6500.0])  # 80 kg m² less 65
    body = replace(
        through(SLOW, tank=replace(TANK, propellant=0.01, inertia_per_kg=tuple(shed.tolist()))),
        dispersions=Dispersions(inertia_per_kg=Tolerance("normal", 0.15, relative=True)),
    )
    model = study_of(body, fires(body, commands(body)[:1])).model
    draws, redrawn = DrawSource(model.inputs.drawn, 3, model.physical).block(0)
    left = np.array([[120.0], [120.0], [80.0]]) - 0.01 * np.outer(
        shed, 1.0 + np.asarray(draws["inertia_per_kg"])
    )
    assert len(redrawn) > 100
    assert np.all(left > 0.0)
    assert np.all(left[2] <= 2.0 * left[0])


FILE = """\
name: Sat
inertia: {A: 120, C: 80}
state: {spin: 30 rpm, nutation: 0.4 deg, phase: 40 deg}
thrusters:
  - {name: a, torque: [8, 0, 0], lever_arm: 0.8, isp: 220, min_on_time: 20 ms, max_on_time: 90 ms}
  - {name: b, torque: [-8, 0, 0], lever_arm: 0.8, isp: 220,
     impulse_bit: [[20 ms, 0.15, 16 ms], [90 ms, 0.8, 60 ms]]}
  - {name: c, torque: [0, 8, 0], lever_arm: 0.8, isp: 220, min_on_time: 20 ms, max_on_time: 90 ms}
valve: {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}
"""
ALL_VALVES = (
    "open_delay: {normal: 1 ms}, close_delay: {a: {uniform: 2 ms}, c: {normal: 1 ms}}, "
    "impulse_bit: {normal: 3 %}"
)


def craft(dispersions: str, more: str = "") -> Spacecraft:
    return read_spacecraft(f"{FILE}{more}dispersions: {{{dispersions}}}\n", "sat.yaml")


def test_the_few_draws_below_zero_are_drawn_again() -> None:
    body = craft("open_delay: {a: {normal: 2.6 ms}}")
    model = DispersedModel(body, fires(body, commands(body)[:1]))
    draws, redrawn = DrawSource(model.inputs.drawn, 3, model.physical).block(0)
    assert len(redrawn) > 0
    assert float(np.min(draws["open_delay a"])) >= -0.008


def test_what_is_drawn_and_what_touches_nothing() -> None:
    body = craft(f"{ALL_VALVES}, cold: {{normal: 2 %}}", "cold: {first: 90 %, pulses: 4}\n")
    drawn, unused = list_inputs(body, fires(body, commands(body)))
    names = "open_delay a, open_delay c, close_delay a, close_delay c, impulse_bit b, cold"
    assert ", ".join(one.name for one in drawn) == names
    warm = craft("cold: {normal: 2 %}")
    unused += list_inputs(warm, fires(warm, commands(warm))).unused
    check_text("montecarlo.unused-valves", "\n".join(f"{one.name}: {one.reason}" for one in unused))


def test_bare_numbers_are_dispersed_and_shown_in_parts_of_their_own_values() -> None:
    more = (
        "cold: {first: 90 %, pulses: 4}\n"
        "tank: {propellant: 2, pressure: 22 bar, final_pressure: 16 bar, exponent: 1.2}\n"
    )
    for line, nominal, shown in (
        ("cold: {normal: 2 %}", 0.9, "2 %"),
        ("cold_pulses: {uniform: 10 %}", 4.0, "5.77 %"),
        ("tank_exponent: {bias: 5 %}", 1.2, "5 %"),
        ("tank_final_pressure: {normal: 0.5 bar}", 16e5, "0.5 bar"),
    ):
        body = craft(line, more)
        model = DispersedModel(body, fires(body, commands(body)[:1]))
        (entry,) = model.inputs.drawn
        assert entry.nominal == pytest.approx(nominal)
        assert size_text(entry) == shown
        assert in_words(entry.name) == line.partition(":")[0].replace("_", " ")
        assert model.physical({entry.name: np.array([-1.001 * nominal])}) == [False]
