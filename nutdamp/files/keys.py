"""Keys of a spacecraft file, their units and ranges; the source of the JSON Schema.

Constraints between several keys are in `rules`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from nutdamp.files.fields import (
    RIGHT_ANGLE,
    THREE,
    AcuteAngle,
    Direction,
    Field,
    Key,
    KeyPath,
    Length,
    Name,
    Nutation,
    Position,
    PositiveTime,
    Problems,
    Quantity,
    Rule,
    Section,
    Time,
    Within,
)
from nutdamp.spacecraft.tolerances import (
    KINDS,
    READING,
    Dispersions,
    Each,
    SpinTolerance,
    Tolerance,
)
from nutdamp.units import parse, pattern, shown

if TYPE_CHECKING:
    from nutdamp.spacecraft.equipment import Steerable, Thruster

# --- dispersions and the closed loop

RELATIVE = ("inertia", "momentum", "rate", "force", "ratio", "mass", "pressure")
"""The kinds of quantity that may be dispersed by a percentage of the nominal value."""

VALVE_TIMES = ("open_delay", "close_delay", "rise_time", "fall_time")

# name of all thrusters together, where the file gives one tolerance for them; no thruster has such
# a name
ALL = ""


def size_of(value: object, kind: str) -> tuple[float, bool]:
    """The size of a tolerance of ``kind``, SI or a fraction, and True for a fraction; raises
    ValueError.
    """
    if kind in RELATIVE and isinstance(value, str) and value.rstrip().endswith("%"):
        return parse(value, "ratio"), True
    if kind == READING:
        with suppress(ValueError):
            return parse(value, "acceleration"), False
        return parse(value, "rate"), False
    try:
        return parse(value, kind), kind == "ratio"
    except ValueError as wrong:
        hint = ", or in % of the nominal value" if kind in RELATIVE and kind != "ratio" else ""
        raise ValueError(f"{wrong}{hint}") from None


def unit_kinds(kind: str) -> list[str]:
    """The kinds of quantity (keys of `units.KINDS`)
    by which a tolerance of ``kind`` may be given.
    """
    if kind == READING:
        return ["rate", "acceleration"]
    return [kind, "ratio"] if kind in RELATIVE and kind != "ratio" else [kind]


def by_name(value: Mapping[Any, object]) -> bool:
    """True where a mapping holds tolerances by thruster, and is not itself one."""
    return any(isinstance(getattr(entry, "value", entry), dict) for entry in value.values())


LARGEST_SIGMA = 0.5
"""One sigma, as a share of a value or of a right angle: with more one draw in forty turns its
sign.
"""

LARGEST_OFFSET = 1.0
"""Half a width and a fixed offset: with more any turns its sign."""

EXAMPLES = {"rate": "0.1 deg/s", "angle": "0.5 deg", "length": "5 mm", "time": "5 ms"}


class ToleranceSection(Section):
    """Tolerance of a quantity: one of normal (one sigma), uniform, triangular (half width), bias
    (offset).
    """

    written = "a tolerance, such as {normal: 2 %}"
    quantity = ""
    tolerance: Tolerance

    normal: Any = Field(
        "One sigma of a normal distribution, in its unit or in %.", "2 %", default=None
    )
    uniform: Any = Field(
        "Half the width of a uniform distribution, in its unit or in %.", "5 ms", default=None
    )
    triangular: Any = Field(
        "Half the width of a triangular distribution, in its unit or in %.", "5 %", default=None
    )
    bias: Any = Field("Fixed offset, signed, in its unit or in %.", "-2 ms", default=None)

    @classmethod
    def read(cls, value: Any, problems: Problems, path: KeyPath = ()) -> Self | None:
        """The section, with its ``tolerance`` of the ``quantity``; problems as of any section."""
        section = super().read(value, problems, path)
        if section is None:
            return None
        kinds = [key for key in value if key in KINDS]
        if not kinds:
            size = EXAMPLES.get(cls.quantity, "2 %")
            cure = f"give {{normal: {size}}}, or uniform, triangular, bias"
            problems.append((path, f"names no distribution; {cure}"))
        for kind in kinds[1:]:
            problem = f"given together with {kinds[0]}; keep one of the two"
            problems.append(((*path, kind), problem))
        for kind in kinds:
            try:
                if value[kind] is not None:
                    section.tolerance = _tolerance(kind, value[kind], cls.quantity)
            except ValueError as wrong:
                problems.append(((*path, kind), str(wrong)))
        return section


def _tolerance(kind: str, value: object, quantity: str) -> Tolerance:
    """The tolerance of a ``quantity``; raises ValueError with the values allowed."""
    size, relative = size_of(value, quantity)
    what = {"normal": "one sigma", "bias": "an offset"}.get(kind, "half a width")
    if kind != "bias" and size < 0.0:
        cure = f"expected {what} of at least 0, or bias for a fixed offset"
        raise ValueError(f"{shown(value)} is negative; {cure}")
    share = abs(size) if relative else abs(size) / RIGHT_ANGLE if quantity == "angle" else 0.0
    bound = LARGEST_SIGMA if kind == "normal" else LARGEST_OFFSET
    if share > bound or share == LARGEST_OFFSET:
        limit = f"{100 * bound:g} %" if relative else f"{90 * bound:g} deg"
        words = "of at most" if kind == "normal" else "below"
        raise ValueError(f"{shown(value)} is out of range; expected {what} {words} {limit}")
    return Tolerance(kind, size, relative)


class _Tolerance(Rule):
    """Annotation of a tolerance of ``kind``; or of those of ``each`` axis or thruster, one of which
    may be for all.
    """

    def __init__(self, kind: str, each: Each = "") -> None:
        self.kind, self.each = kind, each

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """A single tolerance is for all thrusters."""
        alone = isinstance(value, dict) and self.each == "thruster" and not by_name(value)
        return inner({ALL: value} if alone else value)

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:  # noqa: ARG002
        """One tolerance or several, with their units."""
        texts = [{"type": "string", "pattern": pattern(unit)} for unit in unit_kinds(self.kind)]
        spread: dict[str, Any] = {"anyOf": [{"type": "number", "minimum": 0}, *texts]}
        single = {
            "type": "object",
            "properties": {
                **dict.fromkeys(KINDS, spread),
                "bias": {"anyOf": [{"type": "number"}, *texts]},
            },
            "additionalProperties": False,
            "minProperties": 1,
            "maxProperties": 1,
        }
        if self.each == "axis":
            return {
                "anyOf": [single, {"type": "array", "items": single, "minItems": 3, "maxItems": 3}]
            }
        if self.each == "thruster":
            return {
                "anyOf": [
                    single,
                    {"type": "object", "additionalProperties": single, "minProperties": 1},
                ]
            }
        return single


_TOLERANCES = {each.name: each.metadata for each in fields(Dispersions) if each.metadata}
QUANTITIES = {
    key: declared["kind"] for key, declared in _TOLERANCES.items()
}  # kinds of quantity by key
BY_THRUSTER = tuple(key for key, declared in _TOLERANCES.items() if declared["each"] == "thruster")


Correlation = Annotated[float, Quantity("ratio", exclusiveMinimum=-1, exclusiveMaximum=1)]


class DispersionsSection(Section):
    """Tolerances: {normal: one sigma}, {uniform: half width}, {triangular: half width} or {bias:
    fixed offset}.
    """

    correlation: list[tuple[str, str, Correlation]] = Field(
        "Pairs of inputs that vary together, named as in disperse --json, and their correlation, "
        "-1 to 1. For uniform and triangular inputs it is that of underlying normals (Gaussian "
        "copula).",
        [["A", "C", 0.99]],
        default=[],
    )

    @classmethod
    @cache
    def fields(cls) -> dict[str, Key]:
        """Keys declared by `Dispersions`, and the correlation."""
        keys = {}
        for key, declared in _TOLERANCES.items():
            rule = _Tolerance(declared["kind"], declared["each"])
            section: Any = type("ToleranceSection", (ToleranceSection,), {"quantity": rule.kind})
            written: Any = {
                "axis": Annotated[list[section], Length(3, 3)] | section,
                "thruster": dict[str, section],
            }.get(rule.each, section)
            keys[key] = Key(
                Annotated[written, rule] | None,
                None,
                declared["text"],
                [declared["example"]],
            )
        return keys | super().fields()


def dispersions(
    section: DispersionsSection | None, thrusters: Iterable[Thruster], torquer: Steerable | None
) -> Dispersions | None:
    """The tolerances of a checked file, those of thrusts as fractions; ``torquer``: also an ideal
    one.
    """
    if section is None:
        return None
    from nutdamp.spacecraft.schedule import STEERABLE

    thrusts = {thruster.name: thruster.thrust for thruster in thrusters}
    if torquer is not None:
        thrusts[STEERABLE] = thrust_behind(torquer.torque, torquer.lever_arm)
    entries: dict[str, Any] = {"correlation": tuple(map(tuple, section.correlation))}
    for key in QUANTITIES:
        entry = getattr(section, key)
        if isinstance(entry, ToleranceSection):
            by_axis = _TOLERANCES[key]["each"] == "axis"
            entries[key] = (entry.tolerance,) * 3 if by_axis else entry.tolerance
        elif isinstance(entry, list | tuple):  # by axis
            entries[key] = tuple(None if part is None else part.tolerance for part in entry)
        elif entry is not None:  # by thruster
            named = {name: part.tolerance for name, part in entry.items()}
            entries[key] = dict.fromkeys(thrusts, named[ALL]) if ALL in named else named
    for name, tolerance in entries.get("thrust", {}).items():
        thrust = thrusts[name]
        if not tolerance.relative and thrust is not None:
            entries["thrust"][name] = Tolerance(
                tolerance.kind, tolerance.size / thrust, relative=True
            )
    return Dispersions(**entries)


def thrust_behind(torque: float | None, lever_arm: float | None) -> float | None:
    """Thrust in N behind a torque (N m) on a lever arm (m); None where one of them is not known."""
    return None if torque is None or lever_arm is None else torque / lever_arm


class Reading(Quantity):
    """Annotation of a quantity in the unit of the sensor: an angular rate of a gyro, else an
    acceleration.
    """

    def __init__(self, **bounds: float) -> None:
        super().__init__("rate", **bounds)

    def read(self, value: Any, inner: Callable[[Any], Any]) -> float:  # noqa: ARG002
        """SI value; raises ValueError with the values allowed."""
        result, _ = size_of(value, READING)
        if not self._allows(result):
            raise ValueError(
                f"{shown(value)} is out of range; expected at least {self.bounds['minimum']:g}"
            )
        return result

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:  # noqa: ARG002
        """A number, or a text with a unit of either."""
        texts = [{"type": "string", "pattern": pattern(kind)} for kind in ("rate", "acceleration")]
        return {"anyOf": [{"type": "number", **self.bounds}, *texts]}


Frequency = Annotated[float, Quantity("frequency", exclusiveMinimum=0)]
Least = Annotated[float, Reading(minimum=0)]


class LoopSensorSection(Section):
    """Sensor of the loop: two rate gyros about axes 1 and 2, or an accelerometer."""

    kind: Literal["gyro", "accelerometer"] = Field(
        "gyro: shows ω1 and ω2. accelerometer: shows the acceleration at position along axis.",
        "gyro",
    )
    axes: Literal["file", "principal"] = Field(
        "Axes about which gyros measure. file (default): those of the file, where a tilted "
        "principal axis shows as a rate. principal: those of gyros calibrated to the principal "
        "axes.",
        "principal",
        default="file",
    )
    rate: Frequency | None = Field("Samples a second, Hz. Default: a continuous signal.", "100 Hz")
    quantisation: Least = Field(
        "Step of a sample, rad/s; of an accelerometer m/s². Default 0.", "0.002 deg/s", default=0.0
    )
    noise: Least = Field(
        "One sigma of the noise of a sample, rad/s; of an accelerometer m/s². Default 0.",
        "0.01 deg/s",
        default=0.0,
    )
    bias: Annotated[float, Reading()] = Field(
        "What a signal shows without motion, rad/s; of an accelerometer m/s². Default 0.",
        "0.02 deg/s",
        default=0.0,
    )
    scale: Annotated[float, Quantity("ratio")] = Field(
        "Signal divided by truth; default 100 %. A reversed sensor has -100 %.",
        "101 %",
        default=1.0,
    )
    delay: Time = Field(
        "Time until a sample reaches the valves, s; default 0.", "20 ms", default=0.0
    )
    low_pass: Time = Field(
        "Time constant of a first-order low-pass filter over the samples, s; default 0: none.",
        "50 ms",
        default=0.0,
    )
    position: Position | None = Field(
        "Place of an accelerometer, m, from the center of mass or as center_of_mass says.",
        ["0.8 m", 0, 0],
    )
    axis: Direction | None = Field(
        ("Direction in which an accelerometer measures, any length but zero; default [0, 0, 1]."),
        [0, 0, 1],
    )


class LoopFaultsSection(Section):
    """Faults that the loop is flown with, and that it does not know."""

    reversed: list[Name] = Field(
        "Channels that push the other way when fired.", ["+M1"], default=[]
    )


class LoopSection(Section):
    """A closed loop, for `nutdamp loop`: it fires when the sensor shows start, until it shows
    stop.
    """

    sensor: LoopSensorSection = Field(
        "The sensor.", {"kind": "gyro", "rate": "100 Hz", "noise": "0.01 deg/s"}
    )
    law: Literal["four-pulse", "one-pulse", "bang"] = Field(
        "four-pulse (default): each channel that comes into line fires as long as needed, at most "
        "on_time. one-pulse: the same, at most half a nutation period. bang: each fires for "
        "on_time.",
        "four-pulse",
        default="four-pulse",
    )
    start: AcuteAngle = Field(
        "Nutation angle at which the loop begins to fire, rad; above stop.", "0.5 deg"
    )
    stop: Nutation = Field(
        "Nutation angle at which it stops, rad; default 0.", "0.05 deg", default=0.0
    )
    settle: Time = Field(
        "Time after a firing in which samples are ignored, s; default 0.", "0.2 s", default=0.0
    )
    min_interval: Time = Field(
        "Least time from one firing to the next, s; default 0.", "0.5 s", default=0.0
    )
    predict: bool = Field(
        "true (default): firings are centred on their moments, with delay, filter and half the "
        "on-time compensated.",
        True,
        default=True,
    )
    alias: bool = Field(
        "true: fewer than four samples in a nutation period are intended; default false.",
        True,
        default=False,
    )
    on_time: PositiveTime | None = Field(
        "On-time of bang, and longest on-time of four-pulse, s. Default of four-pulse: an eighth "
        "of the nutation period, within min_on_time and max_on_time.",
        "50 ms",
    )
    faults: LoopFaultsSection | None = Field(
        "Faults to fly with, default none.", {"reversed": ["+M1"]}
    )


# --- the spacecraft, its motion, actuators, limits and goal


class _AxialShorthand(Rule):
    """Annotation of a torque vector that may be written as a single torque,
    its part about axis 3.
    """

    single = Quantity("torque")

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        return (
            inner(value) if isinstance(value, list) else [0.0, 0.0, self.single.read(value, inner)]
        )

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        return {"anyOf": [inner(), *self.single.schema(inner)["anyOf"]]}


class _ListOf(Rule):
    """Annotation of a list of lists, each ``written`` so; the error for a single list shows how to
    nest it.
    """

    def __init__(self, written: str) -> None:
        self.written = written

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        if isinstance(value, list) and value and not isinstance(value[0], list):
            text = ", ".join(str(entry) for entry in value)
            raise ValueError(f"expected a list of {self.written}, such as [[{text}]], got [{text}]")
        return inner(value)


class _OrWord(Rule):
    """Annotation of a direction, two angles in a list,
    that may be written as one ``word`` instead.
    """

    def __init__(self, word: str) -> None:
        self.word = word

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        if value == self.word:
            return value
        if not isinstance(value, list):
            raise ValueError(
                f"expected {self.word} or [right ascension, declination], got {shown(value)}"
            )
        return inner(value)

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        return {"anyOf": [inner(), {"const": self.word}]}


class _ShareOrRate(Rule):
    """Annotation of a tolerance of a rate: a share of its goal, in %, or a rate."""

    share, rate = Quantity("ratio", exclusiveMinimum=0), Quantity("rate", exclusiveMinimum=0)

    def read(self, value: Any, inner: Callable[[Any], Any]) -> SpinTolerance:
        relative = isinstance(value, str) and value.rstrip().endswith("%")
        return SpinTolerance((self.share if relative else self.rate).read(value, inner), relative)

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        number, rate = self.rate.schema(inner)["anyOf"]
        return {"anyOf": [number, rate, self.share.schema(inner)["anyOf"][1]]}


class _DateAndTime(Rule):
    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        text = inner(value)
        if text is not None:
            if not re.fullmatch(_EPOCH, text):
                raise ValueError(
                    f"{shown(text)} is no epoch; expected ISO 8601: 2026-03-01T12:00:00Z"
                )
            from nutdamp.common.time import Epoch  # an epoch

            # raises for a day that is none, and for one without UTC or beyond four digits
            Epoch.parse(text)
        return text

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        return {**inner(), "pattern": f"^{_EPOCH}$"}


_EPOCH = (
    r"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}(:[0-9]{2}(\.[0-9]+)?)?(Z|[+-][0-9]{2}:[0-9]{2})?"
)

Mass = Annotated[float, Quantity("mass", exclusiveMinimum=0)]
Moment = Annotated[float, Quantity("inertia", exclusiveMinimum=0)]
Rate = Annotated[float, Quantity("rate")]
Angle = Annotated[float, Quantity("angle")]
Tilt = Annotated[float, Quantity("angle", minimum=0, exclusiveMaximum=2 * RIGHT_ANGLE)]
Declination = Annotated[float, Quantity("angle", minimum=-RIGHT_ANGLE, maximum=RIGHT_ANGLE)]
Force = Annotated[float, Quantity("force", exclusiveMinimum=0)]
Lever = Annotated[float, Quantity("length", exclusiveMinimum=0)]
Torque = Annotated[float, Quantity("torque", exclusiveMinimum=0)]
SpinError = Annotated[SpinTolerance, _ShareOrRate()]
Probability = Annotated[float, Quantity("ratio", exclusiveMinimum=0, exclusiveMaximum=1)]
Rates = Annotated[list[Rate], THREE]
Travel = Annotated[list[Annotated[float, Quantity("travel")]], THREE]
Velocity = Annotated[list[Annotated[float, Quantity("speed")]], THREE]
Torques = Annotated[list[Annotated[float, Quantity("torque")]], THREE]
DisturbingTorques = Annotated[Torques, _AxialShorthand()]
Tensor = Annotated[list[Annotated[list[Annotated[float, Quantity("inertia")]], THREE]], THREE]
Quaternion = Annotated[list[Annotated[float, Quantity("number")]], Length(4, 4)]
RightAscension = Annotated[float, Quantity("right ascension")]
InTheSky = tuple[RightAscension, Declination]
Apart = Annotated[float, Quantity("angle", minimum=0, maximum=2 * RIGHT_ANGLE)]
Window = Annotated[list[Time], Length(2, 2)]
DateAndTime = Annotated[str, _DateAndTime()]
Count = Annotated[int, Within(1, 1_000_000)]


class OrbitSection(Section):
    """Position and velocity at attitude.epoch, in attitude.frame. They are for messages to flight
    dynamics.
    """

    position: Position = Field("Position from the center, m.", ["7000 km", 0, 0])
    velocity: Velocity = Field("Velocity, m/s.", [0, "7.5 km/s", 0])
    center: Name = Field("Body at the origin; default EARTH.", "EARTH", default="EARTH")


class WheelSection(Section):
    """A part that spins relative to the body: a momentum wheel, or a despun platform."""

    momentum: Annotated[float, Quantity("momentum")] = Field(
        "Its constant angular momentum along principal axis 3, signed, N m s. It adds to the C ω3 "
        "of the rest.",
        "40 N m s",
    )


class SunSensorSection(Section):
    """A sensor that gives a pulse once a spin, when it sees the Sun."""

    azimuth: Angle = Field(
        "Azimuth in the body at which the Sun pulse comes, rad, about axis 3 from axis 1.", "35 deg"
    )
    elevation: Declination = Field(
        "Middle of its view, rad, from the plane square to axis 3 towards the spin axis; default "
        "0.",
        "45 deg",
        default=0.0,
    )
    half_width: Apart = Field(
        "Largest angle from there at which it sees the Sun, rad. Default: 90 deg, which is always.",
        "45 deg",
        default=RIGHT_ANGLE,
    )
    jitter: Time = Field(
        "One sigma of the times of its pulses, s; default 0.", "0.5 ms", default=0.0
    )


class WidthSection(Section):
    """Widths of pulses that can be commanded: min, min + step, … up to max."""

    step: PositiveTime = Field("Resolution of the width, s.", "1 ms")
    min: PositiveTime = Field("Shortest width, s.", "20 ms")
    max: PositiveTime = Field("Longest width, s.", "500 ms")


Widths = Annotated[list[PositiveTime], Length(1)] | WidthSection


class CommandsSection(Section):
    """Contents of a command block: a number of pulses of one channel, fired by the Sun pulse."""

    delay_step: PositiveTime = Field("Resolution of the delay after the Sun pulse, s.", "2 ms")
    delay_max: PositiveTime = Field(
        "Longest delay, s. At most one spin turn of it is used.", "1.9 s"
    )
    width: Widths = Field(
        "Widths that can be commanded, s: a list, or step, min and max.",
        {"step": "1 ms", "min": "20 ms", "max": "500 ms"},
        ["0.1 s", "0.2 s"],
    )
    max_count: Count = Field("Largest number of pulses of a block; default 255.", 255, default=255)
    every: Annotated[list[Count], Length(1)] = Field(
        "Choices of the number of spins from one pulse to the next; default [1].",
        [1, 2],
        default=[1],
    )
    per_turn: Annotated[int, Within(1, 2)] = Field(
        "Number of blocks that may fire in the same turns, without overlap; default 1. With 2, "
        "prefer delay_is: angle, which keeps opposite pulses apart while the spin changes.",
        2,
        default=1,
    )
    delay_is: Literal["time", "angle"] = Field(
        "How a delay counts. time (default): seconds after the Sun pulse. angle: turn of the Sun "
        "since its pulse.",
        "angle",
        default="time",
    )


class KeepSection(Section):
    """A cone about a direction in space. The spin axis must not enter it (min), or must not leave
    it (max). Nutation counts.
    """

    name: Name = Field("Name of the cone, for reports.", "Earth")
    direction: Annotated[InTheSky, _OrWord("sun")] = Field(
        "Right ascension and declination in the frame of attitude, rad. Or sun.",
        "sun",
        ["120 deg", "10 deg"],
    )
    min: Apart | None = Field("Smallest angle to the spin axis, rad; default 0.", "4 deg")
    max: Apart | None = Field("Largest angle to the spin axis, rad; default 180 deg.", "20 deg")


Pressure = Annotated[float, Quantity("pressure", exclusiveMinimum=0)]
Impulse = Annotated[float, Quantity("impulse", exclusiveMinimum=0)]

Shed = Annotated[float, Quantity("shed", minimum=0)]

ImpulseBits = Annotated[list[tuple[PositiveTime, Impulse, PositiveTime]], Length(2)]
"""Rows of on-time, impulse and centroid."""


class ValveSection(Section):
    """A valve: thrust begins after the command, then rises and falls evenly."""

    open_delay: Time = Field(
        "From the start of the command to the first thrust, s; default 0.", "8 ms", default=0.0
    )
    close_delay: Time = Field(
        "From the end of the command until the thrust begins to fall, s; default 0.",
        "12 ms",
        default=0.0,
    )
    rise_time: Time = Field(
        "From the first thrust to full thrust, s; default 0.", "5 ms", default=0.0
    )
    fall_time: Time = Field("From full thrust to none, s; default 0.", "10 ms", default=0.0)
    on_time_is: Literal["command", "effective"] = Field(
        "Meaning of a commanded on-time. command (default): the length of the command. effective: "
        "impulse over full thrust, which the valve electronics turns into a command.",
        "command",
        default="command",
    )


class ShedSection(Section):
    """Share of the propellant in the tank in the moments of inertia."""

    A: Shed = Field(
        "Decrease of the transverse moment for each kg used, kg m²/kg.", "0.4 kg m^2/kg"
    )
    C: Shed = Field(
        "Decrease of the moment about axis 3 for each kg used, kg m²/kg.", "0.6 kg m^2/kg"
    )


class TankSection(Section):
    """A blowdown tank: pressure and thrust fall as propellant is used and the gas expands."""

    propellant: Mass = Field("Propellant in it at t = 0, kg.", "30 kg")
    pressure: Pressure = Field("Pressure at t = 0, Pa.", "22 bar")
    final_pressure: Pressure = Field("Pressure when the propellant is used up, Pa.", "8 bar")
    exponent: Annotated[float, Quantity("number", minimum=0)] = Field(
        "Exponent n of thrust ~ pressure^n; default 1.", 1, default=1.0
    )
    isp: Annotated[list[tuple[Pressure, PositiveTime]], Length(2)] | None = Field(
        "Rows of pressure, Pa, rising, and specific impulse, s, in place of that of the thrusters."
        " Values between rows are interpolated. Below the first row its value holds.",
        [["8 bar", "215 s"], ["22 bar", "228 s"]],
    )
    inertia_per_kg: Annotated[list[Shed], Length(3, 3)] | ShedSection | None = Field(
        "Decrease of the moments of inertia for each kg used, kg m²/kg. Give A and C, or the three"
        " principal moments, the one about axis 3 last. Default: they stay.",
        {"A": "0.4 kg m^2/kg", "C": "0.6 kg m^2/kg"},
    )


class ColdSection(Section):
    """Cold nozzles: the first pulses of each channel are weaker."""

    first: Annotated[float, Quantity("ratio", exclusiveMinimum=0)] = Field(
        "Thrust of the first pulse of a channel, as a share of that of a warm one.", "90 %"
    )
    pulses: Annotated[float, Quantity("number", exclusiveMinimum=0)] = Field(
        "Number of pulses in which the difference from a warm one falls by the factor e.", 4
    )


def _needs(*keys: str, without: tuple[str, ...]) -> dict[str, Any]:
    """JSON Schema for: all of ``keys`` and none of ``without``."""
    return {"required": list(keys), "not": {"anyOf": [{"required": [key]} for key in without]}}


class InertiaSection(Section):
    """Moments of inertia about the centre of mass: A and C, or the whole tensor."""

    schema_extra: ClassVar = {
        "oneOf": [_needs("A", "C", without=("tensor",)), _needs("tensor", without=("A", "C"))]
    }

    A: Moment | None = Field("Transverse moment of inertia, kg m².", "120 kg m^2")
    C: Moment | None = Field(
        "Moment of inertia about the spin axis 3, kg m²; at most 2 A.", "80 kg m^2"
    )
    tensor: Tensor | None = Field(
        "Inertia tensor, 3 rows of 3, kg m². Entries off the diagonal are minus the products of "
        "inertia: row 1, column 2 is -IXY, with IXY the sum of m x y as in CCSDS messages. Axis 3 "
        "is the principal axis nearest the file's third axis.",
        [[120, 0.5, 0], [0.5, 118, 0], [0, 0, 80]],
    )


class StateSection(Section):
    """The motion at t = 0 by spin and nutation angle."""

    spin: Rate = Field("Spin rate about axis 3, signed, rad/s. Zero only with a wheel.", "30 rpm")
    nutation: Nutation = Field(
        ("Nutation angle between H and spin axis at t = 0, rad, from 0 to below 90 deg."),
        "5 deg",
    )
    phase: Angle = Field(
        "Direction of the transverse rate, arg(ω1 + i ω2), rad; default 0.", "20 deg", default=0.0
    )


class AttitudeSection(Section):
    """Attitude at t = 0. Without it results refer to the frame with z along H."""

    schema_extra: ClassVar = {
        "oneOf": [
            _needs("quaternion", without=("spin_axis", "phase", "sun_phase", "of")),
            _needs("spin_axis", without=("quaternion",)),
        ]
    }

    quaternion: Quaternion | None = Field(
        "Rotation from body to frame, scalar first. It is normalised when read.", [1, 0, 0, 0]
    )
    spin_axis: InTheSky | None = Field(
        "Right ascension and declination of the spin axis, rad, in place of quaternion. See phase.",
        ["120 deg", "-15 deg"],
    )
    phase: Angle | None = Field(
        "Angle about spin_axis from its ascending node to body axis 1, rad; default 0. The "
        "ascending node is z of the frame × spin axis; at a pole it is x of the frame.",
        "20 deg",
    )
    sun_phase: Angle | None = Field(
        "Angle about spin_axis from the side of the Sun to body axis 1, rad, in place of phase. It"
        " needs sun.",
        "35 deg",
    )
    of: Literal["axis", "momentum"] | None = Field(
        "The vector whose direction spin_axis and phase give: the spin axis itself (default), or "
        "the angular momentum.",
        "momentum",
    )
    epoch: DateAndTime | None = Field(
        "Date and time of t = 0, ISO 8601, from 1972 to 9999. Without a zone it is UTC.",
        "2026-03-01T12:00:00Z",
    )
    frame: Literal["EME2000", "J2000", "GCRF", "ECLIPJ2000", "ECLIPDATE", "MOD"] | None = Field(
        "Inertial frame of the attitude and of all directions of the file. In a frame of the "
        "ecliptic, right ascension and declination are longitude and latitude.",
        "EME2000",
    )


class ThrusterSection(Section):
    """A thruster: position, direction and force, or only its torque."""

    schema_extra: ClassVar = {
        "oneOf": [
            _needs("position", "direction", "force", without=("torque", "lever_arm")),
            _needs("torque", without=("position", "direction", "force")),
        ]
    }

    name: Name = Field("Name of the thruster, for channels and schedules.", "T1")
    position: Position | None = Field(
        "Point where the force acts, m, from the center of mass or as center_of_mass says.",
        [0, "0.5 m", "0.8 m"],
    )
    direction: Direction | None = Field(
        "Direction of the force on the spacecraft, against the plume. Any length but zero.",
        [1, 0, 0],
    )
    force: Force | None = Field("Thrust, N.", "10 N")
    torque: Torques | None = Field(
        "Torque about the centre of mass, N m, in place of position, direction and force.",
        [0, "-8 N m", 0],
    )
    lever_arm: Lever | None = Field(
        "Lever arm, m. With a torque it gives the thrust, for the propellant.", "0.8 m"
    )
    isp: PositiveTime | None = Field("Specific impulse, s, for the propellant.", "220 s")
    min_on_time: Time = Field("Shortest firing, s; default 0.", "20 ms", default=0.0)
    max_on_time: PositiveTime | None = Field("Longest firing, s. Default: no limit.", "2 s")
    valve: ValveSection | None = Field(
        "How the thrust follows a command. Default: as the valve of the file, or full thrust at "
        "once.",
        {"open_delay": "8 ms", "close_delay": "12 ms"},
    )
    impulse_bit: ImpulseBits | None = Field(
        "Table from tests, in place of valve. Each row has on-time, s, impulse, N s, and the time "
        "of its centroid after the start of the command, s.",
        [["20 ms", "0.15 N s", "16 ms"], ["100 ms", "0.95 N s", "58 ms"]],
    )


class SteerableSection(Section):
    """A torquer for any transverse axis. It is fixed in the body during a pulse."""

    torque: Torque | None = Field(
        "Torque, N m. Without it its impulses are ideal and take no time.", "20 N m"
    )
    isp: PositiveTime | None = Field("Specific impulse, s, for the propellant.", "220 s")
    lever_arm: Lever | None = Field("Lever arm, m, for the propellant.", "1 m")


class RequirementSection(Section):
    """Requirement on the end of a plan."""

    nutation: AcuteAngle | None = Field(
        "Largest nutation angle, rad, above 0 and below 90 deg.", "0.5 deg"
    )
    momentum_shift: AcuteAngle | None = Field(
        "Largest turn of H from t = 0, rad, above 0 and below 90 deg. With a target give pointing.",
        "0.2 deg",
    )
    pointing: AcuteAngle | None = Field(
        "Largest angle of H from the target of goal, rad, above 0 and below 90 deg.",
        "0.2 deg",
    )
    nutation_during: AcuteAngle | None = Field(
        "Largest nutation angle on the way, rad, above 0 and below 90 deg. It is a cone of the "
        "spin axis about H. For other cones see keep.",
        "2 deg",
    )
    spin: SpinError | None = Field(
        "Tolerance of the spin at the end about goal.spin or --spin, rad/s or % of it; default 1 "
        "%.",
        "0.5 %",
    )
    probability: Probability | None = Field(
        "Share of dispersed flights that must meet it, above 0 and below 1 (or in %).", "99.7 %"
    )


class GoalSection(Section):
    """End of the motion. Without it H stays where it is, and the spin may change."""

    tilt: Tilt | None = Field(
        "Angle of the target axis from H at t = 0, rad, below 180 deg.", "10 deg"
    )
    azimuth: Angle | None = Field(
        "Azimuth of the target axis about H, rad, from the initial tilt direction of the spin "
        "axis.",
        "45 deg",
    )
    right_ascension: RightAscension | None = Field(
        "Right ascension of the target axis in the frame of attitude, rad.", "83.6 deg"
    )
    declination: Declination | None = Field(
        "Declination of the target axis in the frame of attitude, rad.", "22 deg"
    )
    sun_angle: Apart | None = Field(
        "Angle of the target axis from the Sun, rad, 0 to 180 deg. The target is the nearest such "
        "axis on the great circle through the Sun and H at t = 0.",
        "109 deg",
    )
    spin: Rate | None = Field("Spin rate about axis 3 at the end, rad/s, signed.", "31 rpm")


class LimitsSection(Section):
    """Limits of every schedule."""

    horizon: PositiveTime | None = Field(
        "End of the planning time, s. Default: 20 nutation periods.", "120 s"
    )
    earliest: Time = Field("Earliest start of a pulse, s; default 0.", "5 s", default=0.0)
    gap: Time = Field("Least time between two pulses, s; default 0.", "0.5 s", default=0.0)
    tick: PositiveTime | None = Field(
        "Resolution of commanded starts and on-times, s. Default: none.", "1 ms"
    )
    max_pulses: Count | None = Field("Largest number of pulses. Default: no limit.", 8)
    blackout: Annotated[list[Window], _ListOf("[begin, end]")] = Field(
        "Windows [begin, end], s, in which no pulse may be on.", [["10 s", "20 s"]], default=[]
    )


_TURNING = [{"required": ["rate"]}, {"required": ["fixed_in"]}]
_KINDS: list[Any] = [
    {
        "properties": {"kind": {"const": "constant"}, "torque": {"type": "array"}},
        "not": {"anyOf": _TURNING},
    },
    {"properties": {"kind": {"const": "rotating"}, "torque": {"type": "array"}}, "oneOf": _TURNING},
    {"properties": {"kind": {"const": "axial"}}, "required": ["kind"], "not": {"anyOf": _TURNING}},
]
"""JSON Schema for the kinds of a disturbance, the first two also without the key."""


class DisturbanceSection(Section):
    """A disturbance torque, in the axes of the file."""

    schema_extra: ClassVar = {"oneOf": _KINDS}

    name: Name | None = Field("Name of the disturbance, for reports.", "leak")
    kind: Literal["constant", "rotating", "axial"] | None = Field(
        "constant: fixed in the body. rotating: turns about principal axis 3. axial: along the "
        "third axis of the file. Default: rotating if rate or fixed_in is given, else constant.",
        "rotating",
    )
    torque: DisturbingTorques = Field(
        "Torque [M1, M2, M3] about the centre of mass, N m. A rotating one: its value at t = 0, "
        "with M3 = 0. An axial one: a single number.",
        ["20 mN m", 0, 0],
    )
    rate: Rate | None = Field(
        ("Rate at which a rotating torque turns about axis 3, as seen in the body, signed, rad/s."),
        "-3 rad/s",
    )
    fixed_in: Literal["inertial"] | None = Field(
        ("inertial: a rotating torque that is nearly fixed in space. Its rate is minus the spin."),
        "inertial",
    )
    from_: Time | None = Field("Time after t = 0 at which it begins, s; default 0.", "10 s")
    until: PositiveTime | None = Field(
        "Time after t = 0 at which it ends, s. Default: it does not end.", "45 s"
    )


class DissipationSection(Section):
    """Energy dissipation within the body, by flexible parts or liquids."""

    time_constant: PositiveTime = Field(
        "Time, s, in which the nutation angle grows or decays by the factor e.", "600 s"
    )
    nutation: Literal["grows", "decays"] | None = Field(
        "What the nutation does. Default by shape: it grows if A > C, and decays if A < C.", "grows"
    )


class SpacecraftFile(Section):
    """A spinning spacecraft: its inertia, its motion at t = 0, and what it can fire. Bare numbers
    are SI.
    """

    schema_extra: ClassVar = {
        "oneOf": [_needs("omega0", without=("state",)), _needs("state", without=("omega0",))]
    }

    name: Name = Field("Name of the spacecraft.", "Sounder-1")
    mass: Mass | None = Field("Mass, kg. Without it no velocity change is computed.", "250 kg")
    inertia: InertiaSection = Field(
        "Moments of inertia: A and C, or tensor, kg m².", {"A": "120 kg m^2", "C": "80 kg m^2"}
    )
    center_of_mass: Position | None = Field(
        "Center of mass, m, in the frame of the positions of thrusters and sensor. Default: "
        "positions count from it.",
        [0, "2 mm", "0.4 m"],
    )
    center_of_mass_per_kg: Travel | None = Field(
        "Move of the center of mass for each kg of propellant used, m/kg. Default: it stays.",
        [0, 0, "-1 mm/kg"],
    )
    wheel: WheelSection | None = Field(
        "A momentum wheel or a despun platform.", {"momentum": "40 N m s"}
    )
    omega0: Rates | None = Field(
        "Body rates [ω1, ω2, ω3] at t = 0, rad/s. Or give state.", [0.12, "2 deg/s", "30 rpm"]
    )
    state: StateSection | None = Field(
        "Motion at t = 0 by spin and nutation. Or give omega0.",
        {"spin": "30 rpm", "nutation": "5 deg"},
    )
    attitude: AttitudeSection | None = Field(
        "Attitude at t = 0.",
        {"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"},
    )
    object_id: Name | None = Field(
        "International designator, such as 1998-001A, for messages to flight dynamics.", "1998-001A"
    )
    orbit: OrbitSection | None = Field(
        "Position and velocity at t = 0, for messages to flight dynamics.",
        {"position": ["7000 km", 0, 0], "velocity": [0, "7.5 km/s", 0]},
    )
    thrusters: list[ThrusterSection] = Field(
        "Body-fixed thrusters.",
        [{"name": "T2", "torque": [0, "-8 N m", 0], "isp": "220 s", "lever_arm": "0.8 m"}],
        default=[],
    )
    channels: Annotated[dict[Name, Annotated[list[Name], Length(1)]], Length(1)] | None = Field(
        "Names of thrusters that fire together. Without it each thruster is a channel of its own.",
        {"+M1": ["T1", "T2"]},
    )
    steerable: SteerableSection | None = Field(
        "A torquer that can push about any transverse axis.", {"torque": "20 N m"}
    )
    valve: ValveSection | None = Field(
        "How thrust follows a command, for all thrusters that have no valve of their own.",
        {"open_delay": "8 ms", "close_delay": "12 ms", "rise_time": "5 ms", "fall_time": "10 ms"},
    )
    cold: ColdSection | None = Field(
        "Cold nozzles: the first pulses of each channel are weaker.",
        {"first": "90 %", "pulses": 4},
    )
    tank: TankSection | None = Field(
        "A blowdown tank: the thrust depends on its pressure.",
        {"propellant": "30 kg", "pressure": "22 bar", "final_pressure": "8 bar"},
    )
    disturbances: list[DisturbanceSection] = Field(
        "Disturbance torques.", [{"name": "leak", "torque": ["20 mN m", 0, 0]}], default=[]
    )
    dissipation: DissipationSection | None = Field(
        "Energy dissipation. Without it the body is rigid.",
        {"time_constant": "600 s", "nutation": "grows"},
    )
    requirement: RequirementSection | None = Field(
        "What a plan must reach.", {"nutation": "0.5 deg"}
    )
    limits: LimitsSection | None = Field("Limits that each schedule keeps.", {"horizon": "120 s"})
    goal: GoalSection | None = Field(
        "Where spin axis and spin must end.", {"tilt": "10 deg", "azimuth": "45 deg"}
    )
    sun: Annotated[InTheSky, _OrWord("epoch")] | None = Field(
        "Right ascension and declination of the Sun in the frame of attitude, rad. With epoch "
        "nutdamp computes them.",
        "epoch",
        ["120 deg", "10 deg"],
    )
    keep: list[KeepSection] = Field(
        "Cones that the spin axis must keep on its way to a target.",
        [{"name": "Sun", "direction": "sun", "min": "4 deg", "max": "20 deg"}],
        default=[],
    )
    sun_sensor: SunSensorSection | None = Field(
        "The sensor whose pulse fires command blocks.", {"azimuth": "35 deg"}
    )
    commands: CommandsSection | None = Field(
        "Command blocks: pulses that the Sun pulse fires.",
        {
            "delay_step": "2 ms",
            "delay_max": "1.9 s",
            "width": {"step": "1 ms", "min": "20 ms", "max": "500 ms"},
        },
    )
    loop: LoopSection | None = Field(
        "A closed loop that damps by what a sensor shows.",
        {"sensor": {"kind": "gyro", "rate": "100 Hz"}, "start": "0.5 deg", "stop": "0.05 deg"},
    )
    dispersions: DispersionsSection | None = Field(
        "How much the real spacecraft may differ from the values of the file.",
        {"A": {"normal": "2 %"}},
    )
