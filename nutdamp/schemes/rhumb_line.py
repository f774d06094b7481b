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
from nutdamp.flight.dynamics import Arc
from nutdamp.physics import attitude, precession
from nutdamp.schemes import correction, one_pulse
from nutdamp.schemes.catalogue import RhumbLineOptions
from nutdamp.schemes.correction import ROUNDING, tolerable
from nutdamp.schemes.sequential import expect_aim
from nutdamp.schemes.valve_commands import FlownBuilder
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
OTHERS = 4  # other lengths of the pulses that are tried where the one requested does not do

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
    resizable: bool = False  # whether the size is not that of a command, and may be corrected


class Train:
    """Trains from the motion of ``at_leg``."""

    def __init__(self, at_leg: Spacecraft, options: RhumbLineOptions) -> None:
        self.at_leg, self.options = at_leg, options
        self.windows = Windows(at_leg)
        self.turn = 2.0 * math.pi / abs(at_leg.spin)
        self.h = abs(at_leg.axial)
        torquer = at_leg.torquer
        self.channels = list[Channel]()
        self.shortest = 0.0
        self.longest = math.inf
        if torquer is not None:
            self.torque = math.inf if torquer.torque is None else torquer.torque
        else:
            # Of directions as different as can be, the one that costs least for its torque first.
            channels = usable(at_leg)
            count = options.per_turn
            if not channels:
                raise Infeasible("no time is left for the turn after the nutation is damped")
            self.channels = [
                min(channels, key=lambda channel: (channel.price, -abs(channel.transverse)))
            ]
            while len(self.channels) < count:
                off = [
                    min(
                        abs(cmath.phase(each.transverse * other.transverse.conjugate()))
                        for other in self.channels
                    )
                    for each in channels
                ]
                if max(off) < 0.2:
                    raise Infeasible(
                        f"{count} pulses a spin turn need {count} channels of different "
                        f"directions, because each passes the phase once a turn; "
                        f"there are {len(self.channels)}"
                    )
                self.channels.append(channels[off.index(max(off))])
            self.torque = math.fsum(abs(channel.transverse) for channel in self.channels) / len(
                self.channels
            )
            self.shortest = max(channel.min_on_time for channel in self.channels)
            self.longest = min(channel.max_on_time for channel in self.channels)
        self.ideal = math.isinf(self.torque)
        self.widest = min(
            self.longest, WIDEST * self.turn
        )  # s, that is worth firing unless a longer one is given
        given = options.on_time
        self.on_time = (
            max(min(self.longest, TURN_SHARE * self.turn), self.shortest)
            if given is None
            else given
        )
        name = f"the shortest pulse, {self.shortest:.4g} s,"
        if given is not None:
            name = f"an on-time of {given:.4g} s"
            if self.ideal:
                raise Infeasible("ideal impulses have no on-time; give the torquer a torque")
            if not self.shortest <= given <= self.longest:
                allowed = span(self.shortest, self.longest, "s")
                raise Infeasible(f"{name} is outside what the channels allow: {allowed}")
            if abs(self.windows.nearest_tick(given) - given) > TOUCHING:
                tick = self.at_leg.limits.tick
                raise Infeasible(
                    f"an on-time of {given:.6g} s is no multiple of the tick of {tick:.4g} s"
                )
        if not self.ideal and self.on_time > 0.5 * self.turn:
            raise Infeasible(
                f"{name} is more than half a spin turn ({0.5 * self.turn:.4g} s): after that a "
                "torque fixed in the body turns H back"
            )
        self.ahead, self.way = precession.course(
            at_leg.momentum, at_leg.target_axis, at_leg.goal.sun
        )
        self.needed = self.h * self.way  # turn of H, N m s
        self.strongest = self.turns_by(
            STEP * self.h if self.ideal else self.on_time
        )  # turn by a full pulse, N m s
        most = at_leg.limits.max_pulses
        self.most = (
            MOST_PULSES if most is None else most
        )  # pulses allowed, and not shorter than they can be
        if self.shortest > 0.0:
            self.most = min(self.most, int(_ratio(self.needed, self.turns_by(self.shortest))))

    def turns_by(self, size: float) -> float:
        """Turn of H by a pulse of a ``size`` as in `Attempt`, N m s."""
        return (
            size
            if self.ideal
            else self.torque * size * precession.arc_efficiency(self.at_leg.spin, size)
        )

    def size(self, count: int, bent: float = 1.0) -> float:
        """Size of ``count`` pulses with ``bent`` times those to spare, on ticks; not a number where
        it is too far.
        """
        share = self.needed / (count - min(bent * self._spare(count), 0.5 * count))
        if self.ideal:
            return share
        width = max(
            float(precession.on_times_to_turn(np.array([share]), self.torque, self.at_leg.spin)[0]),
            self.shortest,
        )
        return self.windows.tick_after(width) if math.isfinite(width) else math.nan

    def _spare(self, count: int) -> float:
        """Spare pulses of a train of ``count`` that is corrected.

        A pulse moved by an angle of the spin turns its kick by ``a`` times that, and loses half of
        its square.
        """
        ratio = abs(self.at_leg.nutation_rate / self.at_leg.spin)
        return SPARE + (float(self.left[count - 1]) / max(ratio, LEAST_RATIO)) ** 2 / min(
            count, LAST
        )

    def free(self) -> list[Attempt]:
        """Trains of any length to fly, the most promising first; raises Infeasible where there is
        none.
        """
        left = self.left
        fewest = self._fewest(self.strongest)
        if fewest > len(left):
            fewest = self._fewest(self.turns_by(STEP * self.h if self.ideal else self.widest))
        most = min(len(left), self.most)
        if fewest > most:
            raise self._too_few(fewest)
        closing = [count for count in range(fewest, most + 1) if left[count - 1] <= CLOSED]
        if not closing:
            best = int(np.argmin(left[fewest - 1 : most])) + fewest
            if left[best - 1] > OPEN:
                raise self._in_phase(fewest, most)
            closing = [best]
        # Of the next few counts the one that closes best, or that ticks make least dear; at last
        # with room to bend.
        near = [count for count in closing if count <= 1.25 * closing[0] + 3]
        free = self.at_leg.limits.tick is None
        tried = [Attempt(count, self.size(count), True, free) for count in near]
        tried.sort(
            key=lambda attempt: (
                float(left[attempt.pulses - 1]) if free else attempt.pulses * attempt.size
            )
        )
        del tried[TRIES:]
        tried += [Attempt(count, self.size(count, BENT), False, free) for count, *_ in tried[:2]]
        widest = math.inf if self.ideal else max(self.on_time, self.widest) + TOUCHING
        possible = list(
            {attempt[:2]: attempt for attempt in reversed(tried) if attempt.size <= widest}.values()
        )[::-1]
        if not possible:
            raise self._too_few(most + 1)
        return possible

    def held(self) -> list[Attempt]:
        """Trains of the length requested, the fewest pulses first; raises Infeasible where there is
        none.
        """
        left = self.left
        fewest = self._fewest(self.strongest)
        most = min(self.most, len(left))
        if fewest > most:
            raise self._too_few(fewest)
        counts = range(fewest, min(most, fewest + 2 * TRIES) + 1)
        closing = [count for count in counts if left[count - 1] <= OPEN]
        enough = [
            count
            for count in closing
            if count - self.needed / self.strongest >= 0.5 * self._spare(count)
        ]
        tried = [
            Attempt(count, self.on_time, bool(left[count - 1] <= CLOSED))
            for count in enough or closing
        ]
        if not tried:
            raise self._in_phase(fewest, counts[-1])
        return tried[: 2 * TRIES]

    def _fewest(self, each: float) -> int:
        """Least number of pulses that turn H by up to ``each`` N m s; two at least, to close."""
        return max(math.ceil(_ratio(self.needed, each) - 1e-9), 2)

    @cached_property
    def left(self) -> Vector:
        """Sum of the phasors of the first 1, 2, … pulses and the nutation at the start, in pulses,
        (n,).
        """
        # Moments (s) of right phase within the limits, undisturbed, and the direction in the body
        # of each push.
        shots: list[tuple[float, complex]] = []
        ready = self.at_leg.limits.earliest
        on_time = 0.0 if self.ideal else self.on_time
        firsts = [
            (_aligned(self.at_leg, channel, self.ahead, ready), channel.transverse)
            for channel in self.channels
        ]
        gap = max(self.at_leg.limits.gap, 0.5 * self.turn / self.options.per_turn - on_time)

        def after(first: float, time: float) -> float:
            """Moment of the phase of ``first`` from ``time`` s on."""
            return first + max(math.ceil((time - first) / self.turn - 1e-9), 0) * self.turn

        for _ in range(MOST_PULSES + len(self.at_leg.limits.blackout)):
            start = self.windows.earliest_start(on_time, ready)
            if start is None or len(shots) == MOST_PULSES:
                break
            centre = start + 0.5 * on_time
            if firsts:
                first, push = min(firsts, key=lambda shot: after(shot[0], centre))
                t = after(first, centre)
            else:
                t = centre
                push = _in_body(self.at_leg, self.ahead, centre)
            if t + 0.5 * on_time > self.windows.horizon:
                break
            free = self.windows.blocked_until(t - 0.5 * on_time, on_time)
            if free is not None:
                ready = max(free, ready + 0.25 * self.turn)
                continue
            shots.append((t, push))
            ready = t + 0.5 * on_time + gap
            if not firsts:
                ready = max(t + self.turn / self.options.per_turn - 0.5 * on_time, ready)
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

    def _in_phase(self, fewest: int, most: int) -> Infeasible:
        """Error where trains of ``fewest`` to ``most`` pulses leave nutation."""
        ratio = self.at_leg.axial / (
            self.at_leg.inertia.A * self.at_leg.spin * self.options.per_turn
        )
        least = math.degrees(float(self.left[fewest - 1 : most].min()) * self.way / most)
        if abs(ratio - round(ratio)) * most >= 1.0:
            return Infeasible(
                f"no train of {fewest} to {most} pulses, as limits and on-times allow, ends "
                f"without nutation: at least {least:.3g}° would be left; try a longer horizon "
                "or another --per-turn"
            )
        return Infeasible(
            f"C/(A × pulses per turn) = {ratio:.4g} is near a whole number, so the pulses "
            "meet the nutation in nearly the same phase and build it up. The best train of "
            f"{fewest} to {most} pulses would leave {least:.3g}°; try another --per-turn, a "
            "longer horizon, half-cone or two-pulse"
        )

    def _too_few(self, needed: int) -> Infeasible:
        """Message on limits that leave too few times or pulses."""
        most = self.at_leg.limits.max_pulses
        moments = len(self.left)
        if most is not None and most < needed:
            return Infeasible(
                f"a train to the target takes at least {needed} pulses, and limits.max_pulses "
                f"leaves {most} for it"
            )
        if needed <= moments:
            return Infeasible(
                "this many of the shortest pulses turn H beyond the target; lower min_on_time, "
                "or use two-pulse"
            )
        turns = needed / self.options.per_turn * self.turn
        return TooShort(
            f"a train to the target takes {needed} pulses, about {turns:.4g} s, and the "
            f"limits leave time for {moments}; allow longer pulses, more pulses a turn, or "
            "a longer horizon"
        )


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
    _, quaternions = Arc.of(at_leg.inertia, at_leg.initial).motion(np.array([t]))
    body = attitude.matrix(quaternions[0]).T @ direction
    return complex(body[0], body[1])


