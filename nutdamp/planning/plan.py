"""Planning: plan by a scheme, fly the schedule, judge it; see `Plan`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from nutdamp import units
from nutdamp.common import results, work
from nutdamp.common.numerics import cleaned
from nutdamp.common.results import note
from nutdamp.errors import Infeasible
from nutdamp.flight import end_state, propagation
from nutdamp.flight.end_state import left_by, left_on_the_way, seen_at
from nutdamp.flight.propagation import Flight, Residual
from nutdamp.planning.verdict import Cases, JudgedCases, Verdict, judge_schedule, no_plan
from nutdamp.schemes import catalogue, planner
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import Breach, breaches, keeps_limits, misfits
from nutdamp.spacecraft.model import Spacecraft, Vector, required_share
from nutdamp.spacecraft.requirements import Bound, Held, Left
from nutdamp.spacecraft.roles import as_known
from nutdamp.spacecraft.schedule import Schedule

if TYPE_CHECKING:
    import nutdamp
    from nutdamp.flight.cones import Aspect

NO_NUTATION = 1e-12  # rad of nutation below which there is nothing to plan
ROUNDING = 1e-11  # relative decrease of the nutation that may be rounding


class Standing(Enum):
    """Standing of a plan, from the best down."""

    COMPLIES = "complies"  # meets the requirement, and damps the parts that it does not bound
    MEETS = "meets"  # leaves other parts undamped
    MISSES = "misses"  # does not meet it, or, without one, does not damp


class Worse(NamedTuple):
    """``nutation``, rad, that the best schedule would leave ``at`` s: no less than without it."""

    nutation: float
    at: float


@dataclass(frozen=True, eq=False, repr=False)
class Plan(results.Data, results.Rows):
    """``schedule`` of a ``scheme`` for a ``spacecraft``, and its judgement; None where infeasible.

    ``options``: those of the scheme that it was planned with. ``_why`` there is no schedule, in the
    words of `nutdamp.planning.causes`: what the scheme raised, a limit or a cone that is broken, or
    nutation that gets worse. ``_from_file``: read, not planned; ``_cut``: its search ended at its
    budget of `work`.
    """

    spacecraft: Spacecraft
    scheme: str
    schedule: Schedule | None
    _why: Exception | Breach | Aspect | Worse | None = None
    options: catalogue.SchemeOptions = field(default_factory=catalogue.SchemeOptions)
    _from_file: bool = False
    _cut: bool = False

    @property
    def feasible(self) -> bool:
        """True if the schedule keeps every limit and lowers the nutation."""
        return self.schedule is not None

    @property
    def pulses(self) -> Schedule:
        """Schedule; empty where the plan is infeasible."""
        return Schedule() if self.schedule is None else self.schedule

    @property
    def why(self) -> str | None:
        """Reason for the lack of a schedule; None where there is one."""
        return None if self.feasible else str(results.view(self, "reason"))

    @property
    def _failure(self) -> Exception | None:
        """Unexpected exception of the scheme: a bug."""
        why = self._why
        return why if isinstance(why, Exception) and not isinstance(why, Infeasible) else None

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the reader."""
        return tuple(results.view(self, "sentences"))

    @property
    def total_impulse(self) -> float:
        """Σ |J| in N m s."""
        return self.pulses.total_impulse

    @property
    def propellant(self) -> float | None:
        """kg; None where one pulse's is not known."""
        return self.pulses.propellant

    @property
    def end(self) -> float:
        """End of the last pulse, s."""
        return self.pulses.end

    def __len__(self) -> int:
        return len(self.pulses)

    def __bool__(self) -> bool:
        return True  # a plan without pulses is one

    if not TYPE_CHECKING:  # or else a type checker would believe in any name
        _to_numpy, _to_pandas = results.Tabled.to_numpy, results.Tabled.to_pandas

        def __getattr__(self, name: str) -> Any:
            return results.view(self, "former", name)  # or AttributeError

    def fly(
        self, until: float | None = None, *, samples: int = 1000, by_impulses: bool = False
    ) -> Flight:
        """Fly the schedule through its real pulse widths, or by the impulse sum (17), until
        ``until`` s.

        Default: one inertial nutation period after the last pulse. The track has ``samples`` even
        rows, and rows just before and after each pulse. Raises Infeasible without a schedule,
        BadRequest where no track can be made.
        """
        schedule = feasible(self).pulses
        end = units.end_of_flight(
            self.spacecraft.watched_until(self.end) if until is None else until
        )
        count = units.count("samples", samples, 2)
        fly = propagation.by_impulses if by_impulses else propagation.flown
        return replace(
            seen_at(fly(self.spacecraft, schedule, end), end), samples=count, scheme=self.scheme
        )

    def simulate(
        self, until: float | None = None, *, flown: bool = False, samples: int = 1000
    ) -> nutdamp.Simulation:
        """Propagate the plan as `nutdamp.simulate` does."""
        simulated: nutdamp.Simulation = results.view(
            self, "simulated", until, flown=flown, samples=samples
        )
        return simulated

    @property
    def _carried_at(self) -> float:
        """Time, s, from which the spacecraft is carried on by default."""
        return self.end

    def carried(self, at: float | None = None) -> Spacecraft:
        """Spacecraft of the file with the state that the flight has ``at`` a time, s (default
        `carried_at`).

        Raises BadRequest for a spacecraft not read from a file, while a pulse is on, and for a time
        that is none.
        """
        time = self._carried_at if at is None else units.end_of_flight(at)
        spacecraft: Spacecraft = results.view(feasible(self), "carried", time)
        return spacecraft

    def _reaching(self, time: float) -> Flight:
        """Flight through the real pulse widths as far as ``time`` s at least."""
        return replace(propagation.flown(self.spacecraft, self.pulses, time), scheme=self.scheme)

    @cached_property
    def residual(self) -> Residual | None:
        """Residual by the impulse sum (17)."""
        return (
            None
            if self.schedule is None
            else propagation.by_impulses(self.spacecraft, self.schedule).residual
        )

    @cached_property
    def _flight(self) -> Flight:
        """Flight through the real pulse widths; free motion where the plan is infeasible."""
        return propagation.flown(self.spacecraft, self.pulses)

    @property
    def flown(self) -> Residual | None:
        """Residual of the flight through the real pulse widths."""
        return self._flight.residual if self.feasible else None

    @cached_property
    def _disturbed(self) -> Left | None:
        """Residual when the last disturbance has begun or ended, where that is after the last
        pulse.
        """
        last = max(self.spacecraft.edges, default=0.0)
        if not self.feasible or last <= self.end:
            return None
        return left_by(seen_at(self._reaching(last), last))

    @property
    def _left(self) -> Left | None:
        """Flown residual for `requirements`; of nutation and distance the larger one of that and of
        `disturbed`, of spins the one farther from the goal.
        """
        if not self.feasible:
            return None
        left, after = left_on_the_way(self._flight, self._aspects), self._disturbed
        if after is None:
            return left
        nutation, aim = max(left.nutation, after.nutation), max(left.aim, after.aim)
        goal = left.spin if self.spacecraft.goal.spin is None else self.spacecraft.goal.spin
        spin = max(left.spin, after.spin, key=lambda each: abs(each - goal))
        return left._replace(nutation=nutation, aim=aim, spin=spin)

    @cached_property
    def _commandable(self) -> bool:
        """True if the spacecraft can fire it: by command blocks only, or nothing, where it takes
        such.

        Pulses and blocks read from a file have to keep its limits and commands too.
        """
        spacecraft, pulses = self.spacecraft, self.pulses
        if self._from_file and (
            any(misfits(spacecraft, pulses.blocks)) or not keeps_limits(spacecraft, pulses)
        ):
            return False
        return spacecraft.commands is None or bool(pulses.blocks) or not pulses.pulses

    @property
    def _held(self) -> tuple[Held, ...]:
        """Flown residual beside each bound of `requirements`, end and way; empty for an infeasible
        plan.
        """
        return () if self._left is None else requirements.held(self.spacecraft, self._left)

    @property
    def meets_requirement(self) -> bool | None:
        """True if the flown residual keeps the requirement of the file, the spin of the goal, and
        all cones.

        None without these or a schedule; kept cones alone meet nothing. A momentum shift counts
        from a target axis.
        """
        return False if self.feasible and self._kept is False else self._ends_well

    @property
    def _ends_well(self) -> bool | None:
        """Compliance of the flown residual at the end; None where nothing is required."""
        required = [
            line.met for line in self._held if line.bound.required and line.bound.keep is None
        ]
        return all(required) if required else None

    @property
    def _shortfalls(self) -> tuple[Bound, ...]:
        """Bounds at the end that the flown residual breaks."""
        return tuple(line.bound for line in self._held if not line.met and line.bound.keep is None)

    @property
    def _standing(self) -> Standing:
        """Standing at the end, regardless of cones; an infeasible plan misses all."""
        if not self.feasible or self._ends_well is False:
            return Standing.MISSES
        if not self._shortfalls:
            return Standing.COMPLIES
        return Standing.MISSES if self._ends_well is None else Standing.MEETS

    @cached_property
    def verdict(self) -> Verdict:
        """Judgement of the plan: nominal values, and the dispersed cases of its file."""
        judgement: Verdict = results.view(self, "verdict")
        return judgement

    @property
    def _severity(self) -> float:
        """See `requirements.severity`; infinite for an infeasible plan."""
        return (
            math.inf
            if self._left is None
            else float(requirements.severity(self.spacecraft, self._left))
        )

    @property
    def _spin_change(self) -> float | None:
        """ω3 at the end minus at the start, rad/s, flown."""
        before, after = self.spacecraft.spin, self._flight.settled.spin
        return float(cleaned([after - before, before])[0]) if self.feasible else None

    @cached_property
    def _delta_v(self) -> Vector | None:
        """Velocity change in the inertial frame, (3,) m/s; None without mass or where a force is
        not known.
        """
        mass = self.spacecraft.mass
        if not self.feasible or mass is None or any(pulse.force is None for pulse in self.pulses):
            return None
        flown = self._flight
        if self.spacecraft.tank is not None:  # forces accelerate more as the mass falls
            used = 0.0
            pulses = []
            for pulse in flown.schedule:
                taken = pulse.propellant or 0.0
                scale = mass / (mass - used - 0.5 * taken)
                pulses.append(
                    replace(pulse, force=None if pulse.force is None else pulse.force * scale)
                )
                used += taken
            flown = replace(flown, schedule=Schedule(tuple(pulses)))
        return end_state.momentum_gained(flown) / mass

    @cached_property
    def _aspects(self) -> tuple[Aspect, ...]:
        """Extreme angles of the flown spin axis from each watched direction; see
        `cones.aspects`.
        """
        if not self.spacecraft.watched:
            return ()
        from nutdamp.flight.cones import aspects  # a direction to watch

        return aspects(self._flight)

    @property
    def _kept(self) -> bool | None:
        """True if the flown spin axis keeps its cones; None where the file names none."""
        return (
            all(line.met for line in self._held if line.bound.keep is not None)
            if self.spacecraft.keep
            else None
        )


