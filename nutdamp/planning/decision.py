"""Plans compared, the decision on one of them line by line, and remarks.

What a reader should know of a plan, in sentences: what its scheme says, its bounds, why nutation is left, I1 ≠ I2.

Also why there is no schedule, and which limits a schedule breaks. The plan gives the data; what is said of several
plans together is in `nutdamp.views.verdicts`.

Several plans for one spacecraft, and which of them is recommended.

What is to be decided of a plan: each part of the requirement with its margin, the cases that comply, how it ends.

Data, no sentences: `nutdamp.views.decisions` has the words, which every screen, page and file takes from there.

The pulses of a plan propagated to a given time by both models: what ``simulate`` shows.
"""

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
from nutdamp.flight.propagation import Final, Flight
from nutdamp.flight.track import Extremes, Track, extremes
from nutdamp.planning.plan import Plan, plan, reaches_spin, spinning
from nutdamp.planning.recommendation import Hindrance, Obstacle, Recommendation, Share, Standing, recommend
from nutdamp.schemes import catalogue, planner
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import Breach, Limit, breaches
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.requirements import NEGLIGIBLE, Bound, Held
from nutdamp.spacecraft.schedule import Schedule

if TYPE_CHECKING:
    from nutdamp.montecarlo.study import Results
    from nutdamp.planning.screening import Candidate, Cases


