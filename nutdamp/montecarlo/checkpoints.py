"""Abort criteria: where most dispersed cases are after some of the pulses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from nutdamp.montecarlo.propagated import sun_seen
from nutdamp.montecarlo.statistics import OUTPUTS, measure
from nutdamp.montecarlo.study import STRIDE, Study, study_of
from nutdamp.spacecraft.equipment import Block
from nutdamp.spacecraft.schedule import Schedule

CASES = STRIDE
"""Dispersed cases that are flown to each milestone: the first ones of the study."""

Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Milestone:
    """Milestone after so many ``pulses``: values that a share of the cases does not exceed.

    ``nutation`` rad is not exceeded; ``spin`` (rad/s) and ``sun_angle`` (rad, of H, None without a Sun) are between
    least and most, beyond which lies as much of the rest on either side.
    """

    pulses: int
    nutation: float
    spin: Range
    sun_angle: Range | None


def milestones(study: Study, after: Sequence[int], probability: float) -> Iterator[Milestone]:
    """Milestones that the share ``probability`` of the cases of a ``study`` keeps ``after`` pulses of its schedule."""
    body, schedule = study.model.spacecraft, study.model.schedule
    drawn, _ = study.source().block(0)
    draws = {name: draw if isinstance(draw, float) else draw[:CASES].copy() for name, draw in drawn.items()}
    tails = np.array([0.5 * (1.0 - probability), 0.5 * (1.0 + probability)])
    for count in after:
        part = study_of(body, first_pulses(schedule, count), seed=study.seed)
        cases = part.model.cases(draws)
        ends, outcome = part.flies(cases), np.empty((len(OUTPUTS), CASES))
        measure(part.model, ends, outcome)
        sun_angle = None
        if body.sun is not None:
            momentum = np.array([np.broadcast_to(component, CASES) for component in ends.after])
            sun = sun_seen(part.model, cases, CASES)
            across = np.linalg.norm(np.cross(momentum, sun, axis=0), axis=0)
            sun_angle = _range(np.arctan2(across, np.sum(momentum * sun, axis=0)), tails)
        spin = _range(np.broadcast_to(np.asarray(ends.spin, dtype=float), CASES), tails)
        yield Milestone(count, float(np.quantile(outcome[0], probability)), spin, sun_angle)


def _range(values: NDArray[np.float64], tails: NDArray[np.float64]) -> Range:
    least, most = np.quantile(values, tails).tolist()
    return least, most


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
