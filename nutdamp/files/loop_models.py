"""The keys of a spacecraft file that describe a closed loop: its sensor, its law, faults to fly with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

from nutdamp.files.fields import RIGHT_ANGLE, Quantity
from nutdamp.files.quantities import AcuteAngle, Direction, Name, Position, PositiveTime, Time
from nutdamp.files.sections import Field, Section
from nutdamp.units import parse, pattern, shown


class Reading(Quantity):
    """Annotation of a quantity in the unit of the sensor: an angular rate of a gyro, else an acceleration."""

    def __init__(self, **bounds: float) -> None:
        super().__init__("rate", **bounds)

    def check(self, value: object) -> float:
        """SI value; raises ValueError, which says what would be right."""
        try:
            result = parse(value, "acceleration")
        except ValueError:
            result = parse(value, self.kind)
        if not self._allows(result):
            raise ValueError(f"{shown(value)} is out of range; expected at least {self.bounds['minimum']:g}")
        return result

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:  # noqa: ARG002
        """A number, or a text with a unit of either."""
        texts = [{"type": "string", "pattern": pattern(kind)} for kind in ("rate", "acceleration")]
        return {"anyOf": [{"type": "number", **self.bounds}, *texts]}


Frequency = Annotated[float, Quantity("frequency", exclusiveMinimum=0)]
Least = Annotated[float, Reading(minimum=0)]
Threshold = Annotated[float, Quantity("angle", minimum=0, exclusiveMaximum=RIGHT_ANGLE)]


class LoopSensorSection(Section):
    """What the loop sees: two rate gyros about the axes 1 and 2, or an accelerometer."""

    kind: Literal["gyro", "accelerometer"] = Field(
        description="gyro: ω1 and ω2; accelerometer: the acceleration at position along axis.", examples=["gyro"]
    )
    rate: Frequency | None = Field(
        default=None, description="Samples a second, Hz; default: a continuous signal.", examples=["100 Hz"]
    )
    quantisation: Least = Field(
        default=0.0,
        description="Step of a sample: rad/s, of an accelerometer m/s²; default 0.",
        examples=["0.002 deg/s"],
    )
    noise: Least = Field(
        default=0.0,
        description="One sigma of the noise of a sample: rad/s, of an accelerometer m/s²; default 0.",
        examples=["0.01 deg/s"],
    )
    bias: Annotated[float, Reading()] = Field(
        default=0.0,
        description="What a signal shows without motion: rad/s, of an accelerometer m/s²; default 0.",
        examples=["0.02 deg/s"],
    )
    scale: Annotated[float, Quantity("ratio")] = Field(
        default=1.0,
        description="Factor of the signal on the truth; default 100 %. -100 % is a sensor that is reversed.",
        examples=["101 %"],
    )
    delay: Time = Field(
        default=0.0, description="Time until a sample reaches the valves, s; default 0.", examples=["20 ms"]
    )
    low_pass: Time = Field(
        default=0.0,
        description="Time constant of a first-order low-pass filter over the samples, s; default 0: none.",
        examples=["50 ms"],
    )
    position: Position | None = Field(
        default=None,
        description="Where an accelerometer is, from the centre of mass, m.",
        examples=[["0.8 m", 0, 0]],
    )
    axis: Direction | None = Field(
        default=None,
        description="Along which an accelerometer measures, any length but zero; default [0, 0, 1].",
        examples=[[0, 0, 1]],
    )


class LoopFaultsSection(Section):
    """Faults that the loop is flown with and does not know of."""

    reversed: list[Name] = Field(
        default=[], description="Channels that push the other way when they are fired.", examples=[["+M1"]]
    )


class LoopSection(Section):
    """A closed loop, for `nutdamp loop`: it fires from where the sensor shows start down to stop."""

    sensor: LoopSensorSection = Field(
        description="The sensor.", examples=[{"kind": "gyro", "rate": "100 Hz", "noise": "0.01 deg/s"}]
    )
    law: Literal["four-pulse", "one-pulse", "bang"] = Field(
        default="four-pulse",
        description="four-pulse: each channel that comes into line, as long as what is left requires, at most "
        "on_time; one-pulse: the same, at most half a nutation period; bang: each for on_time. Default four-pulse.",
        examples=["four-pulse"],
    )
    start: AcuteAngle = Field(
        description="Nutation angle from which the loop fires, rad; above stop.", examples=["0.5 deg"]
    )
    stop: Threshold = Field(
        default=0.0, description="Nutation angle down to which it fires, rad; default 0.", examples=["0.05 deg"]
    )
    settle: Time = Field(
        default=0.0, description="Time after a firing in which samples are not used, s; default 0.", examples=["0.2 s"]
    )
    min_interval: Time = Field(
        default=0.0, description="Least time from firing to firing, s; default 0.", examples=["0.5 s"]
    )
    predict: bool = Field(
        default=True,
        description="Whether delay, filter and half the on-time are compensated, so that firings are centred on "
        "their moments; default true.",
        examples=[True],
    )
    alias: bool = Field(
        default=False,
        description="Whether fewer than four samples a nutation period are meant; default false.",
        examples=[True],
    )
    on_time: PositiveTime | None = Field(
        default=None,
        description="Pulses of bang, and the longest ones of four-pulse, s; default of four-pulse: an eighth of the "
        "nutation period, within min_on_time and max_on_time.",
        examples=["50 ms"],
    )
    faults: LoopFaultsSection | None = Field(
        default=None, description="Faults to fly with, default none.", examples=[{"reversed": ["+M1"]}]
    )
