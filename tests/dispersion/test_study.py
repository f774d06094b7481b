"""Running studies: the same numbers whatever threads, chunks, interruptions; what is counted and kept."""

from __future__ import annotations

import math
import tracemalloc
import zipfile
from dataclasses import replace
from pathlib import Path

import dispersed
import numpy as np
import pytest
from samples import some

from nutdamp.dispersion import study as study_module
from nutdamp.dispersion import study_of
from nutdamp.dispersion.cases import Model
from nutdamp.dispersion.draws import BLOCK
from nutdamp.dispersion.outputs import OUTPUTS
from nutdamp.dispersion.study import Results, Study, run
from nutdamp.errors import BadRequest, CannotRead
from nutdamp.files.study_file import load_results, save_results
from nutdamp.spacecraft import Disturbance, Goal, Requirement
from nutdamp.tolerances import Dispersions, Tolerance

MANY = 3 * BLOCK + 1_234


def a_study(**changes: object) -> Study:
    model = dispersed.with_jets(scale=0.2)
    given: dict[str, object] = {"requirement": Requirement(0.0712, 0.0269, 0.85), **changes}
    body = replace(model.spacecraft, **given)  # type: ignore[arg-type]
    return study_of(body, model.schedule, seed=5, flown=False)


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


@pytest.mark.parametrize(("threads", "chunk"), [(2, 8192), (1, 1024), (3, 5000), (1, BLOCK)])
def test_threads_and_chunks_change_nothing(plain: Results, threads: int, chunk: int) -> None:
    same(plain, run(Results(a_study(), MANY), threads=threads, chunk=chunk))


@pytest.mark.parametrize("threads", [1, 2])
def test_flown_cases_do_not_depend_on_threads_chunks_or_interruptions(threads: int) -> None:
    model = dispersed.with_jets(moments=(120.0, 110.0, 80.0))

    def flown() -> Study:
        return study_of(model.spacecraft, model.schedule, flown=True)

    whole = run(Results(flown(), 3_000))
    parts = run(Results(flown(), 1_500), threads=threads, chunk=1024)
    same(whole, run(parts.extended(3_000), threads=threads, chunk=2048))


def stop_after(calls: int):  # type: ignore[no-untyped-def]
    left = iter(range(calls))
    return lambda: next(left, None) is None


def test_a_stopped_run_keeps_the_first_cases_and_goes_on_from_a_file(plain: Results, tmp_path: Path) -> None:
    path = str(tmp_path / "study.npz")
    stopped = run(Results(a_study(), MANY), stopped=stop_after(4))
    assert 0 < stopped.done < MANY
    assert stopped.done % BLOCK == 0
    save_results(path, stopped)
    same(plain, run(load_results(path, a_study(), MANY)))


def test_a_study_can_be_extended(plain: Results, tmp_path: Path) -> None:
    path = str(tmp_path / "study.npz")
    save_results(path, run(Results(a_study(), 1_000)))
    same(plain, run(load_results(path, a_study(), MANY), threads=2))
    with pytest.raises(BadRequest, match="1000 cases are done already"):
        load_results(path, a_study(), 999)


def test_only_the_same_study_is_taken_up(tmp_path: Path) -> None:
    path = str(tmp_path / "study.npz")
    save_results(path, run(Results(a_study(), 100)))
    requested = a_study().model.spacecraft.dispersions
    assert requested is not None
    others = [
        replace(a_study(), seed=6),
        a_study(omega0=a_study().model.spacecraft.omega0 * (1.0 + 1e-15)),
        a_study(dispersions=replace(requested, A=Tolerance("normal", 0.1))),
        a_study(requirement=None),
    ]
    for other in others:
        with pytest.raises(BadRequest, match="another study"):
            load_results(path, other, 200)
    assert load_results(path, a_study(), 200).done == 100


def test_results_under_other_disturbances_are_not_taken_up(tmp_path: Path) -> None:
    path = str(tmp_path / "study.npz")
    leak = Disturbance(0.01 + 0.0j)
    save_results(path, run(Results(a_study(disturbances=(leak,)), 100)))
    others = ((), (leak, leak), (replace(leak, transverse=0.02 + 0.0j),), (replace(leak, rate=-3.0),))
    for disturbances in others:
        with pytest.raises(BadRequest, match="another study"):
            load_results(path, a_study(disturbances=disturbances), 200)
    assert load_results(path, a_study(disturbances=(leak,)), 200).done == 100


def test_nor_those_with_other_dissipation(tmp_path: Path) -> None:
    path = str(tmp_path / "study.npz")
    save_results(path, run(Results(a_study(dissipation=3600.0), 100)))
    for dissipation in (None, 1800.0):
        with pytest.raises(BadRequest, match="another study"):
            load_results(path, a_study(dissipation=dissipation), 200)
    assert load_results(path, a_study(dissipation=3600.0), 200).done == 100


@pytest.mark.parametrize("content", [b"", b"not a study", b"PK\x03\x04 broken"])
def test_what_is_no_study_file_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "study.npz"
    path.write_bytes(content)
    with pytest.raises(CannotRead, match="no file that --resume has written"):
        load_results(str(path), a_study(), 10)


