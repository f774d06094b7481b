"""What must hold for the dispersions of a spacecraft file and the probability that it requires.

Like `rules`, these read the raw tree and skip what cannot be read.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from nutdamp.files.correlation_rules import correlation_findings
from nutdamp.files.dispersion_models import (
    BY_THRUSTER,
    QUANTITIES,
    READING,
    VALVE_TIMES,
    by_name,
    size_of,
    thrust_behind,
)
from nutdamp.files.facts import Facts, Finding
from nutdamp.files.fields import RIGHT_ANGLE
from nutdamp.files.rules import symmetric, tensor_fault, tensor_of
from nutdamp.files.thruster_rules import instead
from nutdamp.files.yaml_tree import KeyPath, Node
from nutdamp.physics.inertia import principal_axes
from nutdamp.schedule import STEERABLE
from nutdamp.tolerances import KINDS
from nutdamp.units import bar, shown

LARGEST_SIGMA = 0.5
"""One sigma of a normal distribution, relative to the nominal value, that is still believed: beyond, more than one
draw in forty would turn its sign."""

LARGEST_OFFSET = 1.0
"""Half widths and fixed offsets must stay below this, relative to the nominal value, which would otherwise turn its
sign. Of an angle the nominal value is 90 deg."""


class Entry(NamedTuple):
    """One tolerance: where it is, what kind of quantity it holds, the least nominal value and what that is."""

    path: KeyPath
    kind: str
    nominal: float | None = None
    of: str = ""


def dispersion_findings(root: Node) -> Iterator[Finding]:
    """Everything wrong between the keys of the dispersions and with what else the file says."""
    facts = Facts(root)
    yield from _probability(facts)
    if not facts.has("dispersions"):
        return
    yield from _thruster_names(facts)
    for entry in _entries(facts):
        yield from _kinds(facts, entry)
    yield from _shifted_moments(facts)
    yield from _of_sensor(facts)
    yield from _below_zero(facts)
    yield from correlation_findings(facts, _entries(facts), thrusts(facts))


def _below_zero(facts: Facts) -> Iterator[Finding]:
    """Times of valves and numbers of the tank that draws would turn negative."""
    for key in VALVE_TIMES:
        for path in _each(facts, key):
            for name, nominal in _valve_times(facts, key, path[2:]).items():
                size = _size_of(facts, path, "time")
                if size is not None and size[1] > (1.0 + 1e-12) * nominal:
                    yield _negative(path, size, f"the {key} of {name}, {nominal:g} s")
                    break
    low = facts.number("pressure", "tank", "final_pressure")
    for key in ("tank_propellant", "tank_pressure", "tank_final_pressure"):
        nominal_, path_ = facts.number(QUANTITIES[key], "tank", key.removeprefix("tank_")), ("dispersions", key)
        size = _size_of(facts, path_, QUANTITIES[key], nominal_) if nominal_ is not None else None
        if size is None or nominal_ is None:
            continue
        floor = low if key == "tank_pressure" and low is not None else 0.0
        if size[1] > (1.0 + 1e-12) * (nominal_ - floor):
            value, least = (f"{one:g} kg" if key == "tank_propellant" else bar(one) for one in (nominal_, floor))
            below = f"less than final_pressure, {least}" if floor else "negative"
            yield _negative(path_, size, f"{key.replace('_', '.', 1)}, {value}", below)


def _negative(path: KeyPath, size: tuple[str, float], of: str, below: str = "negative") -> Finding:
    reach = "draws beyond three sigma" if size[0] == "normal" else "draws"
    problem = f"{reach} would make {of}, {below}; expected a smaller spread, or a larger nominal value"
    return Finding((*path, size[0]), problem)


def _each(facts: Facts, key: str) -> list[KeyPath]:
    """Where the tolerances of ``key`` are: one, or one a thruster."""
    path: KeyPath = ("dispersions", key)
    node = facts.root.get(*path)
    if node is None or not isinstance(node.value, dict):
        return []
    return [(*path, name) for name, _ in node.children()] if by_name(node.value) else [path]


def _size_of(facts: Facts, path: KeyPath, kind: str, nominal: float | None = None) -> tuple[str, float] | None:
    """The kind of a tolerance and how far below its nominal value draws go, three sigma or all, in SI of ``kind``.

    One in % is that of the ``nominal`` value, where that is known.
    """
    for name in KINDS:
        size = facts.number(kind, *path, name)
        share = None if size is not None or nominal is None else facts.number("ratio", *path, name)
        if share is not None and nominal is not None:
            out_of_range = abs(share) > (LARGEST_SIGMA if name == "normal" else LARGEST_OFFSET)  # said by `_kinds`
            size = None if out_of_range else share * nominal
        if size is not None:
            return name, -size if name == "bias" else 3.0 * size if name == "normal" else size
    return None


def _valve_times(facts: Facts, key: str, named: KeyPath) -> dict[str, float]:
    """The time of ``key`` of the valve of each thruster that a tolerance concerns, s."""
    found = {}
    for index, _ in facts.children("thrusters"):
        path: KeyPath = ("thrusters", index)
        name = facts.text(*path, "name")
        valve: KeyPath = (*path, "valve") if facts.has(*path, "valve") else ("valve",)
        if name is None or facts.has(*path, "impulse_bit") or not facts.has(*valve) or (named and named[0] != name):
            continue
        time = facts.number("time", *valve, key) if facts.has(*valve, key) else 0.0
        if time is not None:
            found[name] = time
    return found


def _probability(facts: Facts) -> Iterator[Finding]:
    if facts.has("requirement", "probability") and not (
        facts.has("requirement", "nutation") or facts.has("requirement", "momentum_shift")
    ):
        problem = "given alone; name what must be met with it: nutation, momentum_shift or both"
        yield Finding(("requirement", "probability"), problem, True)


def _entries(facts: Facts) -> Iterator[Entry]:
    """All tolerances in the file."""
    forces = thrusts(facts)
    for key, kind in QUANTITIES.items():
        path: KeyPath = ("dispersions", key)
        node = facts.root.get(*path)
        if node is None:
            continue
        if key == "omega0" and isinstance(node.value, list):
            for index, _ in node.children():
                yield Entry((*path, index), kind, _spin(facts) if index == 2 else None, "the spin")
        elif key in BY_THRUSTER and isinstance(node.value, dict) and by_name(node.value):
            for name, _ in node.children():
                nominal = forces.get(str(name)) if kind == "force" else _nominal(facts, key)[0]
                yield Entry((*path, name), kind, nominal, f"the thrust of {name}" if kind == "force" else "")
        elif key == "thrust":
            known = [(thrust, name) for name, thrust in forces.items() if thrust is not None]
            least = min(known, default=(None, ""))
            yield Entry(path, kind, least[0], f"the thrust of {least[1]}")
        else:
            yield Entry(path, kind, *_nominal(facts, key))


def _nominal(facts: Facts, key: str) -> tuple[float | None, str]:
    """The value that a tolerance is compared with, and what it is; None where it cannot be read, or nothing bounds."""
    if key in ("A", "C"):
        moments = moments_of(facts)
        return (None, "") if moments is None else (0.5 * sum(moments[:2]) if key == "A" else moments[2], key)
    if key == "omega0":
        return _spin(facts), "the spin"
    if QUANTITIES[key] == "ratio":
        return 1.0, ""
    return (RIGHT_ANGLE, "a right angle") if QUANTITIES[key] == "angle" else (None, "")


def moments_of(facts: Facts) -> tuple[float, float, float] | None:
    """Principal moments in kg m², the one about the spin axis last; None where they cannot be read."""
    tensor = tensor_of(facts)
    if tensor is not None:
        return None if tensor_fault(tensor) else principal_axes(symmetric(tensor))[0]
    A, C = (facts.number("inertia", "inertia", key) for key in ("A", "C"))
    return None if A is None or C is None or A <= 0.0 or C <= 0.0 else (A, A, C)


def _spin(facts: Facts) -> float | None:
    """|ω3| about the third axis of the file; None where it is zero or cannot be read."""
    spin = facts.number("rate", "omega0", 2) if facts.has("omega0") else facts.number("rate", "state", "spin")
    return abs(spin) if spin else None


def thrusts(facts: Facts) -> dict[str, float | None]:
    """The thrust in N of each thruster of the file and its torquer; None where it is not known."""
    found: dict[str, float | None] = {}
    for index, _ in facts.children("thrusters"):
        path: KeyPath = ("thrusters", index)
        name = facts.text(*path, "name")
        if name is not None:
            torque = facts.vector("torque", 3, *path, "torque")
            size = None if torque is None else float(np.linalg.norm(torque))
            lever = facts.number("length", *path, "lever_arm")
            found[name] = facts.number("force", *path, "force") or thrust_behind(size, lever or None)
    if facts.has("steerable") or not facts.children("thrusters"):
        torque_, lever = facts.number("torque", "steerable", "torque"), facts.number("length", "steerable", "lever_arm")
        found[STEERABLE] = thrust_behind(torque_, lever or None)
    return found


def _thruster_names(facts: Facts) -> Iterator[Finding]:
    """Tolerances of thrusters that the file does not have."""
    known = list(thrusts(facts))
    for key in BY_THRUSTER:
        path: KeyPath = ("dispersions", key)
        node = facts.root.get(*path)
        if node is None or not isinstance(node.value, dict):
            continue
        if not node.value:
            yield Finding(path, f"empty; give {_example(QUANTITIES[key])}, or one such entry by thruster")
        elif by_name(node.value):
            for name in node.value:
                if name == STEERABLE and name not in known:
                    yield Finding((*path, name), f"the file has no {STEERABLE} torquer; leave this out", True)
                elif name not in known:
                    yield Finding((*path, name), f"no thruster is called {shown(name)}; {instead(name, known)}", True)


def _kinds(facts: Facts, entry: Entry) -> Iterator[Finding]:
    """What is wrong with the kinds and the size of one tolerance."""
    node = facts.root.get(*entry.path)
    if node is None or not isinstance(node.value, dict):
        return
    given = [key for key in node.value if key in KINDS]
    said = not node.value and entry.path[1:] in [(key,) for key in BY_THRUSTER]  # by `_thruster_names`
    if not given and not said:
        yield Finding(entry.path, f"names no distribution; give {_example(entry.kind)}")
    for key in given[1:]:
        yield Finding((*entry.path, key), f"given together with {given[0]}; keep one of the two", True)
    for key in given:
        problem = _size_fault(facts, entry, key, node.value[key].plain())
        if problem is not None:
            yield Finding((*entry.path, key), problem)


def _example(kind: str) -> str:
    sizes = {
        "inertia": "2 %",
        "mass": "1 %",
        "pressure": "2 %",
        "rate": "0.1 deg/s",
        "force": "3 %",
        "ratio": "1 %",
        "angle": "0.5 deg",
        READING: "0.01 deg/s",
    }
    return f"{{normal: {sizes.get(kind, '5 mm' if kind == 'length' else '5 ms')}}}, or uniform, triangular, bias"


def _size_fault(facts: Facts, entry: Entry, key: str, value: object) -> str | None:
    """What makes the size of a tolerance impossible."""
    if value is None:
        return None  # said already
    try:
        size, relative = size_of(value, entry.kind)
    except ValueError as wrong:
        return str(wrong)
    if key != "bias" and size < 0.0:
        what = "one sigma" if key == "normal" else "half a width"
        return f"{shown(value)} is negative; expected {what} of at least 0, or bias for a fixed offset"
    if entry.kind == "force" and not relative:
        unknown = _without_thrust(facts, entry)
        if unknown is not None:
            return f"{shown(value)} needs the thrust of {unknown}, which is not known; give its lever_arm, or a %"
    nominal = 1.0 if relative else entry.nominal
    if nominal is None:
        return None
    fraction, limit = abs(size) / nominal, LARGEST_SIGMA if key == "normal" else LARGEST_OFFSET
    if fraction < limit or (key == "normal" and fraction == limit):
        return None
    most = f"{'of at most' if key == 'normal' else 'below'} {100 * limit:g} %"
    amounts = f"is {100 * fraction:.3g} % of {entry.of}" if entry.of and not relative else "is out of range"
    what = {"normal": "one sigma", "bias": "an offset"}.get(key, "half a width")
    return f"{shown(value)} {amounts}; expected {what} {most}"


def _without_thrust(facts: Facts, entry: Entry) -> str | None:
    """A thruster that an absolute tolerance concerns and whose thrust is not known."""
    named = entry.path[2:]
    for name, thrust in thrusts(facts).items():
        if thrust is None and (not named or name == named[0]):
            return f"the {STEERABLE} torquer" if name == STEERABLE else shown(name)
    return None


def _shifted_moments(facts: Facts) -> Iterator[Finding]:
    """Fixed offsets of A and C that make a body no body: every draw would be refused."""
    moments = moments_of(facts)
    if moments is None:
        return
    wider = _offset(facts, "A", 0.5 * (moments[0] + moments[1]))
    longer = _offset(facts, "C", moments[2])
    if wider is None or longer is None or (wider == longer == 0.0):
        return
    first, second, third = (1 + wider) * moments[0], (1 + wider) * moments[1], (1 + longer) * moments[2]
    if third > (first + second) * (1 + 1e-9) or abs(first - second) > third:
        key = "C" if longer != 0.0 else "A"
        problem = f"with this offset C = {third:g} and A = {0.5 * (first + second):g} kg m^2: not physically possible"
        yield Finding(("dispersions", key, "bias"), f"{problem}; C must be at most 2 A")


def _of_sensor(facts: Facts) -> Iterator[Finding]:
    """Tolerances of a sensor that the file does not have, or of the other kind, and a delay below zero."""
    kind = facts.text("loop", "sensor", "kind")
    wrong, right = ("rate", "m/s^2") if kind == "accelerometer" else ("acceleration", "rad/s, deg/s or rpm")
    for key in QUANTITIES:
        path: KeyPath = ("dispersions", key)
        if not key.startswith("sensor_") or not facts.has(*path):
            continue
        if not facts.has("loop"):
            yield Finding(path, "is of the sensor of a loop, and the file has no loop; leave this out", True)
        for one in KINDS if key == "sensor_bias" and kind is not None else ():
            text = facts.text(*path, one)
            if text is not None and facts.number(wrong, *path, one) is not None:
                yield Finding((*path, one), f"{shown(text)} is not in the unit of the sensor: {right}")
    delay, offset = (
        facts.number("time", *path) for path in (("loop", "sensor", "delay"), ("dispersions", "sensor_delay", "bias"))
    )
    if offset is not None and (delay or 0.0) + offset < 0.0 and facts.has("loop"):
        problem = f"with this offset the delay is {(delay or 0.0) + offset:g} s; expected a delay of at least 0"
        yield Finding(("dispersions", "sensor_delay", "bias"), problem)


def _offset(facts: Facts, key: str, nominal: float) -> float | None:
    """Fixed offset of a moment of inertia, relative; 0 where it is exactly known, None where it is random or faulty."""
    if not facts.has("dispersions", key):
        return 0.0
    path = ("dispersions", key, "bias")
    relative, value = facts.number("ratio", *path), facts.number("inertia", *path)
    if facts.text(*path) is None or relative is None:
        relative = None if value is None else value / nominal
    return relative if relative is not None and abs(relative) < LARGEST_OFFSET else None
