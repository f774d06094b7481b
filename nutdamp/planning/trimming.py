"""On-times of a plan shortened as far as enough dispersed cases comply, in cases of a fresh seed too.

Which cases comply with shorter on-times is predicted: their flown ends move by the slopes of the closed form. What
comes out is flown; where too few cases comply then, fewer are predicted to the next time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.montecarlo.cases import DispersedModel, number_of
from nutdamp.montecarlo.closed_form import ClosedForm
from nutdamp.montecarlo.inputs import Draws
from nutdamp.montecarlo.statistics import ROWS, vectors
from nutdamp.montecarlo.study import EARLY, Results, run, study_of, threads_here
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.planning.plan import Plan
from nutdamp.planning.screening import Cases, PlanCandidate, cases_of, entered, fly_all
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import SAME_COST, Left, Part
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

FRESH = 211
"""Seed of cases that nothing was chosen by."""

SHORTEST = 0.8
"""Least share of on-times when they are shortened: together, and then each alone once more."""

HALVINGS, FINER = 7, 5
"""Steps in which all on-times are shortened together, and then each alone."""

FEW = 8
"""Pulses up to which each is shortened alone."""

PASSES, NEARLY = 3, 2.0
"""Times that on-times are shortened, and standard deviations of complying cases to spare up to which once will do."""

WORST, THIN = 20.0, 8
"""How many times the cases that may fail are all predicted, and for how many cases one of the others stands."""

SMALL = 0.02
"""Share of on-times of difference quotients."""

TRIMS, RESERVE = 4, 0.2
"""Plans that are flown in each pass, and the standard deviations by which fewer cases than may are predicted to fail.
"""


class Fresh(NamedTuple):
    """Result in ``cases`` of a fresh seed, with the 95 % ``interval`` of the share that complies."""

    cases: Cases
    interval: tuple[float, float]
    results: Results | None = None

    @property
    def met(self) -> float:
        """Share of the cases that complies."""
        return self.cases.complying or 0.0


def fresh_of(chosen: PlanCandidate, samples: int) -> Fresh | None:
    """Chosen plan in fresh cases; None where nothing is required of it."""
    if chosen.met is None:
        return None
    study = study_of(chosen.plan.spacecraft, chosen.plan.pulses, seed=FRESH)
    try:
        results = run(Results(study, samples), threads=threads_here())
    except Infeasible:  # a case among them takes too long to fly
        return None
    return Fresh(cases_of(results), results.interval, results)


def trimmed(plan: Plan, complies: Callable[[Plan], bool]) -> Plan:
    """Plan with the shortest on-times for which `complies` holds; the same one where nothing is to be gained.

    Plans on ticks, of command blocks, of nothing, or with pulses of no channel stay as they are.
    """
    channels = {channel.name: channel for channel in plan.spacecraft.channels}
    fixed = plan.spacecraft.limits.tick is not None or bool(plan.pulses.blocks) or not len(plan.pulses)
    if fixed or any(pulse.channel not in channels or pulse.on_time == 0.0 for pulse in plan.pulses):
        return plan
    everywhere = list(range(len(plan.pulses)))
    best = _shortened(plan, everywhere, HALVINGS, complies)
    for index in everywhere if len(everywhere) <= FEW else ():
        best = _shortened(best, [index], FINER, complies)
    return best


def _shortened(plan: Plan, which: list[int], halvings: int, complies: Callable[[Plan], bool]) -> Plan:
    """Pulses with the indices ``which`` shortened alike, by bisection."""
    low, high, best = SHORTEST, 1.0, plan
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        ratios = [middle if index in which else 1.0 for index in range(len(plan.pulses))]
        shorter = _scaled(plan, ratios, complies)
        best, low, high = (best, middle, high) if shorter is None else (shorter, low, middle)
    return best


def _scaled(plan: Plan, ratios: Sequence[float], complies: Callable[[Plan], bool] = lambda _: True) -> Plan | None:
    """Plan with on-times times ``ratios``; None where it breaks a limit or its requirement, or ``complies`` fails."""
    body, schedule = plan.spacecraft, _longer(plan, ratios)
    if keeps_limits(body, schedule) and complies(replace(plan, schedule=schedule)):
        with suppress(Infeasible):
            scaled = planning.judged(body, plan.scheme, schedule, plan.options)
            if scaled.feasible and scaled.meets_requirement is not False:
                return scaled
    return None


def _longer(plan: Plan, ratios: Sequence[float]) -> Schedule:
    """Schedule of a plan with on-times times ``ratios``."""
    channels = {channel.name: channel for channel in plan.spacecraft.channels}
    pulses = tuple(
        pulse if ratio == 1.0 else channel_pulse(channels[pulse.channel], pulse.t, ratio * pulse.on_time)
        for pulse, ratio in zip(plan.pulses, ratios, strict=True)
    )
    return replace(plan.pulses, pulses=pulses)


@dataclass(frozen=True)
class FlownPlan:
    """A candidate and its result in fresh cases."""

    candidate: PlanCandidate
    fresh: Fresh

    @property
    def plan(self) -> Plan:
        """The plan flown."""
        return self.candidate.plan

    @property
    def enough(self) -> bool:
        """True if enough cases comply in both draws."""
        return min(self.candidate.met or 0.0, self.fresh.met) >= self.candidate.cases.probability

    @property
    def known(self) -> bool:
        """True if the end vectors of all cases are known, and decide on compliance alone."""
        body, fresh = self.plan.spacecraft, self.fresh.results
        alone = not body.keep and body.tank is None and body.goal.spin is None
        return alone and self.candidate.results is not None and fresh is not None and fresh.done <= EARLY

    @property
    def may_fail(self) -> float:
        """Number of cases of each draw that may fail."""
        return (1.0 - self.candidate.cases.probability) * self.candidate.cases.samples

    @cached_property
    def failing(self) -> list[int]:
        """Number of cases of each draw that fail."""
        return [
            round((1.0 - met) * self.candidate.cases.samples) for met in (self.candidate.met or 0.0, self.fresh.met)
        ]

    @cached_property
    def _slopes(self) -> list[tuple[Vector, Vector, NDArray[np.int_]]]:
        """Ends (10, n) of cases of both draws, their slopes (k, 10, n), and for how many cases each stands, (n,).

        All that are nearest to failing, and some of the others. By what share each pulse, or all of many, is on longer,
        in the closed form, of which the nutation is exact too; it errs by what it takes wide pulses for, nearly alike
        in all cases.
        """
        heads = np.array([_heading(self.plan.spacecraft, schedule) for schedule in self._schedules])
        wide = np.tile((heads[0] - heads[1:]) / SMALL, 2)[:, :, None] - self._nominal[1][:, 2:8]
        slopes = []
        for flown in (self.candidate.results, self.fresh.results):
            assert flown is not None
            ends = flown.early[:, : flown.done]
            severity, worst = self._severity(ends), min(math.ceil(WORST * self.may_fail) + 1, flown.done)
            weights = np.where(severity >= np.sort(severity)[-worst], 1, 0)
            weights[np.flatnonzero(weights == 0)[::THIN]] = THIN
            taken = np.flatnonzero(weights)
            here, slope = self._moved(flown.study.draws_of_all(taken))
            slope[:, 2:8] += wide
            slopes.append((np.vstack([here[:2], ends[2:, taken]]), slope, weights[taken]))
        return slopes

    @cached_property
    def _nominal(self) -> tuple[Vector, Vector]:
        """End (10, 1) with nominal values in the closed form, and its slopes (k, 10, 1)."""
        return self._moved({})

    @cached_property
    def _schedules(self) -> list[Schedule]:
        """The schedule, and those with each pulse, or all of many, on a little shorter."""
        count = len(self.plan.pulses)
        ratios = 1.0 - SMALL * (np.eye(count) if count <= FEW else np.ones((1, count)))
        return [self.plan.pulses, *(_longer(self.plan, row.tolist()) for row in ratios)]

    def _moved(self, draws: Draws) -> tuple[Vector, Vector]:
        """Ends (10, n) of cases in the closed form, and their slopes (k, 10, n)."""
        there = [_ends(self.plan.spacecraft, schedule, draws) for schedule in self._schedules]
        return there[0], (there[0] - np.array(there[1:])) / SMALL

    def predicted(self, plan: Plan, fewer: float) -> bool:
        """True if enough cases of each draw are predicted to comply with a plan of other on-times.

        ``fewer`` cases than may are predicted to fail, unless as many do now.
        """
        nominal, slopes = self._nominal
        pairs = list(zip(plan.pulses, self.plan.pulses, strict=True))
        more = np.array([short.on_time / long.on_time - 1.0 for short, long in pairs[: len(slopes)]])
        # Slopes err by their change, nearly alike in all cases.
        bent = _ends(plan.spacecraft, plan.pulses, {}) - nominal - np.tensordot(more, slopes, 1)
        for (ends, slopes, weights), failing in zip(self._slopes, self.failing, strict=True):
            severity = self._severity(ends + np.tensordot(more, slopes, 1) + bent)
            if weights[severity > 1.0].sum() > max(self.may_fail - fewer, min(failing, self.may_fail)):
                return False
        return True

    def _severity(self, ends: Vector) -> Vector:
        """Severity (n,) of cases by their end vectors (10, n)."""
        body = self.plan.spacecraft
        aim = 2 if requirements.aim(body) is Part.SHIFT else 5
        chord = np.sqrt((ends[aim : aim + 3] ** 2).sum(axis=0))
        left = Left(np.arctan(np.hypot(ends[0], ends[1])), 2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)), 0.0)
        return np.asarray(requirements.severity(body, left))


def _ends(body: Spacecraft, schedule: Schedule, draws: Draws) -> Vector:
    """End vectors (10, n) of cases in the closed form."""
    model = DispersedModel(body, schedule)
    cases = model.cases(draws)
    ends = np.empty((ROWS, number_of(cases)))
    vectors(model, ClosedForm(model)(cases), ends)
    return ends


def _heading(body: Spacecraft, schedule: Schedule) -> Vector:
    """Direction (3,) of H at the end of the nominal flight, in body axes at t = 0."""
    axis = attitude.rotate(attitude.conjugate(body.initial.quaternion), propagation.flown(body, schedule).last_momentum)
    return np.asarray(axis / np.linalg.norm(axis))


def shortest(chosen: PlanCandidate, fresh: Fresh) -> FlownPlan:
    """The plan of a candidate with on-times as short as the required share allows, in fresh cases too, flown."""
    best, variant = FlownPlan(chosen, fresh), f"{chosen.variant}, trimmed"
    for _ in range(PASSES):
        shorter, tries = _shorter(best, variant)
        if shorter is None:
            break
        best = shorter
        if tries == 0 and best.may_fail - max(best.failing) <= NEARLY * math.sqrt(best.may_fail):
            break
    return best


def _shorter(long: FlownPlan, variant: str) -> tuple[FlownPlan | None, int]:
    """Plan with shorter on-times, None where nothing is gained, and how many were flown in vain before."""

    def flown(shorter: Plan) -> FlownPlan | None:
        samples = long.candidate.cases.samples
        with suppress(Infeasible):
            candidate = entered(shorter, variant, study_of(shorter.spacecraft, shorter.pulses), samples)
            fly_all([candidate], samples, 0.0)
            fresh = fresh_of(candidate, samples)
            return None if fresh is None else FlownPlan(candidate, fresh)
        return None

    def complies(shorter: Plan) -> bool:
        short = flown(shorter)
        return short is not None and short.enough

    fewer = RESERVE * math.sqrt(long.may_fail)
    for tries in range(TRIMS):
        best = trimmed(long.plan, partial(long.predicted, fewer=fewer) if long.known else complies)
        if best is long.plan or best.pulses.cost > long.plan.pulses.cost * (1.0 - SAME_COST):
            break
        short = flown(best)
        if short is None or short.enough:
            return short, tries
        fewer += max(short.failing) - long.may_fail + 1.0
    return None, 0