def damaged(whole: bytes, random: np.random.Generator) -> bytes:
    """The content of a file after a slip of hand, a bad disk or a full one."""
    place, length = (int(number) for number in random.integers(0, len(whole), 2))
    match int(random.integers(5)):
        case 0:
            return whole[:place]
        case 1:
            return whole[:place] + bytes(length) + whole[place + length :]
        case 2:
            return whole[:place] + random.bytes(4) + whole[place + 4 :]
        case 3:
            return whole[:place] + whole[place + length % 40 :]
        case _:
            return whole[:place] + bytes([whole[place] ^ 1 << int(random.integers(8))]) + whole[place + 1 :]


@pytest.mark.slow
@pytest.mark.parametrize("seed", some(range(5, 9)))
def test_a_damaged_study_file_is_read_as_it_was_or_refused(tmp_path: Path, seed: int) -> None:
    study, path = a_study(), tmp_path / "study.npz"
    save_results(str(path), run(Results(study, 100)))
    whole, random, messages = path.read_bytes(), np.random.default_rng(seed), []
    for _ in range(250):
        path.write_bytes(damaged(whole, random))
        try:
            same(run(Results(study, 100)), load_results(str(path), study, 100))
        except CannotRead as wrong:
            messages.append(str(wrong))
    assert len(messages) > 125
    assert set(messages) == {f"cannot read {path}: it is no file that --resume has written, or is damaged"}


@pytest.mark.parametrize(
    "change",
    [
        {"counts": np.array([100, 0])},
        {"counts": np.array([100.0, 0.0, 0.0])},
        {"counts": np.array([100, 0, 101])},
        {"counts": np.array([-1, 0, 0])},
        {"counts": np.array([0, 0, 0])},
        {"counts": np.array(["a", "b", "c"])},
        {"worst_cases": np.array([100] * 100)},
        {"worst_severities": np.zeros(3)},
        {"early": np.zeros((10, 50))},
        {"early": np.zeros(10)},
        {"values": np.zeros((5, 99))},
        {"values": np.zeros((5, 100), dtype=complex)},
        {"values": None},
        {"values": None, "sketches": np.zeros((5, 7), dtype=np.int64), "extremes": np.zeros((5, 2))},
        {"values": None, "sketches": np.zeros((5, 262_144), dtype=np.int64), "extremes": np.zeros((5, 2))},
        {"fingerprint": None},
    ],
    ids=lambda change: ",".join(f"{key} {getattr(value, 'shape', '')}" for key, value in change.items()),
)
def test_arrays_that_no_study_writes_are_refused(tmp_path: Path, change: dict[str, object]) -> None:
    path = tmp_path / "study.npz"
    save_results(str(path), run(Results(a_study(), 100)))
    with np.load(path) as kept:
        arrays = {name: kept[name] for name in kept.files}
    np.savez(path, **{name: value for name, value in {**arrays, **change}.items() if value is not None})
    with pytest.raises(CannotRead, match="it is no file that --resume has written, or is damaged"):
        load_results(str(path), a_study(), 200)


@pytest.mark.slow
def test_an_archive_that_unfolds_is_refused_before_it_does(tmp_path: Path) -> None:
    """512 MiB of zeros in a file of half a megabyte: no more memory than the file is taken."""
    path = tmp_path / "study.npz"
    save_results(str(path), run(Results(a_study(), 100)))
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive, archive.open("more.npy", "w") as entry:
        for _ in range(512):
            entry.write(bytes(1 << 20))
    tracemalloc.start()
    try:
        with pytest.raises(CannotRead, match="it is no file that --resume has written, or is damaged"):
            load_results(str(path), a_study(), 200)
        assert tracemalloc.get_traced_memory()[1] < 16 << 20
    finally:
        tracemalloc.stop()


def test_beyond_what_is_kept_singly_all_is_counted(
    plain: Results, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """As if 10,000 were the most: percentiles to 0.1 %, the same counts, resumed or not, in one file or the other."""
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
    path = str(tmp_path / "study.npz")
    for early in (run(Results(a_study(), 9_000)), run(Results(a_study(), MANY), stopped=stop_after(4))):
        save_results(path, early)
        resumed = run(load_results(path, a_study(), MANY))
        assert resumed.sketches is not None
        assert counted.sketches is not None
        for one, other in zip(resumed.sketches, counted.sketches, strict=True):
            assert np.array_equal(one.counts, other.counts)
    assert load_results(path, a_study(), 9_999_999).sketches is not None


def test_a_case_is_the_same_alone(plain: Results) -> None:
    study = plain.study
    assert plain.values is not None
    for case in (0, BLOCK - 1, BLOCK, MANY - 1, int(plain.worst.cases[0])):
        assert study.outputs_of(study.draws_of(case)) == pytest.approx(plain.values[:, case], rel=1e-14, abs=1e-16)


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

    with pytest.raises(ZeroDivisionError, match="in the middle"):
        run(Results(replace(a_study(), fly=fail), MANY), threads=2)  # type: ignore[arg-type]


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
