"""Schedules laid pulse by pulse on the equivalent symmetric body; reasons of infeasibility."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from nutdamp.common import work
from nutdamp.common.results import note
from nutdamp.errors import Infeasible, TooShort
from nutdamp.physics import body as rigid_body
from nutdamp.physics import response
from nutdamp.schemes.correction import ALIGNED, components
from nutdamp.spacecraft.constraints import Windows, at_hand, bounded_by, usable
from nutdamp.spacecraft.equipment import Channel, Steerable
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.roles import with_limits
from nutdamp.spacecraft.schedule import TOUCHING, Pulse, Schedule, channel_pulse, steerable_pulse

# alignments in a row that rounding to ticks or a disturbance may move to before the actuators are
# ready
MISSED = 50
# share of A|ω0| left to correction under dissipation: `response.width_factor` holds at small angles
# only
CORRECTED = 1e-4

# Pulses that are laid one by one, at most: nobody commands more, and each takes its time to be
# planned and flown.
MOST_PULSES = 2000


class ImpulseBuilder:
    """Predicted transverse rate, and the pulses chosen so far.

    ``omega`` and ``spin`` (rad/s) hold just after the centre of the last pulse at ``now`` s;
    ``ready`` is the first moment at which the next pulse may start.
    """

    def __init__(self, spacecraft: Spacecraft, *, endless: bool = False) -> None:
        self.spacecraft = spacecraft
        self.A, self.C, self.a = spacecraft.inertia.A, spacecraft.inertia.C, spacecraft.inertia.a
        self.wheel = spacecraft.inertia.wheel
        self.windows = Windows(spacecraft, endless=endless)
        self.omega = complex(spacecraft.omega0[0], spacecraft.omega0[1])
        self.spin = spacecraft.spin
        self.now = 0.0
        self.ready, most = spacecraft.limits.earliest, spacecraft.limits.max_pulses
        self.most = MOST_PULSES if most is None else min(most, MOST_PULSES)
        self.pulses: list[Pulse] = []
        self._even = spacecraft.growth == 0.0 or self.wheel != 0.0

    @property
    def left(self) -> float:
        """Impulse in N m s that still has to be taken out: A|ω|."""
        return self.A * abs(self.omega)

    @property
    def nutation(self) -> float:
        """Nutation angle of what is left, rad."""
        return math.atan2(self.left, abs(self.C * self.spin + self.wheel))

    @property
    def settled(self) -> bool:
        """True if the residual is rounding; under dissipation, if correction of the last pulse
        suffices.
        """
        corrected = (
            0.0 if self.spacecraft.growth == 0.0 else CORRECTED * self.spacecraft.least_impulse
        )
        return self.left <= max(1e-13 * abs(self.C * self.spin + self.wheel), corrected)

    @property
    def full(self) -> bool:
        """True if no more pulses are allowed."""
        return len(self.pulses) >= self.most

    def rate(self, spin: float) -> float:
        """Rate ν in rad/s at which ω turns in the body at a ``spin``."""
        return rigid_body.body_rate(self.A, self.C, spin, self.wheel)

    @property
    def turning(self) -> float:
        """`rate` at the present spin."""
        return self.rate(self.spin)

    @property
    def period(self) -> float:
        """Nutation period in the body at the present spin, s; infinite for a sphere."""
        rate = abs(self.turning)
        return 2.0 * math.pi / rate if rate > 0.0 else math.inf

    def _coast(self, time: float) -> tuple[complex, float]:
        """ω and ω3 at ``time`` s if nothing more is fired and no disturbance drives ω."""
        since = time - self.now
        growth = self.spacecraft.growth
        omega = self.omega
        spin = self.spin
        angle = self.turning * since
        slower = self.wheel / self.C
        if growth != 0.0:
            from nutdamp.physics import energy_sink  # dissipation

            motion = omega, spin, since, self.wheel, self.spacecraft.sense
            effect = energy_sink.coast(self.A, self.C, growth, *motion)
            equivalent = math.hypot(spin + slower, self.A / self.C * abs(omega))  # |H|/C
            angle = self.a * equivalent * effect.travel - slower * since
            omega = omega * effect.transverse
            spin = equivalent * effect.along - slower
        drift = self.spacecraft.spin_drift(self.now, time)
        angle += 0.5 * self.a * drift * since * since
        return omega * cmath.exp(-1j * angle), spin + drift * since

    def _sink(self) -> tuple[float, float, float]:
        """κ, cos θ and sin²θ of `energy_sink` just after the last pulse."""
        axial, across = (self.C * self.spin + self.wheel) ** 2, (self.A * abs(self.omega)) ** 2
        size = axial + across
        return self.spacecraft.growth, *(
            (math.sqrt(axial / size), across / size) if size > 0.0 else (1.0, 0.0)
        )

    def omega_at(self, time: float) -> complex:
        """ω at ``time`` s if nothing more is fired."""
        free, _ = self._coast(time)
        if not self.spacecraft.disturbances:
            return free
        from nutdamp.physics import driven  # disturbances

        forced = 0.0 + 0.0j
        for disturbance in self.spacecraft.disturbances:
            begin, lasts = disturbance.within(self.now, time)
            if disturbance.transverse != 0.0 and lasts > 0.0:
                torque = np.array([disturbance.after(begin).transverse])
                rate, since = np.array([disturbance.rate]), np.array([lasts])
                gained = driven.rotating_torques(since, 0.0, self.turning, self.A, torque, rate)
                forced += complex(gained[0]) * cmath.exp(1j * self.turning * (begin + lasts - time))
        return free + forced

    def acts(self, pulse: Pulse) -> complex:
        """Effective impulse of ``pulse`` on ω, J1 + iJ2 in N m s."""
        axial = 0.0 if pulse.torque is None else float(pulse.torque[2])
        _, spin = self._coast(pulse.start)
        rate = self.rate(spin)
        slope = self.a * axial / self.C
        growth = self.spacecraft.growth
        drift = self.a * self.spacecraft.spin_drift(*pulse.thrust)
        factor = response.width_factor(rate, slope, pulse.on_time, growth, drift)
        return complex(pulse.impulse[0], pulse.impulse[1]) * factor

    def left_after(self, pulse: Pulse) -> float:
        """Residual, N m s, if ``pulse`` were fired next."""
        return abs(self.A * self.omega_at(pulse.t) + self.acts(pulse))

    def helps(self, pulse: Pulse) -> bool:
        """True if ``pulse`` lowers the residual."""
        return self.left_after(pulse) < abs(self.A * self.omega_at(pulse.t))

    def fire(self, pulse: Pulse) -> None:
        """Take ``pulse`` into the schedule."""
        omega, (_, spin) = self.omega_at(pulse.t) + self.acts(pulse) / self.A, self._coast(pulse.t)
        self.omega, self.spin = omega, spin + float(pulse.impulse[2]) / self.C
        self.now = pulse.t
        self.ready = pulse.end + self.spacecraft.limits.gap
        self.pulses.append(pulse)

    def schedule(self) -> Schedule:
        """Chosen pulses."""
        cut = note("most-pulses", pulses=MOST_PULSES)
        return Schedule(
            tuple(self.pulses),
            (cut,) if len(self.pulses) == MOST_PULSES and not self.settled else (),
        )

    def on_time_for(
        self, channel: Channel, impulse: float, longest: float = math.inf
    ) -> float | None:
        """On-time in s for which ``channel`` acts on ω like ``impulse`` N m s; None if none up to
        ``longest``.
        """
        slope = self.a * channel.axial / self.C
        return response.on_time_for(impulse, abs(channel.transverse), self.turning, slope, longest)

    def align(self, channel: Channel, on_time: float) -> Pulse | None:
        """Next pulse of ``channel`` against ω that the limits allow, ``on_time`` s long (made
        commandable).
        """
        windows = self.windows
        on_time = windows.on_time(on_time, channel.min_on_time, channel.max_on_time)
        probe = channel_pulse(channel, self.now, on_time)
        turn = rigid_body.phase_to_oppose(self.omega, self.acts(probe))
        if math.isinf(self.period):
            start = windows.earliest_start(on_time, self.ready) if abs(turn) <= ALIGNED else None
            return None if start is None else channel_pulse(channel, start + 0.5 * on_time, on_time)
        first = turn / self.turning  # and the times below: as long as it takes at the present spin
        # Rounding may put a pulse just before it may start, but not on the one before it, nor
        # before t = 0.
        slack = min(TOUCHING, 1e-3 * on_time) if self.pulses else 0.0

        def alignment(ready: float) -> float:
            """Whole turns from ``first`` to the alignment at which a pulse starts at ``ready`` s or
            next.
            """
            since = ready + 0.5 * on_time - slack - self.now
            turned = since
            if not self._even:
                from nutdamp.physics import energy_sink  # dissipation

                growth, cosine, square = self._sink()
                turned = energy_sink.course(growth, cosine, square, since).travel / cosine
            return math.ceil((turned - first) / self.period)

        turns = alignment(self.ready)
        for _ in range(len(windows.limits.blackout) + MISSED):
            turned = first + turns * self.period
            if not self._even:
                from nutdamp.physics import energy_sink  # dissipation

                turned = energy_sink.time_to_turn(*self._sink(), turned)
            centre = self.now + turned
            if math.isinf(centre):  # dissipation stops the spin before
                return None
            if self.spacecraft.disturbances or self.spacecraft.growth != 0.0:
                # ω does not turn evenly: the pulse opposes it by Newton steps.
                for _ in range(20):
                    pulse = channel_pulse(channel, centre, on_time)
                    off = rigid_body.phase_to_oppose(self.omega_at(centre), self.acts(pulse))
                    _, spin = self._coast(centre)
                    centre += off / (self.rate(spin) or self.turning)
                    if abs(off) < ALIGNED:
                        break
            start = centre - 0.5 * on_time
            if windows.limits.tick is not None:
                start = windows.nearest_tick(start)
                centre = start + 0.5 * on_time
            free = windows.blocked_until(start, on_time)
            later = (
                not self.pulses or centre > self.now
            )  # also where the clock cannot tell so short a time
            if start >= self.ready - slack and later and free is None:
                return (
                    channel_pulse(channel, centre, on_time)
                    if windows.allows(start, on_time, self.ready)
                    else None
                )
            # Rounded to a tick before the actuators are ready, opposed earlier by a disturbance, or
            # blacked out.
            turns = max(turns + 1, alignment(self.ready if free is None else free))
        return None

    def steer(self, steerable: Steerable, impulse: float) -> Pulse | None:
        """Earliest pulse of a steerable torquer that acts against ω like ``impulse`` N m s; None if
        none can.
        """
        on_time = self.on_time_to_steer(steerable, impulse)
        if on_time is None:
            return None
        start = self.windows.earliest_start(on_time, self.ready)
        return None if start is None else self.steered(steerable, start, impulse, on_time)

    def on_time_to_steer(self, steerable: Steerable, impulse: float) -> float | None:
        """Commandable on-time in s of a pulse like ``impulse`` N m s, 0 of an ideal one; None if it
        is too weak.
        """
        if steerable.torque is None:
            return 0.0
        needed = response.on_time_for(impulse, steerable.torque, self.turning, 0.0, math.inf)
        return None if needed is None else self.windows.on_time(needed, 0.0, math.inf)

    def steered(self, steerable: Steerable, start: float, impulse: float, on_time: float) -> Pulse:
        """Pulse against ω from ``start`` s on, of an ``impulse`` N m s where it is ideal."""
        centre = start + 0.5 * on_time
        angle = cmath.phase(-self.omega_at(centre))
        return steerable_pulse(steerable, centre, angle, impulse=impulse, on_time=on_time)


def fire_components(
    builder: ImpulseBuilder,
    channels: list[Channel],
    on_time: float | None = None,
    *,
    coarse: bool = False,
) -> None:
    """Pulses where ω does not turn in the body: the channels beside -ω share it, |cos φ| + |sin φ|
    for ±1, ±2.
    """
    for channel, impulse in components(channels, -builder.A * builder.omega):
        unit = impulse / abs(channel.transverse)
        longest = channel.max_on_time if on_time is None else on_time
        count = 1 if math.isinf(longest) else max(math.ceil(unit / longest - 1e-9), 1)
        for _ in range(count):
            needed = longest if coarse and not math.isinf(longest) else unit / count
            lasts = builder.windows.on_time(needed, channel.min_on_time, channel.max_on_time)
            start = builder.windows.earliest_start(lasts, builder.ready)
            if builder.full or start is None:
                return
            pulse = channel_pulse(channel, start + 0.5 * lasts, lasts)
            if not builder.helps(pulse):
                break
            builder.fire(pulse)


# Multiple of the horizon up to which a sufficient one is sought, where the default one is not
# longer; halvings of the last doubling: the one that is named is at most an eighth of it too long.
LATEST, BISECTIONS = 64.0, 3

FREE_LIMITS = {"earliest": 0.0, "blackout": (), "gap": 0.0, "tick": None, "max_pulses": None}
# Keys of limits of a file and of its thrusters, with the values that limit nothing.
FREE_ON_TIMES = {"min_on_time": 0.0, "max_on_time": math.inf}


class Cure(NamedTuple):
    """Limit that helps where no schedule is found, by its key, and the text; empty without one."""

    limit: str
    text: str


def why(spacecraft: Spacecraft, attempt: Callable[[Spacecraft], Schedule | None]) -> Cure:
    """Cure of an ``attempt`` that finds no schedule: the first limit without which it finds one; or
    that none alone helps. Without a text where the work for it is spent.
    """
    with work.cure("a limit to lift"):
        lifted = {
            name: with_limits(spacecraft, **{name: free})
            for name, free in FREE_LIMITS.items()
            if getattr(spacecraft.limits, name) != free
        }
        for name, free in FREE_ON_TIMES.items():
            if any(getattr(channel, name) != free for channel in spacecraft.channels):
                channels = tuple(channel.of(**{name: free}) for channel in spacecraft.channels)
                lifted[name] = replace(spacecraft, channels=channels)
        for name, limited in lifted.items():
            schedule = None if work.exhausted() else attempt(limited)
            if schedule is not None:
                return Cure(name, f"without {name} there is a schedule of {len(schedule)} pulses")
        cure = longer_horizon(spacecraft, attempt)
    if cure.limit or not cure.text:
        return cure
    return Cure("", f"no single limit is the cause, and {cure.text}")


def longer_horizon(
    spacecraft: Spacecraft, attempt: Callable[[Spacecraft], Schedule | None]
) -> Cure:
    """Cure of an ``attempt`` by a longer horizon, as in `why`."""
    low = high = spacecraft.horizon
    latest = max(LATEST * high, with_limits(spacecraft, horizon=None).horizon)
    while high < latest and not work.exhausted():
        low, high = high, float(f"{2.0 * high:.4g}")
        if attempt(with_limits(spacecraft, horizon=high)) is None:
            continue
        for _ in range(BISECTIONS):
            middle = float(f"{0.5 * (low + high):.4g}")
            enough = attempt(with_limits(spacecraft, horizon=middle)) is not None
            low, high = (low, middle) if enough else (middle, high)
        return Cure("horizon", f"limits.horizon = {high:.4g} s is long enough")
    return Cure(
        "", "" if work.exhausted() else f"{LATEST:g} times the horizon does not help either"
    )


# Reason why a final spin cannot be had.
NO_AXIAL = "no channel has a torque about axis 3, so no channel can set the spin; leave out --spin"


def expect_aim(spacecraft: Spacecraft) -> None:
    """Raise Infeasible without a target to which a scheme could turn the spin axis, or without an
    actuator.
    """
    if spacecraft.goal.axis is None:
        raise Infeasible("needs a target axis: --target, or goal in the file")
    if spacecraft.torquer is None:
        at_hand(spacecraft, usable(spacecraft))


def no_alignment(spacecraft: Spacecraft, channels: list[Channel]) -> Infeasible:
    """Error where no channel can be fired against ω within the limits."""
    if spacecraft.nutation_rate == 0.0:
        omega = complex(spacecraft.omega0[0], spacecraft.omega0[1])
        off = {
            channel.name: abs(cmath.phase(-omega * channel.transverse.conjugate()))
            for channel in channels
        }
        nearest = min(off, key=lambda name: off[name])
        return Infeasible(
            "no channel opposes the nutation, and waiting does not help: ω does not turn "
            f"in this body. Nearest is {nearest}, {math.degrees(off[nearest]):.4g}° off"
        )
    names = ", ".join(channel.name for channel in channels)
    return TooShort(
        f"no pulse of the channels ({names}) opposes the nutation and lowers it within "
        f"{bounded_by(spacecraft)}"
    )


def reach(spacecraft: Spacecraft) -> float:
    """Most by which one pulse turns H, N m s."""
    from nutdamp.physics import precession  # turns

    torquer, spin = spacecraft.torquer, spacecraft.spin
    if torquer is not None:
        torque = math.inf if torquer.torque is None else torquer.torque
        return precession.reach(torque, spin, math.inf)
    return max(
        (
            precession.reach(abs(channel.transverse), spin, channel.max_on_time)
            for channel in usable(spacecraft)
        ),
        default=0.0,
    )


def strongest_turn(spacecraft: Spacecraft) -> str:
    """Sentence on the turn of H by one pulse, for reasons of infeasibility."""
    most, way = turn_of(spacecraft, reach(spacecraft)), math.degrees(spacecraft.to_turn)
    return f"the target is {way:.4g} deg from H, which one pulse turns by {most} at most"


def turn_of(spacecraft: Spacecraft, impulse: float) -> str:
    """Turn of H in degrees by an ``impulse`` across the spin axis, N m s; of A|ω|, the nutation."""
    return f"{math.degrees(math.atan2(impulse, abs(spacecraft.axial))):.4g} deg"
