"""Robust plans: variations × dispersed cases → the cheapest of which enough cases comply.

Variations are the schedules of the schemes; plans with a margin of so many sigmas (`chance_plan`);
the earliest ends of `optimal`, for errors of the rates grow with time; and variants: later starts,
channels left unused, other alignments.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from nutdamp.common import results, work
from nutdamp.common.results import Note, note
from nutdamp.errors import Infeasible
from nutdamp.montecarlo.study import Results, next_stage, study_of
from nutdamp.planning import chance_plan
from nutdamp.planning import plan as planning
from nutdamp.planning.chance_plan import Tightening, tightening
from nutdamp.planning.decision import (
    ROBUST,
    SEARCH,
    TIES,
    Comparison,
    Ground,
    attempt,
    by_propellant,
    cheapest,
    nearest,
)
from nutdamp.planning.notes import beside
from nutdamp.planning.plan import Plan, Standing, judge
from nutdamp.planning.screening import LIKELIER, FlownPlan, entered
from nutdamp.planning.verdict import Cases, Verdict
from nutdamp.schemes import planner
from nutdamp.schemes.block_model import spin_turn
from nutdamp.schemes.catalogue import LEAST, OPTIMAL, SCHEMES, OptimalOptions, Options
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import keeps_limits
from nutdamp.spacecraft.model import Spacecraft, required_share
from nutdamp.spacecraft.roles import with_limits

# later starts that are tried, in nutation periods as seen in the body (inertial ones for a sphere)
LATER = (0.25, 0.5, 0.75, 1.0, 2.0)
# Work of the tolerances needed and of cases of the chosen plan, in searches of optimal: as long as
# two of them for configs/single-thruster.yaml.
SETTLING = 2.0

# Ends by which the scheme optimal is to be done with least cost, over the earliest one; the first
# for spin-up.yaml, of which 99.98 % of the cases comply with H kept, and at most 98.4 % with the
# others.
WITHIN = (1.35, 1.5, 2.0)

AS_PLANNED = "as planned"

FRESH = 211  # seed of cases that nothing was chosen by

SLACK = 1.02
"""Cost over that of `optimal` without margins from which on no more is tried: the difference
between two margins is as large.
"""

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


@dataclass(frozen=True, eq=False, repr=False)
class RobustComparison(results.Data, results.Shown):
    """Candidates from the best down; ``usual`` is recommended by the comparison, ``chosen`` the
    robust plan.

    ``ground`` decided among the ``equals`` ``candidates`` of a ``comparison``, by propellant or by
    impulse; ``probability``: share of the cases that must comply. ``tightening``:
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
        vars(plan)["verdict"] = judge(plan, self.chosen.cases, self.chosen.results)
        flown[plan] = self.chosen
        return replace(
            self.comparison, plans=plans if same else (*plans, plan), flown=flown, preferred=plan
        )

    @property
    def name(self) -> str:
        """Name of the robust plan in `joined`; empty where there is none."""
        plan = self.joined.recommended
        return "" if self.chosen is None or plan is None else plan.scheme


class Variation(NamedTuple):
    """Lazy ``plans``, each with the label of its variant.

    ``falling``: from the surest one down, so that those after one with which too few cases comply,
    and no more than with the one before, need not be made. ``size``: its work, in searches of
    `optimal`, of which a plan takes one at most.
    """

    plans: Callable[[], Iterable[tuple[str, Plan]]]
    falling: bool = False
    size: float = 0.1


Rounds = tuple[list[Variation], list[Variation], list[Variation]]


def variations_of(comparison: Comparison, options: Options | None = None) -> Rounds:
    """Variations of the plans compared, in three rounds.

    As planned and with margins; early ends of `optimal`; other alignments, later starts and fewer
    channels. Only of schemes that may be recommended.
    """
    spacecraft = comparison.spacecraft
    options = options or Options()
    first, early, others = list[Variation](), list[Variation](), list[Variation]()
    timed = spacecraft.commands is None or not comparison.only_commanded
    for base in comparison.plans:
        scheme = SCHEMES[base.scheme]
        if base._failure is not None or not (timed or scheme.reads_commands or not scheme.fires):
            continue
        first.append(Variation(partial(list, [(AS_PLANNED, base)])))
        others.append(Variation(partial(_alignments, spacecraft, base.scheme, options)))
        for variant, other in _others(spacecraft, base):
            others.append(Variation(partial(_planned, variant, other, base.scheme, options)))
        if scheme is OPTIMAL:
            first.append(Variation(partial(chance_plan.plans, spacecraft, options), True, 1.0))
            large = partial(chance_plan.plans, spacecraft, options, chance_plan.LARGE)
            first.append(Variation(large, size=1.0))
            settled = planner.settled(OPTIMAL, options, spacecraft)
            searches = 1.0 + len(WITHIN)
            early.append(Variation(partial(_early, spacecraft, options, ""), True, searches))
            # Free, the pulses on either side of a long axial one damp what the moments of inertia
            # decide; spin-up.yaml: 73 % of its cases comply, and 99.98 % with H kept.
            if isinstance(settled, OptimalOptions) and settled.free_axis:
                keeping = Options(**{**options.chosen, "free_axis": False, "shift": 0.0})
                kept = partial(_early, spacecraft, keeping, ", H kept")
                early.append(Variation(kept, True, searches))
    return first, early, others


