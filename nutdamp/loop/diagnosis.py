"""Whether firings do what they shall: what each added to the rate that is seen, against what it was to add."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from nutdamp.loop.law import ComplexArray
from nutdamp.spacecraft import Vector

WORKS = 0.25
"""Share of what it was to add above which a firing works, and below whose negative it works backwards."""

SIGMAS = 5.0
"""A firing is judged by what so many sigma of the noise leave open."""


FED = 0.5
"""Share of the first size that firings may add to it in all: then they feed it, whatever hides which of them."""

STALE = 4.0
"""Nutation periods after a firing, from which on what is seen no longer tells what it did."""


class Stop(Enum):
    """Why the loop was flown no further, or that it was flown to the end."""

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
        """Whether the loop was stopped before it could feed the nutation, or has nothing left to fire."""
        return self not in (Stop.END, Stop.FULL)


@dataclass(slots=True)
class Glimpse:
    """The mean of the rates z seen on one coast, carried to the centre of a firing by the nutation ``rate`` (1/s)."""

    z: complex
    samples: int

    @classmethod
    def of(cls, times: Vector, best: ComplexArray, rate: complex, centre: float) -> Glimpse:
        """Of estimates ``best`` (n,) at ``times`` (n,) s; ``rate`` is complex where the nutation grows."""
        return cls(complex((best * np.exp(1j * rate * (times - centre))).mean()), len(times))


@dataclass(slots=True)
class Effect:
    """What the firings of one channel have added, as a factor on what they were to add: least squares over them."""

    did: complex = 0.0
    wanted: float = 0.0
    noise: float = 0.0
    offset: float = 0.0

    def add(self, change: complex, expected: complex, noise: float, offset: float) -> None:
        """A firing that changed z by ``change`` and was to by ``expected``, known to ``noise`` (sigma), ``offset``."""
        size = abs(expected) ** 2
        self.did += change * expected.conjugate()
        self.wanted += size
        self.noise += size * noise * noise
        self.offset += abs(expected) * offset

    @property
    def factor(self) -> complex:
        """1 for what works, -1 for what works backwards, 0 for what does nothing."""
        return self.did / self.wanted

    @property
    def known(self) -> bool:
        """Whether noise and bias leave no doubt which."""
        return SIGMAS * math.sqrt(self.noise) + self.offset < WORKS * self.wanted


@dataclass(slots=True)
class Diagnosis:
    """Judges firing after firing. One that works backwards makes its channel ``suspect``, until ``deadline`` s.

    Another channel that works backwards too shows that it is the sensor, one that works that it is the channel.
    """

    period: float
    effects: dict[str, Effect] = field(default_factory=dict)
    suspect: str | None = None
    deadline: float = math.inf
    fed: float = 0.0
    variance: float = 0.0
    sizes: list[float] = field(default_factory=list)

    def judge(
        self, channel: str, now: float, before: Glimpse, after: Glimpse, expected: complex, doubt: tuple[float, ...]
    ) -> tuple[Stop, str] | None:
        """Why to stop after a firing of ``channel`` that was to add ``expected``, and the channel to name; else None.

        ``now`` s is when it is judged. ``doubt``: sigma of ``before`` and of ``after``, and by how much each may be off
        in any case.
        """
        cause = self._cause(channel, now, before, after, expected, doubt)
        first, second, offset = doubt
        self.sizes.append(abs(before.z))
        self.fed += abs(after.z) - abs(before.z)
        self.variance += first * first + second * second
        most = FED * self.sizes[0] + SIGMAS * math.sqrt(self.variance) + 2.0 * offset
        return (Stop.FED, channel) if cause is None and len(self.sizes) > 1 and self.fed > most else cause

    def _cause(
        self, channel: str, now: float, before: Glimpse, after: Glimpse, expected: complex, doubt: tuple[float, ...]
    ) -> tuple[Stop, str] | None:
        """What the effects of firings show to be wrong, with the channel to name; None where nothing or not yet."""
        first, second, offset = doubt
        effect = self.effects.setdefault(channel, Effect())
        effect.add(after.z - before.z, expected, math.hypot(first, second), 2.0 * offset)
        if not effect.known:
            return None
        factor = effect.factor.real
        if factor <= -WORKS:
            if self.suspect not in (None, channel):
                return Stop.SENSOR, channel
            if self.suspect is None:
                self.suspect, self.deadline = channel, now + self.period
            return None
        if self.suspect is not None:
            return Stop.CHANNEL, self.suspect
        if abs(effect.factor) < WORKS:
            return Stop.IDLE, channel
        believed = abs(abs(before.z) - abs(expected))  # by a firing that comes at its moment
        grown = abs(after.z) - abs(before.z)
        lowers = abs(before.z) - believed > 0.5 * abs(expected)
        if lowers and grown > SIGMAS * math.hypot(first, second) + 2.0 * offset + 1e-9 * abs(before.z):
            return Stop.FEEDS, channel
        return None

    def rest(self) -> None:
        """The loop has fallen quiet: what firings add to the size is counted anew."""
        self.fed = self.variance = 0.0
        self.sizes.clear()

    def overdue(self, now: float) -> tuple[Stop, str] | None:
        """That no other channel has fired in time to tell which of the two it is."""
        return None if self.suspect is None or now <= self.deadline else (Stop.UNCLEAR, self.suspect)
