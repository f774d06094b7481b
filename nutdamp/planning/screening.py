"""Sequential screening of plans in dispersed cases, and on-times trimmed to what enough cases need.

All plans fly the same draws, the first cases first. From these the complying share is bounded by an exact interval
(Clopper & Pearson 1934), which errs once in a million times; a plan that could not be chosen even at its favourable end
is flown no further. Compliance with shorter on-times is predicted: flown ends move by the slopes of the closed form.
What comes out is flown, in fresh cases too; where too few cases comply then, fewer are predicted to the next time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.montecarlo.cases import DispersedModel, number_of
from nutdamp.montecarlo.inputs import Draws
from nutdamp.montecarlo.propagated import ClosedForm
from nutdamp.montecarlo.statistics import EXACT_CASES, OUTPUTS, binomial_interval, vectors
from nutdamp.montecarlo.study import CONFIDENCE, EARLY, Results, Study, run, study_of, threads_here
from nutdamp.physics import attitude
from nutdamp.planning import plan as planning
from nutdamp.planning.plan import Plan, Share
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.model import Spacecraft, Vector, required_share
from nutdamp.spacecraft.requirements import SAME_COST, Left, Part
from nutdamp.spacecraft.schedule import Schedule, channel_pulse

STAGES = (2_048, 8_192)  # numbers of cases after which plans are screened

CERTAIN, LIKELIER = 1.0 - 1e-6, 0.01
"""Confidence of the intervals by which plans are left out; least possible gain in the complying share for a plan to be
flown further, where too few cases comply with each."""

AS_GOOD = 1.05
"""Without a requirement: candidates within this factor of the least angle count as equal, so far apart may be luck."""


@dataclass(frozen=True, slots=True)
class Cases:
    """Result of one schedule in ``samples`` of the ``requested`` dispersed cases of ``seed``.

    ``complying``: the share that keeps the requirement, None without one; ``probability``: the share that must.
    ``levels``: what that share of the cases does not exceed, rad, by part; the spin error has none.
    """

    samples: int
    requested: int
    seed: int
    complying: float | None
    probability: float
    levels: Mapping[Part, float]

    @property
    def decided(self) -> bool:
        """True if all cases have flown."""
        return self.samples >= self.requested

    @property
    def met(self) -> bool | None:
        """Compliance of enough of the flown cases; None where nothing is required."""
        return None if self.complying is None else self.complying >= self.probability

    @property
    def share(self) -> Share | None:
        """Share of all requested cases; None where nothing is required."""
        met, done = self.complying, self.samples
        if met is None:
            return None
        bounds = (met, met) if self.decided else binomial_interval(round(met * done), done, CERTAIN)
        return Share(*bounds, self.probability)


def cases_of(results: Results, requested: int | None = None) -> Cases:
    """Result of a study; ``requested``: number of cases in all, default those of the ``results``."""
    probability, levels = results.probability, {}
    for part in (Part.NUTATION, requirements.aim(results.study.model.spacecraft)):
        distribution = results.distribution(part.value)
        assert distribution is not None
        levels[part] = float(distribution.quantiles(np.array([probability]))[0])
    count = requested or results.requested
    return Cases(results.done, count, results.study.seed, results.met_fraction, probability, levels)


def equal_from(share: float, samples: int) -> float:
    """Least share of ``samples`` cases equal to a ``share`` of them but for the sampling error."""
    return binomial_interval(round(share * samples), samples, CONFIDENCE)[0]


@dataclass(eq=False)
class PlanCandidate:
    """Plan, as ``variant`` of what its scheme plans, and its dispersed ``results``; ``share``: see `Share`."""

    plan: Plan
    variant: str
    cases: Cases
    results: Results | None = None
    share: Share | None = None

    @property
    def nutation(self) -> float:
        """Nutation, rad, not exceeded in the share of cases required."""
        return self.cases.levels[Part.NUTATION]

    @property
    def off(self) -> float:
        """Distance of H from its goal, rad, not exceeded in the required share of cases."""
        return self.cases.levels[requirements.aim(self.plan.spacecraft)]

    @property
    def met(self) -> float | None:
        """Complying share; None where nothing is required."""
        return self.cases.complying

    @property
    def left(self) -> float:
        """Residual, rad: nutation, or the distance from a target axis where that is larger."""
        return float(requirements.missed(self.plan.spacecraft, self.nutation, self.off))

    @property
    def nominal(self) -> float | None:
        """Residual with nominal values, rad."""
        body, flown = self.plan.spacecraft, self.plan.flown
        return None if flown is None else float(requirements.missed(body, flown.nutation, flown.axis_error))

    @property
    def rank(self) -> float:
        """Rank, the least first: the share that does not comply, or the residual."""
        return self.left if self.met is None else 1.0 - self.met


def entered(plan: Plan, variant: str, study: Study, samples: int) -> PlanCandidate:
    """A candidate that has flown the first of ``samples`` cases of a study."""
    results = _run(Results(study, min(STAGES[0], samples)))
    cases = cases_of(results, samples)
    return PlanCandidate(plan, variant, cases, results, cases.share)


def _run(results: Results) -> Results:
    """`run`, counted as work."""
    work.spend(results.study.flies.effort * (results.requested - results.done))
    return run(results, threads=threads_here())


def affordable(study: Study, samples: int) -> bool:
    """True if the open budget of work suffices for so many cases, which are flown at once."""
    return study.flies.effort * samples <= work.left()


def fly_compared(
    plans: Sequence[Plan],
    samples: int,
    choose: Callable[[Mapping[Plan, Share]], Plan | None],
) -> dict[Plan, PlanCandidate]:
    """Fly as many of the ``samples`` cases of each plan as decide on its compliance, within the budget of work.

    All of them with the plan that `choose` takes by the shares. Plans with a case that cannot be flown are left out.
    """
    flown: dict[Plan, PlanCandidate] = {}
    for plan in plans:
        study = study_of(plan.spacecraft, plan.pulses)
        if affordable(study, min(STAGES[0], samples)):
            with suppress(Infeasible), work.steps(1.0):
                flown[plan] = entered(plan, "", study, samples)
    while not work.exhausted():
        first = _undecided(plans, flown, samples, choose)
        if first is None:
            break
        done = first.cases.samples
        if not affordable(study_of(first.plan.spacecraft, first.plan.pulses), _stage(done, samples) - done):
            break
        try:
            _further(first, samples)
        except Infeasible:
            del flown[first.plan]
    return flown


def _undecided(
    plans: Sequence[Plan],
    flown: Mapping[Plan, PlanCandidate],
    samples: int,
    choose: Callable[[Mapping[Plan, Share]], Plan | None],
) -> PlanCandidate | None:
    """Next candidate to fly further; None where all is decided."""
    shares = shares_of(plans, flown)
    ahead = {plan: candidate for plan, candidate in flown.items() if candidate.cases.samples < samples}
    undecided = [plan for plan in ahead if shares and shares[plan].met is None]
    if undecided:
        return ahead[undecided[0]]
    chosen = choose(shares)
    if chosen in ahead:
        return ahead[chosen]
    if chosen is None or chosen not in flown or not shares or shares[chosen].met:
        return None
    worth = shares[chosen].low + LIKELIER

    def may_win(plan: Plan) -> bool:
        best = replace(shares[plan], low=shares[plan].high)
        return best.high >= worth and choose({**shares, plan: best}) is plan

    return next((ahead[plan] for plan in ahead if may_win(plan)), None)


def shares_of(plans: Sequence[Plan], flown: Mapping[Plan, PlanCandidate]) -> dict[Plan, Share]:
    """Complying share of each plan, from none to all where cases have not flown; nothing where none is required."""
    if not plans or not requirements.judged(plans[0].spacecraft):
        return {}
    unknown = Share(0.0, 1.0, required_share(plans[0].spacecraft.requirement))
    return {plan: (flown[plan].share or unknown) if plan in flown else unknown for plan in plans}


def _stage(done: int, samples: int) -> int:
    """Number of cases after which to screen next."""
    return next((count for count in STAGES if done < count < samples), samples)


def _further(candidate: PlanCandidate, samples: int) -> None:
    """Fly the cases of the next stage."""
    assert candidate.results is not None
    stage = _stage(candidate.cases.samples, samples)
    exact = stage <= EXACT_CASES  # beyond, cases are counted and not kept: from the first one on
    candidate.results = _run(candidate.results.extended(stage) if exact else Results(candidate.results.study, stage))
    candidate.cases = cases_of(candidate.results, samples)
    candidate.share = candidate.cases.share


def fly_all(
    candidates: list[PlanCandidate],
    samples: int,
    probability: float,
    always: Sequence[PlanCandidate] = (),
    watch: Callable[[], None] = lambda: None,
) -> None:
    """Fly all ``samples`` cases of those that `ranked` may choose, and of ``always``; ``watch`` follows each step.

    Those that have a case that cannot be flown leave the ``candidates``.
    """

    def promise(candidate: PlanCandidate) -> tuple[bool, bool, float]:
        may = candidate.share is not None and candidate.share.high >= probability
        return candidate not in always, not may, candidate.plan.pulses.cost if may else candidate.rank

    while candidates:
        some = [candidate for candidate in always if candidate in candidates]
        some += _hopeful(candidates, samples, probability)
        some = [candidate for candidate in some if candidate.cases.samples < samples]
        if not some:
            return
        first = min(some, key=promise)
        try:
            _further(first, samples)
        except Infeasible:
            candidates.remove(first)
        watch()


def _hopeful(candidates: list[PlanCandidate], samples: int, probability: float) -> list[PlanCandidate]:
    """Candidates that may still be chosen."""
    bounds = [(each, each.share.low, each.share.high) for each in candidates if each.share is not None]
    if len(bounds) < len(candidates):
        return _as_near(candidates, samples, probability)
    sure = [candidate.plan.pulses.cost for candidate, low, _ in bounds if low >= probability]
    if sure:
        comparable = len({candidate.plan.pulses.propellant is None for candidate in candidates}) == 1
        most = min(sure) * (1.0 + SAME_COST) if comparable else math.inf
        return [each for each, _, high in bounds if high >= probability and each.plan.pulses.cost <= most]
    least = min(probability, equal_from(max((low for _, low, _ in bounds), default=0.0), samples))
    return [candidate for candidate, _, high in bounds if high >= least]


def _as_near(candidates: list[PlanCandidate], samples: int, probability: float) -> list[PlanCandidate]:
    """Candidates that may leave as little as the best complete one, where nothing is required."""
    ranks = [candidate.rank for candidate in candidates if candidate.cases.samples >= samples]
    if not ranks:
        return candidates

    def largest_share(candidate: PlanCandidate) -> float:
        """Of all cases, that may leave that little."""
        body, results = candidate.plan.spacecraft, candidate.results
        if results is None or results.values is None:
            return 1.0
        parts = [Part.NUTATION] if body.goal.axis is None else [Part.NUTATION, requirements.aim(body)]
        rows = results.values[[OUTPUTS.index(part.value) for part in parts], : results.done]
        count = min(int(np.count_nonzero(row <= AS_GOOD * min(ranks))) for row in rows)
        return binomial_interval(count, results.done, CERTAIN)[1]

    return [candidate for candidate in candidates if largest_share(candidate) >= probability]


FRESH = 211  # seed of cases that nothing was chosen by

SHORTEST, HALVINGS, FINER, FEW = 0.8, 7, 5, 8
"""Least share of on-times when they are shortened; steps in which all are shortened together, and then each alone once
more; pulses up to which that is done."""

PASSES, NEARLY = 3, 2.0
"""Times that on-times are shortened, and standard deviations of complying cases to spare up to which once will do."""

WORST, THIN, SMALL = 20.0, 8, 0.02
"""How many times the cases that may fail are all predicted, and for how many cases one of the others stands; share of
on-times of difference quotients."""

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
    """Plan with the shortest on-times for which `complies` holds; the same one on ticks, of blocks or of no channel."""
    channels = {channel.name: channel for channel in plan.spacecraft.channels}
    fixed = plan.spacecraft.limits.tick is not None or bool(plan.pulses.blocks) or not len(plan.pulses)
    if fixed or any(pulse.channel not in channels or pulse.on_time == 0.0 for pulse in plan.pulses):
        return plan
    every, best = range(len(plan.pulses)), plan
    alone = [((index,), FINER) for index in every] if len(every) <= FEW else []
    for which, halvings in ((every, HALVINGS), *alone):
        low, high, long = SHORTEST, 1.0, best
        for _ in range(halvings):
            middle = 0.5 * (low + high)
            shorter = _scaled(long, [middle if index in which else 1.0 for index in every], complies)
            best, low, high = (best, middle, high) if shorter is None else (shorter, low, middle)
    return best


def _scaled(plan: Plan, ratios: Sequence[float], complies: Callable[[Plan], bool]) -> Plan | None:
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
        shares, samples = (self.candidate.met or 0.0, self.fresh.met), self.candidate.cases.samples
        return [round((1.0 - met) * samples) for met in shares]

    @cached_property
    def _slopes(self) -> list[tuple[Vector, Vector, NDArray[np.int_]]]:
        """Ends (10, n) of cases of both draws, their slopes (k, 10, n), and for how many cases each stands, (n,).

        All that are nearest to failing, and some of the others. Slopes by the relative on-time of each pulse, or of all
        of many, in the closed form; it errs by what it takes wide pulses for, nearly alike in all cases.
        """
        body = self.plan.spacecraft
        # Directions of H at the end of nominal flights, in body axes at t = 0.
        flights, back = (propagation.flown(body, each) for each in self._schedules), body.initial.quaternion
        momenta = [attitude.rotate(attitude.conjugate(back), flight.last_momentum) for flight in flights]
        heads = np.array([momentum / np.linalg.norm(momentum) for momentum in momenta])
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
        """True if of each draw ``fewer`` cases than may, or no more than now, are predicted to fail with a plan."""
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
    return vectors(model, ClosedForm(model)(cases), number_of(cases))


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
