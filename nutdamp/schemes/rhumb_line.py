"""A train of short pulses at a fixed inertial phase, which walks H to the target; one or more in each spin turn.

Each pulse turns H by J/(C|ω3|) and gives the nutation a phasor, and from one pulse to the next that phasor turns by
2πC/(AK) for K pulses a turn. So N pulses leave (J/C|ω3|)|sin(Nφ/2)/sin(φ/2)| of nutation, φ = 2πC/(AK): N is
chosen so that they close, a nutation at t = 0 included, and the last pulses are trimmed on the flown motion. Near
φ = 2π, which is C = A for one pulse a turn, and C = 2A too, every pulse meets the nutation in the same phase.

The phase is that of the great circle to the target, or fixed against the Sun: then H follows a rhumb line.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np

from nutdamp.errors import Infeasible
from nutdamp.flight import Arc
from nutdamp.physics import attitude, pointing
from nutdamp.schedule import Pulse, Schedule, channel_pulse, steerable_pulse
from nutdamp.schemes import Options, approach
from nutdamp.schemes.advice import no_channels, no_target
from nutdamp.schemes.journey import ROUNDING, Journey, tolerable
from nutdamp.schemes.windows import Windows, usable
from nutdamp.spacecraft import Channel, Spacecraft, Vector

TURN_SHARE = 0.125
"""Default on-time as a share of the spin turn: 2.6 % of the impulse is lost to the arc."""

WIDEST = 0.4
"""Share of the spin turn up to which pulses widen where the horizon is short: a quarter of the impulse is lost."""

STEP = math.radians(2.0)
"""Angle that one ideal impulse turns H by, at most."""

CLOSED = 0.3
"""Phasors that sum to less than this many pulses count as closed: the rest is trimmed."""

OPEN = 1.2
"""Sum of the phasors, in pulses, beyond which trimming has no hope."""

MOST_PULSES = 600

TRIMMED = (4, 6, 10)
"""How many of the last pulses are trimmed, one number after the other until nothing is left."""

TRIES = 4
"""Pulse counts that are flown, at most."""

EXACT = 1e-10
"""rad of flown residual that counts as nothing."""


class Shot(NamedTuple):
    """A moment (s) at which a channel, or with None the steerable torquer, has the right phase; all undisturbed."""

    t: float
    channel: Channel | None


def schedule(spacecraft: Spacecraft, options: Options) -> Schedule:
    """The train, after one pulse (or a train against ω) where there is more nutation than it can take along.

    ``options.on_time`` and ``per_turn`` as in `Options`. Raises Infeasible with the reason.
    """
    if spacecraft.goal.axis is None:
        raise Infeasible(no_target())
    if spacecraft.torquer is None and not usable(spacecraft):
        raise Infeasible(no_channels(spacecraft))
    journey, reason = Journey(spacecraft), Infeasible("")
    train = _Train(journey.here, options)
    if spacecraft.least_impulse <= 0.5 * train.strongest:
        try:
            return _best(journey, train)
        except Infeasible as why:
            reason = why
    if spacecraft.least_impulse <= 1e-9 * train.h:
        raise reason
    journey.fire(approach.damping(journey.here))
    if journey.left <= ROUNDING:
        return journey.schedule("what damps the nutation brings H to the target already: no train is needed")
    return _best(journey, _Train(journey.here, options))


def _best(journey: Journey, train: _Train) -> Schedule:
    """The train from where the ``journey`` is that leaves least; raises Infeasible where that is too much."""
    best: tuple[float, Schedule] | None = None
    for count in train.counts():
        made, left = _flown(journey.fork(), train, count)
        if best is None or left < 0.5 * best[0]:
            best = left, made
        if left < EXACT:
            break
    if best is None or best[0] > tolerable(train.here):
        raise Infeasible(train.reason(best))
    return best[1]


def _flown(journey: Journey, train: _Train, count: int) -> tuple[Schedule, float]:
    """The train of ``count`` pulses, each aimed from where H then is, the last trimmed; and what it leaves, rad."""
    for remaining in range(count, 0, -1):
        pulse = train.next_pulse(journey.here, remaining)
        if pulse is None:
            break
        journey.fire((pulse,))
    fired = min(count, len(journey.pulses))
    for last in TRIMMED:
        if journey.left < EXACT:
            break
        journey.trim(min(last, fired))
    return journey.schedule(train.note(journey, count)), journey.left


class _Train:
    """What a train from the motion of ``here`` can do."""

    def __init__(self, here: Spacecraft, options: Options) -> None:
        self.here, self.options = here, options
        self.windows = Windows(here)
        self.turn = 2.0 * math.pi / abs(here.spin)
        self.h = here.inertia.C * abs(here.spin)
        self.sun = here.goal.sun
        self.channels = [] if here.torquer is not None else _spread(usable(here), options.per_turn)
        if self.channels:
            self.torque = min(abs(channel.transverse) for channel in self.channels)
            self.shortest = max(channel.min_on_time for channel in self.channels)
            self.longest = min(channel.max_on_time for channel in self.channels)
        else:
            assert here.torquer is not None
            self.torque = math.inf if here.torquer.torque is None else here.torquer.torque
            self.shortest, self.longest = 0.0, math.inf
        asked = options.on_time
        if asked is not None and not self.shortest <= asked <= self.longest:
            raise Infeasible(
                f"an on-time of {asked:.4g} s is outside what the channels allow: "
                f"{self.shortest:.4g} s to {self.longest:.4g} s"
            )
        self.on_time = min(self.longest, TURN_SHARE * self.turn) if asked is None else asked
        self.on_time = max(self.on_time, self.shortest)
        self.way = pointing.course(here.momentum, here.target_axis, self.sun)[1]

    def turns_by(self, on_time: float) -> float:
        """By how much a pulse turns H, N m s."""
        return self.torque * on_time * pointing.arc_efficiency(self.here.spin, on_time)

    @property
    def strongest(self) -> float:
        """By how much a full pulse of the train turns H, N m s."""
        return STEP * self.h if math.isinf(self.torque) else self.turns_by(self.on_time)

    def counts(self) -> list[int]:
        """Pulse counts worth flying: those with which the phasors of the nutation close, the fewest pulses first.

        Raises Infeasible with the reason where there is none.
        """
        shots, fewest = self.shots(), self.fewest()
        if fewest > len(shots):
            widest = self.on_time if self.options.on_time is not None else min(self.longest, WIDEST * self.turn)
            wide = STEP * self.h if math.isinf(self.torque) else self.turns_by(widest)
            fewest = max(math.ceil(self.h * self.way / wide - 1e-9), 2)
        most = min(len(shots), self._most())
        if fewest > most:
            raise Infeasible(self._too_few(fewest, len(shots)))
        left = self.left_by(shots)[:most]
        closing = [count for count in range(fewest, most + 1) if left[count - 1] <= CLOSED]
        if not closing:
            best = int(np.argmin(left[fewest - 1 :])) + fewest
            if left[best - 1] > OPEN:
                raise Infeasible(self._in_phase(fewest, most, float(left[best - 1])))
            closing = [best]
        # Of the next few counts the one that closes best, then in turn.
        near = [count for count in closing if count <= 1.25 * closing[0] + 3]
        return sorted(near, key=lambda count: left[count - 1])[:TRIES]

    def fewest(self) -> int:
        """Pulses that it takes with the on-time wanted; two at least, to close."""
        return max(math.ceil(self.h * self.way / self.strongest - 1e-9), 2)

    def _most(self) -> int:
        """Pulses that are allowed, and not shorter than they can be."""
        most = self.here.limits.max_pulses
        allowed = MOST_PULSES if most is None else most
        if self.shortest > 0.0:
            allowed = min(allowed, int(self.h * self.way / self.turns_by(self.shortest)))
        return allowed

    def left_by(self, shots: list[Shot]) -> Vector:
        """Sum of the phasors of the first 1, 2, … pulses and the nutation at the start, in pulses, (n,)."""
        start, A, a, spin = self.here.initial, self.here.inertia.A, self.here.inertia.a, self.here.spin
        ahead = self._ahead(self.here)
        pushes = np.array([self._body(Arc(A, self.here.inertia.C, 0.0, start), shot, ahead) for shot in shots])
        if len(shots) == 0:
            return np.empty(0)
        turned = np.exp(1j * a * spin * np.array([shot.t for shot in shots]))
        sums = np.cumsum(pushes * turned)
        counts = np.arange(1, len(shots) + 1)
        return np.asarray(np.abs(A * start.omega * counts / (self.h * self.way) + sums))

    def _body(self, arc: Arc, shot: Shot, ahead: Vector) -> complex:
        """Direction of a pulse in the body, as a unit complex number."""
        if shot.channel is not None:
            return shot.channel.transverse / abs(shot.channel.transverse)
        _, quaternions = arc.motion(np.array([shot.t]))
        body = attitude.matrix(quaternions[0]).T @ ahead
        return cmath.exp(1j * math.atan2(body[1], body[0]))

    def shots(self) -> list[Shot]:
        """Moments of right phase, one pulse after the other as the limits allow them."""
        found: list[Shot] = []
        ready, on_time = self.here.limits.earliest, 0.0 if math.isinf(self.torque) else self.on_time
        firsts = [(self._first(channel), channel) for channel in self.channels]
        gap = max(self.here.limits.gap, 0.5 * self.turn / self.options.per_turn - on_time)
        while len(found) < MOST_PULSES:
            start = self.windows.earliest_start(on_time, ready)
            if start is None:
                break
            centre = start + 0.5 * on_time
            if firsts:
                moments = [
                    (first + max(math.ceil((centre - first) / self.turn - 1e-9), 0) * self.turn, number)
                    for number, (first, _) in enumerate(firsts)
                ]
                t, number = min(moments)
                shot = Shot(t, firsts[number][1])
            else:
                shot = Shot(centre, None)
            if shot.t + 0.5 * on_time > self.windows.horizon:
                break
            free = self.windows.blocked_until(shot.t - 0.5 * on_time, on_time)
            if free is not None:
                ready = free
                continue
            found.append(shot)
            ready = shot.t + 0.5 * on_time + gap
            if not firsts:
                ready = max(shot.t + self.turn / self.options.per_turn - 0.5 * on_time, shot.t + 0.5 * on_time + gap)
        return found

    def _ahead(self, here: Spacecraft) -> Vector:
        return pointing.course(here.momentum, here.target_axis, self.sun)[0]

    def _first(self, channel: Channel) -> float:
        return _aligned(self.here, channel, self._ahead(self.here), self.here.limits.earliest)

    def next_pulse(self, here: Spacecraft, remaining: int) -> Pulse | None:
        """The next pulse of ``remaining`` ones from the motion of ``here``; None where the limits leave no moment."""
        ahead, way = pointing.course(here.momentum, here.target_axis, self.sun)
        windows, limits = Windows(here), here.limits
        share = self.h * way / remaining
        on_time = 0.0
        if not math.isinf(self.torque):
            wanted = float(pointing.on_times_to_turn(np.array([share]), self.torque, here.spin)[0])
            widest = max(self.on_time, min(self.longest, WIDEST * self.turn))
            on_time = windows.on_time(wanted if math.isfinite(wanted) else widest, self.shortest, widest)
        ready, turn = limits.earliest, self.turn / self.options.per_turn
        begun = here is not self.here
        if self.channels:  # no two in the same passage of the phase
            return self._passing(here, windows, ahead, on_time, max(ready, 0.5 * turn - on_time) if begun else ready)
        if begun:
            ready = max(ready, turn - on_time)
        start = windows.earliest_start(on_time, ready)
        if start is None:
            return None
        centre = start + 0.5 * on_time
        body = self._body(Arc(here.inertia.A, here.inertia.C, 0.0, here.initial), Shot(centre, None), ahead)
        assert here.torquer is not None
        asked = {"impulse": share} if here.torquer.torque is None else {"on_time": on_time}
        return steerable_pulse(here.torquer, centre, cmath.phase(body), **asked)

    def _passing(self, here: Spacecraft, windows: Windows, ahead: Vector, on_time: float, ready: float) -> Pulse | None:
        """The first firing of a channel as it passes the phase that the limits allow."""
        for _ in range(MOST_PULSES):
            moments = [(_aligned(here, channel, ahead, ready + 0.5 * on_time), channel) for channel in self.channels]
            t, channel = min(moments, key=lambda one: one[0])
            start = windows.nearest_tick(t - 0.5 * on_time)
            free = windows.blocked_until(start, on_time)
            if start + on_time > windows.horizon + 1e-9:
                return None
            if free is None and start >= here.limits.earliest - 1e-9:
                return channel_pulse(channel, start + 0.5 * on_time, on_time)
            ready = max(free or 0.0, start + 0.25 * self.turn)
        return None

    def note(self, journey: Journey, count: int) -> str:
        """What the train is, in words."""
        efficiency = pointing.arc_efficiency(self.here.spin, journey.pulses[-1].on_time)
        line = "great circle" if self.sun is None else "rhumb line at a fixed Sun phase"
        names = ", ".join(channel.name for channel in self.channels)
        damped = len(journey.pulses) - count
        return (
            (f"{damped} pulse{'s' if damped > 1 else ''} to damp the nutation, then " if damped > 0 else "")
            + f"{count} pulses"
            + (f" of {names}" if names else "")
            + f" along the {line} of {math.degrees(self.way):.4g}°, arc efficiency {efficiency:.4f}"
        )

    def reason(self, best: tuple[float, Schedule] | None) -> str:
        """Why the ``best`` train found, with what it leaves (rad), is none."""
        text = "no train of pulses was found that ends on the target within the limits"
        return text if best is None else f"{text}; the best would leave {math.degrees(best[0]):.3g}°"

    def _too_few(self, needed: int, moments: int) -> str:
        most = self.here.limits.max_pulses
        if most is not None and most < needed:
            return f"a train to the target takes {needed} pulses at least, and limits.max_pulses allows {most}"
        if needed <= moments:
            return "the shortest pulses turn H beyond the target in so many; lower min_on_time, or take two-pulse"
        turns = needed / self.options.per_turn * self.turn
        return (
            f"a train to the target takes {needed} pulses, about {turns:.4g} s, and the limits leave moments for "
            f"{moments}; a longer horizon, longer pulses or more of them a turn help"
        )

    def _in_phase(self, fewest: int, most: int, left: float) -> str:
        inertia, per_turn = self.here.inertia, self.options.per_turn
        ratio = inertia.C / (inertia.A * per_turn)
        off = abs(ratio - round(ratio))
        least = math.degrees(left * self.way / most)
        if off * most >= 1.0:
            return (
                f"of {fewest} to {most} pulses, as many as limits and on-times allow, no number brings the nutation "
                f"back to nothing: {least:.3g}° would be left; a longer horizon or another --per-turn can help"
            )
        return (
            f"C/(A × pulses per turn) = {ratio:.4g} is so near a whole number that pulse after pulse meets the "
            f"nutation in nearly the same phase: even the best train, of {fewest} to {most} pulses, "
            f"would leave {least:.3g}°; another --per-turn, a longer horizon, half-cone or two-pulse can help"
        )


def _aligned(here: Spacecraft, channel: Channel, ahead: Vector, ready: float) -> float:
    """First moment (s) from ``ready`` on at which the torque of ``channel`` points along ``ahead`` (3,), inertial."""
    direction = channel.transverse / abs(channel.transverse)
    arc, turn = Arc(here.inertia.A, here.inertia.C, 0.0, here.initial), 2.0 * math.pi / abs(here.spin)
    t = ready
    for step in range(12):
        _, quaternions = arc.motion(np.array([t]))
        body = attitude.matrix(quaternions[0]).T @ ahead
        off = cmath.phase(direction * complex(body[0], -body[1]))  # the torque is so far ahead of it
        change = -off / here.spin
        if step == 0:
            change %= turn
        t += change
        if abs(change) < 1e-12 * turn:
            break
    return t if t >= ready - 1e-9 else t + turn


def _spread(channels: list[Channel], count: int) -> list[Channel]:
    """``count`` channels of directions as different as can be, the one that costs least for its torque first."""
    if not channels:
        raise Infeasible("once the nutation is taken out no time is left for the turn")
    chosen = [min(channels, key=lambda one: (one.price, -abs(one.transverse)))]
    while len(chosen) < count:

        def apart(channel: Channel) -> float:
            return min(abs(cmath.phase(channel.transverse * one.transverse.conjugate())) for one in chosen)

        farthest = max(channels, key=apart)
        if apart(farthest) < 0.2:
            raise Infeasible(
                f"{count} pulses a spin turn ask for {count} channels of different directions, for each passes the "
                f"phase once a turn; there are {len(chosen)}"
            )
        chosen.append(farthest)
    return chosen
