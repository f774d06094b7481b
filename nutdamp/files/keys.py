"""Declaration of the spacecraft file: its keys, their units and ranges, and what explains them.

Reader, rules, JSON Schema, guide and ``--set`` all go by it. Constraints between several keys are
in `rules`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from nutdamp.files.fields import (
    A_LIST,
    A_MAPPING,
    NAME,
    RIGHT_ANGLE,
    Finding,
    Key,
    ValueKind,
    Values,
    choice,
    chosen,
    flag,
    mismatch,
    named,
    named_kind,
    quantity,
    row,
    rows,
    section,
    sections,
    text,
    turned,
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
        kind: Key(size(kind, quantity), f"{what}, in its unit or in %.", (example,))
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
    return ValueKind(read, schema, form=form, keys=keys, about=about)


def tolerance_key(kind: str, each: str, text: str, example: dict[str, str]) -> Key:
    """Key of a tolerance of a ``kind`` of quantity: one for all three axes, or all thrusters, or
    those of ``each``: a list by axis, or a mapping by thruster.
    """
    single = tolerance_of(kind)
    several = rows(single, 3, 3) if each == "axis" else named(single, 1)
    alone = turned(single, lambda size: [size] * 3 if each == "axis" else {ALL: size})

    def choose(node: Node) -> ValueKind | None:
        if isinstance(node.value, dict) and not (each == "thruster" and by_name(node)):
            return alone
        return several if each == "thruster" or isinstance(node.value, list) else None

    if each:
        schema = {"anyOf": [single.schema, several.schema]}
        single = chosen(choose, f"{A_LIST} or {A_MAPPING}", schema, single)
    return Key(single, text, tuple(f"{{{by}: {size}}}" for by, size in example.items()))


DECLARED = {field.name: field.metadata for field in fields(Dispersions) if field.metadata}
BY_THRUSTER = tuple(name for name, key in DECLARED.items() if key["each"] == "thruster")


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


def or_word(word: str, direction: ValueKind) -> ValueKind:
    """A direction in the sky that may be written as one ``word`` instead."""
    alone = ValueKind(lambda *_: word, {"const": word})

    def choose(node: Node) -> ValueKind | None:
        if node.value == word:
            return alone
        return direction if isinstance(node.value, list) else None

    schema = {"anyOf": [direction.schema, alone.schema]}
    return chosen(choose, f"{word} or [right ascension, declination]", schema, direction)


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

TIME, PRESSURE = quantity("time", exclusiveMinimum=0), quantity("pressure", exclusiveMinimum=0)
COUNT = whole(1, 1_000_000)
SKY = row(quantity("right ascension"), named_kind("angle >= -90 deg <= 90 deg", {}))
SHARE, RATE = quantity("ratio", exclusiveMinimum=0), quantity("rate", exclusiveMinimum=0)
CORRELATION = quantity("ratio", exclusiveMinimum=-1, exclusiveMaximum=1)
TORQUE, TORQUES = quantity("torque"), rows(quantity("torque"), 3, 3)
AXIAL = turned(TORQUE, lambda torque: [0.0, 0.0, torque])
OTHERS = {
    "name": NAME,
    "flag": flag(),
    "date": date_and_time(),
    "count": COUNT,
    "counts": rows(COUNT, 1),
    "one or two": whole(1, 2),
    "inertial": choice("inertial"),
    "times": rows(TIME, 1),
    "windows": windows(named_kind("2 of time >= 0", {})),
    "sky": SKY,
    "sky or sun": or_word("sun", SKY),
    "sky or epoch": or_word("epoch", SKY),
    "reading": sensor_quantity(),
    "reading >= 0": sensor_quantity(minimum=0),
    "channels": named(rows(NAME, 1), 1),
    "impulse bits": rows(row(TIME, quantity("impulse", exclusiveMinimum=0), TIME), 2),
    "isp by pressure": rows(row(PRESSURE, TIME), 2),
    # a torque about axis 3 may be written as a single one
    "torques": chosen(
        lambda node: TORQUES if isinstance(node.value, list) else AXIAL,
        "",
        {"anyOf": [TORQUES.schema, *TORQUE.schema["anyOf"]]},
        TORQUES,
    ),
    # a tolerance of a rate is a share of its goal, in %, or a rate
    "share or rate": chosen(
        lambda node: (
            turned(SHARE, lambda share: SpinTolerance(share, relative=True))
            if isinstance(node.value, str) and node.value.rstrip().endswith("%")
            else turned(RATE, lambda rate: SpinTolerance(rate, relative=False))
        ),
        "",
        {"anyOf": [*RATE.schema["anyOf"], unit_text("ratio")]},
    ),
    "Dispersions": section(
        "DispersionsSection",
        "Tolerances: {normal: one sigma}, {uniform: half width}, {triangular: half width} or "
        "{bias: fixed offset}.",
        {
            **{name: tolerance_key(**declared) for name, declared in DECLARED.items()},
            "correlation": Key(
                rows(row(text(), text(), CORRELATION)),
                "Pairs of inputs that vary together, named as in disperse --json, and their "
                "correlation, -1 to 1. For uniform and triangular inputs it is that of underlying "
                "normals (Gaussian copula).",
                ("[[A, C, 0.99]]",),
                default=[],
            ),
        },
    ),
}
"""Kinds of values that the table of keys names, besides those of `fields.named_kind`."""


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

EXTRA: dict[str, dict[str, Any]] = {
    "InertiaSection": {
        "oneOf": [_needs("A", "C", without=("tensor",)), _needs("tensor", without=("A", "C"))]
    },
    "AttitudeSection": {
        "oneOf": [
            _needs("quaternion", without=("spin_axis", "phase", "sun_phase", "of")),
            _needs("spin_axis", without=("quaternion",)),
        ]
    },
    "ThrusterSection": {
        "oneOf": [
            _needs("position", "direction", "force", without=("torque", "lever_arm")),
            _needs("torque", without=("position", "direction", "force")),
        ]
    },
    "DisturbanceSection": {"oneOf": _KINDS},
    "SpacecraftFile": {
        "oneOf": [_needs("omega0", without=("state",)), _needs("state", without=("omega0",))]
    },
}
"""Further keywords of the schemas of sections."""

SECTIONS = sections(
    """
