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
        "gyro: ω1 and ω2; accelerometer: the acceleration at position along axis.", "gyro"
    )
    rate: Frequency | None = Field("Samples a second, Hz; default: a continuous signal.", "100 Hz")
    quantisation: Least = Field(
        "Step of a sample: rad/s, of an accelerometer m/s²; default 0.", "0.002 deg/s", default=0.0
    )
    noise: Least = Field(
        "One sigma of the noise of a sample: rad/s, of an accelerometer m/s²; default 0.", "0.01 deg/s", default=0.0
    )
    bias: Annotated[float, Reading()] = Field(
        "What a signal shows without motion: rad/s, of an accelerometer m/s²; default 0.", "0.02 deg/s", default=0.0
    )
    scale: Annotated[float, Quantity("ratio")] = Field(
        "Factor of the signal on the truth; default 100 %. -100 % is a sensor that is reversed.", "101 %", default=1.0
    )
    delay: Time = Field("Time until a sample reaches the valves, s; default 0.", "20 ms", default=0.0)
    low_pass: Time = Field(
        "Time constant of a first-order low-pass filter over the samples, s; default 0: none.", "50 ms", default=0.0
    )
    position: Position | None = Field("Where an accelerometer is, from the centre of mass, m.", ["0.8 m", 0, 0])
    axis: Direction | None = Field(
        "Along which an accelerometer measures, any length but zero; default [0, 0, 1].", [0, 0, 1]
    )


class LoopFaultsSection(Section):
    """Faults that the loop is flown with and does not know of."""

    reversed: list[Name] = Field("Channels that push the other way when they are fired.", ["+M1"], default=[])


class LoopSection(Section):
    """A closed loop, for `nutdamp loop`: it fires from where the sensor shows start down to stop."""

    sensor: LoopSensorSection = Field("The sensor.", {"kind": "gyro", "rate": "100 Hz", "noise": "0.01 deg/s"})
    law: Literal["four-pulse", "one-pulse", "bang"] = Field(
        "four-pulse: each channel that comes into line, as long as what is left requires, at most "
        "on_time; one-pulse: the same, at most half a nutation period; bang: each for on_time. Default four-pulse.",
        "four-pulse",
        default="four-pulse",
    )
    start: AcuteAngle = Field("Nutation angle from which the loop fires, rad; above stop.", "0.5 deg")
    stop: Threshold = Field("Nutation angle down to which it fires, rad; default 0.", "0.05 deg", default=0.0)
    settle: Time = Field("Time after a firing in which samples are not used, s; default 0.", "0.2 s", default=0.0)
    min_interval: Time = Field("Least time from firing to firing, s; default 0.", "0.5 s", default=0.0)
    predict: bool = Field(
        "Whether delay, filter and half the on-time are compensated, so that firings are centred on "
        "their moments; default true.",
        True,
        default=True,
    )
    alias: bool = Field(
        "Whether fewer than four samples a nutation period are meant; default false.", True, default=False
    )
    on_time: PositiveTime | None = Field(
        "Pulses of bang, and the longest ones of four-pulse, s; default of four-pulse: an eighth of the "
        "nutation period, within min_on_time and max_on_time.",
        "50 ms",
    )
    faults: LoopFaultsSection | None = Field("Faults to fly with, default none.", {"reversed": ["+M1"]})
