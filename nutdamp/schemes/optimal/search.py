"""The search for the least-cost schedule: no nutation left, H on its target, the spin as requested.

The program of `linear_program` chooses burns, at first with small angles. The schedule is flown,
the program is aimed anew along that flight at its true angles, and so on until little is left; then
centres and on-times are refined on it. Where that fails, where the horizon is short and where the
schedule is dear, other attempts follow, see `Search.cheapest`: shorter horizons, the schedules of
other schemes, very many starts.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from nutdamp.common import work
from nutdamp.errors import Infeasible, NotFound
from nutdamp.flight.propagation import Flight
from nutdamp.schemes.catalogue import OptimalOptions
from nutdamp.schemes.optimal import alternatives, multistart, refinement
from nutdamp.schemes.optimal.descent import Task
from nutdamp.schemes.optimal.linear_program import Burn, Program, Solution
from nutdamp.schemes.optimal.problem import LEFT, UNMET, Problem, as_pulses, repaired, thinned
from nutdamp.schemes.optimal.refinement import MOST_GROWN, EndEquations, along, misses
from nutdamp.schemes.sequential import LATEST, why
from nutdamp.spacecraft import requirements
from nutdamp.spacecraft.constraints import bounded_by, keeps_limits, rounded_off, shortest_on_time
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.requirements import DAMPED_ANGLE, SAME_COST, Part
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import TOUCHING, Schedule

# Shares above the cost by small angles from which a schedule is dear enough to look at shorter
# horizons; to try other choices of burns, and firing without a pause; to try more pulses. Most
# schedules of few pulses cost 0.1 % more, those of couples-minisat 1.2 %.
DEARER, DEAR, SAVED = 0.03, 0.01, 0.001

# Share from which every schedule is dear: at large angles those of strong thrusters cost less than
# small angles tell, and 13 % more (a random one) without their descent.
ALWAYS = -1.0

# Units of work where H may move, so that some are left for schedules that keep it.
MOST_LOOSE = 5000.0

# Choices of burns, at small angles and then along the flight before; flights along which each is
# corrected.
CHOICES, AIMS = 3, 8

# Share of what is to do that corrected burns may lack; end error, rad, below which a flight is
# refined.
LOST, NEAR = 0.5, 0.05

# Share of the cost that a further correction must save for another one to follow.
SETTLED = 0.0005

# Pulses for each equation up to which more pulses are tried: couples-minisat costs 1.2 % less.
FEW = 2

# Schedules of other schemes that are corrected to cost less, and exact ones put on ticks.
WAYS = 3

# Shorter horizons that are looked at where there is a schedule already.
HALVINGS = 3

# Inertial nutation periods up to which very many starts are tried, and within which a strong
# channel does all.
SHORT, STRONG = 4.0, 0.3

# Shares above the rigorous bound below which very many starts, and schedules that keep H, are not
# tried.
PROVED, EQUAL = 0.002, 1e-6

# Share by which the end of the horizon seems dearer than its beginning to the program: of equals
# early burns are taken. Less than `SAME_COST`.
HASTE = 0.0008

# Share of the tightest bound that may be left where no schedule is exact.
NEARLY = 0.05


class Search(Problem):
    """The search within one horizon; ``tried`` are all schedules that it has corrected."""

    def __init__(self, spacecraft: Spacecraft, options: OptimalOptions) -> None:
        super().__init__(spacecraft, options)
        self.tried: list[Schedule] = []

    @cached_property
    def first(self) -> Solution:
        """Solution of the program of small angles."""
        return self.program().solve()

    def until(self, horizon: float) -> Search:
        """The same search with another horizon, s."""
        return Search(self.within(horizon), self.options)

    def cheapest(self) -> Schedule | None:
        """The cheapest schedule found; None where there is none.

        The attempts follow each other, each one only where the schedule before costs more than the
        program of small angles by its share.
        """
        symmetric = self.spacecraft.inertia.symmetric
        attempts: list[tuple[float, Callable[[Search, Schedule | None], Schedule | None]]] = [
            (ALWAYS, by_program),
            (DEARER, by_shorter_programs),
            # With three moments small angles mislead sooner. No other plan is to be better: that
            # of two-pulse was, by 1.6 % for despun-comsat. To ask them costs up to half a second.
            (1.5 * DEAR if symmetric else 0.5 * DEAR, by_other_schemes),
            (ALWAYS, by_descent),
            (SAVED, by_more_pulses),
        ]
        # Infinite where the solver gave up, or the work for it was spent.
        if symmetric and UNMET < self.first.unmet < math.inf:
            attempts = attempts[3:]
        best: Schedule | None = None
        for share, attempt in attempts:
            # Other schemes need little: they are asked even where a program of many slots took all
            # the work, as that of weak-doubled does, which one-pulse meets.
            spent = work.exhausted() and attempt is not by_other_schemes
            if not spent and self.dear(best, share):
                best = self.cheaper(best, attempt(self, best))
        return best

    def dear(self, schedule: Schedule | None, share: float) -> bool:
        """True where there is no schedule, or one that costs more by a share than small angles."""
        return schedule is None or self.price(schedule) > self.first.cost * (1.0 + share)

    def proved(self, schedule: Schedule | None, share: float) -> bool:
        """True where a schedule costs at most that ``share`` more than the rigorous bound."""
        return schedule is not None and self.price(schedule) <= (1.0 + share) * (
            self.rigorous(schedule) or 0.0
        )

    def astray(self, schedule: Schedule | None) -> bool:
        """True where there is no schedule, or one that, rounded to ticks, shifts H by more than it
        may.
        """
        allowed = math.inf if self.options.shift is None else self.options.shift
        return schedule is None or self.flown(schedule).residual.axis_error > allowed + DAMPED_ANGLE

    def best(self, schedules: list[Schedule]) -> Schedule | None:
        """The cheapest that leaves no more than `DAMPED_ANGLE`, else what leaves least, where that
        is rounding.
        """
        self.tried += schedules
        # By starts and on-times on ticks, root sum square; zero without ticks.
        exact = [
            each
            for each in schedules
            if self.error(each) <= math.hypot(*rounded_off(self.spacecraft, each))
        ]
        return min(
            exact,
            key=lambda each: (max(self.error(each), DAMPED_ANGLE), self.rank(each)),
            default=None,
        )

    def nearly(self) -> Schedule | None:
        """The cheapest that leaves a little: channels that stand still in space may have to."""
        tightest = min(
            bound.limit
            for bound in requirements.bounds(self.spacecraft)
            if bound.part is not Part.SPIN
        )
        near = [each for each in self.tried if self.error(each) <= NEARLY * tightest]
        return min(near, key=self.rank, default=None)

    def task(self) -> Task:
        """Task of the descents."""
        return Task(self.spacecraft, self.equations, self.channels, self.costs, self.off)

    def refined(self, flight: Flight, off: Vector) -> Schedule:
        """The schedule moved as little as possible to leave H ``off`` (2,) N m s beside its target,
        and no more.
        """
        aside = np.array([0.0, 0.0, *off, 0.0])[self.equations.chosen]
        return refinement.refined(flight, self.equations, aside, self.flown)

    def corrected(self, program: Program, solution: Solution) -> list[Schedule]:
        """Schedules from the burns of a solution, corrected along one flight after the other,
        unless they get lost.
        """
        schedules: list[Schedule] = []
        last = math.inf
        for turn in range(AIMS):
            if solution.unmet > LOST or not solution.burns or work.exhausted():
                break
            commandable = repaired(program, solution)
            if commandable is None:
                break
            flown = self.flown(as_pulses(self.spacecraft, commandable.burns))
            program.aim(along(flown, self.equations, program.width))
            if self.left(flown) < NEAR:
                schedule = self.refined(flown, commandable.off)
                schedules.append(schedule)
                price = math.inf
                if self.error(schedule) == 0.0:
                    price = self.price(schedule)
                    if not self.dear(schedule, DEAR) or price > (1.0 - SETTLED) * last:
                        break
                last = price
            solution = program.solve(program.about(commandable.burns, zoom=2.0**turn))
        return schedules

    def lowered(self, schedule: Schedule | None) -> Schedule | None:
        """The schedule after some steps down on the true motion, where that is known in closed form
        between pulses.
        """
        body = self.spacecraft
        settled = body.disturbances or body.growth or body.limits.tick is not None
        if schedule is None or not len(schedule) or settled or work.exhausted():
            return schedule
        other = multistart.cheapened(self.task(), schedule)
        if (
            other is None
            or not keeps_limits(self.spacecraft, other.pulses)
            or self.left(self.flown(other)) > LEFT
            or (self.hurried(other) and not self.hurried(schedule))
        ):
            return schedule
        return self.cheaper(schedule, other)

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

    def preferred(self, schedules: Sequence[Schedule]) -> Schedule:
        """The schedule with least of what is to be saved; of those within `SAME_COST` fewest
        pulses, earliest end.
        """
        saved: dict[str, Callable[[Schedule], float]] = {
            "time": lambda schedule: schedule.end,
            "pulses": len,
        }
        spent = saved.get(self.options.least, self.price)
        limit = min(map(spent, schedules)) * (1.0 + SAME_COST)
        equal = [schedule for schedule in schedules if spent(schedule) <= limit]
        return min(equal, key=lambda schedule: (len(schedule), schedule.end))


def by_program(search: Search, _: Schedule | None = None) -> Schedule | None:
    """From one choice of burns of the linear program or another."""
    program = search.program()
    program.haste = HASTE
    fewest = search.options.least == "pulses"
    schedules: list[Schedule] = []
    for _choice in range(CHOICES):
        if work.exhausted():
            break
        solution = program.solve()
        if solution.unmet > UNMET:
            break
        burns = thinned(program, solution, search.first.cost, fewest=fewest)
        schedules += search.corrected(program, burns)
        cheap = (not search.dear(each, DEAR) and search.error(each) == 0.0 for each in schedules)
        if not schedules or any(cheap):
            break
    return search.best(schedules)


def by_shorter_programs(search: Search, best: Schedule | None) -> Schedule | None:
    """From the program of half the horizon, of a quarter, and so on, down to a nutation period.

    With three moments, where none of these gives a schedule, from three quarters and from five
    eighths likewise: which program leads to one is chance, and one that does not takes 30 ms.
    """
    spacecraft = search.spacecraft
    shortest = max(shortest_on_time(spacecraft, channel) for channel in search.channels)
    least = spacecraft.limits.earliest + max(spacecraft.inertial_period, shortest)
    shares = (0.5,) if spacecraft.inertia.symmetric else (0.5, 0.75, 0.625)
    for share in shares:
        for halvings in itertools.count():
            horizon = share * 0.5**halvings * spacecraft.horizon
            looked = best is not None and halvings >= HALVINGS
            if horizon <= least or looked or not search.dear(best, DEARER) or work.exhausted():
                break
            shorter = search.until(horizon)
            if shorter.first.unmet > UNMET:
                break
            best = search.cheaper(best, by_program(shorter))
        if best is not None:
            break
    return best


def by_other_schemes(search: Search, _: Schedule | None) -> Schedule | None:
    """Plan of another scheme, as it is or corrected to cost less: they know large angles and far
    targets.
    """
    flights: list[Flight] = []
    for schedule in alternatives.by_other_schemes(search.spacecraft, shift=search.equations.shift):
        flights.append(search.flown(Schedule(schedule.pulses)))
        exact = search.left(flights[-1]) <= LEFT
        if work.exhausted() or (exact and not search.dear(schedule, DEAR)):
            break
    names = {channel.name: channel for channel in search.channels}
    schedules: list[Schedule] = []
    flights.sort(key=lambda flight: (search.left(flight) > LEFT, search.price(flight.schedule)))
    for flight in flights[:WAYS]:
        schedules.append(flight.schedule)
        if work.exhausted():
            continue
        program = search.program()
        program.aim(along(flight, search.equations, program.width))
        burns = [Burn(names[pulse.channel], pulse.t, pulse.on_time) for pulse in flight.schedule]
        schedules += search.corrected(program, program.solve(program.about(burns)))
    return search.best(schedules)


def by_descent(search: Search, best: Schedule | None) -> Schedule | None:
    """Down on the true motion from the best, and from very many starts where it may not be the
    cheapest.
    """
    task = search.task()
    spacecraft = search.spacecraft
    period = spacecraft.inertial_period
    short = spacecraft.horizon - spacecraft.limits.earliest <= SHORT * period
    strong = float(np.min(task.unit)) <= STRONG * period
    if UNMET < search.first.unmet < math.inf:  # at large angles H may be brought there all the same
        doubtful = short
    else:
        hopeful = strong and (short or search.dear(best, DEARER))
        doubtful = best is None or (hopeful and not search.proved(best, PROVED))
    if not doubtful:
        return search.lowered(best)
    schedules = multistart.schedules(task, () if best is None else (best,))
    if spacecraft.limits.tick is not None:
        loose = search.options.shift is not None
        exact = [search.flown(each) for each in schedules[:WAYS]]
        offs = (misses(each, search.equations)[2:4] if loose else np.zeros(2) for each in exact)
        schedules = list(map(search.refined, exact, offs))
    return search.best([each for each in schedules if keeps_limits(spacecraft, each.pulses)])


def by_more_pulses(search: Search, best: Schedule | None) -> Schedule | None:
    """From the longest burns of the program, `FEW` for each equation, where the best has fewer."""
    few = FEW * len(search.equations.chosen)
    if best is None or len(best) >= few or search.options.least == "pulses":
        return None
    program = search.program()
    program.haste = HASTE
    longest = sorted(program.solve().burns, key=lambda burn: -burn.impulse)[:few]
    if len(longest) <= len(best) or work.exhausted():
        return None
    corrected = search.corrected(program, program.solve(program.about(longest)))
    more = search.lowered(search.best(corrected))
    saves = more is not None and search.price(best) > search.price(more) * (1.0 + SAVED)
    return more if saves else None


def schedule(spacecraft: Spacecraft, options: OptimalOptions) -> Schedule:
    """The cheapest schedule found, with its bounds.

    Raises Infeasible where the program has no solution, naming the limit to relax, and NotFound
    where no schedule was found.
    """
    if spacecraft.growth < 0.0:  # once a millionth of the nutation is left, waiting costs ever less
        faded = spacecraft.limits.earliest - MOST_GROWN / spacecraft.growth
        spacecraft = with_limits(spacecraft, horizon=min(spacecraft.horizon, faded))
    search = Search(spacecraft, options)
    every = list(alternatives.spin_changes(search))
    if not every or options.least != "pulses":
        find = {"time": soonest, "pulses": fewest}.get(options.least, least_cost)
        try:
            every.insert(0, find(search))
        except Infeasible:
            if not every:
                raise
    best = search.preferred(every)
    return best if best.bounds is not None else search.with_bounds(best)


def least_cost(search: Search) -> Schedule:
    """The cheapest schedule found, or one that ends earlier at the same cost; raises Infeasible."""
    if others := without_overtaxed(search):
        return search.with_bounds(least_cost(others), search.first)
    # Where H may end elsewhere one that keeps it, or reaches the target, will do too: some work is
    # left for it.
    loose = search.options.free_axis or search.options.shift is not None
    with work.budget("a schedule as asked", MOST_LOOSE if loose else math.inf):
        best = search.cheapest()
    if search.dear(best, DEAR):  # one channel after another, without a pause
        continuous = alternatives.within(search, search.spacecraft.horizon)
        best = search.cheaper(best, search.lowered(continuous))
    if loose and not work.exhausted() and not search.proved(best, EQUAL):
        strict = Search(search.spacecraft, replace(search.options, free_axis=False, shift=None))
        astray = search.astray(best)
        # To keep H takes no less time.
        hopeless = search.options.least == "time" or (
            best is not None
            and strict.first.unmet <= UNMET
            and strict.first.cost > search.price(best) * (1.0 + SAVED)
        )
        keeping = strict.cheapest() if astray or not hopeless else None
        better = astray and not search.astray(keeping)
        best = keeping if better else search.cheaper(best, keeping)
    if best is None and search.first.unmet <= UNMET:
        best = search.nearly()
    if best is None:
        raise refusal(search)
    return search.with_bounds(hastened(search, best), search.first)


def without_overtaxed(search: Search) -> Search | None:
    """The search without channels that need more of their longest pulses than there are moments
    for, if any do.

    Raises Infeasible where there are no others.
    """
    needed: dict[str, float] = {}
    for burn in search.first.burns:
        name = burn.channel.name
        needed[name] = needed.get(name, 0.0) + burn.on_time / burn.channel.max_on_time
    moments = len(search.program().centres)
    overtaxed = {name: count for name, count in needed.items() if count > moments}
    if not overtaxed:
        return None
    others = tuple(
        channel for channel in search.spacecraft.channels if channel.name not in overtaxed
    )
    try:
        return Search(replace(search.spacecraft, channels=others), search.options)
    except Infeasible:
        # Of opposite channels one program asks this one and another one that one for the same:
        # their sum is told.
        longest = max(
            channel.max_on_time for channel in search.channels if channel.name in overtaxed
        )
        count = sum(overtaxed.values())
        raise Infeasible(
            f"the channels would have to fire {count:.1g} pulses, "
            f"none longer than {longest:.3g} s (max_on_time)"
        ) from None


# Relative accuracy of a horizon that is named as needed.
NAMED = 5e-3


def refusal(search: Search) -> Infeasible:
    """Reason for no schedule, and the limit without which there is one."""
    spacecraft = search.spacecraft
    most = spacecraft.limits.max_pulses
    undisturbed = spacecraft.growth == 0.0 and not spacecraft.disturbances
    if most is not None and undisturbed and spacecraft.inertia.symmetric:
        # No pulse of a symmetric body takes out more than its impulse across the axis.
        impulse = max(abs(channel.transverse) * channel.max_on_time for channel in search.channels)
        if most * impulse < spacecraft.least_impulse:
            share = 100.0 * most * impulse / spacecraft.least_impulse
            return Infeasible(
                f"limits.max_pulses = {most} is too few: these pulses give at most {share:.4g} "
                f"% of the impulse needed; {math.ceil(spacecraft.least_impulse / impulse)} or "
                "more give all"
            )
    unproved = search.first.unmet <= UNMET or math.isinf(search.first.unmet)

    def attempt(limited: Spacecraft) -> Schedule | None:
        other = Search(limited, search.options)
        return by_program(other)

    cure = why(spacecraft, attempt)
    cures = [cure.text]
    with work.cure("a limit for small angles"):
        horizon = spacecraft.horizon
        while not (unproved or cure.limit == "horizon" or work.exhausted()):
            horizon *= 2.0
            if horizon > LATEST * spacecraft.horizon:
                break
            if search.feasible(horizon):
                needed = search.least_horizon(0.5 * horizon, horizon, NAMED)
                cures.append(f"limits.horizon of {needed:.4g} s or more is needed, at small angles")
                break
        if search.equations.shift and spacecraft.goal.axis is None and not work.exhausted():
            free = Search(spacecraft, replace(search.options, free_axis=True, shift=None))
            if by_program(free) is not None:
                cures.append("with --free-axis a schedule exists")
    nutation = search.program(equations=EndEquations(shift=False)).solve().unmet
    plain = search.program(equations=EndEquations(shift=search.equations.shift))
    failing = "H would shift"
    if spacecraft.goal.axis is not None:
        failing = "H cannot be brought to the target"
    if search.equations.spin and plain.solve().unmet <= UNMET:
        failing = "the spin cannot be brought to the rate of the goal"
    if spacecraft.transverse_rate > 0.0:
        failing = f"the nutation can be removed, but {failing}"
    if nutation > UNMET:
        names = ", ".join(channel.name for channel in search.channels)
        share = 100.0 * min(nutation, 1.0)
        failing = f"the channels ({names}) cannot remove the nutation: {share:.3g} % of it stays"
    reason = f"within {spacecraft.horizon:.4g} s {failing}"
    if unproved:
        reason = (
            f"within {bounded_by(spacecraft)} the search found no schedule for the true "
            "motion; one may still exist"
        )
    if search.first.unmet <= UNMET:
        reason = f"schedules exist at small angles; {reason}"
    text = "; ".join(filter(None, [reason, *cures]))
    return NotFound(text) if unproved else Infeasible(text)


# --- the least of other things than cost


def fewest(search: Search) -> Schedule:
    """The schedule of fewest pulses: one or two by the schemes that look for them, else as the
    program thins.
    """
    planned = alternatives.by_other_schemes(search.spacecraft, shift=search.equations.shift)
    schedule = next(planned, None)
    if schedule is None or search.left(search.flown(schedule)) > LEFT:
        return least_cost(search)
    return search.with_bounds(schedule)


# Relative accuracy of a least time by schedules found.
SHARP = 0.02

# Shares added to the program's least time, tried in turn: small angles let channels fire at once,
# schedules do not.
MARGINS = (0.002, 0.03, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)


def soonest(search: Search) -> Schedule:
    """The schedule that ends first: of one channel after another, or another one that ends
    before it.
    """
    early = alternatives.earliest(search)
    if early is None:
        return least_cost(shortest(search))
    begin = search.spacecraft.limits.earliest
    if early.end - begin <= (1.0 + SHARP) * (search.least_horizon(begin, early.end) - begin):
        return search.with_bounds(early)
    shorter = shortest(search.until(early.end))
    if shorter.spacecraft.horizon == early.end:  # no program leads to one that ends before
        other = alternatives.within(shorter, early.end)
        return shorter.with_bounds(early if other is None else search.preferred([early, other]))
    return search.preferred([early, least_cost(shorter)])


def shortest(search: Search) -> Search:
    """The same search with the shortest horizon in which the program leads to a schedule."""
    begin, horizon = search.spacecraft.limits.earliest, search.spacecraft.horizon

    def ends(end: float) -> bool:
        return by_program(search.until(end)) is not None

    if search.first.unmet > UNMET:
        return search
    span = search.least_horizon(begin, horizon) - begin
    low = begin + span
    later = (begin + span * (1.0 + margin) for margin in MARGINS)
    for high in (*(end for end in later if end < horizon), horizon):
        if ends(high):
            return search.until(search.least_horizon(low, high, SHARP, ends))
        low = high
    return search  # shorter ones are looked at on the way to a schedule


# --- an earlier end at the same cost

# Share of the end at which small angles must allow the cost, for an earlier one to be looked for,
# and the excess.
CLEARLY, ABOUT = 0.8, 0.002

BISECTIONS = 3
ROUNDS = 3
# Steps in which the earliest end is found that they allow; earlier ends looked for one after the
# other; horizons that are tried in turn, as parts of the way from the earliest end that they allow
# to the end there is.
PARTS = (0.2, 0.4, 0.6)

# Units of `work` after which no other end is looked for, and for all of them; how many more with
# three moments.
EARLIER, MOST_ENDS, INTEGRATED = 300.0, 900.0, 4.0


def hastened(search: Search, best: Schedule) -> Schedule:
    """The ``best``, or one that ends earlier, costs and leaves as much, and has no more pulses.

    By how much earlier an end may be small angles tell; the horizons that are tried lie a little
    later.
    """
    if not search.options.saves_cost or search.first.unmet > UNMET or not len(best):
        return best
    dearest = search.price(best) * (1.0 + SAME_COST)
    allowed = max(search.price(best), search.first.cost) * (1.0 + ABOUT)
    error = search.left(search.flown(best)) + DAMPED_ANGLE
    more = 1.0 if search.spacecraft.inertia.symmetric else INTEGRATED
    begin = search.spacecraft.limits.earliest

    def cost(end: float) -> float:
        """Cost within another horizon by small angles."""
        solution = search.program(search.within(end)).solve()
        return solution.cost if solution.unmet <= UNMET else math.inf

    with work.budget("an earlier end", more * MOST_ENDS) as spent:
        for _ in range(ROUNDS):
            span = best.end - begin
            clearly = cost(begin + CLEARLY * span)
            if clearly > allowed:
                break
            # Nor may it cost more than that in all of the span.
            most = min(allowed, cost(best.end) * (1.0 + ABOUT))
            if clearly > most:
                break
            low = 0.0
            high = CLEARLY
            for _ in range(BISECTIONS):
                middle = 0.5 * (low + high)
                enough = cost(begin + middle * span) <= most
                low, high = (low, middle) if enough else (middle, high)
            before = best
            for part in PARTS:
                if work.exhausted() or spent.done > more * EARLIER:
                    return best
                earlier = search.until(begin + (high + part * (1.0 - high)) * span).cheapest()
                if (
                    earlier is not None
                    and earlier.end < best.end
                    and len(earlier) <= len(best)
                    and search.price(earlier) <= dearest
                    and search.left(search.flown(earlier)) <= error
                ):
                    best = earlier
                    break
            if best is before or not len(best):
                break
    return best
