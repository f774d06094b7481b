"""Sun-synchronous pulse train: short pulses at a fixed inertial phase, one or more in each spin
turn.

Each pulse turns H by J/(C|ω3|) and gives the nutation a phasor, which from one to the next turns by
φ = 2πC/(AK) for K pulses a turn. So N leave (J/C|ω3|)|sin(Nφ/2)/sin(φ/2)| of nutation: N is chosen
so that they close, a nutation at t = 0 included, their equal width so that they just reach the
target. An excess is bent away by heading a little aside (a spiral), and on the flown motion the
last pulses are moved until nothing is left. The phase is that of the great circle to the target, or
fixed against the Sun: then H follows a rhumb line.
"""

from __future__ import annotations

import cmath
import math
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from nutdamp.common import work
from nutdamp.common.results import note
from nutdamp.errors import Infeasible, TooShort, span
from nutdamp.flight.dynamics import free_coast
from nutdamp.physics import attitude, precession
from nutdamp.schemes.catalogue import RhumbLineOptions
from nutdamp.schemes.correction import ROUNDING, tolerable
from nutdamp.schemes.legs import Legs, damped
from nutdamp.schemes.sequential import expect_aim
from nutdamp.spacecraft.constraints import Windows, usable
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import Spacecraft, Vector
from nutdamp.spacecraft.schedule import TOUCHING, Pulse, Schedule, channel_pulse, steerable_pulse

TURN_SHARE = (
    0.125  # default on-time as a share of the spin turn: 2.6 % of the impulse is lost to the arc
)
# pulses that a train has to spare: without them it could not bend, and its phases not bring H
# nearer
SPARE = 3e-3
LEAST_RATIO = 0.1  # inertia ratio below which the phases of pulses hardly matter to the nutation
# share of the spin turn up to which pulses widen where the horizon is short: a quarter of the
# impulse is lost
WIDEST = 0.4
BENT = 10.0  # times as many spare pulses for a last try
WIDEST_BEND = 1.3  # rad by which the heading of a train may differ from the course to the target
# pulses up to which their size is corrected on the flown motion too: a longer train has little to
# spare
SHORT = 60

STEP = math.radians(2.0)  # angle that one ideal impulse turns H by, at most

# Sums of the phasors, in pulses: below they count as closed, as the rest is corrected; beyond that
# has no hope.
CLOSED, OPEN = 0.3, 1.2

MOST_PULSES = 600

LAST = 20  # largest number of last pulses that are moved

MOVED = (
    6,
    12,
    LAST,
)  # numbers of last pulses that are moved, one after the other until nothing is left

TRIES = 4  # counts that are flown, at most


class Attempt(NamedTuple):
    """Train to fly."""

    pulses: int
    size: float  # of each, s; of ideal impulses N m s
    closes: bool  # whether they leave little nutation as they are, so that correction costs little


