"""Constraints between the keys of thrusters, channels and the tank that no row of a table says."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from nutdamp.errors import nearest
from nutdamp.files.fields import SMALLEST, KeyPath
from nutdamp.files.rules import (
    CANCELLED,
    Facts,
    Finding,
    Vector,
    force_vector,
    moments_fault,
    norm,
    principal_of,
)
from nutdamp.files.study_keys import thrust_behind
from nutdamp.files.yaml import Node
from nutdamp.spacecraft.schedule import STEERABLE
from nutdamp.units import shown


def torque_of(facts: Facts, path: KeyPath) -> tuple[Vector, float] | None:
    """Torque of a thruster, and the magnitude that its rounding goes by; None where it cannot be
    read.
    """
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
    """min_on_time and max_on_time in s;
    0 and infinite where they are left out or cannot be read.
    """
    most = facts.number("time", *path, "max_on_time")
    return facts.number("time", *path, "min_on_time") or 0.0, math.inf if most is None else most


def instead(name: str, names: list[str]) -> str:
    """The thruster that was meant, or all there are."""
    few = names[:20]  # to look for the nearest of very many takes long
    close = nearest(name, few)
    if close is not None:
        return f"did you mean {shown(close)}?"
    return (
        f"there are {', '.join(map(shown, few))}{' …' * (names != few)}"
        if names
        else "the file has none"
    )


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
    """Faults of thrusters, channels and the tank beside those of the table."""
    facts = Facts(root)
    for path in facts.below("thrusters"):
        torque = None if facts.has(*path, "torque") else torque_of(facts, path)
        if torque is not None and norm(torque[0]) <= CANCELLED * torque[1]:
            cure = "the force passes through the centre of mass; move or turn the thruster"
            yield Finding((*path, "position"), f"no torque: {cure}")
    paths = {facts.text(*path, "name"): path for path in facts.below("thrusters")}
    names = [name for name in paths if name is not None]
    for path in facts.below("channels"):
        valves = []
        for entry in facts.below(*path):
            name = facts.text(*entry)
            if name in paths:
                nodes = [facts.root.get(*paths[name], key) for key in ("valve", "impulse_bit")]
                valves.append([None if node is None else node.plain() for node in nodes])
            elif name is not None:
                yield Finding(entry, f"no thruster is called {shown(name)}; {instead(name, names)}")
        # A channel has one valve, so that thrusters with another one would not fire as planned.
        if any(valve != valves[0] for valve in valves):
            problem = "its thrusters do not have the same valve or impulse_bit"
            yield Finding(path, f"{problem}; write them alike, or use channels of their own")
    # A tank, or a table of impulses, is of no use without these.
    problem = "missing; tank needs to know the propellant that is used"
    forces = thrusts(facts)
    for path in facts.below("thrusters"):
        thrust = forces.get(facts.text(*path, "name") or "", 0.0)
        unknown = thrust is None and not facts.has(*path, "force")
        if facts.has("tank") and not facts.has("tank", "isp") and not facts.has(*path, "isp"):
            yield Finding((*path, "isp"), f"{problem}, by isp here or in tank")
        if facts.has("tank") and unknown:
            yield Finding((*path, "lever_arm"), f"{problem}, and so the thrust")
        if facts.has(*path, "impulse_bit") and unknown:
            yield Finding((*path, "impulse_bit"), "needs the thrust; give lever_arm", True)
    # Once all propellant is used, the moments must be those of a body.
    path = ("tank", "inertia_per_kg")
    propellant = facts.number("mass", "tank", "propellant")
    principal = principal_of(facts)
    rows = facts.vector("shed", 3, *path)
    transverse, axial = (facts.number("shed", *path, key) for key in "AC")
    if rows is None and transverse is not None and axial is not None:
        rows = np.array([transverse, transverse, axial])
    if propellant is None or principal is None or rows is None:
        return
    fault = moments_fault(np.asarray(principal[0]) - propellant * rows)
    if fault is not None:
        yield Finding(path, f"once {propellant:g} kg are used it leaves {fault}")
