"""Comparison of plans, the decision on one of them line by line, and simulations to a given time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from nutdamp.common import results, work
from nutdamp.errors import NutdampError
from nutdamp.flight import end_state, propagation
from nutdamp.flight.end_state import Aspect, left_by, seen_at
from nutdamp.flight.propagation import Extremes, Flight, Track, extremes
from nutdamp.planning.plan import Plan, Share, Standing, plan, reaches_spin, spinning
from nutdamp.planning.recommendation import Recommendation, recommend
from nutdamp.schemes import catalogue, planner
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import Breach, Limit, breaches
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import NEGLIGIBLE, Bound, Held
from nutdamp.spacecraft.schedule import Schedule

if TYPE_CHECKING:
    from nutdamp.montecarlo.study import Results
    from nutdamp.planning.screening import Cases, PlanCandidate

PICTURED = 100_000  # largest number of rows of the track of a picture


BUG = "internal error, please report"
"""Message on a plan whose scheme raised an unexpected exception, which follows by name."""

SEARCH = 100.0
"""Steps of progress of a scheme that searches, and of the dispersed cases, beside one of each classic scheme."""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(results.Data, results.Tabled):
    """Plans for one spacecraft, and the recommended one; ``comparison["two-pulse"]`` is one of them.

    ``flown``: the feasible ones in dispersed cases; None where these were not to be flown. ``named``: their schemes
    were; ``timed``: pulses may be timed one by one though the spacecraft takes commands.
    """

    spacecraft: Spacecraft
    plans: tuple[Plan, ...]
    flown: Mapping[Plan, PlanCandidate] | None = field(default=None, repr=False)
    named: bool = False
    timed: bool = False

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
        return recommend(self.eligible, self.shares)

    @property
    def only_commanded(self) -> bool:
        """True if only commandable plans may be recommended: not ``timed``, nor ``named`` without any of them."""
        return not self.timed and (not self.named or any(plan.feasible and plan.commandable for plan in self.plans))

    @property
    def eligible(self) -> tuple[Plan, ...]:
        """Feasible plans that may be recommended."""
        return tuple(plan for plan in self.plans if plan.feasible and (plan.commandable or not self.only_commanded))

    @property
    def needless(self) -> bool:
        """True if no pulse is needed: the recommended plan has none, or those named are not needed."""
        chosen = self.recommended
        return requirements.unaided(self.spacecraft) and (self.named or chosen is None or not len(chosen.pulses))

    @cached_property
    def shares(self) -> Mapping[Plan, Share]:
        """Share of dispersed cases that comply with each feasible plan; empty where they do not decide."""
        if self.flown is None:
            return {}
        from nutdamp.planning.screening import shares_of

        return shares_of([plan for plan in self.plans if plan.feasible], self.flown)

    def cases(self, plan: Plan) -> Cases | None:
        """Dispersed cases of a plan; None where they were not flown."""
        candidate = (self.flown or {}).get(plan)
        return None if candidate is None else candidate.cases

    def results(self, plan: Plan) -> Results | None:
        """All dispersed results of a plan; None where they have not flown."""
        candidate = (self.flown or {}).get(plan)
        return None if candidate is None or not candidate.cases.decided else candidate.results

    def meets(self, plan: Plan) -> bool | None:
        """True if a plan meets the requirement, in enough dispersed cases too where they decide."""
        met = plan.meets_requirement
        return bool(self.shares[plan].met) if met and plan in self.shares else met

    @property
    def recommended(self) -> Plan | None:
        """Recommended plan; None where no scheme is feasible."""
        return self.recommendation.plan

    @cached_property
    def with_disturbances(self) -> Plan | None:
        """Recommendation among the schemes planned with the disturbances; None where they were, or there are none.

        A scheme that is slow is planned only where no other one complies.
        """
        chosen, body = self.recommended, self.spacecraft
        if chosen is None or not body.disturbances or chosen.options.with_disturbances:
            return None
        others: tuple[Plan, ...] = ()
        try:
            for slow in (False, True):
                for plan in self.plans:
                    if plan.scheme in catalogue.SCHEMES and catalogue.SCHEMES[plan.scheme].slow == slow:
                        aware = replace(plan.options, with_disturbances=True)
                        others = (*others, attempt(body, plan.scheme, aware))
                best = replace(self, plans=others, flown=None).recommended
                if best is not None and best.standing is Standing.COMPLIES:
                    break
        except NutdampError:
            return None
        return best

    @property
    def failed(self) -> tuple[Plan, ...]:
        """Plans whose scheme has a bug."""
        return tuple(plan for plan in self.plans if plan.failure is not None)


def usual(spacecraft: Spacecraft) -> tuple[str, ...]:
    """Default schemes of a comparison: the classic ones and optimal; those that can point or set the spin, if needed.

    `none` is among them where no pulse may be needed.
    """
    names = catalogue.COMPARED if spacecraft.goal.axis is None else catalogue.POINTING
    if requirements.unaided(spacecraft):
        names = ("none", *names)
    if spacecraft.commands is not None:  # before those that may take all the work
        slow = [name for name in names if catalogue.SCHEMES[name].slow]
        names = (*(name for name in names if name not in slow), *catalogue.COMMANDED, *slow)
    return names if reaches_spin(spacecraft) else tuple(dict.fromkeys((*names, *spinning(spacecraft))))


def compare(
    spacecraft: Spacecraft,
    names: Sequence[str] = (),
    options: planner.Choice = None,
    *,
    samples: int | None = None,
    timed: bool = False,
) -> Comparison:
    """Plan the schemes named, else the `usual` ones, and recommend one; one that has a bug takes no other down.

    With dispersions each plan flies as many of ``samples`` cases (default `work.SAMPLES`, without a requirement 0) as
    it takes to know whether enough comply. ``timed``: see `Comparison`. Raises NutdampError, such as BadRequest, and
    KeyError for a name not in `schemes.NAMES`.
    """
    unknown = set(names) - set(catalogue.NAMES)
    if unknown:
        raise KeyError(*sorted(unknown))
    sizes = [(name, 1.0 if catalogue.SCHEMES[name].classic else SEARCH) for name in names or usual(spacecraft)]
    flies = SEARCH if _flies(spacecraft, samples) else 0.0
    with work.steps(sum(size for _, size in sizes) + flies):
        plans = []
        with work.budget("the comparison", work.COMMAND):
            for name, size in sizes:
                with work.steps(1.0, size):
                    plans.append(attempt(spacecraft, name, options))
        return compare_plans(plans, named=bool(names), samples=samples, timed=timed)


def compare_plans(
    plans: Sequence[Plan], *, named: bool = True, samples: int | None = None, timed: bool = False
) -> Comparison:
    """Comparison of plans of one spacecraft, as the schedule of a file, in the dispersed cases of `compare`."""
    nominal = Comparison(plans[0].spacecraft, tuple(plans), named=named, timed=timed)
    if not _flies(nominal.spacecraft, samples):
        return nominal
    from nutdamp.planning.screening import fly_compared

    feasible = [plan for plan in plans if plan.feasible]
    count = work.SAMPLES if samples is None else samples
    most = work.CASES * max(1.0, count / work.SAMPLES)
    with work.budget("the dispersed cases", most), work.steps(len(feasible) + 1.0, SEARCH):
        flown = fly_compared(feasible, count, lambda shares: recommend(nominal.eligible, shares).plan)
    return replace(nominal, flown=flown)


def _flies(spacecraft: Spacecraft, samples: int | None) -> bool:
    """True if plans fly dispersed cases."""
    wanted = requirements.judged(spacecraft) if samples is None else samples > 0
    return spacecraft.dispersions is not None and wanted


def attempt(spacecraft: Spacecraft, scheme: str, options: planner.Choice) -> Plan:
    """Plan of a scheme, or one that carries its unexpected exception."""
    try:
        planned = plan(spacecraft, scheme, options)
        # Judged here, where a failure is that of this scheme alone, and not when the first figure is shown.
        _ = planned.residual, planned.delta_v, planned.left_if_symmetric
    except NutdampError:
        raise
    except Exception as failure:
        return Plan(spacecraft, scheme, None, f"{BUG}: {type(failure).__name__}", failure=failure)
    return planned


@dataclass(frozen=True, slots=True)
class Line:
    """Part of the requirement: its bound, and its residual with ``nominal`` values (rad, rad/s).

    ``dispersed``: what the share of cases required does not exceed; None, as ``met``, where that is not known.
    """

    bound: Bound
    nominal: float
    dispersed: float | None
    met: bool | None

    @property
    def margin(self) -> float:
        """Margin to the bound, rad (rad/s): of the dispersed value, where it is known."""
        return self.bound.most - (self.nominal if self.dispersed is None else self.dispersed)


@dataclass(frozen=True, eq=False)
class Decision:
    """Plan to decide on, the parts of its requirement, and its dispersed ``cases``, None if not flown.

    ``unknown``: cases were to decide, but not all of them could be flown within the budget of work.
    ``seen``: the flight through the real widths by a certain time; None for that to the end of the last pulse.
    """

    plan: Plan
    cases: Cases | None = None
    unknown: bool = False
    seen: Flight | None = None

    @property
    def flight(self) -> Flight:
        """Judged flight."""
        return self.plan.flight if self.seen is None else self.seen

    @property
    def lines(self) -> tuple[Line, ...]:
        """Required parts, and those with a definition of damped or reached."""
        required, body = requirements.required(self.plan.spacecraft), self.plan.spacecraft
        enough = None if self.cases is None else self.cases.met
        # Of a sole part the count of cases and the percentile, which lies between two of them, say the same.
        counted = enough or (enough is not None and len(required) == 1 and not body.keep)
        lines = []
        for bound, nominal, kept in ((held.bound, held.left, held.met) for held in self._held):
            dispersed = None if self.cases is None else self.cases.levels.get(bound.part)
            met: bool | None = kept and (dispersed is None or dispersed <= bound.most)
            if bound.required and enough is not None and (counted or dispersed is None):
                met = kept and enough if counted else None
            lines.append(Line(bound, nominal, dispersed, met))
        return tuple(lines)

    @property
    def _held(self) -> tuple[Held, ...]:
        return self.plan.held if self.seen is None else requirements.held(self.plan.spacecraft, left_by(self.seen))

    @cached_property
    def aspects(self) -> tuple[Aspect, ...]:
        """Extreme angles of the spin axis from each watched direction, with nominal values."""
        return self.plan.aspects if self.seen is None else end_state.aspects(self.seen, self.seen.until)

    @property
    def strays(self) -> tuple[Aspect, ...]:
        """Members of `aspects` that break a cone."""
        return tuple(aspect for aspect in self.aspects if not aspect.kept)

    @property
    def damped(self) -> bool:
        """True if all of `lines` is kept with nominal values, unrequired parts included."""
        return all(line.met for line in self._held)

    @property
    def nominal(self) -> bool | None:
        """Compliance at the end with nominal values; None where nothing is required."""
        required = [line.met for line in self._held if line.bound.required]
        return all(required) if required else None

    @property
    def met(self) -> bool | None:
        """Compliance with nominal values and in enough cases; None where nothing is required.

        It is not where the spin axis breaks a cone on the way.
        """
        if self.strays or (self.unknown and self.nominal):
            return False
        return self.nominal if not self.nominal or self.cases is None else self.cases.met

    @property
    def undispersed(self) -> bool:
        """True if the file gives dispersions and no such cases were flown."""
        return self.cases is None and not self.unknown and self.plan.spacecraft.dispersions is not None


def decide(compared: Comparison) -> Decision | None:
    """Decision on the recommended plan, by its dispersed cases where they were flown; None without one."""
    plan = compared.recommended
    if plan is None:
        return None
    cases, share = compared.cases(plan), compared.shares.get(plan)
    undecided = share is not None and share.met is None
    return Decision(plan, None if undecided else cases, undecided)


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(results.Data, results.Tabled):
    """Propagation of a ``plan`` to ``until`` s, shown through ``real`` widths or by the impulse sum (17).

    Its track has ``samples`` rows; pictures show it to ``drawn_to`` s.
    """

    plan: Plan
    until: float
    real: bool
    samples: int
    drawn_to: float

    @cached_property
    def _both(self) -> tuple[Flight, Flight]:
        body, pulses = self.plan.spacecraft, self.plan.pulses
        return propagation.by_impulses(body, pulses, self.until), propagation.flown(body, pulses, self.until)

    @cached_property
    def impulses(self) -> Flight:
        """Flight by the impulse sum (17), truncated at ``until``."""
        return seen_at(self._both[0], self.until)

    @cached_property
    def flown(self) -> Flight:
        """Flight through the real widths, truncated at ``until``."""
        return seen_at(self._both[1], self.until)

    @cached_property
    def shown(self) -> Flight:
        """The shown one of them."""
        return replace(self.flown if self.real else self.impulses, scheme=self.plan.scheme)

    @cached_property
    def decision(self) -> Decision:
        """Compliance of the flight through the real widths."""
        return Decision(self.plan, seen=self.flown)

    @cached_property
    def extremes(self) -> Extremes:
        """Extremes of the axis track."""
        return extremes(self.pieces())

    def pieces(self) -> Iterator[Track]:
        """Track of the flight shown, in pieces."""
        return self._both[self.real].pieces(self.samples, self.until)

    @cached_property
    def pictured(self) -> Track:
        """Track of pictures, of at most 100,000 rows."""
        return self._both[self.real].sampled(min(self.samples, PICTURED), self.drawn_to)


TELLING = math.radians(1e-6)  # remaining nutation angle in rad from which there is a note on it

CUT = "the search ended at its limit of work"


def infeasibility(plan: Plan) -> str:
    """Reason for the lack of a schedule; empty where there is one."""
    if plan.breach is not None:
        why = f"the only schedule found breaks a limit: {_broken(plan.breach)}"
    elif plan.astray is not None:
        why = strays(plan.astray)
        if math.isfinite(plan.astray.least_at):
            why += "; no way round it was found within the limits"
    elif plan.worse is not None:
        why = f"the best schedule found would leave {math.degrees(plan.worse):.3g}° of nutation"
        decayed = requirements.decayed(plan.spacecraft, plan.worse_at)
        if decayed < plan.spacecraft.nutation:
            why += f" at {plan.worse_at:.4g} s; without a pulse it decays to {math.degrees(decayed):.3g}° by then"
    else:
        why = plan.refusal or ""
    return f"{why}; {CUT}" if why and plan.cut else why


def strays(aspect: Aspect) -> str:
    """Message on a broken cone."""
    keep, (angle, at, limit) = aspect.keep, aspect.broken_at
    bound = f"{'min' if aspect.too_near else 'max'} = {math.degrees(limit):.6g}°"
    seen = f"{math.degrees(angle) if angle > NEGLIGIBLE else 0.0:.4g}°"
    if math.isinf(at):
        return f"the target is {seen} from {keep.name} ({bound})"
    return f"the spin axis comes to {seen} from {keep.name} at {at:.4g} s ({bound})"


def broken_limits(spacecraft: Spacecraft, schedule: Schedule) -> list[str]:
    """Broken limits of a schedule, each in a sentence with the first pulse that breaks it and the number of others."""
    grouped: dict[tuple[Limit, tuple[float, float] | None], list[Breach]] = {}
    for breach in breaches(spacecraft, schedule):
        grouped.setdefault((breach.limit, breach.window), []).append(breach)
    counts = [(_broken(broken[0]), len(broken) - 1) for broken in grouped.values()]
    return [text + f"; further pulses alike: {more}" * (more > 0) for text, more in counts]


def _broken(breach: Breach) -> str:
    """Message on a pulse that breaks a limit."""
    pulse, bound, limit = breach.pulse, f"{breach.bound:.6g} s", breach.limit
    if limit is Limit.MAX_PULSES:
        return f"{breach.number} pulses are more than {breach.bound:.0f}"
    begins, ends = breach.window or (math.nan, math.nan)
    start, on_time = pulse.loaded
    on = f"is on for {on_time:.6g} s"
    early = f"comes less than {bound} after the one before" if breach.bound else "starts before the one before ends"
    how = {
        Limit.RESOLUTION: f"is too short for its time, where times are {breach.by:.2g} s apart",
        Limit.EARLIEST: f"starts before {bound}",
        Limit.HORIZON: f"ends after the horizon of {bound}",
        Limit.GAP: early,
        Limit.BLACKOUT: f"lies in the blackout window {begins:.6g} s to {ends:.6g} s",
        Limit.MIN_ON_TIME: f"{on}, less than the shortest on-time of {bound}",
        Limit.MAX_ON_TIME: f"{on}, more than the longest on-time of {bound}",
        Limit.START_TICK: f"does not start on a tick of {bound}",
        Limit.ON_TIME_TICK: f"has an on-time that is not a multiple of the tick of {bound}",
    }[limit]
    return f"pulse {breach.number} ({pulse.channel}, {start:.6g} s to {pulse.over:.6g} s) {how}"
