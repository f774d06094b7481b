"""Two pulses half an inertial nutation turn apart, Magnus 1970 (22): no nutation, and H back where it was.

With a steerable torquer the pulses are exact at any angle. Of two channels with torque directions d1, d2 the momentum
shift closes to first order whenever ω3 Δt = π + arg d1 - arg d2 (mod 2π), and both pulses together then oppose ω at a
cost of 1/cos(ψ/2), where ψ is the angle by which the second direction misses the one that Magnus' scheme needs. With a
target axis the two pulses are those of `pulse_pairs`, of which these are the case that H is to stay.
"""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Iterator

import numpy as np

from nutdamp.common.results import Note, note
from nutdamp.errors import Infeasible
from nutdamp.physics import body as rigid_body
from nutdamp.physics import energy_sink, response
from nutdamp.schemes import correction
from nutdamp.schemes.catalogue import TwoPulseOptions
from nutdamp.schemes.correction import CLOSE_IN_COST, PairCandidate, tolerable
from nutdamp.schemes.sequential import ALIGNED, FADED, ImpulseBuilder, at_hand, bounded_by, model_of
from nutdamp.spacecraft.constraints import Windows, for_pairs, keeps_limits, longest_useful
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import TOUCHING, Pulse, Schedule, channel_pulse, steerable_pulse

# pairs that cost more than this times A|ω0| are not looked at: the second pulse would mostly undo the first
DEAREST = 2.0

MANY = 2000  # closings of H looked at for each pair one by one
SHORTLIST = 6  # candidates that are flown and corrected, at most


def schedule(spacecraft: Spacecraft, options: TwoPulseOptions) -> Schedule:
    """Two pulses, and a note on the cost or residual of fixed channels.

    ``options.literal``: equal halves and the wait as printed, not corrected, and the target left alone. Raises
    Infeasible with the reason.
    """
    if spacecraft.goal.axis is not None and not options.literal:
        try:
            from nutdamp.schemes import pulse_pairs  # here, because few plans have a target

            return pulse_pairs.schedule(spacecraft)
        except Infeasible:
            damping = _wide(spacecraft)
            if damping is None:
                raise
            return damping
    return _damping(spacecraft, options)


def _wide(spacecraft: Spacecraft) -> Schedule | None:
    """Pulses that damp without drift, corrected to a target nearby; None where they do not reach it.

    A pulse over a large part of a spin turn hardly turns H and still takes nutation out, so where pulses as wide as
    that are all there is, this finds what an acquisition, which plans for the turn, does not.
    """
    if not 0.0 <= spacecraft.to_turn < spacecraft.nutation:
        return None
    try:
        schedule = _damping(spacecraft, TwoPulseOptions())
    except Infeasible:
        return None
    return schedule if correction.left(spacecraft, schedule) <= tolerable(spacecraft) else None


def _damping(spacecraft: Spacecraft, options: TwoPulseOptions) -> Schedule:
    """Two pulses that leave H where it was, but for the correction to a target."""
    most = spacecraft.limits.max_pulses
    if most is not None and most < 2:
        raise Infeasible(f"two pulses are needed, and limits.max_pulses allows {most}")
    torquer = spacecraft.torquer
    if torquer is not None:
        return _steered(spacecraft, torquer, options)
    return _fixed(spacecraft, at_hand(spacecraft, for_pairs(spacecraft)), options)


# --- steerable torquer -----------------------------------------------------------------------------------------------


def _steered(spacecraft: Spacecraft, torquer: Steerable, options: TwoPulseOptions) -> Schedule:
    """Try every start that touches the limits and every odd number of half turns; the earliest end wins."""
    inertia, windows, earliest = spacecraft.inertia, Windows(spacecraft), spacecraft.limits.earliest
    form = rigid_body.half_pulses_as_printed if options.literal else rigid_body.half_pulses
    halves = form(inertia.A, inertia.C, spacecraft.transverse_rate, inertia.equivalent(spacecraft.spin))
    on_times = tuple(_on_time(spacecraft, torquer, impulse) for impulse in (halves.first, halves.second))
    turns = range(1, min(max(int(windows.horizon / halves.wait), 1), 2 * MANY) + 1, 2)

    def pair(start: float, wait: float) -> tuple[Pulse, ...]:
        """The two pulses against ω, the first from ``start`` s on."""
        builder = ImpulseBuilder(spacecraft)
        for later, on_time, half in zip((0.0, wait), on_times, halves[:2], strict=True):
            begin = windows.nearest_tick(start + 0.5 * on_times[0] + later - 0.5 * on_time)
            centre = begin + 0.5 * on_time
            requested = {"impulse": half} if torquer.torque is None else {"on_time": on_time}
            builder.fire(steerable_pulse(torquer, centre, cmath.phase(-builder.omega_at(centre)), **requested))
        return tuple(builder.pulses)

    waits = [number * halves.wait for number in turns]
    starts = ((start, wait) for wait in waits for start in _starts(windows, earliest, on_times, wait))
    best = next((pulses for pulses in itertools.starmap(pair, starts) if keeps_limits(spacecraft, pulses)), None)
    if best is None:
        raise Infeasible(
            f"the pulses come {halves.wait:.4g} s apart or an odd multiple of that and are {sum(on_times):.4g} s long "
            f"together; no room for both within {bounded_by(spacecraft)}"
        )
    if options.literal or (torquer.torque is None and model_of(spacecraft).exact):
        return Schedule(best)
    return correction.correct(spacecraft, Schedule(best), chosen=(0, 1), momentum=True)