class Train:
    """Trains from the motion of ``at_leg``."""

    def __init__(self, at_leg: Spacecraft, options: RhumbLineOptions) -> None:
        self.at_leg, self.options = at_leg, options
        self.windows = Windows(at_leg)
        self.turn = 2.0 * math.pi / abs(at_leg.spin)
        self.h = abs(at_leg.axial)
        torquer = at_leg.torquer
        self.channels = [] if torquer is not None else _different(at_leg, options.per_turn)
        torques = [abs(channel.transverse) for channel in self.channels]
        if torquer is not None:
            torques = [math.inf if torquer.torque is None else torquer.torque]
        self.torque = math.fsum(torques) / len(torques)
        self.shortest = max((channel.min_on_time for channel in self.channels), default=0.0)
        self.longest = min((channel.max_on_time for channel in self.channels), default=math.inf)
        self.ideal = math.isinf(self.torque)
        # s, that is worth firing unless a longer one is requested
        self.widest = min(self.longest, WIDEST * self.turn)
        requested = options.on_time
        self.on_time = requested or max(min(self.longest, TURN_SHARE * self.turn), self.shortest)
        name = f"the shortest pulse, {self.shortest:.4g} s,"
        if requested is not None:
            name = f"an on-time of {requested:.6g} s"
            if self.ideal:
                raise Infeasible("ideal impulses have no on-time; give the torquer a torque")
            if not self.shortest <= requested <= self.longest:
                allowed = span(self.shortest, self.longest, "s")
                raise Infeasible(f"{name} is outside what the channels allow: {allowed}")
            if abs(self.windows.nearest_tick(requested) - requested) > TOUCHING:
                raise Infeasible(f"{name} is no multiple of the tick of {at_leg.limits.tick:.4g} s")
        if not self.ideal and self.on_time > 0.5 * self.turn:
            raise Infeasible(
                f"{name} is more than half a spin turn ({0.5 * self.turn:.4g} s): after that a "
                "torque fixed in the body turns H back"
            )
        self.ahead, self.way = precession.course(
            at_leg.momentum, at_leg.target_axis, at_leg.goal.sun
        )
        self.needed = self.h * self.way  # turn of H, N m s
        # Turn by a full pulse, N m s.
        self.strongest = self.turns_by(STEP * self.h if self.ideal else self.on_time)

    def turns_by(self, size: float) -> float:
        """Turn of H by a pulse of a ``size`` as in `Attempt`, N m s."""
        if self.ideal:
            return size
        return self.torque * size * precession.arc_efficiency(self.at_leg.spin, size)

    def size(self, count: int, bent: float = 1.0) -> float:
        """Size of ``count`` pulses with ``bent`` times those to spare, on ticks; not a number where
        it is too far.

        A pulse moved by an angle of the spin turns its kick by ν/ω3 times that, and loses half of
        its square.
        """
        ratio = max(abs(self.at_leg.nutation_rate / self.at_leg.spin), LEAST_RATIO)
        spare = SPARE + (float(self.left[count - 1]) / ratio) ** 2 / min(count, LAST)
        share = self.needed / (count - min(bent * spare, 0.5 * count))
        if self.ideal:
            return share
        width = float(
            precession.on_times_to_turn(np.array([share]), self.torque, self.at_leg.spin)[0]
        )
        return self.windows.tick_after(width) if math.isfinite(width) else math.nan

    def attempts(self) -> list[Attempt]:
        """Trains to fly, of the length requested or of any, the most promising first; raises
        Infeasible where there is none.
        """
        left, limits, requested = self.left, self.at_leg.limits, self.options.on_time
        most = min(len(left), limits.max_pulses or MOST_PULSES)
        least = 0.0 if requested is not None else self.shortest
        # Wide pulses only where the horizon leaves no time for so many of the usual ones.
        usual = STEP * self.h if self.ideal else self.on_time
        widest = usual if self.ideal or requested is not None else max(usual, self.widest)
        counts = list[int]()
        for longest in (usual, widest):
            sizes = {count: self.size(count) for count in range(2, most + 1)}
            counts = counts or [
                count
                for count, size in sizes.items()
                if least - TOUCHING <= size <= longest + TOUCHING
            ]
        if not counts:
            needed = max(math.ceil(self.needed / self.turns_by(widest)), 2)
            if needed > (limits.max_pulses or needed):
                raise Infeasible(
                    f"a train to the target takes at least {needed} pulses, "
                    f"and limits.max_pulses leaves {limits.max_pulses} for it"
                )
            turns = needed / self.options.per_turn * self.turn
            text = f"a train to the target takes {needed} pulses, about {turns:.4g} s, and the "
            short = f"limits leave time for {most}"
            raise TooShort(text + (short if needed > most else "shortest pulses turn H beyond it"))
        phases = {count: float(left[count - 1]) for count in counts}
        best = min(counts, key=lambda count: phases[count])
        if phases[best] > OPEN:
            ratio = self.at_leg.axial / (self.at_leg.inertia.A * self.at_leg.spin)
            off = math.degrees(self.way * min(phases[count] / count for count in counts))
            raise TooShort(
                f"no train of {counts[0]} to {counts[-1]} pulses ends without nutation: at least "
                f"{off:.3g}° would be left. The pulses meet the nutation in one phase, and build "
                "it up, where C/(A × pulses per turn) is near a whole number, and it is "
                f"{ratio / self.options.per_turn:.4g}; try another --per-turn, half-cone or "
                "two-pulse"
            )
        # Of the next few counts the one that closes best, or that costs least; at last with room to
        # bend.
        closed = OPEN if requested is not None else CLOSED
        closing = [count for count in counts if phases[count] <= closed] or [best]
        near = [count for count in closing if count <= 1.25 * closing[0] + 3]
        tried = {(count, requested or self.size(count)): phases[count] <= CLOSED for count in near}
        free = requested is None and limits.tick is None
        ranked = sorted(tried, key=lambda each: phases[each[0]] if free else each[0] * each[1])
        del ranked[TRIES:]
        bent = [(count, self.size(count, BENT)) for count, _ in ranked[:2]]
        ranked += [each for each in bent if requested is None and each[1] <= widest + TOUCHING]
        return [Attempt(*each, tried.get(each, False)) for each in dict.fromkeys(ranked)]

    @cached_property
    def left(self) -> Vector:
        """Sum of the phasors of the first 1, 2, … pulses and the nutation at the start, in pulses,
        (n,).
        """
        # Moments (s) of right phase within the limits, undisturbed, and the direction in the body
        # of each push.
        shots: list[tuple[float, complex]] = []
        per_turn, limits = self.options.per_turn, self.at_leg.limits
        ready = limits.earliest
        on_time = 0.0 if self.ideal else self.on_time
        firsts = [
            (_aligned(self.at_leg, channel, self.ahead, ready), channel.transverse)
            for channel in self.channels
        ]
        if not firsts:  # a torquer has the phases of the spin turn from its first pulse on
            times = [
                ready + 0.5 * on_time + number * self.turn / per_turn for number in range(per_turn)
            ]
            firsts = [(time, _in_body(self.at_leg, self.ahead, time)) for time in times]
        gap = max(limits.gap, 0.5 * self.turn / per_turn - on_time)

        def after(first: float, time: float) -> float:
            """Moment of the phase of ``first`` from ``time`` s on."""
            return first + max(math.ceil((time - first) / self.turn - 1e-9), 0) * self.turn

        for _ in range(MOST_PULSES + len(limits.blackout)):
            start = self.windows.earliest_start(on_time, ready)
            if start is None or len(shots) == MOST_PULSES:
                break
            centre = start + 0.5 * on_time
            first, push = min(firsts, key=lambda shot: after(shot[0], centre))
            t = after(first, centre)
            if t + 0.5 * on_time > self.windows.horizon:
                break
            free = self.windows.blocked_until(t - 0.5 * on_time, on_time)
            if free is not None:
                ready = max(free, ready + 0.25 * self.turn)
                continue
            shots.append((t, push))
            ready = t + 0.5 * on_time + gap
        turned = self.at_leg.nutation_rate * np.array([t for t, _ in shots])
        sums = np.cumsum(np.exp(1j * (np.angle(np.array([push for _, push in shots])) + turned)))
        counts = np.arange(1, len(shots) + 1)
        return np.asarray(
            np.abs(self.at_leg.inertia.A * self.at_leg.initial.omega * counts / self.needed + sums)
        )

    def next_pulse(self, at_leg: Spacecraft, remaining: int, attempt: Attempt) -> Pulse | None:
        """Next pulse of ``remaining`` ones from the motion of ``at_leg``; None where the limits
        leave no time.
        """
        ahead, way = precession.course(at_leg.momentum, at_leg.target_axis, at_leg.goal.sun)
        share = self.h * way / (remaining * self.turns_by(attempt.size))
        if share < 1.0:  # equal pulses would turn H too far: to one side of the target, a spiral
            bend = math.acos(max(share, math.cos(WIDEST_BEND)))
            aside = np.cross(at_leg.momentum / float(np.linalg.norm(at_leg.momentum)), ahead)
            ahead = np.asarray(math.cos(bend) * ahead + math.sin(bend) * aside)
        ready = at_leg.limits.earliest
        on_time = 0.0 if self.ideal else attempt.size
        if at_leg is not self.at_leg:  # no two in the same passage of the phase
            turn = self.turn / self.options.per_turn
            ready = max(ready, (0.5 * turn if self.channels else turn) - on_time)
        windows = Windows(at_leg)
        # The first firing of a channel at the required phase within the limits.
        for _ in range(MOST_PULSES if self.channels else 0):
            moments = [
                (_aligned(at_leg, channel, ahead, ready + 0.5 * on_time), channel)
                for channel in self.channels
            ]
            t, channel = min(moments, key=lambda passage: passage[0])
            start = windows.nearest_tick(t - 0.5 * on_time)
            free = windows.blocked_until(start, on_time)
            if start + on_time > windows.horizon + 1e-9:
                return None
            if free is None and start >= at_leg.limits.earliest - 1e-9:
                return channel_pulse(channel, start + 0.5 * on_time, on_time)
            ready = max(free or 0.0, start + 0.25 * self.turn)
        begin = windows.earliest_start(on_time, ready)
        if self.channels or begin is None:
            return None
        centre = begin + 0.5 * on_time
        assert at_leg.torquer is not None
        angle = cmath.phase(_in_body(at_leg, ahead, centre))
        return steerable_pulse(at_leg.torquer, centre, angle, impulse=attempt.size, on_time=on_time)


