"""Draws: their distributions, and that only seed, input and case decide on them."""

from __future__ import annotations

import numpy as np
import pytest

from nutdamp.dispersion.draws import BLOCK, Source
from nutdamp.dispersion.inputs import Input
from nutdamp.errors import BadRequest


def an_input(kind: str, size: float, name: str = "A") -> Input:
    return Input(name, "A", kind, size, 100.0, "kg m²")


def source(*inputs: Input, seed: int = 1) -> Source:
    return Source(inputs, seed, lambda _: True)


def sample(entry: Input, blocks: int = 12) -> np.ndarray:
    drawn = source(entry)
    return np.concatenate([np.array(drawn.block(number)[0][entry.name]) for number in range(blocks)])


@pytest.mark.parametrize(
    ("kind", "excess"),
    [("normal", 0.0), ("uniform", -1.2), ("triangular", -0.6)],
)
def test_draws_have_the_moments_of_their_kind(kind: str, excess: float) -> None:
    entry = an_input(kind, 2.0)
    values = sample(entry)
    count = len(values)
    assert abs(values.mean()) < 4.0 * entry.sigma / np.sqrt(count)
    assert values.std() == pytest.approx(entry.sigma, rel=0.01)
    assert ((values / entry.sigma) ** 3).mean() == pytest.approx(0.0, abs=0.03)
    assert ((values / entry.sigma) ** 4).mean() - 3.0 == pytest.approx(excess, abs=0.06)
    if kind != "normal":
        assert 1.9 < np.abs(values).max() <= 2.0


def test_a_bias_is_the_same_in_every_case() -> None:
    assert source(an_input("bias", -0.3)).block(0)[0] == {"A": -0.3}


def test_neighbours_are_independent() -> None:
    """Inputs, blocks and seeds: correlations of 16,384 numbers stay within four times their scatter."""
    drawn = source(an_input("normal", 1.0, "A"), an_input("normal", 1.0, "C"))
    first, _ = drawn.block(0)
    rows = [np.array(first["A"]), np.array(first["C"])]
    rows.append(np.array(drawn.block(1)[0]["A"]))
    rows.append(np.array(source(an_input("normal", 1.0, "A"), seed=2).block(0)[0]["A"]))
    off = np.corrcoef(rows) - np.eye(4)
    assert np.abs(off).max() < 4.0 / np.sqrt(BLOCK)


def test_other_tolerances_do_not_change_the_draws_of_one() -> None:
    """So two studies of which one has a tighter tolerance see the same cases otherwise."""
    alone = np.array(source(an_input("normal", 1.0, "C")).block(3)[0]["C"])
    drawn = source(an_input("uniform", 5.0, "A"), an_input("normal", 2.0, "C"), an_input("bias", 1.0, "x"))
    assert np.array_equal(2.0 * alone, drawn.block(3)[0]["C"])


def test_what_cannot_be_is_drawn_again_and_reported() -> None:
    """Values above one sigma are refused: 15.87 % are drawn again, of those again 15.87 % and so on."""
    entry = an_input("normal", 1.0)
    drawn = Source([entry], 1, lambda draws: np.asarray(draws["A"]) <= 1.0)
    draws, redrawn = drawn.block(0)
    values = np.array(draws["A"])
    assert values.max() <= 1.0
    assert len(redrawn) == pytest.approx(BLOCK * 0.15866 / (1.0 - 0.15866), rel=0.05)
    free = np.array(source(entry).block(0)[0]["A"])
    kept = free <= 1.0
    assert np.array_equal(values[kept], free[kept])
    assert set(np.flatnonzero(~kept)) == set(redrawn.tolist())
    # A normal cut at one sigma has the mean -φ(1)/Φ(1).
    assert values.mean() == pytest.approx(-0.24197 / 0.84134, abs=0.02)
    again = Source([entry], 1, lambda draws: np.asarray(draws["A"]) <= 1.0)
    again.block(5)
    assert np.array_equal(values, again.block(0)[0]["A"])


def test_dispersions_that_allow_nothing_are_refused() -> None:
    with pytest.raises(BadRequest, match="almost all draws"):
        Source([an_input("normal", 1.0)], 1, lambda draws: np.zeros(len(np.asarray(draws["A"])), dtype=bool)).block(0)
