"""Where a steerable torquer is to push so that H and the spin axis come to the target axis: exact at any angle.

The two pulses of an acquisition, and the first pulse of a row of half cones, are placed by `physics.pointing`; what is
free, the moment of the first pulse and how far aside H goes between two, is chosen for least impulse.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from nutdamp.errors import Infeasible
from nutdamp.limits import Windows, commandable
from nutdamp.motion import Arc
from nutdamp.physics import attitude, pointing
from nutdamp.schedule import Pulse, steerable_pulse
from nutdamp.schemes.tools.reasons import turn_of
from nutdamp.spacecraft import Spacecraft, SpinState, Steerable, Vector

SAMPLES = 256
"""Moments looked at in each turn of the spin axis, before the best is made exact."""

TURNS = 4
"""Turns of the spin axis looked at from the earliest start, and one more from the end of each blackout window."""

MOST_WINDOWS = 40
"""Blackout windows after which a turn is looked at."""

FURTHER = 60
"""Further whole turns that the second pulse may wait for, at most."""

FURTHER_BESIDE = 12
"""The same for the search beside the best places."""

MOST_BESIDE = 1000
"""Moments looked at in that search, at most."""

ASIDE = np.linspace(-1.0, 1.0, 41)
"""Places of H beside the best one, as shares of both jumps, for the case that the limits forbid that one."""

NARROWEST = 1e-7
"""Share of the first steps at which the search for the best choice ends; the cost is flat there to its square."""

COMPASS_STEPS = 2000
"""Steps of that search, at most."""

ROUNDING = 1e-14
"""Relative gain that counts as one while the best choice is made exact."""

EQUAL = 1e-9
"""Costs that differ by less, relatively, are equal: then the earlier end wins."""

SMALLEST = 0.1
"""Least share of both jumps that each real pulse of the two gets."""

APART = 0.5
"""Least sine of half the angle by which the spin axis turns between two real pulses: a sixth of a turn to five."""

NOTHING = 1e-12
"""Jumps below this times C|ω3| are left out."""


class SteerablePair:
    """The choices of a steerable torquer from the motion of a ``spacecraft`` at t = 0 to its target axis."""

    def __init__(self, spacecraft: Spacecraft, torquer: Steerable) -> None:
        self.spacecraft, self.torquer = spacecraft, torquer
        self.A, self.h = spacecraft.inertia.A, spacecraft.inertia.C * abs(spacecraft.spin)
        self.momentum, self.target = spacecraft.momentum, spacecraft.target_axis
        self.start = spacecraft.initial
        self.windows = Windows(spacecraft)

    # --- the motion --------------------------------------------------------------------------------------------------

    def axes(self, times: Vector) -> Vector:
        """Spin axis S at ``times`` (n,) s, (n, 3), inertial."""
        _, quaternions = self._arc(0.0, self.start).motion(times)
        return attitude.rotate(quaternions, np.array([0.0, 0.0, math.copysign(1.0, self.spacecraft.spin)]))

    def _arc(self, since: float, state: SpinState) -> Arc:
        return Arc(self.A, self.spacecraft.inertia.C, since, state)

    def on_times(self, jumps: Vector) -> Vector:
        """On-times (n,) s of pulses that turn H by ``jumps`` (n,) N m s; not a number where no pulse can."""
        if self.torquer.torque is None:
            return np.zeros_like(jumps)
        return pointing.on_times_to_turn(jumps, self.torquer.torque, self.spacecraft.spin)

    def spent(self, jumps: Vector) -> Vector:
        """Impulse (n,) N m s that ``jumps`` (n,) of H take: more where the pulse is wide."""
        torque = self.torquer.torque
        return jumps if torque is None else torque * self.on_times(jumps)

    def pulses(self, jumps: list[tuple[float, Vector]]) -> tuple[Pulse, ...]:
        """Pulses that bring H to the given vectors (3,) N m s at the given moments, in order."""
        made, state, now, momentum = [], self.start, 0.0, self.momentum
        for moment, after in jumps:
            rates, quaternions = self._arc(now, state).motion(np.array([moment]))
            body = attitude.matrix(quaternions[0]).T @ (after - momentum)
            push = complex(body[0], body[1])
            if abs(push) > NOTHING * self.h:
                on_time = float(self.on_times(np.array([abs(push)]))[0])
                requested = {"impulse": abs(push)} if self.torquer.torque is None else {"on_time": on_time}
                angle = math.atan2(push.imag, push.real)
                pulse = steerable_pulse(self.torquer, moment, angle, **requested)
                made.append(commandable(self.spacecraft, pulse))
            state = SpinState(complex(rates[0, 0], rates[0, 1]) + push / self.A, float(rates[0, 2]), quaternions[0])
            now, momentum = moment, after
        return tuple(made)

    # --- what can be chosen ------------------------------------------------------------------------------------------

    def moments(self) -> Vector:
        """Moments (n,) s of the first pulse worth looking at."""
        period = self.spacecraft.inertial_period
        first = self.spacecraft.limits.earliest
        turn = np.arange(SAMPLES) * (period / SAMPLES)
        ends = [end for _, end in self.spacecraft.limits.blackout if end > first][:MOST_WINDOWS]
        parts = [first + number * period + turn for number in range(TURNS)] + [end + turn for end in ends]
        times = np.unique(np.concatenate(parts))
        return np.asarray(times[times <= self.windows.horizon])

    def one(self, cones: int) -> tuple[Pulse, ...]:
        """The first pulse of ``cones`` half cones in a row, at the moment from which all of them cost least."""

        def cost(times: Vector) -> tuple[Vector, Vector]:
            middle, rest = pointing.half_cone(self.h, self.axes(times), self.target, cones)
            jumps = np.linalg.norm(middle - self.momentum, axis=-1)
            on_times = self.on_times(jumps)
            allowed = self.windows.allowed(times - 0.5 * on_times, on_times, self.spacecraft.limits.earliest)
            return np.where(allowed, self.spent(jumps) + rest, np.inf), middle

        times = self.moments()
        costs, _ = cost(times)
        if len(times) == 0 or not np.isfinite(costs.min()):
            raise Infeasible(self.no_room(cones))
        best = float(times[np.flatnonzero(costs <= costs.min() * (1.0 + EQUAL))[0]])
        point = _descend(lambda points: cost(points[:, 0])[0], np.array([best]), self._steps(0.0)[:1])
        moment = float(point[0])
        return self.pulses([(moment, cost(np.array([moment]))[1][0])])

    def two(self, straight: bool = False) -> tuple[Pulse, ...]:
        """The two pulses that end on the target with least impulse; ``straight``: by a half cone, without choice."""
        times = self.moments()
        plain = np.zeros(len(times))
        if len(times) == 0:
            raise Infeasible(self.no_room(1))
        free = pointing.two_jumps(self.A, self.h, self.momentum, self.axes(times), self.target)
        least = float(np.nanmin(self.spent(free.first) + self.spent(free.second), initial=np.inf))
        if not np.isfinite(least):
            raise Infeasible(self.no_room(1))
        found = self._best(times, plain, straight, FURTHER)
        if (found is None or found.cost > least * (1.0 + 1e-6)) and not straight:
            some = slice(None, None, math.ceil(len(times) / MOST_BESIDE))
            beside = np.repeat(times[some], len(ASIDE)), (ASIDE * free.cost[some, None]).ravel()
            other = self._best(*beside, straight, FURTHER_BESIDE)
            if other is not None and (found is None or other.cost < found.cost * (1.0 - EQUAL)):
                found = other
        if found is None:
            raise Infeasible(self.no_room(1))
        point = _descend(
            lambda points: self._costs(points[:, 0], points[:, 1], found.further, straight)[0],
            np.array([found.moment, found.aside]),
            self._steps(0.0 if straight else 0.02 * found.jumps),
        )
        _, second, jumps = self._costs(point[:1], point[1:], found.further, straight)
        return self.pulses([(float(point[0]), jumps.middle[0]), (float(second[0]), self.h * self.target)])

    def _steps(self, aside: float) -> Vector:
        return np.array([self.spacecraft.inertial_period / SAMPLES, aside])

    def _costs(
        self, times: Vector, aside: Vector, further: int, straight: bool
    ) -> tuple[Vector, Vector, pointing.TwoJumps]:
        """Impulse (n,) of first pulses at ``times`` (n,) s, infinite where not allowed; moment of the second."""
        jumps = pointing.two_jumps(self.A, self.h, self.momentum, self.axes(times), self.target, aside, straight)
        second = times + jumps.wait + further * jumps.turn
        long, longer = self.on_times(jumps.first), self.on_times(jumps.second)
        ready = times + 0.5 * long + self.spacecraft.limits.gap
        allowed = self.windows.allowed(times - 0.5 * long, long, self.spacecraft.limits.earliest)
        allowed &= self.windows.allowed(second - 0.5 * longer, longer, ready)
        if self.torquer.torque is not None:
            # Widths are corrected on both pulses: both must be there, and not do the same a whole turn apart.
            allowed &= np.minimum(jumps.first, jumps.second) > SMALLEST * jumps.cost
            allowed &= np.sin(math.pi * jumps.wait / jumps.turn) > APART
        spent = self.spent(jumps.first) + self.spent(jumps.second)
        return np.where(allowed, spent, np.inf), second, jumps

    def _best(self, times: Vector, aside: Vector, straight: bool, most: int) -> _Found | None:
        """The cheapest choice with up to ``most`` further turns, of equal ones that which ends first."""
        best: _Found | None = None
        for further in range(most):
            costs, second, jumps = self._costs(times, aside, further, straight)
            least = float(costs.min())
            if np.isfinite(least) and (best is None or least < best.cost * (1.0 - EQUAL)):
                near = np.flatnonzero(costs <= least * (1.0 + EQUAL))
                index = near[np.argmin(second[near])]
                size = float(jumps.cost[index])
                best = _Found(least, float(times[index]), float(aside[index]), further, size)
            if not (second < self.windows.horizon).any() or (best is not None and not self.spacecraft.limits.blackout):
                break
        return best

    def no_room(self, cones: int) -> str:
        """Why no pulse could be placed."""
        torque, spin, horizon = self.torquer.torque, abs(self.spacecraft.spin), self.windows.horizon
        if torque is not None:
            once = 2.0 * torque / spin
            axes = self.axes(self.moments()[:SAMPLES])
            if len(axes) == 0:
                return "no time is left between limits.earliest and limits.horizon"
            if cones == 1:
                sizes = pointing.two_jumps(self.A, self.h, self.momentum, axes, self.target)
                needed = float(np.maximum(sizes.first, sizes.second).min())
            else:
                middle, _ = pointing.half_cone(self.h, axes, self.target, cones)
                needed = float(np.linalg.norm(middle - self.momentum, axis=1).min())
            if needed > once:
                return (
                    f"one pulse turns H by {turn_of(self.spacecraft, once)} at most (2M/|ω3|, the torque being fixed "
                    f"in the body), and {turn_of(self.spacecraft, needed)} are needed at once; half-cone with more "
                    "cones or rhumb-line take less"
                )
        return (
            f"the pulses of {cones} half cone{'s' if cones > 1 else ''} find no room within the {horizon:.4g} s up to "
            "limits.horizon, the gap and the blackout windows"
        )


class _Found(NamedTuple):
    cost: float
    moment: float
    aside: float
    further: int
    jumps: float


def _descend(cost: Callable[[Vector], Vector], point: Vector, steps: Vector) -> Vector:
    """The least ``cost`` (points (n, k) -> (n,)) near ``point`` (k,), by a compass that narrows from ``steps`` (k,)."""
    rose = np.vstack([np.diag(steps), -np.diag(steps)])
    rose = rose[np.any(rose != 0.0, axis=1)]
    best = float(cost(point[None, :])[0])
    narrowed = 1.0
    for _ in range(COMPASS_STEPS if len(rose) else 0):
        if narrowed <= NARROWEST:
            break
        around = point + narrowed * rose
        costs = cost(around)
        index = int(np.argmin(costs))
        if costs[index] < best * (1.0 - ROUNDING):
            best, point = float(costs[index]), around[index]
        else:
            narrowed *= 0.5
    return point
