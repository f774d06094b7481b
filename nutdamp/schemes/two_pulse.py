"""Two pulses half an inertial nutation turn apart, Magnus 1970 (22): no nutation, and H back where
it was.

With a steerable torquer the pulses are exact at any angle. Of two channels with torque directions
d1, d2 the momentum shift closes to first order whenever ω3 Δt = π + arg d1 - arg d2 (mod 2π), and
both pulses together then oppose ω at a cost of 1/cos(ψ/2), where ψ is the angle by which the second
direction misses the one that Magnus' scheme needs. With a target axis the two pulses are those of
`pulse_pairs`, of which these are the case that H is to stay.
"""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from nutdamp.common.results import note
from nutdamp.errors import Infeasible
from nutdamp.physics import body as rigid_body
from nutdamp.physics import response
from nutdamp.schemes import correction
from nutdamp.schemes.catalogue import TwoPulseOptions
from nutdamp.schemes.correction import (
    ALIGNED,
    CLOSE_IN_COST,
    FADED,
    PairCandidate,
    model_of,
    tolerable,
)
from nutdamp.spacecraft.constraints import Windows, for_pairs, keeps_limits, longest_useful
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import TOUCHING, Pulse, Schedule, channel_pulse

# pairs that cost more than this times A|ω0| are not looked at: the second pulse would mostly undo
# the first
DEAREST = 2.0

MANY = 2000  # closings of H looked at for each pair one by one
SHORTLIST = 6  # candidates that are flown and corrected, at most


def schedule(spacecraft: Spacecraft, options: TwoPulseOptions) -> Schedule:
    """Two pulses, and a note on the cost or residual of fixed channels.

    ``options.literal``: equal halves and the wait as printed, not corrected, and the target left
    alone. Raises Infeasible with the reason.
    """
    most = spacecraft.limits.max_pulses
    if most is not None and most < 2:
        raise Infeasible(f"two pulses are needed, and limits.max_pulses allows {most}")
    if spacecraft.goal.axis is None or options.literal:
        return _damping(spacecraft, options)
    try:
        from nutdamp.schemes import pulse_pairs  # here, because few plans have a target

        return pulse_pairs.schedule(spacecraft)
    except Infeasible:
        # A pulse over a large part of a spin turn hardly turns H and still takes nutation out:
        # where pulses as wide as that are all there is, damping corrected to a target nearby finds
        # what an acquisition, for the turn, does not.
        if spacecraft.to_turn < spacecraft.nutation:
            with suppress(Infeasible):
                damping = _damping(spacecraft, options)
                if correction.left(spacecraft, damping) <= tolerable(spacecraft):
                    return damping
        raise


def _damping(spacecraft: Spacecraft, options: TwoPulseOptions) -> Schedule:
    """Two pulses that leave H where it was; where all break a limit, the first of them: the judge
    says which.
    """
    if spacecraft.torquer is not None:
        return _steered(spacecraft, spacecraft.torquer, options)
    channels = for_pairs(spacecraft)
    if not channels:
        from nutdamp.schemes.sequential import at_hand  # it has the reason

        at_hand(spacecraft, channels)
    best, broken = correction.best_of(spacecraft, _shortlist(spacecraft, channels, options))
    schedule = best or broken
    if schedule is None and spacecraft.nutation_rate == 0.0:
        schedule = _standing(spacecraft, channels)
    if schedule is not None:
        return schedule
    from nutdamp.schemes.sequential import bounded_by  # it has the reason

    names = ", ".join(channel.name for channel in channels)
    if spacecraft.nutation_rate == 0.0:
        raise Infeasible(
            f"ω does not turn in this body, and no channel ({names}) can oppose it twice, "
            f"half a turn of the axis about H apart, within {bounded_by(spacecraft)}; a "
            "steerable torquer can work"
        )
    if _grown(spacecraft, spacecraft.limits.earliest + 0.25 * spacecraft.body_period) < FADED:
        raise Infeasible(f"dissipation damps the nutation before the channels ({names}) oppose it")
    bounds = bounded_by(spacecraft)
    raise Infeasible(
        f"no pair of the channels ({names}) both opposes the nutation and brings H back "
        f"within {bounds}"
    )


