"""What must hold between the keys of a spacecraft file that say what thrusters make of commands."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from nutdamp.files.dispersion_models import VALVE_TIMES
from nutdamp.files.dispersion_rules import moments_of, thrusts
from nutdamp.files.facts import Facts, Finding
from nutdamp.files.yaml_tree import KeyPath, Node
from nutdamp.units import bar

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
