"""Draws: the same numbers for the same seed, whatever the number of threads or of cases.

Cases come in fixed blocks of `BLOCK`. Every input has a stream of its own in every block: the counter-based Philox
generator with the seed and the input's name in the key, the block in the counter. So case 1234 is the same in a study
of any size, and a tolerance that is tightened or dropped leaves the draws of all others as they were. Inputs that are
correlated are mixed of the streams of their group.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.correlation import Group, value_of
from nutdamp.dispersion.inputs import Input
from nutdamp.errors import Unsuitable

Array = NDArray[np.float64]
Draws = Mapping[str, "Array | float"]
"""Deviations from nominal by the name of the input, (n,) or one for all cases."""

BLOCK = 16_384
"""Cases that share a substream of each input."""

MOST_ATTEMPTS = 1_000
"""How often a case may be drawn again before the dispersions count as impossible."""


class Source:
    """Draws of the blocks of a study. Not to be shared by threads: each makes its own.

    ``physical`` tells which of the cases drawn can be (a mask (n,), or True for all); ``groups`` are the inputs that
    are correlated, those too that are not drawn: which others are makes no difference to a draw.
    """

    def __init__(
        self,
        inputs: Sequence[Input],
        seed: int,
        physical: Callable[[Draws], NDArray[np.bool_] | bool],
        groups: Iterable[Group] = (),
    ):
        self._random = [entry for entry in inputs if entry.kind != "bias"]
        self._fixed = {entry.name: entry.size for entry in inputs if entry.kind == "bias"}
        self._rows = {entry.name: row for row, entry in enumerate(self._random)}
        self._groups = [group for group in groups if any(name in self._rows for name in group.names)]
        grouped = {name for group in self._groups for name in group.names}
        self._alone = [entry for entry in self._random if entry.name not in grouped]
        self._keys = {
            name: np.array([seed, _number(name)], dtype=np.uint64)
            for name in dict.fromkeys([*self._rows, *sorted(grouped)])
        }
        self._bits = np.random.Philox(key=0)
        self._generator = np.random.Generator(self._bits)
        self._table = np.empty((len(self._random), BLOCK))
        self._physical = physical

    def block(self, number: int) -> tuple[dict[str, Array | float], NDArray[np.intp]]:
        """Deviations of the cases of block ``number`` (from 0), and which rows were drawn again (as often as it was).

        The arrays are used anew for the next block. Raises Unsuitable where no physical case is found.
        """
        self._fill(self._table, number, 0)
        draws = self._named(self._table)
        redrawn = []
        rows = _bad_rows(self._physical(draws), BLOCK)
        attempt = 0
        while len(rows):
            attempt += 1
            if attempt > MOST_ATTEMPTS:
                problem = "almost all draws are unphysical (C > 2A, thrust < 0, delay < 0)"
                raise Unsuitable(("dispersions",), problem)
            redrawn.append(rows)
            again = np.empty((len(self._random), len(rows)))
            self._fill(again, number, attempt)
            self._table[:, rows] = again
            rows = rows[_bad_rows(self._physical(self._named(again)), len(rows))]
        return draws, np.concatenate(redrawn) if redrawn else np.empty(0, dtype=np.intp)

    def _named(self, table: Array) -> dict[str, Array | float]:
        rows = zip(self._random, table, strict=True)
        return {**self._fixed, **{entry.name: row for entry, row in rows}}

    def _fill(self, table: Array, block: int, attempt: int) -> None:
        """Deviations of one block into ``table`` (inputs, cases); each ``attempt`` has a stream of its own."""
        for entry in self._alone:
            row, generator = table[self._rows[entry.name]], self._stream(entry.name, block, attempt)
            if entry.kind == "normal":
                generator.standard_normal(out=row)
                row *= entry.size
            else:
                generator.random(out=row)
                if entry.kind == "triangular":
                    row += generator.random(len(row))
                    row -= 1.0
                else:
                    row *= 2.0
                    row -= 1.0
                row *= entry.size
        for group in self._groups:
            count = (table.shape[1],)
            normals = [self._stream(name, block, attempt).standard_normal(count) for name in group.names]
            for name, normal in zip(group.names, group.mixed(normals), strict=True):
                if name in self._rows:
                    table[self._rows[name]] = value_of(self._random[self._rows[name]], normal)

    def _stream(self, name: str, block: int, attempt: int) -> np.random.Generator:
        """The generator, at the begin of what one input draws."""
        self._bits.state = {
            "bit_generator": "Philox",
            "state": {"counter": np.array([0, 0, attempt, block], dtype=np.uint64), "key": self._keys[name]},
            "buffer": np.zeros(4, dtype=np.uint64),
            "buffer_pos": 4,  # empty: begin with the counter
            "has_uint32": 0,
            "uinteger": 0,
        }
        return self._generator


def _bad_rows(good: NDArray[np.bool_] | bool, count: int) -> NDArray[np.intp]:
    return np.flatnonzero(~np.broadcast_to(np.asarray(good), count))


def _number(name: str) -> int:
    """A number of 64 bits for a name, the same everywhere."""
    return int.from_bytes(hashlib.blake2b(name.encode(), digest_size=8).digest(), "little")