def compare(
    comparison: Comparison,
    options: Options | None = None,
    *,
    allocate: bool = True,
    progress: Callable[[int, int], object] = lambda _done, _all: None,
) -> RobustComparison:
    """Let dispersed cases fly the `variations_of` the plans compared, and recommend one of them.

    The cheapest plan of which enough cases comply, in fresh ones too, beyond the intervals of both;
    else that with which most comply. ``allocate``: find the tolerances that are needed where too
    few comply; ``progress`` is called with the number of variations made, and that of all. Raises
    BadRequest for a spacecraft without dispersions.
    """
    spacecraft = comparison.spacecraft
    if comparison.preferred is not None:  # found with less work
        usual = tuple(plan for plan in comparison.plans if plan.scheme != ROBUST)
        comparison = replace(comparison, plans=usual, preferred=None)
    rounds = variations_of(comparison, options)
    count = sum(map(len, rounds))
    entries: dict[object, FlownPlan] = {}
    nominal = [plan.pulses.cost for plan in comparison.plans if plan.scheme == OPTIMAL.name]
    cheap = SLACK * min(nominal, default=0.0)
    chosen: FlownPlan | None = None
    unspent = work.FRONTS
    sizes = [math.fsum(variation.size for variation in variations) for variations in rounds]
    made = 0
    settling = SETTLING if allocate else 0.0
    with work.steps(sizes[0] + sizes[1] + settling, SEARCH) as steps:
        for number, variations in enumerate(rounds):
            before = len(entries)
            if number == len(rounds) - 1:  # few come so far
                steps.expected += sizes[number]
            with work.budget("the robust plans", unspent) as spent, work.no_cures():
                for variation in variations:
                    _fly(comparison, variation, entries)
                    made += 1
                    progress(made, count)
            unspent -= spent.done
            chosen, ground, fresh = _confirmed(entries, comparison.recommended, comparison.least)
            saves = comparison.least == LEAST[0]
            if saves and chosen is not None and chosen.plan.pulses.cost <= cheap:
                break
            # What beats the schemes beats their later starts; and others seldom cost less.
            best = max(entries.values(), key=_complying, default=None)
            ahead = best is not None and best.variant != AS_PLANNED
            if number == 1 and (ahead or (chosen is not None and len(entries) > before)):
                break
        progress(count, count)
        if chosen is not None:
            return _result(comparison, entries, chosen, ground, fresh)
        steps.reach(steps.expected - settling)
        chosen, ground, equals = _nearest(
            list(entries.values()), comparison.recommended, comparison.least
        )
        if chosen is None or not allocate or not requirements.judged(spacecraft):
            return _result(comparison, entries, chosen, ground, equals=equals)
        needed = (
            None
            if chosen.cases.enough
            else tightening(chosen.plan, required_share(spacecraft.requirement))
        )
        return _result(comparison, entries, chosen, ground, _fresh(chosen), needed, equals)


def with_robust(comparison: Comparison, options: Options | None = None) -> Comparison:
    """Comparison with the best robust plan that is found with the work of `work.ROBUST`.

    None is searched where, to first order, no pulses keep the requirement in enough cases.
    """
    if chance_plan.hopeless(comparison.spacecraft, options):
        return comparison
    with work.budget("the robust plans", work.ROBUST):
        robust = compare(comparison, options, allocate=False)
    if robust.chosen is not None:
        robust.chosen.finish(None)  # all cases, as of any plan that is shown
    return robust.joined


def _fly(comparison: Comparison, variation: Variation, entries: dict[object, FlownPlan]) -> None:
    """Let plans of a variation fly their first cases, and enter those that are new."""
    share = 0.0
    with work.steps(variation.size, variation.size) as steps:
        for variant, plan in () if work.exhausted() else variation.plans():
            steps.reach(steps.done + 1.0)
            candidate = None if _kind(plan) in entries else _entered(comparison, plan, variant)
            if candidate is None:
                continue
            entries[_kind(plan)] = candidate
            worse = candidate.cases.enough is False and _complying(candidate) <= share
            if work.exhausted() or (variation.falling and worse):
                return
            share = _complying(candidate)


