"""Comparison of plans: the verdict on each, the recommendation by residuals and cost."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING

from nutdamp.common import results, work
from nutdamp.common.results import Note, note
from nutdamp.errors import NutdampError
from nutdamp.planning.plan import Plan, Standing, judge, plan, spinning, unflown
from nutdamp.planning.verdict import Cases, Cheaper, Verdict, no_plan
from nutdamp.schemes import catalogue, planner
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import (
    DAMPED_ANGLE,
    NEGLIGIBLE,
    SAME_COST,
    Part,
    missed,
    required,
)
from nutdamp.spacecraft.schedule import touching

if TYPE_CHECKING:
    from nutdamp.planning.screening import FlownPlan

SAME_ANGLE, SAME_SPEED = 1e-9, 1e-5
"""rad and m/s by which shifts of H and ΔV may differ and be equal: the rounding of a flight."""


class Ground(Enum):
    """Deciding ground among the plans of one standing."""

    ONLY = "only"
    CASES = "cases"
    """Most cases comply, where too few do with each plan."""
    ROBUST = "robust"
    """Made for dispersed cases."""
    LEFT = "left"
    NEAREST = "nearest"
    COST = "cost"
    NOMINAL = "tie-nominal"
    PULSES = "tie-pulses"
    DELTA_V = "tie-delta-v"
    SHIFT = "tie-shift"
    END = "tie-end"


TIES = (Ground.NOMINAL, Ground.PULSES, Ground.DELTA_V, Ground.SHIFT, Ground.END)
"""Grounds among plans of equal cost; the value of each is the code of its note."""


@dataclass(frozen=True, eq=False)
class Recommendation:
    """Recommended plan of the ``count`` of its ``standing``, by propellant or by impulse; None
    where none is feasible.

    ``least``: what is saved, of `catalogue.LEAST`; ``rivals``: all plans that comply, with it.
    """

    plan: Plan | None = None
    standing: Standing | None = None
    ground: Ground | None = None
    count: int = 0
    by_propellant: bool = True
    least: str = catalogue.LEAST[0]
    rivals: tuple[Plan, ...] = ()


def recommend(
    plans: Sequence[Plan],
    cases: Mapping[Plan, Cases] | None = None,
    least: str = catalogue.LEAST[0],
) -> Recommendation:
    """Recommendation: of the plans that meet the requirement, and damp where it bounds nothing, the
    `cheapest`.

    Where there is none, that with least nutation left (least distance from a target axis where that
    is more). Of plans that reach as much those that keep all cones count alone. With ``cases`` a
    plan meets the requirement in enough of them or not at all; where none does, it is that with
    which most comply. ``least``: of `catalogue.LEAST`.
    """
    feasible = [plan for plan in plans if plan.flown is not None]
    if not feasible:
        return Recommendation()
    enough = {plan for plan in feasible if not cases or cases[plan].enough}
    reached = {plan: plan._standing if plan in enough else Standing.MISSES for plan in feasible}
    standing = next(standing for standing in Standing if standing in reached.values())
    those = [plan for plan in feasible if reached[plan] is standing]
    those = [plan for plan in those if plan._kept is not False] or those
    if standing is Standing.COMPLIES:
        best, ground = cheapest(those, least=least)
        return Recommendation(
            best, standing, ground, len(those), by_propellant(those), least, tuple(those)
        )
    most = max(_complying(cases[plan]) for plan in those) if cases else 0.0
    if cases and standing is Standing.MISSES and most > 0.0 and len(those) > 1:
        best, _ = cheapest([plan for plan in those if _complying(cases[plan]) >= most], least=least)
        return Recommendation(best, standing, Ground.CASES, len(those), by_propellant(those), least)
    best, ground = nearest(those)
    return Recommendation(best, standing, ground, len(those), by_propellant(those), least)


def _complying(cases: Cases) -> float:
    """Share that complies, the lower end of its interval where more cases are to fly."""
    return (cases.complying or 0.0) if cases.final else cases.low


def cheapest(
    plans: Sequence[Plan], usual: Plan | None = None, least: str = catalogue.LEAST[0]
) -> tuple[Plan, Ground]:
    """Plan of least propellant (impulse where one is unknown), or of what else is saved, and the
    deciding ground.

    Of costs within `SAME_COST` the ``usual`` one, else that with less propellant where that was not
    compared, fewer pulses, less ΔV, less momentum shift (distance from the target axis), the
    earlier end; the first of these that leaves one decides.
    """
    if len(plans) == 1:
        return plans[0], Ground.ONLY
    unit = cost_unit(plans)
    fewest = min(plan.pulses.spent(least, unit) for plan in plans)
    equal = [plan for plan in plans if plan.pulses.spent(least, unit) <= fewest * (1.0 + SAME_COST)]
    if len(equal) > 1 and least != catalogue.LEAST[0]:
        fewest = min(plan.pulses.cost_in(unit) for plan in equal)
        equal = [plan for plan in equal if plan.pulses.cost_in(unit) <= fewest * (1.0 + SAME_COST)]
    if len(equal) == 1:
        return equal[0], Ground.COST
    if usual is not None and any(plan is usual for plan in equal):
        return usual, Ground.NOMINAL
    for ground, measure, same in (
        (Ground.PULSES, lambda plan: float(len(plan.pulses)), 0.0),
        (Ground.DELTA_V, speed, SAME_SPEED),
        (Ground.SHIFT, off_target, SAME_ANGLE),
    ):
        values = [value for plan in equal if (value := measure(plan)) is not None]
        if len(values) < len(equal):  # not known of all
            continue
        fewest = min(values) + same
        equal = [plan for plan, value in zip(equal, values, strict=True) if value <= fewest]
        if len(equal) == 1:
            return equal[0], ground
    earliest = min(plan.pulses.end for plan in equal)
    first = next(plan for plan in equal if plan.pulses.end <= earliest + touching(earliest))
    return first, Ground.END


def nearest(plans: Sequence[Plan]) -> tuple[Plan, Ground]:
    """Plan of least residual but for `DAMPED_ANGLE`, nearest to the requirement, then `cheapest`;
    deciding ground.
    """
    if len(plans) == 1:
        return plans[0], Ground.ONLY
    least = min(map(_missed, plans))
    as_little = [plan for plan in plans if _missed(plan) <= least + DAMPED_ANGLE]
    if len(as_little) == 1:
        return as_little[0], Ground.LEFT
    spacecraft = as_little[0].spacecraft
    least = min(plan._severity for plan in as_little)
    rounding = NEGLIGIBLE / min(
        (bound.limit for bound in required(spacecraft) if bound.part is not Part.SPIN), default=1.0
    )
    near = [plan for plan in as_little if plan._severity <= least * (1.0 + SAME_COST) + rounding]
    return (near[0], Ground.NEAREST) if len(near) == 1 else cheapest(near)


def by_propellant(plans: Sequence[Plan]) -> bool:
    """True if propellant is known for all plans, which are compared by it; else by impulse."""
    return all(plan.pulses.propellant is not None for plan in plans)


def cost_unit(plans: Sequence[Plan]) -> str:
    """Unit of the costs that plans are compared by."""
    return "kg" if by_propellant(plans) else "N m s"


def speed(plan: Plan) -> float | None:
    """|ΔV| in m/s; None where unknown."""
    return None if plan._delta_v is None else math.hypot(*plan._delta_v.tolist())


def off_target(plan: Plan) -> float:
    """Distance of H at the end from the target axis, or its start, rad."""
    assert plan.flown is not None
    return plan.flown.axis_error


def _missed(plan: Plan) -> float:
    assert plan.flown is not None
    return float(missed(plan.spacecraft, plan.flown.nutation, plan.flown.axis_error))


ROBUST = "robust"  # name of the robust plan beside those of schemes

SEARCH = 100.0
"""Steps of progress of a scheme that searches, and of the dispersed cases, beside one of each
classic scheme.
"""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(results.Data, results.Tabled):
    """The ``plans`` for a ``spacecraft``, and the recommended one; ``comparison["two-pulse"]`` is
    one of them.

    ``flown``: the feasible ones in dispersed cases; None where these were not to be flown.
    ``named``: their schemes were; ``timed``: pulses may be timed one by one though the spacecraft
    takes commands; ``least``: what is saved; ``preferred``: the robust plan, which is recommended
    whatever the others cost.
    """

    spacecraft: Spacecraft
    plans: tuple[Plan, ...]
    flown: Mapping[Plan, FlownPlan] | None = field(default=None, repr=False)
    named: bool = False
    timed: bool = False
    least: str = catalogue.LEAST[0]
    preferred: Plan | None = None

    def __len__(self) -> int:
        return len(self.plans)

    def __iter__(self) -> Iterator[Plan]:
        return iter(self.plans)

    def __getitem__(self, scheme: str) -> Plan:
        return {candidate.scheme: candidate for candidate in self.plans}[scheme]

    @property
    def reason(self) -> str:
        """Reason for the recommendation."""
        return str(results.view(self, "reason"))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings on the recommended plan: unmet bounds and limiting factors."""
        return tuple(results.view(self, "sentences"))

    @cached_property
    def recommendation(self) -> Recommendation:
        """Recommended plan and deciding ground."""
        if self.preferred is None:
            return recommend(self.eligible, self.cases, self.least)
        standing = (
            self.preferred._standing
            if self.verdicts[self.preferred].met is not False
            else Standing.MISSES
        )
        return Recommendation(
            self.preferred, standing, Ground.ROBUST, 1, by_propellant([self.preferred]), self.least
        )

    @property
    def only_commanded(self) -> bool:
        """True if only commandable plans may be recommended: not ``timed``, nor ``named`` without
        any of them.
        """
        return not self.timed and (
            not self.named or any(plan.feasible and plan._commandable for plan in self.plans)
        )

    @property
    def eligible(self) -> tuple[Plan, ...]:
        """Feasible plans that may be recommended."""
        return tuple(
            plan
            for plan in self.plans
            if plan.feasible and (plan._commandable or not self.only_commanded)
        )

    @property
    def nominal(self) -> bool:
        """True if dispersed cases were left out though the file gives dispersions."""
        return self.flown is None and self.spacecraft.dispersions is not None

    @cached_property
    def cases(self) -> Mapping[Plan, Cases]:
        """Dispersed cases of each feasible plan, from none to all where they have not flown; empty
        if not to decide.
        """
        if self.flown is None or not requirements.judged(self.spacecraft):
            return {}
        feasible = (plan for plan in self.plans if plan.feasible)
        return {
            plan: self.flown[plan].cases if plan in self.flown else unflown(plan)
            for plan in feasible
        }

    @cached_property
    def verdicts(self) -> Mapping[Plan, Verdict]:
        """Judgement of each plan, by its dispersed cases where they were flown."""
        return {plan: self._judged(plan) for plan in self.plans}

    @property
    def others(self) -> tuple[Verdict, ...]:
        """Judgements of the feasible plans that are not recommended."""
        return tuple(
            verdict
            for plan, verdict in self.verdicts.items()
            if plan.feasible and plan is not self.recommended
        )

    def _judged(self, plan: Plan) -> Verdict:
        flown = (self.flown or {}).get(plan)
        cases, cored = (None, None) if flown is None else (flown.cases, flown.results)
        return judge(plan, cases, cored, nominal=self.nominal, timed=self.timed)

    @cached_property
    def verdict(self) -> Verdict:
        """Judgement of the recommended plan, with the plans that cost less; of no plan where none
        is feasible.
        """
        plan = self.recommended
        if plan is None:
            return no_plan(self.spacecraft)
        feasible = [each for each in self.plans if each.feasible]
        unit = cost_unit(feasible)
        most = plan.pulses.spent(self.least, unit) * (1.0 - SAME_COST)
        cheaper = []
        for other in feasible:
            if other is not plan and other.pulses.spent(self.least, unit) < most:
                why = self.shortcoming(other)
                cheaper += [] if why is None else [Cheaper(other.scheme, other.pulses, why)]
        return replace(self.verdicts[plan], cheaper=tuple(cheaper))

    def shortcoming(self, plan: Plan) -> Note | None:
        """Reason for which a feasible plan may not be recommended, whatever it costs; None where
        there is none.
        """
        verdict = self.verdicts[plan]
        missed = next((line for line in verdict.lines if not line.bound.met(line.nominal)), None)
        if missed is not None:
            return missed.note
        if not plan._commandable and self.only_commanded:
            return note("why-single-pulses")
        cases = verdict.cases
        if requirements.judged(self.spacecraft) and self.flown is not None:
            if cases is None or cases.complying is None:
                return note("why-cases-unknown")
            if cases.enough is not True:
                share = cases.complying if cases.final else cases.high
                return note(
                    "why-few-comply" if cases.final else "why-few-may-comply",
                    complying_percent=100.0 * share,
                )
        return None

    @property
    def recommended(self) -> Plan | None:
        """Recommended plan; None where no scheme is feasible."""
        return self.recommendation.plan

    @property
    def too_few_comply(self) -> bool:
        """True where of no plan of the usual schemes dispersed cases show that enough comply."""
        flown = any(cases.samples for cases in self.cases.values())
        return flown and not self.named and self.verdict.met is False

    @property
    def failed(self) -> tuple[Plan, ...]:
        """Plans whose scheme has a bug."""
        return tuple(plan for plan in self.plans if plan._failure is not None)


