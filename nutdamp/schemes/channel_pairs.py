"""Two pulses of body-fixed channels that leave no nutation, with H where it was or on a target.

Pairs are found for ideal impulses, and corrected on the flown motion with their real widths.

H where it was (Magnus 1970 after (22)): of torque directions d1, d2 the shift of H closes to first
order whenever ω3 Δt = π + arg d1 - arg d2 (mod 2π). Both pulses together then oppose ω at a cost of
1/cos(ψ/2), where ψ is the angle by which the second direction misses the one that is needed.

H on a target: the time of the first pulse alone determines the jump after which H has the component
C|ω3| along the target that it keeps when the spin axis comes there; times are kept at which the
second channel then points the right way.
"""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from nutdamp.common import work
from nutdamp.common.results import note
from nutdamp.errors import Infeasible, TooShort
from nutdamp.flight.dynamics import free_coast
from nutdamp.physics import attitude, response
from nutdamp.physics import body as rigid_body
from nutdamp.schemes import correction
from nutdamp.schemes.correction import ALIGNED, components, tolerable
from nutdamp.spacecraft.constraints import (
    Windows,
    at_hand,
    bounded_by,
    commandable,
    for_pairs,
    keeps_limits,
    longest_useful,
)
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import Pulse, Schedule, channel_pulse

# Factors of cost and of what is out of reach within which candidates count as equal: of those the
# one that ends first is preferred.
CLOSE_IN_COST, CLOSE_IN_SHORT = 1.02, 1.1
SHORTLIST = 6  # candidates that are flown and corrected, at most
EXACT = 1e-11  # rad of flown residual below which a candidate is as good as exact (6e-10 deg)
FADED = 1e-6  # share of A|ω0| below which pulses have nothing to do
CLEARLY = 0.5  # residual, over that of an earlier candidate, with which a dearer one is taken

# Cost over A|ω0| of pairs that are looked at: the second pulse would mostly undo the first.
DEAREST = 2.0
MANY = 2000  # closings of H looked at for each pair one by one
STILL = 0.1  # rad that channels turn by in half a nutation turn, below which they stand in space

# Cost over the floor of pairs to a target that are looked at.
DEAREST_TURN = 3.0
# Moments looked at in each turn of the body, and turns within which the first pulse comes, at most.
BODY_SAMPLES, BODY_TURNS = 96, 24
FURTHER_TURNS = 60  # further whole turns that the second pulse may wait for, at most
PAIR = 5e-5  # units of `work` of each moment of each pair of channels
# Share of its natural size below which the first jump counts as nothing, and the distance beside
# the target, over the angles at hand, of a search that finds nothing on it.
ON_CONE, BESIDE = 1e-3, 0.05


class PairCandidate(NamedTuple):
    """Two channels with centre and on-time (s) of a pulse of each, which close to first order."""

    cost: float
    end: float
    channels: tuple[Channel, Channel]
    timing: tuple[tuple[float, float], tuple[float, float]]
    short: float = 0.0  # part of the impulse out of reach
    miss: float = 0.0  # ψ, rad
    factor: float = 1.0  # impulse over A|ω0|


class CorrectedPair(NamedTuple):
    """Schedule of a candidate, and what its flight leaves, rad."""

    candidate: PairCandidate
    schedule: Schedule
    left: float


def corrected(
    spacecraft: Spacecraft, candidates: Iterable[PairCandidate], *, literal: bool = False
) -> Iterator[CorrectedPair]:
    """The most promising candidates within the limits, corrected but where ``literal``."""
    every = list(candidates)
    least = min(every, key=lambda each: (each.short, each.cost), default=None)

    def rank(each: PairCandidate) -> tuple[float, ...]:
        assert least is not None
        behind = each.short > CLOSE_IN_SHORT * least.short or each.cost > CLOSE_IN_COST * least.cost
        return (1.0, each.short, each.cost) if behind else (0.0, each.end)

    for candidate in sorted(every, key=rank)[:SHORTLIST]:
        pairs = zip(candidate.channels, candidate.timing, strict=True)
        pulses = (commandable(spacecraft, channel_pulse(each, *timing)) for each, timing in pairs)
        schedule = Schedule(tuple(pulses))
        if not literal:
            schedule = correction.correct(spacecraft, schedule, chosen=(0, 1), momentum=True)
        if keeps_limits(spacecraft, schedule.pulses):
            yield CorrectedPair(candidate, schedule, correction.left(spacecraft, schedule))