def _complying(candidate: FlownPlan) -> float:
    """Share that complies so far; 0 where nothing is required."""
    return candidate.cases.complying or 0.0


def _entered(comparison: Comparison, plan: Plan, variant: str) -> FlownPlan | None:
    """A plan that has flown its first cases; None where it may not be chosen, or they cannot be
    flown.
    """
    spacecraft = comparison.spacecraft
    # Planned for other limits or channels, perhaps, but always flown by this spacecraft.
    if not plan.feasible or not keeps_limits(spacecraft, plan.pulses):
        return None
    own = plan if plan.spacecraft is spacecraft else replace(plan, spacecraft=spacecraft)
    if comparison.only_commanded and not own._commandable:
        return None
    compared = (comparison.flown or {}).get(plan)
    if compared is not None:
        return replace(compared, variant=variant)
    try:
        return entered(own, None, variant)
    except Infeasible:  # such as cases that take too long
        return None


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
        return 0.0 if each.plan._standing is Standing.COMPLIES else each.left

    hopeful = {
        each.plan: each
        for each in entries.values()
        if each.plan.meets_requirement is not False and each.cases.enough is not False
    }
    while hopeful:
        least = min(map(undamped, hopeful.values()))
        plan, ground = cheapest(
            [plan for plan, each in hopeful.items() if undamped(each) == least], usual, saved
        )
        candidate = hopeful.pop(plan)
        with suppress(Infeasible):
            candidate.decide(work.SAMPLES)  # one that takes more cases costs hardly less
            if candidate.cases.enough:
                candidate.finish(None)
            if candidate.cases.enough:
                fresh = _fresh(candidate)
                if fresh is not None and fresh.enough:
                    return candidate, ground, fresh
    return None, None, None


def _fresh(candidate: FlownPlan) -> Cases | None:
    """Plan in as many cases that it was not chosen by as decide on it; None where one of them
    cannot be flown.
    """
    plan = candidate.plan
    study = study_of(plan.spacecraft, plan.pulses, seed=FRESH)
    try:
        fresh = FlownPlan(plan, next_stage(Results(study, 0), work.SAMPLES))
        while not fresh.final and fresh.cases.enough is None:
            fresh.further(work.SAMPLES)
        return fresh.cases
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
            [plan for plan in equals if plan._standing is Standing.COMPLIES] or equals, usual, saved
        )
    elif all(candidate.cases.complying == 0.0 for candidate in candidates):
        equals = [candidate.plan for candidate in candidates]
        best, ground = nearest(equals)
    else:
        low = 0.0
        final = list[FlownPlan]()
        for candidate in sorted(candidates, key=lambda candidate: -candidate.cases.high):
            with suppress(Infeasible):
                candidate.finish(work.SAMPLES, low + LIKELIER if final else 0.0)
                if candidate.final:
                    final.append(candidate)
                    low = max(low, candidate.cases.low)
        equals = [each.plan for each in final if _complying(each) >= low]
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
    # periods of the nutation as seen in the body, inertial ones for a sphere
    periods = [share * spacecraft.nutation_period for share in LATER]
    if SCHEMES[base.scheme].reads_commands:
        # Blocks begin at Sun pulses, and starts within one turn ask the same question.
        periods = [share * spin_turn(spacecraft) for share in LATER if share >= 1.0]
    for period in periods:
        earliest = spacecraft.limits.earliest + period
        if earliest < spacecraft.horizon:
            yield (
                f"from {earliest:.4g} s on",
                with_limits(spacecraft, earliest=earliest),
            )
    for name in dict.fromkeys(pulse.channel for pulse in base.pulses):
        left = tuple(channel for channel in spacecraft.channels if channel.name != name)
        if left and len(left) < len(spacecraft.channels):
            yield f"without {name}", replace(spacecraft, channels=left)


def _early(spacecraft: Spacecraft, options: Options, label: str) -> Iterator[tuple[str, Plan]]:
    """Earliest end of `optimal`, and its cheapest plans that end little later."""
    soonest = Options(**{**options.chosen, "least": "time"})
    first = attempt(spacecraft, OPTIMAL.name, soonest)
    if not first.feasible:
        return
    yield f"earliest end{label}", first
    for times in WITHIN:
        horizon = times * first.end
        if horizon < spacecraft.horizon:
            limited = with_limits(spacecraft, horizon=horizon)
            yield f"by {horizon:.4g} s{label}", attempt(limited, OPTIMAL.name, options)


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
