"""Flying many plans in dispersed cases: a few of all, all for those alone that can still be chosen after a few.

All plans fly the same draws, the first cases first. What part of all cases complies is bounded by an exact interval
about what the first ones show (Clopper & Pearson 1934), so wide that it errs once in a million times; a plan that
could not be chosen even at the favourable end of its interval is flown no further.
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
"""Cases after which it is looked whether a plan can still be chosen."""

CERTAIN = 1.0 - 1e-6
"""Confidence of the intervals by which plans are left out."""

LIKELIER = 0.01
"""Where too few cases comply with each plan: the share by which more must, perhaps, for a plan to be flown further."""

AS_GOOD = 1.05
"""Without a requirement: candidates within this factor of the least angle count as equal, so far apart may be luck."""


@dataclass(frozen=True, slots=True)
class Cases:
    """How one schedule fares in ``samples`` of the ``requested`` dispersed cases of ``seed``.

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
        """Whether all cases have flown."""
        return self.samples >= self.requested

    @property
    def met(self) -> bool | None:
        """Whether as many of those flown comply as must; None where nothing is required."""
        return None if self.complying is None else self.complying >= self.probability


def cases_of(results: Results, requested: int | None = None) -> Cases:
    """What a study says of its schedule; ``requested``: cases to come in all, default those of the ``results``."""
    probability, levels = results.probability, {}
    for part in (Part.NUTATION, requirements.aim(results.study.model.spacecraft)):
        distribution = results.distribution(part.value)
        assert distribution is not None
        levels[part] = float(distribution.quantiles(np.array([probability]))[0])
    count = results.requested if requested is None else requested
    return Cases(results.done, count, results.study.seed, results.met_fraction, probability, levels)


def equal_from(share: float, samples: int) -> float:
    """The least share of ``samples`` cases that is equal to a ``share`` of them but for the sampling error."""
    return binomial_interval(round(share * samples), samples, CONFIDENCE)[0]