def best_of(pairs: Iterable[CorrectedPair]) -> CorrectedPair | None:
    """First pair that is exact, else the one that none behind beats clearly."""
    best: CorrectedPair | None = None
    for pair in pairs:
        if best is None or pair.left < CLEARLY * best.left:
            best = pair
        if best.left <= EXACT:
            break
    return best


# --- H where it was


def damping(spacecraft: Spacecraft, halves: rigid_body.HalfPulses, *, literal: bool) -> Schedule:
    """The best pair that leaves H where it was, of pulses like these ``halves``."""
    channels = at_hand(spacecraft, for_pairs(spacecraft))
    best = best_of(damping_pairs(spacecraft, halves, literal=literal))
    names = ", ".join(channel.name for channel in channels)
    if best is not None:
        return best.schedule
    still = spacecraft.nutation_rate == 0.0
    schedule = _standing(spacecraft, channels, halves) if still else None
    if schedule is not None:
        return schedule
    if still:
        raise Infeasible(
            f"ω does not turn in this body, and no channel ({names}) can oppose it twice, "
            f"half a turn of the axis about H apart, within {bounded_by(spacecraft)}; a "
            "steerable torquer can work"
        )
    damped = ", before dissipation damps it" if spacecraft.growth < 0.0 else ""
    raise Infeasible(
        f"no pair of the channels ({names}) both opposes the nutation and brings H back "
        f"within {bounded_by(spacecraft)}{damped}"
    )


def damping_pairs(
    spacecraft: Spacecraft, halves: rigid_body.HalfPulses, *, literal: bool
) -> Iterator[CorrectedPair]:
    """The most promising pairs that leave H where it was, with a note each."""
    channels = for_pairs(spacecraft)
    candidates = (
        candidate
        for pair in itertools.product(channels, channels)
        for candidate in _closing(spacecraft, pair, halves, literal)
    )
    for pair in corrected(spacecraft, candidates, literal=literal):
        candidate, schedule, _ = pair
        first, second = schedule.pulses
        notes = [
            note(
                "half-turns-apart",
                first=first.channel,
                second=second.channel,
                half_turns=f"{(second.t - first.t) / halves.wait:.2f}",
                off_deg=abs(math.degrees(candidate.miss)),
                ratio=f"{candidate.factor:.3f}",
            )
        ]
        if candidate.short > 1e-9:
            notes.append(note("on-times-miss", short_percent=100.0 * candidate.short))
        yield pair._replace(schedule=replace(schedule, notes=tuple(notes)))


def _closing(
    spacecraft: Spacecraft,
    pair: tuple[Channel, Channel],
    halves: rigid_body.HalfPulses,
    literal: bool,
) -> Iterator[PairCandidate]:
    """Closings of H for this pair within the horizon."""
    inertia, turning, horizon = spacecraft.inertia, spacecraft.nutation_rate, spacecraft.horizon
    turn = cmath.phase(pair[1].transverse * pair[0].transverse.conjugate())  # arg d2 - arg d1
    # Rate of d as seen from H while half the nutation is left: ω3 at small angles, exact for the
    # aligned pair.
    equivalent = inertia.equivalent(spacecraft.spin)
    rate = turning + inertia.C / inertia.A * equivalent / math.cos(0.5 * spacecraft.nutation)
    to_go = math.pi - turn
    waits = np.zeros(0)
    if literal:  # the pair must do with the direction that it finds after an odd number of halves
        waits = halves.wait * np.arange(
            1.0, min(max(horizon / halves.wait, 1.0), 2.0 * MANY) + 1.0, 2.0
        )
    elif rate != 0.0:
        each = 2.0 * math.pi / abs(rate)
        waits = _recurring(to_go * math.copysign(1.0, rate) / abs(rate) % each, each, horizon)
    if not literal and abs(rate) * math.pi < STILL * abs(turning):
        # They close whenever the second opposes ω as the first does.
        each = spacecraft.body_period
        opposed = _recurring(-turn / turning % each, each, horizon)
        off = np.angle(np.exp(1j * (to_go - rate * opposed)))
        waits = np.union1d(waits, opposed[np.abs(off) < STILL])
    miss = np.angle(np.exp(1j * (turn + turning * waits)))
    factor = 1.0 / np.cos(0.5 * miss)
    # Worth placing: each wait clearly cheaper than all before it, and the cheapest few.
    before = np.concatenate([[np.inf], np.minimum.accumulate(factor)[:-1]])
    worth = factor * CLOSE_IN_COST < before
    worth[np.argsort(factor, kind="stable")[:SHORTLIST]] = True
    for index in np.flatnonzero(worth & (factor <= DEAREST)):
        wait, off = float(waits[index]), float(miss[index])
        placed = _placed(spacecraft, pair, halves, wait, off, literal=literal)
        if placed is not None:
            yield placed


