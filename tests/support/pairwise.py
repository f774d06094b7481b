"""Rows of options in which any two of them meet, without a row for every combination."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations

Row = tuple[str, ...]
Pair = tuple[tuple[int, str], ...]
"""Two values, each with the number of its factor."""


def pairs(chosen: dict[int, str]) -> list[Pair]:
    """Pairs of the values of some factors."""
    return [*combinations(sorted(chosen.items()), 2)]


def rows(factors: Sequence[Sequence[str]], first: Iterable[Row] = ()) -> list[Row]:
    """Rows of one value of each factor, ``first`` those, in which each pair of values stands at least once.

    Greedy: a row begins with the first pair that no other has, and takes on what adds most of those.
    """
    both = combinations(range(len(factors)), 2)
    missing = dict.fromkeys(pairs({i: a, j: b})[0] for i, j in both for a in factors[i] for b in factors[j])
    made = [*first]
    for row in made:
        for pair in pairs(dict(enumerate(row))):
            missing.pop(pair, None)
    while missing:
        chosen = dict(next(iter(missing)))
        for number in set(range(len(factors))) - {*chosen}:
            added = {
                value: sum(pair in missing for pair in pairs({**chosen, number: value})) for value in factors[number]
            }
            chosen[number] = max(added, key=added.__getitem__)
        made.append(tuple(chosen[number] for number in range(len(factors))))
        for pair in pairs(chosen):
            missing.pop(pair, None)
    return made
