"""The keys below ``dispersions`` in a spacecraft file, and what they say as `Dispersions`.

The sizes of tolerances stay as they are written here: `dispersion_rules` finds what is wrong with them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Any

from nutdamp.files.fields import Quantity
from nutdamp.files.sections import Field, Length, Rule, Section
from nutdamp.tolerances import KINDS, Dispersions, Tolerance
from nutdamp.units import parse, pattern

if TYPE_CHECKING:  # so that the keys can be known without numpy
    from nutdamp.spacecraft import Steerable, Thruster

READING = "reading"
"""The kind of what a sensor shows: an angular rate of a gyro, an acceleration of an accelerometer."""

QUANTITIES = {
    "A": "inertia",
    "C": "inertia",
    "omega0": "rate",
    "thrust": "force",
    "thrust_per_pulse": "ratio",
    "thrust_direction": "angle",
    "position": "length",
    "timing": "time",
    "timing_offset": "time",
    "attitude": "angle",
    "open_delay": "time",
    "close_delay": "time",
    "rise_time": "time",
    "fall_time": "time",
    "impulse_bit": "ratio",
    "cold": "ratio",
    "sensor_bias": READING,
    "sensor_scale": "ratio",
    "sensor_noise": "ratio",
    "sensor_delay": "time",
    "cold_pulses": "ratio",
    "tank_propellant": "mass",
    "tank_pressure": "pressure",
    "tank_final_pressure": "pressure",
    "tank_exponent": "ratio",
    "inertia_per_kg": "ratio",
}
"""The keys of dispersions with the kind of quantity that they hold."""

RELATIVE = ("inertia", "rate", "force", "ratio", "mass", "pressure")
"""The kinds of quantity that may be dispersed by a percentage of the nominal value."""

VALVE_TIMES = ("open_delay", "close_delay", "rise_time", "fall_time")

BY_THRUSTER = ("thrust", "thrust_direction", "position", *VALVE_TIMES, "impulse_bit")
"""The keys that hold one tolerance for all thrusters, or one by name."""

ALL = ""
"""Name of all thrusters together, where the file gives one tolerance for them; no thruster has such a name."""


def size_of(value: object, kind: str) -> tuple[float, bool]:
    """The size of a tolerance of ``kind`` (a key of `units.KINDS`), SI or a fraction, and whether it is a fraction.

    Raises ValueError, which says what would be right.
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
    """The kinds of quantity (keys of `units.KINDS`) by which a tolerance of ``kind`` may be given."""
    if kind == READING:
        return ["rate", "acceleration"]
    return [kind, "ratio"] if kind in RELATIVE and kind != "ratio" else [kind]


def by_name(value: Mapping[str, object]) -> bool:
    """Whether a mapping holds tolerances by thruster, and is not itself one."""
    return any(isinstance(getattr(entry, "value", entry), dict) for entry in value.values())


class ToleranceSection(Section):
    """How far a quantity may be off: one of normal (one sigma), uniform, triangular (half width), bias (offset)."""

    normal: Any = Field(
        default=None,
        description="One sigma of a normal distribution, in its unit or in %.",
        examples=["2 %"],
    )
    uniform: Any = Field(
        default=None,
        description="Half the width of a uniform distribution, in its unit or in %.",
        examples=["5 ms"],
    )
    triangular: Any = Field(
        default=None,
        description="Half the width of a triangular distribution, in its unit or in %.",
        examples=["5 %"],
    )
    bias: Any = Field(default=None, description="Fixed offset, signed, in its unit or in %.", examples=["-2 ms"])

    def tolerance(self, key: str) -> Tolerance:
        """The checked tolerance, which is at ``key`` of the dispersions."""
        kind = next(kind for kind in KINDS if getattr(self, kind) is not None)
        size, relative = size_of(getattr(self, kind), QUANTITIES[key])
        return Tolerance(kind, size, relative)


class _Alike(Rule):
    """Annotation of what is at ``key``: several tolerances, or one for all; in the schema with their units."""

    def __init__(self, key: str) -> None:
        self.key = key

    def read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        """A single tolerance is that of all three rates, or for all thrusters."""
        if isinstance(value, dict) and self.key == "omega0":
            return inner([value] * 3)
        alone = isinstance(value, dict) and self.key in BY_THRUSTER and not by_name(value)
        return inner({ALL: value} if alone else value)

    def schema(self, inner: Callable[[], dict[str, Any]]) -> dict[str, Any]:  # noqa: ARG002
        """One tolerance or several."""
        single = _json_schema(QUANTITIES[self.key])
        if self.key == "omega0":
            return {"anyOf": [single, {"type": "array", "items": single, "minItems": 3, "maxItems": 3}]}
        if self.key in BY_THRUSTER:
            return {"anyOf": [single, {"type": "object", "additionalProperties": single, "minProperties": 1}]}
        return single