def _recurring(first: float, period: float, horizon: float) -> Vector:
    """Times, s, from the ``first`` on and before the ``horizon``, at most `MANY`."""
    return np.arange(first, min(horizon, first + MANY * period), period)[:MANY]


def _placed(
    spacecraft: Spacecraft,
    pair: tuple[Channel, Channel],
    halves: rigid_body.HalfPulses,
    wait: float,
    miss: float,
    *,
    literal: bool = False,
) -> PairCandidate | None:
    """First allowed moment at which the pair opposes ω; None where the limits leave none."""
    windows, inertia = Windows(spacecraft), spacecraft.inertia
    turning, period = spacecraft.nutation_rate, spacecraft.body_period
    # Both together oppose ω0 where the middle between their directions does.
    omega0 = complex(spacecraft.omega0[0], spacecraft.omega0[1])
    phase = rigid_body.phase_to_oppose(omega0, pair[0].transverse * cmath.exp(0.5j * miss))
    factor = 1.0 if literal else 1.0 / math.cos(0.5 * miss)
    if spacecraft.growth != 0.0 and turning != 0.0 and not literal:
        # What dissipation has made of the nutation half-way between the pulses.
        from nutdamp.physics import energy_sink

        earliest, spin = spacecraft.limits.earliest, spacecraft.spin
        time = earliest + (phase / turning - earliest) % period + 0.5 * wait
        motion = omega0, spin, time, inertia.wheel, spacecraft.sense
        effect = energy_sink.coast(inertia.A, inertia.C, spacecraft.growth, *motion)
        shrunk = float(effect.transverse)
        halves = rigid_body.HalfPulses(shrunk * halves.first, shrunk * halves.second, wait)
        if shrunk < FADED:
            return None
    on_times = list[float]()
    short = 0.0
    for channel, half in zip(pair, halves[:2], strict=True):
        needed, torque = factor * half, abs(channel.transverse)
        slope, longest = inertia.a * channel.axial / inertia.C, channel.max_on_time
        on_time = response.on_time_for(needed, torque, turning, slope, longest)
        on_time = max(on_time or longest_useful(longest, period), channel.min_on_time)
        acts = torque * on_time * abs(response.width_factor(turning, slope, on_time))
        short += abs(needed - acts) / spacecraft.least_impulse / factor
        on_times.append(on_time)
    if short >= 1.0 or wait - 0.5 * sum(on_times) < spacecraft.limits.gap:
        return None
    first = spacecraft.limits.earliest + 0.5 * on_times[0]
    if turning != 0.0:
        first += (phase / turning - first) % period
    elif abs(phase) > ALIGNED:
        return None
    while first + wait + 0.5 * on_times[1] <= windows.horizon:
        timing = ((first, on_times[0]), (first + wait, on_times[1]))
        starts = [centre - 0.5 * on_time for centre, on_time in timing]
        free = map(windows.blocked_until, starts, on_times)
        delay = max((end or start) - start for end, start in zip(free, starts, strict=True))
        if delay == 0.0:
            pulses = Schedule(tuple(map(channel_pulse, pair, *zip(*timing, strict=True))))
            short = short if short > 1e-9 else 0.0
            return PairCandidate(pulses.cost, pulses.end, pair, timing, short, miss, factor)
        first += delay if turning == 0.0 else math.ceil(delay / period) * period
    return None


