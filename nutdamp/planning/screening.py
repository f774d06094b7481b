"""Sequential screening: plans in as many dispersed cases as it takes to know whether enough comply.

All plans fly the same draws, the first cases first, in the stages of `montecarlo.study`. Of a plan
that is shown all are flown that ``nutdamp disperse`` flies; another one is given up as soon as its
interval, which errs once in a million times, lies on one side of the share required. `Checkpoints`
are what the sheet of a manoeuvre holds a flight against.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp import units
from nutdamp.common import results, work
from nutdamp.errors import Infeasible
from nutdamp.montecarlo.inputs import Draws
from nutdamp.montecarlo.study import (
    STAGES,
    STRIDE,
    Dispersed,
    Results,
    Study,
    affordable,
    next_stage,
    study_of,
)
from nutdamp.planning.plan import Plan, judge, unflown
from nutdamp.planning.verdict import Cases, Verdict, cases_of
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.schedule import Schedule


@dataclass(frozen=True, eq=False, repr=False)
class Dispersion(Dispersed, results.Tabled):
    """Schedule of a ``plan`` flown in dispersed cases; rows, a case each: number, true inputs,
    outputs.
    """

    core: Results
    plan: Plan = field(kw_only=True)

    @cached_property
    def verdict(self) -> Verdict:
        """Judgement of the plan by these cases."""
        return judge(self.plan, cases_of(self.core), self.core)

    def percentiles(
        self, levels: float | Iterable[float] = (50, 90, 95, 99, 99.7)
    ) -> results.Table:
        """Values of each output that so many percent of the cases do not exceed, a row a level.

        Fields: ``percent``, and the outputs with units in their names, such as ``nutation_deg``.
        Raises BadRequest.
        """
        shares = tuple(levels) if isinstance(levels, Iterable) else (levels,)
        fits = all(units.is_number(share) and 0.0 <= share <= 100.0 for share in shares)
        units.expect(fits, "levels", levels, "percentages from 0 to 100, such as (50, 99.7)")
        table: results.Table = results.view(self, "percentiles", tuple(map(float, shares)))
        return table


def verdict_of(plan: Plan) -> Verdict:
    """Judgement of a plan in as many dispersed cases as show its share, as ``nutdamp disperse``
    flies them; with nominal values where a comparison flies none.
    """
    if (
        not plan.feasible
        or plan.spacecraft.dispersions is None
        or not requirements.judged(plan.spacecraft)
    ):
        return judge(plan)
    with suppress(Infeasible):
        with work.budget("the dispersed cases", work.CASES):
            candidate = entered(plan, None)
        if candidate is not None:
            candidate.finish(None)
            return judge(plan, candidate.cases, candidate.results)
    return judge(plan)


LIKELIER = 0.01
"""Least possible gain in the complying share for a plan to be flown further, where too few cases
comply with each: a hundredth of the cases, which no operator would choose a plan by.
"""


@dataclass(eq=False)
class FlownPlan:
    """Plan, as ``variant`` of what its scheme plans, and its dispersed ``results``; ``final``: no
    more are to fly.
    """

    plan: Plan
    results: Results | None
    variant: str = ""
    final: bool = False
    cases: Cases = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if self.results is not None:
            self.cases = cases_of(self.results, final=self.final)

    @property
    def left(self) -> float:
        """Residual, rad, that the share required keeps: nutation, or the distance from a target
        axis if larger.
        """
        spacecraft = self.plan.spacecraft
        levels = {bound.part: level for bound, level in self.cases.levels.items()}
        nutation, aim = (
            levels.get(part) for part in (requirements.Part.NUTATION, requirements.aim(spacecraft))
        )
        return float(
            requirements.missed(spacecraft, math.inf if nutation is None else nutation, aim or 0.0)
        )

    def further(self, samples: int | None) -> None:
        """Fly the next stage of ``samples`` cases in all, default as many as show the share; raises
        Infeasible.
        """
        assert self.results is not None
        results = next_stage(self.results, samples)
        self.final = results is self.results
        self.results = results
        self.cases = cases_of(results, final=self.final)

    def decide(self, samples: int | None) -> None:
        """Fly stages until it is known whether enough cases comply,
        within the open budget of work.
        """
        while not self.final and self.cases.enough is None and not work.exhausted():
            self.further(samples)

    def finish(self, samples: int | None, above: float = 0.0) -> None:
        """Fly all stages, as of a plan that is shown, while a share ``above`` that may comply."""
        self.final = False  # fewer may have been enough before
        while not self.final and self.cases.high >= above:
            self.further(samples)


def entered(plan: Plan, samples: int | None, variant: str = "") -> FlownPlan | None:
    """Plan that has flown the first stage of its cases; None where that takes more than is left of
    the budget.
    """
    study = study_of(plan.spacecraft, plan.pulses)
    if not affordable(study, min(STAGES[0], samples or STAGES[0])):
        return None
    return FlownPlan(plan, next_stage(Results(study, 0), samples), variant)


def fly_compared(
    plans: Sequence[Plan],
    samples: int | None,
    choose: Callable[[Mapping[Plan, Cases]], Plan | None],
    eligible: Collection[Plan],
) -> dict[Plan, FlownPlan]:
    """Fly the cases of each plan that decide on it, and all of the plan that ``choose`` takes of
    the ``eligible``.

    ``samples``: number of cases in all, default as many as show the share. The screening has a
    budget of work of its own, each plan that is shown another. Plans with a case that cannot be
    flown are left out.
    """
    flown: dict[Plan, FlownPlan] = {}
    with work.budget("the dispersed cases", work.CASES * max(1.0, (samples or 0) / work.SAMPLES)):
        for plan in plans:
            with suppress(Infeasible), work.steps(1.0):
                candidate = entered(plan, samples)
                if candidate is not None:
                    if requirements.judged(plan.spacecraft):
                        candidate.decide(samples)
                    flown[plan] = candidate
    while True:
        cases = {plan: flown[plan].cases if plan in flown else unflown(plan) for plan in plans}
        chosen = choose(cases)
        candidate = None if chosen is None else flown.get(chosen)
        if candidate is None:
            break
        if candidate.final and candidate.cases.enough is not True:
            worth = (candidate.cases.complying or 0.0) + LIKELIER
            others = [each for each in flown.values() if each.plan in eligible and not each.final]
            rivals = [each for each in others if each.cases.high >= worth]
            candidate = max(rivals, key=lambda each: each.cases.high, default=candidate)
        if candidate.final:
            break
        try:
            candidate.finish(samples)
        except Infeasible:
            del flown[candidate.plan]
    return flown


CASES = 2 * STRIDE  # dispersed cases that are flown for each range: the first ones of the study
TAILS = (0.0015, 0.9985)  # quantiles of the cases between which a flight is as expected
STEPS, HALVINGS = (
    16,
    5,
)  # even steps in which the edge of a window is sought, and halvings of the one that holds it


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
        first, second, axial = map(operator.mul, self._initial.moments, self._initial.omega0)
        return _range(np.arctan2(np.hypot(first, second), np.abs(axial + self._initial.wheel)))

    def nutation_after(self, counts: Sequence[int]) -> Iterator[Range]:
        """Nutation, rad, after the first ``counts`` pulses, of the cases that comply after the last
        one.
        """
        spacecraft, schedule = self.study.model.spacecraft, self.study.model.schedule
        well = requirements.complies(self._flown(self.study, self._draws)[1])
        for count in counts:
            part = study_of(spacecraft, first_pulses(schedule, count), seed=self.study.seed)
            angles = np.broadcast_to(self._flown(part, self._draws)[0][0], CASES)
            yield (
                Range(float(angles[well].min()), float(angles[well].max()))
                if well.any()
                else _range(angles)
            )

    def window(self, probability: float) -> Range | None:
        """Shifts (s) of all pulses, to half a turn, with which the share ``probability`` complies;
        None without any.
        """
        if not self._complies(0.0, probability):
            return None
        first = min(pulse.loaded[0] for pulse in self.study.model.schedule)
        half = math.pi / self.study.model.spacecraft.fastest
        return Range(
            -self._reach(-1.0, min(half, first), probability), self._reach(1.0, half, probability)
        )

    def _reach(self, sense: float, most: float, probability: float) -> float:
        """Largest shift one way, s, up to ``most``: in even steps, then by halving the one that is
        too far.
        """
        step = most / STEPS
        good = next(
            (
                step * count
                for count in range(STEPS)
                if not self._complies(sense * step * (count + 1), probability)
            ),
            most,
        )
        if good < most:
            for _ in range(HALVINGS):
                step *= 0.5
                good += step * self._complies(sense * (good + step), probability)
        return good

    def _complies(self, shift: float, probability: float) -> bool:
        """True where the share ``probability`` of the cases complies with all pulses ``shift`` s
        later.
        """
        late = self._draws.get("timing offset", 0.0) + shift
        _, severity = self._flown(self.study, {**self._draws, "timing offset": late})
        return float(np.mean(requirements.complies(severity))) >= probability

    def _flown(self, study: Study, draws: Draws) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """`Results.values` and severity (n,) of the cases."""
        ends = study.flies(study.model.cases(draws))
        values = study.values(ends, CASES)
        return values, np.broadcast_to(study.severity(values, ends.drained), CASES)


def _range(values: object) -> Range:
    return Range(
        *np.quantile(np.broadcast_to(np.asarray(values, dtype=np.float64), CASES), TAILS).tolist()
    )


def first_pulses(schedule: Schedule, count: int) -> Schedule:
    """First ``count`` pulses of a schedule, and the blocks cut to them."""
    numbers = schedule.pulses_by_block
    counts = [sum(number < count for number in each) for each in numbers]
    blocks = [
        replace(block, count=number)
        for block, number in zip(schedule.blocks, counts, strict=False)
        if number
    ]
    return replace(schedule, pulses=schedule.pulses[:count], blocks=tuple(blocks))


def even(count: int, most: int) -> list[int]:
    """Up to ``most`` (two or more) of the numbers 1 … ``count``, evenly spaced, with the first and
    the last.
    """
    return sorted({round(number) for number in np.linspace(1, count, min(most, count)).tolist()})
