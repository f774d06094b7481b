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

    position: Position = Field("Position from the center, m.", ["7000 km", 0, 0])
    velocity: Velocity = Field("Velocity, m/s.", [0, "7.5 km/s", 0])
    center: Name = Field("Body at the origin; default EARTH.", "EARTH", default="EARTH")


class SunSensorSection(Section):
    """A sensor that gives a pulse in each spin, when the Sun passes it."""

    azimuth: Angle = Field("Azimuth in the body at which the Sun pulse comes, about axis 3 from axis 1, rad.", "35 deg")
    elevation: Declination = Field(
        "Middle of its view, from the plane square to axis 3 towards the spin axis, rad; default 0.",
        "45 deg",
        default=0.0,
    )
    half_width: Apart = Field(
        "How far from there it sees the Sun, rad; default 90 deg, which is always.", "45 deg", default=RIGHT_ANGLE
    )
    jitter: Time = Field("One sigma of its pulses, s; default 0.", "0.5 ms", default=0.0)


class WidthSection(Section):
    """Widths of pulses that can be commanded: min, min + step, … up to max."""

    step: PositiveTime = Field("Resolution of the width, s.", "1 ms")
    min: PositiveTime = Field("Shortest width, s.", "20 ms")
    max: PositiveTime = Field("Longest width, s.", "500 ms")


Widths = Annotated[list[PositiveTime], Length(1)] | WidthSection


class CommandsSection(Section):
    """What a command block may hold: so many pulses of one channel, fired by the Sun pulse."""

    delay_step: PositiveTime = Field("Resolution of the delay after the Sun pulse, s.", "2 ms")
    delay_max: PositiveTime = Field("Longest delay, s; up to a spin turn is used.", "1.9 s")
    width: Widths = Field(
        "Widths that can be commanded, s: a list, or step, min and max.",
        {"step": "1 ms", "min": "20 ms", "max": "500 ms"},
        ["0.1 s", "0.2 s"],
    )
    max_count: Count = Field("Most pulses of a block; default 255.", 255, default=255)
    every: Annotated[list[Count], Length(1)] = Field(
        "Spins from one pulse to the next that can be chosen; default [1].", [1, 2], default=[1]
    )


class KeepSection(Section):
    """A cone about a direction in space which the spin axis must not enter, or must not leave, nutation included."""

    name: Name = Field("Name of the cone, for reports.", "Earth")
    direction: Annotated[InTheSky, OrWord("sun")] = Field(
        "Right ascension and declination in the attitude's frame, rad; or sun.", "sun", ["120 deg", "10 deg"]
    )
    min: Apart | None = Field("Least angle to the spin axis, rad; default 0.", "4 deg")
    max: Apart | None = Field("Largest angle between it and the spin axis, rad; default 180 deg.", "20 deg")