def _standing(
    spacecraft: Spacecraft, channels: list[Channel], halves: rigid_body.HalfPulses
) -> Schedule | None:
    """A pair of pulses of each channel beside -ω where ω does not turn in the body: it brings H
    back by itself.
    """
    at_leg = spacecraft
    pulses = list[Pulse]()
    inertia, (first, second, spin) = spacecraft.inertia, spacecraft.omega0.tolist()
    left = -inertia.A * complex(first, second)
    for channel, impulse in components(channels, left):
        share = impulse * channel.transverse / abs(channel.transverse)
        omega = share / inertia.A
        at_leg = replace(at_leg, omega0=np.array([-omega.real, -omega.imag, spin]))
        parts = rigid_body.half_pulses(
            inertia.A, inertia.C, abs(omega), inertia.equivalent(spin)
        )._replace(wait=halves.wait)
        placed = _placed(at_leg, (channel, channel), parts, halves.wait, 0.0)
        if placed is None:
            return None
        pairs = zip(placed.channels, placed.timing, strict=True)
        pulses += [commandable(spacecraft, channel_pulse(each, *timing)) for each, timing in pairs]
        at_leg = with_limits(at_leg, earliest=pulses[-1].over + spacecraft.limits.gap)
        left -= share
    if not pulses or abs(left) > ALIGNED * spacecraft.least_impulse:
        return None
    every = range(len(pulses))
    return correction.correct(spacecraft, Schedule(tuple(pulses)), chosen=every, momentum=True)


# --- H on a target


def acquiring(spacecraft: Spacecraft) -> Schedule:
    """The best pair that ends with H and the spin axis on the target; raises Infeasible."""
    channels = at_hand(spacecraft, for_pairs(spacecraft))
    floor = max(spacecraft.least_impulse, spacecraft.turning_impulse)
    target, momentum = spacecraft.target_axis, spacecraft.momentum
    targets = [target]
    h = abs(spacecraft.axial)
    wide = spacecraft.nutation + spacecraft.to_turn
    if abs(h - momentum @ target) <= ON_CONE * wide**2 * h:
        # On the cone of the spin axis one pulse would do, and real pulses have two widths to
        # correct: pairs for targets beside it.
        side = np.cross(momentum, target)
        beside = (side, -side, np.cross(side, target), -np.cross(side, target))
        moved = [
            target + BESIDE * wide * each / max(float(np.linalg.norm(each)), 1e-300)
            for each in beside
        ]
        targets = [each / float(np.linalg.norm(each)) for each in moved]
    candidates = (
        candidate
        for each in targets
        for channel in channels
        if not work.exhausted()
        for candidate in _meeting(spacecraft, channel, channels, each, floor)
    )
    best = best_of(corrected(spacecraft, candidates))
    if best is None or best.left > tolerable(spacecraft):
        names = ", ".join(channel.name for channel in channels)
        # Where both pulses together are too weak no other limit is the cause.
        from nutdamp.schemes.sequential import reach, strongest_turn  # no pair

        kind = Infeasible if 2.0 * reach(spacecraft) < floor else TooShort
        raise kind(
            f"no pair of the channels ({names}) ends on the target within "
            f"{bounded_by(spacecraft)}; {strongest_turn(spacecraft)}"
        )
    first, second = best.schedule.pulses
    wait = second.t - first.t
    ratio = f"{best.schedule.total_impulse / floor:.3f}"
    told = note("pulse-pair", first=first.channel, second=second.channel, wait_s=wait, ratio=ratio)
    return replace(best.schedule, notes=(told,))


