"""A schedule laid pulse by pulse along the closed-form motion; what the body-fixed schemes share."""

from __future__ import annotations

import cmath
import math

import numpy as np

from nutdamp.limits import Windows
from nutdamp.physics import damping, energy_sink, forced, rates
from nutdamp.schedule import TOUCHING, Pulse, Schedule, channel_pulse, steerable_pulse
from nutdamp.spacecraft import Channel, Disturbance, Spacecraft, Steerable

ALIGNED = 1e-9
"""Angle in rad below which a standing ω counts as opposed to a torque (a sphere, where nothing turns)."""

MISSED = 50
"""Alignments in a row that rounding to ticks or a disturbance may move to before the actuators are ready."""

MOST_PULSES = 2000
"""Pulses that are laid one by one, at most: nobody commands more, and each takes its time to be planned and flown."""


CORRECTED = 1e-4
"""Share of A|ω0| that is left to correction under dissipation: `rates.width_factor` knows it at small angles only."""


class ImpulseBuilder:
    """The transverse rate as it will be, and the pulses chosen so far.

    ``omega`` and ``spin`` (rad/s) hold just after the centre of the last pulse at ``now`` s; ``ready`` is the first
    moment at which the next pulse may start.
    """

    def __init__(self, spacecraft: Spacecraft, *, endless: bool = False) -> None:
        self.spacecraft = spacecraft
        self.A, self.C, self.a = spacecraft.inertia.A, spacecraft.inertia.C, spacecraft.inertia.a
        self.windows = Windows(spacecraft, endless=endless)
        self.omega = complex(spacecraft.omega0[0], spacecraft.omega0[1])
        self.spin = spacecraft.spin
        self.now = 0.0
        self.ready = spacecraft.limits.earliest
        self.pulses: list[Pulse] = []

    @property
    def left(self) -> float:
        """Impulse in N m s that still has to be taken out: A|ω|."""
        return self.A * abs(self.omega)

    @property
    def settled(self) -> bool:
        """Whether what is left is rounding; under dissipation, what the last pulse can be corrected by."""
        corrected = 0.0 if self.spacecraft.growth == 0.0 else CORRECTED * self.spacecraft.least_impulse
        return self.left <= max(1e-13 * self.C * abs(self.spin), corrected)

    @property
    def growing(self) -> bool:
        """Whether the nutation grows by itself."""
        return self.spacecraft.growth > 0.0

    @property
    def full(self) -> bool:
        """Whether no more pulses are allowed."""
        return len(self.pulses) >= self.most

    @property
    def most(self) -> int:
        """Pulses that are allowed."""
        most = self.spacecraft.limits.max_pulses
        return MOST_PULSES if most is None else min(most, MOST_PULSES)

    @property
    def period(self) -> float:
        """Nutation period in the body at the present spin, s; infinite for a sphere."""
        rate = abs(self.a * self.spin)
        return 2.0 * math.pi / rate if rate > 0.0 else math.inf

    @property
    def uniform(self) -> bool:
        """Whether ω turns in the body at a constant rate between pulses."""
        return not self.spacecraft.disturbances and self.spacecraft.growth == 0.0

    def _coast(self, time: float) -> tuple[complex, float]:
        """ω and ω3 at ``time`` s if nothing more is fired and no disturbance drives ω."""
        since, drift, growth = time - self.now, self.spacecraft.spin_drift, self.spacecraft.growth
        omega, spin, turned = self.omega, self.spin, since
        if growth != 0.0:
            found = energy_sink.coast(self.A, self.C, growth, omega, spin, since)
            omega, spin, turned = omega * found.transverse, spin * found.axial, found.turned
        angle = self.a * (self.spin * turned + 0.5 * drift * since * since)
        return omega * cmath.exp(-1j * angle), spin + drift * since

    def _sink(self) -> tuple[float, float, float]:
        """κ, cos θ and sin²θ of `energy_sink` just after the last pulse."""
        axial, across = (self.C * self.spin) ** 2, (self.A * abs(self.omega)) ** 2
        size = axial + across
        if size == 0.0:
            return self.spacecraft.growth, 1.0, 0.0
        return self.spacecraft.growth, math.sqrt(axial / size), across / size

    def _turned(self, time: float) -> float:
        """How long, s, the present spin takes to turn the body as far as it turns from now to ``time`` s."""
        since = time - self.now
        return since if self.spacecraft.growth == 0.0 else energy_sink.course(*self._sink(), since).turned

    def _when(self, turned: float) -> float:
        """The moment at which `_turned` is ``turned`` s."""
        return self.now + (turned if self.spacecraft.growth == 0.0 else energy_sink.time_to_turn(*self._sink(), turned))

    def omega_at(self, time: float) -> complex:
        """ω at ``time`` s if nothing more is fired."""
        free, _ = self._coast(time)
        if not self.spacecraft.disturbances:
            return free
        since = time - self.now
        return free + sum(self._driven(disturbance, since) for disturbance in self.spacecraft.disturbances)

    def _driven(self, disturbance: Disturbance, since: float) -> complex:
        """What a turning disturbance has added to ω since the last pulse (`forced.rotating_torques` for one)."""
        if disturbance.transverse == 0.0:
            return 0.0 + 0.0j
        torque = disturbance.transverse * cmath.exp(1j * disturbance.rate * self.now)
        driven = forced.rotating_torques(
            np.array([since]), 0.0, self.spin, self.A, self.C, np.array([torque]), np.array([disturbance.rate])
        )
        return complex(driven[0])

    def acts(self, pulse: Pulse) -> complex:
        """Effective impulse of ``pulse`` on ω, J1 + iJ2 in N m s."""
        axial = 0.0 if pulse.torque is None else float(pulse.torque[2])
        _, spin = self._coast(pulse.start)
        factor = rates.width_factor(
            self.a,
            spin,
            axial / self.C,
            pulse.on_time,
            growth=self.spacecraft.growth,
            drift=self.spacecraft.spin_drift,
        )
        return complex(pulse.impulse[0], pulse.impulse[1]) * factor

    def left_after(self, pulse: Pulse) -> float:
        """What would be left, N m s, if ``pulse`` were fired next."""
        return abs(self.A * self.omega_at(pulse.t) + self.acts(pulse))

    def helps(self, pulse: Pulse) -> bool:
        """Whether less is left with ``pulse`` than without."""
        return self.left_after(pulse) < abs(self.A * self.omega_at(pulse.t))

    def fire(self, pulse: Pulse) -> None:
        """Take ``pulse`` into the schedule."""
        omega, (_, spin) = self.omega_at(pulse.t) + self.acts(pulse) / self.A, self._coast(pulse.t)
        self.omega, self.spin = omega, spin + float(pulse.impulse[2]) / self.C
        self.now = pulse.t
        self.ready = pulse.end + self.spacecraft.limits.gap
        self.pulses.append(pulse)

    def schedule(self) -> Schedule:
        """What has been chosen."""
        cut = f"ends after {MOST_PULSES} pulses, the most that are planned; a longer max_on_time helps"
        return Schedule(tuple(self.pulses), (cut,) if len(self.pulses) == MOST_PULSES and not self.settled else ())

    def on_time_for(self, channel: Channel, impulse: float, longest: float = math.inf) -> float | None:
        """On-time in s for which ``channel`` acts on ω like ``impulse`` N m s; None if none up to ``longest``."""
        spin_rate = channel.axial / self.C
        return rates.on_time_for(impulse, abs(channel.transverse), self.a, self.spin, spin_rate, longest)

    def align(self, channel: Channel, on_time: float) -> Pulse | None:
        """Next pulse of ``channel`` against ω that the limits allow, ``on_time`` s long (made commandable)."""
        on_time = self.windows.on_time(on_time, channel.min_on_time, channel.max_on_time)
        probe = channel_pulse(channel, self.now, on_time)
        turn = damping.phase_to_oppose(self.omega, self.acts(probe))
        if math.isinf(self.period):
            start = self.windows.earliest_start(on_time, self.ready) if abs(turn) <= ALIGNED else None
            return None if start is None else channel_pulse(channel, start + 0.5 * on_time, on_time)
        first = turn / (self.a * self.spin)  # and the times below: as long as it takes at the present spin
        # Rounding may put a pulse just before it may start, but not on the one before it, nor before t = 0.
        slack = min(TOUCHING, 1e-3 * on_time) if self.pulses else 0.0

        def alignment(ready: float) -> float:
            """Whole turns from ``first`` to the alignment at which a pulse starts at ``ready`` s or next."""
            return math.ceil((self._turned(ready + 0.5 * on_time - slack) - first) / self.period)

        turns = alignment(self.ready)
        for _ in range(len(self.windows.limits.blackout) + MISSED):
            centre = self._when(first + turns * self.period)
            if math.isinf(centre):  # dissipation stops the spin before
                return None
            if not self.uniform:
                centre = self._opposed_near(channel, centre, on_time)
            start = centre - 0.5 * on_time
            if self.windows.limits.tick is not None:
                start = self.windows.nearest_tick(start)
                centre = start + 0.5 * on_time
            free = self.windows.blocked_until(start, on_time)
            later = not self.pulses or centre > self.now  # also where the clock cannot tell so short a time
            if start >= self.ready - slack and later and free is None:
                allowed = self.windows.allows(start, on_time, self.ready)
                return channel_pulse(channel, centre, on_time) if allowed else None
            # Rounded to a tick before the actuators are ready, opposed earlier by a disturbance, or blacked out.
            turns = max(turns + 1, alignment(self.ready if free is None else free))
        return None

    def _opposed_near(self, channel: Channel, centre: float, on_time: float) -> float:
        """Moment near ``centre`` at which ω opposes the pulse where it does not turn evenly.

        Each step mends the angle still missing, by the rate at which ω turns there.
        """
        for _ in range(20):
            turn = damping.phase_to_oppose(self.omega_at(centre), self.acts(channel_pulse(channel, centre, on_time)))
            _, spin = self._coast(centre)
            centre += turn / (self.a * (spin or self.spin))
            if abs(turn) < ALIGNED:
                break
        return centre

    def steer(self, steerable: Steerable, impulse: float) -> Pulse | None:
        """Earliest pulse of a steerable torquer that acts against ω like ``impulse`` N m s; None if none can."""
        if steerable.torque is None:
            start = self.windows.earliest_start(0.0, self.ready)
            if start is None:
                return None
            return steerable_pulse(steerable, start, cmath.phase(-self.omega_at(start)), impulse=impulse)
        needed = rates.on_time_for(impulse, steerable.torque, self.a, self.spin, 0.0, math.inf)
        if needed is None:
            return None
        on_time = self.windows.on_time(needed, 0.0, math.inf)
        start = self.windows.earliest_start(on_time, self.ready)
        if start is None:
            return None
        centre = start + 0.5 * on_time
        angle = cmath.phase(-self.omega_at(centre))
        return steerable_pulse(steerable, centre, angle, on_time=on_time)