def usual(spacecraft: Spacecraft) -> tuple[str, ...]:
    """Default schemes of a comparison: the classic ones and optimal; those that can point or set
    the spin, if needed.

    `none` is among them where no pulse may be needed.
    """
    names = catalogue.COMPARED if spacecraft.goal.axis is None else catalogue.POINTING
    if requirements.unaided(spacecraft):
        names = ("none", *names)
    if spacecraft.commands is not None:  # before those that may take all the work
        slow = [name for name in names if catalogue.SCHEMES[name].slow]
        names = (*(name for name in names if name not in slow), *catalogue.COMMANDED, *slow)
    return (
        names
        if requirements.reaches_spin(spacecraft)
        else tuple(dict.fromkeys((*names, *spinning(spacecraft))))
    )


def compare(
    spacecraft: Spacecraft,
    names: Sequence[str] = (),
    options: planner.Choice = None,
    *,
    samples: int | None = None,
    timed: bool = False,
) -> Comparison:
    """Plan the schemes named, else the `usual` ones, and recommend one; one that has a bug takes no
    other down.

    With dispersions each plan flies as many of ``samples`` cases (default as `disperse`, without a
    requirement 0) as it takes to know whether enough comply. ``timed``: see `Comparison`. Raises
    NutdampError, such as BadRequest, and KeyError for a name not in `schemes.NAMES`.
    """
    unknown = set(names) - set(catalogue.NAMES)
    if unknown:
        raise KeyError(*sorted(unknown))
    sizes = [
        (name, 1.0 if catalogue.SCHEMES[name].classic else SEARCH)
        for name in names or usual(spacecraft)
    ]
    flies = SEARCH if _flies(spacecraft, samples) else 0.0
    with work.steps(sum(size for _, size in sizes) + flies):
        plans = []
        with work.budget("the comparison", work.COMMAND):
            for name, size in sizes:
                with work.steps(1.0, size):
                    plans.append(attempt(spacecraft, name, options))
        least = (
            options.chosen.get("least")
            if isinstance(options, catalogue.Options)
            else getattr(options, "least", None)
        )
        return compare_plans(
            plans,
            named=bool(names),
            samples=samples,
            timed=timed,
            least=least or catalogue.LEAST[0],
        )


