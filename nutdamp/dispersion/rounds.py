"""Some cases of a study flown by several threads, that take one portion after the other."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nutdamp.dispersion.draws import BLOCK, Draws
from nutdamp.dispersion.outputs import OUTPUTS, ROWS, measure, vectors
from nutdamp.physics import rigid_cases

if TYPE_CHECKING:
    from nutdamp.dispersion.study import Results

Array = NDArray[np.float64]

STRIDE = rigid_cases.BLOCK
"""Cases that are always flown together, as real widths need it."""

PORTION = 2 * STRIDE
"""Cases that a thread takes at once; blocks are multiples of it."""


class Round:
    """Some cases of a study, flown by several threads that take one portion after the other.

    A portion is a part of a block of draws: flying takes much longer than drawing, and few cases too are shared by the
    threads.
    """

    def __init__(self, results: Results, first: int, last: int, out: Array) -> None:
        self.results, self.first, self.last, self.out = results, first, last, out
        self.severity = np.empty(last - first)
        self.aspects = out[len(OUTPUTS) :].reshape(-1, 2, last - first)  # the same memory
        self.emptied = np.zeros(last - first, dtype=bool)
        self.portions = range(first // PORTION, math.ceil(last / PORTION))
        self.taken = 0
        self.finished = 0
        self.redrawn = 0
        self.failures: list[BaseException] = []
        self.lock = threading.Lock()

    def fly(self, threads: int, watch: Callable[[int], None], stopped: Callable[[], bool]) -> tuple[int, int]:
        """How many cases were flown, always the first ones, and how many draws were made again."""
        count = min(threads, len(self.portions))
        # Daemons: an interrupt need not wait for the portions that are in work, which nobody uses then.
        workers = [threading.Thread(target=self._work, args=(stopped,), daemon=True) for _ in range(count)]
        for worker in workers:
            worker.start()
        try:
            for worker in workers:
                while worker.is_alive():
                    worker.join(0.1)
                    if worker.is_alive():
                        watch(max(self._flown, self.first))
        except BaseException:
            self.taken = len(self.portions)  # nothing more is begun
            raise
        if self.failures:
            raise self.failures[0]
        return max(self._flown - self.first, 0), self.redrawn

    @property
    def _flown(self) -> int:
        """Where the cases end that are flown; below ``first`` where none is."""
        return min(self.last, (self.portions[0] + self.finished) * PORTION)

    def _work(self, stopped: Callable[[], bool]) -> None:
        try:
            source = self.results.study.source()
            drawn, block = None, -1
            while not stopped():
                with self.lock:
                    if self.taken >= len(self.portions):
                        return
                    portion = self.portions[self.taken]
                    self.taken += 1
                begin = max(self.first, portion * PORTION)
                end = min(self.last, (portion + 1) * PORTION)
                if drawn is None or begin // BLOCK != block:
                    block = begin // BLOCK
                    drawn = source.block(block)
                redrawn = self._fly(drawn, block * BLOCK, begin, end)
                with self.lock:
                    self.finished += 1
                    self.redrawn += redrawn
        except BaseException as failure:  # handed to the thread that waits
            with self.lock:
                self.failures.append(failure)
                self.taken = len(self.portions)

    def _fly(self, drawn: tuple[Draws, NDArray[np.intp]], start: int, begin: int, end: int) -> int:
        """Fly the cases from ``begin`` to ``end`` of the block that starts at ``start``; returns how often they were
        drawn again.
        """
        study, early = self.results.study, self.results.early
        draws, redrawn = drawn
        # Whole strides are flown, even for fewer cases: what flies them may let one depend on its stride.
        low, high = begin - begin % STRIDE, end + -end % STRIDE
        rows = slice(low - start, high - start)
        ends = study.flies(study.model.cases({n: d if isinstance(d, float) else d[rows] for n, d in draws.items()}))
        inner = slice(begin - low, end - low)
        outputs = np.empty((len(OUTPUTS), high - low))
        measure(study.model, ends, outputs)
        place = slice(begin - self.first, end - self.first)
        self.out[: len(OUTPUTS), place] = outputs[:, inner]
        self.severity[place] = study.severity(outputs, ends)[inner]
        self.emptied[place] = np.broadcast_to(np.real(ends.drained) > 1.0, high - low)[inner]
        if ends.aspects is not None:
            self.aspects[:, :, place] = ends.aspects[:, :, inner]
        if low < early.shape[1]:
            outcome = np.empty((ROWS, high - low))
            vectors(study.model, ends, outcome)
            early[:, begin:end] = outcome[:, inner]
        return int(np.count_nonzero((redrawn >= begin - start) & (redrawn < end - start)))