def _ratio(whole: float, part: float) -> float:
    """Ratio of ``whole`` to ``part``; a billion at most, also where the part is nothing."""
    return whole / part if whole < 1e9 * part else 1e9


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
        raise Infeasible(f"{why}; {_another(spacecraft, options)}") from None


def _train(spacecraft: Spacecraft, options: RhumbLineOptions) -> Schedule:
    """Train from t = 0, or else after damping of the nutation.
    Raises Infeasible with the reason.
    """
    builder = FlownBuilder(spacecraft)
    reason = Infeasible("")
    train = Train(builder.at_leg, options)
    if spacecraft.least_impulse <= 0.5 * train.strongest and train.way > ROUNDING:
        try:
            return _best(builder, train)
        except Infeasible as why:
            reason = why
    if spacecraft.least_impulse <= 1e-9 * train.h:
        raise reason
    builder = one_pulse.damped(builder)
    if builder.left <= ROUNDING:
        return builder.schedule(note("no-train"))
    return _best(builder, Train(builder.at_leg, options))


def _another(spacecraft: Spacecraft, options: RhumbLineOptions) -> str:
    """Advice on a pulse length that works instead of the requested one, the nearest first."""
    builder = FlownBuilder(spacecraft)
    given = options.on_time or 0.0
    ticks = spacecraft.limits.tick is not None
    with suppress(Infeasible):
        if spacecraft.least_impulse > 1e-9 * abs(spacecraft.axial):
            builder = one_pulse.damped(builder)
        train = Train(builder.at_leg, replace(options, on_time=None))
        counts = range(2, min(len(train.left), train.most) + 1)
        lengths = {train.size(count) for count in counts if train.left[count - 1] <= OPEN}
        if ticks:
            lengths |= {train.windows.nearest_tick(given), train.windows.tick_after(given)}
        possible = [
            length
            for length in lengths
            if train.shortest <= length <= train.widest and length > 0.0
        ]
        for length in sorted(possible, key=lambda length: abs(length - given))[:OTHERS]:
            digits = 3 - math.floor(math.log10(length))
            rounded = (
                math.ceil(length * 10.0**digits) / 10.0**digits
            )  # up: so that no more pulses are needed
            with suppress(Infeasible):
                whole = _train(spacecraft, replace(options, on_time=rounded))
                if correction.left(spacecraft, whole) <= max(
                    10.0 * EXACT, ticks * tolerable(spacecraft)
                ):
                    return f"--on-time {rounded:.4g}s works, with {len(whole)} pulses in all"
    return "no other length was found that works"