BUG = "internal error, please report"
"""Why there is no plan where a scheme raised what it should not; the name of the exception follows."""


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(results.Data, results.Tabled):
    """Several plans for one spacecraft, and which of them is recommended on what ground.

    ``comparison["two-pulse"]`` is one of them, iterating gives all. ``flown``: the feasible ones in dispersed cases;
    None where these were not to be flown. ``named``: their schemes were; ``timed``: pulses may be timed one by one
    though the spacecraft takes commands.
    """

    spacecraft: Spacecraft
    plans: tuple[Plan, ...]
    flown: Mapping[Plan, Candidate] | None = field(default=None, repr=False)
    named: bool = False
    timed: bool = False

    def __len__(self) -> int:
        return len(self.plans)

    def __iter__(self) -> Iterator[Plan]:
        return iter(self.plans)

    def __getitem__(self, scheme: str) -> Plan:
        for one in self.plans:
            if one.scheme == scheme:
                return one
        raise KeyError(scheme)

    @property
    def reason(self) -> str:
        """Why the recommended one."""
        return results.reason(self)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the recommended plan does not reach, and what hinders it."""
        return results.sentences(self)

    @cached_property
    def recommendation(self) -> Recommendation[Plan]:
        """Which plan to fly, and what decided."""
        return recommend(self.eligible, self.shares)

    @property
    def only_commanded(self) -> bool:
        """Whether only plans that can be commanded may be recommended.

        Others may, where pulses may be ``timed``, or schemes were ``named`` and none of their plans can be commanded.
        """
        return not self.timed and (not self.named or any(one.feasible and one.commandable for one in self.plans))

    @property
    def eligible(self) -> tuple[Plan, ...]:
        """The feasible plans that may be recommended."""
        return tuple(one for one in self.plans if one.feasible and (one.commandable or not self.only_commanded))

    @property
    def restricted(self) -> bool:
        """Whether feasible plans were left out because they cannot be commanded."""
        return len(self.eligible) < sum(one.feasible for one in self.plans)

    @property
    def needless(self) -> bool:
        """Whether no pulse has to be fired: the recommended plan has none, or those named are not needed."""
        chosen = self.recommended
        return requirements.unaided(self.spacecraft) and (self.named or chosen is None or not len(chosen.pulses))

    @cached_property
    def shares(self) -> Mapping[Plan, Share]:
        """The share of dispersed cases that comply with each feasible plan; nothing where they do not decide."""
        if self.flown is None:
            return {}
        from nutdamp.planning.screening import shares_of

        return shares_of([one for one in self.plans if one.feasible], self.flown)

    def cases(self, plan: Plan) -> Cases | None:
        """How a plan fares in dispersed cases; None where they were not flown."""
        candidate = None if self.flown is None else self.flown.get(plan)
        return None if candidate is None else candidate.cases

    def results(self, plan: Plan) -> Results | None:
        """All its dispersed cases; None where they have not flown."""
        candidate = None if self.flown is None else self.flown.get(plan)
        return None if candidate is None or not candidate.cases.decided else candidate.results

    def meets(self, plan: Plan) -> bool | None:
        """Whether a plan meets the requirement, in enough dispersed cases too where they decide."""
        met = plan.meets_requirement
        return bool(self.shares[plan].met) if met and plan in self.shares else met

    @property
    def recommended(self) -> Plan | None:
        """The plan to fly; None where no scheme is feasible."""
        return self.recommendation.plan

    @cached_property
    def with_disturbances(self) -> Plan | None:
        """What would be recommended of the same schemes if they planned with the disturbances, where they did not.

        None where that is the case already. A scheme that is slow is planned only where no other one complies.
        """
        chosen, body = self.recommended, self.spacecraft
        if chosen is None or not body.disturbances or chosen.options.with_disturbances:
            return None
        others: tuple[Plan, ...] = ()
        try:
            for slow in (False, True):
                for one in self.plans:
                    if one.scheme in catalogue.SCHEMES and catalogue.SCHEMES[one.scheme].slow == slow:
                        aware = replace(one.options, with_disturbances=True)
                        others = (*others, attempt(body, one.scheme, aware))
                best = replace(self, plans=others, flown=None).recommended
                if best is not None and best.standing is Standing.COMPLIES:
                    break
        except NutdampError:
            return None
        return best

    @property
    def failed(self) -> tuple[Plan, ...]:
        """Those whose scheme has a bug."""
        return tuple(one for one in self.plans if one.failure is not None)


def usual(spacecraft: Spacecraft) -> tuple[str, ...]:
    """The schemes to compare where none is named: the classic ones and optimal, with a target those that can point.

    Those that can set the spin are among them where it has to change, and `none` where no pulse may be needed.
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

    With dispersions each plan flies ``samples`` cases (default `dispersion.SAMPLES`, 0: none), as many of them as it
    takes to know whether enough comply; where nothing is required, and no number is given, none. ``timed``: pulses may
    be timed one by one though the file has commands. Raises NutdampError, such as BadRequest, and KeyError for a name
    not in `schemes.NAMES`.
    """
    unknown = set(names) - set(catalogue.NAMES)
    if unknown:
        raise KeyError(*sorted(unknown))
    with work.budget("the comparison", work.COMMAND):
        plans = tuple(attempt(spacecraft, name, options) for name in names or usual(spacecraft))
    return compare_plans(plans, named=bool(names), samples=samples, timed=timed)


def compare_plans(
    plans: Sequence[Plan], *, named: bool = True, samples: int | None = None, timed: bool = False
) -> Comparison:
    """The comparison of plans of one spacecraft, as the schedule of a file, in the dispersed cases of `compare`."""
    spacecraft = plans[0].spacecraft
    nominal = Comparison(spacecraft, tuple(plans), named=named, timed=timed)
    wanted = requirements.judged(spacecraft) if samples is None else samples > 0
    if spacecraft.dispersions is None or not wanted:
        return nominal
    return replace(nominal, flown=_dispersed(nominal, samples))


def _dispersed(compared: Comparison, samples: int | None) -> dict[Plan, Candidate]:
    """The feasible plans in dispersed cases."""
    from nutdamp.montecarlo.study import SAMPLES
    from nutdamp.planning.screening import fly_compared

    feasible = [one for one in compared.plans if one.feasible]
    count = SAMPLES if samples is None else samples
    with work.budget("the dispersed cases", work.CASES * max(1.0, count / SAMPLES)):
        return fly_compared(feasible, count, lambda shares: recommend(compared.eligible, shares).plan)


def attempt(spacecraft: Spacecraft, scheme: str, options: planner.Choice) -> Plan:
    """The plan of a scheme, or one that carries the exception which nobody expected."""
    try:
        made = plan(spacecraft, scheme, options)
        # Judged here, where a failure is that of this scheme alone, and not when the first figure is shown.
        _ = made.residual, made.delta_v, made.left_if_symmetric
    except NutdampError:
        raise
    except Exception as failure:
        return Plan(spacecraft, scheme, None, f"{BUG}: {type(failure).__name__}", failure=failure)
    return made


@dataclass(frozen=True, slots=True)
class Line:
    """A part of the requirement: its bound, and what is left with ``nominal`` values (rad, rad/s).

    ``dispersed``: what the share of cases required does not exceed, None where that is not known. ``met``: whether it
    is kept, None where the cases do not say.
    """

    bound: Bound
    nominal: float
    dispersed: float | None
    met: bool | None

    @property
    def margin(self) -> float:
        """By how much less is left than may be, rad (rad/s): of the dispersed value, where it is known."""
        return self.bound.most - (self.nominal if self.dispersed is None else self.dispersed)


@dataclass(frozen=True, eq=False)
class Decision:
    """The plan to decide on, the parts of its requirement, and how it fares in dispersed ``cases``, None if not flown.

    ``unknown``: cases were to decide, but they could not be flown, or not all of them within the budget of work.
    ``seen``: the flight of the plan through its real widths as it has come by a certain time, None for that to the end
    of the last pulse.
    """

    plan: Plan
    cases: Cases | None = None
    unknown: bool = False
    seen: Flight | None = None

    @property
    def flight(self) -> Flight:
        """What is judged."""
        return self.plan.flight if self.seen is None else self.seen

    @property
    def lines(self) -> tuple[Line, ...]:
        """The parts that are required, and those for which it is said what counts as damped or reached."""
        return tuple(self._line(one.bound, one.left) for one in self._held)

    @property
    def _held(self) -> tuple[Held, ...]:
        return self.plan.held if self.seen is None else requirements.held(self.plan.spacecraft, left_by(self.seen))

    @cached_property
    def aspects(self) -> tuple[Aspect, ...]:
        """How near the spin axis comes to each direction that is watched, with nominal values."""
        return self.plan.aspects if self.seen is None else end_state.aspects(self.seen, self.seen.until)

    @property
    def strays(self) -> tuple[Aspect, ...]:
        """Those of the `aspects` that break a cone."""
        return tuple(one for one in self.aspects if not one.kept)

    @property
    def damped(self) -> bool:
        """Whether all of `lines` is kept with nominal values, what is not required as well."""
        return all(one.met for one in self._held)

    @property
    def nominal(self) -> bool | None:
        """Whether what is required at the end is met with nominal values; None where nothing is."""
        required = [one.met for one in self._held if one.bound.required]
        return all(required) if required else None

    def _line(self, bound: Bound, nominal: float) -> Line:
        kept, cases = nominal <= bound.most, self.cases
        if cases is None:
            return Line(bound, nominal, None, kept)
        dispersed = cases.levels.get(bound.part)
        if not bound.required or cases.met is None:
            return Line(bound, nominal, dispersed, kept if dispersed is None else kept and dispersed <= bound.most)
        alone = len(requirements.required(self.plan.spacecraft)) == 1 and not self.plan.spacecraft.keep
        if cases.met or alone:  # the count of cases and the percentile, which lies between two of them, say the same
            return Line(bound, nominal, dispersed, kept and cases.met)
        return Line(bound, nominal, dispersed, None if dispersed is None else kept and dispersed <= bound.most)

    @property
    def met(self) -> bool | None:
        """Whether the requirement is met, with nominal values and in enough cases; None where nothing is required.

        It is not where the spin axis breaks a cone on the way.
        """
        if self.strays or (self.unknown and self.nominal):
            return False
        return self.nominal if not self.nominal or self.cases is None else self.cases.met

    @property
    def undispersed(self) -> bool:
        """Whether the file says how far its values may be off, and no such cases were flown."""
        return self.cases is None and not self.unknown and self.plan.spacecraft.dispersions is not None

    @property
    def final(self) -> Final:
        """Where spin axis and H end, and the spin."""
        return self.flight.final


def decide(compared: Comparison) -> Decision | None:
    """The decision on the recommended plan, by its dispersed cases where they were flown; None where there is none."""
    plan = compared.recommended
    if plan is None:
        return None
    cases, share = compared.cases(plan), compared.shares.get(plan)
    undecided = share is not None and share.met is None
    return Decision(plan, None if undecided else cases, undecided)


@dataclass(frozen=True, eq=False)
class Simulation:
    """A ``plan`` propagated to ``until`` s; ``real``: through real widths is what is shown, else the impulse sum (17).

    Its track has ``samples`` rows.
    """

    plan: Plan
    until: float
    real: bool
    samples: int

    @cached_property
    def _both(self) -> tuple[Flight, Flight]:
        body, pulses = self.plan.spacecraft, self.plan.pulses
        return propagation.by_impulses(body, pulses, self.until), propagation.flown(body, pulses, self.until)

    @cached_property
    def impulses(self) -> Flight:
        """The flight by the impulse sum (17) as it has come by ``until``."""
        return seen_at(self._both[0], self.until)

    @cached_property
    def flown(self) -> Flight:
        """The flight through the real widths as it has come by ``until``."""
        return seen_at(self._both[1], self.until)

    @cached_property
    def shown(self) -> Flight:
        """Whichever of these is shown."""
        return replace(self.flown if self.real else self.impulses, scheme=self.plan.scheme)

    @cached_property
    def decision(self) -> Decision:
        """How the flight through the real widths meets the requirement."""
        return Decision(self.plan, seen=self.flown)

    @cached_property
    def extremes(self) -> Extremes:
        """Of the axis track."""
        return extremes(self.pieces())

    def pieces(self) -> Iterator[Track]:
        """The track of the flight shown, in pieces."""
        return self._both[self.real].pieces(self.samples, self.until)

    def track(self, samples: int, until: float) -> Track:
        """Another track of it, to another end in s."""
        return self._both[self.real].sampled(samples, until)


TELLING = math.radians(1e-6)
"""Nutation angle in rad from which what is left is worth a remark."""


CUT = "the search ended at its limit of work"


def remarks(plan: Plan, *, cones: bool = True) -> tuple[str, ...]:
    """All of them, what the scheme says first; without ``cones`` where those that are broken are named elsewhere."""
    notes = plan.pulses.notes
    if plan.cut:
        notes = (*notes, f"{CUT}: this is the best schedule found so far")
    if plan.flown is None or not len(plan.pulses):
        return notes
    return (
        *notes,
        *_bounds(plan),
        *_remainder(plan),
        *_asymmetry(plan),
        *_given_length(plan),
        *(_cones(plan) if cones else ()),
    )


def _cones(plan: Plan) -> tuple[str, ...]:
    """Cones that a plan without a target does not keep: it is not its task to."""
    return tuple(f"warning: {strays(one)}" for one in plan.aspects if not one.kept)


def infeasibility(plan: Plan) -> str:
    """Why there is no schedule; empty where there is one."""
    why = _infeasibility(plan)
    return f"{why}; {CUT}" if why and plan.cut else why


def _infeasibility(plan: Plan) -> str:
    if plan.breach is not None:
        return f"the only schedule found breaks a limit: {_broken(plan.breach)}"
    if plan.astray is not None and math.isinf(plan.astray.least_at):
        return strays(plan.astray)
    if plan.astray is not None:
        return f"{strays(plan.astray)}; no way round it was found within the limits"
    if plan.worse is not None:
        return f"the best schedule found would leave {math.degrees(plan.worse):.3g}° of nutation{_by_itself(plan)}"
    return plan.refusal or ""


def _by_itself(plan: Plan) -> str:
    decayed = requirements.decayed(plan.spacecraft, plan.worse_at)
    if decayed >= plan.spacecraft.nutation:
        return ""
    return f" at {plan.worse_at:.4g} s; without a pulse it decays to {math.degrees(decayed):.3g}° by then"


def strays(found: Aspect) -> str:
    """How the spin axis breaks a cone."""
    keep = found.keep
    angle, at, bound = (
        (found.least, found.least_at, f"min = {math.degrees(keep.least):.6g}°")
        if found.too_near
        else (found.largest, found.largest_at, f"max = {math.degrees(keep.most):.6g}°")
    )
    seen = f"{math.degrees(angle) if angle > NEGLIGIBLE else 0.0:.4g}°"
    if math.isinf(at):
        return f"the target is {seen} from {keep.name} ({bound})"
    return f"the spin axis comes to {seen} from {keep.name} at {at:.4g} s ({bound})"


def said(plan: Plan) -> tuple[str, ...]:
    """Why there is no schedule, or the `remarks` on it."""
    return remarks(plan) if plan.feasible else (infeasibility(plan),)


def broken_limits(spacecraft: Spacecraft, made: Schedule) -> list[str]:
    """What a schedule does that limits or on-times forbid, a sentence each; empty where it keeps them all.

    Each limit is named once, with the first pulse that breaks it and the number of others that do.
    """
    found: dict[tuple[Limit, tuple[float, float] | None], list[Breach]] = {}
    for breach in breaches(spacecraft, made):
        found.setdefault((breach.limit, breach.window), []).append(breach)
    return [_broken(first) + _likewise(len(others)) for first, *others in found.values()]


def _likewise(others: int) -> str:
    return f"; likewise {others} more pulse{'s' * (others > 1)}" if others else ""


def _broken(breach: Breach) -> str:
    """The pulse that breaks a limit, and how."""
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


def _bounds(plan: Plan) -> Iterator[str]:
    """How much cheaper another schedule could be."""
    bounds = plan.pulses.bounds
    if bounds is None or (bounds.unit == "kg" and plan.pulses.propellant is None):
        return
    spent = plan.pulses.cost_in(bounds.unit)
    scale, unit = (1e3, "g") if bounds.unit == "kg" else (1.0, "N m s")
    parts = [f"{scale * spent:.4g} {unit}"]
    # Where the nutation damps itself, waiting makes any cost small: the least of ideal pulses says nothing.
    if bounds.first_order is not None and bounds.first_order > 0.0 and plan.spacecraft.growth >= 0.0:
        gap = 100.0 * (spent / bounds.first_order - 1.0)
        rest = plan.flight.residual.nutation > TELLING
        holds = "that leaves no nutation" if rest else "that holds for small angles"
        beside = f"gap {max(gap, 0.0):.2g} %" if gap > -1e-6 else f"{-gap:.2g} % more: {holds}"
        parts.append(
            f"first-order least within {bounds.within:.4g} s {scale * bounds.first_order:.4g} {unit} ({beside})"
        )
    if bounds.rigorous is not None and bounds.rigorous > 0.0:
        least = f"{down(scale * bounds.rigorous):.4g} {unit}"
        parts.append(f"no schedule of the channels that leaves as little takes less than {least}")
    if bounds.keeping is not None:
        parts.append(f"keeping H would take {scale * bounds.keeping:.4g} {unit} by small angles")
    if len(parts) > 1:
        yield "; ".join(parts)


def _remainder(plan: Plan) -> Iterator[str]:
    """Why nutation is left."""
    left = plan.flight.residual.nutation
    if left < TELLING or plan.options.uncorrected:
        return
    why = obstacle(plan)
    if plan.spacecraft.goal.spin is not None and plan.meets_requirement:
        why = "the requirement allows it, where the spin is to change"
    yield f"{_degrees(left)} of nutation remain: {why}"


def obstacle(plan: Plan) -> str:
    """What keeps a plan from leaving less nutation, as a clause."""
    found = plan.hindrance
    return {
        Obstacle.UNPLANNED_DISTURBANCES: "the plan was made without the disturbances (--with-disturbances)",
        Obstacle.STEADY_TILT: f"the disturbances leave a steady tilt of {_degrees(found.steady_tilt)}",
        Obstacle.MAX_PULSES: f"limits.max_pulses = {plan.spacecraft.limits.max_pulses} allows no more pulses",
        Obstacle.RESOLUTION: f"rounding to limits.tick can leave up to {_degrees(found.rounding)}",
        Obstacle.LIMITS: f"{plan.scheme} {_limited(found)}",
        Obstacle.SCHEME: f"with these channels {plan.scheme} removes no more",
    }[found.obstacle]


def _limited(found: Hindrance) -> str:
    """By which limits a schedule is limited, and by which it may be."""
    certain = f"is limited by {' and '.join(found.binding)}" if found.binding else ""
    possible = f"may be limited by {' and '.join(found.suspected)}" if found.suspected else ""
    return ", and ".join(text for text in (certain, possible) if text)


def _asymmetry(plan: Plan) -> Iterator[str]:
    """What the same pulses would leave if I1 and I2 were their mean."""
    without, inertia = plan.left_if_symmetric, plan.spacecraft.inertia
    if without is None:
        return
    first, second, _ = inertia.moments
    left = plan.flight.residual.nutation
    yield (
        f"I1 ≠ I2 by {100 * abs(first - second) / inertia.A:.3g} % changes what these pulses leave by "
        f"{_degrees(abs(left - without))}: {_degrees(left)} of nutation, {_degrees(without)} if both were their mean"
    )


def _given_length(plan: Plan) -> Iterator[str]:
    """That equal pulses of a given length do not end exactly, where they were planned on a simpler motion."""
    options, body, left = plan.options, plan.spacecraft, plan.left
    simple = body.inertia.symmetric and not body.disturbances and body.growth == 0.0
    if left is None or simple or not options.equal or options.resizable or options.uncorrected:
        return
    off = float(requirements.missed(body, left.nutation, left.aim))
    if off >= TELLING:
        yield (
            f"the end is off by {_degrees(off)}, nutation or direction of H, whichever is more: the pulses are planned "
            "on the free motion of a symmetric body, and of a fixed length their starts alone cannot make up for all "
            "of the difference; without --on-time their length is corrected too"
        )


def down(value: float) -> float:
    """The largest number of four digits that is not above ``value``: a bound must not be rounded up."""
    if value <= 0.0 or not math.isfinite(value):
        return value
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return math.floor(value / step * (1.0 + 1e-12)) * step


def _degrees(angle: float) -> str:
    """An angle given in rad, as remarks show it; what is below 1e-9 deg is rounding."""
    return f"{math.degrees(angle):.3g}°" if math.degrees(angle) >= 1e-9 else "less than 1e-9°"
