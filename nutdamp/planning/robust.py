"""Robust plans: selection by the share of cases that comply, and on-times shortened to it.

Robust planning: the plan that complies in most dispersed cases, instead of the best one for nominal values.

Candidates are the schedules of the schemes and variants of them: later starts, channels left unused, other alignments;
and, where `optimal` is among the schemes, its earliest ends, for errors of the rates grow with time, and those that
`chance_plan` makes for the dispersions.
All of them fly the same draws through real widths, so that what is compared is the plans and not their luck.

On-times of a robust plan shortened until just as many dispersed cases comply as must.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.montecarlo.study import SAMPLES, SEED, Results, run, study_of, threads_here
from nutdamp.planning import chance_plan
from nutdamp.planning import plan as planning
from nutdamp.planning.chance_plan import Tightening, tightening
from nutdamp.planning.decision import Comparison, Decision, attempt
from nutdamp.planning.plan import Plan
from nutdamp.planning.recommendation import Ground, by_propellant, cheapest
from nutdamp.planning.screening import AS_GOOD, Candidate, Cases, cases_of, entered, equal_from, fly_all
from nutdamp.schemes.catalogue import Options
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.model import Spacecraft, required_share
from nutdamp.spacecraft.requirements import SAME_COST
from nutdamp.spacecraft.schedule import channel_pulse

SHORTEST = 0.8
"""Share of on-times that is left at least when they are shortened: together, and then each alone once more."""

HALVINGS, FINER = 7, 3
"""Steps in which all on-times are shortened together, and then each alone."""

FEW = 8
"""Pulses up to which each is shortened alone."""


def trimmed(plan: Plan, complies: Callable[[Plan], bool]) -> Plan:
    """The plan with on-times as short as `complies` lets them be; the same one where nothing is to be gained.

    Plans on ticks, of command blocks, or with pulses of no channel stay as they are.
    """
    channels = {one.name: one for one in plan.spacecraft.channels}
    fixed = plan.spacecraft.limits.tick is not None or bool(plan.pulses.blocks)
    if fixed or any(one.channel not in channels or one.on_time == 0.0 for one in plan.pulses):
        return plan
    everywhere = list(range(len(plan.pulses)))
    best = _shortened(plan, everywhere, HALVINGS, complies)
    for index in everywhere if len(everywhere) <= FEW else ():
        best = _shortened(best, [index], FINER, complies)
    return best


def _shortened(plan: Plan, which: list[int], halvings: int, complies: Callable[[Plan], bool]) -> Plan:
    """The pulses with the indices ``which`` shortened alike, by bisection."""
    low, high, best = SHORTEST, 1.0, plan
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        shorter = _scaled(plan, which, middle)
        if shorter is not None and complies(shorter):
            best, high = shorter, middle
        else:
            low = middle
    return best


def _scaled(plan: Plan, which: list[int], share: float) -> Plan | None:
    """The plan with some of its on-times at a ``share``; None where it breaks a limit or its requirement."""
    body = plan.spacecraft
    channels = {one.name: one for one in body.channels}
    pulses = tuple(
        channel_pulse(channels[one.channel], one.t, share * one.on_time) if index in which else one
        for index, one in enumerate(plan.pulses)
    )
    with suppress(Infeasible):
        made = planning.judged(body, plan.scheme, replace(plan.pulses, pulses=pulses), plan.options)
        if made.feasible and made.meets_requirement is not False and keeps_limits(body, made.pulses):
            return made
    return None


LATER = (0.25, 0.5, 0.75, 1.0, 2.0)
"""Later starts that are tried, in nutation periods as seen in the body (inertial ones for a sphere)."""

WITHIN = (1.5, 2.0)
"""Ends by which the scheme optimal is to be done with least cost, over the earliest one."""

FRESH = 211
"""Seed of cases that nothing was chosen by."""

ROBUST = "robust"
"""Name of the robust plan beside those of schemes."""

CHECKED = 6
"""Plans with which just enough cases seem to comply that are tried in such cases, one after the other."""


class Fresh(NamedTuple):
    """How a plan fares in ``cases`` of a seed of their own, with the 95 % ``interval`` of the share that complies."""

    cases: Cases
    interval: tuple[float, float]

    @property
    def met(self) -> float:
        """The share of the cases that complies."""
        return self.cases.complying or 0.0


class Cost(NamedTuple):
    """What one plan takes more than another: propellant kg (None: unknown), impulse N m s, time s, nutation rad."""

    propellant: float | None
    impulse: float
    end: float
    nutation: float


@dataclass(frozen=True, eq=False)
class RobustComparison:
    """Candidates from the best down; ``usual`` is what the comparison recommends, ``chosen`` the robust plan.

    ``ground`` is what decided among the ``equals`` candidates that comply often enough, or are as good as the best, by
    propellant or by impulse. Each candidate flew ``samples`` cases of ``seed``. ``chance_plan``: with which tolerances
    enough cases would comply with the robust plan, where too few do.
    ``fresh``: how the robust plan fares in as many cases by which it was not chosen; None where nothing is required.
    """

    comparison: Comparison
    candidates: tuple[Candidate, ...]
    usual: Candidate | None
    chosen: Candidate | None
    ground: Ground | None
    equals: int
    by_propellant: bool
    probability: float
    samples: int
    seed: int
    tightening: Tightening | None = None
    fresh: Fresh | None = None

    @property
    def cost(self) -> Cost | None:
        """What the robust plan takes more than the usual one; None where there is only one of them."""
        if self.chosen is None or self.usual is None:
            return None
        more, less = self.chosen.plan.pulses, self.usual.plan.pulses
        known = more.propellant is not None and less.propellant is not None
        return Cost(
            (more.propellant or 0.0) - (less.propellant or 0.0) if known else None,
            more.total_impulse - less.total_impulse,
            more.end - less.end,
            self.chosen.left - self.usual.left,
        )

    @property
    def meets_requirement(self) -> bool | None:
        """Whether the robust plan meets it, in enough cases and with nominal values; None where nothing is required."""
        return None if self.decision is None else self.decision.met

    @property
    def decision(self) -> Decision | None:
        """The decision on the robust plan, by the cases that `nutdamp.montecarlo.study` draws for any schedule."""
        return None if self.chosen is None else Decision(self.chosen.plan, self.chosen.cases)

    @property
    def joined(self) -> Comparison:
        """The comparison with the robust plan in it, under the name `ROBUST`, unless it is one of those compared."""
        if self.chosen is None or any(_kind(one) == _kind(self.chosen.plan) for one in self.comparison.plans):
            return self.comparison
        plan = replace(self.chosen.plan, scheme=ROBUST)
        flown = None if self.comparison.flown is None else {**self.comparison.flown, plan: self.chosen}
        return replace(self.comparison, plans=(*self.comparison.plans, plan), flown=flown)

    @property
    def name(self) -> str:
        """The name of the robust plan in `joined`."""
        known = self.comparison.plans if self.chosen is None else self.joined.plans
        chosen = None if self.chosen is None else _kind(self.chosen.plan)
        return next((plan.scheme for plan in known if plan.feasible and _kind(plan) == chosen), "")

    @property
    def lucky(self) -> bool:
        """Whether enough cases comply, but too few of those by which the plan was not chosen."""
        if self.fresh is None or self.chosen is None:
            return False
        return self.fresh.met < self.probability <= (self.chosen.met or 0.0)

    @property
    def met(self) -> float | None:
        """The share of cases that comply with the robust plan."""
        return None if self.chosen is None else self.chosen.met


Attempt = Callable[[], Iterable[tuple[str, Plan]]]
"""Makes plans when it is called, each with what sets it apart from the one that its scheme makes."""


def attempts(comparison: Comparison, options: Options | None = None) -> list[Attempt]:
    """What `compare` is to try: the plans compared, and variants of each."""
    body, options = comparison.spacecraft, options or Options()
    planned, found = list[Attempt](), list[Attempt]()
    for base in comparison.plans:
        if base.failure is not None:
            continue
        planned.append(partial(list, [("as planned", base)]))
        found.append(partial(_alignments, body, base.scheme, options))
        found += [partial(_planned, *other, base.scheme, options) for other in _others(body, base)]
        if base.scheme == chance_plan.SCHEME:
            found.append(partial(_early, body, options))
            found.append(partial(chance_plan.plans, body, options))
    return [*planned, *found]


def compare(
    comparison: Comparison,
    trials: Sequence[Attempt],
    watch: Callable[[int], None] = lambda _: None,
    *,
    samples: int = SAMPLES,
) -> RobustComparison:
    """Make the plans of the ``trials``, let dispersed cases fly each, and recommend one; no schedule comes twice.

    ``samples`` cases of those that may be chosen, see `screening`; ``watch`` is called with how many trials are done,
    and then beyond that now and then. Raises BadRequest for a spacecraft without dispersions.
    """
    body = comparison.spacecraft
    probability = required_share(body.requirement)
    found: dict[object, Candidate] = {}
    with work.budget("the robust plans", work.FRONTS):
        for number, trial in enumerate(trials):
            watch(number)
            for variant, plan in () if work.exhausted() else trial():
                kind = _kind(plan)
                # Planned for other limits or channels, perhaps, but always flown by this spacecraft.
                if not plan.feasible or kind in found or not keeps_limits(body, plan.pulses):
                    continue
                own = plan if plan.spacecraft is body else replace(plan, spacecraft=body)
                if comparison.only_commanded and not own.commandable:
                    continue
                with suppress(Infeasible):  # cases that cannot be flown, such as those that take too long
                    found[kind] = entered(own, variant, study_of(body, own.pulses), samples)
    candidates = list(found.values())
    usual = None if comparison.recommended is None else found.get(_kind(comparison.recommended))
    always = [one for one in candidates if one is usual]
    fly_all(candidates, samples, probability, always, partial(watch, len(trials)))
    ranks = ranked(comparison, candidates, samples, probability)
    return ranks if ranks.chosen is None else _trimmed(_checked(ranks, candidates))


def _trimmed(ranks: RobustComparison) -> RobustComparison:
    """The comparison with the on-times of the robust plan as short as the share required allows, in new cases too."""
    chosen, samples, required = ranks.chosen, ranks.samples, ranks.probability
    if chosen is None or chosen.met is None or chosen.met < required or ranks.lucky:
        return ranks
    flown: dict[Plan, tuple[Candidate, Fresh]] = {}

    def complies(plan: Plan) -> bool:
        with suppress(Infeasible):
            one = entered(plan, f"{chosen.variant}, trimmed", study_of(plan.spacecraft, plan.pulses), samples)
            fly_all([one], samples, required)
            fresh = _fresh(one, samples) if one.cases.decided and (one.met or 0.0) >= required else None
            if fresh is not None and fresh.met >= required:
                flown[plan] = one, fresh
        return plan in flown

    best = trimmed(chosen.plan, complies)
    if best is chosen.plan or best.pulses.cost > chosen.plan.pulses.cost * (1.0 - SAME_COST):
        return ranks
    made, fresh = flown[best]
    return replace(ranks, chosen=made, candidates=(made, *ranks.candidates), ground=Ground.COST, fresh=fresh)


def _checked(ranks: RobustComparison, candidates: Sequence[Candidate]) -> RobustComparison:
    """The comparison with the chosen plan in cases that are new to the choice, which takes luck for merit now and then.

    A plan with which too few of them comply gives way to the next one with which enough seem to. Then, where too few
    comply all the same, with which tolerances enough would.
    """
    comparison, samples, required = ranks.comparison, ranks.samples, ranks.probability
    refused: list[Candidate] = []
    while (chosen := ranks.chosen) is not None:
        ranks = replace(ranks, fresh=_fresh(chosen, samples))
        if not ranks.lucky or chosen in refused or len(refused) == CHECKED:
            break
        refused.append(chosen)
        ranks = ranked(comparison, candidates, samples, required, refused=refused)
    if chosen is None or ranks.met is None or ranks.met >= required:
        return ranks
    return replace(ranks, tightening=tightening(chosen.plan, required))


def _fresh(chosen: Candidate, samples: int) -> Fresh | None:
    """The chosen plan in cases that are new to the choice; None where nothing is required of it."""
    if chosen.met is None:
        return None
    study = study_of(chosen.plan.spacecraft, chosen.plan.pulses, seed=FRESH)
    try:
        found = run(Results(study, samples), threads=threads_here())
    except Infeasible:  # a case among them takes too long to fly
        return None
    return Fresh(cases_of(found), found.interval)


def ranked(
    comparison: Comparison,
    candidates: Sequence[Candidate],
    samples: int,
    probability: float,
    *,
    refused: Sequence[Candidate] = (),
) -> RobustComparison:
    """The comparison of candidates that have flown, and which of them to take.

    That is the cheapest of the equals; of those that cost the same the plan that the comparison recommends.
    With the ``refused`` ones too few of other cases comply: they are taken where there is no plan with which enough do.
    """
    recommended = None if comparison.recommended is None else _kind(comparison.recommended)
    usual = next((one for one in candidates if _kind(one.plan) == recommended), None)
    others = [one for one in candidates if one not in refused]
    enough = any(one.met is not None and one.met >= probability for one in others)
    equals = _equals(others if enough else candidates, samples, probability)
    chosen, ground = None, None
    if equals:
        best, ground = cheapest([one.plan for one in equals], None if usual is None else usual.plan)
        chosen = next(one for one in equals if one.plan is best)
    return RobustComparison(
        comparison,
        tuple(sorted(candidates, key=lambda one: (one is not chosen, one.rank, one.plan.pulses.cost))),
        usual,
        chosen,
        ground,
        len(equals),
        by_propellant([one.plan for one in equals]),
        probability,
        samples,
        SEED,
    )


def _kind(plan: Plan) -> object:
    """What two plans share whose pulses are the same but for rounding."""
    return tuple(
        (pulse.channel, round(pulse.t, 6), round(pulse.on_time, 6), *np.round(pulse.impulse, 6).tolist())
        for pulse in plan.pulses
    )


def _alignments(body: Spacecraft, scheme: str, options: Options) -> Iterator[tuple[str, Plan]]:
    """The plans by other alignments that a scheme weighs, named by their channels."""
    for plan in planning.alternatives(body, scheme, options):
        yield " then ".join(dict.fromkeys(pulse.channel for pulse in plan.pulses)), plan


def _others(body: Spacecraft, base: Plan) -> Iterator[tuple[str, Spacecraft]]:
    """Spacecraft for which the scheme plans in another way: later, or without one of the channels that it fires."""
    for periods in LATER:
        earliest = body.limits.earliest + periods * body.nutation_period
        if earliest < body.horizon:
            yield f"from {earliest:.4g} s on", replace(body, limits=replace(body.limits, earliest=earliest))
    for name in dict.fromkeys(pulse.channel for pulse in base.pulses):
        left = tuple(channel for channel in body.channels if channel.name != name)
        if left and len(left) < len(body.channels):
            yield f"without {name}", replace(body, channels=left)


def _early(body: Spacecraft, options: Options) -> Iterator[tuple[str, Plan]]:
    """The earliest end that `optimal` finds, and its cheapest plans that end little later."""
    first = attempt(body, chance_plan.SCHEME, Options(**{**options.chosen, "least": "time"}))
    if not first.feasible:
        return
    yield "earliest end", first
    for times in WITHIN:
        horizon = times * first.end
        if horizon < body.horizon:
            soon = replace(body, limits=replace(body.limits, horizon=horizon))
            yield f"by {horizon:.4g} s", attempt(soon, chance_plan.SCHEME, options)


def _planned(variant: str, body: Spacecraft, scheme: str, options: Options) -> list[tuple[str, Plan]]:
    return [(variant, attempt(body, scheme, options))]


def _equals(candidates: Sequence[Candidate], samples: int, probability: float) -> list[Candidate]:
    """The candidates that comply as often as is required; without any those that are as good as the best.

    But for what the sampling may make of them.
    """
    enough = [one for one in candidates if one.met is not None and one.met >= probability]
    if enough or not candidates:
        return enough
    best = min(candidates, key=lambda one: one.rank)
    if best.met is None:
        return [one for one in candidates if one.rank <= AS_GOOD * best.rank]
    low = equal_from(best.met, samples)
    return [one for one in candidates if one.met is not None and one.met >= low]
