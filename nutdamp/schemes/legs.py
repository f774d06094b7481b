"""Schedules leg by leg: pulses, or the blocks that fire them, each flown as it is taken."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from nutdamp.common import work
from nutdamp.common.results import Note
from nutdamp.errors import Infeasible, TooShort
from nutdamp.flight import propagation
from nutdamp.flight.dynamics import Supply, lightened
from nutdamp.physics import attitude
from nutdamp.physics.triaxial import widest_cones
from nutdamp.schemes import correction, one_pulse
from nutdamp.schemes.block_model import fired, sun_pulses
from nutdamp.schemes.catalogue import FourPulseOptions, SchemeOptions
from nutdamp.schemes.four_pulse import full_on_time, suffices
from nutdamp.spacecraft.constraints import Windows, at_hand, usable, without_waste
from nutdamp.spacecraft.equipment import Block, Channel
from nutdamp.spacecraft.model import Attitude, Spacecraft, disturbing_after
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import STEERABLE, Pulse, Schedule, channel_pulse, steerable_pulse

PREDAMPING_INTEGRATED = 20_000  # steps of integration after which no more dampings are tried
IN_REACH = 0.5  # share of the horizon within which the damping begins: the rest is for the turn
MOMENTS = 16  # earliest starts of the damping that are tried


class Legs:
    """Pulses and ``blocks`` chosen so far, and the spacecraft after them.

    ``at_leg`` is the spacecraft at ``now`` s, the end of the last pulse, as if its time began
    there, with the goal of the whole. ``steps``: of integration that the flight took so far.
    """

    def __init__(self, spacecraft: Spacecraft) -> None:
        self.spacecraft = spacecraft
        self.at_leg = replace(
            with_limits(spacecraft, horizon=spacecraft.horizon),
            goal=replace(spacecraft.goal, axis=spacecraft.target_axis),
        )
        self.now = 0.0
        self.steps = 0
        self.pulses: list[Pulse] = []
        self.blocks: list[Block] = []
        self._before: list[tuple[float, Spacecraft]] = []

    @property
    def left(self) -> float:
        """Residual, rad: nutation or distance of H from the target, whichever is larger."""
        return max(self.at_leg.nutation, self.at_leg.to_turn)

    def fork(self) -> Legs:
        """Other legs that go on from here."""
        other = Legs(self.at_leg)
        other.now, other.pulses, other._before = self.now, list(self.pulses), list(self._before)
        return other

    def fire(self, leg: Schedule | Iterable[Pulse], *, bounded: bool = False) -> None:
        """Take and fly the pulses of a ``leg``, in order, timed from ``now``, and its blocks, whose
        Sun pulses count from there. Infeasible where they are ``bounded`` by work left.
        """
        base = self.now
        if isinstance(leg, Schedule) and leg.blocks:
            flight = propagation.flown(self.spacecraft, Schedule(tuple(self.pulses)), base)
            passed = len(sun_pulses(flight, base)) if base > 0.0 else 0
            self.blocks += [replace(block, first=block.first + passed) for block in leg.blocks]
        for pulse in leg:
            if bounded and work.exhausted():
                raise Infeasible("the flight of the pulses for that was not finished")
            at_leg = self.at_leg
            self._before.append((self.now, at_leg))
            timed = pulse.moved(base)
            leg_pulse = timed.moved(-self.now)
            flown = propagation.flown(at_leg, Schedule((leg_pulse,)))
            settled, since, limits = flown.settled, leg_pulse.over, at_leg.limits
            to_principal = attitude.from_matrix(at_leg.inertia.axes.T)
            before = at_leg.attitude or Attitude(settled.quaternion)
            turned = attitude.multiply(settled.quaternion, to_principal)
            supply = Supply(at_leg)
            supply.count((leg_pulse,))
            most = limits.max_pulses
            self.at_leg = replace(
                supply.behind(at_leg),
                inertia=lightened(at_leg, leg_pulse.propellant or 0.0),
                omega0=settled.rates,
                attitude=replace(before, quaternion=turned, epoch=None),
                disturbances=disturbing_after(at_leg.disturbances, since),
                limits=replace(
                    limits,
                    horizon=at_leg.horizon - since,
                    earliest=limits.gap,
                    max_pulses=None if most is None else most - 1,
                    blackout=tuple(
                        (begins - since, ends - since)
                        for begins, ends in limits.blackout
                        if ends > since
                    ),
                ),
            )
            self.steps += flown.steps
            self.pulses.append(timed)
            self.now = timed.over

    def correct(self, last: int, *, resized: int = 0) -> None:
        """Move the ``last`` pulses until nothing is left; sizes stay, but those of ``resized``
        equal ones, as one.
        """
        taken = min(max(last, resized), len(self.pulses))
        if last == 0 or taken == 0:
            return
        self.now, self.at_leg = self._before[-taken]
        made = Schedule(tuple(pulse.moved(-self.now) for pulse in self.pulses[-taken:]))
        del self.pulses[-taken:], self._before[-taken:]
        chosen = range(max(taken - last, 0), taken)
        self.fire(
            correction.correct(
                self.at_leg, made, chosen=chosen, momentum=True, equal=True, resizable=resized > 0
            )
        )

    def schedule(self, *notes: Note) -> Schedule:
        """All legs in one, blocks with the Sun pulses of the whole flight; ideal pulses of a
        steerable torquer at one moment as their sum.
        """
        if self.blocks:
            return replace(fired(self.spacecraft, self.blocks), notes=notes)
        pulses = list[Pulse]()
        torquer = self.at_leg.torquer
        for pulse in self.pulses:
            ideal = pulse.channel == STEERABLE and pulse.on_time == 0.0
            if torquer is not None and ideal and pulses and pulses[-1].t == pulse.t:
                first, second, _ = (pulses.pop().impulse + pulse.impulse).tolist()
                angle = math.atan2(second, first)
                size = math.hypot(first, second)
                pulses.append(steerable_pulse(torquer, pulse.t, angle, impulse=size))
            else:
                pulses.append(pulse)
        return Schedule(tuple(pulses), notes)


def damped(start: Legs) -> Legs:
    """The ``start``, after the damping by one pulse or a train, from which the rest of the way
    costs least.

    H then goes to the momentary spin axis. Its pulses cost A|ω0| whenever they come, but the turn
    that is left, C|ω3| times its angle, differs by the cone. Raises Infeasible where no channel can
    damp, or the budget ends before.
    """
    at_leg = start.at_leg
    steps = 0
    # A torquer can fire at any point of the cone; channels at their alignments, which come by the
    # body period.
    span = at_leg.inertial_period
    if at_leg.torquer is None:
        span = 4.0 * min(at_leg.body_period, 0.1 * at_leg.horizon)
    best: tuple[float, Legs] | None = None
    reason: Infeasible | None = None
    for number in range(MOMENTS):
        earliest = at_leg.limits.earliest + number * span / MOMENTS
        if number > 0 and earliest > IN_REACH * at_leg.horizon:  # the rest is for the turn
            break
        legs = start.fork()
        try:
            damping = one_pulse.schedule(with_limits(at_leg, earliest=earliest), SchemeOptions())
            legs.fire(damping, bounded=True)
        except Infeasible as why:
            reason = why
        else:
            to_go = legs.at_leg.to_turn + 2.0 * legs.at_leg.nutation
            cost = damping.total_impulse + abs(at_leg.axial) * to_go
            if best is None or cost < best[0]:
                best = cost, legs
            steps += legs.steps
        if steps > PREDAMPING_INTEGRATED or work.exhausted():
            break
    if best is None:
        text = f"the nutation is to be taken out first, and {reason}"
        raise TooShort(text) if isinstance(reason, TooShort) else Infeasible(text)
    return best[1]


# --- three moments

MOST_FLOWN = 200  # pulses that are laid one by one on the true motion, at most
# moments in a period at which pulses are looked at, shares of a full one
LOOKS = 240
SHARES = 0.88 ** np.arange(40)
LIKE, LEFT = (
    0.5,
    1e-4,
)  # share of the largest gain with which an earlier pulse is fired; rad left to correction


def on_true_motion(spacecraft: Spacecraft, options: FourPulseOptions) -> Schedule:
    """Four-pulse of three moments, whose large nutation turns unevenly and at a rate of its own: by
    the law of ideal rate gyros.

    Each pulse is one that lowers, as an impulse, the largest nutation of the motion that follows
    most. Channels that waste fire only where the others leave too much.
    """
    channels = at_hand(spacecraft, usable(spacecraft))
    thrifty = without_waste(spacecraft, channels)
    legs = _fired(spacecraft, options, thrifty)
    if len(thrifty) < len(channels) and not suffices(spacecraft, legs.at_leg.nutation):
        other = _fired(spacecraft, options, channels)
        legs = min(legs, other, key=lambda each: each.at_leg.nutation)
    return legs.schedule()


def _fired(spacecraft: Spacecraft, options: FourPulseOptions, channels: list[Channel]) -> Legs:
    """Pulses of the ``channels``, each the one to fire next within a period of the motion, until
    none lowers the nutation.
    """
    legs = Legs(spacecraft)
    count = spacecraft.limits.max_pulses or MOST_FLOWN
    while len(legs.pulses) < count and legs.at_leg.nutation > LEFT and not work.exhausted():
        at_leg = legs.at_leg
        windows = Windows(at_leg)
        earliest = at_leg.limits.earliest
        moments = np.tile(np.array(at_leg.inertia.moments)[:, None], LOOKS)
        period = min(at_leg.motion_period, at_leg.horizon)
        times = earliest + np.linspace(0.0, period, LOOKS)
        rates = propagation.flown(at_leg, Schedule(), float(times[-1])).motion(times)[0].T
        best = list[tuple[float, Pulse]]()
        for channel in channels:
            full = full_on_time(period, channel, options.on_time)
            tried = list[tuple[float, float, float]]()
            for on_time in dict.fromkeys(
                windows.on_time(full * share, channel.min_on_time, full) for share in SHARES
            ):
                after = rates + channel.torque[:, None] * on_time / moments
                left = widest_cones(moments, after, at_leg.sense, at_leg.inertia.wheel)[0]
                starts = times - 0.5 * on_time
                left[~windows.allowed(starts, np.full(LOOKS, on_time), earliest)] = math.inf
                at = int(np.argmin(left))
                tried.append((float(left[at]), float(times[at]), on_time))
            left_over, t, on_time = min(tried)
            best.append((at_leg.nutation - left_over, channel_pulse(channel, t, on_time)))
        largest = max(gain for gain, _ in best)
        if largest <= 0.0:
            break
        good = [pulse for gain, pulse in best if gain >= LIKE * largest]
        further = legs.fork()
        further.fire([min(good, key=lambda pulse: pulse.t)])
        if further.at_leg.nutation >= at_leg.nutation:
            break
        legs = further
    return legs
