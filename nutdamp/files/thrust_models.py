"""The keys of a spacecraft file that say what thrusters make of commands: valves, cold nozzles, the tank."""

from __future__ import annotations

from typing import Annotated, Literal

from nutdamp.files.fields import Quantity
from nutdamp.files.quantities import Mass, PositiveTime, Time
from nutdamp.files.sections import Field, Length, Section

Pressure = Annotated[float, Quantity("pressure", exclusiveMinimum=0)]
Impulse = Annotated[float, Quantity("impulse", exclusiveMinimum=0)]

Shed = Annotated[float, Quantity("shed", minimum=0)]

ImpulseBits = Annotated[list[tuple[PositiveTime, Impulse, PositiveTime]], Length(2)]
"""Rows of on-time, impulse and centroid."""


class ValveSection(Section):
    """A valve: from the command to the thrust, which then rises and falls evenly."""

    open_delay: Time = Field("From the start of the command to the first thrust, s; default 0.", "8 ms", default=0.0)
    close_delay: Time = Field(
        "From the end of the command until the thrust begins to fall, s; default 0.", "12 ms", default=0.0
    )
    rise_time: Time = Field("From the first thrust to full thrust, s; default 0.", "5 ms", default=0.0)
    fall_time: Time = Field("From full thrust to none, s; default 0.", "10 ms", default=0.0)
    on_time_is: Literal["command", "effective"] = Field(
        "Meaning of a commanded on-time: the length of the command (default), or impulse over full "
        "thrust, which the electronics of the valve turns into one.",
        "command",
        default="command",
    )


class ShedSection(Section):
    """What the propellant in the tank gives to the moments of inertia."""

    A: Shed = Field("Off the transverse moment for each kg used, kg m²/kg.", "0.4 kg m^2/kg")
    C: Shed = Field("Off the moment about axis 3 for each kg used, kg m²/kg.", "0.6 kg m^2/kg")


class TankSection(Section):
    """A tank in blowdown: the gas expands as the propellant is used, and pressure and thrust fall."""

    propellant: Mass = Field("Propellant in it at t = 0, kg.", "30 kg")
    pressure: Pressure = Field("Pressure at t = 0, Pa.", "22 bar")
    final_pressure: Pressure = Field("Pressure when the propellant is used up, Pa.", "8 bar")
    exponent: Annotated[float, Quantity("number", minimum=0)] = Field(
        "Exponent n in thrust ~ pressure^n; default 1.", 1, default=1.0
    )
    isp: Annotated[list[tuple[Pressure, PositiveTime]], Length(2)] | None = Field(
        "Rows of pressure, Pa, rising, and specific impulse, s, instead of that of the thrusters; it runs "
        "evenly between them, and below the first it is that of the first.",
        [["8 bar", "215 s"], ["22 bar", "228 s"]],
    )
    inertia_per_kg: Annotated[list[Shed], Length(3, 3)] | ShedSection | None = Field(
        "What each kg that is used takes off the moments of inertia, kg m²/kg: A and C, or a list of the "
        "three principal moments, the one about axis 3 last. Default: they stay.",
        {"A": "0.4 kg m^2/kg", "C": "0.6 kg m^2/kg"},
    )


class ColdSection(Section):
    """Cold nozzles: the first pulses of each channel are weaker."""

    first: Annotated[float, Quantity("ratio", exclusiveMinimum=0)] = Field(
        "Thrust of the first pulse of a channel, over that of a warm one.", "90 %"
    )
    pulses: Annotated[float, Quantity("number", exclusiveMinimum=0)] = Field(
        "Pulses in which the difference from a warm one falls by a factor of e.", 4
    )