LoopSensorSection
Sensor of the loop: two rate gyros about axes 1 and 2, or an accelerometer.
kind!: gyro | accelerometer, e.g. gyro
    gyro: shows ω1 and ω2. accelerometer: shows the acceleration at position along axis.
axes = file: file | principal, e.g. principal
    Axes about which gyros measure. file (default): those of the file, where a tilted principal
    axis shows as a rate. principal: those of gyros calibrated to the principal axes.
rate: frequency > 0, e.g. 100 Hz
    Samples a second, Hz. Default: a continuous signal.
quantisation = 0: reading >= 0, e.g. 0.002 deg/s
    Step of a sample, rad/s; of an accelerometer m/s². Default 0.
noise = 0: reading >= 0, e.g. 0.01 deg/s
    One sigma of the noise of a sample, rad/s; of an accelerometer m/s². Default 0.
bias = 0: reading, e.g. 0.02 deg/s
    What a signal shows without motion, rad/s; of an accelerometer m/s². Default 0.
scale = 100 %: ratio, e.g. 101 %
    Signal divided by truth; default 100 %. A reversed sensor has -100 %.
delay = 0: time >= 0, e.g. 20 ms
    Time until a sample reaches the valves, s; default 0.
low_pass = 0: time >= 0, e.g. 50 ms
    Time constant of a first-order low-pass filter over the samples, s; default 0: none.
position: 3 of length, e.g. [0.8 m, 0, 0]
    Place of an accelerometer, m, from the center of mass or as center_of_mass says.
axis: 3 of number, e.g. [0, 0, 1]
    Direction in which an accelerometer measures, any length but zero; default [0, 0, 1].

