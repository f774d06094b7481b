"""Schedule: pulses by channel, time and on-time, and their cost."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from nutdamp.common.results import Note
from nutdamp.spacecraft.equipment import Block, Channel, Steerable, firings
from nutdamp.spacecraft.model import Vector

if TYPE_CHECKING:
    from nutdamp.physics.thruster import Ramp


STEERABLE = "steerable"  # channel name of the pulses of a steerable torquer


# part of its on-time to which a pulse must be resolved at its time: its impulse then errs by no
# more
RESOLUTION = 1e-4

TOUCHING = 1e-9
"""s; pulses that overlap by less, or by less than times can be told apart, only touch."""

Label = TypeVar("Label")


@dataclass(frozen=True, slots=True)
class Command:
    """Command of a pulse, ``start`` and ``on_time`` s, and the resulting thrust.

    ``ramps`` have the times of the schedule and levels in parts of the torque of the pulse.
    ``valve``: one makes another on-time of it; else the thrust is as long as commanded, and falls
    with the pressure of the tank. ``fall``: by which share of its mean that lowers it from the
    begin to the end.
    """

    start: float
    on_time: float
    ramps: tuple[Ramp, ...]
    valve: bool = True
    fall: float = 0.0


@dataclass(frozen=True, slots=True)
class Pulse:
    """Rectangular torque pulse, or an ideal impulse (``on_time`` 0, ``torque`` None).

    ``t`` is its centre in s; ``torque`` (3,) N m and ``impulse`` (3,) N m s are in principal body
    axes; ``force`` (3,) N is the net force, None where it is not known; ``propellant`` kg or None.
    Through a valve it is what the ``command`` gives: ``t`` is the centroid of its thrust and
    ``on_time`` the effective one, impulse over torque.
    """

    t: float
    on_time: float
    channel: str
    impulse: Vector
    torque: Vector | None = None
    force: Vector | None = None
    propellant: float | None = None
    command: Command | None = None

    @property
    def loaded(self) -> tuple[float, float]:
        """Start and on-time as they are commanded, s."""
        return (
            (self.start, self.on_time)
            if self.command is None
            else (self.command.start, self.command.on_time)
        )

    @property
    def through_valve(self) -> bool:
        """True if the valve turns the command into another on-time."""
        return self.command is not None and self.command.valve

    @property
    def thrust(self) -> tuple[float, float]:
        """Start and end of the thrust, s."""
        if self.command is None or not self.command.ramps:
            return self.start, self.end
        return self.command.ramps[0].begin, self.command.ramps[-1].end

    @property
    def over(self) -> float:
        """End of both command and thrust, s."""
        return self.end if self.command is None else max(sum(self.loaded), self.thrust[1])

    @property
    def edges(self) -> tuple[float, ...]:
        """Times (s) at which its thrust begins, ends, or begins or ends to rise or to fall."""
        if self.command is None:
            return self.start, self.end
        return tuple(time for ramp in self.command.ramps for time in ramp[:2])

    def push(self, start: float, end: float) -> tuple[Vector, Vector | None] | None:
        """Torque (3,) N m at ``start`` and its slope, N m/s, None for none, up to ``end`` s, with
        no edge in between.

        None where it does not fire then.
        """
        if self.torque is None or end <= start:
            return None
        if self.command is None:
            return (self.torque, None) if self.start <= start and end <= self.end else None
        for ramp in self.command.ramps:
            if ramp.begin <= start and end <= ramp.end:
                if ramp.first == ramp.last:
                    return self.torque * ramp.first, None
                slope = (ramp.last - ramp.first) / (ramp.end - ramp.begin)
                return self.torque * (
                    ramp.first + slope * (start - ramp.begin)
                ), self.torque * slope
        return None

    def share(self, times: Vector) -> Vector:
        """Fraction of the impulse given by each of the ``times`` (n,) s."""
        if self.on_time == 0.0:
            return np.where(times >= self.t, 1.0, 0.0)
        if self.command is None:
            return np.clip((times - self.start) / self.on_time, 0.0, 1.0)
        given = np.zeros(len(times))
        for ramp in self.command.ramps:
            since = np.clip(times, ramp.begin, ramp.end) - ramp.begin
            given += since * (
                ramp.first + 0.5 * (ramp.last - ramp.first) * since / (ramp.end - ramp.begin)
            )
        return given / self.on_time

    def moved(self, by: float) -> Pulse:
        """Copy ``by`` s later."""
        command = self.command
        if command is not None:
            ramps = tuple(
                ramp._replace(begin=ramp.begin + by, end=ramp.end + by) for ramp in command.ramps
            )
            command = replace(command, start=command.start + by, ramps=ramps)
        return replace(self, t=self.t + by, command=command)

    @property
    def start(self) -> float:
        """Start of the pulse, s."""
        return self.t - 0.5 * self.on_time

    @property
    def end(self) -> float:
        """End of the pulse, s."""
        return self.t + 0.5 * self.on_time

    @property
    def resolved(self) -> bool:
        """True if floating point resolves its length; an ideal impulse has none."""
        return self.on_time == 0.0 or math.ulp(self.end) <= RESOLUTION * self.on_time

    @property
    def magnitude(self) -> float:
        """|J| in N m s."""
        return float(np.linalg.norm(self.impulse))


def overlapping(pulses: Iterable[tuple[Label, Pulse]]) -> list[tuple[Label, Label]]:
    """Labels of pulses that begin while their channel still fires, each with the earlier one's."""
    firing: dict[str, tuple[Label, float]] = {}
    overlaps = []
    for label, pulse in sorted(pulses, key=lambda entry: entry[1].loaded[0]):
        before, end = firing.get(pulse.channel, (label, -math.inf))
        if pulse.loaded[0] < end - touching(end):
            overlaps.append((label, before))
        if pulse.over > end:
            firing[pulse.channel] = label, pulse.over
    return overlaps


