"""What the scheme optimal is to do: channels, costs, equations; their program of small angles, bounds and reasons."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from nutdamp import flight, work
from nutdamp.dynamics import make_dynamics
from nutdamp.errors import Infeasible
from nutdamp.flight import Flight
from nutdamp.limits import rounded_off, usable
from nutdamp.schedule import Bounds, Schedule
from nutdamp.schemes.optimal import bounds, residual_equations
from nutdamp.schemes.optimal.bounds import Allowed
from nutdamp.schemes.optimal.linear_program import Program, Solution
from nutdamp.schemes.optimal.repair import UNMET
from nutdamp.schemes.optimal.residual_equations import Equations
from nutdamp.schemes.options import OptimalOptions
from nutdamp.schemes.tools.reasons import at_hand
from nutdamp.spacecraft import Spacecraft

LEFT = math.radians(1e-6)
"""rad of nutation and distance from the target, and share of the spin, below which a plan has been found."""

LATEST = 64.0
"""Times the horizon up to which a feasible one is looked for, to name it."""

SHARPEST = 1e-3
"""Relative accuracy of a least time by the program of small angles."""

NAMED = 5e-3
"""The same where it is only advice."""


DEARER = 0.03
"""Share above the program's least cost from which shorter horizons are looked at too."""


class Problem:
    """What stays the same while a schedule is looked for."""

    def __init__(self, spacecraft: Spacecraft, options: OptimalOptions) -> None:
        self.spacecraft, self.options = spacecraft, options
        requested = spacecraft.goal.spin is not None
        self.channels = tuple(at_hand(spacecraft, usable(spacecraft, axial=requested)))
        if requested and not any(channel.axial for channel in self.channels):
            raise Infeasible("no channel has a torque about axis 3, so none can set the spin; leave --spin out")
        self.equations = Equations(shift=not options.free_axis, spin=requested)
        flows = [channel.mass_flow for channel in self.channels]
        known = [flow for flow in flows if flow is not None]
        if options.least != "impulse" and len(known) == len(flows):
            self.costs, self.unit = np.array(known), "kg"
        else:
            self.costs = np.array([channel.strength for channel in self.channels])
            self.unit = "N m s"
        self._dynamics = make_dynamics(spacecraft).remembering()

    def flown(self, made: Schedule) -> Flight:
        """The schedule through its real pulse widths; what was flown before is remembered."""
        return flight.flown(self.spacecraft, made, dynamics=self._dynamics)

    @property
    def closed(self) -> bool:
        """Whether the motion between pulses is that of a symmetric body left alone."""
        return self._dynamics.free and self.spacecraft.growth == 0.0

    def program(self, spacecraft: Spacecraft | None = None, equations: Equations | None = None) -> Program:
        """The linear program of small angles, with another horizon or other equations if given."""
        body, equations = spacecraft or self.spacecraft, equations or self.equations
        aim = residual_equations.small_angles(body, equations)
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
        program = self.program(self.within(horizon))
        known = program.reachable()
        return program.solve(enough=True).unmet <= UNMET if known is None else known

    def least_horizon(self, low: float, high: float, sharp: float = SHARPEST) -> float:
        """Between ``low`` (infeasible) and ``high`` (feasible) s, the earliest end that small angles allow.

        To a share ``sharp`` of it, and feasible.
        """
        while high - low > sharp * high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self.feasible(middle) else (middle, high)
        return high

    def overtaxed(self, solution: Solution) -> dict[str, float]:
        """Channels that need more pulses of their longest on-time than there are moments for, and how many."""
        needed: dict[str, float] = {}
        for burn in solution.burns:
            name = burn.channel.name
            needed[name] = needed.get(name, 0.0) + burn.on_time / burn.channel.max_on_time
        return {name: count for name, count in needed.items() if count > self.program().forbidden.shape[1]}

    def with_bounds(self, made: Schedule, first: Solution | None = None) -> Schedule:
        """The schedule with what any other must cost."""
        program = self.program()
        first = first or program.solve()
        least = None if first.unmet > UNMET else bounds.first_order(program, first.prices).bound
        keeping = self._keeping() if self.options.free_axis and not work.exhausted() else None
        return Schedule(made.pulses, made.notes, Bounds(least, self.rigorous(made), self.unit, program.end, keeping))

    def _keeping(self) -> float | None:
        """The first-order least cost of a schedule that keeps H; None where there is none."""
        program = self.program(equations=Equations(shift=True, spin=self.equations.spin))
        found = program.solve()
        return None if found.unmet > UNMET else bounds.first_order(program, found.prices).bound

    def rigorous(self, made: Schedule) -> float | None:
        """What any schedule must cost that leaves no more than this one; None where nothing is known to hold."""
        body = self.spacecraft
        left = self.leaves(self.flown(made))
        return bounds.rigorous(body, self.prices(), self.price(made), left, shift=self.equations.shift)

    def prices(self) -> dict[str, float]:
        """Cost per second, in the unit of the bounds, of every channel of which it is known."""
        flows = {channel.name: channel.mass_flow for channel in self.spacecraft.channels}
        if self.unit == "kg":
            return {name: flow for name, flow in flows.items() if flow is not None}
        return {channel.name: channel.strength for channel in self.spacecraft.channels}

    def price(self, made: Schedule) -> float:
        """What a schedule costs by the program's own prices."""
        price = {channel.name: cost for channel, cost in zip(self.channels, self.costs, strict=True)}
        return math.fsum(price[pulse.channel] * pulse.on_time for pulse in made)

    def worth(self, made: Schedule) -> float:
        """What is to be least: the cost, or the number of pulses."""
        return float(len(made)) if self.options.least == "pulses" else self.price(made)

    def dear(self, made: Schedule | None, least: float, share: float = DEARER) -> bool:
        """Whether there is no schedule, or one so dear that it is worth looking for another."""
        return made is None or self.price(made) > least * (1.0 + share)

    def cheaper(self, one: Schedule | None, other: Schedule | None) -> Schedule | None:
        """The cheaper of two schedules, of which there may be none; the one with fewer pulses where that counts."""
        there = [made for made in (one, other) if made is not None]
        return min(there, key=lambda made: (self.worth(made), self.price(made)), default=None)

    def left(self, flown: Flight) -> float:
        """Largest of what a flight leaves, rad: nutation, distance from the target, and spin as a share of itself."""
        nutation, off, spin = self.leaves(flown)
        return max(nutation, max(off - (self.options.shift or 0.0), 0.0), spin)

    def leaves(self, flown: Flight) -> Allowed:
        """What a flight leaves of what is requested."""
        residual, goal = flown.residual, self.spacecraft.goal
        off = residual.axis_error if self.equations.shift else 0.0
        return Allowed(residual.nutation, off, 0.0 if goal.spin is None else abs(flown.settled.spin / goal.spin - 1.0))

    def rounded(self, made: Schedule) -> float:
        """What starts and on-times on ticks can leave, rad, added up as chance does; without ticks zero."""
        return math.hypot(*rounded_off(self.spacecraft, made))

    def not_found(self) -> str:
        """Why no schedule was found although the program has solutions: the limits that it does not know of."""
        if too_few := self._too_few():
            return too_few
        limits = self.spacecraft.limits
        shortest = max(channel.min_on_time for channel in self.channels)
        longest = min(channel.max_on_time for channel in self.channels)
        kept = {
            f"a gap of {limits.gap:.4g} s": limits.gap > 0.0,
            f"max_pulses {limits.max_pulses}": limits.max_pulses is not None,
            f"on-times of {shortest:.4g} s or more": shortest > 0.0,
            f"on-times of {longest:.4g} s or less": math.isfinite(longest),
            f"ticks of {limits.tick or 0.0:.4g} s": limits.tick is not None,
        }
        named = [name for name, limited in kept.items() if limited] or ["one pulse after the other"]
        return (
            "not found: for small angles, without other limits than the horizon, there are schedules; on the true "
            f"motion none was found with {', '.join(named)}; shorter horizons were tried too, a longer one may help"
        )

    def _too_few(self) -> str:
        """That max_pulses pulses cannot give the impulse that it takes; empty where that is not known."""
        body, most = self.spacecraft, self.spacecraft.limits.max_pulses
        if most is None or not body.inertia.symmetric or body.growth != 0.0 or body.disturbances:
            return ""
        largest = max(abs(channel.transverse) * channel.max_on_time for channel in self.channels)
        if most * largest >= body.least_impulse:
            return ""
        return (
            f"limits.max_pulses = {most} is too few: so many pulses give at most {most * largest:.4g} N m s, and "
            f"taking out the nutation takes {body.least_impulse:.4g} N m s, "
            f"{math.ceil(body.least_impulse / largest)} pulses or more"
        )

    def cure(self, long_enough: Callable[[float], float | None]) -> str:
        """Why the program has no solution, and which limit to relax; ``long_enough``: see `relaxed`."""
        body = self.spacecraft
        names, horizon = ", ".join(channel.name for channel in self.channels), body.horizon
        nutation = Equations(shift=False)
        left = self.program(body, nutation).solve().unmet
        if left <= UNMET:
            failing = "H cannot be kept where it is" if body.goal.axis is None else "H cannot be brought to the target"
            if self.equations.spin and self.program(body, Equations(shift=self.equations.shift)).solve().unmet <= UNMET:
                failing = "the spin cannot be brought to the rate of the goal"
            out = "the nutation can be taken out, but " if body.transverse_rate > 0.0 else ""
            what = f"within {horizon:.4g} s {out}{failing}"
        else:
            what = (
                f"within {horizon:.4g} s the channels ({names}) cannot take out the nutation, "
                f"{100.0 * min(left, 1.0):.3g} % of it stays"
            )
        return f"{what}; {self.relaxed(long_enough)}"

    def relaxed(self, long_enough: Callable[[float], float | None]) -> str:
        """The limit that has to be relaxed, and how far.

        ``long_enough`` gives a horizon in which a schedule was found, s, no shorter than the one with which the program
        has a solution; None where it found none.
        """
        body = self.spacecraft
        horizon = later = body.horizon
        while later < LATEST * horizon:
            if work.exhausted():
                return f"horizons of more than {later:.4g} s were not tried"
            later *= 2.0
            if self.feasible(later):
                needed = self.least_horizon(0.5 * later, later, NAMED)
                enough = long_enough(needed)
                if enough is not None:
                    return f"limits.horizon = {enough:.4g} s is long enough"
                return (
                    f"set limits.horizon to at least {needed:.4g} s ({needed - horizon:.3g} s more; by small angles, "
                    f"without other limits)"
                )
        if body.limits.blackout:
            free = replace(body, limits=replace(body.limits, blackout=()))
            if self.program(free).solve().unmet <= UNMET:
                return "shorten the blackout windows (without any it can be done)"
        return f"not even {LATEST:g} times the horizon helps: channels of other directions or more torque are needed"
