"""Constraints of valves, tank, dispersions and loop.

What must hold for the dispersions of a spacecraft file and the probability that it requires.

Like `rules`, these read the raw tree and skip what cannot be read.

What must hold between the keys of a closed loop and those of the body that it damps.

What must hold between the keys of a spacecraft file that say what thrusters make of commands.

What must hold for the correlated inputs of a spacecraft file.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from nutdamp.errors import nearest, span
from nutdamp.files.fields import RIGHT_ANGLE, KeyPath
from nutdamp.files.keys import BY_THRUSTER, QUANTITIES, READING, VALVE_TIMES, by_name, size_of, thrust_behind
from nutdamp.files.rules import (
    Facts,
    Finding,
    Vector,
    inertia_of,
    instead,
    norm,
    on_times_of,
    spin_axis,
    spin_of,
    symmetric,
    tensor_fault,
    tensor_of,
    torque_of,
)
from nutdamp.files.yaml import Node
from nutdamp.montecarlo.inputs import Pair, grouped, positive_definite
from nutdamp.physics.body import principal_axes
from nutdamp.spacecraft.equipment import ACCELEROMETER
from nutdamp.spacecraft.model import Inertia
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.spacecraft.tolerances import KINDS
from nutdamp.units import KINDS as UNITS
from nutdamp.units import bar, shown

PARTS = {"thrust_direction": ("direction", "ab"), "position": ("position", "xyz"), "attitude": ("attitude", "xy")}
"""Tolerances of which several inputs are drawn: their first word and their last letters."""

EACH_PULSE = ("thrust_per_pulse", "timing")
"""Tolerances that each pulse draws anew."""


def correlation_findings(facts: Facts, entries: Iterable[Entry], thrusters: Iterable[str]) -> Iterator[Finding]:
    """Pairs of what is not drawn, or of one input, pairs given twice, and numbers that cannot be correlations.

    ``entries`` are the tolerances of the file, ``thrusters`` the names that may have some of their own.
    """
    path = ("dispersions", "correlation")
    pairs: dict[frozenset[str], Pair] = {}
    drawn, sound = _drawn(facts, entries, list(thrusters)), True
    for index, node in facts.children(*path):
        names = [facts.text(*path, index, place) for place in (0, 1)]
        size = facts.number("ratio", *path, index, 2)
        if len(node.value if isinstance(node.value, list) else ()) != 3 or None in names or size is None:
            sound = False
            continue  # said already
        first, second = (name or "" for name in names)
        for place, name in enumerate((first, second)):
            problem = _unknown(name, drawn)
            if problem:
                yield Finding((*path, index, place), problem)
        if first == second:
            yield Finding((*path, index, 1), f"{shown(first)} again; expected two different inputs")
        elif frozenset((first, second)) in pairs:
            yield Finding((*path, index), f"{first} and {second} are given before; keep one of the two")
        elif abs(size) == 1.0:
            yield Finding((*path, index, 2), f"{size:g}: one would follow from the other; expected less than 1 in size")
        elif abs(size) < 1.0:
            pairs[frozenset((first, second))] = (first, second, size)
            continue
        sound = False
    for group in grouped(pairs.values()) if sound else ():
        if not positive_definite(group):
            problem = f"not positive definite for {', '.join(group.names)}: no numbers have these correlations"
            yield Finding(path, f"{problem}; pairs that are not given count as 0")


def _unknown(name: str, drawn: dict[str, bool]) -> str:
    """Why an input cannot be correlated; empty where it can. ``drawn``: whether it varies, by name."""
    if name in drawn:
        return "" if drawn[name] else f"{shown(name)} is a fixed offset (bias), which does not vary"
    if name.replace(" ", "_") in EACH_PULSE:
        return f"{shown(name)} is drawn by each pulse anew; expected an input that is the same for all pulses"
    close = nearest(name, list(drawn))
    known = f"did you mean {shown(close)}?" if close else f"known here: {', '.join(drawn) or 'none'}"
    return f"the dispersions have no input called {shown(name)}; {known}"


def _drawn(facts: Facts, entries: Iterable[Entry], thrusters: list[str]) -> dict[str, bool]:
    """Names of all inputs that any schedule could draw once, as `dispersion.inputs` has them, and whether they vary."""
    found = {}
    for entry in entries:
        key, *rest = entry.path[1:]
        node = facts.root.get(*entry.path)
        varies = node is not None and isinstance(node.value, dict) and "bias" not in node.value
        for name in _names(facts, str(key), rest, thrusters):
            found[name] = varies
    return found


def _names(facts: Facts, key: str, one: list[str | int], thrusters: list[str]) -> list[str]:
    """Of a tolerance, which may be of ``one`` thruster or axis alone."""
    if key in EACH_PULSE:
        return []
    if key == "omega0":
        return [f"omega0_{int(axis) + 1}" for axis in one or range(3)]
    word, letters = PARTS.get(key, (key, ""))
    if key in BY_THRUSTER:
        return [
            f"{word} {name} {letter}".rstrip()
            for name in one or thrusters
            for letter in (letters if name != STEERABLE else "") or " "
        ]
    if key in ("sensor_bias", "sensor_scale") and facts.text("loop", "sensor", "kind") != ACCELEROMETER:
        return [f"{key.replace('_', ' ')} {axis}" for axis in (1, 2)]
    if letters:
        return [f"{word} {letter}" for letter in letters]
    spaced = key.startswith(("tank_", "sensor_", "timing_"))
    return [key.replace("_", " ", 1) if spaced else key]


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


THRUST_KEYS = ("valve", "cold", "tank")
"""At the root of the file."""


def thrust_findings(root: Node) -> Iterator[Finding]:
    """Everything wrong with ``valve``, ``impulse_bit``, ``cold`` and ``tank``."""
    facts = Facts(root)
    thrusters = [index for index, _ in facts.children("thrusters")]
    for key in THRUST_KEYS:
        if facts.has(key) and not thrusters:
            yield Finding((key,), "applies to thrusters, and the file has none; leave it out", True)
    named, said = thrusts(facts), set[KeyPath]()
    for index in thrusters:
        path: KeyPath = ("thrusters", index)
        if facts.has(*path, "valve") and facts.has(*path, "impulse_bit"):
            yield Finding((*path, "impulse_bit"), "given together with valve; keep one of the two", True)
        valve = _valve_path(facts, path)
        if valve is not None:
            for found in _opens(facts, path, valve):
                if found.path not in said:
                    yield found
                said.add(found.path)
        elif facts.has(*path, "impulse_bit"):
            yield from _table(facts, path, named.get(facts.text(*path, "name") or ""))
    yield from _alike(facts, named)
    if facts.has("tank") and thrusters:
        yield from _tank(facts, named)


def _valve_path(facts: Facts, path: KeyPath) -> KeyPath | None:
    """Where the valve of a thruster is: its own, or that of all."""
    if facts.has(*path, "valve"):
        return (*path, "valve")
    return ("valve",) if facts.has("valve") and not facts.has(*path, "impulse_bit") else None


def _opens(facts: Facts, path: KeyPath, valve: KeyPath) -> Iterator[Finding]:
    """A valve that closes before it opens, whatever the command."""
    opened, closed = (facts.number("time", *valve, key) or 0.0 for key in VALVE_TIMES[:2])
    longest = facts.number("time", *path, "max_on_time")
    if facts.text(*valve, "on_time_is") != "effective" and longest is not None and longest + closed <= opened:
        of = facts.text(*path, "name") or "a thruster"
        problem = (
            f"{opened:g} s is not less than max_on_time + close_delay = {longest + closed:g} s of {of}: its valve "
            "closes before it opens, and no command gives thrust"
        )
        yield Finding((*valve, "open_delay"), problem)


def _table(facts: Facts, path: KeyPath, thrust: float | None) -> Iterator[Finding]:
    """What is wrong with an impulse_bit; ``thrust`` N, None where it is not known."""
    table: KeyPath = (*path, "impulse_bit")
    rows = [
        [facts.number(kind, *table, row, column) for column, kind in enumerate(("time", "impulse", "time"))]
        for row, _ in facts.children(*table)
    ]
    for number, (before, row) in enumerate(pairwise(rows), start=1):
        for column, what, unit in ((0, "on-time", "s"), (1, "impulse", "N s")):
            value, last = row[column], before[column]
            if value is not None and last is not None and value <= last:
                problem = f"{what} {value:g} {unit} is not above that of the row before, {last:g} {unit}"
                yield Finding((*table, number, column), f"{problem}; expected rows with rising on-times and impulses")
        value, last = row[2], before[2]
        if value is not None and last is not None and value < last:
            problem = f"centroid {value:g} s is before that of the row before, {last:g} s; expected one not earlier"
            yield Finding((*table, number, 2), problem)
    if thrust is None:
        if facts.has(*path, "force") or facts.has(*path, "lever_arm"):
            return  # what cannot be read is said already
        yield Finding(table, "needs the thrust; give lever_arm", True)
        return
    for number, (on_time, impulse, centroid) in enumerate(rows):
        if on_time is None or impulse is None or centroid is None:
            continue
        lasts = impulse / thrust
        if centroid < 0.5 * lasts:
            problem = (
                f"{centroid:g} s is too early: {impulse:g} N s take {lasts:g} s at {thrust:g} N, so that the thrust "
                f"would begin before the command; expected at least {0.5 * lasts:g} s"
            )
            yield Finding((*table, number, 2), problem)
    first, last = (rows[0][0], rows[-1][0]) if rows else (None, None)
    least, most = (facts.number("time", *path, key) for key in ("min_on_time", "max_on_time"))
    if last is not None and least is not None and least >= last:
        yield Finding((*path, "min_on_time"), f"{least:g} s is not below the last on-time of impulse_bit, {last:g} s")
    if first is not None and most is not None and most <= first:
        yield Finding((*path, "max_on_time"), f"{most:g} s is not above the first on-time of impulse_bit, {first:g} s")


def _alike(facts: Facts, named: dict[str, float | None]) -> Iterator[Finding]:
    """Thrusters of one channel that make different pulses of a command; ``named`` are their thrusts, N."""
    entries = {facts.text("thrusters", index, "name"): index for index, _ in facts.children("thrusters")}
    kinds = {name: _kind(facts, index, named.get(name or "")) for name, index in entries.items()}
    for channel, node in facts.children("channels"):
        listed = [entry.value for _, entry in node.children() if isinstance(entry.value, str)]
        members = [name for name in listed if name in kinds]
        other = next((name for name in members if kinds[name] != kinds[members[0]]), None)
        if other is not None:
            problem = f"{members[0]} and {other} make different pulses of a command, by valve or impulse_bit"
            yield Finding(("channels", channel), f"{problem}; let them fire in channels of their own")


def _tank(facts: Facts, named: dict[str, float | None]) -> Iterator[Finding]:
    """What is wrong with the tank; ``named`` are the thrusts of the thrusters, N."""
    full, empty = (facts.number("pressure", "tank", key) for key in ("pressure", "final_pressure"))
    if full is not None and empty is not None and empty > full > 0.0:
        problem = f"{bar(empty)} exceeds pressure: it falls as propellant is used; expected at most {bar(full)}"
        yield Finding(("tank", "final_pressure"), problem)
    mass, propellant = facts.number("mass", "mass"), facts.number("mass", "tank", "propellant")
    if mass is not None and propellant is not None and propellant >= mass > 0.0:
        yield Finding(("tank", "propellant"), f"{propellant:g} kg is not less than the mass, {mass:g} kg")
    rows = [facts.number("pressure", "tank", "isp", row, 0) for row, _ in facts.children("tank", "isp")]
    for number, (before, pressure) in enumerate(pairwise(rows), start=1):
        if before is not None and pressure is not None and pressure <= before:
            problem = f"{bar(pressure)} is not above that of the row before, {bar(before)}; expected rising pressures"
            yield Finding(("tank", "isp", number, 0), problem)
    known = [pressure for pressure in rows if pressure is not None]
    if full is not None and known and not min(known) <= full <= max(known):
        problem = f"{bar(min(known))} to {bar(max(known))} leave out the pressure at t = 0, {bar(full)}; add a row"
        yield Finding(("tank", "isp"), problem)
    if propellant is not None and facts.has("tank", "inertia_per_kg"):
        yield from _emptied(facts, propellant)
    for index, _ in facts.children("thrusters"):
        name = facts.text("thrusters", index, "name") or ""
        if not facts.has("tank", "isp") and not facts.has("thrusters", index, "isp"):
            problem = "missing; tank needs to know the propellant that is used, by isp here or in tank"
            yield Finding(("thrusters", index, "isp"), problem)
        if named.get(name, 0.0) is None and not facts.has("thrusters", index, "force"):
            problem = "missing; tank needs to know the propellant that is used, and so the thrust"
            yield Finding(("thrusters", index, "lever_arm"), problem)


def _emptied(facts: Facts, propellant: float) -> Iterator[Finding]:
    """Moments of inertia that no body can have once all ``propellant`` kg are used."""
    path: KeyPath = ("tank", "inertia_per_kg")
    moments, rows = moments_of(facts), facts.vector("shed", 3, *path)
    transverse, axial = (facts.number("shed", *path, key) for key in "AC")
    if rows is None and transverse is not None and axial is not None:
        rows = np.array([transverse, transverse, axial])
    if moments is None or rows is None or rows.min() < 0.0:
        return  # what cannot be read, or is out of range, is said already
    empty = np.asarray(moments) - propellant * rows
    values = ", ".join(f"{moment:.4g}" for moment in empty)
    least, middle, largest = np.sort(empty).tolist()
    if least <= 0.0:
        worst = int(np.argmax(rows / moments))
        most = f"expected less than {moments[worst] / propellant:.4g} kg m^2/kg of the moment {moments[worst]:g} kg m^2"
        yield Finding(path, f"leaves {values} kg m^2 once {propellant:g} kg are used, all must be above 0; {most}")
    elif empty[2] == middle and least < middle < largest:
        problem = f"leaves {values} kg m^2 once {propellant:g} kg are used: the moment about axis 3 is the middle one"
        yield Finding(path, f"{problem}, about which a spin is unstable; expected the largest or the least")
    elif largest > (least + middle) * (1.0 + 1e-9):
        problem = f"leaves {values} kg m^2 once {propellant:g} kg are used: the largest exceeds the sum of the others"
        yield Finding(path, f"{problem}, which no body has; expected less off the smaller ones, or more off it")


def _kind(facts: Facts, index: str | int, thrust: float | None) -> tuple[float | str | None, ...]:
    """What a thruster of ``thrust`` N makes of a command, to be compared."""
    path: KeyPath = ("thrusters", index)
    valve = _valve_path(facts, path)
    if valve is not None:
        times = tuple(facts.number("time", *valve, key) or 0.0 for key in VALVE_TIMES)
        return (*times, facts.text(*valve, "on_time_is") or "command")
    cells: list[float | str | None] = []
    for row, _ in facts.children(*path, "impulse_bit"):
        impulse = facts.number("impulse", *path, "impulse_bit", row, 1)
        cells += [facts.number("time", *path, "impulse_bit", row, column) for column in (0, 2)]
        cells.append(None if impulse is None else round(impulse / (thrust or math.inf), 12))
    return tuple(cells) if cells else (*(0.0,) * len(VALVE_TIMES), "command")


SAMPLES = 4.0
"""Samples a nutation period without which the phase of the nutation is hardly seen."""

MOST_SAMPLES = 1e6
"""Samples a nutation period, more than which tell no more and take for ever to fly."""

LATE = 20.0
"""Nutation periods after which a sample tells nothing: how long delay, filter and settling may be."""

LONGEST_WAIT = 1e4
"""Nutation periods, more than which from firing to firing damp nothing."""

LARGEST_BIAS, FARTHEST = 1e3, 1e3
"""m/s² and m of an accelerometer beyond which it is none of a spacecraft: its nutation would be lost in rounding."""

SCALES = (0.1, 10.0)
"""Sizes of scales between which a sensor shows what it measures."""

SENSOR: KeyPath = ("loop", "sensor")


def loop_findings(root: Node) -> Iterator[Finding]:
    """Everything wrong with ``loop``."""
    facts = Facts(root)
    if not facts.has("loop"):
        return
    inertia, spin = inertia_of(facts), spin_of(facts)
    yield from _thresholds(facts)
    yield from _sensor(facts)
    yield from _channels(facts)
    if inertia is None or spin is None:
        return
    if inertia.body_rate == 0.0:
        problem = "in a sphere ω does not rotate in the body, so that a loop has no phase to fire by; leave loop out"
        yield Finding(("loop",), problem, True)
        return
    yield from _sampling(facts, abs(inertia.body_rate * spin))
    yield from _lags(facts, 2.0 * math.pi / abs(inertia.body_rate * spin))
    yield from _accelerometer(facts, inertia)
    yield from _seen(facts, inertia, spin)


class ChannelFacts(NamedTuple):
    """A channel as far as it can be read: its torque (3,) N m, file axes, None where it is not known, and on-times, s.

    ``damps`` is whether the torque is more transverse to principal axis 3 than along it.
    """

    name: str
    torque: Vector | None
    damps: bool
    least: float
    most: float


def channel_facts(facts: Facts) -> list[ChannelFacts]:
    """The channels of the file, or its thrusters where it names none."""
    thrusters = {
        facts.text("thrusters", index, "name"): ("thrusters", index) for index, _ in facts.children("thrusters")
    }
    named = [
        (str(name), [entry.value for _, entry in node.children()]) for name, node in facts.children("channels")
    ] or [(name, [name]) for name in thrusters if name is not None]
    axis, found = spin_axis(facts), []
    for name, members in named:
        paths: list[KeyPath] = [thrusters[one] for one in members if one in thrusters]
        torques = [torque_of(facts, path) for path in paths]
        total = None if None in torques else np.sum([one[0] for one in torques if one is not None], axis=0)
        along = 0.0 if total is None else abs(float(total @ axis))
        damps = total is not None and norm(total - (total @ axis) * axis) > along
        times = [on_times_of(facts, path) for path in paths]
        least, most = max((one for one, _ in times), default=0.0), min((one for _, one in times), default=math.inf)
        found.append(ChannelFacts(name, total, damps, least, most))
    return found


def _thresholds(facts: Facts) -> Iterator[Finding]:
    start = facts.number("angle", "loop", "start")
    stop = facts.number("angle", "loop", "stop")
    if start is not None and stop is not None and stop >= start > 0.0:
        problem = f"{math.degrees(stop):g} deg is not below start; expected less than {math.degrees(start):g} deg"
        yield Finding(("loop", "stop"), problem)


def _sensor(facts: Facts) -> Iterator[Finding]:
    kind = facts.text(*SENSOR, "kind")
    scale = facts.number("ratio", *SENSOR, "scale")
    if scale == 0.0:
        yield Finding((*SENSOR, "scale"), "zero: the sensor shows nothing; expected about 100 %")
    elif scale is not None and not SCALES[0] <= abs(scale) <= SCALES[1]:
        allowed = f"{100.0 * SCALES[0]:g} % to {100.0 * SCALES[1]:g} %, or the same below zero"
        yield Finding((*SENSOR, "scale"), f"{100.0 * scale:g} % is no scale of a sensor; expected {allowed}")
    if not facts.has(*SENSOR, "rate"):
        for key in ("noise", "quantisation", "low_pass"):
            if facts.has(*SENSOR, key):
                yield Finding((*SENSOR, key), "applies to samples: it needs rate, such as rate: 100 Hz", True)
    if kind == "accelerometer":
        for key in ("rate", "position"):
            if not facts.has(*SENSOR, key):
                what = "samples, of which a sine is made" if key == "rate" else "where it is, from the centre of mass"
                yield Finding((*SENSOR, key), f"missing; an accelerometer needs {key}: {what}")
    elif kind == "gyro":
        for key in ("position", "axis"):
            if facts.has(*SENSOR, key):
                yield Finding((*SENSOR, key), "is for kind: accelerometer; a gyro measures the same everywhere", True)
    axis = facts.vector("number", 3, *SENSOR, "axis")
    if axis is not None and not axis.any():
        yield Finding((*SENSOR, "axis"), "zero; expected a direction, such as [0, 0, 1]")
    yield from _units(facts, kind)


def _units(facts: Facts, kind: str | None) -> Iterator[Finding]:
    """Quantities in the unit of the other sensor."""
    wrong = {"gyro": "acceleration", "accelerometer": "rate"}.get(kind or "")
    right = {"gyro": "a gyro: rad/s, deg/s or rpm", "accelerometer": "an accelerometer: m/s^2"}.get(kind or "")
    for key in ("noise", "bias", "quantisation"):
        text = facts.text(*SENSOR, key)
        if wrong is not None and text is not None and facts.number(wrong, *SENSOR, key) is not None:
            yield Finding((*SENSOR, key), f"{shown(text)} is not in a unit of {right}")


def _channels(facts: Facts) -> Iterator[Finding]:
    """Whether something can be fired, for as long as the law says, and whether it is there."""
    known = channel_facts(facts)
    law, on_time = facts.text("loop", "law"), facts.number("time", "loop", "on_time")
    if not known:
        problem = "needs channels to fire: thrusters with a torque across axis 3"
        yield Finding(("loop",), problem, True)
    elif all(one.torque is not None for one in known) and not any(one.damps for one in known):
        problem = "no channel has a torque more transverse than axial, so none can damp a nutation"
        yield Finding(("loop",), problem, True)
    if law == "bang" and not facts.has("loop", "on_time"):
        yield Finding(("loop", "on_time"), "missing; the law bang fires pulses of this length")
    if law == "one-pulse" and facts.has("loop", "on_time"):
        yield Finding(("loop", "on_time"), "is for four-pulse and bang; one-pulse fires for as long as it takes", True)
    elif on_time is not None:
        for one in known:
            if not one.least <= on_time <= one.most:
                problem = f"{on_time:g} s is outside what {one.name} allows: {span(one.least, one.most, 's')}"
                yield Finding(("loop", "on_time"), problem)
    names, before = [one.name for one in known], set()
    for index, node in facts.children("loop", "faults", "reversed"):
        path: KeyPath = ("loop", "faults", "reversed", index)
        if node.value in before:
            yield Finding(path, f"{shown(node.value)} is named twice; expected each channel once")
        before.add(node.value)
        if isinstance(node.value, str) and node.value not in names:
            yield Finding(path, f"no channel is called {shown(node.value)}; {instead(node.value, names)}")


def _sampling(facts: Facts, rate: float) -> Iterator[Finding]:
    """Too few samples for a nutation ``rate`` (rad/s) in the body."""
    given, alias = facts.number("frequency", *SENSOR, "rate"), facts.root.get("loop", "alias")
    least = SAMPLES * rate / (2.0 * math.pi)
    if given is not None and 0.0 < given < least and (alias is None or alias.value is not True):
        problem = f"{given:g} Hz is below four times the nutation frequency; expected at least {least:.4g} Hz"
        yield Finding((*SENSOR, "rate"), f"{problem}, or alias: true beside start")
    most = MOST_SAMPLES * rate / (2.0 * math.pi)
    if given is not None and given > most:
        problem = f"{given:g} Hz is more than a million samples a nutation period of {2.0 * math.pi / rate:.4g} s"
        problem += f"; expected at most {most:.4g} Hz"
        yield Finding((*SENSOR, "rate"), f"{problem}, or no rate for a continuous signal")


def _lags(facts: Facts, period: float) -> Iterator[Finding]:
    """Times after which what the sensor shows is of no use; ``period`` s is that of the nutation in the body."""
    lags = ((*SENSOR, "delay"), (*SENSOR, "low_pass"), ("loop", "settle"))
    for path, most in (*((path, LATE) for path in lags), (("loop", "min_interval"), LONGEST_WAIT)):
        value = facts.number("time", *path)
        if value is not None and value > most * period:
            problem = f"{value:g} s is {value / period:.3g} nutation periods; expected at most {most:g}"
            yield Finding(path, f"{problem} of them, {most * period:.4g} s")


def _accelerometer(facts: Facts, inertia: Inertia) -> Iterator[Finding]:
    """An accelerometer that shows nothing of the nutation."""
    from nutdamp.control_loop.sensor import is_blind  # few files have one

    position, axis = _mounting(facts, inertia)
    if facts.text(*SENSOR, "kind") != "accelerometer" or position is None or axis is None:
        return
    if math.hypot(*position) > FARTHEST:
        problem = f"{math.hypot(*position):.4g} m from the centre of mass; expected at most {FARTHEST:g} m"
        yield Finding((*SENSOR, "position"), problem)
    if not is_blind(inertia.moments, position, axis):
        return
    if inertia.symmetric and inertia.C == 2.0 * inertia.A and abs(axis[2]) > 1.0 - 1e-9:
        problem = "blind: along axis 3 it shows r ω1 ω3 (1 + a), which is nothing at C = 2A, where a = -1"
        yield Finding((*SENSOR, "kind"), f"{problem}; measure across axis 3, off its plane")
    else:
        problem = "blind: here it shows nothing of the nutation; move it off axis 3, or turn its axis"
        yield Finding((*SENSOR, "position"), problem)


def _mounting(facts: Facts, inertia: Inertia) -> tuple[Vector | None, Vector | None]:
    """Position (3,) m and unit axis (3,) of an accelerometer in principal axes."""
    position = facts.vector("length", 3, *SENSOR, "position")
    axis = facts.vector("number", 3, *SENSOR, "axis") if facts.has(*SENSOR, "axis") else np.array([0.0, 0.0, 1.0])
    if axis is not None:
        axis = inertia.axes.T @ (axis / math.hypot(*axis)) if axis.any() else None
    return None if position is None else inertia.axes.T @ position, axis


def _seen(facts: Facts, inertia: Inertia, spin: float) -> Iterator[Finding]:
    """Noise, steps and bias in which the start threshold is lost."""
    start, kind = facts.number("angle", "loop", "start"), facts.text(*SENSOR, "kind")
    if start is None or not 0.0 < start < 0.5 * math.pi or kind not in ("gyro", "accelerometer"):
        return
    size = inertia.C * abs(spin) / inertia.A * math.tan(start)
    if kind == "accelerometer":
        from nutdamp.control_loop.sensor import gain

        position, axis = _mounting(facts, inertia)
        if position is None or axis is None:
            return
        size *= abs(spin) * math.hypot(*gain(inertia.moments, position, axis))
        if size == 0.0:
            return
    quantity = "rate" if kind == "gyro" else "acceleration"
    # The offset of an accelerometer is fitted, and does not matter.
    shares = {(*SENSOR, "noise"): 1.0, (*SENSOR, "quantisation"): 2.0}
    biases: list[KeyPath] = [(*SENSOR, "bias"), *(("dispersions", "sensor_bias", one) for one in KINDS)]
    for path, share in (*shares.items(), *((path, 1.0 if kind == "gyro" else LARGEST_BIAS / size) for path in biases)):
        value = facts.number(quantity, *path)
        if value is None or abs(value) <= share * size or (value < 0.0 and path in shares):
            continue
        unit, scale = _unit_of(facts.text(*path)) if kind == "gyro" else ("m/s^2", 1.0)
        most = f"{share * size / scale:.4g} {unit}"
        if kind == "gyro" or path in shares:
            problem = f"{value / scale:.4g} {unit} hides start, which shows as {size / scale:.4g} {unit}"
        else:
            problem = f"{value:.4g} {unit} is no bias of an accelerometer"
        yield Finding(path, f"{problem}; expected at most {most}")


def _unit_of(text: str | None) -> tuple[str, float]:
    """The unit of an angular rate as it is written, and its size in rad/s."""
    written = (text or "").rpartition(" ")[2]
    return (written, UNITS["rate"].factors[written]) if written in UNITS["rate"].factors else ("rad/s", 1.0)
