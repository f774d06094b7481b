"""Rows of options in which any two of them meet, without a row for every combination."""

from collections.abc import Iterable, Sequence
from itertools import combinations

Row = tuple[str, ...]
Pair = tuple[tuple[int, str], ...]
"""Two values, each with the number of its factor."""


def pairs(chosen: dict[int, str]) -> list[Pair]:
    """Pairs of the values of some factors."""
    return [*combinations(sorted(chosen.items()), 2)]


def rows(factors: Sequence[Sequence[str]], first: Iterable[Row] = ()) -> list[Row]:
    """Rows of one value of each factor, ``first`` those, in which each pair of values stands at
    least once.

    Greedy: a row begins with the first pair that no other has, and takes on what adds most of
    those.
    """
    numbers = range(len(factors))
    both = combinations(numbers, 2)
    missing = dict.fromkeys(
        pairs({i: a, j: b})[0] for i, j in both for a in factors[i] for b in factors[j]
    )
    made = list[Row]()
    waiting = [dict(enumerate(row)) for row in first]
    while missing or waiting:
        chosen = waiting.pop(0) if waiting else dict(next(iter(missing)))
        for number in set(numbers) - {*chosen}:
            rivals = {value: pairs({**chosen, number: value}) for value in factors[number]}
            chosen[number] = max(rivals, key=lambda value: len(missing.keys() & {*rivals[value]}))
        made.append(tuple(chosen[number] for number in numbers))
        for pair in pairs(chosen):
            missing.pop(pair, None)
    return made
