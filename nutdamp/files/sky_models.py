"""The keys of a spacecraft file that name directions in space, and the command blocks that a Sun pulse fires."""

from __future__ import annotations

from typing import Annotated

from nutdamp.files.fields import RIGHT_ANGLE, OrWord
from nutdamp.files.quantities import (
    Angle,
    Apart,
    Count,
    Declination,
    InTheSky,
    Name,
    Position,
    PositiveTime,
    Time,
    Velocity,
)
from nutdamp.files.sections import Field, Length, Section


class OrbitSection(Section):
    """Where the spacecraft is at t = 0, at attitude.epoch and in attitude.frame; for messages to flight dynamics."""

    position: Position = Field(description="Position from the center, m.", examples=[["7000 km", 0, 0]])
    velocity: Velocity = Field(description="Velocity, m/s.", examples=[[0, "7.5 km/s", 0]])
    center: Name = Field(default="EARTH", description="Body at the origin; default EARTH.", examples=["EARTH"])


class SunSensorSection(Section):
    """A sensor that gives a pulse in each spin, when the Sun passes it."""

    azimuth: Angle = Field(
        description="Azimuth in the body at which the Sun pulse comes, about axis 3 from axis 1, rad.",
        examples=["35 deg"],
    )
    elevation: Declination = Field(
        default=0.0,
        description="Middle of its view, from the plane square to axis 3 towards the spin axis, rad; default 0.",
        examples=["45 deg"],
    )
    half_width: Apart = Field(
        default=RIGHT_ANGLE,
        description="How far from there it sees the Sun, rad; default 90 deg, which is always.",
        examples=["45 deg"],
    )
    jitter: Time = Field(default=0.0, description="One sigma of its pulses, s; default 0.", examples=["0.5 ms"])


class WidthSection(Section):
    """Widths of pulses that can be commanded: min, min + step, … up to max."""

    step: PositiveTime = Field(description="Resolution of the width, s.", examples=["1 ms"])
    min: PositiveTime = Field(description="Shortest width, s.", examples=["20 ms"])
    max: PositiveTime = Field(description="Longest width, s.", examples=["500 ms"])


Widths = Annotated[list[PositiveTime], Length(1)] | WidthSection


class CommandsSection(Section):
    """What a command block may hold: so many pulses of one channel, fired by the Sun pulse."""

    delay_step: PositiveTime = Field(description="Resolution of the delay after the Sun pulse, s.", examples=["2 ms"])
    delay_max: PositiveTime = Field(description="Longest delay, s; less than a spin turn.", examples=["1.9 s"])
    width: Widths = Field(
        description="Widths that can be commanded, s: a list, or step, min and max.",
        examples=[{"step": "1 ms", "min": "20 ms", "max": "500 ms"}, ["0.1 s", "0.2 s"]],
    )
    max_count: Count = Field(default=255, description="Most pulses of a block; default 255.", examples=[255])
    every: Annotated[list[Count], Length(1)] = Field(
        default=[1], description="Spins from one pulse to the next that can be chosen; default [1].", examples=[[1, 2]]
    )


class KeepSection(Section):
    """A cone about a direction in space which the spin axis must not enter, or must not leave, nutation included."""

    name: Name = Field(description="Name of the cone, for reports.", examples=["Earth"])
    direction: Annotated[InTheSky, OrWord("sun")] = Field(
        description="Right ascension and declination in the attitude's frame, rad; or sun.",
        examples=["sun", ["120 deg", "10 deg"]],
    )
    min: Apart | None = Field(
        default=None, description="Least angle to the spin axis, rad; default 0.", examples=["4 deg"]
    )
    max: Apart | None = Field(
        default=None,
        description="Largest angle between it and the spin axis, rad; default 180 deg.",
        examples=["20 deg"],
    )
