"""Problem of the scheme optimal: channels, costs, equations, program of small angles, bounds and
reasons.

Burns of the linear program become pulses that can be fired: few, within on-times, gap and number.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from nutdamp.common import work
from nutdamp.errors import Infeasible
from nutdamp.flight import propagation
from nutdamp.flight.dynamics import make_dynamics
from nutdamp.flight.propagation import Flight
from nutdamp.schemes.catalogue import OptimalOptions
from nutdamp.schemes.optimal import bounds
from nutdamp.schemes.optimal.bounds import Allowed
from nutdamp.schemes.optimal.linear_program import Burn, Program, Solution
from nutdamp.schemes.optimal.refinement import EndEquations, small_angles
from nutdamp.schemes.sequential import NO_AXIAL
from nutdamp.spacecraft.constraints import at_hand, usable
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import TOUCHING, Bounds, Schedule, channel_pulse

# share of what there is to do that columns may fail to supply: the program's own tolerance
UNMET = 1e-7
REPAIRS = 60  # rounds in which burns that break a limit are moved elsewhere

# Shares of the least cost given away for fewer pulses, of many and of few: so little is not worth a
# search.
THRIFT, GAIN = 0.004, 0.0005


def thinned(program: Program, solution: Solution, cost: float, *, fewest: bool) -> Solution:
    """Fewest burns that hardly cost more than ``cost``, or at any cost: the longest are kept and
    may grow.
    """
    order = sorted(solution.burns, key=lambda burn: -burn.impulse)
    few = len(order) <= 2 * len(program.influence.goal)
    most = max(cost, solution.cost) * (1.0 + (GAIN if few else THRIFT))
    if fewest or len(order) > (program.spacecraft.limits.max_pulses or math.inf):
        most = math.inf
    best = solution
    low, high = 1, len(order)
    while low < high and not work.exhausted():
        middle = (low + high) // 2
        trial = program.solve(program.about(order[:middle]))
        if trial.unmet <= UNMET and trial.cost <= most:
            best, high = trial, middle
        else:
            low = middle + 1
    return best


def repaired(program: Program, solution: Solution) -> Solution | None:
    """The solution with burns that keep on-times, gap and max_pulses: slots of one that does not
    are forbidden.

    Where that leaves too little, too long burns become several side by side. None where that does
    not help either.
    """
    allowed = program.forbidden.copy()
    attempt = solution
    for _ in range(REPAIRS):
        if attempt.unmet > UNMET or work.exhausted():
            break
        broken = broken_by(program, attempt.burns)
        if broken is None:
            return attempt
        program.forbid(*broken)
        near = program.solve(program.about(attempt.burns))
        attempt = near if near.unmet <= UNMET else program.solve()
    program.forbidden = allowed
    return repaired(program, program.solve()) if _divide(program, solution.burns) else None


def _divide(program: Program, burns: tuple[Burn, ...]) -> bool:
    """Forbid slots at regular distances about too long burns, so that none can be too long; true if
    there are any.
    """
    every = np.arange(len(program.centres))
    divided = False
    for row, channel in enumerate(program.channels):
        most = channel.max_on_time
        long = [
            burn for burn in burns if burn.channel is channel and burn.on_time > most + TOUCHING
        ]
        window = math.floor(most / program.width + TOUCHING) if long else 0
        if window == 0:
            continue
        divided = True
        # Between two the thruster is off no shorter than for its shortest pulse: valves take their
        # time.
        pause = max(
            math.ceil(
                max(program.spacecraft.limits.gap, channel.min_on_time) / program.width - TOUCHING
            ),
            1,
        )
        middles = np.searchsorted(program.centres, [burn.t for burn in long])
        nearest = np.searchsorted(0.5 * (middles[1:] + middles[:-1]), every)
        pieces = np.array([math.ceil(burn.on_time / (window * program.width)) for burn in long])
        # The first of the pieces begins so that all of them are centred on the burn.
        first = middles - (pieces * (window + pause) - pause) // 2
        program.forbidden[row, (every - first[nearest]) % (window + pause) >= window] = True
        ends = np.flatnonzero(np.diff(nearest))
        for back in range(pause):  # windows of neighbouring patterns do not join
            program.forbidden[row, ends - back] = True
    return divided


def broken_by(program: Program, burns: tuple[Burn, ...]) -> tuple[Channel, float, float] | None:
    """Span to forbid, s, of a burn too long (its begin), too short, too near another or one too
    many; else None.
    """
    limits, width = program.spacecraft.limits, program.width
    for burn in burns:
        longest, shortest = burn.channel.max_on_time, burn.channel.min_on_time
        if burn.on_time > longest + TOUCHING:
            return (
                burn.channel,
                burn.t - (burn.on_time + width),
                burn.t - 0.5 * longest + 0.5 * width,
            )
        if burn.on_time < 0.5 * shortest:
            return burn.channel, burn.t - 2.0 * width, burn.t + 2.0 * width
    for earlier, later in itertools.pairwise(burns):
        if (
            later.t - 0.5 * later.on_time
            < earlier.t + 0.5 * earlier.on_time + limits.gap - TOUCHING
        ):
            less = min(earlier, later, key=lambda burn: burn.on_time)
            reach = 0.5 * less.on_time + width
            return less.channel, less.t - reach, less.t + reach
    if limits.max_pulses is not None and len(burns) > limits.max_pulses:
        least = min(burns, key=lambda burn: burn.impulse)
        reach = 0.5 * least.on_time + 2.0 * width
        return least.channel, least.t - reach, least.t + reach
    return None


def as_pulses(spacecraft: Spacecraft, burns: tuple[Burn, ...]) -> Schedule:
    """The burns as pulses, on-times within their bounds."""
    pulses = []
    for burn in burns:
        on_time = min(max(burn.on_time, burn.channel.min_on_time), burn.channel.max_on_time)
        start = min(
            max(burn.t - 0.5 * on_time, spacecraft.limits.earliest), spacecraft.horizon - on_time
        )
        pulses.append(channel_pulse(burn.channel, start + 0.5 * on_time, on_time))
    return Schedule(tuple(pulses))


# largest nutation and distance from the target, rad, and spin error, as a share, of a plan: that of
# two-pulse for despun-comsat, which costs least, leaves 8e-6 deg
LEFT = math.radians(1e-5)

# share by which a schedule costs less than the bound of small angles, that refutes the bound
BEATEN = 0.005

# Relative accuracy of a least time by small angles.
SHARPEST = 1e-3


class Problem:
    """Channels, costs and equations of one search."""

    def __init__(self, spacecraft: Spacecraft, options: OptimalOptions) -> None:
        self.spacecraft, self.options = spacecraft, options
        requested = spacecraft.goal.spin is not None
        self.channels = tuple(at_hand(spacecraft, usable(spacecraft, axial=requested)))
        if requested and not any(channel.axial for channel in self.channels):
            raise Infeasible(NO_AXIAL)
        self.equations = EndEquations(shift=not options.free_axis, spin=requested)
        in_kg = options.least != "impulse" and all(
            channel.mass_flow is not None for channel in self.channels
        )
        self.unit = "kg" if in_kg else "N m s"
        prices = {
            channel.name: channel.mass_flow if in_kg else channel.strength
            for channel in spacecraft.channels
        }
        # Cost per second of every channel of which it is known.
        self.prices = {name: price for name, price in prices.items() if price is not None}
        self.costs = np.array([self.prices[channel.name] for channel in self.channels])
        self._dynamics = make_dynamics(spacecraft).remembering()

    def flown(self, schedule: Schedule) -> Flight:
        """The schedule through its real pulse widths; what was flown before is remembered."""
        return propagation.flown(self.spacecraft, schedule, dynamics=self._dynamics)

    def program(
        self, spacecraft: Spacecraft | None = None, equations: EndEquations | None = None
    ) -> Program:
        """The linear program of small angles, with another horizon or other equations if given."""
        body, equations = spacecraft or self.spacecraft, equations or self.equations
        off = self.off if equations.shift else 0.0
        return Program(body, self.channels, self.costs, small_angles(body, equations), off)

    @property
    def off(self) -> float:
        """Distance from its target, N m s, at which H may end."""
        spacecraft, goal = self.spacecraft, self.spacecraft.goal
        axial = abs(spacecraft.inertia.axial(spacecraft.spin if goal.spin is None else goal.spin))
        if not spacecraft.inertia.symmetric:
            # What is along axis 3 swings, and is to be enough at its least.
            size = float(np.linalg.norm(spacecraft.momentum))
            axial = min(axial, size * math.cos(spacecraft.nutation))
        return float(axial) * math.sin(min(self.options.shift or 0.0, 0.5 * math.pi))

    def within(self, horizon: float) -> Spacecraft:
        """The spacecraft with another horizon."""
        return replace(self.spacecraft, limits=replace(self.spacecraft.limits, horizon=horizon))

    def feasible(self, horizon: float) -> bool:
        """True where the program of small angles has a solution within ``horizon`` s."""
        program = self.program(self.within(horizon))
        known = program.reachable()
        return program.solve(enough=True).unmet <= UNMET if known is None else known

    def least_horizon(
        self,
        low: float,
        high: float,
        sharp: float = SHARPEST,
        feasible: Callable[[float], bool] | None = None,
    ) -> float:
        """The earliest ``feasible`` end (to small angles) from ``low`` to ``high`` s, to a share
        ``sharp`` of it.
        """
        while high - low > sharp * high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if (feasible or self.feasible)(middle) else (middle, high)
        return high

    def with_bounds(self, schedule: Schedule, first: Solution | None = None) -> Schedule:
        """The schedule with the lower bounds of its cost."""

        def least(program: Program, solution: Solution) -> float | None:
            return (
                None
                if solution.unmet > UNMET
                else bounds.first_order(program, solution.prices).bound
            )

        program = self.program()
        first_order = least(program, first or program.solve())
        keeping = None
        if self.options.free_axis and not work.exhausted():
            still = self.program(equations=EndEquations(shift=True, spin=self.equations.spin))
            keeping = least(still, still.solve())
        if first_order is not None and self.price(schedule) < first_order * (1.0 - BEATEN):
            first_order = None  # angles are large, or it leaves what the program takes out
        lower = Bounds(first_order, self.rigorous(schedule), self.unit, program.end, keeping)
        return Schedule(schedule.pulses, schedule.notes, lower)

    def rigorous(self, schedule: Schedule) -> float | None:
        """Lower bound of the cost of schedules that leave no more than this one; None where none is
        known.
        """
        return bounds.rigorous(
            self.spacecraft,
            self.prices,
            self.price(schedule),
            self.leaves(self.flown(schedule)),
            shift=self.equations.shift,
        )

    def price(self, schedule: Schedule) -> float:
        """Cost of a schedule by the program's own prices."""
        return math.fsum(self.prices[pulse.channel] * pulse.on_time for pulse in schedule)

    def rank(self, schedule: Schedule) -> tuple[float, float]:
        """Quantity to be least, the cost or the number of pulses; then the cost."""
        price = self.price(schedule)
        return (float(len(schedule)) if self.options.least == "pulses" else price, price)

    def cheaper(self, *schedules: Schedule | None) -> Schedule | None:
        """The cheaper of schedules, of which there may be none; the first of equal ones."""
        present = [schedule for schedule in schedules if schedule is not None]
        return min(present, key=self.rank, default=None)

    def error(self, schedule: Schedule) -> float:
        """End error of a schedule, rad, zero where it is as good as none."""
        left = self.left(self.flown(schedule))
        return 0.0 if left <= LEFT else left

    def left(self, flown: Flight) -> float:
        """Largest end error of a flight, rad: nutation, distance from the target, and spin as a
        share of itself.
        """
        (nutation, off), goal = self.leaves(flown), self.spacecraft.goal
        spin = 0.0 if goal.spin is None else abs(flown.settled.spin / goal.spin - 1.0)
        return max(nutation, max(off - (self.options.shift or 0.0), 0.0), spin)

    def leaves(self, flown: Flight) -> Allowed:
        """End errors of the axis and of H in a flight."""
        return Allowed(
            flown.residual.nutation, flown.residual.axis_error if self.equations.shift else 0.0
        )
