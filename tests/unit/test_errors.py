"""Errors cross the border between processes whole."""

from __future__ import annotations

import pickle
from multiprocessing import get_context
from pathlib import Path

import pytest

import nutdamp
from nutdamp import errors
from nutdamp.errors import Fault

FAULTS = [Fault("b.yaml", 3, 1, "mass", "zero"), Fault("a.yaml", 0, 0, "", "empty")]


@pytest.mark.parametrize(
    "error",
    [
        errors.NutdampError("anything"),
        errors.FaultyFile(FAULTS),
        errors.BadRequest("no such scheme"),
        errors.Unsuitable(("attitude", "epoch"), "before 1972"),
        errors.SenselessOption("per_turn", "0", "expected a whole number of at least 1"),
        errors.CannotRead("in.yaml", "no such file"),
        errors.CannotWrite("out.csv", "permission denied"),
        errors.MissingExtra("plot", "a picture"),
        errors.MissingPandas(),
        errors.Infeasible("no thrusters"),
        errors.TooShort("no pulse fits", "limits.horizon = 90 s is long enough"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_survives_pickling(error: errors.NutdampError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)


def test_every_kind_of_error_is_pickled_above() -> None:
    marks = getattr(test_an_error_survives_pickling, "pytestmark")  # noqa: B009 - pytest sets it
    tried = {type(error) for error in marks[0].args[1]}
    kinds = {kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, BaseException)}
    assert tried == kinds


def test_a_pool_of_processes_reports_a_missing_file(tmp_path: Path) -> None:
    with get_context("spawn").Pool(1) as pool:
        waiting = pool.apply_async(nutdamp.load, (tmp_path / "missing.yaml",))
        with pytest.raises(errors.CannotRead, match=r"cannot read .*missing\.yaml: no such file"):
            waiting.get()  # where the error cannot be rebuilt the pool waits for it for ever; see the test above


def test_faults_are_sorted_and_read_one_a_line() -> None:
    assert str(errors.FaultyFile(FAULTS)) == "a.yaml: empty\nb.yaml:3:1: mass: zero"
