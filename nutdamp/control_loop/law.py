"""Firing law and fault detection.

A channel of torque direction d fires while arg ω = arg d + π (Magnus 1970, section 4). The
diagnosis compares the change of the observed rate by each firing with the expected one.

The law knows the moments of the body and its momentary spin, and sees the transverse rate ω = ω1 +
iω2. With I1 ≠ I2 a small ω runs on an ellipse; the quantity that turns evenly is z = g1 ω1 + i g2
ω2 with gj by `Inertia.circle`, at `Inertia.nutation_rate`: the law works on z, which is ω itself
where I1 = I2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import Infeasible
from nutdamp.physics import body as rigid_body
from nutdamp.physics import response
from nutdamp.schemes.catalogue import DEFAULT_SHARE
from nutdamp.schemes.sequential import at_hand
from nutdamp.spacecraft.constraints import (
    Windows,
    effective_on_time,
    effective_on_times,
    longest_useful,
    usable,
)
from nutdamp.spacecraft.equipment import BANG, ONE_PULSE, Channel, Loop
from nutdamp.spacecraft.model import Spacecraft, Vector

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


# fraction of the expected effect above which a firing works, and below whose negative it works
# backwards
WORKS = 0.25
SIGMAS = 5.0  # sigmas of noise within which a firing is not judged
WHICH = 3.0  # sigmas to tell a channel from the sensor, where it is known that one works backwards
# growth of the nutation under fire, as a share of its first size, from which firings feed it
FED = 0.5
PHASED = (
    1e-3  # phase uncertainty of z (rad) from which on sizes tell more of the effect of a firing
)
LOST = 1.0  # phase uncertainty of a firing (rad) from which on its expected effect is unknown
LARGE = 100.0  # exponent of growth beyond which further growth does not matter
STEPPED = math.sqrt(3.0)  # largest error of a quantised value over its root mean square
ALIKE = 1e-9  # share of the samples below which their information on the bias is rounding


class Ending(Enum):
    """Reason for the end of the flight of a loop."""

    END = "the end of the time"
    FULL = "limits.max_pulses"
    EMPTY = "the tank is empty"
    SENSOR = "the sensor is reversed"
    CHANNEL = "a channel is wired backwards"
    UNCLEAR = "a channel is wired backwards, or the sensor is reversed"
    IDLE = "a channel does nothing"
    FEEDS = "the firings come at the wrong time"
    FED = "the firings feed the nutation"

    @property
    def fault(self) -> bool:
        """True if the loop was stopped before it could feed the nutation, or has nothing left to
        fire.
        """
        return self not in (Ending.END, Ending.FULL)


class Doubt(NamedTuple):
    """Uncertainty of estimates of z; noise falls with the root of the number of samples."""

    noise: float  # rad/s, one sigma of a sample
    white: float  # its part at the rate of z
    least: float  # noise at least: of fits that share their samples
    lift: float  # factor on the noise at rest
    bias: float  # rad/s: constant of the coasts
    steps: float  # rad/s, at most, by the quantisation
    turn: float = 0.0  # share by which the rate at which z turns may be off
    scale: float = 0.0  # that of the sensor

    def of(self, seen: Glimpse) -> float:
        """One sigma of the estimate from the samples ``seen`` on a coast, for a known bias."""
        mixed = self.white * math.sqrt(
            (1.0 + abs(seen.leak) ** 2 * (self.lift**2 - 1.0)) / seen.samples
        )
        return math.hypot(max(min(mixed, self.noise), self.least), self.steps / STEPPED)


@dataclass(slots=True)
class Glimpse:
    """Rates z of one coast, carried to the centre of a firing by the nutation, with a bias b: least
    squares.
    """

    z: complex  # z = ``z`` - b ``leak``
    samples: int
    leak: complex
    rest: complex  # left of the fit: b ``information``
    information: float
    apart: float  # s from the samples to the firing

    @classmethod
    def of(cls, times: Vector, best: ComplexArray, rate: complex, centre: float) -> Glimpse:
        """Glimpse of estimates ``best`` (n,) at ``times`` (n,) s; ``rate`` is complex where the
        nutation grows.
        """
        course = np.exp(-1j * rate * (times - centre))  # of z = 1 at the centre
        power = float((abs(course) ** 2).sum())
        total = complex(course.sum())
        count = len(times)
        z = complex(np.vdot(course, best)) / power
        rest, information = complex(best.sum()) - z * total, count - abs(total) ** 2 / power
        return cls(
            z,
            count,
            total.conjugate() / power,
            rest,
            information,
            abs(float(times.mean()) - centre),
        )


class RateChange(NamedTuple):
    """Values z rad/s ``before`` and ``after`` a firing, carried to its centre."""

    before: complex
    after: complex
    sigma: float  # one sigma of their difference
    bound: float  # by which that may be off besides, in every firing alike

    @classmethod
    def of(cls, before: Glimpse, after: Glimpse, doubt: Doubt) -> RateChange:
        """Change between two coasts of the same bias, which is estimated too where its limits are
        wider.
        """
        sigma = math.hypot(doubt.of(before), doubt.of(after))
        unlike = abs(after.leak - before.leak)
        information = before.information + after.information
        bias = 0j
        open_ = doubt.bias
        if doubt.bias > 0.0 and information > ALIKE * (before.samples + after.samples):
            noise = doubt.white * doubt.lift / math.sqrt(information)
            bends = (
                math.pi * doubt.turn * max(abs(before.z), abs(after.z))
            )  # by turning from the middle to the ends
            if max(noise, bends) < doubt.bias:
                bias = (before.rest + after.rest) / information
                open_ = bends
                sigma = math.hypot(sigma, unlike * noise)
        return cls(
            before.z - bias * before.leak, after.z - bias * after.leak, sigma, unlike * open_
        )


@dataclass(slots=True)
class Effect:
    """Effect of the firings of one channel, as a factor on the expected one: least squares over
    them.
    """

    did: complex = 0.0
    wanted: float = 0.0
    noise: float = 0.0
    bound: float = 0.0

    def add(self, change: RateChange, expected: complex, phase: float) -> None:
        """A firing that was to add ``expected`` and made a ``change``, in which z may be off by a
        ``phase`` (rad).

        Where that matters, and the firing was to change the size, by sizes alone: |z| after it lies
        between |z + e| of a firing that works and |z - e| of one that works backwards.
        """
        wanted = abs(expected)
        did = (change.after - change.before) * expected.conjugate()
        bound = change.bound + phase * abs(change.before)
        if phase > PHASED and abs(change.before) >= 0.5 * wanted:
            works, feeds = abs(change.before + expected), abs(change.before - expected)
            wanted, bound = 0.5 * (feeds - works), change.bound + phase * wanted
            did = complex((0.5 * (feeds + works) - abs(change.after)) * wanted)
        self.did += did
        self.wanted += wanted * wanted
        self.noise += 0.5 * (wanted * change.sigma) ** 2
        self.bound += abs(wanted) * bound

    @property
    def factor(self) -> complex:
        """Factor: 1 for full effect, -1 for reversed effect, 0 for none."""
        return self.did / self.wanted if self.wanted > 0.0 else 1.0

    def open(self, sigmas: float = SIGMAS) -> float:
        """Uncertainty of the factor by noise, and by errors common to all firings."""
        return (
            (sigmas * math.sqrt(self.noise) + self.bound) / self.wanted
            if self.wanted > 0.0
            else math.inf
        )

    def sure(self, sense: float, sigmas: float = SIGMAS) -> bool:
        """True if the firings surely have the expected effect (``sense`` 1), or the opposite one
        (-1).
        """
        return (
            sense * self.factor.real >= WORKS
            and sense * self.factor.real - self.open(sigmas) > -WORKS
        )


@dataclass(slots=True)
class Diagnosis:
    """Judges firing after firing. One that works backwards makes its channel ``suspect``, until
    ``deadline`` s.

    Another channel that works backwards too shows that it is the sensor, one that works that it is
    the channel.
    """

    period: float
    growth: float = 0.0  # of z, 1/s
    slope: float = 0.0  # tan θ over |z|: the spin falls with θ
    effects: dict[str, Effect] = field(default_factory=dict)
    suspect: str | None = None
    deadline: float = math.inf
    first: tuple[float, float] | None = (
        None  # |z| (rad/s) as first fired at since the loop was quiet, and time (s)
    )

    def judge(
        self,
        channel: str,
        now: float,
        before: Glimpse,
        after: Glimpse,
        expected: complex,
        doubt: Doubt,
    ) -> tuple[Ending, str] | None:
        """Reason to stop after a firing that was to add ``expected``, and the channel to name;
        another from ``now``.
        """
        change = RateChange.of(before, after, doubt)
        effect = self.effects.setdefault(channel, Effect())
        size = max(abs(change.before), abs(change.after))
        turns = 2.0 * math.pi / self.period
        falls = (
            abs(self.growth) * (before.apart + after.apart) * (self.slope * size) ** 2
        )  # of the spin, as cos θ
        half = (
            math.pi * doubt.turn
        )  # by which z may have turned from the middle of a period to its ends
        share = falls + doubt.scale + 0.5 * half * half
        if doubt.turn * before.apart * turns < LOST:
            unsure = change._replace(bound=change.bound + share * size)
            effect.add(
                unsure, expected, turns * (before.apart + after.apart) * (0.5 * falls + doubt.turn)
            )
        cause = self._cause(channel, now, change, expected, doubt)
        return cause or self._fed(channel, now, change, doubt)

    def _cause(
        self, channel: str, now: float, change: RateChange, expected: complex, doubt: Doubt
    ) -> tuple[Ending, str] | None:
        """Fault shown by the effects of firings, with the channel to name; None where there is none
        or not yet.
        """
        effect = self.effects[channel]
        if self.suspect is None and effect.sure(-1.0):
            self.suspect = channel
            self.deadline = now + self.period
        if self.suspect is not None:
            others = [effect for name, effect in self.effects.items() if name != self.suspect]
            if any(other.sure(-1.0, WHICH) for other in others):
                return Ending.SENSOR, channel
            return (
                (Ending.CHANNEL, self.suspect)
                if any(other.sure(1.0, WHICH) for other in others)
                else None
            )
        if effect.open() >= WORKS:
            return None
        if abs(effect.factor) < WORKS:
            return Ending.IDLE, channel
        size = abs(change.before)
        lowers = size - abs(size - abs(expected)) > 0.5 * abs(
            expected
        )  # by a firing that comes at its moment
        grown = abs(change.after) - size
        seen_wrong = (
            SIGMAS * doubt.noise + doubt.steps + doubt.bias
        )  # the law fired at what it saw, not at what was
        if lowers and grown > SIGMAS * change.sigma + change.bound + 2.0 * seen_wrong + 1e-9 * size:
            return Ending.FEEDS, channel
        return None

    def _fed(
        self, channel: str, now: float, change: RateChange, doubt: Doubt
    ) -> tuple[Ending, str] | None:
        """Ending and channel where the nutation has grown under fire by more than observation
        errors explain.
        """
        if self.first is None:
            self.first = abs(change.before), now
            return None
        if self.suspect is not None:
            return None
        size, since = self.first
        most = (1.0 + FED) * size * math.exp(min(self.growth * (now - since), LARGE))
        most += SIGMAS * (change.sigma + doubt.noise) + 2.0 * (doubt.steps + doubt.bias)
        return (Ending.FED, channel) if abs(change.after) > most else None


def known_to(spacecraft: Spacecraft) -> tuple[float, float]:
    """Relative errors of nutation rate and sensor scale, two sigma of the dispersions."""
    given, inertia = spacecraft.dispersions, spacecraft.inertia
    if given is None:
        return 0.0, 0.0
    parts = (
        (given.A, inertia.A, spacecraft.axial),
        (given.C, inertia.C, inertia.C * spacecraft.spin),
        (given.wheel_momentum, inertia.wheel, inertia.wheel),
    )
    changes = [
        0.0
        if off is None
        else off.size * (momentum if off.relative else momentum / (nominal or 1.0))
        for off, nominal, momentum in parts
    ]
    scale = 0.0 if given.sensor_scale is None else given.sensor_scale.size
    return 2.0 * math.hypot(*changes) / (inertia.A * abs(spacecraft.nutation_rate)), 2.0 * abs(
        scale
    )