LoopFaultsSection
Faults that the loop is flown with, and that it does not know.
reversed = []: list of name, e.g. [+M1]
    Channels that push the other way when fired.

LoopSection
A closed loop, for `nutdamp loop`: it fires when the sensor shows start, until it shows stop.
sensor!: LoopSensor, e.g. {kind: gyro, rate: 100 Hz, noise: 0.01 deg/s}
    The sensor.
law = four-pulse: four-pulse | one-pulse | bang, e.g. four-pulse
    four-pulse (default): each channel that comes into line fires as long as needed, at most
    on_time. one-pulse: the same, at most half a nutation period. bang: each fires for on_time.
start!: angle > 0 < 90 deg, e.g. 0.5 deg
    Nutation angle at which the loop begins to fire, rad; above stop.
stop = 0: angle >= 0 < 90 deg, e.g. 0.05 deg
    Nutation angle at which it stops, rad; default 0.
settle = 0: time >= 0, e.g. 0.2 s
    Time after a firing in which samples are ignored, s; default 0.
min_interval = 0: time >= 0, e.g. 0.5 s
    Least time from one firing to the next, s; default 0.
predict = true: flag, e.g. true
    true (default): firings are centred on their moments, with delay, filter and half the
    on-time compensated.
alias = false: flag, e.g. true
    true: fewer than four samples in a nutation period are intended; default false.
on_time: time > 0, e.g. 50 ms
    On-time of bang, and longest on-time of four-pulse, s. Default of four-pulse: an eighth of
    the nutation period, within min_on_time and max_on_time.
faults: LoopFaults, e.g. {reversed: [+M1]}
    Faults to fly with, default none.

OrbitSection
Position and velocity at attitude.epoch, in attitude.frame. They are for messages to flight
dynamics.
position!: 3 of length, e.g. [7000 km, 0, 0]
    Position from the center, m.
velocity!: 3 of speed, e.g. [0, 7.5 km/s, 0]
    Velocity, m/s.
center = EARTH: name, e.g. EARTH
    Body at the origin; default EARTH.

WheelSection
A part that spins relative to the body: a momentum wheel, or a despun platform.
momentum!: momentum, e.g. 40 N m s
    Its constant angular momentum along principal axis 3, signed, N m s. It adds to the C ω3 of
    the rest.

SunSensorSection
A sensor that gives a pulse once a spin, when it sees the Sun.
azimuth!: angle, e.g. 35 deg
    Azimuth in the body at which the Sun pulse comes, rad, about axis 3 from axis 1.
elevation = 0: angle >= -90 deg <= 90 deg, e.g. 45 deg
    Middle of its view, rad, from the plane square to axis 3 towards the spin axis; default 0.
half_width = 90 deg: angle >= 0 <= 180 deg, e.g. 45 deg
    Largest angle from there at which it sees the Sun, rad. Default: 90 deg, which is always.
jitter = 0: time >= 0, e.g. 0.5 ms
    One sigma of the times of its pulses, s; default 0.

WidthSection
Widths of pulses that can be commanded: min, min + step, … up to max.
step!: time > 0, e.g. 1 ms
    Resolution of the width, s.
min!: time > 0, e.g. 20 ms
    Shortest width, s.
max!: time > 0, e.g. 500 ms
    Longest width, s.

CommandsSection
Contents of a command block: a number of pulses of one channel, fired by the Sun pulse.
delay_step!: time > 0, e.g. 2 ms
    Resolution of the delay after the Sun pulse, s.
delay_max!: time > 0, e.g. 1.9 s
    Longest delay, s. At most one spin turn of it is used.
width!: times or Width, e.g. {step: 1 ms, min: 20 ms, max: 500 ms} or [0.1 s, 0.2 s]
    Widths that can be commanded, s: a list, or step, min and max.
max_count = 255: count, e.g. 255
    Largest number of pulses of a block; default 255.
every = [1]: counts, e.g. [1, 2]
    Choices of the number of spins from one pulse to the next; default [1].