def _different(at_leg: Spacecraft, count: int) -> list[Channel]:
    """So many channels, of directions as different as can be, the one that costs least for its
    torque first.
    """
    channels = usable(at_leg)
    if not channels:
        raise Infeasible("no time is left for the turn after the nutation is damped")
    different = [min(channels, key=lambda channel: (channel.price, -abs(channel.transverse)))]
    while len(different) < count:
        off = [
            min(
                abs(cmath.phase(each.transverse * other.transverse.conjugate()))
                for other in different
            )
            for each in channels
        ]
        if max(off) < 0.2:
            raise Infeasible(
                f"{count} pulses a spin turn need {count} channels of different directions, "
                f"because each passes the phase once a turn; there are {len(different)}"
            )
        different.append(channels[off.index(max(off))])
    return different


def _aligned(at_leg: Spacecraft, channel: Channel, ahead: Vector, ready: float) -> float:
    """First moment (s) from ``ready`` on at which the torque of ``channel`` points along ``ahead``
    (3,), inertial.
    """
    direction = channel.transverse / abs(channel.transverse)
    turn = 2.0 * math.pi / abs(at_leg.spin)
    t = ready
    for step in range(12):
        off = cmath.phase(
            direction * _in_body(at_leg, ahead, t).conjugate()
        )  # the torque is so far ahead of it
        change = -off / at_leg.spin
        if step == 0:
            change %= turn
        t += change
        if abs(change) < 1e-12 * turn:
            break
    return t if t >= ready - 1e-9 else t + turn


