"""Propellant supply: strength of each pulse with cold nozzles and falling tank pressure."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from nutdamp.common.numerics import gauss_legendre
from nutdamp.errors import Infeasible
from nutdamp.flight.dynamics import lightened
from nutdamp.physics.thruster import Ramp, Tank
from nutdamp.spacecraft.equipment import Channel
from nutdamp.spacecraft.model import BLOWDOWN, COLD, LIGHTER, TRAVEL, VALVES, Spacecraft, Vector
from nutdamp.spacecraft.schedule import Command, Pulse, Schedule, on_command
from nutdamp.units import STANDARD_GRAVITY

EVEN = 0.01
"""Share of its mean by which the thrust falls, at most, in each of the straight pieces of a pulse."""

NODES = 6
"""Nodes of the quadrature in each of them."""

REPEATED, CLOSE = 60, 1e-14
"""Iterations, and relative tolerance of the on-time for an impulse."""


class Supply:
    """Supply state: pulses fired by channel, and propellant used, kg: numbers, or arrays of cases.

    By default what was fired before t = 0. ``used`` is what the pulses would take of a tank that lasts: with an empty
    one nothing fires, and the last pulse before that only as far as the propellant goes.
    """

    def __init__(self, spacecraft: Spacecraft, fired: Counter[str] | None = None, used: Any = None) -> None:
        cold, tank = spacecraft.cold, spacecraft.tank
        before: Mapping[str, int] = {} if cold is None else cold.fired
        self.spacecraft = spacecraft
        self.fired = Counter(before) if fired is None else fired
        self.used = (0.0 if tank is None else tank.used) if used is None else used
        self.steady = not {COLD, BLOWDOWN, TRAVEL} & set(spacecraft.thrust_laws)
        """True if every pulse is as strong as the file says."""
        self._begun = self.used

    def behind(self, later: Spacecraft) -> Spacecraft:
        """Spacecraft ``later``, with all firings so far before its t = 0."""
        cold, tank = later.cold, later.tank
        return replace(
            later,
            inertia=lightened(later, self.since),
            cold=None if cold is None else replace(cold, fired=dict(self.fired)),
            tank=None if tank is None else replace(tank, used=self.used),
        )

    @property
    def since(self) -> Any:
        """Propellant used since t = 0, kg."""
        tank = self.spacecraft.tank
        return self.used if tank is None else np.minimum(self.used, tank.propellant) - tank.used

    def level(self, channel: str) -> Any:
        """Thrust of the next pulse of ``channel``, over that of the file."""
        cold, tank = self.spacecraft.cold, self.spacecraft.tank
        level = 1.0 if cold is None else cold.factor(self.fired[channel])
        return level if tank is None else level * tank.thrust_factor(self.used)

    def fire(self, pulse: Pulse, channel: Channel | None) -> Pulse:
        """Fire a pulse; returns it at its real strength."""
        if channel is None or pulse.torque is None or self.steady:
            share = self.draw(pulse.propellant or 0.0)
            return pulse if share == 1.0 else weakened(pulse, share)
        commanded = pulse if pulse.command is None else on_command(channel, *pulse.loaded)
        before, flow = self.used, self.full_flow(channel)
        level, propellant = self.take(channel, commanded.on_time)
        torque, force = self.torque(channel, 0.5 * (before + self.used)) * level, channel.force
        if self.spacecraft.tank is not None and flow is not None and propellant:
            cold = 1.0 if self.spacecraft.cold is None else self.spacecraft.cold.factor(self.fired[channel.name] - 1)
            commanded = falling(commanded, self.spacecraft.tank, before, flow * cold)
        return replace(
            commanded,
            torque=torque,
            impulse=torque * commanded.on_time,
            force=None if force is None else force * level,
            propellant=propellant,
        )

    def torque(self, channel: Channel, used: float) -> Vector:
        """Torque of ``channel`` at the thrust of the file with ``used`` kg gone, (3,) N m: the center of mass moves."""
        per_kg = self.spacecraft.center_of_mass_per_kg
        if per_kg is None or channel.force is None:
            return channel.torque
        return channel.torque - np.cross((used - self._begun) * per_kg, channel.force)

    def on_time_for(self, channel: Channel, effective: float) -> float:
        """On-time (s) of the next pulse of ``channel`` with the impulse of ``effective`` s of the thrust of the file.

        Found by repeating: each step errs by the share by which the thrust falls, of the error before it.
        """
        cold, tank, flow = self.spacecraft.cold, self.spacecraft.tank, self.full_flow(channel)
        warm = effective / (1.0 if cold is None else cold.factor(self.fired[channel.name]))
        if tank is None:
            return warm
        on_time = warm / float(tank.thrust_factor(self.used))
        for _ in range(REPEATED if flow is not None else 0):
            before, on_time = on_time, warm / float(tank.burn(self.used, flow * effective / warm, on_time)[1])
            if abs(on_time - before) <= CLOSE * on_time:
                break
        return on_time

    def full_flow(self, channel: Channel) -> Any:
        """Propellant of a second of the thrust of the file, kg; times the specific impulse where the tank has it."""
        tank = self.spacecraft.tank
        if tank is None or tank.isp is None or any(thruster.thrust is None for thruster in channel.thrusters):
            return channel.mass_flow
        if channel.mass_flow is None:
            return None
        return sum(thruster.thrust or 0.0 for thruster in channel.thrusters) / STANDARD_GRAVITY

    def draw(self, propellant: Any) -> Any:
        """Consume propellant; return the available fraction."""
        tank, before = self.spacecraft.tank, self.used
        self.used = before + propellant
        return 1.0 if tank is None else tank.share(before, propellant)

    def take(self, channel: Channel, on_time: Any) -> tuple[Any, Any]:
        """Mean level of a pulse of effective ``on_time`` s and its propellant, kg or None, which counts for later ones.

        No level once the tank is empty.
        """
        flow, tank, cold = self.full_flow(channel), self.spacecraft.tank, self.spacecraft.cold
        warmth = 1.0 if cold is None else cold.factor(self.fired[channel.name])
        if flow is None or tank is None:
            level = self.level(channel.name)
            propellant = None if flow is None else flow * on_time * level
        else:
            propellant, level = tank.burn(self.used, flow * warmth, on_time)
            level = warmth * level
        self.fired[channel.name] += 1
        share = self.draw(0.0 if propellant is None else propellant)
        return level * share, None if propellant is None else propellant * share

    def count(self, pulses: Iterable[Pulse]) -> None:
        """Take pulses into account that are as strong as they really are."""
        for pulse in pulses:
            self.fired[pulse.channel] += 1
            self.used += pulse.propellant or 0.0

    @property
    def shortage(self) -> str | None:
        """Message if more has been fired than the tank has; else None."""
        tank = self.spacecraft.tank
        if tank is None or self.used <= tank.propellant:
            return None
        return f"takes {self.used:.4g} kg of propellant, and the tank has {tank.propellant:.4g} kg"

    def expect_to_last(self) -> None:
        """Raise Infeasible where there is a `shortage`."""
        if self.shortage is not None:
            raise Infeasible(self.shortage)


def weakened(pulse: Pulse, factor: float) -> Pulse:
    """Pulse at ``factor`` times the thrust; reversed where that is negative."""
    torque, force = (None if vector is None else factor * vector for vector in (pulse.torque, pulse.force))
    used = None if pulse.propellant is None else abs(factor) * pulse.propellant
    return replace(pulse, impulse=factor * pulse.impulse, torque=torque, force=force, propellant=used)


def falling(pulse: Pulse, tank: Tank, used: float, flow: float) -> Pulse:
    """Pulse whose thrust falls with the pressure of the ``tank``, of which ``used`` kg were gone at its start.

    ``flow`` as `Tank.burn` takes it. Its ramps are straight pieces, each with the impulse and the centroid of the
    thrust there; its mean level is left to the torque.
    """
    start, on_time = pulse.loaded
    command = pulse.command or Command(start, on_time, (Ramp(pulse.start, pulse.end, 1.0, 1.0),), valve=False)
    gone, mean = tank.burn(used, flow, pulse.on_time)
    first, last = (float(tank.thrust_factor(used + spent) / mean) for spent in (0.0, gone))
    pieces, ramps, moment, passed = max(1, math.ceil((first - last) / EVEN)), list[Ramp](), 0.0, 0.0
    nodes, weights = gauss_legendre(NODES)
    for ramp in command.ramps:
        length = (ramp.end - ramp.begin) / pieces
        for number in range(pieces):
            begin, middle = ramp.begin + number * length, ramp.begin + (number + 0.5) * length
            rise = (ramp.last - ramp.first) / pieces
            ahead = ramp.first + number * rise
            along = 0.5 * length * (1.0 + nodes)
            opened = passed + ahead * along + 0.5 * rise / length * along**2
            factors = tank.thrust_factor(used + tank.burn(used, flow, opened)[0]) / mean
            levels = (ahead + rise * along / length) * factors
            even, lean = 0.5 * float(weights @ levels), 1.5 * float(weights @ (nodes * levels))
            ramps.append(Ramp(begin, begin + length, even - lean, even + lean))
            moment += even * length * (middle - pulse.t) + lean * length**2 / 6.0
            passed += (ahead + 0.5 * rise) * length
    shaped = replace(command, ramps=tuple(ramps), fall=first - last)
    return replace(pulse, t=pulse.t + moment / pulse.on_time, command=shaped)


def supplied(spacecraft: Spacecraft, pulses: Iterable[Pulse]) -> tuple[Pulse, ...]:
    """Pulses at their real strength, in the order of their commands."""
    supply, channels = Supply(spacecraft), {channel.name: channel for channel in spacecraft.channels}
    if supply.steady:
        return tuple(pulses)
    ordered = sorted(pulses, key=lambda pulse: pulse.loaded[0])
    return tuple(supply.fire(pulse, channels.get(pulse.channel)) for pulse in ordered)


def lacking(spacecraft: Spacecraft, schedule: Schedule, law: str) -> tuple[Spacecraft, Schedule]:
    """Body without one ``law`` of `Spacecraft.thrust_laws`, and the response to the commands of ``schedule``."""
    if law == VALVES:
        body = replace(spacecraft, channels=tuple(channel.of(valve=None) for channel in spacecraft.channels))
    elif law == LIGHTER and spacecraft.tank is not None:
        body = replace(spacecraft, tank=replace(spacecraft.tank, inertia_per_kg=None))
    elif law == TRAVEL:
        body = replace(spacecraft, center_of_mass_per_kg=None)
    elif law == BLOWDOWN and spacecraft.tank is not None:  # once it is empty nothing fires, at full pressure too
        body = replace(spacecraft, tank=replace(spacecraft.tank, final_pressure=spacecraft.tank.pressure))
    else:
        body = replace(spacecraft, cold=None)
    known = {channel.name: channel for channel in body.channels}
    fired = [
        on_command(known[pulse.channel], *pulse.loaded)
        if pulse.channel in known and pulse.torque is not None
        else pulse
        for pulse in schedule
    ]
    return body, Schedule(supplied(body, fired))