per_turn = 1: one or two, e.g. 2
    Number of blocks that may fire in the same turns, without overlap; default 1. With 2, prefer
    delay_is: angle, which keeps opposite pulses apart while the spin changes.
delay_is = time: time | angle, e.g. angle
    How a delay counts. time (default): seconds after the Sun pulse. angle: turn of the Sun
    since its pulse.

KeepSection
A cone about a direction in space. The spin axis must not enter it (min), or must not leave it
(max). Nutation counts.
name!: name, e.g. Earth
    Name of the cone, for reports.
direction!: sky or sun, e.g. sun or [120 deg, 10 deg]
    Right ascension and declination in the frame of attitude, rad. Or sun.
min: angle >= 0 <= 180 deg, e.g. 4 deg
    Smallest angle to the spin axis, rad; default 0.
max: angle >= 0 <= 180 deg, e.g. 20 deg
    Largest angle to the spin axis, rad; default 180 deg.

ValveSection
A valve: thrust begins after the command, then rises and falls evenly.
open_delay = 0: time >= 0, e.g. 8 ms
    From the start of the command to the first thrust, s; default 0.
close_delay = 0: time >= 0, e.g. 12 ms
    From the end of the command until the thrust begins to fall, s; default 0.
rise_time = 0: time >= 0, e.g. 5 ms
    From the first thrust to full thrust, s; default 0.
fall_time = 0: time >= 0, e.g. 10 ms
    From full thrust to none, s; default 0.
on_time_is = command: command | effective, e.g. command
    Meaning of a commanded on-time. command (default): the length of the command. effective:
    impulse over full thrust, which the valve electronics turns into a command.

ShedSection
Share of the propellant in the tank in the moments of inertia.
A!: shed >= 0, e.g. 0.4 kg m^2/kg
    Decrease of the transverse moment for each kg used, kg m²/kg.
C!: shed >= 0, e.g. 0.6 kg m^2/kg
    Decrease of the moment about axis 3 for each kg used, kg m²/kg.

TankSection
A blowdown tank: pressure and thrust fall as propellant is used and the gas expands.
propellant!: mass > 0, e.g. 30 kg
    Propellant in it at t = 0, kg.
pressure!: pressure > 0, e.g. 22 bar
    Pressure at t = 0, Pa.
final_pressure!: pressure > 0, e.g. 8 bar
    Pressure when the propellant is used up, Pa.
exponent = 1: number >= 0, e.g. 1
    Exponent n of thrust ~ pressure^n; default 1.
isp: isp by pressure, e.g. [[8 bar, 215 s], [22 bar, 228 s]]
    Rows of pressure, Pa, rising, and specific impulse, s, in place of that of the thrusters.
    Values between rows are interpolated. Below the first row its value holds.
inertia_per_kg: 3 of shed >= 0 or Shed, e.g. {A: 0.4 kg m^2/kg, C: 0.6 kg m^2/kg}
    Decrease of the moments of inertia for each kg used, kg m²/kg. Give A and C, or the three
    principal moments, the one about axis 3 last. Default: they stay.

ColdSection
Cold nozzles: the first pulses of each channel are weaker.
first!: ratio > 0, e.g. 90 %
    Thrust of the first pulse of a channel, as a share of that of a warm one.
pulses!: number > 0, e.g. 4
    Number of pulses in which the difference from a warm one falls by the factor e.

InertiaSection
Moments of inertia about the centre of mass: A and C, or the whole tensor.
A: inertia > 0, e.g. 120 kg m^2
    Transverse moment of inertia, kg m².
C: inertia > 0, e.g. 80 kg m^2
    Moment of inertia about the spin axis 3, kg m²; at most 2 A.
tensor: 3 of 3 of inertia, e.g. [[120, 0.5, 0], [0.5, 118, 0], [0, 0, 80]]
    Inertia tensor, 3 rows of 3, kg m². Entries off the diagonal are minus the products of
    inertia: row 1, column 2 is -IXY, with IXY the sum of m x y as in CCSDS messages. Axis 3 is
    the principal axis nearest the file's third axis.

