"""Two pulses that leave no nutation, with H and the spin axis on the target axis: from any motion, exact at any angle.

A steerable torquer is placed by `steerable_pair`. Body-fixed channels are searched: for the first, its moment alone
says how large its jump of H must be for H to have the component C|ω3| along the target that it keeps when the spin axis
comes there; the moments are kept at which the second channel then points the right way. Both are corrected on the real
widths.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp import work
from nutdamp.errors import Infeasible
from nutdamp.limits import Windows, for_pairs, keeps_limits
from nutdamp.motion import Arc
from nutdamp.physics import attitude, pointing
from nutdamp.schedule import Pulse, Schedule
from nutdamp.schemes.tools import least_squares
from nutdamp.schemes.tools.flown_builder import tolerable
from nutdamp.schemes.tools.reasons import at_hand, turn_of
from nutdamp.schemes.tools.steerable_pair import SteerablePair
from nutdamp.schemes.tools.symmetric_model import model_of
from nutdamp.spacecraft import Channel, Spacecraft, Vector

DEAREST = 3.0
"""Pairs that cost more than this times the floor are not looked at."""

CLOSE_IN_COST = 1.02
"""Among candidates within this factor of the cheapest the one that ends first is preferred."""

SHORTLIST = 8
"""Candidates that are flown and corrected, at most."""

SAMPLES = 96
"""Moments looked at in each turn of the body."""

TURNS = 24
"""Turns of the body within which the first pulse comes, at most."""

FURTHER = 60
"""Further whole turns of the spin axis that the second pulse may wait for, at most."""

PAIR = 5e-5
"""Units of `work` of each moment of each pair of channels."""

ON_CONE = 1e-3
"""Share of its natural size below which the first jump counts as nothing."""

BESIDE = 0.05
"""How far beside the target, as a share of the angles at hand, a search goes that would find nothing on it."""


def schedule(spacecraft: Spacecraft, *, straight: bool = False) -> Schedule:
    """The two pulses; ``straight``: by one half cone on the great circle, where a torquer leaves the choice.

    Raises Infeasible with the reason.
    """
    most = spacecraft.limits.max_pulses
    if most is not None and most < 2:
        raise Infeasible(f"two pulses are needed, and limits.max_pulses allows {most}")
    torquer = spacecraft.torquer
    if torquer is not None:
        made = Schedule(SteerablePair(spacecraft, torquer).two(straight))
        if spacecraft.limits.tick is not None and not keeps_limits(spacecraft, made.pulses):
            raise Infeasible(_off_limits())
        if torquer.torque is not None or not model_of(spacecraft).exact:
            made = least_squares.correct(spacecraft, made, chosen=range(len(made)), momentum=True)
        return _checked(spacecraft, made)
    return _fixed(spacecraft, at_hand(spacecraft, for_pairs(spacecraft)))


def _checked(spacecraft: Spacecraft, made: Schedule) -> Schedule:
    """The schedule, if it keeps the limits and comes near the target."""
    if not keeps_limits(spacecraft, made.pulses):
        raise Infeasible(_off_limits())
    if not _left(spacecraft, made) <= tolerable(spacecraft):
        raise Infeasible(_too_wide(spacecraft, made.pulses))
    return made


def _off_limits() -> str:
    return "with commands on the ticks of limits.tick the two pulses touch another limit"


def _too_wide(spacecraft: Spacecraft, pulses: tuple[Pulse, ...]) -> str:
    widest = max((abs(spacecraft.spin) * pulse.on_time for pulse in pulses), default=0.0)
    if widest == 0.0:
        return "placed for free motion of a symmetric body, two impulses could not be corrected to end on the target"
    return (
        f"two pulses as wide as these (the body turns by {math.degrees(widest):.3g}° during one) do not end on the "
        "target; half-cone with more cones or rhumb-line take smaller ones"
    )


def _left(spacecraft: Spacecraft, made: Schedule) -> float:
    return float(np.linalg.norm(least_squares.misses(spacecraft, made)))


# --- body-fixed channels ---------------------------------------------------------------------------------------------


class Candidate(NamedTuple):
    """Two channels, the moments (s) at which ideal impulses of theirs acquire the target, and their on-times (s)."""

    cost: float
    end: float
    channels: tuple[Channel, Channel]
    timing: tuple[tuple[float, float], tuple[float, float]]


def _fixed(spacecraft: Spacecraft, channels: list[Channel]) -> Schedule:
    """Fly and correct the most promising candidates; the smallest flown residual wins, exact ones in order."""
    search = _Search(spacecraft, channels)
    candidates = sorted(search.all_candidates(), key=lambda found: found.cost)
    if not candidates:
        raise Infeasible(search.reason())
    near = [one for one in candidates if one.cost <= candidates[0].cost * CLOSE_IN_COST]
    near.sort(key=lambda found: found.end)
    others = [one for one in candidates if one.cost > candidates[0].cost * CLOSE_IN_COST]
    best, _ = least_squares.best_of(spacecraft, _tried(spacecraft, [*near[: SHORTLIST // 2], *others][:SHORTLIST]))
    if best is None:
        raise Infeasible(search.reason())
    made = _checked(spacecraft, best)
    floor = max(spacecraft.least_impulse, spacecraft.turning_impulse)
    one, two = (pulse.channel for pulse in made)
    note = f"{one} then {two} after {made.pulses[1].t - made.pulses[0].t:.4g} s"
    return Schedule(made.pulses, (f"{note}; {made.total_impulse / floor:.3f} × the floor max(A|ω0|, C|ω3|β)",))


def _tried(spacecraft: Spacecraft, candidates: list[Candidate]) -> Iterator[tuple[Schedule, float]]:
    """The candidates, corrected on the flown motion, with the residual (rad) that each leaves."""
    for candidate in candidates:
        made = least_squares.fired(spacecraft, candidate.channels, candidate.timing)
        if spacecraft.limits.tick is None or keeps_limits(spacecraft, made.pulses):
            made = least_squares.correct(spacecraft, made, chosen=(0, 1), momentum=True)
            yield made, _left(spacecraft, made)


Indices = NDArray[np.intp]


class _Search:
    """Pairs of channels and moments at which ideal impulses acquire the target."""

    def __init__(self, spacecraft: Spacecraft, channels: list[Channel]) -> None:
        self.spacecraft, self.channels, self.windows = spacecraft, channels, Windows(spacecraft)
        inertia = spacecraft.inertia
        self.A, self.h = inertia.A, inertia.C * abs(spacecraft.spin)
        self.turning = inertia.a * spacecraft.spin
        self.momentum, self.target = spacecraft.momentum, spacecraft.target_axis
        self.floor = max(spacecraft.least_impulse, spacecraft.turning_impulse)
        self.arc = Arc(inertia.A, inertia.C, 0.0, spacecraft.initial)
        self.within_reach = False  # whether a pair closed, before on-times and windows were looked at

    def times(self) -> Vector:
        """Moments (n,) s of the first pulse that are looked at."""
        turn = 2.0 * math.pi / abs(self.spacecraft.spin)
        first = self.spacecraft.limits.earliest
        ends = [first, *(end for _, end in self.spacecraft.limits.blackout if end > first)][:TURNS]
        span = np.arange(SAMPLES * max(TURNS // len(ends), 2)) * (turn / SAMPLES)
        times = np.unique(np.concatenate([end + span for end in ends]))
        return np.asarray(times[times <= self.windows.horizon])

    def after(self, channel: Channel, times: Vector) -> _After:
        """What follows when ``channel`` fires at ``times`` (n,) s as much as it must."""
        direction = channel.transverse / abs(channel.transverse)
        _, quaternions = self.arc.motion(times)
        push = attitude.rotate(quaternions, np.array([direction.real, direction.imag, 0.0]))
        sense = math.copysign(1.0, self.spacecraft.spin)
        axes = attitude.rotate(quaternions, np.array([0.0, 0.0, sense]))
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            first = (self.h - self.momentum @ self.target) / (push @ self.target)
            first = np.where((first >= 0.0) & (first <= DEAREST * self.floor), first, np.nan)
            middle = self.momentum + first[:, None] * push
            wait, turn = pointing.coast(self.A, middle, axes, self.target)
            jump = self.h * self.target - middle
            # The attitude when the spin axis is on the target: about H, and about axis 3, as on any arc.
            half = 0.5 * np.linalg.norm(middle, axis=1) / self.A * wait
            unit = middle / np.linalg.norm(middle, axis=1)[:, None]
            outer = np.concatenate([np.cos(half)[:, None], np.sin(half)[:, None] * unit], axis=1)
            there = attitude.multiply(outer, quaternions)
            back = attitude.rotate(attitude.conjugate(there), jump)
            body = (back[:, 0] + 1j * back[:, 1]) * np.exp(-1j * self.turning * wait)
        return _After(first, np.linalg.norm(jump, axis=1), wait, turn, body)

    def all_candidates(self) -> list[Candidate]:
        """Candidates for the target; where the first jump would be nothing, for targets beside it, to be corrected.

        That is where the target lies on the cone of the spin axis itself.
        """
        wide = self.spacecraft.nutation + self.spacecraft.to_turn
        if abs(self.h - self.momentum @ self.target) > ON_CONE * wide**2 * self.h:
            return self.candidates()
        found, target = [], self.target
        side = np.cross(self.momentum, target)
        for beside in (side, np.cross(side, target)):
            for sense in (1.0, -1.0):
                moved = target + sense * BESIDE * wide * beside / max(float(np.linalg.norm(beside)), 1e-300)
                self.target = moved / float(np.linalg.norm(moved))
                found += self.candidates()
        self.target = target
        return found

    def candidates(self) -> list[Candidate]:
        """The pairs that close and keep the limits, the cheapest of each first channel."""
        times = self.times()
        found: list[Candidate] = []
        if len(times) < 2:
            return found
        adjoining = np.diff(times) < 1.5 * 2.0 * math.pi / abs(self.spacecraft.spin) / SAMPLES
        for one in self.channels:
            if work.exhausted():
                break
            after = self.after(one, times)
            promising = adjoining & (after.first + after.second <= DEAREST * self.floor)[:-1]
            for further in range(FURTHER):
                if not np.nanmin(times + after.wait + further * after.turn, initial=np.inf) < self.windows.horizon:
                    break
                work.spend(PAIR * len(times) * len(self.channels))
                needed = after.body * np.exp(-1j * self.turning * further * after.turn)
                for two in self.channels:
                    off = np.angle(needed * two.transverse.conjugate())
                    near = np.abs(off) < 0.5 * math.pi
                    crosses = np.flatnonzero(promising & near[:-1] & near[1:] & (off[:-1] * off[1:] <= 0.0))
                    found += self._placed(one, two, further, times, after, off, crosses)
        return found

    def _placed(
        self, one: Channel, two: Channel, further: int, times: Vector, after: _After, off: Vector, crosses: Indices
    ) -> list[Candidate]:
        """The pairs at the zeros of ``off`` behind the rows ``crosses``, as far as on-times and limits allow them."""
        if len(crosses) == 0:
            return []
        here, there = off[crosses], off[crosses + 1]
        share = np.where(here == there, 0.5, here / (here - there + (here == there)))

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
        made = []
        for row in np.flatnonzero(allowed):
            timing = ((float(first[row]), float(long[row])), (float(second[row]), float(longer[row])))
            cost = sum(price * on_time for price, (_, on_time) in zip(prices, timing, strict=True))
            made.append(Candidate(cost, timing[1][0] + 0.5 * timing[1][1], (one, two), timing))
        return sorted(made, key=lambda candidate: candidate.cost)[:SHORTLIST]

    def _on_times(self, channel: Channel, jumps: Vector) -> Vector:
        """On-times (n,) s with which ``channel`` turns H by ``jumps`` (n,) N m s; not a number where it cannot."""
        on_times = pointing.on_times_to_turn(jumps, abs(channel.transverse), self.spacecraft.spin)
        outside = (on_times < channel.min_on_time) | (on_times > channel.max_on_time)
        return np.where(outside, np.nan, on_times)

    def reason(self) -> str:
        """Why there is no candidate."""
        names = ", ".join(channel.name for channel in self.channels)
        strongest = max(
            pointing.reach(abs(one.transverse), self.spacecraft.spin, one.max_on_time) for one in self.channels
        )
        if 2.0 * strongest < self.floor:
            return (
                f"one pulse turns H by {turn_of(self.spacecraft, strongest)} at most, and two together would have to "
                f"by {turn_of(self.spacecraft, self.floor)}; half-cone with more cones or rhumb-line take smaller ones"
            )
        if self.within_reach:
            return (
                f"pairs of the channels ({names}) acquire the target, but not within on-times, gap, blackout windows "
                f"and the {self.windows.horizon:.4g} s up to limits.horizon"
            )
        return (
            f"no two of the channels ({names}) push in the right directions, one after the other, in the "
            f"{self.windows.horizon:.4g} s up to limits.horizon; a longer horizon, a steerable torquer or rhumb-line "
            "can help"
        )


class _After(NamedTuple):
    """After a first jump of size ``first``: the second, N m s, the wait and one more turn, s; (n,) each.

    ``body`` (n,) is the second jump in body axes, J1 + iJ2, at the end of the plain wait.
    """

    first: Vector
    second: Vector
    wait: Vector
    turn: Vector
    body: NDArray[np.complex128]
