"""Two pulses of a steerable torquer that leave no nutation, with H and the spin axis on the target.

From any motion, exact at any angle: `precession` places them for least impulse; free is the time of
the first. Pulses of real width are corrected on the flown motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from nutdamp.errors import Infeasible, TooShort
from nutdamp.flight.dynamics import free_coast
from nutdamp.physics import attitude, precession
from nutdamp.physics.precession import TwoJumps
from nutdamp.schemes import correction
from nutdamp.schemes.correction import model_of, tolerable
from nutdamp.schemes.sequential import strongest_turn
from nutdamp.spacecraft.constraints import Windows, bounded_by, commandable, keeps_limits
from nutdamp.spacecraft.equipment import Steerable
from nutdamp.spacecraft.model import Spacecraft, SpinState, Vector
from nutdamp.spacecraft.schedule import Pulse, Schedule, steerable_pulse

# Turns of the spin axis looked at from the earliest start, and one more from the end of each of the
# first blackout windows; moments looked at in each.
SPIN_TURNS, MOST_WINDOWS, SPIN_SAMPLES = 4, 40, 256
FURTHER_TURNS = 60  # further whole turns that the second pulse may wait for, at most
# Share of the first steps at which the search for the best moment ends, as the cost is flat there;
# relative difference below which costs are equal: then the earlier end wins.
NARROWEST, EQUAL = 1e-7, 1e-12
ROUNDING = 1e-14  # relative gain that counts as one while the best moment is made exact
SMALLEST = 0.1  # least share of both jumps that each real pulse of the two gets
# least sine of half the angle by which the spin axis turns between two real pulses: a sixth of a
# turn to five
APART = 0.5
# Steps in which a pulse and the place to which it sets back the spin axis are made to agree:
# without them 5 cones of a torquer near its reach cost 7 % more.
BACKWARD = 4
NOTHING = 1e-12  # jumps below this times C|ω3| are left out


class SteerablePair:
    """Placement of a steerable torquer from the motion of a ``spacecraft`` at t = 0 to its target
    axis.
    """

    def __init__(self, spacecraft: Spacecraft, torquer: Steerable) -> None:
        self.spacecraft, self.torquer = spacecraft, torquer
        self.A, self.h = spacecraft.inertia.A, abs(spacecraft.axial)
        self.momentum, self.target = spacecraft.momentum, spacecraft.target_axis
        self.windows = Windows(spacecraft)
        self.step = spacecraft.inertial_period / SPIN_SAMPLES
        # Moments (n,) s of the first pulse worth looking at.
        period, first = spacecraft.inertial_period, spacecraft.limits.earliest
        ends = [end for _, end in spacecraft.limits.blackout if end > first][:MOST_WINDOWS]
        begins = [*(first + number * period for number in range(SPIN_TURNS)), *ends]
        turn = np.arange(SPIN_SAMPLES) * self.step
        times = np.unique(np.concatenate([begin + turn for begin in begins]))
        self.moments = times[times <= self.windows.horizon]

    def axes(self, times: Vector) -> Vector:
        """Spin axis S at ``times`` (n,) s, (n, 3), inertial."""
        _, quaternions = free_coast(self.spacecraft.inertia, self.spacecraft.initial).motion(times)
        return attitude.rotate(quaternions, np.array([0.0, 0.0, self.spacecraft.sense]))

    def on_times(self, jumps: Vector) -> Vector:
        """On-times (n,) s of pulses that turn H by ``jumps`` (n,) N m s; not a number where no
        pulse can.
        """
        torque = self.torquer.torque
        if torque is None:
            return np.zeros_like(jumps)
        return precession.on_times_to_turn(jumps, torque, self.spacecraft.spin)

    def spent(self, jumps: Vector) -> Vector:
        """Impulse (n,) N m s that ``jumps`` (n,) of H take: more where the pulse is wide."""
        torque = self.torquer.torque
        return jumps if torque is None else torque * self.on_times(jumps)

    def set_back(self, jumps: Vector) -> Vector:
        """Angle (n,) rad by which pulses that turn H by ``jumps`` (n,) set the spin axis back.

        A wide pulse acts more on ω than it turns H, by sinc(ντ/2) over sinc(ω3τ/2): seen from its
        centre.
        """
        half = 0.5 * self.spacecraft.nutation_rate * self.on_times(jumps)
        return np.asarray((self.spent(jumps) * np.sinc(half / math.pi) - jumps) / self.h)

    def pulses(self, jumps: list[tuple[float, Vector]]) -> tuple[Pulse, ...]:
        """Pulses that bring H to the given vectors (3,) N m s at the given moments, in order."""
        pulses = []
        state = self.spacecraft.initial
        now = 0.0
        momentum = self.momentum
        for moment, after in jumps:
            rates, quaternions = free_coast(self.spacecraft.inertia, state, now).motion(
                np.array([moment])
            )
            body = attitude.matrix(quaternions[0]).T @ (after - momentum)
            push = complex(body[0], body[1])
            if abs(push) > NOTHING * self.h:
                on_time = float(self.on_times(np.array([abs(push)]))[0])
                angle = math.atan2(push.imag, push.real)
                pulse = steerable_pulse(
                    self.torquer, moment, angle, impulse=abs(push), on_time=on_time
                )
                pulses.append(commandable(self.spacecraft, pulse))
            omega = complex(rates[0, 0], rates[0, 1]) + push / self.A
            state = SpinState(omega, float(rates[0, 2]), quaternions[0])
            now, momentum = moment, after
        return tuple(pulses)

    def one(self, cones: int) -> tuple[Pulse, ...]:
        """First pulse of ``cones`` half cones in a row, at the time from which all of them cost
        least.
        """

        def cost(times: Vector) -> tuple[Vector, Vector]:
            axes = self.axes(times)
            more = np.zeros(len(times))
            for _ in range(BACKWARD):
                middle, last = precession.half_cone(self.h, axes, self.target, cones, more)
                jumps = np.linalg.norm(middle - self.momentum, axis=-1)
                back = self.set_back(jumps)
                more = (back + (cones - 1) * self.set_back(2.0 * last)) / (2 * cones) - back
            on_times = self.on_times(jumps)
            starts = times - 0.5 * on_times
            allowed = self.windows.allowed(starts, on_times, self.spacecraft.limits.earliest)
            spent = self.spent(jumps) + (cones - 1) * self.spent(2.0 * last) + self.spent(last)
            return np.where(allowed & ~np.isnan(spent), spent, np.inf), middle

        costs, _ = cost(self.moments)
        near = np.flatnonzero(costs <= float(costs.min(initial=np.inf)) * (1.0 + EQUAL))
        if not np.isfinite(costs[near]).any():
            raise self.no_room(f"{cones} half cones")
        moment = self.best(lambda times: cost(times)[0], float(self.moments[near[0]]))
        return self.pulses([(moment, cost(np.array([moment]))[1][0])])

    def two(self) -> tuple[Pulse, ...]:
        """Two pulses that end on the target with least impulse."""
        least, moment, turns = math.inf, 0.0, 0
        for further in range(FURTHER_TURNS):
            costs, second, _ = self.costs(self.moments, further)
            if float(costs.min(initial=np.inf)) < least * (1.0 - EQUAL):
                least = float(costs.min())
                near = np.flatnonzero(costs <= least * (1.0 + EQUAL))  # the first to end
                moment, turns = float(self.moments[near[np.argmin(second[near])]]), further
            if not (second < self.windows.horizon).any() or (
                least < math.inf and not self.spacecraft.limits.blackout
            ):
                break
        if math.isinf(least):
            raise self.no_room("two pulses")
        moment = self.best(lambda times: self.costs(times, turns)[0], moment)
        _, second, jumps = self.costs(np.array([moment]), turns)
        ends = jumps.middle[0], self.h * self.target
        return self.pulses([*zip((moment, float(second[0])), ends, strict=True)])

    def costs(self, times: Vector, further: int) -> tuple[Vector, Vector, TwoJumps]:
        """Impulse (n,) of first pulses at ``times`` (n,) s, infinite where not allowed; moment of
        the second, after so many ``further`` turns.
        """
        jumps = precession.two_jumps(self.A, self.h, self.momentum, self.axes(times), self.target)
        second = times + jumps.wait + further * jumps.turn
        long, longer = self.on_times(jumps.first), self.on_times(jumps.second)
        ready = times + 0.5 * long + self.spacecraft.limits.gap
        allowed = self.windows.allowed(times - 0.5 * long, long, self.spacecraft.limits.earliest)
        allowed &= self.windows.allowed(second - 0.5 * longer, longer, ready)
        if self.torquer.torque is not None:
            # Widths are corrected on both pulses: both must be there, and not do the same a whole
            # turn apart.
            allowed &= np.minimum(jumps.first, jumps.second) > SMALLEST * jumps.cost
            allowed &= np.sin(math.pi * jumps.wait / jumps.turn) > APART
        spent = self.spent(jumps.first) + self.spent(jumps.second)
        return np.where(allowed, spent, np.inf), second, jumps

    def best(self, cost: Callable[[Vector], Vector], moment: float) -> float:
        """Moment, s, of the least ``cost`` (n,) of moments (n,) near one."""
        step = self.step
        least = float(cost(np.array([moment]))[0])
        while step > NARROWEST * self.step:
            around = moment + np.linspace(-step, step, 9)
            costs = cost(around)
            if costs.min() < least * (1.0 - ROUNDING):
                least, moment = float(costs.min()), float(around[np.argmin(costs)])
            step *= 0.25
        return moment

    def no_room(self, what: str) -> TooShort:
        """Reason why no pulse could be placed."""
        return TooShort(
            f"no {what} of the steerable torquer that end on the target fit within "
            f"{bounded_by(self.spacecraft)}; {strongest_turn(self.spacecraft)}"
        )


def schedule(spacecraft: Spacecraft) -> Schedule:
    """Two pulses to the target axis, where so many are allowed. Raises Infeasible."""
    torquer = spacecraft.torquer
    if torquer is None:
        from nutdamp.schemes import channel_pairs  # here, because a torquer needs none

        return channel_pairs.acquiring(spacecraft)
    schedule = Schedule(SteerablePair(spacecraft, torquer).two())
    kept = keeps_limits(spacecraft, schedule.pulses)
    if kept and (torquer.torque is not None or not model_of(spacecraft).exact):
        every = range(len(schedule))
        schedule = correction.correct(spacecraft, schedule, chosen=every, momentum=True)
        kept = keeps_limits(spacecraft, schedule.pulses)
    if not kept:
        raise Infeasible("rounded to limits.tick, the two pulses break another limit")
    if correction.left(spacecraft, schedule) > tolerable(spacecraft):
        raise TooShort(
            "two pulses for the free motion of a symmetric body could not be corrected to end on "
            f"the target; {strongest_turn(spacecraft)}"
        )
    return schedule