@dataclass(eq=False)
class Candidate:
    """A plan and how it fares in the dispersed cases of its ``results``.

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
        """How far H ends from where it shall, rad, not exceeded in the share of cases required."""
        return self.cases.levels[requirements.aim(self.plan.spacecraft)]

    @property
    def met(self) -> float | None:
        """The share that complies; None where nothing is required."""
        return self.cases.complying

    @property
    def share(self) -> Share | None:
        """The share of all cases; None where nothing is required."""
        if self.low is None or self.high is None:
            return None
        return Share(self.low, self.high, self.cases.probability)

    @property
    def left(self) -> float:
        """What it leaves, rad: nutation, or the distance from a target axis where that is more."""
        return float(requirements.missed(self.plan.spacecraft, self.nutation, self.off))

    @property
    def nominal(self) -> float | None:
        """The same for nominal values, rad."""
        body, flown = self.plan.spacecraft, self.plan.flown
        return None if flown is None else float(requirements.missed(body, flown.nutation, flown.axis_error))

    @property
    def rank(self) -> float:
        """What candidates are ranked by, the least first: the share that does not comply, or what is left."""
        return self.left if self.met is None else 1.0 - self.met


def entered(plan: Plan, variant: str, study: Study, samples: int) -> Candidate:
    """A candidate that has flown the first of ``samples`` cases of a study."""
    results = _run(Results(study, min(STAGES[0], samples)))
    made = Candidate(plan, variant, cases_of(results, samples), results)
    _bound(made, samples)
    return made


def _run(results: Results) -> Results:
    """`run`, counted as work."""
    work.spend(results.study.flies.effort * (results.requested - results.done))
    return run(results, threads=threads_here())


def affordable(study: Study, samples: int) -> bool:
    """Whether the budget of work that is open is enough for so many cases, which are flown at once."""
    return study.flies.effort * samples <= work.left()


def fly_compared(
    plans: Sequence[Plan],
    samples: int,
    choose: Callable[[Mapping[Plan, Share]], Plan | None],
) -> dict[Plan, Candidate]:
    """Fly so many of the ``samples`` cases with each plan that it is known whether enough comply.

    All of them with the plan that `choose` takes by the shares. Plans with a case that cannot be flown are left out.
    Ends where the budget of work does.
    """
    flown: dict[Plan, Candidate] = {}
    for plan in plans:
        study = study_of(plan.spacecraft, plan.pulses)
        if affordable(study, min(STAGES[0], samples)):
            with suppress(Infeasible):
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
    flown: Mapping[Plan, Candidate],
    samples: int,
    choose: Callable[[Mapping[Plan, Share]], Plan | None],
) -> Candidate | None:
    """The next candidate to fly further; None where all is decided."""
    shares = shares_of(plans, flown)
    ahead = [one for one in flown.values() if one.cases.samples < samples]
    for one in ahead:
        if shares and shares[one.plan].met is None:
            return one
    chosen = choose(shares)
    if chosen is None or chosen not in flown:
        return None
    if flown[chosen] in ahead:
        return flown[chosen]
    if not shares or shares[chosen].met:
        return None
    return next((one for one in ahead if shares[one.plan].high >= shares[chosen].low + LIKELIER), None)


def shares_of(plans: Sequence[Plan], flown: Mapping[Plan, Candidate]) -> dict[Plan, Share]:
    """The share of cases that comply with each plan, from none to all where they have not flown.

    Nothing where nothing is required.
    """
    if not plans or not requirements.judged(plans[0].spacecraft):
        return {}
    unknown = Share(0.0, 1.0, required_share(plans[0].spacecraft.requirement))
    return {one: (flown[one].share or unknown) if one in flown else unknown for one in plans}


def _bound(one: Candidate, samples: int) -> None:
    if one.met is not None:
        known = one.cases.samples >= samples
        count = round(one.met * one.cases.samples)
        one.low, one.high = (one.met, one.met) if known else binomial_interval(count, one.cases.samples, CERTAIN)


def _stage(done: int, samples: int) -> int:
    """Cases after which it is looked next whether a plan can still be chosen."""
    return next((count for count in STAGES if done < count < samples), samples)


def _further(one: Candidate, samples: int) -> None:
    """Fly the cases of the next stage."""
    assert one.results is not None
    stage = _stage(one.cases.samples, samples)
    exact = stage <= EXACT_CASES  # beyond, cases are counted and not kept: from the first one on
    one.results = _run(one.results.extended(stage) if exact else Results(one.results.study, stage))
    one.cases = cases_of(one.results, samples)
    _bound(one, samples)


def fly_all(
    candidates: list[Candidate],
    samples: int,
    probability: float,
    always: Sequence[Candidate] = (),
    watch: Callable[[], None] = lambda: None,
) -> None:
    """Fly all ``samples`` cases of those that may be chosen, and of ``always``; ``watch`` is called after each step.

    To be chosen is the cheapest of which the share ``probability`` complies; where there is none, the cheapest of
    those that comply as often as the best but for the sampling error. Those that have a case that cannot be flown
    leave the ``candidates``.
    """
    while candidates:
        some = [one for one in always if one in candidates] + _hopeful(candidates, samples, probability)
        some = [one for one in some if one.cases.samples < samples]
        if not some:
            return
        first = min(some, key=lambda one: (one not in always, *_promise(one, probability)))
        try:
            _further(first, samples)
        except Infeasible:
            candidates.remove(first)
        watch()


def _promise(one: Candidate, probability: float) -> tuple[bool, float]:
    """What the next to be flown is least in."""
    may = one.high is not None and one.high >= probability
    return not may, one.plan.pulses.cost if may else one.rank


def _hopeful(candidates: list[Candidate], samples: int, probability: float) -> list[Candidate]:
    """Those that may be chosen by what is known of all."""
    if any(one.low is None for one in candidates):
        return _as_near(candidates, samples, probability)
    bounds = [(one, one.low or 0.0, one.high or 0.0) for one in candidates]
    sure = [one.plan.pulses.cost for one, low, _ in bounds if low >= probability]
    if sure:
        comparable = len({one.plan.pulses.propellant is None for one in candidates}) == 1
        most = min(sure) * (1.0 + SAME_COST) if comparable else math.inf
        return [one for one, _, high in bounds if high >= probability and one.plan.pulses.cost <= most]
    least = min(probability, equal_from(max((low for _, low, _ in bounds), default=0.0), samples))
    return [one for one, _, high in bounds if high >= least]


def _as_near(candidates: list[Candidate], samples: int, probability: float) -> list[Candidate]:
    """Where nothing is required: those that may leave as little as the best of those that have flown all cases."""
    ranks = [one.rank for one in candidates if one.cases.samples >= samples]
    if not ranks:
        return candidates
    most = AS_GOOD * min(ranks)
    return [one for one in candidates if _share_within(one, most) >= probability]


def _share_within(one: Candidate, most: float) -> float:
    """The largest share of all cases that may leave at most ``most`` rad."""
    body = one.plan.spacecraft
    if one.results is None or one.results.values is None:
        return 1.0
    parts = [Part.NUTATION] if body.goal.axis is None else [Part.NUTATION, requirements.aim(body)]
    rows = one.results.values[[OUTPUTS.index(part.value) for part in parts], : one.results.done]
    count = min(int(np.count_nonzero(row <= most)) for row in rows)
    return binomial_interval(count, one.results.done, CERTAIN)[1]