def compare_plans(
    plans: Sequence[Plan],
    *,
    named: bool = True,
    samples: int | None = None,
    timed: bool = False,
    least: str = catalogue.LEAST[0],
) -> Comparison:
    """Comparison of plans of one spacecraft, as the schedule of a file, in the dispersed cases of
    `compare`.
    """
    nominal = Comparison(plans[0].spacecraft, tuple(plans), named=named, timed=timed, least=least)
    if not _flies(nominal.spacecraft, samples):
        return nominal
    from nutdamp.planning.screening import fly_compared

    feasible = [plan for plan in plans if plan.feasible]
    with work.steps(len(feasible) + 1.0, SEARCH):
        eligible = nominal.eligible
        flown = fly_compared(
            feasible, samples, lambda cases: recommend(eligible, cases, least).plan, eligible
        )
    compared = replace(nominal, flown=flown)
    for flown_plan in flown.values():
        if (
            flown_plan.final and samples is None
        ):  # by the cases of any other command: they need not fly again
            vars(flown_plan.plan)["verdict"] = judge(
                flown_plan.plan, flown_plan.cases, flown_plan.results
            )
    return compared


def _flies(spacecraft: Spacecraft, samples: int | None) -> bool:
    """True if plans fly dispersed cases."""
    wanted = requirements.judged(spacecraft) if samples is None else samples > 0
    return spacecraft.dispersions is not None and wanted


def attempt(spacecraft: Spacecraft, scheme: str, options: planner.Choice) -> Plan:
    """Plan of a scheme, or one that carries its unexpected exception."""
    try:
        planned = plan(spacecraft, scheme, options)
        # Judged here, where a failure is that of this scheme alone, and not when the first figure
        # is shown.
        _ = planned.residual, planned._delta_v
    except NutdampError:
        raise
    except Exception as failure:
        return Plan(spacecraft, scheme, None, failure)
    return planned
