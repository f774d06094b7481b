"""The search for the least-cost schedule: no nutation left, H on its target, the spin as requested.

The program of `linear_program` chooses burns, at first with small angles. The schedule is flown,
the program is aimed anew along that flight at its true angles, and so on until little is left; then
centres and on-times are refined on it. Where that fails, where the horizon is short and where the
schedule is dear, `multistart` looks for a cheaper one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.flight.propagation import Flight
from nutdamp.schemes.catalogue import OptimalOptions, SchemeOptions, TwoPulseOptions
from nutdamp.schemes.optimal import alternatives, multistart
from nutdamp.schemes.optimal.descent import Task
from nutdamp.schemes.optimal.linear_program import Burn, Program, Solution
from nutdamp.schemes.optimal.problem import (
    DEARER,
    GAIN,
    LEFT,
    UNMET,
    Problem,
    as_pulses,
    repaired,
    thinned,
)
from nutdamp.schemes.optimal.refinement import MOST_GROWN, EndEquations, Refinement, along, misses
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import keeps_limits, rounded_off, shortest_on_time
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import DAMPED_ANGLE, SAME_COST, Part
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import TOUCHING, Schedule

# units that may be spent where H may move, so that some are left for schedules that keep it
MOST_LOOSE = 5000.0

CHOICES, AIMS = 3, 8
"""Choices of burns: at small angles, then along the flight before; and flights along which each is
corrected.
"""

LOST, DEAR = 0.5, 0.01
"""Share of what is to do that corrected burns may lack; share above the least cost from which
others are chosen.
"""

FEW, SAVED = (
    2,
    0.001,
)  # pulses for each equation, and share of the cost that so many must save over still fewer
# schedules of other schemes that are corrected to cost less, and exact ones that are put on ticks
WAYS = 3

SHORT, STRONG = 4.0, 0.3
"""Inertial nutation periods up to which very many starts are tried, and within which a strong
channel does all.
"""

PROVED, EQUAL = 0.002, 1e-6
"""Shares above the rigorous bound below which very many starts, and schedules that keep H, are not
tried.
"""

HALVINGS = 3  # shorter horizons that are looked at where there is a schedule already
# share by which the end of the horizon is dearer than its beginning: of equals early burns are
# taken
HASTE = 0.0008

NEAR, NEARLY = 0.05, 0.05
"""End error, rad, below which a flight is refined; share of the tightest bound that is left where
none is exact.
"""

SHARP = 0.02  # relative accuracy of a least time by schedules found
MARGINS = (
    0.002,
    0.03,
    0.1,
    0.25,
    0.5,
    1.0,
    2.0,
    4.0,
    8.0,
)  # shares added to the program's least time, tried in turn
TRIED, LATER = (
    6,
    4.0,
)  # margins tried to name a long enough horizon, and the longest, over the default: that is slow
LATEST, NAMED = (
    64.0,
    5e-3,
)  # multiple of the horizon up to which a feasible one is sought; relative accuracy

ELSEWHERE = (0.85, 0.7, 0.55, 0.4)
MOST_ELSEWHERE = 1500.0
"""Shares of the horizon that are tried in turn where a schedule is dear or was not found, and units
for them.
"""


def schedule(spacecraft: Spacecraft, options: OptimalOptions) -> Schedule:
    """The cheapest schedule found, with its bounds.

    Raises Infeasible where the program has no solution, naming the limit to relax, or where no
    schedule was found.
    """
    if spacecraft.growth < 0.0:  # once a millionth of the nutation is left, waiting costs ever less
        faded = spacecraft.limits.earliest - MOST_GROWN / spacecraft.growth
        spacecraft = with_limits(spacecraft, horizon=min(spacecraft.horizon, faded))
    search = _LeastCostSearch(spacecraft, options)
    every = list(alternatives.spin_changes(search))
    searched = None
    if not every or options.least != "pulses":
        try:
            ways = {"time": search.soonest, "pulses": search.fewest}
            searched = ways.get(options.least, search.schedule)()
            every = [searched, *every]
        except Infeasible:
            if not every:
                raise
    best = search.preferred(every)
    return best if best is searched else search.with_bounds(best)


class _FlownSchedule(NamedTuple):
    """A schedule, with its end error, rad (0: as good as none), and its cost."""

    left: float
    price: float
    schedule: Schedule


class _LeastCostSearch(Problem):
    """The search for the cheapest schedule; ``nearest`` are all schedules that it has corrected."""

    def __init__(self, spacecraft: Spacecraft, options: OptimalOptions) -> None:
        super().__init__(spacecraft, options)
        self.nearest: list[_FlownSchedule] = []

    def soonest(self) -> Schedule:
        """The schedule that ends first: of one channel after another, or another one that ends
        before it.
        """
        early = alternatives.earliest(self)
        if early is None:
            return self.sooner().schedule()
        begin = self.spacecraft.limits.earliest
        limited = self.within(early.end)
        if early.end - begin <= (1.0 + SHARP) * (self.least_horizon(begin, early.end) - begin):
            return self.with_bounds(early)
        search = _LeastCostSearch(limited, self.options).sooner()
        other = (
            alternatives.within(search, early.end)
            if search.spacecraft.horizon == early.end
            else None
        )
        if other is not None:  # no program leads to a schedule that ends before
            return search.with_bounds(self.preferred([early, other]))
        try:
            return self.preferred([early, search.schedule()])
        except Infeasible:
            return self.with_bounds(early)

    def fewest(self) -> Schedule:
        """The schedule of fewest pulses: one or two by the schemes that look for them, else as the
        program thins.
        """
        from nutdamp.schemes import one_pulse, two_pulse

        spacecraft = self.spacecraft
        schedule = Schedule()
        if spacecraft.torquer is None and spacecraft.goal.spin is None:
            with suppress(Infeasible):
                if self.options.free_axis:
                    schedule = one_pulse.schedule(spacecraft, SchemeOptions())
                else:
                    schedule = two_pulse.schedule(spacecraft, TwoPulseOptions())
        good = (
            schedule.pulses
            and keeps_limits(spacecraft, schedule)
            and self.left(self.flown(schedule)) <= LEFT
        )
        return self.with_bounds(schedule) if good else self.schedule()

    def sooner(self) -> _LeastCostSearch:
        """The same search with the shortest horizon in which a schedule is found."""
        begin, horizon = self.spacecraft.limits.earliest, self.spacecraft.horizon
        if not self.feasible(horizon):
            return self
        span = self.least_horizon(begin, horizon) - begin
        low = begin + span
        later = (begin + span * (1.0 + margin) for margin in MARGINS)
        # Small angles let channels fire at once, the schedule does not.
        for high in (*(end for end in later if end < horizon), horizon):
            if self.has_schedule(high):
                break
            low = high
        else:
            return self  # shorter ones are looked at on the way to a schedule
        return _LeastCostSearch(
            self.within(self.least_horizon(low, high, SHARP, self.has_schedule)), self.options
        )

    def preferred(self, schedules: Sequence[Schedule]) -> Schedule:
        """The schedule with least of what is to be saved; of those within `SAME_COST` fewest
        pulses, earliest end.
        """
        saved: dict[str, Callable[[Schedule], float]] = {
            "time": lambda schedule: schedule.end,
            "pulses": len,
        }
        spent = saved.get(self.options.least, self.price)
        least = min(map(spent, schedules))
        equal = [schedule for schedule in schedules if spent(schedule) <= least * (1.0 + SAME_COST)]
        return min(equal, key=lambda schedule: (len(schedule), schedule.end))

    def has_schedule(self, horizon: float) -> bool:
        """True where a schedule is found with this very ``horizon``, s."""
        search = _LeastCostSearch(self.within(horizon), self.options)
        least = search.program().solve()
        return least.unmet <= UNMET and search.settled(least.cost) is not None

    def cured(self) -> str:
        """Reason for a program without solution, and its cure: each that is named was tried, or
        says that not.
        """
        spacecraft, goal, horizon = self.spacecraft, self.spacecraft.goal, self.spacecraft.horizon
        free = replace(self.options, free_axis=True, shift=None)
        bound = self.equations.shift and goal.axis is None and goal.spin is None
        freed = (
            bound
            and not work.exhausted()
            and _LeastCostSearch(spacecraft, free).has_schedule(horizon)
        )
        left = self.program(spacecraft, EndEquations(shift=False)).solve().unmet
        if left > UNMET:
            names = ", ".join(channel.name for channel in self.channels)
            failing = (
                f"the channels ({names}) cannot take out the nutation, "
                f"{100.0 * min(left, 1.0):.3g} % of it stays"
            )
        else:
            failing = (
                "H cannot be kept where it is"
                if goal.axis is None
                else "H cannot be brought to the target"
            )
            without_spin = EndEquations(shift=self.equations.shift)
            if (
                self.equations.spin
                and self.program(spacecraft, without_spin).solve().unmet <= UNMET
            ):
                failing = "the spin cannot be brought to the rate of the goal"
            if spacecraft.transverse_rate > 0.0:
                failing = f"the nutation can be taken out, but {failing}"
        return f"within {horizon:.4g} s {failing}; {self.relaxed()}{', or use --free-axis' * freed}"

    def relaxed(self) -> str:
        """The limit that has to be relaxed, and how far."""
        spacecraft = self.spacecraft
        horizon = later = spacecraft.horizon
        while later < LATEST * horizon:
            if work.exhausted():
                return f"horizons of more than {later:.4g} s were not tried"
            later *= 2.0
            if self.feasible(later):
                needed = self.least_horizon(0.5 * later, later, NAMED)
                usual = with_limits(spacecraft, horizon=None).horizon
                for margin in MARGINS[:TRIED] if needed <= LATER * usual else ():
                    end = float(f"{needed * (1.0 + margin):.4g}")
                    if not work.exhausted() and self.has_schedule(end):
                        return f"limits.horizon = {end:.4g} s is long enough"
                return (
                    f"set limits.horizon to at least {needed:.4g} s ({needed - horizon:.3g} s "
                    "more; by small angles, "
                    f"without other limits)"
                )
        if spacecraft.limits.blackout:
            free = with_limits(spacecraft, blackout=())
            if self.program(free).solve().unmet <= UNMET:
                return "shorten the blackout windows (without any it can be done)"
        return (
            f"not even {LATEST:g} times the horizon helps: channels of other directions or more "
            "torque are needed"
        )

    def schedule(self) -> Schedule:
        """The cheapest schedule found: over the whole horizon, or over less where there the search
        does not settle.
        """
        first = self.program().solve()
        if other := self.without_overtaxed(first):
            return self.with_bounds(other.schedule(), first)
        # Where H may end elsewhere one that keeps it, or reaches the target, will do too: some work
        # is left for it.
        looser = self.options.free_axis or self.options.shift is not None
        with work.budget("a schedule as asked", MOST_LOOSE if looser else math.inf):
            best = self.whole_or_shorter(first)
        if self.dear(best, first.cost, DEAR):
            best = self.cheaper(
                best, self.cheapened(alternatives.within(self, self.spacecraft.horizon))
            )
        if looser and not work.exhausted() and not self.proved(best, EQUAL):
            still = self.keeping(best)
            best = (
                still if self.astray(best) and not self.astray(still) else self.cheaper(best, still)
            )
        if (
            best is None and first.unmet <= UNMET
        ):  # channels that stand still in space may leave a little
            most = min(
                bound.limit
                for bound in requirements.bounds(self.spacecraft)
                if bound.part is not Part.SPIN
            )
            there = [each for each in self.nearest if each.left <= NEARLY * most]
            best = min(there, key=lambda each: each.price).schedule if there else None
        if best is None:
            raise Infeasible(self.cured() if UNMET < first.unmet < math.inf else self.not_found())
        return self.with_bounds(
            alternatives.hastened(self, best, first, self.within_shorter), first
        )

    def keeping(self, best: Schedule | None) -> Schedule | None:
        """The cheapest schedule found that keeps H, or reaches the target; None where it would not
        replace the best.
        """
        kept = _LeastCostSearch(self.spacecraft, replace(self.options, free_axis=False, shift=None))
        first = kept.program().solve()
        if best is not None and not self.astray(best):  # to keep H takes no less time
            dear = first.unmet <= UNMET and first.cost > self.price(best) * (1.0 + SAVED)
            if dear or self.options.least == "time":
                return None
        return kept.whole_or_shorter(first)

    def without_overtaxed(self, solution: Solution) -> _LeastCostSearch | None:
        """The search without channels that need more of their longest pulses than there are moments
        for, if any do.

        Raises Infeasible where there are no others.
        """
        needed: dict[str, float] = {}
        for burn in solution.burns:
            name = burn.channel.name
            needed[name] = needed.get(name, 0.0) + burn.on_time / burn.channel.max_on_time
        moments = len(self.program().centres)
        overtaxed = {name: count for name, count in needed.items() if count > moments}
        if not overtaxed:
            return None
        others = tuple(
            channel for channel in self.spacecraft.channels if channel.name not in overtaxed
        )
        try:
            return _LeastCostSearch(replace(self.spacecraft, channels=others), self.options)
        except Infeasible:
            # Of opposite channels one program asks this one and another one that one for the same:
            # their sum is told.
            longest = max(
                channel.max_on_time for channel in self.channels if channel.name in overtaxed
            )
            count = sum(overtaxed.values())
            raise Infeasible(
                f"the channels would have to fire {count:.1g} pulses, "
                f"none longer than {longest:.3g} s (max_on_time)"
            ) from None

    def astray(self, schedule: Schedule | None) -> bool:
        """True where there is no schedule, or one that, rounded to ticks, shifts H by more than it
        may.
        """
        most = math.inf if self.options.shift is None else self.options.shift
        return schedule is None or self.flown(schedule).residual.axis_error > most + DAMPED_ANGLE

    def whole_or_shorter(self, first: Solution) -> Schedule | None:
        """The cheapest found over the whole horizon; where there is none, or a dear one, over less
        of it too.
        """
        best = self.cheapest(first)
        begin = self.spacecraft.limits.earliest
        horizon = self.spacecraft.horizon
        with work.budget("other ends", MOST_ELSEWHERE):
            for share in ELSEWHERE if first.unmet <= UNMET else ():
                sooner = begin + share * (horizon - begin)
                if work.exhausted() or not self.dear(best, first.cost) or not self.feasible(sooner):
                    break
                best = self.cheaper(best, self.within_shorter(sooner))
        return best

    def within_shorter(self, horizon: float) -> Schedule | None:
        """The cheapest schedule found within ``horizon`` s."""
        shorter = _LeastCostSearch(self.within(horizon), self.options)
        return shorter.cheapest(shorter.program().solve())

    def cheapest(self, first: Solution) -> Schedule | None:
        """The cheapest schedule found, where the program's ``first`` solution is this."""
        # Infinite where the solver gave up: then there may be solutions all the same.
        misled = UNMET < first.unmet < math.inf and self.spacecraft.inertia.symmetric
        best = None if misled else self.programmed(first)
        if not work.exhausted() and self.doubtful(best, first):
            return self.cheaper(best, self.descended(best))
        best = self.cheapened(best)
        return best if best is None else self.fuller(best, first)

    def fuller(self, schedule: Schedule, first: Solution) -> Schedule:
        """The ``schedule``, or one of up to `FEW` pulses for each equation where that, flown, saves
        `SAVED` of it.
        """
        few = FEW * len(self.equations.chosen)
        if (
            len(schedule) >= few
            or self.options.least == "pulses"
            or not self.dear(schedule, first.cost, SAVED)
        ):
            return schedule
        program = self.program()
        program.haste = HASTE
        longest = sorted(program.solve().burns, key=lambda burn: -burn.impulse)[:few]
        if len(longest) <= len(schedule) or work.exhausted():
            return schedule
        more = self.cheapened(
            self.best(self.corrected(program, program.solve(program.about(longest)), first.cost))
        )
        return (
            more if more is not None and self.dear(schedule, self.price(more), SAVED) else schedule
        )

    def cheapened(self, schedule: Schedule | None) -> Schedule | None:
        """The schedule after some steps down on the true motion, where that is known in closed form
        between pulses.
        """
        ticks = self.spacecraft.limits.tick is not None
        if schedule is None or not len(schedule) or not self.closed or ticks or work.exhausted():
            return schedule
        other = multistart.cheapened(self.task(), schedule)
        if (
            other is None
            or not keeps_limits(self.spacecraft, other.pulses)
            or self.left(self.flown(other)) > LEFT
        ):
            return schedule
        return (
            schedule
            if self.hurried(other) and not self.hurried(schedule)
            else self.cheaper(schedule, other)
        )

    def hurried(self, schedule: Schedule) -> bool:
        """True where a channel is on again before it was off for its shortest on-time: valves take
        their time.
        """
        return any(
            after.start - before.end < channel.min_on_time - TOUCHING
            for channel in self.channels
            for before, after in itertools.pairwise(
                pulse for pulse in schedule if pulse.channel == channel.name
            )
        )

    def programmed(self, first: Solution) -> Schedule | None:
        """The cheapest schedule that the linear program leads to,
        over the whole horizon or less.
        """
        best = self.settled(first.cost)
        horizon = self.spacecraft.horizon
        shortest = max(shortest_on_time(self.spacecraft, channel) for channel in self.channels)
        least = self.spacecraft.limits.earliest + max(self.spacecraft.inertial_period, shortest)
        halvings = 0
        while (
            not work.exhausted()
            and self.dear(best, first.cost)
            and (horizon := 0.5 * horizon) > least
        ):
            halvings += 1
            if best is not None and halvings > HALVINGS:
                break
            shorter = _LeastCostSearch(self.within(horizon), self.options)
            if not shorter.feasible(horizon):
                break
            best = self.cheaper(best, shorter.settled(first.cost))
        # With three moments small angles mislead sooner, and no other plan is to be better.
        share = DEARER if self.spacecraft.inertia.symmetric else 0.5 * DEAR
        if self.dear(best, first.cost, share) and not work.exhausted():
            best = self.cheaper(best, self.others(first.cost))
        return best

    def doubtful(self, schedule: Schedule | None, first: Solution) -> bool:
        """True where a schedule may not be the cheapest, so that very many starts are worth their
        time.
        """
        spacecraft = self.spacecraft
        short = (
            spacecraft.horizon - spacecraft.limits.earliest <= SHORT * spacecraft.inertial_period
        )
        strong = float(np.min(self.task().unit)) <= STRONG * spacecraft.inertial_period
        if UNMET < first.unmet < math.inf:  # at large angles H may be brought there all the same
            return short
        if schedule is None:
            return True
        return (
            strong
            and (short or self.dear(schedule, first.cost))
            and not self.proved(schedule, PROVED)
        )

    def proved(self, schedule: Schedule | None, share: float) -> bool:
        """True where a schedule costs at most that ``share`` more than the rigorous bound."""
        proof = None if schedule is None else self.rigorous(schedule)
        return (
            schedule is not None
            and proof is not None
            and self.price(schedule) <= proof * (1.0 + share)
        )

    def task(self) -> Task:
        """Task of the descents."""
        return Task(self.spacecraft, self.equations, self.channels, self.costs, self.off)

    def descended(self, known: Schedule | None) -> Schedule | None:
        """The best schedule to which very many starts, and the one ``known``, descend on the true
        motion.
        """
        every = multistart.schedules(self.task(), () if known is None else (known,))
        if self.spacecraft.limits.tick is not None:
            every = [self.on_ticks(schedule) for schedule in every[:WAYS]]
        flown = [self.candidate(self.flown(schedule), self.worth(schedule)) for schedule in every]
        return self.best(
            [each for each in flown if keeps_limits(self.spacecraft, each.schedule.pulses)]
        )

    def candidate(self, flight: Flight, price: float) -> _FlownSchedule:
        """The schedule of a flight, with its price."""
        left = self.left(flight)
        return _FlownSchedule(0.0 if left <= LEFT else left, price, flight.schedule)

    def on_ticks(self, schedule: Schedule) -> Schedule:
        """An exact schedule on the ticks of the commands."""
        flight = self.flown(schedule)
        missed = misses(flight, self.equations)
        return self.refined(flight, missed[2:4] if self.options.shift is not None else np.zeros(2))

    def refined(self, flight: Flight, off: Vector) -> Schedule:
        """The schedule moved as little as possible to leave H ``off`` (2,) N m s beside its target,
        and no more.
        """
        aside = np.array([0.0, 0.0, *off, 0.0])[self.equations.chosen]
        return Refinement(flight, self.equations, aside, self.flown).refined()

    def settled(self, least: float) -> Schedule | None:
        """The cheapest of the schedules on which the search settles from one choice of burns or
        another.
        """
        program = self.program()
        fewest = self.options.least == "pulses"
        program.haste = HASTE
        candidates: list[_FlownSchedule] = []
        for _ in range(CHOICES):
            if work.exhausted() or (solution := program.solve()).unmet > UNMET:
                break
            candidates += self.corrected(
                program, thinned(program, solution, least, fewest=fewest), least
            )
            if not candidates or any(
                each.left == 0.0 and each.price <= least * (1.0 + DEAR) for each in candidates
            ):
                break
        return self.best(candidates)

    def others(self, least: float) -> Schedule | None:
        """Best plan of other schemes, as it is or corrected to cost less: they know large angles
        and far targets.
        """
        names = {channel.name: channel for channel in self.channels}
        candidates, flights = list[_FlownSchedule](), list[Flight]()
        for schedule in alternatives.by_other_schemes(self.spacecraft, shift=self.equations.shift):
            flights.append(self.flown(Schedule(schedule.pulses)))
            if work.exhausted() or (
                self.left(flights[-1]) <= LEFT and self.price(schedule) <= least * (1.0 + DEAR)
            ):
                break
        for way in sorted(
            flights, key=lambda flight: (self.left(flight) > LEFT, self.price(flight.schedule))
        )[:WAYS]:
            candidates.append(self.candidate(way, self.price(way.schedule)))
            if work.exhausted():
                continue
            program = self.program()
            program.aim(along(way, self.equations, program.width))
            burns = [Burn(names[pulse.channel], pulse.t, pulse.on_time) for pulse in way.schedule]
            candidates += self.corrected(program, program.solve(program.about(burns)), least)
        return self.best(candidates)

    def corrected(self, program: Program, solution: Solution, least: float) -> list[_FlownSchedule]:
        """Schedules from the burns of a solution, corrected along one flight after the other,
        unless they get lost.
        """
        candidates: list[_FlownSchedule] = []
        last = math.inf
        for turn in range(AIMS):
            if solution.unmet > LOST or not solution.burns or work.exhausted():
                break
            kept = repaired(program, solution)
            if kept is None:
                break
            solution = kept
            flown = self.flown(as_pulses(self.spacecraft, kept.burns))
            program.aim(along(flown, self.equations, program.width))
            if self.left(flown) < NEAR:
                schedule = self.refined(flown, solution.off)
                there = self.candidate(self.flown(schedule), self.price(schedule))
                candidates.append(there)
                if there.left == 0.0 and (
                    there.price <= least * (1.0 + DEAR) or there.price > (1.0 - GAIN) * last
                ):
                    break
                last = there.price if there.left == 0.0 else math.inf
            solution = program.solve(program.about(solution.burns, zoom=2.0**turn))
        return candidates

    def best(self, candidates: list[_FlownSchedule]) -> Schedule | None:
        """The cheapest that leaves no more than `DAMPED_ANGLE`, else what leaves least, where that
        is rounding.
        """
        self.nearest += candidates
        # By starts and on-times on ticks, root sum square; zero without ticks.
        there = [
            each
            for each in candidates
            if each.left <= math.hypot(*rounded_off(self.spacecraft, each.schedule))
        ]
        best = min(there, key=lambda each: (max(each.left, DAMPED_ANGLE), each.price), default=None)
        return None if best is None else best.schedule