def plan(spacecraft: Spacecraft, scheme: str, options: planner.Choice = None) -> Plan:
    """Plan one scheme and judge it. Raises KeyError for a name not in `schemes.NAMES`."""
    if scheme not in catalogue.NAMES:
        raise KeyError(scheme)
    spun = requirements.reaches_spin(spacecraft)
    if spacecraft.nutation < NO_NUTATION and spacecraft.to_turn < NO_NUTATION and spun:
        return Plan(spacecraft, scheme, Schedule(notes=(note("no-nutation"),)))
    if not spun and scheme in catalogue.PLANNED and scheme not in catalogue.SPINNING:
        able = " and ".join(spinning(spacecraft))
        why = f"cannot set the spin; {able} can, with channels that have a torque about axis 3"
        return Plan(spacecraft, scheme, None, Infeasible(why))
    if spacecraft.goal.axis is not None and scheme in catalogue.PLANNED:
        from nutdamp.flight.cones import at_target  # a target

        forbidden = at_target(spacecraft)
        if forbidden is not None:
            return Plan(spacecraft, scheme, None, forbidden)
    chosen = planner.settled(catalogue.SCHEMES[scheme], options, spacecraft)
    known = as_known(spacecraft, disturbed=chosen.with_disturbances)
    with work.budget(scheme, work.SCHEME) as spent:
        try:
            planned_for = spacecraft if catalogue.SCHEMES[scheme].on_true_body else known
            schedule = planner.schedule(scheme, planned_for, chosen)
            result = judged(spacecraft, scheme, schedule, chosen)
        except Infeasible as reason:
            result = Plan(spacecraft, scheme, None, reason.with_traceback(None))
        turns = catalogue.SCHEMES[scheme].points or catalogue.SCHEMES[scheme].reads_commands
        if spacecraft.keep and turns and not result.feasible:
            from nutdamp.flight.cones import Aspect  # cones
            from nutdamp.schemes import routes

            if isinstance(result._why, Aspect):
                rerouted = routes.schedules(known, scheme, chosen)
                others = (judged(spacecraft, scheme, schedule, chosen) for schedule in rerouted)
                result = next((other for other in others if other.feasible), result)
    return replace(result, options=chosen, _cut=spent.exhausted)


