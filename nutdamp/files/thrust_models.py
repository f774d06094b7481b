"""The keys of a spacecraft file that say what thrusters make of commands: valves, cold nozzles, the tank."""

from __future__ import annotations

from typing import Annotated, Literal

from nutdamp.files.fields import Quantity
from nutdamp.files.quantities import PositiveTime, Time
from nutdamp.files.sections import Field, Length, Section

Impulse = Annotated[float, Quantity("impulse", exclusiveMinimum=0)]

ImpulseBits = Annotated[list[tuple[PositiveTime, Impulse, PositiveTime]], Length(2)]
"""Rows of on-time, impulse and centroid."""


class ValveSection(Section):
    """A valve: from the command to the thrust, which then rises and falls evenly."""

    open_delay: Time = Field(
        default=0.0, description="From the start of the command to the first thrust, s; default 0.", examples=["8 ms"]
    )
    close_delay: Time = Field(
        default=0.0,
        description="From the end of the command until the thrust begins to fall, s; default 0.",
        examples=["12 ms"],
    )
    rise_time: Time = Field(
        default=0.0, description="From the first thrust to full thrust, s; default 0.", examples=["5 ms"]
    )
    fall_time: Time = Field(default=0.0, description="From full thrust to none, s; default 0.", examples=["10 ms"])
    on_time_is: Literal["command", "effective"] = Field(
        default="command",
        description="What on-times are that are loaded: the length of the command (default), or impulse over full "
        "thrust, which the electronics of the valve turns into one.",
        examples=["command"],
    )


class ColdSection(Section):
    """Cold nozzles: the first pulses of each channel are weaker."""

    first: Annotated[float, Quantity("ratio", exclusiveMinimum=0)] = Field(
        description="Thrust of the first pulse of a channel, over that of a warm one.", examples=["90 %"]
    )
    pulses: Annotated[float, Quantity("number", exclusiveMinimum=0)] = Field(
        description="Pulses over which the difference to a warm one falls to its e-th part.", examples=[4]
    )
