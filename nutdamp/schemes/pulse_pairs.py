"""Two pulses that leave no nutation, with H and the spin axis on the target axis: from any motion,
exact at any angle.

A steerable torquer is placed for least impulse by `precession`: free are the time of the first
pulse and how far aside H goes between two. Body-fixed channels are searched: the time of the first
alone determines the jump after which H has the component C|ω3| along the target that it keeps when
the spin axis comes there; times are kept at which the second channel then points the right way.
Both are corrected on the real widths.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from nutdamp.common import work
from nutdamp.common.results import note
from nutdamp.errors import Infeasible
from nutdamp.flight.dynamics import Arc
from nutdamp.physics import attitude, precession
from nutdamp.physics.precession import TwoJumps
from nutdamp.schemes import correction
from nutdamp.schemes.correction import PairCandidate, model_of, shortlist, tolerable
from nutdamp.schemes.sequential import at_hand, turn_of
from nutdamp.spacecraft.constraints import Windows, commandable, for_pairs, keeps_limits
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Spacecraft, SpinState, Vector
from nutdamp.spacecraft.schedule import Pulse, Schedule, steerable_pulse

# turns of the spin axis looked at from the earliest start, and one more from the end of each
# blackout window
SPIN_TURNS = 4
MOST_WINDOWS = 40  # blackout windows after which a turn is looked at
FURTHER_TURNS = 60  # further whole turns that the second pulse may wait for, at most
FURTHER_BESIDE = 12  # the same for the search beside the best places
MOST_BESIDE = 1000  # moments looked at in that search, at most
# share of the first steps at which the search for the best choice ends; the cost is flat there to
# its square
NARROWEST = 1e-7
ROUNDING = 1e-14  # relative gain that counts as one while the best choice is made exact
SMALLEST = 0.1  # least share of both jumps that each real pulse of the two gets
# least sine of half the angle by which the spin axis turns between two real pulses: a sixth of a
# turn to five
APART = 0.5
NOTHING = 1e-12  # jumps below this times C|ω3| are left out
SHORTLIST = 8  # candidates that are flown and corrected, at most
PAIR = 5e-5  # units of `work` of each moment of each pair of channels
ON_CONE = 1e-3  # share of its natural size below which the first jump counts as nothing
# distance beside the target, over the angles at hand, of a search that finds nothing on it
BESIDE = 0.05

SPIN_SAMPLES = 256  # moments looked at in each turn of the spin axis, before the best is made exact
BACKWARD = (
    4  # steps in which a pulse and the place to which it sets back the spin axis are made to agree
)
COMPASS_STEPS = 2000  # steps of that search, at most
EQUAL = 1e-9  # costs that differ by less, relatively, are equal: then the earlier end wins


class SteerablePair:
    """Placement of a steerable torquer from the motion of a ``spacecraft`` at t = 0 to its target
    axis.
    """

    def __init__(self, spacecraft: Spacecraft, torquer: Steerable) -> None:
        self.spacecraft, self.torquer = spacecraft, torquer
        self.A, self.h = spacecraft.inertia.A, abs(spacecraft.axial)
        self.momentum, self.target = spacecraft.momentum, spacecraft.target_axis
        self.start, self.windows = spacecraft.initial, Windows(spacecraft)
        self.step = spacecraft.inertial_period / SPIN_SAMPLES

    def axes(self, times: Vector) -> Vector:
        """Spin axis S at ``times`` (n,) s, (n, 3), inertial."""
        _, quaternions = Arc.of(self.spacecraft.inertia, self.start).motion(times)
        return attitude.rotate(quaternions, np.array([0.0, 0.0, self.spacecraft.sense]))

    def on_times(self, jumps: Vector) -> Vector:
        """On-times (n,) s of pulses that turn H by ``jumps`` (n,) N m s; not a number where no
        pulse can.
        """
        torque, spin = self.torquer.torque, self.spacecraft.spin
        return (
            np.zeros_like(jumps)
            if torque is None
            else precession.on_times_to_turn(jumps, torque, spin)
        )

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
        state = self.start
        now = 0.0
        momentum = self.momentum
        for moment, after in jumps:
            rates, quaternions = Arc.of(self.spacecraft.inertia, state, now).motion(
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
            state = SpinState(
                complex(rates[0, 0], rates[0, 1]) + push / self.A,
                float(rates[0, 2]),
                quaternions[0],
            )
            now, momentum = moment, after
        return tuple(pulses)

    def moments(self) -> Vector:
        """Moments (n,) s of the first pulse worth looking at: four turns, and one after each
        blackout window.
        """
        period, first = self.spacecraft.inertial_period, self.spacecraft.limits.earliest
        turn = np.arange(SPIN_SAMPLES) * self.step
        ends = [end for _, end in self.spacecraft.limits.blackout if end > first][:MOST_WINDOWS]
        parts = [first + number * period + turn for number in range(SPIN_TURNS)] + [
            end + turn for end in ends
        ]
        times = np.unique(np.concatenate(parts))
        return np.asarray(times[times <= self.windows.horizon])

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
            allowed = self.windows.allowed(
                times - 0.5 * on_times, on_times, self.spacecraft.limits.earliest
            )
            spent = self.spent(jumps) + (cones - 1) * self.spent(2.0 * last) + self.spent(last)
            return np.where(allowed & ~np.isnan(spent), spent, np.inf), middle

        times = self.moments()
        costs, _ = cost(times)
        least = float(costs.min(initial=np.inf))
        if not np.isfinite(least):
            raise Infeasible(self.no_room(cones))
        best = times[np.flatnonzero(costs <= least * (1.0 + EQUAL))[:1]]
        moment = _descend(lambda points: cost(points[:, 0])[0], best, np.array([self.step]))
        return self.pulses([(float(moment[0]), cost(moment)[1][0])])

    def two(self, straight: bool = False) -> tuple[Pulse, ...]:
        """Two pulses that end on the target with least impulse; ``straight``: by a half cone,
        without choice.
        """
        times = self.moments()
        free = precession.two_jumps(self.A, self.h, self.momentum, self.axes(times), self.target)
        least = float(np.nanmin(self.spent(free.first) + self.spent(free.second), initial=np.inf))
        if not np.isfinite(least):
            raise Infeasible(self.no_room(1))
        choice = self._best(times, np.zeros(len(times)), straight, FURTHER_TURNS)
        if choice[0] > least * (1.0 + 1e-6) and not straight:
            # The limits forbid the best place: others beside it, by shares of both jumps.
            some = slice(None, None, math.ceil(len(times) / MOST_BESIDE))
            shares = np.linspace(-1.0, 1.0, 41)
            beside = np.repeat(times[some], len(shares)), (shares * free.cost[some, None]).ravel()
            other = self._best(*beside, straight, FURTHER_BESIDE)
            if other[0] < choice[0] * (1.0 - EQUAL):
                choice = other
        cost, place, further, size = choice
        if math.isinf(cost):
            raise Infeasible(self.no_room(1))
        point = _descend(
            lambda points: self._costs(points[:, 0], points[:, 1], further, straight)[0],
            place,
            np.array([self.step, 0.0 if straight else 0.02 * size]),
        )
        _, second, jumps = self._costs(point[:1], point[1:], further, straight)
        return self.pulses(
            [(float(point[0]), jumps.middle[0]), (float(second[0]), self.h * self.target)]
        )

    def _costs(
        self, times: Vector, aside: Vector, further: int, straight: bool
    ) -> tuple[Vector, Vector, TwoJumps]:
        """Impulse (n,) of first pulses at ``times`` (n,) s, infinite where not allowed; moment of
        the second.
        """
        jumps = precession.two_jumps(
            self.A, self.h, self.momentum, self.axes(times), self.target, aside, straight
        )
        second = times + jumps.wait + further * jumps.turn
        long, longer = self.on_times(jumps.first), self.on_times(jumps.second)
        ready = times + 0.5 * long + self.spacecraft.limits.gap
        allowed = self.windows.allowed(times - 0.5 * long, long, self.spacecraft.limits.earliest)
        allowed &= self.windows.allowed(second - 0.5 * longer, longer, ready)
        if self.torquer.torque is not None:
            # Widths are corrected on both pulses: both must be there, and not do the same a whole
            # turn apart.
            allowed &= np.minimum(jumps.first, jumps.second) > SMALLEST * jumps.cost
            allowed &= (
                np.sin(math.pi * jumps.wait / jumps.turn) > APART
            )  # a sixth of a turn to five
        spent = self.spent(jumps.first) + self.spent(jumps.second)
        return np.where(allowed, spent, np.inf), second, jumps

    def _best(
        self, times: Vector, aside: Vector, straight: bool, most: int
    ) -> tuple[float, Vector, int, float]:
        """Cheapest choice with up to ``most`` further turns, of equal ones the first to end.

        Its cost, infinite where there is none; moment of the first pulse, s, and how far aside H
        goes, N m s; further turns, and size of both jumps.
        """
        best = math.inf, np.zeros(2), 0, 0.0
        for further in range(most):
            costs, second, jumps = self._costs(times, aside, further, straight)
            least = float(costs.min())
            if np.isfinite(least) and least < best[0] * (1.0 - EQUAL):
                near = np.flatnonzero(costs <= least * (1.0 + EQUAL))
                index = near[np.argmin(second[near])]
                point = np.array([times[index], aside[index]])
                best = least, point, further, float(jumps.cost[index])
            if not (second < self.windows.horizon).any() or (
                best[0] < math.inf and not self.spacecraft.limits.blackout
            ):
                break
        return best

    def no_room(self, cones: int) -> str:
        """Reason why no pulse could be placed."""
        torque, horizon = self.torquer.torque, self.windows.horizon
        if torque is not None:
            once = precession.reach(torque, self.spacecraft.spin, math.inf)
            axes = self.axes(self.moments()[:SPIN_SAMPLES])
            if len(axes) == 0:
                return "no time is left between limits.earliest and limits.horizon"
            if cones == 1:
                sizes = precession.two_jumps(self.A, self.h, self.momentum, axes, self.target)
                needed = float(np.maximum(sizes.first, sizes.second).min())
            else:
                middle, _ = precession.half_cone(self.h, axes, self.target, cones)
                needed = float(np.linalg.norm(middle - self.momentum, axis=1).min())
            if needed > once:
                return (
                    f"one pulse turns H by {turn_of(self.spacecraft, once)} at most (2M/|ω3|, for "
                    f"a torque fixed in the body), and {turn_of(self.spacecraft, needed)} are "
                    "needed at once; use half-cone with more cones, or rhumb-line"
                )
        return (
            f"the pulses (half cones: {cones}) do not fit into the {horizon:.4g} s up to "
            "limits.horizon with the gap and the blackout windows"
        )


def _descend(cost: Callable[[Vector], Vector], point: Vector, steps: Vector) -> Vector:
    """Least ``cost`` (points (n, k) -> (n,)) near ``point`` (k,), by a compass search narrowing
    from ``steps`` (k,).
    """
    rose = np.vstack([np.diag(steps), -np.diag(steps)])
    rose = rose[np.any(rose != 0.0, axis=1)]
    best = float(cost(point[None, :])[0])
    narrowed = 1.0
    for _ in range(COMPASS_STEPS):
        if narrowed <= NARROWEST:
            break
        around = point + narrowed * rose
        costs = cost(around)
        index = int(np.argmin(costs))
        if costs[index] < best * (1.0 - ROUNDING):
            best = float(costs[index])
            point = around[index]
        else:
            narrowed *= 0.5
    return point


DEAREST = 3.0  # pairs that cost more than this times the floor are not looked at

# Moments looked at in each turn of the body, and turns within which the first pulse comes, at most.
BODY_SAMPLES, BODY_TURNS = 96, 24


def schedule(spacecraft: Spacecraft, *, straight: bool = False) -> Schedule:
    """Two pulses, where so many are allowed; ``straight``: by one half cone, of a torquer. Raises
    Infeasible.
    """
    torquer = spacecraft.torquer
    if torquer is not None:
        schedule = Schedule(SteerablePair(spacecraft, torquer).two(straight))
        kept = spacecraft.limits.tick is None or keeps_limits(spacecraft, schedule.pulses)
        if kept and (torquer.torque is not None or not model_of(spacecraft).exact):
            schedule = correction.correct(
                spacecraft, schedule, chosen=range(len(schedule)), momentum=True
            )
        return _checked(spacecraft, schedule)
    search = _PairSearch(spacecraft, at_hand(spacecraft, for_pairs(spacecraft)))

    def corrected() -> Iterator[tuple[Schedule, float]]:
        """Candidates with the residual (rad) of each."""
        for candidate in shortlist(search.all_candidates(), 4, SHORTLIST):
            schedule = candidate.fired(spacecraft)
            if spacecraft.limits.tick is None or keeps_limits(spacecraft, schedule.pulses):
                schedule = correction.correct(spacecraft, schedule, chosen=(0, 1), momentum=True)
                yield schedule, correction.left(spacecraft, schedule)

    best, _ = correction.best_of(spacecraft, corrected())
    if best is None:
        raise Infeasible(search.reason())
    schedule = _checked(spacecraft, best)
    first, second = schedule.pulses
    wait = second.t - first.t
    ratio = f"{schedule.total_impulse / search.floor:.3f}"
    told = note("pulse-pair", first=first.channel, second=second.channel, wait_s=wait, ratio=ratio)
    return Schedule(schedule.pulses, (told,))


def _checked(spacecraft: Spacecraft, schedule: Schedule) -> Schedule:
    """Schedule, if it keeps the limits and comes near the target."""
    if not keeps_limits(spacecraft, schedule.pulses):
        raise Infeasible("rounded to limits.tick, the two pulses break another limit")
    if correction.left(spacecraft, schedule) <= tolerable(spacecraft):
        return schedule
    widest = max((abs(spacecraft.spin) * pulse.on_time for pulse in schedule), default=0.0)
    if widest == 0.0:
        raise Infeasible(
            "two impulses planned for the free motion of a symmetric body could not be "
            "corrected to end on the target"
        )
    raise Infeasible(
        f"the two pulses are too long (the body turns by {math.degrees(widest):.3g}° "
        "during one) and do not end on the target; use half-cone with more cones, or "
        "rhumb-line"
    )


class _PairSearch:
    """Pairs of channels and moments at which ideal impulses acquire the target."""

    def __init__(self, spacecraft: Spacecraft, channels: list[Channel]) -> None:
        self.spacecraft, self.channels, self.windows = spacecraft, channels, Windows(spacecraft)
        inertia = spacecraft.inertia
        self.A, self.h = inertia.A, abs(spacecraft.axial)
        self.turning = spacecraft.nutation_rate
        self.momentum, self.target = spacecraft.momentum, spacecraft.target_axis
        self.floor = max(spacecraft.least_impulse, spacecraft.turning_impulse)
        self.arc = Arc.of(inertia, spacecraft.initial)
        self.within_reach = (
            False  # whether a pair closed, before on-times and windows were looked at
        )

    def after(self, channel: Channel, times: Vector) -> tuple[TwoJumps, NDArray[np.complex128]]:
        """Jumps, the first by ``channel`` at ``times`` (n,) s, and the second in the body after the
        wait, J1 + iJ2.
        """
        direction = channel.transverse / abs(channel.transverse)
        _, quaternions = self.arc.motion(times)
        push = attitude.rotate(quaternions, np.array([direction.real, direction.imag, 0.0]))
        axes = attitude.rotate(quaternions, np.array([0.0, 0.0, self.spacecraft.sense]))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            first = (self.h - self.momentum @ self.target) / (push @ self.target)
            first = np.where((first >= 0.0) & (first <= DEAREST * self.floor), first, np.nan)
            middle = self.momentum + first[:, None] * push
            wait, turn = precession.coast(self.A, middle, axes, self.target)
            jump = self.h * self.target - middle
            # The attitude when the spin axis is on the target: about H, and about axis 3, as on any
            # arc.
            half = 0.5 * np.linalg.norm(middle, axis=1) / self.A * wait
            unit = middle / np.linalg.norm(middle, axis=1)[:, None]
            outer = np.concatenate([np.cos(half)[:, None], np.sin(half)[:, None] * unit], axis=1)
            there = attitude.multiply(outer, quaternions)
            back = attitude.rotate(attitude.conjugate(there), jump)
            body = (back[:, 0] + 1j * back[:, 1]) * np.exp(-1j * self.turning * wait)
        return TwoJumps(middle, first, np.linalg.norm(jump, axis=1), wait, turn), body

    def all_candidates(self) -> Iterator[PairCandidate]:
        """Candidates for the target; where that lies on the cone of the spin axis, for targets
        beside it.
        """
        wide = self.spacecraft.nutation + self.spacecraft.to_turn
        if abs(self.h - self.momentum @ self.target) > ON_CONE * wide**2 * self.h:
            yield from self.candidates()
            return
        target = self.target
        side = np.cross(self.momentum, target)
        for beside, sense in product((side, np.cross(side, target)), (1.0, -1.0)):
            moved = target + sense * BESIDE * wide * beside / max(
                float(np.linalg.norm(beside)), 1e-300
            )
            self.target = moved / float(np.linalg.norm(moved))
            yield from self.candidates()

    def candidates(self) -> Iterator[PairCandidate]:
        """Pairs that close and keep the limits, the cheapest of each first channel."""
        turn = 2.0 * math.pi / self.spacecraft.fastest
        first = self.spacecraft.limits.earliest
        ends = [first, *(end for _, end in self.spacecraft.limits.blackout if end > first)][
            :BODY_TURNS
        ]
        span = np.arange(BODY_SAMPLES * max(BODY_TURNS // len(ends), 2)) * (turn / BODY_SAMPLES)
        times = np.unique(np.concatenate([end + span for end in ends]))  # of the first pulse, s
        times = np.asarray(times[times <= self.windows.horizon])
        if len(times) < 2:
            return
        adjoining = np.diff(times) < 1.5 * turn / BODY_SAMPLES
        for one in self.channels:
            if work.exhausted():
                break
            after, body = self.after(one, times)
            promising = adjoining & (after.cost <= DEAREST * self.floor)[:-1]
            for further in range(FURTHER_TURNS):
                if (
                    not np.nanmin(times + after.wait + further * after.turn, initial=np.inf)
                    < self.windows.horizon
                ):
                    break
                work.spend(PAIR * len(times) * len(self.channels))
                needed = body * np.exp(-1j * self.turning * further * after.turn)
                for two in self.channels:
                    off = np.angle(needed * two.transverse.conjugate())
                    near = np.abs(off) < 0.5 * math.pi
                    crosses = np.flatnonzero(
                        promising & near[:-1] & near[1:] & (off[:-1] * off[1:] <= 0.0)
                    )
                    if len(crosses) > 0:
                        yield from self._placed(one, two, further, times, after, off, crosses)

    def _placed(
        self,
        one: Channel,
        two: Channel,
        further: int,
        times: Vector,
        after: TwoJumps,
        off: Vector,
        crosses: NDArray[np.intp],
    ) -> list[PairCandidate]:
        """Pairs at the zeros of ``off`` behind the rows ``crosses``, within on-times and limits."""
        at_leg, there = off[crosses], off[crosses + 1]
        share = np.where(at_leg == there, 0.5, at_leg / (at_leg - there + (at_leg == there)))

        def at(values: Vector) -> Vector:
            return np.asarray(values[crosses] + share * (values[crosses + 1] - values[crosses]))

        first = at(times)
        second = first + at(after.wait) + further * at(after.turn)
        long, longer = self._on_times(one, at(after.first)), self._on_times(two, at(after.second))
        self.within_reach = True
        ready = first + 0.5 * long + self.spacecraft.limits.gap
        allowed = self.windows.allowed(first - 0.5 * long, long, self.spacecraft.limits.earliest)
        allowed &= self.windows.allowed(second - 0.5 * longer, longer, ready)
        known = all(channel.mass_flow is not None for channel in self.channels)
        prices = [channel.cost_rate(by_propellant=known) for channel in (one, two)]
        pairs = []
        for row in np.flatnonzero(allowed):
            timing = (
                (float(first[row]), float(long[row])),
                (float(second[row]), float(longer[row])),
            )
            cost = sum(price * on_time for price, (_, on_time) in zip(prices, timing, strict=True))
            pairs.append(PairCandidate(cost, timing[1][0] + 0.5 * timing[1][1], (one, two), timing))
        return sorted(pairs, key=lambda candidate: candidate.cost)[:SHORTLIST]

    def _on_times(self, channel: Channel, jumps: Vector) -> Vector:
        """On-times (n,) s with which ``channel`` turns H by ``jumps`` (n,) N m s; not a number
        beyond its reach.
        """
        on_times = precession.on_times_to_turn(jumps, abs(channel.transverse), self.spacecraft.spin)
        outside = (on_times < channel.min_on_time) | (on_times > channel.max_on_time)
        return np.where(outside, np.nan, on_times)

    def reason(self) -> str:
        """Reason why there is no candidate."""
        names = ", ".join(channel.name for channel in self.channels)
        strongest = max(
            precession.reach(abs(channel.transverse), self.spacecraft.spin, channel.max_on_time)
            for channel in self.channels
        )
        if 2.0 * strongest < self.floor:
            return (
                f"one pulse turns H by {turn_of(self.spacecraft, strongest)} at most, and the "
                f"two must turn it by {turn_of(self.spacecraft, self.floor)}; use half-cone "
                "with more cones, or rhumb-line"
            )
        if self.within_reach:
            return (
                f"pairs of the channels ({names}) can reach the target, but not with the "
                f"on-times, gap, blackout windows and {self.windows.horizon:.4g} s up to "
                "limits.horizon"
            )
        return (
            f"no pair of the channels ({names}) pushes in the right directions within the "
            f"{self.windows.horizon:.4g} s up to limits.horizon; try a longer horizon, a "
            "steerable torquer or rhumb-line"
        )
