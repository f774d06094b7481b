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
EVERY = [
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
]


def test_every_kind_of_error_survives_pickling() -> None:
    kinds = {kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, BaseException)}
    assert {type(error) for error in EVERY} == kinds
    for error in EVERY:
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))
    assert str(errors.FaultyFile(FAULTS)) == "a.yaml: empty\nb.yaml:3:1: mass: zero"  # sorted


@pytest.mark.deep
def test_a_pool_of_processes_reports_a_missing_file(tmp_path: Path) -> None:
    with get_context("spawn").Pool(1) as pool:
        waiting = pool.apply_async(nutdamp.load, (tmp_path / "missing.yaml",))
        with pytest.raises(errors.CannotRead, match=r"missing\.yaml"):
            waiting.get()  # where the error cannot be rebuilt the pool waits for it for ever; see the test above