def _on_time(spacecraft: Spacecraft, torquer: Steerable, impulse: float) -> float:
    """On-time in s of one half pulse; raises Infeasible where the torque is too weak for it."""
    if torquer.torque is None:
        return 0.0
    on_time = response.on_time_for(impulse, torquer.torque, spacecraft.nutation_rate, 0.0, math.inf)
    if on_time is None:
        needed = 0.5 * abs(spacecraft.nutation_rate) * impulse
        raise Infeasible(
            f"half the nutation needs more than {needed / torquer.torque:.4g} times the torque of the torquer to be "
            "taken out within half a body nutation period"
        )
    return Windows(spacecraft).on_time(on_time, 0.0, math.inf)


def _starts(windows: Windows, earliest: float, on_times: tuple[float, ...], wait: float) -> list[float]:
    """Starts of the first pulse with which both find room, in order: at once, or as a window ends for either pulse."""
    to_second = wait + 0.5 * (on_times[0] - on_times[1])  # from start to start
    ends = np.array([end for _, end in windows.limits.blackout])
    tried = np.sort(np.concatenate([[earliest], ends, ends - to_second]))
    starts, tick = tried[tried >= earliest], windows.limits.tick
    starts = starts if tick is None else np.ceil((starts - 0.5 * TOUCHING) / tick) * tick
    seconds = starts + to_second if tick is None else np.rint((starts + to_second) / tick) * tick
    long, longer = (np.full(len(starts), on) for on in on_times)
    allowed = windows.allowed(starts, long, earliest) & (seconds > starts)  # not on one tick, however long that is
    allowed &= windows.allowed(seconds, longer, starts + long + windows.limits.gap)
    return [float(start) for start in starts[allowed]]


# --- body-fixed channels ---------------------------------------------------------------------------------------------


def alternatives(spacecraft: Spacecraft, options: TwoPulseOptions) -> Iterator[Schedule]:
    """Schedules among which `schedule` chooses, each within the limits; none for a steerable torquer.

    None either where there is no nutation: these damp, and nothing else.
    """
    if spacecraft.torquer is None and spacecraft.least_impulse > 0.0 and (spacecraft.limits.max_pulses or 2) >= 2:
        for schedule, _ in _shortlist(spacecraft, for_pairs(spacecraft), options):
            if keeps_limits(spacecraft, schedule.pulses):
                yield schedule


def _fixed(spacecraft: Spacecraft, channels: list[Channel], options: TwoPulseOptions) -> Schedule:
    """Candidate of least flown residual; exact ones in order.

    Where every one breaks a limit, the first of them: the judge says which.
    """
    best, broken = correction.best_of(spacecraft, _shortlist(spacecraft, channels, options))
    schedule = best or broken
    if schedule is None:
        raise Infeasible(_nothing_closes(spacecraft, channels))
    return schedule


def _shortlist(
    spacecraft: Spacecraft, channels: list[Channel], options: TwoPulseOptions
) -> Iterator[tuple[Schedule, float]]:
    """Most promising candidates, commandable and corrected on the real widths, each with its flown residual (rad)."""
    pairs = (_candidates(spacecraft, one, two, options.literal) for one in channels for two in channels)
    for candidate in correction.shortlist(itertools.chain.from_iterable(pairs), SHORTLIST, SHORTLIST):
        schedule = candidate.fired(spacecraft)
        if not options.literal:
            schedule = correction.correct(spacecraft, schedule, chosen=(0, 1), momentum=True)
        left = correction.left(spacecraft, schedule)
        yield Schedule(schedule.pulses, _remark(spacecraft, candidate, schedule)), left