StateSection
The motion at t = 0 by spin and nutation angle.
spin!: rate, e.g. 30 rpm
    Spin rate about axis 3, signed, rad/s. Zero only with a wheel.
nutation!: angle >= 0 < 90 deg, e.g. 5 deg
    Nutation angle between H and spin axis at t = 0, rad, from 0 to below 90 deg.
phase = 0: angle, e.g. 20 deg
    Direction of the transverse rate, arg(ω1 + i ω2), rad; default 0.

AttitudeSection
Attitude at t = 0. Without it results refer to the frame with z along H.
quaternion: 4 of number, e.g. [1, 0, 0, 0]
    Rotation from body to frame, scalar first. It is normalised when read.
spin_axis: sky, e.g. [120 deg, -15 deg]
    Right ascension and declination of the spin axis, rad, in place of quaternion. See phase.
phase: angle, e.g. 20 deg
    Angle about spin_axis from its ascending node to body axis 1, rad; default 0. The ascending
    node is z of the frame × spin axis; at a pole it is x of the frame.
sun_phase: angle, e.g. 35 deg
    Angle about spin_axis from the side of the Sun to body axis 1, rad, in place of phase. It
    needs sun.
of: axis | momentum, e.g. momentum
    The vector whose direction spin_axis and phase give: the spin axis itself (default), or the
    angular momentum.
epoch: date, e.g. 2026-03-01T12:00:00Z
    Date and time of t = 0, ISO 8601, from 1972 to 9999. Without a zone it is UTC.
frame: EME2000 | J2000 | GCRF | ECLIPJ2000 | ECLIPDATE | MOD, e.g. EME2000
    Inertial frame of the attitude and of all directions of the file. In a frame of the
    ecliptic, right ascension and declination are longitude and latitude.

ThrusterSection
A thruster: position, direction and force, or only its torque.
name!: name, e.g. T1
    Name of the thruster, for channels and schedules.
position: 3 of length, e.g. [0, 0.5 m, 0.8 m]
    Point where the force acts, m, from the center of mass or as center_of_mass says.
direction: 3 of number, e.g. [1, 0, 0]
    Direction of the force on the spacecraft, against the plume. Any length but zero.
force: force > 0, e.g. 10 N
    Thrust, N.
torque: 3 of torque, e.g. [0, -8 N m, 0]
    Torque about the centre of mass, N m, in place of position, direction and force.
lever_arm: length > 0, e.g. 0.8 m
    Lever arm, m. With a torque it gives the thrust, for the propellant.
isp: time > 0, e.g. 220 s
    Specific impulse, s, for the propellant.
min_on_time = 0: time >= 0, e.g. 20 ms
    Shortest firing, s; default 0.
max_on_time: time > 0, e.g. 2 s
    Longest firing, s. Default: no limit.
valve: Valve, e.g. {open_delay: 8 ms, close_delay: 12 ms}
    How the thrust follows a command. Default: as the valve of the file, or full thrust at once.
impulse_bit: impulse bits, e.g. [[20 ms, 0.15 N s, 16 ms], [100 ms, 0.95 N s, 58 ms]]
    Table from tests, in place of valve. Each row has on-time, s, impulse, N s, and the time of
    its centroid after the start of the command, s.

SteerableSection
A torquer for any transverse axis. It is fixed in the body during a pulse.
torque: torque > 0, e.g. 20 N m
    Torque, N m. Without it its impulses are ideal and take no time.
isp: time > 0, e.g. 220 s
    Specific impulse, s, for the propellant.
lever_arm: length > 0, e.g. 1 m
    Lever arm, m, for the propellant.

RequirementSection
Requirement on the end of a plan.
nutation: angle > 0 < 90 deg, e.g. 0.5 deg
    Largest nutation angle, rad, above 0 and below 90 deg.
momentum_shift: angle > 0 < 90 deg, e.g. 0.2 deg
    Largest turn of H from t = 0, rad, above 0 and below 90 deg. With a target give pointing.
