"""Running studies: the same numbers whatever threads and interruptions; what is counted and kept."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support import dispersed
from support.golden import refused

from nutdamp.dispersion import study as study_module
from nutdamp.dispersion import study_of
from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.draws import BLOCK
from nutdamp.dispersion.outputs import OUTPUTS
from nutdamp.dispersion.rounds import PORTION
from nutdamp.dispersion.study import Results, Study, run
from nutdamp.errors import BadRequest
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Goal, Requirement
from nutdamp.tolerances import Dispersions, Tolerance

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
    assert results.values is not None
    return results.values


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
    watched = run(
        Results(a_study(), MANY),
        threads=3,
        watch=seen.append,
        collect=lambda first, values: collected.append((first, values.shape[1])),
    )
    same(plain, watched)
    assert seen[-1] == MANY
    assert seen == sorted(seen)
    assert collected == [(0, MANY)]


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
    study, values = plain.study, values_of(plain)
    for case in (0, BLOCK - 1, BLOCK, MANY - 1, int(plain.worst.cases[0])):
        assert study.outputs_of(study.draws_of(case)) == pytest.approx(values[:, case], rel=1e-12, abs=1e-14)


def test_the_worst_miss_the_requirement_most(plain: Results) -> None:
    nutation, shift, *_ = values_of(plain)
    severity = np.maximum(nutation / 0.0712, shift / 0.0269)
    assert plain.worst.cases[0] == np.argmax(severity)
    assert plain.met == np.count_nonzero(severity <= 1.0)
    assert plain.met_fraction == plain.met / MANY
    low, high = plain.interval
    assert low < plain.met_fraction < high
    assert plain.meets_requirement is (plain.met_fraction >= 0.85)
    free = run(Results(a_study(requirement=None), 1_000))
    assert free.met_fraction is free.meets_requirement is None
    assert free.worst.cases[0] == np.argmax(values_of(free)[0])


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


def test_a_study_of_biases_alone_has_one_outcome() -> None:
    body = replace(JETS.spacecraft, dispersions=Dispersions(A=Tolerance("bias", 0.01, True)))
    nutation = run(Results(study_of(body, JETS.schedule), 2_000)).distribution("nutation")
    assert nutation is not None
    assert nutation.minimum == nutation.maximum


def test_without_dispersions_there_is_no_study() -> None:
    with refused(BadRequest, "montecarlo.no-dispersions"):
        study_of(replace(JETS.spacecraft, dispersions=None), JETS.schedule)


def test_propellant_that_is_not_known_stays_unknown() -> None:
    pulses = Schedule(tuple(replace(pulse, propellant=None) for pulse in JETS.schedule))
    assert run(Results(Study(Model(JETS.spacecraft, pulses)), 10)).distribution("propellant") is None