def _json_schema(kind: str) -> dict[str, Any]:
    """JSON Schema of a tolerance of ``kind``."""
    texts = [{"type": "string", "pattern": pattern(one)} for one in unit_kinds(kind)]
    spread: dict[str, Any] = {"anyOf": [{"type": "number", "minimum": 0}, *texts]}
    return {
        "type": "object",
        "properties": {**dict.fromkeys(KINDS, spread), "bias": {"anyOf": [{"type": "number"}, *texts]}},
        "additionalProperties": False,
        "minProperties": 1,
        "maxProperties": 1,
    }


_Three = Annotated[list[ToleranceSection], Length(3, 3)]
_ByThruster = dict[str, ToleranceSection]


class DispersionsSection(Section):
    """Tolerances: {normal: one sigma}, {uniform: half width}, {triangular: half width} or {bias: fixed offset}."""

    A: Annotated[ToleranceSection, _Alike("A")] | None = Field(
        default=None, description="Of the transverse moment of inertia, kg m² or %.", examples=[{"normal": "2 %"}]
    )
    C: Annotated[ToleranceSection, _Alike("C")] | None = Field(
        default=None,
        description="Of the moment of inertia about the spin axis, kg m² or %.",
        examples=[{"normal": "1.6 kg m^2"}],
    )
    omega0: Annotated[_Three, _Alike("omega0")] | None = Field(
        default=None,
        description="Of each body rate at t = 0, rad/s or %; or a list of three.",
        examples=[{"normal": "0.1 deg/s"}],
    )
    thrust: Annotated[_ByThruster, _Alike("thrust")] | None = Field(
        default=None,
        description="Of each thruster, the same in all its pulses, % or N; or by name.",
        examples=[{"normal": "3 %"}],
    )
    thrust_per_pulse: Annotated[ToleranceSection, _Alike("thrust_per_pulse")] | None = Field(
        default=None, description="Of the thrust, in each pulse anew, %.", examples=[{"normal": "1 %"}]
    )
    thrust_direction: Annotated[_ByThruster, _Alike("thrust_direction")] | None = Field(
        default=None,
        description="Tilt of each force about two axes across it, rad; or by name.",
        examples=[{"normal": "0.5 deg"}],
    )
    position: Annotated[_ByThruster, _Alike("position")] | None = Field(
        default=None,
        description="Of each thruster's position, each component, m; or by name.",
        examples=[{"normal": "5 mm"}],
    )
    timing: Annotated[ToleranceSection, _Alike("timing")] | None = Field(
        default=None, description="Shift of each pulse, s.", examples=[{"uniform": "5 ms"}]
    )
    timing_offset: Annotated[ToleranceSection, _Alike("timing_offset")] | None = Field(
        default=None, description="One shift of the whole schedule, s.", examples=[{"bias": "2 ms"}]
    )
    attitude: Annotated[ToleranceSection, _Alike("attitude")] | None = Field(
        default=None,
        description="Of the direction of the spin axis at t = 0, about two axes across it, rad.",
        examples=[{"normal": "0.2 deg"}],
    )
    open_delay: Annotated[_ByThruster, _Alike("open_delay")] | None = Field(
        default=None,
        description="Of each valve's open_delay, the same in all its pulses, s; or by name.",
        examples=[{"normal": "1 ms"}],
    )
    close_delay: Annotated[_ByThruster, _Alike("close_delay")] | None = Field(
        default=None,
        description="Of each valve's close_delay, the same in all its pulses, s; or by name.",
        examples=[{"normal": "1 ms"}],
    )
    rise_time: Annotated[_ByThruster, _Alike("rise_time")] | None = Field(
        default=None,
        description="Of each valve's rise_time, the same in all its pulses, s; or by name.",
        examples=[{"normal": "0.5 ms"}],
    )
    fall_time: Annotated[_ByThruster, _Alike("fall_time")] | None = Field(
        default=None,
        description="Of each valve's fall_time, the same in all its pulses, s; or by name.",
        examples=[{"normal": "1 ms"}],
    )
    impulse_bit: Annotated[_ByThruster, _Alike("impulse_bit")] | None = Field(
        default=None,
        description="Of the impulses of each impulse_bit, the same in all its pulses, %; or by name.",
        examples=[{"normal": "2 %"}],
    )
    cold: Annotated[ToleranceSection, _Alike("cold")] | None = Field(
        default=None,
        description="Of the factor of a first cold pulse, cold.first, in % of it.",
        examples=[{"normal": "2 %"}],
    )
    sensor_bias: Annotated[ToleranceSection, _Alike("sensor_bias")] | None = Field(
        default=None,
        description="Of the bias of each gyro of a loop, rad/s, or of its accelerometer, m/s².",
        examples=[{"normal": "0.01 deg/s"}],
    )
    sensor_scale: Annotated[ToleranceSection, _Alike("sensor_scale")] | None = Field(
        default=None,
        description="Of the scale of each gyro of a loop, or of its accelerometer, %.",
        examples=[{"normal": "1 %"}],
    )
    sensor_noise: Annotated[ToleranceSection, _Alike("sensor_noise")] | None = Field(
        default=None, description="Of the noise of the sensor of a loop, %.", examples=[{"uniform": "20 %"}]
    )
    sensor_delay: Annotated[ToleranceSection, _Alike("sensor_delay")] | None = Field(
        default=None,
        description="Of the delay of the sensor of a loop, s; what would be below 0 is drawn again.",
        examples=[{"uniform": "2 ms"}],
    )
    cold_pulses: Annotated[ToleranceSection, _Alike("cold_pulses")] | None = Field(
        default=None,
        description="Of the number of pulses over which nozzles warm up, in %.",
        examples=[{"normal": "10 %"}],
    )
    tank_propellant: Annotated[ToleranceSection, _Alike("tank_propellant")] | None = Field(
        default=None,
        description="Of the propellant in the tank at t = 0, kg or %.",
        examples=[{"normal": "1 %"}],
    )
    tank_pressure: Annotated[ToleranceSection, _Alike("tank_pressure")] | None = Field(
        default=None,
        description="Of the pressure at t = 0, for which the file gives the thrust, Pa or %.",
        examples=[{"normal": "0.2 bar"}],
    )
    tank_final_pressure: Annotated[ToleranceSection, _Alike("tank_final_pressure")] | None = Field(
        default=None,
        description="Of the pressure with nothing left, Pa or %.",
        examples=[{"normal": "0.2 bar"}],
    )
    tank_exponent: Annotated[ToleranceSection, _Alike("tank_exponent")] | None = Field(
        default=None,
        description="Of the power of the pressure that the thrust goes with, in %.",
        examples=[{"normal": "5 %"}],
    )
    inertia_per_kg: Annotated[ToleranceSection, _Alike("inertia_per_kg")] | None = Field(
        default=None,
        description="Of what each kg that is used takes off the moments of inertia, of all alike, in %.",
        examples=[{"normal": "10 %"}],
    )
    correlation: list[tuple[str, str, Annotated[float, Quantity("ratio", minimum=-1, maximum=1)]]] = Field(
        default=[],
        description="Pairs of inputs that vary together, named as in disperse --json, and their correlation, -1 to 1;"
        " of uniform and triangular ones that of the normals behind them (Gaussian copula).",
        examples=[[["A", "C", 0.99]]],
    )