pointing: angle > 0 < 90 deg, e.g. 0.2 deg
    Largest angle of H from the target of goal, rad, above 0 and below 90 deg.
nutation_during: angle > 0 < 90 deg, e.g. 2 deg
    Largest nutation angle on the way, rad, above 0 and below 90 deg. It is a cone of the spin
    axis about H. For other cones see keep.
spin: share or rate, e.g. 0.5 %
    Tolerance of the spin at the end about goal.spin or --spin, rad/s or % of it; default 1 %.
probability: ratio > 0 < 1, e.g. 99.7 %
    Share of dispersed flights that must meet it, above 0 and below 1 (or in %).

GoalSection
End of the motion. Without it H stays where it is, and the spin may change.
tilt: angle >= 0 < 180 deg, e.g. 10 deg
    Angle of the target axis from H at t = 0, rad, below 180 deg.
azimuth: angle, e.g. 45 deg
    Azimuth of the target axis about H, rad, from the initial tilt direction of the spin axis.
right_ascension: right ascension, e.g. 83.6 deg
    Right ascension of the target axis in the frame of attitude, rad.
declination: angle >= -90 deg <= 90 deg, e.g. 22 deg
    Declination of the target axis in the frame of attitude, rad.
sun_angle: angle >= 0 <= 180 deg, e.g. 109 deg
    Angle of the target axis from the Sun, rad, 0 to 180 deg. The target is the nearest such
    axis on the great circle through the Sun and H at t = 0.
spin: rate, e.g. 31 rpm
    Spin rate about axis 3 at the end, rad/s, signed.

LimitsSection
Limits of every schedule.
horizon: time > 0, e.g. 120 s
    End of the planning time, s. Default: 20 nutation periods.
earliest = 0: time >= 0, e.g. 5 s
    Earliest start of a pulse, s; default 0.
gap = 0: time >= 0, e.g. 0.5 s
    Least time between two pulses, s; default 0.
tick: time > 0, e.g. 1 ms
    Resolution of commanded starts and on-times, s. Default: none.
max_pulses: count, e.g. 8
    Largest number of pulses. Default: no limit.
blackout = []: windows, e.g. [[10 s, 20 s]]
    Windows [begin, end], s, in which no pulse may be on.

DisturbanceSection
A disturbance torque, in the axes of the file.
name: name, e.g. leak
    Name of the disturbance, for reports.
kind: constant | rotating | axial, e.g. rotating
    constant: fixed in the body. rotating: turns about principal axis 3. axial: along the third
    axis of the file. Default: rotating if rate or fixed_in is given, else constant.
torque!: torques, e.g. [20 mN m, 0, 0]
    Torque [M1, M2, M3] about the centre of mass, N m. A rotating one: its value at t = 0, with
    M3 = 0. An axial one: a single number.
rate: rate, e.g. -3 rad/s
    Rate at which a rotating torque turns about axis 3, as seen in the body, signed, rad/s.
fixed_in: inertial, e.g. inertial
    inertial: a rotating torque that is nearly fixed in space. Its rate is minus the spin.
from: time >= 0, e.g. 10 s
    Time after t = 0 at which it begins, s; default 0.
until: time > 0, e.g. 45 s
    Time after t = 0 at which it ends, s. Default: it does not end.

DissipationSection
Energy dissipation within the body, by flexible parts or liquids.
time_constant!: time > 0, e.g. 600 s
    Time, s, in which the nutation angle grows or decays by the factor e.
nutation: grows | decays, e.g. grows
    What the nutation does. Default by shape: it grows if A > C, and decays if A < C.

SpacecraftFile
A spinning spacecraft: its inertia, its motion at t = 0, and what it can fire. Bare numbers are
SI.
name!: name, e.g. Sounder-1
    Name of the spacecraft.
mass: mass > 0, e.g. 250 kg
    Mass, kg. Without it no velocity change is computed.
inertia!: Inertia, e.g. {A: 120 kg m^2, C: 80 kg m^2}
    Moments of inertia: A and C, or tensor, kg m².