def _remark(spacecraft: Spacecraft, candidate: PairCandidate, schedule: Schedule) -> tuple[Note, ...]:
    inertia = spacecraft.inertia
    spin = inertia.equivalent(spacecraft.spin)
    halves = rigid_body.half_pulses(inertia.A, inertia.C, spacecraft.transverse_rate, spin)
    first, second = schedule.pulses
    turns = (second.t - first.t) / halves.wait
    apart = note(
        "half-turns-apart",
        first=candidate.channels[0].name,
        second=candidate.channels[1].name,
        half_turns=f"{turns:.2f}",
        off_deg=abs(math.degrees(candidate.miss)),
        ratio=f"{candidate.factor:.3f}",
    )
    missed = [note("on-times-miss", short_percent=100.0 * candidate.short)] * (candidate.short > 1e-9)
    return (apart, *missed)


def _candidates(spacecraft: Spacecraft, one: Channel, two: Channel, literal: bool) -> list[PairCandidate]:
    """Closings of H for this pair within the horizon, the most promising first."""
    inertia, omega0 = spacecraft.inertia, complex(spacecraft.omega0[0], spacecraft.omega0[1])
    A, C, turning, spin = inertia.A, inertia.C, spacecraft.nutation_rate, inertia.equivalent(spacecraft.spin)
    theta = spacecraft.nutation
    turn = cmath.phase(two.transverse * one.transverse.conjugate())  # arg d2 - arg d1
    # Rate of d as seen from H while half the nutation is left: ω3 at small angles, exact for the aligned pair.
    rate = turning + C / A * spin / math.cos(0.5 * theta)
    to_go = math.pi - turn
    still = 0.1  # rad; channels that turn no further stand still in space: they close at any time, or never
    if abs(rate) * spacecraft.horizon < still:
        if abs(cmath.phase(cmath.rect(1.0, to_go))) > still:
            return []
        to_go, rate = -turn, turning  # until the second opposes ω as the first does
    if rate == 0.0:
        return []
    first_wait = to_go * math.copysign(1.0, rate) % (2 * math.pi) / abs(rate)
    count = int(max(spacecraft.horizon - first_wait, 0.0) * abs(rate) / (2 * math.pi)) + 1
    turns = _turns(count, turn + turning * first_wait, 2 * math.pi * turning / abs(rate))
    waits = first_wait + 2 * math.pi / abs(rate) * turns
    halves = rigid_body.half_pulses(A, C, abs(omega0), spin)
    if literal:  # halves and wait as printed; the pair must do with the direction it finds
        halves = rigid_body.half_pulses_as_printed(A, C, abs(omega0), spin)
        count = max(int(spacecraft.horizon / halves.wait), 1) // 2 + 1
        odd = 2 * _turns(count, turn + turning * halves.wait, 2 * turning * halves.wait) + 1
        waits = halves.wait * odd
    miss = np.angle(np.exp(1j * (turn + turning * waits)))
    factor = 1.0 / np.cos(0.5 * miss)
    placed = (
        _place(spacecraft, one, two, halves, float(waits[index]), float(miss[index]), literal)
        for index in _promising(factor)
    )
    return [candidate for candidate in placed if candidate is not None]


def _turns(count: int, miss: float, step: float) -> Vector:
    """Whole turns 0 to ``count`` - 1 to look at, ascending, where ψ = ``miss`` + ``step`` · turn (mod 2π).

    All of the first `MANY`; beyond them, near a sphere or with a horizon of years, those next to ψ = 0.
    """
    first = np.arange(min(count, MANY), dtype=float)
    if count <= MANY or step == 0.0:
        return first
    crossings = (2 * math.pi * np.arange(MANY) - math.copysign(1.0, step) * miss) / abs(step)
    near = np.round(crossings)[:, None] + np.array([-1.0, 0.0, 1.0])
    return np.union1d(first, near[(near >= 0) & (near < count)])


def _promising(factor: Vector) -> Vector:
    """Indices of the waits worth placing: each one clearly cheaper than all before it, and the cheapest few."""
    before = np.concatenate([[np.inf], np.minimum.accumulate(factor)[:-1]])
    better = np.flatnonzero(factor * CLOSE_IN_COST < before)
    cheapest = np.argsort(factor, kind="stable")[:SHORTLIST]
    chosen = np.array(sorted({*better.tolist(), *cheapest.tolist()}), dtype=int)  # np.union1d loads numpy.ma
    return np.asarray(chosen[factor[chosen] <= DEAREST])  # beyond, the second pulse would mostly undo the first


