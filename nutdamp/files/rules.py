"""Constraints between the keys of a spacecraft file: a table, and what body and motion need; and
warnings of numbers that probably lack a unit.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from nutdamp.errors import cure_of, span
from nutdamp.files.facts import (
    CANCELLED,
    Facts,
    Finding,
    Vector,
    force_vector,
    moments_fault,
    symmetric,
    tensor_fault,
)
from nutdamp.files.fields import SMALLEST, KeyPath
from nutdamp.files.keys import BY_THRUSTER, VALVE_TIMES, by_name
from nutdamp.files.yaml import dotted
from nutdamp.physics import body as rigid_body
from nutdamp.spacecraft.model import Spacecraft
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.spacecraft.tolerances import KINDS as DISTRIBUTIONS
from nutdamp.units import FASTEST, KINDS, bar, reading, shown

KEEP = "keep one of the two"
SKY = "[right ascension, declination]"
OF_DATE = ", the date of its equinox; or take ECLIPJ2000 or EME2000"
SUN = f": {SKY}, or sun: epoch"
POINTING = ", which says where the body points at t = 0"
SAMPLED = ", such as rate: 100 Hz: it applies to samples"
SENSED = ", whose sensor it is of"
MOUNTING = ".position .direction .force"
COMPONENT = "expected at least one component other than 0"
TURNING = "only a rotating torque turns"
EVERYWHERE = "a gyro measures the same everywhere"
RESERVED = f"the name {STEERABLE!r} is reserved for the steerable torquer; use another"

RULES = (
    # Path; kind of rule; other keys (those beside it begin with a dot; | is or; =value only with
    # that value), or the kind of quantity; the cure.
    ("omega0", "missing", ".state", "give omega0: [ω1, ω2, ω3], or state: {spin: …, nutation: …}"),
    ("state", "beside", ".omega0", KEEP),
    ("inertia.A", "missing", ".tensor", "the transverse moment of inertia, in kg m^2"),
    ("inertia.C", "missing", ".tensor", "the axial moment of inertia, in kg m^2"),
    ("inertia.tensor", "beside", ".A .C", "keep either tensor, or A and C"),
    (
        "attitude.quaternion",
        "missing",
        ".spin_axis",
        f"turn from body to frame, scalar first, or spin_axis: {SKY}",
    ),
    ("attitude.quaternion", "not zero", "number", "expected a rotation, such as [1, 0, 0, 0]"),
    ("attitude.spin_axis", "beside", ".quaternion", KEEP),
    ("attitude.of", "beside", ".quaternion", KEEP),
    ("attitude.phase", "beside", ".quaternion", KEEP),
    ("attitude.sun_phase", "beside", ".quaternion .phase", KEEP),
    ("attitude.sun_phase", "needs", "sun", SUN),
    ("attitude.frame=ECLIPDATE", "needs", ".epoch", OF_DATE),
    ("attitude.frame=MOD", "needs", ".epoch", OF_DATE),
    ("sun", "needs", "attitude", POINTING),
    ("sun=epoch", "needs", "attitude.epoch", f", the date of t = 0; or give {SKY}"),
    ("sun_sensor", "needs", "sun", SUN),
    ("commands", "needs", "sun_sensor", ", whose pulse fires the blocks"),
    ("commands.width.min", "at most", ".max", "time"),
    (
        "orbit",
        "needs",
        "attitude.epoch attitude.frame",
        ", which give time and axes of the position",
    ),
    (
        "orbit.position",
        "not zero",
        "length",
        "expected the position of the spacecraft relative to center",
    ),
    ("keep", "once", "name", "take another"),
    ("keep.*.direction", "needs", "attitude", POINTING),
    ("keep.*.direction=sun", "needs", "sun", SUN),
    ("keep.*.min", "missing", ".max", "give min, max or both; without them the cone has no effect"),
    ("keep.*.min", "at most", ".max", "angle"),
    (
        "goal.tilt",
        "beside",
        ".right_ascension .declination",
        "keep tilt and azimuth, or the other pair",
    ),
    ("goal.tilt", "completes", ".azimuth", "names no direction"),
    ("goal.declination", "completes", ".right_ascension", "names no direction"),
    ("goal.right_ascension", "completes", ".declination", "names no direction"),
    ("goal.right_ascension", "needs", "attitude", f"{POINTING}; without it give tilt and azimuth"),
    (
        "goal.sun_angle",
        "beside",
        ".tilt .azimuth .right_ascension .declination",
        "keep one target",
    ),
    ("goal.sun_angle", "needs", "sun", SUN),
    ("goal.spin", "not zero", "rate", "expected a rate about axis 3"),
    (
        "requirement.probability",
        "needs",
        ".nutation|.momentum_shift|.pointing|.spin",
        ": this is a share of it",
    ),
    (
        "requirement.pointing",
        "beside",
        ".momentum_shift",
        "pointing counts from the target, momentum_shift from t = 0; keep one of the two",
    ),
    ("limits.earliest", "below", ".horizon", "time"),
    ("limits.blackout.*.0", "at most", ".1", "time"),
    ("disturbances", "once", "name", "take another"),
    ("disturbances.*.torque", "not zero", "torque", COMPONENT),
    ("disturbances.*.rate", "not zero", "rate", "leave rate out for a torque fixed in the body"),
    ("disturbances.*.rate", "beside", ".kind=constant .kind=axial", TURNING),
    ("disturbances.*.fixed_in", "beside", ".kind=constant .kind=axial .rate", KEEP),
    ("disturbances.*.from", "below", ".until", "time"),
    ("disturbances.*.kind=rotating", "needs", ".rate|.fixed_in", ", the rate seen in the body"),
    ("thrusters", "once", "name", "take another"),
    ("thrusters.*.name=steerable", "wrong", "", RESERVED),
    ("thrusters.*.torque", "missing", MOUNTING, "give torque, or position, direction and force"),
    ("thrusters.*.torque", "beside", MOUNTING, "keep torque, or position, direction and force"),
    ("thrusters.*.torque", "not zero", "torque", COMPONENT),
    ("thrusters.*.position", "completes", ".direction .force", "cannot give a torque"),
    ("thrusters.*.direction", "completes", ".position .force", "cannot give a torque"),
    ("thrusters.*.force", "completes", ".position .direction", "cannot give a torque"),
    ("thrusters.*.direction", "not zero", "number", "expected a direction, such as [1, 0, 0]"),
    ("thrusters.*.lever_arm", "beside", ".position", "leave it out: position gives the arm"),
    ("thrusters.*.min_on_time", "at most", ".max_on_time", "time"),
    ("thrusters.*.impulse_bit", "beside", ".valve", KEEP),
    ("thrusters.*.impulse_bit", "needs", ".force|.lever_arm", ", which tells the thrust"),
    ("thrusters.*.impulse_bit", "rising", "time impulse time", "expected rows that rise"),
    ("channels.steerable", "wrong", "", RESERVED),
    ("channels.*", "once", "", "expected once in a channel"),
    ("channels.*.*", "named", "thruster", ""),
    ("valve", "needs", "thrusters", ", which it belongs to"),
    ("cold", "needs", "thrusters", ", whose nozzles are meant"),
    ("tank", "needs", "thrusters", ", which it feeds"),
    ("tank.final_pressure", "at most", ".pressure", "pressure"),
    ("tank.propellant", "below", "mass", "mass"),
    ("tank.isp", "rising", "pressure", "expected rows that rise"),
    ("loop", "needs", "thrusters", ", which it fires"),
    ("loop.stop", "below", ".start", "angle"),
    ("loop.law=bang", "needs", ".on_time", ", the length of its pulses"),
    ("loop.on_time", "beside", ".law=one-pulse", "one-pulse fires as long as needed"),
    ("loop.sensor.kind=accelerometer", "needs", ".rate", ": a sine is fitted to its samples"),
    ("loop.sensor.kind=accelerometer", "needs", ".position", ", from the centre of mass"),
    ("loop.sensor.position", "beside", ".kind=gyro", EVERYWHERE),
    ("loop.sensor.axis", "beside", ".kind=gyro", EVERYWHERE),
    ("loop.sensor.axes", "beside", ".kind=accelerometer", "it measures along axis"),
    ("loop.sensor.noise", "needs", ".rate", SAMPLED),
    ("loop.sensor.quantisation", "needs", ".rate", SAMPLED),
    ("loop.sensor.low_pass", "needs", ".rate", SAMPLED),
    ("loop.sensor.noise", "sensed", "", ""),
    ("loop.sensor.bias", "sensed", "", ""),
    ("loop.sensor.quantisation", "sensed", "", ""),
    ("loop.sensor.axis", "not zero", "number", "expected a direction, such as [0, 0, 1]"),
    (
        "loop.sensor.scale",
        "not zero",
        "ratio",
        "the sensor would show nothing; expected about 100 %",
    ),
    ("loop.faults.reversed", "once", "", "expected each channel once"),
    ("loop.faults.reversed.*", "named", "channel", ""),
    ("dispersions.inertia_tensor", "beside", ".A .C", "keep the tensor, or A and C"),
    (
        "dispersions.inertia_tensor",
        "beside",
        "wheel",
        "the wheel is along principal axis 3, which would move; give A and C instead",
    ),
    ("dispersions.sensor_bias", "needs", "loop", SENSED),
    ("dispersions.sensor_bias.*", "sensed", "", ""),
    ("dispersions.sensor_scale", "needs", "loop", SENSED),
    ("dispersions.sensor_noise", "needs", "loop", SENSED),
    ("dispersions.sensor_delay", "needs", "loop", SENSED),
)


def _place(path: KeyPath, other: str) -> KeyPath:
    """Path of another key in a row of the table."""
    if not other.startswith("."):
        return tuple(other.split("."))
    return (*path[:-1], int(other[1:]) if other[1:].isdigit() else other[1:])


def _holds(facts: Facts, path: KeyPath, other: str) -> bool:
    """True where another key in a row of the table is there, or has the value."""
    key, _, value = other.partition("=")
    place = _place(path, key)
    return facts.text(*place) == value if value else facts.has(*place)


def _words(others: list[str]) -> str:
    """The other keys in a row: ``position and force``, ``kind: gyro``, ``rate or fixed_in``."""
    alone = " and ".join(other.removeprefix(".") for other in others)
    return alone.replace("|.", " or ").replace("=", ": ")


def _beside(facts: Facts, path: KeyPath, others: str, cure: str) -> Iterator[Finding]:
    present = [other for other in others.split() if _holds(facts, path, other)]
    if present and facts.has(*path):
        yield Finding(path, f"given together with {_words(present)}; {cure}", True)


def _needs(facts: Facts, path: KeyPath, others: str, why: str) -> Iterator[Finding]:
    lacking = [
        other
        for other in others.split()
        if not any(_holds(facts, path, choice) for choice in other.split("|"))
    ]
    if lacking and facts.has(*path):
        yield Finding(path, f"needs {_words(lacking)}{why}", True)


def _missing(facts: Facts, path: KeyPath, others: str, cure: str) -> Iterator[Finding]:
    """A key that must be there unless one of the others is."""
    present = facts.has(*path) or any(_holds(facts, path, other) for other in others.split())
    if not present and isinstance(facts.value(*path[:-1]), dict):
        yield Finding(path, f"missing; {cure}")


def _completes(facts: Facts, path: KeyPath, others: str, what: str) -> Iterator[Finding]:
    """A key that must be there beside each of the others."""
    present = [other for other in others.split() if _holds(facts, path, other)]
    if present and not facts.has(*path):
        yield Finding(path, f"missing; {_words(present)} alone {what}")


def _wrong(facts: Facts, path: KeyPath, _: str, problem: str) -> Iterator[Finding]:
    if facts.has(*path):
        yield Finding(path, problem, facts.text(*path) is None)


def _bounded(
    fits: Callable[[float, float], bool],
    fault: str,
    expected: str,
    facts: Facts,
    path: KeyPath,
    other: str,
    kind: str,
) -> Iterator[Finding]:
    """A quantity that fits another one, where both can be read."""
    place = _place(path, other)
    value, limit = facts.number(kind, *path), facts.number(kind, *place)
    if value is not None and limit is not None and not fits(value, limit):
        problem = f"{amount(kind, value)} {fault} {dotted(place)}"
        yield Finding(path, f"{problem}; expected {expected} {amount(kind, limit)}")


def _not_zero(facts: Facts, path: KeyPath, kind: str, cure: str) -> Iterator[Finding]:
    """A quantity, or a list of such, that is no zero."""
    size = len(facts.below(*path))
    numbers = facts.vector(kind, size, *path) if size else facts.number(kind, *path)
    if numbers is not None and np.max(np.abs(numbers)) < SMALLEST:
        yield Finding(path, f"zero; {cure}")


def _rising(facts: Facts, path: KeyPath, kinds: str, cure: str) -> Iterator[Finding]:
    """A list of rows, of quantities of these kinds, in which each rises."""
    for column, kind in enumerate(kinds.split()):
        values = [facts.number(kind, *row, column) for row in facts.below(*path)]
        for row, (before, value) in enumerate(pairwise(values), start=1):
            if before is not None and value is not None and value <= before:
                last = f"that of the row before, {amount(kind, before)}"
                problem = f"{amount(kind, value)} is not above {last}; {cure}"
                yield Finding((*path, row, column), problem)


def _once(facts: Facts, path: KeyPath, key: str, cure: str) -> Iterator[Finding]:
    """A list of which no two entries have the same text, or the same at a ``key``."""
    first: dict[str, KeyPath] = {}
    for entry in facts.below(*path):
        place: KeyPath = (*entry, key) if key else entry
        name = facts.text(*place)
        if name in first:
            problem = f"{shown(name)} is given twice, first in {dotted(first[name])}"
            yield Finding(place, f"{problem}; {cure}")
        elif name is not None:
            first[name] = entry


def _named(facts: Facts, path: KeyPath, what: str, _: str) -> Iterator[Finding]:
    """The name of a thruster or channel of the file."""
    name = facts.text(*path)
    if name is not None and name not in facts.names[what]:
        cure = cure_of(name, facts.names[what])
        yield Finding(path, f"no {what} is called {shown(name)}; {cure}")


OTHER_SENSOR = {
    "gyro": ("acceleration", "a gyro: rad/s, deg/s or rpm"),
    "accelerometer": ("rate", "an accelerometer: m/s^2"),
}
"""Kind of quantity that a sensor does not measure, and the units that it has."""


def _sensed(facts: Facts, path: KeyPath, *_: str) -> Iterator[Finding]:
    """A value in a unit of the sensor of the loop."""
    kind = facts.text("loop", "sensor", "kind") or ""
    text = facts.text(*path)
    if text is None or kind not in OTHER_SENSOR:
        return
    quantity, units = OTHER_SENSOR[kind]
    if facts.number(quantity, *path) is not None:
        yield Finding(path, f"{shown(text)} does not have a unit of {units}")


KINDS_OF_RULES: dict[str, Callable[[Facts, KeyPath, str, str], Iterator[Finding]]] = {
    "beside": _beside,
    "needs": _needs,
    "missing": _missing,
    "completes": _completes,
    "wrong": _wrong,
    "at most": partial(_bounded, operator.le, "exceeds", "at most"),
    "below": partial(_bounded, operator.lt, "is not below", "less than"),
    "not zero": _not_zero,
    "rising": _rising,
    "once": _once,
    "named": _named,
    "sensed": _sensed,
}


def amount(kind: str, value: float) -> str:
    """A quantity as people read it, angles in deg."""
    if kind == "angle":
        return f"{math.degrees(value):g} deg"
    return bar(value) if kind == "pressure" else f"{value:g} {KINDS[kind].si}"


TARGETS = ("tilt", "right_ascension", "sun_angle")  # keys of goal that name a target


def findings(facts: Facts, *, aimed: bool) -> Iterator[Finding]:
    """All faults of the table, and those of body, motion, thrusters and studies; ``aimed``: a
    target is given beside the file.
    """
    target = aimed or any(facts.has("goal", key) for key in TARGETS)
    if facts.has("requirement", "pointing") and not target:
        cure = "give goal or --target, or momentum_shift for the turn from t = 0"
        yield Finding(("requirement", "pointing"), f"needs a target to count from; {cure}", True)
    for pattern, kind, others, cure in RULES:
        for path in facts.matching(pattern):
            yield from KINDS_OF_RULES[kind](facts, path, others, cure)
    for rule in (_inertia, _motion, _disturbances, _thrusters, _tank, _dispersions, _loop):
        yield from rule(facts)


def _inertia(facts: Facts) -> Iterator[Finding]:
    A, C = facts.number("inertia", "inertia", "A"), facts.number("inertia", "inertia", "C")
    if A is not None and C is not None and C > 2 * A > 0:
        cure = "not physically possible (A and C swapped?); at most 2 A (a flat disc)"
        yield Finding(("inertia", "C"), f"C = {C:g} exceeds 2 A = {2 * A:g} kg m^2: {cure}")
    if facts.tensor is None:
        return
    path: KeyPath = ("inertia", "tensor")
    fault = tensor_fault(facts.tensor)
    if fault is not None:
        yield fault
        return
    moments = rigid_body.principal_axes(symmetric(facts.tensor))[0]
    spin, wheel = facts.spin, facts.wheel
    if wheel != 0.0:
        if spin is not None and not rigid_body.growth(moments, spin, wheel).stable:
            low, high = sorted(moment * spin - moments[2] * spin for moment in moments[:2])
            problem = "nutation about the spin axis grows with it"
            cure = f"expected a momentum below {low:.4g} or above {high:.4g} N m s"
            yield Finding(("wheel", "momentum"), f"{problem}; {cure}")
        return
    unstable = {
        "degenerate": "the same principal moment as just one other axis",
        "intermediate": "the middle principal moment",
    }
    kind = rigid_body.axis_class(moments)
    if kind in unstable:
        named = sorted(zip(moments, ("I1", "I2", "I3"), strict=True), reverse=True)
        values = ", ".join(f"{name} = {moment:.10g}" for moment, name in named)
        problem = f"the spin axis has {unstable[kind]} ({values} kg m^2)"
        cure = "spin about the axis of the smallest or largest moment, or hold it by a wheel"
        yield Finding(path, f"{problem}: free spin about it is unstable; {cure}")


def _motion(facts: Facts) -> Iterator[Finding]:
    path, stated = facts.stated_spin
    if stated is not None and abs(stated) < SMALLEST and not facts.wheel:
        cure = "expected a rate about axis 3, or a wheel; without both there is no nutation"
        yield Finding(path, f"the spin is zero; {cure}")
    spin, inertia = facts.spin, facts.inertia
    final = facts.number("rate", "goal", "spin")
    if final is not None and spin is not None and final * spin < 0.0:
        problem = "its sign differs from the spin at t = 0; the spin cannot be reversed"
        yield Finding(("goal", "spin"), problem)
    if spin is None or inertia is None or not inertia.wheel:
        return
    axial = inertia.axial(spin)
    path = ("wheel", "momentum")
    if abs(axial) <= CANCELLED * abs(inertia.wheel):
        problem = f"cancels the C ω3 of the body, {inertia.C * spin:.4g} N m s"
        yield Finding(path, f"{problem}: without momentum there is no nutation")
    elif axial * spin < 0.0 and facts.has("sun_sensor"):
        problem = "points the angular momentum against the spin: blocks fired from the Sun pulse"
        yield Finding(path, f"{problem} are not planned then; leave out sun_sensor")
    if facts.has("dissipation") and not facts.has("dissipation", "nutation"):
        problem = "missing; with a wheel it depends on where energy is lost: give grows or decays"
        yield Finding(("dissipation", "nutation"), problem)


def _disturbances(facts: Facts) -> Iterator[Finding]:
    for path in facts.matching("disturbances.*.torque"):
        across = facts.value(*path[:-1], "kind") in (None, "constant", "rotating")
        if across and facts.number("torque", *path) is not None:
            problem = "expected three components, [M1, M2, M3], got a single torque"
            yield Finding(path, f"{problem}; or kind: axial, along the third axis of the file")


def torque_of(facts: Facts, path: KeyPath) -> tuple[Vector, float] | None:
    """Torque of a mounted thruster, N m, and the magnitude that its rounding goes by."""
    position = facts.vector("length", 3, *path, "position")
    direction = facts.vector("number", 3, *path, "direction")
    force = facts.number("force", *path, "force")
    if position is None or direction is None or not force or math.hypot(*direction) < SMALLEST:
        return None
    center = facts.vector("length", 3, "center_of_mass")
    arm = position if center is None else position - center
    return np.cross(arm, force_vector(direction, force)), math.hypot(*position) * abs(force)


def _thrusters(facts: Facts) -> Iterator[Finding]:
    for path in facts.below("thrusters"):
        torque = None if facts.has(*path, "torque") else torque_of(facts, path)
        if torque is not None and math.hypot(*torque[0]) <= CANCELLED * torque[1]:
            cure = "the force passes through the centre of mass; move or turn the thruster"
            yield Finding((*path, "position"), f"no torque: {cure}")
    # A channel has one valve, so that thrusters with another one would not fire as planned.
    thrusters = facts.names["thruster"]
    for path in facts.below("channels"):
        members = [thrusters.get(facts.text(*entry) or "") for entry in facts.below(*path)]
        nodes = [
            [facts.root.get(*member, key) for key in ("valve", "impulse_bit")]
            for member in members
            if member is not None
        ]
        valves = [[None if node is None else node.plain() for node in pair] for pair in nodes]
        if any(valve != valves[0] for valve in valves):
            problem = "its thrusters do not have the same valve or impulse_bit"
            yield Finding(path, f"{problem}; write them alike, or use channels of their own")


def _tank(facts: Facts) -> Iterator[Finding]:
    """Faults of a tank: it is of no use where the propellant that is used is not known."""
    for path in facts.below("thrusters") if facts.has("tank") else ():
        for key, other in (("isp", ("tank", "isp")), ("lever_arm", (*path, "force"))):
            if not facts.has(*path, key) and not facts.has(*other):
                yield Finding((*path, key), "missing; the tank needs it for the propellant used")
    # Once all propellant is used, the moments must be those of a body.
    path = ("tank", "inertia_per_kg")
    propellant = facts.number("mass", "tank", "propellant")
    rows = facts.vector("shed", 3, *path)
    transverse, axial = (facts.number("shed", *path, key) for key in "AC")
    if rows is None and transverse is not None and axial is not None:
        rows = np.array([transverse, transverse, axial])
    if propellant is None or facts.principal is None or rows is None:
        return
    fault = moments_fault(np.asarray(facts.principal[0]) - propellant * rows)
    if fault is not None:
        yield Finding(path, f"after {propellant:g} kg are used it leaves {fault}")


def _dispersions(facts: Facts) -> Iterator[Finding]:
    """Faults of tolerances by thruster, and of thrusts in N, which become a share of the thrust."""
    for key in BY_THRUSTER:
        value = facts.value("dispersions", key)
        path: KeyPath = ("dispersions", key)
        places = dict.fromkeys(facts.thrusts, path)
        if isinstance(value, dict) and by_name(value):
            places = {str(entry[-1]): entry for entry in facts.below(*path)}
        for name, place in places.items():
            if name not in facts.thrusts:
                cure = cure_of(name, facts.thrusts)
                yield Finding(place, f"no thruster is called {shown(name)}; {cure}", True)
            elif key == "thrust" and facts.thrusts[name] is None:
                for size in DISTRIBUTIONS:
                    if facts.number("force", *place, size) is not None:
                        problem = f"needs the thrust of {shown(name)}, which is not known"
                        yield Finding(
                            (*place, size), f"{problem}; give its lever_arm, or a tolerance in %"
                        )


SAMPLES = 4.0  # samples a nutation period without which the phase of the nutation is hardly seen


def _loop(facts: Facts) -> Iterator[Finding]:
    """Faults of the loop: an on-time that a channel does not allow, a sensor that shows nothing."""
    on_time = facts.number("time", "loop", "on_time")
    thrusters = facts.names["thruster"]
    for name, path in facts.names["channel"].items() if on_time is not None else ():
        entries = [facts.text(*entry) for entry in facts.below(*path)] or [name]
        members = [thrusters[entry] for entry in entries if entry in thrusters]
        shortest = [facts.number("time", *member, "min_on_time") or 0.0 for member in members]
        longest = [facts.number("time", *member, "max_on_time") for member in members]
        low = max(shortest, default=0.0)
        high = min((time for time in longest if time is not None), default=math.inf)
        if on_time is not None and not low <= on_time <= high:
            problem = f"{on_time:g} s is outside what {name} allows: {span(low, high, 's')}"
            yield Finding(("loop", "on_time"), problem)
    inertia, spin = facts.inertia, facts.spin
    if inertia is None or spin is None:
        return
    sensor: KeyPath = ("loop", "sensor")
    rate = facts.number("frequency", *sensor, "rate")
    lowest = SAMPLES * abs(inertia.nutation_rate(spin)) / (2.0 * math.pi)
    if rate is not None and 0.0 < rate < lowest and facts.value("loop", "alias") is not True:
        problem = f"{rate:g} Hz is below four times the nutation frequency"
        cure = f"expected at least {lowest:.4g} Hz, or alias: true beside start"
        yield Finding((*sensor, "rate"), f"{problem}; {cure}")
    if facts.text(*sensor, "kind") != "accelerometer":
        return
    if inertia.wheel != 0.0:
        problem = "accelerometer: with a wheel only gyros are modelled; expected gyro"
        yield Finding((*sensor, "kind"), problem)
        return
    position = facts.vector("length", 3, *sensor, "position")
    axis = facts.vector("number", 3, *sensor, "axis")
    if not facts.has(*sensor, "axis"):
        axis = np.array([0.0, 0.0, 1.0])
    if position is None or axis is None or not axis.any():
        return
    from nutdamp.control_loop.sensor import is_blind

    turn = inertia.axes.T
    if is_blind(inertia.moments, turn @ position, turn @ axis / math.hypot(*axis)):
        problem = "blind: here it shows nothing of the nutation"
        yield Finding((*sensor, "position"), f"{problem}; move it off axis 3, or turn its axis")


def correlation_findings(spacecraft: Spacecraft) -> Iterator[Finding]:
    """Faults of correlated inputs, whose names are known once the spacecraft is."""
    pairs = () if spacecraft.dispersions is None else spacecraft.dispersions.correlation
    if not pairs:
        return
    path = ("dispersions", "correlation")
    from nutdamp.montecarlo.inputs import grouped, positive_definite, reachable  # here: few files

    inputs = reachable(spacecraft)
    names = [*(entry.name for entry in inputs.drawn), *(entry.name for entry in inputs.unused)]
    correlated = [name for name in names if not name.endswith("of each pulse")]
    fixed = {entry.name for entry in inputs.drawn if entry.kind == "bias"}
    before: set[frozenset[str]] = set()
    faults: list[Finding] = []
    for row, (first, second, _) in enumerate(pairs):
        for place, name in enumerate((first, second)):
            if name not in correlated:
                problem = f"the dispersions have no input called {shown(name)}"
                cure = cure_of(name, correlated)
                faults.append(Finding((*path, row, place), f"{problem}; {cure}"))
            elif name in fixed:
                problem = f"{shown(name)} is a fixed offset (bias) and does not vary"
                faults.append(Finding((*path, row, place), problem))
        if first == second:
            problem = f"{shown(first)} again; expected two different inputs"
            faults.append(Finding((*path, row, 1), problem))
        elif frozenset((first, second)) in before:
            problem = f"{first} and {second} are given before; keep one of the two"
            faults.append(Finding((*path, row), problem))
        before.add(frozenset((first, second)))
    yield from faults
    for group in () if faults else grouped(pairs):
        if not positive_definite(group):
            problem = f"not positive definite for {', '.join(group.names)}"
            why = "these correlations contradict each other; pairs that are not given count as 0"
            yield Finding(path, f"{problem}: {why}")


# --- numbers that probably lack a unit

FAR = 50.0  # m; few spacecraft reach further from their centre of mass, and drawings count in mm
FAST_AND_WHOLE = 12.0  # rad/s; above (115 rpm) a whole number is more likely one of rpm
LOOSE = 0.1  # rad; few requirements are looser than this 5.7 deg, and many a file counts in deg
TURN = 2.0 * math.pi


def _fast(value: float, _: Facts) -> bool:
    return abs(value) > (FASTEST if value % 1 else FAST_AND_WHOLE)


class Doubtful(NamedTuple):
    """Numbers at ``paths`` of which a test says that they probably lack the unit ``meant``."""

    paths: str
    kind: str
    meant: str
    test: Callable[[float, Facts], bool]


BANDS = (
    Doubtful(
        "state.phase goal.azimuth goal.right_ascension",
        "angle",
        "deg",
        lambda value, _: abs(value) > TURN,
    ),
    Doubtful(
        "requirement.momentum_shift requirement.pointing requirement.nutation state.nutation",
        "angle",
        "deg",
        lambda value, _: LOOSE < value < 0.5 * math.pi,
    ),
    Doubtful("state.spin goal.spin", "rate", "rpm", _fast),
    Doubtful("omega0.*", "rate", "deg/s", _fast),
    Doubtful(
        "thrusters.*.position.* thrusters.*.lever_arm steerable.lever_arm",
        "length",
        "mm",
        lambda value, _: abs(value) > FAR,
    ),
    Doubtful(  # within a turn a torque cancels itself
        "thrusters.*.min_on_time",
        "time",
        "ms",
        lambda value, facts: facts.spin is not None and value * abs(facts.spin) > TURN,
    ),
    Doubtful(  # s; few valves take so long, and many a data sheet counts in ms
        " ".join(f"valve.{key} thrusters.*.valve.{key}" for key in VALVE_TIMES)
        + " thrusters.*.impulse_bit.*.0 thrusters.*.impulse_bit.*.2",
        "time",
        "ms",
        lambda value, _: value > 1.0,
    ),
    Doubtful(  # s; no chemical thruster has as much, and data sheets also give the speed in m/s
        "thrusters.*.isp steerable.isp tank.isp.*.1",
        "time",
        "m/s",
        lambda value, _: value > 500.0,
    ),
    Doubtful(  # Pa; no tank feeds thrusters with less, and most data sheets count in bar
        "tank.pressure tank.final_pressure tank.isp.*.0",
        "pressure",
        "bar",
        lambda value, _: 0.0 < value < 1e3,
    ),
)


def doubts(facts: Facts) -> Iterator[Finding]:
    """Numbers beyond any plausible value in SI."""
    for band in BANDS:
        for path in (path for each in band.paths.split() for path in facts.matching(each)):
            value = facts.value(*path)  # a text has a unit
            if isinstance(value, bool) or not isinstance(value, int | float):
                continue
            if math.isfinite(value) and band.test(value, facts):
                yield Finding(path, reading(value, band.kind, band.meant))