def _best(builder: FlownBuilder, train: Train) -> Schedule:
    """Train that leaves least, of those that leave nothing the first, unless a later one costs
    clearly less.
    """
    best = math.inf, math.inf, Schedule()
    before = sum(pulse.magnitude for pulse in builder.pulses)
    requested = train.options.on_time
    floor = train.needed / precession.arc_efficiency(
        train.at_leg.spin, train.shortest if requested is None else requested
    )
    for attempt in train.free() if requested is None else train.held():
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
        schedule, left = _flown(builder.fork(), train, attempt)
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


def _flown(builder: FlownBuilder, train: Train, attempt: Attempt) -> tuple[Schedule, float]:
    """Train, each pulse aimed from the current H, the last ones moved; and its residual, rad."""
    count = attempt.pulses
    for remaining in range(count, 0, -1):
        pulse = train.next_pulse(builder.at_leg, remaining, attempt)
        if pulse is None or work.exhausted():
            break
        builder.fire((pulse,))
    fired = min(count, len(builder.pulses))
    for last in MOVED:
        before = builder.left
        if before < EXACT or work.exhausted():
            break
        # A train of more than 60 pulses has little to spare: its size is not corrected.
        builder.correct(
            min(last, fired), resized=count if attempt.resizable and count <= SHORT else 0
        )
        if train.at_leg.limits.tick is not None and builder.left > 0.5 * before:
            break  # what is left is the rounding of starts
    if not builder.pulses:
        return builder.schedule(), builder.left
    on_time = builder.pulses[-1].on_time
    description = note(
        "great-circle-train" if train.at_leg.goal.sun is None else "rhumb-line-train",
        count=count,
        channels=", ".join(channel.name for channel in train.channels) or "the steerable torquer",
        on_time_s=on_time,
        way_deg=math.degrees(train.way),
        efficiency=float(precession.arc_efficiency(train.at_leg.spin, on_time)),
        damping=max(len(builder.pulses) - count, 0),
    )
    return builder.schedule(description), builder.left