def _standing(spacecraft: Spacecraft, channels: list[Channel]) -> Schedule | None:
    """A pair of pulses of each channel beside -ω where ω does not turn in the body: it brings H
    back by itself.
    """
    from nutdamp.schemes.sequential import components  # ω stands still in the body

    wait = _halves(spacecraft).wait
    at_leg = spacecraft
    pulses = list[Pulse]()
    A, (first, second, spin) = spacecraft.inertia.A, spacecraft.omega0.tolist()
    left = -A * complex(first, second)
    for channel, impulse in components(channels, left):
        share = impulse * channel.transverse / abs(channel.transverse)
        at_leg = replace(at_leg, omega0=np.array([-share.real / A, -share.imag / A, spin]))
        placed = _place(at_leg, (channel, channel), wait, 0.0, literal=False)
        if placed is None:
            return None
        pulses += placed.fired(spacecraft)
        earliest = pulses[-1].over + spacecraft.limits.gap
        at_leg = with_limits(at_leg, earliest=earliest)
        left = left - share
    if not pulses or abs(left) > ALIGNED * spacecraft.least_impulse:
        return None
    return correction.correct(
        spacecraft, Schedule(tuple(pulses)), chosen=range(len(pulses)), momentum=True
    )


def _steered(spacecraft: Spacecraft, torquer: Steerable, options: TwoPulseOptions) -> Schedule:
    """Try every start that touches the limits and every odd number of half turns; the earliest end
    wins.
    """
    from nutdamp.schemes.sequential import ImpulseBuilder, bounded_by  # a steerable torquer

    windows = Windows(spacecraft)
    halves = _halves(spacecraft, options.literal)
    on_times = list[float]()
    for half in halves[:2]:
        on_time = ImpulseBuilder(spacecraft).on_time_to_steer(torquer, half)
        if on_time is None:
            times = 0.5 * abs(spacecraft.nutation_rate) * half / (torquer.torque or math.inf)
            raise Infeasible(
                "the torquer is too weak: half the nutation within half a body nutation period "
                f"takes more than {times:.4g} times its torque"
            )
        on_times.append(on_time)
    turns = range(1, min(max(int(windows.horizon / halves.wait), 1), 2 * MANY) + 1, 2)

    def pair(start: float, wait: float) -> list[Pulse]:
        """The two pulses against ω, the first from ``start`` s on."""
        builder = ImpulseBuilder(spacecraft)
        for later, on_time, half in zip((0.0, wait), on_times, halves[:2], strict=True):
            begin = windows.nearest_tick(start + 0.5 * on_times[0] + later - 0.5 * on_time)
            builder.fire(builder.steered(torquer, begin, half, on_time))
        return builder.pulses

    # Starts with which both find room, in order: at once, or as a window ends for either pulse.
    earliest, tick = windows.limits.earliest, windows.limits.tick
    ends = np.array([end for _, end in windows.limits.blackout])
    best: list[Pulse] | None = None
    for number in turns:
        wait = number * halves.wait
        to_second = wait + 0.5 * (on_times[0] - on_times[1])  # from start to start
        tried = np.sort(np.concatenate([[earliest], ends, ends - to_second]))
        starts = tried[tried >= earliest]
        seconds = starts + to_second
        if tick is not None:
            starts = np.ceil((starts - 0.5 * TOUCHING) / tick) * tick
            seconds = np.rint((starts + to_second) / tick) * tick
        long, longer = (np.full(len(starts), on) for on in on_times)
        allowed = windows.allowed(starts, long, earliest) & (
            seconds > starts
        )  # not on one tick, however long that is
        allowed &= windows.allowed(seconds, longer, starts + long + windows.limits.gap)
        pairs = (pair(start, wait) for start in starts[allowed].tolist())
        best = next((pulses for pulses in pairs if keeps_limits(spacecraft, pulses)), None)
        if best is not None:
            break
    if best is None:
        raise Infeasible(
            f"the pulses must be {halves.wait:.4g} s apart, or an odd multiple of that, and "
            f"are {sum(on_times):.4g} s long together; they do not fit within "
            f"{bounded_by(spacecraft)}"
        )
    schedule = Schedule(tuple(best))
    if options.literal or (torquer.torque is None and model_of(spacecraft).exact):
        return schedule
    return correction.correct(spacecraft, schedule, chosen=(0, 1), momentum=True)


def alternatives(spacecraft: Spacecraft, options: TwoPulseOptions) -> Iterator[Schedule]:
    """Schedules of channels among which `schedule` chooses, within the limits; none where there is
    no nutation.
    """
    if (
        spacecraft.torquer is None
        and spacecraft.least_impulse > 0.0
        and (spacecraft.limits.max_pulses or 2) >= 2
    ):
        for schedule, _ in _shortlist(spacecraft, for_pairs(spacecraft), options):
            if keeps_limits(spacecraft, schedule.pulses):
                yield schedule


