"""A schedule: which channel fires when, for how long, and what that costs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np

from nutdamp.commands import Block
from nutdamp.spacecraft import Channel, Steerable, Vector

STEERABLE = "steerable"
"""Channel name of the pulses of a steerable torquer."""


RESOLUTION = 1e-4
"""Part of its on-time to which a pulse must be resolved at its time: its impulse then errs by no more."""

TOUCHING = 1e-9
"""s; pulses that overlap by less only touch, as do those that overlap by less than times can be distinguished."""

Label = TypeVar("Label")


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
    def resolved(self) -> bool:
        """Whether times can be distinguished finely enough to say how long it is; an ideal impulse has no length."""
        return self.on_time == 0.0 or math.ulp(self.end) <= RESOLUTION * self.on_time

    @property
    def magnitude(self) -> float:
        """|J| in N m s."""
        return float(np.linalg.norm(self.impulse))


def overlapping(pulses: Iterable[tuple[Label, Pulse]]) -> list[tuple[Label, Label]]:
    """Labels of pulses that begin while their channel still fires an earlier one, each with the label of that."""
    firing: dict[str, tuple[Label, float]] = {}
    found = []
    for label, pulse in sorted(pulses, key=lambda one: one[1].start):
        before, end = firing.get(pulse.channel, (label, -math.inf))
        if pulse.start < end - touching(end):
            found.append((label, before))
        if pulse.end > end:
            firing[pulse.channel] = label, pulse.end
    return found


def touching(time: float) -> float:
    """By how much two pulses may overlap at ``time`` s that only touch, s."""
    return max(TOUCHING, math.ulp(time)) if math.isfinite(time) else 0.0


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


def steerable_pulse(
    steerable: Steerable, t: float, angle: float, *, impulse: float | None = None, on_time: float = 0.0
) -> Pulse:
    """One firing of a steerable torquer centred at ``t`` s, about the transverse axis at ``angle`` rad.

    Either ``impulse`` N m s is given, or ``on_time`` s where the torquer has a torque; else it gives ideal impulses.
    """
    direction = np.array([math.cos(angle), math.sin(angle), 0.0])
    if steerable.torque is None:
        on_time = 0.0
    elif impulse is not None:
        on_time = impulse / steerable.torque
    if impulse is None:
        impulse = 0.0 if steerable.torque is None else steerable.torque * on_time
    rate = steerable.propellant_per_impulse
    return Pulse(
        t=t,
        on_time=on_time,
        channel=STEERABLE,
        impulse=impulse * direction,
        torque=None if steerable.torque is None else steerable.torque * direction,
        propellant=None if rate is None else rate * impulse,
    )


class Bounds(NamedTuple):
    """Costs that other schedules of the channels cannot go below ``within`` so many s, in ``unit`` (kg or N m s).

    ``first_order`` is that of the small-angle program; None where that was not solved. ``rigorous`` holds at any angle
    for all schedules that leave no more than this one; None where nothing is known to hold: I1 ≠ I2, dissipation,
    disturbances.
    """

    first_order: float | None
    rigorous: float | None
    unit: str
    within: float


@dataclass(frozen=True, slots=True)
class Schedule:
    """Pulses in the order of their centres, remarks of the scheme that chose them, and what others must cost.

    ``blocks`` are the commands by which the pulses are fired, where it is not one by one.
    """

    pulses: tuple[Pulse, ...] = ()
    notes: tuple[str, ...] = ()
    bounds: Bounds | None = None
    blocks: tuple[Block, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "pulses", tuple(sorted(self.pulses, key=lambda pulse: pulse.t)))

    def __len__(self) -> int:
        return len(self.pulses)

    def __iter__(self) -> Iterator[Pulse]:
        return iter(self.pulses)

    @property
    def without_proof(self) -> Schedule:
        """The same without its rigorous bound: for a motion that the bound was not derived for."""
        return self if self.bounds is None else replace(self, bounds=self.bounds._replace(rigorous=None))

    @property
    def cost(self) -> float:
        """Propellant in kg; where that is not known, impulse in N m s."""
        propellant = self.propellant
        return self.total_impulse if propellant is None else propellant

    def cost_in(self, unit: str) -> float:
        """Propellant where the ``unit`` is kg and it is known, else impulse in N m s."""
        return self.cost if unit == "kg" else self.total_impulse

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