center_of_mass: 3 of length, e.g. [0, 2 mm, 0.4 m]
    Center of mass, m, in the frame of the positions of thrusters and sensor. Default: positions
    count from it.
center_of_mass_per_kg: 3 of travel, e.g. [0, 0, -1 mm/kg]
    Move of the center of mass for each kg of propellant used, m/kg. Default: it stays.
wheel: Wheel, e.g. {momentum: 40 N m s}
    A momentum wheel or a despun platform.
omega0: 3 of rate, e.g. [0.12, 2 deg/s, 30 rpm]
    Body rates [ω1, ω2, ω3] at t = 0, rad/s. Or give state.
state: State, e.g. {spin: 30 rpm, nutation: 5 deg}
    Motion at t = 0 by spin and nutation. Or give omega0.
attitude: Attitude, e.g. {quaternion: [1, 0, 0, 0], epoch: 2026-03-01T12:00:00Z, frame: EME2000}
    Attitude at t = 0.
object_id: name, e.g. 1998-001A
    International designator, such as 1998-001A, for messages to flight dynamics.
orbit: Orbit, e.g. {position: [7000 km, 0, 0], velocity: [0, 7.5 km/s, 0]}
    Position and velocity at t = 0, for messages to flight dynamics.
thrusters = []: list of Thruster, e.g. [{name: T2, torque: [0, -8 N m, 0], isp: 220 s, lever_arm:
        0.8 m}]
    Body-fixed thrusters.
channels: channels, e.g. {+M1: [T1, T2]}
    Names of thrusters that fire together. Without it each thruster is a channel of its own.
steerable: Steerable, e.g. {torque: 20 N m}
    A torquer that can push about any transverse axis.
valve: Valve, e.g. {open_delay: 8 ms, close_delay: 12 ms, rise_time: 5 ms, fall_time: 10 ms}
    How thrust follows a command, for all thrusters that have no valve of their own.
cold: Cold, e.g. {first: 90 %, pulses: 4}
    Cold nozzles: the first pulses of each channel are weaker.
tank: Tank, e.g. {propellant: 30 kg, pressure: 22 bar, final_pressure: 8 bar}
    A blowdown tank: the thrust depends on its pressure.
disturbances = []: list of Disturbance, e.g. [{name: leak, torque: [20 mN m, 0, 0]}]
    Disturbance torques.
dissipation: Dissipation, e.g. {time_constant: 600 s, nutation: grows}
    Energy dissipation. Without it the body is rigid.
requirement: Requirement, e.g. {nutation: 0.5 deg}
    What a plan must reach.
limits: Limits, e.g. {horizon: 120 s}
    Limits that each schedule keeps.
goal: Goal, e.g. {tilt: 10 deg, azimuth: 45 deg}
    Where spin axis and spin must end.
sun: sky or epoch, e.g. epoch or [120 deg, 10 deg]
    Right ascension and declination of the Sun in the frame of attitude, rad. With epoch nutdamp
    computes them.
keep = []: list of Keep, e.g. [{name: Sun, direction: sun, min: 4 deg, max: 20 deg}]
    Cones that the spin axis must keep on its way to a target.
sun_sensor: SunSensor, e.g. {azimuth: 35 deg}
    The sensor whose pulse fires command blocks.
commands: Commands, e.g. {delay_step: 2 ms, delay_max: 1.9 s, width: {step: 1 ms, min: 20 ms, max:
        500 ms}}
    Command blocks: pulses that the Sun pulse fires.
loop: Loop, e.g. {sensor: {kind: gyro, rate: 100 Hz}, start: 0.5 deg, stop: 0.05 deg}
    A closed loop that damps by what a sensor shows.
dispersions: Dispersions, e.g. {A: {normal: 2 %}}
    How much the real spacecraft may differ from the values of the file.
""",
    OTHERS,
    EXTRA,
)
SPACECRAFT = SECTIONS["SpacecraftFile"]
