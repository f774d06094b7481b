"""What must hold between the keys of thrusters and channels of a spacecraft file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from nutdamp.errors import nearest
from nutdamp.files.facts import Facts, Finding
from nutdamp.files.fields import SMALLEST
from nutdamp.files.yaml_tree import KeyPath
from nutdamp.units import shown

Vector = NDArray[np.float64]

CANCELLED = 1e-12
"""A sum that is smaller than its terms by this factor is rounding; it counts as zero."""


def norm(vector: Vector) -> float:
    """Length of a vector, without the underflow of squares."""
    return math.hypot(*vector)


def force_vector(direction: Iterable[float], force: float) -> Vector:
    """Force in N along ``direction``, which need not have length one."""
    components = tuple(direction)
    return np.array([part / math.hypot(*components) * force for part in components])


_MOUNTING = ("position", "direction", "force")


def thrusters(facts: Facts) -> Iterator[Finding]:
    """What is wrong with each of the ``thrusters``."""
    for index, node in facts.children("thrusters"):
        if isinstance(node.value, dict):
            yield from _thruster_keys(facts, ("thrusters", index))
            yield from _thruster_values(facts, ("thrusters", index))


def _thruster_keys(facts: Facts, path: KeyPath) -> Iterator[Finding]:
    mounting = [key for key in _MOUNTING if facts.has(*path, key)]
    given = " and ".join(mounting)
    if facts.has(*path, "torque"):
        if mounting:
            problem = f"given together with {given}; keep either torque, or position, direction and force"
            yield Finding((*path, "torque"), problem, True)
    elif not mounting:
        yield Finding((*path, "torque"), "missing; give torque, or position, direction and force")
    else:
        for key in _MOUNTING:
            if key not in mounting:
                yield Finding((*path, key), f"missing; {given} alone cannot give a torque")
    if mounting and facts.has(*path, "lever_arm"):
        yield Finding((*path, "lever_arm"), "goes with torque only; leave it out, position gives the arm", True)


def _thruster_values(facts: Facts, path: KeyPath) -> Iterator[Finding]:
    direction = facts.vector("number", 3, *path, "direction")
    if direction is not None and norm(direction) < SMALLEST:
        yield Finding((*path, "direction"), "zero; expected a direction, such as [1, 0, 0]")
    elif _is_none(torque_of(facts, path)):
        if facts.has(*path, "torque"):
            yield Finding((*path, "torque"), "zero; expected at least one component other than 0")
        else:
            problem = "no torque: the force passes through the centre of mass; move or turn the thruster"
            yield Finding((*path, "position"), problem)
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
    return np.cross(position, force_vector(direction, force)), norm(position) * abs(force)


def _is_none(torque: tuple[Vector, float] | None) -> bool:
    """Whether a torque is zero but for rounding; False where it is not known."""
    return torque is not None and norm(torque[0]) <= max(SMALLEST, CANCELLED * torque[1])


def on_times_of(facts: Facts, path: KeyPath) -> tuple[float, float]:
    """min_on_time and max_on_time in s; 0 and infinite where they are left out or cannot be read."""
    least = facts.number("time", *path, "min_on_time")
    most = facts.number("time", *path, "max_on_time")
    return (0.0 if least is None else least), (math.inf if most is None else most)


def channels(facts: Facts) -> Iterator[Finding]:
    """What is wrong with the ``channels``: thrusters that fire together."""
    indices = {facts.text("thrusters", index, "name"): index for index, _ in facts.children("thrusters")}
    names = [name for name in indices if name is not None]
    for channel, node in facts.children("channels"):
        path = ("channels", channel)
        members: set[KeyPath] = set()
        for index, entry in node.children():
            name = entry.value
            if not isinstance(name, str):
                continue
            if name not in indices:
                yield Finding((*path, index), f"no thruster is called {shown(name)}; {instead(name, names)}")
            elif (member := ("thrusters", indices[name])) in members:
                yield Finding((*path, index), f"{shown(name)} is listed twice in this channel; expected once")
            else:
                members.add(member)
        if members and len(members) == len(list(node.children())):
            yield from _channel_values(facts, path, members)


def instead(name: str, names: list[str]) -> str:
    """The thruster that was meant, or all there are."""
    few = names[:20]  # to look for the nearest of very many takes long
    close = nearest(name, few)
    if close is not None:
        return f"did you mean {shown(close)}?"
    return f"there are {', '.join(map(shown, few))}{' …' * (names != few)}" if names else "the file has none"


def _channel_values(facts: Facts, path: KeyPath, members: set[KeyPath]) -> Iterator[Finding]:
    times = [on_times_of(facts, member) for member in members]
    least, most = max(shortest for shortest, _ in times), min(longest for _, longest in times)
    if least > most and all(shortest <= longest for shortest, longest in times):
        problem = f"min_on_time of one thruster, {least:g} s, exceeds max_on_time of another, {most:g} s"
        yield Finding(path, f"{problem}; let them fire in channels of their own")