def _meeting(
    spacecraft: Spacecraft, one: Channel, channels: list[Channel], target: Vector, floor: float
) -> Iterator[PairCandidate]:
    """Pairs, first of channel ``one``, whose ideal impulses bring H and the spin axis together on
    the ``target`` within the limits, the cheapest of each number of further turns.
    """
    windows, limits = Windows(spacecraft), spacecraft.limits
    h, momentum, A = abs(spacecraft.axial), spacecraft.momentum, spacecraft.inertia.A
    # Moments of the first pulse, s: some turns from the earliest start and from each window on.
    step = 2.0 * math.pi / spacecraft.fastest / BODY_SAMPLES
    ends = [limits.earliest, *(end for _, end in limits.blackout if end > limits.earliest)]
    del ends[BODY_TURNS:]
    span = np.arange(BODY_SAMPLES * max(BODY_TURNS // len(ends), 2)) * step
    times = np.unique(np.concatenate([end + span for end in ends]))
    times = times[times <= windows.horizon]
    from nutdamp.physics import precession  # turns

    # The jump after which H has the component h along the target, the coast until the spin axis is
    # there, and the second jump: as an inertial vector, and in the body.
    direction = one.transverse / abs(one.transverse)
    _, quaternions = free_coast(spacecraft.inertia, spacecraft.initial).motion(times)
    push = attitude.rotate(quaternions, np.array([direction.real, direction.imag, 0.0]))
    axes = attitude.rotate(quaternions, np.array([0.0, 0.0, spacecraft.sense]))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        jump = (h - momentum @ target) / (push @ target)
        jump = np.where((jump >= 0.0) & (jump <= DEAREST_TURN * floor), jump, np.nan)
        middle = momentum + jump[:, None] * push
        wait, turn = precession.coast(A, middle, axes, target)
        last = h * target - middle
        size = np.linalg.norm(last, axis=1)
        # The attitude when the spin axis is on the target: about H, and about axis 3, as on any
        # arc.
        along = np.linalg.norm(middle, axis=1)
        half = 0.5 * along / A * wait
        turned = np.column_stack([np.cos(half), (np.sin(half) / along)[:, None] * middle])
        back = attitude.conjugate(attitude.multiply(turned, quaternions))
        across = attitude.rotate(back, last)
    turning = spacecraft.nutation_rate
    promising = (jump + size <= DEAREST_TURN * floor)[:-1] & (np.diff(times) < 1.5 * step)
    known = all(channel.mass_flow is not None for channel in channels)
    for further in range(FURTHER_TURNS):
        waits = wait + further * turn
        if not np.nanmin(times + waits, initial=np.inf) < windows.horizon:
            break
        work.spend(PAIR * len(times) * len(channels))
        needed = (across[:, 0] + 1j * across[:, 1]) * np.exp(-1j * turning * waits)
        for two in channels:
            off = np.angle(needed * two.transverse.conjugate())
            near = np.abs(off) < 0.5 * math.pi
            crosses = promising & near[:-1] & near[1:] & (off[:-1] * off[1:] <= 0.0)
            rows = np.flatnonzero(crosses)
            if not len(rows):
                continue
            before, after = off[rows], off[rows + 1]
            share = np.where(before == after, 0.5, before / (before - after + (before == after)))
            first, second, *jumps = (
                values[rows] + share * (values[rows + 1] - values[rows])
                for values in (times, times + waits, jump, size)
            )
            long, longer = (
                precession.on_times_to_turn(each, abs(channel.transverse), spacecraft.spin)
                for each, channel in zip(jumps, (one, two), strict=True)
            )
            with np.errstate(invalid="ignore"):
                allowed = (long >= one.min_on_time) & (long <= one.max_on_time)
                allowed &= (longer >= two.min_on_time) & (longer <= two.max_on_time)
            ready = first + 0.5 * long + limits.gap
            allowed &= windows.allowed(first - 0.5 * long, long, limits.earliest)
            allowed &= windows.allowed(second - 0.5 * longer, longer, ready)
            prices = [channel.cost_rate(by_propellant=known) for channel in (one, two)]
            cost = prices[0] * long + prices[1] * longer
            for row in np.flatnonzero(allowed)[np.argsort(cost[allowed])][:SHORTLIST]:
                timing = (
                    (float(first[row]), float(long[row])),
                    (float(second[row]), float(longer[row])),
                )
                end = timing[1][0] + 0.5 * timing[1][1]
                yield PairCandidate(float(cost[row]), end, (one, two), timing)