def _in_body(at_leg: Spacecraft, direction: Vector, t: float) -> complex:
    """Components of an inertial ``direction`` (3,) along axes 1 and 2 of the body at ``t`` s,
    undisturbed.
    """
    _, quaternions = free_coast(at_leg.inertia, at_leg.initial).motion(np.array([t]))
    body = attitude.matrix(quaternions[0]).T @ direction
    return complex(body[0], body[1])


# rad of flown residual that count as nothing, and relative saving that is worth more pulses.
EXACT, CLEARLY = 1e-10, 0.01


def schedule(spacecraft: Spacecraft, options: RhumbLineOptions) -> Schedule:
    """Train, after one pulse (or a train against ω) where nutation is more than it can absorb;
    raises Infeasible.
    """
    expect_aim(spacecraft)
    try:
        return _train(spacecraft, options)
    except Infeasible as why:
        if options.on_time is None:
            raise
        other: Schedule | None = None
        with suppress(Infeasible):
            other = _train(spacecraft, replace(options, on_time=None))
        if other is None or not other.pulses:
            raise
        works = f"{len(other)} pulses, the last {other.pulses[-1].on_time:.4g} s long"
        raise Infeasible(f"{why}; without --on-time there is a train of {works}") from None


def _train(spacecraft: Spacecraft, options: RhumbLineOptions) -> Schedule:
    """Train from t = 0, or else after damping of the nutation.
    Raises Infeasible with the reason.
    """
    legs = Legs(spacecraft)
    reason = Infeasible("")
    train = Train(legs.at_leg, options)
    if spacecraft.least_impulse <= 0.5 * train.strongest and train.way > ROUNDING:
        try:
            return _best(legs, train)
        except Infeasible as why:
            reason = why
    if spacecraft.least_impulse <= 1e-9 * train.h:
        raise reason
    legs = damped(legs)
    if legs.left <= ROUNDING:
        return legs.schedule(note("no-train"))
    return _best(legs, Train(legs.at_leg, options))


