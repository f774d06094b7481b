"""Robust plans: selection by the share of complying cases, and on-times shortened to the required share.

Candidates are the schedules of the schemes, and variants: later starts, channels left unused, other alignments; of
`optimal` its earliest ends too, for errors of the rates grow with time, and those of `chance_plan`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import partial
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from nutdamp.common import results, work
from nutdamp.common.results import Note, note
from nutdamp.errors import Infeasible
from nutdamp.montecarlo.study import SEED, study_of
from nutdamp.planning import chance_plan, screening
from nutdamp.planning import plan as planning
from nutdamp.planning.chance_plan import Tightening, tightening
from nutdamp.planning.decision import Comparison, Decision, attempt
from nutdamp.planning.notes import beside
from nutdamp.planning.plan import Plan, Standing
from nutdamp.planning.recommendation import TIES, Ground, by_propellant, cheapest, nearest
from nutdamp.planning.screening import AS_GOOD, Fresh, PlanCandidate, entered, equal_from, fly_all, fresh_of
from nutdamp.schemes.catalogue import OPTIMAL, SCHEMES, Options
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.model import Spacecraft, required_share

# later starts that are tried, in nutation periods as seen in the body (inertial ones for a sphere)
LATER = (0.25, 0.5, 0.75, 1.0, 2.0)
WITHIN = (1.5, 2.0)  # ends by which the scheme optimal is to be done with least cost, over the earliest one

ROBUST = "robust"  # name of the robust plan beside those of schemes
CHECKED = 6  # plans with which just enough cases seem to comply that are tried in such cases, one after the other


class Cost(NamedTuple):
    """Extra cost of one plan over another: propellant kg (None: unknown), impulse N m s, time s, nutation rad."""

    propellant: float | None
    impulse: float
    end: float
    nutation: float


@dataclass(frozen=True, eq=False)
class RobustComparison(results.Data):
    """Candidates from the best down; ``usual`` is recommended by the comparison, ``chosen`` the robust plan.

    ``ground`` decided among the ``equals`` candidates that comply often enough, or are as good as the best, by
    propellant or by impulse. Each flew ``samples`` cases of ``seed``. ``tightening``: tolerances with which enough
    cases would comply, where too few do. ``fresh``: the robust plan in cases by which it was not chosen, if required.
    """

    comparison: Comparison
    candidates: tuple[PlanCandidate, ...]
    usual: PlanCandidate | None
    chosen: PlanCandidate | None
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
        """Extra cost of the robust plan over the usual one; None where there is only one of them."""
        if self.chosen is None or self.usual is None:
            return None
        more, less = self.chosen.plan.pulses, self.usual.plan.pulses
        return Cost(
            None if more.propellant is None or less.propellant is None else more.propellant - less.propellant,
            more.total_impulse - less.total_impulse,
            more.end - less.end,
            self.chosen.left - self.usual.left,
        )

    @property
    def meets_requirement(self) -> bool | None:
        """Compliance of the robust plan in enough cases and nominally; None where nothing is required."""
        return None if self.decision is None else self.decision.met

    @property
    def decision(self) -> Decision | None:
        """Decision on the robust plan, by the cases that `nutdamp.montecarlo.study` draws for any schedule."""
        return None if self.chosen is None else Decision(self.chosen.plan, self.chosen.cases)

    @property
    def joined(self) -> Comparison:
        """Comparison with the robust plan in it as `ROBUST`, unless it is one of those compared."""
        if self.chosen is None or self.name != ROBUST:
            return self.comparison
        plan = replace(self.chosen.plan, scheme=ROBUST)
        flown = None if self.comparison.flown is None else {**self.comparison.flown, plan: self.chosen}
        return replace(self.comparison, plans=(*self.comparison.plans, plan), flown=flown)

    @property
    def name(self) -> str:
        """Name of the robust plan in `joined`; empty where there is none."""
        if self.chosen is None:
            return ""
        kind = _kind(self.chosen.plan)
        return next((plan.scheme for plan in self.comparison.plans if plan.feasible and _kind(plan) == kind), ROBUST)

    @property
    def lucky(self) -> bool:
        """True if enough cases comply, but too few of those by which the plan was not chosen."""
        return self.fresh is not None and self.fresh.met < self.probability <= (self.met or 0.0)

    @property
    def met(self) -> float | None:
        """Share of cases that comply with the robust plan."""
        return None if self.chosen is None else self.chosen.met


class VariationKind(IntEnum):
    """Kind of the plans that a variation makes, in the order in which they are tried."""

    PLANNED, MARGINS, EARLY, VARIED = range(4)


class Variation(NamedTuple):
    """Lazy generator of plans, each with the label of its variant, and their ``kind``."""

    plans: Callable[[], Iterable[tuple[str, Plan]]]
    kind: VariationKind = VariationKind.VARIED


def variations_of(comparison: Comparison, options: Options | None = None) -> list[Variation]:
    """Variations of `compare`: the plans compared, and variants of each."""
    body, options = comparison.spacecraft, options or Options()
    tried = list[Variation]()
    timed = body.commands is None or not comparison.only_commanded
    for base in (plan for plan in comparison.plans if plan.failure is None):
        if not (timed or SCHEMES[base.scheme].reads_commands or not SCHEMES[base.scheme].fires):
            continue  # none of its variants may be chosen
        tried.append(Variation(partial(list, [("as planned", base)]), VariationKind.PLANNED))
        tried.append(Variation(partial(_alignments, body, base.scheme, options)))
        tried += [Variation(partial(_planned, *other, base.scheme, options)) for other in _others(body, base)]
        if base.scheme == OPTIMAL.name:
            tried.append(Variation(partial(chance_plan.plans, body, options), VariationKind.MARGINS))
            tried.append(Variation(partial(_early, body, options), VariationKind.EARLY))
    return sorted(tried, key=attrgetter("kind"))


def compare(
    comparison: Comparison,
    variations: Sequence[Variation],
    watch: Callable[[int], None] = lambda _: None,
    *,
    samples: int = work.SAMPLES,
) -> RobustComparison:
    """Make the plans of the ``variations``, let dispersed cases fly each, and recommend one; no schedule comes twice.

    ``samples`` cases of those that may be chosen; ``watch`` is called with how many variations are done, then now and
    then. Raises BadRequest for a spacecraft without dispersions.
    """
    body = comparison.spacecraft
    probability = required_share(body.requirement)
    entries: dict[object, PlanCandidate] = {}
    # No early end costs less than the plan of the whole horizon that leaves as little.
    least = min((plan.pulses.cost for plan in comparison.plans if plan.scheme == OPTIMAL.name), default=0.0)
    with work.budget("the robust plans", work.FRONTS) as budget:
        for number, variation in enumerate(variations):
            watch(number)
            planned = False
            # The earliest ends have a budget of their own, whatever the margins took.
            budget.most = work.FRONTS + (budget.done if variation.kind is VariationKind.EARLY else 0.0)
            for variant, plan in () if work.exhausted() else variation.plans():
                kind = _kind(plan)
                # Planned for other limits or channels, perhaps, but always flown by this spacecraft.
                if not plan.feasible or kind in entries or not keeps_limits(body, plan.pulses):
                    continue
                own = plan if plan.spacecraft is body else replace(plan, spacecraft=body)
                if comparison.only_commanded and not own.commandable:
                    continue
                planned = True
                known = None if comparison.flown is None else comparison.flown.get(plan)
                with suppress(Infeasible):  # cases that cannot be flown, such as those that take too long
                    if known is not None and known.cases.requested == samples:
                        entries[kind] = replace(known, variant=variant)
                    else:
                        entries[kind] = entered(own, variant, study_of(body, own.pulses), samples)
            if planned and variation.kind in (VariationKind.MARGINS, VariationKind.EARLY):
                ranks = _flown(comparison, entries, samples, probability)
                cheap = ranks.chosen is not None and ranks.chosen.plan.pulses.cost <= least
                done = variation.kind is VariationKind.EARLY or cheap
                if done and ranks.meets_requirement and not ranks.lucky:  # other variants seldom cost less
                    return _trimmed(ranks)
    return _trimmed(_flown(comparison, entries, samples, probability, partial(watch, len(variations))))


def _flown(
    comparison: Comparison,
    entries: dict[object, PlanCandidate],
    samples: int,
    probability: float,
    watch: Callable[[], None] = lambda: None,
) -> RobustComparison:
    """Comparison of the ``entries`` in all cases, where they may be chosen, and the choice, checked in fresh cases.

    Against selection by luck a plan with which too few of those comply gives way to the next one with which enough seem
    to. `Tightening` where too few comply all the same.
    """
    candidates = list(entries.values())
    usual = None if comparison.recommended is None else entries.get(_kind(comparison.recommended))
    fly_all(candidates, samples, probability, [] if usual is None else [usual], watch)
    ranks = ranked(comparison, candidates, samples, probability)
    refused: list[PlanCandidate] = []
    while (chosen := ranks.chosen) is not None:
        if not chosen.cases.decided and chosen not in refused:  # it came after one that was refused
            flyable = [chosen]
            fly_all(flyable, samples, 0.0)
            refused += [] if flyable else [chosen]
        else:
            ranks = replace(ranks, fresh=fresh_of(chosen, samples))
            if not ranks.lucky or chosen in refused or len(refused) == CHECKED:
                break
            refused.append(chosen)
        ranks = ranked(comparison, candidates, samples, probability, refused=refused)
    if chosen is None or ranks.met is None or ranks.met >= probability:
        return ranks
    return replace(ranks, tightening=tightening(chosen.plan, probability))


def _trimmed(ranks: RobustComparison) -> RobustComparison:
    """Comparison with the robust plan's on-times as short as the required share allows, in fresh cases too.

    Unless they also do what is not required, and would be short of it.
    """
    chosen = ranks.chosen
    if not all(bound.required for bound in requirements.bounds(ranks.comparison.spacecraft)):
        return ranks
    if chosen is None or chosen.met is None or chosen.met < ranks.probability or ranks.lucky or ranks.fresh is None:
        return ranks
    best = screening.shortest(chosen, ranks.fresh)
    if best.candidate is chosen:
        return ranks
    candidates = best.candidate, *ranks.candidates
    return replace(ranks, chosen=best.candidate, candidates=candidates, ground=Ground.COST, fresh=best.fresh)


def ranked(
    comparison: Comparison,
    candidates: Sequence[PlanCandidate],
    samples: int,
    probability: float,
    *,
    refused: Sequence[PlanCandidate] = (),
) -> RobustComparison:
    """Comparison of flown candidates, and the choice: the `cheapest` of the equals.

    Of plans with which enough cases comply those that damp what is not required too, else those that leave least. With
    the ``refused`` ones too few of other cases comply: they are taken where there is no plan with which enough do.
    Where no case complies with any plan, it is the `nearest`.
    """

    def damping(equal: list[PlanCandidate]) -> list[PlanCandidate]:
        return [candidate for candidate in equal if candidate.plan.standing is Standing.COMPLIES]

    recommended = None if comparison.recommended is None else _kind(comparison.recommended)
    usual = next((candidate for candidate in candidates if _kind(candidate.plan) == recommended), None)
    enough = [candidate for candidate in candidates if candidate.met is not None and candidate.met >= probability]
    least = min((candidate.left for candidate in enough), default=0.0)
    enough = damping(enough) or [candidate for candidate in enough if candidate.left <= AS_GOOD * least]
    equals = [candidate for candidate in enough if candidate not in refused] or enough
    if candidates and not equals:  # those as good as the best, but for what the sampling may make of them
        top = min(candidates, key=attrgetter("rank"))
        if top.met is None:
            equals = [candidate for candidate in candidates if candidate.rank <= AS_GOOD * top.rank]
            equals = damping(equals) or equals
        else:
            low = equal_from(top.met, samples)
            equals = [candidate for candidate in candidates if candidate.met is not None and candidate.met >= low]
    chosen, ground = None, None
    if equals:
        plans = [equal.plan for equal in equals]
        hopeless = all(equal.met == 0.0 for equal in equals)
        best, ground = nearest(plans) if hopeless else cheapest(plans, None if usual is None else usual.plan)
        chosen = next(equal for equal in equals if equal.plan is best)
    by_rank = sorted(candidates, key=lambda each: (each is not chosen, each.rank, each.plan.pulses.cost))
    known = by_propellant([equal.plan for equal in equals])
    return RobustComparison(
        comparison, tuple(by_rank), usual, chosen, ground, len(equals), known, probability, samples, SEED
    )


def _kind(plan: Plan) -> object:
    """Key shared by plans whose pulses are equal but for rounding."""
    return tuple(
        (pulse.channel, round(pulse.t, 6), round(pulse.on_time, 6), *np.round(pulse.impulse, 6).tolist())
        for pulse in plan.pulses
    )


def _alignments(body: Spacecraft, scheme: str, options: Options) -> Iterator[tuple[str, Plan]]:
    """Plans by other alignments of a scheme, named by their channels."""
    for plan in planning.alternatives(body, scheme, options):
        yield " then ".join(dict.fromkeys(pulse.channel for pulse in plan.pulses)), plan


def _others(body: Spacecraft, base: Plan) -> Iterator[tuple[str, Spacecraft]]:
    """Spacecraft for which the scheme plans differently: later, or without one of its channels."""
    for periods in LATER:  # of the nutation as seen in the body, inertial ones for a sphere
        earliest = body.limits.earliest + periods * body.nutation_period
        if earliest < body.horizon:
            yield f"from {earliest:.4g} s on", replace(body, limits=replace(body.limits, earliest=earliest))
    for name in dict.fromkeys(pulse.channel for pulse in base.pulses):
        left = tuple(channel for channel in body.channels if channel.name != name)
        if left and len(left) < len(body.channels):
            yield f"without {name}", replace(body, channels=left)


def _early(body: Spacecraft, options: Options) -> Iterator[tuple[str, Plan]]:
    """Earliest end of `optimal`, and its cheapest plans that end little later."""
    first = attempt(body, OPTIMAL.name, Options(**{**options.chosen, "least": "time"}))
    if not first.feasible:
        return
    yield "earliest end", first
    for times in WITHIN:
        horizon = times * first.end
        if horizon < body.horizon:
            soon = replace(body, limits=replace(body.limits, horizon=horizon))
            yield f"by {horizon:.4g} s", attempt(soon, OPTIMAL.name, options)


def _planned(variant: str, body: Spacecraft, scheme: str, options: Options) -> list[tuple[str, Plan]]:
    return [(variant, attempt(body, scheme, options))]


def robust_reasons(robust: RobustComparison) -> Iterator[Note]:
    """Reason for the robust plan, or for none."""
    chosen, count, required = robust.chosen, len(robust.candidates), 100.0 * robust.probability
    if chosen is None:
        yield note("none-feasible")
    elif count == 1:
        yield note("as-requested" if len(robust.comparison.plans) == 1 else "only-plan")
    else:
        if chosen.met is None:
            yield note("robust-least-left", count=count, equals=robust.equals, required_share=required)
        elif chosen.met >= robust.probability:
            yield note("robust-complies", count=count, equals=robust.equals, required_share=required)
        elif chosen.met > 0.0:
            yield note("robust-most-cases", count=count, equals=robust.equals)
        if robust.ground in (Ground.LEFT, Ground.NEAREST):
            yield note("nearest" if robust.ground is Ground.NEAREST else "least-left", count=count)
        elif robust.ground is not None and robust.ground is not Ground.ONLY:
            yield note("equal-least-propellant" if robust.by_propellant else "equal-least-impulse")
        if robust.ground in TIES:
            yield note(robust.ground.value)


def robust_cost(robust: RobustComparison) -> Iterator[Note]:
    """The robust plan against the one that is recommended without ``--robust``."""
    chosen, usual = robust.chosen, robust.usual
    if chosen is None or usual is None:
        return
    if chosen is usual:
        yield note("robust-is-usual")
        return
    known = by_propellant([chosen.plan, usual.plan])
    figures = {"scheme": usual.plan.scheme, **beside(chosen.plan, usual.plan, known)}
    if chosen.met is not None and usual.met is not None:
        yield note("robust-cost", share=f"{100.0 * chosen.met:.4g}", than_share=f"{100.0 * usual.met:.4g}", **figures)
    else:
        left, than = math.degrees(chosen.left), math.degrees(usual.left)
        yield note("robust-cost-left", left_deg=left, than_left_deg=than, **figures)
