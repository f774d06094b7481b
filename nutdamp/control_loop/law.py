"""Firing law of Magnus 1970, section 4: a channel fires while ω is opposite to its torque.

The law knows the moments of the body and its momentary spin, and sees the transverse rate ω = ω1 +
iω2. With I1 ≠ I2 a small ω runs on an ellipse; the quantity that turns evenly is z = g1 ω1 + i g2
ω2 with gj by `Inertia.circle`, at `Inertia.nutation_rate`: the law works on z, which is ω itself
where I1 = I2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.physics import body as rigid_body
from nutdamp.physics import response
from nutdamp.schemes.catalogue import DEFAULT_SHARE
from nutdamp.spacecraft.constraints import (
    Windows,
    at_hand,
    effective_on_time,
    effective_on_times,
    longest_useful,
    usable,
    without_waste,
)
from nutdamp.spacecraft.equipment import BANG, ONE_PULSE, Channel, Loop
from nutdamp.spacecraft.model import Spacecraft

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


LEADS = 100  # on-times of a channel for which the valve response is tabulated


class Firing(NamedTuple):
    """Firing decided by the law."""

    wait: float  # s until its command; negative: overdue
    on_time: float  # s of full thrust
    lead: float  # s from the beginning of the command to the centre of the thrust
    lasts: float  # s of command and thrust together
    acts: complex  # rad/s that it adds to z at its centre


@dataclass(frozen=True, eq=False)
class Actuator:
    """Channel as the law sees it."""

    channel: Channel
    kick: complex  # rad/s²: change of z
    spin_rate: float  # rad/s²: change of ω3
    shortest: float  # s: least effective on-time
    longest: float
    leads: tuple[Array, Array] | None = (
        None  # with a valve, s: on-times (n,) between, and leads to their centres
    )


SPARE = 0.5
"""Share of the horizon and of the pulses allowed that channels may take which are thrifty: a loop
that took nine tenths of the horizon was quiet in time in half of its dispersed cases alone.
"""


class Law:
    """Law of a ``spacecraft`` as known on board, and of its `Loop`; raises Infeasible where none
    can work.
    """

    def __init__(self, spacecraft: Spacecraft, loop: Loop) -> None:
        inertia = spacecraft.inertia
        if spacecraft.nutation_rate == 0.0:
            raise Infeasible("ω does not rotate in this body: there is no phase to fire by")
        self.spacecraft, self.loop, self.inertia = spacecraft, loop, inertia
        self.windows = Windows(spacecraft, endless=True)
        # |z| is that of a symmetric body with A and C at the widest point of the small ellipse.
        circle = inertia.circle(spacecraft.spin)
        first, second = (circle * inertia.moments[:2] / (inertia.A * circle.min())).tolist()
        self.gauge: tuple[float, float] = (first, second)
        self.slope, self._offset = inertia.linear_rate(spacecraft.spin)
        self.period, self.growth = spacecraft.body_period, spacecraft.growth
        channels = at_hand(spacecraft, usable(spacecraft))
        thrifty = tuple(map(self._actuator, without_waste(spacecraft, channels)))
        enough = len(thrifty) == len(channels) or self._in_time(thrifty)
        self.actuators = thrifty if enough else tuple(map(self._actuator, channels))

    def _in_time(self, actuators: Sequence[Actuator]) -> bool:
        """True if their firings in each nutation period outdo growth, and take no more than `SPARE`
        of the horizon and of the pulses allowed.
        """
        spin = self.spacecraft.spin
        size = self.size(max(self.loop.start, self.spacecraft.nutation), spin)
        firings = [self.firing(actuator, complex(size), spin) for actuator in actuators]
        ready = -math.inf
        removed = 0.0
        count = 0
        for firing in sorted(filter(None, firings), key=lambda firing: firing.wait):
            if firing.wait >= ready:  # else one before it is still on
                removed += abs(firing.acts)
                count += 1
                ready = firing.wait + firing.lasts + self.spacecraft.limits.gap
        pull = removed / max(self.period, self.spacecraft.limits.gap)
        grows = self.growth * size / pull if pull > 0.0 else math.inf
        # ∫ d|z| / (pull - κ|z|) up to size; over size / pull it is -ln(1 - x) / x of x = grows.
        if grows >= 1.0:
            return False
        longer = -math.log1p(-grows) / grows if grows else 1.0
        lasts = size / pull * longer
        limits = self.spacecraft.limits
        most = math.inf if limits.max_pulses is None else limits.max_pulses
        fired = count * lasts / max(self.period, limits.gap)
        return lasts <= SPARE * self.spacecraft.horizon and fired <= SPARE * most

    def _actuator(self, channel: Channel) -> Actuator:
        first, second, third = self.inertia.moments
        kick = complex(channel.transverse.real / first, channel.transverse.imag / second)
        shortest, longest = effective_on_times(channel)
        if self.loop.law == ONE_PULSE:
            longest = max(longest_useful(longest, self.period), shortest)
        elif self.loop.on_time is None:
            longest = max(min(longest, DEFAULT_SHARE * self.period), shortest)
        else:
            longest = effective_on_time(channel, self.loop.on_time)
        if self.loop.law == BANG:
            shortest = longest
        leads = None
        valve = channel.valve
        if valve is not None:
            on_times = np.linspace(shortest, longest, LEADS)
            leads = (
                on_times,
                np.array(
                    [valve.thrust(valve.on_time_for(each)).centroid for each in on_times.tolist()]
                ),
            )
        return Actuator(
            channel, complex(self.seen(kick)), channel.axial / third, shortest, longest, leads
        )

    def seen(self, omega: Any) -> Any:
        """z of ω, numbers or arrays."""
        first, second = self.gauge
        return omega if first == second == 1.0 else first * omega.real + 1j * second * omega.imag

    def rate(self, spin: Any) -> Any:
        """Rate at which z turns back in the body, rad/s, signed; numbers or arrays."""
        return self.slope * spin + self._offset

    def nutation(self, size: Any, spin: Any) -> Array:
        """Nutation angle θ, rad, by |z| and ω3: tan θ = A|ω|/|H3|, Magnus 1970 (19)."""
        return np.asarray(
            np.arctan2(self.inertia.A * np.asarray(size), np.abs(self.inertia.axial(spin)))
        )

    def size(self, nutation: float, spin: float) -> float:
        """|z|, rad/s, of a nutation angle (rad)."""
        return abs(float(self.inertia.axial(spin))) / self.inertia.A * math.tan(nutation)

    def firing(self, actuator: Actuator, z: complex, spin: float) -> Firing | None:
        """Next firing of a channel against ``z`` now; None where it would not help."""
        rate = float(self.rate(spin))
        slope = self.slope * actuator.spin_rate
        needed = response.on_time_for(abs(z), abs(actuator.kick), rate, slope, actuator.longest)
        on_time = actuator.longest if needed is None else max(needed, actuator.shortest)
        if actuator.channel.valve is None:
            on_time = lasts = self.windows.on_time(on_time, actuator.shortest, actuator.longest)
            lead = 0.5 * on_time
        else:
            loaded = actuator.channel.valve.on_time_for(on_time)
            thrust = actuator.channel.valve.thrust(loaded)
            lead = thrust.centroid
            lasts = max(loaded, thrust.ramps[-1].end)
        factor = response.width_factor(rate, slope, on_time)
        acts = actuator.kick * on_time * factor
        if not 0.0 < abs(acts) < 2.0 * abs(z):
            return None
        wait = rigid_body.phase_to_oppose(z, acts) / rate
        return Firing(wait - lead if self.loop.predict else wait, on_time, lead, lasts, acts)

    def waits(self, actuator: Actuator, z: ComplexArray, spin: Array) -> Array:
        """`Firing.wait` of one channel for many moments (n,); not a number where a firing would not
        help.

        To first order in the torque about axis 3, to the `LEADS` of its valve and between ticks;
        `firing` is exact.
        """
        rate = self.rate(spin)
        size = np.abs(z)
        push = abs(actuator.kick)
        half = np.abs(0.5 * rate)
        sine = half * size / push
        needed = np.where(sine > 1.0, math.inf, np.arcsin(np.minimum(sine, 1.0)) / half)
        on_time = np.clip(needed, actuator.shortest, actuator.longest)
        acts = push * np.abs(np.sin(half * on_time)) / half
        direction = actuator.kick * np.where(np.sin(half * on_time) < 0.0, -1.0, 1.0)
        if actuator.spin_rate != 0.0:
            direction = direction * np.exp(
                1j * self.slope * actuator.spin_rate * on_time * on_time / 6.0
            )
        wait = np.angle(-z * np.conj(direction)) / rate
        if self.loop.predict:
            wait = wait - (
                0.5 * on_time if actuator.leads is None else np.interp(on_time, *actuator.leads)
            )
        return np.where((acts > 0.0) & (acts < 2.0 * size), wait, math.nan)
