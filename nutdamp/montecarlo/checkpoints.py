"""Ranges of dispersed cases for the manoeuvre sheet: at t = 0, after some of the pulses, and of a shifted start."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.montecarlo.inputs import Draws
from nutdamp.montecarlo.statistics import OUTPUTS, measure
from nutdamp.montecarlo.study import STRIDE, Study, study_of
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.schedule import Schedule

CASES = 2 * STRIDE
"""Dispersed cases that are flown for each range: the first ones of the study."""

TAILS = (0.0015, 0.9985)
"""Quantiles of the cases between which a flight is as expected."""

STEPS, HALVINGS = 16, 5
"""Even steps in which the edge of a window is sought, and halvings of the one that holds it."""


class Range(NamedTuple):
    """Least and largest value."""

    least: float
    most: float


class Checkpoints:
    """Ranges of the first cases of a ``study``."""

    def __init__(self, study: Study) -> None:
        self.study, self._draws = study, study.draws_of_all(np.arange(CASES))
        self._initial = study.model.cases(self._draws)

    @property
    def spin(self) -> Range:
        """Spin at t = 0, rad/s."""
        return _range(self._initial.omega0[2])

    @property
    def nutation(self) -> Range:
        """Angle from H to the spin axis at t = 0, rad."""
        pairs = zip(self._initial.moments, self._initial.omega0, strict=True)
        first, second, axial = (np.asarray(moment * rate, dtype=np.float64) for moment, rate in pairs)
        return _range(np.arctan2(np.hypot(first, second), np.abs(axial + self._initial.wheel)))

    def nutation_after(self, counts: Sequence[int]) -> Iterator[Range]:
        """Nutation, rad, after the first ``counts`` pulses."""
        body, schedule = self.study.model.spacecraft, self.study.model.schedule
        for count in counts:
            part = study_of(body, first_pulses(schedule, count), seed=self.study.seed)
            yield _range(self._flown(part, self._draws)[0][0])

    def window(self, probability: float) -> Range | None:
        """Shifts (s) of all pulses with which the share ``probability`` of the cases complies, about none.

        As far as half a turn of spin or nutation, the faster, and no pulse before t = 0; None where too few comply
        without a shift.
        """
        schedule = self.study.model.schedule
        half, first = math.pi / self.study.model.spacecraft.fastest, min(pulse.loaded[0] for pulse in schedule)
        if not self._complies(0.0, probability):
            return None
        return Range(-self._reach(-1.0, min(half, first), probability), self._reach(1.0, half, probability))

    def _reach(self, sense: float, most: float, probability: float) -> float:
        """Largest shift one way, s, up to ``most``: in even steps, then by halving the one that is too far."""
        step = most / STEPS
        good = next(
            (step * count for count in range(STEPS) if not self._complies(sense * step * (count + 1), probability)),
            most,
        )
        if good < most:
            for _ in range(HALVINGS):
                step *= 0.5
                good += step * self._complies(sense * (good + step), probability)
        return good

    def _complies(self, shift: float, probability: float) -> bool:
        """True where the share ``probability`` of the cases complies with all pulses ``shift`` s later."""
        late = self._draws.get("timing offset", 0.0) + shift
        _, severity = self._flown(self.study, {**self._draws, "timing offset": late})
        return float(np.mean(severity <= 1.0)) >= probability

    def _flown(self, study: Study, draws: Draws) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Outputs (5, n) and severity (n,) of the cases."""
        ends, outputs = study.flies(study.model.cases(draws)), np.empty((len(OUTPUTS), CASES))
        measure(study.model, ends, outputs)
        return outputs, np.broadcast_to(study.severity(outputs, ends), CASES)


def _range(values: object) -> Range:
    return Range(*np.quantile(np.broadcast_to(np.asarray(values, dtype=np.float64), CASES), TAILS).tolist())


def first_pulses(schedule: Schedule, count: int) -> Schedule:
    """First ``count`` pulses of a schedule, and the blocks cut to them."""
    blocks: list[Block] = []
    left = count
    for block in schedule.blocks:
        if left > 0:
            blocks.append(replace(block, count=min(block.count, left)))
            left -= block.count
    return replace(schedule, pulses=schedule.pulses[:count], blocks=tuple(blocks))


def even(count: int, most: int) -> list[int]:
    """Up to ``most`` (two or more) of the numbers 1 … ``count``, evenly spaced, with the first and the last."""
    return sorted({round(number) for number in np.linspace(1, count, min(most, count)).tolist()})
