"""Keys of a spacecraft file for studies: dispersions and the closed loop, with their units and
ranges.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from nutdamp.files.fields import (
    RIGHT_ANGLE,
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
)
from nutdamp.spacecraft.tolerances import KINDS, READING, Dispersions, Each, Tolerance
from nutdamp.units import parse, pattern, shown

if TYPE_CHECKING:
    from nutdamp.spacecraft.equipment import Steerable, Thruster

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


@cache
def tolerance_section(quantity: str) -> type[ToleranceSection]:
    """The section of the tolerances of a ``quantity``."""
    return type("ToleranceSection", (ToleranceSection,), {"quantity": quantity})


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


def _written(section: type[ToleranceSection], each: Each) -> Any:
    """The type of a tolerance, or of those of each axis or thruster."""
    if each == "axis":
        return Annotated[list[section], Length(3, 3)] | section  # type: ignore[valid-type]
    return dict[str, section] if each == "thruster" else section  # type: ignore[valid-type]


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
        "-1 to 1;"
        " of uniform and triangular ones that of the normals behind them (Gaussian copula).",
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
            written = _written(tolerance_section(rule.kind), rule.each)
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
        "gyro: ω1 and ω2; accelerometer: the acceleration at position along axis.", "gyro"
    )
    axes: Literal["file", "principal"] = Field(
        "Axes about which gyros measure: those of the file, in which a tilted axis 3 shows as a "
        "rate, or the principal "
        "ones, of gyros that are calibrated so. Default file.",
        "principal",
        default="file",
    )
    rate: Frequency | None = Field("Samples a second, Hz; default: a continuous signal.", "100 Hz")
    quantisation: Least = Field(
        "Step of a sample: rad/s, of an accelerometer m/s²; default 0.", "0.002 deg/s", default=0.0
    )
    noise: Least = Field(
        "One sigma of the noise of a sample: rad/s, of an accelerometer m/s²; default 0.",
        "0.01 deg/s",
        default=0.0,
    )
    bias: Annotated[float, Reading()] = Field(
        "What a signal shows without motion: rad/s, of an accelerometer m/s²; default 0.",
        "0.02 deg/s",
        default=0.0,
    )
    scale: Annotated[float, Quantity("ratio")] = Field(
        "Factor of the signal on the truth; default 100 %. -100 % is a sensor that is reversed.",
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
        "Where an accelerometer is, from the center of mass, or as center_of_mass is given, m.",
        ["0.8 m", 0, 0],
    )
    axis: Direction | None = Field(
        "Along which an accelerometer measures, any length but zero; default [0, 0, 1].", [0, 0, 1]
    )


class LoopFaultsSection(Section):
    """Faults that the loop is flown with and does not know of."""

    reversed: list[Name] = Field(
        "Channels that push the other way when they are fired.", ["+M1"], default=[]
    )


class LoopSection(Section):
    """A closed loop, for `nutdamp loop`:
    it fires from where the sensor shows start down to stop.
    """

    sensor: LoopSensorSection = Field(
        "The sensor.", {"kind": "gyro", "rate": "100 Hz", "noise": "0.01 deg/s"}
    )
    law: Literal["four-pulse", "one-pulse", "bang"] = Field(
        "four-pulse: each channel that comes into line, as long as what is left requires, at most "
        "on_time; one-pulse: the same, at most half a nutation period; bang: each for on_time. "
        "Default four-pulse.",
        "four-pulse",
        default="four-pulse",
    )
    start: AcuteAngle = Field(
        "Nutation angle from which the loop fires, rad; above stop.", "0.5 deg"
    )
    stop: Nutation = Field(
        "Nutation angle down to which it fires, rad; default 0.", "0.05 deg", default=0.0
    )
    settle: Time = Field(
        "Time after a firing in which samples are not used, s; default 0.", "0.2 s", default=0.0
    )
    min_interval: Time = Field(
        "Least time from firing to firing, s; default 0.", "0.5 s", default=0.0
    )
    predict: bool = Field(
        "Whether delay, filter and half the on-time are compensated, "
        "so that firings are centred on "
        "their moments; default true.",
        True,
        default=True,
    )
    alias: bool = Field(
        "Whether fewer than four samples a nutation period are meant; default false.",
        True,
        default=False,
    )
    on_time: PositiveTime | None = Field(
        "Pulses of bang, and the longest ones of four-pulse, s; default of four-pulse: "
        "an eighth of the "
        "nutation period, within min_on_time and max_on_time.",
        "50 ms",
    )
    faults: LoopFaultsSection | None = Field(
        "Faults to fly with, default none.", {"reversed": ["+M1"]}
    )