def touching(time: float) -> float:
    """Overlap, s, at ``time`` s up to which two pulses count as touching."""
    return max(TOUCHING, math.ulp(time)) if math.isfinite(time) else 0.0


def on_command(channel: Channel, start: float, on_time: float) -> Pulse:
    """Pulse of ``channel`` commanded on at ``start`` s for ``on_time`` s."""
    valve = channel.valve
    if valve is None:
        return _rectangle(channel, start + 0.5 * on_time, on_time)
    thrust = valve.thrust(on_time)
    ramps = tuple(
        ramp._replace(begin=start + ramp.begin, end=start + ramp.end) for ramp in thrust.ramps
    )
    command = Command(start, on_time, ramps)
    if not ramps:
        return Pulse(
            start,
            0.0,
            channel.name,
            np.zeros(3),
            propellant=channel.mass_flow and 0.0,
            command=command,
        )
    return replace(_rectangle(channel, start + thrust.centroid, thrust.on_time), command=command)


def channel_pulse(channel: Channel, t: float, on_time: float) -> Pulse:
    """Pulse of ``channel``, centred at ``t`` s and ``on_time`` s long, with its command."""
    valve = channel.valve
    if valve is None or on_time == 0.0:
        return _rectangle(channel, t, on_time)
    loaded = valve.on_time_for(float(on_time))
    return on_command(channel, float(t) - valve.thrust(loaded).centroid, loaded)


def _rectangle(channel: Channel, t: float, on_time: float) -> Pulse:
    flow = channel.mass_flow
    propellant = None if flow is None else flow * on_time
    return Pulse(
        t,
        on_time,
        channel.name,
        channel.torque * on_time,
        channel.torque,
        channel.force,
        propellant,
    )


def steerable_pulse(
    steerable: Steerable,
    t: float,
    angle: float,
    *,
    impulse: float = 0.0,
    on_time: float | None = None,
) -> Pulse:
    """Pulse of a steerable torquer centred at ``t`` s, about the transverse axis at ``angle`` rad.

    It is ideal, of an ``impulse`` in N m s, where the torquer has no torque; else it lasts for
    ``on_time`` s, by default as long as the impulse takes.
    """
    direction = np.array([math.cos(angle), math.sin(angle), 0.0])
    torque: Vector | None = None
    if steerable.torque is None:
        on_time = 0.0
    else:
        torque = steerable.torque * direction
        if on_time is None:
            on_time = impulse / steerable.torque
        else:
            impulse = steerable.torque * on_time
    rate = steerable.propellant_per_impulse
    propellant = None if rate is None else rate * impulse
    return Pulse(t, on_time, STEERABLE, impulse * direction, torque, propellant=propellant)


