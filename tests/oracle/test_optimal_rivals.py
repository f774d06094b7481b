"""The scheme optimal on random layouts of strong thrusters, against an independent search of many starts."""

import json

import pytest
from support import places, rivals
from support.cases import spread
from support.optimal import flies

GOLDEN = json.loads((places.GOLDEN / "rivals.json").read_text(encoding="utf-8"))


def beats(seed: int, rival: float | None) -> None:
    """Found wherever the rival is, and hardly dearer."""
    if rival is not None:
        spacecraft, free_axis = rivals.strong_layout(seed)
        assert flies(spacecraft, free_axis=free_axis).pulses.cost_in("kg") <= 1.01 * rival


@pytest.mark.deep
@spread("row", GOLDEN[:200], quick=3, deep=0, ids=lambda row: row["seed"])
def test_as_cheap_as_the_rival(row: dict[str, float]) -> None:
    beats(int(row["seed"]), row["cost_kg"])


@pytest.mark.weekly
@pytest.mark.parametrize("seed", range(1000, 1024))
def test_as_cheap_as_a_rival_searched_for_here(seed: int) -> None:
    rival = rivals.cheapest(*rivals.strong_layout(seed), starts=12, seed=seed)
    beats(seed, None if rival is None else rival.cost)