def _shortlist(
    spacecraft: Spacecraft, channels: list[Channel], options: TwoPulseOptions
) -> Iterator[tuple[Schedule, float]]:
    """Most promising candidates, commandable and corrected on the real widths, each with its flown
    residual (rad).
    """
    halves = _halves(spacecraft)
    pairs = itertools.product(channels, channels)
    candidates = (
        candidate for pair in pairs for candidate in _candidates(spacecraft, *pair, options.literal)
    )
    for candidate in correction.shortlist(candidates, SHORTLIST, SHORTLIST):
        schedule = candidate.fired(spacecraft)
        if not options.literal:
            schedule = correction.correct(spacecraft, schedule, chosen=(0, 1), momentum=True)
        first, second = schedule.pulses
        notes = [
            note(
                "half-turns-apart",
                first=candidate.channels[0].name,
                second=candidate.channels[1].name,
                half_turns=f"{(second.t - first.t) / halves.wait:.2f}",
                off_deg=abs(math.degrees(candidate.miss)),
                ratio=f"{candidate.factor:.3f}",
            )
        ]
        if candidate.short > 1e-9:
            notes.append(note("on-times-miss", short_percent=100.0 * candidate.short))
        yield Schedule(schedule.pulses, tuple(notes)), correction.left(spacecraft, schedule)


def _candidates(
    spacecraft: Spacecraft, one: Channel, two: Channel, literal: bool
) -> list[PairCandidate]:
    """Closings of H for this pair within the horizon, the most promising first."""
    inertia, turning = spacecraft.inertia, spacecraft.nutation_rate
    turn = cmath.phase(two.transverse * one.transverse.conjugate())  # arg d2 - arg d1
    # Rate of d as seen from H while half the nutation is left: ω3 at small angles, exact for the
    # aligned pair.
    rate = turning + inertia.C / inertia.A * inertia.equivalent(spacecraft.spin) / math.cos(
        0.5 * spacecraft.nutation
    )
    to_go = math.pi - turn
    waits = np.zeros(0)
    first_wait = (
        to_go * math.copysign(1.0, rate) % (2 * math.pi) / abs(rate) if rate != 0.0 else math.inf
    )
    if first_wait <= spacecraft.horizon:
        count = int((spacecraft.horizon - first_wait) * abs(rate) / (2 * math.pi)) + 1
        turns = _turns(count, turn + turning * first_wait, 2 * math.pi * turning / abs(rate))
        waits = first_wait + 2 * math.pi / abs(rate) * turns
    still = (
        0.1  # rad; channels that turn by less in half a nutation turn all but stand still in space
    )
    if abs(rate) * math.pi < still * abs(
        turning
    ):  # they close whenever the second opposes ω as the first does
        count = min(int(spacecraft.horizon / spacecraft.body_period) + 1, MANY)
        opposed = (
            -turn * math.copysign(1.0, turning) % (2 * math.pi) + 2 * math.pi * np.arange(count)
        ) / abs(turning)
        waits = np.union1d(
            waits, opposed[np.abs(np.angle(np.exp(1j * (to_go - rate * opposed)))) < still]
        )
    if literal:  # halves and wait as printed; the pair must do with the direction it finds
        wait = _halves(spacecraft, literal).wait
        count = max(int(spacecraft.horizon / wait), 1) // 2 + 1
        waits = wait * (2 * _turns(count, turn + turning * wait, 2 * turning * wait) + 1)
    miss = np.angle(np.exp(1j * (turn + turning * waits)))
    factor = 1.0 / np.cos(0.5 * miss)
    # Worth placing: each wait clearly cheaper than all before it, and the cheapest few.
    before = np.concatenate([[np.inf], np.minimum.accumulate(factor)[:-1]])
    better = np.flatnonzero(factor * CLOSE_IN_COST < before)
    cheapest = np.argsort(factor, kind="stable")[:SHORTLIST]
    worth = (
        index
        for index in sorted({*better.tolist(), *cheapest.tolist()})
        if factor[index] <= DEAREST
    )
    placed = (
        _place(spacecraft, (one, two), float(waits[index]), float(miss[index]), literal)
        for index in worth
    )
    return [candidate for candidate in placed if candidate is not None]


def _halves(spacecraft: Spacecraft, literal: bool = False) -> rigid_body.HalfPulses:
    """Half pulses and the wait between them, ``literal``: as printed."""
    form = rigid_body.half_pulses_as_printed if literal else rigid_body.half_pulses
    inertia = spacecraft.inertia
    return form(
        inertia.A, inertia.C, spacecraft.transverse_rate, inertia.equivalent(spacecraft.spin)
    )


