"""Least propellant over channels and firing times: no nutation left, H on its target, and the spin as asked.

The linear program of `program` finds the burns, at first with small angles. The schedule is flown, the program's
equations are taken anew along that flight at its true angles, and so on until the flight leaves little; then centres
and on-times are polished on it. Where that finds nothing, where the horizon is no longer than a few nutation periods
and where the schedule is dear, `optimal_starts` looks for a cheaper one from very many starts. Two bounds go with the
plan: the program's first least cost, of first order, and a rigorous one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from types import ModuleType
from typing import NamedTuple

import numpy as np

from nutdamp import flight
from nutdamp.errors import Infeasible
from nutdamp.schedule import Bounds, Schedule
from nutdamp.schemes import Options, bounds, influence, optimal_starts
from nutdamp.schemes.advice import no_channels
from nutdamp.schemes.bounds import Left
from nutdamp.schemes.burns import GAIN, UNMET, Unrepairable, as_pulses, repaired, thinned
from nutdamp.schemes.influence import Equations
from nutdamp.schemes.optimal_descent import Task
from nutdamp.schemes.polish import polish
from nutdamp.schemes.program import Burn, Program, Solution
from nutdamp.schemes.trim import keeps_limits
from nutdamp.schemes.windows import usable
from nutdamp.spacecraft import Spacecraft

CHOICES = 3
"""Times that burns are chosen among all channels and moments: at small angles, then along the flight before."""

AIMS = 8
"""Flights along which the burns chosen are corrected, at most."""

LOST = 0.5
"""Share of what there is to do that corrected burns may fail to supply before others are chosen."""

DEAR = 0.01
"""Share above the program's least cost from which all channels and moments are looked at again."""

DEARER = 0.03
"""Share above it from which shorter horizons are looked at too."""

WAYS = 3
"""Schedules of other schemes that are corrected to cost less."""

SHORT = 4.0
"""Inertial nutation periods up to which very many starts are tried."""

STRONG = 0.3
"""Inertial periods within which a strong channel does all there is to do."""

PROVED = 0.002
"""Share above the rigorous bound below which they are not: there is little to be saved."""

HALVINGS = 3
"""Shorter horizons that are looked at where there is a schedule already."""

HASTE = 0.0008
"""How much dearer the end of the horizon seems than its beginning, so that of equals the early burns are taken."""

LEFT = math.radians(1e-6)
"""rad of nutation and distance from the target, and share of the spin, below which a plan has been found."""

NEAR = 0.05
"""rad left from which a flight is near enough to be polished."""

LATEST = 64.0
"""Times the horizon up to which a feasible one is looked for, to name it."""

SHARPEST, SHARP = 1e-3, 0.02
"""Relative accuracy of a least time: by the program of small angles, and by schedules found."""

NOT_FOUND = (
    "not found: the program has solutions, but on the true motion the search did not settle on one that "
    "keeps on-times, gap and max_pulses; another horizon may help"
)

