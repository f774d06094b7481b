"""Robust plans: selection by the share of complying cases.

Candidates are the schedules of the schemes, and variants: later starts, channels left unused, other
alignments; of `optimal` its earliest ends too, for errors of the rates grow with time, and those of
`chance_plan`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property, partial
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from nutdamp.common import results, work
from nutdamp.common.results import Note, note
from nutdamp.errors import Infeasible
from nutdamp.montecarlo.study import flown_in_stages, study_of
from nutdamp.planning import chance_plan
from nutdamp.planning import plan as planning
from nutdamp.planning.chance_plan import Tightening, tightening
from nutdamp.planning.decision import (
    TIES,
    Comparison,
    Ground,
    attempt,
    by_propellant,
    cheapest,
    nearest,
)
from nutdamp.planning.notes import beside
from nutdamp.planning.plan import Plan, Standing
from nutdamp.planning.screening import FlownPlan, entered
from nutdamp.planning.verdict import Cases, Verdict, cases_of
from nutdamp.schemes import planner
from nutdamp.schemes.catalogue import LEAST, OPTIMAL, SCHEMES, OptimalOptions, Options
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.model import Spacecraft, required_share
from nutdamp.spacecraft.roles import with_limits

# later starts that are tried, in nutation periods as seen in the body (inertial ones for a sphere)
LATER = (0.25, 0.5, 0.75, 1.0, 2.0)
# Ends by which the scheme optimal is to be done with least cost, over the earliest one; the first
# for spin-up.yaml, of which 99.98 % of the cases comply with H kept, and at most 98.4 % with the
# others.
WITHIN = (1.35, 1.5, 2.0)

ROBUST = "robust"  # name of the robust plan beside those of schemes
FRESH = 211  # seed of cases that nothing was chosen by

AS_GOOD = 1.05
"""Without a requirement: candidates within this factor of the least angle count as equal, so far
apart may be luck.
"""


class Cost(NamedTuple):
    """Extra cost of one plan over another: propellant kg (None: unknown), impulse N m s, time s,
    nutation rad.
    """

    propellant: float | None
    impulse: float
    end: float
    nutation: float


@dataclass(frozen=True, eq=False)
class RobustComparison(results.Data):
    """Candidates from the best down; ``usual`` is recommended by the comparison, ``chosen`` the
    robust plan.

    ``ground`` decided among the ``equals`` candidates, by propellant or by impulse. ``tightening``:
    tolerances with which enough cases would comply, where too few do. ``fresh``: the robust plan in
    cases by which it was not chosen.
    """

    comparison: Comparison
    candidates: tuple[FlownPlan, ...]
    usual: FlownPlan | None
    chosen: FlownPlan | None
    ground: Ground | None
    equals: int
    probability: float
    tightening: Tightening | None = None
    fresh: Cases | None = None

    @property
    def by_propellant(self) -> bool:
        """True if the propellant of all candidates is known, which are compared by it."""
        return by_propellant([candidate.plan for candidate in self.candidates])

    @property
    def cost(self) -> Cost | None:
        """Extra cost of the robust plan over the usual one;
        None where there is only one of them.
        """
        if self.chosen is None or self.usual is None:
            return None
        more, less = self.chosen.plan.pulses, self.usual.plan.pulses
        return Cost(
            None
            if more.propellant is None or less.propellant is None
            else more.propellant - less.propellant,
            more.total_impulse - less.total_impulse,
            more.end - less.end,
            self.chosen.left - self.usual.left,
        )

    @property
    def verdict(self) -> Verdict:
        """Judgement of the robust plan, by the cases that `nutdamp.montecarlo.study` draws for any
        schedule.
        """
        return self.joined.verdict

    @cached_property
    def joined(self) -> Comparison:
        """Comparison with the robust plan in it as `ROBUST`, unless it is one of those compared, as
        recommended.
        """
        if self.chosen is None:
            return self.comparison
        kind = _kind(self.chosen.plan)
        plans = self.comparison.plans
        flown = dict(self.comparison.flown or {})
        same = next((plan for plan in plans if plan.feasible and _kind(plan) == kind), None)
        plan = same or replace(self.chosen.plan, scheme=ROBUST)
        flown[plan] = self.chosen
        return replace(
            self.comparison, plans=plans if same else (*plans, plan), flown=flown, preferred=plan
        )

    @property
    def name(self) -> str:
        """Name of the robust plan in `joined`; empty where there is none."""
        plan = self.joined.recommended
        return "" if self.chosen is None or plan is None else plan.scheme


class VariationKind(IntEnum):
    """Kind of the plans that a variation makes, in the order in which they are tried."""

    PLANNED, MARGINS, EARLY, VARIED = range(4)


class Variation(NamedTuple):
    """Lazy generator of plans, each with the label of its variant, and their ``kind``."""

    plans: Callable[[], Iterable[tuple[str, Plan]]]
    kind: VariationKind = VariationKind.VARIED


def variations_of(comparison: Comparison, options: Options | None = None) -> list[Variation]:
    """Variations of `compare`: the plans compared, and variants of each."""
    spacecraft = comparison.spacecraft
    options = options or Options()
    tried = list[Variation]()
    timed = spacecraft.commands is None or not comparison.only_commanded
    for base in (plan for plan in comparison.plans if plan.failure is None):
        if not (timed or SCHEMES[base.scheme].reads_commands or not SCHEMES[base.scheme].fires):
            continue  # none of its variants may be chosen
        tried.append(Variation(partial(list, [("as planned", base)]), VariationKind.PLANNED))
        tried.append(Variation(partial(_alignments, spacecraft, base.scheme, options)))
        tried += [
            Variation(partial(_planned, *other, base.scheme, options))
            for other in _others(spacecraft, base)
        ]
        if base.scheme == OPTIMAL.name:
            tried.append(
                Variation(partial(chance_plan.plans, spacecraft, options), VariationKind.MARGINS)
            )
            tried.append(Variation(partial(_early, spacecraft, options), VariationKind.EARLY))
    return sorted(tried, key=attrgetter("kind"))


def compare(
    comparison: Comparison,
    variations: Sequence[Variation],
    watch: Callable[[int], None] = lambda _: None,
) -> RobustComparison:
    """Make the plans of the ``variations``, let dispersed cases fly each, and recommend one; no
    schedule comes twice.

    The cheapest plan of which enough cases comply, in fresh ones too, beyond the intervals of both.
    ``watch`` is called with how many variations are done. Raises BadRequest for a spacecraft
    without dispersions.
    """
    spacecraft = comparison.spacecraft
    entries: dict[object, FlownPlan] = {}
    # No early end costs less than the plan of the whole horizon that leaves as little.
    least = min(
        (plan.pulses.cost for plan in comparison.plans if plan.scheme == OPTIMAL.name), default=0.0
    )
    with work.budget("the robust plans", work.FRONTS) as budget:
        for number, variation in enumerate(variations):
            watch(number)
            planned = False
            # The earliest ends have a budget of their own, whatever the margins took.
            budget.most = work.FRONTS + (
                budget.done if variation.kind is VariationKind.EARLY else 0.0
            )
            for variant, plan in () if work.exhausted() else variation.plans():
                kind = _kind(plan)
                # Planned for other limits or channels, perhaps, but always flown by this
                # spacecraft.
                if (
                    not plan.feasible
                    or kind in entries
                    or not keeps_limits(spacecraft, plan.pulses)
                ):
                    continue
                own = (
                    plan if plan.spacecraft is spacecraft else replace(plan, spacecraft=spacecraft)
                )
                if comparison.only_commanded and not own.commandable:
                    continue
                planned = True
                with suppress(
                    Infeasible
                ):  # cases that cannot be flown, such as those that take too long
                    known = (comparison.flown or {}).get(plan)
                    candidate = (
                        entered(own, None, variant)
                        if known is None
                        else replace(known, variant=variant)
                    )
                    if candidate is not None:
                        entries[kind] = candidate
            if planned and variation.kind in (VariationKind.MARGINS, VariationKind.EARLY):
                chosen, ground, fresh = _confirmed(
                    entries, comparison.recommended, comparison.least
                )
                cheap = (
                    chosen is not None
                    and comparison.least == LEAST[0]
                    and chosen.plan.pulses.cost <= least
                )
                done = variation.kind is VariationKind.EARLY or cheap
                if chosen is not None and done:  # other variants seldom cost less
                    return _result(comparison, entries, chosen, ground, fresh)
    watch(len(variations))
    chosen, ground, fresh = _confirmed(entries, comparison.recommended, comparison.least)
    if chosen is not None:
        return _result(comparison, entries, chosen, ground, fresh)
    chosen, ground, equals = _nearest(
        list(entries.values()), comparison.recommended, comparison.least
    )
    if chosen is None or not requirements.judged(spacecraft):
        return _result(comparison, entries, chosen, ground, equals=equals)
    needed = (
        None
        if chosen.cases.enough
        else tightening(chosen.plan, required_share(spacecraft.requirement))
    )
    return _result(comparison, entries, chosen, ground, _fresh(chosen), needed, equals)


def _confirmed(
    entries: Mapping[object, FlownPlan], usual: Plan | None, saved: str = LEAST[0]
) -> tuple[FlownPlan | None, Ground | None, Cases | None]:
    """`cheapest` plan of which enough cases comply, in fresh ones too; deciding ground, and these.
    None without one.

    Plans that damp all come first; those that leave undamped what is not required follow by what
    they leave. Of equal costs the ``usual`` one; ``saved``: see `LEAST`. None where nothing is
    required.
    """
    if not entries or not requirements.judged(next(iter(entries.values())).plan.spacecraft):
        return None, None, None

    def undamped(each: FlownPlan) -> float:
        return 0.0 if each.plan.standing is Standing.COMPLIES else each.left

    hopeful = {
        each.plan: each for each in entries.values() if each.plan.meets_requirement is not False
    }
    while hopeful := {
        plan: each for plan, each in hopeful.items() if each.cases.enough is not False
    }:
        least = min(map(undamped, hopeful.values()))
        plan, ground = cheapest(
            [plan for plan, each in hopeful.items() if undamped(each) == least], usual, saved
        )
        candidate = hopeful.pop(plan)
        with suppress(Infeasible):
            candidate.decide(None)
            if candidate.cases.enough:
                candidate.finish(None)
            if candidate.cases.enough:
                fresh = _fresh(candidate)
                if fresh is not None and fresh.enough:
                    return candidate, ground, fresh
    return None, None, None


def _fresh(candidate: FlownPlan) -> Cases | None:
    """Plan in cases that it was not chosen by; None where one of them cannot be flown."""
    plan = candidate.plan
    try:
        return cases_of(flown_in_stages(study_of(plan.spacecraft, plan.pulses, seed=FRESH)))
    except Infeasible:
        return None


def _nearest(
    candidates: Sequence[FlownPlan], usual: Plan | None, saved: str = LEAST[0]
) -> tuple[FlownPlan | None, Ground | None, int]:
    """Plan with which most cases comply, or that leaves least where nothing is required or no case
    complies.

    Of plans as good, but for what the sampling may make of them, the cheapest, of equal costs the
    ``usual`` one; and how many are as good.
    """
    if not candidates:
        return None, None, 0
    if not requirements.judged(candidates[0].plan.spacecraft):
        least = min(candidate.left for candidate in candidates)
        equals = [candidate.plan for candidate in candidates if candidate.left <= AS_GOOD * least]
        best, ground = cheapest(
            [plan for plan in equals if plan.standing is Standing.COMPLIES] or equals, usual, saved
        )
    elif all(candidate.cases.complying == 0.0 for candidate in candidates):
        equals = [candidate.plan for candidate in candidates]
        best, ground = nearest(equals)
    else:
        hopeful = max(candidate.cases.low for candidate in candidates)
        for candidate in candidates:
            if candidate.cases.high >= hopeful:
                with suppress(Infeasible):
                    candidate.finish(None)
        final = [candidate for candidate in candidates if candidate.final]
        most = max(final, key=lambda candidate: candidate.cases.complying or 0.0)
        equals = [each.plan for each in final if (each.cases.complying or 0.0) >= most.cases.low]
        best, ground = cheapest(equals, usual, saved)
    return next(each for each in candidates if each.plan is best), ground, len(equals)


def _result(
    comparison: Comparison,
    entries: Mapping[object, FlownPlan],
    chosen: FlownPlan | None,
    ground: Ground | None,
    fresh: Cases | None = None,
    needed: Tightening | None = None,
    equals: int | None = None,
) -> RobustComparison:
    """Result of the search, its candidates by rank; ``equals``: default those of which enough cases
    comply.
    """
    usual = None if comparison.recommended is None else entries.get(_kind(comparison.recommended))
    if chosen is not None:
        chosen.finish(None)

    def rank(each: FlownPlan) -> tuple[bool, float, float]:
        missed = each.left if each.cases.complying is None else 1.0 - each.cases.complying
        return each is not chosen, missed, each.plan.pulses.cost

    candidates = tuple(sorted(entries.values(), key=rank))
    if equals is None:
        equals = sum(each.cases.enough is True for each in candidates)
    probability = required_share(comparison.spacecraft.requirement)
    return RobustComparison(
        comparison, candidates, usual, chosen, ground, equals, probability, needed, fresh
    )


def _kind(plan: Plan) -> object:
    """Key shared by plans whose pulses are equal but for rounding."""
    return tuple(
        (
            pulse.channel,
            round(pulse.t, 6),
            round(pulse.on_time, 6),
            *np.round(pulse.impulse, 6).tolist(),
        )
        for pulse in plan.pulses
    )


def _alignments(
    spacecraft: Spacecraft, scheme: str, options: Options
) -> Iterator[tuple[str, Plan]]:
    """Plans by other alignments of a scheme, named by their channels."""
    for plan in planning.alternatives(spacecraft, scheme, options):
        yield " then ".join(dict.fromkeys(pulse.channel for pulse in plan.pulses)), plan


def _others(spacecraft: Spacecraft, base: Plan) -> Iterator[tuple[str, Spacecraft]]:
    """Spacecraft for which the scheme plans differently: later, or without one of its channels."""
    for periods in LATER:  # of the nutation as seen in the body, inertial ones for a sphere
        earliest = spacecraft.limits.earliest + periods * spacecraft.nutation_period
        if earliest < spacecraft.horizon:
            yield (
                f"from {earliest:.4g} s on",
                with_limits(spacecraft, earliest=earliest),
            )
    for name in dict.fromkeys(pulse.channel for pulse in base.pulses):
        left = tuple(channel for channel in spacecraft.channels if channel.name != name)
        if left and len(left) < len(spacecraft.channels):
            yield f"without {name}", replace(spacecraft, channels=left)


def _early(spacecraft: Spacecraft, options: Options) -> Iterator[tuple[str, Plan]]:
    """Earliest end of `optimal`, and its cheapest plans that end little later; the same with H kept
    where it is free.

    Free, the pulses on either side of a long axial one damp what the moments of inertia decide;
    spin-up.yaml: 73 % of its cases comply, and 99.98 % with H kept.
    """
    settled = planner.settled(SCHEMES[OPTIMAL.name], options, spacecraft)
    free = isinstance(settled, OptimalOptions) and settled.free_axis is True
    for label, choice in (("", {}), (", H kept", {"free_axis": False, "shift": 0.0}))[: 1 + free]:
        chosen = Options(**{**options.chosen, **choice})
        first = attempt(spacecraft, OPTIMAL.name, Options(**{**chosen.chosen, "least": "time"}))
        if not first.feasible:
            continue
        yield f"earliest end{label}", first
        for times in WITHIN:
            horizon = times * first.end
            if horizon < spacecraft.horizon:
                soon = with_limits(spacecraft, horizon=horizon)
                yield f"by {horizon:.4g} s{label}", attempt(soon, OPTIMAL.name, chosen)


def _planned(
    variant: str, spacecraft: Spacecraft, scheme: str, options: Options
) -> list[tuple[str, Plan]]:
    return [(variant, attempt(spacecraft, scheme, options))]


def robust_reasons(robust: RobustComparison) -> Iterator[Note]:
    """Reason for the robust plan, or for none."""
    chosen = robust.chosen
    count = len(robust.candidates)
    required = 100.0 * robust.probability
    if chosen is None:
        yield note("none-feasible")
    elif count == 1:
        yield note("as-requested" if len(robust.comparison.plans) == 1 else "only-plan")
    else:
        share = chosen.cases.complying
        if share is None:
            yield note(
                "robust-least-left", count=count, equals=robust.equals, required_share=required
            )
        elif chosen.cases.enough:
            yield note(
                "robust-complies", count=count, equals=robust.equals, required_share=required
            )
        elif share > 0.0:
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
    complying, than = chosen.cases.complying, usual.cases.complying
    if complying is not None and than is not None:
        share, than_share = f"{100.0 * complying:.4g}", f"{100.0 * than:.4g}"
        yield note("robust-cost", share=share, than_share=than_share, **figures)
    else:
        left, than_left = math.degrees(chosen.left), math.degrees(usual.left)
        yield note("robust-cost-left", left_deg=left, than_left_deg=than_left, **figures)
