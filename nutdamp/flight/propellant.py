"""How strong each pulse of a schedule is: cold nozzles and falling pressure, pulse after pulse."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from nutdamp.errors import Infeasible
from nutdamp.flight.propagation import lightened
from nutdamp.spacecraft.equipment import STANDARD_GRAVITY, Channel
from nutdamp.spacecraft.model import BLOWDOWN, COLD, LIGHTER, VALVES, Spacecraft
from nutdamp.spacecraft.schedule import Pulse, Schedule, on_command


class Supply:
    """What has been commanded so far: pulses by channel, and propellant, kg: one number, or an array of cases.

    By default what was fired before t = 0. ``used`` is what the pulses would take of a tank that lasts: with an empty
    one nothing fires, and the last pulse before that only as far as the propellant goes.
    """

    def __init__(self, spacecraft: Spacecraft, fired: Counter[str] | None = None, used: Any = None) -> None:
        cold, tank = spacecraft.cold, spacecraft.tank
        before: Mapping[str, int] = {} if cold is None else cold.fired
        self.spacecraft = spacecraft
        self.fired = Counter(before) if fired is None else fired
        self.used = (0.0 if tank is None else tank.used) if used is None else used
        self.steady = not {COLD, BLOWDOWN} & set(spacecraft.thrust_laws)
        """Whether every pulse is as strong as the file says."""

    def behind(self, later: Spacecraft) -> Spacecraft:
        """The spacecraft ``later``, with what has been fired so far before its t = 0."""
        cold, tank = later.cold, later.tank
        return replace(
            later,
            inertia=lightened(later, self.since),
            cold=None if cold is None else replace(cold, fired=dict(self.fired)),
            tank=None if tank is None else replace(tank, used=self.used),
        )

    @property
    def since(self) -> Any:
        """What of it has been used since t = 0, kg."""
        tank = self.spacecraft.tank
        return self.used if tank is None else np.minimum(self.used, tank.propellant) - tank.used

    def level(self, channel: str) -> Any:
        """Thrust of the next pulse of ``channel``, over that of the file."""
        cold, tank = self.spacecraft.cold, self.spacecraft.tank
        level = 1.0 if cold is None else cold.factor(self.fired[channel])
        return level if tank is None else level * tank.thrust_factor(self.used)

    def fire(self, pulse: Pulse, channel: Channel | None) -> Pulse:
        """The pulse as strong as it really is, taken into account for those after it."""
        if channel is None or pulse.torque is None or self.steady:
            share = self.draw(pulse.propellant or 0.0)
            return pulse if share == 1.0 else weakened(pulse, share)
        level, propellant = self.take(channel, pulse.on_time)
        torque, force = channel.torque * level, channel.force
        return replace(
            pulse,
            torque=torque,
            impulse=torque * pulse.on_time,
            force=None if force is None else force * level,
            propellant=propellant,
        )

    def draw(self, propellant: Any) -> Any:
        """Draws so many kg; returns the share of them that there is."""
        tank, before = self.spacecraft.tank, self.used
        self.used = before + propellant
        return 1.0 if tank is None else tank.share(before, propellant)

    def take(self, channel: Channel, on_time: Any) -> tuple[Any, Any]:
        """Level of a pulse of effective ``on_time`` s and its propellant, kg or None; it counts for those after it.

        No level once the tank is empty.
        """
        level, tank = self.level(channel.name), self.spacecraft.tank
        isp = None if tank is None else tank.isp_after(self.used)
        flow: Any = channel.mass_flow
        if flow is not None and isp is not None and all(one.thrust is not None for one in channel.thrusters):
            flow = sum(one.thrust or 0.0 for one in channel.thrusters) / (isp * STANDARD_GRAVITY)
        propellant = None if flow is None else flow * on_time * level
        self.fired[channel.name] += 1
        share = self.draw(0.0 if propellant is None else propellant)
        return level * share, None if propellant is None else propellant * share

    def count(self, made: Iterable[Pulse]) -> None:
        """Take pulses into account that are as strong as they really are."""
        for pulse in made:
            self.fired[pulse.channel] += 1
            self.used += pulse.propellant or 0.0

    @property
    def shortage(self) -> str | None:
        """That more has been fired than the tank has; None where it has not."""
        tank = self.spacecraft.tank
        if tank is None or self.used <= tank.propellant:
            return None
        return f"takes {self.used:.4g} kg of propellant, and the tank has {tank.propellant:.4g} kg"

    def expect_to_last(self) -> None:
        """Raise Infeasible where there is a `shortage`."""
        if self.shortage is not None:
            raise Infeasible(self.shortage)


def weakened(pulse: Pulse, factor: float) -> Pulse:
    """A pulse of so many times the thrust; backwards where that is negative."""
    torque, force = (None if one is None else factor * one for one in (pulse.torque, pulse.force))
    used = None if pulse.propellant is None else abs(factor) * pulse.propellant
    return replace(pulse, impulse=factor * pulse.impulse, torque=torque, force=force, propellant=used)


def supplied(spacecraft: Spacecraft, pulses: Iterable[Pulse]) -> tuple[Pulse, ...]:
    """The ``pulses`` as strong as they really are, in the order of their commands."""
    supply, channels = Supply(spacecraft), {channel.name: channel for channel in spacecraft.channels}
    if supply.steady:
        return tuple(pulses)
    ordered = sorted(pulses, key=lambda pulse: pulse.loaded[0])
    return tuple(supply.fire(pulse, channels.get(pulse.channel)) for pulse in ordered)


def lacking(spacecraft: Spacecraft, schedule: Schedule, law: str) -> tuple[Spacecraft, Schedule]:
    """The body without one ``law`` of `Spacecraft.thrust_laws`, and what the commands of ``schedule`` give then."""
    if law == VALVES:
        body = replace(spacecraft, channels=tuple(channel.of(valve=None) for channel in spacecraft.channels))
    elif law == LIGHTER and spacecraft.tank is not None:
        body = replace(spacecraft, tank=replace(spacecraft.tank, inertia_per_kg=None))
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