MARGINS = (0.002, 0.03, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""By how much more than the program's least time a schedule may need, tried in turn."""


def schedule(spacecraft: Spacecraft, options: Options) -> Schedule:
    """The cheapest schedule found, with its bounds.

    Raises Infeasible where the program has no solution, naming the limit to relax, or where no schedule was found.
    """
    search = _Search(spacecraft, options)
    if options.least == "time":
        search = search.sooner()
    elif options.least == "pulses":
        return _fewest(search)
    return search.schedule()


def _fewest(search: _Search) -> Schedule:
    """The least number of pulses found: one or two by the schemes that look for them, else as the program thins."""
    from nutdamp.schemes import one_pulse, two_pulse

    body, options = search.spacecraft, search.options
    scheme = one_pulse if options.free_axis else two_pulse
    if body.torquer is None and body.goal.spin is None:
        try:
            made = scheme.schedule(body, options)
        except Infeasible:
            made = Schedule()
        if made.pulses and search.left(flight.flown(body, made)) <= LEFT:
            return search.with_bounds(made)
    return search.schedule()


class _Found(NamedTuple):
    """A schedule that was found: what it leaves in rad (0: as good as nothing), and what it costs."""

    left: float
    price: float
    made: Schedule


class _Search:
    """What stays the same while a schedule is looked for."""

    def __init__(self, spacecraft: Spacecraft, options: Options) -> None:
        self.spacecraft, self.options = spacecraft, options
        asked = spacecraft.goal.spin is not None
        self.channels = tuple(usable(spacecraft, axial=asked))
        if not self.channels:
            raise Infeasible(no_channels(spacecraft))
        if asked and not any(channel.axial for channel in self.channels):
            raise Infeasible("no channel has a torque about axis 3, so none can set the spin; leave --spin out")
        self.equations = Equations(shift=not options.free_axis, spin=asked)
        flows = [channel.mass_flow for channel in self.channels]
        known = [flow for flow in flows if flow is not None]
        if options.least != "impulse" and len(known) == len(flows):
            self.costs, self.unit = np.array(known), "kg"
        else:
            self.costs = np.array([float(np.linalg.norm(channel.torque)) for channel in self.channels])
            self.unit = "N m s"

    def program(self, spacecraft: Spacecraft | None = None, equations: Equations | None = None) -> Program:
        """The linear program of small angles, with another horizon or other equations if given."""
        body, equations = spacecraft or self.spacecraft, equations or self.equations
        aim = influence.small_angles(body, equations)
        off = 0.0
        if self.options.shift is not None and equations.shift:
            final = body.spin if body.goal.spin is None else body.goal.spin
            off = body.inertia.C * abs(final) * math.sin(min(self.options.shift, 0.5 * math.pi))
        return Program(body, self.channels, self.costs, aim, off=off)

    def within(self, horizon: float) -> Spacecraft:
        """The spacecraft with another horizon."""
        return replace(self.spacecraft, limits=replace(self.spacecraft.limits, horizon=horizon))

    def feasible(self, horizon: float) -> bool:
        """Whether the program of small angles has a solution within ``horizon`` s."""
        return self.program(self.within(horizon)).solve().unmet <= UNMET

    def least_horizon(self, low: float, high: float) -> float:
        """Between ``low`` (infeasible) and ``high`` (feasible) s, the earliest end that small angles allow."""
        while high - low > SHARPEST * high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.feasible(middle) else (middle, high)
        return high

    def sooner(self) -> _Search:
        """The same search with the shortest horizon in which a schedule is found."""
        begin, horizon = self.spacecraft.limits.earliest, self.spacecraft.horizon
        if not self.feasible(horizon):
            return self
        span = self.least_horizon(begin, horizon) - begin
        low, high = begin + span, horizon
        for margin in MARGINS:  # small angles let channels fire at once, the schedule does not
            end = begin + span * (1.0 + margin)
            if end >= horizon:
                break
            if _Search(self.within(end), self.options).found():
                high = end
                break
            low = end
        while high - low > SHARP * high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if _Search(self.within(middle), self.options).found() else (middle, high)
        return _Search(self.within(high), self.options)

    def found(self) -> bool:
        """Whether a schedule is found with this very horizon."""
        least = self.program().solve()
        return least.unmet <= UNMET and self.settled(least.cost) is not None

    def schedule(self) -> Schedule:
        """The cheapest schedule found: over the whole horizon, or over less where there the search does not settle."""
        first = self.program().solve()
        solved = first.unmet <= UNMET
        best = self.programmed(first) if solved else None
        if self.doubtful(best, first):
            best = self.cheaper(best, self.descended(best))
        if best is None:
            raise Infeasible(NOT_FOUND if solved else self.cure())
        return self.with_bounds(best, first) if solved else best

    def programmed(self, first: Solution) -> Schedule | None:
        """The cheapest schedule that the linear program leads to, over the whole horizon or less."""
        best, horizon = self.settled(first.cost), self.spacecraft.horizon
        halvings = 0
        while self.dear(best, first.cost) and (horizon := 0.5 * horizon) > self.spacecraft.inertial_period:
            halvings += 1
            if best is not None and halvings > HALVINGS:
                break
            shorter = _Search(self.within(horizon), self.options)
            if not shorter.feasible(horizon):
                break
            best = self.cheaper(best, shorter.settled(first.cost))
        if self.dear(best, first.cost):
            best = self.cheaper(best, self.others(first.cost))
        return best

    def doubtful(self, made: Schedule | None, first: Solution) -> bool:
        """Whether a schedule may not be the cheapest, so that very many starts are worth their time.

        So where nothing was found; and where thrusters are strong, within a few nutation periods and where it is dear,
        as long as the rigorous bound does not prove it cheap enough.
        """
        body = self.spacecraft
        short = body.horizon - body.limits.earliest <= SHORT * body.inertial_period
        strong = float(np.min(self.task().unit)) <= STRONG * body.inertial_period
        if first.unmet > UNMET:  # at large angles H may be brought there all the same
            return short
        if made is None:
            return True
        if not strong or not (short or self.dear(made, first.cost)):
            return False
        proof = self.with_bounds(made, first).bounds
        return proof is None or proof.rigorous is None or self.price(made) > proof.rigorous * (1.0 + PROVED)

    def task(self) -> Task:
        """What is to be done, for the descents."""
        return Task(self.spacecraft, self.equations, self.channels, self.costs, self.program().off)

    def descended(self, known: Schedule | None) -> Schedule | None:
        """The best schedule to which very many starts, and the one ``known``, descend on the true motion."""
        found: list[_Found] = []
        for made in optimal_starts.schedules(self.task(), () if known is None else (known,)):
            if self.spacecraft.limits.tick is not None:
                missed = influence.misses(flight.flown(self.spacecraft, made), self.equations)
                off = missed[2:4] if self.options.shift is not None else np.zeros(2)
                made = polish(self.spacecraft, made, self.equations, off, self.program().width)
            left = self.left(flight.flown(self.spacecraft, made))
            if keeps_limits(self.spacecraft, made.pulses):
                found.append(_Found(0.0 if left <= LEFT else left, self.worth(made), made))
        return self.best(found)

    def worth(self, made: Schedule) -> float:
        """What is to be least: the cost, or the number of pulses."""
        return float(len(made)) if self.options.least == "pulses" else self.price(made)

    def cheaper(self, one: Schedule | None, other: Schedule | None) -> Schedule | None:
        """The cheaper of two schedules, of which there may be none; the one with fewer pulses where that counts."""
        there = [made for made in (one, other) if made is not None]
        return min(there, key=lambda made: (self.worth(made), self.price(made)), default=None)

    def dear(self, made: Schedule | None, least: float) -> bool:
        """Whether there is no schedule, or one so dear that it is worth looking for another."""
        return made is None or self.price(made) > least * (1.0 + DEARER)

    def settled(self, least: float) -> Schedule | None:
        """The cheapest of the schedules on which the search settles from one choice of burns or another."""
        program = self.program()
        program.haste = HASTE
        found: list[_Found] = []
        for _ in range(CHOICES):
            solution = program.solve()
            if solution.unmet > UNMET:
                break
            fewest = self.options.least == "pulses"
            found += self.corrected(program, thinned(program, solution, least, fewest=fewest), least)
            if not found or any(one.left == 0.0 and one.price <= least * (1.0 + DEAR) for one in found):
                break
        return self.best(found)

    def others(self, least: float) -> Schedule | None:
        """What other schemes plan, as it is and corrected to cost less: they know large angles, and far targets."""
        from nutdamp.schemes import half_cone, one_pulse, rhumb_line, two_pulse

        names = {channel.name: channel for channel in self.channels}
        body = replace(self.spacecraft, steerable=None)
        schemes: tuple[ModuleType, ...] = (two_pulse,) if self.equations.shift else (one_pulse,)
        if body.goal.axis is not None:
            schemes = (*schemes, rhumb_line, half_cone)
        ways: list[Schedule] = []
        for scheme in schemes:
            plan: Callable[[Spacecraft, Options], Schedule | Iterable[Schedule]] = scheme.schedule
            if scheme is two_pulse and body.goal.axis is None:
                plan = two_pulse.alternatives
            try:
                made = plan(body, self.options)
                ways += [made] if isinstance(made, Schedule) else made
            except Infeasible:
                continue
        found: list[_Found] = []
        flights = [flight.flown(self.spacecraft, Schedule(one.pulses)) for one in ways]
        for way in sorted(flights, key=lambda one: (self.left(one) > LEFT, self.price(one.schedule)))[:WAYS]:
            left = self.left(way)
            found.append(_Found(0.0 if left <= LEFT else left, self.price(way.schedule), way.schedule))
            program = self.program()
            program.aim(influence.along(way, self.equations, program.width))
            burns = [Burn(names[pulse.channel], pulse.t, pulse.on_time) for pulse in way.schedule]
            found += self.corrected(program, program.solve(program.about(burns)), least)
        return self.best(found)

    def corrected(self, program: Program, solution: Solution, least: float) -> list[_Found]:
        """Schedules from the burns of a solution, corrected along one flight after the other, unless they get lost."""
        found: list[_Found] = []
        last = math.inf
        for turn in range(AIMS):
            if solution.unmet > LOST:
                break
            try:
                solution = repaired(program, solution)
            except Unrepairable:
                break
            made = as_pulses(self.spacecraft, solution.burns)
            flown = flight.flown(self.spacecraft, made)
            program.aim(influence.along(flown, self.equations, program.width))
            if self.left(flown) < NEAR:
                made = polish(self.spacecraft, made, self.equations, solution.off, program.width)
                left, price = self.left(flight.flown(self.spacecraft, made)), self.price(made)
                found.append(_Found(0.0 if left <= LEFT else left, price, made))
                if left <= LEFT and (price <= least * (1.0 + DEAR) or price > (1.0 - GAIN) * last):
                    break
                last = price if left <= LEFT else math.inf
            solution = program.solve(program.about(solution.burns, zoom=2.0**turn))
        return found

    def best(self, found: list[_Found]) -> Schedule | None:
        """The cheapest that leaves nothing; on ticks the one that leaves least."""
        best = min(found, key=lambda one: (one.left, one.price), default=None)
        if best is None or (best.left > 0.0 and self.spacecraft.limits.tick is None):
            return None
        return best.made

    def with_bounds(self, made: Schedule, first: Solution | None = None) -> Schedule:
        """The schedule with what any other must cost."""
        body = self.spacecraft
        first = first or self.program().solve()
        left = self.leaves(flight.flown(body, made))
        rigorous = bounds.rigorous(body, self.prices(), self.price(made), left, shift=self.equations.shift)
        return Schedule(made.pulses, made.notes, Bounds(first.cost, rigorous, self.unit, body.horizon))

    def prices(self) -> dict[str, float]:
        """Cost per second, in the unit of the bounds, of every channel of which it is known."""
        flows = {channel.name: channel.mass_flow for channel in self.spacecraft.channels}
        if self.unit == "kg":
            return {name: flow for name, flow in flows.items() if flow is not None}
        return {channel.name: float(np.linalg.norm(channel.torque)) for channel in self.spacecraft.channels}

    def price(self, made: Schedule) -> float:
        """What a schedule costs by the program's own prices."""
        price = {channel.name: cost for channel, cost in zip(self.channels, self.costs, strict=True)}
        return math.fsum(price[pulse.channel] * pulse.on_time for pulse in made)

    def left(self, flown: flight.Flight) -> float:
        """Largest of what a flight leaves, rad: nutation, distance from the target, and spin as a share of itself."""
        nutation, off, spin = self.leaves(flown)
        return max(nutation, max(off - (self.options.shift or 0.0), 0.0), spin)

    def leaves(self, flown: flight.Flight) -> Left:
        """What a flight leaves of what is asked for."""
        residual, goal = flown.residual, self.spacecraft.goal
        off = residual.axis_error if self.equations.shift else 0.0
        return Left(residual.nutation, off, 0.0 if goal.spin is None else abs(flown.settled.spin / goal.spin - 1.0))

    def cure(self) -> str:
        """Why the program has no solution, and which limit to relax."""
        body = self.spacecraft
        names, horizon = ", ".join(channel.name for channel in self.channels), body.horizon
        nutation = Equations(shift=False)
        left = self.program(body, nutation).solve().unmet
        if left <= UNMET:
            wanted = "H not be kept where it is" if body.goal.axis is None else "H not be brought to the target"
            if self.equations.spin and self.program(body, Equations(shift=self.equations.shift)).solve().unmet <= UNMET:
                wanted = "the spin not be brought to the rate asked for"
            what = f"within {horizon:.4g} s the nutation can be taken out, but {wanted}"
        else:
            what = (
                f"within {horizon:.4g} s the channels ({names}) cannot take out the nutation, "
                f"{100.0 * min(left, 1.0):.2g} % of it stays"
            )
        return f"{what}; {self.relaxed()}"

    def relaxed(self) -> str:
        """The limit that has to be relaxed, and how far."""
        body = self.spacecraft
        horizon = later = body.horizon
        while later < LATEST * horizon:
            later *= 2.0
            if self.feasible(later):
                needed = self.least_horizon(0.5 * later, later)
                more = "" if self.options.free_axis or not self.equations.shift else ", or use --free-axis"
                return f"set limits.horizon to {needed:.4g} s or later ({needed - horizon:.3g} s more){more}"
        if body.limits.blackout:
            free = replace(body, limits=replace(body.limits, blackout=()))
            if self.program(free).solve().unmet <= UNMET:
                return "shorten the blackout windows (without any it can be done)"
        return f"not even {LATEST:g} times the horizon helps: channels of other directions or more torque are needed"