def spinning(spacecraft: Spacecraft) -> tuple[str, ...]:
    """Schemes that can set the spin: by command blocks only where there are commands."""
    commanded = spacecraft.commands is not None
    return tuple(
        scheme
        for scheme in catalogue.SPINNING
        if commanded or not catalogue.SCHEMES[scheme].reads_commands
    )


def alternatives(
    spacecraft: Spacecraft, scheme: str, options: planner.Choice = None
) -> tuple[Plan, ...]:
    """Feasible plans by alternative schedules of the scheme, maybe that of `plan`; raises KeyError
    as it does.
    """
    chosen = planner.settled(catalogue.SCHEMES[scheme], options, spacecraft)
    try:
        alternatives = planner.alternatives(
            scheme, as_known(spacecraft, disturbed=chosen.with_disturbances), chosen
        )
        plans = [judged(spacecraft, scheme, schedule, chosen) for schedule in alternatives]
    except Infeasible:
        return ()
    return tuple(plan for plan in plans if plan.feasible)


def judged(
    spacecraft: Spacecraft, scheme: str, schedule: Schedule, options: catalogue.SchemeOptions
) -> Plan:
    """Plan of a schedule: infeasible where it breaks a limit or does not help. Raises Infeasible on
    flat spin.

    It helps where nutation, distance from the target axis or from the requested spin is less than
    without pulses by the last one.
    """
    if spacecraft.disturbances:  # which the scheme need not have known
        schedule = schedule.without_proof
    flown = Plan(spacecraft, scheme, schedule, options=options)
    left = flown.flown
    breach = next(breaches(spacecraft, schedule), None)
    if breach is not None:
        return Plan(spacecraft, scheme, None, breach)
    if spacecraft.goal.axis is not None and scheme in catalogue.PLANNED:
        from nutdamp.flight.cones import broken  # a target

        astray = broken(spacecraft, flown._flight)
        if astray is not None:
            return Plan(spacecraft, scheme, None, astray)
    if scheme in catalogue.PLANNED and left is not None:
        spin = spacecraft.goal.spin
        least = requirements.decayed(spacecraft, flown.end) * (1.0 - ROUNDING)
        respun = spin is not None and abs(flown._flight.settled.spin - spin) < abs(
            spacecraft.spin - spin
        )
        if not respun and left.nutation >= least and left.axis_error >= spacecraft.to_turn:
            return Plan(spacecraft, scheme, None, Worse(left.nutation, flown.end))
    return flown


