"""Numbers without a unit that are hardly what was meant, with the unit that was: for warnings."""

from __future__ import annotations

import math
from collections.abc import Iterator

from nutdamp.files.facts import Facts, Finding
from nutdamp.files.rules import spin_of
from nutdamp.files.yaml_tree import KeyPath, Node
from nutdamp.units import KINDS

FAR = 50.0
"""m; few spacecraft reach further from their centre of mass, and many a drawing counts in mm."""

FAST = 100.0
"""rad/s; no spacecraft spins faster."""

FAST_AND_WHOLE = 20.0
"""rad/s; from here on (191 rpm) a whole number is more likely one of rpm."""

ANGLES: tuple[KeyPath, ...] = (("state", "phase"), ("goal", "azimuth"), ("goal", "right_ascension"))
"""Angles that may be of any size; the others are refused where they are too large, with a hint."""


def doubts(root: Node) -> Iterator[Finding]:
    """Numbers that are beyond what can be meant in SI."""
    facts = Facts(root)
    for path in ANGLES:
        value = _bare(facts, path)
        if value is not None and abs(value) > 2.0 * math.pi:
            yield _doubt(path, value, "angle", "deg")
    for path in _lengths(facts):
        value = _bare(facts, path)
        if value is not None and abs(value) > FAR:
            yield _doubt(path, value, "length", "mm")
    yield from _rates(facts)
    yield from _shortest_firings(facts)


def _bare(facts: Facts, path: KeyPath) -> float | None:
    """The finite number at ``path``; None where there is none, or a text with a unit."""
    node = facts.root.get(*path)
    value = None if node is None else node.value
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return value


def _doubt(path: KeyPath, value: float, kind: str, meant: str) -> Finding:
    unit = KINDS[kind].si
    problem = f"{value} is read as {value} {unit}; write {value} {meant} if that is meant, else {value} {unit}"
    return Finding(path, problem)


def _lengths(facts: Facts) -> Iterator[KeyPath]:
    for index, _ in facts.children("thrusters"):
        yield ("thrusters", index, "lever_arm")
        for axis, _ in facts.children("thrusters", index, "position"):
            yield ("thrusters", index, "position", axis)
    yield ("steerable", "lever_arm")


def _rates(facts: Facts) -> Iterator[Finding]:
    rates: list[tuple[KeyPath, str]] = [(("state", "spin"), "rpm"), (("goal", "spin"), "rpm")]
    rates += [(("omega0", axis), "deg/s") for axis, _ in facts.children("omega0")]
    for path, meant in rates:
        value = _bare(facts, path)
        if value is not None and abs(value) > (FAST_AND_WHOLE if value == int(value) else FAST):
            yield _doubt(path, value, "rate", meant)


def _shortest_firings(facts: Facts) -> Iterator[Finding]:
    """Shortest on-times of more than a spin turn, within which the torque would cancel itself."""
    spin = spin_of(facts)
    for index, _ in facts.children("thrusters"):
        path = ("thrusters", index, "min_on_time")
        value = _bare(facts, path)
        if value is not None and spin is not None and value * abs(spin) > 2.0 * math.pi:
            yield _doubt(path, value, "time", "ms")
