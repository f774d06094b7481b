"""Sequential screening: many plans in dispersed cases, few of all, all of those that may be chosen after a few.

All plans fly the same draws, the first cases first. The complying share of all cases is bounded by an exact interval
from the first ones (Clopper & Pearson 1934), so wide that it errs once in a million times; a plan that could not be
chosen even at the favourable end of its interval is flown no further.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.montecarlo.statistics import EXACT_CASES, OUTPUTS, binomial_interval
from nutdamp.montecarlo.study import CONFIDENCE, Results, Study, run, study_of, threads_here
from nutdamp.planning.plan import Plan
from nutdamp.planning.recommendation import Share
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import required_share
from nutdamp.spacecraft.requirements import SAME_COST, Part

STAGES = (2_048, 8_192)
"""Numbers of cases after which plans are screened."""

CERTAIN = 1.0 - 1e-6
"""Confidence of the intervals by which plans are left out."""

LIKELIER = 0.01
"""Least possible gain in the complying share for a plan to be flown further, where too few cases comply with each."""

AS_GOOD = 1.05
"""Without a requirement: candidates within this factor of the least angle count as equal, so far apart may be luck."""


@dataclass(frozen=True, slots=True)
class Cases:
    """Result of one schedule in ``samples`` of the ``requested`` dispersed cases of ``seed``.

    ``complying``: the share that keeps every part of the requirement, None where nothing is required;
    ``probability``: the share that must. ``levels``: what that share of the cases does not exceed, rad, by part; the
    spin error has none.
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


def cases_of(results: Results, requested: int | None = None) -> Cases:
    """Result of a study; ``requested``: number of cases in all, default those of the ``results``."""
    probability, levels = results.probability, {}
    for part in (Part.NUTATION, requirements.aim(results.study.model.spacecraft)):
        distribution = results.distribution(part.value)
        assert distribution is not None
        levels[part] = float(distribution.quantiles(np.array([probability]))[0])
    count = results.requested if requested is None else requested
    return Cases(results.done, count, results.study.seed, results.met_fraction, probability, levels)


def equal_from(share: float, samples: int) -> float:
    """Least share of ``samples`` cases equal to a ``share`` of them but for the sampling error."""
    return binomial_interval(round(share * samples), samples, CONFIDENCE)[0]


