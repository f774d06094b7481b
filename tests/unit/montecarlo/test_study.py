"""Running studies: the same numbers whatever threads and interruptions; what is counted and kept."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support import dispersed

from nutdamp.dispersion import study as study_module
from nutdamp.dispersion import study_of
from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.draws import BLOCK
from nutdamp.dispersion.outputs import OUTPUTS
from nutdamp.dispersion.rounds import PORTION
from nutdamp.dispersion.study import Results, Study, run
from nutdamp.errors import BadRequest
from nutdamp.spacecraft import Goal, Requirement
from nutdamp.tolerances import Dispersions, Tolerance

MANY = 3 * BLOCK + 1_234


def a_study(**changes: object) -> Study:
    model = dispersed.with_jets(scale=0.2)
    given: dict[str, object] = {"requirement": Requirement(0.0712, 0.0269, 0.85), **changes}
    body = replace(model.spacecraft, **given)  # type: ignore[arg-type]
    return study_of(body, model.schedule, seed=5)


@pytest.fixture(scope="module")
def plain() -> Results:
    return run(Results(a_study(), MANY))


def same(first: Results, second: Results) -> None:
    assert (first.done, first.redrawn, first.met) == (second.done, second.redrawn, second.met)
    assert first.values is not None
    assert second.values is not None
    assert np.array_equal(first.values[:, : first.done], second.values[:, : second.done])
    assert first.worst.cases.tolist() == second.worst.cases.tolist()
    assert first.shares == second.shares


@pytest.mark.deep
@pytest.mark.parametrize("threads", [2, 3])
def test_threads_change_nothing(plain: Results, threads: int) -> None:
    same(plain, run(Results(a_study(), MANY), threads=threads))


@pytest.mark.parametrize("threads", [1, 2])
def test_cases_of_three_moments_do_not_depend_on_threads_or_interruptions(threads: int) -> None:
    model = dispersed.with_jets(moments=(120.0, 110.0, 80.0))

    def flown() -> Study:
        return study_of(model.spacecraft, model.schedule)

    whole = run(Results(flown(), 3_000))
    parts = run(Results(flown(), 1_500), threads=threads)
    same(whole, run(parts.extended(3_000), threads=threads))


def stop_after(calls: int):  # type: ignore[no-untyped-def]
    left = iter(range(calls))
    return lambda: next(left, None) is None


def test_a_stopped_run_keeps_the_first_cases_and_goes_on(plain: Results) -> None:
    stopped = run(Results(a_study(), MANY), stopped=stop_after(4))
    assert 0 < stopped.done < MANY
    assert stopped.done % PORTION == 0
    same(plain, run(stopped.extended(MANY)))


def test_beyond_what_is_kept_singly_all_is_counted(plain: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if 10,000 were the most: percentiles to 0.1 %, the same counts."""
    monkeypatch.setattr(study_module, "EXACT_CASES", 10_000)
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
    assert plain.values is not None
    for case in (0, BLOCK - 1, BLOCK, MANY - 1, int(plain.worst.cases[0])):
        assert study.outputs_of(study.draws_of(case)) == pytest.approx(plain.values[:, case], rel=1e-12, abs=1e-14)


def test_the_worst_miss_the_requirement_most(plain: Results) -> None:
    assert plain.values is not None
    severity = np.maximum(plain.values[0] / 0.0712, plain.values[1] / 0.0269)
    assert plain.worst.cases[0] == np.argmax(severity)
    assert plain.met == np.count_nonzero(severity <= 1.0)
    assert plain.met_fraction == plain.met / MANY
    low, high = plain.interval
    assert low < plain.met_fraction < high
    assert plain.meets_requirement is (plain.met_fraction >= 0.85)
    free = run(Results(a_study(requirement=None), 1_000))
    assert free.met_fraction is None
    assert free.meets_requirement is None
    assert free.values is not None
    assert free.worst.cases[0] == np.argmax(free.values[0])


def test_with_a_target_the_distance_from_it_counts_and_not_the_shift() -> None:
    """H shifts by 0.027 rad, and ends 0.098 to 0.105 rad from the target."""
    goal = Goal(axis=np.array([math.sin(0.1), 0.0, math.cos(0.1)]))
    results = run(Results(a_study(goal=goal, requirement=Requirement(momentum_shift=0.1)), 1_000))
    assert results.values is not None
    shift, distance = (results.values[OUTPUTS.index(name)] for name in ("momentum_shift", "axis_error"))
    assert results.worst.cases[0] == np.argmax(distance) != np.argmax(shift)
    assert results.worst.severities[0] == pytest.approx(np.max(distance) / 0.1, rel=1e-12)
    assert results.met == np.count_nonzero(distance <= 0.1) < np.count_nonzero(shift <= 0.1)


def test_unphysical_draws_are_counted() -> None:
    body = replace(
        dispersed.with_jets(moments=(100.0, 100.0, 190.0)).spacecraft,
        dispersions=Dispersions(C=Tolerance("normal", 0.05, True)),
    )
    study = study_of(body, dispersed.with_jets().schedule)
    results = run(Results(study, 20_000), threads=2)
    # C > 200 = 2A lies 10/9.5 sigmas off: 14.6 % are drawn again, of those as many again.
    assert results.redrawn == pytest.approx(20_000 * 0.1463 / (1 - 0.1463), rel=0.05)


def test_watching_and_collecting(plain: Results) -> None:
    seen: list[int] = []
    collected: list[tuple[int, int]] = []
    run(
        Results(a_study(), MANY),
        watch=seen.append,
        collect=lambda first, values: collected.append((first, values.shape[1])),
    )
    assert seen[-1] == MANY
    assert seen == sorted(seen)
    assert collected == [(0, MANY)]


def test_a_failure_in_a_thread_is_a_failure_of_the_run() -> None:
    def fail(_: object) -> None:
        raise ZeroDivisionError("in the middle")

    study = a_study()
    vars(study)["flies"] = fail
    with pytest.raises(ZeroDivisionError, match="in the middle"):
        run(Results(study, MANY), threads=2)


def test_a_study_of_biases_alone_has_one_outcome() -> None:
    body = replace(dispersed.with_jets().spacecraft, dispersions=Dispersions(A=Tolerance("bias", 0.01, True)))
    results = run(Results(study_of(body, dispersed.with_jets().schedule), 2_000))
    found = results.distribution("nutation")
    assert found is not None
    assert found.minimum == found.maximum


def test_without_dispersions_there_is_no_study() -> None:
    model = dispersed.with_jets()
    with pytest.raises(BadRequest, match="no dispersions"):
        study_of(replace(model.spacecraft, dispersions=None), model.schedule)


def test_propellant_that_is_not_known_stays_unknown() -> None:
    model = dispersed.with_jets()
    pulses = tuple(replace(pulse, propellant=None) for pulse in model.schedule)
    results = run(Results(Study(Model(model.spacecraft, type(model.schedule)(pulses))), 10))
    assert results.distribution("propellant") is None
