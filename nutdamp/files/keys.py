"""Declaration of the spacecraft file: its keys, their units and ranges, and what explains them.

Reader, rules, JSON Schema, guide and ``--set`` all go by it. Constraints between several keys are
in `rules`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from nutdamp.files.fields import (
    NAME,
    RIGHT_ANGLE,
    Finding,
    Key,
    ValueKind,
    Values,
    choice,
    either,
    flag,
    mismatch,
    named,
    optional,
    quantity,
    required,
    row,
    rows,
    section,
    text,
    unit_form,
    unit_text,
    whole,
)
from nutdamp.files.yaml import KeyPath, Node
from nutdamp.spacecraft.tolerances import READING, Dispersions, SpinTolerance, Tolerance
from nutdamp.units import parse, shown

if TYPE_CHECKING:
    from nutdamp.spacecraft.equipment import Steerable, Thruster

# --- dispersions

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


def by_name(node: Node) -> bool:
    """True where a mapping holds tolerances by thruster, and is not itself one."""
    return any(isinstance(entry.value, dict) for _, entry in node.children())


LARGEST_SIGMA = 0.5
"""One sigma, as a share of a value or of a right angle: with more one draw in forty turns its
sign.
"""

LARGEST_OFFSET = 1.0
"""Half a width and a fixed offset: with more any turns its sign."""

EXAMPLES = {"rate": "0.1 deg/s", "angle": "0.5 deg", "length": "5 mm", "time": "5 ms"}


def size(distribution: str, quantity: str) -> ValueKind:
    """Size of a tolerance of a ``quantity`` by one ``distribution``, read as a `Tolerance`."""
    normal = distribution == "normal"
    what = {"normal": "one sigma", "bias": "an offset"}.get(distribution, "half a width")
    bound = LARGEST_SIGMA if normal else LARGEST_OFFSET

    def read(node: Node, _: KeyPath, _values: Values) -> Tolerance:
        value = node.plain()
        size, relative = size_of(value, quantity)
        if distribution != "bias" and size < 0.0:
            raise ValueError(
                f"{shown(value)} is negative; expected {what} of at least 0, or bias for a fixed "
                "offset"
            )
        share = abs(size) if relative else 0.0
        if quantity == "angle":
            share = abs(size) / RIGHT_ANGLE
        if share > bound or share == LARGEST_OFFSET:
            limit = f"{100 * bound:g} %" if relative else f"{90 * bound:g} deg"
            words = "of at most" if normal else "below"
            raise ValueError(f"{shown(value)} is out of range; expected {what} {words} {limit}")
        return Tolerance(distribution, size, relative)

    number = {"type": "number"} | ({} if distribution == "bias" else {"minimum": 0})
    return ValueKind(read, {"anyOf": [number, *map(unit_text, unit_kinds(quantity))]})


DISTRIBUTIONS = {
    "normal": ("One sigma of a normal distribution", "2 %"),
    "uniform": ("Half the width of a uniform distribution", "5 ms"),
    "triangular": ("Half the width of a triangular distribution", "5 %"),
    "bias": ("Fixed offset, signed", "-2 ms"),
}


def tolerance_of(quantity: str) -> ValueKind:
    """Tolerance of a ``quantity``: a mapping with the size by one of the `DISTRIBUTIONS`."""
    keys = {
        kind: optional(size(kind, quantity), f"{what}, in its unit or in %.", example)
        for kind, (what, example) in DISTRIBUTIONS.items()
    }
    about = (
        "Tolerance of a quantity: one of normal (one sigma), uniform, triangular (half width), "
        "bias (offset)."
    )
    sizes = section("ToleranceSection", about, keys)

    def read(node: Node, path: KeyPath, values: Values) -> Any:
        if not isinstance(node.value, dict):
            raise mismatch(node, "a tolerance, such as {normal: 2 %}")
        contents = sizes.read(node, path, values)
        stated = [name for name in node.value if name in keys]
        if not stated:
            raise ValueError(
                f"names no distribution; give {{normal: {EXAMPLES.get(quantity, '2 %')}}}, or "
                "uniform, triangular, bias"
            )
        for name in stated[1:]:
            values.findings.append(
                Finding((*path, name), f"given together with {stated[0]}; keep one of the two")
            )
        return getattr(contents, stated[0])

    schema = {
        "type": "object",
        "properties": {name: key.kind.schema for name, key in keys.items()},
        **{"additionalProperties": False, "minProperties": 1, "maxProperties": 1},
    }
    form = unit_form(*unit_kinds(quantity))
    return ValueKind(read, schema, form=form, keys=keys, definition=sizes.definition)


def each_or_all(single: ValueKind, each: ValueKind) -> ValueKind:
    """One tolerance for all three axes, or all thrusters, or those of ``each`` of them: a list by
    axis, or a mapping by thruster.
    """
    by_axis = either(each, single)

    def read(node: Node, path: KeyPath, values: Values) -> Any:
        if each.schema["type"] == "array":
            listed = by_axis.read(node, path, values)
            return listed if isinstance(node.value, list) else [listed] * 3
        if by_name(node) or not isinstance(node.value, dict):
            return each.read(node, path, values)
        return {ALL: single.read(node, path, values)}

    return ValueKind(read, {"anyOf": [single.schema, each.schema]}, (single,))


def _tolerances() -> Iterator[tuple[str, Key]]:
    """Keys of the dispersions, as `Dispersions` declares them."""
    for declared in fields(Dispersions):
        if not declared.metadata:
            continue
        kind = tolerance_of(declared.metadata["kind"])
        if declared.metadata["each"] == "axis":
            kind = each_or_all(kind, rows(kind, 3, 3))
        elif declared.metadata["each"] == "thruster":
            kind = each_or_all(kind, named(kind, 1))
        yield declared.name, optional(kind, declared.metadata["text"], declared.metadata["example"])


TOLERANCES = dict(_tolerances())
BY_THRUSTER = tuple(
    field.name for field in fields(Dispersions) if field.metadata.get("each") == "thruster"
)

DISPERSIONS = section(
    "DispersionsSection",
    "Tolerances: {normal: one sigma}, {uniform: half width}, {triangular: half width} or "
    "{bias: fixed offset}.",
    {
        **TOLERANCES,
        "correlation": optional(
            rows(row(text(), text(), quantity("ratio", exclusiveMinimum=-1, exclusiveMaximum=1))),
            "Pairs of inputs that vary together, named as in disperse --json, and their "
            "correlation, -1 to 1. For uniform and triangular inputs it is that of underlying "
            "normals (Gaussian copula).",
            [["A", "C", 0.99]],
            default=[],
        ),
    },
)


def dispersions(
    section: Any, thrusters: Iterable[Thruster], torquer: Steerable | None
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
    entries = {key: entry for key, entry in vars(section).items() if entry is not None}
    for key, entry in entries.items():
        if isinstance(entry, dict) and ALL in entry:
            entries[key] = dict.fromkeys(thrusts, entry[ALL])
        elif isinstance(entry, list):
            entries[key] = tuple(tuple(each) if key == "correlation" else each for each in entry)
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


# --- kinds of values


def sensor_quantity(**bounds: float) -> ValueKind:
    """A quantity in the unit of the sensor: an angular rate of a gyro, else an acceleration."""

    def read(node: Node, _: KeyPath, _values: Values) -> float:
        result, _relative = size_of(node.plain(), READING)
        if result < bounds.get("minimum", -math.inf):
            raise ValueError(
                f"{shown(node.plain())} is out of range; expected at least {bounds['minimum']:g}"
            )
        return result

    texts = map(unit_text, unit_kinds(READING))
    return ValueKind(
        read, {"anyOf": [{"type": "number", **bounds}, *texts]}, form=unit_form("rate")
    )


def or_alone(vector: ValueKind, single: ValueKind) -> ValueKind:
    """A torque vector that may be written as a single torque, its part about axis 3."""

    def read(node: Node, path: KeyPath, values: Values) -> Any:
        if isinstance(node.value, list):
            return vector.read(node, path, values)
        return [0.0, 0.0, single.read(node, path, values)]

    return ValueKind(read, {"anyOf": [vector.schema, *single.schema["anyOf"]]}, (vector,))


def or_word(word: str, direction: ValueKind) -> ValueKind:
    """A direction in the sky that may be written as one ``word`` instead."""

    def read(node: Node, path: KeyPath, values: Values) -> Any:
        if node.value == word:
            return word
        if not isinstance(node.value, list):
            raise mismatch(node, f"{word} or [right ascension, declination]")
        return direction.read(node, path, values)

    return ValueKind(read, {"anyOf": [direction.schema, {"const": word}]}, (direction,))


def windows(window: ValueKind) -> ValueKind:
    """A list of [begin, end]; the error for a single one shows how to nest it."""
    several = rows(window)

    def read(node: Node, path: KeyPath, values: Values) -> Any:
        entries = node.plain()
        if isinstance(entries, list) and entries and not isinstance(entries[0], list):
            single = f"[{', '.join(map(str, entries))}]"
            raise ValueError(f"expected a list of [begin, end], such as [{single}], got {single}")
        return several.read(node, path, values)

    return ValueKind(read, several.schema, several.parts)


def share_or_rate() -> ValueKind:
    """A tolerance of a rate: a share of its goal, in %, or a rate."""
    share = quantity("ratio", exclusiveMinimum=0)
    rate = quantity("rate", exclusiveMinimum=0)

    def read(node: Node, path: KeyPath, values: Values) -> SpinTolerance:
        relative = isinstance(node.value, str) and node.value.rstrip().endswith("%")
        return SpinTolerance((share if relative else rate).read(node, path, values), relative)

    return ValueKind(read, {"anyOf": [*rate.schema["anyOf"], unit_text("ratio")]})


def date_and_time() -> ValueKind:
    """The text of an epoch."""
    plain = text()

    def read(node: Node, path: KeyPath, values: Values) -> str:
        moment: str = plain.read(node, path, values)
        if not re.fullmatch(_EPOCH, moment):
            raise ValueError(
                f"{shown(moment)} is no epoch; expected ISO 8601: 2026-03-01T12:00:00Z"
            )
        from nutdamp.common.time import Epoch  # an epoch

        # raises for a day that is none, and for one without UTC or beyond four digits
        Epoch.parse(moment)
        return moment

    return ValueKind(read, {**plain.schema, "pattern": f"^{_EPOCH}$"}, form=plain.form)


_EPOCH = (
    r"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}(:[0-9]{2}(\.[0-9]+)?)?(Z|[+-][0-9]{2}:[0-9]{2})?"
)

ANGLE = quantity("angle")
NUTATION = quantity("angle", minimum=0, exclusiveMaximum=RIGHT_ANGLE)
ACUTE_ANGLE = quantity("angle", exclusiveMinimum=0, exclusiveMaximum=RIGHT_ANGLE)
APART = quantity("angle", minimum=0, maximum=2 * RIGHT_ANGLE)
DECLINATION = quantity("angle", minimum=-RIGHT_ANGLE, maximum=RIGHT_ANGLE)
RIGHT_ASCENSION = quantity("right ascension")
IN_THE_SKY = row(RIGHT_ASCENSION, DECLINATION)
TIME = quantity("time", minimum=0)
POSITIVE_TIME = quantity("time", exclusiveMinimum=0)
MASS = quantity("mass", exclusiveMinimum=0)
MOMENT_OF_INERTIA = quantity("inertia", exclusiveMinimum=0)
RATE = quantity("rate")
LEVER = quantity("length", exclusiveMinimum=0)
TORQUES = rows(quantity("torque"), 3, 3)
PRESSURE = quantity("pressure", exclusiveMinimum=0)
SHED = quantity("shed", minimum=0)
LEAST_READING = sensor_quantity(minimum=0)
POSITION = rows(quantity("length"), 3, 3)
DIRECTION = rows(quantity("number"), 3, 3)
COUNT = whole(1, 1_000_000)


def _needs(*keys: str, without: tuple[str, ...]) -> dict[str, Any]:
    """JSON Schema for: all of ``keys`` and none of ``without``."""
    return {"required": list(keys), "not": {"anyOf": [{"required": [key]} for key in without]}}


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

# --- the sections, those of other sections behind them

LOOP_SENSOR = section(
    "LoopSensorSection",
    "Sensor of the loop: two rate gyros about axes 1 and 2, or an accelerometer.",
    {
        "kind": required(
            choice("gyro", "accelerometer"),
            "gyro: shows ω1 and ω2. accelerometer: shows the acceleration at position along axis.",
            "gyro",
        ),
        "axes": optional(
            choice("file", "principal"),
            "Axes about which gyros measure. file (default): those of the file, where a tilted "
            "principal axis shows as a rate. principal: those of gyros calibrated to the "
            "principal axes.",
            "principal",
            default="file",
        ),
        "rate": optional(
            quantity("frequency", exclusiveMinimum=0),
            "Samples a second, Hz. Default: a continuous signal.",
            "100 Hz",
        ),
        "quantisation": optional(
            LEAST_READING,
            "Step of a sample, rad/s; of an accelerometer m/s². Default 0.",
            "0.002 deg/s",
            default=0.0,
        ),
        "noise": optional(
            LEAST_READING,
            "One sigma of the noise of a sample, rad/s; of an accelerometer m/s². Default 0.",
            "0.01 deg/s",
            default=0.0,
        ),
        "bias": optional(
            sensor_quantity(),
            "What a signal shows without motion, rad/s; of an accelerometer m/s². Default 0.",
            "0.02 deg/s",
            default=0.0,
        ),
        "scale": optional(
            quantity("ratio"),
            "Signal divided by truth; default 100 %. A reversed sensor has -100 %.",
            "101 %",
            default=1.0,
        ),
        "delay": optional(
            TIME, "Time until a sample reaches the valves, s; default 0.", "20 ms", default=0.0
        ),
        "low_pass": optional(
            TIME,
            "Time constant of a first-order low-pass filter over the samples, s; default 0: none.",
            "50 ms",
            default=0.0,
        ),
        "position": optional(
            POSITION,
            "Place of an accelerometer, m, from the center of mass or as center_of_mass says.",
            ["0.8 m", 0, 0],
        ),
        "axis": optional(
            DIRECTION,
            "Direction in which an accelerometer measures, any length but zero; default [0, 0, 1].",
            [0, 0, 1],
        ),
    },
)


LOOP_FAULTS = section(
    "LoopFaultsSection",
    "Faults that the loop is flown with, and that it does not know.",
    {
        "reversed": optional(
            rows(NAME), "Channels that push the other way when fired.", ["+M1"], default=[]
        ),
    },
)


LOOP = section(
    "LoopSection",
    "A closed loop, for `nutdamp loop`: it fires when the sensor shows start, until it shows stop.",
    {
        "sensor": required(
            LOOP_SENSOR, "The sensor.", {"kind": "gyro", "rate": "100 Hz", "noise": "0.01 deg/s"}
        ),
        "law": optional(
            choice("four-pulse", "one-pulse", "bang"),
            "four-pulse (default): each channel that comes into line fires as long as needed, at "
            "most on_time. one-pulse: the same, at most half a nutation period. bang: each fires "
            "for on_time.",
            "four-pulse",
            default="four-pulse",
        ),
        "start": required(
            ACUTE_ANGLE,
            "Nutation angle at which the loop begins to fire, rad; above stop.",
            "0.5 deg",
        ),
        "stop": optional(
            NUTATION, "Nutation angle at which it stops, rad; default 0.", "0.05 deg", default=0.0
        ),
        "settle": optional(
            TIME,
            "Time after a firing in which samples are ignored, s; default 0.",
            "0.2 s",
            default=0.0,
        ),
        "min_interval": optional(
            TIME, "Least time from one firing to the next, s; default 0.", "0.5 s", default=0.0
        ),
        "predict": optional(
            flag(),
            "true (default): firings are centred on their moments, with delay, filter and half "
            "the on-time compensated.",
            True,
            default=True,
        ),
        "alias": optional(
            flag(),
            "true: fewer than four samples in a nutation period are intended; default false.",
            True,
            default=False,
        ),
        "on_time": optional(
            POSITIVE_TIME,
            "On-time of bang, and longest on-time of four-pulse, s. Default of four-pulse: an "
            "eighth of the nutation period, within min_on_time and max_on_time.",
            "50 ms",
        ),
        "faults": optional(LOOP_FAULTS, "Faults to fly with, default none.", {"reversed": ["+M1"]}),
    },
)


ORBIT = section(
    "OrbitSection",
    "Position and velocity at attitude.epoch, in attitude.frame. They are for messages to flight "
    "dynamics.",
    {
        "position": required(POSITION, "Position from the center, m.", ["7000 km", 0, 0]),
        "velocity": required(rows(quantity("speed"), 3, 3), "Velocity, m/s.", [0, "7.5 km/s", 0]),
        "center": optional(NAME, "Body at the origin; default EARTH.", "EARTH", default="EARTH"),
    },
)


WHEEL = section(
    "WheelSection",
    "A part that spins relative to the body: a momentum wheel, or a despun platform.",
    {
        "momentum": required(
            quantity("momentum"),
            "Its constant angular momentum along principal axis 3, signed, N m s. It adds to the "
            "C ω3 of the rest.",
            "40 N m s",
        ),
    },
)


SUN_SENSOR = section(
    "SunSensorSection",
    "A sensor that gives a pulse once a spin, when it sees the Sun.",
    {
        "azimuth": required(
            ANGLE,
            "Azimuth in the body at which the Sun pulse comes, rad, about axis 3 from axis 1.",
            "35 deg",
        ),
        "elevation": optional(
            DECLINATION,
            "Middle of its view, rad, from the plane square to axis 3 towards the spin axis; "
            "default 0.",
            "45 deg",
            default=0.0,
        ),
        "half_width": optional(
            APART,
            "Largest angle from there at which it sees the Sun, rad. Default: 90 deg, which is "
            "always.",
            "45 deg",
            default=RIGHT_ANGLE,
        ),
        "jitter": optional(
            TIME, "One sigma of the times of its pulses, s; default 0.", "0.5 ms", default=0.0
        ),
    },
)


WIDTH = section(
    "WidthSection",
    "Widths of pulses that can be commanded: min, min + step, … up to max.",
    {
        "step": required(POSITIVE_TIME, "Resolution of the width, s.", "1 ms"),
        "min": required(POSITIVE_TIME, "Shortest width, s.", "20 ms"),
        "max": required(POSITIVE_TIME, "Longest width, s.", "500 ms"),
    },
)


COMMANDS = section(
    "CommandsSection",
    "Contents of a command block: a number of pulses of one channel, fired by the Sun pulse.",
    {
        "delay_step": required(
            POSITIVE_TIME, "Resolution of the delay after the Sun pulse, s.", "2 ms"
        ),
        "delay_max": required(
            POSITIVE_TIME, "Longest delay, s. At most one spin turn of it is used.", "1.9 s"
        ),
        "width": required(
            either(rows(POSITIVE_TIME, 1), WIDTH),
            "Widths that can be commanded, s: a list, or step, min and max.",
            {"step": "1 ms", "min": "20 ms", "max": "500 ms"},
            ["0.1 s", "0.2 s"],
        ),
        "max_count": optional(
            COUNT, "Largest number of pulses of a block; default 255.", 255, default=255
        ),
        "every": optional(
            rows(COUNT, 1),
            "Choices of the number of spins from one pulse to the next; default [1].",
            [1, 2],
            default=[1],
        ),
        "per_turn": optional(
            whole(1, 2),
            "Number of blocks that may fire in the same turns, without overlap; default 1. With "
            "2, prefer delay_is: angle, which keeps opposite pulses apart while the spin changes.",
            2,
            default=1,
        ),
        "delay_is": optional(
            choice("time", "angle"),
            "How a delay counts. time (default): seconds after the Sun pulse. angle: turn of the "
            "Sun since its pulse.",
            "angle",
            default="time",
        ),
    },
)


KEEP = section(
    "KeepSection",
    "A cone about a direction in space. The spin axis must not enter it (min), or must not leave "
    "it (max). Nutation counts.",
    {
        "name": required(NAME, "Name of the cone, for reports.", "Earth"),
        "direction": required(
            or_word("sun", IN_THE_SKY),
            "Right ascension and declination in the frame of attitude, rad. Or sun.",
            "sun",
            ["120 deg", "10 deg"],
        ),
        "min": optional(APART, "Smallest angle to the spin axis, rad; default 0.", "4 deg"),
        "max": optional(APART, "Largest angle to the spin axis, rad; default 180 deg.", "20 deg"),
    },
)


VALVE = section(
    "ValveSection",
    "A valve: thrust begins after the command, then rises and falls evenly.",
    {
        "open_delay": optional(
            TIME,
            "From the start of the command to the first thrust, s; default 0.",
            "8 ms",
            default=0.0,
        ),
        "close_delay": optional(
            TIME,
            "From the end of the command until the thrust begins to fall, s; default 0.",
            "12 ms",
            default=0.0,
        ),
        "rise_time": optional(
            TIME, "From the first thrust to full thrust, s; default 0.", "5 ms", default=0.0
        ),
        "fall_time": optional(
            TIME, "From full thrust to none, s; default 0.", "10 ms", default=0.0
        ),
        "on_time_is": optional(
            choice("command", "effective"),
            "Meaning of a commanded on-time. command (default): the length of the command. "
            "effective: impulse over full thrust, which the valve electronics turns into a "
            "command.",
            "command",
            default="command",
        ),
    },
)


SHED_MOMENTS = section(
    "ShedSection",
    "Share of the propellant in the tank in the moments of inertia.",
    {
        "A": required(
            SHED, "Decrease of the transverse moment for each kg used, kg m²/kg.", "0.4 kg m^2/kg"
        ),
        "C": required(
            SHED, "Decrease of the moment about axis 3 for each kg used, kg m²/kg.", "0.6 kg m^2/kg"
        ),
    },
)


TANK = section(
    "TankSection",
    "A blowdown tank: pressure and thrust fall as propellant is used and the gas expands.",
    {
        "propellant": required(MASS, "Propellant in it at t = 0, kg.", "30 kg"),
        "pressure": required(PRESSURE, "Pressure at t = 0, Pa.", "22 bar"),
        "final_pressure": required(
            PRESSURE, "Pressure when the propellant is used up, Pa.", "8 bar"
        ),
        "exponent": optional(
            quantity("number", minimum=0),
            "Exponent n of thrust ~ pressure^n; default 1.",
            1,
            default=1.0,
        ),
        "isp": optional(
            rows(row(PRESSURE, POSITIVE_TIME), 2),
            "Rows of pressure, Pa, rising, and specific impulse, s, in place of that of the "
            "thrusters. Values between rows are interpolated. Below the first row its value "
            "holds.",
            [["8 bar", "215 s"], ["22 bar", "228 s"]],
        ),
        "inertia_per_kg": optional(
            either(rows(SHED, 3, 3), SHED_MOMENTS),
            "Decrease of the moments of inertia for each kg used, kg m²/kg. Give A and C, or the "
            "three principal moments, the one about axis 3 last. Default: they stay.",
            {"A": "0.4 kg m^2/kg", "C": "0.6 kg m^2/kg"},
        ),
    },
)


COLD = section(
    "ColdSection",
    "Cold nozzles: the first pulses of each channel are weaker.",
    {
        "first": required(
            quantity("ratio", exclusiveMinimum=0),
            "Thrust of the first pulse of a channel, as a share of that of a warm one.",
            "90 %",
        ),
        "pulses": required(
            quantity("number", exclusiveMinimum=0),
            "Number of pulses in which the difference from a warm one falls by the factor e.",
            4,
        ),
    },
)


INERTIA = section(
    "InertiaSection",
    "Moments of inertia about the centre of mass: A and C, or the whole tensor.",
    {
        "A": optional(MOMENT_OF_INERTIA, "Transverse moment of inertia, kg m².", "120 kg m^2"),
        "C": optional(
            MOMENT_OF_INERTIA,
            "Moment of inertia about the spin axis 3, kg m²; at most 2 A.",
            "80 kg m^2",
        ),
        "tensor": optional(
            rows(rows(quantity("inertia"), 3, 3), 3, 3),
            "Inertia tensor, 3 rows of 3, kg m². Entries off the diagonal are minus the products "
            "of inertia: row 1, column 2 is -IXY, with IXY the sum of m x y as in CCSDS "
            "messages. Axis 3 is the principal axis nearest the file's third axis.",
            [[120, 0.5, 0], [0.5, 118, 0], [0, 0, 80]],
        ),
    },
    extra={"oneOf": [_needs("A", "C", without=("tensor",)), _needs("tensor", without=("A", "C"))]},
)


STATE = section(
    "StateSection",
    "The motion at t = 0 by spin and nutation angle.",
    {
        "spin": required(
            RATE, "Spin rate about axis 3, signed, rad/s. Zero only with a wheel.", "30 rpm"
        ),
        "nutation": required(
            NUTATION,
            "Nutation angle between H and spin axis at t = 0, rad, from 0 to below 90 deg.",
            "5 deg",
        ),
        "phase": optional(
            ANGLE,
            "Direction of the transverse rate, arg(ω1 + i ω2), rad; default 0.",
            "20 deg",
            default=0.0,
        ),
    },
)


ATTITUDE = section(
    "AttitudeSection",
    "Attitude at t = 0. Without it results refer to the frame with z along H.",
    {
        "quaternion": optional(
            rows(quantity("number"), 4, 4),
            "Rotation from body to frame, scalar first. It is normalised when read.",
            [1, 0, 0, 0],
        ),
        "spin_axis": optional(
            IN_THE_SKY,
            "Right ascension and declination of the spin axis, rad, in place of quaternion. See "
            "phase.",
            ["120 deg", "-15 deg"],
        ),
        "phase": optional(
            ANGLE,
            "Angle about spin_axis from its ascending node to body axis 1, rad; default 0. The "
            "ascending node is z of the frame × spin axis; at a pole it is x of the frame.",
            "20 deg",
        ),
        "sun_phase": optional(
            ANGLE,
            "Angle about spin_axis from the side of the Sun to body axis 1, rad, in place of "
            "phase. It needs sun.",
            "35 deg",
        ),
        "of": optional(
            choice("axis", "momentum"),
            "The vector whose direction spin_axis and phase give: the spin axis itself "
            "(default), or the angular momentum.",
            "momentum",
        ),
        "epoch": optional(
            date_and_time(),
            "Date and time of t = 0, ISO 8601, from 1972 to 9999. Without a zone it is UTC.",
            "2026-03-01T12:00:00Z",
        ),
        "frame": optional(
            choice("EME2000", "J2000", "GCRF", "ECLIPJ2000", "ECLIPDATE", "MOD"),
            "Inertial frame of the attitude and of all directions of the file. In a frame of the "
            "ecliptic, right ascension and declination are longitude and latitude.",
            "EME2000",
        ),
    },
    extra={
        "oneOf": [
            _needs("quaternion", without=("spin_axis", "phase", "sun_phase", "of")),
            _needs("spin_axis", without=("quaternion",)),
        ]
    },
)


THRUSTER = section(
    "ThrusterSection",
    "A thruster: position, direction and force, or only its torque.",
    {
        "name": required(NAME, "Name of the thruster, for channels and schedules.", "T1"),
        "position": optional(
            POSITION,
            "Point where the force acts, m, from the center of mass or as center_of_mass says.",
            [0, "0.5 m", "0.8 m"],
        ),
        "direction": optional(
            DIRECTION,
            "Direction of the force on the spacecraft, against the plume. Any length but zero.",
            [1, 0, 0],
        ),
        "force": optional(quantity("force", exclusiveMinimum=0), "Thrust, N.", "10 N"),
        "torque": optional(
            TORQUES,
            "Torque about the centre of mass, N m, in place of position, direction and force.",
            [0, "-8 N m", 0],
        ),
        "lever_arm": optional(
            LEVER, "Lever arm, m. With a torque it gives the thrust, for the propellant.", "0.8 m"
        ),
        "isp": optional(POSITIVE_TIME, "Specific impulse, s, for the propellant.", "220 s"),
        "min_on_time": optional(TIME, "Shortest firing, s; default 0.", "20 ms", default=0.0),
        "max_on_time": optional(POSITIVE_TIME, "Longest firing, s. Default: no limit.", "2 s"),
        "valve": optional(
            VALVE,
            "How the thrust follows a command. Default: as the valve of the file, or full thrust "
            "at once.",
            {"open_delay": "8 ms", "close_delay": "12 ms"},
        ),
        "impulse_bit": optional(
            rows(row(POSITIVE_TIME, quantity("impulse", exclusiveMinimum=0), POSITIVE_TIME), 2),
            "Table from tests, in place of valve. Each row has on-time, s, impulse, N s, and the "
            "time of its centroid after the start of the command, s.",
            [["20 ms", "0.15 N s", "16 ms"], ["100 ms", "0.95 N s", "58 ms"]],
        ),
    },
    extra={
        "oneOf": [
            _needs("position", "direction", "force", without=("torque", "lever_arm")),
            _needs("torque", without=("position", "direction", "force")),
        ]
    },
)


STEERABLE = section(
    "SteerableSection",
    "A torquer for any transverse axis. It is fixed in the body during a pulse.",
    {
        "torque": optional(
            quantity("torque", exclusiveMinimum=0),
            "Torque, N m. Without it its impulses are ideal and take no time.",
            "20 N m",
        ),
        "isp": optional(POSITIVE_TIME, "Specific impulse, s, for the propellant.", "220 s"),
        "lever_arm": optional(LEVER, "Lever arm, m, for the propellant.", "1 m"),
    },
)


REQUIREMENT = section(
    "RequirementSection",
    "Requirement on the end of a plan.",
    {
        "nutation": optional(
            ACUTE_ANGLE, "Largest nutation angle, rad, above 0 and below 90 deg.", "0.5 deg"
        ),
        "momentum_shift": optional(
            ACUTE_ANGLE,
            "Largest turn of H from t = 0, rad, above 0 and below 90 deg. With a target give "
            "pointing.",
            "0.2 deg",
        ),
        "pointing": optional(
            ACUTE_ANGLE,
            "Largest angle of H from the target of goal, rad, above 0 and below 90 deg.",
            "0.2 deg",
        ),
        "nutation_during": optional(
            ACUTE_ANGLE,
            "Largest nutation angle on the way, rad, above 0 and below 90 deg. It is a cone of "
            "the spin axis about H. For other cones see keep.",
            "2 deg",
        ),
        "spin": optional(
            share_or_rate(),
            "Tolerance of the spin at the end about goal.spin or --spin, rad/s or % of it; "
            "default 1 %.",
            "0.5 %",
        ),
        "probability": optional(
            quantity("ratio", exclusiveMinimum=0, exclusiveMaximum=1),
            "Share of dispersed flights that must meet it, above 0 and below 1 (or in %).",
            "99.7 %",
        ),
    },
)


GOAL = section(
    "GoalSection",
    "End of the motion. Without it H stays where it is, and the spin may change.",
    {
        "tilt": optional(
            quantity("angle", minimum=0, exclusiveMaximum=2 * RIGHT_ANGLE),
            "Angle of the target axis from H at t = 0, rad, below 180 deg.",
            "10 deg",
        ),
        "azimuth": optional(
            ANGLE,
            "Azimuth of the target axis about H, rad, from the initial tilt direction of the "
            "spin axis.",
            "45 deg",
        ),
        "right_ascension": optional(
            RIGHT_ASCENSION,
            "Right ascension of the target axis in the frame of attitude, rad.",
            "83.6 deg",
        ),
        "declination": optional(
            DECLINATION, "Declination of the target axis in the frame of attitude, rad.", "22 deg"
        ),
        "sun_angle": optional(
            APART,
            "Angle of the target axis from the Sun, rad, 0 to 180 deg. The target is the nearest "
            "such axis on the great circle through the Sun and H at t = 0.",
            "109 deg",
        ),
        "spin": optional(RATE, "Spin rate about axis 3 at the end, rad/s, signed.", "31 rpm"),
    },
)


LIMITS = section(
    "LimitsSection",
    "Limits of every schedule.",
    {
        "horizon": optional(
            POSITIVE_TIME, "End of the planning time, s. Default: 20 nutation periods.", "120 s"
        ),
        "earliest": optional(TIME, "Earliest start of a pulse, s; default 0.", "5 s", default=0.0),
        "gap": optional(TIME, "Least time between two pulses, s; default 0.", "0.5 s", default=0.0),
        "tick": optional(
            POSITIVE_TIME, "Resolution of commanded starts and on-times, s. Default: none.", "1 ms"
        ),
        "max_pulses": optional(COUNT, "Largest number of pulses. Default: no limit.", 8),
        "blackout": optional(
            windows(rows(TIME, 2, 2)),
            "Windows [begin, end], s, in which no pulse may be on.",
            [["10 s", "20 s"]],
            default=[],
        ),
    },
)


DISTURBANCE = section(
    "DisturbanceSection",
    "A disturbance torque, in the axes of the file.",
    {
        "name": optional(NAME, "Name of the disturbance, for reports.", "leak"),
        "kind": optional(
            choice("constant", "rotating", "axial"),
            "constant: fixed in the body. rotating: turns about principal axis 3. axial: along "
            "the third axis of the file. Default: rotating if rate or fixed_in is given, else "
            "constant.",
            "rotating",
        ),
        "torque": required(
            or_alone(TORQUES, quantity("torque")),
            "Torque [M1, M2, M3] about the centre of mass, N m. A rotating one: its value at t = "
            "0, with M3 = 0. An axial one: a single number.",
            ["20 mN m", 0, 0],
        ),
        "rate": optional(
            RATE,
            "Rate at which a rotating torque turns about axis 3, as seen in the body, signed, "
            "rad/s.",
            "-3 rad/s",
        ),
        "fixed_in": optional(
            choice("inertial"),
            "inertial: a rotating torque that is nearly fixed in space. Its rate is minus the "
            "spin.",
            "inertial",
        ),
        "from": optional(TIME, "Time after t = 0 at which it begins, s; default 0.", "10 s"),
        "until": optional(
            POSITIVE_TIME, "Time after t = 0 at which it ends, s. Default: it does not end.", "45 s"
        ),
    },
    extra={"oneOf": _KINDS},
)


DISSIPATION = section(
    "DissipationSection",
    "Energy dissipation within the body, by flexible parts or liquids.",
    {
        "time_constant": required(
            POSITIVE_TIME,
            "Time, s, in which the nutation angle grows or decays by the factor e.",
            "600 s",
        ),
        "nutation": optional(
            choice("grows", "decays"),
            "What the nutation does. Default by shape: it grows if A > C, and decays if A < C.",
            "grows",
        ),
    },
)


SPACECRAFT = section(
    "SpacecraftFile",
    "A spinning spacecraft: its inertia, its motion at t = 0, and what it can fire. Bare numbers "
    "are SI.",
    {
        "name": required(NAME, "Name of the spacecraft.", "Sounder-1"),
        "mass": optional(MASS, "Mass, kg. Without it no velocity change is computed.", "250 kg"),
        "inertia": required(
            INERTIA,
            "Moments of inertia: A and C, or tensor, kg m².",
            {"A": "120 kg m^2", "C": "80 kg m^2"},
        ),
        "center_of_mass": optional(
            POSITION,
            "Center of mass, m, in the frame of the positions of thrusters and sensor. Default: "
            "positions count from it.",
            [0, "2 mm", "0.4 m"],
        ),
        "center_of_mass_per_kg": optional(
            rows(quantity("travel"), 3, 3),
            "Move of the center of mass for each kg of propellant used, m/kg. Default: it stays.",
            [0, 0, "-1 mm/kg"],
        ),
        "wheel": optional(
            WHEEL, "A momentum wheel or a despun platform.", {"momentum": "40 N m s"}
        ),
        "omega0": optional(
            rows(RATE, 3, 3),
            "Body rates [ω1, ω2, ω3] at t = 0, rad/s. Or give state.",
            [0.12, "2 deg/s", "30 rpm"],
        ),
        "state": optional(
            STATE,
            "Motion at t = 0 by spin and nutation. Or give omega0.",
            {"spin": "30 rpm", "nutation": "5 deg"},
        ),
        "attitude": optional(
            ATTITUDE,
            "Attitude at t = 0.",
            {"quaternion": [1, 0, 0, 0], "epoch": "2026-03-01T12:00:00Z", "frame": "EME2000"},
        ),
        "object_id": optional(
            NAME,
            "International designator, such as 1998-001A, for messages to flight dynamics.",
            "1998-001A",
        ),
        "orbit": optional(
            ORBIT,
            "Position and velocity at t = 0, for messages to flight dynamics.",
            {"position": ["7000 km", 0, 0], "velocity": [0, "7.5 km/s", 0]},
        ),
        "thrusters": optional(
            rows(THRUSTER),
            "Body-fixed thrusters.",
            [{"name": "T2", "torque": [0, "-8 N m", 0], "isp": "220 s", "lever_arm": "0.8 m"}],
            default=[],
        ),
        "channels": optional(
            named(rows(NAME, 1), 1),
            "Names of thrusters that fire together. Without it each thruster is a channel of its "
            "own.",
            {"+M1": ["T1", "T2"]},
        ),
        "steerable": optional(
            STEERABLE, "A torquer that can push about any transverse axis.", {"torque": "20 N m"}
        ),
        "valve": optional(
            VALVE,
            "How thrust follows a command, for all thrusters that have no valve of their own.",
            {
                "open_delay": "8 ms",
                "close_delay": "12 ms",
                "rise_time": "5 ms",
                "fall_time": "10 ms",
            },
        ),
        "cold": optional(
            COLD,
            "Cold nozzles: the first pulses of each channel are weaker.",
            {"first": "90 %", "pulses": 4},
        ),
        "tank": optional(
            TANK,
            "A blowdown tank: the thrust depends on its pressure.",
            {"propellant": "30 kg", "pressure": "22 bar", "final_pressure": "8 bar"},
        ),
        "disturbances": optional(
            rows(DISTURBANCE),
            "Disturbance torques.",
            [{"name": "leak", "torque": ["20 mN m", 0, 0]}],
            default=[],
        ),
        "dissipation": optional(
            DISSIPATION,
            "Energy dissipation. Without it the body is rigid.",
            {"time_constant": "600 s", "nutation": "grows"},
        ),
        "requirement": optional(REQUIREMENT, "What a plan must reach.", {"nutation": "0.5 deg"}),
        "limits": optional(LIMITS, "Limits that each schedule keeps.", {"horizon": "120 s"}),
        "goal": optional(
            GOAL, "Where spin axis and spin must end.", {"tilt": "10 deg", "azimuth": "45 deg"}
        ),
        "sun": optional(
            or_word("epoch", IN_THE_SKY),
            "Right ascension and declination of the Sun in the frame of attitude, rad. With "
            "epoch nutdamp computes them.",
            "epoch",
            ["120 deg", "10 deg"],
        ),
        "keep": optional(
            rows(KEEP),
            "Cones that the spin axis must keep on its way to a target.",
            [{"name": "Sun", "direction": "sun", "min": "4 deg", "max": "20 deg"}],
            default=[],
        ),
        "sun_sensor": optional(
            SUN_SENSOR, "The sensor whose pulse fires command blocks.", {"azimuth": "35 deg"}
        ),
        "commands": optional(
            COMMANDS,
            "Command blocks: pulses that the Sun pulse fires.",
            {
                "delay_step": "2 ms",
                "delay_max": "1.9 s",
                "width": {"step": "1 ms", "min": "20 ms", "max": "500 ms"},
            },
        ),
        "loop": optional(
            LOOP,
            "A closed loop that damps by what a sensor shows.",
            {"sensor": {"kind": "gyro", "rate": "100 Hz"}, "start": "0.5 deg", "stop": "0.05 deg"},
        ),
        "dispersions": optional(
            DISPERSIONS,
            "How much the real spacecraft may differ from the values of the file.",
            {"A": {"normal": "2 %"}},
        ),
    },
    extra={"oneOf": [_needs("omega0", without=("state",)), _needs("state", without=("omega0",))]},
)
