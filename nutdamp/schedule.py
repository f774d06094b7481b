"""A schedule: which channel fires when, for how long, and what that costs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from nutdamp.spacecraft import Channel, Steerable, Vector

STEERABLE = "steerable"
"""Channel name of the pulses of a steerable torquer."""


@dataclass(frozen=True, slots=True)
class Pulse:
    """One rectangular torque pulse, or an ideal impulse (``on_time`` 0, ``torque`` None).

    ``t`` is its centre in s; ``torque`` (3,) N m and ``impulse`` (3,) N m s are in principal body axes;
    ``force`` (3,) N is the net force, None where it is not known; ``propellant`` kg or None.
    """

    t: float
    on_time: float
    channel: str
    impulse: Vector
    torque: Vector | None = None
    force: Vector | None = None
    propellant: float | None = None

    @property
    def start(self) -> float:
        """When it comes on, s."""
        return self.t - 0.5 * self.on_time

    @property
    def end(self) -> float:
        """When it goes off, s."""
        return self.t + 0.5 * self.on_time

    @property
    def magnitude(self) -> float:
        """|J| in N m s."""
        return float(np.linalg.norm(self.impulse))


def channel_pulse(channel: Channel, t: float, on_time: float) -> Pulse:
    """One firing of ``channel``, centred at ``t`` s and ``on_time`` s long."""
    flow = channel.mass_flow
    return Pulse(
        t=t,
        on_time=on_time,
        channel=channel.name,
        impulse=channel.torque * on_time,
        torque=channel.torque,
        force=channel.force,
        propellant=None if flow is None else flow * on_time,
    )


def steerable_pulse(steerable: Steerable, t: float, angle: float, *, impulse: float) -> Pulse:
    """One firing of a steerable torquer: ``impulse`` N m s about the transverse axis at ``angle`` rad.

    Its on-time follows from the torque; without one it is an ideal impulse.
    """
    direction = np.array([math.cos(angle), math.sin(angle), 0.0])
    rate = steerable.propellant_per_impulse
    return Pulse(
        t=t,
        on_time=0.0 if steerable.torque is None else impulse / steerable.torque,
        channel=STEERABLE,
        impulse=impulse * direction,
        torque=None if steerable.torque is None else steerable.torque * direction,
        propellant=None if rate is None else rate * impulse,
    )


@dataclass(frozen=True, slots=True)
class Schedule:
    """Pulses in the order of their centres, and remarks of the scheme that chose them."""

    pulses: tuple[Pulse, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "pulses", tuple(sorted(self.pulses, key=lambda pulse: pulse.t)))

    def __len__(self) -> int:
        return len(self.pulses)

    def __iter__(self) -> Iterator[Pulse]:
        return iter(self.pulses)

    @property
    def end(self) -> float:
        """End of the last pulse, s; 0 without pulses."""
        return max((pulse.end for pulse in self.pulses), default=0.0)

    @property
    def total_impulse(self) -> float:
        """Σ |J| in N m s."""
        return math.fsum(pulse.magnitude for pulse in self.pulses)

    @property
    def propellant(self) -> float | None:
        """kg; None where one pulse's is not known."""
        known = [pulse.propellant for pulse in self.pulses if pulse.propellant is not None]
        return math.fsum(known) if len(known) == len(self.pulses) else None
