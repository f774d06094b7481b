"""Constraints between the keys of thrusters, channels, valves, cold nozzles and the tank."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from nutdamp.errors import nearest
from nutdamp.files.fields import SMALLEST, KeyPath
from nutdamp.files.rules import CANCELLED, Facts, Finding, Vector, force_vector, norm, principal_of
from nutdamp.files.study_keys import VALVE_TIMES, thrust_behind
from nutdamp.files.yaml import Node
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.units import bar, shown


def _thruster(facts: Facts, path: KeyPath) -> Iterator[Finding]:
    needed, torque_path = ("position", "direction", "force"), (*path, "torque")
    mounting = [key for key in needed if facts.has(*path, key)]
    given, either = " and ".join(mounting), "torque, or position, direction and force"
    if mounting and facts.has(*torque_path):
        yield Finding(torque_path, f"given together with {given}; keep either {either}", True)
    elif not mounting and not facts.has(*torque_path):
        yield Finding(torque_path, f"missing; give {either}")
    for key in needed if mounting and not facts.has(*torque_path) else ():
        if key not in mounting:
            yield Finding((*path, key), f"missing; {given} alone cannot give a torque")
    if mounting and facts.has(*path, "lever_arm"):
        yield Finding((*path, "lever_arm"), "goes with torque only; leave it out, position gives the arm", True)
    direction = facts.vector("number", 3, *path, "direction")
    if direction is not None and norm(direction) < SMALLEST:
        yield Finding((*path, "direction"), "zero; expected a direction, such as [1, 0, 0]")
    elif (torque := torque_of(facts, path)) is not None and norm(torque[0]) <= max(SMALLEST, CANCELLED * torque[1]):
        if facts.has(*torque_path):
            yield Finding(torque_path, "zero; expected at least one component other than 0")
        else:
            cure = "the force passes through the centre of mass; move or turn the thruster"
            yield Finding((*path, "position"), f"no torque: {cure}")
    least, most = on_times_of(facts, path)
    if least > most:
        yield Finding((*path, "min_on_time"), f"{least:g} s exceeds max_on_time; expected at most {most:g} s")


def torque_of(facts: Facts, path: KeyPath) -> tuple[Vector, float] | None:
    """Torque of a thruster, and the magnitude that its rounding goes by; None where it cannot be read."""
    torque = facts.vector("torque", 3, *path, "torque")
    if torque is not None:
        return torque, norm(torque)
    position = facts.vector("length", 3, *path, "position")
    direction = facts.vector("number", 3, *path, "direction")
    force = facts.number("force", *path, "force")
    if position is None or direction is None or not force or norm(direction) < SMALLEST:
        return None
    center = facts.vector("length", 3, "center_of_mass")
    arm = position if center is None else position - center
    return np.cross(arm, force_vector(direction, force)), norm(position) * abs(force)


def on_times_of(facts: Facts, path: KeyPath) -> tuple[float, float]:
    """min_on_time and max_on_time in s; 0 and infinite where they are left out or cannot be read."""
    most = facts.number("time", *path, "max_on_time")
    return facts.number("time", *path, "min_on_time") or 0.0, math.inf if most is None else most


def _channels(facts: Facts) -> Iterator[Finding]:
    paths = {facts.text(*path, "name"): path for path in facts.below("thrusters")}
    names = [name for name in paths if name is not None]
    for path in facts.below("channels"):
        members: set[KeyPath] = set()
        entries = facts.below(*path)
        for entry in entries:
            name = facts.text(*entry)
            if name is not None and name not in paths:
                yield Finding(entry, f"no thruster is called {shown(name)}; {instead(name, names)}")
            elif name is not None and paths[name] in members:
                yield Finding(entry, f"{shown(name)} is listed twice in this channel; expected once")
            elif name is not None:
                members.add(paths[name])
        if members and len(members) == len(entries):
            times = [on_times_of(facts, member) for member in members]
            least, most = max(shortest for shortest, _ in times), min(longest for _, longest in times)
            if least > most and all(shortest <= longest for shortest, longest in times):
                problem = f"min_on_time of one thruster, {least:g} s, exceeds max_on_time of another, {most:g} s"
                yield Finding(path, f"{problem}; let them fire in channels of their own")


def instead(name: str, names: list[str]) -> str:
    """The thruster that was meant, or all there are."""
    few = names[:20]  # to look for the nearest of very many takes long
    close = nearest(name, few)
    if close is not None:
        return f"did you mean {shown(close)}?"
    return f"there are {', '.join(map(shown, few))}{' …' * (names != few)}" if names else "the file has none"


def thrusts(facts: Facts) -> dict[str, float | None]:
    """The thrust in N of each thruster of the file and its torquer; None where it is not known."""
    forces: dict[str, float | None] = {}
    for path in facts.below("thrusters"):
        if (name := facts.text(*path, "name")) is not None:
            torque = facts.vector("torque", 3, *path, "torque")
            size = None if torque is None else float(np.linalg.norm(torque))
            lever = facts.number("length", *path, "lever_arm") or None
            forces[name] = facts.number("force", *path, "force") or thrust_behind(size, lever)
    if facts.has("steerable") or not facts.children("thrusters"):
        lever = facts.number("length", "steerable", "lever_arm") or None
        forces[STEERABLE] = thrust_behind(facts.number("torque", "steerable", "torque"), lever)
    return forces


def thrust_findings(root: Node) -> Iterator[Finding]:
    """All faults of thrusters, channels, ``valve``, ``impulse_bit``, ``cold`` and ``tank``."""
    facts = Facts(root)
    thrusters = facts.below("thrusters")
    for path in thrusters:
        if facts.is_mapping(*path):
            yield from _thruster(facts, path)
    yield from _channels(facts)
    for key in ("valve", "cold", "tank"):
        if facts.has(key) and not thrusters:
            yield Finding((key,), "applies to thrusters, and the file has none; leave it out", True)
    named, reported = thrusts(facts), set[KeyPath]()
    for path in thrusters:
        if facts.has(*path, "valve") and facts.has(*path, "impulse_bit"):
            yield Finding((*path, "impulse_bit"), "given together with valve; keep one of the two", True)
        valve = _valve_path(facts, path)
        if valve is not None:
            for finding in (each for each in _opens(facts, path, valve) if each.path not in reported):
                yield finding
                reported.add(finding.path)
        elif facts.has(*path, "impulse_bit"):
            yield from _table(facts, path, named.get(facts.text(*path, "name") or ""))
    yield from _alike(facts, named)
    if facts.has("tank") and thrusters:
        yield from _tank(facts, named)


def _valve_path(facts: Facts, path: KeyPath) -> KeyPath | None:
    """Path of the valve of a thruster: its own, or that of all."""
    if facts.has(*path, "valve"):
        return (*path, "valve")
    return ("valve",) if facts.has("valve") and not facts.has(*path, "impulse_bit") else None


def _opens(facts: Facts, path: KeyPath, valve: KeyPath) -> Iterator[Finding]:
    opened, closed = (facts.number("time", *valve, key) or 0.0 for key in VALVE_TIMES[:2])
    longest = on_times_of(facts, path)[1] + closed
    if facts.text(*valve, "on_time_is") != "effective" and longest <= opened:
        name = facts.text(*path, "name") or "a thruster"
        problem = f"{opened:g} s is not less than max_on_time + close_delay = {longest:g} s of {name}: its valve closes"
        yield Finding((*valve, "open_delay"), f"{problem} before it opens, and no command gives thrust")


def _table(facts: Facts, path: KeyPath, thrust: float | None) -> Iterator[Finding]:
    table: KeyPath = (*path, "impulse_bit")
    kinds = ("time", "impulse", "time")
    rows = [[facts.number(kind, *row, column) for column, kind in enumerate(kinds)] for row in facts.below(*table)]
    rising = "expected rows with rising on-times and impulses"
    columns = (
        ("on-time", "s", "not above", rising),
        ("impulse", "N s", "not above", rising),
        ("centroid", "s", "before", "expected one not earlier"),
    )
    for number, (before, row) in enumerate(pairwise(rows), start=1):
        for column, (what, unit, wrong, cure) in enumerate(columns):
            value, last = row[column], before[column]
            if value is not None and last is not None and (value < last or (column < 2 and value == last)):
                problem = f"{what} {value:g} {unit} is {wrong} that of the row before, {last:g} {unit}; {cure}"
                yield Finding((*table, number, column), problem)
    if thrust is None:
        if not facts.has(*path, "force") and not facts.has(*path, "lever_arm"):  # else it is reported already
            yield Finding(table, "needs the thrust; give lever_arm", True)
        return
    for number, (on_time, impulse, centroid) in enumerate(rows):
        if on_time is None or impulse is None or centroid is None:
            continue
        lasts = impulse / thrust
        if centroid < 0.5 * lasts:
            problem = (
                f"{centroid:g} s is too early: {impulse:g} N s take {lasts:g} s at {thrust:g} N, so that the thrust"
            )
            cure = f"would begin before the command; expected at least {0.5 * lasts:g} s"
            yield Finding((*table, number, 2), f"{problem} {cure}")
    first, last = (rows[0][0], rows[-1][0]) if rows else (None, None)
    least, most = (facts.number("time", *path, key) for key in ("min_on_time", "max_on_time"))
    if last is not None and least is not None and least >= last:
        yield Finding((*path, "min_on_time"), f"{least:g} s is not below the last on-time of impulse_bit, {last:g} s")
    if first is not None and most is not None and most <= first:
        yield Finding((*path, "max_on_time"), f"{most:g} s is not above the first on-time of impulse_bit, {first:g} s")


def _alike(facts: Facts, named: dict[str, float | None]) -> Iterator[Finding]:
    """Thrusters of one channel that make different pulses of a command; ``named`` are their thrusts, N."""
    entries = {facts.text(*path, "name"): path for path in facts.below("thrusters")}
    kinds = {name: _kind(facts, path, named.get(name or "")) for name, path in entries.items()}
    for channel, node in facts.children("channels"):
        listed = [entry.value for _, entry in node.children() if isinstance(entry.value, str)]
        members = [name for name in listed if name in kinds]
        other = next((name for name in members if kinds[name] != kinds[members[0]]), None)
        if other is not None:
            problem = f"{members[0]} and {other} make different pulses of a command, by valve or impulse_bit"
            yield Finding(("channels", channel), f"{problem}; let them fire in channels of their own")


def _tank(facts: Facts, named: dict[str, float | None]) -> Iterator[Finding]:
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
    problem = "missing; tank needs to know the propellant that is used"
    for path in facts.below("thrusters"):
        if not facts.has("tank", "isp") and not facts.has(*path, "isp"):
            yield Finding((*path, "isp"), f"{problem}, by isp here or in tank")
        if named.get(facts.text(*path, "name") or "", 0.0) is None and not facts.has(*path, "force"):
            yield Finding((*path, "lever_arm"), f"{problem}, and so the thrust")


def _emptied(facts: Facts, propellant: float) -> Iterator[Finding]:
    """Moments of inertia that no body can have once all ``propellant`` kg are used."""
    path: KeyPath = ("tank", "inertia_per_kg")
    principal, rows = principal_of(facts), facts.vector("shed", 3, *path)
    transverse, axial = (facts.number("shed", *path, key) for key in "AC")
    if rows is None and transverse is not None and axial is not None:
        rows = np.array([transverse, transverse, axial])
    if principal is None or rows is None or rows.min() < 0.0:
        return  # what cannot be read, or is out of range, is reported already
    moments = np.asarray(principal[0])
    empty = moments - propellant * rows
    leaves = f"leaves {', '.join(f'{moment:.4g}' for moment in empty)} kg m^2 once {propellant:g} kg are used"
    least, middle, largest = np.sort(empty).tolist()
    if least <= 0.0:
        worst = moments[np.argmax(rows / moments)]
        most = f"expected less than {worst / propellant:.4g} kg m^2/kg of the moment {worst:g} kg m^2"
        yield Finding(path, f"{leaves}, all must be above 0; {most}")
    elif empty[2] == middle and least < middle < largest:
        problem = "the moment about axis 3 is the middle one, about which a spin is unstable"
        yield Finding(path, f"{leaves}: {problem}; expected the largest or the least")
    elif largest > (least + middle) * (1.0 + 1e-9):
        problem = "the largest exceeds the sum of the others, which no body has"
        yield Finding(path, f"{leaves}: {problem}; expected less off the smaller ones, or more off it")


def _kind(facts: Facts, path: KeyPath, thrust: float | None) -> tuple[float | str | None, ...]:
    """Effect of a command on a thruster of ``thrust`` N, to be compared."""
    valve = _valve_path(facts, path)
    if valve is not None:
        times = tuple(facts.number("time", *valve, key) or 0.0 for key in VALVE_TIMES)
        return (*times, facts.text(*valve, "on_time_is") or "command")
    cells: list[float | str | None] = []
    for row in facts.below(*path, "impulse_bit"):
        impulse = facts.number("impulse", *row, 1)
        cells += [facts.number("time", *row, column) for column in (0, 2)]
        cells.append(None if impulse is None else round(impulse / (thrust or math.inf), 12))
    return tuple(cells) if cells else (*(0.0,) * len(VALVE_TIMES), "command")