def dispersions(
    section: DispersionsSection | None, thrusters: Iterable[Thruster], torquer: Steerable | None
) -> Dispersions | None:
    """The tolerances of a checked file; None where it has none. A thrust in N becomes a fraction of the thruster's.

    ``torquer`` is the steerable one, also where an ideal one is assumed.
    """
    if section is None:
        return None
    from nutdamp.schedule import STEERABLE

    thrusts = {thruster.name: thruster.thrust for thruster in thrusters}
    if torquer is not None:
        thrusts[STEERABLE] = thrust_behind(torquer.torque, torquer.lever_arm)

    def fraction(name: str, tolerance: Tolerance) -> Tolerance:
        thrust = thrusts[name]
        if tolerance.relative or thrust is None:
            return tolerance
        return Tolerance(tolerance.kind, tolerance.size / thrust, relative=True)

    found: dict[str, Any] = {}
    for key in (one.name for one in fields(Dispersions)):
        entry = getattr(section, key)
        if key == "correlation":
            found[key] = tuple((one, other, size) for one, other, size in entry)
        elif isinstance(entry, ToleranceSection):
            found[key] = entry.tolerance(key)
        elif isinstance(entry, list | tuple):  # by axis
            found[key] = tuple(None if one is None else one.tolerance(key) for one in entry)
        elif entry is not None:  # by thruster
            named = {name: one.tolerance(key) for name, one in entry.items()}
            found[key] = dict.fromkeys(thrusts, named[ALL]) if ALL in named else named
    if "thrust" in found:
        found["thrust"] = {name: fraction(name, tolerance) for name, tolerance in found["thrust"].items()}
    return Dispersions(**found)


def thrust_behind(torque: float | None, lever_arm: float | None) -> float | None:
    """Thrust in N behind a torque (N m) on a lever arm (m); None where one of them is not known."""
    return None if torque is None or lever_arm is None else torque / lever_arm