def judge(
    plan: Plan,
    cases: Cases | None = None,
    results: JudgedCases | None = None,
    *,
    nominal: bool = False,
    timed: bool = False,
    seen: Flight | None = None,
) -> Verdict:
    """Judgement of a plan by its nominal values and by dispersed ``cases``, of which ``results``
    has all.

    ``nominal``: cases are left out on request; ``timed``: pulses may be commanded one by one;
    ``seen``: the flight to be judged, default that of the plan.
    """
    spacecraft = plan.spacecraft
    if not plan.feasible:
        return no_plan(spacecraft, plan.scheme, plan.why or "")
    flight, observed, held = plan._flight, plan._aspects, plan._held
    if seen is not None:
        from nutdamp.flight.cones import aspects  # free motion, simulated

        flight = seen
        observed = aspects(seen, seen.until)
        held = requirements.held(spacecraft, left_on_the_way(flight, observed))
    return judge_schedule(
        flight,
        observed,
        held,
        cases,
        results,
        scheme=plan.scheme,
        schedule=plan.pulses,
        sendable=plan._commandable or timed,
        nominal=nominal,
    )


def feasible(plan: Plan) -> Plan:
    """A plan with a schedule; raises BadRequest for anything but a `Plan`, Infeasible for one
    without.
    """
    units.instance("plan", plan, Plan, "a Plan, as nutdamp.plan gives it")
    if not plan.feasible:
        raise Infeasible(f"{plan.scheme} is infeasible: {plan.why}")
    return plan


def unflown(plan: Plan) -> Cases:
    """Cases of a plan that have not flown: of all any share may comply."""
    return Cases(0, 0, required_share(plan.spacecraft.requirement), 0.0, final=False)