def _place(
    spacecraft: Spacecraft,
    one: Channel,
    two: Channel,
    halves: rigid_body.HalfPulses,
    wait: float,
    miss: float,
    literal: bool,
) -> PairCandidate | None:
    """First allowed moment at which the pair opposes ω; None where the limits leave none."""
    windows, turning = Windows(spacecraft), spacecraft.nutation_rate
    omega0 = complex(spacecraft.omega0[0], spacecraft.omega0[1])
    factor = 1.0 if literal else 1.0 / math.cos(0.5 * miss)
    # Both together oppose ω0 where the middle between their directions does.
    phase = rigid_body.phase_to_oppose(omega0, one.transverse * cmath.exp(0.5j * miss))
    if turning == 0.0 and abs(phase) > ALIGNED:
        return None
    period = 2 * math.pi / abs(turning) if turning != 0.0 else math.inf

    def opposed_from(time: float) -> float:
        if turning == 0.0:
            return time
        return phase / turning + max(math.ceil((time - phase / turning) / period), 0) * period

    grown = 1.0 if literal else _grown(spacecraft, opposed_from(spacecraft.limits.earliest) + 0.5 * wait)
    if grown < FADED:
        return None
    long, lacks = _nearest(spacecraft, one, grown * halves.first * factor)
    longer, more = _nearest(spacecraft, two, grown * halves.second * factor)
    on_times, short = (long, longer), (lacks + more) / factor
    if short >= 1.0:
        return None
    first = opposed_from(spacecraft.limits.earliest + 0.5 * on_times[0])
    if wait - 0.5 * sum(on_times) < spacecraft.limits.gap:
        return None
    while first + wait + 0.5 * on_times[1] <= windows.horizon:
        starts = (first - 0.5 * on_times[0], first + wait - 0.5 * on_times[1])
        free = (windows.blocked_until(start, on_time) for start, on_time in zip(starts, on_times, strict=True))
        delay = max((end - start for end, start in zip(free, starts, strict=True) if end is not None), default=0.0)
        if delay == 0.0:
            timing = ((first, on_times[0]), (first + wait, on_times[1]))
            schedule = Schedule((channel_pulse(one, *timing[0]), channel_pulse(two, *timing[1])))
            short = short if short > 1e-9 else 0.0
            return PairCandidate(schedule.cost, schedule.end, (one, two), timing, short, miss, factor)
        first += delay if turning == 0.0 else max(math.ceil(delay / period), 1) * period
    return None


def _nearest(spacecraft: Spacecraft, channel: Channel, needed: float) -> tuple[float, float]:
    """On-time in s with which a channel comes nearest to the effective impulse ``needed`` N m s, and what is missing.

    The latter over the impulse for all nutation.
    """
    slope, longest = spacecraft.inertia.a * channel.axial / spacecraft.inertia.C, channel.max_on_time
    on_time = response.on_time_for(needed, abs(channel.transverse), spacecraft.nutation_rate, slope, longest)
    if on_time is None:
        on_time = longest_useful(longest, spacecraft.body_period)
    on_time = max(on_time, channel.min_on_time)
    width = response.width_factor(spacecraft.nutation_rate, slope, on_time)
    return on_time, abs(needed - abs(channel.transverse) * on_time * abs(width)) / spacecraft.least_impulse


def _grown(spacecraft: Spacecraft, time: float) -> float:
    """Factor of dissipation on the transverse rate until ``time`` s."""
    if spacecraft.growth == 0.0:
        return 1.0
    inertia, (first, second, spin) = spacecraft.inertia, spacecraft.omega0.tolist()
    omega = complex(first, second)
    effect = energy_sink.coast(inertia.A, inertia.C, spacecraft.growth, omega, spin, time, inertia.wheel)
    return float(effect.transverse)


def _nothing_closes(spacecraft: Spacecraft, channels: list[Channel]) -> str:
    names = ", ".join(channel.name for channel in channels)
    if spacecraft.nutation_rate == 0.0:
        return (
            "in a sphere (a = 0) ω does not turn in the body, and no two of the channels "
            f"({names}) have it opposite to the middle between them; a steerable torquer or four-pulse can work"
        )
    if _grown(spacecraft, spacecraft.limits.earliest + 0.25 * spacecraft.body_period) < FADED:
        return f"dissipation takes the nutation out before the channels ({names}) come to oppose it"
    return f"no two of the channels ({names}) bring H back and oppose the nutation within {bounded_by(spacecraft)}"