def _best(legs: Legs, train: Train) -> Schedule:
    """Train that leaves least, of those that leave nothing the first, unless a later one costs
    clearly less.
    """
    best = math.inf, math.inf, Schedule()
    before = sum(pulse.magnitude for pulse in legs.pulses)
    requested = train.options.on_time
    floor = train.needed / precession.arc_efficiency(
        train.at_leg.spin, train.shortest if requested is None else requested
    )
    for attempt in train.attempts():
        # What the rounding of the start of one pulse to a tick leaves counts as nothing.
        rounding = (
            train.turns_by(attempt.size)
            / train.h
            * abs(train.at_leg.spin)
            * (train.at_leg.limits.tick or 0.0)
        )
        nothing = max(EXACT, rounding)
        if best[0] <= nothing and not attempt.closes:
            continue  # it would cost no less
        schedule, left = _flown(legs.fork(), train, attempt)
        left = max(left, nothing)
        cost = schedule.total_impulse - before
        if left < 0.5 * best[0] or (left <= best[0] and cost < (1.0 - CLEARLY) * best[1]):
            best = left, cost, schedule
        cheap = best[1] <= (1.0 + CLEARLY) * floor
        # Of pulses of a given length the trains come in the order of their cost.
        if work.exhausted() or (left <= nothing and (cheap or requested is not None)):
            break
    if best[0] > tolerable(train.at_leg):
        held = "" if requested is None else f" of {requested:.4g} s"
        text = f"no train of equal pulses{held} was found that ends on the target within the limits"
        raise Infeasible(f"{text}; the best would leave {math.degrees(best[0]):.3g}°")
    return best[2]


def _flown(legs: Legs, train: Train, attempt: Attempt) -> tuple[Schedule, float]:
    """Train, each pulse aimed from the current H, the last ones moved; and its residual, rad."""
    count = attempt.pulses
    # The size of a command is not corrected, nor that of a long train, which has little to spare.
    free = train.options.on_time is None and train.at_leg.limits.tick is None
    resized = count if free and count <= SHORT else 0
    for remaining in range(count, 0, -1):
        pulse = train.next_pulse(legs.at_leg, remaining, attempt)
        if pulse is None or work.exhausted():
            break
        legs.fire((pulse,))
    fired = min(count, len(legs.pulses))
    for last in MOVED:
        before = legs.left
        if before < EXACT or work.exhausted():
            break
        legs.correct(min(last, fired), resized=resized)
        if train.at_leg.limits.tick is not None and legs.left > 0.5 * before:
            break  # what is left is the rounding of starts
    if not legs.pulses:
        return legs.schedule(), legs.left
    on_time = legs.pulses[-1].on_time
    description = note(
        "great-circle-train" if train.at_leg.goal.sun is None else "rhumb-line-train",
        count=count,
        channels=", ".join(channel.name for channel in train.channels) or "the steerable torquer",
        on_time_s=on_time,
        way_deg=math.degrees(train.way),
        efficiency=float(precession.arc_efficiency(train.at_leg.spin, on_time)),
        damping=max(len(legs.pulses) - count, 0),
    )
    return legs.schedule(description), legs.left