def _turns(count: int, miss: float, step: float) -> Vector:
    """Whole turns 0 to ``count`` - 1 to look at, ascending, where ψ = ``miss`` + ``step`` · turn
    (mod 2π).

    All of the first `MANY`; beyond them, near a sphere or with a horizon of years, those next to ψ
    = 0.
    """
    first = np.arange(min(count, MANY), dtype=float)
    if count <= MANY or step == 0.0:
        return first
    crossings = (2 * math.pi * np.arange(MANY) - math.copysign(1.0, step) * miss) / abs(step)
    near = np.round(crossings)[:, None] + np.array([-1.0, 0.0, 1.0])
    return np.union1d(first, near[(near >= 0) & (near < count)])


def _place(
    spacecraft: Spacecraft, pair: tuple[Channel, Channel], wait: float, miss: float, literal: bool
) -> PairCandidate | None:
    """First allowed moment at which the pair opposes ω; None where the limits leave none."""
    windows = Windows(spacecraft)
    turning = spacecraft.nutation_rate
    omega0 = complex(spacecraft.omega0[0], spacecraft.omega0[1])
    factor = 1.0 if literal else 1.0 / math.cos(0.5 * miss)
    # Both together oppose ω0 where the middle between their directions does.
    phase = rigid_body.phase_to_oppose(omega0, pair[0].transverse * cmath.exp(0.5j * miss))
    if turning == 0.0 and abs(phase) > ALIGNED:
        return None
    period = spacecraft.body_period

    def opposed_from(time: float) -> float:
        if turning == 0.0:
            return time
        return phase / turning + max(math.ceil((time - phase / turning) / period), 0) * period

    grown = (
        1.0
        if literal
        else _grown(spacecraft, opposed_from(spacecraft.limits.earliest) + 0.5 * wait)
    )
    if grown < FADED:
        return None
    (long, lacks), (longer, more) = (
        _nearest(spacecraft, channel, grown * half * factor)
        for channel, half in zip(pair, _halves(spacecraft, literal)[:2], strict=True)
    )
    short = (lacks + more) / factor
    if short >= 1.0 or wait - 0.5 * (long + longer) < spacecraft.limits.gap:
        return None
    first = opposed_from(spacecraft.limits.earliest + 0.5 * long)
    while first + wait + 0.5 * longer <= windows.horizon:
        timing = ((first, long), (first + wait, longer))
        starts = [(centre - 0.5 * on_time, on_time) for centre, on_time in timing]
        free = [(windows.blocked_until(*start), start[0]) for start in starts]
        delay = max((end - start for end, start in free if end is not None), default=0.0)
        if delay == 0.0:
            pulses = Schedule(
                (channel_pulse(pair[0], *timing[0]), channel_pulse(pair[1], *timing[1]))
            )
            return PairCandidate(
                pulses.cost, pulses.end, pair, timing, short if short > 1e-9 else 0.0, miss, factor
            )
        first += delay if turning == 0.0 else max(math.ceil(delay / period), 1) * period
    return None


def _nearest(spacecraft: Spacecraft, channel: Channel, needed: float) -> tuple[float, float]:
    """On-time in s with which a channel comes nearest to ``needed`` N m s, and what is missing,
    over A|ω0|.
    """
    slope = spacecraft.inertia.a * channel.axial / spacecraft.inertia.C
    longest = channel.max_on_time
    on_time = response.on_time_for(
        needed, abs(channel.transverse), spacecraft.nutation_rate, slope, longest
    )
    if on_time is None:
        on_time = longest_useful(longest, spacecraft.body_period)
    on_time = max(on_time, channel.min_on_time)
    width = response.width_factor(spacecraft.nutation_rate, slope, on_time)
    return on_time, abs(
        needed - abs(channel.transverse) * on_time * abs(width)
    ) / spacecraft.least_impulse


def _grown(spacecraft: Spacecraft, time: float) -> float:
    """Factor of dissipation on the transverse rate until ``time`` s."""
    if spacecraft.growth == 0.0:
        return 1.0
    from nutdamp.physics import energy_sink  # dissipation

    inertia, (first, second, spin) = spacecraft.inertia, spacecraft.omega0.tolist()
    omega = complex(first, second)
    motion = omega, spin, time, inertia.wheel, spacecraft.sense
    effect = energy_sink.coast(inertia.A, inertia.C, spacecraft.growth, *motion)
    return float(effect.transverse)
