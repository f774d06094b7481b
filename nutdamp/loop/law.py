"""When to fire, and for how long: a channel of torque direction d while arg ω = arg d + π (Magnus 1970, section 4).

The law knows the moments of the body and its momentary spin, and sees the transverse rate ω = ω1 + iω2. With
I1 ≠ I2 a small ω runs on an ellipse; what turns evenly there is z = g1 ω1 + i g2 ω2 with gj in proportion to
sqrt(Ij |Ij - I3|), at `Inertia.body_rate` times the spin: the law works on z, which is ω itself where I1 = I2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.limits import Windows, effective_on_time, effective_on_times, longest_useful, usable
from nutdamp.loop_settings import BANG, ONE_PULSE, Loop
from nutdamp.physics import damping, rates
from nutdamp.schemes.four_pulse import DEFAULT_SHARE
from nutdamp.schemes.tools.reasons import at_hand
from nutdamp.spacecraft import Channel, Spacecraft

if TYPE_CHECKING:
    from nutdamp.physics.valve import Valve

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


LEADS = 100
"""On-times of a channel for which it is worked out what its valve does."""


class Firing(NamedTuple):
    """A firing that the law decides on: ``wait`` s until its command (negative: it should have begun).

    ``on_time`` s is that of full thrust, about its centre ``lead`` s after the beginning of the command, which with its
    thrust ``lasts`` so many s; without a valve half and all of the on-time. ``acts`` rad/s is what it adds to z there.
    """

    wait: float
    on_time: float
    lead: float
    lasts: float
    acts: complex


@dataclass(frozen=True, eq=False)
class Actuator:
    """A channel as the law sees it: ``kick`` rad/s² is what a second of it adds to z, ``spin_rate`` rad/s² to ω3.

    Its pulses last from ``shortest`` to ``longest`` s; ``leads`` are those of its valve: see `_leads`.
    """

    channel: Channel
    kick: complex
    spin_rate: float
    shortest: float
    longest: float
    leads: tuple[Array, Array] | None = None


class Law:
    """The law of a ``spacecraft`` as it is known on board, and of its `Loop`; raises Infeasible where none can work."""

    def __init__(self, spacecraft: Spacecraft, loop: Loop) -> None:
        inertia = spacecraft.inertia
        if inertia.body_rate == 0.0:
            raise Infeasible("in a sphere ω does not rotate in the body: there is no phase to fire by")
        self.spacecraft, self.loop, self.inertia = spacecraft, loop, inertia
        self.windows = Windows(spacecraft, endless=True)
        self.gauge = _gauge(inertia.moments)
        self.period, self.growth = spacecraft.body_period, spacecraft.growth
        self.actuators = tuple(map(self._actuator, at_hand(spacecraft, usable(spacecraft))))

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
        leads = _leads(channel.valve, shortest, longest)
        return Actuator(channel, complex(self.seen(kick)), channel.axial / third, shortest, longest, leads)

    def seen(self, omega: Any) -> Any:
        """z of ω, numbers or arrays."""
        first, second = self.gauge
        return omega if first == second == 1.0 else first * omega.real + 1j * second * omega.imag

    def rate(self, spin: Any) -> Any:
        """How fast z turns back in the body, rad/s, signed; numbers or arrays."""
        return self.inertia.body_rate * spin

    def nutation(self, size: Any, spin: Any) -> Array:
        """Nutation angle θ, rad, by |z| and ω3: tan θ = A|ω|/(C|ω3|), Magnus 1970 (19)."""
        return np.asarray(np.arctan2(self.inertia.A * np.asarray(size), self.inertia.C * np.abs(spin)))

    def size(self, nutation: float, spin: float) -> float:
        """|z|, rad/s, of a nutation angle (rad)."""
        return self.inertia.C * abs(spin) / self.inertia.A * math.tan(nutation)

    def firing(self, actuator: Actuator, z: complex, spin: float) -> Firing | None:
        """The next firing of a channel against ``z`` at this moment; None where it would not help."""
        rate = self.inertia.body_rate
        needed = rates.on_time_for(abs(z), abs(actuator.kick), rate, spin, actuator.spin_rate, actuator.longest)
        on_time = actuator.longest if needed is None else max(needed, actuator.shortest)
        lead, lasts = 0.5 * on_time, on_time
        if actuator.channel.valve is None:
            on_time = lasts = self.windows.on_time(on_time, actuator.shortest, actuator.longest)
            lead = 0.5 * on_time
        else:
            loaded = actuator.channel.valve.on_time_for(on_time)
            thrust = actuator.channel.valve.thrust(loaded)
            lead, lasts = thrust.centroid, max(loaded, thrust.ramps[-1].end)
        factor = rates.width_factor(rate, spin, actuator.spin_rate, on_time)
        acts = actuator.kick * on_time * factor
        if not 0.0 < abs(acts) < 2.0 * abs(z):
            return None
        wait = damping.phase_to_oppose(z, acts) / (rate * spin)
        return Firing(wait - lead if self.loop.predict else wait, on_time, lead, lasts, acts)

    def waits(self, actuator: Actuator, z: ComplexArray, spin: Array) -> Array:
        """`Firing.wait` of one channel for many moments (n,); not a number where a firing would not help.

        To first order in the torque about axis 3, to the `LEADS` of its valve and between ticks: it tells between which
        moments a channel comes to fire, `firing` then when and for how long.
        """
        rate, size, push = self.inertia.body_rate * spin, np.abs(z), abs(actuator.kick)
        half = np.abs(0.5 * rate)
        sine = half * size / push
        needed = np.where(sine > 1.0, math.inf, np.arcsin(np.minimum(sine, 1.0)) / half)
        on_time = np.clip(needed, actuator.shortest, actuator.longest)
        acts = push * np.abs(np.sin(half * on_time)) / half
        direction = actuator.kick * np.where(np.sin(half * on_time) < 0.0, -1.0, 1.0)
        if actuator.spin_rate != 0.0:
            direction = direction * np.exp(1j * self.inertia.body_rate * actuator.spin_rate * on_time * on_time / 6.0)
        wait = np.angle(-z * np.conj(direction)) / rate
        if self.loop.predict:
            wait = wait - (0.5 * on_time if actuator.leads is None else np.interp(on_time, *actuator.leads))
        return np.where((acts > 0.0) & (acts < 2.0 * size), wait, math.nan)


def _leads(valve: Valve | None, shortest: float, longest: float) -> tuple[Array, Array] | None:
    """Effective on-times (n,) s from ``shortest`` to ``longest``, and how long before their centres commands begin."""
    if valve is None:
        return None
    on_times = np.linspace(shortest, longest, LEADS)
    return on_times, np.array([valve.thrust(valve.on_time_for(one)).centroid for one in on_times.tolist()])


def _gauge(moments: tuple[float, float, float]) -> tuple[float, float]:
    """(g1, g2), such that |z| is that of a symmetric body with A and C at the widest point of the small ellipse."""
    first, second, third = moments
    if first == second:
        return 1.0, 1.0
    weights = [math.sqrt(moment * abs(moment - third)) for moment in (first, second)]
    most = max(first / weights[0], second / weights[1]) / (0.5 * (first + second))
    return weights[0] * most, weights[1] * most