class Bounds(NamedTuple):
    """Lower bounds on the cost of other schedules of the channels ``within`` so many s, in ``unit``
    (kg or N m s).

    ``first_order`` is that of the small-angle program; None where that was not solved. ``rigorous``
    holds at any angle for all schedules that leave no more than this one; None where nothing is
    known to hold: I1 ≠ I2, dissipation, disturbances, a goal for the spin. ``keeping`` is the
    first-order one of schedules that keep H, where this one need not; None for others.
    """

    first_order: float | None
    rigorous: float | None
    unit: str
    within: float
    keeping: float | None = None


@dataclass(frozen=True, slots=True)
class Schedule:
    """Pulses in the order of their centres, notes of the scheme that chose them, and lower bounds
    on the cost.

    ``blocks`` are the commands by which the pulses are fired, where it is not one by one.
    """

    pulses: tuple[Pulse, ...] = ()
    notes: tuple[Note, ...] = ()
    bounds: Bounds | None = None
    blocks: tuple[Block, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "pulses", tuple(sorted(self.pulses, key=lambda pulse: pulse.t)))

    def __len__(self) -> int:
        return len(self.pulses)

    @property
    def pulses_by_block(self) -> list[list[int]]:
        """Numbers, from 0, of the pulses of each block, or of each pulse alone."""
        if not self.blocks:
            return [[number] for number in range(len(self.pulses))]
        numbers: list[list[int]] = [[] for _ in self.blocks]
        for number, firing in enumerate(firings(self.blocks)):
            numbers[firing.at].append(number)
        return numbers

    def __iter__(self) -> Iterator[Pulse]:
        return iter(self.pulses)

    def __getitem__(self, index: int) -> Pulse:
        return self.pulses[index]

    @property
    def fired_with(self) -> list[int]:
        """Number, from 1, of the first pulse that is fired by the same Sun pulse as each; without
        blocks its own.
        """
        if not self.blocks:
            return list(range(1, len(self.pulses) + 1))
        first: dict[int, int] = {}
        queue = enumerate(firings(self.blocks), start=1)
        return [first.setdefault(firing.number, number) for number, firing in queue]

    @property
    def without_proof(self) -> Schedule:
        """Copy without the rigorous bound: for a motion that the bound was not derived for."""
        return (
            self
            if self.bounds is None
            else replace(self, bounds=self.bounds._replace(rigorous=None))
        )

    @property
    def idealised(self) -> bool:
        """True if any of the pulses is an ideal impulse."""
        return any(pulse.on_time == 0.0 for pulse in self.pulses)

    @property
    def shaped(self) -> bool:
        """True if the thrust of any of the pulses is no rectangle."""
        return any(pulse.command is not None for pulse in self.pulses)

    @property
    def cost(self) -> float:
        """Propellant in kg; where that is unknown, impulse in N m s."""
        propellant = self.propellant
        return self.total_impulse if propellant is None else propellant

    def cost_in(self, unit: str) -> float:
        """Propellant where the ``unit`` is kg and it is known, else impulse in N m s."""
        return self.cost if unit == "kg" else self.total_impulse

    def spent(self, least: str, unit: str = "kg") -> float:
        """Amount of what is saved: propellant or impulse, in ``unit``, the end, s, or pulses."""
        if least == "time":
            return self.end
        if least == "pulses":
            return float(len(self.pulses))
        return self.total_impulse if least == "impulse" else self.cost_in(unit)

    @property
    def end(self) -> float:
        """End of the last pulse, s; 0 without pulses."""
        return max((pulse.over for pulse in self.pulses), default=0.0)

    @property
    def total_impulse(self) -> float:
        """Σ |J| in N m s."""
        return math.fsum(pulse.magnitude for pulse in self.pulses)

    def used_by(self, times: Vector, *, at_once: bool = False) -> Vector:
        """Propellant (n,) kg used by the ``times`` (n,) s, as far as it is known.

        It flows as the thrust goes; ``at_once``: each pulse takes all of it at its centre.
        """
        used = np.zeros(len(times))
        for pulse in self.pulses:
            share = np.where(times >= pulse.t, 1.0, 0.0) if at_once else pulse.share(times)
            used += (pulse.propellant or 0.0) * share
        return used

    @property
    def propellant(self) -> float | None:
        """Propellant in kg; None where that of one pulse is unknown."""
        known = [pulse.propellant for pulse in self.pulses if pulse.propellant is not None]
        return math.fsum(known) if len(known) == len(self.pulses) else None
