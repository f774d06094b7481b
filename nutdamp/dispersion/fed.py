"""How strong pulses of cases are where cold nozzles and the tank are not as the file has them, and what they take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from nutdamp.dispersion.draws import Draws
from nutdamp.dispersion.elementwise import Cases, plus
from nutdamp.physics.feed import Tank
from nutdamp.schedule import Schedule
from nutdamp.spacecraft import Spacecraft
from nutdamp.supply import Supply


def tank_of(body: Spacecraft, draws: Draws) -> Tank | None:
    """The tank as it is in the cases."""
    if body.tank is None:
        return None
    names = ("propellant", "pressure", "final_pressure", "exponent")
    return replace(
        body.tank, **{name: plus(getattr(body.tank, name), draws.get(f"tank {name}", 0.0)) for name in names}
    )


class Fed(NamedTuple):
    """How strong each pulse is over what it is as planned, and its propellant, kg, None where that is not known.

    ``drained``: share of the propellant in the tank that all of them would take, 1 at most where it lasts; 0 without a
    tank, or where it is not known what they take.
    """

    levels: list[Cases]
    spent: tuple[Cases, ...] | None
    drained: Cases = 0.0


def supplied(body: Spacecraft, schedule: Schedule, draws: Draws, flows: Sequence[Cases]) -> Fed:
    """How strong the pulses are in cases: none once the tank is empty, nor those that do not fire as planned.

    ``flows``: what each takes of propellant over what it does as planned, at the same pressure and as warm.
    """
    cold, tank = body.cold, tank_of(body, draws)
    known = all(pulse.propellant is not None for pulse in schedule)
    planned = [pulse.propellant or 0.0 for pulse in schedule]
    levels: list[Cases] = [1.0] * len(flows)
    if tank is None and not ("cold" in draws or "cold_pulses" in draws):
        return Fed(levels, tuple(used * flow for used, flow in zip(planned, flows, strict=True)) if known else None)
    if cold is not None:
        off = draws.get("cold", 0.0), draws.get("cold_pulses", 0.0)
        cold = replace(cold, first=plus(cold.first, off[0]), pulses=plus(cold.pulses, off[1]))
    nominal, case = Supply(body), Supply(replace(body, cold=cold, tank=tank))
    channels = {channel.name: channel for channel in body.channels}
    higher: Cases = 1.0  # the file gives the thrust at its own pressure
    if tank is not None and body.tank is not None:
        higher = (tank.pressure / body.tank.pressure) ** tank.exponent
    taken: list[Cases] = list(planned)
    for number in sorted(range(len(flows)), key=lambda at: schedule.pulses[at].loaded[0]):
        pulse = schedule.pulses[number]
        channel = channels.get(pulse.channel)
        if channel is None or pulse.torque is None:
            nominal.draw(planned[number])
            levels[number] = case.draw(planned[number] * flows[number])
            taken[number] = planned[number] * flows[number] * levels[number]
            continue
        before, _ = nominal.take(channel, pulse.on_time)
        level, used = case.take(channel, pulse.on_time * flows[number] * higher)
        levels[number], taken[number] = level * higher / (before or 1.0), 0.0 if used is None else used
    drained = 0.0 if tank is None or not known else case.used / tank.propellant
    return Fed(levels, tuple(taken) if known else None, drained)