@dataclass(eq=False)
class PlanCandidate:
    """Plan and its dispersed ``results``.

    ``variant`` says how it differs from what its scheme plans. Of all cases the share that complies lies between
    ``low`` and ``high``; these are None where nothing is required.
    """

    plan: Plan
    variant: str
    cases: Cases
    results: Results | None = None
    low: float | None = field(init=False, default=None)
    high: float | None = field(init=False, default=None)

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
    def share(self) -> Share | None:
        """Share of all cases; None where nothing is required."""
        if self.low is None or self.high is None:
            return None
        return Share(self.low, self.high, self.cases.probability)

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
    made = PlanCandidate(plan, variant, cases_of(results, samples), results)
    _bound(made, samples)
    return made


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
    """Fly as many of the ``samples`` cases of each plan as decide on its compliance.

    All of them with the plan that `choose` takes by the shares. Plans with a case that cannot be flown are left out.
    Ends where the budget of work does.
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
    ahead = [candidate for candidate in flown.values() if candidate.cases.samples < samples]
    for value in ahead:
        if shares and shares[value.plan].met is None:
            return value
    chosen = choose(shares)
    if chosen is None or chosen not in flown:
        return None
    if flown[chosen] in ahead:
        return flown[chosen]
    if not shares or shares[chosen].met:
        return None
    return next(
        (candidate for candidate in ahead if shares[candidate.plan].high >= shares[chosen].low + LIKELIER), None
    )


def shares_of(plans: Sequence[Plan], flown: Mapping[Plan, PlanCandidate]) -> dict[Plan, Share]:
    """Complying share of each plan, from none to all where cases have not flown.

    Nothing where nothing is required.
    """
    if not plans or not requirements.judged(plans[0].spacecraft):
        return {}
    unknown = Share(0.0, 1.0, required_share(plans[0].spacecraft.requirement))
    return {plan: (flown[plan].share or unknown) if plan in flown else unknown for plan in plans}


def _bound(candidate: PlanCandidate, samples: int) -> None:
    if candidate.met is not None:
        known = candidate.cases.samples >= samples
        count = round(candidate.met * candidate.cases.samples)
        candidate.low, candidate.high = (
            (candidate.met, candidate.met) if known else binomial_interval(count, candidate.cases.samples, CERTAIN)
        )


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
    _bound(candidate, samples)


def fly_all(
    candidates: list[PlanCandidate],
    samples: int,
    probability: float,
    always: Sequence[PlanCandidate] = (),
    watch: Callable[[], None] = lambda: None,
) -> None:
    """Fly all ``samples`` cases of those that may be chosen, and of ``always``; ``watch`` is called after each step.

    To be chosen is the cheapest of which the share ``probability`` complies; where there is none, the cheapest of
    those that comply as often as the best but for the sampling error. Those that have a case that cannot be flown
    leave the ``candidates``.
    """
    while candidates:
        some = [candidate for candidate in always if candidate in candidates] + _hopeful(
            candidates, samples, probability
        )
        some = [candidate for candidate in some if candidate.cases.samples < samples]
        if not some:
            return
        first = min(some, key=lambda candidate: (candidate not in always, *_promise(candidate, probability)))
        try:
            _further(first, samples)
        except Infeasible:
            candidates.remove(first)
        watch()


def _promise(candidate: PlanCandidate, probability: float) -> tuple[bool, float]:
    """Sort key of the next candidate to fly."""
    may = candidate.high is not None and candidate.high >= probability
    return not may, candidate.plan.pulses.cost if may else candidate.rank


def _hopeful(candidates: list[PlanCandidate], samples: int, probability: float) -> list[PlanCandidate]:
    """Candidates that may still be chosen."""
    if any(candidate.low is None for candidate in candidates):
        return _as_near(candidates, samples, probability)
    bounds = [(candidate, candidate.low or 0.0, candidate.high or 0.0) for candidate in candidates]
    sure = [candidate.plan.pulses.cost for candidate, low, _ in bounds if low >= probability]
    if sure:
        comparable = len({candidate.plan.pulses.propellant is None for candidate in candidates}) == 1
        most = min(sure) * (1.0 + SAME_COST) if comparable else math.inf
        return [
            candidate for candidate, _, high in bounds if high >= probability and candidate.plan.pulses.cost <= most
        ]
    least = min(probability, equal_from(max((low for _, low, _ in bounds), default=0.0), samples))
    return [candidate for candidate, _, high in bounds if high >= least]


def _as_near(candidates: list[PlanCandidate], samples: int, probability: float) -> list[PlanCandidate]:
    """Candidates that may leave as little as the best complete one, where nothing is required."""
    ranks = [candidate.rank for candidate in candidates if candidate.cases.samples >= samples]
    if not ranks:
        return candidates
    most = AS_GOOD * min(ranks)
    return [candidate for candidate in candidates if _share_within(candidate, most) >= probability]


def _share_within(candidate: PlanCandidate, most: float) -> float:
    """Largest share of all cases that may leave at most ``most`` rad."""
    body = candidate.plan.spacecraft
    if candidate.results is None or candidate.results.values is None:
        return 1.0
    parts = [Part.NUTATION] if body.goal.axis is None else [Part.NUTATION, requirements.aim(body)]
    rows = candidate.results.values[[OUTPUTS.index(part.value) for part in parts], : candidate.results.done]
    count = min(int(np.count_nonzero(row <= most)) for row in rows)
    return binomial_interval(count, candidate.results.done, CERTAIN)[1]
